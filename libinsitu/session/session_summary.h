/* Completes a step's report at its end. */
#ifndef SESSION_SUMMARY_H
#define SESSION_SUMMARY_H

#include "session_mesh.h"
#include "session_report.h"
#include "session_writer.h"

/* Adds up the memory of the meshes, of their trees, of `parent` (the tree over these trees) and of the writer, and
 * counts the cells that are not drawn. scene_warning: the reason why the most recent edit of the scene file was
 * refused, or NULL. Local. */
void session_add_mesh_data_to_report(const session_meshes *meshes, const mmbvh *parent, session_writer *writer,
                                     const char *scene_warning, session_report *out);

#endif
