//! The event-driven engine: every reference problem over all tolerances, and work against precision on the
//! oscillator (4.4) beside a special case written by hand.

use super::short;
use crate::json::{Object, Table};
use crate::models::*;
use crate::reference::{self, Reference};
use crate::Context;
use std::sync::Arc;
use std::time::Instant;
use switchback::event::{pairs::dop853, Engine, Kind, Method, Options, Outcome, Run};
use switchback::func::{Dims, EvalResult, Function, Point};
use switchback::linalg::csc::Pattern;
use switchback::settings::{Discretisation, RkFamily};
use switchback::system::{Regions, Subsystem, System};

/// The models of the references, with their controls.
pub fn problems() -> Vec<(&'static str, System, Vec<f64>)> {
    vec![
        ("crossing", switching('a'), vec![]),
        ("sliding", switching('b'), vec![]),
        ("leaving", switching('c'), vec![]),
        ("oscillator", oscillator(), vec![]),
        ("codim2", sliding_mode(), vec![-0.5, -0.4]),
        ("blocks", blocks(), vec![]),
        ("coulomb", coulomb(), vec![]),
        ("stickslip1", stick_slip(), vec![]),
        ("zeno_T0999", zeno(), vec![]),
        ("zeno_post", zeno(), vec![]),
    ]
}

/// Name of a switch in the references.
fn name(k: Kind, subsystem: usize) -> String {
    let name = match k {
        Kind::Cross => "cross",
        Kind::Enter => "enter_sliding",
        Kind::Leave => "leave_sliding",
        Kind::Spontaneous => "spontaneous",
    };
    format!("{name}[{subsystem}]")
}

/// Largest difference relative to the largest value, at least 1.
fn off(found: &[f64], exact: &[f64]) -> f64 {
    if found.len() != exact.len() {
        return f64::INFINITY;
    }
    let size = exact.iter().fold(1.0f64, |m, v| m.max(v.abs()));
    found.iter().zip(exact).fold(0.0f64, |m, (a, b)| m.max((a - b).abs())) / size
}

fn simulate(sys: &System, u: &[f64], x0: &[f64], t: f64, opt: &Options) -> (Run, f64) {
    let mut best = f64::INFINITY;
    let mut e = Engine::new(sys, opt).expect("the options fit");
    for _ in 0..5 {
        let clock = Instant::now();
        e.reinit(0.0, x0).expect("the state fits");
        e.set_controls(u).expect("the controls fit");
        e.advance(t).expect("no function asks to stop");
        best = best.min(clock.elapsed().as_secs_f64());
    }
    (e.into_run(), best)
}

fn accuracy(c: &Context) {
    let head =
        ["problem", "rtol", "error/rtol", "switch/rtol", "found", "dx error", "dt error", "us", "steps", "rejected"];
    let mut table = Table::new(&[&head[..], &["relocated", "evaluations", "outcome", ""]].concat());
    for (problem, sys, u) in problems() {
        let Some(r) = reference::load(problem) else {
            c.say(&format!("{problem}: no reference at hand"));
            continue;
        };
        for e in 4..=12 {
            let rtol = 10f64.powi(-e);
            let opt = Options::with_tolerance(rtol, rtol);
            let (s, seconds) = simulate(&sys, &u, &r.x0, r.t_end, &opt);
            let with = Options { sensitivity: true, ..opt };
            let (d, _) = simulate(&sys, &u, &r.x0, r.t_end, &with);
            let error = off(&s.x, &r.x_end);
            let times: Vec<f64> = s.switches.iter().map(|s| s.t).collect();
            let exact: Vec<f64> = r.switches.iter().map(|s| s.0).collect();
            // beyond an accumulation the switches are not numbered
            let listed = !exact.is_empty();
            let switch = if listed { off(&times, &exact) } else { 0.0 };
            let kinds = s.switches.iter().map(|s| name(s.kind, s.subsystem));
            let found = !listed || kinds.eq(r.switches.iter().map(|s| s.1.clone()));
            let (dx, dt) = derivatives(&d, &r);
            let ok = s.outcome == Outcome::Reached && found && error.max(switch) <= 100.0 * rtol;
            table.row(vec![
                problem.into(),
                format!("{rtol:e}"),
                short(error / rtol),
                short(switch / rtol),
                format!("{}/{}", s.switches.len(), r.switches.len()),
                short(dx),
                short(dt),
                format!("{:.1}", seconds * 1e6),
                s.stats.steps.to_string(),
                s.stats.rejections.to_string(),
                s.stats.relocations.to_string(),
                s.stats.evaluations.to_string(),
                s.outcome.name().into(),
                if ok { "ok" } else { "MISSED" }.into(),
            ]);
            let o = Object::new().text("case", "sim").text("record", "accuracy").text("problem", problem);
            let o = o.num("rtol", rtol).num("error", error).num("switch_error", switch).flag("all_switches", found);
            let o = o.num("sensitivity_error", dx).num("switch_sensitivity_error", dt).num("seconds", seconds);
            let o = o.int("switches", s.switches.len()).int("steps", s.stats.steps).int("rejected", s.stats.rejections);
            let o = o.int("evaluations", s.stats.evaluations).int("newton", s.stats.newton).flag("ok", ok);
            c.record(&o.text("outcome", s.outcome.name()));
        }
    }
    c.say("reference problems, errors relative to the tolerance");
    c.say(&table.text());
}

