/* A hash map from ids (>= 0) to local indices. The map uses open addressing, and grows when it is two thirds full. */
#ifndef WAVE_MAP_H
#define WAVE_MAP_H

#include <stdbool.h>
#include <stdint.h>

typedef struct wave_map {
    int64_t *keys; /* keys of the entries; -1 if the entry is free */
    int32_t *values;
    int64_t capacity, count;
} wave_map;

/* Returns the value of the key, or -1 if it is not in the map. */
int32_t wave_map_find(const wave_map *map, int64_t key);

/* Returns the value of the key. If the key is not in the map, inserts it with `value` and returns `value`. Returns -1
 * if memory ran out. */
int32_t wave_map_insert(wave_map *map, int64_t key, int32_t value);

void wave_map_free(wave_map *map);

#endif
