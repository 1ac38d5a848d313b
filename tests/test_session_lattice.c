/* Checks structured blocks. Pictures, statistics and counts of a lattice must be bit-identical to those of the same
 * cells passed as hexes: for uniform, rectilinear and curvilinear coordinates, for arrays in any order with padding,
 * for ghost layers and for blanked cells. The padding contains values that are not finite, so that a picture would have
 * holes if they were used. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_session_fixture.h"

typedef enum place_form { UNIFORM, RECTILINEAR, RECTILINEAR_FLOAT, CURVILINEAR, CURVILINEAR_FLOAT, FORMS } place_form;
typedef enum array_order { PACKED, FORTRAN_PADDED, C_PADDED, ORDERS } array_order;

/* Numbers of cells along the axes of the whole lattice. Ranks have parts of its layers along k. */
static const int64_t whole[3] = {9, 7, 12};
static const double origin[3] = {0.1, -0.3, 1.7}, spacing[3] = {0.1, 0.07, 0.13};

static const char *const images[] = {
    "[{isosurface: {field: f, values: [0.9], colour_by: {field: c}}}]",
    "[{slice: {planes: [{normal: [1, 2, 3]}], field: f}}]",
    "[{surface: {colour_by: {field: f}, opacity: 0.5, edges: {}}}]",
    "[{volume: {field: f, opacity: [[0, 0], [1, 0.9]]}}]",
    "[{volume: {field: c, opacity: [[0, 0.2], [1, 0.9]]}}]",
    "[{isosurface: {field: c, values: [0.4], normals: vertex}}]",
    "[{surface: {colour_by: {field: c}, threshold: {field: f, from: 0.2}}}]",
    ("[{isosurface: {field: f, values: [0.9]}}, {slice: {planes: [{normal: [1, 2, 3]}], field: f}}], "
     "lights: [{direction: [2, 1, 1]}], shadows: true, ambient_occlusion: {samples: 4, radius: 0.2}"),
};
enum { IMAGES = sizeof images / sizeof images[0] };

/* A rank's block of the lattice. Indices are those of the whole lattice unless stated otherwise. */
typedef struct block {
    place_form form;
    int64_t first[3], cells[3];       /* first cell and number of cells, with ghost layers */
    int64_t own_first[3], own_end[3]; /* range of the cells without ghost layers, as indices in the block */
    int64_t vertex_strides[3], cell_strides[3], vertex_count, cell_count;
    double *places[3];
    float *narrow[3];
    double *axes[3], *f, *c;
    float *narrow_axes[3];
    unsigned char *ghosts;
    int32_t *wide_ghosts; /* ghost flags of 4 bytes; the lowest byte of nonzero flags is 0 */
    int64_t hex_count, *hexes;
    int64_t *hex_cells; /* index in the block of each hex's cell */
    double *hex_values;
    insitu_lattice lattice;
} block;

static double compute_axis_coordinate(place_form form, int axis, int64_t index)
{
    const double uniform = origin[axis] + spacing[axis] * (double)index;
    if (form == UNIFORM) return uniform;
    const double bent = uniform + 0.004 * (double)(index * index % 17);
    return form == RECTILINEAR_FLOAT ? (double)(float)bent : bent;
}

static void compute_position(place_form form, const int64_t index[3], double out[3])
{
    for (int axis = 0; axis < 3; axis++) out[axis] = compute_axis_coordinate(form, axis, index[axis]);
    if (form != CURVILINEAR && form != CURVILINEAR_FLOAT) return;
    const double x = out[0], y = out[1], z = out[2];
    out[0] = x + 0.05 * sin(3 * y + z);
    out[1] = y + 0.04 * sin(4 * z);
    out[2] = z + 0.05 * sin(5 * x + 2 * y);
    for (int axis = 0; axis < 3 && form == CURVILINEAR_FLOAT; axis++) out[axis] = (double)(float)out[axis];
}

