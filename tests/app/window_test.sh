#!/usr/bin/env bash
# Drives the real window under Xvfb with real clicks, drags and keys. What it did is read from the event log that
# TETPBD_WINDOW_LOG names; "at NAME x y width height" lines there say where widgets are.
# Usage: window_test.sh PROGRAM SHADERS FOLDER
set -uo pipefail
if [[ ${1:-} != --inside ]]; then
  exec xvfb-run -a -s "-screen 0 1280x800x24" "$0" --inside "$@"
fi
program=$(realpath "$2") shaders=$(realpath "$3") folder=$4 here=$(dirname "$(realpath "$0")")
rm -rf "$folder" && mkdir -p "$folder" && cd "$folder" || exit 1
export TETPBD_GL_DEBUG=1 TETPBD_WINDOW_LOG=$PWD/events.log TETPBD_CACHE=$PWD/cache MESA_GL_VERSION_OVERRIDE=4.3
log=$TETPBD_WINDOW_LOG
cp -r "$shaders" shaders

cat >block.json <<'JSON'
{"name": "block", "bodies": [{"name": "block", "block": {"size": [1, 1, 1], "cells": [3, 3, 3]}, "position": [0, 0, 0]}],
 "solver": {"mode": "node", "iterations": 4, "dt": 0.01}, "camera": {"target": [0, 0.5, 0], "distance": 3.2, "azimuth": 20, "elevation": 15}}
JSON
echo "this is no mesh" >bad.ply

source "$here/window_driver.sh"

open_window --scene block.json --size 1000x760 --samples 0 --shaders shaders
await '^running [1-9]'

# -------------------------------------------------------------------------------------------------- play, step, reset
key space; await '^pause'
key r; await '^reset'
key s; await '^step 1$'
key Right; await '^step 2$'
click step; await '^step 3$'
click reset; await '^reset'
key s; await '^step 1$'
click play; await '^play'; await '^running ([4-9]|[1-9][0-9])'
key space; await '^pause'

# ---------------------------------------------------------------------------------- the same bits as without a window
await '^state [0-9]+ [0-9a-f]{16}$'
read -r _ steps hash < <(grep '^state ' "$log" | tail -n 1)
"$program" run --scene block.json --shaders shaders --steps "$steps" --csv-every 0 --out headless >/dev/null || fail "no run without a window"
grep -q "\"state_hash\": \"$hash\"" headless/stats.json || fail "after $steps steps the window has another state than a run without it"
[[ $steps -gt 3 ]] || fail "only $steps steps were compared"

# ------------------------------------------------------------------------------------------------------------ settings
unfold "Solver more"; await '^at omega '
to omega 0.3 0.5; press 1
xdotool mousemove $(point omega 0.5 0.5); pause_for_frame
xdotool mousemove $(point omega 0.75 0.5); pause_for_frame
release 1
await '^set omega (2\.[5-9]|3)'
forget  # typing into a slider
xdotool keydown ctrl; to omega 0.5 0.5; press 1; release 1; xdotool keyup ctrl; pause_for_frame
xdotool key ctrl+a; pause_for_frame
for k in 1 period 2; do xdotool key $k; pause_for_frame; done
new_events | grep -qE '^(look|step|colour)' && fail "typing into a slider worked a shortcut"
new_events | grep -q '^set omega' && fail "a number was applied while it was being typed"
xdotool keydown Return; pause_for_frame; xdotool keyup Return
await '^set omega 1\.2'
pause_for_frame  # keys are text for a frame more
# Beyond its range it is brought back, and said; with Esc nothing changes; a click elsewhere is as good as Enter.
type_omega() {
  forget; xdotool keydown ctrl; to omega 0.5 0.5; press 1; release 1; xdotool keyup ctrl; pause_for_frame
  xdotool key ctrl+a; pause_for_frame; xdotool key "$1"; pause_for_frame
}
type_omega 9; xdotool key Return; await '^message omega goes from 0 to 4: it is 4 now'; await '^set omega 4$'; pause_for_frame
type_omega 3; xdotool key Escape; pause_for_frame; pause_for_frame
new_events | grep -q '^set omega' && fail "Esc applied what was typed"
type_omega 2; click "section World" 0.6; await '^set omega 2$'; pause_for_frame; pause_for_frame
click "section World" 0.6; pause_for_frame; pause_for_frame
type_omega 1; xdotool key Return; await '^set omega 1$'; pause_for_frame
for _ in 1 2 3; do key ctrl+z; await '^undo'; done; await '^set omega 1\.2'
# Esc closes a list, and changes nothing.
click mode; await '^at mode=cpu '; pause_for_frame; key Escape; await '^list closed'; pause_for_frame
# One drag is one change, which a right click, Ctrl+Z and a button take back.
key ctrl+z; await '^undo'; await '^set omega (2\.[5-9]|3)'
key ctrl+z; await '^undo'; await '^set omega 1\.5$'
key ctrl+shift+z; await '^redo'; await '^set omega (2\.[5-9]|3)'
key ctrl+y; await '^redo'; await '^set omega 1\.2$'
to omega 0.5 0.5; sleep 0.3; shot unusual.png
forget; press 3; release 3; await '^back omega 1.5'; await '^set omega 1.5$'
click undo; await '^set omega 1.2$'
click redo; await '^set omega 1.5$'
fold "Solver more"
choose mode cpu; await '^set mode cpu'
key s; await '^step'
choose mode node; await '^set mode node'
choose solver auto; await '^message solver: (node|cpu-fast), '; shot auto.png
choose solver paper; await '^set iterations 25'
choose solver substeps; await '^set substeps 20'
click bend 0.1; await '^set constraints stretch,volume'
click bend 0.1; await '^set constraints stretch,bend,volume|^set constraints stretch,volume,bend'
shot panels.png

