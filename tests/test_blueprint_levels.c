/* Checks Mesh Blueprint domains that become blocks of one mesh: uniform domains whose positions are rounded, and levels
 * of refinement with and without ghost layers. The pictures must be bit-identical to those of blocks passed by the
 * public header, no pixel inside the picture of a sphere may show the background, and nothing may be copied. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "conduit_stand_in.h"
#include "insitu/conduit.h"
#include "test_blueprint_door.h"
#include "test_session_fixture.h"

enum { MOST_BOXES = 16, SIDE = 8, SIZE = 120 };

/* A view along z that shows exactly the mesh. The width of picture and mesh is 0.8. */
static const char scene[] =
    "images:\n  - name: a\n    size: [120, 120]\n    background: [0, 0, 0, 0]\n    camera: {position: [0.4, 0.4, 5], "
    "focal: [0.4, 0.4, 0], up: [0, 1, 0], projection: orthographic, height: 0.8}\n    layers:\n"
    "      - isosurface: {field: f, values: [0.3]}\n    outputs: [{path: a.exr}]\n";
/* A scene with a transparent surface: it would show a wall between two domains. */
static const char scene_of_surfaces[] =
    "images:\n  - name: a\n    size: [120, 120]\n    camera: {automatic: {direction: [1, 0.7, 0.9]}}\n    layers:\n"
    "      - surface: {colour_by: {field: f, interpolate: vertex}, opacity: 0.3}\n    outputs: [{path: a.exr}]\n";

/* ---- boxes ------------------------------------------------------------------------------------------------------- */

/* A domain in units of cells of the coarsest level. The whole mesh has SIDE of these cells along each axis. */
typedef struct box {
    int level, lower[3], upper[3];
} box;

typedef enum layer_kind { NO_LAYER, BY_ASCENT, BY_VTK } layer_kind;

typedef struct plan {
    int refinement[3]; /* refinement: number of cells per coarsest cell along an axis, for each level */
    double corner;     /* lower coordinate of the whole mesh along each axis */
    double width;      /* width of a cell of the coarsest level; not a power of two, so that positions are rounded */
    bool is_of_cells;
    bool has_first;  /* domains state elements/origin */
    bool has_layers; /* some domains have ghost layers, in which the values are wrong */
    bool has_levels; /* domains state their level */
    int count;
    box boxes[MOST_BOXES];
} plan;

static void add_box(plan *p, int level, int x, int y, int z, int wide, int high, int deep)
{
    p->boxes[p->count++] = (box){level, {x, y, z}, {x + wide, y + high, z + deep}};
}

/* Adds boxes whose common faces begin at different vertices of each box. */
static void add_shifted_boxes(plan *p)
{
    p->count = 0;
    add_box(p, 0, 0, 0, 0, 4, 3, 8);
    add_box(p, 0, 0, 3, 0, 4, 5, 8);
    add_box(p, 0, 4, 0, 0, 4, 5, 3);
    add_box(p, 0, 4, 0, 3, 4, 5, 5);
    add_box(p, 0, 4, 5, 0, 4, 3, 8);
}

/* Adds eight boxes of the coarsest level, and refined boxes over them: in the middle, next to each other and at the
 * border. If is_moved is set, the finest box lies elsewhere. */
static void add_boxes(plan *p, bool is_moved)
{
    p->count = 0;
    for (int i = 0; i < 8; i++) add_box(p, 0, i % 2 * 4, i / 2 % 2 * 4, i / 4 * 4, 4, 4, 4);
    add_box(p, 1, 0, 2, 4, 3, 5, 4);
    add_box(p, 1, 3, 2, 4, 2, 5, 4);
    add_box(p, 2, is_moved ? 0 : 1, 3, 5, 3, 3, 3);
}

static int get_owner_rank(int number)
{
    return (number * 5 + 1) % rank_count;
}

static double compute_spacing(const plan *p, const box *b)
{
    return p->width / p->refinement[b->level];
}

/* Returns the position that a simulation states for a domain: the mesh's lower corner plus a multiple of the spacing,
 * rounded. layer: number of ghost layers. */
