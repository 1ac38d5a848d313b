/* Makes the words and lines beside an image's data, as the image library takes them. */
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
    insitu_decorations all;        /* points into this and into the layers */
    insitu_decorations background; /* the background alone, for files without decorations */
    insitu_words words[SESSION_MAX_WORDS];
    insitu_colour_bar bars[SESSION_MAX_BARS];
    insitu_tick ticks[SESSION_MAX_BARS][SESSION_MAX_TICKS];
    char labels[SESSION_MAX_BARS][300];
    const scene_field *fields[SESSION_MAX_BARS]; /* the fields that the bars show */
    insitu_stroke *strokes;                      /* room for the outline's boxes and the rulers */
    insitu_label ruler_labels[SESSION_RULER_LABELS];
} session_decorations;

/* Input that decorations are made from. */
typedef struct session_decoration_basis {
    const scene_moment *moment;
    const session_extent *extent;
    const session_view *view;
    const session_layers *layers;
    const session_outline *outline;
    const session_catalogue *catalogue;
} session_decoration_basis;

/* Make them for an image that has some. NULL: no memory. Local. */
session_decorations *session_make_decorations(const scene_image *image, const session_decoration_basis *basis);

/* decorations may be NULL. */
void session_free_decorations(session_decorations *decorations);

/* Edges of a box as the camera sees them, cut off at the eye's plane; returns how many there are. An edge is behind
 * what is in the box where both of its faces are seen from within. Local. */
int session_box_strokes(const double lower[3], const double upper[3], const render_camera *camera,
                        insitu_stroke strokes[SESSION_BOX_EDGES]);

/* Ticks, numbers and names along three edges of the box, one of each axis: of those on the outline, the lowest in the
 * picture. size: height of words, pixels. Local. */
void session_box_rulers(const double lower[3], const double upper[3], const render_camera *camera, double size,
                        insitu_decorations *out, insitu_stroke *strokes, insitu_label *labels);

/* A round length that takes up to a fifth of the picture's width, at the depth of the point. unit: NULL: none. Local.
 */
insitu_scale_bar session_make_scale_bar(const render_camera *camera, const double point[3], const char *unit);

#endif
