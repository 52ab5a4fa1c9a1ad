//! What is searched where modes follow from the state: sequences of active sets of Filippov systems, their programs, those next to one.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ops::Range;
use std::rc::Rc;

use super::SAME;
use crate::dcs::{Across, Dcs};
use crate::error::{Error, Result};
use crate::fesd::Sizes;
use crate::mpcc::{Polish, Solution};
use crate::nlp::{Control, Nlp, Outcome};
use crate::ocp::accuracy::Accuracy;
use crate::ocp::candidates::agree;
use crate::ocp::moves;
use crate::ocp::optimality::{Optimality, Verdict, OTHER};
use crate::ocp::request::Request;
use crate::ocp::sequence::{Room, Traced, LOWEST, NEAR, ROUGH};
use crate::ocp::smoothing::Smoother;
use crate::ocp::solve::{Built, Start};
use crate::ocp::{Ocp, OcpResult};
use crate::random::SplitMix64;
use crate::search::{
    self, watched, Budget, EarlyTermination, Limits, Neighbour, Patience, Rank, Sampler, Source, Space,
};
use crate::settings::OcpStart;
use crate::sim::SolveOptions;
use crate::stop;

/// Multiples of the elements of a grid on which what simulations contradict is solved again.
const FINER: [usize; 2] = [2, 4];
/// Changes of controls, in units of their sizes, with which descents begin on the sides of a kink.
const SIDE: f64 = 0.1;
/// Share of the range of a control by which one that is held may change, so that what a simulation meets to its tolerance can be met exactly.
const HELD: f64 = 0.01;
/// Iterations that the program of a sequence and the homotopy take as a rule. With as many for the homotopy as for a program 70 problems took 1.4 times
/// the work (docs/dev/log/search.md).
const PROGRAM: f64 = 50.0;
const HOMOTOPY: f64 = 300.0;
/// Descents from random controls at most.
const DRAWN: usize = 80;

/// A sequence as it is remembered: the multiple of the usual elements, and the active sets of the phases of every stage. That of the homotopy, which
/// has none before it has ended, is empty.
pub(super) type Sequence = (usize, Vec<Vec<Vec<bool>>>);

/// What the program of a sequence begins with.
#[derive(Clone)]
pub(super) enum Motion {
    /// The homotopy from the guess of the problem.
    Homotopy,
    /// A simulation of the controls of an answer.
    Traced(Rc<Path>),
    /// The same, with controls that stay next to those.
    Held(Rc<Path>),
    /// A solution whose phases are changed.
    Moved { from: Rc<OcpResult>, sizes: Rc<Option<Sizes>>, to: Rc<moves::Sequence> },
    /// Every sequence next to a solution with its own motion.
    Beside(Rc<BTreeMap<Sequence, Motion>>),
}

/// A simulation of controls, and how much of it is kept.
#[derive(Clone)]
pub(super) struct Path {
    from: Rc<OcpResult>,
    traced: Rc<Traced>,
    room: Room,
}

impl Path {
    /// The same simulation with other room.
    fn in_room(&self, room: Room) -> Rc<Path> {
        Rc::new(Path { room, ..self.clone() })
    }
}

/// What the program of a sequence ended at.
pub(super) struct Ended {
    /// The problem with its result and what was built for it.
    pub one: Rc<RefCell<Box<Ocp>>>,
    sequence: Sequence,
    pub rank: Rank,
    /// The result, without what was built.
    pub result: Rc<OcpResult>,
    /// The phases of the solution that it was next to.
    before: Option<Rc<moves::Sequence>>,
    /// Where descents on simulations lead that begin at it.
    lower: Vec<Rc<Path>>,
    /// Is it what the homotopy ended at?
    pub homotopy: bool,
    /// Do derivatives or a descent on simulations say that it is a local optimum?
    pub certified: bool,
    /// What a descent on simulations says of it, where derivatives do not.
    pub still: Option<Verdict>,
    /// Was it compared with a simulation of its controls?
    verified: bool,
}

pub(super) type Candidate = search::Candidate<Sequence, Motion>;

