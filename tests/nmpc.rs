//! Closed loops whose costs are known, and what the theory says of the schemes (tests/data/nmpc).

// the report uses more of it
#[allow(dead_code)]
#[path = "common/nmpc.rs"]
mod problems;

use problems::{chain, pendulum, scheme, Case, Loop};
use std::sync::Arc;
use switchback::error::Error;
use switchback::expr::Graph;
use switchback::func::Dims;
use switchback::nmpc::*;
use switchback::ocp::{CostAt, Ocp};
use switchback::qp::QpStatus;
use switchback::settings::Settings;
use switchback::system::{SharedFunction, System};
use switchback::tableau::Family;

/// Costs that another implementation of the same schemes reaches, with as many digits as it gives.
fn costs(case: &Case, table: &[(&str, Options, f64, f64)]) {
    for (what, options, expected, tol) in table {
        let Loop { cost, controller: c, .. } = case.run(options);
        let m = c.monitor();
        let mean = |t: Timing| 1e6 * t.total / t.count as f64;
        println!("{what}: {cost:.7} ({expected}), {:.1} and {:.2} us", mean(m.preparation), mean(m.feedback));
        assert!((cost - expected).abs() <= tol * expected.abs(), "{what}: {cost:.8}, expected {expected}");
    }
}

#[test]
fn costs_of_closed_loops_with_the_pendulum() {
    let case = pendulum();
    assert!((first_cost(&case) - 39.464096).abs() < 1e-6);
    // five digits of the last rows were printed
    let table = [
        ("RTI", scheme(Scheme::Rti, Level::D0, 0), 50.527637, 2e-8),
        ("AS-RTI-D-1", scheme(Scheme::AsRti, Level::D0, 1), 42.949317, 2e-8),
        ("ideal", scheme(Scheme::Asc, Level::D0, 100), 42.968375, 2e-8),
        ("AS-RTI-D-2", scheme(Scheme::AsRti, Level::D0, 2), 42.9678, 2e-6),
        ("AS-RTI-D-3", scheme(Scheme::AsRti, Level::D0, 3), 42.9537, 2e-6),
        ("AS-RTI-A", scheme(Scheme::AsRti, Level::A, 1), 43.0446, 2e-6),
        ("AS-RTI-B-1", scheme(Scheme::AsRti, Level::B, 1), 43.0461, 2e-6),
        ("AS-RTI-B-3", scheme(Scheme::AsRti, Level::B, 3), 42.9431, 2e-6),
        ("AS-RTI-C-1", scheme(Scheme::AsRti, Level::C, 1), 42.9791, 2e-6),
        ("AS-RTI-C-3", scheme(Scheme::AsRti, Level::C, 3), 42.9606, 2e-6),
    ];
    costs(&case, &table);
    let stagewise = |o: Options| Options { qp: QpMethod::Stagewise, ..o };
    costs(&case, &table.map(|(what, options, cost, tol)| (what, stagewise(options), cost, tol)));
}

#[test]
fn costs_of_closed_loops_with_chains() {
    let case = chain(3);
    assert!((first_cost(&case) - 26.9445118).abs() < 1e-6);
    let table = [
        ("RTI", scheme(Scheme::Rti, Level::D0, 0), 28.066576, 2e-8),
        ("AS-RTI-D-1", scheme(Scheme::AsRti, Level::D0, 1), 28.056979, 2e-8),
        ("ideal", scheme(Scheme::Asc, Level::D0, 100), 28.057042, 2e-8),
        ("AS-RTI-D-2", scheme(Scheme::AsRti, Level::D0, 2), 28.0570, 2e-6),
    ];
    costs(&case, &table);
    let case = chain(6);
    assert!((first_cost(&case) - 49.5744795).abs() < 1e-6);
    let table = [
        ("RTI", scheme(Scheme::Rti, Level::D0, 0), 53.058806, 2e-8),
        ("AS-RTI-D-1", scheme(Scheme::AsRti, Level::D0, 1), 52.870885, 2e-8),
        ("AS-RTI-A", scheme(Scheme::AsRti, Level::A, 1), 52.8708, 2e-6),
        ("AS-RTI-B-3", scheme(Scheme::AsRti, Level::B, 3), 52.8680, 2e-6),
        ("AS-RTI-C-3", scheme(Scheme::AsRti, Level::C, 3), 52.8673, 2e-6),
    ];
    costs(&case, &table);
}

