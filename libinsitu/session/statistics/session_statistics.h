/* Statistics of fields over all drawn cells. They do not depend on the partition. */
#ifndef SESSION_STATISTICS_H
#define SESSION_STATISTICS_H

#include "scene.h"
#include "session_mesh.h"
#include "session_team.h"

enum { SESSION_MAX_BINS = 256 };

typedef struct session_statistics_wish {
    const scene_field *field;
    int bin_count;    /* number of the histogram's bins; 0: no histogram */
    double low, high; /* the range that the bins cover; low > high: the range of the values */
} session_statistics_wish;

/* Statistics of a field. A cell's value is its own, or the mean of its vertices' values. Cells whose values are not all
 * finite do not count. If no cell with a volume counts, shells count instead; then areas take the place of volumes. */
typedef struct session_statistics {
    int64_t cells;
    bool is_of_shells;
    double volume;          /* total volume of the cells */
    double least, most;     /* range of the values, at vertices for a vertex field; least > most: there are no values */
    double mean, deviation; /* mean and deviation of cells' values, weighted by volume */
    int bin_count;
    double low, high; /* begin of the first bin and end of the last one */
    /* each bin's share of the volume, by cells' values; values beyond the ends count in the outer bins */
    double shares[SESSION_MAX_BINS];
} session_statistics;

/* Computes the statistics of fields over all meshes that have them and to which they are restricted by name, by three
 * reductions. Collective. */
insitu_status session_find_statistics(const session_meshes *meshes, const session_team *team,
                                      const session_statistics_wish *wishes, int count, session_statistics *out,
                                      base_error *error);

#endif
