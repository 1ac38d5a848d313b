/* Validates a mesh before any other code reads it, because the grid's accessors check nothing.
 *
 * The cells are checked in one parallel pass, in blocks. Each thread records the lowest index of the invalid cells that
 * it has found. The lowest index of all threads is reported, so that the result does not depend on the number of
 * threads. The error message is composed afterwards, from a second check of this cell. Coordinates are checked only if
 * a drawn cell uses them. Vertices that belong to no cell, or only to ghosts, may have any coordinates. Indices are
 * checked for ghosts too. */
#include "session_check.h"

#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_conform.h"
#include "session_lattice.h"
#include "session_nodes.h"
#include "session_region.h"
#include "session_split.h"
#include "session_tally.h"
#include "session_topology.h"

/* ---- polyhedra -----------------------------------------------------------------------------------------------
 *
 * Checks that the faces of a polyhedron are valid and together bound a volume. A ray that enters a cell must leave it,
 * so exactly two faces must meet at every edge. The edges of all faces are sorted, so that equal edges follow each
 * other; an edge from a vertex to itself bounds nothing and is skipped. */

typedef struct face_edge {
    /* low, high: the edge's vertices, smaller index first; face: a face that has the edge. Indices count from 0. */
    int64_t low, high, face;
} face_edge;

/* A buffer of one thread, which is enlarged if necessary. It must be zero-initialized. */
typedef struct edge_buffer {
    face_edge *edges;
    int64_t capacity;
} edge_buffer;

typedef enum face_fault {
    FACES_GOOD,
    FACES_NO_MEMORY,
    FACES_TOO_FEW,       /* the cell has less than 4 faces */
    FACE_BAD_INDEX,      /* the cell refers to a face that does not exist */
    FACE_BAD_OFFSETS,    /* the offsets lie outside face_connectivity, or decrease */
    FACE_TOO_SMALL,      /* a face has less than 3 vertices */
    FACE_BAD_VERTEX,     /* a face refers to a vertex that does not exist */
    FACE_BAD_COORDINATE, /* a coordinate is not finite; this is not checked in ghosts */
    FACES_OPEN           /* some edge does not belong to exactly two faces */
} face_fault;

typedef struct face_fault_details {
    int64_t count;      /* number of the cell's faces */
    int64_t face;       /* index of the invalid face, counted from 0 */
    int64_t first, end; /* start and end of the face's vertices in face_connectivity */
    /* index of the invalid vertex (vertex), or of the two ends of an edge (vertex and other) */
    int64_t vertex, other;
    int sharing;        /* number of faces that have the edge between `vertex` and `other` */
    double position[3]; /* coordinates of the faulty vertex */
} face_fault_details;

static void free_edge_buffer(edge_buffer *buffer)
{
    base_free(buffer->edges);
    *buffer = (edge_buffer){0};
}

static bool reserve_edges(edge_buffer *buffer, int64_t count)
{
    if (count <= buffer->capacity) return true;
    const int64_t capacity = count + count / 2 + 64;
    face_edge *edges = base_realloc(buffer->edges, (size_t)capacity * sizeof *edges);
    if (!edges) return false;
    buffer->edges = edges;
    buffer->capacity = capacity;
    return true;
}

static bool is_finite_vertex(const grid *g, int64_t vertex, double position[3])
{
    grid_read_vertex_position(g, vertex, position);
    return isfinite(position[0]) && isfinite(position[1]) && isfinite(position[2]);
}

static face_fault check_face(const session_mesh *mesh, bool is_ghost, face_fault_details *details)
{
    const grid *g = &mesh->cells;
    if (details->face < 0 || details->face >= g->face_count) return FACE_BAD_INDEX;
    grid_face_vertices(g, details->face, &details->first, &details->end);
    if (details->first < 0 || details->end < details->first || details->end > mesh->topology.face_connectivity_count)
        return FACE_BAD_OFFSETS;
    if (details->end - details->first < 3) return FACE_TOO_SMALL;
    for (int64_t i = details->first; i < details->end; i++) {
        details->vertex = grid_read_index(&g->face_connectivity, i);
        if (details->vertex < 0 || details->vertex >= g->vertex_count) return FACE_BAD_VERTEX;
        if (!is_ghost && !is_finite_vertex(g, details->vertex, details->position)) return FACE_BAD_COORDINATE;
    }
    return FACES_GOOD;
}

