/* Checks plane runs: triangles, quads and polygons in the plane of x and y, given without z coordinates. If the scene
 * has no camera and no material, each pixel must have the colour of the colour map at the field's value, which has a
 * closed form, and the pictures must be bit-identical on any number of ranks. Statistics, conditions and percentiles
 * must weight cells by area. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "test_session_fixture.h"

enum { NX = 6, NY = 4, MAX_VERTICES = (NX + 1) * (NY + 1), MAX_CELLS = 2 * NX * NY, MAX_ENTRIES = 4 * MAX_CELLS };
enum { WIDTH = 120, HEIGHT = 50, PIXELS = WIDTH * HEIGHT };
static const double right = 3, top = 2; /* the plate is [0, 3] x [0, 2] */

#define IMAGE(more, layer)                                                                                             \
    "images:\n  - name: a\n    size: [120, 50]\n    background: [0, 0, 0, 0]\n" more "    layers: [" layer "]\n"       \
    "    outputs: [{path: a.exr}]\n"
#define MAP_OF(field) "{surface: {colour_by: {field: " field ", map: grey, range: [-2, 6]}}}"
#define NEVER IMAGE("    when: {field: f, above: 1e9}\n", MAP_OF("f"))

/* ---- plates --------------------------------------------------------------------------------------------------- */

typedef enum plate_kind { QUADS, TRIANGLES, POLYGONS, PLATE_KINDS } plate_kind;

/* This rank's cells of a rectangular plate, with all vertices of the plate. */
typedef struct plate {
    plate_kind kind;
    int cell_count, entry_count;
    double xy[2 * MAX_VERTICES], zeros[MAX_VERTICES], f[MAX_VERTICES], c[MAX_CELLS], v[3 * MAX_VERTICES];
    int connectivity[MAX_ENTRIES], offsets[MAX_CELLS + 1];
} plate;

static double compute_linear_field(double x, double y)
{
    return 2 * x - y;
}

/* Returns the cell value of a square of the lattice; both of its triangles have this value. */
static double compute_square_value(int i, int j)
{
    return (3 * i + 5 * j) % 7 - 1;
}

static void add_cell(plate *p, double value, int count, const int *vertices)
{
    p->c[p->cell_count] = value;
    memcpy(p->connectivity + p->entry_count, vertices, (size_t)count * sizeof *vertices);
    p->entry_count += count;
    p->offsets[++p->cell_count] = p->entry_count;
}

static void add_square(plate *p, int i, int j)
{
    const int a = j * (NX + 1) + i, b = a + NX + 1;
    const int quad[4] = {a, a + 1, b + 1, b}, lower[3] = {a, a + 1, b + 1}, upper[3] = {b + 1, b, a};
    if (p->kind != TRIANGLES) {
        add_cell(p, compute_square_value(i, j), 4, quad);
    } else {
        add_cell(p, compute_square_value(i, j), 3, lower);
        add_cell(p, compute_square_value(i, j), 3, upper);
    }
}

/* Makes the squares of the plate that belong to rank `rank` of `ranks` ranks. */
static void make_plate(plate_kind kind, int rank, int ranks, plate *out)
{
    *out = (plate){.kind = kind};
    for (int n = 0; n < MAX_VERTICES; n++) {
        const double x = right * (n % (NX + 1)) / NX, y = top * (n / (NX + 1)) / NY;
        out->xy[2 * n] = x;
        out->xy[2 * n + 1] = y;
        out->f[n] = compute_linear_field(x, y);
        out->v[3 * n] = 0.6 * out->f[n];
        out->v[3 * n + 2] = 0.8 * out->f[n];
    }
    for (int j = 0; j < NY; j++)
        for (int i = 0; i < NX; i++)
            if ((i * NY + j) % ranks == rank) add_square(out, i, j);
}

