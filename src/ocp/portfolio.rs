//! Cold solves from several starts: smoothed problems lead to mode sequences, whose mode programs give exact answers; the
//! homotopy from the guess is a second opinion, asked for where several ways did not lead to one certified answer, or constraints
//! on the way bend. The cheapest exact answer is kept.

use std::time::Instant;

use super::candidates::{agree, cost_of, Candidates};
use super::moves::{Sequence, NOTHING};
use super::optimality::{Verdict, OTHER};
use super::request::Request;
use super::sequence::{Room, LOWEST, NEAR, ROUGH};
use super::smoothing::Smoothed;
use super::solve::Start;
use super::{Ocp, OcpResult};
use crate::dcs::{Dcs, Form};
use crate::error::{Error, Result};
use crate::fesd::Sizes;
use crate::mpcc::Polish;
use crate::nlp::{allowance, Control, Outcome, Statistics};
use crate::settings::OcpStart;
use crate::stop::{self, Why};

/// Costs that differ by less, relative, are the same.
pub(super) const SAME: f64 = 1e-4;
/// Difference, relative, up to which the cost of a mode program is what the smoothed problem promised.
const PROMISED: f64 = 0.03;

/// Iterations that the homotopy has at least where the other starts agree.
const OPINION: usize = 100;
/// Sequences next to that of an answer that are tried at most.
const NEIGHBOURS: usize = 24;
/// Changes of controls, in units of their sizes, by which the direction of a better answer is followed.
const STEPS: [f64; 3] = [0.01, 0.001, 0.1];
/// The same for the starts of descents, and how many of those there are at most.
const LONG: f64 = 0.1;
const SIDES: usize = 3;
/// Multiples of the elements where an answer is too inaccurate for its simulation.
pub(super) const FINER: [usize; 2] = [2, 4];
/// Simulations that are started from where nothing else leads to an answer.
const SIMULATED: usize = 5;
/// Coarse controls that are drawn where that does not help either, and how many of them are aimed at the constraints.
const DRAWN: usize = 100;
const AIMED: usize = 8;
/// How often it is followed at most.
const FOLLOWED: usize = 4;
/// Share of the time that is left that the homotopy may take before mode programs, and an exact search before others.
pub(super) const HALF: f64 = 0.5;
/// Work, iterations times variables, that neighbours may take at least; where more was done before, this share of that.
const EFFORT: f64 = 1_250_000.0;
const BESIDE: f64 = 0.25;
/// Share of the time that is left that a part of a search may take.
pub(super) const SEARCH: f64 = 0.9;
/// Share of the cost by which one must be lower to count as better.
pub(super) const GAIN: f64 = 1e-7;

/// What the answer of a problem costs when it is simulated, or what it says itself where that cannot be compared.
pub(super) fn worth(one: &mut Ocp, request: &Request) -> Result<f64> {
    let own = one.priced();
    Ok(one.simulated_cost(request)?.unwrap_or(own))
}

/// Which smoothed problems are solved.
pub(super) enum Ladders {
    /// All that a cold start has.
    All,
    /// One from the guess, which is a plan with these phases.
    FromPlan(Vec<Vec<Vec<bool>>>),
}

/// What smoothed problems led to.
#[derive(Default)]
struct Race {
    ladders: Vec<Smoothed>,
    /// Phases that are known already.
    tried: Vec<Vec<Vec<Vec<bool>>>>,
    /// Did they take so much that further ones are not worth it?
    large: bool,
}

impl Race {
    /// What the cheapest one costs, where several ladders led to it.
    fn agreed_cost(&self) -> Option<f64> {
        let first = self.ladders.first().filter(|l| l.count > 1)?;
        first.answers.last().map(|r| r.priced)
    }
}

/// Is an answer better than one that costs this much, by itself and when it is simulated? Simulations decide where both can be compared.
pub(super) fn lower(one: &mut Ocp, (cost, simulated): (f64, f64), request: &Request) -> Result<bool> {
    let own = one.priced();
    // those that are far from better by themselves are not simulated
    if own > cost + SAME * cost.abs() {
        return Ok(false);
    }
    let (now, before) = (worth(one, request)?, if simulated.is_finite() { simulated } else { cost });
    Ok(now < before - GAIN * before.abs())
}

/// A part of a search. It leaves time to compare what was found with a simulation, and to judge it; what was found before there was
/// no time left is an answer.
pub(super) fn part(
    found: &mut Candidates,
    control: &mut Control,
    body: impl FnOnce(&mut Candidates, &mut Control) -> Result<()>,
) -> Result<()> {
    part_of(SEARCH, found, control, body)
}

