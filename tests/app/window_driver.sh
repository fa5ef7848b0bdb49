# How tests drive the real window: sourced, with $program and $log set, in the folder where files may be made.
pid=
# Starts the script again under Xvfb, where it then sets these and goes to its folder.
begin_inside() {  # PROGRAM FOLDER
  [[ ${1:-} != --inside ]] && exec xvfb-run -a -s "-screen 0 1280x800x24" "$0" --inside "$@"
  program=$(realpath "$2") folder=$3
  rm -rf "$folder" && mkdir -p "$folder" && cd "$folder" || exit 1
  export TETPBD_GL_DEBUG=1 TETPBD_WINDOW_LOG=$PWD/events.log TETPBD_CACHE=$PWD/cache MESA_GL_VERSION_OVERRIDE=4.3
  log=$TETPBD_WINDOW_LOG
}
fail() {
  echo "FAILED: $*" >&2
  echo "--- last events:" >&2
  tail -n 15 "$log" >&2
  cat output.txt >&2
  import -window root failed.png
  [[ -n $pid ]] && kill "$pid" 2>/dev/null
  exit 1
}
mark=0  # lines of the log already dealt with
forget() { mark=$(wc -l <"$log"); }
new_events() { tail -n +$((mark + 1)) "$log"; }
# Polls: how long an event takes depends on the machine.
await() {  # PATTERN [TIMES]
  for _ in $(seq 1200); do
    [[ $(new_events | grep -cE "$1") -ge ${2:-1} ]] && return 0
    kill -0 "$pid" 2>/dev/null || fail "the program ended while waiting for '$1'"
    sleep 0.05
  done
  fail "no event '$1'"
}
# What Dear ImGui samples once a frame, such as a key that is held, has to stay for one. Presses and releases of buttons, and
# the shortcuts, are kept until the next frame and need no pause.
pause_for_frame() { sleep 0.2; }
# A shortcut.
key() { forget; xdotool key "$1"; }
place() {  # NAME -> x y width height
  local line
  for _ in $(seq 400); do
    line=$(grep -F "at $1 " "$log" | grep -E "^at $1 [0-9-]+ [0-9-]+ [0-9]+ [0-9]+\$" | tail -n 1)
    [[ -n $line ]] && break
    sleep 0.025
  done
  [[ -n $line ]] || fail "no widget '$1'"
  awk '{print $(NF-3), $(NF-2), $(NF-1), $NF}' <<<"$line"
}
point() {  # NAME part-of-width part-of-height -> x y
  read -r x y w h < <(place "$1")
  awk -v x="$x" -v y="$y" -v w="$w" -v h="$h" -v a="$2" -v b="$3" 'BEGIN {printf "%d %d\n", x + a * w, y + b * h}'
}
to() { xdotool mousemove $(point "$@"); pause_for_frame; }
press() { xdotool mousedown "$1"; pause_for_frame; }
release() { xdotool mouseup "$1"; pause_for_frame; }
# The cursor has to stay until the click is seen: the caller awaits what it does, or pauses.
click() {  # NAME part-of-width
  forget
  xdotool mousemove $(point "$1" "${2:-0.5}" 0.5) mousedown 1 mouseup 1
}
# Where widgets are has to be said anew after the panel's lines move: until no place has changed for a few frames.
settled() {
  local now last=
  for _ in $(seq 40); do
    now=$(grep -c '^at ' "$log")
    [[ $now == "$last" ]] && return
    last=$now
    sleep 0.5
  done
}
unfold() { click "section $1" 0.1; await "^opened $1"; settled; }
fold() { click "section $1" 0.1; await "^folded $1"; settled; }
# A button beside a message moves when older ones go by themselves: until a click has met it.
click_until() {  # NAME PATTERN
  for _ in $(seq 20); do
    forget; to "$1" 0.5 0.5; press 1; release 1
    for _ in $(seq 20); do new_events | grep -qE "$2" && return; sleep 0.1; done
  done
  fail "clicking '$1' gave no event '$2'"
}
# A list opens in one place and is moved to another in its next frame: its first entry is said twice.
choose() {  # a combo's entry
  click "$1"
  await "^at $1="
  await "$(new_events | sed -nE "s/^(at $1=.*)( -?[0-9]+){4}$/^\1 /p" | head -n 1)" 2
  click "$1=$2"
}
drag() {  # BUTTON from (x y) by (dx dy)
  forget
  xdotool mousemove "$2" "$3"; pause_for_frame
  press "$1"
  for _ in 1 2; do xdotool mousemove_relative -- $(($4 / 2)) $(($5 / 2)); pause_for_frame; done
}
shot() { import -window root "$1"; }
# Takes the second picture until so many pixels differ by more than a little: when it is drawn depends on the machine.
await_other() {  # BEFORE AFTER LEAST WHAT
  local count
  for _ in $(seq 100); do
    shot "$2"
    count=$(compare -metric AE -fuzz 4% "$1" "$2" null: 2>&1)
    awk -v n="$count" -v least="$3" 'BEGIN {exit !(n >= least)}' && return
    sleep 0.1
  done
  fail "$1 and $2 differ in $count pixels only: $4"
}
colours() { identify -format '%k' "$1"; }
open_window() {  # OPTIONS of tetpbd view
  rm -f "$log"
  mark=0
  "$program" view "$@" >output.txt 2>&1 &
  pid=$!
  for _ in $(seq 1200); do [[ -e $log ]] && break; kill -0 $pid 2>/dev/null || break; sleep 0.05; done
  [[ -e $log ]] || fail "no window"
  await '^ready'
  window=$(xdotool search --onlyvisible --pid $pid | tail -n 1)
  [[ -n $window ]] || fail "no window on the display"
  xdotool windowfocus "$window"
  read -r vx vy vw vh < <(place view)
  cx=$((vx + vw / 2)) cy=$((vy + vh / 2))
  xdotool mousemove $((vx + 20)) $((vy + 20))
}
close_window() {
  xdotool key ctrl+q
  for _ in $(seq 600); do kill -0 $pid 2>/dev/null || break; sleep 0.05; done
  kill -0 $pid 2>/dev/null && fail "Ctrl+Q does not end it"
  wait $pid; status=$?
  [[ $status -eq 0 ]] || fail "exit status $status"
  [[ $(tail -n 1 "$log") == closed ]] || fail "it did not close in order"
  grep -i "GL error" output.txt && fail "GL errors"
}
