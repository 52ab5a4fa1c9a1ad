//! Which active sets of cells continue a Filippov solution at a point: all solutions of the complementarity problem
//! (6.19), and whether they are one motion or several.
//!
//! At a point where several indicators of a subsystem are smallest, its candidates are the cells with these indicators.
//! With `ẋ(θ) = f0 + Σ_i θ_i f_i` the candidates that are active just after the point solve
//!
//! ```text
//! 0 ≤ θ_i ⊥ ġ_i(θ) − ν_k ≥ 0,   Σ_i θ_i = 1   in every subsystem k,     ġ_i(θ) = ∇g_i ẋ(θ) + ∂g_i/∂t
//! ```
//!
//! where `ν_k` is the rate of the active indicators. The problem is small, so its solutions are found by trying the sets
//! of candidates: an active set makes the conditions a linear system for `θ`, and the signs tell whether it is a
//! solution.
//!
//! A solution is *strict* if no weight of an active cell and no rate `ġ_i − ν_k` of another candidate is zero. Where one
//! is (a mode that is left with a zero rate, a surface that is only touched), first order does not decide, and the
//! derivative of what is zero along the solution does: the second-order condition, [`FilippovProblem::solutions`].
//!
//! **Units.** Only signs of switching functions matter, so each is divided by the largest size of the terms of its rate;
//! indicators of a subsystem are compared with each other, so they are divided by one such number together. What is
//! tested after that are weights and rates that have no units. States are compared with their sizes,
//! [`CellFields::size`]. No answer depends on the units of states, of time or of switching functions.

use std::ops::Range;

use super::Cell;
use crate::func::{EvalError, EvalResult};
use crate::linalg::lu::Lu;

/// A weight, or a rate relative to its scale, of at most this size is zero: rounding of the solution of a small linear
/// system, some thousand times as large as that of its terms.
const ZERO: f64 = 1e-9;
/// How far below zero the weights and rates of [`FilippovProblem::nearest`] may be.
const NEARLY_ZERO: f64 = 1e-4;
/// Rates that are sums of terms that cancel to this part of their scale are zero: rounding of the terms.
const ROUNDING: f64 = 1e-13;
/// Values of indicators are known to this part of the sizes of their terms: the rounding of the location of a switch.
const VALUE_ROUNDING: f64 = 64.0 * f64::EPSILON;
/// Maximum number of combinations of active sets that are tried. Where there are more, groups of subsystems that do not
/// influence each other are solved one after the other; where a group alone has more, [`FilippovProblem::keep`] says
/// which subsystems have one set only, and of the rest so many are tried.
const MAX_COMBINATIONS: usize = 8192;
/// Maximum number of solutions that are kept where several groups of subsystems have several each.
const MAX_PRODUCT: usize = 256;
/// Maximum number of candidates of a subsystem whose subsets are tried; of more only all together.
const MAX_CANDIDATES: usize = 12;
/// Velocities are the same if their difference is at most this part of the faster one, with states in units of their
/// sizes.
const SAME_VELOCITY: f64 = 1e-6;
/// A rate of at most this part of the size of its terms leaves a doubt about its sign: [`decide_pair`] then leaves the
/// point to the search.
const DOUBT: f64 = 1e-6;
/// How far ahead the second-order condition looks, as a part of the time over which the solution hardly changes.
const AHEAD: f64 = 1e-4;
/// What is zero may fall by so much on the way there: rounding.
const FALL: f64 = 1e-11;

/// The cells of a subsystem, and the functions its indicators are combined of.
pub struct SubsystemCells<'a> {
    /// Its cells.
    pub cells: &'a [Cell],
    /// Number of the first of them among the cells of all subsystems.
    pub first: usize,
    /// Numbers of its indicator functions among those of all subsystems.
    pub functions: Range<usize>,
    /// Are the indicators made of signs of switching functions, see [`Stewart::by_signs`](super::Stewart::by_signs)?
    pub by_signs: bool,
}

