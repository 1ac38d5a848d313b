#!/usr/bin/env python3
"""run_tutorial.py PREFIX FOLDER: does what docs/tutorial.md says, in an empty folder, by the libinsitu installed in PREFIX.

A block after "Save it as `NAME`" is written to that file; a block of shell is run, in the order of the page. After each run of a
program the pictures are those that the page shows in its text. A language whose compiler is not here is left out.
"""
import os
import pathlib
import re
import shutil
import subprocess
import sys

import markdown_pages

prefix, folder = sys.argv[1], pathlib.Path(sys.argv[2])
root = pathlib.Path(__file__).resolve().parent.parent.parent
text = (root / "docs/tutorial.md").read_text()
lines = ["set -eu", f"export prefix={prefix}"]  # the page's shell, so far
needs = {"mpifort": "mpifort", "heat.py": "/usr/bin/python3"}


def can_run(block):
    for word, program in needs.items():
        if word in block and not shutil.which(program):
            return False
    return "heat.py" not in block or subprocess.run([needs["heat.py"], "-c", "import numpy, mpi4py"]).returncode == 0


def run(block, number):
    for picture in folder.glob("*.png"):
        picture.unlink()
    script = "\n".join(lines + [block])
    done = subprocess.run(["sh", "-c", script], cwd=folder, capture_output=True, text=True)
    if done.returncode or done.stdout or done.stderr:
        sys.exit(f"docs/tutorial.md: status {done.returncode} of:\n{block}\n{done.stdout}{done.stderr}")
    return {p.name: p.read_bytes() for p in folder.glob("*.png")}


shutil.rmtree(folder, ignore_errors=True)
folder.mkdir(parents=True)
of_languages, last = [], {}
for number, m in enumerate(markdown_pages.FENCE.finditer(text)):
    saved = re.findall(r"[Ss]ave (?:it )?as\s+`([\w.]+)`", text[:m.start()].rsplit("```", 1)[-1])
    if saved:
        (folder / saved[-1]).write_text(m[2])
    elif m[1] == "sh" and "export" in m[2]:
        lines.append(m[2])
    elif m[1] == "sh" and can_run(m[2]):
        last = run(m[2], number)
        of_languages.append(last)
    elif m[1] == "sh":
        print(f"left out: {m[2].split()[0]}")

*programs, inside = of_languages
for pictures in programs:
    if sorted(pictures) != ["heat_00.png", "heat_03.png", "heat_06.png", "heat_09.png"]:
        sys.exit(f"docs/tutorial.md: other pictures than it says: {sorted(pictures)}")
    if pictures != programs[0]:
        sys.exit("docs/tutorial.md: the languages draw different pictures")
if "inside_03.png" not in inside:
    sys.exit(f"docs/tutorial.md: other pictures than it says: {sorted(inside)}")
print(f"{len(programs)} languages, all is well")
