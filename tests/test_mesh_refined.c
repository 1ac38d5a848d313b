#include "test_mesh_refined.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "session_interpolation.h"
#include "session_split.h"
#include "test_mesh_make.h"
#include "test_mesh_order.h"

enum { PARTS = 2, ORDER = 2 * PARTS, MOST_NODES = (ORDER + 1) * (ORDER + 1) * (ORDER + 1) };

static const order_kind tet_10 = {"tet 10", INSITU_QUADRATIC_TET, INSITU_ORDER_VTK, 2};
static const order_kind hex_20 = {"hex 20", INSITU_QUADRATIC_HEX, INSITU_ORDER_VTK, 2};
static const order_kind hex_27 = {"hex 27", INSITU_TRIQUADRATIC_HEX, INSITU_ORDER_VTK, 2};
static const order_kind wedge_18 = {"wedge 18", INSITU_BIQUADRATIC_WEDGE, INSITU_ORDER_VTK, 2};

/* A mesh of cells of order ORDER that is made by refining quadratic cells. Each cell has its own nodes. */
typedef struct fine_nodes {
    insitu_mesh mesh;
    double *coordinates;
} fine_nodes;

/* Interpolates the nodes of the finer lattice in a cell and adds them. */
static void refine_cell(const session_interpolation *of, const order_mesh *mesh, int64_t cell, fine_nodes *out)
{
    double nodes[27][3], corners[8][3];
    double *work = malloc(session_interpolation_work_size(of, 3) * sizeof *work);
    for (int n = 0; n < mesh->nodes; n++)
        memcpy(nodes[n], mesh->coordinates + 3 * mesh->connectivity[cell * mesh->nodes + n], sizeof nodes[n]);
    for (int c = 0; c < grid_type_vertex_count(of->of.type); c++)
        memcpy(corners[c], nodes[of->corners[c]], sizeof corners[c]);
    session_interpolate(of, (const double(*)[3])corners, 3, nodes[0], work,
                        out->coordinates + 3 * out->mesh.vertex_count);
    out->mesh.vertex_count += of->fine.count;
    out->mesh.cell_count++;
    free(work);
}

/* Refines the cells in columns of cubes along z: all columns if `column` is -1, else the even (0) or the odd ones
 * (1). */
static void refine_cells(const order_kind *kind, int side, double bend, int column, fine_nodes *out)
{
    order_mesh mesh;
    session_nodes nodes;
    session_interpolation of;
    order_mesh_create(kind, side, bend, test_linear_field, 0, 1, &mesh);
    const int64_t of_cube = mesh.cell_count / (side * side * side);
    assert_true(session_describe_nodes((int)kind->type, mesh.nodes, &nodes));
    assert_true(session_make_interpolation(&nodes, kind->layout, PARTS, false, &of));
    out->coordinates = malloc((size_t)(mesh.cell_count * MOST_NODES) * 3 * sizeof(double));
    insitu_mesh_defaults(&out->mesh);
    for (int64_t cell = 0; cell < mesh.cell_count; cell++) {
        const int64_t cube = cell / of_cube;
        if (column < 0 || (cube % side + cube / side % side) % 2 == column) refine_cell(&of, &mesh, cell, out);
    }
    out->mesh.cell_type = (insitu_cell_type)session_lagrange_type(nodes.type);
    out->mesh.vertex_order = INSITU_ORDER_LEXICOGRAPHIC;
    out->mesh.order = ORDER;
    insitu_mesh_interleaved(&out->mesh, out->coordinates, INSITU_FLOAT64);
    session_drop_interpolation(&of);
    order_mesh_free(&mesh);
}

/* Adds the linear pieces between the nodes to the mesh. Frees the nodes. */
static void add_pieces(fine_nodes *nodes, test_mesh *out)
{
    static const int in_order[GRID_MAX_CELL_VERTICES] = {0, 1, 2, 3, 4, 5, 6, 7};
    base_error error = {.status = INSITU_OK};
    session_mesh split = {.name = (char[]){"m"}, .given = nodes->mesh};
    assert_int_equal(session_split_cells(&split, 1, &error), INSITU_OK);
    const session_topology *t = &split.topology;
    const grid pieces = {.vertex_count = nodes->mesh.vertex_count,
                         .cell_count = t->cell_count,
                         .connectivity = t->connectivity,
                         .offsets = t->offsets,
                         .cell_types = (const char *)t->cell_types,
                         .cell_types_stride = 1,
                         .cell_types_bytes = 1,
                         .cell_type = t->cell_type};
    const int64_t first = out->vertex_count;
    for (int64_t v = 0; v < nodes->mesh.vertex_count; v++) test_mesh_add_vertex(out, nodes->coordinates + 3 * v);
    for (int64_t cell = 0; cell < t->cell_count; cell++) {
        int64_t vertices[GRID_MAX_CELL_VERTICES];
        const int count = grid_cell_vertices(&pieces, cell, vertices);
        for (int i = 0; i < count; i++) vertices[i] += first;
        test_mesh_add_cell(out, grid_cell_type(&pieces, cell), vertices, in_order);
    }
    session_drop_topology(&split.topology);
    free(nodes->coordinates);
}

void test_mesh_make_refined(refined_kind kind, int side, double bend, test_function *f, test_mesh *out)
{
    static const order_kind *const kinds[] = {&tet_10, &hex_20, &hex_27, &wedge_18, &hex_27};
    fine_nodes nodes[2] = {0};
    int64_t vertices = 0, cells = 0;
    refine_cells(kinds[kind], side, bend, kind == REFINED_MIXED ? 0 : -1, &nodes[0]);
    if (kind == REFINED_MIXED) refine_cells(&wedge_18, side, bend, 1, &nodes[1]);
    for (int i = 0; i < 2; i++) {
        vertices += nodes[i].mesh.vertex_count;
        cells += nodes[i].mesh.cell_count * ORDER * ORDER * ORDER;
    }
    test_mesh_allocate(out, vertices, cells, cells * GRID_MAX_CELL_VERTICES);
    for (int i = 0; i < 2; i++)
        if (nodes[i].coordinates) add_pieces(&nodes[i], out);
    test_mesh_set_values(out, f);
}
