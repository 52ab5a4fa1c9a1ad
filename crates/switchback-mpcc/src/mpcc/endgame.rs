//! From the last relaxed problem to an exact point: active set, square Newton system, branch problem.
//!
//! The active set is read off the relaxed solution: a side for every group of pairs, and the bounds and rows whose
//! multiplier exceeds their distance. With it the optimality conditions are a square system; Newton's method solves it
//! in two or three steps, and what has the wrong sign afterwards changes its place (the primal-dual active set strategy:
//! M. Hintermüller, K. Ito, K. Kunisch, SIAM J. Optim. 13, 2002). Where that does not settle, the branch problem is
//! solved by the interior-point method, and other active sets are tried.

use std::time::Instant;

use super::homotopy::{Branch, Settle};
use super::problem::{Mpcc, Side};
use super::proposer::{ActiveSetProposer, ProposalKind};
use super::relaxed::Relaxed;
use super::solver::{MpccSolver, Polish, KEPT_RELAXATION};
use super::tangent::Sides;
use crate::nlp::{Bounds, Control, Iterate, Monotone, Outcome, Start, INFINITE};
use crate::stop;

/// Single decisions turned round at most.
const MAX_FLIPS: usize = 4;
/// Ratio of the members of a pair up to which it leaves no doubt which one is zero.
const CLEAR: f64 = 0.05;
/// The same on the way. The signs in the square system say of every set whether it is the right one: one that is costs no further rungs, one that
/// is not a few steps.
const EARLY_CLEAR: f64 = 0.15;
/// Ratio from which both may be zero.
const DOUBTFUL: f64 = 1e-3;
/// A multiplier, or a distance from a bound, that is as good as zero.
const WEAK: f64 = 1e-9;
/// Violation from which a point that is no solution of its branch is worth a try with the square system.
pub(super) const NEAR: f64 = 1e-4;
/// Violation from which its objective says something of the branches next to it.
const TELLING: f64 = 1e-2;
/// Newton solves with changing active sets.
const ROUNDS: usize = 5;
/// Product of the rounding of a member that is a function and its partner from which that is drawn back, and the share of it that it is
/// drawn back to.
const DRAWN: f64 = KEPT_RELAXATION;
const DRAWN_SHARE: f64 = 1e-4;

/// How much is tried for an exact point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Effort {
    /// The square system of a set that leaves no doubt.
    Early,
    /// The identified set and those that are suggested; a point that solves a later relaxation may leave less doubt.
    Identified,
    /// Doubtful decisions turned round as well.
    All,
}

/// Which bound of a variable or row holds with equality.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Active {
    No,
    Lower,
    Upper,
}

/// Rates of a solution along one change of its data, in the variables and rows of the solver.
pub(super) struct Rates<'a> {
    /// Of the variables.
    pub x: &'a [f64],
    /// Of the multipliers of fixed variables.
    pub z: &'a [f64],
    /// Of the multipliers of rows.
    pub y: &'a [f64],
    /// Of the rows.
    pub c: &'a [f64],
}

/// Active bounds, and room to work with them.
pub(super) struct ActiveSet {
    x: Vec<Active>,
    c: Vec<Active>,
    /// Bounds of the branch problem.
    exact: Bounds,
    /// Multipliers of fixed variables.
    z: Vec<f64>,
    pub(super) at: Iterate,
    /// Where the square system was solved before members were drawn back.
    found: Iterate,
    /// Sizes of the terms of the rows `[m]`, and the rounding of the variables that are functions `[n]`.
    terms: Vec<f64>,
    rounding: Vec<f64>,
}

impl ActiveSet {
    pub fn new(n: usize, m: usize) -> ActiveSet {
        ActiveSet {
            x: vec![Active::No; n],
            c: vec![Active::No; m],
            exact: Bounds::free(n, m),
            z: vec![0.0; n],
            at: Iterate::zeros(n, m),
            found: Iterate::zeros(n, m),
            terms: vec![0.0; m],
            rounding: vec![0.0; n],
        }
    }

    /// Forgets the multipliers of fixed variables: those that are not written again count for tolerances.
    pub fn reset(&mut self) {
        self.z.fill(0.0);
    }

