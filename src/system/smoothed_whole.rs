//! A combined right-hand side `f(x, θ)` with smooth weights: `f(x, θ(v(x)))`.

use std::ops::Range;

use super::smoothed::{columns, gradients, Weights, Widths};
use super::{SharedFunction, System};
use crate::func::{Dims, EvalResult, Function, Point};
use crate::linalg::csc::Pattern;

/// The right-hand side of a smoothed system. `f` is affine in the weights.
pub(super) struct Whole {
    f: SharedFunction,
    dims: Dims,
    switches: Vec<Switch>,
    jac: Pattern,
    hess: Pattern,
    /// Entries behind those of the Jacobian of `f` in columns that are no weights; those of weights follow column by column, each row
    /// with all columns of the switching functions behind it.
    plain_jac: Vec<usize>,
    chain_jac: Vec<usize>,
    /// The same of the Hessian: entries without weights, and for entries with a weight those for all columns behind it.
    plain_hess: Vec<usize>,
    chain_hess: Vec<usize>,
    /// Of every weight its subsystem, and where its slopes begin.
    slopes: Vec<(usize, usize)>,
}

/// The weights of one subsystem; one mode alone has the weight 1 and no switching functions.
struct Switch {
    by: Option<Weights>,
    n_modes: usize,
    /// Its first weight.
    first: usize,
    /// Columns its switching functions depend on.
    cols: Vec<usize>,
    /// Entries of the Hessian behind those of the switching functions, and for every pair of their columns.
    psi_hess: Vec<usize>,
    pairs: Vec<usize>,
}

impl Switch {
    fn function(&self) -> Option<&SharedFunction> {
        self.by.as_ref().map(|b| b.regions.function())
    }

    fn n_psi(&self) -> usize {
        self.function().map_or(0, |f| f.n_out())
    }
}

/// Entries of a matrix in the order they were asked for.
#[derive(Default)]
struct Entries {
    rows: Vec<usize>,
    cols: Vec<usize>,
}

impl Entries {
    fn add(&mut self, row: usize, col: usize) {
        self.rows.push(row);
        self.cols.push(col);
    }

    fn add_sym(&mut self, a: usize, b: usize) {
        self.add(a.min(b), a.max(b));
    }
}

impl Whole {
    /// None where `f` has second derivatives in the weights.
    pub(super) fn new(f: &SharedFunction, system: &System, widths: &Widths) -> Option<Whole> {
        let dims = system.dims();
        let (nx, n_weights) = (dims.x, f.dims().x - dims.x);
        let is_weight = |c: usize| (nx..nx + n_weights).contains(&c);
        let outer = |c: usize| if c < nx { c } else { c - n_weights };
        let (mut switches, mut of_weight, mut width) = (Vec::new(), Vec::new(), 0);
        for (k, s) in system.subsystems().iter().enumerate() {
            let v = s.regions.function();
            let by =
                (s.n_modes > 1).then(|| Weights { regions: s.regions.clone(), widths: widths.clone(), first: width });
            width += by.as_ref().map_or(0, |_| v.n_out());
            let cols = by.as_ref().map_or_else(Vec::new, |_| columns(v.jac_pattern()));
            let first = of_weight.len();
            of_weight.resize(first + s.n_modes, k);
            switches.push(Switch { by, n_modes: s.n_modes, first, cols, psi_hess: Vec::new(), pairs: Vec::new() });
        }
        let behind = |c: usize| switches[of_weight[c - nx]].cols.iter().copied();
        let (mut plain, mut chain) = (Entries::default(), Entries::default());
        let p = f.jac_pattern();
        for c in 0..p.n_cols() {
            for &r in p.rows(c) {
                match is_weight(c) {
                    true => behind(c).for_each(|b| chain.add(r, b)),
                    false => plain.add(r, outer(c)),
                }
            }
        }
        let (jac, plain_jac, chain_jac) = joined(f.n_out(), dims.n_in(), plain, chain);
        let (mut plain, mut chain) = (Entries::default(), Entries::default());
        let p = f.hess_pattern();
        for c in 0..p.n_cols() {
            for &r in p.rows(c) {
                match (is_weight(r), is_weight(c)) {
                    (true, true) => return None,
                    (true, false) => behind(r).for_each(|b| chain.add_sym(outer(c), b)),
                    (false, true) => behind(c).for_each(|b| chain.add_sym(outer(r), b)),
                    (false, false) => plain.add_sym(outer(r), outer(c)),
                }
            }
        }
        let n_chain = chain.rows.len();
        for s in &switches {
            let Some(v) = s.function() else { continue };
            let p = v.hess_pattern();
            (0..p.n_cols()).for_each(|c| p.rows(c).iter().for_each(|&r| chain.add(r, c)));
            s.cols.iter().enumerate().for_each(|(k, &a)| s.cols[k..].iter().for_each(|&b| chain.add_sym(a, b)));
        }
        let (hess, plain_hess, mut chain_hess) = joined(dims.n_in(), dims.n_in(), plain, chain);
        let mut rest = chain_hess.split_off(n_chain).into_iter();
        for s in &mut switches {
            let n = s.function().map_or(0, |v| v.hess_pattern().nnz());
            s.psi_hess = rest.by_ref().take(n).collect();
            s.pairs = rest.by_ref().take(s.cols.len() * (s.cols.len() + 1) / 2).collect();
        }
        let mut at = 0;
        let begin = |&k: &usize| {
            at += switches[k].cols.len();
            (k, at - switches[k].cols.len())
        };
        let slopes = of_weight.iter().map(begin).collect();
        Some(Whole { f: f.clone(), dims, switches, jac, hess, plain_jac, chain_jac, plain_hess, chain_hess, slopes })
    }

