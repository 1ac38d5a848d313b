/* Keys of vertices, and words sent from all ranks to all. */
#ifndef SESSION_EXCHANGE_H
#define SESSION_EXCHANGE_H

#include <mpi.h>
#include <stdbool.h>
#include <stdint.h>

#include "error.h"

/* The key by which two vertices are the same one: a global id, or the bits of three coordinates. */
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

/* Keys numbered 0, 1, ... in the order of their first appearance. */
typedef struct session_key_table {
    session_key *keys; /* count */
    int64_t count;
    int64_t *slots; /* mask + 1; -1: free */
    uint64_t mask;
} session_key_table;

/* Room for up to most keys. False where memory runs out; there is nothing to free then. */
bool session_keys_create(session_key_table *table, int64_t most);
/* The key's number, or -1. */
int64_t session_keys_find(const session_key_table *table, const session_key *key);
int64_t session_keys_add(session_key_table *table, const session_key *key);
void session_keys_free(session_key_table *table);

/* 8-byte words for or from every rank, in the order of ranks. */
typedef struct session_mail {
    int64_t *counts; /* ranks */
    uint64_t *words;
    int64_t total;
} session_mail;

void session_mail_free(session_mail *mail);

/* Two deliveries in a row on one communicator must differ in this, or another collective call stand between them. */
typedef enum session_mail_tag { SESSION_MAIL_THERE = 1, SESSION_MAIL_BACK } session_mail_tag;

/* Brings every rank's words in out to the ranks that they are for. *in owns its memory. Messages go only to ranks that
 * get words, and one reduction tells when all have come. A rank that has failed before calls with its error in *error,
 * and its out is not looked at: then all ranks return that error. What fails on this rank in receiving is in *error
 * alone, with *in empty, for the next phase to agree on. Collective. */
insitu_status session_mail_deliver(MPI_Comm comm, session_mail_tag tag, const session_mail *out, session_mail *in,
                                   base_error *error);

/* As session_mail_deliver(), but what fails in receiving is agreed on too. Collective, agreed. */
insitu_status session_mail_exchange(MPI_Comm comm, const session_mail *out, session_mail *in, base_error *error);

/* Returns how many things a rank takes in a round in which each may be a question to every rank: at most so many, and
 * fewer the more ranks there are, so that a round's mail has a bound. The same on all ranks. */
int64_t session_mail_round(int ranks, int64_t most);

#endif
