//! Bounds of the discretised problem: relaxed, with an active set for every element, and with free signs.

use super::problem::Fesd;
use crate::func::Point;
use crate::mpcc::{Mpcc, Side};
use crate::nlp::Bounds;

/// A multiplier with the wrong sign.
#[derive(Debug, Clone, Copy)]
pub struct Violation<'a> {
    /// Element.
    pub element: usize,
    /// Cell.
    pub cell: usize,
    /// `θ` or `λ`?
    pub of_theta: bool,
    /// State there.
    pub x: &'a [f64],
    /// Time there, where the model has a clock.
    pub t: Option<f64>,
}

/// What ends a sliding mode inside a control stage in the branch problem.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// The multiplier that grows afterwards starts with zero slope: never leaves `λ < 0` behind.
    Slope,
    /// `θ = 0` at the end of the element, for methods with a stage point there or at the start: more accurate exit times,
    /// but `λ` may fall below zero by the error of the method behind it. Other methods use the slope.
    Theta,
}

impl Exit {
    /// The other way.
    pub fn other(self) -> Exit {
        match self {
            Exit::Slope => Exit::Theta,
            Exit::Theta => Exit::Slope,
        }
    }
}

/// Value of a constraint at an initial state, relative to what the state is of it, that counts as zero: the tolerance of a solve.
const SETTLED: f64 = 1e-8;

impl Fesd {
    /// Chooses what ends a sliding mode.
    pub fn set_exit(&mut self, exit: Exit) {
        self.exit = exit;
    }

    /// What ends a sliding mode.
    pub fn exit(&self) -> Exit {
        self.exit
    }

    /// What ends a sliding mode best with this method: the slope, but for two stages of which the first is at the start,
    /// whose slope is a secant over the whole element.
    pub fn usual_exit(&self) -> Exit {
        let t = &self.tableau;
        if t.n_s == 2 && t.c[0] == 0.0 && t.c[1] > 0.5 {
            Exit::Theta
        } else {
            Exit::Slope
        }
    }

    /// Bounds of the relaxed problem: signs of the multipliers, step sizes, rows. States, controls and the
    /// initial value are left free for the caller.
    pub fn bounds(&self) -> Bounds {
        let l = &self.l;
        let mut b = Bounds::free(l.n, l.m);
        b.cl.fill(0.0);
        b.cu.fill(0.0);
        let nonneg = |b: &mut Bounds, from: usize| b.xl[from..from + l.n_cells].fill(0.0);
        for s in &l.starts {
            let [cells, mus] = s.members(self.spec.dcs.form());
            if !s.whole {
                b.xu[s.lambda..s.lambda + l.n_cells].fill(0.0);
                b.xl[s.mu..s.mu + l.n_mu].fill(0.0);
                b.xu[s.mu..s.mu + l.n_mu].fill(0.0);
            }
            nonneg(&mut b, s.lambda);
            cells.into_iter().for_each(|c| b.xu[s.lambda + c] = f64::INFINITY);
            for m in mus {
                (b.xl[s.mu + m], b.xu[s.mu + m]) = (f64::NEG_INFINITY, f64::INFINITY);
            }
        }
        for e in &l.elements {
            for i in 0..e.x.len() {
                nonneg(&mut b, e.theta[i]);
                nonneg(&mut b, e.lambda[i]);
            }
            if let Some(j) = e.lambda_end {
                nonneg(&mut b, j);
            }
            if e.row_sum_lambda.is_some() {
                nonneg(&mut b, e.sum_lambda);
            }
            if l.sums {
                nonneg(&mut b, e.sum_theta);
            }
            let slopes = e.row_slope.map_or(0..0, |r| r..r + l.n_cells);
            let weights = e.row_first.into_iter().chain(e.row_last).flat_map(|r| r..r + l.n_cells);
            for i in slopes.chain(weights).chain(e.row_equal) {
                b.cl[i] = f64::NEG_INFINITY;
                b.cu[i] = f64::INFINITY;
            }
        }
        for (_, v) in self.members() {
            b.xl[v] = 0.0;
        }
        self.write_durations(&mut b);
        let mut rows = l.row_path.iter();
        for p in &self.spec.path {
            for &r in rows.by_ref().take(p.at.n_points(&self.spec.n_fe, self.tableau.n_s)) {
                b.cl[r..r + p.lower.len()].copy_from_slice(&p.lower);
                b.cu[r..r + p.upper.len()].copy_from_slice(&p.upper);
            }
        }
        for (i, &r) in self.spec.inside.iter().zip(rows) {
            let p = &self.spec.path[i.path];
            b.cl[r..r + p.lower.len()].copy_from_slice(&p.lower);
            b.cu[r..r + p.upper.len()].copy_from_slice(&p.upper);
        }
        for (t, &r) in self.spec.terminal.iter().zip(&l.row_terminal) {
            b.cl[r..r + t.lower.len()].copy_from_slice(&t.lower);
            b.cu[r..r + t.upper.len()].copy_from_slice(&t.upper);
        }
        for (t, &r) in self.spec.boundary.iter().zip(&l.row_boundary) {
            b.cl[r..r + t.lower.len()].copy_from_slice(&t.lower);
            b.cu[r..r + t.upper.len()].copy_from_slice(&t.upper);
        }
        b
    }