/// The cost of the plan for the first state.
fn first_cost(case: &Case) -> f64 {
    let mut c = Nmpc::new(&case.ocp, &scheme(Scheme::Rti, Level::D0, 0)).unwrap();
    c.initialise(&case.x0, 200).unwrap();
    let plan = c.plan();
    let (nx, nu, n) = (case.nx, case.nu, plan.u().len() / case.nu);
    let node = |k: usize| &plan.x()[k * nx..(k + 1) * nx];
    let stages: f64 = (0..n).map(|k| case.stage_cost(node(k), &plan.u()[k * nu..(k + 1) * nu])).sum();
    let last = node(n).iter().zip(&case.xref).zip(&case.qn);
    stages + last.map(|((x, y), w)| 0.5 * w * (x - y).powi(2)).sum::<f64>()
}

/// Proposition 10.1: with a level-A inner iteration and a perfect prediction, the linearisation points are those of the RTI that
/// gets the same states; adding the inner step to the last output, which holds the same corrector already, they are not.
#[test]
fn level_a_with_a_perfect_prediction_linearises_where_the_rti_does() {
    let case = pendulum();
    // near the top, where the active set is empty and stays so: the proposition is for a fixed one
    let start = vec![0.01, 0.02, 0.0, 0.0];
    let make = |options: &Options| {
        let mut c = Nmpc::new(&case.ocp, options).unwrap();
        c.set_iterate(&[0.005; 41 * 4], &[0.0; 40]).unwrap();
        c.initialise(&start, 200).unwrap();
        c.prepare(None).unwrap();
        c
    };
    let mut rti = make(&scheme(Scheme::Rti, Level::D0, 0));
    let mut advanced = make(&scheme(Scheme::AsRti, Level::A, 1));
    let (mut x, mut u) = (start.clone(), vec![0.0]);
    let (mut worst, mut mutant, mut size) = (0.0f64, 0.0f64, 0.0f64);
    for k in 0..80usize {
        let before = advanced.linearisation().clone();
        advanced.feedback(&x, &mut u).unwrap();
        let output = advanced.plan().clone();
        case.plant(&mut x, &u);
        x[3] += 0.02 * (((k * 7919) % 13) as f64 / 13.0 - 0.5);
        advanced.prepare(Some(&x)).unwrap();
        rti.feedback(&x, &mut u).unwrap();
        rti.prepare(None).unwrap();
        let (now, expected) = (advanced.linearisation(), rti.linearisation());
        for (a, e) in now.x().iter().chain(now.u()).zip(expected.x().iter().chain(expected.u())) {
            size = size.max(e.abs());
            worst = worst.max((a - e).abs());
        }
        for ((e, b), o) in expected.x().iter().zip(before.x()).zip(output.x()) {
            mutant = mutant.max((o + (e - b) - e).abs());
        }
    }
    assert!(worst <= 1e-12 * size, "{worst:e} of {size}");
    assert!(mutant > 1e-6 * size, "a corrector added twice must be seen: {mutant:e} of {size}");
}

/// Table 10.1: what an iteration of every level evaluates, by counting.
#[test]
fn levels_evaluate_what_the_table_says() {
    let case = pendulum();
    let points_of_a_step = 4;
    for (level, jacobians, adjoints, hessians) in [
        (Level::A, 0, 0, 0),
        (Level::B, 0, 0, 0),
        (Level::C, 0, 1, 0),
        (Level::D0, 1, 0, 0),
        (Level::D1, 1, 0, 0),
        (Level::D2, 1, 0, 1),
    ] {
        let mut c = Nmpc::new(&case.ocp, &scheme(Scheme::Mli, level, 0)).unwrap();
        c.set_iterate(&vec![0.1; 41 * 4], &vec![0.0; 40]).unwrap();
        let mut u = [0.0];
        c.prepare(None).unwrap();
        c.feedback(&[0.1; 4], &mut u).unwrap();
        let before = c.monitor().evaluations;
        assert_eq!(before, c.monitor().last_evaluations);
        // feedback and what follows it evaluate nothing
        c.finish();
        c.feedback(&[0.1; 4], &mut u).unwrap();
        c.prepare(None).unwrap();
        let e = c.monitor().last_evaluations;
        let values = if level == Level::A { 0 } else { 1 + points_of_a_step };
        // dynamics and node functions count one each
        assert_eq!(
            (e.values, e.jacobians > 0, e.adjoints > 0, e.hessians > 0),
            (values, jacobians > 0, adjoints > 0, hessians > 0),
            "{level:?}"
        );
        assert_eq!(c.monitor().evaluations.values - before.values, e.values, "{level:?}");
    }
}

