/* Finished pixels of all owners to rank 0. */
#ifndef COMP_COMP_GATHER_H
#define COMP_COMP_GATHER_H

#include <mpi.h>

#include "comp_pixels.h"

/* Pixels in one message: 768 KiB, of which rank 0 holds a few at a time. */
enum { comp_message_pixels = 1 << 15 };

/* Collective. Rank 0 stores what the others send in out; its own pixels are there already. Returns the same status on
 * all ranks. *sent_bytes grows by what went to rank 0. */
insitu_status comp_gather(MPI_Comm comm, const comp_pixel_list *finished, int64_t message_pixels, image *out,
                          int64_t *sent_bytes, base_error *error);

#endif
