//! Programs that their branches decide: solved by branch and bound instead of along a path, or proved to be infeasible.

use super::branches::Branches;
use super::certificate::{BStationarity, Doubt};
use super::exact::{is_worth, Best, Convex, Minimum};
use super::portfolio::FoundBy;
use super::problem::Mpcc;
use super::proposer::ActiveSetProposer;
use super::solver::{MpccSolver, Polish, Warm};
use crate::nlp::{Bounds, Control, Outcome};

/// Share of the terms of an objective up to which the solution of a branch is the point that was found in it.
const SAME: f64 = 1e-7;
/// Work of complementary pivoting at most, in factorisations: what the path takes.
const LEMKE: f64 = 20.0;

impl MpccSolver {
    /// Searches the branches of a program whose rows are linear and whose objective is convex and quadratic. Nothing for others.
    pub(super) fn search_branches(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, x0: &[f64]) -> Option<Minimum> {
        let work = self.settings.branch_work;
        if work == 0.0 || !self.has_others() || self.is_part {
            return None;
        }
        let (n, m, pairs) = (p.n(), p.m(), p.pairs().to_vec());
        // those of a linear complementarity problem, which may take few pivots
        let square = n == 2 * m && m == pairs.len() && m == p.lifts().len();
        if !square && !is_worth(n, m, work) {
            return None;
        }
        let branches = Branches::linear(p, &pairs, bounds, x0)?;
        let f = Convex::of(p, &branches, x0)?;
        if let Some(objective) = f.is_constant() {
            let least = LEMKE * self.ipm.linear_statistics().work();
            if let Some(best) = branches.by_pivots(p, objective, least) {
                return Some(Minimum { last: best.x.clone(), best: Some(best), bound: objective, complete: true });
            }
        }
        is_worth(n, m, work).then(|| branches.minimum(&f, work))
    }

    /// Ends at the best point of the branches, if the search has shown that it is the optimum, or at the proof that there is no point;
    /// false where neither is known.
    pub(super) fn end_by_branches(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        minimum: &Minimum,
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) -> bool {
        if !minimum.complete {
            return false;
        }
        let Some(best) = &minimum.best else {
            self.solution.outcome = Outcome::Infeasible;
            self.solution.x.copy_from_slice(&minimum.last);
            self.end_at_least_violation(p, bounds, control);
            return true;
        };
        self.enter_best(p, bounds, best, control, proposer)
    }

    /// Goes to the best point of the branches where the path has led to a worse one, and keeps the bound that was proved.
    pub(super) fn improve_by_branches(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        minimum: &Minimum,
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) {
        if let Some(best) = &minimum.best {
            let solved = self.solution.outcome == Outcome::Solved;
            if !solved || self.solution.objective > best.objective + SAME * best.size {
                let before = self.solution.clone();
                self.enter_best(p, bounds, best, control, proposer);
                self.keep(before, FoundBy::Branches);
            }
        }
        let bound = (minimum.bound > f64::NEG_INFINITY).then_some(minimum.bound);
        self.solution.certificate.bound = bound;
    }

    /// The branch of this point from there: first by the square system, whose solution it nearly is.
    fn enter_best(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        best: &Best,
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) -> bool {
        self.branch.copy_from(bounds);
        self.sides.copy_from_slice(&best.sides);
        p.branch(&best.sides, &mut self.branch);
        self.load(p, &Warm { x: &best.x, y: &best.y, z: &best.z });
        self.close = true;
        let mut ok = self.settle_saved(p, control) && self.is_at(best);
        if ok {
            self.solution.found_by = FoundBy::Branches;
            self.judge(p, bounds, control);
        } else {
            self.close = false;
            self.enter_feasible(p, bounds, &best.sides, &best.x, control, proposer);
            ok = self.solution.outcome == Outcome::Solved && self.is_at(best);
            self.solution.found_by = FoundBy::Branches;
        }
        self.close = false;
        p.set_polishing(false);
        ok
    }

    /// Has the recorded solution the objective of this point?
    fn is_at(&self, best: &Best) -> bool {
        (self.solution.objective - best.objective).abs() <= SAME * best.size
    }

    /// What the search has shown of the recorded solution: no branch has a lower objective, so none has a descent.
    pub(super) fn certify_by_branches(&mut self, minimum: &Minimum) {
        let s = &mut self.solution;
        if s.outcome == Outcome::Solved && s.polish == Polish::Done {
            s.certificate.bound = Some(minimum.bound);
            if self.settings.certify && s.certificate.b != BStationarity::Yes {
                (s.certificate.b, s.certificate.doubt) = (BStationarity::Yes, Doubt::None);
            }
        }
    }
}
