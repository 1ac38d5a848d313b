/* Reads outputs that belong to Cinema databases: folders of pictures, each with a table that describes the pictures. */
#include <stdio.h>
#include <string.h>

#include "memory.h"
#include "scene_convert.h"

/* Returns the first control character of the text, or NULL. A database must not contain control characters, so that
 * each picture is exactly one line of the table and an incomplete line can be recognised. */
static const char *find_control_character(const char *text)
{
    for (; text && *text; text++)
        if ((unsigned char)*text < 0x20 || *text == 0x7f) return text;
    return NULL;
}

static insitu_status check_database_folder_name(const scene_document *d, const char *path, const char *folder)
{
    const size_t length = strlen(folder);
    if (length < 5 || strcmp(folder + length - 4, ".cdb") != 0 || folder[length - 5] == '/')
        return scene_fail_at_key(d, path, "cinema",
                                 "\"%.100s\" has another ending, expected a folder's name that ends in .cdb", folder);
    if (strchr(folder, '{'))
        return scene_fail_at_key(d, path, "cinema",
                                 "\"%.100s\" holds a placeholder, expected one folder for all pictures", folder);
    return find_control_character(folder)
               ? scene_fail_at_key(d, path, "cinema", "holds a control character, expected a folder's name")
               : INSITU_OK;
}

static insitu_status check_file_name_in_database(const scene_document *d, const char *path, const scene_image *image,
                                                 const char *file)
{
    if (file && (file[0] == '/' || strncmp(file, "../", 3) == 0 || strstr(file, "/../")))
        return scene_fail_at_key(d, path, "path", "\"%.100s\" is not below the folder, expected a file in the database",
                                 file);
    if (find_control_character(file) || find_control_character(image->name) ||
        find_control_character(image->swept_field))
        return scene_fail_at_key(d, path, file ? "path" : "cinema",
                                 "the picture's name or field holds a control character, expected none in a database");
    return INSITU_OK;
}

static const char *make_default_file_name(const scene_image *image, char file[96])
{
    snprintf(file, 96, "{name}_{cycle:06}%s%s%s%s.png", image->camera.orbit.view_count ? "_{view:03}" : "",
             image->has_isovalue ? "_{isovalue}" : "", image->has_plane ? "_{plane:02}" : "",
             image->swept_field ? "_{field}" : "");
    return file;
}

/* Joins folder and file name to the output's path. */
static insitu_status join_output_path(const scene_document *d, const char *folder, const char *file, scene_output *out)
{
    const size_t size = strlen(folder) + strlen(file) + 2;
    out->path = base_alloc(size);
    if (!out->path) return scene_fail_for_memory(d);
    snprintf(out->path, size, "%s/%s", folder, file);
    out->folder_bytes = (int)strlen(folder) + 1;
    return INSITU_OK;
}

insitu_status scene_convert_cinema(const scene_document *d, const char *path, const scene_file_output *in,
                                   const scene_image *image, scene_output *out)
{
    char file[96];
    const char *folder = in->cinema;
    /* removes "./", so that folders that are written differently in the scene, but are the same, have one table */
    while (strncmp(folder, "./", 2) == 0) folder += 2;
    insitu_status status = check_database_folder_name(d, path, folder);
    if (!status) status = check_file_name_in_database(d, path, image, in->path);
    if (!status && out->format == SCENE_EXR)
        status = scene_fail_at_key(d, path, "path", "\"%.100s\" is no PNG, expected .png in a database", in->path);
    return status ? status
                  : join_output_path(d, folder, in->path ? in->path : make_default_file_name(image, file), out);
}

/* ---- databases ------------------------------------------------------------------------------------------------- */

static bool is_output_in_folder(const scene_output *output, const char *folder)
{
    const size_t length = strlen(folder);
    return output->folder_bytes == (int)length + 1 && strncmp(output->path, folder, length) == 0;
}

/* Returns the index of the database with the output's folder. If there is none yet, it is added. Returns -1 if memory
 * runs out. */
static int find_or_add_database(scene *s, const scene_image *image, const scene_output *output)
{
    for (int i = 0; i < s->database_count; i++)
        if (is_output_in_folder(output, s->databases[i].path)) return i;
    scene_database *items = base_realloc(s->databases, (size_t)(s->database_count + 1) * sizeof *items);
    if (!items) return -1;
    s->databases = items;
    char *folder = base_alloc((size_t)output->folder_bytes);
    if (!folder) return -1;
    snprintf(folder, (size_t)output->folder_bytes, "%s", output->path);
    items[s->database_count] = (scene_database){.path = folder, .first_image = image->variant.source};
    return s->database_count++;
}

static void set_database_columns(scene_database *database, const scene_image *image)
{
    database->has_images = database->has_images || image->variant.source != database->first_image;
    database->has_orbits = database->has_orbits || image->camera.orbit.view_count > 0;
    database->has_isovalues = database->has_isovalues || image->has_isovalue;
    database->has_planes = database->has_planes || image->has_plane;
    database->has_fields = database->has_fields || image->swept_field;
}

static insitu_status add_output_to_database(const scene_document *d, scene *s, scene_image *image, int index)
{
    scene_output *output = &image->outputs[index];
    output->database = -1;
    if (output->folder_bytes == 0) return INSITU_OK;
    output->database = find_or_add_database(s, image, output);
    if (output->database < 0) return scene_fail_for_memory(d);
    set_database_columns(&s->databases[output->database], image);
    for (int i = 0; i < index; i++) {
        if (image->outputs[i].database != output->database) continue;
        char path[64];
        snprintf(path, sizeof path, "images[%d].outputs[%d]", image->variant.source, index);
        return scene_fail_at_key(d, path, "cinema", "\"%.100s\" has this image already, expected it there once",
                                 s->databases[output->database].path);
    }
    return INSITU_OK;
}

insitu_status scene_assign_outputs_to_databases(const scene_document *d, scene *s)
{
    insitu_status status = INSITU_OK;
    for (int i = 0; i < s->image_count; i++)
        for (int o = 0; o < s->images[i].output_count && !status && s->images[i].variant.view == 0; o++)
            status = add_output_to_database(d, s, &s->images[i], o);
    return status;
}
