/* Checks the strides of every array of every form of mesh, of its fields, patches and components. If elements with a
 * stride could not lie in memory, the call must refuse it at once and name the array, its count and its stride, and all
 * ranks must return the same error. Arrays that are read backwards must give the same pictures as arrays that are read
 * forwards. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_effort.h"
#include "test_mesh_forms.h"

enum { SIDE = 3, MOST = 40 };

/* A stride in a description, with the name that messages use for its array, and the number of elements. */
typedef struct strided {
    const char *name;
    int64_t *stride;
    int64_t count;
    insitu_array *array; /* NULL if it is the stride between components */
} strided;

static int append_strided_array(strided *list, int at, const char *name, insitu_array *array, int64_t count)
{
    list[at] = (strided){name, &array->stride_bytes, count, array};
    return at + (array->data && count > 0);
}

static int list_mesh_arrays(insitu_mesh *m, strided *out)
{
    int at = 0;
    at = append_strided_array(out, at, "x coordinates", &m->coordinates[0], m->vertex_count);
    at = append_strided_array(out, at, "y coordinates", &m->coordinates[1], m->vertex_count);
    at = append_strided_array(out, at, "z coordinates", &m->coordinates[2], m->vertex_count);
    at = append_strided_array(out, at, "vertex ids", &m->vertex_ids, m->vertex_count);
    at = append_strided_array(out, at, "cell types", &m->cell_types, m->cell_count);
    at = append_strided_array(out, at, "offsets", &m->offsets, m->cell_count + 1);
    at = append_strided_array(out, at, "ghost flags", &m->ghosts, m->cell_count);
    at = append_strided_array(out, at, "connectivity indices", &m->connectivity, m->connectivity_count);
    at = append_strided_array(out, at, "face offsets", &m->face_offsets, m->face_count + 1);
    at = append_strided_array(out, at, "face vertex indices", &m->face_connectivity, m->face_connectivity_count);
    at = append_strided_array(out, at, "face sizes", &m->face_sizes, m->face_count);
    at = append_strided_array(out, at, "face lists", &m->face_lists, m->face_count);
    at = append_strided_array(out, at, "owners of faces", &m->owner, m->face_count);
    at = append_strided_array(out, at, "neighbours of faces", &m->neighbour, m->neighbour_count);
    return at;
}

static int list_field_arrays(formed_mesh *m, strided *out, int at)
{
    insitu_field *c = &m->fields[FORMED_C], *i = &m->fields[FORMED_I];
    at = append_strided_array(out, at, "values", &m->fields[FORMED_F].values, m->fields[FORMED_F].count);
    at = append_strided_array(out, at, "values", &c->values, c->count);
    at = append_strided_array(out, at, "values", &i->values, i->count);
    at = append_strided_array(out, at, "entries of index", &i->index, i->count);
    if (formed_mesh_has_corners(m->form))
        at = append_strided_array(out, at, "values", &m->fields[FORMED_D].values, m->fields[FORMED_D].count);
    out[at++] = (strided){"components of values", &c->component_stride_bytes, c->component_count, NULL};
    if (!c->patch_count) return at;
    at = append_strided_array(out, at, "patch 0: values", &m->patch.values, m->patch.count);
    out[at++] = (strided){"patch 0: components of values", &m->patch.component_stride_bytes, c->component_count, NULL};
    return at;
}

/* Describes the patch's faces by their vertices and offsets, or by a list of their numbers; appends the arrays of this
 * description to the list. */
static int list_patch_arrays(formed_mesh *m, strided *out)
{
    static int64_t offsets[2], number[1];
    insitu_patch *p = &m->patch;
    const int64_t face = p->first_face - m->mesh.index_base;
    if (!m->fields[FORMED_C].patch_count) return 0;
    number[0] = p->first_face;
    if (m->form == MESH_OWNER) {
        p->faces = (insitu_array){number, INSITU_INT64, 0};
        return append_strided_array(out, 0, "patch 0: faces", &p->faces, 1);
    }
    offsets[0] = m->mesh.index_base;
    p->connectivity_count = m->faces.offsets[face + 1] - m->faces.offsets[face];
    offsets[1] = offsets[0] + p->connectivity_count;
    p->connectivity = (insitu_array){m->faces.narrow_vertices + m->faces.offsets[face], INSITU_INT32, 0};
    p->offsets = (insitu_array){offsets, INSITU_INT64, 0};
    const int at =
        append_strided_array(out, 0, "patch 0: connectivity indices", &p->connectivity, p->connectivity_count);
    return append_strided_array(out, at, "patch 0: offsets", &p->offsets, 2);
}

