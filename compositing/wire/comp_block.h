/* Lossless compression for records of neighbouring pixels.
 *
 * A record is eight words: a pixel's owned index (comp_schedule.h) and up to seven that a fragment or a finished pixel
 * has. Along a row of pixels these floats rise and fall smoothly, so each is predicted from the two before it by a
 * straight line, and only the small remainder is written, mostly one or two bytes (comp_words.h). Pixels come in runs
 * of consecutive indices. A word that is the same in all records of a block is written once; one that always equals the
 * word before it (t_out of hits, the channels of grey) is not written:
 *
 *     bytes | records | bytes of runs | words' kinds | runs | words that are the same | remains of word 1 | of word 2
 * ...
 *
 * The remainders are those of bit patterns, as whole numbers modulo 2^32: no float is rounded, and NaN keeps its bits.
 */
#ifndef COMP_COMP_BLOCK_H
#define COMP_COMP_BLOCK_H

#include <stddef.h>
#include <stdint.h>

enum {
    COMP_BLOCK_RECORDS = 1024,
    COMP_RECORD_WORDS = 8,
    COMP_RUN_SHIFT =
        6, /* runs end where the index is a multiple of 2^COMP_RUN_SHIFT: there the image goes on elsewhere */
    COMP_BLOCK_HEAD = 8
};

typedef struct comp_block {
    int count;
    /* The words of each record; the first is the owned index. 16-byte aligned, as base_alloc() has it. */
    uint32_t records[COMP_BLOCK_RECORDS][COMP_RECORD_WORDS];
    uint32_t remains[COMP_BLOCK_RECORDS][COMP_RECORD_WORDS]; /* scratch */
    uint32_t columns[COMP_RECORD_WORDS][COMP_BLOCK_RECORDS]; /* the same, word by word */
} comp_block;

/* The most bytes that a block of so many records takes, with slack that may be written or read behind them. */
size_t comp_block_bound(int records);

/* Writes the block; returns the end. Local, as is the next. */
unsigned char *comp_block_write(comp_block *block, unsigned char *out);

/* Takes a run: so many pixels from an owned index on. */
typedef void comp_run_taker(void *state, uint32_t index, uint32_t length);

/* Hands over the runs of a block that comp_block_write() wrote, without reading the rest; returns the block's end. */
const unsigned char *comp_block_runs(const unsigned char *in, comp_run_taker *take, void *state);

/* Reads one block that comp_block_write() wrote, with slack behind it; returns the end. */
const unsigned char *comp_block_read(const unsigned char *in, comp_block *block);

#endif
