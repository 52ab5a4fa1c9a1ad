//! Every Runge-Kutta family through sliding modes of codimension one and two: the optimal control problem (7.51), and the
//! simulation of a sliding mode on a curved surface.

mod common;
use common::*;
use switchback::mpcc::Polish;
use switchback::nlp::{Control, Outcome};
use switchback::settings::RkFamily::{LobattoIiia, LobattoIiib, LobattoIiic, RadauIa};
use switchback::settings::{DcsForm, RkFamily, Settings};

/// Exact, and as accurate as the method allows on this grid: the error at the terminal point when the controls are
/// simulated by the event-driven engine.
fn check(family: RkFamily, n_s: i64, n_fe: i64, form: DcsForm, error: f64) {
    let set = Settings { dcs_form: form as i64, ..from_all_starts(settings(family, n_s, n_fe, FESD)) };
    let mut ocp = models::sliding_ocp(&set);
    let r = ocp.solve(&mut Control::default()).unwrap();
    let what = format!("{family:?} {n_s}, {n_fe} elements, {form:?}");
    assert_eq!((r.outcome, r.polish), (Outcome::Solved, Polish::Done), "{what}");
    let found = r.accuracy.as_ref().unwrap().terminal_violation;
    assert!(found <= error, "{what}: off by {found:e}, expected {error:e}");
    assert!((9.0..9.7).contains(&r.cost), "{what}: cost {}", r.cost);
}

#[test]
fn methods_with_equations_too_many_in_a_sliding_mode() {
    check(GaussLegendre, 2, 3, DcsForm::Stewart, 2e-3);
    check(GaussLegendre, 4, 3, DcsForm::Heaviside, 1e-6);
    check(RadauIa, 2, 4, DcsForm::Stewart, 5e-4);
    check(RadauIa, 4, 4, DcsForm::Stewart, 3e-5);
}

#[test]
fn methods_whose_first_stage_is_the_start() {
    check(LobattoIiia, 2, 3, DcsForm::Stewart, 2e-2);
    check(LobattoIiia, 3, 4, DcsForm::Stewart, 1e-8);
    check(LobattoIiia, 4, 3, DcsForm::Heaviside, 1e-9);
}

#[test]
fn methods_with_a_first_stage_beside_the_start() {
    check(LobattoIiib, 2, 3, DcsForm::Stewart, 2e-2);
    check(LobattoIiib, 4, 4, DcsForm::Heaviside, 1e-9);
    check(LobattoIiic, 2, 3, DcsForm::Stewart, 1e-2);
    check(LobattoIiic, 4, 3, DcsForm::Stewart, 1e-9);
}

#[test]
fn half_explicit_methods() {
    check(Explicit, 2, 3, DcsForm::Stewart, 2e-2);
    check(Explicit, 3, 3, DcsForm::Stewart, 1e-3);
    // with three elements a stage has no more of them than phases, and rounding decides whether an exact answer is found
    check(Explicit, 4, 4, DcsForm::Heaviside, 1e-4);
}
