#include "memory.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

/* Each block is preceded by one cache line that holds its size, so that freed bytes can be counted. */
enum { header_bytes = 64 };

static atomic_llong held_bytes;
static atomic_llong peak_bytes;
static atomic_llong allocation_count;
static atomic_llong fail_countdown;

static void count_bytes(long long bytes)
{
    const long long held = atomic_fetch_add(&held_bytes, bytes) + bytes;
    long long peak = atomic_load(&peak_bytes);
    while (held > peak && !atomic_compare_exchange_weak(&peak_bytes, &peak, held)) {
    }
}

static int should_allocation_fail(void)
{
    atomic_fetch_add(&allocation_count, 1);
    if (atomic_load(&fail_countdown) == 0) return 0;
    return atomic_fetch_sub(&fail_countdown, 1) == 1;
}

/* Allocates a block with space for `bytes` bytes, of which `counted` are added to the count of held bytes. Even an
 * empty block has a space of 64 bytes: its address then lies within its own memory, and leak checkers recognize the
 * pointer to it. */
static void *make_block(size_t bytes, size_t counted)
{
    if (should_allocation_fail()) return NULL;
    if (bytes > SIZE_MAX - 2 * header_bytes) return NULL;
    const size_t rounded = bytes ? (bytes + header_bytes - 1) / header_bytes * header_bytes : header_bytes;
    char *raw = aligned_alloc(header_bytes, rounded + header_bytes);
    if (!raw) return NULL;
    memcpy(raw, &counted, sizeof counted);
    count_bytes((long long)counted);
    return raw + header_bytes;
}

void *base_alloc(size_t bytes)
{
    return make_block(bytes, bytes);
}

void *base_reserve(size_t bytes)
{
    return make_block(bytes, 0);
}

void *base_calloc(size_t count, size_t size)
{
    if (size && count > SIZE_MAX / size) return NULL;
    void *block = base_alloc(count * size);
    if (block) memset(block, 0, count * size);
    return block;
}

static size_t read_block_size(const void *block)
{
    size_t bytes;
    memcpy(&bytes, (const char *)block - header_bytes, sizeof bytes);
    return bytes;
}

void base_set_used_bytes(void *block, size_t bytes)
{
    count_bytes((long long)bytes - (long long)read_block_size(block));
    memcpy((char *)block - header_bytes, &bytes, sizeof bytes);
}

void *base_realloc(void *block, size_t bytes)
{
    void *grown = base_alloc(bytes);
    if (!grown || !block) return grown;
    const size_t old_bytes = read_block_size(block);
    memcpy(grown, block, old_bytes < bytes ? old_bytes : bytes);
    base_free(block);
    return grown;
}

void base_free(void *block)
{
    if (!block) return;
    count_bytes(-(long long)read_block_size(block));
    free((char *)block - header_bytes);
}

void *base_arena_alloc(base_arena *from, size_t bytes)
{
    void *p = from->begin ? from->begin + from->used : NULL;
    from->used += (bytes + 63) & ~(size_t)63;
    return p;
}

char *base_strdup(const char *text)
{
    const size_t bytes = strlen(text) + 1;
    char *copy = base_alloc(bytes);
    if (copy) memcpy(copy, text, bytes);
    return copy;
}

int64_t base_memory_held(void)
{
    return atomic_load(&held_bytes);
}
int64_t base_memory_peak(void)
{
    return atomic_load(&peak_bytes);
}
void base_memory_reset_peak(void)
{
    atomic_store(&peak_bytes, atomic_load(&held_bytes));
}
void base_memory_fail_nth(int64_t n)
{
    atomic_store(&fail_countdown, n);
}
int64_t base_memory_allocations(void)
{
    return atomic_load(&allocation_count);
}
