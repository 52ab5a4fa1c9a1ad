//! Derivatives of the right-hand side and of the weights of a sliding mode.

use super::{Columns, Field};
use crate::func::{EvalResult, Point};

/// Room for the derivatives of the weights of a sliding mode: the velocity, and what changes the constraints, `r × n_z`.
#[derive(Debug, Default)]
pub(super) struct Changes {
    velocity: Vec<f64>,
    rows: Vec<f64>,
    /// Of every subsystem the inputs that its weights can depend on; empty where that is not asked for.
    pub(super) of_weights: Vec<Vec<usize>>,
}

impl Field {
    /// Jacobian of `b + D α` for fixed `α`, row-major `nx × n_z` with the columns `x`, `p`, `u`, `t`; where a rule selects the weights,
    /// that of the right-hand side with them.
    pub(in crate::event) fn jacobian(&mut self, t: f64, x: &[f64], alpha: &[f64], out: &mut [f64]) -> EvalResult {
        match self.is_selected() {
            true => self.selected_jacobian(t, x, out),
            false => self.jacobian_of_weights(t, x, alpha, out),
        }
    }

    /// The same for the weights that are given.
    pub(super) fn jacobian_of_weights(&mut self, t: f64, x: &[f64], alpha: &[f64], out: &mut [f64]) -> EvalResult {
        self.counts.jacobians += 1;
        if self.has_contacts() {
            return self.scene_jacobian(t, x, out);
        }
        let at = Point { t, x, u: &self.u, p: &self.p };
        let column = Columns { nx: self.nx, nu: self.u.len(), np: self.p.len() };
        let n_z = self.n_z;
        out.fill(0.0);
        for d in &self.drifts {
            let p = d.f.jac_pattern();
            d.f.jacobian(&at, &mut self.buffer[..p.nnz()], &mut self.work)?;
            for col in 0..p.n_cols() {
                let to = column.of(col);
                for k in p.range(col) {
                    out[d.rows[p.row_idx()[k]] * n_z + to] += self.buffer[k];
                }
            }
        }
        for (k, s) in self.subs.iter().enumerate() {
            let (nr, nnz) = (s.rows.len(), s.modes.jac_pattern().nnz());
            for &cell in &self.active[k] {
                let weight = self.theta_in(alpha, cell);
                let mode = s.cells[cell - s.first].mode;
                if s.mode_entries[mode].is_empty() {
                    continue;
                }
                s.modes.jacobian_rows(&at, mode * nr..(mode + 1) * nr, &mut self.buffer[..nnz], &mut self.work)?;
                for &[e, row, col] in &s.mode_entries[mode] {
                    out[row * n_z + column.of(col)] += weight * self.buffer[e];
                }
            }
        }
        Ok(())
    }

