#!/usr/bin/env bash
# What four readers do first: a student, a researcher, an engine programmer, an artist with a mesh. Twenty tasks by the
# commands of the README, the tutorial and the guide. Each leaves a line of FOLDER/tasks.tsv (number, reader, task, seconds,
# what came of it) and, where there is something to see, FOLDER/NN.png or .svg. Goes on after a task that fails; the status is 1 then.
# Usage: tests/reader_tasks.sh FOLDER [PROGRAM]     PROGRAM: what ./run.sh built, build/release/tetpbd
# Meant for a bare Debian 12 where ./run.sh has installed what it needs; tasks that need more (ffmpeg, a compiler) say so.
set -uo pipefail
source_folder=$(dirname "$(dirname "$(realpath "${BASH_SOURCE[0]}")")")
program=$(realpath "${2:-$source_folder/build/release/tetpbd}")
mkdir -p "$1/bin" && cd "$1" || exit 1
ln -sf "$program" bin/tetpbd
export PATH=$PWD/bin:$PATH
"$source_folder/tests/ring_mesh.sh" >my.obj
: >tasks.tsv
number=0 failed=0

# The last line that a task prints is what came of it.
task() {  # READER TASK COMMAND...
  local began said status
  number=$((number + 1)) began=$(date +%s.%N)
  said=$( set -e; "${@:3}" 2>"$number.err" ) || { status=$?; said="FAILED ($status): $(tail -n 1 "$number.err")"; failed=$((failed + 1)); }
  printf '%d\t%s\t%s\t%.1f\t%s\n' "$number" "$1" "$2" "$(awk -v a="$began" -v b="$(date +%s.%N)" 'BEGIN {print b - a}')" \
    "$(tail -n 1 <<<"$said")" | tee -a tasks.tsv
}
picture() { cp "$1" "$(printf %02d "$number").${1##*.}"; }
value() { grep -m 1 "\"$2\"" "$1/stats.json" | sed -E 's/.*: *"?([^",]*)"?,?$/\1/'; }  # of FOLDER/stats.json: KEY

