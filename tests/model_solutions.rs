//! Models written with operators beside hand-written ones: equal trajectories, equal solutions.

use std::sync::Arc;

use switchback::expr::{Expr, Graph};
use switchback::func::Dims;
use switchback::model::{Built, Model};
use switchback::nlp::{Bounds, CallbackNlp, Control, Ipm, IpmSettings, Monotone, Outcome, Start};
use switchback::ocp::Ocp;
use switchback::settings::{DcsForm, RkFamily, Settings};
use switchback::sim::{SimResult, Simulator};
use switchback::system::System;

#[path = "../examples/report/expression_models.rs"]
mod expression_models;
#[path = "../examples/report/models.rs"]
mod models;

#[path = "common/gallery.rs"]
mod gallery;

fn simulate(s: &System, x0: &[f64], t_end: f64, n: usize) -> (SimResult, Vec<f64>) {
    let set = Settings { rk_family: RkFamily::RadauIia as i64, n_s: 2, n_fe: 3, ..Settings::default() };
    let mut sim = Simulator::new(s, &set).unwrap();
    sim.set_state(0.0, x0).unwrap();
    sim.set_controls(&vec![1.0; s.dims().u]).unwrap();
    let r = sim.run(t_end, n, &mut Control::default()).unwrap();
    (r, sim.state().to_vec())
}

