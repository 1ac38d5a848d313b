#!/bin/sh
# house_kernels.sh OBJECT...: each kernel object shows one symbol, its table. A second one could be merged by the linker
# with its namesake of another instruction set, and run where the processor lacks it. What the address sanitizer adds does not
# count. 77: there are no objects.
set -eu
if [ $# -eq 0 ]; then exit 77; fi
status=0
for object in "$@"; do
    symbols=$(nm --defined-only --extern-only "$object" | awk 'NF == 3 && $3 !~ /^__odr_asan/ { print $3 }')
    if [ "$(printf '%s\n' "$symbols" | grep -c .)" -ne 1 ]; then
        printf '%s: not one symbol but\n%s\n' "$object" "$symbols"
        status=1
    fi
done
exit $status