# ---------------------------------------------------------------------------------------------------------------- view
# Out of the way, which stays so.
fold "Solver"
fold "Material"
for look in 2:wire 3:tets 1:surface; do key "${look%:*}"; await "^look ${look#*:}"; done
for colour in volume stretch velocity motion; do key c; await "^colour $colour"; done
shot plain.png; key w; await '^worst true'
forget; xdotool mousemove $cx $cy; await '^probe [0-9]+ [0-9]+ '
await_other plain.png probe.png 5000 "the tooltip"
key w; await '^worst false'
xdotool mousemove $((vx + 15)) $((vy + 15)); sleep 0.5; shot before.png
click "flattest tet" 0.1; await '^flattest tet true'; xdotool mousemove $((vx + 15)) $((vy + 15)); sleep 0.5
await_other before.png flattest.png 2000 "the flattest tet"
click "flattest tet" 0.1; await '^flattest tet false'; xdotool mousemove $cx $cy
key c; await '^colour patch'; key c; await '^colour residual'; key c; await '^colour plain'
for axis in x y z "the view"; do key x; await "^cut 0.5000 along $axis"; done
await_other plain.png cut.png 5000 "a cut"
forget; xdotool keydown alt; xdotool click 5; xdotool keyup alt; await '^cut 0.4800'
forget; xdotool keydown alt; sleep 0.2; drag 1 $cx $cy 0 40; release 1; xdotool keyup alt; await '^cut 0'
key x; await '^cut 1.0000'
key 4; await '^look graph'; key 1; await '^look surface'
key n; await '^normals false'
key n; await '^normals true'
key g; await '^grid false'
key g; await '^grid true'
key l; await '^follow false'
key l; await '^follow true'
unfold "View more"
click grid 0.1; await '^grid false'
click grid 0.1; await '^grid true'
click "sky and ground" 0.1; await '^sky and ground false'
click "sky and ground" 0.1; await '^sky and ground true'
shot view.png
choose theme dark; await '^scale 1 dark'
await_other view.png dark.png 100000 "the dark theme"
choose theme light; await '^scale 1 light'
fold "Scene"
choose "text size" "125 %"; await '^scale 1.25 light'; sleep 0.5; shot larger.png
to "text size" 0.5 0.5; forget; press 3; release 3; await '^back text size 100 %'; await '^scale 1 light'; sleep 0.5
unfold "Scene"
drag 1 $((vx + vw)) $cy -60 0; release 1; await '^at edge '
read -r _ _ now _ < <(place view); [[ $now -eq $((vw - 60)) ]] || fail "the panel is not wider by what its edge was dragged"
drag 1 $((vx + vw - 60)) $cy 60 0; release 1; await "^at view 0 0 $vw "
fold "View more"
key h; await '^help true'
await_other panels.png help.png 20000 "the help overlay"
key Escape; await '^help false'; pause_for_frame
forget; shot before.png
drag 3 $cx $cy 80 20; release 3; await '^camera'
await_other before.png turned.png 5000 "turning the view"
drag 1 $((vx + 15)) $((vy + 15)) -80 0; release 1; await '^camera'
for _ in 1 2 3; do drag 3 $cx $cy 0 -300; release 3; await '^camera'; done; sleep 0.5; shot ground.png  # not from below
drag 3 $cx $cy 0 60; release 3; await '^camera'
drag 2 $cx $cy 40 0; release 2; await '^camera'
drag 2 $cx $cy -40 0; release 2; await '^camera'
forget; xdotool click 4; await '^zoom'
forget; xdotool click 5; await '^zoom'
key f; await '^frame'

