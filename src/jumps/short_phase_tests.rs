//! Orders with phases that are next to nothing, on another grid.

use super::chain_tests::ball_from;
use super::modes::{ContactMode, Phase, Sequence};
use super::options::{Lead, Method, Options};
use super::problem::{Problem, Statement};
use super::search::solve_again;
use super::simulate::simulate;
use super::space::Reach;
use crate::mpcc::MpccSettings;
use crate::nlp::Control;

/// A ball that rests on a floor cannot leave it: an order in which it does has no solution, and the one without that phase has.
#[test]
fn orders_without_a_solution_are_tried_without_their_short_phases() {
    let p = Problem::new(Statement { n_fe: vec![4], ..ball_from(0.0) }).unwrap();
    let given = p.given();
    let x0 = given.x0_bounds[0].clone();
    let rests = simulate(&p, &x0, &[0.0], &given.durations).unwrap().track(&p, &[0.0], &given.durations).unwrap();
    let phase =
        |mode, jump: Option<ContactMode>, share| Phase { modes: vec![mode], jump: jump.map(|j| vec![j]), share };
    let stage = vec![
        phase(ContactMode::Closed, None, 0.5),
        phase(ContactMode::Open, None, 1e-3),
        phase(ContactMode::Closed, Some(ContactMode::Closed), 0.5),
    ];
    let hops = Sequence { stages: vec![stage] };
    let options = Options {
        method: Method::Auto,
        solver: MpccSettings::default(),
        n_fe: 4,
        rho_h: 1.0,
        effort: 1.0,
        gain: 1e-3,
        least_tried: 0,
        has_costs: false,
        lead: Lead::Guess,
        controls: vec![0.0],
        x0,
        states: None,
        sequence: None,
    };
    let with = (&options, Reach::Wanted);
    let found = solve_again(&p, (&hops, &rests), with, usize::MAX, &mut Control::default()).unwrap();
    let (answer, _) = found.solution().expect("an answer without the hop");
    assert_eq!(answer.sequence.key(), [[(vec![ContactMode::Closed], None)]]);
}
