/* VTK's order of nodes is that of vtkLagrangeHexahedron and the other Lagrange classes: corners, then the nodes inside
 * edges, faces and the cell. The nodes inside a triangle or tet are in the order of those of a smaller triangle or tet.
 * The orders of Gmsh and Exodus are permutations of VTK's. */
#include "session_nodes.h"
#include "session_shape.h"

#include <stddef.h>

/* ---- types of cells ------------------------------------------------------------------------------------- */

static const struct {
    int type, corners, count;
} quadratic_types[] = {
    {INSITU_QUADRATIC_TRIANGLE, GRID_TRIANGLE, 6}, {INSITU_QUADRATIC_QUAD, GRID_QUAD, 8},
    {INSITU_QUADRATIC_TET, GRID_TET, 10},          {INSITU_QUADRATIC_HEX, GRID_HEX, 20},
    {INSITU_QUADRATIC_WEDGE, GRID_WEDGE, 15},      {INSITU_QUADRATIC_PYRAMID, GRID_PYRAMID, 13},
    {INSITU_BIQUADRATIC_QUAD, GRID_QUAD, 9},       {INSITU_TRIQUADRATIC_HEX, GRID_HEX, 27},
    {INSITU_BIQUADRATIC_WEDGE, GRID_WEDGE, 18},
};

enum { QUADRATIC_TYPES = sizeof quadratic_types / sizeof quadratic_types[0] };

static const int lagrange_types[] = {GRID_TRIANGLE, GRID_QUAD, GRID_TET, GRID_HEX, GRID_WEDGE, GRID_PYRAMID};

bool session_is_lagrange(int type)
{
    return type >= INSITU_LAGRANGE_TRIANGLE && type <= INSITU_LAGRANGE_PYRAMID;
}

int session_get_linear_type(int type)
{
    for (int i = 0; i < QUADRATIC_TYPES; i++)
        if (quadratic_types[i].type == type) return quadratic_types[i].corners;
    return session_is_lagrange(type) ? lagrange_types[type - INSITU_LAGRANGE_TRIANGLE] : GRID_NO_TYPE;
}

static int64_t count_complete_nodes(int corner_type, int64_t p)
{
    switch (corner_type) {
    case GRID_TRIANGLE: return (p + 1) * (p + 2) / 2;
    case GRID_QUAD: return (p + 1) * (p + 1);
    case GRID_TET: return (p + 1) * (p + 2) * (p + 3) / 6;
    case GRID_HEX: return (p + 1) * (p + 1) * (p + 1);
    case GRID_WEDGE: return (p + 1) * (p + 1) * (p + 2) / 2;
    case GRID_PYRAMID: return (p + 1) * (p + 2) * (2 * p + 3) / 6;
    default: return 0;
    }
}

int64_t session_node_count(int type, int order)
{
    for (int i = 0; i < QUADRATIC_TYPES; i++)
        if (quadratic_types[i].type == type) return order == 0 || order == 2 ? quadratic_types[i].count : 0;
    if (!session_is_lagrange(type) || order < 1 || order > NODES_MOST_ORDER) return 0;
    return count_complete_nodes(session_get_linear_type(type), order);
}

int session_lagrange_type(int corner_type)
{
    for (int i = 0; i < (int)(sizeof lagrange_types / sizeof lagrange_types[0]); i++)
        if (lagrange_types[i] == corner_type) return INSITU_LAGRANGE_TRIANGLE + i;
    return GRID_NO_TYPE;
}

session_nodes session_describe_complete_nodes(int corner_type, int order)
{
    return (session_nodes){corner_type, order, (int)count_complete_nodes(corner_type, order), true, true};
}

bool session_describe_nodes(int type, int64_t count, session_nodes *out)
{
    const int corners = session_get_linear_type(type);
    if (corners == GRID_NO_TYPE) return false;
    for (int order = session_is_lagrange(type) ? 1 : 2; order <= NODES_MOST_ORDER; order++) {
        if (session_node_count(type, order) != count) continue;
        *out = (session_nodes){corners, order, (int)count, count_complete_nodes(corners, order) == count,
                               session_is_lagrange(type)};
        return true;
    }
    return false;
}

