/* Recentring computes values at vertices. The value at a vertex is the mean of the values of the caller's cells that
 * have this vertex, on all ranks. The result is bit-identical for any partition. For corner fields, the mean is over
 * the corners at this vertex; for values at vertices of refined blocks, it is over all vertices at the same position.
 * If the field has values on faces of the boundary, a vertex of such faces gets the mean of the values of these faces
 * instead, even if the faces are on other ranks.
 *
 * Rounding of a sum depends on the order of its terms, so that adding partial sums of ranks would make the result
 * depend on the partition. Instead, the individual values of all ranks are gathered and added by sum_values(), whose
 * result does not depend on the order.
 *
 *     local:  groups of equal vertices (session_vertex_groups.h) -> values of the cells around each -> means
 *     shared: groups inside another rank's box  --(key, values)-->  their home (session_homes.h): merged by key, means
 *             means  <-------------------------------------------
 *
 * Then vertices that hang on faces of larger cells get the values interpolated on these faces
 * (outer/session_hanging.h).
 *
 * Each field takes two collective exchanges of messages. The first one also sends errors to all ranks. An error in
 * receiving the means is sent to the other ranks in the next phase of the step. */
#include "session_recentre.h"

#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_exchange.h"
#include "session_hanging.h"
#include "session_patches.h"
#include "session_region.h"
#include "session_scalars.h"
#include "session_vertex_groups.h"

/* Values sorted by the groups of equal vertices to which they belong. Those of group g are values[starts[g]] to
 * values[ends[g] - 1]. There is space up to starts[g + 1], because a cell whose value is not finite contributes
 * none. */
typedef struct value_groups {
    int64_t count;
    const int64_t *starts; /* index of each group's first value; count + 1 entries */
    int64_t *ends;         /* index after each group's last value; count entries */
    double *values;
    double *means; /* mean of each group; count entries */
    /* for each group, nonzero if its values come from boundary faces, and 0 if they come from cells or corners; count
     * entries */
    unsigned char *has_face_values;
} value_groups;

/* One of this rank's parts of the meshes whose values are recentred. */
typedef struct mesh_part {
    session_scalar *scalar; /* scalar that gets the recentred values; NULL: the part does not have the field */
    bool is_of_vertices;    /* set if the field has one value per vertex, and not per cell or corner */
    grid_field field;       /* the values that are averaged to vertices */
} mesh_part;

/* The data of one recentring on this rank. mesh_group->groups are the groups of equal vertices. */
typedef struct recentring {
    session_mesh_group *mesh_group;
    session_mesh_group_parts list;
    mesh_part *parts; /* for each part in the list, its field and the scalar that gets the means */
    /* index of each group's first value if faces of the boundary have values; NULL: no face has a value, and
     * corner_starts in mesh_group->groups is used */
    int64_t *starts;
    value_groups values; /* the values to be averaged, sorted by the groups of mesh_group->groups */
} recentring;

/* ---- means of groups of equal vertices --------------------------------------------------------------------------- */

/* Initializes groups that have no values yet. The caller keeps ownership of the array `starts`. */
static bool create_value_groups(value_groups *groups, int64_t count, const int64_t *starts)
{
    *groups = (value_groups){.count = count, .starts = starts};
    groups->ends = base_alloc((size_t)count * sizeof *groups->ends);
    groups->values = base_alloc((size_t)starts[count] * sizeof *groups->values);
    groups->means = base_alloc((size_t)count * sizeof *groups->means);
    groups->has_face_values = base_calloc((size_t)count, sizeof *groups->has_face_values);
    if (!groups->ends || !groups->values || !groups->means || !groups->has_face_values) return false;
    memcpy(groups->ends, starts, (size_t)count * sizeof *starts);
    return true;
}

static void groups_free(value_groups *groups)
{
    base_free(groups->ends);
    base_free(groups->values);
    base_free(groups->means);
    base_free(groups->has_face_values);
    *groups = (value_groups){0};
}

/* Returns the sum of finite values, each multiplied by scale. largest: the largest absolute value. The bits of the sum
 * do not depend on the order of the values. Each value is split into a multiple of a unit and a remainder. The unit is
 * so coarse, compared with the largest value, that sums of its multiples are exact in double. The remainder is exact
 * too; it is rounded to a multiple of a finer unit, so that the sum of the remainders is also exact (Rump, Ogita and
 * Oishi, Accurate floating-point summation, 2008, section 3). For 100 values, the part that is neglected is below 2^-85
 * of the largest value. Therefore the sum is rounded correctly, unless the exact sum is as close as this to the middle
 * between two doubles. */
