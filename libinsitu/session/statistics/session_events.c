#include "session_events.h"

#include "memory.h"
#include "session_agree.h"
#include "session_filled.h"
#include "session_indexed.h"

bool session_are_statistics_due(const scene_statistics *statistics, int64_t cycle)
{
    return statistics->cycle_interval <= 1 || cycle % statistics->cycle_interval == 0;
}

bool session_are_any_statistics_needed(const scene *scene, int64_t cycle, bool images)
{
    for (int i = 0; i < scene->statistics_count; i++)
        if (session_are_statistics_due(&scene->statistics[i], cycle)) return true;
    for (int i = 0; i < scene->image_count && images; i++)
        if (scene->images[i].condition.is_given) return true;
    return false;
}

/* The requests for statistics in a step: requests of the scene's statistics that are due, followed by requests of
 * images' conditions. */
typedef struct event_work {
    int count;
    session_statistics_request *requests;
    session_statistics *results;
    /* source of each request: the index of the statistics in the scene or, for the condition of an image, the number of
     * the scene's statistics plus the image's index */
    int *request_origins;
} event_work;

static void work_free(event_work *w)
{
    base_free(w->requests);
    base_free(w->results);
    base_free(w->request_origins);
}

static bool work_create(const scene *scene, int64_t cycle, const session_valid_events *valid, event_work *w)
{
    const size_t most = (size_t)scene->statistics_count + (size_t)scene->image_count;
    *w = (event_work){0, base_calloc(most, sizeof *w->requests), base_calloc(most, sizeof *w->results),
                      base_calloc(most, sizeof *w->request_origins)};
    if (!w->requests || !w->results || !w->request_origins) return false;
    for (int i = 0; i < scene->statistics_count; i++) {
        const scene_statistics *s = &scene->statistics[i];
        if (!session_are_statistics_due(s, cycle) || !(valid->statistics >> i & 1)) continue;
        w->requests[w->count] = (session_statistics_request){&s->field, s->bin_count, s->low, s->high};
        w->request_origins[w->count++] = i;
    }
    for (int i = 0; i < scene->image_count; i++) {
        if (!scene->images[i].condition.is_given || !scene_is_first_variant(&scene->images[i])) continue;
        if (!(valid->images >> scene->images[i].variant.source & 1)) continue;
        w->requests[w->count] = (session_statistics_request){&scene->images[i].condition.field, 0, 0, -1};
        w->request_origins[w->count++] = scene->statistics_count + i;
    }
    return true;
}

/* Returns whether the condition holds. Returns false if there are no values. */
static bool condition_holds(const scene_condition *c, const session_statistics *s)
{
    const double value = c->statistic == SCENE_MEAN ? s->mean : c->statistic == SCENE_MINIMUM ? s->minimum : s->maximum;
    return s->cell_count > 0 && value > c->above && value < c->below;
}

void session_record_cycle(session_events *events, int64_t cycle)
{
    const bool is_return = events->has_cycle && cycle <= events->last_cycle;
    for (int i = 0; i < SCENE_MAX_STATISTICS && (is_return || !events->has_cycle); i++) {
        const bool is_pending = events->has_cycle && !(events->begun_files >> i & 1);
        if (!is_pending || cycle < events->first_cycles[i]) events->first_cycles[i] = cycle;
    }
    if (is_return) events->begun_files = 0;
    events->has_cycle = true;
    events->last_cycle = cycle;
}

/* Writes all statistics that are due, even if some cannot be written. *error receives the first error. */
static void write_due_statistics(session_events *events, const scene *scene, const event_work *w,
                                 const session_event_time *now, base_error *error)
{
    for (int i = 0; i < w->count; i++) {
        const int at = w->request_origins[i];
        base_error own = {.status = INSITU_OK};
        if (at >= scene->statistics_count || w->results[i].cell_count == 0) continue;
        const bool is_first = !(events->begun_files >> at & 1);
        const int64_t kept_below = is_first ? events->first_cycles[at] : now->cycle;
        session_write_statistics(scene->statistics[at].path, is_first, kept_below, now, &w->results[i], &own);
        if (!own.status) events->begun_files |= (uint64_t)1 << at;
        if (own.status && !error->status) *error = own;
    }
}

