//! Smoothed systems: the weights of the modes are smooth functions of the switching functions.
//!
//! With `s(v) = 1 / (1 + exp(−2 v/w))` the weight of a mode with the signs `S_i` is `Π_j s(S_ij ψ_j)`, the product over
//! the signs that matter; with Stewart's indicators it is `exp(−2 g_i/w) / Σ_k exp(−2 g_k/w)`. The weights are positive
//! and sum to one where the regions cover the state space. As the width `w` goes to zero they become those of the
//! Filippov system away from its surfaces, and the solutions those of the system (section 6.1 of the thesis says what
//! that costs: the fields become stiff, and their derivatives are those of the system only in the limit). What is wanted
//! of them here is a start: optima of wide systems are few, and lead to good ones of the system.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::Arc;

use super::smoothed_whole::Whole;
use super::{Regions, SharedFunction, Subsystem, System};
use crate::error::{Error, Result};
use crate::func::{Dims, EvalResult, Function, Point};
use crate::linalg::csc::Pattern;

/// Widths of all switching functions of a smoothed system, or indicators, in the order of the subsystems. They may be
/// changed between evaluations, through any copy of the handle.
#[derive(Debug, Clone)]
pub struct Widths(Arc<Vec<AtomicU64>>);

impl Widths {
    fn new(n: usize) -> Widths {
        Widths(Arc::new((0..n).map(|_| AtomicU64::new(1f64.to_bits())).collect()))
    }

    /// Number of switching functions and indicators.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// True where nothing switches.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Sets the width of function `k`: positive, in the units of that function.
    pub fn set(&self, k: usize, width: f64) {
        self.0[k].store(width.to_bits(), Ordering::Relaxed);
    }

    fn get(&self, k: usize) -> f64 {
        f64::from_bits(self.0[k].load(Ordering::Relaxed))
    }
}

impl System {
    /// The switching functions or indicators of every subsystem that switches: one width in [`Widths`] for every output.
    pub fn switching_functions(&self) -> Vec<SharedFunction> {
        self.subsystems.iter().filter(|s| s.n_modes > 1).map(|s| s.regions.function().clone()).collect()
    }

    /// The system with smooth weights, which has no modes, and their widths, 1 at first. Systems with inclusions,
    /// transitions or contacts have none.
    pub fn smoothed(&self) -> Result<(System, Widths)> {
        if !self.inclusions.is_empty() || !self.transitions.is_empty() || self.mechanics.is_some() {
            return Err(Error::Unsupported("systems with inclusions, transitions or contacts are not smoothed".into()));
        }
        let widths = Widths::new(self.switching_functions().iter().map(|f| f.n_out()).sum());
        if let Some(whole) = self.combined.as_ref().and_then(|f| Whole::new(f, self, &widths)) {
            let mut out = System::new(self.dims.x, self.dims.u, self.dims.p)?;
            out.set_f0(Arc::new(whole))?;
            return Ok((out, widths));
        }
        let mut first = 0;
        let mut out = self.clone();
        out.combined = None;
        for s in out.subsystems.iter_mut().filter(|s| s.n_modes > 1) {
            let n = s.regions.function().n_out();
            let blend: SharedFunction = Arc::new(Blend::new(s, widths.clone(), first));
            first += n;
            // one mode everywhere
            let regions = Regions::Signs { psi: s.regions.function().clone(), signs: vec![0; n] };
            *s = Subsystem { rows: std::mem::take(&mut s.rows), modes: blend, n_modes: 1, regions };
        }
        Ok((out, widths))
    }
}

impl Regions {
    pub(super) fn function(&self) -> &SharedFunction {
        match self {
            Regions::Signs { psi, .. } => psi,
            Regions::Indicators(g) => g,
        }
    }
}

/// Smooth weights of the modes of a subsystem as functions of its switching functions.
pub(super) struct Weights {
    pub(super) regions: Regions,
    pub(super) widths: Widths,
    /// Place of its widths.
    pub(super) first: usize,
}

