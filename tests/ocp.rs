//! Optimal control problems with known optima.

mod common;
use common::models::*;
use common::*;
use switchback::mpcc::Polish;
use switchback::nlp::{Control, Outcome};
use switchback::ocp::OcpResult;
use switchback::settings::Settings;
use switchback::sim::Simulator;

/// (7.35) with Gauss-Legendre n_s = 2 and 20 elements from one start.
fn tutorial(set: &Settings, start: f64) -> OcpResult {
    let mut o = tutorial_ocp(set);
    o.set_x_guess(&[0.0], &[start]).unwrap();
    o.solve(&mut Control::default()).unwrap().clone()
}

#[test]
fn the_tutorial_problem_has_one_optimum_from_every_start() {
    for sigma_init in [1.0, 0.1] {
        let set = Settings { sigma_init, ..settings(GaussLegendre, 2, 20, FESD) };
        for start in [-2.0, -1.8, -1.6, -1.427572232082767, -1.3, -1.2, -1.1, -1.0, -0.9, -0.8] {
            let r = tutorial(&set, start);
            let x0 = r.trajectory.elements[0].x0[0];
            let what = format!("sigma_init = {sigma_init}, start {start}: {:?} {:?}", r.outcome, r.polish);
            assert_near(&[x0], &[TUTORIAL_X0], 1e-8, &what);
            assert_near(&[r.cost], &[TUTORIAL_COST], 1e-12, &what);
            assert_eq!((r.outcome, r.polish), (Outcome::Solved, Polish::Done), "{what}");
            assert_eq!(r.trajectory.switches.len(), 1, "{what}");
            assert_near(&[r.trajectory.switches[0].t], &[-TUTORIAL_X0 / 3.0], 1e-8, &what);
        }
    }
}

#[test]
fn the_tutorial_problem_with_a_small_first_relaxation() {
    let set = Settings { sigma_init: 1e-4, ..settings(GaussLegendre, 2, 20, FESD) };
    for start in [-2.0, -1.6, -1.2, -0.8] {
        let r = tutorial(&set, start);
        assert_near(&[r.trajectory.elements[0].x0[0]], &[TUTORIAL_X0], 1e-8, &format!("start {start}"));
    }
}

/// Without switch detection the optimum is off by O(h), with the wrong sensitivities for every h.
#[test]
fn the_tutorial_problem_without_switch_detection_is_wrong() {
    for n_fe in [20, 40] {
        let r = tutorial(&settings(GaussLegendre, 2, n_fe, STANDARD), -1.5);
        assert_eq!(r.outcome, Outcome::Solved);
        let e = (r.trajectory.elements[0].x0[0] - TUTORIAL_X0).abs();
        assert!(e > 1e-4, "{n_fe} elements: {e:e}");
    }
}

/// `∂x(2)/∂x0 = 1/3` for −3 ≤ x0 < 0 (4.6), whatever the step size.
#[test]
fn the_sensitivity_through_a_crossing_is_right() {
    let end = |x0: f64| {
        let mut o = tutorial_ocp(&settings(GaussLegendre, 2, 20, FESD));
        o.set_x0(&[x0]).unwrap();
        let r = o.solve(&mut Control::default()).unwrap();
        assert_eq!(r.outcome, Outcome::Solved);
        r.trajectory.elements[19].x1[0]
    };
    for x0 in [-1.7, -1.43, -0.9] {
        let s = (end(x0 + 1e-3) - end(x0 - 1e-3)) / 2e-3;
        assert!((s - 1.0 / 3.0).abs() < 1e-10, "at {x0}: {s}");
    }
}

/// Error of the terminal constraint when the controls are simulated again.
fn resimulated(controls: &[f64]) -> f64 {
    let mut s = Simulator::new(&sliding_mode(), &settings(RadauIia, 4, 3, FESD)).unwrap();
    s.set_state(0.0, &SLIDING_X0).unwrap();
    for u in controls.chunks(2) {
        s.set_controls(u).unwrap();
        let r = s.run(4.0 / 6.0, 20, &mut Control::default()).unwrap();
        assert_eq!(r.outcome, Outcome::Solved, "t = {}", s.time());
    }
    distance(&s.state()[..2], &SLIDING_QT)
}

