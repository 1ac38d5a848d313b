/* Pictures that take the place of earlier ones of the same run. A scene whose outputs have one name is refused when it
 * is read; what shows only as the run goes on is found here: a name without {cycle} in several steps, and names that
 * become one. Found by names alone, and so alike on all ranks. */
#ifndef SESSION_OVERWRITES_H
#define SESSION_OVERWRITES_H

#include "scene.h"
#include "session_report.h"

/* The last picture that an output has written. */
typedef struct session_written {
    uint64_t file; /* hash of its name; 0: none yet */
    long long cycle;
} session_written;

typedef struct session_overwrites {
    int count; /* outputs of the scene, those of all views, isovalues and fields */
    session_written *last;
} session_overwrites;

/* Note what the scene's image with this index has written at this cycle and time. Where a name is that of another
 * output's last picture, or of this output's at another cycle, a warning says so, once for an image. Where memory runs
 * out nothing is noted. Local. */
void session_note_written(session_overwrites *overwrites, const scene *scene, int image, long long cycle, double time,
                          session_report *report);

void session_overwrites_free(session_overwrites *overwrites);

#endif
