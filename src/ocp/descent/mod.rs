//! Descent on event-driven simulations: an answer that is not optimal, and whose direction no sequence of modes next to its own
//! follows, is bettered in its controls alone. What the descent ends at is the start of a mode program again.

mod blocks;
mod chain;
mod cliffs;
mod hinges;
mod judge;
mod order;
mod shooting;
mod sqp;

use super::candidates::agree;
use super::simulated::Base;
use super::solve::Built;
use super::{Ocp, OcpResult};
use crate::error::{Error, Result};
use crate::fesd::Sizes;
use crate::random::SplitMix64;
use crate::stop;
pub(super) use blocks::Gradients;
pub(super) use chain::{Chain, Motion};
pub(super) use order::ModeOrder;
pub(super) use shooting::{Given, Preceding, RowOf, Shooting, SAME_POINT};
pub(super) use sqp::{look_around, minimise, restore, GiveUp, Lowest, Program, Values};

/// Simulations of the horizon of a descent at most.
const EVALUATIONS: usize = 80;
/// Variables of a descent at most: its quadratic programs and the derivatives of its constraints are dense.
pub(super) const VARIABLES: usize = 400;
/// Violation of a constraint, relative to what the variables change it by, with which a descent may end.
const MET: f64 = 1e-4;
/// The same for the start of a mode program, which meets its constraints by itself.
const NEARLY: f64 = 0.1;
/// Gain, relative to the cost, that counts as none.
const NONE: f64 = 1e-6;

impl Lowest {
    /// Does it gain nothing from an answer with this cost, which a simulation confirms?
    pub(super) fn stays_at(&self, cost: f64) -> bool {
        self.gain <= NONE && agree(self.before, cost)
    }
}

/// The end of a descent that nearly meets the constraints.
pub(super) struct Shot {
    /// Controls, lengths, parameters and initial states there.
    pub moved: Box<OcpResult>,
    /// The cost.
    pub cost: f64,
}

impl Ocp {
    /// The end of a descent from an answer, and the answer with what it ends at; `None` where nothing is simulated, there is nothing to vary, or the
    /// constraints are not met. Where the descent does not say whether a direction leads down, its end is looked around.
    pub(super) fn lowest_from(
        &self,
        b: &Built,
        r: &OcpResult,
        known: &Sizes,
    ) -> Result<Option<(Lowest, Box<OcpResult>)>> {
        let mut shooting = Shooting::beside(self, b, r, known)?;
        let start = shooting.place(b, (&r.controls, &r.control_ends));
        looked_at(&mut shooting, start, r, false)
    }

    /// The same of an answer that belongs to no discretised program; its end is looked around always, and has the multipliers of that.
    pub(super) fn lowest_of_simulated(&self, base: &Base, r: &OcpResult) -> Result<Option<(Lowest, Box<OcpResult>)>> {
        let mut shooting = base.judging(self)?;
        let start = shooting.place_fresh((&r.controls, &r.control_ends));
        looked_at(&mut shooting, start, r, true)
    }

    /// The first of these controls and their ends with which a simulation costs less than with those of the answer, and meets the constraints as
    /// well: the controls and that cost.
    pub(super) fn first_lower(
        &self,
        b: &Built,
        r: &OcpResult,
        controls: Vec<[Vec<f64>; 2]>,
    ) -> Result<Option<(Vec<f64>, f64)>> {
        let mut shooting = Shooting::beside(self, b, r, &self.known_or_own_sizes()?)?;
        let Some(own) = shooting.simulated(b, (&r.controls, &r.control_ends))? else { return Ok(None) };
        for [u, ends] in controls {
            if stop::requested().is_some() {
                break;
            }
            let Some(other) = shooting.simulated(b, (&u, &ends))? else { continue };
            let (lower, upper) = shooting.row_bounds();
            let off = |v: &Values, i: usize| violation(v, [lower, upper], i);
            let meets = |i: usize| off(&other, i) <= off(&own, i) + MET * other.usual[i];
            if other.cost < own.cost - NONE * own.cost.abs() && (0..other.rows.len()).all(meets) {
                return Ok(Some((u, other.cost)));
            }
        }
        Ok(None)
    }

