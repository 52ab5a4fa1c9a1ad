//! Contact problems as linear complementarity problems, with the cones of friction as polygons.
//!
//! In the plane a polygon of two sides is the cone exactly. With normal forces `r_n`, shares `β` of the sides `d` of the polygon
//! and the sliding speed `γ` of every contact,
//!
//! ```text
//! 0 ≤ r_n ⊥ z_n ≥ 0,   0 ≤ β_k ⊥ γ + d_k·z_t ≥ 0,   0 ≤ γ ⊥ μ r_n − Σ β ≥ 0,   r_t = Σ d_k β_k
//! ```
//!
//! is solved by C. E. Lemke's pivots, which end with a solution wherever what closes can be stopped (D. E. Stewart, J. C.
//! Trinkle, *An implicit time-stepping scheme for rigid body dynamics with inelastic collisions and Coulomb friction*, Int. J.
//! Numer. Methods Eng. 39 (1996)). Ties, which redundant contacts make, are broken lexicographically (R. W. Cottle, J.-S. Pang,
//! R. E. Stone, *The Linear Complementarity Problem*, 1992, 4.9), so the pivots never go round.

use super::problem::Problem;
use crate::system::Kind;

/// Sides of the polygon of a contact in space.
const SIDES: usize = 8;
/// Entries of the scaled tableau that are zero.
const ZERO: f64 = 1e-11;
/// Pivots for every row, at most.
const PIVOTS: usize = 20;

/// One unknown of the complementarity problem.
enum Unknown {
    /// A force along these components; its row is what the force works on.
    Force(Vec<(usize, f64)>),
    /// The sliding speed of a contact: its force of friction and the share of the normal force, by their unknowns.
    Speed { friction: f64, normal: usize, sides: std::ops::Range<usize> },
}

impl Problem {
    /// Forces that solve the problem with polygons as cones; none where the pivots do not end in a solution.
    pub(super) fn pivot(&self) -> Option<Vec<f64>> {
        let n = self.free.len();
        let unknowns = self.unknowns();
        let m = unknowns.len();
        let product = |a: &[(usize, f64)], b: &[(usize, f64)]| -> f64 {
            a.iter().flat_map(|(i, v)| b.iter().map(move |(j, w)| v * w * self.matrix[i * n + j])).sum()
        };
        // what a force works on: the normal distance, and of friction the way along the side
        let row = |u: &[(usize, f64)]| -> Vec<(usize, f64)> {
            let normal = self.parts.iter().any(|p| p.first == u[0].0);
            if normal {
                vec![u[0]]
            } else {
                u.to_vec()
            }
        };
        // units in which the diagonal is one
        let size: Vec<f64> = unknowns
            .iter()
            .map(|u| match u {
                Unknown::Force(c) => 1.0 / product(&row(c), &row(c)).max(f64::MIN_POSITIVE).sqrt(),
                Unknown::Speed { .. } => 1.0,
            })
            .collect();
        let mut matrix = vec![0.0; m * m];
        let mut free = vec![0.0; m];
        for (i, u) in unknowns.iter().enumerate() {
            match u {
                Unknown::Force(c) => {
                    let own = row(c);
                    for (j, v) in unknowns.iter().enumerate() {
                        if let Unknown::Force(d) = v {
                            matrix[i * m + j] = size[i] * size[j] * product(&own, d);
                        }
                    }
                    free[i] = size[i] * own.iter().map(|(k, w)| w * self.free[*k]).sum::<f64>();
                }
                Unknown::Speed { friction, normal, sides } => {
                    let unit = size[sides.start];
                    matrix[i * m + normal] = friction * size[*normal] / unit;
                    for k in sides.clone() {
                        matrix[i * m + k] = -size[k] / unit;
                        // γ in the units of the sides
                        matrix[k * m + i] = size[k] / unit;
                    }
                }
            }
        }
        let solution = lemke(&matrix, &free)?;
        let mut r = vec![0.0; n];
        for (u, (s, z)) in unknowns.iter().zip(size.iter().zip(&solution)) {
            if let Unknown::Force(c) = u {
                c.iter().for_each(|(i, w)| r[*i] += w * s * z);
            }
        }
        Some(r)
    }

    fn unknowns(&self) -> Vec<Unknown> {
        let mut out = Vec::new();
        for p in &self.parts {
            match p.kind {
                // friction that is not in proportion to a force: the search begins without it
                Kind::Joint | Kind::Switch => continue,
                Kind::Bilateral => {
                    out.extend([1.0, -1.0].map(|n| Unknown::Force(vec![(p.first, n)])));
                    continue;
                }
                Kind::Unilateral => {}
            }
            let normal = out.len();
            let friction = |k: usize, d: [f64; 2]| (p.first + 1 + k, -p.friction * d[k]);
            let slide = p.slides.into_iter().flat_map(|d| (0..p.n_t).map(move |k| friction(k, d)));
            out.push(Unknown::Force(std::iter::once((p.first, 1.0)).chain(slide).collect()));
            if p.slides.is_some() || p.n_t == 0 || p.friction <= 0.0 {
                continue;
            }
            let first = out.len();
            if p.n_t == 1 {
                out.extend([1.0, -1.0].map(|d| Unknown::Force(vec![(p.first + 1, d)])));
            } else {
                let angle = |k: usize| 2.0 * std::f64::consts::PI * k as f64 / SIDES as f64;
                let side = |k| Unknown::Force(vec![(p.first + 1, angle(k).cos()), (p.first + 2, angle(k).sin())]);
                out.extend((0..SIDES).map(side));
            }
            let sides = first..out.len();
            out.push(Unknown::Speed { friction: p.friction, normal, sides });
        }
        out
    }
}

