#!/usr/bin/env python3
"""check_site.py FOLDER: every link of the built site leads to a file and a heading in it, and nothing is fetched from elsewhere."""
import html.parser
import pathlib
import sys
import urllib.parse

folder = pathlib.Path(sys.argv[1]).resolve()


class Page(html.parser.HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.ids, self.links, self.loads = set(), [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.ids |= {given[key] for key in ("id", "name") if given.get(key)}
        if tag == "a" and given.get("href"):
            self.links.append(given["href"])
        for key in ("src", "href"):
            if tag in ("img", "script", "link") and given.get(key):
                self.loads.append(given[key])


pages = {path: Page(path.read_text()) for path in folder.rglob("*.html")}
faults = [f"{folder}: no page"] if not pages else []
for path, page in pages.items():
    if path.name == "404.html":
        continue
    for link in page.links + page.loads:
        parts = urllib.parse.urlsplit(link)
        if parts.scheme or parts.netloc:
            if link in page.loads:
                faults.append(f"{path.relative_to(folder)}: fetches {link}")
            continue
        target = (path.parent / urllib.parse.unquote(parts.path)).resolve() if parts.path else path
        target = target / "index.html" if target.is_dir() else target
        if not target.exists():
            faults.append(f"{path.relative_to(folder)}: {link} leads to nothing")
        elif parts.fragment and target in pages and urllib.parse.unquote(parts.fragment) not in pages[target].ids:
            faults.append(f"{path.relative_to(folder)}: {link}: no such heading")
print("\n".join(faults) or f"{len(pages)} pages, all is well")
sys.exit(1 if faults else 0)
