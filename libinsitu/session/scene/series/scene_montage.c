/* Finds which pictures are panels of one file, and which are insets over these panels. Panels are numbered in the order
 * in which pictures are drawn: images in the order of the scene, for each image the entries of its sweep, and for each
 * entry the views of its orbit. Insets are drawn after the panels, so that no panel covers an inset. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "memory.h"
#include "scene_convert.h"

/* Returns the output's path, with a sample cycle and time inserted for its placeholders. Two outputs are the same file
 * if these paths are equal (scene_outputs.c). */
static char *expand_path_for_comparison(const scene_image *image, const scene_output *output, int view)
{
    scene_placeholder_values moment = scene_make_placeholder_values(image, 123456789012345678, 0.5);
    moment.view = view;
    return scene_expand_placeholders(output->path, &moment);
}

static insitu_status check_views_share_one_file(const scene_document *d, const char *path, const scene_image *image,
                                                const scene_output *output, const char *name)
{
    char *other = expand_path_for_comparison(image, output, 1);
    if (!other) return scene_fail_for_memory(d);
    const bool differs = strcmp(other, name) != 0;
    base_free(other);
    if (!differs) return INSITU_OK;
    return scene_fail_at_key(d, path, "path",
                             "\"%.100s\" is another file for each view, expected one for all cells of a grid",
                             output->path);
}

/* The width of the strip for shared colour bars, as a multiple of the height of text. It has space for a bar with the
 * widest label that is not wrapped, and for borders (adaptors/image/layout.cpp). */
static const double bar_strip = 9;

/* Width of the frames of insets, and their distance from the edges of the panels, as fractions of the file's height. */
static const double inset_frame = 1 / 400.0, inset_distance = 1 / 50.0;

/* Returns the index of the montage of this name; -1: there is none. */
static int find_montage(const scene *s, const char *name)
{
    int found = s->montage_count - 1;
    while (found >= 0 && strcmp(s->montages[found].name, name) != 0) found--;
    return found;
}

/* Returns the index of the montage of this name. If there is none yet, it is added. Returns -1 if memory runs out. */
static int find_or_add_montage(scene *s, const scene_image *image, const scene_output *output, char *name)
{
    const int found = find_montage(s, name), height = image->height * output->rows;
    if (found >= 0) {
        base_free(name);
        return found;
    }
    scene_montage *items = base_realloc(s->montages, (size_t)(s->montage_count + 1) * sizeof *items);
    if (!items) {
        base_free(name);
        return -1;
    }
    s->montages = items;
    items[s->montage_count] = (scene_montage){.name = name,
                                              .columns = output->columns,
                                              .rows = output->rows,
                                              .width = image->width,
                                              .height = image->height,
                                              .format = output->format,
                                              .shares_bars = output->shares_bars,
                                              .are_bars_left = image->decorations.bar_anchor == SCENE_LEFT};
    scene_montage *m = &items[s->montage_count];
    m->frame_width = (int)ceil(inset_frame * height);
    m->inset_margin = m->frame_width + (int)ceil(inset_distance * height);
    if (output->shares_bars) m->bar_width = (int)ceil(bar_strip * image->decorations.size * image->height);
    return s->montage_count++;
}

static bool has_insets(const scene_montage *m)
{
    bool has = false;
    for (int i = 0; i < SCENE_ANCHORS; i++) has = has || m->insets[i].width;
    return has;
}

static insitu_status check_panels_fit_montage(const scene_document *d, const char *path, const scene_image *image,
                                              const scene_output *output, const scene_montage *m)
{
    if (output->columns != m->columns || output->rows != m->rows)
        return scene_fail_at_key(d, path, "grid",
                                 "[%d, %d] differs from that of the file's first picture, expected [%d, %d]",
                                 output->columns, output->rows, m->columns, m->rows);
    if (image->width != m->width || image->height != m->height)
        return scene_fail_at_key(
            d, path, "grid",
            "this picture has %d x %d pixels, that of the file's first cell %d x %d, expected one size", image->width,
            image->height, m->width, m->height);
    if (output->format != m->format)
        return scene_fail_at_key(d, path, "bits", "differs from that of the file's first picture, expected the same");
    if (output->shares_bars != m->shares_bars)
        return scene_fail_at_key(d, path, "shared_bars",
                                 "is %s, and %s for the file's first picture, expected the same",
                                 output->shares_bars ? "true" : "false", m->shares_bars ? "true" : "false");
    if (has_insets(m))
        return scene_fail_at_key(d, path, "grid",
                                 "follows an inset of the same file, expected before all insets of the file");
    if (m->panel_count > m->columns * m->rows)
        return scene_fail_at_key(d, path, "grid", "[%d, %d] has %d cells for %d pictures up to here, expected no fewer",
                                 m->columns, m->rows, m->columns * m->rows, m->panel_count);
    return INSITU_OK;
}

/* Returns the rectangle of an inset of the image's size. Insets lie over the panels, not over the strip for shared
 * colour bars. */
