/* The interface between the library and the module that writes its pictures. libinsitu itself supports no image format:
 * on rank 0, when the first picture is due, it loads libinsitu_image (adaptors/image, based on OpenImageIO) and calls
 * insitu_image_write(). Other ranks therefore never load an image library. */
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
    INSITU_PNG8 = 0,  /* sRGB, 8 bits per channel, straight alpha; no alpha channel if all pixels are opaque */
    INSITU_PNG16 = 1, /* same as INSITU_PNG8 with 16 bits per channel */
    /* linear premultiplied float RGBA, then Z if insitu_image.depth is given, then insitu_image.channels */
    INSITU_EXR = 2,
    INSITU_DEEP_EXR = 3 /* deep: any number of samples per pixel, each with float R, G, B, A, Z and ZBack */
} insitu_image_format;

/* The position of a decoration in the picture. Decorations at the same position are stacked, and none covers another. A
 * decoration that is too large is wrapped or made smaller; one for which there is no space is left out, which
 * insitu_image_check_words() reports. */
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
    const char *text; /* text in UTF-8, a single line */
    insitu_anchor at;
    float size; /* height of the text relative to that of other decorations: 1, or 1.4 for a title */
} insitu_words;

typedef struct insitu_tick {
    double place; /* position along the bar: 0 is the low end, 1 the high end */
    char text[32];
} insitu_tick;

/* A colour bar: the colours of a field, with a label and ticks. */
typedef struct insitu_colour_bar {
    const char *label;
    const float *colours; /* row-major, colour_count × 3, linear, from the low end on, evenly spaced */
    int colour_count;     /* at least 2, or at least 1 if is_banded */
    /* true: each colour fills one band, and all bands have equal width; false: colours are interpolated linearly */
    bool is_banded;
    const float *below; /* 3 values, linear: the colour of values below the low end; NULL: the colour of the low end */
    /* 3 values, linear: the colour of values above the high end; NULL: the colour of the high end */
    const float *above;
    insitu_anchor at; /* position in the picture: INSITU_LEFT or INSITU_RIGHT */
    int tick_count;
    const insitu_tick *ticks;
} insitu_colour_bar;

/* A line in the picture in pixels: (0, 0) is the upper left corner of the picture, (width, height) the lower right
 * one. */
typedef struct insitu_stroke {
    double from[2], to[2];
    bool is_behind; /* true: surfaces and volumes in the picture hide the line */
} insitu_stroke;

/* Words beside a point of the picture. They are left out if they would overlap another decoration. */
typedef struct insitu_label {
    double at[2];   /* position of the point in pixels; (0, 0) is the upper left corner of the picture */
    double away[2]; /* unit vector from the point to the words */
    double gap;     /* distance between the point and the words, as a multiple of the height of words */
    char text[32];
} insitu_label;

/* A scale bar, whose words give its length in the scene. */
typedef struct insitu_scale_bar {
    double length; /* length in pixels; 0: there is no bar */
    insitu_anchor at;
    char text[300];
} insitu_scale_bar;

/* A rectangle of a picture in pixels: (x, y) is its upper left corner. */
typedef struct insitu_rectangle {
    int x, y, width, height;
} insitu_rectangle;

/* Decorations that are drawn over a picture, and the background that is put behind it first. All pointers are
 * borrowed. */
typedef struct insitu_decorations {
    float background[4]; /* RGBA of the background, linear, premultiplied */
    float colour[3];     /* colour of words and lines, linear */
    double size;         /* height of words, as a fraction of the picture's height */
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
    double axes[3][3]; /* the scene's axes in camera coordinates: right, up, towards the eye; unit lengths */
    /* number of areas of the picture that other pictures will cover; texts, colour bars, the scale bar and the axes are
     * not drawn there */
    int covered_count;
    const insitu_rectangle *covered;
} insitu_decorations;

