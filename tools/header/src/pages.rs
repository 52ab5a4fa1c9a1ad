//! Pages and tests from the table of options.

use crate::rust::doc;
use crate::table::{Kind, Options, Row};
use crate::Result;
use std::fmt::Write as _;

/// `docs/options.md`.
pub fn options(all: &Options) -> String {
    let mut s = String::from(
        "# Options\n\n\
         Written by `make header` from `crates/switchback-mpcc/src/settings/options.toml`.\n\n\
         Fields of `swb_settings`, and names for `swb_settings_set_int`, `_double`, `_string` and the same calls of\n\
         objects. Options marked with * shape the problem: when they change, it is built again.\n",
    );
    for (key, title) in &all.groups {
        let rows: Vec<&Row> = all.options.iter().filter(|o| o.group == *key).collect();
        if rows.is_empty() {
            continue;
        }
        let _ = write!(
            s,
            "\n## {title}\n\n| name | type | default | range | symbol | meaning |\n|---|---|---|---|---|---|\n"
        );
        for o in rows {
            row(&mut s, all, o);
        }
    }
    s
}

fn row(s: &mut String, all: &Options, o: &Row) {
    let (kind, default, range) = match o.kind {
        Kind::Int => ("int", format!("{}", o.default as i64), ends(o)),
        Kind::Float => ("float", short(o.default), ends(o)),
        Kind::Enum(e) => {
            let names: Vec<&str> = all.enums[e].values.iter().map(|(v, _)| v.as_str()).collect();
            ("enum", names[o.default as usize].to_owned(), names.join(", "))
        }
    };
    let star = if o.setup { " *" } else { "" };
    let symbol = if o.symbol.is_empty() { String::new() } else { format!("`{}`", o.symbol) };
    let meaning = doc(all, o).replace('_', "\\_").replace('^', "\\^");
    let _ = writeln!(s, "| `{}`{star} | {kind} | {default} | {range} | {symbol} | {meaning} |", o.name);
}

fn ends(o: &Row) -> String {
    let (left, right) = (if o.min.open { '(' } else { '[' }, if o.max.open { ')' } else { ']' });
    format!("{left}{}, {}{right}", short(o.min.value), short(o.max.value))
}

/// Shortest text that reads back to the same number.
fn short(v: f64) -> String {
    if v == f64::INFINITY {
        return "inf".into();
    }
    let (plain, scientific) = (format!("{v}"), format!("{v:e}"));
    if scientific.len() < plain.len() {
        scientific
    } else {
        plain
    }
}

/// `capi_tests/settings_layout.h`: lines for the main function of a test.
pub fn layout(all: &Options) -> String {
    let mut s = String::from(
        "/* Layout of swb_settings and numbers of its enumerations: written by `make header` from crates/switchback-mpcc/src/settings/options.toml. */\n",
    );
    for (i, o) in all.options.iter().enumerate() {
        let _ = writeln!(s, "AT(swb_settings, {}, {});", i + 1, o.name);
    }
    let _ = writeln!(s, "CHECK(sizeof(swb_settings) == (size_t)8 * {});", all.options.len() + 1);
    for e in &all.enums {
        for (number, (value, _)) in e.values.iter().enumerate() {
            let _ = writeln!(s, "CHECK(SWB_{}_{} == {number});", e.name.to_uppercase(), value.to_uppercase());
        }
    }
    s
}

const MEMORY: &str = "\
# What programs are compiled against: place, type and name of the fields of swb_settings, numbers of the values of its
# enumerations. `make header` adds lines and refuses to change one.
";

/// `capi_tests/abi/options.txt`, which remembers what was there before; an error if a line of it is no longer true.
pub fn memory(all: &Options, before: &str) -> Result<String> {
    let mut s = MEMORY.to_owned();
    for (i, o) in all.options.iter().enumerate() {
        let _ = writeln!(s, "{} {} {}", i + 1, if o.kind == Kind::Float { "double" } else { "int64_t" }, o.name);
    }
    for e in &all.enums {
        for (number, (value, _)) in e.values.iter().enumerate() {
            let _ = writeln!(s, "{} {number} {value}", e.name);
        }
    }
    let lines: std::collections::BTreeSet<&str> = s.lines().collect();
    match before.lines().filter(|l| !l.starts_with('#')).find(|l| !lines.contains(l)) {
        Some(l) => {
            Err(format!("capi_tests/abi/options.txt has the line '{l}', which crates/switchback-mpcc/src/settings/options.toml breaks").into())
        }
        None => Ok(s),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str = r#"
groups = [["all", "All"]]
[[view]]
name = "part"
type = "Part"
file = "src/part/settings.rs"
text = "A part."
[[enum]]
name = "toggle"
text = "On or off."
values = [["off", "Without."], ["on", "With."]]
[[option]]
name = "polish"
group = "all"
kind = "enum toggle"
default = "on"
changes = "free"
text = "Polishes."
views = ["part.shine"]
[[option]]
name = "tol"
group = "all"
kind = "float"
default = 1e-9
range = "(0, inf]"
changes = "built"
text = "Tolerance."
"#;

    #[test]
    fn what_programs_rely_on_stays() {
        let before = memory(&Options::parse(TABLE).unwrap(), "").unwrap();
        assert!(before.contains("\n1 int64_t polish\n2 double tol\ntoggle 0 off\ntoggle 1 on\n"), "{before}");
        let more = TABLE.to_owned() + &TABLE[TABLE.rfind("[[option]]").unwrap()..].replace("\"tol\"", "\"tol2\"");
        assert!(memory(&Options::parse(&more).unwrap(), &before).unwrap().contains("3 double tol2"));
        for (from, to) in [("\"tol\"", "\"toll\""), ("\"Without.\"], ", "\"Without.\"], [\"maybe\", \"Perhaps.\"], ")] {
            let broken = Options::parse(&TABLE.replace(from, to)).unwrap();
            assert!(memory(&broken, &before).is_err_and(|e| e.to_string().contains("breaks")), "{to}");
        }
    }

    #[test]
    fn what_is_wrong_is_said() {
        for (from, to, said) in [
            ("1e-9", "0.0", "option tol: the default 0 is outside the range"),
            ("\"(0, inf]\"", "\"0..1\"", "option tol: the range is like"),
            ("\"Tolerance.\"", "\"tolerance\"", "option tol: the text is a sentence"),
            ("\"part.shine\"", "\"prat\"", "option polish: there is no view prat"),
            ("enum toggle", "enum togle", "option polish: there is no such enumeration"),
            ("\"built\"", "\"never\"", "option tol: changes is"),
            ("name = \"tol\"", "name = \"polish\"", "option polish is there twice"),
            ("range =", "rnage =", "option tol: rnage has no meaning"),
        ] {
            let error = Options::parse(&TABLE.replace(from, to)).err().expect(to).to_string();
            assert!(error.starts_with(said), "{error}");
        }
    }

    #[test]
    fn views_have_their_own_names() {
        let all = Options::parse(TABLE).unwrap();
        let rust = crate::rust::view(&all, &all.views[0]);
        assert!(rust.contains("pub shine: bool,") && rust.contains("shine: s.polish(),"), "{rust}");
    }
}
