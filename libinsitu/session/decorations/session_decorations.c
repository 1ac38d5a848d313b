/* The box around the domain is convex and contains all data. An edge between two faces whose inner sides face the eye
 * therefore lies behind all data, and any other edge lies in front of all data or beside it. Therefore edges are drawn
 * correctly without depth values, also over volumes. */
#include "session_decorations.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "memory.h"
#include "session_hash.h"

/* ---- edges of a box ------------------------------------------------------------------------------------------ */

/* A point in the camera's coordinate system, relative to the eye: x to the right, y up, z forward. */
typedef struct seen_point {
    double position[3];
} seen_point;

static seen_point transform_to_camera(const render_camera *c, const double p[3])
{
    const double *const axes[3] = {c->right, c->up, c->forward};
    seen_point out;
    for (int i = 0; i < 3; i++) {
        out.position[i] = 0;
        for (int a = 0; a < 3; a++) out.position[i] += axes[i][a] * (p[a] - c->eye[a]);
    }
    return out;
}

static void project_to_pixel(const render_camera *c, const seen_point *p, double pixel[2])
{
    const double depth = c->is_orthographic ? 1 : p->position[2], scale = 0.5 * c->height / (c->half_height * depth);
    pixel[0] = 0.5 * c->width + p->position[0] * scale;
    pixel[1] = 0.5 * c->height - p->position[1] * scale;
}

/* Clips the edge from a to b at the near plane, which is at z = near in camera coordinates. Returns false if the whole
 * edge is nearer to the eye than this plane. */
static bool clip_at_near_plane(seen_point *a, seen_point *b, double near)
{
    if (a->position[2] < near && b->position[2] < near) return false;
    if (a->position[2] >= near && b->position[2] >= near) return true;
    const double share = (near - a->position[2]) / (b->position[2] - a->position[2]);
    seen_point *hidden = a->position[2] < near ? a : b;
    seen_point cut;
    for (int i = 0; i < 3; i++) cut.position[i] = a->position[i] + share * (b->position[i] - a->position[i]);
    *hidden = cut;
    return true;
}

/* Returns whether the eye sees the outer side of the face of the box that is perpendicular to `axis`, at the high end
 * of the box if `high` is set, and otherwise at the low end. */
static bool is_outer_side_of_face_visible(const double lower[3], const double upper[3], const render_camera *c,
                                          int axis, bool high)
{
    if (c->is_orthographic) return high ? c->forward[axis] < 0 : c->forward[axis] > 0;
    return high ? c->eye[axis] > upper[axis] : c->eye[axis] < lower[axis];
}

int session_compute_box_strokes(const double lower[3], const double upper[3], const render_camera *camera,
                                insitu_stroke strokes[SESSION_BOX_EDGES])
{
    double size = 0;
    int count = 0;
    for (int a = 0; a < 3; a++) size = fmax(size, upper[a] - lower[a]);
    for (int edge = 0; edge < SESSION_BOX_EDGES; edge++) {
        const int axis = edge / 4, b = (axis + 1) % 3, c = (axis + 2) % 3;
        const bool high_b = edge & 1, high_c = edge & 2;
        double from[3], to[3];
        from[axis] = lower[axis];
        to[axis] = upper[axis];
        from[b] = to[b] = high_b ? upper[b] : lower[b];
        from[c] = to[c] = high_c ? upper[c] : lower[c];
        seen_point p = transform_to_camera(camera, from), q = transform_to_camera(camera, to);
        if (!camera->is_orthographic && !clip_at_near_plane(&p, &q, 1e-3 * size)) continue;
        insitu_stroke *stroke = &strokes[count++];
        project_to_pixel(camera, &p, stroke->from);
        project_to_pixel(camera, &q, stroke->to);
        stroke->is_behind = !is_outer_side_of_face_visible(lower, upper, camera, b, high_b) &&
                            !is_outer_side_of_face_visible(lower, upper, camera, c, high_c);
    }
    return count;
}

/* ---- rulers: ticks and numbers along edges of the box -------------------------------------------------------- */

