//! Time stepping of scenes: closed forms, convergence, conservation, units, bad input.

#[path = "common/scenes.rs"]
#[allow(dead_code)]
mod scenes;

use switchback::event;
use switchback::expr::{Expr, Graph};
use switchback::scene::{Contact, Scene};
use switchback::stepping::{simulate_steps, Options, Statistics, Stepper};
use switchback::system::{ImpactLaw, System};

const G: f64 = 9.81;

/// Points of unit mass in the plane under gravity, with contacts of gaps and tangents.
struct Plane {
    g: &'static Graph,
    scene: Scene,
}

impl Plane {
    fn new(n: usize, mass: &[f64], gravity: f64) -> Plane {
        let g: &'static Graph = Box::leak(Box::new(Graph::new()));
        let mut scene = Scene::new("plane", 2 * n, 2 * n, 0, 0).unwrap();
        let mut inertia = vec![g.constant(0.0).id(); 4 * n * n];
        for i in 0..n {
            let m = mass.get(i).copied().unwrap_or(1.0);
            scene.set_force(2 * i, g.constant(0.0).id()).unwrap();
            scene.set_force(2 * i + 1, g.constant(-m * gravity).id()).unwrap();
            inertia[2 * i * (2 * n + 1)] = g.constant(m).id();
            inertia[(2 * i + 1) * (2 * n + 1)] = g.constant(m).id();
        }
        scene.set_inertia(&inertia).unwrap();
        Plane { g, scene }
    }

    fn contact(&mut self, name: &str, gap: Expr<'static>, tangents: &[Expr<'static>], mu: f64, e: f64) {
        let ids = tangents.iter().map(|t| t.id()).collect();
        let (friction, restitution) = (self.g.constant(mu).id(), self.g.constant(e).id());
        let c = Contact { tangents: ids, friction, restitution, ..Contact::new(self.g, name, gap) };
        self.scene.add_contact(c).unwrap();
    }

    fn build(&self) -> System {
        self.scene.build(self.g).unwrap().system
    }
}

fn options(h: f64) -> Options {
    Options { h, ..Options::default() }
}

/// State at `t1`.
fn end(system: &System, o: &Options, x0: &[f64], t1: f64) -> (Vec<f64>, Statistics) {
    let mut s = Stepper::new(system, o).unwrap();
    s.reset(0.0, x0).unwrap();
    s.advance(t1).unwrap();
    (s.state().to_vec(), s.statistics())
}

/// Slope of a straight line through `log error` over `log h`.
fn slope(h: &[f64], error: &[f64]) -> f64 {
    let n = h.len() as f64;
    let (x, y): (Vec<f64>, Vec<f64>) = h.iter().zip(error).map(|(h, e)| (h.ln(), e.max(1e-16).ln())).unzip();
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let (a, b) = x.iter().zip(&y).fold((0.0, 0.0), |s, (x, y)| (s.0 + (x - mx) * (y - my), s.1 + (x - mx) * (x - mx)));
    a / b
}

/// Twenty discs, one on the other, and one that flies at them.
fn pile(o: &Options) -> Stepper {
    let n = 20;
    let mut p = Plane::new(n, &[], G);
    for i in 0..n {
        let y = p.g.x(2 * i + 1);
        p.contact(&format!("ground-{i}"), y - 0.2, &[], 0.0, 0.0);
        for j in 0..i {
            let (dx, dy) = (p.g.x(2 * i) - p.g.x(2 * j), p.g.x(2 * i + 1) - p.g.x(2 * j + 1));
            p.contact(&format!("{j}-{i}"), (dx * dx + dy * dy).sqrt() - 0.4, &[], 0.0, 0.0);
        }
    }
    let system = p.build();
    let mut x = vec![0.0; 4 * n];
    for i in 0..n - 1 {
        x[2 * i + 1] = 0.2 + 0.4 * i as f64;
    }
    (x[2 * n - 2], x[2 * n - 1], x[4 * n - 2]) = (-2.2, 7.4, 10.0);
    let mut s = Stepper::new(&system, o).unwrap();
    s.reset(0.0, &x).unwrap();
    s
}

/// Positions of the discs 17, 18 and 19 at t = 0.30: free flight behind the second impact.
fn pile_reference() -> [f64; 6] {
    let all = scenes::reference("pile_of_20.json");
    let event = &all["events"][1];
    let t = 0.30 - scenes::number(&event["t"]);
    let mut out = [0.0; 6];
    for (k, disc) in ["17", "18", "19"].iter().enumerate() {
        let (q, v) = (scenes::numbers(&event["q"][disc]), scenes::numbers(&event["v_plus"][disc]));
        (out[2 * k], out[2 * k + 1]) = (q[0] + t * v[0], q[1] + t * v[1] - 0.5 * G * t * t);
    }
    out
}

