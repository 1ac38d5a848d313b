#include "session_hanging.h"

#include <math.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_bins.h"
#include "session_coarse_face.h"
#include "session_outer_faces.h"
#include "session_region.h"
#include "session_twins.h"
#include "vector3.h"

/* Distance, as a fraction of a face's width, within which a vertex is treated as lying on the face. The distance is
 * larger than the rounding errors of positions in the caller's code. It is much smaller than the distance between
 * hanging vertices, which are at least an eighth of the width apart. The ranks' boxes are extended by the same fraction
 * (session_homes.h). */
static const double relative_slack = 1e-5;

/* A vertex hangs on a face only if the face's area is more than this factor times the area of each face that has the
 * vertex as a corner and the opposite orientation. The smallest ratio that occurs is 2: a face that is divided into two
 * parts has twice the area of each part. */
static const double least_ratio = 1.25;

/* Two edges of shells lie along the same line if the cosine of the angle between them exceeds this number. It is 1, up
 * to rounding, for an edge and the parts into which it is divided. */
static const double collinear = 0.9;

/* Two faces have opposite orientation if the dot product of their normals is below this number. The dot product is -1
 * for exactly opposite faces, apart from the curvature of divided faces; it is 0, up to rounding, for walls at right
 * angles. */
static const double opposite = -0.1;

/* Maximum number of rounds of session_interpolate_hanging_vertices(). Several rounds are needed if a corner of a face
 * is itself a hanging vertex on a larger face. */
enum { MOST_ROUNDS = 64 };

typedef struct searched_face {
    session_coarse_face face;
    /* groups of equal vertices of this rank to which the corners belong; all -1 if the face was received from another
     * rank */
    int64_t groups[4];
    int source_rank;       /* the rank that sent the face */
    int64_t message_index; /* index of the face in the message from source_rank */
} searched_face;

/* A vertex that may hang, and the faces that were found at its position. */
typedef struct candidate {
    double position[3];
    int64_t group;
    /* Indices, in hanging_search.contacts, of the first elements of two linked lists; -1: the list is empty. hit_list:
     * contacts with the faces on which the vertex lies; corner_list: contacts with the faces of which it is a
     * corner. */
    int64_t hit_list, corner_list;
    int64_t face; /* index, in hanging_search.faces, of the face on which the vertex hangs; -1: it does not hang */
    double weights[4];
} candidate;

/* A candidate together with a face at its position. It is an element of one of the candidate's linked lists. */
typedef struct contact {
    int64_t face;         /* index of the face in hanging_search.faces */
    int64_t next_contact; /* index of the next element of the list; -1: this is the last one */
    double weights[4];    /* weights of the face's corners at the candidate's position; not set if the candidate is a
                             corner of the face */
} contact;

typedef struct hanging_search {
    const session_hanging_basis *basis;
    const session_team *team;
    unsigned char *face_states; /* the face_state of each outer face of this rank's parts, part by part */
    /* face_count: number of entries of `faces`; own_count: number of entries at the beginning of `faces` that are this
     * rank's faces; face_capacity: number of entries for which there is memory */
    int64_t face_count, own_count, candidate_count, face_capacity;
    /* faces of this rank that may touch candidates, then the received faces, then this rank's faces that were read
     * later */
    searched_face *faces;
    candidate *candidates;
    double rounding; /* upper bound of the rounding errors of coordinates */
    int64_t contact_count, contact_capacity;
    contact *contacts;
    session_bins bins; /* the candidates, sorted into bins */
} hanging_search;

static void search_free(hanging_search *s)
{
    base_free(s->face_states);
    base_free(s->faces);
    base_free(s->candidates);
    base_free(s->contacts);
    session_bins_free(&s->bins);
}

/* ---- outer faces of parts of meshes (borders) -------------------------------------------------------------------- */

/* Moves the outer faces from `outer` to *out, and stores in *out a list of the vertices that are marked in
 * is_border. */
static bool store_border(const session_mesh *mesh, session_outer *outer, const unsigned char *is_border,
                         session_border *out)
{
    int64_t count = 0;
    for (int64_t v = 0; v < mesh->cells.vertex_count; v++) count += is_border[v];
    int64_t *vertices = base_alloc((size_t)(count + 1) * sizeof *vertices);
    if (!vertices) return false;
    base_free(out->faces);
    base_free(out->vertices);
    base_free(out->twins);
    *out = (session_border){.face_count = outer->face_count, .faces = outer->faces, .vertices = vertices};
    outer->faces = NULL;
    for (int64_t v = 0; v < mesh->cells.vertex_count; v++)
        if (is_border[v]) vertices[out->vertex_count++] = v;
    return true;
}

