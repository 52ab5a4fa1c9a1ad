//! The loop: steps under error control, switches at their ends.

mod accumulation;
mod chatter;
mod choice;
mod contact;
mod contact_steps;
mod control;
mod derivatives;
mod flat;
mod impact;
mod jump;
mod limit_set;
mod locate;
mod made;
mod order;
mod record;
mod search;
mod selection;
mod timestepping;
mod transition;
mod units;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::Arc;
use std::time::{Duration, Instant};

use self::accumulation::Recent;
use self::chatter::Window;
use self::contact::SceneRoom;
use self::control::{Beyond, Cut, FirstStep, Pace, Tried};
use self::flat::Flat;
use self::limit_set::{Origin, Shrinking};
use self::record::Sampled;
use self::search::Found;
use super::bernstein::{Coefficients, Sampler};
use super::calendar::Calendar;
use super::explicit::Pair;
use super::field::{Apart, Field};
use super::guard::Reset;
use super::path::Path;
use super::radau::Radau;
use super::sens::Sens;
use super::sets;
use super::step::Step;
use super::tape::Tape;
use super::watch::Watch;
use super::{Accumulation, Arbiter, Branching, Contact, Decider};
use super::{Impact, Jump, Method, Options, Outcome, Phase, Run, Statistics, Switch};
use crate::error::{finite, Error, Result};
use crate::func::{trouble, EvalError};
use crate::memory;
use crate::stop;
use crate::system::Mechanics;

/// Rounding.
const EPS: f64 = f64::EPSILON;
/// A time, relative to the run so far and what is left of it, in which nothing happens: the square of it is beyond
/// rounding.
const NO_TIME: f64 = 1e-11;
/// What a call of [`Engine::step`] did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Progress {
    /// A step inside of a mode.
    Stepped,
    /// A step that ends at a switch.
    Switched,
    /// Nothing: the time asked for is reached, or the simulation has ended before; see [`Engine::outcome`].
    Done,
}

