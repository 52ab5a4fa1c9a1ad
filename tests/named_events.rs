//! Events by name: the end of a run, what is noted, joined conditions, edges, resets that switch, and tables of time.

use switchback::document::{self, Document};
use switchback::event::{Engine, Kind, Method, Options, Outcome, Run, Sensitivity, Term};
use switchback::expr::{Cond, Expr, Graph, Piecewise};
use switchback::model::{Built, Model, Transition};
use switchback::system::Direction::{Falling, Rising};
use switchback::system::{Effect, Rule, Trigger};

const TIGHT: f64 = 1e-11;

fn built(g: &Graph, nx: usize, np: usize, rhs: &[Expr], transitions: Vec<Transition>) -> Built {
    assert_eq!(rhs.len(), nx);
    let mut m = Model::from_rhs("m", 0, np, rhs).unwrap();
    transitions.into_iter().for_each(|t| {
        m.add_transition(t);
    });
    m.build(g).unwrap()
}

fn options(tol: f64, method: Method) -> Options {
    Options { method, dense: true, ..Options::with_tolerance(tol, tol) }
}

fn run(b: &Built, o: &Options, x0: &[f64], p: &[f64], t1: f64) -> Run {
    let mut e = Engine::new(&b.system, o).unwrap();
    e.reinit(0.0, x0).unwrap();
    e.set_params(p).unwrap();
    e.advance(t1).unwrap();
    e.into_run()
}

fn stop(name: &str, guard: Expr) -> Transition {
    Transition::event(name, Effect::Stop, guard.id())
}

fn note(name: &str, when: Cond) -> Transition {
    Transition::event(name, Effect::Note, when.id())
}

fn jump(guard: Expr, reset: Vec<(usize, Expr)>) -> Transition {
    let reset = reset.into_iter().map(|(i, e)| (i, e.id())).collect();
    Transition { guard: guard.id(), direction: Rising, from: vec![], reset, to: vec![], rule: Rule::default() }
}

fn times(run: &Run, transition: usize) -> Vec<f64> {
    run.notes.iter().filter(|n| n.transition == transition).map(|n| n.t).collect()
}

/// A body that falls with drag `p` from `y0` lands at `arcosh(e^(p y0)) / √(9.81 p)`.
fn falling(g: &Graph) -> Built {
    let [y, v, c] = [g.x(0), g.x(1), g.p(0)];
    built(g, 2, 1, &[v, c * v * v - 9.81], vec![stop("landed", -y)])
}

#[test]
fn a_run_ends_where_a_guard_passes_zero() {
    let g = Graph::new();
    let b = falling(&g);
    let landing = |y: f64, c: f64| (c * y).exp().acosh() / (9.81 * c).sqrt();
    for method in [Method::Auto, Method::Dp5, Method::Radau5] {
        let r = run(&b, &options(1e-10, method), &[10.0, 0.0], &[0.1], 100.0);
        assert_eq!((r.outcome, r.stopped_by), (Outcome::Event, Some(0)), "{}", r.reason);
        assert!((r.t - landing(10.0, 0.1)).abs() < 1e-8, "{method:?} {}", r.t - landing(10.0, 0.1));
        assert!(r.x[0].abs() < 1e-13 && r.reason.contains("landed"), "{} {}", r.x[0], r.reason);
    }
    // one that never comes
    let r = run(&b, &options(1e-8, Method::Auto), &[10.0, 0.0], &[0.1], 1.0);
    assert_eq!((r.outcome, r.stopped_by, r.t), (Outcome::Reached, None, 1.0));
}

