//! A second look for cheaper answers, from where neither smoothed problems nor sequences next to that of the answer lead: descents on
//! simulations from random controls. One takes as long as a few iterations of a discretised problem, and where it ends a mode
//! program of its phases begins.

use super::candidates::Candidates;
use super::descent::Shot;
use super::portfolio::{lower, worth};
use super::request::Request;
use super::sequence::NEAR;
use super::{Ocp, OcpResult};
use crate::error::Result;
use crate::nlp::Control;
use crate::stop;

/// Simulations of all descents together, over the iterations of the search before them: a simulation of the horizon with its
/// derivatives takes a fraction of the time of an iteration.
const SHARE: f64 = 1.0;
/// Random controls at most.
const DRAWN: usize = 80;
/// Mode programs at most, of the descents that end lowest.
const PROGRAMS: usize = 3;
/// Costs of descents, relative, that differ by less are those of the same motion.
const SAME: f64 = 1e-4;

impl Ocp {
    /// Looks for a cheaper answer than the best one. Is there one?
    pub(super) fn look_again(&self, found: &mut Candidates, request: &Request, control: &mut Control) -> Result<bool> {
        let Some(from) = found.best.as_ref().and_then(|b| b.result.clone()) else { return Ok(false) };
        let known = found.known.clone();
        let inside = Request { comparison: None, explain: false, ..*request };
        let with = |controls: Vec<f64>| {
            let control_ends = controls.clone();
            OcpResult { controls, control_ends, ..from.clone() }
        };
        let mut ends = self.shots(found, &with)?;
        ends.retain(|e| e.cost < from.cost - SAME * from.cost.abs());
        ends.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        ends.dedup_by(|b, a| b.cost - a.cost <= SAME * a.cost.abs());
        let mut cheaper = false;
        for end in ends.into_iter().take(PROGRAMS).filter(|_| stop::requested().is_none()) {
            let Some(traced) = self.trace_through(&end.moved, &inside.options)? else { continue };
            let mut one = self.solve_traced(&end.moved, (&traced, NEAR), &known, &inside, control)?;
            let Some(r) = one.result.as_ref() else { continue };
            found.add(r);
            let exact = r.is_exact();
            let Some(best) = found.best.as_mut().filter(|_| exact) else { continue };
            let now = (best.result.as_ref().map_or(f64::INFINITY, |r| r.cost), worth(best, request)?);
            if lower(&mut one, now, request)? {
                found.replace(one, &inside)?;
                cheaper = true;
            }
        }
        Ok(cheaper)
    }

    /// Where descents from random controls end that nearly meet the constraints, as many as the search so far is worth.
    fn shots(&self, found: &Candidates, with: &dyn Fn(Vec<f64>) -> OcpResult) -> Result<Vec<Shot>> {
        let Some(b) = found.best.as_ref().and_then(|best| best.built.as_ref()) else { return Ok(Vec::new()) };
        let mut left = (SHARE * found.spent.iterations as f64) as usize;
        let mut ends = Vec::new();
        // the first of them are the guess
        for controls in self.random_starts(1 + DRAWN, 0).into_iter().skip(1) {
            if stop::requested().is_some() || left == 0 {
                break;
            }
            let Some((spent, shot)) = self.shoot(b, &with(controls), &found.known)? else { continue };
            left = left.saturating_sub(spent);
            ends.extend(shot);
        }
        Ok(ends)
    }
}
