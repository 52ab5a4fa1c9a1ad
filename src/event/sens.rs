//! Forward sensitivities: the discrete steps differentiated, with the jump at every switch.
//!
//! `S = ∂x(t)/∂(x0, p, u)` at fixed time. A step of length `h` is differentiated with `h` fixed. At a switch that happens
//! where `W(t, x) = 0`, the time moves by `dt = −(∇W S + W_p) / Ẇ⁻`, and at fixed time `S⁺ = S⁻ + (ẋ⁻ − ẋ⁺) dt`
//! (6.25), which holds for crossing, for entering a sliding mode (the result is tangential to the surface) and for
//! leaving it (where the velocity is continuous).

use super::collocation::Collocation;
use super::explicit::Pair;
use super::field::Field;
use super::radau::Radau;
use super::step::Step;
use crate::func::EvalResult;

/// Sensitivities with all memory they need.
pub(super) struct Sens {
    /// Columns: initial states, parameters, controls.
    n_c: usize,
    /// `nx × n_c`, row-major.
    pub(super) s: Vec<f64>,
    y: Vec<f64>,
    k: Vec<f64>,
    jac: Vec<f64>,
    x: Vec<f64>,
    rhs: Vec<f64>,
    step: Collocation,
    /// Derivative of the time of the last switch.
    pub(super) dt: Vec<f64>,
}

impl Sens {
    pub(super) fn new(nx: usize, n_z: usize, most: usize) -> Sens {
        let n_c = n_z - 1;
        let n = 3 * (nx + most);
        Sens {
            n_c,
            s: vec![0.0; nx * n_c],
            y: vec![0.0; nx * n_c],
            k: vec![0.0; 13 * nx * n_c],
            jac: vec![0.0; nx * n_z],
            x: vec![0.0; nx],
            rhs: vec![0.0; n * n_c.max(1)],
            step: Collocation::new(nx, n_z, most),
            dt: vec![0.0; n_c],
        }
    }

    /// Derivatives with respect to a starting state are those of the identity.
    pub(super) fn reset(&mut self) {
        self.s.fill(0.0);
        let nx = self.x.len();
        for i in 0..nx {
            self.s[i * self.n_c + i] = 1.0;
        }
    }

    /// `out = J_x y + J_p`.
    fn product(&self, nx: usize, y: &[f64], jac: &[f64], out: &mut [f64]) {
        let (n_c, n_z) = (self.n_c, self.n_c + 1);
        for i in 0..nx {
            let row = &mut out[i * n_c..(i + 1) * n_c];
            let j = &jac[i * n_z..(i + 1) * n_z];
            row[..nx].fill(0.0);
            row[nx..].copy_from_slice(&j[nx..n_c]);
            for (m, a) in j[..nx].iter().enumerate() {
                if *a != 0.0 {
                    for (r, y) in row.iter_mut().zip(&y[m * n_c..(m + 1) * n_c]) {
                        *r += a * y;
                    }
                }
            }
        }
    }

    /// Over an explicit step, and `rest` behind its end along the velocity.
    pub(super) fn explicit(&mut self, pair: Pair, field: &mut Field, s: &Step, rest: f64) -> EvalResult {
        let (nx, n_c, h) = (field.nx, self.n_c, s.h);
        let (rows, c) = pair.rows();
        let last = rows.len() - 1;
        let mut jac = std::mem::take(&mut self.jac);
        let mut k = std::mem::take(&mut self.k);
        let mut y = std::mem::take(&mut self.y);
        let mut all = || -> EvalResult {
            for (i, row) in rows.iter().enumerate() {
                for ((x, x0), k) in self.x.iter_mut().zip(&s.x0).zip(&s.k) {
                    *x = x0 + h * row.iter().map(|&(j, a)| a * k[j]).sum::<f64>();
                }
                y.copy_from_slice(&self.s);
                for &(j, a) in row.iter() {
                    for (y, k) in y.iter_mut().zip(&k[j * nx * n_c..]) {
                        *y += h * a * k;
                    }
                }
                if i < last || rest != 0.0 {
                    field.jacobian(s.t + c[i] * h, &self.x, &[], &mut jac)?;
                    self.product(nx, &y, &jac, &mut k[i * nx * n_c..(i + 1) * nx * n_c]);
                }
                if i == last {
                    self.s.copy_from_slice(&y);
                    if rest != 0.0 {
                        self.s.iter_mut().zip(&k[i * nx * n_c..]).for_each(|(s, k)| *s += rest * k);
                    }
                }
            }
            Ok(())
        };
        let r = all();
        self.jac = jac;
        self.k = k;
        self.y = y;
        r
    }

