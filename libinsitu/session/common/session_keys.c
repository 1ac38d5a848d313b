#include "session_keys.h"

#include <string.h>

#include "memory.h"

uint64_t session_key_hash(const session_key *key)
{
    return session_mix_bits(key->words[0] ^ session_mix_bits(key->words[1] ^ session_mix_bits(key->words[2])));
}

bool session_keys_create(session_key_table *table, int64_t most)
{
    uint64_t slots = 16;
    while (slots < 2 * (uint64_t)most) slots *= 2;
    *table = (session_key_table){.mask = slots - 1};
    table->keys = base_alloc((size_t)most * sizeof *table->keys);
    table->slots = base_alloc(slots * sizeof *table->slots);
    if (!table->keys || !table->slots) {
        session_keys_free(table);
        return false;
    }
    memset(table->slots, 0xff, slots * sizeof *table->slots);
    return true;
}

int64_t session_keys_find(const session_key_table *table, const session_key *key)
{
    uint64_t slot = session_key_hash(key) & table->mask;
    for (; table->slots[slot] >= 0; slot = (slot + 1) & table->mask)
        if (memcmp(&table->keys[table->slots[slot]], key, sizeof *key) == 0) return table->slots[slot];
    return -1;
}

int64_t session_keys_add(session_key_table *table, const session_key *key)
{
    uint64_t slot = session_key_hash(key) & table->mask;
    for (; table->slots[slot] >= 0; slot = (slot + 1) & table->mask)
        if (memcmp(&table->keys[table->slots[slot]], key, sizeof *key) == 0) return table->slots[slot];
    table->keys[table->count] = *key;
    return table->slots[slot] = table->count++;
}

void session_keys_free(session_key_table *table)
{
    base_free(table->keys);
    base_free(table->slots);
    *table = (session_key_table){0};
}
