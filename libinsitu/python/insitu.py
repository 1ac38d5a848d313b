"""libinsitu from Python: pictures of a running simulation, from its own unstructured cells.

    with insitu.Session(MPI.COMM_WORLD, "scene.yaml") as session:
        session.set_mesh("domain", coordinates=xyz, connectivity=hexes, cell_type=insitu.HEX)
        session.set_field("domain", "pressure", pressure)
        session.step(cycle, time)

Arrays are borrowed as they are, with their strides: nothing is copied here, and what cannot be borrowed is refused. A
session holds references to what it borrows until the mesh or field is set again and a step has returned, or until it is
closed. Errors are exceptions. insitu.h says more of each argument; docs/python.md is the page about this file.
"""

import collections
import ctypes
import math
import operator
import os
import re

import numpy
from mpi4py import MPI

TET, HEX, WEDGE, PYRAMID, POLYHEDRON = 10, 12, 13, 14, 42
TRIANGLE, POLYGON, QUAD = 5, 7, 9
QUADRATIC_TRIANGLE, QUADRATIC_QUAD, QUADRATIC_TET, QUADRATIC_HEX, QUADRATIC_WEDGE, QUADRATIC_PYRAMID = range(22, 28)
BIQUADRATIC_QUAD, TRIQUADRATIC_HEX, BIQUADRATIC_WEDGE = 28, 29, 32
LAGRANGE_TRIANGLE, LAGRANGE_QUAD, LAGRANGE_TET, LAGRANGE_HEX, LAGRANGE_WEDGE, LAGRANGE_PYRAMID = range(69, 75)
CHANGED_NOTHING, CHANGED_TOPOLOGY, CHANGED_GEOMETRY, CHANGED_VALUES, CHANGED_ALL = 0, 1, 2, 4, 7
VERTEX, CELL, CORNER = 0, 1, 2
ORDER_VTK, ORDER_LEXICOGRAPHIC, ORDER_DMPLEX, ORDER_VTK_BEFORE_9_1, ORDER_GMSH, ORDER_EXODUS = range(6)

_TYPES = {"float32": 1, "float64": 2, "int32": 3, "int64": 4, "uint8": 5, "bool": 5, "int8": 6,
          "int16": 7, "uint16": 8, "uint32": 9, "uint64": 10}
_CORNERS = {TET: 4, HEX: 8, WEDGE: 6, PYRAMID: 5, TRIANGLE: 3, QUAD: 4, QUADRATIC_TRIANGLE: 6, QUADRATIC_QUAD: 8,
            QUADRATIC_TET: 10, QUADRATIC_HEX: 20, QUADRATIC_WEDGE: 15, QUADRATIC_PYRAMID: 13, BIQUADRATIC_QUAD: 9,
            TRIQUADRATIC_HEX: 27, BIQUADRATIC_WEDGE: 18}
_MPI_Comm = ctypes.c_void_p if MPI._sizeof(MPI.Comm) == ctypes.sizeof(ctypes.c_void_p) else ctypes.c_int


class Error(RuntimeError):
    """A call that failed: status is its name, as in "INSITU_ERROR_MESH"; on_all_ranks says that every rank has it."""

    def __init__(self, status, message, on_all_ranks):
        super().__init__(message)
        self.status, self.on_all_ranks = status, on_all_ranks


class _Array(ctypes.Structure):
    _fields_ = [("data", ctypes.c_void_p), ("type", ctypes.c_int), ("stride_bytes", ctypes.c_int64)]


class _Lattice(ctypes.Structure):
    _fields_ = [
        ("cells", ctypes.c_int64 * 3),
        ("vertex_strides", ctypes.c_int64 * 3),
        ("cell_strides", ctypes.c_int64 * 3),
        ("interior_first", ctypes.c_int64 * 3),
        ("interior_end", ctypes.c_int64 * 3),
        ("origin", ctypes.c_double * 3),
        ("spacing", ctypes.c_double * 3),
        ("first", ctypes.c_int64 * 3),
        ("axes", _Array * 3),
        ("refinement", ctypes.c_int64 * 3),
    ]


class _Mesh(ctypes.Structure):
    _fields_ = [
        ("vertex_count", ctypes.c_int64),
        ("coordinates", _Array * 3),
        ("vertex_ids", _Array),
        ("cell_count", ctypes.c_int64),
        ("cell_type", ctypes.c_int),
        ("cell_types", _Array),
        ("connectivity_count", ctypes.c_int64),
        ("connectivity", _Array),
        ("offsets", _Array),
        ("face_count", ctypes.c_int64),
        ("face_offsets", _Array),
        ("face_connectivity_count", ctypes.c_int64),
        ("face_connectivity", _Array),
        ("ghosts", _Array),
        ("changed", ctypes.c_uint),
        ("index_base", ctypes.c_int),
        ("owner", _Array),
        ("neighbour_count", ctypes.c_int64),
        ("neighbour", _Array),
        ("face_sizes", _Array),
        ("face_lists", _Array),
        ("keep_polyhedra", ctypes.c_int),
        ("vertex_order", ctypes.c_int),
        ("connectivity_row", ctypes.c_int64),
        ("lattice", ctypes.POINTER(_Lattice)),
        ("boundary_face_count", ctypes.c_int64),
        ("boundary_face_offsets", _Array),
        ("boundary_face_connectivity_count", ctypes.c_int64),
        ("boundary_face_connectivity", _Array),
        ("boundary_owner", _Array),
        ("halo_cell_count", ctypes.c_int64),
        ("open_offsets", ctypes.c_int),
        ("cell_type_map_count", ctypes.c_int),
        ("cell_type_map", ctypes.POINTER(ctypes.c_int)),
        ("order", ctypes.c_int),
    ]


class _Patch(ctypes.Structure):
    _fields_ = [
        ("count", ctypes.c_int64),
        ("first_face", ctypes.c_int64),
        ("faces", _Array),
        ("connectivity_count", ctypes.c_int64),
        ("connectivity", _Array),
        ("offsets", _Array),
        ("values", _Array),
        ("component_stride_bytes", ctypes.c_int64),
    ]


