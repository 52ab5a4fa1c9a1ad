//! Problems of several phases, with known answers.

mod common;
use common::models::*;
use common::*;
use std::sync::Arc;
use switchback::error::Error;
use switchback::func::{Callback, Dims};
use switchback::mpcc::Polish;
use switchback::nlp::{Control, Outcome};
use switchback::ocp::{Durations, MultiPhase, MultiPhaseResult, Ocp};
use switchback::settings::Settings;
use switchback::system::{SharedFunction, System};

fn solved(m: &mut MultiPhase) -> MultiPhaseResult {
    let r = m.solve(&mut Control::default()).unwrap().clone();
    assert_eq!((r.outcome, r.polish), (Outcome::Solved, Polish::Done), "{} {:?}", r.message, r.residuals);
    assert!(r.link_violation < 1e-10 && r.message.is_empty(), "{} {}", r.link_violation, r.message);
    r
}

/// The sliding-mode problem on part of its horizon.
fn part(set: &Settings, stages: usize, first: bool, last: bool) -> Ocp {
    let sys = sliding_mode();
    let mut o = Ocp::new(&sys, 4.0 / 6.0 * stages as f64, stages, set).unwrap();
    let whole = sliding_ocp(set);
    let s = whole.statement();
    o.set_lagrange(s.lagrange.unwrap().clone()).unwrap();
    o.set_x_bounds(&s.x_bounds[0], &s.x_bounds[1]).unwrap();
    o.set_u_bounds(&s.u_bounds[0], &s.u_bounds[1]).unwrap();
    if first {
        o.set_x0(&s.x0_bounds[0]).unwrap();
    }
    for t in s.terminal.iter().filter(|_| last) {
        o.add_terminal(t.f.clone(), &t.lower, &t.upper).unwrap();
    }
    o
}

#[test]
fn two_phases_of_one_system_are_one() {
    let set = settings(RadauIia, 2, 4, FESD);
    // phases are solved by the homotopy, which finds the better of two optima here
    let mut one = sliding_ocp(&from_all_starts(set));
    let one = one.solve(&mut Control::default()).unwrap();
    let mut m = MultiPhase::new(vec![part(&set, 2, true, false), part(&set, 4, false, true)]).unwrap();
    m.link_continuous(0).unwrap();
    let two = solved(&mut m);
    assert_near(&[two.cost], &[one.cost], 1e-9, "cost");
    let controls: Vec<f64> = two.phases.iter().flat_map(|p| p.controls.clone()).collect();
    assert_near(&controls, &one.controls, 1e-6, "controls");
    let times = |r: &[switchback::fesd::Switch]| r.iter().map(|s| s.t).collect::<Vec<f64>>();
    let switches: Vec<f64> = two.phases.iter().flat_map(|p| times(&p.trajectory.switches)).collect();
    // the optimum is flat: times are known to the root of what the cost is known to
    assert_near(&switches, &times(&one.trajectory.switches), 1e-7, "switches");
    assert_eq!(two.phases[1].trajectory.elements[0].t, 4.0 / 6.0 * 2.0);
    assert!(two.error < 1e-5, "{}", two.error);
    // again, from another start: nothing is built a second time
    m.phase_mut(0).unwrap().set_x0(&SLIDING_X0.map(|v| v + 0.01)).unwrap();
    let moved = solved(&mut m);
    assert!((moved.cost - two.cost).abs() < 0.5 && moved.cost != two.cost);
}

fn row(f: &str, d: Dims, entries: &[(usize, usize, f64)]) -> SharedFunction {
    let n = entries.iter().map(|e| e.0 + 1).max().unwrap_or(1);
    affine(f, d, &vec![0.0; n], entries)
}

