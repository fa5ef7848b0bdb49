#!/usr/bin/env python3
"""Makes docs/index.html, a page that opens without a network, and docs/scenes.md, its index of scenes for GitHub.

docs/make_page.py                 writes both, from docs/page.template.html, docs/data, docs/gallery and models/scenes
docs/make_page.py check           fails where one of them differs from what would be written
docs/make_page.py count PROGRAM   prints what stands in `tets` below, counted by PROGRAM (minutes)
"""
import html, json, re, struct, subprocess, sys

sys.dont_write_bytecode = True  # An import leaves no folder among the pages.
from tables import docs, load, percent, thousands

root = docs.parent
esc = html.escape
narrow = "\u202f"  # This space stands between thousands.

# Tets of a scene, with the default fill; 0: sheets alone.
tets = {
    "armadillo-drop": 22103, "balloon": 0, "beads": 1247, "beam": 3072, "bowl": 3849, "bowl-32": 345760, "bunny": 1840,
    "bunny-drop": 10805, "cards": 5760, "chain": 3780, "clamped-bunny": 10805, "clay": 14400, "cloth-heap": 0, "cloth-on-bunny": 10805,
    "dragon-drop": 38337, "folded-ears": 10805, "funnel": 3849, "gripper": 6594, "hard-stack": 1620, "hung-armadillo": 48342,
    "jelly-beam": 192, "jelly-bunny": 23388, "knot": 7056, "layers": 0, "mixed": 1458, "muscle": 12288, "muscle-arm": 1224, "press": 3849,
    "press-cloth": 0, "ring": 18992, "rollers": 5368, "sewn-bag": 0, "soft-beam": 12288, "spikes": 7780, "squishy-balls": 11870,
    "stack": 1620, "stairs": 3136, "twisted-beams": 6144}

modes = {
    "node": "XPBD (Jacobi), GPU", "constraint": "XPBD (Jacobi, a thread per constraint), GPU",
    "gauss-seidel": "XPBD (Gauss–Seidel by colours), GPU", "cpu-fast": "XPBD (Gauss–Seidel by colours), CPU",
    "explicit": "leapfrog, GPU", "newton": "implicit steps, GPU", "vbd": "vertex block descent, GPU",
    "direct": "Newton steps with sparse Cholesky factors, one CPU core", "rigid-body": "a rigid body, one CPU core"}
fronts = {  # by scene and Young's modulus, in the order of the buttons
    "soft-beam": "Soft beam, 1 MPa", "clamped-bunny-5e4": "Clamped bunny, 50 kPa",
    "clamped-bunny-1e6": "Clamped bunny, 1 MPa", "bunny-drop": "Hard bunny falls"}
notes = {"bunny-drop": "as k = 1, the exact motion is a rigid body's"}
parts = ["beam", "bunny", "hard", "rivals"]  # of docs/data: what the chart shows
doors = [("Learn", "tutorial.md", "From a first drop to a stability map, in short lessons.", "Tutorial"),
         ("Compare solvers", "results.md", "Time and error of every solver on the same scenes, and where each one fails.", "Results"),
         ("Read and lift kernels", "extending.md", "The compute shaders, in an order to read them in; how to add a constraint or a solver.", "Extending"),
         ("Bring a mesh", "guide.md#meshes", "Check, repair and tetrahedralize your own surface; film it, export it.", "Guide")]


def size(path):
    """Width and height of a GIF, a PNG or an extended WebP."""
    head = path.read_bytes()[:32]
    if head[:3] == b"GIF":
        return struct.unpack("<HH", head[6:10])
    if head[:4] == b"\x89PNG":
        return struct.unpack(">II", head[16:24])
    if head[12:16] == b"VP8X":
        return tuple(1 + int.from_bytes(head[i:i + 3], "little") for i in (24, 27))
    sys.exit(f"{path}: neither GIF, PNG nor animated WebP")


# ------------------------------------------------------------------------------------------------ what the page is made of
def hero():
    width, height = size(docs / "figures/hero.webp")
    return ('<picture><source media="(prefers-reduced-motion: reduce)" srcset="figures/hero.jpg">'
            f'<img src="figures/hero.webp" width="{width}" height="{height}" '
            'alt="Soft bodies, simulated and drawn by tetpbd"></picture>')


def door_cards():
    return "\n".join(f'<a class="door" href="{link}"><h3>{name}</h3><p>{text}</p><span>{page} →</span></a>'
                     for name, link, text, page in doors)