/// Solves `0 ≤ x ⊥ M x + q ≥ 0`.
fn lemke(matrix: &[f64], q: &[f64]) -> Option<Vec<f64>> {
    let m = q.len();
    let largest = q.iter().fold(0.0f64, |s, v| s.max(v.abs()));
    if q.iter().all(|v| *v >= 0.0) {
        return Some(vec![0.0; m]);
    }
    // columns: slacks, unknowns, the artificial one, the right-hand side; basis: who stands in a row
    let n = 2 * m + 2;
    let mut table = vec![0.0; m * n];
    for i in 0..m {
        table[i * n + i] = 1.0;
        (0..m).for_each(|j| table[i * n + m + j] = -matrix[i * m + j]);
        table[i * n + 2 * m] = -1.0;
        table[i * n + 2 * m + 1] = q[i] / largest;
    }
    let mut basis: Vec<usize> = (0..m).collect();
    let least = |a: &usize, b: &usize| q[*a].total_cmp(&q[*b]);
    let mut row = (0..m).min_by(least)?;
    let mut column = 2 * m;
    for _ in 0..PIVOTS * m + 10 {
        let gone = basis[row];
        eliminate(&mut table, n, row, column);
        basis[row] = column;
        if gone == 2 * m {
            let mut x = vec![0.0; m];
            for (i, b) in basis.iter().enumerate().filter(|(_, b)| (m..2 * m).contains(*b)) {
                x[b - m] = (table[i * n + 2 * m + 1] * largest).max(0.0);
            }
            return Some(x);
        }
        // the complement of what has left comes in
        column = if gone < m { gone + m } else { gone - m };
        row = leaving(&table, n, column, &basis)?;
    }
    None
}

/// The row whose entry leaves the basis for this column: the lexicographically least ratio, the artificial unknown at a tie.
fn leaving(table: &[f64], n: usize, column: usize, basis: &[usize]) -> Option<usize> {
    let m = basis.len();
    let ratio = |i: usize, k: usize| table[i * n + k] / table[i * n + column];
    let mut rows: Vec<usize> = (0..m).filter(|i| table[i * n + column] > ZERO).collect();
    for k in std::iter::once(2 * m + 1).chain(0..m) {
        let least = rows.iter().map(|i| ratio(*i, k)).fold(f64::INFINITY, f64::min);
        rows.retain(|i| ratio(*i, k) <= least + ZERO * least.abs().max(1.0));
        if let (Some(i), true) = (rows.iter().find(|i| basis[**i] == 2 * m), k == 2 * m + 1) {
            return Some(*i);
        }
        if rows.len() <= 1 {
            break;
        }
    }
    rows.first().copied()
}

fn eliminate(table: &mut [f64], n: usize, row: usize, column: usize) {
    let pivot = table[row * n + column];
    table[row * n..(row + 1) * n].iter_mut().for_each(|v| *v /= pivot);
    let own = table[row * n..(row + 1) * n].to_vec();
    for (i, other) in table.chunks_exact_mut(n).enumerate() {
        let factor = other[column];
        if i != row && factor != 0.0 {
            other.iter_mut().zip(&own).for_each(|(o, v)| *o -= factor * v);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn complementarity_holds() {
        let mut seed = 11u64;
        let mut random = move || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (seed >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
        };
        for m in [1usize, 3, 7, 12] {
            for _ in 0..50 {
                // of lower rank than order, and free velocities that these forces can stop
                let k = (2 * m).div_ceil(3);
                let g: Vec<f64> = (0..m * k).map(|_| random()).collect();
                let push: Vec<f64> = (0..k).map(|_| random()).collect();
                let matrix: Vec<f64> =
                    (0..m * m).map(|e| (0..k).map(|l| g[e / m * k + l] * g[e % m * k + l]).sum()).collect();
                let q: Vec<f64> = (0..m).map(|i| (0..k).map(|l| g[i * k + l] * push[l]).sum()).collect();
                let x = lemke(&matrix, &q).expect("a solution");
                for i in 0..m {
                    let y = (0..m).map(|j| matrix[i * m + j] * x[j]).sum::<f64>() + q[i];
                    let size = (0..m).map(|j| (matrix[i * m + j] * x[j]).abs()).sum::<f64>() + q[i].abs();
                    assert!(y >= -1e-9 * size && (x[i] * y).abs() <= 1e-9 * size * (1.0 + x[i]), "{m}: {y} {}", x[i]);
                }
            }
        }
    }
}
