/* Traces chosen rays with the kernels and records the intervals of cells on them, for the tests of exact intervals.
 * chord_trace.c includes the kernels' own headers and is compiled once for each instruction set, like render_kernels.c.
 * It packs rays into packets, traverses the tree with each packet, and records every interval [t_in, t_out) that the
 * kernels would pass to volumes and surfaces. */
#ifndef CHORD_TRACE_H
#define CHORD_TRACE_H

#include "kernel_types.h"

enum { CHORD_MAX_RAYS = 64, CHORD_MAX_INTERVALS = 160 };

typedef struct chord_interval {
    float t_in, t_out;
} chord_interval;

/* Rays of one tile. interval_count counts all intervals of a ray, including those that do not fit into
 * ray_intervals. */
typedef struct chord_rays {
    int count;
    /* whether edge functions are evaluated as affine functions in the image plane, as for the primary rays of a tile
     * (kernel_crossings.h); else they are computed from projected vertices */
    bool is_pencil;
    /* position of the tile's middle in the image plane: slopes (perspective) or offsets (orthographic) */
    double centre_x, centre_y;
    double x[CHORD_MAX_RAYS], y[CHORD_MAX_RAYS]; /* positions of the rays in the image plane */
    int interval_count[CHORD_MAX_RAYS];
    /* intervals of each ray, in the order in which the tree's cells are visited */
    chord_interval ray_intervals[CHORD_MAX_RAYS][CHORD_MAX_INTERVALS];
} chord_rays;

typedef struct chord_table {
    int width;
    size_t cells_bytes; /* size of the memory for cells that each thread needs */
    void (*trace)(const kernel_frame *frame, kernel_thread *thread, chord_rays *rays);
} chord_table;

extern const chord_table chord_table_plain, chord_table_sse42, chord_table_avx2, chord_table_avx512;

#endif
