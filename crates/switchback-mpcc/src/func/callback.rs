//! A [`Function`] made of closures.

use std::fmt;
use std::panic::{catch_unwind, AssertUnwindSafe};
use std::sync::OnceLock;

use super::fdiff::{self, Colouring, Differences};
use super::trouble::{self, Complaint};
use super::{Dims, EvalError, EvalResult, Function, Point};
use crate::error::{Error, Result};
use crate::linalg::csc::Pattern;
use crate::stop;

/// Value or Jacobian, with memory last: returns 0, or a code.
type Plain = dyn Fn(&Point, &mut [f64], &mut [f64]) -> i32 + Send + Sync;
/// Hessian of the sum weighted with the second argument.
type Weighted = dyn Fn(&Point, &[f64], &mut [f64], &mut [f64]) -> i32 + Send + Sync;

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
///   `1e-10`, two evaluations of the value per colour of the pattern. Without a pattern all `x`, `u` and `p`
///   columns are taken as dense; the column of `t` is taken as **absent**, that is, the function does not
///   depend on time. A function of time needs a declared pattern; a declared sparse pattern is cheaper too.
/// - **Hessian**: central differences of the Jacobian, about as accurate, two Jacobians per colour of the
///   full symmetric pattern. Where the Jacobian itself is missing: second differences of the values, four
///   evaluations per entry, accuracy about `1e-8` relative to the size of the values; good enough for
///   trying out, not for tight tolerances. Without a pattern all inputs that occur in a common row of the
///   Jacobian are taken as coupled. [`Callback::linear`] says that there is no second derivative.
///
/// Near the border of the domain, where one side is not defined, the differences are taken from the
/// other side; where neither side is defined the derivative is [`EvalError::Recoverable`].
///
/// A declared pattern must hold every entry that can differ from zero: a missing one spoils others, because
/// the columns of one colour are moved together. [`super::check_derivatives`] finds it.
///
/// ```
/// use switchback_mpcc::func::{Callback, Dims, Function, Point};
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
    jac_declared: Option<Pattern>,
    hessian: Option<Box<Weighted>>,
    hess_declared: Option<Pattern>,
    /// Length of the memory of the closures.
    own_work: usize,
    serial: bool,
    /// Made when first needed: what is not declared is dense, and costs accordingly.
    structure: OnceLock<Structure>,
}

/// What follows from closures and declared patterns.
struct Structure {
    jac_pattern: Pattern,
    jac_colouring: Colouring,
    hess_pattern: Pattern,
    /// Full symmetric pattern, with the entry of the upper triangle behind each entry.
    hess_full: (Pattern, Vec<usize>),
    hess_colouring: Colouring,
    work_len: usize,
}

