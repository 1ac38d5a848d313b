#include "comp_pack.h"

#include <string.h>

#include "memory.h"
#include "region.h"

/* Estimated number of bytes per fragment. It determines the size of a new message. Fragments of most pictures take
 * fewer bytes. */
enum { EXPECTED_BYTES = 16 };

static insitu_status fail_for_memory(base_error *error, const char *what)
{
    return base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory to %s fragments", what);
}

/* ---- packing fragments into messages ---------------------------------------------------------------------------- */

/* The strips in which this rank has fragments, sorted by owner. */
typedef struct owner_strips {
    const comp_strips *strips;
    uint32_t *order;  /* indices of strips, sorted by owner */
    uint32_t *starts; /* for each owner, the index of its first strip in `order`; the last entry is the total number of
                         strips */
} owner_strips;

static bool sort_strips(const comp_owners *owners, owner_strips *c)
{
    const uint32_t *const ranges = c->strips->starts;
    const comp_grid *const grid = c->strips->grid;
    const uint32_t strips = grid->strips;
    uint32_t sum = 0;
    c->order = base_alloc((size_t)strips * sizeof *c->order);
    c->starts = base_calloc((size_t)owners->count + 1, sizeof *c->starts);
    if (!c->order || !c->starts) return false;
    for (uint32_t s = 0; s < strips; s++)
        if (ranges[s + 1] > ranges[s]) c->starts[owners->places[comp_find_block_of_strip(grid, s)]]++;
    for (int k = 0; k < owners->count; k++) c->starts[k] = sum += c->starts[k];
    c->starts[owners->count] = sum;
    for (uint32_t s = strips; s-- > 0;)
        if (ranges[s + 1] > ranges[s]) c->order[--c->starts[owners->places[comp_find_block_of_strip(grid, s)]]] = s;
    return true;
}

typedef struct packing {
    comp_writer *writer;
    uint32_t owner;
    int64_t remaining; /* estimated number of fragments for the owner that are not written yet */
} packing;

static bool pack_sheet(void *state, const comp_sheet *sheet, int count)
{
    packing *p = state;
    const size_t bound = comp_sheet_max_bytes(count, COMP_WORDS);
    const size_t left = (size_t)(p->remaining > 0 ? p->remaining : 0);
    unsigned char *at = comp_writer_reserve(p->writer, p->owner, bound, left * EXPECTED_BYTES + bound);
    if (!at) return false;
    comp_writer_commit(p->writer, comp_sheet_write(sheet, COMP_WORDS, at), (uint32_t)count);
    p->remaining -= count;
    return true;
}

/* Packs this rank's fragments for one owner, in a part of the strips that contain such fragments. These strips are
 * divided into `part_count` parts of about equal length; `part_index` is the index of the part. Returns false if memory
 * ran out. */
static bool pack_fragments_for_owner(const owner_strips *c, uint32_t owner, int part_index, int part_count,
                                     comp_layers *layers, comp_writer *writer)
{
    const uint32_t begin = c->starts[owner], count = c->starts[owner + 1] - begin;
    const uint32_t first = begin + (uint32_t)((uint64_t)count * (uint32_t)part_index / (uint32_t)part_count);
    const uint32_t end = begin + (uint32_t)((uint64_t)count * ((uint32_t)part_index + 1) / (uint32_t)part_count);
    packing p = {writer, owner, 0};
    bool is_ok = true;
    for (uint32_t i = first; i < end; i++) p.remaining += comp_strips_count_fragments(c->strips, c->order[i]);
    for (uint32_t i = first; i < end && is_ok; i++)
        is_ok = comp_strips_pass_sheets(c->strips, c->order[i], layers, pack_sheet, &p);
    return is_ok;
}

/* The fragments that a thread packs at once: a part of this rank's fragments for all owners whose place has `digit` as
 * its first digit. A place is the number of a rank on the route, written with one digit per round (comp_route.h). One
 * partner of the first round gets these fragments; if `digit` is the first digit of this rank's own place, they are
 * kept for later rounds. Fragments that this rank owns itself are not packed. The strips of each owner are divided into
 * `part_count` parts; `part_index` is the index of the part. */
typedef struct batch {
    int digit, radix, place;
    int part_index, part_count;
} batch;

static bool pack_batch(const owner_strips *c, int owners, const batch *b, comp_layers *layers, comp_writer *writer)
{
    bool is_ok = true;
    for (int owner = b->digit; owner < owners && is_ok; owner += b->radix)
        is_ok = owner == b->place ||
                pack_fragments_for_owner(c, (uint32_t)owner, b->part_index, b->part_count, layers, writer);
    return is_ok;
}

static bool pack_fragments_for_all_owners(const owner_strips *c, const comp_route *route, int place, comp_messages *out,
                                          comp_messages *kept)
{
    const int radix = route->round_count ? route->radix[0] : 1, threads = c->strips->grid->threads;
    const bool is_beyond = place >= route->owners;
    const int own = is_beyond ? -1 : comp_route_digit(route, 0, 1, place);
    const int part_count = (threads + radix - 1) / radix;
    bool is_ok = true;
#pragma omp parallel num_threads(threads) reduction(&& : is_ok)
    {
        region_enter();
        comp_layers *const layers = base_calloc(1, sizeof *layers);
        is_ok = layers != NULL;
#pragma omp for schedule(dynamic, 1)
        for (int i = 0; i < radix * part_count; i++) {
            const int digit = is_beyond ? i / part_count : (own + i / part_count) % radix;
            const batch b = {digit, radix, place, i % part_count, part_count};
            comp_writer writer = {
                .rank = comp_find_rank_at_place(route, is_beyond ? place - route->owners
                                                                 : comp_route_partner(route, 0, 1, place, digit))};
            if (is_ok) is_ok = pack_batch(c, route->owners, &b, layers, &writer);
#pragma omp critical(comp_pack)
            comp_messages_append(digit == own ? kept : out, &writer.messages);
        }
        if (layers) comp_layers_free(layers);
        base_free(layers);
        region_leave();
    }
    return is_ok;
}

