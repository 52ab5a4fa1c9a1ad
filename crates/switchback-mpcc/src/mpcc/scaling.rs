//! Scaling of variables by their sizes, where the problem knows them, and of objective and rows by their gradients at the
//! starting point.
//!
//! Programs without pairs, and discretised problems without sizes: every function whose gradient has an entry above 100 is scaled down to that
//! (A. Wächter, L. Biegler, Math. Program. 106, 2006, section 3.8). With sizes gradients are those in units of them, and
//! are scaled up as well.
//!
//! Programs of the user with pairs: the objective is scaled to a largest derivative of 2, every row to 1, so that nothing depends on
//! the units they are in. A variable that stands for a row, a lifted member of a pair, is measured in the units of that
//! row, and the others in units of their own where those given are far apart ([`sizes`]). All factors are powers of two, chosen by exponents alone: an objective, a row or a function in a pair that is
//! multiplied by a power of two leaves the iterates as they are, to the last bit.

use super::policy::Policy;
use super::problem::Mpcc;
use super::sizes::{self, Terms};
use crate::linalg::csc::Pattern;
use crate::nlp::Bounds;

/// Largest entry of a scaled gradient at the starting point.
const LARGEST: f64 = 100.0;
/// Largest entry of the scaled gradient of the objective, and of its second derivatives, in variables of their sizes.
const OBJECTIVE: f64 = 100.0;
/// A gradient in variables of their sizes that is as good as zero.
const ROUNDING: f64 = 1e-12;
/// Value of a function in a pair that is as good as zero: data from outside are rarely better. A function without a gradient
/// has no other scale this could be relative to.
const NO_VALUE: f64 = 1e-8;
/// Smallest factor.
const SMALLEST: f64 = 1e-8;
/// Exponent of two of the largest scaled derivative of the objective of a program of the user. The barrier and the
/// relaxation begin at 0.1 and 1 whatever the objective is: this is how much it weighs beside them.
const PLAIN_EXPONENT: i32 = 1;
/// The same where it is to weigh more, and most. Relaxed problems are solved to tolerances relative to their relaxation, so that derivatives
/// far below the largest count only where that weighs enough; those by differences are too noisy for it.
const MORE_EXPONENT: i32 = 4;
const HEAVY_EXPONENT: i32 = 6;
/// Share of the violation at the start that counts like a gradient: one that vanishes there by chance says nothing.
const VIOLATION_SHARE: f64 = 1.0 / 1024.0;
/// Largest exponent of a factor: products of two are still numbers.
const MAX_EXPONENT: i32 = 200;

/// How much the objective weighs beside barrier and relaxation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Weight {
    /// As usual.
    #[default]
    Plain,
    More,
    Heavy,
}

impl Weight {
    /// Exponent of two of the largest scaled derivative.
    fn exponent(self) -> i32 {
        match self {
            Weight::Plain => PLAIN_EXPONENT,
            Weight::More => MORE_EXPONENT,
            Weight::Heavy => HEAVY_EXPONENT,
        }
    }
}

/// What the factors are chosen by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Rule {
    /// Steep functions are scaled down.
    Steep,
    /// The sizes of the variables, which the problem knows.
    Sizes,
    /// Powers of two for everything: the program of a user with pairs, in whatever units.
    Units,
}

/// Values and derivatives of a program at a point, not scaled.
#[derive(Debug, Clone, Copy)]
pub(super) struct AtPoint<'a> {
    /// Gradient of the objective.
    pub grad: &'a [f64],
    /// Its second derivatives, where they are known.
    pub hess: Option<(&'a Pattern, &'a [f64])>,
    /// The point.
    pub x: &'a [f64],
    /// First derivatives of the rows.
    pub jac: (&'a Pattern, &'a [f64]),
    /// Values of the rows.
    pub c: &'a [f64],
}

/// Factors of objective and rows.
#[derive(Debug)]
pub(super) struct Scaling {
    /// Factor of the objective.
    pub objective: f64,
    /// Factor of every row `[m]`.
    pub rows: Vec<f64>,
    /// Size of every variable `[n]`: the solver sees `x / size`.
    pub sizes: Vec<f64>,
    /// Are there sizes other than 1?
    pub sized: bool,
    /// Weight of the objective of a program of the user.
    pub weight: Weight,
    /// Are variables in the units they are given in, whatever their derivatives say? Those at an answer of before may vanish by chance.
    pub as_given: bool,
    rule: Rule,
    weights: Vec<f64>,
    /// Weights of the rows that are all zero.
    pub none: Vec<f64>,
}

