//! The velocity where surfaces of one subsystem meet and Filippov's convex combinations are a continuum.
//!
//! On the intersection of `m` surfaces `ψ_1 = … = ψ_m = 0` the `2^m` modes around it have weights `θ_c ≥ 0` with the sum 1, and
//! only `m` equations `ψ̇_j = 0` say what they are: where the effects of the surfaces multiply the velocity is not unique. A rule
//! ([`Selection`]) takes one that changes smoothly along the intersection:
//!
//! - **bilinear** (the canopy): `θ_c` is a product of one weight of every surface, `z_j` for one side of it and `1 − z_j` for the
//!   other. It is what independent smoothings of the surfaces lead to, and what the Heaviside form (6.44) says (J. C. Alexander,
//!   T. I. Seidman, *Sliding modes in intersecting switching surfaces*, Houston J. Math. 24 (1998) 545-569; L. Dieci, L. Lopez,
//!   *Sliding motion on discontinuity surfaces of high co-dimension*, Numer. Math. 117 (2011) 779-811);
//! - **moments**: of two surfaces, `Σ_c ±δ_c θ_c = 0` with the sign of the product of the two signs of a mode and `δ_c` the norm of
//!   its rates (L. Dieci, F. Difonzo, *The moments sliding vector field on the intersection of two manifolds*, J. Dyn. Diff. Equat.
//!   29 (2017) 169-201). The rates of every surface are divided by the root of the sum of their squares over the modes, so that the
//!   answer does not depend on the factor that a surface is written with;
//! - **norm**: the weights of the least Euclidean norm.
//!
//! The first two leave the intersection without a jump of the velocity where one surface stops to attract, generically. Subsystems
//! that slide at the same time and touch this one have their equations in the same system. The conditions `ψ̇_j = 0` are those of the
//! pairs of cells that differ in the sign of one surface: rows of [`Sliding`] that are there already.

use super::{Field, Pair, Sliding};
use crate::event::Selection;
use crate::func::{EvalError, EvalResult};
use crate::linalg::lu::Lu;

/// Newton iterations for the weights of the surfaces, and the change that ends them.
const ITERATIONS: usize = 40;
const CONVERGED: f64 = 1e-15;
/// Steps of the central differences of weights, relative to the size of an input.
const DIFFERENCE: f64 = 6e-6;

/// The cells of one subsystem that slide.
struct Group {
    /// Its pairs, among those of the intersection, and the unknowns and equations of its surfaces.
    pairs: std::ops::Range<usize>,
    surfaces: std::ops::Range<usize>,
    /// By pair, the surfaces on whose other side its cell lies than the base, as bits; empty where weights are unique.
    sides: Vec<u32>,
}

/// Subsystems that slide and touch, one of them at least with a choice.
#[derive(Default)]
struct Intersection {
    pairs: Vec<usize>,
    /// The pairs whose constraints are those of the surfaces, by their places in `pairs`.
    rows: Vec<usize>,
    groups: Vec<Group>,
    /// Rates of the surfaces under the base, and what every pair adds to them: one row of `pairs.len()` numbers for every surface.
    own: Vec<f64>,
    by: Vec<f64>,
    /// Weights of the surfaces, and of the pairs.
    z: Vec<f64>,
    alpha: Vec<f64>,
    /// Those of the iteration before.
    last: Vec<f64>,
    /// Derivatives of the weights of the pairs by those of the surfaces, as rows.
    slopes: Vec<f64>,
    rhs: Vec<f64>,
    lu: Lu<f64>,
}

/// The intersections of the present active set, with their memory.
pub(in crate::event) struct Selected {
    rule: Selection,
    all: Vec<Intersection>,
}

impl Group {
    /// The weight of the cell with these `sides` is a product with one factor for every surface; without the factor of surface
    /// `but` it is, up to its sign, the derivative by the weight of that one.
    fn product(&self, sides: u32, z: &[f64], but: Option<usize>) -> f64 {
        let own = z[self.surfaces.clone()].iter().enumerate();
        own.map(|(j, z)| match (sides >> j & 1 == 1, but == Some(j)) {
            (true, false) => *z,
            (false, false) => 1.0 - z,
            (true, true) => 1.0,
            (false, true) => -1.0,
        })
        .product()
    }
}

