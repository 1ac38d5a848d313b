/* Derived fields are computed one after the other, each after the fields on which it depends. The steps for one derived
 * field are:
 *     cells' values that are needed at vertices, and values at vertices of refined meshes  ->  session_recentre()
 *     an expression:  blocks of vertices or cells, each instruction for a whole block
 *     a gradient, or a quantity computed from one:  sums over the cells around each vertex and over all ranks
 *         (session_vertex_sums.h), over all meshes that share the field, so that blocks show no seam
 *
 * Derived values are stored in memory of the session, without gaps. They take 4 bytes each if all values on which they
 * depend have 4 bytes, else 8. A hash of the versions of the input values determines whether the derived values are up
 * to date; they are computed again if the hash has changed on any rank. */
#include "session_derive.h"

#include <omp.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_derived.h"
#include "session_field_input.h"
#include "session_hanging.h"
#include "session_hash.h"
#include "session_mirrors.h"
#include "session_recentre.h"
#include "session_region.h"
#include "session_scalars.h"
#include "session_tensor.h"
#include "session_vertex_sums.h"

enum { SPACE = 3 };

/* The data for computing one derived field. */
typedef struct derive_work {
    const session_derive_basis *basis;
    const scene_derived *derived;
    int derived_index;
    int recentring_count;
    session_recentring *recentrings;
    /* working memory, used twice: by session_recentre(), with one number per recentring of an input, and afterwards
     * with one number per mesh of the catalogue, which is nonzero if the derived values on the mesh are out of date on
     * some rank */
    int *stale;
} derive_work;

/* ---- meshes and inputs of a derived field ---------------------------------------------------------------------- */

/* Returns the catalogue's entry for the derived field on the mesh; NULL if the mesh does not have the field, or if the
 * field cannot be computed there because of an error (fault). */
static const session_catalogue_field *find_derived_field_of_mesh(const derive_work *w,
                                                                 const session_catalogue_mesh *mesh)
{
    for (int f = 0; f < mesh->field_count; f++)
        if (mesh->fields[f].derived_index == w->derived_index && !mesh->fields[f].fault && !mesh->fault)
            return &mesh->fields[f];
    return NULL;
}

/* Iterates over this rank's parts of a mesh that have the field:
 *     for (part_visit v = visit_parts(w, mesh); next_visited_part(w, &v);) use(v.part, v.field_index); */
typedef struct part_visit {
    session_parts parts;
    int next_index;
    session_mesh *part;
    int field_index; /* index of the field in the part's list of fields */
} part_visit;

static part_visit visit_parts(const derive_work *w, const session_catalogue_mesh *mesh)
{
    part_visit visit = {{0}, 0, NULL, 0};
    if (find_derived_field_of_mesh(w, mesh)) visit.parts = session_find_parts(w->basis->meshes, mesh->name);
    return visit;
}

static bool next_visited_part(const derive_work *w, part_visit *v)
{
    while (v->next_index < v->parts.count) {
        v->part = v->parts.items[v->next_index++];
        const bool is_own = v->part->is_given && !v->part->source;
        v->field_index = is_own ? session_find_field(v->part, w->derived->name) : -1;
        if (v->field_index >= 0) return true;
    }
    return false;
}

/* Returns the component of an input that the derived field uses: its index, or -1 for the magnitude
 * (grid_field.component). */
static int find_input_component(const scene_field *input, int component_count)
{
    return input->component == SCENE_COMPONENT_ONLY ? 0 : session_resolve_component(input, component_count);
}

/* Returns whether the input's values on the mesh must first be recentred: cell values, if the derived field has vertex
 * values; and vertex values on a mesh with levels of refinement, if gradients are computed from them, so that hanging
 * vertices get the values interpolated on coarser faces. */
static bool is_recentred(const derive_work *w, const session_catalogue_mesh *mesh, const scene_field *input)
{
    const session_catalogue_field *field = find_derived_field_of_mesh(w, mesh),
                                  *from = session_catalogue_find_field(mesh, input->name);
    if (!field || !from || field->centring == INSITU_CELL) return false;
    const bool is_expression = w->derived->kind == SCENE_EXPRESSION;
    return (from->centring == INSITU_CELL || !is_expression) &&
           session_is_recentred(input, from->centring, mesh->is_refined);
}

