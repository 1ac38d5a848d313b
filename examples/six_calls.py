"""A simulation that draws itself: the slab of hexahedra of six_calls.c, in Python. mpirun -n 2 python3 six_calls.py"""

import sys

import insitu
import numpy
from mpi4py import MPI

NX, NY, NZ = 12, 24, 24
rank = MPI.COMM_WORLD.rank

k, j, i = numpy.meshgrid(range(NZ + 1), range(NY + 1), range(NX + 1), indexing="ij")
xyz = numpy.stack([i + rank * NX, j, k], axis=-1).reshape(-1, 3).astype(float)
vertex = numpy.arange(len(xyz)).reshape(k.shape)
low, high = slice(None, -1), slice(1, None)
quad = [(low, low), (low, high), (high, high), (high, low)]  # of y and x: around, as VTK orders a hex
hexes = numpy.stack([vertex[z][:, y, x] for z in (low, high) for y, x in quad], axis=-1).reshape(-1, 8)
pressure = numpy.empty(len(xyz))
distance = numpy.hypot(numpy.hypot(xyz[:, 0] - 12, xyz[:, 1] - 12), xyz[:, 2] - 12)

with insitu.Session(MPI.COMM_WORLD, sys.argv[1] if len(sys.argv) > 1 else "scene.yaml") as session:
    session.set_mesh("slab", coordinates=xyz, connectivity=hexes, cell_type=insitu.HEX)  # borrowed, not copied
    for cycle in range(4):
        pressure[:] = numpy.cos(0.6 * distance - 0.5 * cycle)
        session.set_field("slab", "pressure", pressure)  # new values, in the same array
        session.step(cycle, 0.5 * cycle)
