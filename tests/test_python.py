"""mpirun -n N python3 test_python.py FOLDER insitu.h: what is borrowed stays alive, every layout draws the same picture,
and what cannot be borrowed, or is wrong, is an exception. Verdicts are reduced, so that no rank waits for one that failed."""

import gc
import math
import os
import re
import sys
import weakref

import numpy
from mpi4py import MPI

import insitu

comm = MPI.COMM_WORLD
folder = sys.argv[1]
SCENE = """
writing: step
images:
  - name: {name}
    size: [48, 32]
    layers:
      - isosurface: {{field: f, values: [1.3]}}
      - volume: {{field: f, map: cool_to_warm, opacity: [[0, 0.2], [1, 0.4]]}}
    outputs: [{{path: {folder}/{name}.png}}]
"""


PLANE = "images: [{name: a, size: [48, 32], background: [0, 0, 0, 0], layers: [{surface: {colour_by: {field: f}}}]}]"


def everywhere(is_well, what):
    if not comm.allreduce(bool(is_well), MPI.LAND):
        raise SystemExit(f"rank {comm.rank}: {what}: {'another rank failed' if is_well else 'not so'}")


def raises(kind, words, call, *arguments, **named):
    try:
        call(*arguments, **named)
    except kind as error:
        everywhere(words in str(error), f"{error}: expected {words}")
        return error
    everywhere(False, f"nothing was raised, expected {kind.__name__}: {words}")


def lattice():
    """A block of 4 x 4 x 4 hexes for each rank, side by side along x."""
    n = 5
    k, j, i = numpy.meshgrid(range(n), range(n), range(n), indexing="ij")
    xyz = numpy.stack([i + comm.rank * (n - 1), j, k], axis=-1).reshape(-1, 3).astype(float)
    v = numpy.arange(n**3).reshape(n, n, n)
    low, high = slice(None, -1), slice(1, None)
    around = [(low, low), (low, high), (high, high), (high, low)]
    hexes = numpy.stack([v[z][:, y, x] for z in (low, high) for y, x in around], axis=-1).reshape(-1, 8)
    return xyz, hexes, numpy.sqrt(xyz[:, 1] + xyz[:, 2])


def picture(name, coordinates, connectivity, values, **named):
    """Draw once, when the caller's own references are gone and other arrays have been where they were."""
    with insitu.Session(comm, scene_text=SCENE.format(name=name, folder=folder)) as session:
        session.set_mesh("m", coordinates=coordinates(), connectivity=connectivity(), cell_type=insitu.HEX, **named)
        session.set_field("m", "f", values())
        gc.collect()
        rubbish = [numpy.full(n, numpy.nan) for n in (125, 375, 64, 512) for _ in range(64)]
        session.step(0, 0.0)
        del rubbish
        everywhere(session.report["images"] == 1 and session.report["bytes_copied"] == 0, f"{name}: {session.report}")
    comm.Barrier()
    with open(f"{folder}/{name}.png", "rb") as file:
        return file.read()


def layouts_draw_the_same_picture():
    # Each array is made anew in the call, and nobody but the session knows it afterwards.
    xyz, hexes, f = (lambda: lattice()[0]), (lambda: lattice()[1]), (lambda: lattice()[2])
    plain = picture("plain", xyz, hexes, f)
    everywhere(len(plain) > 500, "the picture shows something")

    def in_rows_of(array, width):
        wide = numpy.full((array.shape[0], width), numpy.nan)
        wide[:, 1:1 + array.shape[1]] = array
        return wide[:, 1:1 + array.shape[1]]

    others = {
        "axes": (lambda: tuple(xyz().T.copy()), hexes, f),
        "columns": (lambda: numpy.asfortranarray(xyz()), hexes, f),
        "wide": (lambda: in_rows_of(xyz(), 6), hexes, lambda: in_rows_of(f()[:, None], 3)[:, 0]),
        "backwards": (lambda: xyz()[::-1].copy()[::-1], hexes, lambda: f()[::-1].copy()[::-1]),
        "int32": (xyz, lambda: hexes().astype(numpy.int32), f),
        "flat": (xyz, lambda: hexes().ravel(), f),
        "every_other": (xyz, lambda: numpy.repeat(hexes().ravel(), 2)[::2], f),
        "component": (xyz, hexes, lambda: f()[:, None]),
    }
    for name, (coordinates, connectivity, values) in others.items():
        everywhere(picture(name, coordinates, connectivity, values) == plain, f"{name} is the plain picture")
    everywhere(picture("ghosts", xyz, hexes, f, ghosts=numpy.zeros(64, bool)) == plain, "ghosts of type bool")


SPEED = """images: [{name: a, size: [48, 32], layers: [
  {isosurface: {field: u, component: magnitude, values: [2.5], colour_by: {field: u, component: 2}}}]}]"""


def components_and_indices_of_any_type_are_the_same():
    xyz, hexes, _ = lattice()
    tuples = numpy.stack([xyz[:, 1], xyz[:, 2], (xyz[:, 0] * 3 + xyz[:, 1]) % 4], axis=-1)
    packed = numpy.zeros(len(xyz), numpy.dtype([("mark", "i1"), ("w", "f8")]))
    packed["w"] = tuples[:, 2]
    apart = [tuples[:, 0].astype("i2"), tuples[:, 1].astype("u1"), packed["w"]]
    types, numbers = numpy.full(64, insitu.HEX, "u1"), numpy.full(64, 3, "i2")
    offsets, table = numpy.arange(65) * 8, [0, 0, 0, insitu.HEX]
    pictures = []
    for values, cells in [
        (tuples, dict(connectivity=hexes, cell_type=insitu.HEX)),
        (apart, dict(connectivity=hexes.astype("u1"), cell_type=insitu.HEX)),
        (apart, dict(connectivity=hexes.astype("u8").ravel(), cell_types=types, offsets=offsets.astype("u4"))),
        (tuples, dict(connectivity=hexes.ravel(), cell_types=numbers, offsets=offsets[:-1], open_offsets=True,
                      cell_type_map=table)),
    ]:
        with insitu.Session(comm, scene_text=SPEED) as session:
            session.keep_pictures()
            session.set_mesh("m", coordinates=xyz, **cells)
            session.set_field("m", "u", values)
            session.step(0, 0.0)
            pictures.append(session.pictures[0].rgba if comm.rank == 0 else numpy.ones(1))
            raises(ValueError, "values[1]: has 124 values, values[0] has 125", session.set_field, "m", "u",
                   [apart[0], apart[1][:-1]])
    everywhere(pictures[0].any(), "the speed shows something")
    everywhere(all((other == pictures[0]).all() for other in pictures), "arrays of any type draw the same picture")


