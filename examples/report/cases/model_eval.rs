//! Ways to evaluate a model: time of one evaluation, of batches, and of whole solves; the part of evaluation in them.

use super::{settings, short, simulate};
use crate::expression_models as written;
use crate::json::{Object, Table};
use crate::models as by_hand;
use crate::{compiled, Context};
use std::hint::black_box;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::Arc;
use std::time::Instant;
use switchback::expr::{ExprFunction, Tape, LANES};
use switchback::func::{Dims, EvalResult, Function, Point};
use switchback::linalg::csc::Pattern;
use switchback::model::Built;
use switchback::nlp::Control;
use switchback::ocp::Ocp;
use switchback::settings::{Discretisation, RkFamily, Settings};
use switchback::system::{Regions, SharedFunction, Subsystem, System};

/// Solves of every kind, by turns.
const REPEAT: usize = 31;
/// Points of a batch.
const N: usize = 64;

struct Problem {
    name: &'static str,
    by_hand: Option<System>,
    written: Built,
    x0: Vec<f64>,
    t_end: f64,
    n_sim: usize,
}

fn problems() -> Vec<Problem> {
    let p = |name, by_hand, written, x0: &[f64], t_end, n_sim| Problem {
        name,
        by_hand,
        written,
        x0: x0.to_vec(),
        t_end,
        n_sim,
    };
    let pi = by_hand::PI;
    vec![
        p("oscillator", Some(by_hand::oscillator()), written::oscillator(), &by_hand::OSCILLATOR_X0, pi / 2.0, 30),
        p("sliding mode", Some(by_hand::sliding_mode()), written::sliding_mode(), &[1.0, 0.4, 0.0, 0.0], 1.0, 40),
        p("blocks", Some(by_hand::blocks()), written::blocks(), &[-1.0, 1.0, -1.0, 1.0, 1.0, 0.5], 3.0, 40),
        p("coulomb", Some(by_hand::coulomb()), written::coulomb(), &[1.0, 0.0], 4.0, 60),
        p("stick-slip", Some(by_hand::stick_slip()), written::stick_slip(), &[0.5, 0.0], 4.0, 60),
        p("arm", None, written::arm(), &[1.2, -0.4, 0.0, 0.0], 2.0, 40),
    ]
}

/// Functions of a system: smooth part, then modes and switching functions of every subsystem.
fn functions(s: &System) -> Vec<SharedFunction> {
    let mut out: Vec<SharedFunction> = s.f0().into_iter().cloned().collect();
    for sub in s.subsystems() {
        out.push(sub.modes.clone());
        match &sub.regions {
            Regions::Signs { psi, .. } => out.push(psi.clone()),
            Regions::Indicators(g) => out.push(g.clone()),
        }
    }
    out
}

/// The system with other functions, in the order of [`functions`].
fn replaced(s: &System, functions: Vec<SharedFunction>) -> System {
    let d = s.dims();
    let mut next = functions.into_iter();
    let mut take = || next.next().expect("a function for each");
    let mut out = System::new(d.x, d.u, d.p).expect("sizes of a system");
    if s.f0().is_some() {
        out.set_f0(take()).expect("a function like the old one");
    }
    for sub in s.subsystems() {
        let modes = take();
        let regions = match &sub.regions {
            Regions::Signs { signs, .. } => Regions::Signs { psi: take(), signs: signs.clone() },
            Regions::Indicators(_) => Regions::Indicators(take()),
        };
        out.add_subsystem(Subsystem { rows: sub.rows.clone(), modes, n_modes: sub.n_modes, regions })
            .expect("functions like the old ones");
    }
    out
}

/// Nanoseconds of one run, the best of several.
fn time(mut run: impl FnMut()) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..15 {
        let clock = Instant::now();
        for _ in 0..400 {
            run();
        }
        best = best.min(clock.elapsed().as_secs_f64() / 400.0);
    }
    1e9 * best
}

