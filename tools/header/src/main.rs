//! Writes `include/switchback.h`, or says that the committed one is out of date.
//!
//! `switchback-header [--check] [ROOT]`. Only `src/settings.rs` and `src/capi` are read, in the order of
//! the `pub mod` lines of `src/capi/mod.rs`: the generator resolves types by name alone, so the rest of
//! the crate could only confuse it. The version macros come from `Cargo.toml`.

use cbindgen::{Builder, Config};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::{env, fs};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

fn main() -> ExitCode {
    let mut check = false;
    let mut root = PathBuf::from(".");
    for argument in env::args().skip(1) {
        match argument.as_str() {
            "--check" => check = true,
            path => root = PathBuf::from(path),
        }
    }
    match run(&root, check) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => {
            eprintln!("include/switchback.h is out of date: run `make header` and commit it");
            ExitCode::FAILURE
        }
        Err(e) => {
            eprintln!("switchback-header: {e}");
            ExitCode::FAILURE
        }
    }
}

fn run(root: &Path, check: bool) -> Result<bool> {
    let path = root.join("include/switchback.h");
    let header = generate(root)?;
    let committed = fs::read_to_string(&path).unwrap_or_default();
    if !check && header != committed {
        fs::write(&path, &header)?;
        return Ok(true);
    }
    Ok(header == committed)
}

fn generate(root: &Path) -> Result<String> {
    let mut config = Config::from_file(root.join("cbindgen.toml"))?;
    let version = package_version(&fs::read_to_string(root.join("Cargo.toml"))?)?;
    let macros: String = ["MAJOR", "MINOR", "PATCH"]
        .iter()
        .zip(version.split('.'))
        .map(|(part, number)| format!("#define SWB_VERSION_{part} {number}\n"))
        .collect();
    let after = config.after_includes.take().unwrap_or_default();
    config.after_includes = Some(after.replace("@VERSION_MACROS@\n", &macros).replace("@VERSION@", &version));

    let mut builder = Builder::new().with_config(config).with_src(root.join("src/settings.rs"));
    for module in modules(&fs::read_to_string(root.join("src/capi/mod.rs"))?) {
        builder = builder.with_src(root.join(format!("src/capi/{module}.rs")));
    }
    let mut bytes = Vec::new();
    builder.generate()?.write(&mut bytes);
    Ok(String::from_utf8(bytes)?)
}

/// Version in the `[package]` section.
fn package_version(manifest: &str) -> Result<String> {
    let line = manifest.lines().find(|l| l.starts_with("version"));
    let version = line.and_then(|l| l.split('"').nth(1)).ok_or("no version in Cargo.toml")?;
    Ok(version.to_owned())
}

/// Names of the modules declared in a file, in their order.
fn modules(source: &str) -> Vec<&str> {
    source.lines().filter_map(|l| l.strip_prefix("pub mod ")?.strip_suffix(';')).collect()
}