bool session_merges_close_vertices(const session_mesh_group *mesh_group)
{
    return mesh_group->count > 1 || (mesh_group->meshes[0]->is_refined && !mesh_group->by_id);
}

/* Fills the input out[i] of session_find_outer_faces() for each of `count` parts of one mesh: stores the part, and
 * allocates is_border, one byte per vertex of the part. Returns false if memory runs out. */
static bool prepare_face_parts(const session_mesh_group_parts *parts, int first, int count, session_face_part *out)
{
    bool is_done = true;
    for (int i = 0; i < count && is_done; i++) {
        const session_mesh *mesh = parts->items[first + i];
        out[i].mesh = mesh;
        out[i].is_border = base_calloc((size_t)mesh->cells.vertex_count + 1, 1);
        is_done = out[i].is_border != NULL;
    }
    return is_done;
}

/* Finds the outer faces of this rank's parts of one mesh of the group, and the vertices of these faces. */
static insitu_status update_mesh_borders(const session_mesh_group *mesh_group, int m,
                                         const session_mesh_group_parts *parts, const session_team *team,
                                         base_error *error)
{
    const int first = parts->first_parts[m], count = parts->first_parts[m + 1] - first;
    session_border *borders = mesh_group->hanging.borders + first;
    session_outer *outers = base_calloc((size_t)count + 1, sizeof *outers);
    session_face_part *of = base_calloc((size_t)count + 1, sizeof *of);
    for (int i = 0; i < count && outers && of; i++) of[i].outer = &outers[i];
    if (!outers || !of || !prepare_face_parts(parts, first, count, of))
        session_fail_for_memory(error, count * 100LL, "hanging vertices");
    insitu_status status = session_agree(team->comm, error);
    if (!status) status = session_find_outer_faces(of, count, &mesh_group->meshes[m]->homes, team, error);
    for (int i = 0; i < count && !status && !error->status; i++)
        if (!store_border(of[i].mesh, &outers[i], of[i].is_border, &borders[i]))
            session_fail_for_memory(error, of[i].mesh->cells.vertex_count * 8, "hanging vertices");
    if (!status) status = session_agree(team->comm, error);
    for (int i = 0; i < count && !status; i++) borders[i].cells_hash = mesh_group->meshes[m]->cells_hash;
    for (int i = 0; i < count && of && outers; i++) {
        session_drop_outer_surface(&outers[i], true);
        base_free(of[i].is_border);
    }
    base_free(outers);
    base_free(of);
    return status;
}

/* Allocates one border (a list of outer faces) for each of `count` parts. If the number of parts has not changed, the
 * existing borders are kept. Returns false if memory runs out. */
static bool make_borders(session_hanging *hanging, int count)
{
    if (hanging->borders && hanging->border_count == count) return true;
    session_hanging_free(hanging, true);
    hanging->borders = base_calloc((size_t)count + 1, sizeof *hanging->borders);
    if (hanging->borders) hanging->border_count = count;
    return hanging->borders != NULL;
}

/* Sets the flag in `stale` of each mesh of the group whose borders are out of date, because the mesh's cells have
 * changed on some rank since the borders were computed. */
static insitu_status find_stale_borders(const session_mesh_group *mesh_group, const session_mesh_group_parts *parts,
                                        const session_team *team, int *stale, base_error *error)
{
    for (int m = 0; m < mesh_group->count; m++)
        for (int i = parts->first_parts[m]; i < parts->first_parts[m + 1]; i++)
            if (mesh_group->hanging.borders[i].cells_hash != mesh_group->meshes[m]->cells_hash) stale[m] = 1;
    return session_check_mpi(error, MPI_Allreduce(MPI_IN_PLACE, stale, mesh_group->count, MPI_INT, MPI_MAX, team->comm),
                             "MPI_Allreduce");
}

insitu_status session_update_borders(session_mesh_group *mesh_group, const session_mesh_group_parts *parts,
                                     const session_team *team, base_error *error)
{
    session_hanging *hanging = &mesh_group->hanging;
    if (hanging->borders && hanging->twins_version == mesh_group->positions_hash) return INSITU_OK;
    int *stale = base_calloc((size_t)mesh_group->count, sizeof *stale);
    if (!stale || !make_borders(hanging, parts->count))
        session_fail_for_memory(error, parts->count * (int64_t)sizeof *hanging->borders, "hanging vertices");
    insitu_status status = session_agree(team->comm, error);
    if (!status) status = find_stale_borders(mesh_group, parts, team, stale, error);
    for (int m = 0; m < mesh_group->count && !status; m++)
        if (stale[m]) status = update_mesh_borders(mesh_group, m, parts, team, error);
    if (!status && session_merges_close_vertices(mesh_group))
        status = session_find_coincident_vertices(mesh_group, parts, team, error);
    if (!status) status = session_agree(team->comm, error);
    if (!status) hanging->twins_version = mesh_group->positions_hash;
    base_free(stale);
    return status;
}

