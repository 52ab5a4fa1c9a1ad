//! Whatever comes, there is a control within its bounds that says where it is from: calls in any order, interrupts at any model call,
//! deadlines, measurements that are no numbers or lie where the model is not defined, constraints that contradict each other. The same
//! calls give the same bits, and nothing is allocated.

#[path = "common/counting.rs"]
mod counting;
// the report uses more of it
#[allow(dead_code)]
#[path = "common/stick_slip.rs"]
mod stick_slip;

use counting::count;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::sync::Arc;
use switchback::error::Error;
use switchback::expr::{Expr, Graph};
use switchback::func::{Callback, Dims};
use switchback::linalg::csc::Pattern;
use switchback::nmpc::*;
use switchback::ocp::{CostAt, Norm, Ocp};
use switchback::qp::QpStatus;
use switchback::settings::Settings;
use switchback::stop::Stop;
use switchback::system::{SharedFunction, System};
use switchback::tableau::Family;

const DIMS: Dims = Dims { x: 2, u: 1, p: 1 };
const LIMIT: f64 = 1.5;

/// Counts the calls of the model, and raises a flag at one of them.
#[derive(Clone, Default)]
struct Tripwire {
    calls: Arc<AtomicUsize>,
    at: Arc<AtomicUsize>,
    flag: Arc<AtomicBool>,
}

impl Tripwire {
    fn function(&self, name: &str, n_out: usize, f: fn(&[f64], f64, f64, &mut [f64]) -> i32) -> SharedFunction {
        let wire = self.clone();
        let (rows, columns): (Vec<usize>, Vec<usize>) = (0..n_out).flat_map(|i| (0..4).map(move |j| (i, j))).unzip();
        let (pattern, _) = Pattern::from_triplets(n_out, DIMS.n_in(), &rows, &columns);
        let c = Callback::new(name, DIMS, n_out, move |at, out| {
            if wire.calls.fetch_add(1, Relaxed) + 1 == wire.at.load(Relaxed) {
                wire.flag.store(true, Relaxed);
            }
            f(at.x, at.u[0], at.p[0], out)
        });
        Arc::new(c.with_jacobian_pattern(pattern).unwrap())
    }

    fn arm(&self, at: usize) {
        self.calls.store(0, Relaxed);
        self.at.store(at, Relaxed);
        self.flag.store(false, Relaxed);
    }
}

/// Two tanks, the first one fed by a pump, the second one by the first: the outflow is that of Torricelli, and there is none of a level
/// below zero. The second level is to be kept low at a price, and below a bound that it may not pass.
fn tanks(wire: &Tripwire) -> Ocp {
    let rates = wire.function("rates", 2, |x, u, p, out| {
        let flow = |level: f64| 0.6 * level.sqrt();
        out[0] = u - flow(x[0]);
        out[1] = flow(x[0]) - p * flow(x[1]);
        i32::from(x[0] < 0.0 || x[1] < 0.0)
    });
    let cost = wire.function("cost", 3, |x, u, _, out| {
        out.copy_from_slice(&[x[0] - 1.0, x[1] - 0.8, u - 0.6]);
        0
    });
    let end = wire.function("end", 2, |x, _, _, out| {
        out.copy_from_slice(&[x[0] - 1.0, x[1] - 0.8]);
        0
    });
    let level = wire.function("level", 1, |x, _, _, out| {
        out[0] = x[1];
        0
    });
    let mut system = System::new(2, 1, 1).unwrap();
    system.set_f0(rates).unwrap();
    let mut ocp = Ocp::new(&system, 2.0, 8, &Settings::default()).unwrap();
    ocp.add_least_squares(cost, &[1.0, 2.0, 0.1], &[0.0; 3], CostAt::Running).unwrap();
    ocp.add_least_squares(end, &[1.0, 2.0], &[0.0; 2], CostAt::Terminal).unwrap();
    let at = Some(switchback::fesd::PathAt::ControlGrid);
    ocp.add_relaxed(level, &[0.0], &[0.9], at, Norm::L1, 3.0).unwrap();
    ocp.set_x_bounds(&[0.0, 0.0], &[9.0, 1.3]).unwrap();
    ocp.set_u_bounds(&[0.0], &[LIMIT]).unwrap();
    ocp.set_params(&[1.0]).unwrap();
    ocp.set_x0(&[0.5, 0.5]).unwrap();
    ocp.set_x_guess(&[0.0], &[0.5, 0.5]).unwrap();
    ocp
}

