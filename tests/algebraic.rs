//! Algebraic equations of index 1 in event-driven simulation, against closed forms, published values and differences.

use std::f64::consts::PI;

use switchback::error::Error;
use switchback::event::{simulate_batch, Engine, Gradient, Kind, Method, Options, Outcome, Run, Term};
use switchback::expr::{Expr, Graph};
use switchback::model::{Built, Model, Transition};
use switchback::system::{Direction, Effect, Rule};

fn tol(t: f64) -> Options {
    Options { dense: true, ..Options::with_tolerance(t, 1e-2 * t) }
}

/// A model whose last `n_z` states are algebraic: the rows of `rhs` that belong to them are the equations.
fn model(g: &Graph, (nu, np, n_z): (usize, usize, usize), rhs: &[Expr], transitions: Vec<Transition>) -> Built {
    let mut m = Model::from_rhs("dae", nu, np, rhs).unwrap();
    transitions.into_iter().for_each(|t| {
        m.add_transition(t);
    });
    let mut b = m.build(g).unwrap();
    b.system.set_algebraic(n_z, None).unwrap();
    b
}

fn run(b: &Built, o: &Options, x0: &[f64], p: &[f64], end: f64) -> Run {
    let mut e = Engine::new(&b.system, o).unwrap();
    e.reinit(0.0, x0).unwrap();
    e.set_params(p).unwrap();
    e.advance(end).unwrap();
    e.into_run()
}

fn near(found: f64, exact: f64, tol: f64, what: &str) {
    assert!((found - exact).abs() <= tol * exact.abs().max(1.0), "{what}: {found:?}, not {exact:?}");
}

/// `x' = −z`, `0 = z² − x`, `z > 0`: `z = z0 − t / 2`, until both branches meet.
fn draining() -> Built {
    let g = Graph::new();
    let (x, z) = (g.x(0), g.x(1));
    model(&g, (0, 0, 1), &[-1.0 * z, z * z - x], vec![])
}

#[test]
fn algebraic_states_follow_on_their_branch() {
    for method in [Method::Dp5, Method::Dop853, Method::Radau5] {
        for (guess, sign) in [(2.0, 1.0), (0.3, 1.0), (-1.0, -1.0)] {
            let o = Options { method, ..tol(1e-9) };
            let r = run(&draining(), &o, &[4.0, guess], &[], 3.0);
            assert_eq!(r.outcome, Outcome::Reached, "{}", r.reason);
            let z = |t: f64| sign * 2.0 - 0.5 * t;
            near(r.x[0], z(3.0).powi(2), 1e-7, "state");
            near(r.x[1], z(3.0), 1e-7, "algebraic state");
            let path = r.path.unwrap();
            let mut x = [0.0; 2];
            for k in 0..=50 {
                let t = 0.06 * f64::from(k);
                path.eval(t, 0, &mut x).unwrap();
                near(x[1], z(t), 1e-7, "dense output");
                near(x[1] * x[1], x[0], 1e-8, "the equation");
            }
            path.eval(1.234, 1, &mut x).unwrap();
            near(x[1], -0.5, 1e-5, "derivative of the dense output");
        }
    }
}

#[test]
fn a_branch_that_ends_is_an_outcome_with_its_time() {
    for method in [Method::Dp5, Method::Dop853, Method::Radau5] {
        let r = run(&draining(), &Options { method, ..tol(1e-8) }, &[4.0, 2.0], &[], 10.0);
        assert!(matches!(r.outcome, Outcome::StepTooSmall | Outcome::NoContinuation), "{:?}", r.outcome);
        assert!((r.t - 4.0).abs() < 1e-3, "{}", r.t);
        assert!(r.reason.contains("the algebraic equations were not solved at t = "), "{}", r.reason);
    }
}

/// `0 = z³ − 3 z − x`, `x' = 1` from the lower branch: it ends at `x = 2`, and Newton's method alone would go on to the upper one.
#[test]
fn no_jump_to_another_branch() {
    let g = Graph::new();
    let (x, z) = (g.x(0), g.x(1));
    let b = model(&g, (0, 0, 1), &[0.0 * x + 1.0, z.powi(3) - 3.0 * z - x], vec![]);
    for h_max in [f64::INFINITY, 0.5] {
        let r = run(&b, &Options { h_max, ..tol(1e-8) }, &[-4.0, -2.1], &[], 8.0);
        assert!(r.outcome != Outcome::Reached, "{:?}", r.x);
        near(r.t, 6.0, 1e-3, "the end of the branch");
        near(r.x[1], -1.0, 1e-1, "the lower branch");
    }
}

