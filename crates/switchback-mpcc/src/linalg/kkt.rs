//! The KKT level: equilibration, regularisation, inertia and iterative refinement over a backend.
//!
//! The matrix is `K = [H + delta_w I, J'; J, -D - delta_c I]`, symmetric of order `n_primal + m`, given
//! by one upper triangle that stores the whole diagonal. A factorisation without pivoting of an
//! indefinite matrix need not exist. It does for a quasidefinite one (R. Vanderbei, "Symmetric
//! quasidefinite matrices", SIAM J. Optim. 5, 1995), and three measures make it usable for the others:
//!
//! 1. Equilibration: `S K S` with row norms near 1 (D. Ruiz, RAL-TR-2001-034), `S` powers of two, hence
//!    free of rounding.
//! 2. A static shift of `S K S`, positive on primal and negative on dual diagonals. The product of the two
//!    must stay above about 1e-15, or a free variable without curvature between two constraints makes a
//!    Schur complement that swallows the dual shift. On a breakdown the shift grows by 10.
//! 3. Refinement against `S K S` *without* the shift, so that the shift perturbs the factors and not
//!    the solution.
//!
//! The signs of the pivots count the inertia. They are right as long as no eigenvalue of `S K S` is of the
//! order of the shift; [`KktStatus`] separates these cases. Signs are never forced: in a nonconvex problem
//! that replaces the step by something else without a word.

use super::csc::{mul_add_symmetric_upper, Pattern};
use super::krylov::{Asked, Gmres};
use super::ldl::{Factorisation, Inertia, SymmetricSolver};
use crate::error::{Error, Result};

/// Settings of [`Kkt`]; the defaults come from measurements on collocation problems with switches.
#[derive(Debug, Clone, PartialEq)]
pub struct KktSettings {
    /// Shift of the equilibrated diagonal that is always on (plus on primal, minus on dual rows); 3e-8.
    pub static_shift: f64,
    /// Largest shift that a breakdown may raise it to; 1e-5.
    pub max_shift: f64,
    /// Sweeps of the equilibration; 3. With 0 the matrix is not scaled.
    pub ruiz_sweeps: usize,
    /// Largest number of refinement steps; 10.
    pub refine_max: usize,
    /// Relative residual at which refinement stops; 1e-12.
    pub refine_tol: f64,
    /// Residual of the dual rows, relative to their own right-hand side, at which refinement stops as well where
    /// [`Kkt::demand_rows`] was asked for; 1e-3.
    pub rows_tol: f64,
    /// Relative residual above which a solution is not [`KktSolve::ok`]; 1e-5.
    pub singular_residual: f64,
    /// A pivot of smaller magnitude is a breakdown; 1e-14.
    pub min_pivot: f64,
    /// With a wrong inertia, a pivot of the wrong sign and of magnitude up to this multiple of the shift
    /// says nothing about the curvature: the matrix counts as singular; 10.
    pub ambiguous_pivot: f64,
}

impl Default for KktSettings {
    fn default() -> KktSettings {
        KktSettings {
            static_shift: 3e-8,
            max_shift: 1e-5,
            ruiz_sweeps: 3,
            refine_max: 10,
            refine_tol: 1e-12,
            rows_tol: 1e-3,
            singular_residual: 1e-5,
            min_pivot: 1e-14,
            ambiguous_pivot: 10.0,
        }
    }
}

/// What a factorisation says about the matrix.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KktStatus {
    /// `n_primal` positive and `m` negative eigenvalues.
    Ok,
    /// The count is wrong and no pivot is ambiguous: genuine negative curvature; raise `delta_w`. The
    /// factors can be used.
    WrongInertia,
    /// A breakdown at every shift, a value that is not finite, or a wrong count that an eigenvalue of the
    /// order of the shift may explain; raise `delta_c` first. In the last case the factors can be used.
    Singular,
}

/// How a solve ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KktSolve {
    /// `|r| / (|S K S| |x| + |b|)` in the maximum norm and equilibrated units, of the returned solution;
    /// infinite without a solution.
    pub residual: f64,
    /// `|r| / |b|` in the same norm: near 1 where the right-hand side is outside the range of the matrix.
    pub relative: f64,
    /// Refinement steps taken.
    pub steps: usize,
    /// Whether the residual is finite and at most [`KktSettings::singular_residual`].
    pub ok: bool,
}

/// Facts about the factorisations of a [`Kkt`] so far.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LinearStats {
    /// Name of the backend that factors.
    pub backend: &'static str,
    /// Order of the matrix.
    pub n: usize,
    /// Entries of its upper triangle.
    pub nnz_k: usize,
    /// Entries of L below the diagonal.
    pub nnz_l: usize,
    /// Floating-point operations of one factorisation (multiplications, additions and divisions).
    pub flops: f64,
    /// Smallest absolute pivot of the last factorisation, in equilibrated units; 0 without factors.
    pub min_abs_pivot: f64,
    /// Largest absolute pivot, likewise.
    pub max_abs_pivot: f64,
    /// Static shift of the last factorisation, in equilibrated units.
    pub shift: f64,
    /// Numeric factorisations, with those that a breakdown made necessary.
    pub factorisations: usize,
    /// Solutions.
    pub solves: usize,
    /// Steps of refinement and GMRES in all solutions.
    pub refinement_steps: usize,
    /// Times the scaling was computed.
    pub equilibrations: usize,
}

