#include "session_contours.h"

#include <math.h>
#include <string.h>

#include "session_ranges.h"

_Static_assert((int)RENDER_MAX_LINES == (int)SCENE_MAX_LINES, "a scene's lines have room");

/* Computes values that divide the range into parts of equal width on the range's scale, which may be logarithmic. If
 * two values are equal after rounding, only one of them is stored. */
static void compute_evenly_spaced_values(const render_transfer *range, int count, session_contours *out)
{
    const double low = render_scaled(range->scale, range->threshold, range->low);
    const double high = render_scaled(range->scale, range->threshold, range->high);
    for (int i = 0; i < count; i++) {
        const double share = (i + 1.0) / (count + 1);
        const double value = render_unscaled(range->scale, range->threshold, low + share * (high - low));
        const double last = out->lines.count ? out->values[out->lines.count - 1] : -(double)INFINITY;
        if (isfinite(value) && value > last) out->values[out->lines.count++] = value;
    }
}

insitu_status session_compute_contour_lines(const session_meshes *meshes, const session_team *team,
                                            const scene_lines *in, const render_transfer *colours,
                                            session_contours *out, base_error *error)
{
    insitu_status status = INSITU_OK;
    *out = (session_contours){.lines = {.values = out->values, .width = in->width, .is_alone = in->is_alone}};
    memcpy(out->colours, in->colours, sizeof out->colours);
    out->lines.colours = out->colours;
    if (in->has_values) {
        memcpy(out->values, in->values, (size_t)in->count * sizeof *out->values);
        out->lines.count = in->count;
        return INSITU_OK;
    }
    render_transfer range = {.scale = RENDER_LINEAR};
    const session_range_subject values = {&in->field, NULL, false};
    if (!colours) status = session_find_extremes(meshes, team, &values, &range.low, &range.high, error);
    if (!status) compute_evenly_spaced_values(colours ? colours : &range, in->count, out);
    return status;
}