const session_border *session_find_border_of_part(const session_mesh_group *mesh_group,
                                                  const session_mesh_group_parts *parts, const session_mesh *part,
                                                  int *at)
{
    while (parts->items[*at] != part) (*at)++;
    return session_merges_close_vertices(mesh_group) ? &mesh_group->hanging.borders[*at] : NULL;
}

/* ---- candidates: vertices that may hang on a face ---------------------------------------------------------------- */

static bool list_candidates(hanging_search *s)
{
    const session_hanging_basis *basis = s->basis;
    const session_border *borders = basis->mesh_group->hanging.borders;
    int64_t most = 0;
    for (int m = 0; m < basis->part_count; m++) most += borders[m].vertex_count;
    unsigned char *is_listed = base_calloc((size_t)basis->group_count + 1, 1);
    s->candidates = base_alloc((size_t)(most + 1) * sizeof *s->candidates);
    if (!is_listed || !s->candidates) {
        base_free(is_listed);
        return false;
    }
    for (int m = 0; m < basis->part_count; m++)
        for (int64_t i = 0; i < borders[m].vertex_count; i++) {
            const int64_t v = borders[m].vertices[i], group = basis->group_of_vertex[basis->first_vertices[m] + v];
            if (group < 0 || is_listed[group]) continue;
            candidate *c = &s->candidates[s->candidate_count++];
            *c = (candidate){.group = group, .hit_list = -1, .corner_list = -1, .face = -1};
            grid_read_vertex_position(&basis->meshes[m]->cells, v, c->position);
            is_listed[group] = 1;
        }
    base_free(is_listed);
    return true;
}

static bool bin_candidates(hanging_search *s)
{
    return session_bins_create(&s->bins, s->candidates->position, (int64_t)sizeof *s->candidates, s->candidate_count);
}

/* reading this rank's faces, most of which are excluded by their outlines ------------------------------------------ */

typedef enum face_state {
    FACE_UNREAD,
    /* the face will be read in the current pass of read_faces(), because candidates may touch it or it intersects
     * another rank's box */
    FACE_NEEDED,
    FACE_READ
} face_state;

static bool do_boxes_intersect(const session_box *a, const session_box *b, double margin)
{
    for (int axis = 0; axis < 3; axis++)
        if (!(a->lower[axis] - margin <= b->upper[axis] && b->lower[axis] - margin <= a->upper[axis])) return false;
    return true;
}

static bool is_corner_of(const hanging_search *s, int m, const session_face_outline *f, const candidate *c)
{
    for (int i = 0; i < f->count; i++)
        if (s->basis->group_of_vertex[s->basis->first_vertices[m] + f->vertices[i]] == c->group) return true;
    return false;
}

static bool is_in_box(const session_box *box, const double position[3], double slack)
{
    for (int axis = 0; axis < 3; axis++)
        if (!(box->lower[axis] - slack <= position[axis] && position[axis] <= box->upper[axis] + slack)) return false;
    return true;
}

/* Returns whether a candidate may lie on a face of part m without being one of its corners. If needs_hit is set, only
 * candidates that are already known to lie on some face are considered. */
static bool may_candidate_lie_on_face(const hanging_search *s, int m, const session_face_outline *f, double slack,
                                      bool needs_hit)
{
    session_bin_walk walk = session_begin_bin_walk(&s->bins, f->box.lower, f->box.upper, slack);
    int64_t near;
    while (session_next_point_in_bins(&walk, &near)) {
        const candidate *c = &s->candidates[near];
        if (!is_in_box(&f->box, c->position, slack)) continue;
        if ((needs_hit ? c->hit_list >= 0 : !is_corner_of(s, m, f, c)) &&
            session_can_face_contain_position(f, c->position, slack))
            return true;
    }
    return false;
}

static bool intersects_rank_box(const hanging_search *s, const session_box *box, double slack)
{
    const session_homes *homes = s->basis->mesh_group->homes;
    for (int n = 0; n < homes->near_count; n++)
        if (homes->near_ranks[n] != s->team->rank && do_boxes_intersect(box, &homes->boxes[n], slack)) return true;
    return false;
}

