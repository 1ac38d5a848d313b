#include "test_session_fixture.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "memory.h"
#include "session_image.h"

int own_rank, rank_count;
caught_picture caught[MAX_CAUGHT];
int caught_count;
placed_picture placed[MAX_CAUGHT];
int placed_count;
const char *unwritable;
void (*before_writing)(void);

static const char *folder = ".";
static char scene_name[1024];

void assert_everywhere(bool is_well, const char *what, const char *file, int line)
{
    int mine = is_well, all = 0;
    if (!is_well) fprintf(stderr, "%s:%d: rank %d of %d: not so: %s\n", file, line, own_rank, rank_count, what);
    MPI_Allreduce(&mine, &all, 1, MPI_INT, MPI_LAND, MPI_COMM_WORLD);
    assert_true(all);
}

void assert_reported(const insitu_session *session, insitu_status status, insitu_status expected,
                     const char *const *words, const char *file, int line)
{
    char first[1024] = "";
    const char *message = insitu_error(session);
    if (!message) message = "";
    if (own_rank == 0) snprintf(first, sizeof first, "%s", message);
    MPI_Bcast(first, sizeof first, MPI_CHAR, 0, MPI_COMM_WORLD);
    if (status != expected) fprintf(stderr, "rank %d: %s: %s\n", own_rank, insitu_status_name(status), message);
    assert_everywhere(status == expected, "the status is as expected", file, line);
    if (strcmp(first, message) != 0) fprintf(stderr, "rank %d: %s\nrank 0: %s\n", own_rank, message, first);
    assert_everywhere(strcmp(first, message) == 0, "all ranks are told the same", file, line);
    bool has_all = true;
    for (; *words; words++)
        if (!strstr(message, *words)) {
            has_all = false;
            fprintf(stderr, "rank %d: \"%s\" is not in: %s\n", own_rank, *words, message);
        }
    assert_everywhere(has_all, "the message names the thing", file, line);
}

void read_file(const char *path, size_t size, char *text)
{
    text[0] = '\0';
    FILE *file = own_rank == 0 ? fopen(path, "r") : NULL;
    if (!file) return;
    text[fread(text, 1, size - 1, file)] = '\0';
    fclose(file);
}