/// The derivatives of a function: those with respect to the states that are not zero, with the places of these states, and
/// that with respect to time.
#[derive(Debug, Clone, Copy)]
pub struct Gradient<'a> {
    /// States, ascending.
    pub columns: &'a [usize],
    /// Derivatives with respect to them.
    pub values: &'a [f64],
    /// Derivative with respect to time.
    pub t: f64,
}

impl Gradient<'_> {
    /// Rate of change for a velocity, time apart.
    pub fn along(&self, v: &[f64]) -> f64 {
        self.columns.iter().zip(self.values).map(|(&i, g)| g * v[i]).sum()
    }

    /// Size of the terms of [`Gradient::along`].
    pub fn size_along(&self, v: &[f64]) -> f64 {
        self.columns.iter().zip(self.values).map(|(&i, g)| (g * v[i]).abs()).sum()
    }
}

/// A system cell by cell, as far as (6.19) asks for it.
pub trait CellFields {
    /// Number of states.
    fn nx(&self) -> usize;
    /// Size of state `i` at this value: what its changes are compared with. Zero says that there is nothing to compare
    /// with.
    fn size(&self, i: usize, value: f64) -> f64;
    /// Subsystem `k`.
    fn subsystem(&self, k: usize) -> SubsystemCells<'_>;
    /// Writes the smooth part of the right-hand side.
    fn smooth(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> EvalResult;
    /// Adds the right-hand side of a cell; where it fails `out` is as before. The gradients are those of this point.
    fn add_cell(&mut self, t: f64, x: &[f64], cell: usize, out: &mut [f64]) -> EvalResult;
    /// Evaluates the gradients of all indicator functions.
    fn gradients(&mut self, t: f64, x: &[f64]) -> EvalResult;
    /// Derivatives of indicator function `j` with respect to the states and to time, where they were evaluated last.
    fn gradient(&self, j: usize) -> Gradient<'_>;
    /// Value of indicator function `j` where these were evaluated last.
    fn value(&self, j: usize) -> f64;
}

/// Reciprocal of the time in which the first state has moved by its size with this velocity.
pub fn pace(system: &impl CellFields, x: &[f64], velocity: &[f64]) -> f64 {
    let mut pace = 0.0f64;
    for (i, (x, v)) in x.iter().zip(velocity).enumerate() {
        let size = system.size(i, *x);
        // a state of size zero says nothing
        if size > 0.0 {
            pace = pace.max(v.abs() / size);
        }
    }
    pace
}

/// An active set that continues the solution.
#[derive(Debug, Clone, PartialEq)]
pub struct FilippovSolution {
    /// Active cells of every subsystem, by their numbers among those of all subsystems.
    pub sets: Vec<Vec<usize>>,
    /// Their weights.
    pub theta: Vec<Vec<f64>>,
    /// Derivative of the states.
    pub velocity: Vec<f64>,
    /// Smallest weight of an active cell or relative rate of another candidate.
    pub margin: f64,
}

impl FilippovSolution {
    /// No weight of an active cell and no rate of another candidate is zero: first order decides.
    pub fn is_strict(&self) -> bool {
        self.margin > ZERO
    }
}

/// The complementarity problem (6.19) at a point: fields and rates of the candidates.
pub struct FilippovProblem {
    t: f64,
    x: Vec<f64>,
    /// Candidates of all subsystems, and where each subsystem begins.
    cells: Vec<usize>,
    begin: Vec<usize>,
    /// Smooth part of the right-hand side, and the fields of the candidates one after the other.
    f0: Vec<f64>,
    fields: Vec<f64>,
    /// Rate of the indicator of candidate `a` under the smooth part, and under the field of candidate `b`.
    own: Vec<f64>,
    by: Vec<f64>,
    /// What the rates of a candidate are compared with: the largest size of their terms in its subsystem.
    scale: Vec<f64>,
    /// Factor of every indicator function: see [`FilippovProblem::units`].
    unit: Vec<f64>,
    /// Subsystems whose candidates are taken all together where there are too many combinations.
    kept: Vec<bool>,
}

impl FilippovProblem {
    /// Evaluates fields and rates of the `candidates` of every subsystem, cells by their numbers among those of all.
    pub fn new<S: CellFields>(
        system: &mut S,
        t: f64,
        x: &[f64],
        candidates: &[Vec<usize>],
    ) -> Result<FilippovProblem, EvalError> {
        let nx = system.nx();
        let mut begin = vec![0];
        let mut cells = Vec::new();
        for c in candidates {
            cells.extend(c);
            begin.push(cells.len());
        }
        let n = cells.len();
        let n_functions = candidates.len().checked_sub(1).map_or(0, |k| system.subsystem(k).functions.end);
        let mut p = FilippovProblem {
            t,
            x: x.to_vec(),
            f0: vec![0.0; nx],
            fields: vec![0.0; n * nx],
            own: vec![0.0; n],
            by: vec![0.0; n * n],
            scale: vec![0.0; n],
            unit: vec![1.0; n_functions],
            kept: vec![false; candidates.len()],
            cells,
            begin,
        };
        system.smooth(t, x, &mut p.f0)?;
        system.gradients(t, x)?;
        for (i, &c) in p.cells.iter().enumerate() {
            system.add_cell(t, x, c, &mut p.fields[i * nx..(i + 1) * nx])?;
        }
        p.units(system);
        p.rates(system);
        Ok(p)
    }

