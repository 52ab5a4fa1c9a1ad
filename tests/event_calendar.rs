//! Systems of many units: what happens in one of them ends no step of the others. The answers are those of runs whose steps end for all states,
//! which those that record derivatives do.

use switchback::event::{Engine, Kind, Options, Outcome, Run};
use switchback::expr::{Expr, Graph};
use switchback::model::{Model, Transition};
use switchback::system::Direction::{Falling, Rising};
use switchback::system::{Effect, Rule, System, Trigger};

const RTOL: f64 = 1e-7;

/// Numbers between 0 and 1.
fn part(i: usize, of: usize) -> f64 {
    (0.618_033_988_75 * (i + 1) as f64 * (of + 1) as f64 + 0.31 * of as f64).fract()
}

fn run(system: &System, x0: &[f64], end: f64, options: &Options) -> Run {
    let mut e = Engine::new(system, options).unwrap();
    e.reinit(0.0, x0).unwrap();
    e.advance(end).unwrap();
    e.into_run()
}

/// By units, and with steps that end for all states, with far smaller tolerances.
fn both(system: &System, x0: &[f64], end: f64) -> [Run; 2] {
    [(false, RTOL), (true, 1e-3 * RTOL)].map(|(adjoint, rtol)| {
        run(system, x0, end, &Options { dense: true, adjoint, ..Options::with_tolerance(rtol, 1e-2 * rtol) })
    })
}

/// The same motion, but for the tolerances.
fn agree([units, all]: &[Run; 2], size: f64) {
    assert_eq!((units.outcome, all.outcome), (Outcome::Reached, Outcome::Reached), "{} {}", units.reason, all.reason);
    let close = |a: f64, b: f64, what: &str| assert!((a - b).abs() <= 300.0 * RTOL * size, "{what}: {a} and {b}");
    assert_eq!(units.stats.jumps, all.stats.jumps);
    assert_eq!(units.stats.switches, all.stats.switches);
    for (a, b) in units.x.iter().zip(&all.x) {
        close(*a, *b, "state");
    }
    for (k, (a, b)) in units.jumps.iter().zip(&all.jumps).enumerate() {
        close(a.t, b.t, "time of a transition");
        assert_eq!(a.simultaneous, b.simultaneous, "transition {k} at {}", a.t);
    }
    let transitions = |r: &Run| {
        let mut all: Vec<usize> = r.jumps.iter().map(|j| j.transition).collect();
        all.sort_unstable();
        all
    };
    assert_eq!(transitions(units), transitions(all));
    for (a, b) in units.switches.iter().zip(&all.switches) {
        close(a.t, b.t, "time of a switch");
    }
    let (mut x, mut y) = (vec![0.0; units.x.len()], vec![0.0; units.x.len()]);
    let events: Vec<f64> = all.jumps.iter().map(|j| j.t).chain(all.switches.iter().map(|s| s.t)).collect();
    for k in 0..=200 {
        let t = all.t * f64::from(k) / 200.0;
        // states jump there
        if events.iter().any(|e| (e - t).abs() < 1e4 * RTOL) {
            continue;
        }
        units.path.as_ref().unwrap().eval(t, 0, &mut x).unwrap();
        all.path.as_ref().unwrap().eval(t, 0, &mut y).unwrap();
        x.iter().zip(&y).for_each(|(a, b)| close(*a, *b, "dense output"));
    }
}

/// Rooms with hysteresis, a neighbour on either side.
fn rooms(n: usize, coupling: f64) -> (System, Vec<f64>) {
    let g = Graph::new();
    let outside = 8.0 + 10.0 * (1.3 * g.t()).sin();
    let set = |i: usize| 18.0 + 4.0 * part(i, 0);
    let mut rhs: Vec<Expr> = Vec::new();
    for i in 0..n {
        let mut d = (0.8 + 0.4 * part(i, 1)) * (outside - g.x(i)) + 25.0 * g.x(n + i);
        for j in [i.checked_sub(1), Some(i + 1).filter(|j| *j < n)].into_iter().flatten() {
            d += coupling * (g.x(j) - g.x(i));
        }
        rhs.push(d);
    }
    rhs.extend((0..n).map(|_| g.constant(0.0)));
    let mut m = Model::from_rhs("rooms", 0, 0, &rhs).unwrap();
    m.set_discrete(&vec![0.0; n]).unwrap();
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
    (m.build(&g).unwrap().system, x0)
}

