/* Compares polyhedra with the tets of which they consist (test_own_tets.h). */
#include "test_own_tets.h"

#include "reference_cell.h"
#include "reference_polyhedron.h"
#include "test_mesh_make.h"
#include "test_render_fixture.h"

#include <string.h>

static const test_layout doubles = {.wide_coordinates = true, .wide_values = true, .wide_indices = true};

static int64_t add_centre(const reference_cell *cell, const int64_t *vertices, test_mesh *out)
{
    double mean = 0;
    for (int i = 0; i < cell->count; i++) mean += out->values[vertices[i]] / cell->count;
    const int64_t centre = test_mesh_add_vertex(out, cell->position[cell->count]);
    out->values[centre] = mean;
    return centre;
}

static void add_tets(const reference_cell *cell, const int64_t *vertices, test_mesh *out)
{
    const int64_t centre = add_centre(cell, vertices, out);
    for (int i = 0; i < cell->poly.triangle_count; i++) {
        const int *t = cell->poly.triangles[i];
        const int64_t corners[4] = {vertices[t[0]], vertices[t[1]], vertices[t[2]], centre};
        test_mesh_add_cell(out, GRID_TET, corners, (const int[]){0, 1, 2, 3});
    }
}

static void load_cell(const test_mesh *mesh, const grid *g, int64_t index, reference_cell *cell, int64_t *vertices)
{
    cell->type = GRID_POLYHEDRON;
    reference_polyhedron_read(g, index, cell, vertices);
    for (int k = 0; k < cell->count; k++)
        for (int a = 0; a < 3; a++) cell->world[k][a] = cell->position[k][a] = mesh->coordinates[3 * vertices[k] + a];
    reference_polyhedron_setup(cell);
}

static bool is_star_shaped(const reference_polyhedron *p)
{
    for (int i = 0; i < p->triangle_count; i++)
        if (p->sign[i] <= 0) return false;
    return true;
}

int64_t test_mesh_split_polyhedra(test_mesh *mesh, test_mesh *out)
{
    static reference_cell cell;
    int64_t vertices[REFERENCE_MAX_VERTICES], entries = 0, ghosts = 0;
    test_view view;
    test_view_create(mesh, doubles, &view);
    for (int64_t i = 0; i < mesh->connectivity_count; i++) {
        const int64_t face = mesh->connectivity[i];
        entries += mesh->face_offsets[face + 1] - mesh->face_offsets[face];
    }
    test_mesh_allocate(out, mesh->vertex_count + mesh->cell_count, entries, 4 * entries);
    out->vertex_count = mesh->vertex_count;
    memcpy(out->coordinates, mesh->coordinates, 3 * (size_t)mesh->vertex_count * sizeof(double));
    memcpy(out->values, mesh->values, (size_t)mesh->vertex_count * sizeof(double));
    for (int64_t i = 0; i < mesh->cell_count; i++) {
        load_cell(mesh, &view.cells, i, &cell, vertices);
        mesh->ghosts[i] = !is_star_shaped(&cell.poly);
        ghosts += mesh->ghosts[i];
        if (!mesh->ghosts[i]) add_tets(&cell, vertices, out);
    }
    test_view_free(&view);
    return ghosts;
}

static void draw_surface(const test_mesh *mesh, double cell_size, const double *value, int width, int height,
                         render_fixture *f, drawn_frame *out)
{
    fixture_create(f, mesh, 1, doubles, cell_size, 1, (const double[]){0, 0, 0});
    fixture_set_camera(f, CAMERA_OUTSIDE, width, height);
    fixture_add_surface(f, value, 1, 1);
    fixture_draw(f, out);
}

/* Returns whether the ray passes so near to an edge, or its value at a face of a tet is so near to the isovalue, that
 * the result may depend on rounding. Computed in double. */
static bool may_depend_on_rounding(const reference_scene *scene, int x, int y)
{
    reference_ray ray;
    reference_trace(scene, x, y, fixture_background, &ray);
    return ray.edge_margin < 1e-5 || ray.value_margin < 1e-5;
}

static void compare_pixel(const reference_scene *scene, int x, int y, double own, double tets, double allowed,
                          own_tets_tally *t)
{
    const bool has_own = isfinite(own), has_tets = isfinite(tets);
    t->pixels += has_tets;
    if (has_own == has_tets && (!has_own || fabs(own - tets) <= allowed)) return;
    if (may_depend_on_rounding(scene, x, y))
        t->in_band++;
    else if (has_tets)
        t->missing++;
    else
        t->added++;
}

own_tets_tally compare_with_split_tets(test_mesh *polyhedra, double cell_size, double value, int width, int height)
{
    own_tets_tally t = {.pixels = 0};
    render_fixture whole, parts;
    drawn_frame own, other;
    test_mesh tets;
    t.ghosts = test_mesh_split_polyhedra(polyhedra, &tets);
    draw_surface(polyhedra, cell_size, &value, width, height, &whole, &own);
    draw_surface(&tets, cell_size, &value, width, height, &parts, &other);
    reference_scene *scene = reference_create(&parts.job);
    for (int64_t i = 0; i < (int64_t)width * height; i++)
        compare_pixel(scene, (int)(i % width), (int)(i / width),
                      fixture_compute_scene_depth(&whole, own.picture.depth[i]),
                      fixture_compute_scene_depth(&parts, other.picture.depth[i]), 1e-3 * cell_size, &t);
    reference_free(scene);
    drawn_frame_free(&own);
    drawn_frame_free(&other);
    fixture_free(&whole);
    fixture_free(&parts);
    test_mesh_free(&tets);
    return t;
}