    /// The subsystems whose candidates are active all together, if there are too many combinations of active sets to try
    /// all: those that slide, for instance, and go on with it.
    pub fn keep(mut self, kept: Vec<bool>) -> FilippovProblem {
        self.kept = kept;
        self
    }

    /// Switching functions of one subsystem may have different units, and only their signs matter: each is divided by
    /// the largest size of the terms of its rate under the fields of all candidates. Indicators are compared with each
    /// other as they are.
    fn units<S: CellFields>(&mut self, system: &S) {
        let nx = self.f0.len();
        for k in 0..self.kept.len() {
            let s = system.subsystem(k);
            for j in if s.by_signs { s.functions } else { 0..0 } {
                let g = system.gradient(j);
                let fields = (0..self.cells.len()).map(|b| &self.fields[b * nx..(b + 1) * nx]);
                let most = fields.fold(g.size_along(&self.f0) + g.t.abs(), |m, f| m.max(g.size_along(f)));
                if most > 0.0 && most.is_finite() {
                    self.unit[j] = 1.0 / most;
                }
            }
        }
    }

    /// Rates of the indicators of all candidates under the fields of all candidates, and their scales.
    fn rates<S: CellFields>(&mut self, system: &S) {
        let (nx, n) = (self.f0.len(), self.cells.len());
        let mut g = vec![0.0; nx];
        for k in 0..self.kept.len() {
            let s = system.subsystem(k);
            // rates of one subsystem are compared with each other
            let mut most = f64::MIN_POSITIVE;
            for a in self.begin[k]..self.begin[k + 1] {
                g.fill(0.0);
                let mut g_t = 0.0;
                for (w, j) in s.cells[self.cells[a] - s.first].weights.iter().zip(s.functions.clone()) {
                    let w = w * self.unit[j];
                    let d = system.gradient(j);
                    d.columns.iter().zip(d.values).for_each(|(&i, d)| g[i] += w * d);
                    g_t += w * d.t;
                }
                self.own[a] = dot(&g, &self.f0) + g_t;
                most = most.max(size(&g, &self.f0) + g_t.abs());
                for b in 0..n {
                    let f = &self.fields[b * nx..(b + 1) * nx];
                    self.by[a * n + b] = dot(&g, f);
                    most = most.max(size(&g, f));
                }
            }
            self.scale[self.begin[k]..self.begin[k + 1]].fill(most);
        }
    }

