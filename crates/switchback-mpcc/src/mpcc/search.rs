//! From one active set to others: to better ones from a solution, to any from a point that belongs to none.
//!
//! Which sets are next to one another is for the caller to say ([`ActiveSetProposer`]); here is decided where to go on.

use std::time::Instant;

use super::endgame::NEAR;
use super::homotopy::Branch;
use super::problem::{Mpcc, Side};
use super::proposer::{ActiveSetProposer, ProposalKind};
use super::solver::{MpccSolver, Solution};
use crate::nlp::{Bounds, Control, Outcome, Start, Statistics};
use crate::stop;

/// Improvements accepted at most.
const MAX_IMPROVEMENTS: usize = 10;
/// Branches tried where none near the identified one has a solution, and how many of them next to one point.
const MAX_RESCUES: usize = 40;
const RESCUES_OF_A_POINT: usize = 12;
/// Share of the objective by which such a solution may be worse than the relaxation: before others are tried, and at all.
const GOOD_ENOUGH: f64 = 0.01;
const ACCEPTABLE: f64 = 0.25;
/// Sets with parts that vanish, one after the other.
const MAX_COLLAPSES: usize = 3;

/// Barrier parameter, and distance from bounds, where a branch starts at all but its solution.
const CLOSE: f64 = 1e-6;
/// Iterations of a branch that is given, from a point that may be far from its solution.
const MAX_ITERATIONS: usize = 150;

/// How far a point is from the solution of its branch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Distance {
    /// The rows hold nearly, and no direction leads down: only the multipliers are missing.
    Close,
    /// A few iterations away, or not worth more.
    Near,
    /// Not known.
    Far,
}

impl MpccSolver {
    /// Solves the branch `sides` from `x0[n]`, at this distance from its solution, and goes on to better ones; true when
    /// it has a solution, which is then the result.
    pub fn solve_sides(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        sides: &[Side],
        (x0, distance): (&[f64], Distance),
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) -> bool {
        let clock = Instant::now();
        self.enter(p, bounds, sides, x0);
        let mut ok = distance == Distance::Close && self.try_close(p, bounds, control);
        ok = ok || self.try_point(p, bounds, control);
        if !ok && distance != Distance::Near {
            ok = self.collapse_from_near(p, bounds, control, proposer);
            if !ok && stop::requested().is_none() {
                self.sides.copy_from_slice(sides);
                self.st.start(x0, &mut self.point);
                ok = self.try_far(p, bounds, control);
            }
        }
        self.leave(p, bounds, ok, control, proposer);
        self.solution.stats.time_total = clock.elapsed().as_secs_f64();
        ok
    }

    /// A solve of the branch `sides` begins at `x0`; there is no solution yet that another one could be compared with.
    fn enter(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, sides: &[Side], x0: &[f64]) {
        self.begin_exact(p);
        self.scale(p, bounds, x0);
        self.st.start(x0, &mut self.point);
        self.sides.copy_from_slice(sides);
        self.solution.objective = f64::INFINITY;
    }

    /// It ends: the solution, where there is one, becomes the result, and better ones are looked for.
    fn leave(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        ok: bool,
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) {
        self.close = true;
        if ok {
            self.record_exact(p, control);
            self.improve(p, bounds, control, proposer);
            self.judge(p, bounds, control);
        }
        self.close = false;
        p.set_polishing(false);
    }

    /// Tries the branch `sides` from the point in `point`, which is all but its solution: a barrier that is not small, and a start well
    /// inside of the bounds, would lead away to another one.
    fn try_close(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, control: &mut Control) -> bool {
        self.close(|s, mu| s.run_from_point(p, bounds, mu, control)) == Outcome::Solved
    }

