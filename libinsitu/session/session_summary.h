/* The end of a step's report. */
#ifndef SESSION_SUMMARY_H
#define SESSION_SUMMARY_H

#include "session_mesh.h"
#include "session_report.h"
#include "session_writer.h"

/* Sums up the memory of the meshes, their trees, the tree over these (parent) and the writer, and the cells that are
 * not drawn. scene_warning: NULL, or the reason why the scene file's last edit was refused. Local. */
void session_summarize(const session_meshes *meshes, const mmbvh *parent, session_writer *writer,
                       const char *scene_warning, session_report *out);

#endif
