/* Messages between ranks: parcels of sheets (comp_sheet.h), each for one owner.
 *
 *     message | are there more? | parcel | parcel | ...          parcel | owner, records, bytes | sheet | sheet | ...
 *
 * A message is at most COMP_MESSAGE_BYTES long. So a rank that runs out of memory can still receive it, in room that
 * was made before, and throw it away: nobody waits for that rank. */
#ifndef COMP_COMP_MAIL_H
#define COMP_COMP_MAIL_H

#include <mpi.h>
#include <stdbool.h>
#include <stddef.h>

#include "comp_route.h"
#include "comp_sheet.h"
#include "error.h"

enum { COMP_MESSAGE_BYTES = 1 << 17, COMP_MESSAGE_HEAD = 4, COMP_PARCEL_HEAD = 12 };

typedef struct comp_message {
    struct comp_message *next;
    int rank;  /* that it comes from or goes to */
    int bytes; /* bytes of data, without the slack behind them */
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

/* Gets the message's parcel at *offset (COMP_MESSAGE_HEAD: the first) and moves *offset behind it. False: there are no
 * more. */
bool comp_next_parcel(const comp_message *message, size_t *offset, comp_parcel *out);

/* Writes messages to one rank. */
typedef struct comp_writer {
    comp_messages messages;
    int rank;
    size_t room;   /* the room of the last message */
    size_t parcel; /* where the last parcel begins; 0: there is none */
} comp_writer;

/* Room for so many bytes of a parcel for the owner, or NULL: no memory. expected is how many bytes may follow in all.
 */
unsigned char *comp_writer_room(comp_writer *writer, uint32_t owner, size_t bytes, size_t expected);

/* Ends what was written there at end; it holds so many records. */
void comp_writer_commit(comp_writer *writer, unsigned char *end, uint32_t records);

/* Memory that a rank needs to take part in the rounds even when it runs out of other memory. */
typedef struct comp_mailroom {
    MPI_Comm comm;
    int rank;
    unsigned char *waste; /* COMP_MESSAGE_BYTES: receives messages that there is no memory for */
    MPI_Request *reserve; /* a request for each partner of the longest dense round */
    comp_sheet *sheet;    /* for pixels that come to rank 0 */
    int64_t sent_bytes, sent_messages;
} comp_mailroom;

insitu_status comp_mailroom_open(MPI_Comm comm, comp_mailroom *out, base_error *error);
void comp_mailroom_close(comp_mailroom *room);

/* One round: sends the messages of out; *in gets those received, in memory of its own. status is this rank's so far; if
 * it is an error, nothing is sent and all that comes is thrown away. All ranks of comm call it. Returns this rank's own
 * status. */
insitu_status comp_mail_round(comp_mailroom *room, const comp_route *route, int round, comp_messages *out,
                              comp_messages *in, insitu_status status, base_error *error);

/* Before the first round: ranks beyond the owners give all to their partners, who take it. */
insitu_status comp_mail_fold(comp_mailroom *room, const comp_route *route, comp_messages *out, comp_messages *in,
                             insitu_status status, base_error *error);

#endif
