/* Computes smooth normals without a seam. A rank knows the vertices that it needs, those of cells that an isosurface
 * crosses, but not all cells around them: it asks the ranks whose boxes hold such a vertex for their share of its sum.
 *
 *     local:  crossed cells -> their vertices -> keys
 *     shared: keys inside another rank's box  --(keys)-->  that rank adds them to its own
 *     local:  every vertex with one of these keys; the cells around them; their sums (session_gradients.h)
 *     shared: <--(sums)--, in whole numbers, which add up in any order
 *
 * If a mesh is cut into blocks, few vertices lie in other ranks' boxes; if each rank has cells everywhere, each asks
 * all others. */
#include "session_smooth.h"

#include <math.h>
#include <string.h>

#include "memory.h"
#include "region.h"
#include "render.h"
#include "session_agree.h"
#include "session_exchange.h"
#include "session_gradients.h"
#include "session_neighbours.h"
#include "session_scalars.h"

enum { KEY_WORDS = 3 };

/* One field of one mesh. */
typedef struct smooth_item {
    const session_catalogue_mesh *mesh;
    const session_catalogue_field *field;
    const scene_field *scene_field; /* of the first layer that has it */
    uint64_t joined;                /* session_joint_name() where values are recentred */
    int component;
    int value_count;
    mmbvh_interval *values; /* of all layers that have it */
} smooth_item;

typedef struct smooth_items {
    int count;
    smooth_item *items;
} smooth_items;

/* This rank's work on an item. */
typedef struct smooth_work {
    session_mesh *mesh; /* NULL: nothing of it is here */
    session_scalar *scalar;
    grid_field values;
    int32_t *entries;       /* each vertex's key, or -1 */
    session_key_table keys; /* those of this rank first, then those that others ask for */
    int64_t own_count;
    session_gradient_sum *sums; /* one a key */
} smooth_work;

/* ---- what is asked for --------------------------------------------------------------------------------------- */

static smooth_item *find_item(smooth_items *items, const smooth_item *like)
{
    for (int i = 0; i < items->count; i++) {
        smooth_item *item = &items->items[i];
        if (item->mesh == like->mesh && item->field == like->field && item->component == like->component &&
            item->joined == like->joined)
            return item;
    }
    smooth_item *more = base_realloc(items->items, (size_t)(items->count + 1) * sizeof *more);
    if (!more) return NULL;
    items->items = more;
    more[items->count] = *like;
    return &more[items->count++];
}

static bool add_layer(smooth_items *items, const session_catalogue_mesh *mesh, const scene_isosurface *layer)
{
    const session_catalogue_field *field = session_catalogue_find(mesh, layer->field.name);
    if (layer->normals != SCENE_VERTEX || !field || !scene_field_is_on(&layer->field, mesh->name)) return true;
    const int component = session_resolve_component(&layer->field, field->component_count);
    const bool is_recentred = session_is_recentred(&layer->field, field->centring);
    const uint64_t joined = is_recentred ? session_joint_name(mesh, layer->field.joined) : 0;
    smooth_item *item = find_item(items, &(smooth_item){mesh, field, &layer->field, joined, component, 0, NULL});
    if (!item) return false;
    const size_t count = (size_t)item->value_count + (size_t)layer->value_count;
    mmbvh_interval *values = base_realloc(item->values, count * sizeof *values);
    if (!values) return false;
    item->values = values;
    for (int i = 0; i < layer->value_count; i++)
        values[item->value_count++] = render_isovalue_interval(layer->values[i]);
    return true;
}

/* Lists the items, in the same order on all ranks. */
static bool list_items(const session_plan *plan, const session_catalogue *catalogue, smooth_items *out)
{
    bool is_listed = true;
    for (int m = 0; m < catalogue->mesh_count; m++)
        for (int i = 0; i < plan->image_count; i++) {
            const scene_image *image = plan->images[i];
            if (image->variant.view > 0) continue; /* its layers are those of view 0 */
            for (int n = 0; n < image->isosurface_count && is_listed; n++)
                is_listed = add_layer(out, &catalogue->meshes[m], &image->isosurfaces[n]);
        }
    return is_listed;
}