/// Robertson's reaction with the sum of the concentrations as an equation; reference: the test set of E. Hairer and G. Wanner.
#[test]
fn robertson() {
    let g = Graph::new();
    let (a, b, c) = (g.x(0), g.x(1), g.x(2));
    let rhs = [-0.04 * a + 1e4 * b * c, 0.04 * a - 1e4 * b * c - 3e7 * b * b, a + b + c - 1.0];
    let m = model(&g, (0, 0, 1), &rhs, vec![]);
    let o = Options { rtol: vec![1e-9], atol: vec![1e-12, 1e-17, 1e-12], ..Options::default() };
    let r = run(&m, &o, &[1.0, 0.0, 0.0], &[], 1e11);
    assert_eq!(r.outcome, Outcome::Reached, "{}", r.reason);
    let exact = [0.208_334_014_970_125_5e-7, 0.833_336_077_033_471_3e-13, 0.999_999_979_166_505];
    for (x, e) in r.x.iter().zip(exact) {
        assert!((x / e - 1.0).abs() < 1e-5, "{:?}", r.x);
    }
}

/// `x' = z`, `0 = z + x − u`, `u` from 0 to 1 at `t = 1`: the algebraic state jumps with the control.
#[test]
fn consistent_behind_controls() {
    let g = Graph::new();
    let (x, z) = (g.x(0), g.x(1));
    let b = model(&g, (1, 0, 1), &[z, z + x - g.u(0)], vec![]);
    let mut e = Engine::new(&b.system, &tol(1e-10)).unwrap();
    e.reinit(0.0, &[1.0, 7.0]).unwrap();
    e.want_samples(&[0.0, 0.5, 1.0]).unwrap();
    e.advance(1.0).unwrap();
    let samples = e.take_samples();
    for (k, t) in [0.0f64, 0.5, 1.0].iter().enumerate() {
        near(samples[2 * k], (-t).exp(), 1e-9, "sample");
        near(samples[2 * k + 1], -(-t).exp(), 1e-9, "algebraic sample");
    }
    let mut f = [0.0; 2];
    e.whole_derivative(&mut f);
    near(f[1], (-1.0f64).exp(), 1e-9, "derivative of the algebraic state");
    e.set_controls(&[1.0]).unwrap();
    e.advance(2.0).unwrap();
    let x1 = (-1.0f64).exp();
    let at = |t: f64| 1.0 + (x1 - 1.0) * (1.0 - t).exp();
    near(e.state()[0], at(2.0), 1e-9, "state");
    near(e.state()[1], 1.0 - at(2.0), 1e-9, "algebraic state");
    let mut x = [0.0; 2];
    let path = e.path().unwrap().clone();
    path.eval(1.0 + 1e-9, 0, &mut x).unwrap();
    near(x[1], 1.0 - x1, 1e-8, "behind the jump");
    let last = path.times()[path.len() - 1];
    let t = 0.5 * (last + 2.0);
    e.get_dky(t, 0, &mut x).unwrap();
    near(x[1], 1.0 - at(t), 1e-9, "in the last step");
    e.get_dky(t, 1, &mut x).unwrap();
    near(x[1], at(t) - 1.0, 1e-6, "its derivative in the last step");
}

/// A relay on the algebraic state: `x' = −sign z + ½`, `z = 2 x` (written implicitly): it slides at 0 from `t = 2 x0` on.
#[test]
fn sliding_modes_of_algebraic_surfaces() {
    let g = Graph::new();
    let (x, z) = (g.x(0), g.x(1));
    let b = model(&g, (0, 0, 1), &[0.5 - 1.0 * z.sign(), z.exp() - (2.0 * x).exp()], vec![]);
    let r = run(&b, &tol(1e-10), &[1.0, 1.0], &[], 3.0);
    assert_eq!((r.outcome, r.switches.len()), (Outcome::Reached, 1), "{}", r.reason);
    near(r.switches[0].t, 2.0, 1e-12, "the switch");
    assert_eq!(r.switches[0].after, [0, 1]);
    assert!(r.x[0].abs() < 1e-12 && r.x[1].abs() < 1e-12, "{:?}", r.x);
}

/// A capacitor that a resistor charges, `RC = 1`: `v' = i`, `i = 1 − v`; at `i < ½` it is emptied, by a reset that knows the current: `v⁺ = v − i`.
fn relaxation(effect: Effect) -> Built {
    let g = Graph::new();
    let (v, i) = (g.x(0), g.x(1));
    let guard = (i - 0.5 * g.p(0)).id();
    let t = match effect {
        Effect::Jump => {
            let reset = vec![(0, (v - i).id())];
            let (from, to, rule) = (vec![], vec![], Rule::default());
            Transition { guard, direction: Direction::Falling, from, reset, to, rule }
        }
        e => Transition { direction: Direction::Falling, ..Transition::event("half", e, guard) },
    };
    model(&g, (0, 1, 1), &[i, i - (1.0 - v)], vec![t])
}

