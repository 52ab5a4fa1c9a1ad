//! Minimal residuals over a Krylov space with the factors as preconditioner.
//!
//! Refinement with the factors of a shifted matrix converges with the factor `ε/(ε + |λ|)` for an eigenvalue `λ` next
//! to the shift `ε`. A handful of such eigenvalues (dependent active constraints) costs GMRES as many steps
//! (Y. Saad, M. Schultz, SIAM J. Sci. Stat. Comput. 7, 1986; right preconditioning, so that the residual is the true
//! one).
//!
//! Factors of matrices that were not pivoted solve to a few digits less than rounding. So the solution for a combination of vectors is
//! not quite the combination of their solutions, and only the latter has the residual that was minimised (the flexible variant,
//! Y. Saad, SIAM J. Sci. Comput. 14, 1993). The former falls short along eigenvalues far below the shift, which bounds the step where
//! rows depend on each other.

use super::kkt::max_abs;

/// Workspace for systems of one order.
pub(super) struct Gmres {
    /// Orthonormal basis, `(steps + 1) × n`.
    basis: Vec<f64>,
    /// The basis after the preconditioner, `steps × n`.
    preconditioned: Vec<f64>,
    /// Upper triangle of the rotated Hessenberg matrix, by columns of length `steps + 1`.
    hess: Vec<f64>,
    rotations: Vec<(f64, f64)>,
    g: Vec<f64>,
    y: Vec<f64>,
    n: usize,
    steps: usize,
}

/// What a correction is to be.
#[derive(Debug, Clone, Copy)]
pub(super) struct Asked {
    /// Where the residual has fallen by this factor it is good enough.
    pub reduction: f64,
    /// A correction with a larger entry is of no use, and more steps make it larger.
    pub largest: f64,
    /// A combination of preconditioned vectors, not the preconditioned combination.
    pub flexible: bool,
}

/// The size of the correction is looked at after every so many steps.
const LOOK_EVERY: usize = 3;

impl Gmres {
    pub fn new(n: usize, steps: usize) -> Gmres {
        Gmres {
            basis: vec![0.0; (steps + 1) * n],
            preconditioned: vec![0.0; steps * n],
            hess: vec![0.0; (steps + 1) * steps],
            rotations: vec![(1.0, 0.0); steps],
            g: vec![0.0; steps + 1],
            y: vec![0.0; steps],
            n,
            steps,
        }
    }

