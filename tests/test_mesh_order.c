#include "test_mesh_order.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "grid.h"

#define L INSITU_ORDER_LEXICOGRAPHIC
#define V INSITU_ORDER_VTK
#define G INSITU_ORDER_GMSH
#define E INSITU_ORDER_EXODUS

const order_kind order_kinds[] = {
    {"tet 1", INSITU_LAGRANGE_TET, L, 1},
    {"tet 2", INSITU_LAGRANGE_TET, L, 2},
    {"tet 3", INSITU_LAGRANGE_TET, L, 3},
    {"tet 4", INSITU_LAGRANGE_TET, L, 4},
    {"hex 1", INSITU_LAGRANGE_HEX, L, 1},
    {"hex 2", INSITU_LAGRANGE_HEX, L, 2},
    {"hex 4", INSITU_LAGRANGE_HEX, L, 4},
    {"wedge 2", INSITU_LAGRANGE_WEDGE, L, 2},
    {"wedge 3", INSITU_LAGRANGE_WEDGE, L, 3},
    {"pyramid 2", INSITU_LAGRANGE_PYRAMID, L, 2},
    {"pyramid 3", INSITU_LAGRANGE_PYRAMID, L, 3},
    {"tet 10", INSITU_QUADRATIC_TET, V, 2},
    {"hex 20", INSITU_QUADRATIC_HEX, V, 2},
    {"wedge 15", INSITU_QUADRATIC_WEDGE, V, 2},
    {"pyramid 13", INSITU_QUADRATIC_PYRAMID, V, 2},
    {"hex 27", INSITU_TRIQUADRATIC_HEX, V, 2},
    {"wedge 18", INSITU_BIQUADRATIC_WEDGE, V, 2},
    {"tet 10 gmsh", INSITU_QUADRATIC_TET, G, 2},
    {"hex 20 gmsh", INSITU_QUADRATIC_HEX, G, 2},
    {"hex 27 gmsh", INSITU_TRIQUADRATIC_HEX, G, 2},
    {"wedge 15 gmsh", INSITU_QUADRATIC_WEDGE, G, 2},
    {"wedge 18 gmsh", INSITU_BIQUADRATIC_WEDGE, G, 2},
    {"pyramid 13 gmsh", INSITU_QUADRATIC_PYRAMID, G, 2},
    {"hex 20 exodus", INSITU_QUADRATIC_HEX, E, 2},
    {"hex 27 exodus", INSITU_TRIQUADRATIC_HEX, E, 2},
    {"wedge 15 exodus", INSITU_QUADRATIC_WEDGE, E, 2},
    {"wedge 18 exodus", INSITU_BIQUADRATIC_WEDGE, E, 2},
    {"hex 27 old VTK", INSITU_TRIQUADRATIC_HEX, INSITU_ORDER_VTK_BEFORE_9_1, 2},
};
const int order_kind_count = sizeof order_kinds / sizeof order_kinds[0];

/* ---- nodes between corners ------------------------------------------------------------------------------------- */

/* Nodes of a cell that are not corners. A word lists the corners of which the node is the mean, as letters: "ab" is the
 * middle between corners 0 and 1. */
typedef struct node_list {
    insitu_cell_type type; /* the linear cell type */
    insitu_vertex_order layout;
    const char *nodes;
} node_list;

static const node_list lists[] = {
    {INSITU_TET, V, "ab bc ca ad bd cd"},
    {INSITU_TET, G, "ab bc ca ad cd bd"},
    {INSITU_HEX, V, "ab bc cd da ef fg gh he ae bf cg dh aehd bcgf abfe dcgh abcd efgh abcdefgh"},
    {INSITU_HEX, G, "ab ad ae bc bf cd cg dh ef eh fg gh abcd abfe adhe bcgf cdhg efgh abcdefgh"},
    {INSITU_HEX, E, "ab bc cd da ae bf cg dh ef fg gh he abcdefgh abcd efgh adhe bcgf abfe cdhg"},
    {INSITU_WEDGE, V, "ab bc ca de ef fd ad be cf abed bcfe cafd"},
    {INSITU_WEDGE, G, "ab ac ad bc be cf de df ef abed acfd bcfe"},
    {INSITU_WEDGE, E, "ab bc ca ad be cf de ef fd abed bcfe cafd"},
    {INSITU_PYRAMID, V, "ab bc cd da ae be ce de abcd"},
    {INSITU_PYRAMID, G, "ab ad ae bc be cd ce de abcd"},
};

static insitu_cell_type get_linear_type(insitu_cell_type type)
{
    switch (type) {
    case INSITU_QUADRATIC_TET:
    case INSITU_LAGRANGE_TET: return INSITU_TET;
    case INSITU_QUADRATIC_WEDGE:
    case INSITU_BIQUADRATIC_WEDGE:
    case INSITU_LAGRANGE_WEDGE: return INSITU_WEDGE;
    case INSITU_QUADRATIC_PYRAMID:
    case INSITU_LAGRANGE_PYRAMID: return INSITU_PYRAMID;
    default: return INSITU_HEX;
    }
}

