#!/usr/bin/env bash
# Makes docs/gallery: what each command line shows, as small pictures with a page (README.md) around them.
# Usage: docs/gallery.sh [FOLDER]; TETPBD names the program. Needs imagemagick; some minutes on a software renderer.
set -euo pipefail
cd "$(dirname "$0")/.."
program=$(realpath "${TETPBD:-build/release/tetpbd}") folder=${1:-docs/gallery} work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p "$folder"
page=$folder/README.md
printf '# Gallery\n\nEach picture is the last frame of the command below it, with `--png-every`. Made by `docs/gallery.sh`.\n' >"$page"

show() {  # NAME STEPS TEXT OPTIONS...
  "$program" run "${@:4}" --steps "$2" --csv-every 0 --measure-every "$2" --png-every "$2" --size 640x480 --out "$work" >/dev/null
  convert "$work/frame_$(printf %05d "$2").png" -resize 480x360 -colors 128 "$folder/$1.png"
  rm "$work"/frame_*
  printf '\n## %s\n\n![%s](%s.png)\n\n```\ntetpbd run' "$3" "$3" "$1" >>"$page"
  for word in "${@:4}" --steps "$2"; do
    [[ $word == *[* ]] && word="'$word'"
    printf ' %s' "$word" >>"$page"
  done
  printf '\n```\n' >>"$page"
}

near=(--set 'bodies.0.position=[0,0.3,0]' --set camera.distance=2.1)
bunny=(--scene bunny-drop "${near[@]}" --set 'camera.target=[0,0.4,0]')
armadillo=(--scene armadillo-drop "${near[@]}" --set 'camera.target=[0,0.45,0]')
jelly=(--material neo-hookean --young-modulus 2e5 --poisson-ratio 0.4 --mode newton --substeps 2 --iterations 8)
show hard 80 'A hard bunny after its fall' "${bunny[@]}" --set camera.distance=2.6 --mode node
show bunny 64 'The scene that the window begins with: a bunny of jelly, solved by PBD' --scene bunny
show jelly 64 'A bunny of jelly lands: where its volume changes' "${bunny[@]}" "${jelly[@]}" --colour volume
show cut 64 'The same, cut open' "${bunny[@]}" "${jelly[@]}" --look tets --cut 0.55 --cut-axis 2 --colour energy --range 5000
show paper 64 'The method of the paper: soft because the iterations do not converge' "${bunny[@]}" --solver paper --colour stretch
show armadillo 64 'An armadillo of jelly' "${armadillo[@]}" "${jelly[@]}"
show graph 64 'The constraints of the armadillo' "${armadillo[@]}" --mode node --look graph
show squashed 40 'A bunny rises from a hundredth of its height' --scene hard/squashed-100 --set camera.distance=3.4 --set 'camera.target=[0,1.6,0]' --mode node --look wire
show twisted 20 'A bunny, twisted twice, on its way back' --scene hard/twisted-720 --mode node --look wire
show random 30 'Back from random places' --scene hard/random --mode node --look wire --colour volume
show beam 64 'A beam of jelly, clamped at one end' --scene jelly-beam --look wire --colour stretch
show swing 100 'A beam of soft material swings down' --scene soft-beam --material neo-hookean --young-modulus 3e5 --mode explicit --colour energy --range 2000
show block 60 'A spinning block' --scene beam --set 'bodies.0.fixed=[]' --set 'bodies.0.spin=[3,2,5]' --set 'bodies.0.position=[0,1,0]' --set camera.distance=4 --set 'camera.target=[0,0.9,0]' --mode node --colour velocity
show bowl 150 'A ball of jelly and a bunny, whose 50 000 triangles ride on 1 840 tets, meet in a bowl' --scene bowl
show funnel 240 'A ball of jelly is squeezed through a funnel; a bunny waits' --scene funnel
show rollers 150 'Rollers pull a block of jelly through their gap' --scene rollers
show press 210 'A press on a ball of jelly and a bunny' --scene press
show spikes 100 'A slab of jelly on spikes, and a bunny on the slab' --scene spikes
show stairs 100 'A cube of jelly and a bunny tumble down stairs' --scene stairs
show stack 200 'Ten cubes stand on each other' --scene stack
show hard-stack 200 'Ten hard cubes stand on each other' --scene hard-stack
show gripper 420 'Soft pads lift a bunny by friction' --scene gripper
show mixed 60 'A stone falls on a jelly on a slab of stone' --scene mixed
show beads 60 'Hard balls hang from a soft rope' --scene beads
show muscle-arm 200 'The fibres of a muscle bend an arm' --scene muscle-arm
show balloon 300 'A limp ball is blown up' --scene balloon
show sewn-bag 240 'Two sheets, sewn along their edges and blown up' --scene sewn-bag
show clay 300 'Balls and a bar have pressed a face into clay' --scene clay
show press-cloth 300 'A plate presses a heap of cloths' --scene press-cloth
show ring 80 'Balls of jelly, thrown at each other' --scene ring
show squishy-balls 120 'Balls of jelly fall on each other in a corner' --scene squishy-balls
show twisted-beams 340 'Beams are twisted and pressed against each other' --scene twisted-beams
show bowl-32 160 'Bunnies of jelly fall into a bowl: 346 000 tets (minutes per step without a GPU)' --scene bowl-32
show folded-ears 240 'A roller bends the ears of a bunny onto its face' --scene folded-ears
show layers 60 'Four cloths fall over a ball' --scene layers
show cloth-heap 60 'A cloth falls into a heap' --scene cloth-heap
show cards 400 'Thin plates fall onto each other' --scene cards
show chain 60 'A chain of soft rings swings' --scene chain
show knot 40 'A weight pulls at a knot' --scene knot
show cloth-on-bunny 200 'A cloth falls on a bunny' --scene cloth-on-bunny
du -sh "$folder"
