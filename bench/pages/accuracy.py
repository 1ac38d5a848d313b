#!/usr/bin/python3 -B
"""Prints docs/accuracy.md, drawn from the newest CSV file of bench_accuracy: accuracy.py CSV ..."""

import sys
from typing import NamedTuple, Optional

import accuracy_results
import page

TARGETS = ["1e-1", "1e-2", "1e-3", "1e-4", "1e-5"]
ASKED = 10  # required speedup over each of VTK's mappers


class Comparison(NamedTuple):
    """A setting of VTK, and libinsitu's fastest setting whose error is not larger; ours is None if there is none."""
    mesh: accuracy_results.Mesh
    peer: accuracy_results.Setting
    ours: Optional[accuracy_results.Setting]

    @property
    def frame(self):
        return self.peer.frame / self.ours.frame

    @property
    def first(self):
        return self.peer.first / self.ours.first

    @property
    def peer_label(self):
        return self.mesh.label(self.peer).removeprefix("VTK ")

    @property
    def text(self):
        """The speedups of a frame and of the first picture over VTK, as text."""
        if not self.peer.is_drawn:
            return self.peer.status
        return f"{bold_where_slower(self.frame)} / {bold_where_slower(self.first)}" if self.ours else "none is so near"


def write_times(x):
    return f"{x:.1f}" if x < 10 else f"{x:.0f}"


def bold_where_slower(x):
    return write_times(x) if x >= 1 else f"**{write_times(x)}**"


def all_comparisons(meshes):
    return [Comparison(mesh, setting, mesh.cheapest(setting.rms, setting.most) if setting.is_drawn else None)
            for mesh in meshes for setting in mesh.settings if setting.is_peer]


class Standing:
    """All comparisons, also as a table with a row for each mesh and a column for each of VTK's mappers and settings."""

    def __init__(self, comparisons):
        self.comparisons = comparisons
        self.peers = list(dict.fromkeys(c.peer_label for c in comparisons))
        self.rows = {}
        for c in comparisons:
            self.rows.setdefault(str(c.mesh), {})[c.peer_label] = c

    def _least(self, what, is_image):
        """Return the smallest speedup on each mesh: over resampled images if is_image, otherwise over mappers of
        cells."""
        ahead = [[getattr(c, what) for c in row.values() if c.ours and (c.peer.method == "VTK resample") == is_image]
                 for row in self.rows.values()]
        return [min(ratios) for ratios in ahead if ratios]

    def nearest(self, what, is_image):
        return span(self._least(what, is_image))

    def span(self, method, what):
        return span(getattr(c, what) for c in self.comparisons if c.ours and c.peer.method == f"VTK {method}")

    @property
    def reached(self):
        """The number of meshes on which libinsitu is at least ASKED times as fast as all mappers that draw cells."""
        least = zip(self._least("frame", False), self._least("first", False))
        return sum(frame >= ASKED and first >= ASKED for frame, first in least)


def span(ratios):
    ratios = sorted(ratios)
    return f"{write_times(ratios[0])} to {write_times(ratios[-1])}" if ratios else "-"


def greatest_share(meshes):
    """Return the largest error of max_error, divided by the requested error."""
    return max((s.most / float(s.value) for mesh in meshes for s in mesh.of("max_error") if s.is_drawn), default=0)


def ladder(meshes):
    """Return the rows of the table of our settings, method by method: by label, a list with one text per mesh."""
    ours = [(column, mesh, setting) for column, mesh in enumerate(meshes) for setting in mesh.volumes
            if not setting.is_peer and not (setting.is_repeated and setting.method == "frames")]
    methods = list(dict.fromkeys(setting.method for _, _, setting in ours))
    rows = {}
    for column, mesh, setting in sorted(ours, key=lambda one: methods.index(one[2].method)):
        row = rows.setdefault(mesh.label(setting), ["-"] * len(meshes))
        figures = (setting.rms, setting.most, setting.frame)
        row[column] = ", ".join(map(page.write_number, figures)) if setting.is_drawn else setting.status
    return rows


class Surface(NamedTuple):
    """A setting of isosurfaces, and the frame times of the thesis's traversals (packets and SPMD), as text."""
    mesh: accuracy_results.Mesh
    setting: accuracy_results.Setting
    packets: str
    spmd: str


def traversal(mesh, setting, way):
    """Return the time of one of the thesis's traversals, followed by its largest error if its errors differ."""
    for other in mesh.of(f"{setting.method} {way}"):
        if other.value == setting.value:
            frame = page.write_number(other.frame)
            return frame if other.errors == setting.errors else f"{frame} ({page.write_number(other.most)})"
    return ""


def all_surfaces(meshes):
    """Return all settings of isosurfaces, except those whose printed errors equal the errors of the robust setting."""
    surfaces = []
    for mesh in meshes:
        robust = [setting.errors for setting in mesh.of("robust")]
        for setting in mesh.of("Neubauer") + mesh.of("robust"):
            if setting.method == "robust" or setting.errors not in robust:
                ways = (traversal(mesh, setting, way) for way in ("packets", "SPMD"))
                surfaces.append(Surface(mesh, setting, *ways))
    return surfaces


def draw(arguments):
    results = accuracy_results.Results(arguments)
    return page.fill_template(
        "accuracy.md.j2", results=results, targets=TARGETS, standing=Standing(all_comparisons(results.meshes)),
        share=greatest_share(results.meshes), ladder=ladder(results.meshes[:4]), surfaces=all_surfaces(results.meshes),
        figures=results.figures(), asked=ASKED)


if __name__ == "__main__":
    page.run(draw, sys.argv[1:])
