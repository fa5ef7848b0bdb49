#!/usr/bin/env bash
# Feeds readers with libFuzzer: tests/fuzz/run.sh RUNS [READER...]. New inputs and crashes go to build/fuzz/corpus/READER.
# Needs clang and libclang-rt-14-dev; see docs/extending.md.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
runs=${1:?how many runs of each reader}
shift
program=build/fuzz/tetpbd_fuzz
cmake --preset fuzz >/dev/null
cmake --build --preset fuzz
[ $# -gt 0 ] || set -- triangles tets node msh vtk vtu medit cache ply obj stl off scene overrides words
export ASAN_OPTIONS=allocator_may_return_null=0 UBSAN_OPTIONS=print_stacktrace=1
for reader in "$@"; do
  grown=build/fuzz/corpus/$reader
  mkdir -p "$grown"
  echo "== $reader"
  FUZZ_READER=$reader $program -runs="$runs" -rss_limit_mb=2048 -malloc_limit_mb=1024 -timeout=10 -verbosity=0 \
    -print_final_stats=1 -close_fd_mask=1 -artifact_prefix="$grown/" "$grown" "tests/corpus/$reader"
done
