#include "session_corner_cells.h"

#include "memory.h"
#include "session_rows.h"

static bool allocate_corner_cells(int64_t cells, int64_t vertices, session_corner_cells *out)
{
    out->origins = base_alloc(((size_t)vertices + 1) * sizeof *out->origins);
    out->coordinates = base_alloc(((size_t)vertices + 1) * 3 * sizeof *out->coordinates);
    out->connectivity = base_alloc(((size_t)vertices + 1) * sizeof *out->connectivity);
    out->offsets = base_alloc(((size_t)cells + 1) * sizeof *out->offsets);
    out->types = base_alloc((size_t)cells + 1);
    return out->origins && out->coordinates && out->connectivity && out->offsets && out->types;
}

/* Appends the linear cell that has the corners of one of the caller's cells, with vertices of its own. corners:
 * position of each corner in the higher-order cell's list of nodes in the connectivity. type: type of the linear cell.
 * vertex: number of vertices stored so far. Returns the number of vertices stored afterwards. */
static int64_t add_cell_with_corners(const session_mesh *mesh, const session_rows *rows, const int *corners,
                                     int64_t cell, int type, int64_t vertex, session_corner_cells *out)
{
    out->offsets[cell] = vertex;
    out->types[cell] = (unsigned char)type;
    for (int c = 0; c < grid_type_vertex_count(type); c++, vertex++) {
        out->origins[vertex] = session_find_vertex_of_node(rows, cell, corners[c]);
        out->connectivity[vertex] = vertex;
        grid_read_vertex_position(&mesh->cells, out->origins[vertex], out->coordinates + 3 * vertex);
    }
    return vertex;
}

static void describe_grid(const session_rows *rows, int64_t vertices, session_corner_cells *out)
{
    const int64_t size = (int64_t)sizeof(int64_t);
    out->cells = (grid){.vertex_count = vertices,
                        .cell_count = rows->cells.cell_count,
                        .cell_types = (const char *)out->types,
                        .cell_types_stride = 1,
                        .cell_types_bytes = 1,
                        .ghosts = rows->cells.ghosts,
                        .ghosts_stride = rows->cells.ghosts_stride,
                        .ghosts_bytes = rows->cells.ghosts_bytes};
    out->cells.connectivity =
        (grid_array){.data = (const char *)out->connectivity, .stride = size, .is_wide = true, .is_integer = true};
    out->cells.offsets =
        (grid_array){.data = (const char *)out->offsets, .stride = size, .is_wide = true, .is_integer = true};
    for (int axis = 0; axis < 3; axis++)
        out->cells.coordinates[axis] =
            (grid_array){.data = (const char *)(out->coordinates + axis), .stride = 3 * size, .is_wide = true};
}

bool session_corner_cells_create(const session_mesh *mesh, session_corner_cells *out)
{
    session_rows rows = session_describe_rows(mesh);
    int corners[ROWS_MOST_KINDS][8];
    int64_t vertices = 0;
    *out = (session_corner_cells){.origins = NULL};
    session_list_cell_kinds(&rows);
    for (int i = 0; i < rows.kind_count; i++)
        session_find_corners(&rows.kinds[i].nodes, mesh->given.vertex_order, corners[i]);
    for (int64_t cell = 0; cell < rows.cells.cell_count; cell++)
        vertices += grid_type_vertex_count(rows.kinds[session_find_kind_of_cell(&rows, cell)].nodes.type);
    if (!allocate_corner_cells(rows.cells.cell_count, vertices, out)) return false;
    vertices = 0;
    for (int64_t cell = 0; cell < rows.cells.cell_count; cell++) {
        const int kind = session_find_kind_of_cell(&rows, cell);
        vertices = add_cell_with_corners(mesh, &rows, corners[kind], cell, rows.kinds[kind].nodes.type, vertices, out);
    }
    out->offsets[rows.cells.cell_count] = vertices;
    describe_grid(&rows, vertices, out);
    return true;
}

void session_corner_cells_free(session_corner_cells *cells)
{
    base_free(cells->origins);
    base_free(cells->coordinates);
    base_free(cells->connectivity);
    base_free(cells->offsets);
    base_free(cells->types);
    *cells = (session_corner_cells){.origins = NULL};
}