    /// All solutions, few active cells first, then by index. Of those that are not strict the ones are dropped whose
    /// zero weights and rates do not grow along the solution, unless that leaves none. `length` is a time over which
    /// the solution hardly changes, at most: a velocity that moves a state by its size in less has that time. Also
    /// returns how many solutions second order was asked about.
    pub fn solutions<S: CellFields>(
        &self,
        system: &mut S,
        length: f64,
    ) -> Result<(Vec<FilippovSolution>, usize), EvalError> {
        let mut found = self.first_order(ZERO);
        let weak = found.iter().filter(|s| !s.is_strict()).count();
        let mut holds = Vec::with_capacity(found.len());
        for s in &found {
            holds.push(s.is_strict() || self.second_order(system, s, length)?);
        }
        if holds.contains(&true) {
            let mut holds = holds.into_iter();
            found.retain(|_| holds.next().unwrap_or(true));
        }
        // of what is left, as where nothing moves at all, a set that only rounding lets in gives way to a larger one that meets the
        // conditions: its field leads over its own surface, however slowly, and it would be left again at once
        let within = |s: &FilippovSolution, o: &FilippovSolution| {
            s.sets.iter().zip(&o.sets).all(|(s, o)| s.iter().all(|c| o.contains(c)))
        };
        let met: Vec<FilippovSolution> = found.iter().filter(|s| s.margin >= 0.0).cloned().collect();
        found.retain(|s| s.margin >= 0.0 || !met.iter().any(|o| within(s, o)));
        Ok((found, weak))
    }

    /// The active set that misses the conditions by least, where none satisfies them, as after an inaccurate step.
    pub fn nearest(&self) -> Option<FilippovSolution> {
        let mut found = self.first_order(NEARLY_ZERO);
        found.sort_by(|a, b| b.margin.total_cmp(&a.margin));
        found.into_iter().next()
    }

    /// All active sets whose weights and rates are at least `−tol`.
    fn first_order(&self, tol: f64) -> Vec<FilippovSolution> {
        let n_sub = self.kept.len();
        if (0..n_sub).any(|k| self.own_candidates(k).is_empty()) {
            return Vec::new();
        }
        let mut lu = Lu::with_capacity(self.cells.len());
        let first: Vec<Vec<usize>> = (0..n_sub).map(|k| vec![self.begin[k]]).collect();
        let whole: Vec<usize> = (0..n_sub).collect();
        let combinations = |group: &[usize]| {
            let each = group.iter().map(|&k| 1usize << self.own_candidates(k).len().min(MAX_CANDIDATES + 1));
            each.fold(1usize, usize::saturating_mul)
        };
        // together where that is little work, else by groups
        let groups = if combinations(&whole) <= MAX_COMBINATIONS { vec![whole] } else { self.groups() };
        let mut found = vec![first.clone()];
        for group in &groups {
            let good = self.group_solutions(group, &first, &mut lu, tol);
            // what was found for the groups before, with every solution of this one
            let mut next = Vec::new();
            for sets in &found {
                for choice in &good {
                    let mut sets = sets.clone();
                    for (s, &k) in choice.iter().zip(group) {
                        sets[k].clone_from(s);
                    }
                    next.push(sets);
                }
            }
            next.truncate(MAX_PRODUCT);
            found = next;
        }
        let mut out: Vec<FilippovSolution> =
            found.iter().filter_map(|sets| self.solution(sets, &mut lu, tol)).collect();
        out.sort_by_key(|s| s.sets.iter().map(Vec::len).sum::<usize>());
        out
    }

