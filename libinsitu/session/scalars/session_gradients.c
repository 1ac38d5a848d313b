/* Every corner of a cell contributes the gradient of the linear function that interpolates the value at the corner and
 * the values at the other ends of its three edges. The apex of a pyramid has four edges, and contributes one gradient
 * for each triple of them. A corner of a polyhedron's face contributes one gradient, which is computed from the two
 * edges at the corner and the line to the cell's centre. The value at the centre is assumed to be the mean of the
 * vertices' values. At a corner of a shell the gradient is computed from its two edges and the shell's normal; the
 * field is assumed to be constant along the normal. Therefore the gradient of a linear field is exact at all vertices,
 * and gradients at vertices on a boundary are computed from the cells on one side.
 *
 * A cell of higher order contributes at each of its nodes the gradient of its polynomial there. In this case the
 * derivatives of the position along the axes of the reference cell replace the edges, and the derivatives of the field
 * replace the differences.
 *
 * The weight of a corner is the determinant of its edges a, b and c, divided by the fourth power of the corner's length
 * l = sqrt(|a|² + |b|² + |c|²). The ratio of the determinant to l³ distinguishes a well-shaped corner from a sliver,
 * whose weight is almost 0. The factor 1 / l gives small cells more weight, because their gradients are approximations
 * at positions nearer to the vertex. With this weight, errors of first order cancel in a mesh whose cells double their
 * size at a vertex. The product of weight and gradient is a sum of cross products, so that no division by a determinant
 * is needed.
 *
 * Edges are sorted by coordinates, and each corner's numbers are rounded to integers before they are summed. Therefore
 * the result does not depend on the order of cells, of their vertices, or of ranks. The value of the integers' last bit
 * is chosen from bounds that are the same on all ranks. Let R be the largest difference of values along an edge, and l
 * the least length of a corner. Then no weight exceeds 3^-1.5 / l, and no weighted gradient exceeds R / l²: a cross
 * product of two edges is at most half of the sum of their squares, so that three of them, times differences of at most
 * R, sum to at most R l². The last bit is 2^-86 of the bound, so that fields that change little from vertex to vertex
 * keep the precision of doubles. Corners shorter than 2^-32 of the scene are ignored, because the bounds for them would
 * make the last bit too coarse for all other corners. A sum can contain 2^19 corners at one vertex. */
#include "session_gradients.h"

#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "memory.h"
#include "session_region.h"
#include "vector3.h"

enum { HIGH_BITS = 43, MOST_NUMBERS = 10 };
#define LOW_UNIT 0x1p44 /* value of one unit of a high word, in units of a low word */
/* A corner adds no gradient if the squared lengths of the cell's edges at the corner add up to less than this, in units
 * of the square of session_gradient_basis.length. */
#define LEAST_SQUARE 0x1p-64
#define ROUNDING_SHIFT                                                                                                 \
    0x1.8p52 /* when this is added to a number below 2^51, the last bits of the result contain the nearest integer */

typedef struct node {
    double position[3], values[SESSION_GRADIENTS];
    int64_t vertex;
} node;

/* Two numbers that are rounded and summed together in one vector register. */
typedef double number_pair __attribute__((vector_size(16)));
typedef int64_t word_pair __attribute__((vector_size(16)));

/* The data with which one thread adds the contributions of corners. They are added to fixed-point sums or, if `sums` is
 * NULL, to the bounds from which the value of the last bit of these sums is chosen. */
typedef struct target {
    const session_gradient_basis *basis;
    int64_t *sums;
    /* for each sum, the thread that adds to it, as recorded by record_adding_thread(); NULL: there is only one
     * thread */
    unsigned char *owners;
    unsigned char owner; /* value that stands for this thread in `owners` */
    double scale;        /* factor by which coordinates are multiplied, a power of two */
    /* factors by which the numbers are multiplied before they are rounded to integers (find_rounding_units()) */
    number_pair units[MOST_NUMBERS / 2];
    session_gradient_bounds bounds;
} target;

/* ---- rounding to integers ------------------------------------------------------------------------------------ */

/* Returns the power of two by which numbers up to `largest` are multiplied, so that they fit into HIGH_BITS bits.
 * Returns 0 if `largest` is 0 or too small; all products are then 0. */
