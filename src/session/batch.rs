//! Many event-driven simulations of one system on several threads.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::Arc;
use std::time::Instant;

use super::{listening, modes_of, Ending, Record};
use crate::error::{Error, Result};
use crate::event::{Engine, Engines, Options, Outcome};
use crate::memory;
use crate::parallel;
use crate::settings::Settings;
use crate::stop::Stop;
use crate::system::System;

/// Simulations of one system from several initial states, with controls and parameters of their own.
pub struct Batch {
    system: System,
    options: Options,
    n_modes: Vec<i64>,
    interrupt: Arc<AtomicBool>,
    runs: Vec<Result<Record>>,
}

/// Inputs of the runs: none, one for all, or one for each.
struct Inputs<'a> {
    values: &'a [f64],
    width: usize,
    shared: bool,
}

impl<'a> Inputs<'a> {
    fn new(values: &'a [f64], width: usize, n_runs: usize, what: &str) -> Result<Inputs<'a>> {
        let shared = values.len() == width;
        if !values.is_empty() && !shared && values.len() != width * n_runs {
            return Err(Error::Dimension(format!(
                "{what} has length {}: give {width} for all runs, or {width} for each of the {n_runs}",
                values.len()
            )));
        }
        Ok(Inputs { values, width, shared })
    }

    fn of(&self, run: usize) -> Option<&'a [f64]> {
        let start = if self.shared { 0 } else { run * self.width };
        (!self.values.is_empty()).then(|| &self.values[start..start + self.width])
    }
}

/// What surrounds every run of a batch on its thread.
pub type Around<'a> = &'a (dyn Fn(&mut dyn FnMut() -> Result<Record>) -> Result<Record> + Sync);

/// What one run starts from.
struct Start<'a> {
    t0: f64,
    x0: &'a [f64],
    u: Option<&'a [f64]>,
    p: Option<&'a [f64]>,
}

impl Batch {
    /// Without runs; `interrupt` stops those at work, or the next ones.
    ///
    /// # Errors
    /// Those of [`System::validate`] and [`Engine::new`].
    pub fn new(system: System, settings: &Settings, interrupt: &Arc<AtomicBool>) -> Result<Batch> {
        system.validate_for_events()?;
        let n_modes = modes_of(&system);
        let options = Options { preferred: vec![Vec::new(); n_modes.len()], ..Options::from(settings) };
        Engine::new(&system, &options)?;
        Ok(Batch { system, options, n_modes, interrupt: interrupt.clone(), runs: Vec::new() })
    }

    /// Simulates from `t0` to `t1` from all states `x0`, those of one run together, with controls `u` and parameters `p`: none,
    /// one set for all runs, or one for each. Every run is done within `around`: for what is kept per thread, and what panics.
    /// A run that fails does not keep the others from running.
    ///
    /// # Errors
    /// [`Error::Dimension`] where lengths do not fit.
    pub fn run(
        &mut self,
        (t0, t1): (f64, f64),
        x0: &[f64],
        u: &[f64],
        p: &[f64],
        threads: usize,
        around: Around,
    ) -> Result<()> {
        let d = self.system.dims();
        if x0.len() % d.x != 0 {
            return Err(Error::Dimension(format!("x0 has length {}, no multiple of the {} states", x0.len(), d.x)));
        }
        let n_runs = x0.len() / d.x;
        let (u, p) = (Inputs::new(u, d.u, n_runs, "u")?, Inputs::new(p, d.p, n_runs, "p")?);
        let threads = parallel::threads(threads, self.system.is_serial());
        let stop = Stop::on(&self.interrupt);
        let engines = Engines::new(&self.system, &self.options);
        let one = |i: usize| -> Result<Record> {
            let from = Start { t0, x0: &x0[i * d.x..(i + 1) * d.x], u: u.of(i), p: p.of(i) };
            around(&mut || stop.scope(|| memory::call(|| self.one(&engines, &from, t1))))
        };
        let runs = parallel::each(n_runs, threads, &mut |i| one(i), &one);
        self.interrupt.store(false, Ordering::Relaxed);
        let runs: Option<Vec<Result<Record>>> = runs.into_iter().collect();
        self.runs = runs.ok_or_else(|| Error::Internal("a thread of the batch panicked".into()))?;
        Ok(())
    }

    /// One run, by an engine that has done others before if there is one; one whose run fails is not used again.
    fn one(&self, engines: &Engines, from: &Start, t1: f64) -> Result<Record> {
        let clock = Instant::now();
        let (mut run, stopped) = listening(|| {
            let mut engine = engines.take()?;
            engine.set_interrupt(self.interrupt.clone());
            engine.reinit(from.t0, from.x0)?;
            if let Some(u) = from.u {
                engine.set_controls(u)?;
            }
            if let Some(p) = from.p {
                engine.set_params(p)?;
            }
            let stopped = match engine.advance(t1) {
                Err(Error::Interrupted) => true,
                other => other.map(|_| false)?,
            };
            let run = engine.take_run();
            engines.give_back(engine);
            Ok((run, stopped))
        })?;
        let ending = Ending { outcome: run.outcome, stopped: stopped && run.outcome == Outcome::Reached };
        if ending.stopped {
            run.reason = format!("t = {}: interrupted", run.t);
        }
        let seconds = clock.elapsed().as_secs_f64();
        Ok(Record { run, ending, t_start: from.t0, seconds, n_modes: self.n_modes.clone() })
    }

    /// States of the system.
    pub fn n_states(&self) -> usize {
        self.system.dims().x
    }

    /// All runs, in the order of their initial states, or why they failed.
    pub fn runs(&self) -> &[Result<Record>] {
        &self.runs
    }

    /// One run.
    ///
    /// # Errors
    /// [`Error::Dimension`] if there is none; its own if it failed.
    pub fn get(&self, index: i64) -> Result<&Record> {
        let n = self.runs.len();
        let found = usize::try_from(index).ok().and_then(|i| self.runs.get(i));
        let run = found.ok_or_else(|| Error::Dimension(format!("there is no run {index}, the batch has {n}")))?;
        run.as_ref().map_err(Clone::clone)
    }
}
