//! Sliding of higher order: the set that accumulating switches lead to, and the motion in it.
//!
//! Where the rate of an indicator does not depend on the modes, `C D = 0` in its row, (6.17) says nothing about the weights,
//! and solutions reach its surface only through infinitely many switches: twisting and super-twisting algorithms, a relay
//! behind an actuator. The set they lead to is that of sliding of order two, where the indicator difference `c` and its
//! derivative `φ = C b + c_t` are zero, and the weights keep it there by the next derivative,
//!
//! ```text
//! φ_x (b + D α) + φ_t = 0
//! ```
//!
//! (A. Levant, *Sliding order and sliding accuracy in sliding mode control*, Int. J. Control 58 (1993) 1247-1263). The
//! velocity follows from that where the weights are not unique either, as where two relays act on one state: of all weights
//! those nearest to equal ones are taken. The derivatives of `φ` are central differences along `D` and along `b`, for model
//! functions may have no derivatives on their surfaces (`sqrt |x|` of the super-twisting algorithm); everything is
//! evaluated at the point of the surfaces next to the state for the same reason.

use super::{Field, Pair};
use crate::func::{EvalError, EvalResult};

/// A row that is a combination of others up to this part of its size adds nothing: what central differences leave.
const DEPENDENT: f64 = 1e-6;
/// The right-hand side of such a row may differ from that combination by this part of the size of its terms.
const CONSISTENT: f64 = 1e-4;
/// Change of a constraint by modes, relative to the change of the states by them, that is no change: where it vanishes like the root
/// of the distance to the surface, rounding of the state leaves its square root.
const NO_CHANGE: f64 = 1e-6;
/// Steps of the central differences of order four: the part of its size that the fastest state moves by. What is left of order four is
/// then of the size of what rounding leaves, where states are as large as what functions change with; those at rest in the set are
/// smaller by far, and rounding decides.
const DIFFERENCE: f64 = 1e-3;
const BESIDE: [f64; 4] = [1.0, -1.0, 2.0, -2.0];

/// What is known of a limit set, with its memory.
#[derive(Default)]
pub(in crate::event) struct Limit {
    /// Constraints whose rate does not depend on the modes, by pair.
    second: Vec<bool>,
    /// Those of them whose rate vanishes wherever the other constraints hold, as that of `e` in an observer where the difference of
    /// the velocities is a surface, too: they ask for nothing more.
    held: Vec<bool>,
    /// The place of the weight of every pair among all weights, and the weights of every subsystem that slides.
    place: Vec<usize>,
    groups: Vec<std::ops::Range<usize>>,
    /// Equal weights of the cells of a subsystem, by pair.
    equal: Vec<f64>,
    /// Conditions for the weights, orthonormal, and their right-hand sides.
    rows: Vec<Vec<f64>>,
    rhs: Vec<f64>,
    /// The conditions as they are: one row of coefficients of the weights of the pairs for every pair, and right-hand sides.
    raw: Vec<Vec<f64>>,
    raw_rhs: Vec<f64>,
    /// What the right-hand side of a condition without coefficients may be, and reciprocal of the shortest time in which modes move
    /// a state by its size.
    slack: Vec<f64>,
    pace: f64,
    /// Derivatives `φ` at the last point.
    phi: Vec<f64>,
    weights: Vec<f64>,
    /// The point of the surfaces, and one beside it.
    y: Vec<f64>,
    beside: Vec<f64>,
    base: Vec<f64>,
    d: Vec<f64>,
    c: Vec<f64>,
}

impl Limit {
    /// The weights of all active cells of subsystems that slide.
    fn lay_out(&mut self, pairs: &[Pair], first: &[usize]) {
        self.place.clear();
        self.groups.clear();
        self.equal.clear();
        let mut n = 0;
        for w in first.windows(2).filter(|w| w[1] > w[0]) {
            // the base has the first place
            self.groups.push(n..n + 1 + w[1] - w[0]);
            self.place.extend(n + 1..n + 1 + w[1] - w[0]);
            self.equal.resize(w[1], 1.0 / (1 + w[1] - w[0]) as f64);
            n += 1 + w[1] - w[0];
        }
        let r = pairs.len();
        self.weights.resize(n, 0.0);
        self.raw.resize(r, Vec::new());
        self.raw.iter_mut().for_each(|row| row.resize(r, 0.0));
        self.raw_rhs.resize(r, 0.0);
        self.slack.resize(r, 0.0);
        self.phi.resize(r, 0.0);
        self.rows.resize(r + self.groups.len(), Vec::new());
        self.rows.iter_mut().for_each(|row| row.resize(n, 0.0));
        self.rhs.resize(r + self.groups.len(), 0.0);
    }

