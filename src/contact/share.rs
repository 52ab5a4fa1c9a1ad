//! How contacts share a load that the motion does not divide among them.
//!
//! Rigid bodies that touch in more places than their motion needs leave some forces open: those in the null space of the
//! directions of force, which accelerate nothing. Among the forces of a solution that differ by these, the ones are taken that
//! stay as far within the cones of friction, and from zero, as they can: the least of all distances to a border, each in units
//! of the size of its force, is made as large as possible. Forces on a border would leave it in no time, though nothing of the
//! motion changes there. The linear program `max s, S (r + N y) ≥ s` over the few unknowns `y`, `s` is followed along its
//! central path (S. Boyd, L. Vandenberghe, *Convex Optimization*, 2004, 11.3); distances that no choice makes positive are
//! fixed, and the others are looked at again.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::problem::{Part, Problem, Solution, State};
use crate::system::Kind;

/// Eigenvalues below this share of the largest are zero, as in [`super::least_norm`].
const RANK: f64 = 1e-11;
/// Distances to a border, as shares of their sizes, that are zero.
const NOTHING: f64 = 1e-7;
/// A distance that is as good as any larger one: forces that clamp a body between two walls could grow without end.
const ENOUGH: f64 = 1.0;
/// Sides of the polygon in the disc of friction of a contact in space.
const SIDES: usize = 8;

/// Columns of the directions of force, and the distances to the borders of the cones as rows over all components.
#[derive(Default)]
struct Cones {
    /// Of every unknown: components and weights.
    columns: Vec<Vec<(usize, f64)>>,
    /// Of every distance: components and weights, in units of the size.
    distances: Vec<Vec<(usize, f64)>>,
}

impl Cones {
    /// Takes the directions of a contact in.
    fn add_columns(&mut self, p: &Part, state: &State) {
        let i = p.first;
        match state {
            State::Slides(_) if p.kind.has_no_normal() => {}
            // either sign is as good
            _ if p.kind == Kind::Bilateral => self.columns.push(vec![(i, 1.0)]),
            State::Slides(d) => {
                let friction = (0..p.n_t).map(|k| (i + 1 + k, -p.friction * d[k]));
                self.columns.push(std::iter::once((i, 1.0)).chain(friction).collect());
            }
            _ if p.n_t == 0 || p.stiction <= 0.0 => self.columns.push(vec![(i, 1.0)]),
            _ => self.columns.extend((p.lead()..=i + p.n_t).map(|i| vec![(i, 1.0)])),
        }
    }

    /// Takes the distances of a contact to the borders of its cone in, in this unit of its force.
    fn add_distances(&mut self, p: &Part, state: &State, unit: f64) {
        let i = p.first;
        match state {
            State::Slides(_) if p.kind.has_no_normal() => {}
            _ if p.kind == Kind::Bilateral => {}
            State::Rests if p.n_t > 0 && p.stiction > 0.0 => {
                let mut add = |most: f64, d: [f64; 2]| {
                    let friction = (0..p.n_t).map(|k| (i + 1 + k, -d[k] / unit));
                    self.distances.push(std::iter::once((i, most / unit)).chain(friction).collect());
                };
                if p.n_t == 1 {
                    [1.0, -1.0].into_iter().for_each(|d| add(p.stiction, [d, 0.0]));
                } else {
                    let angle = std::f64::consts::PI / SIDES as f64;
                    let sides = (0..SIDES).map(|k| 2.0 * angle * k as f64);
                    sides.for_each(|a| add(p.stiction * angle.cos(), [a.cos(), a.sin()]));
                }
            }
            _ => self.distances.push(vec![(i, 1.0 / unit)]),
        }
    }

    /// A basis of the forces that accelerate nothing: one column for each, over all components of `problem`.
    fn null_space(&self, problem: &Problem) -> Option<DMatrix<f64>> {
        let (n, m) = (problem.free.len(), self.columns.len());
        let product = |a: &[(usize, f64)], b: &[(usize, f64)]| -> f64 {
            a.iter().flat_map(|(i, v)| b.iter().map(move |(j, w)| v * w * problem.matrix[i * n + j])).sum()
        };
        let size: Vec<f64> = self.columns.iter().map(|c| product(c, c).max(f64::MIN_POSITIVE).sqrt()).collect();
        // of equal weights, as the units of forces and torques differ
        let k = DMatrix::from_fn(m, m, |i, j| product(&self.columns[i], &self.columns[j]) / (size[i] * size[j]));
        if k.iter().any(|v| !v.is_finite()) {
            return None;
        }
        let SymmetricEigen { eigenvalues, eigenvectors } = SymmetricEigen::new(k);
        let zero = RANK * eigenvalues.max();
        let free: Vec<usize> = (0..m).filter(|k| eigenvalues[*k] <= zero).collect();
        let mut out = DMatrix::zeros(n, free.len());
        for (l, &k) in free.iter().enumerate() {
            for (j, c) in self.columns.iter().enumerate() {
                c.iter().for_each(|(i, w)| out[(*i, l)] += w * eigenvectors[(j, k)] / size[j]);
            }
        }
        Some(out).filter(|o| o.ncols() > 0)
    }
}

