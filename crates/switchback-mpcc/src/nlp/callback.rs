//! A nonlinear program made of functions.

use std::sync::Arc;

use super::problem::Nlp;
use crate::error::{Error, Result};
use crate::func::{EvalError, EvalResult, Function, Point};
use crate::linalg::csc::Pattern;
use crate::random::SplitMix64;
use crate::stop;

/// A function at `Point { t: 0, x: w, u: [], p }`, and where its derivatives go.
struct Part {
    f: Arc<dyn Function>,
    /// Which of value, Jacobian and Hessian had no value last.
    undefined: Option<&'static str>,
    work: Vec<f64>,
    /// Values of the Jacobian; those of the variables come first.
    jac: Vec<f64>,
    /// Values of the Hessian, and the entry of the merged pattern each of them is added to, if any.
    hess: Vec<f64>,
    hess_map: Vec<Option<usize>>,
}

impl Part {
    fn new(f: Arc<dyn Function>) -> Part {
        Part {
            work: vec![0.0; f.work_len()],
            jac: vec![0.0; f.jac_pattern().nnz()],
            hess: vec![0.0; f.hess_pattern().nnz()],
            hess_map: Vec::new(),
            undefined: None,
            f,
        }
    }

    fn note(&mut self, part: &'static str, r: EvalResult) -> EvalResult {
        if r == Err(EvalError::Recoverable) {
            self.undefined = Some(part);
        }
        r
    }

    fn value(&mut self, at: &Point, out: &mut [f64]) -> EvalResult {
        let r = self.f.value(at, out, &mut self.work);
        self.note("value", r)
    }

    fn jacobian(&mut self, at: &Point) -> EvalResult {
        let r = self.f.jacobian(at, &mut self.jac, &mut self.work);
        self.note("Jacobian", r)
    }

    /// Adds mixed second derivatives by variables, which are the first `n` inputs, and parameters.
    fn add_mixed(&mut self, at: &Point, weights: &[f64], n: usize, to: &mut [ParameterChange]) -> EvalResult {
        let r = self.f.hessian(at, weights, &mut self.hess, &mut self.work);
        self.note("Hessian", r)?;
        let p = self.f.hess_pattern();
        for (k, c) in to.iter_mut().enumerate() {
            let entries = p.range(n + k).map(|e| (p.row_idx()[e], self.hess[e]));
            c.gradient.extend(entries.filter(|(i, v)| *i < n && *v != 0.0));
        }
        Ok(())
    }

    fn add_hessian(&mut self, at: &Point, weights: &[f64], out: &mut [f64]) -> EvalResult {
        let r = self.f.hessian(at, weights, &mut self.hess, &mut self.work);
        self.note("Hessian", r)?;
        for (v, k) in self.hess.iter().zip(&self.hess_map) {
            if let Some(k) = k {
                out[*k] += v;
            }
        }
        Ok(())
    }
}

/// The Hessian of the Lagrangian in one piece: `(at, weight of f, y[m], out[nnz])` writes the entries of the pattern.
pub type LagrangianFn = dyn Fn(&Point, f64, &[f64], &mut [f64]) -> EvalResult + Send + Sync;

/// `min f(w, p)` subject to bounds on `w` and `c(w, p)`, with `f` and `c` given as [`Function`]s.
///
/// The variables are the block `x` of the functions, the parameters their block `p`; there are no controls and
/// the time is 0. Patterns are merged when it is made; evaluating allocates nothing.
pub struct CallbackNlp {
    n: usize,
    params: Vec<f64>,
    objective: Part,
    constraints: Option<Part>,
    /// Takes the place of the Hessians of objective and constraints.
    lagrangian: Option<Arc<LagrangianFn>>,
    jac: Pattern,
    hess: Pattern,
    /// Outputs of the constraints.
    m: usize,
}

