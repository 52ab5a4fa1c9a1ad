//! Inverse dynamics: controls with which a motion accelerates as it should, where contacts and constraints carry what they have to.

use super::dynamics::{dot, At, Dynamics};
use crate::func::EvalError;
use nalgebra::{DMatrix, DVector};

/// Weight of controls in the least squares, as a share of what the strongest one does; forces have none next to it.
const EFFORT: f64 = 1e-6;
const FORCE: f64 = 1e-12;
/// Share of the size of a velocity up to which something rests.
const RESTS: f64 = 1e-6;

/// A force: its contact, and whether it may have any sign.
struct Push {
    contact: usize,
    pulls: bool,
}

impl Dynamics {
    /// Changes of the controls, in sizes `size`, with which the accelerations come closest to `wanted`, in sizes `unit` `[n_v]`. Contacts with a gap of at most
    /// `near` push with what friction does to what slides, and hold what rests. None where the equations have no solution.
    pub(crate) fn drive(
        &mut self,
        at: &At,
        wanted: &[f64],
        (size, unit): (&[f64], &[f64]),
        near: f64,
    ) -> Result<Option<Vec<f64>>, EvalError> {
        self.load(at)?;
        let m = self.mechanics.clone();
        let mut off: Vec<f64> = wanted.iter().zip(&self.free).map(|(a, f)| a - f).collect();
        let (pattern, columns) = (m.smooth.jac_pattern(), at.x.len()..at.x.len() + at.u.len());
        let mut entries = vec![0.0; pattern.nnz()];
        let there = Dynamics::weighted(&self.weights, &mut self.extended, at);
        m.smooth.jacobian(&there, &mut entries, &mut self.work)?;
        let mut moved: Vec<Vec<f64>> = Vec::new();
        for (j, size) in columns.zip(size) {
            let mut by = vec![0.0; m.n_v];
            for (&i, v) in
                pattern.rows(j).iter().zip(&entries[pattern.range(j)]).filter(|(i, _)| m.velocities().contains(i))
            {
                by[i - m.n_q] = v * size;
            }
            moved.push(by);
        }
        let mut pushes: Vec<Push> = Vec::new();
        let rests = RESTS * unit.iter().fold(0f64, |a, v| a.max(*v));
        for (i, c) in m.contacts.iter().enumerate() {
            if self.is_switch(i) {
                continue;
            }
            if self.opens(i) {
                self.load_gap(at, i)?;
                if self.blocks[i].gap[0] > near {
                    continue;
                }
            }
            self.load_contact(at, i)?;
            let b = &self.blocks[i];
            let speed = b.sliding[0].hypot(b.sliding[1]);
            let drags = c.n_tangents > 0 && speed > rests;
            let direction = |k: usize| b.sliding[k] / speed;
            if self.is_joint(i) {
                let mut drag = b.tangent(0).iter().map(|t| -b.friction * direction(0) * t).collect::<Vec<f64>>();
                self.mass.solve(&mut drag);
                if drags {
                    off.iter_mut().zip(&drag).for_each(|(o, d)| *o -= d);
                }
                continue;
            }
            let mut normal = b.normal.clone();
            for k in (0..c.n_tangents).filter(|_| drags) {
                normal.iter_mut().zip(b.tangent(k)).for_each(|(n, t)| *n -= b.friction * direction(k) * t);
            }
            moved.push(normal);
            let held = if drags || b.friction == 0.0 { 0 } else { c.n_tangents };
            moved.extend((0..held).map(|k| b.tangent(k).to_vec()));
            pushes.extend((0..=held).map(|k| Push { contact: i, pulls: k > 0 || !self.opens(i) }));
        }
        let n_u = size.len();
        for (j, by) in moved.iter_mut().enumerate() {
            self.mass.solve(by);
            by.iter_mut().zip(unit).for_each(|(a, u)| *a /= u);
            let length = dot(by, by).sqrt();
            if j >= n_u && length > 0.0 {
                by.iter_mut().for_each(|a| *a /= length);
            }
        }
        let off = DVector::from_iterator(m.n_v, off.iter().zip(unit).map(|(o, u)| o / u));
        let mut kept: Vec<usize> = (0..moved.len()).collect();
        loop {
            let by = DMatrix::from_fn(m.n_v, kept.len(), |i, j| moved[kept[j]][i]);
            let mut gram = by.transpose() * &by;
            let most = (0..n_u).fold(0f64, |a, j| a.max(gram[(j, j)]));
            for (j, k) in kept.iter().enumerate() {
                gram[(j, j)] += most * if *k < n_u { EFFORT } else { FORCE };
            }
            let Some(found) = gram.cholesky().map(|c| c.solve(&(by.transpose() * &off))) else { return Ok(None) };
            // contacts do not pull: those that would are open
            let pulls = |(j, k): &(usize, &usize)| **k >= n_u && !pushes[**k - n_u].pulls && found[*j] < 0.0;
            let before = kept.len();
            let open: Vec<usize> =
                kept.iter().enumerate().filter(pulls).map(|(_, k)| pushes[k - n_u].contact).collect();
            kept.retain(|k| *k < n_u || !open.contains(&pushes[k - n_u].contact));
            if kept.len() == before {
                let all: Vec<f64> = found.iter().take(n_u).zip(size).map(|(d, s)| d * s).collect();
                return Ok(Some(all).filter(|d| d.iter().all(|v| v.is_finite())));
            }
        }
    }
}
