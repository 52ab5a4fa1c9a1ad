//! Forward sensitivities: the discrete steps differentiated, with the jump at every switch.
//!
//! `S = ∂x(t)/∂(x0, p, u)` at fixed time. A step of length `h` is differentiated with `h` fixed. At a switch that happens
//! where `W(t, x) = 0`, the time moves by `dt = −(∇W S + W_p) / Ẇ⁻`, and at fixed time `S⁺ = S⁻ + (ẋ⁻ − ẋ⁺) dt`
//! (6.25), which holds for crossing, for entering a sliding mode (the result is tangential to the surface) and for
//! leaving it (where the velocity is continuous).

use super::collocation::Collocation;
use super::explicit::{self, Pair};
use super::field::{reachable, Field, Rows, StagesOf, Supports, MOST_STAGES};
use super::panels::{Linearised, Panels};
use super::radau::Radau;
use super::step::Step;
use crate::func::EvalResult;
use crate::linalg::lu::block_work;

/// A row of a Jacobian, without the time, times `(S; I)`, with a sign. Most of a large one is zero.
fn along(row: &[f64], sign: f64, nx: usize, s: &[f64], out: &mut [f64]) {
    let n_c = out.len();
    let (states, others) = out.split_at_mut(n_c - (row.len() - nx));
    states.fill(0.0);
    others.iter_mut().zip(&row[nx..]).for_each(|(out, v)| *out = sign * v);
    for (s, a) in s.chunks_exact(n_c.max(1)).zip(&row[..nx]).filter(|(_, a)| **a != 0.0) {
        out.iter_mut().zip(s).for_each(|(out, s)| *out += sign * a * s);
    }
}

/// Sensitivities with all memory they need.
pub(super) struct Sens {
    /// Columns: initial states, parameters, controls, from the input `first` on, which is none of the initial states or all of them.
    n_c: usize,
    first: usize,
    /// `nx × n_c`, row-major.
    pub(super) s: Vec<f64>,
    y: Vec<f64>,
    /// Jacobians at the stages of an explicit step.
    stages: Vec<Rows>,
    x: Vec<f64>,
    rhs: Vec<f64>,
    work: Vec<f64>,
    step: Collocation,
    /// The columns, with all rows, and with those that can be other than zero if most cannot.
    whole: Panels,
    apart: Option<Panels>,
    /// A rule has selected weights: the entries are all that can be other than zero no more.
    filled: bool,
    /// Derivative of the time of the last switch.
    pub(super) dt: Vec<f64>,
}

impl Sens {
    pub(super) fn new(nx: usize, n_z: usize, most: usize, first: usize) -> Sens {
        let n_c = n_z - 1 - first;
        let n = 3 * (nx + most);
        Sens {
            n_c,
            first,
            s: vec![0.0; nx * n_c],
            y: vec![0.0; nx * n_c],
            stages: Vec::new(),
            x: vec![0.0; nx],
            rhs: vec![0.0; n * n_c.max(1)],
            work: vec![0.0; block_work(n, n_c)],
            step: Collocation::new(nx, n_z, most),
            whole: Panels::new(nx, n_z, first, None),
            apart: None,
            filled: false,
            dt: vec![0.0; n_c],
        }
    }

    /// Makes room for the Jacobians at the stages of any explicit step.
    pub(super) fn reserve(&mut self) {
        let (nx, n_z) = (self.x.len(), self.first + self.n_c + 1);
        self.stages.resize_with(MOST_STAGES, Rows::default);
        self.stages.iter_mut().for_each(|s| s.reserve(nx, nx * n_z));
    }

    /// Derivatives with respect to a starting state are those of the identity.
    pub(super) fn reset(&mut self) {
        self.filled = false;
        self.s.fill(0.0);
        for i in self.first..self.x.len() {
            self.s[i * self.n_c + i] = 1.0;
        }
    }

    /// Most derivatives of parts that do not touch are zero: explicit steps leave them out.
    pub(super) fn use_supports(&mut self, supports: &Supports) {
        let (nx, n_z) = (self.x.len(), self.first + self.n_c + 1);
        let apart = Panels::new(nx, n_z, self.first, Some(&Sens::inputs(supports, nx)));
        self.apart = Some(apart).filter(Panels::is_sparse);
    }

    /// Of every state the columns that it can depend on: its start, and what the starts and velocities behind that depend on.
    fn inputs(supports: &Supports, nx: usize) -> Vec<Vec<usize>> {
        let own = |i: usize| std::iter::once(i).chain(supports.velocity[i].iter().copied().filter(|z| *z >= nx));
        let next = |i: usize| supports.velocity[i].iter().copied().filter(|z| *z < nx);
        let own: Vec<Vec<usize>> = (0..nx).map(|i| own(i).collect()).collect();
        let next: Vec<Vec<usize>> = (0..nx).map(|i| next(i).collect()).collect();
        reachable(&own, &next)
    }