def planes_go_without_z():
    n = 5
    xyz, hexes, f = lattice()
    quads, flat = hexes[:(n - 1)**2, :4].copy(), xyz * [1, 1, 0]
    pictures = []
    for coordinates in flat, flat[:, :2], flat[:, :2].copy(), (flat[:, 0].copy(), flat[:, 1]), flat[:, :2].astype("f4"):
        with insitu.Session(comm, scene_text=PLANE) as session:
            session.keep_pictures()
            session.set_mesh("m", coordinates=coordinates, connectivity=quads, cell_type=insitu.QUAD)
            session.set_field("m", "f", f)
            session.step(0, 0.0)
            pictures.append(session.pictures[0].rgba if comm.rank == 0 else numpy.ones(1))
    everywhere(pictures[0].any(), "the plane picture shows something")
    everywhere(all((other == pictures[0]).all() for other in pictures), "coordinates of two columns draw the same picture")


def what_cannot_be_borrowed_is_refused():
    xyz, hexes, f = lattice()
    with insitu.Session(comm, scene_text=SCENE.format(name="refused", folder=folder)) as s:
        mesh = dict(coordinates=xyz, connectivity=hexes, cell_type=insitu.HEX)
        for changed, kind, words in [
            (dict(coordinates=xyz.tolist()), TypeError, "a list cannot be borrowed"),
            (dict(coordinates=xyz.astype(">f8")), TypeError, "native"),
            (dict(coordinates=xyz[:, :1]), ValueError, "vertices x 3 (or x 2)"),
            (dict(coordinates=xyz[:, :2]), insitu.Error, "z coordinates are not given"),
            (dict(coordinates=[axis.reshape(5, 5, -1) for axis in xyz.T]), ValueError, "reshape(-1) makes a list"),
            (dict(connectivity=hexes.astype("complex64")), TypeError, "complex64"),
            (dict(connectivity=numpy.asfortranarray(hexes)), ValueError, "rows that follow one another"),
            (dict(connectivity=hexes[:, :7].copy()), ValueError, "expected 8"),
            (dict(connectivity=hexes[:, :7]), ValueError, "has 7 columns, expected 8"),
            (dict(connectivity=numpy.zeros((64, 27), "i4")[:, :8], offsets=8 * numpy.arange(65)), ValueError, "gaps"),
            (dict(vertex_order=7), insitu.Error, "vertex_order is 7"),
            (dict(vertex_order="vtk"), TypeError, "vertex_order: is 'vtk', expected insitu.ORDER_VTK, "),
            (dict(order=33), insitu.Error, "order is 33, expected 1..32"),
            (dict(order=2), insitu.Error, "order is 2, and cell_type is 12"),
            (dict(cell_type=insitu.QUADRATIC_HEX), ValueError, "has 8 columns, expected 20"),
            (dict(cell_type=insitu.LAGRANGE_HEX, order=2), ValueError, "has 8 columns, expected 27"),
            (dict(cell_type=insitu.LAGRANGE_HEX, connectivity=hexes[:, :7].copy()), insitu.Error, "have 7 nodes, which no order"),
            (dict(cell_type=insitu.LAGRANGE_HEX, connectivity=None, order=3), insitu.Error, "1 cells of 64 nodes without connectivity need 64"),
            (dict(cell_type="hex"), TypeError, "cell_type: is 'hex', expected insitu.TET, insitu.HEX"),
            (dict(ghosts=numpy.zeros(63, "u1")), ValueError, "63 elements, expected 64"),
            (dict(ghosts=numpy.broadcast_to(numpy.uint8(0), 64)), ValueError, "repeats one element"),
        ]:
            raises(kind, words, s.set_mesh, "m", **{**mesh, **changed})
        s.set_mesh("m", **mesh)
        raises(TypeError, "MaskedArray", s.set_field, "m", "f", numpy.ma.masked_array(f))
        for name in ("f\0g", "\0"):
            raises(ValueError, "holds a character 0", s.set_field, "m", name, f)
            raises(ValueError, "holds a character 0", s.set_field, name, "f", f)
            raises(ValueError, "holds a character 0", s.set_mesh, name, **mesh)
            raises(ValueError, "holds a character 0", s.remove_mesh, name)
        for cycle in (2**64 + 5, 2**63, -2**63 - 1):
            raises(ValueError, f"cycle: is {cycle}, expected a whole number of 64 bits", s.step, cycle, 0.0)
        raises(TypeError, "", s.step, 0.5, 0.0)
        raises(TypeError, "centring: is 'cell', expected insitu.VERTEX, insitu.CELL", s.set_field, "m", "f", f, centring="cell")
        raises(insitu.Error, "", s.set_field, "m", "f", f[:-1])
        raises(insitu.Error, "rank", s.step, 0, 0.0)
        s.set_field("m", "f", f)
        s.step(1, 0.0)
        everywhere(s.report["images"] == 1 and s.report["cycle"] == 1, "the session goes on after errors")
    raises(ValueError, "closed", s.step, 2, 0.0)
    error = raises(insitu.Error, "scene text:1", insitu.Session, comm, scene_text="imags: []")
    everywhere(error.status == "INSITU_ERROR_SCENE" and error.on_all_ranks, "a scene's error")
    raises(insitu.Error, "no/such.yaml", insitu.Session, comm, "no/such.yaml")


def parameters_are_numbers():
    with insitu.Session(comm, scene_text="parameters: {inflow: 2.5}\n" + SCENE.format(name="p", folder=folder)) as s:
        everywhere(s.parameter("inflow") == 2.5 and s.parameter("inflow", 7) == 2.5, "a parameter is read")
        error = raises(insitu.Error, '"inflw" is no parameter of scene text (did you mean "inflow"?)', s.parameter, "inflw")
        everywhere(error.status == "INSITU_ERROR_ARGUMENT" and not error.on_all_ranks, "an unknown one is an error")
        everywhere(s.parameter("inflw", 7) == 7, "or what was given for that")
        raises(ValueError, "character 0", s.parameter, "in\0flow")
    raises(ValueError, "closed", s.parameter, "inflow")


