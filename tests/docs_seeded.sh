#!/bin/sh
# docs_seeded.sh ROOT PYTHON FOLDER: docs/site/check_pages.py finds each kind of fault in a tree made for it, docs/site/check_site.py
# in a site, docs/site/header_page.py a declaration without a comment, and docs/site/check_claims.py a sentence that is not proved.
set -eu
root=$1 python=$2 folder=$3
rm -rf "$folder"
mkdir -p "$folder/tree/docs" "$folder/tree/examples" "$folder/site"
cd "$folder/tree"
failed=0

says() {
    "$python" "$root/docs/site/check_pages.py" "$folder/tree" >"$folder/out" 2>&1 && { echo "no fault: $1"; failed=1; }
    grep -qF "$1" "$folder/out" || { echo "not said: $1"; cat "$folder/out"; failed=1; }
}

echo '{ "name": "release" }' >CMakePresets.json
echo 'int one = 1;' >examples/one.c
echo 'echo --known' >run
good='# A `page` of *one*

A [link](other.md#two-words), code `[no](link)`.

```c
int one = 1;
```

    ./run --known     # --not an option
    cmake --preset release
'
printf '%s' "$good" >docs/page.md
printf '# Other\n\n## Two words\n\n- [back](page.md)\n' >docs/other.md
"$python" "$root/docs/site/check_pages.py" "$folder/tree" >"$folder/out" || { cat "$folder/out"; exit 1; }

seed() {
    printf '%s\n%s\n' "$good" "$1" >docs/page.md
    says "$2"
}
seed 'See [it](gone.md).' 'docs/page.md:12: gone.md: there is no docs/gone.md'
seed 'See [it](../../outside.md).' 'there is no ../outside.md'
seed 'See [it](other.md#three).' 'docs/other.md has no heading of that name'
seed 'See ![it](gone.png).' 'there is no docs/gone.png'
seed 'A paragraph
- and a list' 'docs/page.md:13: a list without an empty line before it'
seed '```c
int two = 2;
```' 'docs/page.md:12: a block of c that is no part of a file in examples/'
seed '    ./run --unknown' './run has no option --unknown'
seed '    ./walk' 'there is no ./walk'
seed '    cmake --preset fast' 'there is no preset fast'
seed '    cmake --build b --target gone' 'there is no target gone'
printf '%s' "$good" >docs/page.md
echo 'if' >examples/bad.sh
says 'bad.sh'
rm examples/bad.sh

cd "$folder/site"
site() {
    printf '<h1 id="top">A</h1>%s' "$1" >index.html
    "$python" "$root/docs/site/check_site.py" . >"$folder/out" && { echo "no fault: $2"; failed=1; }
    grep -qF "$2" "$folder/out" || { echo "not said: $2"; cat "$folder/out"; failed=1; }
}
echo '<a href="#top" id="top"></a>' >index.html
"$python" "$root/docs/site/check_site.py" . >"$folder/out" || { cat "$folder/out"; exit 1; }
site '<a href="gone.html"></a>' 'gone.html leads to nothing'
site '<a href="#below"></a>' '#below: no such heading'
site '<script src="https://example.org/a.js"></script>' 'fetches https://example.org/a.js'

printf '/* A header. */\n/* A call. */\nINSITU_API int good(void);\n\nINSITU_API int bad(void);\n' >"$folder/bad.h"
"$python" "$root/docs/site/header_page.py" "$folder/bad.h" >"$folder/out" 2>&1 && { echo 'no fault: bad.h'; failed=1; }
grep -qF 'bad() has no comment right before it' "$folder/out" || { echo 'not said of bad.h'; cat "$folder/out"; failed=1; }

mkdir -p docs/development tests build
printf 'It is\nso, and\nthus | said.\n' >page.md
printf 'cmocka_unit_test(it_is_so)\n' >tests/test_one.c
printf 'add_test([=[one_np2]=] "mpiexec" "bin/test_one")\nset_tests_properties([=[one_np2]=] PROPERTIES  X "(y)")\n' >build/CTestTestfile.cmake
claims() {
    printf '| document | sentence | test | case |\n|---|---|---|---|\n%s\n' "$1" >docs/development/claims.md
    "$python" "$root/docs/site/check_claims.py" . build >"$folder/out"
}
claims '| page.md | It is so, and thus \| said. | one | it_is_so |' || { cat "$folder/out"; failed=1; }
claim() {
    claims "$1" && { echo "no fault: $2"; failed=1; }
    grep -qF "$2" "$folder/out" || { echo "not said: $2"; cat "$folder/out"; failed=1; }
}
claim '| page.md | It is not so | one | it_is_so |' 'page.md does not say: It is not so'
claim '| gone.md | It is | one | it_is_so |' 'there is no gone.md'
claim '| page.md | It is so | two | it_is_so |' 'no test is registered as two'
claim '| page.md | It is so | one | it_is |' 'the test one has no case it_is'
claim '' 'it has no table'
exit $failed
