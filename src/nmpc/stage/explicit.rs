//! Explicit Runge-Kutta steps.

use super::super::evaluate::Many;
use super::sensitivity::{combine, direct, product, REGISTER};
use super::{Evaluations, Stage, Starts};
use crate::func::EvalResult;
use crate::linalg::dense::wide;
use crate::system::SharedFunction;
use crate::tableau::Tableau;

/// Stages side by side where sensitivities are small.
const SIDE_BY_SIDE: usize = 8;
/// Sensitivities with more columns go one stage at a time.
const MOST_COLUMNS: usize = 16;

/// `m` equal steps of an explicit method in every stage, for `ẋ = f(x, u, p, t)`.
///
/// States of all stages lie beside each other, so that every operation is one loop over all of them. Derivatives follow the
/// discrete steps exactly: forward `K_i = J_i Z_i`, backward by the transposed recursion.
pub(in super::super) struct ExplicitRk {
    n: usize,
    nx: usize,
    nu: usize,
    m: usize,
    tableau: Tableau,
    f: Many,
    /// Entries of the Jacobian by states and by controls, row by row, and which they are among those of the function.
    jac_x: Vec<(usize, usize)>,
    jac_u: Vec<(usize, usize)>,
    source: Vec<usize>,
    /// Columns of a block of sensitivities: those by states and controls, where they go one stage at a time up to whole registers.
    columns: usize,
    /// Values of all stage points: `K` and Jacobians `[x entries, u entries]`.
    k: Vec<f64>,
    jac: Vec<f64>,
    x: Vec<f64>,
    z: Vec<f64>,
    /// Points where Hessians are taken, and adjoints of `K` there.
    points: Vec<f64>,
    k_bar: Vec<f64>,
    hess: Vec<f64>,
    bar: Vec<f64>,
    /// Sensitivities: of the state, of the stage point, of all `K`.
    s: Vec<f64>,
    sz: Vec<f64>,
    sk: Vec<f64>,
    sh: Vec<f64>,
    evaluations: Evaluations,
}

impl ExplicitRk {
    /// `n` stages of `m` steps each; `second` where second derivatives will be asked for.
    pub fn new(f: &SharedFunction, n: usize, m: usize, tableau: Tableau, second: bool) -> ExplicitRk {
        let f = Many::new(f, n, second);
        let (nx, nu, s) = (f.dims.x, f.dims.u, tableau.n_s);
        let within = |from: usize, len: usize| {
            let inside = |e: &usize| (from..from + len).contains(&f.jac_entries[*e].1);
            let mut all: Vec<usize> = (0..f.jac_entries.len()).filter(inside).collect();
            all.sort_by_key(|e| f.jac_entries[*e]);
            all
        };
        let (by_x, by_u) = (within(0, nx), within(nx, nu));
        let entries = |of: &[usize]| of.iter().map(|e| f.jac_entries[*e]).collect::<Vec<_>>();
        let (jac_x, jac_u) = (entries(&by_x), entries(&by_u));
        let (lanes, columns) = match nx + nu {
            few if few <= MOST_COLUMNS => (SIDE_BY_SIDE, few),
            many => (1, many.next_multiple_of(REGISTER)),
        };
        let block = nx * columns * lanes;
        let hessians = if second { m * s } else { 0 };
        ExplicitRk {
            n,
            nx,
            nu,
            m,
            k: vec![0.0; m * s * nx * n],
            jac: vec![0.0; m * s * (jac_x.len() + jac_u.len()) * n],
            x: vec![0.0; nx * n],
            z: vec![0.0; nx * n],
            points: vec![0.0; hessians * nx * n],
            k_bar: vec![0.0; m * s * nx * n],
            hess: vec![0.0; hessians * f.hess_entries.len() * n],
            bar: vec![0.0; s * nx * n],
            s: vec![0.0; block],
            sz: vec![0.0; block],
            sk: vec![0.0; s * block],
            sh: vec![0.0; (2 * (nx + nu) * (nx + nu)).max(n * nu)],
            tableau,
            f,
            jac_x,
            jac_u,
            source: [by_x, by_u].concat(),
            columns,
            evaluations: Evaluations::default(),
        }
    }

