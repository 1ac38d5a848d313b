#include "session_lanes.h"

#include <stddef.h>

static const lane_loops *get_loops_for_instruction_set(cpu_isa isa)
{
#ifdef SESSION_HAS_X86
    if (isa == CPU_AVX512) return &session_lanes_avx512;
    if (isa == CPU_AVX2) return &session_lanes_avx2;
#endif
    (void)isa;
    return &session_lanes_plain;
}

lane_run *session_get_cell_loop_for_type(cpu_isa isa, const grid *g, int type)
{
    const bool wide_index = g->connectivity.is_wide, wide_number = g->coordinates[0].is_wide;
    switch (type) {
    case GRID_TET: return get_loops_for_instruction_set(isa)->runs[LANE_TETS][wide_index][wide_number];
    case GRID_HEX: return get_loops_for_instruction_set(isa)->runs[LANE_HEXES][wide_index][wide_number];
    case GRID_WEDGE: return get_loops_for_instruction_set(isa)->runs[LANE_WEDGES][wide_index][wide_number];
    case GRID_PYRAMID: return get_loops_for_instruction_set(isa)->runs[LANE_PYRAMIDS][wide_index][wide_number];
    default: return NULL;
    }
}
