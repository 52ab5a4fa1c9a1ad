//! Automata and hysteresis, alone and driving each other: against closed forms in 60 digits, with derivatives forward,
//! adjoint and by differences.

use std::path::Path;

use switchback::event::{Engine, Method, Options, Outcome, Term};
use switchback::model::Built;

#[path = "../examples/report/automata_models.rs"]
mod automata_models;
use automata_models::AUTOMATA;

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

fn run(b: &Built, opt: &Options, x: &[f64], p: &[f64], t: f64) -> Engine {
    let mut e = Engine::new(&b.system, opt).unwrap();
    e.reinit(0.0, &[x, b.discrete()].concat()).unwrap();
    e.set_params(p).unwrap();
    e.advance(t).unwrap();
    assert_eq!(e.outcome(), Outcome::Reached, "{}", e.reason());
    e
}

#[test]
fn states_and_times_are_those_of_the_closed_forms() {
    for (name, build) in AUTOMATA {
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
    for (name, build) in AUTOMATA {
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

/// `x' = w - x` between 0.35 and 0.65: a step is never as long as tolerances allow, as a switch comes before. A step of order five
/// has six evaluations, and one that is thrown away and made again twelve, beside those at the switch.
#[test]
fn switches_that_end_every_step_are_foreseen() {
    let (b, gap, n) = (automata_models::thermostat(), (0.65f64 / 0.35).ln(), 100);
    let p = [1.0, 1.0, 0.35, 0.65];
    for tol in [1e-2, 1e-3] {
        let e = run(&b, &Options::with_tolerance(tol, tol), &[0.35], &p, (n as f64 + 0.5) * gap);
        assert_eq!(e.jumps().len(), n, "{tol:e}");
        assert!(e.stats().evaluations < 11 * n, "{tol:e}: {:?}", e.stats());
        let off = e.jumps().iter().enumerate().map(|(k, j)| (j.t - (k + 1) as f64 * gap).abs()).fold(0.0, f64::max);
        // a tenth of the tolerance at every switch
        assert!(off < 0.1 * tol * n as f64, "{tol:e}: {off:e}");
    }
}

#[test]
fn derivatives_three_ways_and_the_closed_forms() {
    for (name, build) in AUTOMATA {
        let (r, b) = (Reference::new(name), build());
        let (x0, p, t) = (r.numbers("x0"), r.numbers("p"), r.numbers("T")[0]);
        let (n, nx, np) = (x0.len(), b.dims.x, p.len());
        // what is asked for: columns of the states that are not discrete, and of the parameters
        let columns: Vec<usize> = (0..n).chain(nx..nx + np).collect();
        let (by_x, by_p) = (r.rows("dxT_dx0"), r.rows("dxT_dp"));
        let (t_by_x, t_by_p) = (r.rows("dt_dx0"), r.rows("dt_dp"));
        for method in [Method::Dop853, Method::Radau5] {
            let opt =
                Options { method, sensitivity: true.into(), adjoint: true, ..Options::with_tolerance(1e-12, 1e-12) };
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