    fn start(&mut self, at: &Starts) {
        let (nx, nu, np) = (self.nx, self.nu, self.f.dims.p);
        for k in 0..self.n {
            let (x, u) = (&at.x[k * nx..(k + 1) * nx], &at.u[k * nu..(k + 1) * nu]);
            self.f.set(k, at.t[k], x, u, &at.p[k * np..(k + 1) * np]);
            x.iter().enumerate().for_each(|(i, v)| self.x[i * self.n + k] = *v);
        }
    }

    /// The steps; Jacobians of all stage points are kept where `jacobians` says so.
    fn forward(&mut self, at: &Starts, next: &mut [f64], jacobians: bool) -> EvalResult {
        let (n, nx, s) = (self.n, self.nx, self.tableau.n_s);
        self.start(at);
        let t_col = self.f.dims.t_col();
        let share = 1.0 / self.m as f64;
        for step in 0..self.m {
            for i in 0..s {
                self.z.copy_from_slice(&self.x);
                for j in (0..i).filter(|j| self.tableau.a(i, *j) != 0.0) {
                    let k = &self.k[(step * s + j) * nx * n..][..nx * n];
                    add_steps(self.tableau.a(i, j) * share, at.h, k, &mut self.z);
                }
                self.f.inputs[..nx * n].copy_from_slice(&self.z);
                let c = (step as f64 + self.tableau.c[i]) * share;
                let times = &mut self.f.inputs[t_col * n..(t_col + 1) * n];
                times.iter_mut().zip(at.t.iter().zip(at.h)).for_each(|(v, (t, h))| *v = t + c * h);
                if !self.points.is_empty() {
                    self.points[(step * s + i) * nx * n..][..nx * n].copy_from_slice(&self.z);
                }
                self.f.values()?;
                self.evaluations.values += 1;
                self.k[(step * s + i) * nx * n..][..nx * n].copy_from_slice(&self.f.value);
                if jacobians {
                    self.f.jacobians()?;
                    self.keep_jacobian(step * s + i);
                }
            }
            for i in 0..s {
                let k = &self.k[(step * s + i) * nx * n..][..nx * n];
                add_steps(self.tableau.b[i] * share, at.h, k, &mut self.x);
            }
        }
        for k in 0..n {
            for i in 0..nx {
                next[k * nx + i] = self.x[i * n + k];
            }
        }
        Ok(())
    }

    fn keep_jacobian(&mut self, point: usize) {
        let n = self.n;
        let size = self.source.len() * n;
        let to = &mut self.jac[point * size..(point + 1) * size];
        for (to, e) in to.chunks_exact_mut(n).zip(&self.source) {
            to.copy_from_slice(&self.f.jac[e * n..(e + 1) * n]);
        }
    }

    /// Sensitivities of the stages from `first` on, and products with Hessians where there are any.
    #[inline(always)]
    fn sensitivities<const L: usize>(
        &mut self,
        h: &[f64],
        first: usize,
        a: &mut [f64],
        b: &mut [f64],
        mut hess: Option<&mut [f64]>,
    ) {
        let (n, nx, nu, s) = (self.n, self.nx, self.nu, self.tableau.n_s);
        let (columns, share) = (self.columns, 1.0 / self.m as f64);
        let block = nx * columns * L;
        let mut steps = [0.0; L];
        let m = L.min(n - first);
        steps[..m].copy_from_slice(&h[first..first + m]);
        self.s[..block].fill(0.0);
        for i in 0..nx {
            self.s[(i * columns + i) * L..][..L].fill(1.0);
        }
        let (per_x, per_u) = (self.jac_x.len(), self.jac_u.len());
        for step in 0..self.m {
            for i in 0..s {
                let (before, own) = self.sk.split_at_mut(i * block);
                let own = &mut own[..block];
                let jac = &self.jac[(step * s + i) * (per_x + per_u) * n..][..(per_x + per_u) * n];
                own.fill(0.0);
                let factor = |j: usize| self.tableau.a(i, j) * share;
                combine::<L>(factor, i, &steps, before, &self.s, &mut self.sz);
                if step == 0 && i == 0 {
                    direct::<L>(&self.jac_x, jac, [n, first], columns, own);
                } else {
                    product::<L>(&self.jac_x, jac, [n, first], columns, &self.sz, own);
                }
                direct::<L>(&self.jac_u, &jac[per_x * n..], [n, first], columns, own);
                if let Some(hess) = hess.as_deref_mut() {
                    for l in 0..m {
                        self.add_hessian::<L>(step * s + i, first + l, l, hess);
                    }
                }
            }
            let factor = |j: usize| self.tableau.b[j] * share;
            combine::<L>(factor, s, &steps, &self.sk, &self.s, &mut self.sz);
            std::mem::swap(&mut self.s, &mut self.sz);
        }
        for l in 0..m {
            let k = first + l;
            for i in 0..nx {
                (0..nx).for_each(|j| a[k * nx * nx + i + j * nx] = self.s[(i * columns + j) * L + l]);
                (0..nu).for_each(|j| b[k * nx * nu + i + j * nx] = self.s[(i * columns + nx + j) * L + l]);
            }
        }
    }

