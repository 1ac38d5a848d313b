#include "session_montage.h"

#include <string.h>

#include "memory.h"
#include "session_image.h"

static insitu_status fail_for_memory(const scene_montage *montage, base_error *error)
{
    return base_fail(error, INSITU_ERROR_MEMORY, "no memory for a picture of %d x %d others", montage->columns,
                     montage->rows);
}

static int compute_montage_width(const scene_montage *montage)
{
    return montage->width * montage->columns + montage->bar_width;
}

static int compute_montage_height(const scene_montage *montage)
{
    return montage->height * montage->rows;
}

static int64_t count_pixels(const scene_montage *montage)
{
    return (int64_t)compute_montage_width(montage) * compute_montage_height(montage);
}

/* Returns the place of a panel in the montage. rgba: pixels of the montage. */
static insitu_place find_panel_region(const scene_montage *of, float *rgba, int panel)
{
    const int left = of->are_bars_left ? of->bar_width : 0;
    return (insitu_place){rgba, compute_montage_width(of), left + panel % of->columns * of->width,
                          panel / of->columns * of->height};
}

/* Clips the interval [first, first + length) to [0, end). The length may become negative. */
static void clip_interval(int end, int *first, int *length)
{
    const int last = *first + *length < end ? *first + *length : end;
    *first = *first > 0 ? *first : 0;
    *length = last - *first;
}

int session_find_areas_under_insets(const scene_montage *montage, int panel, insitu_rectangle covered[SCENE_ANCHORS])
{
    const insitu_place place = find_panel_region(montage, NULL, panel);
    const int frame = montage->frame_width;
    int count = 0;
    for (int i = 0; i < SCENE_ANCHORS; i++) {
        const scene_rectangle *inset = &montage->insets[i];
        insitu_rectangle r = {inset->x - frame - place.x, inset->y - frame - place.y, inset->width + 2 * frame,
                              inset->height + 2 * frame};
        clip_interval(montage->width, &r.x, &r.width);
        clip_interval(montage->height, &r.y, &r.height);
        if (inset->width && r.width > 0 && r.height > 0) covered[count++] = r;
    }
    return count;
}

/* Allocates the pixels of the montage, which are initially transparent. */
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

static void free_montage(session_montage *m)
{
    for (int i = 0; i < m->panel_count; i++) session_free_decorations(m->panels[i]);
    for (int i = 0; i < SCENE_ANCHORS; i++) {
        session_free_decorations(m->insets[i].decorations);
        base_free(m->insets[i].rgba);
    }
    base_free(m->panels);
    base_free(m->rgba);
    base_free(m->path);
    *m = (session_montage){0};
}

/* Returns the address, within the montage's pixels, of the first pixel of row y of the smaller picture at this
 * place. */
static float *get_row_address(const insitu_place *place, int y)
{
    return place->rgba + 4 * ((ptrdiff_t)(place->y + y) * place->width + place->x);
}

static size_t get_row_bytes(int width)
{
    return 4 * (size_t)width * sizeof(float);
}

/* Stores a picture without decorations in its panel, and a copy of its decorations. The decorations will be drawn after
 * the last picture of the step. */
static insitu_status keep_panel(const scene_montage *of, session_montage *m, int panel, const insitu_image *picture,
                                const session_decorations *decorations, base_error *error)
{
    const insitu_place place = find_panel_region(of, m->rgba, panel);
    m->panels[panel] = session_copy_decorations(decorations);
    if (!m->panels[panel]) return fail_for_memory(of, error);
    for (int y = 0; y < picture->height; y++)
        memcpy(get_row_address(&place, y), picture->rgba + 4 * (ptrdiff_t)picture->width * y,
               get_row_bytes(picture->width));
    return INSITU_OK;
}

/* Stores copies of an inset's picture without decorations and of its decorations. They are kept until the inset is
 * drawn over the panels. */
static insitu_status keep_inset(const scene_montage *of, session_inset *inset, const scene_output *output,
                                const insitu_image *picture, const session_decorations *decorations, base_error *error)
{
    const size_t size = get_row_bytes(picture->width) * (size_t)picture->height;
    inset->has_decorations = output->has_decorations;
    inset->decorations = decorations ? session_copy_decorations(decorations) : NULL;
    if (!decorations || inset->decorations) inset->rgba = base_alloc(size);
    if (!inset->rgba) return fail_for_memory(of, error);
    memcpy(inset->rgba, picture->rgba, size);
    return INSITU_OK;
}

