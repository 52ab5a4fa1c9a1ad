//! Time stepping for scenes with many contacts: the θ-method of J. J. Moreau and M. Jean.
//!
//! ```text
//! q_m = q + (1 − θ) h N v,          t_m = t + (1 − θ) h
//! M(q_m) (v⁺ − v) = h f_v(q_m, v, t_m) + Σ_i (n_i Λ_i + B_i T_i)      over the contacts with g_i(q_m, t_m) ≤ 0
//! 0 ≤ Λ_i ⊥ ġ_i⁺ + e_i min(ġ_i⁻, 0) ≥ 0,   ‖T_i‖ ≤ μ_i Λ_i,   T_i opposite to s_i⁺
//! q⁺ = q_m + θ h N v⁺ + shift
//! ```
//!
//! (J. J. Moreau, *Unilateral contact and dry friction in finite freedom dynamics*, in: Nonsmooth Mechanics and Applications
//! (1988); M. Jean, *The non-smooth contact dynamics method*, Comput. Methods Appl. Mech. Engrg. 177 (1999).) Steps are not
//! shortened at impacts: any number of them may fall into one step, and the impulses of a step are those of its impacts and of
//! the contact forces together. An impact happens up to a step too late, so the error is of order 1 in `h` once there was
//! one; between impacts it is of order 2 with `θ = 1/2` and forces that depend on coordinates and time. With `θ = 1/2` a
//! rebound with `e = 1` keeps the energy to rounding under a constant force, and bounded otherwise.
//!
//! **Penetration.** An impact is noticed when the gap is negative already, by up to `h |ġ|`. The law is one of velocities and
//! leaves the gap as it is. So what came to rest too deep is shifted back ([`Options::correct`]): the least shift of the
//! coordinates, measured by the inertia, that takes the contacts with an impulse that would stay closed back to the depth to
//! which one step of free motion brings them, `½ h |n·(v_free − v)|`, which keeps them closed. The shift has no velocity and adds
//! no energy of motion, it is of order `h` once per impact and of order `h²` per step on curved gaps, where it takes away the
//! drift, so the order of the method stays. Momentum and centre of mass are kept: the shift is one along contact forces.
//!
//! **Friction at joints and constraints.** The impulse of dry friction at a joint with the bound `F` is at most `h F`, whatever the impacts in
//! the step; where a larger bound holds what sticks, the impulse is that of sticking if this is in it. A constraint has an impulse of either
//! sign, `ċ⁺ = 0`, and what is left of `c` at the end of a step is shifted back.
//!
//! **Forces are explicit.** States beside coordinates and velocities move by `h` times their rates in the middle of the step. `f_v` is taken at the velocities of the start of the step, so steps must resolve it: shorter than
//! `2/ω` for a spring, `2 m/c` for a damper. What is stiffer than that is better stated as a contact or a constraint.
//!
//! **What a step costs.** Functions are evaluated for the contacts that are near only; none is missed, see `near`. The
//! impulses come from block Gauss-Seidel with conjugate gradients where that is slow, see `solver`, starting at those of the last
//! step. After the first steps nothing is allocated, unless more contacts than ever are closed.

mod inertia;
mod near;
mod rows;
mod run;
mod solver;
mod step;

use std::sync::Arc;

use crate::error::{check_positive, finite, Error, Result};
use crate::system::{ImpactLaw, Kind, Local, Mechanics, Order, System};

use inertia::Blocks;
use near::Near;
use rows::{Rows, Touched};
pub use run::{simulate_steps, StepImpulse, Steps};
use solver::Solver;

/// Options of a [`Stepper`].
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Length of a step, in the unit of time of the scene; [`Stepper::advance`] makes equal ones that are not longer.
    pub h: f64,
    /// Place in a step at which the functions are evaluated: 1/2 in its middle, 1 at its start. Between 1/2 and 1.
    pub theta: f64,
    /// The impulses of a step count as found when what a sweep changes of them, and what the sweeps to come are expected to, is
    /// less than this share of them, measured by energy.
    pub tolerance: f64,
    /// Sweeps over the contacts and steps of conjugate gradients in one step at most. A step that needs more goes on with the
    /// impulses it has and is counted in [`Statistics::unconverged`].
    pub max_iterations: usize,
    /// [`Stepper::run`] and [`simulate_steps`] keep the state after every so many steps, and the last.
    pub record_every: usize,
    /// Keep the impulses of the steps whose states are kept.
    pub record_impulses: bool,
    /// Law for several contacts that close at once; None: that of the system.
    pub law: Option<ImpactLaw>,
    /// Shift back what came to rest too deep.
    pub correct: bool,
    /// Look at all contacts in every step. The result is the same to the last bit: for checks.
    pub look_at_all: bool,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            h: 1e-3,
            theta: 0.5,
            tolerance: 1e-8,
            max_iterations: 1000,
            record_every: 1,
            record_impulses: false,
            law: None,
            correct: true,
            look_at_all: false,
        }
    }
}