static double find_scale_to_fit_high_bits(double largest)
{
    int exponent = 0;
    frexp(largest, &exponent);
    const double unit = ldexp(1, HIGH_BITS - exponent);
    return largest > 0 && isfinite(unit) ? unit : 0;
}

/* Computes the factors by which weighted gradients (units[0]) and weights (units[1]) are multiplied before they are
 * rounded to integers. */
static void find_rounding_units(const session_gradient_bounds *bounds, double units[2])
{
    units[0] = find_scale_to_fit_high_bits(bounds->largest_difference * bounds->largest_inverse_square);
    units[1] = find_scale_to_fit_high_bits(0.2 * sqrt(bounds->largest_inverse_square));
}

static inline word_pair extract_rounded_integers(number_pair whole_with_shift)
{
    word_pair words, shift;
    const number_pair shifts = {ROUNDING_SHIFT, ROUNDING_SHIFT};
    memcpy(&words, &whole_with_shift, sizeof words);
    memcpy(&shift, &shifts, sizeof shift);
    return words - shift;
}

static void add_atomically(int64_t *to, word_pair words)
{
    for (int i = 0; i < 2; i++) {
#pragma omp atomic
        to[i] += words[i];
    }
}

/* Rounds numbers to pairs of a high and a low word, and adds these to the words of a sum, two numbers at a time. */
static inline __attribute__((always_inline)) void add_numbers_to_fixed_point_sum(const target *to, int32_t entry,
                                                                                 const number_pair *numbers, int pairs)
{
    const number_pair shift = {ROUNDING_SHIFT, ROUNDING_SHIFT}, low_unit = {LOW_UNIT, LOW_UNIT};
    int64_t *sum = to->sums + (int64_t)entry * 4 * pairs;
    const bool is_own = !to->owners || to->owners[entry] == to->owner;
    for (int i = 0; i < pairs; i++) {
        const number_pair scaled = numbers[i] * to->units[i], high = scaled + shift;
        const number_pair low = (scaled - (high - shift)) * low_unit + shift;
        word_pair of_high = extract_rounded_integers(high), of_low = extract_rounded_integers(low);
        if (is_own) {
            word_pair words[2];
            memcpy(&words[0], sum + 2 * i, sizeof of_high);
            memcpy(&words[1], sum + 2 * (pairs + i), sizeof of_low);
            words[0] += of_high;
            words[1] += of_low;
            memcpy(sum + 2 * i, &words[0], sizeof of_high);
            memcpy(sum + 2 * (pairs + i), &words[1], sizeof of_low);
        } else {
            add_atomically(sum + 2 * i, of_high);
            add_atomically(sum + 2 * (pairs + i), of_low);
        }
    }
}

void session_compute_mean_gradients(const int64_t *sum, int field_count, const session_gradient_bounds *bounds,
                                    double length, double out[][3])
{
    const int count = session_count_sum_numbers(field_count);
    double units[2], numbers[MOST_NUMBERS];
    find_rounding_units(bounds, units);
    for (int i = 0; i < count; i++) numbers[i] = (double)sum[i] * LOW_UNIT + (double)sum[count + i];
    const double weight = numbers[3 * field_count];
    const double scale = units[0] > 0 ? units[1] / units[0] / length : 0;
    for (int f = 0; f < field_count; f++)
        for (int a = 0; a < 3; a++) out[f][a] = weight > 0 ? numbers[3 * f + a] / weight * scale : (double)NAN;
}

/* ---- contributions of corners -------------------------------------------------------------------------------- */

static inline bool is_lexicographically_smaller(const node *a, const node *b)
{
    if (a->position[0] != b->position[0]) return a->position[0] < b->position[0];
    if (a->position[1] != b->position[1]) return a->position[1] < b->position[1];
    return a->position[2] < b->position[2];
}

static inline __attribute__((always_inline)) void
update_gradient_bounds(target *to, double squares, const double rise[3][SESSION_GRADIENTS], int field_count)
{
    for (int i = 0; i < 3; i++)
        for (int f = 0; f < field_count; f++)
            if (fabs(rise[i][f]) > to->bounds.largest_difference) to->bounds.largest_difference = fabs(rise[i][f]);
    if (1 / squares > to->bounds.largest_inverse_square) to->bounds.largest_inverse_square = 1 / squares;
}