def drawn(name, hand_over, scene=SCENE):
    """The picture of what a function hands over, when nobody but the session knows its arrays."""
def drawn(name, hand_over, scene=SCENE, copied=None):
    """The picture of what a function hands over, when nobody but the session knows its arrays; copied: bytes."""
    with insitu.Session(comm, scene_text=scene.format(name=name, folder=folder)) as session:
        hand_over(session)
        gc.collect()
        rubbish = [numpy.full(n, numpy.nan) for n in (64, 125, 343, 512, 1029) for _ in range(64)]
        session.step(0, 0.0)
        del rubbish
        everywhere(copied in (None, session.report["bytes_copied"]), f"{session.report['copied_why']}")
    comm.Barrier()
    with open(f"{folder}/{name}.png", "rb") as file:
        found = file.read()
    comm.Barrier()
    return found


def laid(values, order, low=0, high=0):
    """An array of these values [i, j, k, ...] in an order of memory, in the midst of NaN or 1 where there is padding."""
    wide = numpy.full([n + low + high for n in values.shape[:3]] + list(values.shape[3:]),
                      numpy.nan if values.dtype.kind == "f" else 1, values.dtype, order=order)
    inside = wide[tuple(slice(low, low + n) for n in values.shape[:3])]
    inside[...] = values
    return inside


def blocks_are_their_hexes():
    """Uniform, rectilinear and curvilinear blocks, in both orders, with padding and ghost layers: bitwise the hexes."""
    xyz, hexes, f = lattice()
    n = 5
    places = xyz.reshape(n, n, n, 3).transpose(2, 1, 0, 3)  # [i, j, k], x y z
    values, cells = f.reshape(n, n, n).transpose(2, 1, 0), (4, 4, 4)
    of_cells = values[1:, 1:, 1:] + 0.1 * (numpy.arange(64).reshape(cells) % 3)
    uniform = dict(spacing=(1, 1, 1), first=(4 * comm.rank, 0, 0))

    def hand_hexes(s):
        s.set_mesh("m", coordinates=xyz.copy(), connectivity=hexes, cell_type=insitu.HEX)
        s.set_field("m", "f", f.copy())

    def hand_cells(s):
        s.set_mesh("m", coordinates=xyz.copy(), connectivity=hexes, cell_type=insitu.HEX)
        s.set_field("m", "f", of_cells.transpose(2, 1, 0).reshape(-1).copy(), centring=insitu.CELL)

    def block(order, make, low=0, high=0, components=None, of=insitu.VERTEX, **named):
        def hand_over(s):
            own = laid(values if of == insitu.VERTEX else of_cells, order, low, high)
            if components is not None:  # along an axis of their own, which may be the first or the last
                own = numpy.moveaxis(laid(numpy.stack([values, values + 3], axis=-1), order), -1, components)
            s.set_block("m", cells, **make(), **{"vertex_layout" if of == insitu.VERTEX else "cell_layout": own}, **named)
            s.set_field("m", "f", own if components is None else own[tuple(slice(0, 1) if axis == components % 4 else
                                                                           slice(None) for axis in range(4))], centring=of)
        return hand_over

    plain = {insitu.VERTEX: drawn("block_plain", hand_hexes), insitu.CELL: drawn("block_cells", hand_cells)}
    everywhere(plain[insitu.VERTEX] != plain[insitu.CELL], "fields at vertices and in cells differ")
    axes = [numpy.arange(n) + 4 * comm.rank, numpy.arange(n), numpy.arange(n)]
    forms = {
        "uniform": lambda: uniform,
        "axes": lambda: dict(coordinates=tuple(axis.astype("f4") for axis in axes)),
        "strided_axes": lambda: dict(coordinates=tuple(numpy.repeat(axis.astype("f8"), 2)[::2] for axis in axes)),
    }
    for form, make in forms.items():
        for order in "CF":
            for of in insitu.VERTEX, insitu.CELL:
                copied = 8 * 3 * n if of == insitu.VERTEX else None  # along the axes; no bytes for cells or vertices
                everywhere(drawn("block", block(order, make, of=of), copied=copied) == plain[of], f"{form}, {order}, {of}")
                everywhere(drawn("block", block(order, make, 1, 2, of=of)) == plain[of], f"{form}, {order}, padded, {of}")
    for order in "CF":
        for name, make in {
            "x, y, z": lambda: dict(coordinates=tuple(laid(places[..., i], order, 2, 1) for i in range(3))),
            "of 4 bytes": lambda: dict(coordinates=tuple(laid(places[..., i].astype("f4"), order, 2, 1) for i in range(3))),
            "xyz": lambda: dict(coordinates=numpy.moveaxis(laid(places, order, 2, 1), -1, 0)),
        }.items():
            if name == "xyz" and order == "F":
                continue  # its components are farthest apart
            everywhere(drawn("block", block(order, make, 2, 1), copied=0) == plain[insitu.VERTEX], f"curvilinear {name}, {order}")
        everywhere(drawn("block", block(order, lambda: uniform, components=-1)) == plain[insitu.VERTEX], "components after")
        everywhere(drawn("block", block(order, lambda: uniform, components=0)) == plain[insitu.VERTEX], "components before")

    def with_layers(s):
        """A block of 6 x 6 x 6 of which the outer layers are ghosts, with flags as well, and values by a callable."""
        s.set_block("m", (6, 6, 6), spacing=(1, 1, 1), first=(4 * comm.rank - 1, -1, -1), interior_first=(1, 1, 1),
                    interior_end=(5, 5, 5), ghosts=laid(numpy.zeros((6, 6, 6), "u1"), "F", 0, 1),
                    vertex_layout=laid(values, "C", 1, 1).base)
        s.set_field("m", "f", lambda: laid(values, "C", 1, 1).base)

    everywhere(drawn("block", with_layers) == plain[insitu.VERTEX], "ghost layers")

    def indexed(s):
        s.set_block("m", cells, **uniform)
        s.set_field("m", "f", f.copy(), index=numpy.arange(n**3).reshape(n, n, n).transpose(2, 1, 0).copy())

    everywhere(drawn("block", indexed) == plain[insitu.VERTEX], "values by an index [i, j, k]")

    def mirrored(s):
        s.set_block("m", cells, spacing=(1, -1, 1), first=(4 * comm.rank, -4, 0))
        s.set_field("m", "f", values[:, ::-1].copy())

    def downwards(s):
        s.set_block("m", cells, coordinates=(axes[0] * 1.0, axes[1] * 1.0, axes[2][::-1] * 1.0))
        s.set_field("m", "f", values[:, :, ::-1].copy())

    everywhere(drawn("block", mirrored) == plain[insitu.VERTEX], "a negative spacing")
    everywhere(drawn("block", downwards) == plain[insitu.VERTEX], "an axis that runs downwards")


