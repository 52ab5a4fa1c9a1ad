//! What an optimal control problem can be made of, each on a problem with a known answer.

mod common;
use common::models::*;
use common::*;
use std::sync::atomic::AtomicBool;
use std::sync::Arc;
use switchback::error::Error;
use switchback::fesd::PathAt;
use switchback::func::{Callback, Dims};
use switchback::mpcc::Polish;
use switchback::nlp::{Control, IterationInfo, Outcome};
use switchback::ocp::{CostAt, Durations, Norm, Ocp, OcpResult, Starts};
use switchback::settings::{RkFamily, Settings};
use switchback::stop::Stop;
use switchback::system::{SharedFunction, System};

const DI: Dims = Dims { x: 2, u: 1, p: 0 };

/// `q' = v, v' = u`.
fn double_integrator() -> System {
    let mut s = System::new(2, 1, 0).unwrap();
    s.set_f0(affine("f0", DI, &[0.0; 2], &[(0, 1, 1.0), (1, 2, 1.0)])).unwrap();
    s
}

fn effort() -> SharedFunction {
    let l = Callback::new("u2", DI, 1, |at, o| {
        o[0] = at.u[0] * at.u[0];
        0
    });
    let l = l.with_jacobian(pattern(1, 4, &[(0, 2)]), |at, o| {
        o[0] = 2.0 * at.u[0];
        0
    });
    let l = l.and_then(|l| {
        l.with_hessian(pattern(4, 4, &[(2, 2)]), |_, w, o| {
            o[0] = 2.0 * w[0];
            0
        })
    });
    Arc::new(l.unwrap())
}

/// Both states, as outputs.
fn states(d: Dims) -> SharedFunction {
    affine("x", d, &[0.0; 2], &[(0, 0, 1.0), (1, 1, 1.0)])
}

/// From rest at 0 to rest at 1.
fn rest_to_rest(n_stages: usize, set: &Settings) -> Ocp {
    let mut o = Ocp::new(&double_integrator(), 1.0, n_stages, set).unwrap();
    o.set_x0(&[0.0; 2]).unwrap();
    o.add_terminal(states(DI), &[1.0, 0.0], &[1.0, 0.0]).unwrap();
    o
}

fn solved(o: &mut Ocp) -> OcpResult {
    let r = o.solve(&mut Control::default()).unwrap().clone();
    assert_eq!(r.outcome, Outcome::Solved, "{:?}", r.residuals);
    let a = r.accuracy.as_ref().unwrap();
    assert!(a.terminal < 1e-8 && a.cost_error.abs() < 1e-7, "{a:?}");
    r
}

fn horizon() -> SharedFunction {
    affine("T", DI, &[0.0], &[(0, 3, 1.0)])
}

/// The fastest way from rest to rest over a distance of 1 with `-2 ≤ u ≤ 1` takes `√3` and changes sign at `2/√3`.
#[test]
fn free_lengths_of_horizon_and_stages() {
    let set = settings(RadauIia, 2, 2, FESD);
    let mut o = rest_to_rest(2, &set);
    o.set_mayer(horizon()).unwrap();
    o.set_u_bounds(&[-2.0], &[1.0]).unwrap();
    o.set_free_time(Durations::Stages, 0.1, 5.0).unwrap();
    let r = solved(&mut o);
    assert_near(&r.durations, &[2.0 / 3f64.sqrt(), 1.0 / 3f64.sqrt()], 1e-9, "stages");
    assert_near(&r.controls, &[1.0, -2.0], 1e-9, "bang-bang");
    assert_near(&[r.cost, *r.trajectory.times().last().unwrap()], &[3f64.sqrt(); 2], 1e-9, "horizon");
    // with equal stages the best is symmetric: u = ±1, T = 2
    let mut o = rest_to_rest(2, &set);
    o.set_mayer(horizon()).unwrap();
    o.set_u_bounds(&[-2.0], &[1.0]).unwrap();
    o.set_free_time(Durations::Horizon, 0.1, 5.0).unwrap();
    let r = solved(&mut o);
    assert_near(&[r.cost, r.durations[0], r.durations[1]], &[2.0, 1.0, 1.0], 1e-9, "equal stages");
    // stages of free length in a horizon of given length
    let mut o = rest_to_rest(3, &set);
    o.set_lagrange(effort()).unwrap();
    o.set_free_time(Durations::Stages, 0.05, 5.0).unwrap();
    o.add_horizon(1.0, 1.0).unwrap();
    let r = solved(&mut o);
    assert_near(&[r.durations.iter().sum()], &[1.0], 1e-10, "sum");
    // three equal intervals cost 12 n²/(n² − 1) = 13.5, and the optimum has them equal
    assert_near(&[r.cost], &[13.5], 1e-8, "cost");
}