static void items_free(smooth_items *items)
{
    for (int i = 0; i < items->count; i++) base_free(items->items[i].values);
    base_free(items->items);
}

bool session_is_smooth(const session_plan *plan)
{
    for (int i = 0; i < plan->image_count; i++)
        for (int n = 0; n < plan->images[i]->isosurface_count; n++)
            if (plan->images[i]->isosurfaces[n].normals == SCENE_VERTEX) return true;
    return false;
}

/* ---- which vertices ------------------------------------------------------------------------------------------ */

/* Adds the keys of the crossed cells' vertices. */
static bool add_own_keys(const smooth_item *item, const mmbvh_selection *crossed, smooth_work *work)
{
    const grid *g = &work->mesh->cells;
    int64_t most = 0, vertex;
    for (int64_t v = 0; v < g->vertex_count; v++) work->entries[v] = -1;
    for (int64_t i = 0; i < crossed->count; i++) {
        grid_walk walk = grid_walk_cell(g, crossed->cells[i]);
        while (grid_walk_next(&walk, &vertex)) {
            most += work->entries[vertex] < 0;
            work->entries[vertex] = 0;
        }
    }
    if (most > INT32_MAX || !session_keys_create(&work->keys, most)) return false;
    for (int64_t v = 0; v < g->vertex_count; v++)
        if (work->entries[v] == 0) {
            const session_key key = session_vertex_key(work->mesh, v, item->mesh->has_ids);
            session_keys_add(&work->keys, &key);
        }
    work->own_count = work->keys.count;
    return true;
}

static insitu_status find_own_keys(const smooth_item *item, int threads, smooth_work *work, base_error *error)
{
    const mmbvh_wish wish = {&work->values, item->value_count, item->values};
    const mmbvh_options options = {.threads = threads};
    const int64_t vertices = work->mesh->cells.vertex_count;
    mmbvh_selection crossed;
    int64_t unusable;
    work->entries = base_alloc((size_t)(vertices ? vertices : 1) * sizeof *work->entries);
    if (!work->entries) return session_no_memory(error, vertices * 4, "gradients at vertices");
    if (mmbvh_select(&work->mesh->cells, &wish, 1, &options, &crossed, &unusable, error)) return error->status;
    if (!add_own_keys(item, &crossed, work)) session_no_memory(error, vertices * 40, "gradients at vertices");
    mmbvh_selection_free(&crossed);
    return error->status;
}

/* Begins this rank's share of the item. */
static insitu_status begin_work(const smooth_item *item, const session_meshes *meshes, int threads, smooth_work *work,
                                base_error *error)
{
    session_mesh *mesh = session_find_mesh(meshes, item->mesh->name);
    work->scalar = mesh && mesh->is_given ? session_find_scalar(mesh, item->scene_field) : NULL;
    if (work->scalar) {
        work->mesh = mesh;
        work->values = session_scalar_field(mesh, work->scalar);
        return find_own_keys(item, threads, work, error);
    }
    return session_keys_create(&work->keys, 0) ? INSITU_OK : session_no_memory(error, 64, "gradients at vertices");
}

/* ---- what ranks ask of each other ---------------------------------------------------------------------------- */

static bool is_in(const session_box *box, const double point[3])
{
    for (int a = 0; a < 3; a++)
        if (!(box->lower[a] <= point[a] && point[a] <= box->upper[a])) return false;
    return true;
}

/* Finds a vertex for each of this rank's keys. */
static bool find_places(const smooth_work *work, bool by_id, double (**out)[3])
{
    *out = base_alloc((size_t)(work->own_count ? work->own_count : 1) * sizeof **out);
    if (!*out) return false;
    for (int64_t v = 0; work->mesh && v < work->mesh->cells.vertex_count; v++) {
        if (work->entries[v] < 0) continue;
        const session_key key = session_vertex_key(work->mesh, v, by_id);
        grid_vertex(&work->mesh->cells, v, (*out)[session_keys_find(&work->keys, &key)]);
    }
    return true;
}

