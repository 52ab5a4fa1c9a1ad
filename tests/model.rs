//! Models with operators that switch: the systems they become, and their trajectories beside hand-written ones.

use switchback::dcs::{Dcs, FormOptions};
use switchback::error::Error;
use switchback::expr::{Expr, Graph, Piecewise};
use switchback::func::{check_derivatives, CheckSettings, Function, Point};
use switchback::model::{Built, Model, NoteKind, Trial};
use switchback::settings::DcsForm;
use switchback::system::Regions;

#[path = "../examples/report/expression_models.rs"]
mod expression_models;
#[path = "common/gallery.rs"]
mod gallery;
#[path = "../examples/report/models.rs"]
mod models;

fn build(g: &Graph, nu: usize, np: usize, rhs: &[Expr]) -> Built {
    Model::from_rhs("model", nu, np, rhs).unwrap().build(g).unwrap()
}

/// Regions, switching functions and pairs.
fn counts(b: &Built) -> (usize, usize, usize) {
    (b.report.n_regions(), b.report.n_switching_functions(), b.report.n_pairs())
}

#[test]
fn functions_of_the_gallery_have_exact_derivatives() {
    let all = [
        expression_models::oscillator(),
        expression_models::switching('b'),
        expression_models::sliding_mode(),
        expression_models::blocks(),
        expression_models::stick_slip(),
    ];
    for b in all {
        for f in &b.functions {
            let d = f.dims();
            let x: Vec<f64> = (0..d.x).map(|i| 0.3 + 0.2 * i as f64).collect();
            let at = Point { t: 0.7, x: &x, u: &vec![0.4; d.u], p: &[] };
            let r = check_derivatives(f.as_ref(), &at, &CheckSettings::default()).unwrap();
            assert!(r.passed(), "{}: {r}", b.report.name);
        }
    }
}

#[test]
fn expected_sizes() {
    use expression_models as e;
    assert_eq!(counts(&e::switching('b')), (2, 1, 2));
    assert!(e::switching('b').report.clock && !e::switching('a').report.clock);
    assert_eq!(counts(&e::coulomb()), (2, 1, 2));
    // Friction laws that do not know each other add: 6 modes, not 8.
    assert_eq!(counts(&e::blocks()), (6, 3, 6));
    assert_eq!(e::blocks().report.groups.len(), 3);
    assert_eq!(counts(&e::zeno()), (4, 2, 4));
    assert_eq!(counts(&e::sliding_mode()), (4, 2, 4));
    assert_eq!(counts(&e::oscillator()), (2, 1, 2));
}

#[test]
fn turbo_car_and_gene_network() {
    let g = Graph::new();
    let (v, u) = (g.x(1), g.u(0));
    // The turbo triples the acceleration above 10.
    let car = build(&g, 1, 0, &[v, v.gt(10.0).select(3.0 * u, u)]);
    assert_eq!(counts(&car), (2, 1, 2));
    // Two genes that regulate each other, each expressed in a band of the other's concentration.
    let g = Graph::new();
    let (x, y) = (g.x(0), g.x(1));
    let (one, zero) = (g.constant(1.0), g.constant(0.0));
    let genes = build(
        &g,
        0,
        0,
        &[
            40.0 * (x.gt(4.0) & y.lt(8.0)).select(one, zero) - 4.5 * x,
            40.0 * (x.lt(8.0) & y.gt(4.0)).select(one, zero) - 1.5 * y,
        ],
    );
    // Four thresholds in two independent terms, each with an "and" of two.
    assert_eq!(genes.report.groups.len(), 2);
    assert_eq!(counts(&genes), (6, 4, 8));
    assert_eq!(genes.report.groups[0].n_modes, 2);
}

