#!/usr/bin/env bash
# Drives the real window over a scene of two materials: the body under the mouse is chosen for the panel and changed,
# which is undone, recorded and saved.
# Usage: bodies_test.sh PROGRAM FOLDER
set -uo pipefail
source "$(dirname "$(realpath "$0")")/window_driver.sh"
begin_inside "$@"

cat >two.json <<'JSON'
{"name": "two", "bodies": [
   {"name": "left", "block": {"size": [1, 1, 1], "cells": [2, 2, 2]}, "position": [-0.8, 0.3, 0], "material": "rubber"},
   {"name": "right", "block": {"size": [1, 1, 1], "cells": [2, 2, 2]}, "position": [0.8, 0.3, 0],
    "material": {"young_modulus": 3e4}}],
 "solver": {"mode": "node", "substeps": 5, "dt": 0.01}, "camera": {"target": [0, 0.7, 0], "distance": 5, "azimuth": 0, "elevation": 8}}
JSON
open_window --scene two.json --size 1100x780 --samples 0 --record session.jsonl
key space; await '^pause'
key r; await '^reset'

forget; xdotool mousemove $((vx + vw * 68 / 100)) $((vy + vh / 2)); await '^probe '
key b; await '^body right$'; pause_for_frame; shot right.png
forget; xdotool mousemove $((vx + vw * 32 / 100)) $((vy + vh / 2)); sleep 1
key b; await '^body left$'; pause_for_frame; shot left.png
unfold "Bodies"
click "seen 0"; await '^hidden left$'; pause_for_frame; shot hidden.png
click "body 1"; await '^body right$'; pause_for_frame
forget; xdotool mousemove $((vx + vw * 50 / 100)) $((vy + vh * 5 / 100)); sleep 1
key u; await '^shown left$'
forget; xdotool mousemove $((vx + vw * 68 / 100)) $((vy + vh / 2)); await '^probe '
key u; await '^hidden right$'; sleep 1
key u; await '^shown right$'
fold "Bodies"
choose body "1 right"; pause_for_frame
forget; to young_modulus 0.5 0.5; press 1; release 1; await '^set body 1 .*"young_modulus":'
[[ $(new_events | grep -c '^set young_modulus') -eq 0 ]] || fail "the material of all was changed"
key ctrl+z; await '^undo'; await '^set body 1 .*"young_modulus":30000.0'
key ctrl+y; await '^redo'; await '^set body 1 '
for step in 1 2 3; do key s; await "^step $step\$"; await "^state $step "; done
here_now=$(grep -E '^state 3 ' "$log" | tail -n 1)
key ctrl+s; await '^message saved two_000.json'
click "save state"; await '^message saved two_000.state'
key s; await '^state 4 '; at_four=$(grep -E '^state 4 ' "$log" | tail -n 1)
key s; await '^state 5 '
click mesh; pause_for_frame; xdotool type --delay 60 two_000.state; pause_for_frame
forget; xdotool keydown Return; pause_for_frame; xdotool keyup Return; await '^state of 3$'
key s; await '^state 4 '
[[ $(new_events | grep -E '^state 4 ' | tail -n 1) == "$at_four" ]] || fail "from the file it goes on to another state"
shot state.png
close_window

"$program" run --scene two_000.json --steps 3 --csv-every 0 --out saved >/dev/null || fail "the saved scene does not run"
hash=$(sed -n 's/.*"state_hash": "\(.*\)".*/\1/p' saved/stats.json)
[[ $here_now == *$hash* ]] || fail "the saved scene is another: $hash, not $here_now"
"$program" run --replay session.jsonl --out again >again.txt || fail "the record cannot be done again"
grep -q '"as_recorded": true' again/replay.json || fail "other states than in the window"
echo "bodies: passed in $SECONDS s"
