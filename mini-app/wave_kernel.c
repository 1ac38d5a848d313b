/* Godunov's scheme for acoustics on cells of any shape, made second order by values at vertices.
 *
 *     p_t = -K div u        p' = p - dt K/V sum_f A_f u*_f        over the faces f of a cell
 *     u_t = -1/rho grad p   u' = u - dt/(rho V) sum_f A_f n_f p*_f
 *
 * p* and u* solve the Riemann problem between the two sides a, b of a face, each with its own impedance Z = rho c:
 *
 *     p* = (Zb pa + Za pb + Za Zb (ua - ub)) / (Za + Zb)        u* = (Za ua + Zb ub + pa - pb) / (Za + Zb)
 *
 * The reconstruction needs no gradients. Let P_v be the state at a vertex, averaged from the cells around it. Let P_f
 * be the mean of P_v over the vertices of a face, and P_c the mean over the vertices of a cell. The linear function
 * through these values, shifted so that its mean in the cell is q, has this value at the face:
 *
 *     q + (P_f - P_c) = P_f + j        with the cell's jump j = q - P_c + dt/2 q_t
 *
 * where q_t, from Green's theorem with P_f, advances the value to the middle of the time step. P_f is the same on both
 * sides, so ranks exchange only the four jumps of each cell. In one dimension this is Fromm's scheme. In the
 * first-order scheme, j = q and P = 0.
 *
 * Each cell loops over its own faces, so every flux is computed twice, but no two cells write to the same address. Each
 * sum is computed in the order of the cell's faces, so that every cell's result is bit-identical on any partition. */
#include "wave_kernel.h"

#include <stddef.h>

#ifndef WAVE_REAL
#error "WAVE_REAL, WAVE_INDEX and WAVE_TABLE say what to compile"
#endif

/* Inlined for each constant shape, so that the loops over a cell's faces and vertices are unrolled. */
#define INLINE static inline __attribute__((always_inline))

typedef WAVE_REAL real;
typedef WAVE_INDEX local_index;

typedef struct layer_table {
    real modulus[WAVE_LAYERS_MAX], inverse_density[WAVE_LAYERS_MAX], impedance[WAVE_LAYERS_MAX];
    real inverse_sum[WAVE_LAYERS_MAX][WAVE_LAYERS_MAX]; /* 1 / (Za + Zb) for each pair of layers */
} layer_table;

typedef struct cell_view {
    const wave_cell_shape *shape;
    const local_index *vertex;
    const real *face;         /* normal and area of each face of the cell */
    const int32_t *neighbour; /* neighbour across each face of the cell */
} cell_view;

static layer_table make_layers(const wave_grid *grid)
{
    layer_table t;
    for (int a = 0; a < WAVE_LAYERS_MAX; ++a) {
        double density = grid->density[a];
        t.modulus[a] = (real)grid->modulus[a];
        t.inverse_density[a] = (real)(density > 0 ? 1 / density : 0);
        t.impedance[a] = (real)grid->impedance[a];
        for (int b = 0; b < WAVE_LAYERS_MAX; ++b) {
            double sum = grid->impedance[a] + grid->impedance[b];
            t.inverse_sum[a][b] = (real)(sum > 0 ? 1 / sum : 0);
        }
    }
    return t;
}

INLINE cell_view get_cell_view(const wave_grid *grid, const wave_cell_shape *shape, int32_t c)
{
    cell_view view = {.shape = shape};
    int64_t first_vertex =
        grid->offsets ? (int64_t)((const local_index *)grid->offsets)[c] : (int64_t)c * view.shape->vertex_count;
    int64_t first_face = grid->face_offsets ? grid->face_offsets[c] : (int64_t)c * view.shape->face_count;
    view.vertex = (const local_index *)grid->connectivity + first_vertex;
    view.face = (const real *)grid->faces + 4 * first_face;
    view.neighbour = grid->neighbours + first_face;
    return view;
}

static void average_to_vertices(const wave_grid *grid)
{
    const real *weights = grid->vertex_cell_weights, *state = grid->state.values;
    real *out = grid->vertex_state.values;
    int64_t stride = grid->state.stride, component_stride = grid->state.component_stride;
    for (int32_t v = 0; v < grid->own_vertices; ++v) {
        real sum[4] = {0, 0, 0, 0};
        for (int64_t i = grid->vertex_cell_offsets[v]; i < grid->vertex_cell_offsets[v + 1]; ++i) {
            const real *q = state + grid->vertex_cells[i] * stride;
            for (int k = 0; k < 4; ++k) sum[k] += weights[i] * q[k * component_stride];
        }
        for (int a = 0; a < 3 && grid->reflecting; ++a) {
            if (grid->walls[v] >> a & 1) sum[1 + a] = 0;
        }
        for (int k = 0; k < 4; ++k) {
            out[v * grid->vertex_state.stride + k * grid->vertex_state.component_stride] = sum[k];
        }
    }
}

