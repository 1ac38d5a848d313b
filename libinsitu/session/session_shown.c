#include "session_shown.h"

#include <string.h>

#include "memory.h"
#include "session_plan.h"
#include "session_view.h"

void session_shown_clear(session_scalar *scalar)
{
    scalar->shows_all = false;
    scalar->interval_count = 0;
}

static bool add_intervals(session_scalar *scalar, const mmbvh_interval *more, int count)
{
    const size_t sum = (size_t)(scalar->interval_count + count);
    mmbvh_interval *intervals = base_realloc(scalar->intervals, (sum ? sum : 1) * sizeof *intervals);
    if (!intervals) return false;
    scalar->intervals = intervals;
    memcpy(intervals + scalar->interval_count, more, (size_t)count * sizeof *more);
    scalar->interval_count += count;
    return true;
}

bool session_shown_surface(session_scalar *scalar, const scene_isosurface *layer)
{
    /* Differences look at cells around the surface's. */
    if (layer->normals == SCENE_DIFFERENCES) scalar->shows_all = true;
    bool is_added = true;
    for (int i = 0; i < layer->value_count && is_added; i++) {
        const mmbvh_interval interval = render_isovalue_interval(layer->values[i]);
        is_added = add_intervals(scalar, &interval, 1);
    }
    return is_added;
}

bool session_shown_volume(const insitu_session *session, session_scalar *scalar, const scene_volume *layer)
{
    const scene_range *range = &layer->range;
    session_transfer t;
    mmbvh_interval intervals[RENDER_MAX_INTERVALS];
    base_error error = {0};
    /* A range from the data is known when all ranks have told theirs. */
    if (!range->is_fixed ||
        session_make_transfer(session, layer->colour_map, range->low, range->high, layer, &t, &error)) {
        scalar->shows_all = true;
        return true;
    }
    return add_intervals(scalar, intervals, render_visible_intervals(&t.transfer, intervals));
}

bool session_shown_is_bounded(const session_mesh *mesh)
{
    for (int i = 0; i < mesh->scalar_count; i++)
        if (mesh->scalars[i].wants_ranges && mesh->scalars[i].shows_all) return false;
    return true;
}

uint64_t session_shown_key(const session_mesh *mesh)
{
    uint64_t key = SESSION_HASH_BEGIN;
    for (int i = 0; i < mesh->scalar_count; i++) {
        const session_scalar *s = &mesh->scalars[i];
        if (!s->wants_ranges) continue;
        const int names[4] = {s->field, s->component, s->is_recentred, s->interval_count};
        session_hash_bytes(&key, names, sizeof names);
        session_hash_bytes(&key, s->intervals, (size_t)s->interval_count * sizeof *s->intervals);
    }
    return key;
}

insitu_status session_shown_select(session_mesh *mesh, int threads, mmbvh_selection *out, base_error *error)
{
    const size_t most = (size_t)mesh->scalar_count;
    grid_field *fields = base_calloc(most, sizeof *fields);
    mmbvh_wish *wishes = base_calloc(most, sizeof *wishes);
    int64_t *unusable = base_calloc(most, sizeof *unusable);
    insitu_status status = INSITU_ERROR_MEMORY;
    if (fields && wishes && unusable) {
        int count = 0;
        for (int i = 0; i < mesh->scalar_count; i++) {
            const session_scalar *s = &mesh->scalars[i];
            if (!s->wants_ranges) continue;
            fields[count] = session_scalar_field(mesh, s);
            wishes[count] = (mmbvh_wish){&fields[count], s->interval_count, s->intervals};
            count++;
        }
        const mmbvh_options options = {.threads = threads};
        status = mmbvh_select(&mesh->cells, wishes, count, &options, out, unusable, error);
        for (int i = 0, wish = 0; i < mesh->scalar_count && !status; i++)
            if (mesh->scalars[i].wants_ranges) mesh->scalars[i].unusable = unusable[wish++];
    } else {
        base_fail(error, status, "mesh \"%s\": no memory to plan its tree", mesh->name);
    }
    base_free(fields);
    base_free(wishes);
    base_free(unusable);
    return status;
}
