/* Makes the fragments of the strips that a rank owns into finished pixels. */
#ifndef COMP_COMP_OWNED_H
#define COMP_COMP_OWNED_H

#include "comp_mail.h"
#include "comp_pack.h"
#include "comp_pixels.h"
#include "comp_strips.h"

/* The strips of one place. */
typedef struct comp_owned {
    const comp_strips *own; /* this rank's own fragments */
    comp_arrivals arrivals; /* those of others */
    const comp_owners *owners;
    int place;
} comp_owned;

/* Merges all fragments of the strips. Where merged->out is given, it gets their pixels, and the background where nobody
 * has anything; otherwise *finished gets messages for the parent's rank. Local; on an error *finished is empty, and out
 * may have some of the pixels. */
insitu_status comp_owned_merge(const comp_owned *owned, const comp_merged *merged, int parent, comp_messages *finished,
                               base_error *error);

#endif
