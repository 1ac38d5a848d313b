/* Checks montages, which put pictures side by side, and insets, which put pictures over the corners of a montage. On
 * any number of ranks, each picture in a montage must be bit-identical to the same picture in a file of its own. */
#include <stdio.h>
#include <string.h>

#include "test_session_fixture.h"

enum { SIDE = 3, WIDTH = 32, HEIGHT = 24, COLUMNS = 3, ROWS = 2 };

static const char scene[] = "images:\n"
                            "  - name: a\n    size: [32, 24]\n"
                            "    layers: [{isosurface: {field: f, values: [0.1]}}]\n"
                            "    outputs: [{path: \"all_{cycle}.png\", grid: [3, 2]}, {path: a.png}]\n"
                            "  - name: b\n    size: [32, 24]\n    camera: {orbit: {views: 2}}\n"
                            "    layers: [{surface: {}}]\n"
                            "    outputs: [{path: \"b{view}.png\"}, {path: \"all_{cycle}.png\", grid: [3, 2]}]\n"
                            "  - name: c\n    size: [32, 24]\n    every: 2\n"
                            "    layers: [{slice: {field: f}}]\n"
                            "    outputs: [{path: c.png}, {path: \"all_{cycle}.png\", grid: [3, 2]}]\n";

static const caught_picture *find_picture(const char *path)
{
    for (int i = 0; i < caught_count; i++)
        if (strcmp(caught[i].path, path) == 0) return &caught[i];
    return NULL;
}

/* Returns whether a cell of the montage has exactly the pixels of the picture or, if picture is NULL, is
 * transparent. */
static bool is_in_cell(const caught_picture *whole, int cell, const caught_picture *picture)
{
    static const float nothing[4 * WIDTH];
    bool is_in = true;
    for (int y = 0; y < HEIGHT; y++) {
        const ptrdiff_t row = cell / COLUMNS * HEIGHT + y, column = (ptrdiff_t)(cell % COLUMNS) * WIDTH;
        const float *own = picture ? picture->rgba + 4 * (ptrdiff_t)y * WIDTH : nothing;
        is_in = is_in && memcmp(whole->rgba + 4 * (row * COLUMNS * WIDTH + column), own, sizeof nothing) == 0;
    }
    return is_in;
}

/* Returns whether rank 0 has the montage that is expected after a step. with_c: whether the third image was due. */
static bool is_montage(int cycle, bool with_c)
{
    char path[32];
    snprintf(path, sizeof path, "all_%d.png", cycle);
    const caught_picture *whole = find_picture(path);
    const char *const names[COLUMNS * ROWS] = {"a.png", "b0.png", "b1.png", with_c ? "c.png" : "-", "-", "-"};
    if (caught_count != (with_c ? 5 : 4) || !whole) return false;
    if (whole->width != COLUMNS * WIDTH || whole->height != ROWS * HEIGHT) return false;
    for (int cell = 0; cell < COLUMNS * ROWS; cell++) {
        const caught_picture *picture = find_picture(names[cell]);
        if ((*names[cell] != '-') != (picture != NULL) || !is_in_cell(whole, cell, picture)) return false;
    }
    return true;
}

static void montage_cells_contain_the_pictures_of_a_step(void **state)
{
    (void)state;
    session_input in;
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    for (int cycle = 0; cycle < 3; cycle++) {
        discard_pictures();
        assert_int_equal(submit_input(session, &in), INSITU_OK);
        assert_int_equal(insitu_step(session, cycle, 0), INSITU_OK);
        everywhere(!strstr(insitu_last_report(session)->warnings, "all_"));
        everywhere(own_rank != 0 || is_montage(cycle, cycle % 2 == 0));
    }
    insitu_destroy(&session);
    input_free(&in);
    discard_pictures();
}

static void files_that_cannot_be_written_are_reported(void **state)
{
    (void)state;
    session_input in;
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    discard_pictures();
    assert_int_equal(submit_input(session, &in), INSITU_OK);
    unwritable = "all_0";
    const insitu_status status = insitu_step(session, 0, 0);
    unwritable = NULL;
    check_reported_everywhere(session, status, INSITU_ERROR_IO, "all_0.png: cannot be written");
    everywhere(own_rank != 0 || (caught_count == 4 && find_picture("a.png") && find_picture("c.png")));
    insitu_destroy(&session);
    input_free(&in);
    discard_pictures();
}

