/* Reads a scene. The document is checked against the schema and stored in the schema's structs (scene_schema.h). These
 * structs are then converted to a struct scene, in which all defaults are filled in and all colours are linear.
 *
 * strtod() reads numbers according to the locale, and a simulation may run in a locale with a decimal comma. Therefore
 * the thread is switched to the C locale while a scene is read, and back afterwards. */
#include "scene.h"

#include <stdio.h>
#include <string.h>

#include "colour_map.h"
#include "memory.h"
#include "scene_convert.h"
#include "text_file.h"

/* ---- images ---- */

static insitu_status check_and_copy_image_name(const scene_document *d, const char *path, const scene *s,
                                               const char *name, scene_image *out)
{
    if (strchr(name, '/')) return scene_fail_at_key(d, path, "name", "\"%s\" holds a /, expected a name without", name);
    for (const scene_image *other = s->images; other < out; other++) {
        if (other->variant.source != out->variant.source && strcmp(other->name, name) == 0) {
            return scene_fail_at_key(
                d, path, "name", "\"%s\" is the name of the image in line %d too, expected another", name, other->line);
        }
    }
    out->name = base_strdup(name);
    return out->name ? INSITU_OK : scene_fail_for_memory(d);
}

static void convert_background(const scene_file_image *in, float background[4])
{
    static const double standard[4] = {0.08, 0.09, 0.11, 1};
    const double *given = in->background ? in->background : standard;
    const float alpha = in->background && in->background_count < 4 ? 1 : (float)given[3];
    for (int i = 0; i < 3; i++) background[i] = alpha * colour_linear_from_srgb((float)given[i]);
    background[3] = alpha;
}

/* Returns whether the scene leaves the sampling of volumes to the defaults. All keys of `sampling` except reproducible
 * and max_seconds specify the sampling, even those that apply only to samples. */
static bool is_sampling_unspecified(const scene_file_sampling *in)
{
    return !in->method && !in->max_error && !in->step && !in->step_cells && !in->jitter && !in->frames;
}

/* Chooses the default method for volumes. A single volume is integrated over the segments of each ray, with an error
 * bound: samples would be cheaper, but their noise has no known bound. Several volumes are sampled, because otherwise
 * the segments of different volumes would have to be blended at each pixel. */
static void choose_volume_sampling_method(const scene_file_sampling *in, scene_image *out)
{
    static const double default_error = 0.01;
    const bool by_default = is_sampling_unspecified(in) && out->volume_count == 1;
    out->max_error = in->max_error ? *in->max_error : by_default ? default_error : 0;
    out->has_default_samples = is_sampling_unspecified(in) && out->volume_count > 1;
    out->method = in->method ? (scene_sampling_method)*in->method : out->max_error > 0 ? SCENE_SEGMENTS : SCENE_SAMPLES;
}

static insitu_status convert_sampling(const scene_document *d, const char *path, const scene_file_sampling *in,
                                      scene_image *out)
{
    static const scene_file_sampling none;
    if (!in) in = &none;
    choose_volume_sampling_method(in, out);
    out->step = in->step ? *in->step : 0;
    out->step_cells = in->step_cells ? *in->step_cells : SCENE_STEP_CELLS;
    out->jitter = in->jitter ? *in->jitter : true;
    out->frames = in->frames ? *in->frames : 1;
    out->is_reproducible = in->reproducible && *in->reproducible;
    out->max_seconds = in->max_seconds ? *in->max_seconds : 3600;
    if (in->step && in->step_cells)
        return scene_fail_at_key(d, path, "sampling.step", "given beside step_cells, expected one of the two");
    if (in->max_error && (in->step || in->step_cells))
        return scene_fail_at_key(d, path, "sampling.max_error", "given beside a step, expected one of the two");
    if (in->max_error && out->method == SCENE_SAMPLES)
        return scene_fail_at_key(d, path, "sampling.max_error", "given with method: samples, expected segments");
    return INSITU_OK;
}

