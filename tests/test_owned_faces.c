#include "test_owned_faces.h"

#include <stdlib.h>
#include <string.h>

#include "test_mesh_make.h"

static void find_sides(const test_mesh *part, int64_t *first, int64_t *second)
{
    for (int64_t face = 0; face < part->face_count; face++) first[face] = second[face] = -1;
    for (int64_t cell = 0; cell < part->cell_count; cell++)
        for (int64_t i = part->offsets[cell]; i < part->offsets[cell + 1]; i++) {
            const int64_t face = part->connectivity[i];
            if (first[face] < 0)
                first[face] = cell;
            else
                second[face] = cell;
        }
}

static void append_face(owned *o, const test_mesh *part, int64_t face, int64_t at, int64_t first, int64_t second)
{
    const int64_t *vertices = part->face_connectivity + part->face_offsets[face];
    const int64_t count = part->face_offsets[face + 1] - part->face_offsets[face];
    o->owner[at] = first;
    o->neighbour[at] = second;
    o->offsets[at + 1] = o->offsets[at] + count;
    memcpy(o->vertices + o->offsets[at], vertices, (size_t)count * sizeof *vertices);
}

static void make_narrow(owned *o, int64_t faces, int32_t base)
{
    for (int64_t face = 0; face < faces; face++) {
        o->pairs[2 * face] = (int32_t)o->owner[face] + base;
        o->pairs[2 * face + 1] = (int32_t)o->neighbour[face] + base;
        if (o->neighbour[face] < 0 && face % 2) o->pairs[2 * face + 1] = -1;
        o->lists[face] =
            (label_list){(int32_t)(o->offsets[face + 1] - o->offsets[face]), o->narrow_vertices + o->offsets[face]};
    }
    for (int64_t face = 0; face <= faces; face++) o->narrow_offsets[face] = (int32_t)o->offsets[face] + base;
    for (int64_t i = 0; i < o->offsets[faces]; i++) o->narrow_vertices[i] = (int32_t)o->vertices[i] + base;
}

/* Makes the arrays for FORM_APART. In the separate list of boundary faces, one more face at the end belongs to no cell
 * and has no vertices. */
static void make_separate_boundary(owned *o, int64_t cells, int32_t base)
{
    for (int64_t face = 0; face < o->middle; face++) {
        const int32_t halo = (int32_t)(cells + face % OWNED_HALO) + base, own = (int32_t)o->owner[face] + base;
        const bool is_beyond = face >= o->inner, is_first = face % 2;
        o->halo_pairs[2 * face] = is_beyond && is_first ? halo : own;
        o->halo_pairs[2 * face + 1] = !is_beyond ? (int32_t)o->neighbour[face] + base : is_first ? own : halo;
    }
    for (int64_t face = o->middle; face <= o->faces; face++)
        o->apart_offsets[face - o->middle] = (int32_t)(o->offsets[face] - o->offsets[o->middle]) + base;
    for (int64_t face = o->middle; face < o->faces; face++)
        o->apart_owner[face - o->middle] = (int32_t)o->owner[face] + base;
    o->apart_offsets[o->faces - o->middle + 1] = o->apart_offsets[o->faces - o->middle];
    o->apart_owner[o->faces - o->middle] = base - 1;
}

owned make_owned_faces(const test_mesh *part, int32_t base)
{
    const int64_t faces = part->face_count, entries = part->face_connectivity_count;
    owned o = {.owner = test_allocate(faces, sizeof(int64_t)),
               .neighbour = test_allocate(faces, sizeof(int64_t)),
               .offsets = test_allocate(faces + 1, sizeof(int64_t)),
               .vertices = test_allocate(entries, sizeof(int64_t)),
               .pairs = test_allocate(2 * faces, sizeof(int32_t)),
               .narrow_offsets = test_allocate(faces + 1, sizeof(int32_t)),
               .narrow_vertices = test_allocate(entries, sizeof(int32_t)),
               .lists = test_allocate(faces, sizeof(label_list)),
               .faces = faces,
               .halo_pairs = test_allocate(2 * faces, sizeof(int32_t)),
               .apart_offsets = test_allocate(faces + 2, sizeof(int32_t)),
               .apart_owner = test_allocate(faces + 1, sizeof(int32_t))};
    int64_t *first = test_allocate(faces, sizeof *first), *second = test_allocate(faces, sizeof *second), at = 0;
    find_sides(part, first, second);
    for (int64_t face = 0; face < faces; face++)
        if (second[face] >= 0) append_face(&o, part, face, at++, first[face], second[face]);
    o.inner = at;
    for (int64_t face = 0; face < faces; face++)
        if (second[face] < 0) append_face(&o, part, face, at++, first[face], second[face]);
    o.middle = o.inner + (faces - o.inner) / 3;
    make_narrow(&o, faces, base);
    make_separate_boundary(&o, part->cell_count, base);
    free(first);
    free(second);
    return o;
}