/* Adds the gradient at a corner of a cell to the sum of a vertex. The gradient is computed from the corner's three
 * sorted edges and the differences of the fields along these edges. If two edges are exchanged, both the weighted
 * gradient and the determinant change their signs, so that their quotient remains the same. */
static inline __attribute__((always_inline)) void add_edge_gradient(target *to, int64_t vertex, const double edge[3][3],
                                                                    const double rise[3][SESSION_GRADIENTS],
                                                                    int field_count)
{
    const int pairs = session_count_sum_numbers(field_count) / 2;
    double normal[3][3], squares = 0;
    union {
        double numbers[MOST_NUMBERS];
        number_pair pairs[MOST_NUMBERS / 2];
    } out = {{0}};
    const int32_t entry = to->basis->sum_indices[vertex];
    for (int i = 0; i < 3; i++)
        for (int a = 0; a < 3; a++) squares += edge[i][a] * edge[i][a];
    if (entry < 0 || !(squares >= LEAST_SQUARE)) return;
    if (!to->sums) {
        update_gradient_bounds(to, squares, rise, field_count);
        return;
    }
    for (int i = 0; i < 3; i++) vector3_cross(edge[(i + 1) % 3], edge[(i + 2) % 3], normal[i]);
    const double volume = (edge[0][0] * normal[0][0] + edge[0][1] * normal[0][1]) + edge[0][2] * normal[0][2];
    const double scale = (volume < 0 ? -1 : 1) / (squares * squares);
    double sum = out.numbers[3 * field_count] = volume * scale;
    for (int f = 0; f < field_count; f++)
        for (int a = 0; a < 3; a++)
            sum += out.numbers[3 * f + a] =
                ((rise[0][f] * normal[0][a] + rise[1][f] * normal[1][a]) + rise[2][f] * normal[2][a]) * scale;
    if (out.numbers[3 * field_count] > 0 && isfinite(sum)) add_numbers_to_fixed_point_sum(to, entry, out.pairs, pairs);
}

static inline __attribute__((always_inline)) void add_gradient_at_corner(target *to, const node *corner, const node *p,
                                                                         const node *q, const node *r, int field_count)
{
    const node *swap, *ends[3] = {p, q, r};
    double edge[3][3], rise[3][SESSION_GRADIENTS];
    if (is_lexicographically_smaller(ends[1], ends[0])) swap = ends[0], ends[0] = ends[1], ends[1] = swap;
    if (is_lexicographically_smaller(ends[2], ends[1])) swap = ends[1], ends[1] = ends[2], ends[2] = swap;
    if (is_lexicographically_smaller(ends[1], ends[0])) swap = ends[0], ends[0] = ends[1], ends[1] = swap;
    for (int i = 0; i < 3; i++) {
        for (int f = 0; f < field_count; f++) rise[i][f] = ends[i]->values[f] - corner->values[f];
        for (int a = 0; a < 3; a++) edge[i][a] = ends[i]->position[a] - corner->position[a];
    }
    add_edge_gradient(to, corner->vertex, (const double(*)[3])edge, (const double(*)[SESSION_GRADIENTS])rise,
                      field_count);
}

/* Sets the third edge at a corner of a shell to a normal of the shell. Its length is the square root of the area that
 * the other two edges span. Its direction may be either of the two, because the field does not vary along the
 * normal. */
static void set_normal_edge(double edge[3][3])
{
    vector3_cross(edge[0], edge[1], edge[2]);
    const double area = sqrt(vector3_dot(edge[2], edge[2])), scale = 1 / sqrt(area);
    for (int a = 0; a < 3; a++) edge[2][a] *= scale;
}

static void add_shell_corner_gradient(target *to, const node *corner, const node *p, const node *q)
{
    const int field_count = to->basis->field_count;
    const bool is_swapped = is_lexicographically_smaller(q, p);
    const node *ends[2] = {is_swapped ? q : p, is_swapped ? p : q};
    double edge[3][3], rise[3][SESSION_GRADIENTS] = {{0}};
    for (int i = 0; i < 2; i++) {
        for (int f = 0; f < field_count; f++) rise[i][f] = ends[i]->values[f] - corner->values[f];
        for (int a = 0; a < 3; a++) edge[i][a] = ends[i]->position[a] - corner->position[a];
    }
    set_normal_edge(edge);
    add_edge_gradient(to, corner->vertex, (const double(*)[3])edge, (const double(*)[SESSION_GRADIENTS])rise,
                      field_count);
}

