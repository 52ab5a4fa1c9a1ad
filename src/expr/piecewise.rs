//! Piecewise polynomials of one variable: tables and splines with declared smoothness.

use super::dag::{Dag, Id, Node};
use crate::error::{Error, Result};

/// A piecewise polynomial; the first and the last piece go on to infinity.
#[derive(Debug, Clone, PartialEq)]
pub struct Piecewise {
    /// Where pieces meet, increasing; one less than pieces.
    breaks: Vec<f64>,
    /// Where the powers of each piece are centred.
    origins: Vec<f64>,
    /// `1 + degree` coefficients per piece, lowest power first.
    coefficients: Vec<f64>,
    degree: usize,
    smoothness: i32,
}

impl Piecewise {
    /// Pieces that meet at `breaks` (increasing), piece `i` being `Σ_k coefficients[i (degree+1) + k] (s − o_i)^k`,
    /// with `o_i` the left end of the piece, for the first piece its right end.
    ///
    /// `smoothness` is the number of continuous derivatives that is declared: −1 jumps, 0 continuous. The declaration is checked.
    pub fn new(breaks: &[f64], degree: usize, coefficients: &[f64], smoothness: i32) -> Result<Piecewise> {
        let n = breaks.len() + 1;
        if degree > 9 {
            return Err(Error::Range(format!("piecewise polynomial of degree {degree}: up to 9")));
        }
        if coefficients.len() != n * (degree + 1) {
            return Err(Error::Dimension(format!(
                "piecewise polynomial with {n} pieces of degree {degree}: {} coefficients, expected {}",
                coefficients.len(),
                n * (degree + 1)
            )));
        }
        if let Some(v) = breaks.iter().chain(coefficients).find(|v| !v.is_finite()) {
            return Err(Error::Range(format!("piecewise polynomial: {v} is not finite")));
        }
        if let Some(k) = breaks.windows(2).position(|w| w[0] >= w[1]) {
            return Err(Error::Range(format!(
                "piecewise polynomial: break {} is {}, not above the one before ({})",
                k + 1,
                breaks[k + 1],
                breaks[k]
            )));
        }
        let mut origins = Vec::with_capacity(n);
        origins.push(breaks.first().copied().unwrap_or(0.0));
        origins.extend_from_slice(breaks);
        let p = Piecewise { breaks: breaks.to_vec(), origins, coefficients: coefficients.to_vec(), degree, smoothness };
        p.check_smoothness()?;
        Ok(p)
    }

    /// Constant pieces: `values[i]` between `breaks[i−1]` and `breaks[i]`; one value more than breaks.
    pub fn steps(breaks: &[f64], values: &[f64]) -> Result<Piecewise> {
        Piecewise::new(breaks, 0, values, -1)
    }

    /// Straight lines through the points; horizontal outside.
    pub fn lines(points: &[f64], values: &[f64]) -> Result<Piecewise> {
        check_points(points, values, 2)?;
        let n = points.len();
        let mut c = vec![values[0], 0.0];
        for i in 0..n - 1 {
            c.extend([values[i], (values[i + 1] - values[i]) / (points[i + 1] - points[i])]);
        }
        c.extend([values[n - 1], 0.0]);
        Piecewise::new(points, 1, &c, 0)
    }

    /// Cubic spline through the points with two continuous derivatives, third derivative continuous at the
    /// second and the last but one point ("not a knot"; the interpolating parabola or line for three or two points).
    pub fn spline(points: &[f64], values: &[f64]) -> Result<Piecewise> {
        check_points(points, values, 2)?;
        let n = points.len();
        let m = second_derivatives(points, values);
        let (mut breaks, mut c) = (Vec::new(), Vec::new());
        for i in 0..n - 1 {
            let h = points[i + 1] - points[i];
            let slope = (values[i + 1] - values[i]) / h - h * (2.0 * m[i] + m[i + 1]) / 6.0;
            let piece = [values[i], slope, 0.5 * m[i], (m[i + 1] - m[i]) / (6.0 * h)];
            if i == 0 {
                // Centred at its right end.
                let [a, b, q, k] = piece;
                let first = if n == 2 {
                    [a - b * points[0], b, 0.0, 0.0]
                } else {
                    [a + h * (b + h * (q + h * k)), b + h * (2.0 * q + 3.0 * h * k), q + 3.0 * h * k, k]
                };
                c.extend(first);
            } else {
                breaks.push(points[i]);
                c.extend(piece);
            }
        }
        Piecewise::new(&breaks, 3, &c, 2)
    }

