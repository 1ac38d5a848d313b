/* Reads the files that images are written to, and expands the placeholders in their names. */
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
    PLACEHOLDER_VIEW,
    PLACEHOLDER_TIME,
    PLACEHOLDER_ISOVALUE,
    PLACEHOLDER_PLANE,
    PLACEHOLDER_NAME,
    PLACEHOLDER_FIELD
} placeholder_kind;

typedef struct placeholder {
    placeholder_kind kind;
    /* for an integer: its minimum number of digits. For another number: the digits after the point ('f', 'e') or
     * significant digits ('g'); -1: the value's default number of significant digits. */
    int digits;
    char conversion; /* format of a number that is not whole: 'f', 'e' or 'g'; 't' for a text; 0 for a whole number */
    size_t length;   /* number of bytes of the placeholder in the pattern */
} placeholder;

static const placeholder no_placeholder = {PLACEHOLDER_NONE, 0, 0, 1};

/* Parses the format of "{WORD:0N}". text[at] is the colon. */
static placeholder parse_integer_format(const char *text, size_t at, placeholder_kind kind)
{
    if (text[at + 1] != '0') return no_placeholder;
    const size_t count = strspn(text + at + 2, "0123456789");
    const long digits = count == 1 || count == 2 ? strtol(text + at + 2, NULL, 10) : 0;
    if (digits < 1 || digits > 20 || text[at + 2 + count] != '}') return no_placeholder;
    return (placeholder){kind, (int)digits, 0, at + 2 + count + 1};
}

/* Parses the format of "{WORD:.Nf}" (or e or g instead of f). text[at] is the colon. */
static placeholder parse_real_format(const char *text, size_t at, placeholder_kind kind)
{
    if (text[at + 1] != '.') return no_placeholder;
    const size_t count = strspn(text + at + 2, "0123456789");
    const long digits = count == 1 || count == 2 ? strtol(text + at + 2, NULL, 10) : 99;
    const char conversion = text[at + 2 + count];
    if (digits > 17 || !conversion || !strchr("efg", conversion) || text[at + 3 + count] != '}') return no_placeholder;
    return (placeholder){kind, (int)digits, conversion, at + 2 + count + 2};
}

/* Parses the placeholder at the start of the text. The text begins with '{'. */
static placeholder parse_placeholder(const char *text)
{
    static const struct {
        const char *word;
        placeholder_kind kind;
        int digits;
        /* format of the value: 0 for a whole number, 't' for a text, 'f', 'e' or 'g' for other numbers */
        char conversion;
    } known[] = {{"{cycle", PLACEHOLDER_CYCLE, 1, 0},          {"{view", PLACEHOLDER_VIEW, 1, 0},
                 {"{plane", PLACEHOLDER_PLANE, 1, 0},          {"{time", PLACEHOLDER_TIME, -1, 'g'},
                 {"{isovalue", PLACEHOLDER_ISOVALUE, -1, 'g'}, {"{name", PLACEHOLDER_NAME, 0, 't'},
                 {"{field", PLACEHOLDER_FIELD, 0, 't'}};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
        const size_t length = strlen(known[i].word);
        if (strncmp(text, known[i].word, length) != 0) continue;
        if (text[length] == '}') return (placeholder){known[i].kind, known[i].digits, known[i].conversion, length + 1};
        if (text[length] != ':' || known[i].conversion == 't') continue;
        return known[i].conversion ? parse_real_format(text, length, known[i].kind)
                                   : parse_integer_format(text, length, known[i].kind);
    }
    return no_placeholder;
}

/* Writes a number and returns its length. default_digits: number of significant digits if the placeholder does not set
 * any. */
static int format_number_of_placeholder(const placeholder *p, double value, int default_digits, char *out, size_t size)
{
    if (p->conversion == 'f') return snprintf(out, size, "%.*f", p->digits, value);
    if (p->conversion == 'e') return snprintf(out, size, "%.*e", p->digits, value);
    return snprintf(out, size, "%.*g", p->digits < 0 ? default_digits : p->digits, value);
}

/* Writes the placeholder's value to `out`, which has space for `size` bytes, and returns its length. If `out` is NULL
 * and `size` is 0, only the length is computed. */
