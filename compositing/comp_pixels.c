#include "comp_pixels.h"

#include <omp.h>

#include "comp.h"

insitu_status comp_check_size(const image *out, base_error *error)
{
    if (out->width >= 1 && out->height >= 1 && (int64_t)out->width * out->height <= UINT32_MAX) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_ARGUMENT, "compositing: no image of %d by %d pixels", out->width, out->height);
}

void comp_add_overlap(unsigned char *overlaps, uint32_t pixel)
{
    __atomic_fetch_or(&overlaps[pixel >> 3], (unsigned char)(1u << (pixel & 7)), __ATOMIC_RELAXED);
}

comp_pixel comp_pixels_blend(const comp_merge_output *merged, fragment *items, int64_t count, uint32_t pixel)
{
    comp_pixel blended;
    (merged->is_folded ? comp_merge_folded_pixel : comp_merge_pixel)(items, count, merged->background, blended.rgba,
                                                                     &blended.depth);
    if (merged->overlaps && (merged->is_folded ? comp_folded_pixel_overlaps : comp_pixel_overlaps)(items, count))
        comp_add_overlap(merged->overlaps, pixel);
    if (merged->deep) {
        for (int64_t i = 0; i < count; i++) items[i].pixel = pixel;
        comp_deep_add_pixel(&merged->deep[omp_get_thread_num()], items, count, merged->is_folded);
    }
    return blended;
}
