/* All of the library's heap memory comes through here: 64-byte aligned, counted, and able to fail on purpose.
 *
 * The count is of the whole process (several sessions add up). Thread-safe. */
#ifndef BASE_MEMORY_H
#define BASE_MEMORY_H

#include <stddef.h>
#include <stdint.h>

/* Returns 64-byte aligned memory, or NULL. A block of 0 bytes is a pointer that may be freed. */
void *base_alloc(size_t bytes);

/* As base_alloc(), with all bytes 0. */
void *base_calloc(size_t count, size_t size);

/* base_reserve() gives room for bytes that are not counted yet, since memory that is not written to takes none.
 * base_use() says how many of them are in use and counts them. base_realloc() before base_use() keeps no contents. */
void *base_reserve(size_t bytes);
void base_use(void *block, size_t bytes);

/* Grows or shrinks a block and keeps its contents. Returns NULL on failure, and the old block stays. For a NULL block
 * it is base_alloc(). */
void *base_realloc(void *block, size_t bytes);

/* block may be NULL. */
void base_free(void *block);

/* A block that is given out piece by piece, each 64-byte aligned; begin NULL: the pieces are only counted. */
typedef struct base_carving {
    char *begin;
    size_t used;
} base_carving;

void *base_carve(base_carving *from, size_t bytes);

/* A copy of a C string, or NULL. */
char *base_strdup(const char *text);

/* Bytes held now, and the most held since base_memory_reset_peak(). */
int64_t base_memory_held(void);
int64_t base_memory_peak(void);
void base_memory_reset_peak(void);

/* For tests: let the n-th allocation from now on fail (1: the next one), then work again; 0: none. */
void base_memory_fail_nth(int64_t n);

/* Allocations made since the process began: a test compares two steps. */
int64_t base_memory_allocations(void);

#endif
