#include "test_blueprint_layouts.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- arrays ------------------------------------------------------------------------------------------------------ */

static void *allocate_for_case(layout_case *l, int64_t count, size_t size)
{
    void *made = calloc((size_t)count + 1, size);
    if (!made || l->array_count == LAYOUT_ARRAYS) abort();
    l->arrays[l->array_count++] = made;
    return made;
}

/* Returns a copy of the integers, converted to the type `id`. */
static void *convert_integers(layout_case *l, const int64_t *from, int64_t count, int id)
{
    char *made = allocate_for_case(l, count, (size_t)stand_in_size(id));
    for (int64_t i = 0; i < count; i++) {
        const int8_t i8 = (int8_t)from[i];
        const int16_t i16 = (int16_t)from[i];
        const int32_t i32 = (int32_t)from[i];
        switch (stand_in_size(id)) {
        case 1: memcpy(made + i, &i8, 1); break;
        case 2: memcpy(made + 2 * i, &i16, 2); break;
        case 4: memcpy(made + 4 * i, &i32, 4); break;
        default: memcpy(made + 8 * i, &from[i], 8);
        }
    }
    return made;
}

static void store_integers(layout_case *l, const char *path, int id, const int64_t *from, int64_t count)
{
    stand_in_set_array(l->node, path, id, convert_integers(l, from, count, id), count, 0);
}

static double braid_field(const double p[3])
{
    return 0.3 * p[0] * sin(0.2 * p[1]) + 0.4 * p[2] - 0.02 * p[0] * p[1];
}

/* ---- fields ------------------------------------------------------------------------------------------------------ */

static insitu_field *add_field(layout_case *l, const char *name, insitu_centring centring, int64_t count,
                               int components, const double *values)
{
    insitu_field *f = &l->fields[l->field_count++];
    insitu_field_defaults(f);
    f->name = name;
    f->centring = centring;
    f->count = count;
    f->component_count = components;
    f->values = (insitu_array){values, INSITU_FLOAT64, 0};
    return f;
}

static void store_field_header(layout_case *l, const char *name, const char *association)
{
    char path[256];
    snprintf(path, sizeof path, "fields/%s/association", name);
    conduit_node_set_path_char8_str(l->node, path, association);
    snprintf(path, sizeof path, "fields/%s/topology", name);
    conduit_node_set_path_char8_str(l->node, path, "mesh");
}

/* Adds the fields braid, radial and vel. In the node, each component of vel has its own allocation. positions: vertices
 * × 3. */
static void add_fields(layout_case *l, const double *positions, int64_t vertices, int64_t cells)
{
    static const char *const parts[3] = {"fields/vel/values/u", "fields/vel/values/v", "fields/vel/values/w"};
    double *f = allocate_for_case(l, vertices, sizeof *f), *r = allocate_for_case(l, cells, sizeof *r),
           *v = allocate_for_case(l, 3 * vertices, sizeof *v);
    for (int64_t i = 0; i < vertices; i++) f[i] = braid_field(positions + 3 * i);
    for (int64_t i = 0; i < cells; i++) r[i] = (double)((i * 7 + own_rank) % 5);
    store_field_header(l, "braid", "vertex");
    store_field_header(l, "radial", "element");
    store_field_header(l, "vel", "vertex");
    stand_in_set_array(l->node, "fields/braid/values", STAND_IN_FLOAT64, f, vertices, 0);
    stand_in_set_array(l->node, "fields/radial/values", STAND_IN_FLOAT64, r, cells, 0);
    for (int c = 0; c < 3; c++) {
        double *one = allocate_for_case(l, vertices, sizeof *one);
        for (int64_t i = 0; i < vertices; i++) v[3 * i + c] = one[i] = positions[3 * i + c] * (double)(i % 4);
        stand_in_set_array(l->node, parts[c], STAND_IN_FLOAT64, one, vertices, 0);
    }
    add_field(l, "braid", INSITU_VERTEX, vertices, 1, f);
    add_field(l, "radial", INSITU_CELL, cells, 1, r);
    add_field(l, "vel", INSITU_VERTEX, vertices, 3, v);
}

