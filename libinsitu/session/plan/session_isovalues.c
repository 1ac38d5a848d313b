#include "session_isovalues.h"

#include <math.h>

#include "session_agree.h"
#include "session_scalars.h"

/* The least value and the greatest negated, so that one minimum finds both. */
typedef struct field_range {
    double low, minus_high;
} field_range;

static const field_range no_range = {INFINITY, INFINITY};

static bool is_outside(double value, const field_range *range)
{
    return value < range->low || value > -range->minus_high;
}

/* Takes the range at the root of the tree, which holds all that shows. */
static void take_root(const session_mesh *mesh, const session_scalar *scalar, field_range *range)
{
    if (!mesh->is_needed || !mesh->has_tree || mesh->tree.node_count == 0) return;
    const mmbvh_ranges root = session_scalar_ranges(mesh, scalar);
    range->low = fmin(range->low, (double)*(const float *)(const void *)root.low);
    range->minus_high = fmin(range->minus_high, -(double)*(const float *)(const void *)root.high);
}

static void take_extent(const session_mesh *mesh, session_scalar *scalar, int threads, field_range *range)
{
    double low, high;
    session_scalar_extent(mesh, scalar, threads, false, &low, &high);
    range->low = fmin(range->low, low);
    range->minus_high = fmin(range->minus_high, -high);
}

static field_range own_range(const session_meshes *meshes, const scene_field *field, int threads, bool of_all_cells)
{
    field_range range = no_range;
    for (int i = 0; i < meshes->count; i++) {
        const session_mesh *mesh = meshes->items[i];
        session_scalar *scalar = mesh->is_given ? session_find_scalar(mesh, field) : NULL;
        if (scalar && of_all_cells) take_extent(mesh, scalar, threads, &range);
        if (scalar && !of_all_cells) take_root(mesh, scalar, &range);
    }
    return range;
}

/* An isosurface among the plan's. */
typedef struct planned_surface {
    const scene_image *image;
    const scene_isosurface *layer;
    int first_value; /* values of the image's earlier layers */
    field_range range;
    bool is_news; /* a value lies outside the trees' ranges, and no warning has said so yet */
} planned_surface;

/* In a sweep over isovalues each picture has one, whose number is that in the file. */
static session_warning isovalue_warning(const planned_surface *s, int value)
{
    return (session_warning){WARNING_ISOVALUE, s->image->name, NULL,
                             s->first_value + value + s->image->variant.isovalue};
}

/* Views and fields of one image have the same isosurfaces. */
static bool is_listed(const scene_image *image)
{
    return image->variant.view == 0 && image->variant.field == 0;
}

static int list_surfaces(const session_plan *plan, planned_surface *out)
{
    int count = 0;
    for (int i = 0; i < plan->image_count; i++) {
        const scene_image *image = plan->images[i];
        if (!is_listed(image)) continue;
        for (int n = 0, values = 0; n < image->isosurface_count; n++) {
            out[count++] = (planned_surface){image, &image->isosurfaces[n], values, no_range, false};
            values += image->isosurfaces[n].value_count;
        }
    }
    return count;
}

/* Reduces the ranges over all ranks, together with errors from before; on an error the ranges mean nothing. Collective.
 */
static insitu_status reduce_ranges(const session_meshes *meshes, const session_team *team, planned_surface *surfaces,
                                   int count, bool of_all_cells, base_error *error)
{
    double lows[2 * count + 1];
    lows[2 * count] = error->status ? -1 : 0;
    for (int i = 0; i < count && !error->status; i++) {
        planned_surface *s = &surfaces[i];
        if (!of_all_cells || s->is_news) s->range = own_range(meshes, &s->layer->field, team->threads, of_all_cells);
    }
    for (int i = 0; i < count; i++) {
        lows[2 * i] = surfaces[i].range.low;
        lows[2 * i + 1] = surfaces[i].range.minus_high;
    }
    const int code = MPI_Allreduce(MPI_IN_PLACE, lows, 2 * count + 1, MPI_DOUBLE, MPI_MIN, team->comm);
    const insitu_status status = code == MPI_SUCCESS && lows[2 * count] < 0 ? session_agree(team->comm, error)
                                                                            : session_mpi(error, code, "MPI_Allreduce");
    for (int i = 0; i < count; i++) surfaces[i].range = (field_range){lows[2 * i], lows[2 * i + 1]};
    return status;
}

static bool find_news(const session_report *report, planned_surface *surfaces, int count)
{
    bool is_any = false;
    for (int i = 0; i < count; i++) {
        planned_surface *s = &surfaces[i];
        for (int v = 0; v < s->layer->value_count; v++) {
            const session_warning warning = isovalue_warning(s, v);
            if (is_outside(s->layer->values[v], &s->range) && !session_is_warned(report, &warning)) s->is_news = true;
        }
        is_any = is_any || s->is_news;
    }
    return is_any;
}

/* An isovalue within the range of the trees is right. Else the range of all cells is found, once, and decides. */
static void warn_of_values(session_report *report, const planned_surface *s)
{
    const double low = s->range.low, high = -s->range.minus_high;
    for (int v = 0; v < s->layer->value_count; v++) {
        const double value = s->layer->values[v];
        const session_warning warning = isovalue_warning(s, v);
        const bool has_values = low <= high || !s->is_news;
        session_warn(report, &warning, has_values && is_outside(value, &s->range),
                     "image \"%s\": the isosurface of \"%s\" at %g is empty: the field goes from %g to %g",
                     s->image->name, s->layer->field.name, value, low, high);
    }
}

insitu_status session_check_isovalues(const session_plan *plan, const session_meshes *meshes, const session_team *team,
                                      session_report *report, base_error *error)
{
    int most = 0;
    for (int i = 0; i < plan->image_count; i++)
        if (is_listed(plan->images[i])) most += plan->images[i]->isosurface_count;
    if (most == 0 || plan->cell_count == 0) return session_agree(team->comm, error);
    planned_surface surfaces[most];
    const int count = list_surfaces(plan, surfaces);
    insitu_status status = reduce_ranges(meshes, team, surfaces, count, false, error);
    if (!status && find_news(report, surfaces, count))
        status = reduce_ranges(meshes, team, surfaces, count, true, error);
    for (int i = 0; i < count && !status; i++) warn_of_values(report, &surfaces[i]);
    return status;
}
