"""What the scripts that write pages share: JSON files, numbers as text, tables in Markdown."""
import json, pathlib

docs = pathlib.Path(__file__).resolve().parent


def load(path):
    return json.loads(pathlib.Path(path).read_text())


def thousands(count, space=" "):
    return f"{int(count):,}".replace(",", space)


def rounded(value, digits=4):
    """A number, or the text of one, to so many digits; with an exponent where it is large or small."""
    return "–" if value in ("", None) else f"{float(value):.{digits}g}"


def number(value, digits=3):
    """A number to so many digits, never with an exponent. An integer keeps all its digits, and text stays as it is."""
    if value is None:
        return "–"
    if not isinstance(value, float):
        return thousands(value) if isinstance(value, int) else value
    return f"{float(rounded(value, digits)):f}".rstrip("0").rstrip(".").replace("-", "−")


def percent(value, digits=3):
    return "–" if value is None else f"{number(100.0 * value, digits)} %"


def table(head, rows, gap=""):
    """Lines of Markdown; `gap` stands on both sides of what is in a cell."""
    line = lambda cells: "|" + "|".join(f"{gap}{cell}{gap}" for cell in cells) + "|"
    return "\n".join(map(line, [head, ["---"] * len(head), *rows]))
