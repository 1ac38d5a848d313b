"""A sphere that shrinks by its curvature: the Allen-Cahn equation u' = div grad u - (u^3 - u) / eps^2 in linear elements,
drawn as it runs. By the theory of its sharp limit the radius is sqrt(R^2 - 4 t)."""

import sys

import dolfinx
import insitu
import numpy
import ufl
from dolfinx.fem.petsc import assemble_matrix, assemble_vector
from mpi4py import MPI
from petsc4py import PETSc

CELLS, EPS, STEP, RADIUS = 36, 0.05, 2.5e-4, 0.35

comm = MPI.COMM_WORLD
domain = dolfinx.mesh.create_unit_cube(comm, CELLS, CELLS, CELLS)
space = dolfinx.fem.FunctionSpace(domain, ("CG", 1))
u, trial, test = dolfinx.fem.Function(space, name="u"), ufl.TrialFunction(space), ufl.TestFunction(space)
u.interpolate(lambda x: numpy.tanh((RADIUS - numpy.linalg.norm(x.T - 0.5, axis=1)) / (numpy.sqrt(2) * EPS)))
left = dolfinx.fem.form(trial * test * ufl.dx + STEP * ufl.inner(ufl.grad(trial), ufl.grad(test)) * ufl.dx)
right = dolfinx.fem.form((u - STEP / EPS**2 * (u**3 - u)) * test * ufl.dx)
slope_space = dolfinx.fem.FunctionSpace(domain, ("DG", 1))  # of |grad u|, which jumps from cell to cell
slope = dolfinx.fem.Function(slope_space)
slope_of_u = dolfinx.fem.Expression(ufl.sqrt(ufl.inner(ufl.grad(u), ufl.grad(u))),
                                    slope_space.element.interpolation_points())
solver = PETSc.KSP().create(comm)
matrix = assemble_matrix(left)
matrix.assemble()
solver.setOperators(matrix)
solver.setType("cg")
solver.getPC().setType("jacobi")
solver.setTolerances(rtol=1e-10)


def advance():
    vector = assemble_vector(right)
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    solver.solve(vector, u.vector)
    u.x.scatter_forward()


# ---- what libinsitu takes: from here ...
session = insitu.Session(comm, sys.argv[1])
cells = domain.topology.index_map(3)
vertices = domain.geometry.dofmap.array.reshape(-1, 4)
unknowns = numpy.empty(len(domain.geometry.x), "i4")  # which of u's values each vertex has
unknowns[vertices] = space.dofmap.list.array.reshape(-1, 4)
corners = slope_space.dofmap.list.array.reshape(-1, 4)
session.set_mesh("cube", coordinates=domain.geometry.x, connectivity=vertices, cell_type=insitu.TET,
                 ghosts=numpy.repeat(numpy.array([0, 1], "u1"), [cells.size_local, cells.num_ghosts]))
# ... to here, and four lines below

for cycle in range(61):
    slope.interpolate(slope_of_u)
    session.set_field("cube", "u", u.x.array, index=unknowns)
    session.set_field("cube", "slope", slope.x.array, index=corners, centring=insitu.CORNER)
    session.step(cycle, cycle * STEP)
    advance()
session.close()
