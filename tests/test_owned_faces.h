/* A mesh's faces by owner and neighbour, in the forms that codes of finite volumes have them in. */
#ifndef TEST_OWNED_FACES_H
#define TEST_OWNED_FACES_H

#include "insitu/insitu.h"
#include "test_meshes.h"

/* A face as OpenFOAM's lists have it. */
typedef struct label_list {
    int32_t size;
    int32_t *labels;
} label_list;

/* Faces in the order of finite-volume codes, inner ones first. Besides the arrays of 8 bytes there are those of 4 bytes
 * that count from base, pairs of owner and neighbour, and lists. */
typedef struct owned {
    int64_t inner, faces;
    int64_t *owner, *neighbour, *offsets, *vertices;
    int32_t *pairs, *narrow_offsets, *narrow_vertices;
    label_list *lists;
    int64_t middle; /* the faces from here on are in a list of their own; those between inner and middle have a cell of
                       a halo beyond, as owner or neighbour */
    int32_t *halo_pairs, *apart_offsets, *apart_owner;
} owned;

enum { OWNED_HALO = 5 }; /* cells of the halo */

/* The arrays of 4 bytes count from base. The part is of polyhedra alone. */
owned make_owned(const test_mesh *part, int32_t base);
void free_owned(owned *o);

/* FORM_WIDE: 8 bytes, from 0, neighbours for inner faces only. FORM_PAIRS: 4 bytes, from base, owners and neighbours in
 * turn, for all faces; -1, or base - 1, on the boundary. FORM_LISTS: the same with a list of vertices for each face.
 * FORM_APART: as code_saturne has them, the boundary's faces in a list of their own, and cells of a halo. */
typedef enum form { FORM_WIDE, FORM_PAIRS, FORM_LISTS, FORM_APART, FORM_COUNT } form;

/* Describe the faces so, in place of the cells' connectivity. */
void describe_owned(const owned *o, form which, int base, insitu_mesh *mesh);

#endif
