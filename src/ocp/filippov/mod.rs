//! Optimal control where modes follow from the state: the search for the best sequence of active sets.

mod space;

use std::rc::Rc;
use std::time::Instant;

use self::space::{Ended, Filippov, Sequence};
use super::candidates::Candidates;
use super::portfolio::SEARCH;
use super::programs::plan;
use super::receding::SURPRISE;
use super::request::Request;
use super::solve::Start;
use super::{Ocp, OcpResult};
use crate::dcs::Dcs;
use crate::error::{Error, Result};
use crate::nlp::{allowance, Control, Outcome};
use crate::search::{explore, Budget, Source};
use crate::settings::OcpStart;
use crate::stop;

/// Costs that differ by less, relative, are the same.
pub(super) const SAME: f64 = 1e-4;

/// What a search has found so far.
type Known = Vec<(Ended, Sequence)>;

/// What is spent, and the seconds to build problems.
struct Spent {
    budget: Budget,
    time_build: f64,
}

impl Ocp {
    /// Searches for the best solution. An answer of before, which is what is expected, is bettered and that is all, unless what it leads to costs more
    /// than was expected: something happened to the plant, and other plans may be better now.
    pub(super) fn search_filippov(
        &mut self,
        last: Option<Box<OcpResult>>,
        request: &Request,
        control: &mut Control,
    ) -> Result<&OcpResult> {
        let clock = Instant::now();
        let mut spent = Spent { budget: Budget::new(f64::INFINITY), time_build: 0.0 };
        let mut out = Candidates::default();
        // what is left behind the search is for the comparison and the verdict
        let mut all = control.sooner(SEARCH, |control| {
            out.known = match (&self.measured, &last) {
                (Some(s), Some(_)) => s.clone(),
                _ => self.sizes()?,
            };
            let known = match last {
                Some(last) => {
                    let (known, expected) = self.go_on_from(last, &out, request, &mut spent, control)?;
                    if expected {
                        return Ok(known);
                    }
                    // the plan has had its chance
                    (self.x_guess, self.u_guess) = (None, None);
                    known
                }
                None => Vec::new(),
            };
            let mut space = Filippov::new(self, None, out.known.clone(), request, control)?;
            let all = [Source::Guess, Source::Smoothing, Source::Samples, Source::Relaxation];
            let sources = if request.start == OcpStart::Smoothing { &all[1..2] } else { &all[..] };
            let plan = plan(&self.settings, sources, self.settings.search_effort, request.search, false);
            let mut all = match explore(&mut space, &plan, known, &mut spent.budget, control) {
                // nothing was found before
                Err(Error::Interrupted | Error::OutOfTime) => Vec::new(),
                found => found?.all,
            };
            space.settle(&mut all, &mut spent.budget, control)?;
            spent.time_build += space.time_build;
            out.cut = stop::requested();
            Ok::<Known, Error>(all)
        })?;
        (out.spent, out.time_build) = (spent.budget.stats, spent.time_build);
        if let Some(closest) = all.iter().find(|f| f.0.result.outcome == Outcome::MaxIter && allowance::is_over()) {
            // out of iterations: what violates constraints least, or what is cheapest and no solution yet
            if !all[0].0.rank.feasible {
                self.result = Some(OcpResult::clone(&closest.0.result));
                return self.spent_in_all(&out, clock);
            }
        }
        // where nothing has a solution the homotopy says why
        let homotopy = all.iter().position(|f| f.0.homotopy);
        let solved = all.first().is_some_and(|f| f.0.rank.feasible);
        let Some(at) = (if solved { Some(0) } else { homotopy }) else {
            // the search was cut before
            let request = Request { start: OcpStart::Homotopy, ..*request };
            let r = self.run(Start::Cold, &request, control)?;
            out.add(r);
            return self.spent_in_all(&out, clock);
        };
        let best = all.swap_remove(at).0;
        out.still = best.still.filter(|_| best.rank.feasible);
        let Ok(one) = Rc::try_unwrap(best.one) else {
            return Err(Error::Internal("a solution is in use".into()));
        };
        out.best = Some(one.into_inner());
        self.adopt(out, request, control, clock)
    }

    /// What an answer of before leads to, and whether that costs as much as was expected.
    fn go_on_from(
        &self,
        mut last: Box<OcpResult>,
        out: &Candidates,
        request: &Request,
        spent: &mut Spent,
        control: &mut Control,
    ) -> Result<(Known, bool)> {
        self.restate_start(&mut last);
        let noise = SURPRISE * self.largest;
        let expected = last.priced + noise;
        let mut space = Filippov::new(self, Some(last), out.known.clone(), request, control)?;
        let mut step = |source: Source, least: usize, known: Known, control: &mut Control| -> Result<Known> {
            let plan = plan(&self.settings, &[source], 0.0, least, false);
            Ok(explore(&mut space, &plan, known, &mut spent.budget, control)?.all)
        };
        let cost = |known: &Known| known.first().filter(|k| k.0.rank.feasible).map_or(f64::INFINITY, |k| k.0.rank.cost);
        let mut known = step(Source::Guess, 0, Vec::new(), control)?;
        let simplices = Dcs::stewart(&self.system)?.form().simplices.clone();
        let slides = known.first().is_some_and(|k| k.0.begins_sliding(&simplices));
        if cost(&known) > expected || slides && cost(&known).abs() > noise {
            // what sticks sees no control that would set it free: a smoothed problem does
            known = step(Source::Smoothing, 1, known, control)?;
        }
        spent.time_build += space.time_build;
        let as_expected = cost(&known) <= expected;
        Ok((known, as_expected))
    }
}