static int get_listed_node_count(insitu_cell_type type)
{
    switch (type) {
    case INSITU_QUADRATIC_TET: return 10;
    case INSITU_QUADRATIC_HEX: return 20;
    case INSITU_QUADRATIC_WEDGE: return 15;
    case INSITU_QUADRATIC_PYRAMID: return 13;
    case INSITU_BIQUADRATIC_WEDGE: return 18;
    default: return 27;
    }
}

/* Weights of the corners for each node of a cell. */
typedef struct node_weights {
    int count;
    double of[216][8];
} node_weights;

static void list_nodes(const order_kind *kind, node_weights *out)
{
    const insitu_cell_type linear = get_linear_type(kind->type);
    const int corners = grid_type_vertex_count((int)linear);
    const insitu_vertex_order layout = kind->layout == INSITU_ORDER_VTK_BEFORE_9_1 ? V : kind->layout;
    const node_list *list = lists;
    while (list->type != linear || list->layout != layout) list++;
    out->count = get_listed_node_count(kind->type);
    for (int c = 0; c < corners; c++) out->of[c][c] = 1;
    const char *at = list->nodes;
    for (int n = corners; n < out->count; n++) {
        const size_t size = strcspn(at, " ");
        for (size_t i = 0; i < size; i++) out->of[n][at[i] - 'a'] = 1 / (double)size;
        at += size + (at[size] == ' ');
    }
}

static void add_node(node_weights *out, const double weights[8])
{
    memcpy(out->of[out->count++], weights, 8 * sizeof *weights);
}

static void make_loop_nodes(const order_kind *kind, node_weights *out)
{
    const insitu_cell_type linear = get_linear_type(kind->type);
    const int p = kind->order;
    for (int k = 0; k <= p; k++)
        for (int j = 0; j <= p; j++)
            for (int i = 0; i <= p; i++) {
                const double u = (double)i / p, v = (double)j / p, w = (double)k / p;
                double of[8] = {0};
                if (linear == INSITU_TET && i + j + k <= p) add_node(out, (const double[8]){1 - u - v - w, u, v, w});
                if (linear == INSITU_WEDGE && i + j <= p)
                    add_node(out, (const double[8]){(1 - u - v) * (1 - w), u * (1 - w), v * (1 - w), (1 - u - v) * w,
                                                    u * w, v * w});
                for (int c = 0; c < 8; c++)
                    of[c] =
                        ((c & 3) == 1 || (c & 3) == 2 ? u : 1 - u) * ((c & 3) > 1 ? v : 1 - v) * (c > 3 ? w : 1 - w);
                if (linear == INSITU_HEX) add_node(out, of);
                if (linear != INSITU_PYRAMID || i > p - k || j > p - k) continue;
                const double s = p == k ? 0 : (double)i / (p - k), t = p == k ? 0 : (double)j / (p - k);
                add_node(out, (const double[8]){(1 - s) * (1 - t) * (1 - w), s * (1 - t) * (1 - w), s * t * (1 - w),
                                                (1 - s) * t * (1 - w), w});
            }
}

/* ---- cells in a cube ------------------------------------------------------------------------------------------- */

/* Lists the cells of a cube. Corners are 0 to 7 by bits along x, y, z; 8 is the cube's middle. Returns the number of
 * cells. */
static int get_cells_of_cube(insitu_cell_type linear, const signed char (**cells)[8])
{
    static const signed char hex[1][8] = {{0, 1, 3, 2, 4, 5, 7, 6}};
    static const signed char wedges[2][8] = {{0, 1, 3, 4, 5, 7}, {0, 3, 2, 4, 7, 6}};
    static const signed char tets[6][8] = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7},
                                           {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};
    static const signed char pyramids[6][8] = {{0, 1, 3, 2, 8}, {4, 6, 7, 5, 8}, {0, 4, 5, 1, 8},
                                               {2, 3, 7, 6, 8}, {0, 2, 6, 4, 8}, {1, 5, 7, 3, 8}};
    *cells = linear == INSITU_TET ? tets : linear == INSITU_WEDGE ? wedges : linear == INSITU_PYRAMID ? pyramids : hex;
    return linear == INSITU_TET || linear == INSITU_PYRAMID ? 6 : linear == INSITU_WEDGE ? 2 : 1;
}

/* Makes an order_mesh. Node positions are integers in units of 1 / `units` of a cube's side; across: number of such
 * positions along an axis. */
typedef struct maker {
    order_mesh *out;
    int units, across;
    int64_t *numbers; /* index of the vertex at each position; -1 if it is not created yet */
    double bend;
} maker;

double order_mesh_move_coordinate(double bend, const double point[3], int axis)
{
    const double *p = point;
    const int next = (axis + 1) % 3, last = (axis + 2) % 3;
    return p[axis] + bend * sin(2.3 * p[next] + 0.7 * axis) * cos(1.9 * p[last]) * (1 - p[axis] * p[axis]);
}

