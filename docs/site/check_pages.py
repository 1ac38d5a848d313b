#!/usr/bin/env python3
"""check_pages.py [ROOT]: links, blocks of code and commands of README.md and all other pages are good. Needs no network.

Links lead to files of the tree, and to headings by names that the site and forges give them alike. A block of C, Fortran, Python
or shell is part of a file in examples/, which tests build and run. Scenes, whole or in part, are read by the library where its
Python module is to be had. Commands name programs, options, presets and targets that there are.
"""
import os
import pathlib
import re
import subprocess
import sys
import textwrap

import markdown_pages

ROOT = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parent.parent.parent)
EXAMPLES = {"c": (".c", ".cpp"), "fortran": (".f90",), "python": (".py",), "sh": (".sh",)}
# Blocks of these pages are run in other tests: the tutorial's, and the commands that compile a program.
RUN_ELSEWHERE = {("docs/tutorial.md", "sh"), ("docs/fortran.md", "sh")}
PROGRAMS = {"insitu-render": "tools", "insitu-view": "tools/view", "insitu-wave": "mini-app"}
faults = []


def fault(page, text, place, message):
    faults.append(f"{page}:{markdown_pages.line_of(text, place)}: {message}")


def check_links(page, text):
    for link, place in markdown_pages.links(text):
        path, anchor = markdown_pages.target_of(page, link)
        if not (ROOT / path).exists():
            fault(page, text, place, f"{link}: there is no {path}")
        elif anchor and anchor not in markdown_pages.anchors((ROOT / path).read_text()):
            fault(page, text, place, f"{link}: {path} has no heading of that name, or one that sites and forges name differently")


def check_lists(page, text):
    """The site's Markdown wants an empty line before a list."""
    plain = markdown_pages.blank_code(text)
    for m in re.finditer(r"^(?![ \-*|#\d]|$).*\n(?=(?:- |1\. )\S)", plain, re.M):
        fault(page, text, m.end(), "a list without an empty line before it")


def without_indent(text):
    return textwrap.dedent(text).strip("\n")


def examples(endings):
    return [p.read_text() for p in sorted((ROOT / "examples").rglob("*")) if p.suffix in endings]


def is_part(block, text):
    """Are the lines of the block among those of the text, all farther to the right by as much?"""
    lines, others = without_indent(block).split("\n"), text.split("\n")
    for first in range(len(others) - len(lines) + 1):
        if without_indent("\n".join(others[first:first + len(lines)])) == "\n".join(lines):
            return True
    return False


def check_excerpts(page, text):
    for m in markdown_pages.FENCE.finditer(text):
        language, block = m[1], m[2]
        if language not in EXAMPLES or (page, language) in RUN_ELSEWHERE:
            continue
        if not any(is_part(block, example) for example in examples(EXAMPLES[language])):
            fault(page, text, m.start(), f"a block of {language} that is no part of a file in examples/")


def scene_of(block):
    """The block as a whole scene: what it lacks is put around it."""
    image = "images:\n  - name: any\n    outputs: [{path: any.png}]\n"
    layers = "    layers: [{surface: {}}]\n"
    key = re.match(r"\s*([\w-]+)", block)[1]
    if key == "images":
        return block
    if key in ("fields", "meshes", "statistics", "parameters"):
        return block if re.search(r"^images:", block, re.M) else image + layers + block
    return image + ("" if key == "layers" else layers) + textwrap.indent(block, "    ")


def check_scenes(page, text, insitu, comm):
    for m in markdown_pages.FENCE.finditer(text):
        if m[1] != "yaml":
            continue
        try:
            insitu.Session(comm, scene_text=scene_of(m[2])).close()
        except insitu.Error as error:
            fault(page, text, m.start(), f"a scene that is refused: {error}")


def commands(text):
    """(line, place) of commands: indented blocks and blocks of shell."""
    plain = markdown_pages.FENCE.sub(lambda m: m[0] if m[1] == "sh" else re.sub(r"[^\n]", " ", m[0]), text)
    for m in re.finditer(r"^(?: {4})?(\./[\w-]+|cmake|bench/run|tests/[\w.]+|(?:mpirun -n \d+ )?insitu-\w+)\b.*$", plain, re.M):
        yield m[0].strip(), m.start()


def source_of(program):
    if program in PROGRAMS:
        return "\n".join(p.read_text() for p in sorted((ROOT / PROGRAMS[program]).glob("*.*")))
    at = ROOT / program
    if not at.is_file():
        return None
    # ./demo hands on what it does not know itself.
    return at.read_text() + (source_of("insitu-wave") if program in ("./demo",) else "")


def check_commands(page, text):
    presets = (ROOT / "CMakePresets.json").read_text()
    folders = [p for p in ROOT.iterdir() if p.is_dir() and p.name != "build"]  # of which a test may make a whole Debian
    targets = "\n".join(p.read_text() for folder in folders for p in sorted(folder.rglob("*.cmake")))
    for line, place in commands(text):
        line = re.sub(r"\s#.*", "", line)
        words = line.split()
        for preset in re.findall(r"--preset (\S+)", line):
            if f'"name": "{preset}"' not in presets:
                fault(page, text, place, f"there is no preset {preset}")
        for target in re.findall(r"--target (\S+)", line):
            if not re.search(rf"add_custom_target\({target}\b", targets):
                fault(page, text, place, f"there is no target {target}")
        program = words[3] if words[0] == "mpirun" else words[0]
        if program == "cmake":
            continue
        source = source_of(program)
        if source is None:
            fault(page, text, place, f"there is no {program}")
            continue
        for option in re.findall(r"(?<= )--([a-z][\w-]*)", line):
            if not re.search(rf"\b{option}\b", source):
                fault(page, text, place, f"{program} has no option --{option}")


def scene_reader():
    """The library's Python module and a communicator, or why they are not to be had."""
    try:
        import insitu
        from mpi4py import MPI
    except (ImportError, OSError) as error:
        return None, str(error)
    return (insitu, MPI.COMM_SELF), None


def check_scripts():
    for script in sorted((ROOT / "examples").rglob("*.sh")):
        run = subprocess.run(["sh", "-n", str(script)], capture_output=True, text=True)
        if run.returncode:
            faults.append(run.stderr.strip())


def main():
    reader, why = scene_reader() if os.environ.get("INSITU_CHECK_SCENES") else (None, "INSITU_CHECK_SCENES is not set")
    for page in markdown_pages.pages(ROOT):
        text = (ROOT / page).read_text()
        check_links(page, text)
        check_lists(page, text)
        check_excerpts(page, text)
        check_commands(page, text)
        if reader:
            check_scenes(page, text, *reader)
    check_scripts()
    if not reader:
        print(f"scenes are not read: {why}")
    print("\n".join(faults) or "all is well")
    sys.exit(1 if faults else 0)


main()