    /// Active sets of a group of subsystems that satisfy the conditions of the group, whatever the other subsystems do:
    /// those have the sets `others`.
    fn group_solutions(
        &self,
        group: &[usize],
        others: &[Vec<usize>],
        lu: &mut Lu<f64>,
        tol: f64,
    ) -> Vec<Vec<Vec<usize>>> {
        let product = |l: &[Vec<Vec<usize>>]| l.iter().fold(1usize, |p, l| p.saturating_mul(l.len()));
        let mut lists: Vec<Vec<Vec<usize>>> = group.iter().map(|&k| self.subsets(k, false)).collect();
        if product(&lists) > MAX_COMBINATIONS {
            lists = group.iter().map(|&k| self.subsets(k, self.kept[k])).collect();
        }
        let mut good = Vec::new();
        let mut sets = others.to_vec();
        for mut m in 0..product(&lists).min(MAX_COMBINATIONS) {
            for (l, &k) in lists.iter().zip(group) {
                sets[k].clone_from(&l[m % l.len()]);
                m /= l.len();
            }
            if self.weights(&sets, lu).and_then(|theta| self.margin(&sets, &theta, group, tol)).is_some() {
                good.push(group.iter().map(|&k| sets[k].clone()).collect());
            }
        }
        good
    }

    /// Groups of subsystems whose weights do not depend on those of other groups.
    fn groups(&self) -> Vec<Vec<usize>> {
        let (n, n_sub) = (self.cells.len(), self.kept.len());
        let couples = |k: usize, l: usize| {
            let (a0, b0) = (self.begin[k], self.begin[l]);
            let change = |a: usize, b: usize| self.by[a * n + b] - self.by[a0 * n + b];
            self.own_candidates(k).any(|a| {
                let small = ROUNDING * self.scale[a];
                self.own_candidates(l).any(|b| (change(a, b) - change(a, b0)).abs() > small)
            })
        };
        let mut group: Vec<usize> = (0..n_sub).collect();
        for k in 0..n_sub {
            for l in 0..k {
                let (a, b) = (group[k], group[l]);
                if a != b && (couples(k, l) || couples(l, k)) {
                    group.iter_mut().filter(|g| **g == a).for_each(|g| *g = b);
                }
            }
        }
        let all = (0..n_sub).map(|g| (0..n_sub).filter(|k| group[*k] == g).collect::<Vec<usize>>());
        all.filter(|g| !g.is_empty()).collect()
    }

    /// Candidates of subsystem `k`, by their positions among all.
    fn own_candidates(&self, k: usize) -> Range<usize> {
        self.begin[k]..self.begin[k + 1]
    }

    /// Subsets of the candidates of a subsystem, small ones first; all of them as one where there are too many.
    fn subsets(&self, k: usize, whole: bool) -> Vec<Vec<usize>> {
        let own: Vec<usize> = self.own_candidates(k).collect();
        if whole || own.len() > MAX_CANDIDATES {
            return vec![own];
        }
        let mut all: Vec<Vec<usize>> = (1..1usize << own.len())
            .map(|m| own.iter().enumerate().filter(|(i, _)| m >> i & 1 == 1).map(|(_, &c)| c).collect())
            .collect();
        all.sort_by_key(Vec::len);
        all
    }

    /// Weights of all candidates with the active sets `sets` (positions among the candidates); none where they are not
    /// determined.
    fn weights(&self, sets: &[Vec<usize>], lu: &mut Lu<f64>) -> Option<Vec<f64>> {
        let n = self.cells.len();
        let pairs: Vec<(usize, usize)> = sets.iter().flat_map(|s| s[1..].iter().map(move |&i| (i, s[0]))).collect();
        let r = pairs.len();
        let mut theta = vec![0.0; n];
        for s in sets {
            theta[s[0]] = 1.0;
        }
        if r > 0 {
            let m = lu.clear(r);
            let mut b = vec![0.0; r];
            for (e, &(i, i0)) in pairs.iter().enumerate() {
                let scale = 1.0 / self.scale[i];
                let between = |c: usize| (self.by[i * n + c] - self.by[i0 * n + c]) * scale;
                for (j, &(c, c0)) in pairs.iter().enumerate() {
                    m[e * r + j] = between(c) - between(c0);
                }
                b[e] = -(self.own[i] - self.own[i0]) * scale - sets.iter().map(|s| between(s[0])).sum::<f64>();
            }
            if m.iter().any(|v| !v.is_finite()) || !lu.factorise() {
                return None;
            }
            lu.solve(&mut b);
            for (v, &(i, i0)) in b.iter().zip(&pairs) {
                theta[i] = *v;
                theta[i0] -= v;
            }
        }
        Some(theta)
    }