static uint64_t find_mesh_group_name(const session_catalogue_mesh *mesh, const scene_field *input)
{
    return session_find_group_name_of_mesh(mesh, input->mesh_group_name);
}

/* ---- values recentred to vertices -------------------------------------------------------------------------------- */

/* Adds a scalar to this rank's part of a mesh. The scalar will hold the input's values recentred to vertices. */
static bool add_recentred_scalar_to_part(const session_catalogue_mesh *mesh, session_mesh *part,
                                         const scene_field *input, int component)
{
    const int index = part->is_given ? session_find_field(part, input->name) : -1;
    const uint64_t mesh_group = find_mesh_group_name(mesh, input);
    if (index < 0 || session_find_recentred_scalar(part, input->name, component, mesh_group)) return true;
    session_scalar *scalar = session_add_scalar(part);
    if (!scalar) return false;
    scalar->field = index;
    scalar->component = component;
    scalar->is_recentred = true;
    scalar->mesh_group_name = mesh_group;
    scalar->original_values = session_get_caller_values(part, index, component);
    return true;
}

static bool add_recentred_scalar(const derive_work *w, const session_catalogue_mesh *mesh, const scene_field *input,
                                 int component)
{
    const session_parts parts = session_find_parts(w->basis->meshes, mesh->name);
    for (int i = 0; i < parts.count; i++)
        if (!add_recentred_scalar_to_part(mesh, parts.items[i], input, component)) return false;
    return true;
}

static bool plan_recentring_of_input(derive_work *w, const session_catalogue_mesh *mesh, const scene_field *input)
{
    if (!is_recentred(w, mesh, input)) return true;
    const int count = session_catalogue_find_field(mesh, input->name)->component_count;
    const int first = session_uses_gradient_of_vector_field(w->derived) ? 0 : find_input_component(input, count);
    const int end = session_uses_gradient_of_vector_field(w->derived) ? count : first + 1;
    session_mesh_group *mesh_group = session_find_mesh_group(w->basis->catalogue, find_mesh_group_name(mesh, input));
    bool is_done = mesh_group != NULL;
    for (int c = first; c < end && is_done; c++) {
        const session_recentring item = {mesh_group, input->name, c};
        is_done = session_add_recentring(&w->recentrings, &w->recentring_count, &item) &&
                  add_recentred_scalar(w, mesh, input, c);
    }
    return is_done;
}

static bool list_recentrings(derive_work *w)
{
    const session_catalogue *catalogue = w->basis->catalogue;
    for (int m = 0; m < catalogue->mesh_count; m++)
        for (int k = 0; k < w->derived->input_count; k++)
            if (!plan_recentring_of_input(w, &catalogue->meshes[m], &w->derived->inputs[k])) return false;
    const int most = w->recentring_count > catalogue->mesh_count ? w->recentring_count : catalogue->mesh_count;
    w->stale = base_calloc((size_t)most + 1, sizeof *w->stale);
    return w->stale != NULL;
}

/* ---- derived values that are out of date ------------------------------------------------------------------------- */

static session_scalar *find_recentred(const derive_work *w, const session_catalogue_mesh *mesh,
                                      const session_mesh *part, int input, int component)
{
    const scene_field *of = &w->derived->inputs[input];
    return is_recentred(w, mesh, of)
               ? session_find_recentred_scalar(part, of->name, component, find_mesh_group_name(mesh, of))
               : NULL;
}

/* Adds to the hash when the positions of vertices last changed on any rank, over all meshes whose gradients are
 * averaged with those of this mesh. It changes if a part with cells at a shared vertex is removed. The hash of the
 * remaining part's own data would not change then. */