/// Neurons in a ring that move their neighbours by `weight` when they fire.
fn neurons(n: usize, weight: f64, start: impl Fn(usize) -> f64) -> (System, Vec<f64>) {
    let g = Graph::new();
    let rhs: Vec<Expr> = (0..n).map(|i| 1.05 + 0.3 * part(i, 0) - g.x(i)).collect();
    let mut m = Model::from_rhs("neurons", 0, 0, &rhs).unwrap();
    for i in 0..n {
        let beside = [(i + 1) % n, (i + n - 1) % n].map(|j| (j, (g.x(j) + weight).id()));
        let reset = [&[(i, (g.x(i) - 1.0).id())][..], &beside].concat();
        m.add_transition(Transition {
            guard: (g.x(i) - 1.0).id(),
            direction: Rising,
            from: vec![],
            reset,
            to: vec![],
            rule: Rule::default(),
        });
    }
    (m.build(&g).unwrap().system, (0..n).map(start).collect())
}

#[test]
fn rooms_apart_and_in_a_row_move_as_with_steps_for_all() {
    for coupling in [0.0, 0.1, 2.0] {
        let (system, x0) = rooms(30, coupling);
        let runs = both(&system, &x0, 1.0);
        assert!(runs[0].stats.jumps > 100);
        agree(&runs, 20.0);
    }
}

#[test]
fn neurons_fire_each_other() {
    for weight in [-0.05, 0.05, 0.3] {
        let (system, x0) = neurons(40, weight, |i| part(i, 3));
        let runs = both(&system, &x0, 4.0);
        assert_eq!(weight > 0.2, runs[0].jumps.iter().filter(|j| j.simultaneous).count() > 50, "{weight}");
        agree(&runs, 3.0);
    }
}

/// What happens at one time in many units is no accumulation and no endless cascade.
#[test]
fn units_may_switch_together() {
    let (system, _) = rooms(1, 0.0);
    assert_eq!(system.dims().x, 2);
    let g = Graph::new();
    let n = 70;
    let rhs: Vec<Expr> = (0..n).map(|_| g.constant(1.0)).collect();
    let mut m = Model::from_rhs("together", 0, 0, &rhs).unwrap();
    for i in 0..n {
        let reset = vec![(i, (g.x(i) - 1.0).id())];
        m.add_transition(Transition {
            guard: (g.x(i) - 1.0).id(),
            direction: Rising,
            from: vec![],
            reset,
            to: vec![],
            rule: Rule::default(),
        });
    }
    let system = m.build(&g).unwrap().system;
    let r = run(&system, &vec![0.25; n], 10.0, &Options::default());
    assert_eq!((r.outcome, r.stats.jumps), (Outcome::Reached, 10 * n), "{}", r.reason);
    assert!(r.x.iter().all(|x| (x - 0.25).abs() < 1e-9), "{:?}", r.x);
    assert!(r.jumps.iter().all(|j| j.simultaneous));
}