void write_text_file(const char *path, const char *text)
{
    if (own_rank != 0) return;
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

int run_session_group(int argc, char **argv, const struct CMUnitTest *tests, size_t count, CMFixtureFunction begin,
                      CMFixtureFunction end)
{
    const char *const slash = strrchr(argv[0], '/'), *const name = slash ? slash + 1 : argv[0];
    MPI_Init(&argc, &argv);
    MPI_Comm_rank(MPI_COMM_WORLD, &own_rank);
    MPI_Comm_size(MPI_COMM_WORLD, &rank_count);
    if (argc > 1) folder = argv[1];
    snprintf(scene_name, sizeof scene_name, "%s/%s_np%d.yaml", folder, name, rank_count);
    const int failed = _cmocka_run_group_tests(name, tests, count, begin, end);
    discard_pictures();
    MPI_Finalize();
    return failed;
}

const char *write_scene(const char *text)
{
    bool is_written = true;
    if (own_rank == 0) {
        FILE *file = fopen(scene_name, "w");
        is_written = file && fputs(text, file) >= 0 && fclose(file) == 0;
    }
    everywhere(is_written);
    return scene_name;
}

insitu_session *open_session(MPI_Comm comm, const char *scene)
{
    insitu_session *session = NULL;
    const insitu_status status = insitu_create(comm, scene, &session);
    if (status) fprintf(stderr, "rank %d: insitu_create: %s\n", own_rank, insitu_error(NULL));
    assert_int_equal(status, INSITU_OK);
    return session;
}

insitu_session *open_session_with_mesh(MPI_Comm comm, const char *text, const insitu_mesh *mesh,
                                       const insitu_field *field)
{
    insitu_session *session = open_session(comm, write_scene(text));
    assert_int_equal(insitu_set_mesh(session, "m", mesh), INSITU_OK);
    assert_int_equal(insitu_set_field(session, "m", field), INSITU_OK);
    return session;
}

void describe_part(const test_mesh *part, insitu_mesh *mesh)
{
    insitu_mesh_defaults(mesh);
    mesh->vertex_count = part->vertex_count;
    insitu_mesh_interleaved(mesh, part->coordinates, INSITU_FLOAT64);
    mesh->cell_count = part->cell_count;
    mesh->connectivity_count = part->connectivity_count;
    mesh->connectivity = (insitu_array){part->connectivity, INSITU_INT64, 0};
    mesh->cell_types = (insitu_array){part->types, INSITU_UINT8, 0};
    mesh->offsets = (insitu_array){part->offsets, INSITU_INT64, 0};
    mesh->ghosts = (insitu_array){part->ghosts, INSITU_UINT8, 0};
    mesh->face_count = part->face_count;
    mesh->face_offsets = (insitu_array){part->face_offsets, INSITU_INT64, 0};
    mesh->face_connectivity_count = part->face_connectivity_count;
    mesh->face_connectivity = (insitu_array){part->face_connectivity, INSITU_INT64, 0};
}

void input_describe(session_input *in)
{
    describe_part(&in->part, &in->mesh);
    insitu_field_defaults(&in->field);
    in->field.name = "f";
    in->field.count = in->part.vertex_count;
    in->field.values = (insitu_array){in->part.values, INSITU_FLOAT64, 0};
}

void input_create(session_input *in, test_mesh_kind kind, int side, test_partition_kind distributed, int rank,
                  int count)
{
    test_mesh whole;
    in->kind = kind;
    in->side = side;
    in->distributed = distributed;
    in->rank = rank;
    in->count = count;
    test_mesh_make_lattice(kind, side, 0.2, test_wave_field, &whole);
    int *owners = calloc((size_t)whole.cell_count, sizeof *owners);
    assert_non_null(owners);
    test_partition_cells(&whole, distributed, side, count, owners);
    test_mesh_extract_part(&whole, owners, rank, &in->part);
    free(owners);
    test_mesh_free(&whole);
    input_describe(in);
}

void input_restore(session_input *in)
{
    input_free(in);
    input_create(in, in->kind, in->side, in->distributed, in->rank, in->count);
}

void input_free(session_input *in)
{
    test_mesh_free(&in->part);
}

insitu_status submit_input(insitu_session *session, const session_input *in)
{
    const insitu_status status = insitu_set_mesh(session, "m", &in->mesh);
    return status ? status : insitu_set_field(session, "m", &in->field);
}

void check_step_succeeds(insitu_session *session, int cycle)
{
    discard_pictures();
    const insitu_status status = insitu_step(session, cycle, 0);
    check_reported_everywhere(session, status, INSITU_OK, "");
    everywhere(insitu_last_report(session)->images == 1);
    everywhere(caught_count == (own_rank == 0));
}

void check_fault_is_reported(insitu_session *session, session_input *in, const corrupted_case *c)
{
    const int bad_rank = rank_count - 1;
    const bool is_bad = own_rank == bad_rank;
    char rank_words[32];
    snprintf(rank_words, sizeof rank_words, "rank %d: ", bad_rank);
    if (is_bad) c->corrupt(in);
    const insitu_status at_once = submit_input(session, in);
    everywhere(at_once == (is_bad && c->at_once ? c->status : INSITU_OK));
    everywhere(!is_bad || !c->at_once || strstr(insitu_error(session), c->words[0]) != NULL);
    for (int again = 0; again < 2; again++) { /* the error is reported at every step until it is corrected */
        discard_pictures();
        const insitu_status status = insitu_step(session, 1, 0);
        check_reported_everywhere(session, status, c->status, rank_words, "mesh \"m\"", c->words[0],
                                  c->words[1] ? c->words[1] : "");
        everywhere(insitu_last_report(session)->images == 0 && caught_count == 0);
    }
    input_restore(in);
    everywhere(submit_input(session, in) == INSITU_OK);
    check_step_succeeds(session, 2);
}

void extract_own_cells(const test_mesh *whole, test_partition_kind distributed, int side, bool with_ghosts,
                       test_mesh *out)
{
    int *owners = test_calloc((size_t)whole->cell_count, sizeof *owners);
    int *all = test_calloc((size_t)whole->cell_count, sizeof *all);
    test_partition_cells(whole, distributed, side, rank_count, owners);
    test_mesh_extract_part(whole, with_ghosts ? all : owners, with_ghosts ? 0 : own_rank, out);
    for (int64_t cell = 0; cell < out->cell_count && with_ghosts; cell++) out->ghosts[cell] = owners[cell] != own_rank;
    test_free(owners);
    test_free(all);
}

const char error_scene[] = "images:\n  - name: a\n    size: [24, 16]\n    layers:\n      - volume: {field: f}\n"
                           "    outputs: [{path: a.exr}]\n";

void check_all_faults_are_reported(session_input *in, const corrupted_case *cases, size_t count)
{
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(error_scene));
    for (size_t i = 0; i < count; i++) check_fault_is_reported(session, in, &cases[i]);
    insitu_destroy(&session);
}