    /// Keeps what belongs to the point that derivatives are taken at.
    fn keep(&mut self, base: &[f64], d: &[f64], c: &[f64]) {
        for (to, from) in [(&mut self.base, base), (&mut self.d, d), (&mut self.c, c)] {
            to.clear();
            to.extend_from_slice(from);
        }
    }

    /// Conditions of order two may be off by what is no change in rates of the size `rate`.
    fn set_slack(&mut self, rate: f64) {
        for (slack, second) in self.slack.iter_mut().zip(&self.second) {
            *slack = if *second { NO_CHANGE * rate } else { 0.0 };
        }
    }

    /// Solves the conditions with the right-hand sides `raw_rhs` for weights next to `around` with the sum `sum` in every
    /// subsystem; false where they contradict each other. Rows are made orthonormal one after the other.
    fn solve(&mut self, around: impl Fn(usize) -> f64, sum: f64) -> bool {
        let (n, r) = (self.weights.len(), self.raw.len());
        for (g, group) in self.groups.iter().enumerate() {
            self.weights[group.clone()].fill(around(group.len()));
            let row = &mut self.rows[g];
            row.fill(0.0);
            row[group.clone()].fill(1.0);
            self.rhs[g] = sum;
        }
        let g = self.groups.len();
        for i in 0..r {
            let row = &mut self.rows[g + i];
            row.fill(0.0);
            self.raw[i].iter().zip(&self.place).for_each(|(v, &at)| row[at] = *v);
            self.rhs[g + i] = self.raw_rhs[i];
        }
        let mut consistent = true;
        for i in 0..g + r {
            let (done, rest) = self.rows.split_at_mut(i);
            let row = &mut rest[0];
            let norm = |v: &[f64]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
            let before = norm(row);
            let mut terms = self.rhs[i].abs();
            for (other, rhs) in done.iter().zip(&self.rhs.clone()) {
                let along: f64 = row.iter().zip(other).map(|(a, b)| a * b).sum();
                row.iter_mut().zip(other).for_each(|(a, b)| *a -= along * b);
                self.rhs[i] -= along * rhs;
                terms = terms.max((along * rhs).abs());
            }
            let after = norm(row);
            if after <= DEPENDENT * before || after == 0.0 {
                let slack = if i < g { 0.0 } else { self.slack[i - g] };
                consistent &= self.rhs[i].abs() <= slack.max(CONSISTENT * terms.max(before));
                row.fill(0.0);
                self.rhs[i] = 0.0;
                continue;
            }
            row.iter_mut().for_each(|v| *v /= after);
            self.rhs[i] /= after;
            let missing = self.rhs[i] - row.iter().zip(&self.weights).map(|(a, b)| a * b).sum::<f64>();
            for j in 0..n {
                self.weights[j] += missing * row[j];
            }
        }
        consistent && self.weights.iter().all(|v| v.is_finite())
    }
}

impl Field {
    /// Is the present mode the motion in a limit set?
    pub(in crate::event) fn in_limit_set(&self) -> bool {
        self.limit.is_some()
    }

    /// Has a subsystem a part in the limit set: does it slide together with a constraint of order two?
    pub(in crate::event) fn in_limit(&self, sub: usize) -> bool {
        let Some(limit) = &self.limit else { return false };
        let second = |i: &usize| limit.second.get(*i).copied().unwrap_or(false);
        let own = self.first_pair[sub]..self.first_pair[sub + 1];
        own.into_iter().any(|i| (0..self.pairs.len()).filter(second).any(|j| self.sliding.touch(i, j)))
    }

    /// Is function `j` among those that a constraint of order two of the limit set ties?
    pub(in crate::event) fn is_of_order_two(&self, j: usize) -> bool {
        let Some(limit) = &self.limit else { return false };
        let ties = |p: &Pair| {
            let s = &self.subs[p.sub];
            let w = |cell: usize| s.cells[cell - s.first].weights.get(j.wrapping_sub(s.q0)).copied();
            w(p.cell) != w(p.base)
        };
        self.pairs.iter().zip(&limit.second).any(|(p, second)| *second && ties(p))
    }