    /// Bounds and rows whose multiplier exceeds their distance at the interior point `at`.
    fn guess(&mut self) {
        let ActiveSet { x, c, exact: b, at, .. } = self;
        for j in 0..x.len() {
            x[j] = guess(at.x[j], b.xl[j], b.xu[j], at.zl[j], at.zu[j]);
        }
        for i in 0..c.len() {
            c[i] = guess(at.s[i], b.cl[i], b.cu[i], at.vl[i], at.vu[i]);
        }
    }

    /// The bounds under which the active ones are equations and the others absent.
    fn bounds(&self, out: &mut Bounds) {
        let b = &self.exact;
        for (j, a) in self.x.iter().enumerate() {
            (out.xl[j], out.xu[j]) = restrict(*a, b.xl[j], b.xu[j]);
        }
        for (i, a) in self.c.iter().enumerate() {
            (out.cl[i], out.cu[i]) = restrict(*a, b.cl[i], b.cu[i]);
        }
    }

    /// Does some bound hold without a multiplier, at the settled point with rows `c`?
    pub fn is_weak(&self, c: &[f64]) -> bool {
        let ActiveSet { x, c: active, exact: b, z, at, .. } = self;
        let largest = |v: &[f64]| v.iter().fold(1f64, |a, v| a.max(v.abs()));
        let tol = WEAK * largest(&at.y).max(largest(z));
        let weak = |a: &Active, v: f64, lo: f64, hi: f64, z: f64| {
            let dist = (v - lo).min(hi - v);
            lo < hi && if *a == Active::No { dist <= WEAK * (1.0 + v.abs()) } else { z.abs() <= tol }
        };
        (0..x.len()).any(|j| weak(&x[j], at.x[j], b.xl[j], b.xu[j], z[j]))
            || (0..c.len()).any(|i| weak(&active[i], c[i], b.cl[i], b.cu[i], at.y[i]))
    }

    /// Is a member of one of these pairs held at zero by its branch alone, without a multiplier, while the other one is zero too? The other branch may
    /// be the one on which a solution nearby is.
    pub fn has_weak_pair(&self, pairs: &[(usize, usize)]) -> bool {
        let ActiveSet { z, at, .. } = self;
        let largest = |v: &[f64]| v.iter().fold(1f64, |a, v| a.max(v.abs()));
        let tol = WEAK * largest(&at.y).max(largest(z));
        pairs.iter().any(|&(a, b)| at.x[a].max(at.x[b]) <= WEAK && z[a].abs().min(z[b].abs()) <= tol)
    }

    /// On which sides of the present data the solution follows its rates `r` with the active set as it is, at the settled point with
    /// rows `c`: on a side on which bounds that are active without a multiplier get none of the wrong sign, and those that hold
    /// without being active are not crossed. Both members of a pair may be zero: then one of them must rise, or the other one, which
    /// its branch holds, have a multiplier that is not negative.
    pub fn sides(&self, c: &[f64], pairs: &[(usize, usize)], r: &Rates) -> Sides {
        let ActiveSet { x, c: active, exact: b, z, at, .. } = self;
        let largest = |v: &[f64]| v.iter().fold(0f64, |a, v| a.max(v.abs()));
        let tol = WEAK * largest(&at.y).max(largest(z)).max(1.0);
        let (of_x, of_c) = (WEAK * largest(r.x), WEAK * largest(r.c));
        let of_z = WEAK * largest(r.z).max(largest(r.y));
        // what decides on a side: a rate that must not be negative there, and how much of it is rounding
        let rate = |a: Active, v: f64, (lo, hi): (f64, f64), (z, dz): (f64, f64), (dv, small): (f64, f64)| {
            let near = WEAK * (1.0 + v.abs());
            match a {
                _ if lo >= hi => None,
                Active::Lower => (z.abs() <= tol).then_some((dz, of_z)),
                Active::Upper => (z.abs() <= tol).then_some((-dz, of_z)),
                Active::No if v - lo <= near => Some((dv, small)),
                Active::No if hi - v <= near => Some((-dv, small)),
                Active::No => None,
            }
        };
        let mut conditions: Vec<(f64, f64)> = Vec::new();
        for j in 0..x.len() {
            conditions.extend(rate(x[j], at.x[j], (b.xl[j], b.xu[j]), (z[j], r.z[j]), (r.x[j], of_x)));
        }
        for i in 0..active.len() {
            let limits = (b.cl[i], b.cu[i]);
            conditions.extend(rate(active[i], c[i], limits, (-at.y[i], -r.y[i]), (r.c[i], of_c)));
        }
        let on = |sign: f64| {
            let corner = |&(a, o): &(usize, usize)| {
                let held = b.xl[a] == b.xu[a] && at.x[a].max(at.x[o]) <= WEAK && z[a] <= tol;
                let rises = sign * r.x[o] > of_x;
                !held || rises || (z[a] >= -tol && sign * r.z[a] >= -of_z)
            };
            conditions.iter().all(|(rate, small)| sign * rate >= -small)
                && pairs.iter().flat_map(|&(a, b)| [(a, b), (b, a)]).all(|pair| corner(&pair))
        };
        match (on(1.0), on(-1.0)) {
            (true, true) => Sides::Both,
            (true, false) => Sides::Rising,
            (false, true) => Sides::Falling,
            (false, false) => Sides::Neither,
        }
    }