static void store_topology(layout_case *l, const char *type, const char *of_coordset)
{
    conduit_node_set_path_float64(l->node, "state/time", 3.1415);
    conduit_node_set_path_int64(l->node, "state/cycle", 100);
    conduit_node_set_path_char8_str(l->node, "coordsets/coords/type", of_coordset);
    conduit_node_set_path_char8_str(l->node, "topologies/mesh/type", type);
    conduit_node_set_path_char8_str(l->node, "topologies/mesh/coordset", "coords");
}

/* Stores interleaved coordinates in the node and in the public header's mesh. They are two-dimensional if has_z is
 * false. */
static void store_coordinates(layout_case *l, const double *positions, int64_t vertices, bool has_z)
{
    static const char *const paths[3] = {"coordsets/coords/values/x", "coordsets/coords/values/y",
                                         "coordsets/coords/values/z"};
    l->mesh.vertex_count = vertices;
    insitu_mesh_interleaved(&l->mesh, positions, INSITU_FLOAT64);
    if (!has_z) l->mesh.coordinates[2] = (insitu_array){0};
    for (int axis = 0; axis < (has_z ? 3 : 2); axis++)
        stand_in_set_array(l->node, paths[axis], STAND_IN_FLOAT64, positions + axis, vertices,
                           3 * (int64_t)sizeof(double));
}

/* ---- lattices ---------------------------------------------------------------------------------------------------- */

static double *make_grid_positions(layout_case *l, const int64_t counts[3])
{
    double *out = allocate_for_case(l, 3 * counts[0] * counts[1] * counts[2], sizeof *out), *p = out;
    for (int64_t k = 0; k < counts[2]; k++)
        for (int64_t j = 0; j < counts[1]; j++)
            for (int64_t i = 0; i < counts[0]; i++, p += 3) {
                p[0] = 20 * own_rank - 10 + 20.0 / (double)(counts[0] - 1) * (double)i;
                p[1] = -10 + 20.0 / (double)(counts[1] - 1) * (double)j;
                p[2] = counts[2] == 1 ? 0 : -10 + 20.0 / (double)(counts[2] - 1) * (double)k;
            }
    return out;
}

static void make_hex_cells(layout_case *l, const int64_t counts[3])
{
    l->mesh.lattice = &l->lattice;
    l->mesh.vertex_count = l->mesh.cell_count = 1;
    for (int axis = 0; axis < 3; axis++) {
        l->lattice.cells[axis] = counts[axis] - 1;
        l->mesh.vertex_count *= counts[axis];
        l->mesh.cell_count *= counts[axis] > 1 ? counts[axis] - 1 : 1;
    }
}

/* Makes a uniform grid. first: index of the block's first vertex along x in the whole mesh; the node states this index
 * as elements/origin. */
static void make_uniform_grid(layout_case *l, int dimensions, int64_t first)
{
    static const char *const paths[4][3] = {
        {"coordsets/coords/dims/i", "coordsets/coords/dims/j", "coordsets/coords/dims/k"},
        {"coordsets/coords/origin/x", "coordsets/coords/origin/y", "coordsets/coords/origin/z"},
        {"coordsets/coords/spacing/dx", "coordsets/coords/spacing/dy", "coordsets/coords/spacing/dz"},
        {"topologies/mesh/elements/origin/i", "topologies/mesh/elements/origin/j",
         "topologies/mesh/elements/origin/k"}};
    const int64_t counts[3] = {5, 4, dimensions == 3 ? 3 : 1};
    const double *positions = make_grid_positions(l, counts);
    store_topology(l, "uniform", "uniform");
    make_hex_cells(l, counts);
    for (int axis = 0; axis < dimensions; axis++) {
        const double origin = positions[axis], spacing = 20.0 / (double)(counts[axis] - 1);
        conduit_node_set_path_int64(l->node, paths[0][axis], counts[axis]);
        conduit_node_set_path_float64(l->node, paths[1][axis], origin);
        conduit_node_set_path_float64(l->node, paths[2][axis], spacing);
        if (first) conduit_node_set_path_int64(l->node, paths[3][axis], first);
        l->lattice.origin[axis] = origin - spacing * (double)first;
        l->lattice.spacing[axis] = spacing;
        l->lattice.first[axis] = first;
    }
    add_fields(l, positions, l->mesh.vertex_count, l->mesh.cell_count);
}