static void hash_positions_of_mesh_group(const derive_work *w, const session_catalogue_mesh *mesh, uint64_t *hash)
{
    const session_mesh_group *mesh_group = session_find_mesh_group(
        w->basis->catalogue, session_find_group_name_of_mesh(mesh, w->derived->mesh_group_name));
    for (int i = 0; mesh_group && i < mesh_group->count; i++) {
        const session_catalogue_mesh *other = mesh_group->meshes[i];
        if (find_derived_field_of_mesh(w, other))
            session_hash_bytes(hash, &other->positions_hash, sizeof other->positions_hash);
    }
}

/* Returns a hash of all data that determine the derived values on one of this rank's parts. */
static uint64_t hash_versions_of_inputs(const derive_work *w, const session_catalogue_mesh *mesh,
                                        const session_mesh *part)
{
    uint64_t hash = SESSION_HASH_BEGIN;
    session_hash_bytes(&hash, &part->cells_stamp, sizeof part->cells_stamp);
    session_hash_bytes(&hash, &mesh->has_shells_alone, sizeof mesh->has_shells_alone);
    if (w->derived->kind != SCENE_EXPRESSION) hash_positions_of_mesh_group(w, mesh, &hash);
    for (int k = 0; k < w->derived->input_count; k++) {
        const int index = session_find_field(part, w->derived->inputs[k].name);
        const int count = index < 0 ? 0 : part->fields[index].given.component_count;
        if (index >= 0) session_hash_bytes(&hash, &part->fields[index].version, sizeof part->fields[index].version);
        for (int c = -1; c < count; c++) {
            const session_scalar *scalar = find_recentred(w, mesh, part, k, c);
            if (scalar) session_hash_bytes(&hash, &scalar->computed_count, sizeof scalar->computed_count);
        }
    }
    return hash | 1;
}

/* Finds the meshes on which the derived values are out of date on some rank, and stores them in w->stale. *error may
 * hold an earlier error of this rank. Collective; all ranks return the same status. */
static insitu_status find_stale_meshes(derive_work *w, base_error *error)
{
    const session_catalogue *catalogue = w->basis->catalogue;
    const int count = catalogue->mesh_count;
    for (int m = 0; m < count; m++) {
        w->stale[m] = 0;
        for (part_visit v = visit_parts(w, &catalogue->meshes[m]); next_visited_part(w, &v);)
            if (v.part->fields[v.field_index].inputs_hash != hash_versions_of_inputs(w, &catalogue->meshes[m], v.part))
                w->stale[m] = 1;
    }
    w->stale[count] = error->status != INSITU_OK;
    const MPI_Comm comm = w->basis->team->comm;
    const insitu_status status = session_check_mpi(
        error, MPI_Allreduce(MPI_IN_PLACE, w->stale, count + 1, MPI_INT, MPI_MAX, comm), "MPI_Allreduce");
    return status || !w->stale[count] ? status : session_agree(comm, error);
}

/* ---- input values and derived values on one part of a mesh ------------------------------------------------------- */

/* Returns the values of a component of an input, at vertices or in cells as the derived field requires. These are the
 * recentred values if is_recentred() holds, and otherwise the input's own values. component: index, or -1 for the
 * magnitude. */
static grid_field find_input_values(const derive_work *w, const session_catalogue_mesh *mesh, const session_mesh *part,
                                    int input, int component)
{
    const session_scalar *scalar = find_recentred(w, mesh, part, input, component);
    if (scalar) return session_get_scalar_values(part, scalar);
    return session_get_caller_values(part, session_find_field(part, w->derived->inputs[input].name), component);
}

static bool is_input_in_double(const session_mesh *part, const scene_field *input)
{
    const int index = session_find_field(part, input->name);
    return index >= 0 && part->fields[index].values.is_wide;
}

static int64_t count_values(const session_mesh *part, const session_field *field)
{
    return field->given.centring == INSITU_CELL ? part->cells.cell_count : session_vertex_count(part);
}

/* Allocates memory for the derived values of a field on one part of a mesh, unless the field already has memory of the
 * right size. */
