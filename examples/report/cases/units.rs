//! Many units that switch: what a switch costs as their number grows.

use super::short;
use crate::json::{Object, Table};
use crate::Context;
use std::time::Instant;
use switchback::event::{Engine, Options, Progress};
use switchback::expr::{Expr, Graph};
use switchback::model::{Built, Model, Transition};
use switchback::system::Direction::{Falling, Rising};
use switchback::system::Rule;

/// Numbers between 0 and 1 that repeat on every machine.
fn part(i: usize, of: usize) -> f64 {
    (0.618_033_988_75 * (i + 1) as f64 * (of + 1) as f64 + 0.31 * of as f64).fract()
}

/// Units of one kind: the model, its initial state, and the time it is followed for.
struct Units {
    built: Built,
    x0: Vec<f64>,
    t_end: f64,
}

/// Rooms with a thermostat with hysteresis each, `x' = k (T(t) - x) + c (neighbours - x) + 25 h`.
fn hystereses(n: usize, coupling: f64) -> Units {
    let g = Graph::new();
    let outside = 8.0 + 10.0 * (1.3 * g.t()).sin();
    let set = |i: usize| 18.0 + 4.0 * part(i, 0);
    let mut rhs: Vec<Expr> = Vec::new();
    for i in 0..n {
        let mut d = (0.8 + 0.4 * part(i, 1)) * (outside - g.x(i)) + 25.0 * g.x(n + i);
        for j in [i.checked_sub(1), Some(i + 1).filter(|j| *j < n)].into_iter().flatten().filter(|_| coupling > 0.0) {
            d += coupling * (g.x(j) - g.x(i));
        }
        rhs.push(d);
    }
    rhs.extend((0..n).map(|_| g.constant(0.0)));
    let mut m = Model::from_rhs("rooms", 0, 0, &rhs).expect("the model is well formed");
    m.set_discrete(&vec![0.0; n]).expect("as many as states");
    for i in 0..n {
        let below = set(i) - g.x(i);
        for (guard, direction, from, to) in [(below - 0.5, Rising, 0.0, 1.0), (below + 0.5, Falling, 1.0, 0.0)] {
            let (from, to) = (vec![(n + i, from)], vec![(n + i, to)]);
            m.add_transition(Transition {
                guard: guard.id(),
                direction,
                from,
                reset: vec![],
                to,
                rule: Rule::default(),
            });
        }
    }
    let x0 = (0..n).map(|i| set(i) + 0.8 * part(i, 2) - 0.4).chain((0..n).map(|_| 0.0)).collect();
    Units { built: m.build(&g).expect("the model is well formed"), x0, t_end: 2.0 }
}

/// Integrate-and-fire neurons, `v' = (I - v) / τ`, that move others when they fire.
fn neurons(n: usize, targets: impl Fn(usize) -> Vec<usize>) -> Units {
    let g = Graph::new();
    let rhs: Vec<Expr> =
        (0..n).map(|i| (1.05 + 0.3 * part(i, 0) - g.x(i)) * (1.0 / (1.0 + 0.2 * part(i, 1)))).collect();
    let mut m = Model::from_rhs("neurons", 0, 0, &rhs).expect("the model is well formed");
    for i in 0..n {
        let mut reset = vec![(i, (g.x(i) - 1.0).id())];
        let mut moved = targets(i);
        moved.sort_unstable();
        moved.dedup();
        reset.extend(moved.into_iter().filter(|j| *j != i).map(|j| (j, (g.x(j) + 0.02 * (part(i + j, 2) - 0.5)).id())));
        m.add_transition(Transition {
            guard: (g.x(i) - 1.0).id(),
            direction: Rising,
            from: vec![],
            reset,
            to: vec![],
            rule: Rule::default(),
        });
    }
    let x0 = (0..n).map(|i| part(i, 3)).collect();
    Units { built: m.build(&g).expect("the model is well formed"), x0, t_end: 10.0 }
}

