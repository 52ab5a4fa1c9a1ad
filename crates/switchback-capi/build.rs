//! Names the shared library.

use std::env;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    let version = env::var("CARGO_PKG_VERSION").expect("cargo sets CARGO_PKG_VERSION");
    // Before 1.0 the ABI may change with the minor version: libswitchback.so.0.MINOR; from 1.0 on with
    // the major version alone.
    let mut parts = version.split('.');
    let (major, minor) = (parts.next().unwrap_or("0"), parts.next().unwrap_or("0"));
    let abi = if major == "0" { format!("0.{minor}") } else { major.to_string() };
    let arg = |text: &str| println!("cargo:rustc-cdylib-link-arg={text}");
    match env::var("CARGO_CFG_TARGET_OS").unwrap_or_default().as_str() {
        "linux" => {
            arg(&format!("-Wl,-soname,libswitchback.so.{abi}"));
            arg("-Wl,--no-undefined");
        }
        "macos" => arg(&format!("-Wl,-install_name,@rpath/libswitchback.{abi}.dylib")),
        // Memory for arguments and results, and functions of the host in the place of those of C.
        "wasi" => ["--export=malloc", "--export=free", "--export-table", "--growable-table"].into_iter().for_each(arg),
        _ => {}
    }
}
