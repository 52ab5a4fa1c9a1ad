//! Optimal control where modes follow from the state: descents on simulations, and the best sequence of active sets next to where they lead.

mod space;

use std::rc::Rc;
use std::time::Instant;

use self::space::{Ended, Filippov, Sequence};
use super::candidates::Candidates;
use super::portfolio::SEARCH;
use super::programs::plan;
use super::receding::SURPRISE;
use super::request::Request;
use super::sequence::{LOWEST, NEAR};
use super::simulated::Landed;
use super::solve::Start;
use super::{Ocp, OcpResult};
use crate::dcs::Dcs;
use crate::error::{Error, Result};
use crate::nlp::{allowance, Control, Outcome};
use crate::search::{explore, Budget, Source};
use crate::settings::OcpStart;
use crate::stop::{self, Why};

/// Ladders of smoothed problems next to an optimum that descents have found; where they have found none all are asked for. The comparison that chose it is
/// in `docs/dev/log/search.md`.
const LADDERS: usize = 2;

/// What a search has found so far.
type Known = Vec<(Ended, Sequence)>;

/// What is spent, and the seconds to build problems.
struct Spent {
    budget: Budget,
    time_build: f64,
}

impl Ocp {
    /// Searches for the best solution: descents on simulations say which modes there are, programs along these are exact and say what is next to them, and
    /// descents go on from what is cheaper there. An answer of before, which is what is expected, is bettered and that is all, unless what it leads to
    /// costs more than was expected: something happened to the plant, and other plans may be better now.
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
        let (mut all, landed) = control.sooner(SEARCH, |control| {
            out.known = match (&self.measured, &last) {
                (Some(s), Some(_)) => s.clone(),
                _ => self.sizes()?,
            };
            let mut known = Vec::new();
            if let Some(last) = last {
                let (found, expected) = self.go_on_from(last, &out, request, &mut spent, control)?;
                if expected {
                    return Ok((found, None));
                }
                known = found;
                // the plan has had its chance
                (self.x_guess, self.u_guess) = (None, None);
            }
            let landed = match request.start {
                OcpStart::Smoothing => None,
                _ => self.landed(None, request, &mut spent.budget.stats, control)?,
            };
            if landed.as_ref().is_some_and(|l| l.result.ended.is_some()) {
                // it was cut
                return Ok((known, landed));
            }
            let incumbent = landed.as_ref().map_or(f64::INFINITY, |l| l.result.priced);
            let all = control.with_incumbent(incumbent, |control| {
                self.programs(landed.as_ref(), known, &out, request, &mut spent, control)
            })?;
            out.cut = stop::requested();
            Ok::<(Known, Option<Landed>), Error>((all, landed))
        })?;
        if out.cut == Some(Why::Interrupted) {
            stop::raise();
        }
        (out.spent, out.time_build) = (spent.budget.stats, spent.time_build);
        let best = all.first().filter(|f| f.0.rank.feasible).map(|f| f.0.rank);
        if best.is_none_or(|b| b.contradicted) {
            if let Some(mut landed) = landed {
                // no program follows it
                out.cut.into_iter().for_each(|why| landed.result.tell_cut(why));
                self.adopt_landed(landed);
                return self.spent_in_all(&out, clock);
            }
        }
        let cut_off = |f: &&(Ended, Sequence)| f.0.result.outcome == Outcome::MaxIter;
        if let Some(closest) = all.iter().find(cut_off).filter(|_| best.is_none() && allowance::is_over()) {
            // out of iterations: what violates constraints least, or what is cheapest and no solution yet
            self.result = Some(OcpResult::clone(&closest.0.result));
            return self.spent_in_all(&out, clock);
        }
        // where nothing has a solution the homotopy says why
        let homotopy = all.iter().position(|f| f.0.homotopy);
        let Some(at) = (if best.is_some() { Some(0) } else { homotopy }) else {
            // the search was cut before
            let request = Request { start: OcpStart::Homotopy, ..*request };
            let r = self.run(Start::Cold, &request, control)?;
            out.add(r);
            return self.spent_in_all(&out, clock);
        };
        let best = all.swap_remove(at).0;
        let Ok(one) = Rc::try_unwrap(best.one) else {
            return Err(Error::Internal("a solution is in use".into()));
        };
        out.best = Some(one.into_inner());
        self.adopt(&mut out, request, control)?;
        let own = self.last_result()?.clone();
        if own.is_exact() {
            match self.lower_than(&own, landed, request, &mut out.spent, control)? {
                Some(lower) => self.adopt_landed(lower),
                None => self.judge_again_by_descent()?,
            }
            if let (Some(why), None, Some(r)) = (stop::requested(), out.cut, self.result.as_mut()) {
                r.tell_cut(why);
            }
        }
        self.spent_in_all(&out, clock)
    }

    /// What programs along modes end at: those that descents led to and those of smoothed problems, or where descents led nowhere also those of the homotopy
    /// and the guess.
    fn programs(
        &self,
        landed: Option<&Landed>,
        known: Known,
        out: &Candidates,
        request: &Request,
        spent: &mut Spent,
        control: &mut Control,
    ) -> Result<Known> {
        let from = landed.map(|l| (Box::new(l.result.clone()), LOWEST));
        let sources: &[Source] = match (&from, request.start) {
            (Some(_), _) => &[Source::Guess, Source::Smoothing],
            (None, OcpStart::Smoothing) => &[Source::Smoothing],
            (None, _) => &[Source::Guess, Source::Relaxation, Source::Smoothing],
        };
        let mut space = Filippov::new(self, from, out.known.clone(), request, control)?;
        if landed.is_some_and(|l| l.result.is_optimum()) {
            space.ladders = LADDERS;
        }
        let plan = plan(&self.settings, sources, self.settings.search_effort, request.search, false);
        let all = match explore(&mut space, &plan, known, &mut spent.budget, control) {
            // nothing was found before
            Err(Error::Interrupted | Error::OutOfTime) => Vec::new(),
            found => found?.all,
        };
        spent.time_build += space.time_build;
        Ok(all)
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
        let mut space = Filippov::new(self, Some((last, NEAR)), out.known.clone(), request, control)?;
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
