/* A rank's part of a lattice in each of the forms in which callers have meshes, with fields on it. Descriptions and
 * arrays may be spoilt, and are made again. */
#ifndef TEST_MESH_FORMS_H
#define TEST_MESH_FORMS_H

#include "test_owned_faces.h"
#include "test_session_fixture.h"

typedef enum mesh_form {
    MESH_TETS,      /* of one type, in arrays of 4 bytes */
    MESH_HEXES,     /* of one type, with offsets, by ids of vertices */
    MESH_ROWS,      /* wedges in rows, in DMPlex's order */
    MESH_MIXED,     /* of several types, with ghosts */
    MESH_POLYHEDRA, /* by lists of their faces, which are kept */
    MESH_OWNER,     /* polyhedra by owners and neighbours */
    MESH_PAIRS,     /* the same, in turn, of 4 bytes, from index 1 */
    MESH_LISTS,     /* the same, with a list of vertices for each face */
    MESH_SHELLS,    /* triangles, quads and polygons */
    MESH_FORM_COUNT
} mesh_form;

const char *mesh_form_name(mesh_form form);

/* "f" at vertices; "c", vectors in cells, with a patch of the boundary where the form has faces; "d" at corners, where
 * cells have some; "i" at vertices by an index. */
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

void formed_create(mesh_form form, int side, int rank, int count, formed_mesh *out);
void formed_free(formed_mesh *m);
/* Makes the arrays and their descriptions again. */
void formed_renew(formed_mesh *m);
/* Gives fields as many values as the mesh has vertices, cells and corners by its description. */
void formed_fit_fields(formed_mesh *m);

bool formed_has_corners(mesh_form form);

/* Hands the mesh "m" and its fields over, those at corners if with_corners. Returns the first status that is not OK. */
insitu_status formed_submit(insitu_session *session, const formed_mesh *m, bool with_corners);

/* Scenes of pictures of all layers on "m", one of them with the field at corners. */
extern const char formed_scene[], formed_corner_scene[];
enum { FORMED_PICTURES = 6, FORMED_CORNER_PICTURES = 2 };

#endif
