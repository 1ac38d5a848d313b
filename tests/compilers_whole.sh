#!/bin/sh
# compilers_whole.sh SOURCE FOLDER REGEX [cmake options]: builds all in FOLDER and runs the tests whose names match REGEX.
set -eu
source=$1 folder=$2 regex=$3
shift 3
cmake -S "$source" -B "$folder" -G Ninja -DCMAKE_BUILD_TYPE=Release -DINSITU_BENCH=OFF -DINSITU_WERROR=ON "$@" >"$folder.log" 2>&1 || {
    cat "$folder.log" >&2
    exit 1
}
cmake --build "$folder" -j "$(nproc)"
ctest --test-dir "$folder" --build-config Usual --output-on-failure -j "$(nproc)" -R "$regex"
