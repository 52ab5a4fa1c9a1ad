//! Another method in the place of one whose relaxed problems are not well posed.

use super::Ocp;
use crate::error::Result;
use crate::fesd::Fesd;
use crate::mpcc::{Polish, Solution};
use crate::nlp::{Control, Nlp, Outcome, Statistics};
use crate::settings::{RkFamily, StageForm};

/// A solution, and its point in the variables of the problem with the other method.
pub(super) type Found = (Solution, Vec<f64>);

impl Ocp {
    /// Solves the problem with Radau IIA of as many stages, and gives its solution, where it is exact, as a point
    /// of `problem`, with the work it took.
    pub(super) fn with_stand_in(&self, problem: &Fesd, control: &mut Control) -> Result<(Option<Found>, Statistics)> {
        let mut other = self.blank();
        other.settings.rk_family = RkFamily::RadauIia as i64;
        other.settings.stage_form = StageForm::Auto as i64;
        other.settings.accuracy = 0;
        other.settings.explain = 0;
        let (outcome, stats) = other.solve(control).map(|r| (r.outcome, r.stats))?;
        let Some(built) =
            other.built.filter(|b| outcome == Outcome::Solved && b.solver.solution().polish == Polish::Done)
        else {
            return Ok((None, stats));
        };
        let found = built.solver.solution();
        let mut w = vec![0.0; problem.n()];
        problem.adopt(&built.problem, &found.x, &mut w);
        Ok((Some((found.clone(), w)), stats))
    }
}
