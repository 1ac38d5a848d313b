#include "session_surfaces.h"

#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_covers.h"
#include "session_outer_faces.h"
#include "session_outer_mesh.h"
#include "session_smooth.h"
#include "session_thresholds.h"

/* A mesh whose outer faces a layer shows, and the layer's threshold. This rank may have no part of the mesh. */
typedef struct surface_request {
    const session_catalogue_mesh *mesh;
    const scene_threshold *threshold;
} surface_request;

/* Returns the part's outer surface for the threshold of the request; NULL if the part has none. */
static session_outer *find_outer_surface_of_part(const session_mesh *part, const surface_request *request)
{
    return part->is_given ? session_find_outer_surface(part, request->threshold) : NULL;
}

/* Returns whether the outer faces of any of this rank's parts are out of date. */
static bool are_faces_stale(const session_meshes *meshes, const surface_request *request)
{
    const session_parts parts = session_find_parts(meshes, request->mesh->name);
    for (int i = 0; i < parts.count; i++) {
        const session_outer *outer = find_outer_surface_of_part(parts.items[i], request);
        if (outer && session_are_outer_faces_stale(parts.items[i], outer)) return true;
    }
    return false;
}

static bool is_same_threshold(const scene_threshold *a, const scene_threshold *b)
{
    if (!a->is_given || !b->is_given) return a->is_given == b->is_given;
    return strcmp(a->field.name, b->field.name) == 0 && a->field.component == b->field.component && a->low == b->low &&
           a->high == b->high;
}

static int add_surface_request(surface_request *requests, int count, const surface_request *request)
{
    for (int i = 0; i < count; i++)
        if (requests[i].mesh == request->mesh && is_same_threshold(requests[i].threshold, request->threshold))
            return count;
    requests[count] = *request;
    return count + 1;
}

/* Lists the outer surfaces that an image's layers show, with their meshes. Returns the new length of the list. */
static int list_image_requests(const scene_image *image, const session_catalogue *catalogue, surface_request *requests,
                               int count)
{
    static const scene_threshold none = {.is_given = false};
    for (int m = 0; m < catalogue->mesh_count; m++) {
        const session_catalogue_mesh *mesh = &catalogue->meshes[m];
        for (int n = 0; n < image->surface_count; n++) {
            const surface_request request = {mesh, &image->surfaces[n].threshold};
            if (scene_field_selects_mesh(&image->surfaces[n].meshes_field, mesh->name))
                count = add_surface_request(requests, count, &request);
        }
        for (int n = 0; n < image->isosurface_count && mesh->has_shells_alone; n++) {
            const scene_field *field = &image->isosurfaces[n].field;
            const bool is_on =
                scene_field_selects_mesh(field, mesh->name) && session_catalogue_find_field(mesh, field->name);
            if (is_on) count = add_surface_request(requests, count, &(surface_request){mesh, &none});
        }
    }
    return count;
}

/* Lists the outer surfaces of all images, in the same order on all ranks. Returns their number. */
static int list_requests(const session_plan *plan, const session_catalogue *catalogue, surface_request *requests)
{
    int count = 0;
    for (int i = 0; i < plan->image_count; i++)
        if (plan->images[i]->variant.view == 0)
            count = list_image_requests(plan->images[i], catalogue, requests, count);
    return count;
}

/* Determines which outer faces are out of date on some rank. If *error of any rank already holds an error, all ranks
 * return this error. Collective. */
