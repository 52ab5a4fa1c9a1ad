//! What is no work-precision diagram of the oscillator: a sliding phase beside IDAS, FESD beside the engine, dry friction
//! beside CVODE, batches on threads.

use std::ffi::{c_double, c_int, c_void};
use std::hint::black_box;
use std::time::Instant;

use serde_json::{json, Value};
use switchback::event::{simulate_batch, Engine, Options};
use switchback::func::Dims;
use switchback::nlp::Control;
use switchback::settings::Settings;
use switchback::sim::Simulator;
use switchback::system::System;

use crate::fast_oscillator::compiled;
use crate::models::{add_sides, affine, coulomb, smooth, OSCILLATOR_X0, OSCILLATOR_XT};
use crate::{cpu, T};

extern "C" {
    fn slide_create(tol: c_double) -> *mut c_void;
    fn slide_run(o: *mut c_void, x: *mut c_double, end: c_double) -> c_int;
    fn slide_free(o: *mut c_void);
    fn block_run(method: c_int, tol: c_double, x: *mut c_double, end: c_double) -> c_int;
}

/// Shortest CPU time of several batches of calls.
fn shortest(run: &mut dyn FnMut() -> Option<()>) -> Option<f64> {
    run()?;
    let clock = cpu();
    run()?;
    let calls = (2e-3 / (cpu() - clock).max(1e-7)).clamp(1.0, 200.0) as usize;
    let mut seconds = f64::INFINITY;
    for _ in 0..9 {
        let clock = cpu();
        for _ in 0..calls {
            run()?;
        }
        seconds = seconds.min((cpu() - clock) / calls as f64);
    }
    Some(seconds)
}

/// x' = 1 + y, y' = cos x ∓ 2 on either side of y = 0.3 sin x, which attracts.
fn valley() -> System {
    let d = Dims { x: 2, u: 0, p: 0 };
    let mut s = System::new(2, 0, 0).expect("two states");
    let f0 = smooth(
        "f0",
        d,
        2,
        |at, o| (o[0], o[1]) = (1.0 + at.x[1], at.x[0].cos()),
        &[(1, 0), (0, 1)],
        |at, o| (o[0], o[1]) = (-at.x[0].sin(), 1.0),
        &[(0, 0)],
        |at, w, o| o[0] = -w[1] * at.x[0].cos(),
    );
    s.set_f0(f0).expect("f0 fits");
    let psi = smooth(
        "psi",
        d,
        1,
        |at, o| o[0] = at.x[1] - 0.3 * at.x[0].sin(),
        &[(0, 0), (0, 1)],
        |at, o| (o[0], o[1]) = (-0.3 * at.x[0].cos(), 1.0),
        &[(0, 0)],
        |at, w, o| o[0] = 0.3 * w[0] * at.x[0].sin(),
    );
    add_sides(&mut s, &[1], affine("F", d, &[-2.0, 2.0], &[]), psi);
    s
}

const SLIDE_T: f64 = 10.0;

/// The position at the end of the sliding phase: x' = 1 + 0.3 sin x has an elementary solution.
fn slide_end() -> f64 {
    let (a, w) = (0.3, (1.0f64 - 0.09).sqrt());
    // tan(x / 2) = w tan(w t / 2 + c) - a, on the branch that is reached by whole turns
    let c = (a / w).atan();
    let phase = w * SLIDE_T / 2.0 + c;
    let turns = (phase / std::f64::consts::PI).round();
    2.0 * ((w * phase.tan() - a).atan() + turns * std::f64::consts::PI)
}