    fn n_weights(&self) -> usize {
        self.f.dims().x - self.dims.x
    }

    /// Lengths of the parts of the workspace: inputs of `f`, derivatives of weights with respect to the columns behind them, Jacobian and
    /// Hessian of `f`, values of switching functions, and weights with their derivatives with respect to them, sums over weights, entries
    /// and rows of derivatives of switching functions, and the workspace of functions.
    fn parts(&self) -> [usize; 9] {
        let most = |of: &dyn Fn(&Switch) -> usize| self.switches.iter().map(of).max().unwrap_or(0);
        let derivatives = |s: &Switch| s.function().map_or(0, |v| v.jac_pattern().nnz().max(v.hess_pattern().nnz()));
        [
            self.f.dims().n_in(),
            self.switches.iter().map(|s| s.n_modes * s.cols.len()).sum(),
            self.f.jac_pattern().nnz(),
            self.f.hess_pattern().nnz(),
            most(&|s| s.n_psi() * (1 + s.n_modes + s.n_modes * s.n_psi()) + s.n_modes),
            most(&|s| s.n_psi() * (1 + s.n_psi())),
            most(&derivatives),
            most(&|s| s.n_psi() * s.cols.len()),
            most(&|s| s.function().map_or(0, |v| v.work_len())).max(self.f.work_len()),
        ]
    }