/// The state at the end and the time there are functions of start and parameter.
#[test]
fn derivatives_at_the_end_include_its_time() {
    let g = Graph::new();
    let b = falling(&g);
    for method in [Method::Auto, Method::Dp5, Method::Radau5] {
        let mut o = options(TIGHT, method);
        (o.sensitivity, o.adjoint) = (Sensitivity::On, true);
        let mut e = Engine::new(&b.system, &o).unwrap();
        e.reinit(0.0, &[10.0, 0.0]).unwrap();
        e.set_params(&[0.1]).unwrap();
        e.advance(100.0).unwrap();
        let s = e.sensitivity().unwrap().to_vec();
        let dt = e.jumps()[0].dt.clone();
        let by_adjoint = e.adjoint(&[0.0, 1.0], &[Term::Jump { index: 0, weight: 2.0 }]).unwrap();
        let end = |x: &[f64], p: f64| {
            let r = run(&b, &options(TIGHT, method), x, &[p], 100.0);
            (r.x[1], r.t)
        };
        let h = 1e-4;
        let by = [
            (end(&[10.0 + h, 0.0], 0.1), end(&[10.0 - h, 0.0], 0.1)),
            (end(&[10.0, h], 0.1), end(&[10.0, -h], 0.1)),
            (end(&[10.0, 0.0], 0.1 + h), end(&[10.0, 0.0], 0.1 - h)),
        ];
        for (k, (plus, minus)) in by.into_iter().enumerate() {
            let (dv, time) = ((plus.0 - minus.0) / (2.0 * h), (plus.1 - minus.1) / (2.0 * h));
            assert!((s[3 + k] - dv).abs() < 1e-5 * (1.0 + dv.abs()), "{method:?} {k}: {} {dv}", s[3 + k]);
            assert!((dt[k] - time).abs() < 1e-5 * (1.0 + time.abs()), "{method:?} {k}: {} {time}", dt[k]);
            // it ends on the surface
            assert!(s[k].abs() < 1e-9, "{method:?} {k}: {}", s[k]);
            let whole = if k < 2 { by_adjoint.x0[k] } else { by_adjoint.p[0] };
            assert!((whole - s[3 + k] - 2.0 * dt[k]).abs() < 1e-7 * (1.0 + whole.abs()), "{method:?} {k}: {whole}");
        }
    }
}

#[test]
fn a_run_may_end_behind_a_jump_and_on_a_sliding_mode() {
    // the jump takes the state over the threshold
    let g = Graph::new();
    let x = g.x(0);
    let b = built(&g, 1, 1, &[g.p(0)], vec![jump(x - 1.0, vec![(0, x + 5.0)]), stop("far", x - 3.0)]);
    let mut o = options(1e-9, Method::Auto);
    (o.sensitivity, o.adjoint) = (Sensitivity::On, true);
    let r = run(&b, &o, &[0.0], &[2.0], 10.0);
    assert_eq!((r.outcome, r.stopped_by), (Outcome::Event, Some(1)));
    assert!((r.t - 0.5).abs() < 1e-12 && (r.x[0] - 6.0).abs() < 1e-12 && r.jumps.len() == 2);
    let s = r.sensitivity.unwrap();
    assert!(s.iter().all(|v| v.abs() < 1e-9), "the end is 6 whatever the start: {s:?}");
    // x slides at 0, y ends at 1, a time that depends on the parameter
    let g = Graph::new();
    let [x, y] = [g.x(0), g.x(1)];
    let b = built(&g, 2, 1, &[0.3 - x.sign(), g.p(0) + 0.0 * y], vec![stop("full", y - 1.0)]);
    let r = run(&b, &o, &[0.5, 0.0], &[0.5], 10.0);
    assert!(r.outcome == Outcome::Event && (r.t - 2.0).abs() < 1e-9, "{} {}", r.t, r.reason);
    assert!((r.jumps[0].dt[2] + 4.0).abs() < 1e-7, "{:?}", r.jumps[0].dt);
}

#[test]
fn an_end_that_is_passed_from_the_start_waits() {
    let g = Graph::new();
    let x = g.x(0);
    let b = built(&g, 2, 0, &[g.x(1), -x], vec![stop("high", x - 0.5)]);
    let r = run(&b, &options(TIGHT, Method::Auto), &[1.0, 0.0], &[], 20.0);
    // cos t is above a half from the start, and again from 5 π / 3 on
    assert!((r.t - 5.0 * std::f64::consts::PI / 3.0).abs() < 1e-9, "{}", r.t);
}