static insitu_mesh describe_plate(const plate *p, bool with_z)
{
    static const insitu_cell_type types[] = {INSITU_QUAD, INSITU_TRIANGLE, INSITU_POLYGON};
    insitu_mesh mesh;
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = MAX_VERTICES;
    for (int axis = 0; axis < 2; axis++)
        mesh.coordinates[axis] = (insitu_array){p->xy + axis, INSITU_FLOAT64, 2 * sizeof *p->xy};
    if (with_z) mesh.coordinates[2] = (insitu_array){p->zeros, INSITU_FLOAT64, 0};
    mesh.cell_count = p->cell_count;
    mesh.cell_type = types[p->kind];
    mesh.connectivity_count = p->entry_count;
    mesh.connectivity = (insitu_array){p->connectivity, INSITU_INT32, 0};
    if (p->kind == POLYGONS) mesh.offsets = (insitu_array){p->offsets, INSITU_INT32, 0};
    return mesh;
}

static void set_field(insitu_session *session, const char *name, insitu_centring centring, int64_t count,
                      int components, const double *values)
{
    insitu_field field;
    insitu_field_defaults(&field);
    field.name = name;
    field.centring = centring;
    field.count = count;
    field.component_count = components;
    field.values = (insitu_array){values, INSITU_FLOAT64, 0};
    assert_int_equal(insitu_set_field(session, "plate", &field), INSITU_OK);
}

static insitu_session *open_session_with_plate(MPI_Comm comm, const char *scene, const plate *p, bool with_z)
{
    insitu_session *session = open_session(comm, scene);
    const insitu_mesh mesh = describe_plate(p, with_z);
    discard_pictures();
    assert_int_equal(insitu_set_mesh(session, "plate", &mesh), INSITU_OK);
    set_field(session, "f", INSITU_VERTEX, MAX_VERTICES, 1, p->f);
    set_field(session, "c", INSITU_CELL, p->cell_count, 1, p->c);
    set_field(session, "v", INSITU_VERTEX, MAX_VERTICES, 3, p->v);
    const insitu_status status = insitu_step(session, 0, 0);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    assert_int_equal(status, INSITU_OK);
    return session;
}

static caught_picture draw_plate(MPI_Comm comm, const char *scene, const plate *p, bool with_z)
{
    insitu_session *session = open_session_with_plate(comm, scene, p, with_z);
    if (insitu_last_report(session)->warnings[0]) fail_msg("warnings: %s", insitu_last_report(session)->warnings);
    const caught_picture picture = pop_caught_picture();
    insitu_destroy(&session);
    return picture;
}

/* ---- pictures ------------------------------------------------------------------------------------------------- */

/* Computes the position on the plate at the centre of a pixel. The plate is scaled to fit into 0.95 of the frame's
 * width and of its height. */
static void compute_pixel_position(int pixel, double *x, double *y)
{
    const double half = fmax(top / 2, right / 2 * HEIGHT / WIDTH) / 0.95, size = 2 * half / HEIGHT;
    *x = right / 2 + (pixel % WIDTH + 0.5 - WIDTH / 2.0) * size;
    *y = top / 2 - (pixel / WIDTH + 0.5 - HEIGHT / 2.0) * size;
}

static bool is_near_edge(double at, double size, int cells)
{
    const double place = at / size * cells;
    return fabs(place - round(place)) < 1e-4;
}

/* Converts linear light to the sRGB code of a PNG, before it is rounded. */
static double encode_srgb(float light)
{
    const double c = (double)light;
    return 255 * (c <= 0.0031308 ? 12.92 * c : 1.055 * pow(c, 1 / 2.4) - 0.055);
}

/* Returns whether each 8-bit channel of each pixel differs by at most 1 from the grey map at the field's value.
 * Rounding to 8 bits takes half of this tolerance. Errors of the colour map's table, which is linear between 1024
 * greys, and of float32 values are far below the other half. */
static bool is_picture_of_grey_map(const caught_picture *picture, bool is_of_cells)
{
    int hits = 0;
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        double x, y;
        compute_pixel_position(pixel, &x, &y);
        const float *own = picture->rgba + 4 * (ptrdiff_t)pixel;
        if (is_near_edge(x, right, NX) || is_near_edge(y, top, NY)) continue;
        const bool is_hit = x > 0 && x < right && y > 0 && y < top;
        const double value =
            is_of_cells ? compute_square_value((int)(x / right * NX), (int)(y / top * NY)) : compute_linear_field(x, y);
        const double code = 255 * (value + 2) / 8;
        bool is_well = own[3] == (is_hit ? 1 : 0);
        for (int k = 0; k < 3 && is_hit; k++) is_well = is_well && fabs(encode_srgb(own[k]) - code) <= 1;
        hits += is_hit;
        if (is_well) continue;
        fprintf(stderr, "pixel %d at (%g, %g): %g, expected %g\n", pixel, x, y, encode_srgb(own[0]), is_hit ? code : 0);
        return false;
    }
    return hits > PIXELS / 3;
}

