/* Performs a step by calling its phases in order; each phase has its own file.
 *
 * A phase gets only the parts of the session that it may access. It is collective, and returns the same status on all
 * ranks (session_agree.h), so that all ranks leave the step after the same phase. The first phase is one small
 * reduction; if no image is due and nothing has failed, nothing else is exchanged. */
#include <string.h>

#include "cpu.h"
#include "memory.h"
#include "render.h"
#include "render_isa.h"
#include "session.h"
#include "session_agree.h"
#include "session_changes.h"
#include "session_check.h"
#include "session_checksums.h"
#include "session_covers.h"
#include "session_derive.h"
#include "session_derived.h"
#include "session_distances.h"
#include "session_draw.h"
#include "session_empty_layers.h"
#include "session_events.h"
#include "session_files.h"
#include "session_filled.h"
#include "session_finer.h"
#include "session_guard.h"
#include "session_indexed.h"
#include "session_mesh_groups.h"
#include "session_lines.h"
#include "session_mirrors.h"
#include "session_pieces.h"
#include "session_recentre.h"
#include "session_smooth.h"
#include "session_summary.h"
#include "session_surfaces.h"
#include "session_discontinuous.h"
#include "session_vertex_order.h"
#include "session_warped.h"

static double get_milliseconds_since(double start)
{
    return 1e3 * (MPI_Wtime() - start);
}

/* Reads the edited scene, and frees all data that was created for images of the old scene. If the new scene sets other
 * limits for the number of pieces of cells of higher order, cells are marked as changed. */
static void reload_scene(insitu_session *s, session_changes *changes)
{
    const scene old = s->scene_file.scene;
    /* waits until all pictures are written, so that the writing thread no longer uses the old scene */
    session_writer_drain(&s->writer);
    session_writer_collect_results(&s->writer, &s->report);
    if (!session_reload_scene(&s->scene_file, &s->team)) return;
    session_writer_drop_memory(&s->writer);
    session_run_ranges_free(&s->run_ranges);
    session_cinema_free(&s->cinema);
    session_montages_free(&s->montages);
    session_overwrites_free(&s->overwrites);
    s->events = (session_events){0};
    s->catalogue.are_meshes_grouped = s->catalogue.are_hashes_known = false;
    session_clear_reported_warnings(&s->report);
    session_text_add(&s->report.warnings, "the scene file was edited: its images are drawn from this step on");
    s->catalogue.are_derived = false;
    for (int i = 0; i < s->meshes.count; i++) {
        session_drop_scalars(s->meshes.items[i]);
        session_drop_derived_fields(s->meshes.items[i]);
    }
    const scene *now = &s->scene_file.scene;
    const bool are_same_pieces = now->finer_pieces == old.finer_pieces && now->finer_memory == old.finer_memory &&
                                 now->is_surface_error_given == old.is_surface_error_given;
    if (are_same_pieces) return;
    session_free_finer_lattices(&s->meshes);
    s->meshes.are_cells_changed = s->meshes.are_names_changed = true;
    changes->are_cells_changed = changes->are_names_changed = true;
}

/* Makes all ranks use the lowest of their instruction sets. Instruction sets round differently. If ranks used different
 * ones, volumes would overlap or leave gaps at faces between cells of two ranks. */
static void select_lowest_instruction_set(const session_changes *changes, session_report *report)
{
    render_isa_limit(changes->isa_level);
    session_warn(report, &(session_warning){WARNING_ISA, NULL, NULL, 1}, changes->isa_level < changes->isa_best,
                 "kernels are %s, the best that all ranks have: rank %d has no better, others have %s",
                 cpu_isa_name((cpu_isa)changes->isa_level), changes->isa_rank,
                 cpu_isa_name((cpu_isa)changes->isa_best));
}

static void warn_of_instruction_set_setting(const session_team *team, session_report *report)
{
    const char *isa = render_isa_warning();
    session_warn_locally(report, &(session_warning){WARNING_ISA, NULL, NULL, 0}, *isa != '\0', "rank %d: %s",
                         team->rank, isa);
}

static session_derive_basis make_derive_basis(insitu_session *s)
{
    return (session_derive_basis){&s->scene_file.scene, &s->catalogue, &s->meshes, &s->team, &s->space.extent};
}

static insitu_status add_derived_fields(insitu_session *s, base_error *error)
{
    return session_add_derived_fields(&s->scene_file.scene, s->scene_file.path, &s->catalogue, &s->meshes, &s->team,
                                      error);
}