int64_t session_count_cell_nodes(const insitu_mesh *mesh)
{
    const int type = (int)mesh->cell_type;
    if (session_get_linear_type(type) == GRID_NO_TYPE) return grid_type_vertex_count(type);
    if (!session_is_lagrange(type)) return session_node_count(type, 0);
    if (mesh->order) return session_node_count(type, mesh->order);
    if (mesh->connectivity_row) return mesh->connectivity_row;
    return mesh->cell_count ? mesh->connectivity_count / mesh->cell_count : 0;
}

const char *session_describe_unsupported_node_order(const session_nodes *of, insitu_vertex_order order)
{
    if (order == INSITU_ORDER_DMPLEX) return "DMPlex's order is known for linear cells alone";
    if (order == INSITU_ORDER_LEXICOGRAPHIC && !of->is_complete)
        return "lexicographic order needs cells with all nodes of their order";
    if (order == INSITU_ORDER_LEXICOGRAPHIC) return NULL;
    if ((order == INSITU_ORDER_GMSH || order == INSITU_ORDER_EXODUS) && of->order > 2)
        return "Gmsh's and Exodus's orders are known up to order 2";
    if (of->type == GRID_PYRAMID && of->order > 2)
        return "pyramids of order 3 and more are known in lexicographic order";
    return NULL;
}

/* ---- VTK's order of nodes ---------------------------------------------------------------------------------------- */

/* Returns the index of a quad's corner in VTK's order. i, j: true if the corner is at the far end of the first or
 * second axis. */
static int find_vtk_index_of_quad_corner(bool i, bool j)
{
    return i ? (j ? 2 : 1) : (j ? 3 : 0);
}

static int find_vtk_index_of_quad_node(int p, int i, int j)
{
    const int inner = p - 1;
    const bool at_i = i == 0 || i == p, at_j = j == 0 || j == p;
    if (at_i && at_j) return find_vtk_index_of_quad_corner(i, j);
    if (at_j) return 4 + i - 1 + (j ? 2 * inner : 0);
    if (at_i) return 4 + j - 1 + (i ? inner : 3 * inner);
    return 4 + 4 * inner + i - 1 + inner * (j - 1);
}

/* Returns the index of a hex's node in VTK's order. is_old: in the order of VTK before version 9.1, in which the nodes
 * of two edges along k are swapped. */
static int find_vtk_index_of_hex_node(int p, bool is_old, int i, int j, int k)
{
    const int r = p - 1;
    const bool at_i = i == 0 || i == p, at_j = j == 0 || j == p, at_k = k == 0 || k == p;
    const int edges = 8, faces = edges + 12 * r, inside = faces + 6 * r * r;
    if (at_i && at_j && at_k) return find_vtk_index_of_quad_corner(i, j) + (k ? 4 : 0);
    if (at_j && at_k) return edges + i - 1 + (j ? 2 * r : 0) + (k ? 4 * r : 0);
    if (at_i && at_k) return edges + j - 1 + (i ? r : 3 * r) + (k ? 4 * r : 0);
    if (at_i && at_j)
        return edges + 8 * r + k - 1 + r * (is_old ? (i ? 1 : 0) + (j ? 2 : 0) : find_vtk_index_of_quad_corner(i, j));
    if (at_i) return faces + j - 1 + r * (k - 1) + (i ? r * r : 0);
    if (at_j) return faces + 2 * r * r + i - 1 + r * (k - 1) + (j ? r * r : 0);
    if (at_k) return faces + 4 * r * r + i - 1 + r * (j - 1) + (k ? r * r : 0);
    return inside + i - 1 + r * (j - 1 + r * (k - 1));
}

static int find_smallest_number(const int *b, int count)
{
    int out = b[0];
    for (int n = 1; n < count; n++) out = b[n] < out ? b[n] : out;
    return out;
}

/* Returns the index of a triangle's node in VTK's order. b: the node's barycentric coordinates times the order; b[2]
 * belongs to the first corner. */
static int find_vtk_index_of_triangle_node(int order, const int b[3])
{
    int at = 0, max = order, min = 0;
    for (const int inner = find_smallest_number(b, 3); min < inner; min++, max -= 2, order -= 3) at += 3 * order;
    for (int n = 0; n < 3; n++, at++)
        if (b[(n + 2) % 3] == max) return at;
    for (int n = 0; n < 3; n++, at += max - min - 1)
        if (b[(n + 1) % 3] == min) return at + b[n] - min - 1;
    return at;
}