static insitu_status convert_sample_count_per_pixel(const scene_document *d, const char *path, const int *antialias,
                                                    scene_image *out)
{
    const int count = antialias ? *antialias : 1;
    if (count & (count - 1)) return scene_fail_at_key(d, path, "antialias", "is %d, expected 1, 2, 4, 8 or 16", count);
    out->antialias = count;
    out->frames = (out->frames + count - 1) / count * count;
    return INSITU_OK;
}

static insitu_status convert_image(const scene_document *d, const char *path, const scene_file_image *in,
                                   const scene *s, scene_image *out)
{
    char camera_path[SCENE_PATH_SIZE], clip_path[SCENE_PATH_SIZE];
    snprintf(camera_path, sizeof camera_path, "%s.camera", path);
    snprintf(clip_path, sizeof clip_path, "%s.clip", path);
    out->line = scene_get_line_number_at_path(d, path);
    out->width = in->size ? in->size[0] : 1280;
    out->height = in->size ? in->size[1] : 720;
    out->cycle_interval = in->every ? *in->every : 1;
    out->time_interval = in->every_time ? *in->every_time : 0;
    convert_background(in, out->background);
    insitu_status status = check_and_copy_image_name(d, path, s, in->name, out);
    if (status == INSITU_OK && in->every && in->every_time)
        status = scene_fail_at_key(d, path, "every_time", "given beside every, expected one of the two");
    if (status == INSITU_OK) status = scene_convert_camera(d, camera_path, in->camera, &out->camera);
    if (status == INSITU_OK) status = scene_convert_lights(d, path, in, out);
    if (status == INSITU_OK) status = scene_convert_shadows(d, path, in, out);
    if (status == INSITU_OK) status = scene_convert_clip(d, clip_path, in->clip, out, &out->clips_of_all);
    if (status == INSITU_OK) status = scene_convert_layers(d, path, in, out);
    if (status == INSITU_OK) status = scene_apply_sweep(d, path, in, out);
    out->is_drawn_once = in->once && *in->once;
    if (status == INSITU_OK) status = scene_convert_condition(d, path, in->when, &out->condition);
    if (status == INSITU_OK) status = convert_sampling(d, path, in->sampling, out);
    if (status == INSITU_OK) status = convert_sample_count_per_pixel(d, path, in->antialias, out);
    char decorations_path[SCENE_PATH_SIZE];
    snprintf(decorations_path, sizeof decorations_path, "%s.decorations", path);
    if (status == INSITU_OK)
        status = scene_convert_decorations(d, decorations_path, in->decorations, &out->decorations);
    if (status == INSITU_OK) status = scene_convert_outputs(d, path, in, out);
    return status;
}

/* Converts an image once for each combination of a field, an isovalue and a plane of its sweep. Of the views of an
 * orbit, only the first is converted. */
static insitu_status convert_variants_of_image(const scene_document *d, const scene_file *in, int source, scene *out)
{
    char path[32];
    scene_series series;
    snprintf(path, sizeof path, "images[%d]", source);
    insitu_status status = scene_count_sweep_dimensions(d, path, &in->images[source], &series);
    for (int i = 0; !status && i < series.fields * series.isovalues * series.planes; i++) {
        scene_image *image = &out->images[out->image_count++];
        const int values = i / series.planes;
        image->variant =
            (scene_variant){source, i, values / series.isovalues, values % series.isovalues, i % series.planes, 0};
        status = convert_image(d, path, &in->images[source], out, image);
    }
    return status;
}

/* Inserts the other views of orbits after the first view of each image. The loop starts at the last image, because the
 * array has unused entries only at its end. */
static void add_orbit_views(scene *s, int picture_count)
{
    int end = picture_count;
    for (int i = s->image_count - 1; i >= 0; i--) {
        const scene_image first = s->images[i];
        const scene_orbit *orbit = &first.camera.orbit;
        const int views = orbit->view_count ? orbit->view_count * orbit->circle_count : 1;
        end -= views;
        for (int view = 0; view < views; view++) {
            scene_image *image = &s->images[end + view];
            *image = first;
            image->variant.view = view;
            if (view) scene_set_orbit_view(&image->camera, view);
        }
    }
    s->image_count = picture_count;
}

