/* Checks errors of users in owners, neighbours and lists of faces, each on one rank only. Every rank must get the same
 * message, which names the rank, the mesh, the face and the value. Nothing may be drawn, and the next step after the
 * correction must draw. */
#include "test_owned_faces.h"
#include "test_session_fixture.h"

static owned corrupted;

/* Describes the mesh by owners, with arrays in `corrupted`. The test cases then corrupt this description or its arrays
 * on one rank. */
static void describe_by_owner(session_input *in, form which, int base)
{
    free_owned_faces(&corrupted);
    corrupted = make_owned_faces(&in->part, base);
    describe_owned_faces(&corrupted, which, base, &in->mesh);
}

static void set_large_owner(session_input *in)
{
    describe_by_owner(in, FORM_WIDE, 0);
    corrupted.owner[3] = 1000000;
}
static void set_negative_owner(session_input *in)
{
    describe_by_owner(in, FORM_WIDE, 0);
    corrupted.owner[2] = -1;
}
static void set_owner_before_one(session_input *in)
{
    describe_by_owner(in, FORM_PAIRS, 1);
    corrupted.pairs[2 * 4] = corrupted.pairs[2 * 4 + 1] = 0; /* a single 0 would mark a boundary face, as in CGNS */
}
static void set_large_neighbour(session_input *in)
{
    describe_by_owner(in, FORM_PAIRS, 1);
    corrupted.pairs[1] = (int32_t)in->part.cell_count + 1;
}
static void set_negative_neighbour(session_input *in)
{
    describe_by_owner(in, FORM_WIDE, 0);
    corrupted.neighbour[1] = -2;
}
static void set_owner_to_neighbour(session_input *in)
{
    describe_by_owner(in, FORM_WIDE, 0);
    corrupted.owner[1] = corrupted.neighbour[1] = 2;
}
/* Assigns the faces of cell 0 to other cells. */
static void remove_faces_of_cell(session_input *in)
{
    describe_by_owner(in, FORM_WIDE, 0);
    const int64_t inner = corrupted.inner;
    for (int64_t f = 0; f < in->part.face_count; f++) {
        if (corrupted.owner[f] == 0) corrupted.owner[f] = f < inner && corrupted.neighbour[f] == 1 ? 2 : 1;
        if (f < inner && corrupted.neighbour[f] == 0) corrupted.neighbour[f] = corrupted.owner[f] == 1 ? 2 : 1;
    }
}
static void add_face_of_another_cell(session_input *in)
{
    describe_by_owner(in, FORM_WIDE, 0);
    corrupted.owner[in->part.face_count - 1] = corrupted.owner[in->part.face_count - 1] ? 0 : 1;
}
static void exclude_faces(session_input *in)
{
    describe_by_owner(in, FORM_WIDE, 0);
    in->mesh.face_count = in->mesh.neighbour_count = 0;
}
static void set_more_neighbours(session_input *in)
{
    describe_by_owner(in, FORM_WIDE, 0);
    in->mesh.neighbour_count = in->mesh.face_count + 1;
}
static void set_negative_neighbour_count(session_input *in)
{
    describe_by_owner(in, FORM_WIDE, 0);
    in->mesh.neighbour_count = -4;
}
static void set_neighbours_without_owners(session_input *in)
{
    describe_by_owner(in, FORM_WIDE, 0);
    in->mesh.owner.data = NULL;
}
static void remove_neighbours(session_input *in)
{
    describe_by_owner(in, FORM_WIDE, 0);
    in->mesh.neighbour_count = 1;
    in->mesh.neighbour.data = NULL;
}
static void set_float_owners(session_input *in)
{
    describe_by_owner(in, FORM_WIDE, 0);
    in->mesh.owner.type = INSITU_FLOAT64;
}
static void set_owners_of_tets(session_input *in)
{
    describe_by_owner(in, FORM_WIDE, 0);
    in->mesh.cell_type = INSITU_TET;
}
static void set_owners_and_connectivity(session_input *in)
{
    describe_by_owner(in, FORM_WIDE, 0);
    in->mesh.connectivity = (insitu_array){in->part.connectivity, INSITU_INT64, 0};
}
static void set_owners_and_offsets(session_input *in)
{
    describe_by_owner(in, FORM_WIDE, 0);
    in->mesh.offsets = (insitu_array){in->part.offsets, INSITU_INT64, 0};
}
static void set_unknown_keep_polyhedra(session_input *in)
{
    in->mesh.keep_polyhedra = 7;
}
static void set_null_list(session_input *in)
{
    describe_by_owner(in, FORM_LISTS, 0);
    corrupted.lists[5].labels = NULL;
}
static void set_negative_list_size(session_input *in)
{
    describe_by_owner(in, FORM_LISTS, 1);
    corrupted.lists[5].size = -3;
}
static void set_large_list_vertex(session_input *in)
{
    describe_by_owner(in, FORM_LISTS, 1);
    corrupted.lists[0].labels[2] = 1000000;
}
static void set_short_list(session_input *in)
{
    describe_by_owner(in, FORM_LISTS, 0);
    for (int64_t f = 0; f < in->part.face_count; f++)
        if (corrupted.pairs[2 * f] == 0 || corrupted.pairs[2 * f + 1] == 0) corrupted.lists[f].size = 2;
}
static void remove_list_sizes(session_input *in)
{
    describe_by_owner(in, FORM_LISTS, 0);
    in->mesh.face_sizes.data = NULL;
}
static void remove_lists(session_input *in)
{
    describe_by_owner(in, FORM_WIDE, 0);
    in->mesh.face_sizes = (insitu_array){&corrupted.lists->size, INSITU_INT32, sizeof(label_list)};
}
static void set_lists_and_offsets(session_input *in)
{
    describe_by_owner(in, FORM_LISTS, 0);
    in->mesh.face_offsets = (insitu_array){corrupted.offsets, INSITU_INT64, 0};
}
static void set_lists_between_pointers(session_input *in)
{
    describe_by_owner(in, FORM_LISTS, 0);
    in->mesh.face_lists.stride_bytes = 12;
}
static void set_float_lists(session_input *in)
{
    describe_by_owner(in, FORM_LISTS, 0);
    in->mesh.face_lists.type = INSITU_FLOAT32;
}

