//! Impulses of the closed contacts.
//!
//! ```text
//! rate = G v⁺ + drive,   v⁺ = v + M⁻¹ Gᵀ Λ,   0 ≤ Λ_n ⊥ rate_n ≥ 0,   ‖Λ_t‖ ≤ μ Λ_n,   Λ_t opposite to rate_t
//! ```
//!
//! Block Gauss-Seidel, contact after contact: each is solved for itself with the others as they are, and the velocities carry
//! what the others do, so the matrix `G M⁻¹ Gᵀ` is never formed. That is slow where many contacts carry one another, as in a
//! pile. Then a few sweeps say which contacts push and which stick, and conjugate gradients solve the equations of these, as far
//! as nothing changes its state (J. J. Moré, G. Toraldo, *On the solution of large quadratic programming problems with bound
//! constraints*, SIAM J. Optim. 1 (1991): without friction every part lowers one quadratic function and the end is exact);
//! the next sweep may change the states. What slides keeps its tangential impulse meanwhile and follows in the sweeps.

use super::rows::{Rows, Touched};

/// How a solution went.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Outcome {
    pub(super) sweeps: usize,
    pub(super) gradients: usize,
    pub(super) converged: bool,
    /// Last change, relative to the impulses.
    pub(super) change: f64,
}

/// When to stop.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    /// Change of the impulses, relative to them; both are measured by the energy they have.
    pub(super) tolerance: f64,
    /// Sweeps and steps of conjugate gradients together.
    pub(super) iterations: usize,
    /// Energy that counts as large where that of the impulses is less.
    pub(super) energy: f64,
}

/// Sweeps that go down by less than this, each to the next, are slow.
const SLOW: f64 = 0.3;
/// Sweeps between conjugate gradients.
const SWEEPS: usize = 3;

/// Memory of the solver.
#[derive(Default)]
pub(super) struct Solver {
    /// Rows of the equations, their contacts, and vectors of them.
    rows: Vec<usize>,
    of: Vec<usize>,
    residual: Vec<f64>,
    direction: Vec<f64>,
    product: Vec<f64>,
    /// What the direction does to the velocities.
    moved: Vec<f64>,
    /// Direction by row, zero where a row is not among the equations.
    by_row: Vec<f64>,
    /// Contacts that take part.
    pub(super) part: Vec<bool>,
    /// Only normal impulses are unknown.
    pub(super) normal_only: bool,
}

impl Solver {
    pub(super) fn new(n_v: usize) -> Solver {
        Solver { moved: vec![0.0; n_v], ..Solver::default() }
    }

    /// Changes the impulses of `rows` and the velocities `v`, which they have moved already.
    pub(super) fn solve(&mut self, rows: &mut Rows, t: &Touched, v: &mut [f64], limits: &Limits) -> Outcome {
        let mut o = Outcome::default();
        let (mut last, mut since) = (f64::INFINITY, 0);
        while o.sweeps + o.gradients < limits.iterations {
            let (change, energy) = self.sweep(rows, t, v);
            o.sweeps += 1;
            since += 1;
            let size = energy.max(limits.energy).sqrt();
            let change = change.sqrt();
            let rate = if since > 1 { change / last } else { 0.0 };
            last = change;
            o.change = if size > 0.0 { change / size } else { 0.0 };
            if !o.change.is_finite() {
                return o;
            }
            // what is left is about a geometric series of changes like the last
            let left = change / (1.0 - rate).max(1e-3);
            if change == 0.0 || (left <= limits.tolerance * size && (since > 1 || rows.len() == 1)) {
                o.converged = true;
                return o;
            }
            if since >= SWEEPS && rate > SLOW {
                let rest = limits.iterations - o.sweeps - o.gradients;
                o.gradients += self.gradients(rows, t, v, limits.tolerance * size, rest);
                since = 0;
            }
        }
        o
    }

