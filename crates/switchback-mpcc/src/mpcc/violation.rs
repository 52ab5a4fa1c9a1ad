//! The program that minimises the violation of the rows of another one, with its pairs as they are.
//!
//! ```text
//! min Σ w_i (p_i + q_i)   s.t.   c_l ≤ c(x) − p + q ≤ c_u,   bounds of x,   0 ≤ x_a ⊥ x_b ≥ 0,   p, q ≥ 0
//! ```
//!
//! Where all of `p`, `q` are zero its solution is a feasible point. Where they are not, and the point is certified, no
//! step to first order lowers the violation: there is no feasible point near.

use super::infeasible::elastic_pattern;
use super::problem::{Mpcc, Side};
use crate::error::Result;
use crate::func::{EvalError, EvalResult};
use crate::linalg::csc::Pattern;
use crate::nlp::{Bounds, Nlp};

/// Its structure, made once for a program.
pub(super) struct Structure {
    jac: Pattern,
    hess: Pattern,
    /// Weights of the rows `[m]`.
    pub weights: Vec<f64>,
    /// Those of the program, and the violations.
    lifts: Vec<(usize, usize)>,
}

impl Structure {
    pub fn new(p: &dyn Mpcc) -> Result<Structure> {
        let (n, m) = (p.n(), p.m());
        let all = n + 2 * m;
        let jac = elastic_pattern(p.jac_pattern())?;
        // the second derivatives are those of the program, in its columns
        let h = p.hess_pattern();
        let mut col_ptr = h.col_ptr().to_vec();
        col_ptr.resize(all + 1, h.nnz());
        let hess = Pattern::new(all, all, col_ptr, h.row_idx().to_vec())?;
        let violations = (0..2 * m).map(|k| (k % m, n + k));
        let lifts = p.lifts().iter().copied().chain(violations).collect();
        Ok(Structure { weights: vec![1.0; m], lifts, jac, hess })
    }

    /// Its bounds, from those of the program.
    pub fn bounds(&self, inner: &Bounds) -> Bounds {
        let (n, m) = (inner.xl.len(), inner.cl.len());
        let mut out = Bounds::free(n + 2 * m, m);
        out.xl = [&inner.xl[..], &vec![0.0; 2 * m]].concat();
        out.xu[..n].copy_from_slice(&inner.xu);
        (out.cl, out.cu) = (inner.cl.clone(), inner.cu.clone());
        out
    }

    /// The point `x[n]` with rows `c[m]`, and what they violate.
    pub fn point(&self, x: &[f64], c: &[f64], bounds: &Bounds) -> Vec<f64> {
        let over = c.iter().zip(&bounds.cu).map(|(c, u)| (c - u).max(0.0));
        let under = c.iter().zip(&bounds.cl).map(|(c, l)| (l - c).max(0.0));
        x.iter().copied().chain(over).chain(under).collect()
    }
}

/// The program over the original one.
pub(super) struct Violation<'a> {
    pub inner: &'a mut dyn Mpcc,
    pub st: &'a Structure,
}

impl Nlp for Violation<'_> {
    fn n(&self) -> usize {
        self.inner.n() + 2 * self.inner.m()
    }
    fn m(&self) -> usize {
        self.inner.m()
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.st.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.st.hess
    }
    fn eval(&mut self, x: &[f64], c: &mut [f64]) -> std::result::Result<f64, EvalError> {
        let (n, m) = (self.inner.n(), self.inner.m());
        self.inner.eval(&x[..n], c)?;
        let (over, under) = x[n..].split_at(m);
        let mut f = 0.0;
        for (i, c) in c.iter_mut().enumerate() {
            *c += under[i] - over[i];
            f += self.st.weights[i] * (over[i] + under[i]);
        }
        Ok(f)
    }
    fn derivatives(&mut self, x: &[f64], grad: &mut [f64], jac: &mut [f64]) -> EvalResult {
        let (n, m) = (self.inner.n(), self.inner.m());
        let nnz = jac.len() - 2 * m;
        self.inner.derivatives(&x[..n], &mut grad[..n], &mut jac[..nnz])?;
        grad[..n].fill(0.0);
        grad[n..n + m].copy_from_slice(&self.st.weights);
        grad[n + m..].copy_from_slice(&self.st.weights);
        jac[nnz..nnz + m].fill(-1.0);
        jac[nnz + m..].fill(1.0);
        Ok(())
    }
    fn hessian(&mut self, x: &[f64], _: f64, y: &[f64], hess: &mut [f64]) -> EvalResult {
        self.inner.hessian(&x[..self.inner.n()], 0.0, y, hess)
    }
}