/// Work for an entry of the factor, which is written once and read by every solution, and for a row of the system with what
/// an iteration does to it, in floating-point operations.
const WORK_OF_ENTRY: f64 = 20.0;
const WORK_OF_ROW: f64 = 200.0;

impl LinearStats {
    /// Work of an iteration that factors and solves once, in floating-point operations of a factorisation: the same for the
    /// same structure on every machine.
    pub fn work(&self) -> f64 {
        self.flops + WORK_OF_ENTRY * (self.nnz_l + self.nnz_k) as f64 + WORK_OF_ROW * self.n as f64
    }
}

/// A KKT matrix with its factors; see the module documentation. Memory is allocated in [`Kkt::new`] only
/// (with a backend that keeps to that, as the sparse one does).
pub struct Kkt {
    upper: Pattern,
    n_primal: usize,
    settings: KktSettings,
    backend: Box<dyn SymmetricSolver>,
    /// Position of every diagonal entry.
    diag: Vec<usize>,
    /// Scaling of every row (powers of two), and of every entry.
    scale: Vec<f64>,
    entry_scale: Vec<f64>,
    /// `S (K + deltas) S` without the static shift.
    matrix: Vec<f64>,
    true_diag: Vec<f64>,
    /// Norm of `matrix`, formed at the first solve.
    norm: Option<f64>,
    shift: f64,
    inertia: Inertia,
    has_factors: bool,
    factorisations: usize,
    solves: usize,
    refinement_steps: usize,
    equilibrations: usize,
    b: Vec<f64>,
    x: Vec<f64>,
    best: Vec<f64>,
    r: Vec<f64>,
    gmres: Gmres,
    demands_rows: bool,
}

/// Steps of GMRES where refinement stalls.
const KRYLOV_STEPS: usize = 10;
/// A correction this much larger than the solution may come from a matrix without inverse, and the shifted one's solution is the
/// better step then. Where the rows have to be solved it counts if it leaves less than this share of the residual: of an eigenvalue `λ`
/// below the shift `ε` the correction is `ε/|λ|` times as large as the solution; beyond the limit `λ` is next to rounding.
const KRYLOV_GROWTH: f64 = 10.0;
const KRYLOV_GAIN: f64 = 0.1;
const KRYLOV_GROWTH_MAX: f64 = 1e4;
/// Quality that is worth them, as a relative residual.
const KRYLOV_FROM: f64 = 1e-11;

/// Bounds of the scaling factors: the powers of two inside [1e-8, 1e8].
const SCALE_MIN: f64 = 1.0 / 67_108_864.0;
const SCALE_MAX: f64 = 67_108_864.0;

impl Kkt {
    /// Analyses the upper triangle `upper` of order `n_primal + m`; every diagonal entry must be stored,
    /// zero or not.
    ///
    /// # Errors
    /// [`Error::Dimension`] if the pattern is no upper triangle, lacks a diagonal entry or has fewer rows
    /// than `n_primal`; [`Error::Range`] for settings out of range; what the backend's analysis returns.
    pub fn new(
        upper: &Pattern,
        n_primal: usize,
        mut backend: Box<dyn SymmetricSolver>,
        settings: KktSettings,
    ) -> Result<Kkt> {
        let n = upper.n_cols();
        if n_primal > n {
            return Err(Error::Dimension(format!(
                "KKT matrix: {n_primal} primal variables, but only {n} columns; the order is primal plus dual"
            )));
        }
        let positive = |v: f64| v.is_finite() && v > 0.0;
        if !positive(settings.static_shift) || !positive(settings.max_shift) {
            return Err(Error::Range(format!(
                "KKT settings: static_shift {} and max_shift {} must be positive and finite; the factorisation does \
                 not pivot and needs the shift",
                settings.static_shift, settings.max_shift
            )));
        }
        for (name, v) in [
            ("refine_tol", settings.refine_tol),
            ("rows_tol", settings.rows_tol),
            ("singular_residual", settings.singular_residual),
            ("min_pivot", settings.min_pivot),
            ("ambiguous_pivot", settings.ambiguous_pivot),
        ] {
            if v.is_nan() || v < 0.0 {
                return Err(Error::Range(format!("KKT settings: {name} is {v}; it must not be negative")));
            }
        }
        backend.analyse(upper)?;
        let mut diag = Vec::with_capacity(n);
        for j in 0..n {
            diag.push(upper.get(j, j).ok_or_else(|| {
                Error::Dimension(format!(
                    "KKT matrix: the diagonal entry of column {j} is not in the pattern; store all of them, zeros too"
                ))
            })?);
        }
        Ok(Kkt {
            upper: upper.clone(),
            n_primal,
            settings,
            backend,
            diag,
            scale: vec![1.0; n],
            entry_scale: vec![1.0; upper.nnz()],
            matrix: vec![0.0; upper.nnz()],
            true_diag: vec![0.0; n],
            norm: None,
            shift: 0.0,
            inertia: Inertia::default(),
            has_factors: false,
            factorisations: 0,
            solves: 0,
            refinement_steps: 0,
            equilibrations: 0,
            b: vec![0.0; n],
            x: vec![0.0; n],
            best: vec![0.0; n],
            r: vec![0.0; n],
            gmres: Gmres::new(n, KRYLOV_STEPS),
            demands_rows: false,
        })
    }

