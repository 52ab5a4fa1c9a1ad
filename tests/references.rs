//! Simulations against solutions known to twenty digits (order 44 Taylor, 256 bit, events by Newton).

#![allow(clippy::excessive_precision)]

mod common;
use common::models::*;
use common::*;
use switchback::fesd::SwitchKind::{Cross, Enter, Leave};
use switchback::fesd::{SwitchKind, Trajectory};

type Event = (f64, usize, SwitchKind);

/// Trajectories leave a sliding mode without a kink, so an exit is known to a lower order than the states are.
const EXIT: f64 = 1e-6;

/// Times, subsystems and kinds of all switches.
fn assert_switches(tr: &Trajectory, expected: &[Event], tol: f64, what: &str) {
    let found: Vec<Event> = tr.switches.iter().map(|s| (s.t, s.subsystem, s.kind)).collect();
    assert_eq!(found.len(), expected.len(), "{what}: {found:?}, expected {expected:?}");
    for (f, e) in found.iter().zip(expected) {
        let tol = if e.2 == Leave { tol.max(EXIT) } else { tol };
        assert!((f.0 - e.0).abs() <= tol && (f.1, f.2) == (e.1, e.2), "{what}: {f:?}, expected {e:?}");
    }
}

/// Dense output at these times.
fn assert_samples(tr: &Trajectory, samples: &[(f64, &[f64])], tol: f64, what: &str) {
    for (t, exact) in samples {
        let mut x = vec![0.0; exact.len()];
        tr.state(*t, &mut x).unwrap();
        assert_near(&x, exact, tol, &format!("{what} at t = {t}"));
    }
}

// Example 6.8 (a): closed form
#[test]
fn crossing() {
    for (family, n_s) in [(RadauIia, 1), (RadauIia, 2), (RadauIia, 4), (GaussLegendre, 2), (Explicit, 4)] {
        for n in [1, 3, 7, 10] {
            let what = format!("{family:?} {n_s}, {n} steps");
            let (r, x) = simulate(&switching('a'), &settings(family, n_s, 3, FESD), &[-1.0], 2.0, n);
            assert_near(&x, &[5.0 / 3.0], 1e-10, &what);
            assert_switches(&r.trajectory, &[(1.0 / 3.0, 0, Cross)], 1e-10, &what);
        }
    }
}

// Example 6.8 (b): reference "sliding", root of 0.54 − t − 0.04 cos 5t
#[test]
fn sliding() {
    for (family, n_s, n) in [(RadauIia, 4, 10), (RadauIia, 4, 13), (GaussLegendre, 4, 10)] {
        let what = format!("{family:?} {n_s}, {n} steps");
        let (r, x) = simulate(&switching('b'), &settings(family, n_s, 3, FESD), &[-0.5], 2.0, n);
        assert_near(&x, &[0.0], 1e-10, &what);
        assert_switches(&r.trajectory, &[(0.436_955_033_385_969_07, 0, Enter)], 1e-10, &what);
    }
}

// Example 6.8 (c): reference "leaving"
#[test]
fn leaving() {
    for n_s in [2, 3, 4] {
        for n in [1, 3, 7, 10] {
            let what = format!("Radau IIA {n_s}, {n} steps");
            let set = settings(RadauIia, n_s, 3, FESD);
            let (r, x) = simulate(&switching('c'), &set, &[-0.5], 2.0, n);
            assert_near(&x, &[0.5], 1e-10, &what);
            let enters = (2f64.sqrt() - 1.0, 0, Enter);
            assert_switches(&r.trajectory, &[enters, (1.0, 0, Leave)], 1e-10, &what);
            let (r, x) = simulate(&switching('c'), &set, &[0.0], 2.0, n);
            assert_near(&x, &[0.5], 1e-10, &what);
            assert_switches(&r.trajectory, &[(1.0, 0, Leave)], 1e-10, &what);
        }
    }
}

/// Exits with methods that have no node at the end of the element, for a linear `λ` exact.
#[test]
fn leaving_with_gauss_legendre() {
    for n_s in [2, 3, 4] {
        for n in [1, 3, 7, 10] {
            let what = format!("Gauss-Legendre {n_s}, {n} steps");
            let (r, x) = simulate(&switching('c'), &settings(GaussLegendre, n_s, 3, FESD), &[-0.5], 2.0, n);
            assert_near(&x, &[0.5], 1e-10, &what);
            assert_switches(&r.trajectory, &[(2f64.sqrt() - 1.0, 0, Enter), (1.0, 0, Leave)], 1e-8, &what);
        }
    }
}

