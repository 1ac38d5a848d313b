/* Computes the normals of hits, the points at which rays meet isosurfaces, by central differences of the field. A rank
 * samples the field in its own cells at the six points around each of its hits, and requests samples from every rank
 * whose bounding box contains one of these points. A request is the hit (16 bytes); its answer is the samples (32
 * bytes). If ranks have compact parts of the domain, only hits near the faces between these parts cause requests.
 *
 *     rank A   hits -> own samples -> requests to ranks by their boxes ............ and all samples -> light
 *     rank B                          requests -> own samples -> answers
 *
 * Hits are processed in rounds, so that the memory for messages on each rank is limited to that of one round. */
#include "session_differences.h"

#include <math.h>
#include <string.h>

#include "memory.h"
#include "render_differences.h"
#include "session_agree.h"
#include "session_exchange.h"

enum {
    ROUND_HITS = 1 << 18,
    REQUEST_WORDS = sizeof(render_pending_hit) / 8,
    ANSWER_WORDS = sizeof(render_difference_samples) / 8
};

typedef struct difference_exchange {
    MPI_Comm comm;
    const render_job *job;
    render_pending_list *list;
    int rank, ranks;
    /* round_hits: number of this rank's hits per round; rounds: number of rounds, the same on all ranks */
    int64_t round_hits, rounds;
    /* near_ranks: the near_count ranks that may have samples for this rank's hits; boxes: bounding box of each rank's
     * cells */
    int near_count;
    int *near_ranks;
    render_box *boxes;
    /* first: index of the first hit of the current round; count: number of hits of the round; samples: the samples
     * around each hit of the round */
    int64_t first, count;
    render_difference_samples *samples;
    int64_t *requested_hits; /* for each sent request, in the order of the message: index of its hit in the round */
} difference_exchange;

/* ---- data shared by all ranks -------------------------------------------------------------------------------- */

/* Layout of the array of doubles whose maximum over the ranks is computed. Entries 2 i and 2 i + 1 are the negated
 * minimum and the maximum of the field of surface i, SHARED_ROUNDS is the number of rounds, and SHARED_FAILURE is 1 if
 * the rank has an error. */
enum { SHARED_ROUNDS = 2 * RENDER_MAX_ISOVALUES, SHARED_FAILURE, SHARED };

static insitu_status reduce_field_ranges(difference_exchange *d, base_error *error)
{
    double shared[SHARED] = {0}, ranges[RENDER_MAX_ISOVALUES][2];
    for (int i = 0; i < RENDER_MAX_ISOVALUES; i++) shared[2 * i] = shared[2 * i + 1] = -INFINITY;
    render_compute_field_ranges(d->job, ranges);
    for (int i = 0; i < d->job->surface_count; i++) {
        shared[2 * i] = -ranges[i][0];
        shared[2 * i + 1] = ranges[i][1];
    }
    const int64_t rounds = (d->list->count + d->round_hits - 1) / d->round_hits;
    shared[SHARED_ROUNDS] = (double)rounds;
    shared[SHARED_FAILURE] = error->status != INSITU_OK;
    insitu_status status = session_check_mpi(
        error, MPI_Allreduce(MPI_IN_PLACE, shared, SHARED, MPI_DOUBLE, MPI_MAX, d->comm), "MPI_Allreduce");
    if (status) return status;
    if (shared[SHARED_FAILURE] > 0) return session_agree(d->comm, error);
    for (int i = 0; i < RENDER_MAX_ISOVALUES; i++) {
        d->job->waiting_ranges[i][0] = -shared[2 * i];
        d->job->waiting_ranges[i][1] = shared[2 * i + 1];
    }
    d->rounds = (int64_t)shared[SHARED_ROUNDS];
    return INSITU_OK;
}

/* Lists the ranks whose boxes are near enough to contain samples for this rank's hits. The hits lie in this rank's own
 * box, so that the distance of their samples from this box is at most the largest sampling distance. */