/// Two links with dry friction in both joints: `v' = M(q)⁻¹ (forces − friction)`.
#[test]
fn friction_behind_a_mass_matrix_splits() {
    let g = Graph::new();
    let (q, v) = ([g.x(0), g.x(1)], [g.x(2), g.x(3)]);
    let coupling = 0.5 * (q[0] - q[1]).cos();
    let mass = [g.constant(2.0), coupling, coupling, g.constant(1.0)];
    let forces: Vec<Expr> = (0..2).map(|i| -9.81 * q[i].sin() - 0.3 * v[i].sign()).collect();
    let a = g.solve(&mass, &forces).unwrap();
    let b = build(&g, 0, 0, &[v[0], v[1], a[0], a[1]]);
    assert_eq!(counts(&b), (4, 2, 4));
    assert!(b.system.subsystems().iter().all(|s| s.rows == [2, 3]));
    let at = [0.4, -0.2, 0.7, -0.9];
    let c = 0.5 * 0.6f64.cos();
    let f = [-9.81 * 0.4f64.sin() - 0.3, 9.81 * 0.2f64.sin() + 0.3];
    let det = 2.0 - c * c;
    let exact = [0.7, -0.9, (f[0] - c * f[1]) / det, (2.0 * f[1] - c * f[0]) / det];
    for (a, e) in rhs_at(&b, &at).iter().zip(exact) {
        assert!((a - e).abs() < 1e-14, "{a} {e}");
    }
    for f in &b.functions {
        let r = check_derivatives(f.as_ref(), &Point { t: 0.0, x: &at, u: &[], p: &[] }, &CheckSettings::default());
        assert!(r.as_ref().is_ok_and(|r| r.passed()), "{r:?}");
    }
}

#[test]
fn smooth_models_have_no_pairs() {
    let g = Graph::new();
    let (x, v) = (g.x(0), g.x(1));
    let b = build(&g, 0, 0, &[v, -x]);
    assert_eq!(counts(&b), (0, 0, 0));
    assert!(b.report.to_string().contains("no complementarity"), "{}", b.report);
}

#[test]
fn what_is_not_needed_is_dropped_with_a_reason() {
    let g = Graph::new();
    let (x, y) = (g.x(0), g.x(1));
    let dropped = |b: &Built| b.report.notes_of(NoteKind::Dropped).map(str::to_owned).collect::<Vec<_>>();
    // Never negative: a square plus one, and a square.
    let b = build(&g, 0, 0, &[(x * x + 1.0).sign(), (y * y).abs()]);
    assert_eq!(counts(&b), (0, 0, 0));
    assert_eq!(
        dropped(&b),
        [
            "x[0]^2 + 1 is never negative, since x[0]^2 >= 0: it does not switch",
            "x[1]^2 is never negative, since x[1]^2 >= 0: it does not switch"
        ]
    );
    // clip: three of four patterns.
    let b = build(&g, 0, 0, &[x.clip(g.constant(-1.0), g.constant(1.0)), y]);
    assert_eq!(counts(&b), (3, 2, 3));
    assert_eq!(
        dropped(&b),
        ["1 of 4 sign patterns of -1 - x[0], x[0] - 1 cannot occur: not -1 - x[0] > 0 and x[0] - 1 > 0, because \
          (-1 - x[0]) + (x[0] - 1) = -2 is never positive"]
    );
    // what differs in the last digit only is one, which the report says
    let b = build(&g, 0, 0, &[(x - 0.1).sign() + (5.0 * x - 0.5).abs(), (x - 0.1f64.next_up()).sign()]);
    assert_eq!(b.report.n_switching_functions(), 2, "{}", b.report);
    let merged: Vec<&str> = b.report.notes_of(NoteKind::Merged).collect();
    assert_eq!(merged, ["5*x[0] - 0.5 is taken for x[0] - 0.1: their coefficients agree to the last binary digit"]);
    // The second condition makes no difference.
    let same = y.gt(0.0).select(x, x + 0.0 * y);
    let b = build(&g, 0, 0, &[x.gt(0.0).select(same * 2.0, x), y.sign() - y.sign()]);
    assert_eq!(counts(&b), (2, 1, 2));
    // Equal modes of neighbouring cells become one region; a row that does not switch moves to f0.
    let both = x.gt(0.0) & y.gt(0.0);
    let b =
        build(&g, 0, 0, &[both.select(g.constant(1.0), g.constant(-1.0)), x.abs() + (-x).max(x) - 2.0 * x.abs() + y]);
    assert_eq!(counts(&b), (3, 2, 4));
    let merged: Vec<&str> = b.report.notes_of(NoteKind::Merged).collect();
    assert_eq!(merged, ["4 cells with equal modes became 3 regions"]);
}