/* ---- shared colour bars ------------------------------------------------------------------------------------------ */

/* Writes a scene of two pictures in one row. Each has a colour bar at `side`, whose range ends at 1 in the first
 * picture and at `high` in the second. */
static void write_shared_bar_scene(char text[2048], const char *side, const char *high)
{
    static const char image[] = "  - name: %s\n    size: [32, 24]\n    camera: {automatic: {direction: %s}}\n"
                                "    layers: [{slice: {field: f, range: [-1, %s]}}]\n"
                                "    decorations: {size: 0.1, title: t, colour_bar: {at: %s, labels: heat}}\n"
                                "    outputs: [{path: all.png, grid: [2, 1], shared_bars: true}]\n";
    int used = snprintf(text, 2048, "writing: step\nimages:\n");
    used += snprintf(text + used, 2048 - (size_t)used, image, "a", "[1, 2, 3]", "1", side);
    snprintf(text + used, 2048 - (size_t)used, image, "b", "[1, 1, 1]", high, side);
}

/* Width of the strip with the shared colour bar, in pixels: 9 times the height of letters, rounded up. */
enum { STRIP = 22 };

static bool check_insets_placed(const char *side, bool is_shared)
{
    const int left = strcmp(side, "left") == 0 ? STRIP : 0;
    bool is_well = caught_count == 1 && placed_count == (is_shared ? 3 : 2) && caught[0].width == 2 * WIDTH + STRIP;
    for (int i = 0; i < 2 && is_well; i++)
        is_well = placed[i].x == left + i * WIDTH && placed[i].y == 0 && placed[i].width == WIDTH &&
                  placed[i].of_width == 2 * WIDTH + STRIP && (*placed[i].bars == '\0') == is_shared;
    if (!is_well || !is_shared) return is_well;
    const placed_picture *strip = &placed[2];
    return strip->x == (left ? 0 : 2 * WIDTH) && strip->width == STRIP && strip->height == HEIGHT &&
           strncmp(strip->bars, "heat:", 5) == 0 && strchr(strip->bars, '\n') == strrchr(strip->bars, '\n') &&
           strip->size > 2.39 && strip->size < 2.41 && strip->colour[0] > 0.8F &&
           memcmp(strip->colour, placed[0].colour, sizeof strip->colour) == 0;
}

static void alike_colour_bars_are_drawn_once(void **state)
{
    (void)state;
    static const char *const sides[] = {"right", "left"};
    session_input in;
    char text[2048];
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    for (int i = 0; i < 4; i++) {
        const bool is_shared = i / 2 == 0;
        insitu_session *session = NULL;
        write_shared_bar_scene(text, sides[i % 2], is_shared ? "1" : "1.5");
        const insitu_status status = insitu_create_from_text(MPI_COMM_WORLD, text, &session);
        if (status) fprintf(stderr, "%s\n", insitu_error(NULL));
        assert_int_equal(status, INSITU_OK);
        for (int cycle = 0; cycle < 2; cycle++) {
            discard_pictures();
            assert_int_equal(submit_input(session, &in), INSITU_OK);
            assert_int_equal(insitu_step(session, cycle, 0), INSITU_OK);
            everywhere(own_rank != 0 || check_insets_placed(sides[i % 2], is_shared));
            const char *warning =
                strstr(insitu_last_report(session)->warnings, "all.png: the pictures in it have different");
            everywhere((warning != NULL) == (!is_shared && cycle == 0)); /* the warning is given only once */
        }
        insitu_destroy(&session);
    }
    input_free(&in);
    discard_pictures();
}

/* ---- insets ------------------------------------------------------------------------------------------------------ */

