/* Creates one rank's part of the mesh. Own cubes and cells belong to this rank, and own vertices are the vertices of
 * own cells. Foreign cubes belong to other ranks.
 *
 *     own cubes ──> own cells ──> own vertices          (in ascending order of cube id)
 *     the 26 cubes around each own cube ──> foreign cubes, by (owner, cube) ──> their cells that touch an own vertex
 *     own cells that share a corner with a foreign cube ──> cells to send to its owner, by (owner, cell)
 *
 * Every corner of a cube is a vertex of one of its cells, whatever their type. Therefore a cell shares a corner with a
 * cube of rank B if and only if it shares a vertex with a cell of rank B. The list of cells that rank A sends to rank B
 * hence equals the list of cells that B expects from A, and both are in the order of cell ids. */
#include "wave_mesh_create.h"

#include <stdlib.h>
#include <string.h>

#include "wave_faces.h"
#include "wave_map.h"

typedef struct pair {
    int32_t rank;
    int64_t value;
} pair;

typedef struct pair_list {
    pair *items;
    int64_t count, capacity;
} pair_list;

typedef struct mesh_builder {
    wave_mesh *mesh;
    wave_map vertex_map;
    pair_list own, foreign, sends;
    int64_t cell_capacity, connectivity_capacity, vertex_capacity;
} mesh_builder;

static bool add_to_pair_list(pair_list *list, int32_t rank, int64_t value)
{
    if (list->count == list->capacity) {
        int64_t capacity = list->capacity ? 2 * list->capacity : 256;
        pair *items = realloc(list->items, (size_t)capacity * sizeof *items);
        if (!items) return false;
        list->items = items;
        list->capacity = capacity;
    }
    list->items[list->count++] = (pair){rank, value};
    return true;
}

static int compare_rank_and_value(const void *a, const void *b)
{
    const pair *x = a, *y = b;
    if (x->rank != y->rank) return x->rank < y->rank ? -1 : 1;
    return (x->value > y->value) - (x->value < y->value);
}

static void sort_and_deduplicate_list(pair_list *list)
{
    int64_t kept = 0;
    if (list->count == 0) return;
    qsort(list->items, (size_t)list->count, sizeof(pair), compare_rank_and_value);
    for (int64_t i = 1; i < list->count; ++i) {
        if (compare_rank_and_value(&list->items[i], &list->items[kept]) != 0) list->items[++kept] = list->items[i];
    }
    list->count = kept + 1;
}

static bool find_own_cubes(mesh_builder *m)
{
    const wave_partition *p = &m->mesh->partition;
    int low[3], high[3], at[3];
    wave_partition_find_box(p, m->mesh->rank, low, high);
    for (at[2] = low[2]; at[2] < high[2]; ++at[2]) {
        for (at[1] = low[1]; at[1] < high[1]; ++at[1]) {
            for (at[0] = low[0]; at[0] < high[0]; ++at[0]) {
                if (wave_partition_owner(p, at) != m->mesh->rank) continue;
                if (!add_to_pair_list(&m->own, m->mesh->rank, wave_lattice_find_cube_id(&p->lattice, at))) return false;
            }
        }
    }
    return true;
}

/* Computes the owners of a cube and of the 26 cubes around it, -1 outside the lattice. Returns true if any of them is
 * another rank. */
static bool list_owners_around(const wave_mesh *mesh, int64_t cube, int owner[3][3][3])
{
    const wave_lattice *lattice = &mesh->partition.lattice;
    int ijk[3];
    bool foreign = false;
    wave_lattice_find_cube_indices(lattice, cube, ijk);
    for (int n = 0; n < 27; ++n) {
        int at[3] = {ijk[0] + n % 3 - 1, ijk[1] + n / 3 % 3 - 1, ijk[2] + n / 9 - 1};
        int *o = &owner[n / 9][n / 3 % 3][n % 3];
        *o = wave_lattice_contains_cube(lattice, at) ? wave_partition_owner(&mesh->partition, at) : -1;
        foreign = foreign || (*o >= 0 && *o != mesh->rank);
    }
    return foreign;
}

