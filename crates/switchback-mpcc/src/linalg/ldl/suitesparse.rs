//! SuiteSparse: AMD ordering (P. Amestoy, T. Davis, I. Duff) and the up-looking LDL' without pivoting
//! (T. Davis, "Algorithm 849: a concise sparse Cholesky factorization package", ACM TOMS 31, 2005).
//!
//! The matrix is permuted here, once per analysis, into the upper triangle of `P A P'` with a map of
//! values, so that LDL runs without its own permutation. This file holds the foreign calls, and they rely
//! on three facts only: the index arrays are built from a checked [`Pattern`] and fit `c_int`; the arrays
//! for L have the length that the symbolic analysis asked for; nothing is called before the analysis.

#![allow(unsafe_code)]

use super::ordering::{Ordering, Permuted};
use super::{check_upper, judge, take_over, Factorisation, LdlStats, SymmetricSolver};
use crate::error::{Error, Result};
use crate::linalg::csc::Pattern;
use crate::memory;
use std::ffi::c_int;
use std::ptr;

/// amd.h: the matrix is valid.
const AMD_OK: c_int = 0;
/// amd.h: valid, but columns were unsorted (does not happen with a checked pattern).
const AMD_OK_BUT_JUMBLED: c_int = 1;
/// amd.h: malloc failed or the problem is too large.
const AMD_OUT_OF_MEMORY: c_int = -1;

// ldl.h, amd.h of SuiteSparse 5 to 7, int version.
extern "C" {
    fn amd_order(
        n: c_int,
        ap: *const c_int,
        ai: *const c_int,
        p: *mut c_int,
        control: *mut f64,
        info: *mut f64,
    ) -> c_int;
    fn ldl_symbolic(
        n: c_int,
        ap: *const c_int,
        ai: *const c_int,
        lp: *mut c_int,
        parent: *mut c_int,
        lnz: *mut c_int,
        flag: *mut c_int,
        p: *const c_int,
        pinv: *mut c_int,
    );
    fn ldl_numeric(
        n: c_int,
        ap: *const c_int,
        ai: *const c_int,
        ax: *const f64,
        lp: *const c_int,
        parent: *const c_int,
        lnz: *mut c_int,
        li: *mut c_int,
        lx: *mut f64,
        d: *mut f64,
        y: *mut f64,
        pattern: *mut c_int,
        flag: *mut c_int,
        p: *const c_int,
        pinv: *const c_int,
    ) -> c_int;
    fn ldl_lsolve(n: c_int, x: *mut f64, lp: *const c_int, li: *const c_int, lx: *const f64);
    fn ldl_dsolve(n: c_int, x: *mut f64, d: *const f64);
    fn ldl_ltsolve(n: c_int, x: *mut f64, lp: *const c_int, li: *const c_int, lx: *const f64);
}

/// SuiteSparse LDL, with AMD unless another order is asked for; see the module documentation.
#[derive(Default)]
pub struct SuiteSparse {
    ordering: Ordering,
    n: usize,
    nnz_a: usize,
    flops: f64,
    analysed: bool,
    factored: bool,
    min_abs: f64,
    max_abs: f64,
    /// `perm[k]` is the row of A that is the `k`-th pivot.
    perm: Vec<usize>,
    /// Position `k` of `P A P'` takes the value `src[k]` of A.
    src: Vec<u32>,
    ap: Vec<c_int>,
    ai: Vec<c_int>,
    ax: Vec<f64>,
    lp: Vec<c_int>,
    li: Vec<c_int>,
    lx: Vec<f64>,
    parent: Vec<c_int>,
    lnz: Vec<c_int>,
    flag: Vec<c_int>,
    pattern: Vec<c_int>,
    d: Vec<f64>,
    work: Vec<f64>,
}

impl SuiteSparse {
    /// A solver without a structure; call [`SymmetricSolver::analyse`] next.
    pub fn new() -> SuiteSparse {
        SuiteSparse::default()
    }

