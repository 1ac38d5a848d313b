/* The smallest user: a session on a scene that does not exist is refused with a message, and nobody dies. */
#include <stdio.h>
#include <string.h>

#include <insitu/insitu.h>

int main(int argc, char **argv)
{
    MPI_Init(&argc, &argv);
    insitu_mesh mesh;
    insitu_mesh_defaults(&mesh);
    insitu_session *session = NULL;
    const insitu_status status = insitu_create(MPI_COMM_WORLD, "there-is-no-such-scene.yaml", &session);
    const int well = status == INSITU_ERROR_SCENE && !session && strstr(insitu_error(NULL), "there-is-no-such-scene") &&
                     mesh.changed == INSITU_CHANGED_ALL;
    if (!well) fprintf(stderr, "%s: %s\n", insitu_status_name(status), insitu_error(NULL));
    MPI_Finalize();
    return well ? 0 : 1;
}