/* Updates the catalogue of all ranks' meshes and fields if names are new, adds the derived fields to it, and creates
 * the mesh groups, over which values are averaged at vertices (session_mesh_groups.h). If creating the groups fails,
 * the error is only stored in *error. Collective. */
static insitu_status update_catalogue_and_mesh_groups(insitu_session *s, bool are_names_new, bool is_shared,
                                                      base_error *error)
{
    insitu_status status = INSITU_OK;
    if (are_names_new) status = session_update_catalogue(&s->catalogue, &s->meshes, &s->team, is_shared, error);
    if (!status) status = add_derived_fields(s, error);
    if (!status) session_group_meshes(&s->scene_file.scene, &s->catalogue, &s->meshes, error);
    return status;
}

/* Warps and mirrors the meshes for which the scene requests it. *are_cells_changed is set if this changes cells or
 * coordinates on any rank. Collective. */
static insitu_status warp_and_mirror_meshes(insitu_session *s, bool *are_cells_changed, base_error *error)
{
    const scene *scene = &s->scene_file.scene;
    const bool is_any = scene->warp_count > 0 || scene->mirror_count > 0;
    int mine, any;
    if (!is_any && !s->meshes.are_transformed) return INSITU_OK;
    session_update_warps(scene, s->scene_file.path, &s->meshes, s->team.threads);
    session_update_mirrors(scene, &s->meshes, s->team.threads, error);
    insitu_status status = session_agree(s->team.comm, error);
    if (status) return status;
    s->meshes.are_transformed = is_any;
    mine = s->meshes.are_cells_changed;
    status = session_check_mpi(error, MPI_Allreduce(&mine, &any, 1, MPI_INT, MPI_MAX, s->team.comm), "MPI_Allreduce");
    *are_cells_changed = *are_cells_changed || any;
    return status;
}

/* Divides cells of higher order into linear pieces that are smaller than the distance between nodes, unless the scene
 * disables this. The images that are due determine which cells are divided and, with surface_error, the number of
 * pieces. *are_cells_changed is set if the pieces have changed on any rank. Collective. */
static insitu_status subdivide_higher_order_cells(insitu_session *s, const session_moment *moment,
                                                  bool *are_cells_changed, base_error *error)
{
    const scene *scene = &s->scene_file.scene;
    const session_pieces_basis basis = {scene, moment, *are_cells_changed, &s->catalogue, &s->team, &s->meshes};
    bool are_changed = false;
    if (scene->finer_pieces == 1 || !session_catalogue_has_higher_order(&s->catalogue)) return INSITU_OK;
    if (!*are_cells_changed && session_count_due_images(scene, moment) == 0) return INSITU_OK;
    session_finer_choice *choices = base_calloc((size_t)s->catalogue.mesh_count + 1, sizeof *choices);
    if (!choices) session_fail_for_memory(error, s->catalogue.mesh_count * (int64_t)sizeof *choices, "finer pieces");
    insitu_status status = session_agree(s->team.comm, error);
    if (!status) status = session_count_higher_order_cells(&s->meshes, &s->catalogue, s->team.comm, choices, error);
    if (!status) status = session_choose_higher_order_pieces(&basis, choices, &s->report, error);
    if (!status)
        status = session_make_finer_lattices(&s->meshes, &s->catalogue, choices, &s->team, &are_changed, error);
    session_free_choices(choices, s->catalogue.mesh_count);
    if (status || !are_changed) return status;
    *are_cells_changed = true;
    return session_check_meshes(&s->meshes, &s->team, error);
}

/* Checks the changed contents of meshes, and updates the catalogue. Meshes and fields with faults are excluded from the
 * step; *refused receives the first fault. Collective. */
static insitu_status update_meshes(insitu_session *s, const session_changes *changes, const session_moment *moment,
                                   base_error *refused, base_error *error)
{
    const session_team *team = &s->team;
    const scene *scene = &s->scene_file.scene;
    base_error reason = {.status = INSITU_OK};
    bool are_cells_changed = changes->are_cells_changed;
    if (changes->are_levels_changed && session_update_covered_cells(&s->meshes, team, error)) return error->status;
    if (warp_and_mirror_meshes(s, &are_cells_changed, error)) return error->status;
    if (are_cells_changed) session_check_meshes(&s->meshes, team, &reason);
    if (!refused->status) *refused = reason;
    const bool of_names = changes->are_names_changed || refused->status || s->catalogue.has_faults;
    if (are_cells_changed) session_invalidate_homes(&s->catalogue);
    if (scene->finer_pieces != 1) session_drop_vertex_ids(&s->meshes);
    insitu_status status =
        update_catalogue_and_mesh_groups(s, of_names, changes->are_names_shared && !refused->status, error);
    if ((are_cells_changed || of_names) && !status)
        status = session_check_vertex_order(&s->meshes, &s->catalogue, team, &s->report, error);
    if (!status) status = subdivide_higher_order_cells(s, moment, &are_cells_changed, error);
    if (are_cells_changed && !status) status = session_update_space(&s->space, &s->meshes, team->comm, error);
    if (!status) session_check_warps(scene, &s->catalogue, &s->report);
    return status ? status : session_check_mirrors(scene, &s->meshes, &s->catalogue, team, &s->report, error);
}