#[test]
fn transitions_know_algebraic_states() {
    let half = 0.5f64;
    let r = run(&relaxation(Effect::Jump), &tol(1e-11), &[0.0, 0.0], &[1.0], 3.0);
    // ln 2 to the first jump, to v = 0; then the same again and again
    assert_eq!(r.jumps.len(), 4, "{:?}", r.jumps);
    for (k, j) in r.jumps.iter().enumerate() {
        near(j.t, 2f64.ln() * (k + 1) as f64, 1e-10, "time of a jump");
        near(j.before[1], half, 1e-10, "before");
        near(j.after[0], 0.0, 1e-10, "behind");
        near(j.after[1], 1.0, 1e-10, "behind, the algebraic state");
    }
    let r = run(&relaxation(Effect::Note), &tol(1e-11), &[0.0, 0.0], &[1.0], 3.0);
    assert_eq!(r.notes.len(), 1);
    near(r.notes[0].t, 2f64.ln(), 1e-9, "a note");
    near(r.notes[0].x[1], half, 1e-9, "its algebraic state");
    let r = run(&relaxation(Effect::Stop), &tol(1e-11), &[0.0, 0.0], &[1.0], 3.0);
    assert_eq!(r.outcome, Outcome::Event);
    near(r.t, 2f64.ln(), 1e-10, "the end");
    near(r.x[1], half, 1e-10, "the end, the algebraic state");
}

/// Everything at once: algebraic states that depend on states, parameters, controls and time, in the velocity, in modes, in switching
/// functions, guards and resets, nonlinearly.
fn everything(stops: bool) -> Built {
    let g = Graph::new();
    let (x, y, z, w) = (g.x(0), g.x(1), g.x(2), g.x(3));
    let (p, q, u) = (g.p(0), g.p(1), g.u(0));
    let rhs = [
        y + 0.3 * w,
        -1.0 * p * x - 0.2 * y + 0.5 * u * z - 0.7 * (w - 0.1 * q).sign() * (1.0 + 0.1 * z * z),
        z + 0.2 * z.powi(3) - x * q - 0.1 * (2.0 * g.t()).sin() - 0.2 * w,
        w * (1.0 + 0.1 * z * z) - y - 0.1 * u + 0.1 * x * x,
    ];
    let guard = (z + 0.3 * w - 0.4 * q).id();
    let rule = Rule::default();
    let t = if stops {
        Transition::event("stop", Effect::Stop, guard)
    } else {
        let reset = vec![(1, (-0.5 * y - 0.2 * z * q + 0.05 * w).id())];
        Transition { guard, direction: Direction::Rising, from: vec![], reset, to: vec![], rule }
    };
    model(&g, (1, 2, 2), &rhs, vec![t])
}

struct Data {
    x0: Vec<f64>,
    p: Vec<f64>,
    u: Vec<f64>,
}

impl Data {
    fn new() -> Data {
        Data { x0: vec![-0.5, 1.2, 0.0, 0.0], p: vec![4.0, 1.1], u: vec![0.3] }
    }

    fn flat(&self) -> Vec<f64> {
        [&self.x0[..], &self.p, &self.u].concat()
    }

    fn of(v: &[f64]) -> Data {
        Data { x0: v[..4].to_vec(), p: v[4..6].to_vec(), u: v[6..].to_vec() }
    }

    fn engine(&self, b: &Built, o: &Options, ends: &[f64]) -> Engine {
        let mut e = Engine::new(&b.system, o).unwrap();
        e.set_params(&self.p).unwrap();
        e.set_controls(&self.u).unwrap();
        e.reinit(0.0, &self.x0).unwrap();
        for t in ends {
            e.advance(*t).unwrap();
        }
        assert!(matches!(e.outcome(), Outcome::Reached | Outcome::Event), "{}", e.reason());
        e
    }
}

/// Differences of fourth order.
fn difference(f: &dyn Fn(&[f64]) -> Vec<f64>, at: &[f64], along: &[f64], h: f64) -> Vec<f64> {
    let moved = |s: f64| f(&at.iter().zip(along).map(|(a, d)| a + s * h * d).collect::<Vec<f64>>());
    let (a, b, c, d) = (moved(-2.0), moved(-1.0), moved(1.0), moved(2.0));
    (0..a.len()).map(|i| (a[i] - 8.0 * b[i] + 8.0 * c[i] - d[i]) / (12.0 * h)).collect()
}

