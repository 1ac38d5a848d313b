/* In a dense round every partner sends to every other, if necessary an empty message, so every rank knows how many
 * messages to expect. In a sparse round only partners with fragments send, and the number of messages is unknown. Sends
 * are therefore synchronous: a send completes only after its message is received. A rank whose sends have completed
 * enters a nonblocking barrier and continues to receive until all ranks have entered it; then no message is in flight
 * (Hoefler, Siebert, Lumsdaine, Scalable Communication Protocols for Dynamic Sparse Data Exchange, 2010). This needs no
 * exchange of counts, only one barrier. */
#include "comp_messages.h"

#include <string.h>

#include "comp_agree.h"
#include "memory.h"

enum { TAG_ROUND = 32, TAG_FOLD = 8, LAST_MESSAGE_BYTES = COMP_MESSAGE_HEAD };

static const unsigned char last_message[LAST_MESSAGE_BYTES] = {0};

/* ---- lists and parcels of messages ------------------------------------------------------------------------------ */

void comp_messages_free(comp_messages *messages)
{
    for (comp_message *m = messages->first, *next; m; m = next) {
        next = m->next;
        base_free(m);
    }
    *messages = (comp_messages){NULL, NULL};
}

void comp_messages_append(comp_messages *to, comp_messages *from)
{
    if (!from->first) return;
    if (to->last)
        to->last->next = from->first;
    else
        to->first = from->first;
    to->last = from->last;
    *from = (comp_messages){NULL, NULL};
}

bool comp_next_parcel(const comp_message *message, size_t *offset, comp_parcel *out)
{
    uint32_t head[3];
    if (*offset + COMP_PARCEL_HEAD > (size_t)message->bytes) return false;
    memcpy(head, message->data + *offset, sizeof head);
    *out = (comp_parcel){head[0], head[1], head[2], message->data + *offset + COMP_PARCEL_HEAD};
    *offset += COMP_PARCEL_HEAD + head[2];
    return true;
}

static bool add_message(comp_writer *w, size_t bytes)
{
    comp_message *m = base_alloc(sizeof *m + bytes + COMP_SHEET_SLACK);
    if (!m) return false;
    *m = (comp_message){NULL, w->rank, COMP_MESSAGE_HEAD};
    memset(m->data, 0, COMP_MESSAGE_HEAD);
    comp_messages_append(&w->messages, &(comp_messages){m, m});
    w->capacity = bytes;
    w->parcel = 0;
    return true;
}

static void write_parcel_header(comp_message *m, size_t parcel, uint32_t owner, uint32_t records)
{
    const uint32_t head[3] = {owner, records, (uint32_t)((size_t)m->bytes - parcel - COMP_PARCEL_HEAD)};
    memcpy(m->data + parcel, head, sizeof head);
}

static uint32_t find_parcel_owner(const comp_writer *w)
{
    uint32_t owner;
    memcpy(&owner, w->messages.last->data + w->parcel, sizeof owner);
    return owner;
}

unsigned char *comp_writer_reserve(comp_writer *w, uint32_t owner, size_t bytes, size_t expected)
{
    if (!w->messages.last || (size_t)w->messages.last->bytes + COMP_PARCEL_HEAD + bytes > w->capacity) {
        const size_t wanted = COMP_MESSAGE_HEAD + COMP_PARCEL_HEAD + (expected > bytes ? expected : bytes);
        if (!add_message(w, wanted < COMP_MESSAGE_BYTES ? wanted : COMP_MESSAGE_BYTES)) return NULL;
    }
    comp_message *const m = w->messages.last;
    if (!w->parcel || find_parcel_owner(w) != owner) {
        w->parcel = (size_t)m->bytes;
        m->bytes += COMP_PARCEL_HEAD;
        write_parcel_header(m, w->parcel, owner, 0);
    }
    return m->data + m->bytes;
}

void comp_writer_commit(comp_writer *w, unsigned char *end, uint32_t records)
{
    comp_message *const m = w->messages.last;
    uint32_t head[3];
    memcpy(head, m->data + w->parcel, sizeof head);
    m->bytes = (int)(end - m->data);
    write_parcel_header(m, w->parcel, head[0], head[1] + records);
}

/* ---- rounds of messages ----------------------------------------------------------------------------------------- */

