#!/bin/sh
# house_seeded.sh ROOT CC: the house tests can fail. Each violation is planted alone in a small tree or library of its
# own, which without it passes.
set -eu
root=$1
cc=$2
here=$root/tests
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
failures=0

# refuses WHAT COMMAND...: the command must fail with status 1 and print what.
refuses() {
    what=$1
    shift
    status=0
    "$@" >"$place/said" 2>&1 || status=$?
    if [ $status -ne 1 ] || ! grep -q -- "$what" "$place/said"; then
        printf 'status %s, not a refusal about "%s":\n' $status "$what"
        cat "$place/said"
        failures=$((failures + 1))
    fi
}

accepts() {
    if ! "$@" >"$place/said" 2>&1; then
        echo "refused: $*"
        cat "$place/said"
        failures=$((failures + 1))
    fi
}

fresh_tree() {
    rm -rf "$place/tree"
    mkdir "$place/tree"
    for room in libinsitu mmbvh render compositing adaptors mini-app tools bench tests examples cmake; do
        if [ -d "$root/$room" ]; then cp -R "$root/$room" "$place/tree/"; fi
    done
}

# plant FOLDER SUFFIX LINE WHAT: puts a file of that line into the tree, of which the test of includes is to complain.
plants=0
plant() {
    plants=$((plants + 1))
    printf '%s\n' "$3" >"$place/tree/$1/seeded_$plants.$2"
    printf '%s\n' "$1/seeded_$plants.$2.*$4" >>"$place/expected"
}

fresh_tree
accepts sh "$here/house_includes.sh" "$place/tree"
# One violation is enough for a refusal, and each of many is complained of.
printf 'int seeded;\n' >"$place/tree/tests/comp.c"
refuses 'tests/comp.c.*same name as compositing/comp.c' sh "$here/house_includes.sh" "$place/tree"
rm "$place/tree/tests/comp.c"
: >"$place/expected"
plant libinsitu/base c '#include "comp.h"' 'base must not include comp.h of compositing'
plant libinsitu/session c '    FILE *file = fopen(path, "r");' 'opens a file'
plant libinsitu/base c '    if ((file = open(path, O_RDONLY)) < 0) return;' 'opens a file'
plant libinsitu/base c '#include <mpi.h>' 'base knows no MPI'
plant mmbvh c '#include "render.h"' 'mmbvh must not include render.h of render_face'
plant mmbvh c '  #  include <mpi.h>' 'mmbvh knows no MPI'
plant render c '#include "comp.h"' 'render must not include comp.h of compositing'
plant render c '#include <comp.h>' 'comp.h is ours'
plant render h '#include "insitu/insitu.h"' 'render knows no MPI'
plant render c '#include "../libinsitu/session/scene/scene.h"' 'render must not include .*scene.h of scene'
plant compositing c '#include "render.h"' 'compositing must not include render.h of render_face'
plant render/rays h '#include "kernel_cell.h"' 'rays must not include kernel_cell.h of cells'
plant render/cells h '#include "kernel_finder.h"' 'cells must not include kernel_finder.h of find'
plant render/find c '#include "kernel_surface.h"' 'find must not include kernel_surface.h of surface'
plant render/volume h '#include "kernel_roots.h"' 'volume must not include kernel_roots.h of surface'
plant render/surface h '#include "kernel_samples.h"' 'surface must not include kernel_samples.h of volume'
plant render/volume h '#include "render_frame.h"' 'no file of the tree is called render_frame.h'
plant libinsitu/session c '#include "kernel_types.h"' 'session must not include kernel_types.h of rays'
plant libinsitu/session c '#include <vtkPoints.h>' 'session includes vtkPoints.h'
plant libinsitu/session/common h '#include "session_mesh.h"' 'common must not include session_mesh.h of meshes'
plant libinsitu/session/meshes h '#include "session_plan.h"' 'meshes must not include session_plan.h of plan'
plant libinsitu/session/meshes c '#include "scene.h"' 'meshes must not include scene.h of scene'
plant libinsitu/session/plan c '#include "session_frame.h"' 'plan must not include session_frame.h of pictures'
plant libinsitu/session/pictures c '#include "session.h"' 'pictures must not include session.h of session'
plant libinsitu/session/scene c '#include "session.h"' 'scene must not include session.h of session'
plant libinsitu/session/scene h '#include <mpi.h>' 'scene knows no MPI'
plant libinsitu/session/scene h '#include "mmbvh.h"' 'scene must not include mmbvh.h of mmbvh'
plant libinsitu/include/insitu h '#include "error.h"' 'public must not include error.h of base'
plant adaptors/vtk cpp '#include "memory.h"' 'adaptors must not include memory.h of base'
plant tools cpp '#include "scene.h"' 'tools must not include scene.h of scene'
plant mini-app c '#include "error.h"' 'mini-app must not include error.h of base'
plant mini-app c '#include "insitu/nowhere.h"' 'no file of the tree is called nowhere.h'
plant render cpp 'int seeded;' 'the core is C'
sh "$here/house_includes.sh" "$place/tree" >"$place/said" 2>&1 && failures=$((failures + 1))
while read -r what; do
    grep -q -- "$what" "$place/said" || {
        printf 'no complaint about "%s"\n' "$what"
        failures=$((failures + 1))
    }
