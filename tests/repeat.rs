//! What a solve leaves behind is no part of the input of the next one: a cold solve gives the same bits again, from the
//! same object, after solves that failed, were interrupted or warm, from another object, and on another thread.

#[path = "../examples/report/models.rs"]
mod models;
#[path = "common/optimal/mod.rs"]
mod optimal;
#[path = "../crates/switchback-mpcc/tests/common/textbook/mod.rs"]
mod textbook;

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::Arc;
use switchback::func::{Callback, Dims};
use switchback::mpcc::{MpccSettings, MpccSolver, Polish, Solution};
use switchback::nlp::{Control, IterationInfo, Outcome, Statistics};
use switchback::ocp::{Ocp, OcpResult};
use switchback::settings::{DcsForm, OcpStart, Relaxation, RkFamily, Settings};
use switchback::sim::{SimResult, Simulator};
use switchback::system::System;

fn bits(v: &[f64]) -> Vec<u64> {
    v.iter().map(|v| v.to_bits()).collect()
}

fn work(s: &Statistics) -> [usize; 5] {
    [s.iterations, s.factorisations, s.evaluations, s.restoration_iterations, s.polish_iterations]
}

/// Everything of an answer that is not a time.
fn fingerprint(r: &OcpResult) -> (String, Vec<u64>, [usize; 5], String) {
    let mut v = vec![r.cost, r.violation, r.residuals.primal, r.residuals.dual, r.residuals.pair_min];
    v.extend(r.controls.iter().chain(&r.control_ends).chain(&r.durations).chain(&r.params));
    for e in &r.trajectory.elements {
        v.extend([e.t, e.h].iter().chain(&e.xs).chain(&e.theta).chain(&e.lambda).chain(&e.mu));
    }
    if let Some(a) = &r.accuracy {
        v.extend(a.stages.iter().chain(&a.local).chain(&[a.cost, a.cost_error, a.terminal_violation]));
    }
    let what = format!("{:?} {:?} {:?} {:?}", r.outcome, r.polish, r.certificate, r.adaptation);
    (what, bits(&v), work(&r.stats), r.message.clone())
}

fn solve(o: &mut Ocp) -> OcpResult {
    o.solve(&mut Control::default()).unwrap().clone()
}

fn assert_same(first: &OcpResult, other: &OcpResult, what: &str) {
    let (a, b) = (fingerprint(first), fingerprint(other));
    assert_eq!((a.0, a.2, a.3), (b.0, b.2, b.3), "{what}");
    assert!(a.1 == b.1, "{what}: other bits, cost {} and {}", first.cost, other.cost);
}

/// Stops a solve after some iterations.
fn stop_after(o: &mut Ocp, n: usize) -> Outcome {
    let mut left = n;
    let mut monitor = |_: &IterationInfo| {
        left = left.saturating_sub(1);
        left > 0
    };
    o.solve(&mut Control { monitor: Some(&mut monitor), ..Control::default() }).unwrap().outcome
}

/// All that may come between two cold solves.
fn check(name: &str, mut o: Ocp, small: bool) {
    let mut twin = o.blank();
    let first = solve(&mut o);
    assert_same(&first, &solve(&mut o), &format!("{name}: a second time"));
    o.solve_warm(&mut Control::default()).unwrap();
    assert_same(&first, &solve(&mut o), &format!("{name}: after a warm solve"));
    assert_eq!(stop_after(&mut o, 25), Outcome::Stopped, "{name}");
    assert_same(&first, &solve(&mut o), &format!("{name}: after an interrupted one"));
    // other starts build problems of their own
    let alone = o.settings().ocp_start == OcpStart::Homotopy as i64;
    assert!(o.builds() == 1 || !alone, "{name}: built once");
    let other = std::thread::spawn(move || (solve(&mut twin), twin));
    let (found, mut twin) = other.join().unwrap();
    assert_same(&first, &found, &format!("{name}: another object on another thread"));
    if small {
        assert_same(&first, &solve(&mut twin), &format!("{name}: moved between threads"));
    }
}

#[test]
fn optimal_control_problems_of_the_gallery() {
    problems_of_the_gallery(0);
}

#[test]
fn the_other_optimal_control_problems_of_the_gallery() {
    problems_of_the_gallery(1);
}

