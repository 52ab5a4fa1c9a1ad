//! Costs with kinks that point down: a smooth function and maxima of smooth functions.

use std::sync::Arc;

use super::{Dims, EvalResult, Function, Point};
use crate::error::{check_positive, Error, Result};
use crate::linalg::csc::Pattern;

/// `weight max(0, a_1, a_2, …)`, or its square where that is said.
#[derive(Clone)]
pub struct Maximum {
    /// Positive factor.
    pub weight: f64,
    /// The smooth functions `a_i`, one output each.
    pub of: Arc<dyn Function>,
    /// `weight max(0, a_1, a_2, …)²` instead.
    pub squared: bool,
}

/// `smooth + Σ kinks`: what `|a|`, `max(a, b)` and sums of them in a cost come to. Whoever minimises it puts a variable in the place of every
/// maximum, which is no less than its arguments, so that the program is smooth; elsewhere it is a function like others, whose
/// derivatives are those of the pieces that are the largest.
pub struct Kinked {
    name: String,
    smooth: Arc<dyn Function>,
    kinks: Vec<Maximum>,
    jac: Pattern,
    hess: Pattern,
    /// Length of the workspace of a part, of its Jacobian or Hessian, and of its value.
    work: usize,
    entries: usize,
    pieces: usize,
}

/// Takes a function, the number of a piece of it, the value of that in the cost, the factors of its derivatives and of the product of its gradient
/// with itself, and memory.
type Visit<'a> = dyn FnMut(&dyn Function, usize, f64, [f64; 2], &mut [f64]) -> EvalResult + 'a;

impl Kinked {
    /// A cost of these parts; `smooth` has one output, and all functions the same inputs.
    ///
    /// # Errors
    /// [`Error::Dimension`] where they differ, [`Error::Range`] for a weight that is not positive.
    pub fn new(name: &str, smooth: Arc<dyn Function>, kinks: Vec<Maximum>) -> Result<Kinked> {
        let d = smooth.dims();
        if smooth.n_out() != 1 || kinks.iter().any(|k| k.of.dims() != d || k.of.n_out() == 0) {
            return Err(Error::Dimension(format!("cost '{name}': its parts have other inputs, or no output")));
        }
        kinks.iter().try_for_each(|k| check_positive(&format!("cost '{name}': the factor of a kink"), k.weight))?;
        let all = || std::iter::once(&smooth).chain(kinks.iter().map(|k| &k.of));
        let (mut columns, mut entries) = (vec![false; d.n_in()], Vec::new());
        for f in all() {
            (0..d.n_in()).for_each(|c| columns[c] |= !f.jac_pattern().rows(c).is_empty());
            let h = f.hess_pattern();
            entries.extend((0..d.n_in()).flat_map(|c| h.rows(c).iter().map(move |&r| (r, c))));
        }
        let columns: Vec<usize> = (0..d.n_in()).filter(|&c| columns[c]).collect();
        // the square of a maximum has second derivatives wherever the maximum has first ones
        for f in kinks.iter().filter(|k| k.squared).map(|k| &k.of) {
            let seen: Vec<usize> = (0..d.n_in()).filter(|&c| !f.jac_pattern().rows(c).is_empty()).collect();
            entries.extend(seen.iter().flat_map(|&c| seen.iter().filter(move |&&r| r <= c).map(move |&r| (r, c))));
        }
        let (rows, cols): (Vec<usize>, Vec<usize>) = entries.into_iter().unzip();
        Ok(Kinked {
            name: name.to_owned(),
            jac: Pattern::from_triplets(1, d.n_in(), &vec![0; columns.len()], &columns).0,
            hess: Pattern::from_triplets(d.n_in(), d.n_in(), &rows, &cols).0,
            work: all().map(|f| f.work_len()).max().unwrap_or(0),
            entries: all().map(|f| f.jac_pattern().nnz().max(f.hess_pattern().nnz())).max().unwrap_or(0),
            pieces: all().map(|f| f.n_out()).max().unwrap_or(0),
            smooth,
            kinks,
        })
    }

    /// The cost without its kinks.
    pub fn smooth(&self) -> &Arc<dyn Function> {
        &self.smooth
    }

    /// The kinks that were taken out of it.
    pub fn kinks(&self) -> &[Maximum] {
        &self.kinks
    }

    /// Calls `part` with every part at the point. Maxima that are zero are left out.
    fn parts(&self, at: &Point, work: &mut [f64], part: &mut Visit) -> EvalResult {
        let (values, work) = work.split_at_mut(self.pieces);
        self.smooth.value(at, &mut values[..1], work)?;
        part(self.smooth.as_ref(), 0, values[0], [1.0, 0.0], work)?;
        for k in &self.kinks {
            let values = &mut values[..k.of.n_out()];
            k.of.value(at, values, work)?;
            let largest = (0..values.len()).max_by(|&i, &j| values[i].total_cmp(&values[j]));
            if let Some(i) = largest.filter(|&i| values[i] > 0.0) {
                let (a, w) = (values[i], k.weight);
                let (value, factors) = if k.squared { (w * a * a, [2.0 * w * a, 2.0 * w]) } else { (w * a, [w, 0.0]) };
                part(k.of.as_ref(), i, value, factors, work)?;
            }
        }
        Ok(())
    }
}

