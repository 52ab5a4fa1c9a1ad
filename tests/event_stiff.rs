//! Stiff systems large enough for sparse matrices: a rod that conducts heat, with a thermostat, beside its solution by
//! eigenvectors.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use std::sync::Arc;
use switchback::event::{simulate, Engine, Method, Options, Outcome, Run, Switch};
use switchback::expr::{Expr, ExprFunction, Graph};
use switchback::func::Dims;
use switchback::model::Model;
use switchback::system::{Regions, Subsystem, System};

/// Angular frequency of the air at the end of the rod, its mean temperature and amplitude; temperature of the thermostat.
const OMEGA: f64 = 1.3;
const MEAN: f64 = 8.0;
const AMPLITUDE: f64 = 14.0;
const LEVEL: f64 = 20.0;

/// `n` nodes, insulated at the beginning, as warm as the air at the end, with a heater and a thermostat at node `n / 4`.
struct Rod {
    n: usize,
    heated: usize,
}

impl Rod {
    fn new(n: usize) -> Rod {
        Rod { n, heated: n / 4 }
    }

    fn conduction(&self) -> f64 {
        0.2 * (self.n * self.n) as f64
    }

    /// Heat when the heater is on.
    fn power(&self) -> f64 {
        4.0 * self.n as f64
    }

    /// The model; `full` has every state in every row, multiplied by a parameter that is zero.
    fn system(&self, full: bool) -> System {
        let (n, g) = (self.n, Graph::new());
        let d = Dims { x: n, u: 0, p: 1 };
        let mut s = System::new(n, 0, 1).unwrap();
        let air = MEAN + AMPLITUDE * (OMEGA * g.t()).sin();
        let sum = (1..n).fold(g.x(0), |sum, i| sum + g.x(i));
        let rate = |i: usize| -> Expr {
            let before = if i > 0 { g.x(i - 1) } else { g.x(0) };
            let behind = if i + 1 < n { g.x(i + 1) } else { air };
            let own = self.conduction() * (before - 2.0 * g.x(i) + behind) + 0.3 * (air - g.x(i));
            if full {
                own + g.p(0) * sum
            } else {
                own
            }
        };
        let rates: Vec<Expr> = (0..n).map(rate).collect();
        s.set_f0(Arc::new(g.function("f0", d, &rates).unwrap())).unwrap();
        let psi = Arc::new(g.function("psi", d, &[g.x(self.heated) - LEVEL]).unwrap());
        let ids = g.ids(&[g.constant(0.0), g.constant(self.power())]);
        let modes = Arc::new(ExprFunction::with_parts("modes", &mut g.dag(), d, &ids, 1).unwrap());
        let regions = Regions::Signs { psi, signs: vec![1, -1] };
        s.add_subsystem(Subsystem { rows: vec![self.heated], modes, n_modes: 2, regions }).unwrap();
        s
    }

    fn run(&self, full: bool, options: &Options, end: f64) -> Run {
        let r = simulate(&self.system(full), options, 0.0, &vec![15.0; self.n], end).unwrap();
        assert_eq!(r.outcome, Outcome::Reached, "{} nodes: {}", self.n, r.reason);
        r
    }
}

/// `x' = A x + b + c sin ω t` with a symmetric `A`, for the states that move; the others are constant.
struct Linear {
    moving: Vec<usize>,
    values: DVector<f64>,
    vectors: DMatrix<f64>,
    /// `b` and `c` in eigenvectors.
    b: DVector<f64>,
    c: DVector<f64>,
}

