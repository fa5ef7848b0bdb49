#!/usr/bin/env bash
# Random use of the real window under Xvfb by real input: sliders, combos, buttons, text, keys, camera, pulling, pinning,
# sizes, hiding, other scenes. Passes if it neither crashes, hangs, makes a GL error nor grows. The seed fixes what is
# chosen; what was sent is kept in FOLDER/actions.txt, with which a run can be repeated.
# Usage: monkey.sh PROGRAM FOLDER SEED COUNT | monkey.sh PROGRAM FOLDER --replay ACTIONS
# All it writes is in FOLDER, which it empties first.
set -uo pipefail
if [[ ${1:-} != --inside ]]; then
  exec xvfb-run -a -s "-screen 0 800x600x24" "$0" --inside "$@"
fi
program=$(realpath "$2") folder=$3 seed=$4 count=$5 replay=
[[ $seed == --replay ]] && replay=$(realpath "$5") seed=0 count=0
rm -rf "$folder" && mkdir -p "$folder/models/scenes" && cd "$folder" || exit 1
# Scenes, meshes, caches and screenshots are the folder's own: nothing the monkey opens or saves is elsewhere.
export HOME=$PWD TETPBD_MODELS=$PWD/models TETPBD_CACHE=$PWD/cache TETPBD_GL_DEBUG=1 MESA_GL_VERSION_OVERRIDE=4.3
export TETPBD_WINDOW_LOG=$PWD/events.log
log=$TETPBD_WINDOW_LOG

scene() {  # NAME BODIES REST
  echo "{\"name\": \"$1\", \"bodies\": [$2], \"solver\": {\"mode\": \"node\", \"iterations\": 4, \"dt\": 0.01}$3}" >"models/scenes/$1.json"
}
scene one '{"name": "a", "block": {"size": [1, 1, 1], "cells": [2, 2, 2]}, "position": [0, 0.2, 0]}' ""
scene held '{"name": "a", "block": {"size": [2, 0.5, 0.5], "cells": [6, 2, 2]}, "position": [0, 1, 0],
  "fixed": [{"low": [0, 0, 0], "high": [0.01, 1, 1]}]}' ""
scene two '{"name": "a", "block": {"size": [1, 1, 1], "cells": [2, 2, 2]}, "position": [0, 0, 0]},
  {"name": "b", "block": {"size": [0.5, 1, 0.5], "cells": [1, 3, 1]}, "position": [1.5, 0.5, 0], "deform": "random"}' \
  ', "world": {"obstacles": [{"point": [0, 0, -1], "normal": [0, 0, 1]}]}'
# Its steps take longer than a frame may, so that the thread takes them.
echo '{"name": "slow", "bodies": [{"name": "a", "block": {"size": [1, 1, 1], "cells": [8, 8, 8]}, "position": [0, 0.2, 0]}],
  "solver": {"mode": "node", "material": "neo-hookean", "substeps": 100, "dt": 0.01}}' >models/scenes/slow.json
cat >cube.off <<'END'
OFF
8 12 0
0 0 0
1 0 0
1 1 0
0 1 0
0 0 1
1 0 1
1 1 1
0 1 1
3 0 2 1
3 0 3 2
3 4 5 6
3 4 6 7
3 0 1 5
3 0 5 4
3 1 2 6
3 1 6 5
3 2 3 7
3 2 7 6
3 3 0 4
3 3 4 7
END
echo "this is no mesh" >bad.ply

pid= done_actions=0
fail() {
  echo "FAILED after $done_actions actions, seed $seed: $*" >&2
  echo "repeat: $0 $program FOLDER $seed $count, or FOLDER --replay $PWD/actions.txt" >&2
  tail -n 12 "$log" >&2
  tail -n 5 output.txt >&2
  import -window root failed.png
  [[ -n $pid ]] && kill -9 "$pid" 2>/dev/null
  exit 1
}
alive() { kill -0 "$pid" 2>/dev/null || fail "the program ended"; }
resident() { awk '/^VmRSS/ {print $2}' "/proc/$pid/status"; }  # KiB

"$program" view --scene one --size 480x360 --samples 0 --no-shadow --history-mb 16 --record session.jsonl >output.txt 2>&1 &
pid=$!
for _ in $(seq 600); do grep -q '^ready' "$log" 2>/dev/null && break; kill -0 $pid 2>/dev/null || break; sleep 0.1; done
grep -q '^ready' "$log" 2>/dev/null || fail "no window"
sleep 0.5
window=$(xdotool search --onlyvisible --pid $pid | tail -n 1)
[[ -n $window ]] || fail "no window on the display"
xdotool windowfocus "$window"

# One xdotool for everything: a process an action would take longer than the action.
mkfifo commands
xdotool - <commands &
exec 4>commands
exec 5<"$log" 6>actions.txt
send() {
  echo "$1" >&6
  echo "${1//WINDOW/$window}" >&4
}

