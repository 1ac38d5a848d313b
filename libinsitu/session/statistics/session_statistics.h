/* Computes statistics of fields over all drawn cells. The results do not depend on the distribution of cells over
 * ranks. */
#ifndef SESSION_STATISTICS_H
#define SESSION_STATISTICS_H

#include "scene.h"
#include "session_catalogue.h"
#include "session_fixed_sums.h"
#include "session_team.h"

typedef struct session_statistics_request {
    const scene_field *field;
    int bin_count;    /* number of bins of the histogram; 0: no histogram is computed */
    double low, high; /* range of values that the bins cover; low > high: the range of all values */
} session_statistics_request;

/* Statistics of a field. The value of a cell is its cell value, or the mean of the values at its vertices. In a cell of
 * higher order with values at nodes, the polynomial through these values is integrated. Cells whose values are not all
 * finite are not counted. If no cell with a volume is counted, shells are counted instead, and their areas replace
 * volumes. */
typedef struct session_statistics {
    int64_t cell_count; /* number of counted cells */
    bool is_of_shells;  /* set if shells are counted, so that areas replace volumes */
    double volume;      /* total volume of the cells */
    /* Range of the values; for a vertex field, of the values at all vertices, which include all nodes of cells of
     * higher order. minimum > maximum: there are no values. */
    double minimum, maximum;
    double mean, deviation; /* mean and standard deviation of the cells' values or polynomials, weighted by volume */
    int bin_count;
    double low, high; /* lower bound of the first bin and upper bound of the last one */
    /* fraction of the volume in each bin: cells are sorted into bins by their values, or the quadrature points of
     * polynomials are sorted by the values at the points */
    double bin_fractions[SESSION_MAX_BINS];
} session_statistics;

/* Computes the statistics of the requested fields. A field's statistics are over the meshes that have the field and to
 * which the request's scene_field applies. There are three reductions, and one more if there are cells of higher order.
 * Collective. */
insitu_status session_find_statistics(session_meshes *meshes, const session_catalogue *catalogue,
                                      const session_team *team, const session_statistics_request *requests, int count,
                                      session_statistics *out, base_error *error);

#endif
