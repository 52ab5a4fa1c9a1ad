//! Optimal control of piecewise smooth systems.
//!
//! ```text
//! min ∫ L(x,u,p,t) dt + M(x(T),p) + least squares + penalties
//! s.t. dynamics,  x0 ∈ [x0_l, x0_u],  x ∈ [x_l, x_u],  u ∈ [u_l, u_u],  p ∈ [p_l, p_u],
//!      c_l ≤ c(x,u,p,t) ≤ c_u,  0 ≤ g(x,u,p,t) ⊥ h(x,u,p,t) ≥ 0 along the horizon,
//!      e_l ≤ e(x(T),p) ≤ e_u,  b_l ≤ b(x(0),x(T),p) ≤ b_u
//! ```
//!
//! Controls are piecewise constant, or continuous and linear, on a grid of stages; the stages are equally long unless
//! lengths are given, or the optimiser may choose them; every stage has its number of finite elements (7.50). [`Ocp`]
//! collects the problem, discretises it when it is first solved, and keeps structure and symbolic factorisation for
//! further solves with other bounds, parameters and starting points.

mod accuracy;
mod adapt;
mod between;
mod candidates;
mod choices;
mod clear;
mod descent;
mod diagnosis;
mod extend;
mod filippov;
mod guess;
mod identify;
mod integer;
mod joint;
mod modes;
mod moves;
mod multipliers;
mod neighbours;
mod nominal;
mod optimality;
mod phases;
mod portfolio;
mod programs;
mod projected;
mod receding;
mod request;
mod retries;
mod rewire;
mod scene;
mod sensitivity;
mod sequence;
mod simulated;
mod smoothing;
mod solve;
mod squares;
mod stand_in;
mod starts;
mod statement;
mod terms;

pub use crate::fesd::Durations;
pub use crate::jumps::{Contacts, Method as Jumps};
pub use accuracy::Accuracy;
pub use adapt::{Adaptation, Round};
pub use between::{Along, Between};
pub use modes::{ModeSequence, TransitionAt};
pub use multipliers::{Multipliers, MultipliersOf};
pub use nominal::Nominal;
pub use optimality::{Kink, Optimality, Verdict};
pub use phases::{MultiPhase, MultiPhaseResult};
pub use sensitivity::OcpSensitivity;
pub use simulated::JumpMade;
pub use starts::{Around, Starts};
pub use statement::Statement;

use std::borrow::Cow;
use std::sync::Arc;

use self::accuracy::Replay;
pub(crate) use self::extend::CostOf;
use self::extend::{Complementarity, LeastSquares, Soft};
pub(crate) use self::integer::{Levels, PastChoice, Sequence};
use self::solve::Built;

use crate::error::{check_positive, finite, Error, Result};
use crate::fesd::{Boundary, PathAt, PathConstraint, Sizes, Terminal, Trajectory};
use crate::func::{Kinked, Maximum};
use crate::linalg::kkt::LinearStats;
use crate::memory::sizes;
use crate::mpcc::{Certificate, Polish};
use crate::nlp::{middle, Outcome, Residuals, Statistics};
use crate::settings::Settings;
use crate::system::{combination, SharedFunction, System};

/// Finite elements of a stage at most.
const MAX_ELEMENTS: usize = 100_000;

/// First value of slacks.
const SLACK: f64 = 0.1;

/// Places at which a least-squares term counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
#[non_exhaustive]
pub enum CostAt {
    /// Integrated along the horizon.
    Running = 0,
    /// Summed over the ends of the control stages: for measurements.
    ControlGrid = 1,
    /// At the end of the horizon.
    Terminal = 2,
}

/// How the violation of a relaxed constraint is penalised.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
#[non_exhaustive]
pub enum Norm {
    /// Sum of the violations, integrated where the constraint holds along the horizon: zero if the weight is large
    /// enough and the constraint can be met.
    L1 = 0,
    /// Sum of their squares, integrated likewise: never quite zero.
    L2 = 1,
    /// The largest violation.
    Linf = 2,
}