    /// What has to be at least zero in subsystem `k`: the weights of its active cells, the relative rates of its other
    /// candidates.
    fn slacks<'a>(&'a self, k: usize, set: &'a [usize], theta: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        let n = self.cells.len();
        let rate = move |a: usize| self.own[a] + (0..n).map(|b| self.by[a * n + b] * theta[b]).sum::<f64>();
        let nu = rate(set[0]);
        self.own_candidates(k).map(move |a| if set.contains(&a) { theta[a] } else { (rate(a) - nu) / self.scale[a] })
    }

    /// Smallest slack of the subsystems `which`; none where one is below `−tol`.
    fn margin(&self, sets: &[Vec<usize>], theta: &[f64], which: &[usize], tol: f64) -> Option<f64> {
        let mut margin = f64::INFINITY;
        for &k in which {
            for m in self.slacks(k, &sets[k], theta) {
                if m.is_nan() || m < -tol {
                    return None;
                }
                margin = margin.min(m);
            }
        }
        Some(margin)
    }

    /// The solution with the active sets `sets`, if it is one.
    fn solution(&self, sets: &[Vec<usize>], lu: &mut Lu<f64>, tol: f64) -> Option<FilippovSolution> {
        let theta = self.weights(sets, lu)?;
        let which: Vec<usize> = (0..sets.len()).collect();
        let margin = self.margin(sets, &theta, &which, tol)?;
        let nx = self.f0.len();
        let mut velocity = self.f0.clone();
        for (b, th) in theta.iter().enumerate() {
            for (v, f) in velocity.iter_mut().zip(&self.fields[b * nx..]) {
                *v += th * f;
            }
        }
        Some(FilippovSolution {
            sets: sets.iter().map(|s| s.iter().map(|&i| self.cells[i]).collect()).collect(),
            theta: sets.iter().map(|s| s.iter().map(|&i| theta[i]).collect()).collect(),
            velocity,
            margin,
        })
    }

    /// Do the weights and rates that are zero grow along the solution? Not where the system is not defined ahead of the
    /// point.
    fn second_order<S: CellFields>(
        &self,
        system: &mut S,
        s: &FilippovSolution,
        length: f64,
    ) -> Result<bool, EvalError> {
        let ahead = time_ahead(system, &self.x, &s.velocity, length);
        let y: Vec<f64> = self.x.iter().zip(&s.velocity).map(|(x, v)| x + ahead * v).collect();
        let lists: Vec<Vec<usize>> =
            (0..self.kept.len()).map(|k| self.cells[self.own_candidates(k)].to_vec()).collect();
        let there = match FilippovProblem::new(system, self.t + ahead, &y, &lists) {
            Err(EvalError::Recoverable) => return Ok(false),
            r => r?,
        };
        let (Some(before), Some(after)) = (self.all_slacks(&s.sets), there.all_slacks(&s.sets)) else {
            return Ok(false);
        };
        let mut all = before.iter().zip(&after);
        Ok((0..self.kept.len()).all(|k| {
            let rounding = there.rounding_of_values(system, k);
            // positions among the candidates are those of the slacks
            self.own_candidates(k).zip(all.by_ref()).all(|(i, (b, a))| {
                let is_rate = !s.sets[k].contains(&self.cells[i]) && b.abs() > ROUNDING;
                let excursion = Excursion { rate: *b, growth: (a - b) / ahead, rounding };
                if is_rate && excursion.is_seen() {
                    *b > 0.0
                } else {
                    holds_ahead(*b, *a)
                }
            })
        }))
    }

