#!/usr/bin/env python3
"""The tables of performance.md, as Markdown, from bench.json files of `tetpbd bench` (see performance.md for the commands).

Usage: make_performance.py BENCH.json ...    all of one machine; a later file's row replaces an equal one's
"""
import json
import sys


def table(head, rows):
    print("| " + " | ".join(head) + " |")
    print("|" + "---|" * len(head))
    for row in rows:
        print("| " + " | ".join(row) + " |")
    print()


rows, floors, device = {}, None, None
for name in sys.argv[1:]:
    with open(name) as file:
        bench = json.load(file)
    floors, device = floors or bench["floors"], bench["device"]
    for row in bench["rows"]:
        key = (row["scene"], row["mode"], row["constraints"], row["iterations"], row["substeps"], row["size"], row["picture"])
        rows[key] = row
if not rows:
    sys.exit(__doc__)
alone = [r for r in rows.values() if r["size"] == "" and r["constraints"] == "stretch+bend+volume" and r["substeps"] == 1]
scenes = {r["scene"]: r["tets"] for r in rows.values()}


def us(row):
    """An iteration: GPU time where there is one, else wall time."""
    gpu, wall = row["gpu_ms_per_step"]["median"], row["wall_ms_per_step"]["median"]
    return 1e3 * (gpu if gpu else wall) / row["iterations"]


def one(scene, mode, most=True):
    found = [r for r in alone if r["scene"] == scene and r["mode"] == mode]
    found.sort(key=lambda r: r["iterations"])
    return (found[-1] if most else found[0]) if found else None


print(f"{device['gl_renderer']}, OpenGL {device['gl_version']}: {floors['dispatch_us']:.2f} µs a dispatch with its barrier, "
      f"{floors['copy_gb_s']:.0f} GB/s copied.\n")
print("An iteration, all constraints, µs:\n")
body = []
for scene, tets in sorted(scenes.items(), key=lambda s: s[1]):
    paper = one(scene, "paper")
    for mode in ("node", "constraint", "paper"):
        row = one(scene, mode)
        if not row:
            continue
        bytes_ = row["bytes_per_step"] / row["iterations"]
        launches = row["dispatches_per_step"] / row["iterations"] * floors["dispatch_us"]
        loss = row["max_volume_loss_percent"]
        body.append([scene, f"{tets:,}".replace(",", " "), mode, f"{us(row):.1f}",
                     f"{us(paper) / us(row):.1f}" if paper else "–", f"{1e6 * us(row) / tets:.0f}",
                     f"{bytes_ / 1e6:.1f}", f"{100 * bytes_ / us(row) / 1e3 / floors['copy_gb_s']:.0f} %",
                     f"{100 * launches / us(row):.0f} %", f"{row['gpu_bytes'] / tets:.0f}",
                     f"{row['iterations']}", "–" if loss is None else f"{loss:.2f}"])
table(["scene", "tets", "mode", "µs", "times as fast as paper", "ps a tet", "MB", "of the copied bandwidth", "of it launches",
       "bytes a tet", "iterations", "volume lost %"], body)
body = [[r["scene"], r["mode"], str(r["iterations"]), f"{r['fps']['median']:.0f}",
         "–" if r["max_volume_loss_percent"] is None else f"{r['max_volume_loss_percent']:.2f}"]
        for r in sorted(alone, key=lambda r: (scenes[r["scene"]], r["mode"], r["iterations"]))]
print("Steps a second, simulation alone:\n")
table(["scene", "mode", "iterations", "steps a second", "volume lost %"], body)
body = []
for r in sorted(rows.values(), key=lambda r: (scenes[r["scene"]], r["size"], r["picture"], r["iterations"])):
    if r["size"] and r["draw_ms"]:
        sim, draw, frame = r["gpu_ms_per_step"]["median"] or 0, r["draw_ms"], r["wall_ms_per_step"]["median"]
        body.append([r["scene"], r["mode"], str(r["iterations"]), r["size"], r["picture"], f"{r['fps']['median']:.0f}", f"{1e3 * frame:.0f}",
                     f"{1e3 * sim:.0f}", f"{1e3 * draw:.0f}", f"{100 * (frame / (sim + draw) - 1):+.0f} %"])
if body:
    print("Frames with a picture, µs:\n")
    table(["scene", "mode", "iterations", "size", "picture", "fps", "frame", "step", "picture alone", "frame against both"], body)
