/* The shuffles stand in tables by the byte of lengths, made by the preprocessor from the length of number k, where its
 * bytes begin, and which byte of four whole numbers comes to which place, and back. */
#include "comp_words.h"

#include <string.h>
#if defined(__x86_64__)
#include <immintrin.h>

#include "cpu.h"
#endif

/* The bytes that four numbers take, by their byte of lengths. */
static inline size_t bytes_of(unsigned lengths)
{
    return 4 + (lengths & 3) + (lengths >> 2 & 3) + (lengths >> 4 & 3) + (lengths >> 6);
}

static inline unsigned length_of(uint32_t word)
{
    return (unsigned)(word > 0xff) + (unsigned)(word > 0xffff) + (unsigned)(word > 0xffffff);
}

static size_t write_four(const uint32_t words[4], unsigned char *lengths, unsigned char *out)
{
    unsigned char *const first = out;
    *lengths = 0;
    for (unsigned k = 0; k < 4; k++) {
        const unsigned length = length_of(words[k]);
        for (unsigned j = 0; j < 4; j++) out[j] = (unsigned char)(words[k] >> 8 * j);
        *lengths = (unsigned char)(*lengths | length << 2 * k);
        out += length + 1;
    }
    return (size_t)(out - first);
}

static void read_four(const unsigned char *in, unsigned lengths, uint32_t words[4])
{
    for (unsigned k = 0; k < 4; k++) {
        const unsigned length = lengths >> 2 * k & 3;
        uint32_t word = 0;
        for (unsigned j = 0; j <= length; j++) word |= (uint32_t)in[j] << 8 * j;
        words[k] = word;
        in += length + 1;
    }
}

#if defined(__x86_64__)

#define LENGTH(c, k) (((c) >> 2 * (k)&3) + 1)
#define END1(c) LENGTH(c, 0)
#define END2(c) (END1(c) + LENGTH(c, 1))
#define END3(c) (END2(c) + LENGTH(c, 2))
#define END4(c) (END3(c) + LENGTH(c, 3))
#define OUT(c, p)                                                                                                      \
    ((p) < END1(c)   ? (p)                                                                                             \
     : (p) < END2(c) ? 4 + (p)-END1(c)                                                                                 \
     : (p) < END3(c) ? 8 + (p)-END2(c)                                                                                 \
     : (p) < END4(c) ? 12 + (p)-END3(c)                                                                                \
                     : 0x80)
#define IN(c, k, begin, j) ((j) < LENGTH(c, k) ? (begin) + (j) : 0x80)
#define OUT4(c, p) OUT(c, p), OUT(c, (p) + 1), OUT(c, (p) + 2), OUT(c, (p) + 3)
#define IN4(c, k, begin) IN(c, k, begin, 0), IN(c, k, begin, 1), IN(c, k, begin, 2), IN(c, k, begin, 3)
#define OUT_ROW(c)                                                                                                     \
    {                                                                                                                  \
        OUT4(c, 0), OUT4(c, 4), OUT4(c, 8), OUT4(c, 12)                                                                \
    }
#define IN_ROW(c)                                                                                                      \
    {                                                                                                                  \
        IN4(c, 0, 0), IN4(c, 1, END1(c)), IN4(c, 2, END2(c)), IN4(c, 3, END3(c))                                       \
    }
#define ROWS4(ROW, c) ROW(c), ROW((c) + 1), ROW((c) + 2), ROW((c) + 3)
#define ROWS16(ROW, c) ROWS4(ROW, c), ROWS4(ROW, (c) + 4), ROWS4(ROW, (c) + 8), ROWS4(ROW, (c) + 12)
#define ROWS64(ROW, c) ROWS16(ROW, c), ROWS16(ROW, (c) + 16), ROWS16(ROW, (c) + 32), ROWS16(ROW, (c) + 48)

static const unsigned char outward[256][16] = {ROWS64(OUT_ROW, 0), ROWS64(OUT_ROW, 64), ROWS64(OUT_ROW, 128),
                                               ROWS64(OUT_ROW, 192)};
static const unsigned char inward[256][16] = {ROWS64(IN_ROW, 0), ROWS64(IN_ROW, 64), ROWS64(IN_ROW, 128),
                                              ROWS64(IN_ROW, 192)};

