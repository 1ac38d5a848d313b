"""The pages of the documentation as the other scripts read them: their links, headings and blocks of code."""
import pathlib
import posixpath
import re

FENCE = re.compile(r"^```([\w-]*)\n(.*?)^```$", re.M | re.S)
LINK = re.compile(r"\[(?:[^\]\[]|\[[^\]]*\])*\]\(([^)\s]+)\)")


def pages(root):
    """Every page of the project, as paths below its root."""
    root = pathlib.Path(root)
    found = [*root.glob("*.md"), *(root / "docs").rglob("*.md")]
    return sorted(str(page.relative_to(root)) for page in found)


def blank_code(text):
    """The text with all code blanked out, every letter of the rest where it was."""
    def blank(m):
        return re.sub(r"[^\n]", " ", m[0])
    text = FENCE.sub(blank, text)
    text = re.sub(r"(?:(?<=\n\n)|\A)(?:(?: {4,}[^\n]*)?\n)+", blank, text)
    return re.sub(r"(`+)[^`].*?\1", blank, text, flags=re.S)


def links(text):
    """(target, where it begins) of each link that leads to a file or a heading."""
    for m in LINK.finditer(blank_code(text)):
        if not re.match(r"[a-z]+:", m[1]):
            yield text[m.start(1):m.end(1)], m.start(1)


def target_of(page, link):
    """The path, below the root, and the anchor of a link on a page."""
    path, _, anchor = link.partition("#")
    return posixpath.normpath(posixpath.join(posixpath.dirname(page), path)) if path else page, anchor


def anchors(text):
    """What headings are called by the site and by forges; of those that differ, neither: a link would break on one."""
    found = set()
    for heading in re.findall(r"^#{1,6} +(.*?) *#*$", FENCE.sub("", text), re.M):
        plain = re.sub(r"[`*]|\]\([^)]*\)|\[", "", heading).lower()
        forge = re.sub(r"[^\w\- ]", "", plain).replace(" ", "-")
        site = re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", plain).strip())
        if forge == site:
            found.add(site)
    return found


def line_of(text, place):
    return text.count("\n", 0, place) + 1
