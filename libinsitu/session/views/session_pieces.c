/* Chooses the number of linear pieces between two neighbouring nodes of cells of higher order. The error of the pieces
 * decreases with the square of this number. Therefore each rank computes the largest error, in pixels, that its cells
 * have with one piece between two nodes, one reduction finds the maximum over all ranks, and the number of pieces is
 * computed from this maximum. All cells of a mesh have the same number, so that the pieces of neighbouring cells fit
 * together.
 *
 * The number does not depend on the partition: the error of a cell depends only on the cell's own nodes, cameras fit
 * the bounds of all nodes, and the memory is the sum over all ranks. The set of refined cells does not depend on the
 * partition either, because it is determined by the cells' own values and positions. */
#include "session_pieces.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_deviation.h"
#include "session_distances.h"
#include "session_filled.h"
#include "session_indexed.h"
#include "session_interpolation.h"
#include "session_outer_cells.h"
#include "session_piece_set.h"
#include "session_volume_errors.h"

static const double bytes_per_mib = 1048576;

/* ---- errors of the pieces ---------------------------------------------------------------------------------------- */

/* The errors of the linear pieces of one mesh, and the data from which its number of pieces between two nodes is
 * chosen. */
typedef struct piece_error {
    bool needs_all; /* set if all cells are refined (session_error_requests); the same on every rank */
    /* true: a due image shows the mesh, or the scene gives a fixed number of pieces for all cells; the same on every
     * rank */
    bool is_shown;
    /* results of measuring all requests of the mesh, combined: the largest error, and the number of cells that
     * isosurfaces may cross */
    session_deviation all;
    /* indexed by the number of pieces between two nodes: bytes that the pieces and nodes of refined cells take on all
     * ranks */
    session_finer_bytes bytes[FINER_MOST_PARTS + 1];
    /* largest estimated error of a pixel that shows a volume, if cells have one piece between two nodes */
    double light_error;
    /* largest ratio of a volume's estimated error to the error that the scene allows for this volume */
    double light_excess;
    int volume_count; /* number of volumes whose errors were estimated */
    int components;   /* number of components of the fields that images of the scene show */
    int wanted;       /* number of pieces between two nodes that would be chosen if memory were not limited */
} piece_error;

/* The task of measuring the errors of one mesh, or of selecting its pieces. */
typedef struct mesh_work {
    const session_pieces_basis *basis;
    session_finer_choice *choice;
    /* true: only the cells to be refined are marked, because the number of pieces does not depend on errors */
    bool marks_only;
    session_error_requests requests;
    piece_error *out;
} mesh_work;

/* The task of applying one request to one part of a mesh: measuring the part's errors, or selecting the pieces that the
 * request needs. */
typedef struct part_work {
    const mesh_work *of;
    const session_mesh *mesh;
    session_deviation_request request;
    session_piece_set *pieces; /* receives the pieces that the request needs; NULL: the errors are measured instead */
} part_work;

static insitu_status measure_error_or_select_pieces(part_work *work, base_error *error)
{
    const mesh_work *w = work->of;
    const int threads = w->basis->team->threads;
    if (!work->pieces)
        return session_measure_linearization_error(work->mesh, &work->request, threads, &w->out->all, error);
    return session_add_crossed_pieces(work->mesh, &work->request, w->choice->parts, threads, work->pieces, error);
}

static insitu_status apply_request_to_node_values(void *of, const session_node_values *values, base_error *error)
{
    part_work *work = of;
    work->request.values = values;
    return measure_error_or_select_pieces(work, error);
}

static void apply_error_request_to_part(part_work *work, const session_error_request *request, base_error *error)
{
    static const double zero = 0;
    const mesh_work *w = work->of;
    work->request.component = request->component;
    work->request.isovalues = (session_isovalues){request->value_count, request->values, 0};
    work->request.plane = request->has_plane ? &request->plane : NULL;
    work->request.pixels = (session_pixels){request, session_find_smallest_pixel_size};
    work->request.is_lobatto = w->choice->is_lobatto;
    work->request.marks_only = w->marks_only;
    work->request.values = NULL;
    /* a slice is the isosurface of distance 0 from its plane. The tolerance is positive, because a slice on the border
     * of the data may be drawn slightly shifted (session_choose_slice_isovalue()) */
    if (request->has_plane)
        work->request.isovalues =
            (session_isovalues){1, &zero, 2 * SESSION_BORDER_SHARE * request->views->extent.half_diagonal};
    const int field = request->field ? session_find_field(work->mesh, request->field) : -1;
    if (!request->field) measure_error_or_select_pieces(work, error);
    if (field >= 0) session_pass_node_values(work->mesh, field, apply_request_to_node_values, work, error);
}