static bool allocate_derived_values(const derive_work *w, session_mesh *part, session_field *field)
{
    bool is_wide = false;
    for (int k = 0; k < w->derived->input_count; k++)
        is_wide = is_wide || is_input_in_double(part, &w->derived->inputs[k]);
    const int64_t size = is_wide ? 8 : 4;
    const int64_t bytes = count_values(part, field) * field->given.component_count * size;
    if (!field->copy || field->copy_bytes != bytes) {
        session_drop_copy(field);
        field->copy = base_alloc((size_t)bytes);
        if (!field->copy) return false;
        field->copy_bytes = bytes;
    }
    field->values =
        (grid_array){.data = field->copy, .stride = size * field->given.component_count, .is_wide = is_wide};
    field->component_stride = size;
    return true;
}

static void store_tuple(const session_field *field, int64_t tuple, const double *values)
{
    const int count = field->given.component_count;
    for (int c = 0; c < count; c++)
        if (field->values.is_wide)
            ((double *)(void *)field->copy)[tuple * count + c] = values[c];
        else
            ((float *)(void *)field->copy)[tuple * count + c] = (float)values[c];
}

/* Records that the derived values have changed, so that scalars and fields that depend on them are computed again. */
static void mark_derived_values_changed(const derive_work *w, const session_catalogue_mesh *mesh, session_mesh *part,
                                        int index)
{
    session_mark_scalars_stale(part, index);
    part->fields[index].inputs_hash = hash_versions_of_inputs(w, mesh, part);
    part->fields[index].is_copy_stale = false;
    for (int i = 0; i < part->scalar_count; i++)
        if (part->scalars[i].field == index)
            part->scalars[i].original_values = session_get_caller_values(part, index, part->scalars[i].component);
}

/* ---- expressions ------------------------------------------------------------------------------------------------- */

static void load_block(const grid_field *field, int64_t first, int count, double *restrict out)
{
    const char *data = field->values.data + first * field->values.stride;
    const int64_t stride = field->values.stride;
    if (field->component < 0 || field->values.is_integer) {
        for (int i = 0; i < count; i++) out[i] = grid_field_value(field, first + i);
        return;
    }
    data += field->component * field->component_stride;
    if (field->values.is_wide)
        for (int i = 0; i < count; i++) out[i] = *(const double *)(const void *)(data + i * stride);
    else
        for (int i = 0; i < count; i++) out[i] = (double)*(const float *)(const void *)(data + i * stride);
}

/* A thread's buffers for evaluating an expression on one block of SCENE_BLOCK consecutive vertices or cells. */
typedef struct block_buffer {
    const double **inputs; /* for each input, pointer to its values on the block, within `values` */
    /* memory for the values of the inputs on the block, followed by the stack of the expression's program */
    double *values;
} block_buffer;

static bool block_buffers_create(const scene_derived *derived, int threads, block_buffer **out)
{
    const size_t inputs = (size_t)derived->input_count, rows = inputs + (size_t)derived->expression.depth;
    block_buffer *buffers = *out = base_calloc((size_t)threads, sizeof *buffers);
    for (int t = 0; t < threads && buffers; t++) {
        buffers[t].inputs = base_alloc(inputs * sizeof *buffers[t].inputs);
        buffers[t].values = base_alloc(rows * SCENE_BLOCK * sizeof *buffers[t].values);
        if (!buffers[t].inputs || !buffers[t].values) return false;
        for (size_t k = 0; k < inputs; k++) buffers[t].inputs[k] = buffers[t].values + k * SCENE_BLOCK;
    }
    return buffers != NULL;
}

static void block_buffers_free(block_buffer *buffers, int threads)
{
    for (int t = 0; t < threads && buffers; t++) {
        base_free(buffers[t].inputs);
        base_free(buffers[t].values);
    }
    base_free(buffers);
}

