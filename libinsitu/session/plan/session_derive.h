/* Computes the values of derived fields: expressions, gradients and similar quantities that the scene defines from
 * other fields. */
#ifndef SESSION_DERIVE_H
#define SESSION_DERIVE_H

#include "scene.h"
#include "session_catalogue.h"
#include "session_space.h"

/* Input for computing derived fields; it is the same on every rank except for the rank's own meshes. */
typedef struct session_derive_basis {
    const scene *scene;
    session_catalogue *catalogue;
    session_meshes *meshes;
    const session_team *team;
    const session_extent *extent;
} session_derive_basis;

/* Computes the values of derived fields that are out of date on any rank. needed: one bit per derived field. The fields
 * on which these derived fields depend must have been filled and copied; those of them that are derived must also be in
 * `needed`. Collective; all ranks return the same status. */
insitu_status session_compute_derived(const session_derive_basis *basis, uint64_t needed, base_error *error);

#endif
