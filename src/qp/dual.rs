//! A dual active-set method on the inverse of the Hessian.
//!
//! ```text
//! min ½ uᵀ H u + hᵀ u + prices   s.t.  l ≤ u ≤ u^max,   l_i ≤ a_iᵀ u ≤ u_i
//! ```
//!
//! The dual of a strictly convex program is concave in the multipliers alone (D. Goldfarb, A. Idnani, *A numerically stable dual
//! method for solving strictly convex quadratic programs*, 1983; D. Arnström, A. Bemporad, D. Axehill, *A dual active-set solver for
//! embedded quadratic programming using recursive LDLᵀ updates*, 2022): with `P = H⁻¹` and the active rows `A`, `A P Aᵀ λ = A v − b`
//! where `v = −P h`. For bounds the entries of `A P Aᵀ` are entries of `P`, so they cost nothing to form; other rows are
//! formed when they are first violated ("lazy") and kept until the next preparation. Any set of multipliers `λ ≥ 0` is
//! a start, so the last active set is one.
//!
//! A row that may be violated by `s` at the price `p s + q s²` has `λ = p + 2 q s`: up to `p` it is an ordinary one,
//! beyond it `1/(2q)` is added to its diagonal entry ("shifted"), or, where `q = 0`, its multiplier stays at `p` ("capped").

use super::{QpStatus, Row, StageQp, Terms};
use crate::linalg::dense::{axpy, dot, gemv, Left};

/// A row counts as violated beyond this share of the size of its terms.
const FEASIBLE: f64 = 1e-10;
/// Rows depend on each other where the square of the sine of their angle, in the norm of `P`, is below this.
const DEPENDENT: f64 = 1e-11;
/// Below this the square of the sine is computed again from the difference of the rows themselves: from products it has an
/// error of rounding times the condition of the active rows.
const SUSPICIOUS: f64 = 1e-6;
/// Where rows nearly contradict each other, multipliers are so large that rounding decides which row is violated, in circles:
/// every so many changes per constraint the share above grows by [`GROWTH`].
const CHANGES: usize = 2;
const GROWTH: f64 = 10.0;
/// It grows up to here; a program that needs more is not solved.
const COARSEST: f64 = 1e-6;
/// Operations whose rounding is in the controls, at first; it grows with the share above.
const ROUNDINGS: f64 = 64.0;
/// Below this share of what the largest control would make of a row, it is asked whether a violation is rounding.
const DOUBTFUL: f64 = 1e-8;

/// Where no row is at its price yet, prices of all rows rise in these shares of the last one, and each solution is the guess for the next. At a high price at once
/// multipliers pass through values between zero and there at which other constraints come and go: twice as many changes, with three masses and
/// with a pendulum.
const PRICES: [f64; 4] = [1e-4, 1e-3, 1e-2, 1e-1];

/// What a row is at present.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// Not active; its multiplier is zero.
    Out,
    /// Holds with equality.
    In,
    /// Violated; its multiplier is above the linear price.
    Shifted,
    /// Violated; its multiplier is the linear price.
    Capped,
}

/// Keeps the largest.
fn keep(worst: &mut Option<(f64, usize, bool)>, size: f64, i: usize, up: bool) {
    if worst.is_none_or(|w| size > w.0) {
        *worst = Some((size, i, up));
    }
}

/// Rows that are not bounds.
pub(super) trait Rows {
    /// All `a_iᵀ u` plus what does not depend on `u`.
    fn values(&mut self, u: &[f64], out: &mut [f64]);
    /// `a_i` and `P a_i`.
    fn form(&mut self, i: usize, a: &mut [f64], pa: &mut [f64]);
    /// `H u + h`.
    fn gradient(&mut self, u: &[f64], out: &mut [f64]);
}

/// A program, dense in the controls.
pub(super) struct Program<'a> {
    pub inverse: &'a [f64],
    /// The solution without constraints.
    pub free: &'a [f64],
    pub lower: &'a [f64],
    pub upper: &'a [f64],
    pub row_lower: &'a [f64],
    pub row_upper: &'a [f64],
    pub rows: &'a [Row],
    /// The solution has to be corrected at the end.
    pub ill_conditioned: bool,
}