#[test]
fn a_pile_is_hit() {
    let exact = pile_reference();
    let h: Vec<f64> = (0..6).map(|k| 4e-3 / f64::from(1 << k)).collect();
    for correct in [true, false] {
        let mut errors = Vec::new();
        for &h in &h {
            let mut s = pile(&Options { correct, ..options(h) });
            s.advance(0.30).unwrap();
            let x = &s.state()[34..40];
            let distance = |k: usize| (x[2 * k] - exact[2 * k]).hypot(x[2 * k + 1] - exact[2 * k + 1]);
            errors.push((0..3).map(distance).fold(0.0, f64::max));
            let stats = s.statistics();
            assert!(stats.unconverged == 0 && stats.penetration < 8.0 * h, "{stats:?}");
        }
        assert!(errors[2] < 0.015, "{errors:?}");
        let slope = slope(&h, &errors);
        assert!((0.8..1.6).contains(&slope), "slope {slope} of {errors:?}");
    }
}

/// Looking at the contacts that are near only gives what looking at all of them gives, to the last bit, and looks at few.
#[test]
fn no_contact_is_missed() {
    for h in [4e-3, 1e-3] {
        let mut few = pile(&options(h));
        let mut all = pile(&Options { look_at_all: true, ..options(h) });
        for _ in 0..(1.0 / h) as usize {
            few.step().unwrap();
            all.step().unwrap();
            assert_eq!(few.state(), all.state(), "at t = {}", few.time());
            assert_eq!(few.impulses(), all.impulses());
        }
        let (few, all) = (few.statistics(), all.statistics());
        assert!(2 * few.gaps < all.gaps && few.contacts == all.contacts, "{few:?} {all:?}");
    }
}

/// The same with rods that turn, a wall that moves with time, and jumps of parameters.
#[test]
fn no_contact_is_missed_where_gaps_turn_and_move() {
    let g = Graph::new();
    let n = 6;
    let mut s = Scene::new("rods", 3 * n, 3 * n, 0, 1).unwrap();
    let mut inertia = vec![g.constant(0.0).id(); 9 * n * n];
    for i in 0..n {
        for (k, (force, m)) in [(0.0, 1.0), (-G, 1.0), (0.0, 0.02)].into_iter().enumerate() {
            s.set_force(3 * i + k, g.constant(force).id()).unwrap();
            inertia[(3 * i + k) * (3 * n + 1)] = g.constant(m).id();
        }
        let (x, y, a) = (g.x(3 * i), g.x(3 * i + 1), g.x(3 * i + 2));
        for (end, l) in [("a", 0.3), ("b", -0.3)] {
            let (px, py) = (x + l * a.cos(), y + l * a.sin());
            let e = g.constant(0.4).id();
            let floor = Contact { restitution: e, ..Contact::new(&g, &format!("floor-{i}{end}"), py) };
            s.add_contact(floor).unwrap();
            let wall = 2.0 + 0.3 * (5.0 * g.t()).sin() + g.p(0) - px;
            s.add_contact(Contact { restitution: e, ..Contact::new(&g, &format!("wall-{i}{end}"), wall) }).unwrap();
            s.add_contact(Contact { restitution: e, ..Contact::new(&g, &format!("left-{i}{end}"), px + 2.0) }).unwrap();
        }
    }
    s.set_inertia(&inertia).unwrap();
    let system = s.build(&g).unwrap().system;
    let mut x0 = vec![0.0; 6 * n];
    for i in 0..n {
        (x0[3 * i], x0[3 * i + 1], x0[3 * i + 2]) = (0.3 * i as f64 - 1.0, 0.5 + 0.1 * i as f64, 0.4 * i as f64);
        (x0[3 * n + 3 * i], x0[3 * n + 3 * i + 2]) = (4.0 - 2.0 * i as f64, 40.0 - 13.0 * i as f64);
    }
    let make = |look_at_all: bool| {
        let mut s = Stepper::new(&system, &Options { look_at_all, ..options(1e-3) }).unwrap();
        s.reset(0.0, &x0).unwrap();
        s
    };
    let (mut few, mut all) = (make(false), make(true));
    for k in 0..2000 {
        if k % 500 == 250 {
            let p = [if k % 1000 == 250 { 0.2 } else { 0.0 }];
            few.set_params(&p).unwrap();
            all.set_params(&p).unwrap();
        }
        few.step().unwrap();
        all.step().unwrap();
        assert_eq!(few.state(), all.state(), "step {k}");
    }
    let (few, all) = (few.statistics(), all.statistics());
    assert!(few.contacts == all.contacts && all.contacts > 100 && 2 * few.gaps < all.gaps, "{few:?} {all:?}");
}

