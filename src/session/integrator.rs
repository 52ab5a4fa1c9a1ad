//! An event-driven simulation step by step: stop times, settings that change on the way, and who listens.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use super::{listening, modes_of, subsystem, Ending, Record};
use crate::error::{Error, Result};
use crate::event::{
    self, Along, Branching, Decider, Engine, Gradient, Options, Outcome, Poll, Progress, Run, Statistics, Term,
};
use crate::memory;
use crate::settings::{LogLevel, Settings, Value};
use crate::stop::Stop;
use crate::system::System;

/// What a step did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StepKind {
    /// A step inside of a mode.
    Stepped,
    /// A step that ends at a switch.
    Switched,
    /// Nothing, or no more: the time asked for is reached, or the simulation ended.
    Done,
    /// A step that ends at a stop time.
    StopTime,
}

/// Told of every accepted step; `false` stops.
pub type Watch = Box<dyn FnMut(&Engine, StepKind) -> bool + Send>;
/// Chooses a continuation where there are several: its place, or none to leave it to the options.
pub type Decide = Arc<dyn Fn(&Branching, &[i64]) -> Option<usize> + Send + Sync>;
/// Takes a line of the log.
pub type Lines = Arc<dyn Fn(LogLevel, &str) + Send + Sync>;

/// A value that one thread at a time uses, inside an object that several may read.
struct Own<T>(Mutex<T>);

impl<T> Own<T> {
    fn new(value: T) -> Own<T> {
        Own(Mutex::new(value))
    }

    fn get(&mut self) -> &mut T {
        self.0.get_mut().unwrap_or_else(PoisonError::into_inner)
    }
}

/// An integrator: what it knows of itself may be read by several threads.
pub struct Integrator {
    system: System,
    settings: Settings,
    /// Tolerances state by state, where they were set so.
    tolerances: Option<(Vec<f64>, Vec<f64>)>,
    /// Preferred modes of the subsystems that can switch.
    preferred: Vec<Vec<usize>>,
    decide: Option<Decide>,
    engine: Own<Engine>,
    /// The settings changed since the engine was built.
    stale: bool,
    /// A call failed in the middle of a step.
    broken: bool,
    t_start: f64,
    t: f64,
    x: Vec<f64>,
    f: Vec<f64>,
    u: Vec<f64>,
    p: Vec<f64>,
    n_modes: Vec<i64>,
    active: Vec<Vec<usize>>,
    stop_times: Vec<f64>,
    ending: Ending,
    reason: String,
    stats: Statistics,
    seconds: f64,
    interrupt: Arc<AtomicBool>,
    watch: Own<Option<Watch>>,
    /// The caller asks as well.
    has_poll: bool,
    lines: Option<Lines>,
}

/// An engine with these settings.
fn build(
    system: &System,
    settings: &Settings,
    tolerances: &Option<(Vec<f64>, Vec<f64>)>,
    preferred: &[Vec<usize>],
) -> Result<Engine> {
    let mut o = Options { preferred: preferred.to_vec(), ..Options::from(settings) };
    if let Some((rtol, atol)) = tolerances {
        (o.rtol, o.atol) = (rtol.clone(), atol.clone());
    }
    Engine::new(system, &o)
}

impl Integrator {
    /// Time, state, controls and parameters are zero. `interrupt` stops a run, or the next one.
    ///
    /// # Errors
    /// Those of [`System::validate`] and [`Engine::new`].
    pub fn new(system: System, settings: Settings, interrupt: &Arc<AtomicBool>) -> Result<Integrator> {
        system.validate_for_events()?;
        let d = system.dims();
        let n_modes = modes_of(&system);
        let preferred = vec![Vec::new(); n_modes.len()];
        let engine = build(&system, &settings, &None, &preferred)?;
        let mut integrator = Integrator {
            settings,
            tolerances: None,
            preferred,
            decide: None,
            stale: false,
            broken: false,
            t_start: 0.0,
            t: 0.0,
            x: vec![0.0; d.x],
            f: vec![0.0; d.x],
            u: vec![0.0; d.u],
            p: vec![0.0; d.p],
            active: vec![Vec::new(); n_modes.len()],
            n_modes,
            stop_times: Vec::new(),
            ending: Ending::default(),
            reason: String::new(),
            stats: Statistics::default(),
            seconds: 0.0,
            engine: Own::new(engine),
            interrupt: interrupt.clone(),
            watch: Own::new(None),
            has_poll: false,
            lines: None,
            system,
        };
        integrator.set_poll(None);
        Ok(integrator)
    }

    /// Sets one option by its name; taken over as [`Integrator::set_settings`].
    ///
    /// # Errors
    /// [`Error::Option`], [`Error::Range`].
    pub fn set_option(&mut self, name: &str, value: Value) -> Result<()> {
        let mut settings = self.settings;
        settings.set_by_name(name, value)?;
        self.set_settings(settings);
        Ok(())
    }

