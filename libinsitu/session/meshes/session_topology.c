/* All other code reads the faces of each cell, and the vertices of each face. Finite-volume codes store the vertices of
 * each face and, for each face, the cell that owns it and the neighbouring cell. From these arrays, the list of the
 * faces of each cell, sorted by index, is computed here once per topology. The direction of a face's loop of vertices
 * does not matter, so faces are not reversed. The faces' vertices are read in place, except in two cases: if each face
 * has its own list of vertices, or if boundary faces are in a separate list, all faces are copied into one list.
 *
 * A polyhedron with six quads may be a hex, which is drawn in a fraction of the time. It is recognized by its faces
 * alone, never by coordinates: therefore the result is the same on all ranks that have the cell, and in all steps of a
 * moving mesh.
 *
 *           t3 ------ t2
 *          /|        /|      The base is any face with the right number of vertices: four for a hex and a pyramid,
 *         / |       / |      three for a wedge and a tet. A face that shares an edge with the base is a side. A quad
 *        t0 ------ t1 |      as a side determines the vertices above the edge's ends: t0 and t1 above a0 and a1.
 *        | a3 ----|- a2      The cell is closed if neighbouring sides have the same vertex above the corner that they
 *        | /      | /        share, if the remaining face is the loop of t0, t1, ... in this order, and if no two
 *        |/       |/         vertices are equal. Then every edge belongs to two faces. Triangles as sides have one
 *        a0 ----- a1         vertex above the base, the apex. The directions of the faces' loops do not matter.
 *
 * If any cell is invalid, no polyhedron of the mesh is recognized, so that session_check.c reports the error in terms
 * of the caller's cells. */
#include "session_topology.h"

#include <string.h>

#include "memory.h"
#include "region.h"
#include "session_cell_order.h"
#include "session_lattice.h"
#include "session_split.h"
#include "session_tally.h"

/* ---- arrays that the grid reads ---------------------------------------------------------------------------------- */

void session_select_grid_arrays(session_mesh *mesh)
{
    session_topology *t = &mesh->topology;
    grid g = session_caller_grid(&mesh->given);
    if (t->has_own_cells) {
        g.offsets = t->offsets;
        g.connectivity = t->connectivity;
        g.cell_types = (const char *)t->cell_types;
        g.cell_types_stride = g.cell_types_bytes = 1;
        g.cell_type = t->cell_type;
        if (t->is_split) {
            g.cell_count = t->cell_count;
            g.ghosts = (const char *)t->ghosts;
            g.ghosts_stride = g.ghosts_bytes = 1;
        }
    } else if (t->has_own_order) {
        g.connectivity = t->connectivity;
    } else {
        t->connectivity_count = mesh->given.connectivity_count;
    }
    if (t->has_own_faces) {
        g.face_count = session_face_count(&mesh->given);
        g.face_offsets = t->face_offsets;
        g.face_connectivity = t->face_connectivity;
    } else {
        t->face_connectivity_count = mesh->given.face_connectivity_count;
    }
    if (mesh->discontinuous.is_made) {
        g.vertex_count = mesh->discontinuous.corner_count;
        g.connectivity = mesh->discontinuous.corners;
        for (int axis = 0; axis < 3; axis++) g.coordinates[axis] = mesh->discontinuous.coordinates[axis];
    }
    if (mesh->covered) {
        g.ghosts = (const char *)mesh->covered;
        g.ghosts_stride = g.ghosts_bytes = 1;
    }
    session_set_lattice_of_grid(mesh, &g);
    g.flat = mesh->flat_cells;
    mesh->cells = g;
}

int session_caller_type(const session_mesh *mesh, int64_t cell)
{
    if (mesh->cells.lattice) return mesh->cells.cell_type;
    const grid given = session_caller_grid(&mesh->given);
    return grid_cell_type(&given, session_caller_cell(mesh, cell));
}

/* ---- vertices of faces that the caller gives in several lists ---------------------------------------------------- */