impl Options {
    fn check(&self) -> Result<()> {
        let range = |text: String| Err(Error::Range(text));
        check_positive("the step h", self.h)?;
        if !(self.theta >= 0.5 && self.theta <= 1.0) {
            return range(format!("theta is {}: it must be between 1/2 and 1", self.theta));
        }
        if !(self.tolerance > 0.0 && self.tolerance < 1.0) {
            return range(format!("the tolerance is {}: it must be between 0 and 1", self.tolerance));
        }
        if self.max_iterations == 0 || self.record_every == 0 {
            return range("max_iterations and record_every must be at least 1".into());
        }
        Ok(())
    }
}

/// Counts of the steps since [`Stepper::reset`], and how they went.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Statistics {
    /// Steps.
    pub steps: u64,
    /// Gaps evaluated.
    pub gaps: u64,
    /// Bounds of gaps over boxes, each about as dear as a few gaps.
    pub bounds: u64,
    /// Closed contacts, summed over the steps, and most at once.
    pub contacts: u64,
    /// See [`Statistics::contacts`].
    pub most_contacts: usize,
    /// Sweeps over the contacts.
    pub sweeps: u64,
    /// Steps of conjugate gradients.
    pub gradients: u64,
    /// Steps whose impulses were not found to the tolerance.
    pub unconverged: u64,
    /// The largest relative change left in such a step.
    pub worst_change: f64,
    /// The deepest penetration seen, in the unit of its gap, 0 or positive: of the order of `h` times a speed.
    pub penetration: f64,
    /// The contact it was at, as results number contacts.
    pub deepest: Option<usize>,
}

/// Makes steps of a scene. Steppers are independent of each other and may move to other threads.
///
/// ```
/// use switchback::expr::Graph;
/// use switchback::scene::{Contact, Scene};
/// use switchback::stepping::{Options, Stepper};
///
/// // a ball falls on a floor and stays there
/// let g = Graph::new();
/// let mut scene = Scene::new("ball", 1, 1, 0, 0).unwrap();
/// scene.set_force(0, g.constant(-9.81).id()).unwrap();
/// scene.add_contact(Contact::new(&g, "floor", g.x(0))).unwrap();
/// let system = scene.build(&g).unwrap().system;
/// let mut s = Stepper::new(&system, &Options::default()).unwrap();
/// s.reset(0.0, &[1.0, 0.0]).unwrap();
/// s.advance(1.0).unwrap();
/// assert!(s.state()[0].abs() < 1e-5 && s.state()[1] == 0.0);
/// // in rest the floor gives what gravity takes in a step
/// assert!((s.impulses()[0][0] - 9.81e-3).abs() < 1e-9);
/// ```
pub struct Stepper {
    mechanics: Arc<Mechanics>,
    contacts: Arc<[Local]>,
    options: Options,
    law: ImpactLaw,
    t: f64,
    x: Vec<f64>,
    u: Vec<f64>,
    p: Vec<f64>,
    /// The state is one that [`Stepper::reset`] has accepted, and no step failed since.
    ready: bool,
    inertia: Blocks,
    touched: Touched,
    near: Near,
    rows: Rows,
    solver: Solver,
    /// Constant `N`: velocity and factor of the only entries there are, row by row. None where it varies.
    rates: Option<Vec<(usize, usize, f64)>>,
    impulses: Vec<[f64; 3]>,
    /// Contacts whose impulses are not zero by structure: those of the last step.
    held: Vec<usize>,
    stats: Statistics,
    // memory of a step
    /// What the states beside coordinates and velocities are at its end.
    rest: Vec<f64>,
    middle: Vec<f64>,
    smooth: Vec<f64>,
    v: Vec<f64>,
    free: Vec<f64>,
    shift: Vec<f64>,
    normal: Vec<f64>,
    work: Vec<f64>,
}

