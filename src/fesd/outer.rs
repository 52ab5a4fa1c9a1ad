//! What acts on states, controls and parameters from outside the dynamics: costs at points of time, constraints along the
//! path and at the ends weighted with their multipliers, and the multipliers of the bounds of states. With these the
//! costates of the control problem can be computed by any method that knows the dynamics.

use super::layout::{PathAt, PathConstraint};
use super::places::{Place, RowMeaning};
use super::problem::{Call, Fesd};
use crate::func::EvalError;
use crate::nlp::Nlp;

/// Where the states of one point of time begin among the variables.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StatePoint {
    /// Control stage; the initial state belongs to the first one.
    pub stage: usize,
    /// Share of the stage that lies before the point, 0 to 1.
    pub share: f64,
    /// First of the variables.
    pub at: usize,
}

/// A constraint at a point of time.
#[derive(Debug, Clone)]
pub struct Row {
    /// Its row.
    pub row: usize,
    pub value: f64,
    /// What is not zero of its gradient: variables and derivatives.
    pub gradient: Vec<(usize, f64)>,
    /// Does it hold all the time, so that it goes with a switch where it acts at one?
    pub along: bool,
}

fn acts_on_controls(c: &PathConstraint, row: usize) -> bool {
    let d = c.f.dims();
    (d.x..d.x + d.u).any(|j| c.f.jac_pattern().rows(j).contains(&row))
}

impl Fesd {
    /// The initial state, then the states at stage points and ends of elements, in the order of time.
    pub fn state_points(&self, w: &[f64]) -> Vec<StatePoint> {
        let lengths = self.stage_lengths(w);
        let mut out = vec![StatePoint { stage: 0, share: 0.0, at: self.layout().x0 }];
        let (mut stage, mut before) = (0, 0.0);
        for e in &self.layout().elements {
            if e.stage != stage {
                (stage, before) = (e.stage, 0.0);
            }
            let h = self.h_of(e, w);
            let share = |c: f64| ((before + c * h) / lengths[stage].max(f64::MIN_POSITIVE)).min(1.0);
            let points = e.x.iter().zip(&self.tableau().c).map(|(&at, c)| StatePoint { stage, share: share(*c), at });
            out.extend(points.filter(|p| p.at != e.x_end));
            out.push(StatePoint { stage, share: share(1.0), at: e.x_end });
            before += h;
        }
        out
    }

    /// Shares of every stage before the points inside of it at which a constraint along the path or a bound of a state acts, in the order of
    /// time, by the multipliers `y` of the rows and `z` of the bounds: those above a share `least` of the largest one.
    pub fn acting_shares(&self, w: &[f64], y: &[f64], z: &[f64], least: f64) -> Vec<Vec<f64>> {
        let largest = |v: &[f64]| v.iter().fold(0f64, |m, v| m.max(v.abs()));
        let (points, nx) = (self.state_points(w), self.spec.dcs.dims().x);
        // by the first of the variables of a point
        let mut force = vec![0.0; self.layout().n];
        points.iter().skip(1).for_each(|p| force[p.at] = largest(&z[p.at..p.at + nx]));
        let path = self.path_points().zip(self.path.iter().zip(&self.path_rows));
        for ((k, _), (c, &row)) in path.filter(|((_, at), _)| at.element.is_some()) {
            if let Some(at) = self.var(c, 0) {
                force[at] = force[at].max(largest(&y[row..row + self.spec.path[k].f.n_out()]));
            }
        }
        let least = least * largest(&force);
        let mut out = vec![Vec::new(); self.spec.n_stages()];
        for p in points.iter().skip(1).filter(|p| force[p.at] > least && p.share < 1.0) {
            out[p.stage].push(p.share);
        }
        out
    }

    /// The states that linear controls are, among the states of a point.
    pub fn ramp_places(&self) -> &[Option<usize>] {
        &self.layout().linear
    }

    /// Gradient `[n]` of the costs at points of time plus `yᵀ` times the constraints along the path and at the ends, less
    /// the multipliers `z` of the bounds of states (lower minus upper); the running cost and the dynamics are left out.
    pub fn outer_gradient(&mut self, w: &[f64], y: &[f64], z: &[f64]) -> std::result::Result<Vec<f64>, EvalError> {
        self.evaluate_values(w)?;
        self.evaluate_jacobians(w)?;
        let mut out = vec![0.0; self.layout().n];
        let path = self.path.iter().zip(&self.path_rows);
        for (c, &row) in path.chain(self.end_calls()) {
            self.add_gradient(c, &y[row..], &mut out);
        }
        self.mayer.iter().for_each(|c| self.add_gradient(c, &[1.0], &mut out));
        self.add_bounds(w, z, &mut out);
        Ok(out)
    }

