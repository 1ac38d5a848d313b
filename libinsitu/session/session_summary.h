/* The end of a step's report. */
#ifndef SESSION_SUMMARY_H
#define SESSION_SUMMARY_H

#include "session_mesh.h"
#include "session_report.h"
#include "session_writer.h"

/* Add up what the meshes, their trees, the tree over these (parent) and the writer hold and leave out.
 * scene_warning: NULL, or why the scene file's last edit was not taken. Local. */
void session_summarize(const session_meshes *meshes, const mmbvh *parent, session_writer *writer,
                       const char *scene_warning, session_report *out);

#endif
