//! Rust from the table of options: the settings, and what the layers take of them.

use crate::table::{camel, End, Enum, Kind, Options, Place, Row, View};
use std::fmt::Write as _;

const NOTE: &str = "written by `make header` from options.toml of the settings; do not edit";

/// `options.rs` beside the table.
pub fn settings(all: &Options) -> String {
    let mut s = format!("//! All options: {NOTE}.\n\n");
    s += "use super::{bad, Bound::{Closed, Open}, Kind, OptionInfo};\nuse crate::error::Result;\nuse std::mem::offset_of;\n";
    for e in &all.enums {
        enumeration(&mut s, all, e);
    }
    structure(&mut s, all);
    rows(&mut s, all);
    access(&mut s, all);
    s
}

fn enumeration(s: &mut String, all: &Options, e: &Enum) {
    let (ty, n) = (&e.type_name, e.values.len());
    let users: Vec<&Row> = all.options.iter().filter(|o| enum_of(all, o).is_some_and(|f| f.name == e.name)).collect();
    let text = match users[..] {
        [only] => format!("{} (option {}).", &e.text[..e.text.len() - 1], only.name),
        _ => e.text.clone(),
    };
    let _ = write!(s, "\n/// {text}\n#[repr(i64)]\n#[derive(Clone, Copy, Debug, PartialEq, Eq)]\npub enum {ty} {{\n");
    for (i, (value, text)) in e.values.iter().enumerate() {
        let _ = write!(s, "    /// {text}\n    {} = {i},\n", camel(value));
    }
    let _ = write!(
        s,
        "}}\n\nimpl {ty} {{\n    /// Value names, by value.\n    pub const NAMES: &'static [&'static str] = &["
    );
    for (i, (value, _)) in e.values.iter().enumerate() {
        let _ = write!(s, "{}\"{value}\"", if i == 0 { "" } else { ", " });
    }
    let _ = write!(s, "];\n    const ALL: [{ty}; {n}] = [");
    for (i, (value, _)) in e.values.iter().enumerate() {
        let _ = write!(s, "{}{ty}::{}", if i == 0 { "" } else { ", " }, camel(value));
    }
    *s += "];\n\n    /// Value of this number; `None` outside the enumeration.\n";
    *s += "    pub fn from_i64(value: i64) -> Option<Self> {\n        Self::ALL.get(usize::try_from(value).ok()?).copied()\n    }\n";
    *s += "\n    /// Name of the value.\n    pub fn name(self) -> &'static str {\n        Self::NAMES[self as usize]\n    }\n}\n";
}

fn structure(s: &mut String, all: &Options) {
    *s += "
/// Settings of discretisation and solver.
///
/// Fill with `swb_settings_init` in C, `Settings::default()` in Rust, then change what differs. Fields
/// are only ever appended; every field is 8 bytes wide, so there are no holes. An integer field that is
/// an enumeration takes the values of the enumeration named in its description. Ranges: see the option
/// table (`swb_option_range`).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Size of this struct in bytes, written by the init function: tells the library how much to read.
    pub struct_size: u64,
";
    for o in &all.options {
        let _ = write!(s, "    /// {}\n    pub {}: {},\n", doc(all, o), o.name, number_type(o));
    }
    *s += "}\n\nimpl Default for Settings {\n    fn default() -> Self {\n        Settings {\n";
    *s += "            struct_size: std::mem::size_of::<Settings>() as u64,\n";
    for o in &all.options {
        let value = if o.kind == Kind::Float { float(o.default) } else { format!("{}", o.default as i64) };
        let _ = writeln!(s, "            {}: {value},", o.name);
    }
    *s += "        }\n    }\n}\n";
}

