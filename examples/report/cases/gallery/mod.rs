//! Problems from the literature, each from its default start: how it ended, what the answer is, what is left of the
//! residuals, how far a simulation of the controls ends from the solution, and where the time went.

#[path = "../../../../tests/common/optimal/mod.rs"]
mod optimal;
mod simulations;

use super::short;
use crate::json::{Object, Table};
use crate::svg::{stacked, Mark, Plot};
use crate::Context;
use optimal::{all, Problem};
use std::time::{Duration, Instant};
use switchback::error::Result;
use switchback::nlp::{Control, IterationInfo};
use switchback::ocp::{Ocp, OcpResult};

/// Seconds of a solve by what it did.
#[derive(Default)]
struct Phases {
    homotopy: f64,
    polish: f64,
    /// Certificate, reading the answer, its simulation.
    after: f64,
    total: f64,
}

/// Solves; the time between two iterations counts for the phase of the later one.
fn solve(ocp: &mut Ocp) -> Result<(OcpResult, Phases)> {
    let start = Instant::now();
    let mut last = start;
    let (mut homotopy, mut polish) = (Duration::ZERO, Duration::ZERO);
    let mut monitor = |i: &IterationInfo| {
        let now = Instant::now();
        *(if i.phase == b'p' { &mut polish } else { &mut homotopy }) += now - last;
        last = now;
        true
    };
    let r = ocp.solve(&mut Control { monitor: Some(&mut monitor), ..Control::default() })?.clone();
    let (after, total) = (last.elapsed().as_secs_f64(), start.elapsed().as_secs_f64());
    let homotopy = homotopy.as_secs_f64() - r.time_build;
    Ok((r, Phases { homotopy, polish: polish.as_secs_f64(), after, total }))
}

/// The problems and their names.
pub(super) fn named() -> impl Iterator<Item = (&'static str, Ocp)> {
    all().map(|p| (p.name, p.ocp))
}

pub fn run(c: &Context) {
    let columns =
        ["problem", "cost", "outcome", "polish", "type", "B", "primal", "dual", "pairs", "E(T)", "cost error"];
    let times = ["ms", "build", "homotopy", "polish", "after", "eval", "la", "it", "switches"];
    let mut table = Table::new(&[&columns[..], &times].concat());
    let mut periods = Table::new(&["cycle", "period", "by shooting", "difference"]);
    let mut seen = String::new();
    let clock = Instant::now();
    for mut p in all() {
        let (r, spent) = solve(&mut p.ocp).expect("the problem is well posed");
        let nan = (f64::NAN, f64::NAN);
        let (error, cost_error) = r.accuracy.as_ref().map_or(nan, |a| (a.terminal, a.cost_error));
        let polish = format!("{:?}", r.polish).to_lowercase();
        let residuals = [r.residuals.primal, r.residuals.dual, r.residuals.pair_min];
        let certificate = &r.certificate;
        let horizon = r.durations.iter().sum::<f64>();
        let o = Object::new().text("case", "gallery").text("problem", p.name).num("cost", r.cost);
        let o = o.text("outcome", r.outcome.name()).text("polish", &polish);
        let o = o.text("stationarity", certificate.stationarity.name()).text("b_stationary", certificate.b.name());
        let o = o.list("residuals", &residuals).num("error", error).num("cost_error", cost_error);
        let o = o.num("horizon", horizon).num("horizon_by_shooting", p.horizon.unwrap_or(f64::NAN));
        let o = o.num("wall_s", spent.total).num("build_s", r.time_build).num("homotopy_s", spent.homotopy);
        let o = o.num("polish_s", spent.polish).num("after_s", spent.after);
        let o = o.num("eval_s", r.stats.time_eval).num("linalg_s", r.stats.time_linalg);
        c.record(&o.int("iterations", r.stats.iterations).int("switches", r.trajectory.switches.len()));
        let mut row = vec![p.name.into(), format!("{:.8}", r.cost), r.outcome.name().into(), polish];
        row.extend([certificate.stationarity.name().into(), certificate.b.name().into()]);
        row.extend(residuals.iter().chain(&[error, cost_error]).map(|v| short(*v)));
        let phases = [spent.total, r.time_build, spent.homotopy, spent.polish, spent.after];
        let parts = [r.stats.time_eval, r.stats.time_linalg];
        row.extend(phases.iter().chain(&parts).map(|s| format!("{:.0}", 1e3 * s)));
        row.extend([r.stats.iterations.to_string(), r.trajectory.switches.len().to_string()]);
        table.row(row);
        if let Some(t) = p.horizon {
            let difference = short(horizon - t);
            periods.row(vec![p.name.into(), format!("{horizon:.10}"), format!("{t:.10}"), difference]);
        }
        seen.push_str(&format!("{}: {}\n", p.name, p.see));
        plot(c, &p, &r);
    }
    let seconds = clock.elapsed().as_secs_f64();
    c.say(&table.text());
    c.say(&seen);
    c.say(&periods.text());
    c.say(&format!("all problems: {seconds:.1} s"));
    simulations::run(c);
}

/// States above, controls below.
fn plot(c: &Context, p: &Problem, r: &OcpResult) {
    const POINTS: i32 = 240;
    let times = r.trajectory.times();
    let (from, to) = (times[0], times[times.len() - 1]);
    let mut states = Plot::new(&format!("{}: {}", p.name, p.see), p.time, "states");
    let mut x = vec![0.0; r.trajectory.nx()];
    for (i, label) in p.states.iter().enumerate().filter(|s| !s.1.is_empty()) {
        let at = |k: i32| from + (to - from) * f64::from(k) / f64::from(POINTS);
        let point = |k: i32| r.trajectory.state(at(k), &mut x).ok().map(|()| (at(k), x[i]));
        states.add(label, Mark::Line, (0..=POINTS).filter_map(point).collect());
    }
    let nu = p.controls.len();
    let mut controls = Plot::new("", p.time, "controls");
    for (j, label) in p.controls.iter().enumerate() {
        let mut t = from;
        let mut steps = Vec::new();
        for (k, h) in r.durations.iter().enumerate() {
            steps.push((t, r.controls[k * nu + j]));
            t += h;
        }
        steps.push((t, r.controls[(r.durations.len() - 1) * nu + j]));
        controls.add(label, Mark::Steps, steps);
    }
    let parts = [states, controls];
    c.draw(&stacked(&parts[..if nu > 0 { 2 } else { 1 }]), &format!("gallery-{}.svg", p.name));
}
