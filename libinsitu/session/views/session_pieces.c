/* The error of linear pieces falls with the square of their number. So each rank finds the largest error, in pixels,
 * that its cells have with one piece between two nodes, one reduction finds the largest of all ranks, and the number
 * follows from it. A mesh has one number, so that pieces of neighbours fit together.
 *
 * All that the number depends on is the same for any partition: cells' errors are those of their own nodes, cameras fit
 * the bounds of the nodes, and the memory is that of all ranks together. */
#include "session_pieces.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_camera.h"
#include "session_deviation.h"
#include "session_filled.h"
#include "session_indexed.h"
#include "session_scalars.h"
#include "vector3.h"

static const double bytes_per_mib = 1048576;

/* ---- cameras ----------------------------------------------------------------------------------------------------- */

/* The cameras of the due images. */
typedef struct piece_views {
    int count; /* number of images of the scene */
    bool *are_due;
    render_camera *cameras; /* of due images */
} piece_views;

static void free_views(piece_views *views)
{
    base_free(views->are_due);
    base_free(views->cameras);
}

/* Makes the cameras of the due images. A camera that has no direction of view is an error of the drawing of its image,
 * and is not due here. Collective. */
static insitu_status make_views(const session_pieces_basis *basis, piece_views *out, base_error *error)
{
    const scene *scene = basis->scene;
    session_extent extent = {.cell_count = 0};
    bool needs_extent = false;
    out->count = scene->image_count;
    out->are_due = base_calloc((size_t)out->count, sizeof *out->are_due);
    out->cameras = base_calloc((size_t)out->count, sizeof *out->cameras);
    if (!out->are_due || !out->cameras)
        session_fail_for_memory(error, out->count * (int64_t)sizeof *out->cameras, "cameras");
    if (session_agree(basis->team->comm, error)) return error->status;
    for (int i = 0; i < out->count; i++) {
        out->are_due[i] = session_is_due(&scene->images[i], basis->moment);
        needs_extent = needs_extent || (out->are_due[i] && scene->images[i].camera.is_automatic);
    }
    if (needs_extent && session_find_nodal_extent(basis->meshes, basis->team->comm, &extent, error))
        return error->status;
    for (int i = 0; i < out->count; i++) {
        scene_image placed = scene->images[i];
        placed.camera = scene_camera_at(&placed.camera, basis->moment->cycle, basis->moment->time);
        out->are_due[i] = out->are_due[i] && session_make_camera(&extent, &placed, &out->cameras[i]);
    }
    return INSITU_OK;
}

/* Returns a lower bound of the size of a pixel on a sphere; INFINITY if the camera does not see the sphere. In
 * perspective, a shift d at the distance z along the camera's axis and s from the eye is seen as one of at most
 * d s / z^2. Nearer than its radius a sphere counts as if it were its radius away. */
static double size_in_view(const render_camera *camera, const double centre[3], double radius)
{
    const double aspect = (double)camera->width / camera->height, half = camera->half_height;
    double to[3];
    for (int a = 0; a < 3; a++) to[a] = centre[a] - camera->eye[a];
    const double z = vector3_dot(to, camera->forward), right = fabs(vector3_dot(to, camera->right));
    const double up = fabs(vector3_dot(to, camera->up));
    if (z + radius < 0) return INFINITY;
    if (camera->is_orthographic)
        return right > half * aspect + radius || up > half + radius ? INFINITY : 2 * half / camera->height;
    if (right - z * half * aspect > radius * hypot(1, half * aspect) || up - z * half > radius * hypot(1, half))
        return INFINITY;
    const double near = fmax(z - radius, radius);
    return 2 * half * near * near / (camera->height * fmax(vector3_length(to) + radius, near));
}

/* ---- what images show of a mesh ---------------------------------------------------------------------------------- */

