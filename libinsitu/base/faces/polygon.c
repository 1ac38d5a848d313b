#include "polygon.h"

#include <math.h>
#include <string.h>

#include "vector3.h"

/* Tolerance for triangles of a fan whose orientation is opposite to the polygon's, as a fraction of the polygon's area.
 * Triangles of smaller area have this orientation only because the coordinates of nearly collinear corners are rounded;
 * the tolerance is a few rounding errors of float32 coordinates. */
static const double fan_slack = 0x1p-20;

/* Area below which three corners of a polygon of width about 1 count as collinear. Projected positions have errors of a
 * few 2^-53; areas have errors of about ten times as much. */
static const double line_slack = 0x1p-46;

/* Values of polygon_work.blocker that are not indices of corners. NO_BLOCKER: the corner and its two neighbours form an
 * ear; NOT_CONVEX: they do not, because the corner is not convex. */
enum { NO_BLOCKER = -1, NOT_CONVEX = -2 };

/* The corners of a polygon, numbered in the order that polygon.h defines. */
typedef struct polygon_work {
    int count;
    /* 1 if the corners are numbered in the direction of the caller's list, -1 if they are numbered in the opposite
     * direction */
    int step;
    int *order;
    double (*positions)[3]; /* positions relative to the smallest corner, scaled to a width of about 1 */
    /* corners projected into a plane along the polygon's normal; the corners run counterclockwise in this plane */
    double (*projection)[2];
    int *next, *previous; /* doubly linked list of the corners that have not been cut off */
    /* For each corner that has not been cut off, the index of another corner because of which this corner and its two
     * neighbours do not form an ear; or one of the constants above. The index is stored, because testing all corners
     * again after every cut would take cubic time. */
    int *blocker;
    int (*triangles)[3];
    int triangle_count;
} polygon_work;

size_t polygon_work_bytes(int count)
{
    return (size_t)count * (5 * sizeof(double) + 4 * sizeof(int));
}

static polygon_work divide_work_memory(int count, char *work, int (*triangles)[3])
{
    const size_t n = (size_t)count;
    polygon_work w = {.count = count, .triangles = triangles};
    w.positions = (double(*)[3])(void *)work;
    w.projection = (double(*)[2])(void *)(work + 3 * n * sizeof(double));
    w.order = (int *)(void *)(work + 5 * n * sizeof(double));
    w.next = w.order + n;
    w.previous = w.next + n;
    w.blocker = w.previous + n;
    return w;
}

/* ---- the order of corners ---------------------------------------------------------------------------------------- */

static int cyclic_index(int start, int step, int i, int count)
{
    return (start + (step > 0 ? i : count - i)) % count;
}

static bool is_corner_order_smaller(const double (*p)[3], int count, const int one[2], const int other[2])
{
    for (int i = 0; i < count; i++) {
        const int sign =
            vector3_compare(p[cyclic_index(one[0], one[1], i, count)], p[cyclic_index(other[0], other[1], i, count)]);
        if (sign) return sign < 0;
    }
    return false;
}

static void find_canonical_corner_order(polygon_work *w, const double (*p)[3])
{
    int best[2] = {0, 1};
    for (int i = 0; i < w->count; i++) {
        if (vector3_compare(p[i], p[best[0]]) > 0) continue;
        for (int step = 1; step >= -1; step -= 2)
            if (is_corner_order_smaller(p, w->count, (const int[2]){i, step}, best)) best[0] = i, best[1] = step;
    }
    for (int i = 0; i < w->count; i++) w->order[i] = cyclic_index(best[0], best[1], i, w->count);
    w->step = best[1];
}

/* Computes the scaled positions. The scale is a power of two, so that scaling is exact. Returns false if all corners
 * have the same position. */
static bool scale_positions(polygon_work *w, const double (*p)[3])
{
    double widest = 0;
    int exponent;
    for (int i = 0; i < w->count; i++)
        for (int axis = 0; axis < 3; axis++) {
            w->positions[i][axis] = p[w->order[i]][axis] - p[w->order[0]][axis];
            widest = fmax(widest, fabs(w->positions[i][axis]));
        }
    if (!(widest > 0)) return false;
    frexp(widest, &exponent);
    for (int i = 0; i < w->count; i++)
        for (int axis = 0; axis < 3; axis++) w->positions[i][axis] = ldexp(w->positions[i][axis], -exponent);
    return true;
}

