/* Recentring: the value at a vertex is the mean over its cells (or, for values at corners, over the corners there) on
 * all ranks, with the same bits for any partition. If the field has values on faces of the boundary, a vertex of such
 * faces gets the mean over these instead, even if all of them are on other ranks than its cells.
 *
 * Sums depend on their order, so sums of ranks' partial sums would depend on the partition. Instead all ranks' single
 * values are gathered, sorted, and summed in that order. Vertices with equal keys are one vertex (global ids if all
 * ranks give them, else the bits of the coordinates, -0 as +0), also on a single rank: otherwise a mesh that doubles
 * its vertices along a crack would look different on one rank and on two. The same holds for the meshes on which a
 * layer shows one field, such as blocks and levels of refinement (session_joints.h): by coordinates, since ids belong
 * to one mesh.
 *
 *     local:  vertices -> groups of equal keys -> values of incident cells, group by group -> means
 *     shared: groups inside another rank's box  --(key, values)-->  their home (session_homes.h): merged by key, means
 *             means  <-------------------------------------------
 *
 * Then vertices that hang on larger cells take those cells' values (outer/session_hanging.h).
 *
 * Each field takes two collective deliveries. The first passes errors to all ranks; errors in receiving the means are
 * passed by the next phase. */
#include "session_recentre.h"

#include <stdlib.h>
#include <string.h>

#include "memory.h"
#include "region.h"
#include "session_agree.h"
#include "session_exchange.h"
#include "session_hanging.h"
#include "session_neighbours.h"
#include "session_patches.h"
#include "session_scalars.h"

/* Values by group: those of group g are values[starts[g]] .. values[starts[g + 1] - 1]. */
typedef struct value_groups {
    int64_t count;
    int64_t *starts; /* count + 1 entries */
    double *values;
    double *means;            /* count entries */
    unsigned char *are_faces; /* count entries: the values are those of faces, else those of cells or corners */
} value_groups;

/* This rank's part of one of the meshes. */
typedef struct mesh_part {
    session_scalar *scalar; /* NULL: the mesh does not have the field on this rank */
    grid_field field;       /* the values to recentre */
} mesh_part;

/* The vertices of all parts, numbered consecutively. */
typedef struct vertex_groups {
    bool by_id;
    int part_count;
    mesh_part *parts;
    const session_mesh **meshes; /* one per part; NULL: this rank has no part of the mesh */
    int64_t *firsts;             /* part_count + 1 entries: number of each part's first vertex */
    session_key_table keys;
    int64_t *of_vertex; /* -1: the vertex belongs to no drawn cell */
    int64_t *vertex;    /* if by_id: one vertex of each group */
    value_groups values;
} vertex_groups;

/* ---- values by group ----------------------------------------------------------------------------------------- */

static bool groups_create(value_groups *groups, int64_t count)
{
    *groups = (value_groups){.count = count};
    groups->starts = base_calloc((size_t)count + 1, sizeof *groups->starts);
    groups->means = base_alloc((size_t)count * sizeof *groups->means);
    groups->are_faces = base_calloc((size_t)count, sizeof *groups->are_faces);
    return groups->starts && groups->means && groups->are_faces;
}

/* Allocates the values, after starts[g + 1] was filled with the count of group g. Filling then advances starts[g] to
 * the end of g; groups_close() shifts them back. */
static bool groups_open(value_groups *groups)
{
    for (int64_t g = 0; g < groups->count; g++) groups->starts[g + 1] += groups->starts[g];
    groups->values = base_alloc((size_t)groups->starts[groups->count] * sizeof *groups->values);
    return groups->values != NULL;
}

static void groups_close(value_groups *groups)
{
    for (int64_t g = groups->count; g > 0; g--) groups->starts[g] = groups->starts[g - 1];
    groups->starts[0] = 0;
}

static void groups_free(value_groups *groups)
{
    base_free(groups->starts);
    base_free(groups->values);
    base_free(groups->means);
    base_free(groups->are_faces);
    *groups = (value_groups){0};
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double mean_of(double *values, int64_t count)
{
    double sum = 0;
    if (count == 0) return NAN;
    qsort(values, (size_t)count, sizeof *values, by_value);
    for (int64_t i = 0; i < count; i++) sum += values[i];
    return sum / (double)count;
}

static void groups_average(value_groups *groups, int threads)
{
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t g = 0; g < groups->count; g++)
            groups->means[g] = mean_of(groups->values + groups->starts[g], groups->starts[g + 1] - groups->starts[g]);
        region_leave();
    }
}

