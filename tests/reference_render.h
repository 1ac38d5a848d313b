/* The brute-force renderer: it tests every ray against every cell, in double, without a tree. It draws a render_job as
 * the kernels do and tells for each ray how near it came to a decision that rounding could change. */
#ifndef REFERENCE_RENDER_H
#define REFERENCE_RENDER_H

#include "render.h"

typedef struct reference_hit {
    double depth;
    int surface;      /* counted over the values of all layers */
    double normal[3]; /* world, towards the eye */
    double colour[3]; /* shaded, not premultiplied */
    double opacity;
    double slowness; /* the cell's range of values over its size, by the field's slope along the ray; 0 where the normal
                        tells it */
    int part;
    int64_t cell;
    double conditioning; /* |gradient| / |its component along the ray|: how an error of position becomes one of depth */
} reference_hit;

enum { REFERENCE_MAX_HITS = 64 };

typedef struct reference_ray {
    int hit_count;                          /* up to the first opaque one */
    reference_hit hits[REFERENCE_MAX_HITS]; /* by depth */
    double volume_rgb[3];                   /* all samples in front of the first opaque hit, surfaces left out */
    double volume_transmittance;
    int64_t samples;
    double rgba[4]; /* the whole over the background */

    /* How near to another answer, in cell sizes (cube root of the cell's box) or of the range of the cell's values: */
    double edge_margin;   /* between the ray and an edge of a cell */
    double value_margin;  /* between a face's value and an isovalue */
    double sample_margin; /* between a sample and the cell interval's ends, or a hit and a sample */
    double eye_margin;    /* between a hit and the eye's plane */
    double light_margin;  /* between a hit's surface and the direction of a light; no length: a cosine */
    bool ambiguous;       /* the ray met a cell with more than one root, or one whose interpolant at a face is on the
                             other side of the isovalue than the face, so that the first hit depends on the root finder;
                             or a polyhedron's face whose bilinear map is folded there */
    bool map_failed;      /* an inverse map had no solution */
} reference_ray;

typedef struct reference_scene reference_scene;

/* job is borrowed. */
reference_scene *reference_create(const render_job *job);
void reference_free(reference_scene *scene);

/* For the ray of pixel (x, y) in a hit's cell: field at depth - isovalue, its derivative by depth and its gradient
 * (world; may be NULL), all relative to the range of the cell's values. */
double reference_residual(const reference_scene *scene, int x, int y, const reference_hit *hit, double depth,
                          double *slope, double gradient[3]);

void reference_trace(const reference_scene *scene, int x, int y, const float background[4], reference_ray *out);

#endif