static bool is_face_needed(const hanging_search *s, int m, const session_face *face, bool needs_hit)
{
    session_face_outline f;
    if (!session_read_outline(&s->basis->meshes[m]->cells, face, &f)) return false;
    /* upper bound of the value that compute_face_tolerance() returns for this face, once the face has been read */
    const double slack = relative_slack * f.diameter + s->rounding;
    return may_candidate_lie_on_face(s, m, &f, slack, needs_hit) ||
           (!needs_hit && intersects_rank_box(s, &f.box, slack));
}

/* Appends a face to the list of faces if it is a triangle or quad. Returns false if memory runs out. */
static bool read_face(hanging_search *s, int m, const session_face *face)
{
    int64_t vertices[4];
    if (s->face_count == s->face_capacity) {
        const int64_t capacity = s->face_capacity * 2 + 64;
        searched_face *faces = base_realloc(s->faces, (size_t)capacity * sizeof *faces);
        if (!faces) return false;
        s->faces = faces;
        s->face_capacity = capacity;
    }
    searched_face *f = &s->faces[s->face_count];
    if (!session_read_coarse_face(&s->basis->meshes[m]->cells, face, &f->face, vertices)) return true;
    for (int k = 0; k < 4; k++) f->groups[k] = s->basis->group_of_vertex[s->basis->first_vertices[m] + vertices[k]];
    f->source_rank = s->team->rank;
    s->face_count++;
    return true;
}

/* Reads faces of this rank that have not been read yet. The first pass (needs_hit is false) reads faces on which a
 * candidate may lie, and faces near other ranks. The second pass (needs_hit is true) reads faces near candidates that
 * lie on some face. Returns false if memory runs out. */
static bool read_faces(hanging_search *s, bool needs_hit)
{
    const session_border *borders = s->basis->mesh_group->hanging.borders;
    unsigned char *states = s->face_states;
    bool is_done = true;
    for (int m = 0; m < s->basis->part_count; m++) {
        const session_border *border = &borders[m];
#pragma omp parallel num_threads(session_choose_loop_threads(s->team->threads, border->face_count))
        {
            region_enter();
#pragma omp for schedule(dynamic, REGION_ITEMS) nowait
            for (int64_t i = 0; i < border->face_count; i++)
                if (states[i] == FACE_UNREAD && is_face_needed(s, m, &border->faces[i], needs_hit))
                    states[i] = FACE_NEEDED;
            region_leave();
        }
        for (int64_t i = 0; i < border->face_count && is_done; i++) {
            if (states[i] != FACE_NEEDED) continue;
            is_done = read_face(s, m, &border->faces[i]);
            states[i] = FACE_READ;
        }
        states += border->face_count;
    }
    return is_done;
}

/* Allocates the states of this rank's faces and makes the first pass of read_faces(): reads faces on which a candidate
 * may lie, and faces near other ranks. Returns false if memory runs out. */
static bool read_own_faces(hanging_search *s)
{
    int64_t count = 0;
    for (int m = 0; m < s->basis->part_count; m++) count += s->basis->mesh_group->hanging.borders[m].face_count;
    s->face_states = base_calloc((size_t)count + 1, 1);
    if (!s->face_states || !read_faces(s, false)) return false;
    s->own_count = s->face_count;
    return true;
}

static double compute_face_tolerance(const hanging_search *s, const session_coarse_face *f)
{
    return relative_slack * f->width + s->rounding;
}

/* Packs, for each other rank near this one, the faces of this rank that intersect the other rank's box. sent: receives
 * the index of each packed face. If mail->words is NULL, the words are only counted. */
static void pack_or_count_faces(const hanging_search *s, session_mail *mail, int64_t *sent)
{
    const session_homes *homes = s->basis->mesh_group->homes;
    mail->total = 0;
    for (int n = 0; n < homes->near_count; n++) {
        const int64_t first = mail->total;
        for (int64_t i = 0; i < s->own_count && homes->near_ranks[n] != s->team->rank; i++) {
            const session_coarse_face *f = &s->faces[i].face;
            if (!do_boxes_intersect(&f->box, &homes->boxes[n], compute_face_tolerance(s, f))) continue;
            if (mail->words) {
                session_pack_coarse_face(f, mail->words + mail->total);
                sent[mail->total / SESSION_FACE_WORDS] = i;
            }
            mail->total += SESSION_FACE_WORDS;
        }
        mail->counts[homes->near_ranks[n]] = mail->total - first;
    }
}

