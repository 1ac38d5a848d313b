/* insitu_set_mesh() and insitu_set_block() check the description of a mesh or block and store it in the table of
 * meshes. The contents of arrays are not read here, but by the next step. An error is returned immediately. It is also
 * stored with the mesh until the mesh is set again, so that the next step can return it on every rank. */
#include "session_mesh_input.h"

#include <stdio.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_conform.h"
#include "session_lattice.h"
#include "session_nodes.h"
#include "session_topology.h"
#include "session_warp.h"

void insitu_mesh_defaults(insitu_mesh *mesh)
{
    if (!mesh) return;
    *mesh = (insitu_mesh){0};
    mesh->cell_type = INSITU_TET;
    mesh->changed = INSITU_CHANGED_ALL;
}

void insitu_field_defaults(insitu_field *field)
{
    if (!field) return;
    *field = (insitu_field){0};
    field->component_count = 1;
    field->changed = INSITU_CHANGED_ALL;
}

void insitu_mesh_interleaved(insitu_mesh *mesh, const void *xyz, insitu_type type)
{
    if (!mesh) return;
    const int64_t size = session_type_size(type);
    for (int axis = 0; axis < 3; axis++) {
        mesh->coordinates[axis].data = xyz ? (const char *)xyz + axis * size : NULL;
        mesh->coordinates[axis].type = type;
        mesh->coordinates[axis].stride_bytes = 3 * size;
    }
}

/* ---- checks of the description of a mesh ------------------------------------------------------------------------- */

static insitu_status check_count(const char *name, int64_t count, int64_t most, base_error *error)
{
    if (count < 0) return base_fail(error, INSITU_ERROR_ARGUMENT, "%s is %lld", name, (long long)count);
    if (count > most)
        return base_fail(error, INSITU_ERROR_ARGUMENT, "%s is %lld, at most %lld is supported", name, (long long)count,
                         (long long)most);
    return INSITU_OK;
}

static insitu_status check_counts(const insitu_mesh *mesh, base_error *error)
{
    insitu_status status = check_count("vertex_count", mesh->vertex_count, INT64_MAX / 32, error);
    if (!status) status = check_count("cell_count", mesh->cell_count, 4294967294, error);
    if (!status) status = check_count("connectivity_count", mesh->connectivity_count, INT64_MAX / 32, error);
    if (!status) status = check_count("face_count", mesh->face_count, INT64_MAX / 32, error);
    if (!status) status = check_count("face_connectivity_count", mesh->face_connectivity_count, INT64_MAX / 32, error);
    if (!status) status = check_count("neighbour_count", mesh->neighbour_count, INT64_MAX / 32, error);
    if (!status) status = check_count("boundary_face_count", mesh->boundary_face_count, INT64_MAX / 32, error);
    if (!status)
        status = check_count("boundary_face_connectivity_count", mesh->boundary_face_connectivity_count, INT64_MAX / 32,
                             error);
    if (!status) status = check_count("halo_cell_count", mesh->halo_cell_count, 4294967294, error);
    return status;
}

bool session_may_lack_z(const insitu_mesh *mesh)
{
    if (mesh->lattice) return session_is_quad_lattice(mesh->lattice);
    const int type = (int)mesh->cell_type;
    return mesh->cell_types.data || mesh->cell_count == 0 || grid_is_shell_type(type) ||
           grid_is_shell_type(session_get_linear_type(type));
}

