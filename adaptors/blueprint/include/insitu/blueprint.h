/* Draw what a simulation describes as a Conduit node that follows the Mesh Blueprint: the arrays are borrowed where the
 * node has them. For codes that have such nodes already, as those with an Ascent adaptor; codes with a Catalyst 2
 * adaptor need nothing of this (docs/catalyst.md).
 *
 *     #include <conduit.h>
 *     #include "insitu/blueprint.h"
 *     #include "insitu/conduit.h"
 *
 *     insitu_blueprint *door = NULL;
 *     insitu_blueprint_create(session, &insitu_conduit_functions, MPI_COMM_WORLD, &door);
 *     insitu_blueprint_set(door, "", node);
 *     insitu_blueprint_step(door, NULL, NULL);
 *     ...
 *     insitu_blueprint_destroy(&door);
 *     insitu_destroy(&session);
 *
 * This library links no Conduit: it calls the one that the code is linked to, by a table of functions.
 *
 * A topology "T" of a node given as "name" becomes the mesh "name/T", or "T" if name is "". If the node has several
 * domains, their topologies become "name/T/0", "name/T/1", ... by the domain's number on this rank, and the session
 * joins them as it does all meshes. Taken are uniform, rectilinear, structured and unstructured topologies of 2 and 3
 * dimensions: shapes tri, quad, polygonal, tet, hex, wedge, pyramid, polyhedral and mixed; lattices (insitu_lattice)
 * come of the first three. Fields at vertices and elements, of any numeric type, with components in one allocation or
 * several. Ghosts are the element fields ascent_ghosts and vtkGhostType, and those that state/metadata/vtk_fields calls
 * "Ghosts". Cells that windows of a nestset give to a child are not drawn, as the child's are.
 *
 * Left out, and named in the report: points and lines, the old stream of element_types, coordinates r, theta and phi,
 * fields by a basis or with values of materials alone, ghosts at vertices, fields of structured topologies with other
 * strides than the topology or than the other element fields, and windows that are not within their domain.
 *
 * The arrays must stay until insitu_blueprint_step() returns; the node may go before. */
#ifndef INSITU_BLUEPRINT_H
#define INSITU_BLUEPRINT_H

#include "insitu/insitu.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The functions of Conduit's C API that are called; insitu/conduit.h makes a table of them. Each takes a conduit_node
 * and does what Conduit's of that name does: conduit_node_child() and so on, and from id on those of the node's
 * conduit_datatype. */
typedef struct insitu_conduit {
    int64_t (*number_of_children)(const void *node);
    void *(*child)(const void *node, int64_t number);
    char *(*name)(const void *node); /* given back by free() */
    int (*has_path)(const void *node, const char *path);
    void *(*fetch_existing)(const void *node, const char *path); /* called only for paths that there are */
    void *(*element_ptr)(const void *node, int64_t number);
    char *(*as_char8_str)(const void *node); /* called only for strings; not given back */
    int64_t (*id)(const void *node);
    int64_t (*number_of_elements)(const void *node);
    int64_t (*stride)(const void *node); /* bytes */
    int (*is_string)(const void *node);
} insitu_conduit;

typedef struct insitu_blueprint insitu_blueprint;

/* Report of the last step on this rank. */
typedef struct insitu_blueprint_report {
    int meshes;             /* handed over: one a topology of a domain */
    int fields;             /* handed over, over all meshes */
    int64_t cells;          /* handed over, ghosts included */
    int64_t bytes_copied;   /* held in arrays that the door made, for the reasons in copied_why */
    const char *copied_why; /* "" or one "path: what (bytes)" a line; valid until the next insitu_blueprint_set() */
    const char *left_out;   /* "" or one "path: why" a line: what is not drawn; valid as long */
} insitu_blueprint_report;

/* A door for a session, which must outlive it, on the session's ranks; comm is duplicated. The table of functions must
 * stay. On an error *out is NULL. Collective. */
INSITU_API insitu_status insitu_blueprint_create(insitu_session *session, const insitu_conduit *conduit, MPI_Comm comm,
                                                 insitu_blueprint **out);

/* Set the meshes and fields of a Blueprint mesh of one or several domains, a `conduit_node *`, under a name, which may
 * be "". May be called several times before a step, for nodes of different names; what is not set again before the next
 * step is taken away by it. An empty node, as of a rank without domains, is fine, and so is NULL. Local.
 *
 * What has changed since the last step is found by a hash of the coordinates, connectivity and ghosts, unless the
 * domain says it in state/insitu_changed: "nothing", "geometry" or "all".
 *
 * INSITU_ERROR_MESH or INSITU_ERROR_FIELD: the node is wrong; the message has its path. The next step then returns
 * this on all ranks and draws nothing. Other errors are those of insitu_set_mesh() and insitu_set_field(). */
INSITU_API insitu_status insitu_blueprint_set(insitu_blueprint *door, const char *name, const void *node);

/* Refuse the next step for a reason of the caller's own, as if a node were wrong: it returns this on all ranks. The
 * first reason counts. Local. */
INSITU_API void insitu_blueprint_refuse(insitu_blueprint *door, insitu_status status, const char *message);

/* Take a step of the session with what has been set. cycle, time: NULL: state/cycle and state/time of the domains, the
 * greatest over all ranks; where no domain has them, one more than the last cycle, and the cycle. Collective; the same
 * status on all ranks. */
INSITU_API insitu_status insitu_blueprint_step(insitu_blueprint *door, const int64_t *cycle, const double *time);

/* The report of the last step. Local. */
INSITU_API const insitu_blueprint_report *insitu_blueprint_last_report(const insitu_blueprint *door);

/* The message of the last call on the door that failed, "" if none did. Valid until the next call. Local. For NULL:
 * that of this thread's last insitu_blueprint_create() that failed. */
INSITU_API const char *insitu_blueprint_error(const insitu_blueprint *door);

/* Take the meshes away from the session and set *door to NULL. Collective. NULL, or a pointer to NULL, is fine. */
INSITU_API void insitu_blueprint_destroy(insitu_blueprint **door);

#ifdef __cplusplus
}
#endif

#endif
