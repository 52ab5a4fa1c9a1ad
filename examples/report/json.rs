//! One JSON object per line, and the table a person reads instead.

use std::fmt::Write as _;

/// Fields in the order they were added.
#[derive(Clone, Default)]
pub struct Object(Vec<(&'static str, String)>);

impl Object {
    pub fn new() -> Object {
        Object::default()
    }
    fn put(mut self, key: &'static str, value: String) -> Object {
        self.0.push((key, value));
        self
    }
    pub fn text(self, key: &'static str, v: &str) -> Object {
        self.put(key, quote(v))
    }
    pub fn int(self, key: &'static str, v: usize) -> Object {
        self.put(key, v.to_string())
    }
    pub fn flag(self, key: &'static str, v: bool) -> Object {
        self.put(key, v.to_string())
    }
    pub fn num(self, key: &'static str, v: f64) -> Object {
        self.put(key, number(v))
    }
    pub fn list(self, key: &'static str, v: &[f64]) -> Object {
        let items: Vec<String> = v.iter().map(|v| number(*v)).collect();
        self.put(key, format!("[{}]", items.join(", ")))
    }
    pub fn line(&self) -> String {
        let fields: Vec<String> = self.0.iter().map(|(k, v)| format!("{}: {v}", quote(k))).collect();
        format!("{{{}}}", fields.join(", "))
    }
}

/// Reads back to the same bits; JSON has no word for what is not finite but `null`.
fn number(v: f64) -> String {
    if v.is_finite() {
        format!("{v:e}")
    } else {
        "null".into()
    }
}

fn quote(s: &str) -> String {
    let mut out = String::from("\"");
    for c in s.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            c if u32::from(c) < 32 => {
                let _ = write!(out, "\\u{:04x}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

/// Rows of text, columns as wide as they need to be.
pub struct Table {
    rows: Vec<Vec<String>>,
}

impl Table {
    pub fn new(head: &[&str]) -> Table {
        Table { rows: vec![head.iter().map(|s| (*s).to_string()).collect()] }
    }
    pub fn row(&mut self, cells: Vec<String>) {
        self.rows.push(cells);
    }
    pub fn text(&self) -> String {
        let n = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let width = |j: usize| self.rows.iter().filter_map(|r| r.get(j)).map(|c| c.chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..n).map(width).collect();
        let mut out = String::new();
        for r in &self.rows {
            let mut line = String::new();
            for (c, w) in r.iter().zip(&widths) {
                let _ = write!(line, "{c:<w$}  ");
            }
            let _ = writeln!(out, "{}", line.trim_end());
        }
        out
    }
}
