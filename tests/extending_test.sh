#!/usr/bin/env bash
# docs/extending.md as it stands: its blocks are applied to a copy of the sources, counted, built and run. A row changes
# the layout of what nearly all files include, so nearly all of it is built: minutes.
#   extending_test.sh SOURCES FOLDER [PAGE]
# A comment on a line of its own says what the code block after it is:
#   <!-- file: PATH -->             this new file
#   <!-- row: PATH after: TEXT -->  goes behind the first line of PATH that holds TEXT
# and these stand alone:
#   <!-- run: COMMAND -->           run when all is built, in an empty folder; tetpbd and tetpbd_tests are found
#   <!-- touches: F R T -->         the section's new files, rows, and tests (files or rows in tests/); else 1 1 1
set -euo pipefail
sources=$(realpath "$1") page=${3:-$1/docs/extending.md}
page=$(realpath "$page")
rm -rf "$2" && mkdir -p "$2" && cd "$2" && mkdir copy run
fail() { echo "extending: $*" >&2; exit 1; }

cp -r "$sources"/{CMakeLists.txt,cmake,shaders,sim,render,app,tests} copy/
rm copy/tests/*/test_*.cpp  # those of the page are what is built
cat >copy/tests/CMakeLists.txt <<'CMAKE'
find_package(doctest REQUIRED)
file(GLOB TEST_SOURCES */test_*.cpp)
add_executable(tetpbd_tests main.cpp ${TEST_SOURCES})
target_link_libraries(tetpbd_tests PRIVATE tetpbd_sim doctest::doctest)
CMAKE

section='' files=0 rows=0 tests=0 wanted='1 1 1' what='' inside=false
end_section() {
  [[ "$files $rows $tests" == '0 0 0' ]] && return
  echo "$section: $files new file(s), $rows row(s), $tests test(s)"
  [[ "$files $rows $tests" == "$wanted" ]] || fail "'$section' should touch $wanted"
}
apply() {  # block.txt, as $what says
  local path=copy/${what#*: } text=''
  case $what in
    file:*)
      [[ -e $path ]] && fail "$path is there already"
      mkdir -p "$(dirname "$path")" && cp block.txt "$path"
      [[ $path == copy/tests/* ]] || files=$((files + 1)) ;;
    row:*)
      text=${path#* after: } path=${path%% after: *}
      [[ $path != copy/tests/*/test_* || -e $path ]] || cp "$sources/${path#copy/}" "$path"
      local line
      line=$(grep -nFm1 -- "$text" "$path" | cut -d: -f1) || fail "no line of $path holds: $text"
      sed -i "${line}r block.txt" "$path"
      [[ $path == copy/tests/* ]] || rows=$((rows + 1)) ;;
  esac
  if [[ $path == copy/tests/* ]]; then tests=$((tests + 1)); fi
  what=''
}
: >commands.txt
while IFS= read -r line; do
  if $inside; then
    if [[ $line == '```' ]]; then inside=false; apply; else printf '%s\n' "$line" >>block.txt; fi
    continue
  fi
  case $line in
    '## '*) end_section; section=${line#\#\# } files=0 rows=0 tests=0 wanted='1 1 1' ;;
    '<!-- run: '*' -->') line=${line#<!-- run: }; echo "${line% -->}" >>commands.txt ;;
    '<!-- touches: '*' -->') line=${line#<!-- touches: }; wanted=${line% -->} ;;
    '<!-- file: '*' -->' | '<!-- row: '*' -->') what=${line#<!-- }; what=${what% -->} ;;
    '```'*) if [[ -n $what ]]; then inside=true; : >block.txt; fi ;;
  esac
done <"$page"
end_section

# Files that the page names are there, the new ones among them.
grep -oE '`(app|render|shaders|sim|tests)/[A-Za-z0-9_/]+\.[a-z]+`' "$page" | tr -d '`' | sort -u | while IFS= read -r file; do
  [[ -e copy/$file || -e $sources/$file ]] || fail "the page names $file"
done

# The compiler is what takes long, so nothing is optimised, and OpenVDB's headers, which no example needs, are left out.
launcher=$(command -v ccache || true)
cmake -G Ninja -S copy -B build -DTETPBD_WERROR=ON -DCMAKE_BUILD_TYPE=Debug -DCMAKE_CXX_FLAGS_DEBUG=-O0 -DTETPBD_OPENVDB_INCLUDE= \
  ${launcher:+-DCMAKE_CXX_COMPILER_LAUNCHER="$launcher"} >configure.log || { cat configure.log; fail "configuring"; }
cmake --build build --target tetpbd_tests tetpbd >build.log 2>&1 || { cat build.log; fail "building"; }
export TETPBD_MODELS=$sources/models PATH=$PWD/build:$PWD/build/tests:$PATH
cd run
while IFS= read -r command; do
  echo "\$ $command"
  bash -euo pipefail -c "$command" </dev/null || fail "$command"
done <../commands.txt
