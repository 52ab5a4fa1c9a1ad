#!/bin/sh
# usage: try_crate.sh BUILD    package the crate, and build and run tests/dependent with what is in the package, in BUILD/crate
#
# Without a network: what the package depends on was fetched when the library was built.
set -eu
place=$1/crate
rm -rf "$place/switchback" "$place/dependent"
mkdir -p "$place"
cargo package --quiet --offline --no-verify --allow-dirty --target-dir "$place/package"
name=$(sed -n 's/^version = "\(.*\)"/switchback-\1/p' Cargo.toml | head -1)
tar -xzf "$place/package/package/$name.crate" -C "$place"
mv "$place/$name" "$place/switchback"
size=$(wc -c < "$place/package/package/$name.crate")
# crates.io takes 10 MB; tests, bindings or their data in the package would be seen here
[ "$size" -lt 3000000 ] || { echo "the package has $size bytes"; exit 1; }
for stray in tests bindings capi_tests examples benches fuzz scripts; do
    [ ! -e "$place/switchback/$stray" ] || { echo "$stray is in the package"; exit 1; }
done
cp -r tests/dependent "$place/dependent"
cp Cargo.lock "$place/dependent/"
# Nobody debugs it.
CARGO_PROFILE_DEV_DEBUG=0 CARGO_TARGET_DIR=$place/target cargo run --quiet --offline --manifest-path "$place/dependent/Cargo.toml"
