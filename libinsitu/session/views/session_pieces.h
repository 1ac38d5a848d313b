/* Chooses the number of linear pieces between two nodes of cells of higher order. */
#ifndef SESSION_PIECES_H
#define SESSION_PIECES_H

#include "session_finer.h"
#include "session_plan.h"

/* The input for choosing the numbers of pieces. Scene, moment and catalogue are the same on every rank. */
typedef struct session_pieces_basis {
    const scene *scene;
    const session_moment *moment;
    bool are_cells_changed; /* set if cells or positions have changed on some rank since pieces were last chosen */
    const session_catalogue *catalogue;
    const session_team *team;
    session_meshes *meshes;
} session_pieces_basis;

/* Chooses the number of pieces between two nodes for each mesh. It is the scene's finer_pieces or, if this is 0, the
 * smallest number with which the errors of surfaces and of volumes in due images are at most the allowed errors, up to
 * a maximum (choose_smallest_piece_count() in session_pieces.c). The numbers are reduced if the pieces of all meshes
 * would take more memory than the scene's finer_memory. Calls fill functions of fields that isosurfaces and volumes
 * show. Adds the chosen numbers to the report. choices: results of session_count_higher_order_cells(), one per mesh of
 * the catalogue. Collective; all ranks return the same status. */
insitu_status session_choose_higher_order_pieces(const session_pieces_basis *basis, session_finer_choice *choices,
                                                 session_report *report, base_error *error);

#endif