impl Problem {
    /// Moves the forces of a solution away from the borders of the cones, as far as the motion does not tell them; contacts
    /// that may have a force and do not move rest. Says whether there are such forces.
    pub(super) fn share_loads(&self, s: &mut Solution) -> bool {
        let (mut cones, mut states) = (Cones::default(), s.states.clone());
        for (p, state) in self.parts.iter().zip(&mut states) {
            if *state == State::Open {
                let Some(closed) = self.may_push(p, s) else { continue };
                *state = closed;
            }
            cones.add_columns(p, state);
        }
        if cones.columns.len() < 2 {
            return false;
        }
        let Some(mut null) = cones.null_space(self) else { return false };
        let mut r = DVector::from_column_slice(&s.r);
        let units = self.loads(&self.told(&r, &null));
        for (p, (state, unit)) in self.parts.iter().zip(states.iter().zip(&units)) {
            cones.add_distances(p, state, *unit);
        }
        let mut rows: Vec<Vec<(usize, f64)>> = cones.distances;
        while null.ncols() > 0 {
            let along = |row: &[(usize, f64)], k: usize| row.iter().map(|(i, w)| w * null[(*i, k)]).sum::<f64>();
            let mut table: Vec<Vec<f64>> =
                rows.iter().map(|row| (0..null.ncols()).map(|k| along(row, k)).collect()).collect();
            // in units in which the largest change is one
            let largest = table.iter().flatten().fold(0.0f64, |m, v| m.max(v.abs()));
            if largest <= 0.0 {
                break;
            }
            null /= largest;
            table.iter_mut().flatten().for_each(|v| *v /= largest);
            // distances that the load does not change are what they are
            let still: Vec<bool> = table.iter().map(|t| t.iter().all(|v| v.abs() <= NOTHING)).collect();
            let mut keep = still.iter().map(|t| !t);
            rows.retain(|_| keep.next().unwrap_or(true));
            let mut keep = still.iter().map(|t| !t);
            table.retain(|_| keep.next().unwrap_or(true));
            let told = self.told(&r, &null);
            let start: Vec<f64> = rows.iter().map(|row| row.iter().map(|(i, w)| w * told[*i]).sum()).collect();
            let Some((y, least, weights)) = farthest(&table, &start) else { break };
            if least > NOTHING {
                r = told + &null * &y;
                break;
            }
            // what cannot be left is fixed
            let most = weights.iter().fold(0.0f64, |m, v| m.max(*v));
            let fixed: Vec<usize> = (0..rows.len()).filter(|j| weights[*j] >= 1e-3 * most).collect();
            let a = DMatrix::from_fn(fixed.len(), null.ncols(), |j, k| table[fixed[j]][k]);
            let SymmetricEigen { eigenvalues, eigenvectors } = SymmetricEigen::new(a.transpose() * &a);
            let zero = NOTHING * eigenvalues.max();
            let left: Vec<usize> = (0..null.ncols()).filter(|k| eigenvalues[*k] <= zero).collect();
            null = DMatrix::from_fn(r.len(), left.len(), |i, l| {
                null.row(i).transpose().dot(&eigenvectors.column(left[l]))
            });
            let mut index = 0..;
            rows.retain(|_| index.next().is_none_or(|j| !fixed.contains(&j)));
        }
        let mut moved = Solution { states, r: r.as_slice().to_vec(), z: Vec::new() };
        moved.z = self.residual(&moved.r);
        for (p, (state, before)) in self.parts.iter().zip(moved.states.iter_mut().zip(&s.states)) {
            if *before == State::Open && moved.r[p.first] <= NOTHING * self.force_scale(p, p.first, &moved.r) {
                *state = State::Open;
            }
        }
        if self.holds(&moved) && self.same_motion(s, &moved) {
            *s = moved;
        }
        true
    }

    /// Forces without their part in the null space, orthogonal in units in which all components have equal weights: what clamps bodies would else grow
    /// with every problem that begins with the forces of the last one.
    fn told(&self, r: &DVector<f64>, null: &DMatrix<f64>) -> DVector<f64> {
        let n = r.len();
        let weights = DVector::from_fn(n, |i, _| self.matrix[i * n + i].max(f64::MIN_POSITIVE));
        let weighted = DMatrix::from_fn(n, null.ncols(), |i, k| weights[i] * null[(i, k)]);
        let part = (weighted.transpose() * null).cholesky().map(|c| c.solve(&(weighted.transpose() * r)));
        part.map_or_else(|| r.clone(), |part| r - null * part)
    }

