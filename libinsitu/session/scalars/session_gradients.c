/* Every corner of a cell gives the gradient of the linear function through the corner's value and those at the other
 * ends of its three edges. A pyramid's apex has four edges, and gives one for each three of them. A corner of a
 * polyhedron's face gives one by its two edges there and the line to the cell's centre, which has the mean of the
 * vertices' places and values. So a linear field has its own gradient everywhere, and vertices on a boundary get theirs
 * from the cells on one side.
 *
 * A corner's weight is its determinant over the fourth power of its edges' length l = sqrt(|a|² + |b|² + |c|²). The
 * share of the determinant in l³ tells a good shape from a sliver, which counts for nothing; 1 / l weighs small cells
 * more, whose gradients belong to nearer places. In a mesh whose cells double their size at a vertex the errors of
 * first order cancel. Weight times gradient is a sum of cross products: nothing is divided by a determinant.
 *
 * Edges are taken in the order of coordinates, and each corner's numbers are rounded to whole ones, with 87 bits below
 * the largest of all ranks, before they are summed. So the order of cells, of their vertices and of ranks does not
 * matter. 2^19 corners have room at one vertex. */
#include "session_gradients.h"

#include <stdlib.h>
#include <string.h>

#include "memory.h"
#include "region.h"
#include "vector3.h"

enum { HIGH_BITS = 43 };
#define LOW_UNIT 0x1p44 /* of low words, in a high one's last bit */

typedef struct node {
    double at[3], value;
    int64_t vertex;
} node;

/* The receiver of corners: it sums them, or without sums finds the largest. */
typedef struct target {
    const session_gradient_basis *basis;
    session_gradient_sum *sums;
    double scale;   /* of coordinates: a power of two */
    double unit[2]; /* of the components and of the weights, one more than the last bit of a high word */
    double largest[2];
} target;

/* ---- whole numbers ------------------------------------------------------------------------------------------- */

/* The nearest whole number of one below 2^51, without a call. */
static inline double round_whole(double number)
{
    const double shift = 0x1.8p52;
    return (number + shift) - shift;
}

static inline void add_number(int64_t words[2], double number, double unit)
{
    const double scaled = number * unit, high = round_whole(scaled);
    const int64_t of_high = (int64_t)high, of_low = (int64_t)round_whole((scaled - high) * LOW_UNIT);
#pragma omp atomic
    words[0] += of_high;
#pragma omp atomic
    words[1] += of_low;
}

/* The power of two by which numbers up to largest come to HIGH_BITS bits; 0, so that all are 0, where there is none. */
static double unit_of(double largest)
{
    int exponent = 0;
    frexp(largest, &exponent);
    const double unit = ldexp(1, HIGH_BITS - exponent);
    return largest > 0 && isfinite(unit) ? unit : 0;
}

static void give(target *to, int64_t vertex, const double weighted[3], double weight)
{
    const int32_t entry = to->basis->entries[vertex];
    if (entry < 0 || !(weight > 0) || !isfinite(weighted[0] + weighted[1] + weighted[2]) || !isfinite(weight)) return;
    if (!to->sums) {
        for (int a = 0; a < 3; a++)
            if (fabs(weighted[a]) > to->largest[0]) to->largest[0] = fabs(weighted[a]);
        if (weight > to->largest[1]) to->largest[1] = weight;
        return;
    }
    int64_t *words = to->sums[entry].words;
    for (int a = 0; a < 3; a++) add_number(words + 2 * a, weighted[a], to->unit[0]);
    add_number(words + 6, weight, to->unit[1]);
}

void session_mean_gradient(const session_gradient_sum *sum, float out[3])
{
    double numbers[4];
    for (int i = 0; i < 4; i++) numbers[i] = (double)sum->words[2 * i] * LOW_UNIT + (double)sum->words[2 * i + 1];
    for (int a = 0; a < 3; a++) out[a] = numbers[3] > 0 ? (float)(numbers[a] / numbers[3]) : 0;
}