    /// Lets go of the bounds that hold without a multiplier; false where there are none.
    pub fn drop_weak(&mut self) -> bool {
        let ActiveSet { x, c: active, z, at, .. } = self;
        let largest = |v: &[f64]| v.iter().fold(1f64, |a, v| a.max(v.abs()));
        let tol = WEAK * largest(&at.y).max(largest(z));
        let mut dropped = false;
        let multipliers = z.iter().chain(&at.y);
        for (a, z) in x.iter_mut().chain(active).zip(multipliers) {
            if *a != Active::No && z.abs() <= tol {
                *a = Active::No;
                dropped = true;
            }
        }
        dropped
    }

    /// Takes in what is violated at the point `at` with rows `c`, lets go what has the wrong sign; false when nothing
    /// changed.
    fn update(&mut self, c: &[f64]) -> bool {
        let ActiveSet { x, c: active, exact: b, z, at, .. } = self;
        let largest = |v: &[f64]| v.iter().fold(0f64, |a, v| a.max(v.abs()));
        let tol = 1e-9 * (1.0 + largest(&at.y).max(largest(z)));
        let mut changed = false;
        for j in 0..x.len() {
            changed |= update(&mut x[j], at.x[j], b.xl[j], b.xu[j], z[j], tol);
        }
        for i in 0..c.len() {
            changed |= update(&mut active[i], c[i], b.cl[i], b.cu[i], -at.y[i], tol);
        }
        changed
    }
}

fn guess(v: f64, lo: f64, hi: f64, zl: f64, zu: f64) -> Active {
    if lo == hi {
        Active::No
    } else if lo > -INFINITE && zl > v - lo {
        Active::Lower
    } else if hi < INFINITE && zu > hi - v {
        Active::Upper
    } else {
        Active::No
    }
}

fn restrict(a: Active, lo: f64, hi: f64) -> (f64, f64) {
    match a {
        _ if lo == hi => (lo, hi),
        Active::Lower => (lo, lo),
        Active::Upper => (hi, hi),
        Active::No => (f64::NEG_INFINITY, f64::INFINITY),
    }
}

/// `z` is the multiplier, lower minus upper.
fn update(a: &mut Active, v: f64, lo: f64, hi: f64, z: f64, tol: f64) -> bool {
    let before = *a;
    if lo < hi {
        *a = match before {
            Active::Lower if z < -tol => Active::No,
            Active::Upper if z > tol => Active::No,
            Active::No if v < lo - 1e-12 * (1.0 + lo.abs()) => Active::Lower,
            Active::No if v > hi + 1e-12 * (1.0 + hi.abs()) => Active::Upper,
            a => a,
        };
    }
    *a != before
}

impl MpccSolver {
    /// Votes of the pairs of every group at the point in `saved`: the side with the smaller sum is zero.
    pub(super) fn identify(&mut self, p: &dyn Mpcc) {
        let x = &self.saved.x;
        self.votes.fill((0.0, 0.0));
        for (k, &(a, b)) in p.pairs().iter().enumerate() {
            let v = &mut self.votes[p.group(k)];
            v.0 += x[a].max(0.0);
            v.1 += x[b].max(0.0);
        }
        for (side, v) in self.sides.iter_mut().zip(&self.votes) {
            *side = if v.0 <= v.1 { Side::First } else { Side::Second };
        }
        let votes = &self.votes;
        self.order.sort_unstable_by(|&a, &b| doubt(&votes[b]).total_cmp(&doubt(&votes[a])).then(a.cmp(&b)));
    }

    /// Doubt about the `k`-th least certain decision.
    fn doubt(&self, k: usize) -> f64 {
        doubt(&self.votes[self.order[k]])
    }

