//! Feasibility restoration as the same method on an elastic problem.
//!
//! ```text
//! min ρ Σ(p + q) + ζ/2 ‖D (x − x_r)‖²   s.t.   c_l ≤ c(x) − p + q ≤ c_u,   bounds of x,   p, q ≥ 0
//! ```
//!
//! Wächter and Biegler, section 3.3. Ends when the violation of the original rows has dropped.

use super::allowance;
use super::iterate::{barrier, primal_error, theta, Iterate, RowKind, Shape};
use super::problem::{Bilinear, Bounds, Nlp};
use super::report::{Control, Outcome, Statistics};
use super::settings::IpmSettings;
use super::solver::{Ipm, Measures, Monotone, Start};
use super::start::push_inside;
use crate::error::Result;
use crate::func::{EvalError, EvalResult};
use crate::linalg::csc::Pattern;

const RHO: f64 = 1e3;
/// Share of the violation that may be left.
const KAPPA_RESTO: f64 = 0.9;

/// The restoration solver and its problem's structure.
pub(super) struct Restoration {
    n: usize,
    m: usize,
    jac: Pattern,
    hess: Pattern,
    jac_map: Vec<usize>,
    hess_map: Vec<usize>,
    bilinear: Vec<Bilinear>,
    ipm: Ipm,
    bounds: Bounds,
    start: Vec<f64>,
    reference: Vec<f64>,
    weight: Vec<f64>,
    shape: Shape,
    inner_jac: Vec<f64>,
    inner_hess: Vec<f64>,
}

/// The elastic problem over the original one.
struct Elastic<'a> {
    inner: &'a mut dyn Nlp,
    n: usize,
    m: usize,
    jac: &'a Pattern,
    hess: &'a Pattern,
    jac_map: &'a [usize],
    hess_map: &'a [usize],
    bilinear: &'a [Bilinear],
    reference: &'a [f64],
    weight: &'a [f64],
    inner_jac: &'a mut [f64],
    inner_hess: &'a mut [f64],
}

impl Nlp for Elastic<'_> {
    fn n(&self) -> usize {
        self.n + 2 * self.m
    }
    fn m(&self) -> usize {
        self.m
    }
    fn jac_pattern(&self) -> &Pattern {
        self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        self.hess
    }
    fn bilinear(&self) -> &[Bilinear] {
        self.bilinear
    }
    fn eval(&mut self, x: &[f64], c: &mut [f64]) -> std::result::Result<f64, EvalError> {
        let (n, m) = (self.n, self.m);
        self.inner.eval(&x[..n], c)?;
        let mut f = 0.0;
        for i in 0..m {
            let (p, q) = (x[n + i], x[n + m + i]);
            c[i] += q - p;
            f += RHO * (p + q);
        }
        for j in 0..n {
            let d = x[j] - self.reference[j];
            f += 0.5 * self.weight[j] * d * d;
        }
        Ok(f)
    }
    fn derivatives(&mut self, x: &[f64], grad: &mut [f64], jac: &mut [f64]) -> EvalResult {
        let (n, m) = (self.n, self.m);
        self.inner.derivatives(&x[..n], &mut grad[..n], self.inner_jac)?;
        for j in 0..n {
            grad[j] = self.weight[j] * (x[j] - self.reference[j]);
        }
        grad[n..].fill(RHO);
        let nnz = self.inner_jac.len();
        for (k, v) in self.inner_jac.iter().enumerate() {
            jac[self.jac_map[k]] = *v;
        }
        for i in 0..m {
            jac[self.jac_map[nnz + i]] = -1.0;
            jac[self.jac_map[nnz + m + i]] = 1.0;
        }
        Ok(())
    }
    fn hessian(&mut self, x: &[f64], w: f64, y: &[f64], hess: &mut [f64]) -> EvalResult {
        self.inner.hessian(&x[..self.n], 0.0, y, self.inner_hess)?;
        hess.fill(0.0);
        let nnz = self.inner_hess.len();
        for (k, v) in self.inner_hess.iter().enumerate() {
            hess[self.hess_map[k]] += *v;
        }
        for j in 0..self.n {
            hess[self.hess_map[nnz + j]] += w * self.weight[j];
        }
        Ok(())
    }
}