    /// From now on solutions solve the dual rows by themselves, too. Beside a large gradient, or large multipliers, the violation of the
    /// constraints is no part of the whole residual that counts: the step then leaves all of it, and a Newton method that is told so
    /// by nobody goes on with full steps that do not lower the violation. It is no gain where rows depend on each other and contradict:
    /// there the shift, which bounds the step, is the better answer.
    pub fn demand_rows(&mut self, on: bool) {
        self.demands_rows = on;
    }

    /// Computes the scaling from the matrix `values` (order of the pattern), for the factorisations that
    /// follow; present factors keep theirs only until then, so factor before the next solve.
    ///
    /// Rows without a finite nonzero entry keep the factor 1. Values that are not finite are ignored.
    ///
    /// # Panics
    /// If the number of values is not that of the pattern.
    pub fn equilibrate(&mut self, values: &[f64]) {
        assert_eq!(values.len(), self.upper.nnz(), "equilibrate: one value per entry of the pattern");
        self.has_factors = false;
        self.equilibrations += 1;
        let (ptr, idx) = (self.upper.col_ptr(), self.upper.row_idx());
        self.scale.fill(1.0);
        let norms = &mut self.r;
        for _ in 0..self.settings.ruiz_sweeps {
            norms.fill(0.0);
            for (j, w) in ptr.windows(2).enumerate() {
                let sj = self.scale[j];
                let mut column = 0.0_f64;
                for (&i, &v) in idx[w[0]..w[1]].iter().zip(&values[w[0]..w[1]]) {
                    let a = v.abs() * sj * self.scale[i];
                    // False for NaN; infinity is filtered too.
                    let a = if a <= f64::MAX { a } else { 0.0 };
                    column = larger(a, column);
                    norms[i] = larger(a, norms[i]);
                }
                norms[j] = larger(column, norms[j]);
            }
            for (s, &a) in self.scale.iter_mut().zip(norms.iter()) {
                if a > 0.0 {
                    *s = (*s / a.sqrt()).clamp(SCALE_MIN, SCALE_MAX);
                }
            }
        }
        for s in &mut self.scale {
            *s = nearest_power_of_two(*s);
        }
        for (j, w) in ptr.windows(2).enumerate() {
            let sj = self.scale[j];
            for (e, &i) in self.entry_scale[w[0]..w[1]].iter_mut().zip(&idx[w[0]..w[1]]) {
                *e = sj * self.scale[i];
            }
        }
    }

    /// Factors the matrix `values` (order of the pattern, neither shifted nor scaled) with `delta_w` added
    /// to the primal and `delta_c` subtracted from the dual diagonals, both in the units of `values`.
    ///
    /// # Panics
    /// If the number of values is not that of the pattern.
    pub fn factor(&mut self, values: &[f64], delta_w: f64, delta_c: f64) -> KktStatus {
        assert_eq!(values.len(), self.upper.nnz(), "factor: one value per entry of the pattern");
        self.has_factors = false;
        self.norm = None;
        self.inertia = Inertia::default();
        let mut finite = delta_w.is_finite() & delta_c.is_finite();
        for ((m, &v), &s) in self.matrix.iter_mut().zip(values).zip(&self.entry_scale) {
            let a = v * s;
            finite &= a.is_finite();
            *m = a;
        }
        if !finite {
            return KktStatus::Singular;
        }
        for (j, (&k, &s)) in self.diag.iter().zip(&self.scale).enumerate() {
            let delta = if j < self.n_primal { delta_w } else { -delta_c };
            self.matrix[k] += delta * s * s;
            self.true_diag[j] = self.matrix[k];
        }
        self.shift = self.settings.static_shift;
        let result = loop {
            for (j, (&k, &a)) in self.diag.iter().zip(&self.true_diag).enumerate() {
                self.matrix[k] = if j < self.n_primal { a + self.shift } else { a - self.shift };
            }
            self.factorisations += 1;
            let result = self.backend.factor(&self.matrix);
            if let Factorisation::Ok(inertia) = result {
                if self.upper.n_cols() == 0 || self.backend.stats().min_abs_pivot >= self.settings.min_pivot {
                    break Some(inertia);
                }
            }
            if self.shift >= self.settings.max_shift {
                break None;
            }
            self.shift = (10.0 * self.shift).min(self.settings.max_shift);
        };
        for (&k, &a) in self.diag.iter().zip(&self.true_diag) {
            self.matrix[k] = a;
        }
        let Some(inertia) = result else { return KktStatus::Singular };
        self.has_factors = true;
        self.inertia = inertia;
        if inertia.positive == self.n_primal && inertia.zero == 0 {
            KktStatus::Ok
        } else if self.smallest_suspect() <= self.settings.ambiguous_pivot * self.shift {
            KktStatus::Singular
        } else {
            KktStatus::WrongInertia
        }
    }

