//! What an outcome claims, and what it rests on.
//!
//! That a program with pairs has no point, or an objective without a lower bound, is said only where its branches show it
//! ([`Branches`]). That it is solved is said of points whose rows and pairs hold in the units that the program was given in.

use super::branches::{Branches, Place, Said};
use super::certificate::BStationarity;
use super::problem::Mpcc;
use super::solver::{MpccSolver, Polish};
use crate::nlp::{Bounds, Control, Outcome};
use crate::stop;

/// Violation of a row or a bound of a solved program: relative to its bound or to one, or to the terms of the row to first order.
const ROW: f64 = 1e-6;
const ROW_TERMS: f64 = 1e-9;
/// Smaller member of a pair that is closed, and product of the members of one whose relaxation is the answer.
const MEMBER: f64 = 1e-6;
const PRODUCT: f64 = 1e-7;

/// What branches have shown before other strategies are tried.
#[derive(Debug, Default)]
pub(super) struct Shown {
    /// There is no point.
    pub empty: bool,
    /// A point at which all rows hold.
    pub place: Option<Place>,
}

impl MpccSolver {
    /// Asks the branches of a program without an answer whether one of them has a point.
    pub(super) fn ask_branches(&self, p: &mut dyn Mpcc, bounds: &Bounds, x0: &[f64]) -> Shown {
        let pairs = p.pairs().to_vec();
        let Some(branches) = Branches::new(p, &pairs, bounds, x0) else { return Shown::default() };
        match branches.point() {
            Said::Empty => Shown { empty: true, place: None },
            Said::Holds(place) if branches.complete => Shown { empty: false, place: Some(place) },
            _ => Shown::default(),
        }
    }

    /// Keeps the claim that the objective has no lower bound where there is a ray along which it falls: the answer is then a point of
    /// its branch further on. Without one the iterates ran away, which says nothing of the program.
    pub(super) fn confirm_ray(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, x0: &[f64]) {
        if self.solution.outcome == Outcome::Diverging && !self.find_ray(p, bounds, x0) {
            self.solution.outcome = stop::requested().map_or(Outcome::Stalled, Outcome::from);
        }
    }

    /// Looks for a ray; true where there is one, which is then the outcome.
    pub(super) fn find_ray(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, x0: &[f64]) -> bool {
        let pairs = p.pairs().to_vec();
        let Some(branches) = Branches::new(p, &pairs, bounds, x0) else { return false };
        let Some((place, step)) = branches.ray(p, [x0, &self.solution.x]) else { return false };
        let s = &mut self.solution;
        for ((x, at), step) in s.x.iter_mut().zip(&place.x).zip(&step) {
            *x = at + step;
        }
        s.sides.copy_from_slice(&place.sides);
        (s.outcome, s.polish) = (Outcome::Diverging, Polish::None);
        true
    }

    /// Asks a program without pairs that has no answer, which is one branch, what its linear rows show: that there is no point, or that
    /// the objective has no lower bound.
    pub(super) fn ask_rows(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, x0: &[f64], control: &mut Control) {
        let open = matches!(self.solution.outcome, Outcome::Stalled | Outcome::MaxIter | Outcome::Diverging);
        if !open || stop::requested().is_some() {
            return;
        }
        if self.ask_branches(p, bounds, x0).empty {
            self.solution.outcome = Outcome::Infeasible;
            self.end_at_least_violation(p, bounds, control);
        } else {
            self.find_ray(p, bounds, x0);
        }
    }

    /// The last word of a solve: a point that is called a solution meets rows and pairs in the units of the program, and a call that
    /// had no more iterations says so.
    pub(super) fn conclude(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, x0: &[f64]) {
        // a descent that is known and was not followed to its end
        let falls = self.solution.certificate.b == BStationarity::No;
        if self.solution.outcome == Outcome::Solved && falls && self.find_ray(p, bounds, x0) {
            return;
        }
        if self.solution.outcome == Outcome::Solved && (falls || !self.is_closed(p, bounds)) {
            self.solution.outcome = stop::requested().map_or(Outcome::Stalled, Outcome::from);
        }
        if self.solution.outcome == Outcome::Stalled && self.iterations_left() == 0 {
            self.solution.outcome = Outcome::MaxIter;
        }
    }

    /// Do rows, bounds and pairs of the recorded point hold in the units of the program?
    fn is_closed(&self, p: &mut dyn Mpcc, bounds: &Bounds) -> bool {
        let x = &self.solution.x;
        let (n, m) = (p.n(), p.m());
        let (mut c, mut grad, mut jac) = (vec![0.0; m], vec![0.0; n], vec![0.0; p.jac_pattern().nnz()]);
        if p.eval(x, &mut c).is_err() || p.derivatives(x, &mut grad, &mut jac).is_err() {
            return stop::requested().is_some();
        }
        let mut terms = vec![0.0; m];
        for (j, x) in x.iter().enumerate() {
            for k in p.jac_pattern().range(j) {
                terms[p.jac_pattern().row_idx()[k]] += (jac[k] * x).abs();
            }
        }
        let holds = |v: f64, lo: f64, hi: f64, terms: f64| -> bool {
            let room = |bound: f64| (ROW * bound.abs().max(1.0)).max(ROW_TERMS * terms);
            v >= lo - room(lo) && v <= hi + room(hi)
        };
        // without a polish the answer is that of the last relaxation, which bounds products by its parameter, or members by the root of it
        // (Kadrani, Dussault, Benchakroun, SIAM J. Optim. 20 (2009) 78-103; Lin, Fukushima, Ann. Oper. Res. 133 (2005) 63-84)
        let relaxed = self.solution.polish != Polish::Done;
        let member = if relaxed { MEMBER.max(2.0 * self.settings.sigma_min.sqrt()) } else { MEMBER };
        let mut below = vec![0.0; n];
        for &(a, b) in p.pairs().iter().filter(|_| relaxed) {
            (below[a], below[b]) = (member, member);
        }
        (0..n).all(|j| holds(x[j], bounds.xl[j] - below[j], bounds.xu[j], 0.0))
            && (0..m).all(|i| holds(c[i], bounds.cl[i], bounds.cu[i], terms[i]))
            && p.pairs().iter().all(|&(a, b)| x[a].min(x[b]) <= member || x[a] * x[b] <= PRODUCT)
    }
}
