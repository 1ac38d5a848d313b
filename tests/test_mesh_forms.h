/* A rank's part of a lattice in each of the forms in which callers have meshes, with fields on it. Tests may corrupt
 * the descriptions and arrays, and then make them again. */
#ifndef TEST_MESH_FORMS_H
#define TEST_MESH_FORMS_H

#include "test_owned_faces.h"
#include "test_session_fixture.h"

typedef enum mesh_form {
    MESH_TETS,      /* cells of one type, in arrays of 4-byte elements */
    MESH_HEXES,     /* cells of one type, with offsets and ids of vertices */
    MESH_ROWS,      /* wedges in rows, in the order of DMPlex */
    MESH_MIXED,     /* cells of several types, with ghosts */
    MESH_POLYHEDRA, /* polyhedra by lists of their faces; the caller keeps the arrays */
    MESH_OWNER,     /* polyhedra by owners and neighbours */
    MESH_PAIRS,     /* polyhedra by the two cells of each face, interleaved, in 4-byte elements from index 1 */
    MESH_LISTS,     /* polyhedra by the two cells of each face, with a list of vertices for each face */
    MESH_SHELLS,    /* triangles, quads and polygons */
    MESH_FORM_COUNT
} mesh_form;

const char *mesh_form_name(mesh_form form);

/* Fields: "f" at vertices; "c", vectors in cells, with a patch of the boundary if the form has faces; "d" at corners,
 * if cells have any; "i" at vertices through an index. */
enum { FORMED_F, FORMED_C, FORMED_I, FORMED_D, FORMED_FIELDS };

typedef struct formed_mesh {
    mesh_form form;
    int side, rank, count;
    test_mesh part;
    owned faces;
    insitu_mesh mesh;
    insitu_field fields[FORMED_FIELDS];
    insitu_patch patch;
    float *narrow_coordinates;
    int32_t *narrow_connectivity;
    int64_t *rows, *ids, *index;
    double *cell_values, *corner_values, *patch_values;
} formed_mesh;

void formed_mesh_create(mesh_form form, int side, int rank, int count, formed_mesh *out);
void formed_mesh_free(formed_mesh *m);
/* Makes the arrays and their descriptions again, correct. */
void formed_mesh_restore(formed_mesh *m);
/* Sets the fields' numbers of values to the numbers of vertices, cells and corners in the mesh's description. */
void formed_mesh_resize_fields(formed_mesh *m);

bool formed_mesh_has_corners(mesh_form form);

/* Passes the mesh "m" and its fields to the session, including those at corners if with_corners. Returns the first
 * status that is not OK. */
insitu_status formed_mesh_submit(insitu_session *session, const formed_mesh *m, bool with_corners);

/* Scenes with pictures of all kinds of layers on "m", one scene with the field at corners. */
extern const char formed_scene[], formed_corner_scene[];
enum { FORMED_PICTURES = 6, FORMED_CORNER_PICTURES = 2 };

#endif
