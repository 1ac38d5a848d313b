/* The code that processes meshes reads coordinates as float32 or float64, indices as int32 or int64, and flags as
 * bytes, int32 or int64, all aligned, because its loops are compiled once for each combination of these types. Arrays
 * of other types are converted here, so that all other code can rely on these types. Unsigned indices are read as
 * signed ones, without a copy, as long as they are below half of their range. */
#include "session_conform.h"

#include <string.h>

#include "memory.h"
#include "region.h"
#include "session_agree.h"

/* The meaning of an array's elements. */
typedef enum conform_role { OF_COORDINATES, OF_INDICES, OF_TYPES, OF_FLAGS } conform_role;

/* An array of a mesh that may have to be copied. */
typedef struct conform_array {
    insitu_array *array;
    conform_role role;
    int64_t count;
    int64_t index_limit; /* an upper bound of valid indices, if the array contains indices */
} conform_array;

/* Returns the mesh's array with this number, 0 .. SESSION_CONFORMED - 1. */
static conform_array get_convertible_array(insitu_mesh *m, int number)
{
    const int64_t open = m->open_offsets ? 0 : 1,
                  most = m->vertex_count > m->face_count ? m->vertex_count : m->face_count;
    switch (number) {
    case 0:
    case 1:
    case 2: return (conform_array){&m->coordinates[number], OF_COORDINATES, m->vertex_count, 0};
    case 3: return (conform_array){&m->cell_types, OF_TYPES, m->cell_count, 0};
    case 4: return (conform_array){&m->connectivity, OF_INDICES, m->connectivity_count, most};
    case 5: return (conform_array){&m->offsets, OF_INDICES, m->cell_count + open, m->connectivity_count + 1};
    case 6: return (conform_array){&m->ghosts, OF_FLAGS, m->cell_count, 0};
    case 7: return (conform_array){&m->face_offsets, OF_INDICES, m->face_count + open, m->face_connectivity_count + 1};
    default: return (conform_array){&m->face_connectivity, OF_INDICES, m->face_connectivity_count, m->vertex_count};
    }
}

/* Returns the type in which indices of the given type are read, in place or from a copy: int32 or int64. below: an
 * upper bound of valid indices. */
static insitu_type choose_index_type(insitu_type type, int64_t below)
{
    if (type == INSITU_INT64 || type == INSITU_UINT64) return INSITU_INT64;
    return type == INSITU_UINT32 && below > INT32_MAX ? INSITU_INT64 : INSITU_INT32;
}

/* Returns the type in which the array is read. has_map: the caller numbers cell types in its own way. *is_copied is set
 * if the array must be read from a copy. */
static insitu_type choose_conformed_type(const conform_array *of, bool has_map, bool *is_copied)
{
    const insitu_type type = of->array->type;
    const bool is_float = type == INSITU_FLOAT32 || type == INSITU_FLOAT64;
    insitu_type as = is_float ? type : INSITU_FLOAT64;
    switch (of->role) {
    case OF_COORDINATES: break;
    case OF_INDICES: as = choose_index_type(type, of->index_limit); break;
    case OF_TYPES: as = session_type_size(type) == 1 || has_map ? INSITU_UINT8 : choose_index_type(type, 0); break;
    case OF_FLAGS:
        as = session_type_size(type) < 4 || !session_is_aligned(of->array) ? INSITU_UINT8 : choose_index_type(type, 0);
        break;
    }
    const bool is_same_size = session_type_size(as) == session_type_size(type);
    *is_copied = !is_same_size || !session_is_aligned(of->array) || (of->role == OF_TYPES && has_map) ||
                 (of->role == OF_COORDINATES && as != type);
    return as;
}

/* ---- filling the copies -------------------------------------------------------------------------------------- */

static int64_t read_integer(insitu_type type, const char *p)
{
    int8_t i8;
    uint8_t u8;
    int16_t i16;
    uint16_t u16;
    int32_t i32;
    uint32_t u32;
    int64_t i64;
    switch (type) {
    case INSITU_INT8: return memcpy(&i8, p, sizeof i8), i8;
    case INSITU_UINT8: return memcpy(&u8, p, sizeof u8), u8;
    case INSITU_INT16: return memcpy(&i16, p, sizeof i16), i16;
    case INSITU_UINT16: return memcpy(&u16, p, sizeof u16), u16;
    case INSITU_INT32: return memcpy(&i32, p, sizeof i32), i32;
    case INSITU_UINT32: return memcpy(&u32, p, sizeof u32), u32;
    default: return memcpy(&i64, p, sizeof i64), i64;
    }
}

/* Returns the type of a cell according to the caller's map, or GRID_NO_TYPE if the map does not contain its number. */
static unsigned char map_cell_type(const session_conformed *conformed, int64_t number)
{
    if (number < 0 || number >= conformed->type_count) return GRID_NO_TYPE;
    return conformed->types[number];
}