static void make_uniform(layout_case *l)
{
    make_uniform_grid(l, 3, 0);
}

static void make_uniform_2d(layout_case *l)
{
    make_uniform_grid(l, 2, 0);
}

static void make_uniform_block(layout_case *l)
{
    make_uniform_grid(l, 3, 4 * own_rank + 8);
}

static void make_rectilinear_grid(layout_case *l, int dimensions, int id)
{
    static const char *const paths[3] = {"coordsets/coords/values/x", "coordsets/coords/values/y",
                                         "coordsets/coords/values/z"};
    const int64_t counts[3] = {5, 4, dimensions == 3 ? 3 : 1};
    int64_t strides[3] = {1, counts[0], counts[0] * counts[1]};
    double *positions = make_grid_positions(l, counts);
    store_topology(l, "rectilinear", "rectilinear");
    make_hex_cells(l, counts);
    for (int axis = 0; axis < dimensions; axis++) {
        double *at = allocate_for_case(l, counts[axis], sizeof *at);
        int32_t *whole = allocate_for_case(l, counts[axis], sizeof *whole);
        for (int64_t i = 0; i < counts[axis]; i++) {
            whole[i] = (int32_t)(positions[3 * i * strides[axis] + axis] + (double)(i * i % 3));
            at[i] = whole[i];
        }
        stand_in_set_array(l->node, paths[axis], id, id == STAND_IN_INT32 ? (void *)whole : (void *)at, counts[axis],
                           0);
        l->lattice.axes[axis] = (insitu_array){at, INSITU_FLOAT64, 0};
    }
    add_fields(l, positions, l->mesh.vertex_count, l->mesh.cell_count);
}

static void make_rectilinear(layout_case *l)
{
    make_rectilinear_grid(l, 3, STAND_IN_FLOAT64);
}

static void make_rectilinear_2d(layout_case *l)
{
    make_rectilinear_grid(l, 2, STAND_IN_FLOAT64);
}

static void make_rectilinear_integers(layout_case *l)
{
    make_rectilinear_grid(l, 3, STAND_IN_INT32);
}

static void bend_positions(double *positions, int64_t count)
{
    for (int64_t i = 0; i < count; i++) positions[3 * i + 1] += 0.7 * sin(0.3 * positions[3 * i]);
}

static void make_structured_grid(layout_case *l, int dimensions, bool has_z)
{
    static const char *const dims[3] = {"topologies/mesh/elements/dims/i", "topologies/mesh/elements/dims/j",
                                        "topologies/mesh/elements/dims/k"};
    const int64_t counts[3] = {5, 4, dimensions == 3 ? 3 : 1};
    double *positions = make_grid_positions(l, counts);
    bend_positions(positions, counts[0] * counts[1] * counts[2]);
    store_topology(l, "structured", "explicit");
    make_hex_cells(l, counts);
    store_coordinates(l, positions, l->mesh.vertex_count, has_z);
    for (int axis = 0; axis < dimensions; axis++) conduit_node_set_path_int64(l->node, dims[axis], counts[axis] - 1);
    add_fields(l, positions, l->mesh.vertex_count, l->mesh.cell_count);
}

static void make_structured(layout_case *l)
{
    make_structured_grid(l, 3, true);
}

static void make_structured_2d(layout_case *l)
{
    make_structured_grid(l, 2, false);
}

static void make_structured_shell(layout_case *l)
{
    make_structured_grid(l, 2, true);
}