/* A field of whose isosurfaces, or a mesh of whose positions, the error is found. */
typedef struct piece_wish {
    const piece_views *views;
    bool *images; /* images that show it */
    bool is_shown;
    const char *field; /* NULL: the positions */
    int component;
    int value_count;
    double *values; /* isovalues */
} piece_wish;

enum { MOST_WISHES = 256 };

/* The first wish is that of the positions. */
typedef struct piece_wishes {
    int count;
    bool is_complete; /* set as long as memory has sufficed */
    piece_wish items[MOST_WISHES];
} piece_wishes;

static double find_pixel_size(const void *of, const double centre[3], double radius)
{
    const piece_wish *wish = of;
    double least = INFINITY;
    for (int i = 0; i < wish->views->count; i++)
        if (wish->images[i]) least = fmin(least, size_in_view(&wish->views->cameras[i], centre, radius));
    return least;
}

static void free_wishes(piece_wishes *wishes)
{
    for (int i = 0; i < wishes->count; i++) {
        base_free(wishes->items[i].images);
        base_free(wishes->items[i].values);
    }
}

/* Returns the wish of a field, or of the positions if it is NULL. Further fields than there is space for count as
 * positions. */
static piece_wish *find_wish(piece_wishes *wishes, const piece_views *views, const char *field, int component)
{
    for (int i = 0; i < wishes->count; i++) {
        piece_wish *wish = &wishes->items[i];
        const bool is_same = field && wish->field && strcmp(field, wish->field) == 0 && wish->component == component;
        if (is_same || (!field && !wish->field)) return wish;
    }
    if (wishes->count == MOST_WISHES) return &wishes->items[0];
    piece_wish *wish = &wishes->items[wishes->count++];
    *wish = (piece_wish){.views = views, .field = field, .component = component};
    wish->images = base_calloc((size_t)views->count, sizeof *wish->images);
    wishes->is_complete = wishes->is_complete && wish->images;
    return wish;
}

static void show_in(piece_wishes *wishes, piece_wish *wish, int image)
{
    wish->is_shown = true;
    if (wishes->is_complete) wish->images[image] = true;
}

static void add_value(piece_wishes *wishes, piece_wish *wish, double value)
{
    for (int i = 0; i < wish->value_count; i++)
        if (wish->values[i] == value) return;
    double *values = base_realloc(wish->values, ((size_t)wish->value_count + 1) * sizeof *values);
    wishes->is_complete = wishes->is_complete && values;
    if (!values) return;
    values[wish->value_count++] = value;
    wish->values = values;
}

/* Returns whether the layer's field is a polynomial in each cell: the caller's values at nodes, or one component. */
static bool is_polynomial(const session_catalogue_mesh *mesh, const session_catalogue_field *field,
                          const scene_field *shown)
{
    return field->derived_index < 0 && field->centring != INSITU_CELL &&
           !session_is_recentred(shown, field->centring, mesh->is_refined) &&
           session_resolve_component(shown, field->component_count) >= 0;
}

static void add_isosurface(piece_wishes *wishes, const piece_views *views, const session_catalogue_mesh *mesh,
                           const scene_image *image, int index, int layer, session_report *report)
{
    const scene_isosurface *shown = &image->isosurfaces[layer];
    const session_catalogue_field *field =
        scene_field_is_on(&shown->field, mesh->name) ? session_catalogue_find(mesh, shown->field.name) : NULL;
    if (!field) return;
    const bool is_bounded = is_polynomial(mesh, field, &shown->field);
    piece_wish *wish = find_wish(wishes, views, is_bounded ? field->name : NULL,
                                 is_bounded ? session_resolve_component(&shown->field, field->component_count) : 0);
    show_in(wishes, wish, index);
    for (int i = 0; i < shown->value_count && wish->field && image->variant.view == 0; i++)
        add_value(wishes, wish, shown->values[i]);
    session_warn(report, &(session_warning){WARNING_PIECES, image->name, mesh->name, layer}, !is_bounded,
                 "image \"%s\": surface_error does not hold for the isosurface of \"%s\" on mesh \"%s\": only "
                 "components of fields at vertices and corners are polynomials, but not derived fields, magnitudes and "
                 "means",
                 image->name, field->name, mesh->name);
}

