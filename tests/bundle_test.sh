#!/usr/bin/env bash
# The archive of CPack runs in an empty folder, with an empty environment, and its checksum is right.
# Usage: bundle_test.sh BUILD_FOLDER FOLDER
set -euo pipefail
build=$1 folder=$2
fail() { echo "FAILED: $*" >&2; exit 1; }

rm -rf "$folder"
mkdir -p "$folder/unpacked"
cpack --config "$build/CPackConfig.cmake" -B "$folder/cpack" >"$folder/log.txt" || fail "no archive: $(tail -n 5 "$folder/log.txt")"
(cd "$folder/cpack" && sha256sum --quiet -c tetpbd-*.sha256) || fail "the checksum is not that of the archive"
tar -xzf "$folder"/cpack/tetpbd-*.tar.gz -C "$folder/unpacked"
cd "$folder"/unpacked/tetpbd-*
for file in tetpbd share/tetpbd/LICENSE share/tetpbd/CITATION.cff share/tetpbd/models/README.md share/tetpbd/licences/tetgen; do
  [[ -s $file ]] || fail "the archive has no $file"
done
version=$(env -i PATH=/usr/bin:/bin ./tetpbd --version)
grep -qx "version: $version" share/tetpbd/CITATION.cff || fail "CITATION.cff is of another version than $version"
env -i PATH=/usr/bin:/bin ./tetpbd info >info.txt || fail "no info"
grep -q "^models: *$PWD/share/tetpbd/models\$" info.txt || fail "other models than its own: $(grep ^models info.txt)"
# Fills the bunny with the archive's own TetGen: there is no cache, and PATH has no other before it.
env -i PATH=/usr/bin:/bin ./tetpbd run --scene bunny-drop --steps 2 --size 64x48 --png-every 2 --out out >run.txt 2>&1 || fail "no run: $(cat run.txt)"
grep -q '"finite": true' out/stats.json || fail "the run is not finite"
[[ -s out/frame_00002.png ]] || fail "no picture"
# Nothing but what is of the machine comes from outside.
LD_LIBRARY_PATH=$(printf '%s:' "$PWD"/lib/tetpbd/system/*) ldd bin/tetpbd | grep -v "$PWD" |
  grep -vE 'linux-vdso|ld-linux|lib(c|m|dl|rt|pthread|resolv)\.so|lib(GL|EGL|OpenGL|GLX|GLdispatch)\.so' >others.txt || true
[[ ! -s others.txt ]] || fail "libraries of this machine: $(cat others.txt)"
echo "bundle: $(du -h "$folder"/cpack/*.tar.gz | cut -f1), $(find lib -name '*.so*' | wc -l) libraries, licences of $(ls share/tetpbd/licences | wc -l)"