impl Scaling {
    /// No scaling, for `n` variables and `m` rows.
    pub fn new(n: usize, m: usize) -> Scaling {
        Scaling {
            objective: 1.0,
            rows: vec![1.0; m],
            sizes: vec![1.0; n],
            sized: false,
            weight: Weight::Plain,
            as_given: false,
            rule: Rule::Steep,
            weights: vec![0.0; m],
            none: vec![0.0; m],
        }
    }

    /// Factors 1, and sizes 1 where they are not the problem's own.
    pub fn reset(&mut self) {
        self.objective = 1.0;
        self.rows.fill(1.0);
        if self.rule != Rule::Sizes {
            self.sizes.fill(1.0);
            self.sized = false;
        }
    }

    /// Takes over the sizes a problem has for its variables.
    pub fn set_sizes(&mut self, p: &dyn Mpcc) {
        self.sizes.fill(1.0);
        p.sizes(&mut self.sizes);
        for s in &mut self.sizes {
            *s = if *s > 0.0 && s.is_finite() { *s } else { 1.0 };
        }
        self.sized = self.sizes.iter().any(|s| *s != 1.0);
        self.rule = if self.sized {
            Rule::Sizes
        } else if !Policy::of(p).by_units || p.pairs().is_empty() {
            Rule::Steep
        } else {
            Rule::Units
        };
    }

    /// Does the problem know the sizes of its variables?
    pub fn is_by_sizes(&self) -> bool {
        self.rule == Rule::Sizes
    }

    /// Are objective, rows and pairs scaled so that nothing depends on the units they are in?
    pub fn is_by_units(&self) -> bool {
        self.rule == Rule::Units
    }

    /// Does the choice of factors ask for second derivatives of the objective?
    pub fn is_curved(&self) -> bool {
        self.rule != Rule::Steep
    }

    /// Sizes that are powers of two: variables and bounds are then what they are in their own units, to the last bit.
    pub fn round_sizes(&mut self) {
        self.sizes.iter_mut().for_each(|s| *s = s.log2().round().exp2());
    }

    /// All sizes and factors 1.
    pub fn forget_sizes(&mut self) {
        self.rule = Rule::Steep;
        self.reset();
    }

    /// Factors from the gradients at a point, with respect to variables of their sizes. `lifts` are the rows that have
    /// variables of their own.
    pub fn choose(&mut self, at: &AtPoint, bounds: &Bounds, lifts: &[(usize, usize)]) {
        let (jac, values) = at.jac;
        if self.rule == Rule::Units && !self.as_given {
            let mut lifted = vec![false; self.sizes.len()];
            lifts.iter().for_each(|l| lifted[l.1] = true);
            let terms = Terms { jac: at.jac, grad: at.grad, c: at.c, x: at.x, bounds };
            sizes::choose(&terms, &lifted, &mut self.sizes);
        }
        self.rows.fill(0.0);
        for j in 0..jac.n_cols() {
            for (&i, v) in jac.rows(j).iter().zip(&values[jac.range(j)]) {
                if i < self.rows.len() {
                    self.rows[i] = self.rows[i].max((v * self.sizes[j]).abs());
                }
            }
        }
        match self.rule {
            Rule::Steep => {
                self.rows.iter_mut().for_each(|r| *r = factor(*r));
                self.objective = factor(self.steepest(at));
            }
            Rule::Sizes => {
                self.rows.iter_mut().for_each(|r| *r = unit(*r));
                self.objective = OBJECTIVE * unit(self.steepest(at));
            }
            Rule::Units => {
                self.lift(at, lifts);
                for (i, r) in self.rows.iter_mut().enumerate() {
                    let beyond = (bounds.cl[i] - at.c[i]).max(at.c[i] - bounds.cu[i]);
                    *r = exponent(r.max(VIOLATION_SHARE * beyond)).map_or(1.0, |e| power(-e));
                }
                for &(i, v) in lifts {
                    self.sizes[v] = 1.0 / self.rows[i];
                }
                self.sized = self.sizes.iter().any(|s| *s != 1.0);
                let target = self.weight.exponent();
                self.objective = exponent(self.steepest_near(at)).map_or(1.0, |e| power(target - e));
            }
        }
    }

    /// Makes `rows` of lifted rows the largest derivative with respect to the other variables; where the function has none,
    /// its value.
    fn lift(&mut self, at: &AtPoint, lifts: &[(usize, usize)]) {
        let (jac, values) = at.jac;
        lifts.iter().for_each(|l| self.rows[l.0] = 0.0);
        // 0: the variable of a row, which says nothing about it
        lifts.iter().for_each(|l| self.sizes[l.1] = 0.0);
        for j in (0..jac.n_cols()).filter(|&j| self.sizes[j] != 0.0) {
            for (&i, v) in jac.rows(j).iter().zip(&values[jac.range(j)]) {
                self.rows[i] = self.rows[i].max((v * self.sizes[j]).abs());
            }
        }
        lifts.iter().for_each(|l| self.sizes[l.1] = 1.0);
        for &(i, v) in lifts {
            let value = (at.c[i] + at.x[v]).abs();
            if self.rows[i] == 0.0 && value > NO_VALUE {
                self.rows[i] = value;
            }
        }
    }

