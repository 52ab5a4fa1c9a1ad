//! What is known of a state as a mean with a root of its covariance, and how it grows by a measurement and a stage.
//!
//! Roots are made by orthogonal transformations from the right, so covariances stay positive semidefinite (P. Kaminski, A. Bryson, S. Schmidt, *Discrete
//! square root filtering: a survey of current techniques*, 1971; T. Kailath, A. Sayed, B. Hassibi, *Linear Estimation*, 2000, chapter 12).

use crate::linalg::dense::dot;

/// Diagonal entries of roots stay above this share of the standard deviations of the start: a covariance that is singular has no weight.
const FLOOR: f64 = 1e-6;

/// A mean `m` and a lower triangular root `L`, row-major, of the covariance `L Lᵀ`.
pub(super) struct Arrival {
    nx: usize,
    ny: usize,
    pub mean: Vec<f64>,
    pub root: Vec<f64>,
    /// Standard deviations of the start.
    start: Vec<f64>,
    /// Room for arrays that are made triangular, and for rows of them.
    array: Vec<f64>,
    row: Vec<f64>,
    next: Vec<f64>,
}

/// Makes an array `[rows · cols]`, row-major, lower triangular by reflections of its columns.
fn lower(rows: usize, cols: usize, m: &mut [f64]) {
    for i in 0..rows.min(cols) {
        let (own, below) = m[i * cols..].split_at_mut(cols);
        let v = &mut own[i..];
        let largest = v.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        if largest == 0.0 || v[1..].iter().all(|e| *e == 0.0) {
            continue;
        }
        let norm = largest * v.iter().map(|e| (e / largest).powi(2)).sum::<f64>().sqrt();
        let to = if v[0] > 0.0 { -norm } else { norm };
        // v = a − to e₁, of which vᵀ v = −2 to v₁
        v[0] -= to;
        let half = -to * v[0];
        for r in below.chunks_exact_mut(cols).take(rows - 1 - i) {
            let f = dot(v, &r[i..]) / half;
            r[i..].iter_mut().zip(&*v).for_each(|(r, v)| *r -= f * v);
        }
        v.fill(0.0);
        v[0] = to;
    }
}

impl Arrival {
    /// `nw` states have noise.
    pub fn new(mean: &[f64], deviations: &[f64], ny: usize, nw: usize) -> Arrival {
        let nx = mean.len();
        let mut a = Arrival {
            nx,
            ny,
            mean: vec![0.0; nx],
            root: vec![0.0; nx * nx],
            start: deviations.to_vec(),
            array: vec![0.0; ((ny + nx) * (ny + nx)).max(nx * (nx + nw))],
            row: vec![0.0; ny],
            next: vec![0.0; nx],
        };
        a.reset(mean);
        a
    }

    /// The start, with another mean.
    pub fn reset(&mut self, mean: &[f64]) {
        self.mean.copy_from_slice(mean);
        self.root.fill(0.0);
        (0..self.nx).for_each(|i| self.root[i * (self.nx + 1)] = self.start[i]);
    }

    pub fn copy_from(&mut self, other: &Arrival) {
        self.mean.copy_from_slice(&other.mean);
        self.root.copy_from_slice(&other.root);
    }

    /// A measurement with Jacobian `h[ny · nx]`, row-major, standard deviations `sigma[ny]` and residuals `e[ny]`, `y − h(x)` at the mean; rows whose residual is
    /// no number were not measured.
    ///
    /// ```text
    /// [ R^½  H L ]      [ S^½  0  ]
    /// [  0    L  ]  →   [ K S^½  L⁺ ],   m⁺ = m + K e
    /// ```
    pub fn measure(&mut self, h: &[f64], sigma: &[f64], e: &[f64]) {
        let (nx, ny) = (self.nx, self.ny);
        let w = ny + nx;
        let m = &mut self.array[..w * w];
        m.fill(0.0);
        for i in 0..ny {
            let there = e[i].is_finite();
            m[i * w + i] = if there { sigma[i] } else { 1.0 };
            self.row[i] = if there { e[i] } else { 0.0 };
            for j in (0..nx).filter(|_| there) {
                m[i * w + ny + j] = (j..nx).map(|k| h[i * nx + k] * self.root[k * nx + j]).sum();
            }
        }
        for i in 0..nx {
            m[(ny + i) * w + ny..(ny + i + 1) * w].copy_from_slice(&self.root[i * nx..(i + 1) * nx]);
        }
        lower(w, w, m);
        // S^½ r = e
        for i in 0..ny {
            let s = self.row[i] - dot(&m[i * w..i * w + i], &self.row[..i]);
            self.row[i] = s / m[i * w + i];
        }
        for i in 0..nx {
            self.mean[i] += dot(&m[(ny + i) * w..(ny + i) * w + ny], &self.row);
            self.root[i * nx..(i + 1) * nx].copy_from_slice(&m[(ny + i) * w + ny..(ny + i + 1) * w]);
        }
    }