/* Packs the faces for other ranks. *sent receives the index of each packed face. Returns false if memory runs out. */
static bool pack_faces(const hanging_search *s, session_mail *mail, int64_t **sent)
{
    mail->counts = base_calloc((size_t)s->team->ranks, sizeof *mail->counts);
    if (!mail->counts) return false;
    pack_or_count_faces(s, mail, NULL);
    mail->words = base_alloc((size_t)mail->total * sizeof *mail->words + 1);
    *sent = base_alloc((size_t)(mail->total / SESSION_FACE_WORDS + 1) * sizeof **sent);
    if (!mail->words || !*sent) return false;
    pack_or_count_faces(s, mail, *sent);
    return true;
}

static bool receive_faces(hanging_search *s, const session_mail *in)
{
    const int64_t count = in->total / SESSION_FACE_WORDS;
    searched_face *faces = base_realloc(s->faces, (size_t)(s->own_count + count + 1) * sizeof *faces);
    if (!faces) return false;
    s->faces = faces;
    s->face_capacity = s->own_count + count + 1;
    int64_t at = 0;
    for (int rank = 0; rank < s->team->ranks; rank++)
        for (int64_t number = 0; number < in->counts[rank] / SESSION_FACE_WORDS; number++, at++) {
            searched_face *f = &faces[s->face_count++];
            session_unpack_coarse_face(in->words + SESSION_FACE_WORDS * at, &f->face);
            for (int i = 0; i < 4; i++) f->groups[i] = -1;
            f->source_rank = rank;
            f->message_index = number;
        }
    return true;
}

/* ---- faces at the position of each candidate --------------------------------------------------------------------- */

/* Prepends a contact with a face to one of a candidate's linked lists. number: index of the face. weights: weights of
 * the face's corners at the candidate. *head: index of the list's first element. Returns false if memory runs out. */
static bool add_contact(hanging_search *s, int64_t number, const double weights[4], int64_t *head)
{
    if (s->contact_count == s->contact_capacity) {
        const int64_t capacity = s->contact_capacity * 2 + 256;
        contact *contacts = base_realloc(s->contacts, (size_t)capacity * sizeof *contacts);
        if (!contacts) return false;
        s->contacts = contacts;
        s->contact_capacity = capacity;
    }
    contact *c = &s->contacts[s->contact_count];
    *c = (contact){.face = number, .next_contact = *head};
    if (weights) memcpy(c->weights, weights, sizeof c->weights);
    *head = s->contact_count++;
    return true;
}

/* Adds the face to the candidate's list of hits if the candidate lies on the face and is not one of its corners.
 * Returns false if memory runs out. */
static bool add_face_if_candidate_on_it(hanging_search *s, int64_t number, candidate *c)
{
    const session_coarse_face *f = &s->faces[number].face;
    const double slack = compute_face_tolerance(s, f);
    double weights[4];
    if (session_is_at_corner(f, c->position, slack) || !session_find_weights(f, c->position, slack, weights))
        return true;
    return add_contact(s, number, weights, &c->hit_list);
}

/* If the candidate is a corner of the face, and is known to lie on some other face, adds the face to the candidate's
 * list of faces with this corner. Returns false if memory runs out. */
static bool add_face_if_candidate_is_corner(hanging_search *s, int64_t number, candidate *c)
{
    const session_coarse_face *f = &s->faces[number].face;
    if (c->hit_list < 0 || !session_is_at_corner(f, c->position, compute_face_tolerance(s, f))) return true;
    return add_contact(s, number, NULL, &c->corner_list);
}

/* A test of a candidate on the face with the index `number`: add_face_if_candidate_on_it() or
 * add_face_if_candidate_is_corner(). Returns false if memory runs out. */
typedef bool try_function(hanging_search *s, int64_t number, candidate *c);

static bool test_candidates_on_faces(hanging_search *s, try_function *try_one)
{
    bool is_done = true;
    for (int64_t number = 0; number < s->face_count && s->candidate_count && is_done; number++) {
        const session_coarse_face *f = &s->faces[number].face;
        session_bin_walk walk =
            session_begin_bin_walk(&s->bins, f->box.lower, f->box.upper, compute_face_tolerance(s, f));
        int64_t near;
        while (is_done && session_next_point_in_bins(&walk, &near)) is_done = try_one(s, number, &s->candidates[near]);
    }
    return is_done;
}

/* Returns the largest area among the faces that have the candidate as a corner and whose normal is opposite to that of
 * f; 0 if there are none. */