/// A ball that falls from height 1: `e = 0` rests, `e = 1/2` at a time between its second and third impact.
#[test]
fn a_ball_bounces() {
    let fall = (2.0 / G).sqrt();
    let up = fall * G * 0.5; // speed behind the first impact
    let second = fall + 2.0 * up / G;
    let t = second + 0.3 * up / G;
    let exact = 0.5 * up * (t - second) - 0.5 * G * (t - second) * (t - second);
    for (e, t, exact) in [(0.0, 1.0, 0.0), (0.5, t, exact)] {
        let mut p = Plane::new(1, &[], G);
        p.contact("floor", p.g.x(1), &[], 0.0, e);
        let system = p.build();
        let h: Vec<f64> = (0..8).map(|k| 0.0123 / f64::from(1 << k)).collect();
        let errors: Vec<f64> =
            h.iter().map(|&h| (end(&system, &options(h), &[0.0, 1.0, 0.0, 0.0], t).0[1] - exact).abs()).collect();
        let s = slope(&h, &errors);
        assert!(s > 0.7, "slope {s} of {errors:?}");
        assert!(errors.iter().zip(&h).all(|(e, h)| *e < 5.0 * h), "{errors:?}");
    }
}

/// Sliding on a slope with `μ` less than its tangent, and to a stop on a plane: Coulomb's law has closed forms.
#[test]
fn blocks_slide_and_stop() {
    let (mu, v0) = (0.3, 2.0);
    let mut p = Plane::new(1, &[2.0], G);
    p.contact("floor", p.g.x(1), &[p.g.x(0)], mu, 0.0);
    let system = p.build();
    let stop = v0 / (mu * G);
    let exact = 0.5 * v0 * stop;
    let h: Vec<f64> = (0..6).map(|k| 0.0071 / f64::from(1 << k)).collect();
    let run = |h: f64, t: f64| end(&system, &options(h), &[0.0, 0.0, v0, 0.0], t).0;
    let errors: Vec<f64> = h.iter().map(|&h| (run(h, 1.2 * stop)[0] - exact).abs()).collect();
    assert!(errors.iter().zip(&h).all(|(e, h)| *e < 5.0 * h * h), "{errors:?}");
    // it stands still, exactly
    let x = run(1e-3, 1.2 * stop);
    assert!(x[2] == 0.0 || x[2].abs() < 1e-15, "{x:?}");
    assert_eq!(run(1e-3, 3.0)[0], run(1e-3, 3.0)[0]);

    // down a slope of 1: acceleration g (sin − μ cos)
    let mut p = Plane::new(1, &[], G);
    let r = 0.5f64.sqrt();
    let (x, y) = (p.g.x(0), p.g.x(1));
    p.contact("slope", r * (x + y), &[r * (x - y)], mu, 0.0);
    let system = p.build();
    let a = G * r * (1.0 - mu);
    let t = 0.7;
    let errors: Vec<f64> = h
        .iter()
        .map(|&h| {
            let (x, _) = end(&system, &options(h), &[0.0; 4], t);
            ((r * (x[0] - x[1])) - 0.5 * a * t * t).abs()
        })
        .collect();
    assert!(errors.iter().zip(&h).all(|(e, h)| *e < 5.0 * h * h), "{errors:?}");
    // and stays where friction holds it
    let mut p = Plane::new(1, &[], G);
    let (x, y) = (p.g.x(0), p.g.x(1));
    p.contact("slope", r * (x + y), &[r * (x - y)], 1.1, 0.0);
    let (x, _) = end(&p.build(), &options(1e-3), &[0.0; 4], t);
    assert!((x[0] - x[1]).abs() < 1e-6, "{x:?}");
}

