//! What this layer takes of the options: written by `make header` from options.toml of the settings; do not edit.

use crate::settings::{AmbiguityPolicy, Integration, Selection, Sensitivity, Settings, ZenoPolicy};

/// Settings of a simulation.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Integration method of the modes in event-driven simulation.
    pub method: Integration,
    /// Relative tolerance of the local error in event-driven simulation.
    pub rtol: Vec<f64>,
    /// Absolute tolerance of the local error in event-driven simulation.
    pub atol: Vec<f64>,
    /// First step of an event-driven simulation; 0: the library chooses.
    pub h0: f64,
    /// Longest step of an event-driven simulation.
    pub h_max: f64,
    /// Limit on the steps of an event-driven simulation, accepted and rejected.
    pub max_steps: usize,
    /// Limit on the switches in the log of an event-driven simulation; further ones are only counted.
    pub max_log: usize,
    /// Continuation of an event-driven simulation where switches accumulate.
    pub zeno: ZenoPolicy,
    /// Continuation of an event-driven simulation where it is not unique.
    pub ambiguity: AmbiguityPolicy,
    /// Keep the dense output of an event-driven simulation.
    pub dense: bool,
    /// Compute the derivatives of an event-driven simulation and of its switching times.
    pub sensitivity: Sensitivity,
    /// Record an event-driven simulation for adjoint derivatives.
    pub adjoint: bool,
    /// Limit on the bytes that building, solving or simulating may take; 0: no limit.
    pub max_memory: usize,
    /// Velocity of a sliding mode where surfaces meet and their effects multiply. Where the chosen rule has no weights between 0 and 1, an extreme velocity is taken.
    pub selection: Selection,
    /// Dense output keeps at least so many of the last steps, and at most a quarter more: older ones are dropped; 0: all.
    pub dense_steps: usize,
    /// Modes of every subsystem, the preferred first, for [`AmbiguityPolicy::Prefer`]; those that are not named come last.
    pub preferred: Vec<Vec<usize>>,
}

impl Default for Options {
    fn default() -> Options {
        Options::from(&Settings::default())
    }
}

impl From<&Settings> for Options {
    /// Numbers that are no value of an enumeration count as its default; [`Settings::validate`] names them.
    fn from(s: &Settings) -> Options {
        Options {
            method: s.integration().unwrap_or(Integration::Auto),
            rtol: vec![s.rtol],
            atol: vec![s.atol],
            h0: s.h_init,
            h_max: s.h_max,
            max_steps: usize::try_from(s.max_steps).unwrap_or(0),
            max_log: usize::try_from(s.max_switches).unwrap_or(0),
            zeno: s.zeno().unwrap_or(ZenoPolicy::Continue),
            ambiguity: s.ambiguity().unwrap_or(AmbiguityPolicy::First),
            dense: s.dense(),
            sensitivity: s.sensitivity().unwrap_or(Sensitivity::Off),
            adjoint: s.adjoint(),
            max_memory: usize::try_from(s.max_memory).unwrap_or(0),
            selection: s.selection().unwrap_or(Selection::Bilinear),
            dense_steps: usize::try_from(s.dense_steps).unwrap_or(0),
            preferred: Vec::new(),
        }
    }
}