#[test]
fn operators_have_the_modes_they_should() {
    let g = Graph::new();
    let x = g.x(0);
    let c = |v: f64| g.constant(v);
    // Operator, and its values left of −1, in between, and right of 1.
    let cases: Vec<(Expr, usize, [f64; 3])> = vec![
        (x.sign(), 2, [-1.0, 1.0, 1.0]),
        (x.abs(), 2, [2.0, 0.5, 2.0]),
        (x.min(c(1.0)), 2, [-2.0, 0.5, 1.0]),
        (x.max(c(-1.0)), 2, [-1.0, 0.5, 2.0]),
        (x.clip(c(-1.0), c(1.0)), 3, [-1.0, 0.5, 1.0]),
        (x.dead_zone(c(1.0)), 3, [-1.0, 0.0, 1.0]),
        ((x - 1.0).relay(c(5.0), c(7.0)), 2, [7.0, 7.0, 5.0]),
        ((!x.gt(1.0) & x.gt(-1.0)).select(c(1.0), c(0.0)), 3, [0.0, 1.0, 0.0]),
        ((x.lt(-1.0) | x.gt(1.0)).select(x, x * x), 3, [-2.0, 0.25, 2.0]),
        ((x.abs() - 1.0).abs(), 4, [1.0, 0.5, 1.0]),
    ];
    for (k, (e, cells, values)) in cases.iter().enumerate() {
        let b = build(&g, 0, 0, &[*e]);
        assert_eq!(b.report.n_pairs(), *cells, "case {k}: {}", b.report);
        for (at, expected) in [-2.0, 0.5, 2.0].iter().zip(values) {
            let got = rhs_at(&b, &[*at]);
            assert!((got[0] - expected).abs() < 1e-15, "case {k} at {at}: {got:?}");
        }
    }
    let table = g.step_table(x, &[-1.0, 0.0, 1.0], &[3.0, 1.0, 4.0, 1.5].map(c)).unwrap();
    let b = build(&g, 0, 0, &[table]);
    assert_eq!(counts(&b), (4, 3, 4));
    assert_eq!([-2.0, -0.5, 0.5, 2.0].map(|x| rhs_at(&b, &[x])[0]), [3.0, 1.0, 4.0, 1.5]);
}

/// Right-hand side at a point away from switching surfaces, by the sign matrices.
fn rhs_at(b: &Built, x: &[f64]) -> Vec<f64> {
    let at = Point { t: 0.0, x, u: &[], p: &[] };
    let eval = |f: &dyn Function| {
        let (mut out, mut work) = (vec![0.0; f.n_out()], vec![0.0; f.work_len()]);
        f.value(&at, &mut out, &mut work).unwrap();
        out
    };
    let mut out = b.system.f0().map_or(vec![0.0; x.len()], |f| eval(f.as_ref()));
    for s in b.system.subsystems() {
        let Regions::Signs { psi, signs } = &s.regions else { panic!("signs expected") };
        let (psi, modes) = (eval(psi.as_ref()), eval(s.modes.as_ref()));
        let inside = |i: &usize| (0..psi.len()).all(|j| f64::from(signs[i * psi.len() + j]) * psi[j] >= 0.0);
        let valid: Vec<usize> = (0..s.n_modes).filter(inside).collect();
        assert_eq!(valid.len(), 1, "{x:?} is in {} regions", valid.len());
        for (r, &state) in s.rows.iter().enumerate() {
            out[state] += modes[valid[0] * s.rows.len() + r];
        }
    }
    out
}

