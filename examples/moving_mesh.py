"""A box that sways, and is refined on the way: what is said of changes. mpirun -n 2 python3 moving_mesh.py"""

import sys

import insitu
import numpy
from mpi4py import MPI

rank = MPI.COMM_WORLD.rank


def box(n):
    """n x n x n hexes between rank and rank + 1 in x, and 0 and 1 in y and z."""
    k, j, i = numpy.meshgrid(*[range(n + 1)] * 3, indexing="ij")
    points = numpy.stack([rank + i / n, j / n, k / n], axis=-1).reshape(-1, 3)
    vertex = numpy.arange(len(points)).reshape(k.shape)
    low, high = slice(None, -1), slice(1, None)
    corners = [vertex[z][:, y, x] for z in (low, high) for y, x in [(low, low), (low, high), (high, high), (high, low)]]
    return points, numpy.stack(corners, axis=-1).reshape(-1, 8)


def move(xyz, rest, time):
    xyz[:] = rest
    xyz[:, 1] += 0.2 * numpy.sin(rest[:, 0] + time)


with insitu.Session(MPI.COMM_WORLD, sys.argv[1] if len(sys.argv) > 1 else "scene.yaml") as session:
    for cycle in range(7):
        time = 0.5 * cycle
        if cycle in (0, 4):  # other cells: everything is new, and the fields are to be set again
            rest, hexes = box(8 if cycle == 0 else 16)
            xyz, pressure = rest.copy(), numpy.empty(len(rest))
            move(xyz, rest, time)
            session.set_mesh("box", coordinates=xyz, connectivity=hexes, cell_type=insitu.HEX)
        else:  # the same cells elsewhere: the field set before stays
            move(xyz, rest, time)
            session.set_mesh("box", coordinates=xyz, connectivity=hexes, cell_type=insitu.HEX, changed=insitu.CHANGED_GEOMETRY)
        pressure[:] = numpy.cos(4 * numpy.linalg.norm(xyz - (1, 0.5, 0.5), axis=1) - time)
        session.set_field("box", "pressure", pressure, changed=insitu.CHANGED_VALUES)
        session.step(cycle, time)
