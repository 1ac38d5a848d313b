/* Checks edges of outer surfaces. The part of each pixel that lines cover must follow from the projected edges of the
 * face that the pixel's ray hits, for all types of cells and for faces with more than four corners. The picture must be
 * the same on any number of ranks. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "render.h"
#include "session.h"
#include "session_cell_faces.h"
#include "test_session_fixture.h"

enum { SIDE = 3, WIDTH = 240, HEIGHT = 180, PIXELS = WIDTH * HEIGHT, MOST_CORNERS = 8 };

#define LINE_WIDTH 1.5
#define IMAGE(size, camera, keys)                                                                                      \
    "images:\n  - name: a\n    size: " size "\n    background: [0, 0, 0, 0]\n    camera: {" camera "}\n    layers:\n"  \
    "      - surface: {colour: [1, 1, 1], edges: {width: 1.5, colour: [0, 0, 0]},"                                     \
    " material: {ambient: 1, diffuse: 0, specular: 0}" keys "}\n    outputs: [{path: a.exr}]\n"
#define EYE "position: [3, 2.2, 4], focal: [0, 0, 0], angle: 40"
#define FLAT "position: [3, 2.2, 4], focal: [0, 0, 0], projection: orthographic, height: 4"

static render_camera make_camera(bool is_flat)
{
    render_camera out;
    render_camera_look_at(&out, (const double[]){3, 2.2, 4}, (const double[]){0, 0, 0}, (const double[]){0, 1, 0}, 40,
                          WIDTH, HEIGHT);
    out.is_orthographic = is_flat;
    if (is_flat) out.half_height = 2;
    return out;
}

/* ---- the reference ------------------------------------------------------------------------------------------- */

typedef struct polygon {
    int count;
    double corners[MOST_CORNERS][3];
} polygon;

typedef struct body {
    int count;
    polygon *faces;
} body;

/* Makes a body of the faces on the border of the cube from -1 to 1 (is_cube), or of all faces of all cells. */
static body make_body(const grid *g, bool is_cube)
{
    body out = {0};
    out.faces = test_calloc((size_t)g->cell_count * 40, sizeof *out.faces);
    for (int64_t cell = 0; cell < g->cell_count; cell++) {
        const session_cell_faces faces = session_faces_of_cell(g, cell);
        for (int64_t f = 0; f < faces.count; f++) {
            const session_face_loop loop = session_find_face_loop(&faces, f);
            polygon face = {.count = (int)loop.size};
            bool is_on = !is_cube;
            for (int i = 0; i < face.count; i++)
                grid_read_vertex_position(g, session_face_vertex(&loop, i), face.corners[i]);
            for (int side = 0; side < 6; side++) {
                int count = 0;
                for (int i = 0; i < face.count; i++) count += face.corners[i][side / 2] == side % 2 * 2 - 1;
                is_on = is_on || count == face.count;
            }
            if (is_on) out.faces[out.count++] = face;
        }
    }
    return out;
}

/* Returns the depth at which a ray meets a convex face; infinity if it misses the face. */
static double intersect_face(const polygon *face, const double base[3], const double direction[3])
{
    double u[3], v[3], normal[3], from[3], at[3];
    for (int a = 0; a < 3; a++) {
        u[a] = face->corners[1][a] - face->corners[0][a];
        v[a] = face->corners[2][a] - face->corners[0][a];
        from[a] = face->corners[0][a] - base[a];
    }
    cross_product(u, v, normal);
    const double depth = dot_product(from, normal) / dot_product(direction, normal);
    for (int a = 0; a < 3; a++) at[a] = base[a] + depth * direction[a];
    for (int i = 0; i < face->count; i++) {
        double side[3], turned[3];
        for (int a = 0; a < 3; a++) {
            side[a] = face->corners[(i + 1) % face->count][a] - face->corners[i][a];
            from[a] = at[a] - face->corners[i][a];
        }
        cross_product(side, from, turned);
        if (dot_product(turned, normal) < 0) return INFINITY;
    }
    return depth;
}

