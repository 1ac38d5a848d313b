/* Checks statistics of fields. They are compared with closed forms and with sums computed here. Files must be identical
 * byte by byte on any number of ranks, and restarted runs must continue them. Images must be drawn only if a condition
 * holds, or only once. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "session.h"
#include "test_session_fixture.h"

enum { SIDE = 4, MOST = 1 << 16 };

#define PICTURE(keys)                                                                                                  \
    "images:\n  - name: a\n    size: [8, 6]\n" keys "    layers: [{isosurface: {field: f, values: [0.1]}}]\n"          \
    "    outputs: [{path: a.png}]\n"
#define NEVER PICTURE("    when: {field: f, above: 1e9}\n")

/* ---- inputs and files ------------------------------------------------------------------------------------------ */

/* Makes this rank's part. If is_cell_centred is set, each cell gets a random value that does not depend on the rank
 * that owns the cell. */
static void make_part(test_mesh_kind kind, double jitter, bool is_cell_centred, session_input *out)
{
    test_mesh whole;
    test_mesh_make_lattice(kind, SIDE, jitter, test_linear_field, &whole);
    int *owners = test_calloc((size_t)whole.cell_count, sizeof *owners);
    test_partition_cells(&whole, TEST_RANDOM, SIDE, rank_count, owners);
    test_mesh_extract_part(&whole, owners, own_rank, &out->part);
    if (is_cell_centred) {
        int64_t count = 0;
        free(out->part.values);
        out->part.values = calloc((size_t)whole.cell_count, sizeof(double));
        assert_non_null(out->part.values);
        for (int64_t cell = 0; cell < whole.cell_count; cell++)
            if (owners[cell] == own_rank) out->part.values[count++] = test_uniform_between((uint64_t)cell, 5, -3, 7);
    }
    input_describe(out);
    if (is_cell_centred) {
        out->field.centring = INSITU_CELL;
        out->field.count = out->part.cell_count;
    }
    test_free(owners);
    test_mesh_free(&whole);
}

/* Returns the number in a column of the file's last line. */
static double read_last_line_number(const char *text, int column)
{
    const char *line = text, *end;
    while ((end = strchr(line, '\n')) && end[1]) line = end + 1;
    for (; column > 0 && line; column--) line = strchr(line, ',') ? strchr(line, ',') + 1 : NULL;
    return line ? strtod(line, NULL) : NAN;
}

enum { CELLS = 2, VOLUME, LEAST, MOST_VALUE, MEAN, DEVIATION, LOW, HIGH, FIRST_BIN };

static void run_steps(const char *scene, const session_input *in, int first, int end)
{
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    discard_pictures();
    for (int cycle = first; cycle < end; cycle++) {
        assert_int_equal(submit_input(session, in), INSITU_OK);
        const insitu_status status = insitu_step(session, cycle, 0.5 * cycle);
        if (status) fprintf(stderr, "%s\n", insitu_error(session));
        everywhere(status == INSITU_OK);
    }
    insitu_destroy(&session);
}

/* ---- numbers --------------------------------------------------------------------------------------------------- */

static bool is_nearly_equal(double a, double b)
{
    if (fabs(a - b) <= 1e-8 * fmax(1, fabs(b))) return true; /* numbers are written with nine digits */
    fprintf(stderr, "%.9g, expected %.9g\n", a, b);
    return false;
}

/* Checks a linear field over the cube from -1 to 1: its mean is the value at the centre, and its extremes are at
 * corners. The polyhedra are cubes here, so that the mean of their vertices is their centre. Mixed lattices are exempt
 * from the exact mean: their pyramids are not in pairs, so that the means of vertices are not the centres. */
