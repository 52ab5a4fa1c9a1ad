#!/bin/sh
# usage: check.sh LIBRARY HEADER SONAME    compare exports with symbols.txt, the header and the SONAME
#        check.sh --update LIBRARY         write symbols.txt
# Symbols are only ever added; one that goes away needs a new ABI number.
set -eu
here=$(dirname "$0")
# Functions of the standard FMI are not ours: they have their names and their numbers from it.
exports() { nm -D --defined-only "$1" | awk '$2 ~ /[A-Z]/ { print $3 }' | sed 's/@.*//' | grep -v '^fmi[23][A-Z]' | LC_ALL=C sort; }

if [ "$1" = --update ]; then
    exports "$2" > "$here/symbols.txt"
    exit
fi

tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT
exports "$1" > "$tmp/library"
# Declarations: the name in front of the first parenthesis behind SWB_API.
grep -v '^#' "$2" | tr '\n' ' ' | grep -o 'SWB_API[^;(]*(' | sed 's/.*[ *]\(swb_[a-z0-9_]*\)(/\1/' | LC_ALL=C sort > "$tmp/header"

status=0
compare() {
    if ! diff -u "$1" "$2" > "$tmp/diff"; then
        echo "$3" >&2
        cat "$tmp/diff" >&2
        status=1
    fi
}
compare "$here/symbols.txt" "$tmp/library" "exported symbols are not those of symbols.txt:"
compare "$tmp/header" "$tmp/library" "exported symbols are not those of the header:"
soname=$(readelf -d "$1" | sed -n 's/.*SONAME.*\[\(.*\)\].*/\1/p')
if [ "$soname" != "$3" ]; then
    echo "SONAME is '$soname', not '$3'" >&2
    status=1
fi
exit $status
