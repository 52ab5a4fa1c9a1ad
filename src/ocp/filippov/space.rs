//! What is searched where modes follow from the state: sequences of active sets of Filippov systems, their programs, those next to one.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ops::Range;
use std::rc::Rc;

use crate::dcs::{Across, Dcs};
use crate::error::{Error, Result};
use crate::fesd::Sizes;
use crate::mpcc::{Polish, Solution};
use crate::nlp::{Control, Nlp, Outcome};
use crate::ocp::accuracy::Accuracy;
use crate::ocp::candidates::agree;
use crate::ocp::moves;
use crate::ocp::optimality::{Verdict, OTHER};
use crate::ocp::request::Request;
use crate::ocp::sequence::{Room, Traced, ROUGH};
use crate::ocp::smoothing::Smoother;
use crate::ocp::solve::{Built, Start};
use crate::ocp::{Ocp, OcpResult};
use crate::search::{self, watched, Budget, EarlyTermination, Limits, Neighbour, Patience, Rank, Source, Space};
use crate::settings::OcpStart;
use crate::sim::SolveOptions;
use crate::stop;

/// A sequence as it is remembered: the active sets of the phases of every stage. That of the homotopy, which has none before it has ended, is empty.
pub(super) type Sequence = Vec<Vec<Vec<bool>>>;

/// What the program of a sequence begins with.
#[derive(Clone)]
pub(super) enum Motion {
    /// The homotopy from the guess of the problem.
    Homotopy,
    /// A simulation of the controls of an answer.
    Traced(Rc<Path>),
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
    /// Is it what the homotopy ended at?
    pub homotopy: bool,
    /// Do derivatives say that it is a local optimum?
    pub certified: bool,
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
    /// An answer that is known, the first motion of all and the only one of smoothed problems, and how much of its simulation is kept.
    known_answer: Option<(Box<OcpResult>, Room)>,
    guessed: bool,
    largest: f64,
    /// Ladders of smoothed problems that are left.
    pub ladders: usize,
    /// Seconds to build problems.
    pub time_build: f64,
}

impl<'a> Filippov<'a> {
    pub fn new(
        ocp: &'a Ocp,
        known_answer: Option<(Box<OcpResult>, Room)>,
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
            known_answer,
            guessed: false,
            largest: 0.0,
            ladders: usize::MAX,
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
        self.ocp.phases_along(&p.from, (&p.traced, p.room), &self.dcs).sets()
    }

    fn candidate(&self, path: Rc<Path>) -> Candidate {
        Candidate::new(self.key(&path), Motion::Traced(path))
    }

    /// The simulation of the answer that is known, or of the guess.
    fn guess(&mut self) -> Result<Option<Candidate>> {
        if std::mem::replace(&mut self.guessed, true) {
            return Ok(None);
        }
        let path = match &self.known_answer {
            Some((answer, room)) => self.along(answer, *room, true)?,
            None => {
                let controls = self.ocp.control_guess();
                let from = OcpResult { control_ends: controls.clone(), controls, ..self.template.1.clone() };
                self.along(&from, ROUGH, true)?
            }
        };
        Ok(path.map(|p| self.candidate(p)))
    }