static insitu_status convert_images(const scene_document *d, const scene_file *in, scene *out)
{
    int count = 0;
    insitu_status status = scene_count_pictures(d, in, &count);
    if (status) return status;
    out->images = base_calloc((size_t)count, sizeof *out->images);
    if (!out->images) return scene_fail_for_memory(d);
    for (int i = 0; i < in->images_count && !status; i++) status = convert_variants_of_image(d, in, i, out);
    if (!status) status = scene_assign_outputs_to_databases(d, out);
    if (!status) status = scene_assign_outputs_to_montages(d, out);
    if (!status) add_orbit_views(out, count);
    return status;
}

static insitu_status convert_higher_order_settings(const scene_document *d, const scene_file *in, scene *out)
{
    out->finer_pieces = in->finer_pieces ? *in->finer_pieces : 0;
    out->surface_error = in->surface_error ? *in->surface_error : SCENE_SURFACE_ERROR;
    out->is_surface_error_given = in->surface_error != NULL;
    out->finer_memory = in->finer_memory ? *in->finer_memory : SCENE_FINER_MEMORY;
    if (in->finer_pieces && in->surface_error)
        return scene_fail_at_key(d, "surface_error", "", "given beside finer_pieces, expected one of the two");
    return INSITU_OK;
}

static insitu_status convert_scene_file(const scene_document *d, const scene_file *in, scene *out)
{
    out->threads = in->threads ? *in->threads : 0;
    out->tree = in->tree ? (scene_tree)*in->tree : SCENE_TREE_AUTO;
    out->schedule = in->schedule ? (scene_schedule)*in->schedule : SCENE_SCHEDULE_AUTO;
    out->writing = in->writing ? (scene_writing)*in->writing : SCENE_WRITE_BEHIND;
    insitu_status status = convert_higher_order_settings(d, in, out);
    if (status == INSITU_OK) status = scene_convert_derived(d, in, out);
    if (status == INSITU_OK) status = convert_images(d, in, out);
    if (status == INSITU_OK) status = scene_convert_statistics(d, in, out);
    if (status == INSITU_OK) status = scene_convert_parameters(d, out);
    if (status == INSITU_OK) status = scene_convert_mesh_transforms(d, in, out);
    return status == INSITU_OK ? scene_check_output_paths_differ(d, out) : status;
}

/* ---- meshes ---- */

bool scene_name_selects_mesh(const char *name, const char *mesh)
{
    const size_t length = strlen(name);
    return strncmp(name, mesh, length) == 0 && (mesh[length] == '\0' || mesh[length] == '/');
}

bool scene_field_selects_mesh(const scene_field *field, const char *mesh)
{
    for (int i = 0; i < field->mesh_count; i++)
        if (scene_name_selects_mesh(field->meshes[i], mesh)) return true;
    return field->mesh_count == 0;
}

/* Returns whether the entry with this name should be used for the mesh instead of the best entry so far, whose name is
 * `found`. This is the case if `name` selects the mesh and is longer than `found`, or if found is NULL. */
static bool is_longer_matching_name(const char *name, const char *found, const char *mesh)
{
    return scene_name_selects_mesh(name, mesh) && (!found || strlen(name) > strlen(found));
}

const scene_warp *scene_find_warp(const scene *s, const char *mesh)
{
    const scene_warp *found = NULL;
    for (int i = 0; i < s->warp_count; i++) {
        const scene_warp *warp = &s->warps[i];
        if (is_longer_matching_name(warp->mesh, found ? found->mesh : NULL, mesh)) found = warp;
    }
    return found;
}

const scene_mirror *scene_find_mirror(const scene *s, const char *mesh)
{
    const scene_mirror *found = NULL;
    for (int i = 0; i < s->mirror_count; i++) {
        const scene_mirror *mirror = &s->mirrors[i];
        if (is_longer_matching_name(mirror->mesh, found ? found->mesh : NULL, mesh)) found = mirror;
    }
    return found;
}

/* ---- whole scenes ---- */

