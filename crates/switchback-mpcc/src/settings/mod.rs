//! Settings of discretisation and solver: one sized struct, one table that describes it.
//!
//! Names, defaults, ranges and descriptions are written once, in `options.toml` beside this file. What is made of it is
//! the struct [`Settings`], the fast door (C programs fill it directly), and the table [`OPTIONS`], the other one: set and get
//! by name, with introspection for bindings and a hint when a name is misspelt.
//!
//! Leaf module: knows [`crate::error`] only. It judges single values and simple pairs of values; what a
//! combination means for a problem is checked where the problem is built.

use crate::error::{Error, Result};
use std::fmt::Write as _;

mod names;
#[rustfmt::skip]
mod options;

pub use names::{nearest, shortened};
pub use options::*;

/// A value on its way to or from an option.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// For integer and enumeration options, and for float options.
    Int(i64),
    /// For float options.
    Float(f64),
    /// For every option: a number as text, or the value name of an enumeration.
    Text(String),
}

impl From<i64> for Value {
    fn from(v: i64) -> Self {
        Value::Int(v)
    }
}
impl From<f64> for Value {
    fn from(v: f64) -> Self {
        Value::Float(v)
    }
}
impl From<&str> for Value {
    fn from(v: &str) -> Self {
        Value::Text(v.to_owned())
    }
}

/// On or off, all or none.
impl From<bool> for Sensitivity {
    fn from(on: bool) -> Self {
        if on {
            Sensitivity::On
        } else {
            Sensitivity::Off
        }
    }
}

/// Kind of an option.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Integer.
    Int,
    /// Floating-point number.
    Float,
    /// Enumeration: the names of the values 0, 1, ...
    Enum(&'static [&'static str]),
}

/// An end of a range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// The value itself is allowed.
    Closed(f64),
    /// The value itself is not allowed.
    Open(f64),
}

impl Bound {
    /// Number of this end.
    pub fn value(self) -> f64 {
        match self {
            Bound::Closed(v) | Bound::Open(v) => v,
        }
    }

    /// True where the number itself is outside the range.
    pub fn is_open(self) -> bool {
        matches!(self, Bound::Open(_))
    }
}

/// Description of one option: a row of [`OPTIONS`].
pub struct OptionInfo {
    /// Name, equal to the field of [`Settings`].
    pub name: &'static str,
    /// Key of the group it belongs to in the documentation.
    pub group: &'static str,
    /// Kind, with the value names of enumerations.
    pub kind: Kind,
    /// Default; integers and enumeration values are exact in f64.
    pub default: f64,
    /// Lower end of the range.
    pub min: Bound,
    /// Upper end of the range.
    pub max: Bound,
    /// Symbol in the literature, or empty.
    pub symbol: &'static str,
    /// Description in one sentence.
    pub doc: &'static str,
    /// True where it is fixed once the object is built, since it shapes the problem; else it is free between solves.
    pub setup_only: bool,
    /// Byte offset in [`Settings`].
    pub offset: usize,
    get: fn(&Settings) -> f64,
    set: fn(&mut Settings, f64),
}

use Bound::{Closed, Open};

impl OptionInfo {
    /// Current value in `settings`.
    pub fn get(&self, settings: &Settings) -> Value {
        match self.kind {
            Kind::Float => Value::Float((self.get)(settings)),
            Kind::Int | Kind::Enum(_) => Value::Int((self.get)(settings) as i64),
        }
    }

    /// Current value in `settings` as text: the value name of an enumeration, else a number that reads
    /// back to the same bits.
    pub fn get_text(&self, settings: &Settings) -> String {
        let v = (self.get)(settings);
        match self.kind {
            Kind::Float => float_text(v),
            Kind::Int => format!("{}", v as i64),
            Kind::Enum(names) => match names.get(v as usize) {
                Some(name) if v >= 0.0 => (*name).to_owned(),
                _ => format!("{}", v as i64),
            },
        }
    }

    /// True where the number is inside the range of this option. NaN never is.
    pub fn contains(&self, v: f64) -> bool {
        (match self.min {
            Closed(a) => v >= a,
            Open(a) => v > a,
        }) && match self.max {
            Closed(b) => v <= b,
            Open(b) => v < b,
        }
    }

