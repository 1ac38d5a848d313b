/* Heat that goes around in a ball: u' = k div grad u + f in Q1 or Q2, on a mesh that follows it (p4est, hanging nodes),
 * drawn as it runs. The source f is the one by which u = exp(-|x - c|^2 / w^2), c on a circle around the axis of z: u =
 * 1/2 is a sphere of radius w sqrt(ln 2).
 *
 *     mpirun -n 2 heat heat.yaml [degree] */
#include <deal.II/base/function.h>
#include <deal.II/base/quadrature_lib.h>
#include <deal.II/distributed/solution_transfer.h>
#include <deal.II/distributed/tria.h>
#include <deal.II/dofs/dof_handler.h>
#include <deal.II/dofs/dof_tools.h>
#include <deal.II/fe/fe_q.h>
#include <deal.II/fe/fe_values.h>
#include <deal.II/grid/filtered_iterator.h>
#include <deal.II/grid/grid_generator.h>
#include <deal.II/grid/grid_refinement.h>
#include <deal.II/lac/dynamic_sparsity_pattern.h>
#include <deal.II/lac/la_parallel_vector.h>
#include <deal.II/lac/solver_cg.h>
#include <deal.II/lac/trilinos_precondition.h>
#include <deal.II/lac/trilinos_sparse_matrix.h>
#include <deal.II/lac/sparsity_tools.h>
#include <deal.II/numerics/error_estimator.h>
#include <deal.II/numerics/vector_tools.h>

#include <cmath>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <vector>

#include <insitu/insitu.h>

using namespace dealii;
using Values = LinearAlgebra::distributed::Vector<double>;

constexpr double WIDTH = 0.25, CIRCLE = 0.45, TURN = numbers::PI, CONDUCTIVITY = 0.1, STEP = 0.0125;
constexpr int STEPS = 40, ADAPT = 4, LEAST_LEVEL = 2; // the mesh is adapted at every fourth step

/* The heat as it should be, and the source that makes it so. */
struct Heat : Function<3> {
    Point<3> centre(double time) const { return {CIRCLE * std::cos(TURN * time), CIRCLE * std::sin(TURN * time), 0.}; }
    double value(const Point<3> &x, unsigned = 0) const override
    {
        return std::exp(-(x - centre(get_time())).norm_square() / (WIDTH * WIDTH));
    }
    double source(const Point<3> &x, double time) const
    {
        const Tensor<1, 3> from = x - centre(time);
        const Point<3> velocity(-CIRCLE * TURN * std::sin(TURN * time), CIRCLE * TURN * std::cos(TURN * time), 0.);
        const double w = WIDTH * WIDTH, u = std::exp(-from.norm_square() / w);
        return u * (2 * (from * velocity) / w - CONDUCTIVITY * (4 * from.norm_square() / (w * w) - 6 / w));
    }
};

// ---- what libinsitu takes: from here ...
struct Pictures {
    insitu_session *session = nullptr;
    std::vector<int> corners;  // of the rank's cells: deal.II has no list of them
    std::vector<int> unknowns; // which of the solution's values each vertex has

    void set_mesh(const DoFHandler<3> &dofs, const Values &u)
    {
        const std::vector<Point<3>> &vertices = dofs.get_triangulation().get_vertices();
        corners.clear();
        unknowns.assign(vertices.size(), 0); // vertices of none of the cells keep 0, any value that there is
        for (const auto &cell : dofs.active_cell_iterators() | IteratorFilters::LocallyOwnedCell())
            for (const unsigned i : cell->vertex_indices()) {
                const unsigned v = cell->reference_cell().exodusii_vertex_to_deal_vertex(i); // and so VTK's order
                corners.push_back(cell->vertex_index(v));
                unknowns[cell->vertex_index(v)] = u.get_partitioner()->global_to_local(cell->vertex_dof_index(v, 0));
            }
        insitu_mesh mesh;
        insitu_mesh_defaults(&mesh);
        mesh.vertex_count = corners.empty() ? 0 : vertices.size(); // a rank without cells has no values either
        insitu_mesh_interleaved(&mesh, vertices.data(), INSITU_FLOAT64);
        mesh.cell_type = INSITU_HEX;
        mesh.connectivity = {corners.data(), INSITU_INT32, 0};
        mesh.connectivity_count = corners.size();
        mesh.cell_count = corners.size() / 8;
        insitu_set_mesh(session, "ball", &mesh);
        set_field("height", &vertices[0][2], mesh.vertex_count, sizeof(Point<3>), false);
    }
    void set_field(const char *name, const double *values, int64_t count, int64_t stride, bool by_unknowns)
    {
        insitu_field field;
        insitu_field_defaults(&field);
        field.name = name;
        field.count = count;
        field.values = {values, INSITU_FLOAT64, stride};
        if (by_unknowns) field.index = {unknowns.data(), INSITU_INT32, 0};
        insitu_set_field(session, "ball", &field);
    }
};
// ... to here, and the lines below that have "pictures" in them

