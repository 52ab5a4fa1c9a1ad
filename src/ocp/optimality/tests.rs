use super::*;
use crate::func::{Callback, Dims, Point};
use crate::linalg::csc::Pattern;
use crate::nlp::Control;
use crate::random::SplitMix64;
use crate::settings::Settings;
use crate::system::{SharedFunction, System};
use std::sync::Arc;

const STAGES: usize = 4;
const LEVEL: f64 = 0.6;

/// `min ∫u² + (x(1) − p)²` with `ẋ = u` from zero and `x ≤ LEVEL`, given in several units. Without the constraint `u = p/2`, and it acts from
/// `p = 2 LEVEL` on.
fn to_a_level(p: f64, copies: usize) -> Ocp {
    let of = |f: fn(&Point) -> f64| -> SharedFunction {
        let d = Dims { x: 1, u: 1, p: 1 };
        let f = Callback::new("of", d, 1, move |at, o| {
            o[0] = f(at);
            0
        });
        Arc::new(f.with_jacobian_pattern(Pattern::dense(1, d.n_in())).unwrap())
    };
    let mut system = System::new(1, 1, 1).unwrap();
    system.set_f0(of(|at| at.u[0])).unwrap();
    let mut o = Ocp::new(&system, 1.0, STAGES, &Settings { n_fe: 1, ..Settings::default() }).unwrap();
    o.set_x0(&[0.0]).unwrap();
    o.set_u_bounds(&[-5.0], &[5.0]).unwrap();
    o.set_params(&[p]).unwrap();
    o.set_lagrange(of(|at| at.u[0] * at.u[0])).unwrap();
    o.set_mayer(of(|at| (at.x[0] - at.p[0]).powi(2))).unwrap();
    for k in 0..copies {
        let (f, low, high) = match k {
            0 => (of(|at| at.x[0]), f64::NEG_INFINITY, LEVEL),
            1 => (of(|at| -30.0 * at.x[0]), -30.0 * LEVEL, f64::INFINITY),
            _ => (of(|at| 0.01 * at.x[0]), f64::NEG_INFINITY, 0.01 * LEVEL),
        };
        o.add_path(f, &[low], &[high], crate::fesd::PathAt::ControlGrid).unwrap();
    }
    o
}

/// The controls and multipliers of one problem are judged in another one: they are optimal where multipliers of the other one exist, whatever
/// those that they came with, and not where none do.
#[test]
fn the_verdict_is_of_the_point_and_not_of_its_multipliers() {
    let mut numbers = SplitMix64::new(3);
    for case in 0..24 {
        let own = 2.0 * LEVEL * (0.5 + numbers.share());
        let mut o = to_a_level(own, 1 + case % 3);
        o.solve(&mut Control::default()).unwrap();
        let (mut b, r) = (o.built.take().unwrap(), o.result.clone().unwrap());
        assert_eq!(r.optimality.as_ref().unwrap().verdict, Verdict::LocalOptimum, "case {case}");
        for _ in 0..4 {
            let other = 2.0 * LEVEL * (0.5 + numbers.share());
            b.problem.set_params(&[other]).unwrap();
            b.extended.params = vec![other; STAGES];
            let found = o.judge(&r, &mut b).unwrap();
            let u = LEVEL.min(0.5 * own);
            // what a control that rises everywhere changes the cost by
            let slope = 2.0 * u + 2.0 * (u - other);
            let optimal = if own >= 2.0 * LEVEL { slope <= 0.0 } else { slope.abs() <= 1e-6 };
            let expected = if optimal { Verdict::LocalOptimum } else { Verdict::NotOptimal };
            assert_eq!(found.verdict, expected, "case {case}: {own} judged at {other}: {found:?}");
        }
    }
}

/// Controls of the guess are told of where they cost less than the answer and meet the constraints, and not otherwise.
#[test]
fn a_guess_that_costs_less_than_the_answer_is_told_of() {
    let told = |p: f64, answer: f64, guess: f64| {
        let mut o = to_a_level(p, 1);
        o.solve(&mut Control::default()).unwrap();
        let r = o.result.as_mut().unwrap();
        let wrong = vec![answer; STAGES];
        (r.controls, r.control_ends) = (wrong.clone(), wrong);
        o.set_u_guess(&[guess; STAGES]).unwrap();
        o.tell_cheaper_guess().unwrap();
        o.result.unwrap().message
    };
    // without the constraint u costs u² + (u − p)²
    assert!(told(0.8, 0.5, 0.4).contains("cost 3.200000e-1 in a simulation"));
    assert_eq!(told(0.8, 0.4, 0.5), "", "it costs more");
    assert_eq!(told(0.8, 0.4, 0.4), "", "it is the answer");
    assert_eq!(told(2.0, 0.6, 0.9), "", "it does not meet the constraint");
}