/// Iterations of levels C and D on one problem end at its solution, those of level B at a feasible point.
#[test]
fn levels_converge_where_they_should() {
    let case = pendulum();
    let mut exact = Nmpc::new(&case.ocp, &scheme(Scheme::Rti, Level::D0, 0)).unwrap();
    exact.initialise(&case.x0, 200).unwrap();
    let near: Vec<f64> = case.x0.iter().zip([0.004, 0.01, -0.006, 0.02]).map(|(x, d)| x + d).collect();
    let (x, u) = (exact.plan().x().to_vec(), exact.plan().u().to_vec());
    exact.initialise(&near, 200).unwrap();
    let solution = exact.plan().clone();
    for level in [Level::B, Level::C, Level::D0, Level::D1, Level::D2] {
        let mut c = Nmpc::new(&case.ocp, &scheme(Scheme::Mli, level, 0)).unwrap();
        c.set_iterate(&x, &u).unwrap();
        let mut errors = Vec::new();
        let mut feedback = vec![0.0];
        for _ in 0..40 {
            c.prepare(None).unwrap();
            c.feedback(&near, &mut feedback).unwrap();
            let e = c.plan().x().iter().zip(solution.x()).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
            errors.push(e);
        }
        let last = errors[39];
        if level == Level::B {
            assert!(last > 1e-6, "level B has no reason to be optimal: {last:e}");
        } else {
            assert!(last < 1e-8, "{level:?}: {last:e}");
        }
        // feasible in any case
        let gap = model_gap(&case, &c.plan().clone());
        assert!(gap < 1e-9, "{level:?}: {gap:e}");
    }
}

/// What is left of the dynamics of a plan.
fn model_gap(case: &Case, plan: &Iterate) -> f64 {
    let (nx, nu) = (case.nx, case.nu);
    let one_step = Case { plant_steps: case.steps, ocp: case.ocp.blank(), f: case.f.clone(), ..pendulum() };
    let mut worst = 0.0f64;
    for k in 0..plan.u().len() / nu {
        let mut x = plan.x()[k * nx..(k + 1) * nx].to_vec();
        one_step.plant(&mut x, &plan.u()[k * nu..(k + 1) * nu]);
        let next = &plan.x()[(k + 1) * nx..(k + 2) * nx];
        worst = x.iter().zip(next).fold(worst, |m, (a, b)| m.max((a - b).abs()));
    }
    worst
}

