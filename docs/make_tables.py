#!/usr/bin/env python3
"""Writes the pages of docs/generated, which hold tables only, and the charts of docs/figures.

docs/make_tables.py fronts R DATE: speed against error

  for s in bunny-drop armadillo-drop dragon-drop bunny-100k.json; do
    c() { tetpbd compare --rigid-contact 0 --mass-splitting 0 --scene $s --steps 200 --out R/c/${s%-drop}_$n "$@"; n=$((n + 1)); }; n=1
    c --modes node --iterations 1 --substeps 1,2,3,5,7,10,12,15,20,30,50,100
    c --modes node --iterations 1 --substeps 5,10,20,50 --omegas 2.5
    c --modes node,constraint --iterations 5,25 --substeps 1,5,20
    c --modes constraint --iterations 1 --substeps 1,5,10,20
    c --modes paper --iterations 1 --substeps 1,5,10,25,50,100
    c --modes paper --iterations 5,25,100 --substeps 1
    c --modes cpu-fast --iterations 1 --substeps 1,2,5,10,20
    c --modes cpu --iterations 1 --substeps 1,5
    tetpbd compare --merge R/c/${s%-drop}_* --out R/c/${s%-drop}
  done

docs/make_tables.py performance B/bench.json S/bench.json ...: what a step costs; a later file's row replaces an equal one's

  tetpbd bench --modes constraint,node,paper --constraint-sets stretch+bend+volume --iterations 1,25,150 \\
    --sizes 640x480,1280x720 --most-seconds 0.5 --out B
  tetpbd bench --scenes bunny-100k.json,... --modes node,constraint,paper --iterations 25 --no-render \\
    --constraint-sets stretch+bend+volume --frames 20 --warm-up 5 --most-seconds 1 --out S
  block-N is beam.json with N x N x N cells; bunny-N is bunny-drop with bunny_50k.ply, tetgen pYq1.414o/140aV
  (V = 9e-6, 1.5e-6, 3.53e-7, 1.175e-7 for 100k, 300k, 1M, 3M; 100k has 161k tets) and "deform": "stretch:1.1"
  so that constraints have something to do from the first step on.

docs/make_tables.py stability NOTE FOLDER ...: the hard cases; a later folder's row replaces an earlier one's

  for i in 1 2 3; do tetpbd compare --hard-cases --shard $i/3 --out S/$i & done; wait
  tetpbd compare --hard-cases --merge S/1 S/2 S/3 --out S/all

docs/make_tables.py verdicts NOTE TABLE.csv ...: what still goes wrong in the shipped scenes

  tests/verdicts.sh build/release/tetpbd TABLE.csv 1

docs/make_tables.py scans NOTE TABLE.csv ...: what becomes of surfaces as people bring them

  tests/scans.sh build/release/tetpbd TABLE.csv SURFACE...
"""
import csv, functools, pathlib, shutil, sys

sys.dont_write_bytecode = True  # An import leaves no folder among the pages.
import tables
from tables import docs, load, rounded, thousands

table = functools.partial(tables.table, gap=" ")


def write(name, parts):
    (docs / "generated" / name).write_text("\n\n".join(parts).rstrip() + "\n")


def read(path):
    return list(csv.DictReader(open(path)))


def fronts(source, date):
    source = pathlib.Path(source)
    device = load(source / "c/bunny/compare.json")["device"]
    out = ["# Speed against error: the tables",
           f"Written by `docs/make_tables.py fronts`; its head has the commands, [results.md](../results.md) what they mean. "
           f"{device['gl_renderer']}, OpenGL {device['gl_version']}, {date}."]
    for scene in ("bunny", "armadillo", "dragon", "bunny-100k"):
        shutil.copy(source / f"c/{scene}/compare.svg", docs / f"figures/compare_{scene}.svg")
        rows = [r for r in read(source / f"c/{scene}/compare.csv") if r["finite"] == "true"]
        for row in rows:
            row["ms"] = float(row["gpu_ms_per_step"] or row["wall_ms_per_step"])
            row["lost"] = float(row["max_volume_loss_percent"])
        common = lambda r: [r["mode"], rounded(r["omega"]), r["iterations"], r["substeps"], rounded(r["ms"]),
                            rounded(r["lost"], 3)]
        head = ["ω", "iterations", "substeps", "ms per step", "largest loss %"]
        front = sorted((r for r in rows if r["pareto"] == "true"), key=lambda r: r["ms"])
        out.append(f"## {scene}: {rows[0]['tets']} tets")
        out.append(table(["on the front", *head, "rigid distance at the end", "left of a 5 % stretch after one step"],
                         [[*common(r), *(rounded(r[key], 3) for key in ("rigid_distance", "reference_distance"))]
                          for r in front]))
        ours, lines = [r for r in rows if r["mode"].startswith("node")], []
        for r in (r for r in rows if r["mode"] in ("paper", "cpu-fast")):
            within = min((o["lost"] for o in ours if o["ms"] <= r["ms"]), default=None)
            good = min((o["ms"] for o in ours if o["lost"] <= r["lost"]), default=None)
            less = "–" if within is None else f"{'over ' * (within < 0.01)}{r['lost'] / max(within, 0.01):.0f}"
            lines.append(common(r) + [less, "–" if good is None else f"{r['ms'] / good:.0f}"])
        out.append("Against each setting of `paper` and `cpu-fast`, the best of mode `node`: how many times less "
                   "net volume loss in no more time (below 0.01 % counts as 0.01), how many times faster at no more "
                   "loss:")
        out.append(table(["against", *head, "times less error", "times faster"], lines))
    heading = "## Readings of the paper"
    # Searched for once, no longer measured.
    out.append(heading + (docs / "generated/fronts.md").read_text().split(heading, 1)[1])
    write("fronts.md", out)