static void evaluate_expression_in_blocks(const scene_derived *derived, const grid_field *inputs,
                                          const block_buffer *buffers, const session_field *field, int64_t count,
                                          int threads)
{
    const int64_t blocks = (count + SCENE_BLOCK - 1) / SCENE_BLOCK;
#pragma omp parallel num_threads(session_choose_loop_threads(threads, count))
    {
        region_enter();
        const block_buffer *buffer = &buffers[omp_get_thread_num()];
        double *stack = buffer->values + (int64_t)derived->input_count * SCENE_BLOCK;
#pragma omp for schedule(dynamic, REGION_ITEMS / SCENE_BLOCK) nowait
        for (int64_t block = 0; block < blocks; block++) {
            const int64_t first = block * SCENE_BLOCK;
            const int size = count - first < SCENE_BLOCK ? (int)(count - first) : SCENE_BLOCK;
            for (int k = 0; k < derived->input_count; k++)
                load_block(&inputs[k], first, size, buffer->values + k * SCENE_BLOCK);
            scene_evaluate_expression(&derived->expression, buffer->inputs, size, stack);
            for (int i = 0; i < size; i++) store_tuple(field, first + i, stack + i);
        }
        region_leave();
    }
}

static bool compute_expression_on_part(const derive_work *w, const session_catalogue_mesh *mesh, session_mesh *part,
                                       int index)
{
    const int threads = w->basis->team->threads;
    session_field *field = &part->fields[index];
    block_buffer *buffers = NULL;
    grid_field *inputs = base_alloc((size_t)w->derived->input_count * sizeof *inputs);
    const bool is_done =
        inputs && block_buffers_create(w->derived, threads, &buffers) && allocate_derived_values(w, part, field);
    for (int k = 0; k < w->derived->input_count && is_done; k++) {
        const scene_field *input = &w->derived->inputs[k];
        const int count = part->fields[session_find_field(part, input->name)].given.component_count;
        inputs[k] = find_input_values(w, mesh, part, k, find_input_component(input, count));
    }
    if (is_done) evaluate_expression_in_blocks(w->derived, inputs, buffers, field, count_values(part, field), threads);
    block_buffers_free(buffers, threads);
    base_free(inputs);
    if (is_done) mark_derived_values_changed(w, mesh, part, index);
    return is_done;
}

static void compute_expressions(const derive_work *w, base_error *error)
{
    const session_catalogue *catalogue = w->basis->catalogue;
    for (int m = 0; m < catalogue->mesh_count; m++) {
        if (!w->stale[m]) continue;
        for (part_visit v = visit_parts(w, &catalogue->meshes[m]); next_visited_part(w, &v) && !error->status;)
            if (!compute_expression_on_part(w, &catalogue->meshes[m], v.part, v.field_index))
                session_fail_for_memory(error, count_values(v.part, &v.part->fields[v.field_index]) * 8,
                                        "a derived field");
    }
}

/* ---- quantities computed from gradients -------------------------------------------------------------------------- */

static int select_component(int component, const double vector[3], double *out)
{
    if (component == SCENE_COMPONENT_MAGNITUDE)
        out[0] = sqrt((vector[0] * vector[0] + vector[1] * vector[1]) + vector[2] * vector[2]);
    else if (component >= 0)
        out[0] = vector[component];
    else
        memcpy(out, vector, SPACE * sizeof *out);
    return component == SCENE_COMPONENT_DEFAULT ? SPACE : 1;
}

/* Computes the derived values at a vertex. gradient[c]: gradient, at this vertex, of the scalar c in the list of
 * list_scalars_with_gradients(). */
static void compute_values_from_gradient(const scene_derived *derived, const double gradient[SPACE][SPACE],
                                         double out[SPACE])
{
    double curl[SPACE];
    switch (derived->kind) {
    case SCENE_DIVERGENCE: out[0] = session_divergence(gradient); break;
    case SCENE_Q_CRITERION: out[0] = session_q_criterion(gradient); break;
    case SCENE_LAMBDA2: out[0] = session_lambda2(gradient); break;
    case SCENE_STRAIN_RATE: out[0] = session_strain_rate(gradient); break;
    case SCENE_VORTICITY:
        session_curl(gradient, curl);
        select_component(derived->component, curl, out);
        break;
    default: select_component(derived->component, gradient[0], out); break;
    }
}