static int64_t add_edges(const grid *g, const face_fault_details *details, face_edge *edges, int64_t count)
{
    int64_t from = grid_read_index(&g->face_connectivity, details->end - 1);
    for (int64_t i = details->first; i < details->end; i++) {
        const int64_t to = grid_read_index(&g->face_connectivity, i);
        if (from != to) edges[count++] = (face_edge){from < to ? from : to, from < to ? to : from, details->face};
        from = to;
    }
    return count;
}

static int compare_edges(const void *left, const void *right)
{
    const face_edge *a = left, *b = right;
    if (a->low != b->low) return a->low < b->low ? -1 : 1;
    if (a->high != b->high) return a->high < b->high ? -1 : 1;
    return a->face < b->face ? -1 : a->face > b->face;
}

static face_fault check_edges(face_edge *edges, int64_t count, face_fault_details *details)
{
    if (count) qsort(edges, (size_t)count, sizeof *edges, compare_edges);
    for (int64_t i = 0; i < count; i += 2) {
        int64_t end = i;
        while (end < count && edges[end].low == edges[i].low && edges[end].high == edges[i].high) end++;
        if (end - i == 2 && edges[i].face != edges[i + 1].face) continue;
        details->face = edges[i].face;
        details->vertex = edges[i].low;
        details->other = edges[i].high;
        details->sharing = end - i < 1000 ? (int)(end - i) : 1000;
        return FACES_OPEN;
    }
    return FACES_GOOD;
}

static face_fault check_faces(const session_mesh *mesh, int64_t cell, edge_buffer *buffer, face_fault_details *details)
{
    const grid *g = &mesh->cells;
    int64_t first, end, edges = 0;
    grid_cell_faces(g, cell, &first, &end);
    details->count = end - first;
    if (details->count < 4) return FACES_TOO_FEW;
    for (int64_t i = first; i < end; i++) {
        details->face = grid_read_index(&g->connectivity, i);
        const face_fault fault = check_face(mesh, grid_is_ghost(g, cell), details);
        if (fault) return fault;
        if (!reserve_edges(buffer, edges + details->end - details->first)) return FACES_NO_MEMORY;
        edges = add_edges(g, details, buffer->edges, edges);
    }
    return check_edges(buffer->edges, edges, details);
}

static insitu_status report_face_error(const session_mesh *mesh, int64_t cell, face_fault fault,
                                       const face_fault_details *details, base_error *error)
{
    const char *name = mesh->label;
    /* index of the first element in the caller's numbering; it is added to all indices and offsets in messages */
    const long long base = mesh->given.index_base;
    const long long at = cell, face = details->face + base, vertex = details->vertex + base;
    switch (fault) {
    case FACES_NO_MEMORY:
        return base_fail(error, INSITU_ERROR_MEMORY, "mesh \"%s\": no memory to check cell %lld", name, at);
    case FACES_TOO_FEW:
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": cell %lld (polyhedron): %lld faces, a closed surface has at least 4", name, at,
                         (long long)details->count);
    case FACE_BAD_INDEX:
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": cell %lld (polyhedron): face index %lld is outside %lld..%lld", name, at, face,
                         base, (long long)session_face_count(&mesh->given) - 1 + base);
    case FACE_BAD_OFFSETS:
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": cell %lld (polyhedron): face %lld: offsets %lld and %lld do not rise within "
                         "%lld..%lld",
                         name, at, face, details->first + base, details->end + base, base,
                         mesh->topology.face_connectivity_count + base);
    case FACE_TOO_SMALL:
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": cell %lld (polyhedron): face %lld has %lld vertices, at least 3 are needed",
                         name, at, face, (long long)(details->end - details->first));
    case FACE_BAD_VERTEX:
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": cell %lld (polyhedron): face %lld: vertex index %lld is outside %lld..%lld",
                         name, at, face, vertex, base, (long long)mesh->given.vertex_count - 1 + base);
    case FACE_BAD_COORDINATE:
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": cell %lld (polyhedron): face %lld: vertex %lld has a coordinate that is not "
                         "finite: (%g, %g, %g)",
                         name, at, face, vertex, details->position[0], details->position[1], details->position[2]);
    case FACES_OPEN:
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": cell %lld (polyhedron): face %lld: the edge from vertex %lld to %lld occurs %d "
                         "times, not once in each of two faces: the surface is not closed",
                         name, at, face, vertex, details->other + base, details->sharing);
    case FACES_GOOD: break;
    }
    return INSITU_OK;
}

