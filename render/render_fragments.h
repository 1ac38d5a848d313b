/* The threads of a frame write their fragments into one list, in any order.
 *
 * As long as the list has space, threads take pieces of it and write there: nothing is copied, and a caller who keeps
 * the list from frame to frame pays for its memory once. If there is no space left, a thread continues in its own
 * memory, which is appended at the end. The order of fragments differs from run to run; the set does not. */
#ifndef RENDER_RENDER_FRAGMENTS_H
#define RENDER_RENDER_FRAGMENTS_H

#include "fragment.h"

enum { FRAGMENT_PIECE = 4096 };

typedef struct fragment_pieces {
    fragment_list *out;
    int64_t first;       /* index in out at which the first piece begins */
    int64_t piece_count; /* number of pieces that fit into out */
    int64_t taken;       /* number of pieces that threads have asked for; may exceed piece_count */
    int *filled;         /* number of fragments in each piece, set when the piece is closed */
} fragment_pieces;

/* The list to which a thread writes: a piece of the common list, or memory of its own. */
typedef struct fragment_writer {
    fragment_list list; /* must be the first member: fragment_reserve() casts its address to the writer */
    fragment_pieces *pieces;
    int64_t piece; /* number of the piece to which the thread writes; -1: it writes to its own memory */
} fragment_writer;

/* Prepares out for writing in pieces. expected: number of fragments for which out should have space. Returns false if
 * memory ran out. */
bool fragment_pieces_begin(fragment_pieces *pieces, fragment_list *out, int64_t expected);

/* Ensures space for `more` more fragments; the writer may continue in another piece or in its own memory. */
void fragment_writer_advance(fragment_writer *writer, int64_t more);

/* Ensures space for `more` more fragments in a writer's list, which stays contiguous; returns false if memory ran
 * out. */
bool fragment_reserve(fragment_list *list, int64_t more);

/* Moves all fragments to out and frees everything else. Returns false if memory ran out; out then has none of them. */
bool fragment_pieces_end(fragment_pieces *pieces, fragment_writer *writers, int writer_count);

#endif
