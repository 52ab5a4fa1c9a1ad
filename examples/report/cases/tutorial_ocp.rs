//! The tutorial problem (7.35) from 200 starts: artificial optima without switch detection, none with it
//! (Figs. 5.3-5.5, 7.7-7.9).
//!
//! The starts come in two kinds. `guess` is the optimal control problem with a constant guess of the state.
//! `feasible` solves with the initial value fixed first, then sets it free at that point with a small
//! relaxation: the solver begins where an optimiser over simulations would, and stays in the valley it is in.

use super::{settings, short, Measured, BOTH};
use crate::json::Table;
use crate::models::{switching, tutorial_costs, tutorial_ocp, TUTORIAL_COST, TUTORIAL_X0};
use crate::svg::{Mark, Plot};
use crate::Context;
use std::time::Instant;
use switchback::dcs::Dcs;
use switchback::fesd::{Fesd, Options, Spec, Trajectory};
use switchback::mpcc::{MpccSettings, MpccSolver, Polish};
use switchback::nlp::{Control, Nlp, Outcome, Statistics};
use switchback::ocp::Ocp;
use switchback::settings::{Discretisation, RkFamily, Settings};

const STARTS: usize = 200;
const N_FE: usize = 20;

/// What a run found.
struct Found {
    x0: f64,
    cost: f64,
    stats: Statistics,
    outcome: Outcome,
    polish: Polish,
    /// Longest step over the nominal one.
    longest: f64,
}

/// Runs one start after the other on the same problem.
trait Runner {
    fn run(&mut self, start: f64) -> Found;
}

fn longest(tr: &Trajectory) -> f64 {
    tr.elements.iter().map(|e| e.h * N_FE as f64 / 2.0).fold(0.0, f64::max)
}

impl Runner for Ocp {
    fn run(&mut self, start: f64) -> Found {
        self.set_x_guess(&[0.0], &[start]).expect("one state");
        let r = self.solve(&mut Control::default()).expect("the problem is well posed");
        let x0 = r.trajectory.elements[0].x0[0];
        let longest = longest(&r.trajectory);
        Found { x0, cost: r.cost, stats: r.stats, outcome: r.outcome, polish: r.polish, longest }
    }
}

/// The two solves of a feasible start.
struct Feasible {
    problem: Fesd,
    solver: MpccSolver,
    sigma: f64,
}

impl Feasible {
    fn new(set: &Settings) -> Feasible {
        let [l, m] = tutorial_costs();
        let dcs = Dcs::stewart(&switching('a')).expect("the system is complete");
        let options = Options::from_settings(set).expect("the settings are valid");
        let spec = Spec { lagrange: Some(l), mayer: Some(m), ..Spec::new(dcs, options, vec![N_FE]) };
        let mut problem = Fesd::new(spec, 2.0).expect("the problem can be discretised");
        let solver = MpccSolver::new(&mut problem, MpccSettings::default()).expect("the structure can be analysed");
        Feasible { problem, solver, sigma: set.sigma_init }
    }
}

impl Runner for Feasible {
    fn run(&mut self, start: f64) -> Found {
        let p = &mut self.problem;
        let mut bounds = p.bounds();
        p.bound_initial(&mut bounds, &[start], &[start], 0.0);
        let mut w = vec![0.0; p.n()];
        p.guess(&mut w, 0.0, |_, x| x[0] = start, |_, _| ());
        self.solver.settings = MpccSettings::default();
        let fixed = self.solver.solve(p, &bounds, &w, &mut Control::default()).clone();
        p.bound_initial(&mut bounds, &[f64::NEG_INFINITY], &[f64::INFINITY], 0.0);
        let defaults = MpccSettings::default();
        let mu_init = defaults.mu_over_sigma * self.sigma;
        self.solver.settings = MpccSettings { sigma_init: self.sigma, mu_init, ..defaults };
        let s = self.solver.solve(p, &bounds, &fixed.x, &mut Control::default()).clone();
        let tableau = p.tableau().clone();
        let mut tr = Trajectory::new(&p.spec().dcs, &tableau);
        tr.append(p, &s.x, None, 0.0);
        let mut stats = s.stats;
        stats.iterations += fixed.stats.iterations;
        stats.factorisations += fixed.stats.factorisations;
        let cost = p.cost(&s.x).unwrap_or(f64::NAN);
        let x0 = tr.elements[0].x0[0];
        Found { x0, cost, stats, outcome: s.outcome, polish: s.polish, longest: longest(&tr) }
    }
}