/* ---- strides beyond memory ------------------------------------------------------------------------------------- */

static const int64_t wild[] = {(int64_t)1 << 60,    (int64_t)1 << 62, (int64_t)1 << 49,   INT64_MIN,
                               -((int64_t)1 << 60), INT64_MAX - 7,    -((int64_t)1 << 49)};

/* Sets each invalid stride on the last rank, and checks that all ranks get the error. In the usual run on several
 * ranks, where each error takes a step of all ranks, each array has one of the strides, and the next array the next
 * one. */
static void check_strides_are_refused(insitu_session *session, formed_mesh *m, const strided *s, bool is_last)
{
    const size_t count = sizeof wild / sizeof wild[0];
    static size_t turn;
    turn++;
    for (size_t i = 0; i < count; i++) {
        char words[2][64];
        if (rank_count > 1 && !test_is_long_run() && i != turn % count) continue;
        const int64_t right = *s->stride;
        snprintf(words[0], sizeof words[0], "%s have a stride of %lld bytes", s->name, (long long)wild[i]);
        snprintf(words[1], sizeof words[1], ": %lld of them lie outside of memory", (long long)s->count);
        discard_pictures();
        if (is_last) *s->stride = wild[i];
        const insitu_status at_once = formed_mesh_submit(session, m, formed_mesh_has_corners(m->form));
        *s->stride = right;
        char reported[1024];
        const insitu_status status = insitu_step(session, 1, 0);
        const bool is_well = is_last == (at_once != INSITU_OK) && status;
        if (!is_well) fprintf(stderr, "%s: %s: %lld\n", mesh_form_name(m->form), s->name, (long long)wild[i]);
        assert_true(is_well);
        snprintf(reported, sizeof reported, "%s", insitu_error(session));
        const bool has_words = strstr(reported, words[0]) && strstr(reported, words[1]);
        if (is_last && !has_words) fprintf(stderr, "%s; %s%s\n", reported, words[0], words[1]);
        assert_true(!is_last || has_words);
        assert_true(strstr(reported, "have a stride of "));
    }
}

/* Checks that invalid strides of each array in the list are refused. The lists of all ranks must have the same length,
 * because the checks are collective. */
static void check_all_strides_are_refused(insitu_session *session, formed_mesh *m, const strided *list, int count)
{
    int most = count;
    MPI_Allreduce(MPI_IN_PLACE, &most, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
    everywhere(count == most);
    for (int i = 0; i < count; i++) check_strides_are_refused(session, m, &list[i], own_rank == rank_count - 1);
}

static void strides_beyond_memory_are_refused(void **state)
{
    (void)state;
    strided list[MOST];
    for (mesh_form form = 0; form < MESH_FORM_COUNT; form++) {
        formed_mesh m;
        formed_mesh_create(form, SIDE, own_rank, rank_count, &m);
        const bool is_discontinuous = formed_mesh_has_corners(form);
        insitu_session *session =
            open_session(MPI_COMM_WORLD, write_scene(is_discontinuous ? formed_corner_scene : formed_scene));
        check_all_strides_are_refused(session, &m, list, list_mesh_arrays(&m.mesh, list));
        check_all_strides_are_refused(session, &m, list, list_field_arrays(&m, list, 0));
        check_all_strides_are_refused(session, &m, list, list_patch_arrays(&m, list));
        everywhere(formed_mesh_submit(session, &m, is_discontinuous) == INSITU_OK);
        const insitu_status status = insitu_step(session, 2, 0);
        check_reported_everywhere(session, status, INSITU_OK, "");
        insitu_destroy(&session);
        formed_mesh_free(&m);
    }
}

/* ---- rows of entries ------------------------------------------------------------------------------------------- */

static void rows_beyond_memory_are_refused(void **state)
{
    (void)state;
    formed_mesh m;
    formed_mesh_create(MESH_ROWS, SIDE, own_rank, rank_count, &m);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(formed_corner_scene));
    for (size_t i = 0; i < sizeof wild / sizeof wild[0]; i++) {
        char words[64];
        insitu_field *d = &m.fields[FORMED_D];
        snprintf(words, sizeof words, "connectivity_row is %lld", (long long)wild[i]);
        m.mesh.connectivity_row = wild[i];
        everywhere(formed_mesh_submit(session, &m, false) == INSITU_ERROR_MESH);
        everywhere(insitu_set_mesh(session, "m", &m.mesh) == INSITU_ERROR_MESH);
        everywhere(strstr(insitu_error(session), wild[i] < 0 ? words : "too few for") != NULL);
        m.mesh.connectivity_row = 9;
        everywhere(formed_mesh_submit(session, &m, true) == INSITU_OK);
        snprintf(words, sizeof words, "corner_row is %lld", (long long)wild[i]);
        d->corner_row = wild[i];
        everywhere(insitu_set_field(session, "m", d) == INSITU_ERROR_FIELD);
        everywhere(strstr(insitu_error(session), wild[i] == (int64_t)1 << 49 ? "has " : words) != NULL);
        d->corner_row = 0;
    }
    everywhere(formed_mesh_submit(session, &m, true) == INSITU_OK);
    const insitu_status status = insitu_step(session, 2, 0);
    check_reported_everywhere(session, status, INSITU_OK, "");
    insitu_destroy(&session);
    formed_mesh_free(&m);
}

