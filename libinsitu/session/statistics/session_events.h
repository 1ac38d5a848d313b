/* Computes what depends on values in a step: the statistics that are due, and the conditions of images that are drawn
 * when a field crosses a bound. */
#ifndef SESSION_EVENTS_H
#define SESSION_EVENTS_H

#include "session_catalogue.h"
#include "session_statistics.h"

typedef struct session_event_time {
    int64_t cycle;
    double time;
} session_event_time;

/* State of a session's past steps and of this one: a bit for each of the statistics or images of the scene's file, at
 * most 64 of each by the schema. All variants of an image have one bit. */
typedef struct session_events {
    uint64_t begun; /* statistics to whose file this session has written a line */
    uint64_t held;  /* images whose condition holds in this step */
    uint64_t drawn; /* images that were drawn */
} session_events;

/* The statistics and images of the scene that can be computed in a step: a bit for each, as above. */
typedef struct session_sound_events {
    uint64_t statistics, images;
} session_sound_events;

/* Returns whether the step needs statistics. images: it may draw images, if their conditions hold. Local. */
bool session_has_events(const scene *scene, int64_t cycle, bool images);
bool session_is_statistics_due(const scene_statistics *statistics, int64_t cycle);

/* Computes the statistics that are due and those of images' conditions, writes the former, and records which conditions
 * hold. Only those in `sound`, the same on all ranks, are treated. An error is returned after all of them are done.
 * Collective. */
insitu_status session_update_events(session_events *events, const scene *scene, session_meshes *meshes,
                                    const session_catalogue *catalogue, const session_team *team,
                                    const session_event_time *now, const session_sound_events *sound,
                                    base_error *error);

/* Returns the images that may be drawn: their condition holds, and they were not drawn before if they have `once`. */
uint64_t session_let_images(const session_events *events, const scene *scene);

#endif