/* A number's length is 3 less the bytes that are 0 from the top on. The product brings the four together. */
__attribute__((target("ssse3"))) static inline unsigned lengths_of(__m128i words)
{
    const __m128i zero = _mm_setzero_si128();
    __m128i length = _mm_set1_epi32(3);
    length = _mm_add_epi32(length, _mm_cmpeq_epi32(_mm_srli_epi32(words, 8), zero));
    length = _mm_add_epi32(length, _mm_cmpeq_epi32(_mm_srli_epi32(words, 16), zero));
    length = _mm_add_epi32(length, _mm_cmpeq_epi32(_mm_srli_epi32(words, 24), zero));
    const __m128i bytes = _mm_packus_epi16(_mm_packs_epi32(length, zero), zero);
    return (uint32_t)_mm_cvtsi128_si32(bytes) * 0x01041040u >> 24;
}

__attribute__((target("ssse3"))) static unsigned char *write_by_shuffles(const uint32_t *words, size_t fours,
                                                                         unsigned char *lengths, unsigned char *out)
{
    for (size_t i = 0; i < fours; i++) {
        const __m128i four = _mm_loadu_si128((const __m128i *)(const void *)(words + 4 * i));
        const unsigned c = lengths_of(four);
        const __m128i shuffle = _mm_loadu_si128((const __m128i *)(const void *)outward[c]);
        _mm_storeu_si128((__m128i *)(void *)out, _mm_shuffle_epi8(four, shuffle));
        lengths[i] = (unsigned char)c;
        out += bytes_of(c);
    }
    return out;
}

__attribute__((target("ssse3"))) static const unsigned char *
read_by_shuffles(const unsigned char *in, size_t fours, const unsigned char *lengths, uint32_t *words)
{
    for (size_t i = 0; i < fours; i++) {
        const __m128i shuffle = _mm_loadu_si128((const __m128i *)(const void *)inward[lengths[i]]);
        const __m128i bytes = _mm_loadu_si128((const __m128i *)(const void *)in);
        _mm_storeu_si128((__m128i *)(void *)(words + 4 * i), _mm_shuffle_epi8(bytes, shuffle));
        in += bytes_of(lengths[i]);
    }
    return in;
}

static int has_shuffles(void)
{
    return cpu_best_isa() >= CPU_SSE42;
}

#endif

/* Fills up to a multiple of four with words of 0, which take a byte each. */
static size_t pad(uint32_t *words, size_t count)
{
    const size_t beyond = (4 - count % 4) % 4;
    for (size_t i = count; i < count + beyond; i++) words[i] = 0;
    return beyond;
}

unsigned char *comp_words_write_plain(uint32_t *words, size_t count, unsigned char *out)
{
    const size_t fours = (count + 3) / 4, beyond = pad(words, count);
    unsigned char *const lengths = out;
    out += fours;
    for (size_t i = 0; i < fours; i++) out += write_four(words + 4 * i, lengths + i, out);
    return out - beyond;
}

const unsigned char *comp_words_read_plain(const unsigned char *in, size_t count, uint32_t *words)
{
    const unsigned char *const lengths = in;
    in += (count + 3) / 4;
    for (size_t i = 0; i < count; i += 4) {
        read_four(in, lengths[i / 4], words + i);
        in += bytes_of(lengths[i / 4]);
    }
    return in - (4 - count % 4) % 4;
}

unsigned char *comp_words_write(uint32_t *words, size_t count, unsigned char *out)
{
#if defined(__x86_64__)
    const size_t fours = (count + 3) / 4;
    if (has_shuffles()) {
        const size_t beyond = pad(words, count);
        return write_by_shuffles(words, fours, out, out + fours) - beyond;
    }
#endif
    return comp_words_write_plain(words, count, out);
}

const unsigned char *comp_words_read(const unsigned char *in, size_t count, uint32_t *words)
{
#if defined(__x86_64__)
    const size_t fours = (count + 3) / 4;
    if (has_shuffles()) return read_by_shuffles(in + fours, fours, in, words) - (4 * fours - count);
#endif
    return comp_words_read_plain(in, count, words);
}
