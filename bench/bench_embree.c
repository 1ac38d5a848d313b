/* Uses Embree as its documentation recommends for the highest speed: static scenes of one geometry, coherent packets of
 * 16 rays, and nodes from the builder's thread-local allocators. Embree gets as many threads as libinsitu. */
#include "bench_embree.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <embree3/rtcore.h>
#include <omp.h>

#include "bench_stats.h"

struct bench_embree {
    RTCDevice device;
    RTCScene scene;
    int threads;
    uint32_t *iota; /* indices of triangles that share no vertices: 0, 1, 2, ... */
    int64_t iota_count;
    struct RTCBuildPrimitive *boxes, *sorted; /* cell_count each: the cells' boxes, and a copy that the builder sorts */
    int64_t cell_count;
    RTCBVH bvh;
    void *root;
};

enum { WIDE = 8, PACKET = 4 };

/* A node. If child_count is 0, the node is a leaf of cell_count cells, and its parent stores its box. */
typedef struct tree_node {
    uint32_t child_count, cell_count;
} tree_node;

typedef struct inner_node {
    tree_node head;
    struct RTCBounds bounds[2];
    tree_node *children[2];
} inner_node;

typedef struct wide_node {
    tree_node head;
    struct RTCBounds bounds[WIDE];
    tree_node *children[WIDE];
} wide_node;

typedef struct leaf_node {
    tree_node head;
    uint32_t cells[];
} leaf_node;

static void *require_memory(void *p)
{
    if (!p) abort();
    return p;
}

static void print_embree_error(void *user, enum RTCError code, const char *text)
{
    (void)user;
    fprintf(stderr, "embree: error %d: %s\n", (int)code, text);
    exit(1);
}

bool bench_embree_is_available(void)
{
    return true;
}

bench_embree *bench_embree_create(int threads)
{
    char options[64];
    bench_embree *e = require_memory(calloc(1, sizeof *e));
    snprintf(options, sizeof options, "threads=%d", threads);
    e->device = require_memory(rtcNewDevice(options));
    e->threads = threads;
    rtcSetDeviceErrorFunction(e->device, print_embree_error, NULL);
    return e;
}

void bench_embree_destroy(bench_embree *e)
{
    if (!e) return;
    if (e->scene) rtcReleaseScene(e->scene);
    if (e->bvh) rtcReleaseBVH(e->bvh);
    rtcReleaseDevice(e->device);
    free(e->iota);
    free(e->boxes);
    free(e->sorted);
    free(e);
}

static void grow_iota(bench_embree *e, int64_t count)
{
    if (count <= e->iota_count) return;
    e->iota = require_memory(realloc(e->iota, (size_t)count * sizeof *e->iota));
    for (int64_t i = e->iota_count; i < count; i++) e->iota[i] = (uint32_t)i;
    e->iota_count = count;
}

void bench_embree_build(bench_embree *e, const float *xyz, int64_t triangle_count, bool is_fast)
{
    const enum RTCBuildQuality quality = is_fast ? RTC_BUILD_QUALITY_LOW : RTC_BUILD_QUALITY_MEDIUM;
    const size_t triangles = (size_t)triangle_count;
    if (e->scene) rtcReleaseScene(e->scene);
    grow_iota(e, 3 * triangle_count);
    RTCGeometry geometry = rtcNewGeometry(e->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, xyz, 0, 12, 3 * triangles);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, e->iota, 0, 12, triangles);
    rtcSetGeometryBuildQuality(geometry, quality);
    rtcCommitGeometry(geometry);
    e->scene = rtcNewScene(e->device);
    rtcSetSceneBuildQuality(e->scene, quality);
    rtcAttachGeometry(e->scene, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(e->scene);
}

/* The camera's rays in float32. The direction of a pixel is first + x right + y down; its length along the camera's
 * axis is 1, so that t is the depth. */