/* Writes to each rank the keys in its box. numbers gets the keys' numbers, in the order of the mail. */
static bool write_questions(const smooth_work *work, const session_team *team, const session_homes *homes,
                            const double (*places)[3], session_mail *out, int64_t **numbers)
{
    int64_t total = 0, at = 0;
    out->counts = base_calloc((size_t)team->ranks, sizeof *out->counts);
    if (!out->counts) return false;
    for (int n = 0; n < homes->near_count; n++)
        for (int64_t i = 0; i < work->own_count && homes->near[n] != team->rank; i++)
            out->counts[homes->near[n]] += is_in(&homes->boxes[n], places[i]);
    for (int rank = 0; rank < team->ranks; rank++) total += out->counts[rank];
    out->words = base_alloc((size_t)(total ? total : 1) * KEY_WORDS * sizeof *out->words);
    *numbers = base_alloc((size_t)(total ? total : 1) * sizeof **numbers);
    if (!out->words || !*numbers) return false;
    for (int n = 0; n < homes->near_count; n++) {
        const int rank = homes->near[n];
        for (int64_t i = 0; i < work->own_count && out->counts[rank]; i++) {
            if (!is_in(&homes->boxes[n], places[i])) continue;
            memcpy(out->words + at * KEY_WORDS, work->keys.keys[i].words, KEY_WORDS * sizeof *out->words);
            (*numbers)[at++] = i;
        }
        out->counts[rank] *= KEY_WORDS;
    }
    out->total = total * KEY_WORDS;
    return true;
}

/* Adds the keys of the questions behind this rank's own. numbers are theirs, in the order of the mail. */
static bool read_questions(const session_mail *in, smooth_work *work, int64_t **numbers)
{
    const int64_t count = in->total / KEY_WORDS;
    session_key_table all;
    *numbers = base_alloc((size_t)(count ? count : 1) * sizeof **numbers);
    if (!*numbers || !session_keys_create(&all, work->own_count + count)) return false;
    for (int64_t i = 0; i < work->own_count; i++) session_keys_add(&all, &work->keys.keys[i]);
    for (int64_t i = 0; i < count; i++) {
        session_key key;
        memcpy(key.words, in->words + i * KEY_WORDS, sizeof key.words);
        (*numbers)[i] = session_keys_add(&all, &key);
    }
    session_keys_free(&work->keys);
    work->keys = all;
    return all.count <= INT32_MAX;
}

/* ---- sums ---------------------------------------------------------------------------------------------------- */

/* A few bits of each key, so that most vertices need no look into the table. */
typedef struct key_filter {
    uint64_t *bits;
    uint64_t mask;
} key_filter;

static bool filter_create(const session_key_table *keys, key_filter *out)
{
    uint64_t size = 1024;
    while (size < 16 * (uint64_t)keys->count) size *= 2;
    *out = (key_filter){base_calloc((size_t)(size / 64), sizeof *out->bits), size - 1};
    for (int64_t i = 0; out->bits && i < keys->count; i++) {
        const uint64_t bit = session_key_hash(&keys->keys[i]) >> 32 & out->mask;
        out->bits[bit / 64] |= (uint64_t)1 << bit % 64;
    }
    return out->bits != NULL;
}

/* Finds all vertices with one of the keys: this rank's own, which a crack may double, and those asked for. */
static bool find_entries(smooth_work *work, bool by_id, int threads)
{
    key_filter filter;
    if (!filter_create(&work->keys, &filter)) return false;
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t v = 0; v < work->mesh->cells.vertex_count; v++) {
            const session_key key = session_vertex_key(work->mesh, v, by_id);
            const uint64_t bit = session_key_hash(&key) >> 32 & filter.mask;
            const bool may_be = filter.bits[bit / 64] >> bit % 64 & 1;
            work->entries[v] = may_be ? (int32_t)session_keys_find(&work->keys, &key) : -1;
        }
        region_leave();
    }
    base_free(filter.bits);
    return true;
}

