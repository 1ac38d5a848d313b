#include "render_fragments.h"

#include <string.h>

#include "fragment.h"
#include "memory.h"

static bool grow(fragment_list *list, int64_t capacity)
{
    fragment *items = base_realloc(list->items, (size_t)capacity * sizeof *items);
    if (!items) return false;
    list->items = items;
    list->capacity = capacity;
    return true;
}

bool fragment_pieces_begin(fragment_pieces *pieces, fragment_list *out, int64_t expected)
{
    *pieces = (fragment_pieces){.out = out, .first = out->count};
    if (out->capacity < out->count + expected && !grow(out, out->count + expected)) return false;
    pieces->piece_count = (out->capacity - out->count) / FRAGMENT_PIECE;
    pieces->filled = base_calloc((size_t)pieces->piece_count + 1, sizeof *pieces->filled);
    return pieces->filled != NULL;
}

static void close_piece(fragment_writer *w)
{
    if (w->piece >= 0) w->pieces->filled[w->piece] = (int)w->list.count;
}

void fragment_writer_advance(fragment_writer *w, int64_t more)
{
    fragment_pieces *pieces = w->pieces;
    if (w->list.capacity - w->list.count >= more || (w->piece < 0 && w->list.items)) return;
    int64_t piece;
#pragma omp atomic capture
    piece = pieces->taken++;
    close_piece(w);
    w->piece = -1;
    w->list = (fragment_list){0};
    if (piece >= pieces->piece_count) return;
    w->piece = piece;
    w->list.items = pieces->out->items + pieces->first + piece * FRAGMENT_PIECE;
    w->list.capacity = FRAGMENT_PIECE;
}

bool fragment_reserve(fragment_list *list, int64_t more)
{
    fragment_writer *w = (fragment_writer *)(void *)list;
    const int64_t needed = list->count + more;
    if (needed <= list->capacity) return true;
    const int64_t grown = list->capacity + list->capacity / 2 + 1024;
    const int64_t capacity = grown > needed ? grown : needed;
    if (w->piece < 0) return grow(list, capacity);
    /* the fragments are moved out of the piece, which thereby becomes empty */
    fragment_list own = {0};
    if (!grow(&own, capacity)) return false;
    memcpy(own.items, list->items, (size_t)list->count * sizeof *own.items);
    own.count = list->count;
    *list = own;
    w->piece = -1;
    return true;
}

/* Fills the gaps at the ends of pieces with the fragments that lie at position `count` and beyond. */
static void close_gaps(const fragment_pieces *pieces, int64_t count)
{
    fragment *items = pieces->out->items + pieces->first;
    const int64_t end = pieces->taken < pieces->piece_count ? pieces->taken : pieces->piece_count;
    int64_t from = end - 1, left = end ? pieces->filled[from] : 0;
    for (int64_t piece = 0; piece < end; piece++) {
        int64_t to = piece * FRAGMENT_PIECE + pieces->filled[piece];
        const int64_t stop = (piece + 1) * FRAGMENT_PIECE < count ? (piece + 1) * FRAGMENT_PIECE : count;
        while (to < stop) {
            while (!left) left = pieces->filled[--from];
            items[to++] = items[from * FRAGMENT_PIECE + --left];
        }
    }
}

bool fragment_pieces_end(fragment_pieces *pieces, fragment_writer *writers, int writer_count)
{
    fragment_list *out = pieces->out;
    int64_t within = 0, beside = 0;
    for (int i = 0; i < writer_count; i++) {
        close_piece(&writers[i]);
        beside += writers[i].piece < 0 ? writers[i].list.count : 0;
    }
    for (int64_t i = 0; i < pieces->piece_count; i++) within += pieces->filled[i];
    close_gaps(pieces, within);
    const int64_t total = pieces->first + within + beside;
    const bool has_room = total <= out->capacity || grow(out, total);
    out->count = pieces->first + (has_room ? within : 0);
    for (int i = 0; i < writer_count; i++) {
        const fragment_list *own = &writers[i].list;
        if (writers[i].piece >= 0 || !own->items) continue;
        if (has_room && own->count)
            memcpy(out->items + out->count, own->items, (size_t)own->count * sizeof *own->items);
        out->count += has_room ? own->count : 0;
        base_free(own->items);
    }
    base_free(pieces->filled);
    return has_room;
}
