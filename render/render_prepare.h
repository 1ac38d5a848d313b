/* From a job to the constants of a frame. */
#ifndef RENDER_RENDER_PREPARE_H
#define RENDER_RENDER_PREPARE_H

#include "kernel_types.h"

/* Check the job and fill frame; frame->surfaces is memory of base_alloc(), the caller's to free. */
insitu_status render_prepare(const render_job *job, kernel_frame *frame, base_error *error);

#endif
