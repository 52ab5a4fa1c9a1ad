//! The solver of programs with complementarity constraints as AMPL, Pyomo and JuMP call it: `.nl` files in, `.sol` files out.
//!
//! [`nl`] reads a problem, [`translate`](mod@translate) makes a program of it, and [`driver`] is the command. The page
//! `docs/howto/ampl.md` is for its users.
//!
//! ```
//! use switchback_mpcc_ampl::{nl, translate::translate};
//!
//! // A file without variables is refused with the line, and what was expected there.
//! let e = nl::read(b"g3 1 1 0\n 1 0\n").err().unwrap();
//! assert!(e.to_string().contains("numbers of variables"), "{e}");
//! # let _ = translate;
//! ```
#![deny(unsafe_code)]
#![warn(missing_docs)]

pub mod driver;
pub mod expression;
pub mod nl;
pub mod options;
pub mod program;
pub mod sol;
pub mod statement;
pub mod translate;
pub mod truth;
pub mod verdict;
