//! Optimal control through sliding modes of codimension one and two, (7.51): cost, error of the terminal
//! constraint when the controls are simulated again, time (Figs. 7.10-7.13).

use super::{distance, settings, sliding_families, Measured, BOTH};
use crate::models::{sliding_mode, sliding_ocp, SLIDING_QT, SLIDING_X0};
use crate::svg::{Mark, Plot};
use crate::Context;
use std::time::Instant;
use switchback::fesd::Trajectory;
use switchback::mpcc::Polish;
use switchback::nlp::{Control, Outcome};
use switchback::ocp::OcpResult;
use switchback::settings::{DcsForm, Discretisation, RkFamily, Settings};
use switchback::sim::Simulator;

const STAGES: usize = 6;
const T: f64 = 4.0;

/// Steps per control stage and elements per step of the simulator that checks; the next one where one fails.
const CHECKS: [(usize, usize); 4] = [(20, 3), (20, 2), (31, 3), (12, 4)];

/// State at `T` under piecewise constant controls, with the number of the check that worked.
pub fn resimulate(controls: &[f64], stages: usize) -> Option<([f64; 4], usize)> {
    CHECKS.iter().enumerate().find_map(|(i, &(steps, n_fe))| {
        let set = settings(RkFamily::RadauIia, 4, n_fe, Discretisation::Fesd);
        let mut s = Simulator::new(&sliding_mode(), &set).ok()?;
        s.set_state(0.0, &SLIDING_X0).ok()?;
        for u in controls.chunks(2) {
            s.set_controls(u).ok()?;
            let r = s.run(T / stages as f64, steps, &mut Control::default()).ok()?;
            if r.outcome != Outcome::Solved {
                return None;
            }
        }
        let x = s.state();
        Some(([x[0], x[1], x[2], x[3]], i))
    })
}

/// What one run of the problem gives.
pub struct Run {
    pub label: String,
    pub seconds: f64,
    pub cost: f64,
    /// Distance from the terminal point when the controls are simulated by the event-driven engine.
    pub error: f64,
    /// How far another simulation of the controls, by FESD with four stages and fixed active sets, ends from that.
    pub check: f64,
    pub solved: bool,
    pub exact: bool,
    pub result: Option<OcpResult>,
    text: String,
}

impl Run {
    /// One line for a person.
    pub fn line(&self) -> String {
        let ms = 1e3 * self.seconds;
        format!(
            "{:<42} cost {:<12.8} E(T) {:.1e}  check {:.0e}  {ms:7.1} ms  {}",
            self.label, self.cost, self.error, self.check, self.text
        )
    }
}

/// Solves the problem from the default start and records it. The time includes building the problem and the simulation
/// that measures the error; short runs are timed twice.
pub fn measure(c: &Context, (family, n_s, n_fe, disc, form): (RkFamily, usize, usize, Discretisation, DcsForm)) -> Run {
    let set = Settings { dcs_form: form as i64, ..settings(family, n_s, n_fe, disc) };
    let label = format!("{} {n_s}, {n_fe} el., {}, {}", family.name(), form.name(), disc.name());
    let mut run = Run {
        label,
        seconds: f64::INFINITY,
        cost: f64::NAN,
        error: f64::NAN,
        check: f64::NAN,
        solved: false,
        exact: false,
        result: None,
        text: String::new(),
    };
    for again in [false, true] {
        if again && run.seconds > 0.1 {
            break;
        }
        let clock = Instant::now();
        let mut ocp = sliding_ocp(&set);
        match ocp.solve(&mut Control::default()) {
            Ok(r) => run.result = Some(r.clone()),
            Err(e) => {
                run.text = format!("refused: {e}");
                return run;
            }
        }
        run.seconds = run.seconds.min(clock.elapsed().as_secs_f64());
    }
    let Some(r) = &run.result else { return run };
    (run.cost, run.solved, run.exact) = (r.cost, r.outcome == Outcome::Solved, r.polish == Polish::Done);
    if let Some(a) = &r.accuracy {
        run.error = distance(&a.x_end[..2], &SLIDING_QT);
        run.check = resimulate(&r.controls, STAGES).map_or(f64::NAN, |(x, _)| distance(&x, &a.x_end));
    }
    let polish = format!("{:?}", r.polish).to_lowercase();
    run.text = format!(
        "{} iterations, {} factorisations, {}, {polish}, {} switches",
        r.stats.iterations,
        r.stats.factorisations,
        r.outcome.name(),
        r.trajectory.switches.len()
    );
    let times: Vec<f64> = r.trajectory.switches.iter().map(|s| s.t).collect();
    let m = Measured { n_sim: STAGES, error: run.error, wall_s: run.seconds, stats: r.stats, outcome: r.outcome };
    let o = m.object("sliding-ocp", &set).text("dcs_form", form.name()).num("cost", r.cost).text("polish", &polish);
    let o = o.num("check", run.check).num("build_s", r.time_build).num("eval_s", r.stats.time_eval);
    let o = o.num("linalg_s", r.stats.time_linalg);
    c.record(&o.list("switch_times", &times).list("controls", &r.controls));
    run
}