static insitu_status check_arrays(const insitu_mesh *mesh, base_error *error)
{
    const insitu_array *const arrays[] = {&mesh->coordinates[0],
                                          &mesh->coordinates[1],
                                          &mesh->coordinates[2],
                                          &mesh->vertex_ids,
                                          &mesh->cell_types,
                                          &mesh->connectivity,
                                          &mesh->offsets,
                                          &mesh->ghosts,
                                          &mesh->face_offsets,
                                          &mesh->face_sizes,
                                          &mesh->owner,
                                          &mesh->neighbour,
                                          &mesh->face_connectivity,
                                          &mesh->boundary_face_offsets,
                                          &mesh->boundary_owner,
                                          &mesh->boundary_face_connectivity};
    const int64_t vertices = mesh->vertex_count, cells = mesh->cell_count, faces = mesh->face_count;
    const int64_t apart = mesh->boundary_face_count;
    const bool has_lists = mesh->face_lists.data != NULL, has_axes = session_has_axis_coordinates(mesh);
    const int numbers = SESSION_ALLOW_FLOATS | SESSION_ALLOW_ANY, integers = SESSION_ALLOW_INTEGERS;
    const int any = SESSION_ALLOW_ANY, optional = SESSION_IS_OPTIONAL, closed = SESSION_HAS_END;
    const int end = mesh->open_offsets ? 0 : closed;
    const session_array_rule rules[] = {
        {"x coordinates", vertices, numbers | (has_axes ? optional : 0), 1},
        {"y coordinates", vertices, numbers | (has_axes ? optional : 0), 1},
        {"z coordinates", vertices, numbers | (has_axes || session_may_lack_z(mesh) ? optional : 0), 1},
        {"vertex ids", vertices, integers | optional, 1},
        {"cell types", cells, any | optional, 1},
        {"connectivity indices", mesh->connectivity_count, any, 1},
        {"offsets", cells, any | optional | end, 1},
        {"ghost flags", cells, any | optional, 1},
        {"face offsets", faces, any | end | (has_lists ? optional : 0), 1},
        {"face sizes", faces, integers | (has_lists ? 0 : optional), 1},
        {"owners of faces", faces, integers | optional, 1},
        {"neighbours of faces", mesh->neighbour_count, integers, 1},
        {"face vertex indices", mesh->face_connectivity_count, any, 1},
        {"offsets of boundary faces", apart, integers | closed, 1},
        {"owners of boundary faces", apart, integers, 1},
        {"vertex indices of boundary faces", mesh->boundary_face_connectivity_count, integers, 1},
    };
    for (size_t i = 0; i < sizeof rules / sizeof rules[0]; i++) {
        const insitu_status status = session_check_array(arrays[i], &rules[i], INSITU_ERROR_MESH, error);
        if (status) return status;
    }
    return INSITU_OK;
}

/* Checks the face lists: an array with one pointer per face, to the indices of the face's vertices. The type in the
 * description of this array is the type of these indices. */
static insitu_status check_face_lists(const insitu_mesh *mesh, base_error *error)
{
    const insitu_array *lists = &mesh->face_lists;
    if (!lists->data) {
        if (!mesh->face_sizes.data) return INSITU_OK;
        return base_fail(error, INSITU_ERROR_MESH, "face sizes are given without face lists");
    }
    if (mesh->face_offsets.data || mesh->face_connectivity.data)
        return base_fail(error, INSITU_ERROR_MESH,
                         "face lists and %s are given: give faces their vertices by one of them",
                         mesh->face_offsets.data ? "face offsets" : "face vertex indices");
    const session_array_rule rule = {"face lists", mesh->face_count, SESSION_ALLOW_INTEGERS, 1};
    return session_check_pointers(lists, &rule, INSITU_ERROR_MESH, error);
}

/* Checks the arrays of owners and neighbours by which faces may describe cells, and that no other array describes the
 * cells too. */
