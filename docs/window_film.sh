#!/usr/bin/env bash
# docs/figures/window.webp: the real window under Xvfb; somebody pulls the bunny, cuts it open and goes back in time.
# Usage: docs/window_film.sh; TETPBD names the program. Needs Xvfb, xdotool and ffmpeg; a minute.
set -uo pipefail
docs=$(dirname "$(realpath "${BASH_SOURCE[0]}")")
# shellcheck source=tests/app/window_driver.sh
source "$docs/../tests/app/window_driver.sh"
[[ ${1:-} == --inside ]] || set -- "$(realpath "${TETPBD:-$docs/../build/release/tetpbd}")" "$(mktemp -d)/film"
begin_inside "$@"

# What is awaited between two scenes is not filmed: each scene is a film of its own.
film() {  # NAME
  ffmpeg -v error -y -f x11grab -framerate 10 -video_size 960x600 -i "$DISPLAY" -c:v libx264rgb -qp 0 -preset ultrafast "$1.mkv" </dev/null &
  recorder=$!
  sleep 0.5
}
cut_film() { sleep "${1:-0.7}"; kill -INT $recorder; wait $recorder; }
glide() {  # X Y: the mouse, as a hand moves it
  local x y k
  eval "$(xdotool getmouselocation --shell | grep -E '^[XY]=')"
  x=$X y=$Y
  for k in 1 2 3 4 5 6 7 8; do xdotool mousemove $((x + ($1 - x) * k / 8)) $((y + ($2 - y) * k / 8)); sleep 0.06; done
}

open_window --size 960x600 --samples 0
xdotool windowmove "$window" 0 0
await '^running ([4-9][0-9]|[1-9][0-9]{2})'
film 1
glide $cx $((cy + 20))
xdotool mousedown 1; sleep 0.2
glide $((cx + 90)) $((cy - 40)); sleep 0.4; glide $((cx - 60)) $((cy - 30)); sleep 0.5; glide $cx $((cy + 20)); sleep 0.2
xdotool mouseup 1; await '^release '
cut_film 1
key r; await '^reset'; key 3; await '^look tets'; for _ in 1 2 3; do key x; await '^cut '; done; key c; await '^colour volume'
film 2
sleep 1.6; key c; await '^colour stretch'; sleep 0.5
glide $((cx + 10)) $((cy + 10)); xdotool mousedown 1; sleep 0.2; glide $((cx - 50)) $((cy - 30)); sleep 0.5; xdotool mouseup 1; await '^release '
cut_film 1.2
key space; await '^pause'
film 3
read -r bx by bw bh < <(place time)
glide $((bx + bw - 5)) $((by + bh / 2)); xdotool mousedown 1
for part in 90 80 70 60 50 40 30 20 10 5; do xdotool mousemove $((bx + bw * part / 100)) $((by + bh / 2)); sleep 0.2; done
xdotool mouseup 1; sleep 0.4
cut_film
close_window
printf "file '%s'\n" 1.mkv 2.mkv 3.mkv >parts.txt
ffmpeg -v error -y -f concat -i parts.txt -c:v libwebp_anim -quality 50 -compression_level 5 -loop 0 "$docs/figures/window.webp"
ls -l "$docs/figures/window.webp" "$PWD"/*.mkv
