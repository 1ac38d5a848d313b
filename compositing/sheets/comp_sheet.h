/* A sheet: at most one fragment, or one finished pixel, for each pixel of a strip; and its lossless compression.
 *
 * Values of a picture rise and fall smoothly from row to row. So each is predicted from the one above it, or in a
 * straight line from the two above, as whole numbers modulo 2^32: no float is rounded, and NaN keeps its bits. A row is
 * a vector, so 16 pixels are packed at once, and unpacked. The remains of a row take as many half bytes each as its
 * largest needs:
 *
 *     head | masks of rows that have gaps | word 1: first value, half bytes of rows, remains | word 2 ...
 *
 * A word that is the same in all pixels is written once; one that always equals the word before it (t_out of hits, the
 * channels of grey) is not written. */
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

/* Words of a fragment: all but its pixel, in their order (fragment.h). Those of a finished pixel: depth, then RGBA. */
typedef struct comp_sheet {
    uint32_t words[COMP_WORDS][COMP_STRIP_PIXELS]; /* by comp_grid_at(); those of absent pixels mean nothing */
    uint16_t masks[COMP_ROWS];                     /* the pixels that are there, a bit each */
    uint32_t strip;
    bool is_opaque; /* all are hits of opaque surfaces; of use where sheets of fragments are merged */
} comp_sheet;

/* Makes the sheet empty. */
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

/* Puts a fragment into the sheet, in the place of one that is there. Word by word, which is faster than by a copy. */
static inline void comp_sheet_put(comp_sheet *sheet, uint32_t at, const fragment *item)
{
    const unsigned char *const words = (const unsigned char *)item + sizeof item->pixel;
    for (int w = 0; w < COMP_WORDS; w++) memcpy(&sheet->words[w][at], words + 4 * w, sizeof(uint32_t));
    sheet->masks[at / COMP_LANES] = (uint16_t)(sheet->masks[at / COMP_LANES] | 1u << at % COMP_LANES);
    sheet->is_opaque = sheet->is_opaque && comp_is_opaque(item);
}

/* Gets it back, for a pixel of the picture. */
static inline fragment comp_sheet_get(const comp_sheet *sheet, uint32_t at, uint32_t pixel)
{
    uint32_t record[1 + COMP_WORDS] = {pixel};
    fragment item;
    for (int w = 0; w < COMP_WORDS; w++) record[1 + w] = sheet->words[w][at];
    memcpy(&item, record, sizeof item);
    return item;
}

/* The head of a packed sheet. */
typedef struct comp_sheet_head {
    uint32_t strip;
    uint16_t bytes, count; /* size of the whole sheet; number of its pixels */
    uint32_t rows, full;   /* rows that have pixels; that have all */
    uint32_t kinds;        /* kinds of words, two bits each */
} comp_sheet_head;

/* The most bytes that a sheet of so many pixels and words takes, with slack that may be written behind them. */
size_t comp_sheet_bound(int pixels, int words);

int comp_sheet_count(const comp_sheet *sheet);

/* Writes the first so many words of a sheet; returns the end. Local, as all here. */
unsigned char *comp_sheet_write(const comp_sheet *sheet, int words, unsigned char *out);

/* Reads the head alone; returns the sheet's end. */
const unsigned char *comp_sheet_look(const unsigned char *in, comp_sheet_head *head);

/* Reads what comp_sheet_write() wrote, with slack behind it; returns the end. */
const unsigned char *comp_sheet_read(const unsigned char *in, int words, comp_sheet *sheet);

/* The same by an instruction set that the machine has. The bytes do not depend on it. */
unsigned char *comp_sheet_write_by(cpu_isa isa, const comp_sheet *sheet, int words, unsigned char *out);
const unsigned char *comp_sheet_read_by(cpu_isa isa, const unsigned char *in, int words, comp_sheet *sheet);

/* Adds the fragments of other to all. In pixels that both have, the nearer one stays if all of both are opaque hits;
 * otherwise all keeps its own, and left gets those that other has there. */
void comp_sheet_join(comp_sheet *all, const comp_sheet *other, uint16_t left[COMP_ROWS]);

/* Blends each fragment over the background, as comp_merge_pixel() does with one that is alone or opaque. */
void comp_sheet_finish(const comp_sheet *fragments, const float background[4], comp_sheet *pixels);

/* Stores finished pixels in the picture, and the background in the strip's others. */
void comp_sheet_store(const comp_sheet *pixels, const comp_grid *grid, const float background[4], image *out);

#endif
