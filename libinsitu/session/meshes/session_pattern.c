/* Cells with all nodes of their order are split along the lattice of the nodes: hexes into hexes, wedges into wedges,
 * and so on. The split of a face depends only on the nodes of the face: quads become quads and triangles triangles.
 * Therefore the pieces of neighbouring cells share faces.
 *
 *   A tet of order p is split by the planes of its lattice into tets and octahedra, and each octahedron into four tets
 *   around one of its diagonals, which has the same direction in all octahedra. A pyramid is split into pyramids,
 *   upright and inverted, and tets.
 *
 * Serendipity cells have no nodes inside faces. They are split by their corners and the midpoints of their edges:
 *
 *      +-----m-----+      Each corner is cut off by the midpoints next to it. The remainder of a quad is the quad of
 *      |   /   \   |      its four midpoints. It is split into two triangles by the diagonal from its first node in
 *      | /       \ |      the order of coordinates; the neighbour does the same. The remainder of a straight cell is a
 *      m           m      convex polyhedron with these polygons as faces. It is filled by the tets between its first
 *      | \       / |      node, in the same order, and all triangles that do not contain this node; they split each
 *      |   \   /   |      quad by the diagonal from the quad's first node.
 *      +-----m-----+  */
#include "session_pattern.h"

#include <string.h>

#include "memory.h"
#include "session_cell_order.h"
#include "session_shape.h"

/* ---- pieces of cells with all nodes of their order --------------------------------------------------------------- */

/* The pattern to which pieces are added. In a first pass out->piece_positions and out->types are NULL, and pieces are
 * only counted; in a second pass they are stored. */
typedef struct pattern_list {
    session_pattern *out;
    insitu_vertex_order order;
} pattern_list;

/* Adds a piece to the pattern. nodes: lattice indices i, j, k of each of its vertices. */
static void add_piece(const pattern_list *list, int type, const int nodes[][3])
{
    session_pattern *out = list->out;
    const int count = grid_type_vertex_count(type);
    for (int n = 0; n < count && out->piece_positions; n++)
        out->piece_positions[out->piece_size + n] =
            session_find_node_in_connectivity(&out->nodes, list->order, nodes[n][0], nodes[n][1], nodes[n][2]);
    if (out->types) out->types[out->piece_count] = (unsigned char)type;
    out->piece_count++;
    out->piece_size += count;
}

/* Adds a piece whose vertices are corners of a cube of the lattice. at: lattice indices of the cube's first corner.
 * steps: for each vertex, three bits; bit n is the offset, 0 or 1, that is added to the lattice index along axis n. */
static void add_piece_by_corner_offsets(const pattern_list *list, int type, const int at[3], const signed char *steps)
{
    int nodes[GRID_MAX_CELL_VERTICES][3];
    for (int n = 0; n < grid_type_vertex_count(type); n++)
        for (int axis = 0; axis < 3; axis++) nodes[n][axis] = at[axis] + (steps[n] >> axis & 1);
    add_piece(list, type, (const int(*)[3])nodes);
}

static void list_pieces_of_hex_or_quad(const pattern_list *list, int p)
{
    static const signed char box[] = {0, 1, 3, 2, 4, 5, 7, 6};
    const bool is_hex = list->out->nodes.type == GRID_HEX;
    for (int k = 0; k < (is_hex ? p : 1); k++)
        for (int j = 0; j < p; j++)
            for (int i = 0; i < p; i++)
                add_piece_by_corner_offsets(list, is_hex ? GRID_HEX : GRID_QUAD, (const int[]){i, j, k}, box);
}

static void list_pieces_of_wedge_or_triangle(const pattern_list *list, int p)
{
    static const signed char up[] = {0, 1, 2, 4, 5, 6}, down[] = {1, 3, 2, 5, 7, 6};
    const int type = list->out->nodes.type;
    for (int k = 0; k < (type == GRID_WEDGE ? p : 1); k++)
        for (int j = 0; j < p; j++)
            for (int i = 0; i + j < p; i++) {
                add_piece_by_corner_offsets(list, type, (const int[]){i, j, k}, up);
                if (i + j + 1 < p) add_piece_by_corner_offsets(list, type, (const int[]){i, j, k}, down);
            }
}

