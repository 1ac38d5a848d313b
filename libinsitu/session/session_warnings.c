/* What was told is kept as hashes of what it was about. */
#include "session_warnings.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_tally.h"
#include "session_tree.h"

static uint64_t key_of(const session_warning *w)
{
    const char *const texts[2] = {w->image ? w->image : "", w->mesh ? w->mesh : ""};
    const int numbers[2] = {(int)w->kind, w->number};
    uint64_t key = SESSION_HASH_BEGIN;
    session_hash_bytes(&key, numbers, sizeof numbers);
    for (int i = 0; i < 2; i++) session_hash_bytes(&key, texts[i], strlen(texts[i]) + 1);
    return key;
}

/* told_count: not among them. */
static int find_told(const insitu_session *session, uint64_t key)
{
    int at = 0;
    while (at < session->told_count && session->told[at] != key) at++;
    return at;
}

/* Where memory runs out the warning is told again. */
static void add_told(insitu_session *session, uint64_t key)
{
    uint64_t *told = base_realloc(session->told, (size_t)(session->told_count + 1) * sizeof *told);
    if (!told) return;
    session->told = told;
    told[session->told_count++] = key;
}

void session_warn(insitu_session *session, const session_warning *warning, bool holds, const char *format, ...)
{
    const uint64_t key = key_of(warning);
    const int at = find_told(session, key);
    if (holds && at == session->told_count) {
        char line[1024];
        va_list arguments;
        va_start(arguments, format);
        vsnprintf(line, sizeof line, format, arguments);
        va_end(arguments);
        session_text_add(&session->warnings, "%s", line);
        add_told(session, key);
    } else if (!holds && at < session->told_count) {
        session->told[at] = session->told[--session->told_count];
    }
}

bool session_is_warned(const insitu_session *session, const session_warning *warning)
{
    return find_told(session, key_of(warning)) < session->told_count;
}

void session_forget_warnings(insitu_session *session)
{
    session->told_count = 0;
}

/* ---- cells --------------------------------------------------------------------------------------------------- */

enum cell_sum { DRAWN, FLAT, INVERTED, LOOKED_AT, CROSSED, CELL_SUMS };

static void sum_cells(const insitu_session *session, const char *name, int64_t sums[CELL_SUMS])
{
    const session_mesh *mesh = session_find_mesh(session, name);
    if (!mesh || !mesh->is_given) return;
    sums[DRAWN] = mesh->drawn_count;
    sums[FLAT] = mesh->flat_count;
    sums[INVERTED] = mesh->inverted_count;
    tally_crossed(mesh, &sums[LOOKED_AT], &sums[CROSSED]);
}

static void warn_of_order(insitu_session *session, const char *mesh, const int64_t sums[CELL_SUMS])
{
    const long long drawn = sums[DRAWN], flat = sums[FLAT], inverted = sums[INVERTED];
    const bool are_crossed = 2 * sums[CROSSED] > sums[LOOKED_AT];
    const bool are_flat = !are_crossed && 2 * flat > drawn;
    const bool are_inverted = !are_crossed && 2 * inverted > drawn;
    session_warn(
        session, &(session_warning){WARNING_ORDER, NULL, mesh, 0}, are_crossed,
        "mesh \"%s\": the vertices of its hexes or pyramids seem to be in lexicographic order: their quads cross "
        "themselves, so that little of the cells is seen; VTK's order goes around each quad (counted from 0, exchange "
        "vertices 2 and 3, of hexes 6 and 7 as well)",
        mesh);
    session_warn(
        session, &(session_warning){WARNING_ORDER, NULL, mesh, 1}, are_flat,
        "mesh \"%s\": %lld of %lld cells have no volume and are not seen: look at the order of their vertices, "
        "which is to be VTK's, and at the coordinates",
        mesh, flat, drawn);
    session_warn(
        session, &(session_warning){WARNING_ORDER, NULL, mesh, 2}, are_inverted,
        "mesh \"%s\": %lld of %lld cells are left-handed, which is drawn right if that is all: look at the order "
        "of their vertices, which is to be VTK's, and at the axes",
        mesh, inverted, drawn);
}