class _Field(ctypes.Structure):
    pass


_Fill = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.POINTER(_Field))
_Field._fields_ = [
    ("name", ctypes.c_char_p),
    ("centring", ctypes.c_int),
    ("count", ctypes.c_int64),
    ("component_count", ctypes.c_int),
    ("component_stride_bytes", ctypes.c_int64),
    ("values", _Array),
    ("changed", ctypes.c_uint),
    ("index", _Array),
    ("corner_row", ctypes.c_int64),
    ("fill", _Fill),
    ("fill_data", ctypes.c_void_p),
    ("patch_count", ctypes.c_int),
    ("patches", ctypes.POINTER(_Patch)),
    ("components", ctypes.POINTER(_Array)),
]


class _Report(ctypes.Structure):
    _fields_ = [
        ("cycle", ctypes.c_int64),
        ("time", ctypes.c_double),
        ("images", ctypes.c_int),
        ("total_ms", ctypes.c_double),
        ("prepare_ms", ctypes.c_double),
        ("build_ms", ctypes.c_double),
        ("refit_ms", ctypes.c_double),
        ("surface_ms", ctypes.c_double),
        ("volume_ms", ctypes.c_double),
        ("composite_ms", ctypes.c_double),
        ("write_ms", ctypes.c_double),
        ("background_ms", ctypes.c_double),
        ("pictures_waiting", ctypes.c_int),
        ("turns", ctypes.c_int),
        ("cells", ctypes.c_int64),
        ("cells_ghost", ctypes.c_int64),
        ("cells_unusable", ctypes.c_int64),
        ("cells_inverted", ctypes.c_int64),
        ("cells_flat", ctypes.c_int64),
        ("cells_shell", ctypes.c_int64),
        ("cells_recognised", ctypes.c_int64),
        ("rays", ctypes.c_int64),
        ("fragments", ctypes.c_int64),
        ("bytes_sent", ctypes.c_int64),
        ("map_failures", ctypes.c_int64),
        ("bytes_borrowed", ctypes.c_int64),
        ("bytes_copied", ctypes.c_int64),
        ("bytes_trees", ctypes.c_int64),
        ("bytes_pictures", ctypes.c_int64),
        ("bytes_peak", ctypes.c_int64),
        ("schedule", ctypes.c_char_p),
        ("copied_why", ctypes.c_char_p),
        ("left_out", ctypes.c_char_p),
        ("warnings", ctypes.c_char_p),
        ("pieces", ctypes.c_char_p),
    ]


class _Picture(ctypes.Structure):
    _fields_ = [
        ("image", ctypes.c_char_p),
        ("width", ctypes.c_int),
        ("height", ctypes.c_int),
        ("rgba", ctypes.POINTER(ctypes.c_float)),
        ("depth", ctypes.POINTER(ctypes.c_float)),
    ]


# A cell field's values on faces of the boundary, as many tuples as faces. The faces are named by one of first_face (a
# range), faces (their numbers) and connectivity (their vertices: a list with offsets, or faces x vertices).
Patch = collections.namedtuple("Patch", "values first_face faces connectivity offsets", defaults=(0, None, None, None))

# image: its name in the scene; rgba: height x width x 4, linear and premultiplied; depth: height x width, inf: nothing.
Picture = collections.namedtuple("Picture", "image rgba depth")


def _load():
    """The library that stands beside this file or where the installation puts it, else where the loader looks."""
    folder = os.path.dirname(os.path.realpath(__file__))
    name = "libinsitu.so.0"
    paths = [os.path.join(folder, name), os.path.join(folder, "..", "..", name)]
    library = ctypes.CDLL(next((path for path in paths if os.path.exists(path)), name))
    pointer, text = ctypes.c_void_p, ctypes.c_char_p
    for call, result, arguments in [
        ("insitu_create", ctypes.c_int, [_MPI_Comm, text, ctypes.POINTER(pointer)]),
        ("insitu_create_from_text", ctypes.c_int, [_MPI_Comm, text, ctypes.POINTER(pointer)]),
        ("insitu_mesh_defaults", None, [ctypes.POINTER(_Mesh)]),
        ("insitu_field_defaults", None, [ctypes.POINTER(_Field)]),
        ("insitu_set_mesh", ctypes.c_int, [pointer, text, ctypes.POINTER(_Mesh)]),
        ("insitu_set_field", ctypes.c_int, [pointer, text, ctypes.POINTER(_Field)]),
        ("insitu_set_block", ctypes.c_int, [pointer, text, ctypes.c_int64, ctypes.POINTER(_Mesh)]),
        ("insitu_set_block_field", ctypes.c_int, [pointer, text, ctypes.c_int64, ctypes.POINTER(_Field)]),
        ("insitu_step", ctypes.c_int, [pointer, ctypes.c_int64, ctypes.c_double]),
        ("insitu_last_report", ctypes.POINTER(_Report), [pointer]),
        ("insitu_parameter", ctypes.c_int, [pointer, text, ctypes.POINTER(ctypes.c_double)]),
        ("insitu_keep_pictures", ctypes.c_int, [pointer, ctypes.c_int]),
        ("insitu_last_pictures", ctypes.POINTER(_Picture), [pointer, ctypes.POINTER(ctypes.c_int)]),
        ("insitu_error", text, [pointer]),
        ("insitu_destroy", ctypes.c_int, [ctypes.POINTER(pointer)]),
        ("insitu_status_name", text, [ctypes.c_int]),
    ]:
        function = getattr(library, call)
        function.restype, function.argtypes = result, arguments
    return library


_library = _load()


def _check(status, session, on_all_ranks):
    if status != 0:
        message = _library.insitu_error(session).decode(errors="replace")
        name = _library.insitu_status_name(status).decode()
        raise Error(name, message or name, on_all_ranks)


