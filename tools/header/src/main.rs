//! Writes what is made of the option table and of the C interface, or says which committed file is out of date.
//!
//! `switchback-header [--check] [ROOT]`. From `options.toml` beside the settings of `crates/switchback-mpcc` come the settings in Rust, what the layers of the
//! library take of them, a page and a test; from these settings and `crates/switchback-capi` come `include/switchback.h`, by cbindgen, and
//! `include/api.json`, which describes the same for generators of bindings. Both are read in the order of the `pub mod`
//! lines of its `lib.rs` and from nothing else: types are resolved by name alone, so the rest of the crate could only
//! confuse. The version macros come from `Cargo.toml`.

mod api;
mod pages;
mod rust;
mod table;

use cbindgen::{Builder, Config};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::{env, fs};
use table::Options;

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
        Ok(stale) if stale.is_empty() => ExitCode::SUCCESS,
        Ok(stale) => {
            eprintln!("out of date: {}; run `make header` and commit what it writes", stale.join(", "));
            ExitCode::FAILURE
        }
        Err(e) => {
            eprintln!("switchback-header: {e}");
            ExitCode::FAILURE
        }
    }
}

/// Files that are not what they should be; none after writing them.
fn run(root: &Path, check: bool) -> Result<Vec<String>> {
    let read = |name: &str| fs::read_to_string(root.join(name)).unwrap_or_default();
    let table = format!("{SETTINGS}/options.toml");
    let all = Options::parse(&fs::read_to_string(root.join(&table))?).map_err(|e| format!("{table}: {e}"))?;
    let mut files = vec![
        (format!("{SETTINGS}/options.rs"), rust::settings(&all)),
        ("docs/options.md".to_owned(), pages::options(&all)),
        ("capi_tests/settings_layout.h".to_owned(), pages::layout(&all)),
        (MEMORY.to_owned(), pages::memory(&all, &read(MEMORY))?),
    ];
    files.extend(all.views.iter().map(|v| (v.file.clone(), rust::view(&all, v))));
    let mut stale = compare(root, &files, check)?;
    stale.extend(compare(root, &interface(root, &all)?, check)?);
    Ok(stale)
}

const SETTINGS: &str = "crates/switchback-mpcc/src/settings";
const CAPI: &str = "crates/switchback-capi/src";
const MEMORY: &str = "capi_tests/abi/options.txt";

fn compare(root: &Path, files: &[(String, String)], check: bool) -> Result<Vec<String>> {
    let mut stale = Vec::new();
    for (name, text) in files {
        let path = root.join(name);
        if fs::read_to_string(&path).is_ok_and(|committed| committed == *text) {
            continue;
        }
        if check {
            stale.push(name.clone());
        } else {
            fs::write(&path, text)?;
        }
    }
    Ok(stale)
}

/// Header and `api.json`.
fn interface(root: &Path, all: &Options) -> Result<Vec<(String, String)>> {
    let mut config = Config::from_file(root.join("cbindgen.toml"))?;
    let others = std::mem::take(&mut config.export.include);
    config.export.include = all.enums.iter().map(|e| e.type_name.clone()).chain(others).collect();
    for e in &all.enums {
        config.export.rename.insert(e.type_name.clone(), format!("swb_{}", e.name));
    }
    let version = package_version(&fs::read_to_string(root.join("Cargo.toml"))?)?;
    let macros: String = ["MAJOR", "MINOR", "PATCH"]
        .iter()
        .zip(version.split('.'))
        .map(|(part, number)| format!("#define SWB_VERSION_{part} {number}\n"))
        .collect();
    let after = config.after_includes.take().unwrap_or_default();
    config.after_includes = Some(after.replace("@VERSION_MACROS@\n", &macros).replace("@VERSION@", &version));

    let mut files = vec![root.join(SETTINGS).join("options.rs")];
    let modules = modules(&fs::read_to_string(root.join(CAPI).join("lib.rs"))?).into_iter();
    files.extend(modules.map(|module| root.join(CAPI).join(format!("{module}.rs"))));
    let sources = files.iter().map(fs::read_to_string).collect::<std::io::Result<Vec<_>>>()?;
    let api = api::read(&version, &config, &sources)?;

    let builder = files.iter().fold(Builder::new().with_config(config), |b, file| b.with_src(file));
    let mut bytes = Vec::new();
    builder.generate()?.write(&mut bytes);
    Ok(vec![
        ("include/switchback.h".to_owned(), marked(&String::from_utf8(bytes)?)),
        ("include/api.json".to_owned(), api),
    ])
}

/// The header with `SWB_NODISCARD` before every call whose result must be looked at.
fn marked(header: &str) -> String {
    let lines: Vec<&str> = header.lines().collect();
    let mut out = String::with_capacity(header.len());
    for (k, line) in lines.iter().enumerate() {
        // long declarations have a line for the prefix
        let declaration = match line.strip_prefix("SWB_API") {
            Some("") => lines.get(k + 1).copied().unwrap_or_default(),
            Some(rest) => rest.trim_start(),
            None => "",
        };
        let declaration = declaration.strip_prefix("enum ").unwrap_or(declaration);
        let name = declaration.strip_prefix("swb_status ").and_then(|l| l.split('(').next()).unwrap_or_default();
        if must_be_looked_at(name) {
            out.push_str("SWB_NODISCARD ");
        }
        out.push_str(line);
        out.push('\n');
    }
    out
}

/// Does a call make an object, or compute something that is read afterwards?
fn must_be_looked_at(name: &str) -> bool {
    const ENDS: [&str; 8] =
        ["_run", "_step", "_advance", "_solve", "_solve_warm", "_solve_starts", "_resolve", "_build"];
    !name.is_empty()
        && name != "swb_expr_solve"
        && !name.contains("_get_")
        && (name.contains("_create")
            || name.contains("_from_")
            || name.ends_with("_system")
            || ENDS.iter().any(|end| name.ends_with(end)))
}

/// Version in the `[package]` section.
fn package_version(manifest: &str) -> Result<String> {
    let line = manifest.lines().find(|l| l.starts_with("version"));
    let version = line.and_then(|l| l.split('"').nth(1)).ok_or("no version in Cargo.toml")?;
    Ok(version.to_owned())
}

/// Names of the modules declared in a file, in their order.
fn modules(source: &str) -> Vec<String> {
    let names = source.lines().filter_map(|l| l.strip_prefix("pub mod ")?.strip_suffix(';'));
    names.map(str::to_owned).collect()
}
