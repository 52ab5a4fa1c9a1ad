//! Radau IIA with three stages, order 5, for stiff modes and for sliding modes.
//!
//! ```text
//! Z_i = h Σ_j a_ij F(x0 + Z_j, α_j),   0 = c(x0 + Z_i),   x1 = x0 + Z_3
//! ```
//!
//! The last two hold at every stage point, so nothing drifts. Simplified Newton iteration with the Jacobian at the
//! start of the step; the transformation that decouples the stages into a real and a complex system, the estimate of
//! the error and the transformed tolerance are those of E. Hairer, G. Wanner, *Solving Ordinary Differential
//! Equations II* (1996), section IV.8.

use super::field::Field;
use super::newton::Newton;
use super::step::{derivative, horner, norm, Step};
use crate::error::Result;
use crate::func::EvalError;
use crate::tableau::{Family, Tableau};
use nalgebra::{Complex, Matrix3, Vector3};

/// Newton iterations at most.
pub(super) const MAX_NEWTON: usize = 10;

/// How an attempt ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Attempt {
    /// Size of the local error relative to the tolerance.
    Error(f64),
    /// The iteration did not converge.
    Diverged,
}

/// The method with its memory.
pub(super) struct Radau {
    c: [f64; 3],
    pub(super) a_inv: Matrix3<f64>,
    /// Real eigenvalue of the inverse, and the complex one.
    gamma: f64,
    complex_gamma: Complex<f64>,
    t: Matrix3<f64>,
    t_inv: Matrix3<f64>,
    /// Values at the stages to coefficients of powers.
    to_powers: Matrix3<f64>,
    /// Increments and weights at the stages.
    pub(super) z: [Vec<f64>; 3],
    r: [Vec<f64>; 3],
    /// The matrices of the iteration.
    matrix: Newton,
    /// Weights at the start of the step.
    alpha: Vec<f64>,
    /// Sizes of the unknowns at the start of the step: of the states, and 1 for weights.
    size: Vec<f64>,
    prepared: bool,
    /// The iteration converges so fast that the next step may have the same Jacobian; this one is from a step before.
    keep: bool,
    stale: bool,
    /// Coefficients of powers of the relative time of the last step that was accepted, of increments and weights; its length
    /// and its end.
    last: [Vec<f64>; 3],
    last_h: f64,
    end: f64,
    pair: Vec<Complex<f64>>,
    err: Vec<f64>,
    layer: Vec<f64>,
    /// Reciprocal tolerances of the states, by their values at both ends of the step.
    weights: Vec<f64>,
    pub(super) newton: usize,
    pub(super) factorisations: usize,
    /// Iterations of the last attempt.
    pub(super) last_newton: usize,
    /// What is left of the last increment, as a part of it, by the iterations before; infinite where there were none.
    rest: f64,
}

impl Radau {
    pub(super) fn new(field: &Field, most: usize) -> Result<Radau> {
        let nx = field.nx;
        let tab = Tableau::new(Family::RadauIia, 3)?;
        let c = [tab.c[0], tab.c[1], tab.c[2]];
        let a = Matrix3::from_row_slice(&tab.a);
        // collocation matrices are invertible
        let a_inv = a.try_inverse().unwrap_or_else(Matrix3::identity);
        let s = 9f64.cbrt();
        let gamma = 30.0 / (6.0 + s * (s - 1.0));
        let (re, im) = ((12.0 - s * (s - 1.0)) / 60.0, s * (s + 1.0) * 3f64.sqrt() / 60.0);
        let size = re * re + im * im;
        let complex_gamma = Complex::new(re / size, im / size);
        // eigenvectors are products of two rows of what is singular
        let m = a_inv - Matrix3::identity() * gamma;
        let v = m.row(0).transpose().cross(&m.row(1).transpose());
        let m = a_inv.map(Complex::from) - Matrix3::identity() * complex_gamma;
        let row = |i: usize| Vector3::new(m[(i, 0)], m[(i, 1)], m[(i, 2)]);
        let (p, q) = (row(0), row(1));
        let w = Vector3::new(p.y * q.z - p.z * q.y, p.z * q.x - p.x * q.z, p.x * q.y - p.y * q.x);
        let t = Matrix3::from_columns(&[v / v.norm(), w.map(|v| v.re), w.map(|v| -v.im)]);
        let n = nx + most;
        Ok(Radau {
            c,
            a_inv,
            gamma,
            complex_gamma,
            t,
            t_inv: t.try_inverse().unwrap_or_else(Matrix3::identity),
            to_powers: Matrix3::from_fn(|i, j| c[i].powi(j as i32 + 1)).try_inverse().unwrap_or_else(Matrix3::identity),
            z: [vec![0.0; n], vec![0.0; n], vec![0.0; n]],
            r: [vec![0.0; n], vec![0.0; n], vec![0.0; n]],
            matrix: Newton::new(field, most),
            alpha: vec![0.0; most],
            size: vec![1.0; n],
            prepared: false,
            keep: false,
            stale: false,
            last: [vec![0.0; n], vec![0.0; n], vec![0.0; n]],
            last_h: 0.0,
            end: f64::NAN,
            pair: vec![Complex::default(); n],
            err: vec![0.0; n],
            layer: vec![0.0; n],
            weights: vec![0.0; nx],
            newton: 0,
            factorisations: 0,
            last_newton: 0,
            rest: f64::INFINITY,
        })
    }

