#!/usr/bin/env bash
# Makes the pictures of the README in docs/figures, and those of the window's list of scenes beside these (the window's, lanes.png, is a screenshot of
# tetpbd view --scene soft-beam --material neo-hookean --young-modulus 1e6 --lane mode=explicit
#   --lane mode=newton,substeps=1,iterations=4 --lane mode=node,substeps=20,iterations=1 --lane mode=node,substeps=5,iterations=1).
# Usage: docs/figures.sh; TETPBD names the program. Needs ffmpeg; some minutes on a software renderer.
set -euo pipefail
cd "$(dirname "$0")/.."
program=${TETPBD:-build/release/tetpbd} out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
gif() {  # PALETTE_SIZE DITHER FILTERS OUT INPUT...
  ffmpeg -v error -y "${@:5}" -vf "$3split[a][b];[a]palettegen=max_colors=$1:stats_mode=diff[p];[b][p]paletteuse=dither=$2:diff_mode=rectangle" "$4"
}

"$program" run --scene bunny-drop --constraints stretch,volume --compliance-stretch 1.5e-4 --compliance-volume 1e-11 \
  --constraint-damping 0.0005 --set bodies.0.position=[0,0.6,0] --set camera.distance=3.1 --set camera.target=[0,0.68,0] \
  --steps 260 --png-every 4 --size 480x270 --out "$out"
gif 96 bayer:bayer_scale=4 '' docs/figures/bunny.gif -framerate 25 -pattern_type glob -i "$out/frame_*.png"
rm "$out"/frame_*

still() {  # NAME STEPS OPTIONS...
  "$program" run "${@:3}" --steps "$2" --png-every "$2" --size 640x480 --out "$out"
  mv "$out"/frame_*"$2".png "docs/figures/$1.png"
  rm -f "$out"/frame_*
}
near=(--set bodies.0.position=[0,0.3,0] --set camera.distance=2.1 --colour volume)
jelly=(--material neo-hookean --young-modulus 2e5 --poisson-ratio 0.4 --constraint-damping 0.003 --mode node --substeps 50)
still tets 65 --scene bunny-drop "${near[@]}" "${jelly[@]}" --set camera.target=[0,0.4,0] --look tets --cut 0.55 --cut-axis 2
still armadillo 65 --scene armadillo-drop "${near[@]}" "${jelly[@]}" --set camera.target=[0,0.45,0]
still jelly 64 --scene jelly-beam --set camera.target=[0,0.45,0] --set camera.distance=1.9 --set camera.azimuth=20 --look wire --colour stretch

for scene in models/scenes/*.json; do
  steps=060
  [[ $scene == *cloth* ]] && steps=160
  "$program" run --scene "$scene" --steps $((10#$steps)) --png-every $((10#$steps)) --size 192x144 --samples 8 --out "$out"
  mv "$out/frame_00$steps.png" "${scene%.json}.png"
done

# A beam's end is led up and around and let go, by four solvers.
awk >"$out/lanes.jsonl" '
  function say(what) { printf "{\"step\": %d, %s}\n", step, what }
  BEGIN {
    say("\"load\": {\"scene\": \"soft-beam\", \"settings\": {\"material\": \"neo-hookean\", \"young_modulus\": 5e5, \"poisson_ratio\": 0.45}}")
    say("\"camera\": [0.05, 0.9, 0, 2.7, 30, 12]")
    jelly = "{\"iterations\": 1, \"mode\": \"node\", \"substeps\": "
    say("\"lanes\": [{\"mode\": \"explicit\"}, {\"mode\": \"newton\", \"iterations\": 4, \"substeps\": 1}, " jelly "20}, " jelly "5}]")
    split("1378 1404 1528 1554 1850 1876 1931 1944 1949", edge)
    for (k in edge) say("\"pin\": " edge[k])
    say("\"speed\": 0.5")
    for (; step < 240; ++step)
      for (k = 1; k <= 9; ++k) {
        turn = 6.2832 * step / 240
        say(sprintf("\"move\": [%d, %.5f, %.5f, %.5f]", edge[k], 0.5 - 0.1 * (1 - cos(turn)), 1.25 + 0.4 * step / 240, -0.125 + 0.03125 * (k - 1) + 0.2 * sin(turn)))
      }
    for (k in edge) say("\"unpin\": " edge[k])
    say("\"speed\": 0.25"); step += 160; say("\"speed\": 1")
  }'
"$program" run --replay "$out/lanes.jsonl" --size 720x432 --video "$out/lanes.mp4" --out "$out"
gif 80 none 'fps=12,scale=640:-1:flags=lanczos,' docs/figures/lanes.gif -i "$out/lanes.mp4"