    /// Range as text: `[1, 9]`, `(0, inf)`, or the value names of an enumeration.
    pub fn range_text(&self) -> String {
        if let Kind::Enum(names) = self.kind {
            return names.join(" | ");
        }
        let (left, right) = (if self.min.is_open() { '(' } else { '[' }, if self.max.is_open() { ')' } else { ']' });
        format!("{left}{}, {}{right}", self.min.value(), self.max.value())
    }

    fn check(&self, v: f64) -> Result<()> {
        if self.contains(v) {
            return Ok(());
        }
        Err(Error::Range(match self.kind {
            Kind::Enum(_) => format!("option '{}' is {v}, which is none of {}", self.name, self.enum_text()),
            _ => format!("option '{}' is {v}, outside {}", self.name, self.range_text()),
        }))
    }

    fn enum_text(&self) -> String {
        let Kind::Enum(names) = self.kind else {
            return String::new();
        };
        let pairs: Vec<String> = names.iter().enumerate().map(|(i, n)| format!("{i} ({n})")).collect();
        pairs.join(", ")
    }

    /// Number for this option out of a value of any type.
    fn number(&self, value: &Value) -> Result<f64> {
        match (self.kind, value) {
            (Kind::Float, Value::Float(v)) => Ok(*v),
            (_, Value::Int(v)) => {
                // Beyond 2^53 an integer is not exact in f64; no range reaches that far.
                if v.unsigned_abs() > 1 << 53 {
                    return Err(Error::Range(format!("option '{}' is {v}, outside {}", self.name, self.range_text())));
                }
                Ok(*v as f64)
            }
            (Kind::Int | Kind::Enum(_), Value::Float(v)) => {
                Err(Error::Option(format!("option '{}' takes {}, not the float {v}", self.name, self.kind_text())))
            }
            (Kind::Float, Value::Text(t)) => t.trim().parse::<f64>().map_err(|_| self.not_a_value(t)),
            (Kind::Int, Value::Text(t)) => {
                let v = t.trim().parse::<i64>().map_err(|_| self.not_a_value(t))?;
                self.number(&Value::Int(v))
            }
            (Kind::Enum(names), Value::Text(t)) => {
                let t = t.trim();
                if let Some(i) = names.iter().position(|n| *n == t) {
                    return Ok(i as f64);
                }
                match t.parse::<i64>() {
                    Ok(v) => self.number(&Value::Int(v)),
                    Err(_) => Err(self.not_a_value(t)),
                }
            }
        }
    }

    fn kind_text(&self) -> &'static str {
        match self.kind {
            Kind::Int => "an integer",
            Kind::Float => "a number",
            Kind::Enum(_) => "a value name or its integer",
        }
    }

    fn not_a_value(&self, text: &str) -> Error {
        let mut message = format!("option '{}' takes {}, not '{}'", self.name, self.kind_text(), shortened(text));
        if let Kind::Enum(names) = self.kind {
            match nearest(text, names.iter().copied()) {
                Some(n) => message += &format!("; did you mean '{n}'?"),
                None => message += &format!("; one of {}", names.join(", ")),
            }
        }
        Error::Option(message)
    }
}

/// Row of an option by name; the error names the nearest option.
pub fn option(name: &str) -> Result<&'static OptionInfo> {
    OPTIONS.iter().find(|o| o.name == name).ok_or_else(|| {
        let hint = match nearest(name, OPTIONS.iter().map(|o| o.name)) {
            Some(n) => format!("; did you mean '{n}'?"),
            None => String::new(),
        };
        Error::Option(format!("unknown option '{}'{hint}", shortened(name)))
    })
}

impl Settings {
    /// Set an option by name. An unknown name or a value of the wrong type is [`Error::Option`], a value
    /// outside the range [`Error::Range`]; the settings are then unchanged.
    pub fn set_by_name(&mut self, name: &str, value: impl Into<Value>) -> Result<()> {
        let o = option(name)?;
        let v = o.number(&value.into())?;
        o.check(v)?;
        (o.set)(self, v);
        Ok(())
    }