/* ---- arrays read backwards ------------------------------------------------------------------------------------- */

static int64_t get_element_size(const strided *s)
{
    const insitu_type type = s->array->type;
    return strstr(s->name, "lists")                         ? (int64_t)sizeof(void *)
           : type == INSITU_UINT8                           ? 1
           : type == INSITU_FLOAT32 || type == INSITU_INT32 ? 4
                                                            : 8;
}

/* Copies the elements, each of `bytes` bytes, in reverse order. The array then begins at the copy's last element, and
 * has a negative stride. */
static void *copy_in_reverse(const strided *s, int64_t bytes)
{
    const int64_t from_stride = *s->stride ? *s->stride : bytes;
    char *copy = test_calloc((size_t)s->count + 1, (size_t)bytes);
    for (int64_t i = 0; i < s->count; i++)
        memcpy(copy + (s->count - 1 - i) * bytes, (const char *)s->array->data + i * from_stride, (size_t)bytes);
    s->array->data = copy + (s->count - 1) * bytes;
    *s->stride = -bytes;
    return copy;
}

static int draw_mesh(const char *scene, const formed_mesh *m, caught_picture *out)
{
    insitu_session *session = open_session(MPI_COMM_WORLD, scene);
    discard_pictures();
    everywhere(formed_mesh_submit(session, m, formed_mesh_has_corners(m->form)) == INSITU_OK);
    const insitu_status status = insitu_step(session, 0, 0);
    check_reported_everywhere(session, status, INSITU_OK, "");
    const int count = caught_count;
    for (int i = 0; i < count; i++) out[i] = caught[i];
    caught_count = 0;
    insitu_destroy(&session);
    return count;
}

static void draw_backwards(mesh_form form, const char *scene)
{
    strided list[MOST];
    void *copies[MOST];
    caught_picture pictures[2][FORMED_PICTURES];
    formed_mesh m;
    int count = 0, copy_count = 0;
    formed_mesh_create(form, SIDE, own_rank, rank_count, &m);
    const int pictures_count = draw_mesh(scene, &m, pictures[0]);
    count = list_mesh_arrays(&m.mesh, list);
    count = list_field_arrays(&m, list, count);
    for (int i = 0; i < count; i++) {
        if (!list[i].array) continue;
        const bool are_vectors = list[i].array == &m.fields[FORMED_C].values || list[i].array == &m.patch.values;
        copies[copy_count++] = copy_in_reverse(&list[i], get_element_size(&list[i]) * (are_vectors ? 3 : 1));
    }
    everywhere(draw_mesh(scene, &m, pictures[1]) == pictures_count);
    bool are_same = true;
    for (int i = 0; i < pictures_count; i++) {
        const size_t pixels = (size_t)pictures[0][i].width * (size_t)pictures[0][i].height;
        are_same = are_same && memcmp(pictures[0][i].rgba, pictures[1][i].rgba, pixels * 4 * sizeof(float)) == 0;
        for (int n = 0; n < 2; n++) free_caught(&pictures[n][i]);
    }
    if (!are_same) fprintf(stderr, "%s\n", mesh_form_name(form));
    everywhere(are_same);
    for (int i = 0; i < copy_count; i++) test_free(copies[i]);
    formed_mesh_free(&m);
}

static void negative_strides_read_arrays_backwards(void **state)
{
    (void)state;
    for (mesh_form form = 0; form < MESH_FORM_COUNT; form++) {
        draw_backwards(form, write_scene(formed_scene));
        if (formed_mesh_has_corners(form)) draw_backwards(form, write_scene(formed_corner_scene));
    }
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(strides_beyond_memory_are_refused),
        cmocka_unit_test(rows_beyond_memory_are_refused),
        cmocka_unit_test(negative_strides_read_arrays_backwards),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
