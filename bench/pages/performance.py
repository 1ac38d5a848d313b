#!/usr/bin/python3 -B
"""Prints docs/performance.md, drawn from CSV files: performance.py [--partial] CSV ...

Where a measure stands in several files the first one counts: name the newest first. All sections must be there;
--partial leaves out those that no file has.
"""

import sys
from typing import NamedTuple

import page

SECTIONS = {"render": "render", "peers": "peers", "steps": "steps", "volumes": "volumes", "tables sizes": "tables",
            "tables groups": "tables", "tables steps": "tables", "scaling": "scaling"}
WIDTHS = {"avx512": "16, AVX-512", "avx2": "8, AVX2", "sse4.2": "4, SSE4.2", "plain": "4, plain C"}
NONE = "–"


class Measure(NamedTuple):
    count: int
    median: float
    low: float
    high: float


class Mesh:
    """What one program measured on one mesh: kind is "tets" or "hexes", of n^3 cubes."""

    def __init__(self, kind, n, cells):
        self.kind, self.n, self.cells = kind, n, cells
        self.measures = {}

    def __str__(self):
        return f"{self.kind} {self.n}"

    def has(self, name):
        return name in self.measures

    def median(self, name):
        """Return the median of a measure; None where it was not taken."""
        measure = self.measures.get(name)
        return measure and measure.median

    def least(self, *names):
        """Return the least median of the measures that were taken; None where none was."""
        return min((self.measures[name].median for name in names if name in self.measures), default=None)

    def text(self, name):
        return page.write_number(self.median(name)) if name in self.measures else NONE

    def spread(self, name):
        """The median, with the least and the greatest where there are several."""
        measure = self.measures.get(name)
        if measure is None or measure.count < 2:
            return self.text(name)
        return f"{self.text(name)} ({page.write_number(measure.low)} to {page.write_number(measure.high)})"

    def most(self, name, scale=1):
        """The median and the greatest, times scale."""
        measure = self.measures.get(name)
        if measure is None:
            return NONE
        return f"{page.write_number(scale * measure.median)}, at most {page.write_number(scale * measure.high)}"

    def sides(self, name):
        """As most(), for a length of the scene, in sides of a cube."""
        return self.most(name, self.n / 2)

    def disagreements(self, name):
        wrong, ambiguous, checked = (self.median(f"{name} {what}") for what in ("disagreements", "ambiguous", "checked"))
        return NONE if checked is None else f"{wrong:.0f} ({ambiguous:.0f}) of {checked:.0f}"


class Program:
    """All meshes of one program, in the order of their rows."""

    def __init__(self, isa=NONE, threads=0):
        self.isa, self.threads = isa, threads
        self.meshes = []

    def find(self, kind, n):
        """Return the mesh; one without measures where the program did not have it."""
        return next((mesh for mesh in self.meshes if (mesh.kind, mesh.n) == (kind, n)), Mesh(kind, n, 0))

    def add(self, kind, n, cells):
        mesh = self.find(kind, n)
        if not mesh.measures:
            mesh = Mesh(kind, n, cells)
            self.meshes.append(mesh)
        return mesh


class Results:
    """What the files hold: programs by their names, those of scaling with their instruction set and threads."""

    def __init__(self, paths):
        self.programs = {}
        comments = []
        for path in paths:
            rows, more = page.read_csv(path)
            comments += [comment for comment in more if not page.is_load(comment)]
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
        mesh.measures.setdefault(row.text("measure"), Measure(row.count("count"), *map(row.number, ("median", "min", "max"))))

    def __getitem__(self, name):
        return self.programs.get(name, Program())

    def missing(self):
        """Return the sections of bench/run that have no rows."""
        return [section for program, section in SECTIONS.items()
                if not any(name == program or name.startswith(program + " ") for name in self.programs)]


