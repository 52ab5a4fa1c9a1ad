//! The matrices of Newton's method for Radau IIA, `γ/h I − J` bordered by `−D` and `C` where something slides, with a real and a
//! complex `γ`: dense, or sparse where the system is large and most of the Jacobian is zero.

use super::field::{Field, Pair};
use crate::func::EvalResult;
use crate::linalg::csc::Pattern;
use crate::linalg::lu::Lu;
use crate::linalg::sparse_lu::SparseLu;
use nalgebra::Complex;

/// Both matrices with their factors.
pub(super) struct Newton {
    /// Jacobian `nx × n_z`, `D` and `C`, one row of length `nx` for every algebraic variable.
    jac: Vec<f64>,
    d: Vec<f64>,
    cx: Vec<f64>,
    real: Lu<f64>,
    complex: Lu<Complex<f64>>,
    sparse: Option<Sparse>,
    /// Length of the step the factors belong to; 0 where there are none.
    factored: f64,
    /// States, and algebraic variables of the last evaluation.
    nx: usize,
    r: usize,
}

/// What the sparse matrices are made of.
struct Sparse {
    /// Entries of the Jacobian, and of `D` and `C`, variable by variable.
    jacobian: Vec<f64>,
    border: Vec<f64>,
    /// Row and column of the entries of the Jacobian.
    places: Vec<(usize, usize)>,
    /// Where they go, and where the diagonal of the states is.
    map: Vec<usize>,
    diagonal: Vec<usize>,
    /// Algebraic variables that the pattern belongs to.
    pairs: Vec<Pair>,
    /// Sums of rows.
    sums: Vec<f64>,
    real: SparseLu<f64>,
    complex: SparseLu<Complex<f64>>,
}

impl Newton {
    /// Of `nx` states, `n_z` inputs and at most `most` algebraic variables.
    pub(super) fn new(field: &Field, most: usize) -> Newton {
        let (nx, n_z) = (field.nx, field.n_z);
        let sparse = Sparse::new(field);
        // memory for dense matrices where they are used
        let (n, own) = if sparse.is_some() { (0, 0) } else { (nx + most, nx) };
        Newton {
            jac: vec![0.0; own * n_z],
            d: vec![0.0; most * own],
            cx: vec![0.0; most * own],
            real: Lu::with_capacity(n),
            complex: Lu::with_capacity(n),
            sparse,
            factored: 0.0,
            nx,
            r: 0,
        }
    }

    /// Evaluates the Jacobian, `D` and `C`; where something slides, the field stands at this point.
    pub(super) fn evaluate(&mut self, field: &mut Field, t: f64, x: &[f64], alpha: &[f64]) -> EvalResult {
        self.factored = 0.0;
        self.r = field.n_alg();
        let mut relaid = false;
        if let Some(s) = &mut self.sparse {
            // where a function is not defined, pattern and factors stay as they are
            field.jacobian_entries(t, x, alpha, &mut s.jacobian)?;
            s.border.clear();
            for i in 0..self.r {
                s.border.extend(field.d(i).map(|d| -d.1));
                s.border.extend(field.c(i).filter(|c| c.0 < self.nx).map(|c| c.1));
            }
            relaid = s.pairs != field.pairs();
        }
        if relaid {
            self.sparse = self.sparse.take().and_then(|s| s.laid_out(field));
        }
        if self.sparse.is_some() {
            return Ok(());
        }
        let nx = self.nx;
        self.jac.resize(nx * field.n_z, 0.0);
        let border = (self.r * nx).max(self.d.len());
        self.d.resize(border, 0.0);
        self.cx.resize(border, 0.0);
        for i in 0..self.r {
            let (d, c) = (&mut self.d[i * nx..(i + 1) * nx], &mut self.cx[i * nx..(i + 1) * nx]);
            d.fill(0.0);
            c.fill(0.0);
            field.d(i).for_each(|(j, v)| d[j] = v);
            field.c(i).filter(|e| e.0 < nx).for_each(|(j, v)| c[j] = v);
        }
        field.jacobian(t, x, alpha, &mut self.jac)
    }

    /// Largest sum of a row of the Jacobian, states in units of their sizes: a bound on how fast the mode is.
    pub(super) fn speed(&mut self, size: &[f64]) -> f64 {
        let nx = self.nx;
        let Some(s) = &mut self.sparse else {
            let n_z = self.jac.len() / nx.max(1);
            let row = |r: &[f64]| r[..nx].iter().zip(size).map(|(v, s)| v.abs() * s).sum::<f64>();
            return self.jac.chunks_exact(n_z.max(1)).zip(size).map(|(r, s)| row(r) / s).fold(0.0, f64::max);
        };
        s.speed(size)
    }

    /// Are the matrices sparse?
    pub(super) fn is_sparse(&self) -> bool {
        self.sparse.is_some()
    }

    /// Are there factors for a step of length `h`?
    pub(super) fn is_factorised(&self, h: f64) -> bool {
        self.factored == h
    }

