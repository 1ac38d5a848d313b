/* Checks meshes whose cells list their vertices in another order than the declared one. The warning must name the
 * actual order, whatever signs the sums of corner volumes have. Mirrored and distorted cells must not cause this
 * warning, and for cells that are wrong in every order the warning must state this. */
#include <stdio.h>
#include <string.h>

#include "test_session_fixture.h"

enum { SIDE = 4, ORDERS = 3 };

static const char scene[] = "images:\n  - name: a\n    size: [12, 8]\n    layers: [{surface: {}}]\n"
                            "    outputs: [{path: a.exr}]\n";

static const char *const names[ORDERS] = {"INSITU_ORDER_VTK", "INSITU_ORDER_LEXICOGRAPHIC", "INSITU_ORDER_DMPLEX"};

/* Returns the position of VTK's n-th vertex in another order, as docs/finite_elements.md defines it. */
static int find_vertex_position(insitu_vertex_order order, int type, int n)
{
    static const int lexicographic[] = {0, 1, 3, 2, 4, 5, 7, 6}, hex[] = {0, 3, 2, 1, 4, 5, 6, 7};
    static const int wedge[] = {0, 2, 1, 3, 4, 5};
    const bool has_quads = type == INSITU_HEX || type == INSITU_PYRAMID || type == INSITU_QUAD;
    if (order == INSITU_ORDER_LEXICOGRAPHIC && has_quads) return lexicographic[n];
    if (order == INSITU_ORDER_DMPLEX && type == INSITU_HEX) return hex[n];
    return order == INSITU_ORDER_DMPLEX && type == INSITU_WEDGE ? wedge[n] : n;
}

static void reorder_vertices(test_mesh *part, insitu_vertex_order order)
{
    for (int64_t cell = 0; cell < part->cell_count; cell++) {
        int64_t *first = part->connectivity + part->offsets[cell], held[8];
        const int64_t count = part->offsets[cell + 1] - part->offsets[cell];
        memcpy(held, first, (size_t)count * sizeof *first);
        for (int n = 0; n < count; n++) first[find_vertex_position(order, part->types[cell], n)] = held[n];
    }
}

/* Returns whether the two orders differ for the cells of this kind. */
static bool orders_differ(test_mesh_kind kind, int a, int b)
{
    if (a == b || kind == TEST_MIXED) return a != b;
    if (kind == TEST_HEXES) return true;
    const int own = kind == TEST_WEDGES ? INSITU_ORDER_DMPLEX : INSITU_ORDER_LEXICOGRAPHIC;
    return a == own || b == own;
}

/* Checks that exactly one warning is given, which contains `words`. If words is NULL, checks that no warning about the
 * vertex order is given; a warning about left-handed cells is then allowed. */
static void check_order_warning_text(insitu_session *session, const session_input *in, const char *words,
                                     const char *what)
{
    everywhere(submit_input(session, in) == INSITU_OK);
    check_step_succeeds(session, 0);
    const char *text = insitu_last_report(session)->warnings;
    const bool is_well = words ? strstr(text, words) && !strchr(text, '\n') : !strstr(text, "vertex_order");
    if (!is_well) fprintf(stderr, "%s: %s: %s\n", what, words ? words : "no warning", text);
    everywhere(is_well);
}

static void check_order_warning(test_mesh_kind kind, insitu_vertex_order stand, insitu_vertex_order said, double jitter,
                                bool mirrored)
{
    char what[96];
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    session_input in = {0};
    test_mesh whole;
    test_mesh_make_lattice(kind, SIDE, jitter, test_wave_field, &whole);
    if (mirrored) test_mesh_mirror_cells(&whole, false);
    reorder_vertices(&whole, stand);
    extract_own_cells(&whole, TEST_RANDOM, SIDE, false, &in.part);
    test_mesh_free(&whole);
    input_describe(&in);
    in.mesh.vertex_order = said;
    snprintf(what, sizeof what, "%s in order %d read in %d, jitter %g%s", test_mesh_kind_name(kind), (int)stand,
             (int)said, jitter, mirrored ? ", mirrored" : "");
    check_order_warning_text(session, &in, orders_differ(kind, (int)stand, (int)said) ? names[stand] : NULL, what);
    insitu_destroy(&session);
    input_free(&in);
}

static void fitting_vertex_order_is_suggested(void **state)
{
    (void)state;
    static const test_mesh_kind kinds[] = {TEST_HEXES, TEST_WEDGES, TEST_PYRAMIDS, TEST_MIXED};
    static const double jitters[] = {0, 0.1, 0.3};
    for (int k = 0; k < 4; k++)
        for (int stand = 0; stand < ORDERS; stand++)
            for (int said = 0; said < ORDERS; said++)
                for (int j = 0; j < 3; j++)
                    for (int mirrored = 0; mirrored < 2; mirrored++)
                        /* If the actual order equals VTK's for this kind of cells, the warning names VTK's order, so
                         * that the case is not tested. */
                        if (stand == INSITU_ORDER_VTK || orders_differ(kinds[k], INSITU_ORDER_VTK, stand))
                            check_order_warning(kinds[k], (insitu_vertex_order)stand, (insitu_vertex_order)said,
                                                jitters[j], mirrored);
}

/* Checks hexes of which two opposite vertices are exchanged, so that the cells are wrong in every order. */
static void twisted_cells_are_reported(void **state)
{
    (void)state;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    session_input in = {0};
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    check_order_warning_text(session, &in, NULL, "good hexes");
    for (int64_t cell = 0; cell < in.part.cell_count; cell++) {
        int64_t *v = in.part.connectivity + 8 * cell, held = v[0];
        v[0] = v[6];
        v[6] = held;
    }
    check_order_warning_text(session, &in, "no vertex_order would mend that", "hexes with two vertices exchanged");
    insitu_destroy(&session);
    input_free(&in);
}

/* Checks that no warning is given if only a minority of the cells has another order. */
static void few_reordered_cells_are_not_reported(void **state)
{
    (void)state;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    session_input in = {0};
    input_create(&in, TEST_HEXES, SIDE, TEST_BLOCK, own_rank, rank_count);
    for (int64_t cell = 0; cell < in.part.cell_count; cell += 3) {
        int64_t *v = in.part.connectivity + 8 * cell, held = v[1];
        v[1] = v[3];
        v[3] = held;
    }
    check_order_warning_text(session, &in, NULL, "a third of the hexes in DMPlex's order");
    insitu_destroy(&session);
    input_free(&in);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(fitting_vertex_order_is_suggested),
        cmocka_unit_test(twisted_cells_are_reported),
        cmocka_unit_test(few_reordered_cells_are_not_reported),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