/* Checks pictures of the plate without z coordinates and with z = 0, on all ranks and on one rank. */
static void pictures_are_the_colour_map_of_the_field(void **state)
{
    (void)state;
    static const char *const scenes[2] = {IMAGE("", MAP_OF("f")), IMAGE("", MAP_OF("c"))};
    for (plate_kind kind = 0; kind < PLATE_KINDS; kind++)
        for (int of_cells = 0; of_cells < 2; of_cells++) {
            const char *scene = write_scene(scenes[of_cells]);
            plate part, whole;
            make_plate(kind, own_rank, rank_count, &part);
            make_plate(kind, 0, 1, &whole);
            caught_picture ours = draw_plate(MPI_COMM_WORLD, scene, &part, of_cells), alone = {0};
            bool is_well = true;
            if (own_rank == 0) {
                alone = draw_plate(MPI_COMM_SELF, scene, &whole, !of_cells);
                is_well = is_picture_of_grey_map(&ours, of_cells) && are_same_pictures(&ours, &alone);
            }
            everywhere(is_well);
            free_caught(&ours);
            free_caught(&alone);
        }
}

/* Checks that keys of the scene override the defaults of plane runs: a direction from behind, an explicit camera, a
 * light and a material must each change the picture. */
static void scene_keys_override_defaults(void **state)
{
    (void)state;
    static const char *const scenes[] = {
        IMAGE("    camera: {automatic: {direction: [0, 0, -1]}}\n", MAP_OF("f")),
        IMAGE("    camera: {position: [1.5, 1, 3], focal: [1.5, 1, 0]}\n", MAP_OF("f")),
        IMAGE("    lights: [{direction: [0, 0, 1], intensity: 0.5}]\n", MAP_OF("f")),
        IMAGE("", "{surface: {colour_by: {field: f, map: grey, range: [-2, 6]}, material: {}}}")};
    plate part;
    make_plate(QUADS, own_rank, rank_count, &part);
    caught_picture plain = draw_plate(MPI_COMM_WORLD, write_scene(IMAGE("", MAP_OF("f"))), &part, false);
    for (size_t i = 0; i < sizeof scenes / sizeof *scenes; i++) {
        caught_picture other = draw_plate(MPI_COMM_WORLD, write_scene(scenes[i]), &part, false);
        everywhere(own_rank != 0 || !are_same_pictures(&plain, &other));
        free_caught(&other);
    }
    free_caught(&plain);
}

static void layers_that_show_nothing_are_reported(void **state)
{
    (void)state;
    static const struct {
        const char *scene, *word;
    } cases[] = {{IMAGE("", "{volume: {field: f}}"), "the volume of \"f\""},
                 {IMAGE("", "{slice: {field: f, planes: [{normal: [0, 0, 1]}]}}"), "the slice of \"f\""}};
    plate part;
    make_plate(QUADS, own_rank, rank_count, &part);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        insitu_session *session = open_session_with_plate(MPI_COMM_WORLD, write_scene(cases[i].scene), &part, false);
        const char *warnings = insitu_last_report(session)->warnings;
        everywhere(strstr(warnings, cases[i].word) && strstr(warnings, "surface: {colour_by: {field: f}}"));
        insitu_destroy(&session);
    }
}

/* ---- lines ---------------------------------------------------------------------------------------------------- */

#define LINES "{isosurface: {field: f, values: [3, 1], colours: [[1, 0, 0], [0, 1, 0]]}}"

/* Returns the fraction of a pixel that the contour line of the value `level` covers. The line is 1.5 pixels wide, in a
 * field with the slope of compute_linear_field(). The coverage is that of a box filter of one pixel across the line. */
static double compute_line_coverage(double value, double level)
{
    const double half = fmax(top / 2, right / 2 * HEIGHT / WIDTH) / 0.95, size = 2 * half / HEIGHT;
    return fmin(fmax(1.25 - fabs(value - level) / (sqrt(5) * size), 0), 1);
}