/// The best effort is linear in time: `u = 6 − 12 t`, `J = 12`.
#[test]
fn linear_controls_and_uneven_grids() {
    let mut o = rest_to_rest(3, &settings(RadauIia, 3, 1, FESD));
    o.set_lagrange(effort()).unwrap();
    o.set_linear_controls(&[true]).unwrap();
    o.set_durations(&[0.2, 0.5, 0.3]).unwrap();
    let r = solved(&mut o);
    assert_near(&[r.cost], &[12.0], 1e-9, "cost");
    assert_near(&r.controls, &[6.0, 3.6, -2.4], 1e-8, "at the starts");
    assert_near(&r.control_ends, &[3.6, -2.4, -6.0], 1e-8, "at the ends");
    // bounds hold along the stage
    o.set_u_bounds(&[-5.0], &[5.0]).unwrap();
    let r = solved(&mut o);
    assert!(r.cost > 12.0 && r.controls.iter().chain(&r.control_ends).all(|u| u.abs() <= 5.0 + 1e-10));
}

/// `v' = −μ sign v`: the distance `v0² / 2μ` tells the friction coefficient; so do measurements on the way.
#[test]
fn parameters_are_found() {
    let d = Dims { x: 2, u: 0, p: 1 };
    let mut s = System::new(2, 0, 1).unwrap();
    s.set_f0(affine("f0", d, &[0.0; 2], &[(0, 1, 1.0)])).unwrap();
    let psi = affine("psi", d, &[0.0], &[(0, 1, 1.0)]);
    add_sides(&mut s, &[1], affine("F", d, &[0.0; 2], &[(0, 2, -1.0), (1, 2, 1.0)]), psi);
    let mu = 0.37;
    let n = 8;
    let q = |t: f64| if t < 1.0 / mu { t - 0.5 * mu * t * t } else { 0.5 / mu };
    let data: Vec<f64> = (1..=n).map(|k| q(4.0 * k as f64 / n as f64)).collect();
    let mut o = Ocp::new(&s, 4.0, n, &settings(RadauIia, 2, 2, FESD)).unwrap();
    o.set_x0(&[0.0, 1.0]).unwrap();
    o.set_params(&[0.6]).unwrap();
    o.set_param_bounds(&[0.05], &[2.0]).unwrap();
    let position = affine("q", d, &[0.0], &[(0, 0, 1.0)]);
    o.add_least_squares(position, &[1.0], &data, CostAt::ControlGrid).unwrap();
    let r = solved(&mut o);
    assert_near(&r.params, &[mu], 1e-9, "friction");
    assert!(r.cost < 1e-16, "{}", r.cost);
    assert_near(&[r.trajectory.switches[0].t], &[1.0 / mu], 1e-8, "time of rest");
}

/// Squares of differences from references equal the same cost written out.
#[test]
fn least_squares_follow_references() {
    let set = settings(RadauIia, 3, 1, FESD);
    let target = [0.3, 0.9];
    let mut o = Ocp::new(&double_integrator(), 1.0, 2, &set).unwrap();
    o.set_x0(&[0.0; 2]).unwrap();
    o.add_least_squares(states(DI), &[2.0, 0.5], &[target[0], 0.0, target[1], 0.0], CostAt::Running).unwrap();
    o.add_least_squares(states(DI), &[3.0, 1.0, 1.0, 3.0], &[1.0, 0.1], CostAt::Terminal).unwrap();
    o.set_lagrange(effort()).unwrap();
    let r = solved(&mut o);
    // constant rates a, b of the two stages: the cost in closed form, its minimum by Newton's method on differences
    let cost = |u: [f64; 2]| {
        let (mut q, mut v, mut j) = (0.0, 0.0, 0.0);
        let m = 2000;
        for k in 0..2 {
            for i in 0..m {
                let h = 0.5 / m as f64;
                let at = |s: f64| (q + v * s + 0.5 * u[k] * s * s, v + u[k] * s);
                let rate = |(q, v): (f64, f64)| 2.0 * (q - target[k]).powi(2) + 0.5 * v * v + u[k] * u[k];
                j += h / 6.0 * (rate(at(0.0)) + 4.0 * rate(at(0.5 * h)) + rate(at(h)));
                (q, v) = at(h);
                let _ = i;
            }
        }
        let (a, b) = (q - 1.0, v - 0.1);
        j + 3.0 * a * a + 2.0 * a * b + 3.0 * b * b
    };
    let u = [r.controls[0], r.controls[1]];
    assert_near(&[r.cost], &[cost(u)], 1e-9, "cost");
    for e in [[1e-3, 0.0], [0.0, 1e-3]] {
        let slope = (cost([u[0] + e[0], u[1] + e[1]]) - cost([u[0] - e[0], u[1] - e[1]])) / 2e-3;
        assert!(slope.abs() < 1e-8, "not a minimum: {slope}");
    }
    // references may change without building again
    o.set_references(0, &[0.0; 2]).unwrap();
    let moved = solved(&mut o);
    assert!(moved.time_build == 0.0 && (moved.cost - r.cost).abs() > 1e-3);
    assert!(matches!(o.set_references(5, &[0.0; 2]), Err(Error::Range(_))));
}

