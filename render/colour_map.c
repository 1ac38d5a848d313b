/* The colour tables are computed at first use. Some are copies of published tables (colour_tables.c). Those of
 * ColorBrewer are interpolated linearly in sRGB between the published colours, as matplotlib does. cool_to_warm is
 * Moreland's formula in Msh, the polar form of CIELAB: it leads through a neutral colour in the middle, at which no
 * edge is visible. */
#include "colour_map.h"

#include <pthread.h>
#include <string.h>

#include "colour_space.h"
#include "colour_tables.h"

enum { most_keys = 11 };

typedef float colour_table[COLOUR_TABLE_SIZE][3];

/* A palette of ColorBrewer, with the largest number of colours that ColorBrewer offers for it. Specifications by
 * Cynthia Brewer, colorbrewer.org (Apache-2.0; the file NOTICE has the licence's text). */
typedef struct brewer_palette {
    const char *name;
    int key_count;
    unsigned keys[most_keys];
} brewer_palette;

/* clang-format off */
static const brewer_palette palettes[] = {
    {"greys", 9, {0xffffff, 0xf0f0f0, 0xd9d9d9, 0xbdbdbd, 0x969696, 0x737373, 0x525252, 0x252525, 0x000000}},
    {"blues", 9, {0xf7fbff, 0xdeebf7, 0xc6dbef, 0x9ecae1, 0x6baed6, 0x4292c6, 0x2171b5, 0x08519c, 0x08306b}},
    {"greens", 9, {0xf7fcf5, 0xe5f5e0, 0xc7e9c0, 0xa1d99b, 0x74c476, 0x41ab5d, 0x238b45, 0x006d2c, 0x00441b}},
    {"oranges", 9, {0xfff5eb, 0xfee6ce, 0xfdd0a2, 0xfdae6b, 0xfd8d3c, 0xf16913, 0xd94801, 0xa63603, 0x7f2704}},
    {"purples", 9, {0xfcfbfd, 0xefedf5, 0xdadaeb, 0xbcbddc, 0x9e9ac8, 0x807dba, 0x6a51a3, 0x54278f, 0x3f007d}},
    {"reds", 9, {0xfff5f0, 0xfee0d2, 0xfcbba1, 0xfc9272, 0xfb6a4a, 0xef3b2c, 0xcb181d, 0xa50f15, 0x67000d}},
    {"yellow_green_blue", 9,
     {0xffffd9, 0xedf8b1, 0xc7e9b4, 0x7fcdbb, 0x41b6c4, 0x1d91c0, 0x225ea8, 0x253494, 0x081d58}},
    {"yellow_orange_red", 9,
     {0xffffcc, 0xffeda0, 0xfed976, 0xfeb24c, 0xfd8d3c, 0xfc4e2a, 0xe31a1c, 0xbd0026, 0x800026}},
    {"red_blue", 11,
     {0x67001f, 0xb2182b, 0xd6604d, 0xf4a582, 0xfddbc7, 0xf7f7f7, 0xd1e5f0, 0x92c5de, 0x4393c3, 0x2166ac, 0x053061}},
    {"red_yellow_blue", 11,
     {0xa50026, 0xd73027, 0xf46d43, 0xfdae61, 0xfee090, 0xffffbf, 0xe0f3f8, 0xabd9e9, 0x74add1, 0x4575b4, 0x313695}},
    {"red_yellow_green", 11,
     {0xa50026, 0xd73027, 0xf46d43, 0xfdae61, 0xfee08b, 0xffffbf, 0xd9ef8b, 0xa6d96a, 0x66bd63, 0x1a9850, 0x006837}},
    {"spectral", 11,
     {0x9e0142, 0xd53e4f, 0xf46d43, 0xfdae61, 0xfee08b, 0xffffbf, 0xe6f598, 0xabdda4, 0x66c2a5, 0x3288bd, 0x5e4fa2}},
    {"brown_teal", 11,
     {0x543005, 0x8c510a, 0xbf812d, 0xdfc27d, 0xf6e8c3, 0xf5f5f5, 0xc7eae5, 0x80cdc1, 0x35978f, 0x01665e, 0x003c30}},
    {"orange_purple", 11,
     {0x7f3b08, 0xb35806, 0xe08214, 0xfdb863, 0xfee0b6, 0xf7f7f7, 0xd8daeb, 0xb2abd2, 0x8073ac, 0x542788, 0x2d004b}},
    {"purple_green", 11,
     {0x40004b, 0x762a83, 0x9970ab, 0xc2a5cf, 0xe7d4e8, 0xf7f7f7, 0xd9f0d3, 0xa6dba0, 0x5aae61, 0x1b7837, 0x00441b}},
};
/* clang-format on */