/* Returns whether the picture shows the two contour lines, red at 3 and green at 1, over the grey map if on_grey is
 * set. Float32 values up to 8 have errors of 1e-6, which moves a line by 4e-6 of a pixel of 0.094. The light of a pixel
 * is proportional to the fraction that the line covers. */
static bool check_contour_lines(const caught_picture *picture, bool on_grey)
{
    int hits = 0;
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        double x, y;
        compute_pixel_position(pixel, &x, &y);
        const float *own = picture->rgba + 4 * (ptrdiff_t)pixel;
        if (is_near_edge(x, right, NX) || is_near_edge(y, top, NY)) continue;
        const bool is_in = x > 0 && x < right && y > 0 && y < top;
        const double red = is_in ? compute_line_coverage(compute_linear_field(x, y), 3) : 0,
                     green = is_in ? compute_line_coverage(compute_linear_field(x, y), 1) : 0;
        const double code = 255 * (compute_linear_field(x, y) + 2) / 8, share = red + green;
        bool is_well = fabs((double)own[3] - (on_grey ? is_in : share)) < 1e-4;
        is_well = is_well && (share == 0 || on_grey || fabs((double)own[0] - red) < 1e-4);
        is_well = is_well && (share == 0 || on_grey || fabs((double)own[1] - green) < 1e-4);
        is_well = is_well && (share < 0.9999 || fabs((double)own[0] - red) < 1e-4);
        is_well = is_well && (share > 0 || !is_in || !on_grey || fabs(encode_srgb(own[2]) - code) <= 1);
        hits += share > 0;
        if (is_well) continue;
        fprintf(stderr, "pixel %d at (%g, %g): %g %g %g %g, expected %g of red, %g of green\n", pixel, x, y,
                (double)own[0], (double)own[1], (double)own[2], (double)own[3], red, green);
        return false;
    }
    return hits > 100;
}

/* Checks contour lines without other layers, over the surface of the plate, and with shadows, for which hits are shaded
 * in a later pass. Pictures must be the same on all ranks and on one rank. */
static void isosurfaces_are_contour_lines(void **state)
{
    (void)state;
    static const char *const scenes[] = {IMAGE("", LINES), IMAGE("", LINES ", " MAP_OF("f")),
                                         IMAGE("    shadows: true\n", MAP_OF("f") ", " LINES)};
    for (plate_kind kind = 0; kind < PLATE_KINDS; kind++)
        for (int i = 0; i < 3; i++) {
            plate part, whole;
            make_plate(kind, own_rank, rank_count, &part);
            make_plate(kind, 0, 1, &whole);
            const char *scene = write_scene(scenes[i]);
            caught_picture ours = draw_plate(MPI_COMM_WORLD, scene, &part, false), alone = {0};
            bool is_well = true;
            if (own_rank == 0) {
                alone = draw_plate(MPI_COMM_SELF, scene, &whole, true);
                is_well = check_contour_lines(&ours, i > 0) && are_same_pictures(&ours, &alone);
            }
            everywhere(is_well);
            free_caught(&ours);
            free_caught(&alone);
        }
}

/* Returns the fraction of the pixel that the strip around the hyperbola x y = level covers. It is counted over sample
 * points of the pixel; each point's distance from the curve is estimated along the field's gradient. */
static double compute_hyperbola_coverage(int pixel, double level)
{
    enum { POINTS = 16 };
    const double half = fmax(top / 2, right / 2 * HEIGHT / WIDTH) / 0.95, size = 2 * half / HEIGHT;
    int inside = 0;
    for (int i = 0; i < POINTS * POINTS; i++) {
        double x, y;
        compute_pixel_position(pixel, &x, &y);
        x += ((i % POINTS + 0.5) / POINTS - 0.5) * size;
        y += ((i / POINTS + 0.5) / POINTS - 0.5) * size;
        double px = x, py = y;
        for (int step = 0; step < 4; step++) {
            const double dx = py, dy = px, move = (px * py - level) / (dx * dx + dy * dy);
            px -= move * dx;
            py -= move * dy;
        }
        inside += hypot(px - x, py - y) <= 0.75 * size;
    }
    return (double)inside / (POINTS * POINTS);
}