impl Weights {
    /// Weights `θ_i`, their derivatives `d[i, j]` and, where there is room, second derivatives `dd[i, j, k]` with respect to
    /// the switching functions, whose values are `v`.
    pub(super) fn weights(&self, v: &[f64], theta: &mut [f64], d: &mut [f64], dd: &mut [f64]) {
        let n = v.len();
        d.fill(0.0);
        dd.fill(0.0);
        let slope = |j: usize| 2.0 / self.widths.get(self.first + j);
        match &self.regions {
            Regions::Signs { signs, .. } => {
                for (i, row) in signs.chunks_exact(n).enumerate() {
                    // factor, its first and second derivative
                    let factor = |j: usize| -> [f64; 3] {
                        let k = slope(j) * f64::from(row[j]);
                        let s = 1.0 / (1.0 + (-k * v[j]).exp());
                        let ds = s * (1.0 - s);
                        [s, k * ds, k * k * ds * (1.0 - 2.0 * s)]
                    };
                    let matters = |j: &usize| row[*j] != 0;
                    let product = |skip: [usize; 2]| -> f64 {
                        (0..n).filter(matters).filter(|j| !skip.contains(j)).map(|j| factor(j)[0]).product()
                    };
                    theta[i] = product([n, n]);
                    for j in (0..n).filter(matters) {
                        let [_, dj, ddj] = factor(j);
                        let rest = product([j, n]);
                        d[i * n + j] = dj * rest;
                        if !dd.is_empty() {
                            dd[(i * n + j) * n + j] = ddj * rest;
                            for k in (0..j).filter(matters) {
                                let value = dj * factor(k)[1] * product([j, k]);
                                dd[(i * n + j) * n + k] = value;
                                dd[(i * n + k) * n + j] = value;
                            }
                        }
                    }
                }
            }
            Regions::Indicators(_) => {
                // the widths of indicators that are compared are one
                let k = (0..n).map(slope).fold(f64::INFINITY, f64::min);
                let least = v.iter().copied().fold(f64::INFINITY, f64::min);
                theta.iter_mut().zip(v).for_each(|(t, v)| *t = (-k * (v - least)).exp());
                let sum: f64 = theta.iter().sum();
                theta.iter_mut().for_each(|t| *t /= sum);
                let unit = |i: usize, j: usize| f64::from(u8::from(i == j));
                for i in 0..n {
                    for j in 0..n {
                        d[i * n + j] = -k * theta[i] * (unit(i, j) - theta[j]);
                        for l in 0..if dd.is_empty() { 0 } else { n } {
                            let both = (unit(i, j) - theta[j]) * (unit(i, l) - theta[l]);
                            dd[(i * n + j) * n + l] = k * k * theta[i] * (both - theta[j] * (unit(j, l) - theta[l]));
                        }
                    }
                }
            }
        }
    }
}

/// `Σ_i θ_i(v(x)) F_i(x)` of a subsystem.
struct Blend {
    modes: SharedFunction,
    by: Weights,
    n_rows: usize,
    n_modes: usize,
    jac: Pattern,
    hess: Pattern,
    /// Entry of the Jacobian behind every entry of that of the modes.
    modes_jac: Vec<usize>,
    /// Entries of the Jacobian for every row and every column of the switching functions.
    switch_jac: Vec<usize>,
    modes_hess: Vec<usize>,
    psi_hess: Vec<usize>,
    /// Columns of the modes and of the switching functions.
    cols_f: Vec<usize>,
    cols_v: Vec<usize>,
    /// Entries of the Hessian for every pair of them, and for every pair of columns of the switching functions.
    cross_hess: Vec<usize>,
    switch_hess: Vec<usize>,
}

/// Columns of a pattern that have entries.
pub(super) fn columns(p: &Pattern) -> Vec<usize> {
    (0..p.n_cols()).filter(|&j| !p.rows(j).is_empty()).collect()
}

