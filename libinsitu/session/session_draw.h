/* Due images to pictures on rank 0. */
#ifndef SESSION_DRAW_H
#define SESSION_DRAW_H

#include "session.h"

/* Draw the due images with the meshes as they are known to be right. Those that cannot be drawn are left out, and the
 * first reason is the error; the others are drawn. Collective. */
insitu_status session_draw_images(insitu_session *session, const scene_image *const *due, int count, int64_t cycle,
                                  base_error *error);

#endif