    /// `Zᵀ H Z` of one stage at a stage point: `Z` are the derivatives of its state and control by those of the node.
    fn add_hessian<const L: usize>(&mut self, point: usize, k: usize, lane: usize, hess: &mut [f64]) {
        let (n, nx, columns, width) = (self.n, self.nx, self.nx + self.nu, self.columns);
        let ExplicitRk { f, hess: values, sz, sh, .. } = self;
        let values = &values[point * f.hess_entries.len() * n..];
        let derivative = |row: usize, c: usize| match row {
            r if r < nx => sz[(r * width + c) * L + lane],
            r => f64::from(r == c),
        };
        let (left, right) = sh.split_at_mut(columns * columns);
        let used = |e: &(usize, usize)| e.0 < columns && e.1 < columns;
        let out = &mut hess[k * columns * columns..(k + 1) * columns * columns];
        for (e, &(i, j)) in f.hess_entries.iter().enumerate().filter(|e| used(e.1)) {
            let v = values[e * n + k] * if i == j { 0.5 } else { 1.0 };
            if v == 0.0 {
                continue;
            }
            for c in 0..columns {
                (left[c], right[c]) = (derivative(i, c), derivative(j, c));
            }
            for q in 0..columns {
                for p in q..columns {
                    out[p + q * columns] += v * (left[p] * right[q] + right[p] * left[q]);
                }
            }
        }
    }

    /// Adjoints of `K` at all stage points from `λ`; `z` holds the adjoints of the nodes afterwards, `gu` those of the controls.
    fn backward(&mut self, h: &[f64], lambda: &[f64], gu: &mut [f64]) {
        let (n, nx, nu, s) = (self.n, self.nx, self.nu, self.tableau.n_s);
        let share = 1.0 / self.m as f64;
        let per = self.jac_x.len() + self.jac_u.len();
        for k in 0..n {
            (0..nx).for_each(|i| self.z[i * n + k] = lambda[k * nx + i]);
        }
        gu.fill(0.0);
        for step in (0..self.m).rev() {
            for i in (0..s).rev() {
                let (point, size) = (step * s + i, nx * n);
                let k_bar = &mut self.k_bar[point * size..(point + 1) * size];
                k_bar.fill(0.0);
                add_steps(self.tableau.b[i] * share, h, &self.z, k_bar);
                for j in (i + 1..s).filter(|j| self.tableau.a(*j, i) != 0.0) {
                    add_steps(self.tableau.a(j, i) * share, h, &self.bar[j * size..(j + 1) * size], k_bar);
                }
                let jac = &self.jac[point * per * n..(point + 1) * per * n];
                let bar = &mut self.bar[i * size..(i + 1) * size];
                bar.fill(0.0);
                for (e, &(r, c)) in self.jac_x.iter().enumerate() {
                    let (to, values) = (&mut bar[c * n..(c + 1) * n], &jac[e * n..(e + 1) * n]);
                    let from = &k_bar[r * n..(r + 1) * n];
                    for k in 0..n {
                        to[k] += values[k] * from[k];
                    }
                }
                for (e, &(r, c)) in self.jac_u.iter().enumerate() {
                    let values = &jac[(self.jac_x.len() + e) * n..];
                    for k in 0..n {
                        gu[k * nu + c - nx] += values[k] * k_bar[r * n + k];
                    }
                }
            }
            for i in 0..s {
                let bar = &self.bar[i * nx * n..(i + 1) * nx * n];
                self.z.iter_mut().zip(bar).for_each(|(z, b)| *z += b);
            }
        }
    }