static insitu_status check_face_owners(const insitu_mesh *mesh, base_error *error)
{
    if (!session_has_face_owners(mesh)) {
        if (mesh->halo_cell_count)
            return base_fail(error, INSITU_ERROR_MESH, "halo_cell_count is %lld, but owners of faces are not given",
                             (long long)mesh->halo_cell_count);
        if (!mesh->neighbour.data) return INSITU_OK;
        return base_fail(error, INSITU_ERROR_MESH, "neighbours of faces are given without owners");
    }
    if (mesh->face_count && !mesh->owner.data)
        return base_fail(error, INSITU_ERROR_MESH,
                         "owners of boundary faces are given, but those of %lld faces are not",
                         (long long)mesh->face_count);
    if (mesh->boundary_face_count && mesh->face_lists.data)
        return base_fail(error, INSITU_ERROR_MESH,
                         "boundary_face_count is %lld and face lists are given: give all faces by lists",
                         (long long)mesh->boundary_face_count);
    if (mesh->neighbour_count > mesh->face_count)
        return base_fail(error, INSITU_ERROR_MESH, "neighbour_count is %lld, more than face_count, %lld",
                         (long long)mesh->neighbour_count, (long long)mesh->face_count);
    if (mesh->cell_type != INSITU_POLYHEDRON)
        return base_fail(error, INSITU_ERROR_MESH, "cell_type is %d, but owners of faces are for %d, polyhedra",
                         (int)mesh->cell_type, (int)INSITU_POLYHEDRON);
    const char *other = mesh->connectivity.data ? "connectivity indices"
                        : mesh->offsets.data    ? "offsets"
                        : mesh->cell_types.data ? "cell types"
                                                : NULL;
    if (other)
        return base_fail(error, INSITU_ERROR_MESH, "owners of faces and %s are given: give cells by one of them",
                         other);
    return INSITU_OK;
}

static insitu_status check_mesh_options(const insitu_mesh *mesh, base_error *error)
{
    if (mesh->changed & ~(unsigned)INSITU_CHANGED_ALL)
        return base_fail(error, INSITU_ERROR_ARGUMENT, "changed is %u, unknown bits are set", mesh->changed);
    if (mesh->index_base != 0 && mesh->index_base != 1)
        return base_fail(error, INSITU_ERROR_ARGUMENT, "index_base is %d, expected 0 or 1", mesh->index_base);
    if (mesh->open_offsets != 0 && mesh->open_offsets != 1)
        return base_fail(error, INSITU_ERROR_ARGUMENT, "open_offsets is %d, expected 0 or 1", mesh->open_offsets);
    if (mesh->cell_type_map_count < 0 || (mesh->cell_type_map_count && !mesh->cell_type_map))
        return base_fail(error, INSITU_ERROR_ARGUMENT, "cell_type_map_count is %d%s", mesh->cell_type_map_count,
                         mesh->cell_type_map ? "" : ", and cell_type_map is not given");
    if (mesh->keep_polyhedra != 0 && mesh->keep_polyhedra != 1)
        return base_fail(error, INSITU_ERROR_ARGUMENT, "keep_polyhedra is %d, expected 0 or 1", mesh->keep_polyhedra);
    if ((int)mesh->vertex_order < INSITU_ORDER_VTK || mesh->vertex_order > INSITU_ORDER_EXODUS)
        return base_fail(error, INSITU_ERROR_ARGUMENT,
                         "vertex_order is %d, expected 0 (VTK's), 1 (lexicographic), 2 (DMPlex's), 3 (VTK's before "
                         "9.1), 4 (Gmsh's) or 5 (Exodus's)",
                         (int)mesh->vertex_order);
    return INSITU_OK;
}

/* Checks connectivity_row, the number of connectivity entries per cell. If it is given, no offsets, cell types or
 * owners of faces may be given, and the rows of all cells must fit into the connectivity. */