/* Updates the catalogue after a phase has failed because it found invalid values and stored the error with their field.
 * Only what uses this field is left out of the step then. *error is cleared; *refused keeps the first error.
 * Collective. */
static insitu_status exclude_invalid_field(insitu_session *s, base_error *refused, base_error *error)
{
    if (!refused->status) *refused = *error;
    *error = (base_error){0};
    session_restore_excluded(&s->meshes);
    return update_catalogue_and_mesh_groups(s, true, false, error);
}

/* A phase that reads values of fields, and may therefore find that they are invalid. Collective. */
typedef insitu_status phase_function(insitu_session *s, void *of, base_error *error);

/* Runs a phase, again without each field that it finds to be invalid. It also ends if the phase fails twice with the
 * same error, which then is not that of a field. Collective. */
static insitu_status run_phase_without_invalid_fields(insitu_session *s, phase_function *phase, void *of,
                                                      base_error *refused, base_error *error)
{
    base_error last = {.status = INSITU_OK};
    insitu_status status = phase(s, of, error);
    while ((status == INSITU_ERROR_FIELD || status == INSITU_ERROR_ARGUMENT) &&
           strcmp(error->message, last.message) != 0) {
        last = *error;
        status = exclude_invalid_field(s, refused, error);
        if (!status) status = phase(s, of, error);
    }
    return status;
}

/* The input of read_statistics_and_condition_fields(), and its result `valid`. */
typedef struct event_phase {
    const session_plan_basis *basis;
    bool images;
    session_valid_events valid;
    base_error *error; /* receives the first error of a field that does not exist or has an error */
} event_phase;

/* Reads the fields of the step's statistics and conditions, and computes those that are derived. All ranks return the
 * same status. Collective. */
static insitu_status read_statistics_and_condition_fields(insitu_session *s, void *of, base_error *error)
{
    event_phase *phase = of;
    const scene *scene = phase->basis->scene;
    const int64_t cycle = phase->basis->moment->cycle;
    const uint64_t needed = session_find_derived_fields_of_events(scene, cycle, phase->images);
    const session_derive_basis basis = make_derive_basis(s);
    phase->valid = session_check_event_fields(phase->basis, phase->images, phase->error);
    session_mark_source_fields(scene, needed, &s->meshes);
    const insitu_status status =
        session_read_event_fields(scene, &s->meshes, &s->catalogue, &s->team, cycle, &phase->valid, error);
    return status ? status : session_compute_derived(&basis, needed, error);
}

/* Computes the statistics that are due, and determines the images whose conditions hold. If one of them fails, the
 * others are still computed and images are still drawn; the error is returned afterwards. Collective. */
static void update_statistics_and_conditions(insitu_session *s, session_plan_basis *basis, base_error *error)
{
    const session_moment *moment = basis->moment;
    const session_event_time now = {moment->cycle, moment->time};
    const bool images = session_count_due_images(basis->scene, moment) > 0;
    s->events.held_conditions = 0;
    if (session_are_any_statistics_needed(basis->scene, moment->cycle, images)) {
        base_error own = {.status = INSITU_OK};
        event_phase phase = {.basis = basis, .images = images, .error = error};
        if (!run_phase_without_invalid_fields(s, read_statistics_and_condition_fields, &phase, error, &own))
            session_process_statistics_of_step(&s->events, basis->scene, &s->meshes, basis->catalogue, basis->extent,
                                               &s->team, &now, &phase.valid, &s->report, &own);
        if (!error->status) *error = own;
    }
    basis->allowed_images = session_find_drawable_images(&s->events, basis->scene);
}

/* Makes the meshes discontinuous whose fields at corners the scene uses (session_discontinuous.h). Collective. */
static insitu_status make_meshes_discontinuous(insitu_session *s, void *of, base_error *error)
{
    (void)of;
    return session_make_discontinuous(&s->meshes, &s->catalogue, &s->scene_file.scene, &s->team, error);
}

