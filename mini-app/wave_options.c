/* Options are parsed by getopt_long(). Each option is a row of a table, and is either a flag or has a function that
 * reads its value. */
#include "wave_options.h"

#include <errno.h>
#include <getopt.h>
#include <limits.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char help_text[] =
    "insitu-wave: a wave from a point source through layers, drawn while it runs\n"
    "\n"
    "  mpirun -n 4 insitu-wave [options]\n"
    "\n"
    "  --cells KIND        tet (default), hex, wedge, pyramid, mixed\n"
    "  --size N | X,Y,Z    cubes of the lattice that the cells are cut from (40)\n"
    "  --steps N           time steps (400)\n"
    "  --precision TYPE    float (default) or double: computed on and handed over\n"
    "  --index TYPE        int32 (default) or int64: of the connectivity\n"
    "  --layout HOW        aos (default): components interleaved; soa: an array each\n"
    "  --partition HOW     block (default), morton, random, checkerboard: of cubes onto ranks\n"
    "  --boundary HOW      absorb (default) or reflect\n"
    "  --order N           2 (default) or 1: of the scheme\n"
    "  --jitter A          inner vertices move by up to A edges, 0 to 0.3 (0)\n"
    "  --moving            vertices are drawn displaced by the wave\n"
    "  --swell S           how much --moving exaggerates (0.2)\n"
    "  --centring WHERE    cell (default) or vertex: of the fields handed over\n"
    "  --ghosts            hand over the halo cells too, flagged\n"
    "  --ids               hand over global vertex ids\n"
    "  --scene FILE        what to draw (examples/wave.yaml)\n"
    "  --no-insitu         simulate only\n"
    "  --help              this text\n"
    "\n"
    "Fields: pressure, velocity (3 components), speed (of sound). Errors of libinsitu are shown once each, and the\n"
    "simulation runs on to its end; the exit status is then 0. A wrong option is status 1.\n";

const char *wave_options_help(void)
{
    return help_text;
}

typedef struct option_row option_row;
struct option_row {
    const char *name;
    bool (*read)(const option_row *row, const char *value,
                 void *field); /* function that reads the option's value; NULL for a flag */
    size_t offset;
    const char *expected; /* description of the expected value for messages; if the option has a fixed set of values,
                             these are separated by '|' */
    const int *choice; /* for an option with a fixed set of values: the number that each value stands for; NULL means 0,
                          1, 2, ... */
    double low, high;
};

static bool read_choice(const option_row *row, const char *value, void *field)
{
    size_t length = strlen(value);
    const char *word = row->expected;
    for (int i = 0; word; ++i) {
        const char *end = strchr(word, '|');
        size_t word_length = end ? (size_t)(end - word) : strlen(word);
        if (word_length == length && strncmp(word, value, length) == 0) {
            *(int *)field = row->choice ? row->choice[i] : i;
            return true;
        }
        word = end ? end + 1 : NULL;
    }
    return false;
}

static bool read_number(const option_row *row, const char *value, void *field)
{
    char *end;
    double number = strtod(value, &end);
    if (end == value || *end || !(number >= row->low && number <= row->high)) return false;
    *(double *)field = number;
    return true;
}

static bool read_count(const char **text, double low, double high, int *out)
{
    char *end;
    errno = 0;
    long number = strtol(*text, &end, 10);
    if (end == *text || errno || (double)number < low || (double)number > high) return false;
    *out = (int)number;
    *text = end;
    return true;
}

static bool read_integer(const option_row *row, const char *value, void *field)
{
    return read_count(&value, row->low, row->high, field) && !*value;
}

static bool read_size(const option_row *row, const char *value, void *field)
{
    int *size = field;
    if (!read_count(&value, row->low, row->high, &size[0])) return false;
    size[1] = size[2] = size[0];
    if (!*value) return true;
    for (int a = 1; a < 3; ++a) {
        if (*value++ != ',' || !read_count(&value, row->low, row->high, &size[a])) return false;
    }
    return !*value;
}

static bool read_text(const option_row *row, const char *value, void *field)
{
    (void)row;
    *(const char **)field = value;
    return *value != 0;
}

static const int of_bytes[] = {4, 8};
static const int of_order[] = {1, 2};

/* The values as they are parsed. Choices are stored as int, and converted to enums and bools afterwards. */
typedef struct raw_options {
    int cells, partition, real_bytes, index_bytes, is_soa, reflecting, order, at_vertices, steps, size[3];
    double jitter, swell;
    const char *scene;
    bool moving, ghosts, ids, no_insitu, help;
} raw_options;

#define AT(field) offsetof(raw_options, field)