#[test]
fn derivatives_three_ways() {
    for (stops, method) in
        [(false, Method::Dop853), (false, Method::Radau5), (true, Method::Dop853), (true, Method::Radau5)]
    {
        let b = everything(stops);
        let data = Data::new();
        let o = Options {
            method,
            adjoint: true,
            sensitivity: switchback::event::Sensitivity::On,
            ..Options::with_tolerance(1e-12, 1e-13)
        };
        let end = 2.0;
        let mut e = data.engine(&b, &o, &[1.0, end]);
        assert_eq!(e.outcome() == Outcome::Event, stops);
        if !stops {
            assert!(!e.jumps().is_empty() && !e.switches().is_empty(), "nothing happens");
        }
        let s = e.sensitivity().unwrap().to_vec();
        let n = data.flat().len();
        let state = |v: &[f64]| Data::of(v).engine(&b, &Options::with_tolerance(1e-12, 1e-13), &[end]).state().to_vec();
        for c in 0..n {
            // inputs are states, parameters, controls in this order, as the sensitivities do
            let mut along = vec![0.0; n];
            along[c] = 1.0;
            let d = difference(&state, &data.flat(), &along, 1e-3);
            for i in 0..4 {
                near(s[i * n + c], d[i], 3e-8, &format!("stops {stops}, {method:?}: state {i} by input {c}"));
            }
        }
        let v = [0.3, -0.7, 1.1, 0.4];
        let flat = |g: &Gradient| [&g.x0[..], &g.p, &g.u].concat();
        let g = flat(&e.adjoint(&v, &[]).unwrap());
        for c in 0..n {
            let forward: f64 = (0..4).map(|i| v[i] * s[i * n + c]).sum();
            near(g[c], forward, 1e-9, &format!("stops {stops}, {method:?}: adjoint by input {c}"));
        }
        if stops {
            continue;
        }
        // what depends on the state at a stop
        let g = flat(&e.adjoint(&[0.0; 4], &[Term::State { t: 1.0, v: v.to_vec() }]).unwrap());
        let at_stop = |x: &[f64]| {
            let x = Data::of(x).engine(&b, &Options::with_tolerance(1e-12, 1e-13), &[1.0]).state().to_vec();
            vec![x.iter().zip(&v).map(|(x, v)| x * v).sum::<f64>()]
        };
        for c in 0..n {
            let mut along = vec![0.0; n];
            along[c] = 1.0;
            near(g[c], difference(&at_stop, &data.flat(), &along, 1e-3)[0], 3e-8, &format!("stop, by input {c}"));
        }
    }
}

#[test]
fn second_derivatives() {
    let (b, data) = (everything(false), Data::new());
    let o = Options { adjoint: true, method: Method::Dop853, ..Options::with_tolerance(1e-12, 1e-13) };
    let v = [0.3, -0.7, 1.1, 0.4];
    let flat = |g: &Gradient| [&g.x0[..], &g.p, &g.u].concat();
    let direction = Gradient { x0: vec![0.5, -0.3, 0.0, 0.0], p: vec![0.4, 0.2], u: vec![-0.6] };
    let a = data.engine(&b, &o, &[2.0]).adjoint_along(&v, &direction).unwrap();
    let gradient = |x: &[f64]| flat(&Data::of(x).engine(&b, &o, &[2.0]).adjoint(&v, &[]).unwrap());
    let d = difference(&gradient, &data.flat(), &flat(&direction), 2e-3);
    for (c, (found, exact)) in flat(&a.derivative).iter().zip(d).enumerate() {
        near(*found, exact, 2e-6, &format!("second derivative, input {c}"));
    }
    for (found, exact) in flat(&a.gradient).iter().zip(gradient(&data.flat())) {
        near(*found, exact, 1e-11, "gradient");
    }
    let state = |x: &[f64]| Data::of(x).engine(&b, &o, &[2.0]).state().to_vec();
    for (found, exact) in a.state.iter().zip(difference(&state, &data.flat(), &flat(&direction), 2e-3)) {
        near(*found, exact, 1e-7, "derivative of the state");
    }
}

#[test]
fn runs_do_not_know_each_other() {
    let b = everything(false);
    let starts: Vec<Vec<f64>> = (0..6).map(|k| vec![-0.5 + 0.05 * f64::from(k), 1.2, 0.0, 0.0]).collect();
    let p = vec![vec![4.0, 1.1]; 6];
    let o = tol(1e-8);
    let many = simulate_batch(&b.system, &o, 0.0, &starts, &p, 2.0, 3).unwrap();
    for (start, r) in starts.iter().zip(&many) {
        let alone = run(&b, &o, start, &p[0], 2.0);
        assert_eq!((alone.t, &alone.x, &alone.jumps), (r.t, &r.x, &r.jumps));
    }
}

#[test]
fn what_has_no_index_one_is_refused() {
    let text = |rhs: &dyn Fn(&Graph) -> Vec<Expr>, x0: &[f64]| -> Error {
        let g = Graph::new();
        let b = model(&g, (0, 0, 1), &rhs(&g), vec![]);
        let mut e = match Engine::new(&b.system, &tol(1e-6)) {
            Ok(e) => e,
            Err(e) => return e,
        };
        e.reinit(0.0, x0).unwrap();
        e.advance(1.0).unwrap_err()
    };
    // a pendulum's constraint, without its multiplier
    let e = text(&|g| vec![g.x(1), g.x(0) - g.t()], &[0.0, 0.0]);
    assert!(matches!(&e, Error::State(m) if m.contains("contains no algebraic state")), "{e}");
    // no solution
    let e = text(&|g| vec![g.x(1), g.x(1) * g.x(1) + g.x(0)], &[1.0, 0.5]);
    assert!(matches!(&e, Error::Numeric(m) if m.contains("no consistent start") && m.contains("guess")), "{e}");
    // singular where the run begins
    let e = text(&|g| vec![g.x(1), g.x(1) * g.x(0) - 1.0], &[0.0, 0.5]);
    assert!(matches!(&e, Error::Numeric(m) if m.contains("singular")), "{e}");
}

