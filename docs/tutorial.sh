#!/usr/bin/env bash
# The pictures of docs/tutorial.md, from its own commands with flags for drawing.
# Usage: docs/tutorial.sh                    makes docs/tutorial/*.png anew
#        docs/tutorial.sh commands FOLDER    runs the page's commands there, as they stand
#        docs/tutorial.sh window FOLDER      does there in the window what the page says (after commands)
# TETPBD names the program. Needs Xvfb, xdotool, ffmpeg and imagemagick; about a minute and a half on a software renderer.
set -euo pipefail
docs=$(dirname "$(realpath "${BASH_SOURCE[0]}")")
page=$docs/tutorial.md

blocks() {  # the page's lines of commands
  awk '/^```/ { fence = !fence; code = fence && $0 == "```"; next } code' "$page"
}

# For pictures: larger and nearer. FLAGS come last where a command is a run.
draw() {  # FLAGS...
  # shellcheck disable=SC2317,SC2329  # the page's lines call it
  tetpbd() {
    local flags=(--samples 8)
    [[ $* != *--size* ]] && flags+=(--size 480x400)
    if [[ $* == *--cut* ]]; then flags+=(--set camera.distance=2 --set 'camera.target=[0.12,0.42,0]');
    elif [[ $* == *"--scene bunny "* ]]; then flags+=(--set camera.distance=2.6 --set 'camera.target=[0,0.55,0]'); fi
    if [[ $1 == run ]]; then command tetpbd "$@" "${flags[@]}"; else command tetpbd "$@"; fi
  }
}

run_commands() {  # FOLDER
  mkdir -p "$1/bin" && cd "$1"
  ln -sf "$program" bin/tetpbd
  export PATH=$PWD/bin:$PATH TETPBD_CACHE=$PWD/cache
  awk '/^<!-- file: / { name = $3; next } /^```/ { if (name && inside) name = ""; inside = !inside; next } inside && name { print >name }' "$page"
  "$docs/../tests/ring_mesh.sh" >my.obj
  local line
  while IFS= read -r line <&3; do
    [[ $line == "tetpbd view"* ]] && continue  # of the window
    echo "\$ $line"
    eval "$line"
  done 3< <(blocks)
}

# Under Xvfb, in FOLDER/window: four lanes at 0.4 s, and a fall that is taken back to step 60.
drive_window() {
  export TETPBD_CACHE=$PWD/../cache  # with the reference motion that the commands found
  local words
  eval "$(blocks | grep '^beam=')"
  eval "words=($(blocks | sed -n 's/^tetpbd view //p'))"
  go_to() {  # STEP, from one that is not far
    local at
    for _ in $(seq 400); do
      at=$(grep -oE '^(moment|state) [0-9]+' "$log" | tail -n 1 | grep -oE '[0-9]+')
      if ((at == $1)); then return; fi
      if ((at < $1)); then key s; else key Left; fi
      await '^state '
    done
    fail "it does not get to step $1"
  }
  open_window --size 960x600 --samples 4 "${words[@]}"
  await '^running ([6-9][0-9]|[1-9][0-9]{2})'
  key space; await '^state '
  go_to 80
  sleep 1
  shot lanes.png
  cp "$log" lanes.log
  close_window
  open_window --size 960x600 --samples 4
  await '^running ([6-9][0-9]|[1-9][0-9]{2})'
  key space; await '^state '
  go_to 80
  go_to 60
  sleep 1
  shot timeline.png
  cp "$log" timeline.log
  close_window
}

make_pictures() {
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
  export TETPBD=$program
  draw
  run_commands "$work"
  "$docs/tutorial.sh" window "$work"
  local to=$docs/tutorial
  mkdir -p "$to"
  row() {  # CROP SIZE OUT PICTURE...: side by side
    convert "${@:4}" -gravity center -crop "$1+0+0" +repage -resize "$2!" +append -strip "$to/$3.png"
  }
  row 320x390 213x260 drop drop/frame_000{00,60,80}.png
  row 320x390 213x260 stiffness {soft,medium,stiff}/frame_00066.png
  row 480x400 320x267 scene mine/frame_000{00,80}.png
  cp strain/frame_00060.png "$to/strain.png"
  cp volume/frame_00060.png "$to/volume.png"
  # Frames 1/30 s apart.
  ffmpeg -v error -y -i my.mp4 -vf "select=eq(n\,9)+eq(n\,14)+eq(n\,19)" -vsync 0 film_%d.png
  row 320x360 213x240 film film_{1,2,3}.png
  convert map/map.png -resize 640x -strip "$to/map.png"
  local name
  for name in lanes timeline; do convert "window/$name.png" -crop 640x600+0+0 +repage -strip "$to/$name.png"; done
  ls -l "$to"
}

if [[ ${1:-} != --inside ]]; then
  program=$(realpath "${TETPBD:-$docs/../build/release/tetpbd}")
fi
case ${1:-pictures} in
  pictures) make_pictures ;;
  commands) run_commands "$2" ;;
  window | --inside)
    # shellcheck source=tests/app/window_driver.sh
    source "$docs/../tests/app/window_driver.sh"
    if [[ $1 == window ]]; then begin_inside "$program" "$2/window"; fi
    set +e
    begin_inside "$@"
    drive_window
    exit 0  # else fail has ended it
    ;;
  *) sed -n '3,6s/^# //p' "${BASH_SOURCE[0]}" >&2; exit 2 ;;
esac