/* ---- corners ------------------------------------------------------------------------------------------------- */

static bool is_before(const node *a, const node *b)
{
    for (int axis = 0; axis < 3; axis++)
        if (a->at[axis] != b->at[axis]) return a->at[axis] < b->at[axis];
    return false;
}

/* Adds a corner. Mirrored ends change the signs of both the sum and the determinant. */
static void give_corner(target *to, const node *corner, const node *p, const node *q, const node *r)
{
    const node *swap, *ends[3] = {p, q, r};
    double edge[3][3], rise[3], normal[3][3], weighted[3], squares = 0;
    if (is_before(ends[1], ends[0])) swap = ends[0], ends[0] = ends[1], ends[1] = swap;
    if (is_before(ends[2], ends[1])) swap = ends[1], ends[1] = ends[2], ends[2] = swap;
    if (is_before(ends[1], ends[0])) swap = ends[0], ends[0] = ends[1], ends[1] = swap;
    for (int i = 0; i < 3; i++) {
        rise[i] = ends[i]->value - corner->value;
        for (int a = 0; a < 3; a++) {
            edge[i][a] = (ends[i]->at[a] - corner->at[a]) * to->scale;
            squares += edge[i][a] * edge[i][a];
        }
    }
    for (int i = 0; i < 3; i++) vector3_cross(edge[(i + 1) % 3], edge[(i + 2) % 3], normal[i]);
    const double volume = (edge[0][0] * normal[0][0] + edge[0][1] * normal[0][1]) + edge[0][2] * normal[0][2];
    const double scale = (volume < 0 ? -1 : 1) / (squares * squares);
    for (int a = 0; a < 3; a++)
        weighted[a] = ((rise[0] * normal[0][a] + rise[1] * normal[1][a]) + rise[2] * normal[2][a]) * scale;
    give(to, corner->vertex, weighted, volume * scale);
}

static bool take_node(const session_gradient_basis *basis, int64_t vertex, node *out)
{
    grid_vertex(basis->cells, vertex, out->at);
    out->value = grid_field_value(basis->field, vertex);
    out->vertex = vertex;
    return isfinite(out->value);
}

/* Corners of cells of a fixed number of vertices: the corner, and the ends of three edges. */
static const signed char tet_corners[][4] = {{0, 1, 2, 3}, {1, 0, 2, 3}, {2, 0, 1, 3}, {3, 0, 1, 2}};
static const signed char hex_corners[][4] = {{0, 1, 3, 4}, {1, 0, 2, 5}, {2, 1, 3, 6}, {3, 0, 2, 7},
                                             {4, 5, 7, 0}, {5, 4, 6, 1}, {6, 5, 7, 2}, {7, 4, 6, 3}};
static const signed char wedge_corners[][4] = {{0, 1, 2, 3}, {1, 0, 2, 4}, {2, 0, 1, 5},
                                               {3, 4, 5, 0}, {4, 3, 5, 1}, {5, 3, 4, 2}};
static const signed char pyramid_corners[][4] = {{0, 1, 3, 4}, {1, 0, 2, 4}, {2, 1, 3, 4}, {3, 0, 2, 4},
                                                 {4, 0, 1, 2}, {4, 1, 2, 3}, {4, 2, 3, 0}, {4, 3, 0, 1}};

static const signed char (*corners_of(int type, int *count))[4]
{
    *count = type == GRID_TET ? 4 : type == GRID_WEDGE ? 6 : 8;
    return type == GRID_TET     ? tet_corners
           : type == GRID_HEX   ? hex_corners
           : type == GRID_WEDGE ? wedge_corners
                                : pyramid_corners;
}

