! Two hot spots that rotate around each other, on a box of hexahedra per rank.
program heat_program
    use, intrinsic :: iso_fortran_env, only: real64, error_unit
    use mpi_f08
    use insitu
    implicit none
    integer, parameter :: n = 20, side = n + 1
    real(real64), target :: xyz(3, side**3), heat(side**3)
    integer, target :: hexes(8, n**3)
    type(insitu_session) :: session
    real(real64) :: time, x, y
    integer :: rank, ranks, i, j, k, low, cycle, status

    call MPI_Init()
    call MPI_Comm_rank(MPI_COMM_WORLD, rank)
    call MPI_Comm_size(MPI_COMM_WORLD, ranks)

    do concurrent(k=0:n, j=0:n, i=0:n) ! each rank has a slab of a cube of side 1
        xyz(:, 1 + i + side*(j + side*k)) = [(rank + i/real(n, real64))/ranks, j/real(n, real64), k/real(n, real64)]
    end do
    do k = 0, n - 1
        do j = 0, n - 1
            do i = 0, n - 1
                low = 1 + i + side*(j + side*k) ! the lower quad in cyclic order, then the upper quad
                hexes(:4, 1 + i + n*(j + n*k)) = [low, low + 1, low + 1 + side, low + side]
            end do
        end do
    end do
    hexes(5:, :) = hexes(:4, :) + side**2

    call session%create(MPI_COMM_WORLD, 'heat.yaml', status)
    if (status /= INSITU_OK) then
        write (error_unit, '(a)') session%error()
        call MPI_Abort(MPI_COMM_WORLD, 1)
    end if
    call session%set_mesh('box', insitu_points(xyz), insitu_borrow(hexes), status, cell_type=INSITU_HEX)
    do cycle = 0, 9
        time = 0.3_real64*cycle
        x = 0.25_real64*cos(time)
        y = 0.25_real64*sin(time)
        heat = spot(0.5_real64 + x, 0.5_real64 + y) + spot(0.5_real64 - x, 0.5_real64 - y)
        call session%set_field('box', 'heat', insitu_borrow(heat), status)
        call session%step(cycle, time, status)
        if (status /= INSITU_OK .and. rank == 0) write (error_unit, '(a)') session%error()
    end do
    call session%destroy(status)
    if (status /= INSITU_OK .and. rank == 0) write (error_unit, '(a)') session%error()
    call MPI_Finalize()

contains
    function spot(x, y)
        real(real64), intent(in) :: x, y
        real(real64) :: spot(side**3)
        spot = exp(-8*((xyz(1, :) - x)**2 + (xyz(2, :) - y)**2 + (xyz(3, :) - 0.5_real64)**2))
    end function spot
end program heat_program