    /// Smallest magnitude among the pivots whose sign is not that of their row (plus for primal, minus for
    /// dual). A pivot of the right sign is no suspect however small it is: a variable without curvature
    /// that is eliminated first has exactly the shift as its pivot. Without scalar pivots, the smallest
    /// magnitude of all.
    fn smallest_suspect(&self) -> f64 {
        let (pivots, order) = self.backend.pivots();
        if pivots.is_empty() {
            return self.backend.stats().min_abs_pivot;
        }
        let wrong = pivots.iter().zip(order).filter(|&(&d, &row)| (d > 0.0) != (row < self.n_primal));
        wrong.fold(f64::INFINITY, |m, (d, _)| m.min(d.abs()))
    }

    /// Solves with the last factors and refines: `(K + deltas) sol = rhs`, without the static shift. The
    /// iterate with the smallest residual, that of the dual rows by themselves included where they are demanded, is returned; where a
    /// step gains less than a factor of 2, eigenvalues are next to the shift, and GMRES goes on. Without factors, or if no iterate is finite, `sol` is zero and not `ok`.
    ///
    /// # Panics
    /// If `rhs` or `sol` has not length `n`.
    pub fn solve(&mut self, rhs: &[f64], sol: &mut [f64]) -> KktSolve {
        let n = self.upper.n_cols();
        assert_eq!((rhs.len(), sol.len()), (n, n), "solve: one value per row of the matrix");
        if !self.has_factors {
            sol.fill(0.0);
            return KktSolve { residual: f64::INFINITY, relative: f64::INFINITY, steps: 0, ok: false };
        }
        for ((b, &v), &s) in self.b.iter_mut().zip(rhs).zip(&self.scale) {
            *b = v * s;
        }
        let b_norm = max_abs(&self.b);
        if b_norm == 0.0 {
            sol.fill(0.0);
            return KktSolve { residual: 0.0, relative: 0.0, steps: 0, ok: true };
        }
        let k_norm = match self.norm {
            Some(v) => v,
            None => {
                let v = norm_inf(&self.upper, &self.matrix, &mut self.r);
                *self.norm.insert(v)
            }
        };
        let rows_norm = max_abs(&self.b[self.n_primal..]);
        self.r.copy_from_slice(&self.b);
        self.x.fill(0.0);
        // the quality of the best solution so far in units of what is asked of it, and its residual
        let (mut best, mut best_residual) = (f64::INFINITY, f64::INFINITY);
        let mut last = f64::INFINITY;
        let mut steps = 0;
        let mut krylov = false;
        loop {
            let mut growth = 0.0;
            if krylov {
                let most = if self.demands_rows { KRYLOV_GROWTH_MAX } else { KRYLOV_GROWTH };
                let largest = max_abs(&self.best);
                let asked = Asked { reduction: 1.0 / best, largest: most * largest, flexible: self.demands_rows };
                let Kkt { gmres, backend, upper, matrix, r, .. } = self;
                let multiply = |z: &[f64], w: &mut [f64]| {
                    w.fill(0.0);
                    mul_add_symmetric_upper(upper, matrix, z, w, 1.0);
                };
                steps += gmres.solve(r, asked, |z| backend.solve(z), multiply);
                growth = max_abs(r) / largest;
                if growth > most {
                    break;
                }
            } else {
                self.backend.solve(&mut self.r);
            }
            for (x, &d) in self.x.iter_mut().zip(&self.r) {
                *x += d;
            }
            self.r.copy_from_slice(&self.b);
            mul_add_symmetric_upper(&self.upper, &self.matrix, &self.x, &mut self.r, -1.0);
            let size = max_abs(&self.r);
            if growth > KRYLOV_GROWTH && size > KRYLOV_GAIN * last {
                break;
            }
            last = size;
            let residual = size / (k_norm * max_abs(&self.x) + b_norm);
            let rows = if rows_norm > 0.0 { max_abs(&self.r[self.n_primal..]) / rows_norm } else { 0.0 };
            let asked = residual / self.settings.refine_tol.max(f64::MIN_POSITIVE);
            let asked_of_rows =
                if self.demands_rows { rows / self.settings.rows_tol.max(f64::MIN_POSITIVE) } else { 0.0 };
            // NaN where the whole residual is
            let quality = if asked_of_rows > asked { asked_of_rows } else { asked };
            let previous = best;
            // False for NaN.
            let better = quality < best;
            if better {
                (best, best_residual) = (quality, residual);
                std::mem::swap(&mut self.best, &mut self.x);
            }
            let done = best <= 1.0 || steps >= self.settings.refine_max;
            let stalled = !better || 2.0 * quality > previous;
            let worth = best * self.settings.refine_tol >= KRYLOV_FROM;
            if done || !best.is_finite() || (stalled && (krylov || !worth)) {
                break;
            }
            krylov |= stalled;
            if !better {
                self.r.copy_from_slice(&self.b);
                mul_add_symmetric_upper(&self.upper, &self.matrix, &self.best, &mut self.r, -1.0);
            }
            self.x.copy_from_slice(&self.best);
            steps += 1;
        }
        let best = best_residual;
        self.solves += 1;
        self.refinement_steps += steps;
        if !best.is_finite() {
            sol.fill(0.0);
            return KktSolve { residual: f64::INFINITY, relative: f64::INFINITY, steps, ok: false };
        }
        for ((v, &x), &s) in sol.iter_mut().zip(&self.best).zip(&self.scale) {
            *v = x * s;
        }
        let relative = best * (k_norm * max_abs(&self.best) / b_norm + 1.0);
        KktSolve { residual: best, relative, steps, ok: best <= self.settings.singular_residual }
    }