/// The error of the feedback to a state beside the predicted one: of second order with exact Hessians, whose program is the derivative
/// of the solution; with those of Gauss and Newton a share of the step is wrong, which shows for small ones.
#[test]
fn tangential_predictions_are_of_second_order() {
    let case = pendulum();
    // near the top: no bound of the control is met, and no Hessian has to be made convex
    let x0 = [0.002, 0.004, 0.0, -0.002];
    let sizes = [0.005f64, 0.0025, 0.00125, 0.000625, 0.0003125];
    let slope = |level: Level| {
        let mut exact = Nmpc::new(&case.ocp, &scheme(Scheme::Rti, Level::D0, 0)).unwrap();
        let mut c = Nmpc::new(&case.ocp, &scheme(Scheme::Asc, level, 100)).unwrap();
        exact.set_iterate(&[0.0; 41 * 4], &[0.0; 40]).unwrap();
        exact.initialise(&x0, 200).unwrap();
        let start = exact.plan().clone();
        let points = sizes.map(|size| {
            let x: Vec<f64> = x0.iter().zip([0.3, 1.0, -0.5, 0.7]).map(|(x, d)| x + size * d).collect();
            exact.set_iterate(start.x(), start.u()).unwrap();
            exact.initialise(&x, 200).unwrap();
            c.set_iterate(start.x(), start.u()).unwrap();
            c.prepare(Some(&x0)).unwrap();
            let mut u = [0.0];
            c.feedback(&x, &mut u).unwrap();
            let error = c.plan().u().iter().zip(exact.plan().u()).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
            [size.ln(), error.ln()]
        });
        // of the line through the points
        let mean = |k: usize| points.iter().map(|p| p[k]).sum::<f64>() / points.len() as f64;
        let (a, b) = (mean(0), mean(1));
        let sum = |f: fn(f64, f64) -> f64| points.iter().map(|p| f(p[0] - a, p[1] - b)).sum::<f64>();
        let slope = sum(|x, y| x * y) / sum(|x, _| x * x);
        println!("{level:?}: {points:?}, slope {slope:.3}");
        slope
    };
    let exact = slope(Level::D2);
    assert!((1.9..2.2).contains(&exact), "{exact}");
    assert!(slope(Level::D0) < exact - 0.3);
}

/// There is a control for everything, within its bounds, and it says where it comes from.
#[test]
fn there_always_is_a_control() {
    let case = pendulum();
    let mut c = Nmpc::new(&case.ocp, &scheme(Scheme::Rti, Level::D0, 0)).unwrap();
    let mut u = [f64::NAN];
    // nothing prepared: the plan of the guess
    assert_eq!(c.feedback(&case.x0, &mut u).unwrap().source, Source::Plan);
    assert!(u[0].abs() <= 12.0);
    c.initialise(&case.x0, 200).unwrap();
    let plan = c.plan().u().to_vec();
    c.prepare(None).unwrap();
    assert_eq!(c.feedback(&case.x0, &mut u).unwrap().source, Source::Qp);
    assert!((u[0] - plan[0]).abs() < 1e-6);
    for k in 1..60 {
        // no measurement: the plan goes on, then the last control stays
        c.prepare(None).unwrap();
        let info = c.feedback(&[f64::NAN; 4], &mut u).unwrap();
        let expected = if k < 40 { Source::Plan } else { Source::Hold };
        assert_eq!(info.source, expected, "{k}");
        assert!((u[0] - plan[k.min(39)]).abs() < 1e-6, "{k}");
    }
    c.prepare(None).unwrap();
    let far = [1e200, -1e200, 1e200, 1e200];
    c.feedback(&far, &mut u).unwrap();
    assert!(u[0].abs() <= 12.0);
    c.prepare(None).unwrap();
    // the plan to a state out of reach has no values: the linearisation before is used further
    assert!(c.feedback(&case.x0, &mut u).is_ok());
    assert!(u[0].abs() <= 12.0);
    c.reset();
    c.initialise(&case.x0, 200).unwrap();
    c.prepare(None).unwrap();
    assert_eq!(c.feedback(&case.x0, &mut u).unwrap().source, Source::Qp);
    c.set_deadline(1e-12).unwrap();
    c.prepare(None).unwrap();
    let info = c.feedback(&[0.3, 2.0, 1.0, -3.0], &mut u).unwrap();
    assert!(matches!(info.source, Source::Qp | Source::Tangent), "{info:?}");
    assert!(u[0].abs() <= 12.0);
    assert!(c.feedback(&[0.0; 3], &mut u).is_err());
    assert!(c.set_deadline(f64::NAN).is_err());
}

