#!/bin/sh
# compilers_seeded.sh FOLDER: compilers_read.py finds a fault that gcc on x86 does not, and prints the compiler's message.
set -eu
tests=$(cd "$(dirname "$0")" && pwd)
root=$(dirname "$tests")
folder=$1
rm -rf "$folder"
mkdir -p "$folder"

# seed FILE TEXT FLAGS WHO MESSAGE: the message is found, or no fault if it is none.
seed() {
    printf '%s\n' "$2" >"$folder/fault.c"
    printf '[{"directory": "%s", "command": "cc -I%s %s -o fault.o -c %s", "file": "%s"}]\n' \
        "$folder" "$folder" "$3" "$1" "$1" >"$folder/compile_commands.json"
    status=0
    python3 "$tests/compilers_read.py" "$4" "$folder" >"$folder/answer" 2>&1 || status=$?
    [ "$status" != 77 ] || exit 77
    if [ "$5" = none ]; then
        [ "$status" = 0 ] || { cat "$folder/answer" >&2; exit 1; }
    elif [ "$status" != 1 ] || ! grep -q "$5" "$folder/answer"; then
        echo "$4 did not find: $5 (status $status)" >&2
        cat "$folder/answer" >&2
        exit 1
    fi
}

seed "$folder/fault.c" 'struct { int a, b; struct { int c, d; } e; } s = {.e = {1}};' -Wextra clang 'missing-field-initializers'
# A source that was read is read again when a header of it has changed, and as long as it has a fault.
: >"$folder/late.h"
for message in none missing-field-initializers missing-field-initializers; do
    seed "$folder/fault.c" '#include "late.h"' -Wextra clang $message
    echo 'struct { int a, b; struct { int c, d; } e; } s = {.e = {1}};' >"$folder/late.h"
done
# A source of the library, read with a definition that breaks it on aarch64 alone.
printf '#ifndef __x86_64__\n#error "for x86 alone"\n#endif\n' >"$folder/only_x86.h"
seed "$root/libinsitu/base/cpu.c" '' "-I$root/libinsitu/base -I$root/libinsitu/include -include $folder/only_x86.h" aarch64 'for x86 alone'
