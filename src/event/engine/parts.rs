//! The state of an engine, in components.

use super::accumulation::Recent;
use super::chatter::Window;
use super::contact::SceneRoom;
use super::control::{Cut, FirstStep, Pace};
use super::flat::Flat;
use super::limit_set::Shrinking;
use super::record::Sampled;
use super::worth::Worth;
use crate::event::bernstein::{Coefficients, Sampler};
use crate::event::calendar::UnitEvents;
use crate::event::explicit::Pair;
use crate::event::guard::Reset;
use crate::event::path::Path;
use crate::event::radau::Radau;
use crate::event::sens::Sens;
use crate::event::step::Step;
use crate::event::tape::Tape;
use crate::event::watch::Watch;
use crate::event::{Accumulation, Branching, Contact, Impact, Jump, Noted, Outcome, Phase, Statistics, Switch};

/// How the state is moved: the method, its steps, their length.
pub(super) struct Stepper {
    pub(super) step: Step,
    /// Active sets of the last step.
    pub(super) step_sets: Vec<Vec<usize>>,
    pub(super) step_implicit: bool,
    pub(super) dense_ready: bool,
    pub(super) radau: Radau,
    /// The pair of the present step, of the next one, and that of the tolerance.
    pub(super) pair: Pair,
    pub(super) next_pair: Pair,
    pub(super) usual_pair: Pair,
    /// See [`Engine::note_end`](super::Engine::note_end).
    pub(super) cut: Cut,
    /// Error of the last attempt relative to the tolerance.
    pub(super) tried: f64,
    pub(super) implicit: bool,
    /// How fast modes turned out to be, by cell; the last entry is for a system without cells.
    pub(super) stiff: Vec<Pace>,
    /// Is the present mode stiff?
    pub(super) stiff_mode: bool,
    /// Subsystems that were stiff when they slid.
    pub(super) stiff_slides: Vec<bool>,
    pub(super) stiff_steps: usize,
    /// See [`explicit::stiffness`](crate::event::explicit::stiffness), of the last step that was looked at.
    pub(super) stiffness: f64,
    pub(super) damped: bool,
    pub(super) mild_steps: usize,
    pub(super) weights: Vec<f64>,
    pub(super) node: Vec<f64>,
    pub(super) h: f64,
    /// Length of the first step of the run, zero where nothing says it.
    pub(super) given: f64,
    /// First steps behind switches, by the cell that follows, and that of the last switch.
    pub(super) first_steps: Vec<FirstStep>,
    pub(super) entered: Option<usize>,
    pub(super) err_before: f64,
    /// How coarse the last step was, see [`Engine::resolution`](super::Engine::resolution).
    pub(super) coarse: f64,
    /// Length of the implicit step whose dense output was looked at last, and whether that of the present one was.
    pub(super) clear: f64,
    pub(super) clears: bool,
    /// Algebraic variables at the start and at the end of a step.
    pub(super) alpha_start: Vec<f64>,
    pub(super) alpha_end: Vec<f64>,
    /// The step is the first one under its active set.
    pub(super) fresh: bool,
    /// Does the motion depend on the time itself? If not, what does not move stays.
    pub(super) timed: bool,
    /// Steps under it without a switch, see [`Engine::come_to_rest`](super::Engine::come_to_rest).
    pub(super) slid: usize,
}

