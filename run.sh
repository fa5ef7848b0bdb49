#!/usr/bin/env bash
# Installs what is missing, builds the release preset and starts tetpbd with the arguments given here.
# Without arguments: a window where there is a display, else a headless run of the default scene into out/.
source "$(dirname "${BASH_SOURCE[0]}")/cmake/setup.sh"
install_packages
build_preset release
if [[ $# -eq 0 && -z ${DISPLAY:-} && -z ${WAYLAND_DISPLAY:-} ]]; then
  echo "no display: running bunny-drop headless; frames and statistics go to out/"
  exec build/release/tetpbd run --scene bunny-drop --steps 400 --png-every 40 --out out
fi
exec build/release/tetpbd "$@"