    /// Number of continuous derivatives, −1 for jumps.
    pub fn smoothness(&self) -> i32 {
        self.smoothness
    }

    /// Degree of the pieces.
    pub fn degree(&self) -> usize {
        self.degree
    }

    pub(super) fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    pub(super) fn breaks(&self) -> &[f64] {
        &self.breaks
    }

    pub(super) fn origins(&self) -> &[f64] {
        &self.origins
    }

    /// Coefficients of a derivative of one piece, lowest power first.
    pub(super) fn derivative(&self, piece: usize, order: u8) -> Vec<f64> {
        let (d, order) = (self.degree + 1, usize::from(order));
        let c = &self.coefficients[piece * d..(piece + 1) * d];
        (order..d).map(|k| c[k] * falling(k, order)).collect()
    }

    /// Derivative of this order at `s`; at a break that of the piece behind it.
    #[inline(never)]
    pub fn eval(&self, order: u8, s: f64) -> f64 {
        if s.is_nan() {
            return s;
        }
        let piece = self.breaks.partition_point(|&b| b <= s);
        let (d, order) = (self.degree + 1, usize::from(order));
        let c = &self.coefficients[piece * d..(piece + 1) * d];
        let z = s - self.origins[piece];
        let mut v = 0.0;
        for k in (order..d).rev() {
            v = v * z + c[k] * falling(k, order);
        }
        v
    }

    /// Derivatives up to the declared one have no jumps beyond rounding: that of their size over the pieces on both sides.
    fn check_smoothness(&self) -> Result<()> {
        let d = self.degree + 1;
        if self.smoothness < -1 {
            return Err(Error::Range(format!("smoothness {}: -1 for jumps, 0 and more else", self.smoothness)));
        }
        let coefficients = |piece: usize| &self.coefficients[piece * d..(piece + 1) * d];
        for (i, &b) in self.breaks.iter().enumerate() {
            for order in 0..(self.smoothness + 1).min(d as i32) as usize {
                let value = |piece: usize| {
                    let (c, z) = (coefficients(piece), b - self.origins[piece]);
                    (order..d).map(|k| c[k] * falling(k, order) * z.powi((k - order) as i32)).sum::<f64>()
                };
                let size = |piece: usize| {
                    let (c, h) = (coefficients(piece), self.length(piece));
                    (order..d).map(|k| (c[k] * falling(k, order)).abs() * h.powi((k - order) as i32)).sum::<f64>()
                };
                let (l, r) = (value(i), value(i + 1));
                if (l - r).abs() > SMOOTH * (size(i) + size(i + 1)) {
                    return Err(Error::Range(format!(
                        "piecewise polynomial: derivative {order} jumps from {l} to {r} at break {b}, but smoothness {} \
                         was declared",
                        self.smoothness
                    )));
                }
            }
        }
        Ok(())
    }

    /// Length of a piece; the first and the last, which have no end, count as long as their neighbours.
    fn length(&self, piece: usize) -> f64 {
        let last = self.breaks.len();
        match self.breaks.len() {
            0 | 1 => 0.0,
            _ => {
                let k = piece.clamp(1, last - 1);
                self.breaks[k] - self.breaks[k - 1]
            }
        }
    }
}

/// A jump of a derivative that is larger, relative to the terms of the polynomials, is no rounding of their coefficients.
const SMOOTH: f64 = 1e-9;

/// `k (k−1) … (k−order+1)`
fn falling(k: usize, order: usize) -> f64 {
    (0..order).map(|i| (k - i) as f64).product()
}

