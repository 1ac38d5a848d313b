#include "session_hanging.h"

#include <math.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_cell_faces.h"
#include "session_outer_faces.h"
#include "vector3.h"

/* The share of a quad's width by which a vertex may be off it: roundings of codes that compute hanging vertices in
 * other ways. Vertices that hang are an eighth of it apart, or more. */
static const double place_slack = 1e-5;

/* A quad must have that much more area than those whose corner a vertex is, for the vertex to hang on it: quads that
 * are divided once, along one side, have twice the area of their parts. */
static const double least_ratio = 1.25;

/* Coordinates on the quad are rounded to whole parts of it, from which they may be off by a hundredth of a part: 2:1,
 * 3:1 and 4:1 are exact then, however coordinates round. */
enum { PARTS = 96 };

enum { QUAD_WORDS = 12, MOST_ROUNDS = 64 };

typedef struct quad {
    double places[4][3]; /* around, from the least on, towards the lesser of its neighbours */
    int64_t groups[4];   /* of this rank's own; else -1 */
    int source;          /* the rank that sent it, */
    int64_t number;      /* and its place in that rank's message */
    double area, width;
} quad;

/* A vertex, and the quads that were found at it. */
typedef struct candidate {
    double place[3];
    int64_t group;
    double corner_area; /* of the largest quad with this corner */
    int64_t quad;       /* the largest that it lies on; -1: none */
    double at[2];
} candidate;

typedef struct hanging_search {
    const session_hanging_basis *basis;
    const session_team *team;
    unsigned char *is_border; /* a byte a vertex: of faces that this rank has once */
    int64_t quad_count, own_count, candidate_count;
    quad *quads; /* this rank's, then received ones */
    candidate *candidates;
    double rounding; /* of coordinates */
    /* Bins of candidates. */
    double lower[3], size;
    int64_t bins[3];
    int64_t *starts, *items;
} hanging_search;

static void search_free(hanging_search *s)
{
    base_free(s->is_border);
    base_free(s->quads);
    base_free(s->candidates);
    base_free(s->starts);
    base_free(s->items);
}

/* ---- quads ---------------------------------------------------------------------------------------------------- */

static int compare_places(const double a[3], const double b[3])
{
    for (int axis = 0; axis < 3; axis++)
        if (a[axis] != b[axis]) return a[axis] < b[axis] ? -1 : 1;
    return 0;
}

static void measure_quad(quad *q)
{
    double a[3], b[3], normal[3];
    for (int axis = 0; axis < 3; axis++) {
        a[axis] = q->places[2][axis] - q->places[0][axis];
        b[axis] = q->places[3][axis] - q->places[1][axis];
    }
    for (int axis = 0; axis < 3; axis++) {
        const int next = (axis + 1) % 3, last = (axis + 2) % 3;
        normal[axis] = a[next] * b[last] - a[last] * b[next];
    }
    q->area = sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]) / 2;
    q->width = sqrt(fmax(a[0] * a[0] + a[1] * a[1] + a[2] * a[2], b[0] * b[0] + b[1] * b[1] + b[2] * b[2]));
}

/* False where the face is no quad of a cell. */
static bool read_quad(const session_hanging_basis *basis, const session_face *face, quad *out)
{
    const session_cell_faces faces = session_faces_of_cell(&basis->mesh->cells, face->cell);
    const session_face_loop loop = session_face_of(&faces, face->face);
    double places[4][3];
    int64_t groups[4];
    int least = 0;
    if (loop.size != 4 || faces.size) return false;
    for (int i = 0; i < 4; i++) {
        const int64_t vertex = session_face_vertex(&loop, i);
        grid_vertex(&basis->mesh->cells, vertex, places[i]);
        groups[i] = basis->of_vertex[vertex];
        for (int k = 0; k < i; k++)
            if (compare_places(places[k], places[i]) == 0) return false;
        if (compare_places(places[i], places[least]) < 0) least = i;
    }
    const int step = compare_places(places[(least + 3) % 4], places[(least + 1) % 4]) < 0 ? 3 : 1;
    for (int i = 0; i < 4; i++) {
        memcpy(out->places[i], places[(least + step * i) % 4], sizeof places[i]);
        out->groups[i] = groups[(least + step * i) % 4];
    }
    measure_quad(out);
    return out->area > 0;
}

