/* Normals of the faces of cells of higher order. A face lies in a plane of the reference cell. If m is the plane's
 * normal there, and t_0, t_1 and t_2 are the derivatives of positions along the axes of the reference cell, the normal
 * of the curved face is
 *
 *     m_0 t_1 x t_2 + m_1 t_2 x t_0 + m_2 t_0 x t_1.
 *
 * Triangles and quads have no third axis, and m = (0, 0, 1). */
#include "session_face_normals.h"

#include "memory.h"
#include "session_rims.h"
#include "vector3.h"

bool session_face_normals_create(const session_mesh *mesh, session_face_normals *out)
{
    *out = (session_face_normals){.cell = -1};
    bool is_made = session_polynomials_create(mesh, &out->polynomials);
    int most = 1;
    for (int i = 0; i < out->polynomials.rows.kind_count; i++) {
        const int count = out->polynomials.rows.kinds[i].nodes.count;
        most = count > most ? count : most;
    }
    out->positions = base_alloc((size_t)most * 3 * sizeof *out->positions);
    return is_made && out->positions;
}

void session_face_normals_free(session_face_normals *normals)
{
    session_polynomials_free(&normals->polynomials);
    base_free(normals->positions);
    *normals = (session_face_normals){0};
}

static void read_cell(session_face_normals *n, const session_mesh *mesh, int64_t cell)
{
    const session_rows *rows = &n->polynomials.rows;
    const int count = (int)session_count_nodes_of_cell(rows, cell);
    for (int i = 0; i < count; i++)
        grid_read_vertex_position(&mesh->cells, session_find_vertex_of_node(rows, cell, i), n->positions + 3 * i);
    n->cell = cell;
    n->derivatives = session_find_derivatives_of_cell(&n->polynomials, cell, n->positions, 3);
}

/* Returns the position of a vertex in the list of nodes (row) of one of the caller's cells, or -1 if the cell does not
 * have the vertex. */
static int find_node_of_vertex(const session_rows *rows, int64_t cell, int64_t vertex)
{
    const int count = (int)session_count_nodes_of_cell(rows, cell);
    /* if cells are refined (session_finer.h), the nodes of a cell have consecutive vertex indices */
    const int64_t guess = vertex - session_find_vertex_of_node(rows, cell, 0);
    if (guess >= 0 && guess < count && session_find_vertex_of_node(rows, cell, (int)guess) == vertex) return (int)guess;
    for (int i = 0; i < count; i++)
        if (session_find_vertex_of_node(rows, cell, i) == vertex) return i;
    return -1;
}

/* Computes the derivative of the position, at a node of the cell read last, with respect to a coordinate of the
 * reference cell. */
static void find_tangent(const session_face_normals *n, int node, int axis, double out[3])
{
    const session_derivatives *of = n->derivatives;
    const int first = of->starts[of->axis_count * node + axis], end = of->starts[of->axis_count * node + axis + 1];
    for (int x = 0; x < 3; x++) out[x] = 0;
    for (int term = first; term < end; term++)
        for (int x = 0; x < 3; x++)
            out[x] += of->weights[term] * (n->positions[3 * of->nodes[term] + x] - n->positions[3 * node + x]);
}

bool session_has_face_normals(session_face_normals *normals, const session_mesh *mesh, int64_t cell)
{
    if (normals->cell != cell) read_cell(normals, mesh, cell);
    return normals->derivatives->axis_count > 0;
}

bool session_find_face_normal(session_face_normals *normals, const session_mesh *mesh, int64_t cell, int face,
                              int64_t vertex, double out[3])
{
    const session_rows *rows = &normals->polynomials.rows;
    double plane[3], tangents[3][3] = {{0}}, product[3];
    for (int x = 0; x < 3; x++) out[x] = 0;
    if (!session_has_face_normals(normals, mesh, cell)) return false;
    const int node = find_node_of_vertex(rows, cell, vertex), axes = normals->derivatives->axis_count;
    if (node < 0) return false;
    session_find_face_plane_normal(&rows->kinds[session_find_kind_of_cell(rows, cell)].nodes, face, plane);
    for (int a = 0; a < axes; a++) find_tangent(normals, node, a, tangents[a]);
    for (int a = 0; a < 3; a++) {
        vector3_cross(tangents[(a + 1) % 3], tangents[(a + 2) % 3], product);
        for (int x = 0; x < 3; x++) out[x] += plane[a] * product[x];
    }
    const double length = vector3_length(out);
    return length > 0 && isfinite(length);
}
