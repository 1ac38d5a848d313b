/* Processes the events of a step: the statistics that are written to files, and the conditions of images that are drawn
 * only if a statistic lies between given bounds. */
#ifndef SESSION_EVENTS_H
#define SESSION_EVENTS_H

#include "session_catalogue.h"
#include "session_report.h"
#include "session_space.h"
#include "session_statistics.h"
#include "session_statistics_file.h"

/* State of the session over its steps. Each set has one bit for each of the statistics or images of the scene file, of
 * which there are at most 64 each. All variants of an image share one bit. */
typedef struct session_events {
    /* statistics for which a line has been written since the session began or the run last went back in time */
    uint64_t begun_files;
    /* For each of the statistics: the file's lines of this cycle and of later ones are removed before its next line is
     * written. It is the lowest of the cycles with which the session began, or to which the run went back, after the
     * file's last line. Unused if the statistics are in begun_files. */
    int64_t first_cycles[SCENE_MAX_STATISTICS];
    /* has_cycle: set after the first step; last_cycle: cycle of the last step, whether or not anything was due */
    bool has_cycle;
    int64_t last_cycle;
    uint64_t held_conditions; /* images whose condition holds in this step */
    uint64_t drawn_images;    /* images that have been drawn by this session */
} session_events;

/* One bit for each of the statistics and images of the scene file. The bit is set unless the field of the statistics,
 * or of the image's condition, does not exist or has an error in this step (session_check_event_fields()). */
typedef struct session_valid_events {
    uint64_t statistics, images;
} session_valid_events;

/* Records the cycle of a step. Must be called in every step, because a run may go back in time to a cycle in which no
 * statistics are due. A step that repeats the last cycle also counts as going back. Local. */
void session_record_cycle(session_events *events, int64_t cycle);

/* Returns whether the step needs statistics. images: true if the step may draw images, so that statistics for their
 * conditions are needed. Local. */
bool session_are_any_statistics_needed(const scene *scene, int64_t cycle, bool images);
bool session_are_statistics_due(const scene_statistics *statistics, int64_t cycle);

/* Calls the fill functions of the fields that the events in `valid` use and of the source fields that are marked, and
 * copies values that have an index. Invalid values are an error, which is also stored in session_field.problem; the
 * other fields are still read. `valid` must be the same on all ranks. Collective. */
insitu_status session_read_event_fields(const scene *scene, session_meshes *meshes, const session_catalogue *catalogue,
                                        const session_team *team, int64_t cycle, const session_valid_events *valid,
                                        base_error *error);

/* Computes the statistics that are due and writes them to their files. Also computes the statistics on which images'
 * conditions depend, and stores which conditions hold. Only the events in `valid`, whose fields have been read, are
 * processed. Warns of those that count no cell, unless no cell is drawn at all. If an event fails, the other events are
 * still processed, and the error is returned afterwards. Collective. */
insitu_status session_process_statistics_of_step(session_events *events, const scene *scene, session_meshes *meshes,
                                                 const session_catalogue *catalogue, const session_extent *extent,
                                                 const session_team *team, const session_event_time *now,
                                                 const session_valid_events *valid, session_report *report,
                                                 base_error *error);

/* Returns the images that may be drawn in this step, one bit for each. An image may be drawn if its condition holds,
 * unless the scene draws it only once and it has been drawn before. */
uint64_t session_find_drawable_images(const session_events *events, const scene *scene);

#endif