impl Linear {
    /// With the heater on or off, or with the heated node held at its temperature.
    fn new(rod: &Rod, heat: f64, held: bool) -> Linear {
        let moving: Vec<usize> = (0..rod.n).filter(|i| !(held && *i == rod.heated)).collect();
        let (k, m) = (rod.conduction(), moving.len());
        let (mut a, mut b, mut c) = (DMatrix::zeros(m, m), DVector::zeros(m), DVector::zeros(m));
        for (row, &i) in moving.iter().enumerate() {
            let flows = if i == 0 { 1.0 } else { 2.0 };
            a[(row, row)] = -k * flows - 0.3;
            for j in [i.wrapping_sub(1), i + 1] {
                match moving.binary_search(&j) {
                    Ok(column) => a[(row, column)] = k,
                    Err(_) if held && j == rod.heated => b[row] += k * LEVEL,
                    Err(_) => {}
                }
            }
            let air = 0.3 + if i + 1 == rod.n { k } else { 0.0 };
            b[row] += air * MEAN + if i == rod.heated { heat } else { 0.0 };
            c[row] += air * AMPLITUDE;
        }
        let SymmetricEigen { eigenvalues, eigenvectors } = SymmetricEigen::new(a);
        let (b, c) = (eigenvectors.transpose() * b, eigenvectors.transpose() * c);
        Linear { moving, values: eigenvalues, vectors: eigenvectors, b, c }
    }

    /// The particular solution in eigenvectors.
    fn forced(&self, t: f64) -> DVector<f64> {
        let (s, c) = (OMEGA * t).sin_cos();
        DVector::from_fn(self.values.len(), |i, _| {
            let l = self.values[i];
            -self.b[i] / l - self.c[i] * (l * s + OMEGA * c) / (l * l + OMEGA * OMEGA)
        })
    }

    /// What is left of the start at time `t0`, in eigenvectors.
    fn free(&self, t0: f64, x: &[f64]) -> DVector<f64> {
        let own = DVector::from_iterator(self.moving.len(), self.moving.iter().map(|i| x[*i]));
        self.vectors.transpose() * own - self.forced(t0)
    }

    fn at(&self, t0: f64, free: &DVector<f64>, t: f64, x: &mut [f64]) {
        let grown = DVector::from_fn(free.len(), |i, _| free[i] * (self.values[i] * (t - t0)).exp());
        let own = &self.vectors * (grown + self.forced(t));
        self.moving.iter().zip(own.iter()).for_each(|(i, v)| x[*i] = *v);
    }
}

/// The solution from eigenvectors: switching times and the state at the end.
fn exact(rod: &Rod, end: f64) -> (Vec<f64>, Vec<f64>) {
    let modes = [Linear::new(rod, rod.power(), false), Linear::new(rod, 0.0, false), Linear::new(rod, 0.0, true)];
    let (on, off, slides) = (0, 1, 2);
    // weight of the mode with the heater on the surface
    let weight = |x: &[f64], t: f64| {
        let air = MEAN + AMPLITUDE * (OMEGA * t).sin();
        let h = rod.heated;
        -(rod.conduction() * (x[h - 1] - 2.0 * x[h] + x[h + 1]) + 0.3 * (air - x[h])) / rod.power()
    };
    // what is positive in every mode
    let left = |mode: usize, x: &[f64], t: f64| match mode {
        0 => LEVEL - x[rod.heated],
        1 => x[rod.heated] - LEVEL,
        _ => weight(x, t).min(1.0 - weight(x, t)),
    };
    let (mut mode, mut t0, mut x) = (on, 0.0, vec![15.0; rod.n]);
    let mut times = Vec::new();
    loop {
        let free = modes[mode].free(t0, &x);
        let mut y = x.clone();
        let value = |t: f64, y: &mut Vec<f64>| {
            modes[mode].at(t0, &free, t, y);
            left(mode, y, t)
        };
        // behind a switch the function is zero to rounding
        let (mut a, mut b) = (t0 + 1e-9, t0);
        loop {
            b += 2e-3;
            if b >= end || value(b, &mut y) < 0.0 {
                break;
            }
            a = b;
        }
        if b >= end && value(end, &mut y) >= 0.0 {
            return (times, y);
        }
        b = b.min(end);
        for _ in 0..60 {
            let middle = 0.5 * (a + b);
            if value(middle, &mut y) < 0.0 {
                b = middle;
            } else {
                a = middle;
            }
        }
        value(a, &mut y);
        (t0, x) = (a, y);
        times.push(a);
        let w = weight(&x, a);
        mode = match mode {
            2 if w < 0.5 => off,
            2 => on,
            _ if (0.0..=1.0).contains(&w) => slides,
            0 => off,
            _ => on,
        };
        if mode == slides {
            x[rod.heated] = LEVEL;
        }
    }
}