/* Reads a vertex's position, multiplied by `scale`, and its values. Returns false if a value is not finite. */
static inline __attribute__((always_inline)) bool read_node(const session_gradient_basis *basis, int64_t vertex,
                                                            double scale, int field_count, node *out)
{
    double sum = 0;
    for (int a = 0; a < 3; a++) out->position[a] = grid_read_number(&basis->cells->coordinates[a], vertex) * scale;
    for (int f = 0; f < field_count; f++) sum += out->values[f] = grid_field_value(&basis->fields[f], vertex);
    out->vertex = vertex;
    return isfinite(sum);
}

/* The corners of each type of cell with a fixed number of vertices. Each row is a corner, followed by the other ends of
 * its three edges. */
static const signed char tet_corners[][4] = {{0, 1, 2, 3}, {1, 0, 2, 3}, {2, 0, 1, 3}, {3, 0, 1, 2}};
static const signed char hex_corners[][4] = {{0, 1, 3, 4}, {1, 0, 2, 5}, {2, 1, 3, 6}, {3, 0, 2, 7},
                                             {4, 5, 7, 0}, {5, 4, 6, 1}, {6, 5, 7, 2}, {7, 4, 6, 3}};
static const signed char wedge_corners[][4] = {{0, 1, 2, 3}, {1, 0, 2, 4}, {2, 0, 1, 5},
                                               {3, 4, 5, 0}, {4, 3, 5, 1}, {5, 3, 4, 2}};
static const signed char pyramid_corners[][4] = {{0, 1, 3, 4}, {1, 0, 2, 4}, {2, 1, 3, 4}, {3, 0, 2, 4},
                                                 {4, 0, 1, 2}, {4, 1, 2, 3}, {4, 2, 3, 0}, {4, 3, 0, 1}};

static inline __attribute__((always_inline)) void add_gradients_at_cell_corners(target *to, int64_t cell, int type,
                                                                                const signed char (*corners)[4],
                                                                                int corner_count, int field_count)
{
    const session_gradient_basis *basis = to->basis;
    const int count = grid_type_vertex_count(type);
    int64_t vertices[GRID_MAX_CELL_VERTICES];
    node nodes[GRID_MAX_CELL_VERTICES];
    bool is_finite = true;
    grid_cell_vertices(basis->cells, cell, vertices);
    for (int i = 0; i < count; i++)
        is_finite = read_node(basis, vertices[i], to->scale, field_count, &nodes[i]) && is_finite;
    for (int i = 0; i < corner_count && is_finite; i++)
        add_gradient_at_corner(to, &nodes[corners[i][0]], &nodes[corners[i][1]], &nodes[corners[i][2]],
                               &nodes[corners[i][3]], field_count);
}

#define ADD_CELL_CORNERS(type, corners)                                                                                \
    add_gradients_at_cell_corners(to, cell, type, corners, sizeof corners / sizeof *corners, field_count)

static inline __attribute__((always_inline)) void add_gradients_of_cell_type(target *to, int64_t cell, int type,
                                                                             int field_count)
{
    switch (type) {
    case GRID_TET: ADD_CELL_CORNERS(GRID_TET, tet_corners); break;
    case GRID_HEX: ADD_CELL_CORNERS(GRID_HEX, hex_corners); break;
    case GRID_WEDGE: ADD_CELL_CORNERS(GRID_WEDGE, wedge_corners); break;
    default: ADD_CELL_CORNERS(GRID_PYRAMID, pyramid_corners); break;
    }
}

/* Adds the contributions of all corners of a tet, hex, wedge or pyramid. */
static void add_gradients_of_solid_cell(target *to, int64_t cell, int type)
{
    switch (to->basis->field_count) {
    case 1: add_gradients_of_cell_type(to, cell, type, 1); break;
    case 2: add_gradients_of_cell_type(to, cell, type, 2); break;
    default: add_gradients_of_cell_type(to, cell, type, 3); break;
    }
}

/* ---- polyhedra and shells ------------------------------------------------------------------------------------- */