impl<'a> Program<'a> {
    /// That of stages with this inverse and this solution without constraints.
    pub fn new(qp: &'a StageQp, inverse: &'a [f64], free: &'a [f64], ill_conditioned: bool) -> Program<'a> {
        Program {
            inverse,
            free,
            lower: &qp.u_lower,
            upper: &qp.u_upper,
            row_lower: &qp.row_lower,
            row_upper: &qp.row_upper,
            rows: &qp.rows,
            ill_conditioned,
        }
    }
}

/// The method with its memory and its guess of the active set. Constraints are numbered bounds first.
pub(super) struct DualActiveSet {
    n: usize,
    n_rows: usize,
    state: Vec<State>,
    /// 1 at an upper, −1 at a lower bound.
    side: Vec<f64>,
    lambda: Vec<f64>,
    /// Linear price and `1/(2q)` of every constraint.
    cap: Vec<f64>,
    shift: Vec<f64>,
    /// Coefficients of rows and their products with `P`, those that are formed.
    formed: Vec<bool>,
    a: Vec<f64>,
    pa: Vec<f64>,
    /// Active constraints in the order of the factor; `a_iᵀ P a_j = (L Lᵀ)_ij` with signs.
    active: Vec<usize>,
    factor: Vec<f64>,
    width: usize,
    target: Vec<f64>,
    work: Vec<f64>,
    /// The free solution with what capped rows add; the solution; values of rows at it and where controls are zero.
    base: Vec<f64>,
    u: Vec<f64>,
    residual: Vec<f64>,
    values: Vec<f64>,
    offset: Vec<f64>,
    /// Constraints and sides of the next guess.
    guess: Vec<(usize, f64, bool)>,
    /// Rows whose value follows from the active ones, which meet them: what they seem violated by is rounding.
    implied: Vec<bool>,
    /// Rows that the present controls violate by the rounding of terms that cancel.
    cancelled: Vec<bool>,
    /// The factor is not that of the states.
    stale: bool,
    /// Share of its size by which a row must be violated to be taken in.
    tolerance: f64,
    iterations: usize,
}

/// The first change on the way to other multipliers.
#[derive(Clone, Copy)]
struct Break {
    t: f64,
    place: usize,
    to: State,
}

impl DualActiveSet {
    pub fn new(n: usize, n_rows: usize) -> DualActiveSet {
        let m = n + n_rows;
        // rows that are shifted do not depend on each other, so any number may be active
        let width = m;
        DualActiveSet {
            n,
            n_rows,
            state: vec![State::Out; m],
            side: vec![1.0; m],
            lambda: vec![0.0; m],
            cap: vec![f64::INFINITY; m],
            shift: vec![0.0; m],
            formed: vec![false; n_rows],
            a: vec![0.0; n_rows * n],
            pa: vec![0.0; n_rows * n],
            active: Vec::with_capacity(width),
            factor: vec![0.0; width * (width + 1) / 2],
            width,
            target: vec![0.0; width],
            work: vec![0.0; width],
            base: vec![0.0; n],
            u: vec![0.0; n],
            residual: vec![0.0; n],
            values: vec![0.0; n_rows],
            offset: vec![0.0; n_rows],
            guess: Vec::with_capacity(m),
            implied: vec![false; m],
            cancelled: vec![false; n_rows],
            stale: false,
            tolerance: FEASIBLE,
            iterations: 0,
        }
    }

    pub fn solution(&self) -> &[f64] {
        &self.u
    }

    pub fn iterations(&self) -> usize {
        self.iterations
    }

    /// Is a row beyond its price that has none of its own?
    pub fn violates(&self, rows: &[Row]) -> bool {
        let beyond = |s: &State| matches!(s, State::Shifted | State::Capped);
        self.state[self.n..].iter().zip(rows).any(|(s, row)| row.price.is_none() && beyond(s))
    }

    /// Cost per unit of violation: what it costs to meet every row without a price of its own by itself, `½ v_i²/(a_iᵀ P a_i)` for a row
    /// that the solution without constraints, `q.free`, violates by `v_i` (or by more than bounds of controls let it move, which then
    /// counts), in sum, over the sum of these violations. Of the rows that the last solution met with; zero where controls move none of them.
    pub fn cost_of_rows(&self, q: &Program) -> f64 {
        let (mut cost, mut sum) = (0.0, 0.0);
        for r in (0..self.n_rows).filter(|r| self.formed[*r] && q.rows[*r].price.is_none()) {
            let (a, pa) = (&self.a[r * self.n..(r + 1) * self.n], &self.pa[r * self.n..(r + 1) * self.n]);
            let (value, lower, upper) = (dot(a, q.free) + self.offset[r], q.row_lower[r], q.row_upper[r]);
            let (beyond, bound) = if value > upper { (value - upper, upper) } else { (lower - value, lower) };
            let terms = a.iter().zip(q.lower.iter().zip(q.upper)).filter(|e| *e.0 != 0.0);
            let reach: f64 = terms.map(|(a, (l, u))| a.abs() * (u - l)).sum();
            let own = dot(a, pa);
            if beyond > 0.0 && own > 0.0 && reach > self.tolerance * (value.abs() + bound.abs()) {
                let v = beyond.min(reach);
                cost += 0.5 * v * v / own;
                sum += v;
            }
        }
        if sum > 0.0 {
            cost / sum
        } else {
            0.0
        }
    }