/* Returns whether a layer other than isosurfaces shows the mesh. */
static bool has_other_layers(const session_catalogue_mesh *mesh, const scene_image *image)
{
    bool is_any = false;
    for (int i = 0; i < image->volume_count; i++) {
        const scene_field *field = &image->volumes[i].field;
        is_any = is_any || (scene_field_is_on(field, mesh->name) && session_catalogue_find(mesh, field->name));
    }
    for (int i = 0; i < image->slice_count; i++) {
        const scene_field *field = &image->slices[i].field;
        is_any = is_any || (scene_field_is_on(field, mesh->name) && session_catalogue_find(mesh, field->name));
    }
    for (int i = 0; i < image->surface_count; i++)
        is_any = is_any || scene_field_is_on(&image->surfaces[i].meshes_field, mesh->name);
    return is_any;
}

static void list_wishes(const session_pieces_basis *basis, const piece_views *views, int mesh, piece_wishes *out,
                        session_report *report)
{
    const session_catalogue_mesh *of = &basis->catalogue->meshes[mesh];
    *out = (piece_wishes){.is_complete = true};
    piece_wish *positions = find_wish(out, views, NULL, 0);
    for (int i = 0; i < views->count; i++) {
        const scene_image *image = &basis->scene->images[i];
        if (!views->are_due[i]) continue;
        if (has_other_layers(of, image)) show_in(out, positions, i);
        for (int layer = 0; layer < image->isosurface_count; layer++)
            add_isosurface(out, views, of, image, i, layer, report);
    }
}

/* ---- errors ------------------------------------------------------------------------------------------------------ */

/* The errors of one mesh, and what follows from them. */
typedef struct piece_error {
    bool is_shown;         /* set if some due image shows the mesh; the same on every rank */
    session_deviation all; /* counts are those of isosurfaces */
    int components;        /* number of components of the fields that images of the scene show */
    int wanted;            /* number of pieces without a limit of memory */
} piece_error;

/* A part of a mesh that is being measured. */
typedef struct part_work {
    const session_mesh *mesh;
    session_deviation_wish wish;
    int threads;
    session_deviation *out;
} part_work;

static insitu_status measure_values(void *of, const session_node_values *values, base_error *error)
{
    part_work *work = of;
    work->wish.values = values;
    return session_measure_deviation(work->mesh, &work->wish, work->threads, work->out, error);
}

static void measure_part(const session_pieces_basis *basis, const session_mesh *mesh, const piece_wish *wish,
                         bool is_lobatto, session_deviation *out, base_error *error)
{
    const session_isovalues isovalues = {wish->value_count, wish->values};
    part_work work = {.mesh = mesh,
                      .wish = {.component = wish->component,
                               .isovalues = &isovalues,
                               .pixels = {wish, find_pixel_size},
                               .is_lobatto = is_lobatto},
                      .threads = basis->team->threads,
                      .out = out};
    if (!wish->is_shown || !mesh->is_given || !mesh->topology.is_split) return;
    const int field = wish->field ? session_find_field(mesh, wish->field) : -1;
    if (!wish->field) session_measure_deviation(mesh, &work.wish, work.threads, out, error);
    if (field >= 0) session_read_nodes(mesh, field, measure_values, &work, error);
}

static void measure_mesh(const session_pieces_basis *basis, const piece_views *views, int mesh, bool is_lobatto,
                         piece_error *out, session_report *report, base_error *error)
{
    piece_wishes *wishes = base_alloc(sizeof *wishes);
    const session_parts parts = session_find_parts(basis->meshes, basis->catalogue->meshes[mesh].name);
    if (wishes) list_wishes(basis, views, mesh, wishes, report);
    for (int w = 0; wishes && w < wishes->count; w++) {
        out->is_shown = out->is_shown || wishes->items[w].is_shown;
        for (int i = 0; i < parts.count && wishes->is_complete && !error->status; i++)
            measure_part(basis, parts.items[i], &wishes->items[w], is_lobatto, &out->all, error);
    }
    if (!wishes || !wishes->is_complete) session_fail_for_memory(error, sizeof *wishes, "bounds of isosurfaces");
    if (wishes) free_wishes(wishes);
    base_free(wishes);
}

