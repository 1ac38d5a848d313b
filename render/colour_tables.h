/* Colour tables that were published as tables. */
#ifndef RENDER_COLOUR_TABLES_H
#define RENDER_COLOUR_TABLES_H

#include <stdint.h>

enum { COLOUR_TABLE_SIZE = 256 };

/* Returns COLOUR_TABLE_SIZE entries in sRGB with 16 bits per channel, red in the highest of the lower 48 bits; NULL if
 * there is no published table of this name. */
const uint64_t *colour_published_table(const char *name);

#endif
