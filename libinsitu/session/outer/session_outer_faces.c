/* Faces that two cells share cancel. A face's key is made of its vertices' hashes in no order: their first three power
 * sums. All faces' keys are put into slots by exclusive or, so that shared faces leave nothing behind. A second pass
 * takes the faces whose slots are not empty, mostly outer ones, and counts them exactly. So memory is needed for the
 * slots and the outer faces, not for all faces.
 *
 * Shells are faces that are always kept. One that lies on a cell's outer face replaces it, so that only one is drawn
 * there.
 *
 * Of the faces that a rank has once, those in other ranks' boxes go to their home (session_homes.h), which counts them
 * for all. */
#include "session_outer_faces.h"

#include <string.h>

#include "memory.h"
#include "region.h"
#include "session_agree.h"
#include "session_cell_faces.h"
#include "session_neighbours.h"
#include "session_thresholds.h"

enum { LEAST_SLOTS = 1 << 10, MOST_SLOTS = 1 << 22 };

typedef struct face_search {
    const session_mesh *mesh;
    int threads;
    unsigned char *is_hidden; /* a byte a cell, not 0 for those beyond the threshold; NULL: there is no threshold */
    uint64_t *hashes;         /* one for each vertex of the mesh */
    uint64_t *slots;
    uint64_t mask;
    int64_t count;
    session_face *faces; /* whose slots are not empty */
    session_key *keys;
    int64_t *groups; /* faces with equal keys share a group */
    int64_t *sizes;  /* the number of faces in each group */
} face_search;

static void search_free(face_search *s)
{
    base_free(s->is_hidden);
    base_free(s->hashes);
    base_free(s->slots);
    base_free(s->faces);
    base_free(s->keys);
    base_free(s->groups);
    base_free(s->sizes);
}

/* ---- keys ---------------------------------------------------------------------------------------------------- */

/* Makes a face's key; false where it has fewer than three vertices. A vertex that it has twice counts once: a quad with
 * two corners in one place is a triangle. */
static bool make_key(const face_search *s, const session_face_loop *loop, session_key *key)
{
    uint64_t sums[3] = {0, 0, 0}, vertices = 0;
    for (int64_t i = 0; i < loop->size; i++) {
        const uint64_t h = s->hashes[session_face_vertex(loop, i)];
        bool is_new = true;
        for (int64_t k = 0; k < i && is_new; k++) is_new = s->hashes[session_face_vertex(loop, k)] != h;
        if (!is_new) continue;
        vertices++;
        sums[0] += h;
        sums[1] += h * h;
        sums[2] += h * h * h;
    }
    sums[0] ^= vertices * 0x9e3779b97f4a7c15u;
    memcpy(key->words, sums, sizeof key->words);
    return vertices >= 3;
}

/* ---- this rank's part ---------------------------------------------------------------------------------------- */

static bool has_faces(const face_search *s, int64_t cell)
{
    return !grid_is_ghost(&s->mesh->cells, cell) && !(s->is_hidden && s->is_hidden[cell]);
}

static void hash_vertices(face_search *s, bool by_id)
{
    const int64_t count = s->mesh->cells.vertex_count;
#pragma omp parallel num_threads(s->threads)
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t v = 0; v < count; v++) {
            const session_key key = session_vertex_key(s->mesh, v, by_id);
            s->hashes[v] = session_key_hash(&key);
        }
        region_leave();
    }
}

static void cancel_faces(face_search *s)
{
    const grid *g = &s->mesh->cells;
#pragma omp parallel num_threads(s->threads)
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t cell = 0; cell < g->cell_count; cell++) {
            if (!has_faces(s, cell)) continue;
            const session_cell_faces faces = session_faces_of_cell(g, cell);
            for (int64_t f = 0; f < faces.count; f++) {
                const session_face_loop loop = session_face_of(&faces, f);
                session_key key;
                if (!make_key(s, &loop, &key)) continue;
                const uint64_t hash = session_key_hash(&key);
                uint64_t *slot = &s->slots[hash & s->mask];
#pragma omp atomic
                *slot ^= hash;
            }
        }
        region_leave();
    }
}

/* Counts the faces of one cell whose slots are not empty, and lists them where faces is given. */
static int64_t take_faces(const face_search *s, int64_t cell, session_face *faces, session_key *keys)
{
    const session_cell_faces of_cell = session_faces_of_cell(&s->mesh->cells, cell);
    int64_t count = 0;
    if (!has_faces(s, cell)) return 0;
    for (int64_t f = 0; f < of_cell.count; f++) {
        const session_face_loop loop = session_face_of(&of_cell, f);
        session_key key;
        if (!make_key(s, &loop, &key)) continue;
        if (!of_cell.size && !s->slots[session_key_hash(&key) & s->mask]) continue;
        if (faces) {
            faces[count] = (session_face){cell, f};
            keys[count] = key;
        }
        count++;
    }
    return count;
}