impl Intersection {
    /// Evaluates rates from the matrices of the sliding mode; every surface is measured by its largest one.
    fn rates(&mut self, sliding: &Sliding, pairs: &[Pair], base: &[f64]) {
        let n = self.pairs.len();
        for (e, &row) in self.rows.iter().enumerate() {
            let i = self.pairs[row];
            let by = &mut self.by[e * n..(e + 1) * n];
            self.own[e] = sliding.rate(pairs[i], i, base);
            by.iter_mut().zip(&self.pairs).for_each(|(v, &j)| *v = sliding.entry(pairs, i, j));
            let most = by.iter().fold(self.own[e].abs(), |m, v| m.max(v.abs()));
            if most > 0.0 {
                self.own[e] /= most;
                by.iter_mut().for_each(|v| *v /= most);
            }
        }
    }

    /// Weights of the pairs by the rule, written to `alpha`; false where there are none.
    fn solve(&mut self, rule: Selection) -> bool {
        let found = match rule {
            Selection::Moments => self.moments(),
            Selection::Norm => self.norm(),
            Selection::Bilinear | Selection::Fewest => self.bilinear(),
        };
        found && self.alpha.iter().all(|v| v.is_finite())
    }

    /// By Newton's method from the last weights, then from the middle, then from next to the corners; weights between 0 and 1 are
    /// preferred to others.
    fn bilinear(&mut self) -> bool {
        const CORNERS: usize = 4;
        let m = self.rows.len();
        let inside = |z: &[f64]| z.iter().all(|z| (-1e-9..=1.0 + 1e-9).contains(z));
        if self.newton() && inside(&self.z) {
            return true;
        }
        let mut outside =
            self.z.iter().all(|z| z.is_finite()).then(|| self.z.clone()).filter(|_| self.residual() < 1e-9);
        let starts = if m <= CORNERS { 1usize << m } else { 0 };
        for start in 0..=starts {
            let near = |j: usize| match start {
                0 => 0.5,
                s if (s - 1) >> j & 1 == 1 => 0.9,
                _ => 0.1,
            };
            self.z.iter_mut().enumerate().for_each(|(j, z)| *z = near(j));
            if !self.newton() {
                continue;
            }
            if inside(&self.z) {
                return true;
            }
            // behind an exit the weights go on smoothly
            outside.get_or_insert_with(|| self.z.clone());
        }
        match outside {
            Some(z) => {
                self.z = z;
                self.expand();
                true
            }
            None => {
                self.z.fill(0.5);
                false
            }
        }
    }

    /// Weights of the pairs and their derivatives by those of the surfaces.
    fn expand(&mut self) {
        let m = self.rows.len();
        self.slopes.fill(0.0);
        for g in &self.groups {
            for (i, at) in g.pairs.clone().enumerate() {
                let Some(&sides) = g.sides.get(i) else {
                    let own = g.surfaces.start + i;
                    self.alpha[at] = self.z[own];
                    self.slopes[at * m + own] = 1.0;
                    continue;
                };
                self.alpha[at] = g.product(sides, &self.z, None);
                for (j, own) in g.surfaces.clone().enumerate() {
                    self.slopes[at * m + own] = g.product(sides, &self.z, Some(j));
                }
            }
        }
    }

    /// Largest rate of a surface with the present weights of the pairs, relative to its modes.
    fn residual(&mut self) -> f64 {
        let n = self.pairs.len();
        self.expand();
        let rate = |e: usize| self.own[e] + (0..n).map(|l| self.by[e * n + l] * self.alpha[l]).sum::<f64>();
        (0..self.rows.len()).fold(0.0, |m, e| m.max(rate(e).abs()))
    }

