/* The passes of a time step over a rank's arrays. wave_kernel.c is compiled once for each pair of float or double and
 * int32 or int64; each object exports one table of its passes. */
#ifndef WAVE_KERNEL_H
#define WAVE_KERNEL_H

#include <stdbool.h>
#include <stdint.h>

#include "wave_medium.h"

/* Component k of element i is values[i * stride + k * component_stride]: interleaved (AoS) or apart (SoA). */
typedef struct wave_values {
    void *values;
    int64_t stride, component_stride;
} wave_values;

/* Arrays marked real are float or double, those marked index int32 or int64, as the table used wants them. */
typedef struct wave_grid {
    int32_t own_cells, own_vertices;
    uint8_t uniform_type;
    const uint8_t *types;
    const void *connectivity, *offsets; /* index */
    const int64_t *face_offsets;
    const int32_t *neighbours;
    const int64_t *around_offsets;
    const int32_t *around;
    const uint8_t *walls;
    const uint8_t *layers;      /* cells: layer of the medium */
    const void *around_weights; /* real, as around: weight of each cell in the value at the vertex */
    const void *faces;          /* real, own faces x 4: outward unit normal, area */
    const void *inverse_volume; /* real, own_cells */
    wave_values state;          /* cells: pressure, velocity */
    wave_values vertex_state;   /* vertices: the same; values NULL for a scheme of first order */
    wave_values coordinates;    /* vertices: x, y, z as drawn */
    void *jump;                 /* real, cells x 4, interleaved: cell state less its mean over the cell's vertices */
    double modulus[WAVE_LAYERS_MAX], density[WAVE_LAYERS_MAX], impedance[WAVE_LAYERS_MAX];
    bool second_order; /* vertex_state is used to reconstruct */
    bool reflecting;   /* walls; else absorbing */
} wave_grid;

typedef struct wave_kernel {
    /* Computes vertex_state from the state of the cells around. */
    void (*to_vertices)(const wave_grid *grid);
    /* Computes the jumps of own cells, half a time step ahead. */
    void (*find_jumps)(const wave_grid *grid, double time_step);
    /* Moves the state of own cells a time step ahead, by the jumps of all cells. */
    void (*apply_fluxes)(const wave_grid *grid, double time_step);
    /* Moves the coordinates of own vertices by scale * their velocity. */
    void (*move_vertices)(const wave_grid *grid, double scale);
} wave_kernel;

extern const wave_kernel wave_kernel_float_int32, wave_kernel_float_int64;
extern const wave_kernel wave_kernel_double_int32, wave_kernel_double_int64;

#endif