    /// Settings that are taken over by the next [`Integrator::reinit`], or at once before the first step.
    pub fn set_settings(&mut self, settings: Settings) {
        self.stale |= settings != self.settings;
        self.settings = settings;
    }

    /// The settings as they were set last.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Tolerances state by state; taken over as settings.
    ///
    /// # Errors
    /// [`Error::Dimension`], [`Error::Range`].
    pub fn set_tolerances(&mut self, rtol: &[f64], atol: &[f64]) -> Result<()> {
        let wanted = Some((rtol.to_vec(), atol.to_vec()));
        build(&self.system, &self.settings, &wanted, &self.preferred)?;
        self.tolerances = wanted;
        self.stale = true;
        Ok(())
    }

    /// Modes that a subsystem should take where the continuation is not unique; taken over as settings.
    ///
    /// # Errors
    /// [`Error::Dimension`] if there is no such subsystem, [`Error::Range`] if there is no such mode.
    pub fn set_preferred(&mut self, index: i64, modes: &[i64]) -> Result<()> {
        let k = subsystem(index, self.n_modes.len())?;
        let bad = |m: i64| Error::Range(format!("subsystem {k} has no mode {m}, it has {}", self.n_modes[k]));
        let list = modes.iter().map(|&m| usize::try_from(m).ok().filter(|_| m < self.n_modes[k]).ok_or_else(|| bad(m)));
        self.preferred[k] = list.collect::<Result<_>>()?;
        self.stale = true;
        Ok(())
    }

    /// Who decides where the continuation is not unique.
    pub fn set_decider(&mut self, decide: Option<Decide>) {
        let n_modes = self.n_modes.clone();
        let own = decide.clone();
        self.engine.get().set_decider(own.map(|d| Box::new(move |b: &Branching| d(b, &n_modes)) as Decider));
        self.decide = decide;
    }

    /// Who is told of steps.
    pub fn set_watch(&mut self, watch: Option<Watch>) {
        *self.watch.get() = watch;
    }

    /// Who is asked about every hundredth of a second whether a call is to go on.
    pub fn set_poll(&mut self, poll: Option<Poll>) {
        self.has_poll = poll.is_some();
        let interrupt = self.interrupt.clone();
        let mut poll = poll.unwrap_or_else(|| Box::new(|| true));
        self.engine.get().set_poll(Some(Box::new(move || !interrupt.load(Ordering::Relaxed) && poll())));
    }

    /// Who takes lines of the log.
    pub fn set_lines(&mut self, lines: Option<Lines>) {
        self.lines = lines;
    }

    /// Times at which steps end, in any order; those behind the present time are passed over.
    ///
    /// # Errors
    /// [`Error::Range`] if one is not finite.
    pub fn set_stop_times(&mut self, t: &[f64]) -> Result<()> {
        if let Some(bad) = t.iter().find(|t| !t.is_finite()) {
            return Err(Error::Range(format!("a stop time is {bad}: it must be finite")));
        }
        self.stop_times = t.to_vec();
        self.stop_times.sort_by(f64::total_cmp);
        Ok(())
    }

    /// Sets time and state and begins anew, with the settings set last.
    ///
    /// # Errors
    /// Those of [`Engine::new`] and [`Engine::reinit`].
    pub fn reinit(&mut self, t: f64, x: &[f64]) -> Result<()> {
        if self.stale || self.broken {
            let mut engine = build(&self.system, &self.settings, &self.tolerances, &self.preferred)?;
            engine.reinit(t, x)?;
            engine.set_controls(&self.u)?;
            engine.set_params(&self.p)?;
            engine.set_poll(self.engine.get().set_poll(None));
            self.engine = Own::new(engine);
            self.set_decider(self.decide.clone());
            (self.stale, self.broken) = (false, false);
        } else {
            self.engine.get().reinit(t, x)?;
        }
        (self.t_start, self.t, self.seconds) = (t, t, 0.0);
        self.x.copy_from_slice(x);
        self.look();
        Ok(())
    }

    /// Controls, constant from now on.
    ///
    /// # Errors
    /// Those of [`Engine::set_controls`].
    pub fn set_controls(&mut self, u: &[f64]) -> Result<()> {
        let engine = self.engine.get();
        listening(|| engine.set_controls(u))?;
        self.u.copy_from_slice(u);
        Ok(())
    }

    /// Parameters.
    ///
    /// # Errors
    /// Those of [`Engine::set_params`].
    pub fn set_params(&mut self, p: &[f64]) -> Result<()> {
        let engine = self.engine.get();
        listening(|| engine.set_params(p))?;
        self.p.copy_from_slice(p);
        Ok(())
    }

