//! Work against precision on the oscillator (4.4): the event-driven engine beside SUNDIALS CVODE (Adams, BDF) and ARKODE
//! (ERKStep), diffsol's `tsit45`, and DOP853 with its one event by hand. Compiled right-hand sides, one run, thread CPU
//! time, memory and problems prepared beforehand where the interface allows it. Then a sliding phase beside IDAS, FESD beside
//! the engine, dry friction beside CVODE, batches on threads.
//!
//! `cargo run --release -- [--json FILE] [--plot DIR]`

#[path = "../../../examples/report/fast_oscillator.rs"]
#[allow(dead_code)]
mod fast_oscillator;
#[path = "../../../examples/report/models.rs"]
#[allow(dead_code)]
mod models;
mod others;
#[path = "../../../examples/report/svg.rs"]
#[allow(dead_code)]
mod svg;

use std::cell::Cell;
use std::ffi::{c_double, c_int, c_void};
use std::hint::black_box;

use diffsol::{NalgebraMat, OdeBuilder, OdeSolverMethod, OdeSolverStopReason, VectorHost};
use serde_json::json;
use switchback::event::{Engine, Method, Options};

use fast_oscillator::{by_hand, compiled, W};
use models::{OSCILLATOR_X0, OSCILLATOR_XT, PI};

const T: f64 = PI / 2.0;
/// Accuracies of the state at the end and of the switching time that are asked for.
const TARGETS: [f64; 3] = [1e-7, 1e-9, 1e-11];

extern "C" {
    fn oscillator_create(method: c_int, tol: c_double, omega: c_double) -> *mut c_void;
    fn oscillator_run(o: *mut c_void, x: *mut c_double, end: c_double, t_switch: *mut c_double) -> c_int;
    fn oscillator_free(o: *mut c_void);
}

/// One run: the state at the end, the switching time.
type Answer = ([f64; 2], f64);

struct Sample {
    method: &'static str,
    tol: f64,
    error: f64,
    seconds: f64,
}

/// CPU time of this thread in seconds.
fn cpu() -> f64 {
    let mut t = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `t` can be written.
    unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &mut t) };
    t.tv_sec as f64 + 1e-9 * t.tv_nsec as f64
}

/// Shortest of several batches.
fn measure(method: &'static str, tol: f64, run: &mut dyn FnMut() -> Option<Answer>) -> Option<Sample> {
    let (x, t_switch) = run()?;
    let distance = (x[0] - OSCILLATOR_XT[0]).hypot(x[1] - OSCILLATOR_XT[1]);
    let clock = cpu();
    run()?;
    let calls = (2e-3 / (cpu() - clock).max(1e-7)).clamp(1.0, 200.0) as usize;
    let mut seconds = f64::INFINITY;
    for _ in 0..9 {
        let clock = cpu();
        for _ in 0..calls {
            black_box(run()?);
        }
        seconds = seconds.min((cpu() - clock) / calls as f64);
    }
    let error = distance.max((t_switch - 1.0).abs());
    Some(Sample { method, tol, error: if error.is_nan() { f64::INFINITY } else { error }, seconds })
}

fn switchback(name: &'static str, method: Method, tol: f64) -> Option<Sample> {
    let options = Options { method, ..Options::with_tolerance(tol, tol) };
    let mut engine = Engine::new(&compiled(), &options).ok()?;
    measure(name, tol, &mut || {
        engine.reinit(0.0, &OSCILLATOR_X0).ok()?;
        engine.advance(T).ok()?;
        let t = engine.switches().first().map_or(f64::NAN, |s| s.t);
        Some(([engine.state()[0], engine.state()[1]], t))
    })
}

fn sundials(name: &'static str, method: c_int, tol: f64) -> Option<Sample> {
    // SAFETY: NULL on failure; freed below, used by nobody else.
    let o = unsafe { oscillator_create(method, tol, W) };
    if o.is_null() {
        return None;
    }
    let sample = measure(name, tol, &mut || {
        let (mut x, mut t) = (OSCILLATOR_X0, f64::NAN);
        // SAFETY: `o` is alive, `x` and `t` can be written.
        let code = unsafe { oscillator_run(o, x.as_mut_ptr(), T, &mut t) };
        (code == 0).then_some((x, t))
    });
    // SAFETY: made above.
    unsafe { oscillator_free(o) };
    sample
}