static int format_placeholder_value(const placeholder *p, const scene_placeholder_values *moment, char *out,
                                    size_t size)
{
    switch (p->kind) {
    case PLACEHOLDER_CYCLE: return snprintf(out, size, "%0*lld", p->digits, moment->cycle);
    case PLACEHOLDER_VIEW: return snprintf(out, size, "%0*d", p->digits, moment->view);
    case PLACEHOLDER_PLANE: return snprintf(out, size, "%0*d", p->digits, moment->plane);
    case PLACEHOLDER_NAME: return snprintf(out, size, "%s", moment->name);
    case PLACEHOLDER_FIELD: return snprintf(out, size, "%s", moment->field ? moment->field : "");
    case PLACEHOLDER_ISOVALUE: return format_number_of_placeholder(p, moment->isovalue, 9, out, size);
    default: return format_number_of_placeholder(p, moment->time, 6, out, size);
    }
}

/* Writes the expanded text to `out`, which has space for `size` bytes, and returns its length. If `out` is NULL and
 * `size` is 0, only the length is computed. */
static size_t expand_pattern(const char *pattern, const scene_placeholder_values *moment, char *out, size_t size)
{
    size_t length = 0;
    while (*pattern) {
        const placeholder p = *pattern == '{' ? parse_placeholder(pattern) : no_placeholder;
        char *at = out ? out + length : NULL;
        int written = 1;
        if (p.kind != PLACEHOLDER_NONE)
            written = format_placeholder_value(&p, moment, at, out ? size - length : 0);
        else if (out)
            *at = *pattern;
        length += (size_t)written;
        pattern += p.length;
    }
    if (out) out[length] = '\0';
    return length;
}

char *scene_expand_placeholders(const char *pattern, const scene_placeholder_values *moment)
{
    c_locale numbers;
    if (!c_locale_enter(&numbers)) return NULL;
    const size_t size = expand_pattern(pattern, moment, NULL, 0) + 1;
    char *text = base_alloc(size);
    if (text) expand_pattern(pattern, moment, text, size);
    c_locale_leave(&numbers);
    return text;
}

/* Some placeholders may be used only if the image has a certain key; {view}, for example, needs camera.orbit. Returns a
 * description of the key that the placeholder needs if the image lacks this key; otherwise NULL. image: path of the
 * image in the file. */
static const char *find_key_required_by_placeholder(const scene_document *d, const char *image, placeholder_kind kind)
{
    static const struct {
        placeholder_kind kind;
        const char *key, *lack;
    } needs[] = {{PLACEHOLDER_VIEW, "camera.orbit", "an orbit"},
                 {PLACEHOLDER_ISOVALUE, "sweep.isovalues", "sweep: {isovalues: true}"},
                 {PLACEHOLDER_PLANE, "sweep.planes", "sweep: {planes: true}"},
                 {PLACEHOLDER_FIELD, "sweep.fields", "sweep: {fields: ...}"}};
    for (size_t i = 0; i < sizeof needs / sizeof *needs; i++) {
        char key[SCENE_PATH_SIZE + 32];
        snprintf(key, sizeof key, "%s.%s", image, needs[i].key);
        if (kind == needs[i].kind && scene_get_node_type_at_path(d, key) == SCENE_NOTHING) return needs[i].lack;
    }
    return NULL;
}

insitu_status scene_check_placeholders(const scene_document *d, const char *path, const char *key, const char *text)
{
    for (const char *open = strchr(text, '{'); open; open = strchr(open + 1, '{')) {
        const placeholder_kind kind = parse_placeholder(open).kind;
        const int length = (int)strcspn(open, "}") + 1 < 40 ? (int)strcspn(open, "}") + 1 : 40;
        if (kind == PLACEHOLDER_NONE)
            return scene_fail_at_key(
                d, path, key,
                "\"%.*s\" is unknown, expected {cycle}, {cycle:01} to {cycle:020}, {time}, {time:.0f} to "
                "{time:.17f} (or e, or g), {name}, {view} and {plane} as {cycle}, {isovalue} as {time} or "
                "{field}",
                length, open);
        char image[SCENE_PATH_SIZE];
        snprintf(image, sizeof image, "%.*s", (int)strcspn(path, "."), path);
        const char *lack = find_key_required_by_placeholder(d, image, kind);
        if (lack) return scene_fail_at_key(d, path, key, "\"%.*s\" is of images with %s alone", length, open, lack);
    }
    return INSITU_OK;
}

