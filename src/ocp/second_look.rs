//! Multistart: descents on simulations from random controls, lengths, parameters and initial states, as far as these are free. It finds cheaper
//! solutions than smoothed problems and neighbouring sequences lead to. A descent takes as long as a few iterations of a discretised problem, and a
//! mode program of its phases begins where it ends.

use super::candidates::Candidates;
use super::portfolio::{worth, SAME};
use super::request::Request;
use super::sequence::LOWEST;
use super::{Ocp, OcpResult};
use crate::error::Result;
use crate::nlp::Control;
use crate::stop;

/// Simulations of all descents together, over the iterations of the search before them: a simulation of the horizon with its
/// derivatives takes a fraction of the time of an iteration. Four times as many, and as much at least, made 2 of 114 problems cheaper and took 1.6 times
/// the CPU time (docs/dev/log/search.md).
const SHARE: f64 = 0.25;
/// Simulations at least, where evaluations are cheap: how many descents it takes to come upon another way does not depend on how soon the first one
/// was found. Together with the variables of the problem, for which a simulation stands, no more work than this.
const LEAST: usize = 250;
const WORK: usize = 1_000_000;
/// Random controls at most.
pub(super) const DRAWN: usize = 80;
/// Mode programs at most, of the descents that end lowest.
const PROGRAMS: usize = 3;

impl Ocp {
    /// Simulations that descents from other controls than those of an answer may take, behind so many iterations: the effort of the search times as many
    /// as there were iterations, or the least.
    pub(super) fn simulations(&self, from: &OcpResult, iterations: usize) -> usize {
        let least = if self.statement().is_cheap() { LEAST.min(WORK / from.dimensions.0.max(1)) } else { 0 };
        (self.settings.search_effort * (SHARE * iterations as f64).max(least as f64)) as usize
    }

    /// Looks for a cheaper answer than the best one. Is there one?
    pub(super) fn look_again(&self, found: &mut Candidates, request: &Request, control: &mut Control) -> Result<bool> {
        let Some(best) = found.best.as_mut() else { return Ok(false) };
        let (Some(b), Some(from)) = (best.built.as_ref(), best.result.clone()) else { return Ok(false) };
        let most = self.simulations(&from, found.spent.iterations);
        // the first of them is the guess, from which a descent begins where it is one of the user
        // the first of them is the guess
        let drawn = self.random_starts(1 + DRAWN, 0).split_off(1);
        let mut ends = self.shots(b, &from, drawn, &found.known, most)?;
        ends.retain(|e| e.cost < from.priced - SAME * from.priced.abs());
        ends.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        ends.dedup_by(|b, a| b.cost - a.cost <= SAME * a.cost.abs());
        if ends.is_empty() {
            return Ok(false);
        }
        let known = found.known.clone();
        let inside = request.of_a_part();
        let mut now = (from.priced, worth(best, request)?);
        let mut cheaper = false;
        for end in ends.into_iter().take(PROGRAMS).filter(|_| stop::requested().is_none()) {
            let Some(traced) = self.trace_through(&end.moved, &inside.options)? else { continue };
            let one = self.solve_traced(&end.moved, (&traced, LOWEST), &known, &inside, control)?;
            let Some(next) = one.result.as_ref() else { continue };
            found.add(next);
            if next.is_exact() && self.take_better(found, one, now, &inside, control)? {
                let Some(best) = found.best.as_mut() else { break };
                now = (best.priced(), worth(best, request)?);
                cheaper = true;
            }
        }
        Ok(cheaper)
    }
}
