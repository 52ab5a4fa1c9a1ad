//! Answers of projected systems that descents on simulations better. The multipliers of their constraints are no subsystem with indicators that
//! costates could be followed through, see [`descent`](super::descent). Where a descent gains, the mode program of the contacts that its end makes and
//! breaks is solved from there.

use std::time::{Duration, Instant};

use super::accuracy::{self, with_cost};
use super::adapt::Adaptation;
use super::candidates::Candidates;
use super::extend::Extended;
use super::moves::Sequence;
use super::optimality::Verdict;
use super::portfolio::GAIN;
use super::request::Request;
use super::sequence::{Room, Traced, LOWEST, SAMPLES, TOLERANCE};
use super::solve::{Built, Start};
use super::{Ocp, OcpResult};
use crate::error::{Error, Result};
use crate::event::{self, Engine};
use crate::nlp::{allowance, Control};
use crate::settings::OcpStart;
use crate::stop;
use crate::system::System;

/// Multiple of the elements where an answer is too inaccurate for its simulation.
const FINER: usize = 2;
/// Random controls at most from which descents begin where an answer makes no contact.
const DRAWN: usize = 80;
/// How often a descent is followed at most. Each gains what counts as a change to first order.
const FOLLOWED: usize = 10;

impl Ocp {
    /// The system that answers are simulated with for derivatives: the cost, then linear controls, then the states.
    pub(super) fn system_with_cost(&self, e: &Extended) -> Result<System> {
        let system = self.projected.as_ref().unwrap_or(&e.system);
        with_cost(system, e.system.dims(), e.lagrange.as_ref(), &self.linear)
    }

    /// As long as a descent on simulations leads from the last answer of a projected system to less, the mode program of the contacts at its end is
    /// solved from there; its answer takes the place of the one before where it is cheaper. The derivatives of an answer that makes no contact say
    /// nothing of what contacts do: descents from other controls come first then.
    pub(super) fn follow_contacts(&mut self, start: Start, request: &Request, control: &mut Control) -> Result<()> {
        let searches = start != Start::Warm && request.start != OcpStart::Homotopy && request.comparison.is_some();
        if self.projected.is_none() || !searches {
            return Ok(());
        }
        let story = self.result.as_ref().and_then(|r| r.adaptation.clone());
        let mut follow = || -> Result<()> {
            self.look_for_contacts(request, control)?;
            for _ in 0..FOLLOWED {
                if !self.follow_contacts_once(request, control)? {
                    break;
                }
            }
            Ok(())
        };
        match follow() {
            // the answer stays one where there is no time for others
            Err(Error::Interrupted | Error::OutOfTime) => {}
            r => r?,
        }
        // another answer is on a grid of its own, on which no round was made
        if let Some(r) = self.result.as_mut().filter(|r| r.adaptation.is_none()) {
            let reached = r.is_exact() && r.error() <= self.settings.adapt_tol;
            r.adaptation = story.map(|s| Adaptation { reached, ..s });
        }
        Ok(())
    }

    /// The last answer, where it is exact and there is time left.
    fn exact_in_time(&self) -> Option<(&OcpResult, &Built)> {
        let over = stop::requested().is_some() || allowance::is_over();
        let r = self.result.as_ref().filter(|r| r.is_exact() && !over)?;
        Some((r, self.built.as_deref()?))
    }

    /// Descends from other controls where the answer makes no contact.
    fn look_for_contacts(&mut self, request: &Request, control: &mut Control) -> Result<()> {
        let clock = Instant::now();
        let Some((r, b)) = self.exact_in_time() else { return Ok(()) };
        if r.trajectory.elements.iter().any(|e| e.active_cells.contains(&true)) {
            return Ok(());
        }
        let known = self.known_or_own_sizes()?;
        // as many simulations as the answer took iterations
        let most = (self.settings.search_effort * r.stats.iterations as f64) as usize;
        let shots = self.shots(b, r, self.coarse_starts(DRAWN, 0), &known, most)?;
        let best = shots.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
        if let Some(best) = best.filter(|s| s.cost < r.priced - GAIN * r.priced.abs()) {
            self.solve_contacts(&best.moved, clock, request, control)?;
        }
        Ok(())
    }

