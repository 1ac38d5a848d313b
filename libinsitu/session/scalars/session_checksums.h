/* Finds whether a field's values have changed, as the caller says. */
#ifndef SESSION_CHECKSUMS_H
#define SESSION_CHECKSUMS_H

#include "session_mesh.h"
#include "session_report.h"

/* For every scalar that an image of this step uses and that was set anew: compare a checksum of its values with that of
 * the last picture, and mark what depends on them as stale where they differ. It has 64 bits, and costs reading the
 * values once, at the speed of memory. Of other scalars a few values are looked at: if these have changed all the same,
 * the scalar is treated as set anew, with a warning. Parallel. Local. */
void session_compare_checksums(const session_meshes *meshes, int threads, session_report *report);

#endif