/* An edge of the box parallel to an axis, and its projection into the picture. */
typedef struct ruled_edge {
    double from[3], to[3]; /* ends of the edge in scene coordinates */
    double pixels[2][2];   /* ends of the edge in pixels */
    double outward[2];     /* unit vector in the picture, perpendicular to the edge and pointing out of the box */
    /* is_in_front: the edge and the box's centre lie in front of the eye, and the edge is longer than a pixel;
     * is_outer: the edge is on the box's silhouette, between a face whose outer side is seen and one whose inner side
     * is seen */
    bool is_in_front, is_outer;
} ruled_edge;

static ruled_edge project_box_edge(const double lower[3], const double upper[3], const render_camera *c, int axis,
                                   int corner)
{
    const int b = (axis + 1) % 3, d = (axis + 2) % 3;
    const bool high_b = corner & 1, high_d = corner & 2;
    double middle[3], centre[2];
    ruled_edge e = {.is_in_front = true};
    e.from[axis] = lower[axis];
    e.to[axis] = upper[axis];
    e.from[b] = e.to[b] = high_b ? upper[b] : lower[b];
    e.from[d] = e.to[d] = high_d ? upper[d] : lower[d];
    for (int a = 0; a < 3; a++) middle[a] = 0.5 * lower[a] + 0.5 * upper[a];
    const seen_point ends[3] = {transform_to_camera(c, e.from), transform_to_camera(c, e.to),
                                transform_to_camera(c, middle)};
    for (int i = 0; i < 3; i++) e.is_in_front = e.is_in_front && (c->is_orthographic || ends[i].position[2] > 0);
    if (!e.is_in_front) return e;
    project_to_pixel(c, &ends[0], e.pixels[0]);
    project_to_pixel(c, &ends[1], e.pixels[1]);
    project_to_pixel(c, &ends[2], centre);
    const double x = e.pixels[1][0] - e.pixels[0][0], y = e.pixels[1][1] - e.pixels[0][1], length = hypot(x, y);
    e.is_in_front = length > 1;
    if (!e.is_in_front) return e;
    const double side = (centre[0] - e.pixels[0][0]) * y - (centre[1] - e.pixels[0][1]) * x < 0 ? 1 : -1;
    e.outward[0] = side * y / length;
    e.outward[1] = -side * x / length;
    e.is_outer = is_outer_side_of_face_visible(lower, upper, c, b, high_b) !=
                 is_outer_side_of_face_visible(lower, upper, c, d, high_d);
    return e;
}

static bool is_better_ruler_edge(const ruled_edge *a, const ruled_edge *b)
{
    if (!a->is_in_front || !b->is_in_front) return a->is_in_front;
    if (a->is_outer != b->is_outer) return a->is_outer;
    return a->pixels[0][1] + a->pixels[1][1] > b->pixels[0][1] + b->pixels[1][1];
}

static insitu_label make_label_beside_edge(const double at[2], const double away[2], double gap, const char *text)
{
    insitu_label out = {{at[0], at[1]}, {away[0], away[1]}, gap, ""};
    snprintf(out.text, sizeof out.text, "%s", text);
    return out;
}

/* Computes the position of the name of the edge's axis. It is the middle of the edge or, if the numbers are beside the
 * edge rather than below it, midway between the two neighbouring ticks that are nearest to the middle, so that the name
 * does not overlap a number. */
static void compute_axis_name_position(const ruled_edge *e, const insitu_stroke *ticks, int count, double at[2])
{
    double middle[2], least = INFINITY;
    for (int a = 0; a < 2; a++) at[a] = middle[a] = 0.5 * (e->pixels[0][a] + e->pixels[1][a]);
    if (fabs(e->outward[0]) <= fabs(e->outward[1])) return;
    for (int i = 0; i + 1 < count; i++) {
        const double between[2] = {0.5 * (ticks[i].from[0] + ticks[i + 1].from[0]),
                                   0.5 * (ticks[i].from[1] + ticks[i + 1].from[1])};
        const double distance = hypot(between[0] - middle[0], between[1] - middle[1]);
        if (distance >= least) continue;
        least = distance;
        memcpy(at, between, sizeof between);
    }
}

/* Draws ticks, numbers and the axis's name along an edge. The number of ticks is limited by the space for their
 * numbers. */
