/* Checks that if memory runs out while a picture is written, the result is an error or the correct file, and that the
 * next picture is written correctly. The image library fills tables when it writes its first picture, so each attempt
 * has its own process. */
#define _GNU_SOURCE 1 /* for memmem() */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include <dirent.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "failing_heap.h"
#include "session_image.h"

enum { WIDTH = 40, HEIGHT = 30, MOST_BYTES = 1 << 17, SECONDS = 60 };

static const char *folder = "test_image_memory_files";
static int stride = 41; /* distance between the indices of allocations that fail */
static float rgba[4 * WIDTH * HEIGHT], depth[WIDTH * HEIGHT];

typedef struct picture_case {
    const char *name;
    insitu_image_format format;
    bool has_depth, is_decorated;
} picture_case;

enum { MOST_SAMPLES = 3 };
static insitu_deep_sample samples[MOST_SAMPLES * WIDTH * HEIGHT];
static int64_t first_sample[WIDTH * HEIGHT];
static uint32_t sample_counts[WIDTH * HEIGHT];

static const picture_case cases[] = {{"a.png", INSITU_PNG8, false, false},
                                     {"b.png", INSITU_PNG16, false, false},
                                     {"c.exr", INSITU_EXR, true, false},
                                     {"d.png", INSITU_PNG8, false, true},
                                     {"e.exr", INSITU_DEEP_EXR, false, false}};

typedef struct file_bytes {
    size_t count;
    unsigned char bytes[MOST_BYTES];
} file_bytes;

static void make_picture_path(const picture_case *c, char path[1024])
{
    snprintf(path, 1024, "%s/%s", folder, c->name);
}

static insitu_status write_picture(const picture_case *c, base_error *error)
{
    static const insitu_words words[] = {{"Words", INSITU_TOP, 1}};
    static const float colours[] = {1, 0, 0, 0, 0, 1};
    static const insitu_tick ticks[] = {{0.5, "1.5"}};
    static const insitu_colour_bar bar = {
        .label = "f", .colours = colours, .colour_count = 2, .at = INSITU_RIGHT, .tick_count = 1, .ticks = ticks};
    static const insitu_decorations decorations = {.background = {0, 0, 0, 1},
                                                   .colour = {1, 1, 1},
                                                   .size = 0.1,
                                                   .words_count = 1,
                                                   .words = words,
                                                   .bar_count = 1,
                                                   .bars = &bar,
                                                   .has_axes = true};
    const insitu_deep deep = {samples, first_sample, sample_counts};
    const insitu_image image = {.width = WIDTH,
                                .height = HEIGHT,
                                .rgba = rgba,
                                .depth = c->has_depth ? depth : NULL,
                                .decorations = c->is_decorated ? &decorations : NULL,
                                .deep = &deep};
    char path[1024];
    make_picture_path(c, path);
    *error = (base_error){0};
    return session_write_image(&image, c->format, path, error);
}

/* Clears the time of writing in the file's header. EXR stores it as a text after the text's length, to the second. */
static void clear_date(file_bytes *file)
{
    static const char before[] = "capDate\0string";
    enum { DATE = 19 };
    unsigned char *at = memmem(file->bytes, file->count, before, sizeof before);
    if (at) memset(at + sizeof before + 4, 0, DATE);
}

static bool read_picture(const picture_case *c, file_bytes *out)
{
    char path[1024];
    make_picture_path(c, path);
    FILE *file = fopen(path, "rb");
    out->count = file ? fread(out->bytes, 1, MOST_BYTES, file) : 0;
    if (file) fclose(file);
    clear_date(out);
    return file;
}

static bool is_same(const file_bytes *a, const file_bytes *b)
{
    return a->count == b->count && !memcmp(a->bytes, b->bytes, a->count);
}