/* Calls the fill functions of fields that isosurfaces show. If one fails, the field is not measured, and the plan
 * returns the error. Local, but fill functions may communicate. */
static void fill_fields(const session_pieces_basis *basis, const piece_views *views)
{
    base_error unheard = {.status = INSITU_OK};
    for (int i = 0; i < views->count; i++)
        for (int layer = 0; views->are_due[i] && layer < basis->scene->images[i].isosurface_count; layer++)
            session_want_field(basis->meshes, &basis->scene->images[i].isosurfaces[layer].field);
    session_fill_fields(basis->meshes, basis->catalogue, false, &unheard);
    session_want_no_fields(basis->meshes);
}

static insitu_status reduce_errors(piece_error *errors, int count, MPI_Comm comm, base_error *error)
{
    double *most = base_calloc((size_t)count + 1, sizeof *most);
    int64_t *sums = base_calloc(2 * (size_t)count + 1, sizeof *sums);
    if (!most || !sums) session_fail_for_memory(error, count * 24, "bounds of isosurfaces");
    insitu_status status = session_agree(comm, error);
    for (int m = 0; m < count && !status; m++) {
        most[m] = errors[m].all.error;
        sums[2 * m] = errors[m].all.cell_count;
        sums[2 * m + 1] = errors[m].all.unbounded_count;
    }
    if (!status)
        status = session_check_mpi(error, MPI_Allreduce(MPI_IN_PLACE, most, count, MPI_DOUBLE, MPI_MAX, comm),
                                   "MPI_Allreduce");
    if (!status)
        status = session_check_mpi(error, MPI_Allreduce(MPI_IN_PLACE, sums, 2 * count, MPI_INT64_T, MPI_SUM, comm),
                                   "MPI_Allreduce");
    for (int m = 0; m < count && !status; m++)
        errors[m].all = (session_deviation){most[m], sums[2 * m], sums[2 * m + 1]};
    base_free(most);
    base_free(sums);
    return status;
}

static insitu_status find_errors(const session_pieces_basis *basis, const session_finer_choice *choices,
                                 piece_error *errors, session_report *report, base_error *error)
{
    piece_views views = {.count = 0};
    insitu_status status = make_views(basis, &views, error);
    if (!status) fill_fields(basis, &views);
    for (int m = 0; m < basis->catalogue->mesh_count && !status; m++)
        if (choices[m].order > 1 && !choices[m].pyramid_count)
            measure_mesh(basis, &views, m, choices[m].is_lobatto, &errors[m], report, error);
    if (!status) status = reduce_errors(errors, basis->catalogue->mesh_count, basis->team->comm, error);
    free_views(&views);
    return status;
}

/* ---- numbers of pieces ------------------------------------------------------------------------------------------- */

/* Returns the smallest number of pieces with which the error is allowed. Serendipity cells have more than one, since
 * without finer lattices they are split in another way, of which no bound is known. */
static int find_pieces(const session_finer_choice *choice, const piece_error *of, double allowed)
{
    const int most = session_most_parts(choice);
    int parts = choice->serendipity_count && of->is_shown ? 2 : 1;
    while (parts < most && of->all.error > allowed * parts * parts) parts++;
    return parts;
}