/// (7.51): four switches through codimension two. The converged cost is that of the exact exit of the sliding
/// modes; controls that are simulated again end where they should.
#[test]
fn the_sliding_mode_problem() {
    // with four points the error is 1e-11 or a little more, by where the start leaves elements that no switch needs
    for (n_s, error) in [(2, 1e-6), (3, 1e-8), (4, 2e-11)] {
        let mut o = sliding_ocp(&from_all_starts(settings(RadauIia, n_s, 6, FESD)));
        let r = o.solve(&mut Control::default()).unwrap();
        let what = format!("n_s = {n_s}");
        assert_eq!((r.outcome, r.polish), (Outcome::Solved, Polish::Done), "{what}");
        assert!(r.cost < 9.1579, "{what}: cost {}", r.cost);
        assert_near(&[r.cost], &[9.149_601_87], 1e-6, &what);
        assert_eq!(r.trajectory.switches.len(), 4, "{what}");
        assert!(r.residuals.primal < 1e-11 && r.residuals.pair_min < 1e-12, "{what}: {:?}", r.residuals);
        let e = resimulated(&r.controls);
        assert!(e < error, "{what}: E(T) = {e:e}");
    }
}

#[test]
fn the_control_grid_is_exact_and_steps_are_piecewise_equal() {
    let mut o = sliding_ocp(&settings(RadauIia, 2, 6, FESD));
    let r = o.solve(&mut Control::default()).unwrap();
    let h_stage = 4.0 / 6.0;
    for (k, stage) in r.trajectory.elements.chunks(6).enumerate() {
        let sum: f64 = stage.iter().map(|e| e.h).sum();
        assert!((sum - h_stage).abs() < 1e-12, "stage {k}: {sum}");
        assert!((stage[0].t - k as f64 * h_stage).abs() < 1e-12);
        for p in stage.windows(2) {
            if p[0].active == p[1].active {
                assert!((p[0].h - p[1].h).abs() < 1e-12, "stage {k}: {} and {}", p[0].h, p[1].h);
            }
        }
    }
    for p in r.trajectory.elements.windows(2) {
        assert_eq!(p[0].x1, p[1].x0);
    }
}

#[test]
fn without_switch_detection_the_terminal_constraint_is_missed() {
    let mut o = sliding_ocp(&settings(RadauIia, 2, 6, STANDARD));
    let r = o.solve(&mut Control::default()).unwrap();
    assert_eq!(r.outcome, Outcome::Solved);
    assert!(resimulated(&r.controls) > 1e-5);
}

/// A smooth problem has no pairs at all: `min ∫ u² dt`, double integrator from rest to rest, `J = 12`.
#[test]
fn a_problem_without_switches_is_plain_collocation() {
    let mut s = switchback::system::System::new(2, 1, 0).unwrap();
    let d = s.dims();
    s.set_f0(affine("f0", d, &[0.0; 2], &[(0, 1, 1.0), (1, 2, 1.0)])).unwrap();
    let n = 200;
    let mut o = switchback::ocp::Ocp::new(&s, 1.0, n, &settings(RadauIia, 2, 1, FESD)).unwrap();
    let l = smooth(
        "L",
        d,
        1,
        |at, o| o[0] = at.u[0] * at.u[0],
        &[(0, 2)],
        |at, o| o[0] = 2.0 * at.u[0],
        &[(2, 2)],
        |_, w, o| o[0] = 2.0 * w[0],
    );
    o.set_lagrange(l).unwrap();
    o.set_x0(&[0.0; 2]).unwrap();
    o.add_terminal(affine("e", d, &[0.0; 2], &[(0, 0, 1.0), (1, 1, 1.0)]), &[1.0, 0.0], &[1.0, 0.0]).unwrap();
    let r = o.solve(&mut Control::default()).unwrap();
    assert_eq!(r.outcome, Outcome::Solved);
    assert_eq!(r.dimensions.2, 0);
    // piecewise constant controls on n intervals: 12 n² / (n² − 1)
    let n = n as f64;
    assert_near(&[r.cost], &[12.0 * n * n / (n * n - 1.0)], 1e-9, "cost");
    assert!(r.stats.iterations <= 5, "{} iterations", r.stats.iterations);
}