static void list_near_ranks(difference_exchange *d)
{
    const render_box *own = &d->boxes[d->rank];
    double reach = 0;
    for (int64_t i = 0; i < d->list->count; i++) reach = fmax(reach, (double)d->list->items[i].reach);
    reach = (reach * 1.001 + 1e-4) / d->job->space.scale;
    for (int r = 0; r < d->ranks; r++) {
        bool is_near = r != d->rank;
        for (int a = 0; a < 3; a++)
            is_near = is_near && d->boxes[r].lower[a] <= own->upper[a] + reach &&
                      own->lower[a] - reach <= d->boxes[r].upper[a];
        if (is_near) d->near_ranks[d->near_count++] = r;
    }
}

static insitu_status gather_boxes_of_ranks(difference_exchange *d, base_error *error)
{
    const render_box own = render_differences_box(d->job);
    const int doubles = sizeof own / sizeof(double);
    const insitu_status status = session_check_mpi(
        error, MPI_Allgather(&own, doubles, MPI_DOUBLE, d->boxes, doubles, MPI_DOUBLE, d->comm), "MPI_Allgather");
    if (!status) list_near_ranks(d);
    return status;
}

/* ---- one round of requests and answers --------------------------------------------------------------------------- */

/* Packs, for each near rank, those hits of the round with sample points that may lie in the rank's box. Returns false
 * if memory runs out. */
static bool pack_sample_requests(difference_exchange *d, session_mail *out)
{
    int64_t capacity = d->count + 1;
    out->counts = base_calloc((size_t)d->ranks, sizeof *out->counts);
    out->words = base_alloc((size_t)capacity * REQUEST_WORDS * sizeof *out->words);
    d->requested_hits = base_alloc((size_t)capacity * sizeof *d->requested_hits);
    if (!out->counts || !out->words || !d->requested_hits) return false;
    int64_t requests = 0;
    for (int n = 0; n < d->near_count; n++)
        for (int64_t i = 0; i < d->count; i++) {
            const render_pending_hit *hit = &d->list->items[d->first + i];
            if (!render_difference_points_meet_box(d->job, hit, &d->boxes[d->near_ranks[n]])) continue;
            if (requests == capacity) {
                capacity += capacity / 2 + 1024;
                uint64_t *words = base_realloc(out->words, (size_t)capacity * REQUEST_WORDS * sizeof *words);
                if (words) out->words = words;
                int64_t *requested = base_realloc(d->requested_hits, (size_t)capacity * sizeof *requested);
                if (requested) d->requested_hits = requested;
                if (!words || !requested) return false;
            }
            memcpy(out->words + requests * REQUEST_WORDS, hit, sizeof *hit);
            d->requested_hits[requests++] = i;
            out->counts[d->near_ranks[n]] += REQUEST_WORDS;
        }
    out->total = requests * REQUEST_WORDS;
    return true;
}

/* Computes the answers to the requests in *in. Requests are read directly from the message, because its words are
 * sufficiently aligned for the type of a hit. */
static bool pack_sample_answers(const difference_exchange *d, const session_mail *in, session_mail *out,
                                base_error *error)
{
    const int64_t count = in->total / REQUEST_WORDS;
    out->total = count * ANSWER_WORDS;
    out->counts = base_calloc((size_t)d->ranks, sizeof *out->counts);
    out->words = base_alloc((size_t)(out->total + 1) * sizeof *out->words);
    if (!out->counts || !out->words) return false;
    for (int r = 0; r < d->ranks; r++) out->counts[r] = in->counts[r] / REQUEST_WORDS * ANSWER_WORDS;
    render_sample_pending_hits(d->job, (const render_pending_hit *)(const void *)in->words,
                               (render_difference_samples *)(void *)out->words, count, error);
    return true;
}

/* Exchanges requests and answers with other ranks. If an error occurs on one rank, the next exchange of messages
 * reports it to all ranks. */
