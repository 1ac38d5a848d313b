/* The table of loops of one instruction set, named COMP_SHEET_TABLE. CMakeLists.txt compiles this file once per
 * instruction set. */
#include "comp_sheet_blend.h"
#include "comp_sheet_rows.h"

const comp_sheet_loops COMP_SHEET_TABLE = {.plan = make_plan,
                                           .compress = compress_sheet,
                                           .expand = expand_sheet,
                                           .write = write_words,
                                           .read = read_words,
                                           .join = join_sheets,
                                           .finish = finish_pixels,
                                           .store = store_pixels};