/* An additional channel of an image, for EXR. */
typedef struct insitu_channel {
    const char *name;
    const float *values; /* points to the first pixel's value */
    int stride;          /* floats from pixel to pixel, row-major, top row first */
} insitu_channel;

/* An interval [z, z_back] of a volume on a pixel's ray, or a surface, for which z_back equals z. */
typedef struct insitu_deep_sample {
    float rgba[4];   /* linear, premultiplied */
    float z, z_back; /* distances from the eye along the camera's axis, in scene units */
} insitu_deep_sample;

/* The samples of each pixel of an image, by increasing depth and without overlaps. The background is not included. */
typedef struct insitu_deep {
    const insitu_deep_sample *samples;
    const int64_t *first;   /* row-major, height × width: index of each pixel's first sample in samples */
    const uint32_t *counts; /* row-major, height × width: number of the pixel's samples */
} insitu_deep;

typedef struct insitu_image {
    int width, height;
    const float *rgba; /* row-major, height × width × 4, top row first, linear, premultiplied */
    /* NULL, or row-major, height × width: distance from the eye to the nearest surface along the camera's axis (not
     * along the pixel's ray), in scene units. The surface may have any opacity, and volumes may be in front of it.
     * +infinity if there is no surface. */
    const float *depth;
    const insitu_decorations
        *decorations; /* NULL: nothing is drawn over the picture, and rgba already includes the background */
    int channel_count;
    const insitu_channel *channels; /* borrowed; ignored if the format has no additional channels */
    const insitu_deep *deep; /* NULL, or the samples for INSITU_DEEP_EXR, which uses only them, width and height */
} insitu_image;

/* Writes to a temporary file beside path and renames it, so that path is never an incomplete picture. Missing folders
 * are made. The temporary file is named ".insitu-", 16 random digits and ".part", and is locked while it is written;
 * the first picture that a process writes to a folder removes the temporary files that killed runs of the same user
 * left there. It is an error if path is a pipe, a device or a directory. On an error, message (size bytes) describes
 * the reason, with the path; otherwise it is empty. Local. */
typedef insitu_status insitu_image_write_function(const insitu_image *image, insitu_image_format format,
                                                  const char *path, char *message, size_t size);

INSITU_API insitu_image_write_function insitu_image_write;

/* The position in a larger picture at which a smaller one is stored. */
typedef struct insitu_place {
    float *rgba; /* pixels of the larger picture, in the layout of insitu_image.rgba; they are written */
    int width;   /* width of the larger picture in pixels */
    /* position of the smaller picture's upper left pixel in the larger picture; the smaller one must lie completely
     * inside */
    int x, y;
} insitu_place;

/* Draws the image's decorations over its colours and stores the result in the larger picture. The image itself is not
 * changed. On an error, message (size bytes) describes it, and the larger picture is not changed; otherwise message is
 * empty. Local. Thread-safe. */
typedef insitu_status insitu_image_place_function(const insitu_image *image, const insitu_place *place, char *message,
                                                  size_t size);

INSITU_API insitu_image_place_function insitu_image_place;

/* Reasons why a picture's words are not drawn as they are given. Each text is empty, or one line. */
typedef struct insitu_word_faults {
    char font[1024]; /* no font was found, so that words are left out, or OPENIMAGEIO_FONTS names a font that cannot be
                        read */
    char letters[1024]; /* the font lacks characters, which are drawn as boxes; or the words are not UTF-8 */
    char room[1024];    /* decorations for which the picture has no space are left out */
} insitu_word_faults;

/* Computes the layout of the image's decorations as insitu_image_write() does, without drawing them. Only the size and
 * the decorations of the image are read. Local. Thread-safe. */
typedef insitu_status insitu_image_check_words_function(const insitu_image *image, insitu_word_faults *out);

INSITU_API insitu_image_check_words_function insitu_image_check_words;

#ifdef __cplusplus
}
#endif

#endif