/// The same with a share of the time that is left. Where that alone is over, and no more, there is time for other parts.
fn part_of(
    share: f64,
    found: &mut Candidates,
    control: &mut Control,
    body: impl FnOnce(&mut Candidates, &mut Control) -> Result<()>,
) -> Result<()> {
    if allowance::is_over() && found.best.is_some() {
        return Ok(());
    }
    let ended = control.sooner(share, |control| {
        let ended = body(found, control);
        found.cut = found.cut.or(stop::requested());
        ended
    });
    match ended {
        Err(Error::Interrupted | Error::OutOfTime) if found.best.is_some() || stop::requested().is_none() => Ok(()),
        r => r,
    }
}

impl OcpResult {
    /// A solution of a search that was cut says so.
    pub(super) fn tell_cut(&mut self, why: Why) {
        if self.outcome != Outcome::Solved {
            return;
        }
        self.add_remark(&format!("{} before the search had ended: other answers may be cheaper", why.words()));
        self.ended = self.ended.or(Some(why.into()));
    }

    /// Are there elements without length?
    pub(super) fn has_idle(&self) -> bool {
        self.trajectory.elements.iter().any(|e| e.h <= NOTHING * self.durations[e.stage])
    }

    /// Does it solve the discretised problem, whatever else there is to say of it?
    pub(super) fn is_solution(&self) -> bool {
        self.outcome == Outcome::Solved || self.ended.is_some()
    }

    /// Is it a solution whose active set is exact, or of a problem without pairs? Its multipliers are those of the problem then.
    pub(super) fn has_exact_modes(&self) -> bool {
        self.is_solution() && (self.polish == Polish::Done || self.dimensions.2 == 0)
    }

    /// Is the active set exact, or nothing switches?
    pub(super) fn is_exact(&self) -> bool {
        self.is_solution() && self.polish != Polish::Rejected
    }
}

impl Ocp {
    /// Solves as the request says where to start from; from elsewhere than cold, and where modes are given, as
    /// [`Ocp::run`].
    pub(super) fn search(&mut self, start: Start, request: &Request, control: &mut Control) -> Result<&OcpResult> {
        let shifted = self.shifted.take();
        let last = shifted.as_ref().filter(|_| start == Start::Warm);
        if request.start == OcpStart::Race && (start == Start::Cold || last.is_some()) && self.may_smooth(request) {
            return self.search_filippov(last.cloned(), request, control);
        }
        if let Some(moved) = shifted.filter(|_| start == Start::Warm && self.may_smooth(request)) {
            return match self.solve_shifted(moved, request, control)? {
                None => self.last_result(),
                Some(found) => {
                    // the plan has had its chance
                    (self.x_guess, self.u_guess) = (None, None);
                    self.search_from_all(Start::Cold, found, request, control)
                }
            };
        }
        let smooths = start == Start::Cold && request.start != OcpStart::Homotopy && self.may_smooth(request);
        if !smooths {
            return self.run_from_several(start, request, control);
        }
        let found = Candidates { known: self.sizes()?, ..Candidates::default() };
        self.search_from_all(start, found, request, control)
    }

    /// A function of its own, whose frame solves from one start do not pay for.
    #[inline(never)]
    fn search_from_all(
        &mut self,
        start: Start,
        mut found: Candidates,
        request: &Request,
        control: &mut Control,
    ) -> Result<&OcpResult> {
        let clock = Instant::now();
        // what is left behind all parts together is for the comparison and the verdict
        control.sooner(SEARCH, |control| self.search_in_parts(start, &mut found, request, control))?;
        if found.best.is_some() {
            return self.adopt(found, request, control, clock);
        }
        let failed = self.last_result()?.clone();
        match allowance::is_over() {
            true => self.closest_of(found, failed, clock),
            false => self.spent_in_all(&found, clock),
        }
    }