    pub fn multipliers(&self, u: &mut [f64], rows: &mut [f64]) {
        let signed = |i: usize| self.side[i] * self.lambda[i];
        u.iter_mut().enumerate().for_each(|(i, v)| *v = signed(i));
        rows.iter_mut().enumerate().for_each(|(i, v)| *v = signed(self.n + i));
    }

    pub fn reset(&mut self) {
        self.state.fill(State::Out);
        self.lambda.fill(0.0);
        self.active.clear();
    }

    /// The active set one stage earlier; `row` says which row takes the place of one.
    pub fn shift(&mut self, nu: usize, row: impl Fn(usize) -> Option<usize>) {
        self.guess.clear();
        for i in 0..self.n + self.n_rows {
            if self.state[i] == State::Out {
                continue;
            }
            let to = if i < self.n { i.checked_sub(nu) } else { row(i - self.n).map(|j| self.n + j) };
            if let Some(to) = to {
                self.guess.push((to, self.side[i], self.state[i] == State::Capped));
            }
        }
        self.reset();
        self.stale = true;
        for k in 0..self.guess.len() {
            let (i, side, capped) = self.guess[k];
            self.state[i] = if capped && i >= self.n { State::Capped } else { State::In };
            self.side[i] = side;
        }
    }

    /// Takes the inverse of another program: the factor of the guess is made anew.
    pub fn prepare(&mut self, inverse: &[f64], rows: &mut dyn Rows) {
        self.formed.fill(false);
        self.refactor(inverse, rows);
    }

    /// The factor of what is in, shifted or capped; what depends on others leaves.
    fn refactor(&mut self, inverse: &[f64], rows: &mut dyn Rows) {
        self.active.clear();
        self.stale = false;
        for i in 0..self.n + self.n_rows {
            match self.state[i] {
                State::Out => self.lambda[i] = 0.0,
                State::Capped => self.form(i, rows),
                State::In | State::Shifted => {
                    self.form(i, rows);
                    if !self.append(i, inverse) {
                        self.state[i] = State::Out;
                        self.lambda[i] = 0.0;
                    }
                }
            }
        }
    }

    fn form(&mut self, i: usize, rows: &mut dyn Rows) {
        let Some(r) = i.checked_sub(self.n) else { return };
        if self.formed[r] {
            return;
        }
        let n = self.n;
        rows.form(r, &mut self.a[r * n..(r + 1) * n], &mut self.pa[r * n..(r + 1) * n]);
        self.formed[r] = true;
    }

    /// `P a_i`
    fn column<'s>(&'s self, i: usize, inverse: &'s [f64]) -> &'s [f64] {
        let n = self.n;
        match i.checked_sub(n) {
            Some(r) => &self.pa[r * n..(r + 1) * n],
            None => &inverse[i * n..(i + 1) * n],
        }
    }

    /// `a_iᵀ v`
    fn product(&self, i: usize, v: &[f64]) -> f64 {
        match i.checked_sub(self.n) {
            Some(r) => dot(&self.a[r * self.n..(r + 1) * self.n], v),
            None => v[i],
        }
    }

    fn row(&self, p: usize) -> std::ops::Range<usize> {
        let from = p * (p + 1) / 2;
        from..from + p + 1
    }

    /// Adds a row to the factor; false where it depends on those that are there. `work` then holds `L⁻¹` times its products
    /// with them.
    fn append(&mut self, i: usize, inverse: &[f64]) -> bool {
        let w = self.active.len();
        if w == self.width {
            return false;
        }
        let mut work = std::mem::take(&mut self.work);
        let column = self.column(i, inverse);
        let own = self.product(i, column) + if self.state[i] == State::Shifted { self.shift[i] } else { 0.0 };
        let mut rest = own;
        for (p, &j) in self.active.iter().enumerate() {
            let v = self.product(j, column) * self.side[i] * self.side[j];
            let l = &self.factor[self.row(p)];
            work[p] = (v - dot(&l[..p], &work[..p])) / l[p];
            rest -= work[p] * work[p];
        }
        if rest <= SUSPICIOUS * own {
            rest = self.distance(i, &work, inverse);
        }
        // as many rows as controls leave nothing: what seems left is rounding
        let shifted = self.state[i] == State::Shifted;
        let full = !shifted && self.active.iter().filter(|j| self.state[**j] == State::In).count() >= self.n;
        let independent = !full && rest > DEPENDENT * own;
        if independent {
            let row = self.row(w);
            self.factor[row.clone()][..w].copy_from_slice(&work[..w]);
            self.factor[row.end - 1] = rest.sqrt();
            self.active.push(i);
        }
        self.work = work;
        independent
    }

