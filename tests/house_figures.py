#!/usr/bin/env python3
"""house_figures.py [--hold] [ROOT]: the shape of the source, counted: folders, lines, depth of includes, circles, long parameter lists.

A figure stands beside CONTRIBUTING.md's limit where it has one. With --hold it fails where one is above its limit.
"""
import collections
import functools
import pathlib
import re
import sys

MOST_PARAMETERS, MOST_FILES, MOST_DEPTH, MOST_FUNCTION_LINES = 7, 20, 8, 60
LONG_LISTS = {"compositing": 1}  # functions of more parameters that are suffered
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
by_name = {p.name: p for p in text}
includes = {p: [by_name[n.split("/")[-1]] for n in re.findall(r'^#include ["<]([^">]+)[">]', t, re.M)
                if n.split("/")[-1] in by_name and by_name[n.split("/")[-1]] != p] for p, t in text.items()}


@functools.lru_cache(None)
def depth(p):
    """Files on the longest chain of includes from p on within p's own part of the tree."""
    return 1 + max((depth(q) for q in includes[p] if part_of(q) == part_of(p)), default=0)


def part_of(p):
    return p.relative_to(root).parts[0]


def longest_chain(p):
    chain = [p.name]
    while inner := [q for q in includes[p] if part_of(q) == part_of(p)]:
        p = max(inner, key=depth)
        chain.append(p.name)
    return " > ".join(chain)


def functions(p):
    """(name, number of parameters, lines, whether the file alone sees it, body) of each function that is defined in the file."""
    for m in re.finditer(r"^[A-Za-z_](?:[^;{}()=#]|__attribute__\(\([\w, ]+\)\))*?\b(?!__attribute__)([A-Za-z_]\w*)\(([^;{}]*?)\)\s*\n\{(.*?)^\}", code[p], re.M | re.S):
        inner, flat = 0, ""
        for letter in m[2]:
            inner += (letter == "(") - (letter == ")")
            flat += "" if inner and letter == "," else letter
        count = 0 if flat.strip() in ("", "void") else flat.count(",") + 1
        yield m[1], count, m[0].count("\n") + 1, p.suffix == ".c" and m[0].startswith("static"), m[3]


def calls_in_circles(files):
    """Groups of files that call each other in a circle (Tarjan's strongly connected components); a .c and its .h are one."""
    places = collections.defaultdict(set)
    for p in files:
        for name, _, _, own, _ in functions(p):
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
    all_functions = [(n, c, lines, p) for p in files for n, c, lines, _, _ in functions(p)]
    lengths = sorted(lines for _, _, lines, _ in all_functions) or [0]
    long_lists = [(n, c) for n, c, _, _ in all_functions if c > MOST_PARAMETERS]
    folders = collections.Counter(str(p.parent.relative_to(root)) for p in files)
    deepest = max(files, key=depth)
    groups = calls_in_circles([p for p in files if p.suffix != ".cpp"])
    print(f"{part}: {len(files)} files, {sum(t.count(chr(10)) for p, t in text.items() if p in files)} lines, "
          f"{len(all_functions)} functions, median {lengths[len(lengths) // 2]} lines, longest {lengths[-1]} (at most {MOST_FUNCTION_LINES})")
    print(f"  files in a folder: {', '.join(f'{k} {v}' for k, v in folders.most_common(6))} (at most {MOST_FILES})")
    print(f"  depth of includes: {depth(deepest)} (at most {MOST_DEPTH}): {longest_chain(deepest)}")
    print(f"  functions of more than {MOST_PARAMETERS} parameters: {len(long_lists)}: {', '.join(f'{n} {c}' for n, c in long_lists)}")
    print(f"  circles of calls among files: {len(groups)}{': ' if groups else ''}{'; '.join(' '.join(g) for g in groups)}")
    hold(part, "lines of a function", lengths[-1], MOST_FUNCTION_LINES)
    hold(part, "files in a folder", folders.most_common(1)[0][1], MOST_FILES)
    hold(part, "depth of includes", depth(deepest), MOST_DEPTH)
    hold(part, f"functions of more than {MOST_PARAMETERS} parameters", len(long_lists), LONG_LISTS.get(part, 0))
    hold(part, "circles of calls among files", len(groups), 0)

if "--hold" in sys.argv and complaints:
    sys.exit("\n".join(complaints))