    /// Largest first derivative of the objective.
    fn slope(&self, at: &AtPoint) -> f64 {
        at.grad.iter().zip(&self.sizes).fold(0f64, |a, (g, s)| a.max((g * s).abs()))
    }

    /// Largest first or second derivative of the objective.
    fn steepest(&self, at: &AtPoint) -> f64 {
        self.slope(at).max(curvature(at, |j| self.sizes[j]))
    }

    /// The same where variables have sizes of their own: a second derivative counts over the distance of its variables from
    /// zero, at most one. Large ones beside a small variable tell of its unit. Where that is nothing they count as they are.
    fn steepest_near(&self, at: &AtPoint) -> f64 {
        let near = self.slope(at).max(curvature(at, |j| (at.x[j] / self.sizes[j]).abs().min(1.0) * self.sizes[j]));
        if near > 0.0 {
            near
        } else {
            self.steepest(at)
        }
    }

    /// Objective that a comparison calls one: of a user's program what is one in the units of the solver.
    pub fn one(&self) -> f64 {
        if self.rule == Rule::Units {
            1.0 / self.objective
        } else {
            1.0
        }
    }

    /// Size of the scaled gradient of the objective.
    pub fn steepness(&self) -> f64 {
        if self.is_by_sizes() {
            OBJECTIVE
        } else {
            1.0
        }
    }

    /// Variables in units of their sizes, and back.
    pub fn shrink(&self, x: &[f64], out: &mut [f64]) {
        out.iter_mut().zip(x).zip(&self.sizes).for_each(|((o, x), s)| *o = x / s);
    }

    pub fn grow(&self, x: &[f64], out: &mut [f64]) {
        out.iter_mut().zip(x).zip(&self.sizes).for_each(|((o, x), s)| *o = x * s);
    }

    /// The multiplier of row `i` in the units of the solver.
    pub fn row_multiplier(&self, i: usize, y: f64) -> f64 {
        y * self.objective / self.rows[i]
    }

    /// The multiplier of the bounds of variable `j` in the units of the solver.
    pub fn bound_multiplier(&self, j: usize, z: f64) -> f64 {
        z * self.objective * self.sizes[j]
    }

    pub fn value(&self, f: f64, rows: &mut [f64]) -> f64 {
        rows.iter_mut().zip(&self.rows).for_each(|(c, s)| *c *= s);
        f * self.objective
    }

    pub fn derivatives(&self, grad: &mut [f64], jac: &Pattern, values: &mut [f64]) {
        grad.iter_mut().for_each(|g| *g *= self.objective);
        values.iter_mut().zip(jac.row_idx()).for_each(|(v, &i)| *v *= self.rows[i]);
        if self.sized {
            grad.iter_mut().zip(&self.sizes).for_each(|(g, s)| *g *= s);
            for (j, s) in self.sizes.iter().enumerate() {
                values[jac.range(j)].iter_mut().for_each(|v| *v *= s);
            }
        }
    }

    /// Second derivatives with respect to variables of their sizes.
    pub fn hessian(&self, pattern: &Pattern, values: &mut [f64]) {
        for (j, s) in self.sizes.iter().enumerate().filter(|_| self.sized) {
            for (v, &i) in values[pattern.range(j)].iter_mut().zip(pattern.rows(j)) {
                *v *= s * self.sizes[i];
            }
        }
    }

    /// Weights of objective and rows for the Hessian of the unscaled functions.
    pub fn weights(&mut self, w: f64, y: &[f64]) -> (f64, &[f64]) {
        for ((t, y), s) in self.weights.iter_mut().zip(y).zip(&self.rows) {
            *t = y * s;
        }
        (w * self.objective, &self.weights)
    }

    pub fn bounds(&self, out: &mut Bounds) {
        for (j, s) in self.sizes.iter().enumerate().filter(|_| self.sized) {
            out.xl[j] /= s;
            out.xu[j] /= s;
        }
        for (i, s) in self.rows.iter().enumerate() {
            out.cl[i] *= s;
            out.cu[i] *= s;
        }
    }
}

/// A power of two, so that scaling does not round.
fn factor(largest: f64) -> f64 {
    if largest > LARGEST && largest.is_finite() {
        (LARGEST / largest).max(SMALLEST).log2().floor().exp2()
    } else {
        1.0
    }
}

/// The exponent of two of a number, `None` of zero and what is no number.
fn exponent(v: f64) -> Option<i32> {
    let biased = (v.to_bits() >> 52 & 0x7ff) as i32;
    (v.is_normal() && v > 0.0).then_some((biased - 1023).clamp(-MAX_EXPONENT, MAX_EXPONENT))
}