/// Random nests of operators against their values in plain arithmetic.
#[test]
fn random_switching_expressions() {
    let mut seed = 7u64;
    let mut below = move |n: usize| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((seed >> 33) % n as u64) as usize
    };
    let mut compared = 0;
    for case in 0..60 {
        let g = Graph::new();
        let points: Vec<[f64; 2]> =
            (0..20).map(|_| [below(1000) as f64 / 100.0 - 5.03, below(1000) as f64 / 100.0 - 4.97]).collect();
        let mut exprs = vec![g.x(0), g.x(1), g.constant(0.7)];
        let mut values: Vec<Vec<f64>> =
            vec![points.iter().map(|p| p[0]).collect(), points.iter().map(|p| p[1]).collect(), vec![0.7; 20]];
        for _ in 0..5 {
            let (i, j, k) = (below(exprs.len()), below(exprs.len()), below(exprs.len()));
            let (a, b, c) = (exprs[i], exprs[j], exprs[k]);
            let f: (Expr, fn(f64, f64, f64) -> f64) = match below(8) {
                0 => (a.abs(), |a, _, _| a.abs()),
                1 => (a.sign() * b, |a, b, _| a.signum() * b),
                2 => (a.min(b), |a, b, _| a.min(b)),
                3 => (a.max(b + 1.0), |a, b, _| a.max(b + 1.0)),
                4 => ((a.gt(b) & c.gt(0.5)).select(a, b), |a, b, c| if a > b && c > 0.5 { a } else { b }),
                5 => ((a.gt(b) | !c.gt(0.5)).select(b, c), |a, b, c| if a > b || c <= 0.5 { b } else { c }),
                6 => (a + b * 0.5 - c, |a, b, c| a + b * 0.5 - c),
                _ => (a * b - 1.0, |a, b, _| a * b - 1.0),
            };
            exprs.push(f.0);
            values.push((0..20).map(|n| f.1(values[i][n], values[j][n], values[k][n])).collect());
        }
        let last = exprs.len() - 1;
        let b = build(&g, 0, 0, &[exprs[last], exprs[last - 1] + exprs[last]]);
        for (n, p) in points.iter().enumerate() {
            // Ties are on the surfaces, where the sign does not count.
            let got = rhs_at_or_tie(&b, p);
            let Some(got) = got else { continue };
            compared += 1;
            let exact = [values[last][n], values[last - 1][n] + values[last][n]];
            for (a, e) in got.iter().zip(exact) {
                assert!(
                    (a - e).abs() < 1e-12 * (1.0 + e.abs()),
                    "case {case} at {p:?}: {got:?}, not {exact:?}\n{}",
                    b.report
                );
            }
        }
    }
    assert!(compared > 600, "{compared} of 1200 points were compared");
}

fn rhs_at_or_tie(b: &Built, x: &[f64]) -> Option<Vec<f64>> {
    let at = Point { t: 0.0, x, u: &[], p: &[] };
    for s in b.system.subsystems() {
        let Regions::Signs { psi, .. } = &s.regions else { return None };
        let (mut out, mut work) = (vec![0.0; psi.n_out()], vec![0.0; psi.work_len()]);
        psi.value(&at, &mut out, &mut work).ok()?;
        if out.iter().any(|v| v.abs() < 1e-9) {
            return None;
        }
    }
    Some(rhs_at(b, x))
}

