/* Counts in MPI are of type int. Words have 8 bytes, so that a rank can send up to 16 GiB to another at once. A larger
 * message is an error on all ranks, instead of an overflow. */
#include "session_exchange.h"

#include <string.h>

#include "memory.h"
#include "session_agree.h"

void session_mail_free(session_mail *mail)
{
    base_free(mail->counts);
    base_free(mail->words);
    *mail = (session_mail){0};
}

/* ---- messages -------------------------------------------------------------------------------------------------- */

/* A received message. Ranks do not know in advance which ranks send to them, so that the algorithm of Hoefler et al.
 * (2010) is used. Sends are synchronous: a send completes only after its message is received. A rank whose sends are
 * complete joins a non-blocking reduction. When the reduction is complete, the messages of all ranks have been
 * received. */
typedef struct message {
    struct message *next;
    int source_rank; /* rank that sent the message */
    int64_t count;   /* number of words of the message */
    uint64_t words[];
} message;

typedef struct delivery {
    MPI_Comm comm;
    int tag, rank, ranks;
    int send_count;     /* number of messages that this rank sends */
    MPI_Request *sends; /* MPI requests, one per sent message */
    /* linked list of the received messages */
    message *messages;
} delivery;

static insitu_status start_sends(delivery *d, const session_mail *out, base_error *error)
{
    const uint64_t *words = out->words;
    int receivers = 0;
    for (int r = 0; r < d->ranks; r++) {
        receivers += out->counts[r] > 0;
        if (out->counts[r] > INT32_MAX)
            return base_fail(error, INSITU_ERROR_MEMORY,
                             "%lld bytes of data for rank %d, at most %lld can be sent at once",
                             8 * (long long)out->counts[r], r, 8LL * INT32_MAX);
    }
    d->sends = base_alloc((size_t)(receivers + 1) * sizeof(MPI_Request));
    if (!d->sends) return base_fail(error, INSITU_ERROR_MEMORY, "no memory for messages to %d ranks", receivers);
    for (int n = 0; n < d->ranks; n++) {
        const int64_t count = out->counts[n];
        if (count && n != d->rank && !error->status) {
            session_check_mpi(error,
                              MPI_Issend(words, (int)count, MPI_UINT64_T, n, d->tag, d->comm, &d->sends[d->send_count]),
                              "MPI_Issend");
            d->send_count += !error->status;
        }
        words += count;
    }
    return error->status;
}

static message *message_create(delivery *d, int from, int64_t count)
{
    message *l = base_alloc(sizeof *l + (size_t)count * sizeof *l->words);
    if (!l) return NULL;
    l->source_rank = from;
    l->count = count;
    l->next = d->messages;
    return d->messages = l;
}

/* Receives a message. If memory runs out, it is received with length 0 and its data is lost, so that the sender's call
 * can complete. */
static void receive_message(delivery *d, const MPI_Status *found, base_error *error)
{
    int count = 0;
    MPI_Get_count(found, MPI_UINT64_T, &count);
    message *l = error->status ? NULL : message_create(d, found->MPI_SOURCE, count);
    const int code = MPI_Recv(l ? l->words : NULL, l ? count : 0, MPI_UINT64_T, found->MPI_SOURCE, d->tag, d->comm,
                              MPI_STATUS_IGNORE);
    if (l)
        session_check_mpi(error, code, "MPI_Recv");
    else if (!error->status)
        base_fail(error, INSITU_ERROR_MEMORY, "no memory for %lld bytes of data between ranks", (long long)count * 8);
}

/* Receives messages until the messages of all ranks have been received. *failed receives the lowest rank that had an
 * error before this call, or `ranks` if no rank had one. */