/// Diodes as exponentials: a rectifier `C v' = i − v / R`, `i = I_s (exp((e(t) − v − R_s i) / V_t) − 1)`, with currents from 1e-12 to 1. The sum of what goes
/// in and out is known: `∫ i = C v + ∫ v / R`.
#[test]
fn exponential_diode() {
    let g = Graph::new();
    let (v, _charge, i) = (g.x(0), g.x(1), g.x(2));
    let e = 10.0 * (2.0 * PI * 50.0 * g.t()).sin();
    let (r, c, rs) = (1000.0, 1e-4, 5.0);
    let diode = 1e-12 * ((e - v - rs * i) / 0.026).exp() - 1e-12;
    let b = model(&g, (0, 0, 1), &[(i - v / r) / c, i - v / r, i - diode], vec![]);
    let r = run(&b, &tol(1e-8), &[0.0, 0.0, 0.0], &[], 0.1);
    assert_eq!(r.outcome, Outcome::Reached, "{}", r.reason);
    near(r.x[1], 1e-4 * r.x[0], 1e-9, "charge");
    assert!(r.x[0] > 7.0 && r.x[0] < 9.5, "{:?}", r.x);
}

/// `z + max(z, 0) = 2 x`, written as a switch inside of the equation; `x' = p − z`: closed form on both sides of `x = 0`.
fn bent() -> Built {
    let g = Graph::new();
    let (x, z) = (g.x(0), g.x(1));
    model(&g, (0, 1, 1), &[g.p(0) - z, z + z.max(0.0) - 2.0 * x], vec![])
}

#[test]
fn equations_with_kinks() {
    for method in [Method::Dp5, Method::Dop853, Method::Radau5] {
        let r = run(&bent(), &Options { method, ..tol(1e-10) }, &[-1.0, 0.0], &[1.0], 2.0);
        assert_eq!(r.outcome, Outcome::Reached, "{}", r.reason);
        let passes = 0.5 * 3f64.ln();
        assert_eq!(r.switches.len(), 1, "{:?}", r.switches);
        near(r.switches[0].t, passes, 1e-9, "the kink");
        assert!(r.jumps.is_empty());
        let exact = |t: f64| if t < passes { 0.5 - 1.5 * (-2.0 * t).exp() } else { 1.0 - (passes - t).exp() };
        near(r.x[0], exact(2.0), 1e-8, "state");
        let path = r.path.unwrap();
        let mut x = [0.0; 2];
        for k in 0..=40 {
            let t = 0.05 * f64::from(k);
            path.eval(t, 0, &mut x).unwrap();
            near(x[0], exact(t), 1e-8, "dense output");
            near(x[1], if t < passes { 2.0 * exact(t) } else { exact(t) }, 1e-7, "algebraic dense output");
        }
    }
}

#[test]
fn derivatives_through_kinks() {
    let b = bent();
    let o = Options {
        adjoint: true,
        sensitivity: switchback::event::Sensitivity::On,
        ..Options::with_tolerance(1e-12, 1e-13)
    };
    let state = |d: &[f64]| {
        let r = run(&b, &Options::with_tolerance(1e-12, 1e-13), &[d[0], 0.0], &[d[1]], 2.0);
        r.x
    };
    let mut e = Engine::new(&b.system, &o).unwrap();
    e.reinit(0.0, &[-1.0, 0.0]).unwrap();
    e.set_params(&[1.0]).unwrap();
    e.advance(2.0).unwrap();
    let s = e.sensitivity().unwrap().to_vec();
    assert_eq!(s.len(), 2 * 3);
    assert_eq!(e.switches()[0].dt.len(), 3);
    // passes = ½ ln(1 − 2 x0 / p)
    near(e.switches()[0].dt[0], -1.0 / 3.0, 1e-9, "time of the kink by the state");
    near(e.switches()[0].dt[2], -1.0 / 3.0, 1e-9, "time of the kink by the parameter");
    let g = e.adjoint(&[0.3, 0.7], &[]).unwrap();
    assert_eq!(g.x0.len(), 2);
    let d = [[1.0, 0.0], [0.0, 1.0]].map(|along| difference(&state, &[-1.0, 1.0], &along, 1e-3));
    for i in 0..2 {
        near(s[3 * i], d[0][i], 1e-8, "by the state");
        near(s[3 * i + 2], d[1][i], 1e-8, "by the parameter");
        near(s[3 * i + 1], 0.0, 0.0, "by the guess");
    }
    near(g.x0[0], 0.3 * s[0] + 0.7 * s[3], 1e-10, "adjoint by the state");
    near(g.p[0], 0.3 * s[2] + 0.7 * s[5], 1e-10, "adjoint by the parameter");
    let direction = Gradient { x0: vec![0.4, 0.0], p: vec![-0.3], u: vec![] };
    let along = e.adjoint_along(&[0.3, 0.7], &direction).unwrap();
    assert_eq!((along.state.len(), along.gradient.x0.len(), along.derivative.x0.len()), (2, 2, 2));
}

