/* The face between the library and whatever writes its pictures. libinsitu itself knows no image format: on rank 0,
 * when the first picture is due, it loads libinsitu_image (adaptors/image, on OpenImageIO) and calls
 * insitu_image_write(). So other ranks never load an image library. */
#ifndef INSITU_IMAGE_OUTPUT_H
#define INSITU_IMAGE_OUTPUT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "insitu/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum insitu_image_format {
    INSITU_PNG8 = 0,    /* sRGB, 8 bits a channel, straight alpha; no alpha channel where all is opaque */
    INSITU_PNG16 = 1,   /* the same with 16 bits */
    INSITU_EXR = 2,     /* linear premultiplied float RGBA, the channel Z where depth is given, and channels */
    INSITU_DEEP_EXR = 3 /* deep: any number of samples a pixel, each float R, G, B, A, Z and ZBack */
} insitu_image_format;

/* Where in the picture a decoration stands. Decorations of one place are stacked, and none covers another: what is too
 * large is wrapped or made smaller, and what has no room at all is left out, which insitu_image_check_words() says. */
typedef enum insitu_anchor {
    INSITU_TOP_LEFT,
    INSITU_TOP,
    INSITU_TOP_RIGHT,
    INSITU_LEFT,
    INSITU_RIGHT,
    INSITU_BOTTOM_LEFT,
    INSITU_BOTTOM,
    INSITU_BOTTOM_RIGHT
} insitu_anchor;

typedef struct insitu_words {
    const char *text; /* UTF-8, one line */
    insitu_anchor at;
    float size; /* height, as a multiple of the other decorations' words: 1, for a title 1.4 */
} insitu_words;

typedef struct insitu_tick {
    double place; /* along the bar: 0 is the low end, 1 the high end */
    char text[32];
} insitu_tick;

/* The colours of a field, with words. */
typedef struct insitu_colour_bar {
    const char *label;
    const float *colours; /* row-major, colour_count × 3, linear, from the low end on, evenly spaced */
    int colour_count;     /* >= 2; >= 1 where is_banded */
    bool is_banded;       /* each colour fills a band, all of equal width; else colours are linear between entries */
    const float *below;   /* 3, linear: colour of values below the low end; NULL: that of the low end */
    const float *above;   /* the same for values above the high end */
    insitu_anchor at;     /* INSITU_LEFT or INSITU_RIGHT */
    int tick_count;
    const insitu_tick *ticks;
} insitu_colour_bar;

/* A line of the picture in pixels: (0, 0) is its upper left corner, (width, height) its lower right one. */
typedef struct insitu_stroke {
    double from[2], to[2];
    bool is_behind; /* surfaces and volumes of the picture hide it */
} insitu_stroke;

/* Words beside a point of the picture, left out where they would lie over others. */
typedef struct insitu_label {
    double at[2];   /* pixels, as of a stroke */
    double away[2]; /* unit vector from the point to the words */
    double gap;     /* between point and words, in heights of words */
    char text[32];
} insitu_label;

/* A bar whose words tell its length in the scene. */
typedef struct insitu_scale_bar {
    double length; /* pixels; 0: there is none */
    insitu_anchor at;
    char text[300];
} insitu_scale_bar;

/* Decorations to draw over a picture, and the background that is put behind it first. All of it is borrowed. */
typedef struct insitu_decorations {
    float background[4]; /* linear, premultiplied */
    float colour[3];     /* colour of words and lines, linear */
    double size;         /* height of words, as a share of the picture's height */
    int words_count;
    const insitu_words *words;
    int bar_count;
    const insitu_colour_bar *bars;
    int stroke_count;
    const insitu_stroke *strokes;
    int label_count;
    const insitu_label *labels;
    insitu_scale_bar scale_bar;
    bool has_axes;
    double axes[3][3]; /* the scene's axes, seen from the camera: right, up, towards the eye; unit lengths */
} insitu_decorations;

/* One more number for each pixel of an image, for EXR. */
typedef struct insitu_channel {
    const char *name;
    const float *values; /* points to the first pixel's value */
    int stride;          /* floats from pixel to pixel, row-major, top row first */
} insitu_channel;

/* A stretch of a pixel's ray, or a surface, where z_back is z. */
typedef struct insitu_deep_sample {
    float rgba[4];   /* linear, premultiplied */
    float z, z_back; /* depths as insitu_image has them */
} insitu_deep_sample;

/* The samples of each pixel of an image, by rising depth, without overlaps. They do not hold the background. */
typedef struct insitu_deep {
    const insitu_deep_sample *samples;
    const int64_t *first;   /* row-major, height × width: index in samples of each pixel's first */
    const uint32_t *counts; /* row-major, height × width: number of each pixel's samples */
} insitu_deep;

typedef struct insitu_image {
    int width, height;
    const float *rgba;  /* row-major, height × width × 4, top row first, linear, premultiplied */
    const float *depth; /* NULL, or row-major, height × width: distance from the eye to the nearest surface along the
                           camera's axis (not along the pixel's ray), in scene units. The surface may have any opacity,
                           and volumes may lie in front of it. +infinity where there is none. */
    const insitu_decorations *decorations; /* NULL: none, and rgba has its background */
    int channel_count;
    const insitu_channel *channels; /* borrowed; passed over where the format has none */
    const insitu_deep *deep;        /* NULL, or the samples for a deep format, which uses only them and the size */
} insitu_image;

/* Write to a temporary file beside path and rename it, so that path is never half a picture. Missing folders are made.
 * The temporary file is named ".insitu-", 16 random digits and ".part", and is locked while it is written; the first
 * picture that a process writes to a folder removes the temporary files that killed runs of the same user left there.
 * It is an error if path is a pipe, a device or a directory. On an error, message (size bytes) says what went wrong,
 * with the path; otherwise it is empty. Local. */
typedef insitu_status insitu_image_write_function(const insitu_image *image, insitu_image_format format,
                                                  const char *path, char *message, size_t size);

INSITU_API insitu_image_write_function insitu_image_write;

/* A place in a larger picture for a smaller one. */
typedef struct insitu_place {
    float *rgba; /* the larger picture's, as insitu_image has them; written */
    int width;   /* the larger picture's */
    int x, y;    /* of the smaller one's upper left pixel; all of it lies in the larger one */
} insitu_place;

/* Draw the image's decorations over its colours and put these into the place; the image stays as it is. On an error,
 * message (size bytes) says what went wrong, and the place is as it was; otherwise it is empty. Local. Thread-safe. */
typedef insitu_status insitu_image_place_function(const insitu_image *image, const insitu_place *place, char *message,
                                                  size_t size);

INSITU_API insitu_image_place_function insitu_image_place;

/* Reasons why a picture's words are not drawn as they are given. Each text is empty, or one line. */
typedef struct insitu_word_faults {
    char font[1024];    /* no font was found, so words are left out; or OPENIMAGEIO_FONTS names none that can be read */
    char letters[1024]; /* the font lacks characters, which are drawn as boxes; or words are not UTF-8 */
    char room[1024];    /* decorations that have no room in the picture are left out */
} insitu_word_faults;

/* Lay the image's decorations out as insitu_image_write() does, without drawing them. Of the image only the size and
 * the decorations are read. Local. Thread-safe. */
typedef insitu_status insitu_image_check_words_function(const insitu_image *image, insitu_word_faults *out);

INSITU_API insitu_image_check_words_function insitu_image_check_words;

#ifdef __cplusplus
}
#endif

#endif
