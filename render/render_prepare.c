#include "render_prepare.h"
#include "kernel_cell_types.h"
#include "kernel_types.h"
#include "render.h"
#include "render_pieces.h"
#include "render_scale.h"

#include <math.h>
#include <string.h>

#include "error.h"
#include "fragment.h"
#include "insitu/status.h"
#include "memory.h"
#include "mmbvh.h"

static float find_nearest_float_below(double v)
{
    const float f = (float)v;
    return (double)f > v ? nextafterf(f, -INFINITY) : f;
}

static float find_nearest_float_above(double v)
{
    const float f = (float)v;
    return (double)f < v ? nextafterf(f, INFINITY) : f;
}

/* Appends the interval from low to high, rounded outward, to the list of `count` intervals, or extends the last one if
 * the two touch. Returns the new number of intervals. */
static int add_interval(mmbvh_interval *intervals, int count, double low, double high)
{
    if (count && intervals[count - 1].high >= find_nearest_float_below(low)) {
        intervals[count - 1].high = find_nearest_float_above(high);
        return count;
    }
    intervals[count] = (mmbvh_interval){find_nearest_float_below(low), find_nearest_float_above(high)};
    return count + 1;
}

mmbvh_interval render_isovalue_interval(double value)
{
    return (mmbvh_interval){find_nearest_float_below(value), find_nearest_float_above(value)};
}

int render_visible_intervals(const render_transfer *t, mmbvh_interval out[RENDER_MAX_INTERVALS])
{
    const int n = t->opacity_count;
    int count = 0;
    if (t->opacities[0] > 0) count = add_interval(out, count, -INFINITY, t->opacity_values[0]);
    for (int i = 0; i + 1 < n; i++)
        if (t->opacities[i] > 0 || t->opacities[i + 1] > 0)
            count = add_interval(out, count, t->opacity_values[i], t->opacity_values[i + 1]);
    if (t->opacities[n - 1] > 0) count = add_interval(out, count, t->opacity_values[n - 1], INFINITY);
    return count;
}

static void prepare_scale(kernel_transfer *out, const render_transfer *t)
{
    const double low = render_scaled(t->scale, t->threshold, t->low);
    const double high = render_scaled(t->scale, t->threshold, t->high);
    const double slope = high > low ? 1 / (high - low) : 1;
    /* On a logarithmic scale, values find_nearest_float_below low / 2 are replaced by low / 2 before logarithms are
     * taken. The position of low / 2 in the colour table is find_nearest_float_below that of `low` by more than
     * RENDER_END, so that the replaced values still count as find_nearest_float_below the range. */
    const double least = t->scale == RENDER_LOG ? t->low / 2 : t->threshold;
    const double begin = t->scale == RENDER_LOG ? log(least) : 0;
    out->scale = t->scale;
    out->threshold = (float)(least * out->inverse_width);
    out->inverse_threshold = (float)(1 / (least * out->inverse_width));
    out->scale_slope = (float)slope;
    out->scale_shift = (float)((begin - low) * slope);
}

/* Returns the position in the colour table of a value, as kernel_find_colour_table_position() computes it in float32.
 */
static double compute_colour_table_position(const kernel_transfer *out, const render_transfer *t, double value)
{
    if (t->scale == RENDER_LINEAR) return (value - out->low) * out->inverse_width;
    const double low = render_scaled(t->scale, t->threshold, t->low);
    const double high = render_scaled(t->scale, t->threshold, t->high);
    return high > low ? (render_scaled(t->scale, t->threshold, value) - low) / (high - low) : 0;
}

static void prepare_transfer(kernel_transfer *out, const render_transfer *t, double step)
{
    render_transfer_domain(t, &out->low, &out->inverse_width);
    out->colours = t->colours;
    out->colour_count = t->colour_count;
    out->is_banded = t->is_banded;
    out->outside = t->outside;
    if (t->scale != RENDER_LINEAR) prepare_scale(out, t);
    if (!t->opacity_count) return;
    out->ramp_count = t->opacity_count - 1;
    out->base_opacity = t->opacities[0];
    for (int i = 0; i < out->ramp_count; i++) {
        const double start = compute_colour_table_position(out, t, t->opacity_values[i]);
        const double along = compute_colour_table_position(out, t, t->opacity_values[i + 1]) - start;
        out->ramp_start[i] = (float)start;
        out->ramp_inverse[i] = along > 1e-38 ? (float)(1 / along) : 3e38f;
        out->ramp_rise[i] = t->opacities[i + 1] - t->opacities[i];
    }
    out->exponent = (float)(step / t->unit_distance);
    out->visible_values.count = render_visible_intervals(t, out->visible_values.intervals);
}