    /// Those cells of `sets` where functions have these signs, 0 for any; one of those with the same mode.
    pub(in crate::event) fn restrict(&self, sets: &[Vec<usize>], signs: &[(usize, f64)]) -> Vec<Vec<usize>> {
        let each = self.subs.iter().zip(sets).map(|(s, set)| {
            let own = |e: &&(usize, f64)| s.signs && (s.q0..s.q0 + s.n_q).contains(&e.0);
            let cell = |c: usize| &s.cells[c - s.first];
            let fits = |c: &usize| signs.iter().filter(own).all(|(j, sign)| cell(*c).weights[j - s.q0] * sign <= 0.0);
            let mut some: Vec<usize> = set.iter().copied().filter(fits).collect();
            if some.iter().all(|c| cell(*c).mode == cell(some[0]).mode) {
                some.truncate(1);
            }
            some
        });
        each.collect()
    }

    /// Makes the present mode the motion in its limit set, if the rates of some of its constraints do not depend on the
    /// modes at this point; says whether that is so. Constraints are scaled there.
    pub(in crate::event) fn begin_limit_set(&mut self, t: f64, x: &[f64]) -> Result<bool, EvalError> {
        let mut limit = Box::<Limit>::default();
        limit.y.extend_from_slice(x);
        self.gradients(t, x)?;
        self.constraint_rows();
        self.settle(t, &mut limit.y)?;
        self.parts(t, &limit.y)?;
        self.gradients(t, &limit.y)?;
        self.constraint_rows();
        let r = self.pairs.len();
        // changes relative to sizes, by the modes of every pair
        let paces: Vec<f64> = (0..r).map(|j| self.column_pace(j, x)).collect();
        // other modes do not move what a constraint depends on
        let coupled = |i: usize| self.sliding.dependencies(self.pairs[i].sub).flat_map(|k| self.pairs_of(k));
        let second = |i: usize| coupled(i).all(|j| self.raw_rate(i, j).abs() <= NO_CHANGE * paces[j]);
        limit.second.extend((0..r).map(second));
        let any = limit.second.contains(&true);
        if any {
            limit.lay_out(&self.pairs, &self.first_pair);
            limit.pace = paces.iter().fold(0.0, |m, p| m.max(*p));
            self.find_held(t, x, &mut limit)?;
            self.limit = Some(limit);
        }
        Ok(any)
    }

    /// Finds the constraints of order two that others hold: moving along the modes or with time changes their rates, and no longer once
    /// the point is put back onto the surfaces.
    fn find_held(&mut self, t: f64, x: &[f64], l: &mut Limit) -> EvalResult {
        let r = self.pairs.len();
        let mut phi = vec![0.0; r];
        self.rates_beside(t, &mut l.y, (&l.second, &l.equal), &mut phi, true)?;
        l.keep(&self.base, &self.sliding.d, &self.sliding.c);
        let [mut free, mut on] = [vec![0.0f64; r], vec![0.0f64; r]];
        for j in 0..r + 1 {
            for (settled, sizes) in [(false, &mut free), (true, &mut on)] {
                match self.changes_of_rates((t, x), l, j, settled) {
                    Ok(Some(changes)) => sizes.iter_mut().zip(changes).for_each(|(s, c)| *s = s.max(c.abs())),
                    Ok(None) => {}
                    // what is not defined off the surfaces says nothing, and what is not defined on them holds nothing
                    Err(EvalError::Recoverable) if settled => sizes.fill(f64::INFINITY),
                    Err(EvalError::Recoverable) => {}
                    Err(e) => return Err(e),
                }
            }
        }
        l.held = (0..r).map(|i| l.second[i] && on[i] <= NO_CHANGE * free[i]).collect();
        Ok(())
    }

