/* Reads unstructured topologies. Blueprint's cells and faces use VTK's vertex order. As in insitu_mesh, a polyhedron is
 * a list of faces, and a face is a list of vertices. Blueprint's offsets have no final entry, and may be missing if
 * there are sizes. */
#include "blueprint_mesh.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SHAPE_POINT = 1, SHAPE_LINE = 3, MAP_SIZE = 65536 };

typedef struct shape {
    const char *name;
    int type;
    int vertices; /* vertices per cell; 0 if their number differs from cell to cell */
} shape;

static const shape shapes[] = {{"tri", INSITU_TRIANGLE, 3},      {"quad", INSITU_QUAD, 4},
                               {"tet", INSITU_TET, 4},           {"hex", INSITU_HEX, 8},
                               {"wedge", INSITU_WEDGE, 6},       {"pyramid", INSITU_PYRAMID, 5},
                               {"polygonal", INSITU_POLYGON, 0}, {"polyhedral", INSITU_POLYHEDRON, 0},
                               {"point", SHAPE_POINT, 1},        {"line", SHAPE_LINE, 2}};

static const shape *find_shape(const char *name)
{
    for (size_t i = 0; i < sizeof shapes / sizeof shapes[0]; i++)
        if (strcmp(shapes[i].name, name) == 0) return &shapes[i];
    return NULL;
}

static bool set_unknown_shape_error(const node *of, const char *path, const char *name)
{
    return node_set_error(
        of, path, INSITU_ERROR_MESH,
        "is \"%s\", expected tri, quad, polygonal, tet, hex, wedge, pyramid, polyhedral, mixed, point or line", name);
}

/* Reads an optional array of integers. If it is missing, out->count is -1. */
static bool read_optional_integers(const node *parent, const char *path, node_array *out)
{
    node found;
    *out = (node_array){.count = -1};
    if (!node_find(parent, path, &found)) return true;
    if (!node_read_array(&found, out)) return false;
    return node_is_integer_array(out) || out->count == 0 ||
           node_set_error(&found, "", INSITU_ERROR_MESH, "are no whole numbers");
}

static bool read_required_integers(const node *parent, const char *path, node_array *out)
{
    if (!node_has(parent, path)) return node_set_error(parent, path, INSITU_ERROR_MESH, "is missing");
    return read_optional_integers(parent, path, out);
}

/* ---- cells and faces with different numbers of vertices --------------------------------------------------------- */

/* Lists that are stored one after the other in `connectivity`: the vertices of each cell or face, or the faces of each
 * polyhedron. */
typedef struct row_list {
    node_array connectivity, sizes, offsets;
    int64_t count; /* number of lists in connectivity */
    int vertices;  /* length of each list; 0 if the lists have different lengths, which are then given by `sizes` */
} row_list;

static int64_t row_size(const row_list *rows, int64_t i)
{
    return rows->sizes.count >= 0 ? node_get_element(&rows->sizes.array, i) : rows->vertices;
}

/* Computes the offsets of the lists from their sizes, for a node without offsets. */
static bool compute_row_offsets(const node *of, row_list *rows, owned_arrays *owned)
{
    const int64_t bytes = rows->count * (int64_t)sizeof(int64_t);
    int64_t *offsets = owned_arrays_add(of, owned, bytes), sum = 0;
    if (!offsets) return false;
    for (int64_t i = 0; i < rows->count; i++) {
        offsets[i] = sum;
        sum += row_size(rows, i);
    }
    rows->offsets = (node_array){{offsets, INSITU_INT64, 0}, rows->count};
    node_report_copy(of, "offsets", bytes, "made from sizes, as the node has none");
    return true;
}

/* Checks that each list ends where the next one begins, because the session reads them as contiguous. */
static bool check_offsets(const node *of, const row_list *rows)
{
    for (int64_t i = 0; i < rows->count; i++) {
        const int64_t first = node_get_element(&rows->offsets.array, i), size = row_size(rows, i);
        const int64_t next =
            i + 1 < rows->count ? node_get_element(&rows->offsets.array, i + 1) : rows->connectivity.count;
        if (first < 0 || size < 0 || first > rows->connectivity.count || size > rows->connectivity.count - first)
            return node_set_error(of, "offsets", INSITU_ERROR_MESH, "entry %lld: %lld and size %lld, outside 0..%lld",
                                  (long long)i, (long long)first, (long long)size, (long long)rows->connectivity.count);
        if (first + size != next)
            return node_set_error(
                of, "offsets", INSITU_ERROR_MESH,
                "entry %lld: %lld and size %lld, but the next begins at %lld: lists must follow one another",
                (long long)i, (long long)first, (long long)size, (long long)next);
    }
    return true;
}

