//! Points whose type is known by hand, and random linearised problems against the enumeration of all pieces.

use super::{BStationarity as B, CertSettings, Certificate, Certifier, Doubt, Local, Side, Stationarity as T};
use crate::linalg::csc::{mul_add_transposed, Pattern};
use crate::nlp::{Bounds, Control};
use crate::stop::Stop;

/// A point with dense rows.
#[derive(Clone)]
struct Point {
    x: Vec<f64>,
    c: Vec<f64>,
    grad: Vec<f64>,
    rows: Vec<Vec<f64>>,
    bounds: Bounds,
    pairs: Vec<(usize, usize)>,
    y: Vec<f64>,
    z: Vec<f64>,
}

impl Point {
    /// The origin, with the gradient given; members of pairs are bounded, everything else is free.
    fn origin(grad: &[f64], pairs: &[(usize, usize)]) -> Point {
        let n = grad.len();
        let mut bounds = Bounds::free(n, 0);
        for &(a, b) in pairs {
            bounds.xl[a] = 0.0;
            bounds.xl[b] = 0.0;
        }
        Point {
            x: vec![0.0; n],
            c: vec![],
            grad: grad.to_vec(),
            rows: vec![],
            bounds,
            pairs: pairs.to_vec(),
            y: vec![],
            z: vec![],
        }
    }

    /// Adds a row with value zero.
    fn row(mut self, gradient: &[f64], lower: f64, upper: f64) -> Point {
        self.rows.push(gradient.to_vec());
        self.c.push(0.0);
        self.bounds.cl.push(lower);
        self.bounds.cu.push(upper);
        self
    }

    fn lower(mut self, j: usize, lower: f64) -> Point {
        self.bounds.xl[j] = lower;
        self
    }

    fn upper(mut self, j: usize, upper: f64) -> Point {
        self.bounds.xu[j] = upper;
        self
    }

    fn multipliers(mut self, y: &[f64], z: &[f64]) -> Point {
        self.y = y.to_vec();
        self.z = z.to_vec();
        self
    }

    fn certify(&self, settings: &CertSettings) -> (Certificate, Certifier) {
        let (m, n) = (self.c.len(), self.x.len());
        let jac = Pattern::dense(m, n);
        let values: Vec<f64> = (0..n).flat_map(|j| self.rows.iter().map(move |r| r[j])).collect();
        let mut certifier = Certifier::new(&jac, &self.pairs).unwrap();
        let local = Local {
            x: &self.x,
            c: &self.c,
            grad: &self.grad,
            jac: &jac,
            jac_values: &values,
            bounds: &self.bounds,
            pairs: &self.pairs,
            y: &self.y,
            z: &self.z,
        };
        let cert = certifier.certify(&local, settings, &mut Control::default());
        self.check_claims(&cert, &certifier);
        (cert, certifier)
    }

    /// What is claimed comes with a proof: multipliers, or a descent.
    fn check_claims(&self, cert: &Certificate, certifier: &Certifier) {
        assert!(cert.b != B::No || certifier.descent().is_some());
        assert!(certifier.descent().is_none() || cert.b == B::No || cert.doubt == Doubt::Accuracy);
        if let Some((d, sides)) = certifier.descent() {
            let steepest = self.grad.iter().fold(0f64, |a, g| a.max(g.abs()));
            assert!(dot(&self.grad, d) < -1e-9 * steepest.min(1.0), "{d:?}");
            for (j, &d) in d.iter().enumerate() {
                let t = self.x[j] + d;
                assert!(t >= self.bounds.xl[j] && t <= self.bounds.xu[j] + 1e-12, "{j}: {t}");
            }
            for (i, row) in self.rows.iter().enumerate() {
                let t = self.c[i] + dot(row, d);
                assert!(t >= self.bounds.cl[i] - 1e-7 && t <= self.bounds.cu[i] + 1e-7, "row {i}: {t}");
            }
            for (&(a, b), side) in self.pairs.iter().zip(sides) {
                let zero = if *side == Side::First { a } else { b };
                assert!(d[zero] <= 1e-12);
            }
        }
        if (cert.stationarity as i32) < T::None as i32 {
            let (y, z) = certifier.multipliers();
            let largest = y.iter().chain(z).fold(1f64, |a, v| a.max(v.abs()));
            for j in 0..self.grad.len() {
                let rows: f64 = self.rows.iter().zip(y).map(|(r, y)| r[j] * y).sum();
                assert!((self.grad[j] + rows - z[j]).abs() <= 1e-6 * largest, "variable {j}");
            }
        }
    }

