//! Grids that follow the error on (7.51): the error asked for against the error reached, and the size of the problem
//! against that on grids with equally many elements in every stage.

use super::{settings, short, Measured};
use crate::json::Table;
use crate::models::sliding_ocp;
use crate::svg::{Mark, Plot};
use crate::Context;
use std::time::Instant;
use switchback::mpcc::Polish;
use switchback::nlp::Control;
use switchback::settings::{Discretisation, RkFamily, Settings};

const ASKED: [f64; 8] = [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10];
const UNIFORM: [usize; 8] = [2, 3, 4, 5, 6, 8, 12, 16];
const STAGES: usize = 6;

pub fn run(c: &Context) {
    c.say(
        "problem (7.51), 6 control stages, Radau IIA; error: largest difference from the simulation at the stage ends",
    );
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
    let mut size = Plot::new("Sliding-mode problem (7.51), Radau IIA", "variables", "error").log_log();
    for n_s in 1..=3 {
        let mut points = [Vec::new(), Vec::new()];
        let uniform = UNIFORM.iter().map(|&n| (n, 0.0));
        // the grid that is given has two elements in every stage
        for (n_fe, adapt_tol) in uniform.chain(ASKED.iter().map(|&t| (2, t))) {
            let base = settings(RkFamily::RadauIia, n_s, n_fe, Discretisation::Fesd);
            let set = Settings { adapt_tol, adapt_elements: 150, ..base };
            let clock = Instant::now();
            let mut ocp = sliding_ocp(&set);
            let r = ocp.solve(&mut Control::default()).expect("the problem is well posed").clone();
            let wall = clock.elapsed().as_secs_f64();
            let adapted = r.adaptation.as_ref();
            let rounds = adapted.map_or(1, |a| a.rounds.len());
            let elements = adapted.map_or(vec![n_fe; STAGES], |a| a.rounds[a.kept].elements.clone());
            let n = elements.iter().sum::<usize>();
            let m = Measured { n_sim: STAGES, error: r.error(), wall_s: wall, stats: r.stats, outcome: r.outcome };
            let polish = format!("{:?}", r.polish).to_lowercase();
            let o = m.object("adaptation", &set).num("asked", adapt_tol).num("cost", r.cost).text("polish", &polish);
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
    c.plot(&size, "adaptation-size.svg");
    c.say(&table.text());
}