    /// Value of an option by name; enumerations as integers.
    pub fn get_by_name(&self, name: &str) -> Result<Value> {
        Ok(option(name)?.get(self))
    }

    /// Check every value against its range, and the pairs that belong together.
    pub fn validate(&self) -> Result<()> {
        for o in OPTIONS {
            o.check((o.get)(self))?;
        }
        if self.sigma_min > self.sigma_init {
            return Err(Error::Range(format!(
                "option 'sigma_min' is {:e}, above 'sigma_init' {:e}",
                self.sigma_min, self.sigma_init
            )));
        }
        Ok(())
    }

    /// Check like [`Settings::validate`], and that nothing changed since `setup` that shapes the problem.
    pub fn validate_as_update(&self, setup: &Settings) -> Result<()> {
        self.validate()?;
        for o in OPTIONS.iter().filter(|o| o.setup_only) {
            if (o.get)(self) != (o.get)(setup) {
                return Err(Error::State(format!(
                    "option '{}' is fixed at setup: it was {}, not {}",
                    o.name,
                    o.get_text(setup),
                    o.get_text(self)
                )));
            }
        }
        Ok(())
    }

    /// All options as one JSON object; enumerations by value name, infinite values as text.
    pub fn to_json(&self) -> String {
        let mut out = String::from("{");
        for (i, o) in OPTIONS.iter().enumerate() {
            let text = o.get_text(self);
            let quoted = matches!(o.kind, Kind::Enum(_)) || !(o.get)(self).is_finite();
            let quote = if quoted { "\"" } else { "" };
            let comma = if i == 0 { "" } else { ", " };
            let _ = write!(out, "{comma}\"{}\": {quote}{text}{quote}", o.name);
        }
        out.push('}');
        out
    }

    /// [`LogLevel`] of these settings; a number outside means the nearest level.
    pub fn verbosity(&self) -> LogLevel {
        LogLevel::from_i64(self.log_level.clamp(0, LogLevel::Trace as i64)).unwrap_or(LogLevel::Silent)
    }
}

fn bad(name: &str, value: i64) -> Error {
    match option(name).and_then(|o| o.check(value as f64)) {
        Err(e) => e,
        Ok(()) => Error::Internal(format!("value {value} of option '{name}' has no name")),
    }
}

