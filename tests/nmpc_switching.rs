//! Controllers for systems that switch: closed loops with dry friction.

// the report uses more of it
#[allow(dead_code)]
#[path = "common/stick_slip.rs"]
mod problems;

use problems::{cart_pole, options, two_masses, Disturbance, Loop};
use switchback::nmpc::*;

/// Costs that prototypes reach are 357.23 and 81.18. The first is met within a hundredth, by any number of iterations: plans over one
/// second decide which way a pole is caught that was kicked, and the cheaper plan is not always the cheaper loop.
#[test]
fn costs_of_closed_loops_with_friction() {
    let exact = Disturbance::default();
    for (scheme, inner) in [(Scheme::Rti, 0), (Scheme::AsRti, 1), (Scheme::AsRti, 3)] {
        let Loop { cost, controller: c, .. } = two_masses(1.0).run(&options(scheme, inner), &exact);
        println!("two masses, {scheme:?} {inner}: {cost:.4}, {:?}", c.monitor());
        assert!(cost <= 81.2, "{scheme:?} {inner}: {cost}");
    }
    for inner in [1, 2, 3] {
        let Loop { cost, controller: c, .. } = cart_pole(3.0).run(&options(Scheme::AsRti, inner), &exact);
        println!("cart and pole, {inner}: {cost:.4}, {:?}", c.monitor());
        assert!(cost <= 1.011 * 357.23, "{inner}: {cost}");
    }
}

/// The reason for alternatives: the cart sticks, no derivative says that a larger force would move it, and it stays where it is.
#[test]
fn without_alternatives_a_sticking_system_stays() {
    let case = cart_pole(3.0);
    let inert = Options { flips: 0, ..options(Scheme::AsRti, 3) };
    let done = case.run(&inert, &Disturbance::default());
    assert!(done.x[..60].iter().all(|x| x[0] == case.x0[0]), "the cart has moved");
    let done = case.run(&options(Scheme::Rti, 0), &Disturbance::default());
    assert!(done.controller.monitor().alternatives > 0);
    assert!(done.x[59][0].abs() < 0.2 && (done.x[59][1] - std::f64::consts::PI).abs() < 0.05, "{:?}", done.x[59]);
}

/// Friction that is not that of the model, noise, delay: the pole stands at the end, and the control does not change its sign from
/// sample to sample.
#[test]
fn mismatch_noise_and_delay() {
    let with = |noise: f64, delay: usize| Disturbance { noise, delay };
    for (friction, disturbance) in
        [(3.6, with(0.0, 0)), (2.4, with(0.0, 0)), (3.0, with(2e-3, 0)), (3.0, with(0.0, 1)), (3.6, with(2e-3, 1))]
    {
        let case = cart_pole(3.0).on(cart_pole(friction));
        let done = case.run(&options(Scheme::AsRti, 1), &disturbance);
        let what = format!("friction {friction}, noise {}, delay {}", disturbance.noise, disturbance.delay);
        let last = &done.u[done.u.len() - 20..];
        let turns = last.windows(2).filter(|w| w[0] * w[1] < 0.0 && w[0].abs().min(w[1].abs()) > 1.0).count();
        println!("{what}: {:.2}, {turns} turns, {:?}, {last:.1?}", done.cost, done.x[done.x.len() - 1]);
        let end = done.x[done.x.len() - 1];
        assert!((end[0] + 1.0).abs() < 0.1 && (end[1] - std::f64::consts::PI).abs() < 0.1, "{what}: {end:?}");
        // with more friction than the model has the loop hunts, with a period of about seven samples: how many turns the last twenty have is a
        // matter of rounding, at every sample they would be nineteen
        assert!(turns <= 6, "{what}: {last:?}");
        // after states that were not predicted plans that begin at a bound are tried, and improved for longer: without the former some of
        // these loops cost 440, without the latter that with the delay 410
        assert!(done.cost < 380.0, "{what}: {}", done.cost);
    }
    for (friction, disturbance) in [(1.2, with(0.0, 0)), (0.8, with(0.0, 0)), (1.0, with(2e-3, 0)), (1.0, with(0.0, 1))]
    {
        let done = two_masses(1.0).on(two_masses(friction)).run(&options(Scheme::AsRti, 1), &disturbance);
        let end = done.x[done.x.len() - 1];
        println!("two masses, friction {friction}: {:.3}, {end:?}", done.cost);
        assert!(end.iter().all(|v| v.abs() < 0.15), "friction {friction}: {end:?}");
    }
}