    /// Lets the multipliers that are not fixed take any sign: with an active set for every element the equations
    /// are square, and the signs show where that set is wrong. The multipliers at a given initial value follow
    /// from it: a value that is on a switching surface up to rounding would contradict `λ_{0,0} = 0`.
    pub fn free_signs(&self, b: &mut Bounds) {
        let l = &self.l;
        if let Some(first) = l.starts.first() {
            // one active cell per subsystem keeps λ = 0: it says what μ is
            for cells in &self.spec.dcs.form().simplices {
                let cells = first.lambda + cells.start..first.lambda + cells.end;
                let pinned = cells.clone().find(|&j| b.xu[j] == 0.0);
                for j in cells.filter(|&j| Some(j) != pinned) {
                    b.xl[j] = f64::NEG_INFINITY;
                    b.xu[j] = f64::INFINITY;
                }
            }
            for c in self.spec.dcs.form().multipliers.iter().cloned().flatten() {
                b.xl[first.lambda + c] = f64::NEG_INFINITY;
                b.xu[first.lambda + c] = f64::INFINITY;
            }
            if l.elements[0].row_sum_lambda.is_some() {
                let j = l.elements[0].sum_lambda;
                b.xu[j..j + l.n_cells].fill(f64::INFINITY);
            }
        }
        let mut free = |from: usize| {
            for j in (from..from + l.n_cells).filter(|&j| b.xu[j] != 0.0) {
                b.xl[j] = f64::NEG_INFINITY;
            }
        };
        l.starts.iter().skip(1).for_each(|s| free(s.lambda));
        for e in &l.elements {
            e.theta.iter().chain(&e.lambda).chain(&e.lambda_end).for_each(|&j| free(j));
            if e.row_sum_lambda.is_some() {
                free(e.sum_lambda);
            }
            if l.sums {
                free(e.sum_theta);
            }
        }
    }

    /// Decisions about what switches; those of path complementarities are behind them.
    pub fn n_element_groups(&self) -> usize {
        self.l.n_groups - self.path_pairs().count()
    }

    /// Which side of every path complementarity is smaller at a point, in the order of their groups.
    pub fn member_sides<'a>(&'a self, w: &'a [f64]) -> impl Iterator<Item = Side> + 'a {
        self.path_pairs().map(|(&(a, b), _)| if w[a] <= w[b] { Side::First } else { Side::Second })
    }