    /// Hessians of `k_barᵀ f` at all stage points.
    fn hessians(&mut self, at: &Starts) -> EvalResult {
        let (n, nx, s) = (self.n, self.nx, self.tableau.n_s);
        let t_col = self.f.dims.t_col();
        for point in 0..self.m * s {
            let size = nx * n;
            self.f.inputs[..size].copy_from_slice(&self.points[point * size..(point + 1) * size]);
            let c = ((point / s) as f64 + self.tableau.c[point % s]) / self.m as f64;
            for k in 0..n {
                self.f.inputs[t_col * n + k] = at.t[k] + c * at.h[k];
                let k_bar = &self.k_bar[point * size..];
                self.f.set_weights(k, (0..nx).map(|i| k_bar[i * n + k]));
            }
            self.f.hessians()?;
            self.evaluations.hessians += 1;
            let len = self.f.hess.len();
            self.hess[point * len..(point + 1) * len].copy_from_slice(&self.f.hess);
        }
        Ok(())
    }
}

/// `y += f h_k x` for quantities of all stages.
fn add_steps(f: f64, h: &[f64], x: &[f64], y: &mut [f64]) {
    let n = h.len();
    let mut at = 0;
    while at < y.len() {
        let (x, y) = (&x[at..at + n], &mut y[at..at + n]);
        for k in 0..n {
            y[k] += f * h[k] * x[k];
        }
        at += n;
    }
}

impl Stage for ExplicitRk {
    fn explicit(&self) -> Option<(&SharedFunction, usize, &Tableau)> {
        Some((self.f.function(), self.m, &self.tableau))
    }

    fn values(&mut self, at: &Starts, next: &mut [f64]) -> EvalResult {
        self.forward(at, next, false)
    }

    fn linearise(
        &mut self,
        at: &Starts,
        next: &mut [f64],
        a: &mut [f64],
        b: &mut [f64],
        second: Option<(&[f64], &mut [f64])>,
    ) -> EvalResult {
        self.forward(at, next, true)?;
        self.evaluations.jacobians += 1;
        let mut hess = None;
        if let Some((lambda, out)) = second {
            // the derivatives by the controls are of no use here: they are written where those of the next call go
            let mut unused = std::mem::take(&mut self.sh);
            self.backward(at.h, lambda, &mut unused[..self.n * self.nu]);
            self.sh = unused;
            self.hessians(at)?;
            hess = Some(out);
        }
        let wide_rows = self.nx + self.nu > MOST_COLUMNS;
        let lanes = if wide_rows { 1 } else { SIDE_BY_SIDE };
        for first in (0..self.n).step_by(lanes) {
            let hess = hess.as_deref_mut();
            if wide_rows {
                wide(|| self.sensitivities::<1>(at.h, first, a, b, hess));
            } else {
                wide(|| self.sensitivities::<SIDE_BY_SIDE>(at.h, first, a, b, hess));
            }
        }
        Ok(())
    }

    fn adjoint(&mut self, at: &Starts, lambda: &[f64], next: &mut [f64], gx: &mut [f64], gu: &mut [f64]) -> EvalResult {
        self.forward(at, next, true)?;
        self.evaluations.adjoints += 1;
        self.backward(at.h, lambda, gu);
        for k in 0..self.n {
            (0..self.nx).for_each(|i| gx[k * self.nx + i] = self.z[i * self.n + k]);
        }
        Ok(())
    }

    fn evaluations(&self) -> Evaluations {
        self.evaluations
    }
}
