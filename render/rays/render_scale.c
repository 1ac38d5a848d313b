#include "render_scale.h"

#include <math.h>

double render_scaled(render_scale scale, double threshold, double value)
{
    if (scale == RENDER_LINEAR) return value;
    if (scale == RENDER_LOG) return value > 0 ? log(value) : -INFINITY;
    const double size = fabs(value) / threshold;
    return size <= 1 ? value / threshold : copysign(1 + log(size), value);
}

double render_unscaled(render_scale scale, double threshold, double scaled)
{
    if (scale == RENDER_LINEAR) return scaled;
    if (scale == RENDER_LOG) return exp(scaled);
    const double size = fabs(scaled);
    return size <= 1 ? scaled * threshold : copysign(threshold * exp(size - 1), scaled);
}

void render_transfer_domain(const render_transfer *t, double *low, double *inverse_width)
{
    const bool is_even = t->scale == RENDER_LINEAR;
    const double width = is_even ? t->high - t->low : fmax(fabs(t->low), fabs(t->high));
    *low = is_even ? t->low : 0;
    *inverse_width = width > 0 ? 1 / width : 1;
}

double render_domain_of(const render_transfer *t, double value)
{
    double low, inverse_width;
    render_transfer_domain(t, &low, &inverse_width);
    const double x = (value - low) * inverse_width;
    return x < -1e18 ? -1e18 : x > 1e18 ? 1e18 : x;
}

double render_entry_position(const render_transfer *t, int i)
{
    const double along = (double)i / (t->colour_count - 1);
    if (t->scale == RENDER_LINEAR) return along;
    const double low = render_scaled(t->scale, t->threshold, t->low);
    const double high = render_scaled(t->scale, t->threshold, t->high);
    return render_domain_of(t, render_unscaled(t->scale, t->threshold, low + along * (high - low)));
}