    /// Over an explicit step, and `rest` behind its end along the velocity.
    pub(super) fn explicit(&mut self, pair: Pair, field: &mut Field, s: &Step, rest: f64) -> EvalResult {
        let h = s.h / s.part;
        self.filled |= field.is_selected();
        let last = pair.rows().0.len() - 1;
        let inside = (s.part < 1.0).then(|| explicit::weights_at(pair, s.part));
        let rest = if inside.is_some() { 0.0 } else { rest };
        let n = last + usize::from(rest != 0.0 || inside.is_some());
        let at = StagesOf { pair, t: s.t, h, x0: &s.x0, k: &s.k, n };
        field.linearise_stages(&at, &mut self.stages)?;
        match inside {
            Some(_) => self.x.copy_from_slice(&s.x1),
            None => at.point(last, &mut self.x),
        }
        let panels = self.apart.as_mut().filter(|_| !self.filled).unwrap_or(&mut self.whole);
        panels.explicit(&Linearised { pair, h, inside, rest, stages: &self.stages[..n] }, &mut self.s);
        // the state is moved onto the surfaces behind the step, and with it the derivatives; those of states that move at a given speed are
        // there already
        if field.asks_for_weights() && !field.is_explicit_only() {
            field.hidden(s.t + s.h, &self.x)?;
            self.project(field);
        }
        Ok(())
    }

    /// Over an implicit step.
    pub(super) fn implicit(&mut self, radau: &Radau, field: &mut Field, s: &Step) -> EvalResult {
        self.solve_stages(radau, field, s)?;
        let end = 2 * self.step.own() * self.n_c;
        self.s.iter_mut().zip(&self.rhs[end..]).for_each(|(s, b)| *s += b);
        Ok(())
    }

    /// To the relative time `at` in an implicit step, along its dense output.
    pub(super) fn implicit_to(&mut self, radau: &Radau, field: &mut Field, s: &Step, at: f64) -> EvalResult {
        self.solve_stages(radau, field, s)?;
        let (n_c, block) = (self.n_c, self.step.own() * self.n_c);
        let mut weights = radau.cubic(at);
        if s.poly.iter().any(|p| p[4] != 0.0) {
            // it has the slope of the start, too
            let bend = radau.bend(at);
            weights.iter_mut().zip(radau.slopes_at_start()).for_each(|(w, slope)| *w -= bend * slope);
            field.linearise(s.t, &s.x0)?;
            self.y.fill(0.0);
            for (i, out) in self.y.chunks_exact_mut(n_c.max(1)).enumerate() {
                for (z, v) in field.velocity_rows().entries(i) {
                    match z.checked_sub(field.nx) {
                        None => out.iter_mut().zip(&self.s[z * n_c..]).for_each(|(o, s)| *o += v * s),
                        Some(_) if z < self.first + n_c => out[z - self.first] += v,
                        Some(_) => {}
                    }
                }
            }
            let by = bend * s.h;
            self.s.iter_mut().zip(&self.y).for_each(|(s, y)| *s += by * y);
        }
        let n = self.s.len();
        for (i, w) in weights[1..].iter().enumerate() {
            let own = &self.rhs[i * block..i * block + n];
            self.s.iter_mut().zip(own).for_each(|(s, b)| *s += w * b);
        }
        Ok(())
    }

    /// Derivatives of the stages of an implicit step relative to those of its start.
    fn solve_stages(&mut self, radau: &Radau, field: &mut Field, s: &Step) -> EvalResult {
        let (nx, n_z, r, n_c) = (field.nx, field.n_z, field.n_alg(), self.n_c);
        let z = [&radau.z[0][..], &radau.z[1], &radau.z[2]];
        self.step.assemble(radau, field, (s.t, s.h), &s.x0, z)?;
        let own = self.step.own();
        let n = 3 * own;
        let rhs = &mut self.rhs[..n * n_c];
        for i in 0..3 {
            let own_rows = &mut rhs[i * own * n_c..(i + 1) * own * n_c];
            let (of_f, of_g) = own_rows.split_at_mut(nx * n_c);
            let f = self.step.jac(i).chunks_exact(n_z).map(|row| (row, 1.0));
            let g = self.step.g(i).chunks_exact(n_z).take(r).map(|row| (row, -1.0));
            let rows = of_f.chunks_exact_mut(n_c).zip(f).chain(of_g.chunks_exact_mut(n_c).zip(g));
            rows.for_each(|(out, (row, sign))| along(&row[..n_z - 1], sign, nx, &self.s, out));
        }
        self.step.lu.solve_block(n_c, rhs, &mut self.work);
        Ok(())
    }

    /// Derivative of the time of a switch, from its derivatives with respect to state, parameters and controls just
    /// before (see [`Watch::time_gradient`](super::watch::Watch::time_gradient)).
    pub(super) fn time(&mut self, row: &[f64]) {
        let (nx, n_c, n_states) = (self.x.len(), self.n_c, self.x.len() - self.first);
        self.dt[..n_states].fill(0.0);
        self.dt[n_states..].copy_from_slice(&row[nx..nx + n_c - n_states]);
        for (s, r) in self.s.chunks_exact(n_c.max(1)).zip(&row[..nx]).filter(|(_, r)| **r != 0.0) {
            self.dt.iter_mut().zip(s).for_each(|(dt, s)| *dt += r * s);
        }
    }

