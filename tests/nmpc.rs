//! Closed loops whose costs are known, and what the theory says of the schemes (tests/data/nmpc).

use std::sync::Arc;
use switchback::expr::Graph;
use switchback::func::{Dims, Point};
use switchback::nmpc::*;
use switchback::ocp::{CostAt, Ocp};
use switchback::settings::Settings;
use switchback::system::{SharedFunction, System};
use switchback::tableau::Family;

/// A benchmark: problem, plant, disturbances.
struct Case {
    ocp: Ocp,
    nx: usize,
    nu: usize,
    ts: f64,
    steps: usize,
    plant_steps: usize,
    q: Vec<f64>,
    r: Vec<f64>,
    qn: Vec<f64>,
    xref: Vec<f64>,
    x0: Vec<f64>,
    samples: usize,
    seed: u64,
    amp: Vec<f64>,
    kicks: Vec<(usize, Vec<f64>)>,
    f: SharedFunction,
}

/// Numbers of `tests/data/nmpc/problems.json`.
fn numbers(case: &str, name: &str) -> Vec<f64> {
    let all: serde_json::Value = serde_json::from_str(include_str!("data/nmpc/problems.json")).unwrap();
    all[case][name].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

/// `m` masses on springs between a fixed point and one that is moved: the controls are its velocity.
fn chain(m: usize) -> Case {
    let g = Graph::new();
    let nx = 6 * m + 3;
    let at = |i: usize, c: usize| if i == 0 { g.constant(0.0) } else { g.x(3 * (i - 1) + c) };
    let (mass, stiffness, rest) = (0.03, 1.0, 0.033);
    let spring: Vec<Vec<_>> = (0..=m)
        .map(|i| {
            let d: Vec<_> = (0..3).map(|c| at(i + 1, c) - at(i, c)).collect();
            let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
            let f = (1.0 - rest / length) * stiffness;
            d.into_iter().map(|d| f * d).collect()
        })
        .collect();
    let velocity = |i: usize, c: usize| g.x(3 * (m + 1) + 3 * i + c);
    let mut rates: Vec<_> = (0..m).flat_map(|i| (0..3).map(move |c| (i, c))).map(|(i, c)| velocity(i, c)).collect();
    rates.extend((0..3).map(|c| g.u(c)));
    for pair in spring.windows(2).take(m) {
        for (c, (before, behind)) in pair[0].iter().zip(&pair[1]).enumerate() {
            let weight = if c == 2 { -9.81 } else { 0.0 };
            rates.push((*behind - *before) / mass + weight);
        }
    }
    let f: SharedFunction = Arc::new(g.function("chain", Dims { x: nx, u: 3, p: 0 }, &rates).unwrap());
    let name = format!("chain{m}");
    let (q, r, qn) = (numbers(&name, "Q_diag"), numbers(&name, "R_diag"), numbers(&name, "QN_diag"));
    let mut kick = vec![0.0; nx];
    kick[3 * (m + 1)..].iter_mut().enumerate().for_each(|(i, v)| *v = [0.4, -0.8, 0.4][i % 3]);
    tracking(f, 40, 0.2, 2, q, r, qn, numbers(&name, "xref"), numbers(&name, "x0"), 1.0).with(
        60,
        2,
        numbers(&name, "noise_amp"),
        vec![(25, kick)],
    )
}

/// The swing-up of a pendulum on a cart: states (p, theta, v, omega), theta = 0 upright.
fn pendulum() -> Case {
    let g = Graph::new();
    let [th, v, om, force] = [g.x(1), g.x(2), g.x(3), g.u(0)];
    let (mc, mp, l, grav) = (1.0, 0.1, 0.5, 9.81);
    let d = th.sin() * th.sin() * mp + mc;
    let t = force + om * om * th.sin() * (mp * l);
    let dv = (t - th.sin() * th.cos() * (mp * grav)) / d;
    let dom = (th.sin() * ((mc + mp) * grav) - t * th.cos()) / (d * l);
    let dims = Dims { x: 4, u: 1, p: 0 };
    let f: SharedFunction = Arc::new(g.function("pendulum", dims, &[v, om, dv, dom]).unwrap());
    let (q, r, qn) = (vec![10.0, 10.0, 0.1, 0.1], vec![0.01], vec![100.0, 100.0, 10.0, 10.0]);
    tracking(f, 40, 0.05, 1, q, r, qn, vec![0.0; 4], vec![0.0, std::f64::consts::PI, 0.0, 0.0], 12.0).with(
        120,
        1,
        vec![0.0, 0.0, 0.02, 0.05],
        vec![(60, vec![0.0, 0.0, 0.0, 2.0]), (90, vec![0.0, 0.0, -0.8, -1.5])],
    )
}

/// `½ (x − xref)' Q (x − xref) + ½ u' R u`, summed over the starts of the stages, and a terminal cost.
#[allow(clippy::too_many_arguments)]
fn tracking(
    f: SharedFunction,
    n: usize,
    ts: f64,
    steps: usize,
    q: Vec<f64>,
    r: Vec<f64>,
    qn: Vec<f64>,
    xref: Vec<f64>,
    x0: Vec<f64>,
    limit: f64,
) -> Case {
    let d = f.dims();
    let mut system = System::new(d.x, d.u, d.p).unwrap();
    system.set_f0(f.clone()).unwrap();
    let mut settings = Settings::default();
    settings.set_by_name("rk_family", "explicit").unwrap();
    settings.set_by_name("n_s", 4i64).unwrap();
    settings.set_by_name("n_fe", steps as i64).unwrap();
    let mut ocp = Ocp::new(&system, n as f64 * ts, n, &settings).unwrap();
    let g = Graph::new();
    let all: Vec<_> = (0..d.x).map(|i| g.x(i)).chain((0..d.u).map(|i| g.u(i))).collect();
    let stage: SharedFunction = Arc::new(g.function("stage", d, &all).unwrap());
    let end: SharedFunction = Arc::new(g.function("end", d, &all[..d.x]).unwrap());
    let half = |v: &[f64]| v.iter().map(|v| 0.5 * v).collect::<Vec<_>>();
    let weights = [half(&q), half(&r)].concat();
    let mut reference = xref.clone();
    reference.extend(vec![0.0; d.u]);
    ocp.add_least_squares(stage, &weights, &reference, CostAt::Running).unwrap();
    ocp.add_least_squares(end, &half(&qn), &xref, CostAt::Terminal).unwrap();
    ocp.set_u_bounds(&vec![-limit; d.u], &vec![limit; d.u]).unwrap();
    ocp.set_x0(&x0).unwrap();
    let line: Vec<f64> = x0.iter().chain(&xref).copied().collect();
    ocp.set_x_guess(&[0.0, n as f64 * ts], &line).unwrap();
    let (nx, nu) = (d.x, d.u);
    let (amp, kicks) = (vec![0.0; nx], Vec::new());
    Case { ocp, nx, nu, ts, steps, plant_steps: 10, q, r, qn, xref, x0, samples: 0, seed: 0, amp, kicks, f }
}

impl Case {
    fn with(self, samples: usize, seed: u64, amp: Vec<f64>, kicks: Vec<(usize, Vec<f64>)>) -> Case {
        Case { samples, seed, amp, kicks, ..self }
    }

    /// The plant over one sample: the classical method with small steps.
    fn plant(&self, x: &mut [f64], u: &[f64]) {
        let (nx, h) = (self.nx, self.ts / self.plant_steps as f64);
        let mut work = vec![0.0; self.f.work_len()];
        let mut f = |x: &[f64], out: &mut [f64]| {
            self.f.value(&Point { t: 0.0, x, u, p: &[] }, out, &mut work).unwrap();
        };
        for _ in 0..self.plant_steps {
            let mut k = vec![vec![0.0; nx]; 4];
            for i in 0..4 {
                let c = [0.0, 0.5, 0.5, 1.0][i];
                let z: Vec<f64> = (0..nx).map(|j| x[j] + if i > 0 { c * h * k[i - 1][j] } else { 0.0 }).collect();
                f(&z, &mut k[i]);
            }
            (0..nx).for_each(|j| x[j] += h / 6.0 * (k[0][j] + 2.0 * k[1][j] + 2.0 * k[2][j] + k[3][j]));
        }
    }

    fn stage_cost(&self, x: &[f64], u: &[f64]) -> f64 {
        let part = |w: &[f64], v: &[f64], y: &dyn Fn(usize) -> f64| -> f64 {
            w.iter().zip(v).enumerate().map(|(i, (w, v))| 0.5 * w * (v - y(i)).powi(2)).sum()
        };
        self.ts * (part(&self.q, x, &|i| self.xref[i]) + part(&self.r, u, &|_| 0.0))
    }

    /// The closed loop.
    fn run(&self, options: &Options) -> (f64, Nmpc) {
        // every problem solved with the state that will be measured
        let ideal = options.scheme == Scheme::Asc;
        let mut c = Nmpc::new(&self.ocp, options).unwrap();
        c.initialise(&self.x0, 200).unwrap();
        let mut x = self.x0.clone();
        let mut u = vec![0.0; self.nu];
        let (mut cost, mut s) = (0.0, self.seed);
        for k in 0..self.samples {
            c.prepare(ideal.then_some(&x)).unwrap();
            let info = c.feedback(&x, &mut u).unwrap();
            assert_eq!(info.source, Source::Qp, "{k}");
            cost += self.stage_cost(&x, &u);
            self.plant(&mut x, &u);
            for (x, amp) in x.iter_mut().zip(&self.amp) {
                s = s.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                *x += amp * (2.0 * ((s >> 11) as f64 * 2f64.powi(-53)) - 1.0);
            }
            if let Some((_, kick)) = self.kicks.iter().find(|e| e.0 == k) {
                x.iter_mut().zip(kick).for_each(|(x, d)| *x += d);
            }
        }
        (cost, c)
    }
}

fn scheme(scheme: Scheme, level: Level, inner: usize) -> Options {
    Options { scheme, level, inner, family: Some(Family::Explicit), ..Options::default() }
}

/// Costs that another implementation of the same schemes reaches, with as many digits as it gives.
fn costs(case: &Case, table: &[(&str, Options, f64, f64)]) {
    for (what, options, expected, tol) in table {
        let (cost, c) = case.run(options);
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

/// The error of the feedback to a state beside the predicted one is of second order: the tangential predictor.
#[test]
fn tangential_predictions_are_of_second_order() {
    let case = pendulum();
    let mut exact = Nmpc::new(&case.ocp, &scheme(Scheme::Rti, Level::D0, 0)).unwrap();
    let mut c = Nmpc::new(&case.ocp, &scheme(Scheme::Asc, Level::D0, 100)).unwrap();
    // near the top: no bound of the control is met
    let x0 = [0.002, 0.004, 0.0, -0.002];
    let mut errors = Vec::new();
    let sizes = [0.03f64, 0.02, 0.013];
    for size in sizes {
        let x: Vec<f64> = x0.iter().zip([0.3, 1.0, -0.5, 0.7]).map(|(x, d)| x + size * d).collect();
        exact.set_iterate(&[0.0; 41 * 4], &[0.0; 40]).unwrap();
        exact.initialise(&x, 200).unwrap();
        c.set_iterate(&[0.0; 41 * 4], &[0.0; 40]).unwrap();
        c.initialise(&x0, 200).unwrap();
        c.prepare(Some(&x0)).unwrap();
        let mut u = [0.0];
        c.feedback(&x, &mut u).unwrap();
        errors.push((u[0] - exact.plan().u()[0]).abs());
    }
    let slope = |k: usize| (errors[k] / errors[k + 1]).ln() / (sizes[k] / sizes[k + 1]).ln();
    let slopes = [slope(0), slope(1)];
    assert!(slopes.iter().all(|s| *s > 1.7), "{errors:?} {slopes:?}");
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
    let mut c = Nmpc::new(&case.ocp, &scheme(Scheme::Rti, Level::D0, 0)).unwrap();
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

/// The same calls give the same bits.
#[test]
fn runs_repeat_to_the_bit() {
    let case = pendulum();
    let options = scheme(Scheme::AsRti, Level::C, 2);
    let (a, b) = (case.run(&options).0, case.run(&options).0);
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
