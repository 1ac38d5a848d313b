"""The simulation of six_calls.py with a field that may jump between cells, as discontinuous Galerkin methods have it."""

import sys

import insitu
import numpy
from mpi4py import MPI

NX, NY, NZ = 12, 24, 24
rank = MPI.COMM_WORLD.rank

k, j, i = numpy.meshgrid(range(NZ + 1), range(NY + 1), range(NX + 1), indexing="ij")
points = numpy.stack([i + rank * NX, j, k], axis=-1).reshape(-1, 3).astype(float)
number = numpy.arange(len(points)).reshape(k.shape)
low, high = slice(None, -1), slice(1, None)
corners = [number[z][:, y, x] for z in (low, high) for y in (low, high) for x in (low, high)]  # lexicographic
cells = numpy.stack(corners, axis=-1).reshape(-1, 8)

dofs = numpy.empty(cells.shape)  # cells x corners: the solver's vector
xyz = points[cells].reshape(-1, 3)
distance = numpy.hypot(numpy.hypot(xyz[:, 0] - 12, xyz[:, 1] - 12), xyz[:, 2] - 12).reshape(cells.shape)

with insitu.Session(MPI.COMM_WORLD, sys.argv[1] if len(sys.argv) > 1 else "scene.yaml") as session:
    session.set_mesh("slab", coordinates=points, connectivity=cells, cell_type=insitu.HEX,
                     vertex_order=insitu.ORDER_LEXICOGRAPHIC)
    for cycle in range(4):
        dofs[:] = numpy.cos(0.6 * distance - 0.5 * cycle)
        session.set_field("slab", "pressure", dofs.reshape(-1), centring=insitu.CORNER)
        session.step(cycle, 0.5 * cycle)
