//! Another method in the place of one whose relaxed problems are not well posed.

use super::Ocp;
use crate::error::{Error, Result};
use crate::fesd::Fesd;
use crate::func::EvalError;
use crate::mpcc::{Polish, Solution};
use crate::nlp::{Control, Nlp, Outcome, Statistics};
use crate::sim::SolveOptions;

/// A solution, and its point in the variables of the problem with the other method.
pub(super) type Found = (Solution, Vec<f64>);

impl Ocp {
    /// Solves the problem with Radau IIA of as many stages on the same grid, and gives its solution, where it is exact, as
    /// a point of `problem`, with the work it took.
    pub(super) fn with_stand_in(
        &self,
        problem: &Fesd,
        options: &SolveOptions,
        control: &mut Control,
    ) -> Result<(Option<Found>, Statistics)> {
        let mut other = self.blank();
        other.n_fe.clone_from(&problem.spec().n_fe);
        other.solve_inside(&options.with_radau_iia(), control)?;
        let (Some(built), Some(result)) = (other.built, other.result) else {
            return Ok((None, Statistics::default()));
        };
        if let Some((trouble, EvalError::Fatal(code))) = built.problem.trouble().map(|t| (t.f, t.error)) {
            // a function that asks to stop is not asked again with the other method
            return Err(Error::User { code, what: format!("function '{}'", trouble.name()) });
        }
        let found = built.solver.solution();
        if result.outcome != Outcome::Solved || found.polish != Polish::Done {
            return Ok((None, result.stats));
        }
        let mut w = vec![0.0; problem.n()];
        problem.adopt(&built.problem, &found.x, &mut w);
        Ok((Some((found.clone(), w)), result.stats))
    }
}
