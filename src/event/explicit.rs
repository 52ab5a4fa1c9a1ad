//! Steps of the explicit pairs, with dense output.

use super::field::Field;
use super::pairs::{bs3, dop853, dp5, Row, Rows};
use super::step::{derivative, Poly, Stages, Step};
use crate::func::{EvalError, EvalResult};

/// What a pair integrates: the velocity of some states.
pub(super) trait Flow {
    /// The velocity; `room` is for those that have none of their own.
    fn velocity<'a>(&'a mut self, t: f64, x: &[f64], room: &'a mut [f64]) -> std::result::Result<&'a [f64], EvalError>;
    /// Writes it.
    fn write_velocity(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> EvalResult;
    /// The stages of a step begin, or have ended.
    fn begin_stages(&mut self) {}
    /// See [`Flow::begin_stages`].
    fn end_stages(&mut self) {}
    /// Stage `i` has been evaluated.
    fn keep_stage(&mut self, _i: usize) {}
}

impl Flow for Field {
    #[inline(always)]
    fn velocity<'a>(&'a mut self, t: f64, x: &[f64], room: &'a mut [f64]) -> std::result::Result<&'a [f64], EvalError> {
        self.rhs_view(t, x, room)
    }
    #[inline(always)]
    fn write_velocity(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> EvalResult {
        self.rhs(t, x, out)
    }
    fn begin_stages(&mut self) {
        Field::begin_stages(self);
    }
    fn end_stages(&mut self) {
        Field::end_stages(self);
    }
    #[inline(always)]
    fn keep_stage(&mut self, i: usize) {
        if self.n_alg() > 0 {
            self.trace_weights(i);
        }
    }
}

/// An explicit pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Pair {
    /// Order 3, dense output of order 3: for steps that are far shorter than tolerances ask for.
    Bs3,
    /// Order 5, dense output of order 4.
    Dp5,
    /// Order 8, dense output of order 7.
    Dop853,
}

impl Pair {
    /// Order of the error estimate plus one: what the step size is chosen by.
    pub(super) fn order(self) -> f64 {
        match self {
            Pair::Bs3 => 3.0,
            Pair::Dp5 => 5.0,
            Pair::Dop853 => 8.0,
        }
    }

    /// Rows and nodes of the step itself; the last row is the end point.
    pub(super) fn rows(self) -> (&'static Rows, &'static [f64]) {
        match self {
            Pair::Bs3 => (&bs3::ROWS, &bs3::C),
            Pair::Dp5 => (&dp5::ROWS, &dp5::C),
            Pair::Dop853 => (&dop853::ROWS[..13], &dop853::C[..13]),
        }
    }

