//! Answers do not depend on units: states, time, switching functions, controls and parameters in other units, each with a
//! factor of its own, tolerances with them.
//!
//! Where the factors are powers of two all arithmetic is the same but for exponents, so a run is the same to the last bit:
//! any constant with a hidden unit shows. Factors that are powers of ten add rounding errors of 1e-16 to every number;
//! decisions of the step length hang on them, but what the tolerance allows is not used up by that: the answers agree to
//! a tenth of the tolerance.

mod common;
#[path = "../examples/report/reference.rs"]
mod reference;

use common::models::*;
use std::sync::Arc;
use switchback::event::{Engine, Method, Options, Outcome, Run, Zeno};
use switchback::func::{Dims, EvalResult, Function, Point};
use switchback::linalg::csc::Pattern;
use switchback::system::{Regions, SharedFunction, Subsystem, System};

/// Factors by which numbers become larger in the new units.
#[derive(Clone)]
struct Units {
    x: Vec<f64>,
    u: Vec<f64>,
    p: Vec<f64>,
    t: f64,
    /// Of the switching functions, subsystem by subsystem.
    psi: Vec<Vec<f64>>,
}

impl Units {
    fn of(sys: &System, mut factor: impl FnMut() -> f64) -> Units {
        let d = sys.dims();
        let mut many = |n: usize| (0..n).map(|_| factor()).collect::<Vec<f64>>();
        let (x, u, p) = (many(d.x), many(d.u), many(d.p));
        let t = many(1)[0];
        let psi = sys.subsystems().iter().map(|s| many(psi_of(s).n_out())).collect();
        Units { x, u, p, t, psi }
    }

    /// Only one of the kinds is changed.
    fn only(sys: &System, kind: usize, mut factor: impl FnMut() -> f64) -> Units {
        let mut units = Units::of(sys, || 1.0);
        let d = sys.dims();
        match kind {
            0 => units.x.iter_mut().for_each(|v| *v = factor()),
            1 => units.t = factor(),
            2 => units.psi.iter_mut().flatten().for_each(|v| *v = factor()),
            // states as one, as everyone would
            3 => units.x = vec![factor(); d.x],
            _ => units.u.iter_mut().chain(&mut units.p).for_each(|v| *v = factor()),
        }
        units
    }
}

fn psi_of(s: &Subsystem) -> &SharedFunction {
    match &s.regions {
        Regions::Signs { psi, .. } | Regions::Indicators(psi) => psi,
    }
}

/// A function in other units.
struct Scaled {
    f: SharedFunction,
    units: Units,
    /// Factors of the outputs.
    out: Vec<f64>,
    columns: Vec<f64>,
}

impl Scaled {
    fn shared(f: &SharedFunction, units: &Units, out: Vec<f64>) -> SharedFunction {
        let columns = [&units.x[..], &units.u, &units.p, &[units.t]].concat();
        Arc::new(Scaled { f: f.clone(), units: units.clone(), out, columns })
    }

    fn at<R>(&self, at: &Point, body: impl FnOnce(&Point) -> R) -> R {
        let old = |v: &[f64], s: &[f64]| v.iter().zip(s).map(|(v, s)| v / s).collect::<Vec<f64>>();
        let (x, u, p) = (old(at.x, &self.units.x), old(at.u, &self.units.u), old(at.p, &self.units.p));
        body(&Point { t: at.t / self.units.t, x: &x, u: &u, p: &p })
    }
}