static double compute_stated_position(const plan *p, const box *b, int axis, int layer)
{
    return p->corner + compute_spacing(p, b) * (b->lower[axis] * p->refinement[b->level] - layer);
}

/* Returns the origin of the whole lattice that follows from the domain's stated position. */
static double compute_lattice_origin(const plan *p, const box *b, int axis, int layer)
{
    const double spacing = compute_spacing(p, b), at = compute_stated_position(p, b, axis, layer);
    return p->has_first ? at - spacing * (b->lower[axis] * p->refinement[b->level] - layer) : at;
}

static layer_kind get_ghost_layer(const plan *p, int number)
{
    return p->has_layers ? (layer_kind)(number % 3) : NO_LAYER;
}

/* Returns the smallest of the origins that follow from the domains of the coarsest level. Domains with ghost layers
 * begin farther out. */
static double find_common_origin(const plan *p, int axis)
{
    double least = INFINITY;
    for (int i = 0; i < p->count; i++)
        if (p->boxes[i].level == 0)
            least = fmin(least, compute_lattice_origin(p, &p->boxes[i], axis, get_ghost_layer(p, i) != NO_LAYER));
    return least;
}

/* ---- a domain for both interfaces: the Blueprint node and the public header ---- */

typedef struct domain {
    insitu_lattice lattice;
    int64_t vertex_count, cell_count;
    double *values;
    int32_t *flags; /* flags of cells; NULL if there are none */
} domain;

static void measure_domain(const plan *p, int number, domain *out)
{
    const box *b = &p->boxes[number];
    const int of = p->refinement[b->level], layer = get_ghost_layer(p, number) != NO_LAYER;
    *out = (domain){.vertex_count = 1, .cell_count = 1};
    for (int axis = 0; axis < 3; axis++) {
        insitu_lattice *l = &out->lattice;
        l->cells[axis] = (b->upper[axis] - b->lower[axis]) * of + 2 * layer;
        l->interior_first[axis] = layer;
        l->interior_end[axis] = l->cells[axis] - layer;
        l->spacing[axis] = compute_spacing(p, b);
        l->origin[axis] = find_common_origin(p, axis);
        l->first[axis] = llround((compute_stated_position(p, b, axis, layer) - l->origin[axis]) / l->spacing[axis]);
        l->refinement[axis] = p->has_levels ? of : 0;
        out->cell_count *= l->cells[axis];
        out->vertex_count *= l->cells[axis] + 1;
    }
}

/* Makes a domain whose field is the distance from the middle of the whole mesh. In ghost layers the field is -40. */
static void make_domain(const plan *p, int number, domain *out)
{
    measure_domain(p, number, out);
    const box *b = &p->boxes[number];
    const insitu_lattice *l = &out->lattice;
    const int more = p->is_of_cells ? 0 : 1, layer = (int)l->interior_first[0];
    const int64_t count = p->is_of_cells ? out->cell_count : out->vertex_count;
    out->values = malloc((size_t)count * sizeof *out->values);
    if (layer) out->flags = calloc((size_t)out->cell_count, sizeof *out->flags);
    assert_true(out->values && (out->flags || !layer));
    for (int64_t i = 0; i < count; i++) {
        const int64_t wide[2] = {l->cells[0] + more, l->cells[1] + more};
        const int64_t at[3] = {i % wide[0], i / wide[0] % wide[1], i / wide[0] / wide[1]};
        double square = 0;
        bool is_inner = true;
        for (int axis = 0; axis < 3; axis++) {
            const double x = b->lower[axis] + ((double)(at[axis] - layer) + (more ? 0 : 0.5)) / p->refinement[b->level];
            square += (x - SIDE / 2) * (x - SIDE / 2);
            is_inner = is_inner && at[axis] >= layer && at[axis] < l->cells[axis] - layer + more;
        }
        out->values[i] = is_inner ? p->width * sqrt(square) : -40;
    }
    for (int64_t i = 0; i < out->cell_count && layer; i++) {
        const int64_t at[3] = {i % l->cells[0], i / l->cells[0] % l->cells[1], i / l->cells[0] / l->cells[1]};
        for (int axis = 0; axis < 3; axis++)
            if (at[axis] < layer || at[axis] >= l->cells[axis] - layer) out->flags[i] = 1;
    }
}