static void prepare_lines(kernel_lines *out, const render_lines *l)
{
    const double width = l->values[l->count - 1] - l->values[0];
    out->count = l->count;
    out->low = l->values[0];
    out->inverse_width = width > 0 ? 1 / width : 1 / fmax(fabs(out->low), 1e-30);
    for (int i = 0; i < l->count; i++) {
        const double before = i > 0 ? l->values[i] - l->values[i - 1] : (double)INFINITY;
        const double after = i + 1 < l->count ? l->values[i + 1] - l->values[i] : (double)INFINITY;
        out->level[i] = (float)((l->values[i] - out->low) * out->inverse_width);
        out->gap[i] = (float)(fmin(before, after) * out->inverse_width);
    }
}

static void prepare_camera(kernel_frame *f)
{
    const render_camera *c = &f->job->camera;
    const render_space *s = &f->job->space;
    const double pixel = 2 * c->half_height / c->height;
    const double *axes[3] = {c->right, c->up, c->forward};
    for (int i = 0; i < 3; i++)
        for (int a = 0; a < 3; a++) f->scaled_axes[i][a] = axes[i][a] * s->scale;
    f->depth_shift = s->depth_origin * s->scale;
    f->scaled_step = f->job->step * s->scale;
    f->slope_x0 = (0.5 + c->offset[0] - 0.5 * c->width) * pixel;
    f->slope_dx = pixel;
    f->slope_y0 = (0.5 * c->height - (0.5 + c->offset[1])) * pixel;
    f->slope_dy = -pixel;
    for (int i = 0; i < f->job->light_count; i++)
        for (int k = 0; k < 3; k++) {
            const double *d = f->job->lights[i].direction;
            f->light_direction[i][k] = (float)(d[0] * axes[k][0] + d[1] * axes[k][1] + d[2] * axes[k][2]);
        }
}

void render_surface_range(const render_job *job, int surface, double range[2])
{
    range[0] = INFINITY;
    range[1] = -INFINITY;
    for (int i = 0; i < job->part_count; i++) {
        const mmbvh_ranges *r = &job->surfaces[surface].field.ranges[i];
        if (!r->low || !job->parts[i].tree->node_count) continue;
        float ends[2];
        memcpy(&ends[0], r->low, sizeof ends[0]);
        memcpy(&ends[1], r->high, sizeof ends[1]);
        range[0] = fmin(range[0], (double)ends[0]);
        range[1] = fmax(range[1], (double)ends[1]);
    }
}

/* Returns 1 / the width of the range of a surface's field, rounded to a power of two. The range is taken over all ranks
 * if normals by differences use samples of other ranks (job->waiting is set), otherwise over this rank. */
static double value_scale(const render_job *job, int surface)
{
    double range[2];
    if (job->waiting)
        memcpy(range, job->waiting_ranges[surface], sizeof range);
    else
        render_surface_range(job, surface, range);
    const double width = range[1] - range[0];
    return width > 0 && isfinite(width) ? ldexp(1, -ilogb(width)) : 1;
}

/* Sets f->common_clips to the clips that cut all layers and leave at most one interval of a ray: those that keep the
 * inside of a half space, box or sphere. Sets f->volume_intervals to the largest number of intervals that the clips of
 * volumes can leave of a ray. */
static void prepare_clips(kernel_frame *f)
{
    const render_job *job = f->job;
    uint32_t outside = 0;
    for (int i = 0; i < job->clip_count; i++) outside |= (uint32_t)job->clips[i].is_outside << i;
    f->common_clips = ~outside;
    for (int i = 0; i < job->surface_count; i++) f->common_clips &= job->surfaces[i].clips;
    if (job->volume_count) f->common_clips &= job->volume_clips;
    if (!job->clip_count) f->common_clips = 0;
    if (job->volume_count && job->volume_clips & ~f->common_clips)
        f->volume_intervals = 1 + __builtin_popcount(job->volume_clips & outside);
}

