/* Fragments are converted to samples by comp_merge_intervals(), so that the samples of a deep picture are blended by
 * the same rule as the pixels of an ordinary picture. Rank 0 receives from each owner of pixels first the number of
 * samples of each pixel, and then the samples, which it stores directly at their final position. */
#include "comp_deep.h"

#include <math.h>
#include <string.h>

#include "comp_agree.h"
#include "comp_merge.h"
#include "memory.h"

enum { tag_deep_pixels = 17, tag_deep_samples = 18, message_samples = 1 << 20 };

/* ---- making samples on the owner of a pixel --------------------------------------------------------------------- */

/* Ensures that the array *items, which contains `count` items of `size` bytes, has space for one more item; returns
 * false if memory ran out. */
static bool reserve_item(void **items, int64_t count, int64_t *capacity, size_t size)
{
    if (count < *capacity) return true;
    const int64_t more = *capacity ? 2 * *capacity : 1024;
    void *grown = base_realloc(*items, (size_t)more * size);
    if (!grown) return false;
    *items = grown;
    *capacity = more;
    return true;
}

/* Callback of comp_merge_intervals(): converts the interval to a sample and adds the sample to the list, unless the
 * sample is invisible. */
static void add_interval(void *state, const fragment *f)
{
    comp_deep_list *list = state;
    const insitu_deep_sample sample = {{f->colour[0], f->colour[1], f->colour[2], 1 - f->transmittance},
                                       f->t_in,
                                       f->t_out < f->t_in ? f->t_in : f->t_out};
    if (sample.rgba[3] == 0 && sample.rgba[0] == 0 && sample.rgba[1] == 0 && sample.rgba[2] == 0) return;
    void *items = list->samples;
    if (!reserve_item(&items, list->sample_count, &list->sample_capacity, sizeof sample)) {
        list->lacks_memory = true;
        return;
    }
    list->samples = items;
    list->samples[list->sample_count++] = sample;
}

/* Moves the begins of samples so that none is in front of the end of the previous sample. Rounding may place the begin
 * of a segment slightly in front of the surface that precedes it (comp_merge_folded_pixel()). */
static void separate_samples(insitu_deep_sample *samples, int64_t count)
{
    for (int64_t i = 1; i < count; i++) {
        samples[i].z = fmaxf(samples[i].z, samples[i - 1].z_back);
        samples[i].z_back = fmaxf(samples[i].z_back, samples[i].z);
    }
}

void comp_deep_add_pixel(comp_deep_list *list, fragment *sorted, int64_t count, bool is_folded)
{
    const int64_t first = list->sample_count;
    void *items = list->pixels;
    if (!reserve_item(&items, list->pixel_count, &list->pixel_capacity, sizeof *list->pixels)) {
        list->lacks_memory = true;
        return;
    }
    list->pixels = items;
    if (is_folded)
        comp_merge_folded_intervals(sorted, count, add_interval, list);
    else
        comp_merge_intervals(sorted, count, add_interval, list);
    if (list->samples) separate_samples(list->samples + first, list->sample_count - first);
    list->pixels[list->pixel_count++] = (comp_deep_pixel){sorted->pixel, (uint32_t)(list->sample_count - first)};
}

void comp_deep_free(comp_deep_list *lists, int count)
{
    for (int i = 0; i < count; i++) {
        base_free(lists[i].pixels);
        base_free(lists[i].samples);
        lists[i] = (comp_deep_list){0};
    }
}

/* ---- sending samples to rank 0 ---------------------------------------------------------------------------------- */

static int send_items(MPI_Comm comm, int tag, const void *items, int64_t count, size_t size)
{
    const char *bytes = items;
    int code = MPI_SUCCESS;
    for (int64_t i = 0; i < count && code == MPI_SUCCESS; i += message_samples) {
        const int64_t left = count - i, n = left < message_samples ? left : message_samples;
        code = MPI_Send(bytes + (size_t)i * size, (int)((size_t)n * size), MPI_BYTE, 0, tag, comm);
    }
    return code;
}

static int send_lists(MPI_Comm comm, const comp_deep_list *lists, int count)
{
    int code = MPI_SUCCESS;
    for (int i = 0; i < count && code == MPI_SUCCESS; i++)
        code = send_items(comm, tag_deep_pixels, lists[i].pixels, lists[i].pixel_count, sizeof *lists[i].pixels);
    for (int i = 0; i < count && code == MPI_SUCCESS; i++)
        code = send_items(comm, tag_deep_samples, lists[i].samples, lists[i].sample_count, sizeof *lists[i].samples);
    return code;
}

/* Receives messages from the rank until `count` items have arrived, in whatever numbers the messages contain them. */
static int receive_items(MPI_Comm comm, int rank, int tag, void *items, int64_t count, size_t size)
{
    char *bytes = items;
    int code = MPI_SUCCESS;
    for (int64_t i = 0; i < count && code == MPI_SUCCESS;) {
        const int64_t left = count - i, n = left < message_samples ? left : message_samples;
        MPI_Status status;
        int received = 0;
        code = MPI_Recv(bytes + (size_t)i * size, (int)((size_t)n * size), MPI_BYTE, rank, tag, comm, &status);
        if (code == MPI_SUCCESS) code = MPI_Get_count(&status, MPI_BYTE, &received);
        i += received / (int)size;
    }
    return code;
}

/* Stores in out->first, for each of the given pixels, the index of its first sample. The samples of the pixels are
 * consecutive, and begin at index `at`. */
