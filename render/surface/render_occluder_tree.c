/* Builds a tree whose nodes have one child per lane. mmbvh first builds a binary tree over the boxes of the pieces
 * (triangles or slabs). Then nodes are merged: the child with the largest surface area is repeatedly replaced by its
 * two children, until the node has as many children as there are lanes, or all of them fit into leaves. A leaf of the
 * binary tree that has more pieces than there are lanes is divided. */
#include "render_occluder_tree.h"

#include <math.h>
#include <string.h>

#include "memory.h"
#include "mmbvh.h"
#include "region.h"

enum { MOST_LANES = 16 };

/* The state of the conversion of a binary tree to a tree with one child per lane. */
typedef struct widening {
    const occluder_piece *pieces;
    int64_t piece_count;
    int rows; /* number of floats that are stored for a piece, one in each row of a leaf */
    const mmbvh *binary;
    /* for each node of the binary tree, the pieces below it: index of the first in binary->cells, and their number */
    int64_t *first, *count;
    float *boxes; /* for each node of the binary tree, 6 numbers: lower and upper corner of its box */
    int width;
    kernel_occluder_tree *out;
} widening;

/* Computes the bounding box of the piece with index i. */
static void compute_piece_box(const widening *w, int64_t i, float *lower, float *upper)
{
    const float *rows = w->pieces[i].rows;
    for (int a = 0; a < 3; a++) {
        const bool is_slab = w->rows == KERNEL_SLAB_ROWS;
        lower[a] = is_slab ? rows[KERNEL_SLAB_LOWER + a] : fminf(fminf(rows[a], rows[3 + a]), rows[6 + a]);
        upper[a] = is_slab ? rows[KERNEL_SLAB_UPPER + a] : fmaxf(fmaxf(rows[a], rows[3 + a]), rows[6 + a]);
    }
}

static void grow_box(float box[6], const float *lower, const float *upper)
{
    for (int a = 0; a < 3; a++) {
        box[a] = fminf(box[a], lower[a]);
        box[3 + a] = fmaxf(box[3 + a], upper[a]);
    }
}

/* Computes, for all nodes of the binary tree, their boxes and the pieces below them. It goes from the last node to the
 * first, because children have larger indices than their parents. */
static void compute_node_boxes(widening *w)
{
    for (int64_t node = w->binary->node_count - 1; node >= 0; node--) {
        const int64_t ref = mmbvh_node_ref(w->binary, node), count = mmbvh_node_count(w->binary, node);
        float *box = w->boxes + 6 * node, lower[3], upper[3];
        for (int a = 0; a < 3; a++) box[a] = INFINITY, box[3 + a] = -INFINITY;
        w->first[node] = count ? ref : w->first[ref];
        w->count[node] = count ? count : w->count[ref] + w->count[ref + 1];
        for (int64_t n = 0; n < count; n++) {
            compute_piece_box(w, w->binary->cells[ref + n], lower, upper);
            grow_box(box, lower, upper);
        }
        for (int64_t n = 0; n < (count ? 0 : 2); n++)
            grow_box(box, w->boxes + 6 * (ref + n), w->boxes + 6 * (ref + n) + 3);
    }
}

static float compute_half_box_area(const float box[6])
{
    const float x = box[3] - box[0], y = box[4] - box[1], z = box[5] - box[2];
    return x * y + y * z + z * x;
}

/* A range of the list of pieces in the binary tree's order: all pieces below a node, or a part of a leaf's pieces. */
typedef struct piece_range {
    int64_t node; /* index of the node; -1 if the range is a part of a leaf's pieces */
    int64_t first, count;
    float box[6];
} piece_range;

static piece_range node_range(const widening *w, int64_t node)
{
    piece_range out = {node, w->first[node], w->count[node], {0}};
    memcpy(out.box, w->boxes + 6 * node, sizeof out.box);
    return out;
}