    fn newton(&mut self) -> bool {
        /// Weights are between 0 and 1: a change this large leads nowhere.
        const FAR: f64 = 1e6;
        let (n, m) = (self.pairs.len(), self.rows.len());
        let mut before = f64::INFINITY;
        for _ in 0..ITERATIONS {
            self.expand();
            let matrix = self.lu.clear(m);
            for e in 0..m {
                let by = &self.by[e * n..(e + 1) * n];
                self.rhs[e] = -self.own[e] - by.iter().zip(&self.alpha).map(|(b, a)| b * a).sum::<f64>();
                for (l, b) in by.iter().enumerate().filter(|(_, b)| **b != 0.0) {
                    let slopes = &self.slopes[l * m..(l + 1) * m];
                    matrix[e * m..(e + 1) * m].iter_mut().zip(slopes).for_each(|(v, s)| *v += b * s);
                }
            }
            if !self.lu.factorise() {
                return false;
            }
            self.lu.solve(&mut self.rhs[..m]);
            let size = self.rhs[..m].iter().fold(0.0f64, |s, v| s.max(v.abs()));
            if size.is_nan() || size > FAR {
                return false;
            }
            self.z.iter_mut().zip(&self.rhs).for_each(|(z, d)| *z += d);
            if size <= CONVERGED || size <= 1e-13 && size >= 0.5 * before {
                self.expand();
                return true;
            }
            before = size;
        }
        false
    }

    /// `Σ ±δ θ = 0` for every subsystem with two surfaces. Where subsystems touch, `δ` depends on the weights of the others, and is
    /// found by iteration.
    fn moments(&mut self) -> bool {
        let (n, m) = (self.pairs.len(), self.rows.len());
        let mut before = f64::INFINITY;
        for _ in 0..ITERATIONS {
            self.last.copy_from_slice(&self.alpha);
            let last = &self.last;
            let matrix = self.lu.clear(n);
            matrix[..m * n].copy_from_slice(&self.by);
            self.rhs[..m].iter_mut().zip(&self.own).for_each(|(r, o)| *r = -o);
            for (at, g) in self.groups.iter().filter(|g| !g.sides.is_empty()).enumerate() {
                // rates of both surfaces under the base and under the cells of the three pairs
                let mut distance = [0.0; 4];
                for e in g.surfaces.clone() {
                    let by = &self.by[e * n..(e + 1) * n];
                    let others = (0..n).filter(|l| !g.pairs.contains(l));
                    let base = self.own[e] + others.map(|l| by[l] * last[l]).sum::<f64>();
                    let mut rates = [base; 4];
                    rates[1..].iter_mut().zip(&by[g.pairs.clone()]).for_each(|(r, b)| *r += b);
                    let all: f64 = rates.iter().map(|r| r * r).sum();
                    distance.iter_mut().zip(rates).for_each(|(d, r)| *d += if all > 0.0 { r * r / all } else { 0.0 });
                }
                let [base, others @ ..] = distance.map(f64::sqrt);
                let row = &mut matrix[(m + at) * n..(m + at + 1) * n];
                for ((v, d), sides) in row[g.pairs.clone()].iter_mut().zip(others).zip(&g.sides) {
                    *v = if sides.count_ones() % 2 == 0 { d } else { -d } - base;
                }
                self.rhs[m + at] = -base;
            }
            if !self.lu.factorise() {
                return false;
            }
            self.lu.solve(&mut self.rhs[..n]);
            self.alpha.copy_from_slice(&self.rhs[..n]);
            let change = self.alpha.iter().zip(&self.last).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
            if self.groups.len() == 1 || change <= CONVERGED || change <= 1e-13 && change >= 0.5 * before {
                return true;
            }
            before = change;
        }
        false
    }

