#!/usr/bin/env python3
"""The pages by hand: links and anchors that exist, pictures that are there, words within their budget, no idle phrases.

Usage: pages_test.py ROOT
"""
import pathlib, re, sys, urllib.parse

most_words = 19000
root = pathlib.Path(sys.argv[1]).resolve()
generated = {root / "docs/scenes.md"}
pages = sorted({root / "README.md", root / "CONTRIBUTING.md", root / "CHANGELOG.md", root / "models/README.md",
                *root.glob("docs/*.md"), *root.glob("docs/*/*.md")})
counted = [page for page in [root / "README.md", *sorted(root.glob("docs/*.md"))] if page not in generated]
phrases = ["made of something", "counterparts of", "to the bit", "is of no use", "chance plays no part",
           "go in between vertices", "right motion", "of the way |"]
failures = []


def anchors(text):
    """GitHub's: lower case, letters, digits, hyphens and underscores; spaces become hyphens; repeated ones are numbered."""
    seen = {}
    fence = False
    for line in text.splitlines():
        fence ^= line.startswith("```")
        heading = None if fence else re.match(r"#+ +(.*)", line)
        if heading:
            words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading[1]).replace("`", "").strip().lower()
            slug = re.sub(r"[^\w\- ]", "", words).replace(" ", "-")
            number = seen.get(slug, 0)
            seen[slug] = number + 1
            yield f"{slug}-{number}" if number else slug
    yield from re.findall(r"<a (?:name|id)=\"([^\"]+)\"", text)


texts = {page: page.read_text() for page in pages}
for page, text in texts.items():
    name = page.relative_to(root)
    prose = re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)
    links = re.findall(r"\]\(([^)\s]+)\)", prose) + re.findall(r"(?:src|href)=\"([^\"]+)\"", prose)
    for link in links:
        path, _, anchor = urllib.parse.unquote(link).partition("#")
        if re.match(r"[a-z]+:", path):
            continue
        target = (page.parent / path).resolve() if path else page
        if not target.exists():
            failures.append(f"{name}: no file {link}")
        elif anchor and target.suffix == ".md" and anchor not in anchors(target.read_text()):
            failures.append(f"{name}: no heading {link}")
    failures += [f"{name}: '{phrase}'" for phrase in phrases if phrase in text and "generated" not in name.parts]
# Tables that docs/measured.py fills are not written by hand.
words = {page: len(re.sub(r"<!-- data: .*?<!-- end -->", "", texts[page], flags=re.S).split()) for page in counted}
if sum(words.values()) > most_words:
    failures.append(f"{sum(words.values())} words, at most {most_words}: " +
                    ", ".join(f"{page.name} {count}" for page, count in sorted(words.items(), key=lambda of: -of[1])))
print("\n".join(failures) or f"{len(pages)} pages, {sum(words.values())} words of {most_words}")
sys.exit(bool(failures))
