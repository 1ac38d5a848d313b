/* Small meshes as nodes of the Mesh Blueprint, in the layouts of Conduit's generator of examples, each with the same
 * mesh in the public header's form. The fields braid and vel are at vertices, radial is at elements. Rank r has the
 * block that begins at x = 20 r, or its part of a test_mesh. */
#ifndef TEST_BLUEPRINT_LAYOUTS_H
#define TEST_BLUEPRINT_LAYOUTS_H

#include "conduit_stand_in.h"
#include "test_session_fixture.h"

enum { LAYOUT_ARRAYS = 64, LAYOUT_SIDE = 3 };

/* A node and the same mesh in the public header's form. */
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
    bool is_copied; /* the adaptor must copy something, because the header cannot describe the node's arrays */
} layout_kind;

extern const layout_kind layout_kinds[];
extern const int layout_kind_count;

void layout_make(const layout_kind *kind, layout_case *out);
void layout_free(layout_case *layout);

/* Passes the mesh and its fields to the session by the public header. */
insitu_status layout_submit(insitu_session *session, const char *name, const layout_case *layout);

#endif