def _encoded(what, text):
    """A text of C's, which ends at its first character 0."""
    encoded = os.fsencode(text)
    if b"\0" in encoded:
        raise ValueError(f"{what}: {text!r} holds a character 0, expected none")
    return encoded


def _constant(what, given, names):
    """One of this file's numbers, which a word is not."""
    if isinstance(given, str):
        raise TypeError(f"{what}: is {given!r}, expected {names}")
    return given


def _view(what, given, dimensions):
    """The caller's array, or a view of its memory. Lists and the like would be copied: they are refused."""
    is_array = isinstance(given, numpy.ndarray) or hasattr(given, "__array_interface__")
    if isinstance(given, numpy.ma.MaskedArray) or not (is_array or isinstance(given, memoryview)):
        raise TypeError(f"{what}: a {type(given).__name__} cannot be borrowed, expected a numpy array")
    array = numpy.asarray(given)
    if array.ndim not in dimensions:
        hint = "; reshape(-1) makes a list of a C-contiguous array, and no copy" if array.ndim > max(dimensions) else ""
        raise ValueError(f"{what}: has {array.ndim} dimensions, expected {' or '.join(map(str, dimensions))}{hint}")
    if array.dtype.name not in _TYPES or not array.dtype.isnative:
        raise TypeError(f"{what}: is of type {array.dtype}, expected one of {', '.join(_TYPES)}, native")
    return array


def _strided(what, array, stride):
    """An array of the C interface; stride: bytes from one element to the next."""
    if array.size < 2:
        stride = 0  # numpy's stride of so few elements means nothing
    elif stride == 0:
        raise ValueError(f"{what}: repeats one element (a stride of 0), expected an array with memory of its own")
    return _Array(array.ctypes.data if array.size else _nothing.ctypes.data, _TYPES[array.dtype.name], stride)


_nothing = numpy.zeros(1)  # Where arrays without elements point: to be given, an array must have an address.


def _list(what, given):
    array = _view(what, given, (1,))
    return _strided(what, array, array.strides[0]), array.size, array


def _rows(what, given):
    """A list, or rows of equal length that follow one another as a list would."""
    array = _view(what, given, (1, 2))
    if array.ndim == 2 and array.shape[0] > 1 and array.strides[0] != array.shape[1] * array.strides[1]:
        raise ValueError(f"{what}: there are gaps between its rows, or they are columns; expected rows that follow one another")
    return _strided(what, array, array.strides[-1]), array.size, array


def _lists(what, given):
    """A list of arrays, one a face: tables of their lengths and addresses, and what keeps both alive."""
    arrays = [_view(f"{what}[{i}]", one, (1,)) for i, one in enumerate(given)]
    for i, array in enumerate(arrays):
        if array.dtype != arrays[0].dtype or (array.size > 1 and array.strides[0] != array.itemsize):
            raise ValueError(f"{what}[{i}]: is strided, or of another type than the first, expected packed arrays of one type")
    sizes = numpy.array([array.size for array in arrays], numpy.int64)
    addresses = numpy.array([array.ctypes.data for array in arrays], numpy.uintp)
    kind = _TYPES[arrays[0].dtype.name] if arrays else 4
    table = _Array(addresses.ctypes.data if arrays else _nothing.ctypes.data, kind, 0)
    return _list(what, sizes)[0], table, [arrays, sizes, addresses]


def _row(array):
    """Elements from one row's first to the next one's, where there are others between; else 0."""
    if array.ndim != 2 or array.shape[0] < 2 or array.strides[1] == 0 or array.strides[0] % array.strides[1] != 0:
        return 0
    row = array.strides[0] // array.strides[1]
    return row if row > array.shape[1] else 0