/// Relaxed, a constraint that can be met is met under an exact penalty; one that cannot is violated as little as possible.
#[test]
fn relaxed_constraints_are_met_or_missed_as_little_as_possible() {
    let set = settings(RadauIia, 2, 1, FESD);
    for norm in [Norm::L1, Norm::L2, Norm::Linf] {
        let problem = |bound: f64| {
            let mut o = Ocp::new(&double_integrator(), 1.0, 10, &set).unwrap();
            o.set_x0(&[0.0; 2]).unwrap();
            o.set_u_bounds(&[-bound], &[bound]).unwrap();
            o.set_lagrange(effort()).unwrap();
            o.add_relaxed(states(DI), &[1.0, 0.0], &[1.0, 0.0], None, norm, 1e3).unwrap();
            solved(&mut o)
        };
        let exact = 12.0 * 100.0 / 99.0;
        let free = problem(20.0);
        if norm == Norm::L2 {
            assert!(free.violation > 1e-4 && free.violation < 0.1, "{norm:?}: {}", free.violation);
        } else {
            assert!(free.violation < 1e-9, "{norm:?}: {}", free.violation);
            assert_near(&[free.cost], &[exact], 1e-8, "cost");
        }
        // rest to rest needs u = 4 at least
        let bound = problem(2.0);
        assert!(bound.violation > 0.1, "{norm:?}: {}", bound.violation);
    }
    // along the horizon: v ≤ 1.2 instead of 1.5
    for (norm, at) in [(Norm::L1, PathAt::StagePoints), (Norm::Linf, PathAt::Elements)] {
        let mut o = rest_to_rest(20, &set);
        o.set_lagrange(effort()).unwrap();
        let v = affine("v", DI, &[0.0], &[(0, 1, 1.0)]);
        o.add_relaxed(v, &[f64::NEG_INFINITY], &[1.2], Some(at), norm, 1e4).unwrap();
        let r = solved(&mut o);
        assert!(r.violation < 1e-8 && r.cost > 12.5, "{norm:?}: {} {}", r.violation, r.cost);
    }
}

/// Both ends meet: `x' = u + p − x` with different `p` in its stages.
#[test]
fn periodic_solutions_and_parameters_of_stages() {
    let d = Dims { x: 1, u: 1, p: 1 };
    let mut s = System::new(1, 1, 1).unwrap();
    s.set_f0(affine("f0", d, &[0.0], &[(0, 0, -1.0), (0, 1, 1.0), (0, 2, 1.0)])).unwrap();
    let mut o = Ocp::new(&s, 1.0, 2, &settings(RadauIia, 4, 1, FESD)).unwrap();
    o.set_u_bounds(&[0.0], &[0.0]).unwrap();
    o.set_stage_params(&[1.0, 3.0]).unwrap();
    o.add_periodic(&[0]).unwrap();
    let r = solved(&mut o);
    // x(0) = 1 + (3 − 1)(1 − q) / (1 − q²) with q = e^{−1/2} decaying in a stage
    let q = (-0.5f64).exp();
    let exact = 1.0 + 2.0 / (1.0 + q);
    assert_near(&[r.trajectory.elements[0].x0[0]], &[exact], 1e-7, "start");
    assert_near(&r.trajectory.elements[1].x1, &[exact], 1e-7, "end");
}

#[test]
fn elements_by_stage_and_warm_starts() {
    let set = settings(RadauIia, 3, 4, FESD);
    let mut o = sliding_ocp(&set);
    let uniform = o.solve(&mut Control::default()).unwrap().clone();
    o.set_elements(&[2, 3, 4, 5, 3, 2]).unwrap();
    let r = o.solve(&mut Control::default()).unwrap().clone();
    assert_eq!((r.outcome, r.polish, r.trajectory.elements.len()), (Outcome::Solved, Polish::Done, 19));
    // on another grid the homotopy may end beside the best optimum
    assert!(r.cost > uniform.cost - 1e-6 && r.cost < 9.27, "{}", r.cost);
    // a small change of the initial state: the same order of modes in a few iterations
    let x0 = SLIDING_X0.map(|v| v + 0.01);
    o.set_x0(&x0).unwrap();
    let warm = o.solve_warm(&mut Control::default()).unwrap().clone();
    let cold = o.solve(&mut Control::default()).unwrap().clone();
    assert_eq!((warm.outcome, warm.polish), (Outcome::Solved, Polish::Done));
    assert!((warm.cost - r.cost).abs() < 0.5 && (cold.cost - r.cost).abs() < 0.5);
    assert!(10 * warm.stats.iterations < cold.stats.iterations, "{} {}", warm.stats.iterations, cold.stats.iterations);
    assert!(o.set_elements(&[1, 2]).is_err() && o.set_elements(&[0; 6]).is_err());
}