impl Function for Scaled {
    fn name(&self) -> &str {
        self.f.name()
    }
    fn dims(&self) -> Dims {
        self.f.dims()
    }
    fn n_out(&self) -> usize {
        self.f.n_out()
    }
    fn jac_pattern(&self) -> &Pattern {
        self.f.jac_pattern()
    }
    fn hess_pattern(&self) -> &Pattern {
        self.f.hess_pattern()
    }
    fn work_len(&self) -> usize {
        self.f.work_len()
    }
    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.at(at, |at| self.f.value(at, out, work))?;
        out.iter_mut().zip(&self.out).for_each(|(o, s)| *o *= s);
        Ok(())
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.at(at, |at| self.f.jacobian(at, out, work))?;
        let p = self.jac_pattern();
        for col in 0..p.n_cols() {
            for k in p.range(col) {
                out[k] *= self.out[p.row_idx()[k]] / self.columns[col];
            }
        }
        Ok(())
    }
    fn hessian(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let w: Vec<f64> = weights.iter().zip(&self.out).map(|(w, s)| w * s).collect();
        self.at(at, |at| self.f.hessian(at, &w, out, work))?;
        let p = self.hess_pattern();
        for col in 0..p.n_cols() {
            for k in p.range(col) {
                out[k] /= self.columns[col] * self.columns[p.row_idx()[k]];
            }
        }
        Ok(())
    }
}

/// The system in other units.
fn scaled(sys: &System, units: &Units) -> System {
    let d = sys.dims();
    let mut out = System::new(d.x, d.u, d.p).unwrap();
    let rate = |i: usize| units.x[i] / units.t;
    if let Some(f0) = sys.f0() {
        out.set_f0(Scaled::shared(f0, units, (0..d.x).map(rate).collect())).unwrap();
    }
    for (s, of_psi) in sys.subsystems().iter().zip(&units.psi) {
        let modes: Vec<f64> = (0..s.n_modes).flat_map(|_| s.rows.iter().map(|&r| rate(r))).collect();
        let regions = match &s.regions {
            Regions::Signs { psi, signs } => {
                Regions::Signs { psi: Scaled::shared(psi, units, of_psi.clone()), signs: signs.clone() }
            }
            // indicators are compared with each other: one unit for all
            Regions::Indicators(g) => Regions::Indicators(Scaled::shared(g, units, vec![of_psi[0]; g.n_out()])),
        };
        let modes = Scaled::shared(&s.modes, units, modes);
        out.add_subsystem(Subsystem { rows: s.rows.clone(), modes, n_modes: s.n_modes, regions }).unwrap();
    }
    out
}

/// What is simulated.
struct Case {
    name: &'static str,
    sys: System,
    x0: Vec<f64>,
    u: Vec<f64>,
    p: Vec<f64>,
    t_end: f64,
}

fn cases() -> Vec<Case> {
    let of = |name: &'static str, sys: System, u: &[f64]| {
        let r = reference::load(name);
        Case { name, sys, x0: r.x0, u: u.to_vec(), p: vec![], t_end: r.t_end }
    };
    let mut all = vec![
        of("crossing", switching('a'), &[]),
        of("sliding", switching('b'), &[]),
        of("leaving", switching('c'), &[]),
        of("oscillator", oscillator(), &[]),
        of("codim2", sliding_mode(), &[-0.5, -0.4]),
        of("blocks", blocks(), &[]),
        of("coulomb", coulomb(), &[]),
        of("stickslip1", stick_slip(), &[]),
        of("zeno_T0999", zeno(), &[]),
        of("zeno_post", zeno(), &[]),
    ];
    all.push(with_parameters());
    all.push(two_signs());
    all
}

/// Friction whose size is a parameter, driven by a control.
fn with_parameters() -> Case {
    let d = Dims { x: 2, u: 1, p: 2 };
    let mut sys = System::new(2, 1, 2).unwrap();
    // x' = v, v' = -p0 x + u
    let f0 = smooth(
        "f0",
        d,
        2,
        |at, o| o.copy_from_slice(&[at.x[1], -at.p[0] * at.x[0] + at.u[0]]),
        &[(1, 0), (0, 1), (1, 2), (1, 3)],
        |at, o| o.copy_from_slice(&[-at.p[0], 1.0, 1.0, -at.x[0]]),
        &[(0, 3)],
        |_, w, o| o[0] = -w[1],
    );
    sys.set_f0(f0).unwrap();
    let f = affine("F", d, &[0.0, 0.0], &[(0, 4, -1.0), (1, 4, 1.0)]);
    add_sides(&mut sys, &[1], f, affine("psi", d, &[0.0], &[(0, 1, 1.0)]));
    Case { name: "parameters", sys, x0: vec![1.3, 0.0], u: vec![0.2], p: vec![1.7, 0.35], t_end: 6.0 }
}