static double find_largest_opposite_area(const hanging_search *s, const candidate *c, const session_coarse_face *f)
{
    double area = 0;
    for (int64_t i = c->corner_list; i >= 0; i = s->contacts[i].next_contact) {
        const session_coarse_face *other = &s->faces[s->contacts[i].face].face;
        if (vector3_dot(f->normal, other->normal) < opposite) area = fmax(area, other->area);
    }
    return area;
}

/* Finds the edge of the shell f on which a position lies. weights: weights of the corners at this position. Returns
 * false if the position is not on an edge, or is a corner. */
static bool find_edge_by_weights(const session_coarse_face *f, const double weights[4], double edge[3])
{
    int ends[4], count = 0;
    for (int k = 0; k < 4; k++)
        if (weights[k] > 0) ends[count++] = k;
    if (count != 2) return false;
    for (int axis = 0; axis < 3; axis++)
        edge[axis] = f->corner_positions[ends[1]][axis] - f->corner_positions[ends[0]][axis];
    return true;
}

/* Returns the length of the edge from the corner at the candidate's position to the next (step 1) or previous corner
 * (step -1) if it lies along `direction`; otherwise 0. */
static double measure_collinear_edge(const session_coarse_face *f, const double position[3], int step,
                                     const double direction[3])
{
    int nearest = 0;
    double edge[3];
    for (int i = 1; i < f->count; i++)
        if (session_point_distance(f->corner_positions[i], position) <
            session_point_distance(f->corner_positions[nearest], position))
            nearest = i;
    const double *end = f->corner_positions[(nearest + f->count + step) % f->count];
    for (int axis = 0; axis < 3; axis++) edge[axis] = end[axis] - f->corner_positions[nearest][axis];
    const double length = sqrt(vector3_dot(edge, edge)), along = vector3_dot(edge, direction);
    return fabs(along) > collinear * length * sqrt(vector3_dot(direction, direction)) ? length : 0;
}

/* Returns the greatest length of the edges along `direction` at the candidate's corner of shells; 0 if there are
 * none. */
static double find_longest_collinear_edge(const hanging_search *s, const candidate *c, const double direction[3])
{
    double length = 0;
    for (int64_t i = c->corner_list; i >= 0; i = s->contacts[i].next_contact) {
        const session_coarse_face *other = &s->faces[s->contacts[i].face].face;
        for (int step = -1; step <= 1 && other->is_shell; step += 2)
            length = fmax(length, measure_collinear_edge(other, c->position, step, direction));
    }
    return length;
}

/* Returns whether the candidate hangs on the face that it touches according to session_hanging.h. */
static bool is_hanging_on(const hanging_search *s, const candidate *c, const contact *hit)
{
    const session_coarse_face *f = &s->faces[hit->face].face;
    double edge[3];
    if (!f->is_shell) {
        const double area = find_largest_opposite_area(s, c, f);
        return area > 0 && f->area > least_ratio * area;
    }
    if (!find_edge_by_weights(f, hit->weights, edge)) return false;
    const double length = find_longest_collinear_edge(s, c, edge);
    return length > 0 && sqrt(vector3_dot(edge, edge)) > least_ratio * length;
}

/* Returns whether a vertex that hangs on both faces takes its value from a and not from b. */
static bool is_preferred(const session_coarse_face *a, const session_coarse_face *b)
{
    return a->is_shell != b->is_shell ? b->is_shell : session_is_larger_face(a, b);
}

/* Chooses, of the faces on which the candidate lies and hangs according to session_hanging.h, the preferred one
 * (is_preferred()): the largest face of a cell with a volume or, if there is none, the largest shell. Sets c->face and
 * c->weights if there is one. */
static void choose_face_of_hanging_vertex(const hanging_search *s, candidate *c)
{
    for (int64_t i = c->hit_list; i >= 0; i = s->contacts[i].next_contact) {
        const session_coarse_face *f = &s->faces[s->contacts[i].face].face;
        if (!is_hanging_on(s, c, &s->contacts[i])) continue;
        if (c->face >= 0 && !is_preferred(f, &s->faces[c->face].face)) continue;
        c->face = s->contacts[i].face;
        memcpy(c->weights, s->contacts[i].weights, sizeof c->weights);
    }
}

static bool find_faces_at_candidates(hanging_search *s)
{
    bool is_done = test_candidates_on_faces(s, add_face_if_candidate_on_it);
    if (s->contact_count)
        is_done = is_done && read_faces(s, true) && test_candidates_on_faces(s, add_face_if_candidate_is_corner);
    for (int64_t i = 0; i < s->candidate_count && is_done; i++) choose_face_of_hanging_vertex(s, &s->candidates[i]);
    return is_done;
}

