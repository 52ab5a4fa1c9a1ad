//! The tutorial problem (7.35) from 200 starts: artificial optima without switch detection, none with it
//! (Figs. 5.3-5.5, 7.7-7.9).

use super::{settings, short, Measured, BOTH};
use crate::json::Table;
use crate::models::{tutorial_ocp, TUTORIAL_COST, TUTORIAL_X0};
use crate::svg::{Mark, Plot};
use crate::Context;
use std::time::Instant;
use switchback::nlp::{Control, Outcome};
use switchback::settings::RkFamily;

const STARTS: usize = 200;
const SIGMAS: [f64; 3] = [1.0, 0.1, 1e-4];

pub fn run(c: &Context) {
    let mut table = Table::new(&[
        "discretisation",
        "sigma_init",
        "solved",
        "|x0-x0*|<=1e-6",
        "|x0-x0*|<=1e-9",
        "worst |x0-x0*|",
        "worst |V-V*|",
        "distinct x0",
        "mean ms",
        "mean it",
        "max it",
    ]);
    let mut plot = Plot::new("Optimum found from each start, problem (7.35)", "x0 at the start", "x0 found");
    let mut i_series = 0;
    let mut listed = Table::new(&["discretisation", "sigma_init", "start", "x0", "error", "outcome", "polish"]);
    let mut n_listed = 0;
    for disc in BOTH {
        for sigma in SIGMAS {
            let mut set = settings(RkFamily::GaussLegendre, 2, 20, disc);
            set.sigma_init = sigma;
            let mut ocp = tutorial_ocp(&set);
            let (mut found, mut worst, mut worst_cost) = (Vec::new(), 0f64, 0f64);
            let (mut solved, mut near, mut close, mut seconds, mut its, mut most) = (0, 0, 0, 0.0, 0, 0);
            for k in 0..STARTS {
                let start = -2.0 + 1.2 * k as f64 / (STARTS - 1) as f64;
                let clock = Instant::now();
                ocp.set_x_guess(&[0.0], &[start]).expect("one state");
                let r = ocp.solve(&mut Control::default()).expect("the problem is well posed");
                let wall_s = clock.elapsed().as_secs_f64();
                let x0 = r.trajectory.elements[0].x0[0];
                let error = (x0 - TUTORIAL_X0).abs();
                let m = Measured { n_sim: 1, error, wall_s, stats: r.stats, outcome: r.outcome };
                let o = m.object("tutorial-ocp", &set).num("sigma_init", sigma).num("x0_start", start);
                let o = o.num("x0", x0).num("cost", r.cost).num("cost_error", (r.cost - TUTORIAL_COST).abs());
                c.record(&o.text("polish", &format!("{:?}", r.polish).to_lowercase()));
                solved += usize::from(r.outcome == Outcome::Solved);
                near += usize::from(error <= 1e-6);
                close += usize::from(error <= 1e-9);
                worst = worst.max(error);
                worst_cost = worst_cost.max((r.cost - TUTORIAL_COST).abs());
                seconds += wall_s;
                its += r.stats.iterations;
                most = most.max(r.stats.iterations);
                let bad = r.outcome != Outcome::Solved || (error > 1e-6 && disc == BOTH[0]);
                if bad {
                    n_listed += 1;
                    if n_listed <= 40 {
                        listed.row(vec![
                            disc.name().into(),
                            sigma.to_string(),
                            format!("{start:.6}"),
                            format!("{x0:.9}"),
                            short(error),
                            r.outcome.name().into(),
                            format!("{:?}", r.polish),
                        ]);
                    }
                }
                found.push((start, x0));
            }
            let mut distinct: Vec<f64> = found.iter().map(|p| p.1).collect();
            distinct.sort_by(f64::total_cmp);
            distinct.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
            table.row(vec![
                disc.name().into(),
                sigma.to_string(),
                format!("{solved}/{STARTS}"),
                format!("{near}/{STARTS}"),
                format!("{close}/{STARTS}"),
                short(worst),
                short(worst_cost),
                distinct.len().to_string(),
                format!("{:.2}", 1e3 * seconds / STARTS as f64),
                format!("{:.1}", its as f64 / STARTS as f64),
                most.to_string(),
            ]);
            plot.add_coloured(&format!("{}, sigma {sigma}", disc.name()), Mark::Dots, i_series, found);
            i_series += 1;
        }
    }
    plot.add("x0*", Mark::Dashed, vec![(-2.0, TUTORIAL_X0), (-0.8, TUTORIAL_X0)]);
    c.plot(&plot, "tutorial-ocp-staircase.svg");
    c.say("tutorial problem (7.35), Gauss-Legendre n_s = 2, 20 elements");
    c.say(&table.text());
    if n_listed > 0 {
        c.say(&format!("not solved, or (fesd) elsewhere: {n_listed}, the first of them\n{}", listed.text()));
    }
}
