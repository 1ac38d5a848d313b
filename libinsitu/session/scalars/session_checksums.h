/* Determines whether a field's values have changed. */
#ifndef SESSION_CHECKSUMS_H
#define SESSION_CHECKSUMS_H

#include "session_mesh.h"
#include "session_report.h"

/* For every scalar that an image of this step uses and that was set anew: compares a checksum of its values with that
 * of the last picture, and if they differ marks everything that depends on them as stale. A checksum has 64 bits and
 * costs one read of the values, at the speed of memory. For other scalars a few values are sampled: if these have
 * changed all the same, the scalar is treated as set anew, with a warning. Parallel. Local. */
void session_compare_checksums(const session_meshes *meshes, int threads, session_report *report);

#endif