    /// Least `Σ θ²` under the conditions, by its optimality conditions.
    fn norm(&mut self) -> bool {
        let (n, m) = (self.pairs.len(), self.rows.len());
        let order = n + m;
        let matrix = self.lu.clear(order);
        for g in &self.groups {
            for i in g.pairs.clone() {
                // the weight of the base is what the others leave
                matrix[i * order..][g.pairs.clone()].fill(1.0);
                matrix[i * order + i] += 1.0;
            }
        }
        for e in 0..m {
            for l in 0..n {
                matrix[(n + e) * order + l] = self.by[e * n + l];
                matrix[l * order + n + e] = self.by[e * n + l];
            }
        }
        self.rhs[..n].fill(1.0);
        self.rhs[n..order].iter_mut().zip(&self.own).for_each(|(r, o)| *r = -o);
        if !self.lu.factorise() {
            return false;
        }
        self.lu.solve(&mut self.rhs[..order]);
        self.alpha.copy_from_slice(&self.rhs[..n]);
        true
    }

    /// Replaces the values of the constraints in `values` by the least changes of the weights that bring them about.
    fn least_changes(&mut self, sliding: &Sliding, pairs: &[Pair], values: &mut [f64]) -> bool {
        let (n, m) = (self.pairs.len(), self.rows.len());
        for (e, &row) in self.rows.iter().enumerate() {
            let i = self.pairs[row];
            let by = self.by[e * n..(e + 1) * n].iter_mut();
            by.zip(&self.pairs).for_each(|(v, &j)| *v = sliding.entry(pairs, i, j));
            self.rhs[e] = values[i];
        }
        let matrix = self.lu.clear(m);
        for (e, f) in (0..m).flat_map(|e| (0..m).map(move |f| (e, f))) {
            let (a, b) = (&self.by[e * n..(e + 1) * n], &self.by[f * n..(f + 1) * n]);
            matrix[e * m + f] = a.iter().zip(b).map(|(a, b)| a * b).sum();
        }
        if !self.lu.factorise() {
            return false;
        }
        self.lu.solve(&mut self.rhs[..m]);
        for (l, &i) in self.pairs.iter().enumerate() {
            values[i] = (0..m).map(|e| self.by[e * n + l] * self.rhs[e]).sum();
        }
        true
    }
}

impl Field {
    /// How many surfaces of subsystem `k` meet where these cells do, if the cells are all that surround their intersection and there
    /// are more of them than the surfaces determine the weights of.
    pub(in crate::event) fn meeting_surfaces(&self, k: usize, cells: &[usize]) -> Option<usize> {
        let s = self.subs.get(k).filter(|s| s.signs && cells.len() >= 4 && cells.len().is_power_of_two())?;
        let m = (0..s.n_q).filter(|j| self.ties(k, cells, *j)).count();
        (1usize.checked_shl(u32::try_from(m).ok()?) == Some(cells.len())).then_some(m)
    }

    /// Are there cells on both sides of surface `j` of subsystem `k` among these?
    pub(in crate::event) fn ties(&self, k: usize, cells: &[usize], j: usize) -> bool {
        let s = &self.subs[k];
        let w = |c: usize| s.cells[c - s.first].weights[j];
        cells.iter().any(|c| w(*c) != w(cells[0]))
    }

    /// Is the present mode one whose weights a rule has selected?
    pub(in crate::event) fn is_selected(&self) -> bool {
        self.selected.is_some() && self.limit.is_none()
    }

    /// Is the present mode one that explicit pairs alone integrate: its weights are no solution of a linear system with `C D`?
    pub(in crate::event) fn is_explicit_only(&self) -> bool {
        self.selected.is_some() || self.limit.is_some()
    }

    /// Finds the intersections of the present active set where a rule has to select weights; its pairs are laid out.
    pub(super) fn find_intersections(&mut self) {
        self.selected = None;
        if self.selection == Selection::Fewest || self.active.iter().all(|set| set.len() < 4) {
            return;
        }
        let surfaces: Vec<Option<usize>> =
            self.active.iter().enumerate().map(|(k, set)| self.meeting_surfaces(k, set)).collect();
        let mut all = Vec::new();
        for block in 0..self.sliding.n_blocks() {
            let pairs = self.sliding.pairs_of(block);
            let choice = |i: &usize| surfaces[self.pairs[*i].sub];
            let Some(most) = pairs.iter().filter_map(choice).max() else { continue };
            if self.selection == Selection::Moments && most > 2 {
                continue;
            }
            all.push(self.intersection(pairs.to_vec(), &surfaces));
            self.sliding.leave_out(block);
        }
        if !all.is_empty() {
            self.selected = Some(Box::new(Selected { rule: self.selection, all }));
        }
    }

