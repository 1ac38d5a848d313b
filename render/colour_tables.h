/* Colour tables as they were published. */
#ifndef RENDER_COLOUR_TABLES_H
#define RENDER_COLOUR_TABLES_H

#include <stdint.h>

enum { COLOUR_TABLE_SIZE = 256 };

/* COLOUR_TABLE_SIZE entries, sRGB of 16 bits a channel, red the highest of 48; NULL: none of this name is published so.
 */
const uint64_t *colour_published_table(const char *name);

#endif
