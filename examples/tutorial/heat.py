"""Two hot spots that rotate around each other, on a box of hexahedra per rank."""
import insitu
import numpy
from mpi4py import MPI

N = 20
SIDE = N + 1
rank, ranks = MPI.COMM_WORLD.rank, MPI.COMM_WORLD.size

v = numpy.arange(SIDE**3)  # each rank has a slab of a cube of side 1
xyz = numpy.stack([(rank + v % SIDE / N) / ranks, v // SIDE % SIDE / N, v // SIDE**2 / N], axis=1)
c = numpy.arange(N**3)
low = c % N + SIDE * (c // N % N + SIDE * (c // N**2))
quad = numpy.stack([low, low + 1, low + 1 + SIDE, low + SIDE], axis=1)
hexes = numpy.hstack([quad, quad + SIDE**2])  # the lower quad around, then the upper
heat = numpy.empty(len(xyz))


def spot(x, y):
    return numpy.exp(-8 * ((xyz[:, 0] - x) ** 2 + (xyz[:, 1] - y) ** 2 + (xyz[:, 2] - 0.5) ** 2))


with insitu.Session(MPI.COMM_WORLD, "heat.yaml") as session:
    session.set_mesh("box", coordinates=xyz, connectivity=hexes, cell_type=insitu.HEX)
    for cycle in range(10):
        time = 0.3 * cycle
        x, y = 0.25 * numpy.cos(time), 0.25 * numpy.sin(time)
        heat[:] = spot(0.5 + x, 0.5 + y) + spot(0.5 - x, 0.5 - y)
        session.set_field("box", "heat", heat)
        session.step(cycle, time)
