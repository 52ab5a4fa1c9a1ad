//! Options of a controller.

use super::linearise::HessianKind;
use crate::error::{Error, Result};
use crate::tableau::Family;

/// Work done between two samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
#[non_exhaustive]
pub enum Scheme {
    /// One linearisation at the last iterate per sample (section 10.2).
    Rti = 0,
    /// One iteration of a level per sample: levels A, B and C keep the matrices of the first linearisation.
    Mli = 1,
    /// Iterations of a level on the problem with the predicted state, then a linearisation (Algorithm 2).
    AsRti = 2,
    /// The problem with the predicted state is solved until it converges, then linearised: the feedback is the tangential
    /// predictor of its solution, across changes of the active set.
    Asc = 3,
}

/// Levels of an iteration by what it evaluates (Table 10.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
#[non_exhaustive]
pub enum Level {
    /// Nothing: another initial value in the same quadratic program.
    A = 0,
    /// Values of the constraints; the gradient from the frozen Hessian (10.11).
    B = 1,
    /// Besides, the gradient of the Lagrangian by an adjoint sweep (10.12).
    C = 2,
    /// All Jacobians; the Hessian is that of Gauss and Newton.
    D0 = 3,
    /// All Jacobians; the Hessian is updated from gradients.
    D1 = 4,
    /// All Jacobians and the exact Hessian, made convex.
    D2 = 5,
}

/// How quadratic programs are solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
#[non_exhaustive]
pub enum QpMethod {
    /// States eliminated, dual active set on the prepared inverse of the Hessian.
    Condensing = 0,
    /// States kept: active sets by a Riccati recursion, and an interior point where these do not settle. Work is linear in the number of
    /// stages.
    Stagewise = 1,
    /// The one of both that needs fewer operations at the size of the problem.
    Auto = 2,
}

/// Sources of a control: the best that was there in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
#[non_exhaustive]
pub enum Source {
    /// The quadratic program.
    Qp = 0,
    /// The quadratic program with rows that may be violated at a price, since they cannot all be met, or only at more than that price.
    SoftQp = 1,
    /// The prepared affine feedback, an unfinished quadratic program or the plan, cut off at the bounds of the controls: what costs least, by the program.
    Tangent = 2,
    /// The last plan.
    Plan = 3,
    /// The last control again, cut off at its bounds.
    Hold = 4,
}

/// Options of a controller.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Work done between two samples.
    pub scheme: Scheme,
    /// Level of the iterations of [`Scheme::Mli`] and of the inner iterations of [`Scheme::AsRti`]; the Hessian of all
    /// linearisations where it is one of the levels D.
    pub level: Level,
    /// Inner iterations of advanced steps per sample; at most as many for [`Scheme::Asc`].
    pub inner: usize,
    /// Iterations end early: those of [`Scheme::Asc`] where states and controls change by less than this share of their size, those of
    /// [`Scheme::AsRti`] where they would change by less from then on, by the estimated contraction (10.18).
    pub tol: f64,
    /// How quadratic programs are solved.
    pub qp: QpMethod,
    /// The iterate moves by one stage at every sample: for samples as long as the first stage.
    pub shift: bool,
    /// Seconds that [`super::Nmpc::feedback`] may take, infinite for as many as it needs; checked in every iteration of the
    /// quadratic program.
    pub deadline: f64,
    /// Changes of the active set in a feedback at most (for [`QpMethod::Stagewise`] Newton steps), 0: as many as it needs. What is left of them is
    /// made in the next preparation.
    pub max_changes: usize,
    /// Price per unit of violation where rows cannot all be met; 0: a thousand times what it costs to meet them one by one.
    pub elastic_price: f64,
    /// Runge-Kutta family of the predictions; that of the problem's settings without it.
    pub family: Option<Family>,
    /// Stages of the method, 0: as the problem's settings say.
    pub n_s: usize,
    /// Steps in every control stage, 0: as many as the settings have finite elements.
    pub steps: usize,
    /// Systems that switch: alternatives to the plan that are prepared at most where a control moves nothing since the system
    /// sticks, and other sequences of controls that choose. Memory for as many linearisations is taken when the controller is made.
    pub flips: usize,
    /// An alternative is taken where its predicted cost is lower than that of the plan by more than this share of the latter.
    pub hysteresis: f64,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            scheme: Scheme::Rti,
            level: Level::D0,
            inner: 1,
            tol: 1e-8,
            qp: QpMethod::Auto,
            shift: false,
            deadline: f64::INFINITY,
            max_changes: 0,
            elastic_price: 0.0,
            family: None,
            n_s: 0,
            steps: 0,
            flips: 4,
            hysteresis: 0.01,
        }
    }
}

impl Options {
    /// The Hessian of the linearisations.
    pub fn hessian(&self) -> HessianKind {
        match self.level {
            Level::D1 => HessianKind::QuasiNewton,
            Level::D2 => HessianKind::Exact,
            _ => HessianKind::GaussNewton,
        }
    }

    /// Checks that all numbers are in their ranges.
    pub fn validate(&self) -> Result<()> {
        let range = |ok: bool, what: &str| if ok { Ok(()) } else { Err(Error::Range(what.into())) };
        range(self.tol > 0.0 && self.tol.is_finite(), "tol must be positive")?;
        range(self.deadline > 0.0, "the deadline must be positive; infinite for none")?;
        range(self.elastic_price >= 0.0 && self.elastic_price.is_finite(), "elastic_price must not be negative")?;
        range(self.inner <= 10_000, "inner is at most 10000")?;
        range(self.steps <= 1000, "steps is at most 1000")?;
        range(self.n_s <= 9, "n_s is at most 9")?;
        range(self.flips <= 64, "flips is at most 64")?;
        range((0.0..1.0).contains(&self.hysteresis), "hysteresis is a share, from 0 to below 1")
    }
}
