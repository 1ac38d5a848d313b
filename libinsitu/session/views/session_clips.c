/* Finds out whether clips remove all data. The region that a set of clips leaves of the data's bounds is enclosed in a
 * box: each clip in turn shrinks the box, and the whole set is applied eight times, because a clip may shrink the box
 * further after other clips have shrunk it. If the box becomes empty, the clips leave nothing. */
#include "session_clips.h"

#include <math.h>
#include <string.h>

#include "session_distances.h"
#include "vector3.h"

/* Converts a clip to the renderer's form. A slice on the border of the data is drawn slightly shifted
 * (SESSION_BORDER_SHARE). The region that the clip keeps is extended by twice the largest shift, so that a slice on the
 * region's border is visible. */
static render_clip make_clip(const session_extent *e, const scene_clip *clip)
{
    const double reach = 2 * SESSION_BORDER_SHARE * e->half_diagonal, grown = clip->is_outside ? -reach : reach;
    render_clip out = {.is_outside = clip->is_outside, .radius = fmax(clip->radius + grown, 0)};
    double point[3];
    memcpy(out.centre, clip->centre, sizeof out.centre);
    for (int axis = 0; axis < 3; axis++) {
        const double middle = 0.5 * (clip->lower[axis] + clip->upper[axis]);
        out.lower[axis] = fmin(clip->lower[axis] - grown, middle);
        out.upper[axis] = fmax(clip->upper[axis] + grown, middle);
    }
    switch (clip->kind) {
    case SCENE_CLIP_BOX: out.kind = RENDER_CLIP_BOX; break;
    case SCENE_CLIP_SPHERE: out.kind = RENDER_CLIP_SPHERE; break;
    case SCENE_CLIP_PLANE:
        out.kind = RENDER_CLIP_PLANE;
        session_find_plane_point(&clip->plane, e, point);
        memcpy(out.normal, clip->plane.normal, sizeof out.normal);
        out.distance = vector3_dot(point, out.normal) + grown;
    }
    return out;
}

void session_make_clips(const session_extent *extent, const scene_image *image, render_clip out[RENDER_MAX_CLIPS])
{
    for (int i = 0; i < image->clip_count; i++) out[i] = make_clip(extent, &image->clips[i]);
}

/* ---- bounding boxes of the regions that clips leave ------------------------------------------------------------ */

typedef struct clip_box {
    double lower[3], upper[3];
} clip_box;

static bool is_empty_box(const clip_box *box)
{
    return box->lower[0] > box->upper[0] || box->lower[1] > box->upper[1] || box->lower[2] > box->upper[2];
}

static void make_empty_box(clip_box *box)
{
    box->lower[0] = INFINITY;
}

static void intersect_box_with_box(clip_box *box, const double lower[3], const double upper[3])
{
    for (int axis = 0; axis < 3; axis++) {
        box->lower[axis] = fmax(box->lower[axis], lower[axis]);
        box->upper[axis] = fmin(box->upper[axis], upper[axis]);
    }
}

/* Shrinks the box to the bounds of its part with normal . x <= distance. The limit along an axis follows from the
 * distance that remains after the smallest contributions of the other two axes to normal . x are subtracted. */
static void shrink_box_to_half_space(clip_box *box, const render_clip *clip)
{
    double least[3], left = clip->distance;
    for (int axis = 0; axis < 3; axis++) {
        const double n = clip->normal[axis];
        least[axis] = n * (n > 0 ? box->lower[axis] : box->upper[axis]);
        left -= least[axis];
    }
    if (left < 0) make_empty_box(box);
    for (int axis = 0; axis < 3 && left >= 0; axis++) {
        const double n = clip->normal[axis], reach = (least[axis] + left) / n;
        if (n > 0) box->upper[axis] = fmin(box->upper[axis], reach);
        if (n < 0) box->lower[axis] = fmax(box->lower[axis], reach);
    }
}

/* Computes the distances from a sphere's centre to the nearest and the farthest point of the box. */
static void compute_distances_of_box_from_point(const clip_box *box, const double centre[3], double *nearest,
                                                double *farthest)
{
    double near[3], far[3];
    for (int axis = 0; axis < 3; axis++) {
        const double below = box->lower[axis] - centre[axis], above = centre[axis] - box->upper[axis];
        near[axis] = fmax(fmax(below, above), 0);
        far[axis] = fmax(-below, -above);
    }
    *nearest = sqrt(vector3_dot(near, near));
    *farthest = sqrt(vector3_dot(far, far));
}