/// A disc that slides begins to roll: `v = 2/3 v_0` at `t = v_0 / (3 μ g)`.
#[test]
fn a_disc_begins_to_roll() {
    let g = Graph::new();
    let (m, radius, mu, v0) = (1.5, 0.4, 0.2, 3.0);
    let mut s = Scene::new("disc", 3, 3, 0, 0).unwrap();
    let c = |v: f64| g.constant(v).id();
    let i = 0.5 * m * radius * radius;
    s.set_inertia(&[c(m), c(0.0), c(0.0), c(0.0), c(m), c(0.0), c(0.0), c(0.0), c(i)]).unwrap();
    for (k, f) in [0.0, -m * G, 0.0].into_iter().enumerate() {
        s.set_force(k, c(f)).unwrap();
    }
    let tangent = g.x(0) + radius * g.x(2);
    let floor = Contact { tangents: vec![tangent.id()], friction: c(mu), ..Contact::new(&g, "floor", g.x(1) - radius) };
    s.add_contact(floor).unwrap();
    let system = s.build(&g).unwrap().system;
    let (t_roll, t) = (v0 / (3.0 * mu * G), 1.0);
    let exact = v0 * t_roll - 0.5 * mu * G * t_roll * t_roll + 2.0 / 3.0 * v0 * (t - t_roll);
    let h: Vec<f64> = (0..6).map(|k| 0.0071 / f64::from(1 << k)).collect();
    let mut errors = Vec::new();
    for &h in &h {
        let (x, _) = end(&system, &options(h), &[0.0, radius, 0.0, v0, 0.0, 0.0], t);
        errors.push((x[0] - exact).abs());
        assert!((x[3] - 2.0 / 3.0 * v0).abs() < 1e-9 && (x[3] + radius * x[5]).abs() < 1e-12, "{x:?}");
    }
    assert!(slope(&h, &errors) > 0.8 && errors[0] < 0.02, "{errors:?}");
}

/// Against the event-driven engine: a point that bounces on a parabola, and the two differ by the order of the step.
#[test]
fn the_event_driven_engine_agrees() {
    let g = Graph::new();
    let mut s = Scene::new("parabola", 2, 2, 0, 0).unwrap();
    s.set_force(0, g.constant(0.0).id()).unwrap();
    s.set_force(1, g.constant(-G).id()).unwrap();
    let gap = g.x(1) - 0.3 * g.x(0) * g.x(0);
    s.add_contact(Contact { restitution: g.constant(0.7).id(), ..Contact::new(&g, "curve", gap) }).unwrap();
    let system = s.build(&g).unwrap().system;
    let x0 = [0.4, 1.0, 0.2, 0.0];
    let reference = event::simulate(&system, &event::Options::default(), 0.0, &x0, 1.0).unwrap();
    let exact = reference.x.clone();
    let h: Vec<f64> = (0..8).map(|k| 4.1e-3 / f64::from(1 << k)).collect();
    let distance = |h: f64| {
        let (x, _) = end(&system, &options(h), &x0, 1.0);
        (x[0] - exact[0]).hypot(x[1] - exact[1])
    };
    let errors: Vec<f64> = h.iter().map(|&h| distance(h)).collect();
    assert!(errors.iter().zip(&h).all(|(e, h)| *e < 20.0 * h), "{errors:?}");
    assert!(slope(&h, &errors) > 0.7, "{errors:?}");
}

/// A point that slides without friction in a parabolic bowl sinks in by the order of the square of the step, for ever.
#[test]
fn curved_gaps_do_not_drift() {
    let mut p = Plane::new(1, &[], G);
    let (x, y) = (p.g.x(0), p.g.x(1));
    p.contact("bowl", y - 0.5 * x * x, &[], 0.0, 0.0);
    let system = p.build();

    for h in [4e-3, 2e-3, 1e-3] {
        let (x, _) = end(&system, &options(h), &[0.5, 0.125, 0.0, 0.0], 30.0);
        let gap = x[1] - 0.5 * x[0] * x[0];

        assert!(gap < 1e-12 && gap > -40.0 * h * h, "{h}: {gap}");
        let energy = 0.5 * (x[2] * x[2] + x[3] * x[3]) + G * x[1];
        assert!((energy / (G * 0.125) - 1.0).abs() < 60.0 * h, "{h}: {energy}");
    }
}