    /// Lays out the intersection of the subsystems with these pairs.
    fn intersection(&self, pairs: Vec<usize>, surfaces: &[Option<usize>]) -> Intersection {
        let mut it = Intersection { pairs, ..Intersection::default() };
        let mut at = 0;
        while at < it.pairs.len() {
            let k = self.pairs[it.pairs[at]].sub;
            let end = it.pairs.partition_point(|i| self.pairs[*i].sub <= k);
            let first = it.rows.len();
            let mut sides = Vec::new();
            if surfaces[k].is_some() {
                let s = &self.subs[k];
                let tied: Vec<usize> = (0..s.n_q).filter(|j| self.ties(k, &self.active[k], *j)).collect();
                for i in &it.pairs[at..end] {
                    let p = self.pairs[*i];
                    let (w, w0) = (&s.cells[p.cell - s.first].weights, &s.cells[p.base - s.first].weights);
                    let other = tied.iter().enumerate().filter(|(_, j)| w[**j] != w0[**j]);
                    sides.push(other.fold(0u32, |bits, (n, _)| bits | 1 << n));
                }
                for j in 0..tied.len() {
                    it.rows.extend(sides.iter().position(|s| *s == 1 << j).map(|i| at + i));
                }
            } else {
                it.rows.extend(at..end);
            }
            it.groups.push(Group { pairs: at..end, surfaces: first..it.rows.len(), sides });
            at = end;
        }
        let (n, m) = (it.pairs.len(), it.rows.len());
        it.own = vec![0.0; m];
        it.by = vec![0.0; n * m];
        it.z = vec![0.5; m];
        it.alpha = vec![0.0; n];
        it.last = vec![0.0; n];
        it.slopes = vec![0.0; n * m];
        it.rhs = vec![0.0; n + m];
        it
    }

    /// Weights of the intersections at the last point of `b`, `D` and `C`.
    pub(super) fn select_weights(&mut self) -> EvalResult {
        let Some(s) = &mut self.selected else { return Ok(()) };
        for it in &mut s.all {
            it.rates(&self.sliding, &self.pairs, &self.base);
            if !it.solve(s.rule) {
                return Err(EvalError::Recoverable);
            }
            it.pairs.iter().zip(&it.alpha).for_each(|(&i, a)| self.alpha[i] = *a);
        }
        Ok(())
    }

    /// Part of [`Field::project`]: what moves the state back onto the intersections, from the constraints in `room`.
    pub(super) fn return_to_intersections(&mut self) {
        let Some(s) = &mut self.selected else { return };
        for it in &mut s.all {
            if !it.least_changes(&self.sliding, &self.pairs, &mut self.room) {
                it.pairs.iter().for_each(|&i| self.room[i] = 0.0);
            }
        }
    }

