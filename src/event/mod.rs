//! Event-driven simulation: the system is integrated under its active set, an ordinary differential equation or, while
//! sliding, a differential-algebraic equation of index 2; every switch is located to rounding.
//!
//! - Smooth modes: explicit pairs of Dormand and Prince, order 5 and 8, or Radau IIA of order 5 where they are stiff.
//! - Sliding modes: the weights follow from a linear system of the surfaces that slide, in blocks that do not touch; the
//!   field that they leave is integrated by the explicit pairs, and the end of every step is put onto the surfaces. Where it
//!   is stiff, Radau IIA with the surfaces as constraints at every stage.
//! - Switches: the indicators and the weights of the active modes are followed on the dense output; sign changes are
//!   found from Bernstein coefficients, also two in one step; the step is then repeated with the length that puts the
//!   switch at its end.
//! - The next active set solves the linear complementarity problem (6.19), with second-order conditions where first
//!   order does not decide. **Where more than one continuation exists** ([`Branching`]) all are found and noted; a
//!   callback decides ([`Engine::set_decider`]), or the rule of the options ([`Ambiguity`]): the present active set is
//!   kept if it is one of them, else the one with the fewest active cells is taken, else that with the lowest indices.
//!   Where the conditions have no regular solution an [`Arbiter`] is asked.
//! - Surfaces that are only touched ([`Contact`]) and accumulating switches ([`Accumulation`]) are noted too.
//!
//! [`simulate`] runs from a state to a time; an [`Engine`] goes step by step.
//!
//! ```
//! use std::sync::Arc;
//! use switchback::event::{simulate, Kind, Options};
//! use switchback::func::{Callback, Dims};
//! use switchback::system::{Regions, Subsystem, System};
//!
//! // ẋ = 2 − sign x
//! let d = Dims { x: 1, u: 0, p: 0 };
//! let modes = Arc::new(Callback::new("F", d, 2, |_, f| { f[0] = 1.0; f[1] = 3.0; 0 }));
//! let psi = Arc::new(Callback::new("psi", d, 1, |at, out| { out[0] = at.x[0]; 0 }));
//! let mut system = System::new(1, 0, 0).unwrap();
//! let regions = Regions::Signs { psi, signs: vec![1, -1] };
//! system.add_subsystem(Subsystem { rows: vec![0], modes, n_modes: 2, regions }).unwrap();
//!
//! let run = simulate(&system, &Options::default(), 0.0, &[-1.0], 2.0).unwrap();
//! assert!((run.x[0] - 5.0 / 3.0).abs() < 1e-14);
//! assert_eq!(run.switches[0].kind, Kind::Cross);
//! assert!((run.switches[0].t - 1.0 / 3.0).abs() < 1e-14);
//! ```

mod adjoint;
mod bernstein;
mod calendar;
mod collocation;
mod contact_forces;
mod engine;
mod explicit;
mod field;
mod guard;
mod newton;
pub mod pairs;
mod panels;
mod path;
mod radau;
mod sens;
mod sets;
#[rustfmt::skip]
mod settings;
mod step;
mod tape;
mod watch;

pub use crate::settings::{
    AmbiguityPolicy as Ambiguity, Integration as Method, Selection, Sensitivity, ZenoPolicy as Zeno,
};
pub use adjoint::along::Along;
pub use adjoint::{Gradient, Term};
pub use engine::{Engine, Poll, Progress};
pub use field::MODES_ON_DEMAND;
pub use path::Path;
pub use settings::Options;

use crate::error::{Error, Result};
use crate::parallel;
use crate::system::{Mechanics, System};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

impl Options {
    /// Both tolerances the same for all states.
    pub fn with_tolerance(rtol: f64, atol: f64) -> Options {
        Options { rtol: vec![rtol], atol: vec![atol], ..Options::default() }
    }

