/* Where images go: file names with placeholders. */
#include "scene_convert.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "memory.h"
#include "text_file.h"

typedef enum placeholder_kind {
    PLACEHOLDER_NONE,
    PLACEHOLDER_CYCLE,
    PLACEHOLDER_TIME,
    PLACEHOLDER_NAME
} placeholder_kind;

typedef struct placeholder {
    placeholder_kind kind;
    int digits;      /* least digits of the cycle, or digits of the time; -1: as few as the time needs */
    char conversion; /* of the time: 'f', 'e' or 'g' */
    size_t size;     /* bytes of the pattern it takes */
} placeholder;

static const placeholder no_placeholder = {PLACEHOLDER_NONE, 0, 0, 1};

/* "{cycle:0N}", whose N begins at `digits` bytes into text. */
static placeholder read_cycle(const char *text)
{
    const size_t count = strspn(text + 8, "0123456789");
    const long digits = count == 1 || count == 2 ? strtol(text + 8, NULL, 10) : 0;
    if (digits < 1 || digits > 20 || text[8 + count] != '}') return no_placeholder;
    return (placeholder){PLACEHOLDER_CYCLE, (int)digits, 0, 8 + count + 1};
}

/* "{time:.Nf}", or e, or g. */
static placeholder read_time(const char *text)
{
    const size_t count = strspn(text + 7, "0123456789");
    const long digits = count == 1 || count == 2 ? strtol(text + 7, NULL, 10) : 99;
    const char conversion = text[7 + count];
    if (digits > 17 || !conversion || !strchr("efg", conversion) || text[8 + count] != '}') return no_placeholder;
    return (placeholder){PLACEHOLDER_TIME, (int)digits, conversion, 7 + count + 2};
}

/* The placeholder that stands at text, which begins with '{'. */
static placeholder read_placeholder(const char *text)
{
    if (strncmp(text, "{name}", 6) == 0) return (placeholder){PLACEHOLDER_NAME, 0, 0, 6};
    if (strncmp(text, "{cycle}", 7) == 0) return (placeholder){PLACEHOLDER_CYCLE, 1, 0, 7};
    if (strncmp(text, "{time}", 6) == 0) return (placeholder){PLACEHOLDER_TIME, -1, 'g', 6};
    if (strncmp(text, "{cycle:0", 8) == 0) return read_cycle(text);
    if (strncmp(text, "{time:.", 7) == 0) return read_time(text);
    return no_placeholder;
}

/* What the placeholder becomes, into out (size bytes; NULL and 0 to measure); returns its length. */
static int write_value(const placeholder *p, const scene_moment *moment, char *out, size_t size)
{
    if (p->kind == PLACEHOLDER_CYCLE) return snprintf(out, size, "%0*lld", p->digits, moment->cycle);
    if (p->kind == PLACEHOLDER_NAME) return snprintf(out, size, "%s", moment->name);
    if (p->conversion == 'f') return snprintf(out, size, "%.*f", p->digits, moment->time);
    if (p->conversion == 'e') return snprintf(out, size, "%.*e", p->digits, moment->time);
    return snprintf(out, size, "%.*g", p->digits < 0 ? 6 : p->digits, moment->time);
}

/* The text into out (size bytes; NULL and 0 to measure); returns its length. */
static size_t expand(const char *pattern, const scene_moment *moment, char *out, size_t size)
{
    size_t length = 0;
    while (*pattern) {
        const placeholder p = *pattern == '{' ? read_placeholder(pattern) : no_placeholder;
        char *at = out ? out + length : NULL;
        int written = 1;
        if (p.kind != PLACEHOLDER_NONE)
            written = write_value(&p, moment, at, out ? size - length : 0);
        else if (out)
            *at = *pattern;
        length += (size_t)written;
        pattern += p.size;
    }
    if (out) out[length] = '\0';
    return length;
}

char *scene_expand(const char *pattern, const scene_moment *moment)
{
    c_numbers numbers;
    if (!c_numbers_begin(&numbers)) return NULL;
    const size_t size = expand(pattern, moment, NULL, 0) + 1;
    char *text = base_alloc(size);
    if (text) expand(pattern, moment, text, size);
    c_numbers_end(&numbers);
    return text;
}