static insitu_status find_stale_surfaces(const session_meshes *meshes, const surface_request *requests, int count,
                                         const session_team *team, int *stale, bool *is_any, base_error *error)
{
    /* first entry: nonzero if this rank has an error; second entry: nonzero if the outer faces of a surface are out of
     * date on this rank */
    int own[2] = {error->status != INSITU_OK, 0}, all[2] = {0, 0};
    for (int i = 0; i < count; i++) {
        stale[i] = are_faces_stale(meshes, &requests[i]);
        own[1] = own[1] || stale[i];
    }
    insitu_status status =
        session_check_mpi(error, MPI_Allreduce(own, all, 2, MPI_INT, MPI_MAX, team->comm), "MPI_Allreduce");
    if (!status && all[0]) status = session_agree(team->comm, error);
    *is_any = all[1];
    if (status || !all[1]) return status;
    return session_check_mpi(error, MPI_Allreduce(MPI_IN_PLACE, stale, count, MPI_INT, MPI_MAX, team->comm),
                             "MPI_Allreduce");
}

static insitu_status find_outer_faces_of_request(const session_meshes *meshes, const surface_request *request,
                                                 const session_team *team, base_error *error)
{
    const session_parts parts = session_find_parts(meshes, request->mesh->name);
    int count = 0;
    session_face_part *of = base_calloc((size_t)parts.count + 1, sizeof *of);
    if (!of) session_fail_for_memory(error, parts.count * (int64_t)sizeof *of, "surfaces");
    for (int i = 0; i < parts.count && of; i++) {
        session_outer *outer = find_outer_surface_of_part(parts.items[i], request);
        if (outer) of[count++] = (session_face_part){.mesh = parts.items[i], .outer = outer};
    }
    insitu_status status = session_agree(team->comm, error);
    if (!status) status = session_find_outer_faces(of, count, &request->mesh->homes, team, error);
    if (!status && !error->status) session_drop_faces_between_levels(meshes, of, count, error);
    for (int i = 0; i < count && !status && !error->status; i++)
        session_mark_outer_faces_current(of[i].mesh, of[i].outer);
    base_free(of);
    return status ? status : session_agree(team->comm, error);
}

/* Makes the mesh of outer faces ready to be drawn: fills the members that its trees and kernels need, and marks the
 * mesh as needed. Each cell of this mesh lies behind one outer face. */
static insitu_status prepare_outer_mesh(const session_mesh *mesh, session_outer *outer, bool has_normals,
                                        base_error *error)
{
    const insitu_status status = session_make_outer_mesh(mesh, outer, has_normals, error);
    if (status) return status;
    outer->mesh->is_needed = true;
    outer->mesh->scalars[0].is_used = outer->mesh->scalars[0].needs_ranges = true;
    outer->mesh->scalars[0].needs_all_cells = true;
    return INSITU_OK;
}

static void make_needed_outer_meshes(const session_meshes *meshes, bool have_normals, base_error *error)
{
    for (int i = 0; i < meshes->count; i++) {
        const session_mesh *mesh = meshes->items[i];
        for (int k = 0; k < mesh->outer_count && !error->status; k++)
            if (mesh->outers[k]->is_needed && mesh->outers[k]->are_faces_known)
                prepare_outer_mesh(mesh, mesh->outers[k], have_normals, error);
    }
}

insitu_status session_update_surfaces(const session_plan *plan, const session_catalogue *catalogue,
                                      const session_meshes *meshes, const session_team *team, base_error *error)
{
    const size_t most = (size_t)plan->surface_count * (size_t)catalogue->mesh_count;
    int count = 0, *stale = base_calloc(most, sizeof *stale);
    surface_request *requests = base_calloc(most, sizeof *requests);
    bool is_any = false;
    if (!stale || !requests)
        session_fail_for_memory(error, (int64_t)(most * (sizeof *stale + sizeof *requests)), "surfaces");
    else
        count = list_requests(plan, catalogue, requests);
    insitu_status status = find_stale_surfaces(meshes, requests, count, team, stale, &is_any, error);
    for (int i = 0; i < count && !status && is_any; i++)
        if (stale[i]) status = find_outer_faces_of_request(meshes, &requests[i], team, error);
    base_free(stale);
    base_free(requests);
    if (!status) make_needed_outer_meshes(meshes, session_has_curved_faces(catalogue), error);
    return status;
}