static bool add_foreign_cubes(mesh_builder *m, int64_t cube, int owner[3][3][3])
{
    const wave_lattice *lattice = &m->mesh->partition.lattice;
    int ijk[3];
    wave_lattice_find_cube_indices(lattice, cube, ijk);
    for (int n = 0; n < 27; ++n) {
        int at[3] = {ijk[0] + n % 3 - 1, ijk[1] + n / 3 % 3 - 1, ijk[2] + n / 9 - 1};
        int o = owner[n / 9][n / 3 % 3][n % 3];
        if (o < 0 || o == m->mesh->rank) continue;
        if (!add_to_pair_list(&m->foreign, o, wave_lattice_find_cube_id(lattice, at))) return false;
    }
    return true;
}

/* Adds an entry to the list of sends: the cell is to be sent to the rank. Does nothing if the list has this entry
 * already. Earlier entries of the same cell are at the end of the list. */
static bool add_cell_to_send(mesh_builder *m, int rank, int32_t cell)
{
    for (int64_t i = m->sends.count - 1; i >= 0 && m->sends.items[i].value == cell; --i) {
        if (m->sends.items[i].rank == rank) return true;
    }
    return add_to_pair_list(&m->sends, rank, cell);
}

/* Adds entries to the list of sends, so that the cell is sent to every rank that owns a cube with one of the cell's
 * lattice vertices as a corner. */
static bool add_sends_of_cell(mesh_builder *m, int64_t cube, int32_t cell, const wave_cell *c, int owner[3][3][3])
{
    const wave_lattice *lattice = &m->mesh->partition.lattice;
    int ijk[3], at[3];
    wave_lattice_find_cube_indices(lattice, cube, ijk);
    for (int i = 0; i < wave_cell_shape_of(c->type)->vertex_count; ++i) {
        if (!wave_lattice_find_vertex_indices(lattice, c->vertex[i], at)) continue;
        for (int n = 0; n < 8; ++n) {
            int o = owner[at[2] - ijk[2] + (n >> 2)][at[1] - ijk[1] + (n >> 1 & 1)][at[0] - ijk[0] + (n & 1)];
            if (o < 0 || o == m->mesh->rank) continue;
            if (!add_cell_to_send(m, o, cell)) return false;
        }
    }
    return true;
}

static bool grow_array(void **array, size_t bytes, int64_t capacity)
{
    void *larger = realloc(*array, (size_t)capacity * bytes);
    if (!larger) return false;
    *array = larger;
    return true;
}

static bool reserve_cell(mesh_builder *m)
{
    wave_mesh *mesh = m->mesh;
    if (mesh->cells == INT32_MAX - 1) return false;
    if (mesh->cells == m->cell_capacity) {
        m->cell_capacity = m->cell_capacity ? 2 * m->cell_capacity : 256;
        if (!grow_array((void **)&mesh->cell_ids, sizeof(int64_t), m->cell_capacity)) return false;
        if (!grow_array((void **)&mesh->types, 1, m->cell_capacity)) return false;
        if (!grow_array(&mesh->offsets, (size_t)mesh->index_bytes, m->cell_capacity + 1)) return false;
    }
    if (mesh->connectivity_count + 8 > m->connectivity_capacity) {
        m->connectivity_capacity = m->connectivity_capacity ? 2 * m->connectivity_capacity : 1024;
        if (mesh->index_bytes == 4 && m->connectivity_capacity > INT32_MAX) return false;
        if (!grow_array(&mesh->connectivity, (size_t)mesh->index_bytes, m->connectivity_capacity)) return false;
    }
    return true;
}

static void store_index(const wave_mesh *mesh, void *array, int64_t at, int64_t value)
{
    if (mesh->index_bytes == 8) {
        ((int64_t *)array)[at] = value;
    } else {
        ((int32_t *)array)[at] = (int32_t)value;
    }
}