static double sum_values(const double *values, int64_t count, double largest, double scale)
{
    double sums[2] = {0, 0};
    int exponent, bits;
    frexp(largest * scale, &exponent);
    frexp((double)count, &bits);
    const double coarse = ldexp(1, exponent + bits), fine = ldexp(1, exponent + 2 * bits - 53);
    for (int64_t i = 0; i < count; i++) {
        const double value = values[i] * scale, part = (coarse + value) - coarse;
        sums[0] += part;
        sums[1] += (fine + (value - part)) - fine;
    }
    return sums[0] + sums[1];
}

/* Returns the mean of the values, or NaN if there are none. If all values are equal, the result is exactly this
 * value. */
static double find_mean(const double *values, int64_t count)
{
    double largest = 0;
    bool are_equal = count > 0;
    for (int64_t i = 0; i < count; i++) {
        largest = fabs(values[i]) > largest ? fabs(values[i]) : largest;
        are_equal = are_equal && values[i] == values[0];
    }
    if (are_equal) return values[0];
    const double scale = largest > 0x1p900 ? 0x1p-128 : 1; /* prevents overflow of the sum */
    return count ? sum_values(values, count, largest, scale) / (double)count / scale : NAN;
}

static void compute_group_means(value_groups *groups, int threads)
{
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t g = 0; g < groups->count; g++)
            groups->means[g] = find_mean(groups->values + groups->starts[g], groups->ends[g] - groups->starts[g]);
        region_leave();
    }
}

/* ---- values of this rank's cells and boundary faces -------------------------------------------------------------- */

/* The groups of a cell's vertices, without duplicates. If values at vertices of split cells are averaged, the list
 * contains the vertices instead of their groups. */
typedef struct cell_groups {
    int64_t count, capacity;
    int64_t *groups;
    bool is_out_of_memory; /* set if memory ran out */
} cell_groups;

static void append_group(cell_groups *list, int64_t group)
{
    if (list->count == list->capacity) {
        int64_t *more = base_realloc(list->groups, (size_t)(list->capacity * 2 + 64) * sizeof *more);
        list->is_out_of_memory = list->is_out_of_memory || !more;
        if (!more) return;
        list->groups = more;
        list->capacity = list->capacity * 2 + 64;
    }
    list->groups[list->count++] = group;
}

static void append_group_if_new(cell_groups *list, int64_t group)
{
    for (int64_t i = 0; i < list->count; i++)
        if (list->groups[i] == group) return;
    append_group(list, group);
}

static int compare_groups(const void *a, const void *b)
{
    const int64_t *x = a, *y = b;
    return (*x > *y) - (*x < *y);
}

static void drop_duplicate_groups(cell_groups *list)
{
    int64_t count = 0;
    if (list->count) qsort(list->groups, (size_t)list->count, sizeof *list->groups, compare_groups);
    for (int64_t i = 0; i < list->count; i++)
        if (i == 0 || list->groups[i] != list->groups[count - 1]) list->groups[count++] = list->groups[i];
    list->count = count;
}

/* Adds a value to a group, unless the group has values of boundary faces. is_shared: other threads may add to the group
 * at the same time. */
static inline void add_value_to_group(value_groups *values, int64_t group, double value, bool is_shared)
{
    int64_t at;
    if (values->has_face_values[group]) return;
    if (is_shared)
#pragma omp atomic capture
        at = values->ends[group]++;
    else
        at = values->ends[group]++;
    values->values[at] = value;
}

/* Adds a cell's values to the groups to which its vertices belong. A value of the whole cell is added once to each
 * group. If the field has values at corners, each finite one is added to the group of its corner. */
