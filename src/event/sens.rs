//! Forward sensitivities: the discrete steps differentiated, with the jump at every switch.
//!
//! `S = ∂x(t)/∂(x0, p)` at fixed time. A step of length `h` is differentiated with `h` fixed. At a switch that happens
//! where `W(t, x) = 0`, the time moves by `dt = −(∇W S + W_p) / Ẇ⁻`, and at fixed time `S⁺ = S⁻ + (ẋ⁻ − ẋ⁺) dt`
//! (6.25), which holds for crossing, for entering a sliding mode (the result is tangential to the surface) and for
//! leaving it (where the velocity is continuous).

use super::explicit::Pair;
use super::field::Field;
use super::lu::Lu;
use super::radau::Radau;
use super::step::Step;
use super::watch::Watch;
use crate::func::{EvalError, EvalResult};

/// Sensitivities with all memory they need.
pub(super) struct Sens {
    /// Columns: initial states, then parameters.
    n_c: usize,
    /// `nx × n_c`, row-major.
    pub(super) s: Vec<f64>,
    y: Vec<f64>,
    k: Vec<f64>,
    jac: Vec<f64>,
    x: Vec<f64>,
    v: Vec<f64>,
    rhs: Vec<f64>,
    lu: Lu<f64>,
    /// Derivative of the time of the last switch.
    pub(super) dt: Vec<f64>,
    pub(super) one_sided: bool,
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
            jac: vec![0.0; 3 * nx * n_z],
            x: vec![0.0; nx],
            v: vec![0.0; nx],
            rhs: vec![0.0; n * (n_c + 1)],
            lu: Lu::with_capacity(n),
            dt: vec![0.0; n_c],
            one_sided: false,
        }
    }

    /// Derivatives with respect to a starting state are those of the identity.
    pub(super) fn reset(&mut self) {
        self.s.fill(0.0);
        let nx = self.x.len();
        for i in 0..nx {
            self.s[i * self.n_c + i] = 1.0;
        }
        self.one_sided = false;
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
        let own = nx + r;
        let n = 3 * own;
        self.lu.clear(n);
        // right-hand sides by column
        for i in 0..3 {
            let t = radau.stage(s, i, &mut self.x);
            let alpha = &radau.z[i][nx..];
            if r > 0 {
                field.hidden(t, &self.x)?;
            }
            let jac = &mut self.jac[..nx * n_z];
            field.jacobian(t, &self.x, alpha, jac)?;
            let m = self.lu.matrix();
            for a in 0..nx {
                let row = &mut m[(i * own + a) * n..(i * own + a + 1) * n];
                for j in 0..3 {
                    row[j * own + a] += radau.a_inv[(i, j)] / s.h;
                }
                for b in 0..nx {
                    row[i * own + b] -= jac[a * n_z + b];
                }
                for b in 0..r {
                    row[i * own + nx + b] = -field.d(b)[a];
                }
                for c in 0..n_c {
                    let mut v = if c < nx { 0.0 } else { jac[a * n_z + c] };
                    for b in 0..nx {
                        v += jac[a * n_z + b] * self.s[b * n_c + c];
                    }
                    self.rhs[c * n + i * own + a] = v;
                }
            }
            for b in 0..r {
                let g = &field.c[b * n_z..(b + 1) * n_z];
                m[(i * own + nx + b) * n + i * own..][..nx].copy_from_slice(&g[..nx]);
                for c in 0..n_c {
                    let mut v = if c < nx { 0.0 } else { g[c] };
                    for (a, g) in g[..nx].iter().enumerate() {
                        v += g * self.s[a * n_c + c];
                    }
                    self.rhs[c * n + i * own + nx + b] = -v;
                }
            }
        }
        if !self.lu.factorise() {
            return Err(EvalError::Recoverable);
        }
        for c in 0..n_c {
            let b = &mut self.rhs[c * n..(c + 1) * n];
            self.lu.solve(b);
            for a in 0..nx {
                self.s[a * n_c + c] += b[2 * own + a];
            }
        }
        Ok(())
    }

    /// Derivative of the time at which a watched function vanishes; `f` is the velocity before, gradients and active
    /// set of the field are those at this point.
    pub(super) fn time(&mut self, w: &Watch, field: &mut Field, t: f64, x: &[f64], f: &[f64]) -> EvalResult {
        let (nx, n_z, n_c) = (field.nx, field.n_z, self.n_c);
        if let Watch::Leave { cell, .. } = *w {
            // weights are functions of time, state and parameters: central differences along every direction
            let size = x.iter().fold(1.0f64, |m, v| m.max(v.abs()));
            let mut along = |field: &mut Field, dt: f64, dx: &dyn Fn(usize) -> f64, p: Option<usize>| {
                let most = (0..nx).fold(dt.abs(), |m, i| m.max(dx(i).abs())).max(if p.is_some() { 1.0 } else { 0.0 });
                if most == 0.0 {
                    return Ok(0.0);
                }
                let e = 1e-5 * size / most;
                let saved = p.map_or(0.0, |p| field.p[p]);
                let mut value = [0.0; 2];
                for (v, e) in value.iter_mut().zip([e, -e]) {
                    for i in 0..nx {
                        self.v[i] = x[i] + e * dx(i);
                    }
                    if let Some(p) = p {
                        field.p[p] = saved + e;
                    }
                    let r = field.hidden(t + e * dt, &self.v);
                    if let Some(p) = p {
                        field.p[p] = saved;
                    }
                    r?;
                    *v = field.theta(cell);
                }
                Ok((value[0] - value[1]) / (2.0 * e))
            };
            let rate: f64 = along(field, 1.0, &|i| f[i], None)?;
            for c in 0..n_c {
                let column = |i: usize| self.s[i * n_c + c];
                self.dt[c] = -along(field, 0.0, &column, c.checked_sub(nx))? / rate;
            }
            // the gradients belong to the point again
            field.forget();
            field.gradients(t, x)?;
            return Ok(());
        }
        let rate = w.rate(&field.dq, n_z, f);
        for c in 0..n_c {
            let column = |j: usize| self.s[j * n_c + c];
            // the part of a parameter takes the place of that of time
            let moved = w.derivative(&field.dq, n_z, column, nx, (c >= nx).then_some(c));
            self.dt[c] = -moved / rate;
        }
        Ok(())
    }

    /// The jump between two velocities.
    pub(super) fn jump(&mut self, before: &[f64], after: &[f64]) {
        for (row, (a, b)) in self.s.chunks_exact_mut(self.n_c).zip(before.iter().zip(after)) {
            for (s, dt) in row.iter_mut().zip(&self.dt) {
                *s += (a - b) * dt;
            }
        }
    }

    /// Makes the derivatives tangential to the surfaces of a sliding mode, along `D`; `C D` is that of the last
    /// [`Field::hidden`].
    pub(super) fn project(&mut self, field: &mut Field) {
        let (nx, n_z, r, n_c) = (field.nx, field.n_z, field.n_alg(), self.n_c);
        for c in 0..if r == 0 { 0 } else { n_c } {
            for b in 0..r {
                let g = &field.c[b * n_z..(b + 1) * n_z];
                let own = if c < nx { 0.0 } else { g[c] };
                self.rhs[b] = -own - (0..nx).map(|a| g[a] * self.s[a * n_c + c]).sum::<f64>();
            }
            field.solve_constraints(&mut self.rhs[..r]);
            for b in 0..r {
                for a in 0..nx {
                    self.s[a * n_c + c] += self.rhs[b] * field.d(b)[a];
                }
            }
        }
    }
}
