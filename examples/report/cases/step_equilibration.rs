//! Step equilibration (Fig. 7.12) and the granularities of cross complementarity: what every choice costs, and how far
//! the grid is from piecewise equidistant.

use super::{gallery, settings, short, simulate, Measured};
use crate::json::Table;
use crate::models::{self, sliding_ocp};
use crate::svg::{Mark, Plot};
use crate::Context;
use std::time::Instant;
use switchback::fesd::Trajectory;
use switchback::nlp::{Control, Outcome};
use switchback::ocp::Ocp;
use switchback::settings::{Cross, DcsForm, Discretisation, Polish, RkFamily, Settings, StepEquilibration};

const EQUILIBRATIONS: [StepEquilibration; 7] = [
    StepEquilibration::None,
    StepEquilibration::Mean,
    StepEquilibration::Difference,
    StepEquilibration::EtaProduct,
    StepEquilibration::EtaSquared,
    StepEquilibration::EtaSaturated,
    StepEquilibration::EtaEquation,
];
const CROSS: [Cross; 4] = [Cross::Element, Cross::Stage, Cross::Point, Cross::Full];

/// The largest relative difference of neighbouring steps of a control stage with the same active set.
fn unevenness(tr: &Trajectory) -> f64 {
    let pairs = tr.elements.windows(2).filter(|e| e[0].stage == e[1].stage && e[0].active == e[1].active);
    pairs.map(|e| (e[0].h - e[1].h).abs() / e[0].h.max(e[1].h)).fold(0.0, f64::max)
}

/// One problem under one choice.
struct Run {
    solved: bool,
    exact: bool,
    iterations: f64,
    seconds: f64,
    cost: f64,
    uneven: f64,
}

/// A choice: form, cross complementarity, equilibration, polish.
type Choice = (DcsForm, Cross, StepEquilibration, Polish);

const DEFAULT: Choice = (DcsForm::Auto, Cross::Element, StepEquilibration::Difference, Polish::On);

fn choices() -> Vec<Choice> {
    let (form, cross, eq, on) = DEFAULT;
    let mut all = vec![DEFAULT];
    all.extend(EQUILIBRATIONS.into_iter().filter(|e| *e != eq).map(|e| (form, cross, e, on)));
    all.extend(CROSS.into_iter().filter(|c| *c != cross).map(|c| (form, c, eq, on)));
    all.extend([DcsForm::Stewart, DcsForm::Heaviside].map(|f| (f, cross, eq, on)));
    all.extend([StepEquilibration::None, eq].map(|e| (form, cross, e, Polish::Off)));
    all
}

/// The problems, each with its default settings: (7.51) with two to four stage points and two or four elements per control
/// stage, and the others of the gallery; of these none in a sample.
fn problems(sample: bool) -> Vec<(String, Ocp)> {
    let mut all = Vec::new();
    for n_s in 2..=4 {
        for n_fe in [2, 4] {
            let set = settings(RkFamily::RadauIia, n_s, n_fe, Discretisation::Fesd);
            all.push((format!("sliding-mode {n_s} {n_fe}"), sliding_ocp(&set)));
        }
    }
    let others = gallery::named().filter(|p| p.0 != "sliding-mode" && !sample);
    all.extend(others.map(|(name, ocp)| (name.to_string(), ocp)));
    all
}

fn measure(c: &Context, (form, cross, eq, polish): Choice) -> Vec<Run> {
    let mut runs = Vec::new();
    for (name, mut ocp) in problems(c.all) {
        let set = Settings {
            dcs_form: form as i64,
            cross: cross as i64,
            step_equilibration: eq as i64,
            polish: polish as i64,
            max_time: PATIENCE,
            ..*ocp.settings()
        };
        let clock = Instant::now();
        let solved = ocp.set_settings(&set).and_then(|()| ocp.solve(&mut Control::default()).cloned());
        let wall_s = clock.elapsed().as_secs_f64();
        let r = match solved {
            Ok(r) => r,
            Err(e) => {
                c.say(&format!("{name}, {}, {}, {}: {e}", form.name(), cross.name(), eq.name()));
                continue;
            }
        };
        let uneven = unevenness(&r.trajectory);
        let error = r.accuracy.as_ref().map_or(f64::NAN, |a| a.terminal);
        let m = Measured { n_sim: r.durations.len(), error, wall_s, stats: r.stats, outcome: r.outcome };
        let o = m.object("step-equilibration", &set).text("problem", &name).num("cost", r.cost);
        let o = o.num("unevenness", uneven).text("dcs_form", form.name()).text("cross", cross.name());
        c.record(&o.text("step_equilibration", eq.name()).text("polish", polish.name()));
        runs.push(Run {
            solved: r.outcome == Outcome::Solved,
            exact: r.polish == switchback::mpcc::Polish::Done,
            iterations: r.stats.iterations as f64,
            seconds: wall_s,
            cost: r.cost,
            uneven,
        });
    }
    runs
}

