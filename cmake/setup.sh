# Sourced by run.sh and test.sh: installs missing Debian packages, then builds one CMake preset.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# install_packages run|test [-y]: `run` takes what building and running need, `test` all of cmake/packages.txt. Asks before it
# uses sudo, unless -y says yes to that.
install_packages() {
  local purpose=$1 yes=${2:-} missing=() package mark
  command -v dpkg-query >/dev/null && command -v apt-get >/dev/null ||
    { echo "tetpbd: not a Debian system: install by hand what cmake/packages.txt lists (docs/install.md)" >&2; return 0; }
  while read -r package mark _; do
    [[ -n $package && $package != \#* && ($purpose == test || $mark == "$purpose") ]] || continue
    dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing+=("$package")
  done <cmake/packages.txt
  [[ ${#missing[@]} -eq 0 ]] && return 0

  local by_hand="apt-get install --no-install-recommends ${missing[*]}" sudo=()
  echo "packages to install, with what they depend on: ${missing[*]}"
  if [[ $(id -u) -ne 0 ]]; then
    command -v sudo >/dev/null || { echo "tetpbd: no rights to install packages; ask an administrator for: $by_hand" >&2; exit 1; }
    if [[ $yes != -y ]]; then
      [[ -t 0 ]] || { echo "tetpbd: no terminal to ask in: give -y, or run first: sudo $by_hand" >&2; exit 1; }
      local answer
      read -rp "install them with sudo? [y/N] " answer || answer=
      [[ $answer == [yY]* ]] || { echo "tetpbd: nothing installed; when it suits you: sudo $by_hand" >&2; exit 1; }
    fi
    sudo=(sudo)
  fi
  "${sudo[@]}" apt-get update -qq &&
    "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null ||
    { echo "tetpbd: packages not installed; an administrator can: $by_hand" >&2; exit 1; }
}

build_preset() {
  cmake --preset "$1" >build_configure.log 2>&1 || { cat build_configure.log; rm -f build_configure.log; return 1; }
  rm -f build_configure.log
  cmake --build --preset "$1"
}
