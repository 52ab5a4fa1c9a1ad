//! What the branches of a program with linear rows show: that it has no point, a point, or a ray along which the objective falls.
//!
//! With the sides of some pairs chosen and the others left open the linear rows and the bounds are a linear program, which holds
//! all branches with these sides. A tree of such programs ends where each one is shown to be empty ([`Simplex`]), which is a proof for
//! the whole program, its nonlinear rows included, or at a point of a branch. Rays are looked for in the same way, among the
//! directions in which no bound ends.
//!
//! Rows count as linear where their values follow the first derivatives of one point at others, up to a million times as far out.

use super::problem::{Mpcc, Side};
use super::simplex::{Found, Simplex};
use crate::linalg::csc::Pattern;
use crate::nlp::{within, Bounds, INFINITE};
use crate::random::SplitMix64;
use crate::stop;

/// Distances of the points at which rows are compared with their linearisation, relative to sizes of variables above one, and how
/// many points at each.
pub(super) const DISTANCES: [f64; 4] = [1e-3, 1.0, 1e3, 1e6];
pub(super) const DRAWS: usize = 3;
/// What a linear row may differ from it by, relative to its terms: rounding.
const LINEAR: f64 = 1e-12;
/// Entries of tableaus of a search: a second at most.
const WORK: f64 = 5e8;
/// Entries of a tableau that is not too large for one.
const ENTRIES: f64 = 1e6;
/// A member of a pair that is zero, in units in which the rows have entries of one.
const ZERO: f64 = 1e-9;
/// Points along a ray at which the objective is asked, each so many times as far out as the last one; and what rounding
/// may leave of slopes that are the same.
const POINTS: usize = 10;
const APART: f64 = 8.0;
const SLOPE: f64 = 1e-6;

/// What was found in a branch.
#[derive(Debug, Clone)]
pub(super) struct Place {
    /// Point `[n]` whose linear rows, bounds and pairs hold.
    pub x: Vec<f64>,
    /// Sides of the groups.
    pub sides: Vec<Side>,
}

/// What the branches show.
#[derive(Debug, Clone)]
pub(super) enum Said {
    /// None has a point.
    Empty,
    /// The linear rows of one hold here.
    Holds(Place),
    /// Nothing.
    Open,
}

/// The linear part of a program.
pub(super) struct Branches<'a> {
    pub(super) pairs: &'a [(usize, usize)],
    groups: Vec<usize>,
    pub(super) n_groups: usize,
    pub(super) n: usize,
    pub(super) bounds: Bounds,
    /// Linear rows `[k · n]` by rows, with bounds without the constants.
    pub(super) rows: Vec<f64>,
    pub(super) sides: Vec<(f64, f64)>,
    /// Are all rows linear?
    pub complete: bool,
}

pub(super) fn goes_on() -> bool {
    stop::requested().is_none()
}