static insitu_status check_cell_rows(const insitu_mesh *mesh, base_error *error)
{
    const long long row = mesh->connectivity_row, vertices = session_count_cell_nodes(mesh);
    if (row == 0 || mesh->cell_count == 0) return INSITU_OK;
    const char *other = session_has_face_owners(mesh) ? "owners of faces"
                        : mesh->offsets.data          ? "offsets"
                        : mesh->cell_types.data       ? "cell types"
                                                      : NULL;
    if (other)
        return base_fail(error, INSITU_ERROR_MESH,
                         "connectivity_row is %lld and %s are given: rows are of cells of one type without offsets",
                         row, other);
    if (row < vertices)
        return base_fail(error, INSITU_ERROR_MESH, "connectivity_row is %lld, a cell has %lld vertices", row, vertices);
    const long long rest = mesh->connectivity_count - vertices, cells = mesh->cell_count;
    if (rest < 0 || (cells > 1 && row > rest / (cells - 1)))
        return base_fail(error, INSITU_ERROR_MESH,
                         "connectivity_count is %lld, too few for %lld cells of %lld vertices in rows of %lld",
                         (long long)mesh->connectivity_count, cells, vertices, row);
    return INSITU_OK;
}

/* Checks that `order` is only given if all cells have one Lagrange type and no offsets. Each other type has only one
 * order, and if offsets are given, the number of nodes determines the order of each cell. */
static insitu_status check_lagrange_order(const insitu_mesh *mesh, base_error *error)
{
    const int type = (int)mesh->cell_type;
    if (mesh->order == 0) return INSITU_OK;
    if (mesh->order < 0 || mesh->order > NODES_MOST_ORDER)
        return base_fail(error, INSITU_ERROR_ARGUMENT, "order is %d, expected 1..%d, or 0: as the nodes tell",
                         mesh->order, NODES_MOST_ORDER);
    if (mesh->cell_count == 0) return INSITU_OK;
    const char *other = mesh->lattice                   ? "a lattice"
                        : session_has_face_owners(mesh) ? "owners of faces"
                        : mesh->cell_types.data         ? "cell types"
                        : mesh->offsets.data            ? "offsets"
                                                        : NULL;
    if (other)
        return base_fail(error, INSITU_ERROR_MESH,
                         "order is %d and %s are given: order is of cells of one Lagrange type without offsets",
                         mesh->order, other);
    if (session_is_lagrange(type)) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_MESH, "order is %d, and cell_type is %d: order is for types 69 to 74",
                     mesh->order, type);
}

/* Checks the description of a mesh whose cells all have one type of higher order. If offsets are given, a step checks
 * each cell's number of nodes later. */
static insitu_status check_higher_order(const insitu_mesh *mesh, base_error *error)
{
    const long long cells = mesh->cell_count, nodes = session_count_cell_nodes(mesh), count = mesh->connectivity_count;
    const int type = (int)mesh->cell_type;
    session_nodes of;
    if (mesh->offsets.data) return INSITU_OK;
    const bool is_implied = !mesh->connectivity.data && count == 0;
    if (is_implied && !mesh->order)
        return base_fail(error, INSITU_ERROR_MESH,
                         "connectivity indices are not given, nor is order, without which they are needed");
    if (is_implied && mesh->connectivity_row)
        return base_fail(error, INSITU_ERROR_MESH, "connectivity_row is %lld, and connectivity indices are not given",
                         (long long)mesh->connectivity_row);
    if (is_implied && mesh->vertex_count != cells * nodes)
        return base_fail(error, INSITU_ERROR_MESH,
                         "vertex_count is %lld, %lld cells of %lld nodes without connectivity need %lld",
                         (long long)mesh->vertex_count, cells, nodes, cells * nodes);
    if (!is_implied && !mesh->connectivity_row && (nodes == 0 || count != cells * nodes))
        return base_fail(error, INSITU_ERROR_MESH, "connectivity_count is %lld, %lld cells of %lld nodes need %lld",
                         count, cells, nodes, cells * nodes);
    if (!session_describe_nodes(type, nodes, &of))
        return base_fail(error, INSITU_ERROR_MESH, "cells of type %d have %lld nodes, which no order from 1 to %d has",
                         type, nodes, NODES_MOST_ORDER);
    const char *why = session_describe_unsupported_node_order(&of, mesh->vertex_order);
    if (!why) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_MESH, "cells of type %d and order %d: vertex_order is %d: %s", type, of.order,
                     (int)mesh->vertex_order, why);
}