fn times(switches: &[Switch]) -> Vec<f64> {
    switches.iter().map(|s| s.t).collect()
}

fn error(found: &[f64], exact: &[f64]) -> f64 {
    assert_eq!(found.len(), exact.len(), "{found:?}\n{exact:?}");
    found.iter().zip(exact).map(|(a, b)| (a - b).abs() / (1.0 + b.abs())).fold(0.0, f64::max)
}

#[test]
fn a_rod_with_a_thermostat_is_followed_at_every_tolerance() {
    for n in [60, 200] {
        let rod = Rod::new(n);
        let (switches, x) = exact(&rod, 3.0);
        assert!(switches.len() >= 3, "{switches:?}");
        let mut errors = Vec::new();
        for e in [4, 6, 8] {
            let tol = 10f64.powi(-e);
            let r = rod.run(false, &Options::with_tolerance(tol, 1e-2 * tol), 3.0);
            let worst = error(&times(&r.switches), &switches).max(error(&r.x, &x));
            assert!(worst <= 30.0 * tol, "{n} nodes, {tol:e}: {worst:e}");
            errors.push(worst);
        }
        // with the tolerance over four decades, where the loosest one is met by far
        assert!(errors[2] <= 3e-2 * errors[0], "{errors:?}");
    }
}

#[test]
fn a_rod_of_many_nodes_is_no_more_steps() {
    let steps = |n: usize| {
        let r = Rod::new(n).run(false, &Options::with_tolerance(1e-6, 1e-8), 12.0);
        assert_eq!(r.switches.len(), 11, "{:?}", times(&r.switches));
        assert!(r.stats.factorisations > 0, "{:?}", r.stats);
        r.stats.steps
    };
    let few = steps(50);
    for n in [100, 200, 400] {
        assert!(steps(n) <= 2 * few, "{n} nodes");
    }
}

#[test]
fn sparse_and_dense_matrices_give_the_same_steps() {
    let (rod, end) = (Rod::new(40), 2.8);
    let options = Options { method: Method::Radau5, ..Options::with_tolerance(1e-7, 1e-9) };
    let (sparse, dense) = (rod.run(false, &options, end), rod.run(true, &options, end));
    assert_eq!(sparse.switches.len(), dense.switches.len());
    assert!(error(&times(&sparse.switches), &times(&dense.switches)) <= 1e-6);
    assert!(error(&sparse.x, &dense.x) <= 1e-6);
    // factors that serve several steps
    assert!(sparse.stats.jacobians < dense.stats.jacobians, "{:?} {:?}", sparse.stats, dense.stats);
}

/// The error of Radau IIA falls with the fifth power of the length of the steps, for sparse matrices with slides too.
#[test]
fn the_order_of_sparse_radau_is_five() {
    let rod = Rod::new(40);
    let (switches, x) = exact(&rod, 1.6);
    let worst = |e: f64| {
        let tol = 10f64.powf(-e);
        let options = Options { method: Method::Radau5, ..Options::with_tolerance(tol, 1e-2 * tol) };
        let r = rod.run(false, &options, 1.6);
        (r.stats.steps as f64, error(&times(&r.switches), &switches).max(error(&r.x, &x)))
    };
    let ((n1, e1), (n2, e2)) = (worst(5.0), worst(9.0));
    let order = (e1 / e2).ln() / (n2 / n1).ln();
    assert!(order >= 4.0, "{order}");
}

