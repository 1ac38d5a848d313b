#!/bin/sh
# house_library.sh LIBRARY: a shared library shows insitu_* and nothing else, and drags no C++, VTK or image library in.
set -eu
library=$1
symbols=$(nm -D --defined-only "$library" | awk '{ print $NF }')
needed=$(readelf -d "$library" | sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p')
status=0

foreign=$(printf '%s\n' "$symbols" | grep -v -e '^insitu_' -e '^__odr_asan' || true)
if [ -z "$symbols" ]; then
    echo "$library: shows nothing at all"
    status=1
elif [ -n "$foreign" ]; then
    printf '%s: shows what is not insitu_*:\n%s\n' "$library" "$foreign"
    status=1
fi
heavy=$(printf '%s\n' "$needed" | grep -E '^lib(stdc\+\+|c\+\+|vtk|OpenImageIO|mpi_cxx)' || true)
if [ -n "$heavy" ]; then
    printf '%s: needs\n%s\n' "$library" "$heavy"
    status=1
fi
exit $status
