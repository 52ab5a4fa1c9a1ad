//! A problem with complementarity constraints as a nonlinear program: what stands for the pairs as additional rows,
//! terms of the objective and variables.

use super::problem::Mpcc;
use super::relaxation::{Elastic, Jet, Seen, SigmaIn, Softness, Strategy};
use super::scaling::{AtPoint, Scaling};
use crate::func::{EvalError, EvalResult};
use crate::linalg::csc::Pattern;
use crate::nlp::{Bilinear, Bounds, Nlp, Residuals};
use std::ops::Range;

/// Upper bound of elastic variables.
const ELASTIC_MAX: f64 = 10.0;

/// Structure of the relaxed problem. Variables: those of the problem, then the elastic ones. Rows: the ordinary
/// ones, then every kind of row of the strategy for all pairs (the products, free, where it has none that is a product:
/// the interior-point solver finds the pairs by them), then the ordinary ones once more where these are relaxed.
pub(super) struct Structure {
    strategy: &'static dyn Strategy,
    /// Variables of the problem.
    pub n: usize,
    /// Ordinary rows.
    pub m: usize,
    n_all: usize,
    m_all: usize,
    jac: Pattern,
    jac_map: Vec<usize>,
    /// Second copy of the ordinary rows, then what their elastic variable has in both.
    copy_map: Vec<usize>,
    elastic_map: Vec<usize>,
    places: Vec<Place>,
    hess: Pattern,
    hess_map: Vec<usize>,
    /// Positions of the second derivatives `aa`, `ab`, `bb` of every pair.
    hess_pair: Vec<[usize; 3]>,
    pub bilinear: Vec<Bilinear>,
    pub scaling: Scaling,
    inner_jac: Vec<f64>,
    inner_hess: Vec<f64>,
    weighted: Vec<f64>,
    /// Room for a point in the units of the problem.
    user: Vec<f64>,
    soft: Softness,
    /// Parameters of the pairs, where the strategy has such.
    own: Vec<[f64; 3]>,
    /// What decides about these, of the last iteration.
    seen: Vec<Seen>,
    has_seen: bool,
    /// The bounds are those of a branch problem: nothing stands for the pairs.
    branch: bool,
    /// Something has stood for the pairs since the last reset, and multipliers may be those of the relaxed problem.
    relaxes: bool,
}

/// A row of a pair: its number, and where its derivatives in `a`, `b` and the elastic variable are.
struct Place {
    row: usize,
    a: usize,
    b: usize,
    elastic: Option<(usize, usize)>,
}

