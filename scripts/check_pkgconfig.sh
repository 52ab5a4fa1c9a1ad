#!/bin/sh
# usage: check_pkgconfig.sh PREFIX LIBDIR WORK    compile and run a test through the pkg-config file
set -eu
prefix=$1
lib=$prefix/$2
work=$3
here=$(cd "$(dirname "$0")/.." && pwd)
command -v pkg-config > /dev/null || {
    echo "left out: the pkg-config file: pkg-config not found"
    exit 0
}
export PKG_CONFIG_PATH="$lib/pkgconfig"
mkdir -p "$work"
query() { pkg-config "$@" switchback; }

version=$(sed -n 's/^version *= *"\(.*\)"/\1/p' "$here/Cargo.toml" | head -n 1)
[ "$(query --modversion)" = "$version" ] || {
    echo "switchback.pc has version $(query --modversion), not $version" >&2
    exit 1
}
# shellcheck disable=SC2046
cc $(query --cflags) "$here/capi_tests/test_version.c" -o "$work/shared" $(query --libs) "-Wl,-rpath,$lib" -lm
"$work/shared"
# The static library by its path, with the private libraries.
# shellcheck disable=SC2046
cc $(query --cflags) "$here/capi_tests/test_version.c" -o "$work/static" \
    $(query --static --libs | sed "s|-lswitchback|$lib/libswitchback.a|")
"$work/static"
if readelf -d "$work/static" | grep -q libswitchback; then
    echo "the static program needs the shared library" >&2
    exit 1
fi
echo "pkg-config: shared and static"