static void add_ticks_and_labels_along_edge(const ruled_edge *e, int axis, const render_camera *c, double size,
                                            insitu_decorations *out, insitu_stroke *strokes, insitu_label *labels)
{
    static const char *const names[] = {"x", "y", "z"};
    insitu_tick ticks[SESSION_MAX_TICKS];
    const double length = hypot(e->pixels[1][0] - e->pixels[0][0], e->pixels[1][1] - e->pixels[0][1]);
    const int most = (int)fmin(fmax(length / (4 * size), 2), 8);
    const session_scale scale = {.kind = RENDER_LINEAR, .low = e->from[axis], .high = e->to[axis]};
    double name_at[2];
    const insitu_stroke *first = strokes + out->stroke_count;
    const int count = e->from[axis] < e->to[axis] ? session_make_ticks(&scale, most, ticks) : 0;
    for (int i = 0; i < count; i++) {
        double place[3], at[2];
        for (int a = 0; a < 3; a++) place[a] = (1 - ticks[i].place) * e->from[a] + ticks[i].place * e->to[a];
        const seen_point seen = transform_to_camera(c, place);
        project_to_pixel(c, &seen, at);
        strokes[out->stroke_count++] = (insitu_stroke){
            {at[0], at[1]}, {at[0] + 0.35 * size * e->outward[0], at[1] + 0.35 * size * e->outward[1]}, false};
        labels[out->label_count++] = make_label_beside_edge(at, e->outward, 0.55, ticks[i].text);
    }
    compute_axis_name_position(e, first, count, name_at);
    labels[out->label_count++] = make_label_beside_edge(name_at, e->outward, 2.4, names[axis]);
}

void session_add_box_rulers(const double lower[3], const double upper[3], const render_camera *camera, double size,
                            insitu_decorations *out, insitu_stroke *strokes, insitu_label *labels)
{
    for (int axis = 0; axis < 3; axis++) {
        ruled_edge best = {.is_in_front = false};
        for (int corner = 0; corner < 4; corner++) {
            const ruled_edge e = project_box_edge(lower, upper, camera, axis, corner);
            if (is_better_ruler_edge(&e, &best)) best = e;
        }
        if (best.is_in_front) add_ticks_and_labels_along_edge(&best, axis, camera, size, out, strokes, labels);
    }
}

insitu_scale_bar session_make_scale_bar(const render_camera *camera, const double point[3], const char *unit)
{
    insitu_scale_bar out = {.length = 0};
    const double depth = camera->is_orthographic ? 1 : transform_to_camera(camera, point).position[2];
    const double pixel = 2 * camera->half_height * depth / camera->height;
    if (!(pixel > 0)) return out;
    const double room = 0.2 * camera->width * pixel, power = pow(10, floor(log10(room)));
    const double length = power * (room >= 5 * power ? 5 : room >= 2 * power ? 2 : 1);
    const session_scale scale = {.kind = RENDER_LINEAR, .high = length};
    insitu_tick ticks[SESSION_MAX_TICKS];
    const int count = session_make_ticks(&scale, 2, ticks);
    if (count < 2) return out;
    out.length = length / pixel;
    snprintf(out.text, sizeof out.text, "%s%s%s", ticks[count - 1].text, unit ? " " : "", unit ? unit : "");
    return out;
}

/* ---- texts and colour bars ----------------------------------------------------------------------------------- */

/* Chooses the colour of text: light on a dark background, and dark on a light or transparent one. */
static void choose_text_colour(const scene_image *image, float colour[3])
{
    const float *b = image->background;
    const double luminance = 0.2126 * (double)b[0] + 0.7152 * (double)b[1] + 0.0722 * (double)b[2];
    const bool is_dark = b[3] > 0.5F && luminance < 0.18 * (double)b[3];
    for (int i = 0; i < 3; i++)
        colour[i] = image->decorations.has_colour ? image->decorations.colour[i] : is_dark ? 0.85F : 0.01F;
}

/* Adds a text to the decorations. Returns false if memory runs out. */
static bool add_expanded_text(session_decorations *d, const char *text, const scene_placeholder_values *moment,
                              insitu_anchor at, float size)
{
    char *expanded = scene_expand_placeholders(text, moment);
    if (expanded) d->words[d->decorations.words_count++] = (insitu_words){expanded, at, size};
    return expanded != NULL;
}

