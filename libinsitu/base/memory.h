/* Allocates all of the library's heap memory: 64-byte aligned, counted, and with simulated failures for tests.
 *
 * The counts are those of the whole process (several sessions are added up). Thread-safe. */
#ifndef BASE_MEMORY_H
#define BASE_MEMORY_H

#include <stddef.h>
#include <stdint.h>

/* Returns 64-byte aligned memory, or NULL on failure. For 0 bytes it returns a pointer that may be freed. */
void *base_alloc(size_t bytes);

/* Returns memory for count × size bytes, all 0, aligned to 64 bytes; NULL on failure. */
void *base_calloc(size_t count, size_t size);

/* base_reserve() allocates a block without counting its bytes, because memory that has not been written to takes no
 * physical memory. base_set_used_bytes() then sets how many of its bytes are in use, and counts them. Before this call,
 * base_realloc() does not keep the contents of the block. */
void *base_reserve(size_t bytes);
void base_set_used_bytes(void *block, size_t bytes);

/* Grows or shrinks a block and keeps its contents. Returns NULL on failure, and the old block remains valid. A NULL
 * block is allocated as by base_alloc(). */
void *base_realloc(void *block, size_t bytes);

/* Frees a block from these functions; NULL is allowed. */
void base_free(void *block);

/* Divides a block into pieces that are aligned to 64 bytes. If `begin` is NULL, only the total size of the pieces is
 * computed. */
typedef struct base_arena {
    char *begin; /* start of the block; NULL: only sizes are added up */
    size_t used; /* number of bytes of all pieces so far */
} base_arena;

void *base_arena_alloc(base_arena *from, size_t bytes);

/* Returns a copy of a C string, or NULL on failure. */
char *base_strdup(const char *text);

/* base_memory_held() returns the number of bytes that are allocated now, base_memory_peak() their maximum since the
 * last base_memory_reset_peak(). */
int64_t base_memory_held(void);
int64_t base_memory_peak(void);
void base_memory_reset_peak(void);

/* For tests: makes the n-th allocation from this call on fail (1: the next one); later allocations succeed. 0: no
 * allocation fails. */
void base_memory_fail_nth(int64_t n);

/* Returns the number of allocations since the process began. A test compares it between two steps. */
int64_t base_memory_allocations(void);

#endif