    /// Pairs of path complementarities and their groups.
    fn path_pairs(&self) -> impl Iterator<Item = (&(usize, usize), &usize)> {
        let n: usize = self.complementarity.iter().map(|c| self.functions[c.f].n_out() / 2).sum();
        self.l.pairs.iter().zip(&self.l.groups).skip(self.l.pairs.len() - n)
    }

    /// Is the end of an element off the surface of a sliding mode by the error of the method? The stages determine the
    /// weights of such a mode; that the end lies on the surface too would be one equation too many, but for surfaces the
    /// method follows exactly.
    pub fn drifts(&self) -> bool {
        !self.tableau.stiffly_accurate() && self.tableau.a_inv.is_some()
    }

    /// Does the first stage point of an element say anything about its sliding mode? It repeats the start where it is the
    /// start itself, and a method whose last stage moves no other has one equation too many in the stage points: it holds
    /// the mode by those behind the first and by the end.
    fn first_counts(&self) -> bool {
        self.tableau.c[0] > 0.0 || self.tableau.a_inv.is_some()
    }

    /// Is the first stage point at the start? The multipliers there have their signs at the end of the element before, and
    /// at the stage point up to its error only: where the start is on a surface, or was shortly before, it may lie on
    /// either side.
    fn first_repeats(&self) -> bool {
        self.tableau.c[0] == 0.0
    }