pub fn run(c: &Context) {
    let mut table = Table::new(&[
        "discretisation",
        "start",
        "sigma_init",
        "solved",
        "|x0-x0*|<=1e-6",
        "worst |x0-x0*|",
        "worst |V-V*|",
        "distinct x0",
        "mean ms",
        "mean it",
        "max it",
    ]);
    // what was missed, equal results together: text, how many, a start
    let mut missed: Vec<(Vec<String>, usize, f64)> = Vec::new();
    for kind in ["guess", "feasible"] {
        let sigmas: &[f64] = if kind == "guess" { &[1.0, 0.1, 1e-4] } else { &[1e-4] };
        let title = format!("Optimum found from each start ({kind}), problem (7.35)");
        let mut plot = Plot::new(&title, "x0 at the start", "x0 found");
        for disc in BOTH {
            for (i_sigma, &sigma) in sigmas.iter().enumerate() {
                let mut set = settings(RkFamily::GaussLegendre, 2, N_FE, disc);
                set.sigma_init = sigma;
                let mut runner: Box<dyn Runner> = match kind {
                    "guess" => Box::new(tutorial_ocp(&set)),
                    _ => Box::new(Feasible::new(&set)),
                };
                let (mut points, mut worst, mut worst_cost) = (Vec::new(), 0f64, 0f64);
                let (mut solved, mut near, mut seconds, mut its, mut most) = (0, 0, 0.0, 0, 0);
                for k in 0..STARTS {
                    let start = -2.0 + 1.2 * k as f64 / (STARTS - 1) as f64;
                    let clock = Instant::now();
                    let r = runner.run(start);
                    let wall_s = clock.elapsed().as_secs_f64();
                    let error = (r.x0 - TUTORIAL_X0).abs();
                    let m = Measured { n_sim: 1, error, wall_s, stats: r.stats, outcome: r.outcome };
                    let polish = format!("{:?}", r.polish).to_lowercase();
                    let o = m.object("tutorial-ocp", &set).text("start", kind).num("sigma_init", sigma);
                    let o = o.num("x0_start", start).num("x0", r.x0).num("cost", r.cost);
                    c.record(&o.num("cost_error", (r.cost - TUTORIAL_COST).abs()).text("polish", &polish));
                    solved += usize::from(r.outcome == Outcome::Solved);
                    near += usize::from(error <= 1e-6);
                    worst = worst.max(error);
                    worst_cost = worst_cost.max((r.cost - TUTORIAL_COST).abs());
                    seconds += wall_s;
                    its += r.stats.iterations;
                    most = most.max(r.stats.iterations);
                    if r.outcome != Outcome::Solved || (disc == Discretisation::Fesd && error > 1e-6) {
                        let text = vec![
                            disc.name().into(),
                            kind.into(),
                            sigma.to_string(),
                            format!("{:.6}", r.x0),
                            format!("{:.3}", r.longest),
                            r.outcome.name().into(),
                            polish,
                        ];
                        match missed.iter_mut().find(|m| m.0 == text) {
                            Some(m) => m.1 += 1,
                            None => missed.push((text, 1, start)),
                        }
                    }
                    points.push((start, r.x0));
                }
                let mut distinct: Vec<f64> = points.iter().map(|p| p.1).collect();
                distinct.sort_by(f64::total_cmp);
                distinct.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
                table.row(vec![
                    disc.name().into(),
                    kind.into(),
                    sigma.to_string(),
                    format!("{solved}/{STARTS}"),
                    format!("{near}/{STARTS}"),
                    short(worst),
                    short(worst_cost),
                    distinct.len().to_string(),
                    format!("{:.2}", 1e3 * seconds / STARTS as f64),
                    format!("{:.1}", its as f64 / STARTS as f64),
                    most.to_string(),
                ]);
                let colour = i_sigma + 3 * usize::from(disc == Discretisation::Standard);
                plot.add_coloured(&format!("{}, sigma {sigma}", disc.name()), Mark::Dots, colour, points);
            }
        }
        plot.add_coloured("x0*", Mark::Dashed, 8, vec![(-2.0, TUTORIAL_X0), (-0.8, TUTORIAL_X0)]);
        c.plot(&plot, &format!("tutorial-ocp-{kind}.svg"));
    }
    c.say("tutorial problem (7.35), Gauss-Legendre n_s = 2, 20 elements");
    c.say(&table.text());
    if !missed.is_empty() {
        let head =
            ["discretisation", "start", "sigma_init", "x0", "h/h_mean", "outcome", "polish", "runs", "first start"];
        let mut listed = Table::new(&head);
        for (mut text, n, start) in missed {
            text.extend([n.to_string(), format!("{start:.6}")]);
            listed.row(text);
        }
        c.say(&format!("not solved, or with switch detection elsewhere:\n{}", listed.text()));
    }
}
