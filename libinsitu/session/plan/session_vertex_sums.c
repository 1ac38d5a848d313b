/* For each vertex, the gradients of the cells around it are summed. A rank has all vertices for which it needs sums,
 * but may lack some of the cells around them. For each of these vertices, it therefore requests partial sums from the
 * ranks whose boxes contain the vertex.
 *
 *     shared: keys inside another rank's box  --(keys)-->  that rank adds them to its own keys
 *     local:  every vertex with one of these keys; the cells around them; their sums (session_gradients.h)
 *     shared: <--(sums)--, as integers, so that the order of addition does not matter
 *
 * If a mesh is cut into compact blocks, few vertices lie in other ranks' boxes. If the cells of each rank are scattered
 * over the whole domain, each rank sends requests to all others. */
#include "session_vertex_sums.h"

#include <math.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_region.h"
#include "session_twins.h"

enum { KEY_WORDS = 3 };

/* ---- keys of all vertices ------------------------------------------------------------------------------------- */

/* Sets key_indices to 0 for vertices of cells that are not ghosts, and to -1 for all other vertices. */
static void mark_vertices_of_drawn_cells(session_sum_part *part)
{
    const grid *g = &part->mesh->cells;
    for (int64_t v = 0; v < g->vertex_count; v++) part->key_indices[v] = -1;
    for (int64_t cell = 0; cell < g->cell_count; cell++) {
        if (grid_is_ghost(g, cell)) continue;
        grid_walk walk = grid_walk_cell(g, cell);
        int64_t vertex;
        while (grid_walk_next(&walk, &vertex)) part->key_indices[vertex] = 0;
    }
}

static bool assign_keys_to_all_vertices(session_vertex_sums *sums)
{
    int64_t most = 0;
    for (int i = 0; i < sums->part_count; i++) {
        session_sum_part *part = &sums->parts[i];
        const int64_t count = part->mesh->cells.vertex_count;
        part->key_indices = base_alloc((size_t)count * sizeof *part->key_indices);
        if (!part->key_indices) return false;
        most += count;
    }
    if (most > INT32_MAX || !session_keys_create(&sums->keys, most)) return false;
    for (int i = 0; i < sums->part_count; i++) {
        session_sum_part *part = &sums->parts[i];
        mark_vertices_of_drawn_cells(part);
        for (int64_t v = 0; v < part->mesh->cells.vertex_count; v++) {
            if (part->key_indices[v] < 0) continue;
            const session_key key = session_merged_vertex_key(part->mesh, part->border, v, sums->by_id);
            part->key_indices[v] = (int32_t)session_keys_add(&sums->keys, &key);
        }
    }
    sums->own_count = sums->keys.count;
    return true;
}

static int64_t count_vertices(const session_vertex_sums *sums)
{
    int64_t count = 0;
    for (int i = 0; i < sums->part_count; i++) count += sums->parts[i].mesh->cells.vertex_count;
    return count;
}

insitu_status session_assign_keys_to_vertices(session_vertex_sums *sums, base_error *error)
{
    sums->has_all_vertices = true;
    if (assign_keys_to_all_vertices(sums)) return INSITU_OK;
    return session_fail_for_memory(error, count_vertices(sums) * 60, "gradients at vertices");
}

/* ---- requests to other ranks ----------------------------------------------------------------------------------- */

/* The messages by which ranks exchange sums of gradients. A request is the key of a vertex; the answer is the sum over
 * the other rank's cells around the vertex with this key. */
typedef struct sums_messages {
    double (*positions)[3]; /* position of a vertex for each of this rank's own keys */
    session_mail requests, received_requests, answers, received_answers;
    /* indices in session_vertex_sums.keys: own_numbers: of each key in `requests`; requested_numbers: of each key in
     * `received_requests`, or -1 if this rank has no vertex with the key */
    int64_t *own_numbers, *requested_numbers;
} sums_messages;

static void free_sum_messages(sums_messages *mail)
{
    base_free(mail->positions);
    session_mail_free(&mail->requests);
    session_mail_free(&mail->received_requests);
    session_mail_free(&mail->answers);
    session_mail_free(&mail->received_answers);
    base_free(mail->own_numbers);
    base_free(mail->requested_numbers);
}

/* Finds, for each of this rank's own keys, the position of a vertex that has the key. */
static bool find_key_positions(const session_vertex_sums *sums, double (**out)[3])
{
    *out = base_alloc((size_t)(sums->own_count ? sums->own_count : 1) * sizeof **out);
    if (!*out) return false;
    for (int i = 0; i < sums->part_count; i++) {
        const session_sum_part *part = &sums->parts[i];
        for (int64_t v = 0; v < part->mesh->cells.vertex_count; v++) {
            if (part->key_indices[v] < 0) continue;
            int64_t number = part->key_indices[v];
            if (!sums->has_all_vertices) {
                const session_key key = session_merged_vertex_key(part->mesh, part->border, v, sums->by_id);
                number = session_keys_find(&sums->keys, &key);
            }
            grid_read_vertex_position(&part->mesh->cells, v, (*out)[number]);
        }
    }
    return true;
}

