! A two-dimensional simulation: heat on squares of quads, one per rank, side by side. The pictures equal those of
! plate.c. Run it with:
! mpirun -n 2 plate plate.yaml
program heat_in_a_plane
    use, intrinsic :: iso_fortran_env, only: real64, error_unit
    use mpi_f08
    use insitu
    implicit none
    integer, parameter :: n = 32, vertices = (n + 1)**2
    real(real64), target :: xy(2, vertices), heat(vertices)
    integer, target :: quads(4, n*n)
    type(insitu_session) :: pictures
    type(insitu_report) :: report
    character(256) :: scene
    real(real64) :: time
    integer :: i, j, rank, cycle, status

    call MPI_Init()
    call MPI_Comm_rank(MPI_COMM_WORLD, rank)
    do concurrent(j=0:n, i=0:n)
        xy(:, 1 + i + (n + 1)*j) = [rank + i/real(n, real64), j/real(n, real64)]
    end do
    do concurrent(j=0:n - 1, i=0:n - 1)
        quads(:, 1 + i + n*j) = 1 + i + (n + 1)*j + [0, 1, n + 2, n + 1]
    end do
    scene = 'plate.yaml'
    if (command_argument_count() > 0) call get_command_argument(1, scene)

    call pictures%create(MPI_COMM_WORLD, scene, status)
    if (status /= INSITU_OK) then
        if (rank == 0) write (error_unit, '(2a)') 'no pictures: ', pictures%error()
        call MPI_Abort(MPI_COMM_WORLD, 1)
    end if
    ! (2, vertices): z is not given, and is 0
    call pictures%set_mesh('plate', insitu_points(xy), insitu_borrow(quads), status, cell_type=INSITU_QUAD)
    do cycle = 0, 2
        time = 0.5_real64*cycle
        heat = 1/(1 + 12*((xy(1, :) - (0.5_real64 + time))*(xy(1, :) - (0.5_real64 + time)) &
            + (xy(2, :) - 0.4_real64)*(xy(2, :) - 0.4_real64)))
        call pictures%set_field('plate', 'heat', insitu_borrow(heat), status)
        call pictures%step(cycle, time, status)
        if (status /= INSITU_OK .and. rank == 0) write (error_unit, '(a)') pictures%error()
        report = pictures%report()
        if (rank == 0) write (error_unit, '(a)', advance='no') insitu_text(report%warnings)
    end do
    call pictures%destroy(status)
    if (status /= INSITU_OK .and. rank == 0) write (error_unit, '(a)') pictures%error()
    call MPI_Finalize()
end program heat_in_a_plane
