! test_fortran PREFIX: every kind of array that insitu_borrow takes draws the same picture, whose file is compared to the
! byte; what cannot be borrowed, and what the library refuses, is a status and a text on every rank.
module test_fortran_maker
    use, intrinsic :: iso_fortran_env, only: real64
    use mpi_f08
    use insitu
    implicit none
    real(real64), pointer :: made_of(:)
    integer :: calls = 0
    logical :: fails = .false.
    type(insitu_session), pointer :: caller
    integer :: forbidden = 0 ! the call that call_and_make makes

contains

    subroutine call_and_make(values, status)
        type(insitu_array), intent(out) :: values
        integer, intent(out) :: status
        type(insitu_picture), allocatable :: pictures(:)
        status = INSITU_ERROR_ARGUMENT
        select case (forbidden)
        case (1)
            call caller%step(1, 0.0_real64, status)
        case (2)
            call caller%destroy(status)
        case (3)
            call caller%set_field('m', 'p', insitu_borrow(made_of), status)
        case (4)
            call caller%set_filled_field('m', 'p', make_values, status)
        case (5)
            pictures = caller%pictures()
            if (size(pictures) > 0) status = INSITU_OK
        end select
        if (forbidden > 0 .and. status == INSITU_OK) error stop 'a call of a fill is not refused'
        call make_values(values, status)
    end subroutine call_and_make

    ! Called by the steps that need the field: it may communicate.
    subroutine make_values(values, status)
        type(insitu_array), intent(out) :: values
        integer, intent(out) :: status
        integer :: ranks
        call MPI_Allreduce(1, ranks, 1, MPI_INTEGER, MPI_SUM, MPI_COMM_WORLD)
        calls = calls + ranks
        values = insitu_borrow(made_of)
        status = merge(INSITU_ERROR_IO, INSITU_OK, fails)
    end subroutine make_values
end module test_fortran_maker