/* Projects a point into the picture; out receives its position in pixels. Returns the point's depth. */
static double project_point(const render_camera *c, const double point[3], double out[2])
{
    double from[3];
    for (int a = 0; a < 3; a++) from[a] = point[a] - c->eye[a];
    const double depth = dot_product(from, c->forward),
                 pixel = 2 * c->half_height / HEIGHT * (c->is_orthographic ? 1 : depth);
    out[0] = dot_product(from, c->right) / pixel + 0.5 * WIDTH;
    out[1] = 0.5 * HEIGHT - dot_product(from, c->up) / pixel;
    return depth;
}

/* Computes a lower and an upper bound of the distance, in pixels, from the pixel's centre to the middle of the nearest
 * line. The library divides an edge's offset from the ray by the depth of the hit instead of the edge's own depth; the
 * resulting error is bounded by the difference of the two depths. */
static void bound_distance_from_line(const render_camera *c, const polygon *face, const double pixel[2], double hit,
                                     double bounds[2])
{
    bounds[0] = bounds[1] = INFINITY;
    for (int i = 0; i < face->count; i++) {
        double a[2], b[2], depths[2];
        depths[0] = project_point(c, face->corners[i], a);
        depths[1] = project_point(c, face->corners[(i + 1) % face->count], b);
        const double e[2] = {b[0] - a[0], b[1] - a[1]};
        const double along = ((pixel[0] - a[0]) * e[0] + (pixel[1] - a[1]) * e[1]) / (e[0] * e[0] + e[1] * e[1]);
        const double s = fmin(fmax(along, 0), 1);
        const double distance = hypot(a[0] + s * e[0] - pixel[0], a[1] + s * e[1] - pixel[1]);
        const double scale = c->is_orthographic ? 0 : 1 / hit;
        bounds[0] = fmin(bounds[0], distance * (1 + scale * (fmin(depths[0], depths[1]) - hit)));
        bounds[1] = fmin(bounds[1], distance * (1 + scale * (fmax(depths[0], depths[1]) - hit)));
    }
}

/* Checks how much of a pixel the lines leave white. The tolerance is that of single precision: positions are rounded by
 * about 5e-7 in scenes of size 5, which is 1/15,000 of a pixel, but more on slanted faces. */
static bool is_exact_edge_pixel(const render_camera *c, const body *b, const caught_picture *picture, int pixel,
                                bool *has_line)
{
    double base[3], direction[3], nearest = INFINITY, bounds[2];
    const polygon *face = NULL;
    render_camera_ray(c, pixel % WIDTH, pixel / WIDTH, base, direction);
    for (int i = 0; i < b->count; i++) {
        const double depth = intersect_face(&b->faces[i], base, direction);
        if (depth >= nearest) continue;
        nearest = depth;
        face = &b->faces[i];
    }
    const float *rgba = picture->rgba + 4 * pixel;
    if (!face) return true;
    bound_distance_from_line(c, face, (const double[]){pixel % WIDTH + 0.5, pixel / WIDTH + 0.5}, nearest, bounds);
    const double least = fmin(fmax(bounds[0] - 0.5 * (LINE_WIDTH - 1), 0), 1);
    const double most = fmin(fmax(bounds[1] - 0.5 * (LINE_WIDTH - 1), 0), 1);
    *has_line = *has_line || most < 0.5;
    const double white = (double)rgba[0];
    if ((white > least - 2e-3 && white < most + 2e-3) || (rgba[3] == 0 && least < 0.3)) return true;
    fprintf(stderr, "pixel %d: %g, expected from %g to %g\n", pixel, white, least, most);
    return false;
}

static bool is_exact_picture(const caught_picture *picture, const body *b, bool is_flat)
{
    const render_camera c = make_camera(is_flat);
    bool has_line = false, is_well = true;
    for (int pixel = 0; pixel < PIXELS && is_well; pixel++)
        is_well = is_exact_edge_pixel(&c, b, picture, pixel, &has_line);
    return is_well && has_line;
}

/* ---- pictures ------------------------------------------------------------------------------------------------ */

/* Draws a picture; if b is not NULL, also makes the body of the session's mesh. */
static caught_picture draw_edges(MPI_Comm comm, const char *scene, const session_input *in, body *b)
{
    insitu_session *session = open_session_and_draw(comm, scene, in);
    if (b) *b = make_body(&session_find_mesh(&session->meshes, "m")->cells, in->part.cell_count > 1);
    const caught_picture picture = pop_caught_picture();
    insitu_destroy(&session);
    return picture;
}

