//! Feedback in real time: model predictive control by a few iterations per sample (chapter 10).
//!
//! A controller keeps a linearisation of the optimal control problem and improves it between samples. At a sample
//! [`Nmpc::feedback`] embeds the measured state into the quadratic program that [`Nmpc::prepare`] made and factorised; no model
//! function is evaluated. The problem is that of an [`crate::ocp::Ocp`]: costs along the horizon are summed over the starts of
//! the stages as in (10.1), path constraints hold there.
//!
//! ```text
//! nodes          times, parameters, algebraic states
//! stage          x_{k+1} = ψ(x_k, u_k), A_k, B_k, adjoints: explicit and implicit Runge-Kutta, events
//! cost, constraints
//! linearise      quadratic programs of levels B, C, D at a point; steps belong to them
//! branch         alternatives where a system sticks, and where controls choose
//! choices        sequences of values that controls choose
//! controller     schemes: real-time iterations, multi-level iterations, advanced steps
//! monitor        contraction, times, counts
//! standby        the last plan with its feedback law
//! code           controllers as C files
//! estimator      states and parameters from what was measured, with the same programs
//! arrival        what is known of samples that left its window
//! worker         preparations on a thread of their own
//! ```

mod arrival;
mod branch;
mod choices;
mod code;
mod constraints;
mod controller;
mod cost;
mod estimator;
mod evaluate;
mod iterate;
mod linearise;
mod monitor;
mod nodes;
mod options;
mod problem;
mod quasi_newton;
mod stage;
mod standby;
mod worker;

pub use code::CCode;
pub use controller::{Feedback, Nmpc, Preparation};
pub use estimator::{Estimate, Mhe, MheOptions, Noise};
pub use iterate::Iterate;
pub use linearise::HessianKind;
pub use monitor::{Monitor, Timing};
pub use options::{Level, Options, QpMethod, Scheme, Source};
pub use stage::Evaluations;
pub use worker::Worker;