/* A thread's buffer for the vertices of one cell. */
typedef struct node_list {
    node *nodes;
    int64_t count, capacity;
    bool is_out_of_memory;
} node_list;

static int compare_nodes(const void *a, const void *b)
{
    const node *x = a, *y = b;
    if (is_lexicographically_smaller(x, y)) return -1;
    if (is_lexicographically_smaller(y, x)) return 1;
    return (x->vertex > y->vertex) - (x->vertex < y->vertex);
}

/* Ensures that the list has space for `count` nodes. */
static bool reserve_nodes(node_list *list, int64_t count)
{
    if (count <= list->capacity) return true;
    const int64_t capacity = count < 64 ? 64 : 2 * count;
    node *nodes = base_realloc(list->nodes, (size_t)capacity * sizeof *nodes);
    list->is_out_of_memory = list->is_out_of_memory || !nodes;
    if (!nodes) return false;
    list->nodes = nodes;
    list->capacity = capacity;
    return true;
}

static bool add_node(node_list *list, target *to, int64_t vertex)
{
    if (!reserve_nodes(list, list->count + 1)) return false;
    return read_node(to->basis, vertex, to->scale, to->basis->field_count, &list->nodes[list->count++]);
}

/* Lists the cell's vertices in the cell's own order. Returns false if a value is not finite, or if memory runs out. */
static bool list_nodes(node_list *list, target *to, int64_t cell)
{
    grid_walk walk = grid_walk_cell(to->basis->cells, cell);
    int64_t vertex;
    list->count = 0;
    while (grid_walk_next(&walk, &vertex))
        if (!add_node(list, to, vertex)) return false;
    return list->count > 0;
}

/* Returns the mean of the listed vertices. Vertices that occur several times are counted once, and vertices are added
 * in the order of their coordinates, so that the result does not depend on the order of faces. */
static node find_centre(node_list *list, int field_count)
{
    node centre = {.vertex = -1};
    int64_t count = 0;
    qsort(list->nodes, (size_t)list->count, sizeof *list->nodes, compare_nodes);
    for (int64_t i = 0; i < list->count; i++)
        if (count == 0 || list->nodes[i].vertex != list->nodes[count - 1].vertex) list->nodes[count++] = list->nodes[i];
    list->count = count;
    for (int64_t i = 0; i < count; i++) {
        for (int a = 0; a < 3; a++) centre.position[a] += list->nodes[i].position[a] / (double)count;
        for (int f = 0; f < field_count; f++) centre.values[f] += list->nodes[i].values[f] / (double)count;
    }
    return centre;
}

static void add_gradients_of_polyhedron(target *to, int64_t cell, node_list *list)
{
    const session_gradient_basis *basis = to->basis;
    const grid *g = basis->cells;
    int64_t first, end, from, until;
    if (!list_nodes(list, to, cell)) return;
    const node centre = find_centre(list, basis->field_count);
    grid_cell_faces(g, cell, &first, &end);
    for (int64_t i = first; i < end; i++) {
        grid_face_vertices(g, grid_read_index(&g->connectivity, i), &from, &until);
        const int64_t count = until - from;
        for (int64_t n = 0; n < count; n++) {
            node nodes[3]; /* vertices of the face before the corner, at the corner, and after it */
            for (int k = 0; k < 3; k++)
                read_node(basis, grid_read_index(&g->face_connectivity, from + (n + count + k - 1) % count), to->scale,
                          basis->field_count, &nodes[k]);
            add_gradient_at_corner(to, &nodes[1], &nodes[0], &nodes[2], &centre, basis->field_count);
        }
    }
}

static void add_gradients_of_shell(target *to, int64_t cell, node_list *list)
{
    if (!list_nodes(list, to, cell)) return;
    for (int64_t n = 0; n < list->count; n++)
        add_shell_corner_gradient(to, &list->nodes[n], &list->nodes[(n + list->count - 1) % list->count],
                                  &list->nodes[(n + 1) % list->count]);
}

/* ---- listing the cells that contribute ----------------------------------------------------------------------- */

static bool has_finite_cell_values(const session_gradient_basis *basis, int64_t cell)
{
    for (int f = 0; f < basis->field_count; f++)
        if (!grid_has_finite_cell_value(&basis->fields[f], cell)) return false;
    return true;
}