/* ---- this rank's part ---------------------------------------------------------------------------------------- */

static session_key key_of_place(const double place[3])
{
    session_key key;
    for (int axis = 0; axis < 3; axis++) {
        const double unsigned_zero = place[axis] + 0.0;
        memcpy(&key.words[axis], &unsigned_zero, sizeof unsigned_zero);
    }
    return key;
}

/* Assigns groups to the vertices of drawn cells. Until then of_vertex is -2 - i for the i-th twin. */
static void group_vertices(const session_mesh *mesh, int64_t first, const session_border *border, vertex_groups *groups)
{
    const grid *g = &mesh->cells;
    int64_t *of_vertex = groups->of_vertex + first;
    for (int64_t v = 0; v < g->vertex_count; v++) of_vertex[v] = -1;
    for (int64_t i = 0; border && i < border->twin_count; i++) of_vertex[border->twins[i].vertex] = -2 - i;
    for (int64_t cell = 0; cell < g->cell_count; cell++) {
        if (grid_is_ghost(g, cell)) continue;
        grid_walk walk = grid_walk_cell(g, cell);
        int64_t vertex;
        while (grid_walk_next(&walk, &vertex)) {
            if (of_vertex[vertex] >= 0) continue;
            const int64_t twin = -2 - of_vertex[vertex];
            const session_key key =
                twin >= 0 ? key_of_place(border->twins[twin].place) : session_vertex_key(mesh, vertex, groups->by_id);
            const int64_t group = session_keys_add(&groups->keys, &key);
            of_vertex[vertex] = group;
            if (groups->by_id) groups->vertex[group] = vertex;
        }
    }
}

static void place_of(const vertex_groups *groups, int64_t group, double place[3])
{
    if (groups->by_id)
        grid_vertex(&groups->meshes[0]->cells, groups->vertex[group], place);
    else
        memcpy(place, groups->keys.keys[group].words, 3 * sizeof *place);
}

/* Gets the value that the cell, or its corner at this vertex, contributes to the vertex; returns false if it
 * contributes none. */
static bool gives(const grid_field *field, int64_t cell, int64_t vertex, double *value)
{
    *value = grid_field_value(field, field->is_cell_centred ? cell : vertex);
    return isfinite(*value);
}

/* Adds each cell's value to the groups of its vertices, once per group; last: per group, the last cell that
 * contributed. Values at corners are each added. The first pass counts, the second stores. */
static void give_values(vertex_groups *groups, int part, int64_t *last, bool is_stored)
{
    const grid *g = &groups->meshes[part]->cells;
    const grid_field *field = &groups->parts[part].field;
    const int64_t *of_vertex = groups->of_vertex + groups->firsts[part];
    value_groups *values = &groups->values;
    double value = 0;
    for (int64_t i = 0; i < groups->keys.count; i++) last[i] = -1;
    for (int64_t cell = 0; cell < g->cell_count; cell++) {
        if (grid_is_ghost(g, cell)) continue;
        grid_walk walk = grid_walk_cell(g, cell);
        int64_t vertex;
        while (grid_walk_next(&walk, &vertex)) {
            const int64_t group = of_vertex[vertex];
            if (values->are_faces[group] || (field->is_cell_centred && last[group] == cell)) continue;
            if (!gives(field, cell, vertex, &value)) continue;
            last[group] = cell;
            if (is_stored)
                values->values[values->starts[group]++] = value;
            else
                values->starts[group + 1]++;
        }
    }
}

static void count_face_values(const session_patch_values *faces, value_groups *values)
{
    for (int64_t i = 0; i < faces->count; i++) {
        values->are_faces[faces->groups[i]] = 1;
        values->starts[faces->groups[i] + 1]++;
    }
}

static void store_face_values(const session_patch_values *faces, value_groups *values)
{
    for (int64_t i = 0; i < faces->count; i++) values->values[values->starts[faces->groups[i]]++] = faces->values[i];
}

