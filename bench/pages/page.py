"""Shared code of the benchmarks' pages: reads the rows of CSV files, formats numbers, and fills templates."""

import csv
import math
import pathlib
import re
import sys

try:
    import jinja2
except ImportError:
    sys.exit("the pages of the benchmarks need jinja2: Debian's package python3-jinja2")


class PageError(Exception):
    """A page cannot be drawn; the message names the file, the line and the column that contain the error."""


class Row:
    """A line of a CSV file. Its columns are accessed by name."""

    def __init__(self, place, names, values):
        if len(names) != len(values):
            raise PageError(f"{place}: {len(values)} values under {len(names)} columns")
        self.place = place
        self.columns = dict(zip(names, values))

    def text(self, column):
        if column not in self.columns:
            raise PageError(f"{self.place}: there is no column \"{column}\"")
        return self.columns[column]

    def number(self, column):
        text = self.text(column)
        try:
            return float(text)
        except ValueError:
            raise PageError(f"{self.place}: \"{text}\" in column \"{column}\" is not a number") from None

    def count(self, column):
        return int(self.number(column))


def read_csv(path):
    """Return the rows of a benchmark's CSV file, and its comments. A line that begins with "program" names columns."""
    rows, comments, names = [], [], None
    for number, line in enumerate(_lines(path), 1):
        place = f"{path}, line {number}"
        if line.startswith("#"):
            comments.append(line[1:].strip())
        elif line.startswith("program,"):
            names = next(csv.reader([line]))
        elif line.startswith("bench_"):
            if names is None:
                raise PageError(f"{place}: no line of column names stands before it")
            rows.append(Row(place, names, next(csv.reader([line]))))
    return rows, comments


def _lines(path):
    try:
        return pathlib.Path(path).read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise PageError(f"{path}: {error.strerror}") from None


def is_of_section(comment):
    """Return whether a comment describes the date, load or duration of one section, and not the machine."""
    return comment.startswith(("measured ", "load average")) or re.fullmatch(r"\d+ s", comment) is not None


def read_newest_first(paths):
    """Return (path, rows, comments) of the files, newest first. Files without a date are last, in the order of
    `paths`."""
    return sorted(((path, *read_csv(path)) for path in paths), key=lambda file: _date(file[2]), reverse=True)


def _date(comments):
    return max((comment for comment in comments if comment.startswith("measured ")), default="")


def write_number(x):
    """Return x with three digits and at most three decimals, or a dash if it is not a number."""
    if math.isnan(x):
        return "-"
    if x == 0:
        return "0"
    if x < 0.001:
        return f"{x:.1e}"
    decimals = 3 if x < 1 else 2 if x < 10 else 1 if x < 100 else 0
    return f"{x:.{decimals}f}"


def fill_template(name, **values):
    """Return the page that a template of this folder makes from the values."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(pathlib.Path(__file__).parent), undefined=jinja2.StrictUndefined,
        trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True)
    environment.filters["number"] = write_number
    return environment.get_template(name).render(values)


def run(program, arguments):
    """Print the page that program(arguments) returns, or exit with one line that states why there is no page."""
    try:
        sys.stdout.reconfigure(encoding="utf-8")
        sys.stdout.write(program(arguments))
    except PageError as error:
        sys.exit(f"{pathlib.Path(sys.argv[0]).name}: {error}")
