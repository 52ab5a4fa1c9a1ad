//! Answers of descents on simulations beside those of programs: which of the two is the answer of the problem.

use std::time::Instant;

use super::{Last, Task};
use crate::error::{Error, Result};
use crate::nlp::{allowance, Control, Outcome, Statistics};
use crate::ocp::descent::VARIABLES;
use crate::ocp::request::Request;
use crate::ocp::{Ocp, OcpResult};
use crate::stop;

/// Costs that differ by less, relative, are the same, and so are costs that differ by less of their usual size than the tolerance of simulations.
const SAME: f64 = 1e-4;
const TOLD: f64 = 1e-8;

/// The answer that descents lead to, and what its derivatives are made of.
pub(in crate::ocp) struct Landed {
    pub result: OcpResult,
    last: Option<Box<Last>>,
}

impl Ocp {
    /// Where descents on simulations lead, from the last answer first; from nowhere else without an effort, which is a multiple of the usual one.
    pub(in crate::ocp) fn land(
        &mut self,
        last: Option<&OcpResult>,
        effort: f64,
        request: &Request,
        control: &mut Control,
    ) -> Result<Landed> {
        let clock = Instant::now();
        let base = self.base(last)?;
        let settings = self.settings;
        let mut task = Task { ocps: vec![self], links: &[], settings: &settings, effort };
        let mut found = task.solve(vec![base], last.map(std::slice::from_ref), request, control)?;
        let mut result = found.results.pop().ok_or_else(|| Error::Internal("a search without an answer".into()))?;
        result.stats.time_total = clock.elapsed().as_secs_f64();
        let (mut bases, mut cuts) = found.parts;
        let last = bases.pop().zip(cuts.pop());
        let last = last.map(|(base, cuts)| Box::new(Last { base, cuts, lowest: found.lowest }));
        Ok(Landed { result, last })
    }

    /// Where descents lead before programs are solved, or from the answer of one; `None` where they meet no constraints, lead to a motion that does not go
    /// on from its own states, or have no time. What they took is added.
    pub(in crate::ocp) fn landed(
        &mut self,
        from: Option<&OcpResult>,
        request: &Request,
        spent: &mut Statistics,
        control: &mut Control,
    ) -> Result<Option<Landed>> {
        // quadratic programs and derivatives of descents are dense
        let variables = self.n_stages * self.system.dims().u;
        if allowance::is_over() || variables > VARIABLES {
            return Ok(None);
        }
        match self.land(from, if from.is_some() { 0.0 } else { 1.0 }, request, control) {
            Ok(mut landed) => {
                spent.add(&landed.result.stats);
                if landed.result.ended == Some(Outcome::Stopped) {
                    // all else ends too
                    stop::raise();
                }
                let elsewhere = landed.result.accuracy.as_ref().is_some_and(|a| a.parts_ways || !a.follows());
                if elsewhere || !landed.result.is_exact() {
                    return Ok(None);
                }
                self.name_choice(&mut landed.result)?;
                Ok(Some(landed))
            }
            Err(Error::Interrupted) => {
                stop::raise();
                Ok(None)
            }
            // beyond the bounds that contacts were left out for nothing is known
            Err(Error::OutOfTime | Error::Numeric(_) | Error::Unsupported(_) | Error::State(_)) => Ok(None),
            Err(e) => Err(e),
        }
    }

    /// The answer of descents in the place of `own`, that of a program, where it is cheaper by more than programs are more exact. From a program's answer
    /// that is not known to be an optimum descents go on first.
    pub(in crate::ocp) fn lower_than(
        &mut self,
        own: &OcpResult,
        mut landed: Option<Landed>,
        request: &Request,
        spent: &mut Statistics,
        control: &mut Control,
    ) -> Result<Option<Landed>> {
        let cost = |l: &Option<Landed>| l.as_ref().map_or(f64::INFINITY, |l| l.result.priced);
        if !own.is_optimum() && stop::requested().is_none() {
            let next = self.landed(Some(own), request, spent, control)?;
            landed = next.filter(|n| n.result.priced <= cost(&landed)).or(landed);
        }
        let alike = (SAME * own.priced.abs()).max(TOLD * self.cost_size(own.priced));
        // derivatives on one side of what the answer is held at may lead down where no motion does
        let least = match landed.as_ref().filter(|_| own.is_not_optimal()) {
            Some(l) if l.result.is_optimum() => -alike,
            Some(_) => 0.0,
            None => alike,
        };
        let lower = cost(&landed) < own.priced - least;
        Ok(landed.filter(|_| lower))
    }

    /// Makes it the answer of the problem.
    pub(in crate::ocp) fn adopt_landed(&mut self, landed: Landed) {
        self.result = Some(landed.result);
        (self.simulated.last, self.simulated.leads) = (landed.last, true);
    }
}