/* For each other rank near this one, packs the keys whose vertices lie in the other rank's box into a message. *numbers
 * receives the index of each packed key, in the order of the messages. */
static bool pack_key_requests(const session_vertex_sums *sums, const session_team *team, const session_homes *homes,
                              const double (*positions)[3], session_mail *out, int64_t **numbers)
{
    int64_t total = 0, at = 0;
    out->counts = base_calloc((size_t)team->ranks, sizeof *out->counts);
    if (!out->counts) return false;
    for (int n = 0; n < homes->near_count; n++)
        for (int64_t i = 0; i < sums->own_count && homes->near_ranks[n] != team->rank; i++)
            out->counts[homes->near_ranks[n]] += session_is_in_box(&homes->boxes[n], positions[i]);
    for (int rank = 0; rank < team->ranks; rank++) total += out->counts[rank];
    out->words = base_alloc((size_t)(total ? total : 1) * KEY_WORDS * sizeof *out->words);
    *numbers = base_alloc((size_t)(total ? total : 1) * sizeof **numbers);
    if (!out->words || !*numbers) return false;
    for (int n = 0; n < homes->near_count; n++) {
        const int rank = homes->near_ranks[n];
        for (int64_t i = 0; i < sums->own_count && out->counts[rank]; i++) {
            if (!session_is_in_box(&homes->boxes[n], positions[i])) continue;
            memcpy(out->words + at * KEY_WORDS, sums->keys.keys[i].words, KEY_WORDS * sizeof *out->words);
            (*numbers)[at++] = i;
        }
        out->counts[rank] *= KEY_WORDS;
    }
    out->total = total * KEY_WORDS;
    return true;
}

/* Enlarges the table of keys so that it has space for `more` keys requested by other ranks, which the caller adds after
 * this rank's own keys. */
static bool reserve_requested_keys(session_vertex_sums *sums, int64_t more)
{
    session_key_table all;
    if (!session_keys_create(&all, sums->own_count + more)) return false;
    for (int64_t i = 0; i < sums->own_count; i++) session_keys_add(&all, &sums->keys.keys[i]);
    session_keys_free(&sums->keys);
    sums->keys = all;
    return true;
}

/* Finds the index of each key that other ranks have requested, and adds the key if it is new. If has_all_vertices is
 * set, no keys are added, because every vertex has one already. *numbers receives the indices of the requested keys, in
 * the order of the messages; -1: this rank has no vertex with the key. */
static bool add_requested_keys(const session_mail *in, session_vertex_sums *sums, int64_t **numbers)
{
    const int64_t count = in->total / KEY_WORDS;
    *numbers = base_alloc((size_t)(count ? count : 1) * sizeof **numbers);
    if (!*numbers || (!sums->has_all_vertices && !reserve_requested_keys(sums, count))) return false;
    for (int64_t i = 0; i < count; i++) {
        session_key key;
        memcpy(key.words, in->words + i * KEY_WORDS, sizeof key.words);
        (*numbers)[i] =
            sums->has_all_vertices ? session_keys_find(&sums->keys, &key) : session_keys_add(&sums->keys, &key);
    }
    return sums->keys.count <= INT32_MAX;
}

static insitu_status send_requests(const session_homes *homes, const session_team *team, session_vertex_sums *sums,
                                   sums_messages *mail, base_error *error)
{
    if (!error->status && (!find_key_positions(sums, &mail->positions) ||
                           !pack_key_requests(sums, team, homes, (const double(*)[3])mail->positions, &mail->requests,
                                              &mail->own_numbers)))
        session_fail_for_memory(error, sums->own_count * 24, "gradients at vertices that ranks share");
    const insitu_status status =
        session_mail_deliver(team->comm, SESSION_MAIL_THERE, &mail->requests, &mail->received_requests, error);
    if (!status && !error->status && !add_requested_keys(&mail->received_requests, sums, &mail->requested_numbers))
        session_fail_for_memory(error, mail->received_requests.total * 24, "gradients at vertices that ranks share");
    return status;
}

