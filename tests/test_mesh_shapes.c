/* Makes meshes with a single cell, valid or degenerate. */
#include "test_mesh_make.h"

#include <math.h>
#include <string.h>

static const double unit_hex[8][3] = {{-0.5, -0.5, -0.5}, {0.5, -0.5, -0.5}, {0.5, 0.5, -0.5}, {-0.5, 0.5, -0.5},
                                      {-0.5, -0.5, 0.5},  {0.5, -0.5, 0.5},  {0.5, 0.5, 0.5},  {-0.5, 0.5, 0.5}};

const char *test_polyhedron_name(test_polyhedron_shape shape)
{
    static const char *const names[TEST_POLYHEDRON_COUNT] = {"L prism", "U prism", "spikes", "bent spikes", "cavity"};
    return names[shape];
}

static void make_prism(test_mesh *mesh, const double (*base)[2], int count)
{
    int64_t loop[2][8], faces[10];
    for (int level = 0; level < 2; level++)
        for (int i = 0; i < count; i++)
            loop[level][i] =
                test_mesh_add_vertex(mesh, (const double[]){base[i][0], base[i][1] + 0.1 * level, level ? 0.45 : -0.4});
    for (int level = 0; level < 2; level++) faces[level] = test_mesh_add_face(mesh, loop[level], count);
    for (int i = 0; i < count; i++) {
        const int next = (i + 1) % count;
        const int64_t quad[4] = {loop[0][i], loop[0][next], loop[1][next], loop[1][i]};
        faces[2 + i] = test_mesh_add_face(mesh, quad, 4);
    }
    test_mesh_add_polyhedron(mesh, faces, count + 2);
}

static void make_spikes(test_mesh *mesh, bool is_bent)
{
    int64_t faces[24];
    for (int axis = 0; axis < 3; axis++)
        for (int side = -1; side < 2; side += 2) {
            double p[3] = {0.02, -0.01, 0.03};
            p[axis] += 0.4 * side;
            test_mesh_add_vertex(mesh, p);
        }
    for (int octant = 0; octant < 8; octant++) {
        const int64_t corners[3] = {octant & 1, 2 + (octant >> 1 & 1), 4 + (octant >> 2)};
        double tip[3];
        for (int axis = 0; axis < 3; axis++) tip[axis] = 0.6 * (octant >> axis & 1 ? 1 : -1);
        if (is_bent) tip[octant % 3] *= -0.9;
        const int64_t top = test_mesh_add_vertex(mesh, tip);
        for (int i = 0; i < 3; i++) {
            const int64_t triangle[3] = {corners[i], corners[(i + 1) % 3], top};
            faces[3 * octant + i] = test_mesh_add_face(mesh, triangle, 3);
        }
    }
    test_mesh_add_polyhedron(mesh, faces, 24);
}

static void make_cavity(test_mesh *mesh)
{
    int64_t faces[12];
    for (int shell = 0; shell < 2; shell++) {
        const int64_t first = mesh->vertex_count;
        for (int i = 0; i < 8; i++) {
            double p[3];
            for (int axis = 0; axis < 3; axis++)
                p[axis] = (shell ? 0.2 : 0.5) * unit_hex[i][axis] * 2 + 0.02 * shell + 0.01 * axis * i;
            test_mesh_add_vertex(mesh, p);
        }
        for (int face = 0; face < 6; face++) {
            int64_t quad[4];
            for (int i = 0; i < 4; i++) quad[i] = first + test_get_cell_faces(GRID_HEX)->vertices[face][i];
            faces[6 * shell + face] = test_mesh_add_face(mesh, quad, 4);
        }
    }
    test_mesh_add_polyhedron(mesh, faces, 12);
}

void test_mesh_make_polyhedron(test_polyhedron_shape shape, test_function *f, test_mesh *out)
{
    static const double l[6][2] = {{-0.5, -0.5}, {0.5, -0.45}, {0.5, -0.1}, {0.0, 0.0}, {-0.1, 0.5}, {-0.5, 0.4}};
    static const double u[8][2] = {{-0.5, -0.5}, {0.5, -0.5},  {0.5, 0.5},   {0.3, 0.45},
                                   {0.25, -0.3}, {-0.3, -0.3}, {-0.3, 0.45}, {-0.5, 0.5}};
    test_mesh_allocate(out, 16, 1, 24);
    test_mesh_allocate_faces(out, 24, 72);
    switch (shape) {
    case TEST_L_PRISM: make_prism(out, l, 6); break;
    case TEST_U_PRISM: make_prism(out, u, 8); break;
    case TEST_CAVITY: make_cavity(out); break;
    default: make_spikes(out, shape == TEST_BENT_SPIKES); break;
    }
    test_mesh_set_values(out, f);
}

