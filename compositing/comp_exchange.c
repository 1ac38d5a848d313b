/* Direct send: every rank sends every owner what is the owner's, in as many messages as there are pairs that share
 * anything. Few ranks, or fragments of an object that covers little of the image, want nothing better.
 *
 * Counts go first, all to all; then both sides know every message, post all receives and sends, and wait once. Own
 * fragments are copied meanwhile. Whatever can fail on one rank alone happens before the first message and is agreed
 * upon, so that a posted receive always has its send. */
#include "comp_exchange.h"

#include <string.h>

#include "comp_agree.h"
#include "comp_bucket.h"
#include "memory.h"

enum { tag_fragments = 1 };

typedef struct exchange {
    int64_t *send_starts;    /* ranks + 1, in items */
    int64_t *send_counts;    /* ranks */
    int64_t *receive_counts; /* ranks */
    fragment *received;
    int64_t received_count;
    MPI_Request *requests;
    int64_t request_count;
} exchange;

static insitu_status out_of_memory(base_error *error, const char *what, int64_t bytes)
{
    return base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory for %s (%lld bytes)", what, (long long)bytes);
}

static insitu_status sort_by_owner(exchange *x, const comp_layout *layout, fragment_list *items, base_error *error)
{
    const size_t ranks = layout->ranks;
    x->send_starts = base_alloc((ranks + 1) * sizeof *x->send_starts);
    x->send_counts = base_alloc(ranks * sizeof *x->send_counts);
    x->receive_counts = base_alloc(ranks * sizeof *x->receive_counts);
    if (!x->send_starts || !x->send_counts || !x->receive_counts)
        return out_of_memory(error, "message counts", (int64_t)(3 * ranks * sizeof *x->send_counts));
    if (!comp_bucket_fits(layout, items->items, items->count))
        return base_fail(error, INSITU_ERROR_INTERNAL, "compositing: a fragment's pixel is not in the image");
    comp_bucket_by_owner(layout, items->items, items->count, x->send_starts);
    for (size_t r = 0; r < ranks; r++) x->send_counts[r] = x->send_starts[r + 1] - x->send_starts[r];
    return INSITU_OK;
}

static int64_t messages_of(int64_t count, int64_t message_fragments)
{
    return (count + message_fragments - 1) / message_fragments;
}

static insitu_status make_room(exchange *x, const comp_layout *layout, int rank, int64_t message_fragments,
                               base_error *error)
{
    int64_t messages = 0;
    for (int r = 0; r < (int)layout->ranks; r++) {
        x->received_count += x->receive_counts[r];
        if (r == rank) continue;
        messages += messages_of(x->receive_counts[r], message_fragments);
        messages += messages_of(x->send_counts[r], message_fragments);
    }
    if (messages > INT32_MAX) return base_fail(error, INSITU_ERROR_INTERNAL, "compositing: too many messages");
    const size_t bytes = (size_t)x->received_count * sizeof(fragment);
    x->received = base_alloc(bytes);
    if (!x->received) return out_of_memory(error, "received fragments", (int64_t)bytes);
    x->requests = base_alloc((size_t)messages * sizeof(MPI_Request));
    if (!x->requests) return out_of_memory(error, "requests", messages * (int64_t)sizeof(MPI_Request));
    return INSITU_OK;
}

static int message_bytes(int64_t message_fragments, int64_t left)
{
    return (int)((left < message_fragments ? left : message_fragments) * (int64_t)sizeof(fragment));
}

static int post_receives(exchange *x, MPI_Comm comm, int from, fragment *to, int64_t message_fragments)
{
    const int64_t count = x->receive_counts[from];
    int code = MPI_SUCCESS;
    for (int64_t i = 0; i < count && code == MPI_SUCCESS; i += message_fragments)
        code = MPI_Irecv(to + i, message_bytes(message_fragments, count - i), MPI_BYTE, from, tag_fragments, comm,
                         &x->requests[x->request_count++]);
    return code;
}

static int post_sends(exchange *x, MPI_Comm comm, int to, const fragment *items, int64_t message_fragments)
{
    const int64_t count = x->send_counts[to], first = x->send_starts[to];
    int code = MPI_SUCCESS;
    for (int64_t i = 0; i < count && code == MPI_SUCCESS; i += message_fragments)
        code = MPI_Isend(items + first + i, message_bytes(message_fragments, count - i), MPI_BYTE, to, tag_fragments,
                         comm, &x->requests[x->request_count++]);
    return code;
}

/* All receives first; then sends, each rank beginning with its successor, so that they do not all begin with rank 0. */
static int move_fragments(exchange *x, MPI_Comm comm, const comp_layout *layout, int rank, const fragment *items,
                          int64_t message_fragments)
{
    const int ranks = (int)layout->ranks;
    fragment *to = x->received, *own = x->received;
    int code = MPI_SUCCESS;
    for (int r = 0; r < ranks && code == MPI_SUCCESS; to += x->receive_counts[r++]) {
        if (r == rank)
            own = to;
        else
            code = post_receives(x, comm, r, to, message_fragments);
    }
    for (int i = 1; i < ranks && code == MPI_SUCCESS; i++)
        code = post_sends(x, comm, (int)(((int64_t)rank + i) % ranks), items, message_fragments);
    if (x->send_counts[rank]) memcpy(own, items + x->send_starts[rank], (size_t)x->send_counts[rank] * sizeof *own);
    const int waited = MPI_Waitall((int)x->request_count, x->requests, MPI_STATUSES_IGNORE);
    return code != MPI_SUCCESS ? code : waited;
}

static insitu_status run(exchange *x, MPI_Comm comm, const comp_layout *layout, fragment_list *items,
                         int64_t message_fragments, base_error *error)
{
    int rank = 0;
    MPI_Comm_rank(comm, &rank);
    insitu_status status = comp_agree(comm, sort_by_owner(x, layout, items, error), error);
    if (status != INSITU_OK) return status;
    status =
        comp_mpi_status(MPI_Alltoall(x->send_counts, 1, MPI_INT64_T, x->receive_counts, 1, MPI_INT64_T, comm), error);
    if (status == INSITU_OK) status = make_room(x, layout, rank, message_fragments, error);
    status = comp_agree(comm, status, error);
    if (status != INSITU_OK) return status;
    status = comp_mpi_status(move_fragments(x, comm, layout, rank, items->items, message_fragments), error);
    return comp_agree(comm, status, error);
}

insitu_status comp_exchange_direct(MPI_Comm comm, const comp_layout *layout, fragment_list *items,
                                   int64_t message_fragments, fragment_list *owned, int64_t *sent_bytes,
                                   base_error *error)
{
    exchange x = {0};
    int rank = 0;
    MPI_Comm_rank(comm, &rank);
    const insitu_status status = run(&x, comm, layout, items, message_fragments, error);
    if (status == INSITU_OK) {
        *sent_bytes += (items->count - x.send_counts[rank]) * (int64_t)sizeof(fragment);
        *owned = (fragment_list){x.received, x.received_count, x.received_count};
        x.received = NULL;
    }
    base_free(x.received);
    base_free(x.requests);
    base_free(x.receive_counts);
    base_free(x.send_counts);
    base_free(x.send_starts);
    return status;
}