static bool pack_sum_answers(const session_vertex_sums *sums, const sums_messages *mail, int ranks, session_mail *out)
{
    const session_mail *requests = &mail->received_requests;
    const int64_t count = requests->total / KEY_WORDS, words = session_count_sum_words(sums->field_count);
    out->counts = base_calloc((size_t)ranks, sizeof *out->counts);
    out->words = base_calloc((size_t)(count ? count : 1), (size_t)words * sizeof *out->words);
    if (!out->counts || !out->words) return false;
    for (int rank = 0; rank < ranks; rank++) out->counts[rank] = requests->counts[rank] / KEY_WORDS * words;
    for (int64_t i = 0; i < count; i++)
        if (mail->requested_numbers[i] >= 0)
            memcpy(out->words + i * words, sums->sums + mail->requested_numbers[i] * words,
                   (size_t)words * sizeof *out->words);
    out->total = count * words;
    return true;
}

static void add_received_sums(const sums_messages *mail, session_vertex_sums *sums)
{
    const int64_t words = session_count_sum_words(sums->field_count);
    for (int64_t i = 0; i < mail->received_answers.total / words; i++) {
        int64_t *sum = sums->sums + mail->own_numbers[i] * words;
        for (int64_t k = 0; k < words; k++) {
            int64_t share;
            memcpy(&share, &mail->received_answers.words[i * words + k], sizeof share);
            sum[k] += share;
        }
    }
}

static insitu_status send_answers(const session_team *team, session_vertex_sums *sums, sums_messages *mail,
                                  base_error *error)
{
    if (!error->status && !pack_sum_answers(sums, mail, team->ranks, &mail->answers))
        session_fail_for_memory(error, mail->received_requests.total * 24, "gradients at vertices that ranks share");
    const insitu_status status =
        session_mail_deliver(team->comm, SESSION_MAIL_BACK, &mail->answers, &mail->received_answers, error);
    if (!status && !error->status) add_received_sums(mail, sums);
    return status;
}

/* ---- computing the sums ------------------------------------------------------------------------------------------ */

/* A Bloom filter of the keys in a table: the hash of each key selects one bit, which is set. A vertex whose bit is not
 * set has no key in the table, so that most vertices need no search there. */
typedef struct key_filter {
    uint64_t *bits;
    uint64_t mask; /* number of bits - 1; the number of bits is a power of two */
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

/* Stores in key_indices the index of each vertex's key, or -1 if the vertex has none. The key is one of this rank's own
 * keys or a requested key; several vertices along a crack may have the same key. If only some pieces of cells of higher
 * order are made, most vertices belong to no piece and are not searched. */
static void find_key_indices(const session_vertex_sums *sums, session_sum_part *part, const key_filter *filter,
                             int threads)
{
    const bool is_marked = part->mesh->finer.pieces.first_words != NULL;
    if (is_marked) mark_vertices_of_drawn_cells(part);
#pragma omp parallel num_threads(session_choose_loop_threads(threads, part->mesh->cells.vertex_count))
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t v = 0; v < part->mesh->cells.vertex_count; v++) {
            if (is_marked && part->key_indices[v] < 0) continue;
            const session_key key = session_merged_vertex_key(part->mesh, part->border, v, sums->by_id);
            const uint64_t bit = session_key_hash(&key) >> 32 & filter->mask;
            const bool may_be = filter->bits[bit / 64] >> bit % 64 & 1;
            part->key_indices[v] = may_be ? (int32_t)session_keys_find(&sums->keys, &key) : -1;
        }
        region_leave();
    }
}

static bool find_all_key_indices(const session_vertex_sums *sums, int threads)
{
    key_filter filter;
    if (!filter_create(&sums->keys, &filter)) return false;
    for (int i = 0; i < sums->part_count; i++) find_key_indices(sums, &sums->parts[i], &filter, threads);
    base_free(filter.bits);
    return true;
}

static session_gradient_basis make_gradient_basis(const session_vertex_sums *sums, const session_sum_part *part,
                                                  int threads)
{
    return (session_gradient_basis){.cells = &part->mesh->cells,
                                    .fields = part->fields,
                                    .field_count = sums->field_count,
                                    .of_shells = part->of_shells,
                                    .sum_indices = part->key_indices,
                                    .length = sums->length,
                                    .threads = threads,
                                    .polynomials = part->polynomials};
}

/* Finds the polynomials of a part whose cells are split into pieces. If a field's values were averaged from cells to
 * vertices, no polynomials are needed, because the means at nodes are not values of a polynomial. */
static bool make_polynomials(const session_vertex_sums *sums, session_sum_part *part)
{
    bool is_polynomial = part->mesh->topology.is_split;
    for (int f = 0; f < sums->field_count; f++) is_polynomial = is_polynomial && !part->fields[f].source_cells;
    if (!is_polynomial) return true;
    part->polynomials = base_calloc(1, sizeof *part->polynomials);
    return part->polynomials && session_polynomials_create(part->mesh, part->polynomials);
}

