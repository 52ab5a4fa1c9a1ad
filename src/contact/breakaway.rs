//! The direction in which a slide in space begins.
//!
//! A contact with normal force `λ_n`, friction `λ_t` and the local inertia `D = G M⁻¹ Gᵀ` accelerates by
//!
//! ```text
//! a_n = D_nn λ_n + D_nt λ_t + b_n = 0,    a_t = D_tn λ_n + D_tt λ_t + b_t
//! ```
//!
//! At rest friction has no velocity to be opposite to. The slide begins in the direction `e = (cos φ, sin φ)` of its own
//! acceleration: `λ_t = −μ λ_n e` and `a_t = α e` with `α ≥ 0`. The normal row gives `λ_n = −b_n / (D_nn − μ D_nt e)`, and one
//! equation `e⊥ · a_t = 0` is left for the angle (W. J. Stronge, *Impact Mechanics*, 2000, chapter 4; V. Acary,
//! B. Brogliato, *Numerical Methods for Nonsmooth Dynamical Systems*, 2008, chapter 3). Times the denominator it is a
//! trigonometric polynomial of degree two,
//!
//! ```text
//! f(φ) = e⊥ · (b_t (D_nn − μ D_nt e) − b_n (D_tn − μ D_tt e)),
//! ```
//!
//! and so a quartic of `tan φ/2`: it has four zeros at most, and all are found. Without a state that holds there is Painlevé's
//! paradox; it needs `D_nn ≤ μ ‖D_nt‖` (F. Génot, B. Brogliato, *New results on Painlevé paradoxes*, Eur. J. Mech. A/Solids 18
//! (1999)).
//!
//! The direction of the velocity obeys `σ e' = e⊥ (e⊥ · a_t)` with the speed `σ`: where `σ` is small it follows the zero of the
//! right-hand side at once, and an integrator that reads the direction from the velocity meets a stiffness `μ λ_n D/σ` without
//! bound. While tolerances do not see the part of the velocity across that zero, the direction is the zero
//! ([`Dynamics::settle_directions`], with one angle for every contact); a step is begun with the direction of the velocity as
//! soon as they nearly see it. Where the sliding breaks away from rest `α = 0`, and what it does next is decided by
//! `a_t' = α' e + α e'` with the turning `e' = ω e⊥` ([`Dynamics::turning`]).

use super::dynamics::{dot, Dynamics};
use super::problem::{Problem, Room, Solution, Solutions, State};
use super::{mode, ZERO};
use crate::func::EvalResult;
use crate::linalg::lu::Lu;

/// Multiple of what tolerances do not see of a velocity, beyond which a direction is read from it in any case: derivatives do not
/// know how a direction turns that follows the acceleration, and forget that while the velocity is small.
const FAST: f64 = 1e4;
/// Places on the circle between which there is one zero of a trigonometric polynomial of degree two, or a pair.
const PLACES: usize = 48;

/// How the motion answers when contacts that begin to slide turn.
pub(super) struct Turning {
    /// Change of the accelerations, for the turning of every one of them.
    pub(super) accelerations: Vec<Vec<f64>>,
    /// Change of the forces of what is held.
    pub(super) forces: Vec<Vec<f64>>,
    /// `e⊥ · a_t` of contact `k`, row by row, for the turning of contact `j`.
    pub(super) matrix: Vec<f64>,
}

/// The direction across.
pub(super) fn across(e: [f64; 2]) -> [f64; 2] {
    [-e[1], e[0]]
}

impl Problem {
    /// All solutions for one contact in space that does not slide yet.
    pub(super) fn solve_alone(&self, room: &mut Room) -> Solutions {
        let at_rest = [State::Rests, State::Open].into_iter();
        let states = at_rest.chain(self.slides_alone().into_iter().map(State::Slides));
        let mut found = Vec::new();
        for state in states {
            let mut trial = Solution { states: vec![state], ..Solution::default() };
            if self.with_states(&mut trial, room) && self.holds(&trial) {
                found.push((usize::from(state == State::Open), trial));
            }
        }
        self.distinct(found)
    }

    /// The directions in which the sliding acceleration may be opposite to friction.
    fn slides_alone(&self) -> Vec<[f64; 2]> {
        let (w, b, mu) = (&self.matrix, &self.free, self.parts[0].friction);
        let f = |phi: f64| {
            let e = [phi.cos(), phi.sin()];
            let less = w[0] - mu * (w[1] * e[0] + w[2] * e[1]);
            let along = |k: usize| b[k] * less - b[0] * (w[3 * k] - mu * (w[3 * k + 1] * e[0] + w[3 * k + 2] * e[1]));
            e[0] * along(2) - e[1] * along(1)
        };
        let step = std::f64::consts::TAU / PLACES as f64;
        let mut ends: Vec<f64> = (0..=PLACES).map(|k| (k as f64 - 0.5) * step).collect();
        // two zeros between places: the extremum between them has the other sign
        for k in 0..PLACES {
            let (low, high) = (ends[k] - step, ends[k] + step);
            let side = f(ends[k]).signum();
            if side * f(ends[k]) <= (side * f(low)).min(side * f(high)) {
                ends.push(extremum(|phi| side * f(phi), low, high));
            }
        }
        ends.sort_by(f64::total_cmp);
        let pairs = ends.windows(2).filter(|e| (f(e[0]) > 0.0) != (f(e[1]) > 0.0));
        pairs.map(|e| bisect(&f, e[0], e[1])).map(|phi| [phi.cos(), phi.sin()]).collect()
    }
}

