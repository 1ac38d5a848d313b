#!/bin/sh
# packaging_by_the_letter.sh SOURCE FOLDER: runs the lines of docs/packaging.md as they stand, on a copy of SOURCE in FOLDER:
# build and install, link examples/six_calls.c by pkg-config and by CMake, to the shared and the static library, draw, uninstall.
# Only names are put in: <prefix>, and my_simulation for the example.
set -eu
source=$1 folder=$2
rm -rf "$folder"
mkdir -p "$folder/user"
trap 'rm -rf "$folder"' EXIT
git -C "$source" ls-files -z | (cd "$source" && tar --null -T - -cf -) | (mkdir "$folder/source" && tar -xf - -C "$folder/source")
prefix=$folder/prefix
page=$folder/source/docs/packaging.md

# block TEXT: the indented lines of the block that has the text.
block() {
    awk -v text="$1" '/^    / { block = block substr($0, 5) "\n"; next } index(block, text) { exit } { block = "" }
        END { if (index(block, text)) printf "%s", block }' "$page" | sed "s#<prefix>#$prefix#g; s#my_simulation\.c#six_calls.c#"
}

# run TEXT PATTERN: the lines of the block that match the pattern, in the current folder.
run() {
    block "$1" | grep -- "$2" >"$folder/lines" || { echo "docs/packaging.md: no line \"$2\" beside \"$1\""; exit 1; }
    sh -eu "$folder/lines" >"$folder/log" 2>&1 || { cat "$folder/lines" "$folder/log"; exit 1; }
}

# draws PROGRAM: the program writes pictures on two ranks.
draws() {
    rm -rf pictures
    mpirun -n 2 "$1"
    ls pictures/*.png >/dev/null || { echo "$1 drew nothing"; exit 1; }
}

cd "$folder/source"
run 'cmake -B build/user' '-B build/user'
run 'cmake -B build/user' '--install'

cd "$folder/user"
cp "$folder/source/examples/six_calls.c" .
cp "$folder/source/examples/six_calls.yaml" scene.yaml
run 'export PKG_CONFIG_PATH' .
draws ./a.out
export PKG_CONFIG_PATH="$prefix/lib/pkgconfig"
run '--static' mpicc
draws ./a.out

for library in insitu::insitu insitu::static; do
    {
        printf 'cmake_minimum_required(VERSION 3.16)\nproject(user LANGUAGES C)\nadd_executable(my_simulation six_calls.c)\n'
        sed -n '/^```cmake/,/^```$/{/^```/d;p}' "$page" | sed "s/insitu::insitu/$library m/"
    } >CMakeLists.txt
    rm -rf build
    cmake -S . -B build "-DCMAKE_PREFIX_PATH=$prefix" >"$folder/log" && cmake --build build >>"$folder/log" || { cat "$folder/log"; exit 1; }
    draws build/my_simulation
done

cd "$folder/source"
run 'cmake -B build/user' 'uninstall'
[ -z "$(find "$prefix" ! -type d)" ] || { echo 'uninstall left files'; exit 1; }
echo 'The lines of docs/packaging.md build, install, link and draw.'
