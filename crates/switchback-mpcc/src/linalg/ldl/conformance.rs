//! One suite for every backend of [`SymmetricSolver`].

#![allow(clippy::needless_range_loop)]

use super::Ordering;
#[cfg(feature = "suitesparse")]
use super::SuiteSparse;
use super::{Auto, Dense, Factorisation, Inertia, Native, SymmetricSolver};
#[cfg(feature = "faer")]
use super::{Faer, Form};
use crate::error::Error;
use crate::linalg::csc::{mul_add_symmetric_upper, Pattern};

/// Deterministic numbers in [-1, 1) (xorshift64*, S. Vigna).
struct Rng(u64);

impl Rng {
    fn unit(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let v = self.0.wrapping_mul(0x2545_f491_4f6c_dd1d);
        (v >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn below(&mut self, n: usize) -> usize {
        (((self.unit() + 1.0) / 2.0) * n as f64) as usize % n
    }
}

/// A quasidefinite KKT matrix: `n` primal rows with a positive, `m` dual rows with a negative diagonal,
/// sparse coupling of any size. Inertia (n, m).
fn random_kkt(rng: &mut Rng, n: usize, m: usize) -> (Pattern, Vec<f64>) {
    let (mut rows, mut cols, mut t) = (Vec::new(), Vec::new(), Vec::new());
    for j in 0..n + m {
        rows.push(j);
        cols.push(j);
        t.push(if j < n { 1.0 } else { -1e-2 } * (1.5 + rng.unit()));
    }
    for j in n..n + m {
        for _ in 0..3.min(n) {
            rows.push(rng.below(n));
            cols.push(j);
            t.push(3.0 * rng.unit());
        }
    }
    let (p, map) = Pattern::from_triplets(n + m, n + m, &rows, &cols);
    let mut v = vec![0.0; p.nnz()];
    for (k, &pos) in map.iter().enumerate() {
        v[pos] += t[k];
    }
    (p, v)
}

fn residual(p: &Pattern, v: &[f64], x: &[f64], b: &[f64]) -> f64 {
    let mut r = b.to_vec();
    mul_add_symmetric_upper(p, v, x, &mut r, -1.0);
    r.iter().fold(0.0, |m: f64, a| m.max(a.abs()))
}

fn inertia(f: Factorisation) -> Inertia {
    match f {
        Factorisation::Ok(i) => i,
        f => panic!("{f:?}"),
    }
}

fn diagonal(n: usize) -> Pattern {
    Pattern::new(n, n, (0..=n).collect(), (0..n).collect()).unwrap()
}

type Make = fn() -> Box<dyn SymmetricSolver>;

fn random_systems(make: Make) {
    let mut rng = Rng(7);
    for (n, m) in [(1, 0), (1, 1), (5, 3), (20, 12), (40, 40), (60, 10)] {
        let (p, v) = random_kkt(&mut rng, n, m);
        let mut s = make();
        s.analyse(&p).unwrap();
        assert_eq!(inertia(s.factor(&v)), Inertia { positive: n, negative: m, zero: 0 });
        let b: Vec<f64> = (0..n + m).map(|_| rng.unit()).collect();
        let mut x = b.clone();
        s.solve(&mut x);
        assert!(residual(&p, &v, &x, &b) < 1e-10, "{} {n} {m}", s.name());
        let mut reference = Dense::new();
        reference.analyse(&p).unwrap();
        inertia(reference.factor(&v));
        let mut y = b.clone();
        reference.solve(&mut y);
        for (a, b) in x.iter().zip(&y) {
            assert!((a - b).abs() < 1e-8 * (1.0 + b.abs()), "{} {n} {m}: {a} {b}", s.name());
        }
        let st = s.stats();
        assert_eq!((st.name, st.n, st.nnz_a), (s.name(), n + m, p.nnz()));
        assert!(st.min_abs_pivot > 0.0 && st.min_abs_pivot <= st.max_abs_pivot);
    }
}

/// Diagonally dominant with diagonal signs at random: the inertia is the count of the signs.
fn counts_inertia(make: Make) {
    let mut rng = Rng(99);
    for _ in 0..20 {
        let n = 3 + rng.below(30);
        let p = Pattern::dense_upper(n);
        let mut positive = 0;
        let mut v = vec![0.0; p.nnz()];
        for j in 0..n {
            for k in p.range(j) {
                v[k] = rng.unit();
            }
            let up = rng.unit() > 0.0;
            positive += usize::from(up);
            v[p.get(j, j).unwrap()] = if up { 1.0 } else { -1.0 } * (n as f64 + 1.0);
        }
        let mut s = make();
        s.analyse(&p).unwrap();
        assert_eq!(inertia(s.factor(&v)), Inertia { positive, negative: n - positive, zero: 0 });
    }
}

/// The values are in the order of the pattern whatever the ordering does: solve against an arrow matrix
/// whose fill-reducing order reverses it, with a different value in each entry.
fn permutation(make: Make) {
    let n = 12;
    let mut rows = vec![0; n];
    let mut cols: Vec<usize> = (0..n).collect();
    rows.extend(1..n);
    cols.extend(1..n);
    let (p, map) = Pattern::from_triplets(n, n, &rows, &cols);
    let mut v = vec![0.0; p.nnz()];
    for (k, &pos) in map.iter().enumerate() {
        v[pos] = if rows[k] == cols[k] { 10.0 + k as f64 } else { 0.1 * k as f64 };
    }
    v[0] = 100.0;
    let mut s = make();
    s.analyse(&p).unwrap();
    assert_eq!(inertia(s.factor(&v)).positive, n);
    for i in 0..n {
        // Column i of A as the right-hand side gives the unit vector i.
        let mut e = vec![0.0; n];
        e[i] = 1.0;
        let mut x = vec![0.0; n];
        mul_add_symmetric_upper(&p, &v, &e, &mut x, 1.0);
        s.solve(&mut x);
        for (j, (&a, &b)) in x.iter().zip(&e).enumerate() {
            assert!((a - b).abs() < 1e-14, "{} column {i} row {j}: {a}", s.name());
        }
    }
}

fn singular(make: Make) {
    // An exactly zero row.
    let p = Pattern::dense_upper(3);
    let mut s = make();
    s.analyse(&p).unwrap();
    let zero_row = [2.0, 0.0, 0.0, 1.0, 0.0, 3.0];
    assert_eq!(s.factor(&zero_row), Factorisation::Singular { pivot: 1 });
    assert_eq!(s.stats().min_abs_pivot, 0.0);
    // Rank one.
    assert!(matches!(s.factor(&[1.0; 6]), Factorisation::Singular { .. }));
    // An empty column is a zero row too.
    let q = Pattern::new(2, 2, vec![0, 1, 1], vec![0]).unwrap();
    s.analyse(&q).unwrap();
    assert_eq!(s.factor(&[1.0]), Factorisation::Singular { pivot: 1 });
}

/// NaN and infinity are named by their column, and leave nothing behind.
fn not_finite(make: Make) {
    let mut rng = Rng(3);
    let (p, v) = random_kkt(&mut rng, 8, 4);
    let mut s = make();
    s.analyse(&p).unwrap();
    let b: Vec<f64> = (0..12).map(|_| rng.unit()).collect();
    inertia(s.factor(&v));
    let mut x = b.clone();
    s.solve(&mut x);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for k in 0..p.nnz() {
            let mut w = v.clone();
            w[k] = bad;
            let Factorisation::Singular { pivot } = s.factor(&w) else { panic!("{} accepts {bad}", s.name()) };
            assert!(pivot < 12);
        }
    }
    inertia(s.factor(&v));
    let mut y = b.clone();
    s.solve(&mut y);
    assert_eq!(x, y);
    // Overflow inside the factorisation: finite values, a product beyond the range.
    let p = Pattern::dense_upper(2);
    s.analyse(&p).unwrap();
    assert!(matches!(s.factor(&[1e-300, 1e300, 1.0]), Factorisation::Singular { .. }) || bears_small_pivots(&*s));
}

fn bears_small_pivots(s: &dyn SymmetricSolver) -> bool {
    ["dense", "faer pivoted"].contains(&s.name())
}

fn reuse(make: Make) {
    let mut rng = Rng(5);
    let (p, v) = random_kkt(&mut rng, 15, 9);
    let mut s = make();
    s.analyse(&p).unwrap();
    for round in 1..6 {
        let w: Vec<f64> = v.iter().map(|a| a * f64::from(round)).collect();
        assert_eq!(inertia(s.factor(&w)).positive, 15);
        let b: Vec<f64> = (0..24).map(|_| rng.unit()).collect();
        for _ in 0..2 {
            let mut x = b.clone();
            s.solve(&mut x);
            assert!(residual(&p, &w, &x, &b) < 1e-10);
        }
        // A breakdown in between.
        assert!(matches!(s.factor(&vec![0.0; p.nnz()]), Factorisation::Singular { .. }));
    }
    // Another structure in the same object.
    let (p, v) = random_kkt(&mut rng, 4, 2);
    s.analyse(&p).unwrap();
    assert_eq!(inertia(s.factor(&v)), Inertia { positive: 4, negative: 2, zero: 0 });
    let mut x = vec![1.0; 6];
    s.solve(&mut x);
    assert!(residual(&p, &v, &x, &[1.0; 6]) < 1e-12);
}

fn small(make: Make) {
    let mut s = make();
    s.analyse(&Pattern::empty(0, 0)).unwrap();
    assert_eq!(s.factor(&[]), Factorisation::Ok(Inertia::default()));
    s.solve(&mut []);
    assert_eq!((s.stats().n, s.stats().nnz_l), (0, 0));
    s.analyse(&diagonal(1)).unwrap();
    assert_eq!(inertia(s.factor(&[-4.0])), Inertia { positive: 0, negative: 1, zero: 0 });
    let mut x = [2.0];
    s.solve(&mut x);
    assert_eq!(x, [-0.5]);
    assert_eq!((s.stats().min_abs_pivot, s.stats().max_abs_pivot), (4.0, 4.0));
    assert_eq!(s.factor(&[0.0]), Factorisation::Singular { pivot: 0 });
    // No entry at all.
    s.analyse(&Pattern::empty(3, 3)).unwrap();
    assert!(matches!(s.factor(&[]), Factorisation::Singular { .. }));
}

fn refuses(make: Make) {
    let mut s = make();
    assert!(matches!(s.analyse(&Pattern::empty(2, 3)), Err(Error::Dimension(_))));
    match s.analyse(&Pattern::dense(3, 3)) {
        Err(Error::Dimension(m)) => assert!(m.contains("column 0"), "{m}"),
        r => panic!("{r:?}"),
    }
}

fn same_bits(make: Make) {
    let mut rng = Rng(11);
    let (p, v) = random_kkt(&mut rng, 50, 30);
    let b: Vec<f64> = (0..80).map(|_| rng.unit()).collect();
    let run = |s: &mut Box<dyn SymmetricSolver>| {
        s.analyse(&p).unwrap();
        s.factor(&v);
        let mut x = b.clone();
        s.solve(&mut x);
        x.iter().map(|a| a.to_bits()).collect::<Vec<_>>()
    };
    let mut s = make();
    let first = run(&mut s);
    assert_eq!(first, run(&mut s));
    assert_eq!(first, run(&mut make()));
}

fn pivots(make: Make) {
    let mut rng = Rng(13);
    let (p, v) = random_kkt(&mut rng, 20, 10);
    let mut s = make();
    s.analyse(&p).unwrap();
    s.factor(&v);
    let (d, order) = s.pivots();
    if d.is_empty() {
        return;
    }
    let mut seen = order.to_vec();
    seen.sort_unstable();
    assert_eq!(seen, (0..30).collect::<Vec<_>>());
    // Quasidefinite: the sign of every pivot is that of its row, in every order.
    assert!(d.iter().zip(order).all(|(&d, &row)| (d > 0.0) == (row < 20)));
    s.factor(&vec![0.0; p.nnz()]);
    assert!(s.pivots().0.is_empty());
}

macro_rules! suite {
    ($backend:ident, $make:expr, $($test:ident),*) => {
        mod $backend {
            use super::*;
            $(#[test]
            fn $test() {
                super::$test(|| Box::new($make));
            })*
        }
    };
}

macro_rules! conformance {
    ($backend:ident, $make:expr) => {
        suite!(
            $backend,
            $make,
            random_systems,
            counts_inertia,
            permutation,
            singular,
            not_finite,
            reuse,
            small,
            refuses,
            same_bits,
            pivots
        );
    };
}

#[cfg(feature = "suitesparse")]
conformance!(suitesparse, SuiteSparse::new());
conformance!(native, Native::new());
conformance!(native_natural, Native::with_ordering(Ordering::Natural));
conformance!(dense, Dense::new());
conformance!(auto, Auto::new(Ordering::Amd));
#[cfg(feature = "faer")]
conformance!(faer_simplicial, Faer::new(Form::Simplicial, Ordering::Amd));
#[cfg(feature = "faer")]
conformance!(faer_supernodal, Faer::new(Form::Supernodal, Ordering::Amd));
#[cfg(feature = "faer")]
conformance!(faer_pivoted, Faer::new(Form::Pivoted, Ordering::Amd));
#[cfg(feature = "suitesparse")]
conformance!(suitesparse_natural, SuiteSparse::with_ordering(Ordering::Natural));

/// Both have the same order, the same structure of L, and do the same operations one after the other: they differ by no more than a
/// compiler that joins products and sums makes of them.
#[cfg(feature = "suitesparse")]
#[test]
fn native_is_suitesparse() {
    let mut rng = Rng(17);
    for round in 0..60 {
        let (n, m) = (1 + rng.below(150), rng.below(100));
        let (p, v) = random_kkt(&mut rng, n, m);
        let b: Vec<f64> = (0..n + m).map(|_| rng.unit()).collect();
        let ordering = if round % 3 == 0 { Ordering::Natural } else { Ordering::Amd };
        let mut theirs = SuiteSparse::with_ordering(ordering.clone());
        let mut ours = Native::with_ordering(ordering);
        theirs.analyse(&p).unwrap();
        ours.analyse(&p).unwrap();
        assert_eq!(theirs.factor(&v), ours.factor(&v));
        let (st, so) = (theirs.stats(), ours.stats());
        assert_eq!((st.nnz_l, st.flops), (so.nnz_l, so.flops));
        // Entries of x carry the errors of n eliminations, enlarged by the condition of the pivots at most.
        let scale = (n + m) as f64 * f64::EPSILON * st.max_abs_pivot / st.min_abs_pivot;
        let (d, order) = theirs.pivots();
        assert_eq!(order, ours.pivots().1);
        assert!(d.iter().zip(ours.pivots().0).all(|(a, b)| (a - b).abs() <= scale * a.abs()));
        let (mut x, mut y) = (b.clone(), b);
        theirs.solve(&mut x);
        ours.solve(&mut y);
        let largest = x.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        assert!(x.iter().zip(&y).all(|(a, b)| (a - b).abs() <= scale * largest));
        if cfg!(target_arch = "x86_64") {
            // no compiler joins there
            assert_eq!(x, y);
        }
    }
}

/// Structures of all kinds: sparse, with full rows, with empty ones, without diagonals.
#[cfg(feature = "suitesparse")]
#[test]
fn orders_are_those_of_suitesparse() {
    let mut rng = Rng(23);
    for round in 0..400 {
        let n = 1 + rng.below(if round % 20 == 0 { 1000 } else { 60 });
        let (mut rows, mut cols) = (Vec::new(), Vec::new());
        let mut add = |i: usize, j: usize| {
            rows.push(i.min(j));
            cols.push(i.max(j));
        };
        for _ in 0..rng.below(5) * n {
            add(rng.below(n), rng.below(n));
        }
        for _ in 0..rng.below(3) {
            let full = rng.below(n);
            (0..n).for_each(|i| add(i, full));
        }
        if rng.unit() > 0.0 {
            (0..n).for_each(|i| add(i, i));
        }
        let (p, _) = Pattern::from_triplets(n, n, &rows, &cols);
        assert_eq!(super::suitesparse::amd(&p).unwrap(), super::native::amd(&p).unwrap(), "{n} rows, round {round}");
    }
}