/// A half-wave rectifier with ideal diode: `0 ≤ i ⊥ v + R i − e ≥ 0`, next to the same circuit solved for `i`.
#[test]
fn ideal_diode() {
    let g = Graph::new();
    let (v, i) = (g.x(0), g.x(1));
    let e = (2.0 * PI * g.t()).sin();
    let (r, load) = (0.05, 2.0);
    let b = model(&g, (0, 0, 1), &[i - v / load, i.min(v + r * i - e)], vec![]);
    let g = Graph::new();
    let v = g.x(0);
    let e = (2.0 * PI * g.t()).sin();
    let by_hand = model(&g, (0, 0, 0), &[((e - v) / r).max(0.0) - v / load], vec![]);
    let dae = run(&b, &tol(1e-10), &[0.2, 0.0], &[], 5.0);
    let ode = run(&by_hand, &tol(1e-10), &[0.2], &[], 5.0);
    assert_eq!(dae.outcome, Outcome::Reached, "{}", dae.reason);
    assert_eq!((dae.switches.len(), ode.switches.len()), (10, 10));
    for (a, b) in dae.switches.iter().zip(&ode.switches) {
        near(a.t, b.t, 1e-9, "time of a switch");
    }
    near(dae.x[0], ode.x[0], 1e-9, "voltage");
}

/// A bridge of four diodes that leak: currents commutate in pairs. By symmetry it is the rectifier of `|e|`.
#[test]
fn bridge() {
    let g = Graph::new();
    let x: Vec<Expr> = (0..7).map(|k| g.x(k)).collect();
    let (v, i1, i2, i3, i4) = (x[0], x[1], x[2], x[3], x[4]);
    let (a, b) = (x[5], x[6]);
    let e = 10.0 * (2.0 * PI * g.t()).sin();
    const LEAK: f64 = 1e-3;
    let r = 0.1;
    let s = (e - (a - b)) / r;
    // what a diode carries beside its leak, and its voltage against the current
    fn diode<'g>(i: Expr<'g>, w: Expr<'g>) -> Expr<'g> {
        (i + LEAK * w).min(w)
    }
    let rhs =
        [(i1 + i2 - v) / 0.5, diode(i1, v - a), diode(i2, v - b), diode(i3, a), diode(i4, b), s - i1 + i3, s + i2 - i4];
    let m = model(&g, (0, 0, 6), &rhs, vec![]);
    let dae = run(&m, &tol(1e-9), &[0.0; 7], &[], 2.0);
    assert_eq!(dae.outcome, Outcome::Reached, "{}", dae.reason);
    assert!(dae.switches.len() >= 16, "{:?}", dae.switches.len());
    // without leaks the capacitor sees (|e| − v) / r
    let g = Graph::new();
    let v = g.x(0);
    let e = 10.0 * (2.0 * PI * g.t()).sin();
    let by_hand = model(&g, (0, 0, 0), &[(((e.abs() - v) / r).max(0.0) - v) / 0.5], vec![]);
    let ode = run(&by_hand, &tol(1e-9), &[0.0], &[], 2.0);
    near(dae.x[0], ode.x[0], 2e-3, "voltage, up to the leaks");
}

/// A ladder of diodes at rest: all algebraic states are exactly zero, and the guess is far away.
#[test]
fn solutions_that_are_zero() {
    let n = 50;
    let g = Graph::new();
    let v = |k: usize| g.x(k);
    let w = |k: usize| g.x(n + k);
    let mut rhs: Vec<Expr> = (0..n).map(|k| (w(k) - v(k)).max(0.0) - 0.1 * v(k)).collect();
    for k in 0..n {
        let left = if k == 0 { g.t().sin() } else { w(k - 1) };
        let right = if k + 1 == n { 0.0 * w(k) } else { w(k + 1) };
        rhs.push(left + right - 2.0 * w(k) - (w(k) - v(k)).max(0.0) - 0.01 * w(k));
    }
    let b = model(&g, (0, 0, n), &rhs, vec![]);
    for guess in [-1.0, 0.01, 0.0, 7.0] {
        let r = run(&b, &tol(1e-9), &[[0.01; 50], [guess; 50]].concat(), &[], 1.0);
        assert_eq!(r.outcome, Outcome::Reached, "{guess}: {}", r.reason);
        let mut x = [0.0; 100];
        r.path.unwrap().eval(0.0, 0, &mut x).unwrap();
        assert!(x[n..].iter().all(|z| z.abs() < 1e-15), "{x:?}");
    }
}

/// `x' = 2 cos t − x / 5 + z / 10`, `z + sign z = x + p`: where `|x + p| < 1` neither sign has a solution, and `z` is held at zero.
fn inside_of_its_own_equation() -> Built {
    let g = Graph::new();
    let (x, z, p) = (g.x(0), g.x(1), g.p(0));
    model(&g, (0, 1, 1), &[2.0 * g.t().cos() - 0.2 * x + 0.1 * z, z + z.sign() - x - p], vec![])
}