impl CallbackNlp {
    /// Checks that the functions are those of a problem in `n` variables and `np` parameters; returns its rows.
    pub fn check(n: usize, np: usize, objective: &dyn Function, constraints: Option<&dyn Function>) -> Result<usize> {
        if n == 0 {
            return Err(Error::Dimension("a problem needs at least one variable".into()));
        }
        for f in std::iter::once(objective).chain(constraints) {
            let d = f.dims();
            if (d.x, d.u, d.p) != (n, 0, np) {
                return Err(Error::Dimension(format!(
                    "function '{}' takes (x, u, p) of sizes ({}, {}, {}), expected ({n}, 0, {np})",
                    f.name(),
                    d.x,
                    d.u,
                    d.p
                )));
            }
        }
        if objective.n_out() != 1 {
            return Err(Error::Dimension(format!(
                "objective '{}' has {} outputs, expected 1",
                objective.name(),
                objective.n_out()
            )));
        }
        Ok(constraints.map_or(0, |c| c.n_out()))
    }

    /// A problem in `n` variables and `np` parameters, which are zero until they are set.
    pub fn new(
        n: usize,
        np: usize,
        objective: Arc<dyn Function>,
        constraints: Option<Arc<dyn Function>>,
    ) -> Result<CallbackNlp> {
        let m = CallbackNlp::check(n, np, &*objective, constraints.as_deref())?;
        let jac = match &constraints {
            Some(c) => columns(c.jac_pattern(), m, n)?,
            None => Pattern::empty(0, n),
        };
        let (mut rows, mut cols) = (Vec::new(), Vec::new());
        let mut objective = Part::new(objective);
        let mut constraints = constraints.map(Part::new);
        let mut places = Vec::new();
        for part in std::iter::once(&objective).chain(&constraints) {
            let p = part.f.hess_pattern();
            for j in 0..p.n_cols() {
                for &i in p.rows(j) {
                    // upper triangle: the row of an entry is no parameter unless the column is one
                    places.push((j < n).then_some(rows.len()));
                    if j < n {
                        rows.push(i);
                        cols.push(j);
                    }
                }
            }
        }
        let (hess, map) = Pattern::from_triplets(n, n, &rows, &cols);
        let mut places = places.into_iter().map(|place| place.map(|k: usize| map[k]));
        for part in std::iter::once(&mut objective).chain(&mut constraints) {
            part.hess_map = places.by_ref().take(part.hess.len()).collect();
        }
        Ok(CallbackNlp { n, params: vec![0.0; np], objective, constraints, lagrangian: None, jac, hess, m })
    }

    /// Takes second derivatives from one function for all, with a pattern `n × n`, upper triangle.
    pub fn with_lagrangian(mut self, pattern: Pattern, hessian: Arc<LagrangianFn>) -> Result<CallbackNlp> {
        let (n, rows, cols) = (self.n, pattern.n_rows(), pattern.n_cols());
        if (rows, cols) != (n, n) {
            return Err(Error::Dimension(format!("Hessian of the Lagrangian: {rows} x {cols}, expected {n} x {n}")));
        }
        if !pattern.is_upper() {
            return Err(Error::Range("Hessian of the Lagrangian: entries below the diagonal".into()));
        }
        self.hess = pattern;
        self.lagrangian = Some(hessian);
        Ok(self)
    }

    /// The function that had no value somewhere since [`CallbackNlp::forget_undefined`], and which part of it, the
    /// objective first.
    pub fn undefined(&self) -> Option<(&str, &'static str)> {
        std::iter::once(&self.objective).chain(&self.constraints).find_map(|p| Some((p.f.name(), p.undefined?)))
    }

    /// Forgets what had no value.
    pub fn forget_undefined(&mut self) {
        std::iter::once(&mut self.objective).chain(&mut self.constraints).for_each(|p| p.undefined = None);
    }

    /// Sets the parameters.
    pub fn set_params(&mut self, p: &[f64]) -> Result<()> {
        if p.len() != self.params.len() {
            return Err(Error::Dimension(format!("{} parameters given, expected {}", p.len(), self.params.len())));
        }
        if let Some(i) = p.iter().position(|v| !v.is_finite()) {
            return Err(Error::Range(format!("parameter {i} is {}: it must be finite", p[i])));
        }
        self.params.copy_from_slice(p);
        Ok(())
    }
}