static void store_values_from_gradients(const derive_work *w, const session_vertex_sums *sums,
                                        const session_sum_part *part, const session_field *field)
{
    const int words = session_count_sum_words(sums->field_count);
#pragma omp parallel num_threads(session_choose_loop_threads(w->basis->team->threads, part->mesh->cells.vertex_count))
    {
        region_enter();
#pragma omp for schedule(dynamic, REGION_ITEMS) nowait
        for (int64_t v = 0; v < part->mesh->cells.vertex_count; v++) {
            double gradient[SPACE][SPACE] = {{0}}, values[SPACE] = {(double)NAN, (double)NAN, (double)NAN};
            if (part->key_indices[v] >= 0) {
                session_compute_mean_gradients(sums->sums + (int64_t)part->key_indices[v] * words, sums->field_count,
                                               &sums->bounds, sums->length, gradient);
                compute_values_from_gradient(w->derived, (const double(*)[SPACE])gradient, values);
            }
            store_tuple(field, v, values);
        }
        region_leave();
    }
}

/* Lists the scalars whose gradients the derived field needs, and returns their number. The scalars are the 2 or 3
 * components of a vector field, or the inputs of the derived field if these are scalars. */
static int list_scalars_with_gradients(const derive_work *w, const session_catalogue_mesh *mesh,
                                       const session_mesh *part, grid_field out[SESSION_GRADIENTS])
{
    const scene_derived *derived = w->derived;
    const int first = session_find_field(part, derived->inputs[0].name);
    const int count = session_uses_gradient_of_vector_field(derived) ? part->fields[first].given.component_count
                                                                     : derived->input_count;
    for (int c = 0; c < count; c++)
        out[c] = find_input_values(
            w, mesh, part, session_uses_gradient_of_vector_field(derived) ? 0 : c,
            session_uses_gradient_of_vector_field(derived) ? c : find_input_component(&derived->inputs[c], 1));
    return count;
}

/* Returns the first mesh of the group on which the derived field can be computed. A vector has the same number of
 * components on all such meshes. */
static const session_catalogue_mesh *find_first_mesh_without_fault(const derive_work *w,
                                                                   const session_mesh_group *mesh_group)
{
    int i = 0;
    while (i < mesh_group->count && !find_derived_field_of_mesh(w, mesh_group->meshes[i])) i++;
    return i < mesh_group->count ? mesh_group->meshes[i] : NULL;
}

/* Returns the number of scalars whose gradients are computed. It is determined from the catalogue instead of this
 * rank's parts, because ranks that have no part of the meshes need it as well. */
static int count_scalars_with_gradients(const derive_work *w, const session_mesh_group *mesh_group)
{
    if (!session_uses_gradient_of_vector_field(w->derived)) return w->derived->input_count;
    return session_catalogue_find_field(find_first_mesh_without_fault(w, mesh_group), w->derived->inputs[0].name)
        ->component_count;
}

static insitu_status prepare_sums_of_gradients(const derive_work *w, const session_mesh_group *mesh_group,
                                               const session_mesh_group_parts *list, session_vertex_sums *sums,
                                               base_error *error)
{
    int at = 0;
    sums->parts = base_calloc((size_t)w->basis->meshes->count + 1, sizeof *sums->parts);
    if (!sums->parts) return session_fail_for_memory(error, w->basis->meshes->count * 100LL, "gradients at vertices");
    for (int m = 0; m < mesh_group->count; m++)
        for (part_visit v = visit_parts(w, mesh_group->meshes[m]); next_visited_part(w, &v);) {
            session_sum_part *part = &sums->parts[sums->part_count++];
            part->mesh = v.part;
            part->border = session_find_border_of_part(mesh_group, list, v.part, &at);
            part->of_shells = mesh_group->meshes[m]->has_shells_alone;
            list_scalars_with_gradients(w, mesh_group->meshes[m], v.part, part->fields);
            if (!allocate_derived_values(w, v.part, &v.part->fields[v.field_index]))
                return session_fail_for_memory(error, v.part->cells.vertex_count * 8, "a derived field");
        }
    return session_assign_keys_to_vertices(sums, error);
}

/* Computes the derived field from gradients on all meshes of a group. Collective. An error of this rank after the last
 * communication is only stored in *error. */
