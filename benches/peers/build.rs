//! Compiles the SUNDIALS side; `SUNDIALS_ROOT` is the prefix with `include` and `lib`.

use std::path::PathBuf;

fn main() {
    println!("cargo:rerun-if-changed=src/sundials.c");
    println!("cargo:rerun-if-env-changed=SUNDIALS_ROOT");
    let root = std::env::var("SUNDIALS_ROOT").map_or_else(|_| PathBuf::from("../../build/sundials/usr"), PathBuf::from);
    let root = root.canonicalize().expect("no SUNDIALS: run `make deps`, or set SUNDIALS_ROOT");
    cc::Build::new()
        .file("src/sundials.c")
        .include(root.join("include"))
        .opt_level(3)
        .warnings_into_errors(true)
        .compile("peers_sundials");
    for dir in ["lib", "lib/x86_64-linux-gnu", "lib/aarch64-linux-gnu"].map(|d| root.join(d)) {
        if dir.exists() {
            println!("cargo:rustc-link-search=native={}", dir.display());
            println!("cargo:rustc-link-arg=-Wl,-rpath,{}", dir.display());
        }
    }
    for lib in ["cvode", "arkode", "idas", "nvecserial", "sunmatrixdense", "sunlinsoldense", "sunnonlinsolfixedpoint"] {
        println!("cargo:rustc-link-lib=dylib=sundials_{lib}");
    }
}
