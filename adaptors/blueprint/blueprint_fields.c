/* Reads fields, including ghost flags. On a lattice (structured grid) all vertex arrays must have the same strides, and
 * all cell arrays must have the same strides. The topology states the strides of vertex arrays; the first element field
 * states those of cell arrays. */
#include "blueprint_hash.h"
#include "blueprint_mesh.h"

#include <stdlib.h>
#include <string.h>

/* A field of the topology. */
typedef struct blueprint_field {
    node field_node, values_node;
    bool is_element;
    int64_t first;      /* index of the tuple of the first vertex or cell in the array */
    int64_t strides[3]; /* distance in tuples between neighbours along each axis of a lattice */
} blueprint_field;

/* The bits of vtkGhostType that hide a cell: duplicate, refined, hidden. Other bits only describe the cell. A cell in a
 * layer of ghost cells has at least one of VTK_LAYER_BITS. */
enum { VTK_HIDDEN_BITS = 1 | 8 | 32, VTK_LAYER_BITS = 1 | 32 };

/* ---- fields of a topology --------------------------------------------------------------------------------------- */

/* Checks whether state/metadata/vtk_fields declares the field as ghost flags. */
static bool is_declared_ghost_field(const node *domain, const char *name)
{
    node states, state;
    const char *attribute;
    if (!node_find(domain, "state/metadata/vtk_fields", &states) || !node_find(&states, name, &state)) return false;
    return node_has(&state, "attribute_type") && node_read_string(&state, "attribute_type", &attribute) &&
           strcmp(attribute, "Ghosts") == 0;
}

static bool is_ghost_field(const node *domain, const char *name)
{
    return strcmp(name, "vtkGhostType") == 0 || strcmp(name, "ascent_ghosts") == 0 ||
           is_declared_ghost_field(domain, name);
}

/* Checks whether the field belongs to the topology. Fields of other topologies are ignored even if they contain
 * errors. */
static bool belongs_to_topology(const node *field, const char *topology)
{
    const char *name;
    if (!node_read_string(field, "topology", &name)) return false;
    return strcmp(name, topology) == 0;
}

/* Finds the values and association of a field. Returns false if the field is invalid or left out. An invalid field sets
 * the error; a field that is left out is reported only if reports_left_out is set. */
static bool find_field(const node *field, blueprint_field *out, bool reports_left_out)
{
    const char *association;
    if (!node_has(field, "association") && node_has(field, "basis")) {
        if (reports_left_out) node_report_left_out(field, "basis", "fields by a basis are not read");
        return false;
    }
    if (!node_has(field, "values") && node_has(field, "matset_values")) {
        if (reports_left_out) node_report_left_out(field, "values", "values of materials alone are not read");
        return false;
    }
    if (!node_read_string(field, "association", &association)) return false;
    out->field_node = *field;
    out->is_element = strcmp(association, "element") == 0;
    if (!out->is_element && strcmp(association, "vertex") != 0)
        return node_set_error(field, "association", INSITU_ERROR_FIELD, "is \"%s\", expected vertex or element",
                              association);
    return node_require(&out->field_node, "values", &out->values_node);
}

/* Iterates over the fields of a topology. next_field() returns false after the last field, or if a field is invalid. */
typedef struct field_walk {
    const node *domain;
    const char *topology;
    bool reports_left_out; /* true if fields that are left out are reported */
    node fields, field;
    int64_t next;
    blueprint_field field_found;
} field_walk;

static bool next_field(field_walk *w)
{
    if (w->next == 0 && !node_find(w->domain, "fields", &w->fields)) return false;
    while (w->next < node_child_count(&w->fields)) {
        node_get_child(&w->fields, w->next++, &w->field);
        w->field_found = (blueprint_field){.first = 0};
        if (belongs_to_topology(&w->field, w->topology) && find_field(&w->field, &w->field_found, w->reports_left_out))
            return true;
        if (w->domain->log->status) return false;
    }
    return false;
}

/* ---- strides of structured grids -------------------------------------------------------------------------------- */

