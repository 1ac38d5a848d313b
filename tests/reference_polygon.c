#include "reference_polygon.h"

#include <math.h>
#include <string.h>

/* Areas below these fractions of the polygon's area count as rounding. fan_slack: for the triangles of a fan;
 * line_slack: for corners on a line. */
static const double fan_slack = 0x1p-20, line_slack = 1e-14;

/* The polygon that remains after some ears are cut off. Its corners are in the order in which ears are tested. */
typedef struct loop {
    int count;
    bool is_backward;
    int number[REFERENCE_MAX_CORNERS];
    double place[REFERENCE_MAX_CORNERS][3];
    double normal[3], area; /* normal: unit normal; area: twice the polygon's area */
} loop;

static double signed_area_along_normal(const double *normal, const double *a, const double *b, const double *c)
{
    double sum = 0;
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        sum += normal[i] * ((b[j] - a[j]) * (c[k] - a[k]) - (b[k] - a[k]) * (c[j] - a[j]));
    }
    return sum;
}

/* Makes the loop of corners. It begins at the corner, and runs in the direction, for which the list of coordinates is
 * lexicographically least. */
static void make_loop(const double (*corners)[3], int count, loop *out)
{
    int best[2] = {0, 1};
    for (int i = 0; i < 2 * count; i++) {
        const int start = i / 2, step = i % 2 ? count - 1 : 1;
        int sign = 0;
        for (int k = 0; k < 3 * count && !sign; k++) {
            const double a = corners[(start + k / 3 * step) % count][k % 3];
            const double b = corners[(best[0] + k / 3 * best[1]) % count][k % 3];
            sign = a < b ? -1 : a > b;
        }
        if (sign < 0) best[0] = start, best[1] = step;
    }
    *out = (loop){.count = count, .is_backward = best[1] != 1};
    for (int i = 0; i < count; i++) {
        out->number[i] = (best[0] + i * best[1]) % count;
        memcpy(out->place[i], corners[out->number[i]], sizeof out->place[i]);
    }
    for (int axis = 0; axis < 3; axis++) {
        double unit[3] = {0, 0, 0};
        unit[axis] = 1;
        for (int i = 1; i + 1 < count; i++)
            out->normal[axis] += signed_area_along_normal(unit, out->place[0], out->place[i], out->place[i + 1]);
    }
    out->area =
        sqrt(out->normal[0] * out->normal[0] + out->normal[1] * out->normal[1] + out->normal[2] * out->normal[2]);
    for (int axis = 0; axis < 3 && out->area > 0; axis++) out->normal[axis] /= out->area;
}

static double compute_corner_area(const loop *l, int a, int b, int c)
{
    return signed_area_along_normal(l->normal, l->place[a], l->place[b], l->place[c]) / l->area;
}

static bool is_fan(const loop *l)
{
    for (int i = 1; i + 1 < l->count; i++)
        if (compute_corner_area(l, 0, i, i + 1) < -fan_slack) return false;
    return true;
}

static bool are_equal_points(const loop *l, int a, int b)
{
    return memcmp(l->place[a], l->place[b], sizeof l->place[a]) == 0;
}

static bool is_ear(const loop *l, int tip)
{
    const int n = l->count, a = (tip + n - 1) % n, c = (tip + 1) % n;
    if (compute_corner_area(l, a, tip, c) <= line_slack) return false;
    for (int i = 0; i < n; i++) {
        if (i == a || i == tip || i == c || are_equal_points(l, i, a) || are_equal_points(l, i, c)) continue;
        if (!are_equal_points(l, i, tip)) {
            if (compute_corner_area(l, a, tip, i) >= -line_slack && compute_corner_area(l, tip, c, i) >= -line_slack &&
                compute_corner_area(l, c, a, i) >= -line_slack)
                return false;
            continue;
        }
        for (int side = 1; side < n; side += n - 2) { /* neighbours of another corner at the same position */
            const int end = (i + side) % n;
            if (compute_corner_area(l, a, tip, end) > line_slack && compute_corner_area(l, tip, c, end) > line_slack)
                return false;
        }
    }
    return true;
}

static void add_triangle(const loop *l, int a, int b, int c, int (*triangles)[3], int *count)
{
    int *t = triangles[(*count)++];
    t[0] = l->number[a];
    t[1] = l->number[l->is_backward ? c : b];
    t[2] = l->number[l->is_backward ? b : c];
}

static int find_first_ear(const loop *l)
{
    for (int i = 1; i <= l->count; i++)
        if (is_ear(l, i % l->count)) return i % l->count;
    for (int i = 1; i <= l->count; i++) {
        const int n = l->count, b = i % n;
        if (fabs(compute_corner_area(l, (b + n - 1) % n, b, (b + 1) % n)) <= line_slack) return b;
    }
    return -1;
}

int reference_polygon_triangulate(const double (*corners)[3], int count, int (*triangles)[3])
{
    loop l;
    int found = 0;
    make_loop(corners, count, &l);
    const bool is_simple = l.area == 0 || (count == 4 && !reference_is_concave_quad(corners)) || is_fan(&l);
    while (l.count > 3 && !is_simple) {
        const int ear = find_first_ear(&l);
        if (ear < 0) break;
        add_triangle(&l, (ear + l.count - 1) % l.count, ear, (ear + 1) % l.count, triangles, &found);
        l.count--;
        memmove(l.number + ear, l.number + ear + 1, (size_t)(l.count - ear) * sizeof l.number[0]);
        memmove(l.place + ear, l.place + ear + 1, (size_t)(l.count - ear) * sizeof l.place[0]);
    }
    for (int i = 1; i + 1 < l.count; i++) add_triangle(&l, 0, i, i + 1, triangles, &found);
    return found;
}

bool reference_is_concave_quad(const double (*corners)[3])
{
    loop l;
    int inward = 0;
    make_loop(corners, 4, &l);
    for (int i = 0; i < 4 && l.area > 0; i++)
        inward += compute_corner_area(&l, (i + 3) % 4, i, (i + 1) % 4) < -fan_slack / 2;
    return inward == 1;
}
