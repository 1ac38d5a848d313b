/* Rays for the tests of exactness, and the intervals of cells that the kernels find on them. The kernels' own headers
 * are compiled into chord_trace.c, once an instruction set as render_kernels.c is: rays are put into packets, packets
 * go down the tree, and every [t_in, t_out) that volumes and surfaces would get is recorded. */
#ifndef CHORD_TRACE_H
#define CHORD_TRACE_H

#include "kernel_types.h"

enum { CHORD_MAX_RAYS = 64, CHORD_MAX_INTERVALS = 160 };

typedef struct chord_interval {
    float t_in, t_out;
} chord_interval;

/* Rays of one tile. Where there are more spans than fit, span_count says so all the same. */
typedef struct chord_rays {
    int count;
    bool is_pencil;                              /* edges by their lines (kernel_cell.h), as tiles have them? */
    double centre_x, centre_y;                   /* the tile's middle in the image plane: slopes, or offsets */
    double x[CHORD_MAX_RAYS], y[CHORD_MAX_RAYS]; /* the rays */
    int interval_count[CHORD_MAX_RAYS];
    chord_interval ray_intervals[CHORD_MAX_RAYS][CHORD_MAX_INTERVALS]; /* in the order of the tree */
} chord_rays;

typedef struct chord_table {
    int width;
    size_t cells_bytes; /* of a thread's cells */
    void (*trace)(const kernel_frame *frame, kernel_thread *thread, chord_rays *rays);
} chord_table;

extern const chord_table chord_table_plain, chord_table_sse42, chord_table_avx2, chord_table_avx512;

#endif
