/* The scene of a session: read from a file, and again where that is edited, or given as text. */
#ifndef SESSION_SCENE_FILE_H
#define SESSION_SCENE_FILE_H

#include <sys/stat.h>

#include "scene.h"
#include "session_team.h"

typedef struct session_scene_file {
    char *path;     /* the same on every rank; SESSION_SCENE_TEXT of a scene given as text */
    bool is_text;   /* rank 0: there is no file to be edited */
    scene scene;    /* the same on every rank */
    char *warning;  /* NULL, or why the last edit of the file was not taken */
    bool has_stamp; /* rank 0 */
    struct stat stamp;
} session_scene_file;

/* The name of a scene given as text in messages, in place of a file's path. */
#define SESSION_SCENE_TEXT "scene text"

/* Where a scene comes from. Rank 0's counts. */
typedef struct session_scene_source {
    const char *call; /* the public call, for messages */
    const char *path; /* the file's path; NULL if text is given, or nothing */
    const char *text; /* YAML; NULL where a path is given, or nothing is */
} session_scene_source;

/* Read the scene for the first time. *file is empty before, and to be freed whatever happens. Collective. */
insitu_status session_load_scene(session_scene_file *file, const session_team *team, const session_scene_source *source,
                                 base_error *error);

/* Was the file edited since it was read? False on ranks other than 0, and where there is no file. Local. */
bool session_is_scene_edited(const session_scene_file *file, int rank);

/* Read the file again. False: it keeps the old scene, and warning says why. Collective. */
bool session_reload_scene(session_scene_file *file, const session_team *team);

void session_scene_file_free(session_scene_file *file);

#endif
