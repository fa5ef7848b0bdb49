#!/usr/bin/env bash
# Installs what is missing, builds the ci preset (warnings are errors) and runs all tests: unit, GL on a software
# renderer, headless end to end, and the window under Xvfb. Arguments go to ctest (for example: ./test.sh -R mesh).
# They run side by side, those of the window alone.
source "$(dirname "${BASH_SOURCE[0]}")/cmake/setup.sh"
install_packages
build_preset ci
exec ctest --preset ci -j"$(nproc)" "$@"
