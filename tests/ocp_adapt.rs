//! Grids of optimal control problems that follow the error.

mod common;
use std::time::{Duration, Instant};

use common::models::*;
use common::*;
use switchback::fesd::Durations;
use switchback::mpcc::Polish;
use switchback::nlp::{Control, IterationInfo, Outcome};
use switchback::ocp::{Ocp, OcpResult};
use switchback::settings::{DcsForm, RkFamily, Settings};

fn solve(o: &mut Ocp) -> OcpResult {
    let r = o.solve(&mut Control::default()).unwrap().clone();
    assert_eq!((r.outcome, r.polish), (Outcome::Solved, Polish::Done), "{}", r.message);
    r
}

#[test]
fn the_error_asked_for_is_reached() {
    for adapt_tol in [1e-6, 1e-8] {
        let set = Settings { adapt_tol, ..from_all_starts(settings(RadauIia, 2, 2, FESD)) };
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
    let set = Settings { adapt_tol: 1e-4, ..from_all_starts(settings(RadauIia, 3, 6, FESD)) };
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
    let found = o.sensitivity();
    assert!(found.is_ok(), "{found:?}");
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

/// Solves inside of the solves of the rounds, as methods need them whose relaxed problems are not well posed, do not adapt.
#[test]
fn every_method_adapts_in_stewarts_form_or_says_why_not() {
    let reached = adapt_with_every_method(DcsForm::Stewart);
    assert!(reached >= 8, "{reached} of 21 reach the error");
}

#[test]
fn every_method_adapts_in_the_heaviside_form_or_says_why_not() {
    let reached = adapt_with_every_method(DcsForm::Heaviside);
    assert!(reached >= 8, "{reached} of 21 reach the error");
}

/// How many methods reach the error?
fn adapt_with_every_method(form: DcsForm) -> usize {
    let mut reached = 0;
    for family in 0..RkFamily::NAMES.len() as i64 {
        for n_s in 1..=3 {
            let set = Settings {
                rk_family: family,
                n_s,
                n_fe: 2,
                dcs_form: form as i64,
                adapt_tol: 1e-5,
                adapt_rounds: 3,
                max_iter: 600,
                ..Settings::default()
            };
            let what = format!("{} {n_s} {}", RkFamily::NAMES[family as usize], form.name());
            let mut o = tutorial(&set);
            let r = match o.solve(&mut Control::default()) {
                Ok(r) => r.clone(),
                Err(e) => {
                    assert!(e.code() != -99 && e.to_string().len() > 20, "{what}: {e}");
                    continue;
                }
            };
            let a = r.adaptation.as_ref().unwrap();
            assert!(r.outcome == Outcome::Solved || !r.message.is_empty(), "{what}: {:?} unsaid", r.outcome);
            assert_eq!(r.error().to_bits(), a.rounds[a.kept].error.to_bits(), "{what}: {a:?}");
            reached += usize::from(a.reached);
            // the object goes on: the same again, and without adaptation
            let again = o.solve(&mut Control::default()).unwrap();
            // as text: a round without a solution has the cost NaN
            let all = |r: &OcpResult| format!("{:?} {:?}", r.cost, r.adaptation);
            assert_eq!(all(again), all(&r), "{what}");
            o.set_settings(&Settings { adapt_tol: 0.0, ..set }).unwrap();
            assert!(o.solve(&mut Control::default()).unwrap().adaptation.is_none(), "{what}");
        }
    }
    reached
}

/// A relay against a drift: a switch, a sliding mode, and a cost that the drift has a hand in.
fn tutorial(set: &Settings) -> Ocp {
    let sys = switching('b');
    let mut o = Ocp::new(&sys, 2.0, 2, set).unwrap();
    let l = smooth(
        "L",
        sys.dims(),
        1,
        |at, o| o[0] = at.x[0] * at.x[0],
        &[(0, 0)],
        |at, o| o[0] = 2.0 * at.x[0],
        &[(0, 0)],
        |_, w, o| o[0] = 2.0 * w[0],
    );
    o.set_lagrange(l).unwrap();
    o.set_x0(&[-0.5]).unwrap();
    o
}

/// Where a limit ends a later round, the answer is the best of the rounds that ended, to the bit.
#[test]
fn a_round_that_is_cut_short_does_not_replace_the_answer() {
    let set = Settings { adapt_tol: 1e-6, ..settings(RadauIia, 1, 4, FESD) };
    let mut o = sliding_ocp(&set);
    let whole = solve(&mut o);
    let rounds = &whole.adaptation.as_ref().unwrap().rounds;
    assert!(rounds.len() > 2, "{rounds:?}");
    let first = rounds[0].iterations + 3;
    // stopped in the second round
    let mut seen = 0;
    let mut monitor = |_: &IterationInfo| {
        seen += 1;
        seen < first + 10
    };
    let r = o.solve(&mut Control { monitor: Some(&mut monitor), ..Control::default() }).unwrap().clone();
    let a = r.adaptation.as_ref().unwrap();
    assert_eq!(r.outcome, Outcome::Stopped);
    assert!(a.rounds.len() <= 2 && a.kept == 0 && !a.reached, "{a:?}");
    assert_eq!((r.cost.to_bits(), r.error().to_bits()), (rounds[0].cost.to_bits(), rounds[0].error.to_bits()));
    assert!(r.message.contains("the answer is that of round 0"), "{}", r.message);
    // out of time there: the second round waits for the end of its time
    let (clock, limit) = (Instant::now(), Duration::from_secs(8));
    o.set_settings(&Settings { max_time: limit.as_secs_f64(), ..set }).unwrap();
    let mut seen = 0;
    let mut monitor = |_: &IterationInfo| {
        seen += 1;
        if seen == first + 10 {
            std::thread::sleep(limit.saturating_sub(clock.elapsed()) + Duration::from_millis(5));
        }
        true
    };
    let r = o.solve(&mut Control { monitor: Some(&mut monitor), ..Control::default() }).unwrap().clone();
    let a = r.adaptation.as_ref().unwrap();
    assert_eq!((r.outcome, r.polish, a.kept), (Outcome::MaxTime, Polish::Done, 0), "{a:?}");
    assert_eq!((r.cost.to_bits(), r.error().to_bits()), (rounds[0].cost.to_bits(), rounds[0].error.to_bits()));
    assert!(r.message.contains("max_time"), "{}", r.message);
    // and the object is none the worse for it
    o.set_settings(&set).unwrap();
    assert_eq!(solve(&mut o).cost.to_bits(), whole.cost.to_bits());
}