def scenes():
    found = []
    for file in sorted((root / "models/scenes").glob("*.json"), key=lambda file: file.stem):
        scene = load(file)
        found.append({"name": file.stem, "title": scene.get("title", ""), "text": scene.get("description", ""),
                      "tets": tets.get(file.stem), "picture": f"../models/scenes/{file.stem}.png"})
    return found


def shown(scene):
    text = " ".join(part for part in (scene["title"] and scene["title"].rstrip(".") + ".", scene["text"]) if part)
    return re.sub(r"(?<=\d) (?=\d{3}\b|c?m\b|[kMG]?Pa\b|kg\b|tets\b)", "\u00a0", text)


def scene_cards():
    cards = []
    for s in scenes():
        count = f' <small>{thousands(s["tets"], narrow)} tets</small>' if s["tets"] else ""
        cards.append(f'<li class="card" data-name="{s["name"]}"><img src="{s["picture"]}" width="192" height="144" loading="lazy" alt="">'
                     f'<div><h3>{s["name"]}{count}</h3><p>{esc(shown(s), False)}</p></div>'
                     f'<code class="cmd">tetpbd view --scene {s["name"]}</code></li>')
    return "\n".join(cards)


def scene_page():
    tet_count = lambda s: thousands(s["tets"], narrow) if s["tets"] else "–"
    rows = [f'| ![{s["name"]}]({s["picture"]}) | `{s["name"]}` | {shown(s)} | {tet_count(s)} | '
            f'`tetpbd view --scene {s["name"]}` |' for s in scenes()]
    return ("# Scenes\n\nThe scenes in `models/scenes`, each of them a JSON file [to start from](guide.md#scenes). "
            "Written by `docs/make_page.py`; “–”: no tets, sheets alone.\n\n"
            "| | scene | what it shows | tets | command |\n|---|---|---|---|---|\n" + "\n".join(rows) + "\n")


def gallery():
    items = []
    for section in re.split(r"^## ", (docs / "gallery/README.md").read_text(), flags=re.M)[1:]:
        title = section.split("\n", 1)[0].strip()
        picture = re.search(r"!\[[^\]]*\]\(([^)\s]+)\)", section)
        command = re.search(r"^```\w*\n(.*?)\n```", section, re.S | re.M)
        if picture:
            film = (docs / "gallery" / picture[1]).with_suffix(".webp")
            clip = f' data-clip="gallery/{film.name}" tabindex="0"' if film.exists() else ""
            items.append(f'<figure><img src="gallery/{picture[1]}"{clip} loading="lazy" alt=""><figcaption>{esc(title, False)}'
                         + (f'<details><summary>command</summary><code class="cmd">{esc(command[1], False)}</code></details>' if command else "") + "</figcaption></figure>")
    return "\n".join(items)


def measured():
    """Every row of these parts that has an error, by what it simulates."""
    groups = {key: {"title": title, "rows": []} for key, title in fronts.items()}
    for part in (load(docs / f"data/{name}.json") for name in parts):
        for row in part["rows"]:
            if row.get("motion_final") is None:
                continue
            modulus = re.search(r"--young-modulus (\S+)", row["command"])
            key = row["scene"] + (f"-{modulus[1]}" if modulus else "")
            group = groups.setdefault(key, {"title": key, "rows": []})
            steps = re.search(r"--steps (\d+)", row["command"])
            if steps and "text" not in group:
                dt = load(root / f"models/scenes/{row['scene']}.json")["solver"]["dt"]
                group["text"] = (f"{thousands(row['tets'], narrow)} tets, {int(steps[1]) * dt:g} s of motion "
                                 f"in steps of {1000 * dt:g} ms")
                group["text"] += f"; {notes[key]}" if key in notes else ""
            group["rows"].append({**{k: row.get(k) for k in ("mode", "substeps", "iterations", "runs", "command", "gpu_ms", "wall_ms",
                                                             "gpu_ms_flight", "gpu_ms_contact")},
                                  "size": row["motion_final"], "displacement": row["motion_relative"]})
            group["source"] = f"{part['machine']['gpu'].split('/')[0]}, {part['machine']['driver']}; {part['machine']['cpu']}; {part['date']}"
    for group in groups.values():
        group["rows"].sort(key=lambda row: (list(modes).index(row["mode"]) if row["mode"] in modes else 99, (row["gpu_ms"] or row["wall_ms"])[1]))
    return {key: group for key, group in groups.items() if group["rows"]}


def cells(tag, *values):
    return "<tr>" + "".join(f"<{tag}>{value}</{tag}>" for value in values) + "</tr>"