/* The input of plan_images(), and its result `plan`. */
typedef struct plan_phase {
    const session_plan_basis *basis;
    session_plan *plan;
} plan_phase;

/* Makes the step's plan: the images to draw and the data that they need (session_plan.h). Then computes the derived
 * fields and the values averaged at vertices that these images need. Collective. */
static insitu_status plan_images(insitu_session *s, void *of, base_error *error)
{
    const plan_phase *phase = of;
    const session_team *team = &s->team;
    const session_extent *extent = &s->space.extent;
    const session_derive_basis derived = make_derive_basis(s);
    session_plan *plan = phase->plan;
    session_plan_free(plan);
    insitu_status status = session_make_plan(phase->basis, &s->meshes, team, &s->report, plan, error);
    if (!status)
        status =
            session_compute_derived(&derived, session_find_derived_fields_of_plan(&s->scene_file.scene, plan), error);
    if (!status &&
        (plan->recentring_count || plan->surface_count || session_plan_has_smooth_normals(plan, &s->catalogue)))
        status = session_update_home_ranks(&s->catalogue, &s->meshes, extent->half_diagonal, team, error);
    if (!status)
        status = session_recentre(plan->recentrings, plan->recentring_count, plan->stale, &s->meshes, team, error);
    return status;
}

/* Performs the phases of a step in which images, statistics or conditions are due. Only data that the plan uses is
 * computed. refused: the error of a failed insitu_set_*() call; if there is none, receives the first error of a mesh or
 * field that this step finds. Images that do not use a mesh or field with an error are drawn, and *refused is returned
 * afterwards. */
static insitu_status draw_due_images(insitu_session *s, const session_changes *changes, const session_moment *moment,
                                     base_error *refused, base_error *error)
{
    const double start = MPI_Wtime();
    const session_team *team = &s->team;
    const session_extent *extent = &s->space.extent;
    session_plan_basis basis = {&s->scene_file.scene, s->scene_file.path,         moment, 0, &s->catalogue, extent,
                                changes->is_filled,   s->kept_pictures.is_enabled};
    base_error of_events = {.status = INSITU_OK};
    const session_drawing drawing = {
        .team = team,
        .scene_path = s->scene_file.path,
        .cycle = changes->cycle,
        .meshes = &s->meshes,
        .parent = &s->trees.parent,
        .space = &s->space,
        .run_ranges = &s->run_ranges,
        .report = &s->report,
        .kept = &s->kept_pictures,
        .scene = basis.scene,
        .cinema = &s->cinema,
        .montages = &s->montages,
        .overwrites = &s->overwrites,
        .writer = &s->writer,
        .catalogue = &s->catalogue,
        .writes_behind = changes->writes_behind,
    };
    session_plan plan = {0};
    insitu_status status = update_meshes(s, changes, moment, refused, error);
    if (!status) status = run_phase_without_invalid_fields(s, make_meshes_discontinuous, NULL, refused, error);
    if (!status) update_statistics_and_conditions(s, &basis, &of_events);
    if (!status)
        status = run_phase_without_invalid_fields(s, plan_images, &(plan_phase){&basis, &plan}, refused, error);
    if (!status && refused->status) plan.refusal = *refused;
    if (!status) status = session_find_smooth_gradients(&plan, &s->catalogue, &s->meshes, team, extent, error);
    if (!status) session_find_changed_values(&s->meshes, team->threads, &s->report);
    if (!status && plan.slice_count) session_update_distances(&s->meshes, team, error);
    if (!status && plan.surface_count) status = session_update_surfaces(&plan, &s->catalogue, &s->meshes, team, error);
    s->report.public_report.prepare_ms = get_milliseconds_since(start);
    /* a phase above may have stored an error in *error without returning it; the next session_agree() returns it on all
     * ranks */
    if (!status) {
        if (!error->status)
            session_update_trees(&s->trees, &s->meshes, &s->space, basis.scene->tree, team, &s->report.public_report,
                                 error);
        status = session_warn_of_empty_layers(&plan, &s->catalogue, &s->meshes, team, &s->report, error);
    }
    if (!status) status = session_draw_images(&drawing, &plan, &s->events.drawn_images, error);
    session_plan_free(&plan);
    session_restore_excluded(&s->meshes);
    if (!status) *error = of_events;
    return error->status;
}

