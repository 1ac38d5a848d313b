/* The brute-force renderer: it tests every ray against every cell, in double, without a tree. It draws a render_job as
 * the kernels do and reports for each ray how near it came to a decision that rounding could change. */
#ifndef REFERENCE_RENDER_H
#define REFERENCE_RENDER_H

#include "render.h"

typedef struct reference_hit {
    double depth;
    int surface;      /* index of the isovalue, counted over the values of all layers */
    double normal[3]; /* in world coordinates, towards the eye */
    double colour[3]; /* shaded, not premultiplied */
    double opacity;
    /* the cell's range of values over its size, divided by the field's slope along the ray; 0 if the normal gives it */
    double slowness;
    int part;
    int64_t cell;
    /* |gradient| / |component of the gradient along the ray|: the ratio of an error of depth to an error of position */
    double conditioning;
} reference_hit;

enum { REFERENCE_MAX_HITS = 64 };

typedef struct reference_ray {
    int hit_count;                          /* hits up to and including the first opaque one */
    reference_hit hits[REFERENCE_MAX_HITS]; /* sorted by depth */
    double volume_rgb[3];                   /* all samples in front of the first opaque hit, without surfaces */
    double volume_transmittance;
    int64_t samples;
    double rgba[4]; /* the blended ray over the background */

    /* Distances to a different result, in cell sizes (cube root of the volume of the cell's box) or in ranges of the
     * cell's values: */
    double edge_margin;   /* between the ray and an edge of a cell */
    double value_margin;  /* between a face's value and an isovalue */
    double sample_margin; /* between a sample and the cell interval's ends, or a hit and a sample */
    double eye_margin;    /* between a hit and the eye's plane */
    double light_margin;  /* between a hit's surface and the direction of a light, as a cosine */
    /* the ray met a cell with more than one root, or one whose interpolant at a face is on the other side of the
     * isovalue than the face's value, so that the first hit depends on the root finder; or it met a polyhedron's face
     * whose bilinear map is folded there */
    bool ambiguous;
    bool map_failed; /* the inverse map had no solution */
} reference_ray;

typedef struct reference_scene reference_scene;

/* Creates the renderer of a job, which is borrowed. */
reference_scene *reference_create(const render_job *job);
void reference_free(reference_scene *scene);

/* Computes, for the ray of pixel (x, y) in a hit's cell, the field at depth minus the isovalue, its derivative by depth
 * and its gradient (world coordinates; may be NULL), all relative to the range of the cell's values. */
double reference_residual(const reference_scene *scene, int x, int y, const reference_hit *hit, double depth,
                          double *slope, double gradient[3]);

void reference_trace(const reference_scene *scene, int x, int y, const float background[4], reference_ray *out);

#endif