/// Two switching functions in one subsystem, a mode for every pattern of signs: crossings and a sliding mode.
fn two_signs() -> Case {
    let d = Dims { x: 2, u: 0, p: 0 };
    let mut sys = System::new(2, 0, 0).unwrap();
    let psi = affine("psi", d, &[0.0, 0.0], &[(0, 0, 1.0), (1, 0, 0.3), (0, 1, 0.2), (1, 1, 1.0)]);
    let modes = affine("F", d, &[-1.0, 0.6, -0.8, 0.9, 1.0, 0.7, 0.9, -1.1], &[]);
    let regions = Regions::Signs { psi, signs: vec![1, 1, 1, -1, -1, -1, -1, 1] };
    sys.add_subsystem(Subsystem { rows: vec![0, 1], modes, n_modes: 4, regions }).unwrap();
    Case { name: "two signs", sys, x0: vec![0.9, -1.2], u: vec![], p: vec![], t_end: 4.0 }
}

fn options(method: Method) -> Options {
    Options { method, sensitivity: true.into(), adjoint: true, ..Options::with_tolerance(1e-8, 1e-10) }
}

/// The run in other units, and what it says in the old ones.
fn run(c: &Case, units: &Units, opt: &Options) -> (Run, Vec<f64>) {
    let times = |v: &[f64], s: &[f64]| v.iter().zip(s).map(|(v, s)| v * s).collect::<Vec<f64>>();
    let n = c.x0.len();
    let opt = Options { atol: units.x.iter().map(|s| opt.atol[0] * s).collect(), ..opt.clone() };
    let mut e = Engine::new(&scaled(&c.sys, units), &opt).unwrap();
    e.reinit(0.0, &times(&c.x0, &units.x)).unwrap();
    e.set_controls(&times(&c.u, &units.u)).unwrap();
    e.set_params(&times(&c.p, &units.p)).unwrap();
    e.advance(c.t_end * units.t).unwrap();
    // the gradient of the sum of the old states
    let v: Vec<f64> = units.x.iter().map(|s| 1.0 / s).collect();
    let gradient =
        e.adjoint(&v, &[]).map(|g| [times(&g.x0, &units.x), times(&g.p, &units.p), times(&g.u, &units.u)].concat());
    let mut r = e.into_run();
    r.t /= units.t;
    r.x.iter_mut().zip(&units.x).for_each(|(x, s)| *x /= s);
    r.switches.iter_mut().for_each(|s| s.t /= units.t);
    let columns = [&units.x[..], &units.p, &units.u].concat();
    for (k, s) in r.sensitivity.iter_mut().flatten().enumerate() {
        *s *= columns[k % columns.len()] / units.x[k / columns.len()];
    }
    assert_eq!(r.x.len(), n);
    (r, gradient.unwrap_or_default())
}

/// Numbers of the generator of Steele, Lea and Flood (2014) on `[0, 1)`.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
    /// `base` to an integer power between plus and minus `most`.
    fn power(&mut self, base: f64, most: i32) -> f64 {
        base.powi((self.next() * f64::from(2 * most + 1)) as i32 - most)
    }
}

fn modes(r: &Run) -> Vec<(usize, Vec<usize>, Vec<usize>)> {
    r.switches.iter().map(|s| (s.subsystem, s.before.clone(), s.after.clone())).collect()
}