/* Checks curved lines of the field x y, which quads represent exactly. A drawn line has a ramp of one pixel at its
 * borders in any direction. The root mean square error of its coverage must be within 0.02, and the total light within
 * a hundredth of width times length. */
static void coverage_of_curved_lines_matches_strips(void **state)
{
    (void)state;
    const char *scene = write_scene(IMAGE("", "{isosurface: {field: f, values: [1, 3]}}"));
    plate part;
    make_plate(QUADS, own_rank, rank_count, &part);
    for (int n = 0; n < MAX_VERTICES; n++) part.f[n] = part.xy[2 * n] * part.xy[2 * n + 1];
    caught_picture picture = draw_plate(MPI_COMM_WORLD, scene, &part, false);
    double squares = 0, drawn = 0, exact = 0;
    int count = 0;
    for (int pixel = 0; pixel < PIXELS && own_rank == 0; pixel++) {
        const double border = 0.1; /* more than two pixels wide */
        double x, y;
        compute_pixel_position(pixel, &x, &y);
        if (x < border || x > right - border || y < border || y > top - border) continue;
        const double is = (double)picture.rgba[4 * (ptrdiff_t)pixel + 3];
        const double share = compute_hyperbola_coverage(pixel, 1) + compute_hyperbola_coverage(pixel, 3);
        if (share == 0 && is == 0) continue;
        squares += (is - share) * (is - share);
        drawn += is;
        exact += share;
        count++;
    }
    const double rms = sqrt(squares / count);
    const bool is_well = own_rank != 0 || (count > 100 && rms < 0.02 && fabs(drawn / exact - 1) < 0.01);
    if (!is_well || getenv("TEST_LINES_SHOW"))
        fprintf(stderr, "%d pixels, %g rms, width %g\n", count, rms, drawn / exact);
    everywhere(is_well);
    free_caught(&picture);
}

static void lines_beyond_the_field_are_reported(void **state)
{
    (void)state;
    plate part;
    make_plate(TRIANGLES, own_rank, rank_count, &part);
    const char *scene = write_scene(IMAGE("", "{isosurface: {field: f, values: [1, 20]}}"));
    insitu_session *session = open_session_with_plate(MPI_COMM_WORLD, scene, &part, false);
    const char *warnings = insitu_last_report(session)->warnings;
    everywhere(strstr(warnings, "the isosurface of \"f\" at 20 is empty: the field goes from -2 to 6") &&
               !strstr(warnings, "at 1 is empty"));
    insitu_destroy(&session);
}

static void solid_cells_require_z_coordinates(void **state)
{
    (void)state;
    plate part;
    make_plate(QUADS, own_rank, rank_count, &part);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(IMAGE("", MAP_OF("f"))));
    insitu_mesh mesh = describe_plate(&part, false);
    mesh.cell_type = INSITU_TET; /* tets have as many vertices as quads */
    assert_int_equal(insitu_set_mesh(session, "plate", &mesh), INSITU_ERROR_MESH);
    everywhere(strstr(insitu_error(session), "z coordinates are not given") != NULL);
    mesh = describe_plate(&part, false);
    mesh.coordinates[1].data = NULL;
    assert_int_equal(insitu_set_mesh(session, "plate", &mesh), INSITU_ERROR_MESH);
    everywhere(strstr(insitu_error(session), "y coordinates are not given") != NULL);
    insitu_destroy(&session);
}

/* ---- colour bars ---------------------------------------------------------------------------------------------- */

#define BARS(keys)                                                                                                     \
    "images:\n  - name: a\n    size: [120, 50]\n    layers:\n" SURFACE_OF("field: v")                                  \
        SURFACE_OF("field: v, component: x") SURFACE_OF("field: f")                                                    \
            SURFACE_OF("field: f, component: magnitude, map: magma") "    decorations: {colour_bar: " keys             \
                                                                     "}\n    outputs: [{path: a.png}]\n"
#define SURFACE_OF(keys) "      - surface: {colour_by: {" keys ", range: [0, 1]}}\n"