    /// The next ladder of smoothed problems: simulations of the controls that it ends at, the narrowest problem first.
    fn smoothed(&mut self, budget: &mut Budget, control: &mut Control) -> Result<Vec<Candidate>> {
        if self.smoother.is_none() {
            self.smoother = Some(self.ocp.smoother(&self.known, &self.request, control)?);
        }
        while let Some(Some(smoother)) = self.smoother.as_mut().filter(|_| self.ladders > 0) {
            self.ladders -= 1;
            // what descents ended at is where they led, and no plan
            let plans = self.known_answer.as_ref().is_some_and(|(_, room)| !room.lowest);
            let answers = if plans { smoother.plan_ladder(control) } else { smoother.next_ladder(control) };
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
        let next = self.ended(one, budget)?;
        if next.rank.feasible && !next.result.has_idle() && agree(next.result.priced, s.result.priced) {
            *s = Ended { before: s.before.take(), ..next };
        }
        Ok(())
    }

    fn watch(&self, cost: f64) -> EarlyTermination {
        EarlyTermination::new(cost, Patience::usual(usize::MAX), self.request.options.solver.tol)
    }

    /// What a program ended at.
    fn ended(&mut self, one: Box<Ocp>, budget: &mut Budget) -> Result<Ended> {
        let r = one.last_result()?;
        budget.solved(r.dimensions.0, &r.stats);
        self.time_build += r.time_build;
        let s = moves::Sequence::of(r);
        let mut rank = r.rank(r.priced, self.largest);
        if r.outcome == Outcome::Failed {
            rank.violation = f64::INFINITY;
        }
        Ok(Ended {
            sequence: s.sets(),
            rank,
            result: Rc::new(r.clone()),
            before: None,
            homotopy: false,
            certified: false,
            one: Rc::new(RefCell::new(one)),
        })
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
        _: Option<&Ended>,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<Vec<Candidate>> {
        match source {
            Source::Guess => Ok(self.guess()?.into_iter().collect()),
            Source::Smoothing => self.smoothed(budget, control),
            Source::Relaxation if !std::mem::replace(&mut self.asked_homotopy, true) => {
                Ok(vec![Candidate::new(Sequence::default(), Motion::Homotopy)])
            }
            _ => Ok(Vec::new()),
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
        let mut ended = self.ended(one, budget)?;
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
        if !ended.homotopy && (ended.rank.cost > limits.cost || !ended.rank.feasible) {
            // what is no candidate for the best keeps its result alone
            let one = &mut *ended.one.borrow_mut();
            (one.built, one.engine) = (None, None);
        }
        Ok(vec![(ended.sequence.clone(), ended)])
    }

    fn rank(&self, s: &Ended) -> Rank {
        Rank { rounding: f64::EPSILON * self.largest, ..s.rank }
    }

    /// Says whether the controls of a solution lead to it, and whether it is a local optimum by its derivatives. What touches a surface that it does not
    /// cross is replaced by what keeps clear of it.
    fn verify(&mut self, s: &mut Ended, budget: &mut Budget, control: &mut Control) -> Result<()> {
        self.use_idle(s, budget, control)?;
        let mut simulated = s.one.borrow_mut().simulated(&self.request)?;
        let judged = s.one.borrow_mut().judged()?;
        let elsewhere = judged.as_ref().is_some_and(|o| o.reason == OTHER);
        // the derivatives of what is held at a surface may be those of one side
        let one_sided = judged.is_some_and(|o| o.verdict == Verdict::NotOptimal);
        let mut follows = !elsewhere && simulated.as_ref().is_none_or(Accuracy::follows);
        if !follows || one_sided || s.one.borrow().dips() {
            let one = s.one.clone();
            let mut spent = Vec::new();
            let clear =
                one.borrow().keep_clear(&self.request, &mut |r| spent.push((r.dimensions.0, r.stats)), control)?;
            spent.iter().for_each(|(n, stats)| budget.solved(*n, stats));
            if let Some(mut clear) = clear {
                let again = clear.simulated(&self.request)?;
                let cost = |one: &Ocp, a: &Option<Accuracy>| a.as_ref().map_or(f64::INFINITY, |a| one.cost_in(a));
                let [other, own] = [cost(&clear, &again), cost(&one.borrow(), &simulated)];
                let certain = one_sided && agree(other, own) && clear.judged()?.is_some_and(|o| o.is_optimum());
                if !follows || certain || other < own {
                    let r = clear.last_result()?.clone();
                    s.rank = r.rank(r.priced, self.largest);
                    (s.result, s.one) = (Rc::new(r), Rc::new(RefCell::new(clear)));
                    (follows, simulated) = (true, again);
                }
            }
        }
        let mut one = s.one.borrow_mut();
        let Some(o) = one.judged()? else { return Ok(()) };
        let costs = simulated.filter(|_| one.costs_compare()).map(|a| one.cost_in(&a));
        s.rank.contradicted = !follows || costs.is_some_and(|c| !agree(c, s.result.priced));
        s.rank.cost = costs.unwrap_or(s.result.priced);
        s.certified = o.is_optimum();
        Ok(())
    }

    /// Sequences with switches in other stages and without short phases. Nothing next to a local optimum is better near by.
    fn neighbours(&self, s: &Ended) -> (Vec<Neighbour<Sequence>>, Motion) {
        if s.result.outcome == Outcome::Failed || s.homotopy && s.result.polish != Polish::Done {
            // it has no exact phases
            return (Vec::new(), Motion::Homotopy);
        }
        let mut beside = BTreeMap::new();
        let mut out: Vec<Neighbour<Sequence>> = Vec::new();
        let now = moves::Sequence::of(&s.result);
        let sizes = Rc::new(s.one.borrow().sizes.clone());
        let further = s.before.as_ref().and_then(|before| now.beyond(before));
        let next = now.neighbours(&self.groups, &self.across).into_iter().map(|s| (1, s));
        for (kind, to) in further.map(|s| (0, s)).into_iter().chain(next) {
            let sequence = to.sets();
            if sequence == s.sequence || beside.contains_key(&sequence) {
                continue;
            }
            let motion = Motion::Moved { from: s.result.clone(), sizes: sizes.clone(), to: Rc::new(to) };
            beside.insert(sequence.clone(), motion);
            out.push(Neighbour { sequence, promise: 0.0, kind, is_local: !s.certified });
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