static void add_cell_values(recentring *r, int part, int64_t cell, cell_groups *list, bool is_shared)
{
    const grid_field *field = &r->parts[part].field;
    const int64_t *of_vertex = r->mesh_group->groups.group_of_vertex + r->mesh_group->groups.first_vertices[part];
    grid_walk walk = grid_walk_cell(&r->list.items[part]->cells, cell);
    double value = field->is_cell_centred ? grid_field_value(field, cell) : 0;
    int64_t vertex;
    if (!isfinite(value)) return;
    list->count = 0;
    while (grid_walk_next(&walk, &vertex)) {
        if (field->is_cell_centred) {
            append_group_if_new(list, of_vertex[vertex]);
            continue;
        }
        value = grid_field_value(field, vertex);
        if (isfinite(value)) add_value_to_group(&r->values, of_vertex[vertex], value, is_shared);
    }
    for (int64_t i = 0; i < list->count; i++) add_value_to_group(&r->values, list->groups[i], value, is_shared);
}

/* Adds the values of one of the caller's cells that is split into pieces. Vertices that pieces share are added once. */
static void add_split_cell_values(recentring *r, int part, int64_t cell, cell_groups *list, bool is_shared)
{
    const session_mesh *mesh = r->list.items[part];
    const grid_field *field = &r->parts[part].field;
    const int64_t *of_vertex = r->mesh_group->groups.group_of_vertex + r->mesh_group->groups.first_vertices[part];
    const int64_t first = session_first_piece(mesh, cell);
    double value = field->is_cell_centred ? grid_field_value(field, first) : 0;
    if (!isfinite(value)) return;
    list->count = 0;
    for (int64_t piece = first; piece < session_first_piece(mesh, cell + 1); piece++) {
        grid_walk walk = grid_walk_cell(&mesh->cells, piece);
        int64_t vertex;
        while (grid_walk_next(&walk, &vertex)) append_group(list, field->is_cell_centred ? of_vertex[vertex] : vertex);
    }
    drop_duplicate_groups(list);
    for (int64_t i = 0; i < list->count; i++) {
        const int64_t at = list->groups[i];
        if (!field->is_cell_centred) value = grid_field_value(field, at);
        if (isfinite(value))
            add_value_to_group(&r->values, field->is_cell_centred ? at : of_vertex[at], value, is_shared);
    }
}

/* Adds the finite values at vertices of drawn cells to the vertices' groups. Each vertex is added once. */
static void add_vertex_values(recentring *r, int part)
{
    const grid_field *field = &r->parts[part].field;
    const int64_t *of_vertex = r->mesh_group->groups.group_of_vertex + r->mesh_group->groups.first_vertices[part];
    for (int64_t v = 0; v < r->list.items[part]->cells.vertex_count; v++) {
        const double value = of_vertex[v] < 0 ? NAN : grid_field_value(field, v);
        if (isfinite(value)) add_value_to_group(&r->values, of_vertex[v], value, false);
    }
}

/* Adds the values of a part's cells to the groups. Returns false if memory ran out. */
static bool add_part_values(recentring *r, int part, int threads)
{
    const session_mesh *mesh = r->list.items[part];
    const grid *g = &mesh->cells;
    const int64_t count = session_count_whole_cells(mesh);
    const bool is_split = mesh->topology.is_split;
    bool is_lost = false;
    if (r->parts[part].is_of_vertices) {
        add_vertex_values(r, part);
        return true;
    }
#pragma omp parallel num_threads(session_choose_loop_threads(threads, count)) reduction(|| : is_lost)
    {
        region_enter();
        cell_groups list = {0};
        const bool is_shared = omp_get_num_threads() > 1;
#pragma omp for schedule(static) nowait
        for (int64_t cell = 0; cell < count; cell++) {
            if (grid_is_ghost(g, session_first_piece(mesh, cell))) continue;
            if (is_split)
                add_split_cell_values(r, part, cell, &list, is_shared);
            else
                add_cell_values(r, part, cell, &list, is_shared);
        }
        is_lost = list.is_out_of_memory;
        base_free(list.groups);
        region_leave();
    }
    return !is_lost;
}

/* Adds the values of boundary faces to the groups of the faces' vertices, and marks these groups, so that no values of
 * cells are added to them. */
static void add_boundary_face_values(const session_patch_values *faces, value_groups *values)
{
    for (int64_t i = 0; i < faces->count; i++) {
        const int64_t group = faces->groups[i];
        values->has_face_values[group] = 1;
        values->values[values->ends[group]++] = faces->values[i];
    }
}

