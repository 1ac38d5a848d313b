/* The types of cells of higher order, and the positions of their nodes in the cell's row, which is the list of the
 * cell's nodes in the connectivity. The lattice of a cell of order p is the regular grid of its nodes, whose indices i,
 * j, k along the axes of the reference cell are 0 .. p. */
#ifndef SESSION_NODES_H
#define SESSION_NODES_H

#include "grid.h"
#include "insitu/insitu.h"

/* highest supported order of cells */
enum { NODES_MOST_ORDER = 32 };

/* A type of cell and its order. A complete cell has all nodes of the lattice of its order; a serendipity cell (8, 13,
 * 15 or 20 nodes) has only its corners and the midpoints of its edges. */
typedef struct session_nodes {
    int type;  /* GRID_* type of the linear cell with the same corners */
    int order; /* polynomial order; 1: the cell is linear */
    int count; /* number of nodes of the cell */
    bool is_complete;
    bool is_lagrange; /* set if the caller's type is INSITU_LAGRANGE_* */
} session_nodes;

/* Returns the linear type with the same corners, or GRID_NO_TYPE if the caller's type is not of higher order. */
int session_get_linear_type(int type);

/* Returns whether the caller's type is one of INSITU_LAGRANGE_*. */
bool session_is_lagrange(int type);

/* Finds the order of a cell of higher order from its type and its number of nodes, and describes its nodes in *out.
 * Returns false if cells of this type have no order with this number of nodes. */
bool session_describe_nodes(int type, int64_t count, session_nodes *out);

/* Returns the type INSITU_LAGRANGE_* with the same corners as the linear type, or GRID_NO_TYPE if there is none. */
int session_lagrange_type(int corner_type);

/* Describes a complete cell of this order: a cell with all nodes of its lattice. corner_type: the linear type with the
 * same corners. */
session_nodes session_describe_complete_nodes(int corner_type, int order);

/* Returns the number of nodes of a cell of this type and order, or 0 if there is no such cell. order: may be 0 for
 * types that have only one order. */
int64_t session_node_count(int type, int order);

/* Returns the reason why the vertex order is not defined for the cell, or NULL if it is defined. */
const char *session_describe_unsupported_node_order(const session_nodes *of, insitu_vertex_order order);

/* Returns the position, in the cell's list of nodes in the connectivity, of the node with the lattice indices i, j, k.
 * The axes of the lattice are the edges at the cell's first corner. Each layer k of a pyramid has one node less along i
 * and j than the layer below. For a node that a serendipity cell lacks, the result is at least session_nodes.count. */
int session_find_node_in_connectivity(const session_nodes *of, insitu_vertex_order order, int i, int j, int k);

/* Finds the position of each corner in the cell's list of nodes in the connectivity. out: one position per corner, with
 * corners in VTK's order. */
void session_find_corners(const session_nodes *of, insitu_vertex_order order, int out[8]);

/* Returns whether the lattice of the cell's order has a node with the indices i, j, k; each index must be in 0 ..
 * order. */
bool session_has_node(const session_nodes *of, int i, int j, int k);

/* For cells of order 2: returns the position, in the cell's list of nodes in the connectivity, of the node that has the
 * index n in VTK's order. */
int session_convert_quadratic_node_index(const session_nodes *of, insitu_vertex_order order, int n);

/* Returns the number of nodes of each cell of a mesh of one type, or 0 if the description does not determine it. */
int64_t session_count_cell_nodes(const insitu_mesh *mesh);

#endif