/* Loads the states at the cell's vertices. */
INLINE void load_vertices(const wave_grid *grid, const cell_view *view, real p[8][4])
{
    const real *values = grid->vertex_state.values;
    int64_t stride = grid->vertex_state.stride, component_stride = grid->vertex_state.component_stride;
    for (int i = 0; i < view->shape->vertex_count; ++i) {
        const real *from = values + (int64_t)view->vertex[i] * stride;
        for (int k = 0; k < 4; ++k) p[i][k] = from[k * component_stride];
    }
}

/* Computes the mean of the states at a face's vertices. Opposite vertices of a quad are summed first, so that the mean
 * is rounded in the same way for both of its cells. */
INLINE void compute_face_mean(const wave_cell_shape *shape, int f, const real p[8][4], real mean[4])
{
    const int8_t *v = shape->face[f];
    if (shape->face_size[f] == 3) {
        for (int k = 0; k < 4; ++k) mean[k] = (p[v[0]][k] + p[v[1]][k] + p[v[2]][k]) * (real)(1.0 / 3);
    } else {
        for (int k = 0; k < 4; ++k) mean[k] = ((p[v[0]][k] + p[v[2]][k]) + (p[v[1]][k] + p[v[3]][k])) * (real)0.25;
    }
}

/* Computes integrals over the cell's surface: of u.n in integral[0], and of p n in integral[1], [2] and [3]. */
INLINE void integrate_faces(const cell_view *view, const real p[8][4], real integral[4])
{
    for (int k = 0; k < 4; ++k) integral[k] = 0;
    for (int f = 0; f < view->shape->face_count; ++f) {
        const real *n = view->face + 4 * f;
        real mean[4];
        compute_face_mean(view->shape, f, p, mean);
        integral[0] += n[3] * (n[0] * mean[1] + n[1] * mean[2] + n[2] * mean[3]);
        for (int a = 0; a < 3; ++a) integral[1 + a] += n[3] * n[a] * mean[0];
    }
}

/* Calls pass(grid, shape, layers, step, cell) for every own cell, with a constant shape. */
#define FOR_EACH_CELL(grid, pass, layers, step)                                                                        \
    for (int32_t c = 0; c < (grid)->own_cells; ++c) {                                                                  \
        switch ((grid)->types ? (grid)->types[c] : (grid)->uniform_type) {                                             \
        case WAVE_TYPE_TET: pass(grid, &wave_tet_shape, layers, step, c); break;                                       \
        case WAVE_TYPE_HEX: pass(grid, &wave_hex_shape, layers, step, c); break;                                       \
        case WAVE_TYPE_WEDGE: pass(grid, &wave_wedge_shape, layers, step, c); break;                                   \
        default: pass(grid, &wave_pyramid_shape, layers, step, c); break;                                              \
        }                                                                                                              \
    }

INLINE void compute_cell_jump(const wave_grid *grid, const wave_cell_shape *shape, const layer_table *layers,
                              real half_step, int32_t c)
{
    const real *state = (const real *)grid->state.values + c * grid->state.stride;
    real *jump = (real *)grid->jump + 4 * (int64_t)c;
    cell_view view = get_cell_view(grid, shape, c);
    real p[8][4], integral[4];
    load_vertices(grid, &view, p);
    integrate_faces(&view, p, integral);
    real rate = half_step * ((const real *)grid->inverse_volume)[c];
    int layer = grid->layers[c];
    for (int k = 0; k < 4; ++k) {
        real mean = 0;
        for (int i = 0; i < view.shape->vertex_count; ++i) mean += (real)view.shape->centre[i] * p[i][k];
        real material = k == 0 ? layers->modulus[layer] : layers->inverse_density[layer];
        jump[k] = state[k * grid->state.component_stride] - mean - rate * material * integral[k];
    }
}

