/* Checks the outer surfaces of a session, which consist of the faces that only one cell has. Their area shows that no
 * face is missing and that no interior face is included. Their pictures must agree with a closed form, and must be
 * bit-identical for any partition. Warped faces must be drawn as bilinear patches. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "render.h"
#include "session.h"
#include "test_session_fixture.h"
#include "test_session_view.h"

enum { SIDE = 3 };

#define PLAIN "material: {ambient: 1, diffuse: 0, specular: 0}"
#define COLOURED(keys) "      - surface: {colour_by: {field: f, map: grey, range: [-2, 2]}, " PLAIN keys "}\n"

/* ---- inputs -------------------------------------------------------------------------------------------------- */

static void make_whole_mesh(test_mesh_kind kind, session_input *out)
{
    test_mesh_make_lattice(kind, SIDE, 0.2, test_linear_field, &out->part);
    input_describe(out);
}

/* Extracts this rank's cells in an order of its own or, if with_ghosts is set, all cells, of which those of other ranks
 * are ghosts. */
static void extract_rank_cells(const session_input *whole, test_partition_kind distributed, bool with_ghosts,
                               session_input *out)
{
    extract_own_cells(&whole->part, distributed, SIDE, with_ghosts, &out->part);
    if (!with_ghosts) test_mesh_reorder_vertices(&out->part, 3 + (uint64_t)own_rank);
    test_mesh_shuffle_cells(&out->part, 7 + (uint64_t)own_rank);
    input_describe(out);
}

static insitu_session *open_session_with_input(MPI_Comm comm, const char *scene, const session_input *in)
{
    insitu_session *session = open_session_and_draw(comm, scene, in);
    const char *warnings = insitu_last_report(session)->warnings;
    if (*warnings && !strstr(warnings, "left-handed")) fail_msg("warnings: %s", warnings);
    return session;
}

static caught_picture draw_input(MPI_Comm comm, const char *scene, const session_input *in)
{
    insitu_session *session = open_session_with_input(comm, scene, in);
    const caught_picture picture = pop_caught_picture();
    insitu_destroy(&session);
    return picture;
}

/* ---- faces --------------------------------------------------------------------------------------------------- */

static double compute_triangle_area(const double *a, const double *b, const double *c)
{
    double u[3], v[3], sum = 0;
    for (int i = 0; i < 3; i++) u[i] = b[i] - a[i], v[i] = c[i] - a[i];
    for (int i = 0; i < 3; i++) {
        const double w = u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3];
        sum += w * w;
    }
    return 0.5 * sqrt(sum);
}

/* Returns the area of this rank's outer faces; NaN if one of them is not on the boundary of the cube. */
static double compute_outer_area(const insitu_session *session)
{
    const session_mesh *mesh = session_find_mesh(&session->meshes, "m");
    const session_outer *outer = mesh->outers[0];
    double sum = 0;
    for (int64_t cell = 0; cell < outer->mesh->cells.cell_count; cell++) {
        const int64_t *entries = outer->connectivity + outer->offsets[cell];
        const int corners = (int)(outer->offsets[cell + 1] - outer->offsets[cell]) - 1;
        const double *p[4] = {0};
        bool is_on_border = false;
        for (int i = 0; i < corners; i++) p[i] = outer->coordinates + 3 * entries[i];
        for (int axis = 0; axis < 3; axis++) {
            bool is_on = fabs(p[0][axis]) == 1;
            for (int i = 1; i < corners; i++) is_on = is_on && p[i][axis] == p[0][axis];
            is_on_border = is_on_border || is_on;
        }
        if (!is_on_border) return NAN;
        sum += compute_triangle_area(p[0], p[1], p[2]) + (corners == 4 ? compute_triangle_area(p[0], p[2], p[3]) : 0);
    }
    return sum;
}