    /// Improves the solution of `A d = r`: `r[n]` is replaced by the correction, `Z y` with `Z = M⁻¹ V` where it is `flexible`, else
    /// `M⁻¹ (V y)`; `y` minimises the residual over the Krylov space `V` of `A M⁻¹`. Ends early when the residual has fallen by what is
    /// asked for, or the correction is larger than it may be. Returns the steps taken.
    ///
    /// `apply(z, w)` writes `A z` into `w`; `precondition(z)` replaces `z` by `M⁻¹ z`.
    pub fn solve(
        &mut self,
        r: &mut [f64],
        asked: Asked,
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
            let z = &mut self.preconditioned[k * n..(k + 1) * n];
            z.copy_from_slice(&known[k * n..]);
            precondition(z);
            apply(z, w);
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
            if length == 0.0 || self.g[k].abs() <= asked.reduction * beta {
                break;
            }
            w.iter_mut().for_each(|w| *w /= length);
            if k < self.steps && k % LOOK_EVERY == 0 {
                self.combine(k, true, r);
                if max_abs(r) > asked.largest {
                    return k;
                }
            }
        }
        self.combine(k, asked.flexible, r);
        if !asked.flexible {
            precondition(r);
        }
        k
    }

    /// Writes the combination of `k` vectors that minimises the residual, after the preconditioner or before it.
    fn combine(&mut self, k: usize, preconditioned: bool, out: &mut [f64]) {
        let ld = self.steps + 1;
        self.y[..k].copy_from_slice(&self.g[..k]);
        for i in (0..k).rev() {
            let known: f64 = (i + 1..k).map(|j| self.hess[j * ld + i] * self.y[j]).sum();
            self.y[i] = (self.y[i] - known) / self.hess[i * ld + i];
        }
        out.fill(0.0);
        let vectors = if preconditioned { &self.preconditioned } else { &self.basis };
        for (v, &y) in vectors.chunks_exact(self.n).zip(&self.y[..k]) {
            out.iter_mut().zip(v).for_each(|(r, v)| *r += y * v);
        }
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

    fn ask(reduction: f64, flexible: bool) -> Asked {
        Asked { reduction, largest: f64::INFINITY, flexible }
    }

    /// Along an eigenvalue of 1e-14 the correction is beyond what is allowed after a few steps, and no more are made.
    #[test]
    fn a_correction_that_grows_too_large_ends_it() {
        let n: usize = 40;
        let d: Vec<f64> = (0..n).map(|i| if i < 8 { 10f64.powi(-7 - i as i32) } else { 1.0 + i as f64 }).collect();
        let taken = |largest: f64| {
            let mut r = vec![1.0; n];
            let steps = Gmres::new(n, 12).solve(
                &mut r,
                Asked { reduction: 1e-15, largest, flexible: false },
                |z| z.iter_mut().zip(&d).for_each(|(z, d)| *z /= d + 3e-8),
                |z, w| w.iter_mut().zip(z).zip(&d).for_each(|((w, z), d)| *w = d * z),
            );
            (steps, max_abs(&r))
        };
        let (free, bounded) = (taken(f64::INFINITY), taken(1e5));
        assert!(free.0 > 6 && free.1 > 1e5, "{free:?}");
        assert!(bounded.0 < free.0 && bounded.1 > 1e5, "{bounded:?}");
    }

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
            ask(1e-15, false),
            |z| z.iter_mut().zip(&d).for_each(|(z, d)| *z /= d + 3e-8),
            |z, w| w.iter_mut().zip(z).zip(&d).for_each(|((w, z), d)| *w = d * z),
        );
        let residual = r.iter().zip(&d).zip(&b).map(|((r, d), b)| (d * r - b).abs()).fold(0.0, f64::max);
        assert!(residual <= 1e-13 && steps <= 8, "{residual:e} after {steps}");
    }

    /// The same with a preconditioner that is off by a relative 1e-7, differently for every vector, as rounding is: what is left is
    /// what was minimised.
    #[test]
    fn a_preconditioner_with_errors_costs_no_digits() {
        let n: usize = 40;
        let d: Vec<f64> = (0..n).map(|i| if i < 3 { 10f64.powi(-9 - i as i32) } else { 1.0 + i as f64 }).collect();
        let b: Vec<f64> = (0..n).map(|i| if i < 3 { 1e-9 * (i as f64 + 1.0) } else { 0.0 }).collect();
        let left = |flexible: bool| {
            let (mut r, mut calls) = (b.clone(), 0);
            let precondition = |z: &mut [f64]| {
                calls += 1;
                let off = |i: usize| 1e-7 * ((3 * i + 7 * calls) as f64).sin();
                let size = z.iter().fold(0f64, |a, v| a.max(v.abs())) / 3e-8;
                for (i, (z, d)) in z.iter_mut().zip(&d).enumerate() {
                    *z = *z / (d + 3e-8) + size * off(i);
                }
            };
            Gmres::new(n, 20).solve(&mut r, ask(1e-12, flexible), precondition, |z, w| {
                w.iter_mut().zip(z).zip(&d).for_each(|((w, z), d)| *w = d * z);
            });
            r.iter().zip(&d).zip(&b).map(|((r, d), b)| (d * r - b).abs()).fold(0.0, f64::max)
        };
        let (fixed, flexible) = (left(false), left(true));
        assert!(fixed > 1e-9 * 3e-9 && flexible <= 1e-9 * 3e-9, "{fixed:e} {flexible:e}");
    }

    #[test]
    fn nothing_to_do_and_nonsense() {
        let mut g = Gmres::new(2, 4);
        let mut zero = [0.0, 0.0];
        assert_eq!(g.solve(&mut zero, ask(1e-10, false), |_| {}, |z, w| w.copy_from_slice(z)), 0);
        let mut nan = [f64::NAN, 1.0];
        assert_eq!(g.solve(&mut nan, ask(1e-10, true), |_| {}, |z, w| w.copy_from_slice(z)), 0);
        assert_eq!(nan, [0.0, 0.0]);
        let mut r = [1.0, 2.0];
        assert_eq!(g.solve(&mut r, ask(1e-10, true), |_| {}, |_, w| w.fill(f64::INFINITY)), 0);
        assert_eq!(r, [0.0, 0.0]);
    }
}