/* Computes the number of cells (if is_element) or vertices along each axis of the lattice; it is at least 1. */
static void get_element_counts(const blueprint_mesh *mesh, bool is_element, int64_t counts[3])
{
    for (int axis = 0; axis < 3; axis++) {
        const int64_t cells = mesh->lattice.cells[axis];
        counts[axis] = is_element ? (cells ? cells : 1) : cells + 1;
    }
}

/* Reads the field's offsets and strides. A field without strides has no padding between its elements. */
static bool read_strides(const blueprint_mesh *mesh, blueprint_field *field)
{
    int64_t counts[3], offsets[3] = {0, 0, 0};
    int count = 0;
    get_element_counts(mesh, field->is_element, counts);
    if (!mesh->mesh.lattice) {
        node_read_strides(NULL, NULL, counts, field->strides);
        return true;
    }
    node_read_integers(&field->field_node, "offsets", offsets, &count);
    node_read_strides(&field->field_node, "strides", counts, field->strides);
    for (int axis = 0; axis < 3; axis++) {
        if (field->strides[axis] < 1 || offsets[axis] < 0)
            return node_set_error(&field->field_node, field->strides[axis] < 1 ? "strides" : "offsets",
                                  INSITU_ERROR_FIELD, "has %lld",
                                  (long long)(field->strides[axis] < 1 ? field->strides : offsets)[axis]);
        field->first += offsets[axis] * field->strides[axis];
    }
    return !field->field_node.log->status;
}

/* Checks whether the strides a and b are equal along each axis that has more than one element (counts[axis] > 1). A
 * stride along another axis is never used. */
static bool have_same_strides(const int64_t counts[3], const int64_t a[3], const int64_t b[3])
{
    bool is_same = true;
    for (int axis = 0; axis < 3; axis++) is_same = is_same && (counts[axis] == 1 || a[axis] == b[axis]);
    return is_same;
}

/* Checks whether the field's strides are those of the mesh's vertices or cells. */
static bool has_mesh_strides(const blueprint_mesh *mesh, const blueprint_field *field)
{
    int64_t counts[3];
    if (!mesh->mesh.lattice) return true;
    get_element_counts(mesh, field->is_element, counts);
    return have_same_strides(counts, field->strides,
                             field->is_element ? mesh->lattice.cell_strides : mesh->lattice.vertex_strides);
}

/* Sets the cell strides of a lattice to those of its first element field. */
static void set_cell_strides(blueprint_mesh *mesh, const blueprint_field *field)
{
    int64_t counts[3];
    if (!mesh->mesh.lattice || mesh->has_cell_strides) return;
    get_element_counts(mesh, true, counts);
    memcpy(mesh->lattice.cell_strides, field->strides, sizeof field->strides);
    mesh->mesh.cell_count = blueprint_count_spanned_elements(counts, field->strides);
    mesh->has_cell_strides = true;
}

/* ---- arrays of components --------------------------------------------------------------------------------------- */

/* Stores in *out the array of one component of the field, beginning with the mesh's first vertex or cell. */
static bool read_component(const node *values, const blueprint_mesh *mesh, const blueprint_field *field,
                           insitu_array *out)
{
    node_array array;
    const int64_t needed = field->is_element ? mesh->mesh.cell_count : mesh->mesh.vertex_count;
    if (!node_read_array(values, &array)) return false;
    const bool is_whole = !mesh->mesh.lattice && array.count != needed;
    if (is_whole || array.count < field->first + needed)
        return node_set_error(values, "", INSITU_ERROR_FIELD, "has %lld elements, the topology has %lld %s%s",
                              (long long)array.count, (long long)needed, field->is_element ? "elements" : "vertices",
                              field->first ? ", after the field's offsets" : "");
    *out = array.array;
    if (out->data) out->data = (const char *)out->data + field->first * out->stride_bytes;
    return true;
}

/* ---- ghost flags ------------------------------------------------------------------------------------------------ */

/* Returns new flags of the mesh's cells, owned by the adaptor: 1 if the cell's entry in `flags` has a bit of the mask,
 * otherwise 0. Returns NULL if memory ran out. */