impl Stepper {
    /// A stepper of a system with contacts, in no state yet: see [`Stepper::reset`]. Controls and parameters are zero.
    ///
    /// # Errors
    /// [`Error::State`] for a system that is no scene, [`Error::Unsupported`] for a projected system, [`Error::Range`] for options that make no sense, [`Error::Numeric`] for
    /// a constant inertia that is not positive definite.
    pub fn new(system: &System, options: &Options) -> Result<Stepper> {
        options.check()?;
        system.validate()?;
        let Some(m) = system.mechanics() else {
            return Err(Error::State(
                "the system is no scene: time stepping needs coordinates, velocities, inertia and contacts".into(),
            ));
        };
        system.check_without_transitions("time stepping")?;
        if let Some(c) = m.contacts.iter().find(|c| c.kind == Kind::Switch) {
            return Err(Error::Unsupported(format!(
                "time stepping does not follow switches of forces or rates, as the {}: simulate the scene event-driven",
                c.name
            )));
        }
        let locals: Option<Arc<[Local]>> = m.contacts.iter().map(|c| c.local.clone()).collect();
        let Some(contacts) = locals.filter(|_| m.order == Order::Second) else {
            return Err(Error::Unsupported(
                "time stepping is for mechanical systems: simulate projected systems event-driven".into(),
            ));
        };
        let inertia = Blocks::new(m).ok_or_else(|| {
            Error::Numeric("the inertia is not positive definite: forces would have no finite effect".into())
        })?;
        let (dims, n, n_v) = (system.dims(), m.contacts.len(), m.n_v);
        let mut work = m.smooth.work_len();
        if let crate::system::Inertia::Varying { matrix, .. } = &m.inertia {
            work = work.max(matrix.work_len());
        }
        for l in contacts.iter() {
            work = work.max(l.rows.work_len());
        }
        Ok(Stepper {
            law: options.law.unwrap_or(m.law),
            options: options.clone(),
            t: 0.0,
            x: vec![0.0; dims.x],
            u: vec![0.0; dims.u],
            p: vec![0.0; dims.p],
            ready: false,
            touched: Touched::new(&contacts, &inertia),
            inertia,
            near: Near::new(
                &contacts,
                m.contacts.iter().map(|c| !c.kind.opens()).collect(),
                m.n_q,
                options.look_at_all,
            ),
            contacts,
            rows: Rows::default(),
            solver: Solver::new(n_v),
            rates: None,
            impulses: vec![[0.0; 3]; n],
            held: Vec::new(),
            stats: Statistics::default(),
            rest: vec![0.0; m.n_z],
            middle: vec![0.0; dims.x],
            smooth: vec![0.0; dims.x],
            v: vec![0.0; n_v],
            free: vec![0.0; n_v],
            shift: vec![0.0; n_v],
            normal: Vec::new(),
            work: vec![0.0; work],
            mechanics: m.clone(),
        })
    }

    /// Sets the controls, which stay until they are set again.
    pub fn set_controls(&mut self, u: &[f64]) -> Result<()> {
        finite("controls", u, self.u.len())?;
        self.u.copy_from_slice(u);
        Ok(())
    }

    /// Sets the parameters, which stay until they are set again.
    pub fn set_params(&mut self, p: &[f64]) -> Result<()> {
        finite("parameters", p, self.p.len())?;
        self.p.copy_from_slice(p);
        self.forget_gaps();
        Ok(())
    }

    /// The state after the last step: coordinates, then velocities.
    pub fn state(&self) -> &[f64] {
        &self.x
    }

    /// The time after the last step.
    pub fn time(&self) -> f64 {
        self.t
    }

    /// Impulses of the last step by contact: normal, then along the tangents there are. Divided by the length of the step they
    /// are the mean forces, where no impact fell into it.
    pub fn impulses(&self) -> &[[f64; 3]] {
        &self.impulses
    }

    /// Counts of the steps since [`Stepper::reset`], and how they went.
    pub fn statistics(&self) -> Statistics {
        Statistics { gaps: self.near.looked, bounds: self.near.bounded, ..self.stats }
    }

    /// The options it was made with.
    pub fn options(&self) -> &Options {
        &self.options
    }
}
