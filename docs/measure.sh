#!/usr/bin/env bash
# Measures what README.md and docs/results.md quote: docs/data/PART.json, from which docs/measured.py fills their tables.
# A part takes at most ten minutes on one GPU; one whose file is there is left out, so that an interrupted run goes on.
# Usage: docs/measure.sh [PART ...]; TETPBD names the program, COMMIT what it was built from, DATA where files go.
set -euo pipefail
here=$(dirname "$(realpath "$0")")
program=${TETPBD:-$here/../build/release/tetpbd} data=${DATA:-$here/data} runs=${RUNS:-5}
commit=${COMMIT:-$(git -C "$here" rev-parse --short=12 HEAD)}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# A command, so many times, for the quartiles of its times; each leaves compare.json or stats.json.
measure() {  # TIMES WORDS...
  local number times=$1 k
  number=$(find "$work/$part" -mindepth 1 -maxdepth 1 | wc -l)
  mkdir -p "$work/$part/$number"
  echo "tetpbd ${*:2}" >"$work/$part/$number/command"
  for k in $(seq "$times"); do
    "$program" "${@:2}" --out "$work/$part/$number/$k" >"$work/log" 2>&1 || [[ $? == 1 && -e $work/$part/$number/$k ]] ||
      { tail -n 3 "$work/log" >&2; return 1; }
  done
}

hard() {
  "$program" reference --scene bunny-drop --steps 160 >/dev/null
  for solver in hard substeps paper; do
    measure "$runs" run --scene bunny-drop --solver $solver --steps 160 --csv-every 0
  done
  measure 1 compare --scene bunny-drop --steps 160 --judge motion --modes rigid-body --iterations 1 --substeps 5
}

beam() {
  local scene=(--scene soft-beam --material neo-hookean --steps 80 --judge motion --iterations 1)
  measure "$runs" compare "${scene[@]}" --modes node --substeps 20,50,200
  measure "$runs" compare "${scene[@]}" --modes cpu-fast --substeps 5,10,20
  for stability in 0.4 0.9; do
    measure "$runs" compare "${scene[@]}" --modes explicit --substeps 1 --stability $stability
  done
  scene=(--scene soft-beam --material neo-hookean --steps 80 --judge motion --substeps 1)
  measure "$runs" compare "${scene[@]}" --modes newton --iterations 2,4
  measure 1 compare "${scene[@]}" --modes direct --iterations 1
}

bunny() {
  for modulus in 5e4 1e6; do
    local scene=(--scene clamped-bunny --fill tetgen --young-modulus $modulus --steps 40 --judge motion)
    measure "$runs" compare "${scene[@]}" --modes node --iterations 1 --substeps 20,50
    for stability in 0.4 0.9; do
      measure "$runs" compare "${scene[@]}" --modes explicit --iterations 1 --substeps 1 --stability $stability --mass-scaling 0
    done
    measure "$runs" compare "${scene[@]}" --modes newton --iterations 2,4 --substeps 1
  done
}

# Other methods in the same program, on the same scenes.
rivals() {
  local scene
  for scene in "soft-beam --material neo-hookean --steps 80" "clamped-bunny --fill tetgen --young-modulus 5e4 --steps 40" \
    "clamped-bunny --fill tetgen --young-modulus 1e6 --steps 40"; do
    # shellcheck disable=SC2086
    measure "$runs" compare --scene $scene --judge motion --modes gauss-seidel --iterations 1 --substeps 5,10,20,50
    for acceleration in 0 0.9; do
      # shellcheck disable=SC2086
      measure "$runs" compare --scene $scene --judge motion --modes vbd --iterations 10,30,100 --substeps 1 --acceleration $acceleration
    done
  done
}

# Scenes of other programs, at their own steps. The reference motion of a damped beam takes minutes, once.
published() {
  local scene
  for scene in "sofa-beam --steps 50" "sofa-beam-fine --steps 10" "newton-beams --steps 60"; do
    # shellcheck disable=SC2086
    measure "$runs" compare --scene published/$scene --judge motion --modes newton --iterations 2,4 --substeps 1,4
    # shellcheck disable=SC2086
    measure "$runs" compare --scene published/$scene --judge motion --modes vbd --iterations 10 --substeps 10
  done
  measure "$runs" run --scene published/mgpbd-bunny --steps 1 --iterations 100 --csv-every 0
  measure "$runs" run --scene published/vbd-ball --steps 20 --csv-every 0
}

# Implicit steps over stiffness and step: errors alone, which are those of any machine.
stiffness() {
  local scene=(--scene beam --set "bodies.0.block.cells=[8,3,3]" --material neo-hookean --modes newton --iterations 4 --substeps 1)
  for dt in 0.001 0.005 0.05; do
    for modulus in 1e4 1e5 1e6 1e7 1e8 1e9; do
      measure 1 compare "${scene[@]}" --young-modulus $modulus --dt $dt --steps "$(awk -v dt=$dt 'BEGIN {print 0.4 / dt}')" --judge motion
    done
  done
}

copies() {
  for count in 1 8 64 512; do
    measure "$runs" run --scene jelly-beam --mode explicit --copies $count --steps 400 --measure-every 1000 --csv-every 0
  done
}

mkdir -p "$data"
[[ $# -gt 0 ]] || set -- hard beam bunny rivals published stiffness copies
for part in "$@"; do
  [[ -e $data/$part.json ]] && continue
  mkdir -p "$work/$part"
  $part
  "$here/measured.py" collect "$work/$part" "$data/$part.json" "$commit"
  echo "$data/$part.json"
done