    fn validate(&self, nx: usize) -> Result<()> {
        for (what, v) in [("rtol", &self.rtol), ("atol", &self.atol)] {
            if v.len() != 1 && v.len() != nx {
                return Err(Error::Dimension(format!(
                    "{what} has {} values: give one, or one for each of the {nx} states",
                    v.len()
                )));
            }
            if let Some(bad) = v.iter().find(|v| !(**v >= 0.0 && v.is_finite())) {
                return Err(Error::Range(format!("{what} holds {bad}: it must be finite and not negative")));
            }
        }
        for i in 0..nx {
            let (r, a) = (self.rtol[i % self.rtol.len()], self.atol[i % self.atol.len()]);
            if r < 1e-14 && a == 0.0 {
                return Err(Error::Range(format!(
                    "state {i} has rtol = {r} and atol = 0: give rtol of at least 1e-14 or a positive atol"
                )));
            }
        }
        if !(self.h0 >= 0.0 && self.h0.is_finite()) {
            return Err(Error::Range(format!("h0 is {}: give a positive step, or 0", self.h0)));
        }
        if self.h_max.is_nan() || self.h_max <= 0.0 {
            return Err(Error::Range(format!("h_max is {}: it must be positive", self.h_max)));
        }
        Ok(())
    }
}

/// How a simulation ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(i32)]
#[non_exhaustive]
pub enum Outcome {
    /// The time asked for is reached.
    #[default]
    Reached = 0,
    /// More steps than allowed.
    MaxSteps = 1,
    /// The step became too short: a solution that grows without bound, a function that is not defined, tolerances
    /// below rounding.
    StepTooSmall = 2,
    /// Switches accumulate, and there is no sliding mode beyond, or the policy is to stop.
    Zeno = 3,
    /// The continuation is not unique and the policy is to stop.
    Ambiguous = 4,
    /// No active set continues the solution.
    NoContinuation = 5,
    /// A transition of the effect [`Effect::Stop`](crate::system::Effect::Stop) happened.
    Event = 6,
}

impl Outcome {
    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Outcome::Reached => "reached",
            Outcome::MaxSteps => "max-steps",
            Outcome::StepTooSmall => "step-too-small",
            Outcome::Zeno => "zeno",
            Outcome::Ambiguous => "ambiguous",
            Outcome::NoContinuation => "no-continuation",
            Outcome::Event => "event",
        }
    }
}

/// Kinds of switches, by the active modes before and after (Table 6.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
#[non_exhaustive]
pub enum Kind {
    /// Modes leave the active set and others enter it.
    Cross = 0,
    /// Modes enter: a sliding mode begins, or gets another mode.
    Enter = 1,
    /// Modes leave: a sliding mode ends, or loses a mode.
    Leave = 2,
    /// Modes leave although they could stay: the solution is not unique.
    Spontaneous = 3,
}

impl Kind {
    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Cross => "cross",
            Kind::Enter => "enter",
            Kind::Leave => "leave",
            Kind::Spontaneous => "spontaneous",
        }
    }
}

/// A change of the active set of one subsystem.
#[derive(Debug, Clone, PartialEq)]
pub struct Switch {
    /// Time.
    pub t: f64,
    /// Kind of the switch.
    pub kind: Kind,
    /// Another subsystem switches at the same time.
    pub simultaneous: bool,
    /// Subsystem, counted among those with more than one mode.
    pub subsystem: usize,
    /// Modes active before.
    pub before: Vec<usize>,
    /// Modes active after.
    pub after: Vec<usize>,
    /// Rate at which the quantity that vanishes (an indicator difference, or a weight) goes through zero before the
    /// switch; NaN where the switch is not caused by one.
    pub rate: f64,
    /// Cosine between the gradient of the surface and the velocity: near zero the contact is grazing. NaN for a weight.
    pub transversality: f64,
    /// The continuation was unique.
    pub unique: bool,
    /// Derivatives of the time with respect to initial state, parameters and controls, if they are asked for.
    pub dt: Vec<f64>,
}

/// A transition that was made.
#[derive(Debug, Clone, PartialEq)]
pub struct Jump {
    /// Time.
    pub t: f64,
    /// The transition, in the order they were added to the system.
    pub transition: usize,
    /// The states that `before` and `after` are of, where that is not all of them: a system of many units is not stopped for what happens in one.
    pub states: Vec<usize>,
    /// State just before.
    pub before: Vec<f64>,
    /// State just behind.
    pub after: Vec<f64>,
    /// Rate at which the guard passes zero, positive in its direction; NaN where it held when its discrete state began.
    pub rate: f64,
    /// Another transition was made at the same time.
    pub simultaneous: bool,
    /// Derivatives of the time with respect to initial state, parameters and controls, if they are asked for.
    pub dt: Vec<f64>,
}

impl Jump {
    /// Bytes of one in a log, about.
    fn bytes(nx: usize) -> usize {
        size_of::<Jump>() + 2 * nx * size_of::<f64>()
    }
}