typedef struct pinhole {
    float eye[3], first[3], right[3], down[3];
    int width, height;
} pinhole;

static pinhole make_pinhole(const render_camera *c)
{
    pinhole p = {.width = c->width, .height = c->height};
    double base[3], corner[3], beside[3], below[3];
    render_camera_ray(c, 0, 0, base, corner);
    render_camera_ray(c, 1, 0, base, beside);
    render_camera_ray(c, 0, 1, base, below);
    for (int axis = 0; axis < 3; axis++) {
        p.eye[axis] = (float)c->eye[axis];
        p.first[axis] = (float)corner[axis];
        p.right[axis] = (float)(beside[axis] - corner[axis]);
        p.down[axis] = (float)(below[axis] - corner[axis]);
    }
    return p;
}

/* Makes the rays of 4 × 4 pixels. It is compiled for each instruction set, so that it takes little time compared with
 * tracing the rays. */
__attribute__((target_clones("avx512f", "avx2", "default"))) static void
make_packet(const pinhole *p, int x0, int y0, struct RTCRayHit16 *packet, int *valid)
{
    struct RTCRay16 *ray = &packet->ray;
    for (int i = 0; i < 16; i++) {
        const int x = x0 + (i & 3), y = y0 + (i >> 2);
        valid[i] = x < p->width && y < p->height ? -1 : 0;
        ray->org_x[i] = p->eye[0];
        ray->org_y[i] = p->eye[1];
        ray->org_z[i] = p->eye[2];
        ray->dir_x[i] = p->first[0] + (float)x * p->right[0] + (float)y * p->down[0];
        ray->dir_y[i] = p->first[1] + (float)x * p->right[1] + (float)y * p->down[1];
        ray->dir_z[i] = p->first[2] + (float)x * p->right[2] + (float)y * p->down[2];
        ray->tnear[i] = 0;
        ray->tfar[i] = INFINITY;
        ray->time[i] = 0;
        ray->mask[i] = 0xffffffffu;
        ray->id[i] = 0;
        ray->flags[i] = 0;
        packet->hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
        packet->hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
}

static void store_packet(const pinhole *p, int x0, int y0, const struct RTCRayHit16 *packet, const int *valid,
                         float *depths, float *normals)
{
    for (int i = 0; i < 16; i++) {
        if (!valid[i]) continue;
        const int64_t pixel = (int64_t)(y0 + (i >> 2)) * p->width + x0 + (i & 3);
        const bool is_hit = packet->hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
        depths[pixel] = is_hit ? packet->ray.tfar[i] : INFINITY;
        normals[3 * pixel] = is_hit ? packet->hit.Ng_x[i] : 0;
        normals[3 * pixel + 1] = is_hit ? packet->hit.Ng_y[i] : 0;
        normals[3 * pixel + 2] = is_hit ? packet->hit.Ng_z[i] : 0;
    }
}

void bench_embree_trace(bench_embree *e, const render_camera *camera, float *depths, float *normals)
{
    const pinhole p = make_pinhole(camera);
    const int columns = (p.width + PACKET - 1) / PACKET, rows = (p.height + PACKET - 1) / PACKET;
#pragma omp parallel for schedule(dynamic, 4) num_threads(e->threads)
    for (int row = 0; row < rows; row++)
        for (int column = 0; column < columns; column++) {
            struct RTCRayHit16 packet;
            struct RTCIntersectContext context;
            _Alignas(64) int valid[16];
            rtcInitIntersectContext(&context);
            context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
            make_packet(&p, PACKET * column, PACKET * row, &packet, valid);
            rtcIntersect16(valid, e->scene, &context, &packet);
            store_packet(&p, PACKET * column, PACKET * row, &packet, valid, depths, normals);
        }
}

static void occlude_packet(bench_embree *e, const bench_embree_ray *rays, int count, bool *blocked)
{
    struct RTCRay16 packet;
    struct RTCIntersectContext context;
    _Alignas(64) int valid[16];
    rtcInitIntersectContext(&context);
    for (int i = 0; i < 16; i++) {
        const bench_embree_ray *ray = &rays[i < count ? i : 0];
        valid[i] = i < count ? -1 : 0;
        packet.org_x[i] = ray->origin[0];
        packet.org_y[i] = ray->origin[1];
        packet.org_z[i] = ray->origin[2];
        packet.dir_x[i] = ray->direction[0];
        packet.dir_y[i] = ray->direction[1];
        packet.dir_z[i] = ray->direction[2];
        packet.tnear[i] = 0;
        packet.tfar[i] = ray->far;
        packet.time[i] = 0;
        packet.mask[i] = 0xffffffffu;
        packet.id[i] = 0;
        packet.flags[i] = 0;
    }
    rtcOccluded16(valid, e->scene, &context, &packet);
    for (int i = 0; i < count; i++) blocked[i] = packet.tfar[i] < 0;
}

void bench_embree_occlude(bench_embree *e, const bench_embree_ray *rays, int64_t count, bool *blocked)
{
#pragma omp parallel for schedule(dynamic, 64) num_threads(e->threads)
    for (int64_t first = 0; first < count; first += 16)
        occlude_packet(e, rays + first, (int)(count - first < 16 ? count - first : 16), blocked + first);
}

/* ---- the builder for cells ---- */

static struct RTCBuildPrimitive compute_cell_box(const grid *cells, int64_t cell)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    grid_walk walk = grid_walk_cell(cells, cell);
    int64_t vertex;
    while (grid_walk_next(&walk, &vertex)) {
        double p[3];
        grid_read_vertex_position(cells, vertex, p);
        for (int axis = 0; axis < 3; axis++) {
            low[axis] = fmin(low[axis], p[axis]);
            high[axis] = fmax(high[axis], p[axis]);
        }
    }
    return (struct RTCBuildPrimitive){.lower_x = (float)low[0],
                                      .lower_y = (float)low[1],
                                      .lower_z = (float)low[2],
                                      .upper_x = (float)high[0],
                                      .upper_y = (float)high[1],
                                      .upper_z = (float)high[2],
                                      .primID = (unsigned)cell};
}