static void statistics_of_linear_fields_match_closed_forms(void **state)
{
    (void)state;
    static char text[MOST];
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        session_input in = {0};
        make_part(kind == TEST_POLYHEDRA ? TEST_HEXES : kind, 0, false, &in);
        if (kind == TEST_POLYHEDRA) test_mesh_to_polyhedra(&in.part, 1);
        input_describe(&in);
        if (own_rank == 0) unlink("linear.csv");
        run_steps(NEVER "statistics: [{field: f, path: linear.csv}]\n", &in, 0, 1);
        read_file("linear.csv", MOST, text);
        everywhere(own_rank != 0 || (is_nearly_equal(read_last_line_number(text, VOLUME), 8) &&
                                     is_nearly_equal(read_last_line_number(text, LEAST), -1.4) &&
                                     is_nearly_equal(read_last_line_number(text, MOST_VALUE), 1.6) &&
                                     (kind == TEST_MIXED || is_nearly_equal(read_last_line_number(text, MEAN), 0.1))));
        input_free(&in);
    }
}

/* Checks that cells with warped faces and concave cells leave no gap and do not overlap: their volumes sum to the
 * cube's volume. Warped hexes and wedges are also tested as polyhedra with bilinear faces. */
static void bent_and_concave_cells_fill_their_cube(void **state)
{
    (void)state;
    static char text[MOST];
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (int way = 0; way < 2; way++) {
            session_input in = {0};
            make_part(kind, 0.15, false, &in); /* no tet is inverted */
            if (way == 1 && kind == TEST_POLYHEDRA) test_mesh_reorder_vertices(&in.part, 9);
            if (way == 1 && kind != TEST_POLYHEDRA) test_mesh_to_polyhedra(&in.part, 0.5);
            input_describe(&in);
            in.mesh.keep_polyhedra = way;
            if (own_rank == 0) unlink("bent.csv");
            run_steps(NEVER "statistics: [{field: f, path: bent.csv}]\n", &in, 0, 1);
            read_file("bent.csv", MOST, text);
            everywhere(own_rank != 0 || is_nearly_equal(read_last_line_number(text, VOLUME), 8));
            input_free(&in);
        }
}

/* Compares the statistics of equal cubes with known values with sums computed here. The bins range from -2 to 6, so
 * that some cells are in no bin. */
static void cell_counts_are_sums_over_ranks(void **state)
{
    (void)state;
    enum { COUNT = SIDE * SIDE * SIDE, BINS = 5 };
    static char text[MOST];
    session_input in = {0};
    double sum = 0, squares = 0, least = 7, most = -3, bins[BINS] = {0};
    for (int cell = 0; cell < COUNT; cell++) {
        const double value = test_uniform_between((uint64_t)cell, 5, -3, 7);
        sum += value / COUNT;
        least = fmin(least, value);
        most = fmax(most, value);
        if (value >= -2 && value <= 6) bins[(int)fmin((value + 2) / 8 * BINS, BINS - 1)] += 1.0 / COUNT;
    }
    for (int cell = 0; cell < COUNT; cell++)
        squares += pow(test_uniform_between((uint64_t)cell, 5, -3, 7) - sum, 2) / COUNT;
    make_part(TEST_HEXES, 0, true, &in);
    if (own_rank == 0) unlink("folder/cells.csv"), rmdir("folder");
    run_steps(NEVER "statistics: [{field: f, path: folder/cells.csv, histogram: {bins: 5, range: [-2, 6]}}]\n", &in, 0,
              1);
    read_file("folder/cells.csv", MOST, text);
    bool is_well =
        read_last_line_number(text, CELLS) == COUNT && is_nearly_equal(read_last_line_number(text, VOLUME), 8);
    is_well = is_well && is_nearly_equal(read_last_line_number(text, LEAST), least) &&
              is_nearly_equal(read_last_line_number(text, MOST_VALUE), most);
    is_well = is_well && is_nearly_equal(read_last_line_number(text, MEAN), sum) &&
              is_nearly_equal(read_last_line_number(text, DEVIATION), sqrt(squares));
    is_well = is_well && read_last_line_number(text, LOW) == -2 && read_last_line_number(text, HIGH) == 6;
    for (int bin = 0; bin < BINS; bin++)
        is_well = is_well && is_nearly_equal(read_last_line_number(text, FIRST_BIN + bin), bins[bin]);
    everywhere(own_rank != 0 || is_well);
    input_free(&in);
}