static bool add_vertex(mesh_builder *m, int64_t id, int32_t *local)
{
    wave_mesh *mesh = m->mesh;
    *local = wave_map_insert(&m->vertex_map, id, mesh->vertices);
    if (*local < 0) return false;
    if (*local < mesh->vertices) return true;
    if (mesh->vertices == m->vertex_capacity) {
        m->vertex_capacity = m->vertex_capacity ? 2 * m->vertex_capacity : 256;
        if (!grow_array((void **)&mesh->vertex_ids, sizeof(int64_t), m->vertex_capacity)) return false;
        if (!grow_array((void **)&mesh->walls, 1, m->vertex_capacity)) return false;
    }
    mesh->vertex_ids[mesh->vertices] = id;
    mesh->walls[mesh->vertices] = wave_lattice_find_walls(&mesh->partition.lattice, id);
    mesh->vertices++;
    return true;
}

static bool add_cell(mesh_builder *m, const wave_cell *c, int64_t id)
{
    wave_mesh *mesh = m->mesh;
    if (!reserve_cell(m)) return false;
    mesh->cell_ids[mesh->cells] = id;
    mesh->types[mesh->cells] = c->type;
    for (int i = 0; i < wave_cell_shape_of(c->type)->vertex_count; ++i) {
        int32_t local;
        if (!add_vertex(m, c->vertex[i], &local)) return false;
        store_index(mesh, mesh->connectivity, mesh->connectivity_count++, local);
    }
    store_index(mesh, mesh->offsets, ++mesh->cells, mesh->connectivity_count);
    return true;
}

static bool make_own_cells(mesh_builder *m)
{
    wave_cell cells[WAVE_CELLS_PER_CUBE];
    int owner[3][3][3];
    for (int64_t i = 0; i < m->own.count; ++i) {
        int64_t cube = m->own.items[i].value;
        int count = wave_lattice_make_cells(&m->mesh->partition.lattice, cube, cells);
        bool foreign = list_owners_around(m->mesh, cube, owner);
        if (foreign && !add_foreign_cubes(m, cube, owner)) return false;
        for (int c = 0; c < count; ++c) {
            if (foreign && !add_sends_of_cell(m, cube, m->mesh->cells, &cells[c], owner)) return false;
            if (!add_cell(m, &cells[c], cube * WAVE_CELLS_PER_CUBE + c)) return false;
        }
    }
    m->mesh->own_cells = m->mesh->cells;
    m->mesh->own_vertices = m->mesh->vertices;
    sort_and_deduplicate_list(&m->foreign);
    sort_and_deduplicate_list(&m->sends);
    return true;
}

static bool touches_own_vertex(const mesh_builder *m, const wave_cell *c)
{
    for (int i = 0; i < wave_cell_shape_of(c->type)->vertex_count; ++i) {
        int32_t local = wave_map_find(&m->vertex_map, c->vertex[i]);
        if (local >= 0 && local < m->mesh->own_vertices) return true;
    }
    return false;
}

static bool make_halo_cells(mesh_builder *m)
{
    wave_mesh *mesh = m->mesh;
    wave_cell cells[WAVE_CELLS_PER_CUBE];
    int64_t links = 0;
    for (int64_t i = 0; i < m->foreign.count; ++i) {
        links += i == 0 || m->foreign.items[i].rank != m->foreign.items[i - 1].rank;
    }
    mesh->links = calloc((size_t)links + 1, sizeof *mesh->links);
    if (!mesh->links) return false;
    for (int64_t i = 0; i < m->foreign.count; ++i) {
        int32_t rank = m->foreign.items[i].rank;
        int64_t cube = m->foreign.items[i].value;
        int count = wave_lattice_make_cells(&mesh->partition.lattice, cube, cells);
        if (mesh->link_count == 0 || mesh->links[mesh->link_count - 1].rank != rank) {
            mesh->links[mesh->link_count++] = (wave_link){.rank = rank, .receive_begin = mesh->cells};
        }
        for (int c = 0; c < count; ++c) {
            if (!touches_own_vertex(m, &cells[c])) continue;
            if (!add_cell(m, &cells[c], cube * WAVE_CELLS_PER_CUBE + c)) return false;
        }
        mesh->links[mesh->link_count - 1].receive_end = mesh->cells;
    }
    return true;
}