    /// `|h λ|` at the border of the region of stability, on the real axis.
    pub(super) fn stability(self) -> f64 {
        match self {
            Pair::Bs3 => 2.5,
            Pair::Dp5 => 3.25,
            Pair::Dop853 => 6.1,
        }
    }
}

#[inline(always)]
fn dot<const M: usize>(k: &Stages, row: &Row<M>) -> f64 {
    let mut s = 0.0;
    for &(j, a) in row {
        s += a * k[j];
    }
    s
}

/// Evaluates stage `i` at node `c`; `n` is the number of states, known when this is compiled where that is small.
#[inline(always)]
fn stage<const M: usize>(n: usize, field: &mut impl Flow, s: &mut Step, i: usize, c: f64, row: &Row<M>) -> EvalResult {
    let h = s.h;
    let k = &mut s.k[..n];
    for ((y, x), k) in s.y[..n].iter_mut().zip(&s.x0[..n]).zip(&*k) {
        *y = x + h * dot(k, row);
    }
    let f = field.velocity(s.t + c * h, &s.y, &mut s.f)?;
    for (k, f) in k.iter_mut().zip(&f[..n]) {
        k[i] = *f;
    }
    field.keep_stage(i);
    Ok(())
}

#[inline(always)]
fn end<const M: usize>(n: usize, s: &mut Step, row: &Row<M>) {
    for ((x1, x), k) in s.x1[..n].iter_mut().zip(&s.x0[..n]).zip(&s.k[..n]) {
        *x1 = x + s.h * dot(k, row);
    }
}

/// Computes the end of a step from `x0`, `f0`.
pub(super) fn attempt(pair: Pair, field: &mut impl Flow, s: &mut Step) -> EvalResult {
    field.begin_stages();
    let r = match (pair, s.x0.len()) {
        (Pair::Bs3, n) => bs3_stages(n, field, s),
        (Pair::Dp5, 1) => dp5_stages(1, field, s),
        (Pair::Dp5, 2) => dp5_stages(2, field, s),
        (Pair::Dp5, 4) => dp5_stages(4, field, s),
        (Pair::Dp5, n) => dp5_stages(n, field, s),
        (Pair::Dop853, 1) => dop853_stages(1, field, s),
        (Pair::Dop853, 2) => dop853_stages(2, field, s),
        (Pair::Dop853, 4) => dop853_stages(4, field, s),
        (Pair::Dop853, n) => dop853_stages(n, field, s),
    };
    field.end_stages();
    r
}

#[inline(always)]
fn bs3_stages(n: usize, field: &mut impl Flow, s: &mut Step) -> EvalResult {
    use bs3::*;
    begin(n, s);
    stage(n, field, s, 1, C[1], &A1)?;
    stage(n, field, s, 2, C[2], &A2)?;
    s.n_k = 3;
    end(n, s, &A3);
    finish(Pair::Bs3, field, s)
}

#[inline(always)]
fn dp5_stages(n: usize, field: &mut impl Flow, s: &mut Step) -> EvalResult {
    use dp5::*;
    begin(n, s);
    stage(n, field, s, 1, C[1], &A1)?;
    stage(n, field, s, 2, C[2], &A2)?;
    stage(n, field, s, 3, C[3], &A3)?;
    stage(n, field, s, 4, C[4], &A4)?;
    stage(n, field, s, 5, C[5], &A5)?;
    s.n_k = 6;
    end(n, s, &A6);
    finish(Pair::Dp5, field, s)
}

#[inline(always)]
fn dop853_stages(n: usize, field: &mut impl Flow, s: &mut Step) -> EvalResult {
    use dop853::*;
    begin(n, s);
    stage(n, field, s, 1, C[1], &A1)?;
    stage(n, field, s, 2, C[2], &A2)?;
    stage(n, field, s, 3, C[3], &A3)?;
    stage(n, field, s, 4, C[4], &A4)?;
    stage(n, field, s, 5, C[5], &A5)?;
    stage(n, field, s, 6, C[6], &A6)?;
    stage(n, field, s, 7, C[7], &A7)?;
    stage(n, field, s, 8, C[8], &A8)?;
    stage(n, field, s, 9, C[9], &A9)?;
    stage(n, field, s, 10, C[10], &A10)?;
    stage(n, field, s, 11, C[11], &A11)?;
    s.n_k = 12;
    end(n, s, &A12);
    Ok(())
}

#[inline(always)]
fn begin(n: usize, s: &mut Step) {
    s.part = 1.0;
    for (k, f) in s.k[..n].iter_mut().zip(&s.f0[..n]) {
        k[0] = *f;
    }
}

/// Evaluates the derivative at the end.
pub(super) fn finish(pair: Pair, field: &mut impl Flow, s: &mut Step) -> EvalResult {
    field.write_velocity(s.t + s.h, &s.x1, &mut s.f1)?;
    let last = match pair {
        Pair::Bs3 => 3,
        Pair::Dp5 => 6,
        Pair::Dop853 => 12,
    };
    for (k, f) in s.k.iter_mut().zip(&s.f1) {
        k[last] = *f;
    }
    s.n_k = last + 1;
    field.keep_stage(last);
    Ok(())
}

/// How well a step resolves the weights of a sliding mode: the largest difference of a weight at a stage to the cubic
/// through its values at both ends and at two other stages; after [`finish`].
pub(super) fn weights_error(pair: Pair, field: &Field, start: &[f64]) -> f64 {
    // stages of high order where there are some
    let (inner, others): ([usize; 2], &[usize]) = match pair {
        Pair::Bs3 => return weights_error_of_three(field, start),
        Pair::Dp5 => ([2, 3], &[1, 4]),
        Pair::Dop853 => ([5, 9], &[6, 8, 10]),
    };
    let (c, last) = (pair.rows().1, pair.rows().0.len() - 1);
    let nodes = [0.0, c[inner[0]], c[inner[1]], 1.0];
    let mut worst = 0.0f64;
    for &i in others {
        let weight = |m: usize| -> f64 {
            let rest = nodes.iter().enumerate().filter(|(k, _)| *k != m);
            rest.map(|(_, n)| (c[i] - n) / (nodes[m] - n)).product()
        };
        let w: [f64; 4] = std::array::from_fn(weight);
        for (trace, start) in field.traces().iter().zip(start) {
            let cubic = w[0] * start + w[1] * trace[inner[0]] + w[2] * trace[inner[1]] + w[3] * trace[last];
            worst = worst.max((trace[i] - cubic).abs());
        }
    }
    worst
}

/// The same for the pair of order 3: the difference to the parabola through three of its four values.
fn weights_error_of_three(field: &Field, start: &[f64]) -> f64 {
    /// Weights of the values at 0, 3/4 and 1 in that at 1/2.
    const MIDDLE: [f64; 3] = [1.0 / 6.0, 4.0 / 3.0, -0.5];
    field.traces().iter().zip(start).fold(0.0, |worst, (trace, start)| {
        let parabola = MIDDLE[0] * start + MIDDLE[1] * trace[2] + MIDDLE[2] * trace[3];
        f64::max(worst, (trace[1] - parabola).abs())
    })
}

/// What the pair of order 5 leaves, by the terms before it, without the step length. The estimate by [`dp5::E`] is a derivative of
/// order 5, which vanishes twice in a period of whatever oscillates: where a step covers much of a period it is often small by chance
/// and what comes behind it is not. That is as large as the term of order 4 times its ratio to the term of order 2, which are in phase
/// with each other and not with that of order 5. Next to a zero of both the term of order 3 takes part in the ratio. In a step that
/// resolves the solution this is of order 6, below the estimate.
#[inline(always)]
fn order_six(k: &Stages) -> f64 {
    /// Six times what a step of a small part of a period leaves of an oscillation.
    const SHARE: f64 = 1.0;
    /// The square of the phase of five periods: of longer steps the stages say nothing, and rounding has any ratio.
    const MOST: f64 = 1e3;
    /// Part of the term of order 3.
    const THIRD: f64 = 0.2;
    let (second, third, fourth) = (k[6] - k[0], dot(k, &dp5::THIRD), dot(k, &dp5::FOURTH));
    let before = second.abs() + THIRD * third.abs();
    // NaN is no number either
    SHARE * dp5::ERROR * if fourth.abs() < MOST * before { fourth * fourth / before } else { MOST * fourth.abs() }
}

/// The part of the tolerance that steps of the pair of order 3 may use: others are far more accurate than asked for where switches cut
/// them short, and what they leave does not add up over many of them.
const SHARE_OF_BS3: f64 = 0.2;

/// Size of the local error relative to what it may be; `weights` are reciprocal tolerances.
#[inline(always)]
pub(super) fn error(pair: Pair, s: &Step, weights: &[f64]) -> f64 {
    let n = s.x0.len() as f64;
    match pair {
        Pair::Bs3 => {
            let sum: f64 = s.k.iter().zip(weights).map(|(k, w)| (dot(k, &bs3::E) * w).powi(2)).sum();
            s.h.abs() * (sum / n).sqrt() / SHARE_OF_BS3
        }
        Pair::Dp5 => {
            let (mut sum, mut behind) = (0.0, 0.0);
            for (k, w) in s.k.iter().zip(weights) {
                sum += (dot(k, &dp5::E) * w).powi(2);
                behind += (order_six(k) * w).powi(2);
            }
            s.h.abs() * (f64::max(sum, behind) / n).sqrt()
        }
        Pair::Dop853 => {
            let (mut e5, mut e3) = (0.0, 0.0);
            for (k, w) in s.k.iter().zip(weights) {
                e5 += (dot(k, &dop853::E5) * w).powi(2);
                e3 += (dot(k, &dop853::E3) * w).powi(2);
            }
            let d = e5 + 0.01 * e3;
            // an underflow is no error
            if d > 0.0 {
                s.h.abs() * e5 / (d * n).sqrt()
            } else {
                0.0
            }
        }
    }
}

/// What [`error`] would be for the pair of order 3, by the stages of the one of order 5: of a step that was not shortened since.
pub(super) fn error_of_order_three(s: &Step, weights: &[f64]) -> f64 {
    let sum: f64 = s.k.iter().zip(weights).map(|(k, w)| (dot(k, &dp5::THIRD) * w).powi(2)).sum();
    bs3::ERROR * s.h.abs() * (sum / s.x0.len() as f64).sqrt() / SHARE_OF_BS3
}

/// An estimate of `|h λ|` for the fastest part of the system, after [`finish`], and whether that part is damped: two points at
/// the end of the step go straight towards each other. `weights` are reciprocal tolerances.
pub(super) fn stiffness(pair: Pair, s: &Step, weights: &[f64]) -> (f64, bool) {
    /// Cosine of the angle between the difference of two points and that of their velocities.
    const STRAIGHT: f64 = -0.9;
    let last = match pair {
        // no two stages at one time: its steps are short, and where they are not it is given up
        Pair::Bs3 => return (0.0, false),
        Pair::Dp5 => 5,
        Pair::Dop853 => 11,
    };
    let (mut num, mut den, mut dot) = (0.0, 0.0, 0.0);
    for i in 0..s.x1.len() {
        let (rate, apart) = ((s.f1[i] - s.k[i][last]) * weights[i], (s.x1[i] - s.y[i]) * weights[i]);
        num += rate * rate;
        den += apart * apart;
        dot += rate * apart;
    }
    if den > 0.0 {
        (s.h.abs() * (num / den).sqrt(), dot <= STRAIGHT * (num * den).sqrt())
    } else {
        (0.0, false)
    }
}

/// Is the estimate of the error out of its depth, after [`finish`]? It is made for steps whose stages follow the solution. Where two points
/// at the end of the step differ, by what their velocities make of it, much more than stability allows, as next to the end of `x' = -√x`, the
/// terms of a step have no order any more, and an estimate that is small is so by chance. `weights` are reciprocal tolerances.
pub(super) fn is_misjudged(pair: Pair, s: &Step, weights: &[f64]) -> bool {
    /// How far beyond the border of stability.
    const FAR: f64 = 2.0;
    let last = match pair {
        Pair::Bs3 => return false,
        Pair::Dp5 => 5,
        Pair::Dop853 => 11,
    };
    let (mut num, mut den) = (0.0, 0.0);
    for i in 0..s.x1.len() {
        let (rate, apart) = (s.h * (s.f1[i] - s.k[i][last]) * weights[i], (s.x1[i] - s.y[i]) * weights[i]);
        num += rate * rate;
        den += apart * apart;
    }
    // below the tolerance it does not matter
    num > s.x1.len() as f64 && num > (FAR * pair.stability()).powi(2) * den
}

/// Writes the dense output, after [`finish`].
pub(super) fn dense(pair: Pair, field: &mut impl Flow, s: &mut Step) -> EvalResult {
    let h = s.h;
    if pair == Pair::Dop853 {
        use dop853::*;
        let (n, n_k) = (s.x0.len(), s.n_k);
        stage(n, field, s, 13, C[13], &A13)?;
        stage(n, field, s, 14, C[14], &A14)?;
        stage(n, field, s, 15, C[15], &A15)?;
        s.n_k = n_k;
    }
    s.degree = match pair {
        Pair::Bs3 => 3,
        Pair::Dp5 => 4,
        Pair::Dop853 => 7,
    };
    for (i, p) in s.poly.iter_mut().enumerate() {
        let k = &s.k[i];
        let d = s.x1[i] - s.x0[i];
        let (a, b) = (h * s.f0[i] - d, 2.0 * d - h * (s.f0[i] + s.f1[i]));
        // nested form, innermost coefficient first: factors alternate between τ and 1 − τ
        match pair {
            Pair::Bs3 => *p = [0.0, d + a, b - a, -b, 0.0, 0.0, 0.0, 0.0],
            Pair::Dp5 => {
                let e = h * dot(k, &dp5::D);
                *p = [0.0, d + a, b + e - a, -(b + 2.0 * e), e, 0.0, 0.0, 0.0];
            }
            Pair::Dop853 => {
                use dop853::{D0, D1, D2, D3};
                *p = [0.0; 8];
                let c = [dot(k, &D3), dot(k, &D2), dot(k, &D1), dot(k, &D0)];
                nested(&[h * c[0], h * c[1], h * c[2], h * c[3], b, a, d], p)
            }
        }
        p[0] += s.x0[i];
    }
    Ok(())
}

/// What the dense output of a step is off by inside, relative to the tolerances whose reciprocals are `weights`, by its defect at one point. It has values and velocities
/// of both ends, so what it is off by goes with `s² (1 − s)²`: that is 1/16 at most, and its slope `√3 / 9`, at `s = (1 − 1/√3) / 2`.
pub(super) fn error_inside(
    field: &mut impl Flow,
    s: &mut Step,
    weights: &[f64],
) -> std::result::Result<f64, EvalError> {
    /// Where the slope is steepest, and the largest value relative to it.
    const AT: f64 = 0.211_324_865_405_187_1;
    const SHARE: f64 = 0.324_759_526_419_164_5;
    let mut y = std::mem::take(&mut s.y);
    s.at(AT, &mut y);
    let r = field.velocity(s.t + AT * s.h, &y, &mut s.f).map(|f| {
        let off = |((p, f), w): ((&Poly, &f64), &f64)| ((derivative(p, 1, AT) - s.h * f) * w).powi(2);
        s.poly.iter().zip(f).zip(weights).map(off).sum::<f64>()
    });
    s.y = y;
    Ok(SHARE * (r? / s.x0.len() as f64).sqrt())
}

/// Weights of the stages, its end the last of them, in the dense output of a pair that needs no others at relative time `s`.
pub(super) fn weights_at(pair: Pair, s: f64) -> Stages {
    debug_assert!(pair != Pair::Dop853);
    let rows = pair.rows().0;
    let last = rows.len() - 1;
    let (mut end, mut bend) = ([0.0; 16], [0.0; 16]);
    rows[last].iter().for_each(|&(j, b)| end[j] = b);
    if pair == Pair::Dp5 {
        dp5::D.iter().for_each(|&(j, d)| bend[j] = d);
    }
    std::array::from_fn(|j| {
        let (first, second) = (f64::from(u8::from(j == 0)), f64::from(u8::from(j == last)));
        let (d, e) = (end[j], bend[j]);
        let (a, b) = (first - d, 2.0 * d - first - second);
        s * (d + a + s * (b + e - a + s * (e * s - b - 2.0 * e)))
    })
}

/// Multiplies out `τ (c_last + (1 − τ) (… (c_0)))`, with as many factors as coefficients.
fn nested(c: &[f64], p: &mut [f64; 8]) {
    for (m, v) in c.iter().enumerate() {
        p[0] += v;
        let by_tau = (c.len() - 1 - m) % 2 == 0;
        for j in (1..=m + 1).rev() {
            p[j] = if by_tau { p[j - 1] } else { p[j] - p[j - 1] };
        }
        if by_tau {
            p[0] = 0.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::pairs::{bs3, dop853, dp5};
    use super::{weights_at, Pair};

    /// `Σ w_i(s) c_i^q = s^{q+1} / (q+1)` below the order of the dense output, and at the end the weights of the step.
    #[test]
    fn weights_of_the_dense_output() {
        for (pair, order) in [(Pair::Bs3, 3), (Pair::Dp5, 4)] {
            let (rows, c) = pair.rows();
            for s in [0.0, 0.3, 0.8, 1.0] {
                let w = weights_at(pair, s);
                for q in 0..order {
                    let sum: f64 = c.iter().zip(&w).map(|(c, w)| w * c.powi(q)).sum();
                    assert!((sum - f64::powi(s, q + 1) / f64::from(q + 1)).abs() < 1e-14, "{pair:?} {s} {q}: {sum}");
                }
            }
            let w = weights_at(pair, 1.0);
            let end = |j: usize| rows[rows.len() - 1].iter().find(|b| b.0 == j).map_or(0.0, |b| b.1);
            assert!((0..16).all(|j| (w[j] - end(j)).abs() < 1e-14), "{pair:?}: {w:?}");
        }
    }

    /// Of every tree of an order below, `Σ e_i Φ_i = 0`; of those of the order itself `Σ e_i Φ_i = p! / γ` without the last
    /// factor of the density, so that the sum is the derivative.
    #[test]
    fn derivatives_by_the_stages_of_the_pair_of_order_five() {
        let c = dp5::C;
        let along = |v: &dyn Fn(usize) -> f64, i: usize| dp5::ROWS[i].iter().map(|(j, a)| a * v(*j)).sum::<f64>();
        let ac = |i: usize| along(&|j| c[j], i);
        let acc = |i: usize| along(&|j| c[j] * c[j], i);
        let aac = |i: usize| along(&ac, i);
        type Tree<'a> = &'a dyn Fn(usize) -> f64;
        let trees: [(Tree, [f64; 3]); 8] = [
            (&|_| 1.0, [0.0; 3]),
            (&|i| c[i], [0.0; 3]),
            (&|i| c[i] * c[i], [2.0, 0.0, 0.0]),
            (&ac, [1.0, 0.0, 0.0]),
            (&|i| c[i].powi(3), [f64::NAN, 6.0, 0.0]),
            (&|i| c[i] * ac(i), [f64::NAN, 3.0, 0.0]),
            (&acc, [f64::NAN, 2.0, 0.0]),
            (&aac, [f64::NAN, 1.0, 0.0]),
        ];
        for (k, row) in [&dp5::THIRD[..], &dp5::FOURTH, &dp5::E].into_iter().enumerate() {
            for (m, (tree, exact)) in trees.iter().enumerate() {
                let sum: f64 = row.iter().map(|&(i, e)| e * tree(i)).sum();
                assert!(exact[k].is_nan() || (sum - exact[k]).abs() < 1e-12, "{k}, tree {m}: {sum}");
            }
        }
        // by a quadrature: the fifth derivative of its solution is 24 where the velocity is t^4
        let fifth: f64 = dp5::E.iter().map(|&(i, e)| e * c[i].powi(4)).sum();
        assert!((fifth.abs() - 24.0 * dp5::ERROR).abs() < 1e-12);
    }

    /// `Σ b_i c_i^q = 1/(q+1)` and `Σ a_ij c_j^q = c_i^{q+1}/(q+1)`.
    #[test]
    fn quadrature_and_row_conditions() {
        let check = |rows: &[&[(usize, f64)]], c: &[f64], last: usize, order: i32| {
            for q in 0..order {
                let s: f64 = rows[last].iter().map(|(j, b)| b * c[*j].powi(q)).sum();
                assert!((s - 1.0 / f64::from(q + 1)).abs() < 1e-14, "{order}, q = {q}: {s}");
            }
            for (row, c) in rows.iter().zip(c) {
                assert!((row.iter().map(|e| e.1).sum::<f64>() - c).abs() < 1e-13, "{order}: {row:?}");
            }
        };
        check(&bs3::ROWS, &bs3::C, 3, 3);
        check(&dp5::ROWS, &dp5::C, 6, 5);
        check(&dop853::ROWS, &dop853::C, 12, 8);
        for e in [&bs3::E[..], &dp5::E, &dop853::E5, &dop853::E3] {
            assert!(e.iter().map(|e| e.1).sum::<f64>().abs() < 1e-14);
        }
        // both trees of order 3 in the error of order 2: half of Σ e_i c_i², and Σ e_i a_ij c_j
        let square: f64 = bs3::E.iter().map(|&(i, e)| 0.5 * e * bs3::C[i].powi(2)).sum();
        let nested = |i: usize| bs3::ROWS[i].iter().map(|(j, a)| a * bs3::C[*j]).sum::<f64>();
        let chain: f64 = bs3::E.iter().map(|&(i, e)| e * nested(i)).sum();
        assert!([square, chain].iter().all(|s| (s.abs() - bs3::ERROR).abs() < 1e-15), "{square} {chain}");
        for i in [13, 14, 15] {
            for q in 0..5 {
                let s: f64 = dop853::ROWS[i].iter().map(|(j, a)| a * dop853::C[*j].powi(q)).sum();
                let exact = dop853::C[i].powi(q + 1) / f64::from(q + 1);
                assert!((s - exact).abs() < 1e-13, "row {i}, q = {q}: {s} {exact}");
            }
        }
    }
}