/// An event-driven simulation, step by step. Memory is allocated when it is made; switches and dense output are
/// appended to lists.
///
/// The vocabulary is that of SUNDIALS: [`Engine::reinit`], [`Engine::step`], [`Engine::advance`],
/// [`Engine::get_dky`].
pub struct Engine {
    options: Options,
    nx: usize,
    rtol: Vec<f64>,
    atol: Vec<f64>,
    field: Field,
    step: Step,
    /// Active sets of the last step.
    step_sets: Vec<Vec<usize>>,
    step_implicit: bool,
    dense_ready: bool,
    radau: Radau,
    /// The pair of the present step, of the next one, and that of the tolerance.
    pair: Pair,
    next_pair: Pair,
    usual_pair: Pair,
    /// See [`Engine::note_end`].
    cut: Cut,
    /// Error of the last attempt relative to the tolerance.
    tried: f64,
    /// Weights of the second of two cells of every subsystem at the start of the last step; NaN where it did not slide.
    last_weights: Vec<f64>,
    implicit: bool,
    /// How fast modes turned out to be, by cell; the last entry is for a system without cells.
    stiff: Vec<Pace>,
    /// Is the present mode stiff?
    stiff_mode: bool,
    /// Subsystems that were stiff when they slid.
    stiff_slides: Vec<bool>,
    stiff_steps: usize,
    /// See [`explicit::stiffness`](super::explicit::stiffness), of the last step that was looked at.
    stiffness: f64,
    damped: bool,
    mild_steps: usize,
    sampler: Sampler,
    samples: Vec<Coefficients>,
    watches: Vec<Watch>,
    /// Those that are looked at in the present step.
    looked: Vec<usize>,
    /// Those whose contacts are to be sampled, by contact.
    wanted: Vec<bool>,
    /// Memory for events of contacts.
    scene: SceneRoom,
    /// Order of the zero that a watched function has at the start of the step.
    depart: Vec<u8>,
    w0: Vec<f64>,
    w1: Vec<f64>,
    suspect: Vec<bool>,
    /// Those among [`Engine::looked`].
    suspects: Vec<usize>,
    /// The first zeros of all of these in the step: watch, relative time, rate.
    zeros: Vec<(usize, f64, f64)>,
    /// What happens in the step unit by unit, where the model can be taken apart.
    calendar: Option<Box<Calendar>>,
    /// Zero to rounding over the whole of the last step.
    resting: Vec<bool>,
    q0: Vec<f64>,
    q1: Vec<f64>,
    dq0: Vec<f64>,
    dq1: Vec<f64>,
    zero: Vec<bool>,
    set: Vec<usize>,
    /// Memory for decisions, for candidates, for active sets.
    apart: Apart,
    candidates: Vec<Vec<usize>>,
    /// Subsystems that the present switch does not touch, where that is known.
    kept: Vec<bool>,
    keeps: bool,
    /// Do bounds that contacts were left out for say nothing?
    passes_bounds: bool,
    /// When what is watched vanishes next, as far as is known, see [`Engine::time_to_switch`]: by indicator, then by cell.
    due: Vec<f64>,
    guesses: usize,
    /// Ends the present step a little behind where a switch is expected, see [`Engine::time_to_first_switch`]?
    foreseen: bool,
    /// What vanishes there, by the place of its indicator, from when on that was expected, and after which time; and of every indicator the
    /// part of that time after which it came the last time.
    expected: Option<(usize, f64, f64)>,
    late: Vec<f64>,
    /// Of every cell the function whose sign excluded it last.
    ruled_out: Vec<usize>,
    before: Vec<Vec<usize>>,
    /// The velocity is that at the present point under the active set before a switch.
    arrived: bool,
    /// It has been evaluated there already, with what is watched.
    known_end: bool,
    weights: Vec<f64>,
    node: Vec<f64>,
    t: f64,
    x: Vec<f64>,
    f: Vec<f64>,
    /// The velocity before the last switch.
    f_before: Vec<f64>,
    h: f64,
    /// First steps behind switches, by the cell that follows, and that of the last switch.
    first_steps: Vec<FirstStep>,
    entered: Option<usize>,
    err_before: f64,
    /// How coarse the last step was, see [`Engine::resolution`].
    coarse: f64,
    /// Length of the implicit step whose dense output was looked at last, and whether that of the present one was.
    clear: f64,
    clears: bool,
    /// Algebraic variables at the start and at the end of a step.
    alpha_start: Vec<f64>,
    alpha_end: Vec<f64>,
    /// The step is the first one under its active set.
    fresh: bool,
    /// Steps under it without a switch, see [`Engine::come_to_rest`].
    slid: usize,
    /// The active set has to be found before the next step.
    restart: bool,
    recent: Recent,
    shrinking: Shrinking,
    /// When a limit set was entered last, and how often without time between.
    limits: (f64, usize),
    /// The next active set is the one behind an accumulation.
    behind: bool,
    /// Passages of [`Zeno::TimeStepping`](super::Zeno) one soon after the other.
    passages: i32,
    /// Work of all passages, see [`Engine::step_through`].
    passage_work: f64,
    /// From where to where the last of them went.
    passage: (f64, f64),
    /// Where the run began, and where the present call ends.
    t_start: f64,
    t_stop: f64,
    /// Progress lately, see [`Engine::chatters`].
    window: Window,
    crowd: usize,
    /// Since when there were impacts without time between them, and how many.
    burst: (f64, usize),
    /// A contact in the step that is looked at.
    touched: Option<Contact>,
    /// The relative time in the last step at which something touches zero without being crossed, to what the tolerances see.
    grazed: f64,
    /// Complaints of functions before the present step.
    heard: usize,
    outcome: Outcome,
    reason: String,
    switches: Vec<Switch>,
    jumps: Vec<Jump>,
    impacts: Vec<Impact>,
    /// Contact modes with controls and parameters, from times on, for forces afterwards.
    phases: Vec<Phase>,
    branchings: Vec<Branching>,
    contacts: Vec<Contact>,
    accumulations: Vec<Accumulation>,
    decider: Option<Decider>,
    arbiter: Option<Arbiter>,
    stats: Statistics,
    path: Option<Path>,
    sampled: Sampled,
    sens: Option<Sens>,
    tape: Option<Tape>,
    /// States that only transitions move.
    discrete: Vec<usize>,
    /// The last transition made.
    reset: Reset,
    /// The last call was ended between transitions of one time.
    unmade: bool,
    /// Derivatives of the time of a switch.
    time_row: Vec<f64>,
    /// What the zero that the last step ended at was like, if it was of higher order.
    flat: Option<Flat>,
    /// Of every indicator, where it vanished last with a zero of higher order: signs of values up to this one mean nothing there.
    levels: Vec<f64>,
    /// Room for products with a Jacobian, and what they said last of the longest step for derivatives, at which step.
    powers: [Vec<f64>; 3],
    nonzero: Vec<(usize, usize, f64)>,
    variational: (f64, usize),
    /// Looks in a row at which stability allowed much less than the state wanted.
    held_back: usize,
    one_sided: bool,
    /// Had it a choice: did several active sets continue the motion somewhere?
    ambiguous: bool,
    interrupt: Option<Arc<AtomicBool>>,
    polls: Polls,
    /// The last step was not begun for lack of memory.
    refused: bool,
}