impl Structure {
    pub fn new(p: &dyn Mpcc, strategy: &'static dyn Strategy) -> Structure {
        let (n, m, np) = (p.n(), p.m(), p.pairs().len());
        let relaxes_rows = strategy.relaxes_rows() && np > 0;
        let n_elastic = match strategy.elastic() {
            Elastic::None => 0,
            Elastic::Common => np.min(1),
            Elastic::Each => np,
        };
        let kinds = strategy.rows();
        let n_lumps = if p.n_groups() < np { p.n_groups() } else { np.min(1) };
        let lump = |k: usize| if n_lumps == 1 { 0 } else { p.group(k) };
        let first = if strategy.lumped() { n_lumps } else { np };
        let row_of = |i: usize, k: usize| match i {
            0 if strategy.lumped() => m + lump(k),
            0 => m + k,
            _ => m + first + (i - 1) * np + k,
        };
        let product = kinds.iter().position(|r| r.product);
        let m_own = if kinds.is_empty() { 0 } else { first + (kinds.len() - 1) * np };
        let products = m + m_own;
        let m_pairs = products + if product.is_none() { np } else { 0 };
        let m_all = m_pairs + if relaxes_rows { m } else { 0 };
        let n_all = n + n_elastic;

        let (mut rows, mut cols) = (Vec::new(), Vec::new());
        push_pattern(p.jac_pattern(), &mut rows, &mut cols);
        let nnz = rows.len();
        let elastic_of = |k: usize| if n_elastic > 1 { n + k } else { n };
        for (i, kind) in kinds.iter().enumerate() {
            for (k, &(a, b)) in p.pairs().iter().enumerate() {
                rows.extend([row_of(i, k); 2]);
                cols.extend([a, b]);
                if kind.elastic {
                    rows.push(row_of(i, k));
                    cols.push(elastic_of(k));
                }
            }
        }
        let after_pairs = rows.len();
        if relaxes_rows {
            for k in 0..nnz {
                rows.push(m_pairs + rows[k]);
                cols.push(cols[k]);
            }
            for i in 0..m {
                rows.extend([i, m_pairs + i]);
                cols.extend([n; 2]);
            }
        }
        let (jac, map) = Pattern::from_triplets(m_all, n_all, &rows, &cols);
        let mut at = nnz;
        let mut places = Vec::with_capacity(kinds.len() * np);
        for (i, kind) in kinds.iter().enumerate() {
            for k in 0..np {
                let elastic = kind.elastic.then(|| (elastic_of(k), map[at + 2]));
                places.push(Place { row: row_of(i, k), a: map[at], b: map[at + 1], elastic });
                at += if kind.elastic { 3 } else { 2 };
            }
        }
        let copies = if relaxes_rows { nnz } else { 0 };
        let (copy_map, elastic_map) = map[after_pairs..].split_at(copies);
        let (copy_map, elastic_map) = (copy_map.to_vec(), elastic_map.to_vec());
        let jac_map = map[..nnz].to_vec();

        rows.clear();
        cols.clear();
        push_pattern(p.hess_pattern(), &mut rows, &mut cols);
        let nnz = rows.len();
        for &(a, b) in p.pairs() {
            rows.push(a.min(b));
            cols.push(a.max(b));
            if strategy.curved() {
                rows.extend([a, b]);
                cols.extend([a, b]);
            }
        }
        let (hess, map) = Pattern::from_triplets(n_all, n_all, &rows, &cols);
        let step = if strategy.curved() { 3 } else { 1 };
        // without them the diagonal is never written
        let hess_pair = map[nnz..].chunks(step).map(|c| [c[step / 2], c[0], c[step - 1]]).collect();
        let row = |k| product.map_or(products + k, |i| row_of(i, k));
        let bilinear = p.pairs().iter().enumerate().map(|(k, &(a, b))| Bilinear { a, b, row: row(k) }).collect();
        let adapts = strategy.open(1.0).is_some();
        Structure {
            strategy,
            n,
            m,
            n_all,
            m_all,
            scaling: Scaling::new(n, m),
            inner_jac: vec![0.0; p.jac_pattern().nnz()],
            inner_hess: vec![0.0; nnz],
            weighted: vec![0.0; if relaxes_rows { m } else { 0 }],
            hess_map: map[..nnz].to_vec(),
            hess_pair,
            jac,
            jac_map,
            copy_map,
            elastic_map,
            places,
            hess,
            bilinear,
            user: vec![0.0; n],
            soft: Softness::default(),
            own: vec![[0.0; 3]; if adapts { np } else { 0 }],
            seen: vec![Seen::default(); if adapts { np } else { 0 }],
            has_seen: false,
            branch: false,
            relaxes: true,
        }
    }

    /// Variables and rows of the relaxed problem.
    pub fn size(&self) -> (usize, usize) {
        (self.n_all, self.m_all)
    }