program test_fortran
    use, intrinsic :: iso_c_binding, only: c_ptr, c_loc, c_null_ptr
    use, intrinsic :: iso_fortran_env, only: int8, int16, int32, int64, real32, real64, error_unit
    use mpi_f08
    use insitu
    use test_fortran_maker
    use test_fortran_blocks
    implicit none
    save ! so that what is still allocated as the program ends is no leak
    integer, parameter :: n = 5, vertices = n**3, cells = (n - 1)**3
    real(real64), target :: xyz(3, vertices), axes(vertices, 3), gaps(6, 2*vertices), pressure(vertices)
    real(real32), target :: xyz_4(3, vertices), vector_4(2, vertices)
    integer(int32), target :: hexes(8, cells)
    integer(int64), target :: hexes_8(8, cells), offsets_8(cells + 1), wide_8(16, cells)
    integer, parameter :: face_count = 3*n*(n - 1)**2
    integer(int32), target :: faces(4, face_count), face_offsets(face_count + 1), owner(face_count), neighbour(face_count)
    integer(int64), target :: faces_8(4, face_count), face_sizes_8(face_count)
    integer(int32), target :: face_sizes(face_count), cell_faces(6, cells), cell_offsets(cells + 1)
    type(c_ptr), target :: face_lists(face_count), face_lists_8(2, face_count)
    integer(int32), allocatable, target :: inner_faces(:, :), inner_offsets(:), inner_owner(:), inner_neighbour(:)
    integer(int32), allocatable, target :: outer_faces(:, :), outer_offsets(:), outer_owner(:)
    integer(int8), target :: types(cells), ghosts(cells)
    real(real64), target :: vector(2*vertices)
    integer(int32), target :: places(vertices), nodes(27, cells), own(8, cells), dofs(10, cells)
    real(real64), target :: doubled(3, 8*cells), at_corners(8*cells), unknowns(10*cells)
    real(real64), target :: block(n, n, n), velocity(2, n, n, n)
    real(real64), pointer :: list(:), matrix(:, :)
    integer(int32), allocatable, target :: wall(:), wall_faces(:, :)
    real(real64), allocatable, target :: wall_values(:)
    real(real32), allocatable, target :: wall_4(:)
    real(real64), target :: cell_values(cells)
    character(:), allocatable :: prefix, plain
    integer :: rank, status

    call MPI_Init()
    call MPI_Comm_rank(MPI_COMM_WORLD, rank)
    call take_prefix()
    call make_mesh()
    plain = picture('plain', insitu_points(xyz), insitu_borrow(hexes), insitu_borrow(pressure))
    call expect(len(plain) > 300 .or. rank /= 0, 'the picture shows something')
    call same(picture('axes', insitu_points(axes(:, 1), axes(:, 2), axes(:, 3)), insitu_borrow(hexes), &
        insitu_borrow(pressure)), 'x, y, z')
    call same(picture('gaps', insitu_points(gaps(1:6:2, 1:2*vertices:2)), insitu_borrow(hexes), &
        insitu_borrow(pressure)), 'gaps between coordinates')
    call same(picture('single', insitu_points(xyz_4), insitu_borrow(hexes_8), insitu_borrow(pressure)), 'single precision')
    call same(picture('vector', insitu_points(xyz), insitu_borrow(reshaped()), insitu_borrow(vector_4), 'x'), 'components')
    call same(picture('mixed', insitu_points(xyz), insitu_borrow(hexes_8), insitu_borrow(pressure), with_types=.true.), &
        'types, offsets, ghosts')
    block = reshape(pressure, [n, n, n])
    list(1:vertices) => block
    call same(picture('block', insitu_points(xyz), insitu_borrow(hexes), insitu_borrow(list)), 'three dimensions as a list')
    velocity = reshape(vector_4, [2, n, n, n])
    matrix(1:2, 1:vertices) => velocity
    call same(picture('velocity', insitu_points(xyz), insitu_borrow(hexes), insitu_borrow(matrix), 'x'), 'and as a matrix')
    call make_faces()
    call same(picture('faces', insitu_points(xyz), insitu_borrow(faces), insitu_borrow(pressure), with_owner=.true.), &
        'owner and neighbour')
    call same(picture('lists', insitu_points(xyz), insitu_borrow(faces), insitu_borrow(pressure), with_owner=.true., &
        with_lists=1), 'a list for each face')
    call same(picture('lists_8', insitu_points(xyz), insitu_borrow(faces), insitu_borrow(pressure), with_owner=.true., &
        with_lists=2), 'lists in long integers, pointers apart')
    call same(picture('cells', insitu_points(xyz), insitu_borrow(cell_faces), insitu_borrow(pressure), with_owner=.true., &
        with_lists=3), 'cells of faces that have lists')
    call split_faces()
    call same(picture('apart', insitu_points(xyz), insitu_borrow(faces), insitu_borrow(pressure), with_owner=.true., &
        with_apart=.true.), 'faces of the boundary in a list of their own')
    call make_dofs()
    call same(picture('rows', insitu_points(xyz), insitu_borrow(wide_8(1:8, :)), insitu_borrow(pressure)), 'first rows')
    call same(picture('nodes', insitu_points(xyz), insitu_borrow(nodes(1:8, :)), insitu_borrow(vector), with_dofs=.true.), &
        'nodes in lexicographic order, values by an index')
    call make_corners()
    plain = picture('doubled', insitu_points(doubled), insitu_borrow(own), insitu_borrow(at_corners))
    call same(picture('corners', insitu_points(xyz), insitu_borrow(hexes), insitu_borrow(at_corners), at_corner=1), &
        'values at corners')
    call same(picture('corner_index', insitu_points(xyz), insitu_borrow(hexes), insitu_borrow(unknowns), at_corner=2), &
        'values at corners by an index')
    call planes_go_without_z()
    call components_may_be_apart()
    call patches_have_values()
    call parameters_are_read()
    call procedures_make_values()
    call errors_are_reported()
    call test_blocks(prefix)
    call MPI_Finalize()