/// Switches of one step at most, usually.
const SWITCHES: usize = 8;
/// An implicit step so much longer than another is looked at on its own.
const SHORTER: f64 = 8.0;
/// Asked now and then while a call runs; `false` ends it.
pub type Poll = Box<dyn FnMut() -> bool + Send>;

/// From one question to the next: at once for a person, and long compared with what a callback costs.
const POLL: Duration = Duration::from_millis(10);

/// Whether a call is to go on.
struct Polls {
    ask: Option<Poll>,
    next: Instant,
    to_end: bool,
}

impl Polls {
    fn begin(&mut self) {
        (self.to_end, self.next) = (false, Instant::now() + POLL);
    }

    fn is_to_end(&mut self) -> bool {
        if let Some(ask) = self.ask.as_mut().filter(|_| !self.to_end && Instant::now() >= self.next) {
            self.to_end = !ask();
            self.next = Instant::now() + POLL;
        }
        self.to_end
    }
}

/// Shorter logs grow as they will.
const LONG_LOG: usize = 1024;

impl Engine {
    /// Sets the controls, constant from now on. The active set is found anew.
    pub fn set_controls(&mut self, u: &[f64]) -> Result<()> {
        finite("control", u, self.field.u.len())?;
        self.save_dense()?;
        self.field.u.copy_from_slice(u);
        self.field.forget();
        self.restart = true;
        if let Some(tape) = &mut self.tape {
            tape.set_data(&self.field);
        }
        Ok(())
    }

    /// Sets the parameters. The active set is found anew.
    pub fn set_params(&mut self, p: &[f64]) -> Result<()> {
        finite("parameter", p, self.field.p.len())?;
        self.save_dense()?;
        self.field.p.copy_from_slice(p);
        self.field.forget();
        self.restart = true;
        if let Some(tape) = &mut self.tape {
            tape.set_data(&self.field);
        }
        Ok(())
    }

    /// Decides where the continuation is not unique, instead of the rule of the options.
    pub fn set_decider(&mut self, decider: Option<Decider>) {
        self.decider = decider;
    }

    /// Is asked where the conditions (6.19) have no regular solution: singular matrices, infinitely many weights.
    /// Without one the run stops there.
    pub fn set_arbiter(&mut self, arbiter: Option<Arbiter>) {
        self.arbiter = arbiter;
    }

    /// Who is asked about every hundredth of a second whether a call is to go on: by [`Engine::is_to_end`], and between the transitions of one
    /// time, of which there may be many. What asked before is given back.
    pub fn set_poll(&mut self, poll: Option<Poll>) -> Option<Poll> {
        std::mem::replace(&mut self.polls.ask, poll)
    }

    /// A call begins.
    pub fn begin_polls(&mut self) {
        self.polls.begin();
    }

    /// Is the call to end? Asks, if it is time to.
    pub fn is_to_end(&mut self) -> bool {
        self.polls.is_to_end()
    }

    /// Was the call ended between transitions of one time? The next one goes on with those that are left.
    pub fn is_unmade(&self) -> bool {
        self.unmade
    }