static const char inset_scene[] = "images:\n"
                                  "  - name: a\n    size: [32, 24]\n"
                                  "    layers: [{isosurface: {field: f, values: [0.1]}}]\n"
                                  "    outputs: [{path: whole.png, grid: [2, 1]}, {path: a.png}]\n"
                                  "  - name: b\n    size: [32, 24]\n    layers: [{slice: {field: f}}]\n"
                                  "    decorations: {colour_bar: true}\n"
                                  "    outputs: [{path: whole.png, grid: [2, 1]}, {path: b.png}]\n"
                                  "  - name: c\n    size: [10, 8]\n    camera: {automatic: {zoom: 3}}\n"
                                  "    layers: [{slice: {field: f}}]\n"
                                  "    outputs: [{path: c.png}, {path: whole.png, inset: top_right}]\n"
                                  "  - name: d\n    size: [6, 20]\n    every: 2\n    layers: [{surface: {}}]\n"
                                  "    outputs: [{path: d.png}, {path: whole.png, inset: bottom_left}]\n";

/* MARGIN: distance of insets from the montage's edges; FRAME: width of the frame around insets, which is inside the
 * margin; both in pixels. */
enum { MARGIN = 2, FRAME = 1 };

typedef struct inset_place {
    const caught_picture *picture; /* NULL if there is no inset */
    int x, y;
} inset_place;

/* Returns the expected pixel of an inset or its frame at a position of the montage; NULL if the position is outside
 * both. */
static const float *get_inset_pixel(const inset_place *inset, int x, int y)
{
    static const float grey[4] = {0.2140F, 0.2140F, 0.2140F, 1};
    const caught_picture *p = inset->picture;
    const int column = x - inset->x, row = y - inset->y;
    if (!p || column < -FRAME || row < -FRAME || column >= p->width + FRAME || row >= p->height + FRAME) return NULL;
    const bool is_in = column >= 0 && row >= 0 && column < p->width && row < p->height;
    return is_in ? p->rgba + 4 * ((ptrdiff_t)row * p->width + column) : grey;
}

/* Returns whether rank 0 has the montage with insets that is expected after a step. with_d: whether the fourth image
 * was due. */
static bool has_insets(bool with_d)
{
    const caught_picture *whole = find_picture("whole.png"), *cells[2] = {find_picture("a.png"), find_picture("b.png")};
    const inset_place insets[2] = {{find_picture("c.png"), 2 * WIDTH - 10 - MARGIN, MARGIN},
                                   {find_picture("d.png"), MARGIN, HEIGHT - 20 - MARGIN}};
    if (!whole || !cells[0] || !cells[1] || !insets[0].picture || (insets[1].picture != NULL) != with_d) return false;
    bool is_well = whole->width == 2 * WIDTH && whole->height == HEIGHT;
    for (int y = 0; y < HEIGHT && is_well; y++)
        for (int x = 0; x < 2 * WIDTH; x++) {
            const float *expected = get_inset_pixel(&insets[0], x, y);
            if (!expected) expected = get_inset_pixel(&insets[1], x, y);
            if (!expected) expected = cells[x / WIDTH]->rgba + 4 * ((ptrdiff_t)y * WIDTH + x % WIDTH);
            is_well = is_well && memcmp(whole->rgba + 4 * ((ptrdiff_t)y * 2 * WIDTH + x), expected, 16) == 0;
        }
    return is_well;
}

static bool is_covered(const placed_picture *panel, int x, int y, int width, int height)
{
    const insitu_rectangle *r = &panel->covered[0];
    return panel->covered_count == 1 && r->x == x && r->y == y && r->width == width && r->height == height;
}

/* Returns whether rank 0 has the expected areas that decorations must avoid. In the second panel this is the rectangle
 * of the inset with its frame; the first panel, over which no inset lies, has no such area. */
static bool check_avoided_areas(void)
{
    return placed_count >= 2 && placed[0].covered_count == 0 &&
           is_covered(&placed[1], WIDTH - 10 - MARGIN - FRAME, MARGIN - FRAME, 10 + 2 * FRAME, 8 + 2 * FRAME);
}