fn rows(s: &mut String, all: &Options) {
    *s += "\n/// All options, in the order of the fields of [`Settings`].\npub static OPTIONS: &[OptionInfo] = &[\n";
    for o in &all.options {
        let kind = match (o.kind, enum_of(all, o)) {
            (_, Some(e)) => format!("Kind::Enum({}::NAMES)", e.type_name),
            (Kind::Float, _) => "Kind::Float".into(),
            _ => "Kind::Int".into(),
        };
        let end = |e: End| format!("{}({})", if e.open { "Open" } else { "Closed" }, float(e.value));
        let (name, group) = (&o.name, &o.group);
        let (to, from) = if o.kind == Kind::Float { ("", "") } else { (" as f64", " as i64") };
        let _ = write!(
            s,
            "    OptionInfo {{\n        name: \"{name}\",\n        group: \"{group}\",\n        kind: {kind},\n        \
             default: {},\n        min: {},\n        max: {},\n        symbol: \"{}\",\n        doc: {:?},\n        \
             setup_only: {},\n        offset: offset_of!(Settings, {name}),\n        get: |s| s.{name}{to},\n        \
             set: |s, v| s.{name} = v{from},\n    }},\n",
            float(o.default),
            end(o.min),
            end(o.max),
            o.symbol,
            doc(all, o),
            o.setup
        );
    }
    *s += "];\n";
}

fn access(s: &mut String, all: &Options) {
    *s += "\nimpl Settings {";
    let mut first = true;
    for o in &all.options {
        let Some(e) = enum_of(all, o) else {
            continue;
        };
        *s += if first { "\n" } else { "\n\n" };
        first = false;
        let (name, ty) = (&o.name, &e.type_name);
        if e.is_toggle() {
            let _ = write!(s, "    /// True where the option {name} is on.\n    pub fn {name}(&self) -> bool {{\n        self.{name} != 0\n    }}");
        } else {
            let _ =
                write!(s, "    /// [`{ty}`] of these settings.\n    pub fn {name}(&self) -> Result<{ty}> {{\n        ");
            let _ = write!(s, "{ty}::from_i64(self.{name}).ok_or_else(|| bad(\"{name}\", self.{name}))\n    }}");
        }
    }
    *s += "\n}\n";
}

/// The file of a view.
pub fn view(all: &Options, v: &View) -> String {
    let (fields, ty) = (all.of_view(&v.name), &v.type_name);
    let mut s = format!("//! What this layer takes of the options: {NOTE}.\n\n");
    let mut used: Vec<&str> = fields.iter().filter_map(|(o, _)| plain_enum(all, o)).map(|e| &*e.type_name).collect();
    used.push("Settings");
    used.sort_unstable();
    used.dedup();
    let target = v.passes_to.as_ref().and_then(|to| all.views.iter().find(|w| w.name == *to));
    if let Some(w) = target {
        let module = w.file.rsplit_once("src/").and_then(|(_, f)| f.split('/').next()).unwrap_or_default();
        let _ = writeln!(s, "use crate::{module}::{};", w.type_name);
    }
    let _ = write!(s, "use crate::settings::{{{}}};\n\n/// {}\n", used.join(", "), v.text);
    let lists = fields.iter().any(|(_, p)| p.list) || v.own.iter().any(|f| f.type_name.starts_with("Vec"));
    let copy = if lists { "" } else { "Copy, " };
    let _ = write!(s, "#[derive(Debug, Clone, {copy}PartialEq)]\npub struct {ty} {{\n");
    for (o, p) in &fields {
        let fixed = if o.setup { " Fixed when the problem is built." } else { "" };
        let _ = write!(s, "    /// {}{fixed}\n    pub {}: {},\n", o.text, p.field, field_type(all, o, p));
    }
    for f in &v.own {
        let _ = write!(s, "    /// {}\n    pub {}: {},\n", f.text, f.name, f.type_name);
    }
    let _ = write!(s, "}}\n\nimpl Default for {ty} {{\n    fn default() -> {ty} {{\n        {ty}::from(&Settings::default())\n    }}\n}}\n");
    let _ = write!(s, "\nimpl From<&Settings> for {ty} {{\n");
    s += "    /// Numbers that are no value of an enumeration count as its default; [`Settings::validate`] names them.\n";
    let _ = write!(s, "    fn from(s: &Settings) -> {ty} {{\n        {ty} {{\n");
    for (o, p) in &fields {
        let _ = writeln!(s, "            {}: {},", p.field, taken(all, o, p));
    }
    for f in &v.own {
        let _ = writeln!(s, "            {}: {},", f.name, f.default);
    }
    s += "        }\n    }\n}\n";
    if let Some(w) = target {
        pass(&mut s, all, v, w);
    }
    s
}