static unsigned char *make_flags(const node *of, blueprint_mesh *mesh, const insitu_array *flags, int64_t mask)
{
    unsigned char *own = owned_arrays_add(of, &mesh->owned, mesh->mesh.cell_count);
    for (int64_t i = 0; own && i < mesh->mesh.cell_count && flags->data; i++)
        own[i] = (node_get_element(flags, i) & mask) != 0;
    return own;
}

/* Returns the bitwise or of the flags of all cells whose indices are at least first[] and less than end[] along each
 * axis. */
static int64_t combine_flags(const insitu_array *flags, const int64_t strides[3], const int64_t first[3],
                             const int64_t end[3])
{
    int64_t any = 0;
    for (int64_t k = first[2]; k < end[2]; k++)
        for (int64_t j = first[1]; j < end[1]; j++)
            for (int64_t i = first[0]; i < end[0]; i++)
                any |= node_get_element(flags, i * strides[0] + j * strides[1] + k * strides[2]);
    return any;
}

/* Finds the bounding box of the cells in which no bit of the mask is set. If there is no such cell, the box is
 * empty. */
static void find_inner_cells(const insitu_array *flags, const int64_t strides[3], const int64_t counts[3], int64_t mask,
                             int64_t first[3], int64_t end[3])
{
    int64_t at[3];
    for (int axis = 0; axis < 3; axis++) {
        first[axis] = counts[axis];
        end[axis] = 0;
    }
    for (at[2] = 0; at[2] < counts[2]; at[2]++)
        for (at[1] = 0; at[1] < counts[1]; at[1]++)
            for (at[0] = 0; at[0] < counts[0]; at[0]++) {
                if (node_get_element(flags, at[0] * strides[0] + at[1] * strides[1] + at[2] * strides[2]) & mask)
                    continue;
                for (int axis = 0; axis < 3; axis++) {
                    if (at[axis] < first[axis]) first[axis] = at[axis];
                    if (at[axis] >= end[axis]) end[axis] = at[axis] + 1;
                }
            }
    for (int axis = 0; axis < 3 && end[0] == 0; axis++) first[axis] = end[axis] = counts[axis];
}

/* Returns the bitwise or of the flags of all cells, or, if the block has a level of refinement, of the cells in its
 * interior. In the second case, first excludes the ghost layers from the interior: these are the cells whose flags have
 * a bit of the mask. The block hides the coarser cells that its interior covers, and must not hide those that only its
 * ghost layers cover. */
static int64_t combine_ghost_flags_of_block(const insitu_array *flags, int64_t mask, blueprint_mesh *mesh)
{
    insitu_lattice *l = &mesh->lattice;
    int64_t counts[3], first[3], end[3], any = 0;
    if (!flags->data) return 0;
    if (mesh->has_level) {
        get_element_counts(mesh, true, counts);
        find_inner_cells(flags, l->cell_strides, counts, mask, first, end);
        memcpy(l->interior_first, first, sizeof first);
        memcpy(l->interior_end, end, sizeof end);
        return combine_flags(flags, l->cell_strides, first, end);
    }
    for (int64_t i = 0; i < mesh->mesh.cell_count; i++) any |= node_get_element(flags, i);
    return any;
}

static bool set_ghost_flags(const blueprint_field *field, blueprint_mesh *mesh)
{
    const bool is_ascent = strcmp(field->field_node.name, "ascent_ghosts") == 0;
    node_array array;
    insitu_array flags;
    if (!node_read_array(&field->values_node, &array)) return false;
    if (!node_is_integer_array(&array))
        return node_set_error(&field->values_node, "", INSITU_ERROR_FIELD,
                              "are no whole numbers, as flags of ghosts are");
    if (!read_component(&field->values_node, mesh, field, &flags)) return false;
    const int64_t any = combine_ghost_flags_of_block(&flags, is_ascent ? -1 : VTK_LAYER_BITS, mesh);
    mesh->mesh.ghosts = any ? flags : (insitu_array){0};
    if (is_ascent || !(any & ~(int64_t)VTK_HIDDEN_BITS)) return true;
    unsigned char *own = make_flags(&field->field_node, mesh, &flags, VTK_HIDDEN_BITS);
    if (!own) return false;
    node_report_copy(&field->field_node, "values", mesh->mesh.cell_count, "the flags that hide a cell");
    mesh->mesh.ghosts = (insitu_array){own, INSITU_UINT8, 0};
    return true;
}

