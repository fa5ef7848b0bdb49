#!/usr/bin/env bash
# Runs a script with the first Python that has these modules: where python3 is another than Debian's, that may be the second.
#   with_python.sh numpy,meshio SCRIPT ARGUMENTS
for python in python3 /usr/bin/python3; do
  "$python" -c "import $1" 2>/dev/null && exec "$python" "${@:2}"
done
echo "no python3 with $1 (on Debian: apt-get install python3-${1//,/ python3-})"
exit 1
