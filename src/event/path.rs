//! Dense output of a whole run.

use super::step::{derivative, horner, Poly};
use crate::error::{Error, Result};
use crate::memory;
use crate::tableau::{Family, Tableau};

/// Pieces of one step at most: one, but for steps of a method that needs no switches.
const ROOM: usize = 64;
/// Points of a step at which a function is integrated.
const QUADRATURE: usize = 5;

/// A piecewise polynomial solution.
#[derive(Debug, Clone, Default)]
pub struct Path {
    nx: usize,
    /// Start, end and the unit of relative time of every piece.
    pieces: Vec<(f64, f64, f64)>,
    poly: Vec<Poly>,
}

impl Path {
    pub(super) fn new(nx: usize) -> Path {
        Path { nx, pieces: Vec::new(), poly: Vec::new() }
    }

    pub(super) fn clear(&mut self) {
        self.pieces.clear();
        self.poly.clear();
    }

    /// Makes room for the next pieces.
    pub(super) fn room(&mut self) -> Result<()> {
        memory::reserve(&mut self.pieces, ROOM)?;
        memory::reserve(&mut self.poly, ROOM * self.nx)
    }

    /// Bytes of the pieces.
    pub fn bytes(&self) -> usize {
        self.pieces.len() * size_of::<(f64, f64, f64)>() + self.poly.len() * size_of::<Poly>()
    }

    pub(super) fn push(&mut self, t: f64, end: f64, h: f64, poly: &[Poly]) {
        self.pieces.push((t, end, h));
        self.poly.extend_from_slice(poly);
    }

    /// A piece along a straight line.
    pub(super) fn push_line(&mut self, t: f64, end: f64, x: &[f64], f: &[f64]) {
        self.pieces.push((t, end, end - t));
        self.poly.extend(x.iter().zip(f).map(|(x, f)| {
            let mut line = Poly::default();
            (line[0], line[1]) = (*x, (end - t) * f);
            line
        }));
    }

    /// Number of pieces.
    pub fn len(&self) -> usize {
        self.pieces.len()
    }

    /// True before the first step.
    pub fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    /// Ends of the steps, the start first.
    pub fn times(&self) -> Vec<f64> {
        self.pieces.first().map(|p| p.0).into_iter().chain(self.pieces.iter().map(|p| p.1)).collect()
    }

    /// Integral of a function of time and state over the steps from `from` on, by Gauss's rule of five points in every step, exact for the
    /// polynomials of the output up to degree 9.
    pub fn integrate(&self, from: f64, f: &mut dyn FnMut(f64, &[f64]) -> f64) -> Result<f64> {
        let rule = Tableau::new(Family::GaussLegendre, QUADRATURE)?;
        let (mut x, mut sum) = (vec![0.0; self.nx], 0.0);
        let first = self.pieces.partition_point(|p| p.0 < from);
        for (i, &(t0, end, h)) in self.pieces.iter().enumerate().skip(first) {
            for (c, b) in rule.c.iter().zip(&rule.b) {
                let t = t0 + c * (end - t0);
                eval(&self.poly[i * self.nx..(i + 1) * self.nx], (t - t0) / h, h, 0, &mut x);
                sum += b * (end - t0) * f(t, &x);
            }
        }
        Ok(sum)
    }

    /// State at time `t`, or its `k`-th derivative. At a switch the piece before it counts.
    pub fn eval(&self, t: f64, k: usize, out: &mut [f64]) -> Result<()> {
        if out.len() != self.nx {
            return Err(Error::Dimension(format!("room for {} values, a state has {}", out.len(), self.nx)));
        }
        let (Some(first), Some(last)) = (self.pieces.first(), self.pieces.last()) else {
            return Err(Error::State("there is no dense output: ask for it in the options, then simulate".into()));
        };
        if !(t >= first.0 && t <= last.1) {
            return Err(Error::Range(format!("time {t} is outside of the run, {} to {}", first.0, last.1)));
        }
        let i = self.pieces.partition_point(|p| p.1 < t);
        let (t0, _, h) = self.pieces[i];
        eval(&self.poly[i * self.nx..(i + 1) * self.nx], (t - t0) / h, h, k, out);
        Ok(())
    }
}

/// `k`-th derivative of a step at relative time `s`.
pub(super) fn eval(poly: &[Poly], s: f64, h: f64, k: usize, out: &mut [f64]) {
    for (o, p) in out.iter_mut().zip(poly) {
        *o = match k {
            0 => horner(p, s),
            _ if k >= p.len() => 0.0,
            _ => derivative(p, k, s) / h.powi(k as i32),
        };
    }
}