static bool collect_faces(face_search *s)
{
    const int64_t cells = s->mesh->cells.cell_count;
    int64_t count = 0;
#pragma omp parallel num_threads(s->threads)
    {
        region_enter();
#pragma omp for schedule(static) reduction(+ : count) nowait
        for (int64_t cell = 0; cell < cells; cell++) count += take_faces(s, cell, NULL, NULL);
        region_leave();
    }
    s->faces = base_alloc((size_t)count * sizeof *s->faces);
    s->keys = base_alloc((size_t)count * sizeof *s->keys);
    if (!s->faces || !s->keys) return false;
    for (int64_t cell = 0; cell < cells; cell++)
        s->count += take_faces(s, cell, s->faces + s->count, s->keys + s->count);
    return true;
}

/* Counts the groups of equal keys, and their sizes. */
static bool count_keys(const session_key *keys, int64_t count, int64_t **groups, int64_t **sizes)
{
    session_key_table table = {0};
    *groups = base_alloc((size_t)count * sizeof **groups);
    *sizes = base_calloc((size_t)count, sizeof **sizes);
    if (!*groups || !*sizes || !session_keys_create(&table, count)) return false;
    for (int64_t i = 0; i < count; i++) {
        (*groups)[i] = session_keys_add(&table, &keys[i]);
        (*sizes)[(*groups)[i]]++;
    }
    session_keys_free(&table);
    return true;
}

static bool is_shell(const face_search *s, const session_face *face)
{
    return grid_is_shell_type(grid_cell_type(&s->mesh->cells, face->cell));
}

static void keep_single_faces(face_search *s)
{
    int64_t kept = 0;
    for (int64_t i = 0; i < s->count; i++) {
        if (s->sizes[s->groups[i]] != 1 && !is_shell(s, &s->faces[i])) continue;
        s->faces[kept] = s->faces[i];
        s->keys[kept++] = s->keys[i];
    }
    s->count = kept;
}

/* Finds no faces where this rank has no part of the mesh, or one without cells: that may lack the ids that all cells'
 * vertices have. */
static insitu_status search_own(face_search *s, const session_outer *outer, bool by_id, base_error *error)
{
    if (!s->mesh || s->mesh->cells.cell_count == 0) return INSITU_OK;
    if (outer->threshold.is_given) {
        s->is_hidden = session_hidden_cells(s->mesh, &outer->threshold, s->threads);
        if (!s->is_hidden) return session_no_memory(error, s->mesh->cells.cell_count, "cells of a threshold");
    }
    const grid *g = &s->mesh->cells;
    uint64_t slots = LEAST_SLOTS;
    while (slots < MOST_SLOTS && slots < (uint64_t)g->cell_count) slots *= 2;
    s->mask = slots - 1;
    s->hashes = base_alloc((size_t)g->vertex_count * sizeof *s->hashes);
    s->slots = base_calloc(slots, sizeof *s->slots);
    bool is_done = s->hashes && s->slots;
    if (is_done) {
        hash_vertices(s, by_id);
        cancel_faces(s);
    }
    is_done = is_done && collect_faces(s) && count_keys(s->keys, s->count, &s->groups, &s->sizes);
    if (!is_done) return session_no_memory(error, g->vertex_count * 8 + (int64_t)slots * 8, "outer faces");
    keep_single_faces(s);
    return INSITU_OK;
}

/* ---- what ranks share ---------------------------------------------------------------------------------------- */

enum { KEY_WORDS = 3 };

/* Returns the home of a face whose vertices are all in other ranks' boxes, or -1 where it is this rank's alone. The
 * home is that of the face's first vertex in an order by hashes, which is the same on all ranks. */
static int home_of(const face_search *s, const session_homes *homes, int64_t face)
{
    const session_cell_faces faces = session_faces_of_cell(&s->mesh->cells, s->faces[face].cell);
    const session_face_loop loop = session_face_of(&faces, s->faces[face].face);
    int64_t first = session_face_vertex(&loop, 0);
    double point[1][3];
    for (int64_t i = 0; i < loop.size; i++) {
        const int64_t vertex = session_face_vertex(&loop, i);
        grid_vertex(&s->mesh->cells, vertex, point[0]);
        if (!session_homes_share(homes, point[0])) return -1;
        if (s->hashes[vertex] < s->hashes[first]) first = vertex;
    }
    grid_vertex(&s->mesh->cells, first, point[0]);
    const session_key key = session_vertex_key(s->mesh, first, homes->by_id);
    return session_home(homes, (const double(*)[3])point, 1, session_key_hash(&s->keys[face]), (int64_t)key.words[0]);
}