    /// The first `λ` below `-tol_lambda` or `θ` below `-tol_theta` in the order of time: element, cell, and whether it is a `θ`; with the
    /// states at that point.
    ///
    /// The `θ` that ends a sliding mode according to `sides` is left out at the end of its element; those at the very end
    /// have the tolerance `tol_end`: a mode may leave there, or begin to.
    pub fn first_violation<'a>(
        &self,
        w: &'a [f64],
        sides: &[Side],
        tol_lambda: f64,
        tol_theta: f64,
        tol_end: f64,
    ) -> Option<Violation<'a>> {
        let (l, nx) = (&self.l, self.spec.dcs.dims().x);
        for (element, e) in l.elements.iter().enumerate() {
            let ends = e.lambda_end.map(|lam| (e.x_end, None, lam));
            let stages = (0..e.x.len()).map(|i| (e.x[i], Some(e.theta[i]), e.lambda[i]));
            let last = e.theta.last().copied();
            for (x, theta, lambda) in stages.chain(ends) {
                for cell in 0..l.n_cells {
                    let next = sides.get((element + 1) * l.n_cells + cell);
                    let at_end = theta == last;
                    let theta = theta.filter(|_| !at_end || next != Some(&Side::Second));
                    let tol_theta = if at_end && next.is_none() { tol_end } else { tol_theta };
                    let of_theta = theta.is_some_and(|j| w[j + cell] < -tol_theta);
                    // the end of a sliding mode may drift to either side
                    let drift = self.drifts() && Some(lambda) == e.lambda_end && {
                        sides[element * l.n_cells + cell] == Side::First
                    };
                    let first = lambda == e.lambda[0] && {
                        let slides = sides[element * l.n_cells + cell] == Side::First && !self.first_counts();
                        slides || self.first_repeats() && sides[element * l.n_cells + cell] == Side::Second
                    };
                    if of_theta || w[lambda + cell] < -tol_lambda && !drift && !first {
                        let t = self.spec.dcs.clock().map(|c| w[x + c]);
                        return Some(Violation { element, cell, of_theta, x: &w[x..x + nx], t });
                    }
                }
            }
        }
        None
    }

    /// State at the start of an element, and the time where the model has a clock.
    pub fn start_of<'a>(&self, element: usize, w: &'a [f64]) -> (&'a [f64], Option<f64>) {
        let x = self.l.elements[element].x_start;
        (&w[x..x + self.spec.dcs.dims().x], self.spec.dcs.clock().map(|c| w[x + c]))
    }

    /// Rewrites the bounds that depend on the lengths of the control stages.
    pub fn write_durations(&self, b: &mut Bounds) {
        let g = self.spec.options.gamma_h;
        for e in &self.l.elements {
            let Some(j) = e.h else { continue };
            let h = self.h_nominal(e.stage);
            let (lower, upper) = if self.free_length(e.stage).is_none() {
                ((1.0 - g) * h, if self.spec.n_fe[e.stage] == 1 { f64::INFINITY } else { (1.0 + g) * h })
            } else {
                (0.0, f64::INFINITY)
            };
            b.xl[j] = lower;
            b.xu[j] = upper;
            if let Some(r) = e.row_range {
                (b.cu[r], b.cl[r + 1]) = (f64::INFINITY, f64::NEG_INFINITY);
            }
        }
        for (k, &r) in self.l.row_time.iter().enumerate() {
            let length = if self.free_length(k).is_some() { 0.0 } else { self.durations[k] };
            b.cl[r] = length;
            b.cu[r] = length;
        }
    }

    /// Sets bounds of the length of stage `k` where it is a variable of its own, of the horizon where only that is one.
    pub fn bound_duration(&self, b: &mut Bounds, k: usize, lower: f64, upper: f64) {
        if let Some(v) = self.l.time[k] {
            b.xl[v] = lower;
            b.xu[v] = upper;
        }
    }

    /// Sets bounds of parameter `j` where it is a variable.
    pub fn bound_param(&self, b: &mut Bounds, j: usize, lower: f64, upper: f64) {
        if let Some(v) = self.l.params[j] {
            b.xl[v] = lower;
            b.xu[v] = upper;
        }
    }

    /// Sets bounds of all user states along the horizon, the initial value excepted.
    pub fn bound_states(&self, b: &mut Bounds, lower: &[f64], upper: &[f64]) {
        for e in &self.l.elements {
            let ends = e.row_end.map(|_| e.x_end);
            for &x in e.x.iter().chain(&ends) {
                b.xl[x..x + lower.len()].copy_from_slice(lower);
                b.xu[x..x + upper.len()].copy_from_slice(upper);
            }
        }
    }

    /// Sets bounds of the initial value; `t0` is the clock, if there is one. Algebraic states that their equations
    /// determine stay free.
    pub fn bound_initial(&self, b: &mut Bounds, lower: &[f64], upper: &[f64], t0: f64) {
        let x = self.l.x0;
        b.xl[x..x + lower.len()].copy_from_slice(lower);
        b.xu[x..x + upper.len()].copy_from_slice(upper);
        if self.l.row_z0.is_some() {
            for r in self.l.z.clone() {
                b.xl[x + r] = f64::NEG_INFINITY;
                b.xu[x + r] = f64::INFINITY;
            }
        }
        if let Some(c) = self.spec.dcs.clock() {
            b.xl[x + c] = t0;
            b.xu[x + c] = t0;
        }
        if lower == upper && !self.spec.dcs.form().multipliers.is_empty() {
            self.settle_constraints(b, lower, t0);
        }
    }

    /// Constraints that hold with equality at a given initial state, but for what a solve leaves over, hold exactly: the state is a
    /// number, and the multiplier there could not be zero otherwise.
    fn settle_constraints(&self, b: &mut Bounds, x: &[f64], t0: f64) {
        let (form, Some(s)) = (self.spec.dcs.form(), self.l.starts.first()) else { return };
        let is_constraint = |c: usize| form.multipliers.iter().any(|m| m.contains(&c));
        for (i, &k) in s.rows.iter().enumerate() {
            let r = &form.rows[k];
            let (f, true) = (&form.sources[r.source], r.lambda.iter().all(|l| is_constraint(l.0))) else { continue };
            let d = f.dims();
            let (u, p) = (vec![0.0; d.u], f.jac_pattern());
            let at = Point { t: t0, x, u: &u, p: &self.constants[..d.p] };
            let (mut values, mut slopes) = (vec![0.0; f.n_out()], vec![0.0; p.nnz()]);
            let mut work = vec![0.0; f.work_len()];
            let known = f.value(&at, &mut values, &mut work).and_then(|()| f.jacobian(&at, &mut slopes, &mut work));
            let value: f64 = r.weights.iter().zip(&values).map(|(w, v)| w * v).sum();
            let slope = |c: usize| {
                p.rows(c).iter().zip(&slopes[p.range(c)]).map(|(&o, v)| (r.weights[o] * v).abs()).sum::<f64>()
            };
            let size = x.iter().fold(0.0, |m: f64, v| m.max(v.abs())) * (0..d.x).map(slope).sum::<f64>();
            let rest = if known.is_ok() && value.abs() <= SETTLED * size { value } else { 0.0 };
            (b.cl[s.row + i], b.cu[s.row + i]) = (rest, rest);
        }
    }

    /// Sets bounds of the control of stage `k`; at both of its ends where the control is linear.
    pub fn bound_control(&self, b: &mut Bounds, k: usize, lower: &[f64], upper: &[f64]) {
        let els = self.l.stage(k);
        for j in 0..lower.len() {
            let mut set = |v: usize| (b.xl[v], b.xu[v]) = (lower[j], upper[j]);
            match self.l.linear[j] {
                None => set(self.l.u[k] + j),
                Some(r) => {
                    if k == 0 {
                        set(self.l.x0 + r);
                    }
                    set(els[els.len() - 1].x_end + r);
                }
            }
        }
    }

    /// The component `c` leaves a sliding mode at the start of the element `i_e`, as [`Exit`] says.
    fn leave(&self, i_e: usize, c: usize, b: &mut Bounds) {
        let [before, e] = [&self.l.elements[i_e - 1], &self.l.elements[i_e]];
        let last = before.theta[self.tableau.n_s - 1] + c;
        let by_theta = self.exit == Exit::Theta && (self.tableau.stiffly_accurate() || before.row_last.is_some());
        match e.row_slope {
            Some(slope) if !by_theta => {
                b.cu[slope + c] = 0.0;
                b.xl[last] = f64::NEG_INFINITY;
            }
            _ => {
                match before.row_last {
                    Some(row) => (b.cl[row + c], b.cu[row + c]) = (0.0, 0.0),
                    None => (b.xl[last], b.xu[last]) = (0.0, 0.0),
                }
                if let Some(row) = e.row_slope {
                    b.cl[row + c] = f64::NEG_INFINITY;
                }
            }
        }
    }
}