    /// The step begins somewhere else.
    pub(super) fn invalidate(&mut self) {
        self.prepared = false;
    }

    /// The next step has nothing to do with the last one: other modes, other data.
    pub(super) fn forget(&mut self) {
        (self.keep, self.end, self.rest) = (false, f64::NAN, f64::INFINITY);
    }

    /// May the next step have the Jacobian of this one?
    pub(super) fn keeps(&self) -> bool {
        self.keep
    }

    /// The step is accepted and ends at `t1`.
    pub(super) fn accept(&mut self, s: &Step, r: usize, t1: f64) {
        let nx = s.x0.len();
        for i in 0..nx + r {
            let from = if i < nx { 0.0 } else { self.alpha[i - nx] };
            let c = self.to_powers * Vector3::new(self.z[0][i] - from, self.z[1][i] - from, self.z[2][i] - from);
            (self.last[0][i], self.last[1][i], self.last[2][i]) = (c.x, c.y, c.z);
        }
        (self.last_h, self.end) = (s.h, t1);
    }

    /// A bound on how fast the mode is.
    pub(super) fn speed(&mut self) -> f64 {
        self.matrix.speed(&self.size)
    }

    /// Matrices for the step: those of the last one where it followed them well and this one follows it.
    fn prepare(&mut self, field: &mut Field, s: &Step) -> std::result::Result<(), EvalError> {
        if self.prepared {
            return Ok(());
        }
        let (nx, r) = (field.nx, field.n_alg());
        for (i, (to, x)) in self.size.iter_mut().zip(&s.x0).enumerate() {
            let size = field.size(i, *x);
            *to = if size > 0.0 { size } else { 1.0 };
        }
        self.size[nx..].fill(1.0);
        if r > 0 {
            field.hidden(s.t, &s.x0)?;
            self.alpha[..r].copy_from_slice(&field.alpha[..r]);
        }
        self.stale = self.keep && self.end == s.t;
        if !self.stale {
            self.matrix.evaluate(field, s.t, &s.x0, &self.alpha)?;
        }
        self.prepared = true;
        Ok(())
    }

    /// Computes the end of a step from `x0`, `f0`; `tolerances` are the absolute and relative ones of the states, `shrink` what their
    /// reciprocals are multiplied with for the estimate of lower order, `tol` what the iteration error may be.
    pub(super) fn attempt(
        &mut self,
        field: &mut Field,
        s: &mut Step,
        tolerances: (&[f64], &[f64]),
        shrink: f64,
        tol: f64,
    ) -> std::result::Result<Attempt, EvalError> {
        self.last_newton = 0;
        loop {
            self.prepare(field, s)?;
            let h = s.h;
            let known = self.matrix.is_factorised(h);
            let regular = self.matrix.factorise(h, (self.gamma, self.complex_gamma), &self.size);
            self.factorisations += usize::from(!known);
            if regular && self.iterate(field, s, tolerances, (shrink, tol))? {
                break;
            }
            if !self.stale {
                return Ok(Attempt::Diverged);
            }
            // not with this Jacobian
            (self.keep, self.prepared) = (false, false);
        }
        for (x1, (x0, z)) in s.x1.iter_mut().zip(s.x0.iter().zip(&self.z[2])) {
            *x1 = x0 + z;
        }
        s.n_k = 3;
        self.weigh(s, tolerances);
        self.error(field, s, shrink)
    }