/* Stores the values of a field in a padded array. Elements outside the block are NaN. */
static void store_padded_values(layout_case *l, int field, const int64_t counts[3], const int64_t offsets[3],
                                const int64_t strides[3], int64_t length)
{
    char path[256];
    const insitu_field *f = &l->fields[field];
    double *padded = allocate_for_case(l, length, sizeof *padded);
    const double *packed = f->values.data;
    for (int64_t i = 0; i < length; i++) padded[i] = NAN;
    for (int64_t k = 0; k < counts[2]; k++)
        for (int64_t j = 0; j < counts[1]; j++)
            for (int64_t i = 0; i < counts[0]; i++)
                padded[(i + offsets[0]) * strides[0] + (j + offsets[1]) * strides[1] + (k + offsets[2]) * strides[2]] =
                    *packed++;
    snprintf(path, sizeof path, "fields/%s/values", f->name);
    stand_in_set_array(l->node, path, STAND_IN_FLOAT64, padded, length, 0);
    snprintf(path, sizeof path, "fields/%s/offsets", f->name);
    store_integers(l, path, STAND_IN_INT64, offsets, 3);
    snprintf(path, sizeof path, "fields/%s/strides", f->name);
    store_integers(l, path, STAND_IN_INT64, strides, 3);
}

/* Makes a strided block: it is a part of an array of 8 x 7 x 6 vertices in which i varies fastest, and of an array of
 * cells in which k varies fastest. Coordinates outside the block are set too. */
static void make_strided(layout_case *l)
{
    const int64_t counts[3] = {5, 4, 3}, cells[3] = {4, 3, 2}, offsets[3] = {2, 1, 2}, strides[3] = {1, 8, 56};
    const int64_t cell_offsets[3] = {1, 1, 0}, cell_strides[3] = {20, 4, 1};
    const int64_t length = 8 * 7 * 6;
    static const char *const paths[3] = {"coordsets/coords/values/x", "coordsets/coords/values/y",
                                         "coordsets/coords/values/z"};
    make_structured(l);
    const double *positions = l->mesh.coordinates[0].data;
    for (int axis = 0; axis < 3; axis++) {
        double *padded = allocate_for_case(l, length, sizeof *padded);
        for (int64_t i = 0; i < length; i++) padded[i] = NAN;
        for (int64_t v = 0; v < 60; v++) {
            const int64_t i = v % 5, j = v / 5 % 4, k = v / 20;
            padded[(i + offsets[0]) + (j + offsets[1]) * 8 + (k + offsets[2]) * 56] = positions[3 * v + axis];
        }
        stand_in_set_array(l->node, paths[axis], STAND_IN_FLOAT64, padded, length, 0);
    }
    store_integers(l, "topologies/mesh/elements/dims/offsets", STAND_IN_INT32, offsets, 3);
    store_integers(l, "topologies/mesh/elements/dims/strides", STAND_IN_INT32, strides, 3);
    store_padded_values(l, 0, counts, offsets, strides, length);
    store_padded_values(l, 1, cells, cell_offsets, cell_strides, 5 * 5 * 4);
    stand_in_remove(l->node, "fields/vel");
    l->field_count = 2;
}

/* ---- unstructured in two dimensions ------------------------------------------------------------------------------ */

/* Lists the cells of a plane of 12 quads. If has_triangles and has_quads are both set, every second quad is split into
 * two triangles; if only has_triangles is set, every quad is. Stores the sizes and types of cells as the layout
 * requires. Returns the number of cells. */
static int64_t list_plane(layout_case *l, bool has_triangles, bool has_quads, int64_t *connectivity, int64_t *sizes,
                          int64_t *types)
{
    int64_t cells = 0, entries = 0;
    for (int64_t q = 0; q < 12; q++) {
        const int64_t v = q % 4 + q / 4 * 5, corners[4] = {v, v + 1, v + 6, v + 5};
        const bool is_cut = has_triangles && (!has_quads || q % 2);
        for (int part = 0; part < (is_cut ? 2 : 1); part++) {
            sizes[cells] = is_cut ? 3 : 4;
            types[cells++] = is_cut ? INSITU_TRIANGLE : INSITU_QUAD;
            for (int c = 0; c < (is_cut ? 3 : 4); c++)
                connectivity[entries++] = is_cut ? corners[(2 * part + c) % 4] : corners[c];
        }
    }
    l->mesh.cell_count = cells;
    return entries;
}

static int64_t *sum_sizes(layout_case *l, const int64_t *sizes, int64_t count)
{
    int64_t *offsets = allocate_for_case(l, count + 1, sizeof *offsets);
    for (int64_t i = 0; i < count; i++) offsets[i + 1] = offsets[i] + sizes[i];
    return offsets;
}