/// Result of a solve.
#[derive(Debug, Clone)]
pub struct OcpResult {
    /// How it ended.
    pub outcome: Outcome,
    /// Outcome of the polish, which identifies the active set and solves the problem with it.
    pub polish: Polish,
    /// Why it is no exact solution, in the words of the model: what cannot be met and by how much, which function has
    /// no value where, which stage needs more elements. Stages, elements, rows are counted from zero. Empty where there
    /// is nothing to say.
    pub message: String,
    /// The user's cost alone: without penalties of relaxed constraints. NaN unless this is a solution.
    pub cost: f64,
    /// Cost of the point that is given here, solution or not. One that is none need not satisfy dynamics and
    /// constraints, and its cost may lie on either side of that of a solution.
    pub cost_reached: f64,
    /// The same with what the violation of relaxed constraints costs, which a search lowers.
    pub(super) priced: f64,
    /// Controls `[n_stages · nu]`; where they are linear, at the start of every stage.
    pub controls: Vec<f64>,
    /// Controls at the end of every stage `[n_stages · nu]`: others than at its start where they are linear.
    pub control_ends: Vec<f64>,
    /// Lengths of the control stages.
    pub durations: Vec<f64>,
    /// Parameters, those that were free as they were found, `[np]`.
    pub params: Vec<f64>,
    /// Largest violation of a relaxed constraint.
    pub violation: f64,
    /// States, switches, dense output.
    pub trajectory: Trajectory,
    /// Residuals at the end.
    pub residuals: Residuals,
    /// Type of stationarity and B-stationarity of the discretised problem; unknown without a polish.
    pub certificate: Certificate,
    /// Work and time of the solve; building the problem is not part of it.
    pub stats: Statistics,
    /// Seconds to build the problem, 0 when an earlier structure was used again.
    pub time_build: f64,
    /// Variables, rows, complementarity pairs of the discretised problem.
    pub dimensions: (usize, usize, usize),
    /// Comparison with a simulation of the controls; `None` when it is not asked for.
    pub accuracy: Option<Accuracy>,
    /// Optimality of the answer as a point of the control problem; `None` where the comparison is not asked for.
    pub optimality: Option<Optimality>,
    /// A model function has no value where one is needed: that is why there is no solution.
    pub undefined: bool,
    /// How a solve ended whose answer is a solution of the discretised problem, where that is no whole success: the search was cut, or no
    /// simulation follows the answer. It is the outcome once the solve is over.
    pub(super) ended: Option<Outcome>,
    /// How the grid was adapted; `None` where that was not asked for.
    pub adaptation: Option<Adaptation>,
    /// Transitions, in the order of time.
    pub jumps: Vec<JumpMade>,
    /// Modes of an answer that was simulated, by the times from the start of the horizon at which they begin; empty where elements have them.
    pub(super) phases: Vec<(f64, Vec<bool>)>,
    /// Modes and impacts of the contacts of a scene; `None` for other systems.
    pub contacts: Option<Contacts>,
}