contains

    subroutine take_prefix()
        integer :: length, ranks
        call get_command_argument(1, length=length)
        allocate (character(length) :: prefix)
        call get_command_argument(1, prefix)
        ! Runs of other numbers of ranks, which may be at work at the same time, have files of their own.
        call MPI_Comm_size(MPI_COMM_WORLD, ranks)
        prefix = prefix//'np'//achar(iachar('0') + ranks)//'_'
    end subroutine take_prefix

    ! A block of hexes for each rank, side by side along x; sums of few bits, so that float32 holds all of it.
    subroutine make_mesh()
        integer :: i, j, k, v
        do k = 0, n - 1
            do j = 0, n - 1
                do i = 0, n - 1
                    v = 1 + i + n*(j + n*k)
                    xyz(:, v) = [i + rank*(n - 1), j, k]
                    pressure(v) = 0.25_real64*j + 0.5_real64*k
                end do
            end do
        end do
        do k = 0, n - 2
            do j = 0, n - 2
                do i = 0, n - 2
                    v = 1 + i + n*(j + n*k)
                    hexes(:, 1 + i + (n - 1)*(j + (n - 1)*k)) = &
                        [v, v + 1, v + 1 + n, v + n, v + n*n, v + 1 + n*n, v + 1 + n + n*n, v + n + n*n]
                end do
            end do
        end do
        axes = transpose(xyz)
        gaps = -1e9_real64
        gaps(1:6:2, 1:2*vertices:2) = xyz
        xyz_4 = real(xyz, real32)
        vector_4(1, :) = real(pressure, real32)
        vector_4(2, :) = -7
        hexes_8 = hexes
        wide_8 = -1
        wide_8(1:8, :) = hexes
        offsets_8 = [(int(1 + 8*(i - 1), int64), i=1, cells + 1)]
        types = int(INSITU_HEX, int8)
        ghosts = 0_int8
    end subroutine make_mesh

    ! Each quad once, with the first of its cells and the second, 0 where there is none.
    subroutine make_faces()
        integer, parameter :: corners(4, 6) = reshape([1, 2, 3, 4, 5, 6, 7, 8, 1, 2, 6, 5, 2, 3, 7, 6, 3, 4, 8, 7, 4, 1, 5, 8], &
            [4, 6])
        integer :: cell, side, face, count
        count = 0
        neighbour = 0
        do cell = 1, cells
            do side = 1, 6
                associate (quad => hexes(corners(:, side), cell))
                    do face = 1, count
                        if (sum(faces(:, face)) == sum(quad) .and. minval(faces(:, face)) == minval(quad) .and. &
                            maxval(faces(:, face)) == maxval(quad)) exit
                    end do
                    if (face <= count) then
                        neighbour(face) = cell
                    else
                        count = face
                        faces(:, face) = quad
                        owner(face) = cell
                    end if
                end associate
            end do
        end do
        face_offsets = [(1 + 4*(face - 1), face=1, face_count + 1)]
        faces_8 = faces
        face_sizes = 4
        face_sizes_8 = 4
        face_lists_8 = c_null_ptr
        do face = 1, face_count
            face_lists(face) = c_loc(faces(1, face))
            face_lists_8(1, face) = c_loc(faces_8(1, face))
        end do
        cell_offsets = [(1 + 6*(cell - 1), cell=1, cells + 1)]
        do cell = 1, cells
            cell_faces(:, cell) = pack([(face, face=1, face_count)], owner == cell .or. neighbour == cell)
        end do
        call expect(count == face_count, 'all faces are found')
    end subroutine make_faces

    ! Faces of the boundary in a list of their own, but for one, which has a cell of a halo beyond.
    subroutine split_faces()
        logical :: is_outer(face_count)
        integer :: face
        is_outer = neighbour == 0
        is_outer(findloc(is_outer, .true., dim=1)) = .false.
        inner_faces = reshape(pack(faces, spread(.not. is_outer, 1, 4)), [4, count(.not. is_outer)])
        outer_faces = reshape(pack(faces, spread(is_outer, 1, 4)), [4, count(is_outer)])
        inner_owner = pack(owner, .not. is_outer)
        outer_owner = pack(owner, is_outer)
        inner_neighbour = pack(neighbour, .not. is_outer)
        where (inner_neighbour == 0) inner_neighbour = cells + 1
        inner_offsets = [(1 + 4*(face - 1), face=1, size(inner_owner) + 1)]
        outer_offsets = [(1 + 4*(face - 1), face=1, size(outer_owner) + 1)]
    end subroutine split_faces

    ! The connectivity as a list.
    function reshaped()
        integer(int32), pointer :: reshaped(:)
        reshaped(1:size(hexes)) => hexes
    end function reshaped

    ! As codes of finite elements hold them: nodes of second order, the corners first, and a vector of other unknowns too.
    subroutine make_dofs()
        integer :: v
        nodes = -5
        nodes(1:8, :) = hexes([1, 2, 4, 3, 5, 6, 8, 7], :)
        vector = -1000
        do v = 1, vertices
            places(v) = 2*(vertices - v) + 1
            vector(places(v)) = pressure(v)
        end do
    end subroutine make_dofs

    ! Each cell with values of its own, and the mesh whose vertices are doubled.
    subroutine make_corners()
        integer :: cell, corner, at
        dofs = -5
        unknowns = -1000
        do cell = 1, cells
            do corner = 1, 8
                at = corner + 8*(cell - 1)
                own(corner, cell) = at
                doubled(:, at) = xyz(:, hexes(corner, cell))
                at_corners(at) = pressure(hexes(corner, cell)) + 0.1_real64*mod(cell, 3)
                dofs(corner, cell) = 10*cells + 1 - at
                unknowns(dofs(corner, cell)) = at_corners(at)
            end do
        end do
    end subroutine make_corners

    subroutine expect(is_well, what)
        logical, intent(in) :: is_well
        character(*), intent(in) :: what
        logical :: is_well_everywhere
        call MPI_Allreduce(is_well, is_well_everywhere, 1, MPI_LOGICAL, MPI_LAND, MPI_COMM_WORLD)
        if (is_well_everywhere) return
        if (.not. is_well) write (error_unit, '(a, i0, 2a)') 'rank ', rank, ': not so: ', what
        flush (error_unit)
        call MPI_Abort(MPI_COMM_WORLD, 1)
    end subroutine expect

    subroutine same(other, what)
        character(*), intent(in) :: other, what
        call expect(rank /= 0 .or. other == plain, what//' draw the same picture')
    end subroutine same

    function scene_of(name, component) result(out)
        character(*), intent(in) :: name, component
        character(:), allocatable :: out
        out = 'images: [{name: a, size: [48, 32], layers: [{isosurface: {field: p, component: '//component// &
            ', values: [1.3]}}, {surface: {opacity: 0.3}}], outputs: [{path: '//prefix//name//'.png}]}]'
    end function scene_of

    subroutine set_lists(session, way, cells_of_faces)
        type(insitu_session), intent(inout) :: session
        integer, intent(in) :: way
        type(insitu_array), intent(in) :: cells_of_faces
        select case (way)
        case (1)
            call session%set_mesh_of_faces('m', insitu_points(xyz), insitu_lists(face_lists, face_sizes), &
                insitu_borrow(owner), insitu_borrow(neighbour), cells, status, ghosts=insitu_borrow(ghosts))
        case (2)
            call session%set_mesh_of_faces('m', insitu_points(xyz), insitu_lists(face_lists_8(1, :), face_sizes_8, int64), &
                insitu_borrow(owner), insitu_borrow(neighbour), cells, status)
        case default
            call session%set_mesh('m', insitu_points(xyz), cells_of_faces, status, cell_type=INSITU_POLYHEDRON, &
                offsets=insitu_borrow(cell_offsets), face_lists=insitu_lists(face_lists, face_sizes))
        end select
    end subroutine set_lists

    ! The file's bytes, on rank 0.
    function picture(name, points, connectivity, values, component, with_types, with_owner, with_dofs, at_corner, &
        with_lists, with_apart) result(out)
        character(*), intent(in) :: name
        type(insitu_array), intent(in) :: points(3), connectivity, values
        character(*), intent(in), optional :: component
        logical, intent(in), optional :: with_types, with_owner, with_dofs, with_apart
        integer, intent(in), optional :: at_corner, with_lists
        character(:), allocatable :: out
        type(insitu_session) :: session
        type(insitu_report) :: report
        if (present(component)) then
            call session%create_from_text(MPI_COMM_WORLD%MPI_VAL, scene_of(name, component), status)
        else
            call session%create_from_text(MPI_COMM_WORLD, scene_of(name, 'magnitude'), status)
        end if
        call expect(status == INSITU_OK, session%error())
        if (present(with_types)) then
            call session%set_mesh('m', points, connectivity, status, cell_types=insitu_borrow(types), &
                offsets=insitu_borrow(offsets_8), ghosts=insitu_borrow(ghosts))
        else if (present(with_lists)) then
            call set_lists(session, with_lists, connectivity)
        else if (present(with_owner) .and. present(with_apart)) then
            call session%set_mesh_of_faces('m', points, insitu_borrow(inner_faces), insitu_borrow(inner_offsets), &
                insitu_borrow(inner_owner), insitu_borrow(inner_neighbour), cells, status, halo_cells=1, &
                boundary_faces=insitu_borrow(outer_faces), boundary_offsets=insitu_borrow(outer_offsets), &
                boundary_owner=insitu_borrow(outer_owner))
        else if (present(with_owner)) then
            call session%set_mesh_of_faces('m', points, connectivity, insitu_borrow(face_offsets), insitu_borrow(owner), &
                insitu_borrow(neighbour), cells, status, ghosts=insitu_borrow(ghosts))
        else if (present(with_dofs)) then
            call session%set_mesh('m', points, connectivity, status, cell_type=INSITU_HEX, &
                vertex_order=INSITU_ORDER_LEXICOGRAPHIC)
        else
            call session%set_mesh('m', points, connectivity, status, cell_type=INSITU_HEX)
        end if
        call expect(status == INSITU_OK, session%error())
        if (present(with_dofs)) then
            call session%set_field('m', 'p', values, status, index=insitu_borrow(places))
        else if (present(at_corner)) then
            if (at_corner == 1) call session%set_field('m', 'p', values, status, centring=INSITU_CORNER)
            if (at_corner == 2) call session%set_field('m', 'p', values, status, centring=INSITU_CORNER, &
                index=insitu_borrow(dofs(1:8, :)))
        else
            call session%set_field('m', 'p', values, status)
        end if
        call expect(status == INSITU_OK, session%error())
        call session%step(7, 0.5_real64, status)
        call expect(status == INSITU_OK, session%error())
        report = session%report()
        call expect(report%images == 1 .and. report%cycle == 7 .and. abs(report%time - 0.5_real64) < 1e-9, &
            'the report is of the step')
        call expect(report%cells_recognised == merge(cells, 0, present(with_owner)), 'hexes are recognised')
        call expect(report%cells == cells .and. index(insitu_text(report%copied_why), 'outer faces') > 0, 'and its texts')
        call session%destroy(status)
        call expect(status == INSITU_OK, 'the session ends')
        out = file_of(name)
    end function picture

    ! The picture's bytes, on rank 0.
    function file_of(name) result(out)
        character(*), intent(in) :: name
        character(:), allocatable :: out
        integer :: unit, size
        out = ''
        if (rank /= 0) return
        open (newunit=unit, file=prefix//name//'.png', access='stream', form='unformatted', status='old')
        inquire (unit, size=size)
        deallocate (out)
        allocate (character(size) :: out)
        read (unit) out
        close (unit)
    end function file_of

    ! Values on the wall y = 0: the same picture whether its faces are told by their numbers or by their vertices.
    subroutine patches_have_values()
        character(:), allocatable :: without
        type(insitu_patch) :: none(0)
        integer :: face, i
        wall = pack([(face, face=1, face_count)], [(all(xyz(2, faces(:, face)) < 0.5_real64), face=1, face_count)])
        wall_faces = faces(:, wall)
        wall_values = [(2 + 0.1_real64*i, i=1, size(wall))]
        wall_4 = real(wall_values, real32)
        wall_values = wall_4
        cell_values = 1
        without = wall_picture(none)
        plain = wall_picture([insitu_patch(insitu_borrow(wall_values), faces=insitu_borrow(wall))])
        call expect(rank /= 0 .or. without /= plain, 'the wall is seen')
        call same(wall_picture([insitu_patch(insitu_borrow(wall_4), connectivity=insitu_borrow(wall_faces))]), 'vertices')
        call same(wall_picture([(insitu_patch(insitu_borrow(wall_values(i:i)), first_face=wall(i)), i=1, size(wall))]), &
            'ranges')
    end subroutine patches_have_values

    function wall_picture(patches) result(out)
        type(insitu_patch), intent(in) :: patches(:)
        character(:), allocatable :: out
        type(insitu_session) :: session
        call session%create_from_text(MPI_COMM_WORLD, scene_of('wall', 'magnitude'), status)
        call session%set_mesh_of_faces('m', insitu_points(xyz), insitu_borrow(faces), insitu_borrow(face_offsets), &
            insitu_borrow(owner), insitu_borrow(neighbour), cells, status)
        call expect(status == INSITU_OK, session%error())
        call session%set_field('m', 'p', insitu_borrow(cell_values), status, centring=INSITU_CELL, patches=patches)
        call expect(status == INSITU_OK, session%error())
        call session%step(0, 0.0_real64, status)
        call expect(status == INSITU_OK, session%error())
        call session%destroy(status)
        out = file_of('wall')
    end function wall_picture

    subroutine parameters_are_read()
        type(insitu_session) :: session
        real(real64) :: value
        value = -1
        call session%parameter('inflow', value, status)
        call expect(status == INSITU_ERROR_ARGUMENT .and. session%error() == 'the session is not open', session%error())
        call session%create_from_text(MPI_COMM_WORLD, 'parameters: {inflow: 2.5}'//new_line('a')// &
            'images: [{name: a, layers: [{volume: {field: p}}]}]', status)
        call session%parameter('inflow  ', value, status)
        call expect(status == INSITU_OK .and. abs(value - 2.5_real64) <= 0, 'a parameter is read')
        call session%parameter('inflw', value, status)
        call expect(status == INSITU_ERROR_ARGUMENT .and. abs(value - 2.5_real64) <= 0, 'an unknown one leaves the value')
        call expect(index(session%error(), '(did you mean "inflow"?)') > 0, session%error())
        call session%parameter('in'//achar(0)//'flow', value, status)
        call expect(status == INSITU_ERROR_ARGUMENT .and. index(session%error(), 'character 0') > 0, session%error())
        call session%destroy(status)
    end subroutine parameters_are_read

    ! Components in arrays of their own, and corners of cells in two bytes: the picture of tuples.
    subroutine components_may_be_apart()
        integer(int16), target :: whole(vertices), hexes_2(8, cells)
        real(real32), target :: single(2*vertices)
        real(real64), target :: tuples(3, vertices)
        integer :: i
        whole = [(int(mod(i, 7), int16), i=1, vertices)]
        single = -1
        single(1:2*vertices:2) = [(real(mod(i, 3), real32), i=1, vertices)]
        tuples(1, :) = real(whole, real64)
        tuples(2, :) = real(single(1:2*vertices:2), real64)
        tuples(3, :) = pressure
        hexes_2 = int(hexes, int16)
        call expect(components_picture(insitu_borrow(hexes_2), [insitu_borrow(whole), insitu_borrow(single(1:2*vertices:2)), &
            insitu_borrow(pressure)]) == components_picture(insitu_borrow(hexes), [insitu_borrow(tuples)]), &
            'components apart draw the picture of tuples')
    end subroutine components_may_be_apart

    ! parts: tuples, or an array for each component.
    function components_picture(connectivity, parts) result(out)
        type(insitu_array), intent(in) :: connectivity, parts(:)
        character(:), allocatable :: out
        type(insitu_session) :: session
        call session%create_from_text(MPI_COMM_WORLD, scene_of('parts', 'magnitude'), status)
        call session%set_mesh('m', insitu_points(xyz), connectivity, status, cell_type=INSITU_HEX)
        if (size(parts) == 1) then
            call session%set_field('m', 'p', parts(1), status)
        else
            call session%set_components('m', 'p', parts, status)
        end if
        call expect(status == INSITU_OK, session%error())
        call session%step(0, 0.0_real64, status)
        call expect(status == INSITU_OK, session%error())
        call session%set_components('m', 'p', [parts(1), insitu_borrow(pressure(2:))], status)
        call refused(session, 'components are ')
        call session%destroy(status)
        out = file_of('parts')
    end function components_picture

    subroutine procedures_make_values()
        type(insitu_session), pointer :: session
        type(insitu_picture), allocatable :: given(:), made(:)
        real(real32) :: rgba(4, 48, 32)
        integer :: ranks
        allocate (session)
        call MPI_Comm_size(MPI_COMM_WORLD, ranks)
        call session%create_from_text(MPI_COMM_WORLD, 'images: [{name: a, every: 2, size: [48, 32], layers: '// &
            '[{isosurface: {field: p, values: [1.3]}}], outputs: [{path: '//prefix//'made.png}]}]', status)
        call session%set_mesh('m', insitu_points(xyz), insitu_borrow(hexes), status, cell_type=INSITU_HEX)
        call session%set_field('m', 'p', insitu_borrow(pressure), status)
        call session%step(0, 0.0_real64, status)
        made = session%pictures()
        call expect(size(made) == 0, 'nothing is kept that was not asked for')
        call session%keep_pictures(.true., status)
        call expect(status == INSITU_OK, session%error())
        call session%step(2, 0.0_real64, status)
        given = session%pictures()
        call expect(size(given) == merge(1, 0, rank == 0), 'rank 0 has the picture')
        made_of => pressure
        rgba = 0
        if (rank == 0) rgba = given(1)%rgba
        call session%set_filled_field('m', 'p', make_values, status)
        call expect(status == INSITU_OK, session%error())
        call session%step(3, 0.0_real64, status)
        call expect(calls == 0, 'nothing is made in a step that draws nothing')
        call session%step(4, 0.0_real64, status)
        call expect(status == INSITU_OK .and. calls == ranks, 'a step that draws makes it once')
        made = session%pictures()
        if (rank == 0) then
            call expect(made(1)%image == 'a' .and. all(abs(made(1)%rgba - rgba) <= 0) .and. &
                all(shape(made(1)%depth) == [48, 32]) .and. any(made(1)%depth < 100), 'it is the picture of the values')
        else
            call expect(size(made) == 0, 'other ranks have none')
        end if
        fails = rank == 0
        call session%step(6, 0.0_real64, status)
        call refused(session, 'its fill returned 5')
        fails = .false.
        caller => session
        call session%set_filled_field('m', 'p', call_and_make, status)
        do forbidden = 1, 5
            call session%step(6 + 4 * forbidden, 0.0_real64, status)
            call refused(session, 'its fill called insitu_')
            call session%set_field('m', 'q', insitu_borrow(pressure), status)
            call expect(status == INSITU_OK .and. index(session%error(), 'its fill called insitu_') > 0, &
                'the message of a step stays when a later call is well')
        end do
        forbidden = 0
        call session%step(40, 0.0_real64, status)
        call expect(status == INSITU_OK .and. session%error() == '', 'a step that is well clears the message')
        call session%destroy(status)
        deallocate (session)
    end subroutine procedures_make_values

    ! The same picture of quads with z, which is 0, and without.
    subroutine planes_go_without_z()
        real(real64), target :: flat(3, vertices), plane(2, vertices)
        real(real32), target :: plane_4(2, vertices)
        integer(int32), target :: quads(4, (n - 1)**2)
        flat = 0
        flat(1:2, :) = xyz(1:2, :)
        plane = xyz(1:2, :)
        plane_4 = real(plane, real32)
        quads = hexes(1:4, 1:(n - 1)**2)
        plain = plane_picture('flat', insitu_points(flat), quads)
        call expect(len(plain) > 300 .or. rank /= 0, 'the plane picture shows something')
        call same(plane_picture('plane', insitu_points(plane), quads), 'coordinates of two rows')
        call same(plane_picture('plane_4', insitu_points(plane_4), quads), 'in single precision')
        call same(plane_picture('plane_xy', insitu_points(axes(:, 1), axes(:, 2)), quads), 'x and y')
    end subroutine planes_go_without_z

    function plane_picture(name, points, quads) result(out)
        character(*), intent(in) :: name
        type(insitu_array), intent(in) :: points(3)
        integer(int32), intent(in), target :: quads(:, :)
        character(:), allocatable :: out
        type(insitu_session) :: session
        call session%create_from_text(MPI_COMM_WORLD, 'images: [{name: a, size: [48, 32], layers: [{surface: {colour_by: '// &
            '{field: p}}}], outputs: [{path: '//prefix//name//'.png}]}]', status)
        call expect(status == INSITU_OK, session%error())
        call session%set_mesh('m', points, insitu_borrow(quads), status, cell_type=INSITU_QUAD)
        call expect(status == INSITU_OK, session%error())
        call session%set_field('m', 'p', insitu_borrow(pressure), status)
        call session%step(0, 0.0_real64, status)
        call expect(status == INSITU_OK, session%error())
        call session%destroy(status)
        out = file_of(name)
    end function plane_picture

    subroutine refused(session, words)
        type(insitu_session), intent(in) :: session
        character(*), intent(in) :: words
        call expect(status /= INSITU_OK .and. index(session%error(), words) > 0, words//', not: '//session%error())
    end subroutine refused

    subroutine errors_are_reported()
        type(insitu_session) :: session
        call session%create(MPI_COMM_WORLD, prefix//'no.yaml', status)
        call refused(session, 'no.yaml')
        call session%create_from_text(MPI_COMM_WORLD, 'images: 3', status)
        call refused(session, 'scene text:1')
        call session%create_from_text(MPI_COMM_WORLD, scene_of('none', 'x'), status)
        call session%set_mesh('m', insitu_points(axes), insitu_borrow(hexes), status)
        call refused(session, 'first extent than 2 or 3')
        call session%set_mesh('m', insitu_points(axes(:, 1), axes(:, 2)), insitu_borrow(hexes), status, cell_type=INSITU_HEX)
        call refused(session, 'z coordinates are not given')
        call session%set_mesh('m', insitu_points(xyz), insitu_borrow(wide_8(1:8, :)), status, cell_type=INSITU_HEX, &
            offsets=insitu_borrow(offsets_8))
        call refused(session, 'gaps between their columns')
        call session%set_mesh('m', insitu_points(xyz), insitu_borrow(nodes(1:8, :)), status, cell_type=INSITU_HEX, &
            vertex_order=7)
        call refused(session, 'vertex_order is 7')
        call session%set_mesh('m', insitu_points(xyz), insitu_borrow(hexes), status, cell_type=INSITU_TET)
        call refused(session, 'another first extent than cells')
        call session%set_mesh('m', insitu_points(xyz), insitu_borrow(hexes), status, cell_type=77)
        call refused(session, 'unknown cell_type 77')
        call session%set_mesh('m'//char(0)//'n', insitu_points(xyz), insitu_borrow(hexes), status, cell_type=INSITU_HEX)
        call refused(session, 'a name holds a character 0')
        call session%set_field('m', char(0)//'p', insitu_borrow(pressure), status)
        call refused(session, 'a name holds a character 0')
        call session%set_field('m'//char(0), 'p', insitu_borrow(pressure), status)
        call refused(session, 'a name holds a character 0')
        call session%remove_mesh('m'//char(0), status)
        call refused(session, 'a name holds a character 0')
        call session%set_mesh('m', insitu_points(xyz), insitu_borrow(hexes), status, cell_type=INSITU_HEX, &
            ghosts=insitu_borrow(ghosts(2:)))
        call refused(session, 'ghosts are not as many')
        call session%set_mesh_of_faces('m', insitu_points(xyz), insitu_borrow(faces), insitu_borrow(face_offsets), &
            insitu_borrow(owner(2:)), insitu_borrow(neighbour), cells, status)
        call refused(session, 'face_offsets are not one more than owner')
        call session%set_mesh_of_faces('m', insitu_points(xyz), insitu_lists(face_lists, face_sizes(2:)), &
            insitu_borrow(owner), insitu_borrow(neighbour), cells, status)
        call refused(session, 'lists of faces are not as many as their sizes')
        call session%set_mesh_of_faces('m', insitu_points(xyz), insitu_lists(face_lists(2:), face_sizes(2:)), &
            insitu_borrow(owner), insitu_borrow(neighbour), cells, status)
        call refused(session, 'lists of faces are not as many as owner')
        call session%set_mesh('m', insitu_points(xyz), insitu_borrow(hexes), status, cell_type=INSITU_HEX)
        call expect(status == INSITU_OK, session%error())
        call session%set_field('m', 'p', insitu_borrow(pressure(2:)), status)
        call refused(session, 'p')
        call session%set_field('m', 'p', insitu_borrow(vector), status, index=insitu_borrow(places(2:)))
        call refused(session, 'index has not as many entries')
        call session%set_field('m', 'p', insitu_borrow(vector), status, index=insitu_borrow(nodes(1:8, :)))
        call refused(session, 'index is a list')
        call session%set_field('m', 'p', insitu_borrow(unknowns), status, centring=INSITU_CORNER, &
            index=insitu_borrow(dofs(1:8, 2:)))
        call refused(session, 'index has not as many entries')
        call session%set_field('m', 'p', insitu_borrow(cell_values), status, centring=INSITU_CELL, &
            patches=[insitu_patch(insitu_borrow(wall_values), faces=insitu_borrow(wall(2:)))])
        call refused(session, 'not as many values as faces')
        call session%set_field('m', 'p', insitu_borrow(cell_values), status, centring=INSITU_CELL, &
            patches=[insitu_patch(insitu_borrow(wall_values), connectivity=insitu_borrow(wall_faces), &
            offsets=insitu_borrow(wall))])
        call refused(session, 'offsets of a patch')
        call session%set_field('m', 'p', insitu_borrow(cell_values), status, centring=INSITU_CELL, &
            patches=[insitu_patch(insitu_borrow(wall_values), first_face=3)])
        call refused(session, 'patch 0: names faces by their numbers')
        places(5) = 0
        call session%set_field('m', 'p', insitu_borrow(vector), status, index=insitu_borrow(places))
        call session%step(0, 0.0_real64, status)
        call refused(session, 'the index of vertex 5 is 0, outside 1..250')
        call session%set_field('m', 'p', insitu_borrow(pressure), status)
        hexes(3, 2) = 0
        call session%set_mesh('m', insitu_points(xyz), insitu_borrow(hexes), status, cell_type=INSITU_HEX)
        call session%set_field('m', 'p', insitu_borrow(pressure), status)
        call session%step(0, 0.0_real64, status)
        call refused(session, 'vertex index 0 is outside 1..125')
        call session%remove_mesh('m', status)
        call expect(status == INSITU_OK, session%error())
        call session%destroy(status)
        call session%set_mesh('m', insitu_points(xyz), insitu_borrow(hexes), status, cell_type=INSITU_HEX)
        call refused(session, 'the session is not open')
        call session%step(1, 0.0_real64, status)
        call refused(session, 'the session is not open')
        call session%destroy(status)
        call expect(status == INSITU_OK .and. session%error() == '', 'a closed session may be closed again')
    end subroutine errors_are_reported
end program test_fortran
