#include "session_twins.h"

#include <math.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_bins.h"
#include "session_coarse_face.h"
#include "session_cell_faces.h"
#include "session_exchange.h"
#include "session_neighbours.h"
#include "vector3.h"

enum { CORNER_WORDS = 4 };

/* A vertex of an outer face. */
typedef struct face_corner {
    double position[3];
    double slack; /* vertices of outer faces within this distance of the corner are treated as equal to it */
} face_corner;

/* A vertex of a face that belongs to only one cell on this rank, and the lexicographically smallest position of all
 * vertices that are equal to this vertex. */
typedef struct border_vertex {
    double position[3], least_position[3];
} border_vertex;

typedef struct twin_search {
    const session_mesh_group *mesh_group;
    const session_mesh_group_parts *parts;
    const session_team *team;
    int64_t corner_count, vertex_count;
    face_corner *corners;    /* the corners of this rank's outer faces, followed by the received corners */
    border_vertex *vertices; /* vertices of all parts, sorted by part */
    /* upper bound of the rounding errors of coordinates */
    double rounding;
    session_bins bins;
} twin_search;

/* ---- corners of this rank's outer faces -------------------------------------------------------------------------- */

/* Sets edges[v], for each vertex v of the face, to the minimum of its previous value and the lengths of the face's two
 * edges at v. Edges of length 0 are ignored. */
static void measure_edges(const grid *g, const session_face *face, double *edges)
{
    const session_cell_faces faces = session_faces_of_cell(g, face->cell);
    const session_face_loop loop = session_find_face_loop(&faces, face->face);
    for (int64_t i = 0; i < loop.size; i++) {
        const int64_t from = session_face_vertex(&loop, i), to = session_face_vertex(&loop, (i + 1) % loop.size);
        double a[3], b[3];
        grid_read_vertex_position(g, from, a);
        grid_read_vertex_position(g, to, b);
        const double length = session_point_distance(a, b);
        if (!(length > 0)) continue;
        edges[from] = fmin(edges[from], length);
        edges[to] = fmin(edges[to], length);
    }
}

/* Appends the corners of a part's outer faces to s->corners, whose memory has been allocated before. Returns false if
 * memory for the lengths of edges runs out. */
static bool add_corners(twin_search *s, const session_mesh *mesh, const session_border *border)
{
    const grid *g = &mesh->cells;
    double *edges = base_alloc((size_t)(g->vertex_count + 1) * sizeof *edges);
    for (int64_t v = 0; v < g->vertex_count && edges; v++) edges[v] = (double)INFINITY;
    for (int64_t i = 0; i < border->face_count && edges; i++) measure_edges(g, &border->faces[i], edges);
    for (int64_t i = 0; i < border->vertex_count && edges; i++) {
        const double edge = edges[border->vertices[i]];
        if (isinf(edge)) continue;
        face_corner *c = &s->corners[s->corner_count++];
        grid_read_vertex_position(g, border->vertices[i], c->position);
        c->slack = fmin(fmax(1e-5 * edge, s->rounding), edge / 4);
    }
    base_free(edges);
    return edges != NULL;
}

static bool list_own_corners(twin_search *s)
{
    const session_border *borders = s->mesh_group->hanging.borders;
    int64_t count = 0;
    for (int m = 0; m < s->parts->count; m++) count += borders[m].vertex_count;
    s->vertices = base_alloc((size_t)(count + 1) * sizeof *s->vertices);
    s->corners = base_alloc((size_t)(count + 1) * sizeof *s->corners);
    if (!s->vertices || !s->corners) return false;
    for (int m = 0; m < s->parts->count; m++) {
        for (int64_t i = 0; i < borders[m].vertex_count; i++) {
            border_vertex *v = &s->vertices[s->vertex_count++];
            grid_read_vertex_position(&s->parts->items[m]->cells, borders[m].vertices[i], v->position);
            memcpy(v->least_position, v->position, sizeof v->least_position);
        }
        if (!add_corners(s, s->parts->items[m], &borders[m])) return false;
    }
    return session_bins_create(&s->bins, s->vertices->position, (int64_t)sizeof *s->vertices, s->vertex_count);
}

/* ---- exchange of corners with other ranks ------------------------------------------------------------------------ */

/* Packs, for each other rank near this one, the corners of this rank that lie in the other rank's box. If mail->words
 * is NULL, the words are only counted. */
static void pack_or_count_corners(const twin_search *s, session_mail *mail)
{
    const session_homes *homes = s->mesh_group->homes;
    mail->total = 0;
    for (int n = 0; n < homes->near_count; n++) {
        const int64_t first = mail->total;
        for (int64_t i = 0; i < s->corner_count && homes->near_ranks[n] != s->team->rank; i++) {
            if (!session_is_in_box(&homes->boxes[n], s->corners[i].position)) continue;
            if (mail->words) memcpy(mail->words + mail->total, &s->corners[i], sizeof s->corners[i]);
            mail->total += CORNER_WORDS;
        }
        mail->counts[homes->near_ranks[n]] = mail->total - first;
    }
}