/// Every scheme with every level, by an explicit and by an implicit method. `exact`: with level D2.
fn all_options() -> Vec<Options> {
    let mut all = Vec::new();
    for (family, n_s) in [(Family::Explicit, 4), (Family::GaussLegendre, 2)] {
        for scheme in [Scheme::Rti, Scheme::Mli, Scheme::AsRti, Scheme::Asc] {
            for level in [Level::A, Level::B, Level::C, Level::D0, Level::D1, Level::D2] {
                if level == Level::D2 && family != Family::Explicit {
                    continue;
                }
                let family = Some(family);
                let qp = if all.len() % 2 == 0 { QpMethod::Stagewise } else { QpMethod::Auto };
                all.push(Options {
                    scheme,
                    level,
                    inner: 2,
                    qp,
                    shift: true,
                    family,
                    n_s,
                    steps: 1,
                    ..Options::default()
                });
            }
        }
    }
    all
}

/// Numbers from 0 to below `n`.
struct Dice(u64);

impl Dice {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 33) as usize) % n
    }

    fn share(&mut self) -> f64 {
        self.below(1 << 30) as f64 / (1u64 << 30) as f64
    }
}

/// A feedback, and what every one of them must be.
fn answer(c: &mut Nmpc, x: &[f64], [low, high]: [f64; 2], what: &str) -> (f64, Feedback) {
    let before = c.monitor().sources;
    let mut u = [f64::NAN];
    let info = c.feedback(x, &mut u).unwrap();
    assert!((low..=high).contains(&u[0]), "{what}: {u:?} from {info:?}");
    let after = c.monitor().sources;
    for (i, (a, b)) in after.iter().zip(before).enumerate() {
        assert_eq!(a - b, u64::from(i == info.source as usize), "{what}: {info:?}");
    }
    match info.source {
        Source::Qp => assert_eq!(info.status, QpStatus::Solved, "{what}"),
        Source::SoftQp => assert!(matches!(info.status, QpStatus::Solved | QpStatus::Infeasible), "{what}: {info:?}"),
        Source::Tangent => assert_ne!(info.status, QpStatus::Solved, "{what}"),
        _ => {}
    }
    if x.iter().any(|v| !v.is_finite()) {
        assert!(matches!(info.source, Source::Plan | Source::Hold), "{what}: {info:?}");
    }
    (u[0], info)
}

/// A preparation that is interrupted at some model call makes no other one and leaves a controller that answers; made once more, it is
/// the preparation that it would have been.
#[test]
fn interrupts_at_random_moments() {
    let wire = Tripwire::default();
    let ocp = tanks(&wire);
    let stop = Stop::on(&wire.flag);
    let mut dice = Dice(7);
    let states = [[0.5, 0.5], [0.55, 0.52], [0.7, 0.6], [0.8, 0.75]];
    for options in all_options() {
        let what = format!("{:?} {:?} {:?}", options.family, options.scheme, options.level);
        // how many calls the last preparation makes, and what comes of it; `at`: where it is interrupted first
        let run = |at: usize, answer_first: bool| {
            let mut c = Nmpc::new(&ocp, &options).unwrap();
            let mut u = 0.0;
            wire.arm(usize::MAX);
            for x in &states[..3] {
                c.prepare(None).unwrap();
                u = answer(&mut c, x, [0.0, LIMIT], &what).0;
                c.finish();
            }
            wire.arm(at);
            let end = stop.scope(|| c.prepare(None));
            let calls = wire.calls.load(Relaxed);
            if at == usize::MAX {
                end.unwrap();
                return (calls, [answer(&mut c, &states[3], [0.0, LIMIT], &what).0; 2]);
            }
            assert_eq!(end.unwrap_err(), Error::Interrupted, "{what}: at {at}");
            assert_eq!(calls, at, "{what}: functions were called after the interrupt");
            wire.arm(usize::MAX);
            if answer_first {
                let (v, info) = answer(&mut c, &states[3], [0.0, LIMIT], &what);
                assert!(matches!(info.source, Source::Qp | Source::SoftQp), "{what}: {info:?}");
                c.prepare(None).unwrap();
                answer(&mut c, &states[3], [0.0, LIMIT], &what);
                return (calls, [v, f64::NAN]);
            }
            c.prepare(None).unwrap();
            (calls, [u, answer(&mut c, &states[3], [0.0, LIMIT], &what).0])
        };
        let (all, [expected, _]) = run(usize::MAX, false);
        if all == 0 {
            // level A with the scheme that never linearises again
            assert_eq!((options.scheme, options.level), (Scheme::Mli, Level::A));
            continue;
        }
        for _ in 0..8 {
            let at = 1 + dice.below(all);
            let (_, [_, again]) = run(at, dice.below(2) == 0);
            // inner iterations that were made are not undone; stage equations are solved from other starts
            let whole = matches!(options.scheme, Scheme::Rti | Scheme::Mli);
            let tol = if options.family == Some(Family::Explicit) { 0.0 } else { 1e-9 };
            if whole && again.is_finite() {
                assert!((again - expected).abs() <= tol * LIMIT, "{what}: at {at} {again:e}, not {expected:e}");
            }
        }
    }
}

