/* Runs the three phases of compositing: ranks send fragments to the owners of their pixels, owners merge them, and
 * owners send finished pixels to rank 0. Before the phases, all ranks agree whether every rank has the memory for them,
 * and which rank owns which block; after the phases, they agree whether all ranks succeeded. A rank that runs out of
 * memory during a phase takes part in the remaining communication, so that no rank waits for it, and reports the error
 * at the end. Memory is released as soon as its phase ends: at the peak, a rank holds its own fragments and the packed
 * fragments received from other ranks. A single rank merges its list of fragments in place. It has no list if its
 * pixels have already been blended tile by tile (comp_tiles.h). */
#include "comp.h"

#include <omp.h>
#include <string.h>

#include "comp_agree.h"
#include "comp_cost.h"
#include "comp_exchange.h"
#include "comp_gather.h"
#include "comp_owned.h"
#include "memory.h"

/* The state of this rank while a picture is composited. */
typedef struct composition {
    const comp_group *group;
    image *out;
    comp_merge_output merged;
    comp_statistics *statistics;
    comp_transport transport;
    comp_route route;
    comp_grid grid;
    comp_strips strips;
    comp_owners owners;
    uint64_t *loads; /* load of each rank: number of fragments that it owns */
} composition;

static composition make_composition(const comp_group *group, const float background[4], image *out,
                                    comp_statistics *statistics)
{
    return (composition){.group = group,
                         .merged = {.background = background, .is_folded = out->is_folded},
                         .out = out,
                         .statistics = statistics};
}

static int64_t pixel_count(const composition *c)
{
    return (int64_t)c->out->width * c->out->height;
}

static double milliseconds_since(double start)
{
    return 1e3 * (MPI_Wtime() - start);
}

/* Expected number of bytes per fragment in a message. In most pictures a surface hit takes 10 bytes, and a volume
 * interval 11. */
static const double expected_bytes = 11;

/* Chooses the route on which messages are sent (comp_route.h). `fragments` is the number of fragments of the rank that
 * has most. All ranks must pass the same number, and choose the same route. */
static void choose_message_route(composition *c, int64_t fragments)
{
    enum { DEFAULT_RADIX = 8 };
    const comp_group *g = c->group;
    const comp_load load = {fragments, expected_bytes, comp_grid_block_pixels(&c->grid)};
    c->route = g->schedule == COMP_AUTOMATIC
                   ? comp_find_fastest_route(c->route.ranks, g->nodes, &load, &comp_default_machine)
                   : comp_make_route(g->schedule, c->route.ranks, g->nodes, DEFAULT_RADIX);
    if (g->max_dense_ranks) c->route.max_dense_ranks = g->max_dense_ranks;
    c->statistics->schedule = c->route.schedule;
}

static void choose_owners(composition *c)
{
    comp_claim *const claims = c->group->claims->items;
    c->owners.count = c->route.owners;
    comp_convert_claims_to_places(&c->route, claims, c->grid.blocks);
    comp_claims_balance(claims, c->grid.blocks, c->loads, c->route.owners);
    for (uint32_t b = 0; b < c->grid.blocks; b++)
        c->owners.places[b] = claims[b].priority ? comp_priority_rank(claims[b].priority) : -1;
}

/* Computes this rank's claim to own each block of pixels: the number of fragments that this rank has in the block, and
 * the priority that follows from this number (comp_claim_priority()). The rank with the highest priority will own the
 * block. */
static void claim_blocks(composition *c)
{
    comp_claim *const claims = c->group->claims->items;
    const uint32_t ranges = c->strips.starts[c->grid.strips];
    for (uint32_t r = 0; r < ranges; r++)
        claims[comp_find_block_of_strip(&c->grid, c->strips.ranges[r].strip)].fragments += c->strips.ranges[r].count;
    for (uint32_t b = 0; b < c->grid.blocks; b++)
        claims[b].priority = comp_claim_priority(b, c->transport.rank, claims[b].fragments);
}

/* Allocates the memory for exchanging and merging fragments. Also finds this rank's fragments in each strip of the
 * picture, and computes this rank's claims to own blocks of pixels. */