fn diffsol(tol: f64) -> Option<Sample> {
    let w = Cell::new(W);
    let rhs =
        |x: &diffsol::NalgebraVec<f64>, _: &diffsol::NalgebraVec<f64>, _: f64, y: &mut diffsol::NalgebraVec<f64>| {
            let (x, y) = (x.as_slice(), y.as_mut_slice());
            (y[0], y[1]) = (x[0] + w.get() * x[1], x[1] - w.get() * x[0]);
        };
    let problem = OdeBuilder::<NalgebraMat<f64>>::new()
        .rtol(tol)
        .atol([tol])
        .rhs(rhs)
        .init(|_, _, y| y.as_mut_slice().copy_from_slice(&OSCILLATOR_X0), 2)
        .root(
            |x, _, _, y| {
                let x = x.as_slice();
                y.as_mut_slice()[0] = x[0] * x[0] + x[1] * x[1] - 1.0;
            },
            1,
        )
        .build()
        .ok()?;
    measure("diffsol tsit45", tol, &mut || {
        w.set(W);
        let mut solver = problem.tsit45().ok()?;
        solver.set_stop_time(T).ok()?;
        let mut t_switch = f64::NAN;
        loop {
            match solver.step().ok()? {
                OdeSolverStopReason::TstopReached => break,
                OdeSolverStopReason::InternalTimestep => {}
                OdeSolverStopReason::RootFound(t, _) => {
                    t_switch = t;
                    solver.state_mut_back(t).ok()?;
                    w.set(-W);
                    let state = solver.state_mut();
                    let x = [state.y.as_slice()[0], state.y.as_slice()[1]];
                    state.dy.as_mut_slice().copy_from_slice(&[x[0] - W * x[1], x[1] + W * x[0]]);
                    solver.set_stop_time(T).ok()?;
                }
            }
        }
        let x = solver.state().y.as_slice();
        Some(([x[0], x[1]], t_switch))
    })
}

fn hand_written(tol: f64) -> Option<Sample> {
    measure("DOP853 by hand", tol, &mut || Some(by_hand(tol, black_box(OSCILLATOR_X0), T)))
}

fn main() {
    let (mut file, mut plots) = (None, None);
    let mut args = std::env::args().skip(1);
    while let Some(a) = args.next() {
        match a.as_str() {
            "--json" => file = args.next(),
            "--plot" => plots = args.next(),
            _ => {
                eprintln!("unknown argument {a}\nusage: peers [--json FILE] [--plot DIR]");
                std::process::exit(2)
            }
        }
    }
    let mut samples = Vec::new();
    // tolerances in turn, so that no method has the quiet part of the run for itself
    for e in 6..=56 {
        let tol = 10f64.powf(-0.25 * f64::from(e));
        samples.extend(hand_written(tol));
        samples.extend(switchback("switchback dop853", Method::Dop853, tol));
        if tol > 1e-11 {
            samples.extend(switchback("switchback dp5", Method::Dp5, tol));
        }
        if tol > 1e-14 {
            samples.extend(diffsol(tol));
        }
        for (name, method) in [("CVODE Adams", 0), ("CVODE BDF", 1), ("ARKODE 5(4)", 2), ("ARKODE 8(7)", 3)] {
            samples.extend(sundials(name, method, tol));
        }
    }
    let mut names: Vec<&str> = Vec::new();
    for s in &samples {
        if !names.contains(&s.method) {
            names.push(s.method);
        }
    }
    let cheapest = |names: &[&str], target: f64| {
        let good = samples.iter().filter(|s| names.contains(&s.method) && s.error <= target);
        good.map(|s| s.seconds).fold(f64::INFINITY, f64::min) * 1e6
    };
    let ours = ["switchback dop853", "switchback dp5"];
    println!(
        "oscillator (4.4): microseconds of CPU time to reach an error in the state at T and in the switching time"
    );
    println!("{:20} {:>9} {:>9} {:>9}   times ours", "", "1e-7", "1e-9", "1e-11");
    let mut rows = Vec::new();
    for name in &names {
        let us = TARGETS.map(|t| cheapest(&[name], t));
        let ratios: Vec<f64> = TARGETS.iter().zip(us).map(|(&t, us)| us / cheapest(&ours, t)).collect();
        let cell = |v: f64| if v.is_finite() { format!("{v:.2}") } else { "-".into() };
        println!(
            "{name:20} {:>9} {:>9} {:>9}   {:>6} {:>6} {:>6}",
            cell(us[0]),
            cell(us[1]),
            cell(us[2]),
            cell(ratios[0]),
            cell(ratios[1]),
            cell(ratios[2])
        );
        rows.push(json!({ "method": name, "us": us, "times_ours": ratios }));
    }
    let sliding = others::sliding();
    let fesd = others::beside_fesd();
    let friction = others::friction();
    let batches = others::batches();
    if let Some(file) = file {
        let list: Vec<_> = samples
            .iter()
            .map(|s| json!({ "method": s.method, "tol": s.tol, "error": s.error, "us": s.seconds * 1e6 }))
            .collect();
        let all = json!({ "targets": TARGETS, "to_reach": rows, "samples": list, "sliding": sliding, "fesd": fesd,
            "friction": friction, "batches": batches });
        if let Err(e) = std::fs::write(&file, format!("{all:#}\n")) {
            eprintln!("cannot write {file}: {e}");
        }
    }
    if let Some(dir) = plots {
        let mut plot = svg::Plot::new("Oscillator (4.4) through its switch", "microseconds", "error").log_log();
        for (k, name) in names.iter().enumerate() {
            let good = samples.iter().filter(|s| s.method == *name && s.error.is_finite() && s.error > 0.0);
            let points = good.map(|s| (s.seconds * 1e6, s.error)).collect();
            plot.add_coloured(name, svg::Mark::LineDots, k, points);
        }
        let file = std::path::Path::new(&dir).join("simulation-peers.svg");
        if let Err(e) = std::fs::create_dir_all(&dir).and_then(|()| std::fs::write(file, plot.svg())) {
            eprintln!("cannot write the plot: {e}");
        }
    }
}
