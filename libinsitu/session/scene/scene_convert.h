/* Converts the schema's structs (scene_schema.h) into a struct scene: fills in defaults, and checks what the schema
 * cannot express. */
#ifndef SCENE_SCENE_CONVERT_H
#define SCENE_SCENE_CONVERT_H

#include "colour_space.h"
#include "scene.h"
#include "scene_document.h"

enum { SCENE_PATH_SIZE = 128 };

/* The points between which the colours of a map are interpolated. */
typedef struct scene_colour_points {
    int count;
    colour_point *items;
    colour_space space;
    bool is_banded; /* set if each colour belongs to a band and is not interpolated */
} scene_colour_points;

/* Scales v to unit length; returns false for a zero vector. */
bool scene_normalize_vector(double v[3]);
/* Returns whether two unit vectors are parallel within a millionth of a radian. */
bool scene_are_vectors_parallel(const double a[3], const double b[3]);

/* Numbers of fields, isovalues, planes and views over which an image varies. It makes one picture for each combination,
 * so that the product is the number of its pictures in a step. */
typedef struct scene_series {
    int fields, isovalues, planes, views; /* each is at least 1 */
} scene_series;

/* Checks the image's sweep, and counts the fields, isovalues, planes and views over which it makes pictures. path: path
 * of the image in the file. */
insitu_status scene_count_sweep_dimensions(const scene_document *d, const char *path, const scene_file_image *in,
                                           scene_series *out);
/* Counts the pictures of all images together; more than SCENE_MAX_PICTURES are an error. */
insitu_status scene_count_pictures(const scene_document *d, const scene_file *in, int *count);
/* Reduces the layers of an image to what one of its pictures shows (scene_variant): the field, the isovalue and the
 * plane that the picture's sweep selects. in: the image as the file gives it. */
insitu_status scene_apply_sweep(const scene_document *d, const char *path, const scene_file_image *in,
                                scene_image *out);

/* These functions convert the keys of a camera that give it several positions: its orbit or its path. path: path of the
 * camera in the file. */
insitu_status scene_convert_orbit(const scene_document *d, const char *path, const scene_file_camera *in,
                                  scene_camera *out);
insitu_status scene_convert_path(const scene_document *d, const char *path, const scene_file_camera *in,
                                 scene_camera *out);
int scene_count_orbit_views(const scene_document *d, const char *path, const scene_file_camera *in);
/* Sets the direction of a camera with an orbit to the direction of the view with this index. */
void scene_set_orbit_view(scene_camera *camera, int view);

/* Converts the path of an output that belongs to a Cinema database (scene_database). */
insitu_status scene_convert_cinema(const scene_document *d, const char *path, const scene_file_output *in,
                                   const scene_image *image, scene_output *out);
/* Lists the files with several pictures (scene_montage) of all images, and assigns indices to the pictures in them.
 * Must be called before the further views of orbits are added to the scene. */
insitu_status scene_assign_outputs_to_montages(const scene_document *d, scene *s);
/* Lists the Cinema databases of all images. Must be called before the further views of orbits are added to the scene.
 */
insitu_status scene_assign_outputs_to_databases(const scene_document *d, scene *s);

/* The functions below convert one part of an image each. path: path of this part in the file, for messages. */
insitu_status scene_convert_camera(const scene_document *d, const char *path, const scene_file_camera *in,
                                   scene_camera *out);
insitu_status scene_convert_lights(const scene_document *d, const char *path, const scene_file_image *in,
                                   scene_image *out);
/* Converts shadows and ambient occlusion. Must be called after scene_convert_lights(). */
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
/* Returns an error if the text has an unknown placeholder, or one for a value that the image does not have. key: key of
 * the text; path: path of the mapping with this key. */
insitu_status scene_check_placeholders(const scene_document *d, const char *path, const char *key, const char *text);

/* Converts the keys that describe how values are mapped to colours. path: path of the mapping with these keys. */
insitu_status scene_convert_colour_map(const scene_document *d, const char *path, const scene_file_colour_map *in,
                                       scene_colour_map *out);

/* Reads a colour map from a file in ParaView's format as points with increasing positions (allocated by base_alloc()).
 * file_name: for messages; name: selects one of the file's maps, or NULL for its only map. */
