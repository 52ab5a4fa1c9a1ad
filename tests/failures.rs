//! Functions without a value, limits, interrupts, infeasible problems: outcomes, no panics.

mod common;
use common::models::*;
use common::*;
use std::sync::atomic::AtomicBool;
use std::sync::Arc;
use switchback::func::{Callback, Dims, Point};
use switchback::nlp::{Control, IterationInfo, Outcome};
use switchback::ocp::Ocp;
use switchback::settings::Settings;
use switchback::sim::Simulator;
use switchback::stop::Stop;
use switchback::system::{SharedFunction, System};

const DIMS: Dims = Dims { x: 1, u: 1, p: 0 };

/// Ways to have no value.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    NaN,
    Infinite,
    Recoverable,
    Fatal,
    Panic,
}

const WAYS: [Way; 5] = [Way::NaN, Way::Infinite, Way::Recoverable, Way::Fatal, Way::Panic];

fn fail(way: Way, o: &mut [f64]) -> i32 {
    match way {
        Way::NaN => o.fill(f64::NAN),
        Way::Infinite => o.fill(f64::INFINITY),
        Way::Recoverable => return 1,
        Way::Fatal => return -7,
        Way::Panic => panic!("a model function that panics"),
    }
    0
}

/// Which of value, Jacobian and Hessian fails.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Part {
    Value,
    Jacobian,
    Hessian,
}

/// `x²/2 + u` (one output) that fails where `bad` says so.
fn fragile(part: Part, way: Way, bad: fn(&Point) -> bool) -> SharedFunction {
    let f = Callback::new("fragile", DIMS, 1, move |at, o| {
        if part == Part::Value && bad(at) {
            return fail(way, o);
        }
        o[0] = 0.5 * at.x[0] * at.x[0] + at.u[0];
        0
    })
    .with_jacobian(pattern(1, 3, &[(0, 0), (0, 1)]), move |at, o| {
        if part == Part::Jacobian && bad(at) {
            return fail(way, o);
        }
        o[0] = at.x[0];
        o[1] = 1.0;
        0
    })
    .unwrap()
    .with_hessian(pattern(3, 3, &[(0, 0)]), move |at, w, o| {
        if part == Part::Hessian && bad(at) {
            return fail(way, o);
        }
        o[0] = w[0];
        0
    })
    .unwrap();
    Arc::new(f)
}

/// `x' ∈ 1 + u − sign x` with a cost; `role` is played by the fragile function.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Role {
    Drift,
    Psi,
    Lagrange,
    Mayer,
    Terminal,
    Path,
}

const ROLES: [Role; 6] = [Role::Drift, Role::Psi, Role::Lagrange, Role::Mayer, Role::Terminal, Role::Path];

fn system(role: Role, f: &SharedFunction) -> System {
    let mut s = System::new(1, 1, 0).unwrap();
    s.set_f0(if role == Role::Drift { f.clone() } else { affine("f0", DIMS, &[0.5], &[(0, 1, 1.0)]) }).unwrap();
    let psi = if role == Role::Psi { f.clone() } else { affine("psi", DIMS, &[0.0], &[(0, 0, 1.0)]) };
    add_sides(&mut s, &[0], affine("F", DIMS, &[-1.0, 1.0], &[]), psi);
    s
}

fn ocp(role: Role, f: &SharedFunction, set: &Settings) -> Ocp {
    let mut o = Ocp::new(&system(role, f), 1.0, 2, set).unwrap();
    let square = smooth(
        "L",
        DIMS,
        1,
        |at, o| o[0] = at.u[0] * at.u[0],
        &[(0, 1)],
        |at, o| o[0] = 2.0 * at.u[0],
        &[(1, 1)],
        |_, w, o| o[0] = 2.0 * w[0],
    );
    o.set_lagrange(if role == Role::Lagrange { f.clone() } else { square }).unwrap();
    if role == Role::Mayer {
        o.set_mayer(f.clone()).unwrap();
    }
    if role == Role::Terminal {
        o.add_terminal(f.clone(), &[-5.0], &[5.0]).unwrap();
    }
    if role == Role::Path {
        o.add_path(f.clone(), &[-5.0], &[5.0], switchback::fesd::PathAt::StagePoints).unwrap();
    }
    o.set_x0(&[-0.5]).unwrap();
    o.set_u_bounds(&[-2.0], &[2.0]).unwrap();
    o
}

