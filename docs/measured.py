#!/usr/bin/env python3
"""Numbers on pages come from docs/data alone.

docs/measured.py collect FOLDER FILE COMMIT   what docs/measure.sh left, as one file: commands, machine, quartiles
docs/measured.py fill [PAGE ...]              writes the numbers of these pages, or of README.md and all in docs
docs/measured.py check [PAGE ...]             fails where a page differs from what fill would write

A table stands between <!-- data: NAME --> and <!-- end -->; `tables` below makes it. A number in a sentence is
<!--n:PART/WORD/.../FIELD-->9.8 ms<!--/n-->: of the one row of docs/data/PART.json that all the words match (its key, mode
or scene, a word of its command, or FIELD=VALUE) the field, with its unit. docs/data/earlier.json has the parts that
docs/measure.sh does not measure; what is not known about them is null.
"""
import datetime, json, pathlib, re, statistics, sys

sys.dont_write_bytecode = True  # An import leaves no folder among the pages.
from tables import docs, load, number, percent, table

pages = [docs.parent / "README.md", *sorted(docs.glob("*.md"))]


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
        document = load(run / "compare.json")
        for row in document["rows"]:
            median = lambda v: v["median"] if isinstance(v, dict) else v
            yield document["device"], {
                **{key: row.get(key) for key in ("scene", "mode", "iterations", "substeps", "tets", "motion_final",
                                                 "motion_relative", "rise", "finite")},
                "gpu_ms": median(row["gpu_ms_per_step"]), "wall_ms": median(row["wall_ms_per_step"])}
    else:
        s = load(run / "stats.json")
        gpu, wall = s["timing"]["gpu_ms_per_step"] or {}, s["timing"]["wall_ms_per_step"] or {}
        yield s["device"], {
            "scene": s["scene"], "mode": s["settings"]["mode"], "iterations": s["settings"]["iterations"],
            "substeps": s["settings"]["substeps"], "tets": s["mesh"]["tets"], "finite": s["finite"],
            "motion_final": s["error"]["motion_final"], "motion_relative": s["error"].get("motion_relative"),
            "residual": s.get("watch", {}).get("largest_residual"),
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
    """A part as measure.sh left it, else as earlier.json has it; its rows say by what command and when they were measured."""
    file = docs / f"data/{part}.json"
    found = load(file) if file.exists() else load(docs / "data/earlier.json").get(part)
    if found:
        found["rows"] = [{"command": found.get("command"), "date": found.get("date"), **row} for row in found["rows"]]
    return found


def matches(row, word):
    """Whether a row has a value ("substeps=20"), or is named by this word: key, mode, scene, or a word of its command."""
    field, equal, value = word.partition("=")
    if equal and field in row:
        return str(row[field]) == value
    return word in (row.get("key"), row.get("mode"), row.get("scene"), *(row["command"] or "").split())


def pick(part, words="", **values):
    """The rows of a part whose command has all these words, in the order of the file."""
    return [row for row in part["rows"] if all(row.get(k) == v for k, v in values.items())
            and all(word in (row["command"] or "").split() for word in words.split())]


def share(field, digits=2):
    """A column of per cents, the sign of which stands in its head."""
    return lambda row: "–" if row.get(field) is None else number(100.0 * row[field], digits)


def code(field):
    return lambda row: f"`{row[field]}`"


def after(flag):
    """The word behind a flag of a row's command."""
    return lambda row: re.search(f"{flag} (\\S+)", row["command"])[1]


def ms(row):
    cost = next((row[key] for key in ("gpu_ms", "wall_ms", "ms") if row.get(key)), None)
    return number(cost[1] if isinstance(cost, list) else cost)


def short_name(name):
    """What a driver or the system calls a device, without versions and the like."""
    return re.sub(r"/.*|\(R\)| Processor| \(LLVM.*", "", name)


def source(name, *others):
    """On what, when and from what the numbers of a table come, as far as that is known."""
    parts = [data(one) for one in (name, *others)]
    part, machine = parts[0], parts[0]["machine"] or {}
    gpu, cpu = (short_name(machine.get(key, "")) for key in ("gpu", "cpu"))
    commits = " and ".join(dict.fromkeys(one["commit"] for one in parts if one["commit"]))
    runs = max(row.get("runs", 0) for row in part["rows"])
    dates = " and ".join(dict.fromkeys(row["date"] for row in part["rows"] if row["date"]))
    facts = [gpu, cpu, f"commit {commits}" if commits else "", dates, f"medians of {runs} runs" if runs > 1 else ""]
    facts = list(filter(None, facts)) or [f"`{part['command']}`" if part["command"] else "as published"]
    return f"`{name}`: {', '.join(facts)}."


def listed(name, *columns):
    """A table with a line for each row of a part. Columns: head and what is in it, a field or a function of the row."""
    cell = lambda row, what: what(row) if callable(what) else number(row.get(what))
    rows = [[cell(row, what) for _, what in columns] for row in data(name)["rows"]]
    return table([head for head, _ in columns], rows) + "\n\n" + source(name)


def crossed(name, side, top, cell, corner=""):
    """A table with a line for each value of one field (or function) and a column for each of another."""
    part = data(name)
    get = lambda row, what: what(row) if callable(what) else row[what]
    sides, tops = (list(dict.fromkeys(get(row, what) for row in part["rows"])) for what in (side, top))
    cells = {(get(row, side), get(row, top)): cell(row) for row in part["rows"]}
    rows = [[str(s), *(cells.get((s, t), "") for t in tops)] for s in sides]
    return table([corner, *map(str, tops)], rows) + "\n\n" + source(name)


# ------------------------------------------------------------------------------------------------ the tables
errors = [("error, %", share("motion_final")), ("relative to displacement, %", share("motion_relative"))]


def hard_table():
    part, rows = data("hard"), []
    for command, name in (("--modes rigid-body", "a rigid body, 5 × 1, one CPU core"),
                          ("--solver hard", "`--solver hard`, 5 × 1"),
                          ("--solver substeps", "`--solver substeps`, 20 × 1, the default"),
                          ("--solver paper", "`--solver paper`, 1 × 25")):
        row = pick(part, command)[0]
        times = [row["gpu_ms_flight"], row["gpu_ms_contact"]] if "gpu_ms_flight" in row else [row["wall_ms"]]
        rows.append([name, ", ".join(number(time[1], 2) for time in times), *(what(row) for _, what in errors)])
    head = ["substeps × iterations", "ms per step: in flight, in contact", *(name for name, _ in errors)]
    return table(head, rows) + "\n\n" + source("hard")


solvers = [("node", "", "`node` (Jacobi XPBD), {} × 1"),
           ("gauss-seidel", "", "`gauss-seidel` (coloured XPBD), {} × 1"),
           ("cpu-fast", "", "`cpu-fast` (XPBD, CPU), {} × 1"),
           ("vbd", "--acceleration 0", "`vbd`, 1 × {}"),
           ("vbd", "--acceleration 0.9", "`vbd`, acceleration 0.9, 1 × {}"),
           ("direct", "", "Newton with sparse Cholesky, one core, 1 × {}"),
           ("newton", "", "`newton`, 1 × {}"),
           ("explicit", "", "`explicit`, {} × 1")]


def solver_table(name, scenes):
    """The settings of one solver in one line: times, errors."""
    lines = []
    for scene, title in scenes:
        lines += [[f"**{title}**", "", "", ""]] if title else []
        for mode, words, label in solvers:
            rows = [row for part in (name, "rivals") for row in pick(data(part), f"{scene} {words}", mode=mode)]
            of = lambda what: ", ".join(map(what, rows))
            if rows:
                varied = "substeps" if label.endswith("× 1") else "iterations"
                lines.append([label.format(of(lambda row: str(row[varied]))), of(ms), *(of(what) for _, what in errors)])
    head = ["substeps × iterations", "ms per step", *(name for name, _ in errors)]
    return table(head, lines) + "\n\n" + source(name, "rivals")


def published_table():
    """Scenes of other programs: what these take by their own numbers, then what this one takes."""
    lines, ours = [], data("published")
    machine = short_name(ours["machine"]["gpu"])

    def error(row):
        return percent(row["residual"] if row["motion_final"] is None else row["motion_final"], 2)
    for row in data("elsewhere")["rows"]:
        found = [one for one in ours["rows"] if one["scene"] == row["scene"]]
        size = f", {number(found[0]['tets'])} tets" if found else ""
        lines += [[f"**`{row['scene']}`**{size}", "", "", ""], [row["program"], row["machine"], ms(row), "–"]]
        for mode, substeps in dict.fromkeys((one["mode"], one["substeps"]) for one in found):
            rows = [one for one in found if (one["mode"], one["substeps"]) == (mode, substeps)]
            iterations = ", ".join(str(one["iterations"]) for one in rows)
            lines.append([f"`{mode}`, {substeps} × {iterations}", machine, ", ".join(map(ms, rows)),
                          ", ".join(map(error, rows))])
    return table(["scene; program, substeps × iterations", "machine", "ms per step", "error"], lines) + "\n\n" + source("published")


def copies_table():
    part = data("copies")
    one = part["rows"][0]["fps"][1]
    rows = [[str(row["copies"]), ms(row), number(round(row["copies"] * row["fps"][1])),
             number(row["copies"] * row["fps"][1] / one)] for row in part["rows"]]
    head = [f"copies of {part['rows'][0]['tets']} tets", "ms per step", "steps of one per second", "times one alone"]
    return table(head, rows) + "\n\n" + source("copies")


def losses_table():
    each = lambda field: lambda row: ", ".join(number(100.0 * value) for value in row[field])
    return listed("losses", ("largest net volume loss, %", "body"), ("published", each("published")), ("tetpbd", each("loss")))


def arrow(row):
    """Time -> error in per cent, bold where a row is what its scene has."""
    error = next((row[key] for key in ("total", "total_relative", "motion_final") if row.get(key) is not None), None)
    text = f"{ms(row)} → {'–' if error is None else number(100.0 * error)}"
    return f"**{text}**" if row.get("default") else text


tables = {
    "hard": hard_table,
    "beam": lambda: solver_table("beam", [("soft-beam", "")]),
    "bunny": lambda: solver_table("bunny", [("clamped-bunny --young-modulus 5e4", "50 kPa"),
                                            ("clamped-bunny --young-modulus 1e6", "1 MPa")]),
    "copies": copies_table,
    "published": published_table,
    "forces": lambda: crossed("forces", "name", "setting",
                              lambda r: arrow(r) + (f" ({r['substeps']})" if r["mode"] == "explicit" else "")),
    "meshes": lambda: crossed("meshes", lambda r: f"{r['mesh']}, {number(r['like'])} tets",
                              lambda r: f"`{r['scene']}`" + ", smoothed" * (r["element"] == "smoothed"), arrow),
    "sag-motion": lambda: crossed("sag-motion", "name", "element", arrow),
    "stiffness": lambda: crossed("stiffness", after("--dt"), after("--young-modulus"),
                                 lambda r: ", ".join(what(r) for _, what in errors), "dt, s; *E*, Pa"),
    "contact": lambda: listed("contact", ("scene", code("scene")), ("mode", code("mode")), ("least distance", "least"),
                              ("momentum, m/s", "momentum"),
                              ("ms per step, 95 %", lambda r: f"{ms(r)}, {number(r['ms_95'])}")),
    "created": lambda: listed("created", ("scene", lambda r: r.get("name", f"`{r['scene']}`")), ("mode", code("mode")),
                              ("energy created, %", share("created")), ("ms per step", ms)),
    "others": lambda: listed("others", ("program", "program"), ("scene", "what"), ("promises", "promise"),
                             ("ms per step", ms)),
    "sag": lambda: crossed("sag", "nu", "cells", share("ratio", 3), "%"),
    "sag-smoothed": lambda: crossed("sag-smoothed", "element", "nu", share("ratio", 4), "%"),
    "pipeline": lambda: crossed("pipeline", "name", "body", lambda r: f"{number(r['us'])}; {number(100 * r['loss'])}",
                                "µs; loss, %"),
    "materials": lambda: crossed("materials", "name", code("mode"), ms, "ms per step"),
    "hard-cases": lambda: listed("hard-cases", ("mode", "name"), ("recovered", lambda r: f"{r['recovered']} of {r['of']}")),
    "losses": losses_table,
}


# ------------------------------------------------------------------------------------------------ numbers in sentences
units = {"speed": " m/s", "distance": " mm", "us": " µs"}
aliases = {"error": "motion_final", "relative": "motion_relative"}
fractions = {"motion_final", "motion_relative", "total", "created", "loss", "off", "shape", "ratio", "energy", "cost"}


def quoted(key):
    """PART/WORD/.../FIELD: of the one row that all these words match what it has there, with its unit."""
    name, *words, field = key.split("/")
    part = data(name) or sys.exit(f"{key}: docs/data has no part {name}")
    rows = [row for row in part["rows"] if all(matches(row, word) for word in words)]
    field = aliases.get(field, field)
    if len(rows) != 1:
        sys.exit(f"{key}: {len(rows)} rows match")
    if field == "ms":
        return f"{ms(rows[0])} ms"
    value = rows[0][field] if field in rows[0] else sys.exit(f"{key}: the row has {', '.join(rows[0])}")
    return percent(value) if field in fractions else number(value) + units.get(field, "")


def filled(text):
    def block(found):
        name = found[1]
        made = tables[name]() if name in tables else sys.exit(f"{name}: not among the tables of docs/measured.py")
        return f"<!-- data: {name} -->\n{made}\n<!-- end -->"
    text = re.sub(r"<!-- data: (\w[\w-]*) -->\n.*?<!-- end -->", block, text, flags=re.S)
    return re.sub(r"(<!-- ?n: ?([\w-]+/\S+?) ?-->).*?(<!-- ?/n ?-->)", lambda m: m[1] + quoted(m[2]) + m[3], text, flags=re.S)


def main(words):
    if words[:1] == ["collect"] and len(words) == 4:
        return collect(pathlib.Path(words[1]), pathlib.Path(words[2]), words[3])
    if words[:1] not in (["fill"], ["check"]):
        sys.exit(__doc__)
    for page in map(pathlib.Path, words[1:]) if words[1:] else pages:
        text = page.read_text()
        if words[0] == "fill":
            page.write_text(filled(text))
        elif filled(text) != text:
            sys.exit(f"{page}: differs from docs/data: run docs/measured.py fill")


main(sys.argv[1:])
