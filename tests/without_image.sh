#!/bin/sh
# without_image.sh SOURCE FOLDER [build]: configured with INSITU_IMAGE=OFF nothing of the library names OpenImageIO or FreeType;
# with `build` it is built too, and a program draws into memory, and is told which file it cannot write.
set -eu
source=$1 folder=$2
rm -rf "$folder"
mkdir -p "$folder"
cmake -S "$source" -B "$folder/build" -G Ninja -DINSITU_IMAGE=OFF -DINSITU_VTK=OFF -DINSITU_BENCH=OFF -DBUILD_TESTING=OFF \
    >"$folder/said" 2>&1 || { cat "$folder/said"; exit 1; }
! grep -iE 'openimageio|freetype|insitu_image' "$folder/build/build.ninja" || exit 1
! grep -iE '^(openimageio|freetype)' "$folder/build/CMakeCache.txt" || exit 1
[ "${3:-}" = build ] || exit 0
cmake --build "$folder/build" --target insitu insitu_static >"$folder/said" 2>&1 || { cat "$folder/said"; exit 1; }
mpicc -I"$source/libinsitu/include" -o "$folder/in_memory" "$source/tests/outside/outside_memory.c" -L"$folder/build/lib" \
    -Wl,-rpath,"$folder/build/lib" -linsitu -lm
cd "$folder"
mpiexec -n 1 ./in_memory
