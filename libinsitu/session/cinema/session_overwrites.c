#include "session_overwrites.h"

#include <string.h>

#include "memory.h"
#include "session_hash.h"

/* Computes a hash of a path. The components "." and repeated slashes are ignored, so that different paths to the same
 * file have equal hashes. The result is never 0. */
static uint64_t hash_path(const char *path)
{
    uint64_t hash = SESSION_HASH_BEGIN;
    bool is_part_begun = false;
    if (path[0] == '/') session_hash_bytes(&hash, "/", 1);
    while (*path) {
        const size_t size = strcspn(path, "/");
        const bool is_shown = size > 0 && !(size == 1 && path[0] == '.');
        if (is_shown && is_part_begun) session_hash_bytes(&hash, "/", 1);
        if (is_shown) session_hash_bytes(&hash, path, size);
        is_part_begun = is_part_begun || is_shown;
        path += size + (path[size] == '/');
    }
    return hash ? hash : 1;
}

static int count_outputs_before(const scene *scene, int image)
{
    int count = 0;
    for (int i = 0; i < image; i++) count += scene->images[i].output_count;
    return count;
}

/* Returns the image of the scene that has this output. */
static const scene_image *find_image_with_output(const scene *scene, int output)
{
    int image = 0;
    while (output >= scene->images[image].output_count) output -= scene->images[image++].output_count;
    return &scene->images[image];
}

/* Returns the record of a file, of which `file` is the hash of its path, or NULL if there is none. A picture that the
 * output `output` itself wrote at the same cycle is ignored, because in that case the step was repeated. */
static session_written *find_record_of_file(const session_overwrites *all, uint64_t file, int output, long long cycle)
{
    for (session_written *it = all->last_files; it < all->last_files + all->count; it++)
        if (it->file == file && (it->output != output || it->cycle != cycle)) return it;
    return NULL;
}

/* Records that the output has written a picture to the file. Records of other outputs with this file are changed, too,
 * because their pictures are overwritten. */
static void record_file(session_overwrites *all, uint64_t file, int output, long long cycle)
{
    all->last_files[output].file = file;
    for (int i = 0; i < all->count; i++)
        if (all->last_files[i].file == file) all->last_files[i] = (session_written){file, cycle, output};
}

/* Returns the advice at the end of the warning: how to avoid the overwriting. */
static const char *get_overwrite_advice(const scene_image *image, const scene_image *before, bool is_same_output)
{
    if (is_same_output) return "put {cycle} into its path to keep a picture of each step";
    if (image->variant.source != before->variant.source)
        return "give each image's outputs paths of their own, as with {name} in them";
    return "give each of its pictures a path of its own";
}

static void warn_of_overwrite(const session_written *before, const scene *scene, const scene_image *image, int output,
                              const char *path, long long cycle, session_report *report)
{
    const scene_image *earlier = find_image_with_output(scene, before->output);
    session_warn(report, &(session_warning){WARNING_REPLACED, image->name, NULL, 0}, true,
                 "image \"%s\": %.400s, written at cycle %lld by image \"%s\", is overwritten at cycle %lld; %s",
                 image->name, path, before->cycle, earlier->name, cycle,
                 get_overwrite_advice(image, earlier, before->output == output));
}

static bool reserve_entries(session_overwrites *all, const scene *scene)
{
    if (all->last_files) return true;
    const int count = count_outputs_before(scene, scene->image_count);
    all->last_files = base_calloc((size_t)count, sizeof *all->last_files);
    all->count = all->last_files ? count : 0;
    return all->last_files != NULL;
}

void session_record_written_files(session_overwrites *all, const scene *scene, int image, long long cycle, double time,
                                  session_report *report)
{
    const scene_image *drawn = &scene->images[image];
    const scene_placeholder_values moment = scene_make_placeholder_values(drawn, cycle, time);
    if (!reserve_entries(all, scene)) return;
    const int first = count_outputs_before(scene, image);
    for (int i = 0; i < drawn->output_count; i++) {
        const scene_output *output = &drawn->outputs[i];
        if (output->montage >= 0 && output->first_panel + drawn->variant.view > 0)
            continue; /* all panels of a montage are in one file, so that only the output of the first panel is
                         recorded */
        char *path = scene_expand_placeholders(drawn->outputs[i].path, &moment);
        if (!path) continue;
        const uint64_t file = hash_path(path);
        const session_written *before = find_record_of_file(all, file, first + i, cycle);
        if (before) warn_of_overwrite(before, scene, drawn, first + i, path, cycle, report);
        record_file(all, file, first + i, cycle);
        base_free(path);
    }
}

void session_overwrites_free(session_overwrites *overwrites)
{
    base_free(overwrites->last_files);
    *overwrites = (session_overwrites){0};
}