static insitu_status determine_file_format(const scene_document *d, const char *path, const scene_file_output *in,
                                           scene_format *format)
{
    if (!in->path && !in->cinema)
        return scene_fail_at_key(d, path, "path", "missing, expected a file's name, or cinema: and that of a database");
    const char *file = in->path ? in->path : ".png";
    const size_t length = strlen(file);
    const char *ending = length >= 4 ? file + length - 4 : "";
    if (strcasecmp(ending, ".exr") == 0) {
        *format = SCENE_EXR;
        return in->bits ? scene_fail_at_key(d, path, "bits", "given for an EXR, expected for a PNG only") : INSITU_OK;
    }
    if (strcasecmp(ending, ".png") != 0) {
        return scene_fail_at_key(d, path, "path", "\"%.100s\" has an unknown ending, expected .png or .exr", file);
    }
    const int bits = in->bits ? *in->bits : 8;
    *format = bits == 16 ? SCENE_PNG16 : SCENE_PNG8;
    return bits == 8 || bits == 16 ? INSITU_OK
                                   : scene_fail_at_key(d, path, "bits", "%d is not allowed, expected 8 or 16", bits);
}

static insitu_status check_and_set_deep_output(const scene_document *d, const char *path, const scene_file_output *in,
                                               scene_output *out)
{
    out->is_deep = in->deep && *in->deep;
    if (!out->is_deep) return INSITU_OK;
    if (out->format != SCENE_EXR)
        return scene_fail_at_key(d, path, "deep", "given for a PNG, expected for an EXR only");
    if (out->has_data) return scene_fail_at_key(d, path, "deep", "given with data: true, expected a file for each");
    if (in->decorations && *in->decorations)
        return scene_fail_at_key(d, path, "deep", "given with decorations: true, which a deep picture has none of");
    return INSITU_OK;
}

/* Converts the keys that combine several pictures in one file (montages and insets). */
static insitu_status convert_montage_settings(const scene_document *d, const char *path, const scene_file_output *in,
                                              scene_output *out)
{
    const char *key = in->inset ? "inset" : "grid";
    out->montage = -1;
    out->shares_bars = in->shared_bars && *in->shared_bars;
    if (!in->grid && out->shares_bars)
        return scene_fail_at_key(d, path, "shared_bars", "given without grid, expected beside it");
    if (!in->grid && !in->inset) return INSITU_OK;
    if (in->grid && in->inset) return scene_fail_at_key(d, path, "inset", "given beside grid, expected one of the two");
    if (out->format == SCENE_EXR) return scene_fail_at_key(d, path, key, "given for an EXR, expected for a PNG only");
    if (in->cinema) return scene_fail_at_key(d, path, key, "given beside cinema, expected one of the two");
    out->columns = in->grid ? in->grid[0] : 0;
    out->rows = in->grid ? in->grid[1] : 0;
    out->is_inset = in->inset != NULL;
    out->corner = in->inset ? (scene_anchor)*in->inset : SCENE_TOP_LEFT;
    return INSITU_OK;
}

static insitu_status convert_output(const scene_document *d, const char *path, const scene_file_output *in,
                                    const scene_image *image, scene_output *out)
{
    out->database = -1;
    insitu_status status = determine_file_format(d, path, in, &out->format);
    if (!status && in->path) status = scene_check_placeholders(d, path, "path", in->path);
    if (status) return status;
    out->has_data = in->data && *in->data;
    if (out->has_data && out->format != SCENE_EXR)
        return scene_fail_at_key(d, path, "data", "given for a PNG, expected for an EXR only");
    status = check_and_set_deep_output(d, path, in, out);
    if (!status) status = convert_montage_settings(d, path, in, out);
    if (status) return status;
    out->has_decorations = in->decorations ? *in->decorations : out->format != SCENE_EXR;
    if (out->shares_bars && !(out->has_decorations && image->decorations.has_bars))
        return scene_fail_at_key(d, path, "shared_bars",
                                 "given, and the picture has no colour bars, expected decorations with a colour_bar");
    if (in->cinema) return scene_convert_cinema(d, path, in, image, out);
    out->path = base_strdup(in->path);
    return out->path ? INSITU_OK : scene_fail_for_memory(d);
}

insitu_status scene_convert_outputs(const scene_document *d, const char *path, const scene_file_image *in,
                                    scene_image *out)
{
    out->outputs = base_calloc((size_t)in->outputs_count, sizeof *out->outputs);
    if (!out->outputs) return scene_fail_for_memory(d);
    out->output_count = in->outputs_count;
    insitu_status status = INSITU_OK;
    for (int i = 0; i < in->outputs_count && status == INSITU_OK; i++) {
        char output_path[SCENE_PATH_SIZE];
        snprintf(output_path, sizeof output_path, "%s.outputs[%d]", path, i);
        status = convert_output(d, output_path, &in->outputs[i], out, &out->outputs[i]);
    }
    return status;
}

