/* Defines the parts of a session. The code of each part uses only those parts whose headers it includes, and a function
 * gets as parameters only the parts that it may access. Only the public calls, the step and its first reduction access
 * the whole session. */
#ifndef SESSION_SESSION_H
#define SESSION_SESSION_H

#include "error.h"
#include "insitu/insitu.h"
#include "session_catalogue.h"
#include "session_cinema.h"
#include "session_events.h"
#include "session_mesh.h"
#include "session_montage.h"
#include "session_news.h"
#include "session_overwrites.h"
#include "session_parameters.h"
#include "session_picture.h"
#include "session_report.h"
#include "session_run_ranges.h"
#include "session_scene_file.h"
#include "session_space.h"
#include "session_team.h"
#include "session_threads.h"
#include "session_trees.h"
#include "session_writer.h"

struct insitu_session {
    session_team team;
    session_threads threads;
    session_scene_file scene_file;
    session_requested_names requested_parameters;
    session_meshes meshes;
    session_catalogue catalogue;
    session_space space;
    session_trees trees;
    session_writer writer; /* writes pictures; used on rank 0 only */
    session_kept_pictures kept_pictures;
    session_run_ranges run_ranges;
    session_cinema cinema;     /* databases of pictures; used on rank 0 only */
    session_montages montages; /* files with several pictures side by side; used on rank 0 only */
    session_news news;         /* messages for programs that watch the run; used on rank 0 only */
    session_overwrites overwrites;
    session_events events;
    session_report report;
    bool has_stepped;
    double last_time; /* time of the most recent step */
    base_error error; /* error of the most recent call that has failed since the most recent step began */
};

#endif
