/* A step computes the jumps of own cells and exchanges them, applies fluxes and the source, exchanges states, and
 * updates vertices. The computation uses the mesh at rest and the equations of small displacements. If vertices move,
 * only the drawn mesh changes: each of its vertices moves with the velocity of the ground there, exaggerated by the
 * factor `swell`. */
#include "wave_solver.h"

#include <math.h>
#include <stdlib.h>

#include "wave_geometry.h"
#include "wave_weights.h"

static void store_real(void *array, int bytes, int64_t at, double value)
{
    if (bytes == 8) {
        ((double *)array)[at] = value;
    } else {
        ((float *)array)[at] = (float)value;
    }
}

static double get_real(const void *array, int bytes, int64_t at)
{
    return bytes == 8 ? ((const double *)array)[at] : (double)((const float *)array)[at];
}

static const wave_kernel *choose_kernel(int real_bytes, int index_bytes)
{
    if (real_bytes == 8) return index_bytes == 8 ? &wave_kernel_double_int64 : &wave_kernel_double_int32;
    return index_bytes == 8 ? &wave_kernel_float_int64 : &wave_kernel_float_int32;
}

static bool make_values(const wave_setup *setup, int64_t count, int components, wave_values *out)
{
    out->values = calloc((size_t)(count * components) + 1, (size_t)setup->real_bytes);
    out->stride = setup->is_soa ? 1 : components;
    out->component_stride = setup->is_soa ? count : 1;
    return out->values != NULL;
}

static bool allocate_state(wave_solver *s)
{
    const wave_mesh *mesh = s->mesh;
    size_t real = (size_t)s->setup.real_bytes;
    bool vertices = s->setup.order == 2 || s->setup.vertices || s->setup.swell != 0;
    s->faces = malloc((4 * (size_t)mesh->face_count + 1) * real);
    s->inverse_volume = malloc(((size_t)mesh->own_cells + 1) * real);
    s->layers = malloc((size_t)mesh->cells + 1);
    s->speed = malloc(((size_t)mesh->cells + 1) * real);
    s->volume = malloc(((size_t)mesh->own_cells + 1) * sizeof(double));
    s->grid.jump = calloc(4 * (size_t)mesh->cells + 1, real);
    bool ok = s->faces && s->inverse_volume && s->layers && s->speed && s->volume && s->grid.jump;
    if (vertices) {
        s->vertex_cell_weights = malloc(((size_t)mesh->vertex_cell_offsets[mesh->own_vertices] + 1) * real);
        ok = ok && s->vertex_cell_weights && make_values(&s->setup, mesh->vertices, 4, &s->grid.vertex_state);
    }
    return ok && make_values(&s->setup, mesh->cells, 4, &s->grid.state) &&
           make_values(&s->setup, mesh->vertices, 3, &s->grid.coordinates) &&
           wave_halo_create(mesh, s->comm, s->setup.real_bytes, &s->halo);
}

static void fill_grid(wave_solver *s)
{
    const wave_mesh *mesh = s->mesh;
    wave_grid *g = &s->grid;
    g->own_cells = mesh->own_cells;
    g->own_vertices = mesh->own_vertices;
    g->uniform_type = mesh->uniform_type;
    g->types = mesh->types;
    g->connectivity = mesh->connectivity;
    g->offsets = mesh->offsets;
    g->face_offsets = mesh->face_offsets;
    g->neighbours = mesh->neighbours;
    g->vertex_cell_offsets = mesh->vertex_cell_offsets;
    g->vertex_cells = mesh->vertex_cells;
    g->walls = mesh->walls;
    g->layers = s->layers;
    g->vertex_cell_weights = s->vertex_cell_weights;
    g->faces = s->faces;
    g->inverse_volume = s->inverse_volume;
    g->second_order = s->setup.order == 2;
    g->reflecting = s->setup.reflecting;
    for (int l = 0; l < s->setup.medium.count; ++l) {
        double c = s->setup.medium.speed[l], density = s->setup.medium.density[l];
        g->density[l] = density;
        g->modulus[l] = density * c * c;
        g->impedance[l] = density * c;
    }
}

static void measure_cells(const wave_mesh *mesh, int32_t cell, wave_cell_geometry *out)
{
    int32_t vertex[8];
    int64_t id[8];
    double position[8][3];
    const wave_cell_shape *shape = wave_mesh_cell(mesh, cell, vertex);
    for (int i = 0; i < shape->vertex_count; ++i) {
        id[i] = mesh->vertex_ids[vertex[i]];
        wave_lattice_compute_position(&mesh->partition.lattice, id[i], position[i]);
    }
    wave_cell_measure(shape, (const double(*)[3])position, id, out);
}