/// What is watched: values, gradients, and what is known of zeros in the step.
pub(super) struct EventFunctions {
    pub(super) sampler: Sampler,
    pub(super) samples: Vec<Coefficients>,
    pub(super) watches: Vec<Watch>,
    /// Those that are looked at in the present step.
    pub(super) looked: Vec<usize>,
    /// Order of the zero that a watched function has at the start of the step.
    pub(super) depart: Vec<u8>,
    pub(super) w0: Vec<f64>,
    pub(super) w1: Vec<f64>,
    pub(super) suspect: Vec<bool>,
    /// Those among [`Engine::looked`](super::Engine::looked).
    pub(super) suspects: Vec<usize>,
    /// The first zeros of all of these in the step: watch, relative time, rate.
    pub(super) zeros: Vec<(usize, f64, f64)>,
    /// Zero to rounding over the whole of the last step.
    pub(super) resting: Vec<bool>,
    pub(super) q0: Vec<f64>,
    pub(super) q1: Vec<f64>,
    pub(super) dq0: Vec<f64>,
    pub(super) dq1: Vec<f64>,
    pub(super) zero: Vec<bool>,
    /// A contact in the step that is looked at.
    pub(super) touched: Option<Contact>,
    /// The relative time in the last step at which something touches zero without being crossed, to what the tolerances see.
    pub(super) grazed: f64,
    /// What the zero that the last step ended at was like, if it was of higher order.
    pub(super) flat: Option<Flat>,
    /// Of every indicator, where it vanished last with a zero of higher order: signs of values up to this one mean nothing there.
    pub(super) levels: Vec<f64>,
    /// Of every guard, by its place: how far from zero it has been at the ends of steps since it vanished last.
    pub(super) reached: Vec<f64>,
}

/// What happens when: unit by unit in a step, and how it repeats.
pub(super) struct Calendar {
    /// Single units may switch within a step.
    pub(super) within_steps: bool,
    /// What happens in the step unit by unit, where the model can be taken apart.
    pub(super) units: Option<Box<UnitEvents>>,
    /// Whether that is worth it.
    pub(super) worth: Worth,
    pub(super) recent: Recent,
    pub(super) shrinking: Shrinking,
    /// When a limit set was entered last, and how often without time between.
    pub(super) limits: (f64, usize),
    /// The next active set is the one behind an accumulation.
    pub(super) behind: bool,
    /// Passages of [`Zeno::TimeStepping`](super::Zeno) one soon after the other.
    pub(super) passages: i32,
    /// Work of all passages, see [`Engine::step_through`](super::Engine::step_through).
    pub(super) passage_work: f64,
    /// From where to where the last of them went.
    pub(super) passage: (f64, f64),
    /// Progress lately, see [`Engine::chatters`](super::Engine::chatters).
    pub(super) window: Window,
    pub(super) crowd: usize,
}

/// Events of contacts.
pub(super) struct ContactEvents {
    /// Those whose contacts are to be sampled, by contact.
    pub(super) wanted: Vec<bool>,
    /// Memory for events of contacts.
    pub(super) scene: SceneRoom,
    /// Do bounds that contacts were left out for say nothing?
    pub(super) passes_bounds: bool,
    /// Since when there were impacts without time between them, and how many.
    pub(super) burst: (f64, usize),
    /// Contact modes with controls and parameters, from times on, for forces afterwards.
    pub(super) phases: Vec<Phase>,
}

/// What a run leaves.
pub(super) struct Log {
    /// Complaints of functions before the present step.
    pub(super) heard: usize,
    pub(super) outcome: Outcome,
    pub(super) reason: String,
    /// The transition that ended the run.
    pub(super) stopped_by: Option<usize>,
    pub(super) switches: Vec<Switch>,
    pub(super) jumps: Vec<Jump>,
    pub(super) notes: Vec<Noted>,
    pub(super) impacts: Vec<Impact>,
    pub(super) branchings: Vec<Branching>,
    pub(super) contacts: Vec<Contact>,
    pub(super) accumulations: Vec<Accumulation>,
    pub(super) stats: Statistics,
    pub(super) path: Option<Path>,
    pub(super) sampled: Sampled,
    pub(super) one_sided: bool,
    /// Had it a choice: did several active sets continue the motion somewhere?
    pub(super) ambiguous: bool,
}

/// Derivatives along the run.
pub(super) struct Derivatives {
    pub(super) sens: Option<Sens>,
    pub(super) tape: Option<Tape>,
    /// The last transition made.
    pub(super) reset: Reset,
    /// Derivatives of the time of a switch.
    pub(super) time_row: Vec<f64>,
    /// Room for products with a Jacobian, and what they said last of the longest step for derivatives, at which step.
    pub(super) powers: [Vec<f64>; 3],
    pub(super) nonzero: Vec<(usize, usize, f64)>,
    pub(super) variational: (f64, usize),
    /// Looks in a row at which stability allowed much less than the state wanted.
    pub(super) held_back: usize,
}
