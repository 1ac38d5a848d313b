#include "render_thread.h"

#include "memory.h"
#include "render_polyhedra.h"

bool render_thread_begin(const kernel_frame *frame, const kernel_table *kernels, kernel_thread *thread)
{
    if (thread->memory || thread->out_of_memory) return !thread->out_of_memory;
    thread->memory = base_alloc(kernels->memory_bytes);
    if (frame->has_polyhedra) thread->polyhedra = polyhedra_create();
    thread->out_of_memory = !thread->memory || (frame->has_polyhedra && !thread->polyhedra);
    if (!thread->out_of_memory) kernels->begin(thread);
    return !thread->out_of_memory;
}

void render_thread_end(kernel_thread *thread)
{
    polyhedra_free(thread->polyhedra);
    base_free(thread->out.items);
    base_free(thread->memory);
    base_free(thread->bin.buffer);
    base_free(thread->volume_bin.buffer);
    base_free(thread->waiting.items);
    base_free(thread->waiting.shadings);
}