/// Without outer forces momentum stays to rounding, whatever collides.
#[test]
fn momentum_is_kept() {
    let n = 8;
    let mut p = Plane::new(n, &[1.0, 2.0, 0.5, 3.0, 1.0, 1.5, 0.7, 2.2], 0.0);
    for i in 0..n {
        for j in 0..i {
            let (dx, dy) = (p.g.x(2 * i) - p.g.x(2 * j), p.g.x(2 * i + 1) - p.g.x(2 * j + 1));
            let e = 0.1 * ((i + j) % 11) as f64;
            p.contact(&format!("{j}-{i}"), (dx * dx + dy * dy).sqrt() - 0.4, &[], 0.0, e);
        }
    }
    let system = p.build();
    let mut x0 = vec![0.0; 4 * n];
    let mass = [1.0, 2.0, 0.5, 3.0, 1.0, 1.5, 0.7, 2.2];
    for i in 0..n {
        let a = i as f64 * 2.4;
        let r = 0.5 + 0.2 * i as f64;
        (x0[2 * i], x0[2 * i + 1]) = (r * a.cos(), r * a.sin());
        (x0[2 * n + 2 * i], x0[2 * n + 2 * i + 1]) = (-2.0 * r * a.cos() + 0.1, -2.0 * r * a.sin());
    }
    let momentum = |x: &[f64]| -> [f64; 2] { [0, 1].map(|k| (0..n).map(|i| mass[i] * x[2 * n + 2 * i + k]).sum()) };
    let energy = |x: &[f64]| -> f64 {
        (0..n).map(|i| 0.5 * mass[i] * x[2 * n + 2 * i..2 * n + 2 * i + 2].iter().map(|v| v * v).sum::<f64>()).sum()
    };
    let (x, stats) = end(&system, &options(1e-3), &x0, 1.0);
    assert!(stats.contacts > 5 && stats.unconverged == 0, "{stats:?}");
    let (a, b) = (momentum(&x0), momentum(&x));
    assert!((0..2).all(|k| (a[k] - b[k]).abs() < 1e-12), "{a:?} {b:?}");
    assert!(energy(&x) < energy(&x0));
}

/// A particle that slides over a plane in space goes straight and stops; with a force across it turns.
#[test]
fn friction_in_space() {
    let g = Graph::new();
    let mut s = Scene::new("space", 3, 3, 0, 0).unwrap();
    for (k, f) in [0.0, 0.0, -G].into_iter().enumerate() {
        s.set_force(k, g.constant(f).id()).unwrap();
    }
    let (x, y) = (g.x(0), g.x(1));
    // tangents that are not unit vectors along the motion
    let r = 0.5f64.sqrt();
    let (a, b) = (r * (x + y), r * (x - y));
    let mu = 0.25;
    let floor =
        Contact { tangents: vec![a.id(), b.id()], friction: g.constant(mu).id(), ..Contact::new(&g, "floor", g.x(2)) };
    s.add_contact(floor).unwrap();
    let system = s.build(&g).unwrap().system;
    let v0: [f64; 2] = [1.5, 0.8];
    let size = v0[0].hypot(v0[1]);
    let way = size * size / (2.0 * mu * G);
    let h: Vec<f64> = (0..5).map(|k| 0.0071 / f64::from(1 << k)).collect();
    let mut errors = Vec::new();
    for &h in &h {
        let (x, _) = end(&system, &options(h), &[0.0, 0.0, 0.0, v0[0], v0[1], 0.0], 1.0);
        let exact = [way * v0[0] / size, way * v0[1] / size];
        errors.push((x[0] - exact[0]).hypot(x[1] - exact[1]));
        assert!((x[0] * v0[1] - x[1] * v0[0]).abs() < 1e-9 * way && x[3].hypot(x[4]) < 1e-12, "{x:?}");
    }
    assert!(slope(&h, &errors) > 0.8 && errors[0] < 0.02, "{errors:?}");
}

/// Newton's law for three equal balls that touch, and for one pair after the other.
#[test]
fn a_chain_of_three_balls() {
    for (law, exact) in
        [(ImpactLaw::Newton, [-1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0]), (ImpactLaw::Sequential, [0.0, 0.0, 1.0])]
    {
        let g = Graph::new();
        let mut s = Scene::new("cradle", 3, 3, 0, 0).unwrap();
        (0..3).for_each(|k| s.set_force(k, g.constant(0.0).id()).unwrap());
        let e = g.constant(1.0).id();
        for k in 0..2 {
            let gap = g.x(k + 1) - g.x(k) - 1.0;
            s.add_contact(Contact { restitution: e, ..Contact::new(&g, &format!("{k}"), gap) }).unwrap();
        }
        let system = s.build(&g).unwrap().system;
        let o = Options { law: Some(law), ..options(0.25) };
        let (x, _) = end(&system, &o, &[-0.5, 1.0, 2.0, 1.0, 0.0, 0.0], 2.0);
        assert!((0..3).all(|k| (x[3 + k] - exact[k]).abs() < 1e-7), "{law:?}: {x:?}");
    }
}