/// One of the things that can be asked of a controller, by dice. Returns the control where there is one.
fn anything(
    c: &mut Nmpc,
    dice: &mut Dice,
    states: &[Vec<f64>],
    bounds: [f64; 2],
    np: usize,
    what: &str,
) -> Option<f64> {
    let n = states.len();
    let pick = |dice: &mut Dice| states[dice.below(n)].clone();
    match dice.below(12) {
        0..=3 => {
            let x = pick(dice);
            return Some(answer(c, &x, bounds, what).0);
        }
        4 | 5 => {
            let done = c.prepare(None).unwrap();
            assert!(done.time >= 0.0);
        }
        6 => {
            let x = pick(dice);
            // refused where it is not finite
            let fine = x.iter().all(|v| v.is_finite());
            if fine {
                c.prepare(Some(&x)).unwrap();
            }
        }
        7 => c.finish(),
        8 => {
            // over before the first look at the clock, or never
            let deadline = if dice.below(2) == 0 { 1e-12 } else { f64::INFINITY };
            c.set_deadline(deadline).unwrap();
        }
        9 => c.set_time(dice.share()).unwrap(),
        10 if np > 0 => c.set_params(&vec![0.5 + dice.share(); np]).unwrap(),
        _ => c.set_references(1, &vec![0.2 * dice.share(); if np > 0 { 2 } else { 4 }]).unwrap(),
    }
    None
}

/// States as sensors and their failures give them: what is usual, far off, where the model has no value, no numbers.
fn measurements(usual: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let nx = usual[0].len();
    let mut all: Vec<Vec<f64>> = usual.to_vec();
    all.extend(usual.to_vec());
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, 1e6, -1e6, 1e-310, -0.3] {
        let mut one = usual[0].clone();
        one[nx - 1] = value;
        all.push(one);
        all.push(vec![value; nx]);
    }
    all
}

#[test]
fn calls_in_any_order() {
    let wire = Tripwire::default();
    let ocp = tanks(&wire);
    let usual = [[0.5, 0.5], [0.9, 0.85], [1.2, 0.1], [0.01, 1.25], [0.0, 0.0], [0.3, 2.0]].map(|x| x.to_vec());
    let states = measurements(&usual);
    let mut sources = [0; 5];
    for options in all_options() {
        let what = format!("{:?} {:?} {:?}", options.family, options.scheme, options.level);
        let play = |seed: u64| {
            let mut c = Nmpc::new(&ocp, &options).unwrap();
            let mut dice = Dice(seed);
            let mut bits = Vec::with_capacity(400);
            for k in 0..400 {
                if k == 300 {
                    c.reset();
                }
                bits.extend(anything(&mut c, &mut dice, &states, [0.0, LIMIT], 1, &what).map(f64::to_bits));
            }
            (bits, c.monitor().sources)
        };
        for seed in [1, 2] {
            let (bits, from) = play(seed);
            assert_eq!(play(seed), (bits, from), "{what}: other bits the second time");
            sources.iter_mut().zip(from).for_each(|(s, f)| *s += f);
        }
    }
    // all of them have been there
    assert!(sources.iter().all(|s| *s > 0), "{sources:?}");
}

