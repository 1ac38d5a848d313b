#!/bin/sh
# One run of the mini-app on 2 ranks under valgrind: PROGRAM [options]. Fails on an error or a definite leak that the
# suppressions (Open MPI's own file, and ours beside this script) do not name. Open MPI unloads its plugins before the
# end, and calls them deeply: without their names kept and long stacks no suppression would find them. Then polyhedra,
# which the mini-app does not have: some frames of test_render_polyhedra, beside the program, without MPI.
set -eu
program=$(realpath "$1")
shift
here=$(cd "$(dirname "$0")" && pwd)
scene=$here/../examples/wave.yaml
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
status=0
export HWLOC_COMPONENTS=-x86 # which valgrind cannot run
[ $# -gt 0 ] || set -- --size 4 --steps 50
OMP_NUM_THREADS=2 mpirun -n 2 valgrind -q --keep-debuginfo=yes --num-callers=40 --error-exitcode=99 --leak-check=full --errors-for-leak-kinds=definite \
    --show-leak-kinds=definite --suppressions=/usr/share/openmpi/openmpi-valgrind.supp \
    --suppressions="$here/valgrind.supp" "$program" --scene "$scene" "$@" || status=$?
if [ $status = 0 ] && ! ls ./*.png >/dev/null 2>&1; then
    echo 'valgrind: no picture was drawn' >&2
    status=1
fi
valgrind -q --num-callers=40 --error-exitcode=99 "$(dirname "$program")/test_render_polyhedra" 'random_*' || status=$?
[ $status = 0 ] && echo 'valgrind: no errors' || echo "valgrind: errors, status $status" >&2
exit $status
