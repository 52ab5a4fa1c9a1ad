//! Weighted sums of squared differences from references.

use std::sync::Arc;

use super::terms::Places;
use crate::error::{Error, Result};
use crate::func::{Dims, EvalResult, Function, Point};
use crate::linalg::csc::Pattern;
use crate::system::{input, SharedFunction};

/// `(r − y)ᵀ W (r − y)` with the outputs `r` of a function and a symmetric matrix `W`; the references `y` are a block of
/// the parameters behind those the function knows.
pub(super) struct Squares {
    f: SharedFunction,
    dims: Dims,
    /// Column of every input of `f`, and the first column of `y`.
    columns: Vec<usize>,
    y: usize,
    weights: Vec<f64>,
    jac: Pattern,
    hess: Pattern,
    /// Entries of the Hessian: of every product of two entries of one pair of rows, of the Hessian of `f`.
    jac_at: Vec<usize>,
    products: Vec<(usize, usize, usize, f64)>,
    inner_hess: Vec<usize>,
    inner: Vec<(usize, usize)>,
}

impl Squares {
    /// `f` of inputs of sizes `dims` less the parameters from column `y` on; `weights[n]` a diagonal or `[n²]` a matrix.
    pub fn of(f: &SharedFunction, dims: Dims, y: usize, weights: &[f64]) -> Result<SharedFunction> {
        let n = f.n_out();
        let mut w = vec![0.0; n * n];
        match weights.len() {
            k if k == n => (0..n).for_each(|i| w[i * n + i] = weights[i]),
            k if k == n * n => (0..n * n).for_each(|k| w[k] = 0.5 * (weights[k] + weights[k % n * n + k / n])),
            k => {
                return Err(Error::Dimension(format!(
                    "{k} weights for the {n} residuals of '{}': give {n}, or a matrix of {}",
                    f.name(),
                    n * n
                )))
            }
        }
        let columns = Places::leading(dims).columns(f.dims(), dims);
        let n_in = dims.n_in();
        let p = f.jac_pattern();
        // entries (row, column) of the residual: those of f, then −1 for its reference
        let mut inner: Vec<(usize, usize)> = (0..p.n_cols())
            .flat_map(|j| p.rows(j).iter().map(move |&i| (i, j)))
            .map(|(i, j)| (i, columns[j]))
            .collect();
        inner.extend((0..n).map(|i| (i, y + i)));
        let cols: Vec<usize> = inner.iter().map(|e| e.1).collect();
        let (jac, jac_at) = Pattern::from_triplets(1, n_in, &vec![0; cols.len()], &cols);
        let (mut rows_h, mut cols_h, mut products) = (Vec::new(), Vec::new(), Vec::new());
        for (a, ea) in inner.iter().enumerate() {
            for (b, eb) in inner.iter().enumerate() {
                if ea.1 <= eb.1 && w[ea.0 * n + eb.0] != 0.0 {
                    rows_h.push(ea.1);
                    cols_h.push(eb.1);
                    products.push((a, b, 0, 2.0 * w[ea.0 * n + eb.0]));
                }
            }
        }
        let q = f.hess_pattern();
        for j in 0..q.n_cols() {
            for &i in q.rows(j) {
                rows_h.push(columns[i].min(columns[j]));
                cols_h.push(columns[i].max(columns[j]));
            }
        }
        let (hess, map) = Pattern::from_triplets(n_in, n_in, &rows_h, &cols_h);
        products.iter_mut().zip(&map).for_each(|(p, &k)| p.2 = k);
        let inner_hess = map[products.len()..].to_vec();
        Ok(Arc::new(Squares {
            f: f.clone(),
            dims,
            columns,
            y,
            weights: w,
            jac,
            hess,
            jac_at,
            products,
            inner_hess,
            inner,
        }))
    }