/// Where a function that has one minimum between two places has it.
fn extremum(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    const SHARE: f64 = 0.381_966_011_250_105;
    for _ in 0..40 {
        let (a, b) = (low + SHARE * (high - low), high - SHARE * (high - low));
        if f(a) < f(b) {
            high = b;
        } else {
            low = a;
        }
    }
    0.5 * (low + high)
}

/// A zero between two places of different sign.
fn bisect(f: &impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let positive = f(low) > 0.0;
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if (f(middle) > 0.0) == positive {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

impl Dynamics {
    /// Has a contact under a sliding mode no velocity yet that its direction could be read from?
    pub(super) fn has_no_direction(&self, i: usize) -> bool {
        let s = self.blocks[i].sliding;
        let size = s[0].hypot(s[1]);
        size <= self.stop(i) || size == 0.0 || self.carried[i] || self.follows(i)
    }

    /// Does a contact under a sliding mode go where it accelerates to?
    pub(super) fn follows(&self, i: usize) -> bool {
        self.begins[i] > 0.0 && self.across_direction(i) <= self.begins[i] && self.speed(i) <= FAST * self.begins[i]
    }

    /// Has a contact that begins to slide, at the end of a step, a velocity that the next step may read its direction from?
    /// Within a step the direction does not change its meaning.
    pub(super) fn has_begun(&self, i: usize) -> bool {
        /// Share of the limits within a step.
        const NEARLY: f64 = 0.1;
        let least = NEARLY * self.begins[i];
        self.across_direction(i) > least || self.speed(i) > FAST * least || self.slows_down(i)
    }

    fn speed(&self, i: usize) -> f64 {
        let s = self.blocks[i].sliding;
        s[0].hypot(s[1])
    }

    /// The part of the sliding velocity that does not go along the direction of the acceleration.
    pub(super) fn across_direction(&self, i: usize) -> f64 {
        let (e, s) = (self.settled[i], self.blocks[i].sliding);
        if e[0] * s[0] + e[1] * s[1] < 0.0 {
            return s[0].hypot(s[1]);
        }
        (e[0] * s[1] - e[1] * s[0]).abs()
    }

    /// Does a contact that begins to slide go along its velocity, as it loses it?
    pub(super) fn slows_down(&self, i: usize) -> bool {
        let (e, a, b) = (self.settled[i], self.sliding_rates(i), &self.blocks[i]);
        let size =
            b.sliding_rest.iter().map(|r| r.abs()).sum::<f64>() + (0..2).map(|k| self.size_along(i, k)).sum::<f64>();
        e[0] * a[0] + e[1] * a[1] < -ZERO * size && b.sliding[0].hypot(b.sliding[1]) > 0.0
    }

    /// Tangential acceleration of a contact under the last accelerations.
    fn sliding_rates(&self, i: usize) -> [f64; 2] {
        let b = &self.blocks[i];
        [0, 1].map(|k| dot(b.tangent(k), &self.acceleration) + b.sliding_rest[k])
    }

    /// What changes when the directions of these contacts turn by one radian each, under the last accelerations.
    pub(super) fn turning(&mut self, contacts: &[usize]) -> Turning {
        let (n_v, n) = (self.mechanics.n_v, contacts.len());
        let mut out =
            Turning { accelerations: Vec::with_capacity(n), forces: Vec::with_capacity(n), matrix: vec![0.0; n * n] };
        for (j, &i) in contacts.iter().enumerate() {
            let (b, side) = (&self.blocks[i], across(self.settled[i]));
            let push = -b.friction * self.forces[i][0];
            let pushed = (0..n_v).map(|r| push * (side[0] * b.tangent(0)[r] + side[1] * b.tangent(1)[r]));
            let mut a: Vec<f64> = pushed.collect();
            self.mass.solve(&mut a);
            let held = self.rows.iter().map(|r| -dot(self.blocks[r.contact].row(r.component), &a));
            let mut held: Vec<f64> = held.collect();
            if !held.is_empty() {
                self.held.solve(&mut held);
            }
            for (l, y) in held.iter().zip(self.y.chunks_exact(n_v)) {
                a.iter_mut().zip(y).for_each(|(a, y)| *a += l * y);
            }
            for (k, &other) in contacts.iter().enumerate() {
                let (b, side) = (&self.blocks[other], across(self.settled[other]));
                out.matrix[k * n + j] = side[0] * dot(b.tangent(0), &a) + side[1] * dot(b.tangent(1), &a);
            }
            out.accelerations.push(a);
            out.forces.push(held);
        }
        out
    }

    /// Contacts in space that begin to slide turn to where they accelerate to, as far as tolerances do not see the velocity across.
    /// The forces of what is held are known, and are so again.
    pub(super) fn settle_directions(&mut self, modes: &[Vec<usize>]) -> EvalResult {
        if self.begins.iter().all(|b| *b == 0.0) {
            return Ok(());
        }
        let begins =
            |i: &usize| self.begins[*i] > 0.0 && modes[*i][0] == mode::SLIDES && !self.carried[*i] && self.follows(*i);
        let mut all: Vec<usize> = (0..modes.len()).filter(begins).collect();
        while !all.is_empty() {
            self.turn_to_accelerations(&all, modes)?;
            // the velocity has a direction of its own; and what slows down goes where it goes, however small it is
            let own = all.iter().position(|&i| !self.follows(i) || self.slows_down(i));
            let Some(k) = own else { break };
            let i = all.remove(k);
            let s = self.blocks[i].sliding;
            let size = s[0].hypot(s[1]);
            self.settled[i] = [s[0] / size, s[1] / size];
            self.assemble(modes)?;
            self.solve_held();
        }
        Ok(())
    }

    /// Newton's method for the directions of these contacts: `e⊥ · a_t = 0`.
    fn turn_to_accelerations(&mut self, all: &[usize], modes: &[Vec<usize>]) -> EvalResult {
        /// Newton steps at most, and an angle that is rounding.
        const STEPS: usize = 12;
        const ROUNDING: f64 = 1e-14;
        /// Largest step.
        const MOST: f64 = 0.5;
        let n = all.len();
        let mut last = f64::INFINITY;
        for _ in 0..STEPS {
            let turning = self.turning(all);
            let mut solver = Lu::with_capacity(n);
            solver.clear(n).copy_from_slice(&turning.matrix);
            let mut angles = Vec::with_capacity(n);
            for (k, &i) in all.iter().enumerate() {
                let (e, a) = (self.settled[i], self.sliding_rates(i));
                let side = across(e);
                solver.matrix()[k * n + k] -= (e[0] * a[0] + e[1] * a[1]).max(0.0);
                angles.push(-(side[0] * a[0] + side[1] * a[1]));
            }
            if !solver.factorise() {
                return Ok(());
            }
            solver.solve(&mut angles);
            let size = angles.iter().fold(0.0f64, |m, w| m.max(w.abs()));
            if size >= last || angles.iter().any(|w| !w.is_finite()) {
                return Ok(());
            }
            last = size;
            let share = (MOST / size).min(1.0);
            for (&i, w) in all.iter().zip(&angles) {
                let (sin, cos) = (share * w).sin_cos();
                let e = self.settled[i];
                self.settled[i] = [cos * e[0] - sin * e[1], sin * e[0] + cos * e[1]];
            }
            self.assemble(modes)?;
            self.solve_held();
            if size <= ROUNDING {
                return Ok(());
            }
        }
        Ok(())
    }

    /// What the sliding acceleration along tangent `k` consists of before anything cancels.
    fn size_along(&self, i: usize, k: usize) -> f64 {
        let terms = self.free.iter().zip(&self.acceleration).map(|(f, a)| f.abs().max(a.abs()));
        self.blocks[i].tangent(k).iter().zip(terms).map(|(t, a)| t.abs() * a).sum()
    }

    /// How fast contacts in space that begin to slide turn, from the rates `jerks` of their sliding accelerations without
    /// turning: `e⊥ · a_t' = 2 α ω`, since the velocity is `s = α e ε + a_t' ε²/2`.
    pub(super) fn turning_rates(&mut self, contacts: &[usize], jerks: &[[f64; 2]]) -> Option<(Turning, Vec<f64>)> {
        let n = contacts.len();
        let turning = self.turning(contacts);
        let mut solver = Lu::with_capacity(n);
        solver.clear(n).copy_from_slice(&turning.matrix);
        let mut rates = Vec::with_capacity(n);
        for (k, (&i, jerk)) in contacts.iter().zip(jerks).enumerate() {
            let (e, a) = (self.settled[i], self.sliding_rates(i));
            let side = across(e);
            solver.matrix()[k * n + k] -= 2.0 * (e[0] * a[0] + e[1] * a[1]).max(0.0);
            rates.push(-(side[0] * jerk[0] + side[1] * jerk[1]));
        }
        if !solver.factorise() {
            return None;
        }
        solver.solve(&mut rates);
        rates.iter().all(|r| r.is_finite()).then_some((turning, rates))
    }
}