/* Lists this rank's parts of the meshes of a recentring. */
static bool list_recentred_parts(const session_recentring *item, const session_meshes *meshes, recentring *r)
{
    r->mesh_group = item->mesh_group;
    if (!session_list_mesh_group_parts(item->mesh_group, meshes, &r->list)) return false;
    r->parts = base_calloc((size_t)r->list.count + 1, sizeof *r->parts);
    if (!r->parts) return false;
    for (int i = 0; i < r->list.count; i++) {
        const session_mesh *mesh = r->list.items[i];
        mesh_part *part = &r->parts[i];
        part->scalar = session_find_recentred_scalar(mesh, item->field, item->component, item->mesh_group->name);
        if (!part->scalar) continue;
        part->field = session_get_caller_values(mesh, part->scalar->field, part->scalar->component);
        part->is_of_vertices = mesh->fields[part->scalar->field].given.centring == INSITU_VERTEX;
    }
    return true;
}

static bool update_groups_of_equal_vertices(recentring *r, int ranks)
{
    session_mesh_group *mesh_group = r->mesh_group;
    const session_border *borders = session_merges_close_vertices(mesh_group) ? mesh_group->hanging.borders : NULL;
    const session_vertex_groups_basis basis = {mesh_group->positions_hash, r->list.count,     r->list.items, borders,
                                               mesh_group->homes,          mesh_group->by_id, ranks};
    return session_update_vertex_groups(&basis, &mesh_group->groups);
}

/* Reads the values of boundary faces, one list per part. An error of a patch is stored with its field. */
static void read_boundary_face_values(const recentring *r, session_patch_values *faces, base_error *error)
{
    const session_vertex_groups *groups = &r->mesh_group->groups;
    for (int i = 0; i < r->list.count && !error->status; i++) {
        base_error own = {.status = INSITU_OK};
        const mesh_part *part = &r->parts[i];
        const session_vertex_numbers numbers = {&groups->keys, groups->group_of_vertex + groups->first_vertices[i],
                                                r->mesh_group->by_id};
        if (!part->scalar) continue;
        session_find_patch_values(r->list.items[i], part->scalar->field, part->scalar->component, &numbers, &faces[i],
                                  &own);
        if (own.status == INSITU_ERROR_FIELD || own.status == INSITU_ERROR_ARGUMENT)
            session_store_problem(&r->list.items[i]->fields[part->scalar->field], &own, error);
        else
            *error = own;
    }
}

/* Allocates memory for the values of cells and, if there are any, of faces. */
static bool allocate_values_of_groups(recentring *r, const session_patch_values *faces)
{
    const session_vertex_groups *groups = &r->mesh_group->groups;
    int64_t count = 0, added = 0;
    for (int i = 0; i < r->list.count; i++) count += faces[i].count;
    if (count == 0) return create_value_groups(&r->values, groups->count, groups->corner_starts);
    r->starts = base_calloc((size_t)groups->count + 1, sizeof *r->starts);
    if (!r->starts) return false;
    for (int i = 0; i < r->list.count; i++)
        for (int64_t k = 0; k < faces[i].count; k++) r->starts[faces[i].groups[k] + 1]++;
    for (int64_t g = 1; g <= groups->count; g++) {
        added += r->starts[g];
        r->starts[g] = groups->corner_starts[g] + added;
    }
    if (!create_value_groups(&r->values, groups->count, r->starts)) return false;
    for (int i = 0; i < r->list.count; i++) add_boundary_face_values(&faces[i], &r->values);
    return true;
}

/* Computes the means over this rank's cells and faces. */
static void average_own_values(recentring *r, const session_team *team, base_error *error)
{
    const int count = r->list.count;
    session_patch_values *faces = base_calloc((size_t)count + 1, sizeof *faces);
    bool is_done = faces && update_groups_of_equal_vertices(r, team->ranks);
    if (is_done) read_boundary_face_values(r, faces, error);
    if (is_done && !error->status) is_done = allocate_values_of_groups(r, faces);
    for (int i = 0; i < count && is_done && !error->status; i++)
        if (r->parts[i].scalar) is_done = add_part_values(r, i, team->threads);
    if (!is_done) session_fail_for_memory(error, r->mesh_group->groups.count * 100, "values recentred to vertices");
    if (!error->status) compute_group_means(&r->values, team->threads);
    for (int i = 0; i < count && faces; i++) session_patch_values_free(&faces[i]);
    base_free(faces);
}

