//! A [`Function`] made of closures.

use std::fmt;
use std::panic::{catch_unwind, AssertUnwindSafe};

use super::fdiff::{self, Colouring, Differences};
use super::{Dims, EvalError, EvalResult, Function, Point};
use crate::error::{Error, Result};
use crate::linalg::csc::Pattern;

/// Value or Jacobian: returns 0, or a code.
type Plain = dyn Fn(&Point, &mut [f64]) -> i32 + Send + Sync;
/// Hessian of the sum weighted with the second argument.
type Weighted = dyn Fn(&Point, &[f64], &mut [f64]) -> i32 + Send + Sync;

/// A function made of closures for the value and, as far as they are known, its derivatives.
///
/// Closures get zeroed outputs and return a code:
/// - `0`: done. Outputs that are not finite count as not defined at the point.
/// - positive: not defined at the point ([`EvalError::Recoverable`]).
/// - negative: stop ([`EvalError::Fatal`] with the code).
///
/// A panic is caught and counts as the code [`Callback::PANIC_CODE`] (the panic hook of the program runs).
///
/// What is missing is replaced by finite differences:
/// - **Jacobian**: central differences with the step `eps^(1/3) max(1, |z|)`, relative accuracy about
///   `1e-10`, two evaluations of the value per colour of the pattern. Without a pattern all `x` and `u`
///   columns are taken as dense; the columns of `p` and `t` are taken as **absent**, that is, parameters
///   are constants and the function does not depend on time. A function of time needs a declared
///   pattern; a declared sparse pattern is cheaper too.
/// - **Hessian**: central differences of the Jacobian, about as accurate, two Jacobians per colour of the
///   full symmetric pattern. Where the Jacobian itself is missing: second differences of the values, four
///   evaluations per entry, accuracy about `1e-8` relative to the size of the values; good enough for
///   trying out, not for tight tolerances. Without a pattern all inputs that occur in a common row of the
///   Jacobian are taken as coupled. [`Callback::linear`] says that there is no second derivative.
///
/// Near the border of the domain, where one side is not defined, the differences are taken from the
/// other side; where neither side is defined the derivative is [`EvalError::Recoverable`].
///
/// ```
/// use switchback::func::{Callback, Dims, Function, Point};
///
/// let dims = Dims { x: 2, u: 0, p: 0 };
/// let f = Callback::new("f", dims, 1, |at, out| {
///     out[0] = at.x[0] * at.x[1].sin();
///     0
/// });
/// let at = Point { t: 0.0, x: &[2.0, 0.0], u: &[], p: &[] };
/// let mut work = vec![0.0; f.work_len()];
/// let mut jac = vec![0.0; f.jac_pattern().nnz()];
/// f.jacobian(&at, &mut jac, &mut work).unwrap();
/// assert!((jac[1] - 2.0).abs() < 1e-9);
/// assert!(f.jacobian_is_approximate());
/// ```
pub struct Callback {
    name: String,
    dims: Dims,
    n_out: usize,
    value: Box<Plain>,
    jacobian: Option<Box<Plain>>,
    jac_pattern: Pattern,
    jac_colouring: Colouring,
    hessian: Option<Box<Weighted>>,
    hess_pattern: Pattern,
    /// The Hessian pattern was declared, not derived from the Jacobian.
    hess_declared: bool,
    /// Full symmetric pattern, with the entry of the upper triangle behind each entry.
    hess_full: (Pattern, Vec<usize>),
    hess_colouring: Colouring,
    work_len: usize,
}

impl Callback {
    /// Code of [`EvalError::Fatal`] for a closure that panicked.
    pub const PANIC_CODE: i32 = i32::MIN;

    /// A function with `n_out` outputs given by its values; `value(point, out)` writes `out[n_out]`.
    pub fn new(
        name: &str,
        dims: Dims,
        n_out: usize,
        value: impl Fn(&Point, &mut [f64]) -> i32 + Send + Sync + 'static,
    ) -> Callback {
        let (mut rows, mut cols) = (Vec::new(), Vec::new());
        for j in 0..dims.x + dims.u {
            for i in 0..n_out {
                rows.push(i);
                cols.push(j);
            }
        }
        let jac_pattern = Pattern::from_triplets(n_out, dims.n_in(), &rows, &cols).0;
        let mut f = Callback {
            name: name.to_owned(),
            dims,
            n_out,
            value: Box::new(value),
            jacobian: None,
            jac_pattern,
            jac_colouring: Colouring::default(),
            hessian: None,
            hess_pattern: Pattern::empty(dims.n_in(), dims.n_in()),
            hess_declared: false,
            hess_full: (Pattern::empty(dims.n_in(), dims.n_in()), Vec::new()),
            hess_colouring: Colouring::default(),
            work_len: 0,
        };
        f.prepare();
        f
    }

