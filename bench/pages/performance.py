#!/usr/bin/python3 -B
"""Prints a page drawn from CSV files: performance.py PAGE [--partial] CSV ...

PAGE is "performance" for docs/performance.md, or "measurements" for docs/development/measurements.md. If several
files contain a measure, the newest one counts. All sections must exist; --partial leaves out sections that no
file contains.
"""

import sys
from typing import NamedTuple

import page
from performance_bars import Standing, all_claims, figures, span, span_of_speeds, write_ratio
from performance_results import NONE, Mesh, Results

PAGES = ("performance", "measurements")
WIDTHS = {"avx512": "16, AVX-512", "avx2": "8, AVX2", "sse4.2": "4, SSE4.2", "plain": "4, plain C"}


class Hexes:
    """Times of hexes, for which no bar was set, as ratios to Embree's times and to those of tets of the same
    lattices."""

    def __init__(self, results):
        self.trace = span(mesh.embree_trace() / mesh.median("isosurface trace") for mesh in results["peers"].meshes
                          if mesh.kind == "hexes" and mesh.embree_trace() and mesh.has("isosurface trace"))
        self.isosurface, self.volume = (self._beside_tets(results["render"], name) for name in ("isosurface", "volume"))

    @staticmethod
    def _beside_tets(program, name):
        pairs = [(mesh, program.find("tets", mesh.n)) for mesh in program.meshes if mesh.kind == "hexes"]
        return span(hexes.median(name) / tets.median(name) for hexes, tets in pairs
                    if hexes.has(name) and tets.has(name))


class Disagreement(NamedTuple):
    """wrong: number of pixels in which hit or miss differs from the reference. ambiguous: number of these pixels
    whose rays meet several roots in a cell. checked: number of all compared pixels."""
    wrong: int
    ambiguous: int
    checked: int


def count_disagreements(programs):
    meshes = [mesh for program in programs for mesh in program.meshes]
    return Disagreement(*(int(sum(mesh.median(f"isosurface {what}") or 0 for mesh in meshes))
                          for what in ("disagreements", "ambiguous", "checked")))


class Agreement(NamedTuple):
    """The difference of a peer's picture of a surface from ours: a share of the pixels, and depths in sides of a
    cube."""
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


def beside(mesh, ours, theirs, most=None):
    """Return the ratio of two measures, bold if it is above `most`, and both measures."""
    ours, theirs = mesh.median(ours), mesh.median(theirs)
    if not ours or not theirs:
        return NONE
    ratio = write_ratio(ours / theirs)
    return f"{f'**{ratio}**' if most and ours / theirs > most else ratio} ({figures(ours, theirs)})"


class FlowRow(NamedTuple):
    """A picture of the section "flow", and how VTK makes it."""
    picture: str
    name: str
    peer: str

    def text(self, mesh):
        """Return the ratio of our time to VTK's time, and both times."""
        return beside(mesh, f"{self.name} new values", f"{self.name} vtk")


FLOW = (
    FlowRow("Slice", "slice", "vtk3DLinearGridPlaneCutter"),
    FlowRow("Slice with 10 contour lines", "lined slice", "the same, vtkContourFilter"),
    FlowRow("16 slices", "planes", "vtk3DLinearGridPlaneCutter for each"),
    FlowRow("Outer surface", "surface", "vtkGeometryFilter"),
    FlowRow("Outer surface with 10 contour lines", "lined surface", "the same, vtkContourFilter"),
    FlowRow("Outer surface of the warped mesh, new displacements", "warped surface", "vtkWarpVector, vtkGeometryFilter"),
    FlowRow("Outer surface of the mesh and its mirror image", "mirrored surface",
            "vtkReflectionFilter, vtkGeometryFilter"),
    FlowRow("Q criterion at all vertices, without a picture", "q criterion", "vtkGradientFilter"),
    FlowRow("Isosurface of the Q criterion, new velocities", "vortices", "vtkGradientFilter, vtkContour3DLinearGrid"),
    FlowRow("Montage: a slice, two outer surfaces, an isosurface", "montage", "a window with a renderer for each"))


class Scaling(NamedTuple):
    lanes: str
    threads: int
    mesh: Mesh


def all_scalings(results):
    """Return the scalings with all threads, followed by those with one thread."""
    scalings = []
    for threads in sorted({results.most_threads(), 1}, reverse=True):
        for isa, lanes in WIDTHS.items():
            scalings += [Scaling(lanes, threads, mesh) for mesh in results[f"scaling {isa} {threads}"].meshes[:1]]
    return scalings


def draw(arguments):
    name, arguments = arguments[0] if arguments else None, arguments[1:]
    if name not in PAGES:
        raise page.PageError(f"the first argument names the page: {' or '.join(PAGES)}")
    is_partial = arguments[:1] == ["--partial"]
    paths = arguments[is_partial:]
    if not paths:
        raise page.PageError("no CSV file is named: are there any in bench/results?")
    results = Results(paths)
    missing = results.missing()
    if missing and not is_partial:
        raise page.PageError(f"no rows of {', '.join(dict.fromkeys(missing))} in {', '.join(paths)}")
    return page.fill_template(
        f"{name}.md.j2", results=results, bars=Standing(all_claims(results)), hexes=Hexes(results),
        scalings=all_scalings(results), agreements=all_agreements(results["peers"].meshes),
        beside=beside, flow=FLOW, disagreement=count_disagreements([results["render"], results["tables sizes"]]), span_of_speeds=span_of_speeds)


if __name__ == "__main__":
    page.run(draw, sys.argv[1:])