#[test]
fn lints() {
    let g = Graph::new();
    let (x, y, u, p, t) = (g.x(0), g.x(1), g.u(0), g.p(0), g.t());
    let warnings = |rhs: &[Expr]| {
        let b = build(&g, 1, 1, rhs);
        b.report.notes_of(NoteKind::Warning).collect::<Vec<_>>().join("; ")
    };
    assert_eq!(warnings(&[y - x.sign(), u]), "");
    assert!(warnings(&[p.sign(), y]).contains("cannot be crossed"));
    assert!(warnings(&[(x - u).sign(), y]).contains("depends on a control"));
    assert!(warnings(&[(x * x - y * y).sign(), y]).contains("no gradient where it vanishes"));
    let jumps = Piecewise::steps(&[0.0], &[1.0, 2.0]).unwrap();
    assert_eq!(warnings(&[g.piecewise(&jumps, t), y]), "");
    assert!(warnings(&[g.piecewise(&jumps, x), y]).contains("not found as switches"));
    let never = (x.gt(2.0) & x.lt(1.0)).select(u, p);
    assert!(warnings(&[never, y]).contains("is always false: one side of the choice is never taken"));
    let always = (x.gt(-2.0) | x.lt(1.0)).select(u, y.sign());
    assert!(warnings(&[always, y]).contains("is always true"));
    assert_eq!(warnings(&[(x.gt(2.0) & y.lt(1.0)).select(u, p) + x.clip(p, p + 1.0), y]), "");
    let b = build(&g, 1, 1, &[y, x.abs()]);
    assert!(b.report.notes_of(NoteKind::Info).any(|n| n.contains("no sliding mode")), "{}", b.report);
    // Three regions, and no difference across either surface.
    let b = build(&g, 1, 1, &[y, x.dead_zone(g.constant(0.5))]);
    assert_eq!(b.report.notes_of(NoteKind::Info).filter(|n| n.contains("no sliding mode")).count(), 2, "{}", b.report);
    // Across y = 0 the speeds are ±x: equal where x vanishes.
    let mut m = Model::from_rhs("m", 0, 0, &[g.constant(1.0), -x * y.sign()]).unwrap();
    for (x0, n) in [(0.0, 1), (1.0, 0)] {
        m.set_trial(Trial { x: vec![x0, 0.0], ..Trial::default() }).unwrap();
        let report = m.build(&g).unwrap().report;
        assert_eq!(report.notes_of(NoteKind::Warning).filter(|n| n.contains("singular")).count(), n, "{report}");
    }
    let b = build(&g, 1, 1, &[y, g.constant(0.0)]);
    assert!(b.report.notes_of(NoteKind::Info).any(|n| n.contains("x[1] is constant")), "{}", b.report);
    let mut m = Model::from_rhs("m", 0, 0, &[x.ln() - y.sign(), y.gt(1.0).select(x, 1.0 / y)]).unwrap();
    m.set_trial(Trial { x: vec![-1.0, 0.0], ..Trial::default() }).unwrap();
    let notes = m.build(&g).unwrap().report;
    let warnings: Vec<&str> = notes.notes_of(NoteKind::Warning).collect();
    assert_eq!(
        warnings,
        [
            "the value of f0 is not defined at the trial point",
            "the value of some mode of x[1] is not defined at the trial point"
        ]
    );
}