static bool read_quads(hanging_search *s, const session_outer *outer)
{
    s->quads = base_alloc((size_t)(outer->face_count + 1) * sizeof *s->quads);
    if (!s->quads) return false;
    for (int64_t i = 0; i < outer->face_count; i++)
        if (read_quad(s->basis, &outer->faces[i], &s->quads[s->own_count])) {
            s->quads[s->own_count].source = s->team->rank;
            s->own_count++;
        }
    s->quad_count = s->own_count;
    return true;
}

static bool does_meet(const quad *q, const session_box *box, double margin)
{
    for (int axis = 0; axis < 3; axis++) {
        double low = q->places[0][axis], high = low;
        for (int i = 1; i < 4; i++) {
            low = fmin(low, q->places[i][axis]);
            high = fmax(high, q->places[i][axis]);
        }
        if (!(low - margin <= box->upper[axis] && box->lower[axis] - margin <= high)) return false;
    }
    return true;
}

static double slack_of(const hanging_search *s, const quad *q)
{
    return place_slack * q->width + s->rounding;
}

/* Lists the quads for each rank whose box they meet; counts words where there is no room. */
static void send_quads(const hanging_search *s, session_mail *mail, int64_t *sent)
{
    const session_homes *homes = s->basis->homes;
    mail->total = 0;
    for (int n = 0; n < homes->near_count; n++) {
        const int64_t first = mail->total;
        for (int64_t i = 0; i < s->own_count && homes->near[n] != s->team->rank; i++) {
            if (!does_meet(&s->quads[i], &homes->boxes[n], slack_of(s, &s->quads[i]))) continue;
            if (mail->words) {
                memcpy(mail->words + mail->total, s->quads[i].places, sizeof s->quads[i].places);
                sent[mail->total / QUAD_WORDS] = i;
            }
            mail->total += QUAD_WORDS;
        }
        mail->counts[homes->near[n]] = mail->total - first;
    }
}

/* sent: which quad each of the mail is. */
static bool pack_quads(const hanging_search *s, session_mail *mail, int64_t **sent)
{
    mail->counts = base_calloc((size_t)s->team->ranks, sizeof *mail->counts);
    if (!mail->counts) return false;
    send_quads(s, mail, NULL);
    mail->words = base_alloc((size_t)mail->total * sizeof *mail->words + 1);
    *sent = base_alloc((size_t)(mail->total / QUAD_WORDS + 1) * sizeof **sent);
    if (!mail->words || !*sent) return false;
    send_quads(s, mail, *sent);
    return true;
}

static bool take_quads(hanging_search *s, const session_mail *in)
{
    const int64_t count = in->total / QUAD_WORDS;
    quad *quads = base_realloc(s->quads, (size_t)(s->own_count + count + 1) * sizeof *quads);
    if (!quads) return false;
    s->quads = quads;
    int64_t at = 0;
    for (int rank = 0; rank < s->team->ranks; rank++)
        for (int64_t number = 0; number < in->counts[rank] / QUAD_WORDS; number++, at++) {
            quad *q = &quads[s->quad_count++];
            memcpy(q->places, in->words + QUAD_WORDS * at, sizeof q->places);
            for (int i = 0; i < 4; i++) q->groups[i] = -1;
            q->source = rank;
            q->number = number;
            measure_quad(q);
        }
    return true;
}

/* ---- candidates ----------------------------------------------------------------------------------------------- */