static insitu_status check_cell_description(const insitu_mesh *mesh, base_error *error)
{
    if (mesh->cell_count == 0 || session_has_face_owners(mesh) || mesh->lattice) return INSITU_OK;
    if (mesh->cell_types.data) {
        if (!mesh->offsets.data)
            return base_fail(error, INSITU_ERROR_MESH, "cell types are given without offsets: mixed cells need both");
        return INSITU_OK;
    }
    if (mesh->cell_type == INSITU_POLYHEDRON && !mesh->offsets.data)
        return base_fail(error, INSITU_ERROR_MESH, "offsets are not given: polyhedra need them, or owners of faces");
    if (mesh->cell_type == INSITU_POLYGON && !mesh->offsets.data)
        return base_fail(error, INSITU_ERROR_MESH, "offsets are not given: polygons need them");
    if (mesh->cell_type == INSITU_POLYHEDRON || mesh->cell_type == INSITU_POLYGON) return INSITU_OK;
    if (session_get_linear_type((int)mesh->cell_type) != GRID_NO_TYPE) return check_higher_order(mesh, error);
    const int vertices = grid_type_vertex_count((int)mesh->cell_type);
    if (vertices == 0)
        return base_fail(error, INSITU_ERROR_MESH,
                         "unknown cell_type %d (10 tet, 12 hex, 13 wedge, 14 pyramid, 42 polyhedron; 5 triangle, 9 "
                         "quad, 7 polygon; 22 to 29, 32 and 69 to 74 of higher order)",
                         (int)mesh->cell_type);
    if (!mesh->offsets.data && !mesh->connectivity_row && mesh->connectivity_count != mesh->cell_count * vertices)
        return base_fail(error, INSITU_ERROR_MESH, "connectivity_count is %lld, %lld cells of %d vertices need %lld",
                         (long long)mesh->connectivity_count, (long long)mesh->cell_count, vertices,
                         (long long)mesh->cell_count * vertices);
    return INSITU_OK;
}

static insitu_status check_mesh(const insitu_mesh *mesh, base_error *error)
{
    insitu_status status = check_counts(mesh, error);
    if (!status && mesh->lattice) status = session_check_lattice(mesh, error);
    if (!status) status = check_arrays(mesh, error);
    if (!status) status = check_mesh_options(mesh, error);
    if (!status) status = check_face_lists(mesh, error);
    if (!status) status = check_face_owners(mesh, error);
    if (!status) status = check_lagrange_order(mesh, error);
    if (!status) status = check_cell_description(mesh, error);
    if (!status) status = check_cell_rows(mesh, error);
    return status;
}

/* Returns whether two descriptions differ in counts, types, options, or in the set of arrays that are given. The mesh
 * then counts as a new one, whatever changes the caller declares. */
static bool has_other_shape(const insitu_mesh *a, const insitu_mesh *b)
{
    return a->vertex_count != b->vertex_count || a->cell_count != b->cell_count ||
           a->connectivity_count != b->connectivity_count || a->cell_type != b->cell_type ||
           a->index_base != b->index_base || !a->cell_types.data != !b->cell_types.data ||
           !a->offsets.data != !b->offsets.data || !a->ghosts.data != !b->ghosts.data ||
           a->face_count != b->face_count || a->face_connectivity_count != b->face_connectivity_count ||
           a->neighbour_count != b->neighbour_count || a->keep_polyhedra != b->keep_polyhedra || a->order != b->order ||
           a->open_offsets != b->open_offsets || a->vertex_order != b->vertex_order ||
           a->connectivity_row != b->connectivity_row || !a->owner.data != !b->owner.data ||
           !a->face_lists.data != !b->face_lists.data ||
           session_lattice_changes(a->lattice, b->lattice) == INSITU_CHANGED_ALL ||
           a->boundary_face_count != b->boundary_face_count || a->halo_cell_count != b->halo_cell_count ||
           a->boundary_face_connectivity_count != b->boundary_face_connectivity_count;
}