/* Reads a window of a nestset, which is the range of this domain's cells that another domain covers: the cells first[]
 * to end[] - 1 along each axis. *fits is set to whether this range lies in the domain. */
static bool read_window(const node *window, const blueprint_mesh *mesh, int64_t first[3], int64_t end[3], bool *fits)
{
    static const char *const origins[3] = {"origin/i", "origin/j", "origin/k"};
    static const char *const dims[3] = {"dims/i", "dims/j", "dims/k"};
    int64_t counts[3];
    get_element_counts(mesh, true, counts);
    *fits = true;
    for (int axis = 0; axis < 3; axis++) {
        int64_t count = 1;
        first[axis] = 0;
        if (!node_read_integer(window, origins[axis], axis == 0, &first[axis])) return false;
        if (!node_read_integer(window, dims[axis], axis == 0, &count)) return false;
        *fits = *fits && first[axis] >= 0 && count >= 0 && count <= counts[axis] && first[axis] <= counts[axis] - count;
        end[axis] = first[axis] + count;
    }
    return true;
}

static void set_flags_of_cell_range(const int64_t strides[3], const int64_t first[3], const int64_t end[3],
                                    unsigned char *flags)
{
    for (int64_t k = first[2]; k < end[2]; k++)
        for (int64_t j = first[1]; j < end[1]; j++)
            for (int64_t i = first[0]; i < end[0]; i++) flags[i * strides[0] + j * strides[1] + k * strides[2]] = 1;
}

/* Sets the ghost flags of the cells that finer domains cover, according to the windows of the nestset. Windows that do
 * not fit the domain are left out, because some codes write windows as ranges of vertices, or in the indices of another
 * level. */
static bool flag_covered_cells(const node *nestset, blueprint_mesh *mesh)
{
    node windows, window;
    const char *kind;
    unsigned char *flags = NULL;
    int64_t first[3], end[3];
    bool fits;
    if (!node_require(nestset, "windows", &windows)) return false;
    for (int64_t i = 0; i < node_child_count(&windows); i++) {
        node_get_child(&windows, i, &window);
        if (!node_read_string(&window, "domain_type", &kind)) return false;
        if (strcmp(kind, "child") != 0) continue;
        if (!read_window(&window, mesh, first, end, &fits)) return false;
        if (!fits) {
            node_report_left_out(&window, "",
                                 "is not within the domain's own cells: the cells that a child covers are drawn too");
            continue;
        }
        if (!flags) flags = make_flags(nestset, mesh, &mesh->mesh.ghosts, -1);
        if (!flags) return false;
        set_flags_of_cell_range(mesh->lattice.cell_strides, first, end, flags);
    }
    if (!flags) return true;
    node_report_copy(nestset, "windows", mesh->mesh.cell_count, "flags of the cells that other domains refine");
    mesh->mesh.ghosts = (insitu_array){flags, INSITU_UINT8, 0};
    return true;
}

static bool read_nestsets(const node *domain, const char *topology, blueprint_mesh *mesh)
{
    node nestsets, nestset;
    /* for blocks with levels of refinement, the session itself finds the covered cells */
    if (!mesh->mesh.lattice || mesh->has_level || !node_find(domain, "nestsets", &nestsets)) return true;
    for (int64_t i = 0; i < node_child_count(&nestsets); i++) {
        node_get_child(&nestsets, i, &nestset);
        if (belongs_to_topology(&nestset, topology) && !flag_covered_cells(&nestset, mesh)) return false;
        if (domain->log->status) return false;
    }
    return true;
}