/// Largest second derivative of the objective over these distances.
fn curvature(at: &AtPoint, size: impl Fn(usize) -> f64) -> f64 {
    let Some((p, h)) = at.hess else { return 0.0 };
    (0..p.n_cols()).fold(0.0, |a, j| {
        let column = p.rows(j).iter().zip(&h[p.range(j)]);
        column.fold(a, |a, (&i, v)| a.max((v * size(i) * size(j)).abs()))
    })
}

fn power(e: i32) -> f64 {
    f64::from(e).exp2()
}

/// Makes the largest entry 1, unless it is rounding.
fn unit(largest: f64) -> f64 {
    if largest > ROUNDING && largest.is_finite() {
        1.0 / largest
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at<'a>(grad: &'a [f64], jac: &'a Pattern, values: &'a [f64], c: &'a [f64]) -> AtPoint<'a> {
        AtPoint { grad, hess: None, x: &[0.0; 3][..grad.len()], jac: (jac, values), c }
    }

    #[test]
    fn steep_functions_are_scaled_down_and_flat_ones_left_alone() {
        let (jac, _) = Pattern::from_triplets(3, 2, &[0, 1, 1], &[0, 0, 1]);
        let mut s = Scaling::new(2, 3);
        let b = Bounds::free(2, 3);
        s.choose(&at(&[1e6, 0.0], &jac, &[50.0, 1e30, f64::INFINITY], &[0.0; 3]), &b, &[]);
        assert!(s.objective * 1e6 <= 100.0 && s.objective * 1e6 > 49.0 && s.objective.log2().fract() == 0.0);
        assert_eq!((s.rows[0], s.rows[2]), (1.0, 1.0));
        s.choose(&at(&[0.0, 1.0], &jac, &[200.0, 1e30, 1.0], &[0.0; 3]), &b, &[]);
        assert_eq!((s.objective, s.rows[0]), (1.0, 0.5));
        assert!(s.rows[1] >= 0.5 * SMALLEST);
        let mut c = [4.0, 1.0, 3.0];
        assert_eq!(s.value(7.0, &mut c), 7.0);
        assert_eq!((c[0], c[2]), (2.0, 3.0));
        s.reset();
        assert_eq!(s.weights(2.0, &[1.0, 2.0, 3.0]), (2.0, &[1.0, 2.0, 3.0][..]));
    }

    /// Two variables, and a third that stands for row 1, which is as flat as row 0 is steep.
    #[test]
    fn programs_of_the_user_are_scaled_to_the_same_whatever_their_units() {
        let (jac, _) = Pattern::from_triplets(3, 3, &[0, 1, 1, 2], &[0, 1, 2, 1]);
        let mut b = Bounds::free(3, 3);
        b.cl[2] = 3.0;
        let mut s = Scaling::new(3, 3);
        s.rule = Rule::Units;
        // the gradient of row 2 vanishes at the start, which violates it by 3
        s.choose(&at(&[3e6, 0.0, 0.0], &jac, &[5e3, 1e-3, 0.0, -1.0], &[0.0; 3]), &b, &[(1, 2)]);
        assert!((2.0..4.0).contains(&(s.objective * 3e6)));
        assert!((1.0..2.0).contains(&(s.rows[0] * 5e3)) && (1.0..2.0).contains(&(s.rows[1] * 1e-3)));
        assert!((1.0..2.0).contains(&(s.rows[2] * VIOLATION_SHARE * 3.0)));
        // the derivative of row 1 in its own variable is what it was
        assert_eq!((&s.sizes[..2], s.sizes[2] * s.rows[1]), (&[1.0, 1.0][..], 1.0));
        assert!(s.sized && !s.is_by_sizes());
        // neither has the function of row 1 a gradient there: its value is 2^19, and its variable is 2^18 above it
        let flat =
            AtPoint { x: &[0.0, 0.0, 786_432.0], ..at(&[1.0, 0.0, 0.0], &jac, &[1.0, 0.0, 0.0, -1.0], &[0.0; 3]) };
        s.choose(&AtPoint { c: &[0.0, -262_144.0, 0.0], ..flat }, &b, &[(1, 2)]);
        assert_eq!((s.rows[1], s.sizes[2]), (524_288f64.recip(), 524_288.0));
        s.reset();
        assert!(!s.sized && s.sizes == [1.0; 3]);
        s.choose(&at(&[0.0; 3], &jac, &[0.0, f64::NAN, f64::INFINITY, -1.0], &[0.0; 3]), &Bounds::free(3, 3), &[]);
        assert_eq!((s.objective, &s.rows[..]), (1.0, &[1.0; 3][..]));
    }
}