    /// Weights by the states at both ends of the step. The velocity at its start times its length is no size of a state here: in a
    /// stiff transient it is as many times the way to its end as the step is longer than the transient.
    fn weigh(&mut self, s: &Step, (atol, rtol): (&[f64], &[f64])) {
        for (i, w) in self.weights.iter_mut().enumerate() {
            let size = s.x0[i].abs().max((s.x0[i] + self.z[2][i]).abs());
            *w = 1.0 / (atol[i] + rtol[i] * size).max(f64::MIN_POSITIVE);
        }
    }

    /// Increments and weights to begin with: the last step goes on where this one follows it, else the first derivative is
    /// all that is known.
    fn guess(&mut self, s: &Step, r: usize) {
        let nx = s.x0.len();
        let follows = self.matrix.is_sparse() && self.end == s.t && self.last_h > 0.0;
        for (z, c) in self.z.iter_mut().zip(&self.c) {
            if follows {
                let tau = 1.0 + c * s.h / self.last_h;
                let powers = [tau - 1.0, tau * tau - 1.0, tau * tau * tau - 1.0];
                for i in 0..nx + r {
                    let from = if i < nx { 0.0 } else { self.alpha[i - nx] };
                    z[i] = from + (0..3).map(|k| powers[k] * self.last[k][i]).sum::<f64>();
                }
                continue;
            }
            z[nx..nx + r].copy_from_slice(&self.alpha[..r]);
            for (z, f) in z.iter_mut().zip(&s.f0) {
                *z = c * s.h * f;
            }
        }
    }

    /// Newton's method with the matrices as they are; says whether it has converged. How fast it does is known from the steps before, which
    /// are trusted less from step to step (E. Hairer, G. Wanner, section IV.8): one iteration is enough where modes are affine. Where the
    /// matrices are sparse, evaluating
    /// them and finding their factors costs more than the iterations that old ones take more: those that the iteration
    /// converges fast with serve the next step too (E. Hairer, G. Wanner, section IV.8).
    fn iterate(
        &mut self,
        field: &mut Field,
        s: &mut Step,
        tolerances: (&[f64], &[f64]),
        (shrink, tol): (f64, f64),
    ) -> std::result::Result<bool, EvalError> {
        /// A rate that leaves the Jacobian good enough for the next step.
        const FAST: f64 = 1e-3;
        /// Power of what is known from the step before.
        const TRUST: f64 = 0.8;
        let (nx, r) = (field.nx, field.n_alg());
        let n = nx + r;
        self.guess(s, r);
        let (mut before, mut rate) = (0.0, 0.0);
        for it in 0..MAX_NEWTON {
            let worst = self.residuals(field, s)?;
            self.newton += 1;
            self.last_newton += 1;
            self.direction(n);
            for (z, w) in self.z.iter_mut().zip(&self.r) {
                for (z, w) in z.iter_mut().zip(w).take(n) {
                    *z += w;
                }
            }
            self.weigh(s, tolerances);
            let sizes = self.r.iter().map(|w| norm(&w[..nx], &self.weights) * shrink);
            let size = sizes.fold(0.0f64, f64::max);
            if !size.is_finite() {
                return Ok(false);
            }
            if it > 0 {
                rate = if before > 0.0 { size / before } else { 0.0 };
                if rate >= 0.99 && size > tol {
                    return Ok(false);
                }
                self.keep = self.matrix.is_sparse() && rate <= FAST;
            }
            if it == 0 {
                self.rest = self.rest.max(f64::EPSILON).powf(TRUST);
                if r == 0 && size * self.rest <= tol {
                    self.write_stages(s);
                    return Ok(true);
                }
            } else {
                self.rest = rate.min(0.99) / (1.0 - rate.min(0.99));
            }
            let rest = if it > 0 { size * self.rest } else { size };
            // constraints are relative to the sizes of the states
            let on_surface = r == 0 || it > 0 && worst * rate.max(1e-3) <= 1e-14;
            if size == 0.0 || it > 0 && rest <= tol && (on_surface || size <= 1e-6 * tol) {
                return Ok(true);
            }
            before = size;
        }
        Ok(false)
    }

