#include "session_own_coordinates.h"

#include "memory.h"

static bool has_axis(int axes, int axis)
{
    return axes >> axis & 1;
}

/* Returns whether coordinates exist along exactly those axes whose bits are set in `axes`, and have the given types. */
static bool have_axes_and_types(const insitu_array coordinates[3], int axes, const insitu_type types[3])
{
    bool are_so = true;
    for (int axis = 0; axis < 3; axis++)
        are_so = are_so && (coordinates[axis].data != NULL) == has_axis(axes, axis) &&
                 (!coordinates[axis].data || coordinates[axis].type == types[axis]);
    return are_so;
}

bool session_reserve_coordinates(char **memory, insitu_array coordinates[3], int64_t count, int axes,
                                 const insitu_type types[3], int64_t *bytes, bool *is_new)
{
    int64_t largest = 0, offset = 0, used = 0;
    bool has_one_type = true;
    for (int axis = 0; axis < 3; axis++) {
        if (!has_axis(axes, axis)) continue;
        const int64_t size = session_type_size(types[axis]);
        has_one_type = has_one_type && (!largest || size == largest);
        largest = size > largest ? size : largest;
        used++;
    }
    *bytes = used * count * largest;
    if (*memory && have_axes_and_types(coordinates, axes, types)) return true;
    base_free(*memory);
    *memory = base_calloc((size_t)*bytes + 1, 1);
    *is_new = true;
    for (int axis = 0; axis < 3; axis++) {
        coordinates[axis] = (insitu_array){0};
        if (!*memory || !has_axis(axes, axis)) continue;
        /* coordinates are interleaved only if their types have the same size; otherwise each axis has a separate
         * array */
        coordinates[axis] = (insitu_array){*memory + offset, types[axis],
                                           has_one_type ? used * largest : session_type_size(types[axis])};
        offset += has_one_type ? largest : count * largest;
    }
    return *memory != NULL;
}