/// Errors of the derivatives of the final state and of the switching times.
fn derivatives(s: &Run, r: &Reference) -> (f64, f64) {
    let exact: Vec<f64> = r.sensitivity.concat();
    let dx = s.sensitivity.as_ref().map_or(f64::NAN, |d| off(d, &exact));
    let each = s.switches.iter().zip(&r.switches).map(|(s, r)| off(&s.dt, &r.2));
    (dx, each.fold(0.0, f64::max))
}

const W: f64 = 2.0 * PI;

/// The modes of the oscillator as compiled code, one alone where only one is asked for.
struct Modes {
    jac: Pattern,
    hess: Pattern,
}

/// Its switching function.
struct Surface {
    jac: Pattern,
    hess: Pattern,
}

const D2: Dims = Dims { x: 2, u: 0, p: 0 };

impl Function for Modes {
    fn name(&self) -> &str {
        "F"
    }
    fn dims(&self) -> Dims {
        D2
    }
    fn n_out(&self) -> usize {
        4
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn work_len(&self) -> usize {
        0
    }
    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.value_rows(at, 0..2, out, work)?;
        self.value_rows(at, 2..4, out, work)
    }
    fn value_rows(&self, at: &Point, rows: std::ops::Range<usize>, out: &mut [f64], _: &mut [f64]) -> EvalResult {
        let w = if rows.start == 0 { -W } else { W };
        out[rows.start] = at.x[0] + w * at.x[1];
        out[rows.start + 1] = at.x[1] - w * at.x[0];
        Ok(())
    }
    fn jacobian(&self, _: &Point, out: &mut [f64], _: &mut [f64]) -> EvalResult {
        out.copy_from_slice(&[1.0, W, 1.0, -W, -W, 1.0, W, 1.0]);
        Ok(())
    }
    fn hessian(&self, _: &Point, _: &[f64], _: &mut [f64], _: &mut [f64]) -> EvalResult {
        Ok(())
    }
}

impl Function for Surface {
    fn name(&self) -> &str {
        "psi"
    }
    fn dims(&self) -> Dims {
        D2
    }
    fn n_out(&self) -> usize {
        1
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn work_len(&self) -> usize {
        0
    }
    fn value(&self, at: &Point, out: &mut [f64], _: &mut [f64]) -> EvalResult {
        out[0] = at.x[0] * at.x[0] + at.x[1] * at.x[1] - 1.0;
        Ok(())
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], _: &mut [f64]) -> EvalResult {
        out[0] = 2.0 * at.x[0];
        out[1] = 2.0 * at.x[1];
        Ok(())
    }
    fn hessian(&self, _: &Point, weights: &[f64], out: &mut [f64], _: &mut [f64]) -> EvalResult {
        out.fill(2.0 * weights[0]);
        Ok(())
    }
}

fn compiled_oscillator() -> System {
    let dense: Vec<(usize, usize)> = (0..2).flat_map(|j| (0..4).map(move |i| (i, j))).collect();
    let modes = Modes { jac: pattern(4, 3, &dense), hess: Pattern::empty(3, 3) };
    let psi = Surface { jac: pattern(1, 3, &[(0, 0), (0, 1)]), hess: pattern(3, 3, &[(0, 0), (1, 1)]) };
    let mut s = System::new(2, 0, 0).expect("two states");
    let regions = Regions::Signs { psi: Arc::new(psi), signs: vec![1, -1] };
    s.add_subsystem(Subsystem { rows: vec![0, 1], modes: Arc::new(modes), n_modes: 2, regions }).expect("it fits");
    s
}