/// Nanoseconds of values, Jacobians and Hessians of functions, one after the other; what is constant is not called.
fn single(functions: &[SharedFunction], x: &[f64]) -> [f64; 3] {
    let mut sums = [0.0; 3];
    for f in functions {
        let u = vec![0.3; f.dims().u];
        let at = Point { t: 0.4, x, u: &u, p: &[] };
        let (n_jac, n_hess) = (f.jac_pattern().nnz(), f.hess_pattern().nnz());
        let mut work = vec![0.0; f.work_len()];
        let mut out = vec![0.0; f.n_out().max(n_jac).max(n_hess)];
        let weights = vec![0.7; f.n_out()];
        sums[0] += time(|| {
            black_box(f.value(black_box(&at), &mut out, &mut work).is_ok());
        });
        if n_jac > 0 {
            sums[1] += time(|| {
                black_box(f.jacobian(black_box(&at), &mut out, &mut work).is_ok());
            });
        }
        if n_hess > 0 {
            sums[2] += time(|| {
                black_box(f.hessian(black_box(&at), &weights, &mut out, &mut work).is_ok());
            });
        }
    }
    sums
}

/// Nanoseconds per point of all programs of a model in batches.
fn batch(functions: &[Arc<ExprFunction>], x: &[f64]) -> [f64; 3] {
    let mut sums = [0.0; 3];
    for f in functions {
        let u = vec![0.3; f.dims().u];
        let tapes: [(&Tape, usize); 3] = [(f.value_tape(), 0), (f.jacobian_tape(), 0), (f.hessian_tape(), f.n_out())];
        for (sum, (tape, n_weights)) in sums.iter_mut().zip(tapes) {
            if tape.n_out() == 0 {
                continue;
            }
            let weights = vec![0.7; n_weights];
            let mut out = vec![0.0; tape.n_out() * N];
            let mut work = vec![[0.0; LANES]; tape.work_len()];
            let z: Vec<f64> = x.iter().chain(&u).chain(&[0.4]).chain(&weights).copied().collect();
            let inputs: Vec<f64> = z.iter().flat_map(|&v| [v; N]).collect();
            *sum += time(|| {
                black_box(tape.run_batch(N, black_box(&inputs), &mut out, &mut work).is_ok());
            }) / N as f64;
        }
    }
    sums
}

/// A function that counts its calls: values, Jacobians, Hessians.
struct Counted {
    f: SharedFunction,
    calls: [AtomicU64; 3],
}

impl Counted {
    fn count(&self, kind: usize) {
        self.calls[kind].fetch_add(1, Ordering::Relaxed);
    }
}

impl Function for Counted {
    fn name(&self) -> &str {
        self.f.name()
    }
    fn dims(&self) -> Dims {
        self.f.dims()
    }
    fn n_out(&self) -> usize {
        self.f.n_out()
    }
    fn jac_pattern(&self) -> &Pattern {
        self.f.jac_pattern()
    }
    fn hess_pattern(&self) -> &Pattern {
        self.f.hess_pattern()
    }
    fn work_len(&self) -> usize {
        self.f.work_len()
    }
    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.count(0);
        self.f.value(at, out, work)
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.count(1);
        self.f.jacobian(at, out, work)
    }
    fn value_rows(&self, at: &Point, rows: Range<usize>, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.count(0);
        self.f.value_rows(at, rows, out, work)
    }
    fn jacobian_rows(&self, at: &Point, rows: Range<usize>, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.count(1);
        self.f.jacobian_rows(at, rows, out, work)
    }
    fn hessian(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.count(2);
        self.f.hessian(at, weights, out, work)
    }
}

