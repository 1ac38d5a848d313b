/* Declares functions that draw meshes that the scene warps or mirrors, compare the pictures with those of meshes that
 * are given in their final form, and make planes, lattices and blocks for these tests. */
#ifndef TEST_TRANSFORMED_H
#define TEST_TRANSFORMED_H

#include "test_mesh_forms.h"

/* Computes the position of a vertex from the mesh's description: from coordinates of each vertex, or from those along
 * the axes of a lattice with packed strides. */
void compute_vertex_position(const insitu_mesh *mesh, int64_t vertex, double out[3]);

/* The data of copy_filled_values(), a fill function that all ranks must call. `calls` counts only the calls that all
 * ranks made together. */
typedef struct filled_values {
    insitu_array values;
    int64_t count;
    int calls;
} filled_values;

insitu_status copy_filled_values(void *filled, insitu_field *field);

/* Checks that both drawings have bit-identical pictures that are not empty, and frees the drawings. */
void expect_same(drawn *a, drawn *b, const char *what);

/* Opens a session with the text `before` followed by the scene. */
insitu_session *open_session_from_texts(MPI_Comm comm, const char *before, const char *scene);

#define LAYERS(name, layers)                                                                                           \
    "  - name: " name "\n    size: [24, 18]\n    layers: " layers "\n    outputs: [{path: " name ".exr}]\n"

/* Scenes with all layers of "f", and with surfaces only. Pictures of surfaces are bit-identical on any number of
 * ranks. */
extern const char all_layers[], surface_layers[];

/* Draws "f" on one mesh in one step, and destroys the session. `u` is a further field, or NULL. */
drawn draw_mesh(insitu_session *session, const insitu_mesh *mesh, const insitu_field *f, const insitu_field *u);

/* Draws the formed mesh `m`, described by `mesh` instead of its own description, in one step, and destroys the
 * session. */
drawn draw_formed(insitu_session *session, const formed_mesh *m, const insitu_mesh *mesh, bool with_corners,
                  const insitu_field *u);

/* This rank's 3 × 3 quads in the plane z = 0, with float or double coordinates. */
typedef struct plane {
    double wide[16][2], values[16];
    float narrow[16][2];
    int32_t quads[9][4];
    insitu_mesh mesh;
    insitu_field field;
} plane;

void make_plane(bool is_wide, plane *out);

typedef enum lattice_form { UNIFORM, RECTILINEAR, CURVILINEAR, QUADS, LATTICE_FORMS } lattice_form;

const char *lattice_form_name(lattice_form form);

enum { ACROSS = 4, THICK = 2, MOST_VERTICES = 5 * 5 * 3 + 6 };

typedef struct block {
    float axes[3][8];
    double places[3][MOST_VERTICES], values[MOST_VERTICES];
    insitu_lattice lattice;
    insitu_mesh mesh;
    insitu_field field;
} block;

/* Makes the block with this number. Consecutive blocks are stacked along z, or along y if they consist of quads.
 * Curvilinear blocks have padding along x. */
void make_block(lattice_form form, int number, block *out);

#endif