/// What a transition of the effect [`Effect::Note`](crate::system::Effect::Note) wrote down.
#[derive(Debug, Clone, PartialEq)]
pub struct Noted {
    /// Time.
    pub t: f64,
    /// The transition, in the order they were added to the system.
    pub transition: usize,
    /// State there; behind a jump where that has made the condition true.
    pub x: Vec<f64>,
    /// Rate at which the guard passes zero, positive in its direction; NaN where a jump has made the condition true.
    pub rate: f64,
    /// Derivatives of the time with respect to initial state, parameters and controls, if they are asked for; NaN in an implicit step.
    pub dt: Vec<f64>,
}

impl Noted {
    /// Bytes of one in a log, about.
    fn bytes(nx: usize) -> usize {
        size_of::<Noted>() + nx * size_of::<f64>()
    }
}

/// Causes of impacts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
#[non_exhaustive]
pub enum ImpactKind {
    /// A contact closed.
    Collision = 0,
    /// No forces continue the motion (Painlevé): sliding stops by an impact without collision.
    Painleve = 1,
    /// Impacts accumulate: this is the last, the contact stays closed.
    Last = 2,
}

/// The part of one contact in an impact.
#[derive(Debug, Clone, PartialEq)]
pub struct Impact {
    /// Time.
    pub t: f64,
    /// The contact.
    pub contact: usize,
    /// Its cause.
    pub kind: ImpactKind,
    /// Rate of the gap before and behind.
    pub rates: [f64; 2],
    /// Normal impulse, and tangential impulses in the order of the tangents.
    pub impulse: [f64; 3],
    /// How far the bodies would overlap without the impact, `ġ⁻² / (2 |g̈|)`: small where the contact is grazing, and
    /// derivatives grow like its square root. Infinite without acceleration towards the contact.
    pub depth: f64,
    /// Other contacts had impulses at the same time.
    pub simultaneous: bool,
    /// Velocities behind it and impulses are unique.
    pub unique: bool,
    /// Derivatives of the time with respect to initial state, parameters and controls, if they are asked for.
    pub dt: Vec<f64>,
}

/// A contact in space that slides from the start of a phase on.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// The contact.
    pub contact: usize,
    /// The direction it begins with.
    pub direction: [f64; 2],
    /// Sliding velocity that the tolerances do not see: while no more goes across, the contact goes where it accelerates to. Zero
    /// for one that has slid before.
    pub unseen: f64,
}

/// Contact modes, controls and parameters from a time on.
#[derive(Debug, Clone, PartialEq)]
pub struct Phase {
    /// The time it begins.
    pub t: f64,
    /// Mode of every contact: 0 open, 1 closed (sticking), 2 sliding, 3 sliding against the tangent.
    pub modes: Vec<usize>,
    /// Contacts are redundant: the motion is unique, the forces are those of least norm among many.
    pub redundant: bool,
    /// Contacts in space that slide from here on, and the directions they begin with.
    pub starting: Vec<Start>,
    /// Controls.
    pub u: Vec<f64>,
    /// Parameters.
    pub p: Vec<f64>,
    /// Modes in algebraic equations and of steps of inclusions, and their weights, which stand behind the states in the engine.
    pub behind: Vec<f64>,
}

/// A way a solution may go on.
#[derive(Debug, Clone, PartialEq)]
pub struct Continuation {
    /// Active modes of every subsystem, ascending.
    pub modes: Vec<Vec<usize>>,
    /// Derivative of the state.
    pub velocity: Vec<f64>,
}

/// A point from which several solutions go on.
#[derive(Debug, Clone, PartialEq)]
pub struct Branching {
    /// Time.
    pub t: f64,
    /// State.
    pub x: Vec<f64>,
    /// Active modes of every subsystem before.
    pub before: Vec<Vec<usize>>,
    /// All continuations that differ in their velocity, in the order of [`Ambiguity::First`].
    pub continuations: Vec<Continuation>,
    /// The continuation that was taken; none where the run stops. None while it is being decided.
    pub taken: Option<usize>,
}

/// Decides at a [`Branching`]: the place of a continuation, or none to stop.
pub type Decider = Box<dyn FnMut(&Branching) -> Option<usize> + Send>;