#[test]
fn one_function_may_be_in_two_path_constraints() {
    use switchback::fesd::PathAt::{ControlGrid, StagePoints};
    let set = settings(RadauIia, 2, 5, FESD);
    for tight_first in [true, false] {
        let mut o = sliding_ocp(&set);
        let d = o.system().dims();
        let v2 = smooth("v2", d, 1, |at, o| o[0] = at.x[3], &[(0, 3)], |_, o| o[0] = 1.0, &[], |_, _, _| {});
        let mut constraints = [(StagePoints, -1.65), (ControlGrid, -5.0)];
        if !tight_first {
            constraints.reverse();
        }
        for (at, lower) in constraints {
            o.add_path(v2.clone(), &[lower], &[5.0], at).unwrap();
        }
        let r = o.solve(&mut Control::default()).unwrap();
        assert_eq!(r.outcome, Outcome::Solved);
        let least = r.trajectory.elements.iter().flat_map(|e| e.xs.chunks(4).map(|x| x[3])).fold(0.0, f64::min);
        assert!((least + 1.65).abs() < 1e-6, "v2 goes down to {least}: without the constraint it is -1.70");
    }
}

/// The error that comes with an answer is that of an independent simulation, switch by switch. The program is solved to 1e-12 of the
/// sizes of its rows; a sliding mode on two surfaces makes ten times that of it.
#[test]
fn every_answer_says_how_far_it_is_off() {
    for (n_s, n_fe, most) in [(2, 6, 1e-9), (3, 4, 1e-10), (4, 4, 1e-10)] {
        // with two stage points the homotopy ends at another optimum
        let own = settings(RadauIia, n_s, n_fe, FESD);
        let mut o = sliding_ocp(&if n_s == 2 { from_all_starts(own) } else { own });
        let r = o.solve(&mut Control::default()).unwrap().clone();
        let a = r.accuracy.unwrap();
        assert_eq!((a.outcome, a.n_switches), (Some(switchback::event::Outcome::Reached), r.trajectory.switches.len()));
        assert_eq!(a.stages.len(), 6);
        assert!(a.stages.iter().all(|e| *e < most), "n_s = {n_s}: {:?}", a.stages);
        assert!(a.terminal_violation < most && a.cost_error.abs() < most, "n_s = {n_s}: {a:?}");
        // two simulators that share no equations
        assert!((resimulated(&r.controls) - a.terminal_violation).abs() < 1e-9, "n_s = {n_s}");
    }
    let mut o = sliding_ocp(&settings(RadauIia, 2, 6, STANDARD));
    let a = o.solve(&mut Control::default()).unwrap().accuracy.clone().unwrap();
    assert!(a.terminal_violation > 1e-5, "{a:?}");
    o.set_settings(&Settings { accuracy: 0, ..*o.settings() }).unwrap();
    assert!(o.solve(&mut Control::default()).unwrap().accuracy.is_none());
}

/// A cost that depends on time, parameters and the end, simulated along.
#[test]
fn the_simulated_cost_has_all_its_terms() {
    let mut o = tutorial_ocp(&settings(GaussLegendre, 4, 10, FESD));
    let r = o.solve(&mut Control::default()).unwrap();
    let a = r.accuracy.as_ref().unwrap();
    assert_near(&[a.cost], &[TUTORIAL_COST], 1e-10, "simulated cost");
    assert!(a.cost_error.abs() < 1e-10 && a.terminal < 1e-10, "{a:?}");
}

/// Without sequences beside its own, and with them, the default start ends at the better optimum of (7.51), on a grid of three elements
/// whose relaxed problems lead to the other one; that a search leaves that one is tested where it is given as a sequence.
#[test]
fn the_better_optimum_is_found_with_and_without_a_search_among_neighbours() {
    let solve = |mode_search: i64| {
        let set = Settings { mode_search, ..settings(RadauIia, 2, 3, FESD) };
        let r = sliding_ocp(&set).solve(&mut Control::default()).unwrap().clone();
        assert_eq!((r.outcome, r.polish), (Outcome::Solved, Polish::Done));
        assert!(r.cost < 9.157_859_2, "mode_search {mode_search}: {}", r.cost);
        assert!(r.accuracy.as_ref().unwrap().terminal_violation < 1e-5);
        r
    };
    let (without, with) = (solve(0), solve(20));
    assert!(with.cost < without.cost + 1e-9, "{} {}", without.cost, with.cost);
    let again = solve(20);
    assert_eq!(again.controls, with.controls, "the search is deterministic");
}
