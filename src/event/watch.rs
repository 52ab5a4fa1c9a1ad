//! What must stay positive under an active set: distances to the surfaces around, weights of the active cells.

use super::field::Field;
use super::step::Stages;
use crate::func::EvalResult;

/// A function of time and state that is positive as long as the active set holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Watch {
    /// `sign · (q_a − q_b)`: another region begins where it vanishes.
    Enter { sub: usize, a: usize, b: Option<usize>, sign: f64 },
    /// The weight of an active cell.
    Leave { sub: usize, cell: usize },
}

impl Watch {
    pub(super) fn is_leave(&self) -> bool {
        matches!(self, Watch::Leave { .. })
    }

    /// Value from indicators `q` and the weights of the field.
    pub(super) fn value(&self, q: &[f64], field: &Field) -> f64 {
        match *self {
            Watch::Enter { a, b, sign, .. } => sign * (q[a] - b.map_or(0.0, |b| q[b])),
            Watch::Leave { cell, .. } => field.theta(cell),
        }
    }

    /// Rate of change for a velocity, from the gradients of the indicators (`n_z` columns); 0 for weights.
    pub(super) fn rate(&self, dq: &[f64], n_z: usize, velocity: &[f64]) -> f64 {
        let Watch::Enter { a, b, sign, .. } = *self else { return 0.0 };
        let along = |j: usize| {
            let g = &dq[j * n_z..(j + 1) * n_z];
            g.iter().zip(velocity).map(|(g, v)| g * v).sum::<f64>() + g[n_z - 1]
        };
        sign * (along(a) - b.map_or(0.0, along))
    }

    /// Rates for the velocities at all stages of a step.
    pub(super) fn rates(&self, dq: &[f64], n_z: usize, k: &[Stages]) -> Stages {
        let mut out = [0.0; 16];
        let Watch::Enter { a, b, sign, .. } = *self else { return out };
        for (j, sign) in std::iter::once((a, sign)).chain(b.map(|b| (b, -sign))) {
            let g = &dq[j * n_z..(j + 1) * n_z];
            out.iter_mut().for_each(|o| *o += sign * g[n_z - 1]);
            for (g, k) in g.iter().zip(k) {
                out.iter_mut().zip(k).for_each(|(o, k)| *o += sign * g * k);
            }
        }
        out
    }

    /// Derivatives of the time at which this vanishes with respect to state, parameters and controls, written to the
    /// first `n_z − 1` places of `out`; `velocity` is that before, gradients and active set of the field are those at
    /// the point, `jac` has room for `nx × n_z` values.
    pub(super) fn time_gradient(
        &self,
        field: &mut Field,
        (t, x, velocity): (f64, &[f64], &[f64]),
        jac: &mut [f64],
        out: &mut [f64],
    ) -> EvalResult {
        let n_z = field.n_z;
        match *self {
            Watch::Leave { cell, .. } => field.theta_gradient(cell, (t, x, velocity), jac, out)?,
            Watch::Enter { a, b, sign, .. } => {
                out.iter_mut().zip(&field.dq[a * n_z..(a + 1) * n_z]).for_each(|(o, g)| *o = sign * g);
                if let Some(b) = b {
                    out.iter_mut().zip(&field.dq[b * n_z..(b + 1) * n_z]).for_each(|(o, g)| *o -= sign * g);
                }
            }
        }
        let rate = out.iter().zip(velocity).fold(out[n_z - 1], |r, (g, v)| r + g * v);
        out[..n_z - 1].iter_mut().for_each(|g| *g /= -rate);
        Ok(())
    }

    /// Size of the rounding errors of the value, in units of the machine precision; and of the gradient.
    pub(super) fn scale(&self, dq: &[f64], n_z: usize, t: f64, x: &[f64]) -> (f64, f64) {
        let Watch::Enter { a, b, .. } = *self else { return (1.0, 1.0) };
        let (mut size, mut gradient) = (0.0, 0.0);
        let most = x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        for j in std::iter::once(a).chain(b) {
            let g = &dq[j * n_z..(j + 1) * n_z];
            for g in &g[..x.len()] {
                size += (g * most).abs();
                gradient += g * g;
            }
            size += (g[n_z - 1] * t).abs();
        }
        (size, gradient.sqrt())
    }
}

/// All that is to be watched under the active set of the field.
pub(super) fn list(field: &Field, out: &mut Vec<Watch>) {
    out.clear();
    for (k, (s, set)) in field.subs.iter().zip(&field.active).enumerate() {
        let first = set[0] - s.first;
        if s.signs {
            for j in 0..s.n_q {
                let w = s.cells[first].weights[j];
                let fixed = set.iter().all(|c| s.cells[c - s.first].weights[j] == w);
                if fixed && set.iter().any(|c| s.cares(c - s.first, j)) {
                    out.push(Watch::Enter { sub: k, a: s.q0 + j, b: None, sign: -w });
                }
            }
        } else {
            for j in (0..s.cells.len()).filter(|j| !set.contains(&(s.first + j))) {
                out.push(Watch::Enter { sub: k, a: s.q0 + j, b: Some(s.q0 + first), sign: 1.0 });
            }
        }
        if set.len() > 1 {
            out.extend(set.iter().map(|&cell| Watch::Leave { sub: k, cell }));
        }
    }
}
