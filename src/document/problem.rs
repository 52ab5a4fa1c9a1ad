//! Simulations and optimal control problems.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::parts::{Interval, SavedFunction, SavedSettings, SavedSystem};
use crate::error::{check_run, finite, Error, Result};
use crate::fesd::PathAt;
use crate::func::{Function, Maximum};
use crate::memory::sizes::check as sizes;
use crate::ocp::{CostAt, CostOf, Durations, Jumps, ModeSequence, Nominal, Norm, Ocp, Statement, TransitionAt};
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
        check_run(self.duration, i64::try_from(self.n_steps).unwrap_or(i64::MAX))?;
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
    /// Between the initial and the final state.
    BothEnds,
}

impl SavedAt {
    fn of(at: PathAt) -> SavedAt {
        match at {
            PathAt::ControlGrid => SavedAt::ControlGrid,
            PathAt::Elements => SavedAt::Elements,
            PathAt::StagePoints => SavedAt::StagePoints,
        }
    }

    /// Along the horizon; `None` at its end.
    fn path(self) -> Option<PathAt> {
        match self {
            SavedAt::ControlGrid => Some(PathAt::ControlGrid),
            SavedAt::Elements => Some(PathAt::Elements),
            SavedAt::StagePoints => Some(PathAt::StagePoints),
            SavedAt::Terminal | SavedAt::BothEnds => None,
        }
    }
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum SavedNorm {
    L1,
    L2,
    Linf,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum SavedPlace {
    Running,
    ControlGrid,
    Terminal,
}

/// A price for the violation of a constraint.
#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedPrice {
    norm: SavedNorm,
    weight: f64,
    /// No constraint of the user: a maximum in a cost.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    kink_of: Option<SavedCost>,
}

/// A cost that has kinks.
#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum SavedCost {
    Running,
    Terminal,
}

impl SavedCost {
    fn of(cost: CostOf) -> SavedCost {
        match cost {
            CostOf::Running => SavedCost::Running,
            CostOf::Terminal => SavedCost::Terminal,
        }
    }

    fn cost(self) -> CostOf {
        match self {
            SavedCost::Running => CostOf::Running,
            SavedCost::Terminal => CostOf::Terminal,
        }
    }
}

/// A least-squares term.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedSquares {
    f: SavedFunction,
    weights: Vec<f64>,
    references: Vec<f64>,
    place: SavedPlace,
}

/// Lengths of the stages where they are variables; else only `durations` counts.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedTime {
    durations: Vec<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    free: Option<SavedFree>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    bounds: Option<Interval>,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum SavedFree {
    Horizon,
    Stages,
}

/// A constraint along the horizon or at its end.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedConstraint {
    at: SavedAt,
    f: SavedFunction,
    bounds: Interval,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    relaxed: Option<SavedPrice>,
}

/// Two functions that are not negative, one of which is zero.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedComplementarity {
    at: SavedAt,
    a: SavedFunction,
    b: SavedFunction,
}

#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedGuess {
    times: Vec<f64>,
    states: Vec<f64>,
}

/// Usual sizes of quantities, as far as they are known.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedNominal {
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    states: Vec<Option<f64>>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    controls: Vec<Option<f64>>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    params: Vec<Option<f64>>,
}

/// An order of modes to start from.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedModes {
    times: Vec<f64>,
    modes: Vec<bool>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    cells: Vec<bool>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    transitions: Vec<SavedAtTime>,
}

/// A transition of such an order.
#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedAtTime {
    t: f64,
    transition: usize,
    stage: usize,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    at_once: bool,
}

impl SavedAtTime {
    fn of(t: &TransitionAt) -> SavedAtTime {
        SavedAtTime { t: t.t, transition: t.transition, stage: t.stage, at_once: t.at_once }
    }

    fn transition(&self) -> TransitionAt {
        TransitionAt { t: self.t, transition: self.transition, stage: self.stage, at_once: self.at_once }
    }
}

/// How contact modes of a scene are found; the default is not written.
#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum SavedJumps {
    Modes,
    FesdJ,
    Steps,
    Shots,
    Freezing,
}

impl SavedJumps {
    fn of(method: Jumps) -> Option<SavedJumps> {
        Some(match method {
            Jumps::Auto => return None,
            Jumps::Modes => SavedJumps::Modes,
            Jumps::FesdJ => SavedJumps::FesdJ,
            Jumps::Steps => SavedJumps::Steps,
            Jumps::Shots => SavedJumps::Shots,
            Jumps::Freezing => SavedJumps::Freezing,
        })
    }

    fn method(self) -> Jumps {
        match self {
            SavedJumps::Modes => Jumps::Modes,
            SavedJumps::FesdJ => Jumps::FesdJ,
            SavedJumps::Steps => Jumps::Steps,
            SavedJumps::Shots => Jumps::Shots,
            SavedJumps::Freezing => Jumps::Freezing,
        }
    }
}

