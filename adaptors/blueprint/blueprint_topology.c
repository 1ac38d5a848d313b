/* Reads coordsets and topologies. Uniform, rectilinear and structured topologies become lattices. A lattice needs no
 * list of cells. */
#include "blueprint_mesh.h"

#include <string.h>

static const char *const index_names[3] = {"i", "j", "k"};

/* ---- lattices (structured grids) -------------------------------------------------------------------------------- */

/* Stores the number of vertices along each axis; each number must be at least 1. A topology whose cells have fewer than
 * two dimensions is left out. */
static bool set_vertex_counts(const node *of, const char *path, const int64_t counts[3], blueprint_mesh *out)
{
    int flat = 0;
    for (int axis = 0; axis < 3; axis++) {
        if (counts[axis] < 1 || counts[axis] > (int64_t)1 << 40)
            return node_set_error(of, path, INSITU_ERROR_MESH, "has %lld vertices along %s, expected at least 1",
                                  (long long)counts[axis], index_names[axis]);
        flat += counts[axis] == 1;
        out->lattice.cells[axis] = counts[axis] - 1;
    }
    out->mesh.lattice = &out->lattice;
    out->is_left_out = flat > 1;
    if (out->is_left_out)
        node_report_left_out(of, path, "%lld x %lld x %lld vertices make no cells of two or three dimensions",
                             (long long)counts[0], (long long)counts[1], (long long)counts[2]);
    return true;
}

/* Sets the strides of the lattice's vertices and cells to those of arrays without padding, and stores the numbers of
 * vertices and cells. */
static void set_lattice_strides_and_counts(blueprint_mesh *out)
{
    int64_t counts[3];
    for (int axis = 0; axis < 3; axis++) counts[axis] = out->lattice.cells[axis] + 1;
    node_read_strides(NULL, NULL, counts, out->lattice.vertex_strides);
    node_read_strides(NULL, NULL, out->lattice.cells, out->lattice.cell_strides);
    out->mesh.vertex_count = blueprint_count_spanned_elements(counts, out->lattice.vertex_strides);
    out->mesh.cell_count = blueprint_count_spanned_elements(out->lattice.cells, out->lattice.cell_strides);
}

/* Reads elements/origin, the index of the block's first vertex in the whole lattice. Its entries are called i0, j0 and
 * k0 in the specification, and i, j and k in older nodes. */
static bool read_first(const node *topology, int64_t first[3], bool *has_first)
{
    static const char *const paths[2][3] = {{"elements/origin/i", "elements/origin/j", "elements/origin/k"},
                                            {"elements/origin/i0", "elements/origin/j0", "elements/origin/k0"}};
    for (int form = 0; form < 2; form++)
        for (int axis = 0; axis < 3; axis++) {
            if (!node_read_integer(topology, paths[form][axis], false, &first[axis])) return false;
            *has_first = *has_first || node_has(topology, paths[form][axis]);
        }
    return true;
}

/* Reads a uniform coordset. The origin of the whole lattice is computed from elements/origin, so that all blocks
 * compute the same coordinates. */
static bool read_uniform_coordset(const node *coordset, const node *topology, blueprint_mesh *out)
{
    static const char *const dims[3] = {"dims/i", "dims/j", "dims/k"};
    static const char *const origins[3] = {"origin/x", "origin/y", "origin/z"};
    static const char *const spacings[3] = {"spacing/dx", "spacing/dy", "spacing/dz"};
    int64_t counts[3] = {1, 1, 1}, first[3] = {0, 0, 0};
    if (!read_first(topology, first, &out->has_first)) return false;
    for (int axis = 0; axis < 3; axis++) {
        double origin = 0, spacing = 1;
        if (!node_read_integer(coordset, dims[axis], axis == 0, &counts[axis])) return false;
        if (!node_has(coordset, dims[axis])) continue;
        if (!node_read_real(coordset, origins[axis], false, &origin)) return false;
        if (!node_read_real(coordset, spacings[axis], false, &spacing)) return false;
        if (spacing == 0) return node_set_error(coordset, spacings[axis], INSITU_ERROR_MESH, "is 0");
        out->lattice.origin[axis] = origin - spacing * (double)first[axis];
        out->lattice.spacing[axis] = spacing;
        out->lattice.first[axis] = first[axis];
    }
    if (!set_vertex_counts(coordset, "dims", counts, out)) return false;
    set_lattice_strides_and_counts(out);
    return true;
}