insitu_status session_warn_of_cells(insitu_session *session, base_error *error)
{
    const session_catalogue *catalogue = &session->catalogue;
    const size_t words = (size_t)catalogue->mesh_count * CELL_SUMS;
    int64_t *sums = base_calloc(words, sizeof *sums);
    if (!sums) session_no_memory(error, (int64_t)(words * sizeof *sums), "counts of cells");
    insitu_status status = session_agree(session->comm, error);
    for (int m = 0; m < catalogue->mesh_count && !status; m++)
        sum_cells(session, catalogue->meshes[m].name, sums + m * CELL_SUMS);
    if (!status)
        status = session_mpi(error, MPI_Allreduce(MPI_IN_PLACE, sums, (int)words, MPI_INT64_T, MPI_SUM, session->comm),
                             "MPI_Allreduce");
    for (int m = 0; m < catalogue->mesh_count && !status; m++)
        warn_of_order(session, catalogue->meshes[m].name, sums + m * CELL_SUMS);
    base_free(sums);
    return status;
}

/* ---- isovalues ----------------------------------------------------------------------------------------------- */

/* The least value and the greatest negated, so that one minimum finds both. */
typedef struct field_range {
    double low, minus_high;
} field_range;

static const field_range no_range = {INFINITY, INFINITY};

static bool is_outside(double value, const field_range *range)
{
    return value < range->low || value > -range->minus_high;
}

/* Of what the trees hold, which is all that shows. */
static void take_root(const session_mesh *mesh, const session_scalar *scalar, field_range *range)
{
    if (!mesh->is_needed || !mesh->has_tree || mesh->tree.node_count == 0) return;
    const mmbvh_ranges root = session_scalar_ranges(mesh, scalar);
    range->low = fmin(range->low, (double)*(const float *)(const void *)root.low);
    range->minus_high = fmin(range->minus_high, -(double)*(const float *)(const void *)root.high);
}

static void take_extent(const insitu_session *session, const session_mesh *mesh, session_scalar *scalar,
                        field_range *range)
{
    double low, high;
    session_scalar_extent(mesh, scalar, session->threads, &low, &high);
    range->low = fmin(range->low, low);
    range->minus_high = fmin(range->minus_high, -high);
}

static field_range own_range(const insitu_session *session, const scene_field *field, bool of_all_cells)
{
    field_range range = no_range;
    for (int i = 0; i < session->mesh_count; i++) {
        const session_mesh *mesh = session->meshes[i];
        session_scalar *scalar = mesh->is_given ? session_find_scalar(mesh, field) : NULL;
        if (scalar && of_all_cells) take_extent(session, mesh, scalar, &range);
        if (scalar && !of_all_cells) take_root(mesh, scalar, &range);
    }
    return range;
}

/* An isosurface among the plan's. */
typedef struct planned_surface {
    const scene_image *image;
    const scene_isosurface *layer;
    int first_value; /* values of the image's earlier layers */
    field_range range;
    bool is_news; /* a value is outside what the trees hold, and that was not told */
} planned_surface;

static session_warning isovalue_warning(const planned_surface *s, int value)
{
    return (session_warning){WARNING_ISOVALUE, s->image->name, NULL, s->first_value + value};
}

static int list_surfaces(const session_plan *plan, planned_surface *out)
{
    int count = 0;
    for (int i = 0; i < plan->image_count; i++) {
        const scene_image *image = plan->images[i];
        for (int n = 0, values = 0; n < image->isosurface_count; n++) {
            out[count++] = (planned_surface){image, &image->isosurfaces[n], values, no_range, false};
            values += image->isosurfaces[n].value_count;
        }
    }
    return count;
}

/* Over all ranks. Collective. */
static insitu_status reduce_ranges(insitu_session *session, planned_surface *surfaces, int count, bool of_all_cells,
                                   base_error *error)
{
    double lows[2 * count];
    for (int i = 0; i < count; i++) {
        planned_surface *s = &surfaces[i];
        if (!of_all_cells || s->is_news) s->range = own_range(session, &s->layer->field, of_all_cells);
        lows[2 * i] = s->range.low;
        lows[2 * i + 1] = s->range.minus_high;
    }
    const insitu_status status = session_mpi(
        error, MPI_Allreduce(MPI_IN_PLACE, lows, 2 * count, MPI_DOUBLE, MPI_MIN, session->comm), "MPI_Allreduce");
    for (int i = 0; i < count; i++) surfaces[i].range = (field_range){lows[2 * i], lows[2 * i + 1]};
    return status;
}

static bool find_news(const insitu_session *session, planned_surface *surfaces, int count)
{
    bool is_any = false;
    for (int i = 0; i < count; i++) {
        planned_surface *s = &surfaces[i];
        for (int v = 0; v < s->layer->value_count; v++) {
            const session_warning warning = isovalue_warning(s, v);
            if (is_outside(s->layer->values[v], &s->range) && !session_is_warned(session, &warning)) s->is_news = true;
        }
        is_any = is_any || s->is_news;
    }
    return is_any;
}

