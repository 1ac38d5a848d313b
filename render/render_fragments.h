/* The threads of a frame put their fragments into one list, in any order.
 *
 * As long as the list has room, threads take pieces of it and write there: nothing is copied, and a caller who keeps
 * the list from frame to frame pays for its memory once. Without room a thread goes on in memory of its own, which is
 * appended at the end. The order of fragments differs from run to run; what they are does not. */
#ifndef RENDER_RENDER_FRAGMENTS_H
#define RENDER_RENDER_FRAGMENTS_H

#include "fragment.h"

enum { FRAGMENT_PIECE = 4096 };

typedef struct fragment_pieces {
    fragment_list *out;
    int64_t first;       /* pieces begin here */
    int64_t piece_count; /* that out has room for */
    int64_t taken;
    int *filled; /* fragments in each piece */
} fragment_pieces;

/* A thread's list: a piece, or memory of its own. */
typedef struct fragment_writer {
    fragment_list list; /* first: fragment_reserve() is given this */
    fragment_pieces *pieces;
    int64_t piece; /* -1: memory of its own */
} fragment_writer;

/* expected: how many fragments out should have room for at least. False where memory ran out. */
bool fragment_pieces_begin(fragment_pieces *pieces, fragment_list *out, int64_t expected);

/* Make sure of some room, where the list need not go on in one piece. */
void fragment_writer_advance(fragment_writer *writer, int64_t room);

/* Make room in a writer's list, which stays in one piece; false where memory ran out. */
bool fragment_reserve(fragment_list *list, int64_t more);

/* All fragments into out, and all else freed. False where memory ran out: out has none of them then. */
bool fragment_pieces_end(fragment_pieces *pieces, fragment_writer *writers, int writer_count);

#endif
