/* A rank's part of a lattice, described in each of the forms in which simulations may pass meshes, with fields. Tests
 * may corrupt the descriptions and arrays, and restore them by formed_mesh_restore(). */
#ifndef TEST_MESH_FORMS_H
#define TEST_MESH_FORMS_H

#include "test_owned_faces.h"
#include "test_session_fixture.h"

typedef enum mesh_form {
    MESH_TETS,      /* cells of one type, in arrays of 4-byte elements */
    MESH_HEXES,     /* cells of one type, with offsets and ids of vertices */
    MESH_ROWS,      /* wedges whose connectivity is stored in longer rows, in the vertex order of DMPlex */
    MESH_MIXED,     /* cells of several types, with ghosts */
    MESH_POLYHEDRA, /* polyhedra as lists of their faces; the caller keeps the arrays */
    MESH_OWNER,     /* polyhedra as faces with owners and neighbours, in the order of owners */
    MESH_PAIRS,     /* polyhedra as faces with pairs of cells, interleaved, in 4-byte elements with indices from 1 */
    MESH_LISTS,     /* polyhedra as faces with two arrays of cells, and a list of vertices for each face */
    MESH_SHELLS,    /* triangles, quads and polygons */
    MESH_FORM_COUNT
} mesh_form;

const char *mesh_form_name(mesh_form form);

/* Indices of the fields. FORMED_F: "f" at vertices; FORMED_C: "c", vectors in cells, with a patch of boundary values if
 * the form has faces; FORMED_I: "i" at vertices, through an index; FORMED_D: "d" at corners of cells, if the form has
 * them. */
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
/* Makes all arrays and their descriptions anew. */
void formed_mesh_restore(formed_mesh *m);
/* Sets the numbers of values of the fields to the numbers of vertices, cells and corners in the mesh's description. */
void formed_mesh_resize_fields(formed_mesh *m);

bool formed_mesh_has_corners(mesh_form form);

/* Passes the mesh "m" and its fields to the session, including the field at corners if with_corners is set. Returns the
 * first status that is not OK. */
insitu_status formed_mesh_submit(insitu_session *session, const formed_mesh *m, bool with_corners);

/* Scenes with images that show all kinds of layers of "m"; formed_corner_scene shows the field at corners. */
extern const char formed_scene[], formed_corner_scene[];
enum { FORMED_PICTURES = 6, FORMED_CORNER_PICTURES = 2 };

#endif
