#!/usr/bin/env bash
# Sixty seconds of lanes side by side: writes a record by hand (docs/guide.md, "Record, and do it again") and draws it.
# Usage: docs/film.sh FILM.mp4 [OPTIONS of tetpbd run]; TETPBD names the program.
set -euo pipefail
film=$1 folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
awk >"$folder/film.jsonl" '
  function say(what) { printf "{\"step\": %d, %s}\n", step, what }
  function lanes(a, b, c, d) { say("\"lanes\": [{" a "}, {" b "}, {" c "}, {" d "}]") }
  function play(steps, speed) { say("\"speed\": " speed); step += steps }
  BEGIN {
    # 20 s: a soft beam is let go: forces, implicit steps, and PBD with many substeps and with few.
    say("\"load\": {\"scene\": \"soft-beam\", \"settings\": {\"material\": \"neo-hookean\"}}")
    say("\"camera\": [0.05, 0.9, 0, 2.7, 30, 12]")
    jelly = "\"iterations\": 1, \"mode\": \"node\", \"substeps\": "
    lanes("\"mode\": \"explicit\"", "\"mode\": \"newton\", \"iterations\": 4, \"substeps\": 1", jelly 20, jelly 5)
    play(200, 0.125)  # 8 s
    play(200, 0.25)   # 4 s
    # The upper edge of its end is led up and around, and let go.
    split("1378 1404 1528 1554 1850 1876 1931 1944 1949", edge)
    say("\"reset\": true"); step = 0
    for (k in edge) say("\"pin\": " edge[k])
    say("\"speed\": 0.25")
    for (; step < 240; ++step) {  # 4.8 s
      turn = 6.2832 * step / 240
      for (k = 1; k <= 9; ++k)
        say(sprintf("\"move\": [%d, %.5f, %.5f, %.5f]", edge[k], 0.5 - 0.1 * (1 - cos(turn)), 1.25 + 0.4 * step / 240, -0.125 + 0.03125 * (k - 1) + 0.2 * sin(turn)))
    }
    for (k in edge) say("\"unpin\": " edge[k])
    play(160, 0.125)  # 6.4 s
    # In the middle of its way all become four times as stiff.
    for (k = 0; k < 4; ++k) say("\"lane\": " k ", \"set\": {\"young_modulus\": 4e6}")
    play(165, 0.125)  # 6.6 s
    # A hard body: the published iterations, substeps on the GPU and on the CPU.
    say("\"load\": {\"scene\": \"bunny-drop\"}"); step = 0
    hard = "\"iterations\": 1, \"substeps\": "
    lanes("\"iterations\": 25, \"substeps\": 1, \"mass_splitting\": false, \"rigid_contact\": false", hard "5", hard "40", hard "5, \"mode\": \"cpu-fast\"")
    play(300, 0.125)  # 12 s
    # Back into the fall, and on with a third of the gravity, then with that of Jupiter.
    say("\"go\": 80"); step = 80
    for (k = 0; k < 4; ++k) say("\"lane\": " k ", \"set\": {\"gravity\": 3.27}")
    play(305, 0.125)  # 12.2 s
    for (k = 0; k < 4; ++k) say("\"lane\": " k ", \"set\": {\"gravity\": 24.8}")
    play(150, 0.125)  # 6 s
    say("\"speed\": 1")
  }'
"${TETPBD:-build/release/tetpbd}" run --replay "$folder/film.jsonl" --video "$film" --out "$folder" "${@:2}"
