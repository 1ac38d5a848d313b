/* The three phases of compositing: fragments go to the owners of their pixels, are merged there, and pixels go to rank
 * 0. Before these phases all ranks agree that everyone has the memory for them, and afterwards whether they succeeded:
 * a rank that runs out of memory on the way takes part to the end without it, so that nobody waits, and then reports
 * the error. Memory is given back as soon as its phase is over: at the peak a rank holds its own fragments twice, or
 * those of the pixels it owns and the bytes that they came in. One rank alone merges its list where it lies (or has
 * none: comp_tiles.h). */
#include "comp.h"

#include <omp.h>

#include "comp_agree.h"
#include "comp_bucket.h"
#include "comp_cost.h"
#include "comp_exchange.h"
#include "comp_gather.h"
#include "memory.h"

/* A picture that is being composited, on this rank. */
typedef struct composition {
    const comp_group *group;
    image *out;
    comp_merged merged;
    comp_statistics *statistics;
    comp_mailroom room;
    comp_route route;
    comp_layout layout;
    comp_windows windows;
} composition;

static composition composition_of(const comp_group *group, const float background[4], image *out,
                                  comp_statistics *statistics)
{
    return (composition){.group = group,
                         .merged = {.background = background, .is_folded = out->is_folded},
                         .out = out,
                         .statistics = statistics};
}

static double milliseconds_since(double start)
{
    return 1e3 * (MPI_Wtime() - start);
}

static insitu_status merge_alone(composition *c, fragment_list *items, base_error *error)
{
    const double start = MPI_Wtime();
    comp_pixels_clear(&c->layout, c->out, c->merged.background);
    c->merged.out = c->out;
    const insitu_status status = comp_pixels_merge(&c->layout, items, &c->merged, error);
    c->statistics->merge_ms = milliseconds_since(start);
    return status;
}

/* Bytes that a fragment takes on its way: in most pictures 10 for a hit, 11 for a stretch of volume. */
static const double usual_bytes = 11;

/* Gives the same on all ranks. fragments is the most that any of them has. */
static void choose_route(composition *c, int64_t fragments)
{
    enum { USUAL_RADIX = 8 };
    const comp_group *g = c->group;
    const comp_load load = {fragments, usual_bytes};
    c->route = g->schedule == COMP_AUTOMATIC ? comp_cheapest_route(c->route.ranks, g->nodes, &load, &comp_usual_machine)
                                             : comp_route_of(g->schedule, c->route.ranks, g->nodes, USUAL_RADIX);
    if (g->longest_dense) c->route.longest_dense = g->longest_dense;
    const int threads = c->layout.threads;
    c->layout = comp_layout_of(c->layout.pixel_count, c->route.owners);
    c->layout.threads = threads;
    c->statistics->schedule = c->route.schedule;
}

/* Allocates what the three phases need. */
static insitu_status prepare(composition *c, fragment_list *items, base_error *error)
{
    if (error && error->status) return error->status;
    if (!comp_bucket_fits(&c->layout, items->items, items->count))
        return base_fail(error, INSITU_ERROR_INTERNAL, "compositing: a fragment's pixel is not in the image");
    if (c->out->deep) c->merged.deep = base_calloc((size_t)c->layout.threads, sizeof *c->merged.deep);
    if (c->out->deep && !c->merged.deep)
        return base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory for a deep image");
    if (c->layout.ranks == 1) return INSITU_OK;
    return comp_mailroom_open(c->group->comm, &c->room, error);
}

/* Merged pixels of this rank: on rank 0 in the picture, elsewhere in *finished. */
static insitu_status merge_owned(composition *c, comp_owned *owned, comp_pixel_list *finished, insitu_status status,
                                 base_error *error)
{
    const double start = MPI_Wtime();
    const int place = comp_route_place(&c->route, c->room.rank);
    c->merged.out = place == 0 ? c->out : NULL;
    c->merged.finished = finished;
    if (c->merged.out) comp_pixels_clear(&c->layout, c->out, c->merged.background);
    if (!status && place < c->route.owners)
        status = comp_pixels_blend(&c->layout, (uint32_t)place, owned, &c->merged, error);
    base_free(owned->items);
    base_free(owned->starts);
    c->statistics->merge_ms = milliseconds_since(start);
    return status;
}

static insitu_status run_phases(composition *c, fragment_list *items, base_error *error)
{
    const double start = MPI_Wtime();
    comp_owned owned = {NULL, NULL};
    comp_pixel_list finished = {NULL, 0};
    insitu_status status = comp_windows_make(&c->layout, items, &c->windows, error);
    status = comp_exchange(&c->room, &c->route, &c->windows, &owned, status, error);
    c->statistics->exchange_ms = milliseconds_since(start);
    status = merge_owned(c, &owned, &finished, status, error);
    const double gather_start = MPI_Wtime();
    status = comp_gather(&c->room, &c->route, &c->layout, &finished, c->out, status, error);
    base_free(finished.items);
    c->statistics->gather_ms = milliseconds_since(gather_start);
    c->statistics->sent_bytes = c->room.sent_bytes;
    c->statistics->sent_messages = c->room.sent_messages;
    return status;
}

