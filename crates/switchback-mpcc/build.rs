//! Links SuiteSparse (LDL, AMD) with the feature `suitesparse`.

use std::env;
use std::ffi::OsString;
use std::path::Path;
use std::process::{Command, Stdio};

/// Order matters to a linker that resolves from left to right: users before what they use.
const LIBRARIES: [&str; 3] = ["ldl", "amd", "suitesparseconfig"];

/// What to build with where there is no SuiteSparse.
const WITHOUT: &str = "--no-default-features (and --features allocator for the library for C)";

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-env-changed=SUITESPARSE_LIB_DIR");
    let target = |what: &str| env::var(format!("CARGO_CFG_TARGET_{what}")).unwrap_or_default();
    if target("FAMILY") == "wasm" && target("OS") != "wasi" {
        println!(
            "cargo::error=this target has no clock, which time limits and measured times need: build for wasm32-wasip1"
        );
    }
    if env::var_os("CARGO_FEATURE_SUITESPARSE").is_some() {
        if target("FAMILY") == "wasm" {
            println!("cargo::error=there is no SuiteSparse for WebAssembly: build with {WITHOUT}");
        } else {
            suitesparse();
        }
    }
}

fn suitesparse() {
    // A SuiteSparse outside the linker's default path.
    let place = env::var_os("SUITESPARSE_LIB_DIR");
    if let Some(dir) = &place {
        println!("cargo:rustc-link-search=native={}", dir.to_string_lossy());
    }
    // LDL is under the LGPL, so it is linked dynamically.
    for lib in LIBRARIES {
        println!("cargo:rustc-link-lib=dylib={lib}");
    }
    if let Some(missing) = missing(place) {
        println!(
            "cargo::error=SuiteSparse is not here: the linker finds no lib{missing}. Install it (Debian, Ubuntu: \
             apt-get install libsuitesparse-dev; Fedora: dnf install suitesparse-devel), or set SUITESPARSE_LIB_DIR \
             to the folder of libldl, libamd and libsuitesparseconfig. Or build without it: {WITHOUT}."
        );
    }
}

/// The first library that a link with the C compiler fails for, which is what rustc links with; none where there is no
/// such compiler, where another linker or another machine is meant, and where only documentation is made.
fn missing(place: Option<OsString>) -> Option<&'static str> {
    let foreign = env::var("TARGET") != env::var("HOST") || env::var_os("DOCS_RS").is_some();
    if foreign || env::var_os("RUSTC_LINKER").is_some() {
        return None;
    }
    let out = Path::new(&env::var_os("OUT_DIR")?).join("link");
    let flags = env::var("CARGO_ENCODED_RUSTFLAGS").unwrap_or_default();
    let link = |libs: &[&str]| {
        let mut command = Command::new("cc");
        command.args(["-x", "c", "/dev/null", "-shared", "-o"]).arg(&out);
        if let Some(dir) = &place {
            command.arg("-L").arg(dir);
        }
        // -L of RUSTFLAGS: together with its folder, or in front of it; "native=" is a word of rustc's.
        let mut words = flags.split('\x1f');
        while let Some(word) = words.next() {
            if let Some(dir) = word.strip_prefix("-L") {
                let dir = if dir.is_empty() { words.next().unwrap_or("") } else { dir };
                command.arg("-L").arg(dir.split_once('=').map_or(dir, |(_, d)| d));
            }
        }
        command.args(libs.iter().map(|l| format!("-l{l}")));
        command.stdout(Stdio::null()).stderr(Stdio::null());
        command.status().is_ok_and(|s| s.success())
    };
    if link(&LIBRARIES) || !link(&[]) {
        return None;
    }
    LIBRARIES.into_iter().find(|l| !link(&[l]))
}
