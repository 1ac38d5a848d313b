/* Cell values on hexes that are refined here and there, covered ones given as ghosts: an isosurface goes on over
 * hanging nodes. The distance from the middle has a sphere for an isosurface, by closed form; a ray through a slit
 * would show its back, or nothing. The same picture to the bit on any ranks. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "session.h"
#include "test_session_fixture.h"

enum { SIZE = 200, PIXELS = SIZE * SIZE, SIDE = 8, LEVELS = 3, CUTS = 4, LINE = SIDE * CUTS * CUTS + 1 };

/* Looked at along z from z = 5; a pixel is 1/100 wide. */
static const char scene_text[] =
    "images:\n  - name: a\n    size: [200, 200]\n    background: [0, 0, 0, 0]\n    camera: {position: [0, 0, 5], "
    "focal: [0, 0, 0], up: [0, 1, 0], projection: orthographic, height: 2}\n    layers:\n"
    "      - isosurface: {field: f, values: [0.72]}\n    outputs: [{path: a.exr}]\n";

typedef enum amr_shape { PLAIN, TURNED, BENT, SHAPES } amr_shape;

typedef struct amr {
    int cuts; /* a cell into so many along each axis */
    amr_shape shape;
    int rank, ranks; /* whose cells are given */
} amr;

/* Arrays of one mesh on one rank. */
typedef struct part {
    int64_t vertex_count, cell_count;
    int64_t *vertices; /* of the finest lattice; -1: none yet */
    double *coordinates, *values;
    int64_t *connectivity;
    unsigned char *ghosts;
} part;

static void part_create(part *p)
{
    const size_t most = 200000;
    *p = (part){.vertices = malloc((size_t)LINE * LINE * LINE * sizeof(int64_t))};
    p->coordinates = malloc(3 * most * sizeof(double));
    p->values = malloc(most * sizeof(double));
    p->connectivity = malloc(8 * most * sizeof(int64_t));
    p->ghosts = malloc(most);
    assert_true(p->vertices && p->coordinates && p->values && p->connectivity && p->ghosts);
    memset(p->vertices, 0xff, (size_t)LINE * LINE * LINE * sizeof(int64_t));
}

static void part_free(part *p)
{
    free(p->vertices);
    free(p->coordinates);
    free(p->values);
    free(p->connectivity);
    free(p->ghosts);
}

static void place_of(const amr *a, const double at[3], double out[3])
{
    memcpy(out, at, 3 * sizeof *out);
    if (a->shape == TURNED) { /* no coordinate is exact */
        out[0] = 0.8 * at[0] - 0.6 * at[1];
        out[1] = 0.48 * at[0] + 0.64 * at[1] - 0.6 * at[2];
        out[2] = 0.36 * at[0] + 0.48 * at[1] + 0.8 * at[2];
    }
    if (a->shape == BENT) { /* bilinear in every cube, so that hanging vertices are on quads */
        out[0] += 0.2 * at[1] * at[2];
        out[1] += 0.1 * at[0] * at[2];
    }
}

