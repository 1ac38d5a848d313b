#include "comp_pack.h"

#include <string.h>

#include "comp_block.h"
#include "memory.h"

/* Bytes of a fragment, from which the room for a message is first guessed. In most pictures fragments take fewer. */
enum { EXPECTED_BYTES = 16 };

static insitu_status no_memory(base_error *error, const char *what)
{
    return base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory to %s fragments", what);
}

/* ---- fragments into messages --------------------------------------------------------------------------------- */

typedef struct packing {
    comp_writer *writer;
    uint32_t owner;
    int64_t left; /* fragments for the owner that are not written yet */
} packing;

static bool take_block(void *state, comp_block *block)
{
    packing *p = state;
    const size_t bound = comp_block_bound(block->count);
    unsigned char *at = comp_writer_room(p->writer, p->owner, bound, (size_t)p->left * EXPECTED_BYTES + bound);
    if (!at) return false;
    comp_writer_commit(p->writer, comp_block_write(block, at), (uint32_t)block->count);
    p->left -= block->count;
    return true;
}

static bool pack_owner(const comp_windows *w, uint32_t owner, comp_block *block, comp_writer *writer)
{
    packing p = {writer, owner, comp_windows_first(w, owner + 1) - comp_windows_first(w, owner)};
    return p.left == 0 || comp_windows_walk(w, owner, block, take_block, &p);
}

/* Packs what goes to the partner with the digit: the fragments of all owners with it, except this place. */
static bool pack_digit(const comp_windows *w, int radix, int digit, int place, comp_block *block, comp_writer *writer)
{
    bool is_well = true;
    for (int owner = digit; owner < (int)w->layout->ranks && is_well; owner += radix)
        is_well = owner == place || pack_owner(w, (uint32_t)owner, block, writer);
    return is_well;
}

static bool pack_digits(const comp_windows *w, const comp_route *route, int place, comp_messages *out,
                        comp_messages *kept)
{
    const int radix = route->round_count ? route->radix[0] : 1;
    const bool is_beyond = place >= route->owners;
    const int own = is_beyond ? -1 : comp_route_digit(route, 0, 1, place);
    bool is_well = true;
#pragma omp parallel num_threads(w->layout->threads) reduction(&& : is_well)
    {
        comp_block *const block = base_alloc(sizeof *block);
        is_well = block != NULL;
#pragma omp for schedule(dynamic, 1)
        for (int i = 0; i < radix; i++) {
            const int digit = is_beyond ? i : (own + i) % radix;
            comp_writer writer = {.rank = comp_route_rank(route, is_beyond
                                                                     ? place - route->owners
                                                                     : comp_route_partner(route, 0, 1, place, digit))};
            if (is_well) is_well = pack_digit(w, radix, digit, place, block, &writer);
#pragma omp critical(comp_pack)
            comp_messages_append(digit == own ? kept : out, &writer.messages);
        }
        base_free(block);
    }
    return is_well;
}

insitu_status comp_pack(const comp_windows *windows, const comp_route *route, int rank, comp_messages *out,
                        comp_messages *kept, base_error *error)
{
    const int place = comp_route_place(route, rank);
    if (pack_digits(windows, route, place, out, kept)) return INSITU_OK;
    comp_messages_free(out);
    comp_messages_free(kept);
    return no_memory(error, "send");
}

/* ---- parcels on their way ------------------------------------------------------------------------------------ */

/* Forwards the parcels for owners that have this digit, and this place's digits of the rounds before. All others have
 * been sent in those rounds. */
static bool forward_to(const comp_messages *in, const comp_route *route, int round, int place, int digit,
                       comp_writer *writer)
{
    const int stride = comp_route_stride(route, round);
    for (const comp_message *m = in->first; m; m = m->next) {
        comp_parcel parcel;
        for (size_t at = COMP_MESSAGE_HEAD; comp_next_parcel(m, &at, &parcel);) {
            const int owner = (int)parcel.owner;
            if (owner % stride != place % stride || comp_route_digit(route, round, stride, owner) != digit) continue;
            unsigned char *to = comp_writer_room(writer, parcel.owner, parcel.bytes, (size_t)m->bytes);
            if (!to) return false;
            memcpy(to, parcel.data, parcel.bytes);
            comp_writer_commit(writer, to + parcel.bytes, parcel.records);
        }
    }
    return true;
}

insitu_status comp_forward(const comp_messages *in, const comp_route *route, int round, int rank, comp_messages *out,
                           base_error *error)
{
    const int place = comp_route_place(route, rank), stride = comp_route_stride(route, round);
    const int own = comp_route_digit(route, round, stride, place);
    *out = (comp_messages){NULL, NULL};
    for (int i = 1; i < route->radix[round] && place < route->owners; i++) {
        const int digit = (own + i) % route->radix[round];
        comp_writer writer = {.rank = comp_route_rank(route, comp_route_partner(route, round, stride, place, digit))};
        const bool is_well = forward_to(in, route, round, place, digit, &writer);
        comp_messages_append(out, &writer.messages);
        if (is_well) continue;
        comp_messages_free(out);
        return no_memory(error, "pass on");
    }
    return INSITU_OK;
}