/// Nanoseconds of a solve that are spent in functions of the model: calls times the time of one.
fn evaluation(s: &System, x: &[f64], solve: impl FnOnce(&System)) -> f64 {
    let all: Vec<Arc<Counted>> =
        functions(s).into_iter().map(|f| Arc::new(Counted { f, calls: Default::default() })).collect();
    solve(&replaced(s, all.iter().map(|c| c.clone() as SharedFunction).collect()));
    let cost = |c: &Arc<Counted>| {
        let each = single(std::slice::from_ref(&c.f), x);
        c.calls.iter().zip(each).map(|(n, t)| n.load(Ordering::Relaxed) as f64 * t).sum::<f64>()
    };
    all.iter().map(cost).sum()
}

/// Runs all ways by turns: the best seconds of each, and the median of the ratios to the first, which a busy machine
/// spoils least.
fn by_turns(n: usize, mut run: impl FnMut(usize) -> f64) -> Vec<(f64, f64)> {
    let all: Vec<Vec<f64>> = (0..REPEAT).map(|_| (0..n).map(&mut run).collect()).collect();
    let figures = |k: usize| {
        let best = all.iter().map(|w| w[k]).fold(f64::INFINITY, f64::min);
        let mut ratios: Vec<f64> = all.iter().map(|w| w[k] / w[0]).collect();
        ratios.sort_by(f64::total_cmp);
        (best, ratios[REPEAT / 2])
    };
    (0..n).map(figures).collect()
}

/// A way to evaluate a model.
struct Way {
    name: &'static str,
    system: System,
}

fn ways(c: &Context, p: &Problem) -> Vec<Way> {
    let mut out = vec![Way { name: "tape", system: p.written.system.clone() }];
    let mut add = |name, system| out.push(Way { name, system });
    if let Some(s) = &p.by_hand {
        add("callback", s.clone());
    }
    let model = p.name.replace([' ', '-'], "_");
    if let Some(f) = compiled::own(&model, &p.written.functions) {
        add("own C", replaced(&p.written.system, f));
    }
    if let Some(folder) = &c.casadi {
        let dims: Vec<Dims> = functions(&p.written.system).iter().map(|f| f.dims()).collect();
        let [interpreted, compiled] = compiled::casadi(folder, &model, &dims);
        let at = |f: &SharedFunction| {
            let (mut out, mut work) = (vec![0.0; f.n_out()], vec![0.0; f.work_len()]);
            let u = vec![0.3; f.dims().u];
            f.value(&Point { t: 0.4, x: &p.x0, u: &u, p: &[] }, &mut out, &mut work).expect("defined where it starts");
            out
        };
        for (k, f) in functions(&p.written.system).iter().enumerate() {
            for other in [&interpreted[k], &compiled[k]] {
                let distance = super::distance(&at(f), &at(other));
                assert!(distance < 1e-12, "{model}_{k} of the folder is another function: {distance}");
            }
        }
        add("CasADi VM", replaced(&p.written.system, interpreted));
        add("CasADi C", replaced(&p.written.system, compiled));
    }
    out
}

/// Seconds of the sliding-mode problem, building excluded, and its cost.
fn optimal_control(set: &Settings, expressions: bool) -> (f64, f64) {
    let mut o = if expressions {
        let built = written::sliding_mode();
        let mut o = Ocp::new(&built.system, 4.0, 6, set).expect("the settings fit");
        o.set_lagrange(written::sliding_cost()).expect("L fits");
        o.set_x0(&by_hand::SLIDING_X0).expect("four states");
        let inf = by_hand::INF;
        o.set_x_bounds(&[-inf, -inf, -2.0, -2.0], &[inf, inf, 2.0, 2.0]).expect("four states");
        o.set_u_bounds(&[-10.0; 2], &[10.0; 2]).expect("two controls");
        let e = by_hand::affine("e", built.system.dims(), &[0.0; 2], &[(0, 0, 1.0), (1, 1, 1.0)]);
        o.add_terminal(e, &by_hand::SLIDING_QT, &by_hand::SLIDING_QT).expect("e fits");
        o
    } else {
        by_hand::sliding_ocp(set)
    };
    let clock = Instant::now();
    let r = o.solve(&mut Control::default()).expect("the problem is well posed");
    (clock.elapsed().as_secs_f64(), r.cost)
}