/// An optimal control problem.
pub struct Ocp {
    system: System,
    /// A projected system as events follow it; `system` is its form for finite elements then.
    projected: Option<System>,
    settings: Settings,
    horizon: f64,
    n_stages: usize,
    t0: f64,
    /// Lengths of the control stages; to start from where they are variables.
    durations: Vec<f64>,
    time: Durations,
    /// Bounds of the horizon and of a stage, where their lengths are variables.
    time_bounds: [f64; 2],
    /// Elements of every stage; empty: as the settings say.
    n_fe: Vec<usize>,
    linear: Vec<bool>,
    lagrange: Option<SharedFunction>,
    mayer: Option<SharedFunction>,
    squares: Vec<LeastSquares>,
    path: Vec<PathConstraint>,
    terminal: Vec<Terminal>,
    boundary: Vec<Boundary>,
    soft: Vec<Soft>,
    complementarity: Vec<Complementarity>,
    x_bounds: [Vec<f64>; 2],
    x0_bounds: [Vec<f64>; 2],
    u_bounds: [Vec<f64>; 2],
    /// Bounds of the controls in every stage `[n_stages · nu]`, where choices are made or narrowed.
    chosen: Option<[Vec<f64>; 2]>,
    /// Bounds of the parameters that are variables.
    p_bounds: Option<[Vec<f64>; 2]>,
    nominal: Nominal,
    /// NaN until they are set.
    params: Vec<f64>,
    /// Parameters of every stage `[n_stages · np]`, where they differ.
    stage_params: Option<Vec<f64>>,
    x_guess: Option<(Vec<f64>, Vec<f64>)>,
    u_guess: Option<Vec<f64>>,
    modes: Option<ModeSequence>,
    /// What the mode program of `modes` keeps clear of.
    clearance: Option<crate::fesd::Clearance>,
    /// Points inside of elements at which path constraints hold too, of the last solution.
    inside: Vec<crate::fesd::Inside>,
    built: Option<Box<Built>>,
    /// How often the problem was discretised.
    builds: usize,
    /// Simulates answers.
    engine: Option<Replay>,
    result: Option<OcpResult>,
    /// Sizes that are known already, for problems made of another one.
    sizes: Option<Sizes>,
    /// Sizes that the last search measured.
    measured: Option<Sizes>,
    /// The largest cost of an answer so far.
    largest: f64,
    /// The last solution one control stage later, where the next warm solve is to start from it.
    shifted: Option<Box<OcpResult>>,
    /// Is it followed by simulations alone, and what derivatives of their answer are made of.
    simulated: simulated::State,
    /// How contact modes are found, where the system is a scene, and what the last solve knows of them.
    scene: scene::SceneControl,
}

impl Ocp {
    /// A problem over `[0, horizon]` with `n_stages` control intervals. Bounds are infinite, the initial value is
    /// free, parameters have no values until they are set.
    pub fn new(system: &System, horizon: f64, n_stages: usize, settings: &Settings) -> Result<Ocp> {
        let only_simulates = simulated::only_simulates(system);
        if only_simulates { system.validate_for_events() } else { system.validate() }?;
        system.check_modes_known()?;
        settings.validate()?;
        check_positive("the horizon", horizon)?;
        if n_stages == 0 {
            return Err(Error::Dimension("the horizon needs at least one control stage".into()));
        }
        sizes::check("control stages", &[n_stages])?;
        let d = system.dims();
        let free = |n: usize| [vec![f64::NEG_INFINITY; n], vec![f64::INFINITY; n]];
        if let Some(k) = system.transitions().iter().position(|t| t.stops()) {
            return Err(Error::Unsupported(format!(
                "transition {k} stops a simulation, and the horizon of an optimal control problem has its own end: make its guard a terminal \
                 constraint, and the length of the horizon free"
            )));
        }
        let given = system;
        let system = if only_simulates { Cow::Borrowed(given) } else { given.with_multipliers()? };
        let projected = matches!(system, Cow::Owned(_)).then(|| given.clone());
        Ok(Ocp {
            system: system.into_owned(),
            projected,
            settings: *settings,
            horizon,
            n_stages,
            t0: 0.0,
            durations: vec![horizon / n_stages as f64; n_stages],
            time: Durations::Fixed,
            time_bounds: [0.0, f64::INFINITY],
            n_fe: Vec::new(),
            linear: vec![false; d.u],
            lagrange: None,
            mayer: None,
            squares: Vec::new(),
            path: Vec::new(),
            terminal: Vec::new(),
            boundary: Vec::new(),
            soft: Vec::new(),
            complementarity: Vec::new(),
            x_bounds: free(d.x),
            x0_bounds: free(d.x),
            u_bounds: free(d.u),
            chosen: None,
            p_bounds: None,
            nominal: Nominal::default(),
            params: vec![f64::NAN; d.p],
            stage_params: None,
            x_guess: None,
            u_guess: None,
            modes: None,
            clearance: None,
            inside: Vec::new(),
            built: None,
            builds: 0,
            engine: None,
            result: None,
            sizes: None,
            measured: None,
            largest: 0.0,
            shifted: None,
            simulated: simulated::State { only: only_simulates, ..Default::default() },
            scene: scene::SceneControl::default(),
        })
    }

    /// The system.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// Number of control stages.
    pub fn n_stages(&self) -> usize {
        self.n_stages
    }