/* Packs the keys of faces in other ranks' boxes by their homes. order gets the face of each key. */
static bool pack_keys(const face_search *s, const session_homes *homes, int ranks, session_mail *mail, int64_t **order)
{
    int64_t *places = base_calloc((size_t)ranks + 1, sizeof *places);
    int *home = base_alloc((size_t)(s->count + 1) * sizeof *home);
    mail->counts = base_calloc((size_t)ranks, sizeof *mail->counts);
    bool is_done = places && home && mail->counts;
    for (int64_t i = 0; i < s->count && is_done; i++) {
        home[i] = home_of(s, homes, i);
        if (home[i] >= 0) places[home[i] + 1]++;
    }
    for (int rank = 0; rank < ranks && is_done; rank++) {
        mail->counts[rank] = KEY_WORDS * places[rank + 1];
        mail->total += mail->counts[rank];
        places[rank + 1] += places[rank];
    }
    mail->words = base_alloc((size_t)mail->total * sizeof *mail->words);
    *order = base_alloc((size_t)mail->total * sizeof **order);
    is_done = is_done && mail->words && *order;
    for (int64_t i = 0; i < s->count && is_done; i++) {
        if (home[i] < 0) continue;
        const int64_t place = places[home[i]]++;
        memcpy(mail->words + KEY_WORDS * place, s->keys[i].words, KEY_WORDS * sizeof *mail->words);
        (*order)[place] = i;
    }
    base_free(places);
    base_free(home);
    return is_done;
}

/* Answers for each key how often it came. */
static bool answer_keys(const session_mail *in, int ranks, session_mail *reply)
{
    const int64_t count = in->total / KEY_WORDS;
    int64_t *groups = NULL, *sizes = NULL;
    reply->counts = base_calloc((size_t)ranks, sizeof *reply->counts);
    reply->words = base_alloc((size_t)count * sizeof *reply->words);
    session_key *keys = base_alloc((size_t)count * sizeof *keys);
    bool is_done = reply->counts && reply->words && keys;
    for (int64_t i = 0; i < count && is_done; i++)
        memcpy(keys[i].words, in->words + KEY_WORDS * i, sizeof keys[i].words);
    is_done = is_done && count_keys(keys, count, &groups, &sizes);
    for (int64_t i = 0; i < count && is_done; i++) reply->words[i] = (uint64_t)sizes[groups[i]];
    for (int rank = 0; rank < ranks && is_done; rank++) reply->counts[rank] = in->counts[rank] / KEY_WORDS;
    reply->total = count;
    base_free(groups);
    base_free(sizes);
    base_free(keys);
    return is_done;
}

static void drop_shared(face_search *s, const session_mail *answers, const int64_t *order)
{
    int64_t kept = 0;
    for (int64_t i = 0; i < answers->total; i++)
        if (answers->words[i] > 1 && !is_shell(s, &s->faces[order[i]])) s->faces[order[i]].cell = -1;
    for (int64_t i = 0; i < s->count; i++)
        if (s->faces[i].cell >= 0) s->faces[kept++] = s->faces[i];
    s->count = kept;
}

static insitu_status exchange_keys(face_search *s, const session_mail *mail, const int64_t *order,
                                   const session_team *team, base_error *error)
{
    session_mail in = {0}, reply = {0}, answers = {0};
    insitu_status status = session_mail_deliver(team->comm, SESSION_MAIL_THERE, mail, &in, error);
    if (status) return status;
    if (!error->status && !answer_keys(&in, team->ranks, &reply))
        session_no_memory(error, in.total * 24, "faces that ranks share");
    status = session_mail_deliver(team->comm, SESSION_MAIL_BACK, &reply, &answers, error);
    if (!status) status = session_agree(team->comm, error);
    if (!status) drop_shared(s, &answers, order);
    session_mail_free(&in);
    session_mail_free(&reply);
    session_mail_free(&answers);
    return status;
}

static insitu_status search_shared(face_search *s, const session_homes *homes, const session_team *team,
                                   base_error *error)
{
    session_mail mail = {0};
    int64_t *order = NULL;
    if (!error->status && !pack_keys(s, homes, team->ranks, &mail, &order))
        session_no_memory(error, s->count * 40, "faces that ranks share");
    const insitu_status status = exchange_keys(s, &mail, order, team, error);
    session_mail_free(&mail);
    base_free(order);
    return status;
}

static void mark_border(const face_search *s, unsigned char *is_border)
{
    for (int64_t i = 0; i < s->count; i++) {
        const session_cell_faces faces = session_faces_of_cell(&s->mesh->cells, s->faces[i].cell);
        const session_face_loop loop = session_face_of(&faces, s->faces[i].face);
        for (int64_t k = 0; k < loop.size; k++) is_border[session_face_vertex(&loop, k)] = 1;
    }
}

insitu_status session_find_outer_faces(const session_mesh *mesh, session_outer *outer, const session_homes *homes,
                                       const session_team *team, unsigned char *is_border, base_error *error)
{
    face_search search = {.mesh = mesh, .threads = team->threads};
    search_own(&search, outer, homes->by_id, error);
    if (is_border && !error->status) mark_border(&search, is_border);
    const insitu_status status =
        team->ranks > 1 ? search_shared(&search, homes, team, error) : session_agree(team->comm, error);
    if (!status && mesh) {
        session_drop_outer(outer, true);
        outer->face_count = search.count;
        outer->faces = search.faces;
        outer->are_faces_known = true;
        search.faces = NULL;
    }
    search_free(&search);
    return status;
}
