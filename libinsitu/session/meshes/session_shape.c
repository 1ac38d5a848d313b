#include "session_shape.h"

#include "grid.h"

static const session_shape triangle = {
    GRID_TRIANGLE, 3, 3, 1, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1}, {1, 2}, {2, 0}}, {{0, 1, 2, -1}}};
static const session_shape quad = {
    GRID_QUAD, 4, 4, 1, {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1}, {1, 2}, {2, 3}, {3, 0}}, {{0, 1, 2, 3}}};
static const session_shape tet = {GRID_TET,
                                  4,
                                  6,
                                  4,
                                  {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                                  {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}},
                                  {{0, 1, 3, -1}, {1, 2, 3, -1}, {2, 0, 3, -1}, {0, 2, 1, -1}}};
static const session_shape pyramid = {GRID_PYRAMID,
                                      5,
                                      8,
                                      5,
                                      {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}},
                                      {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {0, 4}, {1, 4}, {2, 4}, {3, 4}},
                                      {{0, 3, 2, 1}, {0, 1, 4, -1}, {1, 2, 4, -1}, {2, 3, 4, -1}, {3, 0, 4, -1}}};
static const session_shape wedge = {GRID_WEDGE,
                                    6,
                                    9,
                                    5,
                                    {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}},
                                    {{0, 1}, {1, 2}, {2, 0}, {3, 4}, {4, 5}, {5, 3}, {0, 3}, {1, 4}, {2, 5}},
                                    {{0, 1, 2, -1}, {3, 5, 4, -1}, {0, 3, 4, 1}, {1, 4, 5, 2}, {2, 5, 3, 0}}};
static const session_shape hex = {
    GRID_HEX,
    8,
    12,
    6,
    {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}},
    {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6}, {6, 7}, {7, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}},
    {{0, 4, 7, 3}, {1, 2, 6, 5}, {0, 1, 5, 4}, {3, 7, 6, 2}, {0, 3, 2, 1}, {4, 5, 6, 7}}};

const session_shape *session_get_cell_shape(int type)
{
    switch (type) {
    case GRID_TRIANGLE: return &triangle;
    case GRID_QUAD: return &quad;
    case GRID_TET: return &tet;
    case GRID_PYRAMID: return &pyramid;
    case GRID_WEDGE: return &wedge;
    default: return &hex;
    }
}

void session_find_face_plane(const session_shape *shape, int face, int out[3])
{
    const signed char *corners = shape->faces[face];
    int a[3], b[3];
    for (int axis = 0; axis < 3; axis++) {
        const int begin = shape->corners[(int)corners[0]][axis];
        a[axis] = shape->corners[(int)corners[1]][axis] - begin;
        b[axis] = shape->corners[(int)corners[2]][axis] - begin;
    }
    for (int axis = 0; axis < 3; axis++)
        out[axis] = a[(axis + 1) % 3] * b[(axis + 2) % 3] - a[(axis + 2) % 3] * b[(axis + 1) % 3];
}

unsigned session_faces_of_node(const session_shape *shape, int order, const int node[3])
{
    unsigned faces = 0;
    for (int f = 0; f < shape->face_count; f++) {
        const signed char *corner = shape->corners[(int)shape->faces[f][0]];
        int plane[3], height = 0;
        session_find_face_plane(shape, f, plane);
        for (int axis = 0; axis < 3; axis++) height += plane[axis] * (node[axis] - corner[axis] * order);
        if (height == 0) faces |= 1U << f;
    }
    return faces;
}