/* Collects the values of all parts by group. faces: one per part. */
static bool collect_values(const session_patch_values *faces, vertex_groups *groups)
{
    int64_t *last = base_alloc((size_t)groups->keys.count * sizeof *last);
    if (!last) return false;
    for (int i = 0; i < groups->part_count; i++) count_face_values(&faces[i], &groups->values);
    for (int i = 0; i < groups->part_count; i++)
        if (groups->parts[i].scalar) give_values(groups, i, last, false);
    const bool is_open = groups_open(&groups->values);
    for (int i = 0; i < groups->part_count && is_open; i++) store_face_values(&faces[i], &groups->values);
    for (int i = 0; i < groups->part_count && is_open; i++)
        if (groups->parts[i].scalar) give_values(groups, i, last, true);
    if (is_open) groups_close(&groups->values);
    base_free(last);
    return is_open;
}

static void vertex_groups_free(vertex_groups *groups)
{
    base_free(groups->parts);
    base_free(groups->meshes);
    base_free(groups->firsts);
    session_keys_free(&groups->keys);
    base_free(groups->of_vertex);
    base_free(groups->vertex);
    groups_free(&groups->values);
}

/* Lists this rank's parts of the item's meshes. */
static bool list_parts(const session_recentring *item, const session_meshes *meshes, vertex_groups *groups)
{
    const int count = item->joint->count;
    groups->by_id = item->joint->by_id;
    groups->parts = base_calloc((size_t)count, sizeof *groups->parts);
    groups->meshes = base_calloc((size_t)count, sizeof *groups->meshes);
    groups->firsts = base_calloc((size_t)count + 1, sizeof *groups->firsts);
    if (!groups->parts || !groups->meshes || !groups->firsts) return false;
    groups->part_count = count;
    for (int i = 0; i < count; i++) {
        const session_mesh *mesh = session_find_mesh(meshes, item->joint->meshes[i]->name);
        if (mesh && !mesh->is_given) mesh = NULL;
        mesh_part *part = &groups->parts[i];
        groups->meshes[i] = mesh;
        groups->firsts[i + 1] = groups->firsts[i] + (mesh ? mesh->cells.vertex_count : 0);
        part->scalar = mesh ? session_find_recentred(mesh, item->field, item->component, item->joint->name) : NULL;
        if (part->scalar) part->field = session_given_field(mesh, part->scalar->field, part->scalar->component);
    }
    return true;
}

static bool number_groups(const session_hanging *hanging, vertex_groups *groups)
{
    const int64_t count = groups->firsts[groups->part_count];
    groups->of_vertex = base_alloc((size_t)count * sizeof *groups->of_vertex);
    groups->vertex = groups->by_id ? base_alloc((size_t)count * sizeof *groups->vertex) : NULL;
    if (!groups->of_vertex || (groups->by_id && !groups->vertex) || !session_keys_create(&groups->keys, count))
        return false;
    for (int i = 0; i < groups->part_count; i++)
        if (groups->meshes[i])
            group_vertices(groups->meshes[i], groups->firsts[i],
                           hanging->borders && groups->part_count > 1 ? &hanging->borders[i] : NULL, groups);
    return groups_create(&groups->values, groups->keys.count);
}

static insitu_status average_groups(vertex_groups *groups, int threads, base_error *error)
{
    const int count = groups->part_count;
    session_patch_values *faces = base_calloc((size_t)count, sizeof *faces);
    for (int i = 0; i < count && faces && !error->status; i++) {
        const mesh_part *part = &groups->parts[i];
        const session_vertex_numbers numbers = {&groups->keys, groups->of_vertex + groups->firsts[i], groups->by_id};
        if (part->scalar)
            session_find_patch_values(groups->meshes[i], part->scalar->field, part->scalar->component, &numbers,
                                      &faces[i], error);
    }
    const bool is_done = faces && !error->status && collect_values(faces, groups);
    for (int i = 0; i < count && faces; i++) session_patch_values_free(&faces[i]);
    base_free(faces);
    if (error->status) return error->status;
    if (!is_done) return session_no_memory(error, groups->keys.count * 80, "values recentred to vertices");
    groups_average(&groups->values, threads);
    return INSITU_OK;
}

static insitu_status make_groups(const session_recentring *item, int threads, vertex_groups *groups, base_error *error)
{
    if (!number_groups(&item->joint->hanging, groups))
        return session_no_memory(error, groups->firsts[groups->part_count] * 80, "values recentred to vertices");
    return average_groups(groups, threads, error);
}

/* ---- groups of several ranks --------------------------------------------------------------------------------- */

/* Number of words before the values: the key, and the count, in which the bit FACE_VALUES marks values of faces. */
enum { RECORD_HEAD = 4 };
#define FACE_VALUES (UINT64_C(1) << 63)