static void make_plane(layout_case *l, const char *shape, bool has_triangles, bool has_quads, int id)
{
    const int64_t counts[3] = {5, 4, 1};
    int64_t *connectivity = allocate_for_case(l, 96, sizeof(int64_t)),
            *sizes = allocate_for_case(l, 24, sizeof(int64_t));
    int64_t *types = allocate_for_case(l, 24, sizeof(int64_t));
    double *positions = make_grid_positions(l, counts);
    bend_positions(positions, 20);
    store_topology(l, "unstructured", "explicit");
    store_coordinates(l, positions, 20, false);
    const int64_t entries = list_plane(l, has_triangles, has_quads, connectivity, sizes, types);
    const int64_t cells = l->mesh.cell_count, *offsets = sum_sizes(l, sizes, cells);
    l->mesh.connectivity_count = entries;
    l->mesh.connectivity = (insitu_array){connectivity, INSITU_INT64, 0};
    l->mesh.offsets = (insitu_array){offsets, INSITU_INT64, 0};
    l->mesh.cell_type = strcmp(shape, "polygonal") == 0 ? INSITU_POLYGON : has_quads ? INSITU_QUAD : INSITU_TRIANGLE;
    conduit_node_set_path_char8_str(l->node, "topologies/mesh/elements/shape", shape);
    store_integers(l, "topologies/mesh/elements/connectivity", id, connectivity, entries);
    add_fields(l, positions, 20, cells);
    if (strcmp(shape, "tri") == 0 || strcmp(shape, "quad") == 0) return;
    store_integers(l, "topologies/mesh/elements/sizes", id, sizes, cells);
    store_integers(l, "topologies/mesh/elements/offsets", id, offsets, cells);
    if (strcmp(shape, "mixed") != 0) return;
    l->mesh.cell_types = (insitu_array){types, INSITU_INT64, 0};
    store_integers(l, "topologies/mesh/elements/shapes", id, types, cells);
    conduit_node_set_path_int64(l->node, "topologies/mesh/elements/shape_map/quad", INSITU_QUAD);
    conduit_node_set_path_int64(l->node, "topologies/mesh/elements/shape_map/tri", INSITU_TRIANGLE);
}

static void make_tris(layout_case *l)
{
    make_plane(l, "tri", true, false, STAND_IN_INT32);
}

static void make_quads(layout_case *l)
{
    make_plane(l, "quad", false, true, STAND_IN_UINT64);
}

static void make_quads_poly(layout_case *l)
{
    make_plane(l, "polygonal", false, true, STAND_IN_INT32);
}

static void make_mixed_2d(layout_case *l)
{
    make_plane(l, "mixed", true, true, STAND_IN_INT32);
}

static void make_polygons_without_offsets(layout_case *l)
{
    make_plane(l, "polygonal", true, true, STAND_IN_UINT32);
    stand_in_remove(l->node, "topologies/mesh/elements/offsets");
}

/* ---- unstructured in three dimensions ---------------------------------------------------------------------------- */

/* Copies an array of a test_mesh into memory owned by the case. */
static void *copy_to_case(layout_case *l, const void *from, int64_t count, size_t size)
{
    void *made = allocate_for_case(l, count, size);
    memcpy(made, from, (size_t)count * size);
    return made;
}

static void store_rows(layout_case *l, const char *where, int id, const int64_t *offsets, int64_t count)
{
    char path[256];
    int64_t *sizes = allocate_for_case(l, count, sizeof *sizes);
    for (int64_t i = 0; i < count; i++) sizes[i] = offsets[i + 1] - offsets[i];
    snprintf(path, sizeof path, "topologies/mesh/%s/sizes", where);
    store_integers(l, path, id, sizes, count);
    snprintf(path, sizeof path, "topologies/mesh/%s/offsets", where);
    store_integers(l, path, id, offsets, count);
}

