/* What a session holds, for the files of the session alone. One noun a file pair; this one is the ground they share.
 *
 * A step goes down this list, and every item that can fail on one rank alone ends in session_agree(), so that all
 * ranks leave at the same place:
 *
 *     session_step.c       one small reduction: cycle, pending errors, what changed anywhere; the order of the rest
 *     session_scene.c      the scene file, read again when it changed
 *     session_check.c      deep checks of meshes that changed, their bounds and counts
 *     session_team.c       how many threads there are, where more are wanted than before
 *     session_space.c      global bounds, origin and scale
 *     session_catalogue.c  which meshes and fields there are, over all ranks
 *     session_warnings.c   what is drawn as asked but hardly as meant
 *     session_plan.c       due images to the scalars they need; nothing else is computed from here on
 *     session_recentre.c   cell values to vertices, where a layer wants them (session_exchange.c: over ranks)
 *     session_values.c     whether values that were set anew have changed
 *     session_shown.c      which values of them the images show
 *     session_tree.c       trees and ranges
 *     session_draw.c       frames, outputs (session_view.c: camera, lights, transfer functions)
 *     session_kept.c       which images share the cells of isosurfaces
 *     session_frame.c      one frame: tracing, compositing, pixels where cells overlap
 *     session_report.c     what was done */
#ifndef SESSION_SESSION_H
#define SESSION_SESSION_H

#include <mpi.h>
#include <pthread.h>
#include <sys/stat.h>

#include "error.h"
#include "grid.h"
#include "insitu/insitu.h"
#include "mmbvh.h"
#include "render.h"
#include "scene.h"

typedef struct session_field {
    insitu_field given; /* name is a copy of ours, the values are borrowed */
    grid_array values;
    int64_t component_stride;
    base_error problem; /* of the last insitu_set_field() */
} session_field;

/* One scalar of a field as a layer uses it: a component or the magnitude, as it is or recentred to vertices. */
typedef struct session_scalar {
    int field;     /* in the mesh's fields */
    int component; /* as grid_field.component */
    bool is_recentred;
    bool is_used;       /* by an image of this step */
    bool wants_ranges;  /* by an image of this step: colours need none */
    bool shows_all;     /* an image of this step may need any cell */
    int interval_count; /* else the values that its images show */
    mmbvh_interval *intervals;
    double *vertex_values; /* recentred values, a declared copy; NULL until computed */
    grid_field own;        /* of a recentred one in use: the cells' */
    bool are_values_stale; /* recentred ones are to be computed again */
    bool is_suspect;       /* the values were set anew: they may have changed */
    bool has_checksum;
    uint64_t checksum;
    bool has_own_ranges; /* the tree nodes' own, else pairs */
    float *pairs;        /* NULL until computed */
    bool are_ranges_stale;
    int64_t unusable;
    bool is_extent_known;
    double low, high; /* over drawn cells all of whose values are finite; low > high: there are none */
} session_scalar;

/* One rank's part of a mesh. */
typedef struct session_mesh {
    char *name;
    insitu_mesh given;
    grid cells;
    bool is_given;      /* false after an insitu_set_mesh() that failed: problem says why */
    base_error problem; /* of the last insitu_set_mesh() */
    int field_count;
    session_field *fields;

    bool is_check_stale;
    bool is_topology_stale;    /* the tree is of other cells */
    bool is_geometry_stale;    /* the tree is of other coordinates */
    double lower[3], upper[3]; /* of the drawn cells; lower > upper: there are none */
    int64_t drawn_count, ghost_count, inverted_count, flat_count;
    double size_sum; /* of drawn cells: cube roots of volumes */
    uint64_t *flat;  /* NULL: no cell is flat; else as in cells */

    bool is_needed; /* by an image of this step */
    bool has_tree;
    mmbvh tree;
    bool is_partial; /* the tree is over what the images of shown_key can show, while nothing changes */
    uint64_t shown_key;
    double rent; /* seconds spent on partial trees since the cells last changed, beyond what a full one would cost */
    int scalar_count;
    session_scalar *scalars;
} session_mesh;

/* A mesh over all ranks; the same on every rank. */
typedef struct session_catalogue_field {
    char *name;
    int component_count;
    bool is_cell_centred;
    int first_rank;   /* that has it */
    int last_rank;    /* that has it together with cells; -1: none */
    int odd_rank;     /* -1, or one that has it with another centring or count of components */
    int lacking_rank; /* -1, or one that has cells of the mesh but not the field */
} session_catalogue_field;

typedef struct session_catalogue_mesh {
    char *name;
    int first_rank; /* that has cells of it; -1: none */
    bool has_ids;   /* all of these give vertex ids */
    int field_count;
    session_catalogue_field *fields;
} session_catalogue_mesh;

typedef struct session_catalogue {
    int mesh_count;
    session_catalogue_mesh *meshes;
} session_catalogue;

/* Global bounds of the drawn cells and what follows from them; the same on every rank. */
typedef struct session_extent {
    double lower[3], upper[3]; /* both 0 where there are no cells */
    double half_diagonal;
    int64_t cell_count; /* drawn ones */
    double cell_size;   /* their mean: of the cube roots of their volumes; 0 where they have none */
    int rank_count;     /* ranks that have some */
} session_extent;