    /// Inertia of the last factorisation; zeros without factors.
    pub fn inertia(&self) -> Inertia {
        self.inertia
    }

    /// Numeric factorisations so far, with those that a breakdown made necessary.
    pub fn factorisations(&self) -> usize {
        self.factorisations
    }

    /// Facts about structure, last factorisation and work so far.
    pub fn stats(&self) -> LinearStats {
        let s = self.backend.stats();
        LinearStats {
            backend: s.name,
            n: s.n,
            nnz_k: s.nnz_a,
            nnz_l: s.nnz_l,
            flops: s.flops,
            min_abs_pivot: s.min_abs_pivot,
            max_abs_pivot: s.max_abs_pivot,
            shift: self.shift,
            factorisations: self.factorisations,
            solves: self.solves,
            refinement_steps: self.refinement_steps,
            equilibrations: self.equilibrations,
        }
    }

    /// Order of the matrix, `n_primal + m`.
    pub fn n(&self) -> usize {
        self.upper.n_cols()
    }

    /// Number of primal rows.
    pub fn n_primal(&self) -> usize {
        self.n_primal
    }

    /// The static shift of the last factorisation, in equilibrated units; above the setting after a
    /// breakdown.
    pub fn shift(&self) -> f64 {
        self.shift
    }

    /// Scaling factor of every row, powers of two (length `n`).
    pub fn scaling(&self) -> &[f64] {
        &self.scale
    }

    /// The settings.
    pub fn settings(&self) -> &KktSettings {
        &self.settings
    }
}

/// The power of two nearest in the logarithm; `v` positive and normal.
fn nearest_power_of_two(v: f64) -> f64 {
    // The exponent alone is the next power of two below; sqrt(2) moves the border between two of them.
    f64::from_bits((v * std::f64::consts::SQRT_2).to_bits() & 0x7ff0_0000_0000_0000)
}

/// The larger of two numbers that are not NaN, in one instruction.
#[inline]
fn larger(a: f64, b: f64) -> f64 {
    if a > b {
        a
    } else {
        b
    }
}

/// Maximum norm; NaN if an entry is. Without the sign, the bits of floats order like the floats, NaN last.
pub(super) fn max_abs(v: &[f64]) -> f64 {
    f64::from_bits(v.iter().fold(0, |m: u64, a| m.max(a.abs().to_bits())))
}

/// Largest absolute row sum of the symmetric matrix; `work` has length `n`.
fn norm_inf(p: &Pattern, v: &[f64], work: &mut [f64]) -> f64 {
    work.fill(0.0);
    for (j, w) in p.col_ptr().windows(2).enumerate() {
        let mut s = 0.0;
        for (&i, &a) in p.row_idx()[w[0]..w[1]].iter().zip(&v[w[0]..w[1]]) {
            let a = a.abs();
            if i != j {
                work[i] += a;
            }
            s += a;
        }
        work[j] += s;
    }
    work.iter().fold(0.0, |m: f64, &a| m.max(a))
}

#[cfg(test)]
#[allow(clippy::needless_range_loop)]
mod tests {
    use super::super::ldl::{Columns, Dense};
    use super::*;

    /// Upper triangle of a dense matrix: all nonzeros and the whole diagonal.
    fn upper(a: &[&[f64]]) -> (Pattern, Vec<f64>) {
        let n = a.len();
        let (mut rows, mut cols) = (Vec::new(), Vec::new());
        for j in 0..n {
            for i in 0..=j {
                if i == j || a[i][j] != 0.0 {
                    rows.push(i);
                    cols.push(j);
                }
            }
        }
        let (p, _) = Pattern::from_triplets(n, n, &rows, &cols);
        let v = rows.iter().zip(&cols).map(|(&i, &j)| a[i][j]).collect();
        (p, v)
    }

    fn sparse(p: &Pattern, n_primal: usize) -> Kkt {
        Kkt::new(p, n_primal, Box::new(Columns::new()), KktSettings::default()).unwrap()
    }

    fn close(a: &[f64], b: &[f64], tol: f64) {
        assert_eq!(a.len(), b.len());
        for (x, y) in a.iter().zip(b) {
            assert!((x - y).abs() <= tol * (1.0 + y.abs()), "{a:?} {b:?}");
        }
    }

