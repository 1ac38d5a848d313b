/* Writes whole numbers in as many bytes as they need, by stream vbyte (Lemire, Kurz, Rupp, 2018).
 *
 * Two bits a number say whether it takes 1, 2, 3 or 4 bytes. These bits of four numbers make a byte, and all such bytes
 * stand in front, so that four numbers are unpacked by one shuffle. */
#ifndef COMP_COMP_WORDS_H
#define COMP_COMP_WORDS_H

#include <stddef.h>
#include <stdint.h>

/* Bytes behind the end that may be read and written. */
enum { COMP_WORDS_SLACK = 16 };

/* The most bytes that so many words take, slack apart. */
static inline size_t comp_words_bound(size_t count)
{
    return (count + 3) / 4 + 4 * count;
}

/* Writes the words; those up to the next multiple of four behind them become 0. Returns the end. Local, as all here. */
unsigned char *comp_words_write(uint32_t *words, size_t count, unsigned char *out);

/* Reads so many words; those up to the next multiple of four behind them become anything. Returns the end. */
const unsigned char *comp_words_read(const unsigned char *in, size_t count, uint32_t *words);

/* The same on any machine. */
unsigned char *comp_words_write_plain(uint32_t *words, size_t count, unsigned char *out);
const unsigned char *comp_words_read_plain(const unsigned char *in, size_t count, uint32_t *words);

#endif