/* Checks that all ranks together and one rank alone write the same bytes for cells of different volumes. */
static void files_do_not_depend_on_the_partition(void **state)
{
    (void)state;
    static char text[MOST], alone[MOST];
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (int way = 0; way < 2; way++) {
            session_input in = {0}, whole = {0};
            make_part(kind, 0.2, way == 1, &in);
            if (own_rank == 0) unlink("parts.csv"), unlink("whole.csv");
            run_steps(NEVER "statistics: [{field: f, path: parts.csv, histogram: {bins: 100}}]\n", &in, 0, 1);
            const char *scene =
                write_scene(NEVER "statistics: [{field: f, path: whole.csv, histogram: {bins: 100}}]\n");
            const int ranks = rank_count;
            if (own_rank == 0) {
                rank_count = 1;
                make_part(kind, 0.2, way == 1, &whole);
                insitu_session *session = open_session(MPI_COMM_SELF, scene);
                assert_int_equal(submit_input(session, &whole), INSITU_OK);
                assert_int_equal(insitu_step(session, 0, 0), INSITU_OK);
                insitu_destroy(&session);
                input_free(&whole);
                rank_count = ranks;
            }
            read_file("parts.csv", MOST, text);
            read_file("whole.csv", MOST, alone);
            everywhere(own_rank != 0 || (strlen(text) > 900 && strcmp(text, alone) == 0));
            input_free(&in);
        }
}

/* Checks that zeros are written without a sign: which of the values 0 and -0 is the minimum would depend on the
 * partition. */
static void zeros_are_written_without_a_sign(void **state)
{
    (void)state;
    static char text[MOST];
    for (int kind = 1; kind <= 3; kind++) {
        session_input in = {0};
        make_part(TEST_HEXES, 0, false, &in);
        for (int64_t v = 0; v < in.part.vertex_count; v++)
            in.part.values[v] = kind == 1 || (kind == 3 && v % 2) ? -0.0 : 0.0;
        if (own_rank == 0) unlink("zeros.csv");
        run_steps(NEVER "statistics: [{field: f, path: zeros.csv, histogram: {bins: 2}}]\n", &in, 0, 1);
        read_file("zeros.csv", MOST, text);
        everywhere(own_rank != 0 || strstr(text, ",8,0,0,0,0,0,0,") != NULL);
        input_free(&in);
    }
}

/* ---- files ----------------------------------------------------------------------------------------------------- */

static void restarted_runs_continue_the_file(void **state)
{
    (void)state;
    static char first[MOST], text[MOST];
    static const char scene[] = NEVER "statistics: [{field: f, path: runs.csv, every: 2}]\n";
    session_input in = {0};
    make_part(TEST_TETS, 0.1, false, &in);
    if (own_rank == 0) unlink("runs.csv");
    run_steps(scene, &in, 0, 7);
    read_file("runs.csv", MOST, first);
    everywhere(own_rank != 0 || (read_last_line_number(first, 0) == 6 && read_last_line_number(first, 1) == 3));
    run_steps(scene, &in, 3, 7);
    read_file("runs.csv", MOST, text);
    everywhere(own_rank != 0 || strcmp(first, text) == 0);
    if (own_rank == 0) first[strlen(first) - 20] = '\0'; /* makes the last line incomplete */
    write_text_file("runs.csv", first);
    run_steps(scene, &in, 6, 7);
    read_file("runs.csv", MOST, first);
    everywhere(own_rank != 0 || strcmp(first, text) == 0);
    input_free(&in);
}

/* Checks that a run that goes back in time within a session replaces the lines of the cycles that it repeats, in files
 * of different intervals. */
