#!/usr/bin/env bash
# docs/tutorial.md as it stands: its commands are run, its lanes and its fall opened in the window, and what it says of
# the results is looked up in them.
# Usage: tutorial_test.sh PROGRAM PAGE FOLDER
set -euo pipefail
program=$(realpath "$1") page=$(realpath "$2")
docs=$(dirname "$page")
rm -rf "$3" && mkdir -p "$3" && cd "$3"
fail() { echo "tutorial: $*" >&2; exit 1; }
holds() { awk "BEGIN { exit !($1) }" || fail "${2:-it is not so}: $1"; }
near() {  # WHAT SAID MEASURED
  holds "$3 > 0.85 * $2 && $3 < 1.15 * $2" "the page says another $1"
}
value() {  # FILE KEY
  sed -nE "s/^ *\"$2\": \"?([^\",]+)\"?,?\$/\1/p" "$1" | head -n 1
}
column() {  # FILE NAME: of each row
  awk -F, -v name="$2" 'NR == 1 { for (i = 1; i <= NF; ++i) if ($i == name) c = i; next } { print $c }' "$1"
}
differ() {  # PICTURE PICTURE
  local count
  count=$(compare -metric AE -fuzz 4% "$1" "$2" null: 2>&1 || true)
  awk -v n="$count" 'BEGIN { exit !(n >= 2000) }' || fail "$1 and $2 show the same"
}

# The page.
(($(wc -w <"$page") <= 1500)) || fail "the page has $(wc -w <"$page") words"
mapfile -t pictures < <(grep -oE '\]\(tutorial/[^)]*\.png\)' "$page" | sed 's/^](//; s/)$//')
((${#pictures[@]} >= 8)) || fail "${#pictures[@]} pictures only"
bytes=0
for picture in "${pictures[@]}"; do
  [[ -s $docs/$picture ]] || fail "no $picture"
  (($(identify -format %w "$docs/$picture") <= 640)) || fail "$picture is wider than 640"
  bytes=$((bytes + $(stat -c %s "$docs/$picture")))
done
((bytes <= 1500000)) || fail "the pictures have $bytes bytes"
(($(find "$docs/tutorial" -name '*.png' | wc -l) == ${#pictures[@]})) || fail "a picture that the page does not show"

export TETPBD=$program
"$docs/tutorial.sh" commands .
"$docs/tutorial.sh" window .

# 1
for step in 00 20 40 60 80; do [[ -s drop/frame_000$step.png ]] || fail "no picture of step $step"; done
differ drop/frame_00000.png drop/frame_00060.png
(($(wc -l <drop/stats.csv) == 82)) || fail "drop/stats.csv has other rows"
grep -q '"level"' drop/stats.json || fail "no verdict"

# 2
read -r soft medium stiff < <(for name in soft medium stiff; do value $name/stats.json stretch_rms; done | xargs)
mapfile -t said < <(sed -n 's/^| <!-- strain -->[^|]*//p' "$page" | grep -oE '[0-9.]+')
near strain "${said[0]}" "100 * $soft"
near strain "${said[1]}" "100 * $medium"
near strain "${said[2]}" "100 * $stiff"
holds "$soft > 2 * $medium && $medium > 2 * $stiff" "four times E does not halve the strain"
differ soft/frame_00066.png stiff/frame_00066.png

# 3
(($(wc -l <solvers/compare.csv) == 5)) || fail "not four solvers"
for chart in motion.svg compare.html; do [[ -s solvers/$chart ]] || fail "no solvers/$chart"; done
error() {  # MODE SUBSTEPS, in %
  paste <(column solvers/compare.csv mode) <(column solvers/compare.csv substeps) <(column solvers/compare.csv motion_final) |
    awk -v mode="$1" -v substeps="$2" '$1 == mode && (!substeps || $2 == substeps) { print 100 * $3 }'
}
while read -r mode substeps percent; do
  near "error of $mode" "$percent" "$(error "$mode" "$substeps")"
done < <(sed -nE 's/.*<!-- error ([a-z]+) ([0-9]+) --> ([0-9.]+) %.*/\1 \2 \3/p' "$page")
holds "$(error explicit '') < 0.001"
holds "$(error node 5) > 8 * $(error node 20)"
holds "$(error node 20) > $(error newton 1)"

# 4: the instant of drop/frame_00060.png.
differ strain/frame_00060.png drop/frame_00060.png
differ strain/frame_00060.png volume/frame_00060.png
for name in strain volume; do
  [[ $(value $name/stats.json state_hash) == "$(value half/stats.json state_hash)" ]] || fail "$name shows another instant"
done

# 5
[[ -s half.state ]] || fail "no half.state"
hash=$(value drop/stats.json state_hash)
[[ -n $hash && $(value rest/stats.json state_hash) == "$hash" ]] || fail "a run from a state ends elsewhere"
[[ $(value other/stats.json state_hash) != "$hash" ]] || fail "a stiffer body moves alike"
differ other/frame_00020.png drop/frame_00080.png

# 6
(($(wc -l <my_scene.json) <= 13)) || fail "my_scene.json is long"
(($(grep -c '"volume_error_percent"' mine/stats.json) == 2)) || fail "not two bodies"
differ mine/frame_00000.png mine/frame_00080.png
grep '"centre": \[' -A 2 mine/stats.json | awk '/^ +[-0-9.]+,?$/ { y[++n] = $1 + 0 } END { exit !(y[4] > 0.3 && y[4] < 0.5) }' ||
  fail "the ball is not on the block"
if sed 's/"height"/"hight"/' my_scene.json >typo.json && PATH=bin:$PATH tetpbd run --scene typo.json --out typo 2>typo.txt; then
  fail "a misspelt key is accepted"
fi
grep -q height typo.txt || fail "a misspelt key, and no word of the right one: $(cat typo.txt)"

# 7
(($(ffprobe -v error -count_frames -show_entries stream=nb_read_frames -of csv=p=0 my.mp4) >= 20)) || fail "a short film"
[[ $(ffprobe -v error -show_entries stream=width,height -of csv=p=0 my.mp4) == 640,360 ]] || fail "a film of another size"

# 8: rows from the bottom, in each stiffness to the right.
mapfile -t errors < <(column map/map.csv motion_rms)
((${#errors[@]} == 12)) || fail "the map has ${#errors[@]} cells"
[[ $(column map/map.csv finite | sort -u) == true ]] || fail "a cell fails"
for k in 0 1 2 3; do
  holds "${errors[k]} > ${errors[k + 4]} && ${errors[k + 4]} > ${errors[k + 8]}" "more substeps, and no smaller error"
done
for k in 0 1 2; do holds "${errors[k]} < ${errors[k + 1]}" "stiffer, and no larger error"; done
holds "${errors[1]} < 0.01 && ${errors[2]} > 0.01 && ${errors[6]} < 0.01 && ${errors[7]} > 0.01 && ${errors[11]} < 0.01" "1 % needs other rows"

# The window: four lanes at 0.4 s with an error, and a fall that went back.
(($(grep -c '^lane [1-4] .* 80 ' window/lanes.log) >= 4)) || fail "the window has no four lanes at step 80"
grep -q '^moment 60' window/timeline.log || fail "the window did not go back to step 60"
differ window/lanes.png window/timeline.png
[[ $(grep -oE '^state 60 [0-9a-f]+' window/timeline.log | tail -n 1) == "state 60 $(value half/stats.json state_hash)" ]] ||
  fail "the window's step 60 is another than that of run"
