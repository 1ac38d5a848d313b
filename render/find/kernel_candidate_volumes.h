/* Finds the cells that are visible in a volume, SIMD_WIDTH cells at a time (kernel_candidates.h). Their pixels are
 * those of the bounding box of their vertices. */
#ifndef RENDER_KERNEL_CANDIDATE_VOLUMES_H
#define RENDER_KERNEL_CANDIDATE_VOLUMES_H

#include "grid.h"
#include "kernel_arrays.h"
#include "kernel_cell.h"
#include "kernel_finder.h"
#include "kernel_visible_values.h"
#include "kernel_wide.h"
#include "simd.h"

/* Reads one cell's positions and values from the mesh into s->cell. */
SIMD_INLINE void kernel_finder_fetch_cell(kernel_finder *s, uint32_t cell)
{
    kernel_cell_fetch(&s->cell, s->frame->job->parts[s->part].cells, &s->field->fields[s->part], cell);
}

/* Adds the cells whose values are visible in the volume to the candidates. All cells of the list have one type. */
static __attribute__((noinline)) void kernel_find_volumes(kernel_finder *s, const kernel_cells *c)
{
    kernel_view_bounds e = kernel_view_bounds_empty();
    vm fitting = vm_all_lanes();
    vf v[8] = {vf_set(0)};
    for (int i = 0; i < c->vertices; i++) {
        const vi vertex = kernel_cells_vertex(c, i);
        kernel_raw_numbers value;
        vf place[3], at[3];
        kernel_arrays_values(&s->arrays, vertex, c->cell, &value);
        v[i] = kernel_numbers_are_narrow(&s->arrays.values) ? value.narrow : kernel_wide_doubles_narrow(&value.wide);
        fitting = vm_and(fitting, vf_lt(vf_abs(v[i]), vf_set(1e30f)));
        kernel_finder_positions(s, vertex, place);
        fitting = kernel_positions_fit_lanes(fitting, place);
        kernel_rotate_to_camera(s, place, at);
        kernel_view_bounds_add(s, &e, at, vm_all_lanes());
    }
    const vm shows = kernel_visible_values_overlap_cells(s->visible_values, v, c->vertices);
    const unsigned all = (1u << c->count) - 1;
    const unsigned good = kernel_arrays_drawn(&s->arrays, c->cell, all & vm_bits(vm_and(fitting, shows)));
    if (good) kernel_add_lanes(s, &e, good, c->cell, s->source);
    for (unsigned odd = all & ~vm_bits(fitting); odd; odd &= odd - 1) {
        kernel_finder_fetch_cell(s, c->cell[__builtin_ctz(odd)]);
        kernel_find_volume(s);
    }
}

#endif