/* Returns whether the cell contributes to sums. If of_shells is set, shells contribute; otherwise drawn cells with a
 * volume do. */
static bool does_drawn_cell_contribute(const session_gradient_basis *basis, int64_t cell)
{
    return basis->of_shells ? !grid_is_ghost(basis->cells, cell) && grid_is_shell(basis->cells, cell)
                            : grid_is_drawn(basis->cells, cell);
}

/* Returns whether one of the caller's cells is drawn, and a sum of gradients is computed at one of its nodes. The cells
 * must be those of basis->polynomials. */
static bool does_polynomial_cell_contribute(const session_gradient_basis *basis, int64_t cell)
{
    const session_polynomials *p = basis->polynomials;
    const int64_t size = session_count_nodes_of_cell(&p->rows, cell);
    int64_t piece = p->first_pieces[cell];
    while (piece < p->first_pieces[cell + 1] && !does_drawn_cell_contribute(basis, piece)) piece++;
    if (piece == p->first_pieces[cell + 1]) return false;
    for (int n = 0; n < size; n++)
        if (basis->sum_indices[session_find_vertex_of_node(&p->rows, cell, n)] >= 0) return true;
    return false;
}

static bool does_cell_contribute(const session_gradient_basis *basis, int64_t cell)
{
    if (basis->polynomials) return does_polynomial_cell_contribute(basis, cell);
    if (!does_drawn_cell_contribute(basis, cell)) return false;
    grid_walk walk = grid_walk_cell(basis->cells, cell);
    int64_t vertex;
    while (grid_walk_next(&walk, &vertex))
        if (basis->sum_indices[vertex] >= 0) return has_finite_cell_values(basis, cell);
    return false;
}

/* Lists the cells with a vertex at which a sum is computed (sum_indices). The cells are counted first, so that threads
 * can fill a list of fixed size. */