/* Fills frame->surfaces, opaque layers first. Fragments of an isovalue get the kind FRAGMENT_SURFACE + the isovalue's
 * index among all isovalues of the job, which are counted layer by layer in the job's order. */
static void prepare_surfaces(kernel_frame *f)
{
    const render_job *job = f->job;
    int isovalues = 0;
    for (int pass = 0; pass < 2; pass++) {
        uint32_t kind = FRAGMENT_SURFACE;
        for (int i = 0; i < job->surface_count; i++) {
            const render_surface_layer *layer = &job->surfaces[i];
            const bool is_opaque = layer->opacity >= 1;
            if (is_opaque == (pass == 0)) {
                kernel_surface *s = &f->surfaces[f->surface_count++];
                s->layer = layer;
                s->first_kind = kind;
                s->own_clips = job->clip_count ? layer->clips & ~f->common_clips : 0;
                if (layer->normal == RENDER_DIFFERENCES) s->value_scale = value_scale(job, i);
                if (layer->colour_map) prepare_transfer(&s->colour, layer->colour_map, 1);
                if (layer->lines) prepare_lines(&s->lines, layer->lines);
                f->opaque_count += is_opaque;
                s->visible_values.count = layer->value_count;
                for (int value = 0; value < layer->value_count; value++) {
                    s->visible_values.intervals[value] = render_isovalue_interval(layer->values[value]);
                    f->isovalue_surface[isovalues] = f->surface_count - 1;
                    f->isovalue_number[isovalues++] = value;
                }
                f->has_transparent = f->has_transparent || !is_opaque;
            }
            kind += (uint32_t)layer->value_count;
        }
    }
}

static insitu_status check_lines(const render_lines *l, int layer, base_error *error)
{
    if (l->count < 1 || l->count > RENDER_MAX_LINES || !(l->width > 0))
        return base_fail(error, INSITU_ERROR_ARGUMENT,
                         "isosurface %d: %d lines of %g pixels, expected 1 to %d of more "
                         "than 0",
                         layer, l->count, (double)l->width, RENDER_MAX_LINES);
    for (int i = 0; i < l->count; i++)
        if (!isfinite(l->values[i]) || (i > 0 && !(l->values[i] > l->values[i - 1])))
            return base_fail(error, INSITU_ERROR_ARGUMENT, "isosurface %d: line %d at %g, expected values that rise",
                             layer, i, l->values[i]);
    return INSITU_OK;
}

