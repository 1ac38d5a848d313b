/* Which instruction set frames use. A process has one (render_isa() in render.h), and the calling thread may be held to
 * a lower one: the ranks of a picture take the highest that all have, since sets differ in roundings, and cells on two
 * sides of a face must not. */
#ifndef RENDER_RENDER_ISA_H
#define RENDER_RENDER_ISA_H

/* The process's set, as a cpu_isa; and the highest that the calling thread's frames may use from now on. */
int render_isa_level(void);
void render_isa_limit(int level);

#endif