static void shrink_box_to_sphere(clip_box *box, const render_clip *clip)
{
    double nearest, farthest, lower[3], upper[3];
    compute_distances_of_box_from_point(box, clip->centre, &nearest, &farthest);
    if (clip->is_outside ? farthest < clip->radius : nearest > clip->radius) make_empty_box(box);
    if (clip->is_outside) return;
    for (int axis = 0; axis < 3; axis++) {
        lower[axis] = clip->centre[axis] - clip->radius;
        upper[axis] = clip->centre[axis] + clip->radius;
    }
    intersect_box_with_box(box, lower, upper);
}

static void empty_box_if_inside_clip_box(clip_box *box, const render_clip *clip)
{
    bool is_within = true;
    for (int axis = 0; axis < 3; axis++)
        is_within = is_within && clip->lower[axis] < box->lower[axis] && box->upper[axis] < clip->upper[axis];
    if (is_within) make_empty_box(box);
}

static void shrink_box_to_clip(clip_box *box, const render_clip *clip)
{
    switch (clip->kind) {
    case RENDER_CLIP_PLANE: shrink_box_to_half_space(box, clip); break;
    case RENDER_CLIP_SPHERE: shrink_box_to_sphere(box, clip); break;
    case RENDER_CLIP_BOX:
        if (clip->is_outside)
            empty_box_if_inside_clip_box(box, clip);
        else
            intersect_box_with_box(box, clip->lower, clip->upper);
    }
}

static bool do_clips_remove_all_data(const session_extent *e, const render_clip *clips, int count, uint32_t set)
{
    enum { TURNS = 8 };
    clip_box box;
    memcpy(box.lower, e->lower, sizeof box.lower);
    memcpy(box.upper, e->upper, sizeof box.upper);
    for (int turn = 0; turn < TURNS; turn++)
        for (int i = 0; i < count && !is_empty_box(&box); i++)
            if (set >> i & 1) shrink_box_to_clip(&box, &clips[i]);
    return is_empty_box(&box);
}

/* ---- warnings -------------------------------------------------------------------------------------------------- */

typedef struct clip_basis {
    const session_extent *extent;
    const scene_image *image;
    const render_clip *clips;
    session_report *report;
    /* true: there are no cells, or the clips that cut all layers leave nothing; no warnings of single layers are added
     * in this case */
    bool is_empty;
} clip_basis;

static void warn_if_clips_remove_layer(const clip_basis *b, const char *layer, const char *field, int number,
                                       uint32_t set)
{
    const session_extent *e = b->extent;
    const session_warning warning = {WARNING_CLIP, b->image->name, layer, number};
    const bool holds = !b->is_empty && do_clips_remove_all_data(e, b->clips, b->image->clip_count, set);
    session_warn(b->report, &warning, holds,
                 "image \"%s\": clip leaves nothing of %s%s%s%s: the cells lie between (%g, %g, %g) and (%g, %g, %g)",
                 b->image->name, layer, field ? " of \"" : "", field ? field : "", field ? "\"" : "", e->lower[0],
                 e->lower[1], e->lower[2], e->upper[0], e->upper[1], e->upper[2]);
}

void session_warn_of_layers_clipped_away(const session_extent *extent, const scene_image *image,
                                         const render_clip *clips, session_report *report)
{
    clip_basis basis = {extent, image, clips, report, extent->cell_count == 0};
    if (image->variant.view > 0 || image->clip_count == 0) return;
    warn_if_clips_remove_layer(&basis, "the picture", NULL, 0, image->clips_of_all);
    basis.is_empty = basis.is_empty || do_clips_remove_all_data(extent, clips, image->clip_count, image->clips_of_all);
    for (int i = 0; i < image->isosurface_count; i++)
        warn_if_clips_remove_layer(&basis, "the isosurface", image->isosurfaces[i].field.name, i,
                                   image->isosurfaces[i].clips);
    for (int i = 0; i < image->volume_count; i++)
        warn_if_clips_remove_layer(&basis, "the volume", image->volumes[i].field.name, i, image->volumes[i].clips);
    for (int i = 0; i < image->slice_count; i++)
        warn_if_clips_remove_layer(&basis, "the slice", image->slices[i].field.name, i, image->slices[i].clips);
    for (int i = 0; i < image->surface_count; i++)
        warn_if_clips_remove_layer(&basis, "the surface", NULL, i, image->surfaces[i].clips);
}
