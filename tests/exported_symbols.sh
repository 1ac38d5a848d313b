#!/bin/sh
# exported_symbols.sh LIBRARY SONAME HEADER...: the library exports what the headers declare by INSITU_API, no less and no
# more, and has the soname; an archive, whose soname is "-", has no other global symbols. Instances of C++'s templates,
# which are weak, do not count.
set -eu
library=$1 soname=$2
shift 2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cat "$@" | tr '\n' ' ' | grep -o 'INSITU_API [^;{]*[;{]' | sed 's/(.*//; s/[;{].*//; s/.*[ *]//' | grep '^insitu_' |
    sort -u >"$work/declared"
[ "$soname" = - ] && table=-g || table=-D
nm $table --defined-only "$library" | awk 'NF == 3 && $2 != "W" && $2 != "V" && $2 != "u" { print $3 }' | sort -u >"$work/exported"
if ! diff "$work/declared" "$work/exported" >"$work/differences"; then
    echo "declared (<) and exported (>) by $library:"
    cat "$work/differences"
    exit 1
fi
[ "$(wc -l <"$work/exported")" -gt 0 ]
[ "$soname" = - ] || readelf -d "$library" | grep -q "SONAME.*\\[$soname\\]" || {
    echo "$library has another soname than $soname"
    exit 1
}
