#include "session_parameters.h"

#include "session_hash.h"

static uint64_t hash_name(const char *name)
{
    uint64_t key = SESSION_HASH_BEGIN;
    session_hash_text(&key, name);
    return key;
}

static bool is_name_requested(const session_requested_names *requested, const char *name)
{
    const uint64_t key = hash_name(name);
    for (int i = 0; i < requested->count && i < SESSION_MOST_REQUESTED; i++)
        if (requested->names[i] == key) return true;
    return requested->count > SESSION_MOST_REQUESTED;
}

static void record_requested_name(session_requested_names *requested, const char *name)
{
    if (is_name_requested(requested, name)) return;
    if (requested->count < SESSION_MOST_REQUESTED) requested->names[requested->count] = hash_name(name);
    requested->count++;
}

insitu_status session_read_parameter(const session_scene_file *file, session_requested_names *requested,
                                     const char *name, double *value, base_error *error)
{
    char others[512];
    if (!name || !value)
        return base_fail(error, INSITU_ERROR_ARGUMENT, "insitu_parameter: %s is NULL", name ? "value" : "name");
    record_requested_name(requested, name);
    const scene_parameter *found = scene_find_parameter(&file->scene, name);
    if (found) {
        *value = found->value;
        return INSITU_OK;
    }
    scene_describe_parameter_names(&file->scene, name, others, sizeof others);
    return base_fail(error, INSITU_ERROR_ARGUMENT, "insitu_parameter: \"%.63s\" is no parameter of %.300s%s", name,
                     file->path, others);
}

void session_warn_of_unused_parameters(const scene *scene, const session_requested_names *requested,
                                       session_report *report)
{
    for (int i = 0; i < scene->parameter_count; i++) {
        const char *name = scene->parameters[i].name;
        session_warn_locally(
            report, &(session_warning){WARNING_PARAMETER, name, NULL, 0}, !is_name_requested(requested, name),
            "parameter \"%s\" of the scene changes nothing: the code has not asked for it on rank 0", name);
    }
}