/* ---- checks of cells of any type --------------------------------------------------------------------------------- */

enum { BLOCK_CELLS = 4096 };

typedef enum cell_fault { CELL_GOOD, BAD_TYPE, BAD_OFFSETS, BAD_INDEX, BAD_COORDINATE, BAD_FACES } cell_fault;

typedef struct fault_details {
    int type;
    int64_t first, end; /* the cell's offset, and the offset of the next cell */
    int64_t vertex;     /* index of the invalid vertex, counted from 0 */
    double position[3];
    face_fault fault_of_faces;
    face_fault_details faces;
} fault_details;

static cell_fault check_coordinates(const grid *g, const int64_t *vertices, int count, fault_details *details)
{
    for (int i = 0; i < count; i++) {
        grid_read_vertex_position(g, vertices[i], details->position);
        details->vertex = vertices[i];
        for (int axis = 0; axis < 3; axis++)
            if (!isfinite(details->position[axis])) return BAD_COORDINATE;
    }
    return CELL_GOOD;
}

static cell_fault check_polyhedron(const session_mesh *mesh, int64_t cell, edge_buffer *buffer, fault_details *details)
{
    const grid *g = &mesh->cells;
    if (!grid_may_have_polyhedra(g) || !g->offsets.data) return BAD_TYPE;
    details->first = grid_read_index(&g->offsets, cell);
    details->end = grid_offset_end(&g->offsets, cell);
    if (details->first < 0 || details->end > mesh->topology.connectivity_count || details->end < details->first)
        return BAD_OFFSETS;
    details->fault_of_faces = check_faces(mesh, cell, buffer, &details->faces);
    return details->fault_of_faces ? BAD_FACES : CELL_GOOD;
}

/* Checks a polygon. Polygons are the only type whose number of vertices differs from cell to cell. */
static cell_fault check_polygon(const session_mesh *mesh, int64_t cell, fault_details *details)
{
    const grid *g = &mesh->cells;
    if (!g->offsets.data) return BAD_TYPE;
    details->first = grid_read_index(&g->offsets, cell);
    details->end = grid_offset_end(&g->offsets, cell);
    if (details->first < 0 || details->end < details->first || details->end > mesh->given.connectivity_count ||
        details->end - details->first < 3)
        return BAD_OFFSETS;
    for (int64_t i = details->first; i < details->end; i++) {
        details->vertex = grid_read_index(&g->connectivity, i);
        if (details->vertex < 0 || details->vertex >= g->vertex_count) return BAD_INDEX;
        if (!grid_is_ghost(g, cell) && !is_finite_vertex(g, details->vertex, details->position)) return BAD_COORDINATE;
    }
    return CELL_GOOD;
}

static cell_fault check_cell(const session_mesh *mesh, int64_t cell, edge_buffer *buffer, fault_details *details)
{
    const grid *g = &mesh->cells;
    details->type = grid_cell_type(g, cell);
    if (details->type == GRID_POLYHEDRON) return check_polyhedron(mesh, cell, buffer, details);
    if (details->type == GRID_POLYGON) return check_polygon(mesh, cell, details);
    const int count = grid_type_vertex_count(details->type);
    if (count == 0) return BAD_TYPE;
    /* Ghosts of lattices need no check: a ghost that pads the lattice has no vertices, and the vertices of other cells
     * are in range because they are computed. */
    if (g->lattice && grid_is_ghost(g, cell)) return CELL_GOOD;
    if (g->offsets.data) {
        details->first = grid_read_index(&g->offsets, cell);
        details->end = grid_offset_end(&g->offsets, cell);
        if (details->first < 0 || details->end > mesh->topology.connectivity_count || details->end < details->first ||
            details->end - details->first != count)
            return BAD_OFFSETS;
    }
    int64_t vertices[GRID_MAX_CELL_VERTICES];
    grid_cell_vertices(g, cell, vertices);
    for (int i = 0; i < count; i++) {
        details->vertex = vertices[i];
        if (vertices[i] < 0 || vertices[i] >= g->vertex_count) return BAD_INDEX;
    }
    return grid_is_ghost(g, cell) ? CELL_GOOD : check_coordinates(g, vertices, count, details);
}