/// The sequences of a problem.
pub(super) struct Filippov<'a> {
    ocp: &'a Ocp,
    request: Request,
    dcs: Dcs,
    groups: Vec<Range<usize>>,
    across: Vec<Across>,
    n_fe: Vec<usize>,
    known: Sizes,
    /// The discretised problem at its starting point, from which simulations of controls take what is no control.
    template: (Box<Built>, OcpResult),
    /// Smoothed problems, once they were asked for.
    smoother: Option<Option<Smoother>>,
    asked_homotopy: bool,
    /// An answer of before, the first motion of all, and the only one of smoothed problems.
    last: Option<Box<OcpResult>>,
    guessed: bool,
    sampler: Sampler,
    numbers: SplitMix64,
    drawn: usize,
    largest: f64,
    /// Seconds to build problems.
    pub time_build: f64,
}

impl<'a> Filippov<'a> {
    pub fn new(
        ocp: &'a Ocp,
        last: Option<Box<OcpResult>>,
        known: Sizes,
        request: &Request,
        control: &mut Control,
    ) -> Result<Filippov<'a>> {
        let dcs = Dcs::new(&ocp.system, request.options.form)?;
        let form = dcs.form();
        let (groups, across) = (form.groups(), form.groups_across(&ocp.linear, ocp.stage_params.is_some()));
        Ok(Filippov {
            request: Request { plain_branches: true, ..request.of_a_part() },
            groups,
            across,
            n_fe: ocp.elements(&request.options),
            template: template(ocp, &known, &request.options, control)?,
            known,
            smoother: None,
            asked_homotopy: false,
            last,
            guessed: false,
            sampler: Sampler::new(ocp.settings.search_seed as u64),
            numbers: SplitMix64::new(ocp.settings.search_seed as u64),
            drawn: 0,
            largest: 0.0,
            time_build: 0.0,
            dcs,
            ocp,
        })
    }

    /// The simulation of the controls of an answer, from its initial state or stage by stage, as a candidate; `None` where there is none.
    fn along(&self, from: &OcpResult, room: Room, through: bool) -> Result<Option<Rc<Path>>> {
        let o = &self.request.options;
        let traced = if through { self.ocp.trace_through(from, o) } else { self.ocp.trace(from, o) };
        Ok(traced?.map(|traced| Rc::new(Path { from: Rc::new(from.clone()), traced: Rc::new(traced), room })))
    }

    fn key(&self, p: &Path) -> Sequence {
        (p.room.elements, self.ocp.phases_along(&p.from, (&p.traced, p.room), &self.dcs).sets())
    }

    fn candidate(&self, path: Rc<Path>) -> Candidate {
        Candidate::new(self.key(&path), Motion::Traced(path))
    }

    /// The simulation of the guess, or of an answer of before.
    fn guess(&mut self) -> Result<Vec<Candidate>> {
        if std::mem::replace(&mut self.guessed, true) {
            return Ok(Vec::new());
        }
        if let Some(last) = &self.last {
            return Ok(self.along(last, NEAR, true)?.map(|p| self.candidate(p)).into_iter().collect());
        }
        let from = self.with(self.ocp.control_guess());
        let Some(path) = self.along(&from, ROUGH, true)? else { return Ok(Vec::new()) };
        let near = path.in_room(NEAR);
        let mut out = vec![self.candidate(path)];
        if self.ocp.u_guess.is_some() {
            // a guess that meets the constraints is a solution but for its discretisation, whatever its program leads to
            if let Some(cost) = self.ocp.feasible_cost(&self.template.0, &from, &self.known)? {
                out.push(Candidate { sequence: (0, self.key(&near).1), motion: Motion::Held(near), promise: cost });
            }
        }
        Ok(out)
    }

    /// An answer with other controls, and all else as the problem begins.
    fn with(&self, controls: Vec<f64>) -> OcpResult {
        OcpResult { control_ends: controls.clone(), controls, ..self.template.1.clone() }
    }

    /// The next ladder of smoothed problems: simulations of the controls that it ends at, the narrowest problem first.
    fn smoothed(&mut self, budget: &mut Budget, control: &mut Control) -> Result<Vec<Candidate>> {
        if self.smoother.is_none() {
            self.smoother = Some(self.ocp.smoother(&self.known, &self.request, control)?);
        }
        while let Some(Some(smoother)) = self.smoother.as_mut() {
            let answers =
                if self.last.is_some() { smoother.plan_ladder(control) } else { smoother.next_ladder(control) };
            let Some(answers) = answers else { break };
            budget.solved(smoother.n(), &std::mem::take(&mut smoother.spent));
            let mut out = Vec::new();
            for answer in answers.iter().rev() {
                out.extend(self.along(answer, ROUGH, false)?.map(|p| self.candidate(p)));
            }
            if !out.is_empty() || stop::requested().is_some() {
                return Ok(out);
            }
        }
        Ok(Vec::new())
    }

    /// A descent on simulations from random controls, the first from the guess.
    fn sample(&mut self, best: Option<&Ended>, budget: &mut Budget) -> Result<Vec<Candidate>> {
        if self.drawn < DRAWN && stop::requested().is_none() {
            self.drawn += 1;
            let guess = self.ocp.control_guess();
            let known = best.map_or(&guess[..], |b| &b.result.controls);
            let controls = match self.drawn {
                1 => guess,
                _ => self.sampler.draw(self.ocp.n_stages, &self.ocp.control_ranges(), known),
            };
            let from = self.with(self.ocp.within_bounds(controls));
            // lengths, parameters and initial states are those of the start and random ones in turn
            let numbers = (self.drawn % 2 == 0).then_some(&mut self.numbers);
            let shot = self.ocp.shot(&self.template.0, &from, &self.known, numbers)?;
            let Some((shot, evaluations)) = shot else { return Ok(Vec::new()) };
            budget.simulated(self.template.0.problem.n(), evaluations);
            let Some(shot) = shot else { return Ok(vec![nothing()]) };
            let Some(path) = self.along(&shot.moved, LOWEST, true)? else { return Ok(vec![nothing()]) };
            return Ok(vec![Candidate { promise: shot.cost, ..self.candidate(path) }]);
        }
        Ok(Vec::new())
    }

    /// Solves the program of a candidate.
    fn run(
        &self,
        motion: &Motion,
        (watch, request): (&mut EarlyTermination, &Request),
        control: &mut Control,
    ) -> Result<Box<Ocp>> {
        match motion {
            Motion::Traced(p) => watched(watch, control, |control| {
                self.ocp.solve_traced(&p.from, (&p.traced, p.room), &self.known, request, control)
            }),
            Motion::Held(p) => {
                let mut near = self.ocp.blank();
                near.chosen = Some(self.beside(&p.from.controls));
                let mut one = near.solve_traced(&p.from, (&p.traced, p.room), &self.known, request, control)?;
                one.chosen.clone_from(&self.ocp.chosen);
                Ok(one)
            }
            Motion::Moved { from, sizes, to } => {
                let mut one = self.ocp.with_sequence(from, to, self.dcs.form(), &self.n_fe)?;
                one.sizes = Option::clone(sizes);
                watched(watch, control, |control| one.run(Start::Near, request, control).map(|_| ()))?;
                Ok(one)
            }
            Motion::Homotopy | Motion::Beside(_) => {
                let mut one = Box::new(self.ocp.blank());
                one.run(Start::Cold, &Request { start: OcpStart::Homotopy, ..*request }, control)?;
                Ok(one)
            }
        }
    }

    /// Bounds of controls next to these.
    fn beside(&self, controls: &[f64]) -> [Vec<f64>; 2] {
        let ranges = self.ocp.control_ranges();
        let within = |sign: f64| {
            let moved = controls.iter().zip(ranges.iter().cycle()).map(|(u, [l, h])| u + sign * HELD * (h - l));
            self.ocp.within_bounds(moved.collect())
        };
        [within(-1.0), within(1.0)]
    }

    /// Where its phases leave elements without length, the same phases with those: the solution is more accurate then.
    fn use_idle(&mut self, s: &mut Ended, budget: &mut Budget, control: &mut Control) -> Result<()> {
        if !s.result.has_idle() || stop::requested().is_some() {
            return Ok(());
        }
        let sizes = Rc::new(s.one.borrow().sizes.clone());
        let to = Rc::new(moves::Sequence::of(&s.result));
        let motion = Motion::Moved { from: s.result.clone(), sizes, to };
        let mut watch = self.watch(f64::INFINITY);
        let one = self.run(&motion, (&mut watch, &self.request), control)?;
        let next = self.ended(one, 1, budget)?;
        if next.rank.feasible && !next.result.has_idle() && agree(next.result.priced, s.result.priced) {
            *s = Ended { before: s.before.take(), ..next };
        }
        Ok(())
    }

    fn watch(&self, cost: f64) -> EarlyTermination {
        EarlyTermination::new(cost, Patience::usual(usize::MAX), self.request.options.solver.tol)
    }

    /// What a program ended at, on so many times the usual elements.
    fn ended(&mut self, one: Box<Ocp>, elements: usize, budget: &mut Budget) -> Result<Ended> {
        let r = one.last_result()?;
        budget.solved(r.dimensions.0, &r.stats);
        self.time_build += r.time_build;
        let s = moves::Sequence::of(r);
        let mut rank = r.rank(r.priced, self.largest);
        if r.outcome == Outcome::Failed {
            rank.violation = f64::INFINITY;
        }
        Ok(Ended {
            sequence: (elements, s.sets()),
            rank,
            result: Rc::new(r.clone()),
            before: None,
            lower: Vec::new(),
            homotopy: false,
            certified: false,
            still: None,
            verified: false,
            one: Rc::new(RefCell::new(one)),
        })
    }

    /// Where descents on simulations lead that begin at a solution which is no local optimum by its derivatives, and on the sides of its kinks.
    fn descend(&mut self, s: &mut Ended, o: &Optimality, budget: &mut Budget) -> Result<()> {
        let elsewhere = o.reason == OTHER;
        if !elsewhere && !o.asks_for_descent() {
            return Ok(());
        }
        let sides = std::iter::once(&o.direction).chain(&o.beyond).filter(|d| !d.is_empty());
        let own = s.result.controls.clone();
        let sides = sides.map(|d| self.ocp.moved(&own, d, SIDE));
        let starts: Vec<Vec<f64>> = std::iter::once(own.clone()).chain(sides).collect();
        let mut at = None;
        for (i, controls) in starts.iter().enumerate() {
            if stop::requested().is_some() {
                break;
            }
            let Some(d) = self.ocp.descend(&s.one.borrow(), &self.known, controls)? else { continue };
            budget.simulated(s.result.dimensions.0, d.evaluations);
            if i == 0 && !elsewhere {
                (at, s.still) = (Some(d.before), d.still);
            }
            if i == 0 && d.still.is_some_and(|v| v != Verdict::Unknown) {
                break;
            }
            if at.is_some_and(|at| !d.betters(at)) {
                continue;
            }
            s.lower.extend(self.along(&d.moved, LOWEST, true)?);
        }
        Ok(())
    }
}

