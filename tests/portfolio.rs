//! Several strategies in one solve: where the first one fails others follow, and all of them together find the best.

#[path = "common/textbook/mod.rs"]
mod textbook;

use switchback::mpcc::{FoundBy, MpccSettings};
use switchback::nlp::Outcome;
use switchback::settings::{Portfolio, Relaxation};
use textbook::{all, Expect, Verdict, ACCURACY};

/// The equilibrium of Billups has no free variable and one solution, which the relaxations of Scholtes do not lead to; some
/// relaxations fail on a few programs more. Whatever one fails at, another one solves.
#[test]
fn where_a_strategy_fails_others_follow() {
    let mut rescued = Vec::new();
    for relaxation in [Relaxation::Scholtes, Relaxation::Kadrani, Relaxation::FischerBurmeister] {
        for p in all().iter().filter(|p| p.known.expect == Expect::Optimal && !p.members.is_empty()) {
            for start in &p.starts {
                let of = |portfolio| {
                    let settings = MpccSettings { relaxation, portfolio, ..MpccSettings::default() };
                    p.solve(settings, start)
                };
                let (alone, together) = (of(Portfolio::Off), of(Portfolio::Rescue));
                // the search for a point that violates nothing, which a claim needs, may solve it as well
                let path = alone.solution.outcome == Outcome::Solved && alone.solution.found_by == FoundBy::Path;
                let found_by = together.solution.found_by;
                assert_eq!(together.solution.outcome, Outcome::Solved, "{relaxation:?} {}", p.name);
                assert!(path || found_by != FoundBy::Path, "{relaxation:?} {}", p.name);
                assert!(together.solution.stats.iterations <= MpccSettings::default().max_iter);
                if !path {
                    let verdict = p.judge(&together);
                    assert!(!matches!(verdict, Verdict::Fail(_)), "{relaxation:?} {}: {verdict:?}", p.name);
                    rescued.push((relaxation, p.name.clone()));
                }
            }
        }
    }
    assert!(rescued.iter().any(|r| r.0 == Relaxation::Scholtes && r.1 == "billups"), "{rescued:?}");
}

#[test]
fn all_strategies_together_find_the_best() {
    never_worse_and_better_somewhere(Portfolio::All);
}

/// Paths on which the objective weighs differently end in other local optima, of which the best is kept.
#[test]
fn paths_that_do_not_agree_find_better_answers() {
    never_worse_and_better_somewhere(Portfolio::Agree);
}

/// Several strategies beside those that only follow where the path fails.
fn never_worse_and_better_somewhere(portfolio: Portfolio) {
    let mut better = Vec::new();
    for p in all().iter().filter(|p| p.known.expect == Expect::Optimal && !p.members.is_empty()) {
        for start in &p.starts {
            let of = |portfolio| p.solve(MpccSettings { portfolio, ..MpccSettings::default() }, start);
            let (first, best) = (of(Portfolio::Rescue), of(portfolio));
            assert_eq!(best.solution.outcome, first.solution.outcome, "{}", p.name);
            assert!(!matches!(p.judge(&best), Verdict::Fail(_)), "{}: {:?}", p.name, p.judge(&best));
            let gain = (first.solution.objective - best.solution.objective) / first.solution.objective.abs().max(1.0);
            assert!(gain >= -ACCURACY, "{}: {gain}", p.name);
            assert!(best.solution.stats.iterations >= first.solution.stats.iterations, "{}", p.name);
            if gain > ACCURACY {
                assert_ne!(best.solution.found_by, FoundBy::Path, "{}", p.name);
                better.push(p.name.clone());
            }
        }
    }
    assert!(!better.is_empty());
}
