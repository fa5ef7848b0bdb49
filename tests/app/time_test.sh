#!/usr/bin/env bash
# Drives the real window back and forth in time, records what is done, and does it again without a window.
# Usage: time_test.sh PROGRAM FOLDER
set -uo pipefail
source "$(dirname "$(realpath "$0")")/window_driver.sh"
begin_inside "$@"

cat >block.json <<'JSON'
{"name": "block", "bodies": [{"name": "block", "block": {"size": [1, 1, 1], "cells": [3, 3, 3]}, "position": [0, 0.3, 0], "material": "rubber"}],
 "solver": {"mode": "node", "substeps": 5, "dt": 0.01}, "camera": {"target": [0, 0.6, 0], "distance": 4, "azimuth": 20, "elevation": 15}}
JSON
hashes() { new_events | grep -E '^lane [0-9] [a-z-]+ [0-9]+ [0-9a-f]{16}$' | tail -n 4 | cut -d ' ' -f 2,4,5; }  # of lanes, now
open_window --scene block.json --size 1100x780 --samples 0 --record session.jsonl \
  --lane mode=node --lane mode=explicit --lane newton --lane mode=cpu-fast

# ------------------------------------------------------------------------------------------- state by state, and on
key space; await '^pause'
key r; await '^reset'
declare -A of
for step in 1 2 3 4 5 6; do key Right; await "^step $step\$"; await "^state $step "; of[$step]=$(hashes); done
key Left; await '^moment 5$'; await '^state 5 '
[[ $(hashes) == "${of[5]}" ]] || fail "one state back is another state than it was"
for step in 4 3 2; do key Left; await "^moment $step\$"; done
key Right; await '^moment 3$'
for step in 4 5 6; do key s; await "^step $step\$"; await "^state $step "; done
[[ $(hashes) == "${of[6]}" ]] || fail "the same steps again give other states"

# ------------------------------------------------------------------------------------------------- slider, loop, speed
key space; await '^running ([6-9][0-9]|[1-9][0-9][0-9])'
key space; await '^pause'
forget; to time 0.2 0.5; press 1; release 1; await '^moment [0-9]+$'; await '^state '
shot back.png
forget; to time 0.9 0.5; press 1; release 1; await '^moment [0-9]+$'
await_other back.png forth.png 3000 "another time"
click loop 0.1; await '^looping true'; await '^loop$'; shot loop.png
click loop 0.1; await '^looping false'; await '^pause'
key comma; await '^speed 0.5'
choose speed 1/8x; await '^speed 0.125'
key space; await '^play'; await '^running [0-9]+ 0\.(0[5-9]|1[0-5])'
for speed in 0.25 0.5 1; do key period; await "^speed $speed\$"; done

# --------------------------------------------------------------------------- what is done then, done without a window
drag 1 $((vx + vw / 4)) $((vy + vh / 4)) 40 -120; await '^grab [0-9]+'; sleep 1.5; shot pulled.png
release 1; await '^release [0-9]+ moved'
key space; await '^pause'
forget; to time 0.8 0.5; press 1; release 1; await '^moment [0-9]+$'
forget; xdotool mousemove $((vx + vw / 4)) $((vy + vh / 4)); pause_for_frame
xdotool click --repeat 2 --delay 60 1; await '^pin [0-9]+'
forget; to young_modulus 0.7 0.5; press 1; await '^set young_modulus'
key space; await '^play'; release 1; sleep 1.5  # a held slider takes no shortcut away
key space; await '^pause'; await '^state '
shot end.png
of[end]=$(hashes)
key Left; await '^moment '; key Right; await '^moment '; await '^state '
[[ $(hashes) == "${of[end]}" ]] || fail "back and forth is another state"
close_window
"$program" run --replay session.jsonl --out again >again.txt || fail "the record cannot be done again"
grep -q '"as_recorded": true' again/replay.json || fail "other states than in the window"
while read -r _ _ hash; do
  grep -q "\"state_hash\": \"$hash\"" again/replay.json || fail "a state of the window is not that of the record"
done <<<"${of[end]}"
sed '$s/"[0-9a-f]*"/"0"/' session.jsonl >other.jsonl
"$program" run --replay other.jsonl --out other >other.txt 2>&1 && fail "other states are no failure"
grep -q "other states than recorded: other.jsonl" other.txt || fail "other states are not said"

# ------------------------------------------------------------------------------------------------------- no history
open_window --scene block.json --size 900x600 --history-mb 0
key space; await '^pause'; await '^state '
key Left; key s; await '^step '
new_events | grep -q '^moment' && fail "something was kept"
close_window
echo "time: passed in $SECONDS s"
