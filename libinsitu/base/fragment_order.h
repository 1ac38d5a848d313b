/* Defines the order of a pixel's fragments: by t_in, at equal t_in with surfaces before volumes, and then by all
 * other bits of a fragment. Fragments that compare equal are therefore identical. */
#ifndef BASE_FRAGMENT_ORDER_H
#define BASE_FRAGMENT_ORDER_H

#include <stdint.h>
#include <string.h>

#include "fragment.h"

/* Maps a float to an unsigned integer, so that the order of the integers is that of the floats. NaN is ordered like any
 * other bit pattern. */
static inline uint32_t fragment_sortable_bits(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits & 0x80000000u ? ~bits : bits | 0x80000000u;
}

static inline int fragment_compare_numbers(uint32_t a, uint32_t b)
{
    return (a > b) - (a < b);
}

static inline int fragment_compare_other_members(const fragment *a, const fragment *b)
{
    const float of_a[] = {a->t_in, a->t_out, a->transmittance, a->colour[0], a->colour[1], a->colour[2]};
    const float of_b[] = {b->t_in, b->t_out, b->transmittance, b->colour[0], b->colour[1], b->colour[2]};
    int order = fragment_compare_numbers(a->kind, b->kind);
    for (int i = 0; !order && i < 6; i++)
        order = fragment_compare_numbers(fragment_sortable_bits(of_a[i]), fragment_sortable_bits(of_b[i]));
    return order;
}

/* Returns a negative number if a is in front of b, 0 if they are identical, else a positive number. */
static inline int fragment_compare(const fragment *a, const fragment *b)
{
    if (a->t_in < b->t_in) return -1;
    if (a->t_in > b->t_in) return 1;
    if (a->t_in != b->t_in) {
        const int order = fragment_compare_numbers(fragment_sortable_bits(a->t_in), fragment_sortable_bits(b->t_in));
        if (order) return order;
    }
    const int order = (b->kind >= FRAGMENT_SURFACE) - (a->kind >= FRAGMENT_SURFACE);
    return order ? order : fragment_compare_other_members(a, b);
}

#endif
