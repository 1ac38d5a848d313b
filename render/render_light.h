/* Computes shadows and ambient occlusion of hits: finds which of the rays that begin at a hit are blocked by opaque
 * surfaces, and computes the resulting colour. A ray is called open as long as no surface has been found that blocks
 * it.
 *
 * A frame painted RENDER_UNLIT is traced first. Each of its hits then has one ray towards each light that casts shadows
 * and that it faces, and a set of rays into the hemisphere above it. Each rank tests which of these rays its opaque
 * surfaces block; a ray stays open if those of no rank block it. Whether a cell blocks a ray depends on the ray and the
 * cell alone, so the picture does not depend on the partition. Transparent surfaces and volumes block nothing;
 * transparent surfaces are lit like opaque ones. A surface whose material is purely ambient is not lit by lights: it
 * gets its final colours in the first frame, and its hits have no rays.
 *
 * Where rays begin: a hit deviates from its surface by the rounding of its depth and of the numbers from which the
 * depth was computed, by at most 1e-6 in the space's scaled units (twice KERNEL_WEIGHT_ERROR, and t's own rounding).
 * Rays begin RENDER_LIFT scaled units above it, along the normal. So a ray does not meet the surface at its own hit.
 * Another surface that is closer to the hit than RENDER_LIFT is not seen by the rays. */
#ifndef RENDER_RENDER_LIGHT_H
#define RENDER_RENDER_LIGHT_H

#include "error.h"
#include "fragment.h"
#include "insitu/status.h"
#include "render.h"

enum { RENDER_MAX_SAMPLES = 64 };

/* Height above its surface at which a hit's rays begin, in scaled units, in which the size of a scene is about 1. */
#define RENDER_LIFT 4e-6

/* A hit on a surface, taken from an unlit fragment: its pixel, its ray parameter t, and its unit normal in octahedral
 * encoding (hit_normal()). */
typedef struct render_hit {
    uint32_t pixel;
    float t, normal[2];
} render_hit;

/* The open rays of a hit: those that no surface found so far blocks. samples: bit k stands for ray k into the
 * hemisphere; lights: bit i stands for the ray towards light i of the job. The bits of open rays are set. */
typedef struct render_hit_rays {
    uint64_t samples;
    uint32_t lights, unused;
} render_hit_rays;

/* Computes the hit of an unlit fragment of the job, and sets the bits in *rays of all rays that the hit has. Returns
 * false if the fragment needs no rays to be lit. */
bool render_make_hit_from_fragment(const render_job *job, const fragment *f, render_hit *hit, render_hit_rays *rays);

/* Computes the point at which the hit's rays begin, in scene units, and the unit directions of its rays into the
 * hemisphere. */
void render_compute_hemisphere_rays(const render_job *job, const render_hit *hit, double start[3],
                                    double directions[RENDER_MAX_SAMPLES][3]);

/* This rank's occluders: the cells that contain an opaque surface, which may block rays of the job's hits. */
typedef struct render_occluders render_occluders;

/* Collects the occluders once for all hits of a frame. Until they are freed, the job must not change, except for its
 * occlusion and camera. On success *out is NULL if there are no occluders. Local. */
insitu_status render_occluders_create(const render_job *job, render_occluders **out, base_error *error);
void render_occluders_free(render_occluders *occluders);

/* Clears the bits of the rays that this rank's opaque surfaces block. hits[i] has the rays rays[i]. occluders may be
 * NULL. Local; after an error the contents of `rays` are undefined. */
insitu_status render_clear_blocked_rays(const render_occluders *occluders, const render_hit *hits,
                                        render_hit_rays *rays, int64_t count, base_error *error);

/* Returns the bounding box of all cells of this rank that may block rays. */
render_box render_occluder_box(const render_job *job);

/* render_find_boxes_met_by_rays() calls take(state, i, rays) for each of the `count` boxes that open rays of the hit
 * may meet. i: index of the box; rays: those rays that may meet it. */
typedef void render_box_callback(void *state, int box, const render_hit_rays *rays);
void render_find_boxes_met_by_rays(const render_job *job, const render_hit *hit, const render_hit_rays *rays,
                                   const render_box *boxes, int count, render_box_callback *take, void *state);

/* Lights an unlit fragment, whose rays in *open no surface blocks. If all rays are open, the result is the fragment
 * that RENDER_LIGHT would have given. Fragments of volumes are left unchanged. */
void render_light_fragment(const render_job *job, const render_hit_rays *open, fragment *f);

#endif
