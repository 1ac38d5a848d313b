#!/bin/sh
# house_regions.sh ROOT: every parallel region of the core begins with region_enter() (libinsitu/base/region.h), so that its
# workers have the library's floating-point environment and a core of their own.
set -eu
cd "$1"
files=$(grep -rl --include='*.c' --include='*.h' '^ *#pragma omp parallel' libinsitu mmbvh render compositing | LC_ALL=C sort)
# shellcheck disable=SC2086 # names without spaces
found=$(awk '
    FNR == 1 { open = 0 }
    /^ *#pragma omp parallel/ { open = 1; place = FILENAME ":" FNR; regions++ }
    open && /\\$/ { next }
    open && (/omp parallel for/ || (/;/ && !/region_enter\(\);/)) { print place ": a region without region_enter()"; open = 0 }
    /region_enter\(\);/ { open = 0 }
    END { if (!regions) print "no region was read: the test looks in the wrong place" }
' $files)
[ -z "$found" ] || { echo "$found"; exit 1; }