    fn split<'a>(&self, mut work: &'a mut [f64]) -> [&'a mut [f64]; 9] {
        self.parts().map(|n| {
            let (a, b) = std::mem::take(&mut work).split_at_mut(n);
            work = b;
            a
        })
    }

    /// Puts the point and the weights there into `inputs`, and the derivatives of the weights with respect to the columns behind them
    /// into `slopes`, subsystem by subsystem and weight by weight, where it has room.
    #[allow(clippy::too_many_arguments)]
    fn place(
        &self,
        at: &Point,
        inputs: &mut [f64],
        slopes: &mut [f64],
        psi: &mut [f64],
        entries: &mut [f64],
        gradient: &mut [f64],
        work: &mut [f64],
    ) -> EvalResult {
        let (nx, n_weights) = (self.dims.x, self.n_weights());
        inputs[..nx].copy_from_slice(at.x);
        let rest = at.u.iter().chain(at.p).chain(std::iter::once(&at.t));
        inputs[nx + n_weights..].iter_mut().zip(rest).for_each(|(to, v)| *to = *v);
        let mut slope = 0;
        for s in &self.switches {
            let (Some(by), Some(v)) = (&s.by, s.function()) else {
                inputs[nx + s.first..nx + s.first + s.n_modes].fill(1.0);
                continue;
            };
            let (n, n_cols) = (v.n_out(), s.cols.len());
            let (values, rest) = psi.split_at_mut(n);
            let (theta, rest) = rest.split_at_mut(s.n_modes);
            let d = &mut rest[..s.n_modes * n];
            v.value(at, values, work)?;
            by.weights(values, theta, d, &mut []);
            inputs[nx + s.first..nx + s.first + s.n_modes].copy_from_slice(&theta[..s.n_modes]);
            if slopes.is_empty() {
                continue;
            }
            v.jacobian(at, entries, work)?;
            let g = &mut gradient[..n * n_cols];
            gradients(v.jac_pattern(), entries, &s.cols, g);
            for i in 0..s.n_modes {
                for c in 0..n_cols {
                    slopes[slope] = (0..n).map(|j| d[i * n + j] * g[j * n_cols + c]).sum();
                    slope += 1;
                }
            }
        }
        Ok(())
    }

    /// The inputs as a point of `f`.
    fn point<'a>(&self, inputs: &'a [f64]) -> Point<'a> {
        let d = self.f.dims();
        let (x, rest) = inputs.split_at(d.x);
        let (u, rest) = rest.split_at(d.u);
        Point { t: rest[d.p], x, u, p: &rest[..d.p] }
    }

    /// The subsystem of a weight, and where its slopes are.
    fn slope_of(&self, weight: usize) -> (&Switch, Range<usize>) {
        let (k, at) = self.slopes[weight];
        let s = &self.switches[k];
        (s, at..at + s.cols.len())
    }

    /// Second derivatives of the weights of a subsystem, `along[i]` times those of weight `i`.
    #[allow(clippy::too_many_arguments)]
    fn curvature(
        &self,
        s: &Switch,
        at: &Point,
        along: &[f64],
        out: &mut [f64],
        psi: &mut [f64],
        sums: &mut [f64],
        entries: &mut [f64],
        gradient: &mut [f64],
        work: &mut [f64],
    ) -> EvalResult {
        let (Some(by), Some(v)) = (&s.by, s.function()) else { return Ok(()) };
        let (n, n_cols) = (v.n_out(), s.cols.len());
        let (values, rest) = psi.split_at_mut(n);
        let (theta, rest) = rest.split_at_mut(s.n_modes);
        let (d, rest) = rest.split_at_mut(s.n_modes * n);
        let dd = &mut rest[..s.n_modes * n * n];
        v.value(at, values, work)?;
        let (y, b) = sums.split_at_mut(n);
        let b = &mut b[..n * n];
        by.weights(values, theta, d, dd);
        for (j, y) in y.iter_mut().enumerate() {
            *y = along.iter().enumerate().map(|(i, a)| a * d[i * n + j]).sum();
        }
        v.jacobian(at, entries, work)?;
        let g = &mut gradient[..n * n_cols];
        gradients(v.jac_pattern(), entries, &s.cols, g);
        if !s.psi_hess.is_empty() {
            let h = &mut entries[..s.psi_hess.len()];
            v.hessian(at, y, h, work)?;
            s.psi_hess.iter().zip(&*h).for_each(|(&k, v)| out[k] += v);
        }
        b.fill(0.0);
        for (a, d) in along.iter().zip(dd.chunks_exact(n * n)) {
            b.iter_mut().zip(d).for_each(|(b, d)| *b += a * d);
        }
        let mut pairs = s.pairs.iter();
        for p in 0..n_cols {
            for q in p..n_cols {
                let of = |j: usize| g[j * n_cols + p] * (0..n).map(|k| b[j * n + k] * g[k * n_cols + q]).sum::<f64>();
                let value: f64 = (0..n).map(of).sum();
                if let Some(&k) = pairs.next() {
                    out[k] += value;
                }
            }
        }
        Ok(())
    }
}

/// The pattern of two lists of entries, and the places of either.
fn joined(n_rows: usize, n_cols: usize, a: Entries, b: Entries) -> (Pattern, Vec<usize>, Vec<usize>) {
    let n = a.rows.len();
    let (rows, cols) = ([a.rows, b.rows].concat(), [a.cols, b.cols].concat());
    let (p, mut map) = Pattern::from_triplets(n_rows, n_cols, &rows, &cols);
    let rest = map.split_off(n);
    (p, map, rest)
}

