//! Checks derivatives against finite differences.

use std::fmt;

use super::fdiff::{self, step};
use super::{Dims, EvalError, EvalResult, Function, Point};
use crate::error::{Error, Result};
use crate::stop;

/// Relative step of the extrapolated central differences, `eps^(1/5)`.
const STEP: f64 = 7.4e-4;

/// Tolerances and choices of [`check_derivatives`].
#[derive(Debug, Clone, PartialEq)]
pub struct CheckSettings {
    /// Relative tolerance of the entries of the Jacobian.
    pub first: f64,
    /// Relative tolerance of the entries of the Hessian.
    pub second: f64,
    /// Derivatives below this size are compared absolutely: errors are relative to `max(|given|, |difference|, floor)`.
    pub floor: f64,
    /// Weights of the outputs in the Hessian; `None` takes fixed weights without pattern.
    pub weights: Option<Vec<f64>>,
    /// Compares the Hessian as well.
    pub hessian: bool,
    /// Checks the columns of `p` also where the Jacobian pattern declares none of them.
    ///
    /// A function without any entry there takes its parameters as constants, which is no mistake.
    pub parameters: bool,
}

impl Default for CheckSettings {
    fn default() -> Self {
        CheckSettings { first: 1e-6, second: 1e-5, floor: 1e-3, weights: None, hessian: true, parameters: false }
    }
}

/// Mistakes in an entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum MismatchKind {
    /// An entry of the Jacobian has the wrong value.
    Jacobian,
    /// The derivative does not vanish, but the Jacobian pattern has no such entry.
    JacobianPattern,
    /// An entry of the Hessian has the wrong value.
    Hessian,
    /// The second derivative does not vanish, but the Hessian pattern has no such entry.
    HessianPattern,
}

impl fmt::Display for MismatchKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            MismatchKind::Jacobian => "Jacobian value",
            MismatchKind::JacobianPattern => "missing in Jacobian pattern",
            MismatchKind::Hessian => "Hessian value",
            MismatchKind::HessianPattern => "missing in Hessian pattern",
        })
    }
}

/// One derivative that does not agree with the differences.
#[derive(Debug, Clone, PartialEq)]
pub struct Mismatch {
    /// The mistake.
    pub kind: MismatchKind,
    /// Row in the pattern: an output of the Jacobian, an input of the Hessian.
    pub row: usize,
    /// Column in the pattern: an input.
    pub col: usize,
    /// Row in words, such as `out[3]`, for the Hessian `x[1]`.
    pub row_name: String,
    /// Column in words, such as `x[2]` or `t`.
    pub col_name: String,
    /// Value of the function; zero where the pattern has no entry.
    pub given: f64,
    /// Value of the differences.
    pub difference: f64,
    /// Relative error, see [`CheckSettings::floor`].
    pub error: f64,
}

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}: ({}, {}) given {:.9e}, differences {:.9e}, relative error {:.1e}",
            self.kind, self.row_name, self.col_name, self.given, self.difference, self.error
        )
    }
}

/// Result of [`check_derivatives`].
#[derive(Debug, Clone, PartialEq)]
pub struct CheckReport {
    /// Name of the function.
    pub name: String,
    /// Disagreements, the worst first.
    pub mismatches: Vec<Mismatch>,
    /// Largest relative error of the Jacobian, accepted ones included.
    pub worst_first: f64,
    /// Largest relative error of the Hessian, accepted ones included.
    pub worst_second: f64,
    /// Entries compared, those outside the patterns included.
    pub n_compared: usize,
    /// Inputs that could not be moved without leaving the domain; their columns were not compared.
    pub skipped: Vec<String>,
}

impl CheckReport {
    /// True where nothing disagrees.
    pub fn passed(&self) -> bool {
        self.mismatches.is_empty()
    }
}