    /// Does what begins next to its solution: with this barrier parameter, and as close to bounds as its start is.
    pub(super) fn close<R>(&mut self, body: impl FnOnce(&mut Self, f64) -> R) -> R {
        let push = std::mem::replace(&mut self.ipm.settings_mut().bound_push, CLOSE);
        let found = body(self, CLOSE);
        self.ipm.settings_mut().bound_push = push;
        found
    }

    /// Tries the branch `sides` from the point in `point`, which may be far from its solution.
    pub(super) fn try_far(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, control: &mut Control) -> bool {
        self.branch.copy_from(bounds);
        p.branch(&self.sides, &mut self.branch);
        p.set_polishing(true);
        self.st.bounds(&self.branch, f64::INFINITY, &mut self.bounds);
        let mut rule = Branch::far(self.branch_rule(self.settings.mu_init));
        let usual = std::mem::replace(&mut self.branch_iterations, MAX_ITERATIONS);
        let point = std::mem::take(&mut self.point);
        let outcome = self.run(p, Start::Cold(&point), &mut rule, control, b'p');
        self.point = point;
        self.branch_iterations = usual;
        if outcome == Outcome::Solved || self.violation(p) > NEAR {
            return outcome == Outcome::Solved;
        }
        self.active.at.copy_from(self.ipm.iterate());
        self.settle(p, control)
    }

    /// Solves the branch problem of `near`, the solution of another discretisation: its active set from `x0[n]`, its point in
    /// the variables of this problem, without multipliers. Where there is no solution, as [`MpccSolver::rescue`]. True when
    /// one is found.
    pub fn solve_near(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        near: &Solution,
        x0: &[f64],
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) -> bool {
        let clock = Instant::now();
        self.enter(p, bounds, &near.sides, x0);
        self.close = true;
        let ok = self.try_point(p, bounds, control) || self.go_on_from_near(p, bounds, control, proposer);
        self.leave(p, bounds, ok, control, proposer);
        self.solution.stats.time_total = clock.elapsed().as_secs_f64();
        if ok {
            return true;
        }
        self.st.start(x0, &mut self.saved.x);
        self.solution.objective = near.objective;
        self.rescue(p, bounds, control, proposer)
    }

    /// Adds what was spent before to the cost of the last solve.
    pub fn add_cost(&mut self, cost: &Statistics) {
        self.solution.stats.add(cost);
    }

    /// Looks for the best active set further away where none like the identified one has a solution; true when there is
    /// one. Starts at the point the relaxation reached, and goes on from the best of the points where branches get stuck.
    pub fn rescue(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) -> bool {
        let clock = Instant::now();
        self.close = true;
        self.identify(p);
        let before = self.solution.clone();
        let relaxed = before.objective;
        let above = |share: f64| relaxed + share * (1.0 + relaxed.abs());
        let mut best = f64::INFINITY;
        let mut stuck = vec![(relaxed, self.saved.x.clone(), self.sides.clone())];
        let mut left = MAX_RESCUES;
        while let Some(node) =
            (0..stuck.len()).filter(|_| stop::requested().is_none()).min_by(|&a, &b| stuck[a].0.total_cmp(&stuck[b].0))
        {
            let (_, point, sides) = stuck.swap_remove(node);
            for k in 0..RESCUES_OF_A_POINT.min(left) {
                if stop::requested().is_some() {
                    break;
                }
                self.sides.copy_from_slice(&sides);
                self.point.copy_from_slice(&point);
                if !self.ask_near(ProposalKind::Rescue(k), p, proposer) {
                    break;
                }
                left -= 1;
                if !self.try_point(p, bounds, control) {
                    if self.near < f64::INFINITY {
                        stuck.push((self.near, self.point.clone(), self.sides.clone()));
                    }
                } else if best == f64::INFINITY || self.is_better(best) {
                    self.record_exact(p, control);
                    best = self.solution.objective;
                    if best <= above(GOOD_ENOUGH) {
                        break;
                    }
                }
            }
            if best <= above(ACCEPTABLE) || left == 0 {
                break;
            }
        }
        let ok = best <= above(ACCEPTABLE);
        if ok {
            self.improve(p, bounds, control, proposer);
            self.judge(p, bounds, control);
        } else {
            let stats = self.solution.stats;
            self.solution = Solution { stats, ..before };
        }
        self.close = false;
        p.set_polishing(false);
        self.solution.stats.time_total += clock.elapsed().as_secs_f64();
        ok
    }