session_face_row session_find_vertices_of_caller_face(const insitu_mesh *mesh, int64_t face)
{
    const bool is_apart = face >= mesh->face_count;
    if (mesh->face_lists.data) {
        const grid_array sizes = session_grid_array(&mesh->face_sizes);
        const insitu_array list = {session_face_list(mesh, face), mesh->face_lists.type, 0};
        const int64_t size = grid_read_index(&sizes, face);
        return (session_face_row){session_index_array(mesh, &list), 0, size, size};
    }
    const grid_array offsets =
        is_apart ? session_index_array(mesh, &mesh->boundary_face_offsets)
                 : session_offset_array(mesh, &mesh->face_offsets, mesh->face_count, mesh->face_connectivity_count);
    const insitu_array *list = is_apart ? &mesh->boundary_face_connectivity : &mesh->face_connectivity;
    const int64_t at = is_apart ? face - mesh->face_count : face, first = grid_read_index(&offsets, at);
    return (session_face_row){session_index_array(mesh, list), first,
                              (int64_t)((uint64_t)grid_offset_end(&offsets, at) - (uint64_t)first),
                              is_apart ? mesh->boundary_face_connectivity_count : mesh->face_connectivity_count};
}

static insitu_status check_vertices_of_face(const session_mesh *mesh, int64_t face, const session_face_row *row,
                                            base_error *error)
{
    const long long base = mesh->given.index_base, at = face + base, first = row->first, size = row->size;
    if (!mesh->given.face_lists.data) {
        if (first >= 0 && first <= row->limit && size >= 0 && size <= row->limit - first) return INSITU_OK;
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": face %lld: its vertices from offset %lld on, %lld of them, do not lie within "
                         "%lld..%lld",
                         mesh->label, at, first + base, size, base, (long long)row->limit + base);
    }
    if (size < 0 || size > INT64_MAX / 64)
        return base_fail(error, INSITU_ERROR_MESH, "mesh \"%s\": face %lld: its size is %lld", mesh->label, at, size);
    if (size > 0 && !row->list.data)
        return base_fail(error, INSITU_ERROR_MESH, "mesh \"%s\": face %lld: its list is NULL, its size %lld",
                         mesh->label, at, size);
    return INSITU_OK;
}

/* Returns the total number of vertices of all faces, or -1 if a list is invalid. */
static int64_t count_listed_vertices(const session_mesh *mesh, base_error *error)
{
    int64_t total = 0;
    for (int64_t face = 0; face < session_face_count(&mesh->given); face++) {
        const session_face_row row = session_find_vertices_of_caller_face(&mesh->given, face);
        if (check_vertices_of_face(mesh, face, &row, error)) return -1;
        total += row.size;
        if (total <= INT64_MAX / 64) continue;
        base_fail(error, INSITU_ERROR_MESH, "mesh \"%s\": face %lld: its size is %lld, too many with those before",
                  mesh->label, (long long)face + mesh->given.index_base, (long long)row.size);
        return -1;
    }
    return total;
}

static insitu_status copy_face_lists(session_mesh *mesh, base_error *error)
{
    const insitu_mesh *given = &mesh->given;
    session_topology *t = &mesh->topology;
    const int64_t total = count_listed_vertices(mesh, error), count = session_face_count(given);
    const long long base = given->index_base;
    int64_t at = 0;
    t->has_own_faces = true;
    if (total < 0 || !session_allocate_indices(mesh, "faces' offsets", count, total, &t->face_offsets, error) ||
        !session_allocate_indices(mesh, "faces' vertices", total, given->vertex_count, &t->face_connectivity, error))
        return error->status;
    for (int64_t face = 0; face < count; face++) {
        const session_face_row row = session_find_vertices_of_caller_face(given, face);
        for (int64_t i = 0; i < row.size; i++) {
            const int64_t vertex = grid_read_index(&row.list, row.first + i);
            if (vertex < 0 || vertex >= given->vertex_count)
                return base_fail(error, INSITU_ERROR_MESH,
                                 "mesh \"%s\": face %lld: vertex index %lld is outside %lld..%lld (index_base is %lld)",
                                 mesh->label, face + base, vertex + base, base, given->vertex_count - 1 + base, base);
            session_store_index(&t->face_connectivity, at++, vertex);
        }
        session_store_index(&t->face_offsets, face + 1, at);
    }
    t->face_connectivity_count = total;
    t->face_bytes = (count + 1) * t->face_offsets.stride + (total + 1) * t->face_connectivity.stride;
    return INSITU_OK;
}

/* ---- faces of cells from the owners and neighbours of faces ------------------------------------------------------ */

/* Value of a cell index for a cell that this rank does not have: a halo cell, or the missing cell of a face in the
 * caller's separate list of boundary faces. */
static const int64_t outside = INT64_MIN;