impl Restoration {
    pub fn new(nlp: &mut dyn Nlp, settings: IpmSettings) -> Result<Restoration> {
        let (n, m) = (nlp.n(), nlp.m());
        let (mut rows, mut cols) = (Vec::new(), Vec::new());
        let jp = nlp.jac_pattern();
        for j in 0..n {
            for &i in jp.rows(j) {
                rows.push(i);
                cols.push(j);
            }
        }
        let jac_nnz = rows.len();
        for i in 0..m {
            rows.push(i);
            cols.push(n + i);
        }
        for i in 0..m {
            rows.push(i);
            cols.push(n + m + i);
        }
        let (jac, jac_map) = Pattern::from_triplets(m, n + 2 * m, &rows, &cols);
        rows.clear();
        cols.clear();
        let hp = nlp.hess_pattern();
        for j in 0..n {
            for &i in hp.rows(j) {
                rows.push(i);
                cols.push(j);
            }
        }
        let hess_nnz = rows.len();
        for j in 0..n {
            rows.push(j);
            cols.push(j);
        }
        let (hess, hess_map) = Pattern::from_triplets(n + 2 * m, n + 2 * m, &rows, &cols);
        let bilinear = nlp.bilinear().to_vec();
        let (mut inner_jac, mut inner_hess) = (vec![0.0; jac_nnz], vec![0.0; hess_nnz]);
        let zeros = vec![0.0; n];
        let elastic = Elastic {
            inner: nlp,
            n,
            m,
            jac: &jac,
            hess: &hess,
            jac_map: &jac_map,
            hess_map: &hess_map,
            bilinear: &bilinear,
            reference: &zeros,
            weight: &zeros,
            inner_jac: &mut inner_jac,
            inner_hess: &mut inner_hess,
        };
        let ipm = Ipm::new(&elastic, IpmSettings { restoration: false, ..settings })?;
        Ok(Restoration {
            n,
            m,
            ipm,
            bounds: Bounds::free(n + 2 * m, m),
            start: vec![0.0; n + 2 * m],
            reference: zeros.clone(),
            weight: zeros,
            shape: Shape::new(n, m),
            inner_jac,
            inner_hess,
            jac,
            hess,
            jac_map,
            hess_map,
            bilinear,
        })
    }

    pub fn statistics(&self) -> Statistics {
        *self.ipm.statistics()
    }

    /// The point reached.
    pub fn x(&self) -> &[f64] {
        &self.ipm.iterate().x[..self.n]
    }

    /// Multipliers of the rows there.
    pub fn y(&self) -> &[f64] {
        &self.ipm.iterate().y
    }

    /// Runs from the point `it` with rows `c`; true when the violation has dropped enough.
    #[allow(clippy::too_many_arguments)]
    pub fn run(
        &mut self,
        nlp: &mut dyn Nlp,
        bounds: &Bounds,
        it: &Iterate,
        c: &[f64],
        mu: f64,
        settings: IpmSettings,
        control: &mut Control,
    ) -> (bool, Outcome) {
        let (n, m) = (self.n, self.m);
        self.shape.classify(bounds);
        self.bounds.xl[..n].copy_from_slice(&bounds.xl);
        self.bounds.xu[..n].copy_from_slice(&bounds.xu);
        self.bounds.cl.copy_from_slice(&bounds.cl);
        self.bounds.cu.copy_from_slice(&bounds.cu);
        let zeta = mu.sqrt();
        for j in 0..n {
            self.reference[j] = it.x[j];
            self.weight[j] = zeta / it.x[j].abs().max(1.0).powi(2);
            self.start[j] = it.x[j];
        }
        for i in 0..m {
            let free = self.shape.row[i] == RowKind::Free;
            let r = if free { 0.0 } else { c[i] - it.s[i] };
            // (33): p and q on the central path of the elastic problem
            let h = 0.5 * (mu / RHO - r);
            let q = h + (h * h + 0.5 * mu * r.abs() / RHO).sqrt().max(0.0);
            let q = if free { 0.0 } else { q.max(1e-10) };
            let p = if free { 0.0 } else { (r + q).max(1e-10) };
            for (k, v) in [(n + i, p), (n + m + i, q)] {
                self.bounds.xl[k] = 0.0;
                self.bounds.xu[k] = if free { 0.0 } else { f64::INFINITY };
                self.start[k] = v;
            }
        }
        let th0 = theta(&self.shape, &it.s, c);
        *self.ipm.settings_mut() =
            IpmSettings { restoration: false, max_iter: settings.max_iter.min(500), bound_push: 1e-10, ..settings };
        self.ipm.set_phase(b'r');
        let Restoration { shape, start, ipm, jac, hess, jac_map, hess_map, bilinear, reference, weight, .. } = self;
        let mut elastic = Elastic {
            inner: nlp,
            n,
            m,
            jac,
            hess,
            jac_map,
            hess_map,
            bilinear,
            reference,
            weight,
            inner_jac: &mut self.inner_jac,
            inner_hess: &mut self.inner_hess,
        };
        let mut found = false;
        // p − q is the violation of the original rows, up to what the elastic rows themselves are off
        let mut probe = |x: &[f64]| {
            let mut t = 0.0;
            for i in 0..m {
                if shape.row[i] != RowKind::Free {
                    t += (x[n + i] - x[n + m + i]).abs();
                }
            }
            found = t <= KAPPA_RESTO * th0;
            found
        };
        let mut rule = Monotone { mu_init: mu, tol: 1e-8, primal_tol: 1e-8 };
        let outcome = ipm.run(&mut elastic, &self.bounds, Start::Cold(start), &mut rule, control, Some(&mut probe));
        (found, outcome)
    }
}

