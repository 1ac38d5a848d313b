/* Determines whether a field's values have changed. */
#ifndef SESSION_CHECKSUMS_H
#define SESSION_CHECKSUMS_H

#include "session_mesh.h"
#include "session_report.h"

/* Compares a checksum of the values with the checksum at the most recently drawn picture. This is done for every scalar
 * that an image of this step uses, if the caller has set its field since that picture without declaring the values
 * unchanged. If the checksums differ, everything that depends on the values is marked as stale. A checksum has 64 bits
 * and requires reading the values once, at the speed of memory. For all other scalars only a few values are sampled. If
 * these have changed although the caller declared them unchanged, the scalar is treated as if its field was set again,
 * and a warning is added. Parallel. Local. */
void session_find_changed_values(const session_meshes *meshes, int threads, session_report *report);

#endif
