/* The scene of a session: read from a file, and again if that is edited, or given as text. */
#ifndef SESSION_SCENE_FILE_H
#define SESSION_SCENE_FILE_H

#include <sys/stat.h>

#include "scene.h"
#include "session_team.h"

typedef struct session_scene_file {
    char *path;     /* the same on every rank; SESSION_SCENE_TEXT for a scene given as text */
    bool is_text;   /* on rank 0: there is no file that may be edited */
    scene scene;    /* the same on every rank */
    char *warning;  /* the reason why the last edit of the file was refused, or NULL */
    bool has_stamp; /* on rank 0 */
    struct stat stamp;
} session_scene_file;

/* The name of a scene given as text in messages, in place of a file's path. */
#define SESSION_SCENE_TEXT "scene text"

/* The source of a scene. Only rank 0's is used. */
typedef struct session_scene_source {
    const char *call; /* the public call, for messages */
    const char *path; /* the file's path; NULL if text is given, or nothing */
    const char *text; /* YAML; NULL if a path is given, or nothing */
} session_scene_source;

/* Reads the scene for the first time. *file must be empty before, and must be freed even after an error. Collective. */
insitu_status session_load_scene(session_scene_file *file, const session_team *team, const session_scene_source *source,
                                 base_error *error);

/* Returns whether the file was edited since it was read; false on ranks other than 0, and if there is no file.
 * Local. */
bool session_is_scene_edited(const session_scene_file *file, int rank);

/* Reads the file again. Returns false if it keeps the old scene; warning then has the reason. Collective. */
bool session_reload_scene(session_scene_file *file, const session_team *team);

void session_scene_file_free(session_scene_file *file);

#endif