/* ---- cutting into a fan --------------------------------------------------------------------------------------- */

/* Returns whether the polygon can be cut into a fan from its first corner. `normal` receives the polygon's normal; its
 * length is twice the polygon's area. */
static bool can_be_cut_into_fan(const polygon_work *w, double normal[3])
{
    double area[3];
    normal[0] = normal[1] = normal[2] = 0;
    for (int i = 1; i + 1 < w->count; i++) {
        vector3_cross(w->positions[i], w->positions[i + 1], area);
        for (int axis = 0; axis < 3; axis++) normal[axis] += area[axis];
    }
    const double least = -fan_slack * vector3_dot(normal, normal);
    for (int i = 1; i + 1 < w->count; i++) {
        vector3_cross(w->positions[i], w->positions[i + 1], area);
        if (vector3_dot(area, normal) < least) return false;
    }
    return true;
}

/* Returns whether exactly one of four corners is concave. */
static bool is_concave_quad(const polygon_work *w)
{
    double areas[4][3], normal[3] = {0, 0, 0}, sides[4][3];
    int inward = 0;
    for (int i = 0; i < 4; i++)
        for (int axis = 0; axis < 3; axis++) sides[i][axis] = w->positions[(i + 1) & 3][axis] - w->positions[i][axis];
    for (int i = 0; i < 4; i++) {
        vector3_cross(sides[(i + 3) & 3], sides[i], areas[i]);
        for (int axis = 0; axis < 3; axis++) normal[axis] += areas[i][axis] / 2;
    }
    for (int i = 0; i < 4; i++) inward += vector3_dot(areas[i], normal) < -fan_slack * vector3_dot(normal, normal);
    return inward == 1;
}

static void add_triangle(polygon_work *w, int a, int b, int c)
{
    int *t = w->triangles[w->triangle_count++];
    t[0] = w->order[a];
    t[1] = w->order[w->step > 0 ? b : c];
    t[2] = w->order[w->step > 0 ? c : b];
}

static void add_fan(polygon_work *w, int first)
{
    for (int i = w->next[first]; w->next[i] != first; i = w->next[i]) add_triangle(w, first, i, w->next[i]);
}

/* ---- cutting off ears ----------------------------------------------------------------------------------------- */

static void project_to_plane(polygon_work *w, const double normal[3])
{
    const double size = sqrt(vector3_dot(normal, normal));
    double up[3], right[3], across[3] = {0, 0, 0};
    int largest = 0;
    for (int axis = 1; axis < 3; axis++)
        if (fabs(normal[axis]) > fabs(normal[largest])) largest = axis;
    across[(largest + 1) % 3] = 1;
    vector3_cross(across, normal, right);
    const double length = sqrt(vector3_dot(right, right));
    for (int axis = 0; axis < 3; axis++) right[axis] /= length;
    vector3_cross(normal, right, up);
    for (int i = 0; i < w->count; i++) {
        w->projection[i][0] = vector3_dot(w->positions[i], right);
        w->projection[i][1] = vector3_dot(w->positions[i], up) / size;
    }
}

/* Returns twice the signed area of a triangle: it is positive if the triangle runs counterclockwise. */
static double compute_triangle_area(const polygon_work *w, int a, int b, int c)
{
    const double *p = w->projection[a], *q = w->projection[b], *r = w->projection[c];
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
}

static bool are_coincident(const polygon_work *w, int a, int b)
{
    const double *p = w->positions[a], *q = w->positions[b];
    return p[0] == q[0] && p[1] == q[1] && p[2] == q[2];
}

/* The corners `coincident` and `tip` have the same position. Returns whether one of the two edges at `coincident` leads
 * into the angle between the two edges from `tip` to its neighbours a and c. */
