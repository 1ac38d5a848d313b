#include "blueprint_hash.h"

#include <stdbool.h>
#include <string.h>

#include "blueprint_node.h"

enum { LANES = 4 };

uint64_t blueprint_mix_hash(uint64_t hash, uint64_t bits)
{
    const uint64_t product = (hash ^ bits) * 0x9e3779b97f4a7c15u;
    return product ^ product >> 29;
}

uint64_t blueprint_hash_text(const char *text)
{
    uint64_t hash = 14695981039346656037u;
    for (const char *c = text; *c; c++) hash = (hash ^ (unsigned char)*c) * 1099511628211u;
    return hash;
}

/* Hashes contiguous bytes in several independent lanes. A multiplication must wait for the previous one of the same
 * lane only, so that the processor computes all lanes at the same time. */
static uint64_t hash_bytes(const char *data, int64_t bytes)
{
    uint64_t lanes[LANES] = {1, 2, 3, 4}, words[LANES];
    for (; bytes >= (int64_t)sizeof words; bytes -= (int64_t)sizeof words, data += sizeof words) {
        memcpy(words, data, sizeof words);
        for (int i = 0; i < LANES; i++) lanes[i] = blueprint_mix_hash(lanes[i], words[i]);
    }
    memset(words, 0, sizeof words);
    if (bytes > 0) memcpy(words, data, (size_t)bytes);
    for (int i = 0; i < LANES; i++) lanes[i] = blueprint_mix_hash(lanes[i], words[i]);
    return blueprint_mix_hash(blueprint_mix_hash(lanes[0], lanes[1]), blueprint_mix_hash(lanes[2], lanes[3]));
}

/* Hashes `count` elements of `size` bytes that are `stride` bytes apart, in several independent lanes like
 * hash_bytes(). The function is inlined, so that the size is a constant. */
static inline uint64_t hash_elements(const char *data, int64_t count, int64_t stride, size_t size)
{
    uint64_t lanes[LANES] = {1, 2, 3, 4}, bits[LANES] = {0};
    int64_t i = 0;
    for (; i + LANES <= count; i += LANES) {
        for (int k = 0; k < LANES; k++) memcpy(&bits[k], data + (i + k) * stride, size);
        for (int k = 0; k < LANES; k++) lanes[k] = blueprint_mix_hash(lanes[k], bits[k]);
    }
    for (; i < count; i++) {
        memcpy(&bits[0], data + i * stride, size);
        lanes[0] = blueprint_mix_hash(lanes[0], bits[0]);
    }
    return blueprint_mix_hash(blueprint_mix_hash(lanes[0], lanes[1]), blueprint_mix_hash(lanes[2], lanes[3]));
}

static uint64_t hash_array(uint64_t sum, const insitu_array *array, int64_t count)
{
    if (!array->data) return blueprint_mix_hash(sum, 0);
    const char *data = array->data;
    const int64_t size = node_type_bytes(array->type), stride = array->stride_bytes ? array->stride_bytes : size;
    sum = blueprint_mix_hash(blueprint_mix_hash(sum, (uint64_t)count), (uint64_t)array->type);
    if (stride == size) return blueprint_mix_hash(sum, hash_bytes(data, count * size));
    switch (size) {
    case 1: return blueprint_mix_hash(sum, hash_elements(data, count, stride, 1));
    case 2: return blueprint_mix_hash(sum, hash_elements(data, count, stride, 2));
    case 4: return blueprint_mix_hash(sum, hash_elements(data, count, stride, 4));
    default: return blueprint_mix_hash(sum, hash_elements(data, count, stride, 8));
    }
}

/* Checks whether the coordinates are stored as x y z x y z ... without gaps. */
static bool are_interleaved(const insitu_array coordinates[3])
{
    const int64_t size = node_type_bytes(coordinates[0].type);
    bool are = coordinates[0].data != NULL;
    for (int axis = 0; axis < 3 && are; axis++)
        are = coordinates[axis].data == (const char *)coordinates[0].data + axis * size &&
              coordinates[axis].type == coordinates[0].type && coordinates[axis].stride_bytes == 3 * size;
    return are;
}

uint64_t blueprint_hash_coordinates(const insitu_mesh *mesh)
{
    const insitu_array *c = mesh->coordinates;
    uint64_t sum = 1;
    if (are_interleaved(c))
        sum = hash_bytes(c[0].data, 3 * mesh->vertex_count * node_type_bytes(c[0].type));
    else
        for (int axis = 0; axis < 3; axis++) sum = hash_array(sum, &c[axis], mesh->vertex_count);
    for (int axis = 0; axis < 3 && mesh->lattice; axis++) {
        uint64_t bits[2];
        memcpy(&bits[0], &mesh->lattice->origin[axis], sizeof bits[0]);
        memcpy(&bits[1], &mesh->lattice->spacing[axis], sizeof bits[1]);
        sum = blueprint_mix_hash(blueprint_mix_hash(sum, bits[0]), bits[1]);
        sum = hash_array(sum, &mesh->lattice->axes[axis], mesh->lattice->cells[axis] + 1);
    }
    return sum;
}

uint64_t blueprint_hash_cells(const insitu_mesh *mesh)
{
    uint64_t sum = blueprint_mix_hash(1, (uint64_t)mesh->cell_type);
    sum = hash_array(sum, &mesh->cell_types, mesh->cell_count);
    sum = hash_array(sum, &mesh->connectivity, mesh->connectivity_count);
    sum = hash_array(sum, &mesh->offsets, mesh->cell_count);
    sum = hash_array(sum, &mesh->face_offsets, mesh->face_count);
    sum = hash_array(sum, &mesh->face_connectivity, mesh->face_connectivity_count);
    return hash_array(sum, &mesh->ghosts, mesh->cell_count);
}
