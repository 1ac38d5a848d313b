/* Computes cameras. An automatic camera looks along a given direction. Its position is such that the sphere around the
 * bounds, or the corners of the bounds, just fit into the part of the frame that decorations leave free.
 *
 * Coordinates are relative to the centre of the bounds: x to the right, y up, and w against the direction of view.
 * Let a corner be at (x, y, w), and the eye at x = s and w = D. Let r and l be the tangents of the angles to the
 * right and left border of the frame. The corner is within the right border if x - s <= r (D - w), and within the
 * left border if s - x <= l (D - w). Therefore, with the maxima over the corners a = max(x + r w) and b = max(l w -
 * x), s must be between a - r D and l D - b. These limits are equal at D = (a + b) / (r + l), the smallest possible
 * distance. The same holds for up and down; the larger D is used. A sphere of radius R has a = R sqrt(1 + r^2) and b
 * = R sqrt(1 + l^2). A box is placed in the middle of its allowed interval of s, a sphere as near to the middle of
 * the frame as the interval allows. */
#include "session_camera.h"

#include <math.h>
#include <string.h>

#include "vector3.h"

/* Largest part of the frame that a box may fill, in each direction from the centre, as a fraction of half the frame. */
static const double max_filled = 0.95;

/* Returns `up` or, if `up` is parallel to the direction of view, a coordinate axis that is not parallel to it. */
static void choose_valid_up_direction(const double direction[3], const double up[3], double out[3])
{
    double cross[3];
    vector3_cross(direction, up, cross);
    for (int axis = 0; axis < 3; axis++) out[axis] = up[axis];
    if (vector3_length(cross) > 1e-6 * vector3_length(direction) * vector3_length(up)) return;
    int least = 0;
    for (int axis = 1; axis < 3; axis++)
        if (fabs(direction[axis]) < fabs(direction[least])) least = axis;
    for (int axis = 0; axis < 3; axis++) out[axis] = axis == least;
}

/* ---- position of the camera ------------------------------------------------------------------------------------ */

/* Tangents of half the horizontal and half the vertical angle of view. */
typedef struct camera_tangents {
    double horizontal, vertical;
} camera_tangents;

static camera_tangents compute_tangents_of_view_angle(const scene_image *image)
{
    const double up = tan(image->camera.angle * (3.14159265358979323846 / 360));
    return (camera_tangents){up * image->width / image->height, up};
}

/* Extents of the data. right, left, up, down: for each side of the picture, the maximum a or b over the corners (see
 * the top of this file). back: the largest distance of a corner from the centre, measured towards the eye. */
typedef struct corner_reach {
    double right, left, up, down, back;
} corner_reach;

/* Limits within which the data must lie in the picture: for each side, the distance of the limit from the centre of the
 * frame, as a fraction of half the frame or as the tangent of an angle. */
typedef struct camera_frame {
    double right, left, up, down;
} camera_frame;

/* For a perspective and for an orthographic camera: the extents of the data, measured from the centre of the bounds,
 * and the limits within which the data must lie in the picture. */
typedef struct camera_fit {
    corner_reach perspective_reach, orthographic_reach;
    camera_frame tangents, frame_fractions;
    bool is_centred; /* set if the data is centred in the part of the frame that decorations leave free */
} camera_fit;

/* Space that decorations take from the picture, as multiples of the height of text: a column of colour bars, a title, a
 * line of text, and the numbers of rulers. The constants in the second statement describe the shape of a colour bar,
 * approximately that of adaptors/image/layout.cpp. */
static const double bar_space = 6.5, title_space = 2.4, line_space = 1.5, ruler_space = 3;
static const double letter_width = 0.6, label_width = 7, bar_borders = 1.2, bar_height = 5.3, line_height = 1.2;

static double compute_free_frame_fraction(double most, double words, double pixels)
{
    return fmax(most - 2 * words / pixels, 0.5);
}

/* Returns the number of colour bars. *letters receives the number of letters of the longest label. */
static int count_colour_bars(const scene_image *image, double *letters)
{
    const scene_decorations *d = &image->decorations;
    int count = image->slice_count + image->volume_count;
    *letters = 0;
    for (int i = 0; i < d->label_count; i++) *letters = fmax(*letters, (double)strlen(d->labels[i]));
    for (int i = 0; i < d->unit_count; i++) *letters = fmax(*letters, (double)strlen(d->units[i]) + 2);
    for (int i = 0; i < image->isosurface_count; i++) count += image->isosurfaces[i].has_colour_by;
    for (int i = 0; i < image->surface_count; i++) count += image->surfaces[i].has_colour_by;
    return count;
}