/* Draws a picture into its panel. Decorations are placed so that insets do not cover them. */
static insitu_status draw_panel(const scene_montage *of, session_montage *m, int panel, const insitu_image *picture,
                                base_error *error)
{
    insitu_rectangle covered[SCENE_ANCHORS];
    insitu_decorations decorations = {0};
    insitu_image drawn = *picture;
    const insitu_place place = find_panel_region(of, m->rgba, panel);
    if (picture->decorations) {
        decorations = *picture->decorations;
        decorations.covered = covered;
        decorations.covered_count = session_find_areas_under_insets(of, panel, covered);
        drawn.decorations = &decorations;
    }
    return session_place_image(&drawn, &place, error);
}

static insitu_status add_picture(const scene_montage *of, session_montage *m, int panel, const scene_output *output,
                                 const insitu_image *picture, const session_decorations *decorations, base_error *error)
{
    if (output->is_inset) return keep_inset(of, &m->insets[output->corner], output, picture, decorations, error);
    if (of->shares_bars) return keep_panel(of, m, panel, picture, decorations, error);
    return draw_panel(of, m, panel, picture, error);
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
    status = add_picture(&scene->montages[output->montage], m, panel, output, picture, decorations, error);
    m->has_picture = m->has_picture || !status;
    return status;
}

/* ---- panels that share their colour bars ------------------------------------------------------------------------- */

/* Returns the decorations of the first panel that has a picture, if the bars of all panels are equal; otherwise
 * NULL. */
static const session_decorations *find_shared_bars(const scene_montage *of, const session_montage *m)
{
    const session_decorations *first = NULL;
    for (int i = 0; i < of->panel_count; i++) {
        if (!m->panels[i]) continue;
        if (!first) first = m->panels[i];
        if (m->panels[i]->bars_hash != first->bars_hash) return NULL;
    }
    return first;
}

/* Draws the decorations of a panel over its picture in the montage. has_bars: whether colour bars are drawn, too.
 * buffer: memory for a copy of the picture. */
static insitu_status decorate_panel(const scene_montage *of, session_montage *m, int panel, bool has_bars,
                                    float *buffer, base_error *error)
{
    insitu_decorations decorations = m->panels[panel]->decorations;
    const insitu_image picture = {
        .width = of->width, .height = of->height, .rgba = buffer, .decorations = &decorations};
    const insitu_place place = find_panel_region(of, m->rgba, panel);
    for (int y = 0; y < of->height; y++)
        memcpy(buffer + 4 * (ptrdiff_t)of->width * y, get_row_address(&place, y), get_row_bytes(of->width));
    if (!has_bars) decorations.bar_count = 0;
    return draw_panel(of, m, panel, &picture, error);
}

/* Draws the shared bars into the strip beside the panels, with text as large as in the panels. */
static insitu_status draw_shared_bars(const scene_montage *of, session_montage *m, const session_decorations *shared,
                                      base_error *error)
{
    const int height = compute_montage_height(of);
    insitu_decorations decorations = shared->background;
    memcpy(decorations.colour, shared->decorations.colour, sizeof decorations.colour);
    decorations.size = shared->decorations.size / of->rows;
    decorations.bar_count = shared->decorations.bar_count;
    decorations.words_count = decorations.stroke_count = decorations.label_count = 0;
    decorations.scale_bar.length = 0;
    float *empty = base_calloc(4 * (size_t)of->bar_width * (size_t)height, sizeof *empty);
    if (!empty) return fail_for_memory(of, error);
    const insitu_image strip = {.width = of->bar_width, .height = height, .rgba = empty, .decorations = &decorations};
    const insitu_place place = {m->rgba, compute_montage_width(of), of->are_bars_left ? 0 : of->width * of->columns, 0};
    const insitu_status status = session_place_image(&strip, &place, error);
    base_free(empty);
    return status;
}