void bench_embree_set_cells(bench_embree *e, const grid *cells)
{
    const size_t bytes = (size_t)cells->cell_count * sizeof *e->boxes;
    e->cell_count = cells->cell_count;
    e->boxes = require_memory(aligned_alloc(32, bytes));
    e->sorted = require_memory(aligned_alloc(32, bytes));
#pragma omp parallel for schedule(static)
    for (int64_t cell = 0; cell < cells->cell_count; cell++) e->boxes[cell] = compute_cell_box(cells, cell);
    e->bvh = require_memory(rtcNewBVH(e->device));
}

static void *create_inner(RTCThreadLocalAllocator allocator, unsigned count, void *user)
{
    inner_node *node = rtcThreadLocalAlloc(allocator, sizeof *node, 16);
    (void)user;
    node->head = (tree_node){count, 0};
    return node;
}

static void *create_wide(RTCThreadLocalAllocator allocator, unsigned count, void *user)
{
    wide_node *node = rtcThreadLocalAlloc(allocator, sizeof *node, 16);
    (void)user;
    node->head = (tree_node){count, 0};
    return node;
}

static void set_inner_children(void *node, void **children, unsigned count, void *user)
{
    (void)user;
    for (unsigned i = 0; i < count; i++) ((inner_node *)node)->children[i] = children[i];
}

static void set_wide_children(void *node, void **children, unsigned count, void *user)
{
    (void)user;
    for (unsigned i = 0; i < count; i++) ((wide_node *)node)->children[i] = children[i];
}

static void set_inner_bounds(void *node, const struct RTCBounds **bounds, unsigned count, void *user)
{
    (void)user;
    for (unsigned i = 0; i < count; i++) ((inner_node *)node)->bounds[i] = *bounds[i];
}