static double compute_whole_area(const session_input *in)
{
    insitu_session *session = open_session_with_input(MPI_COMM_WORLD, write_scene(IMAGE("      - surface: {}\n")), in);
    double area = compute_outer_area(session);
    MPI_Allreduce(MPI_IN_PLACE, &area, 1, MPI_DOUBLE, MPI_SUM, MPI_COMM_WORLD);
    insitu_destroy(&session);
    return area;
}

/* Checks the area of the outer faces: the cube has six squares of area 4. A sum of some hundred areas has an error of
 * less than 1e-12. */
static void outer_faces_match_the_cube(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (int way = 0; way < 4; way++) {
            session_input whole = {0}, part = {0};
            make_whole_mesh(kind, &whole);
            extract_rank_cells(&whole, way == 1 ? TEST_BLOCK : TEST_RANDOM, way == 2, &part);
            if (way == 3 && kind != TEST_POLYHEDRA)
                test_mesh_to_polyhedra(&part.part, 0.5); /* half of the cells, mixed with other types */
            input_describe(&part);
            const double area = compute_whole_area(&part);
            if (!(fabs(area - 24) < 1e-12))
                fprintf(stderr, "%s, %d: area %.17g\n", test_mesh_kind_name(kind), way, area);
            everywhere(fabs(area - 24) < 1e-12);
            input_free(&part);
            input_free(&whole);
        }
}

static int64_t *make_ids(const session_input *whole, const session_input *part, int64_t factor, int64_t offset)
{
    int64_t *ids = test_calloc((size_t)part->part.vertex_count + 1, sizeof *ids);
    for (int64_t v = 0; v < part->part.vertex_count; v++)
        for (int64_t w = 0; w < whole->part.vertex_count; w++)
            if (memcmp(whole->part.coordinates + 3 * w, part->part.coordinates + 3 * v, 3 * sizeof(double)) == 0)
                ids[v] = factor * w + offset;
    return ids;
}

/* Checks that vertex ids that are equal on all ranks do not change the outer faces. If the ids of each rank differ from
 * those of all other ranks, the whole boundary of each rank's part is outer. */
static void vertex_ids_identify_shared_faces(void **state)
{
    (void)state;
    session_input whole = {0}, part = {0};
    make_whole_mesh(TEST_HEXES, &whole);
    extract_rank_cells(&whole, TEST_BLOCK, false, &part);
    int64_t *shared = make_ids(&whole, &part, 7, -100), *own = make_ids(&whole, &part, rank_count, own_rank);
    part.mesh.vertex_ids = (insitu_array){shared, INSITU_INT64, 0};
    everywhere(fabs(compute_whole_area(&part) - 24) < 1e-12);
    part.mesh.vertex_ids = (insitu_array){own, INSITU_INT64, 0};
    const double area = compute_whole_area(&part);
    everywhere(rank_count == 1 ? fabs(area - 24) < 1e-12 : isnan(area));
    test_free(shared);
    test_free(own);
    input_free(&part);
    input_free(&whole);
}

/* ---- pictures of the cube ------------------------------------------------------------------------------------ */

/* Computes the depths at which the ray enters and leaves the cube; returns false if it misses the cube. *margin is the
 * distance of the ray from the nearest edge of the cube or from the border between hit and miss. */
static bool cross_cube(const ray *r, double depths[2], double *margin)
{
    double in[3], out[3];
    depths[0] = -INFINITY;
    depths[1] = INFINITY;
    for (int a = 0; a < 3; a++) {
        const double one = (-1 - r->base[a]) / r->direction[a], other = (1 - r->base[a]) / r->direction[a];
        in[a] = fmin(one, other);
        out[a] = fmax(one, other);
        depths[0] = fmax(depths[0], in[a]);
        depths[1] = fmin(depths[1], out[a]);
    }
    *margin = fabs(depths[1] - depths[0]);
    return depths[0] < depths[1];
}