class Claim(NamedTuple):
    """A bar and how we stand to it. The bar is the least of what the ratio may be, or else the most."""
    what: str
    mesh: Mesh
    ours: str
    theirs: str
    ratio: float
    is_least: bool
    bar: str
    note: str = ""

    @property
    def holds(self):
        return self.ratio >= float(self.bar) if self.is_least else self.ratio <= float(self.bar)

    @property
    def asked(self):
        return f"{'≥' if self.is_least else '≤'} {self.bar}{self.note}"


def quantity(x, unit):
    return f"{page.write_number(x)} {unit}".strip()


def claim_times(what, mesh, ours, theirs, is_least, bar, note="", work=0, unit="ms"):
    """Return [claim], or [] where a time is missing. With work the figures are speeds, theirs over ours the ratio."""
    if not ours or not theirs:
        return []
    ratio = theirs / ours if is_least else ours / theirs
    figures = [quantity(work / t if work else t, unit) for t in (ours, theirs)]
    return [Claim(what, mesh, *figures, ratio, is_least, bar, note)]


def claim_trace(mesh):
    embree = embree_trace(mesh)
    rays = 1000 * (mesh.median("rays") or 0)
    claims = []
    for what, measure in (("from all cells", "isosurface trace"), ("from the crossed cells kept", "isosurface trace kept")):
        claims += claim_times(f"isosurface, speed of tracing, {what}: Embree, packets of 16, extracted surface", mesh,
                              mesh.median(measure), embree, True, "1.0", ", aim 2", rays, "Mrays/s")
    return claims


def embree_trace(mesh):
    """Of the faster of Embree's trees."""
    return mesh.least("isosurface embree trace low", "isosurface embree trace medium")


def claim_steps(mesh):
    claims = []
    pictures = (("isosurface", "isosurface"), ("isosurfaces", "three isosurfaces"))
    for picture, name in pictures:
        route = mesh.least(f"{picture} embree route low", f"{picture} embree route medium")
        claims += claim_times(f"{name}, time to picture, new values: Embree: extract, build and trace", mesh,
                              mesh.median(f"{picture} new values"), route, False, "1.0", ", aim 0.5")
    for picture, name in pictures:
        claims += claim_times(f"{name}, time to picture, new mesh: VTK: extract and first render", mesh,
                              mesh.median(f"{picture} new mesh"), mesh.median(f"{picture} vtk route"), False, "1.0")
    return claims


def claim_builds(mesh):
    million = mesh.cells / 1000
    return (claim_times("binned SAH build: rtcBuildBVH MEDIUM, the faster of binary and 8-wide", mesh,
                        mesh.median("build sah"), mesh.least("embree cells medium", "embree cells medium wide"),
                        True, "2.0", "", million, "Mcells/s")
            + claim_times("Morton build: rtcBuildBVH LOW", mesh, mesh.median("build morton"),
                          mesh.median("embree cells low"), True, "1.0", "", million, "Mcells/s")
            + claim_times("SAH cost of the tree: rtcBuildBVH MEDIUM, binary", mesh, mesh.median("build sah cost"),
                          mesh.median("embree cells medium cost"), False, "1.05", unit=""))


def claim_figure(what, mesh, measure, asked, is_least, unit, note="", theirs=NONE):
    """Return [claim] of a measure that has no peer but a figure that was asked for."""
    ours = mesh.median(measure)
    return [Claim(what, mesh, quantity(ours, unit), theirs, ours / asked, is_least, "1.0", note)] if ours else []


def claim_memory(mesh):
    return (claim_figure("the full tree with one field", mesh, "tree size", 16, False, "B/cell", ", aim 0.5 of 16 B/cell")
            + claim_figure("peak of its build", mesh, "build peak", 40, False, "B/cell", " of 40 B/cell"))


def claim_volumes(mesh):
    claims = []
    for peer, name, bar in (("VTK's ray cast", "vtk ray cast", "10"), ("VTK's projected tets", "vtk projected tets", "3")):
        claims += claim_times(f"volume, half-cell steps: {peer}", mesh, mesh.median("volume samples frame"),
                              mesh.median(f"volume {name} frame"), True, bar)
    return claims