static const option_row rows[] = {
    {"cells", read_choice, AT(cells), "tet|hex|wedge|pyramid|mixed", NULL, 0, 0},
    {"size", read_size, AT(size), "N or X,Y,Z, each 1 to 8192", NULL, 1, 8192},
    {"steps", read_integer, AT(steps), "0 to 1000000000", NULL, 0, 1e9},
    {"precision", read_choice, AT(real_bytes), "float|double", of_bytes, 0, 0},
    {"index", read_choice, AT(index_bytes), "int32|int64", of_bytes, 0, 0},
    {"layout", read_choice, AT(is_soa), "aos|soa", NULL, 0, 0},
    {"partition", read_choice, AT(partition), "block|morton|random|checkerboard", NULL, 0, 0},
    {"boundary", read_choice, AT(reflecting), "absorb|reflect", NULL, 0, 0},
    {"order", read_choice, AT(order), "1|2", of_order, 0, 0},
    {"jitter", read_number, AT(jitter), "a number from 0 to 0.3", NULL, 0, 0.3},
    {"swell", read_number, AT(swell), "a number from 0 to 10", NULL, 0, 10},
    {"centring", read_choice, AT(at_vertices), "cell|vertex", NULL, 0, 0},
    {"scene", read_text, AT(scene), "a file", NULL, 0, 0},
    {"moving", NULL, AT(moving), NULL, NULL, 0, 0},
    {"ghosts", NULL, AT(ghosts), NULL, NULL, 0, 0},
    {"ids", NULL, AT(ids), NULL, NULL, 0, 0},
    {"no-insitu", NULL, AT(no_insitu), NULL, NULL, 0, 0},
    {"help", NULL, AT(help), NULL, NULL, 0, 0},
};

enum { ROW_COUNT = sizeof rows / sizeof *rows };

/* Fills getopt_long()'s table of options. For the option in row i of `rows`, getopt_long() returns i + 1, because it
 * uses the result 0 for other purposes. */
static void list_options(struct option list[ROW_COUNT + 1])
{
    for (int i = 0; i < ROW_COUNT; ++i)
        list[i] = (struct option){rows[i].name, rows[i].read ? required_argument : no_argument, NULL, i + 1};
    list[ROW_COUNT] = (struct option){0};
}

static bool read_option(const option_row *row, raw_options *raw, char *message, size_t size)
{
    void *field = (char *)raw + row->offset;
    if (!row->read)
        *(bool *)field = true;
    else if (!row->read(row, optarg, field)) {
        snprintf(message, size, "--%s: expected %s, got %s", row->name, row->expected, optarg);
        return false;
    }
    return true;
}

/* Writes a message about an option that getopt_long() rejects; optopt is the row plus 1 if the option is known. */
static void describe_error(int found, const char *argument, char *message, size_t size)
{
    if (optopt > ROW_COUNT) /* getopt_long() found an unknown letter, as in "-abc" */
        snprintf(message, size, "-%c: no such option; --help lists them", optopt);
    else if (optopt < 1)
        snprintf(message, size, "%s: no such option; --help lists them", argument);
    else if (found == ':')
        snprintf(message, size, "--%s: expected %s, got nothing", rows[optopt - 1].name, rows[optopt - 1].expected);
    else
        snprintf(message, size, "--%s takes no value", rows[optopt - 1].name);
}

/* Parses the options. getopt_long() must not print messages, because every rank would print them. */
static bool read_options(int argc, char **argv, raw_options *raw, char *message, size_t size)
{
    struct option list[ROW_COUNT + 1];
    list_options(list);
    opterr = 0;
    optind = 0; /* resets getopt_long() in case it was used before */
    int found;
    while ((found = getopt_long(argc, argv, ":", list, NULL)) != -1) {
        if (found == ':' || found == '?') {
            describe_error(found, argv[optind - 1], message, size);
            return false;
        }
        if (!read_option(&rows[found - 1], raw, message, size)) return false;
    }
    if (optind == argc) return true;
    snprintf(message, size, "%s: no such option; --help lists them", argv[optind]);
    return false;
}

bool wave_options_parse(int argc, char **argv, wave_options *options, char *message, int message_size)
{
    raw_options raw = {.steps = 400,
                       .size = {40, 40, 40},
                       .real_bytes = 4,
                       .index_bytes = 4,
                       .order = 2,
                       .swell = 0.2,
                       .scene = "examples/wave.yaml"};
    if (!read_options(argc, argv, &raw, message, (size_t)message_size)) return false;
    *options = (wave_options){
        .cells = (wave_cells)raw.cells,
        .size = {raw.size[0], raw.size[1], raw.size[2]},
        .steps = raw.steps,
        .real_bytes = raw.real_bytes,
        .index_bytes = raw.index_bytes,
        .is_soa = raw.is_soa != 0,
        .partition = (wave_partition_kind)raw.partition,
        .reflecting = raw.reflecting != 0,
        .order = raw.order,
        .jitter = raw.jitter,
        .moving = raw.moving,
        .swell = raw.swell,
        .ghosts = raw.ghosts,
        .ids = raw.ids,
        .at_vertices = raw.at_vertices != 0,
        .scene = raw.no_insitu ? NULL : raw.scene,
        .help = raw.help,
    };
    return true;
}
