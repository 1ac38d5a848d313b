#!/usr/bin/env python3
"""header_page.py HEADER ...: the page of the interface, in Markdown, made of the comments in the C headers.

Each public declaration gets a heading: the comment before it, then the declaration as it stands in the header, whose own
comments say the rest. Declarations that follow one another without an empty line share a comment.
"""
import pathlib
import re
import sys

COMMENT = r"/\*.*?\*/"
DECLARATION = r"typedef (?:struct|enum) \w+ \{.*?^\} \w+;|typedef struct \w+ \w+;|^enum \{.*?^\};|^INSITU_API .*?;"


def prose(comment):
    """The comment's text; what is indented in it is code."""
    lines = [re.sub(r"^ ?\* ?", "", line) for line in comment[2:-2].split("\n")]
    text = "\n".join(line.rstrip() for line in lines).strip()
    blocks = re.split(r"\n\n", text)
    return "\n\n".join(block if block.startswith("    ") else marked(block) for block in blocks)


def marked(text):
    """Names of the interface as code."""
    text = re.sub(r"(?<![\w`])((?:mesh->|\*)?(?:insitu|INSITU|MPI)_\w+\*?(?:\(\))?|NULL)", r"`\1`", text)
    return text.replace("<", "&lt;")


def name_of(declaration):
    if declaration.startswith("enum"):
        return re.search(r"\b([A-Z]+_[A-Z]+)_\w+", declaration)[1] + "_*"
    if declaration.startswith("typedef"):
        return re.search(r"(\w+);\Z", declaration)[1]
    return re.search(r"(\w+)\(", declaration)[1] + "()"


def entries(text):
    """(comment, [declarations]) in the header's order; the first has no declaration: the header's own comment."""
    found, end = [], 0
    for m in re.finditer(rf"^(?P<comment>{COMMENT})|(?P<declaration>{DECLARATION})", text, re.M | re.S):
        if m["comment"]:
            found.append((m["comment"], []))
        elif not found or text[end:m.start()].strip(" ") != "\n":
            raise SystemExit(f"header_page.py: {name_of(m['declaration'])} has no comment right before it")
        else:
            found[-1][1].append(m["declaration"])
        end = m.end()
    return found


def page(headers):
    """headers: the texts. The first header's opening comment opens the page."""
    out = ["# The interface in C", prose(entries(headers[0])[0][0])]
    for number, text in enumerate(headers):
        for comment, declarations in entries(text)[0 if number else 1:]:
            if not declarations:
                continue
            out += ["## " + ", ".join(name_of(d) for d in declarations), prose(comment)]
            code = "\n".join(declarations).replace("INSITU_API ", "")
            out.append(f"```c\n{code}\n```")
    return "\n\n".join(out) + "\n"


if __name__ == "__main__":
    sys.stdout.write(page([pathlib.Path(name).read_text() for name in sys.argv[1:]]))