/* Draws the decorations of all panels, and the bars that they share. shared: decorations that contain these bars; NULL:
 * no bars are shared. */
static insitu_status decorate_all_panels(const scene_montage *of, session_montage *m, const session_decorations *shared,
                                         base_error *error)
{
    float *buffer = base_alloc(4 * (size_t)of->width * (size_t)of->height * sizeof *buffer);
    insitu_status status = buffer ? INSITU_OK : fail_for_memory(of, error);
    for (int i = 0; i < of->panel_count && !status; i++)
        if (m->panels[i]) status = decorate_panel(of, m, i, !shared, buffer, error);
    base_free(buffer);
    return status || !shared ? status : draw_shared_bars(of, m, shared, error);
}

/* ---- drawing insets ---------------------------------------------------------------------------------------------- */

/* Draws the frame around an inset, in a grey that is visible on dark and light backgrounds. */
static void draw_inset_border(const scene_montage *of, const insitu_place *place, const scene_rectangle *inset)
{
    static const float grey[4] = {0.2140F, 0.2140F, 0.2140F, 1}; /* grey of sRGB 0.5, in linear light */
    const int frame = of->frame_width;
    for (int y = -frame; y < inset->height + frame; y++)
        for (int x = -frame; x < inset->width + frame; x++) {
            const bool is_inside = x >= 0 && x < inset->width && y >= 0 && y < inset->height;
            if (!is_inside) memcpy(get_row_address(place, y) + 4 * x, grey, sizeof grey);
        }
}

/* Draws an inset and its frame over a corner of the panels. shared: decorations that contain the bars in the strip;
 * NULL: no bars are shared. */
static insitu_status draw_inset(const scene_montage *of, session_montage *m, scene_anchor corner,
                                const session_decorations *shared, base_error *error)
{
    const scene_rectangle *at = &of->insets[corner];
    const session_inset *inset = &m->insets[corner];
    const session_decorations *own = inset->decorations;
    const insitu_place place = {m->rgba, compute_montage_width(of), at->x, at->y};
    insitu_decorations decorations = {0};
    if (own) decorations = inset->has_decorations ? own->decorations : own->background;
    if (own && shared && own->bars_hash == shared->bars_hash) decorations.bar_count = 0;
    const insitu_image picture = {
        .width = at->width, .height = at->height, .rgba = inset->rgba, .decorations = own ? &decorations : NULL};
    const insitu_status status = session_place_image(&picture, &place, error);
    if (!status) draw_inset_border(of, &place, at);
    return status;
}

/* Draws what must be drawn after the last picture of the step: decorations with shared bars, and insets. */
static insitu_status draw_shared_decorations_and_insets(const scene_montage *of, session_montage *m, base_error *error)
{
    const session_decorations *shared = of->shares_bars ? find_shared_bars(of, m) : NULL;
    insitu_status status = of->shares_bars ? decorate_all_panels(of, m, shared, error) : INSITU_OK;
    for (int i = 0; i < SCENE_ANCHORS && !status; i++)
        if (m->insets[i].rgba) status = draw_inset(of, m, (scene_anchor)i, shared, error);
    return status;
}

/* ---- writing montages to files ----------------------------------------------------------------------------------- */

insitu_status session_write_montages(session_montages *montages, const scene *scene, base_error *error)
{
    for (int i = 0; i < montages->count; i++) {
        session_montage *m = &montages->items[i];
        const scene_montage *of = &scene->montages[i];
        if (!m->has_picture) continue;
        const insitu_image whole = {
            .width = compute_montage_width(of), .height = compute_montage_height(of), .rgba = m->rgba};
        base_error reason = {0};
        const insitu_image_format format = of->format == SCENE_PNG16 ? INSITU_PNG16 : INSITU_PNG8;
        if (draw_shared_decorations_and_insets(of, m, &reason) ||
            session_write_image(&whole, format, m->path, &reason) != INSITU_OK)
            base_fail(error, reason.status, "%.900s", reason.message);
        free_montage(m);
    }
    return error->status;
}

void session_montages_free(session_montages *montages)
{
    for (int i = 0; i < montages->count; i++) free_montage(&montages->items[i]);
    base_free(montages->items);
    *montages = (session_montages){0};
}