/// Balls that bounce, each by itself: where one comes to rest its bounces accumulate.
#[test]
fn bounces_accumulate_in_one_of_many_units() {
    let g = Graph::new();
    let n = 20;
    let rhs: Vec<Expr> = (0..n).map(|i| g.x(n + i)).chain((0..n).map(|_| g.constant(-10.0))).collect();
    let mut m = Model::from_rhs("balls", 0, 0, &rhs).unwrap();
    for i in 0..n {
        let reset = vec![(n + i, (-0.5 * g.x(n + i)).id())];
        m.add_transition(Transition {
            guard: g.x(i).id(),
            direction: Falling,
            from: vec![],
            reset,
            to: vec![],
            rule: Rule::default(),
        });
    }
    let system = m.build(&g).unwrap().system;
    let height = |i: usize| 1.0 + i as f64;
    let x0: Vec<f64> = (0..n).map(height).chain((0..n).map(|_| 0.0)).collect();
    // the first flight, and two flights by (1 + 2 · 1/2 / (1 - 1/2)) of it
    let end = 3.0 * (2.0 * height(0) / 10.0f64).sqrt();
    let r = run(&system, &x0, 10.0, &Options::with_tolerance(RTOL, RTOL));
    assert_eq!(r.outcome, Outcome::Zeno, "{}", r.reason);
    assert!((r.t - end).abs() < 1e-4, "{} and not {end}", r.t);
    let before = run(&system, &x0, 0.9 * end, &Options::with_tolerance(RTOL, RTOL));
    for (i, x) in before.x[n / 2..n].iter().enumerate() {
        let fall = height(n / 2 + i) - 5.0 * before.t * before.t;
        assert!((x - fall).abs() < 1e-5, "ball {i}: {x} and not {fall}");
    }
}