    /// Sets the cost rate, one output. Kinks ([`crate::expr::Graph::cost`]), as those of `|u|`, get a variable for every stage; they may see controls that
    /// are constant by stage, and parameters.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for kinks in what moves within a stage: states, time, controls that are linear.
    pub fn set_lagrange(&mut self, f: SharedFunction) -> Result<()> {
        self.lagrange = Some(self.take_kinks(f, CostOf::Running)?);
        self.changed();
        Ok(())
    }

    /// Sets the terminal cost, one output; it may have kinks ([`crate::expr::Graph::cost`]).
    pub fn set_mayer(&mut self, f: SharedFunction) -> Result<()> {
        self.mayer = Some(self.take_kinks(f, CostOf::Terminal)?);
        self.changed();
        Ok(())
    }

    /// The smooth part of a cost; its kinks take the place of those that this cost had.
    fn take_kinks(&mut self, f: SharedFunction, of: CostOf) -> Result<SharedFunction> {
        self.check_sizes(&f, Some(1))?;
        let (smooth, kinks) = f.kinked().map_or((f.clone(), &[][..]), |k| (k.smooth().clone(), k.kinks()));
        let kinks: Vec<Soft> = Soft::kinks(of, kinks).collect();
        for k in &kinks {
            self.check_kink(k)?;
        }
        self.soft.retain(|s| s.cost != Some(of));
        self.soft.extend(kinks);
        Ok(smooth)
    }

    /// A cost with the kinks that were taken from it.
    fn with_kinks(&self, smooth: Option<&SharedFunction>, of: CostOf) -> Result<Option<SharedFunction>> {
        let own = self.soft.iter().filter(|s| s.cost == Some(of));
        let kinks: Vec<Maximum> = own.map(Soft::maximum).collect();
        Ok(match smooth {
            Some(f) if !kinks.is_empty() => Some(Arc::new(Kinked::new(f.name(), f.clone(), kinks)?)),
            f => f.cloned(),
        })
    }

    fn check_kink(&self, kink: &Soft) -> Result<()> {
        if kink.holds_within_stages(&self.linear) {
            return Ok(());
        }
        Err(Error::Unsupported(format!(
            "cost rate '{}': abs, min and max of states, of time or of controls that are linear within a stage switch between the control \
             stages: make the cost the derivative of a further state of the model, and its value at the end the cost (set_mayer)",
            kink.f.name()
        )))
    }

    /// Adds a constraint along the horizon.
    pub fn add_path(&mut self, f: SharedFunction, lower: &[f64], upper: &[f64], at: PathAt) -> Result<()> {
        self.check(&f, None)?;
        check_bounds("path constraint", lower, upper, f.n_out())?;
        self.path.push(PathConstraint { f, lower: lower.to_vec(), upper: upper.to_vec(), at });
        self.changed();
        Ok(())
    }

    /// Adds a constraint at the end of the horizon.
    pub fn add_terminal(&mut self, f: SharedFunction, lower: &[f64], upper: &[f64]) -> Result<()> {
        self.check(&f, None)?;
        check_bounds("terminal constraint", lower, upper, f.n_out())?;
        self.terminal.push(Terminal { f, lower: lower.to_vec(), upper: upper.to_vec() });
        self.changed();
        Ok(())
    }

    /// Adds a constraint between the two ends of the horizon: `f` sees the initial state, then the final one, as `2 nx`
    /// states, with control and time at the end.
    pub fn add_boundary(&mut self, f: SharedFunction, lower: &[f64], upper: &[f64]) -> Result<()> {
        let (d, given) = (self.system.dims(), f.dims());
        if (given.x, given.u, given.p) != (2 * d.x, d.u, d.p) {
            return Err(Error::Dimension(format!(
                "function '{}' of both ends takes (x, u, p) of sizes ({}, {}, {}), expected ({}, {}, {})",
                f.name(),
                given.x,
                given.u,
                given.p,
                2 * d.x,
                d.u,
                d.p
            )));
        }
        check_bounds("constraint between the ends", lower, upper, f.n_out())?;
        self.boundary.push(Boundary { f, lower: lower.to_vec(), upper: upper.to_vec() });
        self.changed();
        Ok(())
    }

