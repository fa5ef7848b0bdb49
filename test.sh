#!/usr/bin/env bash
# Installs what is missing, builds the ci preset (warnings are errors) and runs the tests: unit, GL on a software renderer,
# headless end to end, and the window under Xvfb.
#   ./test.sh [-y] [ARGUMENTS of ctest]         the short suite, for example ./test.sh -R mesh
#   ./test.sh [-y] --long [SEED] [ARGUMENTS]    all tests at their full length, with other random numbers for another SEED
# -y installs packages with sudo without asking. What passed of the long suite is not run again at the same commit and seed.
# When all has passed, docs/data/long-suite.json says so.
source "$(dirname "${BASH_SOURCE[0]}")/cmake/setup.sh"
yes=
if [[ ${1:-} == -y ]]; then yes=-y; shift; fi
install_packages test $yes
build_preset ci
if [[ ${1:-} == --long ]]; then
  shift
  source tests/long_suite.sh
  run_long_suite "$@"
else
  exec ctest --preset ci -j"$(($(nproc) + 1))" "$@"  # one more, because tests of the window mostly wait
fi