pub fn sliding() -> Value {
    let end = slide_end();
    let mut samples = Vec::new();
    for e in 8..=48 {
        let tol = 10f64.powf(-0.25 * f64::from(e));
        let options = Options::with_tolerance(tol, tol);
        let ours = Engine::new(&valley(), &options).ok().and_then(|mut engine| {
            let mut error = f64::NAN;
            let seconds = shortest(&mut || {
                engine.reinit(0.0, &[0.0, 0.0]).ok()?;
                engine.advance(SLIDE_T).ok()?;
                let x = engine.state();
                error = (x[0] - end).hypot(x[1] - 0.3 * end.sin());
                Some(())
            })?;
            Some(("switchback", tol, error, seconds))
        });
        samples.extend(ours);
        // SAFETY: NULL on failure; freed below, used by nobody else; `x` can be written.
        let o = unsafe { slide_create(tol) };
        if o.is_null() {
            continue;
        }
        let mut error = f64::NAN;
        let seconds = shortest(&mut || {
            let mut x = [0.0, 0.0];
            if unsafe { slide_run(o, x.as_mut_ptr(), SLIDE_T) } != 0 {
                return None;
            }
            error = (x[0] - end).hypot(x[1] - 0.3 * end.sin());
            black_box(x);
            Some(())
        });
        unsafe { slide_free(o) };
        samples.extend(seconds.map(|s| ("IDAS", tol, error, s)));
    }
    let cheapest = |name: &str, target: f64| {
        let good = samples.iter().filter(|s| s.0 == name && s.2 <= target);
        good.map(|s| s.3).fold(f64::INFINITY, f64::min) * 1e6
    };
    println!("\nsliding phase: microseconds to reach an error in the state at the end");
    println!("{:>8} {:>12} {:>12} {:>10}", "error", "switchback", "IDAS", "ours/IDAS");
    let mut rows = Vec::new();
    for target in [1e-4, 1e-6, 1e-8, 1e-10] {
        let (ours, idas) = (cheapest("switchback", target), cheapest("IDAS", target));
        println!("{target:>8.0e} {ours:>12.1} {idas:>12.1} {:>10.2}", ours / idas);
        rows.push(json!({ "error": target, "switchback_us": ours, "idas_us": idas, "ours_over_idas": ours / idas }));
    }
    let all: Vec<_> =
        samples.iter().map(|s| json!({ "method": s.0, "tol": s.1, "error": s.2, "us": s.3 * 1e6 })).collect();
    json!({ "to_reach": rows, "samples": all })
}

/// The oscillator by finite elements with switch detection, at the least work for this error.
pub fn beside_fesd() -> Value {
    let target = 1e-9;
    let system = compiled();
    let mut best: Option<(i64, usize, f64, f64, f64)> = None;
    for n_s in [3, 4, 5] {
        let settings = Settings { n_s, n_fe: 2, ..Settings::default() };
        let Ok(mut sim) = Simulator::new(&system, &settings) else { continue };
        for n_steps in [4, 6, 8, 12, 16, 24, 32, 48] {
            let (mut error, mut t_switch) = (f64::INFINITY, f64::NAN);
            let seconds = shortest(&mut || {
                sim.set_state(0.0, &OSCILLATOR_X0).ok()?;
                let r = sim.run(T, n_steps, &mut Control::default()).ok()?;
                let x = sim.state();
                t_switch = r.trajectory.switches.first().map_or(f64::NAN, |s| s.t);
                error = (x[0] - OSCILLATOR_XT[0]).hypot(x[1] - OSCILLATOR_XT[1]).max((t_switch - 1.0).abs());
                Some(())
            });
            if let Some(s) = seconds.filter(|s| error <= target && best.is_none_or(|b| *s < b.2)) {
                best = Some((n_s, n_steps, s, error, t_switch));
            }
        }
    }
    let mut ours = (f64::INFINITY, f64::NAN, f64::NAN);
    for e in 20..=52 {
        let tol = 10f64.powf(-0.25 * f64::from(e));
        let Ok(mut engine) = Engine::new(&system, &Options::with_tolerance(tol, tol)) else { continue };
        let (mut error, mut t_switch) = (f64::INFINITY, f64::NAN);
        let seconds = shortest(&mut || {
            engine.reinit(0.0, &OSCILLATOR_X0).ok()?;
            engine.advance(T).ok()?;
            let x = engine.state();
            t_switch = engine.switches().first().map_or(f64::NAN, |s| s.t);
            error = (x[0] - OSCILLATOR_XT[0]).hypot(x[1] - OSCILLATOR_XT[1]).max((t_switch - 1.0).abs());
            Some(())
        });
        if let Some(s) = seconds.filter(|s| error <= target && *s < ours.0) {
            ours = (s, error, t_switch);
        }
    }
    let Some((n_s, n_steps, seconds, error, t_switch)) = best else {
        println!("\nFESD did not reach {target:e}");
        return Value::Null;
    };
    println!(
        "\noscillator to {target:e}: engine {:.1} microseconds, FESD (n_s = {n_s}, {n_steps} steps) {:.1}: {:.0} times as \
         much; switching times differ by {:.1e}",
        ours.0 * 1e6,
        seconds * 1e6,
        seconds / ours.0,
        (t_switch - ours.2).abs()
    );
    json!({ "target": target, "engine_us": ours.0 * 1e6, "engine_error": ours.1, "fesd_us": seconds * 1e6,
        "fesd_error": error, "n_s": n_s, "n_steps": n_steps, "times": seconds / ours.0,
        "switch_difference": (t_switch - ours.2).abs() })
}