    /// The solution is periodic in these states: their final values are their initial ones.
    pub fn add_periodic(&mut self, states: &[usize]) -> Result<()> {
        let d = self.system.dims();
        if let Some(i) = states.iter().find(|i| **i >= d.x) {
            return Err(Error::Range(format!("state {i} of {} cannot be periodic", d.x)));
        }
        let rows = states.iter().map(|&i| vec![(i, -1.0), (d.x + i, 1.0)]).collect();
        let f = combination("periodic", crate::func::Dims { x: 2 * d.x, ..d }, rows);
        let zeros = vec![0.0; states.len()];
        self.add_boundary(f, &zeros, &zeros)
    }

    /// Adds the sum of squares `(f − y)ᵀ W (f − y)` to the cost. `weights` is the diagonal of `W` or all of it;
    /// `references` is `y`, or, but for a terminal term, one `y` for every stage.
    pub fn add_least_squares(
        &mut self,
        f: SharedFunction,
        weights: &[f64],
        references: &[f64],
        place: CostAt,
    ) -> Result<()> {
        self.check(&f, None)?;
        let n = f.n_out();
        finite("weight", weights, weights.len())?;
        if weights.len() != n && weights.len() != n * n {
            return Err(Error::Dimension(format!(
                "{} weights for the {n} residuals of '{}': give {n}, or a matrix of {}",
                weights.len(),
                f.name(),
                n * n
            )));
        }
        self.check_references(n, references, place == CostAt::Terminal)?;
        self.squares.push(LeastSquares { f, weights: weights.to_vec(), references: references.to_vec(), place });
        self.changed();
        Ok(())
    }

    fn check_references(&self, n: usize, references: &[f64], terminal: bool) -> Result<()> {
        finite("reference", references, references.len())?;
        let by_stage = n * self.n_stages;
        if references.len() != n && (terminal || references.len() != by_stage) {
            let more = if terminal { String::new() } else { format!(", or {by_stage} for all stages") };
            return Err(Error::Dimension(format!("{} references given, expected {n}{more}", references.len())));
        }
        Ok(())
    }

    /// Changes the references of least-squares term `k`, in the order they were added.
    pub fn set_references(&mut self, k: usize, references: &[f64]) -> Result<()> {
        let n_terms = self.squares.len();
        let Some(term) = self.squares.get(k) else {
            return Err(Error::Range(format!("least-squares term {k}: there are {n_terms}")));
        };
        self.check_references(term.f.n_out(), references, term.place == CostAt::Terminal)?;
        self.squares[k].references = references.to_vec();
        Ok(())
    }

    /// Constraints of the user come before the kinks of costs: their numbers are the user's.
    fn push_soft(&mut self, soft: Soft) {
        let at = self.n_relaxed();
        self.soft.insert(at, soft);
    }

    /// Relaxed constraints of the user.
    fn n_relaxed(&self) -> usize {
        self.soft.iter().filter(|s| s.cost.is_none()).count()
    }

    /// Adds a constraint that may be violated at a price: along the horizon, or with `at = None` at its end.
    pub fn add_relaxed(
        &mut self,
        f: SharedFunction,
        lower: &[f64],
        upper: &[f64],
        at: Option<PathAt>,
        norm: Norm,
        weight: f64,
    ) -> Result<()> {
        self.check(&f, None)?;
        check_bounds("relaxed constraint", lower, upper, f.n_out())?;
        check_positive("the weight of the violation", weight)?;
        self.push_soft(Soft { f, lower: lower.to_vec(), upper: upper.to_vec(), at, norm, weight, cost: None });
        self.changed();
        Ok(())
    }

    /// Adds `0 ≤ a(x, u, p, t) ⊥ b(x, u, p, t) ≥ 0`, component by component, at the ends of the control stages, at the ends
    /// of elements, or at stage points. Pairs of controls alone belong to the control grid: at other places they would
    /// be said several times.
    pub fn add_complementarity(&mut self, a: SharedFunction, b: SharedFunction, at: PathAt) -> Result<()> {
        self.check(&a, None)?;
        self.check(&b, Some(a.n_out()))?;
        self.complementarity.push(Complementarity { a, b, at });
        self.changed();
        Ok(())
    }