/* Returns the INSITU_CHANGED_* bits of the changes between two descriptions with equal numbers of cells and vertices.
 * Arrays with a new address or layout count as changed, because they have not been checked yet. */
static unsigned find_description_changes(const session_mesh *mesh, const insitu_mesh *b)
{
    const insitu_mesh *a = &mesh->original;
    bool has_same_cells =
        session_has_cell_type_map(mesh, b->cell_type_map_count, b->cell_types.data ? b->cell_type_map : NULL) &&
        session_is_same_array(&a->cell_types, &b->cell_types) &&
        session_is_same_array(&a->connectivity, &b->connectivity) && session_is_same_array(&a->offsets, &b->offsets) &&
        session_is_same_array(&a->ghosts, &b->ghosts) && session_is_same_array(&a->face_offsets, &b->face_offsets) &&
        session_is_same_array(&a->face_connectivity, &b->face_connectivity) &&
        session_is_same_array(&a->face_sizes, &b->face_sizes) &&
        session_is_same_array(&a->face_lists, &b->face_lists) && session_is_same_array(&a->owner, &b->owner) &&
        session_is_same_array(&a->neighbour, &b->neighbour) &&
        session_is_same_array(&a->boundary_owner, &b->boundary_owner) &&
        session_is_same_array(&a->boundary_face_offsets, &b->boundary_face_offsets) &&
        session_is_same_array(&a->boundary_face_connectivity, &b->boundary_face_connectivity);
    bool has_same_vertices = session_is_same_array(&a->vertex_ids, &b->vertex_ids);
    for (int axis = 0; axis < 3; axis++)
        has_same_vertices = has_same_vertices && session_is_same_array(&a->coordinates[axis], &b->coordinates[axis]);
    return (has_same_cells ? 0 : INSITU_CHANGED_TOPOLOGY) | (has_same_vertices ? 0 : INSITU_CHANGED_GEOMETRY) |
           session_lattice_changes(a->lattice, b->lattice);
}

/* ---- storing descriptions in the table of meshes ----------------------------------------------------------------- */

/* Called after the caller has set a new description, which is in mesh->given. If cells or coordinates have changed,
 * frees the finer lattices (session_finer.h). Otherwise makes the mesh read them again. */
static void reuse_or_drop_finer_lattices(session_mesh *mesh, unsigned changed)
{
    if (changed & (INSITU_CHANGED_TOPOLOGY | INSITU_CHANGED_GEOMETRY)) session_drop_finer_lattices(&mesh->finer);
    if (!mesh->finer.parts) return;
    mesh->finer.nodal = mesh->given;
    mesh->given = mesh->finer.fine;
}

void session_store_mesh(session_meshes *meshes, session_mesh *mesh, const insitu_mesh *given, base_error *error)
{
    unsigned changed = given->changed;
    if (!mesh->is_given || has_other_shape(&mesh->original, given)) changed = INSITU_CHANGED_ALL;
    const bool drops_fields = changed & INSITU_CHANGED_TOPOLOGY;
    const bool had_ids = mesh->original.vertex_ids.data, had_levels = session_has_refinement_level(&mesh->given);
    changed |= find_description_changes(mesh, given);
    if (changed & INSITU_CHANGED_GEOMETRY && (mesh->topology.depends_on_coordinates || mesh->finer.parts))
        changed |= INSITU_CHANGED_TOPOLOGY;
    if (session_allocate_converted_arrays(mesh, given, changed, error)) return;
    reuse_or_drop_finer_lattices(mesh, changed);
    if (drops_fields) {
        session_drop_fields(mesh);
        meshes->are_names_changed = true;
    }

    if (changed & INSITU_CHANGED_TOPOLOGY) {
        session_drop_cell_data(meshes, mesh);
        session_drop_moved_coordinates(mesh);
        base_free(mesh->covered);
        mesh->covered = NULL;
        meshes->are_levels_changed = meshes->are_levels_changed || had_levels || session_has_refinement_level(given);
    }
    if (had_ids != (given->vertex_ids.data != NULL) || had_levels != session_has_refinement_level(given))
        meshes->are_names_changed = true;
    if (changed & (INSITU_CHANGED_TOPOLOGY | INSITU_CHANGED_GEOMETRY)) {
        session_mark_moved(meshes, mesh);
        mesh->warp.is_stale = true;
    }
    session_copy_lattice(mesh);
    mesh->original.lattice = mesh->given.lattice;
    if (mesh->warp.is_applied) session_use_moved_coordinates(mesh);
    session_select_grid_arrays(mesh);
    mesh->is_given = true;
    mesh->problem = (base_error){0};
}