static bool list_candidates(hanging_search *s)
{
    const session_mesh *mesh = s->basis->mesh;
    int64_t *found = base_alloc((size_t)(s->basis->group_count + 1) * sizeof *found);
    s->candidates = base_alloc((size_t)(s->basis->group_count + 1) * sizeof *s->candidates);
    if (!found || !s->candidates) {
        base_free(found);
        return false;
    }
    for (int64_t g = 0; g < s->basis->group_count; g++) found[g] = -1;
    for (int64_t v = 0; mesh && v < mesh->cells.vertex_count; v++) {
        const int64_t group = s->basis->of_vertex[v];
        if (!s->is_border[v] || group < 0 || found[group] >= 0) continue;
        candidate *c = &s->candidates[s->candidate_count];
        *c = (candidate){.group = group, .quad = -1};
        grid_vertex(&mesh->cells, v, c->place);
        found[group] = s->candidate_count++;
    }
    base_free(found);
    return true;
}

static int64_t bin_along(const hanging_search *s, double place, int axis)
{
    const double at = (place - s->lower[axis]) / s->size;
    return at < 0 ? 0 : at >= (double)s->bins[axis] ? s->bins[axis] - 1 : (int64_t)at;
}

static int64_t bin_of(const hanging_search *s, const double place[3])
{
    return bin_along(s, place[0], 0) +
           s->bins[0] * (bin_along(s, place[1], 1) + s->bins[1] * bin_along(s, place[2], 2));
}

/* Cubes, about as many as there are candidates on a surface. */
static bool make_bins(hanging_search *s)
{
    double upper[3], widest = 0;
    for (int axis = 0; axis < 3; axis++) {
        s->lower[axis] = (double)INFINITY;
        upper[axis] = -(double)INFINITY;
        for (int64_t i = 0; i < s->candidate_count; i++) {
            s->lower[axis] = fmin(s->lower[axis], s->candidates[i].place[axis]);
            upper[axis] = fmax(upper[axis], s->candidates[i].place[axis]);
        }
        widest = fmax(widest, upper[axis] - s->lower[axis]);
    }
    const double across = fmin(fmax(sqrt((double)s->candidate_count) / 2, 1), 128);
    s->size = widest > 0 ? widest / across : 1;
    int64_t count = 1;
    for (int axis = 0; axis < 3; axis++) {
        s->bins[axis] = s->candidate_count ? (int64_t)((upper[axis] - s->lower[axis]) / s->size) + 1 : 1;
        count *= s->bins[axis];
    }
    s->starts = base_calloc((size_t)count + 2, sizeof *s->starts);
    s->items = base_alloc((size_t)(s->candidate_count + 1) * sizeof *s->items);
    if (!s->starts || !s->items) return false;
    for (int64_t i = 0; i < s->candidate_count; i++) s->starts[bin_of(s, s->candidates[i].place) + 2]++;
    for (int64_t b = 0; b < count; b++) s->starts[b + 2] += s->starts[b + 1];
    for (int64_t i = 0; i < s->candidate_count; i++) s->items[s->starts[bin_of(s, s->candidates[i].place) + 1]++] = i;
    return true;
}

/* ---- places on quads ------------------------------------------------------------------------------------------ */

static double distance(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
}

static void place_on(const quad *q, const double at[2], double out[3], double slopes[2][3])
{
    for (int axis = 0; axis < 3; axis++) {
        const double a = q->places[0][axis], b = q->places[1][axis], c = q->places[2][axis], d = q->places[3][axis];
        slopes[0][axis] = (1 - at[1]) * (b - a) + at[1] * (c - d);
        slopes[1][axis] = (1 - at[0]) * (d - a) + at[0] * (c - b);
        out[axis] = (1 - at[1]) * (a + at[0] * (b - a)) + at[1] * (d + at[0] * (c - d));
    }
}

/* A whole part of the quad where it is one but for rounding. */
static double rounded(double at)
{
    const double parts = round(at * PARTS);
    return fabs(at * PARTS - parts) < 0.01 ? parts / PARTS : at;
}