    /// A solver that eliminates in this order.
    pub fn with_ordering(ordering: Ordering) -> SuiteSparse {
        SuiteSparse { ordering, ..SuiteSparse::default() }
    }
}

fn to_int(v: usize, what: &str) -> Result<c_int> {
    c_int::try_from(v).map_err(|_| {
        Error::Unsupported(format!(
            "suitesparse: {v} {what} do not fit the 32-bit index of LDL; split the problem or use a shorter horizon"
        ))
    })
}

/// Approximate minimum degree order of the symmetric matrix with this upper triangle: `order[k]` is the `k`-th pivot.
pub(super) fn amd(upper: &Pattern) -> Result<Vec<usize>> {
    let n = upper.n_cols();
    if n == 0 {
        return Ok(Vec::new());
    }
    let n_int = to_int(n, "rows")?;
    // AMD forms A + A' inside.
    to_int(2 * upper.nnz() + n, "entries")?;
    let up: Vec<c_int> = upper.col_ptr().iter().map(|&v| v as c_int).collect();
    let ui: Vec<c_int> = upper.row_idx().iter().map(|&v| v as c_int).collect();
    let mut order = vec![0 as c_int; n];
    // SAFETY: `up` (n + 1) and `ui` (up[n]) are a valid compressed-column matrix of order n with
    // sorted rows, `order` has length n; null control and info mean the defaults. An empty `ui` has a
    // non-null dangling pointer, which AMD only tests against null.
    let rc =
        unsafe { amd_order(n_int, up.as_ptr(), ui.as_ptr(), order.as_mut_ptr(), ptr::null_mut(), ptr::null_mut()) };
    match rc {
        AMD_OK | AMD_OK_BUT_JUMBLED => Ok(order.iter().map(|&v| v as usize).collect()),
        AMD_OUT_OF_MEMORY => Err(Error::Library(format!("suitesparse: AMD ran out of memory for {n} rows"))),
        rc => Err(Error::Library(format!("suitesparse: amd_order returned {rc} for {n} rows"))),
    }
}

