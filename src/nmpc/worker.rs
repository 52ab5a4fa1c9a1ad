//! Preparations on a thread of their own.
//!
//! A [`Worker`] owns a controller. [`Worker::prepare`] hands it to the thread and returns; [`Worker::feedback`] takes it back when the
//! preparation is done, waiting for at most half of the deadline. A preparation that is late does not hold the sample up: its control
//! is that of the last plan with the feedback law of the program that gave it, `u_k + K_k (x − x_k)` cut off at the bounds, and the
//! preparation goes on for the next sample. The controller learns of the control that acted.

use super::controller::{Feedback, Nmpc, Preparation};
use super::standby::{Passed, Standby};
use crate::error::{Error, Result};
use crate::func::trouble;
use crate::memory::{self, thread::Thread};
use crate::qp::QpStatus;
use crate::stop::Stop;
use std::panic::{catch_unwind, AssertUnwindSafe};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Share of the deadline for which a feedback waits for a preparation; the rest is for the quadratic program.
const PATIENCE: f64 = 0.5;

/// What caller and thread share.
struct State {
    /// The controller, but while the thread has it.
    nmpc: Option<Box<Nmpc>>,
    /// A preparation is to be made or is being made.
    busy: bool,
    /// The state it is for, where one is given.
    predicted: Vec<f64>,
    has_predicted: bool,
    /// How the last preparation ended.
    done: Option<Result<Preparation>>,
    /// Written by the thread before it begins to prepare.
    standby: Standby,
    quit: bool,
}

struct Shared {
    state: Mutex<State>,
    changed: Condvar,
    interrupt: Arc<AtomicBool>,
}

impl Shared {
    /// A panic of the thread leaves the state whole: the controller is missing then.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(&self, guard: MutexGuard<'a, State>) -> MutexGuard<'a, State> {
        self.changed.wait(guard).unwrap_or_else(PoisonError::into_inner)
    }

    /// Preparations until the worker is dropped.
    fn serve(&self) {
        let mut predicted = Vec::new();
        let mut state = self.lock();
        predicted.resize(state.predicted.len(), 0.0);
        loop {
            while !state.busy && !state.quit {
                state = self.wait(state);
            }
            if state.quit {
                return;
            }
            let Some(mut nmpc) = state.nmpc.take() else { return };
            predicted.copy_from_slice(&state.predicted);
            let given = state.has_predicted.then_some(&predicted[..]);
            drop(state);
            let stop = Stop::on(&self.interrupt);
            let body = || {
                // what belongs to the last sample comes first: it is what answers if the rest is late
                nmpc.finish();
                nmpc.stand_by(&mut self.lock().standby);
                nmpc.prepare(given)
            };
            let listening = || {
                let (result, troubles) = trouble::collect(true, body);
                troubles.fatal.map_or(result, |complaint| Err(complaint.error()))
            };
            let guarded = || memory::call(|| stop.scope(listening));
            let end = catch_unwind(AssertUnwindSafe(guarded));
            // one preparation ends, not the next
            self.interrupt.store(false, Ordering::Relaxed);
            state = self.lock();
            state.busy = false;
            match end {
                Ok(result) => {
                    state.done = Some(result);
                    state.nmpc = Some(nmpc);
                }
                Err(payload) => {
                    let what = || Error::Internal("a preparation panicked: the controller is lost".into());
                    state.done = Some(Err(memory::from_panic(payload).unwrap_or_else(|_| what())));
                }
            }
            self.changed.notify_all();
            if state.nmpc.is_none() {
                return;
            }
        }
    }
}

/// A controller whose preparations may run on a thread of their own. The thread is started by the first of them.
pub struct Worker {
    shared: Arc<Shared>,
    thread: Option<Thread>,
    sizes: [usize; 3],
    deadline: f64,
    /// Functions of the model may be called by one thread only.
    serial: bool,
    /// Samples that the controller does not know of yet.
    passed: Passed,
}

impl Worker {
    /// Takes over a controller. Preparations end when `interrupt` is raised; whoever ends one with it finds it lowered.
    pub fn new(nmpc: Nmpc, interrupt: &Arc<AtomicBool>) -> Worker {
        let (nx, nu) = (nmpc.nx(), nmpc.nu());
        let mut standby = Standby::new(nmpc.n(), nx, nu);
        nmpc.stand_by(&mut standby);
        let sizes = [nmpc.n(), nx, nu];
        let (deadline, serial) = (nmpc.options().deadline, nmpc.is_serial());
        let state = State {
            nmpc: Some(Box::new(nmpc)),
            busy: false,
            predicted: vec![0.0; nx],
            has_predicted: false,
            done: None,
            standby,
            quit: false,
        };
        let state = Mutex::new(state);
        let shared = Arc::new(Shared { state, changed: Condvar::new(), interrupt: interrupt.clone() });
        Worker { shared, thread: None, sizes, deadline, serial, passed: Passed::new(nx, nu) }
    }