static insitu_status parse_in_c_locale(const char *text, size_t size, const char *file_name,
                                       scene_attachments *attachments, scene *out, base_error *error)
{
    scene_document document;
    scene_file *file = NULL;
    insitu_status status = scene_document_open(&document, text, size, file_name, error);
    if (status != INSITU_OK) return status;
    document.attachments = attachments;
    status = scene_convert_document_to_structs(&document, &file);
    if (status == INSITU_OK) status = convert_scene_file(&document, file, out);
    scene_document_close(&document);
    return status;
}

insitu_status scene_parse(const char *text, size_t size, const char *file_name, scene_attachments *attachments,
                          scene *out, base_error *error)
{
    base_error ignored = {.status = INSITU_OK};
    *out = (scene){0};
    c_locale numbers;
    if (!c_locale_enter(&numbers))
        return base_fail(error, INSITU_ERROR_MEMORY, "%.300s: no memory for the scene", file_name);
    const insitu_status status = parse_in_c_locale(text, size, file_name, attachments, out, error ? error : &ignored);
    c_locale_leave(&numbers);
    if (status != INSITU_OK) scene_free(out);
    return status;
}

void scene_attachments_free(scene_attachments *attachments)
{
    for (int i = 0; i < attachments->count; i++) {
        base_free(attachments->items[i].path);
        base_free(attachments->items[i].text);
    }
    base_free(attachments->items);
    attachments->items = NULL;
    attachments->count = 0;
}

static void free_colour_map(scene_colour_map *map)
{
    base_free(map->name);
    base_free(map->colours);
}

static void free_image(scene_image *image)
{
    /* the variants of an image that differ only in their view share these arrays; the one with view 0 owns them */
    if (image->variant.view > 0) return;
    for (int i = 0; i < image->isosurface_count; i++) {
        scene_isosurface *surface = &image->isosurfaces[i];
        scene_free_field(&surface->field);
        scene_free_field(&surface->colour_by);
        scene_free_field(&surface->lines.field);
        base_free(surface->values);
        base_free(surface->colours);
        free_colour_map(&surface->colour_map);
    }
    for (int i = 0; i < image->volume_count; i++) {
        scene_free_field(&image->volumes[i].field);
        base_free(image->volumes[i].opacity);
        free_colour_map(&image->volumes[i].colour_map);
    }
    for (int i = 0; i < image->surface_count; i++) {
        scene_free_field(&image->surfaces[i].meshes_field);
        scene_free_field(&image->surfaces[i].colour_by);
        scene_free_field(&image->surfaces[i].lines.field);
        scene_free_field(&image->surfaces[i].threshold.field);
        free_colour_map(&image->surfaces[i].colour_map);
    }
    for (int i = 0; i < image->slice_count; i++) {
        scene_free_field(&image->slices[i].field);
        scene_free_field(&image->slices[i].lines.field);
        base_free(image->slices[i].planes);
        free_colour_map(&image->slices[i].colour_map);
    }
    for (int i = 0; i < image->output_count; i++) base_free(image->outputs[i].path);
    scene_free_decorations(&image->decorations);
    scene_free_field(&image->condition.field);
    base_free(image->name);
    base_free(image->swept_field);
    base_free(image->camera.points);
    base_free(image->isosurfaces);
    base_free(image->volumes);
    base_free(image->slices);
    base_free(image->clips);
    base_free(image->surfaces);
    base_free(image->lights);
    base_free(image->outputs);
}

void scene_free(scene *s)
{
    for (int i = 0; i < s->image_count; i++) free_image(&s->images[i]);
    base_free(s->images);
    for (int i = 0; i < s->statistics_count; i++) {
        scene_free_field(&s->statistics[i].field);
        base_free(s->statistics[i].path);
    }
    base_free(s->statistics);
    scene_free_derived(s);
    for (int i = 0; i < s->parameter_count; i++) base_free(s->parameters[i].name);
    base_free(s->parameters);
    scene_free_mesh_transforms(s);
    for (int i = 0; i < s->database_count; i++) base_free(s->databases[i].path);
    base_free(s->databases);
    for (int i = 0; i < s->montage_count; i++) base_free(s->montages[i].name);
    base_free(s->montages);
    *s = (scene){0};
}