impl Branches<'_> {
    /// The linear part of a program near the point `x`; nothing where it is too large, or where functions have no value.
    pub fn new<'a>(p: &mut dyn Mpcc, pairs: &'a [(usize, usize)], bounds: &Bounds, x: &[f64]) -> Option<Branches<'a>> {
        Branches::part(p, pairs, bounds, x, false)
    }

    /// The same of a program all of whose rows are linear; nothing for others.
    pub fn linear<'a>(
        p: &mut dyn Mpcc,
        pairs: &'a [(usize, usize)],
        bounds: &Bounds,
        x: &[f64],
    ) -> Option<Branches<'a>> {
        Branches::part(p, pairs, bounds, x, true)
    }

    fn part<'a>(
        p: &mut dyn Mpcc,
        pairs: &'a [(usize, usize)],
        bounds: &Bounds,
        x: &[f64],
        all: bool,
    ) -> Option<Branches<'a>> {
        let (n, m) = (p.n(), p.m());
        if (n as f64) * (m + n) as f64 > ENTRIES {
            return None;
        }
        let base = inside(bounds, x);
        let (mut c, mut grad, mut jac) = (vec![0.0; m], vec![0.0; n], vec![0.0; p.jac_pattern().nnz()]);
        p.eval(&base, &mut c).ok()?;
        p.derivatives(&base, &mut grad, &mut jac).ok()?;
        // values and sizes of the terms of the rows, by the derivatives at the base
        let along = |pattern: &Pattern, x: &[f64], values: &mut [(f64, f64)]| {
            values.fill((0.0, 0.0));
            for (j, x) in x.iter().enumerate() {
                for k in pattern.range(j) {
                    let v = &mut values[pattern.row_idx()[k]];
                    *v = (v.0 + jac[k] * x, v.1 + (jac[k] * x).abs());
                }
            }
        };
        let (mut at, mut there) = (vec![(0.0, 0.0); m], vec![(0.0, 0.0); m]);
        along(p.jac_pattern(), &base, &mut at);
        let constants: Vec<f64> = (0..m).map(|i| c[i] - at[i].0).collect();
        let mut linear: Vec<bool> = (0..m).map(|i| constants[i].is_finite()).collect();
        let mut draw = SplitMix64::new(0);
        let mut other = base.clone();
        for distance in DISTANCES.iter().flat_map(|d| [*d; DRAWS]) {
            for (j, x) in other.iter_mut().enumerate() {
                let away = distance * base[j].abs().max(1.0) * (2.0 * draw.share() - 1.0);
                *x = within(base[j] + away, bounds.xl[j], bounds.xu[j]);
            }
            along(p.jac_pattern(), &other, &mut there);
            p.eval(&other, &mut c).ok()?;
            for i in 0..m {
                let size = there[i].1 + constants[i].abs() + at[i].1;
                linear[i] &= (c[i] - constants[i] - there[i].0).abs() <= LINEAR * size;
            }
            if all && linear.contains(&false) {
                return None;
            }
        }
        let mut rows = vec![0.0; m * n];
        for j in 0..n {
            for k in p.jac_pattern().range(j) {
                rows[p.jac_pattern().row_idx()[k] * n + j] += jac[k];
            }
        }
        let mut part = Branches {
            pairs,
            groups: (0..pairs.len()).map(|k| p.group(k)).collect(),
            n_groups: p.n_groups(),
            n,
            bounds: bounds.clone(),
            rows: Vec::new(),
            sides: Vec::new(),
            complete: linear.iter().all(|l| *l),
        };
        for i in (0..m).filter(|i| linear[*i]) {
            part.rows.extend_from_slice(&rows[i * n..][..n]);
            part.sides.push((bounds.cl[i] - constants[i], bounds.cu[i] - constants[i]));
        }
        Some(part)
    }

    /// The linearised rows of a program at a point `x` with rows `c[m]` and Jacobian `jac[nnz]`.
    pub fn linearised<'a>(
        p: &dyn Mpcc,
        pairs: &'a [(usize, usize)],
        bounds: Bounds,
        x: &[f64],
        (c, jac): (&[f64], &[f64]),
    ) -> Branches<'a> {
        let (n, m) = (p.n(), p.m());
        let (mut rows, mut constants) = (vec![0.0; m * n], c.to_vec());
        for j in 0..n {
            for k in p.jac_pattern().range(j) {
                let i = p.jac_pattern().row_idx()[k];
                rows[i * n + j] += jac[k];
                constants[i] -= jac[k] * x[j];
            }
        }
        let sides = (0..m).map(|i| (bounds.cl[i] - constants[i], bounds.cu[i] - constants[i])).collect();
        let groups = (0..pairs.len()).map(|k| p.group(k)).collect();
        Branches { pairs, groups, n_groups: p.n_groups(), n, bounds, rows, sides, complete: false }
    }

    /// The point within the bounds next to `x`.
    pub fn inside(&self, x: &[f64]) -> Vec<f64> {
        inside(&self.bounds, x)
    }

    pub(super) fn m(&self) -> usize {
        self.sides.len()
    }

    /// Bounds with the chosen sides; `ends`: what ends where, for points, or nothing but the directions that no bound ends.
    pub(super) fn set(&self, lp: &mut Simplex, chosen: &[Option<Side>], directions: bool) {
        let of = |lo: f64, hi: f64| -> (f64, f64) {
            let (below, above) = (lo > -INFINITE, hi < INFINITE);
            match directions {
                true => (if below { 0.0 } else { f64::NEG_INFINITY }, if above { 0.0 } else { f64::INFINITY }),
                false => (if below { lo } else { f64::NEG_INFINITY }, if above { hi } else { f64::INFINITY }),
            }
        };
        for j in 0..self.n {
            let (lo, hi) = of(self.bounds.xl[j], self.bounds.xu[j]);
            lp.bound(j, lo, hi);
        }
        for (i, s) in self.sides.iter().enumerate() {
            let (lo, hi) = of(s.0, s.1);
            lp.bound(self.n + i, lo, hi);
        }
        for (k, &(a, b)) in self.pairs.iter().enumerate() {
            if let Some(side) = chosen[self.groups[k]] {
                lp.bound(if side == Side::First { a } else { b }, 0.0, 0.0);
            }
        }
    }

    /// Sides of all groups at the point of `lp`, those that are chosen as they are; the open group whose smaller members are
    /// largest, where they are not zero.
    pub(super) fn read(&self, lp: &Simplex, chosen: &[Option<Side>]) -> (Vec<Option<Side>>, Option<usize>) {
        let mut votes = vec![(0f64, 0f64); self.n_groups];
        for (k, &(a, b)) in self.pairs.iter().enumerate() {
            let v = &mut votes[self.groups[k]];
            *v = (v.0.max(lp.scaled(a)), v.1.max(lp.scaled(b)));
        }
        let (mut all, mut worst, mut most) = (chosen.to_vec(), None, ZERO);
        for (g, v) in votes.iter().enumerate().filter(|g| chosen[g.0].is_none()) {
            all[g] = Some(if v.0 <= v.1 { Side::First } else { Side::Second });
            if v.0.min(v.1) > most {
                (worst, most) = (Some(g), v.0.min(v.1));
            }
        }
        (all, worst)
    }

    /// The branch that is chosen, and what is at its point.
    fn place(lp: &Simplex, all: &[Option<Side>]) -> Place {
        Place { x: lp.point().collect(), sides: all.iter().map(|s| s.unwrap_or(Side::First)).collect() }
    }

    /// Has one of the branches a point at which the linear rows hold?
    pub fn point(&self) -> Said {
        let mut lp = Simplex::new(self.n, self.m(), self.rows.clone());
        lp.allowed = WORK;
        let (mut open, mut nodes) = (false, vec![vec![None; self.n_groups]]);
        while let Some(chosen) = nodes.pop() {
            self.set(&mut lp, &chosen, false);
            match lp.feasible(&goes_on) {
                Found::Infeasible => continue,
                Found::Point => {}
                _ if lp.work > lp.allowed || !goes_on() => return Said::Open,
                // what is not seen of all branches together may be seen of each
                _ => {
                    match chosen.iter().position(Option::is_none) {
                        Some(g) => nodes.extend(both(&chosen, g, Side::First)),
                        None => open = true,
                    }
                    continue;
                }
            }
            let (all, worst) = self.read(&lp, &chosen);
            if worst.is_none() {
                self.set(&mut lp, &all, false);
                if lp.feasible(&goes_on) == Found::Point {
                    return Said::Holds(Branches::place(&lp, &all));
                }
            }
            match worst.or_else(|| chosen.iter().position(Option::is_none)) {
                Some(g) => nodes.extend(both(&chosen, g, all[g].unwrap_or(Side::First))),
                None => open = true,
            }
        }
        if open {
            Said::Open
        } else {
            Said::Empty
        }
    }

    /// A branch with a point, and a ray from there along which the objective `f` of `p` falls at each of many points at least as
    /// steeply as before: the point, a step along the ray, and that step. Asked are a
    /// `start` and a point `far` out on what may be such a ray.
    pub fn ray(&self, p: &mut dyn Mpcc, [start, far]: [&[f64]; 2]) -> Option<(Place, Vec<f64>)> {
        if !self.complete {
            return None;
        }
        let (mut grad, mut jac) = (vec![0.0; self.n], vec![0.0; p.jac_pattern().nnz()]);
        // a direction in which the objective is not curved, if there is one; else one in which it falls at the point far out
        let flat = self.curvature(p, start)?;
        for (rows, at) in [(Some(&flat), start), (None, far)] {
            p.derivatives(at, &mut grad, &mut jac).ok()?;
            let extra = rows.map_or(0, |r| r.len() / self.n);
            let all = self.rows.iter().chain(rows.into_iter().flatten()).copied().collect();
            let mut directions = Simplex::new(self.n, self.m() + extra, all);
            let mut points = Simplex::new(self.n, self.m(), self.rows.clone());
            (directions.allowed, points.allowed) = (WORK, WORK);
            let mut nodes = vec![vec![None; self.n_groups]];
            while let Some(chosen) = nodes.pop() {
                if !goes_on() || directions.work > WORK || points.work > WORK {
                    return None;
                }
                self.set(&mut directions, &chosen, true);
                (0..extra).for_each(|i| directions.bound(self.n + self.m() + i, 0.0, 0.0));
                self.set(&mut points, &chosen, false);
                let falls = directions.feasible(&goes_on) == Found::Point
                    && directions.minimise(&grad, &goes_on) == Found::Ray
                    && points.feasible(&goes_on) != Found::Infeasible;
                if !falls {
                    continue;
                }
                let Some(g) = chosen.iter().position(Option::is_none) else {
                    if points.feasible(&goes_on) != Found::Point {
                        continue;
                    }
                    let (place, d) = (Branches::place(&points, &chosen), directions.ray().collect::<Vec<f64>>());
                    if let Some(step) = falls_for_ever(p, &place.x, &d) {
                        return Some((place, step));
                    }
                    continue;
                };
                let ray: Vec<f64> = directions.ray().collect();
                let of = |second: bool| -> f64 {
                    let members = self.pairs.iter().enumerate().filter(|k| self.groups[k.0] == g);
                    members.map(|(_, &(a, b))| ray[if second { b } else { a }].abs()).sum()
                };
                nodes.extend(both(&chosen, g, if of(false) <= of(true) { Side::First } else { Side::Second }));
            }
        }
        None
    }

    /// The rows of the Hessian of the objective that are not zero, `[k · n]` by rows.
    fn curvature(&self, p: &mut dyn Mpcc, x: &[f64]) -> Option<Vec<f64>> {
        let n = self.n;
        let mut values = vec![0.0; p.hess_pattern().nnz()];
        p.hessian(x, 1.0, &vec![0.0; p.m()], &mut values).ok()?;
        let mut full = vec![0.0; n * n];
        for j in 0..n {
            for k in p.hess_pattern().range(j) {
                let i = p.hess_pattern().row_idx()[k];
                full[i * n + j] = values[k];
                full[j * n + i] = values[k];
            }
        }
        if full.iter().any(|v| !v.is_finite()) {
            return None;
        }
        Some(full.chunks(n).filter(|row| row.iter().any(|v| *v != 0.0)).flatten().copied().collect())
    }
}

