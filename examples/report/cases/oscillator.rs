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
/// Below this the errors are rounding.
const FLOOR: f64 = 5e-14;
const FAMILIES: [RkFamily; 3] = [RkFamily::RadauIia, RkFamily::GaussLegendre, RkFamily::Explicit];

fn order(family: RkFamily, n_s: usize) -> usize {
    match family {
        RkFamily::RadauIia | RkFamily::RadauIa => 2 * n_s - 1,
        RkFamily::LobattoIiia | RkFamily::LobattoIiib | RkFamily::LobattoIiic => 2 * n_s - 2,
        RkFamily::GaussLegendre => 2 * n_s,
        RkFamily::Explicit => n_s,
    }
}

/// Numbers of steps, geometric, with the switch at `t = 1` in about the same place of its step: from a fifth to
/// half of it. That place is in the error constant, and leaving it to chance would hide the slope.
///
/// Without switch detection the error itself depends on that place and can vanish: there the numbers come in groups
/// of eleven neighbours, over which the place goes round (`11 · 2/π ≈ 7`), and the mean error of a group counts.
fn step_numbers(disc: Discretisation, order: usize) -> Vec<Vec<usize>> {
    if disc == Discretisation::Standard {
        // the methods' own error of low order has to become small first
        let finest = if order <= 2 { 8 } else { 6 };
        return (0..finest).map(|k| 15 << k).map(|n| (n..n + 11).collect()).collect();
    }
    let good = |n: usize| (0.18..0.48).contains(&(n as f64 / T).fract());
    let mut numbers: Vec<usize> =
        (0..28).filter_map(|k| ((4.0 * 1.24f64.powi(k)) as usize..).find(|n| good(*n))).collect();
    numbers.dedup();
    numbers.into_iter().map(|n| vec![n]).collect()
}

/// The finest errors above the floor that span a decade of `h`.
fn window(points: &[(f64, f64)]) -> &[(f64, f64)] {
    let end = points.iter().position(|p| p.1 < FLOOR).unwrap_or(points.len());
    let above = &points[..end];
    let Some(last) = above.last() else { return above };
    let from = above.iter().rposition(|p| p.0 >= 10.0 * last.0).unwrap_or(0);
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
                for group in step_numbers(disc, order(family, n_s)) {
                    let (mut mean, mut seconds, mut h_mean, mut n_solved) = (0.0, 0.0, 0.0, 0);
                    for n_sim in group {
                        let (r, x, wall_s) = simulate(&sys, &set, &OSCILLATOR_X0, T, n_sim);
                        let solved = r.outcome == Outcome::Solved;
                        let error = if solved { distance(&x, &OSCILLATOR_XT) } else { f64::NAN };
                        let m = Measured { n_sim, error, wall_s, stats: r.stats, outcome: r.outcome };
                        let h = T / (n_sim * N_FE) as f64;
                        let switches = &r.trajectory.switches;
                        let switch = switches.iter().map(|s| (s.t - 1.0).abs()).fold(f64::NAN, f64::min);
                        let o = m.object("oscillator", &set).text("record", "run").num("h", h);
                        c.record(&o.num("switch_error", switch).int("switches", switches.len()));
                        total.0 += wall_s;
                        total.1.iterations += r.stats.iterations;
                        total.1.factorisations += r.stats.factorisations;
                        if solved {
                            n_solved += 1;
                            mean += error;
                            seconds += wall_s;
                            h_mean += h;
                        } else {
                            failed += 1;
                        }
                    }
                    if n_solved == 0 {
                        continue;
                    }
                    let n = f64::from(n_solved);
                    by_h.push((h_mean / n, mean / n));
                    by_time.push((seconds / n, mean / n));
                    if mean < 0.05 * FLOOR {
                        break;
                    }
                }
                let standard = disc == Discretisation::Standard;
                let p = window(&by_h);
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
                let mark = [Mark::LineDots, Mark::Dashed, Mark::Line][i_f];
                error_plot.add_coloured(&label, mark, n_s - 1, by_h);
                work_plot.add_coloured(&label, mark, n_s - 1, by_time);
            }
        }
        c.plot(&error_plot, &format!("oscillator-order-{}.svg", disc.name()));
        c.plot(&work_plot, &format!("oscillator-work-{}.svg", disc.name()));
    }
    c.say("oscillator (4.4), T = pi/2, two elements per step");
    c.say(&table.text());
}
