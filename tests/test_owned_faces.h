/* Describes the cells of a mesh by its faces, each with an owner and a neighbour, in the forms that finite-volume codes
 * use. */
#ifndef TEST_OWNED_FACES_H
#define TEST_OWNED_FACES_H

#include "insitu/insitu.h"
#include "test_meshes.h"

/* The vertices of a face, in the form of OpenFOAM's lists. */
typedef struct label_list {
    int32_t size;
    int32_t *labels;
} label_list;

/* Faces in the order of finite-volume codes: inner faces first. Arrays of 8-byte elements have indices from 0. Arrays
 * of 4-byte elements have indices from base: pairs of owner and neighbour, and lists of vertices. */
typedef struct owned {
    int64_t inner, faces;
    int64_t *owner, *neighbour, *offsets, *vertices;
    int32_t *pairs, *narrow_offsets, *narrow_vertices;
    label_list *lists;
    /* Faces from `middle` on are in a separate list (FORM_APART); faces between `inner` and `middle` have a halo cell
     * as owner or neighbour. */
    int64_t middle;
    int32_t *halo_pairs, *apart_offsets, *apart_owner;
} owned;

enum { OWNED_HALO = 5 }; /* number of halo cells */

/* Makes the faces of a part that consists only of polyhedra. Indices in 4-byte arrays begin at base. */
owned make_owned_faces(const test_mesh *part, int32_t base);
void free_owned_faces(owned *o);

/* FORM_WIDE: 8-byte elements, indices from 0, neighbours for inner faces only. FORM_PAIRS: 4-byte elements, indices
 * from base, owner and neighbour alternating, for all faces; the neighbour is base - 1 at the boundary. FORM_LISTS:
 * like FORM_PAIRS, with a list of vertices for each face. FORM_APART: like code_saturne, with boundary faces in a
 * separate list, and with halo cells. */
typedef enum form { FORM_WIDE, FORM_PAIRS, FORM_LISTS, FORM_APART, FORM_COUNT } form;

/* Describes the mesh by its faces in the given form. The faces replace the cells' connectivity. */
void describe_owned_faces(const owned *o, form which, int base, insitu_mesh *mesh);

#endif
