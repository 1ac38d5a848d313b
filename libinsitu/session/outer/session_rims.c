#include "session_rims.h"

#include "memory.h"
#include "session_shape.h"

/* ---- faces and rims of a type and order of cells ----------------------------------------------------------------- */

void session_find_face_plane_normal(const session_nodes *of, int face, double out[3])
{
    int plane[3];
    session_find_face_plane(session_get_cell_shape(of->type), face, plane);
    for (int axis = 0; axis < 3; axis++) out[axis] = plane[axis];
}

static void list_rim_nodes(const session_nodes *of, insitu_vertex_order order, const signed char face[4], int *count,
                           int *nodes)
{
    const session_shape *shape = session_get_cell_shape(of->type);
    const int corners = face[3] < 0 ? 3 : 4;
    *count = 0;
    for (int n = 0; n < corners; n++) {
        const signed char *from = shape->corners[(int)face[n]], *to = shape->corners[(int)face[(n + 1) % corners]];
        int at[3];
        for (int step = 0; step < of->order; step++) {
            for (int axis = 0; axis < 3; axis++) at[axis] = from[axis] * of->order + (to[axis] - from[axis]) * step;
            nodes[(*count)++] = session_find_node_in_connectivity(of, order, at[0], at[1], at[2]);
        }
    }
}

static bool make_rim_kind(const session_nodes *of, insitu_vertex_order order, session_rim_kind *out)
{
    const session_shape *shape = session_get_cell_shape(of->type);
    out->faces_of_node = base_calloc((size_t)of->count, 1);
    if (!out->faces_of_node) return false;
    for (int f = 0; f < shape->face_count; f++)
        list_rim_nodes(of, order, shape->faces[f], &out->counts[f], out->nodes[f]);
    for (int k = 0; k <= of->order; k++)
        for (int j = 0; j <= of->order; j++)
            for (int i = 0; i <= of->order; i++) {
                if (!session_has_node(of, i, j, k)) continue;
                const int at = session_find_node_in_connectivity(of, order, i, j, k);
                if (at < of->count)
                    out->faces_of_node[at] =
                        (unsigned char)session_faces_of_node(shape, of->order, (const int[]){i, j, k});
            }
    return true;
}

/* ---- faces and rims of a mesh ------------------------------------------------------------------------------------ */

bool session_rims_create(const session_mesh *mesh, session_rims *out)
{
    *out = (session_rims){.rows = session_describe_rows(mesh), .cell = -1};
    session_list_cell_kinds(&out->rows);
    out->kinds = base_calloc((size_t)out->rows.kind_count, sizeof *out->kinds);
    out->faces_of_vertex = base_calloc((size_t)mesh->cells.vertex_count + 1, 1);
    bool is_made = out->kinds && out->faces_of_vertex;
    for (int i = 0; i < out->rows.kind_count && is_made; i++)
        is_made = make_rim_kind(&out->rows.kinds[i].nodes, mesh->given.vertex_order, &out->kinds[i]);
    return is_made;
}

void session_rims_free(session_rims *rims)
{
    for (int i = 0; i < rims->rows.kind_count && rims->kinds; i++) base_free(rims->kinds[i].faces_of_node);
    base_free(rims->kinds);
    base_free(rims->faces_of_vertex);
    *rims = (session_rims){0};
}

int64_t session_count_rim_nodes(const session_rims *rims, int64_t cell)
{
    const session_rim_kind *kind = session_get_rims_of_cell(rims, cell);
    int64_t count = 0;
    for (int f = 0; f < RIMS_MOST_FACES; f++) count += kind->counts[f];
    return count;
}

/* If are_set is true, adds to faces_of_vertex, for each node of one of the caller's cells, the faces of the cell on
 * which the node lies. Otherwise clears faces_of_vertex for these nodes. A vertex may occur several times in a cell's
 * list of nodes, so that the faces of all of its occurrences are combined. */
static void set_faces_of_vertices(session_rims *rims, int64_t cell, bool are_set)
{
    const int kind = session_find_kind_of_cell(&rims->rows, cell);
    for (int n = 0; n < rims->rows.kinds[kind].nodes.count; n++) {
        unsigned char *faces = &rims->faces_of_vertex[session_find_vertex_of_node(&rims->rows, cell, n)];
        *faces = are_set ? *faces | rims->kinds[kind].faces_of_node[n] : 0;
    }
}

unsigned session_find_faces_with_vertices(session_rims *rims, int64_t cell, const int64_t *vertices, int64_t count)
{
    unsigned faces = (1U << RIMS_MOST_FACES) - 1;
    if (rims->cell != cell) {
        if (rims->cell >= 0) set_faces_of_vertices(rims, rims->cell, false);
        set_faces_of_vertices(rims, cell, true);
        rims->cell = cell;
    }
    for (int64_t i = 0; i < count; i++) faces &= rims->faces_of_vertex[vertices[i]];
    return faces;
}

int session_find_face_of_vertices(session_rims *rims, int64_t cell, const int64_t *vertices, int64_t count)
{
    const unsigned faces = session_find_faces_with_vertices(rims, cell, vertices, count);
    return faces ? __builtin_ctz(faces) : -1;
}