static session_gradient_basis basis_of(const smooth_work *work, const session_extent *extent, int threads)
{
    int exponent = 0;
    frexp(extent->half_diagonal, &exponent);
    return (session_gradient_basis){&work->mesh->cells, &work->values, work->entries, ldexp(1, exponent), threads};
}

/* Makes the input of the sums, and finds this rank's largest numbers. */
static bool begin_sums(const session_team *team, const session_extent *extent, bool by_id, smooth_work *work,
                       session_gradient_basis *basis, session_cell_list *list, double largest[2])
{
    const int64_t count = work->keys.count;
    work->sums = base_calloc((size_t)(count ? count : 1), sizeof *work->sums);
    if (!work->sums) return false;
    if (!work->mesh || !count) return true;
    if (!find_entries(work, by_id, team->threads)) return false;
    *basis = basis_of(work, extent, team->threads);
    return session_list_cells(basis, list) && session_largest_gradients(basis, list, largest);
}

/* Numbers are rounded below the largest of all ranks. Where a rank has failed before, all return its error; what fails
 * behind the reduction is in *error alone. Collective. */
static insitu_status make_sums(const session_team *team, const session_extent *extent, bool by_id, smooth_work *work,
                               base_error *error)
{
    session_cell_list list = {0};
    session_gradient_basis basis = {0};
    double largest[3] = {0, 0, 0}; /* the last one tells whether a rank has failed */
    if (!error->status && !begin_sums(team, extent, by_id, work, &basis, &list, largest))
        session_no_memory(error, work->keys.count * 100, "gradients at vertices");
    largest[2] = error->status != INSITU_OK;
    insitu_status status =
        session_mpi(error, MPI_Allreduce(MPI_IN_PLACE, largest, 3, MPI_DOUBLE, MPI_MAX, team->comm), "MPI_Allreduce");
    if (!status && largest[2] > 0) status = session_agree(team->comm, error);
    if (!status && list.count && !session_add_gradients(&basis, &list, largest, work->sums))
        session_no_memory(error, work->keys.count * 100, "gradients at vertices");
    base_free(list.cells);
    return status;
}

static bool write_answers(const smooth_work *work, const session_mail *questions, const int64_t *numbers, int ranks,
                          session_mail *out)
{
    const int64_t count = questions->total / KEY_WORDS;
    out->counts = base_calloc((size_t)ranks, sizeof *out->counts);
    out->words = base_alloc((size_t)(count ? count : 1) * sizeof(session_gradient_sum));
    if (!out->counts || !out->words) return false;
    for (int rank = 0; rank < ranks; rank++)
        out->counts[rank] = questions->counts[rank] / KEY_WORDS * SESSION_SUM_WORDS;
    for (int64_t i = 0; i < count; i++)
        memcpy(out->words + i * SESSION_SUM_WORDS, &work->sums[numbers[i]], sizeof(session_gradient_sum));
    out->total = count * SESSION_SUM_WORDS;
    return true;
}

static void add_answers(const session_mail *answers, const int64_t *numbers, smooth_work *work)
{
    for (int64_t i = 0; i < answers->total / SESSION_SUM_WORDS; i++) {
        session_gradient_sum sum;
        memcpy(&sum, answers->words + i * SESSION_SUM_WORDS, sizeof sum);
        for (int k = 0; k < SESSION_SUM_WORDS; k++) work->sums[numbers[i]].words[k] += sum.words[k];
    }
}

/* ---- one item ------------------------------------------------------------------------------------------------ */

/* The letters of an item's exchange. */
typedef struct smooth_mail {
    double (*places)[3];
    session_mail questions, asked, answers, answered;
    int64_t *own_numbers, *asked_numbers;
} smooth_mail;

