/* Draws the mesh that a simulation describes as a Conduit node by the Mesh Blueprint. The node's arrays are borrowed if
 * libinsitu can read them. This header is for codes that create such nodes already, for example with an Ascent adaptor;
 * codes with a Catalyst 2 adaptor do not need it (docs/catalyst.md).
 *
 *     #include <conduit.h>
 *     #include "insitu/blueprint.h"
 *     #include "insitu/conduit.h"
 *
 *     insitu_blueprint *adaptor = NULL;
 *     insitu_blueprint_create(session, &insitu_conduit_functions, MPI_COMM_WORLD, &adaptor);
 *     insitu_blueprint_set(adaptor, "", node);
 *     insitu_blueprint_step(adaptor, NULL, NULL);
 *     ...
 *     insitu_blueprint_destroy(&adaptor);
 *     insitu_destroy(&session);
 *
 * This library does not link Conduit. It calls the Conduit that the code is linked with, through a table of functions.
 *
 * A topology "T" of a node that is set as "name" becomes the mesh "name/T", or "T" if name is "". If the node is a list
 * of domains, their topologies "T" become blocks of this mesh (insitu_set_block), numbered by the domain's index on
 * this rank, so that there is no seam between domains. If a domain has other fields than the domains before it on this
 * rank, it becomes a separate mesh "name/T/3", where 3 is the domain's number. The adaptor reads uniform, rectilinear,
 * structured and unstructured topologies of two and three dimensions, with the shapes tri, quad, polygonal, tet, hex,
 * wedge, pyramid, polyhedral and mixed. The first three types of topologies become lattices (insitu_lattice). Fields at
 * vertices and elements may have any numeric type, and their components may be in one allocation or several. Ghost
 * flags are the element fields ascent_ghosts and vtkGhostType, and element fields that state/metadata/vtk_fields
 * declares as "Ghosts".
 *
 * Uniform domains of a mesh get a common origin, found by all ranks in the first step, so that common vertices have
 * equal coordinates even if the positions in the nodes differ by rounding errors. Uniform domains with state/level (or
 * state/level_id) are blocks of levels of refinement (insitu_lattice). The refinement ratios are computed from the
 * spacings. Cells that a finer domain on any rank covers are not drawn. Layers of ghost cells around such a domain are
 * not part of the block's interior. In domains without a level, cells are not drawn if a nestset's windows assign them
 * to a child domain.
 *
 * The following is left out, and named in the report: points and lines, the old stream of element_types, the
 * coordinates r, theta and phi, fields that are given by a basis or have only values per material, ghost flags at
 * vertices, fields of structured topologies whose strides differ from those of the topology or of the other element
 * fields, and windows that are not within their domain. A domain whose spacing or position does not fit the coarsest
 * level is drawn, but hides no coarser cells; the report names it too.
 *
 * The arrays must stay valid until insitu_blueprint_step() returns; the node may be destroyed earlier. */
#ifndef INSITU_BLUEPRINT_H
#define INSITU_BLUEPRINT_H

#include "insitu/insitu.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The functions of Conduit's C API that the adaptor calls; insitu/conduit.h defines such a table. Each member is called
 * with a conduit_node and does the same as the function of Conduit with that name, such as conduit_node_child(). The
 * members from id on correspond to functions of the node's conduit_datatype. */
typedef struct insitu_conduit {
    int64_t (*number_of_children)(const void *node);
    void *(*child)(const void *node, int64_t number);
    char *(*name)(const void *node); /* returns a string that the caller frees with free() */
    int (*has_path)(const void *node, const char *path);
    void *(*fetch_existing)(const void *node, const char *path); /* is called only for paths that exist */
    void *(*element_ptr)(const void *node, int64_t number);
    char *(*as_char8_str)(const void *node); /* is called only for nodes that are strings; the result is not freed */
    int64_t (*id)(const void *node);
    int64_t (*number_of_elements)(const void *node);
    int64_t (*stride)(const void *node); /* returns the stride in bytes */
    int (*is_string)(const void *node);
} insitu_conduit;

typedef struct insitu_blueprint insitu_blueprint;

/* The report of the last step on this rank. */
typedef struct insitu_blueprint_report {
    int meshes;             /* number of meshes and blocks set: one per topology of a domain */
    int fields;             /* number of fields set, over all meshes */
    int64_t cells;          /* number of cells set, including ghosts */
    int64_t bytes_copied;   /* size of arrays that the adaptor allocated, for the reasons in copied_why */
    const char *copied_why; /* "", or lines of "path: what (bytes)"; valid until the next insitu_blueprint_set() */
    const char *left_out;   /* "", or lines of "path: why" about what is not drawn; valid as long as copied_why */
} insitu_blueprint_report;

/* Creates an adaptor for the session, which must outlive it. comm has the session's ranks and is duplicated. The table
 * of functions must stay valid. On an error *out is NULL. Collective. */
INSITU_API insitu_status insitu_blueprint_create(insitu_session *session, const insitu_conduit *conduit, MPI_Comm comm,
                                                 insitu_blueprint **out);

/* Sets the meshes and fields of a Blueprint mesh with one or several domains. `node` is a `conduit_node *`; the name
 * may be "". The function may be called several times before a step, for nodes with different names; meshes that are
 * not set again before the next step are removed by it. An empty node (as on a rank without domains) and NULL are
 * allowed. Local.
 *
 * Changes since the last step are detected by hashes of the coordinates, connectivity and ghost flags, unless the
 * domain states them in state/insitu_changed: "nothing", "geometry" or "all".
 *
 * If the node is invalid, returns INSITU_ERROR_MESH or INSITU_ERROR_FIELD, with the path in the message. The next step
 * then returns this error on all ranks and draws nothing. Other errors are those of insitu_set_mesh() and
 * insitu_set_field(). */
INSITU_API insitu_status insitu_blueprint_set(insitu_blueprint *adaptor, const char *name, const void *node);

/* Makes the next step fail, as if a node were invalid, for a reason that the caller has found itself. The step returns
 * this status on all ranks. If the function is called several times, the first call counts. Local. */
INSITU_API void insitu_blueprint_refuse(insitu_blueprint *adaptor, insitu_status status, const char *message);

/* Performs a step of the session with the meshes and fields that have been set. If cycle or time is NULL, the largest
 * state/cycle or state/time of all domains on all ranks is used; if no domain has them, the cycle is one more than the
 * last one, and the time equals the cycle. Collective; returns the same status on all ranks. */
INSITU_API insitu_status insitu_blueprint_step(insitu_blueprint *adaptor, const int64_t *cycle, const double *time);

/* Returns the report of the last step. Local. */
INSITU_API const insitu_blueprint_report *insitu_blueprint_last_report(const insitu_blueprint *adaptor);

/* Returns the message of the last call that failed on this adaptor, or "" if none did. It is valid until the next call.
 * For NULL, returns the message of this thread's last insitu_blueprint_create() that failed. Local. */
INSITU_API const char *insitu_blueprint_error(const insitu_blueprint *adaptor);

/* Removes the meshes from the session and sets *adaptor to NULL. NULL and a pointer to NULL are allowed. Collective. */
INSITU_API void insitu_blueprint_destroy(insitu_blueprint **adaptor);

#ifdef __cplusplus
}
#endif

#endif
