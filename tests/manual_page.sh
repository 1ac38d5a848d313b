#!/bin/sh
# manual_page.sh INSITU_RENDER PAGE: every option of --help is in the page, every one of the page is in --help, and groff,
# where it is to be had, has nothing to say.
set -eu
options=$("$1" --help | grep -o '^  --[a-z]*' | tr -d ' ' | sort -u)
documented=$(sed -n 's/^\.BI* \\-\\-\([a-z]*\).*/--\1/p' "$2" | sort -u)
if [ "$options" != "$documented" ]; then
    echo "--help has: $options"
    echo "the page has: $documented"
    exit 1
fi
if command -v groff >/dev/null; then
    said=$(groff -man -ww -z "$2" 2>&1)
    [ -z "$said" ] || { echo "$said"; exit 1; }
fi