static const double unit_tet[4][3] = {{-0.5, -0.5, -0.5}, {0.7, -0.4, -0.3}, {-0.3, 0.6, -0.4}, {-0.1, 0.0, 0.7}};

const char *test_cell_shape_name(test_cell_shape shape)
{
    static const char *const names[TEST_SHAPE_COUNT] = {"unit tet",       "unit hex",   "unit wedge",  "unit pyramid",
                                                        "sliver tet",     "warped hex", "twisted hex", "hex as wedge",
                                                        "hex as pyramid", "flat tet",   "flat hex",    "point hex"};
    return names[shape];
}

static int get_shape_type(test_cell_shape shape)
{
    switch (shape) {
    case TEST_UNIT_TET:
    case TEST_SLIVER_TET:
    case TEST_FLAT_TET: return GRID_TET;
    case TEST_UNIT_WEDGE: return GRID_WEDGE;
    case TEST_UNIT_PYRAMID: return GRID_PYRAMID;
    default: return GRID_HEX;
    }
}

static void compute_shape_hex_vertex(test_cell_shape shape, int i, double p[3])
{
    const double upper = i < 4 ? 0 : 1, angle = 50 * 3.14159265358979 / 180 * upper, x = p[0], y = p[1];
    switch (shape) {
    case TEST_WARPED_HEX:
        for (unsigned axis = 0; axis < 3; axis++) p[axis] += 0.3 * test_uniform((uint64_t)(3 * i) + axis, 3) - 0.15;
        break;
    case TEST_TWISTED_HEX:
        p[0] = cos(angle) * x - sin(angle) * y;
        p[1] = sin(angle) * x + cos(angle) * y;
        break;
    case TEST_HEX_AS_WEDGE: p[0] *= 1 - upper; break;
    case TEST_HEX_AS_PYRAMID:
        p[0] *= 1 - upper;
        p[1] *= 1 - upper;
        break;
    case TEST_FLAT_HEX: p[2] = 0; break;
    case TEST_POINT_HEX: p[0] = p[1] = p[2] = 0.1; break;
    default: break;
    }
}

static void compute_shape_vertex(test_cell_shape shape, int i, double p[3])
{
    static const double wedge[3][2] = {{-0.5, -0.4}, {0.6, -0.3}, {0.0, 0.6}};
    switch (get_shape_type(shape)) {
    case GRID_TET:
        memcpy(p, unit_tet[i], sizeof unit_tet[i]);
        if (shape == TEST_SLIVER_TET) p[2] = i == 3 ? 1e-4 : 0;
        if (shape == TEST_FLAT_TET) p[2] = 0.25 * p[0];
        break;
    case GRID_WEDGE:
        p[0] = wedge[i % 3][0];
        p[1] = wedge[i % 3][1] + (i < 3 ? 0 : 0.1);
        p[2] = i < 3 ? -0.5 : 0.5;
        break;
    case GRID_PYRAMID: memcpy(p, i < 4 ? unit_hex[i] : (const double[]){0.2, -0.1, 0.6}, 3 * sizeof(double)); break;
    default:
        memcpy(p, unit_hex[i], sizeof unit_hex[i]);
        compute_shape_hex_vertex(shape, i, p);
        break;
    }
}

void test_mesh_make_single_cell(test_cell_shape shape, test_function *f, test_mesh *out)
{
    const int type = get_shape_type(shape);
    const int64_t indices[8] = {0, 1, 2, 3, 4, 5, 6, 7};
    test_mesh_allocate(out, 8, 1, 8);
    for (int i = 0; i < grid_type_vertex_count(type); i++) {
        double p[3];
        compute_shape_vertex(shape, i, p);
        test_mesh_add_vertex(out, p);
    }
    test_mesh_add_cell(out, type, indices, (const int[]){0, 1, 2, 3, 4, 5, 6, 7});
    test_mesh_set_values(out, f);
}