static insitu_status receive_all(delivery *d, int *failed, base_error *error)
{
    int own = error->status ? d->rank : d->ranks, has_joined = 0, is_over = 0;
    base_error lost = {0}; /* first error of this rank while it received messages */
    MPI_Request all = MPI_REQUEST_NULL;
    insitu_status status = INSITU_OK;
    while (!status && !is_over) {
        MPI_Status found;
        int has_come = 0;
        status = session_check_mpi(error, MPI_Iprobe(MPI_ANY_SOURCE, d->tag, d->comm, &has_come, &found), "MPI_Iprobe");
        if (!status && has_come) receive_message(d, &found, &lost);
        if (has_come || status) continue;
        if (has_joined) {
            status = session_check_mpi(error, MPI_Test(&all, &is_over, MPI_STATUS_IGNORE), "MPI_Test");
            continue;
        }
        status = session_check_mpi(error, MPI_Testall(d->send_count, d->sends, &has_joined, MPI_STATUSES_IGNORE),
                                   "MPI_Testall");
        if (!status && has_joined)
            status = session_check_mpi(error, MPI_Iallreduce(&own, failed, 1, MPI_INT, MPI_MIN, d->comm, &all),
                                       "MPI_Iallreduce");
    }
    if (!status && !error->status) *error = lost;
    return status;
}

/* Adds the words that this rank sends to itself, as if they were a received message. */
static void copy_own_words(delivery *d, const session_mail *out, base_error *error)
{
    const uint64_t *words = out->words;
    for (int r = 0; r < d->rank; r++) words += out->counts[r];
    const int64_t count = out->counts[d->rank];
    if (!count) return;
    message *l = message_create(d, d->rank, count);
    if (l)
        memcpy(l->words, words, (size_t)count * sizeof *words);
    else
        base_fail(error, INSITU_ERROR_MEMORY, "no memory for %lld bytes of data", (long long)count * 8);
}

/* Concatenates the messages in the order of the ranks that sent them. */
static void concatenate_messages(const delivery *d, session_mail *in, base_error *error)
{
    int64_t *starts = base_calloc((size_t)d->ranks + 1, sizeof *starts);
    in->counts = base_calloc((size_t)d->ranks, sizeof *in->counts);
    for (const message *l = d->messages; l && !error->status; l = l->next) in->total += l->count;
    in->words = base_alloc((size_t)(in->total + 1) * sizeof *in->words);
    if (!starts || !in->counts || !in->words) {
        base_fail(error, INSITU_ERROR_MEMORY, "no memory for %lld bytes of data between ranks",
                  (long long)in->total * 8);
        in->total = 0;
    }
    for (const message *l = d->messages; l && !error->status; l = l->next) in->counts[l->source_rank] = l->count;
    for (int r = 0; r < d->ranks && !error->status; r++) starts[r + 1] = starts[r] + in->counts[r];
    for (const message *l = d->messages; l && !error->status; l = l->next)
        memcpy(in->words + starts[l->source_rank], l->words, (size_t)l->count * sizeof *l->words);
    base_free(starts);
}

static void free_delivery(delivery *d)
{
    while (d->messages) {
        message *next = d->messages->next;
        base_free(d->messages);
        d->messages = next;
    }
    base_free(d->sends);
}

insitu_status session_mail_deliver(MPI_Comm comm, session_mail_tag tag, const session_mail *out, session_mail *in,
                                   base_error *error)
{
    delivery d = {.comm = comm, .tag = (int)tag};
    int failed = 0;
    *in = (session_mail){0};
    MPI_Comm_rank(comm, &d.rank);
    MPI_Comm_size(comm, &d.ranks);
    if (!error->status) start_sends(&d, out, error);
    if (!error->status) copy_own_words(&d, out, error);
    insitu_status status = receive_all(&d, &failed, error);
    if (!status && failed < d.ranks) status = session_agree(comm, error);
    if (!status) concatenate_messages(&d, in, error);
    free_delivery(&d);
    if (status) session_mail_free(in);
    return status;
}

insitu_status session_mail_exchange(MPI_Comm comm, const session_mail *out, session_mail *in, base_error *error)
{
    insitu_status status = session_mail_deliver(comm, SESSION_MAIL_THERE, out, in, error);
    if (!status) status = session_agree(comm, error);
    if (status) session_mail_free(in);
    return status;
}

int64_t session_count_items_per_round(int ranks, int64_t most)
{
    enum { LEAST = 1 << 10, QUESTIONS = 1 << 22 };
    const int64_t count = QUESTIONS / ranks;
    return count < LEAST ? LEAST : count < most ? count : most;
}
