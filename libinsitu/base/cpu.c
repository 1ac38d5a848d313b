#include "cpu.h"

cpu_isa cpu_best_isa(void)
{
#if defined(__x86_64__)
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") &&
        __builtin_cpu_supports("avx512vl"))
        return CPU_AVX512;
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return CPU_AVX2;
    if (__builtin_cpu_supports("sse4.2")) return CPU_SSE42;
#endif
    return CPU_PLAIN;
}

const char *cpu_isa_name(cpu_isa isa)
{
    static const char *const names[CPU_ISA_COUNT] = {"plain", "sse4.2", "avx2", "avx512"};
    return names[isa];
}