static void check_against_exact(const session_input *in, bool is_flat)
{
    const char *scene = write_scene(is_flat ? IMAGE("[240, 180]", FLAT, "") : IMAGE("[240, 180]", EYE, ""));
    bool is_well = true;
    if (own_rank == 0) {
        body b = {0};
        caught_picture picture = draw_edges(MPI_COMM_SELF, scene, in, &b);
        is_well = is_exact_picture(&picture, &b, is_flat);
        free_caught(&picture);
        test_free(b.faces);
    }
    everywhere(is_well);
}

static void lines_are_drawn_along_edges(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        session_input whole = {0};
        test_mesh_make_lattice(kind, SIDE, 0, test_linear_field, &whole.part);
        input_describe(&whole);
        check_against_exact(&whole, kind % 2);
        input_free(&whole);
    }
}

/* Checks a prism over a regular hexagon: the triangle fan of the hexagon has three inner edges, along which no lines
 * may be drawn. The prism is rotated, because the fan depends on which corner has the smallest coordinates. */
static void faces_of_many_corners_have_no_other_lines(void **state)
{
    (void)state;
    for (int turn = 0; turn < 5; turn++) {
        double coordinates[12][3];
        int64_t faces[2 * 6 + 6 * 4], offsets[9] = {0}, all[8], cells[2] = {0, 8}, count = 0;
        const unsigned char type = 42;
        for (int i = 0; i < 12; i++) {
            const double angle = 0.3 * turn + 1.0471975511965976 * (i % 6);
            coordinates[i][0] = cos(angle);
            coordinates[i][1] = sin(angle);
            coordinates[i][2] = i < 6 ? -0.5 : 0.7;
        }
        for (int f = 0; f < 8; f++) {
            for (int i = 0; i < 6 && f < 2; i++) faces[count++] = f ? 6 + i : 5 - i;
            const int next = (f - 1) % 6, corners[4] = {f - 2, next, 6 + next, 4 + f};
            for (int i = 0; i < 4 && f >= 2; i++) faces[count++] = corners[i];
            offsets[f + 1] = count;
            all[f] = f;
        }
        session_input in = {0};
        test_mesh_make_lattice(TEST_HEXES, 1, 0, test_linear_field, &in.part);
        input_describe(&in);
        double values[12] = {0};
        insitu_mesh_defaults(&in.mesh);
        in.mesh.vertex_count = 12;
        insitu_mesh_interleaved(&in.mesh, coordinates, INSITU_FLOAT64);
        in.mesh.cell_count = 1;
        in.mesh.connectivity_count = 8;
        in.mesh.connectivity = (insitu_array){all, INSITU_INT64, 0};
        in.mesh.offsets = (insitu_array){cells, INSITU_INT64, 0};
        in.mesh.cell_types = (insitu_array){&type, INSITU_UINT8, 0};
        in.mesh.face_count = 8;
        in.mesh.face_offsets = (insitu_array){offsets, INSITU_INT64, 0};
        in.mesh.face_connectivity_count = count;
        in.mesh.face_connectivity = (insitu_array){faces, INSITU_INT64, 0};
        in.field.count = 12;
        in.field.values = (insitu_array){values, INSITU_FLOAT64, 0};
        check_against_exact(&in, turn % 2);
        input_free(&in);
    }
}

static void any_ranks_draw_one_picture(void **state)
{
    (void)state;
    const char *scene = write_scene(IMAGE("[240, 180]", EYE, ", opacity: 0.5"));
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        session_input whole = {0}, part = {0};
        caught_picture alone = {0};
        input_create(&whole, kind, SIDE, TEST_BLOCK, 0, 1);
        if (own_rank == 0) alone = draw_edges(MPI_COMM_SELF, scene, &whole, NULL);
        input_create(&part, kind, SIDE, TEST_RANDOM, own_rank, rank_count);
        test_mesh_reorder_vertices(&part.part, 3 + (uint64_t)own_rank);
        test_mesh_shuffle_cells(&part.part, 7 + (uint64_t)own_rank);
        input_describe(&part);
        caught_picture picture = draw_edges(MPI_COMM_WORLD, scene, &part, NULL);
        everywhere(own_rank != 0 || are_same_pictures(&picture, &alone));
        free_caught(&picture);
        free_caught(&alone);
        input_free(&part);
        input_free(&whole);
    }
}