/* ---- out of messages -----------------------------------------------------------------------------------------
 *
 * A counting sort by pixel: the blocks' runs tell how many fragments each pixel has before any is unpacked, so each
 * goes straight to its place. starts[k] is at first the count of pixel k, then the end of its fragments, and falls to
 * their begin as they are placed. */

typedef struct unpacking {
    const comp_layout *layout;
    comp_parcel *parcels;
    int64_t parcel_count;
    comp_owned *out;
} unpacking;

static int64_t find_parcels(const comp_messages *in, uint32_t owner, comp_parcel *out, int64_t *fragments)
{
    int64_t count = 0;
    for (const comp_message *m = in->first; m; m = m->next) {
        comp_parcel parcel;
        for (size_t at = COMP_MESSAGE_HEAD; comp_next_parcel(m, &at, &parcel);) {
            if (parcel.owner != owner) continue;
            if (out) out[count] = parcel;
            *fragments += parcel.records;
            count++;
        }
    }
    return count;
}

static void count_run(void *starts, uint32_t index, uint32_t length)
{
    for (uint32_t k = index; k < index + length; k++) ((uint32_t *)starts)[k]++;
}

static void count_all(const unpacking *u, const fragment *own, int64_t own_count, uint32_t pixels)
{
    uint32_t *const starts = u->out->starts, sum = 0;
    for (int64_t i = 0; i < own_count; i++) starts[comp_layout_index(u->layout, own[i].pixel)]++;
    for (int64_t i = 0; i < u->parcel_count; i++)
        for (const unsigned char *at = u->parcels[i].data, *end = at + u->parcels[i].bytes; at < end;)
            at = comp_block_runs(at, count_run, starts);
    for (uint32_t k = 0; k < pixels; k++) starts[k] = sum += starts[k];
    starts[pixels] = sum;
}

/* is_shared tells that other threads place fragments of the same pixels. */
static inline void place(comp_owned *out, const void *item, uint32_t index, bool is_shared)
{
    const uint32_t to = is_shared ? __atomic_sub_fetch(&out->starts[index], 1, __ATOMIC_RELAXED) : --out->starts[index];
    memcpy(&out->items[to], item, sizeof *out->items);
    out->items[to].pixel = index;
}

static void place_parcel(const unpacking *u, const comp_parcel *parcel, comp_block *block, bool is_shared)
{
    for (const unsigned char *at = parcel->data, *end = at + parcel->bytes; at < end;) {
        at = comp_block_read(at, block);
        for (int i = 0; i < block->count; i++) place(u->out, block->records[i], block->records[i][0], is_shared);
    }
}

static bool place_all(const unpacking *u, const fragment *own, int64_t own_count)
{
    bool is_well = true;
    const int threads = u->layout->threads;
#pragma omp parallel num_threads(threads) reduction(&& : is_well)
    {
        comp_block *const block = base_alloc(sizeof *block);
        is_well = block != NULL;
#pragma omp for schedule(dynamic, 1)
        for (int64_t i = -1; i < u->parcel_count; i++) {
            for (int64_t k = 0; i < 0 && k < own_count; k++)
                place(u->out, &own[k], comp_layout_index(u->layout, own[k].pixel), threads > 1);
            if (i >= 0 && block) place_parcel(u, &u->parcels[i], block, threads > 1);
        }
        base_free(block);
    }
    return is_well;
}

insitu_status comp_unpack(const comp_layout *layout, uint32_t owner, const comp_messages *in, const fragment *own,
                          int64_t own_count, comp_owned *out, base_error *error)
{
    const uint32_t pixels = comp_layout_owned(layout, (int)owner);
    int64_t total = own_count;
    unpacking u = {.layout = layout, .out = out, .parcel_count = find_parcels(in, owner, NULL, &total)};
    u.parcels = base_alloc((size_t)u.parcel_count * sizeof *u.parcels);
    out->items = base_alloc((size_t)total * sizeof *out->items);
    out->starts = base_calloc((size_t)pixels + 1, sizeof *out->starts);
    bool is_well = u.parcels && out->items && out->starts && total <= UINT32_MAX;
    if (is_well) {
        find_parcels(in, owner, u.parcels, &(int64_t){0});
        count_all(&u, own, own_count, pixels);
        is_well = place_all(&u, own, own_count);
    }
    base_free(u.parcels);
    if (is_well) return INSITU_OK;
    base_free(out->items);
    base_free(out->starts);
    *out = (comp_owned){NULL, NULL};
    return base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory for received fragments (%lld bytes)",
                     (long long)total * (long long)sizeof(fragment));
}
