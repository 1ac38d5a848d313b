/* Lets the simulation read the scene's parameters. */
#ifndef SESSION_PARAMETERS_H
#define SESSION_PARAMETERS_H

#include "session_report.h"
#include "session_scene_file.h"

enum { SESSION_MOST_REQUESTED = 256 };

/* The names of parameters that the simulation has requested on this rank. */
typedef struct session_requested_names {
    /* number of names that were requested. Only the first SESSION_MOST_REQUESTED names are recorded; if there are more,
     * no parameter is reported as unused */
    int count;
    uint64_t names[SESSION_MOST_REQUESTED]; /* hashes of the recorded names */
} session_requested_names;

/* Finds a parameter by its name, and records that it was requested. On an error *value is unchanged. Local. */
insitu_status session_read_parameter(const session_scene_file *file, session_requested_names *requested,
                                     const char *name, double *value, base_error *error);

/* Warns of parameters that were never requested on this rank. Local. */
void session_warn_of_unused_parameters(const scene *scene, const session_requested_names *requested,
                                       session_report *report);

#endif