fn check_points(points: &[f64], values: &[f64], least: usize) -> Result<()> {
    if points.len() != values.len() || points.len() < least {
        return Err(Error::Dimension(format!(
            "interpolation of {} values at {} points: as many values as points, at least {least}",
            values.len(),
            points.len()
        )));
    }
    if let Some(v) = points.iter().chain(values).find(|v| !v.is_finite()) {
        return Err(Error::Range(format!("interpolation: {v} is not finite")));
    }
    match points.windows(2).position(|w| w[0] >= w[1]) {
        Some(k) => Err(Error::Range(format!(
            "interpolation: point {} is {}, not above the one before ({})",
            k + 1,
            points[k + 1],
            points[k]
        ))),
        None => Ok(()),
    }
}

/// Second derivatives of the not-a-knot spline at the points: tridiagonal after the two end conditions are used up.
fn second_derivatives(x: &[f64], y: &[f64]) -> Vec<f64> {
    let n = x.len();
    if n == 2 {
        return vec![0.0; 2];
    }
    let h: Vec<f64> = x.windows(2).map(|w| w[1] - w[0]).collect();
    let s: Vec<f64> = (0..n - 1).map(|i| (y[i + 1] - y[i]) / h[i]).collect();
    if n == 3 {
        return vec![2.0 * (s[1] - s[0]) / (h[0] + h[1]); 3];
    }
    // Rows 1..n−1: h_{i−1} m_{i−1} + 2 (h_{i−1} + h_i) m_i + h_i m_{i+1} = 6 (s_i − s_{i−1}).
    let k = n - 2;
    let (mut lower, mut diag, mut upper, mut r) = (vec![0.0; k], vec![0.0; k], vec![0.0; k], vec![0.0; k]);
    for i in 0..k {
        (lower[i], diag[i], upper[i]) = (h[i], 2.0 * (h[i] + h[i + 1]), h[i + 1]);
        r[i] = 6.0 * (s[i + 1] - s[i]);
    }
    // m_0 = m_1 + (m_1 − m_2) h_0 / h_1, and the same at the other end.
    let (a, b) = (h[0] / h[1], h[n - 2] / h[n - 3]);
    diag[0] += h[0] * (1.0 + a);
    upper[0] -= h[0] * a;
    diag[k - 1] += h[n - 2] * (1.0 + b);
    lower[k - 1] -= h[n - 2] * b;
    for i in 1..k {
        let f = lower[i] / diag[i - 1];
        diag[i] -= f * upper[i - 1];
        r[i] -= f * r[i - 1];
    }
    let mut m = vec![0.0; n];
    for i in (0..k).rev() {
        let next = if i + 1 < k { upper[i] * m[i + 2] } else { 0.0 };
        m[i + 1] = (r[i] - next) / diag[i];
    }
    m[0] = m[1] + (m[1] - m[2]) * a;
    m[n - 1] = m[n - 2] + (m[n - 2] - m[n - 3]) * b;
    m
}

impl Dag {
    /// Value of a piecewise polynomial. A table that jumps is not turned into switching functions: use it for
    /// functions of time with breaks on the grid, and [`Dag::step_table`] for functions of the state.
    pub fn piecewise(&mut self, p: &Piecewise, a: Id) -> Id {
        self.piecewise_derivative(p, 0, a)
    }

    pub(super) fn piecewise_derivative(&mut self, p: &Piecewise, order: u8, a: Id) -> Id {
        let index = self.piecewise.iter().position(|q| q == p).unwrap_or_else(|| {
            self.piecewise.push(p.clone());
            self.piecewise.len() - 1
        });
        self.piecewise_node(index as u32, order, a)
    }

    /// Continuous derivatives a node is declared to have in its arguments: those of a table, else as many as one likes.
    pub fn smoothness(&self, id: Id) -> i32 {
        match self.node(id) {
            Node::Piecewise(index, order, _) => self.piecewise[index as usize].smoothness - i32::from(order),
            _ => i32::MAX,
        }
    }