impl Structure {
    fn of(f: &Callback) -> Structure {
        let n_in = f.dims.n_in();
        let jac_pattern = f.jac_declared.clone().unwrap_or_else(|| fdiff::dense_without_time(f.dims, f.n_out));
        let hess_pattern = f.hess_declared.clone().unwrap_or_else(|| fdiff::hessian_pattern_of(&jac_pattern));
        let mut work = 0;
        let mut jac_colouring = Colouring::default();
        if f.jacobian.is_none() {
            jac_colouring = Colouring::of(&jac_pattern);
            work = Differences::work_len(n_in, f.n_out);
        }
        let mut hess_full = (Pattern::empty(n_in, n_in), Vec::new());
        let mut hess_colouring = Colouring::default();
        if f.hessian.is_none() && hess_pattern.nnz() > 0 {
            if f.jacobian.is_some() {
                hess_full = fdiff::expand(&hess_pattern);
                hess_colouring = Colouring::of(&hess_full.0);
                work = work.max(jac_pattern.nnz() + Differences::work_len(n_in, n_in));
            } else {
                work = work.max(f.n_out + n_in);
            }
        }
        Structure { jac_pattern, jac_colouring, hess_pattern, hess_full, hess_colouring, work_len: f.own_work + work }
    }
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
        Callback::with_work(name, dims, n_out, 0, move |at, out, _| value(at, out))
    }

    /// A callback with memory: `value(point, out, work)` gets `work[work_len]`, whose content is undefined. So do the
    /// closures of [`Callback::with_jacobian_in_work`] and [`Callback::with_hessian_in_work`].
    pub fn with_work(
        name: &str,
        dims: Dims,
        n_out: usize,
        work_len: usize,
        value: impl Fn(&Point, &mut [f64], &mut [f64]) -> i32 + Send + Sync + 'static,
    ) -> Callback {
        Callback {
            name: name.to_owned(),
            dims,
            n_out,
            value: Box::new(value),
            jacobian: None,
            jac_declared: None,
            hessian: None,
            hess_declared: None,
            own_work: work_len,
            serial: false,
            structure: OnceLock::new(),
        }
    }

    /// Gives the Jacobian: `jacobian(point, out)` writes the `nnz` values of the `n_out × n_in` pattern.
    pub fn with_jacobian(
        self,
        pattern: Pattern,
        jacobian: impl Fn(&Point, &mut [f64]) -> i32 + Send + Sync + 'static,
    ) -> Result<Callback> {
        self.with_jacobian_in_work(pattern, move |at, out, _| jacobian(at, out))
    }

    /// [`Callback::with_jacobian`] with memory, see [`Callback::with_work`].
    pub fn with_jacobian_in_work(
        mut self,
        pattern: Pattern,
        jacobian: impl Fn(&Point, &mut [f64], &mut [f64]) -> i32 + Send + Sync + 'static,
    ) -> Result<Callback> {
        self.set_jac_pattern(pattern)?;
        self.jacobian = Some(Box::new(jacobian));
        self.structure.take();
        Ok(self)
    }

    /// Declares the pattern of the Jacobian, `n_out × n_in`; the values are central differences.
    pub fn with_jacobian_pattern(mut self, pattern: Pattern) -> Result<Callback> {
        self.set_jac_pattern(pattern)?;
        self.jacobian = None;
        self.structure.take();
        Ok(self)
    }

    /// Gives the Hessian of the weighted sum: `hessian(point, weights, out)` writes the `nnz` values of
    /// the `n_in × n_in` pattern of the upper triangle.
    pub fn with_hessian(
        self,
        pattern: Pattern,
        hessian: impl Fn(&Point, &[f64], &mut [f64]) -> i32 + Send + Sync + 'static,
    ) -> Result<Callback> {
        self.with_hessian_in_work(pattern, move |at, weights, out, _| hessian(at, weights, out))
    }

    /// [`Callback::with_hessian`] with memory, see [`Callback::with_work`].
    pub fn with_hessian_in_work(
        mut self,
        pattern: Pattern,
        hessian: impl Fn(&Point, &[f64], &mut [f64], &mut [f64]) -> i32 + Send + Sync + 'static,
    ) -> Result<Callback> {
        self.set_hess_pattern(pattern)?;
        self.hessian = Some(Box::new(hessian));
        self.structure.take();
        Ok(self)
    }

    /// Declares the pattern of the Hessian, `n_in × n_in`, upper triangle; the values are differences.
    pub fn with_hessian_pattern(mut self, pattern: Pattern) -> Result<Callback> {
        self.set_hess_pattern(pattern)?;
        self.hessian = None;
        self.structure.take();
        Ok(self)
    }

    /// Declares that all second derivatives vanish.
    pub fn linear(mut self) -> Callback {
        self.hess_declared = Some(Pattern::empty(self.dims.n_in(), self.dims.n_in()));
        self.hessian = None;
        self.structure.take();
        self
    }

    /// Declares that the closures may only be called by the thread that called the library, one at a time.
    pub fn serial(mut self) -> Callback {
        self.serial = true;
        self
    }

    fn set_jac_pattern(&mut self, pattern: Pattern) -> Result<()> {
        self.expect_size("Jacobian", &pattern, self.n_out)?;
        self.jac_declared = Some(pattern);
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
        self.hess_declared = Some(pattern);
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

    fn structure(&self) -> &Structure {
        self.structure.get_or_init(|| Structure::of(self))
    }

    fn call_value(&self, at: &Point, out: &mut [f64], own: &mut [f64]) -> EvalResult {
        self.guarded("value", at, out, |out| (self.value)(at, out, own))
    }

    /// Runs a closure on a zeroed output: maps its code, catches its panic, checks its output, and notes the complaint
    /// of a closure that has not done so itself.
    fn guarded(
        &self,
        part: &'static str,
        at: &Point,
        out: &mut [f64],
        f: impl FnOnce(&mut [f64]) -> i32,
    ) -> EvalResult {
        if stop::requested().is_some() {
            return Err(EvalError::Stopped);
        }
        let before = trouble::count();
        out.fill(0.0);
        let code = match catch_unwind(AssertUnwindSafe(|| f(&mut *out))) {
            Ok(0) if out.iter().all(|v| v.is_finite()) => return Ok(()),
            Ok(code) if code < 0 => return Err(EvalError::Fatal(code)),
            Ok(code) => code,
            Err(_) => return Err(EvalError::Fatal(Callback::PANIC_CODE)),
        };
        if trouble::count() == before {
            let bad = out.iter().copied().enumerate().find(|(_, v)| code == 0 && part == "value" && !v.is_finite());
            let place = trouble::place(at, bad);
            trouble::note(Complaint { function: self.name.as_str().into(), part, code, place, timeless: false });
        }
        Err(EvalError::Recoverable)
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
        let Structure { jac_pattern, hess_pattern: upper, hess_full: (full, map), hess_colouring, .. } =
            self.structure();
        let (own, work) = work.split_at_mut(self.own_work);
        let (jac, work) = work.split_at_mut(jac_pattern.nnz());
        let mut gradient = |at: &Point, g: &mut [f64]| {
            self.guarded("Jacobian", at, jac, |jac| jacobian(at, jac, own))?;
            for (j, g) in g.iter_mut().enumerate() {
                let entries = jac_pattern.range(j);
                let rows = jac_pattern.rows(j);
                *g = rows.iter().zip(&jac[entries]).map(|(&r, v)| weights[r] * v).sum();
            }
            Ok(())
        };
        // Every entry beside the diagonal arises twice, from either column: their mean.
        out.fill(0.0);
        let mut emit = |k: usize, v: f64| {
            let u = map[k];
            out[u] += v;
        };
        Differences { dims: self.dims, pattern: full, colouring: hess_colouring }.run(
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
        &self.structure().jac_pattern
    }

    fn hess_pattern(&self) -> &Pattern {
        &self.structure().hess_pattern
    }

    fn work_len(&self) -> usize {
        self.structure().work_len
    }

    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.call_value(at, &mut out[..self.n_out], &mut work[..self.own_work])
    }

    fn jacobian(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let Structure { jac_pattern, jac_colouring, .. } = self.structure();
        let out = &mut out[..jac_pattern.nnz()];
        if let Some(jacobian) = &self.jacobian {
            return self.guarded("Jacobian", at, out, |out| jacobian(at, out, &mut work[..self.own_work]));
        }
        let (own, work) = work.split_at_mut(self.own_work);
        Differences { dims: self.dims, pattern: jac_pattern, colouring: jac_colouring }.run(
            at,
            &mut |at, f| self.call_value(at, f, own),
            &mut |k, v| out[k] = v,
            work,
        )?;
        finite(out)
    }

    fn hessian(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let pattern = &self.structure().hess_pattern;
        let out = &mut out[..pattern.nnz()];
        let weights = &weights[..self.n_out];
        if let Some(hessian) = &self.hessian {
            return self.guarded("Hessian", at, out, |out| hessian(at, weights, out, &mut work[..self.own_work]));
        }
        if out.is_empty() || weights.iter().all(|w| *w == 0.0) {
            out.fill(0.0);
            return Ok(());
        }
        match &self.jacobian {
            Some(jacobian) => self.hessian_of_jacobian(jacobian.as_ref(), at, weights, out, work)?,
            None => {
                let (own, work) = work.split_at_mut(self.own_work);
                let (f, work) = work.split_at_mut(self.n_out);
                let mut sum = |at: &Point| {
                    self.call_value(at, f, own)?;
                    Ok(f.iter().zip(weights).map(|(f, w)| f * w).sum())
                };
                fdiff::second_differences(self.dims, pattern, at, &mut sum, out, work)?;
            }
        }
        finite(out)
    }

    fn is_serial(&self) -> bool {
        self.serial
    }

    fn jacobian_is_approximate(&self) -> bool {
        self.jacobian.is_none() && self.jac_pattern().nnz() > 0
    }

    fn hessian_is_approximate(&self) -> bool {
        self.hessian.is_none() && self.hess_pattern().nnz() > 0
    }
}