static void choose_fixed(const char *mesh, const scene *scene, session_finer_choice *choice, session_report *report)
{
    const int wanted = scene->finer_pieces, most = session_most_parts(choice);
    choice->parts = choice->pyramid_count ? 1 : wanted < most ? wanted : most;
    session_warn(report, &(session_warning){WARNING_FINER, NULL, mesh, 1}, !choice->pyramid_count && most < wanted,
                 "mesh \"%s\": it has cells of order %d, and so finer_pieces is %d on it instead of %d: at most %d "
                 "pieces along an edge of a cell are supported",
                 mesh, choice->order, most, wanted, NODES_MOST_ORDER);
}

static void choose_by_error(const char *mesh, const scene *scene, const piece_error *of, session_finer_choice *choice,
                            session_report *report)
{
    choice->parts = choice->pyramid_count || choice->order < 2 ? 1 : find_pieces(choice, of, scene->surface_error);
    const double met = of->all.error / (choice->parts * choice->parts);
    session_warn(
        report, &(session_warning){WARNING_FINER, NULL, mesh, 1}, met > scene->surface_error,
        "mesh \"%s\": %d pieces between two nodes are the most that are supported: they are within %.2g pixels "
        "of the cells' polynomials, and surface_error is %g",
        mesh, choice->parts, met, scene->surface_error);
}

static void warn_of_pyramids(const char *mesh, const scene *scene, const session_finer_choice *choice,
                             session_report *report)
{
    session_warn(report, &(session_warning){WARNING_FINER, NULL, mesh, 0}, choice->pyramid_count > 0,
                 "mesh \"%s\": %lld of its cells are pyramids, whose polynomials are not known: %s has no effect on "
                 "it, and its cells are split at their own nodes",
                 mesh, (long long)choice->pyramid_count, scene->finer_pieces ? "finer_pieces" : "surface_error");
}

/* ---- memory ------------------------------------------------------------------------------------------------------ */

/* Returns the number of components of those fields of a mesh that images of the scene show. */
static int count_components(const scene *scene, const session_catalogue_mesh *mesh)
{
    int count = 0;
    for (int f = 0; f < mesh->field_count; f++) {
        bool is_shown = false;
        for (int i = 0; i < scene->image_count && !is_shown; i++) {
            scene_field_walk walk = {.image = &scene->images[i]};
            for (const scene_field *field; !is_shown && (field = scene_next_field(&walk)) != NULL;)
                is_shown = strcmp(field->name, mesh->fields[f].name) == 0 && scene_field_is_on(field, mesh->name);
        }
        if (is_shown) count += mesh->fields[f].component_count;
    }
    return count;
}

/* Returns the bytes that so many finer pieces of a mesh take. They grow with the number of pieces. */
static double find_bytes(const session_finer_choice *choice, const piece_error *of, int parts)
{
    return (double)choice->bytes[parts] + of->components * (double)choice->bytes_per_component[parts];
}

/* A number of pieces that a mesh may lose one of, and the bytes that they take. */
typedef struct piece_step {
    double bytes;
    int mesh, parts;
} piece_step;

/* Orders steps by decreasing bytes, and those of the same bytes by their meshes. */
static int compare_steps(const void *a, const void *b)
{
    const piece_step *x = a, *y = b;
    if (x->bytes != y->bytes) return x->bytes > y->bytes ? -1 : 1;
    return x->mesh - y->mesh;
}

/* Takes pieces from the mesh whose pieces need most memory, until those of all meshes fit. steps: space for
 * FINER_MOST_PARTS steps of each mesh. Returns the bytes before. */
static double take_pieces(int mesh_count, double limit, const piece_error *errors, piece_step *steps,
                          session_finer_choice *choices)
{
    double all = 0;
    int count = 0;
    for (int m = 0; m < mesh_count; m++) {
        all += find_bytes(&choices[m], &errors[m], choices[m].parts);
        for (int parts = choices[m].parts; parts > 1; parts--)
            steps[count++] = (piece_step){find_bytes(&choices[m], &errors[m], parts), m, parts};
    }
    if (!(all > limit)) return all;
    qsort(steps, (size_t)count, sizeof *steps, compare_steps);
    double sum = all;
    for (const piece_step *step = steps; step < steps + count && sum > limit; step++) {
        choices[step->mesh].parts = step->parts - 1;
        sum += find_bytes(&choices[step->mesh], &errors[step->mesh], step->parts - 1) - step->bytes;
    }
    return all;
}