/// A rocket burns its fuel and flies on without its tank: the apex is highest with full thrust to the end.
#[test]
fn a_launch_loses_a_state() {
    let (g, c, thrust, empty) = (1.0, 2.0, 3.0, 0.4);
    let d = Dims { x: 3, u: 1, p: 0 };
    let mut s = System::new(3, 1, 0).unwrap();
    let f = Callback::new("burn", d, 3, move |at, o| {
        (o[0], o[1], o[2]) = (at.x[1], at.u[0] / at.x[2] - g, -at.u[0] / c);
        0
    });
    let entries = [(0, 1), (1, 2), (1, 3), (2, 3)];
    let f = f.with_jacobian(pattern(3, 5, &entries), move |at, o| {
        // columns v, m, u
        (o[0], o[1]) = (1.0, -at.u[0] / (at.x[2] * at.x[2]));
        (o[2], o[3]) = (1.0 / at.x[2], -1.0 / c);
        0
    });
    s.set_f0(Arc::new(f.unwrap())).unwrap();
    let mut burn = Ocp::new(&s, 0.5, 4, &settings(RadauIia, 5, 2, FESD)).unwrap();
    burn.set_x0(&[0.0, 0.0, 1.0]).unwrap();
    burn.set_x_bounds(&[-0.1, -0.1, empty], &[5.0; 3]).unwrap();
    burn.set_u_bounds(&[0.0], &[thrust]).unwrap();
    burn.set_free_time(Durations::Horizon, 0.1, 2.0).unwrap();
    burn.set_u_guess(&[2.0; 4]).unwrap();
    let d = Dims { x: 2, u: 0, p: 0 };
    let mut s = System::new(2, 0, 0).unwrap();
    s.set_f0(affine("fall", d, &[0.0, -g], &[(0, 1, 1.0)])).unwrap();
    let mut coast = Ocp::new(&s, 0.5, 1, &settings(RadauIia, 2, 1, FESD)).unwrap();
    coast.set_x_bounds(&[-1.0; 2], &[5.0; 2]).unwrap();
    coast.set_free_time(Durations::Horizon, 0.0, 3.0).unwrap();
    coast.set_mayer(row("height", d, &[(0, 0, -1.0)])).unwrap();
    coast.add_terminal(row("apex", d, &[(0, 1, 1.0)]), &[0.0], &[0.0]).unwrap();
    let mut m = MultiPhase::new(vec![burn, coast]).unwrap();
    assert!(matches!(m.link_continuous(0), Err(Error::Dimension(_))));
    let link = m.link_dims(0).unwrap();
    assert_eq!((link.x, link.u, link.p), (5, 0, 0));
    let same = row("same", link, &[(0, 0, -1.0), (1, 1, -1.0), (0, 3, 1.0), (1, 4, 1.0)]);
    m.link(0, same, &[0.0; 2], &[0.0; 2]).unwrap();
    let r = solved(&mut m);
    // m = 1 − q t with q = thrust / c
    let (q, t) = (thrust / c, c * (1.0 - empty) / thrust);
    let v = -c * empty.ln() - g * t;
    let h = c * (t + empty / q * empty.ln()) - c * (1.0 - q * t - empty) - 0.5 * g * t * t;
    assert_near(&[r.cost], &[-(h + 0.5 * v * v / g)], 1e-8, "height");
    assert_near(&r.phases[0].controls, &[thrust; 4], 1e-8, "thrust");
    assert_near(&[r.phases[0].durations.iter().sum()], &[t], 1e-8, "burn");
    assert_near(&[r.phases[1].durations[0]], &[v / g], 1e-8, "coast");
    assert_eq!(r.phases[1].trajectory.nx(), 2);
}

/// A ball falls, loses half of its speed, and rises to a quarter of its height; every phase is as long as it takes.
#[test]
fn a_jump_between_phases() {
    let d = Dims { x: 2, u: 0, p: 0 };
    let mut s = System::new(2, 0, 0).unwrap();
    s.set_f0(affine("fall", d, &[0.0, -9.81], &[(0, 1, 1.0)])).unwrap();
    let set = settings(RadauIia, 2, 1, FESD);
    let flight = |state: usize| {
        let mut o = Ocp::new(&s, 0.5, 1, &set).unwrap();
        o.set_free_time(Durations::Horizon, 0.0, 5.0).unwrap();
        o.add_terminal(row("end", d, &[(0, state, 1.0)]), &[0.0], &[0.0]).unwrap();
        o
    };
    let mut down = flight(0);
    down.set_x0(&[1.0, 0.0]).unwrap();
    let mut m = MultiPhase::new(vec![down, flight(1)]).unwrap();
    let link = m.link_dims(0).unwrap();
    let jump = Callback::new("jump", link, 2, |at, o| {
        o[0] = at.x[2] - at.x[0];
        // as energies, so that the link is not linear
        o[1] = at.x[3] * at.x[3] - 0.25 * at.x[1] * at.x[1];
        0
    });
    m.link(0, Arc::new(jump), &[0.0; 2], &[0.0; 2]).unwrap();
    let mut rise = row("rise", link, &[(0, 3, 1.0)]);
    m.link(0, rise.clone(), &[0.0], &[f64::INFINITY]).unwrap();
    m.phase_mut(1).unwrap().set_x_guess(&[0.0], &[0.0, 1.0]).unwrap();
    let r = solved(&mut m);
    let fall = (2.0f64 / 9.81).sqrt();
    assert_near(&r.phases[1].trajectory.elements[0].x1, &[0.25, 0.0], 1e-8, "apex");
    let times = [r.phases[0].durations[0], r.phases[1].durations[0]];
    assert_near(&times, &[fall, 0.5 * fall], 1e-8, "times");
    assert!(r.error < 1e-9);
    assert!(matches!(m.link(1, rise.clone(), &[0.0], &[0.0]), Err(Error::Range(_))));
    assert!(matches!(m.link(0, rise.clone(), &[0.0; 2], &[0.0; 2]), Err(Error::Dimension(_))));
    rise = row("rise", d, &[(0, 1, 1.0)]);
    assert!(matches!(m.link(0, rise, &[0.0], &[0.0]), Err(Error::Dimension(_))));
    assert!(MultiPhase::new(Vec::new()).is_err());
}

