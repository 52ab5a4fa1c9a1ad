//! Rows of constraints at the nodes.

use super::cost::add_block;
use super::evaluate::Many;
use super::nodes::Nodes;
use crate::func::EvalResult;
use crate::qp::{Price, Row, StageQp};
use crate::system::SharedFunction;

/// Where a constraint holds.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Where {
    /// At the start of every stage, and, where the control has no influence, at the last node in its place.
    Path,
    /// The same with a price that is integrated: not at the last node.
    PricedPath,
    /// At the last node.
    Terminal,
}

/// A constraint as stated.
pub(super) struct Stated {
    pub f: SharedFunction,
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    pub place: Where,
    pub price: Option<Price>,
}

/// What a row of the program is.
#[derive(Clone, Copy)]
pub(super) struct RowSource {
    /// Number of the group, none for bounds of states.
    pub group: Option<usize>,
    /// Output of its function, or the state.
    pub out: usize,
    pub lower: f64,
    pub upper: f64,
}

/// All rows, node by node.
pub(super) struct Constraints {
    pub groups: Vec<Many>,
    pub sources: Vec<RowSource>,
    rows: Vec<Row>,
    /// Values of all rows at the last point.
    pub values: Vec<f64>,
}

impl Constraints {
    /// Rows of stated constraints and of bounds of states (differential, then algebraic) behind the first node.
    pub fn new(nodes: &Nodes, stated: &[Stated], state_bounds: [&[f64]; 2], second: bool) -> Constraints {
        let n = nodes.n;
        let groups: Vec<Many> = stated.iter().map(|c| Many::new(&c.f, n + 1, second)).collect();
        let (from_u, to_u) = (nodes.nx + nodes.nz, nodes.nx + nodes.nz + nodes.nu);
        let (mut sources, mut rows) = (Vec::new(), Vec::new());
        for node in 0..=n {
            if node > 0 {
                for (out, (&lower, &upper)) in state_bounds[0].iter().zip(state_bounds[1]).enumerate() {
                    if lower.is_finite() || upper.is_finite() {
                        sources.push(RowSource { group: None, out, lower, upper });
                        rows.push(Row { node, price: None });
                    }
                }
            }
            for (group, (c, f)) in stated.iter().zip(&groups).enumerate() {
                for out in 0..f.n_out() {
                    let controlled = f.jac_entries.iter().any(|e| e.0 == out && (from_u..to_u).contains(&e.1));
                    let here = match c.place {
                        Where::Terminal => node == n,
                        // the first state is given: what depends on it alone cannot be changed
                        _ if controlled => node < n,
                        Where::Path => node > 0,
                        Where::PricedPath => node > 0 && node < n,
                    };
                    let (lower, upper) = (c.lower[out], c.upper[out]);
                    if here && (lower.is_finite() || upper.is_finite()) {
                        let scale = if c.place == Where::PricedPath { nodes.h[node] } else { 1.0 };
                        let price = c.price.map(|p| Price { linear: p.linear * scale, quadratic: p.quadratic * scale });
                        sources.push(RowSource { group: Some(group), out, lower, upper });
                        rows.push(Row { node, price });
                    }
                }
            }
        }
        Constraints { groups, values: vec![0.0; rows.len()], sources, rows }
    }

    /// The rows of the program.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// Values of all rows.
    pub fn values(&mut self, nodes: &Nodes, x: &[f64], u: &[f64]) -> EvalResult {
        for f in &mut self.groups {
            (0..=nodes.n).for_each(|k| nodes.put(k, x, u, f, k));
            f.values()?;
        }
        for ((v, s), r) in self.values.iter_mut().zip(&self.sources).zip(&self.rows) {
            *v = match s.group {
                None if s.out < nodes.nx => x[r.node * nodes.nx + s.out],
                None => nodes.z[r.node * nodes.nz + s.out - nodes.nx],
                Some(g) => self.groups[g].value[s.out * (nodes.n + 1) + r.node],
            };
        }
        Ok(())
    }

    /// Values and Jacobians.
    pub fn linearise(&mut self, nodes: &Nodes, x: &[f64], u: &[f64]) -> EvalResult {
        self.values(nodes, x, u)?;
        self.groups.iter_mut().try_for_each(Many::jacobians)
    }