def levels_are_their_hexes():
    """A coarse level under a finer one of ratio 2 on each rank, cell values, isosurfaces across both: bitwise the hexes, of
    which none is covered. Ghosts flag the covered ones; or both are blocks of one mesh, and they are found."""
    origin, spacing = (0.1, -0.3, 0.7), (0.3, 0.2, 0.25)

    def centres(first, cells, ratio):
        return numpy.meshgrid(*(origin[a] + spacing[a] / ratio * (first[a] + numpy.arange(cells[a]) + 0.5) for a in range(3)),
                              indexing="ij")

    levels = {"coarse": ((4 * comm.rank, 0, 0), (4, 6, 6), 1), "fine": ((8 * comm.rank + 2, 4, 4), (4, 4, 6), 2)}
    covered = numpy.zeros((4, 6, 6), bool)
    covered[1:3, 2:4, 2:5] = True

    def set_blocks(s):
        for name, (first, cells, ratio) in levels.items():
            s.set_block(name, cells, origin=origin, spacing=tuple(h / ratio for h in spacing), first=first,
                        ghosts=covered if ratio == 1 else None)
            x, y, z = centres(first, cells, ratio)
            s.set_field(name, "f", 1 + 0.4 * x + numpy.sin(3 * y) * z, centring=insitu.CELL)

    def set_numbered(s):
        for number, (first, cells, ratio) in enumerate(levels.values()):
            x, y, z = centres(first, cells, ratio)
            for n in number, 10:  # number 10 goes again
                s.set_block("amr", cells, origin=origin, spacing=tuple(h / ratio for h in spacing), first=first,
                            refinement=(ratio,) * 3, number=n)
                s.set_field("amr", "f", 1 + 0.4 * x + numpy.sin(3 * y) * z, centring=insitu.CELL, number=n)
        s.remove_mesh("amr", number=10)

    def set_hexes(s):
        for name, (first, cells, ratio) in levels.items():
            axes = [origin[a] + spacing[a] / ratio * (first[a] + numpy.arange(cells[a] + 1)) for a in range(3)]
            corners = numpy.arange(math.prod(n + 1 for n in cells)).reshape([n + 1 for n in cells])
            low, high = slice(None, -1), slice(1, None)
            around = [(low, low), (high, low), (high, high), (low, high)]
            hexes = numpy.stack([corners[i, j, k] for k in (low, high) for i, j in around], axis=-1)
            own = ~covered if ratio == 1 else numpy.ones(cells, bool)
            s.set_mesh(name, coordinates=tuple(a.reshape(-1) for a in numpy.meshgrid(*axes, indexing="ij")),
                       connectivity=hexes[own], cell_type=insitu.HEX)
            x, y, z = centres(first, cells, ratio)
            s.set_field(name, "f", (1 + 0.4 * x + numpy.sin(3 * y) * z)[own], centring=insitu.CELL)

    hexes = drawn("levels", set_hexes)
    everywhere(drawn("levels", set_blocks) == hexes, "levels of blocks are levels of hexes")
    everywhere(drawn("levels", set_numbered) == hexes, "levels of blocks of one mesh are levels of hexes")


def blocks_of_two_dimensions_are_their_quads():
    scene = SCENE.split("    layers:")[0] + """    layers: [{{surface: {{colour_by: {{field: f}}}}}}]
    outputs: [{{path: {folder}/{name}.png}}]
"""
    i, j = numpy.meshgrid(range(6), range(5), indexing="ij")
    x, z = i + 5.0 * comm.rank, 0.3 * (i + 5 * comm.rank) * j
    v = numpy.arange(30).reshape(6, 5)
    quads = numpy.stack([v[:-1, :-1], v[1:, :-1], v[1:, 1:], v[:-1, 1:]], axis=-1).reshape(-1, 4)

    def hand_quads(height):
        def hand_over(s):
            s.set_mesh("m", coordinates=tuple(a.reshape(-1) for a in (x, 1.0 * j, height)), connectivity=quads,
                       cell_type=insitu.QUAD)
            s.set_field("m", "f", (x + j).reshape(-1))
        return hand_over

    def submit_block(**named):
        def hand_over(s):
            s.set_block("m", (5, 4), **named)
            s.set_field("m", "f", x + j)
        return hand_over

    bent, flat = drawn("quads", hand_quads(z), scene), drawn("quads", hand_quads(0 * z), scene)
    everywhere(bent != flat and len(flat) > 300, "the quads are seen")
    everywhere(drawn("quads", submit_block(coordinates=(x, 1.0 * j, z)), scene) == bent, "a surface in space")
    everywhere(drawn("quads", submit_block(coordinates=(x[:, 0], j[0] * 1.0)), scene) == flat, "axes")
    everywhere(drawn("quads", submit_block(spacing=(1, 1), first=(5 * comm.rank, 0)), scene) == flat, "uniform")