impl fmt::Debug for Callback {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Callback")
            .field("name", &self.name)
            .field("dims", &self.dims)
            .field("n_out", &self.n_out)
            .field("jacobian_given", &self.jacobian.is_some())
            .field("jacobian_entries", &self.jac_pattern().nnz())
            .field("hessian_given", &self.hessian.is_some())
            .field("hessian_entries", &self.hess_pattern().nnz())
            .finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::Arc;

    const DIMS: Dims = Dims { x: 3, u: 1, p: 1 };
    const X: [f64; 3] = [0.7, -1.3, 2.1];

    fn at() -> Point<'static> {
        Point { t: 0.4, x: &X, u: &[0.9], p: &[1.7] }
    }

    fn pattern(m: usize, n: usize, entries: &[(usize, usize)]) -> Pattern {
        let rows: Vec<usize> = entries.iter().map(|e| e.0).collect();
        let cols: Vec<usize> = entries.iter().map(|e| e.1).collect();
        Pattern::from_triplets(m, n, &rows, &cols).0
    }

    /// `(x0² u + sin(x1 t), exp(x2) p)`; inputs are x0 x1 x2 u p t.
    fn value(at: &Point, out: &mut [f64]) -> i32 {
        out[0] = at.x[0] * at.x[0] * at.u[0] + (at.x[1] * at.t).sin();
        out[1] = at.x[2].exp() * at.p[0];
        0
    }

    fn jac_pattern() -> Pattern {
        pattern(2, 6, &[(0, 0), (0, 1), (1, 2), (0, 3), (1, 4), (0, 5)])
    }

    fn jacobian(at: &Point, out: &mut [f64]) -> i32 {
        let phase = at.x[1] * at.t;
        out[0] = 2.0 * at.x[0] * at.u[0];
        out[1] = phase.cos() * at.t;
        out[2] = at.x[2].exp() * at.p[0];
        out[3] = at.x[0] * at.x[0];
        out[4] = at.x[2].exp();
        out[5] = phase.cos() * at.x[1];
        0
    }

    fn hess_pattern() -> Pattern {
        pattern(6, 6, &[(0, 0), (1, 1), (2, 2), (0, 3), (2, 4), (1, 5), (5, 5)])
    }

    fn hessian(at: &Point, w: &[f64], out: &mut [f64]) -> i32 {
        let phase = at.x[1] * at.t;
        out[0] = w[0] * 2.0 * at.u[0];
        out[1] = -w[0] * phase.sin() * at.t * at.t;
        out[2] = w[1] * at.x[2].exp() * at.p[0];
        out[3] = w[0] * 2.0 * at.x[0];
        out[4] = w[1] * at.x[2].exp();
        out[5] = w[0] * (phase.cos() - phase.sin() * phase);
        out[6] = -w[0] * phase.sin() * at.x[1] * at.x[1];
        0
    }

    fn exact() -> Callback {
        Callback::new("f", DIMS, 2, value)
            .with_jacobian(jac_pattern(), jacobian)
            .unwrap()
            .with_hessian(hess_pattern(), hessian)
            .unwrap()
    }

    fn jac_of(f: &Callback) -> Vec<f64> {
        let mut out = vec![f64::NAN; f.jac_pattern().nnz()];
        f.jacobian(&at(), &mut out, &mut vec![f64::NAN; f.work_len()]).unwrap();
        out
    }

    fn hess_of(f: &Callback) -> Vec<f64> {
        let mut out = vec![f64::NAN; f.hess_pattern().nnz()];
        f.hessian(&at(), &[0.8, -1.1], &mut out, &mut vec![f64::NAN; f.work_len()]).unwrap();
        out
    }

    /// Largest difference of two sparse matrices whose patterns may differ.
    fn gap(p: &Pattern, a: &[f64], q: &Pattern, b: &[f64]) -> f64 {
        let value = |p: &Pattern, v: &[f64], i, j| p.get(i, j).map_or(0.0, |k| v[k]);
        let mut worst: f64 = 0.0;
        for j in 0..p.n_cols() {
            for i in 0..p.n_rows() {
                worst = worst.max((value(p, a, i, j) - value(q, b, i, j)).abs());
            }
        }
        worst
    }

    #[test]
    fn exact_derivatives_are_passed_on() {
        let f = exact();
        let mut out = [0.0; 6];
        jacobian(&at(), &mut out);
        assert_eq!(jac_of(&f), out);
        assert!(!f.jacobian_is_approximate() && !f.hessian_is_approximate());
        assert_eq!(f.work_len(), 0);
        assert_eq!((f.name(), f.n_out(), f.dims()), ("f", 2, DIMS));
    }

    #[test]
    fn jacobian_by_differences() {
        let f = Callback::new("f", DIMS, 2, value).with_jacobian_pattern(jac_pattern()).unwrap();
        assert!(f.jacobian_is_approximate());
        for (a, b) in jac_of(&f).iter().zip(jac_of(&exact())) {
            assert!((a - b).abs() < 2e-9, "{a} {b}");
        }
    }

    #[test]
    fn default_pattern_is_dense_in_all_but_the_time() {
        let f = Callback::new("f", DIMS, 2, value);
        let p = f.jac_pattern();
        for j in 0..6 {
            assert_eq!(p.rows(j).len(), if j < 5 { 2 } else { 0 });
        }
        let e = exact();
        let (v, w) = (jac_of(&f), jac_of(&e));
        for j in 0..5 {
            for i in 0..2 {
                let b = e.jac_pattern().get(i, j).map_or(0.0, |k| w[k]);
                assert!((v[p.get(i, j).unwrap()] - b).abs() < 2e-9);
            }
        }
    }

    /// The dense patterns that stand for undeclared ones would not fit into memory here.
    #[test]
    fn declared_patterns_cost_what_they_hold() {
        const N: usize = 200_000;
        let dims = Dims { x: N, u: 0, p: 0 };
        let diagonal: Vec<usize> = (0..N).collect();
        let of = |n_rows| Pattern::from_triplets(n_rows, N + 1, &diagonal, &diagonal).0;
        let f = Callback::new("f", dims, N, |at, out| {
            out.iter_mut().zip(at.x).for_each(|(f, x)| *f = x * x);
            0
        })
        .with_jacobian(of(N), |_, _| 0)
        .unwrap();
        let f = f.with_hessian(of(N + 1), |_, _, _| 0).unwrap();
        assert_eq!((f.jac_pattern().nnz(), f.hess_pattern().nnz(), f.work_len()), (N, N, 0));
        let gradient = Pattern::from_triplets(1, N + 1, &vec![0; N], &diagonal).0;
        let f = Callback::new("sum", dims, 1, |_, _| 0).with_jacobian(gradient, |_, _| 0).unwrap().linear();
        assert_eq!((f.jac_pattern().nnz(), f.hess_pattern().nnz()), (N, 0));
    }

    #[test]
    fn colours_save_evaluations() {
        let count = Arc::new(AtomicUsize::new(0));
        let counter = count.clone();
        let f = Callback::new("f", DIMS, 2, move |at, out| {
            counter.fetch_add(1, Ordering::Relaxed);
            value(at, out)
        })
        .with_jacobian_pattern(jac_pattern())
        .unwrap();
        jac_of(&f);
        // Row 0 has four entries, row 1 two.
        assert_eq!(count.load(Ordering::Relaxed), 8);
    }

    #[test]
    fn hessian_by_differences_of_the_jacobian() {
        let e = exact();
        let base = || Callback::new("f", DIMS, 2, value).with_jacobian(jac_pattern(), jacobian).unwrap();
        for f in [base(), base().with_hessian_pattern(hess_pattern()).unwrap()] {
            assert!(f.hessian_is_approximate() && !f.jacobian_is_approximate());
            let d = gap(f.hess_pattern(), &hess_of(&f), e.hess_pattern(), &hess_of(&e));
            assert!(d < 5e-9, "{d}");
        }
    }

    #[test]
    fn hessian_by_second_differences() {
        let e = exact();
        let f = Callback::new("f", DIMS, 2, value).with_jacobian_pattern(jac_pattern()).unwrap();
        let d = gap(f.hess_pattern(), &hess_of(&f), e.hess_pattern(), &hess_of(&e));
        assert!(d < 1e-6, "{d}");
    }

    #[test]
    fn order_of_declarations_does_not_matter() {
        let a = Callback::new("f", DIMS, 2, value)
            .with_hessian_pattern(hess_pattern())
            .unwrap()
            .with_jacobian(jac_pattern(), jacobian)
            .unwrap();
        let e = exact();
        assert!(gap(a.hess_pattern(), &hess_of(&a), e.hess_pattern(), &hess_of(&e)) < 5e-9);
        let l = Callback::new("f", DIMS, 2, value).linear().with_jacobian(jac_pattern(), jacobian).unwrap();
        assert_eq!(l.hess_pattern().nnz(), 0);
        assert!(!l.hessian_is_approximate());
        assert_eq!(hess_of(&l), Vec::<f64>::new());
    }

    #[test]
    fn random_sparse_quadratics() {
        // f_r = Σ q_rab z_a z_b over few inputs of each row: every derivative is known.
        let mut state = 5u64;
        let mut next = move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let dims = Dims { x: 8, u: 3, p: 0 };
        let n = dims.n_in();
        for _ in 0..20 {
            let m = 5;
            let mut terms = Vec::new();
            for r in 0..m {
                for _ in 0..3 {
                    let (a, b) = ((next() * n as f64) as usize, (next() * n as f64) as usize);
                    terms.push((r, a.min(b), a.max(b), next() - 0.5));
                }
            }
            let entries: Vec<_> = terms.iter().flat_map(|t| [(t.0, t.1), (t.0, t.2)]).collect();
            let jp = pattern(m, n, &entries);
            let z: Vec<f64> = (0..n).map(|_| 4.0 * (next() - 0.5)).collect();
            let w: Vec<f64> = (0..m).map(|_| next() - 0.5).collect();
            let (t1, t2, p2) = (terms.clone(), terms.clone(), jp.clone());
            let f = Callback::new("q", dims, m, move |at, out| {
                for &(r, a, b, q) in &t1 {
                    out[r] += q * fdiff::input(dims, at, a) * fdiff::input(dims, at, b);
                }
                0
            });
            let by_values = f.with_jacobian_pattern(jp.clone()).unwrap();
            let t3 = terms.clone();
            let by_jacobian = Callback::new("q", dims, m, move |at, out| {
                for &(r, a, b, q) in &t3 {
                    out[r] += q * fdiff::input(dims, at, a) * fdiff::input(dims, at, b);
                }
                0
            })
            .with_jacobian(jp, move |at, out| {
                for &(r, a, b, q) in &t2 {
                    out[p2.get(r, a).unwrap()] += q * fdiff::input(dims, at, b);
                    out[p2.get(r, b).unwrap()] += q * fdiff::input(dims, at, a);
                }
                0
            })
            .unwrap();
            let mut hess = vec![0.0; n * n];
            for &(r, a, b, q) in &terms {
                hess[a * n + b] += w[r] * q * if a == b { 2.0 } else { 1.0 };
            }
            for (f, tol) in [(&by_jacobian, 1e-8), (&by_values, 1e-6)] {
                let mut out = vec![0.0; f.hess_pattern().nnz()];
                let mut work = vec![0.0; f.work_len()];
                f.hessian(&fdiff::point(dims, &z), &w, &mut out, &mut work).unwrap();
                for j in 0..n {
                    for i in 0..=j {
                        let v = f.hess_pattern().get(i, j).map_or(0.0, |k| out[k]);
                        assert!((v - hess[i * n + j]).abs() < tol, "{v} {}", hess[i * n + j]);
                    }
                }
            }
        }
    }

    #[test]
    fn one_sided_at_the_border_of_the_domain() {
        // NaN where x0 < 1, a code where x1 > 2: one group of the colouring, opposite sides.
        let dims = Dims { x: 2, u: 0, p: 0 };
        let f = Callback::new("f", dims, 2, |at, out| {
            out[0] = if at.x[0] < 1.0 { f64::NAN } else { at.x[0] * at.x[0] };
            out[1] = at.x[1].powi(3);
            i32::from(at.x[1] > 2.0)
        });
        let f = f.with_jacobian_pattern(pattern(2, 3, &[(0, 0), (1, 1)])).unwrap();
        let mut work = vec![0.0; f.work_len()];
        let mut out = [0.0; 2];
        let at = Point { t: 0.0, x: &[1.0, 2.0], u: &[], p: &[] };
        f.jacobian(&at, &mut out, &mut work).unwrap();
        assert!((out[0] - 2.0).abs() < 1e-8 && (out[1] - 12.0).abs() < 1e-7, "{out:?}");
        let mut hess = [0.0; 2];
        f.hessian(&at, &[1.0, 1.0], &mut hess, &mut work).unwrap();
        assert!((hess[0] - 2.0).abs() < 1e-3 && (hess[1] - 12.0).abs() < 1e-2, "{hess:?}");
    }

    #[test]
    fn no_side_is_recoverable() {
        let dims = Dims { x: 1, u: 0, p: 0 };
        let f = Callback::new("f", dims, 1, |at, out| {
            out[0] = 1.0;
            i32::from(at.x[0] != 3.0)
        });
        let mut work = vec![0.0; f.work_len()];
        let at = Point { t: 0.0, x: &[3.0], u: &[], p: &[] };
        assert_eq!(f.value(&at, &mut [0.0], &mut work), Ok(()));
        assert_eq!(f.jacobian(&at, &mut [0.0], &mut work), Err(EvalError::Recoverable));
        assert_eq!(f.hessian(&at, &[1.0], &mut [0.0], &mut work), Err(EvalError::Recoverable));
    }

    #[test]
    fn codes_nan_and_panics() {
        let dims = Dims { x: 1, u: 0, p: 0 };
        let f = Callback::new("f", dims, 1, |at, out| {
            out[0] = match at.x[0] as i32 {
                0 => 1.0,
                1 => f64::NAN,
                2 => f64::INFINITY,
                3 => return 4,
                4 => return -7,
                _ => panic!("on purpose"),
            };
            0
        });
        let mut work = vec![0.0; f.work_len()];
        let mut run = |x: f64| {
            let at = Point { t: 0.0, x: &[x], u: &[], p: &[] };
            let v = f.value(&at, &mut [0.0], &mut work);
            let j = f.jacobian(&at, &mut [0.0], &mut work);
            assert!(v.is_ok() || v == j);
            v
        };
        assert_eq!(run(0.5), Ok(()));
        assert_eq!(run(1.5), Err(EvalError::Recoverable));
        assert_eq!(run(2.5), Err(EvalError::Recoverable));
        assert_eq!(run(3.5), Err(EvalError::Recoverable));
        assert_eq!(run(4.5), Err(EvalError::Fatal(-7)));
        assert_eq!(run(5.5), Err(EvalError::Fatal(Callback::PANIC_CODE)));
    }

    #[test]
    fn patterns_of_the_wrong_size_are_refused() {
        let f = || Callback::new("f", DIMS, 2, value);
        assert!(matches!(f().with_jacobian_pattern(Pattern::dense(2, 5)), Err(Error::Dimension(_))));
        assert!(matches!(f().with_jacobian(Pattern::dense(3, 6), jacobian), Err(Error::Dimension(_))));
        assert!(matches!(f().with_hessian_pattern(Pattern::empty(5, 5)), Err(Error::Dimension(_))));
        assert!(matches!(f().with_hessian(Pattern::dense(6, 6), hessian), Err(Error::Range(_))));
    }

    #[test]
    fn zero_weights_cost_nothing_and_may_be_shared_between_threads() {
        let f = Callback::new("f", DIMS, 2, value);
        let mut out = vec![1.0; f.hess_pattern().nnz()];
        f.hessian(&at(), &[0.0, 0.0], &mut out, &mut vec![0.0; f.work_len()]).unwrap();
        assert!(out.iter().all(|v| *v == 0.0));
        std::thread::scope(|s| {
            for _ in 0..2 {
                s.spawn(|| jac_of(&f));
            }
        });
    }
}
