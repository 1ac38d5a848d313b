/* Computes FNV-1a hashes. The caller initializes *hash with SESSION_HASH_BEGIN; each call then updates *hash with
 * further bytes. */
#ifndef SESSION_HASH_H
#define SESSION_HASH_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define SESSION_HASH_BEGIN 0xcbf29ce484222325u

static inline void session_hash_bytes(uint64_t *hash, const void *data, size_t size)
{
    for (size_t i = 0; i < size; i++) *hash = (*hash ^ ((const unsigned char *)data)[i]) * 0x100000001b3u;
}

/* Updates the hash with a text including its terminating NUL, so that sequences of texts that are split differently
 * have different hashes. */
static inline void session_hash_text(uint64_t *hash, const char *text)
{
    session_hash_bytes(hash, text, strlen(text) + 1);
}

#endif
