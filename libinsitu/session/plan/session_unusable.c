#include "session_unusable.h"

#include "memory.h"
#include "session_agree.h"
#include "session_hash.h"
#include "session_scalars.h"

/* Iterator over the fields of the plan's isosurfaces and volumes, and over the fields that colour slices and surfaces.
 * Views of an image have the same layers, so that only the first view is visited. */
typedef struct field_walk {
    const session_plan *plan;
    int image; /* index of the image whose fields are visited next */
    scene_field_walk fields;
    /* set if the current field colours a slice or a surface; cells with values that are not finite are then drawn, but
     * have no colour */
    bool is_of_colours;
} field_walk;

static const scene_field *next_field(field_walk *walk)
{
    for (;;) {
        const scene_field *field = walk->fields.image ? scene_find_next_field_of_layers(&walk->fields) : NULL;
        const scene_field_role role = walk->fields.role;
        walk->is_of_colours = role == SCENE_COLOURS || walk->fields.kind == SCENE_SLICE;
        if (field && (role == SCENE_SHOWN || role == SCENE_COLOURS)) return field;
        if (field) continue;
        if (walk->image == walk->plan->image_count) return NULL;
        const scene_image *image = walk->plan->images[walk->image++];
        walk->fields = (scene_field_walk){.image = image->variant.view > 0 ? NULL : image};
    }
}

static int64_t count_unusable_cells(const session_mesh *mesh, const scene_field *field, bool is_of_colours, int threads)
{
    session_scalar *scalar = mesh->is_given && !mesh->source ? session_find_scalar(mesh, field) : NULL;
    if (!scalar) return 0;
    return is_of_colours ? session_count_uncoloured_cells(mesh, scalar, threads)
                         : session_count_unusable_cells(mesh, scalar);
}

static int64_t count_unusable_cells_of_parts(const session_meshes *meshes, const char *name, const scene_field *field,
                                             bool is_of_colours, int threads)
{
    const session_parts parts = session_find_parts(meshes, name);
    int64_t sum = 0;
    for (int i = 0; i < parts.count; i++) sum += count_unusable_cells(parts.items[i], field, is_of_colours, threads);
    return sum;
}

static bool has_unusable_cells(const session_mesh *mesh, const scene_field *field, bool is_of_colours, int threads)
{
    double low, high;
    session_scalar *scalar = mesh->is_given && !mesh->source ? session_find_scalar(mesh, field) : NULL;
    if (!scalar || !is_of_colours) return scalar && scalar->unusable_count;
    session_find_scalar_extent(mesh, scalar, threads, SESSION_SEEN, &low, &high);
    return scalar->extremes[SESSION_SEEN].unusable_count > 0;
}

uint64_t session_hash_unusable_fields(const session_plan *plan, const session_meshes *meshes, int threads)
{
    uint64_t key = 0;
    field_walk walk = {.plan = plan};
    for (const scene_field *field; (field = next_field(&walk)) != NULL;)
        for (int m = 0; m < meshes->count; m++) {
            const session_mesh *mesh = meshes->items[m];
            if (!has_unusable_cells(mesh, field, walk.is_of_colours, threads)) continue;
            if (!key) key = SESSION_HASH_BEGIN;
            session_hash_text(&key, mesh->name);
            session_hash_text(&key, field->name);
            session_hash_bytes(&key, &field->component, sizeof field->component);
            session_hash_bytes(&key, &walk.is_of_colours, sizeof walk.is_of_colours);
        }
    return key;
}

static void warn_of_unusable_cells(const char *mesh, const scene_field *field, int64_t count, session_report *report)
{
    session_warn(report, &(session_warning){WARNING_UNUSABLE, field->name, mesh, field->component}, count > 0,
                 "mesh \"%s\": %lld cells are not drawn: values of field \"%s\" are not finite", mesh, (long long)count,
                 field->name);
}

/* The count includes cells that the picture does not show, such as those inside a surface, because only drawing would
 * tell them apart. If warn_of_unusable_cells() has warned of the same values, a second warning would say nothing new.
 */
static void warn_of_uncoloured_cells(const char *mesh, const scene_field *field, int64_t count, session_report *report)
{
    const session_warning unusable = {WARNING_UNUSABLE, field->name, mesh, field->component};
    session_warn(report, &(session_warning){WARNING_UNCOLOURED, field->name, mesh, field->component},
                 count > 0 && !session_has_reported_warning(report, &unusable),
                 "mesh \"%s\": values of field \"%s\" are not finite in %lld cells: where the picture shows them, they "
                 "have the colour `nan`",
                 mesh, field->name, (long long)count);
}

/* Warns of the plan's fields that colour slices and surfaces, or of the others. counts: memory for one number for each
 * mesh of the catalogue. Collective. */
static insitu_status warn_of_fields(const session_plan *plan, bool is_of_colours, const session_catalogue *catalogue,
                                    const session_meshes *meshes, const session_team *team, int64_t *counts,
                                    session_report *report, base_error *error)
{
    const int mesh_count = catalogue->mesh_count;
    insitu_status status = INSITU_OK;
    field_walk walk = {.plan = plan};
    for (const scene_field *field; !status && (field = next_field(&walk)) != NULL;) {
        if (walk.is_of_colours != is_of_colours) continue;
        for (int m = 0; m < mesh_count; m++)
            counts[m] =
                count_unusable_cells_of_parts(meshes, catalogue->meshes[m].name, field, is_of_colours, team->threads);
        const int code = MPI_Allreduce(MPI_IN_PLACE, counts, mesh_count, MPI_INT64_T, MPI_SUM, team->comm);
        status = session_check_mpi(error, code, "MPI_Allreduce");
        for (int m = 0; m < mesh_count && !status; m++)
            (is_of_colours ? warn_of_uncoloured_cells : warn_of_unusable_cells)(catalogue->meshes[m].name, field,
                                                                                counts[m], report);
    }
    return status;
}

insitu_status session_warn_of_unusable_cells(const session_plan *plan, const session_catalogue *catalogue,
                                             const session_meshes *meshes, const session_team *team,
                                             session_report *report, base_error *error)
{
    const int mesh_count = catalogue->mesh_count;
    int64_t *counts = base_alloc((size_t)(mesh_count + 1) * sizeof *counts);
    if (!counts) session_fail_for_memory(error, (mesh_count + 1) * (int64_t)sizeof *counts, "counts of cells");
    insitu_status status = session_agree(team->comm, error);
    /* colours come second, because their warning depends on that of the others */
    if (!status) status = warn_of_fields(plan, false, catalogue, meshes, team, counts, report, error);
    if (!status) status = warn_of_fields(plan, true, catalogue, meshes, team, counts, report, error);
    base_free(counts);
    if (!status) report->unusable_key = session_hash_unusable_fields(plan, meshes, team->threads);
    return status;
}