/* Returns the type as stored in the caller's array, which may contain 64-bit integers. */
static long long read_original_cell_type(const session_mesh *mesh, int64_t cell)
{
    const grid *g = &mesh->cells;
    if (mesh->conformed.types) {
        const grid_array numbers = session_grid_array(&mesh->original.cell_types);
        return (long long)grid_read_number(&numbers, cell);
    }
    if (!g->cell_types || g->cell_types_bytes < 8) return grid_cell_type(g, cell);
    const grid_array types = {
        .data = g->cell_types, .stride = g->cell_types_stride, .is_wide = true, .is_integer = true};
    return grid_read_index(&types, cell);
}

static const char *type_name(int type)
{
    switch (type) {
    case GRID_TET: return "tet";
    case GRID_HEX: return "hex";
    case GRID_WEDGE: return "wedge";
    case GRID_PYRAMID: return "pyramid";
    case GRID_POLYHEDRON: return "polyhedron";
    case GRID_TRIANGLE: return "triangle";
    case GRID_QUAD: return "quad";
    case GRID_POLYGON: return "polygon";
    default: break;
    }
    switch (session_get_linear_type(type)) {
    case GRID_TET: return "tet of higher order";
    case GRID_HEX: return "hex of higher order";
    case GRID_WEDGE: return "wedge of higher order";
    case GRID_PYRAMID: return "pyramid of higher order";
    case GRID_TRIANGLE: return "triangle of higher order";
    case GRID_QUAD: return "quad of higher order";
    default: return "unknown";
    }
}

/* Returns the name of the cell's type in the caller's description. The session may read a polyhedron as another
 * type. */
static const char *original_type_name(const session_mesh *mesh, int64_t cell)
{
    return type_name(session_caller_type(mesh, cell));
}

static insitu_status report_offset_error(const session_mesh *mesh, int64_t cell, const fault_details *details,
                                         base_error *error)
{
    const long long base = mesh->given.index_base, first = details->first + base, next = details->end + base;
    if (details->type == GRID_POLYGON && details->first >= 0 && details->end <= mesh->given.connectivity_count)
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": cell %lld (polygon): offsets %lld and %lld; a polygon has at least 3 vertices",
                         mesh->label, (long long)cell, first, next);
    if (details->type == GRID_POLYHEDRON && next < first)
        return base_fail(
            error, INSITU_ERROR_MESH,
            "mesh \"%s\": cell %lld (polyhedron): offsets fall from %lld to %lld; a polyhedron has at least 4 faces",
            mesh->label, (long long)cell, first, next);
    const char *format =
        details->end < details->first
            ? "mesh \"%s\": cell %lld (%s): offsets fall from %lld to %lld; a cell of its type has %d vertices"
            : "mesh \"%s\": cell %lld (%s): offsets %lld and %lld do not lie %d apart, the vertices of its type";
    if (details->first < 0 || (next >= first && details->end > mesh->topology.connectivity_count))
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": cell %lld (%s): offsets %lld and %lld are outside %lld..%lld", mesh->label,
                         (long long)cell, type_name(details->type), first, next, base,
                         mesh->topology.connectivity_count + base);
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
    return base_fail(error, INSITU_ERROR_MESH, format, mesh->label, (long long)cell, type_name(details->type), first,
                     next, grid_type_vertex_count(details->type));
#pragma GCC diagnostic pop
}

/* Checks an invalid cell a second time and returns its error with a message. If the second check finds no error, memory
 * ran out in the first check, and this is reported. */
