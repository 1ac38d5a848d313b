! libinsitu from Fortran: pictures of a running simulation, from its own unstructured cells.
!
!     type(insitu_session) :: pictures
!     call pictures%create(MPI_COMM_WORLD, 'scene.yaml', status)
!     call pictures%set_mesh('domain', insitu_points(xyz), insitu_borrow(hexes), status, cell_type=INSITU_HEX)
!     call pictures%set_field('domain', 'pressure', insitu_borrow(pressure), status)
!     call pictures%step(cycle, time, status)
!     if (status /= INSITU_OK) write (error_unit, '(a)') pictures%error()
!     call pictures%destroy(status)
!
! Arrays are borrowed with their strides and not copied. They must keep their addresses until the next step has returned
! or they are set again, whichever is later. Give them the attribute target, and do not pass expressions. Indices count
! from 1. insitu.h describes each argument in more detail; docs/fortran.md is the page about this module.
module insitu
    use, intrinsic :: iso_c_binding
    use, intrinsic :: iso_fortran_env, only: int16, int32, int64, int8, real32, real64
    use mpi_f08, only: MPI_Comm
    implicit none
    private

    integer, parameter, public :: INSITU_OK = 0, INSITU_ERROR_ARGUMENT = 1, INSITU_ERROR_SCENE = 2, &
        INSITU_ERROR_MESH = 3, INSITU_ERROR_FIELD = 4, INSITU_ERROR_IO = 5, INSITU_ERROR_MEMORY = 6, &
        INSITU_ERROR_MPI = 7, INSITU_ERROR_INTERNAL = 8
    integer, parameter, public :: INSITU_TET = 10, INSITU_HEX = 12, INSITU_WEDGE = 13, INSITU_PYRAMID = 14, &
        INSITU_POLYHEDRON = 42, INSITU_TRIANGLE = 5, INSITU_POLYGON = 7, INSITU_QUAD = 9
    integer, parameter, public :: INSITU_QUADRATIC_TRIANGLE = 22, INSITU_QUADRATIC_QUAD = 23, INSITU_QUADRATIC_TET = 24, &
        INSITU_QUADRATIC_HEX = 25, INSITU_QUADRATIC_WEDGE = 26, INSITU_QUADRATIC_PYRAMID = 27, &
        INSITU_BIQUADRATIC_QUAD = 28, INSITU_TRIQUADRATIC_HEX = 29, INSITU_BIQUADRATIC_WEDGE = 32
    integer, parameter, public :: INSITU_LAGRANGE_TRIANGLE = 69, INSITU_LAGRANGE_QUAD = 70, INSITU_LAGRANGE_TET = 71, &
        INSITU_LAGRANGE_HEX = 72, INSITU_LAGRANGE_WEDGE = 73, INSITU_LAGRANGE_PYRAMID = 74
    integer, parameter, public :: INSITU_CHANGED_NOTHING = 0, INSITU_CHANGED_TOPOLOGY = 1, &
        INSITU_CHANGED_GEOMETRY = 2, INSITU_CHANGED_VALUES = 4, INSITU_CHANGED_ALL = 7
    integer, parameter, public :: INSITU_VERTEX = 0, INSITU_CELL = 1, INSITU_CORNER = 2
    integer, parameter, public :: INSITU_ORDER_VTK = 0, INSITU_ORDER_LEXICOGRAPHIC = 1, INSITU_ORDER_DMPLEX = 2, &
        INSITU_ORDER_VTK_BEFORE_9_1 = 3, INSITU_ORDER_GMSH = 4, INSITU_ORDER_EXODUS = 5

    integer(c_int), parameter :: float32 = 1, float64 = 2, integer32 = 3, integer64 = 4, bytes = 6, &
        integer16 = 7

    ! A borrowed array: its elements are stored in `rows` rows of equal length, or it has up to four dimensions, as
    ! arrays of blocks have.
    type, public :: insitu_array
        private
        type(c_ptr) :: data = c_null_ptr
        integer(c_int) :: kind = float32
        integer(c_int64_t) :: rows = 1, columns = 0      ! rows: 1, or the first extent of a matrix
        integer(c_int64_t) :: row_stride = 0, stride = 0 ! bytes along the first and the last extent
        integer :: dimensions = 1
        integer(c_int64_t) :: extents(4) = 0, steps(4) = 0 ! steps: distance in bytes; 0 along extents of 1
    end type insitu_array

    ! Faces that each have their own list of vertices: pointers to the lists, and the number of vertices in each.
    type, public :: insitu_face_lists
        private
        type(insitu_array) :: lists, sizes
    end type insitu_face_lists

    ! Values of a cell field on faces of the boundary: insitu_patch(insitu_borrow(values), first_face=n). The faces are
    ! given by a range, by their numbers, or by their vertices (a list with offsets, or a matrix (vertices, faces)).
    type, public :: insitu_patch
        type(insitu_array) :: values
        integer :: first_face = 0
        type(insitu_array) :: faces = insitu_array(), connectivity = insitu_array(), offsets = insitu_array()
    end type insitu_patch

    type, bind(C) :: c_array
        type(c_ptr) :: data
        integer(c_int) :: kind
        integer(c_int64_t) :: stride
    end type c_array

    type, bind(C) :: c_lattice
        integer(c_int64_t) :: cells(3), vertex_strides(3), cell_strides(3), interior_first(3), interior_end(3)
        real(c_double) :: origin(3), spacing(3)
        integer(c_int64_t) :: first(3)
        type(c_array) :: axes(3)
        integer(c_int64_t) :: refinement(3)
    end type c_lattice

    type, bind(C) :: c_mesh
        integer(c_int64_t) :: vertex_count
        type(c_array) :: coordinates(3)
        type(c_array) :: vertex_ids
        integer(c_int64_t) :: cell_count
        integer(c_int) :: cell_type
        type(c_array) :: cell_types
        integer(c_int64_t) :: connectivity_count
        type(c_array) :: connectivity, offsets
        integer(c_int64_t) :: face_count
        type(c_array) :: face_offsets
        integer(c_int64_t) :: face_connectivity_count
        type(c_array) :: face_connectivity, ghosts
        integer(c_int) :: changed, index_base
        type(c_array) :: owner
        integer(c_int64_t) :: neighbour_count
        type(c_array) :: neighbour, face_sizes, face_lists
        integer(c_int) :: keep_polyhedra, vertex_order
        integer(c_int64_t) :: connectivity_row
        type(c_ptr) :: lattice
        integer(c_int64_t) :: boundary_face_count
        type(c_array) :: boundary_face_offsets
        integer(c_int64_t) :: boundary_face_connectivity_count
        type(c_array) :: boundary_face_connectivity, boundary_owner
        integer(c_int64_t) :: halo_cell_count
        integer(c_int) :: open_offsets, cell_type_map_count
        type(c_ptr) :: cell_type_map
        integer(c_int) :: order
    end type c_mesh

    type, bind(C) :: c_patch
        integer(c_int64_t) :: count, first_face
        type(c_array) :: faces
        integer(c_int64_t) :: connectivity_count
        type(c_array) :: connectivity, offsets, values
        integer(c_int64_t) :: component_stride
    end type c_patch

    type, bind(C) :: c_field
        type(c_ptr) :: name
        integer(c_int) :: centring
        integer(c_int64_t) :: count
        integer(c_int) :: component_count
        integer(c_int64_t) :: component_stride
        type(c_array) :: values
        integer(c_int) :: changed
        type(c_array) :: index
        integer(c_int64_t) :: corner_row
        type(c_funptr) :: fill
        type(c_ptr) :: fill_data
        integer(c_int) :: patch_count
        type(c_ptr) :: patches
        type(c_ptr) :: components
    end type c_field

    ! The report of the last step on this rank; insitu_report in insitu.h describes the members.
    type, bind(C), public :: insitu_report
        integer(c_int64_t) :: cycle = 0
        real(c_double) :: time = 0
        integer(c_int) :: images = 0
        real(c_double) :: total_ms = 0, prepare_ms = 0, build_ms = 0, refit_ms = 0, surface_ms = 0, volume_ms = 0, &
            composite_ms = 0, write_ms = 0, background_ms = 0
        integer(c_int) :: pictures_waiting = 0, turns = 0
        integer(c_int64_t) :: cells = 0, cells_ghost = 0, cells_unusable = 0, cells_inverted = 0, cells_flat = 0, &
            cells_shell = 0, cells_recognised = 0
        integer(c_int64_t) :: rays = 0, fragments = 0, bytes_sent = 0, map_failures = 0
        integer(c_int64_t) :: bytes_borrowed = 0, bytes_copied = 0, bytes_trees = 0, bytes_pictures = 0, bytes_peak = 0
        ! insitu_text() converts these texts
        type(c_ptr) :: schedule = c_null_ptr, copied_why = c_null_ptr, left_out = c_null_ptr, &
            warnings = c_null_ptr, pieces = c_null_ptr
    end type insitu_report

    type, bind(C) :: c_picture
        type(c_ptr) :: image
        integer(c_int) :: width, height
        type(c_ptr) :: rgba, depth
    end type c_picture

    ! A picture of the last step, on rank 0. It is in the session's memory, and is valid until the next step.
    type, public :: insitu_picture
        character(:), allocatable :: image                           ! name of the image in the scene
        real(real32), pointer, contiguous :: rgba(:, :, :) => null() ! (4, width, height), the top row first
        real(real32), pointer, contiguous :: depth(:, :) => null()   ! (width, height); huge or infinite: no surface
    end type insitu_picture

    ! Computes the values of a field in the steps that need them: values = insitu_borrow(...), of an array that must
    ! exist until the step has returned. The procedure may communicate (insitu_fill in insitu.h). status: INSITU_OK, or
    ! another status to report an error.
    abstract interface
        subroutine insitu_fill(values, status)
            import :: insitu_array
            type(insitu_array), intent(out) :: values
            integer, intent(out) :: status
        end subroutine insitu_fill
    end interface
    public :: insitu_fill

    ! The layout of the arrays of a structured block: of its vertices (1) and of its cells (2). Strides are stored as
    ! integers without a common divisor, so that arrays of different kinds and numbers of components have equal strides.
    ! The first array determines them.
    type :: block_shape
        integer :: dimensions = 0 ! 0: not a block
        integer(c_int64_t) :: extents(3, 2) = 1, strides(3, 2) = 1
        logical :: has_strides(2) = .false.
    end type block_shape

    ! An array of a block in the form that is passed to C: with the number of components, and their distance in bytes.
    type :: block_array
        type(c_array) :: array
        integer(c_int64_t) :: count = 0, components = 1, component_stride = 0
    end type block_array

    ! The data that C passes to the function that it calls. Its address does not change until the session ends.
    type :: fill_record
        character(:), allocatable :: mesh, field
        type(block_shape) :: block
        procedure(insitu_fill), pointer, nopass :: fill => null()
        character(:), allocatable :: fault ! error in the values that `fill` has computed in this step
        type(fill_record), pointer :: next => null()
    end type fill_record

    ! The sizes of a mesh or block that was passed to C. They determine the required length of a field's index.
    type :: mesh_size
        character(:), allocatable :: name ! name of the mesh, or name[number] for a block
        integer(c_int64_t) :: vertices = 0, cells = 0, corners = 0
        integer :: cell_size = 0 ! number of vertices per cell; 0: cells have offsets
        type(block_shape) :: block
    end type mesh_size

    ! A session. create, step and destroy are collective, all other procedures local. status: INSITU_OK, or an error
    ! that error() describes.
    type, public :: insitu_session
        private
        type(c_ptr) :: handle = c_null_ptr
        character(:), allocatable :: own_error ! error in an argument that was not passed to C
        type(mesh_size), allocatable :: sizes(:)
        ! number of entries of sizes in use, and index of the entry that was found last
        integer :: size_count = 0, last_size = 1
        type(fill_record), pointer :: fills => null()
    contains
        procedure, private :: create_integer, create_f08, text_integer, text_f08
        generic :: create => create_integer, create_f08                   ! (comm, scene_file, status)
        generic :: create_from_text => text_integer, text_f08             ! (comm, scene_text, status)
        procedure, private :: set_faces_by_offsets, set_faces_by_lists
        generic :: set_mesh_of_faces => set_faces_by_offsets, set_faces_by_lists
        procedure :: set_mesh, set_block, remove_mesh, set_field, set_components, set_filled_field, step, report, error
        procedure :: destroy
        procedure :: keep_pictures, pictures
        procedure :: parameter => read_parameter
    end type insitu_session

    ! Borrows an array of any kind that the library supports: reals of 4 and 8 bytes, and integers of 1, 2, 4
    ! and 8 bytes. It is a list or a matrix: (corners, cells) for connectivity, (components, tuples) for values. For
    ! blocks it may also be an array (i, j, k) and, for fields with components, (components, i, j, k) or (i, j, k,
    ! components).
    interface insitu_borrow
        module procedure borrow_r4, borrow_r8, borrow_i1, borrow_i2, borrow_i4, borrow_i8
        module procedure borrow_r4_2, borrow_r8_2, borrow_i1_2, borrow_i2_2, borrow_i4_2, borrow_i8_2
        module procedure borrow_r4_3, borrow_r8_3, borrow_i1_3, borrow_i2_3, borrow_i4_3, borrow_i8_3
        module procedure borrow_r4_4, borrow_r8_4, borrow_i1_4, borrow_i2_4, borrow_i4_4, borrow_i8_4
    end interface insitu_borrow

    ! Borrows coordinates: a matrix (3, vertices), or x, y and z. If z is 0 everywhere: a matrix (2, vertices), or x and
    ! y.
    interface insitu_points
        module procedure points_of_matrix_r4, points_of_matrix_r8, points_of_axes_r4, points_of_axes_r8
    end interface insitu_points

    ! Borrows pointers (c_loc) to the lists of faces' vertices, and the sizes of the lists. kind: kind of the indices in
    ! the lists, int32 (default) or int64.
    interface insitu_lists
        module procedure lists_i4, lists_i8
    end interface insitu_lists

    public :: insitu_borrow, insitu_points, insitu_lists, insitu_text

    interface
        integer(c_int) function c_create(comm, scene, is_text, session) bind(C, name='insitu_create_fortran')
            import :: c_int, c_char, c_ptr
            integer(c_int), value :: comm, is_text
            character(kind=c_char), intent(in) :: scene(*)
            type(c_ptr), intent(out) :: session
        end function c_create
        subroutine c_mesh_defaults(mesh) bind(C, name='insitu_mesh_defaults')
            import :: c_mesh
            type(c_mesh), intent(out) :: mesh
        end subroutine c_mesh_defaults
        subroutine c_field_defaults(field) bind(C, name='insitu_field_defaults')
            import :: c_field
            type(c_field), intent(out) :: field
        end subroutine c_field_defaults
        integer(c_int) function c_set_mesh(session, name, mesh) bind(C, name='insitu_set_mesh')
            import :: c_int, c_char, c_ptr
            type(c_ptr), value :: session, mesh
            character(kind=c_char), intent(in) :: name(*)
        end function c_set_mesh
        integer(c_int) function c_set_field(session, mesh, field) bind(C, name='insitu_set_field')
            import :: c_int, c_char, c_ptr, c_field
            type(c_ptr), value :: session
            character(kind=c_char), intent(in) :: mesh(*)
            type(c_field), intent(in) :: field
        end function c_set_field
        integer(c_int) function c_set_block(session, name, number, mesh) bind(C, name='insitu_set_block')
            import :: c_int, c_char, c_ptr, c_int64_t
            type(c_ptr), value :: session, mesh
            integer(c_int64_t), value :: number
            character(kind=c_char), intent(in) :: name(*)
        end function c_set_block
        integer(c_int) function c_set_block_field(session, mesh, number, field) bind(C, name='insitu_set_block_field')
            import :: c_int, c_char, c_ptr, c_int64_t, c_field
            type(c_ptr), value :: session
            integer(c_int64_t), value :: number
            character(kind=c_char), intent(in) :: mesh(*)
            type(c_field), intent(in) :: field
        end function c_set_block_field
        integer(c_int) function c_step(session, cycle, time) bind(C, name='insitu_step')
            import :: c_int, c_ptr, c_int64_t, c_double
            type(c_ptr), value :: session
            integer(c_int64_t), value :: cycle
            real(c_double), value :: time
        end function c_step
        type(c_ptr) function c_report(session) bind(C, name='insitu_last_report')
            import :: c_ptr
            type(c_ptr), value :: session
        end function c_report
        integer(c_int) function c_keep_pictures(session, keep) bind(C, name='insitu_keep_pictures')
            import :: c_int, c_ptr
            type(c_ptr), value :: session
            integer(c_int), value :: keep
        end function c_keep_pictures
        integer(c_int) function c_parameter(session, name, value) bind(C, name='insitu_parameter')
            import :: c_char, c_double, c_int, c_ptr
            type(c_ptr), value :: session
            character(kind=c_char), intent(in) :: name(*)
            real(c_double), intent(inout) :: value
        end function c_parameter
        type(c_ptr) function c_pictures(session, count) bind(C, name='insitu_last_pictures')
            import :: c_int, c_ptr
            type(c_ptr), value :: session
            integer(c_int), intent(out) :: count
        end function c_pictures
        type(c_ptr) function c_error(session) bind(C, name='insitu_error')
            import :: c_ptr
            type(c_ptr), value :: session
        end function c_error
        integer(c_int) function c_destroy(session) bind(C, name='insitu_destroy')
            import :: c_int, c_ptr
            type(c_ptr), intent(inout) :: session
        end function c_destroy
        integer(c_size_t) function c_strlen(text) bind(C, name='strlen')
            import :: c_size_t, c_ptr
            type(c_ptr), value :: text
        end function c_strlen
    end interface