static void set_wide_bounds(void *node, const struct RTCBounds **bounds, unsigned count, void *user)
{
    (void)user;
    for (unsigned i = 0; i < count; i++) ((wide_node *)node)->bounds[i] = *bounds[i];
}

static void *create_leaf(RTCThreadLocalAllocator allocator, const struct RTCBuildPrimitive *boxes, size_t count,
                         void *user)
{
    leaf_node *leaf = rtcThreadLocalAlloc(allocator, sizeof *leaf + count * sizeof *leaf->cells, 16);
    (void)user;
    leaf->head = (tree_node){0, (uint32_t)count};
    for (size_t i = 0; i < count; i++) leaf->cells[i] = boxes[i].primID;
    return leaf;
}

double bench_embree_build_cells(bench_embree *e, bench_embree_builder builder)
{
    const bool is_wide = builder == BENCH_EMBREE_MEDIUM_WIDE;
    struct RTCBuildArguments arguments = rtcDefaultBuildArguments();
    memcpy(e->sorted, e->boxes, (size_t)e->cell_count * sizeof *e->boxes);
    arguments.buildQuality = builder == BENCH_EMBREE_LOW ? RTC_BUILD_QUALITY_LOW : RTC_BUILD_QUALITY_MEDIUM;
    arguments.maxBranchingFactor = is_wide ? WIDE : 2;
    arguments.maxDepth = 1024;
    arguments.maxLeafSize = is_wide ? 8 : 7;
    arguments.bvh = e->bvh;
    arguments.primitives = e->sorted;
    arguments.primitiveCount = arguments.primitiveArrayCapacity = (size_t)e->cell_count;
    arguments.createNode = is_wide ? create_wide : create_inner;
    arguments.setNodeChildren = is_wide ? set_wide_children : set_inner_children;
    arguments.setNodeBounds = is_wide ? set_wide_bounds : set_inner_bounds;
    arguments.createLeaf = create_leaf;
    const double began = bench_read_clock();
    e->root = require_memory(rtcBuildBVH(&arguments));
    return bench_read_clock() - began;
}

static double compute_half_area(const struct RTCBounds *b)
{
    const double x = (double)b->upper_x - (double)b->lower_x, y = (double)b->upper_y - (double)b->lower_y;
    const double z = (double)b->upper_z - (double)b->lower_z;
    return x * y + y * z + z * x;
}

static struct RTCBounds unite_bounds(const struct RTCBounds *a, const struct RTCBounds *b)
{
    return (struct RTCBounds){.lower_x = fminf(a->lower_x, b->lower_x),
                              .lower_y = fminf(a->lower_y, b->lower_y),
                              .lower_z = fminf(a->lower_z, b->lower_z),
                              .upper_x = fmaxf(a->upper_x, b->upper_x),
                              .upper_y = fmaxf(a->upper_y, b->upper_y),
                              .upper_z = fmaxf(a->upper_z, b->upper_z)};
}

/* Returns the number of tests below a node, each weighted by the half area of its node. `area` is the half area of this
 * node. An inner node tests two boxes, and a leaf tests its cells. */
static double compute_subtree_cost(const tree_node *node, double area)
{
    if (!node->child_count) return area * node->cell_count;
    const inner_node *inner = (const inner_node *)node;
    double sum = 2 * area;
    for (int i = 0; i < 2; i++) sum += compute_subtree_cost(inner->children[i], compute_half_area(&inner->bounds[i]));
    return sum;
}

double bench_embree_compute_cost(const bench_embree *e)
{
    const inner_node *root = e->root;
    if (!root->head.child_count) return 1 + (double)root->head.cell_count;
    const struct RTCBounds all = unite_bounds(&root->bounds[0], &root->bounds[1]);
    return 1 + compute_subtree_cost(&root->head, compute_half_area(&all)) / compute_half_area(&all);
}