static insitu_status exchange_samples_of_round(difference_exchange *d, base_error *error)
{
    session_mail sent_requests = {0}, received_requests = {0}, sent_answers = {0}, received_answers = {0};
    if (!pack_sample_requests(d, &sent_requests))
        session_fail_for_memory(error, d->count * 24, "samples of other ranks");
    insitu_status status = session_mail_deliver(d->comm, SESSION_MAIL_THERE, &sent_requests, &received_requests, error);
    if (!status && !error->status && !pack_sample_answers(d, &received_requests, &sent_answers, error))
        session_fail_for_memory(error, received_requests.total * 16, "samples for other ranks");
    if (!status) status = session_mail_deliver(d->comm, SESSION_MAIL_BACK, &sent_answers, &received_answers, error);
    if (!status && !error->status)
        for (int64_t i = 0; i < sent_requests.total / REQUEST_WORDS; i++)
            render_differences_merge(
                &d->samples[d->requested_hits[i]],
                (const render_difference_samples *)(const void *)(received_answers.words + i * ANSWER_WORDS));
    session_mail_free(&sent_requests);
    session_mail_free(&received_requests);
    session_mail_free(&sent_answers);
    session_mail_free(&received_answers);
    base_free(d->requested_hits);
    d->requested_hits = NULL;
    return status;
}

static void light_hits_of_round(const difference_exchange *d, fragment_list *fragments, base_error *error)
{
    const int64_t count = fragments->count + d->count;
    if (count > fragments->capacity) {
        fragment *items = base_realloc(fragments->items, (size_t)count * sizeof *items);
        if (!items) {
            session_fail_for_memory(error, count * (int64_t)sizeof *items, "fragments");
            return;
        }
        fragments->items = items;
        fragments->capacity = count;
    }
    if (!render_light_pending_hits(d->job, d->list, d->samples, d->first, d->count, fragments->items + fragments->count,
                                   error))
        fragments->count = count;
}

static insitu_status light_hits_in_rounds(difference_exchange *d, fragment_list *fragments, base_error *error)
{
    insitu_status status = INSITU_OK;
    for (int64_t round = 0; round < d->rounds && !status; round++) {
        const int64_t left = d->list->count - d->first;
        d->count = left < d->round_hits ? left : d->round_hits;
        if (!error->status) render_sample_pending_hits(d->job, d->list->items + d->first, d->samples, d->count, error);
        status = exchange_samples_of_round(d, error);
        if (!status && !error->status) light_hits_of_round(d, fragments, error);
        d->first += d->count;
    }
    return status;
}

static insitu_status compute_normals_by_differences(difference_exchange *d, fragment_list *fragments, base_error *error)
{
    const int64_t most = d->list->count < d->round_hits ? d->list->count : d->round_hits;
    d->samples = base_alloc((size_t)(most + 1) * sizeof *d->samples);
    d->boxes = base_alloc((size_t)d->ranks * sizeof *d->boxes);
    d->near_ranks = base_alloc((size_t)d->ranks * sizeof *d->near_ranks);
    if (!d->samples || !d->boxes || !d->near_ranks || !render_differences_sort(d->job, d->list))
        session_fail_for_memory(error, most * 64, "normals by differences");
    insitu_status status = reduce_field_ranges(d, error);
    if (!status && d->rounds) status = gather_boxes_of_ranks(d, error);
    if (!status) status = light_hits_in_rounds(d, fragments, error);
    base_free(d->samples);
    base_free(d->boxes);
    base_free(d->near_ranks);
    return status;
}

insitu_status session_light_hits_by_differences(MPI_Comm comm, const render_job *job, fragment_list *fragments,
                                                double *ms, base_error *error)
{
    const double start = MPI_Wtime();
    difference_exchange d = {.comm = comm, .job = job, .list = job->waiting};
    MPI_Comm_rank(comm, &d.rank);
    MPI_Comm_size(comm, &d.ranks);
    d.round_hits = session_count_items_per_round(d.ranks, ROUND_HITS);
    const insitu_status status = compute_normals_by_differences(&d, fragments, error);
    base_free(d.list->items);
    base_free(d.list->shadings);
    *d.list = (render_pending_list){0};
    *ms += 1e3 * (MPI_Wtime() - start);
    return status;
}