static void measure_errors_of_part(const mesh_work *w, const session_mesh *mesh, session_cell_marks *marks,
                                   base_error *error)
{
    unsigned char *cells = marks ? marks->cells : NULL;
    part_work work = {.of = w, .mesh = mesh, .request = {.marks = cells}};
    if (marks && w->requests.needs_outer) work.request.measured = mesh->finer.outer_faces;
    for (int n = 0; n < w->requests.count && !error->status; n++) {
        const session_error_request *request = &w->requests.items[n];
        if (request->is_shown && !request->volume && (!w->marks_only || marks))
            apply_error_request_to_part(&work, request, error);
    }
    for (int64_t cell = 0; work.request.measured && cell < session_get_mesh_of_caller_nodes(mesh)->cell_count; cell++)
        if (work.request.measured[cell]) cells[cell] = 1;
    session_count_finer_bytes(mesh, cells, w->out->bytes);
}

/* Adds to the part's set of pieces those pieces of refined cells that the requests need. */
static void select_needed_pieces_of_part(const mesh_work *w, const session_mesh *mesh, session_cell_marks *marks,
                                         base_error *error)
{
    part_work work = {.of = w, .mesh = mesh, .pieces = &marks->pieces};
    session_begin_piece_set(mesh, marks->cells, w->choice->parts, work.pieces, error);
    for (int n = 0; n < w->requests.count && !error->status; n++) {
        const session_error_request *request = &w->requests.items[n];
        if (request->is_shown && (request->field || request->has_plane))
            apply_error_request_to_part(&work, request, error);
    }
    if (w->requests.needs_outer && !error->status) session_add_outer_pieces(mesh, w->choice->parts, work.pieces, error);
}

/* Measures the errors in all parts of a mesh. If the number of pieces has been chosen already, selects the pieces of
 * refined cells instead. */
static void measure_or_choose_parts(const mesh_work *w, const char *name, base_error *error)
{
    const session_parts parts = session_find_parts(w->basis->meshes, name);
    const bool is_chosen = w->choice->parts > 1;
    if (!is_chosen && !w->requests.needs_all && !session_allocate_cell_marks(w->choice, &parts))
        session_fail_for_memory(error, parts.count, "marks of cells of higher order");
    for (int i = 0; i < parts.count && !error->status; i++) {
        const session_mesh *mesh = parts.items[i];
        if (!mesh->is_given || !mesh->topology.is_split) continue;
        if (is_chosen)
            select_needed_pieces_of_part(w, mesh, &w->choice->marks[i], error);
        else
            measure_errors_of_part(w, mesh, session_get_marks_of_part(w->choice, i), error);
    }
}

static void measure_or_choose_mesh(const session_pieces_basis *basis, const session_due_views *views, int mesh,
                                   session_finer_choice *choice, piece_error *out, session_report *report,
                                   base_error *error)
{
    const scene *scene = basis->scene;
    mesh_work *w = base_alloc(sizeof *w);
    if (w) {
        w->basis = basis;
        w->choice = choice;
        w->marks_only = scene->finer_pieces > 0;
        w->out = out;
        session_list_error_requests(scene, views, &basis->catalogue->meshes[mesh], choice->shell_count > 0,
                                    &w->requests, scene->is_surface_error_given ? report : NULL);
        out->needs_all = w->requests.needs_all;
        out->is_shown = w->requests.is_shown || (w->marks_only && w->requests.needs_all);
        if (w->requests.is_complete) measure_or_choose_parts(w, basis->catalogue->meshes[mesh].name, error);
    }
    if (!w || !w->requests.is_complete) session_fail_for_memory(error, sizeof *w, "bounds of isosurfaces");
    if (w) session_free_error_requests(&w->requests);
    base_free(w);
}

