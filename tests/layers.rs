//! Modules know only what lies below them. That switchback-mpcc knows nothing of switchback, and nobody of the C interface,
//! cargo sees to; what lies in one crate is checked here.

use std::fs;
use std::path::{Path, PathBuf};

/// Sources of the crates with layers. Modules of the second are, for the first, as if they were its own.
const CRATES: [&str; 2] = ["src", "crates/switchback-mpcc/src"];
/// The crate of the C interface, which may use everything.
const CAPI: &str = "crates/switchback-capi/src";

/// Every module and what it may use.
const LAYERS: &[(&str, &[&str])] = &[
    ("error", &[]),
    ("memory", &["error"]),
    ("parallel", &[]),
    ("random", &[]),
    ("settings", &["error"]),
    ("stop", &["error"]),
    ("log", &["error", "settings"]),
    ("tableau", &["error"]),
    ("linalg", &["error", "stop", "settings", "log"]),
    ("qp", &["error", "linalg"]),
    ("func", &["error", "stop", "settings", "log", "linalg"]),
    ("expr", &["error", "stop", "linalg", "func"]),
    ("nlp", &["error", "stop", "settings", "log", "linalg", "func"]),
    ("mpcc", &["error", "stop", "settings", "log", "linalg", "func", "nlp"]),
    ("search", &["error", "stop", "nlp"]),
    ("system", &["error", "stop", "settings", "log", "linalg", "func"]),
    ("model", &["error", "stop", "linalg", "func", "expr", "system"]),
    ("scene", &["error", "stop", "linalg", "func", "expr", "system", "model"]),
    ("freezing", &["error", "expr", "func", "system", "model", "scene"]),
    ("contact", &["error", "stop", "linalg", "func", "system"]),
    ("stepping", &["error", "stop", "linalg", "func", "system", "contact"]),
    ("dcs", &["error", "stop", "settings", "log", "linalg", "func", "system"]),
    ("event", &["error", "stop", "settings", "log", "tableau", "linalg", "func", "system", "contact", "dcs"]),
    ("fesd", &["error", "stop", "settings", "log", "tableau", "linalg", "func", "nlp", "mpcc", "system", "dcs"]),
    (
        "jumps",
        &[
            "error", "stop", "settings", "log", "tableau", "linalg", "func", "expr", "nlp", "mpcc", "system", "scene",
            "freezing", "dcs", "event", "fesd", "search",
        ],
    ),
    (
        "sim",
        &[
            "error", "stop", "settings", "log", "tableau", "linalg", "func", "nlp", "mpcc", "system", "dcs", "event",
            "fesd",
        ],
    ),
    (
        "ocp",
        &[
            "error", "stop", "settings", "log", "tableau", "linalg", "qp", "func", "nlp", "mpcc", "system", "contact",
            "dcs", "event", "fesd", "search", "jumps", "sim",
        ],
    ),
    (
        "nmpc",
        &["error", "stop", "settings", "tableau", "linalg", "func", "expr", "system", "fesd", "event", "ocp", "qp"],
    ),
    ("session", &["error", "stop", "settings", "func", "system", "event"]),
    ("document", &["error", "stop", "settings", "func", "expr", "system", "model", "scene", "fesd", "ocp"]),
    ("fmu", &["error", "expr", "system", "model", "event", "document"]),
];
/// Everybody may use these; they use `error` at most.
const BELOW_ALL: &[&str] = &["memory", "parallel", "random"];

/// Every source of these folders of the repository: its path inside of the folder, and the file.
fn inside_of(folders: &[&str]) -> Vec<(PathBuf, PathBuf)> {
    let mut out = Vec::new();
    for folder in folders {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
        let mut files = Vec::new();
        sources(&root, &mut files);
        assert!(files.len() > 20, "found only {} files in {folder}", files.len());
        out.extend(files.into_iter().map(|f| (f.strip_prefix(&root).unwrap().to_owned(), f)));
    }
    out
}

fn sources(dir: &Path, out: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = fs::read_dir(dir).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for p in entries {
        if p.is_dir() {
            sources(&p, out);
        } else if p.extension().is_some_and(|e| e == "rs") {
            out.push(p);
        }
    }
}

