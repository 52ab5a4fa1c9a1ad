//! Mathematical programs with complementarity constraints.
//!
//! TODO
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
pub mod mpcc;
pub mod nlp;
pub mod settings;

// What these are made of: open to the crate `switchback`, not part of the interface of this one.
pub mod linalg;
#[doc(hidden)]
pub mod parallel;
#[doc(hidden)]
pub mod random;
pub mod stop;

pub use error::{Error, Result};
pub use func::{Callback, Dims, Function, Point};
pub use mpcc::{Mpcc, MpccSettings, MpccSolver};
pub use nlp::{Control, IterationInfo, Nlp, Outcome, Residuals, Statistics};
