#!/usr/bin/env bash
# What becomes of surfaces as people bring them: fills each with a lattice, drops it 1 m in three stiffnesses, and
# writes a table.
# Usage: scans.sh PROGRAM TABLE.csv SURFACE...
# Bodies are 20 cm high, of 15000 tets (TETS), and fall for 3 s (DURATION); a run of more than two minutes (LIMIT, in
# s) is called too slow.
set -uo pipefail
[[ $# -ge 3 ]] || { sed -n '2,5s/^# //p' "$0" >&2; exit 2; }
program=$(realpath "$1") table=$2
shift 2
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
scene='{"bodies": [{"mesh": "none", "height": 0.2, "position": [0, 1, 0], "material": {"model": "neo-hookean",
  "young_modulus": 1e5, "poisson_ratio": 0.4}}], "world": {"friction": 0.5}, "duration": '"${DURATION:-3}"'}'
echo "$scene" > "$out/scene.json"

number() { sed -nE "s/^ *\"$1\": ([-0-9.e+]+|null),?\$/\1/p" "$2" | head -n 1; }
drop() {  # SURFACE YOUNG_MODULUS: created energy in % of the scale, inverted tets
  rm -rf "$out/run"
  timeout "${LIMIT:-120}" "$program" run --scene "$out/scene.json" --mesh "$1" --height 0.2 --tets "${TETS:-15000}" \
    --young-modulus "$2" --csv-every 0 --measure-every 10 --out "$out/run" >"$out/said.txt" 2>&1
  [[ $? == 124 ]] && { echo "too slow,"; return; }
  awk -v created="$(number created "$out/run/stats.json")" -v scale="$(number scale "$out/run/stats.json")" \
    -v inverted="$(number inverted_tets "$out/run/stats.json")" 'BEGIN {
      if (inverted == "" || inverted == "null") print "not finite,"
      else printf "%.3g,%s\n", (scale > 0 ? 100 * created / scale : 0), inverted}'
}

{
  echo "surface,tets,fill_s,created_1e4,inverted_1e4,created_1e5,inverted_1e5,created_1e6,inverted_1e6"
  for surface; do
    begin=$(date +%s.%N)
    if ! TETPBD_CACHE="$out/cache" "$program" mesh "$surface" --tets "${TETS:-15000}" --json >"$out/mesh.json" 2>"$out/error.txt"; then
      echo "$(basename "$surface"),refused: $(tr ',\n' '; ' <"$out/error.txt")"
      continue
    fi
    end=$(date +%s.%N)
    row="$(basename "$surface"),$(number tets "$out/mesh.json"),$(awk -v t="$end" -v s="$begin" 'BEGIN {printf "%.1f", t - s}')"
    for modulus in 1e4 1e5 1e6; do row+=",$(drop "$surface" "$modulus")"; done
    echo "$row"
  done
} > "$table"
