/* Shadows and ambient occlusion of hits: which of a hit's rays are open, and what colour that makes it.
 *
 * A frame painted RENDER_UNLIT is traced first. Each of its hits then has one ray towards each light that casts shadows
 * and that it faces, and a set of rays into the hemisphere above it; every rank that holds cells on their way is asked
 * which of them its opaque surfaces block, and a ray is open where none does. Whether one blocks depends on the ray and
 * on the cell alone, so that the picture does not depend on who holds which cell. Transparent surfaces and volumes
 * block nothing; transparent surfaces are lit as opaque ones are; a surface that takes no light (its material is
 * ambient alone) keeps the colours it has, and has no rays.
 *
 * Where rays begin. A hit is off its surface by the rounding of its depth, and of what the depth was found by: by no
 * more than 1e-6 in the space's scaled units (KERNEL_WEIGHT_ERROR twice, and t's own rounding). Rays begin RENDER_LIFT
 * of them above it, along the normal: so the cell that was hit is left, not met again, and what is nearer than that to
 * a surface is not told from it. */
#ifndef RENDER_RENDER_LIGHT_H
#define RENDER_RENDER_LIGHT_H

#include "error.h"
#include "fragment.h"
#include "insitu/status.h"
#include "render.h"

enum { RENDER_MAX_SAMPLES = 64 };

/* Scaled units, of which a scene is about one. */
#define RENDER_LIFT 4e-6

/* As an unlit fragment has it. */
typedef struct render_hit {
    uint32_t pixel;
    float t, normal[2];
} render_hit;

/* A bit a ray: into the hemisphere; and towards lights. */
typedef struct render_hit_rays {
    uint64_t samples;
    uint32_t lights, unused;
} render_hit_rays;

/* The hit of an unlit fragment of the job, with the rays it has. False: it is lit without any. */
bool render_hit_of(const render_job *job, const fragment *f, render_hit *hit, render_hit_rays *rays);

/* Where the hit's rays begin, and the directions of its samples, of unit length; scene units. */
void render_hit_samples(const render_job *job, const render_hit *hit, double start[3],
                        double directions[RENDER_MAX_SAMPLES][3]);

/* What may block rays of the job's hits on this rank. */
typedef struct render_occluders render_occluders;

/* Finds it, once for all hits of a frame: the cells that opaque surfaces cross. The job, without its occlusion and
 * camera, is to stay as it is until they are freed. On success *out is NULL where there is nothing. Local. */
insitu_status render_occluders_create(const render_job *job, render_occluders **out, base_error *error);
void render_occluders_free(render_occluders *occluders);

/* Closes the rays that are blocked by this rank's opaque surfaces; occluders may be NULL. Local; rays are in an
 * undefined state on an error. */
insitu_status render_occlude(const render_occluders *occluders, const render_hit *hits, render_hit_rays *rays,
                             int64_t count, base_error *error);

/* Around all cells of this rank that may block. */
render_box render_occluder_box(const render_job *job);

/* For each of count boxes that one of the hit's rays may meet: take(state, box's number, the rays that may). */
typedef void render_box_taker(void *state, int box, const render_hit_rays *rays);
void render_rays_to_boxes(const render_job *job, const render_hit *hit, const render_hit_rays *rays,
                          const render_box *boxes, int count, render_box_taker *take, void *state);

/* Makes an unlit fragment what RENDER_LIGHT would have made it, by the light of the open rays; of a volume's fragment
 * nothing. */
void render_light_fragment(const render_job *job, const render_hit_rays *open, fragment *f);

#endif