pub fn run(c: &Context) {
    // constant controls with a reference solution of 20 digits: reference/codim2.json
    let exact = [-1.0, -0.450_012_233_952_023_67, -2.0, -1.6];
    let check = resimulate(&[-0.5, -0.4].repeat(STAGES), STAGES);
    let check_error = check.map_or(f64::NAN, |(x, _)| distance(&x, &exact));
    c.say(&format!("problem (7.51), 6 control stages; the simulator that checks is off by {check_error:.1e}"));
    for disc in BOTH {
        if let Some(r) = measure(c, (RkFamily::RadauIia, 2, 6, disc, DcsForm::Stewart)).result {
            plot_solution(c, &r, disc.name());
        }
    }
    sliding_families::run(c);
}

fn samples(tr: &Trajectory, i: usize) -> Vec<(f64, f64)> {
    let mut x = vec![0.0; tr.nx()];
    (0..=400)
        .filter_map(|k| {
            let t = T * f64::from(k) / 400.0;
            tr.state(t, &mut x).ok().map(|()| (t, x[i]))
        })
        .collect()
}

fn plot_solution(c: &Context, r: &OcpResult, name: &str) {
    let title = format!("Problem (7.51), {name}, Radau IIA 2, 6 elements per stage");
    let q = [samples(&r.trajectory, 0), samples(&r.trajectory, 1)];
    let mut phase = Plot::new(&title, "q1", "q2");
    phase.add("trajectory", Mark::Line, q[0].iter().zip(&q[1]).map(|(a, b)| (a.1, b.1)).collect());
    let grid = |from: f64, to: f64| (0..=100).map(move |k| from + (to - from) * f64::from(k) / 100.0);
    phase.add("c1 = 0", Mark::Dashed, grid(-0.9, 1.1).map(|y| (-0.15 * y * y, y)).collect());
    phase.add("c2 = 0", Mark::Dashed, grid(-0.7, 2.2).map(|x| (x, 0.05 * x * x * x)).collect());
    c.plot(&phase, &format!("sliding-ocp-phase-{name}.svg"));
    let mut states = Plot::new(&title, "t", "states");
    for (i, label) in ["q1", "q2", "v1", "v2"].into_iter().enumerate() {
        states.add(label, Mark::Line, samples(&r.trajectory, i));
    }
    for s in &r.trajectory.switches {
        states.add_coloured("", Mark::Dashed, 8, vec![(s.t, -2.0), (s.t, 2.0)]);
    }
    c.plot(&states, &format!("sliding-ocp-states-{name}.svg"));
    let mut controls = Plot::new(&title, "t", "u");
    for i in 0..2 {
        let at = |k: usize| (T * k as f64 / STAGES as f64, r.controls[2 * k.min(STAGES - 1) + i]);
        controls.add(&format!("u{}", i + 1), Mark::Steps, (0..=STAGES).map(at).collect());
    }
    c.plot(&controls, &format!("sliding-ocp-controls-{name}.svg"));
    let mut steps = Plot::new(&title, "t", "h");
    let mut h: Vec<(f64, f64)> = r.trajectory.elements.iter().map(|e| (e.t, e.h)).collect();
    if let Some(last) = r.trajectory.elements.last() {
        h.push((last.t + last.h, last.h));
    }
    let top = h.iter().map(|p| p.1).fold(0.0, f64::max);
    steps.add("h", Mark::Steps, h);
    for s in &r.trajectory.switches {
        steps.add_coloured("", Mark::Dashed, 8, vec![(s.t, 0.0), (s.t, top)]);
    }
    c.plot(&steps, &format!("sliding-ocp-steps-{name}.svg"));
}