    /// Moves to neighbouring active sets as long as the objective falls. The result stays the best point.
    pub(super) fn improve(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) {
        for _ in 0..MAX_IMPROVEMENTS {
            let best = self.solution.objective;
            let mut better = false;
            for k in 0.. {
                self.sides.copy_from_slice(&self.solution.sides);
                let x = std::mem::take(&mut self.solution.x);
                let more = proposer.propose(ProposalKind::Improve(k), &x, &mut self.sides);
                let ok = more
                    && (self.try_neighbour(p, bounds, &x, control)
                        || self.go_on_from_near(p, bounds, control, proposer));
                self.solution.x = x;
                if ok && self.is_better(best) {
                    self.record_exact(p, control);
                    better = true;
                    break;
                }
                if !more || stop::requested().is_some() {
                    break;
                }
            }
            if !better {
                return;
            }
        }
    }

    /// The neighbour just tried has no solution although its points are better than the best one: what vanishes there is
    /// left out, and switches that end up between control stages are moved off them.
    fn go_on_from_near(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) -> bool {
        if self.collapse_from_near(p, bounds, control, proposer) {
            return true;
        }
        if stop::requested().is_some() {
            return false;
        }
        if self.near >= self.solution.objective {
            return false;
        }
        let (point, sides) = (self.point.clone(), self.sides.clone());
        for k in 0.. {
            self.point.copy_from_slice(&point);
            self.sides.copy_from_slice(&sides);
            if !self.ask_near(ProposalKind::Repair(k), p, proposer) {
                break;
            }
            if self.try_point(p, bounds, control) {
                return true;
            }
            if stop::requested().is_some() {
                break;
            }
        }
        false
    }

    /// The branch just tried has no solution although its points are better than the best one: what vanishes there is left out. True
    /// where that has a solution.
    fn collapse_from_near(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) -> bool {
        for _ in 0..MAX_COLLAPSES {
            let known = self.near < self.solution.objective;
            if !known || stop::requested().is_some() || !self.ask_near(ProposalKind::Collapse, p, proposer) {
                break;
            }
            if self.try_point(p, bounds, control) {
                return true;
            }
        }
        false
    }

    /// Another active set for the point a branch got stuck at, which is made a point of that set; false without one.
    fn ask_near(&mut self, kind: ProposalKind, p: &mut dyn Mpcc, proposer: &mut dyn ActiveSetProposer) -> bool {
        self.st.scaling.grow(&self.point, &mut self.room);
        let mut sides = self.sides.clone();
        let found = proposer.propose(kind, &self.room, &mut sides);
        if found {
            p.enter_branch(&self.sides, &sides, &mut self.room);
            self.st.scaling.shrink(&self.room, &mut self.point[..self.st.n]);
            self.sides = sides;
        }
        found
    }

    /// Tries the branch `sides` from the point `x` of another one: multipliers start afresh, and what may now be
    /// positive starts inside.
    fn try_neighbour(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, x: &[f64], control: &mut Control) -> bool {
        self.room.copy_from_slice(x);
        p.enter_branch(&self.solution.sides, &self.sides, &mut self.room);
        self.st.start(&self.room, &mut self.point);
        self.try_point(p, bounds, control)
    }

    /// Is the point just reached better than one with this objective?
    pub(super) fn is_better(&self, best: f64) -> bool {
        self.st.objective(self.ipm.objective(), &self.ipm.iterate().x)
            < best - 1e-9 * (self.st.scaling.one() + best.abs())
    }
}