insitu_status comp_pack(const comp_strips *strips, const comp_owners *owners, const comp_route *route, int rank,
                        comp_messages *out, comp_messages *kept, base_error *error)
{
    owner_strips c = {.strips = strips};
    const bool is_ok = sort_strips(owners, &c) &&
                       pack_fragments_for_all_owners(&c, route, comp_find_place_of_rank(route, rank), out, kept);
    base_free(c.order);
    base_free(c.starts);
    if (is_ok) return INSITU_OK;
    comp_messages_free(out);
    comp_messages_free(kept);
    return fail_for_memory(error, "send");
}

/* ---- forwarding parcels ----------------------------------------------------------------------------------------- */

/* Writes the parcels for one partner of the round. These are the parcels for owners whose place (comp_route.h) has the
 * digit `digit` in this round. Skips parcels for owners whose place differs from this rank's place in a digit of an
 * earlier round, because these parcels have been sent in that round. */
static bool forward_parcels_with_digit(const comp_messages *in, const comp_route *route, int round, int place,
                                       int digit, comp_writer *writer)
{
    const int stride = comp_route_stride(route, round);
    for (const comp_message *m = in->first; m; m = m->next) {
        comp_parcel parcel;
        for (size_t at = COMP_MESSAGE_HEAD; comp_next_parcel(m, &at, &parcel);) {
            const int owner = (int)parcel.owner;
            if (owner % stride != place % stride || comp_route_digit(route, round, stride, owner) != digit) continue;
            unsigned char *to = comp_writer_reserve(writer, parcel.owner, parcel.bytes, (size_t)m->bytes);
            if (!to) return false;
            memcpy(to, parcel.data, parcel.bytes);
            comp_writer_commit(writer, to + parcel.bytes, parcel.records);
        }
    }
    return true;
}

insitu_status comp_forward_parcels(const comp_messages *in, const comp_route *route, int round, int rank,
                                   comp_messages *out, base_error *error)
{
    const int place = comp_find_place_of_rank(route, rank), stride = comp_route_stride(route, round);
    const int own = comp_route_digit(route, round, stride, place);
    *out = (comp_messages){NULL, NULL};
    for (int i = 1; i < route->radix[round] && place < route->owners; i++) {
        const int digit = (own + i) % route->radix[round];
        comp_writer writer = {
            .rank = comp_find_rank_at_place(route, comp_route_partner(route, round, stride, place, digit))};
        const bool is_ok = forward_parcels_with_digit(in, route, round, place, digit, &writer);
        comp_messages_append(out, &writer.messages);
        if (is_ok) continue;
        comp_messages_free(out);
        return fail_for_memory(error, "pass on");
    }
    return INSITU_OK;
}

/* ---- finding received sheets ------------------------------------------------------------------------------------ */

/* One of the two passes of a counting sort that sorts the received sheets of an owner by strip. If `sheets` is NULL,
 * adds the number of sheets of each strip to starts[strip]. Otherwise stores the address of each sheet in `sheets`, and
 * reduces starts[strip], which is the end of the strip's addresses before the call, to their start. */
static void count_or_store_sheets(const comp_messages *in, int owner, uint32_t *starts, const unsigned char **sheets)
{
    for (const comp_message *m = in->first; m; m = m->next) {
        comp_parcel parcel;
        for (size_t at = COMP_MESSAGE_HEAD; comp_next_parcel(m, &at, &parcel);) {
            if ((int)parcel.owner != owner) continue;
            const unsigned char *const end = parcel.data + parcel.bytes;
            for (const unsigned char *sheet = parcel.data, *next; sheet < end; sheet = next) {
                comp_sheet_head head;
                next = comp_sheet_read_head(sheet, &head);
                if (sheets)
                    sheets[--starts[head.strip]] = sheet;
                else
                    starts[head.strip]++;
            }
        }
    }
}

insitu_status comp_received_list_sheets(const comp_grid *grid, int owner, const comp_messages *in, comp_received *out,
                                        base_error *error)
{
    uint32_t sum = 0;
    *out = (comp_received){NULL, base_calloc((size_t)grid->strips + 1, sizeof *out->starts)};
    if (out->starts) {
        count_or_store_sheets(in, owner, out->starts, NULL);
        for (uint32_t s = 0; s < grid->strips; s++) out->starts[s] = sum += out->starts[s];
        out->starts[grid->strips] = sum;
        out->sheets = base_alloc((size_t)sum * sizeof *out->sheets);
    }
    if (out->sheets) {
        count_or_store_sheets(in, owner, out->starts, out->sheets);
        return INSITU_OK;
    }
    comp_received_free(out);
    return fail_for_memory(error, "receive");
}

void comp_received_free(comp_received *arrivals)
{
    base_free(arrivals->sheets);
    base_free(arrivals->starts);
    *arrivals = (comp_received){NULL, NULL};
}
