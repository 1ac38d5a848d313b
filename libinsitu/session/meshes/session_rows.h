/* Access to the caller's cells of a mesh whose cells of higher order are split into linear pieces (session_split.h).
 * The row of a cell is the sequence of entries of the connectivity that list the cell's nodes. */
#ifndef SESSION_ROWS_H
#define SESSION_ROWS_H

#include "session_mesh.h"
#include "session_nodes.h"

enum { ROWS_MOST_KINDS = 64 };

/* A kind of cell: a type together with a number of nodes per cell. */
typedef struct session_row_kind {
    int type; /* type of the cells as the caller gives it */
    session_nodes nodes;
} session_row_kind;

typedef struct session_rows {
    /* the caller's cells. If the caller gives no connectivity, the cells are read as if entry i of the connectivity
     * were vertex i. */
    grid cells;
    /* Used if the caller gives no offsets, so that all cells have the same number of nodes. nodes_per_cell: this
     * number; row_stride: number of entries of the connectivity from the first node of a cell to the first node of the
     * next cell. */
    int64_t nodes_per_cell, row_stride;
    /* set if the mesh is discontinuous (session_discontinuous), so that each node of each cell is a separate vertex */
    bool is_discontinuous;
    int kind_count;
    session_row_kind kinds[ROWS_MOST_KINDS];
} session_rows;

/* Describes where the nodes of each cell of a mesh are in the connectivity. The mesh's description must be valid. The
 * list of kinds is left empty (session_list_cell_kinds()). */
session_rows session_describe_rows(const session_mesh *mesh);
/* Does the same for a valid description of a mesh, whose cells share vertices as the caller has described them. The
 * list of kinds is left empty. */
session_rows session_describe_caller_rows(const insitu_mesh *given);

/* Returns the index, in the caller's connectivity, of the entry with a cell's first node. */
static inline int64_t session_find_first_entry_of_cell(const session_rows *rows, int64_t cell)
{
    return rows->cells.offsets.data ? grid_read_index(&rows->cells.offsets, cell) : cell * rows->row_stride;
}

/* Returns the number of nodes of a cell. */
static inline int64_t session_count_nodes_of_cell(const session_rows *rows, int64_t cell)
{
    if (!rows->cells.offsets.data) return rows->nodes_per_cell;
    return (int64_t)((uint64_t)grid_offset_end(&rows->cells.offsets, cell) -
                     (uint64_t)grid_read_index(&rows->cells.offsets, cell));
}

/* Returns the caller's vertex to which an entry of the connectivity refers. */
static inline int64_t session_row_vertex(const session_rows *rows, int64_t entry)
{
    return rows->cells.connectivity.data ? grid_read_index(&rows->cells.connectivity, entry) : entry;
}

/* Returns the index of a cell's node in a sequence of all nodes of all cells. It is the index of an entry of the
 * connectivity if unused entries are not counted. node: position of the node in the cell's list of nodes. */
static inline int64_t session_row_entry(const session_rows *rows, int64_t cell, int node)
{
    return rows->cells.offsets.data ? session_find_first_entry_of_cell(rows, cell) + node
                                    : cell * rows->nodes_per_cell + node;
}

/* Returns the index, in session_mesh.cells, of the vertex that is the node at position `node` in the cell's list of
 * nodes. */
static inline int64_t session_find_vertex_of_node(const session_rows *rows, int64_t cell, int node)
{
    return rows->is_discontinuous ? session_row_entry(rows, cell, node)
                                  : session_row_vertex(rows, session_find_first_entry_of_cell(rows, cell) + node);
}

/* Returns the index, in rows->kinds, of the cells of this type with `count` nodes, or -1 if they are not listed. */
int session_find_cell_kind(const session_rows *rows, int type, int64_t count);
static inline int session_find_kind_of_cell(const session_rows *rows, int64_t cell)
{
    return session_find_cell_kind(rows, grid_cell_type(&rows->cells, cell), session_count_nodes_of_cell(rows, cell));
}

/* Lists the kinds of all cells. The cells must have been split before, so that their types are known to be valid. */
void session_list_cell_kinds(session_rows *rows);

#endif
