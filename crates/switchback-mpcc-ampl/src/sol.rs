//! Solutions as AMPL reads them: `.sol` files in text form (D. M. Gay, *Hooking your solver to AMPL*, 1997).

use std::fmt::Write as _;

use crate::nl::Header;

/// What a value belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Variables.
    Variables = 0,
    /// Constraints.
    Constraints = 1,
    /// The problem.
    Problem = 3,
}

/// Values of a suffix, those that are not zero.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Integers.
    Int(Vec<(usize, i64)>),
    /// Numbers.
    Real(Vec<(usize, f64)>),
}

/// A suffix that goes back.
#[derive(Debug, Clone, PartialEq)]
pub struct Suffix {
    /// Its name.
    pub name: &'static str,
    /// What has it.
    pub kind: Kind,
    /// Its values.
    pub values: Values,
}

impl Suffix {
    /// A suffix of numbers.
    pub fn real(name: &'static str, kind: Kind, values: &[f64]) -> Suffix {
        let nonzero = values.iter().copied().enumerate().filter(|v| v.1 != 0.0 && v.1.is_finite());
        Suffix { name, kind, values: Values::Real(nonzero.collect()) }
    }

    /// A number of the problem.
    pub fn of_problem(name: &'static str, value: i64) -> Suffix {
        Suffix { name, kind: Kind::Problem, values: Values::Int(vec![(0, value)]) }
    }
}

/// A result for AMPL.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sol {
    /// What is shown; lines that are empty are left out.
    pub message: String,
    /// Dual values of the constraints, or none.
    pub duals: Vec<f64>,
    /// Values of the variables, or none.
    pub primals: Vec<f64>,
    /// The number of the objective, from 1 on, and 0 for none.
    pub objno: usize,
    /// `solve_result_num`.
    pub code: i32,
    /// Suffixes.
    pub suffixes: Vec<Suffix>,
}

impl Sol {
    /// The file.
    pub fn text(&self, header: &Header) -> String {
        let mut out = String::new();
        for line in self.message.lines().map(str::trim_end).filter(|l| !l.is_empty()) {
            out.push_str(line);
            out.push('\n');
        }
        let usual = [1, 1, 0];
        let options: &[i64] = if header.options.is_empty() { &usual } else { &header.options };
        // two more where a tolerance follows: that is how AMPL tells
        let n_options = options.len() + if header.tolerance.is_some() { 2 } else { 0 };
        let _ = write!(out, "\nOptions\n{n_options}\n");
        options.iter().for_each(|o| line(&mut out, o));
        let known = |values: &[f64]| values.iter().all(|v| v.is_finite());
        let duals: &[f64] = if known(&self.duals) { &self.duals } else { &[] };
        let primals: &[f64] = if known(&self.primals) { &self.primals } else { &[] };
        for n in [header.n_cons, duals.len(), header.n_vars, primals.len()] {
            line(&mut out, &n);
        }
        if let Some(t) = header.tolerance {
            line(&mut out, &format_args!("{t:e}"));
        }
        for v in duals.iter().chain(primals) {
            // a zero without its sign
            line(&mut out, &format_args!("{:e}", v + 0.0));
        }
        let _ = writeln!(out, "objno {} {}", self.objno.saturating_sub(1), self.code);
        self.suffixes.iter().for_each(|s| s.write(&mut out));
        out
    }
}

fn line(out: &mut String, value: &dyn std::fmt::Display) {
    let _ = writeln!(out, "{value}");
}

impl Suffix {
    fn write(&self, out: &mut String) {
        let (real, n) = match &self.values {
            Values::Int(v) => (0, v.len()),
            Values::Real(v) => (4, v.len()),
        };
        if n == 0 {
            return;
        }
        let _ = write!(out, "suffix {} {n} {} 0 0\n{}\n", self.kind as i32 | real, self.name.len() + 1, self.name);
        match &self.values {
            Values::Int(values) => values.iter().for_each(|(k, v)| line(out, &format_args!("{k} {v}"))),
            Values::Real(values) => values.iter().for_each(|(k, v)| line(out, &format_args!("{k} {v:e}"))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_as_ampl_reads_it() {
        let header =
            Header { options: vec![1, 3, 0], tolerance: Some(1e-3), n_vars: 2, n_cons: 1, ..Header::default() };
        let sol = Sol {
            message: "found\n\nobjective 1".into(),
            duals: vec![-0.5],
            primals: vec![1.0, -0.0],
            objno: 1,
            code: 0,
            suffixes: vec![
                Suffix::real("bound_dual", Kind::Variables, &[0.0, 2.5]),
                Suffix::real("empty", Kind::Constraints, &[0.0]),
                Suffix::of_problem("stationarity", 1),
            ],
        };
        let expected = "found\nobjective 1\n\nOptions\n5\n1\n3\n0\n1\n1\n2\n2\n1e-3\n-5e-1\n1e0\n0e0\nobjno 0 0\n\
                        suffix 4 1 11 0 0\nbound_dual\n1 2.5e0\nsuffix 3 1 13 0 0\nstationarity\n0 1\n";
        assert_eq!(sol.text(&header), expected);
        let unknown = Sol { primals: vec![f64::NAN, 1.0], ..sol };
        assert!(unknown.text(&header).contains("\n1\n1\n2\n0\n"), "{}", unknown.text(&header));
    }
}
