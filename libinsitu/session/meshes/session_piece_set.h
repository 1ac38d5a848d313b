/* Sets of linear pieces in refined cells, that is, cells of higher order in which polynomials are evaluated between the
 * nodes (session_finer.h). A cell is refined if it is marked. Only the following pieces of it are made: those that an
 * isosurface or a slice may cross, those on outer faces that an image shows, and one piece at each of the cell's own
 * nodes. Their number therefore grows with the square of the number of pieces along an edge, not with its cube. */
#ifndef SESSION_PIECE_SET_H
#define SESSION_PIECE_SET_H

#include "session_deviation.h"

/* Creates a set that contains, of each marked cell, one piece at each of the cell's own nodes, so that the ranges of
 * all fields include the values at these nodes. Edges of marked cells between two nodes are divided into `parts`
 * pieces. All pieces of the other cells are made. Local. The caller must drop *out even after an error. */
insitu_status session_begin_piece_set(const session_mesh *mesh, const unsigned char *marks, int parts,
                                      session_piece_set *out, base_error *error);

/* Adds the pieces of the marked cells that an isosurface of the request, or its plane, may cross, even after values are
 * rounded to float32. Parallel. Local. */
insitu_status session_add_crossed_pieces(const session_mesh *mesh, const session_deviation_request *request, int parts,
                                         int threads, session_piece_set *set, base_error *error);

/* Adds the pieces of the marked cells that have a face on an outer face of the cell (session_finer.outer_faces), which
 * must be known. Local. */
insitu_status session_add_outer_pieces(const session_mesh *mesh, int parts, session_piece_set *set, base_error *error);

/* Returns whether two sets select the same pieces of the same cell_count cells. */
bool session_is_same_piece_set(const session_piece_set *a, const session_piece_set *b, int64_t cell_count);

static inline int64_t session_piece_set_bytes(const session_piece_set *set, int64_t cell_count)
{
    if (!set->first_words) return 0;
    return (cell_count + 1) * (int64_t)sizeof *set->first_words +
           set->first_words[cell_count] * (int64_t)sizeof *set->bits;
}

#endif
