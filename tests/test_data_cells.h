/* Reads the cells of a real grid as they are, including cells of higher order, for tests of sessions. */
#ifndef TEST_DATA_CELLS_H
#define TEST_DATA_CELLS_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Cells of one type. The arrays are allocated by malloc(). */
typedef struct data_cells {
    int type, nodes; /* type: VTK's number of the cell type; nodes: number of nodes of each cell */
    int64_t vertex_count, cell_count;
    double *coordinates; /* vertices x 3 */
    double *values;      /* values at the vertices */
    int64_t *connectivity;
} data_cells;

/* Reads a .vtu file whose cells all have one type. Returns false if there is no such file, or if it has no point data
 * of this name with one component. */
bool data_cells_read_file(const char *path, const char *field, data_cells *out);

#ifdef __cplusplus
}
#endif

#endif