session_face_sides session_get_owner_arrays(const insitu_mesh *given)
{
    return (session_face_sides){given, session_index_array(given, &given->owner),
                                session_index_array(given, &given->neighbour),
                                session_index_array(given, &given->boundary_owner)};
}

void session_find_cells_of_face(const session_face_sides *sides, int64_t face, int64_t cells[2])
{
    const insitu_mesh *given = sides->given;
    const int64_t base = given->index_base, apart = face - given->face_count;
    cells[0] = grid_read_index(apart < 0 ? &sides->owner : &sides->boundary_owner, apart < 0 ? face : apart);
    cells[1] = -1;
    if (apart < 0 && face < given->neighbour_count && sides->neighbour.data)
        cells[1] = grid_read_index(&sides->neighbour, face);
    if (cells[1] == -1 - base) cells[1] = -1;
    if (apart >= 0 && (cells[0] == -1 || cells[0] == -1 - base)) cells[0] = outside;
    for (int i = 0; i < 2; i++)
        if (cells[i] >= given->cell_count && cells[i] - given->cell_count < given->halo_cell_count) cells[i] = outside;
    /* In CGNS, cell 0 means that there is no cell, on either side of the face. */
    if (cells[1] >= 0 && (cells[0] == outside || (base == 1 && cells[0] == -1))) {
        cells[0] = cells[1];
        cells[1] = -1;
    }
}

static insitu_status check_owner_and_neighbour(const session_mesh *mesh, int64_t face, const int64_t cells[2],
                                               base_error *error)
{
    const long long base = mesh->given.index_base, at = face + base;
    const long long last = mesh->given.cell_count + mesh->given.halo_cell_count - 1 + base;
    if (cells[0] != outside && (cells[0] < 0 || cells[0] > last - base))
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": face %lld: its owner %lld is outside %lld..%lld (index_base is %lld)",
                         mesh->label, at, cells[0] + base, base, last, base);
    if (cells[1] != outside && (cells[1] < -1 || cells[1] > last - base))
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": face %lld: its neighbour %lld is outside %lld..%lld (index_base is %lld), "
                         "nor is it %lld, as on the boundary",
                         mesh->label, at, cells[1] + base, base, last, base, base - 1);
    if (cells[0] == cells[1] && cells[0] != outside)
        return base_fail(error, INSITU_ERROR_MESH, "mesh \"%s\": face %lld: its owner and its neighbour are both %lld",
                         mesh->label, at, cells[0] + base);
    return INSITU_OK;
}

/* Counts the faces of each cell. The count of cell c is stored in offsets[c + 1]. */
static insitu_status count_faces_of_cells(const session_mesh *mesh, const session_face_sides *sides,
                                          const grid_array *offsets, base_error *error)
{
    for (int64_t face = 0; face < session_face_count(&mesh->given); face++) {
        int64_t cells[2];
        session_find_cells_of_face(sides, face, cells);
        if (check_owner_and_neighbour(mesh, face, cells, error)) return error->status;
        for (int i = 0; i < 2 && cells[i] >= 0; i++)
            session_store_index(offsets, cells[i] + 1, grid_read_index(offsets, cells[i] + 1) + 1);
    }
    return INSITU_OK;
}

/* Converts the numbers of faces in t->offsets into offsets, and then stores the index of each face in the lists of its
 * cells. Storing a face advances the offset of its cell, which finally is the offset of the next cell; the last loop
 * shifts all offsets back. */
static void store_faces_of_cells(const session_mesh *mesh, const session_face_sides *sides, const session_topology *t)
{
    const int64_t count = mesh->given.cell_count;
    for (int64_t c = 0; c < count; c++)
        session_store_index(&t->offsets, c + 1, grid_read_index(&t->offsets, c + 1) + grid_read_index(&t->offsets, c));
    for (int64_t face = 0; face < session_face_count(&mesh->given); face++) {
        int64_t cells[2];
        session_find_cells_of_face(sides, face, cells);
        for (int i = 0; i < 2 && cells[i] >= 0; i++) {
            const int64_t at = grid_read_index(&t->offsets, cells[i]);
            session_store_index(&t->connectivity, at, face);
            session_store_index(&t->offsets, cells[i], at + 1);
        }
    }
    for (int64_t c = count; c > 0; c--) session_store_index(&t->offsets, c, grid_read_index(&t->offsets, c - 1));
    session_store_index(&t->offsets, 0, 0);
}

