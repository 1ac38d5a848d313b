/* Selects the instruction set that frames use. It is the process's instruction set (render_isa() in render.h), unless
 * the calling thread has been limited to a lower one. All ranks that draw a picture together must use the same set, the
 * highest that all of them have. The reason: results are rounded differently with different sets, and the cells on both
 * sides of a face, which may be on different ranks, must give bit-identical crossings. */
#ifndef RENDER_RENDER_ISA_H
#define RENDER_RENDER_ISA_H

/* render_isa_level() returns the process's instruction set as a value of the enum cpu_isa. render_isa_limit() limits
 * later frames of the calling thread to at most the given set. */
int render_isa_level(void);
void render_isa_limit(int level);

#endif