/* Returns whether a mesh that has the field has cells on any rank, whether or not they are drawn. */
static bool has_cells(const session_catalogue *catalogue, const scene_field *field)
{
    bool is_any = false;
    for (int m = 0; m < catalogue->mesh_count; m++) {
        const session_catalogue_mesh *mesh = &catalogue->meshes[m];
        is_any = is_any || (mesh->first_rank >= 0 && scene_field_selects_mesh(field, mesh->name) &&
                            session_catalogue_find_field(mesh, field->name));
    }
    return is_any;
}

/* Warns of fields of which no cell counts. There is no warning if no cell of any mesh is drawn: the fields are not the
 * cause then, and pictures have a warning of their own. */
static void warn_of_uncounted_cells(const scene *scene, const session_catalogue *catalogue,
                                    const session_extent *extent, const event_work *w, session_report *report)
{
    for (int i = 0; i < w->count; i++) {
        const scene_field *field = w->requests[i].field;
        const bool is_condition = w->request_origins[i] >= scene->statistics_count;
        session_warn(report, &(session_warning){WARNING_UNCOUNTED, field->name, NULL, w->request_origins[i]},
                     w->results[i].cell_count == 0 && extent->cell_count > 0 && has_cells(catalogue, field),
                     "%s of \"%s\": no cell counts (ghosts, no volume, or no finite value): %s",
                     is_condition ? "`when`" : "statistics", field->name,
                     is_condition ? "no picture is drawn" : "no line is written");
    }
}

static void store_conditions(session_events *events, const scene *scene, const event_work *w)
{
    events->held_conditions = 0;
    for (int i = 0; i < w->count; i++) {
        const int image = w->request_origins[i] - scene->statistics_count;
        if (image >= 0 && condition_holds(&scene->images[image].condition, &w->results[i]))
            events->held_conditions |= (uint64_t)1 << scene->images[image].variant.source;
    }
}

insitu_status session_read_event_fields(const scene *scene, session_meshes *meshes, const session_catalogue *catalogue,
                                        const session_team *team, int64_t cycle, const session_valid_events *valid,
                                        base_error *error)
{
    event_work work;
    if (!work_create(scene, cycle, valid, &work)) session_fail_for_memory(error, 1 << 12, "statistics of fields");
    for (int i = 0; i < work.count; i++) session_mark_field_for_statistics(meshes, work.requests[i].field);
    work_free(&work);
    /* ranks agree on errors before fill functions are called, because fill functions may be collective */
    insitu_status status = session_agree(team->comm, error);
    if (status) return status;
    session_fill_fields(meshes, catalogue, false, error);
    session_copy_requested_fields(meshes, team->threads, error);
    return session_agree(team->comm, error);
}

insitu_status session_process_statistics_of_step(session_events *events, const scene *scene, session_meshes *meshes,
                                                 const session_catalogue *catalogue, const session_extent *extent,
                                                 const session_team *team, const session_event_time *now,
                                                 const session_valid_events *valid, session_report *report,
                                                 base_error *error)
{
    event_work work;
    if (!work_create(scene, now->cycle, valid, &work)) session_fail_for_memory(error, 1 << 12, "statistics of fields");
    insitu_status status = session_agree(team->comm, error);
    if (!status)
        status = session_find_statistics(meshes, catalogue, team, work.requests, work.count, work.results, error);
    if (!status) {
        store_conditions(events, scene, &work);
        warn_of_uncounted_cells(scene, catalogue, extent, &work, report);
        if (team->rank == 0) write_due_statistics(events, scene, &work, now, error);
        status = session_agree_without_rank(team->comm, error);
    }
    work_free(&work);
    return status;
}

uint64_t session_find_drawable_images(const session_events *events, const scene *scene)
{
    uint64_t drawable = 0;
    for (int i = 0; i < scene->image_count; i++) {
        const uint64_t bit = (uint64_t)1 << scene->images[i].variant.source;
        const bool is_drawable = !scene->images[i].condition.is_given || events->held_conditions & bit;
        if (is_drawable && !(scene->images[i].is_drawn_once && events->drawn_images & bit)) drawable |= bit;
    }
    return drawable;
}