    /// The squared distance of a row to the span of the active ones in the norm of `P`, and its own shift; `v` is `L⁻¹` times its
    /// products with them.
    fn distance(&mut self, i: usize, v: &[f64], inverse: &[f64]) -> f64 {
        let n = self.n;
        let mut r = std::mem::take(&mut self.target);
        r.copy_from_slice(v);
        self.back(&mut r);
        let (mut a, mut pa) = (std::mem::take(&mut self.base), std::mem::take(&mut self.residual));
        a.fill(0.0);
        pa.fill(0.0);
        let mut shift = if self.state[i] == State::Shifted { self.shift[i] } else { 0.0 };
        let others = self.active.iter().zip(&r).map(|(&j, r)| (j, -r * self.side[j] * self.side[i]));
        for (j, f) in std::iter::once((i, 1.0)).chain(others) {
            match j.checked_sub(n) {
                Some(row) => axpy(f, &self.a[row * n..(row + 1) * n], &mut a),
                None => a[j] += f,
            }
            axpy(f, self.column(j, inverse), &mut pa);
            if j != i && self.state[j] == State::Shifted {
                shift += f * f * self.shift[j];
            }
        }
        let square = dot(&a, &pa) + shift;
        (self.target, self.base, self.residual) = (r, a, pa);
        square
    }

    /// Takes the constraint at place `p` out of the factor: the columns behind it are rotated into one less.
    fn remove(&mut self, p: usize) {
        let w = self.active.len();
        for c in p..w - 1 {
            let first = self.row(c + 1).start;
            let (x, y) = (self.factor[first + c], self.factor[first + c + 1]);
            let r = x.hypot(y);
            let (cos, sin) = (x / r, y / r);
            for i in c + 1..w {
                let at = self.row(i).start + c;
                let (x, y) = (self.factor[at], self.factor[at + 1]);
                self.factor[at] = cos * x + sin * y;
                self.factor[at + 1] = cos * y - sin * x;
            }
        }
        for i in p + 1..w {
            let (from, to) = (self.row(i).start, self.row(i - 1).start);
            self.factor.copy_within(from..from + i, to);
        }
        self.active.remove(p);
    }

    /// `L⁻ᵀ v` in place, for the first entries.
    fn back(&self, v: &mut [f64]) {
        for p in (0..self.active.len()).rev() {
            let l = &self.factor[self.row(p)];
            v[p] /= l[p];
            let f = v[p];
            axpy(-f, &l[..p], &mut v[..p]);
        }
    }

    /// `(L Lᵀ)⁻¹ v` in place, for the first entries.
    fn solve_factor(&self, v: &mut [f64]) {
        for p in 0..self.active.len() {
            let l = &self.factor[self.row(p)];
            v[p] = (v[p] - dot(&l[..p], &v[..p])) / l[p];
        }
        self.back(v);
    }

    /// Solves; the guess is what was active last.
    pub fn solve(&mut self, q: &Program, rows: &mut dyn Rows, terms: &Terms) -> QpStatus {
        self.iterations = 0;
        if let Some(price) = terms.elastic.filter(|_| !self.violates(q.rows)) {
            for share in PRICES {
                let status = self.find(q, rows, &Terms { elastic: Some(share * price), ..*terms });
                if status == QpStatus::OutOfTime {
                    return status;
                }
            }
        }
        let status = self.find(q, rows, terms);
        if status != QpStatus::Solved {
            return status;
        }
        self.refine(q, rows);
        if self.u.iter().all(|v| v.is_finite()) {
            QpStatus::Solved
        } else {
            QpStatus::Failed
        }
    }

