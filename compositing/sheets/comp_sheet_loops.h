/* The table of the loops over the rows of a sheet. The loops are compiled once per instruction set
 * (comp_sheet_table.c). Only static inline code may be shared between the resulting objects; tests/house_kernels.sh
 * checks this. */
#ifndef COMP_COMP_SHEET_LOOPS_H
#define COMP_COMP_SHEET_LOOPS_H

#include "comp_sheet.h"

/* Describes the rows of a sheet that contain pixels, and how their values are predicted. If the sheet has many gaps,
 * its pixels are first moved together, so that they fill rows without gaps (a compacted sheet). A lane is fresh in a
 * row if it has a pixel in this row but none in the rows above. Its value is then predicted from another lane. */
typedef struct sheet_plan {
    int rows, count; /* rows: number of rows that contain pixels; count: number of pixels in all rows */
    bool is_sparse;  /* true: the sheet has many gaps, and its pixels are moved together before packing; fresh and
                        source are then not set */
    /* For each row that contains pixels: row is its index in the strip, number the number of its pixels, mask the bit
     * mask of the lanes with a pixel, and fresh the bit mask of the fresh lanes. */
    uint8_t row[COMP_ROWS], number[COMP_ROWS];
    uint16_t mask[COMP_ROWS], fresh[COMP_ROWS];
    uint8_t source[COMP_ROWS][COMP_LANES]; /* for each lane that has no pixel in the rows above (fresh): the lane
                                              whose most recent value predicts its value */
} sheet_plan;

typedef struct comp_sheet_loops {
    void (*plan)(const uint16_t masks[COMP_ROWS], sheet_plan *plan);
    void (*compress)(const comp_sheet *sheet, const sheet_plan *plan, int words, comp_sheet *compact);
    void (*expand)(const comp_sheet *compact, const sheet_plan *plan, int words, comp_sheet *sheet);
    unsigned char *(*write)(const comp_sheet *sheet, const sheet_plan *plan, int words, uint32_t *kinds,
                            unsigned char *out);
    const unsigned char *(*read)(const unsigned char *in, const sheet_plan *plan, uint32_t kinds, int words,
                                 comp_sheet *out);
    void (*join)(comp_sheet *all, const comp_sheet *other, uint16_t left[COMP_ROWS]);
    void (*finish)(const comp_sheet *fragments, const float background[4], comp_sheet *pixels);
    void (*store)(const comp_sheet *pixels, const comp_area *area, const float background[4], image *out);
} comp_sheet_loops;

extern const comp_sheet_loops comp_sheet_plain, comp_sheet_sse42, comp_sheet_avx512;

/* Returns the table of the fastest loops that processors with this instruction set can run. */
const comp_sheet_loops *comp_sheet_loops_of(cpu_isa isa);

#endif