    /// Type, B-stationarity, and that no better type exists.
    fn expect(&self, kind: T, b: B) -> Certificate {
        self.expect_to(CertSettings::default().rounding, kind, b)
    }

    /// The same with gradients that are known to `rounding`.
    fn expect_to(&self, rounding: f64, kind: T, b: B) -> Certificate {
        let (cert, _) = self.certify(&CertSettings { rounding, ..CertSettings::default() });
        assert_eq!((cert.stationarity, cert.b, cert.sharp, cert.doubt), (kind, b, true, Doubt::None), "{cert:?}");
        cert
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

const INF: f64 = f64::INFINITY;

#[test]
fn one_pair_has_the_type_of_its_signs() {
    for (grad, kind, b) in [
        ([1.0, 2.0], T::S, B::Yes),
        ([0.0, 2.0], T::S, B::Yes),
        ([-2.0, 0.0], T::M, B::No),
        ([-1.0, -1.0], T::C, B::No),
        ([1.0, -1.0], T::A, B::No),
        ([-1e-2, 1e4], T::A, B::No),
    ] {
        let p = Point::origin(&grad, &[(0, 1)]);
        let cert = p.expect(kind, b);
        assert_eq!(cert.biactive, 1);
        let with = p.multipliers(&[], &grad).expect(kind, b);
        assert_eq!(with.stationarity, cert.stationarity);
        let largest = grad.iter().fold(1f64, |a, g| a.max(g.abs()));
        assert!((with.min_multiplier - grad[0].min(grad[1]) / largest).abs() < 1e-12);
        assert_eq!(with.ulsc, grad[0] != 0.0 && grad[1] != 0.0);
        if kind == T::S {
            assert_eq!(with.lps, 0);
        }
    }
}

/// One pair is A-stationary alone, the other C-stationary alone.
#[test]
fn pairs_of_different_types_leave_weak_stationarity() {
    Point::origin(&[1.0, -1.0, -1.0, -1.0], &[(0, 1), (2, 3)]).expect(T::W, B::No);
}

/// Scheel and Scholtes 2000, example 3: the global minimum is no KKT point.
#[test]
fn global_minimum_without_strong_stationarity() {
    let p =
        Point::origin(&[1.0, 1.0, -1.0], &[(0, 1)]).row(&[4.0, 0.0, -1.0], 0.0, INF).row(&[0.0, 4.0, -1.0], 0.0, INF);
    let cert = p.expect(T::M, B::Yes);
    assert!(cert.nodes >= 3 && cert.lps >= 3 && cert.lp_iterations > 0);
    assert!(p.certify(&CertSettings::default()).1.biactive().eq([0]));
}

/// Ralph and Wright, problem ralph1 of MacMPEC: `min 2x − y, 0 ≤ y ⊥ y − x ≥ 0, x ≥ 0`, the second member lifted.
fn ralph1() -> Point {
    Point::origin(&[2.0, -1.0, 0.0], &[(1, 2)]).row(&[-1.0, 1.0, -1.0], 0.0, 0.0).lower(0, 0.0)
}

#[test]
fn ralph1_is_b_stationary_and_not_s_stationary() {
    ralph1().expect(T::M, B::Yes);
    // the multipliers of a branch
    let cert = ralph1().multipliers(&[0.5], &[1.5, -0.5, -0.5]).expect(T::M, B::Yes);
    assert!(cert.min_multiplier <= 0.0);
}

/// Pairs with positive multipliers beside ralph1 take no part in its proof, whatever the order of the decisions. A free
/// variable ties all of them together.
#[test]
fn decisions_a_proof_does_not_rest_on_are_skipped() {
    let mut grad = vec![2.0, -1.0, 0.0];
    let mut pairs = vec![(1, 2)];
    for k in 0..8 {
        grad.extend([1.0 + k as f64, 0.1]);
        pairs.push((3 + 2 * k, 4 + 2 * k));
    }
    grad.push(0.0);
    let mut row = vec![0.0; grad.len()];
    row[..3].copy_from_slice(&[-1.0, 1.0, -1.0]);
    let tie = vec![1.0; grad.len()];
    let p = Point::origin(&grad, &pairs).row(&row, 0.0, 0.0).row(&tie, 0.0, 0.0).lower(0, 0.0);
    let cert = p.expect(T::M, B::Yes);
    assert!(cert.nodes <= 12, "{cert:?}");
}

/// Ten copies of ralph1 with nothing in common have 1024 branches, and are looked at one by one.
#[test]
fn parts_with_nothing_in_common_are_searched_one_by_one() {
    let copies = 10;
    let mut grad = vec![];
    let mut pairs = vec![];
    for k in 0..copies {
        grad.extend([2.0 + k as f64, -1.0, 0.0]);
        pairs.push((3 * k + 1, 3 * k + 2));
    }
    let build = |grad: &[f64]| {
        let mut p = Point::origin(grad, &pairs);
        for k in 0..copies {
            let mut row = vec![0.0; grad.len()];
            row[3 * k..3 * k + 3].copy_from_slice(&[-1.0, 1.0, -1.0]);
            p = p.row(&row, 0.0, 0.0).lower(3 * k, 0.0);
        }
        p
    };
    let cert = build(&grad).expect(T::M, B::Yes);
    assert!(cert.nodes <= 60, "{cert:?}");
    grad[3 * 6] = 0.5;
    let (cert, certifier) = build(&grad).certify(&CertSettings::default());
    assert_eq!(cert.b, B::No);
    assert!(certifier.descent().is_some_and(|(d, _)| d[3 * 6] > 1e-3));
}

#[test]
fn node_limits_leave_the_question_open() {
    let (cert, _) = ralph1().certify(&CertSettings { max_nodes: 1, type_nodes: 1, ..CertSettings::default() });
    assert_eq!((cert.b, cert.doubt), (B::Undecided, Doubt::Nodes));
    assert!(!cert.sharp);
    let (cert, _) = ralph1().certify(&CertSettings { type_nodes: 0, ..CertSettings::default() });
    assert_eq!((cert.stationarity, cert.b, cert.doubt), (T::Unknown, B::Yes, Doubt::None));
}

/// ralph2 at the origin: `min x² + y² − 4xy, 0 ≤ x ⊥ y ≥ 0` has no gradient there.
#[test]
fn zero_gradient_is_strongly_stationary() {
    let cert = Point::origin(&[0.0, 0.0], &[(0, 1)]).expect(T::S, B::Yes);
    assert_eq!((cert.lps, cert.ulsc), (0, false));
}

/// Without biactive pairs all types are one; multipliers of the zero members have no sign.
#[test]
fn strict_complementarity_needs_no_program() {
    let mut p = Point::origin(&[0.0, -1.0], &[(0, 1)]);
    p.x[0] = 1.0;
    let cert = p.clone().multipliers(&[], &[0.0, -1.0]).expect(T::S, B::Yes);
    assert_eq!((cert.lps, cert.biactive), (0, 0));
    assert!(p.expect(T::S, B::Yes).lps >= 1, "without multipliers one program finds them");
    // a point that is not stationary at all
    p.grad[0] = 0.1;
    p.expect(T::None, B::No);
}

/// `x₁ + x₂ ≥ 0` follows from the bounds: the multipliers are not unique, and the ones given hide the best type.
#[test]
fn better_multipliers_are_found_where_they_are_not_unique() {
    let p = Point::origin(&[1.0, 1.0], &[(0, 1)]).row(&[1.0, 1.0], 0.0, INF).multipliers(&[-2.0], &[-1.0, -1.0]);
    let cert = p.expect(T::S, B::Yes);
    assert!(cert.lps >= 1 && cert.min_multiplier > -1e-6);
}

/// A member that an upper bound or another pair holds at zero does not constrain its partner.
#[test]
fn pinned_members_have_free_multipliers() {
    Point::origin(&[-5.0, 1.0], &[(0, 1)]).upper(0, 0.0).expect(T::S, B::Yes);
    Point::origin(&[5.0, -1.0], &[(0, 1)]).upper(0, 0.0).expect(T::M, B::No);
    let mut p = Point::origin(&[-5.0, 1.0, 0.0], &[(0, 1), (0, 2)]);
    p.x[2] = 3.0;
    p.expect(T::S, B::Yes);
}

/// Two pairs with a common member: its multiplier is the sum of two.
#[test]
fn shared_members_split_their_multiplier() {
    let pairs = [(0, 1), (0, 2)];
    for (grad, kind, b) in [
        ([1.0, 1.0, 1.0], T::S, B::Yes),
        ([1.0, 1.0, -1.0], T::M, B::No),
        ([-1.0, -1.0, 1.0], T::C, B::No),
        ([-1.0, 1.0, 1.0], T::A, B::No),
    ] {
        let p = Point::origin(&grad, &pairs);
        p.expect(kind, b);
        p.multipliers(&[], &grad).expect(kind, b);
    }
}

/// A gradient of 1e-6 is as good as one of 1: what descends is no S-stationary point.
#[test]
fn tolerances_are_relative_to_the_gradient() {
    for scale in [1e-6, 1e-3, 1.0, 1e6] {
        let p = Point::origin(&[1.0 * scale, -0.05 * scale], &[(0, 1)]);
        p.expect(T::A, B::No);
        p.multipliers(&[], &[1.0 * scale, -0.05 * scale]).expect(T::A, B::No);
    }
}

/// Pairs whose members are all small are not biactive for that; a member that may be zero has to show nothing.
#[test]
fn members_are_compared_with_the_largest_one() {
    let small = |x: [f64; 4], z: [f64; 4]| {
        let mut p = Point::origin(&z, &[(0, 1), (2, 3)]);
        p.x.copy_from_slice(&x);
        p.multipliers(&[], &z).certify(&CertSettings::default()).0
    };
    let cert = small([0.0, 2e-6, 3e-6, 0.0], [-1.0, 0.0, 0.0, -1.0]);
    assert_eq!((cert.biactive, cert.stationarity, cert.b), (0, T::S, B::Yes));
    // beside a member of size 1 the other one may be zero: the multiplier of its partner has to be none
    let open = |z: [f64; 4]| {
        let mut p = Point::origin(&z, &[(0, 1), (2, 3)]);
        p.x.copy_from_slice(&[0.0, 5e-7, 1.0, 0.0]);
        p.certify(&CertSettings::default()).0
    };
    let cert = open([-1.0, 0.0, 0.0, 1.0]);
    assert_eq!((cert.b, cert.doubt), (B::Undecided, Doubt::Accuracy));
    let cert = open([1.0, 0.0, 0.0, 1.0]);
    assert_eq!((cert.biactive, cert.b), (1, B::Yes));
}

#[test]
fn bad_data_give_no_claims() {
    let good = Point::origin(&[1.0, 1.0], &[(0, 1)]).row(&[1.0, 1.0], 0.0, INF);
    let bad = |change: &dyn Fn(&mut Point)| {
        let mut p = good.clone();
        change(&mut p);
        let (cert, _) = p.certify(&CertSettings::default());
        assert_eq!((cert.stationarity, cert.b), (T::Unknown, B::Undecided));
        cert.doubt
    };
    assert_eq!(bad(&|p| p.x[0] = f64::NAN), Doubt::Data);
    assert_eq!(bad(&|p| p.grad[1] = f64::INFINITY), Doubt::Data);
    assert_eq!(bad(&|p| p.rows[0][1] = f64::NAN), Doubt::Data);
    assert_eq!(bad(&|p| p.c[0] = f64::NAN), Doubt::Data);
    assert_eq!(bad(&|p| p.grad.truncate(1)), Doubt::Data);
    assert_eq!(bad(&|p| p.bounds.xl[0] = f64::NAN), Doubt::Data);
    assert_eq!(bad(&|p| p.x = vec![1.0, 1.0]), Doubt::Infeasible);
    assert_eq!(bad(&|p| p.c[0] = -1.0), Doubt::Infeasible);
    // multipliers that are no numbers are none
    good.clone().multipliers(&[f64::NAN], &[0.0, 0.0]).expect(T::S, B::Yes);
    assert!(Certifier::new(&Pattern::empty(0, 2), &[(0, 2)]).is_err());
}

/// Nothing is claimed that the factorisations allowed do not show.
#[test]
fn without_factorisations_nothing_is_claimed() {
    for max_factorisations in 0..20 {
        let (cert, c) = ralph1().certify(&CertSettings { max_factorisations, ..CertSettings::default() });
        // the last program may correct the inertia, and estimate multipliers at its start
        assert!(c.factorisations() <= max_factorisations + 3, "{} of {max_factorisations}", c.factorisations());
        assert_ne!(cert.b, B::No);
        assert!(cert.b == B::Yes || cert.doubt == Doubt::Nodes, "{cert:?}");
        assert!(max_factorisations > 0 || cert.b == B::Undecided);
    }
}

#[test]
fn an_interrupt_leaves_the_question_open() {
    let stop = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(true));
    let p = ralph1();
    let jac = Pattern::dense(1, 3);
    let mut certifier = Certifier::new(&jac, &p.pairs).unwrap();
    let local = Local {
        x: &p.x,
        c: &p.c,
        grad: &p.grad,
        jac: &jac,
        jac_values: &p.rows[0],
        bounds: &p.bounds,
        pairs: &p.pairs,
        y: &[],
        z: &[],
    };
    let mut control = Control::of(Stop::on(&stop));
    let cert = certifier.certify(&local, &CertSettings::default(), &mut control);
    assert_eq!((cert.stationarity, cert.b, cert.doubt), (T::Unknown, B::Undecided, Doubt::Stopped));
}

/// The only row has no gradient, so no multipliers exist.
#[test]
fn points_without_multipliers() {
    let p = Point::origin(&[1.0, 0.0, 0.0], &[(1, 2)]).row(&[0.0, 0.0, 0.0], -INF, 0.0);
    p.expect(T::None, B::No);
}

/// Dependent equalities, more rows than variables, and a feasible cone that is a point.
#[test]
fn degenerate_rows() {
    let rows = [[1.0, 1.0, 0.0], [2.0, 2.0, 0.0], [1.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 3.0, 0.0]];
    let mut p = Point::origin(&[-3.0, -1.0, 1.0], &[(1, 2)]);
    for r in &rows {
        p = p.row(r, 0.0, 0.0);
    }
    p.expect(T::S, B::Yes);
    // the same cone through inequalities without interior
    let p = Point::origin(&[-3.0, -1.0, 1.0], &[(1, 2)]).row(&[1.0, 1.0, 0.0], -INF, 0.0).lower(0, 0.0);
    p.expect(T::S, B::Yes);
    let p = Point::origin(&[-3.0, 1.0, -1.0], &[(1, 2)]).row(&[1.0, 1.0, 0.0], -INF, 0.0).lower(0, 0.0);
    p.expect(T::A, B::No);
}

/// Is `target` a non-negative combination of `columns`? First phase of the simplex method with the rule of Bland.
fn in_cone(columns: &[Vec<f64>], target: &[f64]) -> bool {
    const ZERO: f64 = 1e-9;
    let (m, n) = (target.len(), columns.len());
    let sign = |i: usize| if target[i] < 0.0 { -1.0 } else { 1.0 };
    let mut rows: Vec<Vec<f64>> =
        (0..m).map(|i| columns.iter().map(|c| c[i]).chain([target[i]]).map(|v| sign(i) * v).collect()).collect();
    // numbers from n on are artificial variables
    let mut basis: Vec<usize> = (n..n + m).collect();
    loop {
        let left = |j: usize, rows: &[Vec<f64>]| -> f64 { (0..m).filter(|&i| basis[i] >= n).map(|i| rows[i][j]).sum() };
        let Some(enter) = (0..n).find(|&j| !basis.contains(&j) && left(j, &rows) > ZERO) else {
            return left(n, &rows) <= 1e-7;
        };
        let ratio = |i: usize| rows[i][n].max(0.0) / rows[i][enter];
        let leave = (0..m)
            .filter(|&i| rows[i][enter] > ZERO)
            .min_by(|&i, &k| ratio(i).total_cmp(&ratio(k)).then(basis[i].cmp(&basis[k])))
            .expect("the sum of the artificial variables is bounded below");
        let pivot: Vec<f64> = rows[leave].iter().map(|v| v / rows[leave][enter]).collect();
        for (i, row) in rows.iter_mut().enumerate() {
            let factor = row[enter];
            for (v, p) in row.iter_mut().zip(&pivot) {
                *v = if i == leave { *p } else { *v - factor * p };
            }
        }
        basis[leave] = enter;
    }
}

/// Signs of a multiplier: not negative, not positive.
type Range = (bool, bool);
const UP: Range = (true, false);
const DOWN: Range = (false, true);
const ZERO: Range = (true, true);
const FREE: Range = (false, false);

impl Point {
    /// Are there multipliers with the signs given at every pair? All rows and bounds of these points are active.
    fn has_multipliers(&self, signs: &[(Range, Range)]) -> bool {
        let n = self.grad.len();
        let mut columns: Vec<Vec<f64>> = Vec::new();
        let mut push = |v: Vec<f64>, range: Range| {
            if !range.1 {
                columns.push(v.clone());
            }
            if !range.0 {
                columns.push(v.iter().map(|t| -t).collect());
            }
        };
        for (i, r) in self.rows.iter().enumerate() {
            push(r.clone(), (self.bounds.cu[i] == INF, self.bounds.cl[i] == -INF));
        }
        let unit = |j: usize| (0..n).map(|i| f64::from(i == j)).collect::<Vec<f64>>();
        for (&(a, b), &(sa, sb)) in self.pairs.iter().zip(signs) {
            for (j, s) in [(a, sa), (b, sb)] {
                if s != ZERO {
                    push(unit(j), s);
                }
            }
        }
        in_cone(&columns, &self.grad)
    }