    /// One sweep; the energy of the change and of the impulses.
    fn sweep(&self, rows: &mut Rows, t: &Touched, v: &mut [f64]) -> (f64, f64) {
        let (mut change, mut energy) = (0.0, 0.0);
        for a in 0..rows.len() {
            if !self.part[a] {
                continue;
            }
            let (from, n_t) = (rows.first[a], if self.normal_only { 0 } else { rows.n_tangents(a) });
            let w = rows.own[a];
            let mut old = [0.0; 3];
            old[..=n_t].copy_from_slice(&rows.impulse[from..=from + n_t]);
            let mut rate = [0.0; 3];
            for k in 0..=n_t {
                rate[k] = rows.drive[from + k] + rows.times(t, a, from + k, v);
            }
            let mu = [rows.friction[a], rows.stiction[a]];
            let (new, slides) = match n_t {
                0 => ([(old[0] - rate[0] / w[0]).max(rows.least(a)), 0.0, 0.0], false),
                1 if rows.is_joint(a) => joint(w[4], old, rate[1], mu),
                1 => planar(&w, old, rate, mu),
                _ => spatial(&w, old, rate, mu),
            };
            rows.slides[a] = slides;
            for k in 0..=n_t {
                let d = new[k] - old[k];
                if d != 0.0 {
                    rows.impulse[from + k] = new[k];
                    rows.push(t, a, from + k, d, v);
                }
                change += d * d * w[4 * k];
                energy += new[k] * new[k] * w[4 * k];
            }
        }
        (change, energy)
    }

    /// Conjugate gradients on the equations of the contacts that push, and of those that stick; ends where one would leave its
    /// state, or where what is left is small. Counts the steps.
    fn gradients(&mut self, rows: &mut Rows, t: &Touched, v: &mut [f64], small: f64, most: usize) -> usize {
        self.list(rows);
        let n = self.rows.len();
        if n == 0 {
            return 0;
        }
        for vector in [&mut self.residual, &mut self.direction, &mut self.product] {
            vector.clear();
            vector.resize(n, 0.0);
        }
        self.by_row.clear();
        self.by_row.resize(rows.impulse.len(), 0.0);
        let diagonal = |rows: &Rows, a: usize, r: usize| rows.own[a][4 * (r - rows.first[a])];
        let mut norm = 0.0;
        for i in 0..n {
            let (r, a) = (self.rows[i], self.of[i]);
            self.residual[i] = -(rows.drive[r] + rows.times(t, a, r, v));
            self.direction[i] = self.residual[i] / diagonal(rows, a, r);
            norm += self.residual[i] * self.direction[i];
        }
        let mut steps = 0;
        while steps < most.min(4 * n + 8) && norm.sqrt() > 0.1 * small && norm.is_finite() {
            steps += 1;
            self.moved.fill(0.0);
            for i in 0..n {
                rows.push(t, self.of[i], self.rows[i], self.direction[i], &mut self.moved);
                self.by_row[self.rows[i]] = self.direction[i];
            }
            let mut curvature = 0.0;
            for i in 0..n {
                self.product[i] = rows.times(t, self.of[i], self.rows[i], &self.moved);
                curvature += self.product[i] * self.direction[i];
            }
            // nothing to gain where the rows depend on each other
            if curvature.is_nan() || curvature <= 0.0 {
                break;
            }
            let length = norm / curvature;
            let room = self.room(rows, length);
            let step = length.min(room);
            for i in 0..n {
                let r = self.rows[i];
                rows.impulse[r] += step * self.direction[i];
                if r == rows.first[self.of[i]] {
                    rows.impulse[r] = rows.impulse[r].max(rows.least(self.of[i]));
                }
            }
            v.iter_mut().zip(&self.moved).for_each(|(v, m)| *v += step * m);
            if room < length {
                break;
            }
            let mut next = 0.0;
            for i in 0..n {
                self.residual[i] -= step * self.product[i];
                let d = diagonal(rows, self.of[i], self.rows[i]);
                next += self.residual[i] * self.residual[i] / d;
            }
            let ratio = next / norm;
            norm = next;
            for i in 0..n {
                let d = diagonal(rows, self.of[i], self.rows[i]);
                self.direction[i] = self.residual[i] / d + ratio * self.direction[i];
            }
        }
        steps
    }

    /// Rows of contacts that push: the normals, and tangents that stick.
    fn list(&mut self, rows: &Rows) {
        self.rows.clear();
        self.of.clear();
        for a in (0..rows.len()).filter(|&a| self.part[a]) {
            let from = rows.first[a];
            let l = rows.impulse[from];
            if l <= 0.0 && l <= rows.least(a) {
                continue;
            }
            if !rows.is_joint(a) {
                self.rows.push(from);
                self.of.push(a);
            }
            let n_t = if self.normal_only { 0 } else { rows.n_tangents(a) };
            let size = rows.impulse[from + 1..=from + n_t].iter().fold(0.0, |s: f64, i| s.hypot(*i));
            // what sticks by more than it slides with may have the impulse of both
            let slides = rows.slides[a] && rows.stiction[a] > rows.friction[a];
            if size < rows.stiction[a] * l * (1.0 - 1e-12) && !slides {
                for r in (from + 1..=from + n_t).filter(|r| rows.own[a][4 * (r - from)] > 0.0) {
                    self.rows.push(r);
                    self.of.push(a);
                }
            }
        }
    }

