"""The results of all programs of bench/run except bench_accuracy: programs, their meshes, and the measures of each."""

from typing import NamedTuple

import page

SECTIONS = {"render": "render", "peers": "peers", "light": "light", "steps": "steps", "volumes": "volumes",
            "layers": "layers", "layers flow": "flow", "cells types": "cells", "cells layouts": "cells", "cells thousand": "cells",
            "blocks": "blocks", "order": "order",
            "tables sizes": "tables",
            "tables groups": "tables", "tables steps": "tables", "scaling": "scaling"}
NONE = "–"


class Measure(NamedTuple):
    count: int
    median: float
    low: float
    high: float


class Mesh:
    """The measures of one program on one mesh. kind: "tets" or "hexes"; n: the mesh has n^3 cubes."""

    def __init__(self, kind, n, cells):
        self.kind, self.n, self.cells = kind, n, cells
        self.measures = {}

    def __str__(self):
        return f"{self.kind} {self.n}"

    def has(self, name):
        return name in self.measures

    def median(self, name):
        """Return the median of a measure, or None if it was not measured."""
        measure = self.measures.get(name)
        return measure and measure.median

    def least(self, *names):
        """Return the smallest median of the measures that were taken, or None if none was taken."""
        return min((self.measures[name].median for name in names if name in self.measures), default=None)

    def embree_trace(self):
        """Return the smaller median of the trace times with Embree's two trees, or None if there is none."""
        return self.least("isosurface embree trace low", "isosurface embree trace medium")

    def text(self, name):
        return page.write_number(self.median(name)) if name in self.measures else NONE

    def spread(self, name):
        """Return the median as text, with the smallest and the largest value if there are several."""
        measure = self.measures.get(name)
        if measure is None or measure.count < 2:
            return self.text(name)
        return f"{self.text(name)} ({page.write_number(measure.low)}–{page.write_number(measure.high)})"

    def error(self, name, scale=1):
        """Return the median and the largest value as text, multiplied by scale."""
        measure = self.measures.get(name)
        if measure is None:
            return NONE
        return f"{page.write_number(scale * measure.median)} ({page.write_number(scale * measure.high)})"

    def depth_error(self, *names):
        """Return error() of the depth errors, in units of a cube's side; equal texts appear only one time."""
        return "; ".join(dict.fromkeys(self.error(f"{name} depth error", self.n / 2) for name in names))


class Program:
    """All meshes of one program, in the order of their rows."""

    def __init__(self, isa=NONE, threads=0):
        self.isa, self.threads = isa, threads
        self.meshes = []

    def find(self, kind, n):
        """Return the mesh, or a mesh without measures if the program did not measure it."""
        return next((mesh for mesh in self.meshes if (mesh.kind, mesh.n) == (kind, n)), Mesh(kind, n, 0))

    def add(self, kind, n, cells):
        mesh = self.find(kind, n)
        if not mesh.measures:
            mesh = Mesh(kind, n, cells)
            self.meshes.append(mesh)
        return mesh


class Results:
    """The programs in the files, by name. Names in the scaling section include the instruction set and the threads."""

    def __init__(self, paths):
        self.programs = {}
        comments = []
        for _, rows, more in page.read_newest_first(paths):
            comments += [comment for comment in more if not page.is_of_section(comment)]
            for row in rows:
                self._take(row)
        self.machine = "; ".join(dict.fromkeys(comments))

    def _take(self, row):
        name = row.text("program").removeprefix("bench_")
        isa, threads = row.text("isa"), row.count("threads")
        if name == "tables scaling":
            name = f"scaling {isa} {threads}"
        program = self.programs.setdefault(name, Program(isa, threads))
        mesh = program.add(row.text("mesh"), row.count("n"), row.count("cells"))
        measure = Measure(row.count("count"), *map(row.number, ("median", "min", "max")))
        mesh.measures.setdefault(row.text("measure"), measure)

    def __getitem__(self, name):
        return self.programs.get(name, Program())

    def most_threads(self):
        """Return the largest number of threads in the rows of scaling, or 0 if there are none."""
        return max((program.threads for name, program in self.programs.items() if name.startswith("scaling")),
                   default=0)

    def missing(self):
        """Return the sections of bench/run that have no rows."""
        return [section for program, section in SECTIONS.items()
                if not any(name == program or name.startswith(program + " ") for name in self.programs)]
