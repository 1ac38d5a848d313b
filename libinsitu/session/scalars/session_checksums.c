/* Data that depends on a scalar's values is expensive to compute. Therefore it is computed again only if a checksum of
 * the values has changed. */
#include "session_checksums.h"

#include <string.h>

#include "session_region.h"
#include "session_scalars.h"

enum { BLOCK_VALUES = 1 << 14, LANES = 4 };

static uint64_t mix_bits(uint64_t sum, uint64_t bits)
{
    const uint64_t product = (sum ^ bits) * 0x9e3779b97f4a7c15u;
    return product ^ product >> 29;
}

/* Computes the checksum of contiguous bytes as several independent sums, which a CPU computes in parallel. In a single
 * sum, each multiplication would depend on the result of the previous one. */
static uint64_t compute_checksum_of_packed_bytes(const char *data, int64_t bytes)
{
    uint64_t lanes[LANES] = {1, 2, 3, 4}, words[LANES];
    for (; bytes >= (int64_t)sizeof words; bytes -= (int64_t)sizeof words, data += sizeof words) {
        memcpy(words, data, sizeof words);
        for (int i = 0; i < LANES; i++) lanes[i] = mix_bits(lanes[i], words[i]);
    }
    memset(words, 0, sizeof words);
    memcpy(words, data, (size_t)bytes);
    for (int i = 0; i < LANES; i++) lanes[i] = mix_bits(lanes[i], words[i]);
    return mix_bits(mix_bits(lanes[0], lanes[1]), mix_bits(lanes[2], lanes[3]));
}

static uint64_t compute_checksum_of_strided_array(const char *data, int64_t stride, size_t size, int64_t count)
{
    uint64_t sum = 1;
    for (int64_t i = 0; i < count; i++) {
        uint64_t bits = 0;
        memcpy(&bits, data + i * stride, size);
        sum = mix_bits(sum, bits);
    }
    return sum;
}

static uint64_t compute_checksum_of_array(const grid_array *a, int64_t count, int threads)
{
    const int64_t size = grid_element_bytes(a), blocks = (count + BLOCK_VALUES - 1) / BLOCK_VALUES;
    uint64_t sum = 0;
#pragma omp parallel num_threads(session_choose_loop_threads(threads, count))
    {
        region_enter();
#pragma omp for schedule(static) reduction(+ : sum) nowait
        for (int64_t block = 0; block < blocks; block++) {
            const int64_t first = block * BLOCK_VALUES;
            const int64_t values = count - first < BLOCK_VALUES ? count - first : BLOCK_VALUES;
            const char *data = a->data + first * a->stride;
            const uint64_t own = a->stride == size
                                     ? compute_checksum_of_packed_bytes(data, values * size)
                                     : compute_checksum_of_strided_array(data, a->stride, (size_t)size, values);
            sum += mix_bits(own, (uint64_t)block); /* the sum does not depend on the order in which threads add
                                                      blocks */
        }
        region_leave();
    }
    return sum;
}

static uint64_t add_field_to_checksum(uint64_t sum, const session_mesh *mesh, const grid_field *field, int threads)
{
    const int64_t count = field->is_cell_centred ? mesh->cells.cell_count : session_vertex_count(mesh);
    const int first = field->component < 0 ? 0 : field->component;
    const int end = field->component < 0 ? field->component_count : first + 1;
    for (int component = first; component < end && field->values.data; component++) {
        const grid_array a = grid_field_component(field, component);
        sum = mix_bits(sum, compute_checksum_of_array(&a, count, threads));
    }
    return sum;
}

/* Returns the checksum of a scalar. If the scalar's values are means of cell values, the checksum includes the cell
 * values: if some of these become NaN, the means at their vertices may remain the same. */
static uint64_t find_checksum(const session_mesh *mesh, const session_scalar *scalar, int threads)
{
    const grid_field field = session_get_scalar_values(mesh, scalar);
    const uint64_t sum = add_field_to_checksum(0, mesh, &field, threads);
    return field.source_cells ? add_field_to_checksum(sum, mesh, field.source_cells, threads) : sum;
}

static uint64_t add_samples_to_checksum(uint64_t sum, const session_mesh *mesh, const grid_field *field)
{
    enum { SAMPLES = 64 };
    const int64_t count = field->is_cell_centred ? mesh->cells.cell_count : session_vertex_count(mesh);
    const int64_t step = count / SAMPLES + 1;
    for (int64_t i = 0; i < count && field->values.data; i += step) {
        const double value = grid_field_value(field, i);
        uint64_t bits;
        memcpy(&bits, &value, sizeof bits);
        sum = mix_bits(sum, bits);
    }
    return sum;
}