    /// The derivatives at the stages that belong to the increments.
    fn write_stages(&self, s: &mut Step) {
        for (j, k) in s.k.iter_mut().enumerate() {
            for (i, k) in k.iter_mut().enumerate().take(3) {
                *k = (0..3).map(|m| self.a_inv[(i, m)] * self.z[m][j]).sum::<f64>() / s.h;
            }
        }
    }

    /// Residuals of all stages, the derivatives in the step; returns the largest constraint.
    fn residuals(&mut self, field: &mut Field, s: &mut Step) -> std::result::Result<f64, EvalError> {
        let (nx, r, h) = (field.nx, field.n_alg(), s.h);
        let mut worst = 0.0f64;
        for i in 0..3 {
            for ((y, x), z) in s.y.iter_mut().zip(&s.x0).zip(&self.z[i]) {
                *y = x + z;
            }
            let t = s.t + self.c[i] * h;
            field.parts(t, &s.y)?;
            field.alpha[..r].copy_from_slice(&self.z[i][nx..nx + r]);
            field.combine(&mut s.f);
            for (k, f) in s.k.iter_mut().zip(&s.f) {
                k[i] = *f;
            }
            for j in 0..nx {
                let sum: f64 = (0..3).map(|m| self.a_inv[(i, m)] * self.z[m][j]).sum();
                self.r[i][j] = s.f[j] - sum / h;
            }
            if r > 0 {
                field.indicators(t, &s.y)?;
                for j in 0..r {
                    let c = field.constraint(j);
                    worst = worst.max(c.abs());
                    self.r[i][nx + j] = -c;
                }
            }
        }
        Ok(worst)
    }

    /// Turns residuals into increments.
    fn direction(&mut self, n: usize) {
        let [r0, r1, r2] = &mut self.r;
        for i in 0..n {
            let w = self.t_inv * Vector3::new(r0[i], r1[i], r2[i]);
            r0[i] = w.x;
            self.pair[i] = Complex::new(w.y, w.z);
        }
        self.matrix.solve_real(&mut r0[..n]);
        self.matrix.solve_complex(&mut self.pair[..n]);
        for i in 0..n {
            let w = self.t * Vector3::new(r0[i], self.pair[i].re, self.pair[i].im);
            (r0[i], r1[i], r2[i]) = (w.x, w.y, w.z);
        }
    }

    /// Estimate of the error from an embedded formula of order 3; it is tangential to the constraints.
    fn error(&mut self, field: &mut Field, s: &mut Step, shrink: f64) -> std::result::Result<Attempt, EvalError> {
        let nx = field.nx;
        let root = 6f64.sqrt();
        let e = [-(13.0 + 7.0 * root) / 3.0, (-13.0 + 7.0 * root) / 3.0, -1.0 / 3.0];
        let mut size = f64::INFINITY;
        for pass in 0..2 {
            if pass == 0 {
                s.f.copy_from_slice(&s.f0);
            } else {
                for i in 0..nx {
                    s.y[i] = s.x0[i] + self.err[i];
                }
                field.rhs(s.t, &s.y, &mut s.f)?;
            }
            self.err.fill(0.0);
            for i in 0..nx {
                self.err[i] = s.f[i] + (0..3).map(|m| e[m] * self.z[m][i]).sum::<f64>() / s.h;
            }
            self.matrix.solve_real(&mut self.err);
            size = norm(&self.err[..nx], &self.weights) * shrink;
            // the estimate is bad for stiff components far from equilibrium: filtered twice it is not
            if size < 1.0 {
                break;
            }
        }
        Ok(if size.is_finite() { Attempt::Error(size) } else { Attempt::Diverged })
    }

    /// Puts the end onto the constraints to rounding and evaluates the derivative there.
    pub(super) fn finish(&self, field: &mut Field, s: &mut Step) -> std::result::Result<(), EvalError> {
        field.rhs(s.t + s.h, &s.x1, &mut s.f1)?;
        if field.project(s.t + s.h, &mut s.x1)? {
            field.rhs(s.t + s.h, &s.x1, &mut s.f1)?;
        }
        Ok(())
    }

