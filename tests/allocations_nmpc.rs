//! A controller allocates nothing after it was made: feedback, preparations of all levels, also where programs are infeasible and
//! measurements are not numbers.

#[path = "common/counting.rs"]
mod counting;
// other tests use more of it
#[allow(dead_code)]
#[path = "common/stick_slip.rs"]
mod stick_slip;
use counting::count;
use std::sync::Arc;
use switchback::expr::Graph;
use switchback::func::Dims;
use switchback::nmpc::{Level, Nmpc, Options, QpMethod, Scheme};
use switchback::ocp::{CostAt, Norm, Ocp};
use switchback::settings::Settings;
use switchback::system::{SharedFunction, System};
use switchback::tableau::Family;

/// A pendulum with a bound of the angular velocity that may be violated and one of the angle that may not.
fn problem() -> Ocp {
    let g = Graph::new();
    let dims = Dims { x: 2, u: 1, p: 0 };
    let [a, w, u] = [g.x(0), g.x(1), g.u(0)];
    let f: SharedFunction = Arc::new(g.function("f", dims, &[w, u - a.sin()]).unwrap());
    let all: SharedFunction = Arc::new(g.function("all", dims, &[a, w, u]).unwrap());
    let speed: SharedFunction = Arc::new(g.function("speed", dims, &[w]).unwrap());
    let mut system = System::new(2, 1, 0).unwrap();
    system.set_f0(f).unwrap();
    let mut ocp = Ocp::new(&system, 1.5, 15, &Settings::default()).unwrap();
    ocp.add_least_squares(all, &[1.0, 0.1, 0.01], &[0.0; 3], CostAt::Running).unwrap();
    let at = switchback::fesd::PathAt::ControlGrid;
    ocp.add_relaxed(speed.clone(), &[-0.5], &[0.5], Some(at), Norm::L1, 3.0).unwrap();
    ocp.add_relaxed(speed, &[-0.5], &[0.5], Some(at), Norm::L2, 5.0).unwrap();
    ocp.set_x_bounds(&[-0.8, -9.0], &[0.8, 9.0]).unwrap();
    ocp.set_u_bounds(&[-1.0], &[1.0]).unwrap();
    ocp
}

#[test]
fn nothing_is_allocated_after_creation() {
    let ocp = problem();
    for (family, n_s) in [(Family::Explicit, 4), (Family::GaussLegendre, 2)] {
        for scheme in [Scheme::Rti, Scheme::Mli, Scheme::AsRti, Scheme::Asc] {
            for level in [Level::A, Level::B, Level::C, Level::D0, Level::D1, Level::D2] {
                if level == Level::D2 && family != Family::Explicit {
                    continue;
                }
                let both = [QpMethod::Condensing, QpMethod::Stagewise];
                for (qp, max_changes) in both.into_iter().flat_map(|qp| [(qp, 0), (qp, 2)]) {
                    let options = Options {
                        max_changes,
                        scheme,
                        level,
                        inner: 2,
                        qp,
                        shift: true,
                        family: Some(family),
                        n_s,
                        steps: 1,
                        ..Options::default()
                    };
                    let mut c = Nmpc::new(&ocp, &options).unwrap();
                    let mut u = [0.0];
                    let before = count();
                    for x in [[0.5, 0.0], [0.4, 0.3], [f64::NAN, 0.0], [2.0, 3.0], [-0.6, -0.4], [0.0, 0.0]] {
                        c.prepare(None).unwrap();
                        c.feedback(&x, &mut u).unwrap();
                        c.finish();
                    }
                    assert_eq!(count(), before, "{family:?} {scheme:?} {level:?} {qp:?} {max_changes}");
                    let [solved, soft, cut, ..] = c.monitor().sources;
                    let seen = if max_changes == 0 { solved > 0 && soft > 0 } else { cut > 0 };
                    assert!(seen, "{:?}", c.monitor().sources);
                }
            }
        }
    }
}

/// Stages of systems that switch by themselves are simulated, also those of alternatives: from the first preparation on nothing is allocated. Only
/// where rates leave the modes in doubt is a problem made of that (6.19).
#[test]
fn preparations_with_friction_allocate_nothing() {
    for case in [stick_slip::two_masses(1.0), stick_slip::cart_pole(3.0)] {
        for (scheme, inner) in [(Scheme::Rti, 0), (Scheme::AsRti, 1)] {
            let done = case.run(&stick_slip::options(scheme, inner), &stick_slip::Disturbance::default());
            assert!(done.alternatives.contains(&4));
            let doubts = done.allocations.iter().filter(|a| **a > 0).count();
            assert!(doubts <= 1, "{scheme:?}: {:?}", done.allocations);
        }
    }
}

/// Where controls choose only preparations allocate: sequences are compared there.
#[test]
fn feedbacks_that_choose_allocate_nothing() {
    let g = Graph::new();
    let dims = Dims { x: 2, u: 2, p: 0 };
    let [a, w, on, push] = [g.x(0), g.x(1), g.u(0), g.u(1)];
    let f: SharedFunction = Arc::new(g.function("f", dims, &[w, on + push - a]).unwrap());
    let all: SharedFunction = Arc::new(g.function("all", dims, &[a - 0.5, w, push]).unwrap());
    let mut system = System::new(2, 2, 0).unwrap();
    system.set_f0(f).unwrap();
    system.add_choice(0, &[0.0, 1.0], 0.2).unwrap();
    let mut ocp = Ocp::new(&system, 0.6, 6, &Settings::default()).unwrap();
    ocp.add_least_squares(all, &[1.0, 0.1, 0.01], &[0.0; 3], CostAt::Running).unwrap();
    ocp.set_u_bounds(&[0.0, -0.3], &[1.0, 0.3]).unwrap();
    let mut c = Nmpc::new(&ocp, &Options { shift: true, ..Options::default() }).unwrap();
    let mut u = [0.0; 2];
    c.initialise(&[0.0, 0.0], 50).unwrap();
    for x in [[0.0, 0.0], [0.1, 0.3], [0.8, -0.3], [0.5, 0.0]] {
        c.prepare(None).unwrap();
        let before = count();
        c.feedback(&x, &mut u).unwrap();
        assert_eq!(count(), before);
        assert!(u[0] == 0.0 || u[0] == 1.0, "{u:?}");
    }
}
