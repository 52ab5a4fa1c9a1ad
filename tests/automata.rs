//! Automata and hysteresis, alone and driving each other: against closed forms in 60 digits, with derivatives forward,
//! adjoint and by differences.

use std::path::Path;

use switchback::event::{Engine, Method, Options, Outcome, Term};
use switchback::expr::{Expr, Graph, Id, Piecewise};
use switchback::model::{Built, Model, Transition};
use switchback::system::Direction;

use Direction::{Falling, Rising};

/// A problem of `tests/data/reference/scenes`.
struct Reference(serde_json::Value);

impl Reference {
    fn new(name: &str) -> Reference {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/reference/scenes");
        let text = std::fs::read_to_string(folder.join(format!("{name}.json"))).unwrap();
        Reference(serde_json::from_str(&text).unwrap())
    }

    fn numbers(&self, field: &str) -> Vec<f64> {
        flat(&self.0[field])
    }

    fn rows(&self, field: &str) -> Vec<Vec<f64>> {
        self.0[field].as_array().unwrap().iter().map(flat).collect()
    }
}

fn flat(v: &serde_json::Value) -> Vec<f64> {
    let one = |v: &serde_json::Value| v.as_f64().or_else(|| v.as_str().and_then(|s| s.parse().ok())).unwrap();
    v.as_array().map_or_else(|| vec![one(v)], |a| a.iter().flat_map(flat).collect())
}

/// Largest difference, relative to one and to the numbers.
fn off(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len(), "{a:?} {b:?}");
    a.iter().zip(b).fold(0.0, |m, (a, b)| f64::max(m, (a - b).abs() / (1.0 + b.abs())))
}

/// Where the guard passes zero: between which values of a discrete state.
fn edge(guard: Expr, direction: Direction, state: usize, (from, to): (f64, f64)) -> Transition {
    Transition { guard: guard.id(), direction, from: vec![(state, from)], reset: vec![], to: vec![(state, to)] }
}

/// A value that goes from `low` to 1 above `on`, and back below `off`.
fn hysteresis(m: &mut Model, value: Expr, on: Expr, off: Expr, state: usize, low: f64) {
    m.add_transition(edge(value - on, Rising, state, (low, 1.0)));
    m.add_transition(edge(value - off, Falling, state, (1.0, low)));
}

fn model(g: &Graph, np: usize, rhs: &[Expr], initial: &[f64], add: impl FnOnce(&mut Model)) -> Built {
    let zeros = vec![g.constant(0.0); initial.len()];
    let mut m = Model::from_rhs("automaton", 0, np, &[rhs, &zeros].concat()).unwrap();
    m.set_discrete(initial).unwrap();
    add(&mut m);
    m.build(g).unwrap()
}

fn thermostat() -> Built {
    let g = Graph::new();
    let (x, w) = (g.x(0), g.x(1));
    let [k, heat, lo, hi] = [0, 1, 2, 3].map(|i| g.p(i));
    model(&g, 4, &[heat * w - k * x], &[1.0], |m| hysteresis(m, -x, -lo, -hi, 1, 0.0))
}

fn relay() -> Built {
    let g = Graph::new();
    let (x, u, d) = (g.x(0), g.x(1), g.p(0));
    model(&g, 1, &[u - x], &[1.0], |m| {
        m.add_transition(edge(x - d, Rising, 1, (1.0, -1.0)));
        m.add_transition(edge(x + d, Falling, 1, (-1.0, 1.0)));
    })
}

/// The thresholds of the pump depend on the valve: hysteresis drives hysteresis.
fn two_tanks() -> Built {
    let g = Graph::new();
    let [h1, h2, pump, valve] = [0, 1, 2, 3].map(|i| g.x(i));
    let [q, k1, k2, c, lo, hi, b, d] = [0, 1, 2, 3, 4, 5, 6, 7].map(|i| g.p(i));
    let rhs = [q * pump - k1 * h1, k1 * h1 - k2 * h2 - c * valve];
    model(&g, 8, &rhs, &[0.0, 0.0], |m| {
        hysteresis(m, -h1, 0.25 * valve - lo, 0.25 * valve - hi, 2, 0.0);
        hysteresis(m, h2, b, d, 3, 0.0);
    })
}