static void store_faces(layout_case *l, const test_mesh *m, int id)
{
    l->mesh.face_count = m->face_count;
    l->mesh.face_offsets =
        (insitu_array){copy_to_case(l, m->face_offsets, m->face_count + 1, sizeof(int64_t)), INSITU_INT64, 0};
    l->mesh.face_connectivity_count = m->face_connectivity_count;
    l->mesh.face_connectivity = (insitu_array){
        copy_to_case(l, m->face_connectivity, m->face_connectivity_count, sizeof(int64_t)), INSITU_INT64, 0};
    conduit_node_set_path_char8_str(l->node, "topologies/mesh/subelements/shape", "polygonal");
    store_integers(l, "topologies/mesh/subelements/connectivity", id, m->face_connectivity, m->face_connectivity_count);
    store_rows(l, "subelements", id, m->face_offsets, m->face_count);
}

/* Stores the shape of each cell as a number and the map of numbers to shapes' names. The numbers are those of VTK plus
 * `shift`, since a simulation may use any numbers. */
static void store_shapes(layout_case *l, const test_mesh *m, int64_t shift, int id)
{
    static const char *const names[] = {"tet", "hex", "wedge", "pyramid", "polyhedral"};
    static const int64_t types[] = {INSITU_TET, INSITU_HEX, INSITU_WEDGE, INSITU_PYRAMID, INSITU_POLYHEDRON};
    char path[256];
    int64_t *numbers = allocate_for_case(l, m->cell_count, sizeof *numbers);
    for (int64_t i = 0; i < m->cell_count; i++) numbers[i] = m->types[i] + shift;
    store_integers(l, "topologies/mesh/elements/shapes", id, numbers, m->cell_count);
    for (int i = 0; i < 5; i++) {
        snprintf(path, sizeof path, "topologies/mesh/elements/shape_map/%s", names[i]);
        conduit_node_set_path_int64(l->node, path, types[i] + shift);
    }
}

typedef struct solid_kind {
    test_mesh_kind kind;
    const char *shape;
    double polyhedra;    /* fraction of cells that are stored as polyhedra */
    int64_t shape_shift; /* added to VTK's number of each shape in mixed meshes */
    int id;              /* type of the integers in the node (STAND_IN_*) */
} solid_kind;

static void make_solid(layout_case *l, const solid_kind *of)
{
    session_input in;
    input_create(&in, of->kind, LAYOUT_SIDE, TEST_BLOCK, own_rank, rank_count);
    test_mesh *m = &in.part;
    if (of->polyhedra > 0) test_mesh_to_polyhedra(m, of->polyhedra);
    const double *positions = copy_to_case(l, m->coordinates, 3 * m->vertex_count, sizeof(double));
    store_topology(l, "unstructured", "explicit");
    store_coordinates(l, positions, m->vertex_count, true);
    l->mesh.cell_count = m->cell_count;
    l->mesh.connectivity_count = m->connectivity_count;
    l->mesh.connectivity =
        (insitu_array){copy_to_case(l, m->connectivity, m->connectivity_count, sizeof(int64_t)), INSITU_INT64, 0};
    l->mesh.offsets = (insitu_array){copy_to_case(l, m->offsets, m->cell_count + 1, sizeof(int64_t)), INSITU_INT64, 0};
    l->mesh.cell_types = (insitu_array){copy_to_case(l, m->types, m->cell_count, 1), INSITU_UINT8, 0};
    conduit_node_set_path_char8_str(l->node, "topologies/mesh/elements/shape", of->shape);
    store_integers(l, "topologies/mesh/elements/connectivity", of->id, m->connectivity, m->connectivity_count);
    const bool is_mixed = strcmp(of->shape, "mixed") == 0, has_faces = m->face_count > 0;
    if (is_mixed) store_shapes(l, m, of->shape_shift, of->id);
    if (is_mixed || has_faces) store_rows(l, "elements", of->id, m->offsets, m->cell_count);
    if (has_faces) store_faces(l, m, of->id);
    add_fields(l, positions, m->vertex_count, m->cell_count);
    input_free(&in);
}

#define SOLID(name, ...)                                                                                               \
    static void name(layout_case *l)                                                                                   \
    {                                                                                                                  \
        const solid_kind of = {__VA_ARGS__};                                                                           \
        make_solid(l, &of);                                                                                            \
    }

