#!/usr/bin/env python3
"""check_claims.py ROOT BUILD: what docs/development/claims.md lists stands where it is said to stand.

Each sentence is in its document, word for word, but for line breaks and the marks of comments. Each test is registered in BUILD by
this name, or by this name and a number of ranks (session_np3). Each case stands in the source of that test's program: as a case of
cmocka, a function of Python or a subroutine of Fortran.
"""
import pathlib
import re
import sys

root, build = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
table = root / "docs/development/claims.md"
faults = []


def read_words(path):
    """The text with single blanks, without the stars that begin lines of C comments."""
    text = path.read_text()
    if path.suffix == ".h":
        text = re.sub(r"\n *\* ", "\n", text)
    return " ".join(text.split())


def read_tests():
    """The commands of the registered tests, by their names without the number of ranks."""
    tests, folders = {}, [build]
    for folder in folders:
        text = (folder / "CTestTestfile.cmake").read_text()
        folders += [folder / name for name in re.findall(r'^subdirs\("(.*?)"\)', text, re.M)]
        for name, command in re.findall(r"add_test\(\[=\[(.*?)\]=\] (.*?)\)\n", text, re.S):
            tests.setdefault(re.sub(r"_np\d+$", "", name), []).append(command)
    return tests


def find_sources(commands):
    programs = set(re.findall(r"\btest_\w+", " ".join(commands)))
    return [p for p in (root / "tests").iterdir() if p.stem in programs and p.suffix in (".c", ".cpp", ".py", ".f90")]


def has_case(source, case):
    begin = {".py": r"def ", ".f90": r"subroutine "}.get(source.suffix, r"cmocka_unit_test\w*\(")
    return re.search(begin + re.escape(case) + r"\b", source.read_text())


documents, tests, count = {}, read_tests(), 0
for number, line in enumerate(table.read_text().split("\n"), 1):
    cells = [c.strip().replace("\\|", "|") for c in re.split(r"(?<!\\)\|", line)]
    if len(cells) != 6 or cells[1] in ("document", "---"):
        continue
    _, document, sentence, test, case, _ = cells
    where = f"docs/development/claims.md:{number}"
    count += 1
    if not (root / document).is_file():
        faults.append(f"{where}: there is no {document}")
        continue
    if document not in documents:
        documents[document] = read_words(root / document)
    if " ".join(sentence.split()) not in documents[document]:
        faults.append(f"{where}: {document} does not say: {sentence}")
    if test not in tests:
        faults.append(f"{where}: no test is registered as {test}")
    elif case and not any(has_case(source, case) for source in find_sources(tests[test])):
        faults.append(f"{where}: the test {test} has no case {case}")
if count == 0:
    faults.append("docs/development/claims.md: it has no table")
print("\n".join(faults) or f"{count} sentences have their tests")
sys.exit(1 if faults else 0)