    fn any_piece(&self, pieces: &[(Range, Range)], all: bool) -> bool {
        let k = self.pairs.len();
        let total = pieces.len().pow(k as u32);
        let mut each = (0..total).map(|mut code| {
            let choice: Vec<_> = (0..k)
                .map(|_| {
                    let p = pieces[code % pieces.len()];
                    code /= pieces.len();
                    p
                })
                .collect();
            self.has_multipliers(&choice)
        });
        if all {
            each.all(|ok| ok)
        } else {
            each.any(|ok| ok)
        }
    }

    /// Type and B-stationarity by enumeration.
    fn enumerate(&self) -> (T, B) {
        let b = if self.any_piece(&[(FREE, UP), (UP, FREE)], true) { B::Yes } else { B::No };
        let kinds: [(T, &[(Range, Range)]); 5] = [
            (T::S, &[(UP, UP)]),
            (T::M, &[(UP, UP), (FREE, ZERO), (ZERO, FREE)]),
            (T::C, &[(UP, UP), (DOWN, DOWN)]),
            (T::A, &[(UP, FREE), (FREE, UP)]),
            (T::W, &[(FREE, FREE)]),
        ];
        let kind =
            kinds.into_iter().find(|(_, pieces)| self.any_piece(pieces, false)).map_or(T::None, |(kind, _)| kind);
        (kind, b)
    }
}

/// Numbers from a fixed sequence.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 33) as f64 / (1u64 << 30) as f64 - 1.0
    }
    fn below(&mut self, n: usize) -> usize {
        ((self.next() + 1.0) * 0.5 * n as f64) as usize % n
    }
}

