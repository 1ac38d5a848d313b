/* The scene's parameters, as the simulation reads them. */
#ifndef SESSION_PARAMETERS_H
#define SESSION_PARAMETERS_H

#include "session_report.h"
#include "session_scene_file.h"

enum { SESSION_MOST_ASKED = 256 };

/* Names that the code has asked for on this rank. */
typedef struct session_asked {
    int count; /* beyond SESSION_MOST_ASKED they are not noted, and no parameter counts as forgotten */
    uint64_t names[SESSION_MOST_ASKED]; /* hashes */
} session_asked;

/* Find a parameter, and note that it was asked for. On an error *value stays. Local. */
insitu_status session_read_parameter(const session_scene_file *file, session_asked *asked, const char *name,
                                     double *value, base_error *error);

/* Warn of parameters that were never asked for on this rank. Local. */
void session_warn_of_parameters(const scene *scene, const session_asked *asked, session_report *report);

#endif
