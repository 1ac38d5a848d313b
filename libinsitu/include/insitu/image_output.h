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

/* Where in the picture a decoration stands. Those of one place stack, and none lies over another. */
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
    float size; /* height, in those of the other decorations' words: 1, a title's 1.4 */
} insitu_words;

typedef struct insitu_tick {
    double place; /* along the bar: 0 is the low end, 1 the high end */
    char text[32];
} insitu_tick;

/* The colours of a field, with words. */
typedef struct insitu_colour_bar {
    const char *label;
    const float *colours; /* row-major, colour_count × 3, linear, from the low end on, evenly spaced */
    int colour_count;     /* >= 2; of bands >= 1 */
    bool is_banded;       /* the colours are those of bands of equal width; else linear between entries */
    const float *below;   /* 3, linear: of values below the low end; NULL: that end's */
    const float *above;   /* as below, of the high end */
    insitu_anchor at;     /* INSITU_LEFT or INSITU_RIGHT */
    int tick_count;
    const insitu_tick *ticks;
} insitu_colour_bar;

/* A line of the picture in pixels: (0, 0) is its upper left corner, (width, height) its lower right one. */
typedef struct insitu_stroke {
    double from[2], to[2];
    bool is_behind; /* whatever is drawn hides it */
} insitu_stroke;

/* Words beside a point of the picture, left out where they would lie over others. */
typedef struct insitu_label {
    double at[2];   /* pixels, as of a stroke */
    double away[2]; /* of length 1: where from the point they are */
    double gap;     /* between the two, in heights of words */
    char text[32];
} insitu_label;

/* A bar whose length in the scene is told by its words. */
typedef struct insitu_scale_bar {
    double length; /* pixels; 0: there is none */
    insitu_anchor at;
    char text[300];
} insitu_scale_bar;

/* Decorations drawn over a picture, and the background over which the picture is put first. Borrowed, all of it. */
typedef struct insitu_decorations {
    float background[4]; /* linear, premultiplied */
    float colour[3];     /* of words and lines; linear */
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

/* Numbers of an image's pixels beside their colours, for EXR. */
typedef struct insitu_channel {
    const char *name;
    const float *values; /* of the first pixel */
    int stride;          /* floats from pixel to pixel, row-major, top row first */
} insitu_channel;

/* A stretch of a pixel's ray, or a surface, where z_back is z. */
typedef struct insitu_deep_sample {
    float rgba[4];   /* linear, premultiplied */
    float z, z_back; /* depths as insitu_image has them */
} insitu_deep_sample;

/* Samples behind each other in the pixels of an image, rising with depth and not overlapping. Without background. */
typedef struct insitu_deep {
    const insitu_deep_sample *samples;
    const int64_t *first;   /* row-major, height × width: of a pixel's samples, where they begin */
    const uint32_t *counts; /* row-major, height × width: and how many they are */
} insitu_deep;

typedef struct insitu_image {
    int width, height;
    const float *rgba;  /* row-major, height × width × 4, top row first, linear, premultiplied */
    const float *depth; /* NULL, or row-major, height × width: of the nearest surface, of any opacity and whatever
                           volume is in front, the distance from the eye along the camera's axis (not along the pixel's
                           ray) in scene units; +infinity where there is none */
    const insitu_decorations *decorations; /* NULL: none, and rgba has its background */
    int channel_count;
    const insitu_channel *channels; /* borrowed; passed over where the format has none */
    const insitu_deep *deep;        /* NULL, or what a deep format holds, in place of all else but the size */
} insitu_image;

/* Write to a temporary file beside path and rename, so that path is never half a picture; missing folders are made. The
 * temporary file is named ".insitu-", 16 random digits and ".part", and is locked while it is written; the first
 * picture that a process writes to a folder removes those that killed runs of the same user left there. A pipe, device
 * or directory of the picture's name is an error. On an error message (size bytes) says what, with the path. Where all
 * is well it is empty, or a warning: no font was found, and the picture is without its words. Local. */
typedef insitu_status insitu_image_write_function(const insitu_image *image, insitu_image_format format,
                                                  const char *path, char *message, size_t size);

INSITU_API insitu_image_write_function insitu_image_write;

#ifdef __cplusplus
}
#endif

#endif