/// The same calls give the same bits.
#[test]
fn runs_repeat_to_the_bit() {
    let run = || two_masses(1.0).run(&options(Scheme::AsRti, 2), &Disturbance::default()).cost.to_bits();
    assert_eq!(run(), run());
}

/// States that cannot be measured or simulated: there is a control, and its source is said.
#[test]
fn there_always_is_a_control() {
    let case = cart_pole(3.0);
    let mut c = Nmpc::new(&case.ocp, &options(Scheme::AsRti, 1)).unwrap();
    let mut u = [f64::NAN];
    assert_eq!(c.feedback(&case.x0, &mut u).unwrap().source, Source::Plan);
    c.prepare(None).unwrap();
    assert_eq!(c.feedback(&[f64::NAN; 4], &mut u).unwrap().source, Source::Plan);
    c.prepare(Some(&[1e300, 1e300, 1e300, 1e300])).unwrap();
    assert!(c.monitor().failed_linearisations > 0);
    c.feedback(&case.x0, &mut u).unwrap();
    assert!(u[0].abs() <= 20.0);
    c.set_deadline(1e-12).unwrap();
    c.prepare(Some(&case.x0)).unwrap();
    c.feedback(&case.x0, &mut u).unwrap();
    assert!(u[0].abs() <= 20.0);
}

#[test]
fn what_is_not_known_is_said() {
    let case = cart_pole(3.0);
    let refused = |o: Options| Nmpc::new(&case.ocp, &o).map(|_| ()).unwrap_err().to_string();
    for level in [Level::A, Level::B, Level::C, Level::D1, Level::D2] {
        assert!(refused(Options { level, ..options(Scheme::AsRti, 1) }).contains("that switch"));
    }
    assert!(refused(options(Scheme::Mli, 1)).contains("that switch"));
    assert!(refused(Options { hysteresis: 1.0, ..Options::default() }).contains("hysteresis"));
}

/// What a callback sees besides its arguments may change: stages that it is part of are simulated at every preparation.
#[test]
fn callbacks_are_asked_again() {
    use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
    use std::sync::Arc;
    use switchback::expr::Graph;
    use switchback::func::{Callback, Dims, Point};
    use switchback::ocp::{CostAt, Ocp};
    use switchback::settings::Settings;
    use switchback::system::{Regions, Subsystem, System};
    let gain = Arc::new(AtomicU64::new(1.0f64.to_bits()));
    let (g, dims, seen) = (Graph::new(), Dims { x: 1, u: 1, p: 0 }, gain.clone());
    let f = Callback::new("f", dims, 1, move |at: &Point, out: &mut [f64]| {
        out[0] = f64::from_bits(seen.load(Relaxed)) * at.u[0];
        0
    });
    let mut system = System::new(1, 1, 0).unwrap();
    system.set_f0(Arc::new(f)).unwrap();
    let modes = Arc::new(g.function("friction", dims, &[g.constant(-0.1), g.constant(0.1)]).unwrap());
    let regions = Regions::Signs { psi: Arc::new(g.function("x", dims, &[g.x(0)]).unwrap()), signs: vec![1, -1] };
    system.add_subsystem(Subsystem { rows: vec![0], modes, n_modes: 2, regions }).unwrap();
    let mut ocp = Ocp::new(&system, 0.5, 5, &Settings::default()).unwrap();
    let all = Arc::new(g.function("all", dims, &[g.x(0) - 2.0, g.u(0)]).unwrap());
    ocp.add_least_squares(all, &[1.0, 0.1], &[0.0; 2], CostAt::Running).unwrap();
    ocp.set_u_bounds(&[-5.0], &[5.0]).unwrap();
    let control = |c: &mut Nmpc| {
        let mut u = [0.0];
        for _ in 0..20 {
            c.prepare(Some(&[1.0])).unwrap();
            c.feedback(&[1.0], &mut u).unwrap();
        }
        u[0]
    };
    let mut c = Nmpc::new(&ocp, &options(Scheme::AsRti, 1)).unwrap();
    let before = control(&mut c);
    gain.store(2.0f64.to_bits(), Relaxed);
    let (after, fresh) = (control(&mut c), control(&mut Nmpc::new(&ocp, &options(Scheme::AsRti, 1)).unwrap()));
    assert!((after - fresh).abs() < 1e-6 && (after - before).abs() > 1e-2, "{before} {after} {fresh}");
}
