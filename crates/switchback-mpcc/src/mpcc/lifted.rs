//! Problems with pairs of functions, brought into vertical form.
//!
//! A member of a pair that is a function gets a variable `v` of its own and the row `G(w) − v = 0`. A member that is a
//! variable is used as it is, unless it is in several pairs: then every pair gets a copy, with a row `w_j − v = 0` behind
//! those of the problem, because a product relaxed in one pair would hold back the others.

use super::problem::Mpcc;
use crate::error::{Error, Result};
use crate::func::{EvalError, EvalResult};
use crate::linalg::csc::Pattern;
use crate::nlp::{Bounds, Nlp};

/// A member of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Member {
    /// Variable `w_j`.
    Variable(usize),
    /// Row `c_i(w)`, which then is no ordinary constraint.
    Row(usize),
}

/// A nonlinear program some of whose rows and variables form complementarity pairs.
pub struct Lifted<P> {
    inner: P,
    pairs: Vec<(usize, usize)>,
    /// Row and variable of every lifted member that is a function.
    lifts: Vec<(usize, usize)>,
    /// Original and copy of every variable in several pairs.
    copies: Vec<(usize, usize)>,
    n: usize,
    m: usize,
    jac: Pattern,
    jac_map: Vec<usize>,
    hess: Pattern,
    jac_values: Vec<f64>,
    nnz: usize,
}

impl<P: Nlp> Lifted<P> {
    /// Lifts what is no variable. Fails when an index does not exist or a row is used twice.
    pub fn new(inner: P, members: &[(Member, Member)]) -> Result<Lifted<P>> {
        let (n0, m) = (inner.n(), inner.m());
        let mut uses = vec![0; n0];
        for member in members.iter().flat_map(|m| [m.0, m.1]) {
            if let Member::Variable(j) = member {
                if j < n0 {
                    uses[j] += 1;
                }
            }
        }
        let mut lifts: Vec<(usize, usize)> = Vec::new();
        let mut lifted = vec![false; m];
        let mut copies: Vec<(usize, usize)> = Vec::new();
        let mut place = |mem: Member, k: usize| -> Result<usize> {
            match mem {
                Member::Variable(j) if j < n0 && uses[j] == 1 => Ok(j),
                Member::Variable(j) if j < n0 => {
                    copies.push((j, n0 + lifts.len() + copies.len()));
                    Ok(n0 + lifts.len() + copies.len() - 1)
                }
                Member::Variable(j) => Err(Error::Range(format!("pair {k} names variable {j}, the problem has {n0}"))),
                Member::Row(i) if i >= m => Err(Error::Range(format!("pair {k} names row {i}, the problem has {m}"))),
                Member::Row(i) => {
                    if std::mem::replace(&mut lifted[i], true) {
                        return Err(Error::Range(format!(
                            "row {i} is in two pairs: lift it to a variable and use that in both"
                        )));
                    }
                    lifts.push((i, n0 + lifts.len() + copies.len()));
                    Ok(n0 + lifts.len() + copies.len() - 1)
                }
            }
        };
        let mut pairs = Vec::with_capacity(members.len());
        for (k, &(a, b)) in members.iter().enumerate() {
            let pair = (place(a, k)?, place(b, k)?);
            if members[k].0 == members[k].1 {
                return Err(Error::Range(format!("pair {k} pairs a variable with itself")));
            }
            pairs.push(pair);
        }
        let (n, m_all) = (n0 + lifts.len() + copies.len(), m + copies.len());
        let (mut rows, mut cols) = (Vec::new(), Vec::new());
        let p = inner.jac_pattern();
        for j in 0..n0 {
            for &i in p.rows(j) {
                rows.push(i);
                cols.push(j);
            }
        }
        let nnz = rows.len();
        for &(i, v) in &lifts {
            rows.push(i);
            cols.push(v);
        }
        for (k, &(j, v)) in copies.iter().enumerate() {
            rows.extend([m + k, m + k]);
            cols.extend([v, j]);
        }
        let (jac, jac_map) = Pattern::from_triplets(m_all, n, &rows, &cols);
        rows.clear();
        cols.clear();
        let p = inner.hess_pattern();
        for j in 0..n0 {
            for &i in p.rows(j) {
                rows.push(i);
                cols.push(j);
            }
        }
        let (hess, _) = Pattern::from_triplets(n, n, &rows, &cols);
        Ok(Lifted { inner, pairs, lifts, copies, n, m: m_all, jac, jac_map, hess, jac_values: vec![0.0; nnz], nnz })
    }