/// A gear box asks whether the driver drives; going up it brakes the car and wears by the speed.
fn gear_box() -> Built {
    let g = Graph::new();
    let [v, wear, gear, drives] = [0, 2, 3, 4].map(|i| g.x(i));
    let [a, d, e, r] = [0, 1, 2, 3].map(|i| g.p(i));
    let ratios = Piecewise::steps(&[1.5, 2.5], &[3.0, 1.5, 1.0]).unwrap();
    let rhs = [a * g.piecewise(&ratios, gear) * drives - d * v, v, g.constant(0.0)];
    model(&g, 4, &rhs, &[1.0, 1.0], |m| {
        let reset = |m: &mut Model, t: Transition, reset: Vec<(usize, Id)>| m.add_transition(Transition { reset, ..t });
        for (from, above) in [(1.0, 10.0), (2.0, 18.0)] {
            let mut t = edge(v - above, Rising, 3, (from, from + 1.0));
            t.from.push((4, 1.0));
            reset(m, t, vec![(0, ((1.0 - e) * v).id()), (2, (wear + r * v * v).id())]);
        }
        for (from, below) in [(2.0, 7.0), (3.0, 13.0)] {
            reset(m, edge(v - below, Falling, 3, (from, from - 1.0)), vec![(2, (wear + r).id())]);
        }
        m.add_transition(edge(v - 24.0, Rising, 4, (1.0, 0.0)));
        m.add_transition(edge(v - 6.0, Falling, 4, (0.0, 1.0)));
    })
}

fn run(b: &Built, opt: &Options, x: &[f64], p: &[f64], t: f64) -> Engine {
    let mut e = Engine::new(&b.system, opt).unwrap();
    e.reinit(0.0, &[x, b.discrete()].concat()).unwrap();
    e.set_params(p).unwrap();
    e.advance(t).unwrap();
    assert_eq!(e.outcome(), Outcome::Reached, "{}", e.reason());
    e
}

const CASES: [(&str, fn() -> Built); 4] =
    [("thermostat_run", thermostat), ("relay_hysteresis_run", relay), ("two_tanks", two_tanks), ("gear_box", gear_box)];

#[test]
fn states_and_times_are_those_of_the_closed_forms() {
    for (name, build) in CASES {
        let (r, b) = (Reference::new(name), build());
        let (x0, p, t) = (r.numbers("x0"), r.numbers("p"), r.numbers("T")[0]);
        for method in [Method::Auto, Method::Dp5, Method::Dop853, Method::Radau5] {
            let e = run(&b, &Options { method, ..Options::with_tolerance(1e-12, 1e-12) }, &x0, &p, t);
            let times: Vec<f64> = e.jumps().iter().map(|j| j.t).collect();
            assert!(off(&times, &r.numbers("switches")) < 1e-10, "{name} {method:?}: {times:?}");
            let end = [r.numbers("x_T"), r.numbers("w_T")].concat();
            assert!(off(e.state(), &end) < 1e-10, "{name} {method:?}: {:?} {end:?}", e.state());
            assert!(!e.one_sided(), "{name} {method:?}");
            // discrete states are whole numbers, to the last bit
            let whole = e.jumps().iter().flat_map(|j| &j.after[x0.len()..]).all(|w| w.fract() == 0.0);
            assert!(whole, "{name} {method:?}");
        }
    }
}

#[test]
fn errors_follow_the_tolerance() {
    for (name, build) in CASES {
        let (r, b) = (Reference::new(name), build());
        let (x0, p, t) = (r.numbers("x0"), r.numbers("p"), r.numbers("T")[0]);
        for k in 4..=12 {
            let tol = 10f64.powi(-k);
            let e = run(&b, &Options::with_tolerance(tol, tol), &x0, &p, t);
            let times: Vec<f64> = e.jumps().iter().map(|j| j.t).collect();
            let error = off(&times, &r.numbers("switches")).max(off(&e.state()[..x0.len()], &r.numbers("x_T")));
            assert!(error < 100.0 * tol, "{name} {tol:e}: {error:e}");
        }
    }
}