/* Returns whether the picture shows the cube. The depth of a hit has rounding errors of numbers near 5 in single
 * precision, and equal errors of its position across the ray, divided by the sine of the angle between ray and face, at
 * least 1/10 here. The grey of a hit has the error of the position, times the field's slope of 1 in 4, times the colour
 * table's slope of 3. */
static bool is_cube(const caught_picture *picture, float opacity)
{
    int hits = 0;
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        const ray r = make_pixel_ray(pixel);
        double depths[2], margin;
        const bool is_hit = cross_cube(&r, depths, &margin);
        if (margin < 1e-4) continue;
        const float alpha = picture->rgba[4 * pixel + 3], depth = picture->depth[pixel];
        const bool is_well =
            is_hit ? alpha == opacity && fabs((double)depth - depths[0]) < 1.5e-5 : alpha == 0 && isinf(depth);
        hits += is_hit;
        if (is_well) continue;
        fprintf(stderr, "pixel %d: opacity %g, depth %.9g, expected %.9g\n", pixel, (double)alpha, (double)depth,
                is_hit ? depths[0] : (double)INFINITY);
        return false;
    }
    return hits > PIXELS / 5;
}

static bool has_linear_colours(const caught_picture *picture, const caught_picture *other)
{
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        const ray r = make_pixel_ray(pixel);
        double depths[2], margin, at[3];
        if (!cross_cube(&r, depths, &margin) || margin < 1e-4) continue;
        for (int a = 0; a < 3; a++) at[a] = r.base[a] + depths[0] * r.direction[a];
        const double grey = (test_linear_field(at) + 2) / 4;
        const double light = grey <= 0.04045 ? grey / 12.92 : pow((grey + 0.055) / 1.055, 2.4);
        if (fabs((double)picture->rgba[4 * pixel] - light) < 1e-4) continue;
        fprintf(stderr, "pixel %d: %g, expected %g\n", pixel, (double)picture->rgba[4 * pixel], light);
        return false;
    }
    return memcmp(picture->depth, other->depth, PIXELS * sizeof(float)) == 0;
}

/* Checks pictures of the cube. Every ray crosses surfaces of opacity 1/2 twice, so that the opacity of the pixel is
 * 3/4. */
static void check_cube_picture(test_mesh_kind kind)
{
    session_input whole = {0};
    caught_picture alone = {0}, clear = {0};
    bool is_well = true;
    make_whole_mesh(kind, &whole);
    const char *scene = write_scene(IMAGE(COLOURED("")));
    if (own_rank == 0) alone = draw_input(MPI_COMM_SELF, scene, &whole);
    scene = write_scene(IMAGE(COLOURED(", opacity: 0.5")));
    if (own_rank == 0) {
        clear = draw_input(MPI_COMM_SELF, scene, &whole);
        is_well = is_cube(&alone, 1) && is_cube(&clear, 0.75F) && has_linear_colours(&alone, &clear);
    }
    everywhere(is_well);
    for (int way = 0; way < 3; way++) {
        session_input part = {0};
        extract_rank_cells(&whole, way == 1 ? TEST_BLOCK : TEST_RANDOM, way == 2, &part);
        caught_picture picture = draw_input(MPI_COMM_WORLD, scene, &part);
        everywhere(own_rank != 0 || are_same_pictures(&picture, &clear));
        free_caught(&picture);
        input_free(&part);
    }
    free_caught(&alone);
    free_caught(&clear);
    input_free(&whole);
}

static void cube_surfaces_are_exact_on_any_ranks(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) check_cube_picture(kind);
}

/* ---- warped faces -------------------------------------------------------------------------------------------- */

/* The reference intersects each bilinear patch in two stages: first as FINE × FINE squares of two triangles each, and
 * then by STEPS steps of Newton's method for the exact patch. */
enum { FINE = 16, STEPS = 6 };

