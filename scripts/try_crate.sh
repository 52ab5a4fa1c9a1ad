#!/bin/sh
# usage: try_crate.sh BUILD [DIST]    package the crates, put them into DIST if there is one, and build and run programs with what is in the packages, in BUILD/crate
#
# tests/dependent depends on switchback and switchback-mpcc; a program in C is linked with the library that switchback-capi makes.
# Without a network: what the packages depend on was fetched when the library was built.
set -eu
place=$(realpath "$1")/crate
packages=$place/package/package
version=$(sed -n 's/^version *= *"\(.*\)"/\1/p' Cargo.toml | head -n 1)
rm -rf "$place/unpacked" "$place/dependent" "$packages"
mkdir -p "$place/unpacked"
cargo package --quiet --workspace --offline --no-verify --allow-dirty --target-dir "$place/package"
for name in switchback switchback-mpcc switchback-capi switchback-mpcc-ampl; do
    # as new: what is in a package has one date, and cargo builds by dates
    tar -xzmf "$packages/$name-$version.crate" -C "$place/unpacked"
    mv "$place/unpacked/$name-$version" "$place/unpacked/$name"
    size=$(wc -c < "$packages/$name-$version.crate")
    # crates.io takes 10 MB; tests, bindings or their data in a package would be seen here
    [ "$size" -lt 3000000 ] || { echo "the package $name has $size bytes"; exit 1; }
    for stray in tests bindings capi_tests benches fuzz scripts crates; do
        [ ! -e "$place/unpacked/$name/$stray" ] || { echo "$stray is in the package $name"; exit 1; }
    done
    echo "$name-$version.crate: $size bytes"
done
cp -r tests/dependent "$place/dependent"
cp Cargo.lock "$place/dependent/"
# Nobody debugs it.
export CARGO_PROFILE_DEV_DEBUG=0 CARGO_TARGET_DIR="$place/target"
cargo run --quiet --offline --manifest-path "$place/dependent/Cargo.toml"
# Programs get neither C symbols nor an allocator.
if nm "$place/target/debug/dependent" | grep -E ' T swb_|switchback_mpcc6memory9allocator'; then
    echo "a program that depends on the crate has symbols of the C interface, or its allocator"
    exit 1
fi
# The C interface is built with the same settings, of the packages alone.
cp Cargo.lock "$place/unpacked/switchback-capi/"
printf '\n[workspace]\n' >> "$place/unpacked/switchback-capi/Cargo.toml"
cargo build --quiet --offline --manifest-path "$place/unpacked/switchback-capi/Cargo.toml" --config profile.dev.opt-level=0 \
    --config "patch.crates-io.switchback.path='$place/unpacked/switchback'" \
    --config "patch.crates-io.switchback-mpcc.path='$place/unpacked/switchback-mpcc'"
# The solver for AMPL is, too: it solves a small problem.
cp Cargo.lock "$place/unpacked/switchback-mpcc-ampl/"
printf '\n[workspace]\n' >> "$place/unpacked/switchback-mpcc-ampl/Cargo.toml"
cargo build --quiet --offline --manifest-path "$place/unpacked/switchback-mpcc-ampl/Cargo.toml" --config profile.dev.opt-level=0 \
    --config "patch.crates-io.switchback.path='$place/unpacked/switchback'" \
    --config "patch.crates-io.switchback-mpcc.path='$place/unpacked/switchback-mpcc'"
"$place/target/debug/switchback-mpcc-ampl" crates/switchback-mpcc-ampl/tests/data/jr1 | grep "optimal solution (S-stationary, B-stationary)"
# It is loaded by its soname.
ln -sf libswitchback.so "$place/target/debug/libswitchback.so.${version%.*}"
cc -Wall -Werror -I"$place/unpacked/switchback-capi/include" examples/c/friction.c -o "$place/friction" \
    -L"$place/target/debug" -lswitchback -Wl,-rpath,"$place/target/debug" -lm
"$place/friction" "$place"
[ -z "${2:-}" ] || for name in switchback switchback-mpcc switchback-capi switchback-mpcc-ampl; do cp "$packages/$name-$version.crate" "$2/"; done