#[test]
fn a_solution_one_stage_later_is_a_guess() {
    let set = settings(RadauIia, 2, 1, FESD);
    let mut o = rest_to_rest(5, &set);
    assert!(matches!(o.shift(), Err(Error::State(_))));
    o.set_lagrange(effort()).unwrap();
    let r = solved(&mut o);
    o.shift().unwrap();
    o.set_x0(&r.trajectory.elements[1].x0).unwrap();
    let next = solved(&mut o);
    assert!(next.stats.iterations <= r.stats.iterations);
}

/// Starts are independent: the results are the same to the last bit on any number of threads, and the best one stays.
#[test]
fn several_starts_on_any_number_of_threads() {
    let set = settings(RadauIia, 2, 2, FESD);
    let starts: Vec<Vec<f64>> = [-4.0, 0.0, 3.0].iter().map(|u| vec![*u; 12]).collect();
    let mut o = sliding_ocp(&set);
    let control = &mut Control::default();
    let one = o.solve_starts(&starts, 1, control).unwrap();
    let result = |s: &Starts, k: usize| s.results[k].clone().unwrap();
    let best = result(&one, one.best);
    assert_eq!(o.result().unwrap().cost, best.cost);
    let three = sliding_ocp(&set).solve_starts(&starts, 3, control).unwrap();
    assert_eq!(one.best, three.best);
    for k in 0..3 {
        let (a, b) = (result(&one, k), result(&three, k));
        assert!(a.outcome != Outcome::Solved || a.cost >= best.cost);
        assert_eq!((a.cost.to_bits(), &a.controls), (b.cost.to_bits(), &b.controls));
    }
    let refused = [vec![], vec![vec![0.0]]];
    assert!(refused.iter().all(|s| o.solve_starts(s, 2, control).is_err()));
    let random = o.random_starts(4, 7);
    assert_eq!(random, o.random_starts(4, 7));
    assert!(random[1] != random[2] && random[1] != o.random_starts(4, 8)[1]);
    assert!(random.iter().flatten().all(|u| u.abs() <= 10.0) && random[0] == [0.0; 12]);
}

/// An interrupt, and a monitor on the thread of the caller, stop the starts on all threads.
#[test]
fn several_starts_are_stopped_together() {
    let mut o = sliding_ocp(&settings(RadauIia, 2, 2, FESD));
    let starts = o.random_starts(6, 1);
    let stop = Arc::new(AtomicBool::new(true));
    let interrupt = &mut Control::of(Stop::on(&stop));
    let stopped = |s: &Starts| s.results.iter().all(|r| r.as_ref().unwrap().outcome == Outcome::Stopped);
    assert!(stopped(&o.solve_starts(&starts, 3, interrupt).unwrap()));
    let mut left = 3;
    let mut monitor = |_: &IterationInfo| {
        left -= 1;
        left > 0
    };
    let s = o.solve_starts(&starts, 1, &mut Control { monitor: Some(&mut monitor), ..Control::default() }).unwrap();
    assert!(stopped(&s));
}

#[test]
fn what_makes_no_sense_is_refused() {
    let mut o = rest_to_rest(2, &settings(RadauIia, 2, 1, FESD));
    let refused = [
        o.set_durations(&[1.0]),
        o.set_durations(&[1.0, 0.0]),
        o.set_free_time(Durations::Horizon, 2.0, 1.0),
        o.set_linear_controls(&[true, false]),
        o.set_param_bounds(&[0.0], &[1.0]),
        o.set_stage_params(&[1.0]),
        o.add_periodic(&[2]),
        o.add_boundary(states(DI), &[0.0; 2], &[0.0; 2]),
        o.add_least_squares(states(DI), &[1.0; 3], &[0.0; 2], CostAt::Running),
        o.add_least_squares(states(DI), &[1.0; 2], &[0.0; 4], CostAt::Terminal),
        o.add_relaxed(states(DI), &[0.0; 2], &[0.0; 2], None, Norm::L1, 0.0),
    ];
    for (k, r) in refused.iter().enumerate() {
        assert!(r.is_err(), "{k}");
    }
}