/* Computes the list of the faces of each cell from the owners and neighbours of faces. */
static insitu_status list_faces_of_cells(session_mesh *mesh, base_error *error)
{
    const insitu_mesh *given = &mesh->given;
    session_topology *t = &mesh->topology;
    const session_face_sides sides = session_get_owner_arrays(given);
    const int64_t faces = session_face_count(given), most = faces + given->neighbour_count;
    t->has_own_cells = true;
    t->cell_type = GRID_POLYHEDRON;
    if (!session_allocate_indices(mesh, "cells' offsets", given->cell_count, most, &t->offsets, error))
        return error->status;
    if (count_faces_of_cells(mesh, &sides, &t->offsets, error)) return error->status;
    int64_t total = 0;
    for (int64_t c = 0; c < given->cell_count; c++) total += grid_read_index(&t->offsets, c + 1);
    if (!session_allocate_indices(mesh, "cells' faces", total, faces, &t->connectivity, error)) return error->status;
    store_faces_of_cells(mesh, &sides, t);
    t->connectivity_count = total;
    t->cell_bytes = (given->cell_count + 1) * t->offsets.stride + (total + 1) * t->connectivity.stride;
    return INSITU_OK;
}

/* ---- recognition of a polyhedron as a tet, hex, wedge or pyramid ------------------------------------------------- */

enum { MOST_FACES = 6 };

typedef struct face_ring {
    int count; /* number of vertices: 3 or 4 */
    int64_t vertex[4];
} face_ring;

/* Reads a face's vertices. Returns false if the face does not exist, has a vertex that does not exist, or does not have
 * 3 or 4 vertices. */
static bool read_face_ring(const session_mesh *mesh, int64_t face, face_ring *ring)
{
    const grid *g = &mesh->cells;
    int64_t from, to;
    if (face < 0 || face >= g->face_count) return false;
    grid_face_vertices(g, face, &from, &to);
    if (from < 0 || to < from || to > mesh->topology.face_connectivity_count) return false;
    if (to - from < 3 || to - from > 4) return false;
    ring->count = (int)(to - from);
    for (int i = 0; i < ring->count; i++) {
        ring->vertex[i] = grid_read_index(&g->face_connectivity, from + i);
        if (ring->vertex[i] < 0 || ring->vertex[i] >= g->vertex_count) return false;
    }
    return true;
}

/* Finds a face that contains the edge between `ends` and whose bit in the mask `used` is not set. rings: the faces of
 * the cell. above[i] receives the face's other vertex that is adjacent to ends[i]. Returns the face's index, or -1 if
 * there is none. */
static int find_side_face(const face_ring *rings, int count, unsigned used, const int64_t ends[2], int64_t above[2])
{
    for (int f = 0; f < count; f++) {
        const int n = rings[f].count;
        const int64_t *v = rings[f].vertex;
        for (int i = 0; i < n && !(used >> f & 1); i++)
            for (int back = 0; back < 2; back++) {
                if (v[i] != ends[back] || v[(i + 1) % n] != ends[1 - back]) continue;
                above[back] = v[(i + n - 1) % n];
                above[1 - back] = v[(i + 2) % n];
                return f;
            }
    }
    return -1;
}

/* Returns whether a face lists exactly the n vertices `top` in cyclic order, starting at any of them, in either
 * direction. */
static bool is_loop_of(const face_ring *ring, const int64_t *top, int n)
{
    if (ring->count != n) return false;
    for (int begin = 0; begin < n; begin++)
        for (int step = 1; step < n; step += n - 2) {
            int same = 0;
            while (same < n && ring->vertex[(begin + same * step) % n] == top[same]) same++;
            if (same == n) return true;
        }
    return false;
}

static bool are_distinct(const int64_t *vertices, int count)
{
    for (int i = 0; i < count; i++)
        for (int j = 0; j < i; j++)
            if (vertices[i] == vertices[j]) return false;
    return true;
}

/* Constructs a tet, hex, wedge or pyramid from its faces. rings: the `count` faces; base: index of the face that is the
 * base; side_size: number of vertices that each face with an edge of the base must have. vertices: receives the cell's
 * vertices in VTK's order, except that the cell may be left-handed. Returns false if the faces do not form such a
 * cell. */
