/* A map from ids (>= 0) to local numbers: open addressing, grown at two thirds. */
#ifndef WAVE_MAP_H
#define WAVE_MAP_H

#include <stdbool.h>
#include <stdint.h>

typedef struct wave_map {
    int64_t *keys; /* -1: free */
    int32_t *values;
    int64_t capacity, count;
} wave_map;

/* Value of key, or -1. */
int32_t wave_map_find(const wave_map *map, int64_t key);

/* Value of key; where it had none, this value is put there. -1 where memory ran out. */
int32_t wave_map_insert(wave_map *map, int64_t key, int32_t value);

void wave_map_free(wave_map *map);

#endif