static int find_vtk_index_of_tet_node(int order, const int b[4])
{
    static const signed char corner[4] = {3, 0, 1, 2}, edge_side[6] = {0, 1, 3, 2, 2, 2};
    static const signed char edge[6][2] = {{1, 2}, {2, 3}, {0, 2}, {0, 1}, {1, 3}, {0, 3}};
    static const signed char face[4] = {1, 3, 0, 2}, face_sides[4][3] = {{0, 2, 3}, {2, 0, 1}, {2, 1, 3}, {1, 0, 3}};
    int at = 0, max = order, min = 0;
    for (const int inner = find_smallest_number(b, 4); min < inner; min++, max -= 3, order -= 4)
        at += 2 * (order * order + 1);
    for (int n = 0; n < 4; n++, at++)
        if (b[(int)corner[n]] == max) return at;
    for (int n = 0; n < 6; n++, at += max - min - 1)
        if (b[(int)edge[n][0]] == min && b[(int)edge[n][1]] == min) return at + b[(int)edge_side[n]] - min - 1;
    for (int n = 0; n < 4; n++, at += (order + 1) * (order + 2) / 2 - 3 * order) {
        if (b[(int)face[n]] != min) continue;
        int on[3];
        for (int a = 0; a < 3; a++) on[a] = b[(int)face_sides[n][a]] - min;
        return at + find_vtk_index_of_triangle_node(order, on) - 3 * order;
    }
    return at;
}

/* Returns the index of a node inside a triangle of order p, among the nodes inside it. These are numbered row by
 * row. */
static int find_index_among_inner_triangle_nodes(int p, int i, int j)
{
    return i + p * (j - 1) - j * (j + 1) / 2;
}

static int find_vtk_index_of_wedge_node(int p, int i, int j, int k)
{
    const int r = p - 1, triangle = r * (r - 1) / 2, edges = 6, faces = edges + 9 * r;
    const int quads = faces + 2 * triangle, inside = quads + 3 * r * r;
    const bool at_i = i == 0, at_j = j == 0, at_far = i + j == p, at_k = k == 0 || k == p;
    const int side = at_i && at_j ? 0 : at_j && at_far ? 1 : 2;
    if (at_i + at_j + at_far == 2) return at_k ? side + (k ? 3 : 0) : edges + 6 * r + r * side + k - 1;
    if (at_k && at_j) return edges + (k ? 3 * r : 0) + i - 1;
    if (at_k && at_far) return edges + (k ? 3 * r : 0) + r + j - 1;
    if (at_k && at_i) return edges + (k ? 3 * r : 0) + 2 * r + p - j - 1;
    if (at_k) return faces + (k ? triangle : 0) + find_index_among_inner_triangle_nodes(p, i, j);
    if (at_j) return quads + i - 1 + r * (k - 1);
    if (at_far) return quads + r * r + p - i - 1 + r * (k - 1);
    if (at_i) return quads + 2 * r * r + p - j - 1 + r * (k - 1);
    return inside + find_index_among_inner_triangle_nodes(p, i, j) + triangle * (k - 1);
}

/* Returns the index of a pyramid's node in VTK's order, for pyramids of order 1 and 2. */
static int find_vtk_index_of_pyramid_node(int p, int i, int j, int k)
{
    if (p == 1) return k ? 4 : find_vtk_index_of_quad_corner(i, j);
    if (k == 2) return 4;
    if (k == 1) return 9 + find_vtk_index_of_quad_corner(i, j);
    const int on_base = find_vtk_index_of_quad_node(p, i, j);
    return on_base < 4 ? on_base : on_base == 8 ? 13 : on_base + 1;
}

static int find_vtk_index_of_node(const session_nodes *of, bool is_old, int i, int j, int k)
{
    const int p = of->order;
    switch (of->type) {
    case GRID_TRIANGLE: return find_vtk_index_of_triangle_node(p, (const int[]){i, j, p - i - j});
    case GRID_QUAD: return find_vtk_index_of_quad_node(p, i, j);
    case GRID_TET: return find_vtk_index_of_tet_node(p, (const int[]){i, j, k, p - i - j - k});
    case GRID_HEX: return find_vtk_index_of_hex_node(p, is_old, i, j, k);
    case GRID_WEDGE: return find_vtk_index_of_wedge_node(p, i, j, k);
    default: return find_vtk_index_of_pyramid_node(p, i, j, k);
    }
}

