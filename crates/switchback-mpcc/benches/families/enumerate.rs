//! All branches of a program, one smooth program for each.

use switchback_mpcc::mpcc::simplex::{Found, Simplex};
use switchback_mpcc::mpcc::{Lifted, Mpcc, Side};
use switchback_mpcc::nlp::{within, Bounds, Control, Ipm, IpmSettings, Monotone, Nlp, Start};
use switchback_mpcc::random::SplitMix64;

use crate::program::Program;

pub type Lift = Lifted<Program>;

/// The least objective of all branches; infinite where none has a point.
pub fn enumerate(program: &Program, p: &mut Lift, b: &Bounds) -> f64 {
    let k = p.pairs().len();
    let (n, m) = (p.n(), p.m());
    let convex = program.has_linear_rows() && program.convex;
    let mut draw = SplitMix64::new(k as u64);
    let mut starts = vec![p.start(&program.x0)];
    if !convex {
        starts.extend((0..2).map(|_| {
            (0..n).map(|j| within(4.0 * draw.share() - 1.0, b.xl[j], b.xu[j].min(b.xl[j].max(-5.0) + 8.0))).collect()
        }));
    }
    let mut lp = program.has_linear_rows().then(|| linear_rows(p, &vec![0.0; n]));
    let mut ipm = Ipm::new(p, IpmSettings { max_iter: 200, ..IpmSettings::default() }).expect("a solver");
    let (mut best, mut branch, mut c) = (f64::INFINITY, b.clone(), vec![0.0; m]);
    for number in 0..1usize << k {
        let side = |i: usize| if number >> i & 1 == 0 { Side::First } else { Side::Second };
        let sides: Vec<Side> = (0..k).map(side).collect();
        branch.copy_from(b);
        p.branch(&sides, &mut branch);
        if let Some((lp, constants)) = &mut lp {
            (0..n).for_each(|j| lp.bound(j, branch.xl[j], branch.xu[j]));
            (0..m).for_each(|i| lp.bound(n + i, branch.cl[i] - constants[i], branch.cu[i] - constants[i]));
            if lp.feasible(&|| true) == Found::Infeasible {
                continue;
            }
        }
        for start in &starts {
            let mut rule = Monotone { mu_init: 0.1, tol: 1e-8, primal_tol: 1e-9 };
            ipm.solve(p, &branch, Start::Cold(start), &mut rule, &mut Control::default());
            let x = &ipm.iterate().x;
            let f = p.eval(x, &mut c).unwrap_or(f64::INFINITY);
            if f < best && holds(x, &c, &branch, 1e-7) {
                best = f;
            }
        }
    }
    best
}

/// Rows of the Jacobian at `x` as those of a linear program, and what they are at zero.
pub fn linear_rows(p: &mut Lift, x: &[f64]) -> (Simplex, Vec<f64>) {
    let (n, m) = (p.n(), p.m());
    let (mut c, mut grad, mut jac) = (vec![0.0; m], vec![0.0; n], vec![0.0; p.jac_pattern().nnz()]);
    p.eval(x, &mut c).expect("values");
    p.derivatives(x, &mut grad, &mut jac).expect("derivatives");
    let mut rows = vec![0.0; m * n];
    for j in 0..n {
        for k in p.jac_pattern().range(j) {
            let i = p.jac_pattern().row_idx()[k];
            rows[i * n + j] += jac[k];
            c[i] -= jac[k] * x[j];
        }
    }
    (Simplex::new(n, m, rows), c)
}

pub fn holds(x: &[f64], c: &[f64], b: &Bounds, tol: f64) -> bool {
    let within = |v: f64, lo: f64, hi: f64| v >= lo - tol * lo.abs().max(1.0) && v <= hi + tol * hi.abs().max(1.0);
    (0..x.len()).all(|j| within(x[j], b.xl[j], b.xu[j])) && (0..c.len()).all(|i| within(c[i], b.cl[i], b.cu[i]))
}