static insitu_status begin(composition *c, int threads, base_error *error)
{
    int ranks = 1;
    MPI_Comm_size(c->group->comm, &ranks);
    const insitu_status status = comp_check_size(c->out, error);
    c->statistics->has_failed = status != INSITU_OK;
    if (status) return status;
    c->route = comp_route_of(COMP_DIRECT, ranks, c->group->nodes, 0);
    c->layout = comp_layout_of((uint32_t)((int64_t)c->out->width * c->out->height), c->route.owners);
    c->layout.threads = threads > 0 ? threads : omp_get_max_threads();
    return INSITU_OK;
}

/* Gathers the samples of deep pixels, or drops them where something failed. The lists are freed. */
static insitu_status gather_deep(composition *c, insitu_status status, base_error *error)
{
    comp_deep_list *const lists = c->merged.deep;
    if (!status) {
        status = comp_deep_gather(c->group->comm, lists, c->layout.threads, c->out->deep, &c->statistics->sent_bytes,
                                  error);
        c->statistics->has_failed = status != INSITU_OK; /* *error says why, to be reported */
    } else if (lists) {
        comp_deep_free(lists, c->layout.threads);
    }
    base_free(lists);
    return status;
}

/* *has_overlaps becomes the same on all ranks: nonzero where any found overlaps. */
static insitu_status composite(composition *c, fragment_list *items, int64_t *has_overlaps, base_error *error)
{
    comp_statistics *const statistics = c->statistics;
    const MPI_Comm comm = c->group->comm;
    statistics->sent_fragments = items->count;
    int64_t most = items->count;
    insitu_status own = prepare(c, items, error), status = own;
    if (c->route.ranks > 1) status = comp_agree(comm, own, &most, error);
    if (!status) {
        if (c->route.ranks > 1) choose_route(c, most);
        own = c->route.ranks > 1 ? run_phases(c, items, error) : merge_alone(c, items, error);
        *has_overlaps = c->merged.overlaps && pixel_set_count(c->merged.overlaps, c->layout.pixel_count) > 0;
        status = c->route.ranks > 1 ? comp_agree(comm, own, has_overlaps, error) : own;
    }
    statistics->has_failed = own != INSITU_OK || status == INSITU_ERROR_MPI;
    comp_windows_free(&c->windows);
    comp_mailroom_close(&c->room);
    base_free(items->items);
    *items = (fragment_list){NULL, 0, 0};
    return c->out->deep ? gather_deep(c, status, error) : status;
}

insitu_status comp_composite(const comp_group *group, fragment_list *items, const float background[4], int threads,
                             image *out, comp_statistics *statistics, base_error *error)
{
    comp_statistics unwanted;
    if (!statistics) statistics = &unwanted;
    *statistics = (comp_statistics){0};
    composition c = composition_of(group, background, out, statistics);
    int64_t none = 0;
    const insitu_status status = begin(&c, threads, error);
    return status ? status : composite(&c, items, &none, error);
}

/* ---- overlaps ------------------------------------------------------------------------------------------------ */

/* Tells all ranks the pixels in which owners found overlaps. */
static insitu_status share_overlaps(const composition *c, comp_overlaps *overlaps, base_error *error)
{
    const int bytes = (int)pixel_set_bytes(c->layout.pixel_count);
    const MPI_Comm comm = c->group->comm;
    const insitu_status status =
        comp_mpi_status(MPI_Allreduce(MPI_IN_PLACE, c->merged.overlaps, bytes, MPI_BYTE, MPI_BOR, comm), error);
    if (!status)
        *overlaps = (comp_overlaps){pixel_set_count(c->merged.overlaps, c->layout.pixel_count), c->merged.overlaps};
    return status;
}

insitu_status comp_composite_overlaps(const comp_group *group, fragment_list *items, const float background[4],
                                      int threads, image *out, comp_overlaps *overlaps, comp_statistics *statistics,
                                      base_error *error)
{
    comp_statistics unwanted;
    if (!statistics) statistics = &unwanted;
    *statistics = (comp_statistics){0};
    *overlaps = (comp_overlaps){0, NULL};
    composition c = composition_of(group, background, out, statistics);
    base_error here = {INSITU_OK, ""};
    if (!error) error = &here;
    insitu_status status = begin(&c, threads, error);
    if (status) return status;
    c.merged.overlaps = base_calloc(pixel_set_bytes(c.layout.pixel_count), 1);
    if (!c.merged.overlaps && !error->status)
        base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory for a set of %lld pixels",
                  (long long)c.layout.pixel_count);
    int64_t has_overlaps = 0;
    status = composite(&c, items, &has_overlaps, error);
    if (!status && has_overlaps) status = share_overlaps(&c, overlaps, error);
    if (!overlaps->pixels) base_free(c.merged.overlaps);
    return status;
}