static insitu_status describe_fault(const session_mesh *mesh, int64_t cell, base_error *error)
{
    fault_details details = {0};
    edge_buffer buffer = {0};
    const cell_fault fault = check_cell(mesh, cell, &buffer, &details);
    free_edge_buffer(&buffer);
    const long long base = mesh->given.index_base, at = session_caller_cell(mesh, cell), vertex = details.vertex + base;
    const char *type = original_type_name(mesh, cell);
    switch (fault) {
    case BAD_FACES: return report_face_error(mesh, cell, details.fault_of_faces, &details.faces, error);
    case BAD_TYPE:
        if (details.type == GRID_POLYHEDRON)
            return base_fail(error, INSITU_ERROR_MESH,
                             "mesh \"%s\": cell %lld is a polyhedron, and face_offsets are not given", mesh->label, at);
        return base_fail(
            error, INSITU_ERROR_MESH,
            "mesh \"%s\": cell %lld: unknown cell type %lld (10 tet, 12 hex, 13 wedge, 14 pyramid, 42 polyhedron; 5 "
            "triangle, 9 quad, 7 polygon)",
            mesh->label, at, read_original_cell_type(mesh, cell));
    case BAD_OFFSETS: return report_offset_error(mesh, cell, &details, error);
    case BAD_INDEX:
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": cell %lld (%s): vertex index %lld is outside %lld..%lld (index_base is %lld)",
                         mesh->label, at, type, vertex, base, (long long)mesh->given.vertex_count - 1 + base, base);
    case BAD_COORDINATE:
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": cell %lld (%s): vertex %lld has a coordinate that is not finite: (%g, %g, %g)",
                         mesh->label, at, type, vertex, details.position[0], details.position[1], details.position[2]);
    case CELL_GOOD: break;
    }
    return report_face_error(mesh, cell, FACES_NO_MEMORY, &details.faces, error);
}

/* Checks the cells begin .. end - 1, which may have any layout, one by one, and adds the valid ones to *tally. Returns
 * the first invalid cell, or `end` if all are valid. */
static int64_t check_cells_one_by_one(const session_mesh *mesh, int64_t begin, int64_t end, edge_buffer *buffer,
                                      mesh_tally *tally)
{
    mesh_tally own = tally_empty();
    fault_details details;
    int64_t cell = begin;
    for (; cell < end && check_cell(mesh, cell, buffer, &details) == CELL_GOOD; cell++)
        tally_cell(&mesh->cells, cell, &own);
    tally_merge(tally, &own);
    return cell;
}

/* Checks all cells in parallel and adds them to *tally. Returns the lowest index of an invalid cell, or cell_count if
 * all are valid. */
static int64_t check_cells(const session_mesh *mesh, int threads, mesh_tally *tally)
{
    const int64_t count = mesh->cells.cell_count;
    const tally_run run = tally_choose_check_function(mesh);
    int64_t first_bad = count;
    if (tally_lattice_by_axes(mesh, tally)) return count;
#pragma omp parallel num_threads(session_choose_loop_threads(threads, count)) reduction(min : first_bad)
    {
        region_enter();
        mesh_tally mine = tally_empty();
        edge_buffer buffer = {0};
#pragma omp for schedule(static)
        for (int64_t begin = 0; begin < count; begin += BLOCK_CELLS) {
            if (first_bad < count) continue;
            const int64_t end = begin + BLOCK_CELLS < count ? begin + BLOCK_CELLS : count;
            /* run() stops at an invalid cell, or at a cell that it cannot check, such as a polygon. The remaining cells
             * of the block are then checked one by one. */
            int64_t at = run ? run(mesh, begin, end, &mine) : begin;
            if (at < end) at = check_cells_one_by_one(mesh, at, end, &buffer, &mine);
            if (at < end) first_bad = at;
        }
        free_edge_buffer(&buffer);
#pragma omp critical(session_check_tally)
        tally_merge(tally, &mine);
        region_leave();
    }
    return first_bad;
}

static insitu_status check_last_offset(const session_mesh *mesh, base_error *error)
{
    const grid *g = &mesh->cells;
    if (!g->offsets.data || g->cell_count == 0) return INSITU_OK;
    const int64_t last = grid_offset_end(&g->offsets, g->cell_count - 1);
    if (last == mesh->topology.connectivity_count) return INSITU_OK;
    const long long base = mesh->given.index_base;
    return base_fail(error, INSITU_ERROR_MESH, "mesh \"%s\": the last offset is %lld, not connectivity_count%s, %lld",
                     mesh->label, last + base, base ? " + 1" : "", mesh->topology.connectivity_count + base);
}