#[test]
fn what_is_noted_ends_no_step() {
    let g = Graph::new();
    let [x, y] = [g.x(0), g.x(1)];
    let rhs = [y, -x];
    let plain = built(&g, 2, 0, &rhs, vec![]);
    let noted = built(&g, 2, 0, &rhs, vec![note("up", x.gt(0.0)), note("bent", (x * x * x - 0.1 * y).lt(0.05))]);
    let pi = std::f64::consts::PI;
    for (method, off) in [(Method::Auto, 1e-8), (Method::Dp5, 1e-8), (Method::Radau5, 1e-6)] {
        let o = options(1e-10, method);
        let (a, b) = (run(&plain, &o, &[0.0, -1.0], &[], 30.0), run(&noted, &o, &[0.0, -1.0], &[], 30.0));
        assert_eq!((a.stats.steps, a.stats.rejections, &a.x), (b.stats.steps, b.stats.rejections, &b.x), "{method:?}");
        // −sin t rises through zero at odd multiples of π
        let found = times(&b, 0);
        assert_eq!(found.len(), 5, "{method:?} {found:?}");
        for (k, t) in found.iter().enumerate() {
            assert!((t - (2 * k + 1) as f64 * pi).abs() < off, "{method:?} {k}: {}", t - (2 * k + 1) as f64 * pi);
        }
        for n in &b.notes {
            let guard = match n.transition {
                0 => n.x[0],
                _ => n.x[0].powi(3) - 0.1 * n.x[1] - 0.05,
            };
            assert!(guard.abs() < 10.0 * off, "{guard}");
        }
        assert_eq!(times(&b, 1).len(), 5, "{:?}", times(&b, 1));
        assert!(b.notes.windows(2).all(|w| w[0].t <= w[1].t) && b.stats.notes == b.notes.len());
    }
}

#[test]
fn a_note_has_the_accuracy_and_the_derivatives_of_a_transition() {
    let g = Graph::new();
    let [y, v, c] = [g.x(0), g.x(1), g.p(0)];
    let b = built(&g, 2, 1, &[v, c * v * v - 9.81], vec![note("landed", y.lt(0.0))]);
    let s = falling(&Graph::new());
    let mut o = options(1e-9, Method::Dp5);
    o.sensitivity = Sensitivity::On;
    let (a, b) = (run(&s, &o, &[10.0, 0.0], &[0.1], 100.0), run(&b, &o, &[10.0, 0.0], &[0.1], 1.8));
    let (jump, noted) = (&a.jumps[0], &b.notes[0]);
    assert!((jump.t - noted.t).abs() < 1e-9, "{}", jump.t - noted.t);
    assert!((jump.rate - noted.rate).abs() < 1e-7 && (noted.x[1] - a.x[1]).abs() < 1e-7);
    for (p, q) in jump.dt.iter().zip(&noted.dt) {
        assert!((p - q).abs() < 1e-6 * (1.0 + p.abs()), "{:?} {:?}", jump.dt, noted.dt);
    }
}

/// In an implicit step the time of a note is one on the dense output, and so are its derivatives: in the first step of a run, which has the slope of its
/// start, in others, and in a sliding mode.
#[test]
fn notes_in_implicit_steps_have_derivatives() {
    let g = Graph::new();
    let [x, y, p] = [g.x(0), g.x(1), g.p(0)];
    let levels = [0.999, 0.9, 0.5, 0.2];
    let notes = |of: Expr| levels.map(|l| note(&format!("{l}"), of.lt(l))).to_vec();
    // decays by itself; and where the other state slides at 0.3
    let b = built(&g, 2, 1, &[-(p * x), 3.0 * p - (y - 0.3).sign() - x.powi(2) * (y - 0.3).sign()], notes(x));
    let mut o = options(1e-9, Method::Radau5);
    o.sensitivity = Sensitivity::On;
    let (x0, p) = (1.0f64, 0.3f64);
    let r = run(&b, &o, &[x0, 1.0], &[p], 10.0);
    assert_eq!(r.notes.len(), levels.len());
    assert!(r.switches.iter().any(|s| s.kind == Kind::Enter));
    for (n, level) in r.notes.iter().zip(levels) {
        let t = (x0 / level).ln() / p;
        assert!((n.t - t).abs() < 1e-7, "{level}: {}", n.t - t);
        for (found, exact) in n.dt.iter().zip([1.0 / (p * x0), 0.0, -t / p]) {
            assert!((found - exact).abs() < 1e-6 * (1.0 + exact.abs()), "{level}: {:?} {exact}", n.dt);
        }
    }
}

