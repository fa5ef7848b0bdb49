#!/usr/bin/env bash
# What somebody does who has never seen the program, in twenty tasks, by clicks, drags and keys alone. Each leaves a
# picture, and a line of tasks.tsv: number, task, seconds, what the window said.
# Usage: first_tasks_test.sh PROGRAM FOLDER
set -uo pipefail
here=$(dirname "$(realpath "$0")") models=$(realpath "$here/../../models")
source "$here/window_driver.sh"
begin_inside "$@"

number=0 task= began=0
begin_task() {
  number=$((number + 1)) task=$1 began=$(date +%s.%N)
  echo "-- $number: $task"
}
end_task() {  # PATTERN of what the window has to say
  await "$1"
  pause_for_frame
  local said
  said=$(new_events | grep -E "$1" | tail -n 1)
  shot "$(printf %02d "$number").png"
  printf '%d\t%s\t%.1f\t%s\n' "$number" "$task" "$(bc <<<"$(date +%s.%N) - $began")" "$said" >>tasks.tsv
}
typed() {  # NAME TEXT: into a slider, then Enter
  xdotool keydown ctrl; to "$1" 0.5 0.5; press 1; release 1; xdotool keyup ctrl; pause_for_frame
  xdotool key ctrl+a; pause_for_frame
  xdotool type --delay 60 "$2"; pause_for_frame
  forget; xdotool keydown Return; pause_for_frame; xdotool keyup Return
}

begin_task "start the program: a soft bunny falls"
open_window --size 1280x720 --samples 0
end_task '^running [1-9]'

begin_task "stop and go on"
key space; await '^pause'
key space; end_task '^play'

begin_task "drag the bunny"
xdotool mousemove $cx $cy; pause_for_frame
drag 1 $cx $cy 120 -60; await '^grab [0-9]+'
release 1; end_task '^release [0-9]+ moved 0\.[0-9]*[1-9]'

begin_task "pin a vertex, and take that back"
key space; await '^pause'
forget; xdotool mousemove $cx $cy click --repeat 2 --delay 60 1; await '^pin [0-9]+'
key ctrl+z; end_task '^unpin [0-9]+'

begin_task "make it softer"
typed young_modulus 5000; end_task '^set young_modulus 5000'

begin_task "solve it with more substeps"
typed "substeps number" 12; end_task '^set substeps 12$'

begin_task "see what a converging solver does: K"
key k; await '^lane '
key space; end_task '^running [1-9]'

begin_task "back to one lane"
key space; await '^pause'
key j; await '^lane '
grep -q '^lane node, 12' <(new_events) || fail "the lane that was there first is gone"
end_task '^reset'

begin_task "run it, and go back in time"
key space; await '^running ([3-9]|[1-9][0-9])'
key space; await '^pause'
forget; xdotool mousemove $(point time 0.3 0.5) mousedown 1 mouseup 1
end_task '^moment [0-9]+'

begin_task "replay it in a loop"
click loop; await '^looping true'
end_task '^loop$'
click loop; await '^looping false'

begin_task "cut it open"
key x; end_task '^cut 0\.5'
for _ in 1 2 3 4; do key x; await '^cut '; done

begin_task "colour it by strain"
choose colour stretch; end_task '^colour stretch'
choose colour plain; await '^colour plain'

begin_task "look at the tetrahedra"
key 3; end_task '^look tets'
key 1; await '^look surface'

begin_task "higher plots"
read -r px py pw ph < <(place "edge of plots")
drag 1 $((px + pw / 2)) $((py + ph / 2)) 0 -80; release 1
read -r _ ny _ _ < <(place "edge of plots")
[[ $ny -lt $((py - 60)) ]] || fail "the plots stay at $ny of $py"
end_task '^at edge of plots'
drag 1 $((px + pw / 2)) $((ny + ph / 2)) 0 80; release 1

begin_task "a picture and a video"
key p; await '^screenshot screenshot_000.png'
key v; await '^filming video_000.mp4'
key space; await '^running [1-9]'; sleep 1
key space; await '^pause'
key v; end_task '^video video_000.mp4'
[[ -s video_000.mp4 ]] || fail "there is no video"
ffprobe -v error -show_entries stream=nb_frames -of csv=p=0 video_000.mp4 | grep -qE '^[1-9][0-9]+' || fail "the video has no frames"

begin_task "fill a stability map, and take a cell's values"
unfold "Stability map"
click "map across"; pause_for_frame
xdotool key ctrl+a; xdotool type --delay 40 'substeps=2,6'; pause_for_frame
click "map up"; pause_for_frame
xdotool key ctrl+a; xdotool type --delay 40 'dt=0.005,0.02'; pause_for_frame
click "fill map"; await '^map of 4 cells'; pause_for_frame
forget; await '^map done'
click "map 2 1"; end_task '^map chose 6 0.005'
fold "Stability map"

begin_task "let it choose a solver, and think better of that"
choose solver auto; await '^at cancel '; pause_for_frame
xdotool mousemove $(point cancel 0.5 0.5) mousedown 1; sleep 0.5; xdotool mouseup 1
end_task '^message cancelled: the solver stays as it is'
new_events | grep -q '^set ' && fail "a search that was cancelled changed settings"

begin_task "put an obstacle beside it and lead it by an arrow"
unfold "Obstacles"
forget; xdotool mousemove $(point "section Obstacles" 0.5 0.5); for _ in 1 2 3 4 5 6 7 8; do xdotool click 5; pause_for_frame; done
choose "add obstacle" sphere; await '^obstacles 1'; sleep 0.5
read -r gx gy _ _ < <(place "gizmo y")
drag 1 "$gx" "$gy" 0 -60; release 1
end_task '^obstacle 1 at [-0-9.]+ 0\.[0-9]*[1-9]'
key ctrl+z; await '^undo'; key ctrl+z; await '^obstacles 0'

begin_task "open a scene from the list"
forget; xdotool mousemove $(point "look" 0.5 0.5); for _ in $(seq 20); do xdotool click 4; pause_for_frame; done
click scene; await '^at scene=beam '; sleep 0.5
xdotool mousemove $(point scene=beam 0.5 0.5)
for _ in $(seq 30); do
  xdotool click 5; pause_for_frame
  new_events | grep -q '^at scene=mixed ' && break
done
for _ in 1 2 3; do xdotool click 5; pause_for_frame; done  # the whole of it
click scene=mixed; end_task '^scene mixed '

begin_task "hide what stands in front"
unfold "Bodies"
click "seen 0"; end_task '^hidden '

begin_task "open a mesh of one's own by walking to it"
cp "$models/ball.obj" own.obj
click browse; await '^at file=own.obj '
await "$(new_events | sed -nE 's/^(at file=own\.obj)( -?[0-9]+){4}$/^\1 /p' | head -n 1)"; pause_for_frame
click "file=own.obj"; end_task '^scene mixed '

begin_task "save the scene, and leave"
key ctrl+s; end_task '^message saved mixed_with_own_obj_000.json'
close_window
[[ $(wc -l <tasks.tsv) -eq 22 ]] || fail "not all tasks are done"
"$program" run --scene mixed_with_own_obj_000.json --steps 2 --csv-every 0 --out again >/dev/null || fail "the saved scene does not run"
cat tasks.tsv
