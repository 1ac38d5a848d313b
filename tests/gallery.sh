#!/bin/sh
# gallery.sh INSITU_RENDER GALLERY FOLDER: draws each scene of docs/gallery from its grid, in a quarter of its pixels by a
# few rays a pixel; each is to make its picture.
set -eu
render=$1 gallery=$2 folder=$3 data=${INSITU_TEST_DATA:-}
[ -d "$data" ] || { echo "skipped: INSITU_TEST_DATA names no folder of grids"; exit 77; }
rm -rf "$folder"
mkdir -p "$folder"
cd "$folder"
for scene in "$gallery"/*.yaml; do
    name=$(basename "$scene" .yaml)
    grid=$(sed -n '1s/^# Grid: \([a-z_0-9]*\.vtu\)\..*/\1/p' "$scene")
    [ -n "$grid" ] || { echo "$scene names no grid in its first line"; exit 1; }
    sed "s/^    antialias: 4$/    antialias: 2/; s/samples: 16/samples: 2/; s/^    size: .*/    size: [320, 200]/" "$scene" >quick.yaml
    "$render" quick.yaml "$data/$grid" >said 2>&1 || { cat said; exit 1; }
    ! grep -i warning said || exit 1
    [ -s "$name.png" ] || { echo "$scene made no $name.png"; exit 1; }
    [ -s "$gallery/$name.png" ] || { echo "the gallery has no $name.png"; exit 1; }
    grep -q "($name.png)" "$gallery/README.md" || { echo "the gallery's page does not show $name.png"; exit 1; }
done
