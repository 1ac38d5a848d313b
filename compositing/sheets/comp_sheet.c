#include "comp_sheet.h"

#include "comp_sheet_loops.h"

enum { OPAQUE_BIT = 31 };

_Static_assert(sizeof(comp_sheet_head) == COMP_SHEET_HEAD, "heads have no padding");

const comp_sheet_loops *comp_sheet_loops_of(cpu_isa isa)
{
#if defined(__x86_64__)
    if (isa == CPU_AVX512) return &comp_sheet_avx512;
    if (isa >= CPU_SSE42) return &comp_sheet_sse42;
#endif
    (void)isa;
    return &comp_sheet_plain;
}

/* Plans how to pack a sheet of which few pixels have values: its `count` values are first moved together, so that they
 * fill rows of 16 without gaps. This saves time, because a row with few values takes as long to pack as a full one. */
static void plan_rows_without_gaps(int count, sheet_plan *plan)
{
    plan->rows = (count + COMP_LANES - 1) / COMP_LANES;
    plan->count = count;
    for (int i = 0; i < plan->rows; i++) {
        const int left = count - i * COMP_LANES;
        plan->row[i] = (uint8_t)i;
        plan->number[i] = (uint8_t)(left < COMP_LANES ? left : COMP_LANES);
        plan->mask[i] = (uint16_t)((1u << plan->number[i]) - 1);
        plan->fresh[i] = 0;
    }
}

size_t comp_sheet_max_bytes(int pixels, int words)
{
    return COMP_SHEET_HEAD + COMP_ROWS * sizeof(uint16_t) +
           (size_t)words * (sizeof(uint32_t) * (size_t)(pixels + 1) + COMP_ROWS / 2) + COMP_SHEET_SLACK;
}

int comp_sheet_count_pixels(const comp_sheet *sheet)
{
    uint64_t masks[COMP_ROWS / 4];
    int count = 0;
    memcpy(masks, sheet->masks, sizeof masks);
    for (int i = 0; i < COMP_ROWS / 4; i++) count += __builtin_popcountll(masks[i]);
    return count;
}

unsigned char *comp_sheet_write_by(cpu_isa isa, const comp_sheet *sheet, int words, unsigned char *out)
{
    const comp_sheet_loops *const loops = comp_sheet_loops_of(isa);
    sheet_plan plan;
    unsigned char *at = out + COMP_SHEET_HEAD;
    comp_sheet_head head = {.strip = sheet->strip};
    loops->plan(sheet->masks, &plan);
    for (int i = 0; i < plan.rows; i++) {
        head.rows |= 1u << plan.row[i];
        if (plan.mask[i] == 0xffff) {
            head.full |= 1u << plan.row[i];
        } else {
            memcpy(at, &plan.mask[i], sizeof plan.mask[i]);
            at += sizeof plan.mask[i];
        }
    }
    head.count = (uint16_t)plan.count;
    if (plan.is_sparse) {
        comp_sheet compact;
        sheet_plan compact_plan;
        loops->compress(sheet, &plan, words, &compact);
        plan_rows_without_gaps(plan.count, &compact_plan);
        at = loops->write(&compact, &compact_plan, words, &head.kinds, at);
    } else if (plan.count) {
        at = loops->write(sheet, &plan, words, &head.kinds, at);
    }
    head.kinds |= (uint32_t)sheet->is_opaque << OPAQUE_BIT;
    head.bytes = (uint16_t)(at - out);
    memcpy(out, &head, sizeof head);
    return at;
}

/* Reads the row masks that follow the header; returns the position of the first word. */
static const unsigned char *read_masks(const unsigned char *in, const comp_sheet_head *head, uint16_t masks[COMP_ROWS])
{
    in += COMP_SHEET_HEAD;
    for (int r = 0; r < COMP_ROWS; r++) {
        masks[r] = head->full >> r & 1 ? 0xffff : 0;
        if (!((head->rows & ~head->full) >> r & 1)) continue;
        memcpy(&masks[r], in, sizeof masks[r]);
        in += sizeof masks[r];
    }
    return in;
}

const unsigned char *comp_sheet_read_head(const unsigned char *in, comp_sheet_head *head)
{
    memcpy(head, in, sizeof *head);
    return in + head->bytes;
}

const unsigned char *comp_sheet_read_by(cpu_isa isa, const unsigned char *in, int words, comp_sheet *sheet)
{
    const comp_sheet_loops *const loops = comp_sheet_loops_of(isa);
    comp_sheet_head head;
    sheet_plan plan;
    const unsigned char *const end = comp_sheet_read_head(in, &head), *const at = read_masks(in, &head, sheet->masks);
    sheet->strip = head.strip;
    sheet->is_opaque = head.kinds >> OPAQUE_BIT;
    loops->plan(sheet->masks, &plan);
    if (plan.is_sparse) {
        comp_sheet compact;
        sheet_plan compact_plan;
        plan_rows_without_gaps(plan.count, &compact_plan);
        loops->read(at, &compact_plan, head.kinds, words, &compact);
        loops->expand(&compact, &plan, words, sheet);
    } else if (plan.count) {
        loops->read(at, &plan, head.kinds, words, sheet);
    }
    return end;
}

unsigned char *comp_sheet_write(const comp_sheet *sheet, int words, unsigned char *out)
{
    return comp_sheet_write_by(cpu_best_isa(), sheet, words, out);
}

const unsigned char *comp_sheet_read(const unsigned char *in, int words, comp_sheet *sheet)
{
    return comp_sheet_read_by(cpu_best_isa(), in, words, sheet);
}

void comp_sheet_join(comp_sheet *all, const comp_sheet *other, uint16_t left[COMP_ROWS])
{
    comp_sheet_loops_of(cpu_best_isa())->join(all, other, left);
}

void comp_sheet_finish(const comp_sheet *fragments, const float background[4], comp_sheet *pixels)
{
    comp_sheet_loops_of(cpu_best_isa())->finish(fragments, background, pixels);
}

void comp_sheet_store(const comp_sheet *pixels, const comp_grid *grid, const float background[4], image *out)
{
    const comp_area area = comp_find_strip_area(grid, pixels->strip);
    comp_sheet_loops_of(cpu_best_isa())->store(pixels, &area, background, out);
}