static void set_strides(array_order order, const int64_t counts[3], int64_t strides[3], int64_t *length)
{
    const int64_t pad = order == PACKED ? 0 : 2;
    int64_t reach = 1;
    for (int n = 0; n < 3; n++) {
        const int axis = order == C_PADDED ? 2 - n : n;
        strides[axis] = reach;
        reach *= counts[axis] + pad + (pad ? n : 0);
    }
    *length = reach;
}

static void *allocate_zeroed(int64_t count, size_t size)
{
    void *out = calloc((size_t)count + 1, size);
    assert_non_null(out);
    return out;
}

static int64_t compute_strided_index(const int64_t strides[3], int64_t i, int64_t j, int64_t k)
{
    return i * strides[0] + j * strides[1] + k * strides[2];
}

static void fill_vertices(block *b)
{
    for (int64_t v = 0; v < b->vertex_count; v++) b->f[v] = (double)NAN;
    for (int axis = 0; axis < 3; axis++)
        for (int64_t v = 0; v < b->vertex_count; v++) b->places[axis][v] = (double)INFINITY;
    for (int64_t k = 0; k <= b->cells[2]; k++)
        for (int64_t j = 0; j <= b->cells[1]; j++)
            for (int64_t i = 0; i <= b->cells[0]; i++) {
                const int64_t at[3] = {b->first[0] + i, b->first[1] + j, b->first[2] + k};
                const int64_t v = compute_strided_index(b->vertex_strides, i, j, k);
                double place[3];
                compute_position(b->form, at, place);
                for (int axis = 0; axis < 3; axis++) {
                    b->places[axis][v] = place[axis];
                    b->narrow[axis][v] = (float)place[axis];
                }
                b->f[v] = 0.5 + 0.5 * sin(0.7 * (double)at[0]) * cos(0.5 * (double)at[1] + 0.4 * (double)at[2]);
            }
    for (int axis = 0; axis < 3; axis++)
        for (int64_t n = 0; n <= b->cells[axis]; n++) {
            b->axes[axis][n] = compute_axis_coordinate(b->form, axis, b->first[axis] + n);
            b->narrow_axes[axis][n] = (float)b->axes[axis][n];
        }
}

static bool is_own_cell(const block *b, const int64_t at[3])
{
    for (int axis = 0; axis < 3; axis++)
        if (at[axis] < b->own_first[axis] || at[axis] >= b->own_end[axis]) return false;
    return true;
}

static bool is_blanked(const int64_t at[3])
{
    return (at[0] * 5 + at[1] * 3 + at[2]) % 11 == 0;
}

