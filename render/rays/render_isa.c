#include "render_isa.h"
#include "kernel_types.h"
#include "render_kernels.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cpu.h"

static pthread_once_t once = PTHREAD_ONCE_INIT;
static cpu_isa chosen;
static _Thread_local int limit = CPU_ISA_COUNT - 1;
static char warning[160];

static void choose(void)
{
    const char *query = getenv("INSITU_ISA");
    const cpu_isa best = cpu_best_isa();
    chosen = best;
    if (!query || !*query) return;
    for (int i = 0; i < CPU_ISA_COUNT; i++) {
        if (strcmp(query, cpu_isa_name((cpu_isa)i)) != 0) continue;
        if (i <= (int)best) {
            chosen = (cpu_isa)i;
            return;
        }
        snprintf(warning, sizeof warning, "INSITU_ISA=%s: this machine has %s at best, which is used", query,
                 cpu_isa_name(best));
        return;
    }
    snprintf(warning, sizeof warning, "INSITU_ISA=%.40s is none of avx512, avx2, sse4.2, plain: %s is used", query,
             cpu_isa_name(best));
}

const kernel_table *render_kernels(void)
{
#if defined(RENDER_HAS_X86)
    const int level = render_isa_level() < limit ? render_isa_level() : limit;
    if (level == CPU_AVX512) return &kernel_table_avx512;
    if (level == CPU_AVX2) return &kernel_table_avx2;
    if (level == CPU_SSE42) return &kernel_table_sse42;
#endif
    return &kernel_table_plain;
}

int render_isa_level(void)
{
    pthread_once(&once, choose);
    return (int)chosen;
}

void render_isa_limit(int level)
{
    limit = level;
}

const char *render_isa(void)
{
    pthread_once(&once, choose);
    return cpu_isa_name(chosen);
}

const char *render_isa_warning(void)
{
    pthread_once(&once, choose);
    return warning;
}