/* Returns whether some output file of the image has the colour bars inside the picture, instead of beside it. */
static bool has_colour_bars_inside_picture(const scene_image *image)
{
    bool is_any = image->output_count == 0;
    for (int i = 0; i < image->output_count; i++) is_any = is_any || !image->outputs[i].shares_bars;
    return image->decorations.has_bars && is_any;
}

/* Returns the width of all columns of colour bars, as a multiple of the height of text. */
static double compute_colour_bar_width(const scene_image *image)
{
    const scene_decorations *d = &image->decorations;
    double letters;
    const int count = count_colour_bars(image, &letters);
    const double words = letter_width * letters, width = fmax(bar_space, fmin(words, label_width) + bar_borders);
    const double each = bar_height + line_height * fmax(1, ceil(words / label_width));
    const double rows = fmax(1, floor((1 / d->size - (d->title ? title_space : 0) - bar_borders) / each));
    return has_colour_bars_inside_picture(image) ? width * fmax(1, ceil(count / rows)) : 0;
}

/* Returns the height of the lines of text at the top or bottom of the picture, as a multiple of the height of text. It
 * is the largest of the heights of the lines in the middle, at the left corner and at the right corner. A corner is
 * included only if one of its lines extends far into the picture. */
static double compute_text_lines_height(const scene_image *image, scene_anchor middle, scene_anchor left,
                                        scene_anchor right)
{
    const scene_decorations *d = &image->decorations;
    const double long_line = 0.3 * image->width / (d->size * image->height * letter_width);
    int counts[3] = {0, 0, 0};
    bool is_long[3] = {true, false, false};
    for (int i = 0; i < d->words_count; i++) {
        const scene_anchor at = d->words[i].anchor;
        const int place = at == middle ? 0 : at == left ? 1 : at == right ? 2 : -1;
        if (place < 0) continue;
        counts[place]++;
        is_long[place] = is_long[place] || (double)strlen(d->words[i].text) > long_line;
    }
    int most = 0;
    for (int place = 0; place < 3; place++)
        if (is_long[place] && counts[place] > most) most = counts[place];
    return line_space * most + (most ? 0.5 : 0);
}

/* Returns the part of the frame that decorations leave free: for each side, the distance of its border from the centre,
 * as a fraction of half the frame. `most` is the fraction without decorations. */
static camera_frame compute_frame_without_decorations(const scene_image *image, double most)
{
    const scene_decorations *d = &image->decorations;
    if (!d->is_given) return (camera_frame){most, most, most, most};
    const double size = d->size * image->height, rulers = d->has_rulers ? ruler_space : 0,
                 bars = compute_colour_bar_width(image);
    const double top =
        (d->title ? title_space : 0) + compute_text_lines_height(image, SCENE_TOP, SCENE_TOP_LEFT, SCENE_TOP_RIGHT);
    const double foot = compute_text_lines_height(image, SCENE_BOTTOM, SCENE_BOTTOM_LEFT, SCENE_BOTTOM_RIGHT);
    const double right = rulers + (d->bar_anchor == SCENE_RIGHT ? bars : 0);
    const double left = rulers + (d->bar_anchor == SCENE_LEFT ? bars : 0);
    return (camera_frame){.right = compute_free_frame_fraction(most, right * size, image->width),
                          .left = compute_free_frame_fraction(most, left * size, image->width),
                          .up = compute_free_frame_fraction(most, top * size, image->height),
                          .down = compute_free_frame_fraction(most, (rulers + foot) * size, image->height)};
}

