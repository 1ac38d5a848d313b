#!/usr/bin/env python3
"""house_figures.py [--hold] [ROOT]: counts the files, lines and functions of each room, and finds circles of calls among files.

With --hold it fails if a function is longer than CONTRIBUTING.md allows, or if files call each other in a circle.
"""
import collections
import pathlib
import re
import sys

MOST_FUNCTION_LINES = 60
arguments = [a for a in sys.argv[1:] if a != "--hold"]
root = pathlib.Path(arguments[0] if arguments else pathlib.Path(__file__).parent.parent)
parts = ["libinsitu", "mmbvh", "render", "compositing", "adaptors", "mini-app", "tools"]


def files_of(part):
    return sorted(p for p in (root / part).rglob("*") if p.suffix in (".c", ".h", ".cpp"))


def plain(text):
    """The code without comments and strings, line for line."""
    blank = lambda m: re.sub(r"[^\n]", " ", m[0])
    return re.sub(r"/\*.*?\*/|//[^\n]*|\"(?:\\.|[^\"\\\n])*\"", blank, text, flags=re.S)


text = {p: p.read_text() for part in parts for p in files_of(part)}
code = {p: plain(t) for p, t in text.items()}
def part_of(p):
    return p.relative_to(root).parts[0]


def functions(p):
    """(name, lines, whether the file alone sees it, body) of each function that is defined in the file."""
    for m in re.finditer(r"^[A-Za-z_](?:[^;{}()=#]|__attribute__\(\([\w, ]+\)\))*?\b(?!__attribute__)([A-Za-z_]\w*)\([^;{}]*?\)\s*\n\{(.*?)^\}", code[p], re.M | re.S):
        yield m[1], m[0].count("\n") + 1, p.suffix == ".c" and m[0].startswith("static"), m[2]


def calls_in_circles(files):
    """Groups of files that call each other in a circle (Tarjan's strongly connected components); a .c and its .h are one."""
    places = collections.defaultdict(set)
    for p in files:
        for name, _, own, _ in functions(p):
            if not own:
                places[name].add(p.stem)
    defined = {name: min(found) for name, found in places.items() if len(found) == 1}
    calls = collections.defaultdict(set)
    for p in files:
        bodies = "".join(body for *_, body in functions(p))
        called = re.findall(r"(?<![>.\w])([a-z_]\w*)\(", bodies)  # by name, not by a pointer of a struct
        calls[p.stem] |= {defined[n] for n in called if n in defined and defined[n] != p.stem}
    index, low, stack, groups = {}, {}, [], []

    def visit(unit):
        index[unit] = low[unit] = len(index)
        stack.append(unit)
        for other in calls[unit]:
            if other not in index:
                visit(other)
            if other in stack:
                low[unit] = min(low[unit], low[other])
        if low[unit] == index[unit]:
            group = [stack.pop()]
            while group[-1] != unit:
                group.append(stack.pop())
            if len(group) > 1:
                groups.append(sorted(group))

    for p in files:
        if p.stem not in index:
            visit(p.stem)
    return groups


complaints = []


def hold(part, what, figure, limit):
    if figure > limit:
        complaints.append(f"{part}: {what}: {figure}, more than {limit}")


sys.setrecursionlimit(10000)
for part in parts:
    files = [p for p in text if part_of(p) == part]
    lengths = sorted(lines for p in files for _, lines, _, _ in functions(p)) or [0]
    groups = calls_in_circles([p for p in files if p.suffix != ".cpp"])
    print(f"{part}: {len(files)} files, {sum(t.count(chr(10)) for p, t in text.items() if p in files)} lines, "
          f"{len(lengths)} functions, median {lengths[len(lengths) // 2]} lines, longest {lengths[-1]} (at most {MOST_FUNCTION_LINES})")
    print(f"  circles of calls among files: {len(groups)}{': ' if groups else ''}{'; '.join(' '.join(g) for g in groups)}")
    hold(part, "lines of a function", lengths[-1], MOST_FUNCTION_LINES)
    hold(part, "circles of calls among files", len(groups), 0)

if "--hold" in sys.argv and complaints:
    sys.exit("\n".join(complaints))
