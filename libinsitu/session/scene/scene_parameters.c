/* Reads the scene's parameters: numbers for the simulation, with names that the scene chooses. */
#include <stdio.h>
#include <string.h>

#include "memory.h"
#include "scene_convert.h"
#include "scene_shorthand.h"

insitu_status scene_convert_parameters(const scene_document *d, scene *out)
{
    const char *names[SCENE_MAX_NAMES];
    const int count = scene_list_keys_at_path(d, "parameters", names, SCENE_MAX_NAMES);
    out->parameters = base_calloc((size_t)count, sizeof *out->parameters);
    if (!out->parameters) return scene_fail_for_memory(d);
    while (out->parameter_count < count) {
        scene_parameter *parameter = &out->parameters[out->parameter_count];
        char path[SCENE_PATH_SIZE];
        snprintf(path, sizeof path, "parameters.%s", names[out->parameter_count]);
        parameter->name = base_strdup(names[out->parameter_count]);
        if (!parameter->name) return scene_fail_for_memory(d);
        parameter->value = scene_get_number_at_path(d, path);
        out->parameter_count++;
    }
    return INSITU_OK;
}

const scene_parameter *scene_find_parameter(const scene *s, const char *name)
{
    for (int i = 0; i < s->parameter_count; i++)
        if (strcmp(s->parameters[i].name, name) == 0) return &s->parameters[i];
    return NULL;
}

void scene_describe_parameter_names(const scene *s, const char *name, char *words, size_t size)
{
    const char *names[SCENE_MAX_NAMES];
    for (int i = 0; i < s->parameter_count; i++) names[i] = s->parameters[i].name;
    const char *meant = scene_find_most_similar_word(name, names, s->parameter_count);
    size_t used = 0;
    words[0] = '\0';
    if (meant) used = (size_t)snprintf(words, size, " (did you mean \"%s\"?)", meant);
    for (int i = 0; i < s->parameter_count && used < size; i++)
        used += (size_t)snprintf(words + used, size - used, "%s%s", i ? ", " : ", expected one of ", names[i]);
    if (!s->parameter_count) snprintf(words, size, ": it has no parameters");
}
