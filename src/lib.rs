//! Simulation and optimal control of systems that switch.
//!
//! A piecewise smooth system
//!
//! ```text
//! ẋ = f0(x,u,p,t) + Σ_k Σ_i θ_i^k f_i^k(x,u,p,t),   mode i of subsystem k valid in its region R_i^k
//! ```
//!
//! becomes a dynamic complementarity system ([`dcs`]), is discretised by finite elements with switch detection
//! ([`fesd`]), and solved as a mathematical program with complementarity constraints ([`mpcc`]) by an interior-point
//! method ([`nlp`]) over sparse LDLᵀ factorisations ([`linalg`]). [`system`] states models made of [`func`]tions,
//! [`event`] and [`sim`] simulate them, [`ocp`] controls them optimally. [`capi`] is the C interface over all of it.
//!
//! Equation and section numbers in brackets are those of A. Nurkanović, *Numerical Methods for Optimal Control of
//! Nonsmooth Dynamical Systems* (PhD thesis, Freiburg 2023). ARCHITECTURE.md has the layers and the decisions.
#![deny(unsafe_code)]
#![warn(missing_docs)]
#![allow(clippy::needless_range_loop)]

#[macro_use]
pub mod memory;

pub mod capi;
pub(crate) mod contact;
pub mod dcs;
pub mod document;
pub mod error;
pub mod event;
pub mod expr;
pub mod fesd;
pub mod freezing;
pub mod func;
pub mod jumps;
pub mod linalg;
pub mod model;
pub mod mpcc;
pub mod nlp;
pub mod nmpc;
pub mod ocp;
pub mod qp;
pub mod scene;
pub mod settings;
pub mod sim;
pub mod stepping;
pub mod stop;
pub mod system;
pub mod tableau;