    /// Over an implicit step.
    pub(super) fn implicit(&mut self, radau: &Radau, field: &mut Field, s: &Step) -> EvalResult {
        let (nx, n_z, r, n_c) = (field.nx, field.n_z, field.n_alg(), self.n_c);
        let z = [&radau.z[0][..], &radau.z[1], &radau.z[2]];
        self.step.assemble(radau, field, (s.t, s.h), &s.x0, z)?;
        let own = self.step.own();
        let n = 3 * own;
        // a row of ∂F or ∂c times (S; I)
        let along = |row: &[f64], s: &[f64], c: usize| {
            let fixed = if c < nx { 0.0 } else { row[c] };
            row[..nx].iter().enumerate().fold(fixed, |v, (b, j)| v + j * s[b * n_c + c])
        };
        for c in 0..n_c {
            let b = &mut self.rhs[c * n..(c + 1) * n];
            for i in 0..3 {
                for (a, row) in self.step.jac(i).chunks_exact(n_z).enumerate() {
                    b[i * own + a] = along(row, &self.s, c);
                }
                for (a, row) in self.step.g(i).chunks_exact(n_z).enumerate().take(r) {
                    b[i * own + nx + a] = -along(row, &self.s, c);
                }
            }
        }
        for c in 0..n_c {
            let b = &mut self.rhs[c * n..(c + 1) * n];
            self.step.lu.solve(b);
            for a in 0..nx {
                self.s[a * n_c + c] += b[2 * own + a];
            }
        }
        Ok(())
    }

    /// Derivative of the time of a switch, from its derivatives with respect to state, parameters and controls just
    /// before (`n_c` values, see [`Watch::time_gradient`](super::watch::Watch::time_gradient)).
    pub(super) fn time(&mut self, row: &[f64]) {
        let (nx, n_c) = (self.x.len(), self.n_c);
        for (c, dt) in self.dt.iter_mut().enumerate() {
            *dt = if c < nx { 0.0 } else { row[c] };
            for (a, r) in row[..nx].iter().enumerate() {
                *dt += r * self.s[a * n_c + c];
            }
        }
    }

    /// The jump between two velocities.
    pub(super) fn jump(&mut self, before: &[f64], after: &[f64]) {
        for (row, (a, b)) in self.s.chunks_exact_mut(self.n_c).zip(before.iter().zip(after)) {
            for (s, dt) in row.iter_mut().zip(&self.dt) {
                *s += (a - b) * dt;
            }
        }
    }

    /// From derivatives at fixed time to those along the moving time of a jump (`sign` 1), or back (−1).
    pub(super) fn advance(&mut self, velocity: &[f64], sign: f64) {
        for (row, f) in self.s.chunks_exact_mut(self.n_c).zip(velocity) {
            for (s, dt) in row.iter_mut().zip(&self.dt) {
                *s += sign * f * dt;
            }
        }
    }

    /// Behind a reset with the Jacobian `jac` (`nx × n_z`), along the moving time of the jump.
    pub(super) fn reset_by(&mut self, jac: &[f64]) {
        let (nx, n_c) = (self.x.len(), self.n_c);
        self.y.copy_from_slice(&self.s);
        for (row, r) in self.s.chunks_exact_mut(n_c).zip(jac.chunks_exact(n_c + 1)) {
            for (c, s) in row.iter_mut().enumerate() {
                let own = if c < nx { 0.0 } else { r[c] };
                *s = (0..nx).fold(own + r[n_c] * self.dt[c], |v, b| v + r[b] * self.y[b * n_c + c]);
            }
        }
    }

    /// Makes the derivatives tangential to the surfaces of a sliding mode, along `D`; `C D` is that of the last
    /// [`Field::hidden`].
    pub(super) fn project(&mut self, field: &mut Field) {
        let (nx, r, n_c) = (field.nx, field.n_alg(), self.n_c);
        for c in 0..if r == 0 { 0 } else { n_c } {
            for b in 0..r {
                let own = field.c(b).find(|g| g.0 == c && c >= nx).map_or(0.0, |g| g.1);
                let moved = field.c(b).filter(|g| g.0 < nx).map(|(a, g)| g * self.s[a * n_c + c]).sum::<f64>();
                self.rhs[b] = -own - moved;
            }
            field.solve_constraints(&mut self.rhs[..r]);
            for b in 0..r {
                for (a, d) in field.d(b) {
                    self.s[a * n_c + c] += self.rhs[b] * d;
                }
            }
        }
    }
}