    /// Sets the number of finite elements of every stage `[n_stages]`; without it all have that of the settings.
    pub fn set_elements(&mut self, n_fe: &[usize]) -> Result<()> {
        if n_fe.len() != self.n_stages {
            return Err(Error::Dimension(format!("{} numbers of elements for {} stages", n_fe.len(), self.n_stages)));
        }
        if let Some(k) = n_fe.iter().position(|n| !(1..=MAX_ELEMENTS).contains(n)) {
            return Err(Error::Range(format!("stage {k} has {} elements: give it 1 to {MAX_ELEMENTS}", n_fe[k])));
        }
        self.n_fe = n_fe.to_vec();
        Ok(())
    }

    /// Sets the lengths of the stages `[n_stages]`: the control grid is then as uneven as they are. Where lengths are
    /// variables these are what they start from.
    pub fn set_durations(&mut self, durations: &[f64]) -> Result<()> {
        finite("length of a stage", durations, self.n_stages)?;
        if let Some(k) = durations.iter().position(|d| *d <= 0.0) {
            return Err(Error::Range(format!("stage {k} has the length {}: it must be positive", durations[k])));
        }
        self.durations = durations.to_vec();
        Ok(())
    }

    /// Lets the optimiser choose the length of the horizon, the stages keeping their shares of it
    /// ([`Durations::Horizon`]), or that of every stage ([`Durations::Stages`]): the bounds are those of the horizon, or of
    /// a stage.
    pub fn set_free_time(&mut self, what: Durations, lower: f64, upper: f64) -> Result<()> {
        if !(lower >= 0.0 && lower <= upper && upper > 0.0 && lower.is_finite()) {
            return Err(Error::Range(format!(
                "lengths between {lower} and {upper}: bounds must not be negative, and the lower one finite"
            )));
        }
        if self.time != what {
            self.forget_programs();
        }
        self.time = what;
        self.time_bounds = [lower, upper];
        Ok(())
    }

    /// Requires that the horizon is as long as this, where the lengths of the stages are free.
    pub fn add_horizon(&mut self, lower: f64, upper: f64) -> Result<()> {
        let d = self.system.dims();
        check_bounds("length of the horizon", &[lower], &[upper], 1)?;
        let f = combination("length of the horizon", d, vec![vec![(d.t_col(), 1.0)]]);
        self.add_terminal(f, &[self.t0 + lower], &[self.t0 + upper])
    }

    /// Makes controls continuous and linear on every stage `[nu]`, the others stay constant.
    pub fn set_linear_controls(&mut self, linear: &[bool]) -> Result<()> {
        if linear.len() != self.system.dims().u {
            return Err(Error::Dimension(format!(
                "{} entries given, the system has {} controls",
                linear.len(),
                self.system.dims().u
            )));
        }
        let before = std::mem::replace(&mut self.linear, linear.to_vec());
        if let Some(e) = self.soft.iter().find_map(|s| self.check_kink(s).err()) {
            self.linear = before;
            return Err(e);
        }
        self.changed();
        Ok(())
    }

    /// Adds a kink of a cost whose smooth part is set, as documents have them.
    pub(crate) fn add_kink(&mut self, of: CostOf, kink: Maximum) -> Result<()> {
        self.check(&kink.of, None)?;
        check_positive("the factor of a kink in the cost", kink.weight)?;
        let kinks: Vec<Soft> = Soft::kinks(of, &[kink]).collect();
        kinks.iter().try_for_each(|k| self.check_kink(k))?;
        self.soft.extend(kinks);
        self.changed();
        Ok(())
    }

    /// Makes parameters with a lower bound below the upper one variables of the problem; the others keep their values.
    pub fn set_param_bounds(&mut self, lower: &[f64], upper: &[f64]) -> Result<()> {
        check_bounds("parameter", lower, upper, self.params.len())?;
        let before = self.free_params();
        self.p_bounds = Some([lower.to_vec(), upper.to_vec()]);
        if self.free_params() != before {
            self.forget_programs();
        }
        Ok(())
    }

