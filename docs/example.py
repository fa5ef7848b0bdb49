#!/usr/bin/env python3
"""How far three solvers come from a fine run, over time: runs tetpbd, reads its arrays and writes a table.

Usage: docs/example.py TABLE.csv [OPTIONS of tetpbd run]; TETPBD names the program. Needs numpy alone.
"""
import json, os, pathlib, subprocess, sys, tempfile

import numpy as np

table, *options = sys.argv[1:]
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
columns = []
for name, solver in solvers.items():
    states, stats = run(*solver)
    columns.append(100 * np.sqrt(((states - fine) ** 2).sum(-1).mean(-1)) / size)
    median = stats["timing"]["wall_ms_per_step"]["median"]
    print(f"{name}: {median:.2g} ms a step, at the end {columns[-1][-1]:.2g} % of the size from the fine run")
time = stats["frames"]["seconds"] * np.arange(len(fine))
np.savetxt(table, np.transpose([time, *columns]), "%.6g", ",", comments="", header=",".join(["seconds", *solvers]))