/* ---- lexicographic order, and orders of Gmsh and Exodus ---------------------------------------------------------- */

static int find_row_by_row_triangle_index(int p, int i, int j)
{
    return i + j * (p + 1) - j * (j - 1) / 2;
}

/* Returns the number of nodes of a tet with n nodes on each edge. */
static int count_tet_nodes(int n)
{
    return n * (n + 1) * (n + 2) / 6;
}

static int number_lexicographic_node(int type, int p, int i, int j, int k)
{
    const int n = p + 1;
    int below = 0;
    switch (type) {
    case GRID_TRIANGLE: return find_row_by_row_triangle_index(p, i, j);
    case GRID_QUAD:
    case GRID_HEX: return i + n * (j + n * k);
    case GRID_WEDGE: return find_row_by_row_triangle_index(p, i, j) + k * (n * (n + 1) / 2);
    case GRID_TET:
        below = count_tet_nodes(n) - count_tet_nodes(n - k);
        return below + find_row_by_row_triangle_index(p - k, i, j);
    default:
        for (int layer = 0; layer < k; layer++) below += (n - layer) * (n - layer);
        return below + i + (n - k) * j;
    }
}

/* For cells of order 2: returns a table with one entry for each node other than a corner, in VTK's order: the node's
 * position in the given order. Returns NULL if both orders are the same. */
static const signed char *quadratic_permutation(int type, insitu_vertex_order order)
{
    static const signed char gmsh_tet[] = {4, 5, 6, 7, 9, 8};
    static const signed char gmsh_hex[] = {8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15, 22, 23, 21, 24, 20, 25, 26};
    static const signed char gmsh_wedge[] = {6, 9, 7, 12, 14, 13, 8, 10, 11, 15, 17, 16};
    static const signed char gmsh_pyramid[] = {5, 8, 10, 6, 7, 9, 11, 12, 13};
    static const signed char exodus_hex[] = {8, 9, 10, 11, 16, 17, 18, 19, 12, 13, 14, 15, 23, 24, 25, 26, 21, 22, 20};
    static const signed char exodus_wedge[] = {6, 7, 8, 12, 13, 14, 9, 10, 11, 15, 16, 17};
    if (order == INSITU_ORDER_EXODUS) return type == GRID_HEX ? exodus_hex : type == GRID_WEDGE ? exodus_wedge : NULL;
    if (order != INSITU_ORDER_GMSH) return NULL;
    return type == GRID_TET       ? gmsh_tet
           : type == GRID_HEX     ? gmsh_hex
           : type == GRID_WEDGE   ? gmsh_wedge
           : type == GRID_PYRAMID ? gmsh_pyramid
                                  : NULL;
}

int session_convert_quadratic_node_index(const session_nodes *of, insitu_vertex_order order, int n)
{
    const int corners = grid_type_vertex_count(of->type);
    const signed char *turn = n < corners || of->order != 2 ? NULL : quadratic_permutation(of->type, order);
    return turn ? turn[n - corners] : n;
}

int session_find_node_in_connectivity(const session_nodes *of, insitu_vertex_order order, int i, int j, int k)
{
    if (order == INSITU_ORDER_LEXICOGRAPHIC) return number_lexicographic_node(of->type, of->order, i, j, k);
    const bool is_old = order == INSITU_ORDER_VTK_BEFORE_9_1 && of->is_lagrange;
    return session_convert_quadratic_node_index(of, order, find_vtk_index_of_node(of, is_old, i, j, k));
}

void session_find_corners(const session_nodes *of, insitu_vertex_order order, int out[8])
{
    const session_shape *shape = session_get_cell_shape(of->type);
    const int p = of->order;
    for (int c = 0; c < shape->corner_count; c++) {
        const signed char *at = shape->corners[c];
        out[c] = session_find_node_in_connectivity(of, order, p * at[0], p * at[1], p * at[2]);
    }
}

bool session_has_node(const session_nodes *of, int i, int j, int k)
{
    const int p = of->order;
    switch (of->type) {
    case GRID_TRIANGLE: return i + j <= p && k == 0;
    case GRID_QUAD: return k == 0;
    case GRID_TET: return i + j + k <= p;
    case GRID_WEDGE: return i + j <= p;
    case GRID_PYRAMID: return i + k <= p && j + k <= p;
    default: return true;
    }
}
