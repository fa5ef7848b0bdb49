#!/usr/bin/env bash
# The commands of docs/guide.md, "Recipes", as they stand there.
# Usage: recipes_test.sh PROGRAM GUIDE FOLDER
set -euo pipefail
program=$(realpath "$1") guide=$(realpath "$2") here=$(dirname "$(realpath "$0")")
rm -rf "$3" && mkdir -p "$3/bin" && cd "$3"
ln -s "$program" bin/tetpbd
export PATH=$PWD/bin:$PATH

"$here/ring_mesh.sh" >my.obj

# A task of a Slurm array, without Slurm.
srun() { "$@"; }
export SLURM_ARRAY_TASK_ID=2 PARALLEL_HOME=$PWD

mapfile -t commands < <(awk '/^## / { recipes = /^## Recipes/ } /^```/ { fence = !fence; code = fence && $0 !~ /json/; next } recipes && code' "$guide")
for command in "${commands[@]}"; do
  echo "$command"
  eval "$command"
done
for file in my.mp4 chart/motion.svg my/frames.pvd my/surface.obj my/surface.pc2 many/stats.json joined/compare.csv task2/compare.csv; do
  [[ -s $file ]] || { echo "recipes: no $file" >&2; exit 1; }
done