    /// Factorises for a step of length `h`; `γ` real and complex, unknowns of these sizes. False where a matrix is singular.
    pub(super) fn factorise(&mut self, h: f64, gamma: (f64, Complex<f64>), size: &[f64]) -> bool {
        if self.factored == h {
            return true;
        }
        let regular = match &mut self.sparse {
            Some(s) => s.factorise((gamma.0 / h, gamma.1 / h), size),
            None => self.factorise_dense((gamma.0 / h, gamma.1 / h), size),
        };
        if regular {
            self.factored = h;
        }
        regular
    }

    fn factorise_dense(&mut self, shift: (f64, Complex<f64>), size: &[f64]) -> bool {
        let (nx, r) = (self.nx, self.r);
        let (n, n_z) = (nx + r, self.jac.len() / nx.max(1));
        let (jac, d, cx) = (&self.jac, &self.d, &self.cx);
        let real = self.real.clear(n);
        for i in 0..nx {
            for j in 0..nx {
                real[i * n + j] = -jac[i * n_z + j];
            }
            for j in 0..r {
                real[i * n + nx + j] = -d[j * nx + i];
                real[(nx + j) * n + i] = cx[j * nx + i];
            }
        }
        for (to, from) in self.complex.clear(n).iter_mut().zip(real.iter()) {
            *to = Complex::new(*from, 0.0);
        }
        for i in 0..nx {
            real[i * n + i] += shift.0;
            self.complex.add(i * n + i, shift.1);
        }
        self.real.factorise_sized(|j| size[j]) && self.complex.factorise_sized(|j| size[j])
    }

    /// Replaces a right-hand side by the solution with the real matrix.
    pub(super) fn solve_real(&mut self, b: &mut [f64]) {
        match &mut self.sparse {
            Some(s) => s.real.solve(b),
            None => self.real.solve(b),
        }
    }

    /// Replaces a right-hand side by the solution with the complex matrix.
    pub(super) fn solve_complex(&mut self, b: &mut [Complex<f64>]) {
        match &mut self.sparse {
            Some(s) => s.complex.solve(b),
            None => self.complex.solve(b),
        }
    }
}

impl Sparse {
    /// None where dense factors serve.
    fn new(field: &Field) -> Option<Sparse> {
        let pattern = field.sparse_pattern()?;
        Some(Sparse {
            jacobian: vec![0.0; pattern.nnz()],
            border: Vec::new(),
            places: (0..field.nx).flat_map(|j| pattern.rows(j).iter().map(move |i| (*i, j))).collect(),
            map: (0..pattern.nnz()).collect(),
            diagonal: (0..field.nx).filter_map(|i| pattern.get(i, i)).collect(),
            pairs: Vec::new(),
            sums: vec![0.0; field.nx],
            real: SparseLu::new(pattern.clone()).ok()?,
            complex: SparseLu::new(pattern.clone()).ok()?,
        })
    }

    /// The same for the present algebraic variables; none where no order of elimination is found.
    fn laid_out(self, field: &Field) -> Option<Sparse> {
        let nx = field.nx;
        let (mut rows, mut cols): (Vec<usize>, Vec<usize>) = self.places.iter().copied().unzip();
        for i in 0..field.n_alg() {
            rows.extend(field.d(i).map(|d| d.0));
            cols.resize(rows.len(), nx + i);
            cols.extend(field.c(i).map(|c| c.0).filter(|c| *c < nx));
            rows.resize(cols.len(), nx + i);
        }
        let n = nx + field.n_alg();
        let (pattern, map) = Pattern::from_triplets(n, n, &rows, &cols);
        Some(Sparse {
            diagonal: (0..nx).filter_map(|i| pattern.get(i, i)).collect(),
            map,
            pairs: field.pairs().to_vec(),
            real: SparseLu::new(pattern.clone()).ok()?,
            complex: SparseLu::new(pattern).ok()?,
            ..self
        })
    }

    fn factorise(&mut self, shift: (f64, Complex<f64>), size: &[f64]) -> bool {
        let (real, complex) = (self.real.clear(), self.complex.clear());
        let values = self.jacobian.iter().map(|v| -v).chain(self.border.iter().copied());
        for (v, &place) in values.zip(&self.map) {
            real[place] += v;
            complex[place].re += v;
        }
        for &place in &self.diagonal {
            real[place] += shift.0;
            complex[place] += shift.1;
        }
        self.real.factorise_sized(|j| size[j]) && self.complex.factorise_sized(|j| size[j])
    }

    fn speed(&mut self, size: &[f64]) -> f64 {
        let sums = &mut self.sums;
        sums.fill(0.0);
        for (v, &(i, j)) in self.jacobian.iter().zip(&self.places) {
            sums[i] += v.abs() * size[j];
        }
        sums.iter().zip(size).map(|(v, s)| v / s).fold(0.0, f64::max)
    }
}