    /// Keeps what may be read while others read, too.
    fn look(&mut self) {
        let engine = self.engine.get();
        self.t = engine.time();
        self.x.copy_from_slice(engine.state());
        engine.whole_derivative(&mut self.f);
        self.ending = Ending { outcome: engine.outcome(), stopped: false };
        self.reason.clear();
        self.reason.push_str(engine.reason());
        self.stats = engine.stats();
        for (k, active) in self.active.iter_mut().enumerate() {
            *active = engine.active(k);
        }
    }

    /// New options are taken over where nothing is lost by it.
    fn prepare(&mut self) -> Result<()> {
        if self.broken {
            return Err(Error::State(
                "the last call failed in the middle of a step: call swb_integrator_reinit".into(),
            ));
        }
        if self.stale && self.stats.steps == 0 && self.t == self.t_start {
            let x = self.x.clone();
            self.reinit(self.t_start, &x)?;
        }
        Ok(())
    }

    /// Integrates to the last of the times, and gives back the states at all of them, see [`Engine::want_samples`].
    ///
    /// # Errors
    /// Those of [`Engine::want_samples`] and [`Integrator::run`].
    pub fn sample(&mut self, times: &[f64]) -> Result<Vec<f64>> {
        self.prepare()?;
        self.engine.get().want_samples(times)?;
        let r = times.last().map_or(Ok(StepKind::Done), |&t| self.run(t, false));
        // also where it failed: nothing is asked for any more
        let states = self.engine.get().take_samples();
        r.map(|_| states)
    }

    /// Integrates to `t`, or does one step only.
    ///
    /// # Errors
    /// Those of [`Engine::step`]; [`Error::State`] after one in the middle of a step.
    pub fn run(&mut self, t: f64, one: bool) -> Result<StepKind> {
        self.prepare()?;
        let clock = Instant::now();
        let (mut stopped, mut kind) = (false, StepKind::Done);
        let mut logged = self.stats.switches;
        let level = self.settings.verbosity();
        let (engine, watch, has_poll) = (self.engine.get(), self.watch.get(), self.has_poll);
        let stop_times = &self.stop_times;
        engine.begin_polls();
        let (lines, interrupt) = (&self.lines, &self.interrupt);
        let result = listening(|| loop {
            if interrupt.swap(false, Ordering::Relaxed) {
                stopped = true;
                return Ok(());
            }
            let now = engine.time();
            let next = stop_times.iter().copied().find(|&s| s > now && s < t);
            let until = next.unwrap_or(t);
            // who looks at steps sees every switch
            let done = if one || watch.is_some() { engine.step(until) } else { engine.step_on(until) }?;
            kind = match done {
                _ if engine.outcome() == Outcome::Reached && Some(engine.time()) == next => StepKind::StopTime,
                Progress::Stepped => StepKind::Stepped,
                Progress::Switched => StepKind::Switched,
                Progress::Done => StepKind::Done,
            };
            if let Some(lines) = lines {
                report(lines, level, engine, done, logged);
            }
            logged = engine.stats().switches;
            if done == Progress::Done {
                return Ok(());
            }
            if watch.as_mut().is_some_and(|w| !w(engine, kind)) {
                stopped = true;
                return Ok(());
            }
            if (has_poll || engine.is_unmade()) && engine.is_to_end() {
                interrupt.store(false, Ordering::Relaxed);
                stopped = true;
                return Ok(());
            }
            if one {
                return Ok(());
            }
        });
        self.seconds += clock.elapsed().as_secs_f64();
        self.look();
        if let Err(e) = result {
            // arguments and memory are checked before anything is done
            let before = matches!(e, Error::Range(_) | Error::Dimension(_));
            self.broken = !before && !self.engine.get().was_refused();
            self.tell(LogLevel::Error, || format!("integration error = {e}"));
            return Err(e);
        }
        if stopped {
            self.ending.stopped = true;
            self.reason = format!("t = {}: a callback or an interrupt asked to stop", self.t);
        }
        if !one || kind == StepKind::Done {
            let good = self.ending.is_reached();
            self.tell(if good { LogLevel::Info } else { LogLevel::Warning }, || self.summary());
        }
        Ok(kind)
    }

    fn summary(&self) -> String {
        let name = self.ending.name().replace('-', "_");
        let s = &self.stats;
        let why = if self.reason.is_empty() { String::new() } else { format!(", reason = {}", self.reason) };
        format!(
            "integration outcome = {name}, t = {}, steps = {}, rejections = {}, switches = {}, evaluations = {}, time = \
             {:.3e}{why}",
            self.t, s.steps, s.rejections, s.switches, s.evaluations, self.seconds
        )
    }

    fn tell(&self, importance: LogLevel, line: impl FnOnce() -> String) {
        if let (Some(lines), true) = (&self.lines, self.settings.verbosity() as i64 >= importance as i64) {
            lines(importance, &line());
        }
    }