static void list_pieces_of_tet(const pattern_list *list, int p)
{
    static const signed char up[] = {0, 1, 2, 4}, down[] = {3, 6, 5, 7};
    static const signed char octahedron[4][4] = {{1, 3, 2, 6}, {1, 5, 3, 6}, {1, 4, 5, 6}, {1, 2, 4, 6}};
    for (int k = 0; k < p; k++)
        for (int j = 0; j + k < p; j++)
            for (int i = 0; i + j + k < p; i++) {
                const int at[3] = {i, j, k}, left = p - 1 - i - j - k;
                add_piece_by_corner_offsets(list, GRID_TET, at, up);
                for (int n = 0; n < 4 && left > 0; n++) add_piece_by_corner_offsets(list, GRID_TET, at, octahedron[n]);
                if (left > 1) add_piece_by_corner_offsets(list, GRID_TET, at, down);
            }
}

/* Lists the pieces of a pyramid of order p. Node i, j of layer k + 1 is above the centre of the quad in layer k whose
 * first node is i, j. */
static void list_pieces_of_pyramid(const pattern_list *list, int p)
{
    for (int k = 0; k < p; k++)
        for (int j = 0; j < p - k; j++)
            for (int i = 0; i < p - k; i++) {
                const int up[5][3] = {{i, j, k}, {i + 1, j, k}, {i + 1, j + 1, k}, {i, j + 1, k}, {i, j, k + 1}};
                const int down[5][3] = {
                    {i, j, k + 1}, {i, j + 1, k + 1}, {i + 1, j + 1, k + 1}, {i + 1, j, k + 1}, {i + 1, j + 1, k}};
                const int along_i[4][3] = {{i + 1, j, k}, {i + 1, j + 1, k}, {i, j, k + 1}, {i + 1, j, k + 1}};
                const int along_j[4][3] = {{i + 1, j + 1, k}, {i, j + 1, k}, {i, j, k + 1}, {i, j + 1, k + 1}};
                const bool has_next_i = i + 1 < p - k, has_next_j = j + 1 < p - k;
                add_piece(list, GRID_PYRAMID, up);
                if (has_next_i && has_next_j) add_piece(list, GRID_PYRAMID, down);
                if (has_next_i) add_piece(list, GRID_TET, along_i);
                if (has_next_j) add_piece(list, GRID_TET, along_j);
            }
}

static void list_pieces(const pattern_list *list)
{
    const int p = list->out->nodes.order;
    list->out->piece_count = list->out->piece_size = 0;
    switch (list->out->nodes.type) {
    case GRID_HEX:
    case GRID_QUAD: list_pieces_of_hex_or_quad(list, p); break;
    case GRID_WEDGE:
    case GRID_TRIANGLE: list_pieces_of_wedge_or_triangle(list, p); break;
    case GRID_TET: list_pieces_of_tet(list, p); break;
    default: list_pieces_of_pyramid(list, p); break;
    }
}

/* ---- serendipity cells ----------------------------------------------------------------------------------------- */

/* Returns the index, in VTK's order of nodes, of the node in the middle of the edge between corners a and b; -1 if
 * there is no such edge. */
static int find_midpoint(const session_shape *shape, int a, int b)
{
    for (int e = 0; e < shape->edge_count; e++)
        if ((shape->edges[e][0] == a && shape->edges[e][1] == b) ||
            (shape->edges[e][0] == b && shape->edges[e][1] == a))
            return shape->corner_count + e;
    return -1;
}