static bool build_cell_on_base_face(const face_ring *rings, int count, int base, int side_size,
                                    int64_t vertices[GRID_MAX_CELL_VERTICES])
{
    const int n = rings[base].count, tops = side_size == 3 ? 1 : n;
    unsigned used = 1u << base;
    int64_t top[5] = {0};
    for (int i = 0; i < n; i++) {
        const int64_t ends[2] = {rings[base].vertex[i], rings[base].vertex[(i + 1) % n]};
        int64_t above[2];
        const int side = find_side_face(rings, count, used, ends, above);
        if (side < 0 || rings[side].count != side_size) return false;
        used |= 1u << side;
        if (i == 0) top[0] = above[0];
        if (above[0] != top[i]) return false;
        top[i + 1] = above[1];
    }
    if (top[n] != top[0]) return false;
    memcpy(vertices, rings[base].vertex, (size_t)n * sizeof *vertices);
    memcpy(vertices + n, top, (size_t)tops * sizeof *vertices);
    if (!are_distinct(vertices, n + tops)) return false;
    int left = 0;
    while (left < count - 1 && used >> left & 1) left++;
    return side_size == 3 || is_loop_of(&rings[left], top, n);
}

static void swap_vertices(int64_t *vertices, int i, int j)
{
    const int64_t v = vertices[i];
    vertices[i] = vertices[j];
    vertices[j] = v;
}

/* Reorders the vertices of a left-handed cell so that it becomes right-handed. The handedness is computed from the
 * current positions, since faces may be listed in either direction. Pictures do not depend on the handedness. */
static void make_right_handed(const grid *g, int type, int n, int64_t *vertices)
{
    double points[GRID_MAX_CELL_VERTICES][3];
    const int count = grid_type_vertex_count(type);
    for (int i = 0; i < count; i++) grid_read_vertex_position(g, vertices[i], points[i]);
    if (!(tally_signed_volume(type, points) < 0)) return;
    swap_vertices(vertices, 1, n - 1);
    if (count == 2 * n) swap_vertices(vertices, n + 1, 2 * n - 1);
}

/* Returns the type of cell that a polyhedron's faces form: a tet, hex, wedge or pyramid, whose vertices are stored in
 * `vertices` in VTK's order; GRID_POLYHEDRON if the faces form none of these. */
static int recognise_polyhedron(const session_mesh *mesh, int64_t cell, int64_t vertices[GRID_MAX_CELL_VERTICES])
{
    static const struct {
        int type, triangles, quads, base, side;
    } shapes[] = {{GRID_TET, 4, 0, 3, 3}, {GRID_PYRAMID, 4, 1, 4, 3}, {GRID_WEDGE, 2, 3, 3, 4}, {GRID_HEX, 0, 6, 4, 4}};
    const grid *g = &mesh->cells;
    face_ring rings[MOST_FACES];
    int64_t first, end;
    int triangles = 0, base = 0;
    grid_cell_faces(g, cell, &first, &end);
    const int count = end - first <= MOST_FACES ? (int)(end - first) : 0;
    for (int i = 0; i < count; i++) {
        if (!read_face_ring(mesh, grid_read_index(&g->connectivity, first + i), &rings[i])) return GRID_POLYHEDRON;
        triangles += rings[i].count == 3;
    }
    for (size_t s = 0; s < sizeof shapes / sizeof shapes[0]; s++) {
        if (count != shapes[s].triangles + shapes[s].quads || triangles != shapes[s].triangles) continue;
        while (rings[base].count != shapes[s].base) base++;
        if (!build_cell_on_base_face(rings, count, base, shapes[s].side, vertices)) return GRID_POLYHEDRON;
        make_right_handed(g, shapes[s].type, shapes[s].base, vertices);
        return shapes[s].type;
    }
    return GRID_POLYHEDRON;
}

/* ---- recognition of all polyhedra -------------------------------------------------------------------------------- */

enum { TYPES = GRID_POLYHEDRON + 1 };

typedef struct recognition {
    bool is_faulty; /* set if some cell of the mesh is invalid, so that no polyhedron is recognized */
    /* polyhedron_count: number of polyhedra that the caller gave; recognised_count: number of these polyhedra that are
     * read as another type */
    int64_t polyhedron_count, recognised_count;
    int64_t type_counts[TYPES]; /* for each type, the number of cells that will be read as this type */
    int64_t entry_count;        /* number of connectivity entries of all cells after recognition */
    unsigned char *types;
} recognition;

