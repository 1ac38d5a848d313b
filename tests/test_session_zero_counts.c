/* Checks all combinations of counts of a mesh that are 0 or not, in each form of mesh, for all layers, on the last rank
 * or on all ranks, with and without the arrays that have these counts. The step must return an error on all ranks or
 * draw a picture, and must never abort. A mesh without cells is valid, whatever its other counts are. */
#include <stdio.h>
#include <string.h>

#include "test_effort.h"
#include "test_mesh_forms.h"

enum { SIDE = 3, COUNTS = 6 };

static void list_mesh_counts(insitu_mesh *mesh, int64_t *counts[COUNTS])
{
    int64_t *const all[COUNTS] = {&mesh->vertex_count,
                                  &mesh->cell_count,
                                  &mesh->connectivity_count,
                                  &mesh->face_count,
                                  &mesh->face_connectivity_count,
                                  &mesh->neighbour_count};
    memcpy(counts, all, sizeof all);
}

/* Removes the arrays whose number of elements is a count in the mask, or is one more than such a count. */
static void drop_arrays(insitu_mesh *mesh, unsigned mask)
{
    insitu_array *const of_counts[COUNTS][5] = {
        {&mesh->coordinates[0], &mesh->coordinates[1], &mesh->coordinates[2], &mesh->vertex_ids},
        {&mesh->cell_types, &mesh->offsets, &mesh->ghosts},
        {&mesh->connectivity},
        {&mesh->face_offsets, &mesh->face_sizes, &mesh->face_lists, &mesh->owner},
        {&mesh->face_connectivity},
        {&mesh->neighbour}};
    for (int c = 0; c < COUNTS; c++)
        for (int i = 0; i < 5 && of_counts[c][i] && mask >> c & 1; i++) of_counts[c][i]->data = NULL;
}

/* Returns whether the mesh is valid because it has no cells and no contradictory arrays. */
static bool is_valid_empty_mesh(const insitu_mesh *mesh)
{
    return mesh->cell_count == 0 && mesh->neighbour_count <= mesh->face_count &&
           !(mesh->face_sizes.data && !mesh->face_lists.data) && !(mesh->neighbour.data && !mesh->owner.data) &&
           !(mesh->owner.data && mesh->face_count) &&
           (mesh->face_count == 0 || mesh->face_offsets.data || mesh->face_lists.data);
}

static void draw_mesh_with_zero_counts(insitu_session *session, formed_mesh *m, bool is_discontinuous, unsigned mask,
                                       bool with_arrays, bool is_mine)
{
    const insitu_mesh right = m->mesh;
    const insitu_field right_fields[FORMED_FIELDS] = {m->fields[0], m->fields[1], m->fields[2], m->fields[3]};
    int64_t *counts[COUNTS];
    list_mesh_counts(&m->mesh, counts);
    for (int c = 0; c < COUNTS && is_mine; c++)
        if (mask >> c & 1) *counts[c] = 0;
    if (is_mine && !with_arrays) drop_arrays(&m->mesh, mask);
    formed_mesh_resize_fields(m);
    const bool is_right = !is_mine || is_valid_empty_mesh(&m->mesh);
    discard_pictures();
    const insitu_status set = formed_mesh_submit(session, m, is_discontinuous);
    const insitu_status status = insitu_step(session, 1, 0);
    if ((set && !status) || (is_right && status))
        fprintf(stderr, "%s mask %u %s: %s\n", mesh_form_name(m->form), mask, with_arrays ? "arrays" : "none",
                insitu_error(session));
    int all_right = is_right;
    MPI_Allreduce(MPI_IN_PLACE, &all_right, 1, MPI_INT, MPI_LAND, MPI_COMM_WORLD);
    everywhere(!all_right || status == INSITU_OK);
    everywhere(!set || status);
    check_reported_everywhere(session, status, status, status ? "mesh \"m\"" : "");
    m->mesh = right;
    memcpy(m->fields, right_fields, sizeof right_fields);
}

static void check_form(mesh_form form, bool is_discontinuous)
{
    formed_mesh m;
    formed_mesh_create(form, SIDE, own_rank, rank_count, &m);
    insitu_session *session =
        open_session(MPI_COMM_WORLD, write_scene(is_discontinuous ? formed_corner_scene : formed_scene));
    int64_t *counts[COUNTS];
    list_mesh_counts(&m.mesh, counts);
    unsigned given = 0;
    for (int c = 0; c < COUNTS; c++) given |= (unsigned)(*counts[c] > 0) << c;
    MPI_Allreduce(MPI_IN_PLACE, &given, 1, MPI_UNSIGNED, MPI_BOR, MPI_COMM_WORLD);
    for (unsigned mask = 1; mask < 1u << COUNTS; mask++) {
        if (mask & ~given) continue;
        /* The last rank is all ranks if there is one. The usual run on several ranks keeps or drops the arrays in turn.
         */
        for (int way = 0; way < (rank_count > 1 ? 4 : 2); way++)
            if (rank_count == 1 || test_is_long_run() || (mask + form + (unsigned)way) % 2 == 0)
                draw_mesh_with_zero_counts(session, &m, is_discontinuous, mask, way & 1,
                                           way & 2 || own_rank == rank_count - 1);
    }
    discard_pictures();
    everywhere(formed_mesh_submit(session, &m, is_discontinuous) == INSITU_OK);
    const insitu_status status = insitu_step(session, 2, 0);
    check_reported_everywhere(session, status, INSITU_OK, "");
    everywhere(insitu_last_report(session)->images == (is_discontinuous ? FORMED_CORNER_PICTURES : FORMED_PICTURES));
    insitu_destroy(&session);
    formed_mesh_free(&m);
}

static void zero_counts_give_an_error_or_a_picture(void **state)
{
    (void)state;
    for (mesh_form form = 0; form < MESH_FORM_COUNT; form++) check_form(form, false);
}

static void zero_counts_with_corner_fields_give_an_error_or_a_picture(void **state)
{
    (void)state;
    for (mesh_form form = 0; form < MESH_FORM_COUNT; form++)
        if (formed_mesh_has_corners(form)) check_form(form, true);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(zero_counts_give_an_error_or_a_picture),
        cmocka_unit_test(zero_counts_with_corner_fields_give_an_error_or_a_picture),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