contains

    ! ---- arrays ---------------------------------------------------------------------------------------------------

    ! Returns the number of bytes from one address to the other.
    integer(c_int64_t) function bytes_between(from, to)
        type(c_ptr), intent(in) :: from, to
        bytes_between = transfer(to, 0_c_intptr_t) - transfer(from, 0_c_intptr_t)
    end function bytes_between

    ! Returns an array with these extents, whose memory is not set yet.
    function array_of(kind, extents) result(out)
        integer(c_int), intent(in) :: kind
        integer, intent(in) :: extents(:)
        type(insitu_array) :: out
        out%kind = kind
        out%dimensions = size(extents)
        out%extents(:size(extents)) = extents
        if (size(extents) > 1) out%rows = extents(1)
        if (all(extents > 0)) out%columns = extents(size(extents))
    end function array_of

    ! Sets the memory. at: address of the first element, and for each dimension address of the next element along it, or
    ! of the first one if there is no next element.
    subroutine put_memory(array, at)
        type(insitu_array), intent(inout) :: array
        type(c_ptr), intent(in) :: at(:)
        integer :: i
        array%data = at(1)
        do i = 1, array%dimensions
            array%steps(i) = bytes_between(at(1), at(i + 1))
        end do
        array%stride = array%steps(array%dimensions)
        if (array%dimensions > 1) array%row_stride = array%steps(1)
    end subroutine put_memory

    function borrow_r4(a) result(out)
        real(real32), intent(in), target :: a(:)
        type(insitu_array) :: out
        out = array_of(float32, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1)), c_loc(a(min(2, size(a))))])
    end function borrow_r4

    function borrow_r8(a) result(out)
        real(real64), intent(in), target :: a(:)
        type(insitu_array) :: out
        out = array_of(float64, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1)), c_loc(a(min(2, size(a))))])
    end function borrow_r8

    function borrow_i1(a) result(out)
        integer(int8), intent(in), target :: a(:)
        type(insitu_array) :: out
        out = array_of(bytes, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1)), c_loc(a(min(2, size(a))))])
    end function borrow_i1

    function borrow_i2(a) result(out)
        integer(int16), intent(in), target :: a(:)
        type(insitu_array) :: out
        out = array_of(integer16, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1)), c_loc(a(min(2, size(a))))])
    end function borrow_i2

    function borrow_i4(a) result(out)
        integer(int32), intent(in), target :: a(:)
        type(insitu_array) :: out
        out = array_of(integer32, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1)), c_loc(a(min(2, size(a))))])
    end function borrow_i4

    function borrow_i8(a) result(out)
        integer(int64), intent(in), target :: a(:)
        type(insitu_array) :: out
        out = array_of(integer64, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1)), c_loc(a(min(2, size(a))))])
    end function borrow_i8

    function borrow_r4_2(a) result(out)
        real(real32), intent(in), target :: a(:, :)
        type(insitu_array) :: out
        out = array_of(float32, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1, 1)), c_loc(a(min(2, size(a, 1)), 1)), &
            c_loc(a(1, min(2, size(a, 2))))])
    end function borrow_r4_2

    function borrow_r8_2(a) result(out)
        real(real64), intent(in), target :: a(:, :)
        type(insitu_array) :: out
        out = array_of(float64, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1, 1)), c_loc(a(min(2, size(a, 1)), 1)), &
            c_loc(a(1, min(2, size(a, 2))))])
    end function borrow_r8_2

    function borrow_i1_2(a) result(out)
        integer(int8), intent(in), target :: a(:, :)
        type(insitu_array) :: out
        out = array_of(bytes, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1, 1)), c_loc(a(min(2, size(a, 1)), 1)), &
            c_loc(a(1, min(2, size(a, 2))))])
    end function borrow_i1_2

    function borrow_i2_2(a) result(out)
        integer(int16), intent(in), target :: a(:, :)
        type(insitu_array) :: out
        out = array_of(integer16, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1, 1)), c_loc(a(min(2, size(a, 1)), 1)), &
            c_loc(a(1, min(2, size(a, 2))))])
    end function borrow_i2_2

    function borrow_i4_2(a) result(out)
        integer(int32), intent(in), target :: a(:, :)
        type(insitu_array) :: out
        out = array_of(integer32, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1, 1)), c_loc(a(min(2, size(a, 1)), 1)), &
            c_loc(a(1, min(2, size(a, 2))))])
    end function borrow_i4_2

    function borrow_i8_2(a) result(out)
        integer(int64), intent(in), target :: a(:, :)
        type(insitu_array) :: out
        out = array_of(integer64, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1, 1)), c_loc(a(min(2, size(a, 1)), 1)), &
            c_loc(a(1, min(2, size(a, 2))))])
    end function borrow_i8_2

    function borrow_r4_3(a) result(out)
        real(real32), intent(in), target :: a(:, :, :)
        type(insitu_array) :: out
        out = array_of(float32, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1, 1, 1)), c_loc(a(min(2, size(a, 1)), 1, 1)), &
            c_loc(a(1, min(2, size(a, 2)), 1)), c_loc(a(1, 1, min(2, size(a, 3))))])
    end function borrow_r4_3

    function borrow_r8_3(a) result(out)
        real(real64), intent(in), target :: a(:, :, :)
        type(insitu_array) :: out
        out = array_of(float64, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1, 1, 1)), c_loc(a(min(2, size(a, 1)), 1, 1)), &
            c_loc(a(1, min(2, size(a, 2)), 1)), c_loc(a(1, 1, min(2, size(a, 3))))])
    end function borrow_r8_3

    function borrow_i1_3(a) result(out)
        integer(int8), intent(in), target :: a(:, :, :)
        type(insitu_array) :: out
        out = array_of(bytes, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1, 1, 1)), c_loc(a(min(2, size(a, 1)), 1, 1)), &
            c_loc(a(1, min(2, size(a, 2)), 1)), c_loc(a(1, 1, min(2, size(a, 3))))])
    end function borrow_i1_3

    function borrow_i2_3(a) result(out)
        integer(int16), intent(in), target :: a(:, :, :)
        type(insitu_array) :: out
        out = array_of(integer16, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1, 1, 1)), c_loc(a(min(2, size(a, 1)), 1, 1)), &
            c_loc(a(1, min(2, size(a, 2)), 1)), c_loc(a(1, 1, min(2, size(a, 3))))])
    end function borrow_i2_3

    function borrow_i4_3(a) result(out)
        integer(int32), intent(in), target :: a(:, :, :)
        type(insitu_array) :: out
        out = array_of(integer32, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1, 1, 1)), c_loc(a(min(2, size(a, 1)), 1, 1)), &
            c_loc(a(1, min(2, size(a, 2)), 1)), c_loc(a(1, 1, min(2, size(a, 3))))])
    end function borrow_i4_3

    function borrow_i8_3(a) result(out)
        integer(int64), intent(in), target :: a(:, :, :)
        type(insitu_array) :: out
        out = array_of(integer64, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1, 1, 1)), c_loc(a(min(2, size(a, 1)), 1, 1)), &
            c_loc(a(1, min(2, size(a, 2)), 1)), c_loc(a(1, 1, min(2, size(a, 3))))])
    end function borrow_i8_3

    function borrow_r4_4(a) result(out)
        real(real32), intent(in), target :: a(:, :, :, :)
        type(insitu_array) :: out
        out = array_of(float32, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1, 1, 1, 1)), c_loc(a(min(2, size(a, 1)), 1, 1, 1)), &
            c_loc(a(1, min(2, size(a, 2)), 1, 1)), c_loc(a(1, 1, min(2, size(a, 3)), 1)), &
            c_loc(a(1, 1, 1, min(2, size(a, 4))))])
    end function borrow_r4_4

    function borrow_r8_4(a) result(out)
        real(real64), intent(in), target :: a(:, :, :, :)
        type(insitu_array) :: out
        out = array_of(float64, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1, 1, 1, 1)), c_loc(a(min(2, size(a, 1)), 1, 1, 1)), &
            c_loc(a(1, min(2, size(a, 2)), 1, 1)), c_loc(a(1, 1, min(2, size(a, 3)), 1)), &
            c_loc(a(1, 1, 1, min(2, size(a, 4))))])
    end function borrow_r8_4

    function borrow_i1_4(a) result(out)
        integer(int8), intent(in), target :: a(:, :, :, :)
        type(insitu_array) :: out
        out = array_of(bytes, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1, 1, 1, 1)), c_loc(a(min(2, size(a, 1)), 1, 1, 1)), &
            c_loc(a(1, min(2, size(a, 2)), 1, 1)), c_loc(a(1, 1, min(2, size(a, 3)), 1)), &
            c_loc(a(1, 1, 1, min(2, size(a, 4))))])
    end function borrow_i1_4

    function borrow_i2_4(a) result(out)
        integer(int16), intent(in), target :: a(:, :, :, :)
        type(insitu_array) :: out
        out = array_of(integer16, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1, 1, 1, 1)), c_loc(a(min(2, size(a, 1)), 1, 1, 1)), &
            c_loc(a(1, min(2, size(a, 2)), 1, 1)), c_loc(a(1, 1, min(2, size(a, 3)), 1)), &
            c_loc(a(1, 1, 1, min(2, size(a, 4))))])
    end function borrow_i2_4

    function borrow_i4_4(a) result(out)
        integer(int32), intent(in), target :: a(:, :, :, :)
        type(insitu_array) :: out
        out = array_of(integer32, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1, 1, 1, 1)), c_loc(a(min(2, size(a, 1)), 1, 1, 1)), &
            c_loc(a(1, min(2, size(a, 2)), 1, 1)), c_loc(a(1, 1, min(2, size(a, 3)), 1)), &
            c_loc(a(1, 1, 1, min(2, size(a, 4))))])
    end function borrow_i4_4

    function borrow_i8_4(a) result(out)
        integer(int64), intent(in), target :: a(:, :, :, :)
        type(insitu_array) :: out
        out = array_of(integer64, shape(a))
        if (size(a) > 0) call put_memory(out, [c_loc(a(1, 1, 1, 1)), c_loc(a(min(2, size(a, 1)), 1, 1, 1)), &
            c_loc(a(1, min(2, size(a, 2)), 1, 1)), c_loc(a(1, 1, min(2, size(a, 3)), 1)), &
            c_loc(a(1, 1, 1, min(2, size(a, 4))))])
    end function borrow_i8_4

    ! Returns an array of `count` elements without data, which stands for the z coordinates of plane meshes.
    function absent(count) result(out)
        integer, intent(in) :: count
        type(insitu_array) :: out
        out%columns = count
    end function absent

    ! Returns the three coordinates of a matrix with three or two rows. For any other matrix, returns an array that
    ! set_mesh refuses.
    function points_of_matrix_r4(xyz) result(out)
        real(real32), intent(in), target :: xyz(:, :)
        type(insitu_array) :: out(3)
        integer :: axis
        out%rows = size(xyz, 1)
        if (size(xyz, 1) /= 2 .and. size(xyz, 1) /= 3) return
        out(3) = absent(size(xyz, 2))
        do axis = 1, size(xyz, 1)
            out(axis) = borrow_r4(xyz(axis, :))
        end do
    end function points_of_matrix_r4

    function points_of_matrix_r8(xyz) result(out)
        real(real64), intent(in), target :: xyz(:, :)
        type(insitu_array) :: out(3)
        integer :: axis
        out%rows = size(xyz, 1)
        if (size(xyz, 1) /= 2 .and. size(xyz, 1) /= 3) return
        out(3) = absent(size(xyz, 2))
        do axis = 1, size(xyz, 1)
            out(axis) = borrow_r8(xyz(axis, :))
        end do
    end function points_of_matrix_r8

    function points_of_axes_r4(x, y, z) result(out)
        real(real32), intent(in), target :: x(:), y(:)
        real(real32), intent(in), target, optional :: z(:)
        type(insitu_array) :: out(3)
        out = [borrow_r4(x), borrow_r4(y), absent(size(x))]
        if (present(z)) out(3) = borrow_r4(z)
    end function points_of_axes_r4

    function points_of_axes_r8(x, y, z) result(out)
        real(real64), intent(in), target :: x(:), y(:)
        real(real64), intent(in), target, optional :: z(:)
        type(insitu_array) :: out(3)
        out = [borrow_r8(x), borrow_r8(y), absent(size(x))]
        if (present(z)) out(3) = borrow_r8(z)
    end function points_of_axes_r8

    function pointers_of(pointers, kind) result(out)
        type(c_ptr), intent(in), target :: pointers(:)
        integer, intent(in), optional :: kind
        type(insitu_array) :: out
        out%kind = integer32
        if (present(kind)) out%kind = merge(integer64, integer32, kind == int64)
        out = array_of(out%kind, shape(pointers))
        if (size(pointers) > 0) call put_memory(out, [c_loc(pointers(1)), c_loc(pointers(min(2, size(pointers))))])
    end function pointers_of

    function lists_i4(pointers, sizes, kind) result(out)
        type(c_ptr), intent(in), target :: pointers(:)
        integer(int32), intent(in), target :: sizes(:)
        integer, intent(in), optional :: kind
        type(insitu_face_lists) :: out
        out%lists = pointers_of(pointers, kind)
        out%sizes = borrow_i4(sizes)
    end function lists_i4

    function lists_i8(pointers, sizes, kind) result(out)
        type(c_ptr), intent(in), target :: pointers(:)
        integer(int64), intent(in), target :: sizes(:)
        integer, intent(in), optional :: kind
        type(insitu_face_lists) :: out
        out%lists = pointers_of(pointers, kind)
        out%sizes = borrow_i8(sizes)
    end function lists_i8

    ! Converts a list to the form that is passed to C. An array without elements is also passed as given.
    function as_c(a, nothing) result(out)
        type(insitu_array), intent(in) :: a
        real(real64), intent(in), target :: nothing
        type(c_array) :: out
        out%data = a%data
        if (a%rows * a%columns == 0) out%data = c_loc(nothing)
        out%kind = a%kind
        out%stride = merge(a%row_stride, a%stride, a%rows > 1)
    end function as_c

    ! Returns whether the rows are contiguous, so that the array can be read as a list.
    logical function is_list(a)
        type(insitu_array), intent(in) :: a
        is_list = a%dimensions <= 2 .and. (a%rows <= 1 .or. a%columns <= 1 .or. a%stride == a%rows * a%row_stride)
    end function is_list

    ! Returns the number of elements from the first element of a column to that of the next, if there are further
    ! elements between the columns. Returns 0 if there are none, or if the distance is not a multiple of the element's
    ! size.
    integer(c_int64_t) function row_of(a)
        type(insitu_array), intent(in) :: a
        row_of = 0
        if (is_list(a) .or. a%row_stride == 0 .or. a%dimensions > 2) return
        if (mod(a%stride, a%row_stride) == 0 .and. a%stride / a%row_stride > a%rows) row_of = a%stride / a%row_stride
    end function row_of

    ! ---- blocks ---------------------------------------------------------------------------------------------------

    ! Creates a block with these numbers of cells, whose strides are not known yet, and its lattice, in which only the
    ! cells are set.
    subroutine make_block(cells, lattice, block, fault)
        integer, intent(in) :: cells(:)
        type(c_lattice), intent(out) :: lattice
        type(block_shape), intent(out) :: block
        character(:), allocatable, intent(out) :: fault
        type(c_array), parameter :: none = c_array(c_null_ptr, float32, 0)
        integer(c_int64_t), parameter :: zero(3) = 0
        lattice = c_lattice(zero, zero, zero, zero, zero, [0, 0, 0], [0, 0, 0], zero, [none, none, none], &
            zero)
        fault = 'cells are '//as_text(int(cells, c_int64_t))//', expected two or three numbers of at least 1, or all 0 '// &
            'without cells'
        if (size(cells) < 2 .or. size(cells) > 3) return
        if (any(cells < 0) .or. (any(cells == 0) .and. any(cells /= 0))) return
        fault = 'cells are '//as_text(int(cells, c_int64_t))//', too many, expected at most 4294967294 in all'
        if (product(real(cells, real64)) > 4294967294.0_real64) return
        fault = ''
        block%dimensions = size(cells)
        lattice%cells(:size(cells)) = cells
        block%extents(:size(cells), 2) = cells
        block%extents(:size(cells), 1) = cells + merge(1, 0, cells > 0)
    end subroutine make_block

    ! Checks the length of an argument that has one number per axis. For blocks of two dimensions the third number may
    ! be missing.
    subroutine check_size(what, length, dimensions, fault)
        character(*), intent(in) :: what
        integer, intent(in) :: length, dimensions
        character(:), allocatable, intent(inout) :: fault
        if (len(fault) > 0 .or. length == dimensions .or. length == 3) return
        fault = what//' has '//as_text([int(length, c_int64_t)])//' numbers, expected '// &
            as_text([int(dimensions, c_int64_t)])//', one for each axis'
    end subroutine check_size

    subroutine put_ranges(lattice, dimensions, fault, spacing, origin, first, interior_first, interior_last, refinement)
        type(c_lattice), intent(inout) :: lattice
        integer, intent(in) :: dimensions
        character(:), allocatable, intent(inout) :: fault
        real(real64), intent(in), optional :: spacing(:), origin(:)
        integer, intent(in), optional :: first(:), interior_first(:), interior_last(:), refinement(:)
        if (present(refinement)) call check_size('refinement', size(refinement), dimensions, fault)
        if (present(spacing)) call check_size('spacing', size(spacing), dimensions, fault)
        if (present(origin)) call check_size('origin', size(origin), dimensions, fault)
        if (present(first)) call check_size('first', size(first), dimensions, fault)
        if (present(interior_first)) call check_size('interior_first', size(interior_first), dimensions, fault)
        if (present(interior_last)) call check_size('interior_last', size(interior_last), dimensions, fault)
        if (len(fault) == 0 .and. .not. present(spacing) .and. &
            (present(origin) .or. (present(first) .and. .not. present(refinement)))) &
            fault = 'spacing is not given, and origin or first is; expected it for a uniform block'
        if (len(fault) == 0 .and. (present(interior_first) .neqv. present(interior_last))) &
            fault = 'one of interior_first and interior_last is given, expected both or none'
        if (len(fault) > 0) return
        if (present(spacing)) lattice%spacing(:size(spacing)) = spacing
        if (present(origin)) lattice%origin(:size(origin)) = origin
        if (present(first)) lattice%first(:size(first)) = first
        if (present(refinement)) lattice%refinement = 1
        if (present(refinement)) lattice%refinement(:size(refinement)) = refinement
        if (.not. present(interior_first)) return
        lattice%interior_end(3) = 1
        lattice%interior_first(:size(interior_first)) = interior_first - 1
        lattice%interior_end(:size(interior_last)) = interior_last
        if (any(lattice%interior_first /= 0) .or. any(lattice%interior_end /= 0)) return
        lattice%interior_first = 1 ! not 0, because in C all 0 means that all cells are drawn
        lattice%interior_end = 1
    end subroutine put_ranges

    ! Sets the coordinates of a block: a list along the axis, or an array over its vertices.
    subroutine put_places(block, mesh, lattice, axis, what, fault, nothing, given)
        type(block_shape), intent(inout) :: block
        type(c_mesh), intent(inout) :: mesh
        type(c_lattice), intent(inout) :: lattice
        integer, intent(in) :: axis
        character(*), intent(in) :: what
        character(:), allocatable, intent(inout) :: fault
        real(real64), intent(in), target :: nothing
        type(insitu_array), intent(in), optional :: given
        type(block_array) :: laid
        if (.not. present(given)) return
        if (len(fault) > 0 .or. block%extents(1, 2) == 0) return
        if (given%dimensions > 1) then
            call borrow_for(block, what, 1, .false., laid, fault, nothing, given)
            mesh%coordinates(axis) = laid%array
        else if (given%columns /= block%extents(axis, 1)) then
            fault = what//' has '//as_text([given%columns])//' elements, expected '//as_text(block%extents(axis:axis, 1))// &
                ', one more than there are cells, or the shape '//as_text(block%extents(:block%dimensions, 1))
        else
            lattice%axes(axis) = as_c(given, nothing)
        end if
    end subroutine put_places

    ! Borrows an array over a block's vertices (of = 1) or cells (of = 2). It is an array (i, j, k), with components as
    ! the first or last dimension, or a list as long as the block's arrays.
    subroutine borrow_for(block, what, of, may_have_components, laid, fault, nothing, given)
        type(block_shape), intent(inout) :: block
        character(*), intent(in) :: what
        integer, intent(in) :: of
        logical, intent(in) :: may_have_components
        type(block_array), intent(out) :: laid
        character(:), allocatable, intent(inout) :: fault
        real(real64), intent(in), target :: nothing
        type(insitu_array), intent(in), optional :: given
        integer :: skipped, dimensions, beside
        laid%array = c_array(c_null_ptr, float32, 0)
        if (.not. present(given) .or. len(fault) > 0) return
        dimensions = block%dimensions
        laid%array = as_c(given, nothing)
        laid%array%stride = given%stride
        laid%count = count_of(block, of)
        if (given%dimensions == 1) then
            if (given%columns == laid%count) return
            fault = what//' is a list of '//as_text([given%columns])//', expected '//as_text([laid%count])//' or '// &
                shape_text(block, of, .false.)
            return
        end if
        skipped = 0 ! number of dimensions of components before i
        if (may_have_components .and. given%dimensions == dimensions + 1) then
            if (all(given%extents(2:dimensions + 1) == block%extents(:dimensions, of))) skipped = 1
            beside = merge(1, dimensions + 1, skipped == 1)
            laid%components = given%extents(beside)
            laid%component_stride = given%steps(beside)
        end if
        if (laid%count == 0) then
            laid%array%data = c_loc(nothing)
        else if (given%dimensions - merge(1, 0, may_have_components .and. given%dimensions > dimensions) /= dimensions .or. &
            any(given%extents(skipped + 1:skipped + dimensions) /= block%extents(:dimensions, of))) then
            fault = what//' has the shape '//as_text(given%extents(:given%dimensions))//', expected '// &
                shape_text(block, of, may_have_components)
        else
            call fit(block, what, of, given%steps(skipped + 1:skipped + dimensions), laid%array%stride, fault)
        end if
    end subroutine borrow_for

    ! Finds the common divisor of an array's strides, in bytes, and checks that the strides, as multiples of this
    ! divisor, equal those of the block's other arrays.
    subroutine fit(block, what, of, steps, unit, fault)
        type(block_shape), intent(inout) :: block
        character(*), intent(in) :: what
        integer, intent(in) :: of
        integer(c_int64_t), intent(in) :: steps(:)
        integer(c_int64_t), intent(out) :: unit
        character(:), allocatable, intent(inout) :: fault
        integer(c_int64_t) :: strides(3)
        integer :: axis
        character(*), parameter :: things(2) = ['vertices', 'cells   '], layouts(2) = ['vertex_layout', 'cell_layout  ']
        unit = 0
        do axis = 1, size(steps)
            if (block%extents(axis, of) > 1) unit = divisor(unit, steps(axis))
            if (block%extents(axis, of) > 1 .and. steps(axis) <= 0) fault = what//' has strides of '//as_text(steps)// &
                ' bytes, expected positive ones'
        end do
        if (len(fault) > 0 .or. unit == 0) return
        strides = 1
        where (block%extents(:size(steps), of) > 1) strides(:size(steps)) = steps / unit
        if (.not. block%has_strides(of)) block%strides(:, of) = strides
        block%has_strides(of) = .true.
        if (all(strides == block%strides(:, of))) return
        fault = what//' has strides of '//as_text(steps)//' bytes, which are as '//as_text(strides(:size(steps)))// &
            ', expected as '//as_text(block%strides(:size(steps), of))//': all arrays of the '//trim(things(of))// &
            ' of a block have one order and padding ('//trim(layouts(of))//' of set_block says which)'
    end subroutine fit

    pure recursive integer(c_int64_t) function divisor(a, b) result(out)
        integer(c_int64_t), intent(in) :: a, b
        out = a
        if (b /= 0) out = divisor(b, mod(a, b))
    end function divisor

    ! Sets packed strides, in which i varies fastest, if no array has determined the strides.
    subroutine pack_strides(block, of)
        type(block_shape), intent(inout) :: block
        integer, intent(in) :: of
        if (block%has_strides(of)) return
        block%strides(:, of) = [1_c_int64_t, block%extents(1, of), block%extents(1, of) * block%extents(2, of)]
        where (block%extents(:, of) <= 1) block%strides(:, of) = 1
        block%has_strides(of) = .true.
    end subroutine pack_strides

    ! Returns the length of the block's arrays, from the first to the last element.
    pure integer(c_int64_t) function count_of(block, of)
        type(block_shape), intent(in) :: block
        integer, intent(in) :: of
        type(block_shape) :: packed
        packed = block
        if (.not. block%has_strides(of)) &
            packed%strides(:, of) = [1_c_int64_t, block%extents(1, of), block%extents(1, of) * block%extents(2, of)]
        count_of = 1 + sum((packed%extents(:, of) - 1) * packed%strides(:, of))
        if (any(block%extents(:, of) == 0)) count_of = 0
    end function count_of

    function shape_text(block, of, may_have_components) result(out)
        type(block_shape), intent(in) :: block
        integer, intent(in) :: of
        logical, intent(in) :: may_have_components
        character(:), allocatable :: out
        out = as_text(block%extents(:block%dimensions, of))
        if (may_have_components) out = out//', with components before or after,'
        out = out//' for the '//trim(merge('vertices', 'cells   ', of == 1))//' of the block'
    end function shape_text

    ! ---- texts ----------------------------------------------------------------------------------------------------

    ! Formats numbers for messages: 5, or (1, 12, 144).
    function as_text(numbers) result(out)
        integer(c_int64_t), intent(in) :: numbers(:)
        character(:), allocatable :: out
        character(24) :: digits
        integer :: i
        out = ''
        do i = 1, size(numbers)
            write (digits, '(i0)') numbers(i)
            if (i > 1) out = out//', '
            out = out//trim(digits)
        end do
        if (size(numbers) /= 1) out = '('//out//')'
    end function as_text

    ! Returns a text of C, such as a text of the report, which must still be valid.
    function insitu_text(from) result(out)
        type(c_ptr), intent(in) :: from
        character(:), allocatable :: out
        character(kind=c_char), pointer :: letters(:)
        integer :: i, length
        length = 0
        if (c_associated(from)) length = int(c_strlen(from))
        allocate (character(length) :: out)
        if (length == 0) return
        call c_f_pointer(from, letters, [length])
        do i = 1, length
            out(i:i) = letters(i)
        end do
    end function insitu_text

    function as_c_text(text) result(out)
        character(*), intent(in) :: text
        character(kind=c_char) :: out(len_trim(text) + 1)
        integer :: i
        do i = 1, len_trim(text)
            out(i) = text(i:i)
        end do
        out(len_trim(text) + 1) = c_null_char
    end function as_c_text

    ! ---- sessions -------------------------------------------------------------------------------------------------

    subroutine create_integer(self, comm, scene_file, status)
        class(insitu_session), intent(inout) :: self
        integer, intent(in) :: comm
        character(*), intent(in) :: scene_file
        integer, intent(out) :: status
        self%own_error = ''
        status = c_create(int(comm, c_int), as_c_text(scene_file), 0_c_int, self%handle)
    end subroutine create_integer

    subroutine create_f08(self, comm, scene_file, status)
        class(insitu_session), intent(inout) :: self
        type(MPI_Comm), intent(in) :: comm
        character(*), intent(in) :: scene_file
        integer, intent(out) :: status
        call self%create_integer(comm%MPI_VAL, scene_file, status)
    end subroutine create_f08

    subroutine text_integer(self, comm, scene_text, status)
        class(insitu_session), intent(inout) :: self
        integer, intent(in) :: comm
        character(*), intent(in) :: scene_text
        integer, intent(out) :: status
        self%own_error = ''
        status = c_create(int(comm, c_int), as_c_text(scene_text), 1_c_int, self%handle)
    end subroutine text_integer

    subroutine text_f08(self, comm, scene_text, status)
        class(insitu_session), intent(inout) :: self
        type(MPI_Comm), intent(in) :: comm
        character(*), intent(in) :: scene_text
        integer, intent(out) :: status
        call self%text_integer(comm%MPI_VAL, scene_text, status)
    end subroutine text_f08

    ! Describes the first argument that cannot be passed to C; '' if there is none. row: result of row_of(); 0 if the
    ! connectivity must not have gaps.
    function find_fault(points, connectivity, row, lists, face_lists) result(out)
        type(insitu_array), intent(in) :: points(3), connectivity, lists(:)
        integer(c_int64_t), intent(in) :: row
        type(insitu_face_lists), intent(in), optional :: face_lists
        character(:), allocatable :: out
        out = ''
        if (points(1)%rows /= 1 .or. any(points%dimensions > 1)) then
            out = 'points have another first extent than 2 or 3'
        else if (any(points%columns /= points(1)%columns)) then
            out = 'x, y and z are of different lengths'
        else if (row == 0 .and. .not. is_list(connectivity)) then
            out = 'connectivity or faces have gaps between their columns, which must follow one another'
        else if (any(lists%rows > 1 .or. lists%dimensions > 2)) then
            out = 'cell_types, offsets, face_offsets, owner, neighbour, ghosts and vertex_ids are lists, one is a matrix'
        end if
        if (len(out) > 0 .or. .not. present(face_lists)) return
        if (face_lists%lists%columns /= face_lists%sizes%columns) out = 'the lists of faces are not as many as their sizes'
    end function find_fault

    ! Describes a name that contains a NUL, at which C would end it; '' if there is no such name.
    function find_zero(name, mesh) result(out)
        character(*), intent(in) :: name
        character(*), intent(in), optional :: mesh
        character(:), allocatable :: out
        out = ''
        if (index(name, c_null_char) > 0) out = 'a name holds a character 0'
        if (.not. present(mesh)) return
        if (index(mesh, c_null_char) > 0) out = 'a name holds a character 0'
    end function find_zero

    ! Returns whether an argument is faulty, and stores the fault as the session's message. If there is no fault, the
    ! last message is kept.
    logical function is_refused(self, fault)
        class(insitu_session), intent(inout) :: self
        character(*), intent(in) :: fault
        is_refused = len(fault) > 0
        if (is_refused) self%own_error = fault
    end function is_refused

    ! Stores the status of a call of C in status. If the call failed, error() returns its message.
    subroutine take_status(self, of_c, status)
        class(insitu_session), intent(inout) :: self
        integer(c_int), intent(in) :: of_c
        integer, intent(out) :: status
        status = of_c
        if (status == INSITU_OK) return
        self%own_error = ''
        if (.not. c_associated(self%handle)) self%own_error = 'the session is not open'
    end subroutine take_status

    subroutine take_lists(mesh, face_lists, nothing)
        type(c_mesh), intent(inout) :: mesh
        type(insitu_face_lists), intent(in) :: face_lists
        real(real64), intent(in), target :: nothing
        mesh%face_count = face_lists%lists%columns
        mesh%face_lists = as_c(face_lists%lists, nothing)
        mesh%face_sizes = as_c(face_lists%sizes, nothing)
    end subroutine take_lists

    ! Passes this rank's part of a mesh to the session. connectivity is a list or, for cells of one type, a matrix
    ! (corners, cells), which may consist of the first rows of a larger one. Vertices are in VTK's order, or in
    ! vertex_order. For Lagrange cells connectivity is a matrix, whose first extent determines their order, unless there
    ! are offsets. For polyhedra, connectivity lists faces; faces and face_offsets are then the vertices of the faces
    ! and the index at which each face begins, or face_lists replaces both. All indices and offsets count from 1, or
    ! from index_base.
    subroutine set_mesh(self, name, points, connectivity, status, cell_type, cell_types, offsets, faces, face_offsets, &
        ghosts, vertex_ids, changed, index_base, keep_polyhedra, vertex_order, face_lists, number)
        class(insitu_session), intent(inout) :: self
        character(*), intent(in) :: name
        type(insitu_array), intent(in) :: points(3), connectivity
        integer, intent(out) :: status
        integer, intent(in), optional :: cell_type, changed, index_base, vertex_order, number
        type(insitu_array), intent(in), optional :: cell_types, offsets, faces, face_offsets, ghosts, vertex_ids
        type(insitu_face_lists), intent(in), optional :: face_lists
        logical, intent(in), optional :: keep_polyhedra
        type(insitu_array) :: given(6)
        ! number of elements between the last element of a column and the first one of the next
        integer(c_int64_t) :: gap
        type(c_mesh), target :: mesh
        real(real64), target :: nothing
        character(:), allocatable :: fault, part
        integer :: axis, corners
        nothing = 0
        call c_mesh_defaults(mesh)
        mesh%index_base = 1
        if (present(cell_type)) mesh%cell_type = cell_type
        if (present(changed)) mesh%changed = changed
        if (present(index_base)) mesh%index_base = index_base
        if (present(keep_polyhedra)) mesh%keep_polyhedra = merge(1_c_int, 0_c_int, keep_polyhedra)
        if (present(cell_types)) given(1) = cell_types
        if (present(offsets)) given(2) = offsets
        if (present(face_offsets)) given(3) = face_offsets
        if (present(ghosts)) given(4) = ghosts
        if (present(vertex_ids)) given(5) = vertex_ids
        if (present(faces)) given(6) = faces
        if (present(vertex_order)) mesh%vertex_order = vertex_order
        if (.not. (present(offsets) .or. present(cell_types))) mesh%connectivity_row = row_of(connectivity)
        gap = max(0_c_int64_t, mesh%connectivity_row - connectivity%rows)
        fault = find_fault(points, connectivity, mesh%connectivity_row, given(1:5), face_lists)
        if (len(fault) == 0) fault = find_zero(name)
        status = INSITU_ERROR_ARGUMENT
        if (is_refused(self, fault)) return
        mesh%vertex_count = points(1)%columns
        do axis = 1, 3
            mesh%coordinates(axis) = as_c(points(axis), nothing)
        end do
        mesh%connectivity_count = connectivity%rows * connectivity%columns + gap * max(0_c_int64_t, connectivity%columns - 1)
        mesh%connectivity = as_c(connectivity, nothing)
        if (present(cell_types)) mesh%cell_types = as_c(cell_types, nothing)
        if (present(offsets)) mesh%offsets = as_c(offsets, nothing)
        if (present(ghosts)) mesh%ghosts = as_c(ghosts, nothing)
        if (present(vertex_ids)) mesh%vertex_ids = as_c(vertex_ids, nothing)
        if (present(face_offsets)) mesh%face_offsets = as_c(face_offsets, nothing)
        if (present(face_offsets)) mesh%face_count = max(0_c_int64_t, face_offsets%columns - 1)
        if (present(faces)) mesh%face_connectivity = as_c(faces, nothing)
        mesh%face_connectivity_count = given(6)%rows * given(6)%columns
        if (present(face_lists)) call take_lists(mesh, face_lists, nothing)
        corners = corners_of(mesh%cell_type)
        if (mesh%cell_type >= INSITU_LAGRANGE_TRIANGLE .and. mesh%cell_type <= INSITU_LAGRANGE_PYRAMID) &
            corners = int(connectivity%rows)
        if (present(cell_types)) then
            mesh%cell_count = cell_types%columns
        else if (present(offsets)) then
            mesh%cell_count = max(0_c_int64_t, offsets%columns - 1)
        else
            mesh%cell_count = connectivity%rows * connectivity%columns / max(1, corners)
        end if
        fault = find_length(mesh%cell_count, mesh%vertex_count, connectivity%rows, corners, given(1:5))
        if (is_refused(self, fault)) return
        call set_part(self, name, c_loc(mesh), status, number)
        if (present(offsets) .or. present(cell_types)) corners = 0
        if (status /= INSITU_OK) return
        part = part_name(name, number)
        call note_size(self, mesh_size(part, mesh%vertex_count, mesh%cell_count, &
            merge(mesh%cell_count * corners, mesh%connectivity_count, corners > 0), corners))
    end subroutine set_mesh

    ! Passes this rank's part of a finite-volume mesh to the session. The faces are given by their vertices and the
    ! index at which each face begins, or by a list for each face. Each face also has the cell that owns it and the
    ! neighbour on its other side. For faces on the boundary the neighbour is 0 (index_base - 1); or these faces come
    ! last and have no entry in neighbour; or they are in a separate list, with boundary_faces, the index at which each
    ! of them begins, and its only cell. owner and neighbour may refer to halo_cells cells of a halo, which are numbered
    ! after cell_count.
    subroutine set_faces_by_offsets(self, name, points, faces, face_offsets, owner, neighbour, cell_count, status, ghosts, &
        vertex_ids, changed, index_base, keep_polyhedra, boundary_faces, boundary_offsets, boundary_owner, halo_cells)
        class(insitu_session), intent(inout) :: self
        character(*), intent(in) :: name
        type(insitu_array), intent(in) :: points(3), faces, face_offsets, owner, neighbour
        integer, intent(in) :: cell_count
        integer, intent(out) :: status
        type(insitu_array), intent(in), optional :: ghosts, vertex_ids, boundary_faces, boundary_offsets, boundary_owner
        integer, intent(in), optional :: changed, index_base, halo_cells
        logical, intent(in), optional :: keep_polyhedra
        type(c_mesh), target :: mesh
        real(real64), target :: nothing
        character(:), allocatable :: fault
        nothing = 0
        call c_mesh_defaults(mesh)
        status = INSITU_ERROR_ARGUMENT
        fault = find_fault(points, faces, 0_c_int64_t, [face_offsets])
        if (len(fault) == 0 .and. face_offsets%columns /= owner%columns + 1) fault = 'face_offsets are not one more than owner'
        if (len(fault) == 0 .and. any([present(boundary_faces), present(boundary_offsets)] .neqv. present(boundary_owner))) &
            fault = 'boundary_faces, boundary_offsets and boundary_owner are given together or not at all'
        if (len(fault) == 0 .and. present(boundary_owner)) &
            fault = find_boundary_fault(points, boundary_faces, boundary_offsets, boundary_owner)
        if (is_refused(self, fault)) return
        if (present(halo_cells)) mesh%halo_cell_count = halo_cells
        if (present(boundary_owner)) then
            mesh%boundary_face_count = boundary_owner%columns
            mesh%boundary_owner = as_c(boundary_owner, nothing)
            mesh%boundary_face_offsets = as_c(boundary_offsets, nothing)
            mesh%boundary_face_connectivity_count = boundary_faces%rows * boundary_faces%columns
            mesh%boundary_face_connectivity = as_c(boundary_faces, nothing)
        end if
        mesh%face_count = max(0_c_int64_t, face_offsets%columns - 1)
        mesh%face_offsets = as_c(face_offsets, nothing)
        mesh%face_connectivity_count = faces%rows * faces%columns
        mesh%face_connectivity = as_c(faces, nothing)
        call set_owned(self, mesh, name, points, owner, neighbour, cell_count, status, ghosts, vertex_ids, changed, &
            index_base, keep_polyhedra)
    end subroutine set_faces_by_offsets

    ! Describes the first argument of the separate list of boundary faces that cannot be passed to C; '' if there is
    ! none.
    function find_boundary_fault(points, faces, offsets, owner) result(out)
        type(insitu_array), intent(in) :: points(3), faces, offsets, owner
        character(:), allocatable :: out
        out = find_fault(points, faces, 0_c_int64_t, [offsets, owner])
        if (len(out) == 0 .and. offsets%columns /= owner%columns + 1) &
            out = 'boundary_offsets are not one more than boundary_owner'
    end function find_boundary_fault

    subroutine set_faces_by_lists(self, name, points, face_lists, owner, neighbour, cell_count, status, ghosts, vertex_ids, &
        changed, index_base, keep_polyhedra)
        class(insitu_session), intent(inout) :: self
        character(*), intent(in) :: name
        type(insitu_array), intent(in) :: points(3), owner, neighbour
        type(insitu_face_lists), intent(in) :: face_lists
        integer, intent(in) :: cell_count
        integer, intent(out) :: status
        type(insitu_array), intent(in), optional :: ghosts, vertex_ids
        integer, intent(in), optional :: changed, index_base
        logical, intent(in), optional :: keep_polyhedra
        type(c_mesh), target :: mesh
        real(real64), target :: nothing
        character(:), allocatable :: fault
        nothing = 0
        call c_mesh_defaults(mesh)
        status = INSITU_ERROR_ARGUMENT
        fault = find_fault(points, owner, 0_c_int64_t, [face_lists%sizes], face_lists)
        if (len(fault) == 0 .and. face_lists%lists%columns /= owner%columns) &
            fault = 'the lists of faces are not as many as owner'
        if (is_refused(self, fault)) return
        call take_lists(mesh, face_lists, nothing)
        call set_owned(self, mesh, name, points, owner, neighbour, cell_count, status, ghosts, vertex_ids, changed, &
            index_base, keep_polyhedra)
    end subroutine set_faces_by_lists

    ! Passes a mesh to C in which the faces are already set.
    subroutine set_owned(self, mesh, name, points, owner, neighbour, cell_count, status, ghosts, vertex_ids, changed, &
        index_base, keep_polyhedra)
        class(insitu_session), intent(inout) :: self
        type(c_mesh), intent(inout), target :: mesh
        character(*), intent(in) :: name
        type(insitu_array), intent(in) :: points(3), owner, neighbour
        integer, intent(in) :: cell_count
        integer, intent(out) :: status
        type(insitu_array), intent(in), optional :: ghosts, vertex_ids
        integer, intent(in), optional :: changed, index_base
        logical, intent(in), optional :: keep_polyhedra
        type(insitu_array) :: given(4)
        real(real64), target :: nothing
        character(:), allocatable :: fault, part
        integer :: axis
        nothing = 0
        mesh%index_base = 1
        mesh%cell_type = INSITU_POLYHEDRON
        mesh%cell_count = cell_count
        if (present(changed)) mesh%changed = changed
        if (present(index_base)) mesh%index_base = index_base
        if (present(keep_polyhedra)) mesh%keep_polyhedra = merge(1_c_int, 0_c_int, keep_polyhedra)
        given(1:2) = [owner, neighbour]
        if (present(ghosts)) given(3) = ghosts
        if (present(vertex_ids)) given(4) = vertex_ids
        fault = find_fault(points, owner, 0_c_int64_t, given)
        if (len(fault) == 0) fault = find_face_length(points(1)%columns, mesh%cell_count, given(3:4))
        if (len(fault) == 0) fault = find_zero(name)
        status = INSITU_ERROR_ARGUMENT
        if (is_refused(self, fault)) return
        mesh%vertex_count = points(1)%columns
        do axis = 1, 3
            mesh%coordinates(axis) = as_c(points(axis), nothing)
        end do
        mesh%owner = as_c(owner, nothing)
        mesh%neighbour_count = neighbour%columns
        mesh%neighbour = as_c(neighbour, nothing)
        if (present(ghosts)) mesh%ghosts = as_c(ghosts, nothing)
        if (present(vertex_ids)) mesh%vertex_ids = as_c(vertex_ids, nothing)
        call take_status(self, c_set_mesh(self%handle, as_c_text(name), c_loc(mesh)), status)
        if (status /= INSITU_OK) return
        part = part_name(name)
        call note_size(self, mesh_size(part, mesh%vertex_count, mesh%cell_count, 0_c_int64_t, 0))
    end subroutine set_owned

    ! Passes a mesh to C or, if a number is given, one of its blocks. If mesh is absent, the mesh or block is removed.
    subroutine set_part(self, name, mesh, status, number)
        class(insitu_session), intent(inout) :: self
        character(*), intent(in) :: name
        type(c_ptr), intent(in) :: mesh
        integer, intent(out) :: status
        integer, intent(in), optional :: number
        if (present(number)) then
            call take_status(self, c_set_block(self%handle, as_c_text(name), int(number, c_int64_t), mesh), status)
        else
            call take_status(self, c_set_mesh(self%handle, as_c_text(name), mesh), status)
        end if
    end subroutine set_part

    ! Does the same as find_length() for a mesh of faces. given: ghosts, vertex_ids.
    function find_face_length(vertices, cells, given) result(out)
        integer(c_int64_t), intent(in) :: vertices, cells
        type(insitu_array), intent(in) :: given(2)
        character(:), allocatable :: out
        out = ''
        if (given(1)%columns > 0 .and. given(1)%columns /= cells) then
            out = 'ghosts are not as many as the cells'
        else if (given(2)%columns > 0 .and. given(2)%columns /= vertices) then
            out = 'vertex_ids are not as many as the vertices'
        end if
    end function find_face_length

    ! Describes an array whose length is wrong; '' if there is none. C does not get these lengths, and would read beyond
    ! the end. given: cell_types, offsets, face_offsets, ghosts, vertex_ids.
    function find_length(cells, vertices, rows, corners, given) result(out)
        integer(c_int64_t), intent(in) :: cells, vertices, rows
        integer, intent(in) :: corners
        type(insitu_array), intent(in) :: given(5)
        character(:), allocatable :: out
        logical :: is_given(5)
        is_given = given%columns > 0
        out = ''
        if (.not. any(is_given(1:2)) .and. corners > 0 .and. rows > 1 .and. rows /= corners) then
            out = 'connectivity has another first extent than cells of its type have vertices'
        else if (is_given(2) .and. given(2)%columns /= cells + 1) then
            out = 'offsets are not one more than the cells'
        else if (is_given(4) .and. given(4)%columns /= cells) then
            out = 'ghosts are not as many as the cells'
        else if (is_given(5) .and. given(5)%columns /= vertices) then
            out = 'vertex_ids are not as many as the vertices'
        end if
    end function find_length

    ! Returns the number of vertices of a cell type; 0 for types without a fixed number, and for unknown types.
    pure integer function corners_of(cell_type)
        integer(c_int), intent(in) :: cell_type
        select case (cell_type)
        case (INSITU_TET); corners_of = 4
        case (INSITU_HEX); corners_of = 8
        case (INSITU_WEDGE); corners_of = 6
        case (INSITU_PYRAMID); corners_of = 5
        case (INSITU_TRIANGLE); corners_of = 3
        case (INSITU_QUAD); corners_of = 4
        case (INSITU_QUADRATIC_TRIANGLE); corners_of = 6
        case (INSITU_QUADRATIC_QUAD); corners_of = 8
        case (INSITU_QUADRATIC_TET); corners_of = 10
        case (INSITU_QUADRATIC_HEX); corners_of = 20
        case (INSITU_QUADRATIC_WEDGE); corners_of = 15
        case (INSITU_QUADRATIC_PYRAMID); corners_of = 13
        case (INSITU_BIQUADRATIC_QUAD); corners_of = 9
        case (INSITU_TRIQUADRATIC_HEX); corners_of = 27
        case (INSITU_BIQUADRATIC_WEDGE); corners_of = 18
        case default; corners_of = 0
        end select
    end function corners_of

    subroutine note_size(self, new)
        class(insitu_session), intent(inout) :: self
        type(mesh_size), intent(in) :: new
        type(mesh_size), allocatable :: more(:)
        integer :: at
        at = size_at(self, new%name)
        if (at == 0) then
            if (.not. allocated(self%sizes)) allocate (self%sizes(8))
            if (self%size_count == size(self%sizes)) then
                allocate (more(2 * self%size_count))
                more(:self%size_count) = self%sizes
                call move_alloc(more, self%sizes)
            end if
            self%size_count = self%size_count + 1
            at = self%size_count
        end if
        self%sizes(at) = new
        self%last_size = at
    end subroutine note_size

    ! Returns the name of a mesh or block in the list of sizes.
    function part_name(name, number) result(out)
        character(*), intent(in) :: name
        integer, intent(in), optional :: number
        character(:), allocatable :: out
        out = trim(name)
        if (present(number)) out = out//'['//as_text([int(number, c_int64_t)])//']'
    end function part_name

    ! Returns the index of a mesh or block in the list of sizes; 0 if it is missing. Names are mostly requested in the
    ! order of the list, so that the search begins at the entry that was found last.
    integer function size_at(self, name)
        class(insitu_session), intent(inout) :: self
        character(*), intent(in) :: name
        integer :: i
        do i = 1, self%size_count
            size_at = 1 + mod(self%last_size + i - 2, self%size_count)
            if (self%sizes(size_at)%name /= name) cycle
            self%last_size = size_at
            return
        end do
        size_at = 0
    end function size_at

    ! Returns the shape of a mesh or block, for fields at its vertices or in its cells.
    function block_of(self, part, centring) result(out)
        class(insitu_session), intent(inout) :: self
        character(*), intent(in) :: part
        integer(c_int), intent(in) :: centring
        type(block_shape) :: out
        integer :: at
        if (centring /= INSITU_VERTEX .and. centring /= INSITU_CELL) return
        at = size_at(self, part)
        if (at > 0) out = self%sizes(at)%block
    end function block_of

    ! Returns whether a field's index has an entry for each vertex, cell or corner. Also returns true in cases that C
    ! refuses anyway.
    logical function is_as_long(self, part, centring, row, length)
        class(insitu_session), intent(inout) :: self
        character(*), intent(in) :: part
        integer(c_int), intent(in) :: centring
        integer(c_int64_t), intent(in) :: row, length
        integer :: at
        is_as_long = .true.
        at = size_at(self, part)
        if (at == 0) return
        select case (centring)
        case (INSITU_VERTEX); is_as_long = length == self%sizes(at)%vertices
        case (INSITU_CELL); is_as_long = length == self%sizes(at)%cells
        case default
            is_as_long = length == self%sizes(at)%corners
            if (row > 0) is_as_long = length >= (self%sizes(at)%cells - 1) * row + self%sizes(at)%cell_size
        end select
    end function is_as_long

    ! Passes this rank's part of a mesh to the session as a structured block, with the given numbers of cells along i, j
    ! and k, or of quads along i and j. If number (from 0 on) is given, it is one of several blocks of the mesh. Uniform
    ! coordinates: spacing and origin (0 by default) of the lattice; first: number of cells of the lattice before the
    ! block along each axis. Rectilinear coordinates: x, y and z are lists along the axes. Curvilinear coordinates: x, y
    ! and z are arrays (i, j, k). Cells with indices from interior_first to interior_last, counted from 1, are drawn;
    ! all other cells are ghost layers. vertex_layout, cell_layout: any arrays with the memory layout of later fields at
    ! vertices and in cells. If these and all other arrays are missing, fields are packed with i fastest. refinement:
    ! number of the block's cells along a cell of the coarsest level, for each axis; cells that finer blocks cover are
    ! not drawn. docs/structured.md describes blocks.
    subroutine set_block(self, name, cells, status, spacing, origin, first, x, y, z, interior_first, interior_last, ghosts, &
        vertex_ids, vertex_layout, cell_layout, changed, refinement, number)
        class(insitu_session), intent(inout) :: self
        character(*), intent(in) :: name
        integer, intent(in) :: cells(:)
        integer, intent(out) :: status
        real(real64), intent(in), optional :: spacing(:), origin(:)
        integer, intent(in), optional :: first(:), interior_first(:), interior_last(:), changed, refinement(:), number
        type(insitu_array), intent(in), optional :: x, y, z, ghosts, vertex_ids, vertex_layout, cell_layout
        type(c_mesh), target :: mesh
        type(c_lattice), target :: lattice
        type(block_shape) :: block
        type(block_array) :: laid
        real(real64), target :: nothing
        character(:), allocatable :: fault, part
        nothing = 0
        call c_mesh_defaults(mesh)
        call make_block(cells, lattice, block, fault)
        if (len(fault) == 0) call put_ranges(lattice, size(cells), fault, spacing, origin, first, &
            interior_first, interior_last, refinement)
        call borrow_for(block, 'vertex_layout', 1, .true., laid, fault, nothing, vertex_layout)
        call borrow_for(block, 'cell_layout', 2, .true., laid, fault, nothing, cell_layout)
        call put_places(block, mesh, lattice, 1, 'x', fault, nothing, x)
        call put_places(block, mesh, lattice, 2, 'y', fault, nothing, y)
        call put_places(block, mesh, lattice, 3, 'z', fault, nothing, z)
        call borrow_for(block, 'vertex_ids', 1, .false., laid, fault, nothing, vertex_ids)
        if (present(vertex_ids)) mesh%vertex_ids = laid%array
        call borrow_for(block, 'ghosts', 2, .false., laid, fault, nothing, ghosts)
        if (present(ghosts)) mesh%ghosts = laid%array
        if (len(fault) == 0) fault = find_zero(name)
        status = INSITU_ERROR_ARGUMENT
        if (is_refused(self, fault)) return
        call pack_strides(block, 1)
        call pack_strides(block, 2)
        lattice%vertex_strides = block%strides(:, 1)
        lattice%cell_strides = block%strides(:, 2)
        mesh%vertex_count = count_of(block, 1)
        mesh%cell_count = count_of(block, 2)
        mesh%index_base = 1
        if (present(changed)) mesh%changed = changed
        mesh%lattice = c_loc(lattice)
        call set_part(self, name, c_loc(mesh), status, number)
        if (status /= INSITU_OK) return
        part = part_name(name, number)
        call note_size(self, mesh_size(part, mesh%vertex_count, mesh%cell_count, 0_c_int64_t, 0, block))
    end subroutine set_block

    ! Removes this rank's part of a mesh, or the block with that number.
    subroutine remove_mesh(self, name, status, number)
        class(insitu_session), intent(inout) :: self
        character(*), intent(in) :: name
        integer, intent(out) :: status
        integer, intent(in), optional :: number
        status = INSITU_ERROR_ARGUMENT
        if (is_refused(self, find_zero(name))) return
        call set_part(self, name, c_null_ptr, status, number)
    end subroutine remove_mesh

    ! Passes this rank's part of a field to the session: a list, or a matrix (components, tuples); on a block also an
    ! array (i, j, k), with components as the first or last dimension. index: the tuple of each vertex, cell or corner,
    ! counted from 1 or from the mesh's index_base. For corners, index is a list or a matrix (corners, cells), which may
    ! consist of the first rows of a larger one. corner_row, for corners: number of tuples (or of entries of index, if
    ! it is a list) from the first corner of a cell to that of the next. patches, for cells: the values on the boundary.
    ! number: number of the mesh's block.
    subroutine set_field(self, mesh, name, values, status, centring, changed, index, corner_row, patches, number)
        class(insitu_session), intent(inout) :: self
        character(*), intent(in) :: mesh, name
        type(insitu_array), intent(in) :: values
        integer, intent(out) :: status
        integer, intent(in), optional :: centring, changed, corner_row, number
        type(insitu_array), intent(in), optional :: index
        type(insitu_patch), intent(in), optional :: patches(:)
        type(c_patch), allocatable, target :: table(:)
        type(block_shape) :: block
        type(block_array) :: laid
        integer(c_int64_t) :: entries
        character(kind=c_char), target :: c_name(len_trim(name) + 1)
        type(c_field) :: field
        real(real64), target :: nothing
        character(:), allocatable :: fault
        nothing = 0
        c_name = as_c_text(name)
        call c_field_defaults(field)
        field%name = c_loc(c_name)
        if (present(centring)) field%centring = centring
        if (present(changed)) field%changed = changed
        if (present(corner_row)) field%corner_row = corner_row
        field%count = values%columns
        field%component_count = int(values%rows, c_int)
        field%component_stride = values%row_stride
        field%values = as_c(values, nothing)
        field%values%stride = values%stride
        status = INSITU_ERROR_ARGUMENT
        fault = find_zero(name, mesh)
        block = block_of(self, part_name(mesh, number), field%centring)
        if (block%dimensions > 0) call borrow_for(block, 'index', field%centring + 1, .false., laid, fault, nothing, index)
        if (present(index)) then
            field%index = laid%array
        else if (block%dimensions > 0) then
            call put_block_values(block, field, values, nothing, fault)
        end if
        if (len(fault) == 0 .and. (block%dimensions == 0 .or. present(index)) .and. values%dimensions > 2) &
            fault = 'values have '//as_text([int(values%dimensions, c_int64_t)])//' dimensions, expected a list or a matrix: '// &
            'the mesh is no block, or an index is given'
        if (is_refused(self, fault)) return
        if (present(index) .and. block%dimensions == 0) then
            field%index = as_c(index, nothing)
            if (field%centring == INSITU_CORNER .and. .not. present(corner_row)) field%corner_row = row_of(index)
            entries = index%rows * index%columns &
                + max(0_c_int64_t, field%corner_row - index%rows) * merge(index%columns - 1, 0_c_int64_t, index%rows > 1)
            if (index%rows > 1 .and. field%centring /= INSITU_CORNER) then
                fault = 'index is a list, and a matrix is given'
            else if (field%corner_row == 0 .and. .not. is_list(index)) then
                fault = 'index has gaps between its columns'
            else if (.not. is_as_long(self, part_name(mesh, number), field%centring, field%corner_row, entries)) then
                fault = 'index has not as many entries as the mesh has vertices, cells or corners'
            end if
            status = INSITU_ERROR_ARGUMENT
            if (is_refused(self, fault)) return
        end if
        if (present(patches)) then
            fault = find_patch_fault(patches, values%rows)
            status = INSITU_ERROR_ARGUMENT
            if (is_refused(self, fault)) return
            allocate (table(size(patches)))
            call put_patches(patches, table, nothing)
            field%patch_count = size(patches)
            if (size(patches) > 0) field%patches = c_loc(table)
        end if
        call set_part_field(self, mesh, field, status, number)
    end subroutine set_field

    ! Passes a field to C. If number is given, the field belongs to this block of the mesh.
    subroutine set_part_field(self, mesh, field, status, number)
        class(insitu_session), intent(inout) :: self
        character(*), intent(in) :: mesh
        type(c_field), intent(in) :: field
        integer, intent(out) :: status
        integer, intent(in), optional :: number
        if (present(number)) then
            call take_status(self, c_set_block_field(self%handle, as_c_text(mesh), int(number, c_int64_t), field), status)
        else
            call take_status(self, c_set_field(self%handle, as_c_text(mesh), field), status)
        end if
    end subroutine set_part_field

    ! Passes this rank's part of a field to the session whose components are separate arrays of any types:
    ! call pictures%set_components('domain', 'velocity', [insitu_borrow(u), insitu_borrow(v), insitu_borrow(w)], status).
    ! number: number of the mesh's block. Local.
    subroutine set_components(self, mesh, name, components, status, centring, changed, number)
        class(insitu_session), intent(inout) :: self
        character(*), intent(in) :: mesh, name
        type(insitu_array), intent(in) :: components(:)
        integer, intent(out) :: status
        integer, intent(in), optional :: centring, changed, number
        type(c_array), target :: table(max(1, size(components)))
        type(block_shape) :: block
        type(block_array) :: laid
        character(kind=c_char), target :: c_name(len_trim(name) + 1)
        type(c_field) :: field
        real(real64), target :: nothing
        character(:), allocatable :: fault
        integer :: i
        nothing = 0
        c_name = as_c_text(name)
        call c_field_defaults(field)
        field%name = c_loc(c_name)
        if (present(centring)) field%centring = centring
        if (present(changed)) field%changed = changed
        fault = find_zero(name, mesh)
        if (size(components) == 0) fault = 'components are none'
        block = block_of(self, part_name(mesh, number), field%centring)
        do i = 1, size(components)
            if (block%dimensions > 0) then
                call borrow_for(block, 'components', field%centring + 1, .false., laid, fault, nothing, components(i))
                table(i) = laid%array
                field%count = laid%count
            else
                if (components(i)%dimensions > 1) fault = 'components are matrices, expected a list each'
                if (components(i)%columns /= components(1)%columns) fault = 'components are of different lengths'
                table(i) = as_c(components(i), nothing)
                field%count = components(1)%columns
            end if
        end do
        status = INSITU_ERROR_ARGUMENT
        if (is_refused(self, fault)) return
        field%component_count = size(components)
        field%components = c_loc(table)
        call set_part_field(self, mesh, field, status, number)
    end subroutine set_components

    subroutine put_block_values(block, field, values, nothing, fault)
        type(block_shape), intent(inout) :: block
        type(c_field), intent(inout) :: field
        type(insitu_array), intent(in) :: values
        real(real64), intent(in), target :: nothing
        character(:), allocatable, intent(inout) :: fault
        type(block_array) :: laid
        call borrow_for(block, 'values', field%centring + 1, .true., laid, fault, nothing, values)
        field%values = laid%array
        field%count = laid%count
        field%component_count = int(laid%components, c_int)
        field%component_stride = laid%component_stride
    end subroutine put_block_values

    ! Describes a patch with an array of wrong length; '' if there is none. C does not get these lengths, and would read
    ! beyond the end.
    function find_patch_fault(patches, components) result(out)
        type(insitu_patch), intent(in) :: patches(:)
        integer(c_int64_t), intent(in) :: components
        character(:), allocatable :: out
        integer :: i
        out = ''
        do i = 1, size(patches)
            if (patches(i)%values%rows /= components .and. patches(i)%values%columns > 0) then
                out = 'a patch has other components than its field'
            else if (is_given(patches(i)%faces) .and. patches(i)%faces%columns /= patches(i)%values%columns) then
                out = 'a patch has not as many values as faces'
            else if (is_given(patches(i)%offsets) .and. patches(i)%offsets%columns /= patches(i)%values%columns + 1) then
                out = 'offsets of a patch are not one more than its values'
            else if (any([patches(i)%values%dimensions, patches(i)%faces%dimensions, patches(i)%offsets%dimensions] > 2)) then
                out = 'arrays of patches are lists or matrices, one has more dimensions'
            else if (patches(i)%faces%rows > 1 .or. patches(i)%offsets%rows > 1) then
                out = 'faces and offsets of patches are lists, one is a matrix'
            else if (.not. is_list(patches(i)%connectivity)) then
                out = 'connectivity of a patch has gaps between its columns, which must follow one another'
            end if
        end do
    end function find_patch_fault

    logical function is_given(a)
        type(insitu_array), intent(in) :: a
        is_given = a%columns > 0
    end function is_given

    subroutine put_patches(patches, table, nothing)
        type(insitu_patch), intent(in) :: patches(:)
        type(c_patch), intent(out) :: table(:)
        real(real64), intent(in), target :: nothing
        integer :: i
        do i = 1, size(patches)
            table(i)%count = patches(i)%values%columns
            table(i)%first_face = patches(i)%first_face
            table(i)%values = as_c(patches(i)%values, nothing)
            table(i)%values%stride = patches(i)%values%stride
            table(i)%component_stride = patches(i)%values%row_stride
            table(i)%connectivity_count = patches(i)%connectivity%rows * patches(i)%connectivity%columns
            table(i)%faces = c_array(c_null_ptr, integer32, 0)
            table(i)%connectivity = table(i)%faces
            table(i)%offsets = table(i)%faces
            if (is_given(patches(i)%faces)) table(i)%faces = as_c(patches(i)%faces, nothing)
            if (is_given(patches(i)%connectivity)) table(i)%connectivity = as_c(patches(i)%connectivity, nothing)
            if (is_given(patches(i)%offsets)) table(i)%offsets = as_c(patches(i)%offsets, nothing)
        end do
    end subroutine put_patches

    ! C calls this function. It runs the caller's procedure, and passes the resulting array to C. It is recursive
    ! because the procedure may perform a step of another session.
    recursive function run_fill(data, field) bind(C) result(status)
        type(c_ptr), value :: data
        type(c_field), intent(inout) :: field
        integer(c_int) :: status
        type(fill_record), pointer :: record
        type(insitu_array) :: values
        real(real64), target, save :: nothing = 0
        integer :: own_status
        call c_f_pointer(data, record)
        call record%fill(values, own_status)
        status = int(own_status, c_int)
        record%fault = ''
        if (own_status /= INSITU_OK) return
        field%count = values%columns
        field%component_count = int(values%rows, c_int)
        field%component_stride = values%row_stride
        field%values = as_c(values, nothing)
        field%values%stride = values%stride
        if (record%block%dimensions > 0) then
            call put_block_values(record%block, field, values, nothing, record%fault)
        else if (values%dimensions > 2) then
            record%fault = 'values have more than two dimensions, and the mesh is no block'
        end if
        if (len(record%fault) > 0) status = INSITU_ERROR_FIELD
    end function run_fill

    ! Returns the record of the field, which is created if it does not exist.
    function record_of(self, mesh, name) result(out)
        class(insitu_session), intent(inout) :: self
        character(*), intent(in) :: mesh, name
        type(fill_record), pointer :: out
        out => self%fills
        do while (associated(out))
            if (out%mesh == trim(mesh) .and. out%field == trim(name)) return
            out => out%next
        end do
        allocate (out)
        out%fault = ''
        out%mesh = trim(mesh)
        out%field = trim(name)
        out%next => self%fills
        self%fills => out
    end function record_of

    ! Passes this rank's part of a field to the session, with this number of components, whose values `fill` computes in
    ! the steps that need them.
    subroutine set_filled_field(self, mesh, name, fill, status, centring, components, number)
        class(insitu_session), intent(inout) :: self
        character(*), intent(in) :: mesh, name
        procedure(insitu_fill) :: fill
        integer, intent(out) :: status
        integer, intent(in), optional :: centring, components, number
        character(kind=c_char), target :: c_name(len_trim(name) + 1)
        type(fill_record), pointer :: record
        type(c_field) :: field
        status = INSITU_ERROR_ARGUMENT
        if (is_refused(self, find_zero(name, mesh))) return
        c_name = as_c_text(name)
        record => record_of(self, part_name(mesh, number), name)
        call c_field_defaults(field)
        field%name = c_loc(c_name)
        if (present(centring)) field%centring = centring
        if (present(components)) field%component_count = components
        record%block = block_of(self, part_name(mesh, number), field%centring)
        field%fill = c_funloc(run_fill)
        field%fill_data = c_loc(record)
        call set_part_field(self, mesh, field, status, number)
        if (status == INSITU_OK) record%fill => fill
    end subroutine set_filled_field

    ! Sets whether rank 0 keeps each step's pictures in memory. Collective; only rank 0's keep is used.
    subroutine keep_pictures(self, keep, status)
        class(insitu_session), intent(inout) :: self
        logical, intent(in) :: keep
        integer, intent(out) :: status
        call take_status(self, c_keep_pictures(self%handle, merge(1_c_int, 0_c_int, keep)), status)
    end subroutine keep_pictures

    ! Reads a parameter of the scene. If the scene has no parameter of this name, value is not changed, and status is an
    ! error. An edit of the scene changes parameters during a step, on all ranks.
    subroutine read_parameter(self, name, value, status)
        class(insitu_session), intent(inout) :: self
        character(*), intent(in) :: name
        real(real64), intent(inout) :: value
        integer, intent(out) :: status
        status = INSITU_ERROR_ARGUMENT
        if (is_refused(self, find_zero(name))) return
        call take_status(self, c_parameter(self%handle, as_c_text(name), value), status)
    end subroutine read_parameter

    ! Returns the pictures of the last step; none on ranks other than 0, or if pictures are not kept.
    function pictures(self) result(out)
        class(insitu_session), intent(in) :: self
        type(insitu_picture), allocatable :: out(:)
        type(c_picture), pointer :: kept(:)
        type(c_ptr) :: first
        integer(c_int) :: count
        integer :: i
        first = c_pictures(self%handle, count)
        allocate (out(count))
        if (count == 0) return
        call c_f_pointer(first, kept, [count])
        do i = 1, count
            out(i)%image = insitu_text(kept(i)%image)
            call c_f_pointer(kept(i)%rgba, out(i)%rgba, [4, int(kept(i)%width), int(kept(i)%height)])
            call c_f_pointer(kept(i)%depth, out(i)%depth, [int(kept(i)%width), int(kept(i)%height)])
        end do
    end function pictures

    ! Draws the images that are due. Collective. An error is returned on every rank, and the session remains usable. The
    ! procedure is recursive because a fill procedure may call it; a call on its own session is refused.
    recursive subroutine step(self, cycle, time, status)
        class(insitu_session), intent(inout) :: self
        integer, intent(in) :: cycle
        real(real64), intent(in) :: time
        integer, intent(out) :: status
        type(fill_record), pointer :: record
        self%own_error = ''
        call take_status(self, c_step(self%handle, int(cycle, c_int64_t), real(time, c_double)), status)
        record => self%fills
        do while (associated(record))
            if (status /= INSITU_OK .and. len(record%fault) > 0) &
                self%own_error = insitu_text(c_error(self%handle))//': '//record%fault
            record%fault = ''
            record => record%next
        end do
    end subroutine step

    ! Returns the report of the last step. All members are zero before the first step.
    function report(self) result(out)
        class(insitu_session), intent(in) :: self
        type(insitu_report) :: out
        type(insitu_report), pointer :: last
        type(c_ptr) :: at
        at = c_report(self%handle)
        if (.not. c_associated(at)) return
        call c_f_pointer(at, last)
        out = last
    end function report

    ! Returns the message of the last call that failed since the last step began (insitu_error in insitu.h).
    function error(self) result(out)
        class(insitu_session), intent(in) :: self
        character(:), allocatable :: out
        out = ''
        if (allocated(self%own_error)) out = self%own_error
        if (len(out) == 0) out = insitu_text(c_error(self%handle))
    end function error

    subroutine destroy(self, status)
        class(insitu_session), intent(inout) :: self
        integer, intent(out) :: status
        type(fill_record), pointer :: record
        self%own_error = ''
        status = c_destroy(self%handle)
        if (c_associated(self%handle)) return ! the call was refused, because a fill procedure has made it
        do while (associated(self%fills))
            record => self%fills
            self%fills => record%next
            deallocate (record)
        end do
    end subroutine destroy
end module insitu
