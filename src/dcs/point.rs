//! The system at one point, and which modes can be active just after it.
//!
//! At a point where several indicators are smallest, the modes that follow solve the linear complementarity
//! problem (6.19): `0 ≤ θ_i ⊥ ġ_i(θ) − ν_k ≥ 0`, `Σ θ = 1` per subsystem, with `ġ = ∇g ẋ(θ)`. It is small, so
//! all its solutions are found by enumeration; more than one velocity means that the continuation is not unique.

use nalgebra::{DMatrix, DVector};

use super::Dcs;
use crate::func::{EvalResult, Point};

/// Combinations tried at most; beyond that the point is left to the MPCC.
const MAX_COMBINATIONS: usize = 4096;

/// A solution of (6.19).
#[derive(Debug, Clone, PartialEq)]
pub struct Continuation {
    /// Active cells, all subsystems one after the other.
    pub active: Vec<bool>,
    /// Weights of the cells.
    pub theta: Vec<f64>,
    /// Derivative of the states.
    pub velocity: Vec<f64>,
}

/// Values and gradients at a point. All memory is allocated once.
pub struct PointEvaluator {
    nx: usize,
    /// Smooth part of the right-hand side.
    f0: Vec<f64>,
    /// Right-hand side of every cell, `n_cells × nx`.
    fields: Vec<f64>,
    /// Indicators.
    g: Vec<f64>,
    /// Gradients of the indicators with respect to state and time, `n_cells × (nx + 1)`.
    dg: Vec<f64>,
    buffer: Vec<f64>,
    work: Vec<f64>,
}

impl PointEvaluator {
    /// For a system.
    pub fn new(dcs: &Dcs) -> PointEvaluator {
        let (nx, nc) = (dcs.dims().x, dcs.n_cells());
        let drifts = dcs.drifts().iter().map(|d| &d.f);
        let subs = dcs.subsystems().iter().flat_map(|s| [&s.modes, &s.indicators]);
        let (mut buffer, mut work) = (0, 0);
        for f in drifts.chain(subs) {
            buffer = buffer.max(f.n_out()).max(f.jac_pattern().nnz());
            work = work.max(f.work_len());
        }
        PointEvaluator {
            nx,
            f0: vec![0.0; nx],
            fields: vec![0.0; nc * nx],
            g: vec![0.0; nc],
            dg: vec![0.0; nc * (nx + 1)],
            buffer: vec![0.0; buffer],
            work: vec![0.0; work],
        }
    }

    /// Evaluates everything at `at`.
    pub fn evaluate(&mut self, dcs: &Dcs, at: &Point) -> EvalResult {
        let nx = self.nx;
        self.f0.fill(0.0);
        self.fields.fill(0.0);
        self.g.fill(0.0);
        self.dg.fill(0.0);
        for d in dcs.drifts() {
            d.f.value(at, &mut self.buffer[..d.rows.len()], &mut self.work)?;
            for (o, &r) in d.rows.iter().enumerate() {
                self.f0[r] += self.buffer[o];
            }
        }
        let mut first = 0;
        for s in dcs.subsystems() {
            let nr = s.rows.len();
            let n_out = s.modes.n_out();
            s.modes.value(at, &mut self.buffer[..n_out], &mut self.work)?;
            for (c, cell) in s.cells.iter().enumerate() {
                for (o, &r) in s.rows.iter().enumerate() {
                    self.fields[(first + c) * nx + r] = self.buffer[cell.mode * nr + o];
                }
            }
            let n_ind = s.indicators.n_out();
            s.indicators.value(at, &mut self.buffer[..n_ind], &mut self.work)?;
            for (c, cell) in s.cells.iter().enumerate() {
                self.g[first + c] = cell.weights.iter().zip(&self.buffer).map(|(w, v)| w * v).sum();
            }
            let p = s.indicators.jac_pattern();
            if p.nnz() > 0 {
                s.indicators.jacobian(at, &mut self.buffer[..p.nnz()], &mut self.work)?;
            }
            for col in 0..p.n_cols() {
                let to = if col < nx {
                    col
                } else if col == dcs.dims().t_col() {
                    nx
                } else {
                    continue;
                };
                for k in p.range(col) {
                    for (c, cell) in s.cells.iter().enumerate() {
                        self.dg[(first + c) * (nx + 1) + to] += cell.weights[p.row_idx()[k]] * self.buffer[k];
                    }
                }
            }
            first += s.cells.len();
        }
        Ok(())
    }

    /// Cells whose indicator is within `tol` (relative to the size of the indicators' gradient) of the smallest
    /// one of their subsystem.
    pub fn candidates(&self, dcs: &Dcs, tol: f64) -> Vec<bool> {
        let mut out = vec![false; self.g.len()];
        let mut first = 0;
        for s in dcs.subsystems() {
            let n = s.cells.len();
            let min = self.g[first..first + n].iter().fold(f64::INFINITY, |a, &b| a.min(b));
            for c in first..first + n {
                let row = &self.dg[c * (self.nx + 1)..(c + 1) * (self.nx + 1)];
                let scale = row.iter().fold(1e-3f64, |a, v| a.max(v.abs()));
                out[c] = self.g[c] - min <= tol * scale;
            }
            first += n;
        }
        out
    }