static void find_jumps(const wave_grid *grid, double time_step)
{
    if (grid->second_order) {
        layer_table layers = make_layers(grid);
        FOR_EACH_CELL(grid, compute_cell_jump, &layers, (real)(0.5 * time_step));
        return;
    }
    for (int32_t c = 0; c < grid->own_cells; ++c) {
        const real *state = (const real *)grid->state.values + c * grid->state.stride;
        for (int k = 0; k < 4; ++k) ((real *)grid->jump)[4 * (int64_t)c + k] = state[k * grid->state.component_stride];
    }
}

/* The state on one side of a face: the mean of the states at the face's vertices, plus the jump of the cell on this
 * side. `layer` is the medium's layer in which this cell lies. If the face is on a wall, the far side has no cell, and
 * its jump is NULL. */
typedef struct face_side {
    const real *jump;
    int layer;
} face_side;

INLINE face_side get_face_side(const wave_grid *grid, int32_t cell)
{
    return cell < 0 ? (face_side){NULL, 0}
                    : (face_side){(const real *)grid->jump + 4 * (int64_t)cell, grid->layers[cell]};
}

/* Computes p* and u* of a face with normal n, from the mean of the states at the face's vertices and the jumps of the
 * cells on both sides. */
INLINE void solve_riemann(const wave_grid *grid, const layer_table *layers, const real *n, const real mean[4],
                          face_side near, face_side far, real star[2])
{
    const real *a = near.jump, *b = far.jump;
    real za = layers->impedance[near.layer], pa = mean[0] + a[0];
    real ua = n[0] * (mean[1] + a[1]) + n[1] * (mean[2] + a[2]) + n[2] * (mean[3] + a[3]);
    if (!b) {
        /* A rigid wall reflects the wave; behind an absorbing wall the state is zero. */
        star[0] = grid->reflecting ? pa + za * ua : (pa + za * ua) * (real)0.5;
        star[1] = grid->reflecting ? 0 : star[0] * (2 * layers->inverse_sum[near.layer][near.layer]);
        return;
    }
    real zb = layers->impedance[far.layer], pb = mean[0] + b[0];
    real ub = n[0] * (mean[1] + b[1]) + n[1] * (mean[2] + b[2]) + n[2] * (mean[3] + b[3]);
    real inverse = layers->inverse_sum[near.layer][far.layer];
    star[0] = ((zb * pa + za * pb) + za * zb * (ua - ub)) * inverse;
    star[1] = ((za * ua + zb * ub) + (pa - pb)) * inverse;
}

INLINE void apply_flux(const wave_grid *grid, const wave_cell_shape *shape, const layer_table *layers, real time_step,
                       int32_t c)
{
    cell_view view = get_cell_view(grid, shape, c);
    real p[8][4], mean[4] = {0, 0, 0, 0}, sum[4] = {0, 0, 0, 0};
    int layer = grid->layers[c];
    face_side near = get_face_side(grid, c);
    if (grid->second_order) load_vertices(grid, &view, p);
    for (int f = 0; f < view.shape->face_count; ++f) {
        const real *n = view.face + 4 * f;
        real star[2];
        if (grid->second_order) compute_face_mean(view.shape, f, p, mean);
        solve_riemann(grid, layers, n, mean, near, get_face_side(grid, view.neighbour[f]), star);
        sum[0] += n[3] * star[1];
        for (int a = 0; a < 3; ++a) sum[1 + a] += n[3] * star[0] * n[a];
    }
    real *state = (real *)grid->state.values + c * grid->state.stride;
    real rate = time_step * ((const real *)grid->inverse_volume)[c];
    state[0] -= rate * layers->modulus[layer] * sum[0];
    for (int k = 1; k < 4; ++k) {
        state[k * grid->state.component_stride] -= rate * layers->inverse_density[layer] * sum[k];
    }
}

static void apply_fluxes(const wave_grid *grid, double time_step)
{
    layer_table layers = make_layers(grid);
    FOR_EACH_CELL(grid, apply_flux, &layers, (real)time_step);
}

static void move_vertices(const wave_grid *grid, double scale)
{
    const real *velocity = grid->vertex_state.values;
    real *x = grid->coordinates.values;
    for (int32_t v = 0; v < grid->own_vertices; ++v) {
        for (int a = 0; a < 3; ++a) {
            int64_t from = v * grid->vertex_state.stride + (1 + a) * grid->vertex_state.component_stride;
            x[v * grid->coordinates.stride + a * grid->coordinates.component_stride] += (real)scale * velocity[from];
        }
    }
}

const wave_kernel WAVE_TABLE = {average_to_vertices, find_jumps, apply_fluxes, move_vertices};