static void add_cell(const amr *a, part *p, const int at[3], int width, bool is_ghost)
{
    double middle[3] = {0, 0, 0};
    for (int corner = 0; corner < 8; corner++) {
        static const int steps[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                        {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
        int64_t index = 0;
        double flat[3], place[3];
        for (int axis = 2; axis >= 0; axis--) {
            const int along = at[axis] + steps[corner][axis] * width;
            index = index * LINE + along;
            flat[axis] = 2.0 * along / (SIDE * a->cuts * a->cuts) - 1;
        }
        place_of(a, flat, place);
        for (int axis = 0; axis < 3; axis++) middle[axis] += place[axis] / 8;
        if (p->vertices[index] < 0) {
            memcpy(p->coordinates + 3 * p->vertex_count, place, sizeof place);
            p->vertices[index] = p->vertex_count++;
        }
        p->connectivity[8 * p->cell_count + corner] = p->vertices[index];
    }
    p->values[p->cell_count] =
        is_ghost ? -7 : sqrt(middle[0] * middle[0] + middle[1] * middle[1] + middle[2] * middle[2]);
    p->ghosts[p->cell_count++] = is_ghost;
}

/* Half of the cubes, in blocks, and of their parts those beside. */
static bool is_refined(const amr *a, int level, const int at[3], int width)
{
    double middle[3];
    for (int axis = 0; axis < 3; axis++) middle[axis] = (2.0 * at[axis] + width) / (SIDE * a->cuts * a->cuts) - 1;
    if (level == 0) return middle[0] + 0.4 * middle[1] > 0.1 || (middle[1] < -0.5 && middle[2] > 0.25);
    return level == 1 && a->cuts == 2 && middle[0] + 0.4 * middle[1] > 0.6;
}

static void add_tree(const amr *a, part *p, int level, const int at[3], int width)
{
    const bool is_cut = is_refined(a, level, at, width);
    const uint64_t name = (uint64_t)(at[0] + LINE * (at[1] + LINE * at[2])) * LEVELS + (uint64_t)level;
    const int owner = (int)(test_uniform(name, 8) * a->ranks);
    if (owner == a->rank) add_cell(a, p, at, width, is_cut);
    for (int i = 0; is_cut && i < a->cuts * a->cuts * a->cuts; i++) {
        const int w = width / a->cuts;
        const int within[3] = {at[0] + i % a->cuts * w, at[1] + i / a->cuts % a->cuts * w,
                               at[2] + i / (a->cuts * a->cuts) * w};
        add_tree(a, p, level + 1, within, w);
    }
}

static void make_part(const amr *a, part *p)
{
    const int width = a->cuts * a->cuts;
    part_create(p);
    for (int i = 0; i < SIDE * SIDE * SIDE; i++)
        add_tree(a, p, 0, (const int[]){i % SIDE * width, i / SIDE % SIDE * width, i / (SIDE * SIDE) * width}, width);
}

static void set_part(insitu_session *session, const part *p)
{
    insitu_mesh mesh;
    insitu_field field;
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = p->vertex_count;
    insitu_mesh_interleaved(&mesh, p->coordinates, INSITU_FLOAT64);
    mesh.cell_count = p->cell_count;
    mesh.cell_type = INSITU_HEX;
    mesh.connectivity_count = 8 * p->cell_count;
    mesh.connectivity = (insitu_array){p->connectivity, INSITU_INT64, 0};
    mesh.ghosts = (insitu_array){p->ghosts, INSITU_UINT8, 0};
    insitu_field_defaults(&field);
    field.name = "f";
    field.centring = INSITU_CELL;
    field.count = p->cell_count;
    field.values = (insitu_array){p->values, INSITU_FLOAT64, 0};
    assert_int_equal(insitu_set_mesh(session, "m", &mesh), INSITU_OK);
    assert_int_equal(insitu_set_field(session, "m", &field), INSITU_OK);
}

static caught_picture draw(MPI_Comm comm, const char *scene, const amr *a)
{
    part own;
    insitu_session *session = open_session(comm, scene);
    make_part(a, &own);
    forget_pictures();
    set_part(session, &own);
    const insitu_status status = insitu_step(session, 0, 0);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    assert_int_equal(status, INSITU_OK);
    const caught_picture picture = take_caught();
    insitu_destroy(&session);
    part_free(&own);
    return picture;
}

/* Pixels at which the front of the sphere is not seen. The surface in a cell is off the sphere by less than half the
 * largest cell's diagonal, 0.22; inside of 0.6 the front and the back are 0.8 apart. */
static int count_slits(const caught_picture *picture)
{
    int slits = 0;
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        const double x = (pixel % SIZE + 0.5) / 100 - 1, y = 1 - (pixel / SIZE + 0.5) / 100, square = x * x + y * y;
        if (square > 0.6 * 0.6) continue;
        const double front = 5 - sqrt(0.72 * 0.72 - square);
        slits += !(picture->rgba[4 * pixel + 3] > 0 && fabs((double)picture->depth[pixel] - front) < 0.22);
    }
    return slits;
}

static bool are_same(const caught_picture *a, const caught_picture *b)
{
    return memcmp(a->rgba, b->rgba, 4 * PIXELS * sizeof(float)) == 0 &&
           memcmp(a->depth, b->depth, PIXELS * sizeof(float)) == 0;
}

static void check(int cuts)
{
    const char *scene = write_scene(scene_text);
    for (amr_shape shape = PLAIN; shape < SHAPES; shape++) {
        const amr whole = {cuts, shape, 0, 1}, own = {cuts, shape, own_rank, rank_count};
        caught_picture ours = draw(MPI_COMM_WORLD, scene, &own), alone = {0};
        bool is_well = true;
        if (own_rank == 0) {
            alone = draw(MPI_COMM_SELF, scene, &whole);
            const int slits = count_slits(&alone), parted = count_slits(&ours);
            is_well = slits == 0 && parted == 0 && are_same(&ours, &alone);
            if (!is_well)
                fprintf(stderr, "%d to 1, shape %d: %d pixels torn, %d on ranks; %s\n", cuts, (int)shape, slits, parted,
                        are_same(&ours, &alone) ? "the same" : "another picture");
        }
        everywhere(is_well);
        free_caught(&ours);
        free_caught(&alone);
    }
}

static void cell_values_go_on_over_hanging_nodes(void **state)
{
    (void)state;
    check(2);
    check(4);
}

static int run(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(cell_values_go_on_over_hanging_nodes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

int main(int argc, char **argv)
{
    return run_session_tests(argc, argv, run);
}