    /// All parts of a search. Each has a share of the time that is left, so that with more time every one of them has more; without a best
    /// answer the last result is that of the homotopy, which failed.
    fn search_in_parts(
        &mut self,
        start: Start,
        found: &mut Candidates,
        request: &Request,
        control: &mut Control,
    ) -> Result<()> {
        let mut race = Race::default();
        part_of(HALF, found, control, |found, control| {
            // where iterations are counted the other starts have as many
            let most = allowance::left();
            let most = if most == usize::MAX { most } else { most / 2 };
            race = allowance::within(most, || self.race(found, Ladders::All, request, control))?;
            Ok(())
        })?;
        let given = self.x_guess.is_some() || self.u_guess.is_some();
        let only_smooth = request.start == OcpStart::Smoothing;
        let (mut asked, mut enough) = (false, false);
        if race.large && !given && !only_smooth {
            (asked, enough) = self.keeps_promise(found, &race, start, request, control)?;
        }
        let mut improved = None;
        if !enough {
            part(found, control, |found, control| self.solve_raced(found, race, request, control))?;
            enough = found.best.is_some() && only_smooth;
            if !enough && found.agreed && !given {
                part(found, control, |found, control| {
                    self.improve(found, request, control)?;
                    enough = found.is_certified()?;
                    Ok(())
                })?;
                improved = Some(found.cost());
            }
        }
        // around what bends there are several ways, and all smoothed problems may have taken the same
        let enough = enough && (only_smooth || !self.bends());
        let over = stop::requested().is_some() || allowance::is_over();
        if !enough && !asked && (found.best.is_none() || !over) {
            // a second opinion may take as long as the first
            let most = (found.agreed && !given).then_some(found.spent.iterations.max(OPINION));
            // without an answer what is behind it has as much time
            let share = if found.best.is_some() { SEARCH } else { HALF };
            match self.ask_homotopy(found, start, (most, share), request, control) {
                Ok(_) => (),
                // what the other starts found stays an answer where this one is asked to end
                Err(Error::OutOfTime) if found.best.is_some() => (),
                Err(e) => return Err(e),
            }
        }
        if found.best.is_none() && !allowance::is_over() {
            let failed = self.last_result()?.clone();
            part(found, control, |found, control| self.solve_from_simulations(found, &failed, request, control))?;
        }
        if found.best.is_none() {
            return Ok(());
        }
        part(found, control, |found, control| self.aim_missed(found, request, control))?;
        if improved.is_none_or(|cost| found.cost() < cost) {
            part(found, control, |found, control| self.improve(found, request, control))?;
        }
        if !only_smooth {
            part(found, control, |found, control| {
                if self.look_again(found, request, control)? {
                    self.improve(found, request, control)?;
                }
                Ok(())
            })?;
        }
        part(found, control, |found, control| self.settle(found, request, control))
    }

    /// The point with the least violation of all solves of a search that is out of iterations.
    fn closest_of(&mut self, mut found: Candidates, last: OcpResult, clock: Instant) -> Result<&OcpResult> {
        let closer = found.closest.take().filter(|c| c.residuals.primal < last.residuals.primal);
        self.result = Some(closer.map_or(last, |c| *c));
        self.spent_in_all(&found, clock)
    }

    /// The homotopy from the guess, within iterations and a share of the time that is left; its answer becomes the best one where it
    /// is cheaper. Is it exact?
    fn ask_homotopy(
        &mut self,
        found: &mut Candidates,
        start: Start,
        (most, share): (Option<usize>, f64),
        request: &Request,
        control: &mut Control,
    ) -> Result<bool> {
        let mut inside = Request { start: OcpStart::Homotopy, ..*request };
        let limit = &mut inside.options.solver.max_iter;
        *limit = most.map_or(*limit, |most| most.min(*limit));
        control.sooner(share, |control| {
            let ended = self.run(start, &inside, control).map(|_| ());
            found.cut = found.cut.or(stop::requested());
            ended
        })?;
        let r = self.last_result()?;
        let (exact, cost) = (r.is_exact() && r.polish == Polish::Done, r.priced);
        found.add(r);
        // what a descent said of the best answer is not given up for one that costs the same
        let lead = if found.still.is_some() { GAIN * cost.abs() } else { 0.0 };
        if exact && cost <= found.cost() - lead {
            let mut own = Box::new(self.blank());
            (own.built, own.result, own.engine) = (self.built.take(), self.result.take(), self.engine.take());
            // where its own controls lead elsewhere, that is what it is worth
            let simulated = worth(&mut own, request)?;
            let better = match found.best.as_mut() {
                Some(best) => agree(simulated, cost) || simulated < worth(best, request)?,
                None => true,
            };
            if better {
                found.replace(own, request)?;
            }
        }
        Ok(exact)
    }

    /// Of large problems: does the homotopy keep the promise of smoothed problems that several ladders led to, with a certified
    /// answer? Mode programs of their controls have nothing to add then, and their switches, which may be many control stages
    /// off, need not be moved from stage to stage, which takes the longer the more stages there are. First whether the
    /// homotopy came to an end.
    fn keeps_promise(
        &mut self,
        found: &mut Candidates,
        race: &Race,
        start: Start,
        request: &Request,
        control: &mut Control,
    ) -> Result<(bool, bool)> {
        let Some(promised) = race.agreed_cost().filter(|_| stop::requested().is_none()) else {
            return Ok((false, false));
        };
        let most = found.spent.iterations.max(OPINION);
        match self.ask_homotopy(found, start, (Some(most), HALF), request, control) {
            Ok(_) => (),
            Err(Error::OutOfTime) => return Ok((false, false)),
            Err(e) => return Err(e),
        }
        let kept = (found.cost() - promised).abs() <= PROMISED * promised.abs().max(found.cost().abs());
        Ok((true, kept && found.is_certified()?))
    }