/* ---- storing the hanging vertices ----------------------------------------------------------------------------- */

/* Requests the values at the corners of received faces on which vertices hang: packs the message indices of these
 * faces, for the ranks that sent them. (*firsts)[i] receives, for each such face i, the index of its first corner's
 * value among all values that will be received; -1: no vertex hangs on face i. */
static bool pack_face_requests(const hanging_search *s, session_mail *requested, int64_t **firsts)
{
    int64_t *first = base_alloc((size_t)(s->face_count + 1) * sizeof *first);
    requested->counts = base_calloc((size_t)s->team->ranks, sizeof *requested->counts);
    requested->words = base_alloc((size_t)(s->face_count + 1) * sizeof *requested->words);
    *firsts = first;
    if (!first || !requested->counts || !requested->words) return false;
    for (int64_t i = 0; i < s->face_count; i++) first[i] = -1;
    for (int64_t i = 0; i < s->candidate_count; i++)
        if (s->candidates[i].face >= 0) first[s->candidates[i].face] = 0;
    for (int64_t i = s->own_count; i < s->face_count; i++) { /* received faces, sorted by the rank that sent them */
        if (first[i] < 0) continue;
        first[i] = 4 * requested->total;
        requested->words[requested->total++] = (uint64_t)s->faces[i].message_index;
        requested->counts[s->faces[i].source_rank]++;
    }
    return true;
}

static bool store_hanging_vertices(const hanging_search *s, const int64_t *firsts, session_hanging *out)
{
    int64_t count = 0;
    for (int64_t i = 0; i < s->candidate_count; i++) count += s->candidates[i].face >= 0;
    out->vertices = base_alloc((size_t)(count + 1) * sizeof *out->vertices);
    if (!out->vertices) return false;
    for (int64_t i = 0; i < s->candidate_count; i++) {
        const candidate *c = &s->candidates[i];
        if (c->face < 0) continue;
        session_hanging_vertex *v = &out->vertices[out->count++];
        v->group = c->group;
        memcpy(v->weights, c->weights, sizeof v->weights);
        v->is_received = c->face >= s->own_count;
        for (int k = 0; k < 4; k++) v->corners[k] = v->is_received ? firsts[c->face] + k : s->faces[c->face].groups[k];
    }
    return true;
}

/* Lists the groups of equal vertices whose values this rank will send to other ranks for their hanging vertices.
 * requests: for each rank, the requested faces, as indices within the message of faces that this rank sent to that
 * rank. mail: all of these messages. sent: the index in s->faces of each face in them. */
static bool store_requested_groups(const hanging_search *s, const session_mail *mail, const int64_t *sent,
                                   const session_mail *requests, session_hanging *out)
{
    out->sent_counts = base_calloc((size_t)s->team->ranks, sizeof *out->sent_counts);
    out->sent_groups = base_alloc((size_t)(4 * requests->total + 1) * sizeof *out->sent_groups);
    if (!out->sent_counts || !out->sent_groups) return false;
    const uint64_t *word = requests->words;
    int64_t first = 0;
    for (int rank = 0; rank < s->team->ranks; rank++) {
        for (int64_t i = 0; i < requests->counts[rank]; i++) {
            const searched_face *f = &s->faces[sent[first + (int64_t)*word++]];
            memcpy(out->sent_groups + out->sent_total, f->groups, sizeof f->groups);
            out->sent_total += 4;
        }
        out->sent_counts[rank] = 4 * requests->counts[rank];
        first += mail->counts[rank] / SESSION_FACE_WORDS;
    }
    return true;
}

/* ---- search for hanging vertices ------------------------------------------------------------------------------ */

/* Finds the hanging vertices, also on faces of other ranks. Errors that occur only on this rank are stored in *error
 * and not returned. */