/* Returns whether the cell's entries lie within the connectivity and are indices of faces or vertices. */
static bool has_valid_connectivity(const session_mesh *mesh, int64_t cell, int type)
{
    const grid *g = &mesh->cells;
    const int64_t limit = type == GRID_POLYHEDRON ? g->face_count : g->vertex_count;
    int64_t first, end;
    grid_cell_faces(g, cell, &first, &end);
    if (first < 0 || end > mesh->topology.connectivity_count || end < first) return false;
    if (type != GRID_POLYHEDRON && end - first != grid_type_vertex_count(type)) return false;
    for (int64_t i = first; i < end; i++) {
        const int64_t index = grid_read_index(&g->connectivity, i);
        if (index < 0 || index >= limit) return false;
    }
    return true;
}

static void recognise_cell(const session_mesh *mesh, int64_t cell, recognition *r)
{
    const int type = grid_cell_type(&mesh->cells, cell);
    int64_t vertices[GRID_MAX_CELL_VERTICES], first, end;
    if ((grid_type_vertex_count(type) == 0 && type != GRID_POLYHEDRON) || !has_valid_connectivity(mesh, cell, type)) {
        r->is_faulty = true;
        return;
    }
    const int now = type == GRID_POLYHEDRON ? recognise_polyhedron(mesh, cell, vertices) : type;
    grid_cell_faces(&mesh->cells, cell, &first, &end);
    r->types[cell] = (unsigned char)now;
    r->polyhedron_count += type == GRID_POLYHEDRON;
    r->recognised_count += now != type;
    r->type_counts[now]++;
    r->entry_count += now == GRID_POLYHEDRON ? end - first : grid_type_vertex_count(now);
}

static void recognise_cells(const session_mesh *mesh, int threads, recognition *r)
{
    const int64_t count = mesh->cells.cell_count;
#pragma omp parallel num_threads(threads)
    {
        region_enter();
        recognition mine = {.types = r->types};
#pragma omp for schedule(static)
        for (int64_t cell = 0; cell < count; cell++) recognise_cell(mesh, cell, &mine);
#pragma omp critical(session_topology_recognise)
        {
            r->is_faulty = r->is_faulty || mine.is_faulty;
            r->polyhedron_count += mine.polyhedron_count;
            r->recognised_count += mine.recognised_count;
            for (int type = 0; type < TYPES; type++) r->type_counts[type] += mine.type_counts[type];
            r->entry_count += mine.entry_count;
        }
        region_leave();
    }
}

/* Returns the type that all cells have, or 0 if types differ. */
static int find_common_type(const recognition *r, int64_t count)
{
    int type = TYPES - 1;
    while (type > 0 && r->type_counts[type] != count) type--;
    return type;
}

static void store_recognised_cell(const session_mesh *mesh, int64_t cell, int type, int64_t at, const grid_array *out)
{
    const grid *g = &mesh->cells;
    int64_t vertices[GRID_MAX_CELL_VERTICES], first, end;
    if (type == grid_cell_type(g, cell)) {
        grid_cell_faces(g, cell, &first, &end);
        for (int64_t i = first; i < end; i++) session_store_index(out, at++, grid_read_index(&g->connectivity, i));
        return;
    }
    recognise_polyhedron(mesh, cell, vertices);
    for (int i = 0; i < grid_type_vertex_count(type); i++) session_store_index(out, at++, vertices[i]);
}

static void store_offsets(const session_mesh *mesh, const recognition *r, const grid_array *out)
{
    int64_t at = 0;
    for (int64_t cell = 0; cell < mesh->cells.cell_count; cell++) {
        int64_t first = 0, end = grid_type_vertex_count(r->types[cell]);
        if (r->types[cell] == GRID_POLYHEDRON) grid_cell_faces(&mesh->cells, cell, &first, &end);
        at += end - first;
        session_store_index(out, cell + 1, at);
    }
}

/* Stores the types, offsets and connectivity of all cells, after recognition, in the mesh's topology. If all cells have
 * one type, neither types nor offsets are stored. */
