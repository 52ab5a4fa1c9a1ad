//! Forces of least energy, from which the search for solutions of many contacts begins.
//!
//! The forces within the cones of friction that minimise `½ rᵀ W r + wᵀ r` are those of the problem without friction exactly;
//! with friction they are the solution where the minimum brings everything to rest (`W r + w = 0`), and near one otherwise:
//! sliding contacts would be lifted (M. Anitescu, *Optimization-based simulation of nonsmooth rigid multibody dynamics*, Math.
//! Program. 105 (2006)). So a heap that can stand stands, though other motions may satisfy Coulomb's law, too. With the edges of the cones as unknowns that are
//! not negative it is solved by the active sets of C. L. Lawson and R. J. Hanson, *Solving Least Squares Problems* (1974), chapter
//! 23.

use super::least_norm::LeastNorm;
use super::problem::{Part, Problem};
use crate::system::Kind;

/// Edges of the cone of a contact in space.
const EDGES: usize = 8;
/// What is smaller than this share of its size is zero.
const ZERO: f64 = 1e-10;

/// A force along an edge of the cone of a contact: the place of its normal component, and its components.
struct Edge {
    first: usize,
    force: [f64; 3],
}

fn edges(p: &Part, out: &mut Vec<Edge>) {
    let mu = p.friction;
    match p.kind {
        // what is not in proportion to a force has no cone: the search begins without it
        Kind::Joint | Kind::Switch => return,
        Kind::Bilateral => return out.extend([1.0, -1.0].map(|n| Edge { first: p.first, force: [n, 0.0, 0.0] })),
        Kind::Unilateral => {}
    }
    let mut add = |d: [f64; 2]| out.push(Edge { first: p.first, force: [1.0, mu * d[0], mu * d[1]] });
    match (p.slides, p.n_t) {
        (Some(d), _) => add([-d[0], -d[1]]),
        (None, n) if n == 0 || mu <= 0.0 => add([0.0; 2]),
        (None, 1) => [[1.0, 0.0], [-1.0, 0.0]].into_iter().for_each(add),
        (None, _) => (0..EDGES).for_each(|k| {
            let angle = 2.0 * std::f64::consts::PI * k as f64 / EDGES as f64;
            add([angle.cos(), angle.sin()]);
        }),
    }
}

impl Problem {
    /// The forces, or none where rounding does not let the iteration end.
    pub(super) fn least_energy(&self) -> Option<Vec<f64>> {
        let n = self.free.len();
        let (mut all, mut owner) = (Vec::new(), Vec::new());
        for (k, p) in self.parts.iter().enumerate() {
            edges(p, &mut all);
            owner.resize(all.len(), k);
        }
        let m = all.len();
        let components = |e: usize| 1 + self.parts[owner[e]].n_t;
        let along =
            |e: usize, v: &[f64]| -> f64 { (0..components(e)).map(|k| all[e].force[k] * v[all[e].first + k]).sum() };
        // energy in terms of the edges: ½ cᵀ A c + bᵀ c
        let mut matrix = vec![0.0; m * m];
        let mut column = vec![0.0; n];
        for j in 0..m {
            for (i, c) in column.iter_mut().enumerate() {
                *c = (0..components(j)).map(|k| self.matrix[i * n + all[j].first + k] * all[j].force[k]).sum();
            }
            (0..m).for_each(|i| matrix[i * m + j] = along(i, &column));
        }
        let b: Vec<f64> = (0..m).map(|j| along(j, &self.free)).collect();
        let size = |j: usize| {
            let p = &self.parts[owner[j]];
            self.free[p.first..=p.first + p.n_t].iter().fold(p.size, |s, v| s.max(v.abs()))
        };
        let c = minimise(&matrix, &b, &size)?;
        let mut r = vec![0.0; n];
        for (j, c) in c.iter().enumerate() {
            (0..components(j)).for_each(|k| r[all[j].first + k] += c * all[j].force[k]);
        }
        Some(r)
    }
}