/* Adds the polygon that cuts off a corner: the midpoints of the edges at the corner. */
static void add_polygon_at_corner(session_pattern *out, const session_shape *shape, int corner)
{
    pattern_polygon *cut = &out->polygons[out->polygon_count++];
    *cut = (pattern_polygon){.corner = corner};
    for (int e = 0; e < shape->edge_count; e++)
        if (shape->edges[e][0] == corner || shape->edges[e][1] == corner)
            cut->nodes[cut->count++] = shape->corner_count + e;
}

/* Returns the coordinates of a node in the reference cell. The apex of a pyramid has the same x and y as its first
 * corner. */
static void reference_position(const session_shape *shape, int node, double out[3])
{
    const int corners = shape->corner_count;
    const int a = node < corners ? node : shape->edges[node - corners][0];
    const int b = node < corners ? node : shape->edges[node - corners][1];
    for (int axis = 0; axis < 3; axis++) out[axis] = 0.5 * (shape->corners[a][axis] + shape->corners[b][axis]);
}

/* Orients the polygon counterclockwise as seen from outside the polyhedron that the polygons bound. */
static void orient_outwards(const session_shape *shape, pattern_polygon *p)
{
    double a[3], b[3], c[3], middle[3] = {0, 0, 0}, volume = 0;
    const int corners = shape->corner_count;
    for (int n = 0; n < corners; n++) {
        reference_position(shape, n, a);
        for (int axis = 0; axis < 3; axis++) middle[axis] += a[axis] / corners;
    }
    reference_position(shape, p->nodes[0], a);
    reference_position(shape, p->nodes[1], b);
    reference_position(shape, p->nodes[2], c);
    for (int axis = 0; axis < 3; axis++) {
        const int next = (axis + 1) % 3, last = (axis + 2) % 3;
        const double normal = (b[next] - a[next]) * (c[last] - a[last]) - (b[last] - a[last]) * (c[next] - a[next]);
        volume += normal * (a[axis] - middle[axis]);
    }
    if (volume >= 0) return;
    for (int n = 0, m = p->count - 1; n < m; n++, m--) {
        const int node = p->nodes[n];
        p->nodes[n] = p->nodes[m];
        p->nodes[m] = node;
    }
}

/* Finds the midpoints of a serendipity cell's edges, and the polygons by which the cell is split
 * (session_pattern.h). */
static void find_splitting_polygons(session_pattern *out, insitu_vertex_order order)
{
    const session_shape *shape = session_get_cell_shape(out->nodes.type);
    const int corners = shape->corner_count;
    for (int c = 0; c < corners; c++) add_polygon_at_corner(out, shape, c);
    for (int f = 0; f < shape->face_count; f++) {
        pattern_polygon *face = &out->polygons[out->polygon_count++];
        *face = (pattern_polygon){.corner = -1, .count = shape->faces[f][3] < 0 ? 3 : 4};
        for (int n = 0; n < face->count; n++)
            face->nodes[n] = find_midpoint(shape, shape->faces[f][n], shape->faces[f][(n + 1) % face->count]);
    }
    for (int i = 0; i < out->polygon_count; i++) {
        pattern_polygon *p = &out->polygons[i];
        if (p->count > 2 && shape->type != GRID_QUAD) orient_outwards(shape, p);
        for (int n = 0; n < p->count; n++)
            p->nodes[n] = session_convert_quadratic_node_index(&out->nodes, order, p->nodes[n]);
    }
    out->midpoint_count = shape->edge_count;
    for (int e = 0; e < out->midpoint_count; e++)
        out->midpoints[e] = session_convert_quadratic_node_index(&out->nodes, order, corners + e);
}

/* Splits a polygon into triangles of the same orientation by the diagonals from the node that comes first in the order
 * of coordinates. */
