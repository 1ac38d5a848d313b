"""A simulation on one uniform block a rank, with a layer of ghost cells. mpirun -n 2 python3 uniform_block.py blocks.yaml"""

import sys

import insitu
import numpy
from mpi4py import MPI

NX, NY, NZ = 48, 32, 24  # cells of the whole lattice
SPACING = (2 / NX, 2 / NX, 2 / NX)
ORIGIN = (-1, -NY / NX, -NZ / NX)  # of the whole lattice: the same on all ranks
comm = MPI.COMM_WORLD

begin, end = NX * comm.rank // comm.size, NX * (comm.rank + 1) // comm.size
density = numpy.full((end - begin + 2, NY + 2, NZ + 2), -1.0)  # [i, j, k], with the ghost layers
own = density[1:-1, 1:-1, 1:-1]  # a view: its strides are those of the whole array
x, y, z = numpy.meshgrid(*(origin + spacing * (first + numpy.arange(n) + 0.5) for origin, spacing, first, n in
                           zip(ORIGIN, SPACING, (begin, 0, 0), own.shape)), indexing="ij")

with insitu.Session(comm, sys.argv[1] if len(sys.argv) > 1 else "scene.yaml") as session:
    session.set_block("box", own.shape, spacing=SPACING, origin=ORIGIN, first=(begin, 0, 0), cell_layout=own)
    for cycle in range(2):
        own[...] = 1 / (1 + 4 * (x**2 + y**2 + z**2) + 2 * numpy.cos(5 * x - cycle) * numpy.cos(5 * y))
        session.set_field("box", "density", own, centring=insitu.CELL)  # borrowed, not copied
        session.step(cycle, cycle)