#[test]
fn malformed_models_are_refused() {
    let g = Graph::new();
    let x = g.x(0);
    let mut m = Model::new("m", 2, 0, 0).unwrap();
    m.set_names(switchback::model::Names { x: vec!["q".into(), "v".into()], ..Default::default() });
    m.set_derivative(0, x.id()).unwrap();
    let e = m.build(&g).map(|_| ()).unwrap_err();
    assert!(matches!(e, Error::State(_)) && e.to_string().contains("state v has no derivative"), "{e}");
    assert!(matches!(m.set_derivative(2, x.id()), Err(Error::Range(_))));
    m.set_derivative(1, x.gt(0.0).id()).unwrap();
    assert!(matches!(m.build(&g).map(|_| ()), Err(Error::Range(_))));
    m.set_derivative(1, g.x(5).id()).unwrap();
    assert!(matches!(m.build(&g).map(|_| ()), Err(Error::Dimension(_))));
    m.set_derivative(1, g.constant(f64::NAN).id()).unwrap();
    assert!(matches!(m.build(&g).map(|_| ()), Err(Error::NonFinite(_))));
    assert!(Model::new("m", 0, 0, 0).is_err());
    assert!(m.set_trial(Trial { x: vec![0.0], ..Trial::default() }).is_err());
    assert!(m.set_trial(Trial { x: vec![0.0, f64::NAN], ..Trial::default() }).is_err());
    // A chain that is longer than a model may be.
    let g = Graph::new();
    let chain = (0..=switchback::model::MAX_NODES).fold(g.x(0), |a, _| a.sin());
    let e = Model::from_rhs("m", 0, 0, &[chain]).unwrap().build(&g).map(|_| ()).unwrap_err();
    assert!(matches!(e, Error::Unsupported(_)) && e.to_string().contains("a model may have"), "{e}");
    // Constants that are no numbers, also in conditions.
    let g = Graph::new();
    let e = Model::from_rhs("m", 0, 0, &[g.constant(f64::NAN).sign()]).unwrap().build(&g).map(|_| ()).unwrap_err();
    assert!(matches!(e, Error::NonFinite(_)), "{e}");
    // Switches inside switches inside switches.
    let g = Graph::new();
    let nested = (0..30).fold(g.x(0), |a, k| (a - 0.3 - f64::from(k)).abs());
    let built = Model::from_rhs("m", 0, 0, &[nested.sign()]).unwrap().build(&g).unwrap();
    let e = built.system.check_modes_known().unwrap_err();
    assert!(matches!(e, Error::Unsupported(_)) && e.to_string().contains("31 coupled switching functions"), "{e}");
    // Twenty coupled conditions.
    let g = Graph::new();
    let product = (0..20).map(|i| g.x(i).sign()).reduce(|a, b| a * b).unwrap();
    let mut rhs = vec![product];
    rhs.extend((1..20).map(|i| g.x(i)));
    let built = Model::from_rhs("m", 0, 0, &rhs).unwrap().build(&g).unwrap();
    let e = built.system.check_modes_known().unwrap_err();
    assert!(matches!(e, Error::Unsupported(_)) && e.to_string().contains("20 coupled switching functions"), "{e}");
}

/// The report and the complementarity system agree on the form and its size.
#[test]
fn the_smaller_form_is_reported_and_taken() {
    let pairs_of = |b: &Built, form| {
        let options = FormOptions { form, ..FormOptions::default() };
        Dcs::new(&b.system, options).unwrap().form().n_cells
    };
    let g = Graph::new();
    // a ladder: four switching functions, five modes
    let ladder = (0..4).rev().fold(g.constant(0.0), |rest, k| g.x(k).gt(0.0).select(f64::from(k as u32) + 1.0, rest));
    let rhs = [ladder, g.x(0), g.x(1), g.x(2)];
    let b = build(&g, 0, 0, &rhs);
    assert!(b.report.groups[0].prefers_heaviside(), "{}", b.report);
    assert_eq!(counts(&b), (5, 4, 8));
    assert!(b.report.to_string().contains("(Stewart's form: 16, 33, 17)"), "{}", b.report);
    assert!(b.report.json().contains("\"form\":\"heaviside\""));
    assert_eq!(pairs_of(&b, DcsForm::Auto), 8);
    assert_eq!((pairs_of(&b, DcsForm::Stewart), pairs_of(&b, DcsForm::Heaviside)), (16, 8));
    let all =
        [gallery::two_genes().1, gallery::motor().1, gallery::tank_cascade().1, expression_models::sliding_mode()];
    for b in &all {
        assert!(b.report.groups.iter().all(|g| !g.prefers_heaviside()));
        assert_eq!(pairs_of(b, DcsForm::Auto), b.report.n_pairs());
        assert_eq!(pairs_of(b, DcsForm::Heaviside), 2 * b.report.n_switching_functions());
    }
}