double dot_product(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

void cross_product(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++) out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

int compare_doubles(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

double compute_mean(const double *values, int count)
{
    double sum = 0, rest = 0; /* Knuth's two-sum: sum + rest has twice the precision */
    for (int i = 0; i < count; i++) {
        const double next = sum + values[i], added = next - sum;
        rest += (sum - (next - added)) + (values[i] - added);
        sum = next;
    }
    return count ? (sum + rest) / count : NAN;
}

bool enter_test_folder(const char *name)
{
    char path[512];
    snprintf(path, sizeof path, "%s/%s_np%d", folder, name, rank_count);
    mkdir(path, 0777);
    return chdir(path) == 0;
}

void free_caught(caught_picture *picture)
{
    free(picture->rgba);
    free(picture->depth);
    free(picture->data);
    free(picture->samples);
    free(picture->first);
    *picture = (caught_picture){0};
}

void discard_pictures(void)
{
    placed_count = 0;
    for (int i = 0; i < caught_count; i++) free_caught(&caught[i]);
    caught_count = 0;
}

caught_picture pop_caught_picture(void)
{
    caught_picture picture = {0};
    if (caught_count > 0) picture = caught[0];
    for (int i = 1; i < caught_count; i++) free_caught(&caught[i]);
    caught_count = 0;
    return picture;
}

static void submit_and_check_step(insitu_session *session, const session_input *in)
{
    discard_pictures();
    assert_int_equal(submit_input(session, in), INSITU_OK);
    const insitu_status status = insitu_step(session, 0, 0);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    assert_int_equal(status, INSITU_OK);
}

insitu_session *open_session_and_draw(MPI_Comm comm, const char *scene, const session_input *in)
{
    insitu_session *session = open_session(comm, scene);
    submit_and_check_step(session, in);
    return session;
}

caught_picture submit_and_draw(insitu_session **session, const session_input *in)
{
    submit_and_check_step(*session, in);
    const caught_picture picture = pop_caught_picture();
    insitu_destroy(session);
    return picture;
}

caught_picture draw_scene(MPI_Comm comm, const char *scene, const session_input *in)
{
    insitu_session *session = open_session(comm, scene);
    return submit_and_draw(&session, in);
}

/* Returns whether two arrays are equal or both NULL. */
static bool are_same_bytes(const void *a, const void *b, size_t bytes)
{
    return a && b ? memcmp(a, b, bytes) == 0 : a == b;
}

bool are_same_pictures(const caught_picture *a, const caught_picture *b)
{
    const size_t pixels = (size_t)a->width * (size_t)a->height;
    if (a->width != b->width || a->height != b->height || a->channel_count != b->channel_count) return false;
    if (!are_same_bytes(a->rgba, b->rgba, 4 * pixels * sizeof(float))) return false;
    if (!are_same_bytes(a->depth, b->depth, pixels * sizeof(float))) return false;
    if (!are_same_bytes(a->data, b->data, (size_t)a->channel_count * pixels * sizeof(float))) return false;
    if (!are_same_bytes(a->first, b->first, (pixels + 1) * sizeof *a->first)) return false;
    return are_same_bytes(a->samples, b->samples, a->first ? (size_t)a->first[pixels] * sizeof *a->samples : 0);
}

int count_visible_pixels(const caught_picture *picture)
{
    int count = 0;
    for (int i = 0; i < picture->width * picture->height; i++) count += picture->rgba[4 * i + 3] > 0;
    return count;
}

int count_gap_pixels(const caught_picture *picture)
{
    const int size = picture->width;
    int gaps = 0;
    for (int pixel = 0; pixel < size * size; pixel++) {
        const double x = 2 * (pixel % size + 0.5) / size - 1, y = 1 - 2 * (pixel / size + 0.5) / size;
        if (x * x + y * y > 0.6 * 0.6) continue;
        const double front = 5 - sqrt(0.72 * 0.72 - x * x - y * y);
        gaps += !(picture->rgba[4 * pixel + 3] > 0 && fabs((double)picture->depth[pixel] - front) < 0.22);
    }
    return gaps;
}

drawn take_caught_pictures(void)
{
    drawn out = {0};
    for (; out.count < caught_count; out.count++) {
        assert_true(out.count < MOST_DRAWN);
        out.pictures[out.count] = caught[out.count];
    }
    caught_count = 0;
    return out;
}

void free_picture_set(drawn *d)
{
    for (int i = 0; i < d->count; i++) free_caught(&d->pictures[i]);
    *d = (drawn){0};
}

bool are_same_picture_sets(const drawn *a, const drawn *b)
{
    bool is_same = a->count == b->count;
    for (int i = 0; i < a->count && is_same; i++) {
        is_same = are_same_pictures(&a->pictures[i], &b->pictures[i]);
        if (!is_same) fprintf(stderr, "picture %d differs\n", i);
    }
    return is_same;
}

drawn step_and_take_pictures(insitu_session *session, int cycle)
{
    discard_pictures();
    const insitu_status status = insitu_step(session, cycle, 0);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    everywhere(status == INSITU_OK);
    return take_caught_pictures();
}

double read_last_number(const char *text, int column)
{
    const char *line = text, *end;
    while ((end = strchr(line, '\n')) && end[1]) line = end + 1;
    for (; column > 0 && line; column--) line = strchr(line, ',') ? strchr(line, ',') + 1 : NULL;
    return line ? strtod(line, NULL) : NAN;
}

double largest_colour_difference(const caught_picture *a, const caught_picture *b)
{
    double worst = a->width == b->width && a->height == b->height ? 0 : (double)INFINITY;
    for (int i = 0; i < 4 * a->width * a->height && worst < (double)INFINITY; i++)
        worst = test_larger_error(worst, fabs((double)a->rgba[i] - (double)b->rgba[i]));
    return worst;
}

bool session_writes_behind;

library_loading library_loaded;

insitu_word_faults word_faults;

void session_find_text_faults(const insitu_image *image, insitu_word_faults *out)
{
    (void)image;
    *out = word_faults;
}

double session_load_image_library(void)
{
    library_loaded.count++;
    library_loaded.by = pthread_self();
    return library_loaded.ms;
}

/* Copies a deep picture; returns false if an allocation fails. */
static bool copy_deep_picture(const insitu_deep *deep, size_t pixels, caught_picture *out)
{
    int64_t count = 0;
    for (size_t p = 0; p < pixels; p++) count += deep->counts[p];
    out->samples = malloc((size_t)(count + 1) * sizeof *out->samples);
    out->first = malloc((pixels + 1) * sizeof *out->first);
    if (!out->samples || !out->first) return false;
    out->first[0] = 0;
    for (size_t p = 0; p < pixels; p++) {
        out->first[p + 1] = out->first[p] + deep->counts[p];
        if (deep->counts[p])
            memcpy(out->samples + out->first[p], deep->samples + deep->first[p],
                   deep->counts[p] * sizeof *out->samples);
    }
    return true;
}

static bool copy_pixels(const insitu_image *image, size_t pixels, caught_picture *out)
{
    out->rgba = malloc(pixels * 4 * sizeof(float));
    if (image->depth) out->depth = malloc(pixels * sizeof(float));
    out->channel_count = image->channel_count;
    if (image->channel_count) out->data = malloc(pixels * (size_t)image->channel_count * sizeof(float));
    if (!out->rgba || (image->depth && !out->depth) || (image->channel_count && !out->data)) return false;
    memcpy(out->rgba, image->rgba, pixels * 4 * sizeof(float));
    if (image->depth) memcpy(out->depth, image->depth, pixels * sizeof(float));
    for (int c = 0; c < image->channel_count; c++)
        for (size_t p = 0; p < pixels; p++)
            out->data[pixels * (size_t)c + p] = image->channels[c].values[p * (size_t)image->channels[c].stride];
    return !image->deep || copy_deep_picture(image->deep, pixels, out);
}

static void copy_bars(const insitu_decorations *decorations, char *out, size_t size)
{
    for (int i = 0; i < decorations->bar_count; i++) {
        const insitu_colour_bar *bar = &decorations->bars[i];
        snprintf(out + strlen(out), size - strlen(out), "%s:", bar->label);
        for (int n = 0; n < bar->tick_count; n++)
            snprintf(out + strlen(out), size - strlen(out), " %s", bar->ticks[n].text);
        snprintf(out + strlen(out), size - strlen(out), "\n");
    }
}

static void copy_covered_areas(const insitu_decorations *decorations, placed_picture *out)
{
    for (int i = 0; i < decorations->covered_count && i < 4; i++)
        out->covered[out->covered_count++] = decorations->covered[i];
}

insitu_status session_place_image(const insitu_image *image, const insitu_place *place, base_error *error)
{
    (void)error;
    if (placed_count < MAX_CAUGHT) {
        placed_picture *p = &placed[placed_count++];
        *p = (placed_picture){
            .x = place->x, .y = place->y, .width = image->width, .height = image->height, .of_width = place->width};
        if (image->decorations) p->size = image->decorations->size * image->height;
        if (image->decorations) memcpy(p->colour, image->decorations->colour, sizeof p->colour);
        if (image->decorations) copy_bars(image->decorations, p->bars, sizeof p->bars);
        if (image->decorations) copy_covered_areas(image->decorations, p);
    }
    for (int y = 0; y < image->height; y++)
        memcpy(place->rgba + 4 * ((ptrdiff_t)(place->y + y) * place->width + place->x),
               image->rgba + 4 * (ptrdiff_t)y * image->width, 4 * (size_t)image->width * sizeof(float));
    return INSITU_OK;
}

insitu_status session_write_image(const insitu_image *image, insitu_image_format format, const char *path,
                                  base_error *error)
{
    if (before_writing) before_writing();
    if (unwritable && strstr(path, unwritable)) return base_fail(error, INSITU_ERROR_IO, "%s: cannot be written", path);
    if (caught_count == MAX_CAUGHT) return base_fail(error, INSITU_ERROR_INTERNAL, "too many pictures for the test");
    if ((format == INSITU_DEEP_EXR) != (image->deep != NULL))
        return base_fail(error, INSITU_ERROR_INTERNAL, "%s: the format and what is given differ", path);
    const size_t pixels = (size_t)image->width * (size_t)image->height;
    caught_picture picture = {.width = image->width, .height = image->height, .held = base_memory_held()};
    snprintf(picture.path, sizeof picture.path, "%s", path);
    if (image->decorations) copy_bars(image->decorations, picture.bars, sizeof picture.bars);
    if (!copy_pixels(image, pixels, &picture)) {
        free_caught(&picture);
        return base_fail(error, INSITU_ERROR_MEMORY, "%s: no memory to catch it", path);
    }
    caught[caught_count++] = picture;
    return INSITU_OK;
}
