// The smallest user in C++, with the C++ library of MPI nowhere in sight: insitu.h and insitu::insitu alone.
#include <insitu/insitu.h>

#include <cstdio>
#include <cstring>

int main(int argc, char **argv)
{
    MPI_Init(&argc, &argv);
    insitu_session *session = nullptr;
    const insitu_status status = insitu_create(MPI_COMM_WORLD, "there-is-no-such-scene.yaml", &session);
    const bool well = status == INSITU_ERROR_SCENE && !session && std::strstr(insitu_error(nullptr), "no-such-scene");
    if (!well) std::fprintf(stderr, "%s: %s\n", insitu_status_name(status), insitu_error(nullptr));
    MPI_Finalize();
    return well ? 0 : 1;
}
