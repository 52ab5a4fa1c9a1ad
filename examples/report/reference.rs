//! Reference solutions beside the repository: one JSON file per problem, with switching times and sensitivities.
#![allow(dead_code)]

use std::collections::BTreeMap;
use std::path::PathBuf;

/// A JSON value.
#[derive(Debug, Clone, PartialEq)]
pub enum Json {
    Null,
    Flag(bool),
    Number(f64),
    Text(String),
    List(Vec<Json>),
    Map(BTreeMap<String, Json>),
}

impl Json {
    /// Parses a document; `None` if it is not JSON.
    pub fn parse(text: &str) -> Option<Json> {
        let mut p = Parser { s: text.as_bytes(), i: 0 };
        let v = p.value()?;
        p.skip();
        (p.i == p.s.len()).then_some(v)
    }

    /// Member of an object; null if there is none.
    pub fn get(&self, key: &str) -> &Json {
        match self {
            Json::Map(m) => m.get(key).unwrap_or(&Json::Null),
            _ => &Json::Null,
        }
    }

    pub fn list(&self) -> &[Json] {
        match self {
            Json::List(l) => l,
            _ => &[],
        }
    }

    pub fn number(&self) -> f64 {
        match self {
            Json::Number(v) => *v,
            _ => f64::NAN,
        }
    }

    pub fn text(&self) -> &str {
        match self {
            Json::Text(s) => s,
            _ => "",
        }
    }

    pub fn numbers(&self) -> Vec<f64> {
        self.list().iter().map(Json::number).collect()
    }
}

struct Parser<'a> {
    s: &'a [u8],
    i: usize,
}

impl Parser<'_> {
    fn skip(&mut self) {
        while self.s.get(self.i).is_some_and(u8::is_ascii_whitespace) {
            self.i += 1;
        }
    }

    fn eat(&mut self, c: u8) -> Option<()> {
        self.skip();
        (self.s.get(self.i) == Some(&c)).then(|| self.i += 1)
    }

    fn word(&mut self, w: &str, v: Json) -> Option<Json> {
        self.s[self.i..].starts_with(w.as_bytes()).then(|| {
            self.i += w.len();
            v
        })
    }

    fn value(&mut self) -> Option<Json> {
        self.skip();
        match *self.s.get(self.i)? {
            b'{' => {
                self.i += 1;
                let mut m = BTreeMap::new();
                if self.eat(b'}').is_some() {
                    return Some(Json::Map(m));
                }
                loop {
                    self.skip();
                    let k = self.string()?;
                    self.eat(b':')?;
                    m.insert(k, self.value()?);
                    if self.eat(b',').is_none() {
                        break;
                    }
                }
                self.eat(b'}')?;
                Some(Json::Map(m))
            }
            b'[' => {
                self.i += 1;
                let mut l = Vec::new();
                if self.eat(b']').is_some() {
                    return Some(Json::List(l));
                }
                loop {
                    l.push(self.value()?);
                    if self.eat(b',').is_none() {
                        break;
                    }
                }
                self.eat(b']')?;
                Some(Json::List(l))
            }
            b'"' => self.string().map(Json::Text),
            b't' => self.word("true", Json::Flag(true)),
            b'f' => self.word("false", Json::Flag(false)),
            b'n' => self.word("null", Json::Null),
            _ => {
                let from = self.i;
                while self.s.get(self.i).is_some_and(|c| b"+-.eE0123456789".contains(c)) {
                    self.i += 1;
                }
                std::str::from_utf8(&self.s[from..self.i]).ok()?.parse().ok().map(Json::Number)
            }
        }
    }

    /// Escapes other than the simple ones do not occur in the files.
    fn string(&mut self) -> Option<String> {
        self.eat(b'"')?;
        let mut out = Vec::new();
        loop {
            match *self.s.get(self.i)? {
                b'"' => {
                    self.i += 1;
                    return String::from_utf8(out).ok();
                }
                b'\\' => {
                    out.push(*self.s.get(self.i + 1)?);
                    self.i += 2;
                }
                c => {
                    out.push(c);
                    self.i += 1;
                }
            }
        }
    }
}

/// A reference problem.
pub struct Reference {
    pub t_end: f64,
    pub x0: Vec<f64>,
    pub x_end: Vec<f64>,
    /// Time, kind (`cross[0]`, `enter_sliding[1]`), derivative of the time with respect to the initial state.
    pub switches: Vec<(f64, String, Vec<f64>)>,
    /// `∂x(T)/∂x0`, rows.
    pub sensitivity: Vec<Vec<f64>>,
    /// Times and states on the way.
    pub samples: Vec<(f64, Vec<f64>)>,
}

/// Reads the reference of this name; `None` where the references are not at hand.
pub fn load(name: &str) -> Option<Reference> {
    let path: PathBuf =
        [env!("CARGO_MANIFEST_DIR"), "..", "shared", "reference", &format!("{name}.json")].iter().collect();
    let j = Json::parse(&std::fs::read_to_string(path).ok()?)?;
    let switches = j.get("switches").list().iter();
    Some(Reference {
        t_end: j.get("T").number(),
        x0: j.get("x0").numbers(),
        x_end: j.get("x_T").numbers(),
        switches: switches
            .map(|s| (s.get("t").number(), s.get("kind").text().to_owned(), s.get("dt_dx0").numbers()))
            .collect(),
        sensitivity: j.get("sens_xT_x0").list().iter().map(Json::numbers).collect(),
        samples: j.get("samples").list().iter().map(|s| (s.get("t").number(), s.get("x").numbers())).collect(),
    })
}