typedef struct shared_groups {
    int64_t count;
    int64_t *groups; /* in the order in which they are sent */
    session_mail mail;
} shared_groups;

static int home_of(const session_homes *homes, const vertex_groups *groups, int64_t group)
{
    const session_key *key = &groups->keys.keys[group];
    double point[1][3];
    place_of(groups, group, point[0]);
    return session_home(homes, (const double(*)[3])point, 1, session_key_hash(key), (int64_t)key->words[0]);
}

static int64_t value_count(const value_groups *values, int64_t group)
{
    return values->starts[group + 1] - values->starts[group];
}

static void write_record(const vertex_groups *groups, int64_t group, uint64_t *record)
{
    const int64_t count = value_count(&groups->values, group);
    memcpy(record, groups->keys.keys[group].words, sizeof groups->keys.keys[group].words);
    record[RECORD_HEAD - 1] = (uint64_t)count | (groups->values.are_faces[group] ? FACE_VALUES : 0);
    memcpy(record + RECORD_HEAD, groups->values.values + groups->values.starts[group], (size_t)count * sizeof(double));
}

/* Packs the shared groups into records, sorted by home rank. */
static bool pack_records(const session_homes *homes, const vertex_groups *groups, int ranks, shared_groups *shared)
{
    session_mail *mail = &shared->mail;
    int64_t *places = base_calloc((size_t)ranks * 2, sizeof *places);
    int64_t *ordered = base_alloc((size_t)shared->count * sizeof *ordered);
    int *home = base_alloc((size_t)(shared->count + 1) * sizeof *home);
    mail->counts = base_calloc((size_t)ranks, sizeof *mail->counts);
    if (!places || !ordered || !home || !mail->counts) goto fail;
    int64_t *orders = places + ranks;
    for (int64_t i = 0; i < shared->count; i++) {
        home[i] = home_of(homes, groups, shared->groups[i]);
        mail->counts[home[i]] += RECORD_HEAD + value_count(&groups->values, shared->groups[i]);
        if (home[i] + 1 < ranks) orders[home[i] + 1]++;
    }
    for (int rank = 1; rank < ranks; rank++) {
        places[rank] = places[rank - 1] + mail->counts[rank - 1];
        orders[rank] += orders[rank - 1];
    }
    mail->total = places[ranks - 1] + mail->counts[ranks - 1];
    mail->words = base_alloc((size_t)mail->total * sizeof *mail->words);
    if (!mail->words) goto fail;
    for (int64_t i = 0; i < shared->count; i++) {
        const int64_t group = shared->groups[i];
        write_record(groups, group, mail->words + places[home[i]]);
        places[home[i]] += RECORD_HEAD + value_count(&groups->values, group);
        ordered[orders[home[i]]++] = group;
    }
    base_free(shared->groups);
    shared->groups = ordered;
    base_free(places);
    base_free(home);
    return true;
fail:
    base_free(places);
    base_free(home);
    base_free(ordered);
    return false;
}

static bool find_shared(const vertex_groups *groups, const session_homes *homes, shared_groups *out)
{
    out->groups = base_alloc((size_t)groups->keys.count * sizeof *out->groups);
    if (!out->groups) return false;
    for (int64_t group = 0; group < groups->keys.count; group++) {
        double point[3];
        place_of(groups, group, point);
        if (session_homes_share(homes, point)) out->groups[out->count++] = group;
    }
    return true;
}

/* ---- the homes' part: merge by key --------------------------------------------------------------------------- */

static int64_t record_count(const uint64_t *record)
{
    return (int64_t)(record[RECORD_HEAD - 1] & ~FACE_VALUES);
}

static const uint64_t *next_record(const uint64_t *record)
{
    return record + RECORD_HEAD + record_count(record);
}

/* Returns whether the record has values that its group uses. If any rank has values of faces, those of cells do not
 * count. */
static bool has_values(const uint64_t *record, const value_groups *values, int64_t group)
{
    return !values->are_faces[group] || record[RECORD_HEAD - 1] & FACE_VALUES;
}