/* ---- sending groups that several ranks have ---------------------------------------------------------------------- */

/* number of 64-bit words in a record, the message about one group of equal vertices, before its values: three for the
 * key, and one for the number of values, in which the bit FACE_VALUES is set if the values are those of boundary
 * faces */
enum { RECORD_HEAD = 4 };
#define FACE_VALUES (UINT64_C(1) << 63)

static int64_t count_values_of_group(const value_groups *values, int64_t group)
{
    return values->ends[group] - values->starts[group];
}

/* Packs the groups that other ranks may have too, one record for each group, sorted by their home ranks, which combine
 * the values of all ranks. */
static bool pack_records(const recentring *r, int ranks, session_mail *mail)
{
    const session_vertex_groups *groups = &r->mesh_group->groups;
    const value_groups *values = &r->values;
    mail->counts = base_calloc((size_t)ranks, sizeof *mail->counts);
    if (!mail->counts) return false;
    const int64_t *next = groups->shared_groups;
    for (int rank = 0; rank < ranks; rank++) {
        for (int64_t i = 0; i < groups->shared_counts[rank]; i++)
            mail->counts[rank] += RECORD_HEAD + count_values_of_group(values, *next++);
        mail->total += mail->counts[rank];
    }
    mail->words = base_alloc((size_t)mail->total * sizeof *mail->words);
    if (!mail->words) return false;
    uint64_t *record = mail->words;
    for (int64_t i = 0; i < groups->shared_count; i++) {
        const int64_t group = groups->shared_groups[i], count = count_values_of_group(values, group);
        memcpy(record, groups->shared_keys[i].words, sizeof groups->shared_keys[i].words);
        record[RECORD_HEAD - 1] = (uint64_t)count | (values->has_face_values[group] ? FACE_VALUES : 0);
        memcpy(record + RECORD_HEAD, values->values + values->starts[group], (size_t)count * sizeof(double));
        record += RECORD_HEAD + count;
    }
    return true;
}

/* ---- work of home ranks: merging records by key ---------------------------------------------------------------- */

static int64_t count_record_values(const uint64_t *record)
{
    return (int64_t)(record[RECORD_HEAD - 1] & ~FACE_VALUES);
}

static const uint64_t *next_record(const uint64_t *record)
{
    return record + RECORD_HEAD + count_record_values(record);
}

/* Returns whether the record's values are included in the mean of the group. If the group has values of boundary faces
 * on any rank, values of cells are ignored. */
static bool uses_record_values(const uint64_t *record, const value_groups *values, int64_t group)
{
    return !values->has_face_values[group] || record[RECORD_HEAD - 1] & FACE_VALUES;
}

/* Assigns each record to a group: groups[i] becomes the index, from 0, of the group of record i; records with equal
 * keys are in the same group. */
static bool assign_records_to_groups(const session_mail *in, int64_t *groups, session_key_table *keys, int64_t records)
{
    const uint64_t *end = in->words + in->total;
    if (!session_keys_create(keys, records)) return false;
    for (const uint64_t *r = in->words; r < end; r = next_record(r)) {
        session_key key;
        memcpy(key.words, r, sizeof key.words);
        *groups++ = session_keys_add(keys, &key);
    }
    return true;
}

/* Collects the values of all records of each group. groups[i]: group of record i; count: number of groups; starts:
 * receives the index of each group's first value, and must contain count + 1 zeros at the call. */
static bool gather_values_by_group(const session_mail *in, const int64_t *groups, int64_t count, int64_t *starts,
                                   value_groups *values)
{
    const uint64_t *end = in->words + in->total;
    int64_t i = 0;
    for (const uint64_t *r = in->words; r < end; r = next_record(r)) starts[groups[i++] + 1] += count_record_values(r);
    for (int64_t g = 0; g < count; g++) starts[g + 1] += starts[g];
    if (!create_value_groups(values, count, starts)) return false;
    i = 0;
    for (const uint64_t *r = in->words; r < end; r = next_record(r), i++)
        if (r[RECORD_HEAD - 1] & FACE_VALUES) values->has_face_values[groups[i]] = 1;
    i = 0;
    for (const uint64_t *r = in->words; r < end; r = next_record(r), i++) {
        if (!uses_record_values(r, values, groups[i])) continue;
        memcpy(values->values + values->ends[groups[i]], r + RECORD_HEAD,
               (size_t)count_record_values(r) * sizeof(double));
        values->ends[groups[i]] += count_record_values(r);
    }
    return true;
}