bool blueprint_read_ghosts(const node *domain, const char *topology, blueprint_mesh *mesh)
{
    for (field_walk w = {.domain = domain, .topology = topology}; next_field(&w);) {
        if (!w.field_found.is_element) continue;
        if (!read_strides(mesh, &w.field_found)) return false;
        set_cell_strides(mesh, &w.field_found);
        if (has_mesh_strides(mesh, &w.field_found) && is_ghost_field(domain, w.field.name) &&
            !set_ghost_flags(&w.field_found, mesh))
            return false;
        if (domain->log->status) return false;
    }
    return !domain->log->status && read_nestsets(domain, topology, mesh);
}

/* ---- values of fields ------------------------------------------------------------------------------------------- */

/* Returns a new list of the arrays of the field's components; the caller must free the list. Returns NULL on an
 * error. */
static insitu_array *read_values(const blueprint_field *field, const blueprint_mesh *mesh, int *count)
{
    const int64_t children = node_child_count(&field->values_node);
    *count = children ? (int)children : 1;
    insitu_array *out = calloc((size_t)*count, sizeof *out);
    bool is_read = out != NULL;
    if (!out) node_set_error(&field->values_node, "", INSITU_ERROR_MEMORY, "no memory for %d components", *count);
    if (out && !children) is_read = read_component(&field->values_node, mesh, field, out);
    for (int i = 0; i < children && is_read; i++) {
        node component;
        node_get_child(&field->values_node, i, &component);
        is_read = read_component(&component, mesh, field, &out[i]);
    }
    if (is_read) return out;
    free(out);
    return NULL;
}

static bool set_field(const blueprint_field *field, const blueprint_mesh *mesh, const mesh_target *target)
{
    insitu_field given;
    int components;
    insitu_array *values = read_values(field, mesh, &components);
    if (!values) return false;
    insitu_field_defaults(&given);
    given.name = field->field_node.name;
    given.centring = field->is_element ? INSITU_CELL : INSITU_VERTEX;
    given.count = field->is_element ? mesh->mesh.cell_count : mesh->mesh.vertex_count;
    given.component_count = components;
    if (components == 1)
        given.values = values[0];
    else
        given.components = values;
    const insitu_status status = target->number == WHOLE_MESH
                                     ? insitu_set_field(target->session, target->name, &given)
                                     : insitu_set_block_field(target->session, target->name, target->number, &given);
    free(values);
    return !status || node_set_error(&field->field_node, "", status, "%s", insitu_error(target->session));
}

/* Finds the next field that can be drawn on the mesh. Returns false after the last field, or if a field is invalid. */
static bool find_next_drawn_field(field_walk *w, const blueprint_mesh *mesh)
{
    while (next_field(w)) {
        blueprint_field *field = &w->field_found;
        const bool is_flags = is_ghost_field(w->domain, w->field.name);
        if (is_flags && !field->is_element && w->reports_left_out)
            node_report_left_out(&w->field, "values", "ghosts at vertices are not read");
        if (is_flags) continue;
        if (!read_strides(mesh, field)) return false;
        if (has_mesh_strides(mesh, field)) return true;
        if (w->reports_left_out)
            node_report_left_out(&w->field, "strides", "has other strides than the %s of the topology",
                                 field->is_element ? "other element fields" : "vertices");
    }
    return false;
}

uint64_t blueprint_hash_fields(const node *domain, const char *topology, const blueprint_mesh *mesh)
{
    uint64_t sum = 0;
    for (field_walk w = {.domain = domain, .topology = topology}; find_next_drawn_field(&w, mesh);) {
        const int64_t components = node_child_count(&w.field_found.values_node);
        const uint64_t shape = 2 * (uint64_t)(components ? components : 1) + w.field_found.is_element;
        sum += blueprint_mix_hash(blueprint_hash_text(w.field.name), shape);
    }
    return sum;
}

bool blueprint_set_fields(const node *domain, const char *topology, const blueprint_mesh *mesh,
                          const mesh_target *target, int *count)
{
    for (field_walk w = {.domain = domain, .topology = topology, .reports_left_out = true};
         find_next_drawn_field(&w, mesh);) {
        if (!set_field(&w.field_found, mesh, target)) return false;
        ++*count;
    }
    return !domain->log->status;
}