static void separate_components(session_input *in)
{
    describe_by_owner(in, FORM_APART, 0);
}
static void set_neighbour_beyond_halo(session_input *in)
{
    separate_components(in);
    corrupted.halo_pairs[1] = (int32_t)in->part.cell_count + OWNED_HALO;
}
static void set_unreported_halo(session_input *in)
{
    separate_components(in);
    for (int64_t i = 0; i < corrupted.middle; i++) corrupted.halo_pairs[2 * i] = (int32_t)in->part.cell_count;
    in->mesh.halo_cell_count = 0;
}
static void set_large_boundary_owner(session_input *in)
{
    separate_components(in);
    corrupted.apart_owner[1] = 1000000;
}
static void set_negative_boundary_owner(session_input *in)
{
    separate_components(in);
    corrupted.apart_owner[0] = -2;
}
static void set_large_boundary_offset(session_input *in)
{
    separate_components(in);
    corrupted.apart_offsets[1] = 1000000;
}
static void set_decreasing_boundary_offset(session_input *in)
{
    separate_components(in);
    corrupted.apart_offsets[1] = -1;
}
static void set_large_boundary_vertex(session_input *in)
{
    describe_by_owner(in, FORM_APART, 1);
    corrupted.narrow_vertices[corrupted.offsets[corrupted.middle]] = 1000000;
}
static void remove_boundary_owners(session_input *in)
{
    separate_components(in);
    in->mesh.boundary_owner.data = NULL;
}
static void remove_boundary_offsets(session_input *in)
{
    separate_components(in);
    in->mesh.boundary_face_offsets.data = NULL;
}
static void set_boundary_owners_alone(session_input *in)
{
    separate_components(in);
    in->mesh.owner.data = in->mesh.neighbour.data = NULL;
    in->mesh.neighbour_count = 0;
}
static void set_negative_boundary_count(session_input *in)
{
    separate_components(in);
    in->mesh.boundary_face_count = -1;
}
static void set_huge_boundary_count(session_input *in)
{
    separate_components(in);
    in->mesh.boundary_face_count = INT64_MAX;
}
static void set_huge_boundary_entries(session_input *in)
{
    separate_components(in);
    in->mesh.boundary_face_connectivity_count = INT64_MAX;
}
static void set_negative_halo(session_input *in)
{
    separate_components(in);
    in->mesh.halo_cell_count = -7;
}
static void set_huge_halo(session_input *in)
{
    separate_components(in);
    in->mesh.halo_cell_count = INT64_MAX;
}
static void set_halo_without_owners(session_input *in)
{
    in->mesh.halo_cell_count = 3;
}
static void set_boundary_stride(session_input *in)
{
    separate_components(in);
    in->mesh.boundary_owner.stride_bytes = 6;
}
static void set_far_boundary(session_input *in)
{
    separate_components(in);
    in->mesh.boundary_face_offsets.stride_bytes = (int64_t)1 << 47;
}
static void set_boundary_beside_lists(session_input *in)
{
    describe_by_owner(in, FORM_LISTS, 0);
    in->mesh.boundary_face_count = 1;
    in->mesh.boundary_face_offsets = (insitu_array){corrupted.apart_offsets, INSITU_INT32, 0};
    in->mesh.boundary_owner = (insitu_array){corrupted.apart_owner, INSITU_INT32, 0};
}

