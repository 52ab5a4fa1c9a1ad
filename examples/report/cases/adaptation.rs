//! Grids that follow the error: the error asked for against the error reached, and the size of the problem against that
//! on grids with equally many elements in every stage. On (7.51), whose states are almost polynomials between its switches,
//! and on a pendulum with dry friction.

use super::{settings, short, Measured};
use crate::json::Table;
use crate::models::{add_sides, affine, sliding_ocp, smooth};
use crate::svg::{Mark, Plot};
use crate::Context;
use std::time::Instant;
use switchback::func::{Dims, Point};
use switchback::mpcc::Polish;
use switchback::nlp::Control;
use switchback::ocp::Ocp;
use switchback::settings::{Discretisation, RkFamily, Settings};
use switchback::system::System;

const ASKED: [f64; 5] = [1e-3, 1e-5, 1e-7, 1e-9, 1e-10];
const UNIFORM: [usize; 7] = [2, 3, 4, 6, 8, 12, 16];
const STAGES: usize = 6;

/// From rest at the bottom to rest at an angle of 2.5 in a time of 6 against dry friction, with the least effort:
/// `q'' = −sin q − 0.3 sign q' + u`.
fn pendulum(settings: &Settings) -> Ocp {
    let d = Dims { x: 2, u: 1, p: 0 };
    let mut s = System::new(2, 1, 0).expect("two states");
    let f0 = smooth(
        "f0",
        d,
        2,
        |at, o| {
            o[0] = at.x[1];
            o[1] = at.u[0] - at.x[0].sin();
        },
        &[(1, 0), (0, 1), (1, 2)],
        |at, o| {
            o[0] = -at.x[0].cos();
            o[1] = 1.0;
            o[2] = 1.0;
        },
        &[(0, 0)],
        |at, w, o| o[0] = w[1] * at.x[0].sin(),
    );
    s.set_f0(f0).expect("f0 fits");
    add_sides(&mut s, &[1], affine("F", d, &[-0.3, 0.3], &[]), affine("psi", d, &[0.0], &[(0, 1, 1.0)]));
    let mut o = Ocp::new(&s, 6.0, STAGES, settings).expect("the settings fit");
    let effort = |at: &Point, o: &mut [f64]| o[0] = at.u[0] * at.u[0];
    let slope = |at: &Point, o: &mut [f64]| o[0] = 2.0 * at.u[0];
    let l = smooth("L", d, 1, effort, &[(0, 2)], slope, &[(2, 2)], |_, w, o| o[0] = 2.0 * w[0]);
    o.set_lagrange(l).expect("L fits");
    o.set_x0(&[0.0, 0.0]).expect("two states");
    let e = affine("e", d, &[0.0; 2], &[(0, 0, 1.0), (1, 1, 1.0)]);
    o.add_terminal(e, &[2.5, 0.0], &[2.5, 0.0]).expect("e fits");
    o
}

pub fn run(c: &Context) {
    c.say("6 control stages, Radau IIA; error: largest difference from the simulation at the ends of the stages");
    study(c, "sliding", "Sliding-mode problem (7.51)", &[2], &sliding_ocp);
    study(c, "pendulum", "Pendulum with dry friction", &[1, 2, 3], &pendulum);
}

fn study(c: &Context, name: &str, title: &str, stage_points: &[usize], problem: &dyn Fn(&Settings) -> Ocp) {
    c.say(title);
    let mut table = Table::new(&[
        "n_s",
        "grid",
        "asked",
        "error",
        "elements",
        "variables",
        "rounds",
        "it",
        "ms",
        "cost",
        "polish",
        "of stages",
    ]);
    let mut size = Plot::new(&format!("{title}, Radau IIA"), "variables", "error").log_log();
    for &n_s in stage_points {
        let mut points = [Vec::new(), Vec::new()];
        let uniform = UNIFORM.iter().map(|&n| (n, 0.0));
        // the grid that is given has two elements in every stage
        for (n_fe, adapt_tol) in uniform.chain(ASKED.iter().map(|&t| (2, t))) {
            let base = settings(RkFamily::RadauIia, n_s, n_fe, Discretisation::Fesd);
            let set = Settings { adapt_tol, adapt_elements: 150, ..base };
            let clock = Instant::now();
            let mut ocp = problem(&set);
            let r = ocp.solve(&mut Control::default()).expect("the problem is well posed").clone();
            let wall = clock.elapsed().as_secs_f64();
            let adapted = r.adaptation.as_ref();
            let rounds = adapted.map_or(1, |a| a.rounds.len());
            let elements = adapted.map_or(vec![n_fe; STAGES], |a| a.rounds[a.kept].elements.clone());
            let n = elements.iter().sum::<usize>();
            let m = Measured { n_sim: STAGES, error: r.error(), wall_s: wall, stats: r.stats, outcome: r.outcome };
            let polish = format!("{:?}", r.polish).to_lowercase();
            let o = m
                .object("adaptation", &set)
                .text("problem", name)
                .num("asked", adapt_tol)
                .num("cost", r.cost)
                .text("polish", &polish);
            let o = o.num("variables", r.dimensions.0 as f64).num("rounds", rounds as f64).num("elements", n as f64);
            c.record(&o.list("of_stages", &elements.iter().map(|n| *n as f64).collect::<Vec<f64>>()));
            let grid = if adapt_tol > 0.0 { "adapted" } else { "uniform" };
            table.row(vec![
                n_s.to_string(),
                grid.into(),
                if adapt_tol > 0.0 { short(adapt_tol) } else { String::new() },
                short(r.error()),
                n.to_string(),
                r.dimensions.0.to_string(),
                rounds.to_string(),
                r.stats.iterations.to_string(),
                format!("{:.0}", 1e3 * wall),
                format!("{:.8}", r.cost),
                polish,
                format!("{elements:?}"),
            ]);
            if r.polish == Polish::Done && r.error().is_finite() {
                points[usize::from(adapt_tol > 0.0)].push((r.dimensions.0 as f64, r.error().max(1e-16)));
            }
        }
        let [uniform, mut adapted] = points;
        adapted.sort_by(|a, b| a.0.total_cmp(&b.0));
        size.add_coloured(&format!("uniform, n_s = {n_s}"), Mark::LineDots, n_s - 1, uniform);
        size.add_coloured(&format!("adapted, n_s = {n_s}"), Mark::LineDots, n_s + 2, adapted);
    }
    c.plot(&size, &format!("adaptation-{name}.svg"));
    c.say(&table.text());
}