fn median(mut v: Vec<f64>) -> f64 {
    v.sort_by(f64::total_cmp);
    v.get(v.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Seconds after which a run counts as not solved.
const PATIENCE: f64 = 20.0;
/// How much worse than the best cost still counts as that.
const AS_GOOD: f64 = 1e-3;

pub fn run(c: &Context) {
    c.say(
        "problem (7.51) with 2 to 4 stage points and 2 or 4 elements per stage, and the other problems of the gallery; \
         time: geometric mean over the problems relative to the defaults; best: runs that find the best cost of the table",
    );
    let choices = choices();
    let all: Vec<Vec<Run>> = choices.iter().map(|&choice| measure(c, choice)).collect();
    let n = all[0].len();
    let best: Vec<f64> = (0..n)
        .map(|k| {
            let costs = all.iter().filter_map(|runs| runs.get(k)).filter(|r| r.solved && r.exact).map(|r| r.cost);
            costs.fold(f64::INFINITY, f64::min)
        })
        .collect();
    let head = ["form", "cross", "equilibration", "polish", "solved", "exact", "best", "median it", "time", "uneven"];
    let mut table = Table::new(&head);
    for ((form, cross, eq, polish), runs) in choices.iter().zip(&all) {
        let count = |f: &dyn Fn(usize, &Run) -> bool| runs.iter().enumerate().filter(|(k, r)| f(*k, r)).count();
        let good = |k: usize, r: &Run| r.solved && r.cost <= best[k] + AS_GOOD * (1.0 + best[k].abs());
        let logs: Vec<f64> = runs.iter().zip(&all[0]).map(|(r, d)| (r.seconds / d.seconds).ln()).collect();
        let time = (logs.iter().sum::<f64>() / logs.len() as f64).exp();
        table.row(vec![
            form.name().into(),
            cross.name().into(),
            eq.name().into(),
            polish.name().into(),
            format!("{} of {n}", count(&|_, r| r.solved)),
            count(&|_, r| r.exact).to_string(),
            count(&good).to_string(),
            format!("{:.0}", median(runs.iter().map(|r| r.iterations).collect())),
            format!("{time:.2}"),
            short(runs.iter().filter(|r| r.solved).map(|r| r.uneven).fold(0.0, f64::max)),
        ]);
    }
    c.say(&table.text());
    simulations(c);
    steps(c);
}

/// The forms in simulations.
fn simulations(c: &Context) {
    let mut table = Table::new(&["model", "form", "ms", "homotopies", "switches", "outcome"]);
    let cases = [
        ("oscillator", models::oscillator(), models::OSCILLATOR_X0.to_vec(), 1.5, 20),
        ("sliding", models::sliding_mode(), models::SLIDING_X0.to_vec(), 4.0, 20),
        ("blocks", models::blocks(), vec![-1.0, 1.0, -1.0, -1.0, 1.0, 1.0], 10.0, 100),
    ];
    for (name, sys, x0, t_end, steps) in &cases {
        for form in [DcsForm::Auto, DcsForm::Stewart, DcsForm::Heaviside] {
            let base = settings(RkFamily::RadauIia, 3, 3, Discretisation::Fesd);
            let set = Settings { dcs_form: form as i64, ..base };
            let (r, _, seconds) = simulate(sys, &set, x0, *t_end, *steps);
            table.row(vec![
                (*name).into(),
                form.name().into(),
                format!("{:.1}", 1e3 * seconds),
                r.homotopies.to_string(),
                r.trajectory.switches.len().to_string(),
                r.outcome.name().into(),
            ]);
        }
    }
    c.say(&table.text());
}

/// Fig. 7.12: step sizes without and with equilibration.
fn steps(c: &Context) {
    let mut plot = Plot::new("Sliding-mode problem (7.51), step sizes", "t", "h");
    for (i, (eq, polish)) in
        [(StepEquilibration::None, Polish::Off), (StepEquilibration::Difference, Polish::On)].into_iter().enumerate()
    {
        let mut set = settings(RkFamily::RadauIia, 3, 6, Discretisation::Fesd);
        (set.step_equilibration, set.polish) = (eq as i64, polish as i64);
        let mut ocp = sliding_ocp(&set);
        let Ok(r) = ocp.solve(&mut Control::default()) else { continue };
        let points = r.trajectory.elements.iter().flat_map(|e| [(e.t, e.h), (e.t + e.h, e.h)]).collect();
        let label = if i == 0 { "without equilibration" } else { "with, exact" };
        plot.add_coloured(label, Mark::Line, i, points);
        c.say(&format!("{label}: neighbouring steps of one active set differ by {:.1e}", unevenness(&r.trajectory)));
    }
    c.plot(&plot, "step-equilibration.svg");
}