done <"$place/expected"

# A tree of one function a room.
rooms='libinsitu mmbvh render compositing adaptors mini-app tools'
rm -rf "$place/tree"
for room in $rooms; do
    mkdir -p "$place/tree/$room/seeded"
    printf 'int seeded_alone(void)\n{\n    return 0;\n}\n' >"$place/tree/$room/alone.c"
done
figures() {
    python3 "$here/house_figures.py" --hold "$place/tree"
}
accepts figures
{
    printf 'int seeded(void)\n{\n    int a = 0;\n'
    yes '    a++;' | head -n 60
    printf '    return a;\n}\n'
} >"$place/tree/render/seeded.c"
refuses 'render: lines of a function: 65, more than 60' figures
rm "$place/tree/render/seeded.c"
for room in $rooms; do
    printf 'int seeded_there(void)\n{\n    return seeded_here();\n}\n' >"$place/tree/$room/seeded/seeded_one.c"
    printf 'int seeded_here(void)\n{\n    return seeded_there();\n}\n' >"$place/tree/$room/seeded/seeded_two.c"
done
refuses 'circles of calls among files' figures
for room in $rooms; do
    if ! grep -q "^$room: circles of calls among files: 1, more than 0" "$place/said"; then
        echo "the circle in $room was not found"
        failures=$((failures + 1))
    fi
    rm -r "$place/tree/$room/seeded"
done
accepts figures
rm -rf "$place/tree"
mkdir -p "$place/tree/mmbvh"
refuses 'wrong place' sh "$here/house_includes.sh" "$place/tree"

headers_tree() {
    rm -rf "$place/headers"
    mkdir -p "$place/headers/libinsitu/base" "$place/headers/libinsitu/session" "$place/headers/mmbvh" "$place/headers/render" \
        "$place/headers/compositing"
}
headers_tree
refuses 'no header was found' sh "$here/house_headers.sh" "$place/headers" "$cc"
echo 'typedef int seeded;' >"$place/headers/render/seeded.h"
accepts sh "$here/house_headers.sh" "$place/headers" "$cc"
echo 'static inline bool is_seeded(void) { return true; }' >"$place/headers/render/seeded.h"
refuses 'render/seeded.h does not compile alone' sh "$here/house_headers.sh" "$place/headers" "$cc"

# library NAME SOURCE [FLAG...]
library() {
    printf '%s\n' "$2" >"$place/$1.c"
    name=$1
    shift 2
    "$cc" -shared -fPIC -o "$place/$name.so" "$place/$name.c" "$@"
}
library clean 'int insitu_one(void); int insitu_one(void) { return 1; }'
accepts sh "$here/house_library.sh" "$place/clean.so"
library leaking 'int insitu_one(void) { return 1; } int comp_two(void) { return 2; }' -w
refuses comp_two sh "$here/house_library.sh" "$place/leaking.so"
library heavy 'int insitu_one(void) { return 1; }' -w -Wl,--no-as-needed -l:libstdc++.so.6
refuses 'libstdc++' sh "$here/house_library.sh" "$place/heavy.so"
library empty 'static int one; int *insitu_none(void);' -w
refuses 'nothing at all' sh "$here/house_library.sh" "$place/empty.so"

# object NAME SOURCE
object() {
    printf '%s\n' "$2" >"$place/$1.c"
    "$cc" -w -c -o "$place/$1.o" "$place/$1.c"
}
object one 'static int half(int x) { return x / 2; } int (*const table)(int) = half;'
object two 'int half(int x) { return x / 2; } int (*const table)(int) = half;'
object weak '__attribute__((weak)) int half(int x) { return x / 2; } int (*const table)(int) = half;'
accepts sh "$here/house_kernels.sh" "$place/one.o"
refuses half sh "$here/house_kernels.sh" "$place/one.o" "$place/two.o"
refuses half sh "$here/house_kernels.sh" "$place/weak.o"

exit $((failures > 0))