    /// All solutions of (6.19) with active cells among `candidates`, small sets first; empty when there is none or
    /// there are too many combinations.
    pub fn continuations(&self, dcs: &Dcs, candidates: &[bool]) -> Vec<Continuation> {
        let mut lists: Vec<Vec<Vec<usize>>> = Vec::new();
        let (mut first, mut total) = (0, 1usize);
        for s in dcs.subsystems() {
            let cand: Vec<usize> = (first..first + s.cells.len()).filter(|&c| candidates[c]).collect();
            if cand.is_empty() || cand.len() > 12 {
                return Vec::new();
            }
            let mut subsets: Vec<Vec<usize>> = (1..1usize << cand.len())
                .map(|m| cand.iter().enumerate().filter(|(i, _)| m >> i & 1 == 1).map(|(_, &c)| c).collect())
                .collect();
            subsets.sort_by_key(Vec::len);
            total = total.saturating_mul(subsets.len());
            lists.push(subsets);
            first += s.cells.len();
        }
        if total > MAX_COMBINATIONS {
            return Vec::new();
        }
        let mut out: Vec<Continuation> = (0..total)
            .filter_map(|mut k| {
                let sets: Vec<&[usize]> = lists
                    .iter()
                    .map(|l| {
                        let s = &l[k % l.len()];
                        k /= l.len();
                        s.as_slice()
                    })
                    .collect();
                self.solve(dcs, &sets, candidates)
            })
            .collect();
        out.sort_by_key(|c| c.active.iter().filter(|a| **a).count());
        out
    }

    /// Weights and velocity for given active sets, when they satisfy all signs.
    fn solve(&self, dcs: &Dcs, sets: &[&[usize]], candidates: &[bool]) -> Option<Continuation> {
        const TOL: f64 = 1e-9;
        let (nx, n_sub) = (self.nx, sets.len());
        let cells: Vec<usize> = sets.iter().flat_map(|s| s.iter().copied()).collect();
        let owner: Vec<usize> = sets.iter().enumerate().flat_map(|(k, s)| s.iter().map(move |_| k)).collect();
        let n = cells.len();
        let rate = |c: usize, v: &[f64]| {
            let row = &self.dg[c * (nx + 1)..(c + 1) * (nx + 1)];
            row[..nx].iter().zip(v).map(|(a, b)| a * b).sum::<f64>()
        };
        let mut a = DMatrix::<f64>::zeros(n + n_sub, n + n_sub);
        let mut b = DVector::<f64>::zeros(n + n_sub);
        for (i, &c) in cells.iter().enumerate() {
            for (j, &d) in cells.iter().enumerate() {
                a[(i, j)] = rate(c, &self.fields[d * nx..(d + 1) * nx]);
            }
            a[(i, n + owner[i])] = -1.0;
            a[(n + owner[i], i)] = 1.0;
            b[i] = -rate(c, &self.f0) - self.dg[c * (nx + 1) + nx];
        }
        for k in 0..n_sub {
            b[n + k] = 1.0;
        }
        let scale = a.amax().max(1.0);
        let sol = a.clone().lu().solve(&b)?;
        if (&a * &sol - &b).amax() > 1e-8 * scale * sol.amax().max(1.0) || sol.iter().any(|v| !v.is_finite()) {
            return None;
        }
        let mut theta = vec![0.0; self.g.len()];
        let mut velocity = self.f0.clone();
        for (i, &c) in cells.iter().enumerate() {
            if sol[i] < -TOL {
                return None;
            }
            theta[c] = sol[i];
            for r in 0..nx {
                velocity[r] += sol[i] * self.fields[c * nx + r];
            }
        }
        let mut first = 0;
        for (k, s) in dcs.subsystems().iter().enumerate() {
            for c in (first..first + s.cells.len()).filter(|&c| candidates[c] && !cells.contains(&c)) {
                let w = rate(c, &velocity) + self.dg[c * (nx + 1) + nx] - sol[n + k];
                if w < -TOL * scale {
                    return None;
                }
            }
            first += s.cells.len();
        }
        let mut active = vec![false; self.g.len()];
        cells.iter().for_each(|&c| active[c] = true);
        Some(Continuation { active, theta, velocity })
    }
}

/// Do the solutions differ in more than the degeneracy of a set with `θ_i = 0`?
pub fn is_ambiguous(solutions: &[Continuation]) -> bool {
    let Some(first) = solutions.first() else { return false };
    solutions[1..].iter().any(|s| {
        let scale = first.velocity.iter().fold(1.0f64, |a, v| a.max(v.abs()));
        s.velocity.iter().zip(&first.velocity).any(|(a, b)| (a - b).abs() > 1e-6 * scale)
    })
}
