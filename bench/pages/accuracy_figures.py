#!/usr/bin/python3 -B
"""Draws the error over the time, one panel per mesh, as FOLDER/accuracy_*.png: accuracy_figures.py FOLDER CSV ..."""

import pathlib
import sys
from typing import Callable, NamedTuple

try:
    from matplotlib import pyplot
    from matplotlib.lines import Line2D
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator
except ImportError:
    sys.exit("the figures of the benchmarks need matplotlib: Debian's package python3-matplotlib")

import accuracy_results
import page

HALF_STEP = 1 / 510  # half a step of an 8-bit channel, in mid-tones


class Series(NamedTuple):
    """The settings that one line joins, or that points represent. value: "" for all settings of the method.
    names(mesh, setting): the text beside a point. offset: offset of the text from the point, in typographic
    points."""
    title: str
    method: str
    style: dict
    value: str = ""
    names: Callable = lambda mesh, setting: ""
    offset: tuple = (6, 3)


def line(colour, marker, dashes="-", **more):
    return {"color": colour, "marker": marker, "linestyle": dashes, "linewidth": 1.3, "markersize": 6, **more}


def points(colour, marker, **more):
    return line(colour, marker, "none", **{"markersize": 8, **more})


def hollow(style):
    return {**style, "markerfacecolor": "white"}


def value_of(mesh, setting):
    return setting.value


def value_of_parts(mesh, setting):
    return "" if mesh.is_linear else setting.value


def value_and_wrong(mesh, setting):
    return f"{setting.value}: {setting.wrong} wrong" if setting.wrong else setting.value


def resolution(mesh, setting):
    return setting.value.replace("^3", "³")


VOLUME_SERIES = [
    Series("samples, 4 to 1/16 cell", "samples", line("#1f5fbf", "o"), names=value_of),
    Series("samples a cell apart, 1, 2, 4 … frames", "frames", hollow(line("#7fb2e5", "o", markersize=5))),
    Series("segments, 4 to 1/8 cell", "segments", line("#117733", "s"), names=value_of_parts),
    Series("max_error 1e-1 to 1e-4", "max_error", line("#44aa66", "^", ":")),
    Series("VTK ray cast, partial pre-integration", "VTK ray cast", points("#cc3311", "D"), "partial pre-integration"),
    Series("VTK ray cast, linear integrator", "VTK ray cast", hollow(points("#cc3311", "D")), "linear integrator"),
    Series("VTK Z-sweep", "VTK Z-sweep", points("#aa4499", "p", markersize=9)),
    Series("VTK projected tets", "VTK projected tets", points("#882255", "v")),
    Series("VTK resampled", "VTK resample", hollow(line("#ee7733", "s")), names=resolution, offset=(-7, 7)),
]
SURFACE_SERIES = [
    Series("Neubauer's method", "Neubauer", line("#1f5fbf", "o"), names=value_and_wrong),
    Series("Neubauer's, by packets", "Neubauer packets", line("#77aadd", "^", ":")),
    Series("Neubauer's, by SPMD", "Neubauer SPMD", line("#aabbe0", "v", ":")),
    Series("robust roots", "robust", points("#117733", "s"), names=value_and_wrong),
    Series("robust roots, by packets", "robust packets", points("#66bb88", "^")),
    Series("robust roots, by SPMD", "robust SPMD", points("#aaddbb", "v")),
]


def draw_series(axes, mesh, series, floor):
    """Draw a series. Errors below `floor` are drawn at `floor`."""
    settings = [s for s in mesh.of(series.method) if s.is_drawn and series.value in ("", s.value)]
    errors = [max(setting.most, floor) for setting in settings]
    axes.plot([setting.frame for setting in settings], errors, **series.style)
    for setting, error in zip(settings, errors):
        axes.annotate(series.names(mesh, setting), (setting.frame, error), series.offset, textcoords="offset points",
                      fontsize=8, color=series.style["color"])


def write_time(x, _):
    return f"{x / 1000:g} s" if x >= 1000 else f"{x:g}"


def draw_panel(axes, mesh, all_series, bottom):
    axes.set(title=f"{mesh} — {mesh.cells} cells", xscale="log", yscale="log", xlabel="milliseconds a frame",
             ylim=(bottom, 1.5))
    for series in all_series:
        draw_series(axes, mesh, series, 2 * bottom)
    # The names are to the right of their points and need space.
    low, high = axes.get_xlim()
    axes.set_xlim(low / 1.3, high * 1.5)
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.xaxis.set_major_formatter(FuncFormatter(write_time))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_locator(LogLocator(numticks=12))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(color="#e4e4e4", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.text(0.01, 0.02, "better: left and down", transform=axes.transAxes, fontsize=8, color="#888888")


def draw_half_step(axes):
    axes.axhline(HALF_STEP, color="#bbbbbb", linestyle="--", linewidth=0.8, zorder=0)
    axes.text(0.01, HALF_STEP / 1.7, "half a step of 8 bits in mid-tones", transform=axes.get_yaxis_transform(),
              fontsize=8, color="#888888")


def draw_figure(path, meshes, is_volume):
    all_series, bottom = (VOLUME_SERIES, 2e-8) if is_volume else (SURFACE_SERIES, 1e-7)
    figure, panels = pyplot.subplots(2, 2, figsize=(15, 11.8), squeeze=False)
    for axes, mesh in zip(panels.flat, meshes):
        draw_panel(axes, mesh, all_series, bottom)
        axes.set_ylabel("largest error of a channel" if is_volume else "largest depth error, cells")
        if is_volume:
            draw_half_step(axes)
    for axes in panels.flat[len(meshes):]:
        axes.remove()
    keys = [Line2D([], [], label=series.title, **series.style) for series in all_series]
    figure.legend(handles=keys, loc="lower center", ncols=3, frameon=False)
    figure.tight_layout(rect=(0, 0.07, 1, 1), w_pad=3, h_pad=2)
    figure.savefig(path, dpi=100, metadata={"Software": None})


def draw(arguments):
    if not arguments:
        raise page.PageError("no folder for the figures is named")
    pyplot.switch_backend("agg")
    pyplot.rcParams.update({"font.size": 11, "axes.titlesize": 11, "axes.edgecolor": "#555555"})
    for name, meshes in accuracy_results.Results(arguments[1:]).figures().items():
        draw_figure(pathlib.Path(arguments[0], f"{name}.png"), meshes, name != "accuracy_isosurfaces")
    return ""


if __name__ == "__main__":
    page.run(draw, sys.argv[1:])