    pub fn strategy(&self) -> &'static dyn Strategy {
        self.strategy
    }

    /// Rows whose upper bound is `σ`.
    pub fn sigma_rows(&self) -> Range<usize> {
        match (self.strategy.sigma_in(), self.strategy.lumped()) {
            (SigmaIn::Bound, false) => self.m..self.m + self.bilinear.len(),
            (SigmaIn::Bound, true) => self.m..self.m_all,
            _ => self.m..self.m,
        }
    }

    /// Forgets the relaxation of the last solve, and what was seen of its multipliers.
    pub fn reset(&mut self) {
        self.scaling.reset();
        self.soft = Softness::default();
        self.own.fill([0.0; 3]);
        self.seen.fill(Seen::default());
        self.has_seen = false;
        self.branch = true;
        self.relaxes = false;
    }

    /// Scales by the gradients at `x`; not at all where functions or gradients have no value. `rows[m]`, `grad[n]` are room.
    pub fn scale(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, x: &[f64], rows: &mut [f64], grad: &mut [f64]) {
        self.scaling.reset();
        // what is added outside of the polish is measured by the objective, and not the other way round
        p.set_polishing(true);
        // values first: gradients are those of the point whose values were computed last
        if p.eval(x, rows).is_ok() && p.derivatives(x, grad, &mut self.inner_jac).is_ok() {
            // where the gradient vanishes its change over the size of a variable says how steep the objective is
            let none = &self.scaling.none[..];
            let curved = self.scaling.is_curved() && p.hessian(x, 1.0, none, &mut self.inner_hess).is_ok();
            let hess = if curved { Some((p.hess_pattern(), &self.inner_hess[..])) } else { None };
            let at = AtPoint { grad, hess, x, jac: (p.jac_pattern(), &self.inner_jac), c: rows };
            self.scaling.choose(&at, bounds, p.lifts());
        }
        p.set_polishing(false);
        if self.scaling.is_by_sizes() {
            p.set_steepest(self.scaling.steepness() / self.scaling.objective);
        }
    }

    /// Bounds of the relaxed problem at `sigma`; where that is infinite, of a branch problem, in which nothing stands for
    /// the pairs.
    pub fn bounds(&mut self, inner: &Bounds, sigma: f64, out: &mut Bounds) {
        let Structure { n, m, .. } = *self;
        out.xl[..n].copy_from_slice(&inner.xl);
        out.xu[..n].copy_from_slice(&inner.xu);
        out.cl[..m].copy_from_slice(&inner.cl);
        out.cu[..m].copy_from_slice(&inner.cu);
        self.scaling.bounds(out);
        out.cl[m..].fill(f64::NEG_INFINITY);
        out.cu[m..].fill(f64::INFINITY);
        out.xl[n..].fill(0.0);
        self.branch = sigma == f64::INFINITY;
        if self.branch {
            out.xu[n..].fill(0.0);
            return;
        }
        out.xu[n..].fill(ELASTIC_MAX);
        self.relaxes = true;
        self.has_seen = false;
        self.soft = Softness::new(sigma);
        if let Some(open) = self.strategy.open(sigma) {
            self.own.fill(open);
        }
        // where one member is fixed at zero the pair asks for nothing, but most functions would ask the other one
        let by_functions = self.strategy.sigma_in() != SigmaIn::Bound;
        let void = |p: &Bilinear| by_functions && (inner.xu[p.a] == 0.0 || inner.xu[p.b] == 0.0);
        for (i, kind) in self.strategy.rows().iter().enumerate() {
            for k in (0..self.bilinear.len()).filter(|&k| !void(&self.bilinear[k])) {
                let row = self.places[i * self.bilinear.len() + k].row;
                (out.cl[row], out.cu[row]) = (kind.lower, kind.upper);
            }
        }
        for i in self.sigma_rows() {
            out.cu[i] = sigma;
        }
        let lower = self.strategy.lower(sigma);
        if lower < 0.0 {
            for p in self.bilinear.iter().filter(|p| !void(p)) {
                for j in [p.a, p.b] {
                    if out.xl[j] < out.xu[j] {
                        out.xl[j] = lower;
                    }
                }
            }
        }
        // c − s ≤ upper bound, c + s ≥ lower bound
        for i in 0..self.weighted.len() {
            let copy = self.m_all - self.m + i;
            out.cl[copy] = std::mem::replace(&mut out.cl[i], f64::NEG_INFINITY);
        }
    }

    /// Starting point from `x0[n]`.
    pub fn start(&self, x0: &[f64], out: &mut [f64]) {
        self.scaling.shrink(x0, &mut out[..self.n]);
        self.start_elastic(out);
    }

    /// Elastic variables as large as the products.
    pub fn start_elastic(&self, out: &mut [f64]) {
        let (x0, out) = out.split_at_mut(self.n);
        let products = self.bilinear.iter().map(|p| x0[p.a] * x0[p.b]);
        if self.n_all - self.n == self.bilinear.len() {
            for (s, v) in out.iter_mut().zip(products) {
                *s = v;
            }
        } else {
            out.fill(products.fold(0.0, f64::max));
        }
    }

    /// Function of a row of a pair; `i` numbers rows of pairs, kind by kind.
    fn jet(&self, i: usize, x: &[f64]) -> Jet {
        let np = self.bilinear.len();
        let (kind, k) = (i / np, i % np);
        let q = Softness { own: self.own.get(k).copied().unwrap_or_default(), ..self.soft };
        let p = &self.bilinear[k];
        self.strategy.jet(kind, x[p.a], x[p.b], &q)
    }

    fn weights(&self) -> (f64, f64) {
        if self.branch {
            (0.0, 0.0)
        } else {
            self.strategy.weights(self.soft.sigma)
        }
    }

    /// What the strategy adds to the objective.
    fn penalty(&self, x: &[f64]) -> f64 {
        let (products, elastic) = self.weights();
        let mut f = 0.0;
        if products != 0.0 {
            f += products * self.bilinear.iter().map(|p| x[p.a] * x[p.b]).sum::<f64>();
        }
        if elastic != 0.0 {
            f += elastic * x[self.n..].iter().sum::<f64>();
        }
        f
    }

    /// Objective of the problem out of that of the relaxed one.
    pub fn objective(&self, f: f64, x: &[f64]) -> f64 {
        (f - self.penalty(x)) / self.scaling.objective
    }

    /// Multipliers of the ordinary rows `y[m]`.
    pub fn row_multipliers(&self, relaxed: &[f64], y: &mut [f64]) {
        y.copy_from_slice(&relaxed[..self.m]);
        for (v, copy) in y.iter_mut().zip(&relaxed[self.m_all - self.weighted.len()..]) {
            *v += copy;
        }
    }

    /// Makes `z[n]`, the multipliers of the bounds in the relaxed problem, those of the MPCC: the chain rule brings the
    /// multipliers `y` of the rows and the penalties to the members, for Scholtes' relaxation as in (2.31).
    pub fn pull_back(&self, x: &[f64], y: &[f64], z: &mut [f64]) {
        if !self.relaxes {
            return;
        }
        let (products, _) = self.strategy.weights(self.soft.sigma);
        let np = self.bilinear.len();
        for (i, place) in self.places.iter().enumerate() {
            let (j, p) = (self.jet(i, x), &self.bilinear[i % np]);
            z[p.a] -= y[place.row] * j.d.0;
            z[p.b] -= y[place.row] * j.d.1;
        }
        if products != 0.0 {
            for p in &self.bilinear {
                z[p.a] -= products * x[p.b];
                z[p.b] -= products * x[p.a];
            }
        }
    }

    /// What the relaxed problem allows is a violation of the original one: negative members, elastic variables.
    pub fn complete(&self, x: &[f64], r: &mut Residuals) {
        if self.strategy.lower(1.0) < 0.0 {
            for p in &self.bilinear {
                r.primal = r.primal.max(-x[p.a]).max(-x[p.b]);
            }
        }
        r.primal = r.primal.max(self.row_slack(x));
    }

    /// Elastic variable of the ordinary rows.
    fn row_slack(&self, x: &[f64]) -> f64 {
        if self.weighted.is_empty() {
            0.0
        } else {
            x[self.n]
        }
    }

    /// Remembers what decides about the parameters of the pairs; `z` of members is zero unless they sit at a bound far
    /// from the pair.
    fn look(&mut self, x: &[f64], y: &[f64]) {
        let np = self.bilinear.len();
        for (s, p) in self.seen.iter_mut().zip(&self.bilinear) {
            *s = Seen { x: (x[p.a], x[p.b]), nu: (0.0, 0.0) };
        }
        for i in 0..self.places.len() {
            let (j, y) = (self.jet(i, x), y[self.places[i].row]);
            let nu = &mut self.seen[i % np].nu;
            nu.0 -= y * j.d.0;
            nu.1 -= y * j.d.1;
        }
        self.has_seen = true;
    }

    fn set_level(&mut self, sigma: f64) -> bool {
        if self.branch {
            return false;
        }
        let before = std::mem::replace(&mut self.soft, Softness::new(sigma));
        if self.has_seen {
            for (own, seen) in self.own.iter_mut().zip(&self.seen) {
                if sigma > before.sigma {
                    for v in own {
                        *v *= sigma / before.sigma;
                    }
                } else {
                    self.strategy.adapt(sigma, seen, own);
                }
            }
        }
        self.strategy.sigma_in() == SigmaIn::Functions
    }
}