    #[test]
    fn refinement_removes_the_shift() {
        // Free variable without curvature between two constraints: no pivot exists without a shift.
        let (p, v) =
            upper(&[&[0.0, 0.0, 1.0, 2.0], &[0.0, 1.0, 1.0, -1.0], &[1.0, 1.0, 0.0, 0.0], &[2.0, -1.0, 0.0, 0.0]]);
        let mut k = sparse(&p, 2);
        k.equilibrate(&v);
        assert_eq!(k.factor(&v, 0.0, 0.0), KktStatus::Ok);
        let x = [1.0, -2.0, 3.0, 0.5];
        let (mut b, mut s) = ([0.0; 4], [0.0; 4]);
        mul_add_symmetric_upper(&p, &v, &x, &mut b, 1.0);
        let r = k.solve(&b, &mut s);
        assert!(r.ok && r.residual <= 1e-12 && r.steps <= 3, "{r:?}");
        close(&s, &x, 1e-12);
        let st = k.stats();
        assert_eq!((st.backend, st.n, st.nnz_k, st.shift), (Columns::new().name(), 4, p.nnz(), 3e-8));
        assert_eq!((st.factorisations, st.solves, st.equilibrations), (1, 1, 1));
        assert!(st.refinement_steps == r.steps && r.steps > 0 && st.nnz_l > 0 && st.flops > st.nnz_l as f64);
        assert_eq!((k.n(), k.n_primal()), (4, 2));
    }

    #[test]
    fn deltas_are_unscaled_and_part_of_the_matrix() {
        let (p, v) = upper(&[&[1e6, 0.0, 1e3], &[0.0, 1e-4, 2.0], &[1e3, 2.0, -1e-3]]);
        let (dw, dc) = (0.25, 0.125);
        let mut w = v.clone();
        for j in 0..3 {
            w[p.get(j, j).unwrap()] += if j < 2 { dw } else { -dc };
        }
        let (mut a, mut b) = ([0.0; 3], [0.0; 3]);
        let mut k = sparse(&p, 2);
        k.equilibrate(&v);
        assert!(k.scaling().iter().any(|&s| s != 1.0));
        assert_eq!(k.factor(&v, dw, dc), KktStatus::Ok);
        assert!(k.solve(&[1.0, 2.0, 3.0], &mut a).ok);
        let mut r = [1.0, 2.0, 3.0];
        mul_add_symmetric_upper(&p, &w, &a, &mut r, -1.0);
        close(&r, &[0.0; 3], 1e-10);
        assert_eq!(k.factor(&w, 0.0, 0.0), KktStatus::Ok);
        assert!(k.solve(&[1.0, 2.0, 3.0], &mut b).ok);
        close(&a, &b, 1e-12);
    }

    #[test]
    fn masked_and_dependent_rows_factor() {
        // Row 3 is masked (all zero), rows 2 and 4 are the same constraint.
        let (p, v) = upper(&[
            &[2.0, 0.0, 1.0, 0.0, 1.0],
            &[0.0, 1.0, 1.0, 0.0, 1.0],
            &[1.0, 1.0, 0.0, 0.0, 0.0],
            &[0.0; 5],
            &[1.0, 1.0, 0.0, 0.0, 0.0],
        ]);
        let mut k = sparse(&p, 2);
        k.equilibrate(&v);
        assert_eq!(k.scaling()[3], 1.0);
        assert_eq!(k.factor(&v, 0.0, 0.0), KktStatus::Ok);
        assert_eq!(k.inertia(), Inertia { positive: 2, negative: 3, zero: 0 });
        // Consistent right-hand side: solved, the multipliers are shared.
        let mut s = [0.0; 5];
        let r = k.solve(&[1.0, 1.0, 3.0, 0.0, 3.0], &mut s);
        assert!(r.ok && r.residual < 1e-10, "{r:?}");
        close(&[s[0] + s[1], s[2] - s[4], s[3]], &[3.0, 0.0, 0.0], 1e-7);
        // Inconsistent: what comes back is finite, and the true residual says so or the solution is huge.
        let r = k.solve(&[1.0, 1.0, 3.0, 0.0, 4.0], &mut s);
        assert!(s.iter().all(|a| a.is_finite()));
        assert!(!r.ok || s.iter().any(|a| a.abs() > 1e4), "{r:?} {s:?}");
    }

    #[test]
    fn wrong_inertia_and_delta_w() {
        // Negative curvature that the constraint does not fix, next to a variable whose pivot is the shift:
        // a small pivot of the right sign is no reason to call the matrix singular.
        let (p, v) =
            upper(&[&[-1.0, 0.0, 0.0, 0.0], &[0.0, 0.0, 0.0, 1.0], &[0.0, 0.0, 1.0, 1.0], &[0.0, 1.0, 1.0, 0.0]]);
        let mut k = sparse(&p, 3);
        k.equilibrate(&v);
        assert_eq!(k.factor(&v, 0.0, 0.0), KktStatus::WrongInertia);
        assert!(k.stats().min_abs_pivot <= 10.0 * k.shift());
        assert_eq!(k.inertia(), Inertia { positive: 2, negative: 2, zero: 0 });
        // The factors are those of the matrix all the same.
        let mut s = [0.0; 4];
        assert!(k.solve(&[1.0, 1.0, 1.0, 1.0], &mut s).ok);
        close(&s[..1], &[-1.0], 1e-12);
        assert_eq!(k.factor(&v, 2.0, 0.0), KktStatus::Ok);
    }

    #[test]
    fn curvature_of_the_size_of_the_shift_is_singular() {
        let backends: [Box<dyn SymmetricSolver>; 2] = [Box::new(Columns::new()), Box::new(Dense::new())];
        for backend in backends {
            let (p, v) = upper(&[&[1.0, 0.0], &[0.0, -1e-7]]);
            // Not equilibrated: that would scale the tiny entry up to 1.
            let mut k = Kkt::new(&p, 2, backend, KktSettings::default()).unwrap();
            assert_eq!(k.factor(&v, 0.0, 0.0), KktStatus::Singular);
            assert_eq!(k.inertia().negative, 1);
            assert_eq!(k.factor(&v, 1e-4, 0.0), KktStatus::Ok);
        }
    }

