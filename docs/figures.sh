#!/usr/bin/env bash
# Makes the pictures and films of the README in docs/figures, and those of the window's list of scenes beside these.
# Usage: docs/figures.sh [PART...]: all parts, or those named (below). Needs ffmpeg and imagemagick.
# TETPBD names the program, OUT where files go. An hour or so on a software renderer.
set -euo pipefail
cd "$(dirname "$0")/.."
program=$(realpath "${TETPBD:-build/release/tetpbd}") into=${OUT:-docs/figures} out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
mkdir -p "$into"
gif() {  # PALETTE_SIZE DITHER FILTERS OUT INPUT...
  ffmpeg -v error -y "${@:5}" -vf "$3split[a][b];[a]palettegen=max_colors=$1:stats_mode=diff[p];[b][p]paletteuse=dither=$2:diff_mode=rectangle" "$4"
}
still() {  # FILE STEPS OPTIONS...: the last frame
  "$program" run "${@:3}" --steps "$2" --csv-every 0 --png-every "$2" --samples 8 --out "$out/still"
  mv "$out/still/frame_$(printf %05d "$2").png" "$1"
  rm -f "$out"/still/frame_*
}
jpeg() { convert "${@:1:$#-1}" -strip -sampling-factor 1x1 -quality 88 "${@: -1}"; }
label() { printf '%s\n' -font "$(fc-match -f '%{file}' sans)" -pointsize "$1" -fill '#1c2733' -gravity south; }

tets() {
  local near=(--size 640x480 --set bodies.0.position=[0,0.3,0] --set camera.distance=2.1 --colour volume --range 10)
  local jelly=(--material neo-hookean --young-modulus 2e5 --poisson-ratio 0.4 --constraint-damping 0.003 --mode node --substeps 50)
  still "$into/tets.png" 65 --scene bunny-drop "${near[@]}" "${jelly[@]}" --set camera.target=[0,0.4,0] --look tets --cut 0.55 --cut-axis 2
}

# The pictures of the window's list of scenes.
scenes() {
  local scene steps
  for scene in models/scenes/*.json; do
    steps=60
    [[ $scene == *cloth* ]] && steps=160
    still "${scene%.json}.png" $steps --scene "$scene" --size 192x144
  done
}

# A beam's end is led up and around and let go, by four solvers: the beam that docs/measure.sh measures.
lanes() {
  awk >"$out/lanes.jsonl" '
    function say(what) { printf "{\"step\": %d, %s}\n", step, what }
    BEGIN {
      say("\"load\": {\"scene\": \"soft-beam\", \"settings\": {\"material\": \"neo-hookean\", \"young_modulus\": 1e6, \"poisson_ratio\": 0.3}}")
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
  gif 80 none 'fps=12,scale=640:-1:flags=lanczos,' "$into/lanes.gif" -i "$out/lanes.mp4"
}

# Four scenes, two and a half seconds each.
hero() {
  shot() {  # NAME FRAMES_LEFT_OUT STEPS_PER_FRAME OPTIONS...: 62 frames
    "$program" run "${@:4}" --steps $(($3 * ($2 + 61))) --csv-every 0 --png-every "$3" --size 640x360 --samples 8 --out "$out/shot"
    mkdir -p "$out/hero"
    for frame in $(find "$out/shot" -name 'frame_*.png' | sort | tail -n 62); do mv "$frame" "$out/hero/$1_${frame##*_}"; done
    rm -r "$out/shot"
  }
  shot 1 14 4 --scene bowl --set camera.target=[0,0.42,0] --set camera.distance=2.0 --set camera.elevation=28
  shot 2 10 7 --scene press --set camera.target=[0,0.36,0] --set camera.distance=2.5 --set camera.azimuth=-15 --set camera.elevation=8
  shot 3 0 6 --scene twisted-beams --set camera.target=[0,1,0] --set camera.distance=3.2 --set camera.elevation=8
  shot 4 3 8 --scene gripper --set camera.target=[0,0.25,0] --set camera.distance=1.1 --set camera.azimuth=5 --set camera.elevation=8
  ffmpeg -v error -y -framerate 25 -pattern_type glob -i "$out/hero/*.png" -c:v libwebp_anim -quality 75 -compression_level 5 -loop 0 "$into/hero.webp"
  jpeg "$(find "$out/hero" -name '1_*' | sort | sed -n 46p)" "$into/hero.jpg"
}

# One bunny of five stiffnesses, 75 ms after it has met the ground at 3.1 m/s.
stiffness() {
  awk >"$out/stiffness.json" 'BEGIN {
    printf "{\"bodies\": ["
    for (k = split("4e4 8e4 1.6e5 3.2e5 1e6", modulus); k >= 1; --k)
      printf "{\"mesh\": \"bunny_coarse.obj\", \"surface\": \"bunny_50k.ply\", \"height\": 0.6, \"position\": [%g, 0.01, 0], \"velocity\": [0, -3.1, 0]," \
        "\"density\": 1000, \"material\": {\"model\": \"neo-hookean\", \"young_modulus\": %s, \"poisson_ratio\": 0.4}}%s", 0.8 * (k - 3), modulus[k], (k > 1 ? "," : "")
    print "], \"world\": {\"contact\": \"none\", \"friction\": 0.5}, \"solver\": {\"constraint_damping\": 0.001, \"dt\": 0.005},"
    print "\"camera\": {\"target\": [0, 0.22, 0], \"distance\": 3.2, \"azimuth\": 0, \"elevation\": 8, \"fov\": 28}}"
  }'
  still "$out/stiffness.png" 16 --scene "$out/stiffness.json" --size 1200x320
  local k=0 words=() texts=('40 kPa' '80 kPa' '160 kPa' '320 kPa' '1 MPa')
  for text in "${texts[@]}"; do
    words+=(-annotate "$(printf 0x0%+d+60 $((168 * (k - 2))))" "$text")
    k=$((k + 1))
  done
  jpeg "$out/stiffness.png" $(label 20) "${words[@]}" -crop 900x240+150+40 +repage "$into/stiffness.jpg"
}

# A surface with holes, from Debian's package libcgal-demo: as it comes, filled by a lattice, and squashed on the ground.
scan() {
  tar xzOf "${CGAL_DATA:-/usr/share/doc/libcgal-dev/data.tar.gz}" data/meshes/elephant-with-holes.off >"$out/scan.off"
  local scene=(--mesh "$out/scan.off" --height 0.6 --material neo-hookean --young-modulus 6e5 --mode explicit
    --set bodies.0.rotation=[0,-50,-28] --set bodies.0.position=[0,0.02,0] --set bodies.0.velocity=[0,-1.8,0] --size 640x560
    --set camera.target=[0,0.28,0] --set camera.distance=1.4 --set camera.azimuth=-5 --set camera.elevation=10)
  still "$out/1.png" 1 "${scene[@]}"
  still "$out/2.png" 1 "${scene[@]}" --look tets --cut 0.6 --cut-axis 2
  still "$out/3.png" 16 "${scene[@]}"
  convert "$out"/[123].png -gravity center -crop 520x480+0+0 +repage -resize 300x +append "$out/scan.png"
  jpeg "$out/scan.png" "$into/scan.jpg"
}

[[ $# -gt 0 ]] || set -- tets scenes lanes hero stiffness scan
for part in "$@"; do "$part"; done
