#!/bin/sh
# lint.sh [FILE ...]: clang-tidy (.clang-tidy says which checks, and why some are off) and cppcheck on the library, the
# adaptors, the tools and the mini-app, or on the named files alone. The kernels are looked at as AVX2 has them.
set -u
cd "$(dirname "$0")/.."

mkdir -p build
cmake --preset release -B build/lint -DCMAKE_EXPORT_COMPILE_COMMANDS=ON >build/lint.log 2>&1 || {
    cat build/lint.log >&2
    exit 1
}

# The kernels' one source is compiled once per instruction set: the others' entries go, or each would be checked.
python3 - <<'END'
import json
path = "build/lint/compile_commands.json"
entries = json.load(open(path))
others = ("kernel_table_plain", "kernel_table_sse42", "kernel_table_avx512")
entries = [e for e in entries if not any(o in e["command"] for o in others)]
# gcc compiles C++17 unasked; clang-tidy must be told, and does not know all options of gcc.
for e in entries:
    for option in (" -fpeel-loops", " -Wno-maybe-uninitialized"):
        e["command"] = e["command"].replace(option, "")
    if e["file"].endswith(".cpp") and "-std=" not in e["command"]:
        e["command"] = e["command"].replace(" -o ", " -std=gnu++17 -o ", 1)
json.dump(entries, open(path, "w"), indent=1)
END

files=${*:-$(git ls-files 'libinsitu/*.c' 'mmbvh/*.c' 'render/*.c' 'compositing/*.c' 'adaptors/*.c' 'adaptors/*.cpp' \
    'mini-app/*.c' 'tools/*.c' 'tools/*.cpp' 'examples/*.c')}
status=0
# shellcheck disable=SC2086
for file in $files; do
    grep -q "\"file\": \".*/$file\"" build/lint/compile_commands.json && echo "$file"
done | xargs -P "$(nproc)" -n 1 clang-tidy -p build/lint --quiet 2>/dev/null || status=1

# unusedStructMember and the like are style; what is asked for is what may be wrong. --inline-suppr: a line that is right
# says so where it stands.
# shellcheck disable=SC2046,SC2086
cppcheck --quiet --inline-suppr --error-exitcode=1 --enable=warning,performance,portability --std=c11 -j "$(nproc)" \
    --suppressions-list=tests/cppcheck.supp $(find libinsitu mmbvh render compositing -type d | sed 's/^/-I/') \
    $(printf '%s\n' $files | grep '\.c$' | grep -v -e render_kernels.c -e comp_sheet_table.c) || status=1

[ $status = 0 ] && echo 'clang-tidy and cppcheck have nothing to say.'
exit $status
