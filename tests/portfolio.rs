//! Several strategies in one solve: where the first one fails others follow, and all of them together find the best.

#[path = "../crates/switchback-mpcc/tests/common/textbook/mod.rs"]
mod textbook;

use std::sync::Arc;
use switchback::expr::{Expr, Graph};
use switchback::func::Dims;
use switchback::mpcc::{BStationarity, FoundBy, Lifted, Member, MpccSettings, MpccSolver, Polish, Solution};
use switchback::nlp::{Bounds, CallbackNlp, Control, Outcome};
use switchback::settings::{Homotopy, Portfolio, Relaxation};
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
    assert!(!better_and_never_worse(Portfolio::All).is_empty());
}

/// Which members are zero is chosen by what a steeper term of the objective has nothing to do with. The barrier does not make that choice: with
/// a barrier parameter of a tenth of the relaxation these forty came to 30.63 on the whole.
#[test]
fn the_objective_chooses_between_members() {
    let mut sum = 0.0;
    for n in [10, 14, 16, 20, 24, 26, 34, 40] {
        for wanted in [0.9, 1.0, 1.1, 1.2, 1.5] {
            sum += neighbours(n, wanted, 10.0, MpccSettings::default()).objective / n as f64;
        }
    }
    assert!(sum < 30.4, "{sum}");
}

/// Paths on which the objective weighs differently end in other local optima, of which the best is kept.
#[test]
fn paths_that_do_not_agree_find_better_answers() {
    better_and_never_worse(Portfolio::Agree);
    let of = |portfolio| neighbours(40, 1.0, 0.0, MpccSettings { portfolio, ..MpccSettings::default() });
    let (first, best) = (of(Portfolio::Rescue), of(Portfolio::Agree));
    assert!(best.objective < 0.995 * first.objective, "{} {}", best.objective, first.objective);
    assert_ne!(best.found_by, FoundBy::Path);
}

/// Where paths come to a local optimum beside which a branch is better, that branch is the answer, with a certificate of its own. Models of programs of
/// this size are more work than branch and bound has by default.
#[test]
fn branches_that_models_promise_are_tried() {
    let mut found = 0;
    for n in [14, 20, 26] {
        for wanted in [0.9, 1.0, 1.1] {
            let of = |branch_work| neighbours(n, wanted, 10.0, MpccSettings { branch_work, ..MpccSettings::default() });
            let (first, best) = (of(0.0), of(1e8));
            assert!(best.objective <= first.objective + 1e-9 * n as f64, "{n} {wanted}");
            if best.found_by == FoundBy::Models {
                assert!(best.objective < 0.995 * first.objective, "{} {}", best.objective, first.objective);
                assert_eq!(best.certificate.b, BStationarity::Yes);
                found += 1;
            }
        }
    }
    assert!(found > 0);
}

/// `a b >= least` for a pair has no point where the pair is complementary, but by less than what products may be: the solution of a small
/// relaxation is the answer, and its polish says that no exact point was found. Where `least` is above that there is none. The same of penalties, whose
/// problems have solutions with open pairs, however large the penalty.
#[test]
fn a_relaxation_is_the_answer_where_no_exact_point_is() {
    let elastic = MpccSettings {
        relaxation: Relaxation::LinfPenalty,
        homotopy: Homotopy::Outer,
        portfolio: Portfolio::Off,
        ..MpccSettings::default()
    };
    let solve = |least: f64, settings: MpccSettings| {
        let d = Dims { x: 2, u: 0, p: 0 };
        let g = Graph::new();
        let (a, b) = (g.x(0), g.x(1));
        let objective = g.function("f", d, &[(a - 1.0).powi(2) + (b - 2.0).powi(2)]).unwrap();
        let rows = g.function("c", d, &[a * b]).unwrap();
        let program = CallbackNlp::new(2, 0, Arc::new(objective), Some(Arc::new(rows))).unwrap();
        let mut program = Lifted::new(program, &[(Member::Variable(0), Member::Variable(1))]).unwrap();
        let mut bounds = Bounds::free(2, 1);
        bounds.cl[0] = least;
        let bounds = program.bounds(&bounds).unwrap();
        let mut solver = MpccSolver::new(&mut program, settings).unwrap();
        let start = program.start(&[1.0; 2]);
        solver.solve(&mut program, &bounds, &start, &mut Control::default()).clone()
    };
    for settings in [MpccSettings::default(), elastic] {
        let relaxed = solve(2.5e-8, settings);
        assert_eq!((relaxed.outcome, relaxed.polish), (Outcome::Solved, Polish::Rejected));
        assert!(relaxed.residuals.pair_product >= 2.5e-8 && relaxed.residuals.pair_product <= 1e-7);
        assert_ne!(solve(1e-6, settings).outcome, Outcome::Solved);
    }
    assert_eq!(solve(1e-6, MpccSettings::default()).outcome, Outcome::LocallyInfeasible);
}

/// The answer for `n` variables near `wanted`, of which neighbours share a row and one of every second pair of them is zero, which is a
/// choice with many local optima; and for one more beside them, with a term of the objective that is `steep`.
fn neighbours(n: usize, wanted: f64, steep: f64, settings: MpccSettings) -> Solution {
    let d = Dims { x: n + 1, u: 0, p: 0 };
    let g = Graph::new();
    let x: Vec<Expr> = (0..n).map(|i| g.x(i)).collect();
    let cost = x.iter().map(|x| (*x - wanted).powi(2) + x.powi(4) * 0.1).reduce(|a, b| a + b).unwrap();
    let cost = cost + (g.x(n) - 1.0).powi(2) * steep;
    let rows: Vec<Expr> = x.windows(2).map(|x| x[0] + x[1] * x[1]).collect();
    let objective = g.function("f", d, &[cost]).unwrap();
    let rows = g.function("c", d, &rows).unwrap();
    let program = CallbackNlp::new(n + 1, 0, Arc::new(objective), Some(Arc::new(rows))).unwrap();
    let pairs: Vec<_> = (0..n).step_by(2).map(|i| (Member::Variable(i), Member::Variable(i + 1))).collect();
    let mut program = Lifted::new(program, &pairs).unwrap();
    let mut bounds = Bounds::free(n + 1, n - 1);
    bounds.cu.fill(1.0);
    let bounds = program.bounds(&bounds).unwrap();
    let mut solver = MpccSolver::new(&mut program, settings).unwrap();
    let start = program.start(&vec![0.0; n + 1]);
    let answer = solver.solve(&mut program, &bounds, &start, &mut Control::default()).clone();
    assert_eq!(answer.outcome, Outcome::Solved);
    answer
}

/// Programs of which several strategies find a better answer than those that only follow where the path fails; none has a worse one.
fn better_and_never_worse(portfolio: Portfolio) -> Vec<String> {
    let mut better = Vec::new();
    for p in all().iter().filter(|p| p.known.expect == Expect::Optimal && !p.members.is_empty()) {
        for start in &p.starts {
            // of the strategies themselves: branch and bound leaves them nothing better on small programs
            let of =
                |portfolio| p.solve(MpccSettings { portfolio, branch_work: 0.0, ..MpccSettings::default() }, start);
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
    better
}
