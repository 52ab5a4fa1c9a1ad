//! `crates/switchback-mpcc/src/settings/options.toml`: what it says, or what is wrong with it.

use crate::Result;
use std::collections::BTreeSet;
use toml::{Table, Value};

/// The whole table.
pub struct Options {
    /// Key and title, in the order of the page.
    pub groups: Vec<(String, String)>,
    pub views: Vec<View>,
    pub enums: Vec<Enum>,
    pub options: Vec<Row>,
}

/// What a layer takes of the options.
pub struct View {
    pub name: String,
    pub type_name: String,
    pub file: String,
    pub text: String,
    pub own: Vec<Own>,
    pub passes_to: Option<String>,
}

/// A field of a view that is no option.
pub struct Own {
    pub name: String,
    pub type_name: String,
    pub default: String,
    pub text: String,
}

/// An enumeration: values are numbered from 0.
pub struct Enum {
    pub name: String,
    pub type_name: String,
    pub text: String,
    /// Name and meaning.
    pub values: Vec<(String, String)>,
}

/// One option.
pub struct Row {
    pub name: String,
    pub group: String,
    pub kind: Kind,
    /// Integers and the numbers of values are exact.
    pub default: f64,
    pub min: End,
    pub max: End,
    pub symbol: String,
    pub setup: bool,
    pub text: String,
    pub views: Vec<Place>,
}

/// Kind of an option.
#[derive(Clone, Copy, PartialEq)]
pub enum Kind {
    Int,
    Float,
    /// Index of the enumeration.
    Enum(usize),
}

/// An end of a range.
#[derive(Clone, Copy)]
pub struct End {
    pub value: f64,
    pub open: bool,
}

/// A field of a view.
pub struct Place {
    pub view: String,
    pub field: String,
    /// Has the layer a list of such numbers?
    pub list: bool,
}

impl Enum {
    /// Is it a choice between without and with?
    pub fn is_toggle(&self) -> bool {
        self.values.len() == 2 && self.values[0].0 == "off" && self.values[1].0 == "on"
    }
}

impl Options {
    /// Reads and judges the table.
    pub fn parse(text: &str) -> Result<Options> {
        let table: Table = text.parse()?;
        only(&table, &["groups", "view", "enum", "option"], "the file")?;
        let groups = pairs(&table, "groups", "the file")?;
        let enums = tables(&table, "enum")?.into_iter().map(read_enum).collect::<Result<Vec<_>>>()?;
        let views = tables(&table, "view")?.into_iter().map(read_view).collect::<Result<Vec<_>>>()?;
        let options = tables(&table, "option")?.into_iter().map(|t| read_row(t, &enums)).collect::<Result<Vec<_>>>()?;
        let all = Options { groups, views, enums, options };
        all.judge()?;
        Ok(all)
    }

    /// Options of a view with their fields there, in the order of the table.
    pub fn of_view(&self, view: &str) -> Vec<(&Row, &Place)> {
        let found = |o: &'_ Row| o.views.iter().position(|p| p.view == view);
        self.options.iter().filter_map(|o| found(o).map(|at| (o, &o.views[at]))).collect()
    }

    fn judge(&self) -> Result<()> {
        unique(self.options.iter().map(|o| &o.name), "option")?;
        unique(self.enums.iter().map(|e| &e.name), "enumeration")?;
        unique(self.views.iter().map(|v| &v.name), "view")?;
        for o in &self.options {
            let name = &o.name;
            if !self.groups.iter().any(|(key, _)| *key == o.group) {
                return Err(format!("option {name}: there is no group {}", o.group).into());
            }
            if let Some(p) = o.views.iter().find(|p| !self.views.iter().any(|v| v.name == p.view)) {
                return Err(format!("option {name}: there is no view {}", p.view).into());
            }
            let below = o.default < o.min.value || (o.min.open && o.default == o.min.value);
            let above = o.default > o.max.value || (o.max.open && o.default == o.max.value);
            if below || above || o.default.is_nan() || o.min.value > o.max.value {
                return Err(format!("option {name}: the default {} is outside the range", o.default).into());
            }
        }
        for v in &self.views {
            let fields = self.of_view(&v.name);
            unique(fields.iter().map(|(_, p)| &p.field).chain(v.own.iter().map(|f| &f.name)), "field")?;
            if let Some(to) = v.passes_to.as_ref().filter(|to| !self.views.iter().any(|w| w.name == **to)) {
                return Err(format!("view {}: there is no view {to} to pass options to", v.name).into());
            }
        }
        Ok(())
    }
}

fn read_enum(t: &Table) -> Result<Enum> {
    let name = text(t, "name", "an enumeration")?;
    let about = format!("enumeration {name}");
    only(t, &["name", "type", "text", "values"], &about)?;
    let type_name = t.get("type").and_then(Value::as_str).map_or_else(|| camel(&name), str::to_owned);
    let values = pairs(t, "values", &about)?;
    unique(values.iter().map(|(v, _)| v), "value")?;
    for (value, text) in &values {
        sentence(text, &format!("{about}, value {value}"))?;
    }
    Ok(Enum { type_name, text: spoken(t, &about)?, values, name })
}

fn read_view(t: &Table) -> Result<View> {
    let name = text(t, "name", "a view")?;
    let about = format!("view {name}");
    only(t, &["name", "type", "file", "text", "own", "passes_to"], &about)?;
    let mut own = Vec::new();
    for f in t.get("own").and_then(Value::as_array).into_iter().flatten() {
        let parts: Vec<&str> = f.as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        let [name, type_name, default, text] = parts[..] else {
            return Err(format!("{about}: a field has a name, a type, a default and a sentence").into());
        };
        let [name, type_name, default, text] = [name, type_name, default, text].map(str::to_owned);
        own.push(Own { name, type_name, default, text });
    }
    let passes_to = t.get("passes_to").and_then(Value::as_str).map(str::to_owned);
    let (type_name, file) = (text(t, "type", &about)?, text(t, "file", &about)?);
    Ok(View { type_name, file, text: spoken(t, &about)?, own, passes_to, name })
}