def performance(*files):
    rows, limits, device = {}, None, None
    for name in files:
        bench = load(name)
        limits, device = limits or bench["floors"], bench["device"]
        for r in bench["rows"]:
            rows[tuple(r[k] for k in ("scene", "mode", "constraints", "iterations", "substeps", "size", "picture"))] = r
    rows = sorted(rows.values(), key=lambda r: (r["tets"], r["size"], r["picture"], r["mode"], r["iterations"]))
    lost = lambda r: rounded(r["max_volume_loss_percent"], 3)
    us = lambda r: 1e3 * (r["gpu_ms_per_step"]["median"] or r["wall_ms_per_step"]["median"])
    alone = [r for r in rows if r["size"] == "" and r["constraints"] == "stretch+bend+volume"]
    single = [r for r in alone if r["substeps"] == 1]
    most = {(r["scene"], r["mode"]): r for r in single}  # of the largest number of iterations
    out = ["# What a step costs: the tables",
           "Written by `docs/make_tables.py performance`; its head has the commands, "
           "[results.md](../results.md#what-a-step-costs) what they mean.",
           f"{device['gl_renderer']}, OpenGL {device['gl_version']}: {limits['dispatch_us']:.2f} µs a dispatch with its barrier, "
           f"{limits['copy_gb_s']:.0f} GB/s copied.", "An iteration, all constraints:"]
    lines = []
    for (scene, mode), r in most.items():
        each, paper = us(r) / r["iterations"], most.get((scene, "paper"))
        moved = r["bytes_per_step"] / r["iterations"]
        launches = r["dispatches_per_step"] / r["iterations"] * limits["dispatch_us"]
        lines.append([scene, thousands(r["tets"]), mode, f"{each:.1f}", f"{us(paper) / paper['iterations'] / each:.1f}" if paper else "–",
                      f"{1e6 * each / r['tets']:.0f}", f"{moved / 1e6:.1f}", f"{moved / each / 10 / limits['copy_gb_s']:.0f} %",
                      f"{100 * launches / each:.0f} %", f"{r['gpu_bytes'] / r['tets']:.0f}", r["iterations"], lost(r)])
    out.append(table(["scene", "tets", "mode", "µs", "times as fast as paper", "ps per tet", "MB", "of the copied bandwidth", "of it launches",
                      "bytes per tet", "iterations", "volume lost %"], lines))
    out.append("Steps per second, simulation alone:")
    out.append(table(["scene", "mode", "iterations", "steps per second", "volume lost %"],
                     [[r["scene"], r["mode"], r["iterations"], f"{r['fps']['median']:.0f}", lost(r)] for r in single]))
    out.append("Frames with a picture, µs:")
    lines = []
    for r in (r for r in rows if r["size"] and r["draw_ms"] and r["substeps"] == 1):
        step, draw, frame = 1e3 * (r["gpu_ms_per_step"]["median"] or 0), 1e3 * r["draw_ms"], 1e3 * r["wall_ms_per_step"]["median"]
        lines.append([r["scene"], r["mode"], r["iterations"], r["size"], r["picture"], f"{r['fps']['median']:.0f}", f"{frame:.0f}", f"{step:.0f}",
                      f"{draw:.0f}", f"{100 * (frame / (step + draw) - 1):+.0f} %"])
    out.append(table(["scene", "mode", "iterations", "size", "picture", "fps", "frame", "step", "picture alone", "frame against both"], lines))
    several = [r for r in alone if r["substeps"] > 1]
    if several:
        out.append("Several substeps:")
        out.append(table(["scene", "tets", "mode", "substeps", "iterations", "µs per step", "volume lost %"],
                         [[r["scene"], thousands(r["tets"]), r["mode"], r["substeps"], r["iterations"], f"{us(r):.1f}", lost(r)] for r in several]))
    write("performance.md", out)