/// What a unit of a parameter does while the variables are held.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ParameterChange {
    /// To the objective.
    pub objective: f64,
    /// To the gradient of the Lagrangian by the variables: variable and change.
    pub gradient: Vec<(usize, f64)>,
    /// To the rows.
    pub rows: Vec<(usize, f64)>,
}

/// Step of differences in the parameters, relative to them: with errors of functions and their gradients of about `ε`, and of
/// `√ε` where gradients are differences themselves, theirs are far below [`DOUBT`].
const STEP: f64 = 1e-4;
/// Difference between derivatives that were given and those found, relative to the larger of both, from which they are not the same.
const DOUBT: f64 = 1e-2;
/// Rounding of a value or gradient at most, relative to the terms it is made of; and of one that is finite differences.
const ROUNDING: f64 = 1e-12;
const ROUNDING_OF_DIFFERENCES: f64 = 1e-7;

impl CallbackNlp {
    /// The first derivatives by the parameters, and mixed second derivatives of the Lagrangian, at `x[n]` with the multipliers
    /// `y[m]`: those of the functions, and central differences of gradients where the Hessian is given in one piece.
    pub fn parameter_changes(&mut self, x: &[f64], y: &[f64]) -> std::result::Result<Vec<ParameterChange>, EvalError> {
        let n = self.n;
        let mut changes = vec![ParameterChange::default(); self.params.len()];
        let at = Point { t: 0.0, x, u: &[], p: &self.params };
        let o = &mut self.objective;
        o.jacobian(&at)?;
        for (k, c) in changes.iter_mut().enumerate() {
            c.objective = o.jac[o.f.jac_pattern().range(n + k)].iter().sum();
        }
        if let Some(part) = &mut self.constraints {
            part.jacobian(&at)?;
            let p = part.f.jac_pattern();
            for (k, c) in changes.iter_mut().enumerate() {
                c.rows = p.range(n + k).map(|e| (p.row_idx()[e], part.jac[e])).collect();
            }
        }
        if self.lagrangian.is_none() {
            self.objective.add_mixed(&at, &[1.0], n, &mut changes)?;
            if let Some(part) = &mut self.constraints {
                part.add_mixed(&at, y, n, &mut changes)?;
            }
            return Ok(changes);
        }
        let sizes = self.parameter_sizes();
        for (k, c) in changes.iter_mut().enumerate() {
            let mut along = vec![0.0; sizes.len()];
            along[k] = sizes[k];
            let (_, by) = self.along(x, y, &along)?;
            c.gradient = by.gradient.into_iter().map(|(j, v)| (j, v / sizes[k])).filter(|c| c.1 != 0.0).collect();
        }
        Ok(changes)
    }

    /// Are these the derivatives of the functions? Compared with differences along one direction: columns of parameters that were
    /// left out would be taken for zeros.
    pub fn parameters_agree(
        &mut self,
        x: &[f64],
        y: &[f64],
        changes: &[ParameterChange],
    ) -> std::result::Result<bool, EvalError> {
        if changes.is_empty() {
            return Ok(true);
        }
        let mut random = SplitMix64::new(1);
        let mut draw = || if random.share() < 0.5 { -1.0 } else { 1.0 } * (0.5 + 0.5 * random.share());
        let along: Vec<f64> = self.parameter_sizes().iter().map(|size| size * draw()).collect();
        let (magnitude, found) = self.along(x, y, &along)?;
        // what differences with half the step differ by is their own error
        let half: Vec<f64> = along.iter().map(|d| 0.5 * d).collect();
        let (_, finer) = self.along(x, y, &half)?;
        let (mut objective, mut gradient, mut rows) = (0.0, vec![0.0; self.n], vec![0.0; self.m]);
        for (c, d) in changes.iter().zip(&along) {
            objective += d * c.objective;
            c.gradient.iter().for_each(|&(j, v)| gradient[j] += d * v);
            c.rows.iter().for_each(|&(i, v)| rows[i] += d * v);
        }
        let parts = || std::iter::once(&self.objective).chain(&self.constraints);
        let approximate = parts().any(|p| p.f.jacobian_is_approximate());
        let noise = if approximate { ROUNDING_OF_DIFFERENCES } else { ROUNDING } / STEP;
        let same = |given: f64, found: f64, finer: f64, magnitude: f64| {
            let error = (found - 2.0 * finer).abs() + noise * magnitude;
            (given - found).abs() <= DOUBT * given.abs().max(found.abs()) + 2.0 * error
        };
        let all = |given: &[f64], found: &[(usize, f64)], finer: &[(usize, f64)], sizes: &[(usize, f64)]| {
            (0..given.len()).all(|i| same(given[i], found[i].1, finer[i].1, sizes[i].1))
        };
        Ok(same(objective, found.objective, finer.objective, magnitude.objective)
            && all(&gradient, &found.gradient, &finer.gradient, &magnitude.gradient)
            && all(&rows, &found.rows, &finer.rows, &magnitude.rows))
    }