/// A function that is not defined where a step tries leaves matrices as they are: the run goes on with shorter steps.
#[test]
fn what_is_not_defined_at_a_stage_does_not_end_sparse_matrices() {
    let n = 30;
    let (g, d) = (Graph::new(), Dims { x: n, u: 0, p: 0 });
    // the first state falls to the border of where its root is defined, sqrt(x)' = −1/2 until it rests
    let rate = |i: usize| match i {
        0 => -1.0 * g.x(0).sqrt(),
        _ => 1e5 * (g.x(i - 1) - g.x(i)),
    };
    let rates: Vec<Expr> = (0..n).map(rate).collect();
    let mut s = System::new(n, 0, 0).unwrap();
    s.set_f0(Arc::new(g.function("f0", d, &rates).unwrap())).unwrap();
    let options = Options { method: Method::Radau5, ..Options::with_tolerance(1e-6, 1e-8) };
    let mut engine = Engine::new(&s, &options).unwrap();
    engine.reinit(0.0, &vec![1.0; n]).unwrap();
    assert_eq!(engine.advance(1.9).unwrap(), Outcome::Reached, "{}", engine.reason());
    // x = (1 − t/2)²
    assert!((engine.state()[0] - 0.0025).abs() <= 1e-6, "{}", engine.state()[0]);
    assert!(engine.stats().jacobians < engine.stats().steps, "{:?}", engine.stats());
}

/// Van der Pol's oscillator with a relay, whose jumps last a thousandth of its slow parts: the error of a step is weighed by the state, also where
/// the velocity at its start is that of a transient and times the step as much as many states. The reference is of SciPy's Radau and LSODA at 1e-12.
#[test]
fn transients_do_not_loosen_the_tolerance() {
    let g = Graph::new();
    let (x, v) = (g.x(0), g.x(1));
    let rhs = [v, 1000.0 * (1.0 - x * x) * v - x + 0.1 * x.sign()];
    let system = Model::from_rhs("van der Pol", 0, 0, &rhs).and_then(|m| m.build(&g)).unwrap().system;
    let (end, switch) = ([-1.480_972_166, 0.001_157_290_39], 860.497_792);
    for tol in [1e-3, 1e-4, 1e-5, 1e-6] {
        let options = Options::with_tolerance(tol, 1e-3 * tol);
        let run = simulate(&system, &options, 0.0, &[2.0, 0.0], 1500.0).unwrap();
        assert_eq!(run.switches.len(), 1, "{tol}");
        for (x, exact) in run.x.iter().zip(end) {
            assert!((x - exact).abs() <= tol * exact.abs(), "{tol}: {x}");
        }
        let t = run.switches[0].t;
        assert!((t - switch).abs() <= tol * switch, "{tol}: {t}");
    }
}

/// A rectifier: a source of 10 V and 50 Hz behind a diode with the resistances `on` and `off`, a coil and a resistor, and with a capacitor
/// beside the resistor if there is one.
struct Rectifier {
    on: f64,
    off: f64,
    coil: f64,
    load: f64,
    capacitor: Option<f64>,
}

impl Rectifier {
    const VOLTAGE: f64 = 10.0;
    const OMEGA: f64 = 100.0 * std::f64::consts::PI;
    const END: f64 = 0.06;

    fn system(&self) -> System {
        let g = Graph::new();
        let i = g.x(0);
        let diode = i.gt(0.0).select(self.on * i, self.off * i);
        let source = Self::VOLTAGE * (Self::OMEGA * g.t()).sin();
        let rates = match self.capacitor {
            None => vec![(source - self.load * i - diode) / self.coil],
            Some(c) => vec![(source - g.x(1) - diode) / self.coil, (i - g.x(1) / self.load) / c],
        };
        Model::from_rhs("rectifier", 0, 0, &rates).and_then(|m| m.build(&g)).unwrap().system
    }