/* Finds the coordinates along x, y and z. Returns false if one is missing. A coordset in another system (r, theta, phi)
 * is left out. */
static bool find_coordinate_arrays(const node *coordset, node_array axes[3], int *count, blueprint_mesh *out)
{
    static const char *const paths[3] = {"values/x", "values/y", "values/z"};
    static const char *const others[3] = {"values/r", "values/theta", "values/phi"};
    for (int i = 0; i < 3; i++)
        if (node_has(coordset, others[i])) {
            node_report_left_out(coordset, others[i], "coordinates other than x, y and z are not read");
            out->is_left_out = true;
            return true;
        }
    *count = 0;
    for (int axis = 0; axis < 3; axis++) {
        if (axis && !node_has(coordset, paths[axis])) break;
        if (!node_require_array(coordset, paths[axis], &axes[axis])) return false;
        *count = axis + 1;
    }
    return true;
}

static bool read_rectilinear_coordset(const node *coordset, blueprint_mesh *out)
{
    node_array axes[3] = {{.count = 1}, {.count = 1}, {.count = 1}};
    int dimensions;
    if (!find_coordinate_arrays(coordset, axes, &dimensions, out)) return false;
    if (out->is_left_out) return true;
    const int64_t counts[3] = {axes[0].count, axes[1].count, axes[2].count};
    if (!set_vertex_counts(coordset, "values", counts, out)) return false;
    for (int axis = 0; axis < dimensions; axis++) out->lattice.axes[axis] = axes[axis].array;
    set_lattice_strides_and_counts(out);
    return true;
}

/* Reads the coordinates of each vertex. In two dimensions there is no z. */
static bool read_explicit_coordset(const node *coordset, blueprint_mesh *out)
{
    static const char *const paths[3] = {"values/x", "values/y", "values/z"};
    node_array axes[3];
    int dimensions;
    if (!find_coordinate_arrays(coordset, axes, &dimensions, out)) return false;
    if (out->is_left_out) return true;
    if (dimensions == 1) {
        node_report_left_out(coordset, "values", "coordinates of one dimension");
        out->is_left_out = true;
    }
    out->mesh.vertex_count = axes[0].count;
    for (int axis = 0; axis < dimensions; axis++) {
        if (axes[axis].count != axes[0].count)
            return node_set_error(coordset, paths[axis], INSITU_ERROR_MESH, "has %lld elements, values/x has %lld",
                                  (long long)axes[axis].count, (long long)axes[0].count);
        out->mesh.coordinates[axis] = axes[axis].array;
    }
    return true;
}

/* ---- structured topologies -------------------------------------------------------------------------------------- */

/* Reads the number of vertices along each axis, and the offsets and strides of the vertices in the coordinate arrays.
 * Missing strides are those of arrays without padding. */
static bool read_dims(const node *topology, int64_t counts[3], int64_t offsets[3], int64_t strides[3])
{
    static const char *const dims[3] = {"elements/dims/i", "elements/dims/j", "elements/dims/k"};
    int offset_count = 0;
    for (int axis = 0; axis < 3; axis++) {
        int64_t cells = 0;
        if (!node_read_integer(topology, dims[axis], axis == 0, &cells)) return false;
        if (cells < 0)
            return node_set_error(topology, dims[axis], INSITU_ERROR_MESH, "is %lld, expected at least 0",
                                  (long long)cells);
        counts[axis] = cells + 1;
    }
    node_read_integers(topology, "elements/dims/offsets", offsets, &offset_count);
    node_read_strides(topology, "elements/dims/strides", counts, strides);
    for (int axis = 0; axis < 3 && !topology->log->status; axis++)
        if (offsets[axis] < 0 || strides[axis] < 1)
            return node_set_error(topology, offsets[axis] < 0 ? "elements/dims/offsets" : "elements/dims/strides",
                                  INSITU_ERROR_MESH, "has %lld for %s",
                                  (long long)(offsets[axis] < 0 ? offsets : strides)[axis], index_names[axis]);
    return !topology->log->status;
}

