//! Better branches by models, where rows are not linear or the objective is not quadratic: branch and bound over all branches of a convex
//! quadratic model of the program at its solution, and a solve of the branch that it ends in.
//!
//! The rows of the model are linearised, and its objective has the curvature of the Lagrange function, as in sequential quadratic
//! programming. S. Scholtes, M. Stöhr (SIAM J. Control Optim. 37, 1999) and S. Leyffer, T. Munson (ANL/MCS-P1457, 2007) choose branches by
//! linear models within a trust region, whose descents end at B-stationary points. A quadratic one says something of branches that are far, too:
//! the first one has no trust region, and smaller ones follow while branches that they promise are not better.

use super::branches::Branches;
use super::exact::{is_worth, Best, Convex};
use super::portfolio::FoundBy;
use super::problem::{Mpcc, Side};
use super::solver::{MpccSolver, Polish, Solution, Warm};
use crate::nlp::{Bounds, Control, Outcome};
use crate::stop;

/// Models of a solve at most, and the radii of their trust regions in sizes of variables.
const MODELS: usize = 12;
const RADII: [f64; 3] = [f64::INFINITY, 3.0, 0.3];
/// Share of the terms of the objective that a model has to promise.
const BETTER: f64 = 1e-6;
/// Barrier parameter at which a branch starts.
const FIRST_BARRIER: f64 = 1e-3;
/// Share of the work of branch and bound that is allowed for one model. Of 97 programs that are drawn 95 then end at the optimum, with all of it 96, and 83
/// without models.
const SHARE: f64 = 0.1;

impl MpccSolver {
    /// Goes on from an exact solution to branches that models of the program promise to be better, as long as they are.
    pub(super) fn descend_by_models(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, control: &mut Control) {
        let exact = self.solution.outcome == Outcome::Solved && self.solution.polish == Polish::Done;
        let asked = exact && self.has_others() && !self.is_part;
        if !asked || !is_worth(p.n(), p.m(), SHARE * self.settings.branch_work) {
            return;
        }
        let pairs = p.pairs().to_vec();
        let mut asked: Vec<Vec<Side>> = vec![self.solution.sides.clone()];
        let mut radius = 0;
        for _ in 0..MODELS {
            if radius == RADII.len() || stop::requested().is_some() || self.iterations_left() == 0 {
                return;
            }
            // what the model does not promise anywhere it does not promise within a smaller region
            let Some(best) = self.best_of_model(p, &pairs, bounds, RADII[radius]) else { return };
            if asked.contains(&best.sides) || !self.enter_promised(p, bounds, &best, control) {
                radius += 1;
            } else {
                radius = 0;
            }
            asked.push(best.sides);
        }
    }

    /// The best point of the model within a trust region, where it is better than the solution. The model is in the units of the solver, so
    /// that what it says does not depend on those of the program.
    fn best_of_model(
        &mut self,
        p: &mut dyn Mpcc,
        pairs: &[(usize, usize)],
        bounds: &Bounds,
        radius: f64,
    ) -> Option<Best> {
        let (n, m) = (p.n(), p.m());
        let (mut c, mut grad, mut x) = (vec![0.0; m], vec![0.0; n], vec![0.0; n]);
        let (mut jac, mut hess) = (vec![0.0; p.jac_pattern().nnz()], vec![0.0; p.hess_pattern().nnz()]);
        let (s, scaling) = (&self.solution, &self.st.scaling);
        let f = p.eval(&s.x, &mut c).ok()?;
        p.derivatives(&s.x, &mut grad, &mut jac).ok()?;
        let y: Vec<f64> = s.y.iter().map(|y| y * scaling.objective).collect();
        p.hessian(&s.x, scaling.objective, &y, &mut hess).ok()?;
        let f = scaling.value(f, &mut c);
        scaling.derivatives(&mut grad, p.jac_pattern(), &mut jac);
        scaling.hessian(p.hess_pattern(), &mut hess);
        scaling.shrink(&s.x, &mut x);
        let mut near = bounds.clone();
        scaling.bounds(&mut near);
        let of_pairs = near.xl.clone();
        for (j, x) in x.iter().enumerate() {
            let room = radius * x.abs().max(1.0);
            (near.xl[j], near.xu[j]) = (near.xl[j].max(x - room), near.xu[j].min(x + room));
        }
        // every branch has to be there
        for &j in pairs.iter().flat_map(|(a, b)| [a, b]) {
            near.xl[j] = of_pairs[j];
        }
        let model = Convex::model(f, &grad, p.hess_pattern(), &hess, &x)?;
        let ceiling = f - BETTER * model.size(&x);
        let branches = Branches::linearised(p, pairs, near, &x, (&c, &jac));
        let mut best = branches.below(&model, ceiling, SHARE * self.settings.branch_work).best?;
        for (j, size) in scaling.sizes.iter().enumerate() {
            best.x[j] *= size;
            best.z[j] /= size * scaling.objective;
        }
        for (y, unit) in best.y.iter_mut().zip(&scaling.rows) {
            *y *= unit / scaling.objective;
        }
        Some(best)
    }

    /// Solves the branch that a model ends in, from there: by the square system, or else by the barrier. True where that is better than the
    /// solution, which it then is.
    fn enter_promised(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, best: &Best, control: &mut Control) -> bool {
        let before = self.solution.clone();
        self.branch.copy_from(bounds);
        self.sides.copy_from_slice(&best.sides);
        p.branch(&best.sides, &mut self.branch);
        self.load(p, &Warm { x: &best.x, y: &best.y, z: &best.z });
        self.close = true;
        let mut ok = self.settle_saved(p, control);
        if !ok {
            self.st.start(&best.x, &mut self.point);
            ok = self.run_from_point(p, bounds, FIRST_BARRIER, control) == Outcome::Solved;
            if ok {
                self.record_exact(p, control);
            }
        }
        let better = ok && self.is_better(before.objective);
        if better {
            self.solution.found_by = FoundBy::Models;
            self.judge(p, bounds, control);
        } else {
            let stats = self.solution.stats;
            self.solution = Solution { stats, ..before };
        }
        self.close = false;
        p.set_polishing(false);
        better
    }
}