#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SavedOcp {
    system: SavedSystem,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    jumps: Option<SavedJumps>,
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
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    complementarity: Vec<SavedComplementarity>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    least_squares: Vec<SavedSquares>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    time: Option<SavedTime>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    elements: Vec<usize>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    linear_controls: Vec<bool>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    param_bounds: Option<Interval>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    stage_params: Option<Vec<f64>>,
    state_bounds: Interval,
    initial_bounds: Interval,
    control_bounds: Interval,
    /// Empty until they are set.
    #[serde(default)]
    params: Vec<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    nominal: Option<SavedNominal>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    state_guess: Option<SavedGuess>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    control_guess: Option<Vec<f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    modes: Option<SavedModes>,
}

impl SavedOcp {
    pub(super) fn new(s: &Statement, settings: &Settings) -> Result<SavedOcp> {
        if s.gives_contacts {
            return Err(Error::Unsupported(
                "an order of contacts that is given has no form as a document: take it back first (set_contact_sequence)".into(),
            ));
        }
        let interval = |b: &[Vec<f64>; 2]| Interval::new(&b[0], &b[1]);
        let constraint = |at, f, lower: &[f64], upper: &[f64], relaxed| -> Result<SavedConstraint> {
            Ok(SavedConstraint { at, f: SavedFunction::new(f)?, bounds: Interval::new(lower, upper), relaxed })
        };
        let mut constraints = Vec::new();
        for c in s.path {
            constraints.push(constraint(SavedAt::of(c.at), &c.f, &c.lower, &c.upper, None)?);
        }
        for c in s.terminal {
            constraints.push(constraint(SavedAt::Terminal, &c.f, &c.lower, &c.upper, None)?);
        }
        for c in s.boundary {
            constraints.push(constraint(SavedAt::BothEnds, &c.f, &c.lower, &c.upper, None)?);
        }
        for c in s.soft {
            let norm = match c.norm {
                Norm::L1 => SavedNorm::L1,
                Norm::L2 => SavedNorm::L2,
                Norm::Linf => SavedNorm::Linf,
            };
            let kink_of = c.cost.map(SavedCost::of);
            let price = SavedPrice { norm, weight: c.weight, kink_of };
            let at = c.at.map_or(SavedAt::Terminal, SavedAt::of);
            constraints.push(constraint(at, &c.f, &c.lower, &c.upper, Some(price))?);
        }
        let mut complementarity = Vec::new();
        for c in s.complementarity {
            let (a, b) = (SavedFunction::new(&c.a)?, SavedFunction::new(&c.b)?);
            complementarity.push(SavedComplementarity { at: SavedAt::of(c.at), a, b });
        }
        let mut least_squares = Vec::new();
        for q in s.squares {
            let place = match q.place {
                CostAt::Running => SavedPlace::Running,
                CostAt::ControlGrid => SavedPlace::ControlGrid,
                CostAt::Terminal => SavedPlace::Terminal,
            };
            let (weights, references) = (q.weights.clone(), q.references.clone());
            least_squares.push(SavedSquares { f: SavedFunction::new(&q.f)?, weights, references, place });
        }
        let free = match s.time {
            Durations::Fixed => None,
            Durations::Horizon => Some(SavedFree::Horizon),
            Durations::Stages => Some(SavedFree::Stages),
        };
        let even = s.durations.iter().all(|d| *d == s.horizon / s.n_stages as f64);
        let time = (free.is_some() || !even).then(|| SavedTime {
            durations: s.durations.to_vec(),
            free,
            bounds: free.map(|_| Interval::new(&s.time_bounds[..1], &s.time_bounds[1..])),
        });
        Ok(SavedOcp {
            system: SavedSystem::new(s.simulated)?,
            jumps: SavedJumps::of(s.jumps),
            settings: SavedSettings::new(settings)?,
            horizon: s.horizon,
            n_stages: s.n_stages,
            t0: s.t0,
            lagrange: s.lagrange.map(SavedFunction::new).transpose()?,
            mayer: s.mayer.map(SavedFunction::new).transpose()?,
            constraints,
            complementarity,
            least_squares,
            time,
            elements: s.n_fe.to_vec(),
            linear_controls: if s.linear.contains(&true) { s.linear.to_vec() } else { Vec::new() },
            param_bounds: s.p_bounds.map(interval),
            stage_params: s.stage_params.map(<[f64]>::to_vec),
            state_bounds: interval(s.x_bounds),
            initial_bounds: interval(s.x0_bounds),
            control_bounds: interval(s.u_bounds),
            params: if s.params.iter().any(|p| p.is_nan()) { Vec::new() } else { s.params.to_vec() },
            nominal: (!s.nominal.is_empty()).then(|| SavedNominal {
                states: s.nominal.x.clone(),
                controls: s.nominal.u.clone(),
                params: s.nominal.p.clone(),
            }),
            state_guess: s.x_guess.map(|g| SavedGuess { times: g.0.clone(), states: g.1.clone() }),
            control_guess: s.u_guess.map(<[f64]>::to_vec),
            modes: s.modes.cloned().map(|m| SavedModes {
                times: m.times,
                modes: m.modes,
                cells: m.cells,
                transitions: m.transitions.iter().map(SavedAtTime::of).collect(),
            }),
        })
    }