    /// Jacobian of the velocity as explicit methods follow it, row-major `nx × n_z`: in a sliding mode the weights change with the
    /// point, such that the velocity stays tangential,
    ///
    /// ```text
    /// ∂v = J + D ∂α,   C D ∂α = −(C J + ∂(∇c v + c_t)),
    /// ```
    ///
    /// with `J` the Jacobian for fixed weights.
    pub(in crate::event) fn velocity_jacobian(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> EvalResult {
        let (r, n_z) = (self.pairs.len(), self.n_z);
        if r == 0 || self.is_selected() {
            return self.jacobian(t, x, &[], out);
        }
        self.hidden(t, x)?;
        let mut changes = std::mem::take(&mut self.changes);
        changes.velocity.resize(self.nx, 0.0);
        changes.rows.resize(r * n_z, 0.0);
        self.combine(&mut changes.velocity);
        let alpha = std::mem::take(&mut self.alpha);
        let jacobian = self.jacobian_of_weights(t, x, &alpha, out);
        self.alpha = alpha;
        let changed = jacobian.and_then(|()| self.add_changes_of_weights(t, x, &mut changes, out));
        self.changes = changes;
        changed
    }

    /// Adds `D ∂α` to the Jacobian `out` for fixed weights.
    fn add_changes_of_weights(&mut self, t: f64, x: &[f64], changes: &mut Changes, out: &mut [f64]) -> EvalResult {
        let (r, n_z) = (self.pairs.len(), self.n_z);
        let Changes { velocity, rows, of_weights } = changes;
        let alone = !of_weights.is_empty() && (0..r).all(|i| self.sliding.is_alone(i));
        if alone {
            return self.add_changes_alone(t, x, (velocity, rows, of_weights), out);
        }
        for (i, row) in rows.chunks_exact_mut(n_z).enumerate().take(r) {
            row.fill(0.0);
            self.room[..r].fill(0.0);
            self.room[i] = 1.0;
            self.curvature(t, x, velocity, row)?;
            for (a, c) in self.sliding.row_of_states(self.pairs[i], i) {
                row.iter_mut().zip(&out[a * n_z..(a + 1) * n_z]).for_each(|(o, j)| *o -= c * j);
            }
        }
        self.sliding.solve_rows(n_z, &mut rows[..r * n_z]);
        for (i, row) in rows.chunks_exact(n_z).enumerate().take(r) {
            for (a, d) in self.sliding.column(self.pairs[i], i).filter(|(_, d)| *d != 0.0) {
                out[a * n_z..(a + 1) * n_z].iter_mut().zip(row).for_each(|(o, w)| *o += d * w);
            }
        }
        Ok(())
    }

    /// The same where every weight is alone in its block, by the entries that can be other than zero.
    fn add_changes_alone(
        &mut self,
        t: f64,
        x: &[f64],
        (velocity, rows, of_weights): (&[f64], &mut [f64], &[Vec<usize>]),
        out: &mut [f64],
    ) -> EvalResult {
        let (r, n_z) = (self.pairs.len(), self.n_z);
        for (i, row) in rows.chunks_exact_mut(n_z).enumerate().take(r) {
            let inputs = &of_weights[self.pairs[i].sub];
            inputs.iter().for_each(|&z| row[z] = 0.0);
            if !self.dq_constant {
                self.room[..r].fill(0.0);
                self.room[i] = 1.0;
                self.curvature(t, x, velocity, row)?;
            }
            for (a, c) in self.sliding.row_of_states(self.pairs[i], i) {
                inputs.iter().for_each(|&z| row[z] -= c * out[a * n_z + z]);
            }
        }
        for (i, row) in rows.chunks_exact(n_z).enumerate().take(r) {
            let inputs = &of_weights[self.pairs[i].sub];
            for (a, d) in self.sliding.column(self.pairs[i], i).filter(|(_, d)| *d != 0.0) {
                let d = d / self.sliding.alone(i);
                inputs.iter().for_each(|&z| out[a * n_z + z] += d * row[z]);
            }
        }
        Ok(())
    }

    /// Gradient of the weight of an active cell with respect to `x`, `p`, `u`, `t`, by differentiating
    /// `C (b + D α) + c_t = 0`; the velocity is `b + D α`, `jac` has room for `nx × n_z` values.
    pub(in crate::event) fn theta_gradient(
        &mut self,
        cell: usize,
        (t, x, velocity): (f64, &[f64], &[f64]),
        jac: &mut [f64],
        out: &mut [f64],
    ) -> EvalResult {
        if self.is_selected() {
            return self.selected_theta_gradient(cell, t, x, out);
        }
        self.hidden(t, x)?;
        let (r, n_z) = (self.pairs.len(), self.n_z);
        let alpha = std::mem::take(&mut self.alpha);
        let jacobian = self.jacobian(t, x, &alpha, jac);
        self.alpha = alpha;
        jacobian?;
        // θ is α_e, or 1 − Σ α of the subsystem
        let k = self.owner[cell];
        let base = self.active[k][0] == cell;
        for (v, p) in self.room.iter_mut().zip(&self.pairs) {
            *v = if p.cell == cell {
                1.0
            } else if base && p.sub == k {
                -1.0
            } else {
                0.0
            };
        }
        self.sliding.solve_transposed(&mut self.room[..r]);
        out.fill(0.0);
        for i in 0..r {
            let y = self.room[i];
            for (a, c) in self.sliding.row_of_states(self.pairs[i], i) {
                for (o, j) in out.iter_mut().zip(&jac[a * n_z..(a + 1) * n_z]) {
                    *o -= y * c * j;
                }
            }
        }
        self.curvature(t, x, velocity, out)
    }

    /// Subtracts `Σ_i y_i ∂/∂z (∇c_i · v + c_i,t)` for fixed `v` from `out`; `y` is in the room of the constraints.
    fn curvature(&mut self, t: f64, x: &[f64], velocity: &[f64], out: &mut [f64]) -> EvalResult {
        let nx = self.nx;
        let at = Point { t, x, u: &self.u, p: &self.p };
        let column = Columns { nx, nu: self.u.len(), np: self.p.len() };
        let t_col = self.n_z - 1;
        for (k, s) in self.subs.iter().enumerate() {
            let p = s.indicators.hess_pattern();
            let own = self.first_pair[k]..self.first_pair[k + 1];
            if p.nnz() == 0 || self.room[own].iter().all(|y| *y == 0.0) {
                continue;
            }
            self.q_weights[..s.n_q].fill(0.0);
            for i in self.first_pair[k]..self.first_pair[k + 1] {
                let e = self.pairs[i];
                let (w, w0) = (&s.cells[e.cell - s.first].weights, &s.cells[e.base - s.first].weights);
                let own = self.q_unit[s.q0..].iter().zip(w.iter().zip(w0));
                for (q, (unit, (w, w0))) in self.q_weights.iter_mut().zip(own) {
                    *q += self.room[i] * self.unit[i] * unit * (w - w0);
                }
            }
            s.indicators.hessian(&at, &self.q_weights[..s.n_q], &mut self.buffer[..p.nnz()], &mut self.work)?;
            let direction = |z: usize| match z {
                z if z < nx => velocity[z],
                z if z == t_col => 1.0,
                _ => 0.0,
            };
            for col in 0..p.n_cols() {
                let to = column.of(col);
                for e in p.range(col) {
                    let row = column.of(p.row_idx()[e]);
                    out[row] -= self.buffer[e] * direction(to);
                    if row != to {
                        out[to] -= self.buffer[e] * direction(row);
                    }
                }
            }
        }
        Ok(())
    }
}
