#!/usr/bin/env python3
"""Numbers on pages come from docs/data alone.

docs/measured.py collect FOLDER FILE COMMIT   what docs/measure.sh left, as one file: commands, machine, quartiles
docs/measured.py fill                         writes the tables of README.md and docs/results.md
docs/measured.py check                        fails where a page differs from what fill would write

A table stands between <!-- data: NAME --> and <!-- end -->; the functions below make them.
"""
import datetime, json, pathlib, re, statistics, sys

docs = pathlib.Path(__file__).resolve().parent
pages = [docs.parent / "README.md", docs / "results.md"]


# ------------------------------------------------------------------------------------------------ from runs to a file
def quartiles(values):
    values = [v for v in values if v]
    if not values:
        return None
    q = statistics.quantiles(values, n=4, method="inclusive") if len(values) > 1 else values * 3
    return [float(f"{v:.4g}") for v in q]


def processor():
    lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines()
    names = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    return f"{names[0]}, {len(names)} threads" if names else "unknown"


def rows_of(run):
    """Of one run of a command: what tells its rows apart, times and errors."""
    if (run / "compare.json").exists():
        document = json.loads((run / "compare.json").read_text())
        for row in document["rows"]:
            median = lambda v: v["median"] if isinstance(v, dict) else v
            yield document["device"], {
                **{key: row.get(key) for key in ("scene", "mode", "iterations", "substeps", "tets", "motion_final",
                                                 "motion_relative", "rise", "finite")},
                "gpu_ms": median(row["gpu_ms_per_step"]), "wall_ms": median(row["wall_ms_per_step"])}
    else:
        s = json.loads((run / "stats.json").read_text())
        gpu, wall = s["timing"]["gpu_ms_per_step"] or {}, s["timing"]["wall_ms_per_step"] or {}
        yield s["device"], {
            "scene": s["scene"], "mode": s["settings"]["mode"], "iterations": s["settings"]["iterations"],
            "substeps": s["settings"]["substeps"], "tets": s["mesh"]["tets"], "finite": s["finite"],
            "motion_final": s["error"]["motion_final"], "motion_relative": s["error"].get("motion_relative"),
            "gpu_ms": gpu.get("median"), "wall_ms": wall.get("median"),
            "gpu_ms_flight": gpu.get("p05"), "gpu_ms_contact": gpu.get("p95"),
            "copies": s["timing"].get("copies", 1), "fps": s["timing"]["fps"]}


def collect(folder, file, commit):
    rows, device = [], None
    for command in sorted(folder.iterdir(), key=lambda path: int(path.name)):
        found = {}
        for run in sorted(path for path in command.iterdir() if path.is_dir()):
            for number, (device, row) in enumerate(rows_of(run)):
                found.setdefault(number, []).append(row)
        for repeated in found.values():
            row = {"command": (command / "command").read_text().strip(), "runs": len(repeated), **repeated[0]}
            for key in ("gpu_ms", "wall_ms", "gpu_ms_flight", "gpu_ms_contact", "fps"):
                if key in row:
                    row[key] = quartiles([one[key] for one in repeated])
            rows.append(row)
    document = {"commit": commit, "date": datetime.date.today().isoformat(),
                "machine": {"gpu": device["gl_renderer"], "driver": device["gl_version"], "cpu": processor()},
                "rows": rows}
    text = json.dumps(document, indent=1)
    file.write_text(re.sub(r"\[\s+([^\[\]{}]*?)\s+\]", lambda m: "[" + " ".join(m[1].split()) + "]", text) + "\n")


# ------------------------------------------------------------------------------------------------ from files to pages
def data(part):
    file = docs / "data" / f"{part}.json"
    return json.loads(file.read_text()) if file.exists() else None


def pick(part, words="", **values):
    """The rows of a part whose command has all these words, in the order of the file."""
    return [row for row in part["rows"]
            if all(row.get(k) == v for k, v in values.items()) and all(w in row["command"].split() for w in words.split())]


def ms(row):
    cost = row["gpu_ms"] or row["wall_ms"]
    return f"{cost[1]:.3g}"


def percent(value):
    return "–" if value is None else f"{float(f'{100 * value:.2g}'):f}".rstrip("0").rstrip(".") + " %"