    /// Where nothing else leads to an exact answer: mode programs along simulations of the controls of smoothed problems, aimed at the
    /// constraints, then of the guessed controls and of others within their bounds, as they are and aimed.
    fn solve_from_simulations(
        &self,
        found: &mut Candidates,
        failed: &OcpResult,
        request: &Request,
        control: &mut Control,
    ) -> Result<()> {
        for missed in std::mem::take(&mut found.missed) {
            self.aim_from(found, &missed, request, control)?;
        }
        if found.best.is_some() {
            return Ok(());
        }
        let known = found.known.clone();
        let inside = request.of_a_part();
        let with = |controls: Vec<f64>| {
            let (durations, control_ends) = (self.durations.clone(), controls.clone());
            OcpResult { durations, control_ends, controls, ..failed.clone() }
        };
        for controls in self.random_starts(SIMULATED, 0) {
            if stop::requested().is_some() {
                break;
            }
            self.solve_along(found, &with(controls), ROUGH, &known, &inside, control)?;
        }
        let Some(b) = self.built.as_ref().filter(|_| found.best.is_none()) else { return Ok(()) };
        let drawn = self.closest(b, failed, self.coarse_starts(DRAWN, 0), &known)?;
        for controls in drawn.into_iter().take(AIMED) {
            if found.best.is_some() {
                break;
            }
            self.aim_from(found, &with(controls), request, control)?;
        }
        Ok(())
    }

    /// The mode program along a simulation of the controls of `moved`, whose answer is kept where it is the best.
    fn solve_along(
        &self,
        found: &mut Candidates,
        moved: &OcpResult,
        room: Room,
        known: &Sizes,
        inside: &Request,
        control: &mut Control,
    ) -> Result<()> {
        let Some(traced) = self.trace_through(moved, &inside.options)? else { return Ok(()) };
        let one = self.solve_traced(moved, (&traced, room), known, inside, control)?;
        let Some(r) = one.result.as_ref() else { return Ok(()) };
        found.add(r);
        if r.is_exact() && r.priced < found.cost() {
            found.replace(one, inside)?;
        }
        Ok(())
    }

    /// Smoothed problems that promised less than the best answer costs, but whose mode programs had no answer: they may have
    /// had the wrong phases, where the smooth motion stays close to a surface. Their controls are aimed at the constraints.
    fn aim_missed(&self, found: &mut Candidates, request: &Request, control: &mut Control) -> Result<()> {
        for missed in std::mem::take(&mut found.missed) {
            let cost = found.cost();
            if missed.priced < cost - PROMISED * cost.abs() {
                self.aim_from(found, &missed, request, control)?;
            }
        }
        Ok(())
    }

    /// Aims the simulation of controls at the constraints, and solves the mode program of the phases that are met on the way.
    fn aim_from(
        &self,
        found: &mut Candidates,
        from: &OcpResult,
        request: &Request,
        control: &mut Control,
    ) -> Result<()> {
        let known = found.known.clone();
        let inside = request.of_a_part();
        let Some(b) = found.best.as_ref().map_or(self.built.as_ref(), |best| best.built.as_ref()) else {
            return Ok(());
        };
        if stop::requested().is_some() {
            return Ok(());
        }
        let Some(aimed) = self.aim(b, from, &known)? else { return Ok(()) };
        self.solve_along(found, &aimed, LOWEST, &known, &inside, control)
    }