    /// Turns the `k`-th least certain decision round.
    fn flip(&mut self, k: usize) {
        let side = &mut self.sides[self.order[k]];
        *side = side.other();
    }

    /// An exact point from the relaxed one in `saved`; true when there is one. `effort` says what is tried.
    ///
    /// First the square system of the identified active set, then its branch problem, then those of the suggested
    /// sets, of the set with all doubtful pairs zero on both sides, and of the neighbours of the first.
    pub(super) fn polish(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
        effort: Effort,
    ) -> bool {
        let early = effort == Effort::Early;
        self.close = true;
        self.identify(p);
        let clear = self.doubt(0) <= if early { EARLY_CLEAR } else { CLEAR };
        let mut ok = (!early || (clear && self.policy.early)) && self.settle_branch(p, bounds, control);
        if !early {
            ok = ok || self.try_branch(p, bounds, control);
            for k in 0.. {
                if ok || stop::requested().is_some() {
                    break;
                }
                self.identify(p);
                self.st.scaling.grow(&self.saved.x, &mut self.room);
                if !proposer.propose(ProposalKind::Repair(k), &self.room, &mut self.sides) {
                    break;
                }
                ok = self.try_branch(p, bounds, control);
            }
            if !ok && !clear && effort == Effort::All {
                self.identify(p);
                ok = self.try_corner(p, bounds, control);
            }
            if !ok && effort == Effort::All {
                self.identify(p);
                for k in 0..MAX_FLIPS.min(self.sides.len()) {
                    if self.doubt(k) < DOUBTFUL {
                        break;
                    }
                    self.flip(k);
                    ok = self.try_branch(p, bounds, control);
                    if ok {
                        break;
                    }
                    self.flip(k);
                }
            }
        }
        if ok {
            self.improve(p, bounds, control, proposer);
            self.judge(p, bounds, control);
        } else if let Some(why) = stop::requested() {
            // whether there is an exact solution remains open
            self.solution.outcome = why.into();
        } else if !early {
            self.solution.polish = Polish::Rejected;
        }
        self.close = false;
        p.set_polishing(false);
        ok
    }

    /// Looks for an active set again, from the point the relaxation reached in the last solve, after the branch problems
    /// have changed; true when one is solved.
    pub fn polish_again(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) -> bool {
        let clock = Instant::now();
        let ok = self.polish(p, bounds, control, proposer, Effort::All);
        self.solution.stats.time_total += clock.elapsed().as_secs_f64();
        ok
    }

    /// Records the branch problem just solved, to the last digits where the square system gives them.
    pub(super) fn record_exact(&mut self, p: &mut dyn Mpcc, control: &mut Control) {
        self.record(p, Outcome::Solved, Polish::Done);
        self.active.at.copy_from(self.ipm.iterate());
        if self.settle(p, control) {
            self.record(p, Outcome::Solved, Polish::Done);
        }
    }

    /// Square system of the branch `sides` from the point in `saved`; recorded when it has a solution with the right
    /// signs.
    fn settle_branch(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, control: &mut Control) -> bool {
        self.branch.copy_from(bounds);
        p.branch(&self.sides, &mut self.branch);
        self.settle_saved(p, control)
    }

    /// Square system of the bounds in `branch`, as [`MpccSolver::settle_branch`].
    pub(super) fn settle_saved(&mut self, p: &mut dyn Mpcc, control: &mut Control) -> bool {
        p.set_polishing(true);
        let at = &mut self.active.at;
        at.copy_from(&self.saved);
        // what stands for the pairs contributes to the multipliers of the bounds of their members
        self.st.pull_back(&at.x, &at.y, &mut at.zl);
        for b in &self.st.bilinear {
            at.zl[b.a] = at.zl[b.a].max(0.0);
            at.zl[b.b] = at.zl[b.b].max(0.0);
        }
        let ok = self.settle(p, control);
        if ok {
            self.record(p, Outcome::Solved, Polish::Done);
        }
        ok
    }

    /// Square system of a program without pairs near the point in `saved`; recorded when it has a solution.
    pub(super) fn settle_near(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, control: &mut Control) -> bool {
        self.branch.copy_from(bounds);
        self.close = true;
        let ok = self.settle_saved(p, control);
        self.close = false;
        p.set_polishing(false);
        ok
    }