/* Lists the cells of each part that contribute to sums, and computes bounds of these contributions on this rank. */
static bool allocate_and_bound_sums(session_vertex_sums *sums, session_cell_list *lists, int threads)
{
    const size_t count = (size_t)(sums->keys.count ? sums->keys.count : 1);
    sums->sums = base_calloc(count, (size_t)session_count_sum_words(sums->field_count) * sizeof *sums->sums);
    if (!sums->sums || (!sums->has_all_vertices && sums->keys.count && !find_all_key_indices(sums, threads)))
        return false;
    for (int i = 0; i < sums->part_count && sums->keys.count; i++) {
        session_gradient_bounds own;
        session_sum_part *part = &sums->parts[i];
        if (!make_polynomials(sums, part)) return false;
        const session_gradient_basis basis = make_gradient_basis(sums, part, threads);
        if (!session_list_cells_with_sums(&basis, &lists[i]) || !session_bound_gradients(&basis, &lists[i], &own))
            return false;
        sums->bounds.largest_difference = fmax(sums->bounds.largest_difference, own.largest_difference);
        sums->bounds.largest_inverse_square = fmax(sums->bounds.largest_inverse_square, own.largest_inverse_square);
    }
    return true;
}

static bool add_gradients_to_sums(const session_vertex_sums *sums, const session_cell_list *lists, int threads)
{
    unsigned char *owners = session_create_sum_owners(sums->keys.count, threads);
    bool is_done = owners != NULL;
    for (int i = 0; i < sums->part_count && is_done; i++) {
        if (!lists[i].count) continue;
        const session_gradient_basis basis = make_gradient_basis(sums, &sums->parts[i], threads);
        is_done = session_add_gradients(&basis, &lists[i], &sums->bounds, owners, sums->sums);
    }
    base_free(owners);
    return is_done;
}

/* Computes the sums of gradients in fixed-point integers. The value of their lowest bit is chosen from the largest
 * bounds over all ranks. If *error of any rank already holds an error, all ranks return this error; an error that
 * occurs after the reduction is only stored in *error. Collective. */
static insitu_status compute_sums_over_ranks(const session_team *team, session_vertex_sums *sums,
                                             session_cell_list *lists, base_error *error)
{
    const int64_t bytes = sums->keys.count * session_count_sum_words(sums->field_count) * (int64_t)sizeof(int64_t);
    if (!error->status && !(lists && allocate_and_bound_sums(sums, lists, team->threads)))
        session_fail_for_memory(error, bytes, "gradients at vertices");
    /* the last entry is 1 if this rank has an error */
    double largest[3] = {sums->bounds.largest_difference, sums->bounds.largest_inverse_square,
                         error->status != INSITU_OK};
    insitu_status status = session_check_mpi(
        error, MPI_Allreduce(MPI_IN_PLACE, largest, 3, MPI_DOUBLE, MPI_MAX, team->comm), "MPI_Allreduce");
    sums->bounds = (session_gradient_bounds){largest[0], largest[1]};
    if (!status && largest[2] > 0) status = session_agree(team->comm, error);
    if (!status && !add_gradients_to_sums(sums, lists, team->threads))
        session_fail_for_memory(error, bytes, "gradients at vertices");
    return status;
}

insitu_status session_compute_vertex_sums(const session_homes *homes, const session_team *team,
                                          const session_extent *extent, session_vertex_sums *sums, base_error *error)
{
    int exponent = 0;
    sums_messages mail = {0};
    insitu_status status = INSITU_OK;
    session_cell_list *lists = base_calloc((size_t)sums->part_count, sizeof *lists);
    frexp(extent->half_diagonal, &exponent);
    sums->length = ldexp(1, exponent);
    if (team->ranks > 1) status = send_requests(homes, team, sums, &mail, error);
    if (!status) status = compute_sums_over_ranks(team, sums, lists, error);
    if (!status && team->ranks > 1) status = send_answers(team, sums, &mail, error);
    for (int i = 0; i < sums->part_count && lists; i++) base_free(lists[i].cells);
    base_free(lists);
    free_sum_messages(&mail);
    return status;
}

void session_vertex_sums_free(session_vertex_sums *sums)
{
    for (int i = 0; i < sums->part_count && sums->parts; i++) {
        base_free(sums->parts[i].key_indices);
        if (sums->parts[i].polynomials) session_polynomials_free(sums->parts[i].polynomials);
        base_free(sums->parts[i].polynomials);
    }
    base_free(sums->parts);
    base_free(sums->sums);
    session_keys_free(&sums->keys);
}