    fn point<'a>(&self, at: &Point, z: &'a mut [f64]) -> Point<'a> {
        let d = self.f.dims();
        for (v, &c) in z.iter_mut().zip(&self.columns) {
            *v = input(at, c);
        }
        let z = &*z;
        Point { t: z[d.t_col()], x: &z[..d.x], u: &z[d.x..d.x + d.u], p: &z[d.x + d.u..d.t_col()] }
    }

    /// Residuals into `r`, their products with the matrix into `wr`.
    fn residuals(&self, inner: &Point, at: &Point, r: &mut [f64], wr: &mut [f64], work: &mut [f64]) -> EvalResult {
        let n = r.len();
        self.f.value(inner, r, work)?;
        for (i, r) in r.iter_mut().enumerate() {
            *r -= input(at, self.y + i);
        }
        for (row, o) in self.weights.chunks_exact(n).zip(wr.iter_mut()) {
            *o = row.iter().zip(&*r).map(|(w, r)| w * r).sum();
        }
        Ok(())
    }

    /// Jacobian of the residuals into `j`, in the order of `inner`.
    fn inner_jacobian(&self, inner: &Point, j: &mut [f64], work: &mut [f64]) -> EvalResult {
        let nnz = self.f.jac_pattern().nnz();
        j[nnz..].fill(-1.0);
        self.f.jacobian(inner, &mut j[..nnz], work)
    }
}

impl Function for Squares {
    fn name(&self) -> &str {
        self.f.name()
    }
    fn dims(&self) -> Dims {
        self.dims
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
        let n = self.f.n_out();
        self.columns.len() + 2 * n + self.inner.len() + self.inner_hess.len() + self.f.work_len()
    }
    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let n = self.f.n_out();
        let (z, work) = work.split_at_mut(self.columns.len());
        let (r, work) = work.split_at_mut(n);
        let (wr, work) = work.split_at_mut(n);
        let inner = self.point(at, z);
        self.residuals(&inner, at, r, wr, work)?;
        out[0] = r.iter().zip(&*wr).map(|(a, b)| a * b).sum();
        Ok(())
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let n = self.f.n_out();
        let (z, work) = work.split_at_mut(self.columns.len());
        let (r, work) = work.split_at_mut(n);
        let (wr, work) = work.split_at_mut(n);
        let (j, work) = work.split_at_mut(self.inner.len());
        let inner = self.point(at, z);
        self.residuals(&inner, at, r, wr, work)?;
        self.inner_jacobian(&inner, j, work)?;
        out.fill(0.0);
        for ((&k, &(i, _)), v) in self.jac_at.iter().zip(&self.inner).zip(&*j) {
            out[k] += 2.0 * wr[i] * v;
        }
        Ok(())
    }
    fn hessian(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let n = self.f.n_out();
        let (z, work) = work.split_at_mut(self.columns.len());
        let (r, work) = work.split_at_mut(n);
        let (wr, work) = work.split_at_mut(n);
        let (j, work) = work.split_at_mut(self.inner.len());
        let (h, work) = work.split_at_mut(self.inner_hess.len());
        let inner = self.point(at, z);
        self.residuals(&inner, at, r, wr, work)?;
        self.inner_jacobian(&inner, j, work)?;
        out.fill(0.0);
        for &(a, b, k, w) in &self.products {
            out[k] += weights[0] * w * j[a] * j[b];
        }
        if !h.is_empty() {
            wr.iter_mut().for_each(|v| *v *= 2.0 * weights[0]);
            self.f.hessian(&inner, wr, h, work)?;
            for (&k, v) in self.inner_hess.iter().zip(&*h) {
                out[k] += v;
            }
        }
        Ok(())
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::func::{check_derivatives, Callback, CheckSettings};

    #[test]
    fn squares_with_a_diagonal_and_with_a_matrix() {
        let d = Dims { x: 2, u: 1, p: 3 };
        let r = Callback::new("r", Dims { x: 2, u: 1, p: 1 }, 2, |at, o| {
            o[0] = at.x[0] * at.x[1] + at.u[0] * at.p[0];
            o[1] = at.x[1].sin() * at.u[0];
            0
        });
        // the parameter too: without a pattern it counts as no input
        let pattern = Pattern::new(2, 5, vec![0, 1, 3, 5, 6, 6], vec![0, 0, 1, 0, 1, 0]).unwrap();
        let inner: SharedFunction = Arc::new(r.with_jacobian_pattern(pattern).unwrap());
        let at = Point { t: 0.3, x: &[0.2, 0.7], u: &[-0.5], p: &[0.4, 1.0, -0.3] };
        for w in [&[1.0, 0.5][..], &[2.0, 0.3, 0.3, 1.0]] {
            let f = Squares::of(&inner, d, d.x + d.u + 1, w).unwrap();
            let r = check_derivatives(&*f, &at, &CheckSettings::default()).unwrap();
            assert!(r.mismatches.is_empty(), "{:?}", r.mismatches);
        }
        assert!(Squares::of(&inner, d, 4, &[1.0, 2.0, 3.0]).is_err());
    }
}
