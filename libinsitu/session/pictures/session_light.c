/* Computes shadows and ambient occlusion over all ranks. The rank that has a hit computes its lighting. This rank first
 * traces the hit's shadow and occlusion rays in its own cells, which block most of the rays. Then it sends requests to
 * the ranks whose bounding boxes are intersected by rays that are not blocked yet. A request consists of the hit and
 * the set of its unblocked rays, 32 bytes in all; the other rank computes the rays from the hit in the same way. The
 * answer is the set of rays that are still unblocked (16 bytes).
 *
 *     rank A   hits -> own cells -> unblocked rays -> requests to ranks by their boxes ...... all answers -> colours
 *     rank B                                          requests -> own cells -> unblocked rays -> answers
 *
 * Hits are processed in rounds, so that the memory for messages on each rank is limited to that of one round. */
#include "session_light.h"

#include <string.h>

#include "memory.h"
#include "render_light.h"
#include "session_agree.h"
#include "session_exchange.h"

enum { ROUND_HITS = 1 << 16 };

/* Sizes of one request and of one answer in 8-byte words. A request consists of a hit and the set of its shadow and
 * occlusion rays to trace; an answer is the set of those that are not blocked. */
enum {
    REQUEST_WORDS = sizeof(render_hit) / 8 + sizeof(render_hit_rays) / 8,
    ANSWER_WORDS = sizeof(render_hit_rays) / 8
};

/* The data of one round: the hits of this rank whose lighting is computed in the round, and for each hit the rays that
 * are not blocked yet. */
typedef struct lighting {
    MPI_Comm comm;
    const render_job *job;
    int rank, ranks;
    render_occluders *occluders; /* this rank's opaque surfaces, which may block rays */
    int64_t round_hits;
    render_box *boxes; /* bounding box of each rank's cells */
    int64_t count;
    int64_t *fragments; /* for each hit, the index of its fragment */
    render_hit *hits;
    render_hit_rays *rays;
} lighting;

/* The requests that this rank sends in a round, in the order of the hits for which they are sent. Request i is
 * described by element i of three arrays: ranks has the rank to which it is sent, hits the index of its hit in the
 * round, and rays the set of rays to trace. */
typedef struct request_list {
    int64_t count, capacity;
    int *ranks;
    int64_t *hits;
    render_hit_rays *rays;
    int64_t current_hit; /* index of the hit for which requests are being added */
    const lighting *lighting_state;
    int64_t *first_requests; /* ranks + 1 entries: position in the message of the first request to each rank */
    int64_t *message_order;  /* for each position of a request in the message, the index of the request in this list */
    bool has_no_memory;
} request_list;

static insitu_status gather_occluder_boxes_of_ranks(lighting *l, base_error *error)
{
    const render_box own = render_occluder_box(l->job);
    const int doubles = sizeof own / sizeof(double);
    l->boxes = base_alloc((size_t)l->ranks * sizeof *l->boxes);
    if (!l->boxes) session_fail_for_memory(error, (int64_t)((size_t)l->ranks * sizeof *l->boxes), "the ranks' bounds");
    const insitu_status status = session_agree(l->comm, error);
    if (status) return status;
    return session_check_mpi(error, MPI_Allgather(&own, doubles, MPI_DOUBLE, l->boxes, doubles, MPI_DOUBLE, l->comm),
                             "MPI_Allgather");
}

/* ---- sending requests -------------------------------------------------------------------------------------------- */

static bool grow_request_list(request_list *q)
{
    const int64_t capacity = q->capacity + q->capacity / 2 + 1024;
    int *ranks = base_realloc(q->ranks, (size_t)capacity * sizeof *ranks);
    if (ranks) q->ranks = ranks;
    int64_t *hits = base_realloc(q->hits, (size_t)capacity * sizeof *hits);
    if (hits) q->hits = hits;
    render_hit_rays *rays = base_realloc(q->rays, (size_t)capacity * sizeof *rays);
    if (rays) q->rays = rays;
    if (!ranks || !hits || !rays) return false;
    q->capacity = capacity;
    return true;
}

static void free_requests(request_list *q)
{
    base_free(q->ranks);
    base_free(q->hits);
    base_free(q->rays);
    base_free(q->first_requests);
    base_free(q->message_order);
}

static void add_request(void *state, int rank, const render_hit_rays *rays)
{
    request_list *q = state;
    if (rank == q->lighting_state->rank || q->has_no_memory) return;
    if (q->count == q->capacity && !grow_request_list(q)) {
        q->has_no_memory = true;
        return;
    }
    q->ranks[q->count] = rank;
    q->hits[q->count] = q->current_hit;
    q->rays[q->count++] = *rays;
}

