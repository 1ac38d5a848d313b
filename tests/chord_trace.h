/* Rays for the tests of exactness, and the intervals of cells that the kernels find on them. chord_trace.c includes the
 * kernels' own headers and is compiled once for each instruction set, as render_kernels.c is. It puts rays into
 * packets, sends packets down the tree, and records every [t_in, t_out) that volumes and surfaces would get. */
#ifndef CHORD_TRACE_H
#define CHORD_TRACE_H

#include "kernel_types.h"

enum { CHORD_MAX_RAYS = 64, CHORD_MAX_INTERVALS = 160 };

typedef struct chord_interval {
    float t_in, t_out;
} chord_interval;

/* Rays of one tile. span_count counts all spans, including those that do not fit. */
typedef struct chord_rays {
    int count;
    /* whether rays cross edges by the edges' lines (kernel_cell.h), as in tiles */
    bool is_pencil;
    double centre_x, centre_y;                   /* the tile's middle in the image plane, as slopes or offsets */
    double x[CHORD_MAX_RAYS], y[CHORD_MAX_RAYS]; /* the rays' positions in the image plane */
    int interval_count[CHORD_MAX_RAYS];
    /* the intervals of each ray, in the order of the tree */
    chord_interval ray_intervals[CHORD_MAX_RAYS][CHORD_MAX_INTERVALS];
} chord_rays;

typedef struct chord_table {
    int width;
    size_t cells_bytes; /* size of a thread's memory for cells */
    void (*trace)(const kernel_frame *frame, kernel_thread *thread, chord_rays *rays);
} chord_table;

extern const chord_table chord_table_plain, chord_table_sse42, chord_table_avx2, chord_table_avx512;

#endif
