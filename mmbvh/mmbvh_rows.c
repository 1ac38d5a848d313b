/* In a lattice (structured grid) each row of cells lies between four rows of vertices (two in two dimensions). In a
 * first pass, the range of the values of the four vertices at each position along the rows is computed. A cell lies
 * between two neighbouring positions, so that its range is the union of the ranges at these two positions. */
#include "mmbvh_rows.h"

#include <math.h>
#include <string.h>

#include "mmbvh_fetch.h"

/* Up to four rows of vertices surround a row of cells. This struct stores, for each position along the rows, the range
 * over the values of these rows at this position. The member nonfinite is 0 where all of these values are finite, and
 * NaN otherwise. */
typedef struct row_doubles {
    double low[ROWS_CELLS + 1], high[ROWS_CELLS + 1], nonfinite[ROWS_CELLS + 1];
} row_doubles;

typedef struct row_floats {
    float low[ROWS_CELLS + 1], high[ROWS_CELLS + 1], nonfinite[ROWS_CELLS + 1];
} row_floats;

bool rows_can_read(const grid *g, const grid_field *field)
{
    return g->lattice && !field->is_cell_centred && field->component >= 0 && !field->values.is_integer &&
           !field->source_cells && grid_lattice_row_axis(g->lattice) >= 0;
}

/* The smaller and the larger of two numbers. */
#define SMALLER(a, b) ((a) < (b) ? (a) : (b))
#define LARGER(a, b) ((a) > (b) ? (a) : (b))

/* Computes the range over four rows' values at each position along the rows. nonfinite stays 0 if all values at the
 * position are finite, and becomes NaN otherwise. */
#define ROW_RANGES(number, to, rows, stride, count)                                                                    \
    for (int64_t n = 0; n < (count); n++) {                                                                            \
        const number a = *(const number *)(const void *)((rows)[0] + n * (stride));                                    \
        const number b = *(const number *)(const void *)((rows)[1] + n * (stride));                                    \
        const number c = *(const number *)(const void *)((rows)[2] + n * (stride));                                    \
        const number d = *(const number *)(const void *)((rows)[3] + n * (stride));                                    \
        const number ab = SMALLER(a, b), cd = SMALLER(c, d), most_ab = LARGER(a, b), most_cd = LARGER(c, d);           \
        (to)->low[n] = SMALLER(ab, cd);                                                                                \
        (to)->high[n] = LARGER(most_ab, most_cd);                                                                      \
        (to)->nonfinite[n] = ((a - a) + (b - b)) + ((c - c) + (d - d));                                                \
    }

#define DEFINE_RANGES(name, number, places)                                                                            \
    static void name(const char *const rows[4], int64_t stride, rows_ranges *out)                                      \
    {                                                                                                                  \
        places of;                                                                                                     \
        const int64_t count = out->count + 1;                                                                          \
        if (stride == (int64_t)sizeof(number)) {                                                                       \
            ROW_RANGES(number, &of, rows, (int64_t)sizeof(number), count)                                              \
        } else {                                                                                                       \
            ROW_RANGES(number, &of, rows, stride, count)                                                               \
        }                                                                                                              \
        memset(out->is_finite, 0, (size_t)(out->count + 7) & ~(size_t)7);                                              \
        for (int64_t n = 0; n < out->count; n++) {                                                                     \
            out->low[n] = (float)SMALLER(of.low[n], of.low[n + 1]);                                                    \
            out->high[n] = (float)LARGER(of.high[n], of.high[n + 1]);                                                  \
            out->is_finite[n] = of.nonfinite[n] + of.nonfinite[n + 1] == 0;                                            \
        }                                                                                                              \
    }
DEFINE_RANGES(float_ranges, float, row_floats)
DEFINE_RANGES(double_ranges, double, row_doubles)

enum { EXTENT_LANES = 16 };

/* Defines a function that computes the range of an array, and returns false if a number is not finite. nonfinite is 0
 * while all numbers are finite, otherwise NaN. */