# What the log says so far: where widgets are, and what of it was asked for.
declare -A places
names=() size_seen= panels=true help=false
follow() {
  local line name
  while IFS= read -r -u 5 line; do
    if [[ $line =~ ^at\ (.+)\ (-?[0-9]+)\ (-?[0-9]+)\ ([0-9]+)\ ([0-9]+)$ ]]; then
      name=${BASH_REMATCH[1]}
      [[ -n ${places[$name]:-} ]] || names+=("$name")
      places[$name]="${BASH_REMATCH[2]} ${BASH_REMATCH[3]} ${BASH_REMATCH[4]} ${BASH_REMATCH[5]}"
    elif [[ $line == "size "* ]]; then
      size_seen=${line#size }
    elif [[ $line == "panels "* ]]; then
      panels=${line#panels }
    elif [[ $line == "help "* ]]; then
      help=${line#help }
    fi
  done
}
# Shows the window again in a size it has not had, and waits until the program says so: it is neither gone nor stuck.
width=483
answer() {
  width=$((width == 483 ? 485 : 483)) size_seen=  # no action asks for these
  send "windowmap WINDOW"
  send "windowfocus WINDOW"
  send "windowsize WINDOW $width 360"
  for ((i = 0; i < 1200; ++i)); do
    follow
    if [[ $size_seen == "$width 360" ]]; then  # what covers or hides the widgets is put away
      [[ $help == true ]] && key Escape
      [[ $panels == false ]] && key Escape && key Tab
      return
    fi
    alive
    sleep 0.05
  done
  fail "no answer for 60 s: it hangs"
}

# ------------------------------------------------------------------------------------------------------------ actions
RANDOM=$((seed % 32768))
r=0  # what the pickers leave: no subshell, for that would have a random sequence of its own
pick() { r=$((((RANDOM << 15) | RANDOM) % $1)); }
one_of() { pick $#; shift "$r"; r=$1; }
x=0 y=0
in_widget() {  # NAME -> x y
  local place=(${places[$1]})
  pick $((place[2] + 1)); x=$((place[0] + r))
  pick $((place[3] + 1)); y=$((place[1] + r))
}
any_widget() { pick ${#names[@]}; widget=${names[$r]}; in_widget "$widget"; }
anywhere() { pick 482; x=$r; pick 360; y=$r; }
pause() { send "sleep 0.0$((RANDOM % 3 + 1))"; }
move() { send "mousemove --window WINDOW $x $y"; }
click() { send "mousedown ${1:-1}"; pause; send "mouseup ${1:-1}"; }
drag_somewhere() {  # BUTTON, from where the cursor is
  send "mousedown $1"
  pick 6
  for ((i = 0; i <= r; ++i)); do
    send "mousemove_relative -- $((RANDOM % 121 - 60)) $((RANDOM % 121 - 60))"
    pause
  done
  send "mouseup $1"
}
key() { send "keydown $1"; pause; send "keyup $1"; }
enter_text() {
  send "sleep 0.06"; send "key ctrl+a"; send "sleep 0.06"
  [[ -n $1 ]] && send "type --delay 4 -- $1"
  one_of Return Return Return Return Escape
  key "$r"
}
combo() {
  one_of scene mode look colour MSAA "side by side" speed
  local name=$r choices=() other
  [[ -n ${places[$name]:-} ]] || return
  in_widget "$name"; move; pause; click; send "sleep 0.12"
  for other in "${names[@]}"; do [[ $other == "$name="* ]] && choices+=("$other"); done
  if [[ ${#choices[@]} -gt 0 ]]; then
    pick ${#choices[@]}; in_widget "${choices[$r]}"
  else
    anywhere
  fi
  move; send "sleep 0.06"; click; pause
}
action() {
  pick 100
  local a=$r
  if ((a < 16)); then what="click widget"; any_widget; move; pause; click
  elif ((a < 28)); then what="drag widget"; any_widget; move; pause; drag_somewhere 1
  elif ((a < 34)); then
    what="type value"; any_widget; move; send "keydown ctrl"; click; send "keyup ctrl"; pause
    one_of 1 0 0.5 -3 1e9 1e-30 abc nan 7 100 "" 3.14159
    enter_text "$r"
  elif ((a < 44)); then what=combo; combo
  elif ((a < 58)); then
    what=key
    one_of space s r f 1 2 3 4 c x n g m p h F1 Escape Left Left Right comma period space s r KP_1 k k j o w Up Delete BackSpace ctrl+a ctrl+z alt+s shift+r
    key "$r"
  elif ((a < 61)); then what="key held"; one_of s Left Right; send "keydown $r"; send "sleep 0.3"; send "keyup $r"
  elif ((a < 73)); then what="drag anywhere"; anywhere; move; pause; one_of 1 1 1 2 3; drag_somewhere "$r"
  elif ((a < 76)); then
    what="drag with shift"; anywhere; move; send "keydown shift"; drag_somewhere 1; send "keyup shift"
  elif ((a < 80)); then
    what="pin"; anywhere; move; pause; one_of "click --repeat 2 --delay 30 1" "keydown ctrl"
    if [[ $r == click* ]]; then send "$r"; else send "$r"; click; send "keyup ctrl"; fi
  elif ((a < 86)); then what=wheel; anywhere; move; pick 3; ((r)) || send "keydown alt"; one_of 4 5 6 7; send "click --repeat $((RANDOM % 8 + 1)) --delay 5 $r"; send "keyup alt"
  elif ((a < 89)); then
    what="two buttons"; anywhere; move; send "mousedown 1"; pause; send "mousedown 3"; anywhere; move; pause
    one_of "1 3" "3 1"; send "mouseup ${r% *}"; pause; one_of space r Escape p; key "$r"; send "mouseup 1"; send "mouseup 3"
  elif ((a < 93)); then
    what="mesh file"
    if [[ -n ${places[mesh]:-} ]]; then
      in_widget mesh; move; pause; click; pause
      one_of cube.off bad.ply none.obj / . models/scenes/one.json "" cube.off
      enter_text "$r"; pause
    fi
  elif ((a < 96)); then
    what=size; pick 10
    if ((r < 2)); then send "windowsize WINDOW $((RANDOM % 40 + 1)) $((RANDOM % 40 + 1))"
    else send "windowsize WINDOW $((RANDOM % 700 + 60)) $((RANDOM % 520 + 60))"; fi
    pause; pause
    pick 4; ((r)) && send "windowsize WINDOW 480 360"
  elif ((a < 98)); then  # what a window manager does to minimise: state Iconic, unmapped
    what=minimise
    send "exec --sync xprop -id WINDOW -f WM_STATE 32i -set WM_STATE 3"; send "windowunmap WINDOW"; send "sleep 0.2"
    send "exec --sync xprop -id WINDOW -f WM_STATE 32i -set WM_STATE 1"; send "windowmap WINDOW"; send "sleep 0.05"
    send "windowfocus WINDOW"
  elif ((a < 99)); then what="without panels"; key Tab; anywhere; move; drag_somewhere 1; pause; key Tab
  else what="unmap"; send "windowunmap WINDOW"; pause; one_of space s r; key "$r"; send "windowmap WINDOW"; send "sleep 0.05"; send "windowfocus WINDOW"
  fi
}

report() { echo "$done_actions actions, $SECONDS s: resident $(resident) KiB"; }
follow
early=
if [[ -n $replay ]]; then
  while IFS= read -r line; do send "$line"; done <"$replay"
else
  while ((done_actions < count)); do
    action
    echo "# $done_actions $what" >&6
    ((++done_actions))
    ((done_actions % 20)) || { follow; alive; }
    ((done_actions % 25)) || answer
    if ((done_actions == 200 || done_actions == 2000 || done_actions == count)); then
      report
      ((done_actions < count)) && early=$(resident)
    fi
  done
fi
answer

# ------------------------------------------------------------------------------------------------------------- the end
late=$(resident)
for _ in $(seq 40); do
  send "mouseup 1"; send "mouseup 2"; send "mouseup 3"; send "keyup ctrl"; send "keyup shift"
  key Escape; key Escape; key ctrl+q
  sleep 0.5
  kill -0 $pid 2>/dev/null || break
done
exec 4>&-
kill -0 $pid 2>/dev/null && fail "Ctrl+Q does not end it"
wait $pid; status=$?
[[ $status -eq 0 ]] || fail "exit status $status"
[[ $(tail -n 1 "$log") == closed ]] || fail "it did not close in order"
grep -i "GL error" output.txt && fail "GL errors"
grep -q "^error.*unexpected" "$log" && fail "an unexpected error"
# All it did is done again without a window, to the same states.
"$program" run --replay session.jsonl --out again >again.txt 2>&1 || fail "the record cannot be done again: $(tail -n 1 again.txt)"
# A scene just loaded holds as much of GL as the first time with as many lanes; the view's target and screenshots add some.
grown=$(awk '$1 == "scene" {name = $2} $1 == "lane" && name != "" {name = name "+"} $1 == "live" && name != "" {
  if (!(name in first)) first[name] = $2; last[name] = $2; bytes[name] = $3; name = ""}
  END {most = 0; for (n in first) if (last[n] - first[n] > most) most = last[n] - first[n]; print most}' "$log")
((grown <= 12)) || fail "GL objects after loading a scene grew by $grown"
if [[ -n $early ]]; then
  # Allocators keep what a large window once took; a leak shows in thousands of actions.
  ((late - early < 40960)) || fail "resident memory grew from $early to $late KiB"
fi
echo "monkey: seed $seed, $done_actions actions, $(grep -c '^scene ' "$log") scenes, $(grep -c '^set ' "$log") settings," \
  "$(grep -c '^grab ' "$log") grabs, $(grep -c '^pin ' "$log") pins, $(grep -c '^screenshot ' "$log") screenshots," \
  "$(grep -c '^error ' "$log") errors said, GL objects +$grown, resident $late KiB; passed in $SECONDS s"