/* Sorts the requests by the rank to which they are sent. */
static bool sort_requests(request_list *q)
{
    const int ranks = q->lighting_state->ranks;
    q->first_requests = base_calloc((size_t)ranks + 1, sizeof *q->first_requests);
    q->message_order = base_alloc((size_t)q->count * sizeof *q->message_order);
    if (!q->first_requests || !q->message_order) return false;
    for (int64_t i = 0; i < q->count; i++) q->first_requests[q->ranks[i]]++;
    for (int r = 1; r <= ranks; r++) q->first_requests[r] += q->first_requests[r - 1];
    for (int64_t i = q->count; i-- > 0;) q->message_order[--q->first_requests[q->ranks[i]]] = i;
    return true;
}

static bool pack_ray_requests(const lighting *l, const request_list *q, session_mail *out)
{
    out->total = q->count * REQUEST_WORDS;
    out->counts = base_alloc((size_t)l->ranks * sizeof *out->counts);
    out->words = base_alloc((size_t)out->total * sizeof *out->words);
    if (!out->counts || !out->words) return false;
    for (int r = 0; r < l->ranks; r++)
        out->counts[r] = (q->first_requests[r + 1] - q->first_requests[r]) * REQUEST_WORDS;
    for (int64_t i = 0; i < q->count; i++) {
        uint64_t *words = out->words + i * REQUEST_WORDS;
        const int64_t k = q->message_order[i];
        memcpy(words, &l->hits[q->hits[k]], sizeof *l->hits);
        memcpy(words + sizeof *l->hits / 8, &q->rays[k], sizeof *q->rays);
    }
    return true;
}

static insitu_status send_requests(const lighting *l, request_list *q, session_mail *in, base_error *error)
{
    session_mail out = {0};
    *q = (request_list){.lighting_state = l};
    for (q->current_hit = 0; q->current_hit < l->count; q->current_hit++)
        if (l->rays[q->current_hit].samples || l->rays[q->current_hit].lights)
            render_find_boxes_met_by_rays(l->job, &l->hits[q->current_hit], &l->rays[q->current_hit], l->boxes,
                                          l->ranks, add_request, q);
    if (q->has_no_memory || !sort_requests(q) || !pack_ray_requests(l, q, &out))
        session_fail_for_memory(error, q->count * REQUEST_WORDS * 8, "rays to other ranks");
    insitu_status status = session_agree(l->comm, error);
    if (!status) status = session_mail_exchange(l->comm, &out, in, error);
    session_mail_free(&out);
    return status;
}

/* ---- answering requests ------------------------------------------------------------------------------------------ */

/* Copies the requests into an array of hits and an array of rays, because in the message each hit is followed by its
 * rays. */
static bool unpack_ray_requests(const session_mail *in, render_hit **hits, render_hit_rays **rays)
{
    const int64_t count = in->total / REQUEST_WORDS;
    *hits = base_alloc((size_t)count * sizeof **hits);
    *rays = base_alloc((size_t)count * sizeof **rays);
    if (!*hits || !*rays) return false;
    for (int64_t i = 0; i < count; i++) {
        const uint64_t *words = in->words + i * REQUEST_WORDS;
        memcpy(&(*hits)[i], words, sizeof **hits);
        memcpy(&(*rays)[i], words + sizeof **hits / 8, sizeof **rays);
    }
    return true;
}

/* Computes the answers to the requests in *in, and overwrites the requests with the answers. */
static insitu_status answer_requests(const lighting *l, session_mail *in, base_error *error)
{
    render_hit *hits = NULL;
    render_hit_rays *rays = NULL;
    const int64_t count = in->total / REQUEST_WORDS;
    if (unpack_ray_requests(in, &hits, &rays))
        render_clear_blocked_rays(l->occluders, hits, rays, count, error);
    else
        session_fail_for_memory(error, in->total * 8, "rays of other ranks");
    if (!error->status && rays) memcpy(in->words, rays, (size_t)count * sizeof *rays);
    for (int r = 0; r < l->ranks; r++) in->counts[r] = in->counts[r] / REQUEST_WORDS * ANSWER_WORDS;
    in->total = count * ANSWER_WORDS;
    base_free(hits);
    base_free(rays);
    return session_agree(l->comm, error);
}

