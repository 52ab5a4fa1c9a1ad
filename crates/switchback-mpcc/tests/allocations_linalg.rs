//! Scaling, factorisation and solution allocate nothing after the analysis.

use switchback_mpcc::linalg::csc::Pattern;
use switchback_mpcc::linalg::kkt::{Kkt, KktSettings, KktStatus};
use switchback_mpcc::linalg::ldl::{solver, Ordering, SymmetricSolver};
use switchback_mpcc::memory::allocations as count;
use switchback_mpcc::settings::LinearSolver;

#[test]
fn no_allocation_after_new() {
    no_allocation(solver(LinearSolver::Suitesparse, Ordering::Amd).unwrap());
}

fn no_allocation(backend: Box<dyn SymmetricSolver>) {
    let (n, m) = (40, 25);
    let (mut rows, mut cols): (Vec<usize>, Vec<usize>) = ((0..n + m).collect(), (0..n + m).collect());
    for j in 0..m {
        for i in [j, j + 3, j + 9] {
            rows.push(i);
            cols.push(n + j);
        }
    }
    let (p, map) = Pattern::from_triplets(n + m, n + m, &rows, &cols);
    let mut v = vec![0.0; p.nnz()];
    for (k, &pos) in map.iter().enumerate() {
        v[pos] = if rows[k] != cols[k] { 1.0 + k as f64 } else { f64::from(rows[k] < n) };
    }
    let mut kkt = Kkt::new(&p, n, backend, KktSettings::default()).unwrap();
    let (rhs, mut sol) = (vec![1.0; n + m], vec![0.0; n + m]);
    let nan = vec![f64::NAN; p.nnz()];
    let indefinite: Vec<f64> = v.iter().map(|a| -a).collect();
    assert!(count() > 0, "the counter must count");

    let before = count();
    for round in 0..3 {
        kkt.equilibrate(&v);
        let good = kkt.factor(&v, 1e-4 * f64::from(round), 1e-9);
        let solve = kkt.solve(&rhs, &mut sol);
        let bad = kkt.factor(&nan, 0.0, 0.0);
        let wrong = kkt.factor(&indefinite, 0.0, 0.0);
        let _ = kkt.stats();
        assert!(good == KktStatus::Ok && bad == KktStatus::Singular && wrong != KktStatus::Ok && solve.ok);
    }
    assert_eq!(count(), before);
}
