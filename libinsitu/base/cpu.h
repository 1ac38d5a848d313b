/* Determines the instruction sets that this machine supports. */
#ifndef BASE_CPU_H
#define BASE_CPU_H

typedef enum cpu_isa { CPU_PLAIN = 0, CPU_SSE42 = 1, CPU_AVX2 = 2, CPU_AVX512 = 3, CPU_ISA_COUNT = 4 } cpu_isa;

/* Returns the best instruction set that the machine and its operating system support. CPU_AVX2
 * requires FMA too; CPU_AVX512 requires the extensions F, DQ, BW and VL. */
cpu_isa cpu_best_isa(void);

/* Returns the name of an instruction set: "plain", "sse4.2", "avx2" or "avx512". */
const char *cpu_isa_name(cpu_isa isa);

#endif
