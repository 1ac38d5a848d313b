/* Determines which cells of higher order need finer pieces, that is, linear pieces that are smaller than the distance
 * between nodes. An isosurface or slice is drawn only from the pieces that it crosses. If an isovalue is outside the
 * range of the Bernstein coefficients of a cell, it is also outside the range of each of the cell's faces. The
 * isosurface then crosses none of these faces, however the cells on both sides are divided into pieces. Therefore only
 * cells that isosurfaces may cross need finer pieces.
 *
 * All cells need finer pieces in three cases: if faces of pieces are drawn, or are compared with faces of neighbouring
 * cells (outer surfaces, contours of shells); if rays pass from cell to cell (volumes); or if values at vertices are
 * means or derivatives over neighbouring cells. */
#include "session_error_requests.h"

#include <math.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_camera.h"
#include "session_distances.h"
#include "session_scalars.h"
#include "vector3.h"

/* ---- cameras ----------------------------------------------------------------------------------------------------- */

void session_free_due_views(session_due_views *views)
{
    base_free(views->are_due);
    base_free(views->cameras);
}

insitu_status session_compute_cameras_of_due_images(const scene *scene, const session_moment *moment,
                                                    const session_meshes *meshes, MPI_Comm comm, session_due_views *out,
                                                    base_error *error)
{
    bool needs_extent = false;
    *out = (session_due_views){.scene = scene, .count = scene->image_count};
    out->are_due = base_calloc((size_t)out->count, sizeof *out->are_due);
    out->cameras = base_calloc((size_t)out->count, sizeof *out->cameras);
    if (!out->are_due || !out->cameras)
        session_fail_for_memory(error, out->count * (int64_t)sizeof *out->cameras, "cameras");
    if (session_agree(comm, error)) return error->status;
    for (int i = 0; i < out->count; i++) {
        const scene_image *image = &scene->images[i];
        out->are_due[i] = session_is_image_due(image, moment);
        needs_extent =
            needs_extent ||
            (out->are_due[i] && (image->camera.is_automatic || image->slice_count > 0 || image->volume_count > 0));
    }
    if (needs_extent && session_find_nodal_extent(meshes, comm, &out->extent, error)) return error->status;
    for (int i = 0; i < out->count; i++) {
        scene_image placed = scene->images[i];
        placed.camera = scene_compute_camera_at_time(&placed.camera, moment->cycle, moment->time);
        out->are_due[i] = out->are_due[i] && session_make_camera(&out->extent, &placed, &out->cameras[i]);
    }
    return INSITU_OK;
}

/* Returns a lower bound of the size of a pixel on a sphere, in scene units; INFINITY if the camera does not see the
 * sphere. In perspective, a displacement d of a point at the depth z along the camera's axis, at the distance s from
 * the eye, appears at most as large as d s / z^2 on the plane at depth 1. A sphere that is nearer than its radius is
 * treated as if its depth were its radius. */
static double compute_pixel_size_bound_in_view(const render_camera *camera, const double centre[3], double radius)
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

double session_find_smallest_pixel_size(const void *of, const double centre[3], double radius)
{
    const session_error_request *request = of;
    double least = INFINITY;
    for (int i = 0; i < request->views->count; i++)
        if (request->images[i])
            least = fmin(least, compute_pixel_size_bound_in_view(&request->views->cameras[i], centre, radius));
    return least;
}

/* ---- requests of a mesh ------------------------------------------------------------------------------------------ */

void session_free_error_requests(session_error_requests *requests)
{
    for (int i = 0; i < requests->count; i++) {
        base_free(requests->items[i].images);
        base_free(requests->items[i].values);
    }
}

static bool is_same_plane(const session_plane *a, const session_plane *b)
{
    bool is_same = true;
    for (int x = 0; x < 3; x++) is_same = is_same && a->normal[x] == b->normal[x] && a->point[x] == b->point[x];
    return is_same;
}

/* Returns whether two volumes have the same transfer function. The pictures of a sweep have copies of one volume. */
static bool has_same_transfer_function(const scene_volume *a, const scene_volume *b)
{
    if (!a || !b) return a == b;
    const scene_colour_map *x = &a->colour_map, *y = &b->colour_map;
    bool is_same = a->opacity_count == b->opacity_count && a->unit_distance == b->unit_distance &&
                   x->count == y->count && x->is_banded == y->is_banded && x->scale == y->scale &&
                   x->threshold == y->threshold && x->range.is_fixed == y->range.is_fixed &&
                   x->range.low == y->range.low && x->range.high == y->range.high && x->range.source == y->range.source;
    for (int i = 0; i < a->opacity_count && is_same; i++)
        is_same = a->opacity[i].position == b->opacity[i].position && a->opacity[i].opacity == b->opacity[i].opacity;
    return is_same && memcmp(x->colours, y->colours, (size_t)x->count * 3 * sizeof *x->colours) == 0;
}

