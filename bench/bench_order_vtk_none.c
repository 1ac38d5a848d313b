#include "bench_order_vtk.h"

#include <stddef.h>

bool data_cells_read(const char *path, const char *field, data_cells *out)
{
    (void)path, (void)field, (void)out;
    return false;
}

bench_tessellator *bench_tessellator_create(const data_cells *cells, double error)
{
    (void)cells, (void)error;
    return NULL;
}

void bench_tessellator_destroy(bench_tessellator *tessellator)
{
    (void)tessellator;
}

void bench_tessellator_update(bench_tessellator *tessellator)
{
    (void)tessellator;
}

int64_t bench_tessellator_cell_count(bench_tessellator *tessellator)
{
    (void)tessellator;
    return 0;
}

double bench_tessellator_longest_squared(bench_tessellator *tessellator)
{
    (void)tessellator;
    return 0;
}