/// Methods of the view `v` that give `w` what both have.
fn pass(s: &mut String, all: &Options, v: &View, w: &View) {
    let (ty, to) = (&w.type_name, &w.name);
    let theirs = all.of_view(to);
    let both = all.of_view(&v.name).into_iter().filter_map(|(o, p)| {
        let q = theirs.iter().find(|(other, _)| other.name == o.name)?.1;
        Some((o, &p.field, &q.field))
    });
    let both: Vec<_> = both.collect();
    let _ = write!(
        s,
        "\nimpl {} {{\n    /// [`{ty}`] with the options that are in both; the others have their defaults.\n",
        v.type_name
    );
    let _ = write!(s, "    pub fn {to}(&self) -> {ty} {{\n        {ty} {{\n");
    for (_, own, their) in &both {
        let _ = writeln!(s, "            {their}: self.{own},");
    }
    let _ = write!(s, "            ..{ty}::default()\n        }}\n    }}\n");
    s.push_str("\n    /// Writes the options that are in both and may change at any time.\n");
    let _ = writeln!(s, "    pub fn update_{to}(&self, {to}: &mut {ty}) {{");
    for (_, own, their) in both.iter().filter(|(o, _, _)| !o.setup) {
        let _ = writeln!(s, "        {to}.{their} = self.{own};");
    }
    s.push_str("    }\n}\n");
}

fn field_type(all: &Options, o: &Row, p: &Place) -> String {
    let plain = match o.kind {
        Kind::Int => "usize",
        Kind::Float => "f64",
        Kind::Enum(e) if all.enums[e].is_toggle() => "bool",
        Kind::Enum(e) => &all.enums[e].type_name,
    };
    if p.list {
        format!("Vec<{plain}>")
    } else {
        plain.to_owned()
    }
}

fn taken(all: &Options, o: &Row, p: &Place) -> String {
    let name = &o.name;
    let plain = match o.kind {
        Kind::Int => format!("usize::try_from(s.{name}).unwrap_or(0)"),
        Kind::Float => format!("s.{name}"),
        Kind::Enum(e) if all.enums[e].is_toggle() => format!("s.{name}()"),
        Kind::Enum(e) => {
            let e = &all.enums[e];
            format!("s.{name}().unwrap_or({}::{})", e.type_name, camel(&e.values[o.default as usize].0))
        }
    };
    if p.list {
        format!("vec![{plain}]")
    } else {
        plain
    }
}

/// The sentence of an option with the enumeration its numbers are from.
pub fn doc(all: &Options, o: &Row) -> String {
    match enum_of(all, o) {
        Some(e) => format!("{} (enum {}).", &o.text[..o.text.len() - 1], e.name),
        None => o.text.clone(),
    }
}

fn enum_of<'a>(all: &'a Options, o: &Row) -> Option<&'a Enum> {
    match o.kind {
        Kind::Enum(e) => Some(&all.enums[e]),
        _ => None,
    }
}

/// The enumeration, unless it is on or off.
fn plain_enum<'a>(all: &'a Options, o: &Row) -> Option<&'a Enum> {
    enum_of(all, o).filter(|e| !e.is_toggle())
}

fn number_type(o: &Row) -> &'static str {
    if o.kind == Kind::Float {
        "f64"
    } else {
        "i64"
    }
}

fn float(v: f64) -> String {
    if v == f64::INFINITY {
        "f64::INFINITY".to_owned()
    } else {
        format!("{v:?}")
    }
}