/// With `e = 1` and a constant force a ball keeps its energy to rounding over thousands of impacts.
#[test]
fn elastic_bounces_keep_the_energy() {
    let mut p = Plane::new(1, &[], G);
    p.contact("floor", p.g.x(1), &[], 0.0, 1.0);
    let system = p.build();
    let o = Options { record_every: 100, ..options(1e-2) };
    let run = simulate_steps(&system, &o, 0.0, &[0.0, 1.0, 0.0, 0.0], 1000.0).unwrap();
    assert_eq!((run.times.len(), run.states.len()), (1001, 4004));
    for x in run.states.chunks_exact(4) {
        let energy = 0.5 * x[3] * x[3] + G * x[1];
        assert!((energy / G - 1.0).abs() < 1e-9, "{x:?}: {energy}");
    }
}

/// A body a million times as heavy stands on light ones.
#[test]
fn heavy_on_light() {
    let n = 6;
    let mut mass = [1.0; 6];
    mass[5] = 1e6;
    let mut p = Plane::new(n, &mass, G);
    p.contact("floor", p.g.x(1), &[], 0.0, 0.0);
    for i in 1..n {
        let gap = p.g.x(2 * i + 1) - p.g.x(2 * i - 1) - 0.1;
        p.contact(&format!("{i}"), gap, &[], 0.0, 0.0);
    }
    let mut x0 = vec![0.0; 4 * n];
    (0..n).for_each(|i| x0[2 * i + 1] = 0.1 * i as f64);
    let mut s = Stepper::new(&p.build(), &options(1e-3)).unwrap();
    s.reset(0.0, &x0).unwrap();
    s.advance(0.5).unwrap();
    let (x, stats) = (s.state(), s.statistics());
    assert!((0..n).all(|i| (x[2 * i + 1] - 0.1 * i as f64).abs() < 1e-4), "{x:?}");
    assert_eq!(stats.unconverged, 0, "{stats:?}");
    let weight = (1e6 + 5.0) * G * 1e-3;
    assert!((s.impulses()[0][0] / weight - 1.0).abs() < 1e-6, "{:?} {weight}", s.impulses());
}