#[test]
fn what_a_jump_passes_is_noted_once() {
    // a ball: it lands where it is turned back
    let g = Graph::new();
    let [y, v] = [g.x(0), g.x(1)];
    let landed = note("landed", y.lt(0.0));
    let turned = note("turned", v.gt(0.0));
    let b = built(&g, 2, 0, &[v, g.constant(-9.81)], vec![jump(-y, vec![(1, -0.8 * v)]), landed, turned]);
    for method in [Method::Auto, Method::Dp5, Method::Radau5] {
        let r = run(&b, &options(1e-10, method), &[1.0, 0.0], &[], 2.5);
        let bounces: Vec<f64> = r.jumps.iter().map(|j| j.t).collect();
        assert!(bounces.len() == 5 || bounces.len() == 4, "{bounces:?}");
        for k in [1, 2] {
            let found = times(&r, k);
            assert_eq!(found.len(), bounces.len(), "{method:?} {k} {found:?} {bounces:?}");
            for (t, b) in found.iter().zip(&bounces) {
                assert!((t - b).abs() < 1e-9, "{method:?} {k} {found:?} {bounces:?}");
            }
        }
    }
}

/// On the unit circle: `(cos t, sin t)`.
fn circle(g: &Graph, transitions: Vec<Transition>) -> Built {
    built(g, 3, 0, &[-g.x(1), g.x(0), g.constant(0.0)], transitions)
}

#[test]
fn joined_comparisons_act_where_the_whole_becomes_true() {
    let pi = std::f64::consts::PI;
    let g = Graph::new();
    let [x, y, n] = [g.x(0), g.x(1), g.x(2)];
    // in the first quadrant; above or right of the diagonal; not in both halves
    let conditions: [(Cond, f64); 4] = [
        (x.gt(0.0) & y.gt(0.0), 2.0 * pi),
        (x.gt(0.5) | y.gt(0.5), 5.0 * pi / 3.0),
        (!(x.lt(0.0) | y.lt(0.0)), 2.0 * pi),
        ((x.gt(0.0) & y.gt(0.0)) | (x.lt(0.0) & y.lt(0.0)), pi),
    ];
    for (k, (when, first)) in conditions.into_iter().enumerate() {
        let count = Transition { reset: vec![(2, (n + 1.0).id())], ..Transition::event("", Effect::Stop, when.id()) };
        let count = Transition { rule: Rule { trigger: Trigger::Edge, ..Rule::default() }, ..count };
        let b = circle(&g, vec![count, note("seen", when)]);
        let r = run(&b, &options(TIGHT, Method::Auto), &[(0.3f64).cos(), (0.3f64).sin(), 0.0], &[], 20.0);
        let period = if k == 3 { pi } else { 2.0 * pi };
        let exact: Vec<f64> = (0..9).map(|i| first - 0.3 + f64::from(i) * period).filter(|t| *t < 20.0).collect();
        let made: Vec<f64> = r.jumps.iter().map(|j| j.t).collect();
        for (what, found) in [("made", made), ("noted", times(&r, 1))] {
            assert_eq!(found.len(), exact.len(), "{k} {what}: {found:?} {exact:?}");
            found.iter().zip(&exact).for_each(|(a, b)| assert!((a - b).abs() < 1e-8, "{k} {what}: {a} {b}"));
        }
        assert_eq!(r.x[2], exact.len() as f64);
    }
}