fn inside(bounds: &Bounds, x: &[f64]) -> Vec<f64> {
    x.iter().enumerate().map(|(j, x)| within(*x, bounds.xl[j], bounds.xu[j])).collect()
}

/// The two choices for a group, the one to look at first last.
pub(super) fn both(chosen: &[Option<Side>], group: usize, first: Side) -> [Vec<Option<Side>>; 2] {
    [first.other(), first].map(|side| {
        let mut next = chosen.to_vec();
        next[group] = Some(side);
        next
    })
}

/// Does the objective fall from `x` along `d` without end? A step along it that leads out of the size of the point, if so.
fn falls_for_ever(p: &mut dyn Mpcc, x: &[f64], d: &[f64]) -> Option<Vec<f64>> {
    let size = x.iter().fold(1f64, |a, v| a.max(v.abs()));
    let longest = d.iter().fold(0f64, |a, v| a.max(v.abs()));
    let mut c = vec![0.0; p.m()];
    let mut at = |t: f64| -> Option<f64> {
        let y: Vec<f64> = x.iter().zip(d).map(|(x, d)| x + t * d).collect();
        p.eval(&y, &mut c).ok()
    };
    let (mut slope, mut t) = (f64::NEG_INFINITY, 0.0);
    let mut value = at(0.0)?;
    let mut slopes = Vec::new();
    for _ in 0..POINTS {
        let next = if t == 0.0 { size / longest } else { APART * t };
        let f = at(next)?;
        slope = (f - value) / (next - t);
        slopes.push(slope);
        (t, value) = (next, f);
    }
    // the first ones may rise, or be rounding beside what does not depend on the ray
    let later = &slopes[POINTS / 2..];
    let falls = slope.is_finite() && later.windows(2).all(|s| s[1] < 0.0 && s[1] <= s[0] + SLOPE * s[0].abs());
    falls.then(|| d.iter().map(|d| d * size / longest).collect())
}