/// A point where the conditions (6.19) have no regular solution: time, state, controls, parameters.
#[derive(Debug, Clone, Copy)]
pub struct Doubt<'a> {
    /// Time.
    pub t: f64,
    /// State.
    pub x: &'a [f64],
    /// Controls.
    pub u: &'a [f64],
    /// Parameters.
    pub p: &'a [f64],
}

/// Decides where the conditions (6.19) do not: the modes of every subsystem that are active next, or none.
pub type Arbiter = Box<dyn FnMut(Doubt) -> Option<Vec<Vec<usize>>> + Send>;

/// A surface that is only touched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Time.
    pub t: f64,
    /// Subsystem, counted among those with more than one mode.
    pub subsystem: usize,
    /// Derivative of the indicator difference along the solution.
    pub rate: f64,
    /// Cosine between the gradient of the surface and the velocity.
    pub transversality: f64,
}

/// Accumulating switches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Accumulation {
    /// Time at which they accumulate, by the geometric series of the last intervals: it may lie behind the time at which the motion goes on.
    pub t: f64,
    /// Time at which ordinary integration begins again.
    pub until: f64,
    /// Steps of [`Zeno::TimeStepping`], 0 with the other policies, and where the motion goes on in a limit set.
    pub steps: usize,
    /// Error that these steps added to the state, relative to the tolerance: the difference to half as many. Where the
    /// motion goes on in a limit set of order two, how far it was from there, relative to the tolerance.
    pub error: f64,
}

/// Work done.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Accepted steps.
    pub steps: usize,
    /// Rejected steps.
    pub rejections: usize,
    /// Steps repeated to end at a switch.
    pub relocations: usize,
    /// Evaluations of the right-hand side.
    pub evaluations: usize,
    /// Evaluations of its Jacobian.
    pub jacobians: usize,
    /// Entries of the Jacobians by which derivatives with respect to initial states and inputs were moved over explicit steps, forward and
    /// in sweeps.
    pub entries: usize,
    /// Newton iterations.
    pub newton: usize,
    /// Factorisations.
    pub factorisations: usize,
    /// Switches, all subsystems together.
    pub switches: usize,
    /// Transitions.
    pub jumps: usize,
    /// Impacts, each contact for itself.
    pub impacts: usize,
    /// What transitions noted.
    pub notes: usize,
    /// Points at which switches accumulate.
    pub accumulations: usize,
}

/// A finished simulation.
#[derive(Debug, Clone)]
pub struct Run {
    /// How it ended.
    pub outcome: Outcome,
    /// Why, in words; where the time asked for is reached, what is not known to the tolerances, or nothing.
    pub reason: String,
    /// The transition that ended it, where one did. Derivatives of the state are then those at the end, whose time moves.
    pub stopped_by: Option<usize>,
    /// Time reached.
    pub t: f64,
    /// State there.
    pub x: Vec<f64>,
    /// The switches in the order of time.
    pub switches: Vec<Switch>,
    /// The transitions in the order they were made.
    pub jumps: Vec<Jump>,
    /// What transitions noted in the order of time; as many as switches at most.
    pub notes: Vec<Noted>,
    /// The impacts in the order they happened, one entry for every contact with an impulse.
    pub impacts: Vec<Impact>,
    /// Contact modes of a scene as they followed each other; as many as switches at most.
    pub phases: Vec<Phase>,
    /// The equations of motion of a scene, for the forces of its contacts.
    pub mechanics: Option<Arc<Mechanics>>,
    /// Work done.
    pub stats: Statistics,
    /// Points with several continuations; as many as switches at most.
    pub branchings: Vec<Branching>,
    /// Surfaces that were only touched; as many as switches at most.
    pub contacts: Vec<Contact>,
    /// Accumulating switches; as many as switches at most.
    pub accumulations: Vec<Accumulation>,
    /// Dense output, if it was asked for.
    pub path: Option<Path>,
    /// `∂x/∂(x0, p, u)`, row-major, one row per state, if it was asked for; `∂x/∂(p, u)` where that is all that was.
    pub sensitivity: Option<Vec<f64>>,
    /// The derivatives are those of one side only: switches at the same time, a continuation that is not unique, a
    /// surface that is only touched, or accumulating switches.
    pub one_sided: bool,
}