    /// What the parameters are measured by: their own size, and a share of the largest, or 1.
    fn parameter_sizes(&self) -> Vec<f64> {
        let largest = self.params.iter().fold(0f64, |a, p| a.max(p.abs()));
        let least = if largest > 0.0 { ROUNDING_OF_DIFFERENCES * largest } else { 1.0 };
        self.params.iter().map(|p| if *p == 0.0 { largest.max(least) } else { p.abs().max(least) }).collect()
    }

    /// Sizes of objective, entries of the gradient of the Lagrangian and rows, and central differences of them along a direction of the
    /// parameters, every entry.
    fn along(
        &mut self,
        x: &[f64],
        y: &[f64],
        direction: &[f64],
    ) -> std::result::Result<(ParameterChange, ParameterChange), EvalError> {
        let before = self.params.clone();
        let mut at = |step: f64| {
            for ((p, b), d) in self.params.iter_mut().zip(&before).zip(direction) {
                *p = b + step * d;
            }
            let (mut grad, mut jac, mut rows) = (vec![0.0; self.n], vec![0.0; self.jac.nnz()], vec![0.0; self.m]);
            let f = self.eval(x, &mut rows).and_then(|f| self.derivatives(x, &mut grad, &mut jac).map(|()| f));
            self.params.copy_from_slice(&before);
            let f = f?;
            // the terms of the gradient of the Lagrangian may cancel: their sizes count
            let mut sizes: Vec<f64> = grad.iter().map(|g| g.abs()).collect();
            for (j, g) in grad.iter_mut().enumerate() {
                for e in self.jac.range(j) {
                    let term = jac[e] * y[self.jac.row_idx()[e]];
                    *g += term;
                    sizes[j] += term.abs();
                }
            }
            Ok::<_, EvalError>((f, grad, rows, sizes))
        };
        let (right, left) = (at(STEP)?, at(-STEP)?);
        let difference = |a: &[f64], b: &[f64]| -> Vec<(usize, f64)> {
            a.iter().zip(b).map(|(a, b)| (a - b) / (2.0 * STEP)).enumerate().collect()
        };
        let sizes = |v: &[f64]| -> Vec<(usize, f64)> { v.iter().map(|v| v.abs()).enumerate().collect() };
        let magnitude = ParameterChange { objective: right.0.abs(), gradient: sizes(&right.3), rows: sizes(&right.2) };
        let change = ParameterChange {
            objective: (right.0 - left.0) / (2.0 * STEP),
            gradient: difference(&right.1, &left.1),
            rows: difference(&right.2, &left.2),
        };
        Ok((magnitude, change))
    }
}

/// The first `n` columns of a pattern: a leading part of its entries.
fn columns(p: &Pattern, m: usize, n: usize) -> Result<Pattern> {
    let col_ptr = p.col_ptr()[..=n].to_vec();
    let row_idx = p.row_idx()[..col_ptr[n]].to_vec();
    Pattern::new(m, n, col_ptr, row_idx)
}