    /// Derivatives of the rates of all constraints along column `j` of `D`, or behind the last one along `b` with time, of points
    /// that are put back onto the surfaces or not; none where nothing moves.
    fn changes_of_rates(
        &mut self,
        (t, x): (f64, &[f64]),
        l: &mut Limit,
        j: usize,
        settled: bool,
    ) -> Result<Option<Vec<f64>>, EvalError> {
        let r = self.pairs.len();
        let pace = if j < r { self.column_pace(j, x) } else { self.pace(x, &self.base) };
        if pace == 0.0 {
            return Ok(None);
        }
        let h = DIFFERENCE / pace;
        let mut ends = [const { Vec::new() }; 4];
        for (by, end) in BESIDE.into_iter().zip(&mut ends) {
            end.resize(r, 0.0);
            let by = by * h;
            let mut beside = std::mem::take(&mut l.beside);
            beside.clone_from(&l.y);
            let rules = (&l.second[..], &l.equal[..]);
            let known = if j < r {
                self.d(j).for_each(|(i, d)| beside[i] += by * d);
                self.rates_beside(t, &mut beside, rules, end, settled)
            } else {
                beside.iter_mut().zip(&self.base).for_each(|(y, b)| *y += by * b);
                self.rates_beside(t + by, &mut beside, rules, end, settled)
            };
            l.beside = beside;
            self.base.clone_from(&l.base);
            self.sliding.d.clone_from(&l.d);
            self.sliding.c.clone_from(&l.c);
            known?;
        }
        let along = |i: usize| (8.0 * (ends[0][i] - ends[1][i]) - (ends[2][i] - ends[3][i])) / (12.0 * h);
        Ok(Some((0..r).map(along).collect()))
    }

    /// Have the modes nearly no influence on the rate of one of the surfaces they slide on? The right-hand side is that of this point.
    pub(in crate::event) fn has_lost_influence(&mut self, t: f64, x: &[f64]) -> Result<bool, EvalError> {
        /// Change of a constraint by modes relative to the change of the states by them.
        const LITTLE: f64 = 1e-3;
        self.gradients(t, x)?;
        self.constraint_rows();
        let r = self.pairs.len();
        let little = |i: usize| (0..r).all(|j| self.raw_rate(i, j).abs() <= LITTLE * self.column_pace(j, x));
        Ok((0..r).any(little))
    }

    /// Reciprocal of the time in which the modes of pair `j` move a state by its size.
    fn column_pace(&self, j: usize, x: &[f64]) -> f64 {
        let each = self.d(j).map(|(i, d)| (d.abs(), self.size(i, x[i])));
        each.filter(|e| e.1 > 0.0).fold(0.0, |m, (d, size)| m.max(d / size))
    }

    /// Rate of constraint `i` by column `j` of `D`.
    fn raw_rate(&self, i: usize, j: usize) -> f64 {
        let mut sum = 0.0;
        if !self.sliding.dependencies(self.pairs[i].sub).any(|k| k == self.pairs[j].sub) {
            return sum;
        }
        for (row, d) in self.d(j) {
            sum += self.sliding.row_of_states(self.pairs[i], i).find(|c| c.0 == row).map_or(0.0, |c| c.1 * d);
        }
        sum
    }

    /// Rates of constraint `i` by the columns of `D`.
    fn raw_row(&self, i: usize) -> Vec<f64> {
        (0..self.pairs.len()).map(|j| self.raw_rate(i, j)).collect()
    }

    /// Moves a point onto all surfaces, every state in proportion to its size.
    fn settle(&mut self, t: f64, y: &mut [f64]) -> EvalResult {
        for _ in 0..4 {
            self.indicators(t, y)?;
            let mut worst = 0.0f64;
            for i in 0..self.pairs.len() {
                let value = self.constraint(i);
                worst = worst.max(value.abs());
                if value.abs() <= f64::EPSILON {
                    // constraints that are combinations of others hold with them
                    continue;
                }
                let row = || self.sliding.row_of_states(self.pairs[i], i);
                let square = |i: usize| Some(self.size(i, y[i])).filter(|s| *s > 0.0).map_or(1.0, |s| s * s);
                let total: f64 = row().map(|(i, g)| g * g * square(i)).sum();
                if total > 0.0 {
                    let moves: Vec<(usize, f64)> = row().map(|(i, g)| (i, value / total * g * square(i))).collect();
                    moves.into_iter().for_each(|(i, by)| y[i] -= by);
                    // constraints that share states see where the others have moved them
                    self.indicators(t, y)?;
                }
            }
            if worst <= f64::EPSILON {
                break;
            }
        }
        // what is zero but for rounding is zero: functions may not be defined on its other side
        for i in 0..self.pairs.len() {
            for (i, _) in self.sliding.row_of_states(self.pairs[i], i) {
                if y[i].abs() <= 4.0 * f64::EPSILON * self.floor[i] {
                    y[i] = 0.0;
                }
            }
        }
        Ok(())
    }

