#!/bin/sh
# Starts bin/tetpbd of this folder, wherever it lies. The machine's own libraries come first: its OpenGL driver needs them as new
# as they are. What the machine lacks or has too old, as the loader says, comes from lib/tetpbd/system.
here=$(readlink -f "$0")
here=${here%/*}
path=${LD_LIBRARY_PATH-}
for round in 1 2 3; do
  report=$(LD_LIBRARY_PATH=$path LD_TRACE_LOADED_OBJECTS=1 "$here/bin/tetpbd" 2>&1)
  more=
  for folder in "$here"/lib/tetpbd/system/*; do
    case $report in
      *"${folder##*/} => not found"* | *"/${folder##*/}: version "*) more=$folder${more:+:$more} ;;
    esac
  done
  [ -n "$more" ] || break
  path=$more${path:+:$path}
done
case $report in
  *"libc.so.6: version "* | *"libm.so.6: version "*)
    echo "tetpbd: the C library of this system is too old; Debian 12, Ubuntu 22.04 or newer have one that will do" >&2
    exit 1 ;;
  *"libGL.so.1 => not found"* | *"libEGL.so.1 => not found"*)
    echo "tetpbd: no OpenGL on this system: install the driver of your GPU, or Mesa (Debian: libegl1 libgl1 libgl1-mesa-dri)" >&2
    exit 1 ;;
  *"not found"*)
    echo "tetpbd: cannot start on this system:" >&2
    echo "$report" | grep "not found" >&2
    exit 1 ;;
esac
[ -z "$path" ] || export LD_LIBRARY_PATH="$path"
exec "$here/bin/tetpbd" "$@"