/// Rows that cannot be met are met as well as possible.
#[test]
fn infeasible_programs_are_softened() {
    let mut case = pendulum();
    case.ocp.set_x_guess(&[0.0], &[0.0; 4]).unwrap();
    case.ocp.set_x_bounds(&[-0.2, -10.0, -50.0, -50.0], &[0.2, 10.0, 50.0, 50.0]).unwrap();
    for qp in [QpMethod::Condensing, QpMethod::Stagewise] {
        let mut c = Nmpc::new(&case.ocp, &Options { qp, ..scheme(Scheme::Rti, Level::D0, 0) }).unwrap();
        let mut u = [0.0];
        let mut sources = Vec::new();
        for x in [[0.0, 0.1, 0.0, 0.0], [0.0, 0.1, 3.0, 0.0], [5.0, 0.0, 0.0, 0.0]] {
            c.reset();
            c.prepare(None).unwrap();
            sources.push(c.feedback(&x, &mut u).unwrap().source);
            assert!(u[0].abs() <= 12.0);
        }
        assert_eq!(sources[0], Source::Qp);
        assert_eq!(sources[2], Source::SoftQp);
    }
}

/// A bound on changes is kept where rows contradict each other; the plan then is finished in the preparation, with the control that was given, and the next
/// sample, at the state that was predicted, has next to nothing to do.
#[test]
fn feedback_of_bounded_work_is_finished_later() {
    let mut case = pendulum();
    case.ocp.set_x_guess(&[0.0], &[0.0; 4]).unwrap();
    case.ocp.set_x_bounds(&[-0.2, -10.0, -50.0, -50.0], &[0.2, 10.0, 50.0, 50.0]).unwrap();
    for (qp, max_changes) in [(QpMethod::Condensing, 4), (QpMethod::Stagewise, 2)] {
        let options = Options { qp, max_changes, shift: true, ..scheme(Scheme::Rti, Level::D0, 0) };
        let mut c = Nmpc::new(&case.ocp, &options).unwrap();
        let mut u = [0.0];
        for x in [[5.0, 0.0, 0.0, 0.0], [-1.0, 0.2, -3.0, 0.0]] {
            c.reset();
            c.prepare(None).unwrap();
            let info = c.feedback(&x, &mut u).unwrap();
            assert_eq!((info.source, info.status), (Source::Tangent, QpStatus::OutOfTime), "{qp:?}");
            // the program with prices is looked at once at least
            assert!(info.iterations <= max_changes + 1, "{qp:?}: {info:?}");
            let plan = c.plan();
            assert_eq!(plan.u()[0], u[0], "{qp:?}");
            let next = plan.x()[4..8].to_vec();
            assert!(plan.x()[..4].iter().zip(&x).all(|(a, b)| (a - b).abs() < 1e-12));
            c.prepare(None).unwrap();
            let info = c.feedback(&next, &mut u).unwrap();
            assert_eq!((info.source, info.status), (Source::SoftQp, QpStatus::Infeasible), "{qp:?}");
            assert!(info.iterations <= 2, "{qp:?}: {info:?}");
        }
    }
}

