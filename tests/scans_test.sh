#!/usr/bin/env bash
# The table of scans: a cube with a triangle too few falls, what encloses nothing is refused in its row.
# Usage: scans_test.sh PROGRAM FOLDER
set -uo pipefail
program=$1 here=$(dirname "$(realpath "$0")") table=$2/scans.csv
rm -rf "$2" && mkdir -p "$2"
corners='v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n'
faces='f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8\n'
printf "$corners$faces" >"$2/open.obj"
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n' >"$2/flat.obj"
TETS=300 DURATION=0.05 "$here/scans.sh" "$program" "$table" "$2"/{open,flat}.obj || exit 1
grep -qE '^open\.obj,[23][0-9]{2},[0-9.]+(,[0-9.e-]+,0){3}$' "$table" && grep -q '^flat.obj,refused: .*encloses nothing' "$table" && exit 0
echo "FAILED:" >&2
cat "$table" >&2
exit 1
