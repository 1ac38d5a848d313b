/* Exchanges words between all ranks. */
#ifndef SESSION_EXCHANGE_H
#define SESSION_EXCHANGE_H

#include <mpi.h>
#include <stdbool.h>
#include <stdint.h>

#include "error.h"
#include "session_keys.h"

/* 8-byte words that are sent to or received from each rank, in the order of ranks. */
typedef struct session_mail {
    int64_t *counts; /* number of words for each rank */
    uint64_t *words; /* the words for all ranks, in the order of ranks */
    int64_t total;   /* number of words for all ranks */
} session_mail;

void session_mail_free(session_mail *mail);

/* MPI tags of message exchanges. Two consecutive exchanges on one communicator need different tags, or another
 * collective call between them. */
typedef enum session_mail_tag { SESSION_MAIL_THERE = 1, SESSION_MAIL_BACK } session_mail_tag;

/* Sends the words in every rank's `out` to the ranks for which they are intended. *in receives the words for this rank,
 * and owns its memory. Messages are sent only to ranks for which there are words, and one reduction determines when all
 * have been received. A rank on which an error has occurred before passes it in *error, and its `out` is not read; then
 * all ranks return that error. An error in receiving is stored only in this rank's *error, with *in empty, and must be
 * shared by the next phase. Collective. */
insitu_status session_mail_deliver(MPI_Comm comm, session_mail_tag tag, const session_mail *out, session_mail *in,
                                   base_error *error);

/* Exchanges words in the same way as session_mail_deliver(), but ranks also share errors in receiving. Collective; all
 * ranks return the same status. */
insitu_status session_mail_exchange(MPI_Comm comm, const session_mail *out, session_mail *in, base_error *error);

/* Returns the number of items that a rank processes in one round of messages, if each item may cause a message to every
 * rank. It is at most `most`, and smaller for more ranks, so that the memory for a round's messages is bounded. The
 * result is the same on all ranks. */
int64_t session_mail_round_size(int ranks, int64_t most);

#endif
