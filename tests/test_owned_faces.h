/* A mesh's faces by owner and neighbour, in the forms used by finite-volume codes. */
#ifndef TEST_OWNED_FACES_H
#define TEST_OWNED_FACES_H

#include "insitu/insitu.h"
#include "test_meshes.h"

/* A face in the form of OpenFOAM's lists. */
typedef struct label_list {
    int32_t size;
    int32_t *labels;
} label_list;

/* Faces in the order of finite-volume codes, inner ones first. Besides the arrays of 8 bytes there are arrays of 4
 * bytes with indices that start at base, pairs of owner and neighbour, and lists. */
typedef struct owned {
    int64_t inner, faces;
    int64_t *owner, *neighbour, *offsets, *vertices;
    int32_t *pairs, *narrow_offsets, *narrow_vertices;
    label_list *lists;
    /* the faces from here on are in a separate list; those between inner and middle have a halo cell as owner or
     * neighbour */
    int64_t middle;
    int32_t *halo_pairs, *apart_offsets, *apart_owner;
} owned;

enum { OWNED_HALO = 5 }; /* number of halo cells */

/* Makes the faces of a part that consists of polyhedra only. Indices in arrays of 4 bytes start at base. */
owned make_owned(const test_mesh *part, int32_t base);
void free_owned(owned *o);

/* FORM_WIDE: 8 bytes, indices from 0, neighbours for inner faces only. FORM_PAIRS: 4 bytes, indices from base, owner
 * and neighbour alternating, for all faces; -1, or base - 1, on the boundary. FORM_LISTS: as FORM_PAIRS with a list of
 * vertices for each face. FORM_APART: as in code_saturne, with the boundary's faces in a separate list, and halo
 * cells. */
typedef enum form { FORM_WIDE, FORM_PAIRS, FORM_LISTS, FORM_APART, FORM_COUNT } form;

/* Describes the faces in this form, in place of the cells' connectivity. */
void describe_owned(const owned *o, form which, int base, insitu_mesh *mesh);

#endif
