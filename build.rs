//! Links SuiteSparse (LDL, AMD) and names the shared library.

use std::env;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-env-changed=SUITESPARSE_LIB_DIR");
    // A SuiteSparse outside the linker's default path.
    if let Some(dir) = env::var_os("SUITESPARSE_LIB_DIR") {
        println!("cargo:rustc-link-search=native={}", dir.to_string_lossy());
    }
    // Order matters to a linker that resolves from left to right: users before what they use. LDL is
    // under the LGPL, so it is linked dynamically.
    for lib in ["ldl", "amd", "suitesparseconfig"] {
        println!("cargo:rustc-link-lib=dylib={lib}");
    }
    // Before 1.0 the ABI may change with the minor version: libswitchback.so.0.MINOR; from 1.0 on with
    // the major version alone.
    if env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("linux") {
        let version = env::var("CARGO_PKG_VERSION").expect("cargo sets CARGO_PKG_VERSION");
        let mut parts = version.split('.');
        let (major, minor) = (parts.next().unwrap_or("0"), parts.next().unwrap_or("0"));
        let abi = if major == "0" { format!("0.{minor}") } else { major.to_string() };
        println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,libswitchback.so.{abi}");
        println!("cargo:rustc-cdylib-link-arg=-Wl,--no-undefined");
    }
}
