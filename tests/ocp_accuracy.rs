//! Accuracy of answers for systems that the event-driven engine does not know.

mod common;
use common::models::*;
use std::sync::Arc;
use switchback::event;
use switchback::expr::Graph;
use switchback::func::Dims;
use switchback::mpcc::Polish;
use switchback::nlp::{Control, Outcome};
use switchback::ocp::{Ocp, OcpResult};
use switchback::settings::Settings;
use switchback::system::{Inclusion, Regions, SetValued, Subsystem, System};

const D: Dims = Dims { x: 2, u: 1, p: 0 };

/// `q' = v`, `v' = u − 0.3 sign v`: the friction as a mode each, or as an inclusion in the step of `v`.
fn friction(inclusion: bool) -> System {
    let g = Graph::new();
    let (v, u) = (g.x(1), g.u(0));
    let mut s = System::new(2, 1, 0).unwrap();
    s.set_f0(Arc::new(g.function("f0", D, &[v, u]).unwrap())).unwrap();
    let psi = affine("v", D, &[0.0], &[(0, 1, 1.0)]);
    if inclusion {
        let step = g.x(2);
        let f = Arc::new(g.function("friction", Dims { x: 3, ..D }, &[0.3 - 0.6 * step]).unwrap());
        s.add_inclusion(Inclusion { rows: vec![1], f, psi, set: SetValued::Step }).unwrap();
    } else {
        let modes = affine("friction", D, &[-0.3, 0.3], &[]);
        let regions = Regions::Signs { psi, signs: vec![1, -1] };
        s.add_subsystem(Subsystem { rows: vec![1], modes, n_modes: 2, regions }).unwrap();
    }
    s
}

fn rest_to_rest(system: &System, linear: bool) -> OcpResult {
    let g = Graph::new();
    let mut o = Ocp::new(system, 4.0, 4, &Settings { n_s: 3, ..Settings::default() }).unwrap();
    o.set_x0(&[0.0; 2]).unwrap();
    o.set_linear_controls(&[linear]).unwrap();
    o.set_lagrange(Arc::new(g.function("effort", D, &[g.u(0) * g.u(0)]).unwrap())).unwrap();
    o.add_terminal(affine("x", D, &[0.0; 2], &[(0, 0, 1.0), (1, 1, 1.0)]), &[1.0, 0.0], &[1.0, 0.0]).unwrap();
    let r = o.solve(&mut Control::default()).unwrap().clone();
    assert_eq!((r.outcome, r.polish), (Outcome::Solved, Polish::Done));
    r
}

#[test]
fn inclusions_are_simulated_by_finite_elements() {
    for linear in [false, true] {
        let (modes, steps) = (rest_to_rest(&friction(false), linear), rest_to_rest(&friction(true), linear));
        let (a, b) = (modes.accuracy.unwrap(), steps.accuracy.unwrap());
        assert!((modes.cost - steps.cost).abs() < 1e-8, "{} {}", modes.cost, steps.cost);
        for (k, a) in [&a, &b].into_iter().enumerate() {
            assert_eq!(a.outcome, Some(event::Outcome::Reached), "{}", a.reason);
            assert!(a.terminal < 1e-9 && a.stages.iter().all(|e| *e < 1e-9), "{k}: {a:?}");
            assert!(a.cost_error.abs() < 1e-9 && a.terminal_violation < 1e-9, "{k}: {a:?}");
        }
        assert!((a.cost - b.cost).abs() < 1e-9);
    }
}

/// `q' = z`, `0 = z + q − u`: with the algebraic state behind, the cost in front of it.
#[test]
fn algebraic_equations_too() {
    let g = Graph::new();
    let (q, z, u) = (g.x(0), g.x(1), g.u(0));
    let mut s = System::new(2, 1, 0).unwrap();
    s.set_f0(Arc::new(g.function("f0", D, &[z, z + q - u]).unwrap())).unwrap();
    s.set_algebraic(1, None).unwrap();
    let mut o = Ocp::new(&s, 1.0, 2, &Settings { n_s: 3, ..Settings::default() }).unwrap();
    o.set_x0_bounds(&[1.0, -10.0], &[1.0, 10.0]).unwrap();
    o.set_lagrange(Arc::new(g.function("effort", D, &[u * u]).unwrap())).unwrap();
    o.add_terminal(affine("q", D, &[0.0], &[(0, 0, 1.0)]), &[0.0], &[0.0]).unwrap();
    let r = o.solve(&mut Control::default()).unwrap();
    assert_eq!(r.outcome, Outcome::Solved);
    let a = r.accuracy.as_ref().unwrap();
    // q(1) = e⁻¹ + a u₁ + b u₂ = 0 with b = 1 − e^(−½) and a = b e^(−½): the cost is that of the smallest u
    let b = 1.0 - (-0.5f64).exp();
    let a2 = b * b * (1.0 + (-1f64).exp());
    let least = 0.5 * (-2f64).exp() / a2;
    assert!((r.cost - least).abs() < 1e-6, "{} {least}", r.cost);
    assert!(a.terminal < 1e-5 && a.cost_error.abs() < 1e-9 && a.reached(), "{a:?}");
}