    /// The square system at the point `active.at` under the bounds in `branch`. Members that it leaves free and that run away are drawn back.
    pub(super) fn settle(&mut self, p: &mut dyn Mpcc, control: &mut Control) -> bool {
        if !self.settings.square_newton {
            return false;
        }
        self.st.bounds(&self.branch, f64::INFINITY, &mut self.active.exact);
        self.active.guess();
        if !self.settle_set(p, control) {
            return false;
        }
        if !self.draw_back(p) {
            return true;
        }
        let best = self.ipm.objective();
        let close = |f: f64| f - best <= DRAWN * (1.0 + best.abs());
        if self.settle_set(p, control) && close(self.ipm.objective()) {
            return true;
        }
        // something holds them: the point as it was
        let ActiveSet { at, found, .. } = &mut self.active;
        at.copy_from(found);
        self.active.guess();
        self.settle_set(p, control)
    }

    /// Draws members back whose product with the rounding of their partner, a function, is no longer zero; false where there are none.
    ///
    /// A multiplier of a problem below another one that appears in nothing but its own pair, or with others whose gradients cancel,
    /// is on a ray of solutions, and the barrier moves it towards infinity. The residual of the pair in double precision is the
    /// rounding of the function times the multiplier, so that a point far out is a worse solution than one near by.
    fn draw_back(&mut self, p: &dyn Mpcc) -> bool {
        let lifts = p.lifts();
        if lifts.is_empty() || !self.policy.free_pairs {
            return false;
        }
        let ActiveSet { at, found, terms, rounding, .. } = &mut self.active;
        self.ipm.row_terms(terms);
        found.copy_from(at);
        let x = &mut at.x;
        rounding.fill(0.0);
        for &(row, v) in lifts {
            rounding[v] = f64::EPSILON * terms[row];
        }
        let mut drawn = false;
        for &(a, b) in p.pairs() {
            for (zero, other) in [(a, b), (b, a)] {
                if x[other] * rounding[zero] > DRAWN {
                    x[other] = DRAWN_SHARE * DRAWN / rounding[zero];
                    drawn = true;
                }
            }
        }
        drawn
    }

    /// Newton's method on the square system at the point `active.at` with the active set in `active`, which changes until all signs are
    /// right.
    fn settle_set(&mut self, p: &mut dyn Mpcc, control: &mut Control) -> bool {
        self.ipm.settings_mut().restoration = false;
        let mut ok = false;
        for _ in 0..ROUNDS {
            self.active.bounds(&mut self.bounds);
            let mut rule = Settle::new(self.settings.polish_tol, self.policy.consistency, self.st.scaling.steepness());
            let at = std::mem::replace(&mut self.active.at, Iterate::zeros(0, 0));
            let outcome = self.run(p, Start::Warm(&at, 0.0), &mut rule, control, b'p');
            self.active.at = at;
            if outcome != Outcome::Solved && !(outcome == Outcome::Stalled && self.nearly_solved(p, 1e-9)) {
                break;
            }
            self.active.at.copy_from(self.ipm.iterate());
            self.ipm.fixed_multipliers(&mut self.active.z);
            if !self.active.update(self.ipm.constraints()) {
                ok = true;
                break;
            }
        }
        self.ipm.settings_mut().restoration = true;
        ok
    }

    /// The square system once more, at the point it was solved at, without the bounds that hold without a multiplier; true
    /// where that is a solution as well.
    pub(super) fn let_go(&mut self, p: &mut dyn Mpcc) -> bool {
        if !self.active.drop_weak() {
            return false;
        }
        self.active.bounds(&mut self.bounds);
        self.ipm.settings_mut().restoration = false;
        let mut rule = Settle::new(self.settings.polish_tol, self.policy.consistency, self.st.scaling.steepness());
        let at = std::mem::replace(&mut self.active.at, Iterate::zeros(0, 0));
        let outcome = self.run(p, Start::Warm(&at, 0.0), &mut rule, &mut Control::default(), b'p');
        self.active.at = at;
        self.ipm.settings_mut().restoration = true;
        outcome == Outcome::Solved || (outcome == Outcome::Stalled && self.nearly_solved(p, 1e-9))
    }

    /// Tries the branch `sides` from the point in `saved`.
    fn try_branch(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, control: &mut Control) -> bool {
        self.branch.copy_from(bounds);
        p.branch(&self.sides, &mut self.branch);
        let ok = self.run_branch(p, control) == Outcome::Solved;
        if ok {
            self.record_exact(p, control);
        }
        ok
    }