/* Where the trees hold values on both sides nothing more is asked; else, once, what all cells have. */
static void warn_of_values(insitu_session *session, const planned_surface *s)
{
    const double low = s->range.low, high = -s->range.minus_high;
    for (int v = 0; v < s->layer->value_count; v++) {
        const double value = s->layer->values[v];
        const session_warning warning = isovalue_warning(s, v);
        const bool has_values = low <= high || !s->is_news;
        session_warn(session, &warning, has_values && is_outside(value, &s->range),
                     "image \"%s\": the isosurface of \"%s\" at %g is not there: the field is from %g to %g",
                     s->image->name, s->layer->field.name, value, low, high);
    }
}

insitu_status session_warn_of_isovalues(insitu_session *session, const session_plan *plan, base_error *error)
{
    int most = 0;
    for (int i = 0; i < plan->image_count; i++) most += plan->images[i]->isosurface_count;
    if (most == 0 || session->extent.cell_count == 0) return INSITU_OK;
    planned_surface surfaces[most];
    const int count = list_surfaces(plan, surfaces);
    insitu_status status = reduce_ranges(session, surfaces, count, false, error);
    if (!status && find_news(session, surfaces, count)) status = reduce_ranges(session, surfaces, count, true, error);
    for (int i = 0; i < count && !status; i++) warn_of_values(session, &surfaces[i]);
    return status;
}

/* ---- views --------------------------------------------------------------------------------------------------- */

/* Where the corners of the bounds lie in the picture. */
typedef struct corner_bounds {
    double low[2], high[2]; /* of places in the picture: -1 and 1 are its borders; of corners in front */
    int behind;             /* corners */
    bool is_beside;         /* all of them beyond one border */
} corner_bounds;

static double along(const double v[3], const double axis[3])
{
    return v[0] * axis[0] + v[1] * axis[1] + v[2] * axis[2];
}

static corner_bounds project_bounds(const session_extent *e, const render_camera *c)
{
    corner_bounds b = {{INFINITY, INFINITY}, {-INFINITY, -INFINITY}, 0, false};
    int beyond[4] = {0, 0, 0, 0};
    const double half[2] = {c->half_height * c->width / c->height, c->half_height};
    for (int corner = 0; corner < 8; corner++) {
        double offset[3];
        for (int a = 0; a < 3; a++) offset[a] = (corner >> a & 1 ? e->upper[a] : e->lower[a]) - c->eye[a];
        const double z = along(offset, c->forward);
        const double place[2] = {along(offset, c->right), along(offset, c->up)};
        b.behind += z <= 0;
        for (int a = 0; a < 2; a++) {
            beyond[2 * a] += place[a] < -half[a] * z;
            beyond[2 * a + 1] += place[a] > half[a] * z;
            if (z > 0) b.low[a] = fmin(b.low[a], place[a] / (half[a] * z));
            if (z > 0) b.high[a] = fmax(b.high[a], place[a] / (half[a] * z));
        }
    }
    for (int side = 0; side < 4; side++) b.is_beside = b.is_beside || beyond[side] == 8;
    return b;
}

/* Why nothing is in view, NULL where something may be. */
static const char *why_unseen(const session_extent *e, const render_camera *c)
{
    const corner_bounds b = project_bounds(e, c);
    if (b.behind == 8) return "they are behind it";
    if (b.is_beside) return "they are beside the picture";
    const bool is_small =
        b.behind == 0 && (b.high[0] - b.low[0]) * c->width < 2 && (b.high[1] - b.low[1]) * c->height < 2;
    return is_small ? "together they are smaller than a pixel" : NULL;
}

void session_warn_of_view(insitu_session *session, const scene_image *image, const session_view *view)
{
    const session_extent *e = &session->extent;
    const char *why = e->cell_count ? why_unseen(e, &view->camera) : NULL;
    const session_warning warning = {WARNING_VIEW, image->name, NULL, 0};
    session_warn(session, &warning, why != NULL,
                 "image \"%s\": its camera does not see the cells, which lie between (%g, %g, %g) and (%g, %g, %g): %s",
                 image->name, e->lower[0], e->lower[1], e->lower[2], e->upper[0], e->upper[1], e->upper[2],
                 why ? why : "");
}