#[test]
fn a_level_acts_at_once_and_an_edge_waits() {
    let g = Graph::new();
    let [x, y, n] = [g.x(0), g.x(1), g.x(2)];
    let level = jump(x - 0.5, vec![(2, n + 1.0)]);
    let edge = Transition { rule: Rule { trigger: Trigger::Edge, ..Rule::default() }, ..level.clone() };
    let both = |t: &Transition| Transition { guard: (x.gt(0.5) & y.gt(-2.0)).id(), ..t.clone() };
    for (t, count) in [(level.clone(), 4.0), (edge.clone(), 3.0), (both(&level), 4.0), (both(&edge), 3.0)] {
        let b = circle(&g, vec![t]);
        let r = run(&b, &options(1e-9, Method::Auto), &[1.0, 0.0, 0.0], &[], 19.0);
        assert_eq!(r.x[2], count, "{:?}", r.jumps);
    }
    // a jump of another transition makes it true; so does a parameter, but not the begin of a discrete state
    let g = Graph::new();
    let [x, n, d] = [g.x(0), g.x(1), g.x(2)];
    let edge = Rule { trigger: Trigger::Edge, ..Rule::default() };
    let over = jump(g.t() - 1.0, vec![(0, x + 10.0)]);
    let counts = Transition { rule: edge.clone(), ..jump(x + g.p(0) - 5.0, vec![(1, n + 1.0)]) };
    let begins = Transition { to: vec![(2, 1.0)], ..jump(g.t() - 2.0, vec![]) };
    let waits = Transition { from: vec![(2, 1.0)], rule: edge, ..jump(x - 5.0, vec![(1, n + 100.0)]) };
    let zero = g.constant(0.0);
    let b = built(&g, 3, 1, &[zero, zero, zero], vec![over, counts, begins, waits]);
    let r = run(&b, &options(1e-9, Method::Auto), &[0.0, 0.0, 0.0], &[0.0], 3.0);
    assert_eq!(r.x, [10.0, 1.0, 1.0], "{d:?}", d = d.id());
    let mut e = Engine::new(&b.system, &options(1e-9, Method::Auto)).unwrap();
    e.reinit(0.0, &[0.0; 3]).unwrap();
    e.set_params(&[0.0]).unwrap();
    e.advance(0.5).unwrap();
    e.set_params(&[6.0]).unwrap();
    e.advance(0.7).unwrap();
    assert_eq!(e.state()[1], 1.0);
}

/// A controller that samples a plant, quantises what it measures, and limits its command.
#[test]
fn a_quantised_sampled_controller_is_its_own_program() {
    let g = Graph::new();
    let [q, v, u, n] = [g.x(0), g.x(1), g.x(2), g.x(3)];
    let (h, lsb) = (0.1, 0.01);
    let measured = lsb * (q / lsb + 0.5).floor();
    let command = (-g.p(0) * measured - 2.0 * v).clip(-0.5, 0.5);
    let clock = jump(g.t() - h * n, vec![(2, command), (3, n + 1.0)]);
    let zero = g.constant(0.0);
    let b = built(&g, 4, 1, &[v, u - q, zero, zero], vec![clock]);
    let mut o = options(TIGHT, Method::Auto);
    (o.sensitivity, o.adjoint) = (Sensitivity::On, true);
    // the same by hand: exact rotation about the command between the samples
    let by_hand = |q0: f64, gain: f64| {
        let (mut q, mut v) = (q0, 0.0);
        for _ in 0..50 {
            let m = lsb * (q / lsb + 0.5).floor();
            let u = (-gain * m - 2.0 * v).clamp(-0.5, 0.5);
            let (c, s) = (h.cos(), h.sin());
            (q, v) = (u + (q - u) * c + v * s, -(q - u) * s + v * c);
        }
        [q, v]
    };
    let r = run(&b, &o, &[1.0, 0.0, 0.0, 0.0], &[3.0], 5.0 - 1e-9);
    let exact = by_hand(1.0, 3.0);
    assert_eq!(r.jumps.len(), 50);
    (0..2).for_each(|i| assert!((r.x[i] - exact[i]).abs() < 1e-8, "{i}: {} {}", r.x[i], exact[i]));
    let s = r.sensitivity.unwrap();
    let d = 1e-7;
    let (plus, minus) = (by_hand(1.0, 3.0 + d), by_hand(1.0, 3.0 - d));
    (0..2).for_each(|i| {
        let slope = (plus[i] - minus[i]) / (2.0 * d);
        assert!((s[5 * i + 4] - slope).abs() < 1e-5 * (1.0 + slope.abs()), "{i}: {} {slope}", s[5 * i + 4]);
    });
    assert!(s[4].abs() > 1e-4);
}