#[test]
fn leaving_with_explicit_methods() {
    for n_s in [2, 4] {
        for n in [3, 7, 10] {
            let what = format!("explicit {n_s}, {n} steps");
            let (r, x) = simulate(&switching('c'), &settings(Explicit, n_s, 3, FESD), &[-0.5], 2.0, n);
            assert_near(&x, &[0.5], 1e-8, &what);
            assert_switches(&r.trajectory, &[(2f64.sqrt() - 1.0, 0, Enter), (1.0, 0, Leave)], 1e-6, &what);
        }
    }
}

/// Solutions rest at 0 until some time, or for ever, then leave to one side.
#[test]
fn where_the_continuation_is_not_unique_some_solution_is_found() {
    for (family, n_s) in [(RadauIia, 2), (GaussLegendre, 2), (Explicit, 2)] {
        let (r, x) = simulate(&switching('d'), &settings(family, n_s, 3, FESD), &[0.0], 2.0, 5);
        assert_eq!(r.non_unique.first(), Some(&0.0), "{family:?} {n_s}: {:?}", r.non_unique);
        let leaves = 2.0 - x[0].abs();
        for e in &r.trajectory.elements {
            let exact = (e.t + e.h - leaves).max(0.0) * x[0].signum();
            assert!((e.x1[0] - exact).abs() < 1e-9, "{family:?} {n_s}: {e:?}");
        }
    }
}

// reference "codim2": (7.51) with u = (−0.5, −0.4), through a sliding mode of codimension two
#[test]
fn codimension_two() {
    for (n_s, n_fe, n) in [(4, 3, 40), (3, 2, 50), (4, 3, 17)] {
        let what = format!("Radau IIA {n_s}, {n} steps of {n_fe}");
        let mut s = switchback::sim::Simulator::new(&sliding_mode(), &settings(RadauIia, n_s, n_fe, FESD)).unwrap();
        s.set_state(0.0, &SLIDING_X0).unwrap();
        s.set_controls(&[-0.5, -0.4]).unwrap();
        let r = s.run(4.0, n, &mut Default::default()).unwrap();
        assert_eq!(r.outcome, switchback::nlp::Outcome::Solved, "{what}, t = {}", s.time());
        let tol = if n_s == 4 { 1e-11 } else { 1e-8 };
        assert_near(s.state(), &[-1.0, -0.450_012_233_952_023_67, -2.0, -1.6], tol, &what);
        let events = [
            (0.843_157_864_293_370_5, 1, Enter),
            (1.518_178_564_196_647_2, 0, Enter),
            (2.0, 0, Leave),
            (2.500_367_558_959_063_3, 1, Leave),
        ];
        assert_switches(&r.trajectory, &events, 1e3 * tol, &what);
        let samples: [(f64, &[f64]); 3] = [
            (1.0, &[0.8443951023931955, 0.030102815814844867, -0.5, -0.4]),
            (1.6, &[0.0, 0.0, -0.8, -0.64]),
            (2.4, &[-0.04, -3.2e-6, -1.2, -0.96]),
        ];
        assert_samples(&r.trajectory, &samples, 1e3 * tol, &what);
    }
}

// reference "blocks": three blocks with dry friction
#[test]
fn blocks_with_friction() {
    let set = settings(RadauIia, 4, 3, FESD);
    let (r, x) = simulate(&blocks(), &set, &[-1.0, 1.0, -1.0, -1.0, 1.0, 1.0], 12.0, 60);
    let exact = [0.113_080_835_391_119_14, 0.186_579_817_257_253_01, 0.234_117_239_102_131_56, 0.0, 0.0, 0.0];
    assert_near(&x, &exact, 1e-10, "blocks");
    let events = [
        (0.204_751_747_825_336_87, 1, Cross),
        (0.248_703_849_479_871_64, 0, Cross),
        (1.788_631_301_583_078_2, 2, Cross),
        (1.902_911_374_264_309_2, 1, Cross),
        (2.144_794_496_509_573_5, 0, Cross),
        (3.491_633_368_472_740_6, 0, Enter),
        (3.641_696_748_667_766_7, 2, Enter),
        (3.927_104_415_443_988_9, 1, Enter),
    ];
    assert_switches(&r.trajectory, &events, 1e-9, "blocks");
}

