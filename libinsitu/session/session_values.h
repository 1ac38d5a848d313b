/* Have a field's values changed, as the caller says? */
#ifndef SESSION_VALUES_H
#define SESSION_VALUES_H

#include "session.h"

/* For every scalar that an image of this step uses and that was set anew: what depends on its values is stale only
 * where they are other values. A checksum of 64 bits decides, which reads them once, at the speed of memory. Local. */
void session_settle_values(insitu_session *session);

#endif