/// Two controls one of which is zero in every stage. Every division of the stages is a local optimum, of known cost.
#[test]
fn one_of_two_controls_is_zero() {
    let d = Dims { x: 1, u: 2, p: 0 };
    let mut s = System::new(1, 2, 0).unwrap();
    s.set_f0(affine("f0", d, &[0.0], &[(0, 1, 1.0), (0, 2, -2.0)])).unwrap();
    for at in [PathAt::ControlGrid, PathAt::Elements] {
        let mut o = Ocp::new(&s, 1.0, 4, &settings(RadauIia, 2, 1, FESD)).unwrap();
        o.set_x0(&[0.0]).unwrap();
        let control = |k: usize| affine(["up", "down"][k], d, &[0.0], &[(0, 1 + k, 1.0)]);
        o.add_complementarity(control(0), control(1), at).unwrap();
        let both = affine("u", d, &[0.0; 2], &[(0, 1, 1.0), (1, 2, 1.0)]);
        o.add_least_squares(both, &[1.0; 2], &[1.0; 2], CostAt::Running).unwrap();
        o.add_least_squares(affine("x", d, &[0.0], &[(0, 0, 1.0)]), &[1.0], &[0.5], CostAt::Terminal).unwrap();
        let r = solved(&mut o);
        assert_eq!(r.polish, Polish::Done);
        let down = r.controls.chunks(2).filter(|u| u[0] < 1e-12).count() as f64 / 4.0;
        assert!(r.controls.chunks(2).all(|u| u[0].min(u[1]).abs() < 1e-12 && u[0].max(u[1]) > 0.5), "{:?}", r.controls);
        // with a share `down` of the stages going down: u = 1 − s up and 1 + 2 s down, s what is missing at the end
        let miss = (0.5 - 3.0 * down) / (2.0 + 3.0 * down);
        assert_near(&[r.cost], &[1.0 + miss * miss * (2.0 + 3.0 * down)], 1e-9, "cost");
    }
}

/// `x' = −1 + λ`, `0 ≤ x ⊥ λ ≥ 0`: down to zero, and held there.
#[test]
fn a_wall_given_by_a_complementarity() {
    let d = Dims { x: 1, u: 1, p: 0 };
    let mut s = System::new(1, 1, 0).unwrap();
    s.set_f0(affine("f0", d, &[-1.0], &[(0, 1, 1.0)])).unwrap();
    for (family, disc) in [(RadauIia, FESD), (RadauIia, STANDARD), (GaussLegendre, FESD)] {
        let mut o = Ocp::new(&s, 1.0, 10, &settings(family, 2, 2, disc)).unwrap();
        o.set_x0(&[0.5]).unwrap();
        let (gap, force) = (affine("gap", d, &[0.0], &[(0, 0, 1.0)]), affine("force", d, &[0.0], &[(0, 1, 1.0)]));
        o.add_complementarity(gap.clone(), force.clone(), PathAt::StagePoints).unwrap();
        let r = solved(&mut o);
        let exact: Vec<f64> = (0..10).map(|k| if k < 5 { 0.0 } else { 1.0 }).collect();
        assert_near(&r.controls, &exact, 1e-9, "force");
        assert_near(&r.trajectory.elements[19].x1, &[0.0], 1e-10, "on the wall");
        assert!(o.add_complementarity(gap, states(DI), PathAt::Elements).is_err());
    }
}

/// Beside what switches: a block with dry friction is pushed from either side, never from both. Nobody would push from both
/// sides: the problem with one control of either sign has the same optimum.
#[test]
fn complementarities_beside_switches() {
    let block = |nu: usize, family: RkFamily| {
        let d = Dims { x: 2, u: nu, p: 0 };
        let push = [(0, 1, 1.0), (1, 2, 1.0), (1, 3, -1.0)];
        let mut s = System::new(2, nu, 0).unwrap();
        s.set_f0(affine("f0", d, &[0.0; 2], &push[..1 + nu])).unwrap();
        add_sides(&mut s, &[1], affine("friction", d, &[-0.3, 0.3], &[]), affine("v", d, &[0.0], &[(0, 1, 1.0)]));
        let mut o = Ocp::new(&s, 3.0, 6, &settings(family, 3, 3, FESD)).unwrap();
        o.set_x0(&[0.0; 2]).unwrap();
        o.add_terminal(states(d), &[1.0, 0.0], &[1.0, 0.0]).unwrap();
        let u = affine("u", d, &vec![0.0; nu], &[(0, 2, 1.0), (1, 3, 1.0)][..nu]);
        o.add_least_squares(u, &vec![1.0; nu], &vec![0.0; nu], CostAt::Running).unwrap();
        (o, d)
    };
    for family in [RadauIia, GaussLegendre] {
        let one = solved(&mut block(1, family).0);
        let (mut o, d) = block(2, family);
        let from = |k: usize| affine(["left", "right"][k], d, &[0.0], &[(0, 2 + k, 1.0)]);
        o.add_complementarity(from(0), from(1), PathAt::ControlGrid).unwrap();
        let two = solved(&mut o);
        assert_eq!((one.polish, two.polish), (Polish::Done, Polish::Done));
        assert_near(&[two.cost], &[one.cost], 1e-8, "cost");
        assert!(two.controls.chunks(2).all(|u| u[0].min(u[1]).abs() < 1e-12), "{:?}", two.controls);
        let net: Vec<f64> = two.controls.chunks(2).map(|u| u[0] - u[1]).collect();
        assert_near(&net, &one.controls, 1e-6, "controls");
    }
}

