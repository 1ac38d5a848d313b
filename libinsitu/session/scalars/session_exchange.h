/* Exchanges messages of 8-byte words between all ranks. */
#ifndef SESSION_EXCHANGE_H
#define SESSION_EXCHANGE_H

#include <mpi.h>
#include <stdbool.h>
#include <stdint.h>

#include "error.h"
#include "session_keys.h"

/* The words that a rank sends to all ranks, or receives from all ranks. A word has 8 bytes. */
typedef struct session_mail {
    int64_t *counts; /* number of words that are sent to each rank, or were received from it */
    uint64_t *words; /* the words that are sent to or were received from all ranks, in the order of ranks */
    int64_t total;   /* number of words of all ranks together */
} session_mail;

void session_mail_free(session_mail *mail);

/* MPI tags of message exchanges. Two consecutive exchanges on one communicator need different tags, or another
 * collective call between them. */
typedef enum session_mail_tag { SESSION_MAIL_THERE = 1, SESSION_MAIL_BACK } session_mail_tag;

/* Sends the words in every rank's `out` to the ranks for which they are intended. *in receives the words for this rank,
 * and owns its memory. A rank sends messages only to ranks for which it has words. One reduction determines when all
 * messages have been received. If a rank's *error already holds an error, its `out` is not read, and all ranks return
 * this error. An error while receiving is only stored in *error of this rank, and *in is then empty; the next
 * collective call, such as session_agree(), must pass the error to all ranks. Collective. */
insitu_status session_mail_deliver(MPI_Comm comm, session_mail_tag tag, const session_mail *out, session_mail *in,
                                   base_error *error);

/* Sends the words in every rank's `out` to the ranks for which they are intended (session_mail_deliver()). An error on
 * any rank, also while receiving, is returned on all ranks. Collective; all ranks return the same status. */
insitu_status session_mail_exchange(MPI_Comm comm, const session_mail *out, session_mail *in, base_error *error);

/* Returns the number of items, such as patch faces or vertices, that a rank processes in one round of messages, if each
 * item may cause a message to every rank. It is at most `most`, and smaller for more ranks, so that the memory for a
 * round's messages is bounded. The result is the same on all ranks. */
int64_t session_count_items_per_round(int ranks, int64_t most);

#endif
