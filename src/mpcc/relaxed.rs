//! A problem with complementarity constraints as a nonlinear program: products as additional rows.

use super::problem::Mpcc;
use super::scaling::Scaling;
use crate::func::{EvalError, EvalResult};
use crate::linalg::csc::Pattern;
use crate::nlp::{Bilinear, Bounds, Nlp};

/// Structure of the relaxed problem: the rows `m..m + n_pairs` are the products.
#[derive(Debug)]
pub(super) struct Structure {
    pub m: usize,
    pub jac: Pattern,
    jac_map: Vec<usize>,
    // positions of ∂(w_a w_b)/∂w_a and ∂w_b
    pair_map: Vec<(usize, usize)>,
    pub hess: Pattern,
    hess_map: Vec<usize>,
    hess_pair: Vec<usize>,
    pub bilinear: Vec<Bilinear>,
    pub scaling: Scaling,
    inner_jac: Vec<f64>,
    inner_hess: Vec<f64>,
}

impl Structure {
    pub fn new(p: &dyn Mpcc) -> Structure {
        let (n, m) = (p.n(), p.m());
        let (mut rows, mut cols) = (Vec::new(), Vec::new());
        push_pattern(p.jac_pattern(), &mut rows, &mut cols);
        let nnz = rows.len();
        for (k, &(a, b)) in p.pairs().iter().enumerate() {
            rows.extend([m + k, m + k]);
            cols.extend([a, b]);
        }
        let (jac, map) = Pattern::from_triplets(m + p.pairs().len(), n, &rows, &cols);
        let pair_map = map[nnz..].chunks(2).map(|c| (c[0], c[1])).collect();
        let jac_map = map[..nnz].to_vec();
        rows.clear();
        cols.clear();
        push_pattern(p.hess_pattern(), &mut rows, &mut cols);
        let nnz = rows.len();
        for &(a, b) in p.pairs() {
            rows.push(a.min(b));
            cols.push(a.max(b));
        }
        let (hess, map) = Pattern::from_triplets(n, n, &rows, &cols);
        let bilinear = p.pairs().iter().enumerate().map(|(k, &(a, b))| Bilinear { a, b, row: m + k }).collect();
        Structure {
            m,
            scaling: Scaling::new(m),
            inner_jac: vec![0.0; p.jac_pattern().nnz()],
            inner_hess: vec![0.0; nnz],
            hess_map: map[..nnz].to_vec(),
            hess_pair: map[nnz..].to_vec(),
            jac,
            jac_map,
            pair_map,
            hess,
            bilinear,
        }
    }

    /// Scales by the gradients at `x`; not at all where they have no value.
    pub fn scale(&mut self, p: &mut dyn Mpcc, x: &[f64], grad: &mut [f64]) {
        self.scaling.reset();
        if p.derivatives(x, grad, &mut self.inner_jac).is_ok() {
            self.scaling.choose(grad, p.jac_pattern(), &self.inner_jac);
        }
    }

    /// Bounds of the relaxed problem: products below `sigma`, or free.
    pub fn bounds(&self, inner: &Bounds, sigma: f64, out: &mut Bounds) {
        out.xl.copy_from_slice(&inner.xl);
        out.xu.copy_from_slice(&inner.xu);
        out.cl[..self.m].copy_from_slice(&inner.cl);
        out.cu[..self.m].copy_from_slice(&inner.cu);
        self.scaling.bounds(out);
        out.cl[self.m..].fill(f64::NEG_INFINITY);
        out.cu[self.m..].fill(sigma);
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

/// The relaxed problem over the original one.
pub(super) struct Relaxed<'a> {
    pub inner: &'a mut dyn Mpcc,
    pub st: &'a mut Structure,
}

impl Nlp for Relaxed<'_> {
    fn n(&self) -> usize {
        self.inner.n()
    }
    fn m(&self) -> usize {
        self.st.m + self.st.bilinear.len()
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
    fn eval(&mut self, x: &[f64], c: &mut [f64]) -> Result<f64, EvalError> {
        let (rows, products) = c.split_at_mut(self.st.m);
        let f = self.inner.eval(x, rows)?;
        for (v, p) in products.iter_mut().zip(&self.st.bilinear) {
            *v = x[p.a] * x[p.b];
        }
        Ok(self.st.scaling.value(f, rows))
    }
    fn derivatives(&mut self, x: &[f64], grad: &mut [f64], jac: &mut [f64]) -> EvalResult {
        let st = &mut *self.st;
        self.inner.derivatives(x, grad, &mut st.inner_jac)?;
        st.scaling.derivatives(grad, self.inner.jac_pattern(), &mut st.inner_jac);
        for (v, &k) in st.inner_jac.iter().zip(&st.jac_map) {
            jac[k] = *v;
        }
        for (p, &(ka, kb)) in st.bilinear.iter().zip(&st.pair_map) {
            jac[ka] = x[p.b];
            jac[kb] = x[p.a];
        }
        Ok(())
    }
    fn hessian(&mut self, x: &[f64], w: f64, y: &[f64], hess: &mut [f64]) -> EvalResult {
        let st = &mut *self.st;
        let (weight, weights) = st.scaling.weights(w, &y[..st.m]);
        self.inner.hessian(x, weight, weights, &mut st.inner_hess)?;
        hess.fill(0.0);
        for (v, &k) in st.inner_hess.iter().zip(&st.hess_map) {
            hess[k] = *v;
        }
        for (p, &k) in st.bilinear.iter().zip(&st.hess_pair) {
            hess[k] += y[p.row];
        }
        Ok(())
    }
}