insitu_status scene_read_colour_file(const scene_attachment *file, const char *file_name, const char *name,
                                     scene_colour_points *out, base_error *error);

/* Copies the texts of the node at the path (a text or a list of texts) into a new array. The caller must free the array
 * and the texts, even after an error. If path is NULL, the array is empty. */
insitu_status scene_copy_texts(const scene_document *d, const char *path, char ***out, int *out_count);

/* Converts the list of mesh names of a layer. layer: path of the layer in the file. */
insitu_status scene_convert_mesh_names(const scene_document *d, const char *layer, scene_field *out);

/* Converts the text that selects a component: magnitude, x, y, z or a number; NULL means SCENE_COMPONENT_DEFAULT. path:
 * path of the mapping with the key `component`. */
insitu_status scene_convert_component(const scene_document *d, const char *path, const char *text, int *component);

/* Converts a field of a layer. layer: path of the layer, which names the meshes; path: path of the mapping that names
 * the field. */
insitu_status scene_convert_field(const scene_document *d, const char *layer, const char *path, const char *name,
                                  const char *component, scene_field *out);

/* Converts the field that colours the layer at the path. */
insitu_status scene_convert_colour_by(const scene_document *d, const char *path, const scene_file_colour_by *in,
                                      scene_field *out, scene_colour_map *map);

/* Converts the contour lines of a layer. layer: path of the layer in the file; in: NULL if there are no lines; colours:
 * the field that colours the layer, or NULL; height: height of the picture in pixels. */
insitu_status scene_convert_lines(const scene_document *d, const char *layer, const scene_file_lines *in,
                                  const scene_field *colours, int height, scene_lines *out);

/* Converts a material. in: NULL for the default material, which is slightly glossy. */
scene_material scene_convert_material(const scene_file_material *in);

/* Adds the clips at the path to the image's list (scene_image.clips), and sets their bits in *set. Bit i stands for
 * entry i of the list. in: NULL if there are no clips. */
insitu_status scene_convert_clip(const scene_document *d, const char *path, const scene_file_clip *in,
                                 scene_image *image, uint32_t *set);
/* Computes the set of clips that cut a layer: the image's clips, which cut all layers, and the clips that the file
 * gives for this layer. */
insitu_status scene_convert_layer_clip(const scene_document *d, const char *layer, const scene_file_clip *in,
                                       scene_image *image, uint32_t *set);
/* Converts the plane with this index in the list `planes` of the mapping at the path. */
insitu_status scene_convert_plane(const scene_document *d, const char *path, int index, const scene_file_plane *in,
                                  scene_plane *out);
/* Converts an outer surface. height: height of the picture in pixels, for the default width of lines. */
insitu_status scene_convert_surface(const scene_document *d, const char *path, const scene_file_surface *in, int height,
                                    scene_surface *out);
/* Returns the number of planes of all entries of the slice's list together. */
int scene_count_planes(const scene_file_slice *in);
insitu_status scene_convert_slice(const scene_document *d, const char *path, const scene_file_slice *in, int height,
                                  scene_slice *out);

/* Converts the condition of an image. in: NULL if there is none; image: path of the image in the file. */
insitu_status scene_convert_condition(const scene_document *d, const char *image, const scene_file_condition *in,
                                      scene_condition *out);
insitu_status scene_convert_statistics(const scene_document *d, const scene_file *in, scene *out);

/* Converts the derived fields, and sorts them so that each comes after the fields from which it is derived. */
insitu_status scene_convert_derived(const scene_document *d, const scene_file *in, scene *out);
void scene_free_derived(scene *s);
insitu_status scene_convert_parameters(const scene_document *d, scene *out);
/* Converts the key `meshes`: for each mesh, the field by which its vertices are displaced (scene_warp), and the planes
 * at which it is mirrored (scene_mirror). */
insitu_status scene_convert_mesh_transforms(const scene_document *d, const scene_file *in, scene *out);
void scene_free_mesh_transforms(scene *s);

/* Returns an error if two outputs would be written to the same file. */
insitu_status scene_check_output_paths_differ(const scene_document *d, const scene *s);

#endif
