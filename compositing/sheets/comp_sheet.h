/* Defines sheets and their lossless compression. A sheet holds at most one fragment, or one finished pixel, for each
 * pixel of a strip (comp_grid.h).
 *
 * Values of a picture vary smoothly from row to row. Each value is therefore predicted, either as equal to the value
 * above it or by linear extrapolation from the two values above it, and the residual is stored. Residuals are
 * differences of integers modulo 2^32, so that nothing is rounded and NaN keeps its bits. A row is a vector, so that 16
 * pixels are packed or unpacked at once. All residuals of a row are stored with the same number of nibbles (half
 * bytes): the smallest number that suffices for the largest residual of the row. The format of a packed sheet is:
 *
 *     header | masks of rows with gaps | word 1: first value, nibble counts of rows, residuals | word 2 ...
 *
 * A word is one of the 32-bit members of a fragment or pixel. A word with the same value in all pixels is stored once.
 * A word that equals the preceding word in all pixels is not stored; examples are t_out of hits, which equals t_in, and
 * the channels of a grey pixel. */
#ifndef COMP_COMP_SHEET_H
#define COMP_COMP_SHEET_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "comp_grid.h"
#include "cpu.h"
#include "fragment.h"
#include "image.h"

enum { COMP_WORDS = 7, COMP_PIXEL_WORDS = 5, COMP_SHEET_HEAD = 20, COMP_SHEET_SLACK = 128 };

/* A sheet stores words: the members of a fragment except its pixel index, in their order (fragment.h), or the depth and
 * RGBA of a finished pixel. */
typedef struct comp_sheet {
    uint32_t words[COMP_WORDS]
                  [COMP_STRIP_PIXELS]; /* for each word, its value in each pixel of the strip
                                          (comp_grid_index_in_strip()); undefined in pixels without a fragment */
    uint16_t masks[COMP_ROWS];         /* for each row, the bit mask of the pixels that have a fragment */
    uint32_t strip;
    /* set if all fragments are hits of opaque surfaces, so that only the nearest one is visible if sheets are joined */
    bool is_opaque;
} comp_sheet;

/* Makes the sheet empty and assigns it to the strip. */
static inline void comp_sheet_begin(comp_sheet *sheet, uint32_t strip)
{
    memset(sheet->masks, 0, sizeof sheet->masks);
    sheet->strip = strip;
    sheet->is_opaque = true;
}

static inline bool comp_sheet_has(const comp_sheet *sheet, uint32_t at)
{
    return sheet->masks[at / COMP_LANES] >> at % COMP_LANES & 1;
}

static inline bool comp_is_opaque(const fragment *item)
{
    uint32_t transmittance;
    memcpy(&transmittance, &item->transmittance, sizeof transmittance);
    return transmittance == 0 && item->kind >= FRAGMENT_SURFACE;
}

/* Stores a fragment in the sheet; replaces an earlier one of the same pixel. Assigning the words one by one is faster
 * than memcpy(). */
static inline void comp_sheet_put(comp_sheet *sheet, uint32_t at, const fragment *item)
{
    const unsigned char *const words = (const unsigned char *)item + sizeof item->pixel;
    for (int w = 0; w < COMP_WORDS; w++) memcpy(&sheet->words[w][at], words + 4 * w, sizeof(uint32_t));
    sheet->masks[at / COMP_LANES] = (uint16_t)(sheet->masks[at / COMP_LANES] | 1u << at % COMP_LANES);
    sheet->is_opaque = sheet->is_opaque && comp_is_opaque(item);
}

/* Returns the fragment stored at the index. `pixel` is the pixel index to set in it. */
static inline fragment comp_sheet_get(const comp_sheet *sheet, uint32_t at, uint32_t pixel)
{
    uint32_t record[1 + COMP_WORDS] = {pixel};
    fragment item;
    for (int w = 0; w < COMP_WORDS; w++) record[1 + w] = sheet->words[w][at];
    memcpy(&item, record, sizeof item);
    return item;
}

/* The header of a packed sheet, as stored in messages. */
typedef struct comp_sheet_head {
    uint32_t strip;
    uint16_t bytes, count; /* size of the packed sheet in bytes; number of its pixels */
    uint32_t rows, full;   /* bit masks over the strip's rows: `rows` has the rows with at least one pixel, `full`
                              the rows with all 16 pixels */
    uint32_t kinds;        /* how each word is stored (enum word_kind in comp_sheet_rows.h), in two bits per word */
} comp_sheet_head;

/* Returns an upper bound of the number of bytes that comp_sheet_write() writes for this number of pixels and words,
 * including scratch bytes after the end of the packed data. */
size_t comp_sheet_max_bytes(int pixels, int words);

int comp_sheet_count_pixels(const comp_sheet *sheet);

/* Packs the first `words` words of a sheet; returns the end of the packed data. All functions in this file are
 * local. */
unsigned char *comp_sheet_write(const comp_sheet *sheet, int words, unsigned char *out);

/* Reads only the header; returns the end of the packed sheet. */
const unsigned char *comp_sheet_read_head(const unsigned char *in, comp_sheet_head *head);

/* Unpacks a sheet that comp_sheet_write() packed. `in` must be followed by COMP_SHEET_SLACK readable bytes. Returns the
 * end of the packed data. */
const unsigned char *comp_sheet_read(const unsigned char *in, int words, comp_sheet *sheet);

/* comp_sheet_write_by() packs, and comp_sheet_read_by() unpacks, a sheet with the given instruction set, which the
 * processor must have. The packed bytes are the same for every instruction set. */
unsigned char *comp_sheet_write_by(cpu_isa isa, const comp_sheet *sheet, int words, unsigned char *out);
const unsigned char *comp_sheet_read_by(cpu_isa isa, const unsigned char *in, int words, comp_sheet *sheet);

/* Adds the fragments of `other` to `all`. If both contain a fragment for a pixel and all fragments of both sheets are
 * hits of opaque surfaces, `all` keeps the nearer fragment. Otherwise `all` keeps its own fragment, and the pixel's bit
 * is set in left[], which has one mask per row; the caller must then merge the fragment that `other` has for this
 * pixel. */
void comp_sheet_join(comp_sheet *all, const comp_sheet *other, uint16_t left[COMP_ROWS]);

/* Blends each fragment over the background. The result equals that of comp_merge_pixel() for a pixel that has only this
 * visible fragment. */
void comp_sheet_finish(const comp_sheet *fragments, const float background[4], comp_sheet *pixels);

/* Stores finished pixels in the picture, and the background in the other pixels of the strip. */
void comp_sheet_store(const comp_sheet *pixels, const comp_grid *grid, const float background[4], image *out);

#endif
