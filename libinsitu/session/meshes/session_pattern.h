/* Patterns: a pattern lists the linear cells (pieces) into which all cells of higher order of one type and order are
 * split. The vertices of pieces are given as positions of nodes in the cell's row, which is the list of the cell's
 * nodes in the connectivity. */
#ifndef SESSION_PATTERN_H
#define SESSION_PATTERN_H

#include "session_nodes.h"

/* PATTERN_MOST_LOOSE: maximum number of pieces into which a serendipity cell is split; PATTERN_MOST_POLYGONS: maximum
 * number of polygons along which it is split (pattern_polygon). */
enum { PATTERN_MOST_LOOSE = 24, PATTERN_MOST_POLYGONS = 16 };

/* A polygon along which a serendipity cell is split; its vertices are midpoints of the cell's edges. Each corner of the
 * cell is cut off by one polygon (in a quad, by a line of two vertices), and one polygon remains of each face. */
typedef struct pattern_polygon {
    int count;  /* number of vertices: 2, 3 or 4 */
    int corner; /* the corner of the cell that the polygon cuts off, or -1 if the polygon lies on a face of the cell */
    int nodes[4]; /* positions of the vertices in the cell's row of nodes */
} pattern_polygon;

/* Describes how cells of one type and order are split into pieces. For complete cells it lists the pieces. For
 * serendipity cells it lists only polygons, because their pieces also depend on the coordinates of the nodes
 * (session_split_serendipity_cell()). */
typedef struct session_pattern {
    int type; /* type of the cells as the caller gives it */
    session_nodes nodes;
    /* piece_count: number of listed pieces, 0 for serendipity cells; piece_size: number of entries of
     * `piece_positions`, the sum of the pieces' numbers of vertices */
    int piece_count, piece_size;
    unsigned char *types; /* GRID_* type of each listed piece */
    /* vertices of the pieces, one piece after the other, as positions in the cell's list of nodes */
    int *piece_positions;
    int polygon_count; /* number of polygons along which a serendipity cell is split; 0 for all other cells */
    pattern_polygon polygons[PATTERN_MOST_POLYGONS];
    int midpoint_count;
    int midpoints[12]; /* positions of the nodes in the middle of edges, in the cell's list of nodes */
} session_pattern;

/* Lists the pieces of cells of this type and with these nodes. order: the order in which a cell's nodes are listed in
 * the connectivity. Returns false if memory runs out. The only piece of a linear cell (order 1) is the cell itself. */
bool session_make_split_pattern(int type, const session_nodes *nodes, insitu_vertex_order order, session_pattern *out);
void session_drop_split_pattern(session_pattern *pattern);

/* Stores the vertices of a serendipity cell's pieces, as positions in the cell's list of nodes: 4 for each tet, or 3
 * for each triangle of a quad. ranks: for each midpoint, at the index of its position in that list, the number of
 * midpoints before it in the lexicographic order of coordinates. Returns the number of pieces. */
int session_split_serendipity_cell(const session_pattern *pattern, const int *ranks, int pieces[PATTERN_MOST_LOOSE][4]);

#endif
