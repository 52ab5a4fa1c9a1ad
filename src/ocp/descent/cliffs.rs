//! Cliffs: places where the merit function of a descent jumps, as where a control passes its own threshold, a start a line that repels, or a transition
//! with a reset is made no more.
//!
//! No model to first order knows of them. A step that falls over one fails however short it is made, until the box holds back all variables. The one that
//! leads over is held instead, as by a bound, and the others go on.

use super::sqp::{Descent, Values};
use crate::error::Result;

/// Share of a rise that is left at half the length of a step or less where it is a jump: that at a kink, and that of curvature, falls with it.
const JUMP: f64 = 0.75;
const SHORTER: f64 = 0.5;
/// Distance from an edge, as a share of the step over it, at which it is found, and share of the rise that is left between both sides of one.
const EDGE: f64 = 1e-9;
const LEFT: f64 = 0.25;

/// A step that ended higher than it began.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fall {
    pub by: f64,
    pub longest: f64,
    /// The box that it was made in.
    pub radius: f64,
    /// The price of violations: merits are of the same function.
    pub price: f64,
}

impl Fall {
    /// Does a shorter step fall over the same cliff?
    pub fn goes_on(&self, shorter: &Fall) -> bool {
        let same = self.by > 0.0 && self.price == shorter.price;
        same && shorter.longest <= SHORTER * self.longest && shorter.by > JUMP * self.by
    }
}

impl Descent<'_> {
    /// Holds the variable that leads over the cliff between a point and the end of a step: the last one that has to move for it, at the edge where it
    /// leads over by itself. Whether there is a cliff, and the number of simulations.
    pub(super) fn hold(&mut self, y: &[f64], here: &Values, (next, fall): (&[f64], &Fall)) -> Result<(bool, usize)> {
        let level = self.merit(here) + 0.5 * fall.by;
        let mut point = y.to_vec();
        let mut simulated = 0;
        let (mut variable, mut end) = (0, y.len());
        while end - variable > 1 {
            let middle = (variable + end) / 2;
            point[..middle].copy_from_slice(&next[..middle]);
            point[middle..].copy_from_slice(&y[middle..]);
            simulated += 1;
            match self.merit_at(&point)? > level {
                true => end = middle,
                false => variable = middle,
            }
        }
        let mut alone = y.to_vec();
        alone[variable] = next[variable];
        simulated += 1;
        let leads = self.merit_at(&alone)? > level;
        let to = if leads { &alone[..] } else { next };
        let (mut before, mut behind) = ((0.0, self.merit(here)), (1.0, f64::INFINITY));
        while behind.0 - before.0 > EDGE {
            let middle = 0.5 * (before.0 + behind.0);
            point.iter_mut().zip(y.iter().zip(to)).for_each(|(p, (a, b))| *p = a + middle * (b - a));
            simulated += 1;
            match self.merit_at(&point)? {
                merit if merit > level => behind = (middle, merit),
                merit => before = (middle, merit),
            }
        }
        if behind.1 - before.1 <= LEFT * fall.by {
            return Ok((false, simulated));
        }
        let way = next[variable] - y[variable];
        let edge = if leads { y[variable] + before.0 * way } else { y[variable] };
        if way > 0.0 {
            self.upper[variable] = edge;
            self.pieces.retain(|p| p.y[variable] <= edge);
        } else {
            self.lower[variable] = edge;
            self.pieces.retain(|p| p.y[variable] >= edge);
        }
        Ok((true, simulated))
    }
}