/// A point with `k` biactive pairs. The gradient is a combination of the rows and the members with signs that favour
/// the types that random numbers seldom give.
fn random_point(rng: &mut Random, k: usize, share: bool) -> Point {
    let n = 2 * k + rng.below(3);
    let pairs: Vec<_> =
        (0..k).map(|i| if share && i > 0 { (2 * (i - 1), 2 * i + 1) } else { (2 * i, 2 * i + 1) }).collect();
    let mut grad = vec![0.0; n];
    let mut rows = Vec::new();
    for _ in 0..rng.below(2 * k + 2) {
        // small whole numbers give dependent rows and ties
        let row: Vec<f64> = (0..n).map(|_| rng.below(5) as f64 - 2.0).collect();
        let equality = rng.below(3) == 0;
        let weight = if equality { rng.next() } else { rng.below(3) as f64 };
        for (g, r) in grad.iter_mut().zip(&row) {
            *g += weight * r;
        }
        rows.push((row, equality));
    }
    let favour = rng.below(5);
    for &(a, b) in &pairs {
        let favour = if favour == 4 { 2 + rng.below(2) } else { favour };
        let (u, v) = (rng.below(3) as f64, rng.below(3) as f64);
        let (u, v) = match favour {
            0 => (u, v),
            1 if rng.below(2) == 0 => (0.0, -v),
            1 => (u, 0.0),
            2 => (-u, -v),
            _ => (u, -v),
        };
        grad[a] += u;
        grad[b] += v;
    }
    if rng.below(10) == 0 {
        grad.iter_mut().for_each(|g| *g += rng.next());
    }
    let mut p = Point::origin(&grad, &pairs);
    for (row, equality) in rows {
        p = p.row(&row, 0.0, if equality { 0.0 } else { INF });
    }
    p
}