/// `x' = u`, from `x(0) = 1` with the least effort to `x(1) = 1.5`, with the start on the lower and the end on the upper
/// bound of the path: no point lies inside of all bounds, and the bounds do not change the answer.
#[test]
fn constraints_without_room_between_them() {
    let d = Dims { x: 1, u: 1, p: 0 };
    let effort = |d: Dims| {
        let l = Callback::new("u2", d, 1, |at, o| {
            o[0] = at.u[0] * at.u[0];
            0
        });
        let l = l.with_jacobian(pattern(1, 3, &[(0, 1)]), |at, o| {
            o[0] = 2.0 * at.u[0];
            0
        });
        let l = l.and_then(|l| {
            l.with_hessian(pattern(3, 3, &[(1, 1)]), |_, w, o| {
                o[0] = 2.0 * w[0];
                0
            })
        });
        Arc::new(l.unwrap())
    };
    for (n, upper, at, states) in (2..9).flat_map(|n| {
        [
            (1.5, PathAt::Elements, false),
            (1.6, PathAt::Elements, false),
            (1.5, PathAt::StagePoints, false),
            (1.5, PathAt::ControlGrid, true),
        ]
        .map(|(upper, at, states)| (n, upper, at, states))
    }) {
        let mut s = System::new(1, 1, 0).unwrap();
        s.set_f0(affine("f0", d, &[0.0], &[(0, 1, 1.0)])).unwrap();
        let mut o = Ocp::new(&s, 1.0, n, &settings(RadauIia, 2, 1, FESD)).unwrap();
        o.set_x0(&[1.0]).unwrap();
        o.set_lagrange(effort(d)).unwrap();
        let x = || affine("x", d, &[0.0], &[(0, 0, 1.0)]);
        if states {
            o.set_x_bounds(&[1.0], &[upper]).unwrap();
        } else {
            o.add_path(x(), &[1.0], &[upper], at).unwrap();
        }
        o.add_terminal(x(), &[1.5], &[1.5]).unwrap();
        let r = solved(&mut o);
        let what = format!("{n} stages, up to {upper}, {at:?}");
        assert!(r.polish == Polish::Done && r.stats.iterations < 100, "{what}: {:?} {:?}", r.polish, r.stats);
        assert_near(&[r.cost], &[0.25], 1e-9, &what);
    }
}

/// A valve with a dead band, `x' = u ∓ 1/2` beyond it: from 0 to 1 in four stages of length 1 with least `∫ u²`. With m stages open
/// the flow is `1/m` and the cost `m (1/m + 1/2)²`, least for two; which two, nothing decides. Modes that controls choose jump
/// with them: no control has to be at the edge of the band in between.
#[test]
fn controls_jump_over_a_dead_band() {
    use switchback::expr::Graph;
    use switchback::model::Model;
    let g = Graph::new();
    let u = g.u(0);
    let system = Model::from_rhs("valve", 1, 0, &[u.dead_zone(0.5)]).and_then(|m| m.build(&g)).unwrap().system;
    let d = Dims { x: 1, u: 1, p: 0 };
    for guess in [None, Some([1.0, 1.0, 0.0, 0.0]), Some([0.0, 1.0, 0.0, 1.0])] {
        let mut o = Ocp::new(&system, 4.0, 4, &from_all_starts(Settings::default())).unwrap();
        o.set_x0(&[0.0]).unwrap();
        o.set_u_bounds(&[-3.0], &[3.0]).unwrap();
        o.set_lagrange(Arc::new(g.function("cost", d, &[u * u]).unwrap())).unwrap();
        o.add_terminal(Arc::new(g.function("end", d, &[g.x(0)]).unwrap()), &[1.0], &[1.0]).unwrap();
        if let Some(u) = guess {
            o.set_u_guess(&u).unwrap();
        }
        let r = solved(&mut o);
        assert_eq!(r.polish, Polish::Done, "{guess:?}");
        assert!((r.cost - 2.0).abs() < 1e-9, "{guess:?}: {} with {:?}", r.cost, r.controls);
        assert!(r.controls.iter().all(|u| u.abs() < 1e-6 || (u - 1.0).abs() < 1e-6), "{guess:?}: {:?}", r.controls);
    }
}