static void free_domains(const plan *p, domain *domains)
{
    for (int i = 0; i < p->count; i++) {
        free(domains[i].values);
        free(domains[i].flags);
    }
}

static void make_domains(const plan *p, domain domains[MOST_BOXES])
{
    for (int i = 0; i < p->count; i++) {
        domains[i] = (domain){.values = NULL};
        if (get_owner_rank(i) == own_rank) make_domain(p, i, &domains[i]);
    }
}

static bool submit_domains_by_header(insitu_session *session, const plan *p, const domain *domains)
{
    bool is_set = true;
    for (int i = 0, number = 0; i < p->count; i++) {
        const domain *d = &domains[i];
        insitu_mesh mesh;
        insitu_field field;
        if (!d->values) continue;
        insitu_mesh_defaults(&mesh);
        mesh.lattice = &d->lattice;
        mesh.vertex_count = d->vertex_count;
        mesh.cell_count = d->cell_count;
        insitu_field_defaults(&field);
        field.name = "f";
        field.centring = p->is_of_cells ? INSITU_CELL : INSITU_VERTEX;
        field.count = p->is_of_cells ? d->cell_count : d->vertex_count;
        field.values = (insitu_array){d->values, INSITU_FLOAT64, 0};
        is_set = is_set && !insitu_set_block(session, "amr/mesh", number, &mesh) &&
                 !insitu_set_block_field(session, "amr/mesh", number, &field);
        number++;
    }
    return is_set;
}

static conduit_node *add_child(conduit_node *node, int number)
{
    char name[32];
    snprintf(name, sizeof name, "domain_%06d", number);
    return conduit_node_fetch(node, name);
}

static void store_field(conduit_node *node, const char *name, bool is_of_cells, int id, const void *values,
                        int64_t count)
{
    char path[64];
    snprintf(path, sizeof path, "fields/%s/association", name);
    conduit_node_set_path_char8_str(node, path, is_of_cells ? "element" : "vertex");
    snprintf(path, sizeof path, "fields/%s/topology", name);
    conduit_node_set_path_char8_str(node, path, "mesh");
    snprintf(path, sizeof path, "fields/%s/values", name);
    stand_in_set_array(node, path, id, values, count, 0);
}

static void store_domain(conduit_node *node, const plan *p, int number, const domain *d)
{
    static const char *const dims[3] = {"coordsets/coords/dims/i", "coordsets/coords/dims/j",
                                        "coordsets/coords/dims/k"};
    static const char *const origins[3] = {"coordsets/coords/origin/x", "coordsets/coords/origin/y",
                                           "coordsets/coords/origin/z"};
    static const char *const spacings[3] = {"coordsets/coords/spacing/dx", "coordsets/coords/spacing/dy",
                                            "coordsets/coords/spacing/dz"};
    static const char *const firsts[3] = {"topologies/mesh/elements/origin/i0", "topologies/mesh/elements/origin/j0",
                                          "topologies/mesh/elements/origin/k0"};
    const box *b = &p->boxes[number];
    const int layer = get_ghost_layer(p, number) != NO_LAYER;
    conduit_node_set_path_char8_str(node, "coordsets/coords/type", "uniform");
    conduit_node_set_path_char8_str(node, "topologies/mesh/type", "uniform");
    conduit_node_set_path_char8_str(node, "topologies/mesh/coordset", "coords");
    if (p->has_levels) conduit_node_set_path_int64(node, number % 2 ? "state/level" : "state/level_id", b->level);
    for (int axis = 0; axis < 3; axis++) {
        conduit_node_set_path_int64(node, dims[axis], d->lattice.cells[axis] + 1);
        conduit_node_set_path_float64(node, origins[axis], compute_stated_position(p, b, axis, layer));
        conduit_node_set_path_float64(node, spacings[axis], compute_spacing(p, b));
        if (p->has_first)
            conduit_node_set_path_int64(node, firsts[axis], b->lower[axis] * p->refinement[b->level] - layer);
    }
    store_field(node, "f", p->is_of_cells, STAND_IN_FLOAT64, d->values,
                p->is_of_cells ? d->cell_count : d->vertex_count);
    if (layer)
        store_field(node, get_ghost_layer(p, number) == BY_VTK ? "vtkGhostType" : "ascent_ghosts", true, STAND_IN_INT32,
                    d->flags, d->cell_count);
}

