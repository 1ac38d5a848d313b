/* The mesh is computed from global ids, which are the same on every rank; the solver's arrays need small local
 * indices. */
#include "wave_map.h"

#include <stdlib.h>

#include "wave_lattice.h"

static int64_t find_map_slot(const wave_map *map, int64_t key)
{
    int64_t mask = map->capacity - 1;
    int64_t at = (int64_t)wave_hash((uint64_t)key) & mask;
    while (map->keys[at] != -1 && map->keys[at] != key) at = (at + 1) & mask;
    return at;
}

int32_t wave_map_find(const wave_map *map, int64_t key)
{
    if (map->capacity == 0) return -1;
    int64_t at = find_map_slot(map, key);
    return map->keys[at] == key ? map->values[at] : -1;
}

static bool grow_map(wave_map *map)
{
    wave_map larger = {.capacity = map->capacity ? 2 * map->capacity : 64, .count = map->count};
    larger.keys = malloc((size_t)larger.capacity * sizeof *larger.keys);
    larger.values = malloc((size_t)larger.capacity * sizeof *larger.values);
    if (!larger.keys || !larger.values) {
        wave_map_free(&larger);
        return false;
    }
    for (int64_t i = 0; i < larger.capacity; ++i) larger.keys[i] = -1;
    for (int64_t i = 0; i < map->capacity; ++i) {
        if (map->keys[i] == -1) continue;
        int64_t at = find_map_slot(&larger, map->keys[i]);
        larger.keys[at] = map->keys[i];
        larger.values[at] = map->values[i];
    }
    wave_map_free(map);
    *map = larger;
    return true;
}

int32_t wave_map_insert(wave_map *map, int64_t key, int32_t value)
{
    if (3 * map->count >= 2 * map->capacity && !grow_map(map)) return -1;
    int64_t at = find_map_slot(map, key);
    if (map->keys[at] == key) return map->values[at];
    map->keys[at] = key;
    map->values[at] = value;
    map->count++;
    return value;
}

void wave_map_free(wave_map *map)
{
    free(map->keys);
    free(map->values);
    *map = (wave_map){0};
}