static void clear_blocked_rays(lighting *l, const request_list *q, const session_mail *answers)
{
    for (int64_t i = 0; i < q->count; i++) {
        const int64_t k = q->message_order[i];
        const render_hit_rays *requested = &q->rays[k];
        render_hit_rays open, *rays = &l->rays[q->hits[k]];
        memcpy(&open, answers->words + i * ANSWER_WORDS, sizeof open);
        rays->samples &= ~(requested->samples & ~open.samples);
        rays->lights &= ~(requested->lights & ~open.lights);
    }
}

static insitu_status exchange_requests(lighting *l, base_error *error)
{
    request_list q;
    session_mail in = {0}, answers = {0};
    insitu_status status = send_requests(l, &q, &in, error);
    if (!status) status = answer_requests(l, &in, error);
    if (!status) status = session_mail_exchange(l->comm, &in, &answers, error);
    if (!status) clear_blocked_rays(l, &q, &answers);
    session_mail_free(&in);
    session_mail_free(&answers);
    free_requests(&q);
    return status;
}

/* ---- lighting in rounds ------------------------------------------------------------------------------------------ */

/* Collects the hits of a round: goes through the fragments from index `first` on until it reaches the end or has found
 * round_hits fragments that need shadow or occlusion rays. The lighting of fragments that need no such rays is computed
 * immediately. Returns the index of the fragment at which the next round continues. */
static int64_t collect_hits(lighting *l, fragment_list *fragments, int64_t first)
{
    static const render_hit_rays none = {0, 0, 0};
    for (l->count = 0; first < fragments->count && l->count < l->round_hits; first++) {
        fragment *f = &fragments->items[first];
        if (render_make_hit_from_fragment(l->job, f, &l->hits[l->count], &l->rays[l->count]))
            l->fragments[l->count++] = first;
        else
            render_light_fragment(l->job, &none, f);
    }
    return first;
}

static void shade_hits(const lighting *l, fragment_list *fragments)
{
    for (int64_t i = 0; i < l->count; i++)
        render_light_fragment(l->job, &l->rays[i], &fragments->items[l->fragments[i]]);
}

/* Determines, by a reduction, whether any rank has fragments left for another round. */
static insitu_status any_rank_has_more_fragments(const lighting *l, bool has_more, bool *out, base_error *error)
{
    int own = has_more, all = 0;
    const insitu_status status =
        session_check_mpi(error, MPI_Allreduce(&own, &all, 1, MPI_INT, MPI_MAX, l->comm), "MPI_Allreduce");
    *out = all;
    return status;
}

static insitu_status light_fragments_in_rounds(lighting *l, fragment_list *fragments, base_error *error)
{
    int64_t at = 0;
    bool goes_on = false;
    insitu_status status = any_rank_has_more_fragments(l, fragments->count > 0, &goes_on, error);
    while (!status && goes_on) {
        at = collect_hits(l, fragments, at);
        render_clear_blocked_rays(l->occluders, l->hits, l->rays, l->count, error);
        status = session_agree(l->comm, error);
        if (!status && l->ranks > 1) status = exchange_requests(l, error);
        if (!status) shade_hits(l, fragments);
        if (!status) status = any_rank_has_more_fragments(l, at < fragments->count, &goes_on, error);
    }
    return status;
}

insitu_status session_light_fragments(MPI_Comm comm, const render_job *job, render_occluders **occluders,
                                      fragment_list *fragments, double *ms, base_error *error)
{
    const double start = MPI_Wtime();
    lighting l = {.comm = comm, .job = job};
    MPI_Comm_rank(comm, &l.rank);
    MPI_Comm_size(comm, &l.ranks);
    l.round_hits = session_count_items_per_round(l.ranks, ROUND_HITS);
    const int64_t most = fragments->count < l.round_hits ? fragments->count : l.round_hits;
    l.fragments = base_alloc((size_t)(most + 1) * sizeof *l.fragments);
    l.hits = base_alloc((size_t)(most + 1) * sizeof *l.hits);
    l.rays = base_alloc((size_t)(most + 1) * sizeof *l.rays);
    if (!l.fragments || !l.hits || !l.rays)
        session_fail_for_memory(error, most * 40, "hits that are lit");
    else if (!*occluders)
        render_occluders_create(job, occluders, error);
    l.occluders = *occluders;
    insitu_status status = session_agree(comm, error);
    if (!status) status = gather_occluder_boxes_of_ranks(&l, error);
    if (!status) status = light_fragments_in_rounds(&l, fragments, error);
    base_free(l.fragments);
    base_free(l.hits);
    base_free(l.rays);
    base_free(l.boxes);
    *ms += 1e3 * (MPI_Wtime() - start);
    return status;
}