impl Blend {
    fn new(s: &Subsystem, widths: Widths, first: usize) -> Blend {
        let (f, v) = (&s.modes, s.regions.function());
        let (n_rows, n_in) = (s.rows.len(), f.dims().n_in());
        let (cols_f, cols_v) = (columns(f.jac_pattern()), columns(v.jac_pattern()));
        let (mut r, mut c) = (Vec::new(), Vec::new());
        for j in 0..n_in {
            for &i in f.jac_pattern().rows(j) {
                r.push(i % n_rows);
                c.push(j);
            }
        }
        let n_f = r.len();
        for i in 0..n_rows {
            for &j in &cols_v {
                r.push(i);
                c.push(j);
            }
        }
        let (jac, map) = Pattern::from_triplets(n_rows, n_in, &r, &c);
        let (modes_jac, switch_jac) = (map[..n_f].to_vec(), map[n_f..].to_vec());
        let (mut r, mut c) = (Vec::new(), Vec::new());
        let mut add = |i: usize, j: usize| {
            r.push(i.min(j));
            c.push(i.max(j));
        };
        for p in [f.hess_pattern(), v.hess_pattern()] {
            (0..n_in).for_each(|j| p.rows(j).iter().for_each(|&i| add(i, j)));
        }
        cols_f.iter().for_each(|&i| cols_v.iter().for_each(|&j| add(i, j)));
        cols_v.iter().for_each(|&i| cols_v.iter().for_each(|&j| add(i, j)));
        let (hess, map) = Pattern::from_triplets(n_in, n_in, &r, &c);
        let (modes_hess, rest) = map.split_at(f.hess_pattern().nnz());
        let (psi_hess, rest) = rest.split_at(v.hess_pattern().nnz());
        let (cross_hess, switch_hess) = rest.split_at(cols_f.len() * cols_v.len());
        Blend {
            modes: f.clone(),
            by: Weights { regions: s.regions.clone(), widths, first },
            n_rows,
            n_modes: s.n_modes,
            jac,
            modes_jac,
            switch_jac,
            modes_hess: modes_hess.to_vec(),
            psi_hess: psi_hess.to_vec(),
            cross_hess: cross_hess.to_vec(),
            switch_hess: switch_hess.to_vec(),
            hess,
            cols_f,
            cols_v,
        }
    }

    fn switch(&self) -> &SharedFunction {
        self.by.regions.function()
    }

    /// Lengths of the parts of the workspace: values of the modes and the switching functions, weights with first and second
    /// derivatives, Jacobians and Hessians of both, dense gradients, multipliers, and the workspace of the two.
    fn parts(&self) -> [usize; 12] {
        let (f, v) = (&self.modes, self.switch());
        let n = v.n_out();
        [
            f.n_out(),
            n,
            self.n_modes,
            self.n_modes * n,
            self.n_modes * n * n,
            f.jac_pattern().nnz(),
            v.jac_pattern().nnz(),
            f.hess_pattern().nnz().max(v.hess_pattern().nnz()),
            n * self.cols_f.len(),
            n * self.cols_v.len(),
            f.n_out().max(n) + n * n,
            f.work_len().max(v.work_len()),
        ]
    }

    fn split<'a>(&self, mut work: &'a mut [f64]) -> [&'a mut [f64]; 12] {
        self.parts().map(|n| {
            let (a, b) = std::mem::take(&mut work).split_at_mut(n);
            work = b;
            a
        })
    }
}

