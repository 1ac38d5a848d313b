/* Ranges that widen over a run (range: run): the widest that each layer of an image has been drawn with.
 *
 * They are kept in a file NAME.ranges, NAME being the image's, in the folder of the image's first output: the part of
 * its path before the last slash that comes before any placeholder; those of a sweep's pictures but the first in
 * NAME.1.ranges and so on. It is text, written anew after each picture for which a range became wider, and read when
 * the first picture of the image is drawn, so that a run that is started again goes on with the ranges of the one
 * before. A line has: isosurface, surface, slice or volume, the layer's number among those of its kind from 0 on, the
 * component (scene.h), low, high, and the field. Lines that match no layer of the image are left out. */
#ifndef SESSION_RUN_RANGES_H
#define SESSION_RUN_RANGES_H

#include "error.h"
#include "scene.h"
#include "session_team.h"

/* A layer that has one; points into the scene. */
typedef struct session_run_range {
    const char *kind;
    int number; /* among the layers of its kind */
    const scene_field *field;
    const scene_colour_map *map;
    double low, high; /* the same on all ranks; low > high: none yet */
} session_run_range;

typedef struct session_image_ranges {
    char *image, *path;
    int layers; /* the layers of the image's variants */
    int count;
    session_run_range *items;
    bool is_changed; /* since the file was written */
} session_image_ranges;

typedef struct session_run_ranges {
    int count;
    session_image_ranges *items;
} session_run_ranges;

/* The image's ranges; *out is NULL where no layer of it has one over the run. Collective. */
insitu_status session_open_run_ranges(session_run_ranges *all, const scene_image *image, const session_team *team,
                                      session_image_ranges **out, base_error *error);

/* Widen the range of the layer with the map by that of this step, and return the result in its place. Local. */
void session_widen_run_range(session_image_ranges *ranges, const scene_colour_map *map, double *low, double *high);

/* Write the file where a range has changed. On rank 0. */
insitu_status session_write_run_ranges(session_image_ranges *ranges, base_error *error);

void session_run_ranges_free(session_run_ranges *all);

#endif
