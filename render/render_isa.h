/* The instruction set that frames use. A process has one (render_isa() in render.h), and the calling thread may be
 * limited to a lower one: all ranks of a picture use the highest that all of them have, because sets round differently,
 * and the cells on both sides of a face must not. */
#ifndef RENDER_RENDER_ISA_H
#define RENDER_RENDER_ISA_H

/* Return the process's set, as a cpu_isa; and limit the calling thread's frames to a set from now on. */
int render_isa_level(void);
void render_isa_limit(int level);

#endif