static piece_range make_range_of_leaf_pieces(const widening *w, int64_t first, int64_t count)
{
    piece_range out = {-1, first, count, {INFINITY, INFINITY, INFINITY, -INFINITY, -INFINITY, -INFINITY}};
    float lower[3], upper[3];
    for (int64_t n = 0; n < count; n++) {
        compute_piece_box(w, w->binary->cells[first + n], lower, upper);
        grow_box(out.box, lower, upper);
    }
    return out;
}

/* Divides a range into two: an inner node's range into those of its children, and the pieces of a leaf or of a part of
 * a leaf into halves. The range must have more pieces than there are lanes. */
static void divide_piece_range(const widening *w, const piece_range *whole, piece_range out[2])
{
    const int64_t half = whole->count / 2;
    if (whole->node >= 0 && !mmbvh_node_count(w->binary, whole->node)) {
        for (int n = 0; n < 2; n++) out[n] = node_range(w, mmbvh_node_ref(w->binary, whole->node) + n);
        return;
    }
    const piece_range both[2] = {make_range_of_leaf_pieces(w, whole->first, half),
                                 make_range_of_leaf_pieces(w, whole->first + half, whole->count - half)};
    memcpy(out, both, sizeof both);
}

/* Divides the range `whole` into the ranges of a node's children: the range with the largest box is divided repeatedly,
 * until there are as many ranges as lanes, or each fits into a leaf. Returns the number of ranges. */
static int divide_range_among_children(const widening *w, const piece_range *whole, piece_range *out)
{
    int count = 1;
    out[0] = *whole;
    while (count < w->width) {
        int largest = -1;
        for (int i = 0; i < count; i++)
            if (out[i].count > w->width &&
                (largest < 0 || compute_half_box_area(out[i].box) > compute_half_box_area(out[largest].box)))
                largest = i;
        if (largest < 0) break;
        piece_range halves[2];
        divide_piece_range(w, &out[largest], halves);
        out[largest] = halves[0];
        out[count++] = halves[1];
    }
    return count;
}

/* Creates a leaf of the pieces in a range, and returns the bitwise complement of its index (~index), which
 * distinguishes leaves from nodes. Lanes without a piece get triangles of NaN or empty boxes, so that no ray meets
 * them. */
static int32_t make_leaf(widening *w, const piece_range *of)
{
    const int32_t leaf = w->out->leaf_count++;
    const int rows = w->rows, width = w->width;
    float *to = w->out->leaves + (int64_t)leaf * rows * width;
    int32_t *sources = w->out->sources + (int64_t)leaf * width;
    for (int64_t i = 0; i < width; i++) {
        const bool is_there = i < of->count;
        const int64_t piece = w->binary->cells[of->first + (is_there ? i : 0)];
        const float *from = w->pieces[piece].rows;
        sources[i] = is_there ? (int32_t)piece : -1;
        for (int row = 0; row < rows; row++) to[row * width + i] = is_there ? from[row] : NAN;
        for (int row = 0; !is_there && rows == KERNEL_SLAB_ROWS && row < 6; row++)
            to[row * width + i] = row < 3 ? INFINITY : -INFINITY;
    }
    return ~leaf;
}

/* Creates a node for a range of pieces, and all nodes and leaves below it. Returns its index. */
static int32_t make_node(widening *w, const piece_range *of)
{
    piece_range children[MOST_LANES];
    const int32_t node = w->out->node_count++;
    const int count = divide_range_among_children(w, of, children), width = w->width;
    float *boxes = w->out->boxes + (int64_t)node * 6 * width;
    int32_t *links = w->out->children + (int64_t)node * width;
    for (int i = 0; i < width; i++)
        for (int row = 0; row < 6; row++)
            boxes[row * width + i] = i < count ? children[i].box[row] : row < 3 ? INFINITY : -INFINITY;
    for (int i = 0; i < width; i++)
        links[i] = i >= count                      ? 0
                   : children[i].count <= w->width ? make_leaf(w, &children[i])
                                                   : make_node(w, &children[i]);
    return node;
}

/* Reserves address space for the largest wide tree that the binary tree can become; pages that stay unused take no
 * memory. */