    /// Gives the Jacobian: `jacobian(point, out)` writes the `nnz` values of the `n_out × n_in` pattern.
    pub fn with_jacobian(
        mut self,
        pattern: Pattern,
        jacobian: impl Fn(&Point, &mut [f64]) -> i32 + Send + Sync + 'static,
    ) -> Result<Callback> {
        self.set_jac_pattern(pattern)?;
        self.jacobian = Some(Box::new(jacobian));
        self.prepare();
        Ok(self)
    }

    /// Declares the pattern of the Jacobian, `n_out × n_in`; the values are central differences.
    pub fn with_jacobian_pattern(mut self, pattern: Pattern) -> Result<Callback> {
        self.set_jac_pattern(pattern)?;
        self.jacobian = None;
        self.prepare();
        Ok(self)
    }

    /// Gives the Hessian of the weighted sum: `hessian(point, weights, out)` writes the `nnz` values of
    /// the `n_in × n_in` pattern of the upper triangle.
    pub fn with_hessian(
        mut self,
        pattern: Pattern,
        hessian: impl Fn(&Point, &[f64], &mut [f64]) -> i32 + Send + Sync + 'static,
    ) -> Result<Callback> {
        self.set_hess_pattern(pattern)?;
        self.hessian = Some(Box::new(hessian));
        self.prepare();
        Ok(self)
    }

    /// Declares the pattern of the Hessian, `n_in × n_in`, upper triangle; the values are differences.
    pub fn with_hessian_pattern(mut self, pattern: Pattern) -> Result<Callback> {
        self.set_hess_pattern(pattern)?;
        self.hessian = None;
        self.prepare();
        Ok(self)
    }

    /// Declares that all second derivatives vanish.
    pub fn linear(mut self) -> Callback {
        self.hess_pattern = Pattern::empty(self.dims.n_in(), self.dims.n_in());
        self.hess_declared = true;
        self.hessian = None;
        self.prepare();
        self
    }

    fn set_jac_pattern(&mut self, pattern: Pattern) -> Result<()> {
        self.expect_size("Jacobian", &pattern, self.n_out)?;
        self.jac_pattern = pattern;
        Ok(())
    }

    fn set_hess_pattern(&mut self, pattern: Pattern) -> Result<()> {
        self.expect_size("Hessian", &pattern, self.dims.n_in())?;
        if !pattern.is_upper() {
            return Err(Error::Range(format!(
                "{}: the Hessian pattern must hold entries of the upper triangle only (row <= column)",
                self.name
            )));
        }
        self.hess_pattern = pattern;
        self.hess_declared = true;
        Ok(())
    }

    fn expect_size(&self, what: &str, pattern: &Pattern, n_rows: usize) -> Result<()> {
        let n_in = self.dims.n_in();
        if pattern.n_rows() == n_rows && pattern.n_cols() == n_in {
            return Ok(());
        }
        Err(Error::Dimension(format!(
            "{}: the {what} pattern is {} x {}, expected {n_rows} x {n_in} (columns: {} of x, {} of u, {} of p, 1 of t)",
            self.name,
            pattern.n_rows(),
            pattern.n_cols(),
            self.dims.x,
            self.dims.u,
            self.dims.p,
        )))
    }

    /// Recomputes what follows from closures and patterns.
    fn prepare(&mut self) {
        let n_in = self.dims.n_in();
        let mut work = 0;
        self.jac_colouring = Colouring::default();
        if self.jacobian.is_none() {
            self.jac_colouring = Colouring::of(&self.jac_pattern);
            work = Differences::work_len(n_in, self.n_out);
        }
        if !self.hess_declared {
            self.hess_pattern = fdiff::hessian_pattern_of(&self.jac_pattern);
        }
        self.hess_full = (Pattern::empty(n_in, n_in), Vec::new());
        self.hess_colouring = Colouring::default();
        if self.hessian.is_none() && self.hess_pattern.nnz() > 0 {
            if self.jacobian.is_some() {
                self.hess_full = fdiff::expand(&self.hess_pattern);
                self.hess_colouring = Colouring::of(&self.hess_full.0);
                work = work.max(self.jac_pattern.nnz() + Differences::work_len(n_in, n_in));
            } else {
                work = work.max(self.n_out + n_in);
            }
        }
        self.work_len = work;
    }

    fn call_value(&self, at: &Point, out: &mut [f64]) -> EvalResult {
        guarded(out, |out| (self.value)(at, out))
    }