static void convert_element(const session_conformed *conformed, const conform_array *of, insitu_type as,
                            const grid_array *from, int64_t i, char *out)
{
    const char *p = from->data + i * from->stride;
    const insitu_type type = of->array->type;
    if (as == type && (of->role != OF_TYPES || !conformed->types)) {
        memcpy(out, p, (size_t)session_type_size(type));
    } else if (of->role == OF_COORDINATES) {
        const double number = grid_read_number(from, i);
        memcpy(out, &number, sizeof number);
    } else {
        const int64_t whole = read_integer(type, p);
        const int32_t narrow = (int32_t)whole;
        if (of->role == OF_FLAGS)
            *out = whole != 0;
        else if (as == INSITU_UINT8)
            *out = (char)(conformed->types ? map_cell_type(conformed, whole) : (unsigned char)whole);
        else if (as == INSITU_INT64)
            memcpy(out, &whole, sizeof whole);
        else
            memcpy(out, &narrow, sizeof narrow);
    }
}

static void convert_array(const session_conformed *conformed, const conform_array *of, insitu_type as, int threads,
                          char *out)
{
    const grid_array from = session_grid_array(of->array);
    const int64_t size = session_type_size(as), count = of->count;
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t i = 0; i < count; i++) convert_element(conformed, of, as, &from, i, out + i * size);
        region_leave();
    }
}

void session_convert_arrays(session_mesh *mesh, int threads)
{
    for (int i = 0; i < SESSION_CONFORMED; i++) {
        if (!mesh->conformed.copies[i]) continue;
        bool is_copied;
        const conform_array of = get_convertible_array(&mesh->original, i);
        const insitu_type as = choose_conformed_type(&of, mesh->conformed.types != NULL, &is_copied);
        convert_array(&mesh->conformed, &of, as, threads, mesh->conformed.copies[i]);
    }
}

/* ---- allocating the copies ------------------------------------------------------------------------------------ */

static unsigned char convert_cell_type_to_byte(int type)
{
    return (unsigned char)(type == (unsigned char)type ? type : GRID_NO_TYPE);
}

bool session_has_cell_type_map(const session_mesh *mesh, int count, const int *map)
{
    const session_conformed *conformed = &mesh->conformed;
    if (!conformed->types || !map) return !conformed->types == !map;
    bool is_same = conformed->type_count == count;
    for (int i = 0; i < count && is_same; i++) is_same = conformed->types[i] == convert_cell_type_to_byte(map[i]);
    return is_same;
}

static bool copy_cell_type_map(const insitu_mesh *original, session_conformed *out)
{
    if (!original->cell_types.data || !original->cell_type_map) return true;
    out->types = base_calloc((size_t)original->cell_type_map_count + 1, 1);
    if (!out->types) return false;
    out->type_count = original->cell_type_map_count;
    for (int i = 0; i < out->type_count; i++) out->types[i] = convert_cell_type_to_byte(original->cell_type_map[i]);
    return true;
}

/* If the array that get_convertible_array() returns for `number` cannot be read in place, makes the description `given`
 * refer to a copy of it. If is_kept is set, the copy in *last, which was made for the previous description, is used
 * again; otherwise a new one is allocated. Returns false if memory runs out. */
static bool replace_array_by_copy(session_conformed *last, bool is_kept, int number, insitu_mesh *given,
                                  session_conformed *out)
{
    const conform_array of = get_convertible_array(given, number);
    bool is_copied;
    if (!of.array->data) return true;
    const insitu_type as = choose_conformed_type(&of, out->types != NULL, &is_copied);
    if (!is_copied) {
        of.array->type = as;
        return true;
    }
    const int64_t bytes = of.count * session_type_size(as);
    if (is_kept && last->copies[number]) {
        out->copies[number] = last->copies[number];
        last->copies[number] = NULL;
    } else {
        out->copies[number] = base_alloc(bytes ? (size_t)bytes : 1);
    }
    out->bytes += bytes;
    *of.array = (insitu_array){out->copies[number], as, 0};
    return out->copies[number] != NULL;
}

insitu_status session_allocate_converted_arrays(session_mesh *mesh, const insitu_mesh *original, unsigned changed,
                                                base_error *error)
{
    session_conformed made = {0};
    insitu_mesh given = *original;
    bool is_made = copy_cell_type_map(original, &made);
    for (int i = 0; i < SESSION_CONFORMED && is_made; i++) {
        const unsigned part = i < 3 ? INSITU_CHANGED_GEOMETRY : INSITU_CHANGED_TOPOLOGY;
        is_made = replace_array_by_copy(&mesh->conformed, !(changed & part), i, &given, &made);
    }
    if (!is_made) {
        const int64_t bytes = made.bytes;
        session_drop_converted_arrays(&made);
        return session_fail_for_memory(error, bytes, "arrays in other types");
    }
    session_drop_converted_arrays(&mesh->conformed);
    mesh->conformed = made;
    mesh->original = *original;
    mesh->original.cell_type_map =
        NULL; /* copy_cell_type_map() has copied the caller's map, which need not stay valid after the call */
    mesh->given = given;
    mesh->given.cell_type_map = NULL;
    return INSITU_OK;
}
