//! Order of every method on the oscillator (4.4), with and without switch detection (Theorem 7.10, Fig. 7.6).

use super::{distance, settings, short, simulate, slope, Measured, BOTH};
use crate::json::Table;
use crate::models::{oscillator, OSCILLATOR_X0, OSCILLATOR_XT};
use crate::svg::{Mark, Plot};
use crate::Context;
use switchback::nlp::{Outcome, Statistics};
use switchback::settings::{Discretisation, RkFamily};

const T: f64 = std::f64::consts::FRAC_PI_2;
const N_FE: usize = 2;
const N_SIM: [usize; 17] = [5, 7, 10, 14, 20, 28, 40, 56, 80, 112, 160, 224, 320, 448, 640, 896, 1280];
/// Below this the errors are rounding.
const FLOOR: f64 = 3e-13;
const FAMILIES: [RkFamily; 3] = [RkFamily::RadauIia, RkFamily::GaussLegendre, RkFamily::Explicit];

fn order(family: RkFamily, n_s: usize) -> usize {
    match family {
        RkFamily::RadauIia => 2 * n_s - 1,
        RkFamily::GaussLegendre => 2 * n_s,
        RkFamily::Explicit => n_s,
    }
}

/// The finest errors above the floor that span a decade of `h`; without switch detection all of them, because
/// the error depends on where in its element the switch lies.
fn window(points: &[(f64, f64)], all: bool) -> &[(f64, f64)] {
    let end = points.iter().position(|p| p.1 < FLOOR).unwrap_or(points.len());
    let above = &points[..end];
    let Some(last) = above.last() else { return above };
    let from = if all { 0 } else { above.iter().rposition(|p| p.0 >= 10.0 * last.0).unwrap_or(0) };
    &above[from..]
}

pub fn run(c: &Context) {
    let sys = oscillator();
    let mut table =
        Table::new(&["method", "n_s", "discretisation", "slope", "expected", "", "h from", "h to", "best", "failed"]);
    for disc in BOTH {
        let mut error_plot = Plot::new(&format!("Oscillator, {}", disc.name()), "h", "error of x(T)").log_log();
        let mut work_plot = Plot::new(&format!("Oscillator, {}", disc.name()), "seconds", "error of x(T)").log_log();
        for (i_f, family) in FAMILIES.into_iter().enumerate() {
            for n_s in 1..=4 {
                let set = settings(family, n_s, N_FE, disc);
                let (mut by_h, mut by_time, mut failed) = (Vec::new(), Vec::new(), 0);
                let mut total = (0.0, Statistics::default());
                for n_sim in N_SIM {
                    let (r, x, wall_s) = simulate(&sys, &set, &OSCILLATOR_X0, T, n_sim);
                    let solved = r.outcome == Outcome::Solved;
                    let error = if solved { distance(&x, &OSCILLATOR_XT) } else { f64::NAN };
                    let m = Measured { n_sim, error, wall_s, stats: r.stats, outcome: r.outcome };
                    let h = T / (n_sim * N_FE) as f64;
                    let switch = r.trajectory.switches.iter().map(|s| (s.t - 1.0).abs()).fold(f64::NAN, f64::min);
                    let o = m.object("oscillator", &set).text("record", "run").num("h", h);
                    c.record(&o.num("switch_error", switch).int("switches", r.trajectory.switches.len()));
                    total.0 += wall_s;
                    total.1.iterations += r.stats.iterations;
                    total.1.factorisations += r.stats.factorisations;
                    if !solved {
                        failed += 1;
                        continue;
                    }
                    by_h.push((h, error));
                    by_time.push((wall_s, error));
                    if error < 0.05 * FLOOR {
                        break;
                    }
                }
                let standard = disc == Discretisation::Standard;
                let p = window(&by_h, standard);
                let found = slope(p);
                let (want, margin) = if standard { (1, 0.3) } else { (order(family, n_s), 0.25) };
                let ok = (found - want as f64).abs() <= margin;
                let best = by_h.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
                let (from, to) = (p.first().map_or(f64::NAN, |p| p.0), p.last().map_or(f64::NAN, |p| p.0));
                table.row(vec![
                    family.name().into(),
                    n_s.to_string(),
                    disc.name().into(),
                    format!("{found:.2}"),
                    want.to_string(),
                    if ok { "ok" } else { "MISSED" }.into(),
                    short(from),
                    short(to),
                    short(best),
                    failed.to_string(),
                ]);
                let outcome = if by_h.is_empty() { Outcome::Failed } else { Outcome::Solved };
                let m = Measured { n_sim: by_h.len(), error: best, wall_s: total.0, stats: total.1, outcome };
                let o = m.object("oscillator", &set).text("record", "slope").num("slope", found);
                let o = o.int("expected", want).flag("ok", ok).num("h_from", from).num("h_to", to);
                c.record(&o.int("failed", failed));
                let label = format!("{} {n_s}", family.name());
                let mark = if i_f == 1 { Mark::Dashed } else { Mark::LineDots };
                error_plot.add_coloured(&label, mark, 4 * i_f + n_s - 1, by_h);
                work_plot.add_coloured(&label, mark, 4 * i_f + n_s - 1, by_time);
            }
        }
        c.plot(&error_plot, &format!("oscillator-order-{}.svg", disc.name()));
        c.plot(&work_plot, &format!("oscillator-work-{}.svg", disc.name()));
    }
    c.say("oscillator (4.4), T = pi/2, two elements per step");
    c.say(&table.text());
}
