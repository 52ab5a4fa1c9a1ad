//! Inclusions by events: steps of switching functions whose weight is an argument.
//!
//! ```text
//! ẋ = f(x, α, u, p, t),   α_j ∈ γ(ψ_j(x, u, p, t)),   γ the set-valued step                                   (6.38)
//! ```
//!
//! Away from its surface `ψ_j = 0` a weight is 0 or 1. Where the motion on neither side leaves the surface, the weight keeps it there: a root of
//! `ψ̇_j(α_j) = 0` between 0 and 1, or of `ψ_j(x, z(x, α)) = 0` where `α` acts on algebraic states that `ψ_j` depends on. Where `f` is
//! not affine in `α` that is not Filippov's convex combination of both sides, but Aizerman and Pyatnitskii's solution. Each step is a loop of
//! the algebraic equations, see [`algebraic`](super::algebraic), with its weight among the unknowns.

use super::algebraic::Algebraic;
use super::held::{By, NO_RATE};
use super::{SharedFunction, System};
use crate::func::{Dims, EvalError, EvalResult, Function, Point};
use crate::linalg::csc::Pattern;
use std::sync::Arc;

/// Intervals of a weight in which continuations are looked for, where its function is not affine in it.
const INTERVALS: usize = 16;

impl Algebraic {
    /// Is the motion from here on the only one, as far as steps of inclusions are concerned whose surface this point is on?
    pub(crate) fn steps_are_unique(
        &self,
        (t, u, p): (f64, &[f64], &[f64]),
        x: &[f64],
    ) -> std::result::Result<bool, EvalError> {
        for (k, l) in self.loops.iter().enumerate() {
            let Some(h) = l.held.first().filter(|h| l.step.is_some() && h.by == By::Rate) else { continue };
            let (v, rounding) = self.regions_at(k, &Point { t, x: &x[..self.dims.x], u, p })?;
            let value: f64 = h.terms.iter().map(|(o, w)| w * v[*o]).sum();
            let noise: f64 = h.terms.iter().map(|(o, w)| w.abs() * rounding[*o]).sum();
            if value.abs() <= noise && self.continuations(k, (t, u, p), x)? > 1 {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Ways to go on from the surface of loop `k`, if that is a step whose surface may be held: it leaves to either side where the rate on that side
    /// leads away, and stays for every weight between at which there is none. One for other loops, and where functions are not defined for
    /// some weights. Of a function that is not affine in the weight, changes of sign are seen in [`INTERVALS`] intervals.
    pub(crate) fn continuations(
        &self,
        k: usize,
        (t, u, p): (f64, &[f64], &[f64]),
        x: &[f64],
    ) -> std::result::Result<usize, EvalError> {
        let l = &self.loops[k];
        let (Some(h), Some((inclusion, _)), Some(weight)) = (l.held.first(), l.step, l.weight) else { return Ok(1) };
        let f = &self.inclusions[inclusion];
        let affine = f.hess_pattern().rows(self.dims.x + weight).iter().all(|r| *r != self.dims.x + weight)
            && !f.hessian_is_approximate()
            && self.parts.iter().all(|p| p.f.jac_pattern().n_cols() != f.jac_pattern().n_cols());
        let n = if affine { 1 } else { INTERVALS };
        let first = self.dims.x + self.loops.len();
        let mut there = x.to_vec();
        there[self.dims.x + k] = h.low as f64;
        let mut signs = Vec::with_capacity(n + 1);
        let mut known = Ok(());
        for i in 0..=n {
            let w = i as f64 / n as f64;
            there[first + weight] = w;
            let mut s = self.lock();
            (s.fixed, s.known) = (Some((k, w)), None);
            known = self.settle(&mut s, &Point { t, x: &there, u, p }).and_then(|()| {
                let full = s.full.clone();
                let (states, weights) = full.split_at(self.dims.x);
                s.w.copy_from_slice(weights);
                let at = Point { t, x: states, u, p };
                let (value, noise) = match h.by {
                    By::Rate => {
                        let (rate, size) = self.rate_of(&mut s, k, &h.terms, &at)?;
                        (rate, NO_RATE * f64::EPSILON * size)
                    }
                    By::Value => {
                        let (v, rounding) = self.regions_at(k, &at)?;
                        let sum = |of: &dyn Fn(usize, f64) -> f64| h.terms.iter().map(|(o, c)| of(*o, *c)).sum::<f64>();
                        (sum(&|o, c| c * v[o]), sum(&|o, c| c.abs() * rounding[o]))
                    }
                };
                signs.push(if value.abs() <= noise { 0.0 } else { value.signum() });
                Ok(())
            });
            (s.fixed, s.known, s.failure) = (None, None, None);
            if known.is_err() {
                break;
            }
        }
        match known {
            Ok(()) => {}
            Err(EvalError::Recoverable) => return Ok(1),
            Err(e) => return Err(e),
        }
        let leaves = usize::from(signs[0] < 0.0) + usize::from(signs[n] > 0.0);
        let between: Vec<f64> = signs.into_iter().filter(|s| *s != 0.0).collect();
        Ok(leaves + between.windows(2).filter(|s| s[0] != s[1]).count())
    }
}

/// The signs of one of `n` switching functions on the sides of its surface, as finite elements list them: positive, then negative. The others do
/// not count.
pub(super) fn signs_of_step(n: usize, j: usize) -> Vec<i8> {
    let mut signs = vec![0; 2 * n];
    (signs[j], signs[n + j]) = (1, -1);
    signs
}

/// What determines the weight of step `j` of inclusion `k` where its surface is held; nothing, where the weight does not act on it.
pub(super) fn held_by(system: &System, (k, j): (usize, usize), known: &[bool]) -> Option<By> {
    let (i, z) = (&system.inclusions[k], system.algebraic_states());
    let own: Vec<usize> = i.f.jac_pattern().rows(system.dims.x + j).iter().map(|o| i.rows[*o]).collect();
    let psi = i.psi.jac_pattern();
    let depends = |c: usize| psi.rows(c).contains(&j);
    let in_equations = own.iter().any(|r| z.contains(r));
    if z.clone().any(depends) {
        return in_equations.then_some(By::Value);
    }
    let moves = in_equations || own.iter().any(|r| depends(*r));
    let is_known = (0..system.dims.x).filter(|c| !z.contains(c)).all(|c| known[c] || !depends(c));
    (moves && is_known).then_some(By::Rate)
}

/// The function of an inclusion, of the states and some weights, as one of the states and `all` weights, the `first` of which is the first of
/// its own.
pub(super) fn of_weights(f: &SharedFunction, dims: Dims, (first, all): (usize, usize)) -> SharedFunction {
    let n = f.dims().x - dims.x;
    let place = |c: usize| match c {
        c if c < dims.x => Some(c),
        c if c < dims.x + n => Some(c + first),
        c => Some(c + all - n),
    };
    Arc::new(Placed::new(f, Dims { x: dims.x + all, ..dims }, &place))
}

/// A function without the parameters behind those of the system: they are zero.
pub(super) fn of_fewer(f: &SharedFunction, dims: Dims) -> SharedFunction {
    let last = f.dims().n_in() - 1;
    if f.dims() == dims {
        return f.clone();
    }
    let place = |c: usize| match c {
        c if c == last => Some(dims.n_in() - 1),
        c => (c + 1 < dims.n_in()).then_some(c),
    };
    Arc::new(Placed::new(f, dims, &place))
}

/// A function of inputs that stand elsewhere among those of another one. Inputs without a place are zero.
pub(super) struct Placed {
    f: SharedFunction,
    dims: Dims,
    /// Where every input of the function stands, but for the time.
    places: Vec<Option<usize>>,
    jac: Pattern,
    /// The entries of the function that its own are, in their order.
    jac_entries: Vec<usize>,
    hess: Pattern,
    hess_entries: Vec<usize>,
}

impl Placed {
    /// `place` ascends where it has a value.
    pub(super) fn new(f: &SharedFunction, dims: Dims, place: &dyn Fn(usize) -> Option<usize>) -> Placed {
        let n_in = dims.n_in();
        let entries = |p: &Pattern, m: usize, rows_too: bool| {
            let (mut rows, mut cols, mut own) = (Vec::new(), Vec::new(), Vec::new());
            for (c, entries) in p.columns() {
                let Some(to) = place(c) else { continue };
                for e in entries {
                    let row = p.row_idx()[e];
                    let Some(row) = (if rows_too { place(row) } else { Some(row) }) else { continue };
                    rows.push(row);
                    cols.push(to);
                    own.push(e);
                }
            }
            // places ascend, so the entries keep their order
            (Pattern::from_triplets(m, n_in, &rows, &cols).0, own)
        };
        let (jac, jac_entries) = entries(f.jac_pattern(), f.n_out(), false);
        let (hess, hess_entries) = entries(f.hess_pattern(), n_in, true);
        let places = (0..f.dims().n_in() - 1).map(place).collect();
        Placed { f: f.clone(), dims, places, jac, jac_entries, hess, hess_entries }
    }

    /// Calls `call` with the point of the function, and room.
    fn at(&self, at: &Point, work: &mut [f64], call: impl FnOnce(&Point, &mut [f64]) -> EvalResult) -> EvalResult {
        let (inputs, work) = work.split_at_mut(self.places.len());
        for (v, place) in inputs.iter_mut().zip(&self.places) {
            *v = place.map_or(0.0, |c| super::linear::input(at, c));
        }
        let d = self.f.dims();
        let (x, rest) = inputs.split_at(d.x);
        let (u, p) = rest.split_at(d.u);
        call(&Point { t: at.t, x, u, p }, work)
    }
}

impl Function for Placed {
    fn name(&self) -> &str {
        self.f.name()
    }
    fn dims(&self) -> Dims {
        self.dims
    }
    fn n_out(&self) -> usize {
        self.f.n_out()
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn work_len(&self) -> usize {
        let f = &self.f;
        self.places.len() + f.jac_pattern().nnz().max(f.hess_pattern().nnz()) + f.work_len()
    }
    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.at(at, work, |there, work| self.f.value(there, out, work))
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.at(at, work, |there, work| {
            let (own, work) = work.split_at_mut(self.f.jac_pattern().nnz());
            self.f.jacobian(there, own, work)?;
            out.iter_mut().zip(&self.jac_entries).for_each(|(o, e)| *o = own[*e]);
            Ok(())
        })
    }
    fn hessian(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.at(at, work, |there, work| {
            let (own, work) = work.split_at_mut(self.f.hess_pattern().nnz());
            self.f.hessian(there, weights, own, work)?;
            out.iter_mut().zip(&self.hess_entries).for_each(|(o, e)| *o = own[*e]);
            Ok(())
        })
    }
    fn is_serial(&self) -> bool {
        self.f.is_serial()
    }
    fn jacobian_is_approximate(&self) -> bool {
        self.f.jacobian_is_approximate()
    }
    fn hessian_is_approximate(&self) -> bool {
        self.f.hessian_is_approximate()
    }
}