/// Relays that slide beside thermostats with hysteresis, all coupled.
#[test]
fn sliding_units_and_others() {
    let g = Graph::new();
    let n = 24;
    let outside = 8.0 + 10.0 * (1.3 * g.t()).sin();
    let set = |i: usize| 18.0 + 4.0 * part(i, 0);
    let mut rhs: Vec<Expr> = Vec::new();
    for i in 0..n {
        let heater = if i % 6 == 0 { 12.0 * (1.0 - (g.x(i) - set(i)).sign()) } else { 25.0 * g.x(n + i) };
        let beside = 0.1 * (g.x((i + 1) % n) + g.x((i + n - 1) % n) - 2.0 * g.x(i));
        rhs.push((0.8 + 0.4 * part(i, 1)) * (outside - g.x(i)) + beside + heater);
    }
    rhs.extend((0..n).map(|_| g.constant(0.0)));
    let mut m = Model::from_rhs("mixed", 0, 0, &rhs).unwrap();
    m.set_discrete(&vec![0.0; n]).unwrap();
    for i in (0..n).filter(|i| i % 6 > 0) {
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
    let x0: Vec<f64> = (0..n).map(|i| set(i) + 0.8 * part(i, 2) - 0.4).chain((0..n).map(|_| 0.0)).collect();
    agree(&both(&m.build(&g).unwrap().system, &x0, 2.0), 20.0);
}

/// Relays without hysteresis in a row: they slide at their set points, one by one, and are too warm at times.
fn relays(n: usize, coupling: f64) -> (System, Vec<f64>) {
    let g = Graph::new();
    let outside = 8.0 + 10.0 * (1.3 * g.t()).sin();
    let mut rhs: Vec<Expr> = Vec::new();
    for i in 0..n {
        let set = 20.0 + 0.1 * (i % 4) as f64 + 0.01 * (i as f64).sin();
        let mut d = (1.0 + 0.05 * (i % 5) as f64) * (outside - g.x(i));
        for j in [i.checked_sub(1), Some(i + 1).filter(|j| *j < n)].into_iter().flatten() {
            d += coupling * (g.x(j) - g.x(i));
        }
        rhs.push(d + (9.0 + 0.3 * (i % 3) as f64) * (1.0 - (g.x(i) - set).sign()));
    }
    let m = Model::from_rhs("relays", 0, 0, &rhs).unwrap();
    (m.build(&g).unwrap().system, (0..n).map(|i| 18.0 + 2.0 * (2.1 * i as f64).sin()).collect())
}

/// The switches in their order, but for those of one time.
fn switches(r: &Run) -> Vec<(usize, Kind, Vec<usize>)> {
    let mut all: Vec<_> = r.switches.iter().map(|s| (s.subsystem, s.t, s.kind, s.after.clone())).collect();
    all.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    all.into_iter().map(|s| (s.0, s.2, s.3)).collect()
}

#[test]
fn relays_slide_one_by_one() {
    for coupling in [0.0, 0.5, 1.5] {
        let (system, x0) = relays(40, coupling);
        let runs = both(&system, &x0, 6.0);
        assert!(runs[0].stats.switches >= 80, "{}", runs[0].stats.switches);
        assert_eq!(switches(&runs[0]), switches(&runs[1]));
        // switches end few steps
        assert!(runs[0].stats.steps < runs[1].stats.steps / 2, "{} {}", runs[0].stats.steps, runs[1].stats.steps);
        agree(&runs, 20.0);
    }
}

/// Masses in a row, each with a relay on `x + v / 2`: a surface of two states, of which the relay drives one. Where `mixed`, it depends on the mass
/// beside it too, and their weights on each other.
fn masses(n: usize, mixed: f64) -> (System, Vec<f64>) {
    let g = Graph::new();
    let mut rhs: Vec<Expr> = (0..n).map(|i| g.x(n + i)).collect();
    for i in 0..n {
        let mut force = 0.9 * ((0.5 + part(i, 0)) * g.t() + part(i, 1)).sin();
        for j in [i.checked_sub(1), Some(i + 1).filter(|j| *j < n)].into_iter().flatten() {
            force += 0.4 * (g.x(j) - g.x(i));
        }
        let surface = g.x(i) + 0.5 * g.x(n + i) + mixed * g.x(n + (i + 1) % n);
        rhs.push(force - surface.sign());
    }
    let m = Model::from_rhs("masses", 0, 0, &rhs).unwrap();
    (m.build(&g).unwrap().system, (0..2 * n).map(|i| 2.0 * part(i, 2) - 1.0).collect())
}

#[test]
fn surfaces_of_several_states() {
    for mixed in [0.0, 0.05] {
        let (system, x0) = masses(20, mixed);
        let runs = both(&system, &x0, 6.0);
        let slid = runs[1].switches.iter().filter(|s| s.kind == Kind::Enter).count();
        assert!(slid >= 10, "{slid}");
        assert_eq!(switches(&runs[0]), switches(&runs[1]));
        assert_eq!(mixed == 0.0, runs[0].stats.steps < runs[1].stats.steps / 2);
        agree(&runs, 2.0);
    }
}

/// Oscillators in a row, stiffer on the way back, that lose speed where they have too much energy: neither surfaces nor guards are straight.
#[test]
fn functions_that_bend() {
    let g = Graph::new();
    let n = 20;
    let (x, v) = (|i: usize| g.x(i), |i: usize| g.x(n + i));
    let mut rhs: Vec<Expr> = (0..n).map(v).collect();
    for i in 0..n {
        let stiffness = 1.5 + part(i, 1) - 0.5 * (x(i) * v(i)).sign();
        rhs.push(0.05 * (x((i + 1) % n) + x((i + n - 1) % n)) + 0.2 * v(i) - stiffness * x(i));
    }
    let mut m = Model::from_rhs("oscillators", 0, 0, &rhs).unwrap();
    for i in 0..n {
        // one of two is straight
        let guard = if i % 2 == 0 { x(i) * x(i) + v(i) * v(i) - 1.2 } else { v(i) - 1.1 };
        m.add_transition(Transition {
            guard: guard.id(),
            direction: Rising,
            from: vec![],
            reset: vec![(n + i, (0.5 * v(i)).id())],
            to: vec![],
            rule: Rule::default(),
        });
    }
    let system = m.build(&g).unwrap().system;
    let x0: Vec<f64> = (0..2 * n).map(|i| 1.2 * part(i, 2) - 0.6).collect();
    let runs = both(&system, &x0, 12.0);
    assert!(runs[0].stats.jumps > 50 && runs[0].stats.switches > 100, "{:?}", runs[0].stats);
    assert!(runs[0].stats.steps < runs[1].stats.steps / 2, "{} {}", runs[0].stats.steps, runs[1].stats.steps);
    assert_eq!(switches(&runs[0]), switches(&runs[1]));
    agree(&runs, 2.0);
}

/// Notes on what single units do: on their states, which jump or have kinks within a step, and under their discrete states.
#[test]
fn notes_on_units() {
    let g = Graph::new();
    let n = 30;
    let rhs: Vec<Expr> =
        (0..n).map(|i| 1.05 + 0.3 * part(i, 0) - g.x(i)).chain((0..n).map(|_| g.constant(0.0))).collect();
    let mut m = Model::from_rhs("noted", 0, 0, &rhs).unwrap();
    m.set_discrete(&vec![0.0; n]).unwrap();
    for i in 0..n {
        let beside = [(i + 1) % n, (i + n - 1) % n].map(|j| (j, (g.x(j) + 0.05).id()));
        // every second firing is another one
        for (from, to) in [(0.0, 1.0), (1.0, 0.0)] {
            m.add_transition(Transition {
                guard: (g.x(i) - 1.0).id(),
                direction: Rising,
                from: vec![(n + i, from)],
                reset: [&[(i, (g.x(i) - 1.0).id())][..], &beside].concat(),
                to: vec![(n + i, to)],
                rule: Rule::default(),
            });
        }
        let note = |guard: Expr, from: Vec<(usize, f64)>| Transition {
            guard: guard.id(),
            direction: Rising,
            from,
            reset: vec![],
            to: vec![],
            rule: Rule { effect: Effect::Note, trigger: Trigger::Edge, ..Rule::default() },
        };
        m.add_transition(note(g.x(i) - 0.5, vec![]));
        m.add_transition(note(g.x(i) * g.x((i + 1) % n) - 0.3, vec![]));
        m.add_transition(note(g.x(i) - 0.4, vec![(n + i, 1.0)]));
    }
    let system = m.build(&g).unwrap().system;
    let x0: Vec<f64> = (0..n).map(|i| 0.9 * part(i, 3)).chain((0..n).map(|_| 0.0)).collect();
    let runs = both(&system, &x0, 4.0);
    assert!(runs[0].stats.steps < runs[1].stats.steps / 4, "{} {}", runs[0].stats.steps, runs[1].stats.steps);
    agree(&runs, 2.0);
    // in the order of time, but for those that are close
    let by_note = |r: &Run| {
        let mut all: Vec<_> = r.notes.iter().map(|n| (n.transition, n.t, n.rate, n.x.clone())).collect();
        all.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        all
    };
    let [units, all] = [0, 1].map(|k| by_note(&runs[k]));
    assert!(units.len() == all.len() && all.len() > 200, "{} {}", units.len(), all.len());
    assert!(all.iter().any(|n| n.2.is_nan()), "no jump made one true");
    for (a, b) in units.iter().zip(&all) {
        assert_eq!((a.0, a.2.is_nan()), (b.0, b.2.is_nan()), "{} {}", a.1, b.1);
        assert!((a.1 - b.1).abs() < 1e-4, "note {}: {} {}", a.0, a.1, b.1);
        let jumped = runs[1].jumps.iter().any(|j| (j.t - b.1).abs() < 1e-4);
        assert!(jumped || a.3.iter().zip(&b.3).all(|(x, y)| (x - y).abs() < 1e-4), "note {} at {}", a.0, a.1);
    }
    assert!(runs[0].notes.windows(2).all(|w| w[0].t <= w[1].t));
}

/// States at times that were asked for before, and those of the last step, are those of the dense output.
#[test]
fn states_on_the_way_are_those_of_the_units() {
    let (system, x0) = rooms(30, 0.1);
    let options = Options { dense: true, ..Options::with_tolerance(RTOL, RTOL) };
    let mut e = Engine::new(&system, &options).unwrap();
    e.reinit(0.0, &x0).unwrap();
    let times: Vec<f64> = (1..100).map(|k| 0.0101 * f64::from(k)).collect();
    e.want_samples(&times).unwrap();
    let n = x0.len();
    let (mut last, mut own) = (vec![0.0; n], vec![0.0; n]);
    while e.time() < 1.0 {
        let from = e.time();
        e.step_on(1.0).unwrap();
        for k in 1..10 {
            let t = from + 0.1 * f64::from(k) * (e.time() - from);
            e.get_dky(t, 0, &mut last).unwrap();
            e.path().unwrap().eval(t, 0, &mut own).unwrap();
            assert_eq!(last, own, "{t}");
        }
    }
    let samples = e.take_samples();
    for (t, x) in times.iter().zip(samples.chunks(n)) {
        e.path().unwrap().eval(*t, 0, &mut own).unwrap();
        assert_eq!(x, own, "{t}");
    }
}

/// A switch costs no more where there are more units: steps do not end for it, and few velocities are evaluated.
#[test]
fn a_switch_costs_what_depends_on_it() {
    let cost = |n: usize| {
        let (system, x0) = rooms(n, 0.1);
        let r = run(&system, &x0, 1.0, &Options::with_tolerance(1e-6, 1e-8));
        assert_eq!(r.outcome, Outcome::Reached);
        (r.stats.steps, r.stats.evaluations as f64 * n as f64 / r.stats.jumps as f64)
    };
    let (few, many) = (cost(100), cost(800));
    assert!(many.0 <= 2 * few.0, "{few:?} {many:?}");
    assert!(many.1 <= 1.2 * few.1, "{few:?} {many:?}");
}

/// A run is the same to the last bit whatever the engine has done before.
#[test]
fn runs_do_not_depend_on_those_before() {
    let (system, x0) = rooms(30, 0.1);
    let mut e = Engine::new(&system, &Options::default()).unwrap();
    let mut ends = Vec::new();
    for _ in 0..2 {
        e.reinit(0.0, &x0).unwrap();
        e.advance(1.0).unwrap();
        ends.push(e.take_run());
    }
    assert_eq!(ends[0].x, ends[1].x);
    assert_eq!(ends[0].jumps, ends[1].jumps);
}

/// Who steps sees every switch: a step ends there.
#[test]
fn single_steps_end_at_every_switch() {
    let (system, x0) = rooms(30, 0.1);
    let mut e = Engine::new(&system, &Options::with_tolerance(RTOL, RTOL)).unwrap();
    e.reinit(0.0, &x0).unwrap();
    let mut made = 0;
    while e.time() < 1.0 {
        e.step(1.0).unwrap();
        for j in &e.jumps()[made..] {
            assert_eq!(j.t, e.time());
            assert_eq!((j.before.len(), j.after.len(), j.states.len()), (60, 60, 0));
        }
        made = e.jumps().len();
    }
    assert!(made > 100);
}

/// States at transitions are known with dense output; without it those that are moved are.
#[test]
fn states_at_transitions() {
    let (system, x0) = neurons(40, 0.3, |i| part(i, 3));
    let with = |dense: bool| run(&system, &x0, 2.0, &Options { dense, ..Options::with_tolerance(RTOL, RTOL) });
    let (known, few) = (with(true), with(false));
    let made = |r: &Run| r.jumps.iter().map(|j| (j.t, j.transition)).collect::<Vec<_>>();
    assert_eq!(made(&known), made(&few));
    for k in 0..known.jumps.len() {
        let ((before, after), (some, _)) = (known.jump_states(k), few.jump_states(k));
        let j = &known.jumps[k];
        for i in 0..40 {
            assert!(before[i].is_finite() && (some[i].is_nan() || some[i] == before[i]));
            let by = match (i + 40 - j.transition) % 40 {
                0 => -1.0,
                1 | 39 => 0.3,
                _ => 0.0,
            };
            assert!((after[i] - before[i] - by).abs() < 1e-12, "{k} {i}: {} {}", before[i], after[i]);
        }
        // the first of one time begins at the threshold, those behind it may be beyond
        assert!(before[j.transition] > 1.0 - 1e-9);
    }
}