static void give_cell(target *to, int64_t cell, int type)
{
    int64_t vertices[GRID_MAX_CELL_VERTICES];
    node nodes[GRID_MAX_CELL_VERTICES];
    int corners;
    const signed char(*corner)[4] = corners_of(type, &corners);
    const int count = grid_cell_vertices(to->basis->cells, cell, vertices);
    bool is_finite = true;
    for (int i = 0; i < count; i++) is_finite = take_node(to->basis, vertices[i], &nodes[i]) && is_finite;
    for (int i = 0; i < corners && is_finite; i++)
        if (to->basis->entries[vertices[corner[i][0]]] >= 0)
            give_corner(to, &nodes[corner[i][0]], &nodes[corner[i][1]], &nodes[corner[i][2]], &nodes[corner[i][3]]);
}

/* ---- polyhedra ----------------------------------------------------------------------------------------------- */

/* A thread's room for the vertices of one polyhedron, in the order of coordinates. */
typedef struct node_list {
    node *nodes;
    int64_t count, capacity;
    bool is_out_of_memory;
} node_list;

static int by_place(const void *a, const void *b)
{
    const node *x = a, *y = b;
    if (is_before(x, y)) return -1;
    if (is_before(y, x)) return 1;
    return (x->vertex > y->vertex) - (x->vertex < y->vertex);
}

static bool add_node(node_list *list, const session_gradient_basis *basis, int64_t vertex)
{
    if (list->count == list->capacity) {
        const int64_t capacity = list->capacity ? 2 * list->capacity : 64;
        node *nodes = base_realloc(list->nodes, (size_t)capacity * sizeof *nodes);
        if (!nodes) {
            list->is_out_of_memory = true;
            return false;
        }
        list->nodes = nodes;
        list->capacity = capacity;
    }
    return take_node(basis, vertex, &list->nodes[list->count++]);
}

/* False where a value is not finite, or memory ran out. */
static bool list_nodes(node_list *list, const session_gradient_basis *basis, int64_t cell)
{
    grid_walk walk = grid_walk_cell(basis->cells, cell);
    int64_t vertex, count = 0;
    list->count = 0;
    while (grid_walk_next(&walk, &vertex))
        if (!add_node(list, basis, vertex)) return false;
    qsort(list->nodes, (size_t)list->count, sizeof *list->nodes, by_place);
    for (int64_t i = 0; i < list->count; i++)
        if (count == 0 || list->nodes[i].vertex != list->nodes[count - 1].vertex) list->nodes[count++] = list->nodes[i];
    list->count = count;
    return count > 0;
}

static node centre_of(const node_list *list)
{
    node centre = {{0}, 0, -1};
    for (int64_t i = 0; i < list->count; i++) {
        for (int a = 0; a < 3; a++) centre.at[a] += list->nodes[i].at[a] / (double)list->count;
        centre.value += list->nodes[i].value / (double)list->count;
    }
    return centre;
}

static void give_polyhedron(target *to, int64_t cell, node_list *list)
{
    const session_gradient_basis *basis = to->basis;
    const grid *g = basis->cells;
    int64_t first, end, from, until;
    if (!list_nodes(list, basis, cell)) return;
    const node centre = centre_of(list);
    grid_cell_faces(g, cell, &first, &end);
    for (int64_t i = first; i < end; i++) {
        grid_face_vertices(g, grid_array_index(&g->connectivity, i), &from, &until);
        const int64_t count = until - from;
        for (int64_t n = 0; n < count; n++) {
            node corner, before, after;
            take_node(basis, grid_array_index(&g->face_connectivity, from + n), &corner);
            if (basis->entries[corner.vertex] < 0) continue;
            take_node(basis, grid_array_index(&g->face_connectivity, from + (n + count - 1) % count), &before);
            take_node(basis, grid_array_index(&g->face_connectivity, from + (n + 1) % count), &after);
            give_corner(to, &corner, &before, &after, &centre);
        }
    }
}

/* ---- all cells ----------------------------------------------------------------------------------------------- */

