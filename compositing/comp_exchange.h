/* How fragments reach the owners of their pixels. */
#ifndef COMP_COMP_EXCHANGE_H
#define COMP_COMP_EXCHANGE_H

#include <mpi.h>

#include "comp_schedule.h"
#include "error.h"
#include "fragment.h"

/* Fragments in one message: 512 MiB, well below the 2^31 bytes at which some transports fail. */
enum { comp_message_fragments = 1 << 24 };

/* Collective: direct send. items is reordered; *owned becomes all ranks' fragments of the pixels this rank owns, in
 * memory of its own (base_free()), own ones copied and not sent. Messages hold at most message_fragments. Returns the
 * same status on all ranks; on an error *owned is left alone. *sent_bytes grows by what went to other ranks. */
insitu_status comp_exchange_direct(MPI_Comm comm, const comp_layout *layout, fragment_list *items,
                                   int64_t message_fragments, fragment_list *owned, int64_t *sent_bytes,
                                   base_error *error);

#endif
