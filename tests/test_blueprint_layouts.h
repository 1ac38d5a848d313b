/* Small meshes as Mesh Blueprint nodes, in the layouts of Conduit's generator of examples. Each comes with the same
 * mesh described by the public header. The fields braid and vel are at vertices, and radial is at elements. On rank r,
 * a lattice is the block that begins at x = 20 r, and an unstructured mesh is the rank's part of a test_mesh. */
#ifndef TEST_BLUEPRINT_LAYOUTS_H
#define TEST_BLUEPRINT_LAYOUTS_H

#include "conduit_stand_in.h"
#include "test_session_fixture.h"

enum { LAYOUT_ARRAYS = 64, LAYOUT_SIDE = 3 };

/* A node and the same mesh described by the public header. */
typedef struct layout_case {
    conduit_node *node;
    insitu_mesh mesh;
    insitu_lattice lattice;
    insitu_field fields[3];
    int field_count;
    void *arrays[LAYOUT_ARRAYS];
    int array_count;
} layout_case;

typedef void layout_function(layout_case *out);

typedef struct layout_kind {
    const char *name;
    layout_function *make;
    /* whether the adaptor must copy arrays, because the public header cannot describe those of the node */
    bool is_copied;
} layout_kind;

extern const layout_kind layout_kinds[];
extern const int layout_kind_count;

void layout_make(const layout_kind *kind, layout_case *out);
void layout_free(layout_case *layout);

/* Passes the mesh of the public header and its fields to the session. */
insitu_status layout_submit(insitu_session *session, const char *name, const layout_case *layout);

#endif