fn silent<T>(f: impl FnOnce() -> T) -> T {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| ()));
    let r = f();
    std::panic::set_hook(hook);
    r
}

#[test]
fn functions_that_never_have_a_value_end_as_failed() {
    silent(|| {
        for way in WAYS {
            for part in [Part::Value, Part::Jacobian, Part::Hessian] {
                for role in ROLES {
                    let f = fragile(part, way, |_| true);
                    let what = format!("{role:?} {part:?} {way:?}");
                    let set = Settings { max_iter: 200, ..settings(RadauIia, 2, 2, FESD) };
                    let outcome = ocp(role, &f, &set).solve(&mut Control::default()).map(|r| r.outcome);
                    // an error is as good: what must not happen is a result that claims to be one
                    assert!(!matches!(outcome, Ok(Outcome::Solved)), "{what}: solved");
                    if part == Part::Value {
                        assert!(matches!(outcome, Ok(Outcome::Failed) | Err(_)), "{what}: {outcome:?}");
                    }
                    if matches!(role, Role::Drift | Role::Psi) {
                        let mut s = Simulator::new(&system(role, &f), &set).unwrap();
                        s.set_state(0.0, &[-0.5]).unwrap();
                        let r = s.run(1.0, 3, &mut Control::default()).map(|r| r.outcome);
                        let linear_enough = part == Part::Hessian;
                        assert!(linear_enough || !matches!(r, Ok(Outcome::Solved)), "{what}: simulated");
                    }
                }
            }
        }
    });
}

#[test]
fn a_domain_that_the_solution_does_not_leave_is_no_obstacle() {
    // the drift is not defined beyond |x| = 3; the solution stays below 1
    for way in [Way::NaN, Way::Infinite, Way::Recoverable] {
        for part in [Part::Value, Part::Jacobian, Part::Hessian] {
            let f = fragile(part, way, |at| at.x[0].abs() > 3.0);
            let r =
                ocp(Role::Drift, &f, &settings(RadauIia, 2, 2, FESD)).solve(&mut Control::default()).unwrap().clone();
            assert_eq!(r.outcome, Outcome::Solved, "{part:?} {way:?}");
        }
    }
}

#[test]
fn a_simulation_that_leaves_the_domain_stops_there_and_says_so() {
    // x' = 1 + x²/2 + u from −0.5 with ψ < 0 for ever after 0; not defined beyond 0.8
    let mut s = System::new(1, 1, 0).unwrap();
    s.set_f0(fragile(Part::Value, Way::NaN, |at| at.x[0] > 0.8)).unwrap();
    let psi = affine("psi", DIMS, &[0.0], &[(0, 0, 1.0)]);
    add_sides(&mut s, &[0], affine("F", DIMS, &[1.0, 1.5], &[]), psi);
    let mut sim = Simulator::new(&s, &settings(RadauIia, 2, 2, FESD)).unwrap();
    sim.set_state(0.0, &[-0.5]).unwrap();
    let r = sim.run(4.0, 40, &mut Control::default()).unwrap();
    assert_ne!(r.outcome, Outcome::Solved);
    assert!(r.steps > 3 && r.steps < 40, "{} steps", r.steps);
    assert!(sim.state()[0] <= 0.8 && sim.time() > 0.3, "{:?} at {}", sim.state(), sim.time());
    assert_eq!(r.trajectory.elements.len(), 2 * r.steps);
    // and can go on from elsewhere
    sim.set_state(0.0, &[-0.5]).unwrap();
    assert_eq!(sim.run(0.3, 3, &mut Control::default()).unwrap().outcome, Outcome::Solved);
}