struct Simulation {
    parallel::distributed::Triangulation<3> mesh{MPI_COMM_WORLD};
    FE_Q<3> element;
    DoFHandler<3> dofs{mesh};
    IndexSet owned, relevant;
    AffineConstraints<double> hanging;
    Values u;
    Heat heat;
    Pictures pictures;
    const bool is_first = Utilities::MPI::this_mpi_process(MPI_COMM_WORLD) == 0;

    explicit Simulation(int degree) : element(degree)
    {
        GridGenerator::hyper_ball(mesh);
        mesh.refine_global(LEAST_LEVEL);
        distribute_unknowns();
    }

    void distribute_unknowns()
    {
        dofs.distribute_dofs(element);
        owned = dofs.locally_owned_dofs();
        DoFTools::extract_locally_relevant_dofs(dofs, relevant);
        hanging.reinit(relevant);
        DoFTools::make_hanging_node_constraints(dofs, hanging);
        hanging.close();
        u.reinit(owned, relevant, MPI_COMM_WORLD);
    }

    void set_solution(Values &values)
    {
        hanging.distribute(values);
        u.copy_locally_owned_data_from(values);
        u.update_ghost_values();
    }

    void set_initial_values()
    {
        Values values(owned, relevant, MPI_COMM_WORLD);
        VectorTools::interpolate(dofs, heat, values);
        set_solution(values);
    }

    /* Finer where the error is, coarser where it is small, but where siblings are on several ranks. */
    void adapt_mesh()
    {
        Vector<float> errors(mesh.n_active_cells());
        KellyErrorEstimator<3>::estimate(dofs, QGauss<2>(element.degree + 1), {}, u, errors);
        const bool is_linear = element.degree == 1;
        const int finest = is_linear ? 5 : 4;
        GridRefinement::refine(mesh, errors, is_linear ? 4e-3 : 2e-3);
        GridRefinement::coarsen(mesh, errors, is_linear ? 5e-4 : 2e-4);
        for (const auto &cell : mesh.active_cell_iterators()) {
            if (cell->level() >= finest) cell->clear_refine_flag();
            if (cell->level() <= LEAST_LEVEL) cell->clear_coarsen_flag();
        }
        parallel::distributed::SolutionTransfer<3, Values> transfer(dofs);
        mesh.prepare_coarsening_and_refinement();
        transfer.prepare_for_coarsening_and_refinement(u);
        mesh.execute_coarsening_and_refinement();
        distribute_unknowns();
        Values values(owned, relevant, MPI_COMM_WORLD);
        transfer.interpolate(values);
        set_solution(values);
    }

    /* One step of Crank and Nicolson's. */
    void advance(double time)
    {
        AffineConstraints<double> constraints(hanging);
        heat.set_time(time);
        VectorTools::interpolate_boundary_values(dofs, 0, heat, constraints);
        constraints.close();
        DynamicSparsityPattern pattern(relevant);
        DoFTools::make_sparsity_pattern(dofs, pattern, constraints, false);
        SparsityTools::distribute_sparsity_pattern(pattern, owned, MPI_COMM_WORLD, relevant);
        TrilinosWrappers::SparseMatrix matrix;
        matrix.reinit(owned, owned, pattern, MPI_COMM_WORLD);
        Values right(owned, relevant, MPI_COMM_WORLD), values(owned, MPI_COMM_WORLD);
        assemble(constraints, time - STEP / 2, matrix, right);

        TrilinosWrappers::PreconditionJacobi jacobi;
        jacobi.initialize(matrix);
        SolverControl control(1000, 1e-10 * right.l2_norm());
        SolverCG<Values>(control).solve(matrix, values, right, jacobi);
        constraints.distribute(values);
        set_solution(values);
    }