/// Digits of the gradient that [`Point::disturbed`] leaves, absolutely.
const DIGITS: f64 = 1e-9;

impl Point {
    /// The same point as a solver delivers it: rows and objective scaled, the last digits wrong. Rows keep their
    /// directions, because some depend on others.
    fn disturbed(&self, rng: &mut Random) -> Point {
        let mut p = self.clone();
        for i in 0..p.rows.len() {
            let scale = 10f64.powf(2.0 * rng.next());
            p.c[i] = 1e-10 * scale * rng.next();
            p.rows[i].iter_mut().for_each(|v| *v *= scale);
        }
        let scale = 10f64.powf(rng.next());
        for j in 0..p.x.len() {
            p.x[j] = 1e-9 * (1.0 + rng.next());
            p.grad[j] = scale * (p.grad[j] + 1e-10 * rng.next());
        }
        p
    }
}

#[test]
fn random_points_agree_with_the_enumeration_of_all_pieces() {
    let mut rng = Random(7);
    let mut seen = std::collections::BTreeMap::new();
    for round in 0..800 {
        let k = 1 + round % 4;
        let p = random_point(&mut rng, k, round % 5 == 4);
        let (kind, b) = p.enumerate();
        p.expect(kind, b);
        p.disturbed(&mut rng).expect_to(DIGITS, kind, b);
        *seen.entry((kind.name(), b.name())).or_insert(0) += 1;
    }
    for case in [("S", "yes"), ("M", "yes"), ("M", "no"), ("C", "no"), ("A", "no"), ("W", "no"), ("none", "no")] {
        assert!(seen.get(&case).copied().unwrap_or(0) >= 5, "{case:?} is missing: {seen:?}");
    }
}