/// Both methods give the same controls, where rows are met and where they cannot be, with the same prices.
#[test]
fn both_methods_for_quadratic_programs_agree() {
    let mut case = pendulum();
    case.ocp.set_x_guess(&[0.0], &[0.0; 4]).unwrap();
    case.ocp.set_x_bounds(&[-0.4, -1.0, -5.0, -5.0], &[0.4, 1.0, 5.0, 5.0]).unwrap();
    let options = Options { elastic_price: 1e4, ..scheme(Scheme::Rti, Level::D0, 0) };
    let controller = |qp| Nmpc::new(&case.ocp, &Options { qp, ..options.clone() }).unwrap();
    let mut both = [controller(QpMethod::Condensing), controller(QpMethod::Stagewise)];
    let mut seen = [0; 2];
    let mut s = 7u64;
    let mut number = || {
        s = s.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (s >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
    };
    for sample in 0..60 {
        let x = [0.5 * number(), 0.3 * number(), number(), number()];
        let answers = both.each_mut().map(|c| {
            let mut u = [0.0];
            c.reset();
            c.prepare(None).unwrap();
            let f = c.feedback(&x, &mut u).unwrap();
            (f.source, u[0], c.plan().u().to_vec())
        });
        assert_eq!(answers[0].0, answers[1].0, "{sample}");
        let off = answers[0].2.iter().zip(&answers[1].2).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        // where rows contradict each other the last controls hardly move the cost, and are determined to few digits
        let tol = if answers[0].0 == Source::Qp { 1e-8 } else { 1e-3 };
        assert!((answers[0].1 - answers[1].1).abs() < 1e-8 && off < tol, "{sample}: {off:e}");
        seen[usize::from(answers[0].0 == Source::SoftQp)] += 1;
    }
    assert!(seen.iter().all(|n| *n >= 10), "{seen:?}");
    assert_eq!(both[1].options().qp, QpMethod::Stagewise);
}

/// A mass that is pushed against a load, which is a parameter; the place it is to be at is a reference.
fn loaded(scheme: Scheme, level: Level) -> Nmpc {
    let g = Graph::new();
    let dims = Dims { x: 2, u: 1, p: 1 };
    let mass: SharedFunction = Arc::new(g.function("mass", dims, &[g.x(1), g.u(0) - g.p(0)]).unwrap());
    let all: SharedFunction = Arc::new(g.function("all", dims, &[g.x(0), g.x(1), g.u(0) - g.p(0)]).unwrap());
    let mut system = System::new(2, 1, 1).unwrap();
    system.set_f0(mass).unwrap();
    let mut ocp = Ocp::new(&system, 2.0, 10, &Settings::default()).unwrap();
    ocp.add_least_squares(all, &[2.0, 0.1, 0.5], &[0.0; 3], CostAt::Running).unwrap();
    ocp.set_u_bounds(&[-3.0], &[3.0]).unwrap();
    ocp.set_x_bounds(&[-9.0, -0.6], &[9.0, 0.6]).unwrap();
    ocp.set_params(&[0.0]).unwrap();
    let explicit = Options { family: Some(Family::Explicit), n_s: 4, steps: 1, ..Options::default() };
    let mut c = Nmpc::new(&ocp, &Options { scheme, level, inner: 1, ..explicit }).unwrap();
    c.set_iterate(&[0.1; 22], &[0.2; 10]).unwrap();
    c
}

/// References and parameters that come between a preparation and its feedback are in the control: where they change vectors of the
/// program alone, it is the control that a preparation with them would have given.
#[test]
fn what_is_set_between_preparation_and_feedback_counts() {
    let x = [0.3, -0.2];
    let all = [Level::A, Level::B, Level::C, Level::D0, Level::D1, Level::D2];
    for (scheme, level) in
        all.map(|l| (Scheme::Mli, l)).into_iter().chain([(Scheme::Rti, Level::D0), (Scheme::AsRti, Level::B)])
    {
        let what = format!("{scheme:?} {level:?}");
        let (mut early, mut late, mut never) = (loaded(scheme, level), loaded(scheme, level), loaded(scheme, level));
        let (mut u, mut v, mut w) = ([0.0], [0.0], [0.0]);
        // the second sample has a program of the level
        for c in [&mut early, &mut late, &mut never] {
            c.prepare(None).unwrap();
            c.feedback(&[0.35, -0.1], &mut u).unwrap();
            c.finish();
        }
        early.set_references(0, &[1.0, 0.0, 0.0]).unwrap();
        early.set_params(&[0.7]).unwrap();
        for c in [&mut early, &mut late, &mut never] {
            c.prepare(None).unwrap();
        }
        late.set_references(0, &[1.0, 0.0, 0.0]).unwrap();
        late.set_params(&[0.7]).unwrap();
        for (c, u) in [(&mut early, &mut u), (&mut late, &mut v), (&mut never, &mut w)] {
            assert_eq!(c.feedback(&x, u).unwrap().source, Source::Qp, "{what}");
        }
        assert!((u[0] - v[0]).abs() < 1e-11, "{what}: {} and {}", u[0], v[0]);
        assert!((u[0] - w[0]).abs() > 0.1, "{what}: {} and {}", u[0], w[0]);
    }
}

/// The same calls give the same bits.
/// A mass with bounds of its speed and its control, and its weights.
fn bounded(weights: &[f64], speed: f64, force: f64, qp: QpMethod, level: Level) -> Nmpc {
    let g = Graph::new();
    let dims = Dims { x: 2, u: 1, p: 0 };
    let f: SharedFunction = Arc::new(g.function("f", dims, &[g.x(1), g.u(0)]).unwrap());
    let all: SharedFunction = Arc::new(g.function("all", dims, &[g.x(0), g.x(1), g.u(0)]).unwrap());
    let mut system = System::new(2, 1, 0).unwrap();
    system.set_f0(f).unwrap();
    let mut ocp = Ocp::new(&system, 2.0, 20, &Settings::default()).unwrap();
    ocp.add_least_squares(all, weights, &[0.0; 3], CostAt::Running).unwrap();
    ocp.set_u_bounds(&[-force], &[force]).unwrap();
    ocp.set_x_bounds(&[f64::NEG_INFINITY, -speed], &[f64::INFINITY, speed]).unwrap();
    let scheme = if level == Level::D0 { Scheme::Rti } else { Scheme::Mli };
    let explicit = Options { family: Some(Family::Explicit), n_s: 4, steps: 1, ..Options::default() };
    Nmpc::new(&ocp, &Options { scheme, level, qp, ..explicit }).unwrap()
}

/// What is set is what a controller has that is made of it: bounds at once, weights from the next preparation on.
#[test]
fn weights_and_bounds_at_run_time() {
    let x = [1.0, -0.2];
    let first = |c: &mut Nmpc| {
        let mut u = [0.0];
        assert_eq!(c.feedback(&x, &mut u).unwrap().source, Source::Qp);
        (u[0], c.plan().x().to_vec())
    };
    let close = |a: &(f64, Vec<f64>), b: &(f64, Vec<f64>)| {
        (a.0 - b.0).abs() < 1e-9 && a.1.iter().zip(&b.1).all(|(a, b)| (a - b).abs() < 1e-9)
    };
    for qp in [QpMethod::Condensing, QpMethod::Stagewise] {
        for level in [Level::D0, Level::C] {
            let made = |weights: &[f64], speed, force| {
                let mut c = bounded(weights, speed, force, qp, level);
                c.prepare(None).unwrap();
                c
            };
            let (old, new) = ([5.0, 0.1, 0.01], [1.0, 0.1, 0.5]);
            let before = first(&mut made(&old, 2.0, 3.0));
            let mut c = made(&old, 2.0, 3.0);
            c.set_control_bounds(&[-1.0], &[0.7]).unwrap();
            c.set_control_bounds(&[-1.0], &[1.0]).unwrap();
            assert!(close(&first(&mut c), &first(&mut made(&old, 2.0, 1.0))));
            let mut c = made(&old, 2.0, 3.0);
            c.set_state_bounds(&[f64::NEG_INFINITY, -0.4], &[f64::INFINITY, 0.4]).unwrap();
            let slow = first(&mut c);
            assert!(close(&slow, &first(&mut made(&old, 0.4, 3.0))) && !close(&slow, &before));
            let mut c = made(&old, 2.0, 3.0);
            c.set_weights(0, &new).unwrap();
            assert!(close(&first(&mut c), &before));
            c.reset();
            c.prepare(None).unwrap();
            let lazy = first(&mut c);
            assert!(close(&lazy, &first(&mut made(&new, 2.0, 3.0))) && !close(&lazy, &before));
            // a matrix counts by its symmetric part
            c.set_weights(0, &[5.0, 0.2, 0.0, -0.2, 0.1, 0.0, 0.0, 0.0, 0.01]).unwrap();
            c.prepare(None).unwrap();
            assert!(close(&first(&mut c), &before));
        }
    }
    let mut c = bounded(&[1.0; 3], 1.0, 1.0, QpMethod::Auto, Level::D0);
    assert!(matches!(c.set_weights(1, &[1.0; 3]), Err(Error::Range(_))));
    assert!(matches!(c.set_weights(0, &[1.0; 2]), Err(Error::Dimension(_))));
    assert!(matches!(c.set_control_bounds(&[1.0], &[0.0]), Err(Error::Range(_))));
    assert!(matches!(c.set_control_bounds(&[], &[]), Err(Error::Dimension(_))));
    let unknown = c.set_state_bounds(&[-1.0, -1.0], &[1.0, 1.0]);
    assert!(matches!(unknown, Err(Error::Range(what)) if what.contains("state 0 has no bound")));
}

/// The first multiplier is the derivative of the cost by the initial value, that of a row by its bound; the gain that of the control.
#[test]
fn multipliers_and_gains_are_derivatives() {
    for qp in [QpMethod::Condensing, QpMethod::Stagewise] {
        let mut c = bounded(&[5.0, 0.1, 0.1], 0.5, 3.0, qp, Level::D0);
        let mut cost = |x: &[f64; 2], speed: f64| {
            c.reset();
            c.set_state_bounds(&[f64::NEG_INFINITY, -speed], &[f64::INFINITY, speed]).unwrap();
            c.prepare(None).unwrap();
            let mut u = [0.0];
            c.feedback(x, &mut u).unwrap();
            let objective = c.objective().unwrap();
            let mut gain = [0.0; 2];
            c.prepare(None).unwrap();
            c.gain(&mut gain).unwrap();
            let plan = c.plan();
            (objective, plan.lambda()[..2].to_vec(), plan.row_mu().iter().sum::<f64>(), u[0], gain)
        };
        let (x, d) = ([0.6, -0.1], 1e-5);
        let (_, lambda, mu, ..) = cost(&x, 0.5);
        for i in 0..2 {
            let mut moved = |by: f64| {
                let mut y = x;
                y[i] += by;
                cost(&y, 0.5).0
            };
            let slope = (moved(d) - moved(-d)) / (2.0 * d);
            assert!((slope - lambda[i]).abs() < 1e-6 * (1.0 + slope.abs()), "{qp:?} {i}: {slope} {}", lambda[i]);
        }
        // all speeds are at the lower bound, which moves with the upper one: -mu
        let slope = (cost(&x, 0.5 + d).0 - cost(&x, 0.5 - d).0) / (2.0 * d);
        assert!(mu < -1e-3 && (slope - mu).abs() < 1e-5, "{qp:?}: {slope} {mu}");
        let (.., gain) = cost(&[0.01, 0.0], 0.5);
        for (i, gain) in gain.iter().enumerate() {
            let mut at = |by: f64| cost(&[if i == 0 { by } else { 0.0 }, if i == 1 { by } else { 0.0 }], 0.5).3;
            let slope = (at(1e-3) - at(-1e-3)) / 2e-3;
            assert!((slope - gain).abs() < 1e-7 * (1.0 + slope.abs()), "{qp:?} {i}: {slope} {gain}");
        }
        assert!(matches!(c.gain(&mut [0.0]), Err(Error::Dimension(_))));
        c.reset();
        assert!(matches!(c.gain(&mut [0.0; 2]), Err(Error::State(_))));
    }
}

#[test]
fn runs_repeat_to_the_bit() {
    let case = pendulum();
    let options = scheme(Scheme::AsRti, Level::C, 2);
    let (a, b) = (case.run(&options).cost, case.run(&options).cost);
    assert_eq!(a.to_bits(), b.to_bits());
}

/// What a controller does not know is said when it is made.
#[test]
fn what_is_not_known_is_said() {
    let case = pendulum();
    let with = |change: &dyn Fn(&mut Ocp)| {
        let mut ocp = case.ocp.blank();
        change(&mut ocp);
        Nmpc::new(&ocp, &Options::default()).map(|_| ()).unwrap_err().to_string()
    };
    assert!(with(&|o| o.set_free_time(switchback::ocp::Durations::Horizon, 1.0, 2.0).unwrap())
        .contains("lengths of stages"));
    assert!(with(&|o| o.set_linear_controls(&[true]).unwrap()).contains("linear controls"));
    assert!(with(&|o| o.add_periodic(&[0]).unwrap()).contains("between the two ends"));
    let mut o = Options { tol: -1.0, ..Options::default() };
    assert!(Nmpc::new(&case.ocp, &o).is_err());
    o = Options { family: Some(Family::LobattoIiib), n_s: 2, ..Options::default() };
    assert!(Nmpc::new(&case.ocp, &o).map(|_| ()).unwrap_err().to_string().contains("singular"));
}