/* Stores the mean for each record's key in reply->words and reply->counts. */
static bool merge_records(const session_mail *in, int ranks, int threads, session_mail *reply)
{
    session_key_table keys = {0};
    value_groups values = {0};
    const uint64_t *end = in->words + in->total;
    int64_t records = 0;
    bool is_done = false;
    for (const uint64_t *r = in->words; r < end; r = next_record(r)) records++;
    int64_t *groups = base_alloc((size_t)records * sizeof *groups);
    reply->words = base_alloc((size_t)records * sizeof *reply->words);
    reply->counts = base_calloc((size_t)ranks, sizeof *reply->counts);
    if (!groups || !reply->words || !reply->counts || !session_keys_create(&keys, records)) goto done;
    for (const uint64_t *r = in->words; r < end; r = next_record(r)) {
        session_key key;
        memcpy(key.words, r, sizeof key.words);
        groups[reply->total++] = session_keys_add(&keys, &key);
    }
    if (!groups_create(&values, keys.count)) goto done;
    int64_t i = 0;
    for (const uint64_t *r = in->words; r < end; r = next_record(r), i++)
        if (r[RECORD_HEAD - 1] & FACE_VALUES) values.are_faces[groups[i]] = 1;
    i = 0;
    for (const uint64_t *r = in->words; r < end; r = next_record(r), i++)
        if (has_values(r, &values, groups[i])) values.starts[groups[i] + 1] += record_count(r);
    if (!groups_open(&values)) goto done;
    i = 0;
    for (const uint64_t *r = in->words; r < end; r = next_record(r), i++) {
        const int64_t count = record_count(r);
        if (!has_values(r, &values, groups[i])) continue;
        memcpy(values.values + values.starts[groups[i]], r + RECORD_HEAD, (size_t)count * sizeof(double));
        values.starts[groups[i]] += count;
    }
    groups_close(&values);
    groups_average(&values, threads);
    for (i = 0; i < records; i++) memcpy(&reply->words[i], &values.means[groups[i]], sizeof(double));
    const uint64_t *record = in->words;
    for (int rank = 0; rank < ranks; rank++)
        for (const uint64_t *stop = record + in->counts[rank]; record < stop; record = next_record(record))
            reply->counts[rank]++;
    is_done = true;
done:
    base_free(groups);
    session_keys_free(&keys);
    groups_free(&values);
    return is_done;
}

static insitu_status exchange_means(const session_team *team, const shared_groups *shared, vertex_groups *groups,
                                    base_error *error)
{
    session_mail in = {0}, reply = {0}, means = {0};
    insitu_status status = session_mail_deliver(team->comm, SESSION_MAIL_THERE, &shared->mail, &in, error);
    if (status) return status;
    if (!error->status && !merge_records(&in, team->ranks, team->threads, &reply))
        session_no_memory(error, in.total * 24, "values at vertices that ranks share");
    session_mail_free(&in);
    status = session_mail_deliver(team->comm, SESSION_MAIL_BACK, &reply, &means, error);
    session_mail_free(&reply);
    for (int64_t i = 0; i < shared->count && !status && !error->status; i++)
        memcpy(&groups->values.means[shared->groups[i]], &means.words[i], sizeof(double));
    session_mail_free(&means);
    return status;
}

static insitu_status merge_shared(const session_team *team, const session_homes *homes, vertex_groups *groups,
                                  base_error *error)
{
    shared_groups shared = {0};
    if (!error->status && (!find_shared(groups, homes, &shared) || !pack_records(homes, groups, team->ranks, &shared)))
        session_no_memory(error, groups->keys.count * 40, "values at vertices that ranks share");
    const insitu_status status = exchange_means(team, &shared, groups, error);
    base_free(shared.groups);
    session_mail_free(&shared.mail);
    return status;
}

/* ---- one scalar ---------------------------------------------------------------------------------------------- */

/* Copies the means to the vertices. A corner whose own value is not finite keeps it, so that its cell is not drawn, as
 * without means. A cell's own value is checked elsewhere (grid_field.own). */
static void spread_means(const vertex_groups *groups, int part, int threads)
{
    const int64_t *of_vertex = groups->of_vertex + groups->firsts[part];
    const int64_t count = groups->meshes[part]->cells.vertex_count;
    const grid_field *own = &groups->parts[part].field;
    double *values = groups->parts[part].scalar->vertex_values;
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t v = 0; v < count; v++) {
            const bool is_lost = of_vertex[v] < 0 || (!own->is_cell_centred && !isfinite(grid_field_value(own, v)));
            values[v] = is_lost ? NAN : groups->values.means[of_vertex[v]];
        }
        region_leave();
    }
}