    /// Hessian by coloured central differences of the gradient `Jᵀ w`.
    fn hessian_of_jacobian(
        &self,
        jacobian: &Plain,
        at: &Point,
        weights: &[f64],
        out: &mut [f64],
        work: &mut [f64],
    ) -> EvalResult {
        let (jac, work) = work.split_at_mut(self.jac_pattern.nnz());
        let mut gradient = |at: &Point, g: &mut [f64]| {
            guarded(jac, |jac| jacobian(at, jac))?;
            for (j, g) in g.iter_mut().enumerate() {
                let entries = self.jac_pattern.range(j);
                let rows = self.jac_pattern.rows(j);
                *g = rows.iter().zip(&jac[entries]).map(|(&r, v)| weights[r] * v).sum();
            }
            Ok(())
        };
        let (full, map) = &self.hess_full;
        // Every entry beside the diagonal arises twice, from either column: their mean.
        let upper = &self.hess_pattern;
        out.fill(0.0);
        let mut emit = |k: usize, v: f64| {
            let u = map[k];
            out[u] += v;
        };
        Differences { dims: self.dims, pattern: full, colouring: &self.hess_colouring }.run(
            at,
            &mut gradient,
            &mut emit,
            work,
        )?;
        for j in 0..upper.n_cols() {
            for k in upper.range(j) {
                if upper.row_idx()[k] != j {
                    out[k] *= 0.5;
                }
            }
        }
        Ok(())
    }
}

/// Runs a closure on a zeroed output: maps its code, catches its panic, checks its output.
fn guarded(out: &mut [f64], f: impl FnOnce(&mut [f64]) -> i32) -> EvalResult {
    out.fill(0.0);
    match catch_unwind(AssertUnwindSafe(|| f(&mut *out))) {
        Ok(0) => finite(out),
        Ok(code) if code > 0 => Err(EvalError::Recoverable),
        Ok(code) => Err(EvalError::Fatal(code)),
        Err(_) => Err(EvalError::Fatal(Callback::PANIC_CODE)),
    }
}

fn finite(out: &[f64]) -> EvalResult {
    if out.iter().all(|v| v.is_finite()) {
        Ok(())
    } else {
        Err(EvalError::Recoverable)
    }
}

impl Function for Callback {
    fn name(&self) -> &str {
        &self.name
    }

    fn dims(&self) -> Dims {
        self.dims
    }

    fn n_out(&self) -> usize {
        self.n_out
    }

    fn jac_pattern(&self) -> &Pattern {
        &self.jac_pattern
    }

    fn hess_pattern(&self) -> &Pattern {
        &self.hess_pattern
    }

    fn work_len(&self) -> usize {
        self.work_len
    }

    fn value(&self, at: &Point, out: &mut [f64], _work: &mut [f64]) -> EvalResult {
        self.call_value(at, &mut out[..self.n_out])
    }

    fn jacobian(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let out = &mut out[..self.jac_pattern.nnz()];
        if let Some(jacobian) = &self.jacobian {
            return guarded(out, |out| jacobian(at, out));
        }
        Differences { dims: self.dims, pattern: &self.jac_pattern, colouring: &self.jac_colouring }.run(
            at,
            &mut |at, f| self.call_value(at, f),
            &mut |k, v| out[k] = v,
            work,
        )?;
        finite(out)
    }

    fn hessian(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let out = &mut out[..self.hess_pattern.nnz()];
        let weights = &weights[..self.n_out];
        if let Some(hessian) = &self.hessian {
            return guarded(out, |out| hessian(at, weights, out));
        }
        if out.is_empty() || weights.iter().all(|w| *w == 0.0) {
            out.fill(0.0);
            return Ok(());
        }
        match &self.jacobian {
            Some(jacobian) => self.hessian_of_jacobian(jacobian.as_ref(), at, weights, out, work)?,
            None => {
                let (f, work) = work.split_at_mut(self.n_out);
                let mut sum = |at: &Point| {
                    self.call_value(at, f)?;
                    Ok(f.iter().zip(weights).map(|(f, w)| f * w).sum())
                };
                fdiff::second_differences(self.dims, &self.hess_pattern, at, &mut sum, out, work)?;
            }
        }
        finite(out)
    }

    fn jacobian_is_approximate(&self) -> bool {
        self.jacobian.is_none() && self.jac_pattern.nnz() > 0
    }

    fn hessian_is_approximate(&self) -> bool {
        self.hessian.is_none() && self.hess_pattern.nnz() > 0
    }
}

impl fmt::Debug for Callback {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Callback")
            .field("name", &self.name)
            .field("dims", &self.dims)
            .field("n_out", &self.n_out)
            .field("jacobian_given", &self.jacobian.is_some())
            .field("jacobian_entries", &self.jac_pattern.nnz())
            .field("hessian_given", &self.hessian.is_some())
            .field("hessian_entries", &self.hess_pattern.nnz())
            .finish()
    }
}