#[test]
fn six_pairs_agree_with_the_enumeration_of_all_branches() {
    let mut rng = Random(11);
    for _ in 0..60 {
        let k = 5 + rng.below(2);
        let p = random_point(&mut rng, k, false);
        let b = if p.any_piece(&[(FREE, UP), (UP, FREE)], true) { B::Yes } else { B::No };
        let (cert, _) = p.certify(&CertSettings { type_nodes: 0, ..CertSettings::default() });
        assert_eq!((cert.b, cert.doubt), (b, Doubt::None), "{cert:?}");
    }
}

/// A chain of stages with five variables and three rows each, as a discretised system has them: two states, a control,
/// a pair. `blocks` stages carry problem ralph1 in their pair; the others are strictly complementary, with multipliers
/// of both signs.
#[test]
fn long_chains_with_five_biactive_pairs() {
    let (stages, blocks) = (500, [3usize, 100, 250, 251, 480]);
    let (n, m) = (5 * stages, 3 * stages);
    let mut rng = Random(3);
    let (mut rows, mut cols, mut values) = (vec![], vec![], vec![]);
    let mut bounds = Bounds::free(n, m);
    bounds.cl.fill(0.0);
    bounds.cu.fill(0.0);
    let (mut x, mut z, mut pairs) = (vec![0.0; n], vec![0.0; n], vec![]);
    let y: Vec<f64> = (0..m).map(|_| rng.next()).collect();
    for k in 0..stages {
        let (v, r) = (5 * k, 3 * k);
        pairs.push((v + 3, v + 4));
        bounds.xl[v + 3] = 0.0;
        bounds.xl[v + 4] = 0.0;
        let mut put = |i: usize, j: usize, a: f64| {
            rows.push(i);
            cols.push(j);
            values.push(a);
        };
        for i in 0..2 {
            put(r + i, v + i, 1.0);
            put(r + i, v + 2, 0.1 * rng.next());
            put(r + i, v + 3, 0.1 * rng.next());
            if k > 0 {
                put(r + i, v - 5, -1.0 - 0.1 * rng.next());
                put(r + i, v - 4, 0.1 * rng.next());
            }
        }
        put(r + 2, v + 2, -1.0);
        put(r + 2, v + 3, 1.0);
        put(r + 2, v + 4, -1.0);
        if blocks.contains(&k) {
            // ralph1: u ≥ 0 and u = a − b
            bounds.xl[v + 2] = 0.0;
        } else if rng.below(2) == 0 {
            x[v + 3] = 0.5;
            z[v + 4] = 1.0 + rng.next();
        } else {
            x[v + 4] = 0.5;
            z[v + 3] = -1.0 + rng.next();
        }
    }
    let (jac, map) = Pattern::from_triplets(m, n, &rows, &cols);
    let mut jac_values = vec![0.0; jac.nnz()];
    for (v, &k) in values.iter().zip(&map) {
        jac_values[k] += v;
    }
    let c = vec![0.0; m];
    let mut certifier = Certifier::new(&jac, &pairs).unwrap();
    let mut certify = |block: [f64; 3], given: bool| {
        let mut z = z.clone();
        for k in blocks {
            z[5 * k + 2..5 * k + 5].copy_from_slice(&block);
        }
        let mut grad = z.clone();
        mul_add_transposed(&jac, &jac_values, &y, &mut grad, -1.0);
        let local = Local {
            x: &x,
            c: &c,
            grad: &grad,
            jac: &jac,
            jac_values: &jac_values,
            bounds: &bounds,
            pairs: &pairs,
            y: if given { &y } else { &[] },
            z: if given { &z } else { &[] },
        };
        let clock = std::time::Instant::now();
        let cert = certifier.certify(&local, &CertSettings::default(), &mut Control::default());
        println!("{cert:?} in {:.3} s", clock.elapsed().as_secs_f64());
        assert_eq!((cert.biactive, cert.doubt), (5, Doubt::None));
        (cert.stationarity, cert.b, cert.lps)
    };
    assert_eq!(certify([1.5, 0.5, 0.5], true), (T::S, B::Yes, 0));
    assert_eq!(certify([1.5, 0.5, 0.5], false), (T::S, B::Yes, 1));
    let (kind, b, lps) = certify([1.5, -0.5, -0.5], true);
    assert!((kind, b) == (T::M, B::Yes) && lps <= 100, "{lps}");
    // along the first member and the control the objective falls now
    let (_, b, lps) = certify([0.2, -0.5, -0.5], true);
    assert!(b == B::No && lps <= 20, "{lps}");
}