static void limit_memory(const scene *scene, const session_catalogue *catalogue, const piece_error *errors,
                         piece_step *steps, session_finer_choice *choices, session_report *report)
{
    const double all = take_pieces(catalogue->mesh_count, scene->finer_memory * bytes_per_mib, errors, steps, choices);
    for (int m = 0; m < catalogue->mesh_count; m++)
        session_warn(report, &(session_warning){WARNING_FINER, NULL, catalogue->meshes[m].name, 2},
                     choices[m].parts < errors[m].wanted,
                     "mesh \"%s\": %d instead of %d pieces between two nodes: all finer pieces would take %.1f MiB on "
                     "all ranks, and finer_memory is %g",
                     catalogue->meshes[m].name, choices[m].parts, errors[m].wanted, all / bytes_per_mib,
                     scene->finer_memory);
}

/* ---- all meshes -------------------------------------------------------------------------------------------------- */

static void report_pieces(const char *mesh, const session_finer_choice *choice, const piece_error *of,
                          session_report *report)
{
    char bound[100] = "without a bound", cells[160] = "";
    if ((choice->parts > 1 || !choice->serendipity_count) && choice->order <= BOUND_MOST_ORDER)
        snprintf(bound, sizeof bound, "within %.3g pixels of the polynomials",
                 of->all.error / (choice->parts * choice->parts));
    if (of->all.cell_count)
        snprintf(cells, sizeof cells, "; isosurfaces may cross %lld cells, of which %lld have no bound",
                 (long long)of->all.cell_count, (long long)of->all.unbounded_count);
    session_text_add(&report->pieces, "mesh \"%s\": %d piece%s between two nodes: %s%s", mesh, choice->parts,
                     choice->parts > 1 ? "s" : "", bound, cells);
}

static void choose_all(const session_pieces_basis *basis, piece_error *errors, piece_step *steps,
                       session_finer_choice *choices, session_report *report)
{
    const scene *scene = basis->scene;
    const session_catalogue *catalogue = basis->catalogue;
    for (int m = 0; m < catalogue->mesh_count; m++) {
        const char *name = catalogue->meshes[m].name;
        if (!choices[m].order) continue;
        warn_of_pyramids(name, scene, &choices[m], report);
        if (scene->finer_pieces)
            choose_fixed(name, scene, &choices[m], report);
        else
            choose_by_error(name, scene, &errors[m], &choices[m], report);
        errors[m].components = count_components(scene, &catalogue->meshes[m]);
        errors[m].wanted = choices[m].parts;
    }
    limit_memory(scene, catalogue, errors, steps, choices, report);
    for (int m = 0; m < catalogue->mesh_count && !scene->finer_pieces; m++)
        if (errors[m].is_shown) report_pieces(catalogue->meshes[m].name, &choices[m], &errors[m], report);
}

insitu_status session_choose_pieces(const session_pieces_basis *basis, session_finer_choice *choices,
                                    session_report *report, base_error *error)
{
    const size_t count = (size_t)basis->catalogue->mesh_count + 1;
    piece_error *errors = base_calloc(count, sizeof *errors);
    piece_step *steps = base_calloc(count * FINER_MOST_PARTS, sizeof *steps);
    if (!errors || !steps)
        session_fail_for_memory(error, (int64_t)(count * (sizeof *errors + FINER_MOST_PARTS * sizeof *steps)),
                                "numbers of pieces");
    insitu_status status = session_agree(basis->team->comm, error);
    if (!status && !basis->scene->finer_pieces) status = find_errors(basis, choices, errors, report, error);
    if (!status) choose_all(basis, errors, steps, choices, report);
    base_free(errors);
    base_free(steps);
    return status;
}