    /// What rounding makes of the differences of the indicators of subsystem `k`, in units of their rates: a time.
    fn rounding_of_values<S: CellFields>(&self, system: &S, k: usize) -> f64 {
        let s = system.subsystem(k);
        let size = |j: usize| {
            let g = system.gradient(j);
            let states = g.columns.iter().zip(g.values).map(|(&i, g)| g.abs() * system.size(i, self.x[i]));
            self.unit[j] * (states.sum::<f64>() + (g.t * self.t).abs())
        };
        let most = s.functions.map(size).fold(0.0f64, f64::max);
        VALUE_ROUNDING * most / self.scale[self.begin[k]]
    }

    /// The slacks of all subsystems with the active cells `sets`; none where the weights are not determined.
    fn all_slacks(&self, sets: &[Vec<usize>]) -> Option<Vec<f64>> {
        let places = |(k, set): (usize, &Vec<usize>)| -> Vec<usize> {
            self.own_candidates(k).filter(|&i| set.contains(&self.cells[i])).collect()
        };
        let sets: Vec<Vec<usize>> = sets.iter().enumerate().map(places).collect();
        let theta = self.weights(&sets, &mut Lu::with_capacity(self.cells.len()))?;
        Some(sets.iter().enumerate().flat_map(|(k, s)| self.slacks(k, s, &theta)).collect())
    }
}

/// How far ahead second-order conditions look from `x`, for a velocity; `length` is a time over which the solution hardly changes.
pub fn time_ahead<S: CellFields>(system: &S, x: &[f64], velocity: &[f64], length: f64) -> f64 {
    let pace = pace(system, x, velocity);
    AHEAD * if pace * length > 1.0 { 1.0 / pace } else { length }
}

/// A function that is zero and begins to change at `rate`, which itself changes by `growth` in a unit of time.
#[derive(Debug, Clone, Copy)]
pub struct Excursion {
    /// Rate of change.
    pub rate: f64,
    /// Rate of change of the rate.
    pub growth: f64,
    /// What the value of the function is known to.
    pub rounding: f64,
}

impl Excursion {
    /// Does the function leave zero to the side of its rate by more than rounding, before it turns back? It turns at
    /// `rate²/(2 |growth|)` if its growth leads back, and never otherwise. However small a rate is, its sign then counts.
    pub fn is_seen(&self) -> bool {
        let back = (-self.growth * self.rate.signum()).max(0.0);
        self.rate.powi(2) > 2.0 * back * self.rounding
    }
}

/// Is a weight positive, or zero and does not fall on the way ahead?
pub fn holds_ahead(here: f64, ahead: f64) -> bool {
    here > ZERO || here >= -ZERO && ahead - here >= -FALL
}

/// Do two velocities at `x` differ by more than this part of the faster one, with states in units of their sizes?
pub fn differ<S: CellFields>(system: &S, x: &[f64], [a, b]: [&[f64]; 2], part: f64) -> bool {
    let difference: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    pace(system, x, &difference) > part * pace(system, x, a).max(pace(system, x, b))
}

/// Of solutions with the same velocity the first: sets that differ only by cells of weight zero are one continuation.
pub fn distinct<S: CellFields>(system: &S, x: &[f64], solutions: Vec<FilippovSolution>) -> Vec<FilippovSolution> {
    let differ = |a: &[f64], b: &[f64]| differ(system, x, [a, b], SAME_VELOCITY);
    let mut out: Vec<FilippovSolution> = Vec::new();
    for s in solutions {
        if out.iter().all(|o| differ(&s.velocity, &o.velocity)) {
            out.push(s);
        }
    }
    out
}