    /// Current and voltage at the end and the times of the switches, piece by piece by steps of a microsecond: the matrix exponential of
    /// the circuit together with the two states of the source.
    fn reference(&self) -> (Vec<f64>, Vec<f64>) {
        let n = if self.capacitor.is_some() { 2 } else { 1 };
        let matrix = |on: bool| {
            let r = if on { self.on } else { self.off };
            let mut a = DMatrix::zeros(n + 2, n + 2);
            a[(0, n)] = Self::VOLTAGE / self.coil;
            (a[(n, n + 1)], a[(n + 1, n)]) = (Self::OMEGA, -Self::OMEGA);
            a[(0, 0)] = -r / self.coil;
            match self.capacitor {
                None => a[(0, 0)] -= self.load / self.coil,
                Some(c) => {
                    a[(0, 1)] = -1.0 / self.coil;
                    (a[(1, 0)], a[(1, 1)]) = (1.0 / c, -1.0 / (c * self.load));
                }
            }
            a
        };
        let steps = 60_000;
        let h = Self::END / f64::from(steps);
        let (modes, over) = ([matrix(false), matrix(true)], |a: &DMatrix<f64>, h: f64| (a * h).exp());
        let whole = [over(&modes[0], h), over(&modes[1], h)];
        let (mut x, mut on, mut switches) = (DVector::zeros(n + 2), true, Vec::new());
        x[n + 1] = 1.0;
        for k in 0..steps {
            let mut next = &whole[usize::from(on)] * &x;
            let crosses = |x: &DVector<f64>, on: bool| if on { x[0] < 0.0 } else { x[0] > 0.0 };
            if crosses(&next, on) {
                let (mut low, mut high) = (0.0, h);
                for _ in 0..50 {
                    let middle = 0.5 * (low + high);
                    let there = over(&modes[usize::from(on)], middle) * &x;
                    (low, high) = if crosses(&there, on) { (low, middle) } else { (middle, high) };
                }
                let mut there = over(&modes[usize::from(on)], high) * &x;
                there[0] = 0.0;
                on = !on;
                next = over(&modes[usize::from(on)], h - high) * there;
                switches.push(f64::from(k) * h + high);
            }
            x = next;
        }
        (x.rows(0, n).iter().copied().collect(), switches)
    }
}

/// Blocking currents next to the tolerances, and modes that are far faster than the steps they begin with: every switch of a diode is
/// found, and no other, at any tolerance.
#[test]
fn diodes_switch_when_they_do() {
    let rectifiers = [
        Rectifier { on: 1e-2, off: 1e5, coil: 1e-2, load: 10.0, capacitor: None },
        Rectifier { on: 1e-2, off: 1e5, coil: 1e-3, load: 5.0, capacitor: None },
        Rectifier { on: 1e-2, off: 1e5, coil: 1e-3, load: 50.0, capacitor: Some(1e-4) },
        Rectifier { on: 1e-2, off: 1e6, coil: 1e-3, load: 50.0, capacitor: Some(1e-4) },
        Rectifier { on: 1e-3, off: 1e4, coil: 1e-2, load: 20.0, capacitor: Some(1e-3) },
    ];
    for (k, r) in rectifiers.iter().enumerate() {
        let (system, (end, switches)) = (r.system(), r.reference());
        let n = end.len();
        for e in 2..=7 {
            let rtol = 10f64.powi(-e);
            for atol in [rtol, 1e-2 * rtol, 1e-4 * rtol] {
                for method in [Method::Auto, Method::Radau5] {
                    let opt = Options { method, ..Options::with_tolerance(rtol, atol) };
                    let s = simulate(&system, &opt, 0.0, &vec![0.0; n], Rectifier::END).unwrap();
                    let what = format!("rectifier {k}, {method:?}, {rtol:e}, {atol:e}");
                    assert_eq!(s.outcome, Outcome::Reached, "{what}: {}", s.reason);
                    assert_eq!(s.switches.len(), switches.len(), "{what}: {:?}", s.switches);
                    for (s, t) in s.switches.iter().zip(&switches) {
                        assert!((s.t - t).abs() <= 30.0 * rtol * Rectifier::END, "{what}: {} and not {t}", s.t);
                    }
                    for (x, e) in s.x.iter().zip(&end) {
                        assert!((x - e).abs() <= 10.0 * (atol + rtol * e.abs()) + 1e-10, "{what}: {x} and not {e}");
                    }
                    assert!(s.stats.steps < 1000, "{what}: {} steps", s.stats.steps);
                }
            }
        }
    }
}

