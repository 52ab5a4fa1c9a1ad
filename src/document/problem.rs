//! Simulations and optimal control problems.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::parts::{sizes, Interval, SavedFunction, SavedSettings, SavedSystem};
use crate::error::{finite, Error, Result};
use crate::fesd::PathAt;
use crate::func::Function;
use crate::ocp::{Ocp, Statement};
use crate::settings::Settings;
use crate::system::System;

/// A simulation to be run: where it starts, how long it goes on, with which settings.
#[derive(Clone)]
#[allow(missing_docs)]
pub struct Simulation {
    pub system: System,
    pub settings: Settings,
    pub t0: f64,
    pub x0: Vec<f64>,
    pub u: Vec<f64>,
    pub p: Vec<f64>,
    pub duration: f64,
    pub n_steps: usize,
}

#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SavedSimulation {
    system: SavedSystem,
    settings: SavedSettings,
    t0: f64,
    x0: Vec<f64>,
    u: Vec<f64>,
    p: Vec<f64>,
    duration: f64,
    n_steps: usize,
}

impl SavedSimulation {
    pub(super) fn new(s: &Simulation) -> Result<SavedSimulation> {
        Ok(SavedSimulation {
            system: SavedSystem::new(&s.system)?,
            settings: SavedSettings::new(&s.settings)?,
            t0: s.t0,
            x0: s.x0.clone(),
            u: s.u.clone(),
            p: s.p.clone(),
            duration: s.duration,
            n_steps: s.n_steps,
        })
    }

    pub(super) fn restore(&self, supplied: &[Arc<dyn Function>]) -> Result<Simulation> {
        let system = self.system.restore(supplied)?;
        system.validate()?;
        let d = system.dims();
        finite("initial time", &[self.t0], 1)?;
        finite("duration", &[self.duration], 1)?;
        finite("state", &self.x0, d.x)?;
        finite("control", &self.u, d.u)?;
        finite("parameter", &self.p, d.p)?;
        sizes("steps", &[self.n_steps])?;
        Ok(Simulation {
            system,
            settings: self.settings.restore()?,
            t0: self.t0,
            x0: self.x0.clone(),
            u: self.u.clone(),
            p: self.p.clone(),
            duration: self.duration,
            n_steps: self.n_steps,
        })
    }
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum SavedAt {
    ControlGrid,
    Elements,
    StagePoints,
    Terminal,
}

/// A constraint along the horizon or at its end.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedConstraint {
    at: SavedAt,
    f: SavedFunction,
    bounds: Interval,
}

#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedGuess {
    times: Vec<f64>,
    states: Vec<f64>,
}

#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SavedOcp {
    system: SavedSystem,
    settings: SavedSettings,
    horizon: f64,
    n_stages: usize,
    t0: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    lagrange: Option<SavedFunction>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    mayer: Option<SavedFunction>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    constraints: Vec<SavedConstraint>,
    state_bounds: Interval,
    initial_bounds: Interval,
    control_bounds: Interval,
    params: Vec<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    state_guess: Option<SavedGuess>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    control_guess: Option<Vec<f64>>,
}

impl SavedOcp {
    pub(super) fn new(s: &Statement, settings: &Settings) -> Result<SavedOcp> {
        if let Some(what) = s.more {
            return Err(Error::Unsupported(format!("a problem with {what} cannot be written down")));
        }
        let interval = |b: &[Vec<f64>; 2]| Interval::new(&b[0], &b[1]);
        let mut constraints = Vec::new();
        for c in s.path {
            let at = match c.at {
                PathAt::ControlGrid => SavedAt::ControlGrid,
                PathAt::Elements => SavedAt::Elements,
                PathAt::StagePoints => SavedAt::StagePoints,
            };
            let bounds = Interval::new(&c.lower, &c.upper);
            constraints.push(SavedConstraint { at, f: SavedFunction::new(&c.f)?, bounds });
        }
        for c in s.terminal {
            let bounds = Interval::new(&c.lower, &c.upper);
            constraints.push(SavedConstraint { at: SavedAt::Terminal, f: SavedFunction::new(&c.f)?, bounds });
        }
        Ok(SavedOcp {
            system: SavedSystem::new(s.system)?,
            settings: SavedSettings::new(settings)?,
            horizon: s.horizon,
            n_stages: s.n_stages,
            t0: s.t0,
            lagrange: s.lagrange.map(SavedFunction::new).transpose()?,
            mayer: s.mayer.map(SavedFunction::new).transpose()?,
            constraints,
            state_bounds: interval(s.x_bounds),
            initial_bounds: interval(s.x0_bounds),
            control_bounds: interval(s.u_bounds),
            params: s.params.to_vec(),
            state_guess: s.x_guess.map(|g| SavedGuess { times: g.0.clone(), states: g.1.clone() }),
            control_guess: s.u_guess.map(<[f64]>::to_vec),
        })
    }

    pub(super) fn restore(&self, supplied: &[Arc<dyn Function>]) -> Result<Ocp> {
        sizes("stages", &[self.n_stages])?;
        let system = self.system.restore(supplied)?;
        let mut ocp = Ocp::new(&system, self.horizon, self.n_stages, &self.settings.restore()?)?;
        ocp.set_t0(self.t0)?;
        if let Some(f) = &self.lagrange {
            ocp.set_lagrange(f.restore(supplied)?)?;
        }
        if let Some(f) = &self.mayer {
            ocp.set_mayer(f.restore(supplied)?)?;
        }
        for c in &self.constraints {
            let (f, [lower, upper]) = (c.f.restore(supplied)?, c.bounds.values());
            match c.at {
                SavedAt::Terminal => ocp.add_terminal(f, &lower, &upper)?,
                SavedAt::ControlGrid => ocp.add_path(f, &lower, &upper, PathAt::ControlGrid)?,
                SavedAt::Elements => ocp.add_path(f, &lower, &upper, PathAt::Elements)?,
                SavedAt::StagePoints => ocp.add_path(f, &lower, &upper, PathAt::StagePoints)?,
            }
        }
        let bounds = [&self.state_bounds, &self.initial_bounds, &self.control_bounds];
        let [x, x0, u] = bounds.map(Interval::values);
        ocp.set_x_bounds(&x[0], &x[1])?;
        ocp.set_x0_bounds(&x0[0], &x0[1])?;
        ocp.set_u_bounds(&u[0], &u[1])?;
        ocp.set_params(&self.params)?;
        if let Some(g) = &self.state_guess {
            ocp.set_x_guess(&g.times, &g.states)?;
        }
        if let Some(u) = &self.control_guess {
            ocp.set_u_guess(u)?;
        }
        Ok(ocp)
    }
}
