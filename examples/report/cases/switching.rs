//! The four ways to switch, Example 6.8: crossing, entering and leaving a sliding mode, a continuation that is
//! not unique.

use super::{settings, short, simulate, Measured, BOTH};
use crate::json::Table;
use crate::models::switching;
use crate::svg::{Mark, Plot};
use crate::Context;
use switchback::fesd::Trajectory;
use switchback::nlp::Outcome;
use switchback::settings::{Discretisation, RkFamily};

const T: f64 = 2.0;

struct Problem {
    name: &'static str,
    model: char,
    x0: f64,
    /// `None` where the solution is not unique.
    x_end: Option<f64>,
    switches: &'static [f64],
}

#[allow(clippy::excessive_precision)]
const PROBLEMS: [Problem; 5] = [
    Problem { name: "a", model: 'a', x0: -1.0, x_end: Some(5.0 / 3.0), switches: &[1.0 / 3.0] },
    // root of 0.54 − t − 0.04 cos 5t
    Problem { name: "b", model: 'b', x0: -0.5, x_end: Some(0.0), switches: &[0.436_955_033_385_969_07] },
    // √2 − 1, then the drift outgrows the friction
    Problem { name: "c", model: 'c', x0: -0.5, x_end: Some(0.5), switches: &[0.414_213_562_373_095_05, 1.0] },
    Problem { name: "c0", model: 'c', x0: 0.0, x_end: Some(0.5), switches: &[1.0] },
    Problem { name: "d", model: 'd', x0: 0.0, x_end: None, switches: &[] },
];

/// Largest distance of an exact switching time from the nearest one found; NaN where one is missing or too many.
fn switch_error(tr: &Trajectory, exact: &[f64]) -> f64 {
    if tr.switches.len() != exact.len() {
        return f64::NAN;
    }
    tr.switches.iter().zip(exact).map(|(s, t)| (s.t - t).abs()).fold(0.0, f64::max)
}

/// The solutions of `x' ∈ sign x` from 0: rest, then leave to one side, or never.
fn is_solution_of_d(tr: &Trajectory) -> bool {
    let end = tr.elements.last().map_or(f64::NAN, |e| e.x1[0]);
    let leaves = T - end.abs();
    tr.elements.iter().all(|e| {
        let exact = ((e.t + e.h - leaves).max(0.0)) * end.signum();
        (e.x1[0] - exact).abs() < 1e-9
    })
}

pub fn run(c: &Context) {
    let methods = [
        (RkFamily::RadauIia, 1),
        (RkFamily::RadauIia, 2),
        (RkFamily::RadauIia, 3),
        (RkFamily::RadauIia, 4),
        (RkFamily::GaussLegendre, 2),
        (RkFamily::GaussLegendre, 3),
        (RkFamily::Explicit, 2),
        (RkFamily::Explicit, 4),
    ];
    let mut table = Table::new(&[
        "problem",
        "method",
        "n_s",
        "discretisation",
        "n_sim",
        "error x(T)",
        "error t_s",
        "switches",
        "outcome",
        "note",
    ]);
    let mut plot = Plot::new("Example 6.8", "t", "x");
    let mut steps = Plot::new("Example 6.8, step sizes of Radau IIA 2", "t", "h");
    for p in &PROBLEMS {
        let sys = switching(p.model);
        for disc in BOTH {
            for (family, n_s) in methods {
                for n_sim in [7, 10, 20] {
                    let set = settings(family, n_s, 3, disc);
                    let (r, x, wall_s) = simulate(&sys, &set, &[p.x0], T, n_sim);
                    let solved = r.outcome == Outcome::Solved;
                    let mut error = p.x_end.map_or(f64::NAN, |e| (x[0] - e).abs());
                    let mut note = String::new();
                    if let Some(t) = r.non_unique.first() {
                        note = format!("continuation not unique at t = {t}");
                    }
                    if p.x_end.is_none() && solved {
                        let right = is_solution_of_d(&r.trajectory);
                        error = if right { 0.0 } else { f64::NAN };
                        let found = if right { "a solution" } else { "NOT A SOLUTION" };
                        note += &format!("; {found}, x(T) = {:.3}", x[0]);
                    }
                    if !solved {
                        error = f64::NAN;
                    }
                    let ts = if p.x_end.is_some() { switch_error(&r.trajectory, p.switches) } else { f64::NAN };
                    let m = Measured { n_sim, error, wall_s, stats: r.stats, outcome: r.outcome };
                    let times: Vec<f64> = r.trajectory.switches.iter().map(|s| s.t).collect();
                    let o = m.object("switching", &set).text("problem", p.name).num("switch_error", ts);
                    c.record(&o.list("switch_times", &times).list("non_unique", &r.non_unique).text("note", &note));
                    table.row(vec![
                        p.name.into(),
                        family.name().into(),
                        n_s.to_string(),
                        disc.name().into(),
                        n_sim.to_string(),
                        short(error),
                        short(ts),
                        format!("{}/{}", times.len(), p.switches.len()),
                        r.outcome.name().into(),
                        note,
                    ]);
                    let shown = (family, n_s, n_sim) == (RkFamily::RadauIia, 2, 7);
                    if shown && disc == Discretisation::Fesd && solved {
                        let mut at = [0.0];
                        let points = (0..=400).filter_map(|k| {
                            let t = T * f64::from(k) / 400.0;
                            r.trajectory.state(t, &mut at).ok().map(|()| (t, at[0]))
                        });
                        plot.add(p.name, Mark::Line, points.collect());
                        let h: Vec<(f64, f64)> = r.trajectory.elements.iter().map(|e| (e.t, e.h)).collect();
                        steps.add(p.name, Mark::Steps, h);
                    }
                }
            }
        }
    }
    plot.add("surface", Mark::Dashed, vec![(0.0, 0.0), (T, 0.0)]);
    c.plot(&plot, "switching-trajectories.svg");
    c.plot(&steps, "switching-steps.svg");
    c.say("Example 6.8, T = 2, three elements per step");
    c.say(&table.text());
}