#[test]
fn derivatives_three_ways_and_the_closed_forms() {
    for (name, build) in CASES {
        let (r, b) = (Reference::new(name), build());
        let (x0, p, t) = (r.numbers("x0"), r.numbers("p"), r.numbers("T")[0]);
        let (n, nx, np) = (x0.len(), b.dims.x, p.len());
        // what is asked for: columns of the states that are not discrete, and of the parameters
        let columns: Vec<usize> = (0..n).chain(nx..nx + np).collect();
        let (by_x, by_p) = (r.rows("dxT_dx0"), r.rows("dxT_dp"));
        let (t_by_x, t_by_p) = (r.rows("dt_dx0"), r.rows("dt_dp"));
        for method in [Method::Dop853, Method::Radau5] {
            let opt = Options { method, sensitivity: true, adjoint: true, ..Options::with_tolerance(1e-12, 1e-12) };
            let mut e = run(&b, &opt, &x0, &p, t);
            let s = e.sensitivity().unwrap().to_vec();
            let width = nx + np;
            for i in 0..n {
                let exact = [&by_x[i][..], &by_p[i]].concat();
                let forward: Vec<f64> = columns.iter().map(|c| s[i * width + c]).collect();
                assert!(off(&forward, &exact) < 1e-9, "{name} {method:?} x{i}: {forward:?} {exact:?}");
                let mut weights = vec![0.0; nx];
                weights[i] = 1.0;
                let gradient = e.adjoint(&weights, &[]).unwrap();
                let adjoint = [&gradient.x0[..n], &gradient.p].concat();
                assert!(off(&adjoint, &exact) < 1e-9, "{name} {method:?} x{i}: {adjoint:?} {exact:?}");
            }
            let jumps: Vec<Vec<f64>> = e.jumps().iter().map(|j| j.dt.clone()).collect();
            for (k, dt) in jumps.iter().enumerate() {
                let exact = [&t_by_x[k][..], &t_by_p[k]].concat();
                let forward: Vec<f64> = columns.iter().map(|&c| dt[c]).collect();
                assert!(off(&forward, &exact) < 1e-9, "{name} {method:?} t{k}: {forward:?} {exact:?}");
                let gradient = e.adjoint(&vec![0.0; nx], &[Term::Jump { index: k, weight: 1.0 }]).unwrap();
                let adjoint = [&gradient.x0[..n], &gradient.p].concat();
                assert!(off(&adjoint, &exact) < 1e-9, "{name} {method:?} t{k}: {adjoint:?} {exact:?}");
            }
        }
        // differences of eighth order between runs: what the engine does is what it differentiates
        let opt = Options { method: Method::Dop853, ..Options::with_tolerance(1e-13, 1e-13) };
        for c in 0..n + np {
            let moved = |h: f64| {
                let (mut x, mut p) = (x0.clone(), p.clone());
                *if c < n { &mut x[c] } else { &mut p[c - n] } += h;
                run(&b, &opt, &x, &p, t).state()[..n].to_vec()
            };
            // the error of a run, some 1e-13 of its largest state, over h is what is left of the digits
            let value = if c < n { x0[c] } else { p[c - n] }.abs();
            let h = if value == 0.0 { 1e-2 } else { 2e-4 * value.max(0.1) };
            let weights = [(1.0, 4.0 / 5.0), (2.0, -1.0 / 5.0), (3.0, 4.0 / 105.0), (4.0, -1.0 / 280.0)];
            let mut difference = vec![0.0; n];
            for (k, w) in weights {
                let (above, below) = (moved(k * h), moved(-k * h));
                for i in 0..n {
                    difference[i] += w * (above[i] - below[i]) / h;
                }
            }
            let exact: Vec<f64> = (0..n).map(|i| if c < n { by_x[i][c] } else { by_p[i][c - n] }).collect();
            assert!(off(&difference, &exact) < 1e-9, "{name} column {c}: {difference:?} {exact:?}");
        }
    }
}