    /// The active set and its multipliers.
    fn find(&mut self, q: &Program, rows: &mut dyn Rows, terms: &Terms) -> QpStatus {
        self.implied.fill(false);
        self.begin(q, rows, terms);
        let patience = CHANGES * (self.n + self.n_rows);
        self.tolerance = FEASIBLE;
        let mut changes = 0;
        loop {
            if self.iterations > 0 && terms.over(self.iterations) {
                self.cut_off(q);
                return QpStatus::OutOfTime;
            }
            self.iterations += 1;
            changes += 1;
            if changes % patience == 0 {
                self.tolerance *= GROWTH;
                if self.tolerance > COARSEST || terms.brief {
                    self.cut_off(q);
                    return QpStatus::Failed;
                }
            }
            self.aim(q);
            if let Some(b) = self.first_break() {
                self.walk(b.t);
                self.change(b, q.inverse);
                continue;
            }
            self.walk(1.0);
            self.update(q);
            let Some((i, up)) = self.next_violated(q, rows) else { break };
            if !self.enter(i, up, q) {
                self.cut_off(q);
                return QpStatus::Infeasible;
            }
        }
        QpStatus::Solved
    }

    /// Prices, values where controls are zero, and a dual point: multipliers of the guess that have a sign they must not
    /// have leave at once.
    fn begin(&mut self, q: &Program, rows: &mut dyn Rows, terms: &Terms) {
        let n = self.n;
        let mut stale = self.stale;
        for (i, row) in q.rows.iter().enumerate() {
            let (cap, shift) = match (row.price, terms.elastic) {
                (Some(p), _) if p.quadratic > 0.0 => (p.linear, 0.5 / p.quadratic),
                (Some(p), _) => (p.linear, 0.0),
                (None, Some(price)) => (price, 0.0),
                (None, None) => (f64::INFINITY, 0.0),
            };
            if self.state[n + i] == State::Shifted && (self.cap[n + i] != cap || self.shift[n + i] != shift) {
                // beyond another price it starts as an ordinary one
                self.state[n + i] = State::In;
                stale = true;
            }
            (self.cap[n + i], self.shift[n + i]) = (cap, shift);
        }
        if self.n_rows > 0 {
            self.u.fill(0.0);
            let mut values = std::mem::take(&mut self.offset);
            rows.values(&self.u, &mut values);
            self.offset = values;
        }
        for i in n..n + self.n_rows {
            // a price that is gone, a bound that is gone
            let unbounded = self.state[i] != State::Out && !self.bound(i, q).is_finite();
            let unpriced = matches!(self.state[i], State::Shifted | State::Capped) && !self.cap[i].is_finite();
            if unbounded || unpriced {
                stale = true;
                self.state[i] = State::Out;
            }
        }
        for i in 0..n {
            if self.state[i] != State::Out && !self.bound(i, q).is_finite() {
                self.state[i] = State::Out;
                stale = true;
            }
        }
        if stale {
            self.refactor(q.inverse, rows);
        }
        self.settle(q);
    }

    /// From the guess to multipliers that have their signs.
    fn settle(&mut self, q: &Program) {
        loop {
            for i in 0..self.state.len() {
                self.lambda[i] = match self.state[i] {
                    State::Out => 0.0,
                    State::Capped => self.cap[i],
                    State::In | State::Shifted => self.lambda[i],
                };
            }
            self.aim(q);
            let mut kept = true;
            for p in (0..self.active.len()).rev() {
                let (i, target) = (self.active[p], self.target[p]);
                let low = if self.state[i] == State::Shifted { self.cap[i] } else { 0.0 };
                let high = if self.state[i] == State::Shifted { f64::INFINITY } else { self.cap[i] };
                if !(target >= low && target <= high) {
                    self.remove(p);
                    kept = false;
                    // a row that would cost more than its price is violated, not free
                    self.state[i] = if target > high { self.beyond(i) } else { State::Out };
                    if self.state[i] == State::Shifted && !self.append(i, q.inverse) {
                        self.state[i] = State::Capped;
                    }
                }
            }
            if kept {
                for (p, &i) in self.active.iter().enumerate() {
                    self.lambda[i] = self.target[p];
                }
                return;
            }
        }
    }

    /// The bound a constraint is at.
    fn bound(&self, i: usize, q: &Program) -> f64 {
        let up = self.side[i] > 0.0;
        match i.checked_sub(self.n) {
            None if up => q.upper[i],
            None => q.lower[i],
            Some(r) if up => q.row_upper[r] - self.offset[r],
            Some(r) => q.row_lower[r] - self.offset[r],
        }
    }

    /// The bound a row is at, as the user gave it.
    fn limit(&self, i: usize, q: &Program) -> f64 {
        let r = i - self.n;
        if self.side[i] > 0.0 {
            q.row_upper[r]
        } else {
            q.row_lower[r]
        }
    }