insitu_status comp_transport_open(MPI_Comm comm, comp_transport *out, base_error *error)
{
    *out = (comp_transport){.comm = comm};
    MPI_Comm_rank(comm, &out->rank);
    out->receive_buffer = base_alloc(COMP_MESSAGE_BYTES + COMP_SHEET_SLACK);
    out->reserved_requests = base_alloc(COMP_MAX_DENSE_RANKS * sizeof(MPI_Request));
    out->sheet = base_alloc(sizeof *out->sheet);
    if (out->receive_buffer && out->reserved_requests && out->sheet) return INSITU_OK;
    comp_transport_close(out);
    return base_fail(error, INSITU_ERROR_MEMORY, "compositing: no memory for messages (%d bytes)", COMP_MESSAGE_BYTES);
}

void comp_transport_close(comp_transport *transport)
{
    base_free(transport->receive_buffer);
    base_free(transport->reserved_requests);
    base_free(transport->sheet);
    *transport = (comp_transport){0};
}

/* The state of one round on this rank. */
typedef struct round {
    comp_transport *transport;
    int tag;
    bool is_sparse;
    int open_partners;     /* number of partners whose last message has not been received; not used in a sparse
                              round, in which this number is unknown */
    comp_messages *in;     /* list to which received messages are appended */
    MPI_Request *requests; /* requests of this rank's sends */
    int request_count;
    insitu_status status;
    base_error *error;
} round;

static void fail_memory(round *r, int bytes)
{
    if (r->status == INSITU_OK)
        r->status = base_fail(r->error, INSITU_ERROR_MEMORY, "compositing: no memory for a message of %d bytes", bytes);
}

static void check_mpi(round *r, int code)
{
    if (code != MPI_SUCCESS && r->status == INSITU_OK) r->status = comp_convert_mpi_error(code, r->error);
}

static void send_data(round *r, const unsigned char *data, int bytes, int rank)
{
    MPI_Request *const request = &r->requests[r->request_count++];
    check_mpi(r, r->is_sparse ? MPI_Issend(data, bytes, MPI_BYTE, rank, r->tag, r->transport->comm, request)
                              : MPI_Isend(data, bytes, MPI_BYTE, rank, r->tag, r->transport->comm, request));
    r->transport->sent_bytes += bytes;
    r->transport->sent_messages++;
}

/* Allocates an MPI request for each message. If this rank has failed or memory runs out, drops the fragments and uses
 * the requests that comp_transport_open() has allocated. These suffice for the empty messages that this rank must still
 * send to every partner. */
static void make_requests(round *r, comp_messages *out, int partners)
{
    int count = r->is_sparse ? 0 : partners;
    for (const comp_message *m = out->first; m; m = m->next) count++;
    r->requests = r->status == INSITU_OK ? base_alloc((size_t)count * sizeof *r->requests) : NULL;
    if (r->requests) return;
    fail_memory(r, count * (int)sizeof *r->requests);
    comp_messages_free(out);
    r->requests = r->transport->reserved_requests;
}

/* Receives a message that MPI_Mprobe() or MPI_Improbe() has matched. Discards the message if there is no memory for
 * it. */
static void receive_message(round *r, MPI_Message *found, const MPI_Status *status)
{
    int bytes = 0;
    MPI_Get_count(status, MPI_BYTE, &bytes);
    comp_message *m = NULL;
    if (bytes > COMP_MESSAGE_HEAD && r->status == INSITU_OK) {
        m = base_alloc(sizeof *m + (size_t)bytes + COMP_SHEET_SLACK);
        if (!m) fail_memory(r, bytes);
    }
    unsigned char *const data = m ? m->data : r->transport->receive_buffer;
    check_mpi(r, MPI_Mrecv(data, bytes, MPI_BYTE, found, MPI_STATUS_IGNORE));
    r->open_partners -= !data[0];
    if (!m) return;
    m->next = NULL;
    m->rank = status->MPI_SOURCE;
    m->bytes = bytes;
    comp_messages_append(r->in, &(comp_messages){m, m});
}

