//! A starting point for a step with a switch, out of the solution of the same step without it.

use super::branch::Violation;
use super::problem::Fesd;
use crate::nlp::within;

/// A point of the grid: its time from the start of the step, and the element and stage point whose values it has.
#[derive(Debug, Clone, Copy)]
struct Node {
    t: f64,
    element: usize,
    stage: usize,
}

impl Fesd {
    /// When the multiplier that violates its sign in `w` passed through zero: the root of the line through its values
    /// around the violation. Seconds from the start of the step.
    pub fn event_time(&self, w: &[f64], v: &Violation) -> f64 {
        let nodes = self.nodes(w);
        let value = |n: &Node| {
            let e = &self.l.elements[n.element];
            w[v.cell + if v.of_theta { e.theta[n.stage] } else { e.lambda[n.stage] }]
        };
        let first = nodes.iter().position(|n| n.element == v.element && value(n) < 0.0);
        let Some(k) = first else {
            // only the multiplier at the end of the element is negative
            return nodes.iter().filter(|n| n.element <= v.element).map(|n| n.t).fold(0.0, f64::max);
        };
        let (a, b) = match k {
            0 if nodes.len() > 1 => (nodes[0], nodes[1]),
            0 => return 0.5 * nodes[0].t,
            _ => (nodes[k - 1], nodes[k]),
        };
        let (va, vb) = (value(&a), value(&b));
        let root = if va == vb { b.t } else { a.t - va * (b.t - a.t) / (vb - va) };
        let lowest = if k == 0 { 1e-3 * nodes[0].t } else { a.t };
        within(root, lowest, nodes[k].t)
    }

    /// Writes into `w` the point that `base` becomes when the elements up to `last` end at the time `event` and the rest
    /// follows: states, multipliers and stage derivatives of `base` at the nearest of its points, states interpolated.
    pub fn restart(&self, base: &[f64], last: usize, event: f64, w: &mut [f64]) {
        let (l, n_fe) = (&self.l, self.l.elements.len());
        let before = self.nodes(base);
        let total = self.durations.iter().sum::<f64>();
        w.copy_from_slice(base);
        for (k, e) in l.elements.iter().enumerate() {
            if let Some(h) = e.h {
                let share = if k <= last {
                    event / (last + 1) as f64
                } else {
                    (total - event) / (n_fe - 1 - last).max(1) as f64
                };
                w[h] = share.max(1e-9 * total);
            }
        }
        let x0 = l.elements[0].x_start;
        let state = |t: f64, r: usize| {
            let k = before.partition_point(|n| n.t < t);
            let of = |n: &Node| base[l.elements[n.element].x[n.stage] + r];
            let (ta, xa) = k.checked_sub(1).map_or((0.0, base[x0 + r]), |i| (before[i].t, of(&before[i])));
            match before.get(k) {
                Some(n) if n.t > ta => xa + (of(n) - xa) * ((t - ta) / (n.t - ta)),
                _ => xa,
            }
        };
        let after = self.nodes(w);
        for n in &after {
            let k = before.partition_point(|m| m.t < n.t).min(before.len() - 1);
            let (from, to) = (before[k], &l.elements[n.element]);
            let e = &l.elements[from.element];
            for r in 0..l.nx {
                w[to.x[n.stage] + r] = state(n.t, r);
                if !l.values_form {
                    w[to.v[n.stage] + r] = base[e.v[from.stage] + r];
                }
            }
            for c in 0..l.n_weights {
                w[to.theta[n.stage] + c] = base[e.theta[from.stage] + c];
            }
            for c in 0..l.n_cells {
                w[to.lambda[n.stage] + c] = base[e.lambda[from.stage] + c].max(0.0);
            }
            for k in 0..l.n_mu {
                w[to.mu[n.stage] + k] = base[e.mu[from.stage] + k];
            }
        }
        let mut t = 0.0;
        for e in &l.elements {
            t += e.h.map_or(total / n_fe as f64, |h| w[h]);
            if e.row_end.is_some() {
                for r in 0..l.nx {
                    w[e.x_end + r] = state(t, r);
                }
            }
            self.write_sums(w, e);
        }
    }

    /// All stage points in the order of time.
    fn nodes(&self, w: &[f64]) -> Vec<Node> {
        let mut out = Vec::with_capacity(self.l.elements.len() * self.tableau.n_s);
        let mut t = 0.0;
        for (element, e) in self.l.elements.iter().enumerate() {
            let h = self.h_of(e, w);
            out.extend(self.tableau.c.iter().enumerate().map(|(stage, c)| Node { t: t + c * h, element, stage }));
            t += h;
        }
        out
    }
}