    pub(super) fn restore(&self, supplied: &[Arc<dyn Function>]) -> Result<Ocp> {
        sizes("stages", &[self.n_stages])?;
        let system = self.system.restore(supplied)?;
        let mut ocp = Ocp::new(&system, self.horizon, self.n_stages, &self.settings.restore()?)?;
        ocp.set_t0(self.t0)?;
        if let Some(j) = self.jumps {
            ocp.set_jumps(j.method());
        }
        if let Some(f) = &self.lagrange {
            ocp.set_lagrange(f.restore(supplied)?)?;
        }
        if let Some(f) = &self.mayer {
            ocp.set_mayer(f.restore(supplied)?)?;
        }
        for c in &self.constraints {
            let (f, [lower, upper]) = (c.f.restore(supplied)?, c.bounds.values());
            match (&c.relaxed, c.at) {
                (Some(_), SavedAt::BothEnds) => {
                    return Err(Error::Range("constraints between both ends cannot be relaxed".into()))
                }
                (Some(price), at) => {
                    let norm = match price.norm {
                        SavedNorm::L1 => Norm::L1,
                        SavedNorm::L2 => Norm::L2,
                        SavedNorm::Linf => Norm::Linf,
                    };
                    match price.kink_of {
                        None => ocp.add_relaxed(f, &lower, &upper, at.path(), norm, price.weight)?,
                        Some(of) => {
                            let kink = Maximum { weight: price.weight, of: f, squared: norm == Norm::L2 };
                            ocp.add_kink(of.cost(), kink)?;
                        }
                    }
                }
                (None, SavedAt::BothEnds) => ocp.add_boundary(f, &lower, &upper)?,
                (None, at) => match at.path() {
                    Some(at) => ocp.add_path(f, &lower, &upper, at)?,
                    None => ocp.add_terminal(f, &lower, &upper)?,
                },
            }
        }
        // parameters of stages replace these
        if !self.params.is_empty() {
            ocp.set_params(&self.params)?;
        }
        self.restore_terms(&mut ocp, supplied)?;
        let bounds = [&self.state_bounds, &self.initial_bounds, &self.control_bounds];
        let [x, x0, u] = bounds.map(Interval::values);
        ocp.set_x_bounds(&x[0], &x[1])?;
        ocp.set_x0_bounds(&x0[0], &x0[1])?;
        ocp.set_u_bounds(&u[0], &u[1])?;
        if let Some(SavedNominal { states, controls, params }) = self.nominal.clone() {
            ocp.set_nominal(Nominal { x: states, u: controls, p: params })?;
        }
        if let Some(g) = &self.state_guess {
            ocp.set_x_guess(&g.times, &g.states)?;
        }
        if let Some(u) = &self.control_guess {
            ocp.set_u_guess(u)?;
        }
        if let Some(SavedModes { times, modes, cells, transitions }) = self.modes.clone() {
            let transitions = transitions.iter().map(SavedAtTime::transition).collect();
            ocp.set_modes(Some(ModeSequence { times, modes, cells, transitions }))?;
        }
        Ok(ocp)
    }

    /// Least squares, lengths, elements, kinds of controls and parameters.
    fn restore_terms(&self, ocp: &mut Ocp, supplied: &[Arc<dyn Function>]) -> Result<()> {
        for c in &self.complementarity {
            let at = c.at.path().ok_or_else(|| Error::Range("complementarities hold along the horizon".into()))?;
            ocp.add_complementarity(c.a.restore(supplied)?, c.b.restore(supplied)?, at)?;
        }
        for q in &self.least_squares {
            let place = match q.place {
                SavedPlace::Running => CostAt::Running,
                SavedPlace::ControlGrid => CostAt::ControlGrid,
                SavedPlace::Terminal => CostAt::Terminal,
            };
            ocp.add_least_squares(q.f.restore(supplied)?, &q.weights, &q.references, place)?;
        }
        if let Some(t) = &self.time {
            ocp.set_durations(&t.durations)?;
            match (t.free, &t.bounds) {
                (None, None) => {}
                (Some(free), Some(bounds)) => {
                    let (what, [lower, upper]) = match free {
                        SavedFree::Horizon => (Durations::Horizon, bounds.values()),
                        SavedFree::Stages => (Durations::Stages, bounds.values()),
                    };
                    let (&[lower], &[upper]) = (&lower[..], &upper[..]) else {
                        return Err(Error::Dimension("free lengths have one lower and one upper bound".into()));
                    };
                    ocp.set_free_time(what, lower, upper)?;
                }
                _ => return Err(Error::Range("free lengths and their bounds belong together".into())),
            }
        }
        if !self.elements.is_empty() {
            ocp.set_elements(&self.elements)?;
        }
        if !self.linear_controls.is_empty() {
            ocp.set_linear_controls(&self.linear_controls)?;
        }
        if let Some(b) = &self.param_bounds {
            let [lower, upper] = b.values();
            ocp.set_param_bounds(&lower, &upper)?;
        }
        if let Some(p) = &self.stage_params {
            ocp.set_stage_params(p)?;
        }
        Ok(())
    }
}