impl Run {
    /// The states just before and just behind transition `index`; NaN where they are not known: a system of many units is not stopped for what
    /// happens in one, and only dense output knows the others.
    pub fn jump_states(&self, index: usize) -> (Vec<f64>, Vec<f64>) {
        let j = &self.jumps[index];
        if j.states.is_empty() {
            return (j.before.clone(), j.after.clone());
        }
        let mut before = vec![f64::NAN; self.x.len()];
        if let Some(p) = &self.path {
            // a time outside is none of the run
            if p.eval(j.t, 0, &mut before).is_err() {
                before.fill(f64::NAN);
            }
        }
        // those of one time follow each other
        let first = self.jumps[..index].partition_point(|k| k.t < j.t);
        for k in &self.jumps[first..index] {
            k.states.iter().zip(&k.after).for_each(|(i, v)| before[*i] = *v);
        }
        j.states.iter().zip(&j.before).for_each(|(i, v)| before[*i] = *v);
        let mut after = before.clone();
        j.states.iter().zip(&j.after).for_each(|(i, v)| after[*i] = *v);
        (before, after)
    }

    /// Bytes of its arrays, about.
    pub fn bytes(&self) -> usize {
        let path = self.path.as_ref().map_or(0, Path::bytes);
        let jumps = self.jumps.len() * Jump::bytes(self.x.len());
        let notes = self.notes.len() * Noted::bytes(self.x.len());
        let impacts = self.impacts.len() * size_of::<Impact>();
        let phases = self
            .phases
            .iter()
            .map(|p| 8 * (p.modes.len() + p.u.len() + p.p.len() + 4 * p.starting.len()))
            .sum::<usize>();
        path + jumps
            + impacts
            + notes
            + phases
            + self.switches.len() * size_of::<Switch>()
            + 8 * self.sensitivity.as_ref().map_or(0, Vec::len)
    }
}

/// Simulates from the state `x0` at `t0` to `t1`, with controls and parameters zero.
pub fn simulate(system: &System, options: &Options, t0: f64, x0: &[f64], t1: f64) -> Result<Run> {
    let mut e = Engine::new(system, options)?;
    e.reinit(t0, x0)?;
    e.advance(t1)?;
    Ok(e.into_run())
}

/// Engines of one system for many runs: as many as there are threads in the end, each with its memory and its functions prepared
/// once. What a run gives does not depend on those before it.
pub(crate) struct Engines<'a> {
    system: &'a System,
    options: &'a Options,
    idle: Mutex<Vec<Engine>>,
}

impl<'a> Engines<'a> {
    /// None so far.
    pub(crate) fn new(system: &'a System, options: &'a Options) -> Engines<'a> {
        Engines { system, options, idle: Mutex::new(Vec::new()) }
    }

    /// One that nobody uses: to be set to a start, and given back after a run that did not fail.
    pub(crate) fn take(&self) -> Result<Engine> {
        let idle = self.idle().pop();
        idle.map_or_else(|| Engine::new(self.system, self.options), Ok)
    }

    /// For the next run.
    pub(crate) fn give_back(&self, engine: Engine) {
        self.idle().push(engine);
    }

    fn idle(&self) -> MutexGuard<'_, Vec<Engine>> {
        self.idle.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Simulates from several initial states, with parameters of their own where `params` holds one set for each, on
/// `threads` threads (0: one for each processor), or one if a function is [serial](crate::func::Function::is_serial). The results are those of
/// single runs to the last bit, whatever the number of threads.
pub fn simulate_batch(
    system: &System,
    options: &Options,
    t0: f64,
    starts: &[Vec<f64>],
    params: &[Vec<f64>],
    t1: f64,
    threads: usize,
) -> Result<Vec<Run>> {
    if !params.is_empty() && params.len() != starts.len() {
        return Err(Error::Dimension(format!("{} sets of parameters for {} starts", params.len(), starts.len())));
    }
    let engines = Engines::new(system, options);
    let one = |i: usize| -> Result<Run> {
        let mut e = engines.take()?;
        e.reinit(t0, &starts[i])?;
        if let Some(p) = params.get(i) {
            e.set_params(p)?;
        }
        e.advance(t1)?;
        let run = e.take_run();
        engines.give_back(e);
        Ok(run)
    };
    let threads = parallel::threads(threads, system.is_serial());
    let failed = || Err(Error::Internal("a thread of the batch panicked".into()));
    let runs = parallel::each(starts.len(), threads, &mut |i| one(i), &one);
    runs.into_iter().map(|run| run.unwrap_or_else(failed)).collect()
}