def stability(note, *folders):
    modes = ["cpu-double", "cpu", "cpu-fast", "node", "constraint", "node-substeps", "paper"]
    rows = {}
    for folder in folders:
        for r in load(pathlib.Path(folder) / "stability.json")["rows"]:
            rows[r["case"], r["mesh"], r["mode"]] = r
    cases, meshes = sorted({c for c, _, _ in rows}), ("bunny", "block", "tet")

    def cell(r):
        if r is None:
            return "–"
        if not r["finite"]:
            return "**not finite**"
        if r["recovered_at_step"] is not None:
            return str(r["recovered_at_step"])
        inverted = f", {r['inverted_tets']:.0f} inv." if r["inverted_tets"] else ""
        return f"never ({r['final_volume_error_percent']:.3g} %{inverted})"

    recovered = lambda *key: (r := rows.get(key)) is not None and r["recovered_at_step"] is not None
    out = ["# Hard cases: the tables",
           "Written by `docs/make_tables.py stability`; its head has the commands, "
           f"[results.md](../results.md#hard-cases) what they mean. {note}",
           "A number is the step from which to the end of the run the volume is within 1 %, no tet is inverted and a hard body's shape is within 1 % of its size; \"never\" has the final volume "
           "error and the inverted tets; \"–\": not run."]
    for mesh in meshes:
        out.append(f"## {mesh}")
        lines = []
        for case in (c for c in cases if any((c, mesh, m) in rows for m in modes)):
            by = [m for m in modes[3:] if recovered(case, mesh, m)]
            none = "**none**" if recovered(case, mesh, "cpu-double") else "none, nor by the reference"
            lines.append([f"`{case}`", *(cell(rows.get((case, mesh, m))) for m in modes), ", ".join(by) or none])
        out.append(table(["case", *modes, "recovered on the GPU by"], lines))
    names, lines = sorted({k for r in rows.values() for k in r if k.startswith("guard_")}), []
    for case in cases:
        for mesh in meshes:
            r = rows.get((case, mesh, "node")) or rows.get((case, mesh, "cpu"))
            if r and any(r.get(n, 0) for n in names):
                lines.append([f"`{case}`", mesh, *(f"{r[n]:.3g}" if r.get(n) else "" for n in names)])
    out.append("## Which guard a case needs\n\nHow often each [guard](../method.md#guards) triggered, in mode `node` where that was counted (else in mode "
               "`cpu`); cases in which none did are left out.")
    out.append(table(["case", "mesh", *(n[6:] for n in names)], lines))
    scenes = docs.parent / "models/scenes/hard"
    out.append("## The cases")
    out.append(table(["case", ""], [[f"`{c}`", load(scenes / f"{c}.json")["description"]] for c in cases]))
    write("stability.md", out)


def verdicts(note, *files):
    rows = sorted((row for name in files for row in read(name)), key=lambda row: row["scene"])
    modes = ["node", "gauss-seidel", "explicit", "newton", "vbd", "cpu-fast"]
    modes = [mode for mode in modes if any(row["mode"] == mode for row in rows)]
    of = {(row["scene"], row["mode"]): row for row in rows}

    def cell(row):
        if row is None:
            return "–"
        word = row["verdict"].split(":")[0]
        if word == "right":
            return word
        parts = [f"{row['created_percent']} %"] if float(row["created_percent"] or 0) > 1 else []
        parts += [f"{row['inverted_tets']} inv."] if (row["inverted_tets"] or "0") != "0" else []
        return f"**{word}**" + (f" ({', '.join(parts)})" if parts else "")

    scenes = sorted({row["scene"] for row in rows})
    write("verdicts.md", ["# What still goes wrong: the table",
          "Written by `docs/make_tables.py verdicts`; its head has the command, "
          f"[the guide](../guide.md#the-verdict) what verdicts mean. {note}",
          "In brackets: energy that came from nothing, of what the scene has, and tets inverted at the end; "
          "\"–\": a mode that does not take the scene.",
          table(["scene", *modes], [[f"`{s}`", *(cell(of.get((s, m))) for m in modes)] for s in scenes])])


def scans(note, *files):
    rows = sorted((row for name in files for row in read(name)), key=lambda row: row["surface"])
    moduli = ["1e4", "1e5", "1e6"]
    both = lambda created, inverted: f"{rounded(created, 2)} %, {inverted}" if inverted else created
    cell = lambda row, m: both(row["created_" + m], row["inverted_" + m])
    write("scans.md", ["# Surfaces as people bring them: the table",
          f"Written by `docs/make_tables.py scans`; its head has the command. {note}",
          "By Young's modulus in Pa: energy that came from nothing, of what the scene has, "
          "and tets inverted at the end.",
          table(["surface", "tets", *moduli], [[f"`{row['surface']}`", row["tets"], *(cell(row, m) for m in moduli)] for row in rows])])


pages = {"fronts": fronts, "performance": performance, "stability": stability, "verdicts": verdicts, "scans": scans}
if len(sys.argv) < 3 or sys.argv[1] not in pages:
    sys.exit(__doc__)
pages[sys.argv[1]](*sys.argv[2:])