impl Mpcc for Fesd {
    fn pairs(&self) -> &[(usize, usize)] {
        &self.l.pairs
    }
    fn is_discretised(&self) -> bool {
        true
    }
    fn sizes(&self, out: &mut [f64]) {
        if !self.sizes.is_empty() {
            out.copy_from_slice(&self.sizes);
        }
    }
    fn n_groups(&self) -> usize {
        self.l.n_groups
    }
    fn group(&self, pair: usize) -> usize {
        self.l.groups[pair]
    }
    fn set_polishing(&mut self, on: bool) {
        self.polishing = on;
    }

    fn set_steepest(&mut self, steepest: f64) {
        self.measure_guidance(steepest);
    }

    /// In elements whose active set changes, active cells get equal shares and the others a positive `λ`.
    fn enter_branch(&self, from: &[Side], to: &[Side], w: &mut [f64]) {
        let l = &self.l;
        for (&(a, b), &g) in self.path_pairs().filter(|(_, g)| from[**g] != to[**g]) {
            let j = if to[g] == Side::First { b } else { a };
            w[j] = 1e-2 * self.size(j);
        }
        if !l.fesd {
            return;
        }
        let n = l.n_cells;
        for (i_e, e) in l.elements.iter().enumerate() {
            let sides = i_e * n..(i_e + 1) * n;
            if from[sides.clone()] == to[sides.clone()] {
                continue;
            }
            for cells in &self.spec.dcs.form().simplices {
                let active = |c: usize| to[i_e * n + c] == Side::First;
                let share = 1.0 / cells.clone().filter(|&c| active(c)).count().max(1) as f64;
                for c in cells.clone() {
                    for (&theta, &lambda) in e.theta.iter().zip(&e.lambda) {
                        w[theta + c] = if active(c) { share } else { 0.0 };
                        w[lambda + c] = if active(c) { 0.0 } else { w[lambda + c].max(0.1 * self.size(lambda + c)) };
                    }
                }
            }
            for c in self.spec.dcs.form().multipliers.iter().cloned().flatten() {
                let active = to[i_e * n + c] == Side::First;
                for (&theta, &lambda) in e.theta.iter().zip(&e.lambda) {
                    let least = |j: usize| w[j].max(0.1 * self.size(j));
                    let (a, b) = if active { (least(theta + c), 0.0) } else { (0.0, least(lambda + c)) };
                    (w[theta + c], w[lambda + c]) = (a, b);
                }
            }
            e.theta.iter().for_each(|&theta| self.write_products(w, theta));
            self.write_sums(w, e);
        }
    }

