#!/bin/sh
# exported_symbols.sh LIBRARY SONAME HEADER...: what the library exports is what the headers declare by INSITU_API, no less and
# no more; and its soname. Instances of C++'s templates, which are weak, are nobody's.
set -eu
library=$1 soname=$2
shift 2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cat "$@" | tr '\n' ' ' | grep -o 'INSITU_API [^;{]*[;{]' | sed 's/(.*//; s/[;{].*//; s/.*[ *]//' | grep '^insitu_' |
    sort -u >"$work/declared"
nm -D --defined-only "$library" | awk '$2 != "W" && $2 != "V" && $2 != "u" { print $3 }' | sort -u >"$work/exported"
if ! diff "$work/declared" "$work/exported" >"$work/differences"; then
    echo "declared (<) and exported (>) by $library:"
    cat "$work/differences"
    exit 1
fi
[ "$(wc -l <"$work/exported")" -gt 0 ]
readelf -d "$library" | grep -q "SONAME.*\\[$soname\\]" || {
    echo "$library has another soname than $soname"
    exit 1
}