    /// Units of the forces of all contacts: what of them the load makes, and a trace of the largest load where there is none.
    fn loads(&self, told: &DVector<f64>) -> Vec<f64> {
        let n = told.len();
        let own = |p: &Part| {
            let i = p.lead();
            let row = self.matrix[i * n..(i + 1) * n].iter().zip(told.iter());
            (row.fold(self.free[i].abs(), |s, (w, r)| s + (w * r).abs()), self.matrix[i * n + i].max(f64::MIN_POSITIVE))
        };
        // of energy: gaps have units of their own
        let largest = self.parts.iter().map(own).map(|(z, w)| z / w.sqrt()).fold(0.0, f64::max);
        let unit = |(z, w): (f64, f64)| (z / w).max(NOTHING * largest / w.sqrt()).max(f64::MIN_POSITIVE);
        self.parts.iter().map(|p| if p.kind == Kind::Switch { p.stiction } else { unit(own(p)) }).collect()
    }

    /// What a contact without a force does if it does not open, and so may have one.
    pub(super) fn may_push(&self, p: &Part, s: &Solution) -> Option<State> {
        let i = p.first;
        if s.z[i].abs() > self.noise(p, i, &s.r) {
            return None;
        }
        if let Some(d) = p.slides {
            return Some(State::Slides(d));
        }
        let size = s.z[i + 1..=i + p.n_t].iter().map(|z| z * z).sum::<f64>().sqrt();
        let noise = (1..=p.n_t).map(|k| self.noise(p, i + k, &s.r)).fold(0.0, f64::max);
        if size <= noise {
            return Some(State::Rests);
        }
        let mut d = [0.0; 2];
        d.iter_mut().zip(&s.z[i + 1..=i + p.n_t]).for_each(|(d, z)| *d = z / size);
        Some(State::Slides(d))
    }
}

/// The `y` for which the least of `start + table y` is largest, that least, and the weights with which the distances hold it
/// back.
fn farthest(table: &[Vec<f64>], start: &[f64]) -> Option<(DVector<f64>, f64, Vec<f64>)> {
    const ITERATIONS: usize = 20;
    let (m, k) = (table.len(), table.first()?.len());
    let value =
        |z: &DVector<f64>, j: usize| table[j].iter().enumerate().fold(start[j], |s, (l, t)| s + t * z[l]) - z[k];
    // unknowns y and the least distance, which begins below all
    let mut z = DVector::zeros(k + 1);
    let size = start.iter().fold(1.0f64, |m, v| m.max(v.abs()));
    z[k] = start.iter().fold(0.5, |m: f64, v| m.min(*v)) - size;
    let mut share = size;
    let cost = |z: &DVector<f64>, share: f64| -> f64 {
        let barrier: f64 = (0..m).map(|j| -value(z, j).ln()).sum();
        -z[k] / share - (ENOUGH - z[k]).ln() + barrier + 0.5 * z.rows(0, k).norm_squared()
    };
    while share > 0.1 * NOTHING / m as f64 {
        for _ in 0..ITERATIONS {
            let mut gradient = DVector::zeros(k + 1);
            let mut hessian = DMatrix::zeros(k + 1, k + 1);
            gradient.rows_mut(0, k).copy_from(&z.rows(0, k));
            let left = 1.0 / (ENOUGH - z[k]);
            gradient[k] += left - 1.0 / share;
            hessian[(k, k)] = left * left;
            // of all that are as far away the least
            (0..k).for_each(|l| hessian[(l, l)] = 1.0);
            for (j, row) in table.iter().enumerate() {
                let d = 1.0 / value(&z, j);
                let row = DVector::from_iterator(k + 1, row.iter().copied().chain([-1.0]));
                gradient.axpy(-d, &row, 1.0);
                hessian.ger(d * d, &row, &row, 1.0);
            }
            let step = hessian.cholesky()?.solve(&-&gradient);
            let decrement = -gradient.dot(&step);
            // as far as all distances stay positive
            let mut length = if step[k] > 0.0 { (0.9 * (ENOUGH - z[k]) / step[k]).min(1.0) } else { 1.0f64 };
            for (j, row) in table.iter().enumerate() {
                let rate = row.iter().enumerate().map(|(l, t)| t * step[l]).sum::<f64>() - step[k];
                if rate < 0.0 {
                    length = length.min(-0.9 * value(&z, j) / rate);
                }
            }
            let here = cost(&z, share);
            while length > 1e-10 && cost(&(&z + length * &step), share) > here - 0.1 * length * decrement {
                length *= 0.5;
            }
            if decrement <= 1e-6 || decrement.is_nan() || length <= 1e-10 {
                break;
            }
            z += length * step;
        }
        share *= 0.1;
    }
    let share = 10.0 * share;
    let weights = (0..m).map(|j| share / value(&z, j)).collect();
    let y = z.rows(0, k).into_owned();
    let least = (0..m).map(|j| value(&z, j) + z[k]).fold(f64::INFINITY, f64::min);
    least.is_finite().then_some((y, least, weights))
}