/// Equal, NaN with NaN.
fn same(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a == b || a.is_nan() && b.is_nan())
}

#[test]
fn units_that_are_powers_of_two_change_no_bit() {
    let mut random = Random(7);
    for c in &cases() {
        for method in [Method::Auto, Method::Dp5, Method::Radau5] {
            let opt = options(method);
            let (base, gradient) = run(c, &Units::of(&c.sys, || 1.0), &opt);
            assert_eq!(base.outcome, Outcome::Reached, "{}: {}", c.name, base.reason);
            for kind in 0..8 {
                let mut factor = || random.power(2.0, 40);
                let units = if kind < 5 { Units::only(&c.sys, kind, factor) } else { Units::of(&c.sys, &mut factor) };
                let (r, g) = run(c, &units, &opt);
                let what = format!("{} {method:?} kind {kind}: {} {:?} {:?}", c.name, r.reason, r.stats, base.stats);
                assert_eq!(r.outcome, Outcome::Reached, "{what}");
                assert_eq!(modes(&r), modes(&base), "{what}");
                assert!(same(&r.x, &base.x), "{what}: {:?} {:?}", r.x, base.x);
                let times = |r: &Run| r.switches.iter().map(|s| s.t).collect::<Vec<f64>>();
                assert!(same(&times(&r), &times(&base)), "{what}: {:?} {:?}", times(&r), times(&base));
                assert_eq!(r.stats, base.stats, "{what}");
                assert!(same(&g, &gradient), "{what}: {g:?} {gradient:?}");
                assert!(same(&r.sensitivity.unwrap(), base.sensitivity.as_ref().unwrap()), "{what}");
            }
        }
    }
}

#[test]
fn units_that_are_powers_of_ten_change_the_rounding() {
    let mut random = Random(11);
    for c in &cases() {
        let opt = options(Method::Auto);
        let (base, _) = run(c, &Units::of(&c.sys, || 1.0), &opt);
        for kind in 0..12 {
            let mut factor = || random.power(10.0, 12);
            let units = if kind < 5 { Units::only(&c.sys, kind, factor) } else { Units::of(&c.sys, &mut factor) };
            let (r, _) = run(c, &units, &opt);
            let what = format!("{} kind {kind}: {}", c.name, r.reason);
            assert_eq!(r.outcome, Outcome::Reached, "{what}");
            // how many of infinitely many switches come before they are found to accumulate is rounding
            if base.stats.accumulations == 0 {
                assert_eq!(modes(&r), modes(&base), "{what}");
            }
            let off = r.x.iter().zip(&base.x).fold(0.0f64, |m, (a, b)| m.max((a - b).abs() / (1.0 + b.abs())));
            assert!(off <= 1e-9, "{what}: off by {off:e}");
        }
    }
}

#[test]
fn accumulating_switches_in_other_units() {
    let mut random = Random(13);
    let c = cases().into_iter().find(|c| c.name == "zeno_post").unwrap();
    let opt = Options { zeno: Zeno::TimeStepping, ..Options::with_tolerance(1e-8, 1e-10) };
    let run = |units: &Units| {
        let opt = Options { atol: units.x.iter().map(|s| opt.atol[0] * s).collect(), ..opt.clone() };
        let x0: Vec<f64> = c.x0.iter().zip(&units.x).map(|(x, s)| x * s).collect();
        let r = switchback::event::simulate(&scaled(&c.sys, units), &opt, 0.0, &x0, c.t_end * units.t).unwrap();
        let x: Vec<f64> = r.x.iter().zip(&units.x).map(|(x, s)| x / s).collect();
        (r.outcome, r.stats, x)
    };
    let base = run(&Units::of(&c.sys, || 1.0));
    assert_eq!(base.0, Outcome::Reached);
    for _ in 0..5 {
        assert_eq!(run(&Units::of(&c.sys, || random.power(2.0, 40))), base);
    }
}
