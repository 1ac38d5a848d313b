/* Holds the scene of a session. The caller gives the scene as text or as a file. A file is read again when it has been
 * edited. */
#ifndef SESSION_SCENE_FILE_H
#define SESSION_SCENE_FILE_H

#include <sys/stat.h>

#include "scene.h"
#include "session_team.h"

typedef struct session_scene_file {
    char *path;        /* path of the file, the same on every rank; SESSION_SCENE_TEXT if the scene was given as text */
    bool is_text;      /* set on rank 0 if the scene was given as text, so that no file can be edited */
    scene scene;       /* the parsed scene, the same on every rank */
    char *warning;     /* reason why the most recent edit of the file was refused; NULL if it was accepted */
    bool has_stamp;    /* set on rank 0 if `stamp` is valid */
    struct stat stamp; /* state of the file (stat()) when it was last read; valid if has_stamp is set */
} session_scene_file;

/* Stands for the file's path in messages if the scene was given as text. */
#define SESSION_SCENE_TEXT "scene text"

/* The source of a scene; only the source given on rank 0 is used. */
typedef struct session_scene_source {
    const char *call; /* name of the public call, for messages */
    const char *path; /* path of the file; NULL if text is given or there is no scene */
    const char *text; /* YAML text; NULL if a path is given or there is no scene */
} session_scene_source;

/* Reads the scene for the first time. *file must be empty before the call, and must be freed even after an error.
 * Collective. */
insitu_status session_load_scene(session_scene_file *file, const session_team *team, const session_scene_source *source,
                                 base_error *error);

/* Returns whether the file was edited since it was last read. Always returns false on ranks other than 0, and if there
 * is no file. Local. */
bool session_is_scene_edited(const session_scene_file *file, int rank);

/* Reads the file again. Returns false if the old scene is kept; file->warning then has the reason. Collective. */
bool session_reload_scene(session_scene_file *file, const session_team *team);

void session_scene_file_free(session_scene_file *file);

#endif
