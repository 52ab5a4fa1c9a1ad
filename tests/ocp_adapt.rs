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
        eprintln!("{what}");
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
    let a = r.adaptation.unwrap();
    eprintln!("{a:?}");
}

#[test]
fn lengths_may_be_free() {
    let set = Settings { adapt_tol: 1e-8, ..settings(RadauIia, 2, 2, FESD) };
    let mut o = sliding_ocp(&set);
    o.set_free_time(Durations::Horizon, 3.0, 5.0).unwrap();
    let r = solve(&mut o);
    let a = r.adaptation.as_ref().unwrap();
    eprintln!("{a:?} {:?}", r.durations);
    assert!(a.reached && r.error() <= 1e-8, "{a:?}");
}
