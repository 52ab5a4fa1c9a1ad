//! Optimal control of scenes in physical time: contacts, impacts and friction as finite elements with jumps.
//!
//! - [`modal`]: the *contact mode program*, smooth, for given contact modes and jumps. Every answer is one of its solutions.
//! - [`complementary`]: *FESD with jumps*, an MPCC that finds modes and jumps.
//! - [`frozen`]: the problem in the numerical time of time-freezing, by finite elements with switch detection.
//! - [`sources`]: orders of contacts from simulations and from these programs.
//! - [`space`]: the orders as the race of all sources searches them; [`search`]: what it is asked for.
//!
//! All programs are sums of model functions at points ([`assembly`]); [`transcribe`] writes motion, costs and constraints, which
//! are the same for all of them.

mod align;
mod answer;
#[cfg(test)]
mod arrival_tests;
mod assembly;
mod blame;
#[cfg(test)]
mod chain_tests;
mod complementary;
#[cfg(test)]
mod derivative_tests;
mod exact;
mod frozen;
mod functions;
mod guards;
mod missed;
mod modal;
mod modes;
mod neighbours;
mod options;
mod overlap;
mod problem;
mod reach;
mod refine;
mod result;
mod scales;
mod search;
mod sensitivity;
#[cfg(test)]
mod short_phase_tests;
mod simulate;
mod sources;
mod space;
mod stepping;
mod track;
mod transcribe;

pub use answer::{Answer, Findings, Found, Paradox};
pub use blame::Blame;
pub use exact::Solved;
pub use missed::{Missed, Of};
pub use modes::{ContactMode, Key, Phase, Sequence};
pub use options::{Lead, Method, Options};
pub use problem::{Problem, Statement};
pub use refine::{refine, Aim, Refined};
pub(crate) use result::trajectory;
pub use result::Contacts;
pub use search::{go_on_from, solve};
pub use sensitivity::Derivatives;
pub use simulate::{met, replay, Met, Replay};
pub use transcribe::Broken;
