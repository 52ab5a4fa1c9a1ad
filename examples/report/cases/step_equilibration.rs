//! Step equilibration (Fig. 7.12) and the granularities of cross complementarity: what every choice costs, and how far
//! the grid is from piecewise equidistant.

use super::{distance, settings, short, Measured};
use crate::json::Table;
use crate::models::{sliding_ocp, SLIDING_QT};
use crate::svg::{Mark, Plot};
use crate::Context;
use std::time::Instant;
use switchback::fesd::Trajectory;
use switchback::nlp::{Control, Outcome};
use switchback::settings::{Cross, DcsForm, Discretisation, Polish, RkFamily, Settings, StepEquilibration};

const EQUILIBRATIONS: [StepEquilibration; 6] = [
    StepEquilibration::None,
    StepEquilibration::Mean,
    StepEquilibration::Difference,
    StepEquilibration::EtaProduct,
    StepEquilibration::EtaSquared,
    StepEquilibration::EtaEquation,
];
const CROSS: [Cross; 4] = [Cross::Element, Cross::Stage, Cross::Point, Cross::Full];

/// The largest relative difference of neighbouring steps of a control stage with the same active set.
fn unevenness(tr: &Trajectory) -> f64 {
    let pairs = tr.elements.windows(2).filter(|e| e[0].stage == e[1].stage && e[0].active == e[1].active);
    pairs.map(|e| (e[0].h - e[1].h).abs() / e[0].h.max(e[1].h)).fold(0.0, f64::max)
}

struct Sum {
    solved: usize,
    polished: usize,
    runs: usize,
    iterations: Vec<usize>,
    seconds: Vec<f64>,
    uneven: f64,
    worst: f64,
}

fn median<T: Copy + PartialOrd>(mut v: Vec<T>) -> Option<T> {
    v.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
    v.get(v.len() / 2).copied()
}

/// Solves (7.51) with two to four stage points and two to five elements per control stage.
fn measure(c: &Context, change: &dyn Fn(&mut Settings), label: [&str; 3]) -> Sum {
    let mut s = Sum {
        solved: 0,
        polished: 0,
        runs: 0,
        iterations: vec![],
        seconds: vec![],
        uneven: 0.0,
        worst: f64::NEG_INFINITY,
    };
    for n_s in 2..=4 {
        for n_fe in 2..=5 {
            let mut set = settings(RkFamily::RadauIia, n_s, n_fe, Discretisation::Fesd);
            change(&mut set);
            let clock = Instant::now();
            let mut ocp = sliding_ocp(&set);
            s.runs += 1;
            let r = match ocp.solve(&mut Control::default()) {
                Ok(r) => r,
                Err(e) => {
                    c.say(&format!("{}, n_s {n_s}, n_fe {n_fe}: {e}", label.join(", ")));
                    continue;
                }
            };
            let wall_s = clock.elapsed().as_secs_f64();
            s.solved += usize::from(r.outcome == Outcome::Solved);
            s.polished += usize::from(r.polish == switchback::mpcc::Polish::Done);
            s.iterations.push(r.stats.iterations);
            s.seconds.push(wall_s);
            let uneven = unevenness(&r.trajectory);
            s.uneven = s.uneven.max(uneven);
            s.worst = s.worst.max(r.cost);
            let end = r.trajectory.elements.last().map_or(f64::NAN, |e| distance(&e.x1[..2], &SLIDING_QT));
            let m = Measured { n_sim: 6, error: end, wall_s, stats: r.stats, outcome: r.outcome };
            let o = m.object("step-equilibration", &set).num("cost", r.cost).num("unevenness", uneven);
            let o = o.text("dcs_form", label[0]).text("cross", label[1]).text("step_equilibration", label[2]);
            c.record(&o.text("polish", if set.polish == Polish::On as i64 { "on" } else { "off" }));
        }
    }
    s
}

pub fn run(c: &Context) {
    c.say(
        "problem (7.51), 6 control stages, Radau IIA with 2 to 4 stage points, 2 to 5 elements per stage: 12 runs each",
    );
    let head = [
        "form",
        "cross",
        "equilibration",
        "polish",
        "solved",
        "exact",
        "median it",
        "median ms",
        "worst cost",
        "uneven",
    ];
    let mut table = Table::new(&head);
    let mut add = |form: DcsForm, cross: Cross, eq: StepEquilibration, polish: Polish| {
        let s = measure(
            c,
            &|set| {
                set.dcs_form = form as i64;
                set.cross = cross as i64;
                set.step_equilibration = eq as i64;
                set.polish = polish as i64;
            },
            [form.name(), cross.name(), eq.name()],
        );
        table.row(vec![
            form.name().into(),
            cross.name().into(),
            eq.name().into(),
            polish.name().into(),
            format!("{} of {}", s.solved, s.runs),
            s.polished.to_string(),
            median(s.iterations).map_or(String::new(), |v| v.to_string()),
            median(s.seconds).map_or(String::new(), |v| format!("{:.0}", 1e3 * v)),
            format!("{:.4}", s.worst),
            short(s.uneven),
        ]);
    };
    for eq in EQUILIBRATIONS {
        add(DcsForm::Stewart, Cross::Element, eq, Polish::On);
    }
    for cross in &CROSS[1..] {
        add(DcsForm::Stewart, *cross, StepEquilibration::Difference, Polish::On);
    }
    add(DcsForm::Heaviside, Cross::Element, StepEquilibration::Difference, Polish::On);
    for eq in [StepEquilibration::None, StepEquilibration::Difference] {
        add(DcsForm::Stewart, Cross::Element, eq, Polish::Off);
    }
    c.say(&table.text());
    steps(c);
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