impl Ipm {
    /// Feasibility restoration: the same method on the elastic problem. `Some` ends the solve.
    pub(super) fn restore(&mut self, nlp: &mut dyn Nlp, control: &mut Control, m: &Measures) -> Option<Outcome> {
        let th0 = theta(&self.shape, &self.it.s, &self.v.c);
        if m.primal <= 1e-2 * m.level.mu.clamp(1e-10, 1e-8) {
            // nothing to restore: the jam is not one of feasibility
            return Some(Outcome::Stalled);
        }
        let phi0 = barrier(&self.shape, &self.bounds, &self.it.x, &self.it.s, self.v.f, self.level.mu);
        self.filter.add(th0, phi0);
        let mut resto = match self.resto.take() {
            Some(r) => r,
            None => match Restoration::new(nlp, self.settings) {
                Ok(r) => Box::new(r),
                Err(_) => return Some(Outcome::Stalled),
            },
        };
        // the iteration that restores is one itself
        let left = self.settings.max_iter.saturating_sub(self.stats.iterations + 1);
        let settings = IpmSettings { max_iter: left, ..self.settings };
        let mu = self.level.mu.max(m.primal);
        let (bounds, at, c) = (&self.bounds, &self.it, &self.v.c);
        let (found, outcome) = allowance::but_one(|| resto.run(nlp, bounds, at, c, mu, settings, control));
        let cost = resto.statistics();
        self.stats.iterations += cost.iterations;
        self.stats.restoration_iterations += cost.iterations;
        self.stats.factorisations += cost.factorisations;
        self.stats.evaluations += cost.evaluations;
        self.it.x.copy_from_slice(resto.x());
        self.trial.y.copy_from_slice(resto.y());
        self.resto = Some(resto);
        if !self.evaluate(nlp) || !self.differentiate(nlp) {
            return Some(Outcome::Failed);
        }
        let Ipm { it, bounds: b, shape, v, .. } = self;
        for j in 0..it.x.len() {
            if !shape.fixed[j] {
                it.x[j] = push_inside(it.x[j], b.xl[j], b.xu[j], 1e-10);
            }
        }
        for i in 0..it.s.len() {
            if shape.row[i] == RowKind::Inequality {
                it.s[i] = push_inside(v.c[i], b.cl[i], b.cu[i], 1e-8);
            }
        }
        self.start_bound_multipliers(false);
        let Ipm { it, .. } = self;
        for z in [&mut it.zl, &mut it.zu, &mut it.vl, &mut it.vu] {
            z.iter_mut().for_each(|z| *z = z.min(1e3));
        }
        self.estimate_multipliers();
        if found {
            return None;
        }
        match outcome {
            Outcome::Solved if primal_error(&self.shape, &self.it, &self.v.c) > 1e-8 => {
                // the multipliers of the least violation say which rows conflict
                self.it.y.copy_from_slice(&self.trial.y);
                Some(Outcome::Infeasible)
            }
            Outcome::Solved => None,
            Outcome::Stalled | Outcome::MaxIter
                if self.stats.iterations + 1 < self.settings.max_iter && allowance::left() > 1 =>
            {
                Some(Outcome::Stalled)
            }
            other => Some(other),
        }
    }
}