static insitu_status compute_field_on_mesh_group(const derive_work *w, session_mesh_group *mesh_group,
                                                 base_error *error)
{
    const session_team *team = w->basis->team;
    session_vertex_sums sums = {.by_id = mesh_group->by_id, .field_count = count_scalars_with_gradients(w, mesh_group)};
    session_mesh_group_parts list;
    insitu_status status = INSITU_OK;
    if (!session_list_mesh_group_parts(mesh_group, w->basis->meshes, &list))
        session_fail_for_memory(error, w->basis->meshes->count * 8LL, "gradients at vertices");
    if (session_merges_close_vertices(mesh_group)) status = session_update_borders(mesh_group, &list, team, error);
    if (!status && !error->status) prepare_sums_of_gradients(w, mesh_group, &list, &sums, error);
    if (!status) status = session_compute_vertex_sums(mesh_group->homes, team, w->basis->extent, &sums, error);
    int at = 0;
    for (int m = 0; m < mesh_group->count && !status && !error->status; m++)
        for (part_visit v = visit_parts(w, mesh_group->meshes[m]); next_visited_part(w, &v);) {
            store_values_from_gradients(w, &sums, &sums.parts[at++], &v.part->fields[v.field_index]);
            mark_derived_values_changed(w, mesh_group->meshes[m], v.part, v.field_index);
        }
    session_vertex_sums_free(&sums);
    session_mesh_group_parts_free(&list);
    return status;
}

static bool is_mesh_group_stale(const derive_work *w, const session_mesh_group *mesh_group)
{
    const session_catalogue *catalogue = w->basis->catalogue;
    bool is_stale = false;
    for (int i = 0; i < mesh_group->count; i++)
        is_stale = is_stale || w->stale[mesh_group->meshes[i] - catalogue->meshes];
    return is_stale;
}

/* Computes the derived field from gradients on each group of meshes on which the field exists and is out of date. */
static insitu_status compute_field_on_mesh_groups(const derive_work *w, base_error *error)
{
    const session_catalogue *catalogue = w->basis->catalogue;
    insitu_status status = INSITU_OK;
    for (int m = 0; m < catalogue->mesh_count && !status; m++) {
        const session_catalogue_mesh *mesh = &catalogue->meshes[m];
        session_mesh_group *mesh_group =
            find_derived_field_of_mesh(w, mesh)
                ? session_find_mesh_group(catalogue, session_find_group_name_of_mesh(mesh, w->derived->mesh_group_name))
                : NULL;
        if (mesh_group && find_first_mesh_without_fault(w, mesh_group) == mesh && is_mesh_group_stale(w, mesh_group))
            status = compute_field_on_mesh_group(w, mesh_group, error);
    }
    return status;
}

/* ---- computing one derived field --------------------------------------------------------------------------------- */

static insitu_status derive_field(derive_work *w, base_error *error)
{
    const session_derive_basis *b = w->basis;
    const bool is_expression = w->derived->kind == SCENE_EXPRESSION;
    if (!list_recentrings(w)) session_fail_for_memory(error, 1000, "the plan of derived fields");
    insitu_status status = session_agree(b->team->comm, error);
    if (!status && (!is_expression || w->recentring_count))
        status = session_update_home_ranks(b->catalogue, b->meshes, b->extent->half_diagonal, b->team, error);
    if (!status) status = session_recentre(w->recentrings, w->recentring_count, w->stale, b->meshes, b->team, error);
    if (!status) status = find_stale_meshes(w, error);
    if (!status && is_expression)
        compute_expressions(w, error);
    else if (!status)
        status = compute_field_on_mesh_groups(w, error);
    return status ? status : session_agree(b->team->comm, error);
}

insitu_status session_compute_derived(const session_derive_basis *basis, uint64_t needed, base_error *error)
{
    insitu_status status = INSITU_OK;
    for (int i = 0; i < basis->scene->derived_count && !status; i++) {
        if (!(needed >> i & 1)) continue;
        derive_work work = {.basis = basis, .derived = &basis->scene->derived[i], .derived_index = i};
        status = derive_field(&work, error);
        session_lend_derived_values_to_mirrors(basis->meshes, work.derived->name);
        base_free(work.recentrings);
        base_free(work.stale);
    }
    return status;
}