static void receive_dense_round(round *r)
{
    while (r->open_partners > 0) {
        MPI_Message found;
        MPI_Status status;
        const int code = MPI_Mprobe(MPI_ANY_SOURCE, r->tag, r->transport->comm, &found, &status);
        check_mpi(r, code);
        if (code != MPI_SUCCESS) return;
        receive_message(r, &found, &status);
    }
    check_mpi(r, MPI_Waitall(r->request_count, r->requests, MPI_STATUSES_IGNORE));
}

static void receive_sparse_round(round *r)
{
    MPI_Request barrier = MPI_REQUEST_NULL;
    int is_over = 0, code = MPI_SUCCESS;
    for (bool is_in_barrier = false; !is_over && code == MPI_SUCCESS;) {
        int is_there = 0, are_sent = 0;
        MPI_Message found;
        MPI_Status status;
        code = MPI_Improbe(MPI_ANY_SOURCE, r->tag, r->transport->comm, &is_there, &found, &status);
        if (code == MPI_SUCCESS && is_there) receive_message(r, &found, &status);
        if (code == MPI_SUCCESS && is_in_barrier) {
            code = MPI_Test(&barrier, &is_over, MPI_STATUS_IGNORE);
        } else if (code == MPI_SUCCESS) {
            code = MPI_Testall(r->request_count, r->requests, &are_sent, MPI_STATUSES_IGNORE);
            if (code == MPI_SUCCESS && are_sent) code = MPI_Ibarrier(r->transport->comm, &barrier);
            is_in_barrier = are_sent;
        }
    }
    check_mpi(r, code);
}

/* Marks the last message to a rank as final (flag 0), and the earlier ones as followed by more (flag 1). Returns false
 * if there is no message to the rank. */
static bool mark_final_message(const comp_messages *out, int rank)
{
    comp_message *last = NULL;
    for (comp_message *m = out->first; m; m = m->next) {
        if (m->rank != rank) continue;
        m->data[0] = 1;
        last = m;
    }
    if (last) last->data[0] = 0;
    return last != NULL;
}

static insitu_status run_round(round *r, comp_messages *out)
{
    for (const comp_message *m = out->first; m; m = m->next) send_data(r, m->data, m->bytes, m->rank);
    if (r->is_sparse)
        receive_sparse_round(r);
    else
        receive_dense_round(r);
    if (r->requests != r->transport->reserved_requests) base_free(r->requests);
    comp_messages_free(out);
    if (r->status) comp_messages_free(r->in);
    return r->status;
}

insitu_status comp_messages_run_round(comp_transport *transport, const comp_route *route, int number,
                                      comp_messages *out, comp_messages *in, insitu_status status, base_error *error)
{
    const int place = comp_find_place_of_rank(route, transport->rank), stride = comp_route_stride(route, number);
    const bool takes_part = place < route->owners;
    const int partners = takes_part ? route->radix[number] - 1 : 0;
    round r = {.transport = transport, .tag = TAG_ROUND + number, .in = in, .status = status, .error = error};
    r.is_sparse = !comp_route_is_dense(route, number);
    if (!takes_part && !r.is_sparse) return status;
    make_requests(&r, out, partners);
    if (!r.is_sparse) r.open_partners = partners;
    const int own = comp_route_digit(route, number, stride, place);
    for (int i = 1; i <= partners && !r.is_sparse; i++) {
        const int digit = (own + i) % route->radix[number];
        const int rank = comp_find_rank_at_place(route, comp_route_partner(route, number, stride, place, digit));
        if (!mark_final_message(out, rank)) send_data(&r, last_message, LAST_MESSAGE_BYTES, rank);
    }
    return run_round(&r, out);
}

insitu_status comp_messages_send_to_owners(comp_transport *transport, const comp_route *route, comp_messages *out,
                                           comp_messages *in, insitu_status status, base_error *error)
{
    const int place = comp_find_place_of_rank(route, transport->rank);
    const bool sends_all = place >= route->owners, receives_all = place + route->owners < route->ranks;
    round r = {.transport = transport,
               .tag = TAG_FOLD,
               .in = in,
               .open_partners = receives_all,
               .status = status,
               .error = error};
    if (!sends_all && !receives_all) return status;
    make_requests(&r, out, 1);
    const int partner = sends_all ? comp_find_rank_at_place(route, place - route->owners) : 0;
    if (sends_all && !mark_final_message(out, partner)) send_data(&r, last_message, LAST_MESSAGE_BYTES, partner);
    return run_round(&r, out);
}