    /// Tries the branch `sides` with both members of the doubtful pairs zero.
    fn try_corner(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, control: &mut Control) -> bool {
        self.branch.copy_from(bounds);
        p.branch(&self.sides, &mut self.branch);
        for (k, &(a, b)) in p.pairs().iter().enumerate() {
            if doubt(&self.votes[p.group(k)]) > CLEAR {
                for j in [a, b] {
                    self.branch.xu[j] = self.branch.xl[j];
                }
            }
        }
        self.settle_saved(p, control)
    }

    /// Tries the branch `sides` from the point in `point`, multipliers afresh.
    pub(super) fn try_point(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, control: &mut Control) -> bool {
        self.near = f64::INFINITY;
        if self.run_from_point(p, bounds, 1e-3, control) == Outcome::Solved {
            return true;
        }
        let violation = self.violation(p);
        let at = self.ipm.iterate();
        if violation <= TELLING {
            self.point.copy_from_slice(&at.x);
            self.near = self.st.objective(self.ipm.objective(), &at.x);
        }
        if violation > NEAR {
            return false;
        }
        // the barrier may jam where the active rows become dependent; their square system does not mind
        let at = at.clone();
        self.active.at.copy_from(&at);
        if self.settle(p, control) {
            return true;
        }
        let saved = std::mem::replace(&mut self.saved, at);
        let outcome = self.run_branch(p, control);
        self.saved = saved;
        self.active.at.copy_from(self.ipm.iterate());
        outcome == Outcome::Solved || (self.violation(p) <= NEAR && self.settle(p, control))
    }

    /// Solves the branch `sides` from the point in `point` and the barrier parameter `mu`, multipliers afresh.
    pub(super) fn run_from_point(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        mu: f64,
        control: &mut Control,
    ) -> Outcome {
        self.branch.copy_from(bounds);
        p.branch(&self.sides, &mut self.branch);
        p.set_polishing(true);
        self.st.bounds(&self.branch, f64::INFINITY, &mut self.bounds);
        let mut rule = Branch::new(self.branch_rule(mu));
        self.ipm.settings_mut().restoration = false;
        let point = std::mem::take(&mut self.point);
        let outcome = self.run(p, Start::Cold(&point), &mut rule, control, b'p');
        self.point = point;
        self.ipm.settings_mut().restoration = true;
        outcome
    }

    pub(super) fn violation(&mut self, p: &mut dyn Mpcc) -> f64 {
        self.ipm.residuals(&Relaxed { inner: p, st: &mut self.st }).primal
    }

    /// Barrier rule of a branch problem: below 1e-10 the barrier no longer moves the solution by more than the tolerance
    /// of the polish.
    pub(super) fn branch_rule(&self, mu_init: f64) -> Monotone {
        Monotone { mu_init, tol: self.settings.tol.min(1e-9), primal_tol: self.settings.polish_tol }
    }

    /// Solves under the bounds in `branch` from the point in `saved`.
    pub(super) fn run_branch(&mut self, p: &mut dyn Mpcc, control: &mut Control) -> Outcome {
        p.set_polishing(true);
        self.st.bounds(&self.branch, f64::INFINITY, &mut self.bounds);
        let mut rule = Branch::new(self.branch_rule(1e-6));
        self.ipm.settings_mut().restoration = false;
        let saved = std::mem::replace(&mut self.saved, Iterate::zeros(0, 0));
        let outcome = self.run(p, Start::Warm(&saved, 1e-8), &mut rule, control, b'p');
        self.saved = saved;
        self.ipm.settings_mut().restoration = true;
        if outcome == Outcome::Stalled && self.nearly_solved(p, 1e-6) {
            return Outcome::Solved;
        }
        outcome
    }

    /// A problem whose last digits are lost to rounding, or to data that are not consistent, counts as solved.
    fn nearly_solved(&mut self, p: &mut dyn Mpcc, dual_tol: f64) -> bool {
        let primal_tol = self.policy.consistency.max(self.settings.polish_tol);
        let r = self.ipm.residuals(&Relaxed { inner: p, st: &mut self.st });
        r.primal <= primal_tol && r.dual <= dual_tol && r.complementarity <= 1e-8
    }
}

fn doubt(v: &(f64, f64)) -> f64 {
    v.0.min(v.1) / v.0.max(v.1).max(1e-300)
}