/// Dry friction: events found, of 13, and the error at the end.
pub fn friction() -> Value {
    let exact = [1.178_427_067_844_834_5, -0.259_736_449_971_157_8];
    let mut rows = Vec::new();
    println!("\ndry friction, T = 40, 13 switches: switches found and error at the end");
    println!("{:>8} {:>16} {:>16} {:>16}", "rtol", "switchback", "CVODE Adams", "CVODE BDF");
    for e in 4..=12 {
        let tol = 10f64.powi(-e);
        let mut engine = Engine::new(&coulomb(), &Options::with_tolerance(tol, tol)).expect("a system with dynamics");
        engine.reinit(0.0, &[1.0, 0.2]).expect("numbers");
        engine.advance(40.0).expect("no function asks to stop");
        let distance = |x: &[f64]| (x[0] - exact[0]).hypot(x[1] - exact[1]);
        let mut cells = vec![("switchback", engine.switches().len() as i64, distance(engine.state()))];
        for (name, method) in [("CVODE Adams", 0), ("CVODE BDF", 1)] {
            let mut x = [1.0, 0.2];
            // SAFETY: `x` can be written.
            let found = unsafe { block_run(method, tol, x.as_mut_ptr(), 40.0) };
            cells.push((name, i64::from(found), distance(&x)));
        }
        print!("{tol:>8.0e}");
        for c in &cells {
            print!(" {:>5} {:>10.1e}", c.1, c.2);
        }
        println!();
        let found: Vec<_> = cells.iter().map(|c| json!({ "method": c.0, "switches": c.1, "error": c.2 })).collect();
        rows.push(json!({ "rtol": tol, "found": found }));
    }
    json!(rows)
}

/// Wall time of a batch on one and two threads; the results are compared bit by bit.
pub fn batches() -> Value {
    let starts: Vec<Vec<f64>> = (0..4000).map(|i| vec![0.05 + 1e-4 * f64::from(i), 0.1]).collect();
    let options = Options::with_tolerance(1e-9, 1e-9);
    let system = compiled();
    let mut rows = Vec::new();
    let mut first: Option<Vec<Vec<f64>>> = None;
    println!("\nbatch of {} runs of the oscillator over T = 3: seconds (wall)", starts.len());
    for threads in [1, 2] {
        let mut seconds = f64::INFINITY;
        let mut ends = Vec::new();
        for _ in 0..5 {
            let clock = Instant::now();
            let runs = simulate_batch(&system, &options, 0.0, &starts, &[], 3.0, threads).expect("sizes fit");
            seconds = seconds.min(clock.elapsed().as_secs_f64());
            ends = runs.into_iter().map(|r| r.x).collect();
        }
        let same = *first.get_or_insert_with(|| ends.clone()) == ends;
        println!("{threads} thread(s): {seconds:.4}, results {}", if same { "identical" } else { "DIFFERENT" });
        rows.push(json!({ "threads": threads, "seconds": seconds, "identical": same }));
    }
    json!(rows)
}