/* Newton's method, from the middle. Returns whether the place is on the quad. */
static bool find_on_quad(const quad *q, const double place[3], double slack, double at[2])
{
    double on[3], slopes[2][3], off[3];
    at[0] = at[1] = 0.5;
    for (int step = 0; step < 12; step++) {
        place_on(q, at, on, slopes);
        for (int axis = 0; axis < 3; axis++) off[axis] = place[axis] - on[axis];
        const double aa = vector3_dot(slopes[0], slopes[0]), ab = vector3_dot(slopes[0], slopes[1]),
                     bb = vector3_dot(slopes[1], slopes[1]);
        const double a = vector3_dot(slopes[0], off), b = vector3_dot(slopes[1], off), det = aa * bb - ab * ab;
        if (!(det > 0)) return false;
        at[0] += (a * bb - b * ab) / det;
        at[1] += (b * aa - a * ab) / det;
        if (!(fabs(at[0]) < 4 && fabs(at[1]) < 4)) return false;
    }
    for (int k = 0; k < 2; k++) at[k] = rounded(at[k]);
    place_on(q, at, on, slopes);
    return at[0] >= 0 && at[0] <= 1 && at[1] >= 0 && at[1] <= 1 && distance(on, place) <= slack;
}

static bool is_larger(const quad *a, const quad *b)
{
    if (a->area != b->area) return a->area > b->area;
    for (int i = 0; i < 4; i++) {
        const int sign = compare_places(a->places[i], b->places[i]);
        if (sign) return sign < 0;
    }
    return false;
}

static void try_quad(hanging_search *s, int64_t number, candidate *c)
{
    const quad *q = &s->quads[number];
    const double slack = slack_of(s, q);
    double at[2];
    for (int i = 0; i < 4; i++)
        if (distance(q->places[i], c->place) <= slack) {
            c->corner_area = fmax(c->corner_area, q->area);
            return;
        }
    if (c->quad >= 0 && !is_larger(q, &s->quads[c->quad])) return;
    if (!find_on_quad(q, c->place, slack, at)) return;
    c->quad = number;
    memcpy(c->at, at, sizeof c->at);
}

static void try_quads(hanging_search *s)
{
    for (int64_t number = 0; number < s->quad_count && s->candidate_count; number++) {
        const quad *q = &s->quads[number];
        const double slack = slack_of(s, q);
        int64_t low[3], high[3];
        for (int axis = 0; axis < 3; axis++) {
            double least = q->places[0][axis], most = least;
            for (int i = 1; i < 4; i++) {
                least = fmin(least, q->places[i][axis]);
                most = fmax(most, q->places[i][axis]);
            }
            low[axis] = bin_along(s, least - slack, axis);
            high[axis] = bin_along(s, most + slack, axis);
        }
        for (int64_t k = low[2]; k <= high[2]; k++)
            for (int64_t j = low[1]; j <= high[1]; j++) {
                const int64_t row = s->bins[0] * (j + s->bins[1] * k);
                for (int64_t i = s->starts[row + low[0]]; i < s->starts[row + high[0] + 1]; i++)
                    try_quad(s, number, &s->candidates[s->items[i]]);
            }
    }
}

static bool hangs(const hanging_search *s, const candidate *c)
{
    return c->quad >= 0 && s->quads[c->quad].area > least_ratio * c->corner_area;
}

/* ---- what is kept --------------------------------------------------------------------------------------------- */

/* Marks the received quads that are used, and writes their numbers to their ranks. firsts: the place of each used
 * quad's first value among those that will come. */
static bool want_quads(const hanging_search *s, session_mail *wanted, int64_t **firsts)
{
    int64_t *first = base_alloc((size_t)(s->quad_count + 1) * sizeof *first);
    wanted->counts = base_calloc((size_t)s->team->ranks, sizeof *wanted->counts);
    wanted->words = base_alloc((size_t)(s->quad_count + 1) * sizeof *wanted->words);
    *firsts = first;
    if (!first || !wanted->counts || !wanted->words) return false;
    for (int64_t i = 0; i < s->quad_count; i++) first[i] = -1;
    for (int64_t i = 0; i < s->candidate_count; i++)
        if (hangs(s, &s->candidates[i])) first[s->candidates[i].quad] = 0;
    for (int64_t i = s->own_count; i < s->quad_count; i++) { /* in the order of ranks */
        if (first[i] < 0) continue;
        first[i] = 4 * wanted->total;
        wanted->words[wanted->total++] = (uint64_t)s->quads[i].number;
        wanted->counts[s->quads[i].source]++;
    }
    return true;
}

