/* Colour tables as they were published. */
#ifndef RENDER_COLOUR_TABLES_H
#define RENDER_COLOUR_TABLES_H

#include <stdint.h>

enum { COLOUR_TABLE_SIZE = 256 };

/* Returns COLOUR_TABLE_SIZE entries, sRGB of 16 bits per channel, red the highest of 48; NULL if no table of this name
 * has been published. */
const uint64_t *colour_published_table(const char *name);

#endif