def wrong_blocks_are_refused():
    n = 5
    f, c = numpy.ones((n, n, n)), numpy.ones((4, 4, 4))
    axis, flags = numpy.arange(5.0), numpy.zeros((4, 4, 4), "u1")
    uniform = dict(cells=(4, 4, 4), spacing=(1, 1, 1), coordinates=None)
    axes, curved = dict(uniform, spacing=None, coordinates=(axis, axis, axis)), dict(uniform, spacing=None, coordinates=(f, f, f))
    with insitu.Session(comm, scene_text=SCENE.format(name="wrong", folder=folder)) as s:
        for named, kind, words in [
            (dict(uniform, cells=(4,)), ValueError, "cells: has 1 numbers, expected 2 or 3"),
            (dict(uniform, cells=4), TypeError, "cells: is 4, expected 2 or 3 numbers"),
            (dict(uniform, spacing=0.5), TypeError, "spacing: is 0.5, expected 3 numbers"),
            (dict(uniform, spacing=(1, 1)), ValueError, "spacing: has 2 numbers, expected 3"),
            (dict(uniform, cells=(4, 0, 4)), ValueError, "cells: are (4, 0, 4), expected"),
            (dict(uniform, cells=(4, -4, 4)), ValueError, "cells: are (4, -4, 4), expected"),
            (dict(uniform, cells=(2**40, 2**40, 2**40)), ValueError, "too many, expected at most 4294967294"),
            (dict(uniform, cells=(4.5, 4, 4)), TypeError, "float"),
            (dict(uniform, spacing=(1, 0, 1)), insitu.Error, "the spacing along j is 0"),
            (dict(uniform, spacing=(1, numpy.nan, 1)), insitu.Error, "along j are not finite"),
            (dict(uniform, spacing=(1,)), ValueError, "spacing: has 1 numbers, expected 3"),
            (dict(uniform, first=(2**63, 0, 0)), ValueError, "first: has the number 9223372036854775808"),
            (dict(uniform, spacing=None, origin=(0, 0, 0)), TypeError, "expected one of them"),
            (dict(axes, first=(1, 0, 0)), TypeError, "spacing: is not given, and origin or first is"),
            (dict(uniform, coordinates=(axis, axis, axis)), TypeError, "expected one of them"),
            (dict(uniform, interior_first=(1, 1, 1)), TypeError, "one is given, expected both or none"),
            (dict(uniform, interior_first=(1, 1, 1), interior_end=(5, 4, 4)), insitu.Error, "the interior along i is 1..5"),
            (dict(uniform, ghosts=flags[1:]), ValueError, "ghosts: has the shape (3, 4, 4), expected (4, 4, 4) for the cells"),
            (dict(uniform, ghosts=flags.reshape(-1)[1:]), ValueError, "ghosts: is a list of 63, expected one of 64"),
            (dict(uniform, ghosts=c), insitu.Error, "ghost flags are of element type 2, not an integer type"),
            (dict(uniform, ghosts=flags.copy("F"), cell_layout=c), ValueError, "ghosts: has strides of (1, 4, 16) bytes, which "
             "are as (1, 4, 16), expected as (16, 4, 1)"),
            (dict(axes, coordinates=(axis, axis[1:], axis)), ValueError, "coordinates[1]: has 4 elements, expected 5"),
            (dict(axes, coordinates=(axis, axis)), ValueError, "coordinates: are along 2 axes, expected 3"),
            (dict(curved, coordinates=(f, f)), ValueError, "are 2 for each vertex, expected x, y and z"),
            (dict(curved, coordinates=(f, f[:-1], f)), ValueError, "coordinates[1]: has the shape (4, 5, 5), expected (5, 5, 5)"),
            (dict(curved, coordinates=(f, f, f[::-1])), ValueError, "coordinates[2]: has strides of (-200, 40, 8) bytes, expected "
             "positive ones"),
            (dict(curved, coordinates=(f, f, f.copy("F"))), ValueError, "coordinates[2]: has strides of (8, 40, 200) bytes, which "
             "are as (1, 5, 25), expected as (25, 5, 1)"),
            (dict(curved, coordinates=(f, f, axis)), ValueError, "coordinates[2]: is a list of 5, expected one of 125"),
            (dict(curved, coordinates=(f, f, numpy.broadcast_to(axis, f.shape))), ValueError, "strides of (0, 0, 8) bytes"),
        ]:
            raises(kind, words, s.set_block, "m", **named)
        s.set_block("m", **uniform)
        for values, centring, kind, words in [
            (f[1:], insitu.VERTEX, ValueError, "values: has the shape (4, 5, 5), expected (5, 5, 5), with components before or"),
            (c, insitu.VERTEX, ValueError, "values: has the shape (4, 4, 4), expected (5, 5, 5)"),
            (f, insitu.CELL, ValueError, "values: has the shape (5, 5, 5), expected (4, 4, 4)"),
            (f.copy("F"), insitu.VERTEX, ValueError, "values: has strides of (8, 40, 200) bytes, which are as (1, 5, 25), expected "
             "as (25, 5, 1): all arrays of the vertices of block \"m\" have one order and padding (set_block's vertex_layout"),
            (numpy.ones((n, n, n + 1))[:, :, :n], insitu.VERTEX, ValueError, "as (30, 6, 1), expected as (25, 5, 1)"),
            (f[0], insitu.VERTEX, ValueError, "values: has 2 dimensions, expected 1 or 3 or 4"),
            (f.reshape(-1)[1:], insitu.VERTEX, ValueError, "values: is a list of 124, expected one of 125"),
            (numpy.ones(512), insitu.CORNER, insitu.Error, "values at corners, and the mesh is a lattice"),
        ]:
            raises(kind, words, s.set_field, "m", "f", values, centring=centring)
        s.set_field("m", "f", lambda: f[1:])
        error = raises(insitu.Error, "its fill returned", s.step, 0, 0.0)
        everywhere("values: has the shape (4, 5, 5)" in str(error.__cause__), f"{error.__cause__}")
        s.set_block("m", (4, 4, 4), spacing=None, coordinates=(axis, axis * numpy.nan, axis))
        s.set_field("m", "f", f)
        raises(insitu.Error, "coordinate 0 along j is not finite: nan", s.step, 1, 0.0)
        s.set_block("m", **uniform)
        s.set_field("m", "f", f)
        s.step(2, 0.0)
        everywhere(s.report["images"] == 1, "the session goes on after errors")
        xyz, hexes, values = lattice()
        s.set_mesh("m", coordinates=xyz, connectivity=hexes, cell_type=insitu.HEX)
        raises(ValueError, "values: has 3 dimensions, expected 1 or 2", s.set_field, "m", "f", f)


def pictures_are_arrays():
    xyz, hexes, f = lattice()
    with insitu.Session(comm, scene_text=SCENE.format(name="kept", folder=folder)) as s:
        s.set_mesh("m", coordinates=xyz, connectivity=hexes, cell_type=insitu.HEX)
        s.set_field("m", "f", f)
        s.step(0, 0.0)
        everywhere(s.pictures == [], "nothing is kept that was not asked for")
        s.keep_pictures()
        s.step(1, 0.0)
        pictures = s.pictures
        everywhere(len(pictures) == (comm.rank == 0), "rank 0 has the picture")
    # The session is closed: the arrays are the caller's own.
    for name, rgba, depth in pictures:
        well = name == "kept" and rgba.shape == (32, 48, 4) and depth.shape == (32, 48) and rgba.dtype == depth.dtype == "f4"
        well = well and numpy.isinf(depth[0, 0]) and depth[16, 24] > 0 and (rgba[16, 24] != rgba[0, 0]).any()
    everywhere(comm.rank or well, "the picture is in the arrays")


