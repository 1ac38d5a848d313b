/* Reads the requests for statistics of fields: statistics that are written to files, and conditions of images. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "memory.h"
#include "scene_convert.h"

insitu_status scene_convert_condition(const scene_document *d, const char *image, const scene_file_condition *in,
                                      scene_condition *out)
{
    char path[SCENE_PATH_SIZE];
    if (!in) return INSITU_OK;
    snprintf(path, sizeof path, "%s.when", image);
    out->is_given = true;
    out->statistic = in->of ? (scene_statistic)*in->of : SCENE_MAXIMUM;
    out->above = in->above ? *in->above : -(double)INFINITY;
    out->below = in->below ? *in->below : (double)INFINITY;
    if (!in->above && !in->below) return scene_fail_at_key(d, path, "", "has no bound, expected above, below or both");
    if (!(out->above < out->below))
        return scene_fail_at_key(d, path, "below", "is %g, expected more than above, which is %g", out->below,
                                 out->above);
    return scene_convert_field(d, path, path, in->field, in->component, &out->field);
}

static insitu_status convert_histogram(const scene_document *d, const char *path, const scene_file_histogram *in,
                                       scene_statistics *out)
{
    out->low = 0;
    out->high = -1;
    if (!in) return INSITU_OK;
    out->bin_count = in->bins ? *in->bins : 32;
    if (!in->range) return INSITU_OK;
    out->low = in->range[0];
    out->high = in->range[1];
    if (out->low < out->high) return INSITU_OK;
    return scene_fail_at_key(d, path, "histogram.range", "goes from %g to %g, expected the first to be less", out->low,
                             out->high);
}

static insitu_status check_statistics_path(const scene_document *d, const char *path, const scene *s, int index)
{
    const char *file = s->statistics[index].path;
    const size_t length = strlen(file);
    if (length < 5 || strcasecmp(file + length - 4, ".csv") != 0)
        return scene_fail_at_key(d, path, "path", "\"%.100s\" has another ending, expected .csv", file);
    for (int i = 0; i < index; i++)
        if (strcmp(s->statistics[i].path, file) == 0)
            return scene_fail_at_key(d, path, "path", "\"%.100s\" is another one's file too, expected its own", file);
    return INSITU_OK;
}

insitu_status scene_convert_statistics(const scene_document *d, const scene_file *in, scene *out)
{
    insitu_status status = INSITU_OK;
    out->statistics = base_calloc((size_t)in->statistics_count, sizeof *out->statistics);
    if (!out->statistics) return scene_fail_for_memory(d);
    for (int i = 0; i < in->statistics_count && !status; i++) {
        const scene_file_statistics *from = &in->statistics[i];
        scene_statistics *to = &out->statistics[out->statistics_count++];
        char path[32];
        snprintf(path, sizeof path, "statistics[%d]", i);
        to->cycle_interval = from->every ? *from->every : 1;
        to->path = base_strdup(from->path);
        if (!to->path) return scene_fail_for_memory(d);
        status = check_statistics_path(d, path, out, i);
        if (!status) status = convert_histogram(d, path, from->histogram, to);
        if (!status) status = scene_convert_field(d, path, path, from->field, from->component, &to->field);
    }
    return status;
}
