/* Defines keys by which equal vertices are recognized, and a hash table that gives each key an index. */
#ifndef SESSION_KEYS_H
#define SESSION_KEYS_H

#include <stdbool.h>
#include <stdint.h>

/* Key of a vertex: its global id, or the bits of its three coordinates. Vertices with equal keys are treated as the
 * same vertex. */
typedef struct session_key {
    uint64_t words[3];
} session_key;

/* Mixes the bits of a 64-bit number, so that each bit of x affects all bits of the result. */
static inline uint64_t session_mix_bits(uint64_t x)
{
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

uint64_t session_key_hash(const session_key *key);

/* A hash table of keys. Keys get the indices 0, 1, ... in the order in which they are added. */
typedef struct session_key_table {
    session_key *keys; /* array of `count` keys */
    int64_t count;
    int64_t *slots; /* mask + 1 slots, each with the index of a key in `keys`; -1: the slot is empty */
    uint64_t mask;
} session_key_table;

/* Creates a table with space for `most` keys. Returns false if memory runs out; then there is nothing to free. */
bool session_keys_create(session_key_table *table, int64_t most);
/* session_keys_find() returns the index of a key, or -1 if the table does not contain the key. session_keys_add()
 * returns the index, too, but first adds the key if the table does not contain it. */
int64_t session_keys_find(const session_key_table *table, const session_key *key);
int64_t session_keys_add(session_key_table *table, const session_key *key);
void session_keys_free(session_key_table *table);

#endif