/* ---- check that outputs are different files ---------------------------------------------------------------------- */

/* Cycle that is inserted for {cycle} into paths before they are compared. It has so many digits that {cycle:03}, for
 * example, adds no zeros and gives the same path as {cycle}. */
static const long long sample_cycle = 123456789012345678;
static const double sample_time = 0.5;

scene_placeholder_values scene_make_placeholder_values(const scene_image *image, int64_t cycle, double time)
{
    const scene_variant *v = &image->variant;
    return (scene_placeholder_values){image->name,     (long long)cycle,  time, v->view, v->plane,
                                      image->isovalue, image->swept_field};
}

/* An output of the scene: the path of its file, the index of its image, its index among the image's outputs, and its
 * index among all outputs of the scene. */
typedef struct written_file {
    char *path;
    int image, output, output_index;
} written_file;

static int compare_output_paths(const void *a, const void *b)
{
    const written_file *first = a, *second = b;
    const int order = strcmp(first->path, second->path);
    return order ? order : first->output_index - second->output_index;
}

/* Returns the name of a placeholder that would make the paths of these two pictures of an image differ. */
static const char *find_distinguishing_placeholder(const scene_variant *a, const scene_variant *b)
{
    if (a->view != b->view) return "view";
    if (a->plane != b->plane) return "plane";
    return a->isovalue != b->isovalue ? "isovalue" : "field";
}

static insitu_status report_repeated_output_file(const scene_document *d, const scene *s, const written_file *first,
                                                 const written_file *second)
{
    const scene_variant *a = &s->images[first->image].variant, *b = &s->images[second->image].variant;
    const scene_output *output = &s->images[second->image].outputs[second->output];
    const char *pattern = output->path + output->folder_bytes;
    char path[64];
    snprintf(path, sizeof path, "images[%d].outputs[%d]", b->source, second->output);
    if (a->source != b->source || first->output != second->output)
        return scene_fail_at_key(d, path, "path", "\"%.100s\" is another output's file too, expected its own", pattern);
    const char *word = find_distinguishing_placeholder(a, b);
    char placeholder[32];
    snprintf(placeholder, sizeof placeholder, "{%s", word);
    return scene_fail_at_key(d, path, "path", "\"%.100s\" is one file for several %ss, expected %s{%s} in it", pattern,
                             word, strstr(pattern, placeholder) ? "more digits of " : "", word);
}

static const scene_output *get_output_of_file(const scene *s, const written_file *file)
{
    return &s->images[file->image].outputs[file->output];
}

/* Returns an error for the first output whose path equals that of an earlier output, unless both outputs belong to a
 * montage. files: sorted by path. */
static insitu_status check_files_are_distinct(const scene_document *d, const scene *s, const written_file *files,
                                              int count)
{
    int found = -1;
    for (int i = 1; i < count; i++) {
        if (strcmp(files[i - 1].path, files[i].path) != 0) continue;
        if (get_output_of_file(s, &files[i - 1])->montage >= 0 && get_output_of_file(s, &files[i])->montage >= 0)
            continue;
        if (found < 0 || files[i].output_index < files[found].output_index) found = i;
    }
    return found < 0 ? INSITU_OK : report_repeated_output_file(d, s, &files[found - 1], &files[found]);
}

insitu_status scene_check_output_paths_differ(const scene_document *d, const scene *s)
{
    size_t total = 0;
    for (int i = 0; i < s->image_count; i++) total += (size_t)s->images[i].output_count;
    written_file *files = base_calloc(total, sizeof *files);
    if (!files) return scene_fail_for_memory(d);
    int count = 0;
    insitu_status status = INSITU_OK;
    for (int i = 0; i < s->image_count && !status; i++) {
        const scene_placeholder_values moment = scene_make_placeholder_values(&s->images[i], sample_cycle, sample_time);
        for (int o = 0; o < s->images[i].output_count && !status; o++) {
            files[count] =
                (written_file){scene_expand_placeholders(s->images[i].outputs[o].path, &moment), i, o, count};
            if (files[count++].path == NULL) status = scene_fail_for_memory(d);
        }
    }
    if (!status) {
        qsort(files, (size_t)count, sizeof *files, compare_output_paths);
        status = check_files_are_distinct(d, s, files, count);
    }
    for (int i = 0; i < count; i++) base_free(files[i].path);
    base_free(files);
    return status;
}
