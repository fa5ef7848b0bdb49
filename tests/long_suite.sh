# Sourced by test.sh: the long suite, which goes on where it was interrupted.

# The tests' environment is that of the short suite, and two variables that tests/long_run.h reads.
run_long_suite() {  # [SEED] [ARGUMENTS of ctest]
  local seed=0 commit folder all left
  if [[ ${1:-} =~ ^[0-9]+$ ]]; then seed=$1; shift; fi
  commit=$(git rev-parse --short=12 HEAD 2>/dev/null || echo archive)
  git diff --quiet HEAD -- . ":!docs/data" 2>/dev/null || commit+=-changed
  folder=build/ci/long_suite/$commit-$seed
  # What is not committed can change between two runs, so that nothing which passed before counts.
  [[ $commit == *-changed || $commit == archive* ]] && rm -rf "$folder"
  mkdir -p "$folder"
  touch "$folder/log.txt" "$folder/worst.txt"
  export TETPBD_LONG=$PWD/$folder/worst.txt TETPBD_SEED=$seed

  numbers() { sed -nE "s/$1/\1/p" | sort -u; }
  all=$(ctest --preset long -N "$@" | numbers '^ *Test +#([0-9]+): .*')
  passed() { numbers '.* Test +#([0-9]+): .* Passed .*' <"$folder/log.txt"; }
  left=$(comm -23 <(echo "$all") <(passed) | paste -sd,)
  # A list that starts at a number above all others holds those that are named behind it alone.
  [[ -z $left ]] || ctest --preset long -j"$(nproc)" -I "1000000,1000000,1,$left" | tee -a "$folder/log.txt" || true
  left=$(comm -23 <(echo "$all") <(passed) | wc -l)
  [[ $left -eq 0 ]] || { echo "long suite: $left of $(wc -w <<<"$all") tests have not passed; ./test.sh --long again runs these alone" >&2; return 1; }
  [[ $# -eq 0 ]] || return 0  # a part of it is not the long suite

  mkdir -p docs/data
  {
    printf '{"commit": "%s", "seed": %d, "tests": %d, "worst": [' "$commit" "$seed" "$(wc -w <<<"$all")"
    awk -F '\t' '!($1 in value) || $2 > value[$1] {value[$1] = $2; most[$1] = $3}
      END {for (name in value) printf "{\"value\": \"%s\", \"worst\": %s, \"at_most\": %s}\n", name, value[name], most[name]}' \
      "$folder/worst.txt" | sort | paste -sd, | sed 's/},{/},\n  {/g; s/^/\n  /'
    printf ']}\n'
  } >docs/data/long-suite.json
  cat docs/data/long-suite.json
}