    /// A flag another thread may raise: the call that runs ends with [`Error::Interrupted`] after the step.
    pub fn set_interrupt(&mut self, flag: Arc<AtomicBool>) {
        self.interrupt = Some(flag);
    }

    /// Time reached.
    pub fn time(&self) -> f64 {
        self.t
    }

    /// State reached.
    pub fn state(&self) -> &[f64] {
        &self.x
    }

    /// Derivative of the state under the present active set.
    pub fn derivative(&self) -> &[f64] {
        &self.f
    }

    /// How the simulation stands.
    pub fn outcome(&self) -> Outcome {
        self.outcome
    }

    /// Why it ended early, in words.
    pub fn reason(&self) -> &str {
        &self.reason
    }

    /// The switches so far.
    pub fn switches(&self) -> &[Switch] {
        &self.switches
    }

    /// The transitions so far.
    pub fn jumps(&self) -> &[Jump] {
        &self.jumps
    }

    /// The impacts so far.
    pub fn impacts(&self) -> &[Impact] {
        &self.impacts
    }

    /// The equations of motion, if the system is a scene.
    pub fn mechanics(&self) -> Option<Arc<Mechanics>> {
        self.field.scene().map(|c| c.dynamics.mechanics.clone())
    }

    /// The contact modes so far, as they followed each other.
    pub fn phases(&self) -> &[Phase] {
        &self.phases
    }

    /// Points with several continuations so far.
    pub fn branchings(&self) -> &[Branching] {
        &self.branchings
    }

    /// Surfaces only touched so far.
    pub fn contacts(&self) -> &[Contact] {
        &self.contacts
    }

    /// Accumulating switches so far.
    pub fn accumulations(&self) -> &[Accumulation] {
        &self.accumulations
    }

    /// Dense output so far, if the options ask for it.
    pub fn path(&self) -> Option<&Path> {
        self.path.as_ref()
    }

    /// Active modes of a subsystem; empty before the first step.
    pub fn active(&self, subsystem: usize) -> Vec<usize> {
        if self.field.active.get(subsystem).is_none_or(|a| a.is_empty()) {
            return Vec::new();
        }
        self.field.modes(subsystem)
    }

