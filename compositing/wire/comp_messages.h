/* Messages between ranks. A message contains parcels, each for one owner, and a parcel contains sheets (comp_sheet.h).
 *
 *     message | flag: more follow | parcel | parcel | ...        parcel | owner, records, bytes | sheet | sheet | ...
 *
 * A message is at most COMP_MESSAGE_BYTES long. A rank that runs out of memory can therefore receive a message in a
 * buffer that was allocated beforehand, and discard it, so that the sender does not wait. */
#ifndef COMP_COMP_MESSAGES_H
#define COMP_COMP_MESSAGES_H

#include <mpi.h>
#include <stdbool.h>
#include <stddef.h>

#include "comp_route.h"
#include "comp_sheet.h"
#include "error.h"

enum { COMP_MESSAGE_BYTES = 1 << 17, COMP_MESSAGE_HEAD = 4, COMP_PARCEL_HEAD = 12 };

typedef struct comp_message {
    struct comp_message *next;
    int rank;  /* rank of the message's source or destination */
    int bytes; /* number of bytes of the message in `data`, without the unused bytes behind them */
    unsigned char data[];
} comp_message;

typedef struct comp_messages {
    comp_message *first, *last;
} comp_messages;

void comp_messages_free(comp_messages *messages);
void comp_messages_append(comp_messages *to, comp_messages *from);

typedef struct comp_parcel {
    uint32_t owner;
    uint32_t records; /* number of fragments or finished pixels in the parcel */
    uint32_t bytes;
    const unsigned char *data;
} comp_parcel;

/* Reads the message's parcel at *offset, and sets *offset to the end of the parcel. COMP_MESSAGE_HEAD is the offset of
 * the first parcel. Returns false if there are no more parcels. */
bool comp_next_parcel(const comp_message *message, size_t *offset, comp_parcel *out);

/* The messages to one rank while they are being written. */
typedef struct comp_writer {
    comp_messages messages;
    int rank;
    size_t capacity; /* capacity of the last message in bytes */
    size_t parcel;   /* offset in bytes of the last parcel in the last message; 0: the message has no parcel */
} comp_writer;

/* Returns space for `bytes` bytes in a parcel for the owner, or NULL if memory ran out. `expected` is an estimate of
 * all bytes that are still to be written; it determines the size of a new message. */
unsigned char *comp_writer_reserve(comp_writer *writer, uint32_t owner, size_t bytes, size_t expected);

/* Appends to the parcel the bytes that the caller has written, from the start of the reserved space up to `end`.
 * `records` is the number of fragments or finished pixels in these bytes. */
void comp_writer_commit(comp_writer *writer, unsigned char *end, uint32_t records);

/* The communicator, and buffers allocated before the rounds, so that a rank can take part in the rounds even if it runs
 * out of memory later. */
typedef struct comp_transport {
    MPI_Comm comm;
    int rank;
    /* buffer of COMP_MESSAGE_BYTES bytes for messages that are forwarded, and for messages that are discarded for lack
     * of memory */
    unsigned char *receive_buffer;
    MPI_Request *reserved_requests; /* COMP_MAX_DENSE_RANKS MPI requests: one for each partner of the largest round
                                       in which every partner sends to every other */
    comp_sheet *sheet;              /* scratch sheet in which rank 0 unpacks pixels */
    int64_t sent_bytes, sent_messages;
} comp_transport;

insitu_status comp_transport_open(MPI_Comm comm, comp_transport *out, base_error *error);
void comp_transport_close(comp_transport *transport);

/* Runs one round: sends the messages in `out`; *in receives the messages of other ranks; the caller must free them.
 * `status` is this rank's status before the call; if it is an error, the rank sends no fragments, and received messages
 * are discarded. Returns this rank's own status. Collective. */
insitu_status comp_messages_run_round(comp_transport *transport, const comp_route *route, int round, comp_messages *out,
                                      comp_messages *in, insitu_status status, base_error *error);

/* Before the first round, ranks that cannot own pixels send all their fragments to their partners. The partners are
 * owners. */
insitu_status comp_messages_send_to_owners(comp_transport *transport, const comp_route *route, comp_messages *out,
                                           comp_messages *in, insitu_status status, base_error *error);

#endif
