/* An automatic camera looks along a given direction, and its place is computed: for the sphere around the bounds, on
 * the line through their middle; for the box, where its corners just fill the part of the frame that decorations leave.
 *
 * A corner at (x, y) across and w towards the eye, seen from a place s to the right and D towards the eye, is within
 * the right border if x - s <= r (D - w), r being its tangent; and within the left one, of tangent l, if s - x <= l (D
 * - w). So with a = max(x + r w) and b = max(l w - x), D is at least (a + b) / (r + l), and s = (a - b + (l - r) D) / 2
 * does for every such D. The same holds for up and down; the larger D serves both. */
#include "session_camera.h"

#include <math.h>

/* The share of the half frame that the data fills at most. */
static const double filled = 0.95;

static double length(const double v[3])
{
    return hypot(hypot(v[0], v[1]), v[2]);
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Chooses up, or, where that is along the view, an axis that is not. */
static void choose_up(const double direction[3], const double up[3], double out[3])
{
    const double cross[3] = {direction[1] * up[2] - direction[2] * up[1], direction[2] * up[0] - direction[0] * up[2],
                             direction[0] * up[1] - direction[1] * up[0]};
    for (int axis = 0; axis < 3; axis++) out[axis] = up[axis];
    if (length(cross) > 1e-6 * length(direction) * length(up)) return;
    int least = 0;
    for (int axis = 1; axis < 3; axis++)
        if (fabs(direction[axis]) < fabs(direction[least])) least = axis;
    for (int axis = 0; axis < 3; axis++) out[axis] = axis == least;
}

/* ---- where it stands ------------------------------------------------------------------------------------------- */

/* The camera's place, from the middle of the bounds: right and up, and how much more for each length towards the eye;
 * back, towards the eye; and for an orthographic picture half its height, and how much right and up for each length of
 * that. */
typedef struct camera_stand {
    double right, up, right_slope, up_slope, back, half_height, right_share, up_share;
} camera_stand;

/* Tangents of half the angles of view, across and up. */
typedef struct camera_tangents {
    double across, up;
} camera_tangents;

static camera_tangents tangents_of(const scene_image *image)
{
    const double up = tan(image->camera.angle * (3.14159265358979323846 / 360));
    return (camera_tangents){up * image->width / image->height, up};
}

/* The place from which a sphere just fits into the narrower of the two angles of view. */
static camera_stand fit_sphere(double radius, const scene_image *image, camera_tangents t)
{
    double half = 0.5 * image->camera.angle * 3.14159265358979323846 / 180;
    if (image->width < image->height) half = atan(tan(half) * image->width / image->height);
    return (camera_stand){.back = radius / sin(half), .half_height = radius * fmax(1, t.up / t.across)};
}

/* The largest of so many places of corners, for which see above. */
typedef struct corner_reach {
    double right, left, up, down, back;
} corner_reach;

/* Shares of half the frame, or tangents, from its middle to where the data may reach on each side. */
typedef struct camera_frame {
    double right, left, up, down;
} camera_frame;

/* The room that a colour bar, a title, and rulers' numbers take of the picture, in heights of words. */
static const double bar_room = 6.5, title_room = 2.4, ruler_room = 3;

static double less_room(double words, double pixels)
{
    return fmax(filled - 2 * words / pixels, 0.5);
}

/* The part of the frame that decorations leave free. */
static camera_frame free_frame(const scene_image *image)
{
    const scene_decorations *d = &image->decorations;
    if (!d->is_given) return (camera_frame){filled, filled, filled, filled};
    const double size = d->size * image->height, rulers = d->has_rulers ? ruler_room * size : 0;
    const double bars = d->has_bars ? bar_room * size : 0, title = d->title ? title_room * size : 0;
    return (camera_frame){.right = less_room(rulers + (d->bars_at == SCENE_RIGHT ? bars : 0), image->width),
                          .left = less_room(rulers + (d->bars_at == SCENE_LEFT ? bars : 0), image->width),
                          .up = less_room(title, image->height),
                          .down = less_room(rulers, image->height)};
}

static corner_reach reach_of_corners(const session_extent *e, const render_camera *axes, const camera_frame *f)
{
    corner_reach r = {-INFINITY, -INFINITY, -INFINITY, -INFINITY, -INFINITY};
    for (int corner = 0; corner < 8; corner++) {
        double p[3];
        for (int a = 0; a < 3; a++) p[a] = (corner >> a & 1 ? 0.5 : -0.5) * (e->upper[a] - e->lower[a]);
        const double x = dot(p, axes->right), y = dot(p, axes->up), w = -dot(p, axes->forward);
        r.right = fmax(r.right, x + f->right * w);
        r.left = fmax(r.left, f->left * w - x);
        r.up = fmax(r.up, y + f->up * w);
        r.down = fmax(r.down, f->down * w - y);
        r.back = fmax(r.back, w);
    }
    return r;
}

static camera_stand fit_box(const session_extent *e, const render_camera *axes, const scene_image *image,
                            camera_tangents t)
{
    static const camera_frame nothing;
    const camera_frame share = free_frame(image);
    const camera_frame f = {share.right * t.across, share.left * t.across, share.up * t.up, share.down * t.up};
    const corner_reach near = reach_of_corners(e, axes, &f), flat = reach_of_corners(e, axes, &nothing);
    const double back = fmax((near.right + near.left) / (f.right + f.left), (near.up + near.down) / (f.up + f.down));
    const double across = 2 * flat.right / (share.right + share.left) * t.up / t.across;
    return (camera_stand){.right = 0.5 * (near.right - near.left),
                          .up = 0.5 * (near.up - near.down),
                          .right_slope = 0.5 * (f.left - f.right),
                          .up_slope = 0.5 * (f.down - f.up),
                          .back = fmax(back, near.back + 0.01 * e->half_diagonal), /* flat bounds, seen edge on */
                          .half_height = fmax(2 * flat.up / (share.up + share.down), across),
                          .right_share = 0.5 * (share.left - share.right) * t.across / t.up,
                          .up_share = 0.5 * (share.down - share.up)};
}

/* Half the height of an orthographic picture. */
static double half_height_of(const scene_image *image, double fitting)
{
    return image->camera.height > 0 ? 0.5 * image->camera.height : fitting;
}

/* The eye stays where it is, with all data before it: an orthographic picture is the same from any distance. */
static void set_orthographic(const scene_image *image, double half_height, render_camera *camera)
{
    if (!image->camera.is_orthographic) return;
    camera->is_orthographic = true;
    camera->half_height = half_height_of(image, half_height);
}

static bool automatic_camera(const session_extent *extent, const scene_image *image, render_camera *out)
{
    const scene_camera *c = &image->camera;
    const double radius = extent->half_diagonal > 0 ? extent->half_diagonal : 1;
    const camera_tangents tangents = tangents_of(image);
    double middle[3], eye[3], focal[3], up[3];
    render_camera axes;
    for (int a = 0; a < 3; a++) {
        middle[a] = 0.5 * extent->lower[a] + 0.5 * extent->upper[a];
        eye[a] = middle[a] + c->direction[a] / length(c->direction) * radius;
    }
    choose_up(c->direction, c->up, up);
    if (!render_camera_look_at(&axes, eye, middle, up, c->angle, image->width, image->height)) return false;
    const bool by_box = c->fits_box && extent->half_diagonal > 0;
    const camera_stand stand = by_box ? fit_box(extent, &axes, image, tangents) : fit_sphere(radius, image, tangents);
    const bool is_flat = c->is_orthographic;
    const double back = is_flat ? 2 * radius : stand.back / c->zoom;
    const double half_height = half_height_of(image, stand.half_height / c->zoom);
    const double right = is_flat ? stand.right_share * half_height : stand.right + stand.right_slope * back;
    const double above = is_flat ? stand.up_share * half_height : stand.up + stand.up_slope * back;
    for (int a = 0; a < 3; a++) {
        focal[a] = middle[a] + (right * axes.right[a] + above * axes.up[a]);
        eye[a] = focal[a] + c->direction[a] / length(c->direction) * back;
    }
    if (!render_camera_look_at(out, eye, focal, up, c->angle, image->width, image->height)) return false;
    set_orthographic(image, half_height, out);
    return true;
}

static bool explicit_camera(const scene_image *image, render_camera *out)
{
    const scene_camera *c = &image->camera;
    if (!render_camera_look_at(out, c->eye, c->focal, c->up, c->angle, image->width, image->height)) return false;
    const double between[3] = {c->eye[0] - c->focal[0], c->eye[1] - c->focal[1], c->eye[2] - c->focal[2]};
    set_orthographic(image, out->half_height * length(between), out);
    return true;
}

bool session_make_camera(const session_extent *extent, const scene_image *image, render_camera *out)
{
    return image->camera.is_automatic ? automatic_camera(extent, image, out) : explicit_camera(image, out);
}
