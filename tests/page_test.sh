#!/usr/bin/env bash
# docs/index.html and docs/scenes.md are what docs/make_page.py writes, their links lead somewhere, and the page works in a browser.
# Usage: page_test.sh FOLDER, which gets the pictures of the page.
set -euo pipefail
docs=$(realpath "$(dirname "$0")/../docs")
fail() { echo "FAILED: $*" >&2; exit 1; }
rm -rf "$1" && mkdir -p "$1" && cd "$1"

python3 "$docs/make_page.py" check || fail "pages are out of date"
(($(stat -c %s "$docs/index.html") <= 400 * 1024)) || fail "index.html is larger than 400 KB"
python3 - "$docs" <<'PYTHON' || fail "links"
import html, pathlib, re, sys
docs, bad = pathlib.Path(sys.argv[1]), []
def anchors(page):
    text = page.read_text()
    if page.suffix == ".html":
        return set(re.findall(r'\sid="([^"]+)"', text))
    return {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in re.findall(r"^#+ (.+?)\s*$", text, re.M)}
for page, pattern in ("index.html", r'\s(?:href|src|srcset|data-clip)="([^"]*)"'), ("scenes.md", r"\]\(([^)\s]+)\)"):
    found = re.findall(pattern, re.sub(r"<script.*?</script>", "", (docs / page).read_text(), flags=re.S))
    for link in map(html.unescape, found):
        if link.startswith("data:"):
            continue
        if re.match(r"\w+:|//", link):
            bad.append(f"{page}: {link} needs a network")
            continue
        path, _, anchor = link.partition("#")
        target = docs / path if path else docs / page
        if not target.exists():
            bad.append(f"{page}: no {link}")
        elif anchor and anchor not in anchors(target):
            bad.append(f"{page}: no such place: {link}")
print("\n".join(bad))
sys.exit(bool(bad))
PYTHON

browser=$(command -v chromium || command -v chromium-browser || command -v google-chrome) || fail "there is no chromium: apt-get install chromium"
browse() {  # OPTIONS... ADDRESS: what the browser prints
  timeout 120 "$browser" --headless=new --no-sandbox --disable-gpu --hide-scrollbars --enable-logging=stderr --user-data-dir="$PWD/profile" \
    "$@" 2>log.txt || fail "no page: $(tail -n 3 log.txt)"
  ! grep CONSOLE log.txt || fail "messages on the console"
}
load() {  # HASH: the page, as it stands once its scripts have run, in page.html
  browse --window-size=1280,900 --dump-dom "file://$docs/index.html#$1" >page.html
  grep -q '<html[^>]* data-ready="yes"' page.html || fail "the script did not reach its end: #$1"
  ! grep -o '<html[^>]* data-errors="[^"]*"' page.html || fail "errors in the script: #$1"
}
has() { grep -qF -- "$1" page.html || fail "the page has no $1"; }

# The chart has a mark for each row with an error, and shows the row that is asked for.
rows=$(python3 -c "import json, sys; print(sum(row['motion_final'] is not None for f in sys.argv[1:] for row in json.load(open(f))['rows']))" \
  "$docs"/data/{beam,bunny,hard,rivals}.json)
load ""
mapfile -t scenes < <(grep -o 'data-scene="[^"]*"' page.html | cut -d '"' -f 2)
marks=0
for scene in "${scenes[@]}"; do
  load "scene=$scene&error=size&point=1"
  marks=$((marks + $(grep -o '<g class="pt' page.html | wc -l)))
  has "data-scene=\"$scene\" aria-pressed=\"true\""
  has '<g class="pt on" data-i="1"'
  grep -q 'id="readout".*<code class="cmd"><span>tetpbd</span>' page.html || fail "no command beside the chart of $scene"
done
[[ $marks == "$rows" ]] || fail "$marks marks for $rows rows"

# The filter leaves what its words are in; a line of the self-test stands in the table, and others do not.
line=$(python3 -c "import json, sys, urllib.parse
print(urllib.parse.quote(next(row['line'] for row in json.load(open(sys.argv[1]))['rows'] if 'line' in row)))" "$docs/data/machines.json")
load "filter=bowl&line=$line"
shown=$(grep -o '<li class="card" data-name="[^"]*">' page.html | cut -d '"' -f 4 | tr '\n' ' ' || true)
[[ " $shown" == *" bowl "* && " $shown" != *" balloon "* ]] || fail "the filter shows $shown"
has '<tr class="yours"><td>yours: llvmpipe'
has 'checks passed.'
load "filter=nothing-has-this&line=tetpbd%20<b>nonsense</b>"
has 'no scene has “nothing-has-this”'
has 'This is not the line'
! grep -q 'class="yours"\|<b>nonsense' page.html || fail "nonsense was taken for a line"

# Pictures; on a phone, which a frame stands for as windows are never that narrow, nothing is wider than the screen.
python3 - "$docs" <<'PYTHON' >phone.html
import html, pathlib, sys
page = (pathlib.Path(sys.argv[1]) / "index.html").read_text().replace("<head>", f'<head><base href="file://{sys.argv[1]}/">')
print(f"""<!DOCTYPE html><meta name="color-scheme" content="light dark"><body style="margin: 0"><iframe style="border: 0; display: block" width=390 height=1600
onload="const root = this.contentDocument.documentElement; document.title = [root.dataset.ready, this.contentWindow.innerWidth, root.scrollWidth].join(' ')"
srcdoc="{html.escape(page)}"></iframe>""")
PYTHON
for address in "$docs/index.html" "$PWD/phone.html"; do
  for scheme in 1 0; do  # light, dark
    name=$(basename "$address" .html)_$scheme.png
    browse --window-size="$([[ $address == *phone* ]] && echo 390 || echo 1280),1600" --blink-settings=preferredColorScheme=$scheme \
      --screenshot="$PWD/$name" "file://$address"
    [[ -s $name ]] || fail "no picture"
  done
done
! cmp -s phone_0.png phone_1.png || fail "dark looks as light"
browse --dump-dom "file://$PWD/phone.html" >page.html
grep -qE '<title>yes ([0-9]+) \1</title>' page.html || fail "on a phone: $(grep -o '<title>[^<]*' page.html | head -n 1) (ready, width of the screen and of the page)"
rm -rf profile
echo "page: $marks marks in ${#scenes[@]} charts, $(grep -c 'class="card"' "$docs/index.html") scenes"