impl fmt::Display for CheckReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const SHOWN: usize = 20;
        write!(
            f,
            "derivatives of {}: {} entries compared, {} wrong; largest relative error {:.1e} (first), {:.1e} (second)",
            self.name,
            self.n_compared,
            self.mismatches.len(),
            self.worst_first,
            self.worst_second
        )?;
        for m in self.mismatches.iter().take(SHOWN) {
            write!(f, "\n  {m}")?;
        }
        if self.mismatches.len() > SHOWN {
            write!(f, "\n  and {} more", self.mismatches.len() - SHOWN)?;
        }
        if !self.skipped.is_empty() {
            write!(f, "\n  not compared (border of the domain): {}", self.skipped.join(", "))?;
        }
        Ok(())
    }
}

/// Compares the derivatives of a function at one point with finite differences: the Jacobian with those of
/// the value, the Hessian with those of the Jacobian.
///
/// All inputs are moved one by one, so that entries outside the declared patterns are found as well. The
/// differences are central, of two step sizes, extrapolated; what the two disagree by, and the rounding
/// errors, are granted on top of the tolerance. Near the border of the domain the step is reduced, then
/// one-sided differences are taken. A wrong Jacobian lets the Hessian look wrong too: mend it first.
/// Derivatives that are differences themselves pass unless their pattern is wrong; a missing entry then
/// spoils others as well, because columns are moved together. A Hessian by differences with all entries is not
/// looked at: nothing of it can be wrong, and of many inputs it would take long.
///
/// Where the size of a value makes its rounding errors large, so is what is granted: check at points of
/// moderate size.
///
/// Fails where the function or a derivative has no value at the point itself, or returns a negative code
/// anywhere.
pub fn check_derivatives(f: &dyn Function, at: &Point, settings: &CheckSettings) -> Result<CheckReport> {
    let dims = f.dims();
    let (n_in, m) = (dims.n_in(), f.n_out());
    for (what, given, expected) in [("x", at.x.len(), dims.x), ("u", at.u.len(), dims.u), ("p", at.p.len(), dims.p)] {
        if given != expected {
            return Err(Error::Dimension(format!(
                "{}: the point has {given} entries of {what}, expected {expected}",
                f.name()
            )));
        }
    }
    let inputs = [at.x, at.u, at.p, std::slice::from_ref(&at.t)];
    if inputs.iter().any(|block| block.iter().any(|v| !v.is_finite())) {
        return Err(Error::Range(format!("{}: the point of the check is not finite", f.name())));
    }
    let weights = match &settings.weights {
        Some(w) if w.len() != m => {
            return Err(Error::Dimension(format!("{}: {} weights for {m} outputs", f.name(), w.len())))
        }
        Some(w) => w.clone(),
        None => (0..m).map(|i| 1.0 + 0.5 * (2.399_963 * i as f64 + 0.7).sin()).collect(),
    };
    let fail = |e: EvalError, what: &str| match e {
        EvalError::Recoverable => {
            Error::NonFinite(format!("{}: {what} not defined at the point of the check", f.name()))
        }
        EvalError::Fatal(code) => Error::User { code, what: format!("{what} of {}", f.name()) },
        EvalError::Stopped => stop::error(),
    };

    let jp = f.jac_pattern();
    let hp = f.hess_pattern();
    let mut work = vec![0.0; f.work_len()];
    let mut value = vec![0.0; m];
    let mut jac = vec![0.0; jp.nnz()];
    let mut hess = vec![0.0; hp.nnz()];
    let full = hp.nnz() == n_in * (n_in + 1) / 2;
    let hessian = settings.hessian && !(full && f.hessian_is_approximate());
    f.value(at, &mut value, &mut work).map_err(|e| fail(e, "value"))?;
    f.jacobian(at, &mut jac, &mut work).map_err(|e| fail(e, "Jacobian"))?;
    if hessian {
        f.hessian(at, &weights, &mut hess, &mut work).map_err(|e| fail(e, "Hessian"))?;
    }

    let mut report = CheckReport {
        name: f.name().to_owned(),
        mismatches: Vec::new(),
        worst_first: 0.0,
        worst_second: 0.0,
        n_compared: 0,
        skipped: Vec::new(),
    };
    let p_cols = dims.x + dims.u..dims.t_col();
    let with_p = settings.parameters || p_cols.clone().any(|j| !jp.rows(j).is_empty());

    let mut column = Column::new(dims, at, m.max(n_in));
    let mut jac_moved = vec![0.0; jp.nnz()];
    for j in 0..n_in {
        if !with_p && p_cols.contains(&j) {
            continue;
        }
        let col_name = input_name(dims, j);

        let done = column
            .difference(j, m, f64::EPSILON, &mut |at, out| f.value(at, out, &mut work))
            .map_err(|e| fail(e, "value"))?;
        if !done {
            report.skipped.push(col_name);
            continue;
        }
        for i in 0..m {
            let (given, kind) = match jp.get(i, j) {
                Some(k) => (jac[k], MismatchKind::Jacobian),
                None => (0.0, MismatchKind::JacobianPattern),
            };
            let (error, wrong) = column.compare(i, given, settings.first, settings.floor);
            report.n_compared += 1;
            report.worst_first = report.worst_first.max(error);
            if wrong {
                report.mismatches.push(Mismatch {
                    kind,
                    row: i,
                    col: j,
                    row_name: format!("out[{i}]"),
                    col_name: col_name.clone(),
                    given,
                    difference: column.result[i],
                    error,
                });
            }
        }

        if !hessian {
            continue;
        }
        let noise = if f.jacobian_is_approximate() { 4.0 * fdiff::STEP_FIRST.powi(2) } else { f64::EPSILON };
        let done = column
            .difference(j, n_in, noise, &mut |at, out| {
                f.jacobian(at, &mut jac_moved, &mut work)?;
                for (c, o) in out.iter_mut().enumerate() {
                    let entries = jp.range(c);
                    *o = jp.rows(c).iter().zip(&jac_moved[entries]).map(|(&r, v)| weights[r] * v).sum();
                }
                Ok(())
            })
            .map_err(|e| fail(e, "Jacobian"))?;
        if !done {
            report.skipped.push(format!("{col_name} (second order)"));
            continue;
        }
        for i in 0..=j {
            if !with_p && p_cols.contains(&i) {
                continue;
            }
            let (given, kind) = match hp.get(i, j) {
                Some(k) => (hess[k], MismatchKind::Hessian),
                None => (0.0, MismatchKind::HessianPattern),
            };
            let (error, wrong) = column.compare(i, given, settings.second, settings.floor);
            report.n_compared += 1;
            report.worst_second = report.worst_second.max(error);
            if wrong {
                report.mismatches.push(Mismatch {
                    kind,
                    row: i,
                    col: j,
                    row_name: input_name(dims, i),
                    col_name: col_name.clone(),
                    given,
                    difference: column.result[i],
                    error,
                });
            }
        }
    }
    report.mismatches.sort_by(|a, b| b.error.total_cmp(&a.error));
    Ok(report)
}