/* Reads the lists of a node `elements` or `subelements`, with their sizes and offsets. rows->vertices must be set;
 * sizes are then required only if it is 0. */
static bool read_rows(const node *of, row_list *rows, owned_arrays *owned)
{
    if (!read_required_integers(of, "connectivity", &rows->connectivity)) return false;
    if (!read_optional_integers(of, "sizes", &rows->sizes) || !read_optional_integers(of, "offsets", &rows->offsets))
        return false;
    if (rows->sizes.count < 0 && !rows->vertices) return node_set_error(of, "sizes", INSITU_ERROR_MESH, "is missing");
    rows->count = rows->sizes.count >= 0 ? rows->sizes.count : rows->connectivity.count / rows->vertices;
    if (rows->offsets.count >= 0 && rows->offsets.count != rows->count)
        return node_set_error(of, "offsets", INSITU_ERROR_MESH, "has %lld elements, expected %lld",
                              (long long)rows->offsets.count, (long long)rows->count);
    if (rows->offsets.count < 0 && !compute_row_offsets(of, rows, owned)) return false;
    return check_offsets(of, rows);
}

/* Reads the faces of polyhedra. The faces may be polygonal, all of one shape, or of mixed shapes. */
static bool read_faces(const node *topology, blueprint_mesh *out)
{
    node faces;
    const char *name = NULL;
    row_list rows = {.vertices = 0};
    if (!node_require(topology, "subelements", &faces) || !node_read_string(&faces, "shape", &name)) return false;
    const shape *of = find_shape(name);
    if (!of && strcmp(name, "mixed") != 0) return set_unknown_shape_error(&faces, "shape", name);
    if (of && of->type != INSITU_POLYGON && of->type != INSITU_TRIANGLE && of->type != INSITU_QUAD)
        return node_set_error(&faces, "shape", INSITU_ERROR_MESH, "is \"%s\", expected tri, quad, polygonal or mixed",
                              name);
    rows.vertices = of ? of->vertices : 0;
    if (!read_rows(&faces, &rows, &out->owned)) return false;
    out->mesh.face_count = rows.count;
    out->mesh.face_offsets = rows.offsets.array;
    out->mesh.face_connectivity = rows.connectivity.array;
    out->mesh.face_connectivity_count = rows.connectivity.count;
    return true;
}

/* ---- cells of several types ------------------------------------------------------------------------------------- */

/* Reads the map from shape numbers to cell types. *are_vtk is set to true if every shape number equals VTK's number of
 * the cell type. */
static bool read_map(const node *elements, blueprint_mesh *out, bool *are_vtk)
{
    node map;
    if (!node_find(elements, "shape_map", &map) && !node_find(elements, "shapes_map", &map))
        return node_set_error(elements, "shape_map", INSITU_ERROR_MESH, "is missing");
    out->type_map = calloc(MAP_SIZE, sizeof *out->type_map);
    if (!out->type_map) return node_set_error(&map, "", INSITU_ERROR_MEMORY, "no memory for a table");
    *are_vtk = true;
    for (int64_t i = 0; i < node_child_count(&map); i++) {
        node entry;
        int64_t number = -1;
        node_get_child(&map, i, &entry);
        const shape *of = find_shape(entry.name);
        if (!of) return set_unknown_shape_error(&map, entry.name, entry.name);
        if (!node_read_integer(&map, entry.name, true, &number)) return false;
        if (number < 0 || number >= MAP_SIZE)
            return node_set_error(&entry, "", INSITU_ERROR_MESH, "is %lld, expected 0..%d", (long long)number,
                                  MAP_SIZE - 1);
        out->type_map[number] = of->type;
        *are_vtk = *are_vtk && number == of->type;
        if (number >= out->mesh.cell_type_map_count) out->mesh.cell_type_map_count = (int)number + 1;
    }
    return true;
}

/* Checks that the map from shape numbers to cell types contains the number of every cell. Topologies with points or
 * lines are left out. *has_polyhedra is set to true if a cell is a polyhedron. */
