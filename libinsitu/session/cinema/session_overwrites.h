/* Finds pictures that overwrite earlier pictures of the same run. A scene whose outputs have equal paths is refused
 * when it is read. This module finds paths that become equal only during the run: a path without {cycle} that is used
 * in several steps, or paths that are equal after their placeholders are replaced. Only paths are compared, so that the
 * result is the same on all ranks. */
#ifndef SESSION_OVERWRITES_H
#define SESSION_OVERWRITES_H

#include "scene.h"
#include "session_report.h"

/* The file to which an output has written its most recent picture, and the output and the cycle that have written this
 * file most recently. The output is another one if it has overwritten the picture. */
typedef struct session_written {
    uint64_t file; /* hash of the file's path; 0: no picture has been written yet */
    long long cycle;
    int output;
} session_written;

typedef struct session_overwrites {
    int count;                   /* number of outputs of the scene, over all views, isovalues and fields */
    session_written *last_files; /* for each output, the file of its most recent picture */
} session_overwrites;

/* Records the files that the image with this index has written at this cycle and time. If a path was already used for
 * the last picture of another output, or of this output at another cycle, a warning is added, once per image. If memory
 * runs out, nothing is recorded. Local. */
void session_record_written_files(session_overwrites *overwrites, const scene *scene, int image, long long cycle,
                                  double time, session_report *report);

void session_overwrites_free(session_overwrites *overwrites);

#endif