/// Name of an input by its block, such as `x[2]`.
fn input_name(dims: Dims, j: usize) -> String {
    if j < dims.x {
        format!("x[{j}]")
    } else if j < dims.x + dims.u {
        format!("u[{}]", j - dims.x)
    } else if j < dims.t_col() {
        format!("p[{}]", j - dims.x - dims.u)
    } else {
        "t".to_owned()
    }
}

/// Extrapolated differences of a vector function along one input.
struct Column {
    dims: Dims,
    z: Vec<f64>,
    samples: [Vec<f64>; 4],
    /// Differences.
    result: Vec<f64>,
    /// Bound of their error.
    slack: Vec<f64>,
}

impl Column {
    fn new(dims: Dims, at: &Point, len: usize) -> Column {
        let mut z = vec![0.0; dims.n_in()];
        fdiff::gather(dims, at, &mut z);
        Column {
            dims,
            z,
            samples: std::array::from_fn(|_| vec![0.0; len]),
            result: vec![0.0; len],
            slack: vec![0.0; len],
        }
    }

    /// Differences of the first `m` outputs along input `j`; false where the domain is too narrow.
    ///
    /// `noise` is the relative error of the outputs.
    fn difference(
        &mut self,
        j: usize,
        m: usize,
        noise: f64,
        eval: &mut dyn FnMut(&Point, &mut [f64]) -> EvalResult,
    ) -> std::result::Result<bool, EvalError> {
        // Multiples of h, and the weights of the samples in the differences of step h/2 and of step h.
        const CENTRAL: Stencil = ([0.5, -0.5, 1.0, -1.0], [1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.5, -0.5]);
        const RIGHT: Stencil = ([0.0, 0.5, 1.0, 2.0], [-3.0, 4.0, -1.0, 0.0], [-1.5, 0.0, 2.0, -0.5]);
        const LEFT: Stencil = ([0.0, -0.5, -1.0, -2.0], [3.0, -4.0, 1.0, 0.0], [1.5, 0.0, -2.0, 0.5]);
        let tries =
            [(CENTRAL, 1.0), (CENTRAL, 0.1), (CENTRAL, 0.01), (LEFT, 0.5), (RIGHT, 0.5), (LEFT, 0.05), (RIGHT, 0.05)];
        for (stencil, scale) in tries {
            match self.stencil(j, m, noise, stencil, scale, eval) {
                Err(EvalError::Recoverable) => continue,
                other => return other.map(|()| true),
            }
        }
        Ok(false)
    }