def faces_of(hexes):
    """Each quad once, with the first of its cells and the second, -1 where there is none."""
    quads = [(0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    faces, cells = hexes[:, quads].reshape(-1, 4), numpy.repeat(numpy.arange(len(hexes)), 6)
    _, first, which = numpy.unique(numpy.sort(faces), axis=0, return_index=True, return_inverse=True)
    neighbour = numpy.full(len(first), -1)
    second = numpy.setdiff1d(numpy.arange(len(faces)), first)
    neighbour[which[second]] = cells[second]
    return faces[first], cells[first], neighbour


def finite_volumes_are_their_hexes():
    xyz, hexes, f = lattice()
    faces, owner, neighbour = faces_of(hexes)
    with open(f"{folder}/plain.png", "rb") as file:
        plain = file.read()
    for base, kind in [(0, numpy.int64), (1, numpy.int32)]:
        with insitu.Session(comm, scene_text=SCENE.format(name="volumes", folder=folder)) as s:
            mesh = dict(coordinates=xyz, faces=(faces + base).astype(kind), index_base=base, cell_count=64,
                        face_offsets=4 * numpy.arange(len(faces) + 1) + base, owner=(owner + base).astype(kind),
                        neighbour=(neighbour + base).astype(kind))
            raises(TypeError, "expected one of them", s.set_mesh, "m", connectivity=hexes, **mesh)
            raises(TypeError, "expected both or none", s.set_mesh, "m", **{**mesh, "cell_count": None})
            raises(ValueError, "owner: has 239 elements, expected 240", s.set_mesh, "m",
                   **{**mesh, "owner": mesh["owner"][1:]})
            s.set_mesh("m", **mesh)
            s.set_field("m", "f", f)
            s.step(0, 0.0)
            everywhere(s.report["cells_recognised"] == 64, "hexes are recognised")
            comm.Barrier()
            with open(f"{folder}/volumes.png", "rb") as file:
                everywhere(file.read() == plain, "the picture of the hexes")
            order = numpy.argsort(neighbour < 0, kind="stable")
            inner = numpy.count_nonzero(neighbour >= 0) + 1  # the last of them has a cell of a halo beyond
            apart = {**mesh, "faces": mesh["faces"][order][:inner], "face_offsets": mesh["face_offsets"][:inner + 1],
                     "owner": mesh["owner"][order][:inner], "neighbour": mesh["neighbour"][order][:inner],
                     "boundary_faces": mesh["faces"][order][inner:], "boundary_owner": mesh["owner"][order][inner:],
                     "boundary_face_offsets": mesh["face_offsets"][:len(faces) - inner + 1], "halo_cell_count": 1}
            apart["neighbour"][-1] = 64 + base
            raises(ValueError, "boundary_face_offsets: has 96 elements, expected 95", s.set_mesh, "m",
                   **{**apart, "boundary_owner": apart["boundary_owner"][1:]})
            s.set_mesh("m", **apart)
            s.set_field("m", "f", f)
            s.step(4, 0.0)
            everywhere(s.report["cells_recognised"] == 64, "hexes are recognised, of two lists")
            comm.Barrier()
            with open(f"{folder}/volumes.png", "rb") as file:
                everywhere(file.read() == plain, "the picture of the hexes, by two lists of faces")
            lists = {**mesh, "faces": [face.astype(kind) + base for face in faces]}
            del lists["face_offsets"]
            raises(ValueError, "faces[3]: is strided", s.set_mesh, "m",
                   **{**lists, "faces": lists["faces"][:3] + [numpy.zeros(8, kind)[::2]]})
            s.set_mesh("m", **lists)
            del lists
            gc.collect()
            s.set_field("m", "f", f)
            s.step(2, 0.0)
            comm.Barrier()
            with open(f"{folder}/volumes.png", "rb") as file:
                everywhere(file.read() == plain, "the picture of the hexes, by lists of faces")
            comm.Barrier()
            s.set_mesh("m", keep_polyhedra=True, **mesh)
            s.set_field("m", "f", f)
            s.step(1, 0.0)
            everywhere(s.report["cells_recognised"] == 0, "polyhedra are left")


def boundaries_have_values_of_their_own():
    """Values on the wall y = 0, its faces told in each way and by layouts that are no copies: one picture, another than
    without. The isosurface lies in the cells at the wall."""
    xyz, hexes, _ = lattice()
    faces, owner, neighbour = faces_of(hexes)
    is_wall = (neighbour < 0) & (xyz[faces][:, :, 1] == 0).all(axis=1)
    order = numpy.argsort(is_wall, kind="stable")
    faces, owner, neighbour, first = faces[order], owner[order], neighbour[order], len(faces) - is_wall.sum()
    values = numpy.repeat(numpy.linspace(2, 3, is_wall.sum()), 2)
    numbers = numpy.arange(first, len(faces))
    ways = {
        "without": [],
        "range": [insitu.Patch(values[::2], first_face=first)],
        "numbers": [insitu.Patch(values[::2].copy()[:5], faces=numbers[:5]),
                    insitu.Patch(values[10::2], faces=numbers[5:].astype("i4"))],
        "rows": [insitu.Patch(values[::2], connectivity=faces[first:])],
        "list": (insitu.Patch(values[::2], connectivity=faces[first:].reshape(-1),
                              offsets=4 * numpy.arange(is_wall.sum() + 1)),),
    }
    pictures = {}
    for name, patches in ways.items():
        with insitu.Session(comm, scene_text=SCENE.format(name="walls", folder=folder)) as s:
            s.set_mesh("m", coordinates=xyz, faces=faces, face_offsets=4 * numpy.arange(len(faces) + 1), owner=owner,
                       neighbour=neighbour, cell_count=64)
            s.set_field("m", "f", numpy.ones(64), centring=insitu.CELL, patches=patches)
            gc.collect()
            s.step(0, 0.0)
            comm.Barrier()
            with open(f"{folder}/walls.png", "rb") as file:
                pictures[name] = file.read()
            comm.Barrier()
            wrong = dict(centring=insitu.CELL)
            raises(ValueError, "patches[0].faces: has 3 elements, expected 4", s.set_field, "m", "f", numpy.ones(64),
                   patches=[insitu.Patch(values[:4], faces=numbers[:3])], **wrong)
            raises(ValueError, "patches[0].offsets: has 3 elements, expected 5", s.set_field, "m", "f", numpy.ones(64),
                   patches=[insitu.Patch(values[:4], connectivity=faces, offsets=numbers[:3])], **wrong)
            raises(ValueError, "patches[0]: has 3 components, its field has 1", s.set_field, "m", "f", numpy.ones(64),
                   patches=[insitu.Patch(xyz, faces=numbers)], **wrong)
            raises(TypeError, "made by a callable", s.set_field, "m", "f", lambda: values, patches=ways["range"], **wrong)
            raises(insitu.Error, "patch 0: has 16 faces from 239 on", s.set_field, "m", "f", numpy.ones(64),
                   patches=[insitu.Patch(values[::2], first_face=len(faces) - 1)], **wrong)
            s.set_field("m", "f", numpy.ones(64), centring=insitu.CELL)
    everywhere(pictures.pop("without") != pictures["range"], "the wall is seen")
    everywhere(len(set(pictures.values())) == 1, "the same picture in all ways")


def finite_elements_are_their_hexes():
    xyz, hexes, f = lattice()
    plain = picture("corners", lambda: xyz.copy(), lambda: hexes.copy(), lambda: f.copy())
    nodes = numpy.full((len(hexes), 27), -5, "i4")  # of second order, the corners first, as dolfinx has them
    nodes[:, :8] = hexes[:, [0, 1, 3, 2, 4, 5, 7, 6]]
    dofs = 2 * numpy.arange(len(xyz))[::-1].astype("i4")
    vector = numpy.full(2 * len(xyz), numpy.nan)
    vector[dofs] = f
    with insitu.Session(comm, scene_text=SCENE.format(name="nodes", folder=folder)) as s:
        s.set_mesh("m", coordinates=xyz, connectivity=nodes[:, :8], cell_type=insitu.HEX,
                   vertex_order=insitu.ORDER_LEXICOGRAPHIC)
        raises(ValueError, "index: has 124 elements, expected 125", s.set_field, "m", "f", vector, index=dofs[1:])
        raises(ValueError, "index: has 125 elements, expected 64", s.set_field, "m", "f", vector, index=dofs, centring=insitu.CELL)
        s.set_field("m", "f", vector, index=dofs.copy())
        s.step(0, 0.0)
        everywhere("field \"f\" by its index" in s.report["copied_why"], s.report["copied_why"])
        everywhere("in VTK's order" in s.report["copied_why"] and not s.report["warnings"], s.report["warnings"])
        dofs[3] = 250
        s.set_field("m", "f", vector, index=dofs)
        raises(insitu.Error, "the index of vertex 3 is 250, outside 0..249", s.step, 1, 0.0)
    if comm.rank == 0:
        with open(f"{folder}/nodes.png", "rb") as file:
            same = file.read() == plain
    everywhere(comm.rank != 0 or same, "nodes and a vector of unknowns draw the plain picture")


def hexes_with_values_at_corners_are_discontinuous():
    xyz, hexes, f = lattice()
    own = numpy.arange(len(hexes)) % 3 * 0.1
    at_corners = f[hexes] + own[:, None]
    doubled = picture("doubled", lambda: xyz[hexes].reshape(-1, 3), lambda: numpy.arange(512).reshape(64, 8),
                      lambda: at_corners.ravel().copy())
    dofs = numpy.full((64, 10), -1, "i4")  # of another order than the mesh: the vertices' come first
    dofs[:, :8] = numpy.arange(640)[::-1].reshape(64, 10)[:, :8]
    vector = numpy.full(640, numpy.nan)
    vector[dofs[:, :8]] = at_corners
    rows = numpy.full((64, 10), numpy.nan)
    rows[:, :8] = at_corners
    for values, named in [(at_corners.ravel(), {}), (vector, {"index": dofs[:, :8]}), (rows.ravel(), {"corner_row": 10}),
                          (vector, {"index": dofs.ravel()[:-2], "corner_row": 10})]:
        with insitu.Session(comm, scene_text=SCENE.format(name="discontinuous", folder=folder)) as s:
            s.set_mesh("m", coordinates=xyz, connectivity=hexes, cell_type=insitu.HEX)
            raises(ValueError, "index: has 7 columns, expected 8", s.set_field, "m", "f", vector, index=dofs[:, :7],
                   centring=insitu.CORNER)
            raises(ValueError, "index: has 500 elements, expected 512", s.set_field, "m", "f", vector,
                   index=dofs.ravel()[:500], centring=insitu.CORNER)
            s.set_field("m", "f", values, centring=insitu.CORNER, **named)
            s.step(0, 0.0)
            everywhere("vertices of each cell's own" in s.report["copied_why"], s.report["copied_why"])
        comm.Barrier()
        with open(f"{folder}/discontinuous.png", "rb") as file:
            everywhere(file.read() == doubled, f"{list(named)}: discontinuous hexes are those of doubled vertices")


def callables_are_asked_in_steps_that_need_them():
    xyz, hexes, f = lattice()
    plain = picture("given", lambda: xyz.copy(), lambda: hexes.copy(), lambda: f.copy())
    calls = []

    def make():
        calls.append(comm.allreduce(1))
        return f.copy()  # nobody but the session knows it

    scene = SCENE.format(name="asked", folder=folder).replace("    size:", "    every: 2\n    size:")
    with insitu.Session(comm, scene_text=scene) as s:
        s.set_mesh("m", coordinates=xyz, connectivity=hexes, cell_type=insitu.HEX)
        s.set_field("m", "f", make)
        for cycle in range(5):
            s.step(cycle, 0.0)
        everywhere(calls == 3 * [comm.size], f"{calls}")
        comm.Barrier()
        with open(f"{folder}/asked.png", "rb") as file:
            everywhere(file.read() == plain, "what a callable returns is drawn")
        s.set_field("m", "f", lambda: 1 / 0 if comm.rank == comm.size - 1 else f)
        error = raises(insitu.Error, "its fill returned", s.step, 6, 0.0)
        own = isinstance(error.__cause__, ZeroDivisionError)
        everywhere(own == (comm.rank == comm.size - 1) and error.on_all_ranks, "the cause is told where it is")
        told = f"rank {comm.size - 1}: ZeroDivisionError: division by zero"
        everywhere(own or str(error.__cause__) == told, f"and elsewhere: {error.__cause__}")
        for i, (name, call) in enumerate([
                ("set_mesh", lambda: s.set_mesh("m", coordinates=xyz, connectivity=hexes, cell_type=insitu.HEX)),
                ("set_mesh", lambda: s.remove_mesh("m")), ("set_field", lambda: s.set_field("m", "f", f.copy())),
                ("step", lambda: s.step(1, 0.0)), ("keep_pictures", lambda: s.keep_pictures()), ("destroy", s.close),
                ("parameter", lambda: s.parameter("a", 1)),
                ("last_pictures", lambda: s.pictures), ("last_report", lambda: s.report)]):
            s.set_field("m", "f", lambda call=call: (call(), f.copy())[1])
            error = raises(insitu.Error, f"its fill called insitu_{name}()", s.step, 12 + 4 * i, 0.0)
            cause = error.__cause__
            everywhere(isinstance(cause, insitu.Error) and cause.status == "INSITU_ERROR_ARGUMENT", f"{name}: {cause}")
            s.set_field("m", "f", lambda: f.copy())
            s.step(14 + 4 * i, 0.0)
        s.set_field("m", "f", lambda: f[:, None].repeat(2, axis=1))
        raises(insitu.Error, "2 components of 1", s.step, 8, 0.0)
        s.set_field("m", "f", lambda: f[:, None].repeat(2, axis=1), components=2)
        s.step(10, 0.0)


def borrowed_arrays_live_as_long_as_they_are_read_and_no_longer():
    """Weak references tell when an array is gone: never before a step that may read it has returned."""
    class Traced(numpy.ndarray):
        pass

    def traced(array):
        out = Traced(array.shape, array.dtype)  # which has the memory itself: views refer to it
        out[...] = array
        return out

    def is_alive(references):
        gc.collect()
        return [reference() is not None for reference in references]

    xyz, hexes, f = lattice()
    first, second = (tuple(map(traced, (xyz, hexes, f))) for _ in range(2))

    def make():
        out = traced(f)
        asked.append(weakref.ref(out))
        return out

    asked = []
    of_first, of_second = [weakref.ref(a) for a in first], [weakref.ref(a) for a in second]
    s = insitu.Session(comm, scene_text=SCENE.format(name="alive", folder=folder))
    s.set_mesh("m", coordinates=first[0], connectivity=first[1], cell_type=insitu.HEX)
    s.set_field("m", "f", first[2])
    del first
    s.step(0, 0.0)
    everywhere(all(is_alive(of_first)), "borrowed arrays stay after a step")
    s.set_mesh("m", coordinates=second[0], connectivity=second[1], cell_type=insitu.HEX)
    s.set_field("m", "f", second[2])
    del second
    everywhere(all(is_alive(of_first) + is_alive(of_second)), "and when others are set, until a step has returned")
    s.step(1, 0.0)
    everywhere(not any(is_alive(of_first)) and all(is_alive(of_second)), "then they go")
    s.set_field("m", "f", make)
    s.step(2, 0.0)
    everywhere(len(asked) == 1 and not any(is_alive(asked)), "what a callable made goes with its step")
    everywhere(is_alive(of_second) == [True, True, False], "and the field before it")
    s.close()
    everywhere(not any(is_alive(of_second)), "a closed session holds nothing")
    of_session = weakref.ref(s)
    del s
    everywhere(of_session() is None, "no circle of references is left to the collector")


def derived_fields_are_fields():
    """One that is made of what a callable makes is drawn as the field itself: 4 f / 2 - f is f to the bit."""
    xyz, hexes, f = lattice()
    asked = []

    def make():
        asked.append(comm.rank)
        return numpy.stack([f, 4 * f], axis=-1)

    with insitu.Session(comm, scene_text=SCENE.format(name="given", folder=folder)) as s:
        s.set_mesh("m", coordinates=xyz, connectivity=hexes, cell_type=insitu.HEX)
        s.set_field("m", "f", f)
        s.step(0, 0.0)
    scene = SCENE.replace("field: f", "field: g").format(name="derived", folder=folder) + "fields: {g: v.y / 2 - v.x}\n"
    with insitu.Session(comm, scene_text=scene) as s:
        s.set_mesh("m", coordinates=xyz, connectivity=hexes, cell_type=insitu.HEX)
        s.set_field("m", "v", make, components=2)
        s.step(0, 0.0)
        everywhere(asked == [comm.rank] and s.report["bytes_copied"] > 0, "the callable is asked once")
    if comm.rank == 0:
        pictures = [open(f"{folder}/{name}.png", "rb").read() for name in ("given", "derived")]
    everywhere(comm.rank > 0 or pictures[0] == pictures[1], "a derived field's picture is the field's")


def structures_are_those_of_the_header():
    with open(sys.argv[2]) as file:
        header = re.sub(r"/\*.*?\*/", "", file.read(), flags=re.S)
    for name, ours in [("array", insitu._Array), ("mesh", insitu._Mesh), ("lattice", insitu._Lattice),
                       ("field", insitu._Field), ("patch", insitu._Patch), ("report", insitu._Report),
                       ("picture", insitu._Picture)]:
        body = re.search(r"typedef struct insitu_%s \{(.*?)\}" % name, header, flags=re.S)[1]
        theirs = [re.search(r"(\w+)(\[\d+\])?$", each.strip())[1]
                  for line in body.split(";") for each in line.split(",") if each.strip()]
        everywhere(theirs == [field[0] for field in ours._fields_], f"insitu_{name}: {theirs}")


if comm.rank == 0:
    os.makedirs(folder, exist_ok=True)
comm.Barrier()
layouts_draw_the_same_picture()
components_and_indices_of_any_type_are_the_same()
planes_go_without_z()
what_cannot_be_borrowed_is_refused()
parameters_are_numbers()
blocks_are_their_hexes()
levels_are_their_hexes()
blocks_of_two_dimensions_are_their_quads()
wrong_blocks_are_refused()
pictures_are_arrays()
finite_volumes_are_their_hexes()
boundaries_have_values_of_their_own()
finite_elements_are_their_hexes()
hexes_with_values_at_corners_are_discontinuous()
callables_are_asked_in_steps_that_need_them()
derived_fields_are_fields()
borrowed_arrays_live_as_long_as_they_are_read_and_no_longer()
structures_are_those_of_the_header()
