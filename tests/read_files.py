"""What tetpbd run leaves for other programs, read back by others' readers. Usage: read_files.py PROGRAM FOLDER"""
import json, pathlib, re, shutil, signal, subprocess, sys, time

import meshio
import numpy as np

program, folder = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2])
shutil.rmtree(folder, ignore_errors=True)
folder.mkdir(parents=True)
out = folder / "out"


def run(*words):
    subprocess.run([program, *words], cwd=folder, check=True)


def same(a, b, within=2e-6):
    assert np.shape(a) == np.shape(b), (np.shape(a), np.shape(b))
    assert np.abs(np.asarray(a, float) - b).max() <= within, np.abs(np.asarray(a, float) - b).max()


# A body from a file, whose numbers must come back, and a block of the same material.
angle, ring = np.meshgrid(np.linspace(0, 2 * np.pi, 24, False), np.linspace(0, 2 * np.pi, 10, False), indexing="ij")
radius = 0.3 + 0.1 * np.cos(ring)
points = np.stack([radius * np.cos(angle), 0.1 * np.sin(ring), radius * np.sin(angle)], -1).reshape(-1, 3)
number = lambda i, j: i % 24 * 10 + j % 10
quads = [(number(i, j), number(i, j + 1), number(i + 1, j + 1), number(i + 1, j)) for i in range(24) for j in range(10)]
meshio.write(folder / "torus.obj", meshio.Mesh(points, [("quad", np.array(quads))]))
run("mesh", "torus.obj", "--out", "torus.msh")
torus = meshio.read(folder / "torus.msh")
# The same mesh as others write it, read by us.
tets = meshio.Mesh(torus.points, [("tetra", torus.cells[0].data)])
for name, kind, how in [("22.msh", "gmsh22", {"binary": True}), ("41.msh", "gmsh", {"binary": True}),
                        ("text.msh", "gmsh", {"binary": False}), ("text.vtk", "vtk", {"binary": False}),
                        ("bytes.vtk", "vtk", {"binary": True}), ("text.vtu", "vtu", {"binary": False}),
                        ("zlib.vtu", "vtu", {"binary": True}), ("a.mesh", "medit", {})]:
    meshio.write(folder / name, tets, kind, **how)
    run("mesh", name, "--out", "back.msh")
    back = meshio.read(folder / "back.msh")
    same(back.points, torus.points, 1e-10)
    assert (back.cells[0].data == torus.cells[0].data).all(), name
soft = {"model": "neo-hookean", "young_modulus": 2e5, "poisson_ratio": 0.4}
(folder / "two.json").write_text(json.dumps({
    "bodies": [{"mesh": "torus.msh", "position": [0, 0.02, 0], "velocity": [0.1, 0, 0], "material": soft},
               {"block": {"size": [0.2, 0.3, 0.2], "cells": [2, 3, 2]}, "position": [1, 0.5, 0], "material": soft}]}))
run("run", "--scene", "two.json", "--mode", "newton", "--steps", "26", "--positions-every", "8", "--export", "vtk,pc2,ply")

load = lambda name: np.load(out / f"{name}.npy")
trajectory, positions, velocities, rest, tets, faces, bodies = map(
    load, ["trajectory", "positions", "velocities", "rest", "tets", "faces", "bodies"])
n = len(torus.points)
assert trajectory.dtype == positions.dtype == np.float32 and trajectory.shape == (4, len(bodies), 3)
same(trajectory[0], rest)
same(rest[:n] - rest[:n].mean(0), torus.points - torus.points.mean(0))
assert (tets[:len(torus.cells[0].data)] == torus.cells[0].data).all()
assert (bodies == (np.arange(len(bodies)) >= n)).all() and tets.max() == faces.max() == len(bodies) - 1
assert np.abs(trajectory[1:] - trajectory[:-1]).max() > 0.01

# Surfaces: closed, outward, of the same vertices as tets.
corners = positions[faces]
volume = np.linalg.det(positions[tets[:, 1:]] - positions[tets[:, :1]]) / 6
assert abs(np.linalg.det(corners.astype(float)).sum() / 6 / volume.sum() - 1) < 1e-4

times = re.findall(r'timestep="(.*)" file="(.*)"', (out / "frames.pvd").read_text())
assert [float(t) for t, _ in times] == [0, 0.04, 0.08, 0.12]
for frame, (_, file) in enumerate(times):
    mesh = meshio.read(out / file)
    same(mesh.points, trajectory[frame], 0)
    assert (mesh.cells[0].data == tets).all() and mesh.cells[0].type == "tetra"
    same(mesh.point_data["displacement"], mesh.points - rest)
    assert (mesh.point_data["body"].ravel() == bodies).all()
    spans = lambda x: np.linalg.det((x[tets[:, 1:]] - x[tets[:, :1]]).astype(float))
    same(mesh.cell_data["volume_error"][0].ravel(), spans(mesh.points) / spans(rest) - 1, 1e-4)
    assert mesh.cell_data["energy_density"][0].min() > -1 and mesh.cell_data["strain"][0].shape[0] == len(tets)
same(np.median(meshio.read(out / times[1][1]).point_data["velocity"][n:, 1]), -9.81 * 0.04, 0.02)
assert mesh.cell_data["energy_density"][0].max() > 10  # it has landed

kind, version, count, start, rate, frames = np.fromfile(
    out / "surface.pc2", "S12,<i4,<i4,<f4,<f4,<i4", count=1)[0].tolist()
used = np.unique(faces)
assert (kind, version, count, start, rate, frames) == (b"POINTCACHE2", 1, len(used), 0, 1, 4)
same(np.fromfile(out / "surface.pc2", "<f4", offset=32).reshape(frames, count, 3), trajectory[:, used], 0)
surface = meshio.read(out / "surface.obj")
same(surface.points, trajectory[0][used])
assert (used[surface.cells[0].data] == faces).all()
same(meshio.read(out / "ply/frame_00024.ply").points, trajectory[3][used])

# Interrupted, it leaves the frames it had.
process = subprocess.Popen([program, "run", "--scene", "two.json", "--steps", "100000000", "--positions-every", "2",
                            "--export", "pc2", "--out", "half"], cwd=folder, stderr=subprocess.DEVNULL)
for _ in range(600):
    time.sleep(0.1)
    if any(file.stat().st_size > 10 * 12 * len(bodies) for file in folder.glob("half/.trajectory*")):
        break
process.send_signal(signal.SIGINT)
assert process.wait() == 1
count = json.loads((folder / "half/stats.json").read_text())["frames"]["count"]
half = np.load(folder / "half/trajectory.npy")
assert count > 5 and half.shape == (count, len(bodies), 3)
assert (folder / "half/surface.pc2").stat().st_size == 32 + 12 * len(used) * count
print("all read back")