static void evaluate_patch(const double *const p[4], double u, double v, double out[3])
{
    for (int a = 0; a < 3; a++)
        out[a] = (1 - v) * ((1 - u) * p[0][a] + u * p[1][a]) + v * ((1 - u) * p[3][a] + u * p[2][a]);
}

static bool intersects_triangle(const ray *r, const double *a, const double *b, const double *c)
{
    double u[3], v[3], w[3], p[3], q[3];
    for (int i = 0; i < 3; i++) u[i] = b[i] - a[i], v[i] = c[i] - a[i], w[i] = r->base[i] - a[i];
    cross_product(r->direction, v, p);
    cross_product(w, u, q);
    const double det = dot_product(u, p), s = dot_product(w, p) / det, t = dot_product(r->direction, q) / det;
    return s >= 0 && t >= 0 && s + t <= 1;
}

/* A ray's hit on a patch: its depth, and the sine of the angle between ray and patch. */
typedef struct patch_hit {
    double depth, slant;
} patch_hit;

static patch_hit refine_patch_hit(const ray *r, const double *const p[4], double u, double v)
{
    patch_hit out = {INFINITY, 1};
    for (int step = 0; step < STEPS; step++) {
        double at[3], du[3], dv[3], normal[3], left[3], a[3], b[3];
        evaluate_patch(p, u, v, at);
        for (int i = 0; i < 3; i++) {
            du[i] = (1 - v) * (p[1][i] - p[0][i]) + v * (p[2][i] - p[3][i]);
            dv[i] = (1 - u) * (p[3][i] - p[0][i]) + u * (p[2][i] - p[1][i]);
            left[i] = r->base[i] - at[i];
        }
        cross_product(du, dv, normal);
        cross_product(r->direction, dv, a);
        cross_product(du, r->direction, b);
        const double det = dot_product(normal, r->direction);
        out.depth = -dot_product(normal, left) / det;
        out.slant = fabs(det) / sqrt(dot_product(normal, normal) * dot_product(r->direction, r->direction));
        u -= dot_product(left, a) / -dot_product(du, a);
        v -= dot_product(left, b) / -dot_product(dv, b);
    }
    return out;
}

static void intersect_patch(const ray *r, const double *const p[4], patch_hit *nearest)
{
    for (int i = 0; i < FINE; i++)
        for (int j = 0; j < FINE; j++) {
            double q[4][3];
            for (int k = 0; k < 4; k++)
                evaluate_patch(p, (double)(i + (k == 1 || k == 2)) / FINE, (double)(j + k / 2) / FINE, q[k]);
            if (!intersects_triangle(r, q[0], q[1], q[2]) && !intersects_triangle(r, q[0], q[2], q[3])) continue;
            const patch_hit hit = refine_patch_hit(r, p, (i + 0.5) / FINE, (j + 0.5) / FINE);
            if (hit.depth < nearest->depth) *nearest = hit;
        }
}

/* Returns whether the picture shows the hex. Rays at the silhouette, next to pixels that do not hit the hex, are not
 * checked. Depths have rounding errors of numbers near 7 in single precision, and errors of the position across the ray
 * divided by the sine of the angle between ray and patch. */