static insitu_status store_recognised_cells(session_mesh *mesh, recognition *r, int threads, base_error *error)
{
    session_topology *t = &mesh->topology;
    const int64_t count = mesh->cells.cell_count, vertices = mesh->cells.vertex_count, faces = mesh->cells.face_count;
    const int type = find_common_type(r, count), size = grid_type_vertex_count(type);
    grid_array offsets = {0}, connectivity;
    if (!session_allocate_indices(mesh, "recognised cells", r->entry_count, vertices > faces ? vertices : faces,
                                  &connectivity, error))
        return error->status;
    if (!type && !session_allocate_indices(mesh, "recognised cells' offsets", count, r->entry_count, &offsets, error)) {
        session_drop_array(&connectivity);
        return error->status;
    }
    if (!type) store_offsets(mesh, r, &offsets);
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t cell = 0; cell < count; cell++)
            store_recognised_cell(mesh, cell, r->types[cell], type ? cell * size : grid_read_index(&offsets, cell),
                                  &connectivity);
        region_leave();
    }
    session_drop_array(&t->offsets);
    session_drop_array(&t->connectivity);
    t->has_own_cells = true;
    t->offsets = offsets;
    t->connectivity = connectivity;
    t->cell_type = type;
    t->connectivity_count = r->entry_count;
    t->cell_bytes = (r->entry_count + 1) * connectivity.stride + (type ? 0 : (count + 1) * offsets.stride + count);
    if (type) return INSITU_OK;
    t->cell_types = r->types;
    r->types = NULL;
    return INSITU_OK;
}

static insitu_status recognise_polyhedra_of_mesh(session_mesh *mesh, int threads, base_error *error)
{
    session_topology *t = &mesh->topology;
    const grid *g = &mesh->cells;
    const int64_t count = g->cell_count;
    recognition r = {0};
    if (grid_offset_end(&g->offsets, count - 1) != t->connectivity_count) return INSITU_OK;
    r.types = base_alloc((size_t)count);
    if (!r.types)
        return base_fail(error, INSITU_ERROR_MEMORY, "mesh \"%s\": no memory for %lld bytes of cells' types",
                         mesh->label, (long long)count);
    recognise_cells(mesh, threads, &r);
    insitu_status status = INSITU_OK;
    if (!r.is_faulty) t->polyhedron_count = r.polyhedron_count;
    if (!r.is_faulty && r.recognised_count) {
        t->recognised_count = r.recognised_count;
        status = store_recognised_cells(mesh, &r, threads, error);
    }
    base_free(r.types);
    if (status || r.is_faulty || r.recognised_count < r.polyhedron_count) return status;
    session_drop_array(&t->face_offsets);
    session_drop_array(&t->face_connectivity);
    t->has_own_faces = true;
    t->face_bytes = t->face_connectivity_count = 0;
    return INSITU_OK;
}

/* Returns whether some cells may be polyhedra. */
static bool may_have_polyhedra(const grid *g)
{
    return g->cell_count && g->offsets.data && grid_may_have_polyhedra(g) &&
           (g->cell_types || g->cell_type == GRID_POLYHEDRON);
}

/* Marks the session's copies of cell values as stale, because they contain one value for each piece of a cell. */
static void mark_value_copies_stale(session_mesh *mesh)
{
    for (int i = 0; i < mesh->field_count; i++)
        if (mesh->fields[i].given.centring == INSITU_CELL) session_drop_copy(&mesh->fields[i]);
}

insitu_status session_make_topology(session_mesh *mesh, int threads, base_error *error)
{
    insitu_status status = INSITU_OK;
    if (mesh->topology.is_split) mark_value_copies_stale(mesh);
    session_drop_topology(&mesh->topology);
    session_select_grid_arrays(mesh);
    if ((mesh->given.face_lists.data && mesh->given.face_sizes.data) || mesh->given.boundary_face_count)
        status = copy_face_lists(mesh, error);
    if (!status && session_has_face_owners(&mesh->given)) status = list_faces_of_cells(mesh, error);
    if (!status && session_has_higher_order(&mesh->given))
        status = session_split_cells(mesh, threads, error);
    else if (!status && session_must_reorder_vertices(&mesh->given))
        status = session_order_cells(mesh, threads, error);
    session_select_grid_arrays(mesh);
    if (!status && !mesh->given.keep_polyhedra && may_have_polyhedra(&mesh->cells))
        status = recognise_polyhedra_of_mesh(mesh, threads, error);
    if (status) session_drop_topology(&mesh->topology);
    session_select_grid_arrays(mesh);
    mesh->topology.is_made = !status;
    if (mesh->topology.is_split) mark_value_copies_stale(mesh);
    return status;
}
