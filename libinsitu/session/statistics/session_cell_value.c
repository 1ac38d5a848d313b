#include "session_cell_value.h"

#include <math.h>

session_cell_value session_read_cell_value(const grid *g, const grid_field *field, int64_t cell, volume_buffer *buffer)
{
    session_cell_value out = {.is_counted = grid_can_be_shown(g, cell),
                              .is_shell = grid_is_shell(g, cell),
                              .minimum = INFINITY,
                              .maximum = -INFINITY};
    if (!out.is_counted) return out;
    out.volume = session_cell_volume(g, cell, buffer);
    const int count = field->is_cell_centred ? 1 : buffer->vertex_count;
    for (int i = 0; i < count; i++) {
        const double value = grid_field_value(field, field->is_cell_centred ? cell : buffer->vertices[i]);
        out.is_counted = out.is_counted && isfinite(value);
        out.minimum = fmin(out.minimum, value);
        out.maximum = fmax(out.maximum, value);
        out.mean += value;
    }
    out.mean /= count;
    out.is_counted = out.is_counted && count > 0 && isfinite(out.mean) && isfinite(out.volume);
    return out;
}