/* Largest allowed coordinate. Squares and volumes of larger coordinates might overflow a double. */
static const double largest_coordinate = 1e100;

/* Reports the first drawn cell that has a coordinate above the largest allowed one. */
static insitu_status report_too_large_coordinate(const session_mesh *mesh, base_error *error)
{
    const grid *g = &mesh->cells;
    for (int64_t cell = 0; cell < g->cell_count; cell++) {
        if (grid_is_ghost(g, cell)) continue;
        grid_walk walk = grid_walk_cell(g, cell);
        int64_t vertex;
        while (grid_walk_next(&walk, &vertex)) {
            double p[3];
            grid_read_vertex_position(g, vertex, p);
            if (fmax(fabs(p[0]), fmax(fabs(p[1]), fabs(p[2]))) > largest_coordinate)
                return base_fail(
                    error, INSITU_ERROR_MESH,
                    "mesh \"%s\": cell %lld (%s): vertex %lld is at (%g, %g, %g), coordinates of at most %g "
                    "are supported",
                    mesh->label, (long long)session_caller_cell(mesh, cell), original_type_name(mesh, cell),
                    (long long)vertex + mesh->given.index_base, p[0], p[1], p[2], largest_coordinate);
        }
    }
    return INSITU_OK;
}

/* Reports an error if a mesh without z coordinates has a drawn cell of a volume type, because such a cell has no
 * volume. The message names the first such cell. Only mixed cells are checked here, because insitu_set_mesh() checks
 * the type of all others. */
static insitu_status check_cells_without_z(const session_mesh *mesh, const mesh_tally *tally, base_error *error)
{
    const grid *g = &mesh->cells;
    if (mesh->original.coordinates[2].data || g->lattice || tally->drawn_count == tally->shell_count) return INSITU_OK;
    int64_t cell = 0;
    while (cell + 1 < g->cell_count && (grid_is_ghost(g, cell) || grid_is_shell_type(grid_cell_type(g, cell)))) cell++;
    return base_fail(
        error, INSITU_ERROR_MESH,
        "mesh \"%s\": z coordinates are not given, but cell %lld (%s) needs them: only triangles, quads and "
        "polygons go without",
        mesh->label, (long long)session_caller_cell(mesh, cell), original_type_name(mesh, cell));
}

static bool has_too_large_coordinates(const mesh_tally *tally)
{
    bool far = false;
    for (int axis = 0; axis < 3 && tally->drawn_count; axis++)
        far = far || fmax(fabs(tally->lower[axis]), fabs(tally->upper[axis])) > largest_coordinate;
    return far;
}

static void find_flat_cells(const grid *g, int threads, uint64_t *flat)
{
    const int64_t words = (g->cell_count + 63) / 64;
#pragma omp parallel num_threads(session_choose_loop_threads(threads, g->cell_count))
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t word = 0; word < words; word++) {
            const int64_t first = 64 * word, end = first + 64 < g->cell_count ? first + 64 : g->cell_count;
            for (int64_t cell = first; cell < end; cell++)
                flat[word] |= (uint64_t)tally_is_flat(g, cell) << (cell - first);
        }
        region_leave();
    }
}

/* Finds the flat cells, which have no volume and are omitted from the tree. If the set of flat cells has changed, the
 * tree is dropped. */
static insitu_status update_flat_cells(session_mesh *mesh, int64_t count, int threads, base_error *error)
{
    const size_t bytes = (size_t)(mesh->cells.cell_count + 63) / 64 * sizeof *mesh->flat_cells;
    uint64_t *flat = NULL;
    if (count) {
        flat = base_calloc(bytes, 1);
        if (!flat) return base_fail(error, INSITU_ERROR_MEMORY, "no memory for %zu bytes of flat cells", bytes);
        find_flat_cells(&mesh->cells, threads, flat);
    }
    const bool is_same = !flat == !mesh->flat_cells && (!flat || memcmp(flat, mesh->flat_cells, bytes) == 0);
    if (!is_same) session_drop_tree(mesh);
    base_free(mesh->flat_cells);
    mesh->cells.flat = mesh->flat_cells = flat;
    return INSITU_OK;
}

