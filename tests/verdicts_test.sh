#!/usr/bin/env bash
# The table of verdicts: nothing but what is known goes wrong, and what is known is named with what has to change.
# Usage: verdicts_test.sh PROGRAM FOLDER     in the long suite a second of every shipped scene
set -uo pipefail
program=$1 here=$(dirname "$(realpath "$0")") table=$2/verdicts.csv
rm -rf "$2" && mkdir -p "$2"
known=(
  'beam,node corrections: contact of what gives way'
  'beam,cpu-fast corrections: contact of what gives way'
  'soft-beam,node corrections: contact of what gives way'
  'jelly-beam,node corrections: few iterations'
  'jelly-bunny,node corrections: contact of soft bodies by positions'
  'jelly-bunny,explicit explicit: tets that bear the landing'
  'muscle,node corrections: few iterations'
  'ring,node corrections: contact of soft bodies by positions'
  'rollers,node corrections: contact of soft bodies by positions'
  'jelly-bunny,newton newton: contact with obstacles'
  'ring,newton newton: contact between bodies'
  'stack,newton newton: contact between bodies'
)
scenes=("$here"/../models/scenes/{jelly-beam,twisted-beams}.json)
[[ -z ${TETPBD_LONG:-} ]] || scenes=("$here"/../models/scenes/*.json)
"$here/verdicts.sh" "$program" "$table" "$([[ -n ${TETPBD_LONG:-} ]] && echo 1 || echo 0.03)" "${scenes[@]}" || exit 1
[[ $(wc -l <"$table") -gt ${#scenes[@]} ]] || { echo "FAILED: scenes are missing: $table" >&2; exit 1; }
status=0
while IFS=, read -r scene mode _ _ verdict; do
  [[ $verdict != '"right"' && $verdict != '"too slow"' ]] || continue
  printf '%s\n' "${known[@]}" | grep -q "^$scene,$mode " && { echo "known: $scene in $mode: $verdict"; continue; }
  echo "FAILED: $scene in mode $mode is $verdict" >&2
  status=1
done < <(tail -n +2 "$table")
exit $status
