! A simulation that draws itself: the slab of hexahedra of six_calls.c, in Fortran. Run it with:
! mpirun -n 2 six_calls_fortran
program six_calls
    use, intrinsic :: iso_fortran_env, only: real64, error_unit
    use mpi_f08
    use insitu
    implicit none
    integer, parameter :: nx = 12, ny = 24, nz = 24, n = (nx + 1)*(ny + 1)*(nz + 1)
    real(real64), target :: xyz(3, n), pressure(n)
    integer, target :: hexes(8, nx*ny*nz)
    type(insitu_session) :: pictures
    character(256) :: scene
    integer :: i, j, k, rank, cycle, status

    call MPI_Init()
    call MPI_Comm_rank(MPI_COMM_WORLD, rank)
    do concurrent(k=0:nz, j=0:ny, i=0:nx)
        xyz(:, vertex(i, j, k)) = [i + rank*nx, j, k]
    end do
    do concurrent(k=0:nz - 1, j=0:ny - 1, i=0:nx - 1) ! VTK's order: the lower quad in cyclic order, then the upper quad
        hexes(:, 1 + i + nx*(j + ny*k)) = [quad(i, j, k), quad(i, j, k + 1)]
    end do
    scene = 'scene.yaml'
    if (command_argument_count() > 0) call get_command_argument(1, scene)

    call pictures%create(MPI_COMM_WORLD, scene, status)
    if (status /= INSITU_OK) then
        if (rank == 0) write (error_unit, '(2a)') 'no pictures: ', pictures%error()
        call MPI_Abort(MPI_COMM_WORLD, 1)
    end if
    call pictures%set_mesh('slab', insitu_points(xyz), insitu_borrow(hexes), status, cell_type=INSITU_HEX) ! not copied
    do cycle = 0, 3
        pressure = cos(0.6_real64*hypot(hypot(xyz(1, :) - 12, xyz(2, :) - 12), xyz(3, :) - 12) - 0.5_real64*cycle)
        ! the array is the same and has new values
        call pictures%set_field('slab', 'pressure', insitu_borrow(pressure), status)
        call pictures%step(cycle, 0.5_real64*cycle, status)
        if (status /= INSITU_OK .and. rank == 0) write (error_unit, '(a)') pictures%error() ! the run continues
    end do
    call pictures%destroy(status)
    if (status /= INSITU_OK .and. rank == 0) write (error_unit, '(a)') pictures%error()
    call MPI_Finalize()

contains
    pure integer function vertex(i, j, k)
        integer, intent(in) :: i, j, k
        vertex = 1 + i + (nx + 1)*(j + (ny + 1)*k)
    end function vertex

    pure function quad(i, j, k)
        integer, intent(in) :: i, j, k
        integer :: quad(4)
        quad = [vertex(i, j, k), vertex(i + 1, j, k), vertex(i + 1, j + 1, k), vertex(i, j + 1, k)]
    end function quad
end program six_calls