/// A trial point on a surface is on it in all units, one beside it is not.
#[test]
fn trial_points_do_not_depend_on_units() {
    for unit in [1.0, 1e12, 1e-12] {
        let g = Graph::new();
        let (x, y) = (g.x(0) * unit, g.x(1) * unit);
        let mut m = Model::from_rhs("m", 0, 0, &[g.constant(1.0), -x * (y - 0.3).sign()]).unwrap();
        for (x0, y0, n) in [(0.0, 0.3, 1), (1e-13, 0.3, 0), (0.0, 0.3 + 1e-9, 0), (1.0, 0.3, 0)] {
            m.set_trial(Trial { x: vec![x0 / unit, y0 / unit], ..Trial::default() }).unwrap();
            let report = m.build(&g).unwrap().report;
            let found = report.notes_of(NoteKind::Warning).filter(|n| n.contains("singular")).count();
            assert_eq!(found, n, "{x0}, {y0} in units of {unit}: {report}");
        }
    }
}

/// Building can be ended like every other call.
#[test]
fn building_ends_when_it_is_to_end() {
    use switchback::stop::{raise, Stop};
    let flag = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
    let g = Graph::new();
    let m = Model::from_rhs("m", 0, 0, &[(0..2000).fold(g.x(0), |a, _| a.sin())]).unwrap();
    let e = Stop::on(&flag).scope(|| {
        raise();
        m.build(&g).map(|_| ())
    });
    assert_eq!(e, Err(Error::Interrupted));
    assert!(m.build(&g).is_ok());
}

#[test]
fn reports_name_things() {
    let g = Graph::new();
    let (x, v) = (g.x(0), g.x(1));
    let mut m = Model::from_rhs("slider", 0, 0, &[v, -x - 0.3 * v.sign()]).unwrap();
    m.set_names(switchback::model::Names { x: vec!["q".into(), "v".into()], ..Default::default() });
    let r = m.build(&g).unwrap().report;
    let text = r.to_string();
    assert!(text.contains("v switch with v: 2 modes in 2 regions"), "{text}");
    assert!(text.contains("2 pairs, 5 algebraic variables, 3 equations"), "{text}");
    let json = r.json();
    assert!(json.contains("\"states\":[\"v\"],\"switching_functions\":[\"v\"],\"regions\":2"), "{json}");
}

/// A planar arm of `n` links with unit masses at their ends and friction in every joint.
fn arm_with_friction(g: &Graph, n: usize) -> Built {
    let q: Vec<Expr> = (0..n).map(|i| g.x(i)).collect();
    let w: Vec<Expr> = (0..n).map(|i| g.x(n + i)).collect();
    let angle: Vec<Expr> = (0..n).map(|i| q[1..=i].iter().fold(q[0], |s, e| s + *e)).collect();
    let zero = g.constant(0.0);
    let mut mass = vec![zero; n * n];
    let mut force: Vec<Expr> = (0..n).map(|i| g.u(i) - 0.1 * w[i] - 0.3 * w[i].sign()).collect();
    for k in 0..n {
        let (mut jx, mut jy) = (vec![zero; n], vec![zero; n]);
        for i in 0..=k {
            for a in &angle[i..=k] {
                jx[i] -= a.sin();
                jy[i] += a.cos();
            }
        }
        for i in 0..n {
            force[i] -= 9.81 * jy[i];
            for j in 0..n {
                mass[i + n * j] = mass[i + n * j] + jx[i] * jx[j] + jy[i] * jy[j];
            }
        }
    }
    let a = g.solve(&mass, &force).unwrap();
    build(g, n, 0, &[w, a].concat())
}

fn value(f: &dyn Function, at: &Point) -> Vec<f64> {
    let mut out = vec![0.0; f.n_out()];
    f.value(at, &mut out, &mut vec![0.0; f.work_len()]).unwrap();
    out
}