# ------------------------------------------------------------------------------------------------------ pull the body
click play; await '^play'
forget; shot before.png
drag 1 $cx $cy 20 -160; await '^grab [0-9]+'
await_other before.png pulled.png 15000 "pulling the body"
release 1
await '^release [0-9]+ moved'
moved=$(new_events | sed -n 's/^release [0-9]* moved //p' | tail -n 1)
awk -v m="$moved" 'BEGIN {exit !(m > 0.1)}' || fail "the body was pulled by $moved m only"
click reset; await '^reset'
key space; await '^pause'
key f; await '^frame'

# ---------------------------------------------------------------------------------------------------------------- pins
forget; xdotool mousemove $cx $cy; pause_for_frame
xdotool click --repeat 2 --delay 60 1; await '^pin [0-9]+'
pinned=$(new_events | sed -n 's/^pin //p' | tail -n 1)
sleep 0.5
forget; xdotool keydown ctrl; press 1; release 1; xdotool keyup ctrl; await "^unpin $pinned\$"

# ----------------------------------------------------------------------------------------------------------- obstacles
unfold "Obstacles"; shot before.png
choose "add obstacle" sphere; await '^obstacles 1'; await '^obstacle 1 chosen'
await_other before.png obstacle.png 1000 "an obstacle"
drag 1 $(point "chosen obstacle" 0.5 0.5) 40 0; release 1; await '^obstacle 1 at '; pause_for_frame
read -r ox oy < <(point "chosen obstacle" 0.5 0.5)
key Escape; await '^obstacle 0 chosen'
drag 1 "$ox" "$oy" 0 0; release 1; await '^obstacle 1 chosen'  # a drag would turn the view
key s; await '^step'
key ctrl+z; await '^undo'; key ctrl+z; await '^obstacles 0'
key ctrl+y; await '^obstacles 1'
click "obstacle 1" 0.1; await '^obstacle 1 chosen'; key Delete; await '^obstacles 0'
key r; await '^reset'
fold "Obstacles"

# ---------------------------------------------------------------------------------------------- screenshots, panels
key p; await '^screenshot screenshot_000.png'
[[ $(identify -format '%wx%h' screenshot_000.png) == "${vw}x$vh" ]] || fail "the screenshot's size is not the view's"
[[ $(colours screenshot_000.png) -gt 100 ]] || fail "the screenshot is blank"
key p; await '^screenshot screenshot_001.png'
key Tab; await '^panels false'; await '^at view 0 0 1000 760'
key Tab; await '^panels true'
# Its widgets are somewhere else a frame or more after it has another size.
forget; xdotool windowsize "$window" 900 600; await '^size 900 600'; await '^at mesh '; sleep 0.3; shot small.png
forget; xdotool windowsize "$window" 1000 760; await '^size 1000 760'; await '^at mesh '; pause_for_frame

# -------------------------------------------------------------------------------------------------------- side by side
unfold "Side by side"
forget; choose "side by side" "paper, node, cpu"
for lane in "node, 25 iterations" "node, 5 substeps" "cpu-fast, 5 substeps"; do await "^lane $lane\$"; done
key s; await '^step 1$'; key s; await '^step 2$'; key s; await '^step 3$'
await '^state 3 '
for lane in "1 node paper" "2 node hard" "3 cpu-fast hard"; do  # in lock-step, each the same bits as alone
  read -r number mode solver <<<"$lane"
  hash=$(new_events | sed -n "s/^lane $number $mode 3 //p")
  [[ -n $hash ]] || fail "lane $number did not step"
  "$program" run --scene block.json --shaders shaders --solver "$solver" --mode "$mode" --steps 3 --csv-every 0 --out lane >/dev/null
  grep -q "\"state_hash\": \"$hash\"" lane/stats.json || fail "lane $number has another state than a run without a window"
done
forget; shot lanes.png
to "plot 1" 0.5 0.5; forget; xdotool click 4; await '^plot 1 [-0-9.e]+ \.\. '; shot zoomed.png
forget; for _ in 1 2 3; do xdotool click 5; pause_for_frame; done; await '^plot 1 whole'
click "csv 1"; await '^message copied [0-9]+ rows'
click "svg 1"; await '^message saved plot_000.svg'; grep -q "time per step, ms" plot_000.svg || fail "the saved plot has no axis"
choose "plotted 2" "energy"; await '^plotted 2 energy'
xdotool mousemove $((vx + 20)) $((vy + 20)); sleep 4.5; shot lanes.png  # messages go
key o; await '^overlaid true'
await_other lanes.png overlaid.png 20000 "lanes in one place"
key o; await '^overlaid false'
key r; await '^reset'
click play; await '^play'
drag 1 $cx $cy 20 -100; await '^lane 2 chosen'; await '^grab [0-9]+'; sleep 3; shot lanes_pulled.png; release 1; await '^release [0-9]+'
key space; await '^pause'
[[ $(new_events | grep -c '^lane [123] ') -ge 3 ]] || fail "lanes did not step together"
forget; key j; await '^reset'; key k; await '^reset'
[[ $(new_events | grep -c '^lane node, 5 substeps') -eq 2 ]] || fail "a lane more is not as the chosen one"
choose "side by side" single; await '^reset'