static const corrupted_case cases[] = {
    {"beyond the halo", set_neighbour_beyond_halo, INSITU_ERROR_MESH, false, {"face 0: its neighbour ", "outside 0.."}},
    {"no halo", set_unreported_halo, INSITU_ERROR_MESH, false, {"face 0: its owner ", "is outside 0.."}},
    {"its owner", set_large_boundary_owner, INSITU_ERROR_MESH, false, {"its owner 1000000 is outside 0.."}},
    {"its owner -2", set_negative_boundary_owner, INSITU_ERROR_MESH, false, {"its owner -2 is outside 0.."}},
    {"offset",
     set_large_boundary_offset,
     INSITU_ERROR_MESH,
     false,
     {"from offset 0 on, 1000000 of them, do not lie within"}},
    {"offset -1",
     set_decreasing_boundary_offset,
     INSITU_ERROR_MESH,
     false,
     {"from offset 0 on, -1 of them, do not lie within"}},
    {"its vertex",
     set_large_boundary_vertex,
     INSITU_ERROR_MESH,
     false,
     {"vertex index 1000000 is outside 1..", "is 1"}},
    {"no owners", remove_boundary_owners, INSITU_ERROR_MESH, true, {"owners of boundary faces are not given"}},
    {"no offsets", remove_boundary_offsets, INSITU_ERROR_MESH, true, {"offsets of boundary faces are not given"}},
    {"owners alone",
     set_boundary_owners_alone,
     INSITU_ERROR_MESH,
     true,
     {"owners of boundary faces are given, but those of "}},
    {"faces -1", set_negative_boundary_count, INSITU_ERROR_ARGUMENT, true, {"boundary_face_count is -1"}},
    {"faces",
     set_huge_boundary_count,
     INSITU_ERROR_ARGUMENT,
     true,
     {"boundary_face_count is 9223372036854775807, at most"}},
    {"entries", set_huge_boundary_entries, INSITU_ERROR_ARGUMENT, true, {"boundary_face_connectivity_count is 92"}},
    {"halo -7", set_negative_halo, INSITU_ERROR_ARGUMENT, true, {"halo_cell_count is -7"}},
    {"halo", set_huge_halo, INSITU_ERROR_ARGUMENT, true, {"halo_cell_count is 9223372036854775807, at most"}},
    {"halo alone", set_halo_without_owners, INSITU_ERROR_MESH, true, {"halo_cell_count is 3, but owners of faces"}},
    {"stride 6", set_boundary_stride, INSITU_ERROR_MESH, true, {"owners of boundary faces have a stride of 6 bytes"}},
    {"far",
     set_far_boundary,
     INSITU_ERROR_MESH,
     true,
     {"offsets of boundary faces have a stride of ", "outside of memory"}},
    {"beside lists",
     set_boundary_beside_lists,
     INSITU_ERROR_MESH,
     true,
     {"boundary_face_count is 1 and face lists are given"}},
    {"owner",
     set_large_owner,
     INSITU_ERROR_MESH,
     false,
     {"face 3: its owner 1000000 is outside 0..", "index_base is 0"}},
    {"owner -1", set_negative_owner, INSITU_ERROR_MESH, false, {"face 2: its owner -1 is outside 0.."}},
    {"owner 0 of 1", set_owner_before_one, INSITU_ERROR_MESH, false, {"face 5: its owner 0 is outside 1..", "is 1"}},
    {"neighbour",
     set_large_neighbour,
     INSITU_ERROR_MESH,
     false,
     {"face 1: its neighbour ", "nor is it 0, as on the boundary"}},
    {"neighbour -2", set_negative_neighbour, INSITU_ERROR_MESH, false, {"face 1: its neighbour -2 is outside 0.."}},
    {"both", set_owner_to_neighbour, INSITU_ERROR_MESH, false, {"face 1: its owner and its neighbour are both 2"}},
    {"empty cell", remove_faces_of_cell, INSITU_ERROR_MESH, false, {"cell 0 (polyhedron): 0 faces, ", "at least 4"}},
    {"open", add_face_of_another_cell, INSITU_ERROR_MESH, false, {"(polyhedron): ", "the surface is not closed"}},
    {"no faces", exclude_faces, INSITU_ERROR_MESH, false, {"cell 0 (polyhedron): 0 faces"}},
    {"count", set_more_neighbours, INSITU_ERROR_MESH, true, {"neighbour_count is ", "more than face_count"}},
    {"count -4", set_negative_neighbour_count, INSITU_ERROR_ARGUMENT, true, {"neighbour_count is -4"}},
    {"alone", set_neighbours_without_owners, INSITU_ERROR_MESH, true, {"neighbours of faces are given without owners"}},
    {"none", remove_neighbours, INSITU_ERROR_MESH, true, {"neighbours of faces are not given"}},
    {"float",
     set_float_owners,
     INSITU_ERROR_ARGUMENT,
     true,
     {"owners of faces are of element type 2, not int32 or int64"}},
    {"tets",
     set_owners_of_tets,
     INSITU_ERROR_MESH,
     true,
     {"cell_type is 10, but owners of faces are for 42, polyhedra"}},
    {"two forms",
     set_owners_and_connectivity,
     INSITU_ERROR_MESH,
     true,
     {"owners of faces and connectivity indices are"}},
    {"two", set_owners_and_offsets, INSITU_ERROR_MESH, true, {"owners of faces and offsets are given"}},
    {"keep", set_unknown_keep_polyhedra, INSITU_ERROR_ARGUMENT, true, {"keep_polyhedra is 7, expected 0 or 1"}},
    {"NULL", set_null_list, INSITU_ERROR_MESH, false, {"face 5: its list is NULL, its size "}},
    {"size", set_negative_list_size, INSITU_ERROR_MESH, false, {"face 6: its size is -3"}},
    {"listed",
     set_large_list_vertex,
     INSITU_ERROR_MESH,
     false,
     {"face 1: vertex index 1000000 is outside 1..", "is 1"}},
    {"short", set_short_list, INSITU_ERROR_MESH, false, {"cell 0 (polyhedron): face ", " has 2 vertices, at least 3"}},
    {"no sizes", remove_list_sizes, INSITU_ERROR_MESH, true, {"face sizes are not given"}},
    {"no lists", remove_lists, INSITU_ERROR_MESH, true, {"face sizes are given without face lists"}},
    {"both lists", set_lists_and_offsets, INSITU_ERROR_MESH, true, {"face lists and face offsets are given"}},
    {"stride", set_lists_between_pointers, INSITU_ERROR_MESH, true, {"face lists have a stride of 12 bytes"}},
    {"floats", set_float_lists, INSITU_ERROR_ARGUMENT, true, {"face lists are of element type 1, not int32 or int64"}},
};

static void wrong_input_is_reported_on_all_ranks(void **state)
{
    (void)state;
    session_input in = {0};
    input_create(&in, TEST_POLYHEDRA, 3, TEST_RANDOM, own_rank, rank_count);
    check_all_faults_are_reported(&in, cases, sizeof cases / sizeof cases[0]);
    input_free(&in);
    free_owned_faces(&corrupted);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(wrong_input_is_reported_on_all_ranks)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