static bool is_hex(const caught_picture *picture, const double *places)
{
    static const int faces[6][4] = {{0, 4, 7, 3}, {1, 2, 6, 5}, {0, 1, 5, 4}, {3, 7, 6, 2}, {0, 3, 2, 1}, {4, 5, 6, 7}};
    patch_hit *truth = test_calloc(PIXELS, sizeof *truth);
    int hits = 0, wrong = 0, edge = 0;
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        const ray r = make_pixel_ray(pixel);
        truth[pixel] = (patch_hit){INFINITY, 1};
        for (int face = 0; face < 6; face++) {
            const double *p[4];
            for (int i = 0; i < 4; i++) p[i] = places + 3 * faces[face][i];
            intersect_patch(&r, p, &truth[pixel]);
        }
    }
    for (int pixel = WIDTH; pixel < PIXELS - WIDTH; pixel++) {
        const double depth = (double)picture->depth[pixel];
        const bool is_hit = isfinite(truth[pixel].depth);
        hits += is_hit;
        if (is_hit ? fabs(depth - truth[pixel].depth) * truth[pixel].slant < 5e-6 : isinf(depth)) continue;
        const bool is_inside = isfinite(truth[pixel - 1].depth) && isfinite(truth[pixel + 1].depth) &&
                               isfinite(truth[pixel - WIDTH].depth) && isfinite(truth[pixel + WIDTH].depth);
        const bool is_outside = isinf(truth[pixel - 1].depth) && isinf(truth[pixel + 1].depth) &&
                                isinf(truth[pixel - WIDTH].depth) && isinf(truth[pixel + WIDTH].depth);
        wrong += is_inside || is_outside;
        edge++;
        if (is_inside || is_outside)
            fprintf(stderr, "pixel %d: depth %g, expected %g\n", pixel, depth, truth[pixel].depth);
    }
    test_free(truth);
    return hits > 100 && wrong == 0 && edge < hits / 20;
}

static void warped_faces_are_bilinear_patches(void **state)
{
    (void)state;
    if (own_rank != 0) return;
    char scene[256];
    const char *folder = IMAGE("      - surface: {}\n");
    snprintf(scene, sizeof scene, "test_session_surfaces_warped_%d.yaml", rank_count);
    FILE *file = fopen(scene, "w");
    assert_true(file && fputs(folder, file) >= 0 && fclose(file) == 0);
    for (uint64_t seed = 1; seed <= 6; seed++) {
        session_input in = {0};
        test_mesh_make_single_cell(TEST_UNIT_HEX, test_linear_field, &in.part);
        for (int64_t i = 0; i < 24; i++) {
            const double moved = test_uniform_between((uint64_t)i, seed, -0.25, 0.25);
            in.part.coordinates[i] = 1.5 * (in.part.coordinates[i] - 0.5 + moved);
        }
        if (seed % 2) test_mesh_to_polyhedra(&in.part, 1);
        input_describe(&in);
        double places[24];
        memcpy(places, in.part.coordinates, sizeof places);
        caught_picture picture = draw_input(MPI_COMM_SELF, scene, &in);
        assert_true(is_hex(&picture, places));
        free_caught(&picture);
        input_free(&in);
    }
    remove(scene);
}

/* ---- recomputation ------------------------------------------------------------------------------------------- */

static void faces_are_found_once_for_the_cells(void **state)
{
    (void)state;
    session_input whole = {0}, part = {0};
    make_whole_mesh(TEST_MIXED, &whole);
    extract_rank_cells(&whole, TEST_BLOCK, false, &part);
    insitu_session *session = open_session_with_input(MPI_COMM_WORLD, write_scene(IMAGE(COLOURED(""))), &part);
    const session_mesh *mesh = session_find_mesh(&session->meshes, "m");
    const session_face *faces = mesh->outers[0]->faces;
    everywhere(insitu_last_report(session)->bytes_copied >= mesh->outers[0]->bytes && mesh->tree.node_count == 0);
    for (int64_t v = 0; v < part.part.vertex_count; v++) part.part.coordinates[3 * v + 1] *= 2;
    part.mesh.changed = INSITU_CHANGED_GEOMETRY;
    everywhere(insitu_set_mesh(session, "m", &part.mesh) == INSITU_OK);
    check_step_succeeds(session, 1);
    everywhere(mesh->outers[0]->faces == faces);
    double highest = 0;
    for (int64_t v = 0; v < mesh->outers[0]->mesh->cells.vertex_count; v++)
        highest = fmax(highest, mesh->outers[0]->coordinates[3 * v + 1]);
    MPI_Allreduce(MPI_IN_PLACE, &highest, 1, MPI_DOUBLE, MPI_MAX, MPI_COMM_WORLD);
    everywhere(highest == 2);
    part.mesh.changed = INSITU_CHANGED_ALL;
    everywhere(submit_input(session, &part) == INSITU_OK);
    everywhere(mesh->outer_count == 0);
    check_step_succeeds(session, 2);
    everywhere(mesh->outers[0]->are_faces_known);
    insitu_destroy(&session);
    input_free(&part);
    input_free(&whole);
}