static bool add_scene_texts(session_decorations *d, const scene_decorations *scene,
                            const scene_placeholder_values *moment)
{
    bool well = !scene->title || add_expanded_text(d, scene->title, moment, INSITU_TOP, 1.4F);
    for (int i = 0; i < scene->words_count && well; i++)
        well = add_expanded_text(d, scene->words[i].text, moment, (insitu_anchor)scene->words[i].anchor, 1);
    return well;
}

/* Returns whether the layer shows the magnitude of the field. This is the case if the scene requests the magnitude, or
 * if the scene requests neither the magnitude nor a component and the field has several components. */
static bool shows_magnitude(const session_catalogue *catalogue, const scene_field *field)
{
    int components = 1;
    for (int m = 0; m < catalogue->mesh_count; m++) {
        const session_catalogue_mesh *mesh = &catalogue->meshes[m];
        const session_catalogue_field *found =
            scene_field_selects_mesh(field, mesh->name) ? session_catalogue_find_field(mesh, field->name) : NULL;
        if (found && found->component_count > components) components = found->component_count;
    }
    return field->component == SCENE_COMPONENT_MAGNITUDE ||
           (field->component == SCENE_COMPONENT_DEFAULT && components > 1);
}

/* Writes the name of the scalar that a layer shows: |v| for the magnitude of a field v, "v x" or "v 7" for a
 * component. */
static void write_name_of_shown_scalar(const session_catalogue *catalogue, const scene_field *field, char *out,
                                       size_t size)
{
    static const char *const axes[] = {"x", "y", "z"};
    if (shows_magnitude(catalogue, field))
        snprintf(out, size, "|%s|", field->name);
    else if (field->component > 2)
        snprintf(out, size, "%s %d", field->name, field->component);
    else if (field->component >= 0)
        snprintf(out, size, "%s %s", field->name, axes[field->component]);
    else
        snprintf(out, size, "%s", field->name);
}

static void write_colour_bar_label(const scene_decorations *scene, int bar, const session_catalogue *catalogue,
                                   const scene_field *field, char *label, size_t size)
{
    const char *unit = scene->unit_count == 1 ? scene->units[0] : bar < scene->unit_count ? scene->units[bar] : NULL;
    if (bar < scene->label_count)
        snprintf(label, size, "%s", scene->labels[bar]);
    else
        write_name_of_shown_scalar(catalogue, field, label, size);
    const size_t length = strlen(label);
    if (unit) snprintf(label + length, size - length, " [%s]", unit);
}

static bool are_ticks_equal(const insitu_colour_bar *a, const insitu_colour_bar *b)
{
    bool are_equal = a->tick_count == b->tick_count;
    for (int i = 0; i < a->tick_count && are_equal; i++)
        are_equal = a->ticks[i].place == b->ticks[i].place && strcmp(a->ticks[i].text, b->ticks[i].text) == 0;
    return are_equal;
}

/* Returns whether an earlier colour bar has the same field, colours and ticks. This happens if several layers show one
 * field. */
static bool is_equal_colour_bar_present(const session_decorations *d, int bar)
{
    const insitu_colour_bar *b = &d->bars[bar];
    bool is_found = false;
    for (int i = 0; i < bar && !is_found; i++) {
        const insitu_colour_bar *a = &d->bars[i];
        is_found = strcmp(d->fields[i]->name, d->fields[bar]->name) == 0 &&
                   d->fields[i]->component == d->fields[bar]->component && a->is_banded == b->is_banded &&
                   a->colour_count == b->colour_count &&
                   memcmp(a->colours, b->colours, (size_t)a->colour_count * 3 * sizeof *a->colours) == 0 &&
                   are_ticks_equal(a, b);
    }
    return is_found;
}

/* The data from which colour bars are computed. */
typedef struct bar_basis {
    const scene_decorations *scene;
    const session_catalogue *catalogue;
} bar_basis;