// reference "coulomb": forced oscillator that stops and starts again, one stop shorter than 8 ms
#[test]
fn oscillator_with_dry_friction() {
    let (r, x) = simulate(&coulomb(), &settings(RadauIia, 4, 3, FESD), &[1.0, 0.2], 40.0, 200);
    assert_near(&x, &[1.178_427_067_844_834_5, -0.259_736_449_971_157_8], 1e-9, "coulomb");
    let events = [
        (0.454_985_086_235_283_8, 0, Enter),
        (1.734_950_423_387_333, 0, Leave),
        (6.635_313_621_707_407, 0, Cross),
        (12.534_236_829_736_55, 0, Enter),
        (13.791_537_824_488_487, 0, Leave),
        (19.009_123_857_675_196, 0, Enter),
        (19.016_434_590_065_784, 0, Leave),
        (25.133_317_139_815_932, 0, Enter),
        (26.163_435_714_972_727, 0, Leave),
        (31.519_905_925_165_814, 0, Enter),
        (31.919_870_207_773_819, 0, Leave),
        (37.713_948_398_986_59, 0, Enter),
        (38.617_782_638_032_468, 0, Leave),
    ];
    assert_switches(&r.trajectory, &events, 1e-8, "coulomb");
}

#[test]
fn oscillator_switch_time_and_samples() {
    let (r, _) = simulate(&oscillator(), &settings(RadauIia, 4, 2, FESD), &OSCILLATOR_X0, PI / 2.0, 100);
    assert_switches(&r.trajectory, &[(1.0, 0, Cross)], 1e-12, "oscillator");
    // inside the disc the solution turns clockwise, outside the other way
    let (a, b) = (2.0 * PI * 0.73, 2.0 * PI * 0.31);
    let inside = [(-0.27f64).exp() * a.cos(), -(-0.27f64).exp() * a.sin()];
    let outside = [0.31f64.exp() * b.cos(), 0.31f64.exp() * b.sin()];
    assert_samples(&r.trajectory, &[(0.73, &inside), (1.31, &outside)], 1e-7, "oscillator");
}

#[test]
fn where_the_continuation_is_unique_nothing_else_is_claimed() {
    for (sys, x0, t_end) in [
        (switching('a'), vec![-1.0], 2.0),
        (switching('b'), vec![-0.5], 2.0),
        (switching('c'), vec![-0.5], 2.0),
        (switching('c'), vec![0.0], 2.0),
        (oscillator(), OSCILLATOR_X0.to_vec(), PI / 2.0),
        (coulomb(), vec![1.0, 0.2], 10.0),
    ] {
        for n in [7, 10] {
            let (r, _) = simulate(&sys, &settings(RadauIia, 3, 3, FESD), &x0, t_end, n);
            assert!(r.non_unique.is_empty(), "{:?}", r.non_unique);
        }
    }
}

// reference "zeno_T0999": the last switch 2.7 ms before the accumulation point
#[test]
fn switches_that_accumulate_up_to_shortly_before_the_end() {
    for n in [10, 33] {
        let (r, x) = simulate(&zeno(), &settings(RadauIia, 2, 3, FESD), &[1.0, 1.0], 0.999, n);
        assert_near(&x, &[-0.001_743_484_224_965_706_4, -0.000_256_515_775_034_293_55], 1e-11, "zeno");
        let times: Vec<f64> = r.trajectory.switches.iter().map(|s| s.t).collect();
        let exact: Vec<f64> = (0..6).map(|k| 1.0 - 2.0 / 3.0 * 3f64.powi(-k)).collect();
        assert_near(&times, &exact, 1e-10, "switching times");
    }
}

