#include "test_blueprint_door.h"

#include "conduit_stand_in.h"
#include "insitu/conduit.h"
#include "test_session_fixture.h"

doorway open_adaptor_session(const char *path)
{
    doorway d = {open_session(MPI_COMM_WORLD, path), NULL};
    everywhere(insitu_blueprint_create(d.session, &insitu_conduit_functions, MPI_COMM_WORLD, &d.adaptor) == INSITU_OK);
    return d;
}

void close_adaptor_session(doorway *d)
{
    insitu_blueprint_destroy(&d->adaptor);
    everywhere(insitu_destroy(&d->session) == INSITU_OK);
}