/// An implicit step of length `h`: the active set of (6.19) for the indicators that its end has to first order,
/// `0 ≤ θ_i ⊥ g_i + h ġ_i(θ) − μ_k ≥ 0`. The indicator functions of the system were evaluated at `x` last.
pub fn implicit_step<S: CellFields>(
    system: &mut S,
    t: f64,
    x: &[f64],
    candidates: &[Vec<usize>],
    h: f64,
) -> Result<Option<FilippovSolution>, EvalError> {
    let mut p = FilippovProblem::new(system, t, x, candidates)?;
    for k in 0..candidates.len() {
        let s = system.subsystem(k);
        let value = |c: usize| -> f64 {
            let weights = s.cells[c - s.first].weights.iter();
            weights.zip(s.functions.clone()).map(|(w, j)| w * system.value(j) * p.unit[j]).sum()
        };
        let values: Vec<f64> = candidates[k].iter().map(|c| value(*c)).collect();
        let least = values.iter().fold(f64::INFINITY, |m, v| m.min(*v));
        for (own, v) in p.own[p.begin[k]..].iter_mut().zip(values) {
            *own += (v - least) / h;
        }
    }
    Ok(p.first_order(ZERO).into_iter().next().or_else(|| p.nearest()))
}

/// The common case without a search and without allocation: one subsystem with two candidates, the others with one, and
/// rates that leave no doubt. Writes the active set of that subsystem to `out` and returns its number; `None` leaves it
/// to [`FilippovProblem`]. `room` is for two velocities.
pub fn decide_pair<S: CellFields>(
    system: &mut S,
    t: f64,
    x: &[f64],
    candidates: &[Vec<usize>],
    room: (&mut [f64], &mut [f64]),
    out: &mut Vec<usize>,
) -> Result<Option<usize>, EvalError> {
    let mut two = candidates.iter().enumerate().filter(|c| c.1.len() > 1);
    let (Some((k, pair)), None) = (two.next(), two.next()) else { return Ok(None) };
    let &[a, b] = &pair[..] else { return Ok(None) };
    let (fa, fb) = room;
    system.smooth(t, x, fa)?;
    system.gradients(t, x)?;
    for (_, c) in candidates.iter().enumerate().filter(|(j, _)| *j != k) {
        system.add_cell(t, x, c[0], fa)?;
    }
    fb.copy_from_slice(fa);
    for (cell, f) in [(a, &mut *fa), (b, &mut *fb)] {
        match system.add_cell(t, x, cell, f) {
            Err(EvalError::Recoverable) => return Ok(None),
            r => r?,
        }
    }
    let s = system.subsystem(k);
    let (wa, wb) = (&s.cells[a - s.first].weights, &s.cells[b - s.first].weights);
    // switching functions have no common unit: two of them are left to the search
    if s.by_signs && wa.iter().zip(wb).filter(|(a, b)| a != b).count() > 1 {
        return Ok(None);
    }
    // rates of g_b − g_a under both fields, and the size of their terms
    let (mut ra, mut rb, mut terms) = (0.0f64, 0.0f64, 0.0f64);
    for ((wa, wb), j) in wa.iter().zip(wb).zip(s.functions) {
        let w = wb - wa;
        if w != 0.0 {
            let g = system.gradient(j);
            ra += w * (g.along(fa) + g.t);
            rb += w * (g.along(fb) + g.t);
            terms += w.abs() * (g.size_along(fa).max(g.size_along(fb)) + g.t.abs());
        }
    }
    let clear = DOUBT * terms;
    if ra.is_nan() || rb.is_nan() || ra.abs() <= clear || rb.abs() <= clear || (ra > 0.0 && rb < 0.0) {
        return Ok(None);
    }
    out.clear();
    match (ra > 0.0, rb > 0.0) {
        (true, _) => out.push(a),
        (_, false) => out.push(b),
        _ => out.extend([a, b]),
    }
    Ok(Some(k))
}

fn dot(g: &[f64], v: &[f64]) -> f64 {
    g.iter().zip(v).map(|(g, v)| g * v).sum()
}

/// Size of the terms of a rate.
fn size(g: &[f64], v: &[f64]) -> f64 {
    g.iter().zip(v).map(|(g, v)| (g * v).abs()).sum()
}