    /// Rates of the constraints at the point of the surfaces next to `x`: under `b`, those of order two under equal weights, which
    /// is the same on the surfaces, and better where modes differ by the root of what rounding leaves of the distance to them.
    fn rates_beside(
        &mut self,
        t: f64,
        x: &mut [f64],
        (second, equal): (&[bool], &[f64]),
        out: &mut [f64],
        settled: bool,
    ) -> EvalResult {
        if settled {
            self.settle(t, x)?;
        }
        self.parts(t, x)?;
        self.gradients(t, x)?;
        self.constraint_rows();
        for (i, o) in out.iter_mut().enumerate() {
            *o = self.sliding.rate(self.pairs[i], i, &self.base);
            if second[i] {
                *o += self.raw_row(i).iter().zip(equal).map(|(v, w)| v * w).sum::<f64>();
            }
        }
        Ok(())
    }

    /// Weights of the motion in a limit set.
    pub(super) fn hidden_limit(&mut self, t: f64, x: &[f64]) -> EvalResult {
        let Some(mut limit) = self.limit.take() else { return Ok(()) };
        let r = self.hidden_limit_inner(t, x, &mut limit);
        self.limit = Some(limit);
        r
    }

    fn hidden_limit_inner(&mut self, t: f64, x: &[f64], l: &mut Limit) -> EvalResult {
        let r = self.pairs.len();
        let (mut y, mut phi) = (std::mem::take(&mut l.y), std::mem::take(&mut l.phi));
        y.clear();
        y.extend_from_slice(x);
        let known = self.rates_beside(t, &mut y, (&l.second, &l.equal), &mut phi, true);
        (l.y, l.phi) = (y, phi);
        known?;
        for i in 0..r {
            l.raw[i] = self.raw_row(i);
            l.raw_rhs[i] = -l.phi[i];
        }
        l.keep(&self.base, &self.sliding.d, &self.sliding.c);
        // along the columns of D, then along b with time
        for j in 0..r + 1 {
            let Some(rates) = self.changes_of_rates((t, x), l, j, true)? else { continue };
            for (i, rate) in rates.into_iter().enumerate() {
                if !l.second[i] {
                    continue;
                }
                if j < r {
                    l.raw[i][j] = rate;
                } else {
                    l.raw_rhs[i] = -rate;
                }
            }
        }
        for i in (0..r).filter(|i| l.held[*i]) {
            l.raw[i].fill(0.0);
            l.raw_rhs[i] = 0.0;
        }
        // where other constraints hold what a constraint of order two depends on, its second derivative is the rest of what is no change
        l.set_slack(l.pace * l.pace);
        if !l.solve(|n| 1.0 / n as f64, 1.0) {
            return Err(EvalError::Recoverable);
        }
        self.alpha.iter_mut().zip(&l.place).for_each(|(a, &at)| *a = l.weights[at]);
        Ok(())
    }

    /// Moves `x` onto the limit set: onto the surfaces, then along `D` until the constraints of order two are constant.
    pub(super) fn project_limit(&mut self, t: f64, x: &mut [f64]) -> Result<bool, EvalError> {
        let before = x.to_vec();
        for _ in 0..2 {
            self.hidden_limit(t, x)?;
            let Some(mut l) = self.limit.take() else { return Ok(false) };
            x.copy_from_slice(&l.y);
            for i in 0..self.pairs.len() {
                l.raw_rhs[i] = if l.second[i] { -l.phi[i] } else { 0.0 };
            }
            l.set_slack(l.pace);
            let solved = l.solve(|_| 0.0, 0.0);
            if solved {
                for j in 0..self.pairs.len() {
                    let by = l.weights[l.place[j]];
                    self.d(j).for_each(|(i, d)| x[i] += by * d);
                }
            }
            self.limit = Some(l);
            if !solved {
                return Err(EvalError::Recoverable);
            }
        }
        Ok(before != x)
    }
}
