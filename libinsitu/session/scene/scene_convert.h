/* Turns the schema's structs into struct scene: defaults are filled in, and what the schema cannot express is checked.
 */
#ifndef SCENE_SCENE_CONVERT_H
#define SCENE_SCENE_CONVERT_H

#include "colour_space.h"
#include "scene.h"
#include "scene_document.h"

enum { SCENE_PATH_SIZE = 128 };

/* Points that a colour map goes through. */
typedef struct scene_colour_points {
    int count;
    colour_point *items;
    colour_space space;
    bool is_banded; /* each colour is that of a band */
} scene_colour_points;

/* Scales v to unit length; false for a zero vector. */
bool scene_normalize(double v[3]);
/* Unit vectors count as parallel within a millionth of a radian. */
bool scene_is_parallel(const double a[3], const double b[3]);

/* The numbers whose product is how many pictures an image makes in a step. */
typedef struct scene_series {
    int fields, isovalues, planes, views; /* each 1 or more */
} scene_series;

/* Checks the image's sweep. path: of the image. */
insitu_status scene_find_series(const scene_document *d, const char *path, const scene_file_image *in,
                                scene_series *out);
/* Counted over all images together; too many are an error. */
insitu_status scene_count_pictures(const scene_document *d, const scene_file *in, int *count);
/* Keeps in the layers, which are those of the file, only what the variant shows. */
insitu_status scene_apply_sweep(const scene_document *d, const char *path, const scene_file_image *in,
                                scene_image *out);

/* Reads the series of a camera, whose path is given: its orbit, its places, and how many views it has. */
insitu_status scene_convert_orbit(const scene_document *d, const char *path, const scene_file_camera *in,
                                  scene_camera *out);
insitu_status scene_convert_path(const scene_document *d, const char *path, const scene_file_camera *in,
                                 scene_camera *out);
int scene_count_views(const scene_document *d, const char *path, const scene_file_camera *in);
/* Turn a camera with an orbit to a view of it. */
void scene_place_view(scene_camera *camera, int view);

/* The path of an output that goes into a database. */
insitu_status scene_convert_cinema(const scene_document *d, const char *path, const scene_file_output *in,
                                   const scene_image *image, scene_output *out);
/* List the pictures of several images, and number their cells; views are still to be made. */
insitu_status scene_find_montages(const scene_document *d, scene *s);
/* List the databases of all images; views are still to be made. */
insitu_status scene_find_databases(const scene_document *d, scene *s);

/* Each fills one part of an image; path is that of the file's part, for messages. */
insitu_status scene_convert_camera(const scene_document *d, const char *path, const scene_file_camera *in,
                                   scene_camera *out);
insitu_status scene_convert_lights(const scene_document *d, const char *path, const scene_file_image *in,
                                   scene_image *out);
/* After the lights. */
insitu_status scene_convert_shadows(const scene_document *d, const char *path, const scene_file_image *in,
                                    scene_image *out);
insitu_status scene_convert_layers(const scene_document *d, const char *path, const scene_file_image *in,
                                   scene_image *out);
insitu_status scene_convert_outputs(const scene_document *d, const char *path, const scene_file_image *in,
                                    scene_image *out);

insitu_status scene_convert_decorations(const scene_document *d, const char *path, const scene_file_decorations *in,
                                        scene_decorations *out);
void scene_free_decorations(scene_decorations *decorations);
void scene_free_field(scene_field *field);
/* Refuses unknown placeholders, and those that stand for something that the image does not have. key: of the text;
 * path: below the image. */
insitu_status scene_check_placeholders(const scene_document *d, const char *path, const char *key, const char *text);

/* The keys that say how values become colours, of the mapping at path. */
insitu_status scene_convert_colour_map(const scene_document *d, const char *path, const scene_file_colour_map *in,
                                       scene_colour_map *out);

/* The colours of a map in a file that ParaView may have written, as points in rising order (from base_alloc()).
 * file_name: for messages, and name: which of its maps; NULL: its only one. */
insitu_status scene_read_colour_file(const scene_attachment *file, const char *file_name, const char *name,
                                     scene_colour_points *out, base_error *error);

/* Copies the texts of a list into an array of their number, to be freed by the caller, after an error too. path NULL:
 * there are none. */
insitu_status scene_copy_texts(const scene_document *d, const char *path, char ***out, int *out_count);

/* The meshes that a layer names. layer: its path. */
insitu_status scene_convert_meshes(const scene_document *d, const char *layer, scene_field *out);

/* A component by its word: magnitude, x, y, z or a number. NULL: SCENE_COMPONENT_DEFAULT. path: of the mapping with the
 * key `component`. */
insitu_status scene_convert_component(const scene_document *d, const char *path, const char *text, int *component);

/* A field as a layer shows it. layer: the path of the layer, which says on what meshes; path: that of the mapping which
 * names the field. */
insitu_status scene_convert_field(const scene_document *d, const char *layer, const char *path, const char *name,
                                  const char *component, scene_field *out);

/* The field that colours a layer, whose path is given. */
insitu_status scene_convert_colour_by(const scene_document *d, const char *path, const scene_file_colour_by *in,
                                      scene_field *out, scene_colour_map *map);

/* The contour lines of a layer, whose path is given; in: NULL where there are none. colours: the field that colours the
 * layer, or NULL; height: of the picture. */
insitu_status scene_convert_lines(const scene_document *d, const char *layer, const scene_file_lines *in,
                                  const scene_field *colours, int height, scene_lines *out);

/* NULL: a slight gloss. */
scene_material scene_convert_material(const scene_file_material *in);

/* Adds the clips to the image's list and to the set, a bit for each entry of the list. in is NULL where there are none.
 */
insitu_status scene_convert_clip(const scene_document *d, const char *path, const scene_file_clip *in,
                                 scene_image *image, uint32_t *set);
/* Makes the set of a layer: the clips of all layers, and its own. */
insitu_status scene_convert_layer_clip(const scene_document *d, const char *layer, const scene_file_clip *in,
                                       scene_image *image, uint32_t *set);
/* The plane of the number in the list `planes` of the mapping at path. */
insitu_status scene_convert_plane(const scene_document *d, const char *path, int index, const scene_file_plane *in,
                                  scene_plane *out);
/* height: of the picture. */
insitu_status scene_convert_surface(const scene_document *d, const char *path, const scene_file_surface *in, int height,
                                    scene_surface *out);
/* Counts the planes of all entries of its list. */
int scene_count_planes(const scene_file_slice *in);
insitu_status scene_convert_slice(const scene_document *d, const char *path, const scene_file_slice *in, int height,
                                  scene_slice *out);

/* in: NULL where there is none; image: its path. */
insitu_status scene_convert_condition(const scene_document *d, const char *image, const scene_file_condition *in,
                                      scene_condition *out);
insitu_status scene_convert_statistics(const scene_document *d, const scene_file *in, scene *out);

/* The derived fields, sorted: each after those that it is made of. */
insitu_status scene_convert_derived(const scene_document *d, const scene_file *in, scene *out);
void scene_free_derived(scene *s);
insitu_status scene_convert_parameters(const scene_document *d, scene *out);

/* Refuse two outputs that would be one file. */
insitu_status scene_check_outputs(const scene_document *d, const scene *s);

#endif