/// A tank that is filled through a check valve by the pressure `u`: `x' = max(u − x, 0)`. The level is to be 1 over two stages of
/// length 1, `∫ (x − 1)² + 0.3 u²`. With `u = (u1, 0)` the level is `u1 (1 − e^−t)`, then `a u1` with `a = 1 − 1/e`, and the cost is
/// quadratic in `u1`; more pressure in the second stage costs more than it gains. The valve is open at the end of the first stage and
/// closed at the start of the second, where the switching function of state and control jumps from 0.42 to −0.73.
#[test]
fn a_switching_function_of_state_and_control_jumps() {
    use switchback::expr::Graph;
    use switchback::model::Model;
    let g = Graph::new();
    let (x, u) = (g.x(0), g.u(0));
    let system =
        Model::from_rhs("tank", 1, 0, &[(u - x).max(g.constant(0.0))]).and_then(|m| m.build(&g)).unwrap().system;
    let d = Dims { x: 1, u: 1, p: 0 };
    let decay = (-1f64).exp();
    let a = 1.0 - decay;
    let squares = 1.0 - 2.0 * a + 0.5 * (1.0 - decay * decay) + a * a + 0.3;
    let (u1, cost) = (1.0 / squares, 2.0 - 1.0 / squares);
    for guess in [None, Some([1.0, 1.0]), Some([0.0, 1.0])] {
        let mut o = Ocp::new(&system, 2.0, 2, &Settings { n_s: 3, ..Settings::default() }).unwrap();
        o.set_x0(&[0.0]).unwrap();
        o.set_u_bounds(&[-3.0], &[3.0]).unwrap();
        let rate = (x - 1.0) * (x - 1.0) + 0.3 * u * u;
        o.set_lagrange(Arc::new(g.function("cost", d, &[rate]).unwrap())).unwrap();
        if let Some(u) = guess {
            o.set_u_guess(&u).unwrap();
        }
        let r = o.solve(&mut Control::default()).unwrap();
        assert_eq!(r.polish, Polish::Done, "{guess:?}");
        assert_near(&[r.cost], &[cost], 1e-6, "cost");
        assert_near(&r.controls, &[u1, 0.0], 1e-4, "controls");
    }
}

/// The same valve with a pressure that is given stage by stage, as a parameter: from 2 to 0 it closes at once.
#[test]
fn a_switching_function_of_a_stage_parameter_jumps() {
    use switchback::expr::Graph;
    use switchback::model::Model;
    let g = Graph::new();
    let (x, u, p) = (g.x(0), g.u(0), g.p(0));
    let rate = (p - x).max(g.constant(0.0)) + u;
    let system = Model::from_rhs("tank", 1, 1, &[rate]).and_then(|m| m.build(&g)).unwrap().system;
    let d = Dims { x: 1, u: 1, p: 1 };
    let mut o = Ocp::new(&system, 2.0, 2, &Settings { n_s: 3, ..Settings::default() }).unwrap();
    o.set_x0(&[0.0]).unwrap();
    o.set_lagrange(Arc::new(g.function("cost", d, &[u * u]).unwrap())).unwrap();
    for stages in [[2.0, 0.0], [0.5, 2.0]] {
        o.set_stage_params(&stages).unwrap();
        let r = o.solve(&mut Control::default()).unwrap();
        assert_eq!(r.polish, Polish::Done, "{}", r.message);
        assert!(r.cost < 1e-9 && r.accuracy.as_ref().unwrap().terminal < 1e-5, "{stages:?}: {:?}", r.accuracy);
    }
}

/// A point `x' = u` in the plane, `∫ |u|² + |x(2) − (2, 0)|²`, from `(−2, 0)`, that must not enter the unit disc. Straight ahead there
/// is a saddle: stopping at `(−1, 0)` costs 9.5. Around the disc (tangent, arc, tangent) the way to the goal is `L = 2√3 + π/3` long, and
/// a way of the length `l` in two time units costs `l²/2 + (L − l)²`, at best `L²/3`; ten control stages, with the disc out of bounds at
/// the ends of elements alone, are within one per cent of that.
#[test]
fn a_saddle_is_no_answer() {
    use switchback::expr::Graph;
    let g = Graph::new();
    let (x, y, a, b) = (g.x(0), g.x(1), g.u(0), g.u(1));
    let d = Dims { x: 2, u: 2, p: 0 };
    let mut s = System::new(2, 2, 0).unwrap();
    s.set_f0(Arc::new(g.function("f0", d, &[a, b]).unwrap())).unwrap();
    let mut o = Ocp::new(&s, 2.0, 10, &Settings::default()).unwrap();
    o.set_x0(&[-2.0, 0.0]).unwrap();
    o.set_lagrange(Arc::new(g.function("effort", d, &[a * a + b * b]).unwrap())).unwrap();
    let miss = (x - 2.0) * (x - 2.0) + y * y;
    o.set_mayer(Arc::new(g.function("miss", d, &[miss]).unwrap())).unwrap();
    let disc = Arc::new(g.function("disc", d, &[x * x + y * y]).unwrap());
    o.add_path(disc, &[1.0], &[f64::INFINITY], PathAt::Elements).unwrap();
    let r = solved(&mut o);
    let around = (2.0 * 3f64.sqrt() + std::f64::consts::PI / 3.0).powi(2) / 3.0;
    assert!((r.cost - around).abs() < 0.01 * around, "{} instead of {around}", r.cost);
}