/// DOP853 with this one event, for this one system: what a careful person writes. State at the end, switching time.
fn by_hand(rtol: f64, x0: [f64; 2], t_end: f64) -> ([f64; 2], f64) {
    let mut w = W;
    let f = |w: f64, x: [f64; 2]| [x[0] + w * x[1], x[1] - w * x[0]];
    let psi = |x: [f64; 2]| x[0] * x[0] + x[1] * x[1] - 1.0;
    let (mut t, mut x, mut h, mut switched) = (0.0, x0, 0.01f64, f64::NAN);
    let mut k = [[0.0; 2]; 16];
    k[0] = f(w, x);
    fn sum<const M: usize>(k: &[[f64; 2]; 16], row: &[(usize, f64); M]) -> [f64; 2] {
        let mut s = [0.0; 2];
        for &(j, a) in row {
            s[0] += a * k[j][0];
            s[1] += a * k[j][1];
        }
        s
    }
    let at = |x: [f64; 2], h: f64, s: [f64; 2]| [x[0] + h * s[0], x[1] + h * s[1]];
    while t < t_end {
        h = h.min(t_end - t);
        macro_rules! stage {
            ($i:expr, $row:expr) => {
                k[$i] = f(w, at(x, h, sum(&k, &$row)))
            };
        }
        stage!(1, dop853::A1);
        stage!(2, dop853::A2);
        stage!(3, dop853::A3);
        stage!(4, dop853::A4);
        stage!(5, dop853::A5);
        stage!(6, dop853::A6);
        stage!(7, dop853::A7);
        stage!(8, dop853::A8);
        stage!(9, dop853::A9);
        stage!(10, dop853::A10);
        stage!(11, dop853::A11);
        let y = at(x, h, sum(&k, &dop853::A12));
        let (e5, e3) = (sum(&k, &dop853::E5), sum(&k, &dop853::E3));
        let (mut s5, mut s3) = (0.0, 0.0);
        for i in 0..2 {
            let scale = rtol + rtol * x[i].abs().max(y[i].abs());
            s5 += (e5[i] / scale).powi(2);
            s3 += (e3[i] / scale).powi(2);
        }
        let err = h * s5 / (2.0 * (s5 + 0.01 * s3)).sqrt().max(f64::MIN_POSITIVE);
        let factor = (0.9 * err.max(1e-10).powf(-0.125)).clamp(0.333, 6.0);
        if err > 1.0 {
            h *= factor.min(1.0);
            continue;
        }
        k[12] = f(w, y);
        if switched.is_nan() && psi(y) >= 0.0 {
            stage!(13, dop853::A13);
            stage!(14, dop853::A14);
            stage!(15, dop853::A15);
            let rows = [sum(&k, &dop853::D0), sum(&k, &dop853::D1), sum(&k, &dop853::D2), sum(&k, &dop853::D3)];
            let dense = |s: f64| {
                let mut out = [0.0; 2];
                for i in 0..2 {
                    let d = y[i] - x[i];
                    let c = [d, h * k[0][i] - d, 2.0 * d - h * (k[0][i] + k[12][i])];
                    let mut v = 0.0;
                    for (m, r) in rows.iter().enumerate().rev() {
                        v = (v + h * r[i]) * if m % 2 == 1 { s } else { 1.0 - s };
                    }
                    out[i] = x[i] + s * (c[0] + (1.0 - s) * (c[1] + s * (c[2] + v)));
                }
                out
            };
            let (mut lo, mut hi) = (0.0, 1.0);
            let (mut p_lo, mut p_hi) = (psi(x), psi(y));
            for _ in 0..60 {
                let s = lo - p_lo * (hi - lo) / (p_hi - p_lo);
                let p = psi(dense(s));
                if p < 0.0 {
                    (lo, p_lo, p_hi) = (s, p, 0.5 * p_hi);
                } else {
                    (hi, p_hi, p_lo) = (s, p, 0.5 * p_lo);
                }
                if p.abs() < 1e-15 || hi - lo < 1e-16 {
                    lo = s;
                    break;
                }
            }
            switched = t + lo * h;
            x = dense(lo);
            t = switched;
            w = -w;
            k[0] = f(w, x);
            continue;
        }
        t += h;
        x = y;
        k[0] = k[12];
        h *= factor;
    }
    (x, switched)
}

/// Shortest time of one call in seconds, from batches long enough to be measured.
fn best_of(mut run: impl FnMut()) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..15 {
        let n = 40;
        let clock = Instant::now();
        for _ in 0..n {
            run();
        }
        best = best.min(clock.elapsed().as_secs_f64() / f64::from(n));
    }
    best
}

