#include "session_montage.h"

#include <string.h>

#include "memory.h"
#include "session_image.h"

static insitu_status fail_for_memory(const scene_montage *montage, base_error *error)
{
    return base_fail(error, INSITU_ERROR_MEMORY, "no memory for a picture of %d x %d others", montage->columns,
                     montage->rows);
}

static int width_of(const scene_montage *montage)
{
    return montage->width * montage->columns + montage->bar_width;
}

static int height_of(const scene_montage *montage)
{
    return montage->height * montage->rows;
}

static int64_t count_pixels(const scene_montage *montage)
{
    return (int64_t)width_of(montage) * height_of(montage);
}

/* Returns the place of a panel. */
static insitu_place find_place(const scene_montage *of, const session_montage *m, int panel)
{
    const int left = of->are_bars_left ? of->bar_width : 0;
    return (insitu_place){m->rgba, width_of(of), left + panel % of->columns * of->width,
                          panel / of->columns * of->height};
}

/* Returns the place of an inset of the picture's size. */
static insitu_place find_inset_place(const scene_montage *of, const session_montage *m, scene_anchor corner,
                                     const insitu_image *picture)
{
    const bool is_right = corner == SCENE_TOP_RIGHT || corner == SCENE_BOTTOM_RIGHT;
    const bool is_low = corner == SCENE_BOTTOM_LEFT || corner == SCENE_BOTTOM_RIGHT;
    const int x = of->inset_margin, y = of->inset_margin;
    return (insitu_place){m->rgba, width_of(of), is_right ? width_of(of) - x - picture->width : x,
                          is_low ? height_of(of) - y - picture->height : y};
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
    const scene_montage *of = &scene->montages[index];
    if (!m->rgba) m->rgba = base_calloc(4 * (size_t)count_pixels(of), sizeof *m->rgba);
    if (of->shares_bars && !m->panels) {
        m->panels = base_calloc((size_t)of->panel_count, sizeof *m->panels);
        m->panel_count = m->panels ? of->panel_count : 0;
    }
    return m->rgba && (m->panels || !of->shares_bars) ? INSITU_OK : fail_for_memory(&scene->montages[index], error);
}

static void end(session_montage *m)
{
    for (int i = 0; i < m->panel_count; i++) session_free_decorations(m->panels[i]);
    base_free(m->panels);
    base_free(m->rgba);
    base_free(m->path);
    *m = (session_montage){0};
}

/* Returns a row of the picture that is in the place. */
static float *row_of(const insitu_place *place, int y)
{
    return place->rgba + 4 * ((ptrdiff_t)(place->y + y) * place->width + place->x);
}

static size_t row_size(int width)
{
    return 4 * (size_t)width * sizeof(float);
}

/* Keeps a picture without its decorations in its panel, and a copy of them. */
static insitu_status keep_panel(const scene_montage *of, session_montage *m, int panel, const insitu_image *picture,
                                const session_decorations *decorations, base_error *error)
{
    const insitu_place place = find_place(of, m, panel);
    m->panels[panel] = session_copy_decorations(decorations);
    if (!m->panels[panel]) return fail_for_memory(of, error);
    for (int y = 0; y < picture->height; y++)
        memcpy(row_of(&place, y), picture->rgba + 4 * (ptrdiff_t)picture->width * y, row_size(picture->width));
    return INSITU_OK;
}

/* Draws the frame around an inset, in a grey that differs from dark and light backgrounds. */
static void draw_frame(const scene_montage *of, const insitu_place *place, const insitu_image *picture)
{
    static const float grey[4] = {0.2140F, 0.2140F, 0.2140F, 1}; /* half of sRGB's range */
    const int frame = of->frame_width;
    for (int y = -frame; y < picture->height + frame; y++)
        for (int x = -frame; x < picture->width + frame; x++) {
            const bool is_inside = x >= 0 && x < picture->width && y >= 0 && y < picture->height;
            if (!is_inside) memcpy(row_of(place, y) + 4 * x, grey, sizeof grey);
        }
}

/* Lays a picture over a corner of the panels. */
static insitu_status add_inset(const scene_montage *of, session_montage *m, scene_anchor corner,
                               const insitu_image *picture, base_error *error)
{
    const insitu_place place = find_inset_place(of, m, corner, picture);
    const insitu_status status = session_place_image(picture, &place, error);
    if (!status) draw_frame(of, &place, picture);
    return status;
}

static insitu_status add_picture(const scene_montage *of, session_montage *m, const scene_output *output, int panel,
                                 const insitu_image *picture, const session_decorations *decorations, base_error *error)
{
    if (output->is_inset) return add_inset(of, m, output->corner, picture, error);
    if (of->shares_bars) return keep_panel(of, m, panel, picture, decorations, error);
    const insitu_place place = find_place(of, m, panel);
    return session_place_image(picture, &place, error);
}