static uint64_t compute_sample_checksum(const session_mesh *mesh, const session_scalar *scalar)
{
    const grid_field field = session_get_scalar_values(mesh, scalar);
    const uint64_t sum = add_samples_to_checksum(1, mesh, &field);
    return field.source_cells ? add_samples_to_checksum(sum, mesh, field.source_cells) : sum;
}

/* Warns if the caller has changed values in place but declared them unchanged. In this case trees contain ranges of the
 * old values, while rays read the new values. */
static void warn_of_change(const session_mesh *mesh, session_scalar *scalar, session_report *report)
{
    if (session_is_distance(scalar)) return;
    const char *field = session_get_scalar_name(mesh, scalar);
    const session_warning warning = {WARNING_UNSAID, field, mesh->label, scalar->component};
    const bool has_changed = !scalar->may_have_changed && scalar->has_checksum &&
                             scalar->sample_checksum != compute_sample_checksum(mesh, scalar);
    session_warn_locally(
        report, &warning, has_changed && !mesh->source,
        "mesh \"%s\": field \"%s\" has other values than in the last picture, but was not set again, or with "
        "INSITU_CHANGED_NOTHING: set it with INSITU_CHANGED_VALUES, as such changes may be missed",
        mesh->label, field);
    scalar->may_have_changed = scalar->may_have_changed || has_changed;
}

/* Computes the checksum of the values and compares it with the checksum at the most recently drawn picture. Returns
 * whether they are equal; otherwise the data that depends on the values is marked as stale. */
static bool compare_checksum(const session_mesh *mesh, session_scalar *scalar, int threads)
{
    const uint64_t checksum = find_checksum(mesh, scalar, threads);
    scalar->may_have_changed = false;
    scalar->sample_checksum = compute_sample_checksum(mesh, scalar);
    if (scalar->has_checksum && scalar->checksum == checksum) return true;
    scalar->has_checksum = true;
    scalar->checksum = checksum;
    scalar->are_ranges_stale = true;
    scalar->version++;
    session_clear_extents(scalar);
    return false;
}

/* Compares the checksums of all fields of one part of a mesh with those at the most recently drawn picture. If the part
 * is a block, returns the number of unchanged fields, which the caller adds to the report. If the part is a whole mesh,
 * adds its unchanged fields to the report and returns 0. The fields of mirror images are not counted. */
static int64_t compare_checksums_of_part(const session_mesh *mesh, int threads, session_report *report)
{
    int64_t unchanged = 0;
    for (int k = 0; k < mesh->scalar_count && mesh->is_given; k++) {
        session_scalar *scalar = &mesh->scalars[k];
        if (!scalar->is_used || !scalar->may_have_changed || !compare_checksum(mesh, scalar, threads)) continue;
        if (mesh->source) continue;
        if (mesh->block != SESSION_WHOLE)
            unchanged++;
        else
            session_text_add(&report->left_out,
                             "mesh \"%s\": field \"%s\" has the values of the last picture: no ranges", mesh->name,
                             session_get_scalar_name(mesh, scalar));
    }
    return unchanged;
}

/* Compares the checksums of the fields of blocks; each block is processed by one thread. Returns the number of fields
 * whose values have not changed. */
static int64_t compare_checksums_of_blocks(const session_parts *parts, int threads)
{
    int64_t unchanged = 0;
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(dynamic, 4) reduction(+ : unchanged) nowait
        for (int i = 0; i < parts->count; i++) unchanged += compare_checksums_of_part(parts->items[i], 1, NULL);
        region_leave();
    }
    return unchanged;
}

static void compare_checksums_of_parts(const session_parts *parts, int threads, session_report *report)
{
    enum { PARTS_A_THREAD = 4 };
    const bool are_blocks = parts->count >= PARTS_A_THREAD * threads && parts->items[0]->block != SESSION_WHOLE;
    int64_t unchanged = 0;
    for (int i = 0; i < parts->count; i++) {
        const session_mesh *mesh = parts->items[i];
        for (int k = 0; k < mesh->scalar_count && mesh->is_given; k++)
            if (mesh->scalars[k].is_used) warn_of_change(mesh, &mesh->scalars[k], report);
    }
    if (threads > 1 && are_blocks)
        unchanged = compare_checksums_of_blocks(parts, threads);
    else
        for (int i = 0; i < parts->count; i++) unchanged += compare_checksums_of_part(parts->items[i], threads, report);
    if (unchanged)
        session_text_add(&report->left_out,
                         "mesh \"%s\": %lld fields of blocks have the values of the last picture: no ranges",
                         parts->items[0]->name, (long long)unchanged);
}

void session_find_changed_values(const session_meshes *meshes, int threads, session_report *report)
{
    for (int i = 0; i < meshes->count;) {
        const session_parts parts = session_find_parts_from_index(meshes, i);
        compare_checksums_of_parts(&parts, threads, report);
        i += parts.count;
    }
}