static conduit_node *make_node(const plan *p, const domain *domains)
{
    conduit_node *node = conduit_node_create();
    for (int i = 0, number = 0; i < p->count; i++)
        if (domains[i].values) store_domain(add_child(node, number++), p, i, &domains[i]);
    return node;
}

/* ---- pictures -----------------------------------------------------------------------------------------------------
 */

static caught_picture draw_mesh_by_header(const char *path, const plan *p, const domain *domains)
{
    insitu_session *session = open_session(MPI_COMM_WORLD, path);
    everywhere(submit_domains_by_header(session, p, domains));
    check_step_succeeds(session, 0);
    insitu_destroy(&session);
    return pop_caught_picture();
}

/* Returns the number of background pixels inside the picture of the sphere. The sphere's radius is 3 cells of the
 * coarsest level, and the isosurface is off by less than one cell, so all pixels within 2 cells of the middle must be
 * covered. */
static int count_holes(const caught_picture *picture)
{
    int holes = 0;
    for (int pixel = 0; pixel < SIZE * SIZE; pixel++) {
        const double x = (pixel % SIZE + 0.5) / SIZE * SIDE - SIDE / 2.0,
                     y = (pixel / SIZE + 0.5) / SIZE * SIDE - SIDE / 2.0;
        holes += x * x + y * y < 2 * 2 && !(picture->rgba[4 * pixel + 3] > 0);
    }
    return holes;
}

/* Draws the domains through the adaptor and compares the picture with that of blocks passed by the public header. */
static void draw_and_compare(doorway *d, const char *path, const plan *p, bool is_sphere)
{
    domain domains[MOST_BOXES];
    make_domains(p, domains);
    conduit_node *node = make_node(p, domains);
    caught_picture truth = draw_mesh_by_header(path, p, domains);
    const insitu_status status = insitu_blueprint_set(d->adaptor, "amr", node);
    conduit_node_destroy(node);
    everywhere(status == INSITU_OK);
    everywhere(insitu_blueprint_step(d->adaptor, NULL, NULL) == INSITU_OK);
    caught_picture picture = pop_caught_picture();
    const insitu_blueprint_report *report = insitu_blueprint_last_report(d->adaptor);
    const bool is_same = own_rank || are_same_pictures(&picture, &truth);
    const int holes = own_rank || !is_sphere ? 0 : count_holes(&picture);
    if (!is_same || holes)
        fprintf(stderr, "ratio %d, corner %g%s%s%s: %s, %d holes\n", p->refinement[1], p->corner,
                p->is_of_cells ? ", cells" : "", p->has_first ? ", first" : "", p->has_layers ? ", layers" : "",
                is_same ? "the same picture" : "another picture", holes);
    everywhere(is_same && !holes);
    everywhere(report->bytes_copied == 0 && !*report->left_out);
    free_caught(&picture);
    free_caught(&truth);
    free_domains(p, domains);
}

/* ---- tests --------------------------------------------------------------------------------------------------------
 */

static plan make_plan(int way)
{
    return (plan){.refinement = {1, way & 1 ? 4 : 2, way & 1 ? 8 : 4},
                  .corner = way & 2 ? 0.3 : 0,
                  .width = 0.1,
                  .is_of_cells = way & 4,
                  .has_first = way & 8,
                  .has_layers = (way ^ way >> 2) & 1,
                  .has_levels = true};
}

static void levels_draw_same_picture_as_blocks(void **state)
{
    (void)state;
    for (int way = 0; way < 16; way++) {
        plan p = make_plan(way);
        add_boxes(&p, false);
        const char *path = write_scene(scene);
        doorway d = open_adaptor_session(path);
        draw_and_compare(&d, path, &p, p.corner == 0);
        close_adaptor_session(&d);
    }
}

