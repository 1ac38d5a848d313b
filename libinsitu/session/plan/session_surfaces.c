#include "session_surfaces.h"

#include "memory.h"
#include "session_agree.h"
#include "session_outer_faces.h"
#include "session_outer_mesh.h"

static bool is_wanted(const session_plan *plan, const char *mesh)
{
    for (int i = 0; i < plan->image_count; i++)
        for (int n = 0; n < plan->images[i]->surface_count; n++)
            if (scene_field_is_on(&plan->images[i]->surfaces[n].on, mesh)) return true;
    return false;
}

/* This rank's part; NULL: it has none. */
static session_mesh *find_part(const session_meshes *meshes, const char *name)
{
    session_mesh *mesh = session_find_mesh(meshes, name);
    return mesh && mesh->is_given ? mesh : NULL;
}

/* The meshes whose faces are not known on some rank. Collective. */
static insitu_status find_stale(const session_plan *plan, const session_catalogue *catalogue,
                                const session_meshes *meshes, const session_team *team, int *stale, base_error *error)
{
    for (int m = 0; m < catalogue->mesh_count; m++) {
        const session_mesh *mesh = find_part(meshes, catalogue->meshes[m].name);
        stale[m] = mesh && is_wanted(plan, mesh->name) && !mesh->outer.are_faces_known;
    }
    return session_mpi(error, MPI_Allreduce(MPI_IN_PLACE, stale, catalogue->mesh_count, MPI_INT, MPI_MAX, team->comm),
                       "MPI_Allreduce");
}

/* All cells of it have a face that is drawn. */
static insitu_status make_ready(session_mesh *mesh, base_error *error)
{
    const insitu_status status = session_make_outer_mesh(mesh, error);
    if (status) return status;
    session_mesh *outer = mesh->outer.mesh;
    outer->is_needed = true;
    outer->scalars[0].is_used = outer->scalars[0].wants_ranges = outer->scalars[0].needs_all = true;
    return INSITU_OK;
}

static void make_meshes(const session_meshes *meshes, base_error *error)
{
    for (int i = 0; i < meshes->count && !error->status; i++) {
        session_mesh *mesh = meshes->items[i];
        if (mesh->is_outer_wanted && mesh->outer.are_faces_known) make_ready(mesh, error);
    }
}

insitu_status session_update_surfaces(const session_plan *plan, const session_catalogue *catalogue,
                                      const session_meshes *meshes, const session_team *team, double half_diagonal,
                                      base_error *error)
{
    const size_t count = (size_t)catalogue->mesh_count;
    int *stale = base_calloc(count, sizeof *stale);
    if (!stale) session_no_memory(error, (int64_t)(count * sizeof *stale), "flags");
    insitu_status status = session_agree(team->comm, error);
    if (!status) status = find_stale(plan, catalogue, meshes, team, stale, error);
    for (size_t m = 0; m < count && !status; m++) {
        const session_catalogue_mesh *of = &catalogue->meshes[m];
        if (stale[m])
            status = session_find_outer_faces(find_part(meshes, of->name), of->has_ids, half_diagonal, team, error);
    }
    base_free(stale);
    if (status) return status;
    make_meshes(meshes, error);
    return session_agree(team->comm, error);
}