    /// Sets parameters that change from stage to stage `[n_stages · np]`.
    pub fn set_stage_params(&mut self, p: &[f64]) -> Result<()> {
        finite("parameter", p, self.n_stages * self.params.len())?;
        if self.stage_params.replace(p.to_vec()).is_none() {
            // switching functions of parameters jump at the ends of stages
            self.forget_programs();
        }
        Ok(())
    }

    /// Parameters that have no values and are no variables are an error.
    pub(crate) fn check_params(&self) -> Result<()> {
        let free = self.free_params();
        let unset = |j: &usize| self.stage_params.is_none() && self.params[*j].is_nan() && !free[*j];
        let missing: Vec<String> = (0..self.params.len()).filter(unset).map(|j| j.to_string()).collect();
        if missing.is_empty() {
            return Ok(());
        }
        Err(Error::State(format!(
            "parameter {} has no value, counted from 0: give it by set_params (params= where the problem is made in Python), those of every \
             stage by set_stage_params, or make it a variable by set_param_bounds",
            missing.join(", ")
        )))
    }

    /// As [`Ocp::check_params`]; variables without a value start in the middle of their bounds.
    fn complete_params(&mut self) -> Result<()> {
        self.check_params()?;
        let Ocp { params, p_bounds, stage_params, .. } = self;
        for (j, p) in params.iter_mut().enumerate().filter(|(_, p)| p.is_nan()) {
            *p = match (&*stage_params, &*p_bounds) {
                (Some(all), _) => all[j],
                (None, Some([lower, upper])) => middle(lower[j], upper[j]),
                (None, None) => *p,
            };
        }
        Ok(())
    }

    /// Which parameters are variables.
    fn free_params(&self) -> Vec<bool> {
        match &self.p_bounds {
            Some([l, u]) => l.iter().zip(u).map(|(l, u)| l < u).collect(),
            None => vec![false; self.params.len()],
        }
    }

    /// What was discretised is of no use any more.
    fn forget_programs(&mut self) {
        self.built = None;
    }

    /// The structure is another one.
    fn changed(&mut self) {
        self.forget_programs();
        self.engine = None;
        self.measured = None;
        self.largest = 0.0;
    }

    /// Sets bounds of the states at all stage points and element ends after the initial time.
    pub fn set_x_bounds(&mut self, lower: &[f64], upper: &[f64]) -> Result<()> {
        check_bounds("state", lower, upper, self.system.dims().x)?;
        self.x_bounds = [lower.to_vec(), upper.to_vec()];
        Ok(())
    }

    /// Sets bounds of the initial value; equal bounds fix it.
    pub fn set_x0_bounds(&mut self, lower: &[f64], upper: &[f64]) -> Result<()> {
        check_bounds("initial value", lower, upper, self.system.dims().x)?;
        self.x0_bounds = [lower.to_vec(), upper.to_vec()];
        Ok(())
    }

    /// Fixes the initial value.
    pub fn set_x0(&mut self, x0: &[f64]) -> Result<()> {
        self.set_x0_bounds(x0, x0)
    }

    /// Sets bounds of the controls.
    pub fn set_u_bounds(&mut self, lower: &[f64], upper: &[f64]) -> Result<()> {
        check_bounds("control", lower, upper, self.system.dims().u)?;
        self.u_bounds = [lower.to_vec(), upper.to_vec()];
        Ok(())
    }

    /// Says how large quantities usually are, in their own units; the solver measures variables by that. What is not given it takes
    /// from bounds, initial values, guesses and simulations.
    pub fn set_nominal(&mut self, nominal: Nominal) -> Result<()> {
        let d = self.system.dims();
        let blocks = [("states", &nominal.x, d.x), ("controls", &nominal.u, d.u), ("parameters", &nominal.p, d.p)];
        for (what, values, n) in blocks {
            if !values.is_empty() && values.len() != n {
                return Err(Error::Dimension(format!("{} nominal values of the {what}: there are {n}", values.len())));
            }
            if let Some(i) = values.iter().position(|v| v.is_some_and(|v| !(v > 0.0 && v.is_finite()))) {
                return Err(Error::Range(format!("nominal value {i} of the {what} must be positive and finite")));
            }
        }
        self.nominal = nominal;
        self.measured = None;
        Ok(())
    }