    #[test]
    fn breakdown_raises_the_shift() {
        // -3e-8 on a primal diagonal cancels the first shift exactly.
        let (p, v) = upper(&[&[1.0, 0.0], &[0.0, -3e-8]]);
        let mut k = sparse(&p, 2);
        assert_eq!(k.factor(&v, 0.0, 0.0), KktStatus::Ok);
        assert!(k.shift() > 1e-7 && k.factorisations() == 2, "{} {}", k.shift(), k.factorisations());
        // No latch: the next matrix starts from the setting again.
        assert_eq!(k.factor(&[1.0, 1.0], 0.0, 0.0), KktStatus::Ok);
        assert_eq!((k.shift(), k.factorisations()), (3e-8, 3));
        // With the largest shift equal to the first there is no way out.
        let settings = KktSettings { max_shift: 3e-8, ..KktSettings::default() };
        let mut k = Kkt::new(&p, 2, Box::new(Columns::new()), settings).unwrap();
        assert_eq!(k.factor(&v, 0.0, 0.0), KktStatus::Singular);
        let mut s = [7.0; 2];
        let r = k.solve(&[1.0, 1.0], &mut s);
        assert!(!r.ok && r.residual.is_infinite() && s == [0.0; 2]);
    }

    /// `x` is what the constraint asks for, whatever the gradient beside it is: `s x = 1e-11`, with `|b|` and `|y|` next to which that is
    /// rounding.
    #[test]
    fn small_violations_beside_large_gradients_are_solved_for() {
        let s = 1e-2;
        let (p, v) = upper(&[&[1.0, s], &[s, 0.0]]);
        let mut k = sparse(&p, 1);
        assert_eq!(k.factor(&v, 0.0, 0.0), KktStatus::Ok);
        let mut left = |demands: bool| {
            let mut x = [0.0; 2];
            k.demand_rows(demands);
            assert!(k.solve(&[100.0, 1e-11], &mut x).ok);
            (s * x[0] * 1e11 - 1.0).abs()
        };
        let (without, with) = (left(false), left(true));
        assert!(without > 0.1 && with <= 1e-3, "{without} {with}");
    }

    /// An eigenvalue a hundredth of the shift: the solution is a hundred times that of the shifted matrix.
    #[test]
    fn eigenvalues_far_below_the_shift_have_their_inverse() {
        let s: f64 = 3e-10_f64.sqrt();
        let (p, v) = upper(&[&[1.0, s], &[s, 0.0]]);
        let mut k = sparse(&p, 1);
        assert_eq!(k.factor(&v, 0.0, 0.0), KktStatus::Ok);
        let mut x = [0.0; 2];
        k.demand_rows(true);
        assert!(k.solve(&[0.0, 1e-7], &mut x).ok);
        close(&[s * x[0] * 1e7, x[0] + s * x[1]], &[1.0, 0.0], 1e-6);
        close(&[-x[1] * 3e-10 * 1e7], &[1.0], 1e-6);
    }

    #[test]
    fn not_finite() {
        let (p, v) = upper(&[&[2.0, 1.0], &[1.0, 0.0]]);
        let mut k = sparse(&p, 1);
        for bad in [f64::NAN, f64::INFINITY] {
            for i in 0..3 {
                let mut w = v.clone();
                w[i] = bad;
                k.equilibrate(&w);
                assert!(k.scaling().iter().all(|s| s.is_finite() && *s > 0.0));
                assert_eq!(k.factor(&w, 0.0, 0.0), KktStatus::Singular);
                assert!(!k.solve(&[1.0, 1.0], &mut [0.0; 2]).ok);
            }
            assert_eq!(k.factor(&v, bad, 0.0), KktStatus::Singular);
            assert_eq!(k.factor(&v, 0.0, bad), KktStatus::Singular);
        }
        assert_eq!(k.factorisations(), 0);
        k.equilibrate(&v);
        assert_eq!(k.factor(&v, 0.0, 0.0), KktStatus::Ok);
        let mut s = [5.0; 2];
        for bad in [f64::NAN, f64::INFINITY] {
            let r = k.solve(&[bad, 1.0], &mut s);
            assert!(!r.ok && s == [0.0; 2], "{r:?}");
        }
        assert!(k.solve(&[1.0, 1.0], &mut s).ok);
        close(&s, &[1.0, -1.0], 1e-12);
        // Zero right-hand side.
        assert_eq!(k.solve(&[0.0, -0.0], &mut s), KktSolve { residual: 0.0, relative: 0.0, steps: 0, ok: true });
    }

