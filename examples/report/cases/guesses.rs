//! Initial guesses of optimal control problems compared: how many solves end exact, at which cost, after how many iterations.

use super::{gallery, settings};
use crate::json::{Object, Table};
use crate::models::sliding_ocp;
use crate::Context;
use std::time::Instant;
use switchback::mpcc::Polish;
use switchback::nlp::{Control, Outcome};
use switchback::ocp::Ocp;
use switchback::settings::{Discretisation, InitialGuess, RkFamily, Settings};

const KINDS: [(&str, InitialGuess); 4] = [
    ("constant", InitialGuess::Constant),
    ("simulation", InitialGuess::Simulation),
    ("smoothed", InitialGuess::Smoothed),
    ("time_stepping", InitialGuess::TimeStepping),
];
/// Costs this close, relative, are the same.
const SAME: f64 = 1e-6;

/// The gallery, of which a sample has none, and the sliding-mode problem on several grids.
fn problems(sample: bool) -> Vec<(String, Ocp)> {
    let gallery = gallery::named().filter(|_| !sample);
    let mut all: Vec<(String, Ocp)> = gallery.map(|(name, ocp)| (name.to_owned(), ocp)).collect();
    for n_s in 1..=4 {
        for n_fe in 2..=5 {
            let set = settings(RkFamily::RadauIia, n_s, n_fe, Discretisation::Fesd);
            all.push((format!("sliding-mode n_s = {n_s} n_fe = {n_fe}"), sliding_ocp(&set)));
        }
    }
    all
}

struct Found {
    exact: bool,
    cost: f64,
    iterations: usize,
    seconds: f64,
}

fn solve(o: &mut Ocp, kind: InitialGuess) -> Found {
    let set = Settings { initial_guess: kind as i64, ..*o.settings() };
    o.set_settings(&set).expect("the settings fit");
    let clock = Instant::now();
    let r = o.solve(&mut Control::default()).expect("the problem is well posed");
    let exact = r.outcome == Outcome::Solved && r.polish == Polish::Done;
    Found { exact, cost: r.cost, iterations: r.stats.iterations, seconds: clock.elapsed().as_secs_f64() }
}

pub fn run(c: &Context) {
    let mut each = Table::new(&["problem", "constant", "simulation", "smoothed", "time_stepping"]);
    let mut totals = [(0usize, 0usize, 0usize, 0.0); KINDS.len()];
    let mut n = 0;
    for (name, mut o) in problems(c.all) {
        let found = KINDS.map(|(_, kind)| solve(&mut o, kind));
        let best = found.iter().filter(|f| f.exact).fold(f64::INFINITY, |m, f| m.min(f.cost));
        let mut row = vec![name.clone()];
        n += 1;
        for (((kind, _), f), total) in KINDS.iter().zip(&found).zip(&mut totals) {
            let good = f.exact && f.cost <= best + SAME * (1.0 + best.abs());
            total.0 += usize::from(f.exact);
            total.1 += usize::from(good);
            total.2 += f.iterations;
            total.3 += f.seconds;
            let mark = if good {
                ""
            } else if f.exact {
                " above"
            } else {
                " inexact"
            };
            row.push(format!("{:.6}{mark}, {} it", f.cost, f.iterations));
            let o =
                Object::new().text("case", "guesses").text("problem", &name).text("guess", kind).num("cost", f.cost);
            c.record(&o.int("exact", usize::from(f.exact)).int("iterations", f.iterations).num("wall_s", f.seconds));
        }
        each.row(row);
    }
    let mut table = Table::new(&["guess", "exact", "best cost", "iterations", "ms"]);
    for ((kind, _), (exact, good, iterations, seconds)) in KINDS.iter().zip(totals) {
        table.row(vec![
            (*kind).into(),
            format!("{exact} of {n}"),
            good.to_string(),
            iterations.to_string(),
            format!("{:.0}", 1e3 * seconds),
        ]);
    }
    c.say(&each.text());
    c.say(&table.text());
}
