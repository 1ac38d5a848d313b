/* Meshes that the scene warps or mirrors: their pictures, beside those of meshes that are handed over as they are to be
 * drawn. Planes, lattices and blocks to do that with. */
#ifndef TEST_TRANSFORMED_H
#define TEST_TRANSFORMED_H

#include "test_mesh_forms.h"

/* The place of a vertex by the description: by vertex, or along the axes of a lattice with packed strides. */
void place_of(const insitu_mesh *mesh, int64_t vertex, double out[3]);

/* The data of give_values(), a fill function, which all ranks must call. calls: how often all did. */
typedef struct filled_values {
    insitu_array values;
    int64_t count;
    int calls;
} filled_values;

insitu_status give_values(void *filled, insitu_field *field);

/* Compares, frees both, and tells where pictures of nothing were compared. */
void expect_same(drawn *a, drawn *b, const char *what);

/* A session of the text `before` and the scene. */
insitu_session *open_text(MPI_Comm comm, const char *before, const char *scene);

#define LAYERS(name, layers)                                                                                           \
    "  - name: " name "\n    size: [24, 18]\n    layers: " layers "\n    outputs: [{path: " name ".exr}]\n"

/* Scenes of all layers of "f", and of surfaces alone, which are the same to the bit on any ranks. */
extern const char all_layers[], surface_layers[];

/* Draws "f" on one mesh in one step, and destroys the session. u: NULL, or a further field. */
drawn draw_mesh(insitu_session *session, const insitu_mesh *mesh, const insitu_field *f, const insitu_field *u);

/* As above, of a formed mesh with another description. */
drawn draw_formed(insitu_session *session, const formed_mesh *m, const insitu_mesh *mesh, bool with_corners,
                  const insitu_field *u);

/* This rank's rows of quads, of 3 x 3 each, in the plane z = 0, of floats or doubles. */
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

/* The block of this number among all ranks', along z; of quads along y. Curvilinear ones have padding along x. */
void make_block(lattice_form form, int number, block *out);

#endif
