#!/usr/bin/env bash
# Installs what is missing, builds the release preset and starts tetpbd with the arguments given here.
# Without arguments: a window where there is a display, else a headless run of the default scene into out/.
#   ./run.sh [-y] [ARGUMENTS of tetpbd]    -y installs packages with sudo without asking
source "$(dirname "${BASH_SOURCE[0]}")/cmake/setup.sh"
yes=
if [[ ${1:-} == -y ]]; then yes=-y; shift; fi
install_packages run $yes
build_preset release
if [[ $# -eq 0 && -z ${DISPLAY:-} && -z ${WAYLAND_DISPLAY:-} ]]; then
  echo "no display: running bunny-drop headless; frames and statistics go to out/"
  exec build/release/tetpbd run --scene bunny-drop --steps 400 --png-every 40 --out out
fi
exec build/release/tetpbd "$@"
