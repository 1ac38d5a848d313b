#include "session_deep.h"

#include "memory.h"
#include "region.h"

bool session_needs_deep_samples(const scene_image *image)
{
    for (int i = 0; i < image->output_count; i++)
        if (image->outputs[i].is_deep) return true;
    return false;
}

insitu_status session_create_deep_image(deep_image *deep, const scene_image *image, base_error *error)
{
    const size_t pixels = (size_t)image->width * (size_t)image->height;
    deep->first = base_calloc(pixels, sizeof *deep->first);
    deep->counts = base_calloc(pixels, sizeof *deep->counts);
    if (deep->first && deep->counts) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_MEMORY, "image \"%s\": no memory for a deep picture of %lld pixels",
                     image->name, (long long)pixels);
}

static float convert_parameter_to_depth(float t, const render_space *space)
{
    return (float)((double)t / space->scale + space->depth_origin);
}

void session_convert_deep_depths(deep_image *deep, const render_space *space, int threads)
{
    if (!deep->count) return;
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t i = 0; i < deep->count; i++) {
            deep->samples[i].z = convert_parameter_to_depth(deep->samples[i].z, space);
            deep->samples[i].z_back = convert_parameter_to_depth(deep->samples[i].z_back, space);
        }
        region_leave();
    }
}

int64_t session_deep_bytes(const deep_image *deep, int width, int height)
{
    const int64_t pixels = deep->counts ? (int64_t)width * height : 0;
    return deep->capacity * (int64_t)sizeof *deep->samples +
           pixels * (int64_t)(sizeof *deep->first + sizeof *deep->counts);
}

void session_free_deep_image(deep_image *deep)
{
    base_free(deep->samples);
    base_free(deep->first);
    base_free(deep->counts);
    *deep = (deep_image){0};
}
