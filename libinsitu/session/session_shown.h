/* Which values of its scalars the due images show, and so which cells can be seen at all. */
#ifndef SESSION_SHOWN_H
#define SESSION_SHOWN_H

#include "session.h"

/* Forget what the images of an earlier step showed. */
void session_shown_clear(session_scalar *scalar);
/* Add what a layer shows; false where memory ran out. */
bool session_shown_surface(session_scalar *scalar, const scene_isosurface *layer);
bool session_shown_volume(const insitu_session *session, session_scalar *scalar, const scene_volume *layer);

/* The mesh's cells that can be seen are told by values alone. */
bool session_shown_is_bounded(const session_mesh *mesh);
/* A hash of all that decides on them but the values: the scalars and their intervals. */
uint64_t session_shown_key(const session_mesh *mesh);
/* These cells. Sets the scalars' counts of unusable cells. */
insitu_status session_shown_select(session_mesh *mesh, int threads, mmbvh_selection *out, base_error *error);

#endif