    /// Value or derivative of the dense output of the last step.
    ///
    /// # Errors
    /// Those of [`Engine::get_dky`].
    pub fn get_dky(&mut self, t: f64, k: usize) -> Result<Vec<f64>> {
        let mut out = vec![0.0; self.x.len()];
        let engine = self.engine.get();
        listening(|| engine.get_dky(t, k, &mut out))?;
        Ok(out)
    }

    /// Gradient by the adjoint of the recorded run.
    ///
    /// # Errors
    /// Those of [`Engine::adjoint`].
    pub fn adjoint(&mut self, v: &[f64], terms: &[Term]) -> Result<Gradient> {
        self.sweep(|engine| engine.adjoint(v, terms))
    }

    /// Derivative of such a gradient in a direction.
    ///
    /// # Errors
    /// Those of [`Engine::adjoint_along`].
    pub fn adjoint_along(&mut self, v: &[f64], direction: &Gradient) -> Result<Along> {
        self.sweep(|engine| engine.adjoint_along(v, direction))
    }

    fn sweep<T>(&mut self, over: impl FnOnce(&mut Engine) -> Result<T>) -> Result<T> {
        let stop = Stop::on(&self.interrupt);
        let engine = self.engine.get();
        let found = stop.scope(|| listening(|| over(engine)));
        if matches!(found, Err(Error::Interrupted)) {
            self.interrupt.store(false, Ordering::Relaxed);
        }
        found
    }

    /// The result so far.
    ///
    /// # Errors
    /// [`Error::Dimension`] or [`Error::Library`] where there is not enough memory for a copy.
    pub fn record(&mut self) -> Result<Record> {
        let engine = self.engine.get();
        let bytes = engine.path().map_or(0, |p| p.bytes()) + size_of_val(engine.switches());
        memory::need(bytes as u128, || "a copy of the run".into())?;
        let run = Run {
            outcome: engine.outcome(),
            reason: self.reason.clone(),
            stopped_by: engine.stopped_by(),
            t: engine.time(),
            x: engine.state().to_vec(),
            switches: engine.switches().to_vec(),
            jumps: engine.jumps().to_vec(),
            notes: engine.notes().to_vec(),
            impacts: engine.impacts().to_vec(),
            phases: engine.phases().to_vec(),
            mechanics: engine.mechanics(),
            stats: engine.stats(),
            path: engine.path().cloned(),
            sensitivity: engine.sensitivity().map(<[f64]>::to_vec),
            one_sided: engine.one_sided(),
            branchings: engine.branchings().to_vec(),
            contacts: engine.contacts().to_vec(),
            accumulations: engine.accumulations().to_vec(),
        };
        let (ending, t_start, seconds) = (self.ending, self.t_start, self.seconds);
        Ok(Record { run, ending, t_start, seconds, n_modes: self.n_modes.clone() })
    }

    /// Time reached.
    pub fn time(&self) -> f64 {
        self.t
    }

    /// State reached.
    pub fn state(&self) -> &[f64] {
        &self.x
    }

    /// Its derivative.
    pub fn derivative(&self) -> &[f64] {
        &self.f
    }

    /// Is each mode of a subsystem active?
    ///
    /// # Errors
    /// [`Error::Dimension`] if there is no such subsystem.
    pub fn active(&self, index: i64) -> Result<Vec<bool>> {
        let k = subsystem(index, self.n_modes.len())?;
        Ok((0..self.n_modes[k] as usize).map(|m| self.active[k].contains(&m)).collect())
    }

    /// How the simulation stands, and why.
    pub fn ending(&self) -> (Ending, &str) {
        (self.ending, &self.reason)
    }

    /// Work so far, and its wall time.
    pub fn stats(&self) -> (&Statistics, f64) {
        (&self.stats, self.seconds)
    }
}

/// Log lines of a step: switches beyond the first `logged`, and the step itself.
fn report(lines: &Lines, level: LogLevel, engine: &Engine, done: Progress, logged: usize) {
    let stats = engine.stats();
    if level as i64 >= LogLevel::Debug as i64 {
        let all = engine.switches();
        let recent = stats.switches - logged;
        all[all.len().saturating_sub(recent)..].iter().for_each(|s| lines(LogLevel::Debug, &switch_line(s)));
    }
    if level as i64 >= LogLevel::Trace as i64 && done != Progress::Done {
        lines(LogLevel::Trace, &format!("step t = {:.17e}, steps = {}", engine.time(), stats.steps));
    }
}

fn switch_line(s: &event::Switch) -> String {
    format!(
        "switch t = {:.17e}, kind = {}, subsystem = {}, before = {:?}, after = {:?}, rate = {:.3e}, unique = {}",
        s.t,
        s.kind.name(),
        s.subsystem,
        s.before,
        s.after,
        s.rate,
        s.unique
    )
}
