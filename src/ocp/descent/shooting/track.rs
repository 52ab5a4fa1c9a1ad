//! Controls whose simulation follows given states, one stage after the other: where descents begin that would not find there by themselves, as
//! motions that are unstable, or that fall where nothing drives them.

use super::Shooting;
use crate::error::{Error, Result};
use crate::ocp::descent::Values;
use nalgebra::{DMatrix, DVector};

/// Steps of Gauss and Newton in every stage, and how often one is halved.
const STEPS: usize = 4;
const HALVED: i32 = 3;
/// Share of what states are off above which a step has hardly gained.
const GAINED: f64 = 0.9;
/// Weight of a change of a control relative to what it changes states by (Marquardt): controls that do the same share it.
const STAYS: f64 = 1e-3;

impl Shooting<'_> {
    /// Variables like `z` with controls such that the states at the ends of the stages are nearer to those of `path`, `[nx]` each, in their sizes. `None`
    /// where that is simulated to no end.
    pub fn track(&mut self, mut z: Vec<f64>, path: &[Vec<f64>]) -> Result<Option<Vec<f64>>> {
        let mut here = self.begin(&z);
        for (k, target) in path.iter().enumerate() {
            let Some(end) = self.fit(&mut z, k, &here, target)? else { return Ok(None) };
            here = end;
        }
        Ok(Some(z))
    }

    /// Places of the user's controls of a stage: at its end where they are linear.
    fn controls_of(&self, k: usize) -> Vec<usize> {
        (0..self.ocp.system.dims().u).map(|j| self.control_at(k + usize::from(self.is_linear(j)), j)).collect()
    }

    /// Changes the controls of a stage that begins at a point so that it ends near a state. Where it ends then, if it does.
    fn fit(&mut self, z: &mut Vec<f64>, k: usize, here: &super::Node, target: &[f64]) -> Result<Option<super::Node>> {
        let mut moved = self.controls_of(k);
        if k == 0 {
            moved.extend((0..self.ocp.system.dims().u).filter(|&j| self.is_linear(j)).map(|j| self.control_at(0, j)));
        }
        let Some(mut end) = self.end_of_stage(z, k, here)? else { return Ok(None) };
        let mut off = self.off(&end, target);
        for _ in 0..STEPS {
            let Some(step) = self.towards(&end, &off, &moved) else { break };
            let mut better = None;
            for halved in 0..HALVED {
                let mut there = z.clone();
                for (&at, d) in moved.iter().zip(step.iter()) {
                    there[at] =
                        (z[at] + 0.5f64.powi(halved) * d * self.sizes[at]).max(self.lower[at]).min(self.upper[at]);
                }
                let found = self.end_of_stage(&there, k, here)?.map(|end| (self.off(&end, target), end, there));
                better = found.filter(|(left, ..)| left.norm() < off.norm());
                if better.is_some() {
                    break;
                }
            }
            let Some((left, next, there)) = better else { break };
            let gained = left.norm() < GAINED * off.norm();
            (*z, off, end) = (there, left, next);
            if !gained {
                break;
            }
        }
        Ok(Some(end))
    }

    /// How far states are from others, in their sizes.
    fn off(&self, here: &super::Node, target: &[f64]) -> DVector<f64> {
        let first = self.n_front();
        let of = |i: usize| (target[i] - here.x[first + i]) / self.usual.x[i];
        DVector::from_fn(target.len(), |i, _| of(i))
    }

    /// The change of variables, in their sizes, that takes away most of what states are off.
    fn towards(&self, here: &super::Node, off: &DVector<f64>, moved: &[usize]) -> Option<DVector<f64>> {
        let entry = |i: usize, j: usize| here.dx[(i, moved[j])] * self.sizes[moved[j]] / self.usual.x[i];
        let by = DMatrix::from_fn(off.len(), moved.len(), entry);
        let mut gram = by.transpose() * &by;
        let least = f64::EPSILON * gram.diagonal().max();
        (0..moved.len()).for_each(|j| gram[(j, j)] += STAYS * gram[(j, j)] + least);
        gram.cholesky().map(|c| c.solve(&(by.transpose() * off))).filter(|d| d.iter().all(|v| v.is_finite()))
    }

    /// The end of a stage that begins at a point.
    fn end_of_stage(&mut self, z: &[f64], k: usize, here: &super::Node) -> Result<Option<super::Node>> {
        // modes are those of the state
        let start = super::Node { begins: true, ..here.clone() };
        match self.stage(z, k, &start, here, &mut Values::default()) {
            Err(e @ (Error::Interrupted | Error::OutOfTime | Error::Internal(_))) => Err(e),
            Ok(end) => Ok(end.filter(|e| e.x.iter().all(|v| v.is_finite()))),
            Err(_) => Ok(None),
        }
    }
}