static bool reserve(const widening *w, size_t nodes, size_t leaves)
{
    const size_t width = (size_t)w->width;
    w->out->boxes = base_reserve(nodes * 6 * width * sizeof(float));
    w->out->children = base_reserve(nodes * width * sizeof(int32_t));
    w->out->leaves = base_reserve(leaves * (size_t)w->rows * width * sizeof(float));
    w->out->sources = base_reserve(leaves * width * sizeof(int32_t));
    return w->out->boxes && w->out->children && w->out->leaves && w->out->sources;
}

static void count_used_bytes(const widening *w)
{
    const size_t width = (size_t)w->width, nodes = (size_t)w->out->node_count, leaves = (size_t)w->out->leaf_count;
    base_set_used_bytes(w->out->boxes, nodes * 6 * width * sizeof(float));
    base_set_used_bytes(w->out->children, nodes * width * sizeof(int32_t));
    base_set_used_bytes(w->out->leaves, leaves * (size_t)w->rows * width * sizeof(float));
    base_set_used_bytes(w->out->sources, leaves * width * sizeof(int32_t));
}

static bool build_wide_tree(widening *w)
{
    const size_t nodes = (size_t)w->binary->node_count;
    w->first = base_alloc(nodes * sizeof *w->first);
    w->count = base_alloc(nodes * sizeof *w->count);
    w->boxes = base_alloc(nodes * 6 * sizeof *w->boxes);
    const bool is_well = w->first && w->count && w->boxes && reserve(w, nodes, nodes + 1);
    if (is_well) {
        compute_node_boxes(w);
        const piece_range all = node_range(w, 0);
        make_node(w, &all);
        count_used_bytes(w);
        for (int k = 0; k < 6; k++) w->out->size = fmaxf(w->out->size, fabsf(w->boxes[k]));
    }
    base_free(w->first);
    base_free(w->count);
    base_free(w->boxes);
    return is_well;
}

static insitu_status build_binary_tree(const widening *w, int threads, mmbvh *out, base_error *error)
{
    const int64_t count = w->piece_count;
    const size_t bytes = (size_t)count * 3 * sizeof(float);
    float *lower = base_alloc(bytes), *upper = base_alloc(bytes),
          *ranges = base_calloc((size_t)count * 2, sizeof(float));
    const mmbvh_options options = {.threads = threads, .layout = MMBVH_REFERENCE, .builder = MMBVH_SAH};
    insitu_status status = INSITU_OK;
    if (!lower || !upper || !ranges) {
        status = base_fail(error, INSITU_ERROR_MEMORY, "no memory for the boxes of %lld pieces of surfaces",
                           (long long)count);
    } else {
#pragma omp parallel num_threads(threads)
        {
            region_enter();
#pragma omp for schedule(static) nowait
            for (int64_t i = 0; i < count; i++) compute_piece_box(w, i, lower + 3 * i, upper + 3 * i);
            region_leave();
        }
        status = mmbvh_build_boxes(lower, upper, ranges, count, &options, out, error);
    }
    base_free(lower);
    base_free(upper);
    base_free(ranges);
    return status;
}

insitu_status occluder_tree_build(const occluder_piece *pieces, int64_t count, int rows, int width, int threads,
                                  kernel_occluder_tree *out, base_error *error)
{
    mmbvh binary = {0};
    widening w = {.pieces = pieces, .piece_count = count, .rows = rows, .binary = &binary, .width = width, .out = out};
    if (!count) return INSITU_OK;
    insitu_status status = build_binary_tree(&w, threads, &binary, error);
    if (!status && !build_wide_tree(&w))
        status =
            base_fail(error, INSITU_ERROR_MEMORY, "no memory for a tree of %lld pieces of surfaces", (long long)count);
    mmbvh_free(&binary);
    return status;
}

void occluder_tree_free(kernel_occluder_tree *tree)
{
    base_free(tree->boxes);
    base_free(tree->children);
    base_free(tree->leaves);
    base_free(tree->sources);
}
