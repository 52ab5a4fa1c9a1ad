//! One step of an integration method: its data and its dense output.

/// Room for the derivatives at the stages of one component.
pub(super) type Stages = [f64; 16];
/// Coefficients of one component of the dense output, in powers of the relative time.
pub(super) type Poly = [f64; 8];

/// A step from `(t, x0)` of length `h`. All memory is allocated once.
pub(super) struct Step {
    pub(super) t: f64,
    pub(super) h: f64,
    /// The part of the step that its stages belong to, less than 1 where it ends on its dense output.
    pub(super) part: f64,
    pub(super) x0: Vec<f64>,
    pub(super) f0: Vec<f64>,
    pub(super) x1: Vec<f64>,
    pub(super) f1: Vec<f64>,
    /// Derivatives at the stages, by component.
    pub(super) k: Vec<Stages>,
    /// Stages that lie in the step.
    pub(super) n_k: usize,
    /// Argument of the last stage, and room.
    pub(super) y: Vec<f64>,
    pub(super) f: Vec<f64>,
    /// Dense output, valid after the method has written it, and its degree.
    pub(super) poly: Vec<Poly>,
    pub(super) degree: usize,
}

impl Step {
    pub(super) fn new(nx: usize) -> Step {
        Step {
            t: 0.0,
            h: 0.0,
            part: 1.0,
            x0: vec![0.0; nx],
            f0: vec![0.0; nx],
            x1: vec![0.0; nx],
            f1: vec![0.0; nx],
            k: vec![[0.0; 16]; nx],
            n_k: 0,
            y: vec![0.0; nx],
            f: vec![0.0; nx],
            poly: vec![[0.0; 8]; nx],
            degree: 7,
        }
    }

    /// Makes it a step of `nx` states. No memory is given back.
    pub(super) fn resize(&mut self, nx: usize) {
        for v in [&mut self.x0, &mut self.f0, &mut self.x1, &mut self.f1, &mut self.y, &mut self.f] {
            v.resize(nx, 0.0);
        }
        self.k.resize(nx, [0.0; 16]);
        self.poly.resize(nx, [0.0; 8]);
    }

    /// Ends the step at relative time `s` of its dense output. Its stages are those of a longer one from now on.
    pub(super) fn end_at(&mut self, s: f64) {
        self.part *= s;
        self.h *= s;
        self.n_k = 0;
        for ((p, x1), f1) in self.poly.iter_mut().zip(&mut self.x1).zip(&mut self.f1) {
            let mut power = 1.0;
            (*x1, *f1) = (0.0, 0.0);
            for (j, c) in p[..=self.degree].iter_mut().enumerate() {
                *c *= power;
                power *= s;
                *x1 += *c;
                *f1 += j as f64 * *c;
            }
            *f1 /= self.h;
        }
    }

    /// State at relative time `s` of the dense output.
    pub(super) fn at(&self, s: f64, out: &mut [f64]) {
        for (o, p) in out.iter_mut().zip(&self.poly) {
            *o = horner(p, s);
        }
    }
}

/// Value of a polynomial.
pub(super) fn horner(p: &Poly, s: f64) -> f64 {
    p.iter().rev().fold(0.0, |v, c| v * s + c)
}

/// `k`-th derivative of a polynomial, relative to its own time.
pub(super) fn derivative(p: &Poly, k: usize, s: f64) -> f64 {
    (k..p.len()).rev().fold(0.0, |v, i| v * s + p[i] * (i - k + 1..=i).product::<usize>() as f64)
}

/// Euclidean norm over the mean of squares of `v / weight`.
pub(super) fn norm(v: &[f64], weights: &[f64]) -> f64 {
    let s: f64 = v.iter().zip(weights).map(|(v, w)| (v * w) * (v * w)).sum();
    (s / v.len() as f64).sqrt()
}