fn read_row(t: &Table, enums: &[Enum]) -> Result<Row> {
    let name = text(t, "name", "an option")?;
    let about = format!("option {name}");
    only(t, &["name", "group", "kind", "default", "range", "symbol", "changes", "text", "views"], &about)?;
    let wrong = |what: &str| -> Box<dyn std::error::Error> { format!("{about}: {what}").into() };
    let kind = match text(t, "kind", &about)?.as_str() {
        "int" => Kind::Int,
        "float" => Kind::Float,
        other => {
            let name = other.strip_prefix("enum ").ok_or_else(|| wrong("the kind is int, float or enum NAME"))?;
            Kind::Enum(enums.iter().position(|e| e.name == name).ok_or_else(|| wrong("there is no such enumeration"))?)
        }
    };
    let default = t.get("default").ok_or_else(|| wrong("there is no default"))?;
    let (default, min, max) = match kind {
        Kind::Enum(e) => {
            let values = &enums[e].values;
            let value = default.as_str().and_then(|d| values.iter().position(|(v, _)| v == d));
            let value = value.ok_or_else(|| wrong("the default is no value of the enumeration"))?;
            let end = |value: usize| End { value: value as f64, open: false };
            (value as f64, end(0), end(values.len() - 1))
        }
        _ => {
            let number = match (default, kind) {
                (Value::Integer(v), _) => *v as f64,
                (Value::Float(v), Kind::Float) => *v,
                _ => return Err(wrong("the default is no number of this kind")),
            };
            let (min, max) =
                range(&text(t, "range", &about)?).ok_or_else(|| wrong("the range is like [1, 9] or (0, inf)"))?;
            (number, min, max)
        }
    };
    let setup = match text(t, "changes", &about)?.as_str() {
        "built" => true,
        "free" => false,
        _ => return Err(wrong("changes is \"free\" or \"built\"")),
    };
    let symbol = t.get("symbol").and_then(Value::as_str).unwrap_or_default().to_owned();
    let views = t.get("views").and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_str);
    let views = views.map(|v| place(v, &name)).collect();
    let (group, text) = (text(t, "group", &about)?, spoken(t, &about)?);
    Ok(Row { name, group, kind, default, min, max, symbol, setup, text, views })
}

/// From `view`, `view.field` or `view.field[]`.
fn place(text: &str, option: &str) -> Place {
    let (plain, list) = text.strip_suffix("[]").map_or((text, false), |plain| (plain, true));
    let (view, field) = plain.split_once('.').unwrap_or((plain, option));
    Place { view: view.to_owned(), field: field.to_owned(), list }
}

fn range(text: &str) -> Option<(End, End)> {
    let (a, b) = text.get(1..text.len().checked_sub(1)?)?.split_once(", ")?;
    let end = |number: &str, bracket: &str, open: &str, closed: &str| {
        let known = bracket == open || bracket == closed;
        known.then_some(End { value: number.parse().ok()?, open: bracket == open })
    };
    Some((end(a, &text[..1], "(", "[")?, end(b, &text[text.len() - 1..], ")", "]")?))
}

/// Words joined by underscores as a Rust type: `rk_family` gives `RkFamily`.
pub fn camel(name: &str) -> String {
    let capital = |w: &str| w[..1].to_uppercase() + &w[1..];
    name.split('_').map(capital).collect()
}

fn text(t: &Table, key: &str, about: &str) -> Result<String> {
    let found = t.get(key).and_then(Value::as_str);
    Ok(found.ok_or_else(|| format!("{about}: there is no {key}"))?.to_owned())
}

fn spoken(t: &Table, about: &str) -> Result<String> {
    let text = text(t, "text", about)?;
    sentence(&text, about)?;
    Ok(text)
}

fn sentence(text: &str, about: &str) -> Result<()> {
    if text.ends_with('.') && !text.contains('\n') && text.starts_with(|c: char| c.is_uppercase()) {
        return Ok(());
    }
    Err(format!("{about}: the text is a sentence on one line").into())
}

fn tables<'a>(t: &'a Table, key: &str) -> Result<Vec<&'a Table>> {
    let list = t.get(key).and_then(Value::as_array).ok_or_else(|| format!("there is no [[{key}]]"))?;
    Ok(list.iter().filter_map(Value::as_table).collect())
}

fn pairs(t: &Table, key: &str, about: &str) -> Result<Vec<(String, String)>> {
    let pair = |v: &Value| {
        let [Value::String(a), Value::String(b)] = v.as_array()?.as_slice() else {
            return None;
        };
        Some((a.clone(), b.clone()))
    };
    let list = t.get(key).and_then(Value::as_array).and_then(|l| l.iter().map(pair).collect::<Option<Vec<_>>>());
    list.filter(|l| !l.is_empty()).ok_or_else(|| format!("{about}: {key} is a list of pairs of texts").into())
}

fn only(t: &Table, known: &[&str], about: &str) -> Result<()> {
    match t.keys().find(|k| !known.contains(&k.as_str())) {
        Some(k) => Err(format!("{about}: {k} has no meaning").into()),
        None => Ok(()),
    }
}

fn unique<'a>(names: impl Iterator<Item = &'a String>, what: &str) -> Result<()> {
    let mut seen = BTreeSet::new();
    for n in names {
        if !seen.insert(n) {
            return Err(format!("{what} {n} is there twice").into());
        }
    }
    Ok(())
}