bool session_list_cells_with_sums(const session_gradient_basis *basis, session_cell_list *out)
{
    enum { BLOCK = 4096 };
    const int64_t cells = basis->polynomials ? basis->polynomials->cell_count : basis->cells->cell_count;
    const int64_t blocks = (cells + BLOCK - 1) / BLOCK;
    int64_t *starts = base_calloc((size_t)blocks + 1, sizeof *starts);
    uint64_t *bits = base_calloc((size_t)blocks * (BLOCK / 64) + 1, sizeof *bits);
    *out = (session_cell_list){0};
    if (!starts || !bits) goto done;
#pragma omp parallel num_threads(session_choose_loop_threads(basis->threads, cells))
    {
        region_enter();
#pragma omp for schedule(dynamic) nowait
        for (int64_t b = 0; b < blocks; b++)
            for (int64_t cell = b * BLOCK; cell < (b + 1) * BLOCK && cell < cells; cell++)
                if (does_cell_contribute(basis, cell)) {
                    bits[cell / 64] |= (uint64_t)1 << cell % 64;
                    starts[b + 1]++;
                }
        region_leave();
    }
    for (int64_t b = 0; b < blocks; b++) starts[b + 1] += starts[b];
    out->cells = base_alloc((size_t)(starts[blocks] ? starts[blocks] : 1) * sizeof *out->cells);
    if (!out->cells) goto done;
    out->count = starts[blocks];
#pragma omp parallel num_threads(session_choose_loop_threads(basis->threads, cells))
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

/* ---- summing over the listed cells ----------------------------------------------------------------------------- */

static void add_gradients_of_linear_cell(target *to, int64_t cell, node_list *buffer)
{
    const int type = grid_cell_type(to->basis->cells, cell);
    if (type == GRID_POLYHEDRON)
        add_gradients_of_polyhedron(to, cell, buffer);
    else if (to->basis->of_shells)
        add_gradients_of_shell(to, cell, buffer);
    else
        add_gradients_of_solid_cell(to, cell, type);
}

/* Adds the gradient of a cell's polynomial at its n-th node to the sum of this node, if a sum is computed there. */
static void add_polynomial_gradient_at_node(target *to, const session_derivatives *d, const node_list *row, int n)
{
    const int field_count = to->basis->field_count;
    const node *at = &row->nodes[n];
    double edge[3][3] = {{0}}, rise[3][SESSION_GRADIENTS] = {{0}}, sum = 0;
    if (to->basis->sum_indices[at->vertex] < 0) return;
    for (int axis = 0; axis < d->axis_count; axis++) {
        const int *starts = d->starts + d->axis_count * n + axis;
        for (int t = starts[0]; t < starts[1]; t++) {
            const node *of = &row->nodes[d->nodes[t]];
            const double weight = d->weights[t];
            for (int a = 0; a < 3; a++) edge[axis][a] += weight * (of->position[a] - at->position[a]);
            for (int f = 0; f < field_count; f++) rise[axis][f] += weight * (of->values[f] - at->values[f]);
        }
        for (int f = 0; f < field_count; f++) sum += rise[axis][f];
    }
    if (d->axis_count == 2) set_normal_edge(edge);
    if (isfinite(sum))
        add_edge_gradient(to, at->vertex, (const double(*)[3])edge, (const double(*)[SESSION_GRADIENTS])rise,
                          field_count);
}

/* Reads one node in a cell's list of nodes (row), unless it has been read before. Returns whether its values are
 * finite. */
static bool read_row_node(target *to, int64_t cell, node_list *row, int n)
{
    if (row->nodes[n].vertex >= 0) return true;
    return read_node(to->basis, session_find_vertex_of_node(&to->basis->polynomials->rows, cell, n), to->scale,
                     to->basis->field_count, &row->nodes[n]);
}

/* Reads those nodes of a cell at which sums are computed, and the nodes from which the derivatives at these nodes are
 * computed. If the cell is refined but only few of its linear pieces are made, these nodes are few. Returns whether all
 * values are finite. */
static bool read_summed_nodes(target *to, int64_t cell, const session_derivatives *d, node_list *row, int size)
{
    const session_polynomials *p = to->basis->polynomials;
    bool is_finite = true;
    for (int n = 0; n < size; n++) row->nodes[n].vertex = -1;
    for (int n = 0; n < size && is_finite; n++) {
        if (to->basis->sum_indices[session_find_vertex_of_node(&p->rows, cell, n)] < 0) continue;
        is_finite = read_row_node(to, cell, row, n);
        const int end = d->starts[d->axis_count * (n + 1)];
        for (int t = d->starts[d->axis_count * n]; t < end && is_finite; t++)
            is_finite = read_row_node(to, cell, row, d->nodes[t]);
    }
    return is_finite;
}

static bool read_all_nodes(target *to, int64_t cell, node_list *row, int size)
{
    bool is_finite = true;
    for (int n = 0; n < size; n++) row->nodes[n].vertex = -1;
    for (int n = 0; n < size; n++) is_finite = read_row_node(to, cell, row, n) && is_finite;
    return is_finite;
}

/* Adds the contributions of one of the caller's cells. If the derivatives of its polynomial are not implemented, or a
 * value is not finite, its linear pieces contribute instead. */
static void add_gradients_of_polynomial_cell(target *to, int64_t cell, node_list *row)
{
    const session_polynomials *p = to->basis->polynomials;
    const int size = (int)session_count_nodes_of_cell(&p->rows, cell);
    const bool is_finer = p->nodal.kind_count > 0;
    if (!reserve_nodes(row, size)) return;
    bool is_finite = is_finer || read_all_nodes(to, cell, row, size);
    const session_derivatives *d =
        session_find_derivatives_of_cell(p, cell, row->nodes->position, (int)(sizeof *row->nodes / sizeof(double)));
    if (is_finer && d->axis_count) is_finite = read_summed_nodes(to, cell, d, row, size);
    if (is_finite && d->axis_count) {
        for (int n = 0; n < size; n++)
            if (row->nodes[n].vertex >= 0) add_polynomial_gradient_at_node(to, d, row, n);
        return;
    }
    for (int64_t piece = p->first_pieces[cell]; piece < p->first_pieces[cell + 1]; piece++)
        if (does_drawn_cell_contribute(to->basis, piece)) add_gradients_of_linear_cell(to, piece, row);
}

static void add_gradients_of_cell(target *to, int64_t cell, node_list *buffer)
{
    if (to->basis->polynomials)
        add_gradients_of_polynomial_cell(to, cell, buffer);
    else
        add_gradients_of_linear_cell(to, cell, buffer);
}

enum { NO_OWNER = 254, SHARED = 255 };

/* Records that this thread adds to the sum of the vertex, if a sum is computed there. Additions to a sum must be atomic
 * only if several threads add to it. */
static void record_adding_thread(const target *to, int64_t vertex)
{
    const session_gradient_basis *basis = to->basis;
    unsigned char before = NO_OWNER;
    if (basis->sum_indices[vertex] < 0) return;
    unsigned char *owner = &to->owners[basis->sum_indices[vertex]];
    if (__atomic_load_n(owner, __ATOMIC_RELAXED) == to->owner ||
        __atomic_compare_exchange_n(owner, &before, to->owner, false, __ATOMIC_RELAXED, __ATOMIC_RELAXED))
        return;
    if (before != to->owner) __atomic_store_n(owner, SHARED, __ATOMIC_RELAXED);
}

static void record_adding_threads(const target *to, int64_t cell)
{
    const session_polynomials *p = to->basis->polynomials;
    const int64_t size = p ? session_count_nodes_of_cell(&p->rows, cell) : 0;
    for (int n = 0; n < size; n++) record_adding_thread(to, session_find_vertex_of_node(&p->rows, cell, n));
    if (p) return;
    grid_walk walk = grid_walk_cell(to->basis->cells, cell);
    int64_t vertex;
    while (grid_walk_next(&walk, &vertex)) record_adding_thread(to, vertex);
}

/* Adds the contributions of all cells. If to.owners is given, a first loop records which threads add to each sum. The
 * second loop, which adds the contributions, has the same schedule, so that each thread processes the same cells. */
static bool add_gradients_of_all_cells(const target *like, const session_cell_list *list,
                                       session_gradient_bounds *bounds)
{
    double rise = 0, sharpness = 0;
    bool is_out_of_memory = false;
#pragma omp parallel num_threads(session_choose_loop_threads(like->basis->threads, list->count))                       \
    reduction(max                                                                                                      \
              : rise, sharpness) reduction(||                                                                          \
                                           : is_out_of_memory)
    {
        region_enter();
        target to = *like;
        to.owner = (unsigned char)(omp_get_thread_num() % NO_OWNER);
        node_list nodes = {0};
        if (to.owners && omp_get_num_threads() < NO_OWNER) {
#pragma omp for schedule(static)
            for (int64_t i = 0; i < list->count; i++) record_adding_threads(&to, list->cells[i]);
        }
#pragma omp for schedule(static)
        for (int64_t i = 0; i < list->count; i++) add_gradients_of_cell(&to, list->cells[i], &nodes);
        rise = to.bounds.largest_difference;
        sharpness = to.bounds.largest_inverse_square;
        is_out_of_memory = nodes.is_out_of_memory;
        base_free(nodes.nodes);
        region_leave();
    }
    *bounds = (session_gradient_bounds){rise, sharpness};
    return !is_out_of_memory;
}

bool session_bound_gradients(const session_gradient_basis *basis, const session_cell_list *list,
                             session_gradient_bounds *out)
{
    const target to = {.basis = basis, .scale = 1 / basis->length};
    return add_gradients_of_all_cells(&to, list, out);
}

unsigned char *session_create_sum_owners(int64_t sum_count, int threads)
{
    const size_t count = threads > 1 ? (size_t)sum_count : 0;
    unsigned char *owners = base_alloc(count + 1);
    /* If there are more threads than a byte can distinguish, all sums are treated as shared. */
    if (owners) memset(owners, threads < NO_OWNER ? NO_OWNER : SHARED, count);
    return owners;
}

bool session_add_gradients(const session_gradient_basis *basis, const session_cell_list *list,
                           const session_gradient_bounds *bounds, unsigned char *owners, int64_t *sums)
{
    target to = {.basis = basis, .sums = sums, .scale = 1 / basis->length};
    double units[2];
    session_gradient_bounds unused;
    if (basis->threads > 1) to.owners = owners;
    find_rounding_units(bounds, units);
    for (int i = 0; i < MOST_NUMBERS; i++)
        to.units[i / 2][i % 2] = i < 3 * basis->field_count ? units[0] : i == 3 * basis->field_count ? units[1] : 0;
    return add_gradients_of_all_cells(&to, list, &unused);
}