/// The same with `z` as a function of `x + p`: an ordinary differential equation with kinks.
fn inside_by_hand() -> Built {
    let g = Graph::new();
    let (x, p) = (g.x(0), g.p(0));
    let s = x + p;
    let z = (s - 1.0).max(0.0) + (s + 1.0).min(0.0);
    model(&g, (0, 1, 0), &[2.0 * g.t().cos() - 0.2 * x + 0.1 * z], vec![])
}

/// `x' = 1.5 y + p − z`, `y' = cos t + z y / 10`, `z = sign x − 0.3 y`: Filippov's sliding mode through an algebraic state.
fn through_an_equation() -> Built {
    let g = Graph::new();
    let (x, y, z, p) = (g.x(0), g.x(1), g.x(2), g.p(0));
    model(&g, (0, 1, 1), &[1.5 * y + p - z, g.t().cos() + 0.1 * z * y, z + 0.3 * y - x.sign()], vec![])
}

/// The same with the relay in the derivatives.
fn through_by_hand() -> Built {
    let g = Graph::new();
    let (x, y, p) = (g.x(0), g.x(1), g.p(0));
    let z = x.sign() - 0.3 * y;
    model(&g, (0, 1, 0), &[1.5 * y + p - z, g.t().cos() + 0.1 * z * y], vec![])
}

#[test]
fn surfaces_are_held_inside_of_equations() {
    let cases = [
        (inside_of_its_own_equation(), inside_by_hand(), vec![0.5], 6, 3),
        (through_an_equation(), through_by_hand(), vec![0.4, 0.1], 3, 1),
    ];
    for (k, (dae, hand, x0, n_switches, n_held)) in cases.iter().enumerate() {
        for method in [Method::Dp5, Method::Dop853, Method::Radau5] {
            let o = Options { method, ..tol(1e-10) };
            let start: Vec<f64> = x0.iter().copied().chain([1.0]).collect();
            let r = run(dae, &o, &start, &[0.1], 9.0);
            let ode = run(hand, &o, x0, &[0.1], 9.0);
            assert_eq!(
                (r.outcome, ode.outcome),
                (Outcome::Reached, Outcome::Reached),
                "{k}: {} {}",
                r.reason,
                ode.reason
            );
            for (a, b) in r.x.iter().zip(&ode.x) {
                near(*a, *b, 1e-8, "state");
            }
            assert_eq!((r.switches.len(), ode.switches.len()), (*n_switches, *n_switches), "{k}: {:?}", r.switches);
            for (a, b) in r.switches.iter().zip(&ode.switches) {
                near(a.t, b.t, 1e-8, "time of a switch");
            }
            let held = r.switches.iter().filter(|s| s.after == [0, 1]).inspect(|s| assert_eq!(s.kind, Kind::Enter));
            assert_eq!(held.count(), *n_held, "{k}: {:?}", r.switches);
            // the equation holds everywhere, with a weight between both modes
            let path = r.path.unwrap();
            let mut x = [0.0; 3];
            for i in 0..=90 {
                let t = 0.1 * f64::from(i);
                path.eval(t, 0, &mut x[..start.len()]).unwrap();
                let (what, relay) = if k == 0 { (x[1], x[0] + 0.1 - x[1]) } else { (x[0], x[2] + 0.3 * x[1]) };
                let sign = if what.abs() < 1e-8 { relay.clamp(-1.0, 1.0) } else { what.signum() };
                near(relay, sign, 1e-7, &format!("{k}: the relay at {t}"));
            }
        }
    }
}

/// Two relays in one pair of equations that are not linear, one of them also in the derivatives; and one on the states alone, whose surface is bent by
/// `bend`, that acts through a third equation with a part that depends on its own solution.
fn held(bend: f64) -> Built {
    let g = Graph::new();
    let x: Vec<Expr> = (0..6).map(|k| g.x(k)).collect();
    let (a, b, c, z, y, w) = (x[0], x[1], x[2], x[3], x[4], x[5]);
    let (p, q, u) = (g.p(0), g.p(1), g.u(0));
    let drive = 2.0 * (2.0 * g.t()).sin();
    let through = (b + bend * a * a + 0.1 * c).sign();
    let rhs = [
        drive - 0.5 * a + 0.2 * z * y + 0.1 * z.sign(),
        0.5 * (g.t() + 1.0).cos() + u + 0.3 * a - w - 0.1 * w * w,
        0.2 * w - 0.3 * c + 0.1 * y,
        z + 0.3 * z.powi(3) + (p + 0.1 * b * b) * z.sign() - a - 0.2 * y,
        y + 0.4 * y.sign() * (1.0 + 0.1 * c * c) + 0.3 * z - q * c - 0.3 * drive,
        w + 0.1 * w.powi(3) - (1.2 + 0.1 * w) * through - 0.2 * c,
    ];
    model(&g, (1, 2, 3), &rhs, vec![])
}