    /// Bounds of the lifted problem from those of the original: members are non-negative, lifted rows become
    /// equalities. Fails when a member that is a variable may be negative only (`xu < 0`).
    pub fn bounds(&self, original: &Bounds) -> Result<Bounds> {
        let mut b = Bounds::free(self.n, self.m);
        let (n0, m0) = (original.xl.len(), original.cl.len());
        b.xl[..n0].copy_from_slice(&original.xl);
        b.xu[..n0].copy_from_slice(&original.xu);
        b.cl[..m0].copy_from_slice(&original.cl);
        b.cu[..m0].copy_from_slice(&original.cu);
        for i in self.lifts.iter().map(|l| l.0).chain(m0..self.m) {
            b.cl[i] = 0.0;
            b.cu[i] = 0.0;
        }
        for &(x, y) in &self.pairs {
            for j in [x, y] {
                b.xl[j] = b.xl[j].max(0.0);
                if b.xu[j] < 0.0 {
                    return Err(Error::Range(format!(
                        "variable {j} is in a complementarity pair but has the upper bound {}",
                        b.xu[j]
                    )));
                }
                if b.xl[j] > 0.0 {
                    return Err(Error::Unsupported(format!(
                        "variable {j} is in a complementarity pair but has the lower bound {} > 0: the other member \
                         is zero, fix it instead",
                        b.xl[j]
                    )));
                }
            }
        }
        Ok(b)
    }

    /// Starting point `[n]` from one of the original problem.
    pub fn start(&mut self, x0: &[f64]) -> Vec<f64> {
        let mut w = vec![0.0; self.n];
        w[..x0.len()].copy_from_slice(x0);
        let mut c = vec![0.0; self.inner.m()];
        if self.inner.eval(x0, &mut c).is_ok() {
            for &(i, v) in &self.lifts {
                w[v] = c[i].max(0.0);
            }
        }
        for &(j, v) in &self.copies {
            w[v] = w[j].max(0.0);
        }
        w
    }

    /// Variable and row numbers of the members of pair `k`, in the lifted numbering.
    pub fn pair(&self, k: usize) -> (usize, usize) {
        self.pairs[k]
    }

    /// The original problem.
    pub fn inner(&mut self) -> &mut P {
        &mut self.inner
    }
}

impl<P: Nlp> Nlp for Lifted<P> {
    fn n(&self) -> usize {
        self.n
    }
    fn m(&self) -> usize {
        self.m
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn eval(&mut self, x: &[f64], c: &mut [f64]) -> std::result::Result<f64, EvalError> {
        let m0 = self.m - self.copies.len();
        let f = self.inner.eval(&x[..self.inner.n()], &mut c[..m0])?;
        for &(i, v) in &self.lifts {
            c[i] -= x[v];
        }
        for (c, &(j, v)) in c[m0..].iter_mut().zip(&self.copies) {
            *c = x[j] - x[v];
        }
        Ok(f)
    }
    fn derivatives(&mut self, x: &[f64], grad: &mut [f64], jac: &mut [f64]) -> EvalResult {
        let n0 = self.inner.n();
        grad[n0..].fill(0.0);
        self.inner.derivatives(&x[..n0], &mut grad[..n0], &mut self.jac_values)?;
        for (v, &k) in self.jac_values.iter().zip(&self.jac_map) {
            jac[k] = *v;
        }
        let (lifts, copies) = self.jac_map[self.nnz..].split_at(self.lifts.len());
        for &k in lifts {
            jac[k] = -1.0;
        }
        for k in copies.chunks_exact(2) {
            jac[k[0]] = -1.0;
            jac[k[1]] = 1.0;
        }
        Ok(())
    }
    fn hessian(&mut self, x: &[f64], w: f64, y: &[f64], hess: &mut [f64]) -> EvalResult {
        let n0 = self.inner.n();
        let m0 = self.m - self.copies.len();
        self.inner.hessian(&x[..n0], w, &y[..m0], hess)
    }
}

impl<P: Nlp> Mpcc for Lifted<P> {
    fn pairs(&self) -> &[(usize, usize)] {
        &self.pairs
    }
    fn lifts(&self) -> &[(usize, usize)] {
        &self.lifts
    }
}
