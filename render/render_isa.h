/* Selects the instruction set that frames use. A process has one (render_isa() in render.h), and the calling thread may
 * be limited to a lower one. All ranks of a picture must use the same set, the highest that all of them have, because
 * sets round differently, and the cells on both sides of a face must give the same bits. */
#ifndef RENDER_RENDER_ISA_H
#define RENDER_RENDER_ISA_H

/* render_isa_level() returns the process's instruction set as a value of the enum cpu_isa. render_isa_limit() limits
 * later frames of the calling thread to at most the given set. */
int render_isa_level(void);
void render_isa_limit(int level);

#endif
