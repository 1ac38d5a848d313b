/* Rank 0 takes the pixels in one fixed order of ranks and messages, a few receives ahead: its memory does not grow with
 * the image or the number of ranks, and ranks whose turn has not come hold their own pixels. Only touched pixels
 * travel, each with its number; the rest are background, which rank 0 knows. */
#include "comp_gather.h"

#include "comp_agree.h"
#include "memory.h"

enum { tag_pixels = 2, slot_count = 4 };

typedef struct inbox {
    int64_t *counts; /* of pixels, by rank */
    int ranks;
    int64_t message_pixels;
    comp_pixel *slots;          /* slot_count × message_pixels */
    int64_t pixels[slot_count]; /* expected in each slot; 0: nothing */
    MPI_Request requests[slot_count];
    int rank;     /* of the next message */
    int64_t done; /* pixels of that rank asked for */
} inbox;

static insitu_status open_inbox(inbox *in, base_error *error)
{
    in->counts = base_alloc((size_t)in->ranks * sizeof *in->counts);
    in->slots = base_alloc((size_t)(slot_count * in->message_pixels) * sizeof *in->slots);
    if (in->counts && in->slots) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory to gather pixels");
}

static void close_inbox(inbox *in)
{
    base_free(in->slots);
    base_free(in->counts);
}

static int post_next(inbox *in, MPI_Comm comm, int slot)
{
    in->pixels[slot] = 0;
    while (in->rank < in->ranks && in->done >= in->counts[in->rank]) {
        in->rank++;
        in->done = 0;
    }
    if (in->rank >= in->ranks) return MPI_SUCCESS;
    const int64_t left = in->counts[in->rank] - in->done;
    const int64_t pixels = left < in->message_pixels ? left : in->message_pixels;
    in->pixels[slot] = pixels;
    in->done += pixels;
    return MPI_Irecv(in->slots + slot * in->message_pixels, (int)(pixels * (int64_t)sizeof(comp_pixel)), MPI_BYTE,
                     in->rank, tag_pixels, comm, &in->requests[slot]);
}

/* After a failure: nothing may be received into memory that is about to be freed. */
static void give_up(inbox *in)
{
    for (int slot = 0; slot < slot_count; slot++) {
        if (in->requests[slot] == MPI_REQUEST_NULL) continue;
        MPI_Cancel(&in->requests[slot]);
        MPI_Wait(&in->requests[slot], MPI_STATUS_IGNORE);
    }
}

static int receive_all(inbox *in, MPI_Comm comm, image *out)
{
    int code = MPI_SUCCESS;
    in->counts[0] = 0;
    for (int slot = 0; slot < slot_count && code == MPI_SUCCESS; slot++) code = post_next(in, comm, slot);
    for (int slot = 0; code == MPI_SUCCESS && in->pixels[slot]; slot = (slot + 1) % slot_count) {
        code = MPI_Wait(&in->requests[slot], MPI_STATUS_IGNORE);
        if (code != MPI_SUCCESS) break;
        const comp_pixel *from = in->slots + slot * in->message_pixels;
        for (int64_t i = 0; i < in->pixels[slot]; i++) comp_pixels_store(out, &from[i]);
        code = post_next(in, comm, slot);
    }
    if (code != MPI_SUCCESS) give_up(in);
    return code;
}

static int send_all(const comp_pixel_list *finished, int64_t message_pixels, MPI_Comm comm)
{
    int code = MPI_SUCCESS;
    for (int64_t i = 0; i < finished->count && code == MPI_SUCCESS; i += message_pixels) {
        const int64_t left = finished->count - i;
        const int64_t pixels = left < message_pixels ? left : message_pixels;
        code =
            MPI_Send(finished->items + i, (int)(pixels * (int64_t)sizeof(comp_pixel)), MPI_BYTE, 0, tag_pixels, comm);
    }
    return code;
}

insitu_status comp_gather(MPI_Comm comm, const comp_pixel_list *finished, int64_t message_pixels, image *out,
                          int64_t *sent_bytes, base_error *error)
{
    inbox in = {.message_pixels = message_pixels};
    for (int slot = 0; slot < slot_count; slot++) in.requests[slot] = MPI_REQUEST_NULL;
    int rank = 0;
    MPI_Comm_rank(comm, &rank);
    MPI_Comm_size(comm, &in.ranks);
    insitu_status status = comp_agree(comm, rank == 0 ? open_inbox(&in, error) : INSITU_OK, error);
    if (status == INSITU_OK) {
        int code = MPI_Gather(&finished->count, 1, MPI_INT64_T, in.counts, 1, MPI_INT64_T, 0, comm);
        if (code == MPI_SUCCESS)
            code = rank == 0 ? receive_all(&in, comm, out) : send_all(finished, message_pixels, comm);
        status = comp_agree(comm, comp_mpi_status(code, error), error);
        if (status == INSITU_OK && rank != 0) *sent_bytes += finished->count * (int64_t)sizeof(comp_pixel);
    }
    close_inbox(&in);
    return status;
}