impl Nlp for CallbackNlp {
    fn n(&self) -> usize {
        self.n
    }
    fn m(&self) -> usize {
        self.m
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn eval(&mut self, x: &[f64], c: &mut [f64]) -> std::result::Result<f64, EvalError> {
        if stop::requested().is_some() {
            return Err(EvalError::Stopped);
        }
        let at = Point { t: 0.0, x, u: &[], p: &self.params };
        let mut f = [0.0];
        self.objective.value(&at, &mut f)?;
        if let Some(part) = &mut self.constraints {
            part.value(&at, c)?;
        }
        Ok(f[0])
    }
    fn derivatives(&mut self, x: &[f64], grad: &mut [f64], jac: &mut [f64]) -> EvalResult {
        let at = Point { t: 0.0, x, u: &[], p: &self.params };
        let o = &mut self.objective;
        o.jacobian(&at)?;
        let p = o.f.jac_pattern();
        for (j, g) in grad.iter_mut().enumerate() {
            // one row: a column holds one entry or none
            *g = o.jac[p.range(j)].iter().sum();
        }
        if let Some(part) = &mut self.constraints {
            part.jacobian(&at)?;
            jac.copy_from_slice(&part.jac[..jac.len()]);
        }
        Ok(())
    }
    fn hessian(&mut self, x: &[f64], w: f64, y: &[f64], hess: &mut [f64]) -> EvalResult {
        let at = Point { t: 0.0, x, u: &[], p: &self.params };
        hess.fill(0.0);
        if let Some(lagrangian) = &self.lagrangian {
            return lagrangian(&at, w, y, hess);
        }
        self.objective.add_hessian(&at, &[w], hess)?;
        match &mut self.constraints {
            Some(part) => part.add_hessian(&at, y, hess),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::func::{Callback, Dims};

    const DIMS: Dims = Dims { x: 2, u: 0, p: 1 };

    fn pattern(m: usize, n: usize, entries: &[(usize, usize)]) -> Pattern {
        let rows: Vec<usize> = entries.iter().map(|e| e.0).collect();
        let cols: Vec<usize> = entries.iter().map(|e| e.1).collect();
        Pattern::from_triplets(m, n, &rows, &cols).0
    }

    /// `f = p x0 x1`, `c = (x0², x0 + p x1)`, with the parameter's derivatives declared as well.
    fn problem() -> CallbackNlp {
        let f = Callback::new("f", DIMS, 1, |at, out| {
            out[0] = at.p[0] * at.x[0] * at.x[1];
            0
        })
        .with_jacobian(pattern(1, 4, &[(0, 0), (0, 1), (0, 2)]), |at, out| {
            out.copy_from_slice(&[at.p[0] * at.x[1], at.p[0] * at.x[0], at.x[0] * at.x[1]]);
            0
        })
        .unwrap()
        .with_hessian(pattern(4, 4, &[(0, 1), (0, 2), (1, 2)]), |at, w, out| {
            out.copy_from_slice(&[w[0] * at.p[0], w[0] * at.x[1], w[0] * at.x[0]]);
            0
        })
        .unwrap();
        let c = Callback::new("c", DIMS, 2, |at, out| {
            out[0] = at.x[0] * at.x[0];
            out[1] = at.x[0] + at.p[0] * at.x[1];
            0
        })
        .with_jacobian(pattern(2, 4, &[(0, 0), (1, 0), (1, 1), (1, 2)]), |at, out| {
            out.copy_from_slice(&[2.0 * at.x[0], 1.0, at.p[0], at.x[1]]);
            0
        })
        .unwrap()
        .with_hessian(pattern(4, 4, &[(0, 0), (1, 2)]), |_, w, out| {
            out.copy_from_slice(&[2.0 * w[0], w[1]]);
            0
        })
        .unwrap();
        let mut p = CallbackNlp::new(2, 1, Arc::new(f), Some(Arc::new(c))).unwrap();
        p.set_params(&[3.0]).unwrap();
        p
    }

    #[test]
    fn values_and_merged_derivatives() {
        let mut p = problem();
        assert_eq!((p.n(), p.m(), p.jac_pattern().nnz(), p.hess_pattern().nnz()), (2, 2, 3, 2));
        let x = [2.0, 5.0];
        let (mut c, mut g, mut jac, mut hess) = ([0.0; 2], [0.0; 2], [0.0; 3], [9.0; 2]);
        assert_eq!(p.eval(&x, &mut c), Ok(30.0));
        assert_eq!(c, [4.0, 17.0]);
        p.derivatives(&x, &mut g, &mut jac).unwrap();
        assert_eq!((g, jac), ([15.0, 6.0], [4.0, 1.0, 3.0]));
        p.hessian(&x, 2.0, &[10.0, 7.0], &mut hess).unwrap();
        let h = p.hess_pattern();
        assert_eq!((hess[h.get(0, 0).unwrap()], hess[h.get(0, 1).unwrap()]), (20.0, 6.0));
    }

    #[test]
    fn the_hessian_in_one_piece_takes_the_place_of_the_parts() {
        let upper = pattern(2, 2, &[(0, 0), (0, 1), (1, 1)]);
        let whole: Arc<LagrangianFn> = Arc::new(|at, w, y, out| {
            out.copy_from_slice(&[2.0 * y[0], w * at.p[0], at.x[1]]);
            if y[1] > 0.0 {
                Ok(())
            } else {
                Err(EvalError::Fatal(-3))
            }
        });
        let mut p = problem().with_lagrangian(upper, whole.clone()).unwrap();
        assert_eq!(p.hess_pattern().nnz(), 3);
        let mut hess = [9.0; 3];
        p.hessian(&[2.0, 5.0], 2.0, &[10.0, 7.0], &mut hess).unwrap();
        assert_eq!(hess, [20.0, 6.0, 5.0]);
        assert_eq!(p.hessian(&[2.0, 5.0], 2.0, &[10.0, 0.0], &mut hess), Err(EvalError::Fatal(-3)));
        let refused = |p: Pattern| problem().with_lagrangian(p, whole.clone()).err().unwrap().code();
        assert_eq!(refused(pattern(3, 3, &[(0, 0)])), -2);
        assert_eq!(refused(pattern(2, 2, &[(1, 0)])), -3);
    }

    #[test]
    fn sizes_are_checked() {
        let two = |name: &str, d, m| Arc::new(Callback::new(name, d, m, |_, _| 0)) as Arc<dyn Function>;
        assert_eq!(CallbackNlp::new(0, 0, two("f", DIMS, 1), None).err().unwrap().code(), -2);
        assert_eq!(CallbackNlp::new(2, 0, two("f", DIMS, 1), None).err().unwrap().code(), -2);
        assert_eq!(CallbackNlp::new(2, 1, two("f", DIMS, 2), None).err().unwrap().code(), -2);
        let e = CallbackNlp::new(2, 1, two("f", DIMS, 1), Some(two("c", Dims { x: 3, u: 0, p: 1 }, 2))).err().unwrap();
        assert!(e.to_string().contains("'c'"), "{e}");
        let mut p = problem();
        assert_eq!(p.set_params(&[]).unwrap_err().code(), -2);
        assert_eq!(p.set_params(&[f64::NAN]).unwrap_err().code(), -3);
    }

    #[test]
    fn a_problem_without_rows() {
        let f = Callback::new("f", Dims { x: 1, u: 0, p: 0 }, 1, |at, out| {
            out[0] = (at.x[0] - 1.0).powi(2);
            0
        });
        let mut p = CallbackNlp::new(1, 0, Arc::new(f), None).unwrap();
        assert_eq!((p.m(), p.jac_pattern().nnz()), (0, 0));
        assert_eq!(p.eval(&[3.0], &mut []), Ok(4.0));
        let mut g = [0.0];
        p.derivatives(&[3.0], &mut g, &mut []).unwrap();
        assert!((g[0] - 4.0).abs() < 1e-8);
    }
}
