/* Keys of vertices, and all-to-all exchange of words. */
#ifndef SESSION_EXCHANGE_H
#define SESSION_EXCHANGE_H

#include <mpi.h>
#include <stdbool.h>
#include <stdint.h>

#include "error.h"

/* Key of a vertex: a global id, or the bits of three coordinates. Vertices with equal keys are the same vertex. */
typedef struct session_key {
    uint64_t words[3];
} session_key;

/* Spreads the bits of a word over all of it. */
static inline uint64_t session_mix(uint64_t x)
{
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

uint64_t session_key_hash(const session_key *key);

/* Keys, numbered 0, 1, ... in the order of their first appearance. */
typedef struct session_key_table {
    session_key *keys; /* count keys */
    int64_t count;
    int64_t *slots; /* mask + 1; -1: free */
    uint64_t mask;
} session_key_table;

/* Creates a table with space for `most` keys. Returns false if memory ran out; nothing is then left to free. */
bool session_keys_create(session_key_table *table, int64_t most);
/* Return the key's number; session_keys_find() returns -1 if it is missing, session_keys_add() adds it. */
int64_t session_keys_find(const session_key_table *table, const session_key *key);
int64_t session_keys_add(session_key_table *table, const session_key *key);
void session_keys_free(session_key_table *table);

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