/* Seconds a cell takes on this rank, as measured; 0: not yet. */
typedef struct session_rates {
    double build, select, refit;
} session_rates;

/* How many threads are known to be there, or to be possible, for the thread that called last; 0: not yet tried. */
typedef struct session_team {
    int size;
    pthread_t caller;
    int64_t ended; /* threads of any team that had ended by then */
} session_team;

/* Growing text for the report; what memory cannot hold is left away. */
typedef struct session_text {
    char *data;
    size_t size, capacity;
} session_text;

struct insitu_session {
    MPI_Comm comm;      /* ours, errors return */
    MPI_Comm comp_comm; /* compositing's own */
    int rank, ranks, node_ranks;
    int threads; /* of this step's teams */
    session_team team;

    char *scene_path; /* the same on every rank */
    scene scene;
    bool has_stamp; /* rank 0 */
    struct stat stamp;
    char *scene_warning; /* NULL, or why the last edit of the scene file was not taken */

    int mesh_count;
    session_mesh **meshes; /* by name */
    bool is_changed;       /* cells or coordinates, since the last agreed extent */
    bool is_table_changed; /* names, since the last agreed catalogue */
    base_error pending;    /* of a set call that had no mesh to stay with; for one step */

    session_catalogue catalogue;
    bool has_catalogue;
    bool has_extent, has_space;
    session_extent extent;
    double space_lower[3], space_upper[3]; /* bounds for which the space was made */
    double origin[3], scale;

    session_rates rates;
    mmbvh parent; /* over the trees of parent_key; none where that is one tree or none */
    uint64_t parent_key;
    bool is_parent_stale;

    float *picture; /* rank 0: memory of the last picture, for the next one (session_draw.c) */
    size_t picture_bytes;

    base_error error;
    insitu_report report;
    session_text copied_why, left_out, warnings;
    int told_count;
    uint64_t *told; /* warnings that hold and were told (session_warnings.c) */
};

static inline int64_t session_type_size(insitu_type type)
{
    switch (type) {
    case INSITU_FLOAT32:
    case INSITU_INT32: return 4;
    case INSITU_FLOAT64:
    case INSITU_INT64: return 8;
    case INSITU_UINT8: return 1;
    }
    return 0;
}

/* FNV-1a: *hash, SESSION_HASH_BEGIN at first, takes the bytes in. */
#define SESSION_HASH_BEGIN 0xcbf29ce484222325u
static inline void session_hash_bytes(uint64_t *hash, const void *data, size_t size)
{
    for (size_t i = 0; i < size; i++) *hash = (*hash ^ ((const unsigned char *)data)[i]) * 0x100000001b3u;
}

static inline insitu_status session_no_memory(base_error *error, int64_t bytes, const char *what)
{
    return base_fail(error, INSITU_ERROR_MEMORY, "no memory for %lld bytes of %s", (long long)bytes, what);
}

/* session_mesh.c: the tables of meshes and fields. */
void session_mesh_free(session_mesh *mesh);
session_mesh *session_find_mesh(const insitu_session *session, const char *name);
int session_find_field(const session_mesh *mesh, const char *name); /* -1: there is none */
void session_drop_scalars(session_mesh *mesh);
void session_drop_tree(session_mesh *mesh);
/* The first error that a set call left behind, or NULL. */
const base_error *session_pending_error(const insitu_session *session);

/* session_check.c: prove a mesh before anything reads it; fills bounds and counts, and finds flat cells. Parallel.
 * Local.
 */
insitu_status session_check_mesh(session_mesh *mesh, int threads, base_error *error);

/* session_space.c */
int session_node_ranks(MPI_Comm comm);
/* Check what changed, then global bounds, then origin and scale. Collective. */
insitu_status session_update_extent(insitu_session *session, base_error *error);

/* session_catalogue.c: collective where is_shared is false (ranks have different tables). */
insitu_status session_update_catalogue(insitu_session *session, bool is_shared, base_error *error);
void session_catalogue_free(session_catalogue *catalogue);
/* A hash of this rank's names: equal on two ranks when their tables say the same. */
uint64_t session_table_hash(const insitu_session *session);
const session_catalogue_field *session_catalogue_find(const session_catalogue_mesh *mesh, const char *name);

/* session_scene.c */
insitu_status session_load_scene(insitu_session *session, const char *path, base_error *error); /* collective */
bool session_scene_file_changed(const insitu_session *session); /* rank 0; false elsewhere */
void session_reload_scene(insitu_session *session);             /* collective; a failure is a warning */

/* session_draw.c: the memory of the last picture. */
void session_drop_picture(insitu_session *session);

/* session_report.c */
void session_text_clear(session_text *text);
void session_text_free(session_text *text);
void session_text_add(session_text *text, const char *format, ...) __attribute__((format(printf, 2, 3)));
void session_begin_report(insitu_session *session, int64_t cycle, double time);
void session_end_report(insitu_session *session);

#endif