static bool does_edge_enter_corner(const polygon_work *w, int a, int tip, int c, int coincident)
{
    const int ends[2] = {w->previous[coincident], w->next[coincident]};
    for (int i = 0; i < 2; i++)
        if (compute_triangle_area(w, a, tip, ends[i]) > line_slack &&
            compute_triangle_area(w, tip, c, ends[i]) > line_slack)
            return true;
    return false;
}

static bool is_ear_blocked_by_corner(const polygon_work *w, int a, int tip, int c, int other)
{
    if (are_coincident(w, other, a) || are_coincident(w, other, c)) return false;
    if (are_coincident(w, other, tip)) return does_edge_enter_corner(w, a, tip, c, other);
    return compute_triangle_area(w, a, tip, other) >= -line_slack &&
           compute_triangle_area(w, tip, c, other) >= -line_slack &&
           compute_triangle_area(w, c, a, other) >= -line_slack;
}

static int find_blocker(const polygon_work *w, int tip)
{
    const int a = w->previous[tip], c = w->next[tip];
    if (!(compute_triangle_area(w, a, tip, c) > line_slack)) return NOT_CONVEX;
    for (int by = w->next[c]; by != a; by = w->next[by])
        if (is_ear_blocked_by_corner(w, a, tip, c, by)) return by;
    return NO_BLOCKER;
}

/* Returns the first corner after `first` at which there is an ear. `first` itself is tested last. Returns -1 if there
 * is no ear. */
static int find_ear(const polygon_work *w, int first)
{
    int i = first;
    do {
        i = w->next[i];
        if (w->blocker[i] == NO_BLOCKER) return i;
    } while (i != first);
    return -1;
}

/* Returns a corner that is collinear with its two neighbours, or -1 if there is none. */
static int find_collinear_corner(const polygon_work *w, int first)
{
    int i = first;
    do {
        i = w->next[i];
        if (fabs(compute_triangle_area(w, w->previous[i], i, w->next[i])) <= line_slack) return i;
    } while (i != first);
    return -1;
}

/* Updates `blocker` after the corner `cut`, whose neighbours are a and c, has been cut off. Values may change at a and
 * c, at corners of which `cut` was the blocker, and at corners that coincide with a or c (does_edge_enter_corner()). */
static void update_blockers(polygon_work *w, int a, int cut, int c)
{
    int i = a;
    do {
        if (w->blocker[i] == cut || are_coincident(w, i, a) || are_coincident(w, i, c))
            w->blocker[i] = find_blocker(w, i);
    } while ((i = w->next[i]) != a);
}

static void cut_ears(polygon_work *w)
{
    int first = 0;
    for (int i = 0; i < w->count; i++) w->blocker[i] = find_blocker(w, i);
    for (int left = w->count; left > 3; left--) {
        int ear = find_ear(w, first);
        if (ear < 0) ear = find_collinear_corner(w, first);
        if (ear < 0) break;
        const int a = w->previous[ear], c = w->next[ear];
        add_triangle(w, a, ear, c);
        w->next[a] = c;
        w->previous[c] = a;
        if (ear == first) first = c;
        update_blockers(w, a, ear, c);
    }
    add_fan(w, first);
}

void polygon_triangulate(const double (*corners)[3], int count, void *work, int (*triangles)[3])
{
    polygon_work w = divide_work_memory(count, work, triangles);
    double normal[3];
    find_canonical_corner_order(&w, corners);
    for (int i = 0; i < count; i++) {
        w.next[i] = (i + 1) % count;
        w.previous[i] = (i + count - 1) % count;
    }
    const bool may_be_concave = count > 3 && scale_positions(&w, corners) && (count > 4 || is_concave_quad(&w));
    if (!may_be_concave || can_be_cut_into_fan(&w, normal)) {
        add_fan(&w, 0);
        return;
    }
    project_to_plane(&w, normal);
    cut_ears(&w);
}

bool polygon_is_concave_quad(const double (*corners)[3])
{
    double work[4 * 8];
    polygon_work w = divide_work_memory(4, (char *)work, NULL);
    find_canonical_corner_order(&w, corners);
    return scale_positions(&w, corners) && is_concave_quad(&w);
}
