! Structured blocks from Fortran: each form and layout draws the picture of the same cells handed over as hexes or quads, to
! the byte; what does not fit is a status and a text that says what was found and what was expected.
module test_fortran_blocks
    use, intrinsic :: iso_fortran_env, only: int8, int16, int32, int64, real32, real64, error_unit
    use mpi_f08
    use insitu
    implicit none
    private
    public :: test_blocks

    integer, parameter :: n = 5, cells(3) = 4
    real(real64), target :: x(n, n, n), y(n, n, n), z(n, n, n), f(n, n, n), c(4, 4, 4)
    real(real64), target :: xyz(3, n**3), vector(2, n, n, n), vector_after(n, n, n, 2)
    integer(int32), target :: hexes(8, 64), places(n, n, n)
    real(real64), target :: wide_x(0:n + 2, 0:n + 1, n), wide_y(0:n + 2, 0:n + 1, n), wide_z(0:n + 2, 0:n + 1, n)
    real(real64), target :: wide_f(0:n + 2, 0:n + 1, n), wide_c(6, 7, 5), turned(n, n, n)
    real(real32), target :: narrow(n, n, n, 3), axis_4(n)
    real(real64), target :: axis(n), first_axis(n), gaps(2*n)
    real(real64), target :: with_layers(n + 2, n + 2, n + 2)
    integer(int8), target :: flags(6, 6, 6), short(3, 4, 4), flags_2(4, 4)
    character(:), allocatable :: prefix
    integer :: rank, status