/// Minimises `½ cᵀ A c + bᵀ c` over `c ≥ 0`, where `A` is positive semidefinite; slopes are compared with the sizes of their terms.
fn minimise(a: &[f64], b: &[f64], size: &dyn Fn(usize) -> f64) -> Option<Vec<f64>> {
    let m = b.len();
    let (mut c, mut free) = (vec![0.0; m], vec![false; m]);
    let mut barred = vec![false; m];
    let mut solver = LeastNorm::with_capacity(m.min(64));
    for _ in 0..4 * m + 10 {
        let slope = |j: usize| (0..m).map(|k| a[j * m + k] * c[k]).sum::<f64>() + b[j];
        let terms = |j: usize| (0..m).map(|k| (a[j * m + k] * c[k]).abs()).sum::<f64>() + size(j);
        let steepest = (0..m)
            .filter(|&j| !free[j] && !barred[j])
            .map(|j| (slope(j) / terms(j).max(f64::MIN_POSITIVE), j))
            .min_by(|x, y| x.0.total_cmp(&y.0));
        let Some((_, j)) = steepest.filter(|s| s.0 < -ZERO) else { return Some(c) };
        free[j] = true;
        for _ in 0..=m {
            let held: Vec<usize> = (0..m).filter(|k| free[*k]).collect();
            let n = held.len();
            let entries = solver.clear(n);
            for (r, &i) in held.iter().enumerate() {
                held.iter().enumerate().for_each(|(s, &k)| entries[r * n + s] = a[i * m + k]);
            }
            if !solver.factorise() {
                return None;
            }
            let mut next: Vec<f64> = held.iter().map(|&k| -b[k]).collect();
            solver.solve(&mut next);
            // as far as all stay positive
            let step = held.iter().zip(&next).filter(|(_, v)| **v <= 0.0).map(|(&k, v)| c[k] / (c[k] - v));
            let step = step.filter(|s| !s.is_nan()).fold(1.0, f64::min);
            held.iter().zip(&next).for_each(|(&k, v)| c[k] += step * (v - c[k]));
            let mut left = false;
            for (&k, v) in held.iter().zip(&next) {
                if *v <= 0.0 && c[k] <= ZERO * v.abs() {
                    (c[k], free[k], left) = (0.0, false, true);
                }
            }
            if step >= 1.0 && !left {
                break;
            }
        }
        // what came and went at once does not come again before something else has
        if free[j] {
            barred.fill(false);
        } else {
            barred[j] = true;
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::super::problem::Room;
    use super::*;

    #[test]
    fn minima_over_positive_numbers() {
        // the second is pushed out by the first
        let c = minimise(&[2.0, 1.0, 1.0, 1.0], &[-2.0, -0.5], &|_| 1.0).unwrap();
        assert!((c[0] - 1.0).abs() < 1e-14 && c[1] == 0.0, "{c:?}");
        let c = minimise(&[2.0, 1.0, 1.0, 1.0], &[-2.0, -1.5], &|_| 1.0).unwrap();
        assert!((c[0] - 0.5).abs() < 1e-14 && (c[1] - 1.0).abs() < 1e-14, "{c:?}");
        // the same edge twice
        let c = minimise(&[1.0; 4], &[-1.0; 2], &|_| 1.0).unwrap();
        assert!((c[0] + c[1] - 1.0).abs() < 1e-12 && c.iter().all(|c| *c >= 0.0), "{c:?}");
    }

    /// Weights, normal and tangential distances of three rows of discs that touch.
    fn pyramid(rows: usize, mu: f64) -> Problem {
        let (r, gravity) = (0.5f64, 9.81);
        let at: Vec<[f64; 2]> = (0..rows)
            .flat_map(|i| {
                (0..rows - i).map(move |j| [2.0 * r * j as f64 + r * i as f64, r + i as f64 * r * 3f64.sqrt()])
            })
            .collect();
        let n = at.len();
        let mut g: Vec<Vec<f64>> = Vec::new();
        let mut add = |i: usize, other: Option<usize>, d: [f64; 2]| {
            let (mut normal, mut tangent) = (vec![0.0; 3 * n], vec![0.0; 3 * n]);
            for (body, sign) in std::iter::once((i, 1.0)).chain(other.map(|j| (j, -1.0))) {
                (normal[3 * body], normal[3 * body + 1]) = (sign * d[0], sign * d[1]);
                (tangent[3 * body], tangent[3 * body + 1]) = (-sign * d[1], sign * d[0]);
                tangent[3 * body + 2] = -r;
            }
            g.push(normal);
            g.push(tangent);
        };
        for i in 0..n {
            if at[i][1] == r {
                add(i, None, [0.0, 1.0]);
            }
            for j in 0..i {
                let d = [at[i][0] - at[j][0], at[i][1] - at[j][1]];
                let length = d[0].hypot(d[1]);
                if length < 2.0 * r + 1e-9 {
                    add(i, Some(j), [d[0] / length, d[1] / length]);
                }
            }
        }
        // unit masses, discs: inertia r²/2
        let weight = |k: usize| if k % 3 == 2 { 2.0 / (r * r) } else { 1.0 };
        let product =
            |a: &[f64], b: &[f64]| a.iter().zip(b).enumerate().map(|(k, (a, b))| weight(k) * a * b).sum::<f64>();
        let matrix = g.iter().flat_map(|a| g.iter().map(|b| product(a, b)).collect::<Vec<_>>()).collect();
        let fall: Vec<f64> = (0..3 * n).map(|k| if k % 3 == 1 { -gravity } else { 0.0 }).collect();
        let free = g.iter().map(|a| a.iter().zip(&fall).map(|(a, f)| a * f).sum()).collect();
        let part = |k: usize| Part {
            first: 2 * k,
            n_t: 1,
            friction: mu,
            stiction: mu,
            kind: Kind::Unilateral,
            slides: None,
            given: None,
            size: gravity,
        };
        Problem { parts: (0..g.len() / 2).map(part).collect(), matrix, free, ..Problem::default() }
    }

    /// Pyramids of discs stand where friction allows it, tan 15° for two rows, though they could also roll apart.
    #[test]
    fn pyramids_stand_that_can() {
        for (rows, mu) in [(2, 0.27), (2, 0.5), (3, 0.5), (4, 0.6), (5, 0.7)] {
            let p = pyramid(rows, mu);
            let s = p.solve(&mut Room::with_capacity(8));
            assert!(!s.all.is_empty(), "{rows} {mu}");
            let worst = s.all[0].z.iter().fold(0.0f64, |m, z| m.max(z.abs()));
            assert!(worst < 1e-8, "{rows} {mu}: {worst}");
        }
        let p = pyramid(2, 0.26);
        let s = p.solve(&mut Room::with_capacity(8));
        assert!(!s.all.is_empty() && s.all[0].z.iter().any(|z| *z > 1e-3));
    }
}