insitu_status session_prefix_error(base_error *error, const char *mesh, const char *field, const base_error *what)
{
    if (field) return base_fail(error, what->status, "mesh \"%s\": field \"%s\": %.700s", mesh, field, what->message);
    return base_fail(error, what->status, "mesh \"%s\": %.700s", mesh, what->message);
}

/* Removes the mesh of this name that has no blocks if a block is being set, and all blocks of this name if a mesh
 * without blocks is being set. */
static void remove_whole_mesh_or_blocks(session_meshes *meshes, const char *name, int64_t block)
{
    const session_parts parts = session_find_parts(meshes, name);
    if (parts.count && (parts.items[0]->block == SESSION_WHOLE) != (block == SESSION_WHOLE))
        session_remove_mesh(meshes, name);
}

static insitu_status set_mesh(session_meshes *meshes, const char *name, int64_t block, const insitu_mesh *given,
                              base_error *error)
{
    if (!given && block == SESSION_WHOLE) session_remove_mesh(meshes, name);
    if (!given) session_remove_block(meshes, name, block);
    if (!given) return INSITU_OK;
    remove_whole_mesh_or_blocks(meshes, name, block);
    session_mesh *mesh = session_find_block(meshes, name, block);
    if (!mesh) mesh = session_add_mesh(meshes, name, block, error);
    if (!mesh) return INSITU_ERROR_MEMORY;
    base_error what = {0};
    const bool had_levels = session_has_refinement_level(&mesh->given);
    if (check_mesh(given, &what) == INSITU_OK) session_store_mesh(meshes, mesh, given, &what);
    if (!what.status) return INSITU_OK;
    meshes->are_levels_changed = meshes->are_levels_changed || had_levels;
    session_drop_data_of_invalid_mesh(mesh);
    meshes->are_cells_changed = true;
    meshes->are_names_changed = true;
    mesh->problem = (base_error){0};
    mesh->is_problem_of_contents = false;
    session_prefix_error(&mesh->problem, mesh->label, NULL, &what);
    *error = mesh->problem;
    return error->status;
}

insitu_status session_set_mesh(session_meshes *meshes, const char *name, int64_t block, const insitu_mesh *given,
                               base_error *error)
{
    const char *call = block == SESSION_WHOLE ? "insitu_set_mesh" : "insitu_set_block";
    *error = (base_error){0};
    if (!name || !*name)
        base_fail(error, INSITU_ERROR_ARGUMENT, "%s: the mesh has no name", call);
    else if (block < 0 && block != SESSION_WHOLE)
        base_fail(error, INSITU_ERROR_ARGUMENT, "%s: mesh \"%s\": the number of the block is %lld, expected 0 or more",
                  call, name, (long long)block);
    if (error->status) {
        session_store_pending(meshes, error, NULL, NULL);
        return error->status;
    }
    const insitu_status status = set_mesh(meshes, name, block, given, error);
    if (status == INSITU_ERROR_MEMORY) session_store_pending(meshes, error, NULL, NULL);
    return status;
}