impl Filippov<'_> {
    /// Of what costs the same, puts the first that is known to be an optimum before the others.
    pub fn settle(&mut self, all: &mut [(Ended, Sequence)], budget: &mut Budget, control: &mut Control) -> Result<()> {
        let Some(most) = all.first().map(|b| b.0.rank.cost + SAME * b.0.rank.cost.abs()) else { return Ok(()) };
        for k in 0..all.len() {
            let s = &mut all[k].0;
            if !s.rank.feasible || s.rank.cost > most || stop::requested().is_some() {
                break;
            }
            let has_built = s.one.borrow().built.is_some();
            if !s.verified && has_built {
                self.verify(s, budget, control)?;
            }
            if s.certified && !s.rank.contradicted && s.rank.cost <= most {
                all[..=k].rotate_right(1);
                break;
            }
        }
        Ok(())
    }
}

impl Ended {
    /// Does one of the subsystems, whose regions are `simplices`, begin on a surface?
    pub fn begins_sliding(&self, simplices: &[Range<usize>]) -> bool {
        moves::Sequence::of(&self.result).begins_sliding(simplices)
    }
}

impl Space for Filippov<'_> {
    type Sequence = Sequence;
    type Motion = Motion;
    type Solution = Ended;

    fn propose(
        &mut self,
        source: Source,
        best: Option<&Ended>,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<Vec<Candidate>> {
        match source {
            Source::Guess => self.guess(),
            Source::Smoothing => self.smoothed(budget, control),
            Source::Samples => self.sample(best, budget),
            Source::Relaxation if !std::mem::replace(&mut self.asked_homotopy, true) => {
                Ok(vec![Candidate::new(Sequence::default(), Motion::Homotopy)])
            }
            _ => Ok(Vec::new()),
        }
    }

    fn expected(&self, source: Source) -> Option<f64> {
        let n = self.template.0.problem.n() as f64;
        match source {
            Source::Relaxation => Some(HOMOTOPY * n),
            _ => Some(PROGRAM * n),
        }
    }

    fn solve(
        &mut self,
        c: &Candidate,
        limits: Limits,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<Vec<(Sequence, Ended)>> {
        let mut watch = self.watch(limits.cost);
        let mut one = self.run(&c.motion, (&mut watch, &self.request), control)?;
        one.result = one.result.take().map(|r| r.given_up(&watch));
        let mut ended = self.ended(one, c.sequence.0, budget)?;
        if ended.rank.feasible {
            self.largest = self.largest.max(ended.result.priced.abs()).max(watch.largest_feasible);
        }
        match &c.motion {
            Motion::Moved { from, .. } => ended.before = Some(Rc::new(moves::Sequence::of(from))),
            Motion::Homotopy => {
                ended.rank.feasible &= ended.result.polish == Polish::Done;
                ended.homotopy = true;
            }
            _ => {}
        }
        // what costs as much may be known to be an optimum where the best is not
        let dear = ended.rank.cost > limits.cost + SAME * limits.cost.abs();
        if !ended.homotopy && (dear || !ended.rank.feasible) {
            // what is no candidate for the best keeps its result alone
            let one = &mut *ended.one.borrow_mut();
            (one.built, one.engine) = (None, None);
        }
        Ok(vec![(ended.sequence.clone(), ended)])
    }

    fn rank(&self, s: &Ended) -> Rank {
        Rank { rounding: f64::EPSILON * self.largest, ..s.rank }
    }

    /// Says whether the controls of a solution lead to it, and whether it is a local optimum. What touches a surface that it does not cross is replaced
    /// by what keeps clear of it.
    fn verify(&mut self, s: &mut Ended, budget: &mut Budget, control: &mut Control) -> Result<()> {
        self.use_idle(s, budget, control)?;
        s.verified = true;
        let mut simulated = s.one.borrow_mut().simulated(&self.request)?;
        let elsewhere = s.one.borrow_mut().leads_elsewhere()?;
        let mut follows = !elsewhere && simulated.as_ref().is_none_or(Accuracy::follows);
        if !follows || s.one.borrow().dips() {
            let one = s.one.clone();
            let mut spent = Vec::new();
            let clear =
                one.borrow().keep_clear(&self.request, &mut |r| spent.push((r.dimensions.0, r.stats)), control)?;
            spent.iter().for_each(|(n, stats)| budget.solved(*n, stats));
            if let Some(mut clear) = clear {
                let again = clear.simulated(&self.request)?;
                let cost = |one: &Ocp, a: &Option<Accuracy>| a.as_ref().map_or(f64::INFINITY, |a| one.cost_in(a));
                if !follows || cost(&clear, &again) < cost(&one.borrow(), &simulated) {
                    let r = clear.last_result()?.clone();
                    s.rank = r.rank(r.priced, self.largest);
                    (s.result, s.one) = (Rc::new(r), Rc::new(RefCell::new(clear)));
                    (follows, simulated) = (true, again);
                }
            }
        }
        let Some(o) = s.one.borrow_mut().judged()? else { return Ok(()) };
        let one = s.one.borrow();
        let costs = simulated.filter(|_| one.costs_compare()).map(|a| one.cost_in(&a));
        drop(one);
        s.rank.contradicted = !follows || costs.is_some_and(|c| !agree(c, s.result.priced));
        s.rank.cost = costs.unwrap_or(s.result.priced);
        self.descend(s, &o, budget)?;
        let optimum = |v: Verdict| matches!(v, Verdict::LocalOptimum | Verdict::Kink);
        s.certified = optimum(o.verdict) || s.still.is_some_and(optimum);
        Ok(())
    }

    /// Where descents on simulations lead, the same on finer grids where simulations contradict it, and sequences with switches in other stages and
    /// without short phases. Nothing next to a local optimum is better near by.
    fn neighbours(&self, s: &Ended) -> (Vec<Neighbour<Sequence>>, Motion) {
        if s.result.outcome == Outcome::Failed {
            return (Vec::new(), Motion::Homotopy);
        }
        let mut beside = BTreeMap::new();
        let mut out: Vec<Neighbour<Sequence>> = Vec::new();
        let mut add = |sequence: Sequence, motion: Motion, promise: f64, kind: usize, is_local: bool| {
            if sequence != s.sequence && !beside.contains_key(&sequence) {
                beside.insert(sequence.clone(), motion);
                out.push(Neighbour { sequence, promise, kind, is_local });
            }
        };
        // a finer grid is for what simulations do not confirm
        let own = if s.rank.contradicted || s.homotopy && !s.rank.feasible {
            self.along(&s.result, NEAR, true).ok().flatten()
        } else {
            None
        };
        let below = s.lower.iter().map(|p| (p, 0, -1.0));
        for (p, kind, promise) in below.chain(own.iter().map(|p| (p, 1, 0.0))) {
            for elements in [1, FINER[0], FINER[1]] {
                let p = p.in_room(Room { elements, ..p.room });
                let promise = if elements == 1 { promise } else { 0.0 };
                add(self.key(&p), Motion::Traced(p), promise, kind, !s.certified);
            }
        }
        if s.homotopy && s.result.polish != Polish::Done {
            // it has no exact phases
            return (out, Motion::Beside(Rc::new(beside)));
        }
        let now = moves::Sequence::of(&s.result);
        let sizes = Rc::new(s.one.borrow().sizes.clone());
        let further = s.before.as_ref().and_then(|before| now.beyond(before));
        let next = now.neighbours(&self.groups, &self.across).into_iter().map(|s| (3, s));
        for (kind, to) in further.map(|s| (2, s)).into_iter().chain(next) {
            let sequence = (1, to.sets());
            let motion = Motion::Moved { from: s.result.clone(), sizes: sizes.clone(), to: Rc::new(to) };
            add(sequence, motion, 0.0, kind, !s.certified);
        }
        (out, Motion::Beside(Rc::new(beside)))
    }

    fn moved(&self, _: &Ended, motion: &Motion, to: &Sequence) -> Motion {
        match motion {
            Motion::Beside(all) => all.get(to).cloned().unwrap_or(Motion::Homotopy),
            other => other.clone(),
        }
    }
}

/// A candidate that leads nowhere.
fn nothing() -> Candidate {
    Candidate { sequence: Sequence::default(), motion: Motion::Homotopy, promise: f64::INFINITY }
}

/// The discretised problem at its starting point, and that as an answer.
fn template(
    ocp: &Ocp,
    known: &Sizes,
    options: &SolveOptions,
    control: &mut Control,
) -> Result<(Box<Built>, OcpResult)> {
    let mut own = ocp.blank();
    own.build(Start::Cold, options)?;
    let Some(mut built) = own.built.take() else {
        return Err(Error::Internal("the problem was not built".into()));
    };
    let stage_params = own.prepare(&mut built)?;
    built.set_sizes(known);
    let (w0, _) = own.starting_point(&mut built.problem, &built.extended, &stage_params, options, control)?;
    let (n, m) = (built.problem.n(), built.problem.m());
    let start = Solution { x: w0, y: vec![0.0; m], z: vec![0.0; n], ..built.solver.solution().clone() };
    built.solver.restore(&start);
    let r = own.read(&mut built.problem, &start, &built.extended, &stage_params);
    Ok((built, r))
}
