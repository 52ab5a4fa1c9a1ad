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
    pieces: Vec<Piece>,
    /// Coefficients of all states, step by step.
    poly: Vec<Poly>,
    /// States that go on otherwise from a time in a step on, step by step, those of one state in the order of time.
    own: Vec<Own>,
    /// The least number of last steps that is kept; 0: all. And whether some have been dropped.
    keep: usize,
    dropped: bool,
}

/// A part of a step between two events.
#[derive(Debug, Clone, Copy)]
struct Piece {
    t: f64,
    end: f64,
    /// Where the step begins, and the unit of its relative time.
    origin: f64,
    h: f64,
    /// The step, and where the states begin that go their own way in it.
    step: usize,
    own: usize,
}

/// One state from a time on.
#[derive(Debug, Clone, Copy)]
struct Own {
    step: u32,
    state: u32,
    t: f64,
    h: f64,
    poly: Poly,
}

impl Path {
    /// Of so many states; it keeps the last `keep` steps at least, or all if that is 0.
    pub(super) fn new(nx: usize, keep: usize) -> Path {
        Path { nx, keep, ..Path::default() }
    }

    /// An empty one for the next run.
    pub(super) fn fresh(&self) -> Path {
        Path::new(self.nx, self.keep)
    }

    pub(super) fn clear(&mut self) {
        self.dropped = false;
        self.pieces.clear();
        self.poly.clear();
        self.own.clear();
    }

    /// Makes room for the next pieces.
    pub(super) fn room(&mut self) -> Result<()> {
        memory::reserve(&mut self.pieces, ROOM)?;
        memory::reserve(&mut self.poly, ROOM * self.nx)
    }

    /// Bytes of the pieces.
    pub fn bytes(&self) -> usize {
        self.pieces.len() * size_of::<Piece>() + self.poly.len() * size_of::<Poly>() + self.own.len() * size_of::<Own>()
    }

    pub(super) fn push(&mut self, t: f64, end: f64, h: f64, poly: &[Poly]) {
        self.begin(t, end, h);
        self.poly.extend_from_slice(poly);
    }

    /// The first piece of a step.
    fn begin(&mut self, t: f64, end: f64, h: f64) {
        self.drop_old();
        let step = self.poly.len() / self.nx.max(1);
        self.pieces.push(Piece { t, end, origin: t, h, step, own: self.own.len() });
    }

    /// Drops steps that are not kept, many at once: every number is moved a few times, however long the run is.
    fn drop_old(&mut self) {
        /// One of so many parts of the steps that are kept is dropped at once.
        const PART: usize = 4;
        let steps = self.poly.len() / self.nx.max(1);
        if self.keep == 0 || steps < self.keep + (self.keep / PART).max(1) {
            return;
        }
        let first = steps - self.keep;
        let pieces = self.pieces.partition_point(|p| p.step < first);
        let own = self.pieces.get(pieces).map_or(self.own.len(), |p| p.own);
        self.pieces.drain(..pieces);
        self.poly.drain(..first * self.nx);
        self.own.drain(..own);
        for p in &mut self.pieces {
            (p.step, p.own) = (p.step - first, p.own - own);
        }
        self.own.iter_mut().for_each(|o| o.step -= first as u32);
        self.dropped = true;
    }

    /// The last piece ends a rounding error later.
    pub(super) fn move_end(&mut self, t: f64) {
        if let Some(last) = self.pieces.last_mut() {
            last.end = t;
        }
    }

    /// Cuts the last piece at the `times` of events, which ascend.
    pub(super) fn cut(&mut self, times: &[f64]) {
        for &t in times {
            let Some(last) = self.pieces.last_mut().filter(|p| p.t < t && t < p.end) else { continue };
            let rest = Piece { t, ..*last };
            last.end = t;
            self.pieces.push(rest);
        }
    }

    /// A state goes on otherwise from time `t` on in the last step.
    pub(super) fn push_own(&mut self, state: usize, (t, h): (f64, f64), poly: &Poly) {
        if let Some(p) = self.pieces.last() {
            self.own.push(Own { step: p.step as u32, state: state as u32, t, h, poly: *poly });
        }
    }

    /// `k`-th derivative of the state at time `t` on a piece.
    fn eval_piece(&self, p: &Piece, t: f64, k: usize, out: &mut [f64]) {
        let n = self.nx;
        eval(&self.poly[p.step * n..(p.step + 1) * n], (t - p.origin) / p.h, p.h, k, out);
        // the piece before an event counts at its time
        for o in self.own[p.own..].iter().take_while(|o| o.step as usize == p.step).filter(|o| o.t < t) {
            let i = o.state as usize;
            eval(std::slice::from_ref(&o.poly), (t - o.t) / o.h, o.h, k, &mut out[i..=i]);
        }
    }

