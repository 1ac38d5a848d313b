/* Defines the data of one cell that the statistics of a field need. */
#ifndef SESSION_CELL_VALUE_H
#define SESSION_CELL_VALUE_H

#include "session_volume.h"

typedef struct session_cell_value {
    /* is_counted: the cell is drawn and all its values are finite; is_shell: the cell is a triangle, quad or polygon,
     * which has no volume */
    bool is_counted, is_shell;
    /* true: the value is a polynomial that varies in the cell, so that `mean` may lie outside minimum .. maximum, and
     * each bin of a histogram gets a part of the cell's volume */
    bool is_integral;
    double minimum, maximum; /* range of the values at the vertices or nodes, or the single value of the cell */
    /* the single value of the cell, the mean of the values at its vertices or, if is_integral is set, the integral of
     * the polynomial divided by the volume */
    double mean;
    double half_deviation; /* half the standard deviation of the value in the cell; the half cannot overflow */
    double volume;         /* volume of the cell, or area if it is a shell */
} session_cell_value;

/* Reads a linear cell. Its mean is the mean of the values at its vertices. */
session_cell_value session_read_cell_value(const grid *g, const grid_field *field, int64_t cell, volume_buffer *buffer);

#endif