/* Merges the records by key. For each record, the reply receives the mean of all values with the record's key. */
static bool merge_records(const session_mail *in, int ranks, int threads, session_mail *reply)
{
    session_key_table keys = {0};
    value_groups values = {0};
    const uint64_t *end = in->words + in->total;
    for (const uint64_t *r = in->words; r < end; r = next_record(r)) reply->total++;
    int64_t *groups = base_alloc((size_t)reply->total * sizeof *groups);
    int64_t *starts = base_calloc((size_t)reply->total + 1, sizeof *starts);
    reply->words = base_alloc((size_t)reply->total * sizeof *reply->words);
    reply->counts = base_calloc((size_t)ranks, sizeof *reply->counts);
    const bool is_done = groups && starts && reply->words && reply->counts &&
                         assign_records_to_groups(in, groups, &keys, reply->total) &&
                         gather_values_by_group(in, groups, keys.count, starts, &values);
    if (is_done) compute_group_means(&values, threads);
    for (int64_t i = 0; i < reply->total && is_done; i++)
        memcpy(&reply->words[i], &values.means[groups[i]], sizeof(double));
    const uint64_t *record = in->words;
    for (int rank = 0; rank < ranks && is_done; rank++)
        for (const uint64_t *stop = record + in->counts[rank]; record < stop; record = next_record(record))
            reply->counts[rank]++;
    base_free(groups);
    base_free(starts);
    session_keys_free(&keys);
    groups_free(&values);
    return is_done;
}

/* Replaces the means of groups that are shared with other ranks by the means over all ranks. */
static insitu_status merge_shared_groups(const session_team *team, recentring *r, base_error *error)
{
    const session_vertex_groups *groups = &r->mesh_group->groups;
    session_mail out = {0}, in = {0}, reply = {0}, means = {0};
    if (!error->status && !pack_records(r, team->ranks, &out))
        session_fail_for_memory(error, groups->shared_count * 100, "values at vertices that ranks share");
    insitu_status status = session_mail_deliver(team->comm, SESSION_MAIL_THERE, &out, &in, error);
    session_mail_free(&out);
    if (status) return status;
    if (!error->status && !merge_records(&in, team->ranks, team->threads, &reply))
        session_fail_for_memory(error, in.total * 24, "values at vertices that ranks share");
    session_mail_free(&in);
    status = session_mail_deliver(team->comm, SESSION_MAIL_BACK, &reply, &means, error);
    session_mail_free(&reply);
    for (int64_t i = 0; i < groups->shared_count && !status && !error->status; i++)
        memcpy(&r->values.means[groups->shared_groups[i]], &means.words[i], sizeof(double));
    session_mail_free(&means);
    return status;
}

/* ---- one recentring -------------------------------------------------------------------------------------------- */

/* Copies the means to the vertices. A vertex or corner whose own value is not finite gets NaN instead, so that its
 * cells are not drawn. For fields with cell values this is not necessary, because grid_field.source_cells excludes the
 * cells whose own values are not finite. */
static void copy_means_to_vertices(const recentring *r, int part, int threads)
{
    const int64_t *of_vertex = r->mesh_group->groups.group_of_vertex + r->mesh_group->groups.first_vertices[part];
    const int64_t count = r->list.items[part]->cells.vertex_count;
    const grid_field *own = &r->parts[part].field;
    double *values = r->parts[part].scalar->vertex_values;
#pragma omp parallel num_threads(session_choose_loop_threads(threads, count))
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t v = 0; v < count; v++) {
            const bool is_lost = of_vertex[v] < 0 || (!own->is_cell_centred && !isfinite(grid_field_value(own, v)));
            values[v] = is_lost ? NAN : r->values.means[of_vertex[v]];
        }
        region_leave();
    }
}

/* Returns whether hanging vertices must get the values interpolated on the faces on which they lie. This is the case if
 * the field has cell or vertex values on some mesh. Corner values are not changed in this way, because codes with such
 * values interpolate them at hanging vertices themselves. */