/// Every second problem from this one on: two tests run beside each other.
fn problems_of_the_gallery(first: usize) {
    for p in optimal::all().skip(first).step_by(2) {
        let mut settings = *p.ocp.settings();
        // one form as the problem has it, the other one too where that is quick
        let small = ["turbo-car", "tanks", "friction"].contains(&p.name);
        // the portfolio too, where that is quick
        let mut alone = p.ocp.blank();
        alone.set_settings(&Settings { ocp_start: OcpStart::Homotopy as i64, ..settings }).unwrap();
        check(p.name, alone, small);
        if small {
            for form in [DcsForm::Stewart, DcsForm::Heaviside] {
                settings.dcs_form = form as i64;
                let mut o = p.ocp.blank();
                o.set_settings(&settings).unwrap();
                check(&format!("{} {}", p.name, form.name()), o, small);
            }
        }
    }
}

#[test]
fn other_methods_and_adapted_grids() {
    let base = Settings { n_s: 2, n_fe: 2, ocp_start: OcpStart::Homotopy as i64, ..Settings::default() };
    for set in [
        Settings { rk_family: RkFamily::GaussLegendre as i64, ..base },
        Settings { rk_family: RkFamily::LobattoIiic as i64, adapt_tol: 1e-6, ..base },
        Settings { adapt_tol: 1e-5, ..base },
        Settings { mode_search: 5, initial_guess: 3, ..base },
        Settings { relaxation: Relaxation::TwoSided as i64, ..base },
    ] {
        let mut o = models::sliding_ocp(&set);
        let first = solve(&mut o);
        assert_same(&first, &solve(&mut o), &format!("{set:?}"));
        o.solve_warm(&mut Control::default()).unwrap();
        assert_same(&first, &solve(&mut o), &format!("{set:?}: after a warm solve"));
    }
}

/// The point, the multipliers and the work of a program.
fn program(s: &Solution) -> (Vec<u64>, [usize; 5], String) {
    let mut v = vec![s.objective];
    v.extend(s.x.iter().chain(&s.y).chain(&s.z));
    (bits(&v), work(&s.stats), format!("{:?} {:?} {:?} {:?}", s.outcome, s.polish, s.sides, s.certificate))
}

#[test]
fn programs_with_complementarity_constraints() {
    let strategies = [Relaxation::Scholtes, Relaxation::TwoSided, Relaxation::L1Penalty, Relaxation::KanzowSchwartz];
    for (k, p) in textbook::all().iter().enumerate() {
        let relaxation = if k % 3 == 0 { strategies[k / 3 % strategies.len()] } else { Relaxation::Scholtes };
        let settings = MpccSettings { relaxation, max_iter: 400, ..MpccSettings::default() };
        let (mut lifted, bounds) = p.lifted();
        let w0 = lifted.start(&p.starts[0]);
        let mut solver = MpccSolver::new(&mut lifted, settings).unwrap();
        let mut solve = |control: &mut Control| program(solver.solve(&mut lifted, &bounds, &w0, control));
        let first = solve(&mut Control::default());
        assert_eq!(first, solve(&mut Control::default()), "{}", p.name);
        let mut left = 7;
        let mut monitor = |_: &IterationInfo| {
            left -= 1;
            left > 0
        };
        solve(&mut Control { monitor: Some(&mut monitor), ..Control::default() });
        assert_eq!(first, solve(&mut Control::default()), "{} after an interrupted solve", p.name);
        let (mut lifted, bounds) = p.lifted();
        let mut solver = MpccSolver::new(&mut lifted, settings).unwrap();
        let other = program(solver.solve(&mut lifted, &bounds, &w0, &mut Control::default()));
        assert_eq!(first, other, "{}: another object", p.name);
    }
}

fn simulation(r: &SimResult) -> (Vec<u64>, [usize; 5], usize) {
    let all = r.trajectory.elements.iter();
    let v: Vec<f64> = all.flat_map(|e| [e.t, e.h].into_iter().chain(e.xs.iter().chain(&e.lambda).copied())).collect();
    (bits(&v), work(&r.stats), r.homotopies)
}

#[test]
fn simulations() {
    for (sys, x0, t_end, n) in [
        (models::blocks(), vec![-1.0, 1.0, -1.0, -1.0, 1.0, 1.0], 12.0, 40),
        (models::coulomb(), vec![1.0, 0.2], 20.0, 40),
        (models::switching('c'), vec![-0.5], 2.0, 3),
    ] {
        for form in [DcsForm::Stewart, DcsForm::Heaviside] {
            for (family, polish) in [(RkFamily::RadauIia, 1), (RkFamily::GaussLegendre, 1), (RkFamily::RadauIia, 0)] {
                let set =
                    Settings { rk_family: family as i64, n_s: 2, dcs_form: form as i64, polish, ..Settings::default() };
                let mut s = Simulator::new(&sys, &set).unwrap();
                let mut run = |control: &mut Control| {
                    s.set_state(0.0, &x0).unwrap();
                    simulation(&s.run(t_end, n, control).unwrap())
                };
                let first = run(&mut Control::default());
                assert_eq!(first, run(&mut Control::default()), "{set:?}");
                let mut left = 30;
                let mut monitor = |_: &IterationInfo| {
                    left -= 1;
                    left > 0
                };
                run(&mut Control { monitor: Some(&mut monitor), ..Control::default() });
                assert_eq!(first, run(&mut Control::default()), "{set:?} after an interrupted run");
            }
        }
    }
}

