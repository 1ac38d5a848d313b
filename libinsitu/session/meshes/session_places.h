/* Coordinates of vertices that the session computes in place of the caller's. Those of a vertex stand side by side:
 * loops that read coordinates are fastest if all three have one stride. */
#ifndef SESSION_PLACES_H
#define SESSION_PLACES_H

#include <string.h>

#include "session_mesh.h"

/* Provides memory for the coordinates of `count` vertices along the axes whose bits are set in `axes`, in these types,
 * and describes them in coordinates; the others get no data. The memory, *places, is kept if it is already that of the
 * same axes and types, for which the count must be the same. *is_new is set otherwise. *bytes receives its size.
 * Returns false if memory runs out; then there is none, and no coordinates have data. Local. */
bool session_reserve_places(char **places, insitu_array coordinates[3], int64_t count, int axes,
                            const insitu_type types[3], int64_t *bytes, bool *is_new);

/* Stores a number in an array of places. Returns whether it differs from the one that was there. */
static inline bool session_store_place(const insitu_array *array, int64_t vertex, double number)
{
    char *to = (char *)(uintptr_t)array->data + vertex * array->stride_bytes;
    if (array->type == INSITU_FLOAT64) {
        const bool differs = memcmp(to, &number, sizeof number) != 0;
        memcpy(to, &number, sizeof number);
        return differs;
    }
    const float narrow = (float)number;
    const bool differs = memcmp(to, &narrow, sizeof narrow) != 0;
    memcpy(to, &narrow, sizeof narrow);
    return differs;
}

#endif
