#!/usr/bin/env bash
# A reader's own mesh, for the tests of pages: a ring of quadrilaterals, as .obj on standard output.
awk 'BEGIN {
  turn = 6.283185307
  for (i = 0; i < 24; ++i) for (j = 0; j < 10; ++j) {
    r = 3 + cos(turn * j / 10)
    print "v", r * cos(turn * i / 24), r * sin(turn * i / 24), sin(turn * j / 10)
  }
  for (i = 0; i < 24; ++i) for (j = 0; j < 10; ++j) {
    k = (i + 1) % 24; l = (j + 1) % 10
    print "f", 10 * i + j + 1, 10 * k + j + 1, 10 * k + l + 1, 10 * i + l + 1
  }
}'
