//! Derivatives of the right-hand side and of the weights of a sliding mode.

use super::{Columns, Field};
use crate::func::{EvalResult, Point};

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
        if self.has_contacts() {
            self.counts.jacobians += 1;
            return self.scene_jacobian(t, x, out);
        }
        self.linearise_fixed(t, x, alpha)?;
        self.linear.fixed.expand(self.n_z, out);
        Ok(())
    }

    /// Gradient of the weight of an active cell with respect to `x`, `p`, `u`, `t`, by differentiating
    /// `C (b + D α) + c_t = 0`; the velocity is `b + D α`.
    pub(in crate::event) fn theta_gradient(
        &mut self,
        cell: usize,
        (t, x, velocity): (f64, &[f64], &[f64]),
        out: &mut [f64],
    ) -> EvalResult {
        if self.is_selected() {
            return self.selected_theta_gradient(cell, t, x, out);
        }
        self.hidden(t, x)?;
        let r = self.pairs.len();
        let alpha = std::mem::take(&mut self.alpha);
        let known = self.linearise_fixed(t, x, &alpha);
        self.alpha = alpha;
        known?;
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
            if y == 0.0 {
                continue;
            }
            for (a, c) in self.sliding.row_of_states(self.pairs[i], i) {
                self.linear.fixed.entries(a).for_each(|(z, v)| out[z] -= y * c * v);
            }
        }
        (0..self.subs.len()).try_for_each(|k| self.curvature_of(k, (t, x, velocity), out))
    }

    /// Subtracts `Σ_i y_i ∂/∂z (∇c_i · v + c_i,t)` for fixed `v` from `out`, over the constraints of subsystem `k`; `y` is in the room of
    /// the constraints.
    pub(super) fn curvature_of(
        &mut self,
        k: usize,
        (t, x, velocity): (f64, &[f64], &[f64]),
        out: &mut [f64],
    ) -> EvalResult {
        let nx = self.nx;
        let at = Point { t, x, u: &self.u, p: &self.p };
        let column = Columns { nx, nu: self.u.len(), np: self.p.len() };
        let t_col = self.n_z - 1;
        let (s, own) = (&self.subs[k], self.first_pair[k]..self.first_pair[k + 1]);
        let p = s.indicators.hess_pattern();
        if p.nnz() == 0 || self.room[own.clone()].iter().all(|y| *y == 0.0) {
            return Ok(());
        }
        self.q_weights[..s.n_q].fill(0.0);
        for i in own {
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
        Ok(())
    }
}