    /// Goes from the best answer to sequences next to its own as long as the cost falls.
    pub(super) fn improve(&self, found: &mut Candidates, request: &Request, control: &mut Control) -> Result<()> {
        let inside = request.of_a_part();
        let form = Dcs::new(&self.system, request.options.form)?.form().clone();
        let groups = form.groups();
        let across = form.groups_across(&self.linear, self.stage_params.is_some());
        let n_fe = self.elements(&request.options);
        let mut tried = Vec::new();
        let mut before: Option<Sequence> = None;
        let mut left = NEIGHBOURS.max(request.search);
        let most = found.work + (self.settings.search_effort * (BESIDE * found.work as f64).max(EFFORT)) as usize;
        let (mut followed, mut descended) = (0, 0);
        self.use_idle(found, &form, &n_fe, request, control)?;
        self.clear_best(found, request, control)?;
        while let Some((r, sizes)) = found.best.as_ref().and_then(|b| Some((b.result.clone()?, b.sizes.clone()))) {
            let now = Sequence::of(&r);
            let own = match found.best.as_mut() {
                Some(best) => worth(best, request)?,
                None => r.priced,
            };
            tried.push(now.sets());
            let mut better = false;
            let beyond = before.replace(now.clone()).and_then(|before| now.beyond(&before));
            for s in beyond.into_iter().chain(now.neighbours(&groups, &across)) {
                if stop::requested().is_some() || allowance::is_over() {
                    return Ok(());
                }
                if left == 0 || (request.search == 0 && found.work > most) {
                    break;
                }
                if tried.contains(&s.sets()) {
                    continue;
                }
                tried.push(s.sets());
                left -= 1;
                let mut work = self.with_sequence(&r, &s, &form, &n_fe)?;
                work.sizes.clone_from(&sizes);
                let next = work.run(Start::Near, &inside, control)?;
                found.add(next);
                if next.is_exact() && self.take_better(found, work, (r.priced, own), request, control)? {
                    better = true;
                    break;
                }
            }
            if better {
                continue;
            }
            if followed < FOLLOWED {
                followed += 1;
                if self.follow(found, request, &mut tried, control)? {
                    continue;
                }
            }
            if descended == FOLLOWED || !self.descend_from(found, request, control)? {
                break;
            }
            descended += 1;
        }
        Ok(())
    }

    /// Elements of the best answer that have no length, as those of phases that turned out to have none, are given to the phases that
    /// are left: the answer is more accurate with them.
    fn use_idle(
        &self,
        found: &mut Candidates,
        form: &Form,
        n_fe: &[usize],
        request: &Request,
        control: &mut Control,
    ) -> Result<()> {
        let inside = request.of_a_part();
        let Some((r, sizes)) = found.best.as_ref().and_then(|b| Some((b.result.clone()?, b.sizes.clone()))) else {
            return Ok(());
        };
        if !r.has_idle() || stop::requested().is_some() {
            return Ok(());
        }
        let mut work = self.with_sequence(&r, &Sequence::of(&r), form, n_fe)?;
        work.sizes = sizes;
        let next = work.run(Start::Near, &inside, control)?;
        found.add(next);
        if next.is_exact() && !next.has_idle() && next.priced <= r.priced + SAME * r.priced.abs() {
            found.replace(work, request)?;
        }
        Ok(())
    }