static int count_files(void)
{
    DIR *entries = opendir(folder);
    int count = 0;
    for (const struct dirent *e; entries && (e = readdir(entries));)
        count += strcmp(e->d_name, ".") && strcmp(e->d_name, "..");
    if (entries) closedir(entries);
    return count;
}

static void remove_picture(const picture_case *c)
{
    char path[1024];
    make_picture_path(c, path);
    unlink(path);
}

/* ---- one process for each attempt ------------------------------------------------------------------------------ */

typedef enum verdict { GOOD, REFUSED, OTHER_PICTURE, OTHER_ERROR, LEFT_FILES, NEXT_FAILED } verdict;

typedef struct outcome {
    verdict verdict;
    int64_t allocations;
    char message[256];
} outcome;

/* A shortage of memory. n: index of the allocation that fails by the failing heap; if n is 0, the address space of the
 * process is limited to its present size plus `spare` bytes. */
typedef struct shortage {
    int64_t n;
    rlim_t spare;
} shortage;

static rlim_t read_address_space_size(void)
{
    long pages = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    if (file && fscanf(file, "%ld", &pages) != 1) pages = 0;
    if (file) fclose(file);
    return (rlim_t)pages * (rlim_t)sysconf(_SC_PAGESIZE);
}

static insitu_status write_in_shortage(const picture_case *c, const shortage *s, outcome *out)
{
    struct rlimit before, tight;
    base_error error;
    getrlimit(RLIMIT_AS, &before);
    tight = before;
    tight.rlim_cur = read_address_space_size() + s->spare;
    if (s->n)
        heap_start_failing(s->n, false);
    else
        setrlimit(RLIMIT_AS, &tight);
    const insitu_status status = write_picture(c, &error);
    if (s->n) out->allocations = heap_stop_failing();
    setrlimit(RLIMIT_AS, &before);
    snprintf(out->message, sizeof out->message, "%.255s", error.message);
    return status;
}

static verdict classify_outcome(const picture_case *c, const file_bytes *expected, const shortage *s, outcome *out)
{
    static file_bytes found;
    const insitu_status status = write_in_shortage(c, s, out);
    const bool is_there = read_picture(c, &found);
    if (status == INSITU_OK && !(is_there && is_same(&found, expected))) return OTHER_PICTURE;
    if (status != INSITU_OK && is_there) return OTHER_PICTURE;
    if (status != INSITU_OK && status != INSITU_ERROR_MEMORY && status != INSITU_ERROR_IO) return OTHER_ERROR;
    if (count_files() != is_there) return LEFT_FILES;
    base_error error;
    if (write_picture(c, &error) || !read_picture(c, &found) || !is_same(&found, expected)) {
        snprintf(out->message, sizeof out->message, "%.255s", error.message);
        return NEXT_FAILED;
    }
    return status ? REFUSED : GOOD;
}

/* Writes the picture in a child process. Returns false if a signal terminated the child. */
static bool try_in_child(const picture_case *c, const file_bytes *expected, const shortage *s, outcome *out)
{
    int pipe_ends[2], status = 0;
    assert_int_equal(pipe(pipe_ends), 0);
    const pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        const struct rlimit no_core = {0, 0};
        setrlimit(RLIMIT_CORE, &no_core);
        alarm(SECONDS);
        outcome mine = {0};
        mine.verdict = classify_outcome(c, expected, s, &mine);
        _exit(write(pipe_ends[1], &mine, sizeof mine) == (ssize_t)sizeof mine ? 0 : 1);
    }
    close(pipe_ends[1]);
    const bool is_reported = read(pipe_ends[0], out, sizeof *out) == (ssize_t)sizeof *out;
    close(pipe_ends[0]);
    waitpid(child, &status, 0);
    remove_picture(c);
    return is_reported && WIFEXITED(status);
}