SOLID(make_tets, TEST_TETS, "tet", 0, 0, STAND_IN_INT32)
SOLID(make_hexs, TEST_HEXES, "hex", 0, 0, STAND_IN_INT64)
SOLID(make_wedges, TEST_WEDGES, "wedge", 0, 0, STAND_IN_UINT32)
SOLID(make_pyramids, TEST_PYRAMIDS, "pyramid", 0, 0, STAND_IN_UINT64)
SOLID(make_hexs_poly, TEST_HEXES, "polyhedral", 1, 0, STAND_IN_INT64)
SOLID(make_polyhedra, TEST_POLYHEDRA, "polyhedral", 0, 0, STAND_IN_INT32)
SOLID(make_mixed, TEST_MIXED, "mixed", 0.3, 0, STAND_IN_INT32)
SOLID(make_mixed_renumbered, TEST_MIXED, "mixed", 0.3, 300, STAND_IN_INT32)
SOLID(make_mixed_shorts, TEST_MIXED, "mixed", 0, 7, STAND_IN_INT16)

/* ---- ghosts and fields ------------------------------------------------------------------------------------------- */

/* Adds an array of flags: `mark` for a third of the cells and `other` for the rest. */
static void store_ghosts(layout_case *l, const char *name, int id, int64_t mark, int64_t other)
{
    char path[256];
    const int64_t cells = l->mesh.cell_count;
    int64_t *flags = allocate_for_case(l, cells, sizeof *flags);
    unsigned char *bytes = allocate_for_case(l, cells, 1);
    for (int64_t i = 0; i < cells; i++) {
        bytes[i] = i % 3 == 1;
        flags[i] = bytes[i] ? mark : i % 2 ? other : 0;
    }
    store_field_header(l, name, "element");
    snprintf(path, sizeof path, "fields/%s/values", name);
    store_integers(l, path, id, flags, cells);
    l->mesh.ghosts = (insitu_array){bytes, INSITU_UINT8, 0};
}

static void make_ghosts_of_vtk(layout_case *l)
{
    make_tets(l);
    store_ghosts(l, "vtkGhostType", STAND_IN_UINT8, 1, 0);
}

/* Bit 16 marks cells at the border of the domain and must hide nothing. */
static void make_ghosts_of_bits(layout_case *l)
{
    make_uniform(l);
    store_ghosts(l, "vtkGhostType", STAND_IN_UINT8, 32, 16);
}

static void make_ghosts_of_ascent(layout_case *l)
{
    make_hexs(l);
    store_ghosts(l, "ascent_ghosts", STAND_IN_INT32, 256, 0);
}

static void make_ghosts_with_name(layout_case *l)
{
    make_structured(l);
    store_ghosts(l, "halo", STAND_IN_INT64, 1, 0);
    conduit_node_set_path_char8_str(l->node, "state/metadata/vtk_fields/halo/attribute_type", "Ghosts");
}

/* Stores vel as interleaved components, braid as integers of two bytes and radial as integers of one byte. */
static void make_fields_of_integers(layout_case *l)
{
    static const char *const parts[3] = {"fields/vel/values/u", "fields/vel/values/v", "fields/vel/values/w"};
    make_hexs(l);
    double *f = (double *)(uintptr_t)l->fields[0].values.data, *r = (double *)(uintptr_t)l->fields[1].values.data;
    int64_t *whole = allocate_for_case(l, l->mesh.vertex_count + l->mesh.cell_count, sizeof *whole);
    for (int64_t i = 0; i < l->mesh.vertex_count; i++) f[i] = (double)(whole[i] = (int64_t)(1000 * f[i]));
    store_integers(l, "fields/braid/values", STAND_IN_INT16, whole, l->mesh.vertex_count);
    for (int64_t i = 0; i < l->mesh.cell_count; i++) whole[i] = (int64_t)r[i];
    store_integers(l, "fields/radial/values", STAND_IN_UINT8, whole, l->mesh.cell_count);
    for (int c = 0; c < 3; c++)
        stand_in_set_array(l->node, parts[c], STAND_IN_FLOAT64, (const double *)l->fields[2].values.data + c,
                           l->mesh.vertex_count, 3 * (int64_t)sizeof(double));
}