/// Shortest text that reads back to the same number, in the notation of C and JSON.
fn float_text(v: f64) -> String {
    if v.is_infinite() {
        return if v > 0.0 { "inf".into() } else { "-inf".into() };
    }
    let plain = format!("{v:?}");
    let scientific = format!("{v:e}");
    if scientific.len() < plain.len() {
        scientific
    } else {
        plain
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_tiles_the_struct() {
        let mut next = 8; // behind struct_size
        for o in OPTIONS {
            assert_eq!(o.offset, next, "option {}", o.name);
            next += 8;
        }
        assert_eq!(next, std::mem::size_of::<Settings>());
        assert_eq!(std::mem::align_of::<Settings>(), 8);
    }

    #[test]
    fn defaults_are_valid() {
        let s = Settings::default();
        s.validate().unwrap();
        assert_eq!(s.struct_size, std::mem::size_of::<Settings>() as u64);
        assert_eq!((s.n_s, s.n_fe, s.max_iter, s.step_equilibration), (3, 3, 3000, 2));
        assert_eq!(s.rk_family(), Ok(RkFamily::RadauIia));
        assert!(s.max_time.is_infinite() && s.polish());
        for o in OPTIONS {
            assert!(o.contains(o.default), "{}", o.name);
            assert!(!o.contains(f64::NAN), "{}", o.name);
            assert!(o.doc.ends_with('.') && !o.doc.contains('\n'), "{}", o.name);
        }
    }

    #[test]
    fn names_follow_values() {
        for (i, name) in StepEquilibration::NAMES.iter().enumerate() {
            assert_eq!(StepEquilibration::from_i64(i as i64).unwrap().name(), *name);
        }
        assert_eq!(RkFamily::from_i64(7), None);
        assert_eq!(RkFamily::from_i64(-1), None);
    }

    #[test]
    fn every_option_goes_round_by_text() {
        let mut s = Settings::default();
        for o in OPTIONS {
            let before = o.get_text(&s);
            s.set_by_name(o.name, before.as_str()).unwrap();
            assert_eq!(o.get_text(&s), before);
            assert_eq!(s.get_by_name(o.name).unwrap(), o.get(&s));
        }
        assert_eq!(s, Settings::default());
    }

    #[test]
    fn set_checks_type_and_range() {
        let mut s = Settings::default();
        s.set_by_name("tol", 1e-6).unwrap();
        s.set_by_name("n_s", 4i64).unwrap();
        s.set_by_name("rho_h", 2i64).unwrap();
        s.set_by_name("rk_family", "gauss_legendre").unwrap();
        s.set_by_name("max_time", "inf").unwrap();
        assert_eq!((s.tol, s.n_s, s.rho_h, s.rk_family), (1e-6, 4, 2.0, 1));
        let before = s;
        for (name, value, code) in [
            ("tol", Value::Float(0.0), -3),
            ("tol", Value::Float(1.0), -3),
            ("tol", Value::Float(f64::NAN), -3),
            ("gamma_h", Value::Float(1.5), -3),
            ("n_s", Value::Int(10), -3),
            ("n_s", Value::Int(i64::MIN), -3),
            ("n_s", Value::Float(2.0), -6),
            ("n_s", Value::Text("two".into()), -6),
            ("n_s", Value::Text("2.5".into()), -6),
            ("cross", Value::Int(4), -3),
            ("cross", Value::Text("elemnt".into()), -6),
            ("max_time", Value::Text("nan".into()), -3),
            ("none_such", Value::Int(0), -6),
            ("struct_size", Value::Int(0), -6),
        ] {
            let e = s.set_by_name(name, value.clone()).unwrap_err();
            assert_eq!(e.code(), code, "{name} {value:?}: {e}");
        }
        assert_eq!(s, before);
    }

    #[test]
    fn misspelt_names_are_recognised() {
        let hint = |name: &str| option(name).err().unwrap().to_string();
        assert_eq!(hint("tolr"), "unknown option 'tolr'; did you mean 'tol'?");
        assert_eq!(hint("max_itre"), "unknown option 'max_itre'; did you mean 'max_iter'?");
        assert_eq!(hint("max-iter"), "unknown option 'max-iter'; did you mean 'max_iter'?");
        assert_eq!(hint("discretization"), "unknown option 'discretization'; did you mean 'discretisation'?");
        assert_eq!(hint("frobnicate_all"), "unknown option 'frobnicate_all'");
        let e = Settings::default().set_by_name("cross", "elemnt").unwrap_err().to_string();
        assert!(e.ends_with("did you mean 'element'?"), "{e}");
    }

    #[test]
    fn validate_finds_bad_fields_and_pairs() {
        let bad = |change: fn(&mut Settings)| {
            let mut s = Settings::default();
            change(&mut s);
            s.validate().unwrap_err().to_string()
        };
        assert_eq!(bad(|s| s.tol = -1.0), "option 'tol' is -1, outside (0, 1)");
        assert_eq!(bad(|s| s.n_s = 0), "option 'n_s' is 0, outside [1, 9]");
        assert!(bad(|s| s.polish = 7).contains("none of 0 (off), 1 (on)"));
        assert!(bad(|s| s.sigma_init = 1e-12).contains("sigma_min"));
        let (old, mut new) = (Settings::default(), Settings::default());
        new.tol = 1e-7;
        new.validate_as_update(&old).unwrap();
        new.n_s = 4;
        assert_eq!(new.validate_as_update(&old).unwrap_err().code(), -4);
    }

    #[test]
    fn json_is_complete() {
        let json = Settings::default().to_json();
        assert!(json.starts_with("{\"rk_family\": \"radau_iia\", \"n_s\": 3, "), "{json}");
        assert!(json.contains("\"max_time\": \"inf\"") && json.contains("\"tol\": 1e-9"), "{json}");
        assert_eq!(json.matches(": ").count(), OPTIONS.len());
    }
}