/// The same where the functions of the model are expressions, which do not write down what was wrong: nothing is allocated.
#[test]
fn calls_in_any_order_allocate_nothing() {
    let ocp = {
        let g = Graph::new();
        let [a, b, u, p] = [g.x(0), g.x(1), g.u(0), g.p(0)];
        // the root of a square: defined everywhere, so that no complaint is written down
        let [first, second] = [a, b].map(|v| (v * v + 1e-4).sqrt().sqrt() * 0.6);
        let rates = [u - first, first - p * second];
        let make = |name: &str, out: &[Expr<'_>]| -> SharedFunction { Arc::new(g.function(name, DIMS, out).unwrap()) };
        let mut system = System::new(2, 1, 1).unwrap();
        system.set_f0(make("rates", &rates)).unwrap();
        let mut ocp = Ocp::new(&system, 2.0, 8, &Settings::default()).unwrap();
        ocp.add_least_squares(make("cost", &[a - 1.0, b - 0.8, u - 0.6]), &[1.0, 2.0, 0.1], &[0.0; 3], CostAt::Running)
            .unwrap();
        ocp.add_least_squares(make("end", &[a - 1.0, b - 0.8]), &[1.0, 2.0], &[0.0; 2], CostAt::Terminal).unwrap();
        let at = Some(switchback::fesd::PathAt::ControlGrid);
        ocp.add_relaxed(make("level", &[b]), &[0.0], &[0.9], at, Norm::L1, 3.0).unwrap();
        ocp.set_x_bounds(&[0.0, 0.0], &[9.0, 1.3]).unwrap();
        ocp.set_u_bounds(&[0.0], &[LIMIT]).unwrap();
        ocp.set_params(&[1.0]).unwrap();
        ocp
    };
    let usual = [[0.5, 0.5], [0.9, 0.85], [1.2, 0.1], [0.01, 1.25], [0.3, 2.0]].map(|x| x.to_vec());
    let states = measurements(&usual);
    for options in all_options() {
        let what = format!("{:?} {:?} {:?}", options.family, options.scheme, options.level);
        let mut c = Nmpc::new(&ocp, &options).unwrap();
        let mut dice = Dice(3);
        let mut u = [0.0];
        for k in 0..200 {
            let x = &states[dice.below(states.len())];
            let before = count();
            match k % 5 {
                0 if x.iter().all(|v| v.is_finite()) => drop(c.prepare(Some(x)).unwrap()),
                0 | 1 => drop(c.prepare(None).unwrap()),
                2 => c.set_params(&[1.1]).unwrap(),
                3 => c.set_references(0, &[0.1, 0.0, 0.0]).unwrap(),
                _ => drop(c.feedback(x, &mut u).unwrap()),
            }
            assert_eq!(count(), before, "{what}: step {k}");
        }
    }
}

/// The same for a system that switches.
#[test]
fn calls_in_any_order_where_a_system_sticks() {
    let case = stick_slip::two_masses(1.0);
    let usual = [[-1.0, 1.0, 0.5, -0.5], [0.2, 0.1, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], [0.5, -0.5, 1.0, -1.0]];
    let states = measurements(&usual.map(|x| x.to_vec()));
    for scheme in [Scheme::Rti, Scheme::AsRti, Scheme::Asc] {
        let play = || {
            let options = Options { flips: 2, ..stick_slip::options(scheme, 1) };
            let mut c = Nmpc::new(&case.ocp, &options).unwrap();
            let mut dice = Dice(5);
            let what = format!("{scheme:?}");
            let mut bits = Vec::new();
            for _ in 0..120 {
                bits.extend(anything(&mut c, &mut dice, &states, [-5.0, 5.0], 0, &what).map(f64::to_bits));
            }
            bits
        };
        assert_eq!(play(), play(), "{scheme:?}: other bits the second time");
    }
}

/// Deadlines that fall into the solution of the program: the clock decides how far it comes, never whether there is a control.
#[test]
fn deadlines_at_random_moments() {
    let wire = Tripwire::default();
    let ocp = tanks(&wire);
    let mut dice = Dice(11);
    let mut cut = 0;
    for options in all_options() {
        let what = format!("{:?} {:?} {:?}", options.family, options.scheme, options.level);
        let mut c = Nmpc::new(&ocp, &options).unwrap();
        for _ in 0..60 {
            // 10 ns to 30 us
            c.set_deadline(1e-8 * 3000f64.powf(dice.share())).unwrap();
            c.prepare(None).unwrap();
            let x = [1.5 * dice.share(), 2.0 * dice.share()];
            let (_, info) = answer(&mut c, &x, [0.0, LIMIT], &what);
            cut += usize::from(info.status == QpStatus::OutOfTime);
        }
        // no time at all: what was active before is tried, in the program and in the one with prices, and that is all
        c.set_deadline(1e-12).unwrap();
        c.prepare(None).unwrap();
        let (_, info) = answer(&mut c, &[0.0, 2.0], [0.0, LIMIT], &what);
        assert!(info.iterations <= 2, "{what}: {info:?}");
    }
    assert!(cut > 0, "no deadline came before the end of a program");
}