    pub(super) fn piecewise_node(&mut self, index: u32, order: u8, a: Id) -> Id {
        let p = &self.piecewise[index as usize];
        if usize::from(order) > p.degree {
            return self.constant(0.0);
        }
        if let Some(v) = self.as_const(a) {
            let v = p.eval(order, v);
            return self.constant(v);
        }
        self.intern(Node::Piecewise(index, order, a))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spline_reproduces_cubics_with_derivatives() {
        let f = |s: f64| 1.0 - s + 2.0 * s * s - 0.5 * s * s * s;
        let points = [-1.0, -0.4, 0.3, 1.1, 2.0];
        let p = Piecewise::spline(&points, &points.map(f)).unwrap();
        for s in [-2.0, -1.0, -0.7, 0.0, 0.3, 1.5, 2.0, 3.0] {
            assert!((p.eval(0, s) - f(s)).abs() < 1e-13, "{s}");
            assert!((p.eval(1, s) - (-1.0 + 4.0 * s - 1.5 * s * s)).abs() < 1e-12, "{s}");
            assert!((p.eval(2, s) - (4.0 - 3.0 * s)).abs() < 1e-12, "{s}");
            assert!((p.eval(3, s) + 3.0).abs() < 1e-12, "{s}");
        }
        for n in [2, 3] {
            let line = Piecewise::spline(&points[..n], &points.map(|s| 2.0 * s)[..n]).unwrap();
            assert!((line.eval(0, 5.0) - 10.0).abs() < 1e-13);
        }
    }

    #[test]
    fn tables() {
        let p = Piecewise::steps(&[0.0, 1.0], &[5.0, 6.0, 7.0]).unwrap();
        assert_eq!([-1.0, 0.0, 0.5, 1.0, 9.0].map(|s| p.eval(0, s)), [5.0, 6.0, 6.0, 7.0, 7.0]);
        assert_eq!((p.eval(1, 0.5), p.smoothness()), (0.0, -1));
        let p = Piecewise::lines(&[0.0, 1.0, 3.0], &[0.0, 2.0, 0.0]).unwrap();
        assert_eq!([-1.0, 0.5, 1.0, 2.0, 9.0].map(|s| p.eval(0, s)), [0.0, 1.0, 2.0, 1.0, 0.0]);
        assert!(p.eval(0, f64::NAN).is_nan());
    }

    /// What is smooth in one unit is smooth in any, and what jumps, jumps.
    #[test]
    fn smoothness_does_not_depend_on_units() {
        let points = [-1.0, -0.4, 0.3, 1.1, 2.0, 2.1];
        let values = [0.3, -1.0, 0.0, 1e-9, 4.0, 4.0];
        for (a, b) in [(1.0, 1.0), (1e12, 1.0), (1e-12, 1.0), (1.0, 1e12), (1.0, 1e-12), (1e12, 1e-12), (1e-12, 1e12)] {
            let (s, v) = (points.map(|s| s * a), values.map(|v| v * b));
            Piecewise::spline(&s, &v).unwrap();
            Piecewise::lines(&s, &v).unwrap();
            let kink = |jump: f64| [0.0, b / a, jump * b, b / a];
            assert!(Piecewise::new(&[0.0], 1, &kink(0.0), 0).is_ok());
            assert!(Piecewise::new(&[0.0], 1, &kink(1e-6), 0).is_err(), "jump of 1e-6 in units {a}, {b}");
        }
    }

    #[test]
    fn declarations_are_checked() {
        let e = Piecewise::new(&[0.0], 1, &[0.0, 1.0, 0.0, 2.0], 1).unwrap_err().to_string();
        assert!(e.contains("derivative 1 jumps from 1 to 2"), "{e}");
        Piecewise::new(&[0.0], 1, &[0.0, 1.0, 0.0, 2.0], 0).unwrap();
        assert!(Piecewise::steps(&[1.0, 1.0], &[0.0; 3]).is_err());
        assert!(Piecewise::steps(&[1.0], &[0.0; 3]).is_err());
        assert!(Piecewise::steps(&[f64::NAN], &[0.0; 2]).is_err());
        assert!(Piecewise::spline(&[1.0], &[0.0]).is_err());
        assert!(Piecewise::lines(&[1.0, 0.0], &[0.0, f64::INFINITY]).is_err());
    }
}