impl Function for Kinked {
    fn name(&self) -> &str {
        &self.name
    }
    fn dims(&self) -> Dims {
        self.smooth.dims()
    }
    fn n_out(&self) -> usize {
        1
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn work_len(&self) -> usize {
        2 * self.pieces + 2 * self.entries + self.work
    }
    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        out[0] = 0.0;
        self.parts(at, work, &mut |_, _, value, _, _| {
            out[0] += value;
            Ok(())
        })
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        out.fill(0.0);
        self.parts(at, work, &mut |f, piece, _, [factor, _], work| {
            let (inner, work) = work.split_at_mut(self.entries);
            let pattern = f.jac_pattern();
            f.jacobian(at, &mut inner[..pattern.nnz()], work)?;
            for c in 0..pattern.n_cols() {
                if let (Some(from), Some(to)) = (pattern.get(piece, c), self.jac.get(0, c)) {
                    out[to] += factor * inner[from];
                }
            }
            Ok(())
        })
    }
    fn hessian(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        out.fill(0.0);
        self.parts(at, work, &mut |f, piece, _, [factor, square], work| {
            let (inner, work) = work.split_at_mut(self.entries);
            let (chosen, work) = work.split_at_mut(self.pieces);
            let chosen = &mut chosen[..f.n_out()];
            chosen.fill(0.0);
            chosen[piece] = weights[0] * factor;
            let pattern = f.hess_pattern();
            f.hessian(at, chosen, &mut inner[..pattern.nnz()], work)?;
            for c in 0..pattern.n_cols() {
                for &r in pattern.rows(c) {
                    if let (Some(from), Some(to)) = (pattern.get(r, c), self.hess.get(r, c)) {
                        out[to] += inner[from];
                    }
                }
            }
            if square != 0.0 {
                let pattern = f.jac_pattern();
                f.jacobian(at, &mut inner[..pattern.nnz()], work)?;
                let slope = |c: usize| pattern.get(piece, c).map(|k| inner[k]);
                for c in 0..pattern.n_cols() {
                    for r in 0..=c {
                        if let (Some(a), Some(b), Some(to)) = (slope(r), slope(c), self.hess.get(r, c)) {
                            out[to] += weights[0] * square * a * b;
                        }
                    }
                }
            }
            Ok(())
        })
    }
    fn kinked(&self) -> Option<&Kinked> {
        Some(self)
    }
    fn is_serial(&self) -> bool {
        self.smooth.is_serial() || self.kinks.iter().any(|k| k.of.is_serial())
    }
}

#[cfg(test)]
mod tests {
    use super::super::Callback;
    use super::*;

    #[test]
    fn derivatives_are_those_of_the_largest_pieces() {
        let d = Dims { x: 1, u: 1, p: 0 };
        let smooth = Callback::new("square", d, 1, |at, out| {
            out[0] = at.x[0] * at.x[0];
            0
        });
        let two = Callback::new("pieces", d, 2, |at, out| {
            (out[0], out[1]) = (at.u[0] - 1.0, -at.u[0] * at.x[0]);
            0
        });
        let two: Arc<dyn Function> = Arc::new(two);
        let kinks = [(3.0, false), (0.5, true)].map(|(weight, squared)| Maximum { weight, of: two.clone(), squared });
        let f = Kinked::new("cost", Arc::new(smooth), kinks.to_vec()).unwrap();
        let mut work = vec![0.0; f.work_len()];
        for (x, u, value, slopes) in [
            (2.0, 0.5, 4.0, [4.0, 0.0]),
            (2.0, 3.0, 4.0 + 6.0 + 2.0, [4.0, 3.0 + 2.0]),
            (2.0, -1.0, 4.0 + 6.0 + 2.0, [4.0 + 3.0 + 2.0, -6.0 - 4.0]),
        ] {
            let at = Point { t: 0.0, x: &[x], u: &[u], p: &[] };
            let (mut v, mut j) = ([0.0], [0.0; 2]);
            f.value(&at, &mut v, &mut work).unwrap();
            f.jacobian(&at, &mut j, &mut work).unwrap();
            assert_eq!(v[0], value);
            assert!(j.iter().zip(slopes).all(|(a, b)| (a - b).abs() < 1e-8), "{j:?} {slopes:?}");
            // second derivatives against differences of the first
            let mut h = vec![0.0; f.hess_pattern().nnz()];
            f.hessian(&at, &[1.0], &mut h, &mut work).unwrap();
            for c in 0..2 {
                for r in 0..=c {
                    let shifted = |by: f64, work: &mut [f64]| {
                        let mut z = [x, u];
                        z[c] += by;
                        let mut j = [0.0; 2];
                        f.jacobian(&Point { t: 0.0, x: &z[..1], u: &z[1..], p: &[] }, &mut j, work).unwrap();
                        j[r]
                    };
                    let slope = (shifted(1e-4, &mut work) - shifted(-1e-4, &mut work)) / 2e-4;
                    let at = f.hess_pattern().get(r, c).map_or(0.0, |k| h[k]);
                    assert!((at - slope).abs() < 1e-4, "({r}, {c}) at ({x}, {u}): {at} {slope}");
                }
            }
        }
        let bad = Maximum { weight: -1.0, of: two, squared: false };
        assert!(Kinked::new("cost", f.smooth().clone(), vec![bad]).is_err());
    }
}
