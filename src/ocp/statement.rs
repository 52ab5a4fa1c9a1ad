//! A problem as it was stated, for who writes it down.

use super::extend::{Complementarity, LeastSquares, Soft};
use super::{Durations, Jumps, ModeSequence, Nominal, Ocp};
use crate::fesd::{Boundary, PathConstraint, Terminal};
use crate::func::Function;
use crate::settings::Settings;
use crate::system::{SharedFunction, System};

/// Everything that was set, nothing that was computed.
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct Statement<'a> {
    pub system: &'a System,
    /// The system as events follow it: another one than that of the finite elements where it is projected.
    pub simulated: &'a System,
    pub jumps: Jumps,
    /// Is an order of contacts given to start from?
    pub gives_contacts: bool,
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
    pub durations: &'a [f64],
    pub time: Durations,
    pub time_bounds: [f64; 2],
    /// Empty: as the settings say.
    pub n_fe: &'a [usize],
    pub linear: &'a [bool],
    pub boundary: &'a [Boundary],
    pub p_bounds: Option<&'a [Vec<f64>; 2]>,
    pub nominal: &'a Nominal,
    pub stage_params: Option<&'a [f64]>,
    pub(crate) squares: &'a [LeastSquares],
    pub(crate) soft: &'a [Soft],
    pub(crate) complementarity: &'a [Complementarity],
    pub modes: Option<&'a ModeSequence>,
}

impl Statement<'_> {
    /// True where functions of the problem must be called by one thread only ([`crate::func::Function::is_serial`]).
    pub fn is_serial(&self) -> bool {
        self.system.is_serial() || self.any_function(&|f| f.is_serial())
    }

    /// Is something true of a function of costs and constraints?
    fn any_function(&self, is: &dyn Fn(&dyn Function) -> bool) -> bool {
        let is = |f: &SharedFunction| is(f.as_ref());
        self.lagrange.into_iter().chain(self.mayer).any(is)
            || self.path.iter().any(|c| is(&c.f))
            || self.terminal.iter().any(|c| is(&c.f))
            || self.boundary.iter().any(|c| is(&c.f))
            || self.squares.iter().any(|c| is(&c.f))
            || self.soft.iter().any(|c| is(&c.f))
            || self.complementarity.iter().any(|c| is(&c.a) || is(&c.b))
    }
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
            time_bounds,
            n_fe,
            linear,
            lagrange,
            mayer,
            squares,
            path,
            terminal,
            boundary,
            soft,
            complementarity,
            x_bounds,
            x0_bounds,
            u_bounds,
            p_bounds,
            nominal,
            params,
            stage_params,
            x_guess,
            u_guess,
            modes,
            built: _,
            builds: _,
            engine: _,
            result: _,
            sizes: _,
            measured: _,
            largest: _,
            shifted: _,
            scene,
            chosen: _,
            clearance: _,
            inside: _,
            projected,
            simulated: _,
        } = self;
        Statement {
            system,
            simulated: projected.as_ref().unwrap_or(system),
            jumps: scene.method(),
            gives_contacts: scene.gives_sequence(),
            settings,
            horizon: *horizon,
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
            durations,
            time: *time,
            time_bounds: *time_bounds,
            n_fe,
            linear,
            boundary,
            p_bounds: p_bounds.as_ref(),
            nominal,
            stage_params: stage_params.as_deref(),
            squares,
            soft,
            complementarity,
            modes: modes.as_ref(),
        }
    }
}