    /// How far along the direction, up to `length`, all contacts keep their states.
    fn room(&self, rows: &Rows, length: f64) -> f64 {
        let mut room = length;
        let mut i = 0;
        while i < self.rows.len() {
            let (a, r) = (self.of[i], self.rows[i]);
            // of a joint the normal impulse is given, and stands in no row
            let given = rows.is_joint(a);
            let (l, dl) = if given { (rows.impulse[rows.first[a]], 0.0) } else { (rows.impulse[r], self.direction[i]) };
            if l + room * dl < 0.0 && rows.least(a) == 0.0 {
                room = -l / dl;
            }
            i += usize::from(!given);
            let tangents = i;
            while i < self.rows.len() && self.of[i] == a {
                i += 1;
            }
            if i > tangents {
                let mu = rows.stiction[a];
                let inside = |s: f64| {
                    let size = (tangents..i).map(|k| rows.impulse[self.rows[k]] + s * self.direction[k]);
                    size.fold(0.0, |h: f64, v| h.hypot(v)) <= mu * (l + s * dl)
                };
                if !inside(room) {
                    // the cone is convex and the start inside: halving finds where it is left
                    let (mut low, mut high) = (0.0, room);
                    for _ in 0..40 {
                        let middle = 0.5 * (low + high);
                        if inside(middle) {
                            low = middle;
                        } else {
                            high = middle;
                        }
                    }
                    room = low;
                }
            }
        }
        room
    }
}

/// Dry friction without a normal, solved exactly: the impulse that makes it stick, or that of sliding. Says whether it slides.
fn joint(w: f64, z: [f64; 3], rate: f64, [mu, sticks]: [f64; 2]) -> ([f64; 3], bool) {
    let held = z[1] - rate / w;
    if held.abs() <= sticks * z[0] {
        ([z[0], held, 0.0], false)
    } else {
        ([z[0], mu * z[0] * held.signum(), 0.0], true)
    }
}

/// A contact with friction in the plane, solved exactly: open, sticking, or sliding one way or the other. Says whether it slides.
fn planar(w: &[f64; 9], z: [f64; 3], rate: [f64; 3], [mu, sticks]: [f64; 2]) -> ([f64; 3], bool) {
    // rates without impulses of this contact
    let n = rate[0] - w[0] * z[0] - w[1] * z[1];
    let s = rate[1] - w[3] * z[0] - w[4] * z[1];
    if n >= 0.0 {
        return ([0.0; 3], false);
    }
    let det = w[0] * w[4] - w[1] * w[3];
    if det > 1e-14 * w[0] * w[4] {
        let (l, tau) = ((-n * w[4] + s * w[1]) / det, (n * w[3] - s * w[0]) / det);
        if l >= 0.0 && tau.abs() <= sticks * l {
            return ([l, tau, 0.0], false);
        }
    }
    for sign in [1.0, -1.0] {
        let along = w[0] - sign * mu * w[1];
        let l = -n / along;
        if along > 0.0 && sign * (s + (w[3] - sign * mu * w[4]) * l) >= 0.0 {
            return ([l, -sign * mu * l, 0.0], true);
        }
    }
    // none or rounding: normal and tangential impulse for themselves
    let l = -n / w[0];
    let tau = if w[4] > 0.0 { (-(s + w[3] * l) / w[4]).clamp(-mu * l, mu * l) } else { 0.0 };
    ([l, tau, 0.0], tau.abs() >= mu * l)
}

