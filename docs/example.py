#!/usr/bin/env python3
"""How far three solvers come from a fine run, over time: runs tetpbd, reads its arrays and draws a chart.

Usage: docs/example.py CHART.png [OPTIONS of tetpbd run]; TETPBD names the program. Needs numpy and matplotlib.
"""
import json, os, pathlib, subprocess, sys, tempfile

import matplotlib.pyplot as plt
import numpy as np

chart, *options = sys.argv[1:]
scene = ["--scene", "soft-beam", "--set", "bodies.0.block.cells=[16,4,4]", "--positions-every", "2", *options]
solvers = {"20 substeps": ["--solver", "substeps"], "newton": ["--solver", "newton"], "explicit": ["--mode", "explicit"]}


def run(*solver):
    """Its states (frames, vertices, 3) and numbers."""
    with tempfile.TemporaryDirectory() as out:
        program = os.environ.get("TETPBD", "build/release/tetpbd")
        subprocess.run([program, "run", *scene, *solver, "--out", out], check=True)
        return np.load(f"{out}/trajectory.npy"), json.loads(pathlib.Path(out, "stats.json").read_text())


fine, _ = run("--mode", "explicit", "--stability", "0.05")
size = np.linalg.norm(np.ptp(fine[0], axis=0))
for name, solver in solvers.items():
    states, stats = run(*solver)
    percent = 100 * np.sqrt(((states - fine) ** 2).sum(-1).mean(-1)) / size
    time = stats["frames"]["seconds"] * np.arange(len(states))
    plt.semilogy(time[1:], percent[1:], label=f"{name}: {stats['timing']['wall_ms_per_step']['median']:.2g} ms a step")
plt.xlabel("time, s")
plt.ylabel("distance from a fine run, % of the size")
plt.legend()
plt.savefig(chart, dpi=150)