    /// The multipliers that would make the active constraints hold with equality, to `target`.
    fn aim(&mut self, q: &Program) {
        self.base.copy_from_slice(q.free);
        let mut base = std::mem::take(&mut self.base);
        for i in self.n..self.n + self.n_rows {
            if self.state[i] == State::Capped {
                axpy(-self.side[i] * self.cap[i], self.column(i, q.inverse), &mut base);
            }
        }
        self.base = base;
        let mut target = std::mem::take(&mut self.target);
        for (p, &i) in self.active.iter().enumerate() {
            let free = if self.state[i] == State::Shifted { self.shift[i] * self.cap[i] } else { 0.0 };
            target[p] = self.side[i] * (self.product(i, &self.base) - self.bound(i, q)) + free;
        }
        self.solve_factor(&mut target);
        self.target = target;
    }

    /// Where the way to `target` first meets the end of a piece of the dual function.
    fn first_break(&self) -> Option<Break> {
        let mut first: Option<Break> = None;
        for (place, &i) in self.active.iter().enumerate() {
            let (from, to) = (self.lambda[i], self.target[place]);
            // what rounding puts beyond the end of a piece is at the end
            let tiny = f64::EPSILON * self.active.len() as f64 * (from.abs() + to.abs());
            let shifted = self.state[i] == State::Shifted;
            let (end, next) = if shifted && to < self.cap[i] - tiny {
                (self.cap[i], State::In)
            } else if !shifted && to < -tiny {
                (0.0, State::Out)
            } else if !shifted && to > self.cap[i] + tiny {
                (self.cap[i], self.beyond(i))
            } else {
                continue;
            };
            let t = ((end - from) / (to - from)).clamp(0.0, 1.0);
            if first.is_none_or(|f| t < f.t) {
                first = Some(Break { t, place, to: next });
            }
        }
        first
    }

    /// What becomes of a constraint whose multiplier reaches its price.
    fn beyond(&self, i: usize) -> State {
        if self.shift[i] > 0.0 {
            State::Shifted
        } else {
            State::Capped
        }
    }

    fn walk(&mut self, t: f64) {
        for (p, &i) in self.active.iter().enumerate() {
            self.lambda[i] =
                if t == 1.0 { self.target[p] } else { self.lambda[i] + t * (self.target[p] - self.lambda[i]) };
        }
    }

    fn change(&mut self, b: Break, inverse: &[f64]) {
        let i = self.active[b.place];
        self.remove(b.place);
        self.implied.fill(false);
        self.state[i] = b.to;
        self.lambda[i] = if b.to == State::Out { 0.0 } else { self.cap[i] };
        if matches!(b.to, State::In | State::Shifted) && !self.append(i, inverse) {
            // no longer shifted, it depends on others: its multiplier stays where it is
            self.state[i] = State::Capped;
        }
    }

    /// The controls of the multipliers.
    fn update(&mut self, q: &Program) {
        let mut u = std::mem::take(&mut self.u);
        u.copy_from_slice(&self.base);
        for &i in &self.active {
            axpy(-self.side[i] * self.lambda[i], self.column(i, q.inverse), &mut u);
        }
        self.u = u;
    }

    /// The constraint to change next, formed, and at which side. Of a row whose bound and value are next to zero only its terms say
    /// what rounding is.
    fn next_violated(&mut self, q: &Program, rows: &mut dyn Rows) -> Option<(usize, bool)> {
        self.cancelled.fill(false);
        loop {
            let (i, up) = self.most_violated(q, rows)?;
            self.form(i, rows);
            let Some(r) = i.checked_sub(self.n) else { return Some((i, up)) };
            let (value, bound) = (self.values[r], if up { q.row_upper[r] } else { q.row_lower[r] });
            let terms = self.a[r * self.n..(r + 1) * self.n].iter().zip(&self.u).map(|(a, u)| (a * u).abs());
            let beyond = (value - bound).abs();
            if beyond > self.tolerance * terms.sum::<f64>() && !self.is_rounding(r, beyond, q) {
                return Some((i, up));
            }
            self.cancelled[r] = true;
        }
    }

    /// Is a violation of a row by so much no more than the rounding of the controls? Those that are zero are sums of terms that cancel, and so is a
    /// row of them alone.
    fn is_rounding(&self, r: usize, beyond: f64, q: &Program) -> bool {
        let a = &self.a[r * self.n..(r + 1) * self.n];
        let largest = self.u.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        if beyond > DOUBTFUL * largest * a.iter().map(|a| a.abs()).sum::<f64>() {
            return false;
        }
        let terms = |k: usize| -> f64 {
            let active = (0..self.n + self.n_rows).filter(|i| self.state[*i] != State::Out);
            q.free[k].abs() + active.map(|i| (self.lambda[i] * self.column(i, q.inverse)[k]).abs()).sum::<f64>()
        };
        let size: f64 = (0..self.n).filter(|k| a[*k] != 0.0).map(|k| a[k].abs() * terms(k)).sum();
        beyond <= self.rounding() * size
    }