    #[test]
    fn equilibration() {
        let (p, v) = upper(&[&[1e10, 1.0, 1e5], &[1.0, 1e-6, 1e-3], &[1e5, 1e-3, 0.0]]);
        let mut k = sparse(&p, 2);
        k.equilibrate(&v);
        let s = k.scaling();
        for &a in s {
            assert_eq!(a.to_bits() & 0x000f_ffff_ffff_ffff, 0, "a power of two");
            assert!((1e-8..=1e8).contains(&a));
        }
        for i in 0..3 {
            let row = (0..3).map(|j| v[p.get(i.min(j), i.max(j)).unwrap()].abs() * s[i] * s[j]).fold(0.0, f64::max);
            assert!((0.2..=4.0).contains(&row), "row {i}: {row}");
        }
        // Extreme entries stay inside the clamp.
        let (p, v) = upper(&[&[1e300, 0.0], &[0.0, 1e-300]]);
        let mut k = sparse(&p, 2);
        k.equilibrate(&v);
        assert_eq!(k.scaling(), [SCALE_MIN, SCALE_MAX]);
        for (v, e) in [(1.0, 1.0), (1.3, 1.0), (1.5, 2.0), (0.6, 0.5), (0.8, 1.0), (3.0, 4.0)] {
            assert_eq!(nearest_power_of_two(v), e);
        }
    }

    /// Random indefinite KKT matrices of nine orders of magnitude: status and inertia as the eigenvalues
    /// have it, solution as LU has it.
    #[test]
    fn agrees_with_the_dense_backend() {
        let mut state = 42_u64;
        let mut unit = || {
            state ^= state >> 12;
            state ^= state << 25;
            state ^= state >> 27;
            (state.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        let mut seen = [0; 2];
        for round in 0..60 {
            let (n, m) = (6 + round % 20, 2 + round % 5);
            let mut a = vec![vec![0.0; n + m]; n + m];
            let curvature = if round % 2 == 0 { 3.0 } else { 0.3 };
            for j in 0..n {
                for i in 0..j {
                    a[i][j] = if unit() > 0.6 { unit() } else { 0.0 };
                }
                a[j][j] = if unit() > 0.5 { 0.0 } else { curvature * n as f64 * (0.5 + unit().abs()) };
            }
            for j in n..n + m {
                for row in a.iter_mut().take(n) {
                    row[j] = if unit() > 0.2 { unit() } else { 0.0 };
                }
            }
            let units: Vec<f64> = (0..n + m).map(|_| 10f64.powf(4.5 * unit())).collect();
            for j in 0..n + m {
                for i in 0..=j {
                    a[i][j] *= units[i] * units[j];
                }
            }
            let rows: Vec<&[f64]> = a.iter().map(Vec::as_slice).collect();
            let (p, v) = upper(&rows);
            let mut k = sparse(&p, n);
            let settings = KktSettings { static_shift: 1e-14, max_shift: 1e-14, ..KktSettings::default() };
            let mut d = Kkt::new(&p, n, Box::new(Dense::new()), settings).unwrap();
            k.equilibrate(&v);
            d.equilibrate(&v);
            let status = d.factor(&v, 0.0, 0.0);
            if d.stats().min_abs_pivot < 1e-5 {
                continue;
            }
            assert_eq!(k.factor(&v, 0.0, 0.0), status, "round {round}");
            assert_eq!(k.inertia(), d.inertia());
            seen[usize::from(status == KktStatus::Ok)] += 1;
            let b: Vec<f64> = units.iter().map(|u| u * unit()).collect();
            let (mut x, mut y) = (vec![0.0; n + m], vec![0.0; n + m]);
            assert!(k.solve(&b, &mut x).ok && d.solve(&b, &mut y).ok);
            // Forward error: residual times condition, in equilibrated units about 1e-12 / 1e-5.
            let size = y.iter().zip(&units).fold(1.0, |a: f64, (v, u)| a.max((v * u).abs()));
            for j in 0..n + m {
                assert!(((x[j] - y[j]) * units[j]).abs() < 1e-6 * size, "round {round}: {} {}", x[j], y[j]);
            }
        }
        assert!(seen[0] > 5 && seen[1] > 5, "{seen:?}");
    }

    #[test]
    fn refuses() {
        let make = |p: &Pattern, n: usize, s: KktSettings| Kkt::new(p, n, Box::new(Columns::new()), s).err();
        let message = |e: Option<Error>| e.expect("an error").to_string();
        let ok = KktSettings::default();
        assert!(message(make(&Pattern::dense_upper(2), 3, ok.clone())).contains("3 primal"));
        let no_diag = Pattern::new(2, 2, vec![0, 1, 2], vec![0, 0]).unwrap();
        assert!(message(make(&no_diag, 1, ok.clone())).contains("column 1"));
        assert!(message(make(&Pattern::dense(2, 2), 1, ok.clone())).contains("below the diagonal"));
        let zero = KktSettings { static_shift: 0.0, ..ok.clone() };
        assert!(message(make(&Pattern::dense_upper(2), 1, zero)).contains("static_shift 0"));
        let nan = KktSettings { refine_tol: f64::NAN, ..ok.clone() };
        assert!(message(make(&Pattern::dense_upper(2), 1, nan)).contains("refine_tol"));
        // Nothing at all is legal.
        let mut k = Kkt::new(&Pattern::empty(0, 0), 0, Box::new(Columns::new()), ok).unwrap();
        k.equilibrate(&[]);
        assert_eq!(k.factor(&[], 0.0, 0.0), KktStatus::Ok);
        assert!(k.solve(&[], &mut []).ok);
    }
}