pub fn run(c: &Context) {
    let mut table =
        Table::new(&["model", "way", "value ns", "Jacobian ns", "Hessian ns", "solve s", "ratio", "distance"]);
    let mut shares = Table::new(&["model", "evaluation of a solve"]);
    let set = settings(RkFamily::RadauIia, 2, 3, Discretisation::Fesd);
    for p in problems() {
        let ways = ways(c, &p);
        let mut ends = vec![Vec::new(); ways.len()];
        let solves = by_turns(ways.len(), |k| {
            let (_, x, wall) = simulate(&ways[k].system, &set, &p.x0, p.t_end, p.n_sim);
            ends[k] = x;
            wall
        });
        let mut record = |way: &str, ns: [f64; 3], solve: Option<((f64, f64), f64)>| {
            let mut o = Object::new()
                .text("case", "model-eval")
                .text("model", p.name)
                .text("way", way)
                .num("value_ns", ns[0])
                .num("jacobian_ns", ns[1])
                .num("hessian_ns", ns[2]);
            let mut row = vec![p.name.to_owned(), way.to_owned()];
            row.extend(ns.map(|v| format!("{v:.0}")));
            if let Some(((wall, ratio), distance)) = solve {
                o = o.num("solve_s", wall).num("solve_ratio", ratio).num("distance", distance);
                row.extend([format!("{wall:.4}"), format!("{ratio:.3}"), short(distance)]);
            } else {
                row.extend(["", "", ""].map(str::to_owned));
            }
            c.record(&o);
            table.row(row);
        };
        for (k, way) in ways.iter().enumerate() {
            let distance = super::distance(&ends[0], &ends[k]);
            record(way.name, single(&functions(&way.system), &p.x0), Some((solves[k], distance)));
        }
        record("batch", batch(&p.written.functions, &p.x0), None);
        let spent = evaluation(&p.written.system, &p.x0, |s| {
            let mut sim = switchback::sim::Simulator::new(s, &set).expect("the settings fit the system");
            sim.set_state(0.0, &p.x0).expect("the state fits");
            sim.run(p.t_end, p.n_sim, &mut Control::default()).expect("the run is well posed");
        });
        let share = 1e-9 * spent / solves[0].0;
        c.record(&Object::new().text("case", "model-eval").text("model", p.name).num("evaluation_share", share));
        shares.row(vec![p.name.to_owned(), format!("{:.1} %", 100.0 * share)]);
    }
    let set = settings(RkFamily::RadauIia, 2, 2, Discretisation::Fesd);
    let mut costs = [0.0; 2];
    let solves = by_turns(2, |k| {
        let (wall, cost) = optimal_control(&set, k == 0);
        costs[k] = cost;
        wall
    });
    for (k, way) in ["tape", "callback"].into_iter().enumerate() {
        let distance = (costs[0] - costs[k]).abs();
        c.record(
            &Object::new()
                .text("case", "model-eval")
                .text("model", "sliding ocp")
                .text("way", way)
                .num("solve_s", solves[k].0)
                .num("solve_ratio", solves[k].1)
                .num("distance", distance),
        );
        let mut row = vec!["sliding ocp".to_owned(), way.to_owned()];
        row.extend(["", "", ""].map(str::to_owned));
        row.extend([format!("{:.4}", solves[k].0), format!("{:.3}", solves[k].1), short(distance)]);
        table.row(row);
    }
    c.say(
        "Ways to evaluate a model: all functions at one point (batch: per point of 64); ratios of solves to the tape",
    );
    c.say(&table.text());
    c.say("Evaluation of tapes in a simulation, building included: calls times the time of one");
    c.say(&shares.text());
}