    /// Share of their terms up to which sums are rounding.
    fn rounding(&self) -> f64 {
        ROUNDINGS * f64::EPSILON * (self.tolerance / FEASIBLE)
    }

    /// The most violated constraint, and at which side: the bound that is violated most in the norm of the dual, without
    /// one the row that is violated most in its own size.
    fn most_violated(&mut self, q: &Program, rows: &mut dyn Rows) -> Option<(usize, bool)> {
        let largest = self.u.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let mut worst: Option<(f64, usize, bool)> = None;
        for i in 0..self.n {
            if self.state[i] != State::Out || self.implied[i] {
                continue;
            }
            let (v, l, u) = (self.u[i], q.lower[i], q.upper[i]);
            let root = q.inverse[i * (self.n + 1)].sqrt();
            if v - u > self.tolerance * (largest + u.abs()) {
                keep(&mut worst, (v - u) / root, i, true);
            } else if l - v > self.tolerance * (largest + l.abs()) {
                keep(&mut worst, (l - v) / root, i, false);
            }
        }
        if worst.is_none() && self.n_rows > 0 {
            let mut values = std::mem::take(&mut self.values);
            rows.values(&self.u, &mut values);
            for (r, &v) in values.iter().enumerate() {
                let (i, l, u) = (self.n + r, q.row_lower[r], q.row_upper[r]);
                let size = |bound: f64| v.abs().max(self.offset[r].abs()) + bound.abs();
                match self.state[i] {
                    State::In | State::Shifted => {}
                    _ if self.implied[i] || self.cancelled[r] => {}
                    State::Out if v - u > self.tolerance * size(u) => keep(&mut worst, (v - u) / size(u), i, true),
                    State::Out if l - v > self.tolerance * size(l) => keep(&mut worst, (l - v) / size(l), i, false),
                    State::Out => {}
                    State::Capped => {
                        let up = self.side[i] > 0.0;
                        let bound = if up { u } else { l };
                        let inside = self.side[i] * (bound - v);
                        // a violation costs more than the linear price where there is a quadratic one
                        let wrong = if self.shift[i] > 0.0 { inside.abs() } else { inside };
                        if wrong > self.tolerance * size(bound) {
                            keep(&mut worst, wrong / size(bound), i, up);
                        }
                    }
                }
            }
            self.values = values;
        }
        worst.map(|w| (w.1, w.2))
    }

    /// Makes a constraint active. One that depends on the active ones takes their multipliers along until one of them, or
    /// its own, is at an end; false where none is: the rows contradict each other.
    fn enter(&mut self, i: usize, up: bool, q: &Program) -> bool {
        // a capped row comes back from its price, or goes beyond it
        let down = self.state[i] == State::Capped;
        if down && self.shift[i] > 0.0 && self.side[i] * (self.values[i - self.n] - self.limit(i, q)) > 0.0 {
            self.state[i] = State::Shifted;
            return self.append(i, q.inverse);
        }
        self.side[i] = if up { 1.0 } else { -1.0 };
        self.state[i] = State::In;
        self.lambda[i] = if down { self.cap[i] } else { 0.0 };
        loop {
            if self.append(i, q.inverse) {
                return true;
            }
            // a_i = Σ r_j a_j: along λ_i + t, λ_j − t r_j the controls stay
            let mut r = std::mem::take(&mut self.work);
            self.back(&mut r);
            if self.is_met(i, &r, q) {
                self.work = r;
                self.implied[i] = true;
                self.state[i] = if down { State::Capped } else { State::Out };
                return true;
            }
            let sign = if down { -1.0 } else { 1.0 };
            let own_end = if down { self.lambda[i] } else { self.cap[i] - self.lambda[i] };
            let mut first: Option<Break> = None;
            for (place, &j) in self.active.iter().enumerate() {
                let rate = -sign * r[place];
                let shifted = self.state[j] == State::Shifted;
                let (room, next) = if rate < 0.0 {
                    let low = if shifted { self.cap[j] } else { 0.0 };
                    (self.lambda[j] - low, if shifted { State::In } else { State::Out })
                } else if rate > 0.0 && !shifted && self.cap[j].is_finite() {
                    (self.cap[j] - self.lambda[j], self.beyond(j))
                } else {
                    continue;
                };
                let t = room.max(0.0) / rate.abs();
                if first.is_none_or(|f| t < f.t) {
                    first = Some(Break { t, place, to: next });
                }
            }
            let t = first.map_or(f64::INFINITY, |f| f.t).min(own_end);
            if !t.is_finite() {
                self.work = r;
                self.state[i] = State::Out;
                self.lambda[i] = 0.0;
                return false;
            }
            for (place, &j) in self.active.iter().enumerate() {
                self.lambda[j] -= sign * t * r[place];
            }
            self.lambda[i] += sign * t;
            self.work = r;
            match first {
                Some(b) if b.t <= own_end => self.change(b, q.inverse),
                _ if down => {
                    self.state[i] = State::Out;
                    self.lambda[i] = 0.0;
                    return true;
                }
                _ => {
                    self.state[i] = self.beyond(i);
                    self.lambda[i] = self.cap[i];
                    if self.state[i] == State::Capped {
                        return true;
                    }
                }
            }
        }
    }

