//! Which velocity continues a solution on an intersection of surfaces that holds a continuum of them.

use super::{Engine, Outcome};
use crate::dcs::filippov::{distinct, holds_ahead, time_ahead, FilippovSolution};
use crate::event::field::Apart;
use crate::event::Selection;
use crate::func::EvalError;

impl Engine {
    /// Puts the velocity that the rule of the options selects in front of the extreme ones among `found`, active sets of all
    /// subsystems that continue the solution. The extreme ones stay in the list: they are the ends of the continuum.
    pub(super) fn select(
        &mut self,
        found: &mut Vec<FilippovSolution>,
        candidates: &[Vec<usize>],
        apart: &Apart,
        length: f64,
    ) -> Result<(), EvalError> {
        if self.options.selection == Selection::Fewest {
            return Ok(());
        }
        let meets = |k: &usize| self.field.meeting_surfaces(*k, &candidates[*k]).is_some();
        let mut corners: Vec<usize> = apart.open.iter().copied().filter(meets).collect();
        // of more candidates than the search takes there are no sets to compare
        let unknown = found.is_empty() && apart.open.len() == corners.len();
        let open = |k: usize| {
            let staying = found.iter().filter(|s| self.stays(k, &candidates[k], s)).cloned().collect();
            distinct(&self.field, &self.x, staying).len() > 1
        };
        corners.retain(|&k| unknown || open(k));
        if corners.is_empty() {
            return Ok(());
        }
        let stays = |s: &FilippovSolution| corners.iter().all(|&k| self.stays(k, &candidates[k], s));
        let staying: Vec<bool> = found.iter().map(stays).collect();
        let first = staying.iter().position(|s| *s);
        let mut sets = match first {
            Some(first) => found[first].sets.clone(),
            None if unknown => apart.sets.clone(),
            None => return Ok(()),
        };
        corners.iter().for_each(|&k| sets[k].clone_from(&candidates[k]));
        let most = corners.iter().filter_map(|&k| self.field.meeting_surfaces(k, &candidates[k])).max();
        if let (Selection::Moments, Some(most)) = (self.options.selection, most.filter(|m| *m > 2)) {
            let text = format!(
                "{most} surfaces meet, and the moments method selects a velocity where two do: set the option selection to bilinear or \
                 norm"
            );
            self.fail(Outcome::Ambiguous, text);
            found.clear();
            return Ok(());
        }
        let present = sets == self.field.active;
        let Some((selected, holds)) = self.selected_solution(sets, length)? else { return Ok(()) };
        if holds && present {
            // the choice was made when the motion came here
            let mut staying = staying.into_iter();
            found.retain(|_| !staying.next().unwrap_or(false));
            found.insert(0, selected);
        } else if holds {
            found.insert(first.unwrap_or(0), selected);
        } else if present {
            // the velocity goes on without a jump where it can
            let same =
                |s: &FilippovSolution| distinct(&self.field, &self.x, vec![selected.clone(), s.clone()]).len() < 2;
            found.sort_by_cached_key(|s| !same(s));
        }
        Ok(())
    }

    /// Do the active sets of a solution keep all surfaces of subsystem `k` that these cells meet at?
    fn stays(&self, k: usize, cells: &[usize], s: &FilippovSolution) -> bool {
        let mut tied = (0..self.field.surfaces(k).len()).filter(|j| self.field.ties(k, cells, *j));
        tied.all(|j| self.field.ties(k, &s.sets[k], j))
    }

    /// The solution with these active sets and the weights that the rule selects, and whether they are weights that stay so; none
    /// where the rule has none.
    fn selected_solution(
        &mut self,
        sets: Vec<Vec<usize>>,
        length: f64,
    ) -> Result<Option<(FilippovSolution, bool)>, EvalError> {
        let held = self.field.hold();
        let alpha = self.field.alpha.clone();
        let (t, x) = (self.t, self.x.clone());
        self.field.set_active(&sets);
        let mut known = || -> Result<(FilippovSolution, bool), EvalError> {
            let f = &mut self.field;
            f.scale_constraints(t, &x)?;
            let mut velocity = vec![0.0; x.len()];
            f.rhs(t, &x, &mut velocity)?;
            let theta: Vec<Vec<f64>> = sets.iter().map(|s| s.iter().map(|c| f.theta(*c)).collect()).collect();
            let margin = theta.iter().flatten().fold(f64::INFINITY, |m, v| m.min(*v));
            let ahead = time_ahead(f, &x, &velocity, length);
            let there: Vec<f64> = x.iter().zip(&velocity).map(|(x, v)| x + ahead * v).collect();
            let mut holds = margin.is_finite();
            if !theta.iter().flatten().all(|v| holds_ahead(*v, f64::NEG_INFINITY)) {
                f.hidden(t + ahead, &there)?;
                let mut both = sets.iter().flatten().zip(theta.iter().flatten());
                holds &= both.all(|(c, v)| holds_ahead(*v, f.theta(*c)));
            }
            Ok((FilippovSolution { sets: sets.clone(), theta, velocity, margin }, holds))
        };
        let r = known();
        self.field.release(held);
        self.field.alpha = alpha;
        match r {
            Ok(s) => Ok(Some(s)),
            Err(EvalError::Recoverable) => Ok(None),
            Err(e) => Err(e),
        }
    }
}