insitu_status scene_check_placeholders(const scene_document *d, const char *path, const char *key, const char *text)
{
    for (const char *open = strchr(text, '{'); open; open = strchr(open + 1, '{')) {
        if (read_placeholder(open).kind != PLACEHOLDER_NONE) continue;
        return scene_bad(d, path, key,
                         "\"%.*s\" is unknown, expected {cycle}, {cycle:01} to {cycle:020}, {time}, {time:.0f} to "
                         "{time:.17f} (or e, or g) or {name}",
                         (int)strcspn(open, "}") + 1 < 40 ? (int)strcspn(open, "}") + 1 : 40, open);
    }
    return INSITU_OK;
}

static insitu_status convert_format(const scene_document *d, const char *path, const scene_file_output *in,
                                    scene_format *format)
{
    const size_t length = strlen(in->path);
    const char *ending = length >= 4 ? in->path + length - 4 : "";
    if (strcasecmp(ending, ".exr") == 0) {
        *format = SCENE_EXR;
        return in->bits ? scene_bad(d, path, "bits", "given for an EXR, expected for a PNG only") : INSITU_OK;
    }
    if (strcasecmp(ending, ".png") != 0) {
        return scene_bad(d, path, "path", "\"%.100s\" has an unknown ending, expected .png or .exr", in->path);
    }
    const int bits = in->bits ? *in->bits : 8;
    *format = bits == 16 ? SCENE_PNG16 : SCENE_PNG8;
    return bits == 8 || bits == 16 ? INSITU_OK
                                   : scene_bad(d, path, "bits", "%d is not allowed, expected 8 or 16", bits);
}

insitu_status scene_convert_outputs(const scene_document *d, const char *path, const scene_file_image *in,
                                    scene_image *out)
{
    out->outputs = base_calloc((size_t)in->outputs_count, sizeof *out->outputs);
    if (!out->outputs) return scene_no_memory(d);
    out->output_count = in->outputs_count;
    insitu_status status = INSITU_OK;
    for (int i = 0; i < in->outputs_count && status == INSITU_OK; i++) {
        char output_path[SCENE_PATH_SIZE];
        snprintf(output_path, sizeof output_path, "%s.outputs[%d]", path, i);
        status = convert_format(d, output_path, &in->outputs[i], &out->outputs[i].format);
        if (status == INSITU_OK) status = scene_check_placeholders(d, output_path, "path", in->outputs[i].path);
        if (status != INSITU_OK) break;
        const bool *wanted = in->outputs[i].decorations;
        out->outputs[i].has_decorations = wanted ? *wanted : out->outputs[i].format != SCENE_EXR;
        out->outputs[i].path = base_strdup(in->outputs[i].path);
        if (!out->outputs[i].path) status = scene_no_memory(d);
    }
    return status;
}

/* Names are compared as they come out at one cycle of many digits, so that {cycle} and {cycle:03} count as the same. */
static const long long sample_cycle = 123456789012345678;
static const double sample_time = 0.5;

static insitu_status check_output(const scene_document *d, const scene *s, int image, int output, char **paths,
                                  int *path_count)
{
    const scene_moment moment = {s->images[image].name, sample_cycle, sample_time};
    char *expanded = scene_expand(s->images[image].outputs[output].path, &moment);
    if (!expanded) return scene_no_memory(d);
    paths[(*path_count)++] = expanded;
    for (int i = 0; i < *path_count - 1; i++) {
        if (strcmp(paths[i], expanded) != 0) continue;
        char path[SCENE_PATH_SIZE];
        snprintf(path, sizeof path, "images[%d].outputs[%d]", image, output);
        return scene_bad(d, path, "path", "\"%.100s\" is another output's file too, expected its own",
                         s->images[image].outputs[output].path);
    }
    return INSITU_OK;
}

insitu_status scene_check_outputs(const scene_document *d, const scene *s)
{
    size_t total = 0;
    for (int i = 0; i < s->image_count; i++) total += (size_t)s->images[i].output_count;
    char **paths = base_calloc(total, sizeof *paths);
    if (!paths) return scene_no_memory(d);
    int count = 0;
    insitu_status status = INSITU_OK;
    for (int i = 0; i < s->image_count; i++) {
        for (int o = 0; o < s->images[i].output_count && status == INSITU_OK; o++) {
            status = check_output(d, s, i, o, paths, &count);
        }
    }
    for (int i = 0; i < count; i++) base_free(paths[i]);
    base_free(paths);
    return status;
}
