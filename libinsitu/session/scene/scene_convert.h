/* From what libcyaml read to struct scene: defaults filled in, and what the schema cannot say is checked. */
#ifndef SCENE_SCENE_CONVERT_H
#define SCENE_SCENE_CONVERT_H

#include "scene.h"
#include "scene_document.h"

enum { SCENE_PATH_SIZE = 128 };

/* A new message-less failure for a block that could not be had. */
insitu_status scene_no_memory(const scene_document *d);

/* Each fills one part of an image; path is that of the file's part, for messages. */
insitu_status scene_convert_camera(const scene_document *d, const char *path, const scene_file_camera *in,
                                   scene_camera *out);
insitu_status scene_convert_lights(const scene_document *d, const char *path, const scene_file_image *in,
                                   scene_image *out);
insitu_status scene_convert_layers(const scene_document *d, const char *path, const scene_file_image *in,
                                   scene_image *out);
insitu_status scene_convert_outputs(const scene_document *d, const char *path, const scene_file_image *in,
                                    scene_image *out);

/* The keys that say how values become colours, of a mapping that has them. */
typedef struct scene_file_colour_map {
    const int *map;      /* colour_map */
    const double *range; /* 2 */
} scene_file_colour_map;

insitu_status scene_convert_colour_map(const scene_document *d, const char *path, const scene_file_colour_map *in,
                                       scene_colour_map *out);

/* Refuse two outputs that would be one file. */
insitu_status scene_check_outputs(const scene_document *d, const scene *s);

#endif