/// Name, both models, initial state, end, steps.
type Case = (&'static str, System, Built, Vec<f64>, f64, usize);

#[test]
fn trajectories_are_those_of_the_hand_written_models() {
    let twice = |name, (by_hand, written): (System, Built), x0: &[f64], t_end, n| {
        (name, by_hand, written, x0.to_vec(), t_end, n)
    };
    let cases: Vec<Case> = vec![
        twice("turbo car", gallery::turbo_car(), &[0.0, 0.0], 14.0, 30),
        twice("two genes", gallery::two_genes(), &[5.0, 5.0], 1.0, 30),
        twice("relay feedback", gallery::relay_feedback(), &[0.0, 0.0, 0.2], 12.0, 40),
        twice("tank cascade", gallery::tank_cascade(), &[0.4, 0.9, 0.5], 8.0, 40),
        twice("motor", gallery::motor(), &[0.0, 0.0, 0.0], 4.0, 60),
        ("oscillator", models::oscillator(), expression_models::oscillator(), models::OSCILLATOR_X0.to_vec(), 1.5, 15),
        ("a", models::switching('a'), expression_models::switching('a'), vec![-1.0], 2.0, 7),
        ("b", models::switching('b'), expression_models::switching('b'), vec![-0.5], 2.0, 10),
        ("c", models::switching('c'), expression_models::switching('c'), vec![-0.5], 2.0, 10),
        ("sliding mode", models::sliding_mode(), expression_models::sliding_mode(), vec![1.0, 0.4, 0.0, 0.0], 1.0, 10),
        ("blocks", models::blocks(), expression_models::blocks(), vec![-1.0, 1.0, -1.0, 1.0, 1.0, 0.5], 3.0, 20),
        ("coulomb", models::coulomb(), expression_models::coulomb(), vec![1.0, 0.0], 4.0, 20),
        ("stick-slip", models::stick_slip(), expression_models::stick_slip(), vec![0.5, 0.0], 4.0, 20),
    ];
    for (name, by_hand, written, x0, t_end, n) in cases {
        let ((a, xa), (b, xb)) = (simulate(&by_hand, &x0, t_end, n), simulate(&written.system, &x0, t_end, n));
        assert_eq!((a.outcome, b.outcome), (Outcome::Solved, Outcome::Solved), "{name}");
        let distance = xa.iter().zip(&xb).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(distance < 1e-10, "{name}: {xa:?} {xb:?}");
        assert_eq!(a.trajectory.switches.len(), b.trajectory.switches.len(), "{name}");
        for (s, r) in a.trajectory.switches.iter().zip(&b.trajectory.switches) {
            assert!((s.t - r.t).abs() < 1e-9, "{name}: switch at {} and {}", s.t, r.t);
        }
    }
}

/// Stewart's form and the Heaviside form are the same system.
#[test]
fn both_forms_of_a_model_have_one_trajectory() {
    let cases = [
        ("two genes", gallery::two_genes().1, vec![5.0, 5.0], 1.0, 30),
        ("motor", gallery::motor().1, vec![0.0; 3], 4.0, 60),
        ("sliding mode", expression_models::sliding_mode(), vec![1.0, 0.4, 0.0, 0.0], 1.0, 10),
    ];
    for (name, b, x0, t_end, n) in cases {
        let ends = [DcsForm::Stewart, DcsForm::Heaviside].map(|form| {
            // steps may be divided differently, so the error of the method must be below what is compared
            let set = Settings { n_s: 4, n_fe: 3, dcs_form: form as i64, ..Settings::default() };
            let mut sim = Simulator::new(&b.system, &set).unwrap();
            sim.set_state(0.0, &x0).unwrap();
            sim.set_controls(&vec![0.5; b.system.dims().u]).unwrap();
            let r = sim.run(t_end, n, &mut Control::default()).unwrap();
            assert_eq!(r.outcome, Outcome::Solved, "{name}");
            sim.state().to_vec()
        });
        let distance = ends[0].iter().zip(&ends[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(distance < 1e-9, "{name}: {ends:?}");
    }
}

#[test]
fn optimal_control_is_that_of_the_hand_written_model() {
    // with fewer elements there are several optima close together, and rounding chooses
    let set = Settings { n_fe: 4, n_s: 3, ..Settings::default() };
    let mut by_hand = models::sliding_ocp(&set);
    let built = expression_models::sliding_mode();
    let mut written = Ocp::new(&built.system, 4.0, 6, &set).unwrap();
    written.set_lagrange(expression_models::sliding_cost()).unwrap();
    written.set_x0(&models::SLIDING_X0).unwrap();
    let inf = f64::INFINITY;
    written.set_x_bounds(&[-inf, -inf, -2.0, -2.0], &[inf, inf, 2.0, 2.0]).unwrap();
    written.set_u_bounds(&[-10.0; 2], &[10.0; 2]).unwrap();
    let g = Graph::new();
    let end = g.function("e", built.system.dims(), &[g.x(0), g.x(1)]).unwrap();
    written.add_terminal(Arc::new(end), &models::SLIDING_QT, &models::SLIDING_QT).unwrap();
    let (a, b) = (by_hand.solve(&mut Control::default()).unwrap(), written.solve(&mut Control::default()).unwrap());
    assert_eq!((a.outcome, b.outcome), (Outcome::Solved, Outcome::Solved));
    assert!((a.cost - b.cost).abs() < 1e-10 * a.cost, "{} {}", a.cost, b.cost);
    // Rounding may lead through other iterates, to the same point.
    assert_eq!(a.controls.len(), b.controls.len());
    for (u, v) in a.controls.iter().zip(&b.controls) {
        assert!((u - v).abs() < 1e-8, "{u} {v}");
    }
}

#[test]
fn a_smooth_model_runs_as_plain_collocation() {
    let g = Graph::new();
    let (x, v) = (g.x(0), g.x(1));
    let b = Model::from_rhs("oscillator", 0, 0, &[v, -x]).unwrap().build(&g).unwrap();
    assert_eq!(b.report.n_pairs(), 0);
    let (r, end) = simulate(&b.system, &[1.0, 0.0], 1.0, 20);
    assert_eq!(r.outcome, Outcome::Solved);
    assert!((end[0] - 1f64.cos()).abs() < 1e-6, "{end:?}");
}

/// Problem 71 of Hock and Schittkowski.
#[test]
fn a_nonlinear_program_made_of_expressions() {
    let g = Graph::new();
    let x: Vec<Expr> = (0..4).map(|i| g.x(i)).collect();
    let d = Dims { x: 4, u: 0, p: 0 };
    let f = g.function("f", d, &[x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2]]).unwrap();
    let squares: Expr = x.iter().map(|x| x.powi(2)).sum();
    let c = g.function("c", d, &[x[0] * x[1] * x[2] * x[3], squares]).unwrap();
    let mut p = CallbackNlp::new(4, 0, Arc::new(f), Some(Arc::new(c))).unwrap();
    let b = Bounds { xl: vec![1.0; 4], xu: vec![5.0; 4], cl: vec![25.0, 40.0], cu: vec![f64::INFINITY, 40.0] };
    let mut ipm = Ipm::new(&p, IpmSettings::default()).unwrap();
    let mut rule = Monotone { mu_init: 0.1, tol: 1e-10, primal_tol: 1e-10 };
    let start = Start::Cold(&[1.0, 5.0, 5.0, 1.0]);
    assert_eq!(ipm.solve(&mut p, &b, start, &mut rule, &mut Control::default()), Outcome::Solved);
    let exact = [1.0, 4.742999643, 3.821149979, 1.379408294];
    for (a, e) in ipm.iterate().x.iter().zip(exact) {
        assert!((a - e).abs() < 1e-7, "{a} {e}");
    }
    assert!((ipm.objective() - 17.0140172891).abs() < 1e-7);
}