/// `x' = u - sign x` with a cost whose function fails at one call, as it is told.
fn fragile(fails_at: Arc<AtomicUsize>, family: RkFamily, adapt_tol: f64) -> Ocp {
    let d = Dims { x: 1, u: 1, p: 0 };
    let mut s = System::new(1, 1, 0).unwrap();
    s.set_f0(models::affine("f0", d, &[0.0], &[(0, 1, 2.0)])).unwrap();
    let psi = models::affine("psi", d, &[0.0], &[(0, 0, 1.0)]);
    models::add_sides(&mut s, &[0], models::affine("F", d, &[-1.0, 1.0], &[]), psi);
    let set = Settings {
        rk_family: family as i64,
        n_fe: 2,
        adapt_tol,
        ocp_start: OcpStart::Homotopy as i64,
        ..Settings::default()
    };
    let mut o = Ocp::new(&s, 1.0, 4, &set).unwrap();
    let cost = Callback::new("L", d, 1, move |at, o| {
        o[0] = (at.x[0] - 0.3).powi(2) + 0.1 * at.u[0] * at.u[0];
        // counts down to the call that fails
        let left = fails_at.load(Ordering::Relaxed);
        fails_at.store(left.saturating_sub(1), Ordering::Relaxed);
        if left == 1 {
            -7
        } else {
            0
        }
    });
    o.set_lagrange(Arc::new(cost)).unwrap();
    o.set_x0(&[-0.5]).unwrap();
    o.set_u_bounds(&[-2.0], &[2.0]).unwrap();
    o
}

#[test]
fn a_callback_that_fails_once_costs_one_solve_and_nothing_else() {
    for (family, adapt_tol) in [(RkFamily::RadauIia, 0.0)] {
        let fails_at = Arc::new(AtomicUsize::new(0));
        let mut o = fragile(fails_at.clone(), family, adapt_tol);
        let first = solve(&mut o);
        assert_eq!(first.outcome, Outcome::Solved, "{}", first.message);
        let warm = o.solve_warm(&mut Control::default()).unwrap().clone();
        let again = o.solve_warm(&mut Control::default()).unwrap().clone();
        // how many calls a solve takes
        fails_at.store(usize::MAX, Ordering::Relaxed);
        solve(&mut o);
        let calls = usize::MAX - fails_at.load(Ordering::Relaxed);
        let built = o.builds();
        let mut failures = 0;
        for k in (0..8).map(|k| 1 + k * calls / 8).chain([2, calls - 1, calls]) {
            let what = format!("{family:?}, adapt_tol {adapt_tol}: call {k} of {calls} fails");
            // the solves before are the same each time
            fails_at.store(0, Ordering::Relaxed);
            solve(&mut o);
            o.solve_warm(&mut Control::default()).unwrap();
            let before = o.builds();
            fails_at.store(k, Ordering::Relaxed);
            let failed = o.solve(&mut Control::default()).map(|r| (r.outcome, r.polish));
            let failed = !matches!(failed, Ok((Outcome::Solved, Polish::Done)));
            failures += usize::from(failed);
            fails_at.store(0, Ordering::Relaxed);
            if adapt_tol == 0.0 {
                // the call may be one of the simulation behind the solve, which is then done
                let r = o.solve_warm(&mut Control::default()).unwrap();
                assert_same(if failed { &again } else { &warm }, r, &format!("{what}, then warm"));
                assert_eq!(o.builds(), before, "{what}: nothing is built again");
            } else {
                let r = o.solve_warm(&mut Control::default()).unwrap();
                assert_eq!(r.outcome, Outcome::Solved, "{what}, then warm: {}", r.message);
                assert!((r.cost - warm.cost).abs() < 1e-3, "{what}: {} {}", r.cost, warm.cost);
            }
            assert_same(&first, &solve(&mut o), &what);
        }
        assert!(failures > 4, "{family:?}: {failures} solves failed");
        assert!(adapt_tol > 0.0 || (built, o.builds()) == (1, 1));
    }
}
