/* A user of a library that was built without the one that writes files: a picture is drawn into memory, and a file that
 * the scene asks for is an error of the step that names the image and what is missing. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <insitu/insitu.h>

static const char words[] = "writing: step\nimages:\n"
                            "  - {name: kept, size: [32, 24], background: [1, 0, 0], layers: [surface: {}]}\n"
                            "  - {name: written, size: [32, 24], every: 2, layers: [surface: {}], "
                            "outputs: [{path: a.png}]}\n";

static int set_tet(insitu_session *session)
{
    static const double corners[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    static const int cell[4] = {0, 1, 2, 3};
    insitu_mesh mesh;
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = 4;
    insitu_mesh_interleaved(&mesh, corners, INSITU_FLOAT64);
    mesh.cell_count = 1;
    mesh.cell_type = INSITU_TET;
    mesh.connectivity_count = 4;
    mesh.connectivity = (insitu_array){.data = cell, .type = INSITU_INT32};
    return insitu_set_mesh(session, "tet", &mesh) == INSITU_OK;
}

/* The tet is in the middle, and the background in the corner. */
static int is_drawn(const insitu_picture *p)
{
    const int middle = 12 * 32 + 16;
    return !strcmp(p->image, "kept") && isinf(p->depth[0]) && isfinite(p->depth[middle]);
}

int main(int argc, char **argv)
{
    int count = 0, well = 1;
    insitu_session *session = NULL;
    MPI_Init(&argc, &argv);
    well = well && insitu_create_from_text(MPI_COMM_WORLD, words, &session) == INSITU_OK && set_tet(session);
    well = well && insitu_keep_pictures(session, 1) == INSITU_OK && insitu_step(session, 1, 0) == INSITU_OK;
    const insitu_picture *pictures = insitu_last_pictures(session, &count);
    well = well && count == 1 && is_drawn(&pictures[0]);
    well = well && insitu_step(session, 2, 0) == INSITU_ERROR_IO && strstr(insitu_error(session), "\"written\"") &&
           strstr(insitu_error(session), "libinsitu_image.so cannot be loaded");
    pictures = insitu_last_pictures(session, &count);
    well = well && count == 2 && is_drawn(&pictures[0]);
    if (!well) fprintf(stderr, "%d pictures; %s\n", count, session ? insitu_error(session) : insitu_error(NULL));
    insitu_destroy(&session);
    MPI_Finalize();
    return well ? 0 : 1;
}
