//! Options of the command: those of AMPL's solvers, and those of the solver of programs with complementarity constraints.

use std::fmt::Write as _;

use switchback::settings::{nearest, OptionInfo, Value, OPTIONS};
use switchback::{Error, MpccSettings, Result, Settings};

/// What a run is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Options of the solver.
    pub settings: Settings,
    /// Objective, from 1 on; 0 for none.
    pub objno: usize,
    /// 0 nothing, 1 the result, 2 the sizes of the problem too, 3 every iteration too.
    pub outlev: i64,
    /// A sum of 1 write a .sol file without -AMPL, 2 print the variables, 4 print the dual values, 8 do not print the result.
    pub wantsol: i64,
    /// Let variables that must be integers take other values.
    pub relax_integrality: bool,
}

impl Default for Options {
    fn default() -> Options {
        Options { settings: Settings::default(), objno: 1, outlev: 1, wantsol: 0, relax_integrality: false }
    }
}

/// Options of the command: name, largest value, default, description.
const OWN: [(&str, i64, i64, &str); 4] = [
    ("objno", i32::MAX as i64, 1, "Number of the objective; 0 for none."),
    ("outlev", 3, 1, "Output: 0 none, 1 the result, 2 sizes of the problem too, 3 iterations too."),
    ("relax_integrality", 1, 0, "Ignore that variables must be integers."),
    ("wantsol", 15, 0, "Sum of 1 write .sol without -AMPL, 2 print variables, 4 print dual values, 8 no result."),
];

/// Options of the solver that need no part of [`MpccSettings`].
const LIMITS: [&str; 2] = ["max_time", "max_memory"];

/// Has the option an effect on programs with complementarity constraints?
fn has_effect(o: &OptionInfo) -> bool {
    if LIMITS.contains(&o.name) {
        return true;
    }
    let usual = MpccSettings::default();
    let others = (0..9).map(Value::Int).chain([0.5, 2.0].map(|f| Value::Float(f * o.default)));
    let mut others = others.chain([Value::Float(1e-3)]);
    others.any(|v| {
        let mut s = Settings::default();
        s.set_by_name(o.name, v).is_ok() && MpccSettings::from(&s) != usual
    })
}

impl Options {
    /// Takes assignments `name=value`, `name = value` or `name value`.
    ///
    /// # Errors
    /// [`Error::Option`] for a name that is none, or a value of the wrong type; [`Error::Range`] for one outside its range.
    pub fn assign(&mut self, text: &str) -> Result<()> {
        let apart = text.replace('=', " ");
        let mut words = apart.split_whitespace().map(|w| w.trim_matches(|c| c == '"' || c == '\''));
        while let Some(name) = words.next() {
            let value = words.next();
            let value =
                value.ok_or_else(|| Error::Option(format!("option '{name}' has no value: write {name}=value")))?;
            self.set(name, value)?;
        }
        Ok(())
    }

    fn set(&mut self, name: &str, value: &str) -> Result<()> {
        if let Some((_, top, ..)) = OWN.iter().find(|o| o.0 == name) {
            let number = value.parse::<i64>();
            let number =
                number.map_err(|_| Error::Option(format!("option '{name}' takes an integer, not '{value}'")))?;
            if !(0..=*top).contains(&number) {
                return Err(Error::Range(format!("option '{name}' is {number}, outside [0, {top}]")));
            }
            match name {
                "objno" => self.objno = number as usize,
                "outlev" => self.outlev = number,
                "wantsol" => self.wantsol = number,
                _ => self.relax_integrality = number == 1,
            }
            return Ok(());
        }
        if name == "log_level" {
            return Err(Error::Option("option 'log_level' is outlev here: 0 none, 1 the result, 3 iterations".into()));
        }
        match OPTIONS.iter().find(|o| o.name == name) {
            Some(o) if has_effect(o) => self.settings.set_by_name(name, value),
            Some(_) => Err(Error::Option(format!(
                "option '{name}' is about systems that switch: it has no effect here, leave it out"
            ))),
            None => {
                let known = OWN.iter().map(|o| o.0).chain(OPTIONS.iter().filter(|o| has_effect(o)).map(|o| o.name));
                let hint = nearest(name, known).map_or_else(String::new, |n| format!("; did you mean '{n}'?"));
                Err(Error::Option(format!("unknown option '{name}'{hint} The flag -= lists all")))
            }
        }
    }
}

/// All options, their ranges and defaults, one a line.
pub fn list() -> String {
    let mut out = String::new();
    for (name, top, default, doc) in OWN {
        let _ = writeln!(out, "{name:20} {doc} [0, {top}], default {default}");
    }
    let usual = Settings::default();
    for o in OPTIONS.iter().filter(|o| has_effect(o)) {
        let _ = writeln!(out, "{:20} {} {}, default {}", o.name, o.doc, o.range_text(), o.get_text(&usual));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn assignments_in_all_forms() {
        let mut o = Options::default();
        o.assign("tol=1e-7 outlev = 3 max_iter 17 relaxation=scholtes wantsol=9 objno=0 max_time=2.5").unwrap();
        assert_eq!((o.settings.tol, o.outlev, o.settings.max_iter), (1e-7, 3, 17));
        assert_eq!((o.wantsol, o.objno, o.settings.max_time), (9, 0, 2.5));
        let error = |text: &str| Options::default().assign(text).unwrap_err().to_string();
        assert!(error("toll=1").contains("did you mean 'tol'?"), "{}", error("toll=1"));
        assert!(error("n_s=2").contains("no effect here"));
        assert!(error("tol").contains("no value"));
        assert!(error("outlev=4").contains("outside [0, 3]"));
        assert!(error("log_level=2").contains("outlev"));
        assert!(error("tol=2").contains("outside"));
    }

    #[test]
    fn the_list_has_what_the_solver_takes() {
        let all = list();
        let has = |name: &str| all.lines().any(|l| l.starts_with(&format!("{name} ")));
        for name in
            ["objno", "tol", "max_iter", "max_time", "max_memory", "sigma_min", "polish", "relaxation", "portfolio"]
        {
            assert!(has(name), "{name}");
        }
        for name in ["n_s", "rtol", "mode_search", "log_level", "explain", "initial_guess"] {
            assert!(!has(name), "{name}");
        }
    }
}
