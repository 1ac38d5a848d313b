/* What an implementation of Catalyst's API does, on a table of Conduit's functions, so that it can be tested where
 * there is no Catalyst. There is one session a process, as Catalyst has one implementation. */
#ifndef CATALYST_DOOR_H
#define CATALYST_DOOR_H

#include "insitu/blueprint.h"

/* Writes into nodes. */
typedef struct catalyst_writer {
    void (*set_string)(void *node, const char *path, const char *value);
    void (*set_integer)(void *node, const char *path, int64_t value);
    void (*set_real)(void *node, const char *path, double value);
} catalyst_writer;

/* Opens a session by the node of catalyst_initialize(). Collective. */
insitu_status catalyst_door_initialize(const insitu_conduit *conduit, const void *params);

/* Takes a step with the channels of the node of catalyst_execute(). Collective; the same status on all ranks. */
insitu_status catalyst_door_execute(const void *params);

/* Closes the session. Collective. */
insitu_status catalyst_door_finalize(void);

/* Writes what the last step reported, and the scene's parameters that the node of catalyst_initialize() names. Local.
 */
void catalyst_door_results(const catalyst_writer *writer, void *node);

void catalyst_door_about(const catalyst_writer *writer, void *node);

#endif