    /// How far the dense output is from the solution at relative time `tau`, by one Newton step of the implicit Euler method from there,
    /// and what of that comes from the distance at the start, as in a layer that the step has passed over: the polynomial goes
    /// through the start, and is carried away from the stages by it. See [`Radau::off`].
    pub(super) fn defect(&mut self, field: &mut Field, s: &mut Step, tau: f64) -> std::result::Result<(), EvalError> {
        for (y, p) in s.y.iter_mut().zip(&s.poly) {
            *y = horner(p, tau);
        }
        field.rhs(s.t + tau * s.h, &s.y, &mut s.f)?;
        let share: f64 = self.c.iter().map(|c| 1.0 - tau / c).product();
        for (off, f, tau, share) in [(&mut self.err, &s.f, tau, 1.0), (&mut self.layer, &s.f0, 0.0, share)] {
            off.fill(0.0);
            for (o, (f, p)) in off.iter_mut().zip(f.iter().zip(&s.poly)) {
                *o = share * (f - derivative(p, 1, tau) / s.h);
            }
            self.matrix.solve_real(off);
        }
        Ok(())
    }

    /// State `i` of what [`Radau::defect`] has found, with or without what comes from the start.
    pub(super) fn off(&self, i: usize, with_start: bool) -> f64 {
        self.err[i] - if with_start { 0.0 } else { self.layer[i] }
    }

    /// Writes the dense output: the collocation polynomial. At the first step of a mode (`fresh`) it also has the
    /// derivative of the start, where that changes little, so that a surface is left to the right side.
    pub(super) fn dense(&self, s: &mut Step, fresh: bool) {
        s.degree = 4;
        for (i, p) in s.poly.iter_mut().enumerate() {
            let c = self.to_powers * Vector3::new(self.z[0][i], self.z[1][i], s.x1[i] - s.x0[i]);
            *p = [s.x0[i], c.x, c.y, c.z, 0.0, 0.0, 0.0, 0.0];
        }
        let slope = |i: usize| s.h * s.f0[i] - s.poly[i][1];
        let size = |v: &dyn Fn(usize) -> f64| {
            (0..s.poly.len()).map(|i| v(i) / self.size[i]).fold(0.0f64, |m, v| m.max(v.abs()))
        };
        if fresh && size(&slope) <= 0.3 * size(&|i| s.poly[i][1].abs().max((s.x1[i] - s.x0[i]).abs())) {
            // a multiple of the polynomial that vanishes at all nodes, with slope −c1 c2 at 0
            let [a, b, _] = self.c;
            let w = [0.0, -a * b, a + b + a * b, -(1.0 + a + b), 1.0];
            for i in 0..s.poly.len() {
                let m = (s.h * s.f0[i] - s.poly[i][1]) / w[1];
                for (p, w) in s.poly[i].iter_mut().zip(&w) {
                    *p += m * w;
                }
            }
        }
    }

    /// Weights of the values at the start, at the first two stages and at the end in the cubic through them at relative time `s`.
    pub(super) fn cubic(&self, s: f64) -> [f64; 4] {
        let [a, b, _] = self.c;
        let nodes = [0.0, a, b, 1.0];
        std::array::from_fn(|m| {
            let others = nodes.iter().enumerate().filter(|(k, _)| *k != m);
            others.map(|(_, c)| (s - c) / (nodes[m] - c)).product()
        })
    }

    /// What the slope at the start of a step adds to its dense output at relative time `s`, where that has it, see [`Radau::dense`]: the multiple of the
    /// polynomial that vanishes at all nodes whose slope there is one.
    pub(super) fn bend(&self, s: f64) -> f64 {
        let [a, b, _] = self.c;
        s * (s - a) * (s - b) * (s - 1.0) / (-a * b)
    }

    /// Slopes at the start of the terms of [`Radau::cubic`], that of the start itself, which all others are relative to, left out.
    pub(super) fn slopes_at_start(&self) -> [f64; 4] {
        let row = self.to_powers.row(0);
        [0.0, row[0], row[1], row[2]]
    }

    /// Value of the cubic through `start`, row `i` at the first two stages, and `end`.
    pub(super) fn between(&self, weights: &[f64; 4], start: f64, i: usize, end: f64) -> f64 {
        weights[0] * start + weights[1] * self.z[0][i] + weights[2] * self.z[1][i] + weights[3] * end
    }

    /// Size of an unknown at the start of the last step: a state, or a weight behind them.
    pub(super) fn size(&self, j: usize) -> f64 {
        self.size[j]
    }

    /// Relative time of stage `i`.
    pub(super) fn node(&self, i: usize) -> f64 {
        self.c[i]
    }
}