static void repeated_cycles_replace_their_lines(void **state)
{
    (void)state;
    static const char scene[] =
        NEVER "statistics: [{field: f, path: all.csv}, {field: f, path: third.csv, every: 3}]\n";
    static const int cycles[] = {0, 1, 2, 3, 3, 4, 5, 6, 2, 3, 4, 4};
    static char expected[2][MOST], text[MOST];
    static const char *const paths[] = {"all.csv", "third.csv"};
    session_input in = {0};
    make_part(TEST_TETS, 0.1, false, &in);
    if (own_rank == 0) unlink(paths[0]), unlink(paths[1]);
    run_steps(scene, &in, 0, 5);
    for (int i = 0; i < 2; i++) read_file(paths[i], MOST, expected[i]);
    if (own_rank == 0) unlink(paths[0]), unlink(paths[1]);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    for (int i = 0; i < (int)(sizeof cycles / sizeof cycles[0]); i++) {
        assert_int_equal(submit_input(session, &in), INSITU_OK);
        everywhere(insitu_step(session, cycles[i], 0.5 * cycles[i]) == INSITU_OK);
    }
    insitu_destroy(&session);
    for (int i = 0; i < 2; i++) {
        read_file(paths[i], MOST, text);
        everywhere(own_rank != 0 || (*text && strcmp(text, expected[i]) == 0));
    }
    input_free(&in);
}

/* Checks that lines of an abandoned branch are removed if the run went back to a cycle in which nothing was due, and if
 * it went back several times before the next line. */
static void returns_between_lines_remove_abandoned_lines(void **state)
{
    (void)state;
    static const char scene[] =
        NEVER "statistics: [{field: f, path: tens.csv, every: 10}, {field: f, path: sevens.csv, every: 7}]\n";
    static const int cycles[] = {10, 14, 20, 21, 30, 15, 18, 18, 40, 49, 50};
    static const char *const paths[] = {"tens.csv", "sevens.csv"};
    static const int expected[2][3] = {{10, 40, 50}, {14, 49, -1}};
    static char text[MOST];
    session_input in = {0};
    make_part(TEST_TETS, 0.1, false, &in);
    if (own_rank == 0) unlink(paths[0]), unlink(paths[1]);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    for (int i = 0; i < (int)(sizeof cycles / sizeof cycles[0]); i++) {
        assert_int_equal(submit_input(session, &in), INSITU_OK);
        everywhere(insitu_step(session, cycles[i], cycles[i]) == INSITU_OK);
    }
    insitu_destroy(&session);
    for (int i = 0; i < 2; i++) {
        read_file(paths[i], MOST, text);
        bool is_right = true;
        const char *line = strchr(text, '\n');
        for (int k = 0; k < 3 && expected[i][k] >= 0 && is_right; k++) {
            is_right = line && atoi(line + 1) == expected[i][k];
            line = line ? strchr(line + 1, '\n') : NULL;
        }
        everywhere(own_rank != 0 || (is_right && line && !line[1]));
    }
    input_free(&in);
}

/* Checks files that cannot be written: the error is returned on all ranks, and the picture is still drawn. */
static void files_that_cannot_be_written_are_reported(void **state)
{
    (void)state;
    static char text[MOST];
    session_input in = {0};
    make_part(TEST_TETS, 0.1, false, &in);
    write_text_file("other.csv", "a,b\n1,2\n");
    insitu_session *session =
        open_session(MPI_COMM_WORLD, write_scene(PICTURE("") "statistics: [{field: f, path: other.csv}]\n"));
    discard_pictures();
    assert_int_equal(submit_input(session, &in), INSITU_OK);
    check_reported_everywhere(session, insitu_step(session, 0, 0), INSITU_ERROR_IO, "other.csv", "other columns",
                              "cycle,time");
    everywhere(caught_count == (own_rank == 0));
    read_file("other.csv", MOST, text);
    everywhere(own_rank != 0 || strcmp(text, "a,b\n1,2\n") == 0);
    insitu_destroy(&session);
    session = open_session(MPI_COMM_WORLD, write_scene(PICTURE("") "statistics: [{field: g, path: g.csv}]\n"));
    assert_int_equal(submit_input(session, &in), INSITU_OK);
    check_reported_everywhere(session, insitu_step(session, 0, 0), INSITU_ERROR_FIELD, "\"g\"", "there are", "f");
    everywhere(caught_count == 2 * (own_rank == 0));
    insitu_destroy(&session);
    input_free(&in);
}

/* Checks that statistics and conditions of other fields are evaluated if the scene also requests those of a missing
 * field. */