void free_owned_faces(owned *o)
{
    void *const arrays[] = {o->owner,      o->neighbour,      o->offsets,         o->vertices,
                            o->pairs,      o->narrow_offsets, o->narrow_vertices, o->lists,
                            o->halo_pairs, o->apart_offsets,  o->apart_owner};
    for (size_t i = 0; i < sizeof arrays / sizeof arrays[0]; i++) free(arrays[i]);
    *o = (owned){0};
}

static void describe_separate_boundary(const owned *o, int base, insitu_mesh *mesh)
{
    const int64_t pair = 2 * sizeof(int32_t), first = o->offsets[o->middle];
    mesh->face_count = mesh->neighbour_count = o->middle;
    mesh->face_connectivity_count = first;
    mesh->owner = (insitu_array){o->halo_pairs, INSITU_INT32, pair};
    mesh->neighbour = (insitu_array){o->halo_pairs + 1, INSITU_INT32, pair};
    mesh->halo_cell_count = OWNED_HALO;
    mesh->boundary_face_count = o->faces - o->middle + 1;
    mesh->boundary_face_offsets = (insitu_array){o->apart_offsets, INSITU_INT32, 0};
    mesh->boundary_face_connectivity_count = o->offsets[o->faces] - first;
    mesh->boundary_face_connectivity = (insitu_array){o->narrow_vertices + first, INSITU_INT32, 0};
    mesh->boundary_owner = (insitu_array){o->apart_owner, INSITU_INT32, 0};
    mesh->index_base = base;
}

void describe_owned_faces(const owned *o, form which, int base, insitu_mesh *mesh)
{
    const int64_t pair = 2 * sizeof(int32_t);
    mesh->cell_type = INSITU_POLYHEDRON;
    mesh->cell_types = mesh->offsets = mesh->connectivity = (insitu_array){0};
    mesh->connectivity_count = 0;
    mesh->neighbour_count = which == FORM_WIDE ? o->inner : mesh->face_count;
    mesh->owner = (insitu_array){o->pairs, INSITU_INT32, pair};
    mesh->neighbour = (insitu_array){o->pairs + 1, INSITU_INT32, pair};
    mesh->face_offsets = (insitu_array){o->narrow_offsets, INSITU_INT32, 0};
    mesh->face_connectivity = (insitu_array){o->narrow_vertices, INSITU_INT32, 0};
    mesh->index_base = base;
    if (which == FORM_WIDE) {
        mesh->owner = (insitu_array){o->owner, INSITU_INT64, 0};
        mesh->neighbour = (insitu_array){o->neighbour, INSITU_INT64, 0};
        mesh->face_offsets = (insitu_array){o->offsets, INSITU_INT64, 0};
        mesh->face_connectivity = (insitu_array){o->vertices, INSITU_INT64, 0};
        mesh->index_base = 0;
    }
    if (which == FORM_APART) describe_separate_boundary(o, base, mesh);
    if (which != FORM_LISTS) return;
    mesh->face_connectivity_count = 0;
    mesh->face_offsets = mesh->face_connectivity = (insitu_array){0};
    mesh->face_sizes = (insitu_array){&o->lists->size, INSITU_INT32, sizeof(label_list)};
    mesh->face_lists = (insitu_array){&o->lists->labels, INSITU_INT32, sizeof(label_list)};
}
