#include "fragment_fold.h"

#include <stdbool.h>

/* ---- the binary tree of an interval ------------------------------------------------------------------------------ */

static void blend_behind(fragment *front, const fragment *behind)
{
    for (int c = 0; c < 3; c++) front->colour[c] += front->transmittance * behind->colour[c];
    front->transmittance *= behind->transmittance;
    if (behind->t_out > front->t_out) front->t_out = behind->t_out;
}

/* Returns the height of the lowest node of the interval's binary tree that contains the leaves with the indices a and
 * b. Leaves have the height 0. */
static int find_height_of_common_node(int32_t a, int32_t b)
{
    return a == b ? 0 : 32 - __builtin_clz((uint32_t)(a ^ b));
}

/* open[] is a stack of partial results. Each entry is the blend of those fragments of one tree node that have been read
 * so far; fragments of this node that are read later are blended into the entry. heights[d], for d >= 1, is the height
 * of the lowest tree node that contains both open[d] and open[d - 1]. These heights decrease towards the top of the
 * stack, so that the stack has at most one entry per level of the tree. */
fragment fragment_fold(const fragment *sorted, int64_t count)
{
    fragment open[FRAGMENT_HALVINGS + 2];
    int heights[FRAGMENT_HALVINGS + 2] = {0}, depth = 1;
    int32_t leaf = fragment_find_leaf(sorted[0].t_in);
    open[0] = sorted[0];
    for (int64_t i = 1; i < count; i++) {
        const int32_t next = fragment_find_leaf(sorted[i].t_in);
        const int height = find_height_of_common_node(leaf, next);
        leaf = next;
        if (height == 0) {
            blend_behind(&open[depth - 1], &sorted[i]);
            continue;
        }
        for (; depth > 1 && heights[depth - 1] < height; depth--) blend_behind(&open[depth - 2], &open[depth - 1]);
        open[depth] = sorted[i];
        heights[depth++] = height;
    }
    for (; depth > 1; depth--) blend_behind(&open[depth - 2], &open[depth - 1]);
    return open[0];
}

/* ---- blending the fragments of one rank -------------------------------------------------------------------------- */

/* The state while a rank folds (blends) its fragments of one pixel in one interval of the ray parameter t. */
typedef struct fold_part {
    float begin, end; /* range of the ray parameter in which this rank has all fragments of the pixel */
    fragment *out;    /* receives the blended fragments, and those that remain as they are */
    int64_t count;    /* number of fragments in `out` */
} fold_part;

/* Returns the ray parameter t at which a leaf of the tree begins. leaf: index of the leaf (fragment_find_leaf()). The
 * result is exact, because the divisor is a power of two. */
static double find_leaf_begin(int32_t leaf)
{
    return (double)leaf / (FRAGMENT_INTERVALS << FRAGMENT_HALVINGS);
}

static bool has_all_fragments_of_node(const fold_part *part, int32_t first_leaf, int height)
{
    return (double)part->begin <= find_leaf_begin(first_leaf) &&
           find_leaf_begin(first_leaf + (1 << height)) <= (double)part->end;
}

/* Appends the fragments in a node of the interval's binary tree to part->out. If this rank has all of the pixel's
 * fragments in a descendant of the node, the fragments in that descendant are first folded to one fragment. */
static void fold_node(fold_part *part, const fragment *sorted, int64_t count, int32_t first_leaf, int height)
{
    while (count > 1 && height > 0 && !has_all_fragments_of_node(part, first_leaf, height)) {
        const int32_t middle = first_leaf + (1 << --height);
        int64_t left = 0;
        while (left < count && fragment_find_leaf(sorted[left].t_in) < middle) left++;
        if (left) fold_node(part, sorted, left, first_leaf, height);
        sorted += left;
        count -= left;
        first_leaf = middle;
    }
    if (count > 1 && !has_all_fragments_of_node(part, first_leaf, height)) {
        for (int64_t i = 0; i < count; i++) part->out[part->count++] = sorted[i];
    } else if (count) {
        part->out[part->count++] = fragment_fold(sorted, count);
    }
}

int64_t fragment_fold_between(const fragment *sorted, int64_t count, float begin, float end, fragment *out)
{
    fold_part part = {begin, end, out, 0};
    const int32_t interval_number = fragment_interval_number(sorted[0].t_in);
    fold_node(&part, sorted, count, interval_number * (1 << FRAGMENT_HALVINGS), FRAGMENT_HALVINGS);
    return part.count;
}