    void assemble(const AffineConstraints<double> &constraints, double time, TrilinosWrappers::SparseMatrix &matrix,
                  Values &right)
    {
        const QGauss<3> points(element.degree + 1);
        FEValues<3> fe(element, points,
                       update_values | update_gradients | update_quadrature_points | update_JxW_values);
        const unsigned n = element.n_dofs_per_cell();
        FullMatrix<double> cell_matrix(n, n);
        Vector<double> cell_right(n);
        std::vector<double> old(points.size());
        std::vector<Tensor<1, 3>> slope(points.size());
        std::vector<types::global_dof_index> places(n);
        for (const auto &cell : dofs.active_cell_iterators() | IteratorFilters::LocallyOwnedCell()) {
            fe.reinit(cell);
            fe.get_function_values(u, old);
            fe.get_function_gradients(u, slope);
            cell_matrix = 0;
            cell_right = 0;
            for (const unsigned q : fe.quadrature_point_indices()) {
                const double half = STEP / 2 * CONDUCTIVITY;
                const double given = old[q] + STEP * heat.source(fe.quadrature_point(q), time);
                for (unsigned i = 0; i < n; i++) {
                    const double value = fe.shape_value(i, q) * fe.JxW(q);
                    const Tensor<1, 3> gradient = half * fe.JxW(q) * fe.shape_grad(i, q);
                    cell_right(i) += value * given - gradient * slope[q];
                    for (unsigned j = 0; j < n; j++)
                        cell_matrix(i, j) += value * fe.shape_value(j, q) + gradient * fe.shape_grad(j, q);
                }
            }
            cell->get_dof_indices(places);
            constraints.distribute_local_to_global(cell_matrix, cell_right, places, matrix, right);
        }
        matrix.compress(VectorOperation::add);
        right.compress(VectorOperation::add);
    }

    void run(const char *scene)
    {
        if (insitu_create(MPI_COMM_WORLD, scene, &pictures.session) != INSITU_OK)
            throw std::runtime_error(insitu_error(nullptr));
        for (int i = 0; i < 4; i++) {
            set_initial_values();
            adapt_mesh();
        }
        set_initial_values();
        for (int cycle = 0; cycle <= STEPS; cycle++) {
            if (cycle > 0) advance(cycle * STEP);
            if (cycle % ADAPT == 0) adapt_mesh();
            draw_pictures(cycle);
        }
        insitu_destroy(&pictures.session);
    }

    void draw_pictures(int cycle)
    {
        if (cycle % ADAPT == 0) pictures.set_mesh(dofs, u);
        pictures.set_field("u", u.begin(), u.locally_owned_size() + u.get_partitioner()->n_ghost_indices(), 0, true);
        if (insitu_step(pictures.session, cycle, cycle * STEP) != INSITU_OK && is_first)
            std::cerr << insitu_error(pictures.session) << '\n';
        if (cycle % 10 == 0) print_error(cycle);
    }

    void print_error(int cycle)
    {
        Vector<double> errors(mesh.n_active_cells());
        const QIterated<3> points(QTrapezoid<1>(), 2);
        VectorTools::integrate_difference(dofs, u, heat, errors, points, VectorTools::Linfty_norm);
        const double error = VectorTools::compute_global_error(mesh, errors, VectorTools::Linfty_norm);
        if (is_first)
            std::cout << cycle << ": " << mesh.n_global_active_cells() << " cells, " << dofs.n_dofs()
                      << " unknowns, error " << error << std::endl;
    }
};

int main(int argc, char **argv)
{
    Utilities::MPI::MPI_InitFinalize mpi(argc, argv, 1);
    Simulation(argc > 2 ? std::atoi(argv[2]) : 1).run(argc > 1 ? argv[1] : "heat.yaml");
}