fn push_pattern(p: &Pattern, rows: &mut Vec<usize>, cols: &mut Vec<usize>) {
    for j in 0..p.n_cols() {
        for &i in p.rows(j) {
            rows.push(i);
            cols.push(j);
        }
    }
}

/// A point in the units of the problem; `room` where these are others.
fn at<'a>(scaling: &Scaling, x: &'a [f64], room: &'a mut [f64]) -> &'a [f64] {
    if !scaling.sized {
        return x;
    }
    scaling.grow(x, room);
    room
}

/// The relaxed problem over the original one.
pub(super) struct Relaxed<'a> {
    pub inner: &'a mut dyn Mpcc,
    pub st: &'a mut Structure,
}

impl Nlp for Relaxed<'_> {
    fn n(&self) -> usize {
        self.st.size().0
    }
    fn m(&self) -> usize {
        self.st.size().1
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.st.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.st.hess
    }
    fn bilinear(&self) -> &[Bilinear] {
        &self.st.bilinear
    }
    fn objective_scale(&self) -> f64 {
        self.st.scaling.objective
    }
    fn elastic(&self, x: &[f64]) -> f64 {
        self.st.row_slack(x)
    }
    fn set_level(&mut self, sigma: f64, mu: f64) -> bool {
        let inner = self.inner.set_level(sigma, mu);
        self.st.set_level(sigma) || inner
    }
    fn eval(&mut self, x: &[f64], c: &mut [f64]) -> Result<f64, EvalError> {
        let st = &mut *self.st;
        let (n, m) = (st.n, st.m);
        let f = self.inner.eval(at(&st.scaling, &x[..n], &mut st.user), &mut c[..m])?;
        let f = st.scaling.value(f, &mut c[..m]);
        c[m..].fill(0.0);
        if st.branch {
            return Ok(f);
        }
        for (i, p) in st.places.iter().enumerate() {
            c[p.row] += st.jet(i, x).v;
            if let Some((s, _)) = p.elastic {
                c[p.row] -= x[s];
            }
        }
        for i in 0..st.weighted.len() {
            c[st.m_all - m + i] = c[i] + x[n];
            c[i] -= x[n];
        }
        Ok(f + st.penalty(x))
    }
    fn derivatives(&mut self, x: &[f64], grad: &mut [f64], jac: &mut [f64]) -> EvalResult {
        let st = &mut *self.st;
        let user = at(&st.scaling, &x[..st.n], &mut st.user);
        self.inner.derivatives(user, &mut grad[..st.n], &mut st.inner_jac)?;
        st.scaling.derivatives(&mut grad[..st.n], self.inner.jac_pattern(), &mut st.inner_jac);
        jac.fill(0.0);
        for (v, &k) in st.inner_jac.iter().zip(&st.jac_map) {
            jac[k] = *v;
        }
        let (products, elastic) = st.weights();
        grad[st.n..].fill(elastic);
        if st.branch {
            return Ok(());
        }
        for (i, p) in st.places.iter().enumerate() {
            let j = st.jet(i, x);
            jac[p.a] += j.d.0;
            jac[p.b] += j.d.1;
            if let Some((_, k)) = p.elastic {
                jac[k] = -1.0;
            }
        }
        for (v, &k) in st.inner_jac.iter().zip(&st.copy_map) {
            jac[k] = *v;
        }
        for k in st.elastic_map.chunks(2) {
            jac[k[0]] = -1.0;
            jac[k[1]] = 1.0;
        }
        if products != 0.0 {
            for p in &st.bilinear {
                grad[p.a] += products * x[p.b];
                grad[p.b] += products * x[p.a];
            }
        }
        Ok(())
    }
    fn hessian(&mut self, x: &[f64], w: f64, y: &[f64], hess: &mut [f64]) -> EvalResult {
        let st = &mut *self.st;
        let (n, m) = (st.n, st.m);
        for i in 0..st.weighted.len() {
            st.weighted[i] = y[i] + y[st.m_all - m + i];
        }
        let of_rows = if st.weighted.is_empty() { &y[..m] } else { &st.weighted };
        let user = at(&st.scaling, &x[..n], &mut st.user);
        let (weight, weights) = st.scaling.weights(w, of_rows);
        self.inner.hessian(user, weight, weights, &mut st.inner_hess)?;
        st.scaling.hessian(self.inner.hess_pattern(), &mut st.inner_hess);
        hess.fill(0.0);
        for (v, &k) in st.inner_hess.iter().zip(&st.hess_map) {
            hess[k] = *v;
        }
        if st.branch {
            return Ok(());
        }
        // w = 0 in the restoration phase, whose multipliers say nothing
        if !st.seen.is_empty() && w != 0.0 {
            st.look(x, y);
        }
        let np = st.bilinear.len();
        let curved = st.strategy.curved();
        for (i, p) in st.places.iter().enumerate() {
            let (j, y, at) = (st.jet(i, x), y[p.row], st.hess_pair[i % np]);
            hess[at[1]] += y * j.dd.1;
            if curved {
                hess[at[0]] += y * j.dd.0;
                hess[at[2]] += y * j.dd.2;
            }
        }
        let (products, _) = st.weights();
        if products != 0.0 {
            for at in &st.hess_pair {
                hess[at[1]] += w * products;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::relaxation::strategy;
    use super::*;
    use crate::settings::Relaxation;

    /// `f = x0² x1 + x2 x3`, rows `x0 x2`, `x1 + x3²`, pairs `(0, 1)`, `(2, 3)`, `(0, 3)`, in one group or three.
    struct Small {
        jac: Pattern,
        hess: Pattern,
        groups: usize,
    }

    impl Small {
        fn new(groups: usize) -> Small {
            let (jac, _) = Pattern::from_triplets(2, 4, &[0, 1, 0, 1], &[0, 1, 2, 3]);
            let (hess, _) = Pattern::from_triplets(4, 4, &[0, 0, 0, 2, 3], &[0, 1, 2, 3, 3]);
            Small { jac, hess, groups }
        }
    }

    impl Nlp for Small {
        fn n(&self) -> usize {
            4
        }
        fn m(&self) -> usize {
            2
        }
        fn jac_pattern(&self) -> &Pattern {
            &self.jac
        }
        fn hess_pattern(&self) -> &Pattern {
            &self.hess
        }
        fn eval(&mut self, x: &[f64], c: &mut [f64]) -> Result<f64, EvalError> {
            c.copy_from_slice(&[x[0] * x[2], x[1] + x[3] * x[3]]);
            Ok(x[0] * x[0] * x[1] + x[2] * x[3])
        }
        fn derivatives(&mut self, x: &[f64], grad: &mut [f64], jac: &mut [f64]) -> EvalResult {
            grad.copy_from_slice(&[2.0 * x[0] * x[1], x[0] * x[0], x[3], x[2]]);
            jac.copy_from_slice(&[x[2], 1.0, x[0], 2.0 * x[3]]);
            Ok(())
        }
        fn hessian(&mut self, x: &[f64], w: f64, y: &[f64], hess: &mut [f64]) -> EvalResult {
            hess.copy_from_slice(&[2.0 * w * x[1], 2.0 * w * x[0], y[0], w, 2.0 * y[1]]);
            Ok(())
        }
    }

    impl Mpcc for Small {
        fn pairs(&self) -> &[(usize, usize)] {
            &[(0, 1), (2, 3), (0, 3)]
        }
        fn n_groups(&self) -> usize {
            self.groups
        }
        fn group(&self, pair: usize) -> usize {
            pair.min(self.groups - 1)
        }
    }

    const SIGMA: f64 = 0.3;

    /// Every strategy, the lumped one with one group, two and three.
    fn each(mut check: impl FnMut(Relaxation, &mut Relaxed)) {
        for name in (0..).map_while(Relaxation::from_i64) {
            for groups in 1..=3 {
                let mut inner = Small::new(groups);
                let mut st = Structure::new(&inner, strategy(name));
                let mut out = Bounds::free(st.n_all, st.m_all);
                st.scaling.rows[1] = 0.25;
                st.bounds(&Bounds::free(4, 2), SIGMA, &mut out);
                check(name, &mut Relaxed { inner: &mut inner, st: &mut st });
            }
        }
    }

    fn point(n: usize) -> Vec<f64> {
        (0..n).map(|j| 0.4 + 0.17 * j as f64).collect()
    }

    /// Gradient of the Lagrangian, and the Lagrangian.
    fn lagrangian(p: &mut Relaxed, x: &[f64], w: f64, y: &[f64]) -> (f64, Vec<f64>) {
        let (mut c, mut g) = (vec![0.0; p.m()], vec![0.0; p.n()]);
        let mut jac = vec![0.0; p.jac_pattern().nnz()];
        let f = p.eval(x, &mut c).unwrap();
        p.derivatives(x, &mut g, &mut jac).unwrap();
        let pattern = p.jac_pattern();
        for (j, v) in g.iter_mut().enumerate() {
            *v = w * *v + pattern.range(j).map(|k| jac[k] * y[pattern.row_idx()[k]]).sum::<f64>();
        }
        (w * f + c.iter().zip(y).map(|(c, y)| c * y).sum::<f64>(), g)
    }

    #[test]
    fn derivatives_of_the_relaxed_problem_against_differences() {
        each(|name, p| {
            let (n, m) = (p.n(), p.m());
            let x = point(n);
            let y: Vec<f64> = (0..m).map(|i| 0.7 - 0.3 * i as f64).collect();
            let (_, g) = lagrangian(p, &x, 1.5, &y);
            let mut hess = vec![0.0; p.hess_pattern().nnz()];
            p.hessian(&x, 1.5, &y, &mut hess).unwrap();
            let h = 1e-6;
            for j in 0..n {
                let mut at = |d: f64| {
                    let mut x = x.clone();
                    x[j] += d;
                    lagrangian(p, &x, 1.5, &y)
                };
                let ((fp, gp), (fm, gm)) = (at(h), at(-h));
                assert!((g[j] - (fp - fm) / (2.0 * h)).abs() < 1e-7, "{name:?} gradient {j}");
                for i in 0..n {
                    let exact = p.hess_pattern().get(i.min(j), i.max(j)).map_or(0.0, |k| hess[k]);
                    assert!((exact - (gp[i] - gm[i]) / (2.0 * h)).abs() < 1e-6, "{name:?} Hessian ({i}, {j})");
                }
            }
        });
    }

    #[test]
    fn a_branch_problem_knows_nothing_of_the_strategy() {
        each(|name, p| {
            let (n, m) = (p.n(), p.m());
            let mut out = Bounds::free(n, m);
            p.st.bounds(&Bounds::free(4, 2), f64::INFINITY, &mut out);
            assert!(!p.set_level(0.0, 1e-9), "{name:?}");
            assert!((2..m).all(|i| out.cl[i] == f64::NEG_INFINITY && out.cu[i] == f64::INFINITY), "{name:?}");
            assert!((4..n).all(|j| out.xl[j] == 0.0 && out.xu[j] == 0.0), "{name:?}");
            let x = point(n);
            let mut y = vec![0.0; m];
            y[..2].copy_from_slice(&[0.7, 0.8]);
            let (mut inner, mut c, mut g, mut jac) = (Small::new(1), [0.0; 2], [0.0; 4], [0.0; 4]);
            let f = inner.eval(&x[..4], &mut c).unwrap();
            inner.derivatives(&x[..4], &mut g, &mut jac).unwrap();
            let (l, d) = lagrangian(p, &x, 1.0, &y);
            assert_eq!(l, f + 0.7 * c[0] + 0.25 * 0.8 * c[1], "{name:?}");
            assert_eq!(d[1], g[1] + 0.25 * 0.8 * jac[1], "{name:?}");
        });
    }

    /// The gradient of the relaxed Lagrangian is that of the problem less the multipliers of the pairs.
    #[test]
    fn multipliers_follow_from_the_chain_rule() {
        each(|name, p| {
            let (n, m) = (p.n(), p.m());
            let x = point(n);
            let y: Vec<f64> = (0..m).map(|i| 0.7 - 0.3 * i as f64).collect();
            let (_, relaxed) = lagrangian(p, &x, 1.0, &y);
            let (mut z, mut rows) = (vec![0.0; 4], vec![0.0; 2]);
            p.st.pull_back(&x, &y, &mut z);
            p.st.row_multipliers(&y, &mut rows);
            p.st.branch = true;
            let mut only_rows = vec![0.0; m];
            only_rows[..2].copy_from_slice(&rows);
            let (_, plain) = lagrangian(p, &x, 1.0, &only_rows);
            for j in 0..4 {
                assert!((plain[j] - z[j] - relaxed[j]).abs() < 1e-12, "{name:?} variable {j}");
            }
        });
    }

    #[test]
    fn a_lump_has_one_row_per_group() {
        let rows = |groups| Structure::new(&Small::new(groups), strategy(Relaxation::ScholtesLumped)).size().1 - 2;
        assert_eq!((rows(1), rows(2), rows(3)), (1, 2, 1));
        let mut p = Small::new(2);
        let mut st = Structure::new(&p, strategy(Relaxation::ScholtesLumped));
        assert_eq!(st.sigma_rows(), 2..4);
        let mut c = [0.0; 4];
        Relaxed { inner: &mut p, st: &mut st }.eval(&[1.0, 2.0, 3.0, 5.0], &mut c).unwrap();
        assert_eq!(c[2..], [2.0, 20.0]);
    }
}