static void add_hex(block *b, int64_t i, int64_t j, int64_t k)
{
    static const int corner[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                     {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
    for (int n = 0; n < 8; n++)
        b->hexes[8 * b->hex_count + n] =
            compute_strided_index(b->vertex_strides, i + corner[n][0], j + corner[n][1], k + corner[n][2]);
    b->hex_values[b->hex_count++] = b->c[compute_strided_index(b->cell_strides, i, j, k)];
}

static void fill_cells(block *b, bool blanking)
{
    for (int64_t c = 0; c < b->cell_count; c++) b->c[c] = (double)NAN;
    for (int64_t k = 0; k < b->cells[2]; k++)
        for (int64_t j = 0; j < b->cells[1]; j++)
            for (int64_t i = 0; i < b->cells[0]; i++) {
                const int64_t own[3] = {i, j, k}, c = compute_strided_index(b->cell_strides, i, j, k);
                const int64_t at[3] = {b->first[0] + i, b->first[1] + j, b->first[2] + k};
                b->c[c] = 0.5 + 0.5 * cos(0.9 * (double)at[0] + 0.3 * (double)(at[1] * at[2]));
                b->ghosts[c] = blanking && is_blanked(at);
                if (is_own_cell(b, own) && !b->ghosts[c]) add_hex(b, i, j, k);
            }
}

/* Makes the rank's block from its share of the layers along k. There may be more ranks than layers. */
static void make_block(block *b, place_form form, array_order order, bool layers, bool blanking)
{
    int64_t vertices[3];
    *b = (block){.form = form};
    for (int axis = 0; axis < 3; axis++) {
        const int64_t first = axis < 2 ? 0 : whole[2] * own_rank / rank_count;
        const int64_t end = axis < 2 ? whole[axis] : whole[2] * (own_rank + 1) / rank_count;
        const int64_t low = layers ? 1 : 0, high = layers ? 2 : 0; /* ghost layers extend beyond the domain too */
        b->first[axis] = first - low;
        b->cells[axis] = end - first + low + high;
        b->own_first[axis] = low;
        b->own_end[axis] = low + end - first;
        vertices[axis] = b->cells[axis] + 1;
    }
    set_strides(order, vertices, b->vertex_strides, &b->vertex_count);
    set_strides(order, b->cells, b->cell_strides, &b->cell_count);
    for (int axis = 0; axis < 3; axis++) {
        b->places[axis] = allocate_zeroed(b->vertex_count, sizeof(double));
        b->narrow[axis] = allocate_zeroed(b->vertex_count, sizeof(float));
        b->axes[axis] = allocate_zeroed(b->cells[axis] + 1, sizeof(double));
        b->narrow_axes[axis] = allocate_zeroed(b->cells[axis] + 1, sizeof(float));
    }
    b->f = allocate_zeroed(b->vertex_count, sizeof(double));
    b->c = allocate_zeroed(b->cell_count, sizeof(double));
    b->ghosts = allocate_zeroed(b->cell_count, 1);
    b->wide_ghosts = allocate_zeroed(b->cell_count, sizeof(int32_t));
    b->hexes = allocate_zeroed(8 * b->cell_count, sizeof(int64_t));
    b->hex_values = allocate_zeroed(b->cell_count, sizeof(double));
    fill_vertices(b);
    fill_cells(b, blanking);
    for (int64_t cell = 0; cell < b->cell_count; cell++)
        b->wide_ghosts[cell] = b->ghosts[cell] ? 0x100 << cell % 23 : 0;
    for (int axis = 0; axis < 3; axis++) {
        b->lattice.cells[axis] = b->cells[axis];
        if (order != PACKED) b->lattice.vertex_strides[axis] = b->vertex_strides[axis];
        if (order != PACKED) b->lattice.cell_strides[axis] = b->cell_strides[axis];
        if (layers) b->lattice.interior_first[axis] = b->own_first[axis];
        if (layers) b->lattice.interior_end[axis] = b->own_end[axis];
        if (form == UNIFORM) {
            b->lattice.origin[axis] = origin[axis];
            b->lattice.spacing[axis] = spacing[axis];
            b->lattice.first[axis] = b->first[axis];
        } else if (form == RECTILINEAR) {
            b->lattice.axes[axis] = (insitu_array){b->axes[axis], INSITU_FLOAT64, 0};
        } else if (form == RECTILINEAR_FLOAT) {
            b->lattice.axes[axis] = (insitu_array){b->narrow_axes[axis], INSITU_FLOAT32, 0};
        }
    }
}

static void free_block(block *b)
{
    for (int axis = 0; axis < 3; axis++) {
        free(b->places[axis]);
        free(b->narrow[axis]);
        free(b->axes[axis]);
        free(b->narrow_axes[axis]);
    }
    free(b->f);
    free(b->c);
    free(b->ghosts);
    free(b->wide_ghosts);
    free(b->hexes);
    free(b->hex_values);
}

static void set_positions(const block *b, insitu_mesh *mesh)
{
    const bool is_float = b->form == CURVILINEAR_FLOAT;
    for (int axis = 0; axis < 3; axis++)
        mesh->coordinates[axis] = is_float ? (insitu_array){b->narrow[axis], INSITU_FLOAT32, 0}
                                           : (insitu_array){b->places[axis], INSITU_FLOAT64, 0};
}

static bool set_fields(insitu_session *session, const block *b, const double *cells, int64_t cell_count)
{
    insitu_field field;
    insitu_field_defaults(&field);
    field.name = "f";
    field.count = b->vertex_count;
    field.values = (insitu_array){b->f, INSITU_FLOAT64, 0};
    if (insitu_set_field(session, "m", &field)) return false;
    field.name = "c";
    field.centring = INSITU_CELL;
    field.count = cell_count;
    field.values = (insitu_array){cells, INSITU_FLOAT64, 0};
    return insitu_set_field(session, "m", &field) == INSITU_OK;
}

static bool set_lattice(insitu_session *session, const block *b, bool blanking)
{
    insitu_mesh mesh;
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = b->vertex_count;
    mesh.cell_count = b->cell_count;
    mesh.lattice = &b->lattice;
    if (b->form >= CURVILINEAR) set_positions(b, &mesh);
    if (blanking)
        mesh.ghosts =
            b->form % 2 ? (insitu_array){b->wide_ghosts, INSITU_INT32, 0} : (insitu_array){b->ghosts, INSITU_UINT8, 0};
    return insitu_set_mesh(session, "m", &mesh) == INSITU_OK && set_fields(session, b, b->c, b->cell_count);
}

static bool set_hexes(insitu_session *session, const block *b)
{
    insitu_mesh mesh;
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = b->vertex_count;
    mesh.cell_type = INSITU_HEX;
    mesh.cell_count = b->hex_count;
    mesh.connectivity_count = 8 * b->hex_count;
    mesh.connectivity = (insitu_array){b->hexes, INSITU_INT64, 0};
    set_positions(b, &mesh);
    return insitu_set_mesh(session, "m", &mesh) == INSITU_OK && set_fields(session, b, b->hex_values, b->hex_count);
}

/* Returns a scene with the first `count` images. `count` decides which cells the trees contain, namely those that these
 * images show. */
static const char *make_scene_of_images(int count)
{
    static char text[4096];
    int at = snprintf(text, sizeof text, "statistics:\n  - {field: c, path: numbers.csv}\nimages:\n");
    for (int i = 0; i < count; i++)
        at += snprintf(text + at, sizeof text - (size_t)at,
                       "  - {name: a%d, size: [40, 30], layers: %s, outputs: [{path: a%d.exr}]}\n", i, images[i], i);
    return write_scene(text);
}

static bool is_same(const caught_picture *a, const caught_picture *b)
{
    const size_t pixels = (size_t)a->width * (size_t)a->height;
    if (a->width != b->width || a->height != b->height || !a->depth != !b->depth) return false;
    if (memcmp(a->rgba, b->rgba, 4 * pixels * sizeof(float))) return false;
    return !a->depth || memcmp(a->depth, b->depth, pixels * sizeof(float)) == 0;
}

/* Returns the number of bytes that the library copies for a lattice: a double for each index along each axis, or
 * nothing if each vertex has coordinates. */
static int64_t compute_copied_axis_bytes(const block *b)
{
    int64_t bytes = 0;
    for (int axis = 0; axis < 3 && b->form < CURVILINEAR; axis++)
        bytes += (b->cells[axis] + 1) * (int64_t)sizeof(double);
    return bytes;
}

/* Compares the pictures, reports and statistics of the hexes, which are drawn first, with those of the lattice. */
static void compare_with_hexes(place_form form, array_order order, bool layers, bool blanking, int count)
{
    block b;
    insitu_report reports[2];
    char statistics[2][4096] = {"", ""}, left_out[2][512];
    make_block(&b, form, order, layers, blanking);
    discard_pictures();
    for (int lattice = 0; lattice < 2; lattice++) {
        if (!own_rank) remove("numbers.csv");
        insitu_session *session = open_session(MPI_COMM_WORLD, make_scene_of_images(count));
        everywhere(lattice ? set_lattice(session, &b, blanking) : set_hexes(session, &b));
        const insitu_status status = insitu_step(session, 0, 0);
        if (status) fprintf(stderr, "%s\n", insitu_error(session));
        everywhere(status == INSITU_OK);
        reports[lattice] = *insitu_last_report(session);
        snprintf(left_out[lattice], sizeof left_out[lattice], "%s", reports[lattice].left_out);
        insitu_destroy(&session);
        read_file("numbers.csv", sizeof statistics[lattice], statistics[lattice]);
    }
    everywhere(own_rank || caught_count == 2 * count);
    for (int i = 0; i < count && !own_rank; i++) {
        if (!is_same(&caught[i], &caught[count + i]))
            fprintf(stderr, "form %d, order %d, layers %d, blanking %d: %s\n", form, order, layers, blanking,
                    images[i]);
        assert_true(count_visible_pixels(&caught[i]) > 50);
        assert_true(is_same(&caught[i], &caught[count + i]));
    }
    everywhere(strcmp(statistics[0], statistics[1]) == 0);
    everywhere(strcmp(left_out[0], left_out[1]) == 0); /* messages with the number of cells that trees leave out */
    everywhere(count > 1 || strstr(left_out[1], "cells show nothing"));
    /* the first image shows the values as they are passed, so that no bytes are allocated per cell or vertex */
    everywhere(count > 1 || reports[1].bytes_copied == compute_copied_axis_bytes(&b));
    const int64_t own =
        (b.own_end[0] - b.own_first[0]) * (b.own_end[1] - b.own_first[1]) * (b.own_end[2] - b.own_first[2]);
    everywhere(reports[1].cells == b.cells[0] * b.cells[1] * b.cells[2]);
    everywhere(reports[1].cells - reports[1].cells_ghost == b.hex_count);
    everywhere(blanking || reports[1].cells_ghost == reports[1].cells - own);
    free_block(&b);
}

static void lattices_draw_same_picture_as_hexes(void **state)
{
    (void)state;
    for (int form = 0; form < FORMS; form++)
        for (int order = 0; order < ORDERS; order++)
            for (int count = 1; count <= IMAGES; count += IMAGES - 1)
                compare_with_hexes((place_form)form, (array_order)order, (form + order) % 2, (form + order) % 3 == 0,
                                   count);
}

/* ---- quads ------------------------------------------------------------------------------------------------------ */

enum { SHEET = 6 };

/* Draws a sheet, which has no cells along the axis `flat`: as a lattice or as quads, uniform or with coordinates of its
 * vertices. Arrays are packed, with i fastest. */
static caught_picture draw_sheet(int flat, bool is_lattice, bool is_uniform)
{
    static const char scene[] =
        "images: [{name: s, size: [40, 30], layers: [{surface: {colour_by: {field: f}, edges: {}, "
        "material: {}}}], camera: {automatic: {direction: [1, 2, 3]}}, outputs: [{path: s.exr}]}]\n";
    enum { VERTICES = (SHEET + 1) * (SHEET + 1), CELLS = SHEET * SHEET };
    double places[VERTICES][3], values[VERTICES];
    int quads[CELLS][4], cell = 0;
    const int a = flat == 0, b = flat == 2 ? 1 : 2; /* the axes that have cells */
    for (int v = 0; v < VERTICES; v++) {
        const int at[2] = {v % (SHEET + 1), v / (SHEET + 1)};
        places[v][flat] = is_uniform ? 0.5 + 0.25 * 3 : 0.3 * sin(at[0] + 0.5 * at[1]);
        places[v][a] = 0.5 + 0.25 * (3 + at[0]) + (is_uniform ? 0 : 0.05 * sin(at[1]));
        places[v][b] = 0.5 + 0.25 * (3 + at[1]);
        values[v] = sin(at[0]) * cos(0.7 * at[1]);
    }
    for (int j = 0; j < SHEET; j++)
        for (int i = 0; i < SHEET; i++, cell++) {
            const int v = i + j * (SHEET + 1);
            const int corners[4] = {v, v + 1, v + SHEET + 2, v + SHEET + 1};
            memcpy(quads[cell], corners, sizeof corners);
        }
    insitu_lattice lattice = {.cells = {SHEET, SHEET, SHEET}, .first = {3, 3, 3}};
    lattice.cells[flat] = 0;
    for (int axis = 0; axis < 3 && is_uniform; axis++) lattice.origin[axis] = 0.5, lattice.spacing[axis] = 0.25;
    insitu_mesh mesh;
    insitu_field field;
    insitu_mesh_defaults(&mesh);
    insitu_field_defaults(&field);
    mesh.vertex_count = own_rank ? 0 : VERTICES;
    mesh.cell_count = own_rank ? 0 : CELLS;
    if (!is_lattice || !is_uniform) insitu_mesh_interleaved(&mesh, places, INSITU_FLOAT64);
    if (is_lattice && !own_rank) mesh.lattice = &lattice;
    mesh.cell_type = INSITU_QUAD;
    if (!is_lattice || own_rank) {
        mesh.connectivity_count = 4 * mesh.cell_count;
        mesh.connectivity = (insitu_array){quads, INSITU_INT32, 0};
    }
    field.name = "f";
    field.count = mesh.vertex_count;
    field.values = (insitu_array){values, INSITU_FLOAT64, 0};
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    everywhere(insitu_set_mesh(session, "m", &mesh) == INSITU_OK &&
               insitu_set_field(session, "m", &field) == INSITU_OK);
    everywhere(insitu_step(session, 0, 0) == INSITU_OK);
    insitu_destroy(&session);
    return pop_caught_picture();
}

static void flat_lattices_draw_same_picture_as_quads(void **state)
{
    (void)state;
    for (int flat = 0; flat < 3; flat++)
        for (int is_uniform = 0; is_uniform < 2; is_uniform++) {
            discard_pictures();
            caught_picture quads = draw_sheet(flat, false, is_uniform), lattice = draw_sheet(flat, true, is_uniform);
            everywhere(own_rank || (is_same(&quads, &lattice) && count_visible_pixels(&quads) > 50));
            free_caught(&quads);
            free_caught(&lattice);
        }
}

/* Checks that a cube whose three axes all point in negative directions causes no warning, although all its cells are
 * left-handed. */
static void left_handed_blocks_give_no_warning(void **state)
{
    (void)state;
    enum { SIDE = 4, VERTICES = (SIDE + 1) * (SIDE + 1) * (SIDE + 1) };
    const insitu_lattice lattice = {.cells = {SIDE, SIDE, SIDE}, .spacing = {-1, -1, -1}};
    double values[VERTICES];
    insitu_mesh mesh;
    insitu_field field;
    insitu_mesh_defaults(&mesh);
    insitu_field_defaults(&field);
    for (int v = 0; v < VERTICES; v++) values[v] = v;
    mesh.vertex_count = VERTICES;
    mesh.cell_count = SIDE * SIDE * SIDE;
    mesh.lattice = &lattice;
    field.name = "f";
    field.count = VERTICES;
    field.values = (insitu_array){values, INSITU_FLOAT64, 0};
    insitu_session *session = open_session(
        MPI_COMM_WORLD, write_scene("images: [{name: s, size: [40, 30], layers: [{surface: {colour_by: f}}], "
                                    "outputs: [{path: s.exr}]}]\n"));
    if (!own_rank) assert_int_equal(insitu_set_mesh(session, "m", &mesh), INSITU_OK);
    if (!own_rank) assert_int_equal(insitu_set_field(session, "m", &field), INSITU_OK);
    everywhere(insitu_step(session, 0, 0) == INSITU_OK);
    assert_string_equal(insitu_last_report(session)->warnings, "");
    insitu_destroy(&session);
    discard_pictures();
}

static int set_up_test_group(void **state)
{
    (void)state;
    return enter_test_folder("lattice") ? 0 : 1;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(lattices_draw_same_picture_as_hexes),
                                       cmocka_unit_test(flat_lattices_draw_same_picture_as_quads),
                                       cmocka_unit_test(left_handed_blocks_give_no_warning)};
    return run_session_tests(argc, argv, tests, set_up_test_group, NULL);
}
