# Sourced by run.sh and test.sh: installs missing Debian packages, then builds one CMake preset.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

install_packages() {
  command -v dpkg-query >/dev/null || { echo "tetpbd: not a Debian system: install what cmake/packages.txt lists by hand" >&2; return 0; }
  local missing=() package
  while read -r package; do
    [[ -z $package || $package == \#* ]] && continue
    dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing+=("$package")
  done <cmake/packages.txt
  [[ ${#missing[@]} -eq 0 ]] && return 0
  echo "installing: ${missing[*]}"
  local sudo=()
  [[ $(id -u) -eq 0 ]] || sudo=(sudo)
  "${sudo[@]}" apt-get update -qq
  DEBIAN_FRONTEND=noninteractive "${sudo[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
}

build_preset() {
  cmake --preset "$1" >build_configure.log 2>&1 || { cat build_configure.log; rm -f build_configure.log; return 1; }
  rm -f build_configure.log
  cmake --build --preset "$1"
}