/* ---- polygons -------------------------------------------------------------------------------------------------- */

/* Checks a cube whose face towards the eye has an additional vertex in the middle of an edge, like a hanging node. Rays
 * that meet the face exactly on the line y = z, between two of its triangles, must hit it. */
static void rays_along_the_diagonals_of_polygons_hit(void **state)
{
    (void)state;
    static const double places[9][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},  {0, 0, 1},
                                        {1, 0, 1}, {1, 1, 1}, {0, 1, 1}, {1, 0.5, 0}};
    static const int64_t connectivity[6] = {0, 1, 2, 3, 4, 5}, offsets[2] = {0, 6};
    static const int64_t vertices[26] = {1, 8, 2, 6, 5, 0, 4, 7, 3, 0, 1, 5, 4, 3, 7, 6, 2, 0, 3, 2, 8, 1, 4, 5, 6, 7};
    static const int64_t faces[7] = {0, 5, 9, 13, 17, 22, 26};
    insitu_session *session = open_session(
        MPI_COMM_WORLD, write_scene("images:\n  - name: a\n    size: [64, 64]\n    layers: [{surface: {}}]\n"
                                    "    camera: {position: [5, 0.5, 0.5], focal: [0, 0.5, 0.5], up: [0, 0, 1], "
                                    "projection: orthographic, height: 2}\n    outputs: [{path: a.exr}]\n"));
    insitu_mesh mesh;
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = 9;
    insitu_mesh_interleaved(&mesh, places, INSITU_FLOAT64);
    mesh.cell_count = 1;
    mesh.cell_type = INSITU_POLYHEDRON;
    mesh.connectivity_count = 6;
    mesh.connectivity = (insitu_array){connectivity, INSITU_INT64, 0};
    mesh.offsets = (insitu_array){offsets, INSITU_INT64, 0};
    mesh.face_count = 6;
    mesh.face_offsets = (insitu_array){faces, INSITU_INT64, 0};
    mesh.face_connectivity_count = 26;
    mesh.face_connectivity = (insitu_array){vertices, INSITU_INT64, 0};
    discard_pictures();
    everywhere(own_rank != 0 || insitu_set_mesh(session, "m", &mesh) == INSITU_OK);
    everywhere(insitu_step(session, 0, 0) == INSITU_OK);
    bool is_right = own_rank != 0 || caught_count == 1;
    for (int i = 0; is_right && own_rank == 0 && i < 64 * 64; i++) {
        const int column = i % 64, row = i / 64;
        const bool is_inside = column >= 16 && column < 48 && row >= 16 && row < 48;
        /* Depths are floats of about 4, measured along the camera's axis. */
        is_right = is_inside ? fabs((double)caught[0].depth[i] - 4) < 1e-6 : isinf(caught[0].depth[i]);
        if (!is_right) fprintf(stderr, "pixel %d, %d: depth %g\n", column, row, (double)caught[0].depth[i]);
    }
    everywhere(is_right);
    insitu_destroy(&session);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(outer_faces_match_the_cube),
        cmocka_unit_test(vertex_ids_identify_shared_faces),
        cmocka_unit_test(cube_surfaces_are_exact_on_any_ranks),
        cmocka_unit_test(warped_faces_are_bilinear_patches),
        cmocka_unit_test(faces_are_found_once_for_the_cells),
        cmocka_unit_test(rays_along_the_diagonals_of_polygons_hit),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