#[test]
fn what_solves_with_one_matrix_is_one_function_of_states_and_weights() {
    let n = 3;
    let g = Graph::new();
    let b = arm_with_friction(&g, n);
    let f = b.system.combined().expect("the joints share the inertia");
    let theta = [0.2, 0.8, 1.0, 0.0, 0.45, 0.55];
    let x: Vec<f64> = (0..2 * n).map(|i| 0.3 - 0.21 * i as f64).collect();
    let u = [0.4, -0.2, 1.3];
    let all = [x.clone(), theta.to_vec()].concat();
    let (at, wide) = (Point { t: 0.0, x: &x, u: &u, p: &[] }, Point { t: 0.0, x: &all, u: &u, p: &[] });
    let mut sum = value(b.system.f0().unwrap().as_ref(), &at);
    for (s, theta) in b.system.subsystems().iter().zip(theta.chunks(2)) {
        let modes = value(s.modes.as_ref(), &at);
        for (mode, theta) in modes.chunks(s.rows.len()).zip(theta) {
            s.rows.iter().zip(mode).for_each(|(&r, v)| sum[r] += theta * v);
        }
    }
    for (a, b) in sum.iter().zip(value(f.as_ref(), &wide)) {
        assert!((a - b).abs() <= 1e-13 * sum.iter().fold(1.0, |m: f64, v| m.max(v.abs())), "{a} {b}");
    }
    let r = check_derivatives(f.as_ref(), &wide, &CheckSettings::default()).unwrap();
    assert!(r.passed(), "{r}");
    // one part of the program solves, where each of the four functions did before
    let apart = b.functions.iter().map(|f| f.hessian_tape().len()).sum::<usize>();
    let own = f.as_any().and_then(|f| f.downcast_ref::<switchback::expr::ExprFunction>()).unwrap();
    assert!(2 * own.hessian_tape().len() < apart, "{} {apart}", own.hessian_tape().len());
    // the smoothed system has the weights inside
    let (smooth, widths) = b.system.smoothed().unwrap();
    (0..widths.len()).for_each(|k| widths.set(k, 0.5 + 0.1 * k as f64));
    assert!(smooth.subsystems().is_empty());
    let whole = smooth.f0().unwrap();
    let s = |v: f64, width: f64| 1.0 / (1.0 + (-2.0 * v / width).exp());
    let mut weights: Vec<f64> = (0..n).map(|k| s(x[n + k], 0.5 + 0.1 * k as f64)).flat_map(|s| [s, 1.0 - s]).collect();
    let signs = |k: usize| match &b.system.subsystems()[k].regions {
        Regions::Signs { signs, .. } => signs[0],
        Regions::Indicators(_) => unreachable!(),
    };
    (0..n).filter(|&k| signs(k) < 0).for_each(|k| weights.swap(2 * k, 2 * k + 1));
    let inside = [x.clone(), weights].concat();
    let expected = value(f.as_ref(), &Point { x: &inside, ..wide });
    for (a, b) in expected.iter().zip(value(whole.as_ref(), &at)) {
        assert!((a - b).abs() <= 1e-13 * a.abs().max(1.0), "{a} {b}");
    }
    let r = check_derivatives(whole.as_ref(), &at, &CheckSettings::default()).unwrap();
    assert!(r.passed(), "{r}");
}

#[test]
fn a_combined_right_hand_side_is_forgotten_where_dynamics_change() {
    let g = Graph::new();
    let b = arm_with_friction(&g, 2);
    let mut s = b.system.clone();
    s.set_f0(b.system.f0().unwrap().clone()).unwrap();
    assert!(s.combined().is_none());
    assert!(matches!(s.set_combined(b.system.f0().unwrap().clone()), Err(Error::Dimension(_))));
    // nothing is combined where no matrix is decomposed twice
    assert!(expression_models::blocks().system.combined().is_none());
}