static void mail_free(smooth_mail *mail)
{
    base_free(mail->places);
    session_mail_free(&mail->questions);
    session_mail_free(&mail->asked);
    session_mail_free(&mail->answers);
    session_mail_free(&mail->answered);
    base_free(mail->own_numbers);
    base_free(mail->asked_numbers);
}

static insitu_status ask(const smooth_item *item, const session_team *team, smooth_work *work, smooth_mail *mail,
                         base_error *error)
{
    const session_homes *homes = &item->mesh->homes;
    if (!error->status &&
        (!find_places(work, homes->by_id, &mail->places) ||
         !write_questions(work, team, homes, (const double(*)[3])mail->places, &mail->questions, &mail->own_numbers)))
        session_no_memory(error, work->own_count * 24, "gradients at vertices that ranks share");
    const insitu_status status =
        session_mail_deliver(team->comm, SESSION_MAIL_THERE, &mail->questions, &mail->asked, error);
    if (!status && !error->status && !read_questions(&mail->asked, work, &mail->asked_numbers))
        session_no_memory(error, mail->asked.total * 24, "gradients at vertices that ranks share");
    return status;
}

static insitu_status answer(const session_team *team, smooth_work *work, smooth_mail *mail, base_error *error)
{
    if (!error->status && !write_answers(work, &mail->asked, mail->asked_numbers, team->ranks, &mail->answers))
        session_no_memory(error, mail->asked.total * 24, "gradients at vertices that ranks share");
    const insitu_status status =
        session_mail_deliver(team->comm, SESSION_MAIL_BACK, &mail->answers, &mail->answered, error);
    if (!status && !error->status) add_answers(&mail->answered, mail->own_numbers, work);
    return status;
}

/* Vertices with sums for other ranks alone need no gradient here. */
static insitu_status end_work(smooth_work *work, base_error *error)
{
    session_scalar *scalar = work->scalar;
    const int64_t count = work->own_count;
    session_drop_gradients(scalar);
    scalar->gradients = base_alloc((size_t)(count ? count : 1) * sizeof *scalar->gradients);
    if (!scalar->gradients) return session_no_memory(error, count * 12, "gradients at vertices");
    for (int64_t i = 0; i < count; i++) session_mean_gradient(&work->sums[i], scalar->gradients[i]);
    for (int64_t v = 0; v < work->mesh->cells.vertex_count; v++)
        if (work->entries[v] >= count) work->entries[v] = -1;
    scalar->gradient_count = count;
    scalar->gradient_entries = work->entries;
    work->entries = NULL;
    return INSITU_OK;
}

static insitu_status smooth(const smooth_item *item, const session_meshes *meshes, const session_team *team,
                            const session_extent *extent, base_error *error)
{
    smooth_work work = {0};
    smooth_mail mail = {0};
    insitu_status status = INSITU_OK;
    if (!error->status) begin_work(item, meshes, team->threads, &work, error);
    if (team->ranks > 1) status = ask(item, team, &work, &mail, error);
    if (!status) status = make_sums(team, extent, item->mesh->has_ids, &work, error);
    if (!status && team->ranks > 1) status = answer(team, &work, &mail, error);
    if (!status && !error->status && work.mesh) end_work(&work, error);
    mail_free(&mail);
    base_free(work.entries);
    base_free(work.sums);
    session_keys_free(&work.keys);
    return status;
}

insitu_status session_smooth(const session_plan *plan, const session_catalogue *catalogue, const session_meshes *meshes,
                             const session_team *team, const session_extent *extent, base_error *error)
{
    smooth_items items = {0};
    if (!session_is_smooth(plan)) return INSITU_OK;
    if (!list_items(plan, catalogue, &items)) session_no_memory(error, 64, "the plan of gradients at vertices");
    insitu_status status = session_agree(team->comm, error);
    for (int i = 0; i < items.count && !status; i++) status = smooth(&items.items[i], meshes, team, extent, error);
    items_free(&items);
    return status;
}