# --------------------------------------------------------------------------------------------------- stability map
unfold "Stability map"
click "map across"; sleep 0.5; xdotool key ctrl+a; pause_for_frame; xdotool type --delay 60 "substeps=1,4"; pause_for_frame
click "map up"; sleep 0.5; xdotool key ctrl+a; pause_for_frame; xdotool type --delay 60 "omega=1,1.5"; pause_for_frame
click "fill map"; await '^map of 4 cells'; await '^map done'; sleep 0.5; shot map.png
click "map 2 1"; await '^map chose 4 1'; await '^set substeps 4'
fold "Stability map"

# ------------------------------------------------------------------------------------------------- errors, other scenes
fold "Side by side"
type_mesh() {
  click mesh; pause_for_frame
  xdotool keydown ctrl keydown a; pause_for_frame; xdotool keyup a keyup ctrl; pause_for_frame
  xdotool type --delay 60 "$1"; pause_for_frame
  new_events | grep -qE '^(look|step|colour|play|panels|follow|screenshot)' && fail "typing a path worked a shortcut"
  xdotool keydown Return; pause_for_frame; xdotool keyup Return; pause_for_frame
}
type_mesh bad.ply; await '^error .*bad.ply'; sleep 0.5; shot error.png
new_events | grep -q '^scene' && fail "a bad mesh was taken over"
key s; await '^step [0-9]+'
click_until dismiss '^dismissed'
# An error goes with the next scene that loads. What was saved is this scene with its settings.
type_mesh bad.ply; await '^error .*bad.ply'
key ctrl+s; await '^message saved block_000.json'
key r; await '^reset'; key s; await '^step 1$'; await '^state 1 '
hash=$(new_events | sed -n 's/^state 1 //p' | tail -n 1)
"$program" run --scene block_000.json --shaders shaders --steps 1 --csv-every 0 --out saved >/dev/null || fail "the saved scene does not run"
grep -q "\"state_hash\": \"$hash\"" saved/stats.json || fail "the saved scene is another"
choose scene beam; await '^scene beam'
type_mesh block_000.json; await '^scene block_000.json'; sleep 0.5; shot loaded.png
click scene; sleep 1; shot scenes.png
click "scene=beam"; await '^scene beam'
key s; await '^step 1$'; shot beam.png

# -------------------------------------------------------------------------------------------------------- shaders
sleep 1.1  # the folder's version is the time of its newest file
forget; cp shaders/solvers/predict.comp good.comp; echo "this is no shader" >>shaders/solvers/predict.comp; await '^error shader does not compile.*predict.comp:[0-9]+'
key s; await '^step 2$'
forget; sleep 1.1; cp good.comp shaders/solvers/predict.comp; await '^message shaders compiled again'
key s; await '^step 3$'

# A state that is not finite: said, paused, and mended by a reset.
cp shaders/seen.glsl good.glsl
sed 's|pull \* params.h|vec3(sqrt(-params.h))|' good.glsl >bad.glsl
cmp -s good.glsl bad.glsl && fail "seen.glsl has no gravity to spoil"
sleep 1.1; forget; cp bad.glsl shaders/seen.glsl; await '^message shaders compiled again'
key m  # also without the plots, where nothing is measured
key space; await '^error the state is not finite: at step [0-9]+, vertex [0-9]+: '
new_events | grep -q '^pause' || fail "it did not pause"
key m
pause_for_frame; shot not_finite.png
sleep 4.2  # until older messages are gone and this one stays where it is
click_until back '^back [0-9]+$'
await_other not_finite.png back.png 2000 "the body is back"
key space; await '^error the state is not finite'
forget; sleep 1.1; cp good.glsl shaders/seen.glsl; await '^message shaders compiled again'
key r; await '^reset'
key space; await '^running [1-9]'
new_events | grep -q '^error' && fail "an error after the reset"

# ------------------------------------------------------------------------------------------------------------- the end
close_window
# What was folded is so the next time; a damaged file is as none.
grep -q '"Solver": *false' cache/window.json && grep -q block_000.json cache/window.json || fail "the window keeps nothing"
open_window --scene block.json --size 1000x760 --samples 0
grep -q '^at mode ' "$log" && fail "what was folded is open again"
close_window
echo '{"dark": ' >cache/window.json
open_window --scene block.json --size 1000x760 --samples 0
await '^at mode '
close_window
echo "window: passed in $SECONDS s"