fn work_precision(c: &Context) {
    let sys = compiled_oscillator();
    let t_end = PI / 2.0;
    // error of state and switching time, seconds, method
    let mut points: Vec<(&str, f64, f64, f64)> = Vec::new();
    for e in 8..=56 {
        let rtol = 10f64.powf(-0.25 * f64::from(e));
        for (name, method) in [("dp5", Method::Dp5), ("dop853", Method::Dop853), ("radau5", Method::Radau5)] {
            if (method != Method::Dop853 && rtol < 1e-11) || (method == Method::Radau5 && e % 4 > 0) {
                continue;
            }
            let opt = Options { method, ..Options::with_tolerance(rtol, rtol) };
            let mut engine = Engine::new(&sys, &opt).expect("the options fit");
            let mut run = || {
                engine.reinit(0.0, &OSCILLATOR_X0).expect("the state fits");
                engine.advance(t_end).expect("no function asks to stop");
            };
            run();
            let seconds = best_of(&mut run);
            let error = super::distance(engine.state(), &OSCILLATOR_XT);
            let switch = engine.switches().first().map_or(f64::INFINITY, |s| (s.t - 1.0).abs());
            points.push((name, error.max(switch), seconds, rtol));
        }
        let seconds = best_of(|| {
            std::hint::black_box(by_hand(rtol, std::hint::black_box(OSCILLATOR_X0), t_end));
        });
        let (x, t) = by_hand(rtol, OSCILLATOR_X0, t_end);
        let error = super::distance(&x, &OSCILLATOR_XT).max((t - 1.0).abs());
        points.push(("by hand", error, seconds, rtol));
    }
    for (method, error, seconds, rtol) in &points {
        let o = Object::new().text("case", "sim").text("record", "work").text("method", method);
        c.record(&o.num("rtol", *rtol).num("error", *error).num("seconds", *seconds));
    }
    let mut table = Table::new(&["method", "us to 1e-7", "1e-9", "1e-11"]);
    for method in ["dop853", "dp5", "radau5", "by hand"] {
        let cheapest = |target: f64| {
            let good = points.iter().filter(|p| p.0 == method && p.1 <= target);
            good.map(|p| p.2).fold(f64::INFINITY, f64::min) * 1e6
        };
        let us = [1e-7, 1e-9, 1e-11].map(cheapest);
        table.row(vec![method.into(), format!("{:.1}", us[0]), format!("{:.1}", us[1]), format!("{:.1}", us[2])]);
        let o = Object::new().text("case", "sim").text("record", "to-reach").text("method", method);
        c.record(&o.num("us_1e-7", us[0]).num("us_1e-9", us[1]).num("us_1e-11", us[2]));
    }
    c.say("oscillator (4.4), compiled functions: microseconds to reach an error in the state at T and in the switch");
    c.say(&table.text());
}

/// The same problems by finite elements with switch detection, with as many steps as they need for 1e-9 or so.
fn against_fesd(c: &Context) {
    let mut table = Table::new(&["problem", "FESD error", "ms", "event error", "ms", "ratio", "switches apart"]);
    let cases: [(&str, System, Vec<f64>, f64, usize); 3] = [
        ("coulomb", coulomb(), vec![1.0, 0.2], 40.0, 200),
        ("blocks", blocks(), vec![-1.0, 1.0, -1.0, -1.0, 1.0, 1.0], 12.0, 60),
        ("stickslip1", stick_slip(), vec![-0.8, -1.0], 40.0, 250),
    ];
    for (problem, sys, x0, t_end, n) in cases {
        let Some(r) = reference::load(problem) else { continue };
        let set = super::settings(RkFamily::RadauIia, 4, 3, Discretisation::Fesd);
        let (fesd, x, fesd_s) = super::simulate(&sys, &set, &x0, t_end, n);
        let (s, event_s) = simulate(&sys, &[], &x0, t_end, &Options::with_tolerance(1e-11, 1e-11));
        let (a, b) = (off(&x, &r.x_end), off(&s.x, &r.x_end));
        let times: Vec<f64> = s.switches.iter().map(|s| s.t).collect();
        let others: Vec<f64> = fesd.trajectory.switches.iter().map(|s| s.t).collect();
        let apart = off(&times, &others);
        table.row(vec![
            problem.into(),
            short(a),
            format!("{:.2}", fesd_s * 1e3),
            short(b),
            format!("{:.3}", event_s * 1e3),
            format!("{:.0}", fesd_s / event_s),
            short(apart),
        ]);
        let o = Object::new().text("case", "sim").text("record", "against-fesd").text("problem", problem);
        let o = o.num("fesd_error", a).num("fesd_seconds", fesd_s).num("error", b).num("seconds", event_s);
        c.record(&o.num("switches_apart", apart));
    }
    c.say("beside finite elements with switch detection (Radau IIA with four stages)");
    c.say(&table.text());
}

pub fn run(c: &Context) {
    accuracy(c);
    against_fesd(c);
    work_precision(c);
}
