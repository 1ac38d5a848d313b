#include "comp_edges.h"

#include <string.h>

#include "memory.h"
#include "region.h"

/* Number of rows of pixels that one thread processes at once. The thread compares each row with the next one and marks
 * pixels in both, so it also marks pixels in the first row of the next chunk, which another thread may be
 * processing. */
enum { ROWS = 32 };

/* Compares two rows of pixels, and stores one byte per channel, nonzero if the channel differs by more than the limit
 * of comp_find_edges(). An sRGB code is nearly proportional to the square root of linear light, so that the test should
 * be |sqrt(a) - sqrt(b)| > c. To avoid square roots, it is replaced by (a - b)^2 > 2 c^2 (a + b): the difference a - b
 * is (sqrt(a) - sqrt(b)) (sqrt(a) + sqrt(b)), and (sqrt(a) + sqrt(b))^2 is close to 2 (a + b) if a is close to b. */
static void compare_rows(const float *restrict a, const float *restrict b, int64_t pixels, unsigned char *restrict out)
{
    const float limit = 0.0018f;
    for (int64_t i = 0; i < 4 * pixels; i++) out[i] = (a[i] - b[i]) * (a[i] - b[i]) > limit * (a[i] + b[i]);
}

/* Marks a pixel as lying at an edge. If is_shared is set, another thread may mark pixels of the same row, and the byte
 * is written atomically. */
static void mark_pixel(unsigned char *pixel, bool is_shared)
{
    if (is_shared) {
#pragma omp atomic write
        *pixel = 1;
    } else {
        *pixel = 1;
    }
}

static void mark_differing_pixel_pairs(const unsigned char *differ, int64_t pixels, unsigned char *own,
                                       bool is_own_shared, unsigned char *other, bool is_other_shared)
{
    for (int64_t p = 0; p < pixels; p++) {
        uint32_t channels;
        memcpy(&channels, differ + 4 * p, sizeof channels);
        if (!channels) continue;
        mark_pixel(own + p, is_own_shared);
        mark_pixel(other + p, is_other_shared);
    }
}

/* Compares each pixel of row y with the pixel to its right and with the three nearest pixels of the next row, and marks
 * both pixels of each pair that differs. `differ` is a buffer of 4 bytes per pixel. */
static void mark_edge_pixels_of_row(const image *picture, int64_t y, unsigned char *differ, unsigned char *marks)
{
    const int64_t width = picture->width;
    const float *row = picture->rgba + 4 * width * y, *next = row + 4 * width;
    unsigned char *own = marks + width * y, *below = own + width;
    const bool is_shared = y % ROWS == 0, is_next_shared = (y + 1) % ROWS == 0;
    compare_rows(row, row + 4, width - 1, differ);
    mark_differing_pixel_pairs(differ, width - 1, own, is_shared, own + 1, is_shared);
    if (y + 1 == picture->height) return;
    compare_rows(row, next, width, differ);
    mark_differing_pixel_pairs(differ, width, own, is_shared, below, is_next_shared);
    compare_rows(row + 4, next, width - 1, differ);
    mark_differing_pixel_pairs(differ, width - 1, own + 1, is_shared, below, is_next_shared);
    compare_rows(row, next + 4, width - 1, differ);
    mark_differing_pixel_pairs(differ, width - 1, own, is_shared, below + 1, is_next_shared);
}

bool comp_find_edges(const image *picture, int threads, unsigned char *pixels)
{
    const int64_t width = picture->width, count = width * picture->height, blocks = (picture->height + ROWS - 1) / ROWS;
    unsigned char *marks = base_calloc((size_t)count, 1), *differ = base_alloc((size_t)(blocks * width) * 4);
    const bool has_memory = marks && differ;
    if (has_memory) {
#pragma omp parallel num_threads(threads)
        {
            region_enter();
#pragma omp for schedule(dynamic) nowait
            for (int64_t block = 0; block < blocks; block++)
                for (int64_t y = block * ROWS; y < (block + 1) * ROWS && y < picture->height; y++)
                    mark_edge_pixels_of_row(picture, y, differ + 4 * width * block, marks);
            region_leave();
        }
        for (int64_t p = 0; p < count; p++)
            if (marks[p]) pixel_set_add(pixels, p);
    }
    base_free(marks);
    base_free(differ);
    return has_memory;
}
