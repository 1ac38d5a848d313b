/* The scene file of a session, and the scene as it was last read. */
#ifndef SESSION_SCENE_FILE_H
#define SESSION_SCENE_FILE_H

#include <sys/stat.h>

#include "scene.h"
#include "session_team.h"

typedef struct session_scene_file {
    char *path;     /* the same on every rank */
    scene scene;    /* the same on every rank */
    char *warning;  /* NULL, or why the last edit of the file was not taken */
    bool has_stamp; /* rank 0 */
    struct stat stamp;
} session_scene_file;

/* Read the file for the first time. *file is empty before, and to be freed whatever happens. Collective. */
insitu_status session_load_scene(session_scene_file *file, const session_team *team, const char *path,
                                 base_error *error);

/* Was the file edited since it was read? False on ranks other than 0. Local. */
bool session_is_scene_edited(const session_scene_file *file, int rank);

/* Read the file again. False: it keeps the old scene, and warning says why. Collective. */
bool session_reload_scene(session_scene_file *file, const session_team *team);

void session_scene_file_free(session_scene_file *file);

#endif