    /// The part of [`Fesd::outer_gradient`], at the point of its last call, that holds all the time: constraints along the path and bounds of
    /// states.
    pub fn along_gradient(&self, w: &[f64], y: &[f64], z: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; self.layout().n];
        for ((k, _), (c, &row)) in self.path_points().zip(self.path.iter().zip(&self.path_rows)) {
            if self.spec.path[k].at != PathAt::ControlGrid {
                self.add_gradient(c, &y[row..], &mut out);
            }
        }
        self.add_bounds(w, z, &mut out);
        out
    }

    /// Takes away the multipliers of the bounds of states.
    fn add_bounds(&self, w: &[f64], z: &[f64], out: &mut [f64]) {
        for p in self.state_points(w).iter().skip(1) {
            (p.at..p.at + self.layout().nx).for_each(|j| out[j] -= z[j]);
        }
    }

    /// Derivatives `[(n_stages + 1) · nx]` of the Lagrange function with the multipliers `y [m]` with respect to the user's states
    /// at the start of every control stage, as far as costs and rows behind it make them; at the end of the horizon, as costs
    /// and constraints at the ends do. Path constraints on the state alone at the start of a stage are those at the end of the stage
    /// before: they do not count, as they would be counted by half at most.
    pub fn costates(&mut self, w: &[f64], y: &[f64]) -> std::result::Result<Vec<f64>, EvalError> {
        let (mut cost, mut values) = (vec![0.0; self.layout().n], vec![0.0; self.jac_pattern().nnz()]);
        self.evaluate_values(w)?;
        self.derivatives(w, &mut cost, &mut values)?;
        let n_stages = self.spec().n_stages();
        // stages that a row is behind the start of
        let stage_of = |row: &RowMeaning| match *row {
            RowMeaning::Path(Place { stage, element: None, .. }, k, r)
                if !acts_on_controls(&self.spec().path[k], r) =>
            {
                stage
            }
            RowMeaning::Dynamics(at, _) | RowMeaning::Complementarity(at) | RowMeaning::Grid(at) => at.stage + 1,
            RowMeaning::Path(at, ..) | RowMeaning::Pair(at, ..) => at.stage + 1,
            RowMeaning::Terminal(..) | RowMeaning::Boundary(..) => n_stages,
        };
        let stages: Vec<usize> = self.row_meanings().iter().map(stage_of).collect();
        let nx = self.spec().dcs.dims().x;
        let pattern = self.jac_pattern();
        let mut out = Vec::with_capacity((n_stages + 1) * nx);
        for k in 0..n_stages {
            let at = self.layout().stage(k)[0].x_start;
            for j in at..at + nx {
                let behind = pattern.range(j).zip(pattern.rows(j)).filter(|(_, &r)| stages[r] > k);
                out.push(behind.map(|(entry, &r)| y[r] * values[entry]).sum());
            }
        }
        let mut ends = vec![0.0; self.layout().n];
        self.mayer.iter().for_each(|c| self.add_gradient(c, &[1.0], &mut ends));
        for (c, &row) in self.end_calls() {
            self.add_gradient(c, &y[row..], &mut ends);
        }
        let end = self.end_place();
        out.extend_from_slice(&ends[end..end + nx]);
        Ok(out)
    }

    /// The points at which the path constraint `index` holds: times from the start of the horizon, and first rows.
    pub fn path_rows(&self, index: usize, w: &[f64]) -> Vec<(f64, usize)> {
        // those inside of elements are behind all others
        let regular = self.path_rows.len() - self.spec.inside.len();
        let all = self.path_points().zip(&self.path_rows).enumerate();
        let own = all.filter(|(_, ((constraint, _), _))| *constraint == index);
        let mut rows: Vec<(f64, usize)> = own
            .map(|(k, ((_, at), &row))| {
                let end = self.time_at(at, w);
                let left = k.checked_sub(regular).map_or(0.0, |k| self.time_left(&self.spec.inside[k], w));
                (end - left, row)
            })
            .collect();
        rows.sort_by(|a, b| a.0.total_cmp(&b.0));
        rows
    }

    /// First rows of the terminal constraints, and of those between the ends.
    pub fn end_rows(&self) -> [&[usize]; 2] {
        [&self.layout().row_terminal, &self.layout().row_boundary]
    }

    /// The constraints at the ends of the horizon, at the point where [`Fesd::outer_gradient`] was called last.
    pub fn end_gradients(&self) -> Vec<Row> {
        self.end_calls().flat_map(|(c, &row)| self.rows_of(c, row, false)).collect()
    }

    /// The constraints along the path at all of their points, in the same way.
    pub fn path_gradients(&self) -> Vec<Row> {
        let calls = self.path_points().zip(self.path.iter().zip(&self.path_rows));
        calls
            .flat_map(|((k, _), (c, &row))| self.rows_of(c, row, self.spec.path[k].at != PathAt::ControlGrid))
            .collect()
    }

    /// The rows of a call, the first of which is `first`.
    fn rows_of(&self, c: &Call, first: usize, along: bool) -> Vec<Row> {
        let value = |r: usize| self.cache.val[c.val + r];
        let row = |r: usize| Row { row: first + r, value: value(r), gradient: Vec::new(), along };
        let mut out: Vec<Row> = (0..self.functions[c.f].n_out()).map(row).collect();
        for (p, &(col, row)) in self.jac_cols[c.f].iter().enumerate() {
            let derivative = self.cache.jac[c.jac + p];
            if let Some(v) = self.var(c, col).filter(|_| derivative != 0.0) {
                out[row as usize].gradient.push((v, derivative));
            }
        }
        out
    }

    /// Terminal and boundary constraints with their first rows.
    fn end_calls(&self) -> impl Iterator<Item = (&Call, &usize)> {
        let l = self.layout();
        self.terminal.iter().zip(&l.row_terminal).chain(self.boundary.iter().zip(&l.row_boundary))
    }

    fn add_gradient(&self, c: &Call, weights: &[f64], out: &mut [f64]) {
        for (p, &(col, row)) in self.jac_cols[c.f].iter().enumerate() {
            if let Some(v) = self.var(c, col) {
                out[v] += weights[row as usize] * self.cache.jac[c.jac + p];
            }
        }
    }
}