static void other_fields_are_found_if_a_field_is_missing(void **state)
{
    (void)state;
    static char text[MOST];
    session_input in = {0};
    make_part(TEST_TETS, 0.1, false, &in);
    if (own_rank == 0) unlink("there.csv");
    insitu_session *session = open_session(
        MPI_COMM_WORLD,
        write_scene(PICTURE("    when: {field: f, above: -1e9}\n") "  - name: b\n    size: [8, 6]\n"
                                                                   "    when: {field: h, above: 0}\n    layers: "
                                                                   "[{isosurface: {field: f, values: "
                                                                   "[0.1]}}]\n    outputs: [{path: b.png}]\n"
                                                                   "statistics: [{field: g, path: g.csv}, {field: f, "
                                                                   "path: there.csv}]\n"));
    discard_pictures();
    assert_int_equal(submit_input(session, &in), INSITU_OK);
    check_reported_everywhere(session, insitu_step(session, 0, 0), INSITU_ERROR_FIELD, "\"g\"", "there are", "f");
    everywhere(caught_count == (own_rank == 0) && insitu_last_report(session)->images == 1);
    insitu_destroy(&session);
    read_file("there.csv", MOST, text);
    everywhere(own_rank != 0 || strstr(text, "\n0,0,"));
    discard_pictures();
    input_free(&in);
}

/* A field whose fill function fails, or whose index is out of range, on the last rank if is_wrong is set. */
typedef struct faulty_field {
    const session_input *in;
    int64_t *index;
    bool is_filled, is_wrong;
} faulty_field;

static insitu_status fill_faulty_field(void *data, insitu_field *field)
{
    const faulty_field *f = data;
    field->count = f->in->field.count;
    field->values = f->in->field.values;
    return f->is_wrong ? INSITU_ERROR_IO : INSITU_OK;
}

static void set_faulty_field(insitu_session *session, faulty_field *f, bool is_wrong)
{
    const int64_t count = f->in->field.count;
    insitu_field field = f->in->field;
    field.name = "q";
    f->is_wrong = is_wrong && own_rank == rank_count - 1;
    for (int64_t v = 0; v < count; v++) f->index[v] = v;
    if (f->is_filled) {
        field.count = 0;
        field.values.data = NULL;
        field.fill = fill_faulty_field;
        field.fill_data = f;
    } else {
        if (f->is_wrong) f->index[count - 1] = count;
        field.index = (insitu_array){f->index, INSITU_INT64, 0};
    }
    everywhere(insitu_set_field(session, "m", &field) == INSITU_OK);
}

static int count_lines(const char *path)
{
    static char text[MOST];
    int count = 0;
    read_file(path, MOST, text);
    for (const char *c = text; *c; c++) count += *c == '\n';
    return own_rank == 0 ? count : 0;
}

/* Checks that statistics, conditions and images of f do not depend on an error in the values of q, also if statistics
 * and images of q or of a field that is derived from q are requested in the same steps. */
static void other_fields_are_found_if_values_are_invalid(void **state)
{
    (void)state;
#define TWO(field)                                                                                                     \
    "statistics: [{field: " field ", path: q.csv}, {field: f, path: p.csv}]\n" PICTURE(                                \
        "    when: {field: f, above: -1e9}\n") "  - {name: b, size: [8, 6], when: {field: " field                      \
                                               ", above: -1e9}, layers: [{isosurface: {field: f, values: [0.1]}}], "   \
                                               "outputs: [{path: b.png}]}\n  - {name: c, size: [8, 6], layers: "       \
                                               "[{isosurface: {field: " field                                          \
                                               ", values: [0.1]}}], outputs: [{path: c.png}]}\n"
    static const char *const scenes[] = {TWO("q"), "fields: {r: 2 * q}\n" TWO("r")};
#undef TWO
    session_input in = {0};
    make_part(TEST_TETS, 0.1, false, &in);
    faulty_field f = {.in = &in, .index = calloc((size_t)in.field.count + 1, sizeof *f.index)};
    assert_non_null(f.index);
    for (int i = 0; i < 4; i++) {
        if (own_rank == 0) unlink("p.csv"), unlink("q.csv");
        f.is_filled = i % 2;
        insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scenes[i / 2]));
        assert_int_equal(submit_input(session, &in), INSITU_OK);
        for (int cycle = 0; cycle < 3; cycle++) {
            set_faulty_field(session, &f, cycle == 1);
            discard_pictures();
            const insitu_status status = insitu_step(session, cycle, cycle);
            if (cycle == 1)
                check_reported_everywhere(session, status, INSITU_ERROR_FIELD, "mesh \"m\": field \"q\": ",
                                          f.is_filled ? "its fill returned 5" : "the index of vertex ");
            else
                everywhere(status == INSITU_OK);
            everywhere(insitu_last_report(session)->images == (cycle == 1 ? 1 : 3));
        }
        insitu_destroy(&session);
        everywhere(own_rank != 0 || (count_lines("p.csv") == 4 && count_lines("q.csv") == 3));
    }
    discard_pictures();
    free(f.index);
    input_free(&in);
}