/// `x' = 1` until 1.5, for as long as that takes, then `x' = t` for a time of 1: the second phase knows when it began.
#[test]
fn time_goes_on_from_phase_to_phase() {
    let d = Dims { x: 1, u: 0, p: 0 };
    let set = settings(RadauIia, 2, 1, FESD);
    let phase = |f: SharedFunction| {
        let mut s = System::new(1, 0, 0).unwrap();
        s.set_f0(f).unwrap();
        Ocp::new(&s, 1.0, 2, &set).unwrap()
    };
    let mut first = phase(affine("one", d, &[1.0], &[]));
    first.set_t0(0.5).unwrap();
    first.set_x0(&[0.0]).unwrap();
    first.set_free_time(Durations::Stages, 0.1, 5.0).unwrap();
    first.add_terminal(row("there", d, &[(0, 0, 1.0)]), &[1.5], &[1.5]).unwrap();
    let mut m = MultiPhase::new(vec![first, phase(row("t", d, &[(0, 1, 1.0)]))]).unwrap();
    m.link_continuous(0).unwrap();
    let r = solved(&mut m);
    assert_near(&r.phases[1].trajectory.elements.last().unwrap().x1, &[1.5 + 2.5], 1e-9, "end");
    assert_near(&[r.phases[1].trajectory.elements[0].t], &[2.0], 1e-9, "start of the second phase");
    // a goal that the links exclude
    m.phase_mut(1).unwrap().set_x0(&[0.0]).unwrap();
    let r = m.solve(&mut Control::default()).unwrap();
    assert_ne!(r.outcome, Outcome::Solved);
    assert!(r.message.contains("link 0 ('continuity') behind phase 0, row 0, is violated by"), "{}", r.message);
}

/// A reset map between two phases: a ball is let fall, hits a plate that doubles as a scale and is turned by it, and the second phase has
/// one state less. The link is that of the function written by hand.
#[test]
fn a_reset_map_ties_the_phases() {
    let set = settings(RadauIia, 3, 1, FESD);
    let d = Dims { x: 2, u: 0, p: 0 };
    let mut fall = System::new(2, 0, 0).unwrap();
    fall.set_f0(affine("fall", d, &[0.0, -9.81], &[(0, 1, 1.0)])).unwrap();
    let mut first = Ocp::new(&fall, 1.0, 1, &set).unwrap();
    first.set_x0(&[2.0, 0.0]).unwrap();
    first.set_free_time(Durations::Stages, 0.1, 5.0).unwrap();
    first.add_terminal(row("down", d, &[(0, 0, 1.0)]), &[0.0], &[0.0]).unwrap();
    // the second phase knows the height above the plate only through the energy
    let one = Dims { x: 1, u: 0, p: 0 };
    let mut rise = System::new(1, 0, 0).unwrap();
    rise.set_f0(affine("rise", one, &[-9.81], &[])).unwrap();
    let mut second = Ocp::new(&rise, 0.2, 2, &set).unwrap();
    second.set_x0_bounds(&[f64::NEG_INFINITY], &[f64::INFINITY]).unwrap();
    let mut m = MultiPhase::new(vec![first, second]).unwrap();
    let wrong = row("wrong", one, &[(0, 0, 1.0)]);
    assert!(matches!(m.link_reset(0, wrong), Err(Error::Dimension(_))));
    assert!(matches!(m.link_reset(1, row("r", one, &[(0, 0, 1.0)])), Err(Error::Range(_))));
    m.link_reset(0, row("bounce", d, &[(0, 1, -0.5)])).unwrap();
    let r = solved(&mut m);
    let v = (2.0f64 * 9.81 * 2.0).sqrt();
    assert_near(&r.phases[1].trajectory.elements[0].x0, &[0.5 * v], 1e-8, "behind the impact");
    assert_near(&r.phases[1].trajectory.elements.last().unwrap().x1, &[0.5 * v - 9.81 * 0.2], 1e-8, "end");
}