/* Calls the caller's functions that fill the values of fields, for those fields that isosurfaces and volumes show. If
 * such a function fails, its field is not measured, and the error is returned later, when the step's plan is made.
 * Local, but these functions may communicate. */
static void call_fill_functions_of_shown_fields(const session_pieces_basis *basis, const session_due_views *views)
{
    base_error unheard = {.status = INSITU_OK};
    for (int i = 0; i < views->count; i++) {
        const scene_image *image = &basis->scene->images[i];
        for (int layer = 0; views->are_due[i] && layer < image->isosurface_count; layer++)
            session_mark_field_for_statistics(basis->meshes, &image->isosurfaces[layer].field);
        for (int layer = 0; views->are_due[i] && layer < image->volume_count; layer++)
            session_mark_field_for_statistics(basis->meshes, &image->volumes[layer].field);
    }
    session_fill_fields(basis->meshes, basis->catalogue, false, &unheard);
    session_clear_statistics_marks(basis->meshes);
}

/* Values of one mesh that are summed over the ranks. cell_count: number of cells that isosurfaces may cross;
 * unbounded_count: number of these cells whose bound was replaced by a limit; area: estimated area of the isosurfaces,
 * in sixteenths of a pixel (session_deviation). */
typedef struct piece_sums {
    int64_t cell_count, unbounded_count, area;
    session_finer_bytes bytes[FINER_MOST_PARTS + 1];
} piece_sums;

static insitu_status reduce_errors_over_ranks(piece_error *errors, int count, MPI_Comm comm, base_error *error)
{
    enum { WORDS = sizeof(piece_sums) / sizeof(int64_t) };
    double *most = base_calloc((size_t)count + 1, sizeof *most);
    piece_sums *sums = base_calloc((size_t)count + 1, sizeof *sums);
    if (!most || !sums) session_fail_for_memory(error, count * (int64_t)sizeof *sums, "bounds of isosurfaces");
    insitu_status status = session_agree(comm, error);
    for (int m = 0; m < count && !status; m++) {
        most[m] = errors[m].all.error;
        sums[m] = (piece_sums){.cell_count = errors[m].all.cell_count,
                               .unbounded_count = errors[m].all.unbounded_count,
                               .area = errors[m].all.area};
        memcpy(sums[m].bytes, errors[m].bytes, sizeof sums[m].bytes);
    }
    if (!status)
        status = session_check_mpi(error, MPI_Allreduce(MPI_IN_PLACE, most, count, MPI_DOUBLE, MPI_MAX, comm),
                                   "MPI_Allreduce");
    if (!status)
        status = session_check_mpi(error, MPI_Allreduce(MPI_IN_PLACE, sums, WORDS * count, MPI_INT64_T, MPI_SUM, comm),
                                   "MPI_Allreduce");
    for (int m = 0; m < count && !status; m++) {
        errors[m].all.error = most[m];
        errors[m].all.cell_count = sums[m].cell_count;
        errors[m].all.unbounded_count = sums[m].unbounded_count;
        errors[m].all.area = sums[m].area;
        memcpy(errors[m].bytes, sums[m].bytes, sizeof sums[m].bytes);
    }
    base_free(most);
    base_free(sums);
    return status;
}

/* Estimates the errors of the volumes on one mesh. Collective. */
static insitu_status estimate_volume_errors_of_mesh(const session_pieces_basis *basis, const session_due_views *views,
                                                    int mesh, const session_finer_choice *choice,
                                                    const session_value_ranges *ranges, piece_error *out,
                                                    base_error *error)
{
    const session_catalogue_mesh *named = &basis->catalogue->meshes[mesh];
    const session_parts parts = session_find_parts(basis->meshes, named->name);
    session_error_requests *requests = base_alloc(sizeof *requests);
    if (requests) session_list_error_requests(basis->scene, views, named, choice->shell_count > 0, requests, NULL);
    if (!requests || !requests->is_complete) session_fail_for_memory(error, sizeof *requests, "errors of volumes");
    session_agree(basis->team->comm, error);
    for (int n = 0; !error->status && n < requests->count; n++) {
        const session_error_request *request = &requests->items[n];
        double own = 0;
        if (!request->volume) continue;
        session_estimate_volume_error(request, ranges, &parts, choice->is_lobatto, basis->team, &own, error);
        out->volume_count++;
        out->light_error = fmax(out->light_error, own);
        out->light_excess = fmax(out->light_excess, own / request->allowed);
    }
    if (requests) session_free_error_requests(requests);
    base_free(requests);
    return error->status;
}

