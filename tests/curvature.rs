//! Second derivatives of event-driven runs: derivatives of gradients in a direction, against differences of gradients.

use switchback::event::{Along, Engine, Gradient, Options};
use switchback::expr::Graph;
use switchback::model::{Built, Model, Transition};
use switchback::system::{Direction, Effect, Rule};

/// A spring with friction, which comes to rest, and a push where `q > 0.5`: crossings, a sliding mode, and its end in another run.
fn spring() -> Built {
    let g = Graph::new();
    let (q, v) = (g.x(0), g.x(1));
    let push = 0.5 * (1.0 + (q - 0.5 * g.p(0)).sign()) * g.u(0) * v.cos();
    let rhs = [v, -1.0 * g.p(0) * q - 0.1 * q.powi(3) - g.p(1) * (1.0 + 0.2 * v * v) * v.sign() + push];
    Model::from_rhs("spring", 1, 2, &rhs).unwrap().build(&g).unwrap()
}

/// A block on a belt with the velocity `p1 + 0.3 sin t`: it sticks, and slips again.
fn belt() -> Built {
    let g = Graph::new();
    let (q, v) = (g.x(0), g.x(1));
    let slip = v - g.p(1) - 0.3 * g.t().sin();
    let rhs = [v, -1.0 * q - 0.05 * v.powi(3) - g.p(0) * slip.sign() / (1.0 + slip * slip) + g.u(0) * q.sin()];
    Model::from_rhs("belt", 1, 2, &rhs).unwrap().build(&g).unwrap()
}

/// A ball with drag that bounces on a table whose height depends on time and a parameter.
fn ball(stops: bool) -> Built {
    let g = Graph::new();
    let (y, v) = (g.x(0), g.x(1));
    let rhs = [v, -9.81 - g.p(0) * v * v.abs() + g.u(0) * y.sin()];
    let mut m = Model::from_rhs("ball", 1, 2, &rhs).unwrap();
    let guard = (y - 0.1 * g.p(1) * (1.0 + (2.0 * g.t()).sin())).id();
    if stops {
        let rule = Rule::event("down", Effect::Stop);
        m.add_transition(Transition {
            direction: Direction::Falling,
            rule,
            ..Transition::event("down", Effect::Stop, guard)
        });
    } else {
        let reset = vec![(1, (-0.8 * v + 0.1 * g.p(1) * v * v + 0.05 * g.t()).id())];
        let (from, to, rule) = (vec![], vec![], Rule::default());
        m.add_transition(Transition { guard, direction: Direction::Falling, from, reset, to, rule });
    }
    m.build(&g).unwrap()
}

/// A point of data.
#[derive(Clone)]
struct Data {
    x0: Vec<f64>,
    p: Vec<f64>,
    u: Vec<f64>,
}

impl Data {
    fn moved(&self, d: &Gradient, h: f64) -> Data {
        let add = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a + h * b).collect();
        Data { x0: add(&self.x0, &d.x0), p: add(&self.p, &d.p), u: add(&self.u, &d.u) }
    }
}

fn engine(b: &Built, data: &Data, end: f64) -> Engine {
    let options = Options { adjoint: true, ..Options::with_tolerance(1e-12, 1e-13) };
    let mut e = Engine::new(&b.system, &options).unwrap();
    e.set_params(&data.p).unwrap();
    e.set_controls(&data.u).unwrap();
    e.reinit(0.0, &data.x0).unwrap();
    e.advance(end).unwrap();
    e
}

fn flat(g: &Gradient) -> Vec<f64> {
    [&g.x0[..], &g.p, &g.u].concat()
}

/// Differences of gradients, of fourth order.
fn differences(b: &Built, data: &Data, end: f64, v: &[f64], d: &Gradient) -> Vec<f64> {
    let h = 2e-3;
    let at = |by: f64| flat(&engine(b, &data.moved(d, by * h), end).adjoint(v, &[]).unwrap());
    let (a, b, c, e) = (at(-2.0), at(-1.0), at(1.0), at(2.0));
    (0..a.len()).map(|i| (a[i] - 8.0 * b[i] + 8.0 * c[i] - e[i]) / (12.0 * h)).collect()
}