/* Makes a domain with a nestset: the cells in its window are drawn by another domain. */
static void make_covered(layout_case *l)
{
    make_rectilinear(l);
    static const char window[] = "nestsets/nest/windows/window_0_1/";
    static const char *const names[] = {"origin/i", "origin/j", "origin/k", "dims/i", "dims/j", "dims/k"};
    static const int64_t numbers[] = {1, 0, 1, 2, 2, 1};
    char path[256];
    unsigned char *flags = allocate_for_case(l, l->mesh.cell_count, 1);
    conduit_node_set_path_char8_str(l->node, "nestsets/nest/association", "element");
    conduit_node_set_path_char8_str(l->node, "nestsets/nest/topology", "mesh");
    conduit_node_set_path_char8_str(l->node, "nestsets/nest/windows/window_0_1/domain_type", "child");
    conduit_node_set_path_char8_str(l->node, "nestsets/nest/windows/window_0_7/domain_type", "parent");
    for (int i = 0; i < 6; i++) {
        snprintf(path, sizeof path, "%s%s", window, names[i]);
        conduit_node_set_path_int64(l->node, path, numbers[i]);
    }
    for (int64_t c = 0; c < l->mesh.cell_count; c++) {
        const int64_t i = c % 4, j = c / 4 % 3, k = c / 12;
        flags[c] = i >= 1 && i < 3 && j < 2 && k == 1;
    }
    l->mesh.ghosts = (insitu_array){flags, INSITU_UINT8, 0};
}

/* ---- list of all layouts ----------------------------------------------------------------------------------------- */

const layout_kind layout_kinds[] = {
    {"uniform", make_uniform, false},
    {"uniform 2d", make_uniform_2d, false},
    {"uniform in a whole", make_uniform_block, false},
    {"rectilinear", make_rectilinear, false},
    {"rectilinear 2d", make_rectilinear_2d, false},
    {"rectilinear of integers", make_rectilinear_integers, false},
    {"structured", make_structured, false},
    {"structured 2d", make_structured_2d, false},
    {"structured shell", make_structured_shell, false},
    {"strided", make_strided, false},
    {"tris", make_tris, false},
    {"quads", make_quads, false},
    {"quads_poly", make_quads_poly, false},
    {"mixed_2d", make_mixed_2d, false},
    {"polygons without offsets", make_polygons_without_offsets, true},
    {"tets", make_tets, false},
    {"hexs", make_hexs, false},
    {"wedges", make_wedges, false},
    {"pyramids", make_pyramids, false},
    {"hexs_poly", make_hexs_poly, false},
    {"polyhedra", make_polyhedra, false},
    {"mixed", make_mixed, false},
    {"mixed, own numbers", make_mixed_renumbered, false},
    {"mixed of int16", make_mixed_shorts, false},
    {"vtkGhostType", make_ghosts_of_vtk, false},
    {"vtkGhostType of bits", make_ghosts_of_bits, true},
    {"ascent_ghosts", make_ghosts_of_ascent, false},
    {"attribute Ghosts", make_ghosts_with_name, false},
    {"integer fields", make_fields_of_integers, false},
    {"covered cells", make_covered, true},
};
const int layout_kind_count = sizeof layout_kinds / sizeof layout_kinds[0];

void layout_make(const layout_kind *kind, layout_case *out)
{
    *out = (layout_case){.node = conduit_node_create()};
    insitu_mesh_defaults(&out->mesh);
    kind->make(out);
}

void layout_free(layout_case *layout)
{
    conduit_node_destroy(layout->node);
    while (layout->array_count) free(layout->arrays[--layout->array_count]);
}

insitu_status layout_submit(insitu_session *session, const char *name, const layout_case *layout)
{
    insitu_mesh mesh = layout->mesh;
    if (mesh.lattice) mesh.lattice = &layout->lattice;
    insitu_status status = insitu_set_mesh(session, name, &mesh);
    for (int i = 0; i < layout->field_count && !status; i++)
        status = insitu_set_field(session, name, &layout->fields[i]);
    return status;
}