/* Adds the colour bar of a layer, unless an equal bar has been added already. */
static void add_colour_bar_if_new(session_decorations *d, const bar_basis *basis, const scene_field *field,
                                  const scene_colour_map *map, const session_transfer *transfer)
{
    const scene_decorations *scene = basis->scene;
    const int i = d->decorations.bar_count, most = scene->tick_count;
    if (i == SESSION_MAX_BARS) return;
    const session_scale scale = {transfer->transfer.scale, transfer->transfer.threshold, transfer->low, transfer->high,
                                 scene->number_form};
    const int tick_count = transfer->is_constant
                               ? session_make_constant_tick(transfer->constant, &scene->number_form, d->ticks[i])
                           : map->is_banded ? session_make_ticks_for_colour_bands(&scale, map->count, most, d->ticks[i])
                                            : session_make_ticks(&scale, most, d->ticks[i]);
    d->fields[i] = field;
    write_colour_bar_label(scene, i, basis->catalogue, field, d->labels[i], sizeof d->labels[i]);
    d->bars[i] = (insitu_colour_bar){.label = d->labels[i],
                                     .colours = map->colours,
                                     .colour_count = map->count,
                                     .is_banded = map->is_banded,
                                     .below = map->has_below ? map->outside_colours[0] : NULL,
                                     .above = map->has_above ? map->outside_colours[1] : NULL,
                                     .at = (insitu_anchor)scene->bar_anchor,
                                     .tick_count = tick_count,
                                     .ticks = d->ticks[i]};
    if (!is_equal_colour_bar_present(d, i)) d->decorations.bar_count++;
}

static void add_colour_bars_of_layers(session_decorations *d, const scene_image *image,
                                      const session_decoration_basis *given)
{
    const bar_basis basis = {&image->decorations, given->catalogue};
    const session_transfer *transfers = given->layers->transfers;
    for (int i = 0; i < image->isosurface_count; i++)
        if (image->isosurfaces[i].has_colour_by)
            add_colour_bar_if_new(d, &basis, &image->isosurfaces[i].colour_by, &image->isosurfaces[i].colour_map,
                                  &transfers[i]);
    const int outer = given->layers->first_outer, planes = outer + image->surface_count;
    for (int i = 0; i < image->surface_count; i++)
        if (image->surfaces[i].has_colour_by)
            add_colour_bar_if_new(d, &basis, &image->surfaces[i].colour_by, &image->surfaces[i].colour_map,
                                  &transfers[outer + i]);
    for (int i = 0, plane = planes; i < image->slice_count; plane += image->slices[i++].plane_count)
        add_colour_bar_if_new(d, &basis, &image->slices[i].field, &image->slices[i].colour_map, &transfers[plane]);
    for (int i = 0; i < image->volume_count; i++)
        add_colour_bar_if_new(d, &basis, &image->volumes[i].field, &image->volumes[i].colour_map,
                              &transfers[given->layers->surface_count + i]);
}

static void hash_colours(uint64_t *hash, const float *colours, int count)
{
    session_hash_bytes(hash, &count, sizeof count);
    if (colours) session_hash_bytes(hash, colours, 3 * (size_t)count * sizeof *colours);
}

/* Returns a hash of the labels, colours and ticks of all colour bars. */
static uint64_t hash_colour_bars(const insitu_decorations *d)
{
    uint64_t hash = SESSION_HASH_BEGIN;
    for (int i = 0; i < d->bar_count; i++) {
        const insitu_colour_bar *bar = &d->bars[i];
        const int kinds[2] = {bar->is_banded, (int)bar->at};
        session_hash_text(&hash, bar->label);
        session_hash_bytes(&hash, kinds, sizeof kinds);
        hash_colours(&hash, bar->colours, bar->colour_count);
        hash_colours(&hash, bar->below, bar->below != NULL);
        hash_colours(&hash, bar->above, bar->above != NULL);
        for (int k = 0; k < bar->tick_count; k++) {
            session_hash_bytes(&hash, &bar->ticks[k].place, sizeof bar->ticks[k].place);
            session_hash_text(&hash, bar->ticks[k].text);
        }
    }
    return hash;
}

/* ---- all decorations ----------------------------------------------------------------------------------------- */

static void set_orientation_axes(session_decorations *d, const render_camera *c)
{
    for (int a = 0; a < 3; a++) {
        d->decorations.axes[a][0] = c->right[a];
        d->decorations.axes[a][1] = c->up[a];
        d->decorations.axes[a][2] = -c->forward[a];
    }
}