    /// Follows the direction in which the best answer is not optimal, or in which only a simulation says what it is: the controls
    /// are moved along it, what they lead to is simulated, and the mode programs of the phases are solved. Is there a better
    /// answer?
    fn follow(
        &self,
        found: &mut Candidates,
        request: &Request,
        tried: &mut Vec<Vec<Vec<Vec<bool>>>>,
        control: &mut Control,
    ) -> Result<bool> {
        let Some(best) = found.best.as_mut() else { return Ok(false) };
        let Some(judged) = best.judged()? else { return Ok(false) };
        let Some(r) = best.result.clone() else { return Ok(false) };
        let known = best.sizes.clone().unwrap_or_else(|| found.known.clone());
        let inside = request.of_a_part();
        if judged.reason == OTHER {
            return Ok(self.clear_best(found, request, control)? || self.refine(found, &r, &known, &inside, control)?);
        }
        // behind a kink that is a jump of the cost the motion may be another one altogether
        let jumps = judged.direction.is_empty();
        let directions = if jumps { judged.beyond } else { vec![judged.direction] };
        if directions.is_empty() {
            return Ok(false);
        }
        let own = worth(best, request)?;
        // a jump is looked at as an excursion from the answer, too
        let ways: &[bool] = if jumps { &[false, true] } else { &[false] };
        let steps = || STEPS.into_iter().flat_map(|s| ways.iter().map(move |through| (s, *through)));
        for (direction, (step, through)) in directions.iter().flat_map(|d| steps().map(move |s| (d, s))) {
            if stop::requested().is_some() {
                break;
            }
            let mut moved = r.clone();
            moved.controls = self.moved(&r.controls, direction, step);
            moved.control_ends.clone_from(&moved.controls);
            let o = &request.options;
            let simulated = if through { self.trace_through(&moved, o) } else { self.trace(&moved, o) };
            let Some(traced) = simulated? else { continue };
            let one = self.solve_traced(&moved, (&traced, NEAR), &known, &inside, control)?;
            let Some(next) = one.result.as_ref() else { continue };
            found.add(next);
            tried.push(Sequence::of(next).sets());
            if next.is_exact() && self.take_better(found, one, (r.priced, own), request, control)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Where nothing else follows the direction of a better answer: by descent on simulations, which says either that there is
    /// none, or where one is. Its mode program is solved on finer grids where it is not better in simulations. Is it?
    fn descend_from(&self, found: &mut Candidates, request: &Request, control: &mut Control) -> Result<bool> {
        let Some(best) = found.best.as_mut() else { return Ok(false) };
        let Some(judged) = best.judged()? else { return Ok(false) };
        let elsewhere = judged.reason == OTHER;
        let doubtful = elsewhere || judged.asks_for_descent();
        if stop::requested().is_some() || !doubtful {
            return Ok(false);
        }
        let known = best.sizes.clone().unwrap_or_else(|| found.known.clone());
        let inside = request.of_a_part();
        let now = worth(best, request)?;
        let Some(r) = best.result.clone() else { return Ok(false) };
        // where a step of any size costs at first, from the other side too
        let sides = std::iter::once(judged.direction).chain(judged.beyond).filter(|d| !d.is_empty()).take(SIDES);
        let starts = std::iter::once(r.controls.clone()).chain(sides.map(|d| self.moved(&r.controls, &d, LONG)));
        // what the answer costs in a simulation, where that is one of the answer
        let mut own = None;
        // the least that a descent ended at whose mode program has no answer
        let mut without = f64::INFINITY;
        for (i, controls) in starts.enumerate() {
            let Some(best) = found.best.as_mut().filter(|_| stop::requested().is_none()) else { break };
            let descent = match self.descend(best, &known, &controls)? {
                Some(descent) => descent,
                None if i == 0 => return Ok(false),
                None => continue,
            };
            if i == 0 && !elsewhere {
                (own, found.still) = (Some(descent.before), descent.still);
            }
            if i == 0 && descent.still.is_some_and(|v| v != Verdict::Unknown) {
                return Ok(false);
            }
            if own.is_some_and(|own| !descent.betters(own)) {
                continue;
            }
            // from several sides descents end at the same place
            if descent.cost > without - SAME * without.abs() {
                continue;
            }
            let moved = descent.moved;
            let Some(traced) = self.trace_through(&moved, &request.options)? else { continue };
            for elements in [1, FINER[0], FINER[1]] {
                if stop::requested().is_some() {
                    break;
                }
                let room = Room { elements, ..LOWEST };
                let mut one = self.solve_traced(&moved, (&traced, room), &known, &inside, control)?;
                let Some(next) = one.result.as_ref() else { continue };
                found.add(next);
                if !next.is_exact() {
                    // a finer grid is for answers that simulations do not confirm
                    without = without.min(descent.cost);
                    break;
                }
                let back = (next.priced - r.priced).abs() <= GAIN * r.priced.abs();
                let little = descent.cost >= r.priced && descent.before - descent.cost <= SAME * r.priced.abs();
                if i == 0 && !elsewhere && back && little {
                    // it gained no more than what the simulation is off by, and its program is solved by the answer
                    found.still = Some(Verdict::Unknown);
                }
                let better = |one: &mut Ocp| Ok(worth(one, request)? < now - GAIN * now.abs());
                if better(&mut one)? {
                    if one.leads_elsewhere()? {
                        one = one.or_clear(found, request, control)?;
                        if !better(&mut one)? {
                            break;
                        }
                    }
                    found.replace(one, request)?;
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }

    /// Controls moved along a direction within their bounds.
    pub(super) fn moved(&self, controls: &[f64], direction: &[f64], step: f64) -> Vec<f64> {
        let bounds = (0..self.n_stages).flat_map(|k| {
            let [lower, upper] = self.control_bounds(k);
            lower.iter().zip(upper)
        });
        let moved = controls.iter().zip(direction).zip(bounds);
        moved.map(|((u, d), (l, h))| (u + step * d).clamp(*l, *h)).collect()
    }

    /// Puts an exact answer in the place of the best one, of which the costs by itself and simulated are given, where it is better. One that
    /// leads elsewhere because of what it touches is kept clear of that first; where the best one leads elsewhere, one as cheap that does not is
    /// better. Is it?
    pub(super) fn take_better(
        &self,
        found: &mut Candidates,
        mut one: Box<Ocp>,
        now: (f64, f64),
        request: &Request,
        control: &mut Control,
    ) -> Result<bool> {
        if one.priced() < now.0 - GAIN * now.0.abs() {
            one = one.or_clear(found, request, control)?;
        }
        let mut better = lower(&mut one, now, request)?;
        if !better && one.priced() <= now.0 + SAME * now.0.abs() {
            let astray = found.best.as_mut().map_or(Ok(false), |best| best.leads_elsewhere())?;
            better = astray && one.leads_to_it(request)?;
        }
        if better {
            found.replace(one, request)?;
        }
        Ok(better)
    }

    /// Where the controls of the best answer lead elsewhere because it touches what it does not cross: the same with a distance. Is there one?
    fn clear_best(&self, found: &mut Candidates, request: &Request, control: &mut Control) -> Result<bool> {
        let cost = found.cost();
        let Some(best) = found.best.as_mut() else { return Ok(false) };
        if found.astray == Some(cost) || !best.leads_elsewhere()? {
            return Ok(false);
        }
        let Some(best) = found.best.take() else { return Ok(false) };
        match best.keep_clear(request, &mut |r| found.add(r), control) {
            Ok(Some(clear)) => {
                found.best = Some(clear);
                Ok(true)
            }
            other => {
                (found.best, found.astray) = (Some(best), Some(cost));
                other.map(|_| false)
            }
        }
    }

    /// An answer that its own controls do not lead to is none: the phases of their simulation on a finer grid replace it,
    /// whatever they cost. Is there such an answer?
    fn refine(
        &self,
        found: &mut Candidates,
        r: &OcpResult,
        known: &Sizes,
        inside: &Request,
        control: &mut Control,
    ) -> Result<bool> {
        let Some(traced) = self.trace(r, &inside.options)? else { return Ok(false) };
        for elements in FINER {
            if stop::requested().is_some() {
                break;
            }
            let room = Room { elements, ..NEAR };
            let mut one = self.solve_traced(r, (&traced, room), known, inside, control)?;
            let Some(next) = one.result.as_ref() else { continue };
            found.add(next);
            if next.is_exact() && one.judged()?.is_some_and(|o| o.reason != OTHER) {
                found.replace(one, inside)?;
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// What counts is what the controls lead to: where that costs more than the answer says, and more than another answer, the
    /// other one is taken. Where there is none it is looked for along the simulation of the best one.
    pub(super) fn settle(&self, found: &mut Candidates, request: &Request, control: &mut Control) -> Result<()> {
        let cost = found.cost();
        let Some(best) = found.best.as_mut() else { return Ok(()) };
        let Some(simulated) = best.simulated_cost(request)? else { return Ok(()) };
        if agree(simulated, cost) {
            return Ok(());
        }
        let inside = request.of_a_part();
        let mut from = best.result.clone();
        let known = best.sizes.clone().unwrap_or_else(|| found.known.clone());
        // descents of the programs end where the simulation is what they say, or lead away from it again
        for _ in 0..FOLLOWED {
            let Some(r) = from.take() else { break };
            let Some(traced) = self.trace_through(&r, &request.options)? else { break };
            let one = self.solve_traced(&r, (&traced, NEAR), &known, &inside, control)?;
            let Some(next) = one.result.as_ref().filter(|n| n.is_exact()) else { break };
            found.add(next);
            from = Some(next.clone());
            found.keep(one, request)?;
        }
        if cost_of(&found.spare) < simulated {
            (found.best, found.still) = (found.spare.take(), None);
        }
        Ok(())
    }

    /// Takes over the best answer with what was built for it, and reports it.
    pub(super) fn adopt(
        &mut self,
        found: Candidates,
        request: &Request,
        control: &mut Control,
        clock: Instant,
    ) -> Result<&OcpResult> {
        let mut found = found;
        let cost = found.cost();
        let taken = found.best.take().and_then(|mut f| f.built.take().map(|b| (b, f.builds, f.result)));
        let Some((mut b, builds, before)) = taken else {
            return Err(Error::Internal("no answer was found".into()));
        };
        let stage_params = b.extended.params.clone();
        let still = found.still;
        self.measured = Some(found.known.clone());
        self.largest = self.largest.max(cost.abs());
        self.builds += builds;
        let reported = self.report(&mut b, &stage_params, (Statistics::default(), None), request, control);
        self.built = Some(b);
        let mut r = reported?;
        // where there is no time to judge it again
        if let Some(known) = before.and_then(|b| b.optimality).filter(|_| stop::requested().is_some()) {
            if r.optimality.as_ref().is_some_and(|o| o.verdict == Verdict::Unknown) {
                r.optimality = Some(known);
                self.withhold_verdict(&mut r);
            }
        }
        if let (Some(o), Some(verdict)) = (r.optimality.as_mut().filter(|o| o.is_open()), still) {
            o.certify_by_descent(verdict);
            self.withhold_verdict(&mut r);
        }
        if let Some(why) = found.cut {
            r.tell_cut(why);
        }
        self.result = Some(r);
        self.tell_cheaper_guess()?;
        self.spent_in_all(&found, clock)
    }

    /// The result is what all of this took.
    pub(super) fn spent_in_all(&mut self, found: &Candidates, clock: Instant) -> Result<&OcpResult> {
        let r = self.result.as_mut().ok_or_else(|| Error::Internal("a solve without a result".into()))?;
        r.time_build = found.time_build;
        r.stats = Statistics { time_total: clock.elapsed().as_secs_f64() - found.time_build, ..found.spent };
        Ok(r)
    }

    /// Is one answer better than another?
    pub(super) fn has_costs(&self) -> bool {
        self.lagrange.is_some() || self.mayer.is_some() || !self.squares.is_empty() || !self.soft.is_empty()
    }

    /// Are there constraints on the way that are not linear, as obstacles are?
    fn bends(&self) -> bool {
        self.path.iter().any(|c| c.f.hess_pattern().nnz() > 0)
    }

    /// Is there a smoothed problem, and are its answers of use: is there a cost to compare, is the exact active set wanted, and
    /// simulated?
    fn may_smooth(&self, request: &Request) -> bool {
        let s = &self.system;
        self.has_costs()
            && self.modes.is_none()
            && self.complementarity.is_empty()
            && s.n_algebraic() == 0
            && s.inclusions().is_empty()
            && self.switches()
            && request.options.solver.polish
            && request.options.discretisation.discretisation == crate::settings::Discretisation::Fesd
    }

    /// From the smoothed problems to the mode programs of their controls.
    pub(super) fn smooth(
        &self,
        found: &mut Candidates,
        ladders: Ladders,
        request: &Request,
        control: &mut Control,
    ) -> Result<()> {
        let race = self.race(found, ladders, request, control)?;
        self.solve_raced(found, race, request, control)
    }

    /// The smoothed problems.
    fn race(&self, found: &mut Candidates, ladders: Ladders, request: &Request, control: &mut Control) -> Result<Race> {
        let Some(mut smoother) = self.smoother(&found.known, request, control)? else { return Ok(Race::default()) };
        let (ladders, tried) = match ladders {
            Ladders::All => (smoother.race(control), Vec::new()),
            Ladders::FromPlan(phases) => (smoother.follow(control), vec![phases]),
        };
        found.spent.add(&smoother.spent);
        found.work += smoother.work();
        Ok(Race { ladders, tried, large: smoother.is_large() })
    }

    /// The mode programs of the controls of smoothed problems.
    fn solve_raced(&self, found: &mut Candidates, race: Race, request: &Request, control: &mut Control) -> Result<()> {
        let Race { ladders, mut tried, large } = race;
        let known = found.known.clone();
        // of a large problem one step to a neighbour moves a switch by a control stage, and there are many on the way
        let inside = Request { plain_branches: large, ..request.of_a_part() };
        let mut costs: Vec<f64> = Vec::new();
        for (k, ladder) in ladders.iter().enumerate() {
            let mut best = f64::INFINITY;
            // the narrowest problem says most; where its mode program keeps the promise the others have nothing to add
            let mut kept = false;
            for smooth in ladder.answers.iter().rev() {
                if kept {
                    break;
                }
                if stop::requested().is_some() {
                    return Ok(());
                }
                let Some(traced) = self.trace(smooth, &request.options)? else { continue };
                let sets = traced.phases.sets();
                if tried.contains(&sets) {
                    continue;
                }
                tried.push(sets);
                let one = self.solve_traced(smooth, (&traced, ROUGH), &known, &inside, control)?;
                let Some(r) = one.result.as_ref() else { continue };
                found.add(r);
                if !r.is_exact() {
                    found.missed.push(smooth.clone());
                    continue;
                }
                best = best.min(r.priced);
                let size = r.priced.abs().max(smooth.priced.abs());
                kept = (r.priced - smooth.priced).abs() <= PROMISED * size;
                if r.priced < found.cost() {
                    found.agreed = k == 0 && ladder.count > 1 && kept;
                    found.replace(one, request)?;
                } else {
                    found.keep(one, request)?;
                }
            }
            costs.push(best);
        }
        costs.sort_by(f64::total_cmp);
        if let [a, b, ..] = costs[..] {
            // where the second one led nowhere the second look is asked, which is cheaper than the homotopy
            found.agreed |= b.is_infinite() || (a - b).abs() <= SAME * a.abs().max(b.abs());
        }
        Ok(())
    }
}