def table(head, rows):
    return "\n".join("| " + " | ".join(row) + " |" for row in [head, ["---"] * len(head), *rows])


def source(part):
    m = part["machine"]
    return (f"{m['gpu'].split('/')[0]}, {m['driver']}, {m['cpu']}; commit {part['commit']}, {part['date']}; medians of "
            f"{max(row['runs'] for row in part['rows'])} runs (`docs/data`, `docs/measure.sh`).")


def several(rows, name, what):
    """Rows of one solver in one line: times, errors."""
    return [name.format(", ".join(str(row[what]) for row in rows)), ", ".join(map(ms, rows)),
            ", ".join(percent(row["motion_final"]) for row in rows),
            ", ".join(percent(row["motion_relative"]) for row in rows)]


def hard_table():
    part = data("hard")
    rigid = pick(part, mode="rigid-body")[0]
    rows = [["a rigid body in 5 steps (one CPU core)", f"{rigid['wall_ms'][1]:.2g}", percent(rigid["motion_final"])]]
    for solver, name in (("hard", "5 substeps (`--solver hard`)"), ("substeps", "20 substeps (`--solver substeps`, the default)"),
                         ("paper", "the paper's 25 iterations (`--solver paper`)")):
        row = pick(part, f"--solver {solver}")[0]
        rows.append([name, f"{row['gpu_ms_flight'][1]:.2g}, {row['gpu_ms_contact'][1]:.2g}", percent(row["motion_final"])])
    return table(["", "ms per step: in flight, in contact", "error of the motion"], rows) + "\n\n" + source(part)


def soft_rows(part, words=""):
    names = [("node", "`node` (XPBD by Jacobi): {} substeps", "substeps"),
             ("gauss-seidel", "`gauss-seidel` (XPBD by colours): {} substeps", "substeps"),
             ("cpu-fast", "`cpu-fast` (XPBD): {} substeps", "substeps"),
             ("direct", "a Newton step with sparse Cholesky factors, one core", "iterations"),
             ("newton", "`newton`: {} iterations", "iterations"),
             ("explicit", "`explicit`: {} substeps", "substeps")]
    rivals = data("rivals") or {"rows": []}
    found = lambda mode: pick(part, words, mode=mode) or pick(rivals, words, mode=mode)
    return [several(rows, name, what) for mode, name, what in names if (rows := found(mode))]


def beam_table():
    part = data("beam")
    return table(["", "ms per step", "error", "of the way"], soft_rows(part, "soft-beam")) + "\n\n" + source(part)


def bunny_table():
    part, parts = data("bunny"), []
    for modulus, name in (("5e4", "50 kPa"), ("1e6", "1 MPa")):
        rows = soft_rows(part, f"clamped-bunny --young-modulus {modulus}")
        parts += [[f"**{name}**", "", "", ""], *rows]
    return table(["", "ms per step", "error", "of the way"], parts) + "\n\n" + source(part)


def copies_table():
    part = data("copies")
    one = part["rows"][0]["fps"][1]
    rows = [[str(row["copies"]), f"{row['gpu_ms'][1]:.3g}", f"{row['copies'] * row['fps'][1]:,.0f}".replace(",", " "),
             f"{row['copies'] * row['fps'][1] / one:.3g}"] for row in part["rows"]]
    return table([f"copies of {part['rows'][0]['tets']} tets", "ms per step", "steps of one per second", "times one alone"], rows) + "\n\n" + source(part)


tables = {"hard": hard_table, "beam": beam_table, "bunny": bunny_table, "copies": copies_table}


def filled(text):
    def block(found):
        name = found[1]
        return f"<!-- data: {name} -->\n{tables[name]()}\n<!-- end -->" if data(name) else found[0]
    return re.sub(r"<!-- data: (\w+) -->\n.*?<!-- end -->", block, text, flags=re.S)


def main(words):
    if words[:1] == ["collect"] and len(words) == 4:
        return collect(pathlib.Path(words[1]), pathlib.Path(words[2]), words[3])
    if words not in (["fill"], ["check"]):
        sys.exit(__doc__)
    for page in pages:
        text = page.read_text()
        if words == ["fill"]:
            page.write_text(filled(text))
        elif filled(text) != text:
            sys.exit(f"{page}: differs from docs/data: run docs/measured.py fill")


main(sys.argv[1:])