static int64_t find_or_add_node(maker *m, const int64_t place[3])
{
    int64_t *number = &m->numbers[place[0] + m->across * (place[1] + m->across * place[2])];
    if (*number >= 0) return *number;
    double point[3];
    for (int axis = 0; axis < 3; axis++) point[axis] = -1 + 2 * (double)place[axis] / (m->across - 1);
    *number = m->out->vertex_count++;
    for (int axis = 0; axis < 3; axis++)
        m->out->coordinates[3 * *number + axis] = order_mesh_move_coordinate(m->bend, point, axis);
    return *number;
}

static void add_cell(maker *m, const node_weights *nodes, const signed char corners[8], int count, const int cube[3])
{
    for (int n = 0; n < nodes->count; n++) {
        int64_t place[3];
        for (int axis = 0; axis < 3; axis++) {
            double at = 0;
            for (int c = 0; c < count; c++)
                at += nodes->of[n][c] * (corners[c] == 8 ? 0.5 : (double)(corners[c] >> axis & 1));
            place[axis] = llround((cube[axis] + at) * m->units);
        }
        m->out->connectivity[m->out->cell_count * nodes->count + n] = find_or_add_node(m, place);
    }
    m->out->cell_count++;
}

static void describe_mesh(const order_kind *kind, order_mesh *out)
{
    insitu_mesh_defaults(&out->mesh);
    insitu_mesh_interleaved(&out->mesh, out->coordinates, INSITU_FLOAT64);
    out->mesh.vertex_count = out->vertex_count;
    out->mesh.cell_count = out->cell_count;
    out->mesh.cell_type = kind->type;
    out->mesh.vertex_order = kind->layout;
    out->mesh.connectivity = (insitu_array){out->connectivity, INSITU_INT64, 0};
    out->mesh.connectivity_count = out->cell_count * out->nodes;
    insitu_field_defaults(&out->field);
    out->field.name = "f";
    out->field.values = (insitu_array){out->values, INSITU_FLOAT64, 0};
    out->field.count = out->vertex_count;
}

void order_mesh_create(const order_kind *kind, int side, double bend, order_function *value, int rank, int ranks,
                       order_mesh *out)
{
    const insitu_cell_type linear = get_linear_type(kind->type);
    const signed char(*cells)[8];
    const int count = get_cells_of_cube(linear, &cells), corners = grid_type_vertex_count((int)linear);
    node_weights *nodes = calloc(1, sizeof *nodes);
    if (kind->layout == L)
        make_loop_nodes(kind, nodes);
    else
        list_nodes(kind, nodes);
    *out = (order_mesh){.nodes = nodes->count};
    maker m = {.out = out, .units = 2 * kind->order, .bend = bend};
    m.across = side * m.units + 1;
    const size_t places = (size_t)m.across * (size_t)m.across * (size_t)m.across;
    m.numbers = malloc(places * sizeof *m.numbers);
    memset(m.numbers, -1, places * sizeof *m.numbers);
    out->coordinates = malloc(3 * places * sizeof(double));
    out->values = malloc(places * sizeof(double));
    out->connectivity = malloc((size_t)(side * side * side * count * nodes->count) * sizeof(int64_t));
    for (int n = 0; n < side * side * side * count; n++) {
        const int at = n / count, cube[3] = {at % side, at / side % side, at / side / side};
        if (n % ranks == rank) add_cell(&m, nodes, cells[n % count], corners, cube);
    }
    for (int64_t i = 0; i < out->vertex_count; i++) out->values[i] = value(out->coordinates + 3 * i);
    describe_mesh(kind, out);
    free(m.numbers);
    free(nodes);
}

order_mesh order_mesh_make_linear_hexes(const order_mesh *of, int p)
{
    order_mesh out = *of;
    const int n = p + 1;
    int64_t *at = out.connectivity = malloc((size_t)(of->cell_count * p * p * p * 8) * sizeof *at);
    for (int64_t cell = 0; cell < of->cell_count; cell++)
        for (int i = 0; i < p * p * p; i++)
            for (int c = 0; c < 8; c++) {
                const int x = i % p + (c % 4 == 1 || c % 4 == 2), y = i / p % p + (c % 4 > 1), z = i / p / p + c / 4;
                *at++ = of->connectivity[cell * of->nodes + x + n * (y + n * z)];
            }
    out.mesh.cell_type = INSITU_HEX;
    out.mesh.vertex_order = INSITU_ORDER_VTK;
    out.mesh.cell_count = of->cell_count * p * p * p;
    out.mesh.connectivity = (insitu_array){out.connectivity, INSITU_INT64, 0};
    out.mesh.connectivity_count = out.mesh.cell_count * 8;
    return out;
}

void order_mesh_free(order_mesh *mesh)
{
    free(mesh->coordinates);
    free(mesh->values);
    free(mesh->connectivity);
    *mesh = (order_mesh){0};
}

double order_sphere_field(const double p[3])
{
    return p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
}

double order_wave_field(const double p[3])
{
    return sin(2 * p[0]) * cos(1.5 * p[1]) + 0.5 * p[2];
}

double order_plane_field(const double p[3])
{
    return p[2] + 0.3 * p[0] + 0.2 * p[1];
}
