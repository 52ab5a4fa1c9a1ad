//! The package says where its C header is, and which version it has.

use std::env;
use std::path::Path;

fn main() {
    let include = env::var("DEP_SWITCHBACK_INCLUDE").expect("the build script of switchback names its include folder");
    for name in ["switchback.h", "switchback.hpp"] {
        let file = Path::new(&include).join(name);
        assert!(file.is_file(), "{} is not in the package", file.display());
    }
    println!("cargo:rustc-env=SWITCHBACK={}", env::var("DEP_SWITCHBACK_VERSION").expect("and its version"));
}