/* Stores the normals and areas of an own cell's faces, and its volume; returns the largest stable time step for the
 * cell. */
static double measure_own_cell(wave_solver *s, int32_t cell, const wave_cell_geometry *g)
{
    int bytes = s->setup.real_bytes, count = wave_cell_shape_of(wave_mesh_type(s->mesh, cell))->face_count;
    int64_t first = 4 * wave_mesh_first_face(s->mesh, cell);
    double surface = 0;
    for (int f = 0; f < count; ++f) {
        const double *a = g->area[f];
        double area = sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
        for (int k = 0; k < 3; ++k) store_real(s->faces, bytes, first + 4 * f + k, area > 0 ? a[k] / area : 0);
        store_real(s->faces, bytes, first + 4 * f + 3, area);
        surface += area;
    }
    s->volume[cell] = g->volume;
    store_real(s->inverse_volume, bytes, cell, 1 / g->volume);
    return 2 * g->volume / (surface * s->setup.medium.speed[s->layers[cell]]);
}

static bool add_source_cell(wave_solver *s, int32_t cell, const double centroid[3])
{
    double density = s->setup.source.amplitude != 0 ? wave_source_density(&s->setup.source, centroid) : 0;
    if (density == 0) return true;
    if ((s->source_cell_count & (s->source_cell_count - 1)) == 0) {
        size_t capacity = s->source_cell_count ? 2 * (size_t)s->source_cell_count : 1;
        int32_t *source_cells = realloc(s->source_cells, capacity * sizeof *source_cells);
        if (!source_cells) return false;
        s->source_cells = source_cells;
        double *rate = realloc(s->source_rates, capacity * sizeof *rate);
        if (!rate) return false;
        s->source_rates = rate;
    }
    s->source_cells[s->source_cell_count] = cell;
    s->source_rates[s->source_cell_count++] = density * s->grid.modulus[s->layers[cell]];
    return true;
}

static bool fill_cells(wave_solver *s, double (*centroid)[3])
{
    wave_cell_geometry g;
    for (int32_t c = 0; c < s->mesh->cells; ++c) {
        measure_cells(s->mesh, c, &g);
        s->layers[c] = wave_medium_layer(&s->setup.medium, g.centroid[2]);
        store_real(s->speed, s->setup.real_bytes, c, s->setup.medium.speed[s->layers[c]]);
        for (int a = 0; a < 3; ++a) centroid[c][a] = g.centroid[a];
        if (c >= s->mesh->own_cells) continue;
        s->time_step = fmin(s->time_step, measure_own_cell(s, c, &g));
        if (!add_source_cell(s, c, g.centroid)) return false;
    }
    return true;
}

static bool fill_vertices(wave_solver *s, const double (*centroid)[3])
{
    int bytes = s->setup.real_bytes;
    double xyz[3];
    for (int32_t v = 0; v < s->mesh->vertices; ++v) {
        wave_lattice_compute_position(&s->mesh->partition.lattice, s->mesh->vertex_ids[v], xyz);
        for (int a = 0; a < 3; ++a) {
            int64_t at = v * s->grid.coordinates.stride + a * s->grid.coordinates.component_stride;
            store_real(s->grid.coordinates.values, bytes, at, xyz[a]);
        }
        if (v >= s->mesh->own_vertices || !s->vertex_cell_weights) continue;
        int64_t begin = s->mesh->vertex_cell_offsets[v];
        int count = (int)(s->mesh->vertex_cell_offsets[v + 1] - begin);
        double weight[WAVE_AROUND_MAX];
        if (count > WAVE_AROUND_MAX) return false;
        wave_weights_fit(xyz, s->mesh->walls[v], count, s->mesh->vertex_cells + begin, centroid, weight);
        for (int i = 0; i < count; ++i) store_real(s->vertex_cell_weights, bytes, begin + i, weight[i]);
    }
    return true;
}

