/* Partitions of the lattice. The width of a lattice is rarely a power of two. The position of a cube on the Morton
 * curve is therefore not its Morton code but the number of cubes of the lattice that precede it; this number is counted
 * octant by octant, from the largest down. */
#include "wave_partition.h"

static double compute_block_surface(const wave_lattice *lattice, const int blocks[3])
{
    double s[3];
    for (int a = 0; a < 3; ++a) s[a] = (double)lattice->size[a] / blocks[a];
    return s[0] * s[1] + s[1] * s[2] + s[2] * s[0];
}

/* Chooses the number of blocks along each axis. The product of these numbers is the number of ranks; of all such
 * choices, the one with the smallest surface between blocks is taken. */
static void choose_blocks(const wave_lattice *lattice, int ranks, int best[3])
{
    best[0] = ranks;
    best[1] = best[2] = 1;
    for (int x = 1; x <= ranks; ++x) {
        for (int y = 1; ranks % x == 0 && y <= ranks / x; ++y) {
            int blocks[3] = {x, y, ranks / x / y};
            if (ranks / x % y != 0) continue;
            if (compute_block_surface(lattice, blocks) < compute_block_surface(lattice, best)) {
                for (int a = 0; a < 3; ++a) best[a] = blocks[a];
            }
        }
    }
}

wave_partition wave_partition_make(const wave_lattice *lattice, wave_partition_kind kind, int ranks)
{
    wave_partition partition = {.lattice = *lattice, .kind = kind, .ranks = ranks, .blocks = {1, 1, 1}};
    if (kind == WAVE_BLOCK) choose_blocks(lattice, ranks, partition.blocks);
    return partition;
}

/* Returns the number of cubes of the lattice in the box that begins at low and has this edge length. */
static int64_t count_cubes_within(const wave_lattice *lattice, const int low[3], int edge)
{
    int64_t count = 1;
    for (int a = 0; a < 3; ++a) {
        int high = low[a] + edge < lattice->size[a] ? low[a] + edge : lattice->size[a];
        count *= high > low[a] ? high - low[a] : 0;
    }
    return count;
}

static int64_t find_morton_position(const wave_lattice *lattice, const int ijk[3])
{
    int edge = 1, low[3] = {0, 0, 0};
    int64_t before = 0;
    for (int a = 0; a < 3; ++a) {
        while (edge < lattice->size[a]) edge *= 2;
    }
    for (edge /= 2; edge > 0; edge /= 2) {
        unsigned own = 0;
        for (int a = 0; a < 3; ++a) own |= (ijk[a] & edge) ? 1u << a : 0u;
        for (unsigned octant = 0; octant < own; ++octant) {
            int at[3];
            for (int a = 0; a < 3; ++a) at[a] = low[a] + ((octant >> a & 1u) ? edge : 0);
            before += count_cubes_within(lattice, at, edge);
        }
        for (int a = 0; a < 3; ++a) low[a] += (own >> a & 1u) ? edge : 0;
    }
    return before;
}

int wave_partition_owner(const wave_partition *partition, const int ijk[3])
{
    const wave_lattice *lattice = &partition->lattice;
    int64_t ranks = partition->ranks;
    switch (partition->kind) {
    case WAVE_MORTON: {
        /* position * ranks is far below 2^63: there are at most 2^40 cubes and 2^20 ranks */
        return (int)(find_morton_position(lattice, ijk) * ranks / wave_lattice_cube_count(lattice));
    }
    case WAVE_RANDOM: return (int)(wave_hash((uint64_t)wave_lattice_find_cube_id(lattice, ijk)) % (uint64_t)ranks);
    case WAVE_CHECKERBOARD: return (int)(((int64_t)ijk[0] + ijk[1] + ijk[2]) % ranks);
    default: break;
    }
    int64_t block[3];
    for (int a = 0; a < 3; ++a) block[a] = (int64_t)ijk[a] * partition->blocks[a] / lattice->size[a];
    return (int)(block[0] + partition->blocks[0] * (block[1] + partition->blocks[1] * block[2]));
}

void wave_partition_find_box(const wave_partition *partition, int rank, int low[3], int high[3])
{
    int at = rank;
    for (int a = 0; a < 3; ++a) {
        int64_t size = partition->lattice.size[a], blocks = partition->blocks[a], block = at % blocks;
        at /= (int)blocks;
        /* low is the smallest i for which i * blocks / size == block, and high is one more than the largest. */
        low[a] = (int)((block * size + blocks - 1) / blocks);
        high[a] = (int)(((block + 1) * size + blocks - 1) / blocks);
    }
}
