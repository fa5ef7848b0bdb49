#!/usr/bin/env bash
# Makes docs/figures/front_bunny.svg and front_beam.svg: speed against the error of the motion, all modes. Measure on a GPU.
# Usage: docs/fronts.sh OUT; TETPBD names the program. Some minutes.
set -euo pipefail
program=${TETPBD:-build/release/tetpbd} out=$1
mkdir -p "$(dirname "$out")" && mkdir "$out"  # empty
sweep() {  # NAME OPTIONS...: a part of a front, in OUT/NAME_N
  part=$((${part:-0} + 1))
  "$program" compare --judge motion "${@:2}" --out "$out/$1_$part" || [[ $? == 1 ]]  # 1: a row is not finite
}
front() { "$program" compare --merge "$out/$1"_* --out "$out/$1"; }

bunny=(--scene bunny-drop --steps 160)
sweep bunny "${bunny[@]}" --modes node --iterations 1 --substeps 1,2,3,5,10,20,50
sweep bunny "${bunny[@]}" --modes node,constraint --iterations 5,25 --substeps 1
sweep bunny "${bunny[@]}" --modes constraint --iterations 1 --substeps 5,20
sweep bunny "${bunny[@]}" --modes paper --iterations 5,25 --substeps 1 --mass-splitting 0 --rigid-contact 0
sweep bunny "${bunny[@]}" --modes cpu-fast --iterations 1 --substeps 1,2,5,10,20
sweep bunny "${bunny[@]}" --modes cpu,cpu-double --iterations 1 --substeps 1,5
sweep bunny "${bunny[@]}" --modes rigid-body --iterations 1 --substeps 1,3,5,50
front bunny

beam=(--scene soft-beam --material neo-hookean --steps 80)
sweep beam "${beam[@]}" --modes node --iterations 1 --substeps 1,2,5,10,20,50,100,200
sweep beam "${beam[@]}" --modes node,constraint --iterations 5,25 --substeps 1
sweep beam "${beam[@]}" --modes constraint --iterations 1 --substeps 5,20,50
sweep beam "${beam[@]}" --modes cpu-fast --iterations 1 --substeps 1,2,5,10,20
sweep beam "${beam[@]}" --modes cpu --iterations 1 --substeps 1,5,20
for stability in 0.2 0.4 0.6 0.9; do sweep beam "${beam[@]}" --modes explicit --iterations 1 --substeps 1 --stability $stability; done
sweep beam "${beam[@]}" --modes newton --iterations 1,2,3,4,8 --substeps 1
sweep beam "${beam[@]}" --modes newton --iterations 4,8 --substeps 2
sweep beam "${beam[@]}" --modes direct --iterations 1,2 --substeps 1
front beam