static insitu_status allocate_phase_memory(composition *c, fragment_list *items, base_error *error)
{
    if (error && error->status) return error->status;
    if (c->out->deep) c->merged.deep = base_calloc((size_t)c->grid.threads, sizeof *c->merged.deep);
    if (c->out->deep && !c->merged.deep)
        return base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory for a deep image");
    c->loads = base_alloc((size_t)c->route.ranks * sizeof *c->loads);
    c->owners.places = base_alloc((size_t)c->grid.blocks * sizeof *c->owners.places);
    if (!c->loads || !c->owners.places)
        return base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory for the owners of %u blocks",
                         (unsigned)c->grid.blocks);
    insitu_status status = c->route.ranks > 1 ? comp_transport_open(c->group->comm, &c->transport, error) : INSITU_OK;
    if (!status) status = comp_strips_make(&c->grid, items, &c->strips, error);
    if (!status) claim_blocks(c);
    return status;
}

/* Merges the fragments of the pixels that this rank owns, including those in *held, which other ranks have sent. Rank 0
 * stores the finished pixels in the picture, and other ranks store them in *finished, as messages. */
static insitu_status merge_fragments_of_own_pixels(composition *c, const comp_messages *held, comp_messages *finished,
                                                   insitu_status status, base_error *error)
{
    const double start = MPI_Wtime();
    const int place = comp_find_place_of_rank(&c->route, c->transport.rank);
    comp_owned owned = {.traced_strips = &c->strips, .owners = &c->owners, .place = place};
    c->merged.out = place == 0 ? c->out : NULL;
    if (!status && place < c->route.owners) {
        const int parent = place ? comp_find_rank_at_place(&c->route, comp_gather_parent(&c->route, place)) : 0;
        status = comp_received_list_sheets(&c->grid, place, held, &owned.arrivals, error);
        if (!status) status = comp_merge_owned_strips(&owned, &c->merged, parent, finished, error);
        comp_received_free(&owned.arrivals);
    }
    c->statistics->merge_ms = milliseconds_since(start);
    return status;
}

static insitu_status merge_on_single_rank(composition *c, base_error *error)
{
    return merge_fragments_of_own_pixels(c, &(comp_messages){NULL, NULL}, &(comp_messages){NULL, NULL}, INSITU_OK,
                                         error);
}

static void free_fragments(fragment_list *items)
{
    base_free(items->items);
    *items = (fragment_list){NULL, 0, 0};
}

static insitu_status run_phases(composition *c, fragment_list *items, base_error *error)
{
    comp_messages held = {NULL, NULL}, finished = {NULL, NULL};
    const comp_canvas canvas = {&c->grid, c->merged.background, c->out};
    insitu_status status = comp_exchange(&c->transport, &c->route, &c->strips, &c->owners, &held, INSITU_OK, error);
    status = merge_fragments_of_own_pixels(c, &held, &finished, status, error);
    comp_messages_free(&held);
    free_fragments(items);
    status = comp_gather(&c->transport, &c->route, &canvas, &finished, status, error);
    c->statistics->sent_bytes = c->transport.sent_bytes;
    c->statistics->sent_messages = c->transport.sent_messages;
    return status;
}

/* Checks the picture's size, and initializes the route, the grid and the claims to blocks. If the size is invalid, the
 * fragments are freed. */
static insitu_status begin_composite(composition *c, fragment_list *items, int threads, base_error *error)
{
    int ranks = 1;
    MPI_Comm_size(c->group->comm, &ranks);
    const insitu_status status = comp_check_size(c->out, error);
    c->statistics->has_failed = status != INSITU_OK;
    if (status) {
        free_fragments(items);
        return status;
    }
    c->route = comp_make_route(COMP_DIRECT, ranks, c->group->nodes, 0);
    c->grid = comp_make_grid((uint32_t)c->out->width, (uint32_t)c->out->height, ranks);
    c->grid.threads = threads > 0 ? threads : omp_get_max_threads();
    memset(c->group->claims->items, 0, c->grid.blocks * sizeof *c->group->claims->items);
    return INSITU_OK;
}

/* Sends the samples of a deep picture to rank 0, or drops them if an error occurred. The samples were made by the
 * owners of the pixels. The lists of samples are freed. */