#[test]
fn tables_of_time_end_steps_at_their_knots() {
    let knots: Vec<f64> = (0..=24).map(f64::from).collect();
    let heights: Vec<f64> = knots.iter().map(|k| (37.0 * k * k).sin()).collect();
    // the integral of straight lines is that of trapezoids, of steps that of rectangles
    let area: f64 = heights.windows(2).map(|w| 0.5 * (w[0] + w[1])).sum();
    let held: f64 = heights[1..].iter().sum();
    for (steps, exact) in [(false, area), (true, held)] {
        let g = Graph::new();
        let table = match steps {
            true => Piecewise::steps(&knots[..24], &heights).unwrap(),
            false => Piecewise::lines(&knots, &heights).unwrap(),
        };
        let data = g.piecewise(&table, g.t());
        let b = built(&g, 2, 0, &[data, data - g.x(1)], vec![]);
        for method in [Method::Auto, Method::Dp5, Method::Radau5] {
            let mut e = Engine::new(&b.system, &options(1e-9, method)).unwrap();
            e.reinit(0.0, &[0.0, 0.0]).unwrap();
            e.advance(24.0).unwrap();
            let r = e.into_run();
            assert!((r.x[0] - exact).abs() < 1e-9, "{steps} {method:?}: {}", r.x[0] - exact);
            assert!(r.stats.rejections < 24 && r.t == 24.0, "{method:?} {:?}", r.stats);
            let path = r.path.unwrap();
            let ends = path.times();
            assert!(knots.iter().all(|k| ends.contains(k)), "{ends:?}");
            assert!(ends.windows(2).all(|w| w[1] > w[0] + 1e-9), "{ends:?}");
        }
    }
}

#[test]
fn a_jump_of_a_table_may_end_a_sliding_mode() {
    let g = Graph::new();
    let table = Piecewise::steps(&[1.0, 2.0], &[0.5, 3.0, -0.5]).unwrap();
    let force = g.piecewise(&table, g.t());
    let b = built(&g, 1, 0, &[force - g.x(0).sign()], vec![]);
    let r = run(&b, &options(1e-10, Method::Auto), &[0.0], &[], 3.0);
    // held until 1, then away with the speed 2 until 2, then back with -1.5
    assert_eq!(r.outcome, Outcome::Reached, "{}", r.reason);
    assert!((r.x[0] - 0.5).abs() < 1e-12, "{}", r.x[0]);
    assert_eq!(r.switches.iter().filter(|s| s.t == 1.0).count(), 1, "{:?}", r.switches);
}

#[test]
fn documents_keep_names_effects_and_conditions() {
    let g = Graph::new();
    let [x, y] = [g.x(0), g.x(1)];
    let edge = Rule { name: "both".into(), effect: Effect::Jump, trigger: Trigger::Edge };
    let both =
        Transition { guard: (x.gt(0.0) & y.gt(0.0)).id(), rule: edge, ..jump(x, vec![(2, (x * 7.0).floor().abs())]) };
    let falling = Transition { direction: Falling, ..stop("low", g.t() - 40.0) };
    let data = Piecewise::lines(&[0.0, 1.0, 2.0], &[0.0, 0.3, 0.0]).unwrap();
    let rhs = [-y, x + g.piecewise(&data, g.t()), g.constant(0.0)];
    let b = built(&g, 3, 0, &rhs, vec![both, note("seen", x.lt(-0.5) | y.lt(-0.5)), stop("end", g.t() - 9.0), falling]);
    let o = options(1e-10, Method::Auto);
    let first = run(&b, &o, &[1.0, 0.1, 0.0], &[], 20.0);
    assert!(first.stopped_by == Some(2) && first.jumps.len() > 1 && !first.notes.is_empty(), "{:?}", first.jumps);
    let text = document::write_model(b.source().unwrap()).unwrap();
    let Document::Model(saved) = document::read(&text, &[]).unwrap() else { panic!("no model") };
    let h = Graph::new();
    let model = saved.restore(&mut h.dag(), &[]).unwrap();
    assert_eq!(model.transitions().len(), 4);
    assert_eq!(model.transitions()[1].rule, Rule::event("seen", Effect::Note));
    let b2 = model.build(&h).unwrap();
    let second = run(&b2, &o, &[1.0, 0.1, 0.0], &[], 20.0);
    assert_eq!((first.t, &first.x, &first.notes), (second.t, &second.x, &second.notes));
    let report = b.report.to_string();
    for words in ["both: ", "seen: noted where", "end: ends the run where", "becomes true"] {
        assert!(report.contains(words), "{words}: {report}");
    }
}