static insitu_status check_job(const render_job *job, base_error *error)
{
    int values = 0;
    for (int i = 0; i < job->surface_count; i++) {
        values += job->surfaces[i].value_count;
        if (job->surfaces[i].value_count < 1)
            return base_fail(error, INSITU_ERROR_ARGUMENT, "isosurface %d: %d isovalues, expected 1 or more", i,
                             job->surfaces[i].value_count);
        if (job->surfaces[i].normal == RENDER_DIFFERENCES && !(job->surfaces[i].difference > 0))
            return base_fail(error, INSITU_ERROR_ARGUMENT,
                             "isosurface %d: differences over %g cell sizes, expected more than 0", i,
                             job->surfaces[i].difference);
        if (job->surfaces[i].normal == RENDER_VERTEX && !job->surfaces[i].gradients)
            return base_fail(error, INSITU_ERROR_ARGUMENT, "isosurface %d: no gradients at vertices were given", i);
        const insitu_status lines = job->surfaces[i].lines ? check_lines(job->surfaces[i].lines, i, error) : INSITU_OK;
        if (lines) return lines;
    }
    if (job->camera.width < 1 || job->camera.height < 1 || job->camera.width > UINT16_MAX ||
        job->camera.height > UINT16_MAX)
        return base_fail(error, INSITU_ERROR_ARGUMENT, "image of %d x %d pixels, expected 1 to %d on each side",
                         job->camera.width, job->camera.height, UINT16_MAX);
    if (values > RENDER_MAX_ISOVALUES || job->volume_count > RENDER_MAX_VOLUMES || job->light_count > RENDER_MAX_LIGHTS)
        return base_fail(error, INSITU_ERROR_ARGUMENT, "%d isovalues, %d volumes, %d lights: at most %d, %d, %d",
                         values, job->volume_count, job->light_count, RENDER_MAX_ISOVALUES, RENDER_MAX_VOLUMES,
                         RENDER_MAX_LIGHTS);
    if (job->clip_count < 0 || job->clip_count > RENDER_MAX_CLIPS)
        return base_fail(error, INSITU_ERROR_ARGUMENT, "%d clips, expected at most %d", job->clip_count,
                         RENDER_MAX_CLIPS);
    if (!job->volume_count) return INSITU_OK;
    if (!(job->max_error >= 0) || !(job->extent >= 0))
        return base_fail(error, INSITU_ERROR_ARGUMENT, "max_error of %g over %g, expected 0 or more", job->max_error,
                         job->extent);
    if (job->sample_group < 1 || job->sample_group > KERNEL_MAX_GROUP)
        return base_fail(error, INSITU_ERROR_ARGUMENT, "sample group of %d, expected 1 to %d", job->sample_group,
                         KERNEL_MAX_GROUP);
    /* In scaled units the scene has a size near 1, so smaller steps would give millions of samples per ray. */
    if (!(job->step * job->space.scale > 1e-6))
        return base_fail(error, INSITU_ERROR_ARGUMENT,
                         "step of %g between samples, expected more than a millionth of "
                         "the scene (%g)",
                         job->step, 1e-6 / job->space.scale);
    for (int i = 0; i < job->volume_count; i++) {
        const render_transfer *t = job->volumes[i].transfer;
        if (t->opacity_count < 1 || t->opacity_count > RENDER_MAX_OPACITY_POINTS || !(t->unit_distance > 0))
            return base_fail(error, INSITU_ERROR_ARGUMENT,
                             "volume %d: %d opacity points over a distance of %g, expected "
                             "1 to %d over more than 0",
                             i, t->opacity_count, t->unit_distance, RENDER_MAX_OPACITY_POINTS);
    }
    return INSITU_OK;
}

/* Returns an upper bound of the length of a ray inside this rank's cells, in scaled units: the diagonal of the bounding
 * box of all trees. */
static double longest_ray_in_scene(const render_job *job)
{
    double low[3] = {1e300, 1e300, 1e300}, high[3] = {-1e300, -1e300, -1e300}, square = 0;
    for (int i = 0; i < job->part_count; i++) {
        const mmbvh *tree = job->parts[i].tree;
        if (!tree->node_count) continue;
        float lower[4], upper[4];
        mmbvh_node_box(tree, 0, lower, upper);
        for (int a = 0; a < 3; a++) {
            low[a] = fmin(low[a], (double)lower[a]);
            high[a] = fmax(high[a], (double)upper[a]);
        }
    }
    for (int a = 0; a < 3; a++) square += low[a] < high[a] ? (high[a] - low[a]) * (high[a] - low[a]) : 0;
    return sqrt(square);
}

/* If the job's max_error (error bound of a colour) is smaller than this, the ends of rays' intervals in tets are
 * computed in double (kernel_frame.is_double). The largest error measured with float32, over random tets and functions
 * with steps and opacities up to 1, was 3.4e-5. */
static const double double_error = 2e-4;

/* Returns whether the job may have hexes, wedges or pyramids, whose segments are computed in lanes
 * (kernel_local_segments.h). */
static bool has_curved_cells(const render_job *job)
{
    for (int i = 0; i < job->part_count; i++) {
        const grid *g = job->parts[i].cells;
        if (g->cell_types || kernel_has_quads(g->cell_type)) return true;
    }
    return false;
}

/* Divides the job's error bound, max_error, among the sources of error (docs/development/error_budget.md). An eighth is
 * allowed for the colour table. Four fifths are allowed for the field, half of them in proportion to length and half in
 * proportion to optical depth. If compositing mixes the segments, only half of these four fifths is allowed for the
 * field, and the other half for the mixing; RENDER_MIXING_ERROR is used if the job gives no max_error. */
