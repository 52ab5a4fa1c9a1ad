//! How a solve ended in the numbers and words of AMPL.

use crate::truth::Truth;
use switchback::mpcc::{BStationarity, Certificate, Doubt, Polish, Solution, Stationarity};
use switchback::nlp::SecondOrder;
use switchback::{Outcome, Settings};

/// `solve_result_num` and the words for it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Verdict {
    /// The number: 0 solved, 100 solved but not quite, 200 infeasible, 300 unbounded, 400 limit, 500 failure, and what follows them.
    pub code: i32,
    /// One line.
    pub text: String,
}

/// Violations up to this multiple of the tolerance are none.
const ALLOWED: f64 = 100.0;

impl Verdict {
    /// A verdict.
    pub fn new(code: i32, text: impl Into<String>) -> Verdict {
        Verdict { code, text: text.into() }
    }

    /// Of a solution, for a program with pairs or without, with what its point is worth, and the options of the solve.
    pub fn of(found: &Solution, has_pairs: bool, truth: &Truth, settings: &Settings) -> Verdict {
        match found.outcome {
            Outcome::Solved => Verdict::solved(found, has_pairs, truth, settings),
            Outcome::Infeasible => Verdict::new(200, "infeasible"),
            Outcome::LocallyInfeasible => Verdict::new(
                201,
                "locally infeasible: the violation of the constraints has a local minimum here; other starts may do better",
            ),
            Outcome::Diverging => Verdict::new(300, "unbounded: the objective falls without an end"),
            Outcome::MaxIter => Verdict::new(400, "limit of iterations (max_iter)"),
            Outcome::MaxTime => Verdict::new(401, "limit of time (max_time)"),
            Outcome::Stopped => Verdict::new(402, "stopped"),
            Outcome::Stalled => Verdict::new(500, "failure: no progress is possible, and the tolerance is not reached"),
            Outcome::Failed => Verdict::new(501, "failure: a function has no value at the starting point; give another start"),
            other => Verdict::new(502, format!("failure: {}", other.name())),
        }
    }

    fn solved(found: &Solution, has_pairs: bool, truth: &Truth, settings: &Settings) -> Verdict {
        let relaxed = has_pairs && found.polish != Polish::Done;
        // some relaxations bound products by their parameter, so that members are as large as its root
        let root = if relaxed { 2.0 * settings.sigma_min.sqrt() } else { 0.0 };
        let allowed = root.max(ALLOWED * settings.tol);
        let missed = truth.violation.is_nan() || truth.violation > allowed;
        let cost = truth.objective.unwrap_or(found.objective);
        let apart = (cost - found.objective).abs();
        let other = apart.is_nan() || apart > allowed * cost.abs().max(1.0);
        if missed || other {
            let why = if missed {
                format!("{} violates its bounds by {:.1e}", truth.place, truth.violation)
            } else {
                format!("the objective there is {cost:e}")
            };
            return Verdict::new(
                120,
                format!("solved, but not as the expressions of the problem are evaluated at the point: {why}"),
            );
        }
        if !has_pairs {
            return match found.certificate.second {
                SecondOrder::StrictMinimum => Verdict::new(0, "optimal solution (a strict local optimum)"),
                SecondOrder::Saddle => Verdict::new(104, "stationary point, but no local optimum: a saddle"),
                _ => Verdict::new(0, "optimal solution (a stationary point)"),
            };
        }
        if relaxed {
            return Verdict::new(103, "solution of a relaxation: pairs are not exactly complementary");
        }
        let Certificate { stationarity, b, doubt, second, .. } = found.certificate;
        let kind = match stationarity {
            Stationarity::Unknown => "a type of stationarity that is not known".to_owned(),
            Stationarity::None => "no multipliers".to_owned(),
            other => format!("{}-stationary", other.name()),
        };
        match b {
            BStationarity::Yes if second == SecondOrder::Saddle => {
                Verdict::new(104, format!("stationary point, but no local optimum: a saddle ({kind}, B-stationary)"))
            }
            BStationarity::Yes => Verdict::new(0, format!("optimal solution ({kind}, B-stationary)")),
            BStationarity::No => Verdict::new(102, format!("stationary point with a descent to first order ({kind})")),
            _ => {
                let why = if doubt == Doubt::None { "not asked" } else { doubt.name() };
                Verdict::new(100, format!("stationary point ({kind}; B-stationary: undecided, {why})"))
            }
        }
    }
}