/// A mass in the plane from rest at `(−2, 0)` to rest at `(2, 0)` around the unit disc: the guess is on the axis of symmetry, where the
/// disc keeps any motion from getting closer to the goal, and so does every motion near by.
#[test]
fn an_obstacle_in_the_middle_of_the_way_is_passed() {
    use switchback::expr::Graph;
    let g = Graph::new();
    let (x, y, v, w) = (g.x(0), g.x(1), g.x(2), g.x(3));
    let (a, b) = (g.u(0), g.u(1));
    let d = Dims { x: 4, u: 2, p: 0 };
    let mut s = System::new(4, 2, 0).unwrap();
    s.set_f0(Arc::new(g.function("f0", d, &[v, w, a, b]).unwrap())).unwrap();
    let mut o = Ocp::new(&s, 4.0, 16, &Settings::default()).unwrap();
    o.set_x0(&[-2.0, 0.0, 0.0, 0.0]).unwrap();
    o.set_u_bounds(&[-5.0; 2], &[5.0; 2]).unwrap();
    o.set_lagrange(Arc::new(g.function("effort", d, &[a * a + b * b]).unwrap())).unwrap();
    let disc = Arc::new(g.function("disc", d, &[x * x + y * y]).unwrap());
    o.add_path(disc, &[1.0], &[f64::INFINITY], PathAt::Elements).unwrap();
    let all = Arc::new(g.function("state", d, &[x, y, v, w]).unwrap());
    o.add_terminal(all, &[2.0, 0.0, 0.0, 0.0], &[2.0, 0.0, 0.0, 0.0]).unwrap();
    let r = solved(&mut o);
    let highest = r.trajectory.elements.iter().map(|e| e.x1[1].abs()).fold(0.0, f64::max);
    assert!(highest > 0.9, "{highest}");
    // straight through the disc it would take at least 12 · 4²/4³
    assert!(r.cost > 3.0 && r.cost < 6.1, "{}", r.cost);
}

/// Least `∫|u|` from rest to rest at a distance of 1 in time 1: full thrust `U` for `t1`, nothing, full thrust back, with `U t1 (1 − t1) = 1`; the cost is
/// `2 U t1`. The stages are `t1/2` long, so constant controls by stage do that exactly.
#[test]
fn kinks_of_costs_are_variables_of_the_program() {
    use switchback::expr::Graph;
    let g = Graph::new();
    let (u, q) = (g.u(0), g.x(0));
    let with = |cost| {
        let mut o = rest_to_rest(10, &Settings::default());
        o.set_u_bounds(&[-6.25], &[6.25]).unwrap();
        o.set_lagrange(g.cost("fuel", DI, cost).unwrap()).unwrap();
        o
    };
    let zero = g.constant(0.0);
    for (cost, expected) in [(u.abs(), 2.5), (u.max(zero) * 3.0, 3.75), (u.max(-u * 0.5), 1.875)] {
        let mut o = with(cost);
        let r = solved(&mut o);
        assert!((r.cost - expected).abs() < 1e-9, "{} {expected}", r.cost);
        assert!(r.violation == 0.0 && r.accuracy.as_ref().is_some_and(|a| a.cost_error.abs() < 1e-9));
        // nothing is nothing more than a program with a variable and a row by stage
        assert_eq!(r.dimensions.2, 0);
        assert_eq!(o.count_multipliers(switchback::ocp::MultipliersOf::Relaxed(0)), 0);
        // another cost takes the kinks away
        o.set_lagrange(effort()).unwrap();
        assert!((solved(&mut o).cost - 12.0).abs() < 0.3);
    }
    // at the end the kinks may be in states: the position that is left of 1, at a price above that of fuel, or below it
    for (price, expected) in [(100.0, 2.5), (0.1, 0.1)] {
        let mut o = Ocp::new(&double_integrator(), 1.0, 10, &Settings::default()).unwrap();
        o.set_x0(&[0.0; 2]).unwrap();
        o.set_u_bounds(&[-6.25], &[6.25]).unwrap();
        let velocity = affine("v", DI, &[0.0], &[(0, 1, 1.0)]);
        o.add_terminal(velocity, &[0.0], &[0.0]).unwrap();
        o.set_lagrange(g.cost("fuel", DI, u.abs()).unwrap()).unwrap();
        o.set_mayer(g.cost("left", DI, (q - 1.0).abs() * price).unwrap()).unwrap();
        assert!((solved(&mut o).cost - expected).abs() < 1e-8, "{}", o.solve(&mut Control::default()).unwrap().cost);
    }
    // what moves within a stage has its kinks there
    let mut o = with(u.abs());
    assert!(matches!(o.set_lagrange(g.cost("far", DI, q.abs()).unwrap()), Err(Error::Unsupported(_))));
    assert!(matches!(o.set_linear_controls(&[true]), Err(Error::Unsupported(_))));
    assert!(matches!(
        o.add_path(g.cost("fuel", DI, u.abs()).unwrap(), &[0.0], &[1.0], PathAt::ControlGrid),
        Err(Error::Unsupported(_))
    ));
    assert!((solved(&mut o).cost - 2.5).abs() < 1e-9);
}
