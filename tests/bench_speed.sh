#!/bin/sh
# bench_speed.sh BIN BENCH: the programs of bench/run on tiny pictures of a tiny mesh, without a screen. No time is looked
# at, but what the comparisons stand on: all see the same surface, whole steps draw it at every kind of change, errors are
# float32's rounding, and the page has its rows.
#
# Depths of two float32 ray tracers differ by what t (up to 6, 2.4e-7 apart) and the vertices are rounded by, times up to 30
# where 99 % of the rays are concerned that meet the surface at any angle: 1e-5.
set -eu
unset DISPLAY
export OMP_WAIT_POLICY=passive # other tests run beside this one
export ASAN_OPTIONS="${ASAN_OPTIONS:+$ASAN_OPTIONS:}detect_leaks=0" # TBB, VTK and Embree hold theirs to the end
csv=$(mktemp)
page=$(mktemp)
trap 'rm -f "$csv" "$page"' EXIT
small='--runs 1 --shrink 8'
"$1/bench_render" $small tets:4 hexes:4 >"$csv"
"$1/bench_peers" $small tets:4 >>"$csv" 2>/dev/null
"$1/bench_light" $small tets:4 >>"$csv" 2>/dev/null
"$1/bench_steps" $small tets:4 >>"$csv" 2>/dev/null
"$1/bench_volumes" $small hexes:4 >>"$csv" # hexes: VTK's mappers take none
"$1/bench_layers" flow $small hexes:4 >>"$csv" 2>/dev/null
"$1/bench_blocks" $small hexes:32 >>"$csv"
env -u INSITU_TEST_DATA "$1/bench_order" $small hexes:2 tets:2 >>"$csv" 2>/dev/null # the real mesh takes long
for table in sizes groups; do "$1/bench_tables" $table $small tets:4 >>"$csv"; done
for table in types layouts thousand; do "$1/bench_cells" $table $small hexes:4 >>"$csv"; done
LC_ALL=C awk -F, '
    function bad(why) { print $1 ", " $4 " " $5 ", " $7 ": " why ": " $10 ", at most " $12; failed = 1 }
    $1 !~ /^bench_/ { next }
    { rows[$1 ", " $7]++ }
    $10 == "nan" || $10 == "-nan" { bad("no number") }
    $8 ~ /ms$/ && $7 ~ /new values$|moved vertices$|new mesh$|trace$/ && $10 <= 0 { bad("not timed") }
    $7 ~ /embree coverage difference/ && $10 > 1e-3 { bad("other pixels than Embree") }
    $7 ~ /embree depth difference/ && $12 > 1e-5 { bad("another depth than Embree") }
    $7 ~ /disagreements/ && $10 > 0 { bad("hits where the reference has none, or none where it has") }
    $7 ~ /depth error/ && $12 > 1e-5 { bad("another depth than the reference") }
    $7 == "volume error" && $12 > 1e-5 { bad("not the samples of the reference") }
    $7 == "volume segments integral error" && $4 == "tets" && $12 > 1e-5 { bad("not the integral") }
    $7 == "volume max_error 1e-2 integral error" && $12 > 1e-2 { bad("more than the error that is allowed") }
    $1 == "bench_order" && $7 ~ /step$/ && $10 <= 0 { bad("not timed") }
    $1 == "bench_order" && $7 ~ /^[1-4] pieces error$/ { piece_error = $10 }
    $1 == "bench_order" && $7 ~ /vtk error$/ && ($10 > piece_error * 1.001 || $10 < piece_error / 4) { bad("not the error of the pieces") }
    $1 == "bench_order" && $4 ~ /hexes/ && $7 == "volume made" && $10 != 64 * $6 { bad("not all pieces of hexes") }
    $1 == "bench_order" && $4 ~ /hexes/ && $7 == "surface made" && !($10 > 0 && $10 < 64 * $6) { bad("not only pieces on outer faces") }
    $1 == "bench_order" && $7 ~ /^1 pieces (vtk )?made$/ && $10 != 8 * $6 { bad("not a division of each tet by 8") }
    $7 ~ /^volume group .* integral error/ {
        if (group == "") group = $10
        if ($10 != group) bad("groups change the picture")
    }
    END {
        count = split("bench_peers, build sah:bench_light, sky trace rate:bench_steps, isosurface new values:bench_steps, isosurfaces moved vertices:" \
            "bench_steps, isosurface new mesh:bench_volumes, volume new values:bench_layers flow, montage new values:bench_tables sizes, process peak:" \
            "bench_cells types, volume everywhere:bench_cells layouts, isosurface int64 ratio:" \
            "bench_cells thousand, volume cost:bench_blocks, blocks new values:bench_order, volume split new values:bench_order, 4 pieces step:" \
            "bench_tables groups, volume group 32", wanted, ":")
        for (i = 1; i <= count; i++)
            if (!(wanted[i] in rows)) { print "no row: " wanted[i]; failed = 1 }
        exit failed
    }' "$csv"
"$2/pages/performance.py" measurements --partial "$csv" >"$page"
for text in '| Tree with one field, B/cell | 16 B/cell | ≤ 1, aim 0.5 | 0' '### Table 5.2' '### Table 4.2' '| hexes 4 | volume everywhere | ' '| tets 4, isosurfaces new mesh |' '| 32³ cells | blocks | ' '| 2³ bent hexes of 27 nodes | volume | ' '| 48 tets of 10 nodes | 4 | '; do
    grep -qF "$text" "$page" || { echo "the page has no \"$text\"" && exit 1; }
done