/// Modules named after `crate::` in the code: `crate::a::b` gives `a`, `crate::{a, b::{c}}` gives `a` and `b`.
fn used(text: &str) -> Vec<String> {
    let code: Vec<&str> = text.lines().map(|l| l.split("//").next().unwrap_or("")).collect();
    let code = code.join("\n");
    let word = |s: &str| s.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    let mut out = Vec::new();
    for (at, _) in code.match_indices("crate::") {
        let before = code[..at].chars().next_back();
        if before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == '$') {
            continue;
        }
        let rest = &code[at + "crate::".len()..];
        let Some(group) = rest.strip_prefix('{') else {
            out.push(word(rest));
            continue;
        };
        let (mut depth, mut item) = (0, true);
        for (i, c) in group.char_indices() {
            match c {
                '{' => depth += 1,
                '}' if depth == 0 => break,
                '}' => depth -= 1,
                ',' if depth == 0 => item = true,
                c if item && c.is_alphabetic() => {
                    out.push(word(&group[i..]));
                    item = false;
                }
                _ => {}
            }
        }
    }
    out
}

#[test]
fn no_module_uses_one_above_it() {
    let mut wrong = Vec::new();
    for (inside, f) in &inside_of(&CRATES) {
        let first = inside.components().next().unwrap().as_os_str().to_str().unwrap();
        let module = first.strip_suffix(".rs").unwrap_or(first);
        if module == "lib" {
            continue;
        }
        let Some((_, allowed)) = LAYERS.iter().find(|l| l.0 == module) else {
            wrong.push(format!("module {module} has no layer: give it one here"));
            continue;
        };
        for u in used(&fs::read_to_string(f).unwrap().replace("switchback_mpcc::", "crate::")) {
            let is_module = LAYERS.iter().any(|l| l.0 == u);
            if is_module && u != module && !allowed.contains(&u.as_str()) && !BELOW_ALL.contains(&u.as_str()) {
                wrong.push(format!("{} uses crate::{u}, which is above {module}", inside.display()));
            }
        }
    }
    wrong.dedup();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn fesd_does_not_know_the_solver() {
    let mut files = Vec::new();
    sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src/fesd"), &mut files);
    for f in files {
        let text = fs::read_to_string(&f).unwrap();
        let code: Vec<&str> = text.lines().map(|l| l.split("//").next().unwrap_or("")).collect();
        for name in ["MpccSolver", "Ipm", "Continuation"] {
            assert!(!code.iter().any(|l| l.contains(name)), "{} names {name}", f.display());
        }
    }
}

/// Threads are started in one place, where a thread that cannot be had is no error.
#[test]
fn threads_are_started_in_one_place() {
    let mut wrong = Vec::new();
    for (inside, f) in &inside_of(&[CRATES[0], CRATES[1], CAPI]) {
        let text = fs::read_to_string(f).unwrap();
        let code: Vec<&str> =
            text.split("#[cfg(test)]").next().unwrap().lines().map(|l| l.split("//").next().unwrap_or("")).collect();
        let starts = ["thread::scope", "thread::spawn", "thread::Builder", "pthread_create"]
            .iter()
            .any(|s| code.iter().any(|l| l.contains(s)));
        let inside = inside.display().to_string();
        if starts && !inside.starts_with("memory/thread/") {
            wrong.push(inside);
        }
    }
    assert!(wrong.is_empty(), "threads are started in {wrong:?}: use crate::parallel or crate::memory::thread");
}

/// Names and numbers of fields of the structs in a source.
fn structs(text: &str) -> Vec<(String, usize)> {
    let mut found: Vec<(String, usize)> = Vec::new();
    let mut open = false;
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        if !line.starts_with(' ') {
            open = false;
            if let Some(i) = words.iter().position(|w| *w == "struct").filter(|_| line.ends_with('{')) {
                found.push((words[i + 1].split('<').next().unwrap().into(), 0));
                open = true;
            }
        } else if open && !words[0].starts_with("//") && !words[0].starts_with('#') {
            // what a line break leaves of a type is deeper
            let field = line.starts_with("    ") && !line.starts_with("     ") && line.contains(": ");
            found.last_mut().unwrap().1 += usize::from(field);
        }
    }
    found
}

/// Who reads a struct has to keep all of it in mind.
#[test]
fn structs_of_the_event_engine_have_at_most_40_fields() {
    const MOST: usize = 40;
    let files = inside_of(&["src"]).into_iter().filter(|(inside, _)| inside.starts_with("event"));
    let all: Vec<(String, usize)> = files.flat_map(|(_, f)| structs(&fs::read_to_string(f).unwrap())).collect();
    assert!(["Engine", "Field", "Stepper"].iter().all(|n| all.iter().any(|s| s.0 == *n && s.1 > 20)), "{all:?}");
    let large: Vec<_> = all.into_iter().filter(|s| s.1 > MOST).collect();
    assert!(large.is_empty(), "{large:?}");
}

#[test]
fn the_scanner_sees_all_forms() {
    let text = "use crate::a::b;\nuse crate::{c, d::{e, f}, g};\n// crate::h\nlet x = crate::i::j(); my_crate::k";
    assert_eq!(used(text), ["a", "c", "d", "g", "i"]);
}