/* Checks a lattice of 24 squares along each side that covers about 10 pixels: the picture must be white, as without
 * lines. */
static void lines_fade_on_small_faces(void **state)
{
    (void)state;
    session_input in = {0};
    const char *scene = write_scene(IMAGE("[24, 18]", EYE, ""));
    test_mesh_make_lattice(TEST_HEXES, 24, 0, test_linear_field, &in.part);
    input_describe(&in);
    bool is_well = true;
    if (own_rank == 0) {
        caught_picture picture = draw_edges(MPI_COMM_SELF, scene, &in, NULL);
        for (int i = 0; i < 24 * 18; i++) is_well = is_well && picture.rgba[4 * i] == picture.rgba[4 * i + 3];
        free_caught(&picture);
    }
    everywhere(is_well);
    input_free(&in);
}

/* ---- rays exactly through edges --------------------------------------------------------------------------------- */

enum { ACROSS = 65 };

/* Returns whether a surface drawn along an axis is closed. The rays pass exactly through lines of the lattice: pixels
 * are 1/32 wide, the middle one is at 0, and all numbers are exact. Surfaces have opacity 0.5, so that a front and a
 * back that are hit once each leave a quarter of the light. Pixels on the border of the picture are not checked,
 * because the surface covers only half of them. */
static bool is_closed_along(const session_input *in, int axis, int side, const char *edges)
{
    char text[512];
    double eye[3] = {0};
    eye[axis] = 4 * side;
    snprintf(text, sizeof text,
             "images:\n  - name: a\n    size: [65, 65]\n    background: [0, 0, 0, 0]\n"
             "    camera: {position: [%g, %g, %g], focal: [0, 0, 0], up: %s, projection: orthographic,\n"
             "             height: 2.03125}\n"
             "    layers:\n      - surface: {opacity: 0.5, material: {ambient: 1, diffuse: 0, specular: 0}%s}\n"
             "    outputs: [{path: a.exr}]\n",
             eye[0], eye[1], eye[2], axis == 1 ? "[0, 0, 1]" : "[0, 1, 0]", edges);
    caught_picture picture = draw_edges(MPI_COMM_WORLD, write_scene(text), in, NULL);
    int holes = 0;
    for (int i = 0; own_rank == 0 && i < ACROSS * ACROSS; i++) {
        const int x = i % ACROSS, y = i / ACROSS;
        const bool is_rim = x == 0 || y == 0 || x == ACROSS - 1 || y == ACROSS - 1;
        holes += !is_rim && (picture.rgba[4 * i + 3] != 0.75f || picture.depth[i] != 3);
    }
    free_caught(&picture);
    return holes == 0;
}

/* Makes this rank's part of a lattice without jitter. */
static void make_exact_part(test_mesh_kind kind, session_input *in)
{
    test_mesh whole;
    test_mesh_make_lattice(kind, 4, 0, test_linear_field, &whole);
    int *owners = test_calloc((size_t)whole.cell_count, sizeof *owners);
    test_partition_cells(&whole, TEST_RANDOM, 4, rank_count, owners);
    test_mesh_extract_part(&whole, owners, own_rank, &in->part);
    test_free(owners);
    test_mesh_free(&whole);
    input_describe(in);
}

static void rays_through_edges_hit_one_face(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        session_input in = {0};
        make_exact_part(kind, &in);
        for (int axis = 0; axis < 3; axis++)
            for (int side = -1; side <= 1; side += 2) {
                everywhere(is_closed_along(&in, axis, side, ""));
                everywhere(is_closed_along(&in, axis, side, ", edges: {width: 1}"));
            }
        input_free(&in);
    }
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lines_are_drawn_along_edges), cmocka_unit_test(faces_of_many_corners_have_no_other_lines),
        cmocka_unit_test(any_ranks_draw_one_picture), cmocka_unit_test(lines_fade_on_small_faces),
        cmocka_unit_test(rays_through_edges_hit_one_face)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