/* Estimates the errors of all volumes on meshes with cells of higher order. Collective. */
static insitu_status estimate_volume_errors_of_all_meshes(const session_pieces_basis *basis,
                                                          const session_due_views *views,
                                                          const session_finer_choice *choices, piece_error *errors,
                                                          base_error *error)
{
    session_value_ranges ranges;
    bool is_any = false;
    for (int i = 0; i < views->count; i++)
        is_any = is_any || (views->are_due[i] && basis->scene->images[i].volume_count > 0);
    if (!is_any || basis->scene->finer_pieces) return INSITU_OK;
    insitu_status status = session_find_volume_ranges(basis->scene, views, basis->meshes, basis->team, &ranges, error);
    for (int m = 0; m < basis->catalogue->mesh_count && !status; m++)
        if (choices[m].order > 1 && !choices[m].excluded_count)
            status = estimate_volume_errors_of_mesh(basis, views, m, &choices[m], &ranges, &errors[m], error);
    session_free_volume_ranges(&ranges);
    return status;
}

/* Returns whether a due image shows the outer surface of a mesh. */
static bool is_outer_surface_shown(const session_due_views *views, const char *mesh)
{
    for (int i = 0; i < views->count; i++) {
        const scene_image *image = &views->scene->images[i];
        for (int layer = 0; views->are_due[i] && layer < image->surface_count; layer++)
            if (scene_field_selects_mesh(&image->surfaces[layer].meshes_field, mesh)) return true;
    }
    return false;
}

/* Finds the outer faces of the meshes whose outer surfaces are shown. Collective. */
static insitu_status find_cells_at_shown_outer_surfaces(const session_pieces_basis *basis,
                                                        const session_due_views *views,
                                                        const session_finer_choice *choices, base_error *error)
{
    insitu_status status = INSITU_OK;
    if (basis->are_cells_changed) session_forget_outer_cells(basis->meshes);
    for (int m = 0; m < basis->catalogue->mesh_count && !status; m++) {
        const char *name = basis->catalogue->meshes[m].name;
        const session_parts parts = session_find_parts(basis->meshes, name);
        if (choices[m].order > 0 && !choices[m].excluded_count && is_outer_surface_shown(views, name))
            status = session_find_outer_cells(&parts, basis->team, error);
    }
    return status;
}

static insitu_status find_errors_of_all_meshes(const session_pieces_basis *basis, const session_due_views *views,
                                               session_finer_choice *choices, piece_error *errors,
                                               session_report *report, base_error *error)
{
    if (find_cells_at_shown_outer_surfaces(basis, views, choices, error)) return error->status;
    call_fill_functions_of_shown_fields(basis, views);
    for (int m = 0; m < basis->catalogue->mesh_count && !error->status; m++)
        if (choices[m].order > 0 && !choices[m].excluded_count)
            measure_or_choose_mesh(basis, views, m, &choices[m], &errors[m], report, error);
    if (reduce_errors_over_ranks(errors, basis->catalogue->mesh_count, basis->team->comm, error)) return error->status;
    return estimate_volume_errors_of_all_meshes(basis, views, choices, errors, error);
}

/* Selects the linear pieces to make in those meshes in which only some cells are refined. */
static insitu_status select_pieces_of_partly_refined_meshes(const session_pieces_basis *basis,
                                                            const session_due_views *views,
                                                            session_finer_choice *choices, piece_error *errors,
                                                            base_error *error)
{
    for (int m = 0; m < basis->catalogue->mesh_count && !error->status; m++)
        if (choices[m].parts > 1 && choices[m].mark_count > 0)
            measure_or_choose_mesh(basis, views, m, &choices[m], &errors[m], NULL, error);
    return session_agree(basis->team->comm, error);
}