static corner_reach compute_extent_of_corners_in_view(const session_extent *e, const render_camera *axes,
                                                      const camera_frame *f)
{
    corner_reach r = {-INFINITY, -INFINITY, -INFINITY, -INFINITY, -INFINITY};
    for (int corner = 0; corner < 8; corner++) {
        double p[3];
        for (int a = 0; a < 3; a++) p[a] = (corner >> a & 1 ? 0.5 : -0.5) * (e->upper[a] - e->lower[a]);
        const double x = vector3_dot(p, axes->right), y = vector3_dot(p, axes->up), w = -vector3_dot(p, axes->forward);
        r.right = fmax(r.right, x + f->right * w);
        r.left = fmax(r.left, f->left * w - x);
        r.up = fmax(r.up, y + f->up * w);
        r.down = fmax(r.down, f->down * w - y);
        r.back = fmax(r.back, w);
    }
    return r;
}

static corner_reach compute_extent_of_sphere_in_view(double radius, const camera_frame *f)
{
    return (corner_reach){radius * hypot(1, f->right), radius * hypot(1, f->left), radius * hypot(1, f->up),
                          radius * hypot(1, f->down), radius};
}

static camera_fit compute_camera_fit(const session_extent *e, const render_camera *axes, const scene_image *image)
{
    static const camera_frame nothing;
    const camera_tangents t = compute_tangents_of_view_angle(image);
    const bool by_box = image->camera.fits_box && e->half_diagonal > 0;
    const camera_frame share = compute_frame_without_decorations(image, by_box ? max_filled : 1);
    const double radius = e->half_diagonal > 0 ? e->half_diagonal : 1;
    camera_fit fit = {.frame_fractions = share, .is_centred = by_box};
    fit.tangents = (camera_frame){share.right * t.horizontal, share.left * t.horizontal, share.up * t.vertical,
                                  share.down * t.vertical};
    fit.perspective_reach = by_box ? compute_extent_of_corners_in_view(e, axes, &fit.tangents)
                                   : compute_extent_of_sphere_in_view(radius, &fit.tangents);
    fit.orthographic_reach = by_box ? compute_extent_of_corners_in_view(e, axes, &nothing)
                                    : compute_extent_of_sphere_in_view(radius, &nothing);
    return fit;
}

/* Returns the distance of the eye from the centre of the bounds. */
static double compute_eye_distance(const camera_fit *fit, double half_diagonal)
{
    const corner_reach *near = &fit->perspective_reach;
    const camera_frame *f = &fit->tangents;
    const double back =
        fmax((near->right + near->left) / (f->right + f->left), (near->up + near->down) / (f->up + f->down));
    /* if bounds are flat and viewed edge-on, the second value keeps the eye outside of the bounds */
    return fmax(back, near->back + 0.01 * half_diagonal);
}

/* Returns half the height of an orthographic picture in which all data fits. aspect: width of the picture divided by
 * its height. */
static double compute_fitting_half_height(const camera_fit *fit, double aspect)
{
    const double across = (fit->orthographic_reach.right + fit->orthographic_reach.left) /
                          (fit->frame_fractions.right + fit->frame_fractions.left) / aspect;
    return fmax((fit->orthographic_reach.up + fit->orthographic_reach.down) /
                    (fit->frame_fractions.up + fit->frame_fractions.down),
                across);
}

/* Returns a position of the eye between low and high: the middle if is_centred is set or if low > high, and otherwise
 * the position nearest to 0. */
static double choose_eye_position(double low, double high, bool is_centred)
{
    if (is_centred || low > high) return 0.5 * (low + high);
    return fmin(fmax(0, low), high);
}

/* Returns half the height of an orthographic picture in scene units: the scene's height, if it is given, otherwise
 * `fitting`. */
static double choose_half_height_of_picture(const scene_image *image, double fitting)
{
    return image->camera.height > 0 ? 0.5 * image->camera.height : fitting;
}

/* Makes the camera orthographic if the scene requests it. The eye keeps its position, from which all data is visible,
 * because an orthographic picture does not depend on the distance. */
static void make_orthographic_if_requested(const scene_image *image, double half_height, render_camera *camera)
{
    if (!image->camera.is_orthographic) return;
    camera->is_orthographic = true;
    camera->half_height = choose_half_height_of_picture(image, half_height);
}

/* Computes an automatic camera. Positions are relative to the centre of the bounds until the camera is complete, so
 * that bounds far from 0 do not lose digits. Returns false if there is no direction of view. */
