//! Grids of optimal control problems that follow the error.

mod common;
use common::models::*;
use common::*;
use switchback::fesd::Durations;
use switchback::mpcc::Polish;
use switchback::nlp::{Control, Outcome};
use switchback::ocp::{Ocp, OcpResult};
use switchback::settings::Settings;

fn solve(o: &mut Ocp) -> OcpResult {
    let r = o.solve(&mut Control::default()).unwrap().clone();
    assert_eq!((r.outcome, r.polish), (Outcome::Solved, Polish::Done), "{}", r.message);
    r
}

#[test]
fn the_error_asked_for_is_reached() {
    for adapt_tol in [1e-5, 1e-8] {
        let set = Settings { adapt_tol, ..settings(RadauIia, 2, 2, FESD) };
        let mut o = sliding_ocp(&set);
        let r = solve(&mut o);
        let a = r.adaptation.as_ref().unwrap();
        let what = format!("{adapt_tol:e}: {a:?}");
        assert!(a.reached && r.error() <= adapt_tol, "{what}");
        assert!(a.rounds.len() > 1 && a.kept == a.rounds.len() - 1, "{what}");
        assert!(r.accuracy.as_ref().unwrap().terminal_violation <= adapt_tol, "{what}");
        assert!((r.cost - 9.149_601_87).abs() < 1e-3, "{what}: {}", r.cost);
        // the settings are those of the user again, and the grid stays
        assert_eq!(o.settings(), &set);
    }
}

/// The first and the last stages of (7.51) have no switches: they lose what they do not need.
#[test]
fn idle_elements_are_taken_away() {
    let set = Settings { adapt_tol: 1e-4, ..settings(RadauIia, 3, 6, FESD) };
    let mut o = sliding_ocp(&set);
    o.set_elements(&[6, 3, 3, 3, 3, 6]).unwrap();
    let r = solve(&mut o);
    let a = r.adaptation.as_ref().unwrap();
    let n = |k: usize| a.rounds[k].elements.iter().sum::<usize>();
    assert!(a.reached && r.error() <= 1e-4, "{a:?}");
    assert!(a.kept > 0 && 2 * n(a.kept) <= n(0), "{a:?}");
    assert!(r.dimensions.0 < a.rounds[0].n_variables, "{a:?}");
    // the optimum is the same, and what was carried over is solved in a few iterations
    assert!((r.cost - a.rounds[0].cost).abs() < 1e-4, "{a:?}");
    assert!(3 * a.rounds[1].iterations < a.rounds[0].iterations, "{a:?}");
    // warm starts are those of the grid that was kept
    assert!(o.sensitivity().is_ok());
}

#[test]
fn the_budget_is_kept() {
    let set = Settings { adapt_tol: 1e-12, adapt_rounds: 2, ..settings(RadauIia, 1, 2, FESD) };
    let r = sliding_ocp(&set).solve(&mut Control::default()).unwrap().clone();
    let a = r.adaptation.as_ref().unwrap();
    assert!(!a.reached && a.rounds.len() == 3, "{a:?}");
    assert_eq!(r.error(), a.rounds[a.kept].error);
    let r = sliding_ocp(&Settings { adapt_elements: 12, ..set }).solve(&mut Control::default()).unwrap().clone();
    assert_eq!(r.adaptation.unwrap().rounds.len(), 1);
    assert!(sliding_ocp(&Settings { adapt_tol: 0.0, ..set })
        .solve(&mut Control::default())
        .unwrap()
        .adaptation
        .is_none());
}

#[test]
fn lengths_may_be_free() {
    let set = Settings { adapt_tol: 1e-8, ..settings(RadauIia, 2, 2, FESD) };
    let mut o = sliding_ocp(&set);
    o.set_free_time(Durations::Horizon, 3.0, 5.0).unwrap();
    let r = solve(&mut o);
    let a = r.adaptation.as_ref().unwrap();
    assert!(a.reached && r.error() <= 1e-8, "{a:?}");
}
