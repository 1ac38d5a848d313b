#include "mmbvh_topology.h"

#include <string.h>

#include "memory.h"
#include "mmbvh_store.h"
#include "region.h"

bool topology_begin(topology_build *build, int64_t cells, int threads)
{
    *build = (topology_build){.threads = threads};
    build->scratch = base_calloc((size_t)threads, sizeof *build->scratch);
    const int64_t most = cells < TOPOLOGY_SUBTREE_CELLS ? cells : TOPOLOGY_SUBTREE_CELLS;
    for (int i = 0; build->scratch && i < threads; i++) {
        build->scratch[i].links = base_alloc((size_t)(2 * most) * sizeof *build->scratch[i].links);
        if (!build->scratch[i].links) return false;
    }
    return build->scratch != NULL;
}

void topology_end(topology_build *build)
{
    for (int i = 0; build->scratch && i < build->threads; i++) base_free(build->scratch[i].links);
    base_free(build->scratch);
    build->scratch = NULL;
}

topology *topology_new(topology_build *build, int64_t first, int64_t count)
{
    topology *t = base_calloc(1, sizeof *t);
    if (!t) {
        atomic_store(&build->failed, true);
        return NULL;
    }
    t->first = first;
    t->count = count;
    return t;
}

void topology_copy_links(topology_build *build, topology *t, const topology_scratch *scratch, topology_link root)
{
    t->root = root;
    if (!scratch->count) return;
    t->links = base_alloc((size_t)scratch->count * sizeof *t->links);
    if (!t->links) {
        atomic_store(&build->failed, true);
        return;
    }
    memcpy(t->links, scratch->links, (size_t)scratch->count * sizeof *t->links);
    t->link_count = scratch->count;
}

static int64_t count_nodes_below(const topology *t)
{
    if (!t->children[0]) return t->link_count;
    return 2 + count_nodes_below(t->children[0]) + count_nodes_below(t->children[1]);
}

int64_t topology_node_count(const topology *t)
{
    return 1 + count_nodes_below(t);
}

static void write_link(const mmbvh *tree, int64_t node, const topology *t, topology_link link, int64_t below)
{
    const int count = (int)(link & 7);
    store_link(tree, node, (count ? t->first : below) + (int64_t)(link >> 3), count);
}

static void write_links(topology *t, const mmbvh *tree, int64_t below)
{
    for (int64_t i = 0; i < t->link_count; i++) write_link(tree, below + i, t, t->links[i], below);
    base_free(t->links);
    t->links = NULL;
}

/* Writes the root of t to the tree's node `slot`, and the descendants of the root to the nodes from `below` on. Returns
 * the index after the last of them. */
static int64_t write_nodes(topology *t, const mmbvh *tree, int64_t slot, int64_t below)
{
    if (!t->children[0]) {
        write_link(tree, slot, t, t->root, below);
        const int64_t end = below + t->link_count;
#pragma omp task default(none) firstprivate(t, tree, below)
        write_links(t, tree, below);
        return end;
    }
    store_link(tree, slot, below, 0);
    const int64_t right = write_nodes(t->children[0], tree, below, below + 2);
    return write_nodes(t->children[1], tree, below + 1, right);
}

void topology_write(topology *t, const mmbvh *tree, int threads)
{
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp single
        write_nodes(t, tree, 0, 1);
        region_leave();
    }
}

void topology_free(topology *t)
{
    if (!t) return;
    topology_free(t->children[0]);
    topology_free(t->children[1]);
    base_free(t->links);
    base_free(t);
}