/// Infinitely many switches before `t = 1`: the simulation may give up, but it must come back, and it must not
/// claim a wrong solution.
#[test]
fn a_zeno_point_is_no_trap() {
    let mut s = switchback::sim::Simulator::new(&zeno(), &settings(RadauIia, 2, 3, FESD)).unwrap();
    s.set_state(0.0, &[1.0, 1.0]).unwrap();
    let clock = std::time::Instant::now();
    let r = s.run(2.0, 20, &mut Default::default()).unwrap();
    assert!(clock.elapsed().as_secs_f64() < 10.0, "{} s", clock.elapsed().as_secs_f64());
    if r.outcome == switchback::nlp::Outcome::Solved {
        assert_near(s.state(), &[0.0, 0.0], 1e-6, "after the accumulation point");
    } else {
        assert!(s.time() <= 1.0 && r.steps >= 8, "t = {}, {} steps", s.time(), r.steps);
    }
}

// reference "stickslip1": limit cycle; a mode that is not active has a pole on the trajectory
#[test]
fn stick_and_slip() {
    let (r, x) = simulate(&stick_slip(), &settings(RadauIia, 4, 3, FESD), &[-0.8, -1.0], 40.0, 250);
    assert_near(&x, &[1.167_852_141_933_150_4, 0.008_029_188_597_314_394], 1e-9, "stick-slip");
    let events = [
        (0.718_626_155_124_502_7, 0, Cross),
        (2.059_609_682_635_571, 0, Enter),
        (11.095_912_541_146_825, 0, Leave),
        (15.799_277_539_088_978, 0, Enter),
        (20.326_682_999_229_806, 0, Leave),
        (25.030_047_997_171_955, 0, Enter),
        (29.557_453_457_312_782, 0, Leave),
        (34.260_818_455_254_935, 0, Enter),
        (38.788_223_915_395_76, 0, Leave),
    ];
    assert_switches(&r.trajectory, &events, 1e-8, "stick-slip");
}

// reference "coulomb" with long steps: the stop from 19.0091 to 19.0164 is far shorter than a step
#[test]
fn a_stop_much_shorter_than_a_step_is_not_jumped_over() {
    for (n_s, n_fe) in [(6, 2), (6, 3)] {
        let (r, x) = simulate(&coulomb(), &settings(RadauIia, n_s, n_fe, FESD), &[1.0, 0.2], 40.0, 40);
        assert_eq!(r.trajectory.switches.len(), 13, "{n_s} {n_fe}: {:?}", r.trajectory.switches);
        assert_near(&x, &[1.178_427_067_844_834_5, -0.259_736_449_971_157_8], 1e-8, "coulomb");
    }
}

/// The mode that is left at 2.50037 with a step that begins at 2.5; reference "codim2".
fn left_shortly_after_the_start(n_s: i64, exit: f64, tol: f64) {
    let mut s = switchback::sim::Simulator::new(&sliding_mode(), &settings(RadauIia, n_s, 3, FESD)).unwrap();
    s.set_state(0.0, &SLIDING_X0).unwrap();
    s.set_controls(&[-0.5, -0.4]).unwrap();
    let r = s.run(4.0, 8, &mut Default::default()).unwrap();
    let last = r.trajectory.switches.last().unwrap();
    assert!((last.t - 2.500_367_558_959_063_3).abs() < exit, "n_s = {n_s}: {last:?}");
    assert_near(s.state(), &[-1.0, -0.450_012_233_952_023_67, -2.0, -1.6], tol, "codim2");
}

#[test]
fn a_mode_left_shortly_after_the_start_of_a_step() {
    // two stages: a multiplier that is a line over the element knows its zero to the order two
    left_shortly_after_the_start(2, 3e-4, 1e-8);
    left_shortly_after_the_start(4, 1e-6, 1e-11);
    left_shortly_after_the_start(6, 1e-8, 1e-11);
}

#[test]
fn no_convex_combination_has_negative_weights() {
    for (n_s, n) in [(4, 40), (4, 200), (3, 100)] {
        let (r, x) = simulate(&coulomb(), &settings(RadauIia, n_s, 3, FESD), &[1.0, 0.2], 40.0, n);
        for e in &r.trajectory.elements {
            let least = e.theta.iter().chain(&e.lambda).fold(0.0, |a: f64, b| a.min(*b));
            assert!(least > -1e-3, "{n_s} {n}, t = {}: {e:?}", e.t);
        }
        assert_near(&x, &[1.178_427_067_844_834_5, -0.259_736_449_971_157_8], 1e-6, "coulomb");
    }
}