static bool needs_hanging_interpolation(const session_recentring *item)
{
    for (int i = 0; i < item->mesh_group->count; i++)
        if (session_catalogue_find_field(item->mesh_group->meshes[i], item->field)->centring != INSITU_CORNER)
            return true;
    return false;
}

static insitu_status interpolate_hanging_values(const recentring *r, const session_team *team, base_error *error)
{
    const session_vertex_groups *groups = &r->mesh_group->groups;
    const session_hanging_basis basis = {r->mesh_group,          r->list.count,           r->list.items,
                                         groups->first_vertices, groups->group_of_vertex, groups->count};
    const insitu_status status = session_update_hanging_vertices(&basis, team, error);
    return status ? status
                  : session_interpolate_hanging_vertices(&r->mesh_group->hanging, team, r->values.means, error);
}

/* Allocates memory for the recentred values of each part. */
static void allocate_recentred(const recentring *r, base_error *error)
{
    for (int i = 0; i < r->list.count; i++) {
        session_scalar *scalar = r->parts[i].scalar;
        if (!scalar || scalar->vertex_values) continue;
        const int64_t count = r->list.items[i]->cells.vertex_count;
        scalar->vertex_values = base_alloc((size_t)count * sizeof(double));
        if (!scalar->vertex_values) session_fail_for_memory(error, count * (int64_t)sizeof(double), "recentred values");
    }
}

static void store_means(const recentring *r, int threads)
{
    for (int i = 0; i < r->list.count; i++) {
        session_scalar *scalar = r->parts[i].scalar;
        if (!scalar) continue;
        copy_means_to_vertices(r, i, threads);
        scalar->are_values_stale = false;
        scalar->computed_count++;
        scalar->positions_hash = r->mesh_group->positions_hash;
        scalar->may_have_changed = true;
    }
}

static insitu_status recentre_field(const session_recentring *item, const session_meshes *meshes,
                                    const session_team *team, base_error *error)
{
    recentring r = {0};
    insitu_status status = INSITU_OK;
    const bool is_listed = list_recentred_parts(item, meshes, &r);
    if (!is_listed) session_fail_for_memory(error, item->mesh_group->count * 64LL, "values recentred to vertices");
    if (item->mesh_group->count > 1 || needs_hanging_interpolation(item))
        status = session_update_borders(item->mesh_group, &r.list, team, error);
    if (!status && is_listed) average_own_values(&r, team, error);
    if (!status && !error->status) allocate_recentred(&r, error);
    if (!status) status = team->ranks > 1 ? merge_shared_groups(team, &r, error) : session_agree(team->comm, error);
    if (!status && needs_hanging_interpolation(item)) status = interpolate_hanging_values(&r, team, error);
    if (!status && !error->status) store_means(&r, team->threads);
    groups_free(&r.values);
    base_free(r.starts);
    base_free(r.parts);
    session_mesh_group_parts_free(&r.list);
    return status;
}

static bool is_recentring_stale(const session_recentring *item, const session_meshes *meshes)
{
    for (int m = 0; m < item->mesh_group->count; m++) {
        const session_parts parts = session_find_parts(meshes, item->mesh_group->meshes[m]->name);
        for (int i = 0; i < parts.count; i++) {
            const session_scalar *scalar =
                session_find_recentred_scalar(parts.items[i], item->field, item->component, item->mesh_group->name);
            if (scalar && (scalar->are_values_stale || scalar->positions_hash != item->mesh_group->positions_hash))
                return true;
        }
    }
    return false;
}

bool session_add_recentring(session_recentring **items, int *count, const session_recentring *item)
{
    for (int i = 0; i < *count; i++) {
        const session_recentring *other = &(*items)[i];
        if (other->mesh_group == item->mesh_group && strcmp(other->field, item->field) == 0 &&
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
    for (int i = 0; i < count; i++) stale[i] = is_recentring_stale(&items[i], meshes);
    insitu_status status = session_check_mpi(
        error, MPI_Allreduce(MPI_IN_PLACE, stale, count, MPI_INT, MPI_MAX, team->comm), "MPI_Allreduce");
    for (int i = 0; i < count && !status; i++)
        if (stale[i]) status = recentre_field(&items[i], meshes, team, error);
    return status;
}