impl Function for Blend {
    fn name(&self) -> &str {
        self.modes.name()
    }
    fn dims(&self) -> Dims {
        self.modes.dims()
    }
    fn n_out(&self) -> usize {
        self.n_rows
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
        let [f, v, theta, d, .., work] = self.split(work);
        self.switch().value(at, v, work)?;
        self.modes.value(at, f, work)?;
        self.by.weights(v, theta, d, &mut []);
        out.fill(0.0);
        for (column, t) in f.chunks_exact(self.n_rows).zip(&*theta) {
            out.iter_mut().zip(column).for_each(|(o, f)| *o += t * f);
        }
        Ok(())
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let [f, v, theta, d, _, jf, jv, _, _, gv, _, work] = self.split(work);
        self.switch().value(at, v, work)?;
        self.modes.value(at, f, work)?;
        self.modes.jacobian(at, jf, work)?;
        self.switch().jacobian(at, jv, work)?;
        self.by.weights(v, theta, d, &mut []);
        out.fill(0.0);
        let p = self.modes.jac_pattern();
        for (&row, (&k, value)) in p.row_idx().iter().zip(self.modes_jac.iter().zip(&*jf)) {
            out[k] += theta[row / self.n_rows] * value;
        }
        let (n, n_v) = (v.len(), self.cols_v.len());
        gradients(self.switch().jac_pattern(), jv, &self.cols_v, gv);
        for r in 0..self.n_rows {
            for j in 0..n {
                let slope: f64 = (0..self.n_modes).map(|i| f[i * self.n_rows + r] * d[i * n + j]).sum();
                for (&k, g) in self.switch_jac[r * n_v..(r + 1) * n_v].iter().zip(&gv[j * n_v..(j + 1) * n_v]) {
                    out[k] += slope * g;
                }
            }
        }
        Ok(())
    }
    fn hessian(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let [f, v, theta, d, dd, jf, jv, h, gf, gv, y, work] = self.split(work);
        self.switch().value(at, v, work)?;
        self.modes.value(at, f, work)?;
        self.modes.jacobian(at, jf, work)?;
        self.switch().jacobian(at, jv, work)?;
        self.by.weights(v, theta, d, dd);
        out.fill(0.0);
        let (n, n_f, n_v) = (v.len(), self.cols_f.len(), self.cols_v.len());
        let (y, b) = y.split_at_mut(y.len() - n * n);
        // second derivatives of the modes
        let h_f = &mut h[..self.modes_hess.len()];
        if !h_f.is_empty() {
            for (k, y) in y[..f.len()].iter_mut().enumerate() {
                *y = weights[k % self.n_rows] * theta[k / self.n_rows];
            }
            self.modes.hessian(at, &y[..f.len()], h_f, work)?;
            self.modes_hess.iter().zip(&*h_f).for_each(|(&k, v)| out[k] += v);
        }
        // those of the switching functions
        let along = |i: usize| -> f64 {
            let column = &f[i * self.n_rows..(i + 1) * self.n_rows];
            column.iter().zip(weights).map(|(f, w)| f * w).sum()
        };
        let h_v = &mut h[..self.psi_hess.len()];
        if !h_v.is_empty() {
            for (j, y) in y[..n].iter_mut().enumerate() {
                *y = (0..self.n_modes).map(|i| along(i) * d[i * n + j]).sum();
            }
            self.switch().hessian(at, &y[..n], h_v, work)?;
            self.psi_hess.iter().zip(&*h_v).for_each(|(&k, v)| out[k] += v);
        }
        // products of first derivatives
        gradients(self.switch().jac_pattern(), jv, &self.cols_v, gv);
        gf.fill(0.0);
        let p = self.modes.jac_pattern();
        for (c, &col) in self.cols_f.iter().enumerate() {
            for (&row, value) in p.rows(col).iter().zip(&jf[p.range(col)]) {
                for j in 0..n {
                    gf[j * n_f + c] += d[row / self.n_rows * n + j] * weights[row % self.n_rows] * value;
                }
            }
        }
        for (a, &col_a) in self.cols_f.iter().enumerate() {
            for (b, &col_b) in self.cols_v.iter().enumerate() {
                let value: f64 = (0..n).map(|j| gf[j * n_f + a] * gv[j * n_v + b]).sum();
                out[self.cross_hess[a * n_v + b]] += if col_a == col_b { 2.0 * value } else { value };
            }
        }
        b.fill(0.0);
        for i in 0..self.n_modes {
            let c = along(i);
            b.iter_mut().zip(&dd[i * n * n..(i + 1) * n * n]).for_each(|(b, d)| *b += c * d);
        }
        for p in 0..n_v {
            for q in p..n_v {
                let mut value = 0.0;
                for j in 0..n {
                    value += gv[j * n_v + p] * (0..n).map(|k| b[j * n + k] * gv[k * n_v + q]).sum::<f64>();
                }
                out[self.switch_hess[p * n_v + q]] += value;
            }
        }
        Ok(())
    }
    fn is_serial(&self) -> bool {
        self.modes.is_serial() || self.switch().is_serial()
    }
    fn jacobian_is_approximate(&self) -> bool {
        self.modes.jacobian_is_approximate() || self.switch().jacobian_is_approximate()
    }
    fn hessian_is_approximate(&self) -> bool {
        self.modes.hessian_is_approximate() || self.switch().hessian_is_approximate()
    }
}

