#!/usr/bin/env bash
# The commands of pages as they stand there, but those that open the window.
# Usage: recipes_test.sh PROGRAM FOLDER PAGE...
set -euo pipefail
program=$(realpath "$1") here=$(dirname "$(realpath "$0")")
mapfile -t pages < <(realpath "${@:3}")
rm -rf "$2" && mkdir -p "$2/bin" && cd "$2"
ln -s "$program" bin/tetpbd
export PATH=$PWD/bin:$PATH

"$here/ring_mesh.sh" >my.obj

# A task of a Slurm array, without Slurm.
srun() { "$@"; }
export SLURM_ARRAY_TASK_ID=2 PARALLEL_HOME=$PWD

# Blocks without a language are commands, except those that a comment before them calls a file or a row.
mapfile -t commands < <(awk '
  /^<!-- (file|row): / { named = 1 }
  /^```/ { fence = !fence; code = fence && $0 == "```" && !named; if (!fence) named = 0; next }
  code && !/^tetpbd view/' "${pages[@]}")
for command in "${commands[@]}"; do
  echo "$command"
  eval "$command"
done
for file in my.mp4 chart/motion.svg my/frames.pvd my/surface.obj my/surface.pc2 many/stats.json joined/compare.csv task2/compare.csv; do
  [[ -s $file ]] || { echo "recipes: no $file" >&2; exit 1; }
done
