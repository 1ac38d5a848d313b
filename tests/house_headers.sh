#!/bin/sh
# house_headers.sh ROOT CC [FLAG...]: every header of the core compiles alone, on plain vectors: it includes what it uses.
# A header that a source includes before anything else has been compiled alone by the build.
set -eu
cd "$1"
cc=$2
shift 2
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
folders=$(find libinsitu mmbvh render compositing -type d | sed 's/^/-I/')
built=$(find libinsitu mmbvh render compositing -name '*.c' -exec awk 'FNR == 1 { found = 0 }
    /^#/ && !found { found = 1; if (/^#include "/) { split($0, word, "\""); print word[2] } }' {} +)
newline='
'
failures=0 headers=0
for header in $(find libinsitu/base libinsitu/session mmbvh render compositing -name '*.h' | LC_ALL=C sort); do
    headers=$((headers + 1))
    case "$newline$built$newline" in *"$newline${header##*/}$newline"*) continue ;; esac
    printf '#include "%s"\n' "${header##*/}" >"$place/alone.c"
    # shellcheck disable=SC2086 # a list
    if ! "$cc" -std=gnu11 -fsyntax-only -DSIMD_PLAIN -Wall -Wextra -Werror -Wno-psabi -Wno-unused-function $folders "$@" "$place/alone.c" \
        >"$place/said" 2>&1; then
        echo "$header does not compile alone:"
        head -n 5 "$place/said"
        failures=$((failures + 1))
    fi
done
[ $headers -gt 0 ] || { echo 'no header was found: the test looks in the wrong place'; exit 1; }
exit $((failures > 0))