static void colour_bars_state_the_field_and_range(void **state)
{
    (void)state;
    static const struct {
        const char *scene, *bars;
    } cases[] = {{BARS("{ticks: 3}"), "|v|: 0 0.5 1.0\nv x: 0 0.5 1.0\nf: 0 0.5 1.0\n|f|: 0 0.5 1.0\n"},
                 {BARS("{ticks: 3, units: m/s, digits: 2, notation: fixed}"),
                  "|v| [m/s]: 0 0.50 1.00\nv x [m/s]: 0 0.50 1.00\nf [m/s]: 0 0.50 1.00\n|f| [m/s]: 0 0.50 1.00\n"},
                 {BARS("{ticks: 3, units: [m/s, K], labels: [speed], notation: scientific}"),
                  "speed [m/s]: 0 5.0e-1 1.0e0\nv x [K]: 0 5.0e-1 1.0e0\nf: 0 5.0e-1 1.0e0\n|f|: 0 5.0e-1 1.0e0\n"}};
    plate part;
    make_plate(QUADS, own_rank, rank_count, &part);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        caught_picture picture = draw_plate(MPI_COMM_WORLD, write_scene(cases[i].scene), &part, false);
        const bool is_well = own_rank != 0 || strcmp(picture.bars, cases[i].bars) == 0;
        if (!is_well) fprintf(stderr, "%sexpected\n%s", picture.bars, cases[i].bars);
        everywhere(is_well);
        free_caught(&picture);
    }
}

#define BAR_UP_TO(high) "      - surface: {colour_by: {field: f, range: [0, " high "]}}\n"

/* The texts of the second bar are shorter than those of the first. */
static void equal_colour_bars_are_drawn_once(void **state)
{
    (void)state;
    const char *scene =
        "images:\n  - name: a\n    size: [120, 50]\n    layers:\n" BAR_UP_TO("0.00125") BAR_UP_TO("0.00125")
            BAR_UP_TO("1") BAR_UP_TO("1") "    decorations: {colour_bar: {ticks: 3}}\n    outputs: [{path: a.png}]\n";
    plate part;
    make_plate(QUADS, own_rank, rank_count, &part);
    caught_picture picture = draw_plate(MPI_COMM_WORLD, write_scene(scene), &part, false);
    const char *second = own_rank == 0 ? strchr(picture.bars, '\n') : NULL;
    everywhere(own_rank != 0 || (second && strcmp(second, "\nf: 0 0.5 1.0\n") == 0));
    free_caught(&picture);
}

/* ---- statistics ----------------------------------------------------------------------------------------------- */

enum { MOST = 1 << 12 };

/* Returns a number in the second line of a table; columns are counted from 0. */
static double read_number(const char *text, int column)
{
    const char *at = strchr(text, '\n');
    for (; column > 0 && at; column--) at = strchr(at + 1, ',');
    return at ? strtod(at + 1, NULL) : NAN;
}

static bool is_nearly_equal(double a, double b)
{
    if (fabs(a - b) <= 1e-8 * fmax(1, fabs(b))) return true; /* numbers are written with nine digits */
    fprintf(stderr, "%.9g, expected %.9g\n", a, b);
    return false;
}

/* Returns whether the statistics are those of the linear field: its mean is the value at the plate's centre, and its
 * extremes are at corners. */
static bool check_plate_statistics(const char *text, plate_kind kind)
{
    enum { CELLS = 2, AREA, LEAST, GREATEST, MEAN };
    return strncmp(text, "cycle,time,cells,area,minimum,", 30) == 0 &&
           read_number(text, CELLS) == (kind == TRIANGLES ? 2 : 1) * NX * NY &&
           is_nearly_equal(read_number(text, AREA), 6) &&
           is_nearly_equal(read_number(text, LEAST), compute_linear_field(0, top)) &&
           is_nearly_equal(read_number(text, GREATEST), compute_linear_field(right, 0)) &&
           is_nearly_equal(read_number(text, MEAN), compute_linear_field(right / 2, top / 2));
}