    /// Does the value of a row that is the sum of active ones with the factors `r` meet its bound? They say it without the
    /// rounding errors of the controls.
    fn is_met(&self, i: usize, r: &[f64], q: &Program) -> bool {
        let own = self.side[i] * self.bound(i, q);
        let (mut value, mut size) = (-own, own.abs());
        let (mut others, mut factor) = (own.abs(), 1.0f64);
        for (&j, r) in self.active.iter().zip(r) {
            let beyond =
                if self.state[j] == State::Shifted { (self.lambda[j] - self.cap[j]) * self.shift[j] } else { 0.0 };
            let bound = self.side[j] * self.bound(j, q) + beyond;
            value += r * bound;
            size += (r * bound).abs();
            others += bound.abs();
            factor = factor.max(r.abs());
        }
        // factors that should be zero are rounding of the largest
        value.abs() <= (self.tolerance * size).max(self.rounding() * factor * others)
    }

    /// Corrections of controls and multipliers by what rounding left of the optimality conditions with this active set.
    fn refine(&mut self, q: &Program, rows: &mut dyn Rows) {
        // bounds alone leave nothing to correct but what rounding does to the affine law
        let corrections = match q.ill_conditioned {
            true => 2,
            false => usize::from(self.state[self.n..].iter().any(|s| *s != State::Out)),
        };
        (0..corrections).for_each(|_| self.correct(q, rows));
        for &i in self.active.iter().filter(|i| **i < self.n) {
            self.u[i] = if self.side[i] > 0.0 { q.upper[i] } else { q.lower[i] };
        }
    }

    fn correct(&mut self, q: &Program, rows: &mut dyn Rows) {
        let mut step = std::mem::take(&mut self.base);
        step.fill(0.0);
        self.descend(q, rows, &mut step);
        // then what keeps the active rows where they are
        let mut target = std::mem::take(&mut self.target);
        for (p, &i) in self.active.iter().enumerate() {
            let free =
                if self.state[i] == State::Shifted { self.shift[i] * (self.cap[i] - self.lambda[i]) } else { 0.0 };
            let gap = self.product(i, &self.u) - self.bound(i, q) + self.product(i, &step);
            target[p] = self.side[i] * gap + free;
        }
        self.solve_factor(&mut target);
        for (p, &i) in self.active.iter().enumerate() {
            axpy(-self.side[i] * target[p], self.column(i, q.inverse), &mut step);
            self.lambda[i] += target[p];
        }
        axpy(1.0, &step, &mut self.u);
        (self.base, self.target) = (step, target);
    }

    /// `−P r` of the gradient `r` of the Lagrangian.
    fn descend(&mut self, q: &Program, rows: &mut dyn Rows, step: &mut [f64]) {
        let n = self.n;
        let mut r = std::mem::take(&mut self.residual);
        rows.gradient(&self.u, &mut r);
        for i in 0..n + self.n_rows {
            let f = self.side[i] * self.lambda[i];
            if self.state[i] == State::Out || f == 0.0 {
                continue;
            }
            match i.checked_sub(n) {
                None => r[i] += f,
                Some(row) => axpy(f, &self.a[row * n..(row + 1) * n], &mut r),
            }
        }
        gemv(n, n, Left { v: q.inverse, ld: n }, &r, step);
        step.iter_mut().for_each(|v| *v = -*v);
        self.residual = r;
    }

    /// The controls of the present multipliers, within their bounds.
    fn cut_off(&mut self, q: &Program) {
        self.aim(q);
        self.update(q);
        let bounds = q.lower.iter().zip(q.upper);
        self.u.iter_mut().zip(bounds).for_each(|(v, (l, u))| *v = v.max(*l).min(*u));
    }
}
