#include "session_vertex_groups.h"

#include <string.h>

#include "memory.h"
#include "session_twins.h"

typedef session_vertex_groups_basis groups_basis;

/* ---- groups of equal vertices ------------------------------------------------------------------------------------ */

/* Assigns the vertices of a part's drawn cells to groups of equal vertices, and adds to corner_starts[g + 1] the number
 * of corners of the part's drawn cells that are in group g. If vertices are compared by id, one_vertex receives the
 * index of one vertex of each group among the vertices of all parts; otherwise it is NULL. */
static void group_vertices_of_part(const groups_basis *basis, int part, session_vertex_groups *out, int64_t *one_vertex)
{
    const session_mesh *mesh = basis->parts[part];
    const session_border *border = basis->borders ? &basis->borders[part] : NULL;
    const grid *g = &mesh->cells;
    int64_t *of_vertex = out->group_of_vertex + out->first_vertices[part];
    for (int64_t v = 0; v < g->vertex_count; v++) of_vertex[v] = -1;
    for (int64_t cell = 0; cell < g->cell_count; cell++) {
        if (grid_is_ghost(g, cell)) continue;
        grid_walk walk = grid_walk_cell(g, cell);
        int64_t vertex;
        while (grid_walk_next(&walk, &vertex)) {
            if (of_vertex[vertex] < 0) {
                const session_key key = session_merged_vertex_key(mesh, border, vertex, basis->by_id);
                of_vertex[vertex] = session_keys_add(&out->keys, &key);
                if (one_vertex) one_vertex[of_vertex[vertex]] = out->first_vertices[part] + vertex;
            }
            out->corner_starts[of_vertex[vertex] + 1]++;
        }
    }
}

/* Computes the groups of equal vertices of all parts. If vertices are compared by id, *one_vertex receives an array
 * with the index of one vertex of each group. Returns false if memory runs out. */
static bool group_vertices(const groups_basis *basis, session_vertex_groups *out, int64_t **one_vertex)
{
    out->first_vertices = base_calloc((size_t)basis->part_count + 1, sizeof *out->first_vertices);
    if (!out->first_vertices) return false;
    for (int i = 0; i < basis->part_count; i++)
        out->first_vertices[i + 1] = out->first_vertices[i] + basis->parts[i]->cells.vertex_count;
    const int64_t most = out->first_vertices[basis->part_count];
    *one_vertex = basis->by_id ? base_alloc((size_t)most * sizeof **one_vertex) : NULL;
    out->group_of_vertex = base_alloc((size_t)most * sizeof *out->group_of_vertex);
    out->corner_starts = base_calloc((size_t)most + 1, sizeof *out->corner_starts);
    if (!out->group_of_vertex || !out->corner_starts || (basis->by_id && !*one_vertex) ||
        !session_keys_create(&out->keys, most))
        return false;
    for (int i = 0; i < basis->part_count; i++) group_vertices_of_part(basis, i, out, *one_vertex);
    out->count = out->keys.count;
    for (int64_t group = 0; group < out->count; group++) out->corner_starts[group + 1] += out->corner_starts[group];
    int64_t *starts = base_realloc(out->corner_starts, (size_t)(out->count + 1) * sizeof *starts);
    if (starts) out->corner_starts = starts;
    return true;
}

/* ---- groups that other ranks may have, too --------------------------------------------------------------------- */

static void find_vertex_position(const groups_basis *basis, const session_vertex_groups *groups, int64_t number,
                                 double position[3])
{
    int part = 0, end = basis->part_count;
    while (end - part > 1) {
        const int middle = part + (end - part) / 2;
        if (groups->first_vertices[middle] <= number)
            part = middle;
        else
            end = middle;
    }
    grid_read_vertex_position(&basis->parts[part]->cells, number - groups->first_vertices[part], position);
}

static void find_group_position(const groups_basis *basis, const session_vertex_groups *groups,
                                const int64_t *one_vertex, int64_t group, double position[3])
{
    if (one_vertex)
        find_vertex_position(basis, groups, one_vertex[group], position);
    else
        memcpy(position, groups->keys.keys[group].words, 3 * sizeof *position);
}

/* Finds the home rank of each group that lies in another rank's box, and counts the groups for each home rank.
 * home[group] becomes -1 if only this rank can have vertices of the group. */
static void find_home_ranks(const groups_basis *basis, const int64_t *one_vertex, session_vertex_groups *out, int *home)
{
    for (int64_t group = 0; group < out->count; group++) {
        const session_key *key = &out->keys.keys[group];
        double position[1][3];
        find_group_position(basis, out, one_vertex, group, position[0]);
        home[group] = -1;
        if (!session_is_in_other_box(basis->homes, position[0])) continue;
        home[group] = session_find_home_rank(basis->homes, (const double(*)[3])position, 1, session_key_hash(key),
                                             (int64_t)key->words[0]);
        out->shared_counts[home[group]]++;
        out->shared_count++;
    }
}

/* Lists the shared groups, sorted by their home ranks. */
static bool list_shared_groups(const groups_basis *basis, const int64_t *one_vertex, session_vertex_groups *out)
{
    int *home = base_alloc((size_t)out->count * sizeof *home);
    int64_t *next = base_calloc((size_t)basis->ranks + 1, sizeof *next);
    out->shared_counts = base_calloc((size_t)basis->ranks, sizeof *out->shared_counts);
    bool is_done = home && next && out->shared_counts;
    if (is_done) {
        find_home_ranks(basis, one_vertex, out, home);
        out->shared_groups = base_alloc((size_t)out->shared_count * sizeof *out->shared_groups);
        out->shared_keys = base_alloc((size_t)out->shared_count * sizeof *out->shared_keys);
        is_done = out->shared_groups && out->shared_keys;
    }
    for (int rank = 0; rank < basis->ranks && is_done; rank++) next[rank + 1] = next[rank] + out->shared_counts[rank];
    for (int64_t group = 0; group < out->count && is_done; group++) {
        if (home[group] < 0) continue;
        const int64_t at = next[home[group]]++;
        out->shared_groups[at] = group;
        out->shared_keys[at] = out->keys.keys[group];
    }
    base_free(home);
    base_free(next);
    return is_done;
}

/* ---- updates --------------------------------------------------------------------------------------------------- */

static bool has_patches(const groups_basis *basis)
{
    for (int i = 0; i < basis->part_count; i++)
        for (int f = 0; f < basis->parts[i]->field_count; f++)
            if (basis->parts[i]->fields[f].given.patch_count) return true;
    return false;
}

bool session_update_vertex_groups(const session_vertex_groups_basis *basis, session_vertex_groups *groups)
{
    int64_t *one_vertex = NULL;
    const bool needs_keys = has_patches(basis);
    if (groups->positions_hash == basis->positions_hash && (groups->keys.keys || !needs_keys)) return true;
    session_vertex_groups_free(groups);
    const bool is_done = group_vertices(basis, groups, &one_vertex) &&
                         (basis->ranks == 1 || list_shared_groups(basis, one_vertex, groups));
    base_free(one_vertex);
    if (!is_done) session_vertex_groups_free(groups);
    if (!needs_keys) session_keys_free(&groups->keys);
    if (is_done) groups->positions_hash = basis->positions_hash;
    return is_done;
}