    /// What a state follows in the last step.
    pub(super) fn set_last(&mut self, state: usize, poly: &Poly) {
        let first = self.poly.len().saturating_sub(self.nx);
        if let Some(p) = self.poly.get_mut(first + state) {
            *p = *poly;
        }
    }

    /// A piece along a straight line.
    pub(super) fn push_line(&mut self, t: f64, end: f64, x: &[f64], f: &[f64]) {
        self.begin(t, end, end - t);
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
        self.pieces.first().map(|p| p.t).into_iter().chain(self.pieces.iter().map(|p| p.end)).collect()
    }

    /// Integral of a function of time and state over the steps from `from` on, by Gauss's rule of five points in every step, exact for the
    /// polynomials of the output up to degree 9.
    pub fn integrate(&self, from: f64, f: &mut dyn FnMut(f64, &[f64]) -> f64) -> Result<f64> {
        let rule = Tableau::new(Family::GaussLegendre, QUADRATURE)?;
        let (mut x, mut sum) = (vec![0.0; self.nx], 0.0);
        let first = self.pieces.partition_point(|p| p.t < from);
        for p in &self.pieces[first..] {
            for (c, b) in rule.c.iter().zip(&rule.b) {
                let t = p.t + c * (p.end - p.t);
                self.eval_piece(p, t, 0, &mut x);
                sum += b * (p.end - p.t) * f(t, &x);
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
        if self.dropped && t < first.t {
            let (a, b) = (first.t, last.end);
            return Err(Error::Range(format!(
                "time {t} is before the dense output, which has kept the steps from {a} to {b}: raise dense_steps, or ask for times on the way"
            )));
        }
        if !(t >= first.t && t <= last.end) {
            return Err(Error::Range(format!("time {t} is outside of the run, {} to {}", first.t, last.end)));
        }
        let i = self.pieces.partition_point(|p| p.end < t);
        self.eval_piece(&self.pieces[i], t, k, out);
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The state is the number of the step; every third one is cut by an event, behind which one state is at zero.
    #[test]
    fn old_steps_are_dropped() {
        let mut path = Path::new(2, 8);
        let mut x = [0.0; 2];
        for k in 0..1000 {
            let (t, mut still) = (f64::from(k), [Poly::default(); 2]);
            still.iter_mut().for_each(|p| p[0] = t);
            path.push(t, t + 1.0, 1.0, &still);
            if k % 3 == 0 {
                path.push_own(1, (t + 0.5, 1.0), &Poly::default());
                path.cut(&[t + 0.5]);
            }
            assert!(path.poly.len() <= 2 * 10 && path.own.len() <= 4 && path.pieces.len() <= 14);
            for back in 0..8.min(k + 1) {
                let s = f64::from(k - back);
                path.eval(s + 0.25, 0, &mut x).unwrap();
                assert_eq!(x, [s, s]);
                path.eval(s + 0.75, 0, &mut x).unwrap();
                assert_eq!(x, [s, if (k - back) % 3 == 0 { 0.0 } else { s }]);
            }
        }
        let e = path.eval(3.0, 0, &mut x).unwrap_err().to_string();
        assert!(e.contains("raise dense_steps"), "{e}");
        path.clear();
        path.push(0.0, 1.0, 1.0, &[Poly::default(); 2]);
        let e = path.eval(-3.0, 0, &mut x).unwrap_err().to_string();
        assert!(e.contains("outside of the run"), "{e}");
    }

    /// Two states stand still from 0 to 2; the second one jumps from 0 to 1 at time 1, and goes on with the velocity 2.
    #[test]
    fn a_state_with_a_piece_of_its_own_leaves_the_others_alone() {
        let mut path = Path::new(2, 0);
        let mut line = Poly::default();
        (line[0], line[1]) = (1.0, 2.0);
        path.push(0.0, 2.0, 2.0, &[Poly::default(); 2]);
        path.push_own(1, (1.0, 1.0), &line);
        path.cut(&[1.0]);
        path.push(2.0, 3.0, 1.0, &[Poly::default(); 2]);
        assert_eq!(path.times(), [0.0, 1.0, 2.0, 3.0]);
        let at = |t: f64, k: usize| {
            let mut x = [f64::NAN; 2];
            path.eval(t, k, &mut x).unwrap();
            x
        };
        assert_eq!(
            [at(0.5, 0), at(1.0, 0), at(1.5, 0), at(2.0, 0), at(2.5, 0)].map(|x| x[1]),
            [0.0, 0.0, 2.0, 3.0, 0.0]
        );
        assert_eq!(at(1.5, 1), [0.0, 2.0]);
        let integral = path.integrate(0.0, &mut |_, x| x[1]).unwrap();
        assert!((integral - 2.0).abs() < 1e-14, "{integral}");
    }
}
