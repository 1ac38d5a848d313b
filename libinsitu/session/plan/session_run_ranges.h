/* Keeps colour ranges that widen over a run (range: run): for each layer of an image, stores the smallest range that
 * contains the layer's ranges of all steps so far.
 *
 * The ranges are stored in a file NAME.ranges, where NAME is the image's name, in the folder of the image's first
 * output: the part of its path before the last slash that comes before any placeholder. Further pictures of a sweep use
 * NAME.1.ranges and so on. The file is text. It is written anew after each picture for which a range became wider, and
 * read when the first picture of the image is drawn, so that a restarted run continues with the ranges of the previous
 * one. If the image has no outputs, there is no file. A line contains, in this order: the layer's type (isosurface,
 * surface, slice or volume); an index (session_run_range.number); the field's component (scene_field.component); the
 * low and the high end of the range; and the field's name. Lines that match no layer of the image are ignored. */
#ifndef SESSION_RUN_RANGES_H
#define SESSION_RUN_RANGES_H

#include "error.h"
#include "scene.h"
#include "session_team.h"

/* The widest range of a layer over the run; its pointers refer to the scene. */
typedef struct session_run_range {
    const char *kind; /* type of the layer, as written in the file of ranges: isosurface, surface, slice or volume */
    /* index of the layer, from 0, among the image's layers of this type that show the same component of the same field
     * and have a range over the run, so that it does not change if layers of other fields are added */
    int number;
    const scene_field *field;
    const scene_colour_map *map;
    double low, high; /* ends of the range, the same on all ranks; low > high: there is no range yet */
} session_run_range;

typedef struct session_image_ranges {
    char *image, *path; /* name of the image, and path of the file that keeps its ranges; NULL: it has no outputs */
    /* If the image has a sweep: index of the combination of field, isovalue and plane to which the ranges belong
     * (scene_variant.layers). 0 without a sweep. */
    int layers;
    int count;
    session_run_range *items; /* one range for each layer whose range widens over the run */
    bool is_changed;          /* set if a range has changed since the file was written */
} session_image_ranges;

typedef struct session_run_ranges {
    int count;
    session_image_ranges *items;
} session_run_ranges;

/* Finds the image's ranges, or reads them from their file at the first call for the image. *out is NULL if no layer of
 * the image has a range that widens over the run. Collective. */
insitu_status session_find_or_read_run_ranges(session_run_ranges *all, const scene_image *image,
                                              const session_team *team, session_image_ranges **out, base_error *error);

/* Widens the range over the run of the layer that has this colour map by the range of this step. On entry, *low and
 * *high are the range of this step; on return, they are the widened range. Local. */
void session_widen_run_range(session_image_ranges *ranges, const scene_colour_map *map, double *low, double *high);

/* Writes the file if a range has changed. Called on rank 0 only. */
insitu_status session_write_run_ranges(session_image_ranges *ranges, base_error *error);

void session_run_ranges_free(session_run_ranges *all);

#endif