    /// Sets the parameters, the same in all stages; those that are variables start there.
    pub fn set_params(&mut self, p: &[f64]) -> Result<()> {
        finite("parameter", p, self.params.len())?;
        self.params.copy_from_slice(p);
        self.stage_params = None;
        Ok(())
    }

    /// Sets the initial time.
    pub fn set_t0(&mut self, t0: f64) -> Result<()> {
        finite("initial time", &[t0], 1)?;
        self.t0 = t0;
        Ok(())
    }

    /// Gives states `x[times.len() · nx]` at rising times from the start of the horizon; linear in between.
    pub fn set_x_guess(&mut self, times: &[f64], x: &[f64]) -> Result<()> {
        finite("time of the guess", times, times.len())?;
        if times.is_empty() || times.windows(2).any(|w| w[0] >= w[1]) {
            return Err(Error::Range("the times of the guess must be given and rise".into()));
        }
        finite("state of the guess", x, times.len() * self.system.dims().x)?;
        self.x_guess = Some((times.to_vec(), x.to_vec()));
        self.shifted = None;
        Ok(())
    }

    /// Gives controls `u[n_stages · nu]` to start from.
    pub fn set_u_guess(&mut self, u: &[f64]) -> Result<()> {
        finite("control of the guess", u, self.n_stages * self.system.dims().u)?;
        self.u_guess = Some(u.to_vec());
        self.shifted = None;
        Ok(())
    }

    /// Changes the settings. The problem is discretised again where its structure depends on what changed.
    pub fn set_settings(&mut self, settings: &Settings) -> Result<()> {
        settings.validate()?;
        self.settings = *settings;
        Ok(())
    }

    /// How often the problem was discretised: a solve that does so loses what the last one knew of the structure.
    pub fn builds(&self) -> usize {
        self.builds
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Structure and work of the factorisations since the problem was built; `None` before the first solve.
    pub fn linear_statistics(&self) -> Option<LinearStats> {
        self.built.as_ref().map(|b| b.solver.linear_statistics())
    }

    /// The result of the last solve.
    pub fn result(&self) -> Option<&OcpResult> {
        self.result.as_ref()
    }

    fn check(&self, f: &SharedFunction, n_out: Option<usize>) -> Result<()> {
        if f.kinked().is_some() {
            return Err(Error::Unsupported(format!("function '{}' has kinks, which only costs may have", f.name())));
        }
        self.check_sizes(f, n_out)
    }

    fn check_sizes(&self, f: &SharedFunction, n_out: Option<usize>) -> Result<()> {
        if f.dims() != self.system.dims() {
            return Err(Error::Dimension(format!(
                "function '{}' takes other numbers of states, controls or parameters than the system",
                f.name()
            )));
        }
        match n_out {
            Some(n) if f.n_out() != n => {
                Err(Error::Dimension(format!("function '{}' has {} outputs, expected {n}", f.name(), f.n_out())))
            }
            _ => Ok(()),
        }
    }
}

/// Times at which stages of these lengths begin, and the end of the last: `[n_stages + 1]`.
fn stage_times(t0: f64, durations: &[f64]) -> Vec<f64> {
    let ends = durations.iter().scan(t0, |t, d| {
        *t += d;
        Some(*t)
    });
    std::iter::once(t0).chain(ends).collect()
}

fn check_bounds(what: &str, lower: &[f64], upper: &[f64], n: usize) -> Result<()> {
    if lower.len() != n || upper.len() != n {
        return Err(Error::Dimension(format!(
            "bounds of the {what} have {} and {} entries, expected {n}",
            lower.len(),
            upper.len()
        )));
    }
    for i in 0..n {
        if lower[i].is_nan() || upper[i].is_nan() {
            return Err(Error::Range(format!("bound of {what} {i} is NaN; use an infinity for no bound")));
        }
        if lower[i] > upper[i] {
            return Err(Error::Range(format!(
                "{what} {i} has lower bound {} above upper bound {}",
                lower[i], upper[i]
            )));
        }
    }
    Ok(())
}
