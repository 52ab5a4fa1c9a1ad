# Recipe of BinaryBuilder for Switchback_jll, as Yggdrasil takes it (S/Switchback/build_tarballs.jl there). Not run here: it
# needs BinaryBuilder and its compilers. Before it is handed in: the commit of the release instead of the zeros.
using BinaryBuilder

name = "Switchback"
version = v"0.2.0"
sources = [GitSource("https://github.com/switchback/switchback.git", "0000000000000000000000000000000000000000")]

script = raw"""
cd ${WORKSPACE}/srcdir/switchback
cargo build --release --locked --package switchback-capi
cmake -DPREFIX=${prefix} -DLIBDIR=lib -DBUILD_DIR=$(pwd)/target/${rust_target}/release -P cmake/install.cmake
install_license LICENSE
"""

platforms = filter(p -> Sys.islinux(p) && libc(p) == "glibc" && arch(p) in ("x86_64", "aarch64"), supported_platforms())
products = [LibraryProduct("libswitchback", :libswitchback)]
dependencies = [Dependency("SuiteSparse_jll")] # LDL and AMD

build_tarballs(ARGS, name, version, sources, script, platforms, products, dependencies; compilers = [:c, :rust], julia_compat = "1.5",
               lock_microarchitecture = false)
