//! Simulation and optimal control of systems that switch.
#![deny(unsafe_code)]
#![warn(missing_docs)]
#![allow(clippy::needless_range_loop)]

pub mod capi;
pub mod dcs;
pub mod error;
pub mod fesd;
pub mod func;
pub mod linalg;
pub mod mpcc;
pub mod nlp;
pub mod ocp;
pub mod settings;
pub mod sim;
pub mod system;
pub mod tableau;