/* Returns whether any of the meshes has values of cells. Values at corners are not constrained: codes that have them do
 * so themselves. */
static bool is_of_cells(const session_recentring *item)
{
    for (int i = 0; i < item->joint->count; i++)
        if (session_catalogue_find(item->joint->meshes[i], item->field)->centring == INSITU_CELL) return true;
    return false;
}

static insitu_status constrain_hanging(const session_recentring *item, const session_team *team, vertex_groups *groups,
                                       base_error *error)
{
    session_hanging *hanging = &item->joint->hanging;
    const session_hanging_basis basis = {item->joint, groups->meshes, groups->firsts, groups->of_vertex,
                                         groups->keys.count};
    const insitu_status status = session_update_hanging(&basis, team, error);
    return status ? status : session_constrain_hanging(hanging, team, groups->values.means, error);
}

/* Allocates the values of each part. */
static void make_room(const vertex_groups *groups, base_error *error)
{
    for (int i = 0; i < groups->part_count; i++) {
        session_scalar *scalar = groups->parts[i].scalar;
        if (!scalar || scalar->vertex_values) continue;
        const int64_t count = groups->meshes[i]->cells.vertex_count;
        scalar->vertex_values = base_alloc((size_t)count * sizeof(double));
        if (!scalar->vertex_values) session_no_memory(error, count * (int64_t)sizeof(double), "recentred values");
    }
}

static void keep_means(const vertex_groups *groups, const session_joint *joint, int threads)
{
    for (int i = 0; i < groups->part_count; i++) {
        session_scalar *scalar = groups->parts[i].scalar;
        if (!scalar) continue;
        spread_means(groups, i, threads);
        scalar->are_values_stale = false;
        scalar->made++;
        scalar->of_places = joint->places;
        scalar->is_suspect = true;
    }
}

static insitu_status recentre(const session_recentring *item, const session_meshes *meshes, const session_team *team,
                              base_error *error)
{
    const session_homes *homes = item->joint->homes;
    vertex_groups groups = {0};
    insitu_status status = INSITU_OK;
    const bool is_listed = list_parts(item, meshes, &groups);
    if (!is_listed) session_no_memory(error, item->joint->count * 64LL, "values recentred to vertices");
    if (item->joint->count > 1 || is_of_cells(item))
        status = session_update_borders(item->joint, groups.meshes, team, error);
    if (!status && is_listed && !make_groups(item, team->threads, &groups, error)) make_room(&groups, error);
    if (!status)
        status = team->ranks > 1 ? merge_shared(team, homes, &groups, error) : session_agree(team->comm, error);
    if (!status && is_of_cells(item)) status = constrain_hanging(item, team, &groups, error);
    if (!status && !error->status) keep_means(&groups, item->joint, team->threads);
    vertex_groups_free(&groups);
    return status;
}

static bool is_stale(const session_recentring *item, const session_meshes *meshes)
{
    for (int i = 0; i < item->joint->count; i++) {
        const session_mesh *mesh = session_find_mesh(meshes, item->joint->meshes[i]->name);
        const session_scalar *scalar =
            mesh ? session_find_recentred(mesh, item->field, item->component, item->joint->name) : NULL;
        if (scalar && (scalar->are_values_stale || scalar->of_places != item->joint->places)) return true;
    }
    return false;
}

bool session_add_recentring(session_recentring **items, int *count, const session_recentring *item)
{
    for (int i = 0; i < *count; i++) {
        const session_recentring *other = &(*items)[i];
        if (other->joint == item->joint && strcmp(other->field, item->field) == 0 &&
            other->component == item->component)
            return true;
    }
    session_recentring *more = base_realloc(*items, (size_t)(*count + 1) * sizeof *more);
    if (!more) return false;
    *items = more;
    more[(*count)++] = *item;
    return true;
}

insitu_status session_recentre(const session_recentring *items, int count, int *stale, const session_meshes *meshes,
                               const session_team *team, base_error *error)
{
    if (count == 0) return INSITU_OK;
    for (int i = 0; i < count; i++) stale[i] = is_stale(&items[i], meshes);
    insitu_status status =
        session_mpi(error, MPI_Allreduce(MPI_IN_PLACE, stale, count, MPI_INT, MPI_MAX, team->comm), "MPI_Allreduce");
    for (int i = 0; i < count && !status; i++)
        if (stale[i]) status = recentre(&items[i], meshes, team, error);
    return status;
}