bool wave_solver_create(const wave_setup *setup, const wave_mesh *mesh, MPI_Comm comm, wave_solver *solver)
{
    *solver = (wave_solver){.setup = *setup, .mesh = mesh, .comm = comm, .time_step = INFINITY};
    solver->kernel = choose_kernel(setup->real_bytes, mesh->index_bytes);
    double(*centroid)[3] = malloc(((size_t)mesh->cells + 1) * sizeof *centroid);
    bool ok = centroid && allocate_state(solver);
    if (ok) fill_grid(solver);
    ok = ok && fill_cells(solver, centroid) && fill_vertices(solver, (const double(*)[3])centroid);
    free(centroid);
    if (!ok) wave_solver_free(solver);
    return ok;
}

void wave_solver_free(wave_solver *s)
{
    free(s->vertex_cell_weights);
    free(s->faces);
    free(s->inverse_volume);
    free(s->layers);
    free(s->speed);
    free(s->volume);
    free(s->source_cells);
    free(s->source_rates);
    free(s->grid.jump);
    free(s->grid.state.values);
    free(s->grid.vertex_state.values);
    free(s->grid.coordinates.values);
    wave_halo_free(&s->halo);
    *s = (wave_solver){0};
}

void wave_solver_set(wave_solver *s, int32_t cell, const double state[4])
{
    const wave_values *v = &s->grid.state;
    for (int k = 0; k < 4; ++k) {
        store_real(v->values, s->setup.real_bytes, cell * v->stride + k * v->component_stride, state[k]);
    }
}

void wave_solver_get(const wave_solver *s, int32_t cell, double state[4])
{
    const wave_values *v = &s->grid.state;
    for (int k = 0; k < 4; ++k) {
        state[k] = get_real(v->values, s->setup.real_bytes, cell * v->stride + k * v->component_stride);
    }
}

void wave_solver_compute_centroid(const wave_solver *s, int32_t cell, double xyz[3])
{
    wave_cell_geometry g;
    measure_cells(s->mesh, cell, &g);
    for (int a = 0; a < 3; ++a) xyz[a] = g.centroid[a];
}

static void update_halo_and_vertices(wave_solver *s)
{
    wave_halo_exchange(&s->halo, s->grid.state.values, s->grid.state.stride, s->grid.state.component_stride);
    if (s->grid.vertex_state.values) s->kernel->average_to_vertices(&s->grid);
}

void wave_solver_start(wave_solver *s)
{
    MPI_Allreduce(MPI_IN_PLACE, &s->time_step, 1, MPI_DOUBLE, MPI_MIN, s->comm);
    s->time_step *= s->setup.courant > 0 ? s->setup.courant : 0.9;
    update_halo_and_vertices(s);
}

static void apply_source(wave_solver *s)
{
    double amount = s->time_step * wave_source_rate(&s->setup.source, s->time + 0.5 * s->time_step);
    for (int32_t i = 0; i < s->source_cell_count; ++i) {
        int64_t at = s->source_cells[i] * s->grid.state.stride;
        double p = get_real(s->grid.state.values, s->setup.real_bytes, at);
        store_real(s->grid.state.values, s->setup.real_bytes, at, p + amount * s->source_rates[i]);
    }
}

void wave_solver_step(wave_solver *s)
{
    s->kernel->find_jumps(&s->grid, s->time_step);
    wave_halo_exchange(&s->halo, s->grid.jump, 4, 1);
    s->kernel->apply_fluxes(&s->grid, s->time_step);
    apply_source(s);
    update_halo_and_vertices(s);
    if (s->setup.swell != 0) s->kernel->move_vertices(&s->grid, s->setup.swell * s->time_step);
    s->time += s->time_step;
}

wave_totals wave_solver_compute_totals(const wave_solver *s)
{
    double sum[3] = {0, 0, 0}, peak = 0, q[4];
    for (int32_t c = 0; c < s->mesh->own_cells; ++c) {
        double modulus = s->grid.modulus[s->layers[c]], density = s->grid.density[s->layers[c]], v = s->volume[c];
        wave_solver_get(s, c, q);
        sum[0] += v;
        sum[1] += v * q[0] / modulus;
        sum[2] += 0.5 * v * (q[0] * q[0] / modulus + density * (q[1] * q[1] + q[2] * q[2] + q[3] * q[3]));
        peak = fmax(peak, fabs(q[0]));
    }
    MPI_Allreduce(MPI_IN_PLACE, sum, 3, MPI_DOUBLE, MPI_SUM, s->comm);
    MPI_Allreduce(MPI_IN_PLACE, &peak, 1, MPI_DOUBLE, MPI_MAX, s->comm);
    return (wave_totals){.volume = sum[0], .mass = sum[1], .energy = sum[2], .peak = peak};
}