drop() { tetpbd run --scene bunny --steps 60 --png-every 60 --out drop; picture drop/frame_00060.png; }
stiffness() {
  for e in 5e4 1e6; do
    tetpbd run --scene bunny --set bodies.0.material.young_modulus=$e --steps 66 --png-every 66 --out e$e
  done
  picture e5e4/frame_00066.png
  echo "strain $(value e5e4 stretch_rms) and $(value e1e6 stretch_rms)"
  awk -v soft="$(value e5e4 stretch_rms)" -v stiff="$(value e1e6 stretch_rms)" 'BEGIN {exit !(soft > 2 * stiff)}'
}
solvers() {
  beam="--scene soft-beam --set bodies.0.block.cells=[16,4,4] --material neo-hookean --young-modulus 5e5"
  tetpbd compare $beam --modes explicit,newton,node --substeps 5 --iterations 4 --steps 40 --judge motion --out solvers
  picture solvers/compare.svg
}
cut() {
  tetpbd run --scene bunny --steps 60 --png-every 60 --look tets --cut 0.5 --cut-axis 2 --colour stretch --out cut
  picture cut/frame_00060.png
}
back() {
  tetpbd run --scene bunny --steps 40 --save-state half.state --out half
  tetpbd run --scene bunny --from-state half.state --steps 20 --out rest
  echo "$(value drop state_hash) at once, $(value rest state_hash) in two runs"
  [[ $(value drop state_hash) == "$(value rest state_hash)" ]]
}
scene() {
  cat >mine.json <<'JSON'
{"bodies": [
  {"block": {"size": [1, 0.3, 0.6], "cells": [8, 3, 5]}, "material": "gelatine"},
  {"mesh": "ball.obj", "height": 0.3, "position": [-0.3, 0.7, 0], "density": 500, "velocity": [1, 0, 0], "material": "foam"}],
 "solver": {"damping": 0.5, "dt": 0.005}, "camera": {"target": [0, 0.35, 0], "distance": 2.4}, "duration": 0.4}
JSON
  tetpbd run --scene mine.json --png-every 80 --out mine; picture mine/frame_00080.png
}
front() {
  tetpbd compare --scene jelly-beam --modes node,explicit --iterations 1 --substeps 2,5,20 --steps 40 --judge motion --out front
  picture front/compare.svg
  [[ $(wc -l <front/compare.csv) -ge 5 ]]
}
map() {
  tetpbd map --scene jelly-beam --x substeps=1,4,16 --y omega=1,1.5 --steps 20 --out map; picture map/map.svg
}
paraview() {
  tetpbd run --mesh my.obj --height 0.5 --material neo-hookean --steps 10 --export vtk --out vtk
  grep -q '<DataSet' vtk/frames.pvd; echo "$(grep -c '<DataSet' vtk/frames.pvd) frames in vtk/frames.pvd"
}
ledger() {
  tetpbd run --scene press --steps 20 --strict --out ledger
  sed -n '/"energy"/,/}/p' ledger/stats.json | tr -d '\n' | tr -s ' '; echo
}
hard_case() { tetpbd compare --hard-cases --cases hard/flat-hinges --meshes block --modes node,cpu --steps 20 --out hard; }
mistake() {
  if tetpbd run --scene bunni --out mistake 2>said; then return 1; fi
  cat said; grep -q "did you mean 'bunny'" said && [[ $(wc -l <said) -eq 1 && ! -e mistake ]]
}
kernels() {
  tetpbd run --scene jelly-beam --mode node --steps 1 --dump-shaders shaders --out dumped
  echo "$(find shaders -type f | wc -l) kernels, $(cat shaders/* | wc -l) lines"
  [[ -n $(find shaders -type f) ]]
}
selftest() { tetpbd info --selftest; }
bench() { tetpbd bench --scenes jelly-beam --modes node,explicit --iterations 1 --frames 20 --no-render --out bench; }
copies() { tetpbd run --scene jelly-beam --copies 8 --steps 20 --csv-every 0 --out many; }
embed() {
  cmake --install "$(dirname "$program")" --component library --prefix prefix >/dev/null
  cmake -G Ninja -S "$source_folder/docs/examples/embed" -B embedded -DCMAKE_PREFIX_PATH="$PWD/prefix" >/dev/null
  cmake --build embedded >/dev/null
  echo "the last vertex ends at $(./embedded/embed)"
}
film() {
  tetpbd mesh my.obj
  tetpbd run --mesh my.obj --height 0.5 --material neo-hookean --young-modulus 3e5 --steps 60 --size 640x360 --video my.mp4 --out film
  [[ -s my.mp4 ]]
}
scan() {  # the ring with a hole, upside down and in millimetres
  awk '/^f/ && n++ % 40 == 0 {next} /^v/ {print $1, 1000 * $2, 1000 * $4, 1000 * $3; next} {print}' my.obj >scan.obj
  tetpbd run --mesh scan.obj --up z --height 0.5 --material rubber --steps 60 --png-every 60 --out scan
  picture scan/frame_00060.png
}
blender() {
  tetpbd run --mesh my.obj --height 0.5 --material neo-hookean --steps 20 --export pc2 --out pc2
  [[ -s pc2/surface.obj && -s pc2/surface.pc2 ]]
}

task student "see something soft fall" drop
task student "change its stiffness" stiffness
task student "compare three solvers" solvers
task student "cut it open" cut
task student "go on from a saved state" back
task student "write a scene" scene
task student "make a mistake" mistake
task researcher "error against time of a scene" front
task researcher "map where a solver is stable" map
task researcher "look at it in ParaView" paraview
task researcher "read the energy ledger" ledger
task researcher "try a hard case" hard_case
task researcher "check this GPU against the CPU" selftest
task programmer "read the kernels that ran" kernels
task programmer "time two solvers" bench
task programmer "many small bodies at once" copies
task programmer "use the library" embed
task artist "film my mesh" film
task artist "bring a broken scan in millimetres" scan
task artist "take it to Blender" blender
exit $((failed > 0))
