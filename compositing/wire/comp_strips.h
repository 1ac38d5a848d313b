/* A rank's fragments by strip of the picture. */
#ifndef COMP_COMP_STRIPS_H
#define COMP_COMP_STRIPS_H

#include <stdbool.h>

#include "comp_grid.h"
#include "comp_sheet.h"
#include "error.h"
#include "fragment.h"

/* Fragments that follow each other in the list and are of one strip. */
typedef struct comp_range {
    uint32_t strip, first, count;
} comp_range;

typedef struct comp_strips {
    const comp_grid *grid;
    const fragment *items; /* borrowed */
    comp_range *ranges;    /* by strip */
    uint32_t *starts;      /* where the ranges of each strip begin, and one more */
} comp_strips;

/* Finds where in the list each strip's fragments are. The list and the grid must outlive out. A pixel beyond the
 * picture is an error. Local. */
insitu_status comp_strips_make(const comp_grid *grid, const fragment_list *items, comp_strips *out, base_error *error);

void comp_strips_free(comp_strips *strips);

/* Counts the strip's fragments. */
int64_t comp_strips_count(const comp_strips *strips, uint32_t strip);

/* A thread's memory for comp_strips_sheets(). All zero: empty. */
typedef struct comp_layers {
    comp_sheet sheet;
    uint32_t ends[COMP_STRIP_PIXELS + 1]; /* the end of each pixel's fragments, in order */
    const fragment **order;
    int64_t capacity;
} comp_layers;

void comp_layers_free(comp_layers *layers);

/* Takes a sheet of so many fragments; false ends the walk. */
typedef bool comp_sheet_taker(void *state, const comp_sheet *sheet, int count);

/* Hands a strip's fragments over in sheets: the first of all pixels, then the second of those that have another, from
 * front to back. False: no memory, or the taker's. Local, and any number of threads at once. */
bool comp_strips_sheets(const comp_strips *strips, uint32_t strip, comp_layers *layers, comp_sheet_taker *take,
                        void *state);

#endif
