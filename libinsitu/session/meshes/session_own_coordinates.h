/* Allocates the vertex coordinates that the session computes and that replace the caller's. The three coordinates of a
 * vertex are interleaved, because loops that read coordinates are fastest if all three have one stride. */
#ifndef SESSION_OWN_COORDINATES_H
#define SESSION_OWN_COORDINATES_H

#include <string.h>

#include "session_mesh.h"

/* Allocates memory for the coordinates of `count` vertices, in these types, along the axes whose bits are set in
 * `axes`, and makes `coordinates` refer to it; coordinates along other axes get no data. If *memory already holds
 * coordinates along the same axes with the same types, it is reused; the count must then be the same too. Otherwise new
 * memory is allocated and *is_new is set. *bytes receives its size. Returns false if memory runs out; then *memory is
 * NULL and no coordinates have data. Local. */
bool session_reserve_coordinates(char **memory, insitu_array coordinates[3], int64_t count, int axes,
                                 const insitu_type types[3], int64_t *bytes, bool *is_new);

/* Stores a vertex's coordinate in the array. Returns whether it differs from the value that the array held before. */
static inline bool session_store_coordinate(const insitu_array *array, int64_t vertex, double number)
{
    char *to = (char *)(uintptr_t)array->data + vertex * array->stride_bytes;
    if (array->type == INSITU_FLOAT64) {
        /* NOLINTNEXTLINE(bugprone-suspicious-memory-comparison): -0 and 0, and two NaNs, are compared by their bits */
        const bool differs = memcmp(to, &number, sizeof number) != 0;
        memcpy(to, &number, sizeof number);
        return differs;
    }
    const float narrow = (float)number;
    /* NOLINTNEXTLINE(bugprone-suspicious-memory-comparison): -0 and 0, and two NaNs, are compared by their bits */
    const bool differs = memcmp(to, &narrow, sizeof narrow) != 0;
    memcpy(to, &narrow, sizeof narrow);
    return differs;
}

#endif