/* ---- choice of the number of pieces ------------------------------------------------------------------------------ */

/* Returns the allowed error of surfaces, in pixels. By default it is smaller for small isosurfaces, for the following
 * reason. A ray misses an isosurface if a silhouette or a border of the surface is displaced across the ray. The share
 * of the surface's pixels whose rays do so is the mean displacement of silhouettes and borders, times their length,
 * divided by the area of the surface. Their length grows only with the square root of the area. On brackets that gmsh
 * made, the mean displacement was at most 1/18 of the error bound, and the length at most 8 times the root of the area,
 * in pixels. With an error bound of 1/640 of the root of the area, less than 0.1 % of the surface's pixels are missed.
 */
static double compute_allowed_surface_error(const scene *scene, const piece_error *of)
{
    static const double least_share = 0.25;
    const double hits = (double)of->all.area / 16;
    if (scene->is_surface_error_given || of->all.area == 0) return scene->surface_error;
    return fmin(scene->surface_error, fmax(least_share * scene->surface_error, sqrt(hits) / 640));
}

/* Returns the smallest number of pieces with which the errors of surfaces and of volumes are within the allowed errors.
 * If all cells of a mesh are refined, memory and time grow with the cube of this number. In that case more than 2
 * pieces are chosen for the error of surfaces only if the scene gives surface_error, and at most 8 for the
 * error of volumes, which always need all cells. */
static int choose_smallest_piece_count(const scene *scene, const session_finer_choice *choice, const piece_error *of)
{
    enum { MOST_UNASKED = 2, MOST_FOR_VOLUMES = 8 };
    const bool is_limited = of->needs_all && !scene->is_surface_error_given;
    const int supported = session_find_max_edge_parts(choice), most = is_limited ? MOST_UNASKED : FINER_MOST_PARTS;
    const double allowed = compute_allowed_surface_error(scene, of);
    int parts = 1;
    while (parts < MOST_FOR_VOLUMES && parts < supported && of->light_excess > parts * parts) parts++;
    while (parts < most && parts < supported && of->all.error > allowed * parts * parts) parts++;
    return parts;
}

static void choose_fixed_piece_count(const char *mesh, const scene *scene, const piece_error *of,
                                     session_finer_choice *choice, session_report *report)
{
    const int wanted = scene->finer_pieces, most = session_find_max_edge_parts(choice);
    choice->parts = choice->excluded_count || !of->is_shown ? 1 : wanted < most ? wanted : most;
    session_warn(report, &(session_warning){WARNING_FINER, NULL, mesh, 1}, !choice->excluded_count && most < wanted,
                 "mesh \"%s\": it has cells of order %d, and so finer_pieces is %d on it instead of %d: at most %d "
                 "pieces along an edge of a cell are supported",
                 mesh, choice->order, most, wanted, NODES_MOST_ORDER);
}

static void choose_piece_count_by_error(const char *mesh, const scene *scene, const piece_error *of,
                                        session_finer_choice *choice, session_report *report)
{
    choice->parts = choice->excluded_count || choice->order < 2 ? 1 : choose_smallest_piece_count(scene, choice, of);
    const double met = of->all.error / (choice->parts * choice->parts);
    session_warn(
        report, &(session_warning){WARNING_FINER, NULL, mesh, 1},
        scene->is_surface_error_given && met > scene->surface_error,
        "mesh \"%s\": %d pieces between two nodes are the most that are supported: they are within %.2g pixels "
        "of the cells' polynomials, and surface_error is %g",
        mesh, choice->parts, met, scene->surface_error);
}

static void warn_of_unrefined_pyramids(const char *mesh, const scene *scene, const session_finer_choice *choice,
                                       session_report *report)
{
    const bool is_asked = scene->finer_pieces || scene->is_surface_error_given;
    session_warn(report, &(session_warning){WARNING_FINER, NULL, mesh, 0}, is_asked && choice->excluded_count > 0,
                 "mesh \"%s\": %lld of its cells are pyramids of an order above %d: %s has no effect on it, and its "
                 "cells are split at their own nodes",
                 mesh, (long long)choice->excluded_count, INTERPOLATION_MOST_PYRAMID,
                 scene->finer_pieces ? "finer_pieces" : "surface_error");
}