static bool read_structured_topology(const node *topology, blueprint_mesh *out)
{
    int64_t counts[3], offsets[3] = {0, 0, 0}, strides[3], first = 0;
    insitu_mesh *m = &out->mesh;
    if (!read_dims(topology, counts, offsets, strides)) return false;
    if (!set_vertex_counts(topology, "elements/dims", counts, out)) return false;
    for (int axis = 0; axis < 3; axis++) first += offsets[axis] * strides[axis];
    const int64_t span = blueprint_count_spanned_elements(counts, strides);
    if (first + span > m->vertex_count)
        return node_set_error(topology, "elements/dims", INSITU_ERROR_MESH,
                              "reaches vertex %lld, the coordset has %lld", (long long)(first + span - 1),
                              (long long)m->vertex_count);
    set_lattice_strides_and_counts(out);
    memcpy(out->lattice.vertex_strides, strides, sizeof strides);
    m->vertex_count = span;
    for (int axis = 0; axis < 3; axis++)
        if (m->coordinates[axis].data)
            m->coordinates[axis].data =
                (const char *)m->coordinates[axis].data + first * m->coordinates[axis].stride_bytes;
    return true;
}

/* ---- topologies ------------------------------------------------------------------------------------------------- */

static bool read_coordset(const node *coordset, const node *topology, const char *type, blueprint_mesh *out)
{
    if (strcmp(type, "uniform") == 0) return read_uniform_coordset(coordset, topology, out);
    if (strcmp(type, "rectilinear") == 0) return read_rectilinear_coordset(coordset, out);
    if (strcmp(type, "explicit") == 0) return read_explicit_coordset(coordset, out);
    return node_set_error(coordset, "type", INSITU_ERROR_MESH, "is \"%s\", expected uniform, rectilinear or explicit",
                          type);
}

static bool find_coordset(const node *domain, const node *topology, node *sets, node *out, const char **type)
{
    const char *name;
    if (!node_read_string(topology, "coordset", &name)) return false;
    if (!node_require(domain, "coordsets", sets)) return false;
    if (!node_find(sets, name, out))
        return node_set_error(topology, "coordset", INSITU_ERROR_MESH, "is \"%s\", which is not among the coordsets",
                              name);
    return node_read_string(out, "type", type);
}

/* Checks that the coordset's type is the one that this type of topology requires. */
static bool check_coordset_type(const node *topology, const char *type, const char *of_coordset)
{
    const bool is_explicit = strcmp(type, "structured") == 0 || strcmp(type, "unstructured") == 0;
    const char *expected = is_explicit ? "explicit" : type;
    return strcmp(of_coordset, expected) == 0 ||
           node_set_error(topology, "coordset", INSITU_ERROR_MESH,
                          "is of type \"%s\", topologies of type \"%s\" need \"%s\"", of_coordset, type, expected);
}

bool blueprint_read_topology(const node *domain, const node *topology, blueprint_mesh *out)
{
    const char *type, *of_coordset;
    node sets, coordset;
    memset(out, 0, sizeof *out);
    insitu_mesh_defaults(&out->mesh);
    if (!node_read_string(topology, "type", &type)) return false;
    if (strcmp(type, "points") == 0) {
        node_report_left_out(topology, "type", "points are not drawn");
        out->is_left_out = true;
        return true;
    }
    if (strcmp(type, "uniform") != 0 && strcmp(type, "rectilinear") != 0 && strcmp(type, "structured") != 0 &&
        strcmp(type, "unstructured") != 0)
        return node_set_error(topology, "type", INSITU_ERROR_MESH,
                              "is \"%s\", expected uniform, rectilinear, structured, unstructured or points", type);
    if (!find_coordset(domain, topology, &sets, &coordset, &of_coordset)) return false;
    if (!check_coordset_type(topology, type, of_coordset)) return false;
    if (!read_coordset(&coordset, topology, of_coordset, out)) return false;
    if (out->is_left_out) return true;
    out->has_level =
        strcmp(type, "uniform") == 0 && (node_has(domain, "state/level") || node_has(domain, "state/level_id"));
    if (strcmp(type, "structured") == 0) return read_structured_topology(topology, out);
    return strcmp(type, "unstructured") != 0 || blueprint_read_unstructured(topology, out);
}
