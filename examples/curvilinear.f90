! A simulation on one curvilinear block per rank, a part of a bent duct, with ghost layers. Run it with:
! mpirun -n 2 curvilinear curvilinear.yaml
program curvilinear
    use, intrinsic :: iso_fortran_env, only: real64, error_unit
    use mpi_f08
    use insitu
    implicit none
    integer, parameter :: ni = 48, nj = 12, nk = 12 ! cells of the whole duct: along it, outwards, and up
    real(real64), allocatable, target :: x(:, :, :), y(:, :, :), z(:, :, :), velocity(:, :, :, :), pressure(:, :, :)
    type(insitu_session) :: pictures
    character(256) :: scene
    integer :: first, n, rank, ranks, cycle, status

    call MPI_Init()
    call MPI_Comm_rank(MPI_COMM_WORLD, rank)
    call MPI_Comm_size(MPI_COMM_WORLD, ranks)
    first = ni*rank/ranks ! number of cells of the duct before this rank's cells
    n = ni*(rank + 1)/ranks - first
    allocate (x(-1:n + 1, -1:nj + 1, -1:nk + 1)) ! vertices, with a layer of ghost cells around them
    allocate (y, z, mold=x)
    allocate (velocity(3, -1:n + 1, -1:nj + 1, -1:nk + 1))
    allocate (pressure(0:n + 1, 0:nj + 1, 0:nk + 1)) ! cells, with the same ghost layer
    call make_duct()
    scene = 'scene.yaml'
    if (command_argument_count() > 0) call get_command_argument(1, scene)

    call pictures%create(MPI_COMM_WORLD, scene, status)
    if (status /= INSITU_OK) then
        if (rank == 0) write (error_unit, '(2a)') 'no pictures: ', pictures%error()
        call MPI_Abort(MPI_COMM_WORLD, 1)
    end if
    ! The complete arrays are passed; the cells 2 to n + 1, 2 to nj + 1 and 2 to nk + 1 are this rank's own.
    call pictures%set_block('duct', [n + 2, nj + 2, nk + 2], status, x=insitu_borrow(x), y=insitu_borrow(y), &
        z=insitu_borrow(z), interior_first=[2, 2, 2], interior_last=[n + 1, nj + 1, nk + 1])
    do cycle = 0, 1
        call advance(0.5_real64*cycle)
        call pictures%set_field('duct', 'velocity', insitu_borrow(velocity), status)
        call pictures%set_field('duct', 'pressure', insitu_borrow(pressure), status, centring=INSITU_CELL)
        call pictures%step(cycle, 0.5_real64*cycle, status)
        if (status /= INSITU_OK .and. rank == 0) write (error_unit, '(a)') pictures%error() ! the run continues
    end do
    call pictures%destroy(status)
    if (status /= INSITU_OK .and. rank == 0) write (error_unit, '(a)') pictures%error()
    deallocate (x, y, z, velocity, pressure) ! the library has read these arrays until here
    call MPI_Finalize()

contains
    subroutine make_duct()
        integer :: i, j, k
        real(real64) :: angle, radius
        do concurrent(k=-1:nk + 1, j=-1:nj + 1, i=-1:n + 1)
            ! computed from the position in the whole duct, so that two ranks get the same bits
            angle = 0.04_real64*(first + i)
            radius = 2 + j/12.0_real64 + 0.1_real64*sin(3*angle)
            x(i, j, k) = radius*cos(angle)
            y(i, j, k) = radius*sin(angle)
            z(i, j, k) = k/12.0_real64 + 0.2_real64*angle
        end do
    end subroutine make_duct

    subroutine advance(time)
        real(real64), intent(in) :: time
        integer :: i, j, k
        do concurrent(k=-1:nk + 1, j=-1:nj + 1, i=-1:n + 1)
            velocity(:, i, j, k) = [-y(i, j, k), x(i, j, k), 0.2_real64]*(j*(nj - j) + k*(nk - k))
        end do
        do concurrent(k=0:nk + 1, j=0:nj + 1, i=0:n + 1)
            pressure(i, j, k) = 1 + cos(0.3_real64*(first + i) - time)*cos(0.25_real64*(j + k))
        end do
    end subroutine advance
end program curvilinear