static bool has_entry(const session_gradient_basis *basis, int64_t cell)
{
    if (!grid_is_drawn(basis->cells, cell)) return false;
    grid_walk walk = grid_walk_cell(basis->cells, cell);
    int64_t vertex;
    while (grid_walk_next(&walk, &vertex))
        if (basis->entries[vertex] >= 0) return grid_has_own_value(basis->field, cell);
    return false;
}

/* Cells are counted first, so that no list has to grow while threads fill it. */
bool session_list_cells(const session_gradient_basis *basis, session_cell_list *out)
{
    enum { BLOCK = 4096 };
    const int64_t cells = basis->cells->cell_count, blocks = (cells + BLOCK - 1) / BLOCK;
    int64_t *starts = base_calloc((size_t)blocks + 1, sizeof *starts);
    uint64_t *bits = base_calloc((size_t)blocks * (BLOCK / 64) + 1, sizeof *bits);
    *out = (session_cell_list){0};
    if (!starts || !bits) goto done;
#pragma omp parallel num_threads(basis->threads)
    {
        region_enter();
#pragma omp for schedule(dynamic) nowait
        for (int64_t b = 0; b < blocks; b++)
            for (int64_t cell = b * BLOCK; cell < (b + 1) * BLOCK && cell < cells; cell++)
                if (has_entry(basis, cell)) {
                    bits[cell / 64] |= (uint64_t)1 << cell % 64;
                    starts[b + 1]++;
                }
        region_leave();
    }
    for (int64_t b = 0; b < blocks; b++) starts[b + 1] += starts[b];
    out->cells = base_alloc((size_t)(starts[blocks] ? starts[blocks] : 1) * sizeof *out->cells);
    if (!out->cells) goto done;
    out->count = starts[blocks];
#pragma omp parallel num_threads(basis->threads)
    {
        region_enter();
#pragma omp for schedule(dynamic) nowait
        for (int64_t b = 0; b < blocks; b++) {
            int64_t at = starts[b];
            for (int64_t word = b * (BLOCK / 64); word < (b + 1) * (BLOCK / 64); word++)
                for (uint64_t left = bits[word]; left; left &= left - 1)
                    out->cells[at++] = word * 64 + __builtin_ctzll(left);
        }
        region_leave();
    }
done:
    base_free(starts);
    base_free(bits);
    return out->cells != NULL;
}

static bool give_all(const session_gradient_basis *basis, const session_cell_list *list, const double unit[2],
                     session_gradient_sum *sums, double largest[2])
{
    double of_gradients = 0, of_weights = 0;
    bool is_out_of_memory = false;
#pragma omp parallel num_threads(basis->threads) reduction(max                                                         \
                                                           : of_gradients, of_weights) reduction(||                    \
                                                                                                 : is_out_of_memory)
    {
        region_enter();
        target to = {basis, sums, 1 / basis->length, {unit[0], unit[1]}, {0, 0}};
        node_list nodes = {0};
#pragma omp for schedule(static)
        for (int64_t i = 0; i < list->count; i++) {
            const int type = grid_cell_type(basis->cells, list->cells[i]);
            if (type == GRID_POLYHEDRON)
                give_polyhedron(&to, list->cells[i], &nodes);
            else
                give_cell(&to, list->cells[i], type);
        }
        of_gradients = to.largest[0];
        of_weights = to.largest[1];
        is_out_of_memory = nodes.is_out_of_memory;
        base_free(nodes.nodes);
        region_leave();
    }
    largest[0] = of_gradients;
    largest[1] = of_weights;
    return !is_out_of_memory;
}

bool session_largest_gradients(const session_gradient_basis *basis, const session_cell_list *list, double largest[2])
{
    const double no_unit[2] = {0, 0};
    return give_all(basis, list, no_unit, NULL, largest);
}

bool session_add_gradients(const session_gradient_basis *basis, const session_cell_list *list, const double largest[2],
                           session_gradient_sum *sums)
{
    const double unit[2] = {unit_of(largest[0]), unit_of(largest[1])};
    double unused[2];
    return give_all(basis, list, unit, sums, unused);
}