static bool make_automatic_camera(const session_extent *extent, const scene_image *image, render_camera *out)
{
    const scene_camera *c = &image->camera;
    const double radius = extent->half_diagonal > 0 ? extent->half_diagonal : 1;
    static const double middle[3];
    double eye[3], focal[3], up[3];
    render_camera axes;
    for (int a = 0; a < 3; a++) eye[a] = c->direction[a] / vector3_length(c->direction) * radius;
    choose_valid_up_direction(c->direction, c->up, up);
    if (!render_camera_look_at(&axes, eye, middle, up, c->angle, image->width, image->height)) return false;
    const camera_fit fit = compute_camera_fit(extent, &axes, image);
    const bool is_flat = c->is_orthographic;
    const double aspect = (double)image->width / image->height;
    const double back = is_flat ? 2 * radius : compute_eye_distance(&fit, extent->half_diagonal) / c->zoom;
    const double half_height =
        choose_half_height_of_picture(image, compute_fitting_half_height(&fit, aspect) / c->zoom);
    const corner_reach *reach = is_flat ? &fit.orthographic_reach : &fit.perspective_reach;
    const camera_frame *f = is_flat ? &fit.frame_fractions : &fit.tangents;
    const double across = is_flat ? half_height * aspect : back, high = is_flat ? half_height : back;
    const double right =
        choose_eye_position(reach->right - f->right * across, f->left * across - reach->left, fit.is_centred);
    const double above = choose_eye_position(reach->up - f->up * high, f->down * high - reach->down, fit.is_centred);
    for (int a = 0; a < 3; a++) {
        focal[a] = right * axes.right[a] + above * axes.up[a];
        eye[a] = focal[a] + c->direction[a] / vector3_length(c->direction) * back;
    }
    if (!render_camera_look_at(out, eye, focal, up, c->angle, image->width, image->height)) return false;
    for (int a = 0; a < 3; a++) out->eye[a] += 0.5 * extent->lower[a] + 0.5 * extent->upper[a];
    make_orthographic_if_requested(image, half_height, out);
    return true;
}

static bool make_explicit_camera(const scene_image *image, render_camera *out)
{
    const scene_camera *c = &image->camera;
    if (!render_camera_look_at(out, c->eye, c->focal, c->up, c->angle, image->width, image->height)) return false;
    const double between[3] = {c->eye[0] - c->focal[0], c->eye[1] - c->focal[1], c->eye[2] - c->focal[2]};
    make_orthographic_if_requested(image, out->half_height * vector3_length(between), out);
    return true;
}

/* ---- cameras for flat data ------------------------------------------------------------------------------------- */

/* Makes the camera look at data that is flat along `axis`, so that of the other two axes, the first points to the right
 * and the second points up. Keys of the camera that the scene gives are kept. */
static void set_default_view_of_flat_data(int axis, scene_camera *c)
{
    static const double towards[3][3] = {{1, 0, 0}, {0, -1, 0}, {0, 0, 1}};
    static const double upward[3][3] = {{0, 0, 1}, {0, 0, 1}, {0, 1, 0}};
    if (!c->has_direction) memcpy(c->direction, towards[axis], sizeof c->direction);
    if (!c->has_direction && !c->has_up) memcpy(c->up, upward[axis], sizeof c->up);
    if (!c->has_projection) c->is_orthographic = true;
    if (!c->has_fit) c->fits_box = true;
}

static bool make_camera_by_bounds(const session_extent *data, const scene_image *image, render_camera *out)
{
    session_extent extent = *data;
    scene_image seen = *image;
    scene_camera *c = &seen.camera;
    if (c->has_bounds) {
        double half[3];
        memcpy(extent.lower, c->lower, sizeof extent.lower);
        memcpy(extent.upper, c->upper, sizeof extent.upper);
        for (int a = 0; a < 3; a++) half[a] = 0.5 * c->upper[a] - 0.5 * c->lower[a];
        extent.half_diagonal = vector3_length(half);
    }
    const int axis = session_flat_axis(&extent);
    if (axis >= 0 && c->orbit.view_count == 0) set_default_view_of_flat_data(axis, c);
    return make_automatic_camera(&extent, &seen, out);
}

bool session_make_camera(const session_extent *extent, const scene_image *image, render_camera *out)
{
    return image->camera.is_automatic ? make_camera_by_bounds(extent, image, out) : make_explicit_camera(image, out);
}