    /// Stages, states and controls.
    pub fn sizes(&self) -> [usize; 3] {
        self.sizes
    }

    /// Lets `body` use the controller; waits for a preparation that runs.
    ///
    /// # Errors
    /// Those of `body`; [`Error::State`] if a preparation has panicked.
    pub fn with<R>(&mut self, body: impl FnOnce(&mut Nmpc) -> Result<R>) -> Result<R> {
        let mut state = self.shared.lock();
        while state.busy {
            state = self.shared.wait(state);
        }
        let Some(nmpc) = state.nmpc.as_mut() else { return Err(lost()) };
        nmpc.catch_up(&mut self.passed);
        let result = body(nmpc);
        self.deadline = nmpc.options().deadline;
        result
    }

    /// Begins a preparation ([`Nmpc::prepare`]) on the thread and returns. False where one is running already: that goes on, and there
    /// is no other. Where functions of the model may be called by one thread only, or there is no room for a thread, the
    /// preparation is made before the call returns.
    ///
    /// # Errors
    /// [`Error::Dimension`], [`Error::Range`]; [`Error::State`] if a preparation has panicked. How it ended is said by [`Worker::wait`].
    pub fn prepare(&mut self, predicted: Option<&[f64]>) -> Result<bool> {
        if let Some(x) = predicted {
            crate::error::finite("predicted state", x, self.sizes[1])?;
        }
        if !self.serial && self.thread.is_none() {
            let shared = self.shared.clone();
            self.thread = Thread::start(move || shared.serve());
        }
        let mut state = self.shared.lock();
        if state.busy {
            return Ok(false);
        }
        let State { nmpc: Some(nmpc), .. } = &mut *state else { return Err(lost()) };
        nmpc.catch_up(&mut self.passed);
        if self.thread.is_none() {
            let stop = Stop::on(&self.shared.interrupt);
            let result = stop.scope(|| nmpc.prepare(predicted));
            self.shared.interrupt.store(false, Ordering::Relaxed);
            state.done = Some(result);
            return Ok(true);
        }
        state.has_predicted = predicted.is_some();
        if let Some(x) = predicted {
            state.predicted.copy_from_slice(x);
        }
        state.busy = true;
        drop(state);
        self.shared.changed.notify_all();
        Ok(true)
    }

    /// Waits for the preparation that runs. How the last one ended.
    ///
    /// # Errors
    /// Those of [`Nmpc::prepare`]; [`Error::State`] where there was none.
    pub fn wait(&mut self) -> Result<Preparation> {
        let mut state = self.shared.lock();
        while state.busy {
            state = self.shared.wait(state);
        }
        state.done.clone().unwrap_or_else(|| Err(Error::State("nothing was prepared on the thread".into())))
    }

    /// The control `u0[nu]` for a measured state `x[nx]`, as [`Nmpc::feedback`]. A preparation that runs is waited for, for at most half
    /// of the deadline; then the control is that of the last plan and its feedback law ([`super::Source::Tangent`], or
    /// [`super::Source::Plan`] and [`super::Source::Hold`] where there is none), and the preparation goes on.
    ///
    /// # Errors
    /// [`Error::Dimension`] if a length is wrong.
    pub fn feedback(&mut self, x: &[f64], u0: &mut [f64]) -> Result<Feedback> {
        let start = Instant::now();
        let [_, nx, nu] = self.sizes;
        if x.len() != nx || u0.len() != nu {
            return Err(Error::Dimension(format!(
                "feedback of {nx} states and {nu} controls: {} and {} given",
                x.len(),
                u0.len()
            )));
        }
        let patience = Duration::try_from_secs_f64(PATIENCE * self.deadline).ok();
        let until = patience.and_then(|d| start.checked_add(d));
        let mut state = self.shared.lock();
        while state.busy {
            let Some(until) = until else {
                state = self.shared.wait(state);
                continue;
            };
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                break;
            }
            state = self.shared.changed.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0;
        }
        if let (false, Some(nmpc)) = (state.busy, &mut state.nmpc) {
            nmpc.catch_up(&mut self.passed);
            let done = nmpc.feedback_since(start, x, u0)?;
            self.passed.u.copy_from_slice(u0);
            return Ok(done);
        }
        let source = state.standby.control(x, &self.passed.u, u0);
        drop(state);
        let time = start.elapsed();
        self.passed.add(x, u0, source, time);
        Ok(Feedback { source, status: QpStatus::OutOfTime, iterations: 0, time: time.as_secs_f64() })
    }
}

fn lost() -> Error {
    Error::State("a preparation panicked: make another controller".into())
}

impl Drop for Worker {
    fn drop(&mut self) {
        let Some(thread) = self.thread.take() else { return };
        self.shared.lock().quit = true;
        self.shared.interrupt.store(true, Ordering::Relaxed);
        self.shared.changed.notify_all();
        drop(thread);
    }
}