#define DEFINE_EXTENT(name, number)                                                                                    \
    static bool name(const char *data, int64_t count, float *low, float *high)                                         \
    {                                                                                                                  \
        const number *v = (const number *)(const void *)data;                                                          \
        number least[EXTENT_LANES], most[EXTENT_LANES], nonfinite[EXTENT_LANES];                                       \
        for (int k = 0; k < EXTENT_LANES; k++) {                                                                       \
            least[k] = most[k] = v[0];                                                                                 \
            nonfinite[k] = v[0] - v[0];                                                                                \
        }                                                                                                              \
        int64_t n = 0;                                                                                                 \
        for (; n + EXTENT_LANES <= count; n += EXTENT_LANES)                                                           \
            for (int k = 0; k < EXTENT_LANES; k++) {                                                                   \
                least[k] = SMALLER(v[n + k], least[k]);                                                                \
                most[k] = LARGER(v[n + k], most[k]);                                                                   \
                nonfinite[k] += v[n + k] - v[n + k];                                                                   \
            }                                                                                                          \
        for (; n < count; n++) {                                                                                       \
            least[0] = SMALLER(v[n], least[0]);                                                                        \
            most[0] = LARGER(v[n], most[0]);                                                                           \
            nonfinite[0] += v[n] - v[n];                                                                               \
        }                                                                                                              \
        for (int k = 1; k < EXTENT_LANES; k++) {                                                                       \
            least[0] = SMALLER(least[k], least[0]);                                                                    \
            most[0] = LARGER(most[k], most[0]);                                                                        \
            nonfinite[0] += nonfinite[k];                                                                              \
        }                                                                                                              \
        *low = (float)least[0];                                                                                        \
        *high = (float)most[0];                                                                                        \
        return nonfinite[0] == 0;                                                                                      \
    }
DEFINE_EXTENT(float_extent, float)
DEFINE_EXTENT(double_extent, double)

bool rows_compute_total_range(const grid *g, const grid_field *field, float *low, float *high)
{
    const int64_t size = field->values.is_wide ? sizeof(double) : sizeof(float);
    const char *data = field->values.data + field->component * field->component_stride;
    if (field->values.stride != size || g->vertex_count == 0) return false;
    return field->values.is_wide ? double_extent(data, g->vertex_count, low, high)
                                 : float_extent(data, g->vertex_count, low, high);
}

/* Searches the cells with indices from `from` to `end` - 1 for the first drawn cell. Stores its index and the number of
 * drawn cells from it to the end of its row (at most ROWS_CELLS) in *out, and the index of its first vertex in *vertex.
 * Returns false if there is no drawn cell. */
static bool find_next_drawn_cells(const grid_lattice *l, int along, int64_t from, int64_t end, rows_ranges *out,
                                  int64_t *vertex)
{
    while (from < end) {
        int64_t index[3], row = from;
        bool is_inside = true;
        for (int axis = 0; axis < 3; axis++) {
            index[axis] = grid_index_along(&l->cell_numbering, axis, from);
            if (axis == along) continue;
            is_inside = is_inside && index[axis] >= l->drawn_first[axis] && index[axis] < l->drawn_end[axis];
        }
        row -= index[along];
        const int64_t first = row + l->drawn_first[along], last = row + l->drawn_end[along];
        if (is_inside && from < last) {
            out->first = from > first ? from : first;
            out->count = (last < end ? last : end) - out->first;
            if (out->count > ROWS_CELLS) out->count = ROWS_CELLS;
            index[along] = out->first - row;
            *vertex = 0;
            for (int axis = 0; axis < 3; axis++) *vertex += index[axis] * l->vertex_numbering.stride[axis];
            if (out->count > 0) return true;
        }
        /* The rest of this row contains no drawn cell, so the search continues with the next row. */
        const double outer = l->cell_numbering.outer[along];
        if (outer == 0) return false;
        from = row + (int64_t)outer;
    }
    return false;
}

bool rows_compute_cell_ranges(const grid *g, const grid_field *field, int64_t from, int64_t end, rows_ranges *out)
{
    const grid_lattice *l = g->lattice;
    const int along = grid_lattice_row_axis(l);
    int64_t vertex;
    if (!find_next_drawn_cells(l, along, from, end, out, &vertex)) return false;
    const char *rows[4];
    const char *data = field->values.data + field->component * field->component_stride;
    const int64_t stride = field->values.stride;
    /* Along an axis without cells the vertices' stride is 0, so the same row is read twice. */
    const int64_t across[2] = {l->vertex_numbering.stride[(along + 1) % 3],
                               l->vertex_numbering.stride[(along + 2) % 3]};
    for (int side = 0; side < 4; side++)
        rows[side] = data + (vertex + (side & 1) * across[0] + (side >> 1) * across[1]) * stride;
    const int64_t step = stride * l->vertex_numbering.stride[along];
    if (field->values.is_wide)
        double_ranges(rows, step, out);
    else
        float_ranges(rows, step, out);
    return true;
}