/* Checks boxes that change between steps. If they do not change, no tree is built. */
static void moved_levels_are_drawn(void **state)
{
    (void)state;
    const char *path = write_scene(scene);
    doorway d = open_adaptor_session(path);
    plan p = make_plan(4);
    for (int step = 0; step < 6; step++) {
        add_boxes(&p, step / 2 % 2);
        if (step == 5) p.count--; /* the finest box is removed */
        draw_and_compare(&d, path, &p, true);
    }
    close_adaptor_session(&d);
}

/* Compares the domains with a single block of the whole mesh that the first rank passes by the public header.
 * Isosurfaces do not depend on the partition, and a transparent surface would show a wall between domains. */
static void domains_of_one_level_have_no_seam(void **state)
{
    (void)state;
    for (int way = 0; way < 8; way++) {
        plan p = {.refinement = {1, 1, 1},
                  .width = 0.1,
                  .corner = way & 2 ? 0.3 : 0,
                  .is_of_cells = true,
                  .has_first = way & 4};
        plan whole = p;
        const char *path = write_scene(way & 1 ? scene_of_surfaces : scene);
        domain domains[MOST_BOXES], one[1];
        add_shifted_boxes(&p);
        add_box(&whole, 0, 0, 0, 0, SIDE, SIDE, SIDE);
        make_domain(&whole, 0, &one[0]);
        for (int axis = 0; axis < 3; axis++) one[0].lattice.origin[axis] = find_common_origin(&p, axis);
        if (own_rank) {
            free(one[0].values);
            one[0].values = NULL;
        }
        caught_picture truth = draw_mesh_by_header(path, &whole, one);
        make_domains(&p, domains);
        conduit_node *node = make_node(&p, domains);
        doorway d = open_adaptor_session(path);
        everywhere(insitu_blueprint_set(d.adaptor, "amr", node) == INSITU_OK);
        everywhere(insitu_blueprint_step(d.adaptor, NULL, NULL) == INSITU_OK);
        caught_picture picture = pop_caught_picture();
        const double off = own_rank ? 0 : largest_colour_difference(&picture, &truth);
        const bool is_well = own_rank || (way & 1 ? off < 1e-5 : are_same_pictures(&picture, &truth));
        if (!is_well) fprintf(stderr, "way %d: pictures differ by %g\n", way, off);
        everywhere(is_well);
        everywhere(insitu_blueprint_last_report(d.adaptor)->bytes_copied == 0);
        close_adaptor_session(&d);
        conduit_node_destroy(node);
        free_caught(&picture);
        free_caught(&truth);
        free_domains(&p, domains);
        free_domains(&whole, one);
    }
}

/* Checks a domain whose cells are no integer fraction of the coarsest cells: it is reported by name and drawn together
 * with the cells that it overlaps. */
static void domains_that_fit_no_level_are_reported(void **state)
{
    (void)state;
    plan p = make_plan(0);
    domain domains[MOST_BOXES];
    add_boxes(&p, false);
    make_domains(&p, domains);
    conduit_node *node = make_node(&p, domains);
    const bool has_one = domains[p.count - 1].values != NULL;
    char path[64];
    int last = -1;
    for (int i = 0; i < p.count; i++) last += domains[i].values != NULL;
    snprintf(path, sizeof path, "domain_%06d/coordsets/coords/spacing/dy", last);
    if (has_one) conduit_node_set_path_float64(node, path, 0.017);
    doorway d = open_adaptor_session(write_scene(scene));
    everywhere(insitu_blueprint_set(d.adaptor, "amr", node) == INSITU_OK);
    everywhere(insitu_blueprint_step(d.adaptor, NULL, NULL) == INSITU_OK);
    const char *left_out = insitu_blueprint_last_report(d.adaptor)->left_out;
    everywhere(has_one == (strstr(left_out, "amr/mesh: block ") && strstr(left_out, "is on no level")));
    discard_pictures();
    close_adaptor_session(&d);
    conduit_node_destroy(node);
    free_domains(&p, domains);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(levels_draw_same_picture_as_blocks),
        cmocka_unit_test(moved_levels_are_drawn),
        cmocka_unit_test(domains_of_one_level_have_no_seam),
        cmocka_unit_test(domains_that_fit_no_level_are_reported),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