static insitu_status check_mesh_cells(session_mesh *mesh, int threads, base_error *error)
{
    mesh_tally tally = tally_empty();
    const int64_t bad = check_cells(mesh, threads, &tally);
    if (bad < mesh->cells.cell_count) return describe_fault(mesh, bad, error);
    insitu_status status =
        has_too_large_coordinates(&tally) ? report_too_large_coordinate(mesh, error) : check_last_offset(mesh, error);
    if (!status) status = check_cells_without_z(mesh, &tally, error);
    if (!status) status = update_flat_cells(mesh, tally.flat_count, threads, error);
    if (status) return status;
    for (int axis = 0; axis < 3; axis++) {
        mesh->lower[axis] = tally.lower[axis];
        mesh->upper[axis] = tally.upper[axis];
    }
    mesh->drawn_count = tally.drawn_count;
    mesh->given_counts = (session_counts){tally.drawn_count, tally.ghost_count, tally.inverted_count, tally.flat_count,
                                          tally.shell_count};
    /* If cells of higher order are refined (session_finer.h), the tally lacks the linear pieces that were not made; the
     * counts of the caller's cells are then stored in `finer`. */
    if (mesh->finer.parts)
        mesh->given_counts = mesh->finer.given_counts;
    else if (mesh->topology.is_split)
        mesh->given_counts = session_count_split_cells(mesh, tally.inverted_count > 0);
    /* cells that pad a lattice are not counted as ghosts */
    if (mesh->cells.lattice) mesh->given_counts.ghost_count -= mesh->cells.cell_count - session_cell_count(mesh);
    mesh->flat_count = tally.flat_count;
    mesh->shell_count = tally.shell_count;
    mesh->size_sum = tally.size_sum;
    mesh->is_check_stale = false;
    return INSITU_OK;
}

static insitu_status report_misaligned_finer_block(const session_mesh *mesh, base_error *error)
{
    const session_misfit *m = &mesh->misfit;
    const int64_t own = mesh->given.lattice->refinement[m->axis];
    return base_fail(error, INSITU_ERROR_MESH,
                     "mesh \"%s\": lattice: block %lld of rank %d, whose refinement along %c is %lld, covers part of a "
                     "cell of this block, whose refinement is %lld: finer blocks begin and end at borders of coarser "
                     "cells",
                     mesh->label, (long long)m->block, m->rank, "ijk"[m->axis], (long long)m -> refinement,
                     (long long)own);
}

/* Checks a mesh. If it is invalid, the topology computed from its cells is dropped, because the caller may correct the
 * arrays in place. */
static insitu_status check_mesh(session_mesh *mesh, int threads, base_error *error)
{
    if (mesh->misfit.exists) return report_misaligned_finer_block(mesh, error);
    if (mesh->warp.problem.status) {
        *error = mesh->warp.problem;
        return error->status;
    }
    session_convert_arrays(mesh, threads);
    if (!mesh->topology.is_made && session_make_topology(mesh, threads, error)) return error->status;
    insitu_status status = session_compute_axis_coordinates(mesh, error);
    if (!status) status = check_mesh_cells(mesh, threads, error);
    if (status) session_drop_topology(&mesh->topology);
    if (!status || !mesh->warp.is_applied) return status;
    const base_error fault = *error;
    *error = (base_error){0};
    return base_fail(error, fault.status, "%.900s; the scene's warp moves its vertices", fault.message);
}

insitu_status session_check_meshes(const session_meshes *meshes, const session_team *team, base_error *error)
{
    for (int i = 0; i < meshes->count; i++) {
        session_mesh *mesh = meshes->items[i];
        if (!mesh->is_check_stale || !mesh->is_given) continue;
        mesh->problem = (base_error){0};
        mesh->is_problem_of_contents = true;
        check_mesh(mesh, team->threads, &mesh->problem);
        if (!error->status) *error = mesh->problem;
    }
    return session_agree(team->comm, error);
}