static bool keep_vertices(const hanging_search *s, const int64_t *firsts, session_hanging *out)
{
    int64_t count = 0;
    for (int64_t i = 0; i < s->candidate_count; i++) count += hangs(s, &s->candidates[i]);
    out->vertices = base_alloc((size_t)(count + 1) * sizeof *out->vertices);
    if (!out->vertices) return false;
    for (int64_t i = 0; i < s->candidate_count; i++) {
        const candidate *c = &s->candidates[i];
        if (!hangs(s, c)) continue;
        const quad *q = &s->quads[c->quad];
        session_hanging_vertex *v = &out->vertices[out->count++];
        const double u = c->at[0], w = c->at[1], weights[4] = {(1 - u) * (1 - w), u * (1 - w), u * w, (1 - u) * w};
        v->group = c->group;
        memcpy(v->weights, weights, sizeof weights);
        v->is_received = c->quad >= s->own_count;
        for (int k = 0; k < 4; k++) v->corners[k] = v->is_received ? firsts[c->quad] + k : q->groups[k];
    }
    return true;
}

/* requests: numbers of quads of this rank's message to each rank, whose values it wants. */
static bool keep_requests(const hanging_search *s, const session_mail *quads, const int64_t *sent,
                          const session_mail *requests, session_hanging *out)
{
    out->sent_counts = base_calloc((size_t)s->team->ranks, sizeof *out->sent_counts);
    out->sent_groups = base_alloc((size_t)(4 * requests->total + 1) * sizeof *out->sent_groups);
    if (!out->sent_counts || !out->sent_groups) return false;
    const uint64_t *word = requests->words;
    int64_t first = 0;
    for (int rank = 0; rank < s->team->ranks; rank++) {
        for (int64_t i = 0; i < requests->counts[rank]; i++) {
            const quad *q = &s->quads[sent[first + (int64_t)*word++]];
            memcpy(out->sent_groups + out->sent_total, q->groups, sizeof q->groups);
            out->sent_total += 4;
        }
        out->sent_counts[rank] = 4 * requests->counts[rank];
        first += quads->counts[rank] / QUAD_WORDS;
    }
    return true;
}

/* ---- finding -------------------------------------------------------------------------------------------------- */

static insitu_status find_own(hanging_search *s, base_error *error)
{
    const session_mesh *mesh = s->basis->mesh;
    session_outer outer = {0};
    if (mesh) {
        s->is_border = base_calloc((size_t)mesh->cells.vertex_count + 1, 1);
        if (!s->is_border) session_no_memory(error, mesh->cells.vertex_count, "hanging vertices");
    }
    insitu_status status = session_agree(s->team->comm, error);
    if (!status) status = session_find_outer_faces(mesh, &outer, s->basis->homes, s->team, s->is_border, error);
    if (status) return status;
    if (!read_quads(s, &outer) || !list_candidates(s) || !make_bins(s))
        session_no_memory(error, (outer.face_count + s->basis->group_count) * 200, "hanging vertices");
    session_drop_outer(&outer, true);
    return INSITU_OK;
}

/* What fails here alone stays in *error. */
static insitu_status find_shared(hanging_search *s, session_hanging *out, base_error *error)
{
    session_mail quads = {0}, in = {0}, wanted = {0}, requests = {0};
    int64_t *sent = NULL, *firsts = NULL;
    if (!error->status && !pack_quads(s, &quads, &sent))
        session_no_memory(error, s->own_count * 96, "hanging vertices");
    insitu_status status = session_mail_deliver(s->team->comm, SESSION_MAIL_THERE, &quads, &in, error);
    if (!status && !error->status) {
        bool is_done = take_quads(s, &in);
        if (is_done) try_quads(s);
        is_done = is_done && want_quads(s, &wanted, &firsts) && keep_vertices(s, firsts, out);
        if (!is_done) session_no_memory(error, s->quad_count * 150, "hanging vertices");
    }
    if (!status) status = session_mail_deliver(s->team->comm, SESSION_MAIL_BACK, &wanted, &requests, error);
    if (!status && !error->status && !keep_requests(s, &quads, sent, &requests, out))
        session_no_memory(error, requests.total * 32, "hanging vertices");
    session_mail_free(&quads);
    session_mail_free(&in);
    session_mail_free(&wanted);
    session_mail_free(&requests);
    base_free(sent);
    base_free(firsts);
    return status;
}