    fn stencil(
        &mut self,
        j: usize,
        m: usize,
        noise: f64,
        (at, fine, coarse): Stencil,
        scale: f64,
        eval: &mut dyn FnMut(&Point, &mut [f64]) -> EvalResult,
    ) -> EvalResult {
        let v = self.z[j];
        let h = round_step(scale * step(STEP, v));
        for (multiple, out) in at.iter().zip(&mut self.samples) {
            self.z[j] = v + multiple * h;
            let done = eval(&fdiff::point(self.dims, &self.z), &mut out[..m]);
            self.z[j] = v;
            done?;
        }
        for i in 0..m {
            let sample = |w: &[f64; 4]| (0..4).map(|k| w[k] * self.samples[k][i]).sum::<f64>() / h;
            let (a, b) = (sample(&fine), sample(&coarse));
            let size = (0..4).map(|k| self.samples[k][i].abs()).fold(0.0, f64::max);
            self.result[i] = a + (a - b) / 3.0;
            self.slack[i] = 2.0 * (a - b).abs() / 3.0 + 10.0 * noise * size / h;
        }
        Ok(())
    }

    /// Relative error of a given value, and whether it is wrong.
    fn compare(&self, i: usize, given: f64, tol: f64, floor: f64) -> (f64, bool) {
        let d = self.result[i];
        let size = given.abs().max(d.abs()).max(floor);
        let gap = (given - d).abs();
        (gap / size, gap > tol * size + self.slack[i])
    }
}

/// Where to sample and the weights of two differences.
type Stencil = ([f64; 4], [f64; 4], [f64; 4]);

/// Power of two next to `h`, so that halving and doubling it is exact.
///
/// What `v + h` loses by rounding is `eps |v| / h` relative to the step, far below the tolerances.
fn round_step(h: f64) -> f64 {
    h.log2().round().exp2()
}

#[cfg(test)]
mod tests {
    use super::super::Callback;
    use super::*;
    use crate::linalg::csc::Pattern;

    const DIMS: Dims = Dims { x: 2, u: 1, p: 1 };

