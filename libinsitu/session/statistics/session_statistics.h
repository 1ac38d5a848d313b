/* Statistics of fields over all drawn cells. They do not depend on how cells are distributed over ranks. */
#ifndef SESSION_STATISTICS_H
#define SESSION_STATISTICS_H

#include "scene.h"
#include "session_mesh.h"
#include "session_team.h"

enum { SESSION_MAX_BINS = 256 };

typedef struct session_statistics_wish {
    const scene_field *field;
    int bin_count;    /* number of bins of the histogram; 0: no histogram is computed */
    double low, high; /* the range that the bins cover; low > high: the range of the values is used */
} session_statistics_wish;

/* Statistics of a field. The value of a cell is its own, or the mean of the values at its vertices. Cells whose values
 * are not all finite are not counted. If no cell with a volume is counted, shells are, and areas are used instead of
 * volumes. */
typedef struct session_statistics {
    int64_t cell_count; /* number of counted cells */
    bool is_of_shells;  /* set if shells are counted, so that areas replace volumes */
    double volume;      /* total volume of the cells */
    /* range of the values, for a vertex field of those at vertices; minimum > maximum: there are no values */
    double minimum, maximum;
    double mean, deviation; /* mean and standard deviation of the cells' values, weighted by volume */
    int bin_count;
    double low, high; /* lower bound of the first bin and upper bound of the last one */
    /* fraction of the volume in each bin, by the cells' values; values outside of the bins count in the first or last
     * bin */
    double bin_fractions[SESSION_MAX_BINS];
} session_statistics;

/* Computes the statistics of fields over all meshes that have them, restricted to a mesh if its name is given, by three
 * reductions. Collective. */
insitu_status session_find_statistics(const session_meshes *meshes, const session_team *team,
                                      const session_statistics_wish *wishes, int count, session_statistics *out,
                                      base_error *error);

#endif