static insitu_status prepare_segments(kernel_frame *f, base_error *error)
{
    const render_job *job = f->job;
    const bool is_apart = job->separate_samples;
    insitu_status status = INSITU_OK;
    f->has_segments = job->integration == RENDER_SEGMENTS && (job->volume_count == 1 || is_apart);
    f->is_double = f->has_segments && job->max_error < double_error;
    if (!f->has_segments) return INSITU_OK;
    const double max_error = is_apart && !(job->max_error > 0) ? RENDER_MIXING_ERROR : job->max_error;
    const double error_of_each = max_error / job->volume_count;
    f->allowance = (float)((is_apart ? 0.2 : 0.4) * error_of_each);
    if (is_apart) f->mixing = (float)(0.4 * error_of_each);
    /* A segment is cut at a surface either by this rank or by compositing, depending on the partition: a rank finds
     * overlaps that lie clearly in front of the surface only among its own cells. Both cuts must give the same result,
     * to 1e-6. Segments of several volumes are always cut by compositing. */
    if (is_apart && job->surface_count && job->volume_count == 1) f->mixing = fminf(f->mixing, 5e-7f);
    const double reach = job->extent > 0 ? job->extent * job->space.scale : longest_ray_in_scene(job);
    for (int i = 0; i < job->volume_count && status == INSITU_OK; i++) {
        const render_transfer *t = job->volumes[i].transfer;
        f->reach[i] = (float)fmax(reach / (t->unit_distance * job->space.scale), 1e-30);
        status = render_pieces_build(&f->pieces[i], t, error_of_each / 8, error);
        f->is_double = f->is_double || f->pieces[i].has_rests;
        if (status == INSITU_OK && error_of_each > 0 && !is_apart)
            status = render_preintegral_build(&f->pieces[i], t, error_of_each, (double)f->reach[i], error);
        if (status == INSITU_OK && (is_apart || has_curved_cells(job)))
            status = render_variations_build(&f->pieces[i], t, error);
    }
    return status;
}

void render_free_prepared_frame(kernel_frame *frame)
{
    base_free(frame->surfaces);
    for (int i = 0; i < RENDER_MAX_VOLUMES; i++) render_pieces_free(&frame->pieces[i]);
}

insitu_status render_prepare_surfaces(const render_job *job, render_job *surfaces, kernel_frame *frame,
                                      base_error *error)
{
    *surfaces = *job;
    surfaces->volume_count = 0;
    surfaces->separate_samples = surfaces->reproducible = false;
    return render_prepare(surfaces, frame, error);
}

insitu_status render_prepare(const render_job *job, kernel_frame *frame, base_error *error)
{
    const insitu_status status = check_job(job, error);
    if (status != INSITU_OK) return status;
    memset(frame, 0, sizeof *frame);
    frame->job = job;
    for (int i = 0; i < job->part_count; i++)
        frame->has_polyhedra = frame->has_polyhedra || grid_may_have_polyhedra(job->parts[i].cells);
    frame->surfaces = base_calloc((size_t)job->surface_count, sizeof *frame->surfaces);
    if (!frame->surfaces) return base_fail(error, INSITU_ERROR_MEMORY, "no memory for %d layers", job->surface_count);
    prepare_camera(frame);
    prepare_clips(frame);
    prepare_surfaces(frame);
    frame->volume_count = job->volume_count;
    for (int i = 0; i < job->volume_count; i++)
        prepare_transfer(&frame->volumes[i], job->volumes[i].transfer, job->step);
    frame->needs_contact = job->volume_count && job->surface_count && !job->is_alone;
    const insitu_status segments = prepare_segments(frame, error);
    if (segments != INSITU_OK) render_free_prepared_frame(frame);
    const bool bins = job->traversal == RENDER_BINNED && !job->pixels;
    frame->is_binned = bins && frame->surface_count;
    /* a tile's list of candidates is consumed when it is traced, so the volume is binned only if its clips leave one
     * interval of a ray, for which one pass suffices */
    frame->bins_volume = bins && job->volume_count == 1 && frame->volume_intervals <= 1;
    return segments;
}
