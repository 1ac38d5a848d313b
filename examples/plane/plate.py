"""A plane run: heat on a square of quads a rank, side by side; the pictures of plate.c. mpirun -n 2 python3 plate.py plate.yaml"""

import sys

import insitu
import numpy
from mpi4py import MPI

N = 32
rank = MPI.COMM_WORLD.rank

j, i = numpy.meshgrid(range(N + 1), range(N + 1), indexing="ij")
xy = numpy.stack([rank + i / N, j / N], axis=-1).reshape(-1, 2)
first = (numpy.arange(N) + (N + 1) * numpy.arange(N)[:, None]).ravel()
quads = first[:, None] + [0, 1, N + 2, N + 1]
heat = numpy.empty(len(xy))

with insitu.Session(MPI.COMM_WORLD, sys.argv[1] if len(sys.argv) > 1 else "plate.yaml") as session:
    session.set_mesh("plate", coordinates=xy, connectivity=quads, cell_type=insitu.QUAD)  # vertices x 2: z is 0
    for cycle in range(3):
        time = 0.5 * cycle
        x, y = xy[:, 0] - (0.5 + time), xy[:, 1] - 0.4
        heat[:] = 1 / (1 + 12 * (x * x + y * y))
        session.set_field("plate", "heat", heat)
        session.step(cycle, time)
        if rank == 0:
            sys.stderr.write(session.report["warnings"])