impl Function for Whole {
    fn name(&self) -> &str {
        self.f.name()
    }
    fn dims(&self) -> Dims {
        self.dims
    }
    fn n_out(&self) -> usize {
        self.dims.x
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn work_len(&self) -> usize {
        self.parts().iter().sum()
    }
    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let [inputs, _, _, _, psi, _, entries, gradient, work] = self.split(work);
        self.place(at, inputs, &mut [], psi, entries, gradient, work)?;
        self.f.value(&self.point(inputs), out, work)
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let [inputs, slopes, jac, _, psi, _, entries, gradient, work] = self.split(work);
        self.place(at, inputs, slopes, psi, entries, gradient, work)?;
        self.f.jacobian(&self.point(inputs), jac, work)?;
        out.fill(0.0);
        let (p, weights) = (self.f.jac_pattern(), self.dims.x..self.dims.x + self.n_weights());
        let (mut plain, mut chain) = (self.plain_jac.iter(), self.chain_jac.iter());
        for c in 0..p.n_cols() {
            let own = weights.contains(&c).then(|| self.slope_of(c - self.dims.x).1);
            for v in &jac[p.range(c)] {
                match &own {
                    Some(r) => slopes[r.clone()].iter().zip(chain.by_ref()).for_each(|(s, &k)| out[k] += v * s),
                    None => plain.next().into_iter().for_each(|&k| out[k] += v),
                }
            }
        }
        Ok(())
    }
    fn hessian(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let [inputs, slopes, jac, hess, psi, sums, entries, gradient, work] = self.split(work);
        self.place(at, inputs, slopes, psi, entries, gradient, work)?;
        self.f.hessian(&self.point(inputs), weights, hess, work)?;
        self.f.jacobian(&self.point(inputs), jac, work)?;
        out.fill(0.0);
        let nx = self.dims.x;
        let (p, columns) = (self.f.hess_pattern(), nx..nx + self.n_weights());
        let outer = |c: usize| if c < nx { c } else { c - self.n_weights() };
        let (mut plain, mut chain) = (self.plain_hess.iter(), self.chain_hess.iter());
        for c in 0..p.n_cols() {
            for (&r, v) in p.rows(c).iter().zip(&hess[p.range(c)]) {
                let (weight, other) = match (columns.contains(&r), columns.contains(&c)) {
                    (true, _) => (r, outer(c)),
                    (_, true) => (c, outer(r)),
                    _ => {
                        plain.next().into_iter().for_each(|&k| out[k] += v);
                        continue;
                    }
                };
                let (s, range) = self.slope_of(weight - nx);
                for ((&col, slope), &k) in s.cols.iter().zip(&slopes[range]).zip(chain.by_ref()) {
                    // both halves of the symmetric matrix fall on the diagonal
                    out[k] += if col == other { 2.0 } else { 1.0 } * v * slope;
                }
            }
        }
        // what the weights of the modes weigh, in the place of the inputs that are not needed any more
        let p = self.f.jac_pattern();
        for c in columns {
            inputs[c] = p.rows(c).iter().zip(&jac[p.range(c)]).map(|(&r, v)| weights[r] * v).sum();
        }
        for s in &self.switches {
            let along = &inputs[nx + s.first..nx + s.first + s.n_modes];
            self.curvature(s, at, along, out, psi, sums, entries, gradient, work)?;
        }
        Ok(())
    }
    fn is_serial(&self) -> bool {
        self.f.is_serial() || self.switches.iter().filter_map(Switch::function).any(|v| v.is_serial())
    }
    fn jacobian_is_approximate(&self) -> bool {
        let own = |s: &Switch| s.function().is_some_and(|v| v.jacobian_is_approximate());
        self.f.jacobian_is_approximate() || self.switches.iter().any(own)
    }
    fn hessian_is_approximate(&self) -> bool {
        let own = |s: &Switch| s.function().is_some_and(|v| v.hessian_is_approximate());
        self.f.hessian_is_approximate() || self.switches.iter().any(own)
    }
}