static void store_sample_offsets(deep_image *out, const comp_deep_pixel *pixels, int64_t count, int64_t at)
{
    for (int64_t i = 0; i < count; i++) {
        out->first[pixels[i].pixel] = at;
        out->counts[pixels[i].pixel] = pixels[i].count;
        at += pixels[i].count;
    }
}

static void copy_own_samples(deep_image *out, const comp_deep_list *lists, int count)
{
    for (int i = 0; i < count; i++) {
        store_sample_offsets(out, lists[i].pixels, lists[i].pixel_count, out->count);
        if (lists[i].sample_count)
            memcpy(out->samples + out->count, lists[i].samples,
                   (size_t)lists[i].sample_count * sizeof *lists[i].samples);
        out->count += lists[i].sample_count;
    }
}

/* Number of pixels and number of samples that rank 0 receives from each rank. Only rank 0 uses this struct. */
typedef struct deep_inbox {
    int ranks;
    int64_t (*counts)[2];    /* for each rank: [0] the number of pixels, [1] the number of samples that it sends */
    comp_deep_pixel *pixels; /* receive buffer, large enough for any other rank's pixels */
} deep_inbox;

static int receive_all(MPI_Comm comm, const deep_inbox *in, deep_image *out)
{
    int code = MPI_SUCCESS;
    for (int rank = 1; rank < in->ranks && code == MPI_SUCCESS; rank++) {
        const int64_t pixels = in->counts[rank][0], samples = in->counts[rank][1];
        code = receive_items(comm, rank, tag_deep_pixels, in->pixels, pixels, sizeof *in->pixels);
        if (code != MPI_SUCCESS) break;
        store_sample_offsets(out, in->pixels, pixels, out->count);
        code = receive_items(comm, rank, tag_deep_samples, out->samples + out->count, samples, sizeof *out->samples);
        out->count += samples;
    }
    return code;
}

/* Allocates space on rank 0 for the pixels and samples of all ranks. Their numbers must be in in->counts. */
static insitu_status allocate_sample_buffers(deep_inbox *in, deep_image *out, base_error *error)
{
    int64_t pixels = 0, samples = out->count;
    for (int rank = 0; rank < in->ranks; rank++) {
        samples += in->counts[rank][1];
        if (rank > 0 && in->counts[rank][0] > pixels) pixels = in->counts[rank][0];
    }
    in->pixels = base_alloc((size_t)pixels * sizeof *in->pixels);
    if (samples > out->capacity) {
        /* a frame may be composited several times (session_frame.c), and each time adds samples, so that the capacity
         * includes space for further samples */
        const int64_t capacity = out->count ? samples + samples / 2 : samples;
        insitu_deep_sample *grown = base_realloc(out->samples, (size_t)capacity * sizeof *grown);
        if (grown) {
            out->samples = grown;
            out->capacity = capacity;
        }
    }
    if (in->pixels && samples <= out->capacity) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory for a deep image of %lld samples (%lld bytes)",
                     (long long)samples, (long long)samples * (long long)sizeof *out->samples);
}

static insitu_status count_all_samples(MPI_Comm comm, const comp_deep_list *lists, int count, deep_inbox *in,
                                       base_error *error)
{
    int64_t own[2] = {0, 0};
    bool lacks_memory = false;
    for (int i = 0; i < count; i++) {
        own[0] += lists[i].pixel_count;
        own[1] += lists[i].sample_count;
        lacks_memory = lacks_memory || lists[i].lacks_memory;
    }
    if (lacks_memory || !in->counts)
        base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory for a deep image's %lld samples",
                  (long long)own[1]);
    const insitu_status status =
        comp_agree(comm, lacks_memory || !in->counts ? INSITU_ERROR_MEMORY : INSITU_OK, NULL, error);
    if (status) return status;
    return comp_convert_mpi_error(MPI_Gather(own, 2, MPI_INT64_T, in->counts, 2, MPI_INT64_T, 0, comm), error);
}

static insitu_status gather_lists(MPI_Comm comm, int rank, const comp_deep_list *lists, int list_count, deep_inbox *in,
                                  deep_image *out, base_error *error)
{
    insitu_status status = count_all_samples(comm, lists, list_count, in, error);
    if (!status && rank == 0) status = allocate_sample_buffers(in, out, error);
    status = comp_agree(comm, status, NULL, error);
    if (status) return status;
    if (rank == 0) copy_own_samples(out, lists, list_count);
    const int code = rank == 0 ? receive_all(comm, in, out) : send_lists(comm, lists, list_count);
    return comp_agree(comm, comp_convert_mpi_error(code, error), NULL, error);
}

insitu_status comp_deep_gather(MPI_Comm comm, comp_deep_list *lists, int list_count, deep_image *out,
                               int64_t *sent_bytes, base_error *error)
{
    int rank = 0;
    deep_inbox in = {0};
    MPI_Comm_rank(comm, &rank);
    MPI_Comm_size(comm, &in.ranks);
    in.counts = base_alloc((size_t)(rank == 0 ? in.ranks : 1) * sizeof *in.counts);
    const insitu_status status = gather_lists(comm, rank, lists, list_count, &in, out, error);
    for (int i = 0; i < list_count && rank != 0 && !status; i++)
        *sent_bytes += lists[i].pixel_count * (int64_t)sizeof *lists[i].pixels +
                       lists[i].sample_count * (int64_t)sizeof *lists[i].samples;
    base_free(in.pixels);
    base_free(in.counts);
    comp_deep_free(lists, list_count);
    return status;
}
