//! Mathematical programs with complementarity constraints:
//!
//! ```text
//! min f(w)   s.t.   w_l ≤ w ≤ w_u,   c_l ≤ c(w) ≤ c_u,   0 ≤ G_k(w) ⊥ H_k(w) ≥ 0 for k = 1, ..., K
//! ```
//!
//! An interior-point method over sparse LDLᵀ factorisations follows a path of relaxed problems. Then the member of each pair
//! that is zero is identified, and the problem with that choice is solved to the last digits. What kind of stationary point the
//! solution is, its multipliers prove.
//!
//! - State a program: functions ([`func`]) make a [`nlp::CallbackNlp`], and [`mpcc::Lifted`] adds the pairs. Programs of another
//!   kind implement [`Nlp`] and [`Mpcc`].
//! - Solve it: [`MpccSolver`], with [`MpccSettings`]. [`mpcc::Solution`] has the point, its multipliers, and the
//!   [`mpcc::Certificate`]. Programs without pairs: [`nlp::Ipm`].
//! - Diagnose it: [`mpcc::diagnostics`].
//!
//! ```
//! use std::sync::Arc;
//! use switchback_mpcc::mpcc::{BStationarity, Lifted, Member, Stationarity};
//! use switchback_mpcc::nlp::{Bounds, CallbackNlp};
//! use switchback_mpcc::{Callback, Control, Dims, MpccSettings, MpccSolver, Outcome};
//!
//! // min (x - 1)² + (y - 2)²  s.t.  0 ≤ x ⊥ y ≥ 0, with derivatives by differences
//! let cost = Callback::new("cost", Dims { x: 2, u: 0, p: 0 }, 1, |at, out| {
//!     out[0] = (at.x[0] - 1.0).powi(2) + (at.x[1] - 2.0).powi(2);
//!     0
//! });
//! let program = CallbackNlp::new(2, 0, Arc::new(cost), None)?;
//! let mut problem = Lifted::new(program, &[(Member::Variable(0), Member::Variable(1))])?;
//! let bounds = problem.bounds(&Bounds { xl: vec![0.0; 2], ..Bounds::free(2, 0) })?;
//! let start = problem.start(&[0.5, 0.5]);
//!
//! let settings = MpccSettings { tol: 1e-8, ..MpccSettings::default() };
//! let mut solver = MpccSolver::new(&mut problem, settings)?;
//! let found = solver.solve(&mut problem, &bounds, &start, &mut Control::default());
//! assert_eq!(found.outcome, Outcome::Solved);
//! assert!(found.x[0] == 0.0 && (found.x[1] - 2.0).abs() < 1e-6);
//! assert_eq!(found.certificate.stationarity, Stationarity::S);
//! assert_eq!(found.certificate.b, BStationarity::Yes);
//! # Ok::<(), switchback_mpcc::Error>(())
//! ```
//!
//! Structs of options gain fields in minor versions: end their literals with `..Default::default()`. Modules that this page does
//! not list are what these are made of; they change without notice. The table of options in [`settings`] is that of the crate
//! `switchback`, most of whose options are about systems that switch; [`MpccSettings`] has those of this crate.
//!
//! The build needs the libraries LDL and AMD of SuiteSparse (Debian: `libsuitesparse-dev`), unless the feature `suitesparse`,
//! which is on by default, is left out.
//!
//! Equation and section numbers in brackets are those of A. Nurkanović, *Numerical Methods for Optimal Control of
//! Nonsmooth Dynamical Systems* (PhD thesis, Freiburg 2023).
#![deny(unsafe_code)]
#![warn(missing_docs)]
#![allow(clippy::needless_range_loop)]
// Descriptions name the parts a module is made of, private ones too; in the pages these are plain text.
#![allow(rustdoc::private_intra_doc_links)]

#[macro_use]
#[doc(hidden)]
pub mod memory;

// What programs use.
pub mod error;
pub mod func;
pub mod linalg;
pub mod mpcc;
pub mod nlp;
pub mod settings;
pub mod stop;

// What these are made of: open to the crate `switchback`, not part of the interface of this one.
#[doc(hidden)]
pub mod parallel;
#[doc(hidden)]
pub mod random;

pub use error::{Error, Result};
pub use func::{Callback, Dims, Function, Point};
pub use mpcc::{Mpcc, MpccSettings, MpccSolver};
pub use nlp::{Control, IterationInfo, Nlp, Outcome, Residuals, Statistics};