contains

    subroutine test_blocks(folder)
        character(*), intent(in) :: folder
        prefix = folder
        call MPI_Comm_rank(MPI_COMM_WORLD, rank)
        call make_arrays()
        call hexes_are_drawn_by_blocks()
        call integers_are_drawn_as_reals()
        call quads_are_drawn_by_blocks()
        call wrong_blocks_are_refused()
        call wrong_fields_are_refused()
    end subroutine test_blocks

    ! A block of 4 x 4 x 4 cells for each rank, side by side along x; padding that no picture may show.
    subroutine make_arrays()
        integer :: i, j, k, v
        do k = 1, n
            do j = 1, n
                do i = 1, n
                    v = i + n*(j - 1 + n*(k - 1))
                    xyz(:, v) = [i - 1 + 4*rank, j - 1, k - 1]
                    x(i, j, k) = xyz(1, v)
                    y(i, j, k) = xyz(2, v)
                    z(i, j, k) = xyz(3, v)
                    f(i, j, k) = 0.25_real64*(j - 1) + 0.5_real64*(k - 1) + 0.0625_real64*modulo(i, 3)
                    places(i, j, k) = v
                    turned(k, j, i) = f(i, j, k)
                end do
            end do
        end do
        do v = 1, 64
            i = 1 + modulo(v - 1, 4) + n*(modulo((v - 1)/4, 4) + n*((v - 1)/16))
            hexes(:, v) = [i, i + 1, i + 1 + n, i + n, i + n*n, i + 1 + n*n, i + 1 + n + n*n, i + n + n*n]
        end do
        c = f(2:, 2:, 2:)
        wide_x = -1e9_real64
        wide_y = -1e9_real64
        wide_z = -1e9_real64
        wide_f = 1e9_real64
        wide_c = 1e9_real64
        wide_x(1:n, 1:n, :) = x
        wide_y(1:n, 1:n, :) = y
        wide_z(1:n, 1:n, :) = z
        wide_f(1:n, 1:n, :) = f
        wide_c(2:5, 3:6, 1:4) = c
        narrow(:, :, :, 1) = real(x, real32)
        narrow(:, :, :, 2) = real(y, real32)
        narrow(:, :, :, 3) = real(z, real32)
        vector = 7
        vector(1, :, :, :) = f
        vector_after = 7
        vector_after(:, :, :, 1) = f
        axis = [(i, i=0, n - 1)]
        axis_4 = real(axis, real32)
        first_axis = axis + 4*rank
        gaps = -1e9_real64
        gaps(::2) = axis
        with_layers = 1e9_real64
        with_layers(2:n + 1, 2:n + 1, 2:n + 1) = f
        flags = 0_int8
        short = 0_int8
        flags_2 = 0_int8
    end subroutine make_arrays

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

    subroutine refused(session, words)
        type(insitu_session), intent(in) :: session
        character(*), intent(in) :: words
        call expect(status /= INSITU_OK .and. index(session%error(), words) > 0, words//', not: '//session%error())
    end subroutine refused

    subroutine start(session, layer)
        type(insitu_session), intent(inout) :: session
        character(*), intent(in), optional :: layer
        character(:), allocatable :: layers
        layers = '{isosurface: {field: p, component: 0, values: [1.3]}}, {surface: {opacity: 0.3}}'
        if (present(layer)) layers = layer
        call session%create_from_text(MPI_COMM_WORLD, 'images: [{name: a, size: [48, 32], layers: ['//layers// &
            '], outputs: [{path: '//prefix//'block.png}]}]', status)
        call expect(status == INSITU_OK, session%error())
    end subroutine start

    ! Steps, ends the session, and returns the file's bytes on rank 0.
    function picture(session) result(out)
        type(insitu_session), intent(inout) :: session
        character(:), allocatable :: out
        integer :: unit, size
        call expect(status == INSITU_OK, session%error())
        call session%step(0, 0.0_real64, status)
        call expect(status == INSITU_OK, session%error())
        call session%destroy(status)
        call expect(status == INSITU_OK, 'the session ends')
        out = ''
        if (rank /= 0) return
        open (newunit=unit, file=prefix//'block.png', access='stream', form='unformatted', status='old')
        inquire (unit, size=size)
        deallocate (out)
        allocate (character(size) :: out)
        read (unit) out
        close (unit)
    end function picture

    ! The picture of a field p on the block that the session has.
    subroutine same(session, values, plain, what, centring)
        type(insitu_session), intent(inout) :: session
        type(insitu_array), intent(in) :: values
        character(*), intent(in) :: plain, what
        integer, intent(in), optional :: centring
        call expect(status == INSITU_OK, session%error())
        call session%set_field('m', 'p', values, status, centring=centring)
        call expect(picture(session) == plain .or. rank /= 0, what//' draw the picture of hexes')
    end subroutine same

    subroutine fill_layers(values, own_status)
        type(insitu_array), intent(out) :: values
        integer, intent(out) :: own_status
        values = insitu_borrow(with_layers)
        own_status = INSITU_OK
    end subroutine fill_layers

    subroutine fill_wrongly(values, own_status)
        type(insitu_array), intent(out) :: values
        integer, intent(out) :: own_status
        values = insitu_borrow(with_layers(2:, :, :))
        own_status = INSITU_OK
    end subroutine fill_wrongly

    ! Values of all kinds of integers, (i, j, k) and with components, draw the picture of the same values as reals.
    subroutine integers_are_drawn_as_reals()
        real(real64), target :: reals(n, n, n)
        integer(int8), target :: i1(n, n, n), i1_before(2, n, n, n)
        integer(int16), target :: i2(n, n, n), i2_before(2, n, n, n)
        integer(int32), target :: i4(n, n, n), i4_before(2, n, n, n)
        integer(int64), target :: i8(n, n, n), i8_before(2, n, n, n)
        character(:), allocatable :: plain
        type(insitu_session) :: s
        reals = aint(2*f)
        i8 = int(reals, int64)
        i4 = int(i8, int32)
        i2 = int(i8, int16)
        i1 = int(i8, int8)
        i8_before = 7
        i8_before(1, :, :, :) = i8
        i4_before = int(i8_before, int32)
        i2_before = int(i8_before, int16)
        i1_before = int(i8_before, int8)
        call set_block_of_rank(s)
        call s%set_field('m', 'p', insitu_borrow(reals), status)
        plain = picture(s)
        call expect(len(plain) > 300 .or. rank /= 0, 'the picture of reals shows something')
        call same_on_block_of_rank(s, insitu_borrow(i1), plain, 'integers of 1 byte')
        call same_on_block_of_rank(s, insitu_borrow(i2), plain, 'integers of 2 bytes')
        call same_on_block_of_rank(s, insitu_borrow(i4), plain, 'integers of 4 bytes')
        call same_on_block_of_rank(s, insitu_borrow(i8), plain, 'integers of 8 bytes')
        call same_on_block_of_rank(s, insitu_borrow(i1_before), plain, 'components of 1 byte')
        call same_on_block_of_rank(s, insitu_borrow(i2_before), plain, 'components of 2 bytes')
        call same_on_block_of_rank(s, insitu_borrow(i4_before), plain, 'components of 4 bytes')
        call same_on_block_of_rank(s, insitu_borrow(i8_before), plain, 'components of 8 bytes')
    end subroutine integers_are_drawn_as_reals

    subroutine same_on_block_of_rank(s, values, plain, what)
        type(insitu_session), intent(inout) :: s
        type(insitu_array), intent(in) :: values
        character(*), intent(in) :: plain, what
        call set_block_of_rank(s)
        call same(s, values, plain, what)
    end subroutine same_on_block_of_rank

    subroutine set_block_of_rank(s)
        type(insitu_session), intent(inout) :: s
        real(real64), parameter :: spacing(3) = 1
        call start(s)
        call s%set_block('m', cells, status, spacing=spacing, first=[4*rank, 0, 0])
    end subroutine set_block_of_rank

    subroutine hexes_are_drawn_by_blocks()
        type(insitu_session) :: s
        character(:), allocatable :: plain, of_cells
        real(real64) :: spacing(3), origin(3)
        integer :: first(3)
        spacing = 1
        origin = 0
        first = [4*rank, 0, 0]
        call start(s)
        call s%set_mesh('m', insitu_points(xyz), insitu_borrow(hexes), status, cell_type=INSITU_HEX)
        call s%set_field('m', 'p', insitu_borrow(vector(1, :, :, :)), status)
        call refused(s, 'values have 3 dimensions, expected a list or a matrix')
        call s%set_field('m', 'p', insitu_borrow(reshape_f()), status)
        plain = picture(s)
        call expect(len(plain) > 300 .or. rank /= 0, 'the picture shows something')
        call start(s)
        call s%set_mesh('m', insitu_points(xyz), insitu_borrow(hexes), status, cell_type=INSITU_HEX)
        call s%set_field('m', 'p', insitu_borrow(reshape_c()), status, centring=INSITU_CELL)
        of_cells = picture(s)
        call expect(of_cells /= plain .or. rank /= 0, 'cells have other values')

        call start(s)
        call s%set_block('m', cells, status, spacing=spacing, first=first)
        call same(s, insitu_borrow(f), plain, 'uniform')
        call start(s)
        call s%set_block('m', cells, status, spacing=spacing, origin=origin, first=first)
        call same(s, insitu_borrow(c), of_cells, 'uniform, cells', INSITU_CELL)
        call start(s)
        call s%set_block('m', cells, status, spacing=spacing, first=first, vertex_layout=insitu_borrow(wide_f(1:n, 1:n, :)))
        call same(s, insitu_borrow(wide_f(1:n, 1:n, :)), plain, 'uniform, padded')
        call start(s)
        call s%set_block('m', cells, status, spacing=spacing, first=first, cell_layout=insitu_borrow(wide_c(2:5, 3:6, 1:4)))
        call same(s, insitu_borrow(wide_c(2:5, 3:6, 1:4)), of_cells, 'uniform, padded, cells', INSITU_CELL)
        call start(s)
        call s%set_block('m', cells, status, x=insitu_borrow(first_axis), y=insitu_borrow(axis_4), z=insitu_borrow(gaps(::2)))
        call same(s, insitu_borrow(f), plain, 'rectilinear')
        call start(s)
        call s%set_block('m', cells, status, x=insitu_borrow(x), y=insitu_borrow(y), z=insitu_borrow(z))
        call same(s, insitu_borrow(f), plain, 'curvilinear')
        call start(s)
        call s%set_block('m', cells, status, x=insitu_borrow(narrow(:, :, :, 1)), y=insitu_borrow(narrow(:, :, :, 2)), &
            z=insitu_borrow(narrow(:, :, :, 3)))
        call same(s, insitu_borrow(f), plain, 'curvilinear of 4 bytes')
        call start(s)
        call s%set_block('m', cells, status, x=insitu_borrow(wide_x(1:n, 1:n, :)), y=insitu_borrow(wide_y(1:n, 1:n, :)), &
            z=insitu_borrow(wide_z(1:n, 1:n, :)))
        call same(s, insitu_borrow(wide_f(1:n, 1:n, :)), plain, 'curvilinear, padded')
        call start(s)
        call s%set_block('m', cells, status, spacing=spacing, first=first)
        call same(s, insitu_borrow(vector), plain, 'components before')
        call start(s)
        call s%set_block('m', cells, status, spacing=spacing, first=first)
        call same(s, insitu_borrow(vector_after), plain, 'components after')
        call start(s)
        call s%set_block('m', cells, status, spacing=spacing, first=first)
        call s%set_field('m', 'p', insitu_borrow(reshape_f()), status, index=insitu_borrow(places))
        call expect(picture(s) == plain .or. rank /= 0, 'an index (i, j, k)')
        call start(s)
        call s%set_block('m', [6, 6, 6], status, spacing=spacing, first=first - 1, interior_first=[2, 2, 2], &
            interior_last=[5, 5, 5], ghosts=insitu_borrow(flags))
        call expect(status == INSITU_OK, s%error())
        call s%set_filled_field('m', 'p', fill_layers, status)
        call expect(picture(s) == plain .or. rank /= 0, 'ghost layers, and values by a procedure')
        call start(s)
        call s%set_block('m', [2, 4, 4], status, spacing=spacing, first=first, refinement=[1, 1, 1], number=7, &
            cell_layout=insitu_borrow(c(:2, :, :)))
        call s%set_field('m', 'p', insitu_borrow(c(:2, :, :)), status, centring=INSITU_CELL, number=7)
        call s%set_block('m', [4, 4, 4], status, spacing=spacing, first=first, number=8)
        call s%set_block('m', [2, 4, 4], status, spacing=spacing, first=first + [2, 0, 0], refinement=[1, 1, 1], number=9, &
            cell_layout=insitu_borrow(c(3:, :, :)))
        call s%set_components('m', 'p', [insitu_borrow(c(3:, :, :))], status, centring=INSITU_CELL, number=9)
        call expect(status == INSITU_OK, s%error())
        call s%set_field('m', 'p', insitu_borrow(c), status, centring=INSITU_CELL)
        call expect(status /= INSITU_OK, 'the mesh is of blocks')
        call s%remove_mesh('m', status, number=8)
        call expect(picture(s) == of_cells .or. rank /= 0, 'two blocks of one mesh draw the picture of hexes')
        call start(s)
        call s%set_block('m', [6, 6, 6], status, spacing=spacing, first=first - 1, interior_first=[2, 2, 2], &
            interior_last=[5, 5, 5], number=3)
        call s%set_filled_field('m', 'p', fill_layers, status, number=3)
        call expect(picture(s) == plain .or. rank /= 0, 'values of a numbered block by a procedure')
    end subroutine hexes_are_drawn_by_blocks

    ! Their memory as lists.
    function reshape_f() result(out)
        real(real64), pointer :: out(:)
        out(1:size(f)) => f
    end function reshape_f

    function reshape_c() result(out)
        real(real64), pointer :: out(:)
        out(1:size(c)) => c
    end function reshape_c

    subroutine quads_are_drawn_by_blocks()
        character(*), parameter :: layer = '{surface: {colour_by: {field: p}}}'
        type(insitu_session) :: s
        character(:), allocatable :: plain
        integer(int32), target :: quads(4, 16)
        integer :: i, v
        do i = 1, 16
            v = 1 + modulo(i - 1, 4) + n*((i - 1)/4)
            quads(:, i) = [v, v + 1, v + 1 + n, v + n]
        end do
        call start(s, layer)
        call s%set_mesh('m', insitu_points(xyz(:, :n*n)), insitu_borrow(quads), status, cell_type=INSITU_QUAD)
        call s%set_field('m', 'p', insitu_borrow(reshape_plane()), status)
        plain = picture(s)
        call expect(len(plain) > 300 .or. rank /= 0, 'the picture shows something')
        call start(s, layer)
        call s%set_block('m', [4, 4], status, x=insitu_borrow(x(:, :, 1)), y=insitu_borrow(y(:, :, 1)), &
            z=insitu_borrow(z(:, :, 1)), ghosts=insitu_borrow(flags_2))
        call same(s, insitu_borrow(f(:, :, 1)), plain, 'quads in space')
        call start(s, layer)
        call s%set_block('m', [4, 4], status, spacing=[1.0_real64, 1.0_real64], first=[4*rank, 0], interior_first=[1, 1], &
            interior_last=[4, 4])
        call same(s, insitu_borrow(f(:, :, 1)), plain, 'uniform quads')
    end subroutine quads_are_drawn_by_blocks

    function reshape_plane() result(out)
        real(real64), pointer :: out(:)
        out(1:n*n) => f(:, :, 1)
    end function reshape_plane

    subroutine wrong_blocks_are_refused()
        type(insitu_session) :: s
        real(real64) :: spacing(3)
        spacing = 1
        call start(s)
        call s%set_block('m', [4], status, spacing=spacing)
        call refused(s, 'cells are 4, expected two or three numbers')
        call s%set_block('m', [4, 0, 4], status, spacing=spacing)
        call refused(s, 'cells are (4, 0, 4), expected')
        call s%set_block('m', [4, -4, 4], status, spacing=spacing)
        call refused(s, 'cells are (4, -4, 4), expected')
        call s%set_block('m', [huge(1), huge(1), huge(1)], status, spacing=spacing)
        call refused(s, 'too many, expected at most 4294967294')
        call s%set_block('m', cells, status)
        call refused(s, 'lattice: neither spacing nor axes nor coordinates are given')
        call s%set_block('m', cells, status, spacing=spacing(:1))
        call refused(s, 'spacing has 1 numbers, expected 3')
        call s%set_block('m', cells, status, spacing=[1.0_real64, 0.0_real64, 1.0_real64])
        call refused(s, 'the spacing along j is 0')
        call s%set_block('m', cells, status, origin=spacing)
        call refused(s, 'spacing is not given, and origin or first is')
        call s%set_block('m', cells, status, spacing=spacing, interior_first=[1, 1, 1])
        call refused(s, 'expected both or none')
        call s%set_block('m', cells, status, spacing=spacing, interior_first=[1, 1, 1], interior_last=[4, 5, 4])
        call refused(s, 'the interior along j is 0..5')
        call s%set_block('m', cells, status, spacing=spacing, ghosts=insitu_borrow(short))
        call refused(s, 'ghosts has the shape (3, 4, 4), expected (4, 4, 4) for the cells of the block')
        call s%set_block('m', cells, status, spacing=spacing, ghosts=insitu_borrow(c))
        call refused(s, 'ghost flags are of element type 2')
        call s%set_block('m', cells, status, x=insitu_borrow(axis), y=insitu_borrow(axis(2:)), z=insitu_borrow(axis))
        call refused(s, 'y has 4 elements, expected 5, one more than there are cells')
        call s%set_block('m', cells, status, x=insitu_borrow(axis), y=insitu_borrow(axis))
        call refused(s, 'coordinates along k are not given')
        call s%set_block('m', cells, status, spacing=spacing, x=insitu_borrow(axis), y=insitu_borrow(axis), z=insitu_borrow(axis))
        call refused(s, 'spacing and axes are given')
        call s%set_block('m', cells, status, x=insitu_borrow(x), y=insitu_borrow(y))
        call refused(s, 'z coordinates are not given')
        call s%set_block('m', cells, status, x=insitu_borrow(x), y=insitu_borrow(y(:, 2:, :)), z=insitu_borrow(z))
        call refused(s, 'y has the shape (5, 4, 5), expected (5, 5, 5) for the vertices of the block')
        call s%set_block('m', cells, status, x=insitu_borrow(x), y=insitu_borrow(y), z=insitu_borrow(wide_z(1:n, 1:n, :)))
        call refused(s, 'z has strides of (8, 64, 448) bytes, which are as (1, 8, 56), expected as (1, 5, 25)')
        call s%set_block('m', cells, status, spacing=spacing, ghosts=insitu_borrow(c))
        call refused(s, 'ghost flags are of element type 2')
        call s%set_block('m', cells, status, x=insitu_borrow(x), y=insitu_borrow(y), z=insitu_borrow(z(n:1:-1, :, :)))
        call refused(s, 'z has strides of (-8, 40, 200) bytes, expected positive ones')
        call s%step(0, 0.0_real64, status)
        call refused(s, 'ghost flags are of element type 2')
        call s%destroy(status)
    end subroutine wrong_blocks_are_refused

    subroutine wrong_fields_are_refused()
        type(insitu_session) :: s
        real(real64) :: spacing(3)
        spacing = 1
        call start(s)
        call s%set_block('m', cells, status, spacing=spacing)
        call expect(status == INSITU_OK, s%error())
        call s%set_field('m', 'p', insitu_borrow(f(2:, :, :)), status)
        call refused(s, 'values has the shape (4, 5, 5), expected (5, 5, 5), with components before or after, for the vertices')
        call s%set_field('m', 'p', insitu_borrow(f), status, centring=INSITU_CELL)
        call refused(s, 'values has the shape (5, 5, 5), expected (4, 4, 4)')
        call s%set_field('m', 'p', insitu_borrow(wide_f(1:n, 1:n, :)), status)
        call refused(s, 'values has strides of (8, 64, 448) bytes, which are as (1, 8, 56), expected as (1, 5, 25): all '// &
            'arrays of the vertices of a block have one order and padding (vertex_layout of set_block says which)')
        call s%set_field('m', 'p', insitu_borrow(wide_c(2:5, 3:6, 1:4)), status, centring=INSITU_CELL)
        call refused(s, 'expected as (1, 4, 16): all arrays of the cells')
        call s%set_field('m', 'p', insitu_borrow(f(:, :, 1)), status)
        call refused(s, 'values has the shape (5, 5), expected (5, 5, 5)')
        call s%set_field('m', 'p', insitu_borrow(axis), status)
        call refused(s, 'values is a list of 5, expected 125 or (5, 5, 5)')
        call s%set_field('m', 'p', insitu_borrow(f), status, index=insitu_borrow(places(2:, :, :)))
        call refused(s, 'index has the shape (4, 5, 5), expected (5, 5, 5) for the vertices')
        call s%set_field('m', 'p', insitu_borrow(reshape_f()), status, centring=INSITU_CORNER)
        call refused(s, 'values at corners, and the mesh is a lattice')
        call s%set_filled_field('m', 'p', fill_wrongly, status)
        call s%step(0, 0.0_real64, status)
        call refused(s, ': values has the shape (6, 7, 7), expected (5, 5, 5)')
        call s%set_field('m', 'p', insitu_borrow(f), status)
        call s%step(1, 0.0_real64, status)
        call expect(status == INSITU_OK, 'the session goes on after errors: '//s%error())
        call s%destroy(status)
    end subroutine wrong_fields_are_refused
end module test_fortran_blocks