static scene_rectangle compute_inset_rectangle(const scene_montage *m, scene_anchor corner, const scene_image *image)
{
    const bool is_right = corner == SCENE_TOP_RIGHT || corner == SCENE_BOTTOM_RIGHT;
    const bool is_low = corner == SCENE_BOTTOM_LEFT || corner == SCENE_BOTTOM_RIGHT;
    const int left = m->are_bars_left ? m->bar_width : 0;
    return (scene_rectangle){
        left + (is_right ? m->width * m->columns - m->inset_margin - image->width : m->inset_margin),
        is_low ? m->height * m->rows - m->inset_margin - image->height : m->inset_margin, image->width, image->height};
}

/* Returns whether an inset and its frame overlap another inset of the file or its frame. */
static bool does_inset_overlap_another(const scene_montage *m, const scene_rectangle *a)
{
    const int frames = 2 * m->frame_width;
    bool overlaps = false;
    for (int i = 0; i < SCENE_ANCHORS; i++) {
        const scene_rectangle *b = &m->insets[i];
        overlaps = overlaps || (b->width && a->x < b->x + b->width + frames && b->x < a->x + a->width + frames &&
                                a->y < b->y + b->height + frames && b->y < a->y + a->height + frames);
    }
    return overlaps;
}

static insitu_status check_inset_fits_montage(const scene_document *d, const char *path, const scene_image *image,
                                              const scene_output *output, const scene_montage *m)
{
    const scene_rectangle own = compute_inset_rectangle(m, output->corner, image);
    const int most_width = m->width * m->columns - 2 * m->inset_margin;
    const int most_height = m->height * m->rows - 2 * m->inset_margin;
    if (image->camera.orbit.view_count)
        return scene_fail_at_key(d, path, "inset", "given for an image with an orbit, expected for a single view");
    if (output->format != m->format)
        return scene_fail_at_key(d, path, "bits", "differs from that of the file's first picture, expected the same");
    if (m->insets[output->corner].width)
        return scene_fail_at_key(d, path, "inset", "is the corner of another inset of the file, expected its own");
    if (image->width > most_width || image->height > most_height)
        return scene_fail_at_key(d, path, "inset", "this picture has %d x %d pixels, expected at most %d x %d",
                                 image->width, image->height, most_width, most_height);
    if (does_inset_overlap_another(m, &own))
        return scene_fail_at_key(d, path, "inset",
                                 "this picture has %d x %d pixels and overlaps another inset of the file, expected "
                                 "smaller pictures",
                                 image->width, image->height);
    return INSITU_OK;
}

/* Places an inset over the panels of the montage of this name. */
static insitu_status add_inset_to_montage(const scene_document *d, const char *path, scene *s, const scene_image *image,
                                          scene_output *output, const char *name)
{
    const int index = find_montage(s, name);
    if (index < 0)
        return scene_fail_at_key(d, path, "inset",
                                 "no output before it has the file \"%.100s\" and a grid, expected one with both "
                                 "(grid: [1, 1] for a single picture)",
                                 output->path);
    scene_montage *m = &s->montages[index];
    const insitu_status status = check_inset_fits_montage(d, path, image, output, m);
    if (status) return status;
    output->montage = index;
    output->first_panel = m->columns * m->rows;
    m->insets[output->corner] = compute_inset_rectangle(m, output->corner, image);
    return INSITU_OK;
}

/* Places a picture, or all views of an orbit, in the next panels of the montage of this name. Takes ownership of the
 * name. */
static insitu_status add_panels_to_montage(const scene_document *d, const char *path, scene *s,
                                           const scene_image *image, scene_output *output, char *name)
{
    const int views =
        image->camera.orbit.view_count ? image->camera.orbit.view_count * image->camera.orbit.circle_count : 1;
    const insitu_status status = views > 1 ? check_views_share_one_file(d, path, image, output, name) : INSITU_OK;
    if (status) {
        base_free(name);
        return status;
    }
    output->montage = find_or_add_montage(s, image, output, name);
    if (output->montage < 0) return scene_fail_for_memory(d);
    scene_montage *m = &s->montages[output->montage];
    output->first_panel = m->panel_count;
    m->panel_count += views;
    return check_panels_fit_montage(d, path, image, output, m);
}

static insitu_status add_output_to_montage(const scene_document *d, scene *s, scene_image *image, int index)
{
    scene_output *output = &image->outputs[index];
    char path[64];
    output->montage = -1;
    if (!output->columns && !output->is_inset) return INSITU_OK;
    char *name = expand_path_for_comparison(image, output, 0);
    if (!name) return scene_fail_for_memory(d);
    snprintf(path, sizeof path, "images[%d].outputs[%d]", image->variant.source, index);
    if (!output->is_inset) return add_panels_to_montage(d, path, s, image, output, name);
    const insitu_status status = add_inset_to_montage(d, path, s, image, output, name);
    base_free(name);
    return status;
}

insitu_status scene_assign_outputs_to_montages(const scene_document *d, scene *s)
{
    insitu_status status = INSITU_OK;
    for (int i = 0; i < s->image_count && !status; i++)
        for (int o = 0; o < s->images[i].output_count && !status; o++)
            status = add_output_to_montage(d, s, &s->images[i], o);
    return status;
}
