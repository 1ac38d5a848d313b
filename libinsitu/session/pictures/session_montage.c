#include "session_montage.h"

#include "memory.h"
#include "session_image.h"

static insitu_status fail_for_memory(const scene_montage *montage, base_error *error)
{
    return base_fail(error, INSITU_ERROR_MEMORY, "no memory for a picture of %d x %d others", montage->columns,
                     montage->rows);
}

static int64_t count_pixels(const scene_montage *montage)
{
    return (int64_t)montage->width * montage->columns * montage->height * montage->rows;
}

/* Allocates the whole picture, which is transparent at first. */
static insitu_status begin_montage(session_montages *montages, const scene *scene, int index, base_error *error)
{
    if (!montages->items) {
        montages->items = base_calloc((size_t)scene->montage_count, sizeof *montages->items);
        montages->count = montages->items ? scene->montage_count : 0;
    }
    if (!montages->items) return fail_for_memory(&scene->montages[index], error);
    session_montage *m = &montages->items[index];
    if (!m->rgba) m->rgba = base_calloc(4 * (size_t)count_pixels(&scene->montages[index]), sizeof *m->rgba);
    return m->rgba ? INSITU_OK : fail_for_memory(&scene->montages[index], error);
}

static void end(session_montage *m)
{
    base_free(m->rgba);
    base_free(m->path);
    *m = (session_montage){0};
}

insitu_status session_add_panel(session_montages *montages, const scene *scene, const scene_image *image,
                                const scene_output *output, const insitu_image *picture, char *path, base_error *error)
{
    const scene_montage *of = &scene->montages[output->montage];
    const int cell = output->first_panel + image->variant.view;
    const insitu_status status = begin_montage(montages, scene, output->montage, error);
    if (status) {
        base_free(path);
        return status;
    }
    session_montage *m = &montages->items[output->montage];
    base_free(m->path);
    m->path = path;
    const insitu_place place = {m->rgba, of->width * of->columns, cell % of->columns * of->width,
                                cell / of->columns * of->height};
    return session_place_image(picture, &place, error);
}

insitu_status session_write_montages(session_montages *montages, const scene *scene, base_error *error)
{
    for (int i = 0; i < montages->count; i++) {
        session_montage *m = &montages->items[i];
        const scene_montage *of = &scene->montages[i];
        if (!m->rgba) continue;
        const insitu_image whole = {.width = of->width * of->columns, .height = of->height * of->rows, .rgba = m->rgba};
        base_error reason = {0};
        const insitu_image_format format = of->format == SCENE_PNG16 ? INSITU_PNG16 : INSITU_PNG8;
        if (session_write_image(&whole, format, m->path, &reason) != INSITU_OK)
            base_fail(error, reason.status, "%.900s", reason.message);
        end(m);
    }
    return error->status;
}

void session_montages_free(session_montages *montages)
{
    for (int i = 0; i < montages->count; i++) end(&montages->items[i]);
    base_free(montages->items);
    *montages = (session_montages){0};
}