static insitu_status gather_deep_samples(composition *c, insitu_status status, base_error *error)
{
    comp_deep_list *const lists = c->merged.deep;
    if (!status) {
        status =
            comp_deep_gather(c->group->comm, lists, c->grid.threads, c->out->deep, &c->statistics->sent_bytes, error);
        c->statistics->has_failed = status != INSITU_OK; /* the caller reports the reason in *error */
    } else if (lists) {
        comp_deep_free(lists, c->grid.threads);
    }
    base_free(lists);
    return status;
}

/* Composites the fragments. *has_overlaps receives the same value on all ranks: nonzero if any rank found a pixel in
 * which fragments overlap, and otherwise 0. */
static insitu_status composite_fragments(composition *c, fragment_list *items, int64_t *has_overlaps, base_error *error)
{
    comp_statistics *const statistics = c->statistics;
    const MPI_Comm comm = c->group->comm;
    statistics->sent_fragments = items->count;
    int64_t most = items->count;
    insitu_status own = allocate_phase_memory(c, items, error), status = own;
    if (c->route.ranks > 1) status = comp_agree_claims(comm, own, &most, c->group->claims, (int)c->grid.blocks, error);
    if (!status) {
        if (c->route.ranks > 1) choose_message_route(c, most);
        choose_owners(c);
        own = c->route.ranks > 1 ? run_phases(c, items, error) : merge_on_single_rank(c, error);
        *has_overlaps = c->merged.overlaps && pixel_set_count(c->merged.overlaps, pixel_count(c)) > 0;
        status = c->route.ranks > 1 ? comp_agree(comm, own, has_overlaps, error) : own;
    }
    statistics->has_failed = own != INSITU_OK || status == INSITU_ERROR_MPI;
    comp_strips_free(&c->strips);
    comp_transport_close(&c->transport);
    base_free(c->owners.places);
    base_free(c->loads);
    free_fragments(items);
    return c->out->deep ? gather_deep_samples(c, status, error) : status;
}

insitu_status comp_composite(const comp_group *group, fragment_list *items, const float background[4], int threads,
                             image *out, comp_statistics *statistics, base_error *error)
{
    comp_statistics ignored;
    if (!statistics) statistics = &ignored;
    *statistics = (comp_statistics){0};
    composition c = make_composition(group, background, out, statistics);
    int64_t none = 0;
    const insitu_status status = begin_composite(&c, items, threads, error);
    return status ? status : composite_fragments(&c, items, &none, error);
}

/* ---- pixels with overlapping fragments -------------------------------------------------------------------------- */

/* Computes the set of all pixels in which fragments overlap, and stores it on all ranks. Before the call, each rank has
 * the set of such pixels among those that it owns. */
static insitu_status share_overlaps(const composition *c, comp_overlaps *overlaps, base_error *error)
{
    const int bytes = (int)pixel_set_bytes(pixel_count(c));
    const MPI_Comm comm = c->group->comm;
    const insitu_status status =
        comp_convert_mpi_error(MPI_Allreduce(MPI_IN_PLACE, c->merged.overlaps, bytes, MPI_BYTE, MPI_BOR, comm), error);
    if (!status) *overlaps = (comp_overlaps){pixel_set_count(c->merged.overlaps, pixel_count(c)), c->merged.overlaps};
    return status;
}

insitu_status comp_composite_overlaps(const comp_group *group, fragment_list *items, const float background[4],
                                      int threads, image *out, comp_overlaps *overlaps, comp_statistics *statistics,
                                      base_error *error)
{
    comp_statistics ignored;
    if (!statistics) statistics = &ignored;
    *statistics = (comp_statistics){0};
    *overlaps = (comp_overlaps){0, NULL};
    composition c = make_composition(group, background, out, statistics);
    base_error here = {INSITU_OK, ""};
    if (!error) error = &here;
    insitu_status status = begin_composite(&c, items, threads, error);
    if (status) return status;
    c.merged.overlaps = base_calloc(pixel_set_bytes(pixel_count(&c)), 1);
    if (!c.merged.overlaps && !error->status)
        base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory for a set of %lld pixels",
                  (long long)pixel_count(&c));
    int64_t has_overlaps = 0;
    status = composite_fragments(&c, items, &has_overlaps, error);
    if (!status && has_overlaps) status = share_overlaps(&c, overlaps, error);
    if (!overlaps->pixels) base_free(c.merged.overlaps);
    return status;
}