static void statistics_weigh_shells_by_area(void **state)
{
    (void)state;
    static char text[MOST], alone[MOST];
    for (plate_kind kind = 0; kind < PLATE_KINDS; kind++) {
        plate part, whole;
        make_plate(kind, own_rank, rank_count, &part);
        make_plate(kind, 0, 1, &whole);
        if (own_rank == 0) unlink("parts.csv"), unlink("whole.csv");
        insitu_session *session = open_session_with_plate(
            MPI_COMM_WORLD, write_scene(NEVER "statistics: [{field: f, path: parts.csv}]\n"), &part, false);
        insitu_destroy(&session);
        const char *scene = write_scene(NEVER "statistics: [{field: f, path: whole.csv}]\n");
        if (own_rank == 0) {
            session = open_session_with_plate(MPI_COMM_SELF, scene, &whole, true);
            insitu_destroy(&session);
        }
        read_file("parts.csv", MOST, text);
        read_file("whole.csv", MOST, alone);
        everywhere(own_rank != 0 || (check_plate_statistics(text, kind) && strcmp(text, alone) == 0));
    }
}

/* Returns the width of a column of quads. The last column is seven times as wide as each of the others. */
static double compute_column_width(int i)
{
    return i == NX - 1 ? 1.75 : 0.25;
}

/* Makes the plate's last column wider and the others narrower, so that the plate's bounds stay the same. */
static void widen_column(plate *p)
{
    for (int n = 0; n < MAX_VERTICES; n++) {
        const int i = n % (NX + 1);
        p->xy[2 * n] = i == NX ? right : compute_column_width(0) * i;
        p->f[n] = compute_linear_field(p->xy[2 * n], p->xy[2 * n + 1]);
    }
}

/* Checks conditions on means. The mean weighted by area is 2; an unweighted mean over cells would differ, because one
 * column is wider. */
static void conditions_weigh_shells_by_area(void **state)
{
    (void)state;
    static const struct {
        const char *when;
        int images;
    } cases[] = {{IMAGE("    when: {field: f, of: mean, above: 1.99, below: 2.01}\n", MAP_OF("f")), 1},
                 {IMAGE("    when: {field: f, of: mean, above: 2.01}\n", MAP_OF("f")), 0},
                 {IMAGE("    when: {field: f, of: maximum, above: 5.9}\n", MAP_OF("f")), 1}};
    plate part;
    make_plate(QUADS, own_rank, rank_count, &part);
    widen_column(&part);
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        insitu_session *session = open_session_with_plate(MPI_COMM_WORLD, write_scene(cases[k].when), &part, false);
        everywhere(insitu_last_report(session)->images == cases[k].images);
        insitu_destroy(&session);
    }
}

/* Returns the least value such that squares with at most this value cover the given percentage of the plate's area. */
static int compute_percentile_by_area(double percent)
{
    enum { LEAST = -1, GREATEST = 5 };
    for (int value = LEAST; value < GREATEST; value++) {
        double area = 0;
        for (int n = 0; n < NX * NY; n++)
            if (compute_square_value(n % NX, n / NX) <= value) area += compute_column_width(n % NX) * top / NY;
        if (area >= percent / 100 * right * top) return value;
    }
    return GREATEST;
}

/* Checks percentiles. None of the tested percentages is exactly the area of whole squares, so that rounding cannot
 * change the result. */
static void percentiles_weigh_shells_by_area(void **state)
{
    (void)state;
    static const int percents[][2] = {{10, 90}, {37, 60}};
    for (plate_kind kind = 0; kind < PLATE_KINDS; kind++)
        for (int i = 0; i < 2; i++) {
            char by_area[600], fixed[600];
            const int *p = percents[i];
            snprintf(by_area, sizeof by_area,
                     IMAGE("", "{surface: {colour_by: {field: c, range: {percentile: [%d, %d]}}}}"), p[0], p[1]);
            snprintf(fixed, sizeof fixed, IMAGE("", "{surface: {colour_by: {field: c, range: [%d, %d]}}}"),
                     compute_percentile_by_area(p[0]), compute_percentile_by_area(p[1]));
            plate part;
            make_plate(kind, own_rank, rank_count, &part);
            widen_column(&part);
            caught_picture found = draw_plate(MPI_COMM_WORLD, write_scene(by_area), &part, false);
            caught_picture truth = draw_plate(MPI_COMM_WORLD, write_scene(fixed), &part, false);
            everywhere(own_rank != 0 || are_same_pictures(&found, &truth));
            free_caught(&found);
            free_caught(&truth);
        }
}

