#!/usr/bin/env bash
# What still goes wrong: runs scenes in every way of solving that takes them and writes a table of verdicts.
# Usage: verdicts.sh PROGRAM TABLE.csv [SECONDS] [SCENES]     all shipped scenes, and a second of each, if none are named
# A run of more than two minutes (LIMIT, in s) is called too slow.
# A row has the energy that came from nothing, in % of the scene's scale, the tets inverted at the end and the verdict.
set -uo pipefail
[[ $# -ge 2 ]] || { sed -n '2,5s/^# //p' "$0" >&2; exit 2; }
program=$(realpath "$1") table=$2 seconds=${3:-1} here=$(dirname "$(realpath "$0")")
shift $(($# < 3 ? $# : 3))
scenes=("$@")
[[ $# -gt 0 ]] || scenes=("$here"/../models/scenes/*.json)
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT

number() { sed -nE "s/^ *\"$1\": ([-0-9.e+]+|null),?\$/\1/p" "$out/stats.json" | tail -n 1; }  # after those by body
row() {  # SCENE MODE
  local verdict
  rm -f "$out"/*
  timeout "${LIMIT:-120}" "$program" run --scene "$1" --mode "$2" --set "duration=$seconds" --csv-every 0 --out "$out" >"$out/said.txt" 2>"$out/error.txt"
  case $? in
    2) return 0 ;;  # a mode that does not take the scene
    124) echo "$(basename "$1" .json),$2,,,\"too slow\""; return 0 ;;
  esac
  verdict=$(grep '^verdict: ' "$out/said.txt" "$out/error.txt" -h | tail -n 1 | sed 's/^verdict: //; s/"/'"'"'/g')
  awk -v scene="$(basename "$1" .json)" -v mode="$2" -v created="$(number created)" -v scale="$(number scale)" \
    -v inverted="$(number inverted_tets)" -v verdict="${verdict:-not finite}" 'BEGIN {
      part = scale > 0 ? sprintf("%.3g", 100 * created / scale) : ""
      printf "%s,%s,%s,%s,\"%s\"\n", scene, mode, part, inverted, verdict}'
}

{
  echo "scene,mode,created_percent,inverted_tets,verdict"
  for scene in "${scenes[@]}"; do
    for mode in node gauss-seidel explicit newton vbd cpu-fast; do row "$scene" "$mode"; done
  done
} >"$table.part" && mv "$table.part" "$table"
awk -F, 'NR > 1 {all++; wrong += $5 !~ /^"right"/} END {print wrong + 0 " of " all + 0 " runs are not right"}' "$table"
