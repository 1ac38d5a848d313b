/* The functions of a Catalyst implementation, written against a table of Conduit's functions so that they can be tested
 * without Catalyst. There is one session per process, because Catalyst loads one implementation per process. */
#ifndef CATALYST_ADAPTOR_H
#define CATALYST_ADAPTOR_H

#include "insitu/blueprint.h"

/* Functions that write values into a Conduit node. */
typedef struct catalyst_writer {
    void (*set_string)(void *node, const char *path, const char *value);
    void (*set_integer)(void *node, const char *path, int64_t value);
    void (*set_real)(void *node, const char *path, double value);
} catalyst_writer;

/* Opens the session that the node of catalyst_initialize() describes. Collective. */
insitu_status catalyst_adaptor_initialize(const insitu_conduit *conduit, const void *params);

/* Performs a step with the channels in the node of catalyst_execute(). Collective; returns the same status on all
 * ranks. */
insitu_status catalyst_adaptor_execute(const void *params);

/* Closes the session. Collective. */
insitu_status catalyst_adaptor_finalize(void);

/* Writes the report of the last step, and the values of the parameters that the node of catalyst_initialize()
 * requested. Local. */
void catalyst_adaptor_write_results(const catalyst_writer *writer, void *node);

void catalyst_adaptor_write_about(const catalyst_writer *writer, void *node);

#endif