/* ---- conditions ------------------------------------------------------------------------------------------------ */

/* Makes steps with the cycles 0 to 9, in which the maximum of the field is the cycle. Returns the cycles that drew a
 * picture, as bits. */
static unsigned find_cycles_drawn(const char *scene)
{
    unsigned drawn = 0;
    session_input in = {0};
    make_part(TEST_TETS, 0.1, false, &in);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    for (int cycle = 0; cycle < 10; cycle++) {
        for (int64_t v = 0; v < in.part.vertex_count; v++)
            in.part.values[v] = cycle / 1.6 * test_linear_field(in.part.coordinates + 3 * v);
        discard_pictures();
        assert_int_equal(submit_input(session, &in), INSITU_OK);
        const insitu_status status = insitu_step(session, cycle, cycle);
        if (status) fprintf(stderr, "%s\n", insitu_error(session));
        everywhere(status == INSITU_OK);
        everywhere(insitu_last_report(session)->images <= 1);
        drawn |= (unsigned)insitu_last_report(session)->images << cycle;
    }
    insitu_destroy(&session);
    input_free(&in);
    return drawn;
}

static void conditions_suppress_images(void **state)
{
    (void)state;
    everywhere(find_cycles_drawn(PICTURE("    when: {field: f, above: 5.5}\n")) == 0x3c0);
    everywhere(find_cycles_drawn(PICTURE("    when: {field: f, above: 5.5, below: 8.5}\n")) == 0x1c0);
    everywhere(find_cycles_drawn(PICTURE("    when: {field: f, of: minimum, above: -2}\n")) == 0x7);
    everywhere(find_cycles_drawn(PICTURE("    when: {field: f, of: mean, below: 0.2}\n")) == 0xf);
    everywhere(find_cycles_drawn(PICTURE("    every: 2\n    when: {field: f, above: 2.5}\n")) == 0x150);
    everywhere(find_cycles_drawn(PICTURE("    once: true\n    when: {field: f, above: 5.5}\n")) == 0x40);
    everywhere(find_cycles_drawn(PICTURE("    once: true\n")) == 0x1);
}

static int set_up_test_group(void **state)
{
    (void)state;
    return enter_test_folder("statistics") ? 0 : 1;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(statistics_of_linear_fields_match_closed_forms),
                                       cmocka_unit_test(bent_and_concave_cells_fill_their_cube),
                                       cmocka_unit_test(cell_counts_are_sums_over_ranks),
                                       cmocka_unit_test(files_do_not_depend_on_the_partition),
                                       cmocka_unit_test(zeros_are_written_without_a_sign),
                                       cmocka_unit_test(restarted_runs_continue_the_file),
                                       cmocka_unit_test(repeated_cycles_replace_their_lines),
                                       cmocka_unit_test(returns_between_lines_remove_abandoned_lines),
                                       cmocka_unit_test(returns_between_lines_remove_abandoned_lines),
                                       cmocka_unit_test(files_that_cannot_be_written_are_reported),
                                       cmocka_unit_test(other_fields_are_found_if_a_field_is_missing),
                                       cmocka_unit_test(other_fields_are_found_if_values_are_invalid),
                                       cmocka_unit_test(conditions_suppress_images)};
    return run_session_tests(argc, argv, tests, set_up_test_group, NULL);
}