def _nodes(cell_type, order, columns):
    """How many nodes a cell of the type has; of Lagrange cells without an order, the table's columns. None: any."""
    if not LAGRANGE_TRIANGLE <= cell_type <= LAGRANGE_PYRAMID:
        return _CORNERS.get(cell_type)
    if not order:
        return columns
    n = order + 1
    return [n * (n + 1) // 2, n * n, n * (n + 1) * (n + 2) // 6, n ** 3, n * n * (n + 1) // 2,
            n * (n + 1) * (2 * n + 1) // 6][cell_type - LAGRANGE_TRIANGLE]


def _connectivity(given, nodes, may_have_gaps):
    """A list, or rows; of cells of one type also some first columns of a table. Returns the row and the cells too."""
    array = _view("connectivity", given, (1, 2))
    if may_have_gaps and array.ndim == 2 and nodes not in (None, array.shape[1]):
        raise ValueError(f"connectivity: has {array.shape[1]} columns, expected {nodes} for this cell_type")
    row = _row(array) if may_have_gaps else 0
    if not row:
        return *_rows("connectivity", given)[:2], row, array.size // (nodes or 1), array
    count = (array.shape[0] - 1) * row + array.shape[1]
    return _strided("connectivity", array, array.strides[1]), count, row, array.shape[0], array


def _axes(given):
    """Coordinates: vertices x 3, or one array each of x, y and z. Without z, which is 0 then, vertices x 2, or x and y."""
    if isinstance(given, (tuple, list)):
        axes = [_list(f"coordinates[{i}]", axis) for i, axis in enumerate(given)]
    else:
        array = _view("coordinates", given, (2,))
        axes = [_list("coordinates", array[:, i]) for i in range(array.shape[1])]
    if len(axes) not in (2, 3) or len({size for _, size, _ in axes}) != 1:
        raise ValueError("coordinates: expected vertices x 3 (or x 2), or x, y and z (or x and y) of equal length")
    arrays = [array for array, _, _ in axes] + [_Array()] * (3 - len(axes))
    return arrays, axes[0][1], [held for _, _, held in axes]


def _numbers(what, given, count, convert, rest=0):
    """Three numbers, of which an array of two dimensions may lack the third: then it is the rest."""
    counts = " or ".join(map(str, sorted({count, 3})))
    if numpy.ndim(given) != 1:
        raise TypeError(f"{what}: is {given!r}, expected {counts} numbers")
    numbers = tuple(convert(n) for n in given)
    if len(numbers) not in (count, 3):
        raise ValueError(f"{what}: has {len(numbers)} numbers, expected {counts}")
    for n in numbers:
        if not -2**63 <= n < 2**63 and convert is operator.index:
            raise ValueError(f"{what}: has the number {n}, expected whole numbers of 64 bits")
    return numbers + (rest,) * (3 - len(numbers))


class _Block:
    """How the arrays of a structured block lie. Pairs are of its vertices and its cells, in the order of VERTEX and CELL.
    Strides are whole numbers without a common divisor, so that arrays of any element types and any numbers of components
    have the same ones; the first array decides on them."""

    def __init__(self, name, cells):
        if min(cells) < 0 or (0 in cells and any(cells)):
            raise ValueError(f"cells: are {cells}, expected numbers of at least 1, or all 0 without cells")
        if math.prod(cells) > 4294967294:
            raise ValueError(f"cells: {cells} are too many, expected at most 4294967294 in all")
        self.name, self.is_empty = name, not any(cells)
        self.extents = tuple(n + (not self.is_empty) for n in cells), cells
        self.strides = [None, None]

    def strides_of(self, of):
        """The strides; if no array has decided on them, those of packed arrays [i, j, k]."""
        if self.strides[of] is None:
            extents = self.extents[of]
            self.strides[of] = tuple(math.prod(extents[axis + 1:]) for axis in range(len(extents)))
        return self.strides[of]

    def count(self, of):
        """The length of arrays, from the first to the last element of the block."""
        if self.is_empty:
            return 0
        return 1 + sum((n - 1) * stride for n, stride in zip(self.extents[of], self.strides_of(of)))

    def borrow(self, what, given, of, may_have_components=False):
        """The caller's array of values at the vertices or in the cells: the array of the C interface, the number of
        components and their stride in bytes, and what is borrowed. It is [i, j, k], with components before or after, or
        a list as long as the block's arrays."""
        extents = self.extents[of]
        rank = len(extents)
        array = _view(what, given, (1, rank, rank + 1) if may_have_components else (1, rank))
        if array.ndim == 1:
            return self._list(what, array, of), 1, 0, array
        before = 0 if array.ndim == rank or array.shape[:rank] == extents else 1
        after = array.ndim - rank - before
        shape = array.shape[before:array.ndim - after]
        apart = (array.shape[:before] + array.shape[array.ndim - after:] + (1,))[0]
        step = (array.strides[:before] + array.strides[array.ndim - after:] + (0,))[0] if apart > 1 else 0
        if self.is_empty:
            return _strided(what, array.reshape(-1)[:0], 0), apart, 0, array
        if shape != extents:
            raise ValueError(f"{what}: has the shape {array.shape}, expected {self._shapes(of, may_have_components)}")
        if apart > 1 and step == 0:
            raise ValueError(f"{what}: repeats one element (a stride of 0), expected an array with memory of its own")
        unit = self._fit(what, of, array.strides[before:array.ndim - after], array.itemsize)
        return _Array(array.ctypes.data, _TYPES[array.dtype.name], unit), apart, step, array

    def _shapes(self, of, may_have_components):
        text = f"{self.extents[of]}" + (", with components before or after," if may_have_components else "")
        return f"{text} for the {('vertices', 'cells')[of]} of block \"{self.name}\""

    def _list(self, what, array, of):
        if array.size != self.count(of):
            raise ValueError(f"{what}: is a list of {array.size}, expected one of {self.count(of)}, or the shape "
                             f"{self._shapes(of, False)}")
        return _strided(what, array, array.strides[0])

    def _fit(self, what, of, steps, itemsize):
        """The common divisor of the steps, in bytes. Along an axis with one index a step means nothing."""
        used = [step for step, n in zip(steps, self.extents[of]) if n > 1]
        if min(used, default=1) <= 0:
            raise ValueError(f"{what}: has strides of {steps} bytes, expected positive ones: it runs backwards or repeats "
                             "elements")
        unit = math.gcd(*used) or itemsize
        if unit % itemsize:
            raise ValueError(f"{what}: has strides of {steps} bytes, expected multiples of its elements' {itemsize}")
        strides = tuple(step // unit if n > 1 else 1 for step, n in zip(steps, self.extents[of]))
        if self.strides[of] is None:
            self.strides[of] = strides
        expected = self.strides[of]
        if any(n > 1 and a != b for a, b, n in zip(strides, expected, self.extents[of])):
            thing = ("vertices", "cells")[of]
            raise ValueError(f"{what}: has strides of {steps} bytes, which are as {strides}, expected as {expected}: all "
                             f"arrays of the {thing} of block \"{self.name}\" have one order and padding (set_block's "
                             f"{('vertex_layout', 'cell_layout')[of]} says which)")
        return unit


def _put_places(lattice, rank, spacing, origin, first):
    """Gives a uniform block its coordinates."""
    if spacing is None and (origin is not None or first is not None):
        raise TypeError("spacing: is not given, and origin or first is; expected it for a uniform block")
    if spacing is not None:
        lattice.spacing[:] = _numbers("spacing", spacing, rank, float, 0.0)
        lattice.origin[:] = _numbers("origin", (0, 0, 0) if origin is None else origin, rank, float, 0.0)
        lattice.first[:] = _numbers("first", (0, 0, 0) if first is None else first, rank, operator.index)


def _put_interior(lattice, rank, first, end):
    if (first is None) != (end is None):
        raise TypeError("interior_first, interior_end: one is given, expected both or none")
    if first is not None:
        lattice.interior_first[:] = _numbers("interior_first", first, rank, operator.index)
        lattice.interior_end[:] = _numbers("interior_end", end, rank, operator.index, 1)
        if not any(lattice.interior_first) and not any(lattice.interior_end):  # all 0 would mean all cells to C
            lattice.interior_first[0] = lattice.interior_end[0] = 1


def _put_coordinates(block, given, mesh, lattice):
    """Gives a block its coordinates along the axes or at the vertices; returns what is borrowed."""
    rank = len(block.extents[CELL])
    if isinstance(given, (tuple, list)) and all(numpy.ndim(axis) == 1 for axis in given):
        axes = [_list(f"coordinates[{i}]", axis) for i, axis in enumerate(given)]
        if len(axes) not in (rank, 3):
            raise ValueError(f"coordinates: are along {len(axes)} axes, expected {rank}")
        for i, (n, (_, size, _)) in enumerate(zip(block.extents[VERTEX] + (1,), axes)):
            if size != n and not block.is_empty:
                raise ValueError(f"coordinates[{i}]: has {size} elements, expected {n}, one more than there are cells")
        lattice.axes[:len(axes)] = [array for array, _, _ in axes]
        return [held for _, _, held in axes]
    if isinstance(given, (tuple, list)):
        made = [block.borrow(f"coordinates[{i}]", axis, VERTEX) for i, axis in enumerate(given)]
        axes, held = [array for array, _, _, _ in made], [held for _, _, _, held in made]
    else:
        array, count, step, held = block.borrow("coordinates", given, VERTEX, True)
        axes = [_Array((array.data or 0) + i * step, array.type, array.stride_bytes) for i in range(count)]
    if len(axes) != 3:
        raise ValueError(f"coordinates: are {len(axes)} for each vertex, expected x, y and z")
    mesh.coordinates[:] = axes
    return [held]


def _put_components(field, given, block):
    """Values of a component each, in arrays of their own: any types and strides."""
    arrays, held = [], []
    for i, one in enumerate(given):
        part = _Field(centring=field.centring)
        held.append(_put_values(part, one, block))
        if part.component_count != 1:
            raise ValueError(f"values[{i}]: has {part.component_count} components, expected 1")
        if i and part.count != field.count:
            raise ValueError(f"values[{i}]: has {part.count} values, values[0] has {field.count}")
        field.count = part.count
        arrays.append(part.values)
    table = (_Array * len(arrays))(*arrays)
    field.component_count, field.components, field.values = len(arrays), table, _Array()
    return [table, held]


def _put_values(field, given, block=None):
    if isinstance(given, (tuple, list)) and given and all(isinstance(one, numpy.ndarray) for one in given):
        return _put_components(field, given, block)
    if block is not None and field.centring in (VERTEX, CELL):
        field.count = block.count(field.centring)
        field.values, field.component_count, field.component_stride_bytes, array = block.borrow(
            "values", given, field.centring, True)
        return array
    array = _view("values", given, (1, 2))
    field.count, field.component_count, field.component_stride_bytes = array.shape[0], 1, 0
    if array.ndim == 2:
        field.component_count = array.shape[1]
        if array.shape[1] > 1:
            field.component_stride_bytes = _strided("values", array[:1], array.strides[1]).stride_bytes
    field.values = _strided("values", array, array.strides[0] if array.shape[0] > 1 else -1)
    if array.shape[0] < 2:
        field.values.stride_bytes = 0
    return array


def _patch(what, given, components):
    """A patch of the C interface, and what it borrows."""
    out, field = _Patch(first_face=given.first_face), _Field()
    held = [_put_values(field, given.values)]
    if field.component_count != components:
        raise ValueError(f"{what}: has {field.component_count} components, its field has {components}")
    out.count, out.values, out.component_stride_bytes = field.count, field.values, field.component_stride_bytes
    for name, expected in ("faces", out.count), ("offsets", out.count + 1):
        if getattr(given, name) is not None:
            array, size, borrowed = _list(f"{what}.{name}", getattr(given, name))
            if size != expected:
                raise ValueError(f"{what}.{name}: has {size} elements, expected {expected}")
            setattr(out, name, array)
            held.append(borrowed)
    if given.connectivity is not None:
        out.connectivity, out.connectivity_count, array = _rows(f"{what}.connectivity", given.connectivity)
        held.append(array)
    return out, held


def _patches(field, given):
    """The table of a field's patches, and what it borrows."""
    made = [_patch(f"patches[{i}]", one, field.component_count) for i, one in enumerate(given)]
    table = (_Patch * max(len(made), 1))(*[patch for patch, _ in made])
    field.patch_count, field.patches = len(made), table
    return [table, *(held for _, held in made)]


def _fill_by(make, index, row, block, made, raised, running):
    """A C function that has make() give the values. made: holds them until the step is over; raised: what went wrong;
    running: holds something while make() runs."""
    def fill(_, field):
        running.append(make)
        try:
            made.append(_put_values(field.contents, make(), block))
            field.contents.index, field.contents.corner_row = index, row
            return 0
        except BaseException as error:  # C must not be passed by
            raised.append(error)
            return 8  # INSITU_ERROR_INTERNAL
        finally:
            running.pop()
    return _Fill(fill)


_MESH_CALLS = _library.insitu_set_mesh, _library.insitu_set_block  # of a whole mesh, and of a block
_FIELD_CALLS = _library.insitu_set_field, _library.insitu_set_block_field


class Session:
    """A session. Opening and closing it and step() are collective: every rank of the communicator calls them."""

    def __init__(self, comm, scene=None, *, scene_text=None):
        """scene: the path of a scene file; scene_text: a scene's YAML itself. Rank 0's counts."""
        if scene is not None and scene_text is not None:
            raise TypeError("scene, scene_text: both are given, expected one of them")
        self._session = ctypes.c_void_p()
        # Of each part: (mesh, None) if it is whole, or (mesh, a block's number).
        self._counts = {}  # its vertices, cells and corners, and the vertices of a cell
        self._blocks = {}  # its _Block, if it is one
        self._held = {}  # {None: what the part borrows, field: what that borrows}
        self._numbers = {}  # mesh: the numbers of its parts
        self._retired = []  # borrowed before it was set again: until a step has returned
        self._made = []  # by callables: until the step has returned
        self._raised = []  # by callables, in this step
        self._comm = comm
        self._running = []  # the callable that runs: what the step borrows stays then, and calls are refused
        create = _library.insitu_create if scene_text is None else _library.insitu_create_from_text
        text = scene_text if scene_text is not None else scene
        text = _encoded("scene", text) if text is not None else None
        handle = _MPI_Comm.from_address(MPI._addressof(comm))
        _check(create(handle, text, ctypes.byref(self._session)), None, True)

    def set_mesh(self, name, *, coordinates, connectivity=None, cell_type=TET, cell_types=None, offsets=None, faces=None,
                 face_offsets=None, owner=None, neighbour=None, cell_count=None, ghosts=None, vertex_ids=None, index_base=0,
                 keep_polyhedra=False, vertex_order=ORDER_VTK, changed=CHANGED_ALL, boundary_faces=None,
                 boundary_face_offsets=None, boundary_owner=None, halo_cell_count=0, open_offsets=False,
                 cell_type_map=None, number=None, order=0):
        """Hand over this rank's part of a mesh, or, with a number from 0 on, one of the blocks that it consists of. Local. faces: the faces' vertices (face_connectivity of insitu.h),
        or a list of arrays, one a face, without face_offsets. For cells of one type, connectivity may be the first
        columns of a table: nodes[:, :8]. Finite-volume codes may give owner, neighbour and cell_count instead of
        connectivity, cell_type, cell_types and offsets; boundary_faces, boundary_face_offsets and boundary_owner, if
        the boundary's faces are in a list of their own, and halo_cell_count, if owner and neighbour name cells of a
        halo. open_offsets: offsets and face_offsets have no last entry. cell_type_map: the types of the numbers in
        cell_types, where these are the code's own: a list, 0 for numbers that are no type. Lagrange cells have the order
        that the table's columns tell, or order; with order, and without connectivity, coordinates are the cells' nodes,
        one cell after the other."""
        _constant("cell_type", cell_type, "insitu.TET, insitu.HEX and so on")
        _constant("vertex_order", vertex_order, "insitu.ORDER_VTK, insitu.ORDER_LEXICOGRAPHIC and so on")
        mesh, held = _Mesh(), []
        _library.insitu_mesh_defaults(ctypes.byref(mesh))
        axes, mesh.vertex_count, held = _axes(coordinates)
        mesh.coordinates[:] = axes
        if (connectivity is None) == (owner is None) and not (order and owner is None):
            raise TypeError("connectivity, owner: expected one of them")
        is_uniform = cell_types is None and offsets is None
        columns = numpy.shape(connectivity)[1] if numpy.ndim(connectivity) == 2 else None
        size = _nodes(cell_type, order, columns) if is_uniform and owner is None else None
        cells = mesh.vertex_count // (size or 1) if connectivity is None else 0
        if (cell_count is None) != (owner is None):
            raise TypeError("owner, cell_count: one is given, expected both or none")
        if connectivity is not None:
            mesh.connectivity, mesh.connectivity_count, mesh.connectivity_row, cells, array = _connectivity(
                connectivity, size, is_uniform)
            held.append(array)
        mesh.cell_type, mesh.changed = cell_type if owner is None else POLYHEDRON, changed
        mesh.index_base, mesh.keep_polyhedra, mesh.vertex_order = index_base, keep_polyhedra, vertex_order
        mesh.order = order
        counts = {}
        for key, given in [("cell_types", cell_types), ("offsets", offsets), ("face_offsets", face_offsets),
                           ("owner", owner), ("neighbour", neighbour), ("ghosts", ghosts), ("vertex_ids", vertex_ids),
                           ("boundary_face_offsets", boundary_face_offsets), ("boundary_owner", boundary_owner)]:
            if given is not None:
                borrowed, counts[key], array = _list(key, given)
                setattr(mesh, key, borrowed)
                held.append(array)
        mesh.open_offsets = 1 if open_offsets else 0
        for key in ("offsets", "face_offsets"):
            if open_offsets and key in counts:
                counts[key] += 1  # as if the last entry were there
        mesh.face_count = max(counts.get("face_offsets", 0) - 1, 0)
        if cell_type_map is not None:
            types = (ctypes.c_int * max(len(cell_type_map), 1))(*cell_type_map)
            mesh.cell_type_map_count, mesh.cell_type_map = len(cell_type_map), types
            held.append(types)
        if isinstance(faces, (list, tuple)):
            mesh.face_count = len(faces)
            mesh.face_sizes, mesh.face_lists, arrays = _lists("faces", faces)
            held.append(arrays)
        elif faces is not None:
            mesh.face_connectivity, mesh.face_connectivity_count, array = _rows("faces", faces)
            held.append(array)
        if boundary_faces is not None:
            mesh.boundary_face_connectivity, mesh.boundary_face_connectivity_count, array = _rows("boundary_faces",
                                                                                                  boundary_faces)
            held.append(array)
        mesh.boundary_face_count, mesh.halo_cell_count = counts.get("boundary_owner", 0), halo_cell_count
        mesh.neighbour_count = counts.get("neighbour", 0)
        mesh.cell_count = self._cell_count(counts, cells) if cell_count is None else cell_count
        self._expect_counts(mesh, counts)
        self._hand_over(_MESH_CALLS, name, number, mesh, None, held)
        size = size or 0
        corners = mesh.cell_count * size if size else mesh.connectivity_count
        self._take_place(name, number)
        self._counts[name, number] = mesh.vertex_count, mesh.cell_count, corners, size
        self._blocks.pop((name, number), None)

    def set_block(self, name, cells, *, spacing=None, origin=None, first=None, coordinates=None, interior_first=None,
                  interior_end=None, ghosts=None, vertex_ids=None, vertex_layout=None, cell_layout=None,
                  refinement=None, number=None, changed=CHANGED_ALL):
        """Hand over this rank's part of a mesh as a structured block of so many cells along i, j and k, or along i and j:
        then they are quads. With a number from 0 on it is one of several blocks of the mesh. Local. All arrays are [i, j, k], in any order and with any padding, in one of the vertices
        and in one of the cells. docs/structured.md is the page about blocks.

        Uniform: spacing and origin (0 by default), of the whole lattice, in which the block's first vertex has the indices
        first. Rectilinear: coordinates=(x, y, z), lists along the axes. Curvilinear: coordinates=(x, y, z), arrays, or
        one array with components x, y, z. Cells from interior_first to interior_end - 1 are drawn, the others are ghost
        layers. refinement: how many of its cells make one of the coarsest level along each axis; cells that finer blocks of
        the mesh cover are not drawn. vertex_layout, cell_layout: any arrays that lie as those of later fields do; without them, and where no
        other array is given, fields are packed with k fastest."""
        mesh, lattice, held = _Mesh(), _Lattice(), []
        _library.insitu_mesh_defaults(ctypes.byref(mesh))
        lattice.cells[:] = _numbers("cells", cells, 2, operator.index)
        cells = tuple(map(operator.index, cells))
        block = _Block(name, cells)
        rank = len(cells)
        if (spacing is None) == (coordinates is None):
            raise TypeError("spacing, coordinates: expected one of them")
        _put_places(lattice, rank, spacing, origin, first if spacing is not None or refinement is None else None)
        _put_interior(lattice, rank, interior_first, interior_end)
        if refinement is not None:
            lattice.refinement[:] = _numbers("refinement", refinement, rank, operator.index, 1)
            lattice.first[:] = _numbers("first", (0, 0, 0) if first is None else first, rank, operator.index)
        for what, given, of in ("vertex_layout", vertex_layout, VERTEX), ("cell_layout", cell_layout, CELL):
            if given is not None:
                block.borrow(what, given, of, True)
        if coordinates is not None:
            held += _put_coordinates(block, coordinates, mesh, lattice)
        for key, given, of in ("vertex_ids", vertex_ids, VERTEX), ("ghosts", ghosts, CELL):
            if given is not None:
                borrowed, _, _, array = block.borrow(key, given, of)
                setattr(mesh, key, borrowed)
                held.append(array)
        for of, strides in (VERTEX, lattice.vertex_strides), (CELL, lattice.cell_strides):
            strides[:] = block.strides_of(of) + (1,) * (3 - rank)
        mesh.vertex_count, mesh.cell_count, mesh.changed = block.count(VERTEX), block.count(CELL), changed
        mesh.lattice = ctypes.pointer(lattice)
        self._hand_over(_MESH_CALLS, name, number, mesh, None, held)
        self._take_place(name, number)
        self._counts[name, number] = mesh.vertex_count, mesh.cell_count, 0, 0
        self._blocks[name, number] = block

    def remove_mesh(self, name, *, number=None):
        """Take this rank's part of a mesh away, or the block of that number, and its fields. Local."""
        text = _encoded("name", name)
        if number is None:
            _check(_library.insitu_set_mesh(self._open(), text, None), self._session, False)
        else:
            _check(_library.insitu_set_block(self._open(), text, number, None), self._session, False)
        for part in list(self._numbers.get(name, ())) if number is None else [number]:
            self._drop(name, part)

    def _drop(self, name, number):
        self._retired.append(self._held.pop((name, number), None))
        self._blocks.pop((name, number), None)
        self._counts.pop((name, number), None)
        self._numbers.get(name, set()).discard(number)

    def _take_place(self, name, number):
        """A mesh is whole or of blocks: the other is gone."""
        numbers = self._numbers.setdefault(name, set())
        if number is None or None in numbers:
            for other in [other for other in numbers if other != number]:
                self._drop(name, other)
        numbers.add(number)

    def set_field(self, mesh, name, values, *, index=None, centring=VERTEX, corner_row=0, components=1,
                  patches=(), number=None, changed=CHANGED_ALL):
        """Hand over this rank's part of a field, or of that on the block of this number: values of n tuples, or n x components, or a list of arrays, one for each
        component, of any types; on a block [i, j, k], or with
        components before or after. index: the tuple that each vertex, cell or corner has, from the mesh's index_base on; for corners it may be the first columns of a table:
        dofs[:, :8]. corner_row, for corners: values (or entries of index) from one cell's first to the next one's.
        patches, for cells: the values on the boundary, each a Patch.

        values may be a callable that returns them, with so many components: the steps that need the field call it, on
        all ranks in the same order. Local."""
        field, held, borrowed = _Field(), [], _Array()
        _library.insitu_field_defaults(ctypes.byref(field))
        field.centring = _constant("centring", centring, "insitu.VERTEX, insitu.CELL or insitu.CORNER")
        field.name, field.changed = _encoded("name", name), changed
        if index is not None:
            borrowed, _, corner_row, array = self._index((mesh, number), index, centring, corner_row)
            held.append(array)
        block = None if index is not None else self._blocks.get((mesh, number))
        if callable(values):
            if len(patches) > 0:
                raise TypeError("patches: are given, and values are made by a callable; expected an array of values")
            field.fill = _fill_by(values, borrowed, corner_row, block, self._made, self._raised, self._running)
            field.component_count = components
            held.append(field.fill)
        else:
            held.append(_put_values(field, values, block))
            field.index = borrowed
            held.append(_patches(field, patches))
        field.corner_row = corner_row
        self._hand_over(_FIELD_CALLS, mesh, number, field, name, held)

    def step(self, cycle, time):
        """Draw the images that are due. Collective; after an error, which every rank gets, the session stays usable."""
        if not -2**63 <= operator.index(cycle) < 2**63:
            raise ValueError(f"cycle: is {cycle}, expected a whole number of 64 bits")
        status = _library.insitu_step(self._open(), cycle, time)
        self._refuse_if_running()
        self._retired.clear()
        self._made.clear()
        raised = self._raised[0] if self._raised else None
        self._raised.clear()
        try:
            _check(status, self._session, True)
        except Error as error:
            elsewhere = self._raised_elsewhere(str(error), raised)
            raise error from raised or elsewhere

    @property
    def report(self):
        """The report of the last step, as a dict with the keys of insitu_report."""
        report = _library.insitu_last_report(self._open()).contents
        self._refuse_if_running()
        values = {key: getattr(report, key) for key, _ in _Report._fields_}
        return {key: (value or b"").decode(errors="replace") if kind is ctypes.c_char_p else value
                for (key, kind), value in zip(_Report._fields_, values.values())}

    def parameter(self, name, default=None):
        """A number of the scene's `parameters`, the same on all ranks; an edit of the scene changes it in a step. Where the
        scene has none of this name, default, or without one Error. Local."""
        value = ctypes.c_double()
        status = _library.insitu_parameter(self._open(), _encoded("name", name), ctypes.byref(value))
        self._refuse_if_running()
        if status == 1 and default is not None:  # INSITU_ERROR_ARGUMENT
            return default
        _check(status, self._session, False)
        return value.value

    def keep_pictures(self, keep=True):
        """Turn on or off that rank 0 keeps each step's pictures in memory. Collective; rank 0's keep counts."""
        _check(_library.insitu_keep_pictures(self._open(), bool(keep)), self._session, True)

    @property
    def pictures(self):
        """The last step's pictures, a list of Picture: copies, which stay. Empty on other ranks, or where none are kept."""
        count = ctypes.c_int()
        kept = _library.insitu_last_pictures(self._open(), ctypes.byref(count))
        self._refuse_if_running()
        return [Picture(kept[i].image.decode(),
                        numpy.ctypeslib.as_array(kept[i].rgba, (kept[i].height, kept[i].width, 4)).copy(),
                        numpy.ctypeslib.as_array(kept[i].depth, (kept[i].height, kept[i].width)).copy())
                for i in range(count.value)]

    def close(self):
        """End the session and let go of what it borrowed; pictures that wait are written first, and Error is raised where
        one could not be. Collective. A closed session may be closed again."""
        status = _library.insitu_destroy(ctypes.byref(self._session)) if self._session else 0
        self._refuse_if_running()
        self._held.clear()
        self._retired.clear()
        _check(status, None, True)

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        # Where an exception is this rank's alone, the others are not closing theirs, and this one would wait for them.
        if error is None or getattr(error, "on_all_ranks", False):
            self.close()

    def _raised_elsewhere(self, message, raised):
        """What a callable raised on the rank that the message names, which all ranks have."""
        named = re.match(r"rank (\d+): .*: its fill (returned 8 |called insitu_)", message, re.DOTALL)
        if not named:
            return None
        words = self._comm.bcast(f"{type(raised).__name__}: {raised}" if raised else None, int(named[1]))
        return RuntimeError(f"rank {named[1]}: {words}") if words else None

    def _open(self):
        if not self._session:
            raise ValueError("the session is closed")
        return self._session

    def _refuse_if_running(self):
        """A callable has called the session, and the library has refused it, in words: not one that all ranks have."""
        if self._running:
            _check(1, self._session, False)  # INSITU_ERROR_ARGUMENT

    def _hand_over(self, calls, mesh, number, description, key, arrays):
        """Those borrowed before are held until a step has returned, or with these if the call is refused."""
        mesh_name = _encoded("mesh", mesh)
        fields = self._held.setdefault((mesh, number), {})
        before = fields.get(key, [])
        fields[key] = before + arrays
        if number is None:
            status = calls[0](self._open(), mesh_name, ctypes.byref(description))
        else:
            status = calls[1](self._open(), mesh_name, operator.index(number), ctypes.byref(description))
        _check(status, self._session, False)
        self._retired.append(before)
        fields[key] = arrays

    def _index(self, part, given, centring, row):
        """The index of a field, its length, and its row where it is of corners and has gaps."""
        counts, block = self._counts.get(part), self._blocks.get(part)
        if block is not None and centring in (VERTEX, CELL):
            borrowed, _, _, array = block.borrow("index", given, centring)
            return borrowed, None, row, array
        if centring != CORNER or counts is None or block is not None:
            borrowed, size, array = _list("index", given)
            expected = size if counts is None else counts[centring == CELL]
        elif numpy.ndim(given) == 2:
            array, expected = _view("index", given, (2,)), counts[2]
            if counts[3] and array.shape[1] != counts[3]:
                raise ValueError(f"index: has {array.shape[1]} columns, expected {counts[3]}, a cell's vertices")
            row = _row(array)
            borrowed, size = (_strided("index", array, array.strides[1]), array.size) if row else _rows("index", given)[:2]
        else:
            borrowed, size, array = _list("index", given)
            expected = counts[2]
            if row and counts[1] and size >= (counts[1] - 1) * row + counts[3]:
                expected = size
        if size != expected:
            raise ValueError(f"index: has {size} elements, expected {expected}")
        return borrowed, size, row, array

    @staticmethod
    def _cell_count(counts, cells):
        if "cell_types" in counts:
            return counts["cell_types"]
        if "offsets" in counts:
            return max(counts["offsets"] - 1, 0)
        return cells

    @staticmethod
    def _expect_counts(mesh, counts):
        """Check lengths that the C interface does not get, and would read beyond."""
        cells, vertices, faces = mesh.cell_count, mesh.vertex_count, mesh.face_count
        for key, expected in [("offsets", cells + 1), ("ghosts", cells), ("vertex_ids", vertices), ("owner", faces),
                              ("boundary_face_offsets", mesh.boundary_face_count + 1)]:
            if key in counts and counts[key] != expected:
                raise ValueError(f"{key}: has {counts[key]} elements, expected {expected}")