static bool is_same_request(const session_error_request *a, const session_error_request *b)
{
    if (!has_same_transfer_function(a->volume, b->volume) || a->allowed != b->allowed) return false;
    if (a->has_plane || b->has_plane) return a->has_plane && b->has_plane && is_same_plane(&a->plane, &b->plane);
    if (!a->field || !b->field) return !a->field && !b->field;
    return strcmp(a->field, b->field) == 0 && a->component == b->component;
}

/* Returns the request in the list that equals `like`, and adds it if the list does not contain it. If the list is full,
 * returns the request for positions, which is the first one, and sets needs_all, so that all cells are refined. */
static session_error_request *find_or_add_error_request(session_error_requests *requests,
                                                        const session_due_views *views,
                                                        const session_error_request *like)
{
    for (int i = 0; i < requests->count; i++)
        if (is_same_request(&requests->items[i], like)) return &requests->items[i];
    requests->needs_all = requests->needs_all || requests->count == SESSION_MOST_ERROR_REQUESTS;
    if (requests->count == SESSION_MOST_ERROR_REQUESTS) return &requests->items[0];
    session_error_request *request = &requests->items[requests->count++];
    *request = *like;
    request->views = views;
    request->images = base_calloc((size_t)views->count, sizeof *request->images);
    requests->is_complete = requests->is_complete && request->images;
    return request;
}

static session_error_request *add_error_request_of_image(session_error_requests *requests,
                                                         const session_due_views *views,
                                                         const session_error_request *like, int image)
{
    session_error_request *request = find_or_add_error_request(requests, views, like);
    request->is_shown = requests->is_shown = true;
    if (requests->is_complete) request->images[image] = true;
    return request;
}

static void add_isovalue_to_request(session_error_requests *requests, session_error_request *request, double value)
{
    for (int i = 0; i < request->value_count; i++)
        if (request->values[i] == value) return;
    double *values = base_realloc(request->values, ((size_t)request->value_count + 1) * sizeof *values);
    requests->is_complete = requests->is_complete && values;
    if (!values) return;
    values[request->value_count++] = value;
    request->values = values;
}

static const session_catalogue_field *find_shown_field(const session_catalogue_mesh *mesh, const scene_field *field)
{
    return scene_field_selects_mesh(field, mesh->name) ? session_catalogue_find_field(mesh, field->name) : NULL;
}

/* Returns whether the layer shows the values that the caller gave, unchanged. These values do not depend on other
 * cells. */
static bool is_field_shown_unchanged(const session_catalogue_mesh *mesh, const session_catalogue_field *field,
                                     const scene_field *shown)
{
    return field->derived_index < 0 && !session_is_recentred(shown, field->centring, mesh->is_refined);
}

/* Returns whether the scalar that the layer shows is a polynomial in each cell: the caller's values at nodes, or one
 * component of these values. */
static bool is_shown_scalar_polynomial(const session_catalogue_mesh *mesh, const session_catalogue_field *field,
                                       const scene_field *shown)
{
    return is_field_shown_unchanged(mesh, field, shown) && field->centring != INSITU_CELL &&
           session_resolve_component(shown, field->component_count) >= 0;
}

static void add_error_request_for_isosurface(session_error_requests *requests, const session_due_views *views,
                                             const session_catalogue_mesh *mesh, const scene_image *image, int index,
                                             int layer, session_report *report)
{
    const scene_isosurface *shown = &image->isosurfaces[layer];
    const session_catalogue_field *field = find_shown_field(mesh, &shown->field);
    session_error_request like = {.field = NULL};
    if (!field) return;
    const bool is_bounded = is_shown_scalar_polynomial(mesh, field, &shown->field);
    if (is_bounded) like.field = field->name;
    if (is_bounded) like.component = session_resolve_component(&shown->field, field->component_count);
    session_error_request *request = add_error_request_of_image(requests, views, &like, index);
    for (int i = 0; i < shown->value_count && request->field && image->variant.view == 0; i++)
        add_isovalue_to_request(requests, request, shown->values[i]);
    /* central differences sample the field also in neighbours of the cells that the isosurface crosses */
    requests->needs_all = requests->needs_all || !is_bounded || shown->normals == SCENE_DIFFERENCES;
    if (!report) return;
    session_warn(report, &(session_warning){WARNING_PIECES, image->name, mesh->name, layer}, !is_bounded,
                 "image \"%s\": surface_error does not hold for the isosurface of \"%s\" on mesh \"%s\": only "
                 "components of fields at vertices and corners are polynomials, but not derived fields, magnitudes and "
                 "means",
                 image->name, field->name, mesh->name);
}

