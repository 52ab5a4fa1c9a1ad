//! The loop: steps under error control, switches at their ends.

mod accumulation;
mod algebraic;
mod chatter;
mod choice;
mod contact;
mod contact_steps;
mod control;
mod derivatives;
mod flat;
mod foresight;
mod impact;
mod jump;
mod limit_set;
mod locate;
mod made;
mod notes;
mod order;
mod outside;
mod parts;
mod record;
mod search;
mod selection;
mod timestepping;
mod transition;
mod units;
mod worth;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::Arc;
use std::time::{Duration, Instant};

use self::algebraic::Follower;
use self::control::{Beyond, Cut, Tried};
use self::foresight::Foresight;
use self::limit_set::Origin;
use self::notes::Notes;
use self::parts::{Calendar, ContactEvents, Derivatives, EventFunctions, Log, Stepper};
use self::search::Found;
use self::units::Followed;
use super::explicit::Pair;
use super::field::{Apart, Field};
use super::path::Path;
use super::sets;
use super::watch::Watch;
use super::{Accumulation, Arbiter, Branching, Contact, Decider};
use super::{Impact, Jump, Method, Noted, Options, Outcome, Phase, Run, Statistics, Switch};
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
/// Result of a call of [`Engine::step`].
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
    set: Vec<usize>,
    /// Memory for decisions, for candidates, for active sets.
    apart: Apart,
    candidates: Vec<Vec<usize>>,
    /// Subsystems that the present switch does not touch, where that is known.
    kept: Vec<bool>,
    keeps: bool,
    /// Of every cell the function whose sign excluded it last.
    ruled_out: Vec<usize>,
    before: Vec<Vec<usize>>,
    /// The velocity is that at the present point under the active set before a switch.
    arrived: bool,
    /// It has been evaluated there already, with what is watched.
    known_end: bool,
    t: f64,
    x: Vec<f64>,
    f: Vec<f64>,
    /// The velocity before the last switch.
    f_before: Vec<f64>,
    /// The active set has to be found before the next step.
    restart: bool,
    /// Where the run began, and where the present call ends.
    t_start: f64,
    t_stop: f64,
    decider: Option<Decider>,
    arbiter: Option<Arbiter>,
    /// States that only transitions move.
    discrete: Vec<usize>,
    /// Times at which steps end, see [`System::known_times`](crate::system::System::known_times), and how many of them are behind.
    known_times: (Vec<(f64, bool)>, usize),
    /// Transitions that note.
    notes: Option<Box<Notes>>,
    /// The states that algebraic equations determine.
    algebraic: Option<Box<Follower>>,
    /// The last call was ended between transitions of one time.
    unmade: bool,
    interrupt: Option<Arc<AtomicBool>>,
    polls: Polls,
    /// The last step was not begun for lack of memory.
    refused: bool,
    stepper: Stepper,
    functions: EventFunctions,
    foresight: Foresight,
    calendar: Calendar,
    contact_events: ContactEvents,
    log: Log,
    derivatives: Derivatives,
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
        if let Some(tape) = &mut self.derivatives.tape {
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
        if let Some(tape) = &mut self.derivatives.tape {
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

    /// Sets the function that is asked about every hundredth of a second whether a call is to go on: by [`Engine::is_to_end`], and between the transitions of one
    /// time, of which there may be many. What asked before is given back.
    pub fn set_poll(&mut self, poll: Option<Poll>) -> Option<Poll> {
        std::mem::replace(&mut self.polls.ask, poll)
    }

    /// A call begins.
    pub fn begin_polls(&mut self) {
        self.polls.begin();
    }

    /// True where the call is to end. Asks, if it is time to.
    pub fn is_to_end(&mut self) -> bool {
        self.polls.is_to_end()
    }

    /// True where the call was ended between transitions of one time. The next one goes on with those that are left.
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
        &self.x[..self.n_shown()]
    }

    /// Derivative of the state under the present active set; zero for algebraic states, see [`Engine::whole_derivative`].
    pub fn derivative(&self) -> &[f64] {
        &self.f[..self.n_shown()]
    }

    /// How the simulation stands.
    pub fn outcome(&self) -> Outcome {
        self.log.outcome
    }

    /// Why it ended early, in words.
    pub fn reason(&self) -> &str {
        &self.log.reason
    }

    /// The transition that ended the run, where one did.
    pub fn stopped_by(&self) -> Option<usize> {
        self.log.stopped_by
    }

    /// The switches so far.
    pub fn switches(&self) -> &[Switch] {
        &self.log.switches
    }

    /// The transitions so far.
    pub fn jumps(&self) -> &[Jump] {
        &self.log.jumps
    }

    /// What transitions noted so far.
    pub fn notes(&self) -> &[Noted] {
        &self.log.notes
    }

    /// The impacts so far.
    pub fn impacts(&self) -> &[Impact] {
        &self.log.impacts
    }

    /// The equations of motion, if the system is a scene.
    pub fn mechanics(&self) -> Option<Arc<Mechanics>> {
        self.field.scene().map(|c| c.dynamics.mechanics.clone())
    }

    /// The contact modes so far, as they followed each other.
    pub fn phases(&self) -> &[Phase] {
        &self.contact_events.phases
    }

    /// Points with several continuations so far.
    pub fn branchings(&self) -> &[Branching] {
        &self.log.branchings
    }

    /// Surfaces only touched so far.
    pub fn contacts(&self) -> &[Contact] {
        &self.log.contacts
    }

    /// Accumulating switches so far.
    pub fn accumulations(&self) -> &[Accumulation] {
        &self.log.accumulations
    }

    /// Dense output so far, if the options ask for it.
    pub fn path(&self) -> Option<&Path> {
        self.log.path.as_ref()
    }

    /// Active modes of a subsystem; empty before the first step.
    pub fn active(&self, subsystem: usize) -> Vec<usize> {
        let subsystem = match self.own_modes(subsystem) {
            Ok(modes) => return modes,
            Err(k) => k,
        };
        if self.field.active.get(subsystem).is_none_or(|a| a.is_empty()) {
            return Vec::new();
        }
        self.field.modes(subsystem)
    }

    /// Cells of all subsystems that were active in the last step.
    pub(crate) fn cells_of_step(&self) -> impl Iterator<Item = usize> + '_ {
        self.stepper.step_sets.iter().flatten().copied()
    }

    /// Work so far.
    pub fn stats(&self) -> Statistics {
        Statistics {
            evaluations: self.field.counts.values,
            jacobians: self.field.counts.jacobians,
            entries: self.field.counts.entries,
            newton: self.stepper.radau.newton,
            factorisations: self.stepper.radau.factorisations,
            ..self.log.stats
        }
    }

    /// The result so far.
    pub fn into_run(mut self) -> Run {
        self.take_run()
    }

    /// The result so far, taken out: [`Engine::reinit`] begins the next run with the memory of this one.
    pub fn take_run(&mut self) -> Run {
        let fresh = self.log.path.as_ref().map(Path::fresh);
        Run {
            outcome: self.log.outcome,
            stats: self.stats(),
            one_sided: self.one_sided(),
            sensitivity: self.sensitivity().map(<[f64]>::to_vec),
            reason: std::mem::take(&mut self.log.reason),
            stopped_by: self.log.stopped_by,
            t: self.t,
            x: self.state().to_vec(),
            switches: std::mem::take(&mut self.log.switches),
            jumps: std::mem::take(&mut self.log.jumps),
            notes: std::mem::take(&mut self.log.notes),
            impacts: std::mem::take(&mut self.log.impacts),
            phases: std::mem::take(&mut self.contact_events.phases),
            mechanics: self.mechanics(),
            branchings: std::mem::take(&mut self.log.branchings),
            contacts: std::mem::take(&mut self.log.contacts),
            accumulations: std::mem::take(&mut self.log.accumulations),
            path: std::mem::replace(&mut self.log.path, fresh),
        }
    }

    /// Integrates to time `t`. Time and state are those at the end, or where the simulation ended before.
    pub fn advance(&mut self, t: f64) -> Result<Outcome> {
        while self.step_on(t)? != Progress::Done {}
        Ok(self.log.outcome)
    }

    /// True where the last step failed before it was begun, for lack of memory. Then the next one may be tried again.
    pub fn was_refused(&self) -> bool {
        self.refused
    }

    /// Makes room for what the next step adds to dense output and tape. An error leaves everything as it is.
    fn check_memory(&mut self) -> Result<()> {
        memory::check()?;
        if self.log.switches.len() >= LONG_LOG {
            memory::reserve(&mut self.log.switches, SWITCHES)?;
        }
        if self.log.jumps.len() >= LONG_LOG {
            memory::reserve(&mut self.log.jumps, SWITCHES)?;
        }
        if self.log.notes.len() >= LONG_LOG {
            memory::reserve(&mut self.log.notes, SWITCHES)?;
        }
        let mut bytes = self.log.switches.len() * size_of::<Switch>() + self.log.jumps.len() * Jump::bytes(self.nx);
        bytes += self.log.notes.len() * Noted::bytes(self.nx);
        if let Some(p) = &mut self.log.path {
            p.room()?;
            bytes += p.bytes();
        }
        if let Some(t) = &mut self.derivatives.tape {
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

    /// Does one step, not beyond `t_stop`. It ends where anything switches.
    ///
    /// # Errors
    /// [`Error::Range`] for a time that lies behind or is no number, [`Error::Interrupted`], and those of the functions of the model.
    pub fn step(&mut self, t_stop: f64) -> Result<Progress> {
        self.calendar.within_steps = false;
        self.step_to(t_stop)
    }

    /// [`Engine::step`] for callers that do not look at every switch: single units of a system of many may switch in the step, which does not end for
    /// them.
    ///
    /// # Errors
    /// Those of [`Engine::step`].
    pub fn step_on(&mut self, t_stop: f64) -> Result<Progress> {
        self.calendar.within_steps = true;
        self.step_to(t_stop)
    }

    fn step_to(&mut self, t_stop: f64) -> Result<Progress> {
        let mut progress = match self.known_end(t_stop) {
            None => self.step_inner(t_stop)?,
            Some((end, at)) => {
                let progress = self.step_inner(end)?;
                self.reach_known(end, at);
                progress
            }
        };
        self.note_work();
        if progress == Progress::Done && self.t < t_stop && self.log.outcome == Outcome::Reached {
            // a known time on the way
            progress = Progress::Stepped;
        }
        if let Some(tape) = self.derivatives.tape.as_mut().filter(|_| self.t == t_stop) {
            tape.stop(t_stop);
        }
        if self.algebraic.is_some() {
            self.settle_end(self.t == t_stop)?;
        }
        Ok(progress)
    }

    /// Where the next step ends at last, if there is a known time before `t_stop`: with what it says.
    fn known_end(&mut self, t_stop: f64) -> Option<(f64, (f64, bool))> {
        let (times, behind) = &mut self.known_times;
        *behind += times[*behind..].iter().take_while(|k| k.0 <= self.t).count();
        let at = *times.get(*behind).filter(|k| k.0 <= t_stop)?;
        // a step that ends where something jumps sees what is before
        Some((if at.1 { at.0.next_down() } else { at.0 }, at))
    }

    /// The step may have ended at `end`, next to a known time: where something jumps there, everything begins anew behind it.
    fn reach_known(&mut self, end: f64, (at, jumps): (f64, bool)) {
        if !jumps || self.t != end || self.log.outcome != Outcome::Reached {
            return;
        }
        self.t = at;
        self.restart = true;
        if let Some(p) = &mut self.log.path {
            p.move_end(at);
        }
        if let Some(tape) = &mut self.derivatives.tape {
            tape.move_end(at);
        }
    }

    fn step_inner(&mut self, t_stop: f64) -> Result<Progress> {
        if !t_stop.is_finite() {
            finite("time", &[t_stop], 1)?;
        }
        if t_stop < self.t {
            return Err(Error::Range(format!("time {t_stop} lies behind: {} is reached", self.t)));
        }
        self.t_stop = t_stop;
        self.log.heard = trouble::count();
        if self.interrupt.as_ref().is_some_and(|f| f.load(Ordering::Relaxed)) {
            return Err(Error::Interrupted);
        }
        stop::check()?;
        if self.unmade && !self.restart && self.log.outcome == Outcome::Reached {
            return self.make_rest();
        }
        if self.log.outcome != Outcome::Reached || self.t == t_stop {
            return Ok(Progress::Done);
        }
        self.refused = true;
        self.check_memory()?;
        self.refused = false;
        if self.restart {
            self.begin(t_stop)?;
            if self.log.outcome != Outcome::Reached {
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
        if self.stepper.pair != self.stepper.next_pair {
            self.stepper.pair = self.stepper.next_pair;
            self.derivatives.variational = (f64::INFINITY, 0);
        }
        let mut longest = self.variational_step()?.min(self.options.h_max);
        self.foresight.foreseen = false;
        if self.looks_ahead() {
            let time = self.time_to_switch()?.max(self.no_time());
            self.foresight.foreseen = time < longest.min(self.stepper.h);
            longest = longest.min(time);
        }
        self.follow_sharpness();
        self.prepare_step();
        if self.stepper.h <= 64.0 * EPS * self.t.abs() {
            // what was left of the way to the last stop says nothing about the way to the next
            self.stepper.h = self.no_time();
        }
        let mut rejected = false;
        let mut beyond = Beyond::default();
        loop {
            if self.log.stats.steps + self.log.stats.rejections >= self.options.max_steps {
                let text = format!("{} steps were not enough to reach {t_stop}", self.options.max_steps);
                return Ok(self.fail(Outcome::MaxSteps, text));
            }
            if let Some(p) = self.chatters()? {
                return Ok(p);
            }
            let left = t_stop - self.t;
            let wanted = self.stepper.h.min(longest);
            let last = wanted >= 0.99 * left;
            self.stepper.step.h = if last { left } else { wanted };
            if self.stepper.step.h <= 4.0 * EPS * self.t.abs() && !last {
                if left <= self.no_time() {
                    return Ok(self.coast(t_stop));
                }
                if let Some(p) = self.reach_surface()? {
                    return Ok(p);
                }
                let before = self.field.active.clone();
                if let Some(p) = self.rescue(&before, Origin::Outside)? {
                    self.stepper.h = self.no_time();
                    return Ok(p);
                }
                if let Some(p) = self.go_through(&before, false)? {
                    return Ok(p);
                }
                let text = "the step became shorter than rounding: the solution grows without bound, a function is \
                            not defined ahead, or the tolerances are too small";
                return Ok(self.fail(Outcome::StepTooSmall, text.into()));
            }
            let t1 = if last { t_stop } else { self.t + self.stepper.step.h };
            match self.attempt()? {
                Tried::Error(err) if err <= 1.0 => {
                    if !self.finish()? {
                        self.reject(&mut rejected, 0.25);
                        continue;
                    }
                    let found = self.search(t1)?;
                    let grown = self.grown(err.max(self.stepper.coarse), rejected);
                    match found {
                        Some(Found::Nothing) => {
                            let inside = self.error_seen_inside(t1)?;
                            if inside > 1.0 {
                                let factor = self.shrunk(inside);
                                self.reject(&mut rejected, factor);
                                continue;
                            }
                            let grown = if inside > 0.0 { grown.min(self.grown(inside, rejected)) } else { grown };
                            self.stepper.err_before = err.max(1e-4);
                            self.note_first_step(grown, rejected);
                            self.accept(t1)?;
                            if t1 < t_stop {
                                self.note_end(false);
                            }
                            self.stepper.h = grown;
                            return Ok(self.come_to_rest()?.unwrap_or(Progress::Stepped));
                        }
                        Some(Found::Zero(l, s, slope)) => {
                            match self.follow_units(t1, grown)? {
                                Followed::To(p) => return Ok(p),
                                Followed::Coarse(e) => {
                                    let factor = self.shrunk(e);
                                    self.reject(&mut rejected, factor);
                                    continue;
                                }
                                Followed::Not => {}
                            }
                            let entered = self.stepper.entered.take();
                            if let Some(cell) = entered {
                                self.stepper.first_steps[cell].allow(self.stepper.step.h);
                            }
                            if let Some(p) = self.land(l, s, slope, grown)? {
                                return Ok(p);
                            }
                            self.stepper.entered = entered;
                            self.note_failed_landing();
                            self.reject(&mut rejected, 0.5);
                        }
                        Some(Found::Coarse(e)) => self.reject(&mut rejected, (0.9 * e.powf(-0.25)).clamp(0.1, 0.9)),
                        None => self.reject(&mut rejected, 0.5),
                    }
                }
                Tried::Error(_) if self.is_beyond_stability(&mut beyond)? => {
                    self.turn_stiff();
                    self.stepper.step_implicit = true;
                    rejected = true;
                    self.log.stats.rejections += 1;
                    self.stepper.h = beyond.longest;
                }
                Tried::Error(err) => {
                    let factor = self.shrunk(err);
                    self.reject(&mut rejected, factor);
                }
                // stage points of an implicit method lie on the surfaces
                Tried::Undefined if self.may_turn_implicit() => {
                    (self.stepper.implicit, self.stepper.step_implicit) = (true, true)
                }
                Tried::Undefined => self.reject(&mut rejected, 0.25),
                Tried::Diverged => self.reject(&mut rejected, 0.35),
            }
        }
    }

    /// Goes along the velocity for a time that no step fits into.
    fn coast(&mut self, t_stop: f64) -> Progress {
        let left = t_stop - self.t;
        if let Some(p) = self.log.path.as_mut().filter(|_| left > 0.0) {
            let n = self.algebraic.as_ref().map_or(self.nx, |a| a.n_states());
            p.push_line(self.t, t_stop, &self.x[..n], &self.f[..n]);
        }
        self.x.iter_mut().zip(&self.f).for_each(|(x, f)| *x += left * f);
        self.t = t_stop;
        self.stepper.h = self.stepper.h.max(self.no_time());
        if let Some(tape) = &mut self.derivatives.tape {
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
        self.log.outcome = outcome;
        self.log.reason = format!("t = {}: {reason}", self.t);
        if let (Outcome::StepTooSmall, Some(cause)) = (outcome, self.cause_of_short_steps()) {
            self.log.reason = format!("{}; {cause}", self.log.reason);
        }
        if matches!(outcome, Outcome::StepTooSmall | Outcome::NoContinuation) {
            if let Some(complaint) = self.algebraic.as_ref().and_then(|a| a.complaint()) {
                self.log.reason = format!("{}; {complaint}", self.log.reason);
            }
            if let Some(complaint) = trouble::last_after(self.log.heard) {
                self.log.reason = format!("{}; last complaint: {complaint}", self.log.reason);
            }
        }
        Progress::Done
    }

    /// Slides an explicit pair that an implicit method may take over from?
    fn may_turn_implicit(&self) -> bool {
        !self.stepper.implicit
            && self.options.method == Method::Auto
            && self.field.n_alg() > 0
            && !self.field.is_explicit_only()
    }

    fn reject(&mut self, rejected: &mut bool, factor: f64) {
        *rejected = true;
        self.log.stats.rejections += 1;
        self.stepper.h = self.stepper.step.h * factor;
    }

    /// The step begins at the present state.
    fn prepare_step(&mut self) {
        self.stepper.step.t = self.t;
        let s = &mut self.stepper.step;
        for i in 0..self.nx {
            (s.x0[i], s.f0[i]) = (self.x[i], self.f[i]);
        }
        self.stepper.dense_ready = false;
        if let Some(c) = &mut self.calendar.units {
            c.tracks.clear();
        }
        self.stepper.radau.invalidate();
        self.stepper.step_implicit = self.stepper.implicit;
        if self.stepper.fresh || self.field.has_contacts() {
            self.stepper.radau.forget();
        }
        if self.stepper.fresh {
            sets::copy(&mut self.stepper.step_sets, &self.field.active);
        }
    }

    /// Takes the step over.
    fn accept(&mut self, t1: f64) -> Result<()> {
        if self.notes.is_some() {
            self.note_events(t1)?;
        }
        if self.log.path.is_some() || self.log.sampled.are_wanted(t1) {
            self.save_dense()?;
            self.note_piece(t1);
        }
        self.differentiate_step(t1)?;
        if let Some(c) = self.functions.touched.take() {
            if self.field.has_contacts() {
                let mut x = std::mem::take(&mut self.stepper.node);
                self.stepper.step.at((c.t - self.stepper.step.t) / self.stepper.step.h, &mut x);
                let r = self.check_gradient(c.subsystem, c.t, &x);
                self.stepper.node = x;
                r?;
            }
            self.touch(c);
        }
        self.log.stats.steps += 1;
        self.calendar.crowd = 0;
        if self.stepper.step_implicit {
            self.stepper.clear = if self.stepper.clears {
                self.stepper.step.h
            } else {
                self.stepper.clear.min(SHORTER * self.stepper.step.h)
            };
            self.stepper.radau.accept(&self.stepper.step, self.field.n_alg(), t1);
        }
        self.watch_stiffness();
        self.t = t1;
        for i in 0..self.nx {
            (self.x[i], self.f[i]) = (self.stepper.step.x1[i], self.stepper.step.f1[i]);
        }
        for l in 0..self.functions.watches.len() {
            self.functions.w0[l] = self.functions.w1[l];
            // what is a little below zero and rises does not vanish there
            let below = self.functions.watches[l].may_begin_below() && self.functions.w1[l] < 0.0;
            self.functions.depart[l] = if self.functions.resting[l] { 2 } else { u8::from(below) };
            if let Watch::Guard { a, .. } = self.functions.watches[l] {
                // NaN where it is not known
                self.functions.reached[a] = self.functions.reached[a].max(self.functions.w0[l].abs());
            }
        }
        self.stepper.fresh = false;
        self.field.accept_near(&self.stepper.step, self.stepper.step_implicit);
        let moved = self.settle_held()? | (self.field.has_contacts() && self.settle_contacts()?);
        std::mem::swap(&mut self.stepper.alpha_start, &mut self.stepper.alpha_end);
        std::mem::swap(&mut self.functions.q0, &mut self.functions.q1);
        if !self.field.constant_gradients() {
            std::mem::swap(&mut self.functions.dq0, &mut self.functions.dq1);
        }
        if moved {
            self.functions.q0.copy_from_slice(&self.field.q);
            for &l in &self.functions.looked {
                self.functions.w0[l] = self.functions.watches[l].value(&self.functions.q0, &self.field);
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