static bool check_shape_numbers(const node *elements, const node_array *numbers, blueprint_mesh *out,
                                bool *has_polyhedra)
{
    for (int64_t i = 0; i < numbers->count; i++) {
        const int64_t number = node_get_element(&numbers->array, i);
        const int type = number >= 0 && number < MAP_SIZE ? out->type_map[number] : 0;
        if (!type)
            return node_set_error(elements, "shapes", INSITU_ERROR_MESH,
                                  "entry %lld is %lld, which shape_map does not have", (long long)i, (long long)number);
        *has_polyhedra = *has_polyhedra || type == INSITU_POLYHEDRON;
        if (type != SHAPE_POINT && type != SHAPE_LINE) continue;
        node_report_left_out(elements, "shapes", "entry %lld is a %s, and points and lines are not drawn", (long long)i,
                             type == SHAPE_POINT ? "point" : "line");
        out->is_left_out = true;
        break;
    }
    return true;
}

static void set_cell_rows(const row_list *rows, blueprint_mesh *out)
{
    out->mesh.cell_count = rows->count;
    out->mesh.offsets = rows->offsets.array;
    out->mesh.connectivity = rows->connectivity.array;
    out->mesh.connectivity_count = rows->connectivity.count;
}

static bool read_cells_of_several_types(const node *topology, const node *elements, blueprint_mesh *out)
{
    node_array numbers;
    row_list rows = {.vertices = 0};
    bool are_vtk = false, has_polyhedra = false;
    if (!read_required_integers(elements, "shapes", &numbers) || !read_map(elements, out, &are_vtk)) return false;
    if (!check_shape_numbers(elements, &numbers, out, &has_polyhedra)) return false;
    if (out->is_left_out) return true;
    if (!read_rows(elements, &rows, &out->owned)) return false;
    if (numbers.count != rows.count)
        return node_set_error(elements, "shapes", INSITU_ERROR_MESH, "has %lld elements, sizes has %lld",
                              (long long)numbers.count, (long long)rows.count);
    set_cell_rows(&rows, out);
    out->mesh.cell_types = numbers.array;
    out->mesh.cell_type_map = are_vtk ? NULL : out->type_map;
    if (are_vtk) out->mesh.cell_type_map_count = 0;
    return !has_polyhedra || read_faces(topology, out);
}

/* ---- cells of one type ------------------------------------------------------------------------------------------ */

static bool read_cells_of_one_type(const node *elements, const shape *of, blueprint_mesh *out)
{
    row_list rows = {.vertices = of->vertices, .sizes = {.count = -1}};
    if (!read_required_integers(elements, "connectivity", &rows.connectivity)) return false;
    if (rows.connectivity.count % of->vertices != 0)
        return node_set_error(elements, "connectivity", INSITU_ERROR_MESH,
                              "has %lld elements, no multiple of a %s's %d", (long long)rows.connectivity.count,
                              of->name, of->vertices);
    if (!read_optional_integers(elements, "offsets", &rows.offsets)) return false;
    rows.count = rows.offsets.count >= 0 ? rows.offsets.count : rows.connectivity.count / of->vertices;
    if (rows.offsets.count >= 0 && !check_offsets(elements, &rows)) return false;
    rows.offsets = (node_array){.count = 0}; /* not needed: check_offsets() found them equal to the regular offsets */
    set_cell_rows(&rows, out);
    return true;
}

bool blueprint_read_unstructured(const node *topology, blueprint_mesh *out)
{
    node elements;
    const char *name;
    out->mesh.open_offsets = 1;
    if (!node_require(topology, "elements", &elements)) return false;
    if (node_has(&elements, "element_types") || node_has(&elements, "stream")) {
        node_report_left_out(&elements, "element_types",
                             "the old form of mixed cells is not read: give shapes and a shape_map");
        out->is_left_out = true;
        return true;
    }
    if (!node_read_string(&elements, "shape", &name)) return false;
    if (strcmp(name, "mixed") == 0) return read_cells_of_several_types(topology, &elements, out);
    const shape *of = find_shape(name);
    if (!of) return set_unknown_shape_error(&elements, "shape", name);
    if (of->type == SHAPE_POINT || of->type == SHAPE_LINE) {
        node_report_left_out(&elements, "shape", "is \"%s\": points and lines are not drawn", name);
        out->is_left_out = true;
        return true;
    }
    out->mesh.cell_type = (insitu_cell_type)of->type;
    if (of->vertices) return read_cells_of_one_type(&elements, of, out);
    row_list rows = {.vertices = 0};
    if (!read_rows(&elements, &rows, &out->owned)) return false;
    set_cell_rows(&rows, out);
    return of->type != INSITU_POLYHEDRON || read_faces(topology, out);
}
