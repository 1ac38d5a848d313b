#!/bin/sh
# bench_accuracy.sh PROGRAM BENCH: tiny pictures at every setting, without peers. What the errors of settings must be:
# robust roots are on the right sheet everywhere, to 1e-4 of a cell (a depth is off by 3e-8 of the scene and its cells' vertices by as
# much, a ray may meet the surface at a hundred times the length of a step across it, and a cell is a fifth of the scene);
# max_error is kept; segments of linear cells are float32's rounding of a few cells; samples of 1/16 cell are nearer than
# those of 4 cells. And the page is drawn of it: each mesh, each setting.
set -eu
csv=$(mktemp)
page=$(mktemp)
trap 'rm -f "$csv" "$page"' EXIT
"$1" --smoke --no-peers tets:4 hexes:4 polyhedra:3 mixed:2 >"$csv"
LC_ALL=C awk -F, '
    function bad(why) { print $4 ", " $8 " " $9 ": " why ": rms " $18 ", max " $19 ", wrong " $20; failed = 1 }
    $1 != "bench_accuracy" { next }
    { rows[$4]++ }
    $10 != "ok" || $13 <= 0 || $17 < 8 { bad("not drawn") }
    $18 == "nan" || $19 == "nan" || $18 > $19 { bad("no errors") }
    $8 ~ /^robust/ && ($20 != 0 || $19 > 1e-4) { bad("a crossing is missed or off") }
    $8 == "max_error" && $19 > $9 + 0 { bad("max_error is not kept") }
    $8 == "segments" && ($4 ~ /tets|polyhedra/) && $19 > 3e-6 { bad("not exact") }
    $8 == "samples" && $9 == "4" { coarse[$4] = $18 }
    $8 == "samples" && $9 == "1/16" && $18 > coarse[$4] / 8 { bad("not near " coarse[$4] " / 8") }
    END {
        for (mesh in rows) meshes++
        if (meshes != 4) { print meshes + 0 " meshes of 4"; failed = 1 }
        exit failed
    }' "$csv"
"$2/pages/accuracy.py" "$csv" >"$page"
time='[0-9.]*'
for text in '| tets:4 | 384 |' '| mixed:2 | robust |' "| tets:4 | robust | .* | $time |  |  |" \
    '| segments |' '| max_error: 1e-4 |' '| samples, step of 1/16 cell |'; do
    grep -q "^$text" "$page" || { echo "the page has no \"$text\"" && exit 1; }
done