/// A damped mode 1e3 times as fast as what drives it, and one that is driven by it. At tight tolerances error control keeps explicit steps
/// a little below the limit of their stability, where they go on for ever: the implicit method has to take over all the same.
#[test]
fn what_is_stiff_is_seen_at_tight_tolerances() {
    const FAST: f64 = 1e3;
    const END: f64 = 10.0;
    let g = Graph::new();
    let rates = [FAST * (g.t().sin() - g.x(0)), g.x(0) - g.x(1)];
    let system = Model::from_rhs("follower", 0, 0, &rates).and_then(|m| m.build(&g)).unwrap().system;
    // x' = L (sin t − x), x(0) = 0, and y' = x − y by variation of constants
    let scale = FAST / (FAST * FAST + 1.0);
    let x = scale * (FAST * END.sin() - END.cos() + (-FAST * END).exp());
    let wave = 0.5 * (FAST * (END.sin() - END.cos()) - (END.cos() + END.sin()));
    let rest = 0.5 * (FAST + 1.0) - 1.0 / (1.0 - FAST);
    let y = scale * (wave + rest * (-END).exp() + (-FAST * END).exp() / (1.0 - FAST));
    for e in 3..=9 {
        let rtol = 10f64.powi(-e);
        let r = simulate(&system, &Options::with_tolerance(rtol, 1e-2 * rtol), 0.0, &[0.0, 0.0], END).unwrap();
        assert!((r.x[0] - x).abs() <= 10.0 * rtol, "{rtol:e}: {} and not {x}", r.x[0]);
        assert!((r.x[1] - y).abs() <= 10.0 * rtol, "{rtol:e}: {} and not {y}", r.x[1]);
        assert!(r.stats.evaluations < 4000, "{rtol:e}: {:?}", r.stats);
    }
}

/// A rectifier blocks fifty times, each time with a transient that is over in a tenth of a microsecond: the first step there is as long as the
/// first ones before turned out to be, and not cut down to it from one of milliseconds every time. Half the attempts failed so.
#[test]
fn transients_that_come_again_are_known() {
    let r = Rectifier { on: 1e-2, off: 1e5, coil: 1e-2, load: 10.0, capacitor: None };
    let s = simulate(&r.system(), &Options::with_tolerance(1e-3, 1e-5), 0.0, &[0.0], 1.0).unwrap();
    assert_eq!(s.switches.len(), 99);
    assert!(s.stats.rejections < 200, "{:?}", s.stats);
}

/// In modes that are affine Newton's method has arrived after one iteration, and how fast it converges is known from the steps before: mostly
/// no second one is needed to see it.
#[test]
fn affine_modes_take_one_iteration() {
    let r = Rectifier { on: 1e-3, off: 1e4, coil: 1e-2, load: 20.0, capacitor: Some(1e-3) };
    for e in [3, 6, 9] {
        let rtol = 10f64.powi(-e);
        let opt = Options { method: Method::Radau5, ..Options::with_tolerance(rtol, 1e-2 * rtol) };
        let s = simulate(&r.system(), &opt, 0.0, &[0.0, 0.0], 1.0).unwrap();
        let attempts = s.stats.steps + s.stats.rejections + s.stats.relocations;
        assert_eq!(s.switches.len(), 99, "{rtol:e}");
        assert!(2 * s.stats.newton < 3 * attempts, "{rtol:e}: {:?}", s.stats);
    }
}