    /// A stage `x⁺ = f + A (x − x̂) + w` with `a` column-major, `f` at `x̂`, and standard deviations `sigma` of `w` at the states `noisy`.
    ///
    /// ```text
    /// [ A L   Q^½ ]  →  [ L⁺  0 ]
    /// ```
    pub fn pass(&mut self, [f, a, at]: [&[f64]; 3], noisy: &[usize], sigma: &[f64]) {
        let nx = self.nx;
        let w = nx + noisy.len();
        let m = &mut self.array[..nx * w];
        m.fill(0.0);
        for i in 0..nx {
            self.next[i] = f[i] + (0..nx).map(|k| a[i + k * nx] * (self.mean[k] - at[k])).sum::<f64>();
            for j in 0..nx {
                m[i * w + j] = (j..nx).map(|k| a[i + k * nx] * self.root[k * nx + j]).sum();
            }
        }
        for (j, (i, s)) in noisy.iter().zip(sigma).enumerate() {
            m[i * w + nx + j] = *s;
        }
        self.take_root(w);
        self.mean.copy_from_slice(&self.next);
    }

    /// A stage of which nothing is known but its noise and its end.
    pub fn follow(&mut self, x: &[f64], noisy: &[usize], sigma: &[f64]) {
        let nx = self.nx;
        let w = nx + noisy.len();
        let m = &mut self.array[..nx * w];
        m.fill(0.0);
        for (own, root) in m.chunks_exact_mut(w).zip(self.root.chunks_exact(nx)) {
            own[..nx].copy_from_slice(root);
        }
        for (j, (i, s)) in noisy.iter().zip(sigma).enumerate() {
            m[i * w + nx + j] = *s;
        }
        self.take_root(w);
        self.mean.copy_from_slice(x);
    }

    /// The root from an array of `w` columns.
    fn take_root(&mut self, w: usize) {
        let nx = self.nx;
        let m = &mut self.array[..nx * w];
        lower(nx, w, m);
        for (i, (root, own)) in self.root.chunks_exact_mut(nx).zip(m.chunks_exact(w)).enumerate() {
            root.copy_from_slice(&own[..nx]);
            root[i] = root[i].abs().max(FLOOR * self.start[i]).copysign(root[i]);
        }
    }

    /// The covariance, `[nx · nx]`.
    pub fn covariance(&self, out: &mut [f64]) {
        let nx = self.nx;
        for i in 0..nx {
            for j in 0..nx {
                out[i * nx + j] = dot(&self.root[i * nx..(i + 1) * nx], &self.root[j * nx..(j + 1) * nx]);
            }
        }
    }

    /// The weight of the arrival cost: the inverse of the covariance, `[nx · nx]`.
    pub fn weight(&mut self, out: &mut [f64]) {
        let nx = self.nx;
        // rows of L⁻¹ to the array
        let inverse = &mut self.array[..nx * nx];
        inverse.fill(0.0);
        for i in 0..nx {
            let (above, own) = inverse.split_at_mut(i * nx);
            let own = &mut own[..nx];
            own[i] = 1.0;
            for k in 0..i {
                let f = self.root[i * nx + k];
                own.iter_mut().zip(&above[k * nx..(k + 1) * nx]).for_each(|(o, a)| *o -= f * a);
            }
            let d = self.root[i * (nx + 1)];
            own.iter_mut().for_each(|v| *v /= d);
        }
        for i in 0..nx {
            for j in 0..nx {
                out[i * nx + j] = (0..nx).map(|k| inverse[k * nx + i] * inverse[k * nx + j]).sum();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One state by hand: a mean of two numbers with their variances, and a stage.
    #[test]
    fn one_state_by_hand() {
        let mut a = Arrival::new(&[2.0], &[3.0], 1, 1);
        a.measure(&[2.0], &[1.0], &[6.0 - 2.0 * 2.0]);
        // weights 1/9 and 4
        let weight = 1.0 / 9.0 + 4.0;
        assert!((a.mean[0] - (2.0 / 9.0 + 4.0 * 3.0) / weight).abs() < 1e-14);
        assert!((a.root[0].powi(2) - 1.0 / weight).abs() < 1e-14);
        a.measure(&[2.0], &[1.0], &[f64::NAN]);
        assert!((a.root[0].powi(2) - 1.0 / weight).abs() < 1e-14);
        let before = a.mean[0];
        a.pass([&[5.0], &[0.5], &[1.0]], &[0], &[0.25]);
        assert!((a.mean[0] - (5.0 + 0.5 * (before - 1.0))).abs() < 1e-14);
        let mut w = [0.0];
        a.weight(&mut w);
        assert!((1.0 / w[0] - (0.25 / weight + 0.0625)).abs() < 1e-10);
    }
}