def claim_thesis(program):
    claims = []
    for n, speed in ((55, 5.3), (126, 4.5)):
        claims += claim_figure("volume, half-cell steps: the thesis's speed on twenty AVX2 cores (an aim)",
                               program.find("tets", n), "volume", speed, True, "Mrays/s", theirs=f"{speed} Mrays/s")
    return claims


def claim_speedup(what, better, worse, bar):
    """Return [claim] of one program's first mesh over another's of the same mesh, or []."""
    if not better.meshes or not worse.meshes:
        return []
    mesh = better.meshes[0]
    ours, theirs = mesh.median("isosurface"), worse.find(mesh.kind, mesh.n).median("isosurface")
    if not ours or not theirs:
        return []
    return [Claim(f"isosurface: {what}", mesh, quantity(ours, "Mrays/s"), quantity(theirs, "Mrays/s"), ours / theirs, True, bar)]


def claim_scaling(results, threads):
    widest = results[f"scaling avx512 {threads}"]
    middle = results[f"scaling avx2 {threads}"]
    claims = (claim_speedup("16 lanes against 8", widest, middle, "1.6")
              + claim_speedup("8 lanes against 4", middle, results[f"scaling sse4.2 {threads}"], "1.6"))
    if threads == 2:
        claims += claim_speedup("two threads against one", widest, results["scaling avx512 1"], "1.9")
    return claims


def most_threads(results):
    """Return the most threads of scaling's rows; 0 where it has none."""
    return max((program.threads for name, program in results.programs.items() if name.startswith("scaling")), default=0)


def all_claims(results):
    claims = []
    for mesh in results["peers"].meshes:
        claims += claim_trace(mesh) if mesh.kind == "tets" else []
    for mesh in results["steps"].meshes:
        claims += claim_steps(mesh)
    for mesh in results["peers"].meshes:
        claims += claim_builds(mesh)
    render = results["render"]
    claims += claim_figure("refit of ranges", render.find("tets", 126), "refit ranges", 100, True, "Mcells/s",
                           " of 100 Mcells/s")
    for mesh in render.meshes:
        claims += claim_memory(mesh) if mesh.kind == "tets" else []
    for mesh in results["volumes"].meshes:
        claims += claim_volumes(mesh)
    return claims + claim_thesis(render) + claim_scaling(results, most_threads(results))


class Agreement(NamedTuple):
    """How far a peer's picture of a surface is from ours: a share of the pixels, and depths in sides of a cube."""
    peer: str
    mesh: Mesh
    coverage: float
    depth: float
    depth_most: float


def all_agreements(meshes):
    agreements = []
    for mesh in meshes:
        for peer in ("VTK", "Embree"):
            name = f"isosurface {peer.lower()}"
            depth = mesh.measures.get(f"{name} depth difference")
            if depth:
                agreements.append(Agreement(peer, mesh, mesh.median(f"{name} coverage difference") or 0,
                                            depth.median * mesh.n / 2, depth.high * mesh.n / 2))
    return agreements


class Scaling(NamedTuple):
    lanes: str
    threads: int
    mesh: Mesh


def all_scalings(results):
    """With all threads, then with one."""
    scalings = []
    for threads in sorted({most_threads(results), 1}, reverse=True):
        for isa, lanes in WIDTHS.items():
            scalings += [Scaling(lanes, threads, mesh) for mesh in results[f"scaling {isa} {threads}"].meshes[:1]]
    return scalings


def draw(arguments):
    is_partial = arguments[:1] == ["--partial"]
    paths = arguments[is_partial:]
    if not paths:
        raise page.PageError("no CSV file is named: are there any in bench/results?")
    results = Results(paths)
    missing = results.missing()
    if missing and not is_partial:
        raise page.PageError(f"no rows of {', '.join(dict.fromkeys(missing))} in {', '.join(paths)}")
    claims = all_claims(results)
    return page.fill_template(
        "performance.md.j2", results=results, claims=claims, held=sum(claim.holds for claim in claims),
        agreements=all_agreements(results["peers"].meshes), scalings=all_scalings(results), embree_trace=embree_trace)


if __name__ == "__main__":
    page.run(draw, sys.argv[1:])
