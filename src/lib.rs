//! Simulation and optimal control of systems that switch.
//!
//! A piecewise smooth system
//!
//! ```text
//! ẋ = f0(x,u,p,t) + Σ_k Σ_i θ_i^k f_i^k(x,u,p,t),   mode i of subsystem k valid in its region R_i^k
//! ```
//!
//! becomes a dynamic complementarity system, is discretised by finite elements with switch detection, and solved as a
//! mathematical program with complementarity constraints by an interior-point method over sparse LDLᵀ factorisations.
//!
//! - State a system: as expressions with operators that switch ([`model`], of [`expr`]essions), or of functions
//!   ([`system`], [`func`]); mechanical systems with contacts: [`scene`]; time-freezing: [`freezing`].
//! - Simulate it: event-driven ([`event`]), with fixed steps of finite elements ([`sim`]), or by time stepping
//!   ([`stepping`]).
//! - Control it optimally ([`ocp`]), in real time ([`nmpc`]); pass it on to other simulators ([`fmu`]); solve programs with complementarity constraints ([`mpcc`]).
//! - Options are one type, [`Settings`]; what goes wrong is an [`Error`]; models and problems are written and read as
//!   JSON by [`document`].
//!
//! What most programs need is at the root:
//!
//! ```
//! use switchback::{Graph, Model, Ocp, Outcome, Settings, SolveControl};
//!
//! // A mass with dry friction: x' = v, v' = u - 0.3 sign(v).
//! let g = Graph::new();
//! let (v, u) = (g.x(1), g.u(0));
//! let built = Model::from_rhs("friction", 1, 0, &[v, u - 0.3 * v.sign()])?.build(&g)?;
//!
//! // With u = 0 it slides until it sticks, at t = 1/0.3.
//! let run = switchback::simulate(&built.system, &Default::default(), 0.0, &[0.0, 1.0], 5.0)?;
//! assert!((run.switches[0].t - 1.0 / 0.3).abs() < 1e-9);
//!
//! // To x = 1 at rest within two units of time, with the least integral of u^2 / 2.
//! let mut ocp = Ocp::new(&built.system, 2.0, 8, &Settings::default())?;
//! ocp.set_x0(&[0.0, 0.0])?;
//! let cost = g.function("L", built.dims, &[0.5 * u * u])?;
//! ocp.set_lagrange(std::sync::Arc::new(cost))?;
//! let end = g.function("e", built.dims, &[g.x(0), v])?;
//! ocp.add_terminal(std::sync::Arc::new(end), &[1.0, 0.0], &[1.0, 0.0])?;
//! ocp.set_u_bounds(&[-3.0], &[3.0])?;
//! let answer = ocp.solve(&mut SolveControl::default())?;
//! assert_eq!(answer.outcome, Outcome::Solved);
//! # Ok::<(), switchback::Error>(())
//! ```
//!
//! Structs of options gain fields, and enumerations of outcomes may gain variants, in minor versions: end literals of
//! options with `..Default::default()`, and matches with `_` where the compiler asks for it. Modules that this page does not list are the parts these are
//! made of; they change without notice.
//!
//! The build needs the libraries LDL and AMD of SuiteSparse (Debian: `libsuitesparse-dev`), unless the feature
//! `suitesparse`, which is on by default, is left out. The solver of programs with complementarity constraints alone is the crate
//! `switchback-mpcc`, and the C interface is the crate `switchback-capi`: this one has no C symbols.
//!
//! Equation and section numbers in brackets are those of A. Nurkanović, *Numerical Methods for Optimal Control of
//! Nonsmooth Dynamical Systems* (PhD thesis, Freiburg 2023). docs/dev/architecture.md has the layers.
#![deny(unsafe_code)]
#![warn(missing_docs)]
#![allow(clippy::needless_range_loop)]
// Descriptions name the parts a module is made of, private ones too; in the pages these are plain text.
#![allow(rustdoc::private_intra_doc_links)]

/// As in the standard library, but `vec![value; n]` with a large `n` unwinds where memory cannot be had.
macro_rules! vec {
    ($value:expr; $n:expr) => { $crate::memory::filled($value, $n) };
    ($($tokens:tt)*) => { ::std::vec![$($tokens)*] };
}

// What programs use.
pub mod document;
pub mod event;
pub mod expr;
pub mod fmu;
pub mod freezing;
pub mod model;
pub mod nmpc;
pub mod ocp;
pub mod scene;
pub mod sim;
pub mod stepping;
pub mod system;
pub use switchback_mpcc::{error, func, mpcc, settings};

// What these are made of: open to the C interface, and to the tests and benchmarks of this package; not part of the interface
// of the crate.
pub(crate) mod contact;
#[doc(hidden)]
pub mod dcs;
#[doc(hidden)]
pub mod fesd;
#[doc(hidden)]
pub mod jumps;
#[doc(hidden)]
pub mod qp;
pub(crate) mod search;
#[doc(hidden)]
pub mod session;
#[doc(hidden)]
pub mod tableau;
#[doc(hidden)]
pub use switchback_mpcc::{linalg, memory, nlp, stop};
pub(crate) use switchback_mpcc::{parallel, random};

// The programs of the page are run.
#[cfg(doctest)]
#[doc = include_str!("../docs/rust.md")]
pub mod page {}

pub use dcs::Dcs;
pub use error::{Error, Result};
pub use event::{simulate, simulate_batch, Engine, Run};
pub use expr::{Expr, Graph};
pub use fesd::{PathAt, Trajectory};
pub use func::{Callback, Dims, Function, Point};
pub use model::Model;
pub use mpcc::{Mpcc, MpccSettings, MpccSolver};
pub use nlp::{Control as SolveControl, IterationInfo, Outcome, Residuals, Statistics};
pub use nmpc::Nmpc;
pub use ocp::{MultiPhase, Ocp, OcpResult};
pub use scene::Scene;
pub use settings::Settings;
pub use sim::Simulator;
pub use system::{Regions, SharedFunction, Subsystem, System};