/* Sets a tet with the values 0 to 3 and an adjacent triangle with larger values, on the last rank. */
static void set_tet_and_triangle(insitu_session *session)
{
    static const double places[3][5] = {{0, 1, 0, 0, 3}, {0, 0, 1, 0, 3}, {0, 0, 0, 1, 0}};
    static const double values[5] = {0, 1, 2, 3, 100};
    static const int connectivity[7] = {0, 1, 2, 3, 1, 2, 4}, offsets[3] = {0, 4, 7};
    static const unsigned char types[2] = {INSITU_TET, INSITU_TRIANGLE};
    insitu_mesh mesh;
    insitu_mesh_defaults(&mesh);
    const bool has_cells = own_rank == rank_count - 1;
    mesh.vertex_count = has_cells ? 5 : 0;
    for (int axis = 0; axis < 3; axis++) mesh.coordinates[axis] = (insitu_array){places[axis], INSITU_FLOAT64, 0};
    mesh.cell_count = has_cells ? 2 : 0;
    mesh.cell_types = (insitu_array){types, INSITU_UINT8, 0};
    mesh.connectivity_count = has_cells ? 7 : 0;
    mesh.connectivity = (insitu_array){connectivity, INSITU_INT32, 0};
    mesh.offsets = (insitu_array){offsets, INSITU_INT32, 0};
    assert_int_equal(insitu_set_mesh(session, "plate", &mesh), INSITU_OK);
    set_field(session, "f", INSITU_VERTEX, mesh.vertex_count, 1, values);
}

/* Checks that shells are ignored in meshes that also have cells with a volume: the statistics are those of the tet,
 * without the triangle. */
static void shells_beside_solids_do_not_count(void **state)
{
    (void)state;
    static const char scene[] = "images:\n  - name: a\n    size: [120, 50]\n    layers:\n"
                                "      - surface: {colour_by: {field: f, range: {percentile: [0, 100]}}}\n"
                                "    decorations: {colour_bar: true}\n    outputs: [{path: a.png}]\n"
                                "statistics: [{field: f, path: mixed.csv}]\n";
    static char text[MOST];
    if (own_rank == 0) unlink("mixed.csv");
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    discard_pictures();
    set_tet_and_triangle(session);
    const insitu_status status = insitu_step(session, 0, 0);
    everywhere(status == INSITU_OK);
    insitu_destroy(&session);
    read_file("mixed.csv", MOST, text);
    everywhere(own_rank != 0 || (strstr(text, ",volume,") && read_number(text, 2) == 1 &&
                                 is_nearly_equal(read_number(text, 3), 1.0 / 6) && read_number(text, 5) == 3 &&
                                 is_nearly_equal(read_number(text, 6), 1.5)));
    caught_picture picture = pop_caught_picture();
    const bool is_of_tet = own_rank != 0 || strcmp(picture.bars, "f: 1.5\n") == 0;
    if (!is_of_tet) fprintf(stderr, "%s", picture.bars);
    everywhere(is_of_tet);
    free_caught(&picture);
}

/* ---- main ------------------------------------------------------------------------------------------------------ */

static int set_up_test_group(void **state)
{
    (void)state;
    return enter_test_folder("plane") ? 0 : 1;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(pictures_are_the_colour_map_of_the_field),
                                       cmocka_unit_test(scene_keys_override_defaults),
                                       cmocka_unit_test(layers_that_show_nothing_are_reported),
                                       cmocka_unit_test(isosurfaces_are_contour_lines),
                                       cmocka_unit_test(coverage_of_curved_lines_matches_strips),
                                       cmocka_unit_test(lines_beyond_the_field_are_reported),
                                       cmocka_unit_test(colour_bars_state_the_field_and_range),
                                       cmocka_unit_test(equal_colour_bars_are_drawn_once),
                                       cmocka_unit_test(solid_cells_require_z_coordinates),
                                       cmocka_unit_test(statistics_weigh_shells_by_area),
                                       cmocka_unit_test(conditions_weigh_shells_by_area),
                                       cmocka_unit_test(percentiles_weigh_shells_by_area),
                                       cmocka_unit_test(shells_beside_solids_do_not_count)};
    return run_session_tests(argc, argv, tests, set_up_test_group, NULL);
}