/// Two rows that are all but the same turn the rounding of their derivatives into slopes as large as the gradient: multipliers
/// of 3e9 prove nothing of a gradient of 4e-2, whatever they leave over.
#[test]
fn multipliers_that_dwarf_the_gradient_prove_nothing() {
    let apart = (-36f64).exp2();
    let point = |apart: f64| {
        let y = 0.04 / apart;
        Point::origin(&[0.0, 0.04, 0.0, 0.0], &[(2, 3)])
            .row(&[1.0, 1.0, 0.0, 0.0], 0.0, 0.0)
            .row(&[1.0, 1.0 + apart, 0.0, 0.0], 0.0, 0.0)
            .multipliers(&[y, -y], &[0.0; 4])
    };
    let (cert, _) = point(apart).certify(&CertSettings::default());
    assert!(cert.b != B::Yes && cert.stationarity != T::S, "{cert:?}");
    // rows that are apart do
    assert_eq!(point(0.5).certify(&CertSettings::default()).0.stationarity, T::S);
}

/// A row that is met to an absolute tolerance only, which is a third of the way that its gradient takes a step of one.
#[test]
fn a_row_that_is_nearly_met_proves_nothing_where_its_multiplier_is_large() {
    let point = |off: f64| {
        let mut p =
            Point::origin(&[1.0, 0.0, 0.0], &[(1, 2)]).row(&[1e-8, 0.0, 0.0], 0.0, 0.0).multipliers(&[-1e8], &[0.0; 3]);
        p.c[0] = off;
        p.certify(&CertSettings::default()).0
    };
    assert_eq!(point(3e-9).b, B::Undecided);
    assert_eq!(point(0.0).stationarity, T::S);
}
