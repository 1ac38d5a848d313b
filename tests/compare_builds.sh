#!/bin/sh
# compare_builds.sh BEFORE AFTER [GRID ...]: do two builds draw the same pictures, to the bit?
#
# BEFORE and AFTER are the insitu-render programs of the two, and picture_difference is built beside AFTER. The grids
# are those of INSITU_TEST_DATA, the named ones or a choice that has every cell type. Each is drawn as isosurfaces and
# as volumes in every way that a scene knows, on every instruction set, on 1 and 3 ranks. Names the pictures that
# differ, with how many pixels and by how much, and exits with 1 where one does.
set -eu
if [ $# -lt 2 ]; then
    sed -n '2,7s/^# //p' "$0" >&2
    exit 2
fi
before=$1
after=$2
shift 2
data=${INSITU_TEST_DATA:?names no folder of grids}
[ $# -gt 0 ] || set -- bluntfin_tet bluntfin_hex mixed_lattice poly_voronoi mesh_fs8_wedge pentahexa cylinder_linear can_2
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT

# field VALUE LOW HIGH of a grid, as the data's own page has them
subject() {
    case $1 in
    bluntfin_*) echo Density 1.2 0.4 3.5 ;;
    mixed_lattice | poly_voronoi) echo f 0.2 -1.5 1.5 ;;
    mesh_fs8_wedge) echo synthetic 0.2 -2 1.8 ;;
    pentahexa) echo synthetic 0.3 -1 1.6 ;;
    cylinder_linear) echo vel_norm 0.5 0 1 ;;
    can_2) echo EQPS 0.7 0 2.7 ;;
    *) echo "compare_builds.sh: no field is known of $1" >&2; exit 2 ;;
    esac
}

# image NAME LAYERS [SAMPLING]
image() {
    printf '  - name: %s\n    size: [150, 110]\n    layers: [%s]\n' "$1" "$2"
    [ -z "${3-}" ] || printf '    sampling: {%s}\n' "$3"
    printf '    outputs: [{path: "{name}.exr"}, {path: "{name}.png", bits: 16}]\n'
}

scene() {
    field=$1 value=$2 low=$3 high=$4
    surface="field: $field, values: [$value]"
    middle=$(awk "BEGIN { print 0.4 * $low + 0.6 * $high }")
    volume="volume: {field: $field, range: [$low, $high], opacity: [[0, 0.1], [0.4, 0], [0.4, 0.5], [1, 0.9]]}"
    echo 'threads: 2'
    echo 'images:'
    image surface "{isosurface: {$surface}}"
    image coloured "{isosurface: {$surface, colour_by: {field: $field}}}"
    image transparent "{isosurface: {field: $field, values: [$value, $middle], opacity: 0.4}}"
    image differences "{isosurface: {$surface, normals: differences}}"
    image samples "{$volume}" 'method: samples'
    image segments "{$volume}" 'method: segments'
    image error "{$volume}" 'max_error: 0.01'
    image both "{isosurface: {$surface, opacity: 0.7}}, {$volume}" 'method: segments'
    image two "{$volume}, {volume: {field: $field, range: [$low, $high], map: grey}}" 'method: samples'
}

# draw PROGRAM ISA RANKS GRID FOLDER
draw() {
    mkdir "$5"
    (cd "$5" && INSITU_ISA=$2 mpirun -n "$3" "$1" "$place/scene.yaml" "$data/$4.vtu" >said 2>&1) ||
        { cat "$5/said"; exit 1; }
    rm "$5/said"
}

different=0 compared=0
for grid; do
    # shellcheck disable=SC2046 # four words
    scene $(subject "$grid") >"$place/scene.yaml"
    for isa in plain sse4.2 avx2 avx512; do
        for ranks in 1 3; do
            draw "$before" $isa $ranks "$grid" "$place/before"
            draw "$after" $isa $ranks "$grid" "$place/after"
            for picture in "$place"/before/*; do
                compared=$((compared + 1))
                said=$("${after%/*}/picture_difference" "$picture" "$place/after/${picture##*/}") && continue
                echo "$grid $isa $ranks: ${picture##*/}: $said"
                different=$((different + 1))
            done
            rm -r "$place/before" "$place/after"
        done
    done
done
echo "$compared pictures, $different different"
[ $different -eq 0 ]