def front_tables():
    out = []
    for group in measured().values():
        rows = []
        for row in group["rows"]:
            low, middle, high = row["gpu_ms"] or row["wall_ms"]
            rows.append(cells("td", f"<code>{row['mode']}</code>", f"{row['substeps']} × {row['iterations']}",
                              f"{middle:.3g}", f"{low:.4g}–{high:.4g}" if row["runs"] > 1 else "one run",
                              percent(row["size"], 2), percent(row["displacement"], 2),
                              f"<code>{esc(row['command'], False)}</code>"))
        head = cells("th", "mode", "substeps × iterations", "ms per step", "quartiles", "error", "relative to displacement", "command")
        out.append(f'<div class="wide"><table><caption>{group["title"]}: {group.get("text", "")}</caption><thead>{head}</thead><tbody>'
                   + "\n".join(rows) + "</tbody></table></div>")
    return "\n".join(out)


# ------------------------------------------------------------------------------------------------ machines
timed = ["bunny-drop node 20x1", "soft-beam explicit", "soft-beam newton 1x4"]


def parse_line(line):
    """The line that `tetpbd info --selftest` ends with; page.template.html reads it alike."""
    parts = [part.strip() for part in line.split("|")]
    machine = {"version": parts[0].split()[1], "gpu": parts[1], "driver": parts[2], "runs": {}}
    for part in parts[3:]:
        if found := re.fullmatch(r"(.+) (\S+) ms (\S+)", part):
            machine["runs"][found[1]] = [float(found[2]), float(found[3])]
        elif found := re.fullmatch(r"dispatch (\S+) us", part):
            machine["dispatch_us"] = float(found[1])
        elif found := re.fullmatch(r"copy (\S+) GB/s", part):
            machine["copy_gb_s"] = float(found[1])
        elif found := re.fullmatch(r"(\d+ of \d+) checks", part):
            machine["checks"] = found[1]
    return machine


def machines():
    out = []
    for row in load(docs / "data/machines.json")["rows"]:
        if "line" in row:
            machine = parse_line(row["line"])
        else:  # from other files of docs/data: name -> [file, what picks the row]
            machine = {key: row[key] for key in row if key != "data"} | {"runs": {}}
            for name, (part, pick) in row["data"].items():
                found = next(r for r in load(docs / f"data/{part}.json")["rows"] if all(r[k] == v for k, v in pick.items()))
                machine["runs"][name] = [float(f"{found['gpu_ms'][1]:.3g}"), found["motion_final"]]
        out.append(machine | {"date": row["date"], "cpu": row["cpu"]})
    return out


def machine_rows():
    rows = []
    for m in machines():
        cost = lambda ms, error: f"<b>{ms:.3g}</b><small>{percent(error, 2)}</small>"
        run = lambda name: cost(*m["runs"][name]) if name in m["runs"] else "–"
        rows.append(cells("td", f"{esc(m['gpu'])}<small>{esc(m['driver'])}; {esc(m['cpu'])}; {m['date']}</small>", *map(run, timed),
                          *(f"<b>{m[k]:.3g}</b>" if k == "dispatch_us" else f"<b>{m[k]:.4g}</b>" if k in m else "–" for k in ("dispatch_us", "copy_gb_s")),
                          m.get("checks", "–")))
    return "\n".join(rows)


# ------------------------------------------------------------------------------------------------ to files
def page():
    data = {"modes": modes, "fronts": measured(), "timed": timed, "machines": machines()}
    made = {"hero": hero, "doors": door_cards, "scenes": scene_cards, "scene_count": lambda: str(len(scenes())), "gallery": gallery,
            "front_tables": front_tables, "machines": machine_rows,
            "data": lambda: json.dumps(data, ensure_ascii=False, separators=(",", ":")).replace("</", "<\\/")}
    return re.sub(r"\{\{(\w+)\}\}", lambda found: made[found[1]](), (docs / "page.template.html").read_text())


def count(program):
    found = {}
    for scene in scenes():
        run = subprocess.run([program, "run", "--scene", scene["name"], "--explain", "--steps", "1"], capture_output=True, text=True)
        number = re.search(r", (\d+) tets", run.stdout) or sys.exit(f"{scene['name']}: no number of tets: {run.stderr}")
        found[scene["name"]] = int(number[1])
    print("tets =", json.dumps(found))


def main(words):
    if words[:1] == ["count"] and len(words) == 2:
        return count(words[1])
    if words not in ([], ["check"]):
        sys.exit(__doc__)
    for file, text in ((docs / "index.html", page()), (docs / "scenes.md", scene_page())):
        if words == []:
            file.write_text(text)
        elif not file.exists() or file.read_text() != text:
            sys.exit(f"{file}: differs from what docs/make_page.py writes: run it")


main(sys.argv[1:])
