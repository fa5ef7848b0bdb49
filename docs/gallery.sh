#!/usr/bin/env bash
# Makes docs/gallery: what each command line shows, as pictures with a page (README.md) around them.
# Usage: docs/gallery.sh [NAME...]: all pictures (an hour or so on a software renderer), or those named; the page in any case.
# Some have a clip of the same motion as well, which docs/index.html plays.
# TETPBD names the program, FOLDER where files go. Needs imagemagick and ffmpeg.
set -euo pipefail
cd "$(dirname "$0")/.."
program=$(realpath "${TETPBD:-build/release/tetpbd}") folder=${FOLDER:-docs/gallery} work=$(mktemp -d) wanted=" $* "
trap 'rm -rf "$work"' EXIT
mkdir -p "$folder"
page=$folder/README.md
printf '# Gallery\n\nEach picture is the last frame of the command below it, with `--png-every`. Made by `docs/gallery.sh`.\n' >"$page"

clips=' bunny bowl funnel press rollers spikes gripper balloon sewn-bag twisted-beams bowl-32 ring squishy-balls cards chain '
show() {  # NAME STEPS TEXT OPTIONS...
  printf '\n## %s\n\n![%s](%s.jpg)\n\n```\ntetpbd run' "$3" "$3" "$1" >>"$page"
  for word in "${@:4}" --steps "$2"; do
    [[ $word == *[* ]] && word="'$word'"
    printf ' %s' "$word" >>"$page"
  done
  printf '\n```\n' >>"$page"
  [[ $wanted == "  " || $wanted == *" $1 "* ]] || return 0
  local every=$2
  [[ $clips != *" $1 "* ]] || every=$((($2 + 23) / 24))
  "$program" run "${@:4}" --steps "$2" --csv-every 0 --measure-every "$2" --png-every "$every" --size 640x480 --samples 8 --out "$work" >/dev/null
  convert "$(find "$work" -name 'frame_*.png' | sort | tail -n 1)" -strip -sampling-factor 1x1 -quality 88 "$folder/$1.jpg"
  [[ $every == "$2" ]] || ffmpeg -v error -y -framerate 12 -pattern_type glob -i "$work/frame_*.png" -vf scale=400:-1 \
    -c:v libwebp_anim -quality 75 -compression_level 5 -loop 0 "$folder/$1.webp"
  rm "$work"/frame_*
}
look_at() {  # TARGET DISTANCE [AZIMUTH [ELEVATION]]: the camera, into `view`
  view=(--set "camera.target=[$1]" --set "camera.distance=$2")
  [[ -z ${3:-} ]] || view+=(--set "camera.azimuth=$3")
  [[ -z ${4:-} ]] || view+=(--set "camera.elevation=$4")
}

near=(--set 'bodies.0.position=[0,0.3,0]' --set camera.distance=2.1)
bunny=(--scene bunny-drop "${near[@]}" --set 'camera.target=[0,0.4,0]')
armadillo=(--scene armadillo-drop "${near[@]}" --set 'camera.target=[0,0.45,0]')
jelly=(--material neo-hookean --young-modulus 2e5 --poisson-ratio 0.4 --mode newton --substeps 2 --iterations 8)
show hard 80 'A hard bunny after its fall' "${bunny[@]}" --set camera.distance=2.6 --mode node
look_at 0,0.4,0 2.6
show bunny 64 'The scene that the window begins with: a bunny of jelly, solved by PBD' --scene bunny
show jelly 64 'A bunny of jelly lands: where its volume changes' "${bunny[@]}" "${jelly[@]}" --colour volume --range 20
show cut 64 'The same, cut open' "${bunny[@]}" "${jelly[@]}" --look tets --cut 0.55 --cut-axis 2 --colour energy --range 1e4
show paper 64 'The published method: soft because the iterations do not converge' "${bunny[@]}" --solver paper --colour stretch
show armadillo 64 'An armadillo of jelly' "${armadillo[@]}" "${jelly[@]}"
look_at 0,0.42,0 1.95
show graph 64 'The constraints of a bunny of 1 840 tets' "${bunny[@]}" "${view[@]}" --mesh models/bunny_coarse.obj --mode node --look graph
show squashed 40 'A bunny rises from a hundredth of its height' --scene hard/squashed-100 --set camera.distance=3.4 --set 'camera.target=[0,1.6,0]' --mode node --look wire
show twisted 20 'A bunny, twisted twice, on its way back' --scene hard/twisted-720 --mode node --look wire
show random 30 'Back from random places' --scene hard/random --mode node --look wire --colour volume
show beam 64 'A beam of jelly, clamped at one end' --scene jelly-beam --look wire --colour stretch
look_at 0.05,0.75,0 2.6
show swing 60 'A beam of soft material swings down' --scene soft-beam "${view[@]}" --material neo-hookean --young-modulus 3e5 --mode explicit --colour energy --range 5e3
show block 60 'A spinning block' --scene beam --set 'bodies.0.fixed=[]' --set 'bodies.0.spin=[3,2,5]' --set 'bodies.0.position=[0,1,0]' --set camera.distance=4 --set 'camera.target=[0,0.9,0]' --mode node --colour velocity
look_at 0,0.4,0 2.3
show bowl 150 'A ball of jelly and a bunny, whose 50 000 triangles are embedded in 1 840 tets, meet in a bowl' --scene bowl "${view[@]}"
look_at 0,0.75,0 3.8
show funnel 240 'A ball of jelly is squeezed through a funnel; a bunny waits' --scene funnel "${view[@]}"
look_at 0,1.3,0 3.6
show rollers 150 'Rollers pull a block of jelly through their gap' --scene rollers "${view[@]}"
look_at 0,0.27,0 2.45 -12 8
show press 210 'A press on a ball of jelly and a bunny' --scene press "${view[@]}"
look_at 0,0.6,0 2.4
show spikes 100 'A slab of jelly on spikes, and a bunny on the slab' --scene spikes "${view[@]}"
look_at -0.2,0.55,0 3.4
show stairs 100 'A cube of jelly and a bunny tumble down stairs' --scene stairs "${view[@]}"
show stack 200 'Ten cubes stand on each other' --scene stack
show hard-stack 200 'Ten hard cubes stand on each other' --scene hard-stack
look_at 0,0.33,0 0.95 8 8
show gripper 420 'Soft pads lift a bunny by friction' --scene gripper "${view[@]}"
look_at 0,0.28,0 1.8
show mixed 60 'A stone falls on a jelly on a slab of stone' --scene mixed "${view[@]}"
look_at 0,1.05,0 2.6
show beads 60 'Hard balls hang from a soft rope' --scene beads "${view[@]}"
look_at 0.15,0.75,0 1.6
show muscle-arm 200 'The fibres of a muscle bend an arm' --scene muscle-arm "${view[@]}"
look_at 0,0.25,0 1.9
show balloon 300 'A limp ball is blown up' --scene balloon "${view[@]}"
show sewn-bag 240 'Two sheets, sewn along their edges and blown up' --scene sewn-bag
show clay 300 'Balls and a bar have pressed a face into clay' --scene clay
look_at 0,0.08,0 1.5
show press-cloth 300 'A plate presses a heap of cloths' --scene press-cloth "${view[@]}"
look_at 0,0.84,0 1.75
show ring 80 'Balls of jelly, thrown at each other' --scene ring "${view[@]}"
look_at 0,0.4,0 2.7
show squishy-balls 120 'Balls of jelly fall on each other in a corner' --scene squishy-balls "${view[@]}"
show twisted-beams 340 'Beams are twisted and pressed against each other' --scene twisted-beams
look_at 0,1,0 5.4 '' 26
show bowl-32 132 'Bunnies of jelly fall into a bowl: 346 000 tets (minutes per step without a GPU)' --scene bowl-32 "${view[@]}"
look_at 0.1,0.68,0 1.7
show folded-ears 240 'A roller bends the ears of a bunny onto its face' --scene folded-ears "${view[@]}"
show layers 60 'Four cloths fall over a ball' --scene layers
show cloth-heap 160 'A cloth falls into a heap' --scene cloth-heap
look_at 0,0.17,0 1.3
show cards 400 'Thin plates fall onto each other' --scene cards "${view[@]}"
show chain 60 'A chain of soft rings swings' --scene chain
look_at 0,1.2,0 3
show knot 40 'A weight pulls at a knot' --scene knot "${view[@]}"
show cloth-on-bunny 200 'A cloth falls on a bunny' --scene cloth-on-bunny
du -sh "$folder"
