#!/usr/bin/env python3
"""Has another compiler read the sources of a build, without making objects: every warning is an error.

compilers_read.py clang BUILD    what users build: all but tests and benchmarks; compilers_clang_whole builds these too
compilers_read.py aarch64 BUILD  the library's C, by the cross compiler for aarch64, without what is compiled for x86 alone

The flags are those of BUILD/compile_commands.json. A source in which no fault was found is read again when it, a header of
the tree that it includes, its flags or the compiler have changed; BUILD/<compiler>_read.json lists what was read. Ends with
77 if the compiler is not installed.
"""

import functools
import hashlib
import json
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

CROSS = "aarch64-linux-gnu-gcc"
LIBRARY = ("libinsitu", "mmbvh", "render", "compositing")
# Other compilers' names for warnings are not asked about; clang's C++ is older than gcc's unless it is told.
CLANG = ["-Wno-unknown-warning-option", "-Werror", "-fsyntax-only"]


def clang_command(source, flags):
    if source.suffix != ".cpp":
        return ["clang", *flags, *CLANG, str(source)]
    standard = [] if any(f.startswith("-std=") for f in flags) else ["-std=gnu++17"]
    return ["clang++", *flags, *standard, *CLANG, str(source)]


def system_headers(source):
    """Without the library's: of these a change is noticed only if a source includes them itself."""
    return re.findall(r"^#include (<(?!insitu/)[^>]+>)", source.read_text(), re.MULTILINE)


def share_headers(pool, place, jobs):
    """Gives the C++ jobs of the same flags one precompiled header: VTK's headers take three quarters of clang's time."""
    groups = {}
    for folder, command in jobs:
        if command[0] == "clang++":
            groups.setdefault((folder, *command[:-1]), []).append(command)
    makers = []
    for (folder, *maker), commands in groups.items():
        counts = Counter(h for command in commands for h in system_headers(pathlib.Path(command[-1])))
        common = sorted(h for h, count in counts.items() if count >= 3)
        if common:
            header = place / f"common{len(makers)}.hpp"
            header.write_text("".join(f"#include {h}\n" for h in common))
            maker.remove("-fsyntax-only")
            makers.append((folder, [*maker, "-x", "c++-header", str(header), "-o", f"{header}.pch"]))
            for command in commands:
                command[-1:] = ["-include-pch", f"{header}.pch", command[-1]]
    return list(pool.map(read, makers))


def cross_command(source, flags):
    """None if the object is compiled for x86 alone. The host's headers come last: the cross compiler has its own C library."""
    if any(f.startswith("-m") for f in flags):
        return None
    kept = [f for f in flags if not f.endswith("_HAS_X86")]
    return [CROSS, *kept, "-Werror", "-fsyntax-only", "-idirafter", "/usr/include", str(source)]


def entries(build, is_wanted):
    """(folder, source, flags) of each object; of objects that differ only in folders and exported names, one."""
    seen = {}
    for entry in json.loads((build / "compile_commands.json").read_text()):
        source = pathlib.Path(entry["file"])
        if source.suffix not in (".c", ".cpp") or not is_wanted(source):
            continue
        words = shlex.split(entry["command"])
        at = words.index("-o")
        passed_over = ("-c", entry["file"], "-fpeel-loops")  # gcc's own option
        flags = [w for w in words[1:at] + words[at + 2 :] if w not in passed_over and not w.endswith("_EXPORTS")]
        seen.setdefault((source, *(f for f in flags if f.startswith(("-D", "-m")))), (entry["directory"], source, flags))
    return seen.values()


def read(job, *more):
    folder, command = job
    answer = subprocess.run([*command, *more], cwd=folder, capture_output=True, text=True, check=False)
    return answer.returncode == 0 and not answer.stderr, answer.stdout + answer.stderr


@functools.cache
def digest(path):
    try:
        return hashlib.sha256(pathlib.Path(path).read_bytes()).hexdigest()
    except OSError:
        return None


def read_with_headers(folder, command, rule):
    """Reads a source. Returns whether it has no fault, what the compiler said, and the digests of the source and of its
    headers, but for the system's."""
    is_right, said = read((folder, command), "-MMD", "-MF", str(rule), "-MT", "all")
    if not is_right:
        return False, said, {}
    files = shlex.split(rule.read_text().replace("\\\n", " "))[1:]
    paths = (os.path.normpath(os.path.join(folder, file)) for file in files)
    return True, said, {path: digest(path) for path in paths if not path.startswith(f"{rule.parent}/")}


def main():
    who, build = sys.argv[1], pathlib.Path(sys.argv[2])
    command = {"clang": clang_command, "aarch64": cross_command}[who]
    if not all(map(shutil.which, {"clang": ("clang", "clang++"), "aarch64": (CROSS,)}[who])):
        print(f"skipped: there is no compiler {who}")
        return 77
    root = pathlib.Path(__file__).resolve().parent.parent

    def is_wanted(source):
        if who == "clang":
            return not any(root / room in source.parents for room in ("tests", "bench"))
        return source.suffix == ".c" and any(root / room in source.parents for room in LIBRARY)

    jobs = [(folder, command(source, flags)) for folder, source, flags in entries(build, is_wanted)]
    jobs = [job for job in jobs if job[1]]
    compiler = subprocess.run([jobs[0][1][0], "--version"], capture_output=True, text=True, check=True).stdout if jobs else ""
    memory = build / f"{who}_read.json"
    known = json.loads(memory.read_text()) if memory.exists() else {}
    names = [shlex.join([compiler, folder, *command]) for folder, command in jobs]
    known = {name: files for name in names if (files := known.get(name))}
    new = [i for i, name in enumerate(names) if not known.get(name) or any(digest(f) != d for f, d in known[name].items())]
    with ThreadPoolExecutor(os.cpu_count()) as pool, tempfile.TemporaryDirectory() as place:
        place = pathlib.Path(place)
        answers = share_headers(pool, place, [jobs[i] for i in new])
        read_now = list(pool.map(lambda i: read_with_headers(*jobs[i], place / f"{i}.d"), new))
    for i, (_, _, files) in zip(new, read_now):
        known[names[i]] = files
    memory.write_text(json.dumps(known, indent=0))
    faults = [text for is_right, text, *_ in (*answers, *read_now) if not is_right]
    print("".join(faults), end="")
    print(f"{who} has read {len(new)} of {len(jobs)} sources, the others before, and found fault with {len(faults)}")
    return 1 if faults or not jobs else 0


if __name__ == "__main__":
    sys.exit(main())
