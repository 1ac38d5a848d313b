/* Messages between ranks: parcels of blocks (comp_block.h), each for one owner.
 *
 *     message | are there more? | parcel | parcel | ...          parcel | owner, records, bytes | block | block | ...
 *
 * A message is at most COMP_MESSAGE_BYTES long, so that one that there is no memory for can still be received, into
 * room that was made before, and thrown away: a rank that runs out of memory keeps nobody waiting. */
#ifndef COMP_COMP_MAIL_H
#define COMP_COMP_MAIL_H

#include <mpi.h>
#include <stdbool.h>
#include <stddef.h>

#include "comp_block.h"
#include "comp_route.h"
#include "error.h"

enum { COMP_MESSAGE_BYTES = 1 << 17, COMP_MESSAGE_HEAD = 4, COMP_PARCEL_HEAD = 12 };

typedef struct comp_message {
    struct comp_message *next;
    int rank;  /* that it comes from or goes to */
    int bytes; /* of data; there is slack behind them */
    unsigned char data[];
} comp_message;

typedef struct comp_messages {
    comp_message *first, *last;
} comp_messages;

void comp_messages_free(comp_messages *messages);
void comp_messages_append(comp_messages *to, comp_messages *from);

typedef struct comp_parcel {
    uint32_t owner;
    uint32_t records;
    uint32_t bytes;
    const unsigned char *data;
} comp_parcel;

/* The message's parcel at *offset (COMP_MESSAGE_HEAD: the first), which moves behind it. False: there are no more. */
bool comp_next_parcel(const comp_message *message, size_t *offset, comp_parcel *out);

/* Writes messages to one rank. */
typedef struct comp_writer {
    comp_messages messages;
    int rank;
    size_t room;   /* of the last message */
    size_t parcel; /* where the last parcel begins; 0: there is none */
} comp_writer;

/* Room for so many bytes of a parcel for the owner, or NULL: no memory. expected: bytes that may follow in all. */
unsigned char *comp_writer_room(comp_writer *writer, uint32_t owner, size_t bytes, size_t expected);

/* What was written there ends at end, and holds so many records. */
void comp_writer_commit(comp_writer *writer, unsigned char *end, uint32_t records);

/* What a rank needs to take part in the rounds, whatever runs out of memory then. */
typedef struct comp_mailroom {
    MPI_Comm comm;
    int rank;
    unsigned char *waste; /* COMP_MESSAGE_BYTES: for what there is no room for */
    MPI_Request *reserve; /* a request for each partner of the longest dense round */
    comp_block *block;
    unsigned char *outgoing[2]; /* COMP_MESSAGE_BYTES each: of pixels on their way to rank 0 */
    int64_t sent_bytes, sent_messages;
} comp_mailroom;

insitu_status comp_mailroom_open(MPI_Comm comm, comp_mailroom *out, base_error *error);
void comp_mailroom_close(comp_mailroom *room);

/* One round: messages go out, *in gets what comes, in memory of its own. status: of this rank so far; where it is none
 * of success nothing is sent, and all that comes is thrown away. All ranks of comm call it. Returns the status of this
 * rank alone. */
insitu_status comp_mail_round(comp_mailroom *room, const comp_route *route, int round, comp_messages *out,
                              comp_messages *in, insitu_status status, base_error *error);

/* Before the first round: ranks beyond the owners give all to their partners, who take it. */
insitu_status comp_mail_fold(comp_mailroom *room, const comp_route *route, comp_messages *out, comp_messages *in,
                             insitu_status status, base_error *error);

#endif