/// Lengths, masses and times in other units: the same motion to rounding.
#[test]
fn units_do_not_matter() {
    let run = |length: f64, mass: f64, time: f64| {
        let n = 4;
        let g = G * length / (time * time);
        let mut p = Plane::new(n, &[mass, 2.0 * mass, mass, 0.5 * mass], g);
        for i in 0..n {
            let (x, y) = (p.g.x(2 * i), p.g.x(2 * i + 1));
            p.contact(&format!("floor {i}"), y - 0.2 * length, &[x], 0.3, 0.2);
            for j in 0..i {
                let (dx, dy) = (x - p.g.x(2 * j), y - p.g.x(2 * j + 1));
                p.contact(&format!("{j}-{i}"), (dx * dx + dy * dy).sqrt() - 0.4 * length, &[], 0.0, 0.5);
            }
        }
        let mut x0 = vec![0.0; 4 * n];
        for i in 0..n {
            (x0[2 * i], x0[2 * i + 1]) = (0.1 * i as f64 * length, (0.3 + 0.5 * i as f64) * length);
            x0[2 * n + 2 * i] = 0.5 * length / time;
        }
        let (mut x, stats) = end(&p.build(), &options(1e-3 * time), &x0, 0.8 * time);
        x[..2 * n].iter_mut().for_each(|x| *x /= length);
        x[2 * n..].iter_mut().for_each(|x| *x *= time / length);
        (x, stats)
    };
    let (x, stats) = run(1.0, 1.0, 1.0);
    assert!(stats.contacts > 100 && stats.unconverged == 0, "{stats:?}");
    for k in [1e-6, 1e6] {
        for (l, m, t) in [(k, 1.0, 1.0), (1.0, k, 1.0), (1.0, 1.0, k)] {
            let (other, _) = run(l, m, t);
            let d = x.iter().zip(&other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(d < 1e-6, "({l}, {m}, {t}): {d}");
        }
    }
}

/// Quaternions have more coordinates than velocities, and an inertia may couple and vary.
#[test]
fn rates_and_inertia_that_vary() {
    let g = Graph::new();
    // polar coordinates of a free point of unit mass: the inertia is diag(1, r²), forces centrifugal
    let mut s = Scene::new("polar", 2, 2, 0, 0).unwrap();
    let (r, vr, w) = (g.x(0), g.x(2), g.x(3));
    let zero = g.constant(0.0);
    s.set_inertia(&[g.constant(1.0).id(), zero.id(), zero.id(), (r * r).id()]).unwrap();
    s.set_force(0, (r * w * w).id()).unwrap();
    s.set_force(1, (-2.0 * r * vr * w).id()).unwrap();
    s.add_contact(Contact { restitution: g.constant(1.0).id(), ..Contact::new(&g, "fence", 3.0 - r) }).unwrap();
    let system = s.build(&g).unwrap().system;
    // a straight line at distance 1 from the middle, to the fence and back by reflection
    let t = 4.0;
    let reach = 8f64.sqrt();
    let turned = 2.0 * (reach / 1.0).atan();
    let past = t - reach;
    // behind the reflection the line is the first one turned about the middle
    let along = -reach + past;
    let exact = [1f64.hypot(along), turned + (along / 1.0).atan()];
    let h: Vec<f64> = (0..5).map(|k| 0.0041 / f64::from(1 << k)).collect();
    let errors: Vec<f64> = h
        .iter()
        .map(|&h| {
            let (x, _) = end(&system, &options(h), &[1.0, 0.0, 0.0, 1.0], t);
            (x[0] - exact[0]).abs().max((x[1] - exact[1]).abs())
        })
        .collect();
    assert!(slope(&h, &errors) > 0.7 && errors.iter().zip(&h).all(|(e, h)| *e < 10.0 * h), "{errors:?}");

    // the same point in the plane, with coordinates that move in a frame that turns
    let g = Graph::new();
    let mut s = Scene::new("turning", 2, 2, 0, 0).unwrap();
    let a = 0.7 * g.t();
    let (u, v) = (g.x(2), g.x(3));
    s.set_rates(&[(a.cos() * u - a.sin() * v).id(), (a.sin() * u + a.cos() * v).id()]).unwrap();
    s.set_force(0, (0.7 * v).id()).unwrap();
    s.set_force(1, (-0.7 * u).id()).unwrap();
    s.add_contact(Contact::new(&g, "wall", 100.0 - g.x(0))).unwrap();
    let system = s.build(&g).unwrap().system;
    let errors: Vec<f64> = h
        .iter()
        .map(|&h| {
            let (x, _) = end(&system, &options(h), &[0.0, 0.0, 1.0, 0.5], 2.0);
            (x[0] - 2.0).hypot(x[1] - 1.0)
        })
        .collect();
    assert!(slope(&h, &errors) > 0.9 && errors[0] < 0.02, "{errors:?}");
}

#[test]
fn steppers_run_on_threads() {
    let alone = {
        let mut s = pile(&options(1e-3));
        s.advance(0.2).unwrap();
        s.state().to_vec()
    };
    let mut steppers: Vec<Stepper> = (0..3).map(|_| pile(&options(1e-3))).collect();
    std::thread::scope(|scope| {
        for s in &mut steppers {
            scope.spawn(|| s.advance(0.2).unwrap());
        }
    });
    assert!(steppers.iter().all(|s| s.state() == alone));
}

#[test]
fn records_and_interrupts() {
    let mut p = Plane::new(1, &[], G);
    p.contact("floor", p.g.x(1), &[], 0.0, 0.0);
    let system = p.build();
    let o = Options { record_every: 7, record_impulses: true, ..options(0.01) };
    let run = simulate_steps(&system, &o, 2.0, &[0.0, 0.1, 0.0, 0.0], 3.0).unwrap();
    assert_eq!(run.statistics.steps, 100);
    // the start, every seventh step and the last
    assert_eq!((run.times.len(), run.states.len()), (16, 64));
    assert_eq!((run.times[0], run.times[15]), (2.0, 3.0));
    assert!(run.impulses.windows(2).all(|w| w[0].record < w[1].record));
    let last = run.impulses.last().unwrap();
    assert!(last.record == 15 && last.contact == 0 && (last.impulse[0] - 0.01 * G).abs() < 1e-12, "{last:?}");

    let flag = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(true));
    let mut s = Stepper::new(&system, &options(1e-3)).unwrap();
    s.reset(0.0, &[0.0, 0.1, 0.0, 0.0]).unwrap();
    let r = switchback::stop::Stop::on(&flag).scope(|| s.advance(1.0));
    assert_eq!((r, s.time()), (Err(switchback::error::Error::Interrupted), 0.0));
    s.advance(1.0).unwrap();
    assert_eq!(s.time(), 1.0);
}

