#!/bin/sh
# test_command.sh ROOT FOLDER: ./test in a tree of its own, in which dpkg-query, apt-get, cmake, ctest and what ./test
# runs instead of it write down how they were called: what each option does, and with which status it ends.
set -eu
root=$1
folder=$2
rm -rf "$folder"
mkdir -p "$folder/tree/cmake" "$folder/tree/tests" "$folder/bin" "$folder/away"
cp "$root/test" "$folder/tree/"
cp "$root/cmake/setup.sh" "$folder/tree/cmake/"
touch "$folder/tree/CMakePresets.json"
ctest=$(command -v ctest)
called=$folder/called
failures=0

# stub FILE COMMANDS: writes down how it was called, then does the commands.
stub() {
    printf '#!/bin/sh\necho "${0##*/} $*" >>"%s"\n%s\n' "$called" "$2" >"$1"
    chmod +x "$1"
}
stub "$folder/bin/dpkg-query" 'for package; do :; done; [ "$package" = "${MISSING-}" ] || echo installed'
stub "$folder/bin/apt-get" 'exit "${APT_STATUS-0}"'
stub "$folder/bin/sudo" '"$@"'
stub "$folder/bin/cmake" '[ "$1" != --preset ] || { mkdir -p "build/$2" && touch "build/$2/build.ninja"; }
    [ "$1" = "${CMAKE_FAILS-}" ] && exit 3 || exit 0'
stub "$folder/bin/ctest" '[ "$1" != --help ] || exec "'"$ctest"'" --help
    echo "asan: ${ASAN_OPTIONS-}" >>"'"$called"'"
    exit "${CTEST_STATUS-0}"'
stub "$folder/tree/tests/lint.sh" 'exit 4'
stub "$folder/tree/tests/valgrind.sh" 'exit 5'
PATH=$folder/bin:$PATH
export PATH
cd "$folder/away"

# run STATUS ARGUMENT...: ./test, called from elsewhere, ends with the status; any stands for all but 0.
run() {
    expected=$1
    shift
    what="./test $*"
    : >"$called"
    status=0
    ../tree/test "$@" >"$folder/said" 2>&1 </dev/null || status=$?
    [ "$status" = "$expected" ] || { [ "$expected" = any ] && [ "$status" != 0 ]; } || fail "status $status, expected $expected"
}

fail() {
    echo "$what: $*"
    cat "$called" "$folder/said"
    failures=$((failures + 1))
}

# calls PATTERN: a line of what was called matches. calls_no WORD: none begins so. says PATTERN.
calls() { grep -qE -- "$1" "$called" || fail "did not call: $1"; }
calls_no() { ! grep -qE -- "^$1 " "$called" || fail "called $1"; }
says() { grep -qE -- "$1" "$folder/said" || fail "did not say: $1"; }

for option in --help -h; do
    run 0 $option
    for word in --long --examples --asan --clang --valgrind --lint --help INSITU_TEST_DATA; do says "$word"; done
    calls_no '[a-z]+'
done

run 0
calls '^cmake --preset release$'
calls '^cmake --build build/release -j [0-9]+$'
calls '^ctest --test-dir build/release --build-config Usual --output-on-failure --no-tests=error -j [0-9]+$'
calls_no apt-get
run 0 # configured once
! grep -q -- '--preset' "$called" || fail 'configured again'
run 0 -R session --repeat until-fail:2 -j1
calls '^ctest --test-dir build/release .* -R session --repeat until-fail:2 -j1$'
run 0 --long -R invariance
calls '^ctest --test-dir build/release --build-config Long .* --label-regex \^long\$ -R invariance$'
run 0 --examples
calls '^ctest --test-dir build/release --build-config Examples .* --label-regex \^examples\$$'
run 0 --asan -N
calls '^ctest --test-dir build/asan --build-config Usual .* -N$'
calls '^asan: fast_unwind_on_malloc=0'
run 0 --clang
calls '^ctest --test-dir build/clang '
run 4 --lint render
calls '^lint.sh render$'
calls_no cmake
run 5 --valgrind
calls '^cmake --preset debug$'
calls '^valgrind.sh build/debug/bin/insitu-wave$'
calls_no ctest

# Failures.
CTEST_STATUS=8 run 8
for option in --asn --longer --long=1 -Z; do
    run any $option
    says "test: $option: unknown option; see ./test --help"
    calls_no cmake
done
run any -R session --clnag
says 'clnag: unknown option'
for step in --preset --build; do
    rm -rf "$folder/tree/build"
    CMAKE_FAILS=$step run any
    says 'build/release'
    ! grep -q '^ctest --test-dir' "$called" || fail 'tests ran after a failed build'
done
MISSING=ninja-build run 0
calls '^apt-get .*install .* ninja-build$'
MISSING=ninja-build APT_STATUS=100 run any
says 'apt-get could not install ninja-build'
calls_no cmake

[ $failures -eq 0 ] || exit 1