static void insets_cover_corners(void **state)
{
    (void)state;
    session_input in;
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(inset_scene));
    for (int cycle = 0; cycle < 2; cycle++) {
        discard_pictures();
        assert_int_equal(submit_input(session, &in), INSITU_OK);
        assert_int_equal(insitu_step(session, cycle, 0), INSITU_OK);
        everywhere(!strstr(insitu_last_report(session)->warnings, "overwr") || cycle > 0);
        everywhere(own_rank != 0 || (has_insets(cycle % 2 == 0) && check_avoided_areas()));
    }
    insitu_destroy(&session);
    input_free(&in);
    discard_pictures();
}

/* Writes a scene of two panels and two insets. The panels share a colour bar that ends at 1; the insets have colour
 * bars that end at 1 and at 2. */
static void write_insets_beside_bars(char text[2048], const char *side)
{
    static const char panel[] = "  - name: %s\n    size: [32, 24]\n    layers: [{slice: {field: f, range: [-1, 1]}}]\n"
                                "    decorations: {size: 0.1, colour_bar: {at: %s, labels: heat}}\n"
                                "    outputs: [{path: all.png, grid: [2, 1], shared_bars: true}]\n";
    static const char inset[] = "  - name: %s\n    size: [9, 8]\n    layers: [{slice: {field: f, range: [-1, %s]}}]\n"
                                "    decorations: {size: 0.1, colour_bar: {at: %s, labels: heat}}\n"
                                "    outputs: [{path: all.png, inset: %s}]\n";
    int used = snprintf(text, 2048, "writing: step\nimages:\n");
    used += snprintf(text + used, 2048 - (size_t)used, panel, "a", side);
    used += snprintf(text + used, 2048 - (size_t)used, panel, "b", side);
    used += snprintf(text + used, 2048 - (size_t)used, inset, "c", "1", side, "top_right");
    snprintf(text + used, 2048 - (size_t)used, inset, "d", "2", side, "bottom_left");
}

/* Returns whether, on rank 0, insets are drawn after the panels and over them, but not over the strip with the shared
 * colour bar. The inset whose colour bar equals the shared one must have none of its own. */
static bool check_insets_beside_bars(const char *side)
{
    const int left = strcmp(side, "left") == 0 ? STRIP : 0;
    const placed_picture *const strip = &placed[2], *const same = &placed[3], *const other = &placed[4];
    return caught_count == 1 && placed_count == 5 && strip->width == STRIP && strncmp(strip->bars, "heat:", 5) == 0 &&
           !*placed[0].bars && !*placed[1].bars &&
           is_covered(&placed[0], MARGIN - FRAME, HEIGHT - 8 - MARGIN - FRAME, 9 + 2 * FRAME, 8 + 2 * FRAME) &&
           is_covered(&placed[1], WIDTH - 9 - MARGIN - FRAME, MARGIN - FRAME, 9 + 2 * FRAME, 8 + 2 * FRAME) &&
           same->x == left + 2 * WIDTH - 9 - MARGIN && same->y == MARGIN && !*same->bars && other->x == left + MARGIN &&
           other->y == HEIGHT - 8 - MARGIN && strstr(other->bars, " 2");
}

static void insets_lie_beside_shared_bars(void **state)
{
    (void)state;
    static const char *const sides[] = {"right", "left"};
    session_input in;
    char text[2048];
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    for (int i = 0; i < 2; i++) {
        insitu_session *session = NULL;
        write_insets_beside_bars(text, sides[i]);
        assert_int_equal(insitu_create_from_text(MPI_COMM_WORLD, text, &session), INSITU_OK);
        discard_pictures();
        assert_int_equal(submit_input(session, &in), INSITU_OK);
        assert_int_equal(insitu_step(session, 0, 0), INSITU_OK);
        everywhere(own_rank != 0 || check_insets_beside_bars(sides[i]));
        everywhere(!strstr(insitu_last_report(session)->warnings, "different"));
        insitu_destroy(&session);
    }
    input_free(&in);
    discard_pictures();
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(montage_cells_contain_the_pictures_of_a_step),
        cmocka_unit_test(files_that_cannot_be_written_are_reported), cmocka_unit_test(insets_cover_corners),
        cmocka_unit_test(insets_lie_beside_shared_bars), cmocka_unit_test(alike_colour_bars_are_drawn_once)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
