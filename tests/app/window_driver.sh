# How tests drive the real window: sourced, with $program and $log set, in the folder where files may be made.
pid=
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
await() {
  for _ in $(seq 600); do
    new_events | grep -qE "$1" && return 0
    kill -0 "$pid" 2>/dev/null || fail "the program ended while waiting for '$1'"
    sleep 0.1
  done
  fail "no event '$1'"
}
pause_for_frame() { sleep 0.2; }
key() {
  forget
  xdotool keydown "$1"
  pause_for_frame
  xdotool keyup "$1"
}
place() {  # NAME -> x y width height
  local line
  for _ in $(seq 100); do
    line=$(grep -F "at $1 " "$log" | grep -E "^at $1 [0-9-]+ [0-9-]+ [0-9]+ [0-9]+\$" | tail -n 1)
    [[ -n $line ]] && break
    sleep 0.1
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
click() {
  forget
  to "$1" "${2:-0.5}" 0.5
  press 1
  release 1
}
choose() {  # a combo's entry
  click "$1"
  await "^at $1="  # its first entry always moves
  sleep 0.7  # a list opens in one place and is moved to another in its next frame
  click "$1=$2"
}
drag() {  # BUTTON from (x y) by (dx dy)
  forget
  xdotool mousemove "$2" "$3"; pause_for_frame
  press "$1"
  for _ in 1 2 3 4; do xdotool mousemove_relative -- $(($4 / 4)) $(($5 / 4)); pause_for_frame; done
}
shot() { import -window root "$1"; }
differ() {  # pixels that differ by more than a little
  local count
  count=$(compare -metric AE -fuzz 4% "$1" "$2" null: 2>&1)
  awk -v n="$count" -v least="$3" 'BEGIN {exit !(n >= least)}' || fail "$1 and $2 differ in $count pixels only: $4"
}
colours() { identify -format '%k' "$1"; }
open_window() {  # OPTIONS of tetpbd view
  rm -f "$log"
  mark=0
  "$program" view "$@" >output.txt 2>&1 &
  pid=$!
  for _ in $(seq 600); do [[ -e $log ]] && break; kill -0 $pid 2>/dev/null || break; sleep 0.1; done
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
  for _ in $(seq 300); do kill -0 $pid 2>/dev/null || break; sleep 0.1; done
  kill -0 $pid 2>/dev/null && fail "Ctrl+Q does not end it"
  wait $pid; status=$?
  [[ $status -eq 0 ]] || fail "exit status $status"
  [[ $(tail -n 1 "$log") == closed ]] || fail "it did not close in order"
  grep -i "GL error" output.txt && fail "GL errors"
}