    /// The jump between two velocities.
    pub(super) fn jump(&mut self, before: &[f64], after: &[f64]) {
        let rows = self.s.chunks_exact_mut(self.n_c.max(1)).zip(before.iter().zip(after));
        // most velocities of many do not change
        for (row, (a, b)) in rows.filter(|(_, (a, b))| a != b) {
            for (s, dt) in row.iter_mut().zip(&self.dt) {
                *s += (a - b) * dt;
            }
        }
    }

    /// From derivatives at fixed time to those along the moving time of a jump (`sign` 1), or back (−1).
    pub(super) fn advance(&mut self, velocity: &[f64], sign: f64) {
        for (row, f) in self.s.chunks_exact_mut(self.n_c.max(1)).zip(velocity) {
            for (s, dt) in row.iter_mut().zip(&self.dt) {
                *s += sign * f * dt;
            }
        }
    }

    /// Behind a reset with the Jacobian `jac` (`nx × n_z`), along the moving time of the jump.
    pub(super) fn reset_by(&mut self, jac: &[f64]) {
        let (nx, n_c) = (self.x.len(), self.n_c);
        let time = self.first + n_c;
        self.y.copy_from_slice(&self.s);
        for (row, r) in self.s.chunks_exact_mut(n_c.max(1)).zip(jac.chunks_exact(time + 1)) {
            along(&r[..time], 1.0, nx, &self.y, row);
            row.iter_mut().zip(&self.dt).for_each(|(s, dt)| *s += r[time] * dt);
        }
    }

    /// The columns for which a row among these, of states, parameters and controls, does not vanish to this share of the sizes of its terms.
    pub(super) fn columns_of(&self, rows: &[f64], sizes: &[f64], share: f64) -> Vec<usize> {
        let n = self.first + self.n_c;
        let mut found = vec![false; self.n_c];
        let mut both = [vec![0.0; self.n_c], vec![0.0; self.n_c]];
        let magnitudes: Vec<f64> = self.s.iter().map(|s| s.abs()).collect();
        for (row, size) in rows.chunks_exact(n).zip(sizes.chunks_exact(n)) {
            let [value, terms] = &mut both;
            along(row, 1.0, self.x.len(), &self.s, value);
            along(size, 1.0, self.x.len(), &magnitudes, terms);
            let columns = found.iter_mut().zip(value.iter().zip(terms.iter()));
            columns.for_each(|(f, (v, t))| *f |= v.abs() > share * t);
        }
        (0..self.n_c).filter(|c| found[*c]).collect()
    }

    /// These columns are not known, nor what they have to do with the time of the last switch.
    pub(super) fn lose(&mut self, columns: &[usize]) {
        for row in self.s.chunks_exact_mut(self.n_c.max(1)) {
            columns.iter().for_each(|c| row[*c] = f64::NAN);
        }
        columns.iter().for_each(|c| self.dt[*c] = f64::NAN);
    }

    /// Makes the derivatives tangential to the surfaces of a sliding mode, along `D`; `C D` is that of the last
    /// [`Field::hidden`].
    pub(super) fn project(&mut self, field: &mut Field) {
        let (nx, r, n_c, first) = (field.nx, field.n_alg(), self.n_c, self.first);
        if n_c == 0 {
            return;
        }
        let rhs = &mut self.rhs[..r * n_c];
        rhs.fill(0.0);
        for (b, row) in rhs.chunks_exact_mut(n_c).enumerate() {
            for (a, g) in field.c(b).filter(|(a, g)| *a < first + n_c && *g != 0.0) {
                match a < nx {
                    true => row.iter_mut().zip(&self.s[a * n_c..]).for_each(|(v, s)| *v -= g * s),
                    false => row[a - first] -= g,
                }
            }
        }
        field.solve_constraints(n_c, rhs);
        for (b, row) in rhs.chunks_exact(n_c).enumerate() {
            for (a, d) in field.d(b).filter(|(_, d)| *d != 0.0) {
                self.s[a * n_c..(a + 1) * n_c].iter_mut().zip(row).for_each(|(s, v)| *s += d * v);
            }
        }
        // zeros without rounding, which are no work in the steps that follow
        for b in 0..r {
            let Some(a) = field.tied_state(b) else { continue };
            let own = &mut self.s[a * n_c..(a + 1) * n_c];
            own.fill(0.0);
            let by_state: f64 = field.c(b).filter(|c| c.0 == a).map(|c| c.1).sum();
            let others = field.c(b).filter(|c| c.0 >= nx && c.0 < first + n_c);
            others.for_each(|(z, g)| own[z - first] = -g / by_state);
        }
    }
}