/* Performs all phases of a step after the first reduction; draws images if any are due. */
static insitu_status run_phases_of_step(insitu_session *s, session_changes *changes, const session_guard *guard,
                                        base_error *error)
{
    s->report.public_report.time = changes->time;
    if (changes->is_scene_changed) {
        reload_scene(s, changes);
        s->news.is_new = true;
    }
    if (s->team.rank == 0) s->report.public_report.write_ms += session_writer_begin(&s->writer, &s->scene_file.scene);
    session_store_first_cinema_cycle(&s->cinema, changes->cycle);
    base_error refused = {.status = INSITU_OK};
    insitu_status status = session_check_errors_and_cycle(changes, &s->meshes, &s->team, &refused, error);
    const session_moment moment = {changes->cycle, changes->time, s->last_time, !s->has_stepped};
    s->has_stepped = true;
    s->last_time = changes->time;
    if (!status) session_record_cycle(&s->events, changes->cycle);
    const bool are_images_due = session_count_due_images(&s->scene_file.scene, &moment) > 0;
    if (status) return status;
    if (!(are_images_due || session_are_any_statistics_needed(&s->scene_file.scene, moment.cycle, false))) {
        *error = refused;
        return error->status;
    }
    select_lowest_instruction_set(changes, &s->report);
    status =
        session_prepare_threads(&s->threads, &s->team, s->scene_file.scene.threads,
                                changes->needs_more_threads || changes->is_scene_changed, guard, &s->report, error);
    if (status) return status;
    return draw_due_images(s, changes, &moment, &refused, error);
}

/* Stores in *error, on all ranks, the error of pictures of earlier steps that could not be written. Must be called only
 * if this step has no error of its own. Collective. */
static insitu_status share_error_of_unwritten_pictures(insitu_session *s, base_error *error)
{
    base_error told = {.status = INSITU_OK};
    if (s->team.rank == 0) told = session_writer_take_failure(&s->writer);
    session_broadcast_error(s->team.comm, 0, &told);
    *error = told;
    return error->status;
}

/* Passes the text of report.json (session_news.h) to the writer. Called on rank 0 only. If queuing the text fails, a
 * later step returns the error; if memory for the text runs out, the file is not written. */
static void queue_report_json(insitu_session *s)
{
    const session_scene_file *file = &s->scene_file;
    const session_news_scene source = {&file->scene, file->path, file->has_stamp ? &file->stamp : NULL,
                                       s->report.pieces.size ? s->report.pieces.data : NULL, file->warning};
    if (s->team.rank != 0 || file->scene.database_count == 0) return;
    session_record_step_messages(&s->news, &s->report, &s->error);
    if (!s->news.is_new) return;
    session_files *files = base_calloc(1, sizeof *files);
    char *text = files ? session_compose_report_json(&s->news, &source, &s->report.public_report) : NULL;
    if (!text) {
        base_free(files);
        return;
    }
    base_error error = {.status = INSITU_OK};
    *files = (session_files){.scene = &file->scene, .news = text};
    files->moment.cycle = s->report.public_report.cycle;
    session_writer_queue(&s->writer, files, &error);
    session_writer_record_error(&s->writer, s->report.public_report.cycle, &error);
}

insitu_status insitu_step(insitu_session *session, int64_t cycle, double time)
{
    if (!session || session_refuse_call_in_fill(&session->meshes, "insitu_step")) return INSITU_ERROR_ARGUMENT;
    session->error = (base_error){0};
    if (session_require_mpi("insitu_step", &session->error)) return session->error.status;
    session_guard guard;
    session_guard_save_settings(&guard);
    const double start = MPI_Wtime();
    session_free_kept_pictures(&session->kept_pictures);
    session_report_begin(&session->report, cycle, time);
    session_changes changes;
    session_writer_collect_results(&session->writer, &session->report);
    warn_of_instruction_set_setting(&session->team, &session->report);
    if (session->has_stepped && session->team.rank == 0)
        session_warn_of_unused_parameters(&session->scene_file.scene, &session->requested_parameters, &session->report);
    insitu_status status = session_reduce_changes_over_ranks(session, cycle, time, &changes, &session->error);
    if (!status && changes.reporting_rank >= 0)
        status = session_broadcast_warnings(&session->report, changes.reporting_rank, &session->team, &session->error);
    if (!status) {
        status = run_phases_of_step(session, &changes, &guard, &session->error);
        session_drop_pending(&session->meshes);
        if (!status && changes.has_unwritten_pictures)
            status = share_error_of_unwritten_pictures(session, &session->error);
    }
    queue_report_json(session);
    session_add_mesh_data_to_report(&session->meshes, &session->trees.parent, &session->writer,
                                    session->scene_file.warning, &session->report);
    session_release_filled_arrays(&session->meshes);
    session->report.public_report.total_ms = get_milliseconds_since(start);
    session_guard_restore_settings(&guard);
    return status;
}