/// Dense rows of a Jacobian in the columns that have entries.
pub(super) fn gradients(p: &Pattern, values: &[f64], cols: &[usize], out: &mut [f64]) {
    out.fill(0.0);
    for (c, &col) in cols.iter().enumerate() {
        for (&row, v) in p.rows(col).iter().zip(&values[p.range(col)]) {
            out[row * cols.len() + c] = *v;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::func::{check_derivatives, Callback, CheckSettings};

    fn function(name: &str, n: usize, f: fn(&Point, &mut [f64])) -> SharedFunction {
        let d = Dims { x: 3, u: 1, p: 0 };
        let f = Callback::new(name, d, n, move |at, out| {
            f(at, out);
            0
        });
        Arc::new(f)
    }

    fn system(regions: Regions, n_modes: usize) -> System {
        let modes = function("F", 2 * n_modes, |at, out| {
            for (k, o) in out.iter_mut().enumerate() {
                *o = (1.0 + k as f64) * at.x[0] * at.u[0] + (at.x[1] + k as f64).sin() * at.x[2];
            }
        });
        let mut s = System::new(3, 1, 0).unwrap();
        s.add_subsystem(Subsystem { rows: vec![0, 2], modes, n_modes, regions }).unwrap();
        s
    }

    fn psi() -> SharedFunction {
        function("psi", 2, |at, out| {
            out[0] = at.x[0] * at.x[1] - 0.1;
            out[1] = at.x[1] - at.x[2].powi(2);
        })
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        let full = Regions::Signs { psi: psi(), signs: vec![1, 1, 1, -1, -1, 1, -1, -1] };
        let some = Regions::Signs { psi: psi(), signs: vec![1, 0, -1, 1, -1, -1] };
        let g = Regions::Indicators(function("g", 3, |at, out| {
            out.copy_from_slice(&[at.x[0] * at.x[2], at.x[1] - 0.2 * at.x[0].sin(), 0.3 - at.x[2]]);
        }));
        for (regions, n) in [(full, 4), (some, 3), (g, 3)] {
            let (smooth, widths) = system(regions, n).smoothed().unwrap();
            (0..widths.len()).for_each(|k| widths.set(k, 0.7));
            let f = &smooth.subsystems()[0].modes;
            let at = Point { t: 0.0, x: &[0.4, 0.3, -0.5], u: &[0.7], p: &[] };
            let r = check_derivatives(&**f, &at, &CheckSettings::default()).unwrap();
            assert!(r.mismatches.is_empty(), "{:?}", r.mismatches);
        }
    }

    #[test]
    fn narrow_weights_choose_the_mode_of_the_region() {
        let signs = vec![1, 0, -1, 1, -1, -1];
        let s = system(Regions::Signs { psi: psi(), signs }, 3);
        let (smooth, widths) = s.smoothed().unwrap();
        (0..2).for_each(|k| widths.set(k, 1e-3));
        let (f, all) = (&smooth.subsystems()[0].modes, &s.subsystems()[0].modes);
        for (x, mode) in [([1.0, 1.0, 0.0], 0), ([-1.0, 1.0, 0.0], 1), ([-1.0, 1.0, 2.0], 2)] {
            let at = Point { t: 0.0, x: &x, u: &[0.5], p: &[] };
            let (mut out, mut modes) = ([0.0; 2], [0.0; 6]);
            f.value(&at, &mut out, &mut vec![0.0; f.work_len()]).unwrap();
            all.value(&at, &mut modes, &mut vec![0.0; all.work_len()]).unwrap();
            assert_eq!(out, modes[2 * mode..2 * mode + 2], "{x:?}");
        }
    }
}
