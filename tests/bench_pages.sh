#!/bin/sh
# bench_pages.sh ROOT: the pages of docs/ are what the scripts draw from bench/results, their arithmetic is right on figures
# that are known, and what is wrong with a CSV file is said by its name, line and column.
set -eu
cd "$1"
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
failed=0

fail() {
    echo "$*"
    failed=1
}

# same PAGE SCRIPT CSV ...
same() {
    page=$1
    shift
    "$@" >"$folder/page"
    cmp "$folder/page" "$page" || fail "$page is not what $1 draws from bench/results: bench/run --page draws it anew"
}

# says TEXT SCRIPT [ARGUMENT ...]: no page, and an error that has the text.
says() {
    text=$1
    shift
    ! "$@" >"$folder/page" 2>"$folder/error" || fail "$*: no error"
    [ ! -s "$folder/page" ] || fail "$*: a page in spite of an error"
    grep -qF "$text" "$folder/error" || fail "$*: \"$(cat "$folder/error")\" does not say \"$text\""
}

# shows TEXT: the page that was drawn last has it.
shows() {
    grep -qF "$1" "$folder/page" || fail "the page has no \"$1\""
}

performance="bench/pages/performance.py measurements"
accuracy=bench/pages/accuracy.py
speeds=$(ls bench/results/*.csv | grep -v /accuracy-)
errors=$(ls bench/results/accuracy-*.csv)

same docs/performance.md bench/pages/performance.py performance $speeds
same docs/development/measurements.md $performance $speeds
same docs/accuracy.md $accuracy $errors

# A build of 10 ms beside 30 and 50 is 3 times as fast as the faster one: above the goal of 2. One of 20 ms is below it.
head=program,isa,threads,mesh,n,cells,measure,unit,count,median,min,max
row=bench_peers,avx2,2,tets,31,20000
cat >"$folder/held.csv" <<END
# A machine
$head
$row,build sah,ms,5,10,9,12
$row,embree cells medium,ms,5,50,50,50
$row,embree cells medium wide,ms,5,30,30,30
# load average 0.1 at the start and 0.2 at the end
END
sed 's/ms,5,10,9,12/ms,5,20,9,32/' "$folder/held.csv" >"$folder/missed.csv"
$performance --partial "$folder/held.csv" >"$folder/page"
shows '| SAH build, Mcells/s | Embree MEDIUM, the faster of binary and 8-wide | ≥ 2 | 3.00 (2.00 / 0.667) |'
shows '0 of 1 goals are missed'
shows '10.0 (9.00–12.0)'
! grep -q 'load average' "$folder/page" || fail 'a load is taken for a machine'
$performance --partial "$folder/missed.csv" "$folder/held.csv" >"$folder/page"
shows '| ≥ 2 | **1.50** (1.00 / 0.667) |' # of a measure in two files the first one counts
shows '1 of 1 goals are missed'
shows '| SAH build | tets 31 | Embree MEDIUM, the faster of binary and 8-wide | 1.50 | ≥ 2 |'

# If there are several files the newest counts; files without a date count as the oldest.
sed 's/^# A machine/&\n# measured 2020-02-01T10:00Z/' "$folder/held.csv" >"$folder/newer.csv"
sed 's/^# A machine/&\n# measured 2020-01-31T23:00Z/' "$folder/missed.csv" >"$folder/older.csv"
$performance --partial "$folder/older.csv" "$folder/newer.csv" >"$folder/page"
shows '| ≥ 2 | 3.00 (2.00 / 0.667) |'
shows 'A machine; '
$performance --partial "$folder/held.csv" "$folder/older.csv" >"$folder/page"
shows '| ≥ 2 | **1.50** (1.00 / 0.667) |'

# VTK's mapper is off by 0.1: the setting of 5 ms is too far off, and 40 / 10 is less than ten times. Of Neubauer's method N = 0
# has the errors of the robust roots; packets of N = 1 have another error than the picture as a whole.
head=program,isa,threads,mesh,cells,size,layer,method,setting,status,build,first,frame,frame_min,frame_max,runs,pixels,rms,max,wrong,residual
row=bench_accuracy,avx2,2,hexes:9,729,64,volume
surface=bench_accuracy,avx2,2,hexes:9,729,64,isosurface
cat >"$folder/accuracy.csv" <<END
$head
$row,samples,1,ok,1,7,5,5,5,5,9,0.02,0.2,0,nan
$row,samples,1/2,ok,1,12,10,9,11,5,9,0.01,0.1,0,nan
$row,samples,1/4,ok,1,22,20,19,21,5,9,0.001,0.01,0,nan
$row,VTK Z-sweep,-,ok,1,6,40,40,40,5,9,0.01,0.1,0,nan
$row,VTK ray cast,-,too slow,1,nan,nan,nan,nan,0,9,nan,nan,0,nan
$surface,Neubauer,N = 0,ok,1,4,3,3,3,5,9,1e-7,2e-7,0,nan
$surface,Neubauer,N = 1,ok,1,4,3,3,3,5,9,0.1,0.2,1,nan
$surface,robust,robust,ok,1,6,5,5,5,5,9,1e-7,2e-7,0,nan
$surface,Neubauer packets,N = 1,ok,1,9,8,8,8,5,9,0.1,0.4,1,nan
$surface,Neubauer SPMD,N = 1,ok,1,10,9,9,9,5,9,0.1,0.2,1,nan
END
$accuracy "$folder/accuracy.csv" >"$folder/page"
shows '| samples, step of 1/2 cell: 10.0 | samples, step of 1/4 cell: 20.0 | - | - | - |'
shows '| hexes:9 | Z-sweep | 0.010 | 0.100 | 40.0 | 6.00 | samples, step of 1/2 cell | 0.100 | 10.0 | 12.0 |'
shows '| mesh | Z-sweep | ray cast |'
shows '| hexes:9 | 4.0 / **0.5** | too slow |'
shows 'reached on 0 of 1 meshes'
shows '| hexes:9 | N = 1 | 0.100, 0.200 | 1 of 9 | - | 3.00 | 8.00 (0.400) | 9.00 |'
shows '| hexes:9 | robust | 1.0e-07, 2.0e-07 | 0 of 9 | - | 5.00 |  |  |'
! grep -q '| hexes:9 | N = 0 |' "$folder/page" || fail 'a setting that changes nothing is shown'

cut -d, -f1-11 "$folder/held.csv" >"$folder/narrow.csv"
sed 's/ms,5,50/ms,5,fast/' "$folder/held.csv" >"$folder/words.csv"
sed 's/,30,30$/,30/' "$folder/held.csv" >"$folder/torn.csv"
sed 2d "$folder/held.csv" >"$folder/headless.csv"
echo '# A machine' >"$folder/empty.csv"
says 'is there one in bench/results?' $accuracy
says 'are there any in bench/results?' $performance
says 'the first argument names the page' bench/pages/performance.py "$folder/held.csv"
says "$folder/none.csv: No such file" $performance "$folder/none.csv"
says "$folder/none.csv: No such file" $accuracy "$folder/none.csv"
says "no rows of render, light, steps, volumes, layers, flow, cells, blocks, order, tables, scaling in $folder/held.csv" $performance "$folder/held.csv"
says "$folder/narrow.csv, line 3: there is no column \"max\"" $performance --partial "$folder/narrow.csv"
says "$folder/words.csv, line 4: \"fast\" in column \"median\" is not a number" $performance --partial "$folder/words.csv"
says "$folder/torn.csv, line 5: 11 values under 12 columns" $performance --partial "$folder/torn.csv"
says "$folder/headless.csv, line 2: no line of column names" $performance --partial "$folder/headless.csv"
says "$folder/held.csv: there is no row of bench_accuracy" $accuracy "$folder/held.csv"
exit $failed