impl SymmetricSolver for SuiteSparse {
    fn name(&self) -> &'static str {
        "suitesparse"
    }

    fn analyse(&mut self, upper: &Pattern) -> Result<()> {
        check_upper(upper)?;
        *self = SuiteSparse::with_ordering(std::mem::take(&mut self.ordering));
        let n = upper.n_cols();
        let nnz = upper.nnz();
        let n_int = to_int(n, "rows")?;
        to_int(nnz, "entries")?;
        if n == 0 {
            self.analysed = true;
            return Ok(());
        }
        let Permuted { order, upper: p, src } = Permuted::new(upper, self.ordering.order(upper)?);
        (self.perm, self.src) = (order, src);
        self.ap = p.col_ptr().iter().map(|&v| v as c_int).collect();
        self.ai = p.row_idx().iter().map(|&v| v as c_int).collect();
        self.ax = vec![0.0; nnz];

        self.lp = vec![0; n + 1];
        self.parent = vec![0; n];
        self.lnz = vec![0; n];
        self.flag = vec![0; n];
        // SAFETY: `ap`/`ai` as above; the outputs have the lengths that ldl.h asks for; P null means no
        // permutation, and then Pinv is not read.
        unsafe {
            ldl_symbolic(
                n_int,
                self.ap.as_ptr(),
                self.ai.as_ptr(),
                self.lp.as_mut_ptr(),
                self.parent.as_mut_ptr(),
                self.lnz.as_mut_ptr(),
                self.flag.as_mut_ptr(),
                ptr::null(),
                ptr::null_mut(),
            );
        }
        // `lp` is a running sum in c_int and may have wrapped: sum the column counts again.
        let nnz_l: usize = self.lnz.iter().map(|&v| v.max(0) as usize).sum();
        to_int(nnz_l, "entries of L")?;
        memory::need(12 * nnz_l as u128, || format!("the factorisation of {n} rows with {nnz_l} entries of L"))?;
        // One division for each entry of a column, a multiplication and an addition for each pair below.
        self.flops = self.lnz.iter().map(|&c| f64::from(c)).map(|c| c * (c + 2.0)).sum();
        self.li = vec![0; nnz_l];
        self.lx = vec![0.0; nnz_l];
        self.pattern = vec![0; n];
        self.d = vec![0.0; n];
        self.work = vec![0.0; n];
        self.n = n;
        self.nnz_a = nnz;
        self.analysed = true;
        Ok(())
    }

    fn factor(&mut self, values: &[f64]) -> Factorisation {
        assert!(self.analysed, "suitesparse: factor before analyse");
        assert_eq!(values.len(), self.nnz_a, "suitesparse: one value per entry of the analysed pattern");
        self.factored = false;
        (self.min_abs, self.max_abs) = (0.0, 0.0);
        if let Some(bad) = take_over(values, &self.src, &mut self.ax) {
            let col = self.ap.partition_point(|&p| p as usize <= bad) - 1;
            return Factorisation::Singular { pivot: self.perm[col] };
        }
        if self.n > 0 {
            // SAFETY: all arrays were sized in `analyse` for this structure and are not resized after it;
            // `li` and `lx` have lp[n] entries; `y`, `pattern`, `flag` are work space of length n. LDL clears
            // the entries of `y` and `lnz` that it uses.
            let done = unsafe {
                ldl_numeric(
                    self.n as c_int,
                    self.ap.as_ptr(),
                    self.ai.as_ptr(),
                    self.ax.as_ptr(),
                    self.lp.as_ptr(),
                    self.parent.as_ptr(),
                    self.lnz.as_mut_ptr(),
                    self.li.as_mut_ptr(),
                    self.lx.as_mut_ptr(),
                    self.d.as_mut_ptr(),
                    self.work.as_mut_ptr(),
                    self.pattern.as_mut_ptr(),
                    self.flag.as_mut_ptr(),
                    ptr::null(),
                    ptr::null(),
                )
            };
            if done as usize != self.n {
                return Factorisation::Singular { pivot: self.perm[done as usize] };
            }
        }
        let (inertia, range) = match judge(&self.d) {
            Ok(found) => found,
            Err(k) => return Factorisation::Singular { pivot: self.perm[k] },
        };
        [self.min_abs, self.max_abs] = range;
        self.factored = true;
        Factorisation::Ok(inertia)
    }

    fn solve(&mut self, rhs: &mut [f64]) {
        assert!(self.factored, "suitesparse: solve needs a successful factorisation");
        assert_eq!(rhs.len(), self.n, "suitesparse: one right-hand side value per row");
        if self.n == 0 {
            return;
        }
        for (w, &i) in self.work.iter_mut().zip(&self.perm) {
            *w = rhs[i];
        }
        let (n, x) = (self.n as c_int, self.work.as_mut_ptr());
        let (lp, li, lx) = (self.lp.as_ptr(), self.li.as_ptr(), self.lx.as_ptr());
        // SAFETY: L and D are complete since the last factorisation was successful; `work` has length n.
        unsafe {
            ldl_lsolve(n, x, lp, li, lx);
            ldl_dsolve(n, x, self.d.as_ptr());
            ldl_ltsolve(n, x, lp, li, lx);
        }
        for (&w, &i) in self.work.iter().zip(&self.perm) {
            rhs[i] = w;
        }
    }

    fn stats(&self) -> LdlStats {
        LdlStats {
            name: self.name(),
            n: self.n,
            nnz_a: self.nnz_a,
            nnz_l: self.li.len(),
            flops: self.flops,
            min_abs_pivot: self.min_abs,
            max_abs_pivot: self.max_abs,
        }
    }

    fn pivots(&self) -> (&[f64], &[usize]) {
        if self.factored {
            (&self.d, &self.perm)
        } else {
            (&[], &[])
        }
    }
}
