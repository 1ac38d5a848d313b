/* A session together with a Blueprint adaptor. */
#ifndef TEST_BLUEPRINT_DOOR_H
#define TEST_BLUEPRINT_DOOR_H

#include "insitu/blueprint.h"
#include "insitu/insitu.h"

typedef struct doorway {
    insitu_session *session;
    insitu_blueprint *adaptor;
} doorway;

/* Opens a session with the scene at `path`, and an adaptor of the session. Collective. */
doorway open_adaptor_session(const char *path);
void close_adaptor_session(doorway *d);

#endif
