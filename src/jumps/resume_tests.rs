//! Simulations from the start of a control stage on, and one after the other by the same engine.

use super::problem::{Problem, Statement};
use super::simulate::{engine, run, Effort, Ends, Inputs, Simulated};
use crate::event::Engine;
use crate::expr::Graph;
use crate::func::Dims;
use crate::scene::{Contact, Scene};

const STAGES: usize = 8;
const TOLERANCE: f64 = 1e-8;
const EFFORT: Effort =
    Effort { tolerance: TOLERANCE, sizes: &[], max_steps: 10_000, max_events: 1000, dense: false, bounded: true };

/// A block falls on a rough floor with a wall at its end, and a ball bounces beside it: contacts that slide, stick, and open again.
fn problem() -> Problem {
    let g = Graph::new();
    let (x, y, ball) = (g.x(0), g.x(1), g.x(2));
    let mut scene = Scene::new("block and ball", 3, 3, 1, 0).unwrap();
    scene.set_force(0, g.u(0).id()).unwrap();
    scene.set_force(1, g.constant(-9.81).id()).unwrap();
    scene.set_force(2, g.constant(-9.81).id()).unwrap();
    let floor = Contact { friction: g.constant(0.4).id(), tangents: vec![x.id()], ..Contact::new(&g, "floor", y) };
    scene.add_contact(floor).unwrap();
    scene.add_contact(Contact::new(&g, "wall", -x + 0.6)).unwrap();
    scene.add_contact(Contact { restitution: g.constant(0.7).id(), ..Contact::new(&g, "ball", ball) }).unwrap();
    let system = scene.build(&g).unwrap().system;
    Problem::new(Statement::bare(system, Dims { x: 6, u: 1, p: 0 }, vec![0.25; STAGES])).unwrap()
}

const START: [f64; 6] = [0.0, 0.3, 0.8, 0.0, 0.0, 0.0];

fn simulate(p: &Problem, controls: &[f64], from: (usize, &Ends)) -> Simulated {
    simulate_by(&mut engine(p, EFFORT).unwrap(), p, &START, controls, from)
}

fn simulate_by(e: &mut Engine, p: &Problem, x0: &[f64], controls: &[f64], from: (usize, &Ends)) -> Simulated {
    let given = p.given();
    let inputs = Inputs { x0, controls, durations: &given.durations, params: &given.params };
    run(p, e, inputs, EFFORT.max_events, from).unwrap()
}

#[test]
fn motions_go_on_from_the_start_of_any_stage() {
    let p = problem();
    let controls = [6.0, 6.0, -2.0, -8.0, 3.0, 5.0, 0.0, 9.0];
    let whole = simulate(&p, &controls, (0, &Ends::default()));
    let known = Ends { times: whole.times.clone(), states: whole.states.clone() };
    for first in 1..STAGES {
        let mut other = controls;
        other[first..].iter_mut().for_each(|u| *u += 1.0);
        let all = simulate(&p, &other, (0, &Ends::default()));
        let rest = simulate(&p, &other, (first, &known));
        assert_eq!(rest.times, all.times);
        let off = all.states.iter().zip(&rest.states).fold(0.0, |m, (a, b)| f64::max(m, (a - b).abs()));
        // errors of both, which impacts make larger
        assert!(off < 100.0 * TOLERANCE, "from stage {first}: {off:e}");
        let moved = all.states.iter().zip(&whole.states).fold(0.0, |m, (a, b)| f64::max(m, (a - b).abs()));
        assert!(moved > 1e-2, "the controls say nothing from stage {first} on: {moved:e}");
    }
}

/// The first run ends with the block held at the wall by its control, which holds it on the floor back, too; others begin away from the wall,
/// sliding, and in the middle of a known one.
#[test]
fn an_engine_that_is_used_again_makes_the_same_runs_to_the_last_bit() {
    let p = problem();
    let mut used = engine(&p, EFFORT).unwrap();
    let held = simulate_by(&mut used, &p, &START, &[9.0; STAGES], (0, &Ends::default()));
    let last = held.run.phases.last().unwrap();
    assert!(last.modes[0] != 0 && last.modes[1] != 0, "{:?}", last.modes);
    assert!((held.run.x[0] - 0.6).abs() < TOLERANCE && held.run.x[3].abs() < TOLERANCE, "{:?}", held.run.x);
    let known = Ends { times: held.times.clone(), states: held.states.clone() };
    let sliding = [0.38, 0.0, 0.2, 1.0, 0.0, 0.0];
    let nowhere = Ends::default();
    let there_and_back = [-1.0, -1.0, 6.0, 9.0, 9.0, 9.0, 9.0, 9.0];
    let returns = [9.0, 9.0, 9.0, 9.0, -8.0, 1.0, 9.0, 9.0];
    let runs = [
        (sliding, there_and_back, (0, &nowhere)),
        (START, returns, (4, &known)),
        (sliding, [0.0; STAGES], (0, &nowhere)),
        (START, [9.0; STAGES], (0, &nowhere)),
    ];
    for (k, (x0, controls, from)) in runs.iter().enumerate() {
        let again = simulate_by(&mut used, &p, x0, controls, *from);
        let fresh = simulate_by(&mut engine(&p, EFFORT).unwrap(), &p, x0, controls, *from);
        assert_eq!(again.times, fresh.times, "run {k}");
        assert_eq!(again.states, fresh.states, "run {k}");
        assert_eq!(again.run.impacts, fresh.run.impacts, "run {k}");
        assert_eq!(again.run.phases, fresh.run.phases, "run {k}");
        assert_eq!(again.run.stats, fresh.run.stats, "run {k}");
    }
}