/// A contact with friction in space: sticking exactly, sliding by turns of normal and tangential impulses, the latter the least
/// point of a quadratic function in a disc. Says whether it slides.
fn spatial(w: &[f64; 9], z: [f64; 3], rate: [f64; 3], [mu, sticks]: [f64; 2]) -> ([f64; 3], bool) {
    let mut b = rate;
    for i in 0..3 {
        for j in 0..3 {
            b[i] -= w[3 * i + j] * z[j];
        }
    }
    if let Some(s) = solve3(w, b) {
        if s[0] >= 0.0 && s[1].hypot(s[2]) <= sticks * s[0] {
            return (s, false);
        }
    }
    let mut x = z;
    for _ in 0..20 {
        let l = (-(b[0] + w[1] * x[1] + w[2] * x[2]) / w[0]).max(0.0);
        let tau = in_disc([w[4], w[5], w[8]], [b[1] + w[3] * l, b[2] + w[6] * l], mu * l);
        let d = (l - x[0]).abs().max((tau[0] - x[1]).hypot(tau[1] - x[2]));
        x = [l, tau[0], tau[1]];
        if d <= 1e-15 * l {
            break;
        }
    }
    (x, true)
}

/// Solution of `W x = −b`, `W` symmetric; None if it is singular to working precision.
fn solve3(w: &[f64; 9], b: [f64; 3]) -> Option<[f64; 3]> {
    // Cholesky
    let l00 = w[0].sqrt();
    let (l10, l20) = (w[3] / l00, w[6] / l00);
    let d1 = w[4] - l10 * l10;
    if d1.is_nan() || d1 <= 1e-14 * w[4] {
        return None;
    }
    let l11 = d1.sqrt();
    let l21 = (w[7] - l20 * l10) / l11;
    let d2 = w[8] - l20 * l20 - l21 * l21;
    if d2.is_nan() || d2 <= 1e-14 * w[8] {
        return None;
    }
    let l22 = d2.sqrt();
    let y0 = -b[0] / l00;
    let y1 = (-b[1] - l10 * y0) / l11;
    let y2 = (-b[2] - l20 * y0 - l21 * y1) / l22;
    let x2 = y2 / l22;
    let x1 = (y1 - l21 * x2) / l11;
    let x0 = (y0 - l10 * x1 - l20 * x2) / l00;
    Some([x0, x1, x2])
}

/// Least point of `½ xᵀ A x + bᵀ x` in a disc, `A = [a0 a1; a1 a2]` not negative: `(A + ν) x = −b` with the least `ν ≥ 0` that
/// keeps `x` inside, by Newton's method on `1/‖x‖`, which is nearly straight in `ν`.
fn in_disc(a: [f64; 3], b: [f64; 2], radius: f64) -> [f64; 2] {
    let size = b[0].hypot(b[1]);
    if radius <= 0.0 || size == 0.0 {
        return [0.0; 2];
    }
    let at = |nu: f64| {
        let (p, q) = (a[0] + nu, a[2] + nu);
        let det = p * q - a[1] * a[1];
        (det, [(-b[0] * q + b[1] * a[1]) / det, (b[0] * a[1] - b[1] * p) / det], [p, q])
    };
    let trace = a[0] + a[2];
    let (det, x, _) = at(0.0);
    if det > 1e-14 * trace * trace && x[0].hypot(x[1]) <= radius {
        return x;
    }
    // between these the norm of x is the radius
    let mut nu = (size / radius - trace).max(1e-14 * trace);
    let mut x = [0.0; 2];
    for _ in 0..30 {
        let (det, y, [p, q]) = at(nu);
        x = y;
        let n = x[0].hypot(x[1]);
        // xᵀ (A + ν)⁻¹ x
        let c = (x[0] * x[0] * q - 2.0 * x[0] * x[1] * a[1] + x[1] * x[1] * p) / det;
        let step = (n / radius - 1.0) * n * n / c;
        if step.is_nan() || step.abs() <= 1e-15 * (nu + trace) {
            break;
        }
        nu = (nu + step).max(1e-14 * trace);
    }
    let n = x[0].hypot(x[1]);
    if n > 0.0 {
        [x[0] * radius / n, x[1] * radius / n]
    } else {
        [-b[0] * radius / size, -b[1] * radius / size]
    }
}

/// The impulse of one contact that meets no others; its normal impulse is not below `least`.
pub(super) fn alone(w: &[f64; 9], rate: [f64; 3], mu: f64, (n_tangents, least): (usize, f64)) -> [f64; 3] {
    match n_tangents {
        0 => [(-rate[0] / w[0]).max(least), 0.0, 0.0],
        1 => planar(w, [0.0; 3], rate, [mu; 2]).0,
        _ => spatial(w, [0.0; 3], rate, [mu; 2]).0,
    }
}