static insitu_status find_hanging_vertices(hanging_search *s, session_hanging *out, base_error *error)
{
    session_mail faces = {0}, in = {0}, requested = {0}, requests = {0};
    int64_t *sent = NULL, *firsts = NULL;
    if (!error->status && !pack_faces(s, &faces, &sent))
        session_fail_for_memory(error, s->own_count * 96, "hanging vertices");
    insitu_status status = session_mail_deliver(s->team->comm, SESSION_MAIL_THERE, &faces, &in, error);
    if (!status && !error->status) {
        const bool is_done = receive_faces(s, &in) && find_faces_at_candidates(s) &&
                             pack_face_requests(s, &requested, &firsts) && store_hanging_vertices(s, firsts, out);
        if (!is_done) session_fail_for_memory(error, s->face_count * 150, "hanging vertices");
    }
    if (!status) status = session_mail_deliver(s->team->comm, SESSION_MAIL_BACK, &requested, &requests, error);
    if (!status && !error->status && !store_requested_groups(s, &faces, sent, &requests, out))
        session_fail_for_memory(error, requests.total * 32, "hanging vertices");
    session_mail_free(&faces);
    session_mail_free(&in);
    session_mail_free(&requested);
    session_mail_free(&requests);
    base_free(sent);
    base_free(firsts);
    return status;
}

static insitu_status count_hanging_vertices(const session_team *team, session_hanging *out, base_error *error)
{
    int64_t count = out->count;
    const insitu_status status = session_check_mpi(
        error, MPI_Allreduce(MPI_IN_PLACE, &count, 1, MPI_INT64_T, MPI_SUM, team->comm), "MPI_Allreduce");
    out->total = count;
    return status;
}

insitu_status session_update_hanging_vertices(const session_hanging_basis *basis, const session_team *team,
                                              base_error *error)
{
    session_mesh_group *mesh_group = basis->mesh_group;
    hanging_search search = {.basis = basis, .team = team};
    session_hanging found = {.positions_hash = mesh_group->positions_hash};
    if (mesh_group->hanging.positions_hash == mesh_group->positions_hash) return INSITU_OK;
    for (int i = 0; i < basis->part_count; i++)
        search.rounding = fmax(search.rounding, session_bound_position_rounding(basis->meshes[i]));
    if (!list_candidates(&search) || !bin_candidates(&search) || !read_own_faces(&search))
        session_fail_for_memory(error, (search.own_count + basis->group_count) * 200, "hanging vertices");
    insitu_status status = find_hanging_vertices(&search, &found, error);
    search_free(&search);
    if (!status) status = session_agree(team->comm, error);
    if (!status) status = count_hanging_vertices(team, &found, error);
    if (status) {
        session_hanging_free(&found, false);
        return status;
    }
    session_hanging_free(&mesh_group->hanging, false);
    found.borders = mesh_group->hanging.borders;
    found.border_count = mesh_group->hanging.border_count;
    found.twins_version = mesh_group->hanging.twins_version;
    mesh_group->hanging = found;
    return INSITU_OK;
}

/* ---- values at hanging vertices ------------------------------------------------------------------------------- */

/* Sets the value of each hanging vertex to the value of the face at the vertex's position, interpolated from the values
 * at the face's corners. Returns whether a value changed. */
static bool interpolate_at_hanging_vertices(const session_hanging *hanging, const double *received, double *means)
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

/* Exchanges the values at corners of faces with other ranks. Then sets the value of each hanging vertex once, from the
 * values at its face's corners. *is_changed is set if a value changed on any rank. */
static insitu_status exchange_and_interpolate_values(const session_hanging *hanging, const session_team *team,
                                                     double *means, int *is_changed, base_error *error)
{
    session_mail out = {.counts = hanging->sent_counts, .total = hanging->sent_total}, in = {0};
    insitu_status status = INSITU_OK;
    if (team->ranks > 1) {
        out.words = base_alloc((size_t)(out.total + 1) * sizeof *out.words);
        if (!out.words) session_fail_for_memory(error, out.total * 8, "values at hanging vertices");
        for (int64_t i = 0; i < out.total && out.words; i++)
            memcpy(&out.words[i], &means[hanging->sent_groups[i]], sizeof out.words[i]);
        status = session_mail_deliver(team->comm, SESSION_MAIL_THERE, &out, &in, error);
        base_free(out.words);
        if (!status) status = session_agree(team->comm, error);
    }
    if (status) return status;
    *is_changed = interpolate_at_hanging_vertices(hanging, (const double *)(const void *)in.words, means);
    session_mail_free(&in);
    return session_check_mpi(error, MPI_Allreduce(MPI_IN_PLACE, is_changed, 1, MPI_INT, MPI_MAX, team->comm),
                             "MPI_Allreduce");
}

insitu_status session_interpolate_hanging_vertices(const session_hanging *hanging, const session_team *team,
                                                   double *means, base_error *error)
{
    insitu_status status = INSITU_OK;
    int is_changed = hanging->total > 0;
    for (int round = 0; round < MOST_ROUNDS && is_changed && !status; round++)
        status = exchange_and_interpolate_values(hanging, team, means, &is_changed, error);
    return status;
}