#define NAME(word, name) name,
static const char *const names[COLOUR_MAP_COUNT] = {COLOUR_MAPS(NAME)};
static colour_table tables[COLOUR_MAP_COUNT];

float colour_linear_from_srgb(float srgb)
{
    return (float)colour_linear_from_srgb_double(srgb);
}

static void fill_published(colour_table table, const uint64_t *codes)
{
    for (int i = 0; i < COLOUR_TABLE_SIZE; i++)
        for (int c = 0; c < 3; c++)
            table[i][c] = (float)colour_linear_from_srgb_double((double)(codes[i] >> (32 - 16 * c) & 65535) / 65535);
}

static double channel_of(unsigned colour, int channel)
{
    return (colour >> (16 - 8 * channel) & 255) / 255.0;
}

static void fill_palette(colour_table table, const brewer_palette *palette)
{
    const int last = palette->key_count - 1;
    for (int i = 0; i < COLOUR_TABLE_SIZE; i++) {
        const double x = (double)(i * last) / (COLOUR_TABLE_SIZE - 1);
        const int key = x < last ? (int)x : last - 1;
        for (int c = 0; c < 3; c++) {
            const double low = channel_of(palette->keys[key], c), high = channel_of(palette->keys[key + 1], c);
            table[i][c] = (float)colour_linear_from_srgb_double(low + (x - key) * (high - low));
        }
    }
}

/* Fills a table from one saturated colour to another, by Moreland's interpolation through a neutral colour in the
 * middle. */
static void fill_diverging(colour_table table, unsigned low, unsigned high)
{
    double ends[2][3];
    for (int c = 0; c < 3; c++) ends[0][c] = channel_of(low, c), ends[1][c] = channel_of(high, c);
    for (int i = 0; i < COLOUR_TABLE_SIZE; i++)
        colour_between(COLOUR_DIVERGING, ends[0], ends[1], (double)i / (COLOUR_TABLE_SIZE - 1), table[i]);
}

static void fill_grey(colour_table table)
{
    for (int i = 0; i < COLOUR_TABLE_SIZE; i++)
        for (int c = 0; c < 3; c++)
            table[i][c] = (float)colour_linear_from_srgb_double((double)i / (COLOUR_TABLE_SIZE - 1));
}

static const brewer_palette *find_palette(const char *name)
{
    for (size_t i = 0; i < sizeof palettes / sizeof *palettes; i++)
        if (strcmp(name, palettes[i].name) == 0) return &palettes[i];
    return NULL;
}

static void fill_tables(void)
{
    for (int map = 0; map < COLOUR_MAP_COUNT; map++) {
        const uint64_t *published = colour_published_table(names[map]);
        const brewer_palette *palette = find_palette(names[map]);
        if (published)
            fill_published(tables[map], published);
        else if (palette)
            fill_palette(tables[map], palette);
        else if (map == COLOUR_MAP_COOL_TO_WARM)
            fill_diverging(tables[map], 0x3b4cc0, 0xb40426);
        else
            fill_grey(tables[map]);
    }
}

const float *colour_map_table(const char *name, int *colour_count)
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    pthread_once(&once, fill_tables);
    for (int map = 0; map < COLOUR_MAP_COUNT; map++) {
        if (strcmp(name, names[map]) != 0) continue;
        *colour_count = COLOUR_TABLE_SIZE;
        return tables[map][0];
    }
    return NULL;
}
