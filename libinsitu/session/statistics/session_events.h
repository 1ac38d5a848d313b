/* Finds what is due in a step by values: the scene's statistics, and images that wait for a field to cross a bound. */
#ifndef SESSION_EVENTS_H
#define SESSION_EVENTS_H

#include "session_catalogue.h"
#include "session_statistics.h"

typedef struct session_event_time {
    int64_t cycle;
    double time;
} session_event_time;

/* A session's knowledge of past steps and this one: a bit for each of the statistics or images of the scene's file,
 * which the schema lets be no more than 64 each. All variants of an image have one bit. */
typedef struct session_events {
    uint64_t begun; /* statistics whose file has a line of this session's */
    uint64_t held;  /* images whose condition holds in this step */
    uint64_t drawn; /* images that were drawn */
} session_events;

/* What of the scene can be found in a step: a bit for each, as above. */
typedef struct session_sound_events {
    uint64_t statistics, images;
} session_sound_events;

/* Tells whether the step wants statistics. images: it may draw some, if conditions hold. Local. */
bool session_has_events(const scene *scene, int64_t cycle, bool images);
bool session_is_statistics_due(const scene_statistics *statistics, int64_t cycle);

/* Find the statistics that are due and those that images wait for, write the former, and note which conditions hold;
 * only those that are sound, the same on all ranks. An error is told when all of them are done. Collective. */
insitu_status session_update_events(session_events *events, const scene *scene, session_meshes *meshes,
                                    const session_catalogue *catalogue, const session_team *team,
                                    const session_event_time *now, const session_sound_events *sound,
                                    base_error *error);

/* The images that are let through: their condition holds, and where they are wanted `once` they were not drawn. */
uint64_t session_let_images(const session_events *events, const scene *scene);

#endif