/* ---- limit of the memory ----------------------------------------------------------------------------------------- */

/* Returns the number of components of all fields of a mesh that images of the scene show. */
static int count_shown_field_components(const scene *scene, const session_catalogue_mesh *mesh)
{
    int count = 0;
    for (int f = 0; f < mesh->field_count; f++) {
        bool is_shown = false;
        for (int i = 0; i < scene->image_count && !is_shown; i++) {
            scene_field_walk walk = {.image = &scene->images[i]};
            for (const scene_field *field; !is_shown && (field = scene_find_next_field_of_layers(&walk)) != NULL;)
                is_shown =
                    strcmp(field->name, mesh->fields[f].name) == 0 && scene_field_selects_mesh(field, mesh->name);
        }
        if (is_shown) count += mesh->fields[f].component_count;
    }
    return count;
}

/* Returns the number of bytes that the pieces and nodes of a mesh's refined cells, and the values at these nodes, take
 * if there are `parts` pieces between two nodes. The result never decreases if `parts` increases. */
static double compute_finer_lattice_bytes(const piece_error *of, int parts)
{
    const session_finer_bytes *bytes = &of->bytes[parts];
    return (double)bytes->own + of->components * (double)bytes->per_component;
}

/* A possible step of reducing the memory of a mesh: from `parts` pieces between two nodes to `parts` - 1. `bytes` is
 * the memory that `parts` pieces take. */
typedef struct piece_step {
    double bytes;
    int mesh, parts;
} piece_step;

/* Sorts steps by decreasing bytes; if bytes are equal, by mesh, and within a mesh by decreasing number of pieces. */
static int compare_reductions_by_memory(const void *a, const void *b)
{
    const piece_step *x = a, *y = b;
    if (x->bytes != y->bytes) return x->bytes > y->bytes ? -1 : 1;
    return x->mesh != y->mesh ? x->mesh - y->mesh : y->parts - x->parts;
}

/* Reduces the numbers of pieces until the pieces of all meshes together take at most `limit` bytes. Of all meshes, the
 * mesh whose pieces take most memory is reduced first. steps: space for FINER_MOST_PARTS steps per mesh. Returns the
 * number of bytes before the reduction. */
static double reduce_piece_counts_to_memory_limit(int mesh_count, double limit, const piece_error *errors,
                                                  piece_step *steps, session_finer_choice *choices)
{
    double all = 0;
    int count = 0;
    for (int m = 0; m < mesh_count; m++) {
        all += compute_finer_lattice_bytes(&errors[m], choices[m].parts);
        for (int parts = choices[m].parts; parts > 1; parts--)
            steps[count++] = (piece_step){compute_finer_lattice_bytes(&errors[m], parts), m, parts};
    }
    if (!(all > limit)) return all;
    qsort(steps, (size_t)count, sizeof *steps, compare_reductions_by_memory);
    double sum = all;
    for (const piece_step *step = steps; step < steps + count && sum > limit; step++) {
        choices[step->mesh].parts = step->parts - 1;
        sum += compute_finer_lattice_bytes(&errors[step->mesh], step->parts - 1) - step->bytes;
    }
    return all;
}

static void limit_memory_of_refined_cells(const scene *scene, const session_catalogue *catalogue,
                                          const piece_error *errors, piece_step *steps, session_finer_choice *choices,
                                          session_report *report)
{
    const double all = reduce_piece_counts_to_memory_limit(catalogue->mesh_count, scene->finer_memory * bytes_per_mib,
                                                           errors, steps, choices);
    for (int m = 0; m < catalogue->mesh_count; m++)
        session_warn(report, &(session_warning){WARNING_FINER, NULL, catalogue->meshes[m].name, 2},
                     choices[m].parts < errors[m].wanted,
                     "mesh \"%s\": %d instead of %d pieces between two nodes: all finer pieces would take %.1f MiB on "
                     "all ranks, and finer_memory is %g",
                     catalogue->meshes[m].name, choices[m].parts, errors[m].wanted, all / bytes_per_mib,
                     scene->finer_memory);
}