/* Computes the scale bar and the rulers. */
static void add_scale_bar_and_rulers(session_decorations *d, const scene_decorations *scene,
                                     const session_extent *extent, const render_camera *camera)
{
    double middle[3];
    for (int a = 0; a < 3; a++) middle[a] = 0.5 * extent->lower[a] + 0.5 * extent->upper[a];
    if (scene->has_rulers)
        session_add_box_rulers(extent->lower, extent->upper, camera, scene->size * camera->height, &d->decorations,
                               d->strokes, d->ruler_labels);
    if (scene->has_scale_bar) d->decorations.scale_bar = session_make_scale_bar(camera, middle, scene->scale_unit);
    d->decorations.scale_bar.at = (insitu_anchor)scene->scale_bar_anchor;
}

static void add_strokes_of_outline_boxes(session_decorations *d, const session_outline *outline,
                                         const render_camera *camera)
{
    for (int i = 0; i < outline->count; i++)
        d->decorations.stroke_count += session_compute_box_strokes(outline->boxes[i].lower, outline->boxes[i].upper,
                                                                   camera, d->strokes + d->decorations.stroke_count);
}

session_decorations *session_make_decorations(const scene_image *image, const session_decoration_basis *basis)
{
    const scene_decorations *scene = &image->decorations;
    const size_t strokes = (size_t)SESSION_BOX_EDGES * (size_t)basis->outline->count + SESSION_RULER_STROKES;
    session_decorations *d = base_calloc(1, sizeof *d);
    if (!d) return NULL;
    d->strokes = base_alloc(strokes * sizeof *d->strokes);
    d->decorations = (insitu_decorations){.size = scene->size,
                                          .words = d->words,
                                          .bars = d->bars,
                                          .strokes = d->strokes,
                                          .labels = d->ruler_labels,
                                          .has_axes = scene->has_axes};
    memcpy(d->decorations.background, image->background, sizeof d->decorations.background);
    d->background = d->decorations;
    d->background.has_axes = false;
    choose_text_colour(image, d->decorations.colour);
    set_orientation_axes(d, &basis->view->camera);
    if (scene->has_bars) add_colour_bars_of_layers(d, image, basis);
    d->bars_hash = hash_colour_bars(&d->decorations);
    if (d->strokes) {
        add_strokes_of_outline_boxes(d, basis->outline, &basis->view->camera);
        if (basis->extent->cell_count) add_scale_bar_and_rulers(d, scene, basis->extent, &basis->view->camera);
        if (add_scene_texts(d, scene, basis->moment)) return d;
    }
    session_free_decorations(d);
    return NULL;
}

/* Changes the pointers in a bitwise copy of a struct, so that they refer to the copy's own members. */
static void redirect_pointers_to_copy(session_decorations *copy)
{
    insitu_decorations *const both[2] = {&copy->decorations, &copy->background};
    for (int i = 0; i < 2; i++) {
        both[i]->words = copy->words;
        both[i]->bars = copy->bars;
        both[i]->strokes = copy->strokes;
        both[i]->labels = copy->ruler_labels;
    }
    for (int i = 0; i < copy->decorations.bar_count; i++) {
        copy->bars[i].label = copy->labels[i];
        copy->bars[i].ticks = copy->ticks[i];
    }
}

session_decorations *session_copy_decorations(const session_decorations *from)
{
    const size_t strokes = (size_t)from->decorations.stroke_count;
    session_decorations *copy = base_alloc(sizeof *copy);
    if (!copy) return NULL;
    *copy = *from;
    copy->decorations.words_count = 0;
    copy->strokes = base_alloc((strokes + 1) * sizeof *copy->strokes);
    bool is_done = copy->strokes != NULL;
    if (is_done && strokes) memcpy(copy->strokes, from->strokes, strokes * sizeof *copy->strokes);
    for (int i = 0; i < from->decorations.words_count && is_done; i++) {
        copy->words[i].text = base_strdup(from->words[i].text);
        is_done = copy->words[i].text != NULL;
        copy->decorations.words_count += is_done;
    }
    redirect_pointers_to_copy(copy);
    if (is_done) return copy;
    session_free_decorations(copy);
    return NULL;
}

void session_free_decorations(session_decorations *decorations)
{
    if (!decorations) return;
    for (int i = 0; i < decorations->decorations.words_count; i++)
        base_free((void *)(uintptr_t)decorations->words[i].text);
    base_free(decorations->strokes);
    base_free(decorations);
}