static void add_error_requests_for_slice(session_error_requests *requests, const session_due_views *views,
                                         const session_catalogue_mesh *mesh, const scene_image *image, int index,
                                         int layer)
{
    const scene_slice *shown = &image->slices[layer];
    if (!find_shown_field(mesh, &shown->field)) return;
    for (int i = 0; i < shown->plane_count; i++) {
        session_error_request like = {.has_plane = true};
        memcpy(like.plane.normal, shown->planes[i].normal, sizeof like.plane.normal);
        session_find_plane_point(&shown->planes[i], &views->extent, like.plane.point);
        add_error_request_of_image(requests, views, &like, index);
    }
}

static void add_error_request_for_volume(session_error_requests *requests, const session_due_views *views,
                                         const session_catalogue_mesh *mesh, const scene_image *image, int index,
                                         int layer)
{
    static const double usual_error = 0.01; /* allowed error of volumes for which the scene gives no max_error */
    const scene_volume *shown = &image->volumes[layer];
    const session_catalogue_field *field = find_shown_field(mesh, &shown->field);
    if (!field || !is_shown_scalar_polynomial(mesh, field, &shown->field)) return;
    const session_error_request like = {.field = field->name,
                                        .component = session_resolve_component(&shown->field, field->component_count),
                                        .volume = shown,
                                        .allowed = image->max_error > 0 ? image->max_error : usual_error};
    add_error_request_of_image(requests, views, &like, index);
}

/* Sets needs_all if the image shows a volume of the mesh, and needs_outer if it shows the mesh's outer surface. If the
 * outer surface has a threshold, needs_all is set too, because the outer faces of the selected cells may lie anywhere
 * in the mesh. In each case, marks the request for positions as shown by the image. */
static void request_all_or_outer_cells(session_error_requests *requests, const session_due_views *views,
                                       const session_catalogue_mesh *mesh, int index)
{
    const scene_image *image = &views->scene->images[index];
    const session_error_request positions = {.field = NULL};
    for (int i = 0; i < image->volume_count; i++) {
        if (!find_shown_field(mesh, &image->volumes[i].field)) continue;
        requests->needs_all = true;
        add_error_request_of_image(requests, views, &positions, index);
    }
    for (int i = 0; i < image->surface_count; i++) {
        if (!scene_field_selects_mesh(&image->surfaces[i].meshes_field, mesh->name)) continue;
        requests->needs_outer = true;
        requests->needs_all = requests->needs_all || image->surfaces[i].threshold.is_given;
        add_error_request_of_image(requests, views, &positions, index);
    }
}

static bool shows_field_computed_from_neighbours(const session_catalogue_mesh *mesh, const scene_image *image)
{
    scene_field_walk walk = {.image = image};
    for (const scene_field *field; (field = scene_find_next_field_of_layers(&walk)) != NULL;) {
        const session_catalogue_field *of = find_shown_field(mesh, field);
        if (of && !is_field_shown_unchanged(mesh, of, field)) return true;
    }
    return false;
}

void session_list_error_requests(const scene *scene, const session_due_views *views, const session_catalogue_mesh *mesh,
                                 bool has_shells, session_error_requests *out, session_report *report)
{
    const session_error_request positions = {.field = NULL};
    bool are_any_due = false;
    *out = (session_error_requests){.is_complete = true, .needs_all = has_shells};
    find_or_add_error_request(out, views, &positions);
    for (int i = 0; i < views->count; i++) {
        const scene_image *image = &scene->images[i];
        are_any_due = are_any_due || views->are_due[i];
        if (!views->are_due[i]) continue;
        request_all_or_outer_cells(out, views, mesh, i);
        out->needs_all = out->needs_all || shows_field_computed_from_neighbours(mesh, image);
        for (int layer = 0; layer < image->isosurface_count; layer++)
            add_error_request_for_isosurface(out, views, mesh, image, i, layer, report);
        for (int layer = 0; layer < image->volume_count; layer++)
            add_error_request_for_volume(out, views, mesh, image, i, layer);
        for (int layer = 0; layer < image->slice_count; layer++)
            add_error_requests_for_slice(out, views, mesh, image, i, layer);
    }
    out->needs_all = out->needs_all || !are_any_due;
}