    /// Is there a cheaper answer where the descent from the last one ends?
    fn follow_contacts_once(&mut self, request: &Request, control: &mut Control) -> Result<bool> {
        let clock = Instant::now();
        let Some((r, b)) = self.exact_in_time() else { return Ok(false) };
        if r.optimality.as_ref().is_none_or(|o| o.verdict != Verdict::NotOptimal) {
            return Ok(false);
        }
        let known = self.known_or_own_sizes()?;
        let found = self.lowest_from(b, r, &known)?;
        let Some((_, moved)) = found else { return Ok(false) };
        self.solve_contacts(&moved, clock, request, control)
    }

    /// Solves the mode program of the contacts that the controls of `moved` make and break. Is its answer cheaper than the last one, which it
    /// replaces then?
    fn solve_contacts(
        &mut self,
        moved: &OcpResult,
        clock: Instant,
        request: &Request,
        control: &mut Control,
    ) -> Result<bool> {
        let (Some(r), Some(traced)) = (self.result.as_ref(), self.trace_contacts(moved)?) else { return Ok(false) };
        let known = self.known_or_own_sizes()?;
        let mut found = Candidates { known: known.clone(), ..Candidates::default() };
        found.add(r);
        // what the last answer took counts
        let spent = Duration::try_from_secs_f64(r.stats.time_total + r.time_build).unwrap_or_default();
        let clock = clock.checked_sub(spent).unwrap_or(clock);
        let now = r.priced;
        let inside = request.of_a_part();
        for elements in [1, FINER] {
            let room = Room { elements, ..LOWEST };
            let one = self.solve_traced(moved, (&traced, room), &known, &inside, control)?;
            let Some(next) = one.result.as_ref() else { continue };
            found.add(next);
            if next.is_exact() && next.priced < now - GAIN * now.abs() {
                found.best = Some(one);
                self.adopt(&mut found, request, control)?;
                self.spent_in_all(&found, clock)?;
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// States and contacts that a simulation of the controls of `r` makes and breaks, from the initial state. `None` where it does not reach the
    /// end, and where controls are linear.
    fn trace_contacts(&self, r: &OcpResult) -> Result<Option<Traced>> {
        let Some(projected) = self.projected.as_ref().filter(|_| !self.linear.contains(&true)) else { return Ok(None) };
        let constraints = projected.mechanics().and_then(|m| m.projection.as_ref()).map(|p| p.constraints.n_out());
        let d = projected.dims();
        let sizes = self.known_or_own_sizes()?.x;
        let tight = accuracy::tolerances(TOLERANCE, &sizes);
        let mut engine = Engine::stopping_for_all(projected, &event::Options { dense: true, ..tight })?;
        let Some(first) = r.trajectory.elements.first() else { return Ok(None) };
        engine.reinit(self.t0, &first.x0)?;
        let params = match &self.stage_params {
            Some(p) => p.clone(),
            None => self.params_from(r).repeat(self.n_stages),
        };
        let mut found = Traced { times: vec![0.0], states: first.x0.clone(), phases: Sequence::default() };
        let (mut t, mut inside) = (self.t0, vec![0.0; d.x]);
        for (k, length) in r.durations.iter().enumerate() {
            engine.set_params(&params[k * d.p..(k + 1) * d.p])?;
            engine.set_controls(&r.controls[k * d.u..(k + 1) * d.u])?;
            if engine.advance(t + length)? != event::Outcome::Reached {
                return Ok(None);
            }
            for j in 1..=SAMPLES {
                let at = t + length * j as f64 / SAMPLES as f64;
                match engine.path() {
                    Some(path) if j < SAMPLES => path.eval(at, 0, &mut inside)?,
                    _ => inside.copy_from_slice(engine.state()),
                }
                if at - self.t0 > found.times[found.times.len() - 1] {
                    found.times.push(at - self.t0);
                    found.states.extend_from_slice(&inside);
                }
            }
            let phases = engine.phases();
            let ends = phases.iter().skip(1).map(|p| p.t).chain([f64::INFINITY]);
            let part = |(p, end): (&event::Phase, f64)| {
                let lasting = end.min(t + length) - p.t.max(t);
                (lasting > 0.0).then(|| (p.modes.iter().map(|m| *m != 0).collect::<Vec<bool>>(), lasting))
            };
            let stage: Vec<(Vec<bool>, f64)> = phases.iter().zip(ends).filter_map(part).collect();
            // a constraint whose gap never changes has no multiplier
            if stage.is_empty() || stage.iter().any(|(set, _)| Some(set.len()) != constraints) {
                return Ok(None);
            }
            found.phases.stages.push(stage);
            t += length;
        }
        Ok(Some(found))
    }
}