static void write_expected_file(const picture_case *c, file_bytes *expected)
{
    const pid_t child = fork();
    base_error error;
    assert_true(child >= 0);
    if (child == 0) _exit(write_picture(c, &error) != INSITU_OK);
    int status = 1;
    waitpid(child, &status, 0);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    assert_true(read_picture(c, expected));
    remove_picture(c);
}

/* Returns whether the picture was written. Fails the test if the outcome is neither a correct picture nor an error. */
static bool check_shortage(const picture_case *c, const file_bytes *expected, const shortage *s, outcome *out)
{
    const bool is_alive = try_in_child(c, expected, s, out);
    if (!is_alive || (out->verdict != GOOD && out->verdict != REFUSED))
        fail_msg("%s, allocation %lld, %lld bytes to spare: %s, verdict %d: %s", c->name, (long long)s->n,
                 (long long)s->spare, is_alive ? "alive" : "the process was ended", (int)out->verdict, out->message);
    return out->verdict == GOOD;
}

/* ---- tests ---------------------------------------------------------------------------------------------------- */

static void failed_allocation_gives_same_picture_or_error(void **context)
{
    (void)context;
    static file_bytes expected;
    if (!heap_can_fail()) skip();
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        outcome out;
        int64_t n = 1;
        /* OpenEXR's writer of deep rows crashes if one allocation among a thousand fails. The image library therefore
         * calls the writer only if enough memory is left, and deep files are not tested here. */
        if (cases[i].format == INSITU_DEEP_EXR) continue;
        int refused = 0;
        write_expected_file(&cases[i], &expected);
        for (;; n += stride) {
            refused += !check_shortage(&cases[i], &expected, &(shortage){.n = n}, &out);
            if (out.allocations < n) break; /* n is beyond the last allocation */
        }
        assert_true(n > 500);
        assert_true(refused > 0); /* at least the first allocation, of the picture itself, must cause an error */
    }
}

static void memory_limit_gives_same_picture_or_error(void **context)
{
    (void)context;
    static file_bytes expected;
    if (!heap_can_fail()) skip();
    const rlim_t most = 48 << 20, step = (rlim_t)stride << 16;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        outcome out = {0};
        int refused = 0;
        write_expected_file(&cases[i], &expected);
        for (rlim_t spare = 0; spare < most; spare += step)
            refused += !check_shortage(&cases[i], &expected, &(shortage){.spare = spare}, &out);
        assert_true(refused > 0);
        assert_int_equal(out.verdict, GOOD);
    }
}

static void make_samples(void)
{
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        first_sample[i] = MOST_SAMPLES * i;
        sample_counts[i] = (uint32_t)(i % (MOST_SAMPLES + 1));
        for (int n = 0; n < MOST_SAMPLES; n++)
            samples[MOST_SAMPLES * i + n] = (insitu_deep_sample){
                {rgba[4 * i] / 4, rgba[4 * i + 1] / 4, rgba[4 * i + 2] / 4, 0.25f}, (float)n, (float)n + 0.5f};
    }
}

int main(int argument_count, char **arguments)
{
    if (argument_count > 1) folder = arguments[1];
    if (argument_count > 2) stride = atoi(arguments[2]);
    for (int i = 0; i < 4 * WIDTH * HEIGHT; i++) rgba[i] = (float)(i * 7919 % 1000) / 1000;
    for (int i = 0; i < WIDTH * HEIGHT; i++) depth[i] = (float)(i * 31 % 100);
    make_samples();
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) remove_picture(&cases[i]);
    mkdir(folder, 0777);
    /* Loads the image library by a call with an invalid picture. The library refuses the picture. */
    base_error error = {0};
    const insitu_image nothing = {.rgba = NULL};
    if (session_write_image(&nothing, INSITU_PNG8, "none.png", &error) != INSITU_ERROR_ARGUMENT) {
        fprintf(stderr, "%s\n", error.message);
        return 1;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(failed_allocation_gives_same_picture_or_error),
        cmocka_unit_test(memory_limit_gives_same_picture_or_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
