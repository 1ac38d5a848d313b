/* The kernels: this one file is compiled once per instruction set and exports one table (kernel_types.h). A tile of
 * pixels is cut into packets; each packet finds its surfaces first, so that volumes know where opaque ones end them. */
#include <math.h>

#include "kernel_segments.h"
#include "kernel_polyhedron_surface.h"
#include "kernel_polyhedron_volume.h"

/* A tree over meshes: its leaves name meshes, which are traversed in their turn. */
typedef struct kernel_parent_state {
    const render_field *field;
    const kernel_interest *interest;
    vf t_low;
    const vf *t_high;
    kernel_leaf *leaf;
    void *state;
} kernel_parent_state;

static void kernel_parent_leaf(kernel_packet *p, void *opaque_state, int unused, const uint32_t *parts, int count,
                               vm rays)
{
    const kernel_parent_state *s = opaque_state;
    (void)unused;
    for (int n = 0; n < count; n++) {
        const int part = (int)parts[n];
        if (!s->field->ranges[part].low) continue;
        kernel_traverse(p, p->frame->job->parts[part].tree, &s->field->ranges[part], s->interest, rays, s->t_low,
                        s->t_high, part, s->leaf, s->state);
    }
}

SIMD_INLINE void kernel_trace_parts(kernel_packet *p, const render_field *field, const kernel_interest *interest,
                                    vf t_low, const vf *t_high, kernel_leaf *leaf, void *state)
{
    const render_job *job = p->frame->job;
    if (job->parent) {
        kernel_parent_state parent = {field, interest, t_low, t_high, leaf, state};
        kernel_traverse(p, job->parent, NULL, NULL, p->active, t_low, t_high, 0, kernel_parent_leaf, &parent);
        return;
    }
    for (int part = 0; part < job->part_count; part++)
        if (field->ranges[part].low)
            kernel_traverse(p, job->parts[part].tree, &field->ranges[part], interest, p->active, t_low, t_high, part,
                            leaf, state);
}

static void trace_packet(const kernel_frame *f, const kernel_tile *tile, kernel_thread *thread, int x0, int y0)
{
    kernel_packet p;
    kernel_hits hits;
    const int64_t first_fragment = thread->out->count;
    kernel_packet_setup(&p, f, tile, thread, x0, y0);
    hits.found = vm_none();
    hits.cut_count = 0;
    hits.kind = hits.reach = vf_set(0);
    for (int a = 0; a < 3; a++) hits.normal[a] = hits.colour[a] = vf_set(0);
    if (f->surface_count) {
        const double start = thread->now();
        kernel_trace_surfaces(&p, &hits);
        kernel_emit_opaque(&p, &hits);
        thread->surface_seconds += thread->now() - start;
    }
    if (f->volume_count) {
        const double start = thread->now();
        if (f->has_segments && f->job->separate_samples)
            kernel_trace_apart(&p);
        else if (f->has_segments)
            kernel_trace_segments(&p, first_fragment);
        else
            kernel_trace_volumes(&p, &hits);
        thread->volume_seconds += thread->now() - start;
    }
}

/* Is one of the packet's pixels to be traced? */
static bool is_wanted(const render_job *job, int x0, int y0)
{
    const int x1 = x0 + KERNEL_PACKET_COLUMNS, y1 = y0 + KERNEL_PACKET_ROWS;
    if (!job->pixels) return true;
    for (int y = y0; y < y1 && y < job->camera.height; y++)
        for (int x = x0; x < x1 && x < job->camera.width; x++)
            if (pixel_set_has(job->pixels, (int64_t)y * job->camera.width + x)) return true;
    return false;
}

static void trace_tile(const kernel_frame *f, kernel_thread *thread, int x0, int y0)
{
    const render_camera *camera = &f->job->camera;
    kernel_tile tile;
    thread->serial++;
    kernel_tile_setup(&tile, f, x0, y0);
    for (int y = y0; y < y0 + KERNEL_TILE && y < camera->height; y += KERNEL_PACKET_ROWS)
        for (int x = x0; x < x0 + KERNEL_TILE && x < camera->width; x += KERNEL_PACKET_COLUMNS)
            if (is_wanted(f->job, x, y)) trace_packet(f, &tile, thread, x, y);
}

const kernel_table KERNEL_TABLE = {SIMD_WIDTH, sizeof(kernel_surface_cache), trace_tile};
