/* The passes of a time step over a rank's arrays. wave_kernel.c is compiled once for each combination of float or
 * double with int32 or int64; each object exports one table of its passes. */
#ifndef WAVE_KERNEL_H
#define WAVE_KERNEL_H

#include <stdbool.h>
#include <stdint.h>

#include "wave_medium.h"

/* Component k of element i is values[i * stride + k * component_stride]: interleaved (AoS) or in separate arrays
 * (SoA). */
typedef struct wave_values {
    void *values;
    int64_t stride, component_stride;
} wave_values;

/* The arrays on which the passes work. Arrays marked "real" are float or double, and arrays marked "index" are int32 or
 * int64, depending on the table of passes. */
typedef struct wave_grid {
    int32_t own_cells, own_vertices;
    uint8_t uniform_type;
    const uint8_t *types;
    const void *connectivity, *offsets; /* arrays of type index */
    const int64_t *face_offsets;
    const int32_t *neighbours;
    const int64_t *vertex_cell_offsets;
    const int32_t *vertex_cells;
    const uint8_t *walls;
    const uint8_t *layers;           /* layer of the medium for each cell */
    const void *vertex_cell_weights; /* real; for each entry of wave_mesh.vertex_cells: weight of the cell in the value
                                        at the vertex */
    const void *faces;               /* real; outward unit normal and area of each face of each own cell */
    const void *inverse_volume;      /* real; 1 / volume of each own cell */
    wave_values state;               /* pressure and velocity of each cell */
    wave_values vertex_state;        /* for each vertex: pressure, velocity; values is NULL in the first-order scheme */
    wave_values coordinates;         /* x, y, z of each vertex, displaced if vertices move */
    void *jump; /* real, interleaved; for each cell, the 4 components of its jump: its state at the middle of the time
                   step minus the mean of the states at its vertices (first-order scheme: its state) */
    double modulus[WAVE_LAYERS_MAX], density[WAVE_LAYERS_MAX], impedance[WAVE_LAYERS_MAX];
    bool second_order; /* true if vertex_state is used for a second-order reconstruction */
    bool reflecting;   /* true if the walls reflect, false if they absorb */
} wave_grid;

typedef struct wave_kernel {
    /* Computes vertex_state from the states of the cells around each vertex. */
    void (*average_to_vertices)(const wave_grid *grid);
    /* Computes the jump of each own cell (see wave_kernel.c), from its state at the middle of the time step. */
    void (*find_jumps)(const wave_grid *grid, double time_step);
    /* Advances the state of own cells by a time step, from the jumps of all cells. */
    void (*apply_fluxes)(const wave_grid *grid, double time_step);
    /* Adds scale * velocity to the coordinates of own vertices. */
    void (*move_vertices)(const wave_grid *grid, double scale);
} wave_kernel;

extern const wave_kernel wave_kernel_float_int32, wave_kernel_float_int64;
extern const wave_kernel wave_kernel_double_int32, wave_kernel_double_int64;

#endif
