#!/bin/sh
# house_hard_cases.sh ROOT: every test that docs/development/hard-cases.md names, in backquotes in a table's last column, is one that
# tests/ registers.
set -eu
status=0
names=$(awk -F'|' '/^\|/ { print $(NF - 1) }' "$1/docs/development/hard-cases.md" | grep -o '`[a-z0-9_]*`' | tr -d '`' | sort -u)
if [ "$(printf '%s\n' "$names" | grep -c .)" -lt 20 ]; then
    echo "docs/development/hard-cases.md: no table of tests"
    exit 1
fi
for name in $names; do
    if ! grep -rqE "cmocka_unit_test[a-z_]*\($name[,)]" "$1/tests"; then
        echo "docs/development/hard-cases.md names $name, which no test program registers"
        status=1
    fi
done
exit $status