static insitu_status count_all(const session_team *team, session_hanging *out, base_error *error)
{
    int64_t count = out->count;
    const insitu_status status =
        session_mpi(error, MPI_Allreduce(MPI_IN_PLACE, &count, 1, MPI_INT64_T, MPI_SUM, team->comm), "MPI_Allreduce");
    out->total = count;
    return status;
}

insitu_status session_update_hanging(session_hanging *hanging, const session_hanging_basis *basis,
                                     const session_team *team, base_error *error)
{
    hanging_search search = {.basis = basis, .team = team};
    session_hanging found = {.is_known = true};
    if (hanging->is_known) return INSITU_OK;
    const session_mesh *mesh = basis->mesh;
    for (int axis = 0; axis < 3 && mesh && mesh->drawn_count; axis++) {
        const double largest = fmax(fabs(mesh->lower[axis]), fabs(mesh->upper[axis]));
        search.rounding = fmax(search.rounding, largest * (mesh->cells.coordinates[axis].is_wide ? 0x1p-50 : 0x1p-21));
    }
    insitu_status status = find_own(&search, error);
    if (!status) status = find_shared(&search, &found, error);
    search_free(&search);
    if (!status) status = session_agree(team->comm, error);
    if (!status) status = count_all(team, &found, error);
    if (status) {
        session_hanging_free(&found);
        return status;
    }
    session_hanging_free(hanging);
    *hanging = found;
    return INSITU_OK;
}

/* ---- values --------------------------------------------------------------------------------------------------- */

/* Returns whether a value changed. */
static bool constrain(const session_hanging *hanging, const double *received, double *means)
{
    bool is_changed = false;
    for (int64_t i = 0; i < hanging->count; i++) {
        const session_hanging_vertex *v = &hanging->vertices[i];
        double value = 0;
        for (int k = 0; k < 4; k++)
            if (v->weights[k] > 0) value += v->weights[k] * (v->is_received ? received : means)[v->corners[k]];
        if (!isfinite(value) || value == means[v->group]) continue;
        means[v->group] = value;
        is_changed = true;
    }
    return is_changed;
}

/* One round; *is_changed: on any rank. */
static insitu_status constrain_once(const session_hanging *hanging, const session_team *team, double *means,
                                    int *is_changed, base_error *error)
{
    session_mail out = {.counts = hanging->sent_counts, .total = hanging->sent_total}, in = {0};
    insitu_status status = INSITU_OK;
    if (team->ranks > 1) {
        out.words = base_alloc((size_t)(out.total + 1) * sizeof *out.words);
        if (!out.words) session_no_memory(error, out.total * 8, "values at hanging vertices");
        for (int64_t i = 0; i < out.total && out.words; i++)
            memcpy(&out.words[i], &means[hanging->sent_groups[i]], sizeof out.words[i]);
        status = session_mail_deliver(team->comm, SESSION_MAIL_THERE, &out, &in, error);
        base_free(out.words);
        if (!status) status = session_agree(team->comm, error);
    }
    if (status) return status;
    *is_changed = constrain(hanging, (const double *)(const void *)in.words, means);
    session_mail_free(&in);
    return session_mpi(error, MPI_Allreduce(MPI_IN_PLACE, is_changed, 1, MPI_INT, MPI_MAX, team->comm),
                       "MPI_Allreduce");
}

insitu_status session_constrain_hanging(const session_hanging *hanging, const session_team *team, double *means,
                                        base_error *error)
{
    insitu_status status = INSITU_OK;
    int is_changed = hanging->total > 0;
    for (int round = 0; round < MOST_ROUNDS && is_changed && !status; round++)
        status = constrain_once(hanging, team, means, &is_changed, error);
    return status;
}