#[test]
fn limits_and_interrupts() {
    let base = settings(RadauIia, 2, 3, FESD);
    for max_iter in [0, 1, 5, 20] {
        let r = sliding_ocp(&Settings { max_iter, ..base }).solve(&mut Control::default()).unwrap().clone();
        assert_eq!(r.outcome, Outcome::MaxIter, "max_iter = {max_iter}");
        assert!(r.stats.iterations <= max_iter as usize + 1, "max_iter = {max_iter}: {}", r.stats.iterations);
        assert!(r.controls.iter().all(|u| u.is_finite()));
    }
    let r = sliding_ocp(&Settings { max_time: 0.0, ..base }).solve(&mut Control::default()).unwrap().clone();
    assert_eq!(r.outcome, Outcome::MaxTime);
    let stop = Arc::new(AtomicBool::new(true));
    let mut control = Control::of(Stop::on(&stop));
    let mut o = sliding_ocp(&base);
    assert_eq!(o.solve(&mut control).unwrap().outcome, Outcome::Stopped);
    // the object is as good as new
    let fresh = sliding_ocp(&base).solve(&mut Control::default()).unwrap().clone();
    let again = o.solve(&mut Control::default()).unwrap();
    assert_eq!(again.outcome, Outcome::Solved);
    assert_eq!(again.controls, fresh.controls);
    for last in [0, 3, 40] {
        let mut monitor = |i: &IterationInfo| i.iter < last;
        let mut control = Control { monitor: Some(&mut monitor), ..Control::default() };
        assert_eq!(sliding_ocp(&base).solve(&mut control).unwrap().outcome, Outcome::Stopped, "{last}");
    }
    let mut sim = Simulator::new(&coulomb(), &base).unwrap();
    sim.set_state(0.0, &[1.0, 0.2]).unwrap();
    let mut control = Control::of(Stop::on(&stop));
    assert_eq!(sim.run(1.0, 3, &mut control).unwrap().outcome, Outcome::Stopped);
    assert_eq!((sim.time(), sim.state()), (0.0, &[1.0, 0.2][..]));
}

#[test]
fn problems_without_a_feasible_point_are_not_solved() {
    for disc in [FESD, STANDARD] {
        let mut o = sliding_ocp(&settings(RadauIia, 2, 3, disc));
        // the velocities are bounded by 2: in 4 time units nobody gets this far
        let e = affine("far", o.system().dims(), &[0.0], &[(0, 0, 1.0)]);
        o.add_terminal(e, &[100.0], &[100.0]).unwrap();
        let r = o.solve(&mut Control::default()).unwrap();
        assert_eq!(r.outcome, Outcome::Infeasible, "{disc:?}");
    }
}

#[test]
fn wrong_input_is_refused() {
    let set = settings(RadauIia, 2, 3, FESD);
    let mut o = sliding_ocp(&set);
    assert!(o.set_x0(&[f64::NAN, 0.0, 0.0, 0.0]).is_err());
    assert!(o.set_x0(&[0.0]).is_err());
    assert!(o.set_u_bounds(&[1.0, 0.0], &[0.0, 1.0]).is_err());
    assert!(o.set_u_guess(&[0.0; 3]).is_err());
    assert!(o.set_x_guess(&[1.0, 0.0], &[0.0; 8]).is_err());
    assert!(Ocp::new(&sliding_mode(), 0.0, 6, &set).is_err());
    assert!(Ocp::new(&sliding_mode(), 4.0, 0, &set).is_err());
    assert!(Ocp::new(&System::new(2, 0, 0).unwrap(), 4.0, 6, &set).is_err());
    let mut s = Simulator::new(&coulomb(), &set).unwrap();
    assert!(s.set_state(0.0, &[1.0]).is_err());
    assert!(s.set_state(f64::INFINITY, &[1.0, 0.0]).is_err());
    assert!(s.run(-1.0, 3, &mut Control::default()).is_err());
    assert!(s.run(1.0, 0, &mut Control::default()).is_err());
    let values = Settings { stage_form: 1, ..settings(Explicit, 2, 3, FESD) };
    assert!(Simulator::new(&coulomb(), &values).is_err());
}
