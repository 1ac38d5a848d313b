/* The brute-force renderer: it tests every ray against every cell, in double, without a tree. It draws a render_job as
 * the kernels do. For each ray it also returns margins: how near the ray is to a decision that rounding could
 * change. */
#ifndef REFERENCE_RENDER_H
#define REFERENCE_RENDER_H

#include "render.h"

typedef struct reference_hit {
    double depth;
    int surface;      /* index of the isovalue, counted over the values of all layers */
    double normal[3]; /* in world coordinates, towards the eye */
    double colour[3]; /* shaded, not premultiplied */
    double opacity;
    /* range of the cell's values divided by the cell's size and by the field's slope along the ray; 0 if the slope
     * follows from the normal */
    double slowness;
    int part;
    int64_t cell;
    /* |gradient| / |component of the gradient along the ray|: the ratio of an error of depth to an error of position */
    double conditioning;
} reference_hit;

enum { REFERENCE_MAX_HITS = 64 };

typedef struct reference_ray {
    int hit_count;                          /* number of hits up to and including the first opaque one */
    reference_hit hits[REFERENCE_MAX_HITS]; /* sorted by depth */
    /* colour of all samples in front of the first opaque hit, without surfaces */
    double volume_rgb[3];
    double volume_transmittance;
    int64_t samples;
    double rgba[4]; /* colour of the ray blended over the background */

    /* Margins: distances from this ray to a ray with a different result, in units of the cell's size (cube root of the
     * volume of the cell's box) or of the range of the cell's values. */
    double edge_margin;   /* between the ray and an edge of a cell */
    double value_margin;  /* between a face's value and an isovalue */
    double sample_margin; /* between a sample and an end of the cell's interval, or between a hit and a sample */
    double eye_margin;    /* between a hit and the eye's plane */
    double light_margin;  /* between a hit's surface and the direction of a light, as a cosine */
    /* Whether the first hit depends on the root finder, or a face of a polyhedron is folded. The ray met a cell with
     * more than one root; or a cell whose interpolant at a face is on another side of the isovalue than the face's
     * value; or a polyhedron's face whose bilinear map is folded there. */
    bool ambiguous;
    bool map_failed; /* whether the inverse map had no solution */
} reference_ray;

typedef struct reference_scene reference_scene;

/* Creates the renderer of a job. The job is borrowed. */
reference_scene *reference_create(const render_job *job);
void reference_free(reference_scene *scene);

/* Evaluates the field at a depth on the ray of pixel (x, y), in the cell of a hit. Returns the field minus the
 * isovalue; slope receives its derivative with respect to depth, and gradient its gradient in world coordinates (may be
 * NULL). All three are relative to the range of the cell's values. */
double reference_compute_residual(const reference_scene *scene, int x, int y, const reference_hit *hit, double depth,
                                  double *slope, double gradient[3]);

void reference_trace(const reference_scene *scene, int x, int y, const float background[4], reference_ray *out);

#endif