    /// Where descents from each of these controls end: those that nearly meet the constraints. Lengths, parameters and initial states that are
    /// free are those of `from` at first in every second one, and drawn within their bounds in the others. No more of them begin once there
    /// have been `most` simulations of the horizon.
    pub(super) fn shots(
        &self,
        b: &Built,
        from: &OcpResult,
        controls: Vec<Vec<f64>>,
        known: &Sizes,
        most: usize,
    ) -> Result<Vec<Shot>> {
        let mut shooting = Shooting::beside(self, b, from, known)?;
        let (mut spent, mut out) = (0, Vec::new());
        let mut numbers = SplitMix64::new(0);
        for (k, u) in controls.iter().enumerate() {
            if stop::requested().is_some() || spent >= most {
                break;
            }
            let mut z = shooting.place(b, (u, u));
            if k % 2 == 0 {
                shooting.draw(&mut z, &mut numbers);
            }
            let Some(found) = lowest(&mut shooting, z, false)? else { continue };
            spent += found.evaluations;
            out.extend(shot(&shooting, &found, from));
        }
        Ok(out)
    }
}

/// Is there something to vary, and not too much?
fn can_vary(shooting: &Shooting) -> bool {
    (1..=VARIABLES).contains(&shooting.n())
}

/// By how much row `i` violates its bounds.
pub(super) fn violation(values: &Values, [lower, upper]: [&[f64]; 2], i: usize) -> f64 {
    (lower[i] - values.rows[i]).max(values.rows[i] - upper[i]).max(0.0)
}

/// The same in units of what states and controls of their sizes change the row by.
pub(super) fn missed(values: &Values, bounds: [&[f64]; 2], i: usize) -> f64 {
    violation(values, bounds, i) / values.usual[i].max(f64::MIN_POSITIVE)
}

/// The end of a descent from `z`, or from the nearest point that meets the constraints where that is asked for; `None` where nothing is
/// simulated, there is nothing to vary, or too much.
fn lowest(shooting: &mut Shooting, mut z: Vec<f64>, restore: bool) -> Result<Option<Lowest>> {
    if !can_vary(shooting) {
        return Ok(None);
    }
    let found = match if restore { sqp::restore(shooting, &z) } else { Ok(None) } {
        Ok(restored) => {
            z = restored.unwrap_or(z);
            sqp::minimise(shooting, &z, EVALUATIONS, &mut |_| false)
        }
        Err(e) => Err(e),
    };
    match found {
        Err(e @ (Error::Interrupted | Error::OutOfTime | Error::Internal(_))) => Err(e),
        // a simulation that fails says nothing of the answer
        Err(_) | Ok(None) => Ok(None),
        Ok(found) => Ok(found),
    }
}

/// An answer with the variables of another point.
fn told(shooting: &Shooting, found: &Lowest, r: &OcpResult) -> Box<OcpResult> {
    let mut moved = Box::new(r.clone());
    shooting.tell(&found.z, &mut moved);
    moved
}

/// The end of a descent that meets the constraints, looked around where it is not stationary or `always`, and the answer `r` with what it ends at.
fn looked_at(
    shooting: &mut Shooting,
    start: Vec<f64>,
    r: &OcpResult,
    always: bool,
) -> Result<Option<(Lowest, Box<OcpResult>)>> {
    let Some(mut found) = lowest(shooting, start, true)?.filter(|found| found.violation <= MET) else {
        return Ok(None);
    };
    if always || !found.stationary {
        let cost = found.cost;
        look_around(shooting, &mut found)?;
        found.gain += (cost - found.cost) / found.unit;
    }
    let moved = told(shooting, &found, r);
    Ok(Some((found, moved)))
}

/// The end of a descent as an answer, where it nearly meets the constraints.
fn shot(shooting: &Shooting, found: &Lowest, from: &OcpResult) -> Option<Shot> {
    (found.violation <= NEARLY).then(|| Shot { moved: told(shooting, found, from), cost: found.cost })
}
