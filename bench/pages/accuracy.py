#!/usr/bin/python3 -B
"""Prints docs/accuracy.md, drawn from a CSV file of bench_accuracy: accuracy.py CSV"""

import sys
from typing import NamedTuple, Optional

import accuracy_results
import page

TARGETS = ["1e-1", "1e-2", "1e-3", "1e-4", "1e-5"]
ASKED = 10  # times as fast as each of VTK's mappers


def times(x):
    return f"{x:.1f}" if x < 10 else f"{x:.0f}"


def bold_below(x):
    return times(x) if x >= ASKED else f"**{times(x)}**"


class Comparison(NamedTuple):
    """A setting of VTK's, and our cheapest one that is off by no more, if there is one."""
    mesh: accuracy_results.Mesh
    peer: accuracy_results.Setting
    ours: Optional[accuracy_results.Setting]

    @property
    def frame(self):
        return self.peer.frame / self.ours.frame

    @property
    def first(self):
        return self.peer.first / self.ours.first


def all_comparisons(meshes):
    return [Comparison(mesh, setting, mesh.cheapest(setting.rms, setting.most) if setting.is_drawn else None)
            for mesh in meshes for setting in mesh.settings if setting.is_peer]


class Verdict(NamedTuple):
    """The comparisons of a mesh in which we are the least ahead, of cells drawn and of resampled images."""
    mesh: accuracy_results.Mesh
    cells_frame: Comparison
    cells_first: Comparison
    image_frame: Optional[Comparison]
    image_first: Optional[Comparison]

    @property
    def holds(self):
        return self.cells_frame.frame >= ASKED and self.cells_first.first >= ASKED

    def nearest(self, name, what):
        comparison = getattr(self, name)
        if comparison is None:
            return "-"
        return f"{times(getattr(comparison, what))} ({self.mesh.label(comparison.peer)})"


def all_verdicts(meshes, comparisons):
    verdicts = []
    for mesh in meshes:
        compared = [c for c in comparisons if c.mesh is mesh and c.ours]
        images = [c for c in compared if c.peer.method == "VTK resample"]
        cells = [c for c in compared if c.peer.method != "VTK resample"]
        if cells:
            verdicts.append(Verdict(mesh, *(min(some, key=lambda c: getattr(c, what), default=None)
                                            for some in (cells, images) for what in ("frame", "first"))))
    return verdicts


def ladder(meshes):
    """Return the cells of the ladder's table by setting: a list of texts, one a mesh."""
    rows = {}
    for column, mesh in enumerate(meshes):
        for setting in mesh.volumes:
            row = rows.setdefault(mesh.label(setting), ["-"] * len(meshes))
            figures = (setting.rms, setting.most, setting.frame)
            row[column] = ", ".join(map(page.write_number, figures)) if setting.is_drawn else setting.status
    return rows


class Surface(NamedTuple):
    mesh: accuracy_results.Mesh
    label: str
    errors: accuracy_results.Setting


def all_surfaces(meshes):
    """Where the field is linear more steps of Neubauer's method change nothing: every second one will do."""
    surfaces = []
    for mesh in meshes:
        for setting in mesh.surfaces:
            if mesh.is_linear and setting.value in ("N = 1", "N = 3", "N = 4"):
                continue
            _, _, way = setting.method.partition(" ")
            surfaces.append(Surface(mesh, f"{setting.value}, {way}" if way else setting.value, setting))
    return surfaces


def draw(arguments):
    if len(arguments) != 1:
        raise page.PageError("name one CSV file: is there one in bench/results?")
    results = accuracy_results.Results(arguments[0])
    comparisons = all_comparisons(results.meshes)
    return page.fill_template(
        "accuracy.md.j2", results=results, targets=TARGETS, comparisons=comparisons,
        verdicts=all_verdicts(results.meshes, comparisons), ladder=ladder(results.meshes[:4]),
        surfaces=all_surfaces(results.meshes), figures=results.figures(), bold_below=bold_below)


if __name__ == "__main__":
    page.run(draw, sys.argv[1:])