    /// Hessians with the multipliers of the rows, added to the blocks of the nodes by [`Constraints::add_hessian`].
    pub fn hessians(&mut self, nodes: &Nodes, mu: &[f64]) -> EvalResult {
        for (g, f) in self.groups.iter_mut().enumerate() {
            for k in 0..=nodes.n {
                f.set_weights(k, std::iter::repeat_n(0.0, f.n_out()));
            }
            for ((s, r), mu) in self.sources.iter().zip(&self.rows).zip(mu).filter(|e| e.0 .0.group == Some(g)) {
                let at = (f.dims.n_in() + s.out) * f.n + r.node;
                f.inputs[at] = *mu;
            }
            f.hessians()?;
        }
        Ok(())
    }

    pub fn add_hessian(&self, nodes: &Nodes, blocks: &mut [f64]) {
        for f in &self.groups {
            (0..=nodes.n).for_each(|k| add_block(nodes, f, k, k, blocks));
        }
    }

    /// Bounds of the rows for steps from the point of the last values.
    pub fn write_bounds(&self, qp: &mut StageQp) {
        for (i, s) in self.sources.iter().enumerate() {
            (qp.row_lower[i], qp.row_upper[i]) = (s.lower - self.values[i], s.upper - self.values[i]);
            qp.row_base[i] = self.values[i].abs();
        }
    }

    /// Does the program have rows for bounds of state `i`?
    pub fn has_row(&self, i: usize) -> bool {
        self.sources.iter().any(|s| s.group.is_none() && s.out == i)
    }

    /// Other bounds of the differential states, those that have rows.
    pub fn set_state_bounds(&mut self, lower: &[f64], upper: &[f64]) {
        for s in self.sources.iter_mut().filter(|s| s.group.is_none() && s.out < lower.len()) {
            (s.lower, s.upper) = (lower[s.out], upper[s.out]);
        }
    }

    /// Bounds of the differential states for steps from states `x` of all nodes.
    pub fn write_state_bounds(&self, x: &[f64], qp: &mut StageQp) {
        let nx = qp.nx;
        for (i, (s, r)) in self.sources.iter().zip(&self.rows).enumerate() {
            if s.group.is_none() && s.out < nx {
                let value = x[r.node * nx + s.out];
                (qp.row_lower[i], qp.row_upper[i]) = (s.lower - value, s.upper - value);
                qp.row_base[i] = value.abs();
            }
        }
    }

    /// Jacobians of the rows.
    pub fn write_jacobian(&self, nodes: &Nodes, qp: &mut StageQp, row: &mut [f64]) {
        for i in 0..self.sources.len() {
            self.row(nodes, i, row);
            qp.row_x[i * nodes.nx..(i + 1) * nodes.nx].copy_from_slice(&row[..nodes.nx]);
            qp.row_u[i * nodes.nu..(i + 1) * nodes.nu].copy_from_slice(&row[nodes.nx..]);
        }
    }

    /// Adds `Cᵀ μ` at the point of the last Jacobians.
    pub fn add_transposed(&self, nodes: &Nodes, mu: &[f64], gx: &mut [f64], gu: &mut [f64], row: &mut [f64]) {
        for (i, mu) in mu.iter().enumerate().filter(|e| *e.1 != 0.0) {
            self.row(nodes, i, row);
            row.iter_mut().for_each(|v| *v *= mu);
            super::cost::give(nodes, self.rows[i].node, row, gx, gu);
        }
    }

    fn row(&self, nodes: &Nodes, i: usize, row: &mut [f64]) {
        row.fill(0.0);
        let (s, k) = (self.sources[i], self.rows[i].node);
        match s.group.map(|g| &self.groups[g]) {
            None => nodes.add_derivative(k, s.out, 1.0, row),
            Some(f) => {
                for (e, entry) in f.jac_entries.iter().enumerate().filter(|e| e.1 .0 == s.out) {
                    nodes.add_derivative(k, entry.1, f.jac[e * f.n + k], row);
                }
            }
        }
        if k == nodes.n {
            row[nodes.nx..].fill(0.0);
        }
    }

    /// Sum of the violations that are not allowed, and the price of those that are, at the last values.
    pub fn violation(&self) -> [f64; 2] {
        let (mut hard, mut priced) = (0.0, 0.0);
        for ((s, r), v) in self.sources.iter().zip(&self.rows).zip(&self.values) {
            let beyond = (v - s.upper).max(s.lower - v).max(0.0);
            match r.price {
                None => hard += beyond,
                Some(p) => priced += beyond * (p.linear + p.quadratic * beyond),
            }
        }
        [hard, priced]
    }
}