/* ---- all meshes -------------------------------------------------------------------------------------------------- */

static void report_piece_count_and_error_bound(const char *mesh, const session_finer_choice *choice,
                                               const piece_error *of, session_report *report)
{
    char bound[100] = "without a bound", cells[160] = "", volumes[100] = "";
    if ((choice->parts > 1 || choice->is_completed || !choice->serendipity_count) && choice->order <= BOUND_MOST_ORDER)
        snprintf(bound, sizeof bound, "within %.3g pixels of the polynomials",
                 of->all.error / (choice->parts * choice->parts));
    if (of->all.cell_count)
        snprintf(cells, sizeof cells, "; isosurfaces may cross %lld cells, of which %lld have no bound",
                 (long long)of->all.cell_count, (long long)of->all.unbounded_count);
    if (of->volume_count)
        snprintf(volumes, sizeof volumes, "; pixels of volumes within %.2g by estimate",
                 of->light_error / (choice->parts * choice->parts));
    session_text_add(&report->pieces, "mesh \"%s\": %d piece%s between two nodes: %s%s%s", mesh, choice->parts,
                     choice->parts > 1 ? "s" : "", bound, cells, volumes);
}

static void choose_pieces_of_all_meshes(const session_pieces_basis *basis, piece_error *errors, piece_step *steps,
                                        session_finer_choice *choices, session_report *report)
{
    const scene *scene = basis->scene;
    const session_catalogue *catalogue = basis->catalogue;
    for (int m = 0; m < catalogue->mesh_count; m++) {
        const char *name = catalogue->meshes[m].name;
        if (!choices[m].order) continue;
        warn_of_unrefined_pyramids(name, scene, &choices[m], report);
        if (scene->finer_pieces)
            choose_fixed_piece_count(name, scene, &errors[m], &choices[m], report);
        else
            choose_piece_count_by_error(name, scene, &errors[m], &choices[m], report);
        errors[m].components = count_shown_field_components(scene, &catalogue->meshes[m]);
        errors[m].wanted = choices[m].parts;
    }
    limit_memory_of_refined_cells(scene, catalogue, errors, steps, choices, report);
    for (int m = 0; m < catalogue->mesh_count && !scene->finer_pieces; m++) {
        /* a serendipity cell lacks some nodes of the complete cell of its order. The error bound is valid only if these
         * nodes are added */
        choices[m].is_completed = errors[m].is_shown && choices[m].parts == 1 && choices[m].serendipity_count > 0;
        if (errors[m].is_shown)
            report_piece_count_and_error_bound(catalogue->meshes[m].name, &choices[m], &errors[m], report);
    }
}

insitu_status session_choose_higher_order_pieces(const session_pieces_basis *basis, session_finer_choice *choices,
                                                 session_report *report, base_error *error)
{
    const size_t count = (size_t)basis->catalogue->mesh_count + 1;
    piece_error *errors = base_calloc(count, sizeof *errors);
    piece_step *steps = base_calloc(count * FINER_MOST_PARTS, sizeof *steps);
    session_due_views views = {.count = 0};
    if (!errors || !steps)
        session_fail_for_memory(error, (int64_t)(count * (sizeof *errors + FINER_MOST_PARTS * sizeof *steps)),
                                "numbers of pieces");
    insitu_status status = session_agree(basis->team->comm, error);
    if (!status)
        status = session_compute_cameras_of_due_images(basis->scene, basis->moment, basis->meshes, basis->team->comm,
                                                       &views, error);
    if (!status) status = find_errors_of_all_meshes(basis, &views, choices, errors, report, error);
    if (!status) choose_pieces_of_all_meshes(basis, errors, steps, choices, report);
    if (!status) status = select_pieces_of_partly_refined_meshes(basis, &views, choices, errors, error);
    session_free_due_views(&views);
    base_free(errors);
    base_free(steps);
    return status;
}
