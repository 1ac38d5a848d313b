/* The three phases of compositing: fragments to the owners of their pixels, merging there, pixels to rank 0. Each ends
 * with all ranks of one mind, so that a rank that ran out of memory stops the others where it stopped. Memory
 * is given back as soon as its phase is over: at the peak a rank holds its own fragments, those of the pixels it owns,
 * and the finished pixels. One rank alone merges its list where it lies (or has none: comp_tiles.h). */
#include "comp.h"

#include <omp.h>

#include "comp_agree.h"
#include "comp_bucket.h"
#include "comp_exchange.h"
#include "comp_gather.h"
#include "memory.h"

static double milliseconds_since(double start)
{
    return 1e3 * (MPI_Wtime() - start);
}

static insitu_status merge_alone(const comp_layout *layout, fragment_list *items, const comp_merged *merged,
                                 comp_statistics *statistics, base_error *error)
{
    const double start = MPI_Wtime();
    if (!comp_bucket_fits(layout, items->items, items->count))
        return base_fail(error, INSITU_ERROR_INTERNAL, "compositing: a fragment's pixel is not in the image");
    comp_pixels_clear(layout, merged->out, merged->background);
    const insitu_status status = comp_pixels_merge(layout, 0, items, merged, error);
    statistics->merge_ms = milliseconds_since(start);
    return status;
}

static insitu_status merge_and_gather(MPI_Comm comm, const comp_layout *layout, fragment_list *owned,
                                      image *out, comp_merged *merged, comp_statistics *statistics, base_error *error)
{
    const double start = MPI_Wtime();
    comp_pixel_list finished = {NULL, 0};
    int rank = 0;
    MPI_Comm_rank(comm, &rank);
    merged->out = rank == 0 ? out : NULL;
    merged->finished = &finished;
    if (merged->out) comp_pixels_clear(layout, out, merged->background);
    insitu_status status = comp_pixels_merge(layout, rank, owned, merged, error);
    base_free(owned->items);
    status = comp_agree(comm, status, error);
    statistics->merge_ms = milliseconds_since(start);
    if (status == INSITU_OK) {
        const double gather_start = MPI_Wtime();
        status = comp_gather(comm, &finished, comp_message_pixels, out, &statistics->sent_bytes, error);
        statistics->gather_ms = milliseconds_since(gather_start);
    }
    base_free(finished.items);
    return status;
}

static insitu_status layout_of(MPI_Comm comm, const image *out, int threads, comp_layout *layout, base_error *error)
{
    int ranks = 1;
    MPI_Comm_size(comm, &ranks);
    const insitu_status status = comp_check_size(out, error);
    if (status) return status;
    *layout = comp_layout_of((uint32_t)((int64_t)out->width * out->height), ranks);
    layout->threads = threads > 0 ? threads : omp_get_max_threads();
    return INSITU_OK;
}

static insitu_status composite_flat(MPI_Comm comm, const comp_layout *layout, fragment_list *items,
                                    image *out, comp_merged *merged, comp_statistics *statistics, base_error *error)
{
    statistics->sent_fragments = items->count;
    merged->out = out;
    if (layout->ranks == 1) return merge_alone(layout, items, merged, statistics, error);
    const double start = MPI_Wtime();
    fragment_list owned = {NULL, 0, 0};
    const insitu_status status =
        comp_exchange_direct(comm, layout, items, comp_message_fragments, &owned, &statistics->sent_bytes, error);
    statistics->exchange_ms = milliseconds_since(start);
    if (status != INSITU_OK) return status;
    return merge_and_gather(comm, layout, &owned, out, merged, statistics, error);
}

/* A list a thread. */
static insitu_status composite_deep(MPI_Comm comm, const comp_layout *layout, fragment_list *items,
                                    image *out, comp_merged *merged, comp_statistics *statistics, base_error *error)
{
    merged->deep = base_calloc((size_t)layout->threads, sizeof *merged->deep);
    insitu_status status = INSITU_OK;
    if (!merged->deep) status = base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory for a deep image");
    status = comp_agree(comm, status, error);
    if (!status) status = composite_flat(comm, layout, items, out, merged, statistics, error);
    if (!status)
        status = comp_deep_gather(comm, merged->deep, layout->threads, out->deep, &statistics->sent_bytes, error);
    else if (merged->deep)
        comp_deep_free(merged->deep, layout->threads);
    base_free(merged->deep);
    return status;
}

static insitu_status composite(MPI_Comm comm, const comp_layout *layout, fragment_list *items, image *out,
                               comp_merged *merged, comp_statistics *statistics, base_error *error)
{
    return (out->deep ? composite_deep : composite_flat)(comm, layout, items, out, merged, statistics, error);
}

insitu_status comp_composite(MPI_Comm comm, fragment_list *items, const float background[4], int threads, image *out,
                             comp_statistics *statistics, base_error *error)
{
    comp_statistics unwanted;
    comp_layout layout;
    if (!statistics) statistics = &unwanted;
    *statistics = (comp_statistics){0};
    const insitu_status status = layout_of(comm, out, threads, &layout, error);
    comp_merged merged = {.background = background};
    return status ? status : composite(comm, &layout, items, out, &merged, statistics, error);
}

/* ---- overlaps ------------------------------------------------------------------------------------------------ */

/* Tells all ranks the pixels in which owners found overlaps. found is NULL on a rank that has no memory for them. */
static insitu_status share_overlaps(MPI_Comm comm, const comp_layout *layout, unsigned char *found,
                                    comp_overlaps *overlaps, base_error *error)
{
    const int64_t own[2] = {found ? pixel_set_count(found, layout->pixel_count) : 0, !found};
    int64_t all[2] = {0, 0};
    insitu_status status = comp_mpi_status(MPI_Allreduce(own, all, 2, MPI_INT64_T, MPI_SUM, comm), error);
    if (!status && all[1])
        status = base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory for a set of %lld pixels",
                           (long long)layout->pixel_count);
    if (status || all[0] == 0) return status;
    const int bytes = (int)pixel_set_bytes(layout->pixel_count);
    status = comp_mpi_status(MPI_Allreduce(MPI_IN_PLACE, found, bytes, MPI_BYTE, MPI_BOR, comm), error);
    status = comp_agree(comm, status, error);
    if (!status) *overlaps = (comp_overlaps){all[0], found};
    return status;
}

insitu_status comp_composite_overlaps(MPI_Comm comm, fragment_list *items, const float background[4], int threads,
                                      image *out, comp_overlaps *overlaps, comp_statistics *statistics,
                                      base_error *error)
{
    comp_statistics unwanted;
    comp_layout layout;
    if (!statistics) statistics = &unwanted;
    *statistics = (comp_statistics){0};
    *overlaps = (comp_overlaps){0, NULL};
    insitu_status status = layout_of(comm, out, threads, &layout, error);
    if (status) return status;
    unsigned char *const found = base_calloc(pixel_set_bytes(layout.pixel_count), 1);
    comp_merged merged = {.background = background, .overlaps = found};
    status = composite(comm, &layout, items, out, &merged, statistics, error);
    if (!status) status = share_overlaps(comm, &layout, found, overlaps, error);
    if (!overlaps->pixels) base_free(found);
    return status;
}
