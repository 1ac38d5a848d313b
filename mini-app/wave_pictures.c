/* libinsitu reads the arrays on which the solver computes, so nothing is converted or copied. */
#include "wave_pictures.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char mesh_name[] = "ground";

/* Prints a message to stderr, unless it has been printed before. */
static void print_once(wave_pictures *p, const char *what, const char *message)
{
    uint64_t hash = 0;
    if (!message || !*message) return;
    for (const char *c = message; *c; ++c) hash = wave_hash(hash ^ (uint64_t)(unsigned char)*c);
    for (int i = 0; i < p->message_count; ++i) {
        if (p->messages[i] == hash) return;
    }
    if (p->message_count == WAVE_MESSAGES_MAX) return;
    p->messages[p->message_count++] = hash;
    fprintf(stderr, "insitu-wave: rank %d: %s: %s\n", p->rank, what, message);
}

static insitu_array make_array(const void *data, insitu_type type, int64_t stride_bytes)
{
    return (insitu_array){data, type, stride_bytes};
}

static insitu_mesh describe_mesh(const wave_pictures *p)
{
    const wave_mesh *mesh = p->mesh;
    const wave_values *x = &p->solver->grid.coordinates;
    int bytes = p->options->real_bytes;
    insitu_type real = bytes == 8 ? INSITU_FLOAT64 : INSITU_FLOAT32;
    insitu_type index = mesh->index_bytes == 8 ? INSITU_INT64 : INSITU_INT32;
    insitu_mesh m;
    insitu_mesh_defaults(&m);
    m.vertex_count = p->options->ghosts ? mesh->vertices : mesh->own_vertices;
    for (int a = 0; a < 3; ++a) {
        const char *first = (const char *)x->values + a * x->component_stride * bytes;
        m.coordinates[a] = make_array(first, real, x->stride * bytes);
    }
    if (p->options->ids) m.vertex_ids = make_array(mesh->vertex_ids, INSITU_INT64, 0);
    m.cell_count = p->options->ghosts ? mesh->cells : mesh->own_cells;
    m.connectivity = make_array(mesh->connectivity, index, 0);
    if (mesh->uniform_type) {
        m.cell_type = (insitu_cell_type)mesh->uniform_type;
        m.connectivity_count = m.cell_count * wave_cell_shape_of(mesh->uniform_type)->vertex_count;
    } else {
        m.cell_types = make_array(mesh->types, INSITU_UINT8, 0);
        m.offsets = make_array(mesh->offsets, index, 0);
        m.connectivity_count = wave_mesh_index(mesh, mesh->offsets, m.cell_count);
    }
    if (p->options->ghosts) m.ghosts = make_array(p->ghosts, INSITU_UINT8, 0);
    m.changed = p->options->moving ? INSITU_CHANGED_GEOMETRY : INSITU_CHANGED_NOTHING;
    if (!p->is_mesh_set) m.changed = INSITU_CHANGED_ALL;
    return m;
}

static insitu_field describe_field(const wave_pictures *p, const insitu_mesh *m, const char *name, int first,
                                   int components)
{
    bool at_vertices = p->options->at_vertices;
    const wave_values *v = at_vertices ? &p->solver->grid.vertex_state : &p->solver->grid.state;
    int bytes = p->options->real_bytes;
    insitu_field f;
    insitu_field_defaults(&f);
    f.name = name;
    f.centring = at_vertices ? INSITU_VERTEX : INSITU_CELL;
    f.count = at_vertices ? m->vertex_count : m->cell_count;
    f.component_count = components;
    f.component_stride_bytes = v->component_stride * bytes;
    f.values = make_array((const char *)v->values + first * v->component_stride * bytes,
                          bytes == 8 ? INSITU_FLOAT64 : INSITU_FLOAT32, v->stride * bytes);
    return f;
}

static insitu_field describe_speed(const wave_pictures *p, const insitu_mesh *m)
{
    insitu_field f;
    insitu_field_defaults(&f);
    f.name = "speed";
    f.centring = INSITU_CELL;
    f.count = m->cell_count;
    f.values = make_array(p->solver->speed, p->options->real_bytes == 8 ? INSITU_FLOAT64 : INSITU_FLOAT32, 0);
    if (p->is_mesh_set) f.changed = INSITU_CHANGED_NOTHING;
    return f;
}

static insitu_status pass_arrays_to_session(wave_pictures *p)
{
    insitu_mesh m = describe_mesh(p);
    insitu_field fields[3] = {describe_field(p, &m, "pressure", 0, 1), describe_field(p, &m, "velocity", 1, 3),
                              describe_speed(p, &m)};
    insitu_status status = INSITU_OK;
    if (m.changed != INSITU_CHANGED_NOTHING) status = insitu_set_mesh(p->session, mesh_name, &m);
    for (int i = 0; i < 3 && status == INSITU_OK; ++i) {
        if (fields[i].changed != INSITU_CHANGED_NOTHING) {
            status = insitu_set_field(p->session, mesh_name, &fields[i]);
        }
    }
    p->is_mesh_set = status == INSITU_OK;
    return status;
}

void wave_pictures_open(const wave_options *options, const wave_mesh *mesh, const wave_solver *solver, MPI_Comm comm,
                        wave_pictures *pictures)
{
    *pictures = (wave_pictures){.options = options, .mesh = mesh, .solver = solver};
    int ok = 1;
    MPI_Comm_rank(comm, &pictures->rank);
    if (!options->scene) return;
    if (options->ghosts) {
        pictures->ghosts = calloc((size_t)mesh->cells + 1, 1);
        ok = pictures->ghosts != NULL;
    }
    MPI_Allreduce(MPI_IN_PLACE, &ok, 1, MPI_INT, MPI_MIN, comm);
    if (!ok) {
        if (pictures->rank == 0) print_once(pictures, "no pictures", "out of memory for ghost flags");
        return;
    }
    if (pictures->ghosts) memset(pictures->ghosts + mesh->own_cells, 1, (size_t)(mesh->cells - mesh->own_cells));
    insitu_status status = insitu_create(comm, options->scene, &pictures->session);
    if (status != INSITU_OK && pictures->rank == 0) print_once(pictures, "no pictures", insitu_error(NULL));
}

void wave_pictures_update_source(wave_pictures *p, wave_source *source)
{
    source->strength = 1;
    source->period = 0;
    if (!p->session) return;
    insitu_parameter(p->session, "strength",
                     &source->strength); /* the strength stays 1 if the scene has no such parameter */
    insitu_parameter(p->session, "period", &source->period);
}

insitu_report wave_pictures_step(wave_pictures *p, int64_t cycle, double time)
{
    if (!p->session) return (insitu_report){0};
    if (pass_arrays_to_session(p) != INSITU_OK) print_once(p, "handing over", insitu_error(p->session));
    insitu_status status = insitu_step(p->session, cycle, time);
    insitu_report report = *insitu_last_report(p->session);
    p->images += report.images;
    if (p->rank == 0) {
        if (status != INSITU_OK) print_once(p, "in situ step", insitu_error(p->session));
        print_once(p, "warning", report.warnings);
    }
    return report;
}

void wave_pictures_close(wave_pictures *p)
{
    if (insitu_destroy(&p->session) != INSITU_OK) print_once(p, "closing", insitu_error(NULL));
    free(p->ghosts);
    p->ghosts = NULL;
}