fn check(name: &str, b: &Built, data: &Data, end: f64, events: usize) {
    let v = [1.0, -0.7];
    let directions = [
        Gradient { x0: vec![0.3, -0.2], p: vec![0.0; 2], u: vec![0.0] },
        Gradient { x0: vec![0.0; 2], p: vec![0.2, 0.5], u: vec![0.0] },
        Gradient { x0: vec![0.2, 0.4], p: vec![0.1, -0.3], u: vec![0.7] },
    ];
    let mut e = engine(b, data, end);
    let found = e.switches().len() + e.jumps().len();
    assert!(found >= events, "{name}: {found} {}", e.reason());
    for d in &directions {
        let Along { gradient, derivative, state } = e.adjoint_along(&v, d).unwrap();
        let own = e.adjoint(&v, &[]).unwrap();
        let off =
            |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs() / (1.0 + b.abs())).fold(0.0, f64::max);
        assert!(off(&flat(&gradient), &flat(&own)) < 1e-12, "{name}");
        let exact = differences(b, data, end, &v, d);
        let found = flat(&derivative);
        assert!(off(&found, &exact) < 1e-6, "{name}: {found:?} and not {exact:?}");
        let h = 1e-5;
        let (a, c) = (engine(b, &data.moved(d, -h), end), engine(b, &data.moved(d, h), end));
        let along: Vec<f64> = a.state().iter().zip(c.state()).map(|(a, c)| (c - a) / (2.0 * h)).collect();
        assert!(off(&state, &along) < 1e-6, "{name}: {state:?} and not {along:?}");
    }
    // the engine goes on as if nothing had been asked
    let mut other = engine(b, data, end);
    if e.time() == end {
        e.advance(end + 0.5).unwrap();
        other.advance(end + 0.5).unwrap();
        assert_eq!(e.state(), other.state(), "{name}");
    }
}

#[test]
fn through_crossings_and_sliding_modes() {
    let data = Data { x0: vec![1.2, 0.3], p: vec![1.3, 0.25], u: vec![0.15] };
    check("spring", &spring(), &data, 2.0, 2);
    check("spring that rests", &spring(), &data, 6.0, 4);
    let data = Data { x0: vec![0.8, 0.0], p: vec![0.9, 0.5], u: vec![0.2] };
    check("belt", &belt(), &data, 8.0, 2);
}

#[test]
fn through_resets_and_to_the_time_of_an_end() {
    let data = Data { x0: vec![1.0, 0.4], p: vec![0.05, 0.6], u: vec![0.3] };
    check("ball", &ball(false), &data, 1.6, 6);
    check("fall", &ball(true), &data, 3.0, 1);
}

#[test]
fn what_has_none_is_refused() {
    let data = Data { x0: vec![1.0, 0.4], p: vec![0.05, 0.6], u: vec![0.3] };
    let b = ball(false);
    let none = Gradient { x0: vec![0.0; 2], p: vec![0.0; 2], u: vec![0.0] };
    let mut e = engine(&b, &data, 1.0);
    assert!(e.adjoint_along(&[1.0], &none).is_err());
    assert!(e.adjoint_along(&[1.0, 0.0], &Gradient { x0: vec![f64::NAN, 0.0], ..none.clone() }).is_err());
    assert!(e.adjoint_along(&[1.0, 0.0], &Gradient { p: vec![], ..none.clone() }).is_err());
    assert!(flat(&e.adjoint_along(&[1.0, 0.0], &none).unwrap().derivative).iter().all(|v| *v == 0.0));
    let mut plain = Engine::new(&b.system, &Options::default()).unwrap();
    plain.reinit(0.0, &data.x0).unwrap();
    plain.advance(0.1).unwrap();
    assert!(plain.adjoint_along(&[1.0, 0.0], &none).is_err());
}