    /// Derivatives of the weights of the pairs by the inputs, `n_alg × n_z`, by central differences: the rules know rates of modes,
    /// and their derivatives would be those of every mode by itself.
    fn slopes_of_weights(&mut self, t: f64, x: &[f64], velocity: &[f64]) -> Result<Vec<f64>, EvalError> {
        let (r, n_z, nx, np) = (self.pairs.len(), self.n_z, self.nx, self.p.len());
        let mut out = vec![0.0; r * n_z];
        let mut y = x.to_vec();
        let pace = self.pace(x, velocity);
        let mut jac = vec![0.0; nx * n_z];
        let alpha = self.alpha.clone();
        self.jacobian_of_weights(t, x, &alpha, &mut jac)?;
        for c in 0..n_z {
            let size = match c {
                c if c < nx => Some(self.size(c, x[c])).filter(|s| *s > 0.0).unwrap_or(1.0),
                c if c < nx + np => self.size_of_input(self.p[c - nx], pace, x, |i| jac[i * n_z + c]),
                c if c < n_z - 1 => self.size_of_input(self.u[c - nx - np], pace, x, |i| jac[i * n_z + c]),
                _ if pace > 0.0 => 1.0 / pace,
                _ => continue,
            };
            let h = DIFFERENCE * size;
            for sign in [1.0, -1.0] {
                let mut time = t;
                let value = match c {
                    c if c < nx => &mut y[c],
                    c if c < nx + np => &mut self.p[c - nx],
                    c if c < n_z - 1 => &mut self.u[c - nx - np],
                    _ => &mut time,
                };
                let held = *value;
                *value += sign * h;
                if c >= nx {
                    self.forget();
                }
                let known = self.hidden(time, &y);
                match c {
                    c if c < nx => y[c] = held,
                    c if c < nx + np => self.p[c - nx] = held,
                    c if c < n_z - 1 => self.u[c - nx - np] = held,
                    _ => {}
                }
                if c >= nx {
                    self.forget();
                }
                known?;
                (0..r).for_each(|i| out[i * n_z + c] += sign * self.alpha[i] / (2.0 * h));
            }
        }
        Ok(out)
    }

    /// Size of a parameter or control for differences: its value, or, where that is zero or next to it, the change that changes
    /// the velocity of some state by as much as moves the state by its size in the time of `pace`; `column` has the derivatives
    /// of the velocities. What neither has a value nor moves anything has no size of its own.
    fn size_of_input(&self, value: f64, pace: f64, x: &[f64], column: impl Fn(usize) -> f64) -> f64 {
        let share = |i: usize| column(i).abs() / (pace * self.size(i, x[i]));
        let most = (0..self.nx).map(share).filter(|s| s.is_finite()).fold(0.0f64, f64::max);
        let natural = if most > 0.0 { 1.0 / most } else { 0.0 };
        match value.abs() {
            own if own > DIFFERENCE * natural => own,
            _ if natural > 0.0 => natural,
            _ => 1.0,
        }
    }

    /// Jacobian of the right-hand side under a rule, row-major `nx × n_z`.
    pub(super) fn selected_jacobian(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> EvalResult {
        let slopes = self.selected_slopes(t, x)?;
        let alpha = self.alpha.clone();
        self.jacobian_of_weights(t, x, &alpha, out)?;
        let n_z = self.n_z;
        for (i, slopes) in slopes.chunks_exact(n_z).enumerate() {
            for (row, d) in self.sliding.column(self.pairs[i], i) {
                out[row * n_z..(row + 1) * n_z].iter_mut().zip(slopes).for_each(|(o, s)| *o += d * s);
            }
        }
        Ok(())
    }

    /// [`Field::slopes_of_weights`], and the weights themselves with all they are made of.
    fn selected_slopes(&mut self, t: f64, x: &[f64]) -> Result<Vec<f64>, EvalError> {
        self.hidden(t, x)?;
        let mut velocity = vec![0.0; self.nx];
        self.combine(&mut velocity);
        let slopes = self.slopes_of_weights(t, x, &velocity)?;
        self.hidden(t, x)?;
        Ok(slopes)
    }

    /// Gradient of the weight of an active cell under a rule.
    pub(super) fn selected_theta_gradient(&mut self, cell: usize, t: f64, x: &[f64], out: &mut [f64]) -> EvalResult {
        let slopes = self.selected_slopes(t, x)?;
        out.fill(0.0);
        let k = self.owner[cell];
        for (i, slopes) in slopes.chunks_exact(self.n_z).enumerate() {
            let p = self.pairs[i];
            let factor = match (p.cell == cell, p.sub == k && p.base == cell) {
                (true, _) => 1.0,
                (_, true) => -1.0,
                _ => continue,
            };
            out.iter_mut().zip(slopes).for_each(|(o, s)| *o += factor * s);
        }
        Ok(())
    }
}
