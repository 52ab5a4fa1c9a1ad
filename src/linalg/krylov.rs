//! Minimal residuals over a Krylov space with the factors as preconditioner.
//!
//! Refinement with the factors of a shifted matrix converges with the factor `ε/(ε + |λ|)` for an eigenvalue `λ` next
//! to the shift `ε`. A handful of such eigenvalues (dependent active constraints) costs GMRES as many steps
//! (Y. Saad, M. Schultz, SIAM J. Sci. Stat. Comput. 7, 1986; right preconditioning, so that the residual is the true
//! one).

/// Workspace for systems of one order.
pub(super) struct Gmres {
    /// Orthonormal basis, `(steps + 1) × n`.
    basis: Vec<f64>,
    /// Upper triangle of the rotated Hessenberg matrix, by columns of length `steps + 1`.
    hess: Vec<f64>,
    rotations: Vec<(f64, f64)>,
    g: Vec<f64>,
    n: usize,
    steps: usize,
}

impl Gmres {
    pub fn new(n: usize, steps: usize) -> Gmres {
        Gmres {
            basis: vec![0.0; (steps + 1) * n],
            hess: vec![0.0; (steps + 1) * steps],
            rotations: vec![(1.0, 0.0); steps],
            g: vec![0.0; steps + 1],
            n,
            steps,
        }
    }

    /// Improves the solution of `A d = r`: `r[n]` is replaced by `M⁻¹ V y`, the correction, with `V y` the minimiser over
    /// the Krylov space of `A M⁻¹`. Ends early when the residual has fallen by `reduction`. Returns the steps taken.
    ///
    /// `apply(z, w)` writes `A z` into `w`; `precondition(z)` replaces `z` by `M⁻¹ z`.
    pub fn solve(
        &mut self,
        r: &mut [f64],
        reduction: f64,
        mut precondition: impl FnMut(&mut [f64]),
        mut apply: impl FnMut(&[f64], &mut [f64]),
    ) -> usize {
        let (n, ld) = (self.n, self.steps + 1);
        let beta = norm(r);
        if !beta.is_finite() || beta == 0.0 {
            r.fill(0.0);
            return 0;
        }
        for (v, &a) in self.basis[..n].iter_mut().zip(r.iter()) {
            *v = a / beta;
        }
        self.g.fill(0.0);
        self.g[0] = beta;
        let mut k = 0;
        while k < self.steps {
            let (known, next) = self.basis.split_at_mut((k + 1) * n);
            let w = &mut next[..n];
            r.copy_from_slice(&known[k * n..]);
            precondition(r);
            apply(r, w);
            let column = &mut self.hess[k * ld..(k + 1) * ld];
            column.fill(0.0);
            // twice: once loses orthogonality as soon as the residual has fallen far
            for _ in 0..2 {
                for (h, v) in column.iter_mut().zip(known.chunks_exact(n)) {
                    let a = dot(v, w);
                    *h += a;
                    w.iter_mut().zip(v).for_each(|(w, v)| *w -= a * v);
                }
            }
            let length = norm(w);
            if !length.is_finite() {
                break;
            }
            for (i, &(c, s)) in self.rotations[..k].iter().enumerate() {
                let (a, b) = (column[i], column[i + 1]);
                column[i] = c * a + s * b;
                column[i + 1] = c * b - s * a;
            }
            let radius = column[k].hypot(length);
            if radius == 0.0 {
                break;
            }
            let (c, s) = (column[k] / radius, length / radius);
            self.rotations[k] = (c, s);
            column[k] = radius;
            self.g[k + 1] = -s * self.g[k];
            self.g[k] *= c;
            k += 1;
            if length == 0.0 || self.g[k].abs() <= reduction * beta {
                break;
            }
            w.iter_mut().for_each(|w| *w /= length);
        }
        for i in (0..k).rev() {
            let known: f64 = (i + 1..k).map(|j| self.hess[j * ld + i] * self.g[j]).sum();
            self.g[i] = (self.g[i] - known) / self.hess[i * ld + i];
        }
        r.fill(0.0);
        for (v, &y) in self.basis.chunks_exact(n).zip(&self.g[..k]) {
            r.iter_mut().zip(v).for_each(|(r, v)| *r += y * v);
        }
        precondition(r);
        k
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A diagonal matrix with a few eigenvalues far below the shift of the preconditioner.
    #[test]
    fn as_many_steps_as_eigenvalues_below_the_shift() {
        let n: usize = 40;
        let d: Vec<f64> = (0..n).map(|i| if i < 3 { 10f64.powi(-9 - i as i32) } else { 1.0 + i as f64 }).collect();
        let x: Vec<f64> = (0..n).map(|i| (i as f64 + 0.5).sin()).collect();
        let mut r: Vec<f64> = d.iter().zip(&x).map(|(d, x)| d * x).collect();
        let b = r.clone();
        let steps = Gmres::new(n, 12).solve(
            &mut r,
            1e-15,
            |z| z.iter_mut().zip(&d).for_each(|(z, d)| *z /= d + 3e-8),
            |z, w| w.iter_mut().zip(z).zip(&d).for_each(|((w, z), d)| *w = d * z),
        );
        let residual = r.iter().zip(&d).zip(&b).map(|((r, d), b)| (d * r - b).abs()).fold(0.0, f64::max);
        assert!(residual <= 1e-13 && steps <= 8, "{residual:e} after {steps}");
    }

    #[test]
    fn nothing_to_do_and_nonsense() {
        let mut g = Gmres::new(2, 4);
        let mut zero = [0.0, 0.0];
        assert_eq!(g.solve(&mut zero, 1e-10, |_| {}, |z, w| w.copy_from_slice(z)), 0);
        let mut nan = [f64::NAN, 1.0];
        assert_eq!(g.solve(&mut nan, 1e-10, |_| {}, |z, w| w.copy_from_slice(z)), 0);
        assert_eq!(nan, [0.0, 0.0]);
        let mut r = [1.0, 2.0];
        assert_eq!(g.solve(&mut r, 1e-10, |_| {}, |_, w| w.fill(f64::INFINITY)), 0);
        assert_eq!(r, [0.0, 0.0]);
    }
}