fn held_engine(b: &Built, d: &[f64], o: &Options) -> Engine {
    let mut e = Engine::new(&b.system, o).unwrap();
    e.set_params(&d[6..8]).unwrap();
    e.set_controls(&d[8..]).unwrap();
    e.reinit(0.0, &d[..6]).unwrap();
    e.advance(4.0).unwrap();
    assert_eq!(e.outcome(), Outcome::Reached, "{}", e.reason());
    e
}

const HELD: [f64; 9] = [-0.4, 0.3, 0.2, 0.1, 0.1, 0.1, 0.6, 0.8, 0.1];

#[test]
fn derivatives_where_surfaces_are_held() {
    for (bend, method) in [(0.1, Method::Dop853), (0.0, Method::Dop853), (0.1, Method::Radau5)] {
        let b = held(bend);
        let fine = Options { method, ..Options::with_tolerance(1e-12, 1e-13) };
        let o = Options { adjoint: true, sensitivity: switchback::event::Sensitivity::On, ..fine.clone() };
        let mut e = held_engine(&b, &HELD, &o);
        let entered = |k: usize| e.switches().iter().filter(|s| s.subsystem == k && s.kind == Kind::Enter).count();
        assert!((0..3).all(|k| entered(k) > 0), "{:?}", e.switches());
        let s = e.sensitivity().unwrap().to_vec();
        let v = [0.3, -0.7, 1.1, 0.4, -0.2, 0.6];
        let g = e.adjoint(&v, &[]).unwrap();
        let flat = |g: &Gradient| [&g.x0[..], &g.p, &g.u].concat();
        let by_rows: Vec<f64> = (0..9).map(|c| (0..6).map(|i| v[i] * s[9 * i + c]).sum()).collect();
        for (c, (adjoint, forward)) in flat(&g).iter().zip(&by_rows).enumerate() {
            near(*adjoint, *forward, 1e-9, &format!("adjoint, input {c}"));
        }
        let state = |d: &[f64]| held_engine(&b, d, &fine).state().to_vec();
        for c in (0..9).filter(|c| !(3..6).contains(c)) {
            let mut along = [0.0; 9];
            along[c] = 1.0;
            for (i, d) in difference(&state, &HELD, &along, 1e-3).iter().enumerate() {
                near(s[9 * i + c], *d, 1e-7, &format!("bend {bend}, state {i} by input {c}"));
            }
        }
        let direction = Gradient { x0: vec![0.5, -0.3, 0.2, 0.0, 0.0, 0.0], p: vec![0.4, 0.2], u: vec![-0.6] };
        let along = e.adjoint_along(&v, &direction);
        if bend != 0.0 {
            assert!(along.is_err(), "third derivatives of a surface");
            continue;
        }
        let along = along.unwrap();
        let gradient = |d: &[f64]| flat(&held_engine(&b, d, &o).adjoint(&v, &[]).unwrap());
        let d = difference(&gradient, &HELD, &flat(&direction), 1e-3);
        for (c, (found, exact)) in flat(&along.derivative).iter().zip(d).enumerate() {
            near(*found, exact, 2e-6, &format!("second derivative, input {c}"));
        }
    }
}

/// Controls change while a surface is held, or move it away; a start may lie on it.
#[test]
fn held_behind_controls_and_at_a_start() {
    let g = Graph::new();
    let (x, z, u) = (g.x(0), g.x(1), g.u(0));
    let b = model(&g, (1, 0, 1), &[u - z + 0.0 * x, z - x.sign()], vec![]);
    let mut e = Engine::new(&b.system, &tol(1e-10)).unwrap();
    e.reinit(0.0, &[0.0, 0.0]).unwrap();
    for (k, (control, state, z)) in
        [(0.3, 0.0, 0.3), (-0.8, 0.0, -0.8), (1.5, 0.5, 1.0), (0.0, 0.0, 0.0)].iter().enumerate()
    {
        e.set_controls(&[*control]).unwrap();
        e.advance(1.0 + k as f64).unwrap();
        assert_eq!(e.outcome(), Outcome::Reached, "{}", e.reason());
        near(e.state()[0], *state, 1e-12, "state");
        near(e.state()[1], *z, 1e-9, "algebraic state");
    }
}

/// A relay whose algebraic state knows nothing of it, so that neither its value nor its rate determines a weight at once.
#[test]
fn what_is_not_held_ends_in_words() {
    let g = Graph::new();
    let (x, z, w) = (g.x(0), g.x(1), g.x(2));
    let b = model(&g, (0, 0, 2), &[0.3 - w + 0.0 * z, z - x, w - z.sign()], vec![]);
    let r = run(&b, &tol(1e-8), &[1.0, 1.0, 1.0], &[], 5.0);
    assert_eq!(r.outcome, Outcome::NoContinuation, "{}", r.reason);
    near(r.t, 1.0 / 0.7, 1e-9, "where it would slide");
    assert!(r.reason.contains("no weights of two of them hold the surface"), "{}", r.reason);
}