    /// The active set of every element is `sides`: `λ`, or `θ`, is zero at all its points. Where it does not
    /// change, neighbouring steps are equal. Where components only leave it, a sliding mode ends: the first of them
    /// leaves as [`Exit`] says. Methods whose ends are off the surface keep only the multipliers at zero there that say what
    /// `μ` is and where a mode is entered. At the start of a control stage, where `θ` may jump with the control, it is `λ̇ ≥ 0`.
    fn branch(&self, sides: &[Side], b: &mut Bounds) {
        let l = &self.l;
        let fix = |b: &mut Bounds, j: usize| {
            b.xl[j] = 0.0;
            b.xu[j] = 0.0;
        };
        if !l.fesd {
            for (k, &(lam, theta)) in l.pairs.iter().enumerate() {
                fix(b, if sides[l.groups[k]] == Side::First { lam } else { theta });
            }
            return;
        }
        for (&(first, second), &g) in self.path_pairs() {
            fix(b, if sides[g] == Side::First { first } else { second });
        }
        let sides = &sides[..self.n_element_groups()];
        let free = |b: &mut Bounds, j: usize| {
            b.xl[j] = f64::NEG_INFINITY;
            b.xu[j] = f64::INFINITY;
        };
        let n = l.n_cells;
        let drifts = self.drifts();
        let multipliers = || self.spec.dcs.form().multipliers.iter().cloned().flatten();
        let given = (l.x0..l.x0 + self.spec.dcs.dims().x).all(|j| b.xl[j] == b.xu[j]);
        for (i_e, e) in l.elements.iter().enumerate() {
            // equal steps need no bound, and one would stop a switch on its way to the optimum
            if let Some(h) = e.h.filter(|_| self.spec.options.gamma_h >= 1.0) {
                b.xu[h] = f64::INFINITY;
            }
            let active = |c: usize| sides[i_e * n + c] == Side::First;
            let mut fix_active = |c: usize, says_mu: bool| {
                let first = self.first_counts() || says_mu;
                // a start may be the end of the element before
                let start = l.start_of(e, c).filter(|_| !drifts || !l.is_tied(e, c));
                let end = e.lambda_end.filter(|_| !drifts);
                for &j in start.iter().chain(&e.lambda[usize::from(!first)..]).chain(&end) {
                    fix(b, j + c);
                }
                if !first {
                    free(b, e.lambda[0] + c);
                }
                if let (false, Some(row)) = (says_mu, e.row_first) {
                    (b.cl[row + c], b.cu[row + c]) = (0.0, 0.0);
                }
                // at a given state the constraint has a value, which its multiplier follows
                let follows = i_e == 0 && given && multipliers().any(|m| m == c);
                if let (true, Some(start)) = (follows, l.start_of(e, c)) {
                    free(b, start + c);
                }
                if e.row_sum_lambda.is_some() && (drifts || !first || follows) {
                    free(b, e.sum_lambda + c);
                } else if e.row_sum_lambda.is_some() {
                    fix(b, e.sum_lambda + c);
                }
            };
            for cells in &self.spec.dcs.form().simplices {
                let says_mu = cells.clone().find(|&c| active(c));
                cells.clone().filter(|&c| active(c)).for_each(|c| fix_active(c, Some(c) == says_mu));
            }
            multipliers().filter(|&c| active(c)).for_each(|c| fix_active(c, false));
            for c in (0..n).filter(|&c| !active(c)) {
                for &j in &e.theta {
                    fix(b, j + c);
                }
                if l.sums {
                    fix(b, e.sum_theta + c);
                }
                if self.first_repeats() {
                    free(b, e.lambda[0] + c);
                    if e.row_sum_lambda.is_some() {
                        free(b, e.sum_lambda + c);
                    }
                }
            }
            if let (true, Some(end)) = (drifts, e.lambda_end) {
                // what jumps says nothing of the stage behind
                let next = |c: usize| match (l.elements.get(i_e + 1), sides.get((i_e + 1) * n + c)) {
                    (Some(b), Some(s)) if l.is_tied(b, c) => *s == Side::First,
                    _ => active(c),
                };
                for cells in &self.spec.dcs.form().simplices {
                    let reference =
                        cells.clone().find(|&c| active(c) && next(c)).or(cells.clone().find(|&c| active(c)));
                    for c in cells.clone() {
                        if Some(c) == reference || next(c) && !active(c) {
                            fix(b, end + c);
                        } else if active(c) {
                            free(b, end + c);
                        }
                    }
                }
            }
            if let (true, Some(end)) = (drifts, e.lambda_end) {
                let entered = |c: usize| match (l.elements.get(i_e + 1), sides.get((i_e + 1) * n + c)) {
                    (Some(b), Some(s)) => l.is_tied(b, c) && *s == Side::First,
                    _ => false,
                };
                for c in multipliers() {
                    if active(c) {
                        free(b, end + c);
                    } else if entered(c) {
                        fix(b, end + c);
                    }
                }
            }
            if let Some(row) = e.row_eta {
                (b.cl[row], b.cu[row]) = (f64::NEG_INFINITY, f64::INFINITY);
            }
            if i_e == 0 {
                continue;
            }
            let before = |c: usize| sides[(i_e - 1) * n + c] == Side::First;
            if let Some(row) = e.row_slope {
                for c in (0..n).filter(|&c| before(c) && !active(c) && l.is_tied(e, c)) {
                    b.cl[row + c] = 0.0;
                }
            }
            let enters = (0..n).any(|c| active(c) && !before(c));
            let Some(row) = e.row_equal else {
                // at the start of a control stage, too, a weight that does not jump with the controls is zero where its mode ends;
                // the two inequalities alone would leave nothing between them
                for (k, cells) in self.spec.dcs.form().simplices.iter().enumerate() {
                    let mut leaving = cells.clone().filter(|&c| before(c) && !active(c) && l.is_tied(e, c));
                    if let (Some(c), None) = (leaving.next(), leaving.next()) {
                        if !enters && !l.weights_jump[k] {
                            self.leave(i_e, c, b);
                        }
                    }
                }
                continue;
            };
            let leaves = (0..n).find(|&c| before(c) && !active(c));
            match (enters, leaves) {
                (false, None) => {
                    b.cl[row] = 0.0;
                    b.cu[row] = 0.0;
                }
                (false, Some(c)) => self.leave(i_e, c, b),
                (true, _) => {}
            }
        }
        self.keep_clear(sides, b);
    }
}