#[test]
fn optimal_control_refuses_what_it_does_not_follow() {
    let g = Graph::new();
    let x = g.x(0);
    let refused = |t: Transition, words: &str| {
        let b = built(&g, 1, 0, &[g.constant(1.0)], vec![t]);
        let made = switchback::ocp::Ocp::new(&b.system, 1.0, 2, &switchback::settings::Settings::default());
        let e = made.map(|_| ()).unwrap_err().to_string();
        assert!(e.contains(words), "{words}: {e}");
    };
    refused(stop("end", x - 0.5), "stops");
}

#[test]
fn what_makes_no_sense_is_refused() {
    let refused = |t: Vec<Transition>, g: &Graph, words: &str| {
        let mut m = Model::new("m", 2, 0, 0).unwrap();
        (0..2).for_each(|i| m.set_derivative(i, g.x(1 - i).id()).unwrap());
        t.into_iter().for_each(|t| {
            m.add_transition(t);
        });
        let e = m.build(g).map(|_| ()).unwrap_err().to_string();
        assert!(e.contains(words), "{words}: {e}");
    };
    let g = Graph::new();
    let x = g.x(0);
    refused(vec![stop("a", x), stop("a", -x)], &g, "'a' already");
    refused(vec![stop("a\nb", x)], &g, "one line");
    let level = Rule { trigger: Trigger::Level, ..Rule::event("", Effect::Stop) };
    refused(vec![Transition { rule: level, ..stop("", x) }], &g, "edge");
    refused(vec![Transition { reset: vec![(0, x.id())], ..stop("", x) }], &g, "second transition");
    refused(vec![Transition { reset: vec![], ..jump(x, vec![]) }], &g, "changes nothing");
    refused(vec![stop("", x.floor())], &g, "floor");
    refused(vec![stop("", x.abs())], &g, "abs");
    refused(vec![Transition { reset: vec![(0, x.gt(0.0).id())], ..jump(x, vec![]) }], &g, "where");
    let mut m = Model::new("m", 1, 0, 0).unwrap();
    m.set_derivative(0, (x.floor() - x).id()).unwrap();
    let e = m.build(&g).map(|_| ()).unwrap_err().to_string();
    assert!(e.contains("hold the value"), "{e}");
    // a condition that is never true is no event, and one that always is none either
    let never = note("never", x.gt(0.0) & x.lt(0.0));
    let b = built(&g, 2, 0, &[g.x(1), -x], vec![never, note("always", x.gt(0.0) | !x.gt(0.0))]);
    let r = run(&b, &options(1e-8, Method::Auto), &[1.0, 0.0], &[], 9.0);
    assert!(r.notes.is_empty());
}

/// While a mode slides, the state is put back onto its surface: a guard that has passed zero does not pass it again by that.
#[test]
fn guards_beside_sliding_modes_act_once() {
    let mut made = 0;
    for k in 0..60 {
        let part = |j: usize| ((k * 7 + j * 13) as f64 * 0.618_033_988).fract();
        let g = Graph::new();
        let [q, v, w, n] = [g.x(0), g.x(1), g.x(2), g.x(3)];
        let surface = w - 0.2 * g.t().sin();
        let rhs =
            [v, -(1.0 + part(0)) * q - 0.1 * v + (3.0 * part(1) * g.t()).sin(), part(2) * q - w - 1.5 * surface.sign()];
        let rhs = [rhs[0], rhs[1], rhs[2], g.constant(0.0)];
        let guard = q + 0.5 * w - 0.2 * part(3);
        let b = built(&g, 4, 0, &rhs, vec![jump(guard, vec![(3, n + 1.0)]), note("seen", guard.gt(0.0))]);
        for method in [Method::Dp5, Method::Auto] {
            let r = run(&b, &options(1e-6, method), &[part(4) - 0.5, part(5) - 0.5, 0.3, 0.0], &[], 10.0);
            // one that holds from the start is made there, and not noted
            let t: Vec<f64> = r.jumps.iter().filter(|j| j.t > 0.0).map(|j| j.t).collect();
            assert!(t.windows(2).all(|w| w[1] > w[0] + 1e-6), "{k} {method:?}: {t:?}");
            assert_eq!(t.len(), times(&r, 1).len(), "{k} {method:?}: {t:?} {:?}", times(&r, 1));
            made += t.len();
        }
    }
    assert!(made > 150, "{made}");
}
