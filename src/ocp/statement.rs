//! A problem as it was stated, for who writes it down.

use super::{Durations, Ocp};
use crate::fesd::{PathConstraint, Terminal};
use crate::settings::Settings;
use crate::system::{SharedFunction, System};

/// Everything that was set, nothing that was computed.
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct Statement<'a> {
    pub system: &'a System,
    pub settings: &'a Settings,
    pub horizon: f64,
    pub n_stages: usize,
    pub t0: f64,
    pub lagrange: Option<&'a SharedFunction>,
    pub mayer: Option<&'a SharedFunction>,
    pub path: &'a [PathConstraint],
    pub terminal: &'a [Terminal],
    pub x_bounds: &'a [Vec<f64>; 2],
    pub x0_bounds: &'a [Vec<f64>; 2],
    pub u_bounds: &'a [Vec<f64>; 2],
    pub params: &'a [f64],
    /// Times and states.
    pub x_guess: Option<&'a (Vec<f64>, Vec<f64>)>,
    pub u_guess: Option<&'a [f64]>,
    /// Something was set that is not among the above: free or uneven lengths, elements by stage, linear controls, least
    /// squares, relaxed constraints, constraints between the ends, parameters that are free or differ by stage.
    pub more: Option<&'static str>,
}

impl Ocp {
    /// The problem as it was stated.
    pub fn statement(&self) -> Statement<'_> {
        // without `..`: what is added to a problem must be written down too
        let Ocp {
            system,
            settings,
            horizon,
            n_stages,
            t0,
            durations,
            time,
            time_bounds: _,
            n_fe,
            linear,
            lagrange,
            mayer,
            squares,
            path,
            terminal,
            boundary,
            soft,
            x_bounds,
            x0_bounds,
            u_bounds,
            p_bounds,
            params,
            stage_params,
            x_guess,
            u_guess,
            built: _,
            engine: _,
            result: _,
        } = self;
        let more = [
            (*time != Durations::Fixed, "free lengths"),
            (durations.iter().any(|d| *d != durations[0]), "stages of different lengths"),
            (!n_fe.is_empty(), "elements by stage"),
            (linear.contains(&true), "linear controls"),
            (!squares.is_empty(), "least squares"),
            (!boundary.is_empty(), "constraints between the ends"),
            (!soft.is_empty(), "relaxed constraints"),
            (p_bounds.is_some(), "bounds of parameters"),
            (stage_params.is_some(), "parameters by stage"),
        ];
        Statement {
            system,
            settings,
            horizon: *horizon,
            more: more.iter().find(|m| m.0).map(|m| m.1),
            n_stages: *n_stages,
            t0: *t0,
            lagrange: lagrange.as_ref(),
            mayer: mayer.as_ref(),
            path,
            terminal,
            x_bounds,
            x0_bounds,
            u_bounds,
            params,
            x_guess: x_guess.as_ref(),
            u_guess: u_guess.as_deref(),
        }
    }
}
