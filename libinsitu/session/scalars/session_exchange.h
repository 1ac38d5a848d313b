/* All-to-all exchange of words. */
#ifndef SESSION_EXCHANGE_H
#define SESSION_EXCHANGE_H

#include <mpi.h>
#include <stdbool.h>
#include <stdint.h>

#include "error.h"
#include "session_keys.h"

/* 8-byte words to or from every rank, in the order of ranks. */
typedef struct session_mail {
    int64_t *counts; /* one per rank */
    uint64_t *words;
    int64_t total;
} session_mail;

void session_mail_free(session_mail *mail);

/* MPI tag of a delivery. Two consecutive deliveries on one communicator need different tags, or another collective call
 * between them. */
typedef enum session_mail_tag { SESSION_MAIL_THERE = 1, SESSION_MAIL_BACK } session_mail_tag;

/* Delivers the words of every rank's `out` to the ranks for which they are. *in owns its memory. Messages are sent only
 * to ranks that get words, and one reduction determines when all have been received. A rank that has failed before
 * calls this with its error in *error, and its `out` is not read: then all ranks return that error. An error in
 * receiving is stored in this rank's *error only, with *in empty, for the next phase to agree on. Collective. */
insitu_status session_mail_deliver(MPI_Comm comm, session_mail_tag tag, const session_mail *out, session_mail *in,
                                   base_error *error);

/* As session_mail_deliver(), but ranks also agree on errors in receiving. Collective, agreed. */
insitu_status session_mail_exchange(MPI_Comm comm, const session_mail *out, session_mail *in, base_error *error);

/* Returns how many items a rank processes in a round in which each may cause a message to every rank: at most `most`,
 * and fewer with more ranks, so that a round's messages are bounded. The same on all ranks. */
int64_t session_mail_round(int ranks, int64_t most);

#endif