/// Rooms whose heaters are relays without hysteresis: they slide at their set points, or are too warm.
fn relays(n: usize) -> Units {
    let g = Graph::new();
    let outside = 8.0 + 10.0 * (1.3 * g.t()).sin();
    let mut rhs: Vec<Expr> = Vec::new();
    for i in 0..n {
        let set = 20.0 + 0.1 * (i % 4) as f64 + 0.01 * (i as f64).sin();
        let mut d = (1.0 + 0.05 * (i % 5) as f64) * (outside - g.x(i));
        for j in [i.checked_sub(1), Some(i + 1).filter(|j| *j < n)].into_iter().flatten() {
            d += 0.5 * (g.x(j) - g.x(i));
        }
        rhs.push(d + (9.0 + 0.3 * (i % 3) as f64) * (1.0 - (g.x(i) - set).sign()));
    }
    let m = Model::from_rhs("relays", 0, 0, &rhs).expect("the model is well formed");
    let x0 = (0..n).map(|i| 18.0 + 2.0 * (2.1 * i as f64).sin()).collect();
    Units { built: m.build(&g).expect("the model is well formed"), x0, t_end: 6.0 }
}

/// Families, with the largest number of units.
type Family = (&'static str, usize, fn(usize) -> Units);

const FAMILIES: [Family; 6] = [
    ("hystereses apart", 3000, |n| hystereses(n, 0.0)),
    ("hystereses in a row", 3000, |n| hystereses(n, 0.1)),
    ("neurons in a ring", 10_000, |n| neurons(n, |i| vec![(i + 1) % n, (i + n - 1) % n])),
    ("neurons, ten each", 10_000, |n| neurons(n, |i| (1..11).map(|k| (i * 7 + k * k * 131) % n).collect())),
    ("neurons, all to one", 3000, |n| neurons(n, |_| vec![0])),
    ("relays in a row", 3000, relays),
];

/// Numbers of units.
const SIZES: [usize; 6] = [10, 100, 300, 1000, 3000, 10_000];

/// Cost per switch by family and number of units; `SWITCHBACK_UNITS` bounds the number.
pub fn run(c: &Context) {
    let most = std::env::var("SWITCHBACK_UNITS").ok().and_then(|v| v.parse().ok()).unwrap_or(usize::MAX);
    let only = std::env::var("SWITCHBACK_FAMILY").ok();
    let rtol = 1e-6;
    let head = ["units", "n", "build s", "run s", "switches", "us/switch", "steps", "rejected", "evaluations", "end"];
    let mut table = Table::new(&[&head[..], &["sum"]].concat());
    for (family, largest, make) in FAMILIES.iter().filter(|f| only.as_ref().is_none_or(|o| f.0.contains(o.as_str()))) {
        for n in SIZES.into_iter().filter(|n| n <= largest && *n <= most) {
            let clock = Instant::now();
            let units = make(n);
            let build = clock.elapsed().as_secs_f64();
            let options = Options { max_log: 1, ..Options::with_tolerance(rtol, 1e-2 * rtol) };
            let mut e = Engine::new(&units.built.system, &options).expect("the options fit");
            e.reinit(0.0, &units.x0).expect("the state fits");
            let clock = Instant::now();
            // what has cost a minute is not followed to its end
            while e.step_on(units.t_end).expect("no function asks to stop") != Progress::Done {
                if clock.elapsed().as_secs_f64() > 60.0 {
                    break;
                }
            }
            let seconds = clock.elapsed().as_secs_f64();
            let s = e.stats();
            let switches = s.switches + s.jumps;
            let each = seconds / switches.max(1) as f64;
            let sum: f64 = e.state().iter().take(n).sum();
            table.row(vec![
                (*family).into(),
                n.to_string(),
                format!("{build:.2}"),
                format!("{seconds:.3}"),
                switches.to_string(),
                short(1e6 * each),
                s.steps.to_string(),
                s.rejections.to_string(),
                s.evaluations.to_string(),
                format!("{} {:.3}", e.outcome().name(), e.time()),
                format!("{sum:.8}"),
            ]);
            let o = Object::new().text("case", "units").text("units", family).int("n", n).num("seconds", seconds);
            let o = o.int("switches", switches).num("seconds_per_switch", each).num("build", build);
            c.record(&o.int("steps", s.steps).int("evaluations", s.evaluations).text("outcome", e.outcome().name()));
        }
    }
    c.say("many units: what a switch costs");
    c.say(&table.text());
}
