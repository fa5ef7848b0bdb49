#!/usr/bin/env bash
# Another program uses the installed library: docs/examples/embed, which docs/embedding.md shows, is built outside the sources,
# and moves a vertex to where tetpbd does.
#   embed_test.sh SOURCES BUILD_FOLDER FOLDER
set -euo pipefail
sources=$(realpath "$1") build=$(realpath "$2")
rm -rf "$3" && mkdir -p "$3" && cd "$3"
fail() { echo "FAILED: $*" >&2; exit 1; }

for file in CMakeLists.txt main.cpp; do
  awk -v start="<!-- file: $file -->" '$0 == start {on = 1; next} on && /^```$/ {exit} on && /^```/ {inside = 1; next} inside' \
    "$sources/docs/embedding.md" | diff - "$sources/docs/examples/embed/$file" || fail "docs/embedding.md shows another $file"
done

cmake --install "$build" --component library --prefix "$PWD/prefix" >install.log || fail "installing: $(cat install.log)"
cp -r "$sources/docs/examples/embed" embed
launcher=$(command -v ccache || true)
cmake -G Ninja -S embed -B built -DCMAKE_PREFIX_PATH="$PWD/prefix" -DCMAKE_CXX_FLAGS="-Wall -Wextra -Wconversion -Werror" \
  ${launcher:+-DCMAKE_CXX_COMPILER_LAUNCHER="$launcher"} >configure.log 2>&1 || fail "configuring: $(tail -n 20 configure.log)"
cmake --build built >build.log 2>&1 || fail "building: $(head -n 20 build.log)"
# Neither the sources nor the build folder are needed any more, nor an environment that names them.
! grep -rlE "$sources/(sim|shaders|cmake)|$build" prefix/include prefix/lib/cmake || fail "the package names folders of its build"
place=$(env -i ${MESA_GL_VERSION_OVERRIDE:+MESA_GL_VERSION_OVERRIDE="$MESA_GL_VERSION_OVERRIDE"} built/embed) || fail "the example does not run"
[[ $place =~ ^-?[0-9.]+\ -?[0-9.]+\ -?[0-9.]+$ ]] || fail "no position: $place"

# The same by tetpbd, whose positions in scenes are those of the bottom: the last vertex ends numpy's file, as float32.
cat >block.json <<'SCENE'
{"bodies": [{"block": {"size": [0.4, 0.2, 0.4], "cells": [4, 2, 4], "mirror": false}, "position": [0, 0.2, 0], "density": 1000}],
 "solver": {"mode": "node", "material": "neo-hookean", "young_modulus": 1e5}}
SCENE
"$build/tetpbd" run --scene block.json --steps 100 --positions --out out >run.log 2>&1 || fail "tetpbd run: $(cat run.log)"
same=$(tail -c 12 out/positions.npy | od -An -t f4)
awk -v a="$place" -v b="$same" 'BEGIN {
  split(a, x, " "); split(b, y, " ")
  for (k = 1; k <= 3; ++k) if (!((x[k] - y[k]) ^ 2 < 4e-12)) exit 1
}' || fail "the vertex is at $place, of tetpbd at $same"
echo "embed: the last vertex is at $place, as of tetpbd run"