static bool list_cells_to_send(mesh_builder *m)
{
    wave_mesh *mesh = m->mesh;
    int64_t at = 0;
    if (m->sends.count > INT32_MAX) return false;
    mesh->send_count = (int32_t)m->sends.count;
    mesh->sends = malloc(((size_t)m->sends.count + 1) * sizeof *mesh->sends);
    if (!mesh->sends) return false;
    for (int l = 0; l < mesh->link_count; ++l) {
        mesh->links[l].send_begin = (int32_t)at;
        for (; at < m->sends.count && m->sends.items[at].rank == mesh->links[l].rank; ++at) {
            mesh->sends[at] = (int32_t)m->sends.items[at].value;
        }
        mesh->links[l].send_end = (int32_t)at;
    }
    return true;
}

static void sort_by_id(const wave_mesh *mesh, int32_t *cells, int64_t count)
{
    for (int64_t i = 1; i < count; ++i) {
        int32_t cell = cells[i];
        int64_t at = i;
        for (; at > 0 && mesh->cell_ids[cells[at - 1]] > mesh->cell_ids[cell]; --at) cells[at] = cells[at - 1];
        cells[at] = cell;
    }
}

/* Lists the cells around each own vertex, sorted by cell id, so that sums over them are rounded in the same way on
 * every rank that has the vertex. */
static bool list_cells_around_vertices(wave_mesh *mesh)
{
    int32_t v[8];
    mesh->vertex_cell_offsets = calloc((size_t)mesh->own_vertices + 2, sizeof *mesh->vertex_cell_offsets);
    mesh->vertex_cells = malloc(((size_t)mesh->connectivity_count + 1) * sizeof *mesh->vertex_cells);
    if (!mesh->vertex_cell_offsets || !mesh->vertex_cells) return false;
    int64_t *begin = mesh->vertex_cell_offsets + 1;
    for (int64_t i = 0; i < mesh->connectivity_count; ++i) {
        int64_t vertex = wave_mesh_index(mesh, mesh->connectivity, i);
        if (vertex < mesh->own_vertices) mesh->vertex_cell_offsets[vertex + 1]++;
    }
    int64_t total = 0;
    for (int32_t i = 0; i < mesh->own_vertices; ++i) {
        int64_t count = begin[i];
        begin[i] = total;
        total += count;
    }
    for (int32_t c = 0; c < mesh->cells; ++c) {
        int count = wave_mesh_cell(mesh, c, v)->vertex_count;
        for (int i = 0; i < count; ++i) {
            if (v[i] < mesh->own_vertices) mesh->vertex_cells[begin[v[i]]++] = c;
        }
    }
    for (int32_t i = 0; i < mesh->own_vertices; ++i) {
        sort_by_id(mesh, mesh->vertex_cells + mesh->vertex_cell_offsets[i],
                   mesh->vertex_cell_offsets[i + 1] - mesh->vertex_cell_offsets[i]);
    }
    return true;
}

static void drop_uniform_arrays(wave_mesh *mesh)
{
    mesh->uniform_type = wave_lattice_uniform_type(&mesh->partition.lattice);
    if (!mesh->uniform_type) return;
    free(mesh->types);
    free(mesh->offsets);
    mesh->types = NULL;
    mesh->offsets = NULL;
}

bool wave_mesh_create(const wave_partition *partition, int rank, int index_bytes, wave_mesh *mesh)
{
    *mesh = (wave_mesh){.partition = *partition, .rank = rank, .index_bytes = index_bytes};
    mesh_builder m = {.mesh = mesh};
    bool ok = find_own_cubes(&m) && reserve_cell(&m);
    if (ok) store_index(mesh, mesh->offsets, 0, 0);
    ok = ok && make_own_cells(&m) && make_halo_cells(&m) && list_cells_to_send(&m);
    wave_map_free(&m.vertex_map);
    free(m.own.items);
    free(m.foreign.items);
    free(m.sends.items);
    if (ok) drop_uniform_arrays(mesh);
    ok = ok && list_cells_around_vertices(mesh) && wave_faces_find_neighbours(mesh);
    if (!ok) wave_mesh_free(mesh);
    return ok;
}
