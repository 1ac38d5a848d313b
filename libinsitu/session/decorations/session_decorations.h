/* Computes the decorations of an image in the form that the image library expects. Decorations are the texts and lines
 * that are drawn in addition to the image's data. */
#ifndef SESSION_DECORATIONS_H
#define SESSION_DECORATIONS_H

#include "insitu/image_output.h"
#include "scene.h"
#include "session_catalogue.h"
#include "session_layers.h"
#include "session_outline.h"
#include "session_space.h"
#include "session_ticks.h"
#include "session_view.h"

enum { SESSION_MAX_BARS = 20, SESSION_MAX_WORDS = 17, SESSION_BOX_EDGES = 12 };
enum { SESSION_RULER_STROKES = 3 * SESSION_MAX_TICKS, SESSION_RULER_LABELS = 3 * SESSION_MAX_TICKS + 3 };

typedef struct session_decorations {
    /* all decorations; pointers in it refer to members of this struct and to tables of colours in the scene */
    insitu_decorations decorations;
    insitu_decorations background;         /* only the background, for files without other decorations */
    insitu_words words[SESSION_MAX_WORDS]; /* the title, if there is one, followed by the scene's other texts */
    /* the colour bars; layers with the same field, colours and ticks share a bar */
    insitu_colour_bar bars[SESSION_MAX_BARS];
    insitu_tick ticks[SESSION_MAX_BARS][SESSION_MAX_TICKS];
    char labels[SESSION_MAX_BARS][300];          /* label of each colour bar */
    const scene_field *fields[SESSION_MAX_BARS]; /* the fields that the colour bars show */
    /* line segments: the edges of all boxes of the outline, followed by the ticks of the rulers */
    insitu_stroke *strokes;
    insitu_label ruler_labels[SESSION_RULER_LABELS]; /* numbers and axis names along the rulers */
    uint64_t bars_hash; /* hash of the labels, colours and ticks of the colour bars; equal bars have equal hashes */
} session_decorations;

/* The data from which decorations are computed. */
typedef struct session_decoration_basis {
    const scene_placeholder_values *moment;
    const session_extent *extent;
    const session_view *view;
    const session_layers *layers;
    const session_outline *outline;
    const session_catalogue *catalogue;
} session_decoration_basis;

/* Returns the decorations of an image for which the scene requests decorations. Returns NULL if memory runs out. Local.
 */
session_decorations *session_make_decorations(const scene_image *image, const session_decoration_basis *basis);

/* Returns a copy of the decorations, which refers to the same scene. Returns NULL if memory runs out. Local. */
session_decorations *session_copy_decorations(const session_decorations *from);

/* Frees the decorations. decorations may be NULL. */
void session_free_decorations(session_decorations *decorations);

/* Computes the edges of a box as strokes in the picture, and returns their number. Parts behind the eye are clipped
 * away. An edge is marked as behind the box's content if the camera sees the inner sides of both its faces. Local. */
int session_compute_box_strokes(const double lower[3], const double upper[3], const render_camera *camera,
                                insitu_stroke strokes[SESSION_BOX_EDGES]);

/* Adds ticks, numbers and names along three edges of the box, one per axis. For each axis, the edge on the box's
 * silhouette that is lowest in the picture is chosen. size is the height of texts in pixels. Local. */
void session_add_box_rulers(const double lower[3], const double upper[3], const render_camera *camera, double size,
                            insitu_decorations *out, insitu_stroke *strokes, insitu_label *labels);

/* Returns a scale bar. Its length is a round number of scene units (1, 2 or 5 times a power of ten). Drawn at the depth
 * of `point`, it spans at most a fifth of the picture's width. unit: unit of length for the bar's label, or NULL.
 * Local. */
insitu_scale_bar session_make_scale_bar(const render_camera *camera, const double point[3], const char *unit);

#endif
