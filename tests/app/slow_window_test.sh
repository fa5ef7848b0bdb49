#!/usr/bin/env bash
# Drives the window with a scene of which a step takes far longer than a frame may: it goes on drawing and answering, and
# every key arrives.
# Usage: slow_window_test.sh PROGRAM FOLDER
set -uo pipefail
source "$(dirname "$(realpath "$0")")/window_driver.sh"
begin_inside "$@"

cat >slow.json <<'JSON'
{"name": "slow", "bodies": [{"name": "block", "block": {"size": [2, 1, 1], "cells": [24, 12, 12]}, "position": [0, 0.2, 0]}],
 "solver": {"mode": "node", "substeps": 150, "iterations": 1, "material": "neo-hookean"}}
JSON
open_window --scene slow.json --size 900x650
await '^running [0-9]+ ' 6
# Frames while one step lasts: the log says every half a second or so which step it is and how many frames a second.
frames=$(new_events | awk '/^running/ {n[$2] += $4 / 2} END {for (k in n) if (n[k] > m) m = n[k]; print int(m)}')
[[ $frames -ge 4 ]] || fail "only $frames frames were drawn in a step"
# The camera answers, while the step that was under way still is.
step=$(new_events | awk '/^running/ {s = $2} END {print s}')
drag 3 $cx $cy 60 0; release 3; await '^camera'
# Twenty times a number and Enter at once, without a pause for the frames.
unfold "Solver more"; await '^at omega '; sleep 1
forget
for k in $(seq 20); do
  xdotool keydown ctrl mousemove $(point omega 0.5 0.5) mousedown 1 mouseup 1 keyup ctrl
  xdotool key ctrl+a; xdotool type --delay 1 "1.$((10 + k))"; xdotool key Return
  await "^set omega 1\.$(printf '%s' $((10 + k)) | sed 's/0$//')\$"
done
# Twenty clicks as fast as they come.
forget
for k in $(seq 20); do xdotool mousemove $(point "section World" 0.5 0.5) mousedown 1 mouseup 1; done
await '^(opened|folded) World' 20
# A step beside the window gives the same bits.
key r; await '^reset'; await '^running 2 '; key space; await '^pause'; await '^state '
read -r _ steps hash < <(grep '^state ' "$log" | tail -n 1)
omega=$(grep '^set omega' "$log" | tail -n 1 | cut -d' ' -f3)
"$program" run --scene slow.json --omega "$omega" --steps "$steps" --csv-every 0 --out headless >/dev/null 2>&1
grep -q "\"state_hash\": \"$hash\"" headless/stats.json || fail "slow steps have another state than a run without a window"
# What is asked for during a step happens in order once that has ended: a lane, a setting of it, and back to one.
key space; await '^running 3 '
key k; key j; await '^lane .*' 3
await '^running [2-9]'
# So does a way back in time, which stops the clock.
forget
for _ in $(seq 10); do
  xdotool mousemove $(point time 0.01 0.5) mousedown 1 mouseup 1
  for _ in $(seq 60); do new_events | grep -q '^moment' && break 2; sleep 0.05; done
done
await '^moment 0'; await '^pause'
close_window

# A step that cannot be divided does not hold up the window either, nor its end.
open_window --scene slow.json --mode cpu --substeps 1000 --size 900x650
await '^running [0-9]+ ' 6
frames=$(new_events | awk '/^running/ {n[$2] += $4 / 2} END {for (k in n) if (n[k] > m) m = n[k]; print int(m)}')
[[ $frames -ge 4 ]] || fail "only $frames frames were drawn in a step on the CPU"
forget; await '^running' 2
step=$(new_events | awk '/^running/ {s = $2} END {print s}')
drag 3 $cx $cy 60 0; release 3; await '^camera'
[[ $(tac "$log" | awk '/^running/ {print $2; exit}') -le $((step + 1)) ]] || fail "steps passed until the camera turned"
began=$(date +%s.%N); close_window; ended=$(date +%s.%N)
step=$("$program" run --scene slow.json --mode cpu --substeps 1000 --steps 1 --csv-every 0 --out on_cpu 2>&1 |
  sed -nE 's/.* ([0-9.]+) ms a step.*/\1/p')
awk -v closing="$(bc <<<"$ended - $began")" -v step="$step" 'BEGIN {exit !(2000 * closing < step)}' ||
  fail "closing took $(bc <<<"$ended - $began") s of a step of $step ms"
exit 0