#[test]
fn bad_input_is_named() {
    let mut p = Plane::new(1, &[], G);
    p.contact("floor", p.g.x(1), &[p.g.x(0)], 0.5, 0.3);
    let system = p.build();
    let of = |o: Options| Stepper::new(&system, &o).err().map(|e| e.to_string()).unwrap_or_default();
    for h in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(of(options(h)).contains("the step h is"), "{h}");
    }
    assert!(of(Options { theta: 0.2, ..Options::default() }).contains("theta is 0.2"));
    assert!(of(Options { tolerance: 0.0, ..Options::default() }).contains("tolerance"));
    assert!(of(Options { max_iterations: 0, ..Options::default() }).contains("max_iterations"));
    let mut plain = System::new(1, 0, 0).unwrap();
    plain.set_f0(std::sync::Arc::new(switchback::func::Callback::new("f", plain.dims(), 1, |_, _| 0))).unwrap();
    assert!(Stepper::new(&plain, &options(1e-3)).err().unwrap().to_string().contains("no scene"));
    let mut s = Stepper::new(&system, &options(1e-3)).unwrap();
    assert!(s.step().unwrap_err().to_string().contains("set its state first"));
    assert!(s.reset(0.0, &[0.0; 3]).is_err() && s.reset(0.0, &[f64::NAN, 1.0, 0.0, 0.0]).is_err());
    let e = s.reset(0.0, &[0.0, -0.5, 0.0, 0.0]).unwrap_err().to_string();
    assert!(e.contains("the gap of contact floor is -0.5"), "{e}");
    assert!(s.set_params(&[1.0]).is_err() && s.set_controls(&[1.0]).is_err());
    s.reset(0.0, &[0.0, 1.0, 0.0, 0.0]).unwrap();
    assert!(s.advance(-1.0).unwrap_err().to_string().contains("steps go forward"));
    s.advance(0.0).unwrap();
    assert!(simulate_steps(&system, &options(1e-3), 0.0, &[0.0, 1.0, 0.0, 0.0], f64::NAN).is_err());

    // bounds that contacts were left out for are kept
    let g = Graph::new();
    let mut scene = Scene::new("bounds", 1, 1, 0, 0).unwrap();
    scene.set_force(0, g.constant(-1.0).id()).unwrap();
    scene.set_bounds(0, -1.0, 5.0).unwrap();
    scene.add_contact(Contact::new(&g, "deep", g.x(0) + 2.0)).unwrap();
    let system = scene.build(&g).unwrap().system;
    let e = simulate_steps(&system, &options(1e-2), 0.0, &[1.0, 0.0], 5.0).unwrap_err().to_string();
    assert!(e.contains("outside of the bounds"), "{e}");
    assert!(simulate_steps(&system, &options(1e-2), 0.0, &[6.0, 0.0], 5.0).is_err());

    // what depends on parameters is seen when it is evaluated
    let g = Graph::new();
    let mut scene = Scene::new("p", 2, 2, 0, 3).unwrap();
    let zero = g.constant(0.0).id();
    scene.set_force(0, g.constant(-1.0).id()).unwrap();
    scene.set_force(1, zero).unwrap();
    scene.set_inertia(&[g.p(2).id(), zero, zero, g.p(2).id()]).unwrap();
    let smooth = Contact { friction: g.p(0).id(), restitution: g.p(1).id(), ..Contact::new(&g, "floor", g.x(0)) };
    let mut wrong = scene.clone();
    wrong.add_contact(smooth.clone()).unwrap();
    assert!(wrong.build(&g).err().unwrap().to_string().contains("floor has friction and no tangents"));
    scene.add_contact(Contact { tangents: vec![g.x(1).id()], ..smooth }).unwrap();
    let system = scene.build(&g).unwrap().system;
    for (p, text) in [
        ([-0.1, 0.0, 1.0], "the friction of contact floor is -0.1"),
        ([0.0, 1.5, 1.0], "the restitution of contact floor is 1.5"),
        ([0.0, 0.0, -1.0], "not positive definite"),
    ] {
        let mut s = Stepper::new(&system, &options(1e-3)).unwrap();
        s.set_params(&p).unwrap();
        let r = s.reset(0.0, &[0.0, 0.0, -1.0, 0.0]).and_then(|()| s.step());
        assert!(r.unwrap_err().to_string().contains(text), "{text}");
    }
}