impl Mpcc for Violation<'_> {
    fn pairs(&self) -> &[(usize, usize)] {
        self.inner.pairs()
    }
    fn lifts(&self) -> &[(usize, usize)] {
        &self.st.lifts
    }
    fn n_groups(&self) -> usize {
        self.inner.n_groups()
    }
    fn group(&self, pair: usize) -> usize {
        self.inner.group(pair)
    }
    fn branch(&self, sides: &[Side], bounds: &mut Bounds) {
        self.inner.branch(sides, bounds);
    }
    fn enter_branch(&self, from: &[Side], to: &[Side], x: &mut [f64]) {
        self.inner.enter_branch(from, to, x);
    }
    fn set_polishing(&mut self, on: bool) {
        self.inner.set_polishing(on);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::func::{Callback, Dims};
    use crate::mpcc::{Lifted, Member, MpccSettings, MpccSolver};
    use crate::nlp::{CallbackNlp, Control, Outcome};

    /// Rows `c(x)` in `x ∈ ℝ²`, with `0 ≤ x_0 ⊥ x_1 ≥ 0`.
    fn program(m: usize, c: fn(&[f64], &mut [f64])) -> Lifted<CallbackNlp> {
        let d = Dims { x: 2, u: 0, p: 0 };
        let f = Callback::new("f", d, 1, |p, o| {
            o[0] = p.x[0] * p.x[1];
            0
        });
        let c = Callback::new("c", d, m, move |p, o| {
            c(p.x, o);
            0
        });
        let inner = CallbackNlp::new(2, 0, Arc::new(f), Some(Arc::new(c))).unwrap();
        Lifted::new(inner, &[(Member::Variable(0), Member::Variable(1))]).unwrap()
    }

    /// The gradient of the Lagrangian against differences of it: rows have those of the program, and `p`, `q` their own.
    #[test]
    fn derivatives_against_differences() {
        let mut p = program(2, |x, c| {
            c[0] = x[0] * x[0] * x[1];
            c[1] = x[0] + 3.0 * x[1] * x[1];
        });
        let mut st = Structure::new(&p).unwrap();
        st.weights = vec![1.0, 0.25];
        let mut v = Violation { inner: &mut p, st: &st };
        let (x, y) = ([0.7, 1.3, 0.2, 0.1, 0.0, 0.4], [0.6, -0.8]);
        let mut lagrangian = |x: &[f64]| {
            let mut c = [0.0; 2];
            let f = v.eval(x, &mut c).unwrap();
            let (mut g, mut jac) = (vec![0.0; 6], vec![0.0; v.jac_pattern().nnz()]);
            v.derivatives(x, &mut g, &mut jac).unwrap();
            crate::linalg::csc::mul_add_transposed(v.jac_pattern(), &jac, &y, &mut g, 1.0);
            (f + y[0] * c[0] + y[1] * c[1], g)
        };
        let (_, g) = lagrangian(&x);
        let h = 1e-6;
        for j in 0..6 {
            let mut at = |d: f64| {
                let mut x = x;
                x[j] += d;
                lagrangian(&x).0
            };
            let difference = (at(h) - at(-h)) / (2.0 * h);
            assert!((g[j] - difference).abs() < 1e-7, "{j}: {} {difference}", g[j]);
        }
    }

    fn solved(m: usize, c: fn(&[f64], &mut [f64]), low: &[f64]) -> crate::mpcc::Solution {
        solved_as(false, m, c, low)
    }

    fn solved_as(is_part: bool, m: usize, c: fn(&[f64], &mut [f64]), low: &[f64]) -> crate::mpcc::Solution {
        let mut p = program(m, c);
        let mut solver = MpccSolver::new(&mut p, MpccSettings::default()).unwrap();
        solver.is_part = is_part;
        let mut bounds = Bounds::free(2, m);
        bounds.xl = vec![0.0; 2];
        bounds.cl = low.to_vec();
        solver.solve(&mut p, &bounds, &[0.5, 0.5], &mut Control::default()).clone()
    }

    /// `x_0 ≥ 1` and `x_1 ≥ 1` with `x_0 ⊥ x_1`: one of them can be had. The corner, where both are missed and every relaxation
    /// of the pair is stationary, is not what shows it.
    #[test]
    fn a_claim_that_there_is_no_solution_rests_on_the_least_violation() {
        let s = solved(2, |x, c| c.copy_from_slice(x), &[1.0, 1.0]);
        assert_eq!(s.outcome, Outcome::Infeasible);
        let missed: f64 = s.x.iter().map(|x| (1.0 - x).max(0.0)).sum();
        assert!((missed - 1.0).abs() < 1e-8 && s.x[0].min(s.x[1]).abs() < 1e-8, "{:?}", s.x);
        assert!(s.conflict.is_some_and(|c| !c.rows.is_empty()));
    }

    /// The solver of a least violation does not look for that of its own where it finds no solution: there would be no end. Any
    /// program without a solution shows it, as only numbers that are too large to be added leave a least violation without one.
    #[test]
    fn the_violation_of_a_violation_is_not_asked_for() {
        let s = solved_as(true, 2, |x, c| c.copy_from_slice(x), &[1.0, 1.0]);
        assert_eq!(s.outcome, Outcome::Stalled);
        assert!(s.conflict.is_none());
    }

    /// Rows that one of the branches meets.
    #[test]
    fn a_branch_that_meets_the_rows_is_found() {
        let s = solved(2, |x, c| c.copy_from_slice(&[x[0] + x[1], x[0] - x[1]]), &[1.0, 0.5]);
        assert_eq!(s.outcome, Outcome::Solved);
        assert!(s.x[1].abs() < 1e-10 && s.x[0] > 1.0 - 1e-9, "{:?}", s.x);
    }
}