static bool pack_corners(const twin_search *s, session_mail *mail)
{
    mail->counts = base_calloc((size_t)s->team->ranks, sizeof *mail->counts);
    if (!mail->counts) return false;
    pack_or_count_corners(s, mail);
    mail->words = base_alloc((size_t)mail->total * sizeof *mail->words + 1);
    if (mail->words) pack_or_count_corners(s, mail);
    return mail->words != NULL;
}

static bool receive_corners(twin_search *s, const session_mail *in)
{
    const int64_t count = in->total / CORNER_WORDS;
    face_corner *corners = base_realloc(s->corners, (size_t)(s->corner_count + count + 1) * sizeof *corners);
    if (!corners) return false;
    s->corners = corners;
    if (count) memcpy(corners + s->corner_count, in->words, (size_t)count * sizeof *corners);
    s->corner_count += count;
    return true;
}

/* ---- common positions of twins (vertices that coincide except for rounding) -------------------------------------- */

/* Finds, for each vertex of this rank, the lexicographically smallest position of the corners that are equal to it. */
static void find_least_equal_positions(twin_search *s)
{
    for (int64_t i = 0; i < s->corner_count && s->vertex_count; i++) {
        const face_corner *c = &s->corners[i];
        session_bin_walk walk = session_begin_bin_walk(&s->bins, c->position, c->position, c->slack);
        int64_t near;
        while (session_next_point_in_bins(&walk, &near)) {
            border_vertex *v = &s->vertices[near];
            if (session_point_distance(v->position, c->position) <= c->slack &&
                vector3_compare(c->position, v->least_position) < 0)
                memcpy(v->least_position, c->position, sizeof v->least_position);
        }
    }
}

static bool store_twins(const border_vertex *vertices, session_border *border)
{
    int64_t count = 0;
    for (int64_t i = 0; i < border->vertex_count; i++)
        count += vector3_compare(vertices[i].least_position, vertices[i].position) != 0;
    session_twin *twins = base_alloc((size_t)(count + 1) * sizeof *twins);
    if (!twins) return false;
    base_free(border->twins);
    border->twins = twins;
    border->twin_count = 0;
    for (int64_t i = 0; i < border->vertex_count; i++) {
        if (vector3_compare(vertices[i].least_position, vertices[i].position) == 0) continue;
        session_twin *twin = &twins[border->twin_count++];
        twin->vertex = border->vertices[i];
        memcpy(twin->position, vertices[i].least_position, sizeof twin->position);
    }
    return true;
}

static bool store_all_twins(const twin_search *s)
{
    bool is_done = true;
    int64_t first = 0;
    for (int m = 0; m < s->parts->count && is_done; m++) {
        session_border *border = &s->mesh_group->hanging.borders[m];
        is_done = store_twins(s->vertices + first, border);
        first += border->vertex_count;
    }
    return is_done;
}

insitu_status session_find_coincident_vertices(session_mesh_group *mesh_group, const session_mesh_group_parts *parts,
                                               const session_team *team, base_error *error)
{
    twin_search s = {.mesh_group = mesh_group, .parts = parts, .team = team};
    session_mail out = {0}, in = {0};
    for (int i = 0; i < parts->count; i++)
        s.rounding = fmax(s.rounding, session_bound_position_rounding(parts->items[i]));
    if (!error->status && (!list_own_corners(&s) || !pack_corners(&s, &out)))
        session_fail_for_memory(error, (s.corner_count + s.vertex_count) * 80, "vertices of several meshes");
    const insitu_status status = session_mail_deliver(team->comm, SESSION_MAIL_THERE, &out, &in, error);
    if (!status && !error->status) {
        const bool is_taken = receive_corners(&s, &in);
        if (is_taken) find_least_equal_positions(&s);
        if (!is_taken || !store_all_twins(&s))
            session_fail_for_memory(error, s.corner_count * 32, "vertices of several meshes");
    }
    session_mail_free(&out);
    session_mail_free(&in);
    session_bins_free(&s.bins);
    base_free(s.corners);
    base_free(s.vertices);
    return status;
}

/* ---- keys -------------------------------------------------------------------------------------------------------- */

static session_key make_key_of_point(const double position[3])
{
    session_key key;
    for (int axis = 0; axis < 3; axis++) {
        const double unsigned_zero = position[axis] + 0.0;
        memcpy(&key.words[axis], &unsigned_zero, sizeof unsigned_zero);
    }
    return key;
}

/* Returns the entry of a vertex in the border's sorted list of twins; NULL if the vertex is no twin. */
static const session_twin *find_twin(const session_border *border, int64_t vertex)
{
    int64_t first = 0, end = border->twin_count;
    while (first < end) {
        const int64_t middle = first + (end - first) / 2;
        if (border->twins[middle].vertex < vertex)
            first = middle + 1;
        else
            end = middle;
    }
    return first < border->twin_count && border->twins[first].vertex == vertex ? &border->twins[first] : NULL;
}

session_key session_merged_vertex_key(const session_mesh *mesh, const session_border *border, int64_t vertex,
                                      bool by_id)
{
    const session_twin *twin = border ? find_twin(border, vertex) : NULL;
    return twin ? make_key_of_point(twin->position) : session_vertex_key(mesh, vertex, by_id);
}