static int split_into_triangles(const pattern_polygon *p, const int *ranks, int triangles[2][3])
{
    int first = 0;
    for (int n = 1; n < p->count; n++)
        if (ranks[p->nodes[n]] < ranks[p->nodes[first]]) first = n;
    for (int t = 0; t + 2 < p->count; t++) {
        triangles[t][0] = p->nodes[first];
        triangles[t][1] = p->nodes[(first + t + 1) % p->count];
        triangles[t][2] = p->nodes[(first + t + 2) % p->count];
    }
    return p->count - 2;
}

static bool has_node(const pattern_polygon *p, int node)
{
    bool has = false;
    for (int n = 0; n < p->count; n++) has = has || p->nodes[n] == node;
    return has;
}

/* Splits a serendipity quad into triangles. Parameters and result are those of session_split_serendipity_cell(). */
static int split_quad(const session_pattern *of, const int *ranks, int pieces[][4])
{
    int count = 0, triangles[2][3];
    for (int i = 0; i < of->polygon_count; i++) {
        const pattern_polygon *p = &of->polygons[i];
        for (int n = 0; n < p->count && p->corner >= 0; n++) pieces[count][n] = p->nodes[n];
        if (p->corner >= 0) pieces[count++][2] = p->corner;
        const int cut = p->corner < 0 ? split_into_triangles(p, ranks, triangles) : 0;
        for (int t = 0; t < cut; t++) memcpy(pieces[count++], triangles[t], sizeof triangles[t]);
    }
    return count;
}

int session_split_serendipity_cell(const session_pattern *pattern, const int *ranks, int pieces[PATTERN_MOST_LOOSE][4])
{
    int count = 0, apex = pattern->midpoints[0], triangles[2][3];
    if (pattern->nodes.type == GRID_QUAD) return split_quad(pattern, ranks, pieces);
    for (int n = 1; n < pattern->midpoint_count; n++)
        if (ranks[pattern->midpoints[n]] < ranks[apex]) apex = pattern->midpoints[n];
    for (int i = 0; i < pattern->polygon_count; i++) {
        const pattern_polygon *p = &pattern->polygons[i];
        const int cut = split_into_triangles(p, ranks, triangles);
        for (int t = 0; t < cut; t++) {
            const int *of = triangles[t];
            if (p->corner >= 0) memcpy(pieces[count++], (const int[]){of[0], of[1], of[2], p->corner}, 4 * sizeof *of);
            if (!has_node(p, apex)) memcpy(pieces[count++], (const int[]){of[0], of[2], of[1], apex}, 4 * sizeof *of);
        }
    }
    return count;
}

/* ---- patterns of all types of cells ------------------------------------------------------------------------------ */

static bool make_pattern_of_linear_cell(int type, insitu_vertex_order order, session_pattern *out)
{
    const signed char *turn = session_vertex_permutation(order, type);
    out->piece_count = 1;
    out->piece_size = grid_type_vertex_count(type);
    out->types = base_alloc(1);
    out->piece_positions = base_alloc((size_t)out->piece_size * sizeof *out->piece_positions);
    if (!out->types || !out->piece_positions) return false;
    out->types[0] = (unsigned char)type;
    for (int n = 0; n < out->piece_size; n++) out->piece_positions[n] = turn ? turn[n] : n;
    return true;
}

bool session_make_split_pattern(int type, const session_nodes *nodes, insitu_vertex_order order, session_pattern *out)
{
    *out = (session_pattern){.type = type, .nodes = *nodes};
    if (type == nodes->type) return make_pattern_of_linear_cell(type, order, out);
    if (!nodes->is_complete) {
        find_splitting_polygons(out, order);
        return true;
    }
    const pattern_list list = {out, order};
    list_pieces(&list);
    out->types = base_alloc((size_t)out->piece_count);
    out->piece_positions = base_alloc((size_t)out->piece_size * sizeof *out->piece_positions);
    if (!out->types || !out->piece_positions) return false;
    list_pieces(&list);
    return true;
}

void session_drop_split_pattern(session_pattern *pattern)
{
    base_free(pattern->types);
    base_free(pattern->piece_positions);
    *pattern = (session_pattern){0};
}