    /// Cells of all subsystems that were active in the last step.
    pub(crate) fn cells_of_step(&self) -> impl Iterator<Item = usize> + '_ {
        self.step_sets.iter().flatten().copied()
    }

    /// Work so far.
    pub fn stats(&self) -> Statistics {
        Statistics {
            evaluations: self.field.counts.values,
            jacobians: self.field.counts.jacobians,
            entries: self.field.counts.entries,
            newton: self.radau.newton,
            factorisations: self.radau.factorisations,
            ..self.stats
        }
    }

    /// The result so far.
    pub fn into_run(mut self) -> Run {
        self.take_run()
    }

    /// The result so far, taken out: [`Engine::reinit`] begins the next run with the memory of this one.
    pub fn take_run(&mut self) -> Run {
        let fresh = self.path.is_some().then(|| Path::new(self.nx));
        Run {
            outcome: self.outcome,
            stats: self.stats(),
            one_sided: self.one_sided(),
            sensitivity: self.sensitivity().map(<[f64]>::to_vec),
            reason: std::mem::take(&mut self.reason),
            t: self.t,
            x: self.x.clone(),
            switches: std::mem::take(&mut self.switches),
            jumps: std::mem::take(&mut self.jumps),
            impacts: std::mem::take(&mut self.impacts),
            phases: std::mem::take(&mut self.phases),
            mechanics: self.mechanics(),
            branchings: std::mem::take(&mut self.branchings),
            contacts: std::mem::take(&mut self.contacts),
            accumulations: std::mem::take(&mut self.accumulations),
            path: std::mem::replace(&mut self.path, fresh),
        }
    }

    /// Integrates to time `t`. Time and state are those at the end, or where the simulation ended before.
    pub fn advance(&mut self, t: f64) -> Result<Outcome> {
        let mut progress = self.step(t)?;
        while progress != Progress::Done {
            progress = self.step(t)?;
        }
        Ok(self.outcome)
    }

    /// Did the last step fail before it was begun, for lack of memory? Then the next one may be tried again.
    pub fn was_refused(&self) -> bool {
        self.refused
    }

    /// Makes room for what the next step adds to dense output and tape. An error leaves everything as it is.
    fn check_memory(&mut self) -> Result<()> {
        memory::check()?;
        if self.switches.len() >= LONG_LOG {
            memory::reserve(&mut self.switches, SWITCHES)?;
        }
        if self.jumps.len() >= LONG_LOG {
            memory::reserve(&mut self.jumps, SWITCHES)?;
        }
        let mut bytes = self.switches.len() * size_of::<Switch>() + self.jumps.len() * Jump::bytes(self.nx);
        if let Some(p) = &mut self.path {
            p.room()?;
            bytes += p.bytes();
        }
        if let Some(t) = &mut self.tape {
            let traced = self.field.n_traced();
            t.room(self.nx + self.field.n_alg().max(traced) + self.field.n_z)?;
            bytes += t.bytes();
        }
        match self.options.max_memory {
            most if most != 0 && bytes > most => Err(Error::Library(format!(
                "t = {}: the results of the simulation take {bytes} bytes, and the option max_memory allows {most}: raise \
                 it, leave out dense output or the record for adjoints, or simulate in parts",
                self.t
            ))),
            _ => Ok(()),
        }
    }

    /// Does one step, not beyond `t_stop`.
    pub fn step(&mut self, t_stop: f64) -> Result<Progress> {
        let progress = self.step_inner(t_stop)?;
        if let Some(tape) = self.tape.as_mut().filter(|_| self.t == t_stop) {
            tape.stop(t_stop);
        }
        Ok(progress)
    }

    fn step_inner(&mut self, t_stop: f64) -> Result<Progress> {
        if !t_stop.is_finite() {
            finite("time", &[t_stop], 1)?;
        }
        if t_stop < self.t {
            return Err(Error::Range(format!("time {t_stop} lies behind: {} is reached", self.t)));
        }
        self.t_stop = t_stop;
        self.heard = trouble::count();
        if self.interrupt.as_ref().is_some_and(|f| f.load(Ordering::Relaxed)) {
            return Err(Error::Interrupted);
        }
        stop::check()?;
        if self.unmade && !self.restart && self.outcome == Outcome::Reached {
            return self.make_rest();
        }
        if self.outcome != Outcome::Reached || self.t == t_stop {
            return Ok(Progress::Done);
        }
        self.refused = true;
        self.check_memory()?;
        self.refused = false;
        if self.restart {
            self.begin(t_stop)?;
            if self.outcome != Outcome::Reached {
                return Ok(Progress::Done);
            }
            if self.restart || self.unmade {
                // gone through by steps, or ended on the way
                return Ok(Progress::Switched);
            }
        }
        if t_stop - self.t <= 8.0 * EPS * t_stop.abs() {
            return Ok(self.coast(t_stop));
        }
        if self.pair != self.next_pair {
            self.pair = self.next_pair;
            self.variational = (f64::INFINITY, 0);
        }
        let mut longest = self.variational_step()?.min(self.options.h_max);
        if self.is_cut_short() {
            longest = longest.min(self.time_to_switch().max(self.no_time()));
        }
        self.foreseen = false;
        if self.may_look_ahead() {
            let time = self.time_to_first_switch()?.max(self.no_time());
            self.foreseen = time < longest.min(self.h);
            longest = longest.min(time);
        }
        self.follow_sharpness();
        self.prepare_step();
        if self.h <= 64.0 * EPS * self.t.abs() {
            // what was left of the way to the last stop says nothing about the way to the next
            self.h = self.no_time();
        }
        let mut rejected = false;
        let mut beyond = Beyond::default();
        loop {
            if self.stats.steps + self.stats.rejections >= self.options.max_steps {
                let text = format!("{} steps were not enough to reach {t_stop}", self.options.max_steps);
                return Ok(self.fail(Outcome::MaxSteps, text));
            }
            if let Some(p) = self.chatters()? {
                return Ok(p);
            }
            let left = t_stop - self.t;
            let wanted = self.h.min(longest);
            let last = wanted >= 0.99 * left;
            self.step.h = if last { left } else { wanted };
            if self.step.h <= 4.0 * EPS * self.t.abs() && !last {
                if left <= self.no_time() {
                    return Ok(self.coast(t_stop));
                }
                if let Some(p) = self.reach_surface()? {
                    return Ok(p);
                }
                let before = self.field.active.clone();
                if let Some(p) = self.rescue(&before, Origin::Outside)? {
                    self.h = self.no_time();
                    return Ok(p);
                }
                if let Some(p) = self.go_through(&before, false)? {
                    return Ok(p);
                }
                let text = "the step became shorter than rounding: the solution grows without bound, a function is \
                            not defined ahead, or the tolerances are too small";
                return Ok(self.fail(Outcome::StepTooSmall, text.into()));
            }
            let t1 = if last { t_stop } else { self.t + self.step.h };
            match self.attempt()? {
                Tried::Error(err) if err <= 1.0 => {
                    if !self.finish()? {
                        self.reject(&mut rejected, 0.25);
                        continue;
                    }
                    let found = self.search(t1)?;
                    let grown = self.grown(err.max(self.coarse), rejected);
                    match found {
                        Some(Found::Nothing) => {
                            self.err_before = err.max(1e-4);
                            self.note_first_step(grown, rejected);
                            self.accept(t1)?;
                            if t1 < t_stop {
                                self.note_end(false);
                            }
                            self.h = grown;
                            return Ok(self.come_to_rest()?.unwrap_or(Progress::Stepped));
                        }
                        Some(Found::Zero(l, s, slope)) => {
                            if let Some(p) = self.follow_units(t1, grown)? {
                                return Ok(p);
                            }
                            let entered = self.entered.take();
                            if let Some(cell) = entered {
                                self.first_steps[cell].allow(self.step.h);
                            }
                            if let Some(p) = self.land(l, s, slope, grown)? {
                                return Ok(p);
                            }
                            self.entered = entered;
                            self.note_failed_landing();
                            self.reject(&mut rejected, 0.5);
                        }
                        Some(Found::Coarse(e)) => self.reject(&mut rejected, (0.9 * e.powf(-0.25)).clamp(0.1, 0.9)),
                        None => self.reject(&mut rejected, 0.5),
                    }
                }
                Tried::Error(_) if self.is_beyond_stability(&mut beyond)? => {
                    self.turn_stiff();
                    self.step_implicit = true;
                    rejected = true;
                    self.stats.rejections += 1;
                    self.h = beyond.longest;
                }
                Tried::Error(err) => {
                    let factor = self.shrunk(err);
                    self.reject(&mut rejected, factor);
                }
                // stage points of an implicit method lie on the surfaces
                Tried::Undefined if self.may_turn_implicit() => (self.implicit, self.step_implicit) = (true, true),
                Tried::Undefined => self.reject(&mut rejected, 0.25),
                Tried::Diverged => self.reject(&mut rejected, 0.35),
            }
        }
    }

    /// Goes along the velocity for a time that no step fits into.
    fn coast(&mut self, t_stop: f64) -> Progress {
        let left = t_stop - self.t;
        if let Some(p) = self.path.as_mut().filter(|_| left > 0.0) {
            p.push_line(self.t, t_stop, &self.x, &self.f);
        }
        self.x.iter_mut().zip(&self.f).for_each(|(x, f)| *x += left * f);
        self.t = t_stop;
        self.h = self.h.max(self.no_time());
        if let Some(tape) = &mut self.tape {
            tape.move_end(t_stop);
        }
        Progress::Done
    }

    /// A time in which nothing happens: relative to the length of the run, and at least rounding of the time.
    fn no_time(&self) -> f64 {
        (NO_TIME * (self.t_stop - self.t_start)).max(16.0 * EPS * self.t.abs())
    }

    /// Ends the run; where a function that is not defined may be the cause, its last complaint is part of the reason.
    fn fail(&mut self, outcome: Outcome, reason: String) -> Progress {
        self.outcome = outcome;
        self.reason = format!("t = {}: {reason}", self.t);
        if let (Outcome::StepTooSmall, Some(cause)) = (outcome, self.cause_of_short_steps()) {
            self.reason = format!("{}; {cause}", self.reason);
        }
        if matches!(outcome, Outcome::StepTooSmall | Outcome::NoContinuation) {
            if let Some(complaint) = trouble::last_after(self.heard) {
                self.reason = format!("{}; last complaint: {complaint}", self.reason);
            }
        }
        Progress::Done
    }

    /// Slides an explicit pair that an implicit method may take over from?
    fn may_turn_implicit(&self) -> bool {
        !self.implicit
            && self.options.method == Method::Auto
            && self.field.n_alg() > 0
            && !self.field.is_explicit_only()
    }

    fn reject(&mut self, rejected: &mut bool, factor: f64) {
        *rejected = true;
        self.stats.rejections += 1;
        self.h = self.step.h * factor;
    }

    /// The step begins at the present state.
    fn prepare_step(&mut self) {
        self.step.t = self.t;
        let s = &mut self.step;
        for i in 0..self.nx {
            (s.x0[i], s.f0[i]) = (self.x[i], self.f[i]);
        }
        self.dense_ready = false;
        if let Some(c) = &mut self.calendar {
            c.tracks.clear();
        }
        self.radau.invalidate();
        self.step_implicit = self.implicit;
        if self.fresh || self.field.has_contacts() {
            self.radau.forget();
        }
        if self.fresh {
            sets::copy(&mut self.step_sets, &self.field.active);
        }
    }

    /// Takes the step over.
    fn accept(&mut self, t1: f64) -> Result<()> {
        if self.path.is_some() || self.sampled.are_wanted(t1) {
            self.save_dense()?;
            self.note_piece(t1);
        }
        self.differentiate_step(t1)?;
        if let Some(c) = self.touched.take() {
            if self.field.has_contacts() {
                let mut x = std::mem::take(&mut self.node);
                self.step.at((c.t - self.step.t) / self.step.h, &mut x);
                let r = self.check_gradient(c.subsystem, c.t, &x);
                self.node = x;
                r?;
            }
            self.touch(c);
        }
        self.stats.steps += 1;
        self.crowd = 0;
        if self.step_implicit {
            self.clear = if self.clears { self.step.h } else { self.clear.min(SHORTER * self.step.h) };
            self.radau.accept(&self.step, self.field.n_alg(), t1);
        }
        self.watch_stiffness();
        self.t = t1;
        for i in 0..self.nx {
            (self.x[i], self.f[i]) = (self.step.x1[i], self.step.f1[i]);
        }
        for l in 0..self.watches.len() {
            self.w0[l] = self.w1[l];
            // what is a little below zero and rises does not vanish there
            let below = self.watches[l].may_begin_below() && self.w1[l] < 0.0;
            self.depart[l] = if self.resting[l] { 2 } else { u8::from(below) };
        }
        self.fresh = false;
        if self.is_cut_short() {
            self.field.pair_weights(&self.alpha_start, &mut self.last_weights);
        }
        self.field.accept_near(&self.step, self.step_implicit);
        let moved = self.field.has_contacts() && self.settle_contacts()?;
        std::mem::swap(&mut self.alpha_start, &mut self.alpha_end);
        std::mem::swap(&mut self.q0, &mut self.q1);
        if !self.field.constant_gradients() {
            std::mem::swap(&mut self.dq0, &mut self.dq1);
        }
        if moved {
            self.q0.copy_from_slice(&self.field.q);
            for &l in &self.looked {
                self.w0[l] = self.watches[l].value(&self.q0, &self.field);
            }
        }
        Ok(())
    }
}

fn fatal(code: i32) -> Error {
    Error::User { code, what: "a function of the model".into() }
}

/// What is not defined becomes `otherwise`, a fatal code an error.
fn recover<T>(r: std::result::Result<T, EvalError>, otherwise: T) -> Result<T> {
    match r {
        Ok(v) => Ok(v),
        Err(EvalError::Recoverable) => Ok(otherwise),
        Err(EvalError::Fatal(code)) => Err(fatal(code)),
        Err(EvalError::Stopped) => Err(stop::error()),
    }
}