insitu_status session_add_panel(session_montages *montages, const scene *scene, const scene_image *image,
                                const scene_output *output, const insitu_image *picture,
                                const session_decorations *decorations, char *path, base_error *error)
{
    const int panel = output->first_panel + image->variant.view;
    insitu_status status = begin_montage(montages, scene, output->montage, error);
    if (status) {
        base_free(path);
        return status;
    }
    session_montage *m = &montages->items[output->montage];
    base_free(m->path);
    m->path = path;
    status = add_picture(&scene->montages[output->montage], m, output, panel, picture, decorations, error);
    m->has_picture = m->has_picture || !status;
    return status;
}

/* ---- shared colour bars ------------------------------------------------------------------------------------------ */

/* Returns the decorations of the first panel that has a picture, if all panels have the same bars, or else NULL. */
static const session_decorations *find_shared(const scene_montage *of, const session_montage *m)
{
    const session_decorations *first = NULL;
    for (int i = 0; i < of->panel_count; i++) {
        if (!m->panels[i]) continue;
        if (!first) first = m->panels[i];
        if (m->panels[i]->bars_hash != first->bars_hash) return NULL;
    }
    return first;
}

/* Draws the decorations of a panel over its picture. buffer has the size of the picture. */
static insitu_status decorate_panel(const scene_montage *of, session_montage *m, int panel, bool has_bars,
                                    float *buffer, base_error *error)
{
    insitu_decorations decorations = m->panels[panel]->decorations;
    const insitu_image picture = {
        .width = of->width, .height = of->height, .rgba = buffer, .decorations = &decorations};
    const insitu_place place = find_place(of, m, panel);
    for (int y = 0; y < of->height; y++)
        memcpy(buffer + 4 * (ptrdiff_t)of->width * y, row_of(&place, y), row_size(of->width));
    if (!has_bars) decorations.bar_count = 0;
    return session_place_image(&picture, &place, error);
}

/* Draws the bars into the strip beside the panels, with words as large as in the panels. */
static insitu_status draw_strip(const scene_montage *of, session_montage *m, const session_decorations *shared,
                                base_error *error)
{
    const int height = height_of(of);
    insitu_decorations decorations = shared->background;
    memcpy(decorations.colour, shared->decorations.colour, sizeof decorations.colour);
    decorations.size = shared->decorations.size / of->rows;
    decorations.bar_count = shared->decorations.bar_count;
    decorations.words_count = decorations.stroke_count = decorations.label_count = 0;
    decorations.scale_bar.length = 0;
    float *empty = base_calloc(4 * (size_t)of->bar_width * (size_t)height, sizeof *empty);
    if (!empty) return fail_for_memory(of, error);
    const insitu_image strip = {.width = of->bar_width, .height = height, .rgba = empty, .decorations = &decorations};
    const insitu_place place = {m->rgba, width_of(of), of->are_bars_left ? 0 : of->width * of->columns, 0};
    const insitu_status status = session_place_image(&strip, &place, error);
    base_free(empty);
    return status;
}

/* Draws the decorations of all panels, and the bars that they share. */
static insitu_status finish_panels(const scene_montage *of, session_montage *m, base_error *error)
{
    const session_decorations *shared = find_shared(of, m);
    float *buffer = base_alloc(4 * (size_t)of->width * (size_t)of->height * sizeof *buffer);
    insitu_status status = buffer ? INSITU_OK : fail_for_memory(of, error);
    for (int i = 0; i < of->panel_count && !status; i++)
        if (m->panels[i]) status = decorate_panel(of, m, i, !shared, buffer, error);
    base_free(buffer);
    return status || !shared ? status : draw_strip(of, m, shared, error);
}

/* ---- files ------------------------------------------------------------------------------------------------------- */

insitu_status session_write_montages(session_montages *montages, const scene *scene, base_error *error)
{
    for (int i = 0; i < montages->count; i++) {
        session_montage *m = &montages->items[i];
        const scene_montage *of = &scene->montages[i];
        if (!m->has_picture) continue;
        const insitu_image whole = {.width = width_of(of), .height = height_of(of), .rgba = m->rgba};
        base_error reason = {0};
        const insitu_image_format format = of->format == SCENE_PNG16 ? INSITU_PNG16 : INSITU_PNG8;
        if (of->shares_bars) finish_panels(of, m, &reason);
        if (reason.status || session_write_image(&whole, format, m->path, &reason) != INSITU_OK)
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