    fn at() -> Point<'static> {
        Point { t: 0.3, x: &[0.8, -1.4], u: &[0.6], p: &[2.0] }
    }

    fn pattern(m: usize, n: usize, entries: &[(usize, usize)]) -> Pattern {
        let rows: Vec<usize> = entries.iter().map(|e| e.0).collect();
        let cols: Vec<usize> = entries.iter().map(|e| e.1).collect();
        Pattern::from_triplets(m, n, &rows, &cols).0
    }

    /// `(x0 x1², p sin(u))`, p constant unless asked for.
    fn value(at: &Point, out: &mut [f64]) -> i32 {
        out[0] = at.x[0] * at.x[1] * at.x[1];
        out[1] = at.p[0] * at.u[0].sin();
        0
    }

    fn function(first: f64, second: f64) -> Callback {
        Callback::new("f", DIMS, 2, value)
            .with_jacobian(pattern(2, 5, &[(0, 0), (0, 1), (1, 2)]), move |at, out| {
                out[0] = at.x[1] * at.x[1];
                out[1] = first * 2.0 * at.x[0] * at.x[1];
                out[2] = at.p[0] * at.u[0].cos();
                0
            })
            .unwrap()
            .with_hessian(pattern(5, 5, &[(0, 1), (1, 1), (2, 2)]), move |at, w, out| {
                out[0] = w[0] * 2.0 * at.x[1];
                out[1] = w[0] * 2.0 * at.x[0];
                out[2] = -second * w[1] * at.p[0] * at.u[0].sin();
                0
            })
            .unwrap()
    }

    #[test]
    fn correct_derivatives_pass() {
        let r = check_derivatives(&function(1.0, 1.0), &at(), &CheckSettings::default()).unwrap();
        assert!(r.passed(), "{r}");
        assert!(r.worst_first < 1e-10 && r.worst_second < 1e-10, "{r}");
        assert!(r.skipped.is_empty());
        // Four columns (p is left out): two outputs each, and a triangle of four.
        assert_eq!(r.n_compared, 8 + 10);
    }

    #[test]
    fn a_wrong_jacobian_value_is_found() {
        let settings = CheckSettings { hessian: false, ..Default::default() };
        let r = check_derivatives(&function(1.00001, 1.0), &at(), &settings).unwrap();
        assert_eq!(r.mismatches.len(), 1);
        let m = &r.mismatches[0];
        assert_eq!((m.kind, m.row, m.col), (MismatchKind::Jacobian, 0, 1));
        assert_eq!((m.row_name.as_str(), m.col_name.as_str()), ("out[0]", "x[1]"));
        assert!((m.error - 1e-5).abs() < 1e-8);
        assert!(r.to_string().contains("(out[0], x[1])"), "{r}");
    }

    #[test]
    fn a_wrong_hessian_value_is_found() {
        let r = check_derivatives(&function(1.0, 1.001), &at(), &CheckSettings::default()).unwrap();
        assert_eq!(r.mismatches.len(), 1, "{r}");
        let m = &r.mismatches[0];
        assert_eq!(m.kind, MismatchKind::Hessian);
        assert_eq!((m.row_name.as_str(), m.col_name.as_str()), ("u[0]", "u[0]"));
    }

    #[test]
    fn missing_entries_are_found_worst_first() {
        let f = Callback::new("f", DIMS, 2, |at, out| {
            value(at, out);
            out[1] += 1e-3 * at.t * at.x[0];
            0
        })
        .with_jacobian(pattern(2, 5, &[(0, 0), (1, 0), (0, 1)]), |at, out| {
            out[0] = at.x[1] * at.x[1];
            out[1] = 1e-3 * at.t;
            out[2] = 2.0 * at.x[0] * at.x[1];
            0
        })
        .unwrap()
        .with_hessian_pattern(pattern(5, 5, &[(0, 1)]))
        .unwrap();
        let r = check_derivatives(&f, &at(), &CheckSettings::default()).unwrap();
        let found = |kind, row, col| r.mismatches.iter().any(|m| (m.kind, m.row, m.col) == (kind, row, col));
        assert!(found(MismatchKind::JacobianPattern, 1, 2), "{r}");
        assert!(found(MismatchKind::JacobianPattern, 1, 4), "{r}");
        assert!(found(MismatchKind::HessianPattern, 1, 1), "{r}");
        assert!(found(MismatchKind::HessianPattern, 0, 4), "{r}");
        // The missing (x[1], x[1]) spoils the differences of its colour: (x[0], x[1]) is wrong as well.
        assert!(found(MismatchKind::Hessian, 0, 1), "{r}");
        assert_eq!(r.mismatches.len(), 5, "{r}");
        assert!(r.mismatches.windows(2).all(|w| w[0].error >= w[1].error));
    }

    #[test]
    fn parameters_are_constants_unless_declared_or_asked_for() {
        let f = function(1.0, 1.0);
        let settings = CheckSettings { parameters: true, ..Default::default() };
        let r = check_derivatives(&f, &at(), &settings).unwrap();
        assert!(r.mismatches.iter().any(|m| m.kind == MismatchKind::JacobianPattern && m.col_name == "p[0]"));
    }

    #[test]
    fn approximate_derivatives_pass() {
        for f in [
            Callback::new("f", DIMS, 2, value),
            Callback::new("f", DIMS, 2, value)
                .with_jacobian_pattern(pattern(2, 5, &[(0, 0), (0, 1), (1, 2), (1, 3)]))
                .unwrap(),
        ] {
            let r = check_derivatives(&f, &at(), &CheckSettings::default()).unwrap();
            assert!(r.passed(), "{r}");
        }
    }

    #[test]
    fn the_border_of_the_domain_is_checked_from_inside() {
        let dims = Dims { x: 1, u: 0, p: 0 };
        let f = |factor: f64| {
            Callback::new("f", dims, 1, |at, out| {
                out[0] = at.x[0].exp();
                i32::from(at.x[0] < 1.0)
            })
            .with_jacobian(pattern(1, 2, &[(0, 0)]), move |at, out| {
                out[0] = factor * at.x[0].exp();
                0
            })
            .unwrap()
        };
        let at = Point { t: 0.0, x: &[1.0], u: &[], p: &[] };
        let r = check_derivatives(&f(1.0), &at, &CheckSettings::default()).unwrap();
        assert!(r.passed() && r.skipped.is_empty(), "{r}");
        let r = check_derivatives(&f(1.0001), &at, &CheckSettings::default()).unwrap();
        assert!(!r.passed());
    }

    #[test]
    fn columns_without_room_are_skipped() {
        let dims = Dims { x: 1, u: 0, p: 0 };
        let f = Callback::new("f", dims, 1, |at, out| {
            out[0] = 1.0;
            i32::from(at.x[0] != 1.0)
        })
        .with_jacobian_pattern(pattern(1, 2, &[]))
        .unwrap();
        let at = Point { t: 0.0, x: &[1.0], u: &[], p: &[] };
        let r = check_derivatives(&f, &at, &CheckSettings::default()).unwrap();
        assert_eq!(r.skipped, ["x[0]"]);
        assert!(r.to_string().contains("x[0]"));
    }

    #[test]
    fn failures() {
        let dims = Dims { x: 1, u: 0, p: 0 };
        let f = |code: i32| Callback::new("f", dims, 1, move |_, _| code);
        let at = Point { t: 0.0, x: &[1.0], u: &[], p: &[] };
        let check = |code, at: &Point, s: &CheckSettings| check_derivatives(&f(code), at, s);
        let s = CheckSettings::default();
        assert!(matches!(check(1, &at, &s), Err(Error::NonFinite(_))));
        assert!(matches!(check(-3, &at, &s), Err(Error::User { code: -3, .. })));
        let short = Point { x: &[], ..at };
        assert!(matches!(check(0, &short, &s), Err(Error::Dimension(_))));
        let nan = Point { t: f64::NAN, ..at };
        assert!(matches!(check(0, &nan, &s), Err(Error::Range(_))));
        let s = CheckSettings { weights: Some(vec![1.0; 2]), ..s };
        assert!(matches!(check(0, &at, &s), Err(Error::Dimension(_))));
    }
}
