//! Automata and hysteresis with solutions in closed form (`tests/data/reference/scenes`), and rooms with a thermostat each.
#![allow(dead_code)]

use switchback::expr::{Expr, Graph, Id, Piecewise};
use switchback::model::{Built, Model, Transition};
use switchback::system::Direction::{self, Falling, Rising};
use switchback::system::Rule;

/// Name of a reference and its model.
pub type Automaton = (&'static str, fn() -> Built);

/// The automata with references.
pub const AUTOMATA: [Automaton; 4] =
    [("thermostat_run", thermostat), ("relay_hysteresis_run", relay), ("two_tanks", two_tanks), ("gear_box", gear_box)];

/// Where the guard passes zero: between which values of a discrete state.
fn edge(guard: Expr, direction: Direction, state: usize, (from, to): (f64, f64)) -> Transition {
    Transition {
        guard: guard.id(),
        direction,
        from: vec![(state, from)],
        reset: vec![],
        to: vec![(state, to)],
        rule: Rule::default(),
    }
}

/// A value that goes from `low` to 1 above `on`, and back below `off`.
fn hysteresis(m: &mut Model, value: Expr, on: Expr, off: Expr, state: usize, low: f64) {
    m.add_transition(edge(value - on, Rising, state, (low, 1.0)));
    m.add_transition(edge(value - off, Falling, state, (1.0, low)));
}

fn model(g: &Graph, np: usize, rhs: &[Expr], initial: &[f64], add: impl FnOnce(&mut Model)) -> Built {
    let zeros = vec![g.constant(0.0); initial.len()];
    let mut m = Model::from_rhs("automaton", 0, np, &[rhs, &zeros].concat()).unwrap();
    m.set_discrete(initial).unwrap();
    add(&mut m);
    m.build(g).unwrap()
}

/// `x' = P w - k x` with the parameters k, P and the thresholds of w.
pub fn thermostat() -> Built {
    let g = Graph::new();
    let (x, w) = (g.x(0), g.x(1));
    let [k, heat, lo, hi] = [0, 1, 2, 3].map(|i| g.p(i));
    model(&g, 4, &[heat * w - k * x], &[1.0], |m| hysteresis(m, -x, -lo, -hi, 1, 0.0))
}

/// `x' = u - x`, u goes over from 1 to -1 above d and back below -d.
pub fn relay() -> Built {
    let g = Graph::new();
    let (x, u, d) = (g.x(0), g.x(1), g.p(0));
    model(&g, 1, &[u - x], &[1.0], |m| {
        m.add_transition(edge(x - d, Rising, 1, (1.0, -1.0)));
        m.add_transition(edge(x + d, Falling, 1, (-1.0, 1.0)));
    })
}

/// The thresholds of the pump depend on the valve: hysteresis drives hysteresis.
pub fn two_tanks() -> Built {
    let g = Graph::new();
    let [h1, h2, pump, valve] = [0, 1, 2, 3].map(|i| g.x(i));
    let [q, k1, k2, c, lo, hi, b, d] = [0, 1, 2, 3, 4, 5, 6, 7].map(|i| g.p(i));
    let rhs = [q * pump - k1 * h1, k1 * h1 - k2 * h2 - c * valve];
    model(&g, 8, &rhs, &[0.0, 0.0], |m| {
        hysteresis(m, -h1, 0.25 * valve - lo, 0.25 * valve - hi, 2, 0.0);
        hysteresis(m, h2, b, d, 3, 0.0);
    })
}

/// A gear box asks whether the driver drives; going up it brakes the car and wears by the speed.
pub fn gear_box() -> Built {
    let g = Graph::new();
    let [v, wear, gear, drives] = [0, 2, 3, 4].map(|i| g.x(i));
    let [a, d, e, r] = [0, 1, 2, 3].map(|i| g.p(i));
    let ratios = Piecewise::steps(&[1.5, 2.5], &[3.0, 1.5, 1.0]).unwrap();
    let rhs = [a * g.piecewise(&ratios, gear) * drives - d * v, v, g.constant(0.0)];
    model(&g, 4, &rhs, &[1.0, 1.0], |m| {
        let reset = |m: &mut Model, t: Transition, reset: Vec<(usize, Id)>| m.add_transition(Transition { reset, ..t });
        for (from, above) in [(1.0, 10.0), (2.0, 18.0)] {
            let mut t = edge(v - above, Rising, 3, (from, from + 1.0));
            t.from.push((4, 1.0));
            reset(m, t, vec![(0, ((1.0 - e) * v).id()), (2, (wear + r * v * v).id())]);
        }
        for (from, below) in [(2.0, 7.0), (3.0, 13.0)] {
            reset(m, edge(v - below, Falling, 3, (from, from - 1.0)), vec![(2, (wear + r).id())]);
        }
        m.add_transition(edge(v - 24.0, Rising, 4, (1.0, 0.0)));
        m.add_transition(edge(v - 6.0, Falling, 4, (0.0, 1.0)));
    })
}

/// Rooms in a row that exchange heat, each with a thermostat that goes on below `p0` and off above `p1`.
pub fn rooms(n: usize) -> Built {
    let g = Graph::new();
    let (t, w): (Vec<Expr>, Vec<Expr>) = (0..n).map(|i| (g.x(i), g.x(n + i))).unzip();
    let own = |i: usize| 8.0 * w[i] - (0.2 + 0.01 * i as f64) * t[i];
    let between = |i: usize, j: usize| 0.1 * (t[j] - t[i]);
    let rhs: Vec<Expr> = (0..n)
        .map(|i| {
            let left = if i > 0 { own(i) + between(i, i - 1) } else { own(i) };
            if i + 1 < n {
                left + between(i, i + 1)
            } else {
                left
            }
        })
        .collect();
    model(&g, 2, &rhs, &vec![0.0; n], |m| {
        for (i, t) in t.iter().enumerate() {
            hysteresis(m, -*t, -g.p(0), -g.p(1), n + i, 0.0);
        }
    })
}
