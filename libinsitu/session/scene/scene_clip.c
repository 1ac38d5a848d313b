/* Reads the clips of an image's layers: half spaces, boxes and spheres. An image has one list of clips, without
 * duplicates; each layer has a set of entries of this list, stored as a bit mask. */
#include <stdio.h>
#include <string.h>

#include "memory.h"
#include "scene_convert.h"

/* Adds the clip to a set of clips, and to the image's list of clips unless the list already contains it. */
static insitu_status add_clip_to_image_and_set(const scene_document *d, const char *path, const scene_clip *clip,
                                               scene_image *image, uint32_t *set)
{
    int at = 0;
    /* NOLINTNEXTLINE(bugprone-suspicious-memory-comparison): applying a clip twice does no harm */
    while (at < image->clip_count && memcmp(&image->clips[at], clip, sizeof *clip) != 0) at++;
    if (at == SCENE_MAX_CLIPS)
        return scene_fail_at_key(d, path, "",
                                 "is one of more than %d planes, boxes and spheres that cut, expected at most %d "
                                 "in an image",
                                 SCENE_MAX_CLIPS, SCENE_MAX_CLIPS);
    if (at == image->clip_count) image->clips[image->clip_count++] = *clip;
    *set |= UINT32_C(1) << at;
    return INSITU_OK;
}

/* Zeroes the whole struct, including padding, so that two clips can be compared with memcmp(). */
static scene_clip *initialize_clip(scene_clip *clip, scene_clip_kind kind, bool is_outside)
{
    memset(clip, 0, sizeof *clip);
    clip->kind = kind;
    clip->is_outside = is_outside;
    return clip;
}

static insitu_status add_clip_planes(const scene_document *d, const char *path, const scene_file_clip *in,
                                     scene_image *image, uint32_t *set)
{
    scene_clip clip;
    insitu_status status = INSITU_OK;
    for (int i = 0; i < in->planes_count && !status; i++) {
        status =
            scene_convert_plane(d, path, i, &in->planes[i], &initialize_clip(&clip, SCENE_CLIP_PLANE, false)->plane);
        if (!status) status = add_clip_to_image_and_set(d, path, &clip, image, set);
    }
    return status;
}

static insitu_status add_clip_box(const scene_document *d, const char *path, const double box[2][3], bool is_outside,
                                  scene_image *image, uint32_t *set)
{
    scene_clip clip;
    initialize_clip(&clip, SCENE_CLIP_BOX, is_outside);
    for (int axis = 0; axis < 3; axis++) {
        clip.lower[axis] = box[0][axis];
        clip.upper[axis] = box[1][axis];
        if (!(box[0][axis] < box[1][axis]))
            return scene_fail_at_key(d, path, "box",
                                     "from %g to %g along %c, expected the first corner to be less than the other",
                                     box[0][axis], box[1][axis], "xyz"[axis]);
    }
    return add_clip_to_image_and_set(d, path, &clip, image, set);
}

static insitu_status add_clip_sphere(const scene_document *d, const char *path, const scene_file_sphere *in,
                                     bool is_outside, scene_image *image, uint32_t *set)
{
    scene_clip clip;
    initialize_clip(&clip, SCENE_CLIP_SPHERE, is_outside);
    memcpy(clip.centre, in->centre, sizeof clip.centre);
    clip.radius = in->radius;
    return add_clip_to_image_and_set(d, path, &clip, image, set);
}

insitu_status scene_convert_clip(const scene_document *d, const char *path, const scene_file_clip *in,
                                 scene_image *image, uint32_t *set)
{
    if (!in) return INSITU_OK;
    const bool is_outside = in->keep && *in->keep == SCENE_KEEP_OUTSIDE;
    if (!in->planes && !in->box && !in->sphere)
        return scene_fail_at_key(d, path, "", "holds nothing, expected planes, a box or a sphere");
    if (in->keep && !in->box && !in->sphere)
        return scene_fail_at_key(d, path, "keep", "given without a box or a sphere, expected one of them beside it");
    if (!image->clips) image->clips = base_calloc(SCENE_MAX_CLIPS, sizeof *image->clips);
    if (!image->clips) return scene_fail_for_memory(d);
    insitu_status status = add_clip_planes(d, path, in, image, set);
    if (!status && in->box) status = add_clip_box(d, path, (const double(*)[3])in->box, is_outside, image, set);
    return status || !in->sphere ? status : add_clip_sphere(d, path, in->sphere, is_outside, image, set);
}

insitu_status scene_convert_layer_clip(const scene_document *d, const char *layer, const scene_file_clip *in,
                                       scene_image *image, uint32_t *set)
{
    char path[SCENE_PATH_SIZE];
    snprintf(path, sizeof path, "%s.clip", layer);
    *set = image->clips_of_all;
    return scene_convert_clip(d, path, in, image, set);
}
