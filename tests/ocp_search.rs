//! Mode sequences of optimal control problems: given, found, bettered.

mod common;
use common::models::*;
use common::*;
use std::sync::Arc;
use switchback::expr::Graph;
use switchback::fesd::PathAt;
use switchback::func::Dims;
use switchback::model::Model;
use switchback::mpcc::Polish;
use switchback::nlp::{Control, IterationInfo, Outcome};
use switchback::ocp::{ModeSequence, Norm, Ocp, OcpResult, Verdict};
use switchback::settings::{DcsForm, OcpStart, Settings};

/// Best cost known of (7.51) by its authors; the converged optimum is 9.14960187.
const GOOD: f64 = 9.157_859_2;
/// Its neighbour: the second sliding mode begins exactly at the fourth control stage.
const POOR: f64 = 9.265_045;

fn solve(o: &mut Ocp) -> OcpResult {
    let r = o.solve(&mut Control::default()).unwrap().clone();
    assert_eq!(r.outcome, Outcome::Solved, "{}", r.message);
    r
}

/// Modes of the two subsystems of (7.51) in phases: `+`, `-`, or `0` for a sliding mode.
fn sequence(phases: &[(f64, &str)]) -> ModeSequence {
    let active = |c: char| [c != '-', c != '+'];
    ModeSequence {
        times: phases.iter().map(|p| p.0).collect(),
        modes: phases.iter().flat_map(|p| p.1.chars().flat_map(active)).collect(),
        ..ModeSequence::default()
    }
}

fn poor_sequence() -> ModeSequence {
    sequence(&[(0.0, "++"), (0.9, "+0"), (2.0, "00"), (2.3, "0-"), (2.8, "--")])
}

/// The cost of the best solution so far is told with every iteration, it never rises, and a solve that is stopped returns that solution.
#[test]
fn the_cost_of_the_incumbent_is_told_and_kept() {
    let mut o = sliding_ocp(&Settings { ocp_start: OcpStart::Portfolio as i64, ..settings(RadauIia, 2, 6, FESD) });
    let mut told = Vec::new();
    let mut monitor = |i: &IterationInfo| {
        told.push(i.incumbent);
        true
    };
    let best = o.solve(&mut Control { monitor: Some(&mut monitor), ..Control::default() }).unwrap().cost;
    assert!(told[0].is_infinite() && told.windows(2).all(|w| w[1] <= w[0]), "{told:?}");
    let last = *told.last().unwrap();
    assert!((last - best).abs() < 1e-6 * best, "{last} {best}");
    for (k, known) in told.iter().enumerate().filter(|t| t.1.is_finite()).step_by(told.len() / 5 + 1) {
        let mut left = k + 1;
        let mut monitor = |_: &IterationInfo| {
            left -= 1;
            left > 0
        };
        let r = o.solve(&mut Control { monitor: Some(&mut monitor), ..Control::default() }).unwrap();
        assert!(
            r.outcome == Outcome::Stopped && r.cost <= known + 1e-6 * known.abs(),
            "{k}: {:?} {}",
            r.outcome,
            r.cost
        );
        // it was compared with a simulation before it counted, and that is told
        assert!(r.accuracy.as_ref().is_some_and(|a| a.cost_error.abs() < 1e-6), "{k}: {}", r.message);
    }
}

/// All sources in one race: the best optimum of (7.51), a mass with friction whose cost is known, the same twice, and what is left where it is stopped.
#[test]
fn a_race_of_all_sources_finds_the_best_optimum() {
    for n_s in [2, 3] {
        let set = Settings { ocp_start: OcpStart::Portfolio as i64, ..settings(RadauIia, n_s, 6, FESD) };
        let mut o = sliding_ocp(&set);
        let r = solve(&mut o);
        assert!((r.cost - 9.149_601_87).abs() < 1e-6, "n_s = {n_s}: {}", r.cost);
        assert_eq!(r.optimality.unwrap().verdict, Verdict::LocalOptimum);
        assert_eq!(solve(&mut o).cost.to_bits(), r.cost.to_bits(), "the same again");
    }
    let g = Graph::new();
    let system = Model::from_rhs("mass", 1, 0, &[g.x(1), g.u(0) - 0.3 * g.x(1).sign()]);
    let system = system.and_then(|m| m.build(&g)).unwrap().system;
    let d = Dims { x: 2, u: 1, p: 0 };
    let mut o = Ocp::new(&system, 4.0, 10, &Settings::default()).unwrap();
    o.set_lagrange(Arc::new(g.function("of", d, &[g.u(0) * g.u(0)]).unwrap())).unwrap();
    o.add_terminal(Arc::new(g.function("end", d, &[g.x(0), g.x(1)]).unwrap()), &[1.0, 0.0], &[1.0, 0.0]).unwrap();
    o.set_u_bounds(&[-2.0], &[2.0]).unwrap();
    o.set_x0(&[0.0, 0.0]).unwrap();
    let exact = 0.36 + 0.1875 / 0.99;
    let r = solve(&mut o);
    assert!((r.cost - exact).abs() < 1e-9, "{} instead of {exact}", r.cost);
    for most in [1, 3, 10, 30, 100] {
        let mut left = most;
        let mut monitor = |_: &IterationInfo| {
            left -= 1;
            left > 0
        };
        let stopped = o.solve(&mut Control { monitor: Some(&mut monitor), ..Control::default() }).unwrap();
        let is_solution = stopped.outcome == Outcome::Solved && (stopped.cost - exact).abs() < 1e-9;
        assert!(stopped.outcome == Outcome::Stopped || is_solution, "{most}: {:?} {}", stopped.outcome, stopped.cost);
    }
}

#[test]
fn a_given_sequence_is_solved_and_the_search_leaves_it_for_the_better_optimum() {
    let mut guess = vec![0.0; 12];
    for n_s in [2, 3] {
        for form in [DcsForm::Stewart, DcsForm::Heaviside] {
            let solve = |mode_search: i64| {
                let dcs_form = form as i64;
                let set = Settings { mode_search, dcs_form, ..settings(RadauIia, n_s, 3, FESD) };
                let mut o = sliding_ocp(&set);
                o.set_modes(Some(poor_sequence())).unwrap();
                o.set_u_guess(&guess).unwrap();
                solve(&mut o)
            };
            let what = format!("n_s = {n_s}, {}", form.name());
            let without = solve(0);
            assert_eq!(without.polish, Polish::Done, "{what}");
            assert!((without.cost - POOR).abs() < 1e-4, "{what}: {}", without.cost);
            assert!(without.modes().times.iter().any(|t| (t - 2.0).abs() < 1e-9), "{what}: a switch between stages");
            let with = solve(10);
            assert_eq!(with.polish, Polish::Done, "{what}");
            assert!(with.cost <= GOOD, "{what}: {}", with.cost);
            assert!(with.accuracy.as_ref().unwrap().terminal_violation < 1e-5, "{what}");
            assert_eq!(with.controls, solve(10).controls, "{what}: the search is deterministic");
            guess = without.controls;
        }
    }
}

/// From the default start, without a budget.
#[test]
fn the_better_optimum_is_found_on_all_grids() {
    for (n_s, n_fe) in [(2, 3), (2, 5), (3, 2), (3, 3), (4, 2), (4, 3)] {
        for start in [OcpStart::Portfolio, OcpStart::Smoothing] {
            let set = Settings { ocp_start: start as i64, ..settings(RadauIia, n_s, n_fe, FESD) };
            let r = solve(&mut sliding_ocp(&set));
            let what = format!("n_s = {n_s}, {n_fe} elements, {start:?}");
            assert_eq!(r.polish, Polish::Done, "{what}");
            // with two elements a stage holds no third phase, and what is found is its neighbour: a kink of the cost
            assert!(n_fe == 2 || r.cost <= GOOD, "{what}: {}", r.cost);
            assert!(r.accuracy.unwrap().terminal_violation < 1e-6, "{what}");
        }
    }
}

/// Exact up to the error of the method, which is some 1e-12 here. Without an element to spare the mode sequence of the relaxation has
/// no solution; another one has, and leaves surfaces between control stages, where the slope of a multiplier is zero: that is exact
/// to the order of the stages only, `h^4` with the longest elements.
#[test]
fn coarse_grids_have_exact_answers() {
    for (n_s, n_fe, tol) in [(3, 1, 1e-6), (4, 1, 1e-9), (4, 2, 1e-11)] {
        let r = solve(&mut sliding_ocp(&settings(RadauIia, n_s, n_fe, FESD)));
        assert_eq!(r.polish, Polish::Done, "n_s = {n_s}, {n_fe} elements: {}", r.message);
        let off = r.accuracy.unwrap().terminal_violation;
        assert!(off < tol, "n_s = {n_s}, {n_fe} elements: {off:e}");
    }
}

#[test]
fn the_modes_of_a_solution_lead_back_to_it() {
    for form in [DcsForm::Stewart, DcsForm::Heaviside] {
        let set = Settings { dcs_form: form as i64, ..settings(RadauIia, 3, 4, FESD) };
        let first = solve(&mut sliding_ocp(&set));
        for with_cells in [true, false] {
            let mut modes = first.modes();
            if !with_cells {
                modes.cells.clear();
            }
            let mut o = sliding_ocp(&set);
            o.set_modes(Some(modes.clone())).unwrap();
            assert_eq!(o.modes(), Some(&modes));
            let r = solve(&mut o);
            let what = format!("{}, cells: {with_cells}, {} after {}", form.name(), r.cost, first.cost);
            assert!((r.cost - first.cost).abs() < 1e-10, "{what}");
            assert_eq!(r.modes().modes, modes.modes, "{what}");
            let (a, b) = (r.stats.iterations, first.stats.iterations);
            assert!(a < b, "{what}: {a} iterations, {b} before");
            // without it, as before
            o.set_modes(None).unwrap();
            assert_eq!(solve(&mut o).controls, first.controls, "{what}");
        }
    }
}

#[test]
fn a_sequence_without_a_solution_is_left() {
    let mut o = sliding_ocp(&settings(RadauIia, 2, 3, FESD));
    let plain = solve(&mut o);
    // the second subsystem cannot stay where it starts
    o.set_modes(Some(sequence(&[(0.0, "++"), (2.0, "-+")]))).unwrap();
    let r = solve(&mut o);
    assert_eq!(r.polish, Polish::Done);
    assert!(r.cost < 9.2651, "one of the two optima: {}", r.cost);
    assert!(r.stats.iterations > plain.stats.iterations, "what was tried counts");
    // four phases in one stage of three elements
    let many = sequence(&[(0.0, "++"), (0.1, "+0"), (0.2, "+-"), (0.3, "--")]);
    o.set_modes(Some(many)).unwrap();
    let e = o.solve(&mut Control::default()).unwrap_err().to_string();
    assert!(e.contains("stage 0 has 4 phases and 3 elements"), "{e}");
    o.set_modes(Some(ModeSequence { times: vec![0.0], modes: vec![true], ..ModeSequence::default() })).unwrap();
    assert!(o.solve(&mut Control::default()).is_err());
}

/// Relays of three lags switch each other, and the first lag is to end exactly where its relay switches. Smoothed problems stay on that surface,
/// and their mode programs have no solution; controls that are aimed at the end lead to phases that have one.
#[test]
fn an_end_on_a_switching_surface_is_reached() {
    let g = Graph::new();
    let (a, b, c, u) = (g.x(0), g.x(1), g.x(2), g.u(0));
    let rhs = [c.lt(0.4).select(1.0, 0.0) - a + u, a.gt(0.5).select(1.2, 0.0) - b, b.gt(0.6).select(1.0, 0.0) - c];
    let system = Model::from_rhs("relays", 1, 0, &rhs).and_then(|m| m.build(&g)).unwrap().system;
    let mut o = Ocp::new(&system, 8.0, 12, &Settings { n_s: 3, n_fe: 2, ..Settings::default() }).unwrap();
    let d = Dims { x: 3, u: 1, p: 0 };
    let of = |outputs: &[switchback::expr::Expr]| Arc::new(g.function("of", d, outputs).unwrap());
    o.set_x0(&[0.0, 0.2, 0.7]).unwrap();
    o.set_u_bounds(&[-0.4], &[0.4]).unwrap();
    o.set_lagrange(of(&[u * u])).unwrap();
    o.add_terminal(of(&[a, b]), &[0.5, 0.3], &[0.5, 0.3]).unwrap();
    let r = solve(&mut o);
    assert_eq!(r.polish, Polish::Done);
    // bounds and the length of the horizon allow 1.28; the answer costs 0.3014
    assert!(r.cost < 0.302, "{}", r.cost);
    let end = r.accuracy.unwrap().terminal_violation;
    assert!(end < 5e-3, "{end}");
}

/// A cart on a slack spring pulls a load with dry friction: the load may be pulled once after a run-up, twice, or slowly, and these are optima
/// of their own. An implicit Euler scheme with set-valued friction, 40000 steps, takes the controls of the best one to a position of 1.00007 at
/// a velocity of 3e-5; smoothed problems lead to one that costs 2.6346, and the search as it is by default to one that costs 1.8722.
#[test]
fn a_run_up_is_found_where_smoothed_problems_lead_elsewhere() {
    let g = Graph::new();
    let (x, y, v, w, u) = (g.x(0), g.x(1), g.x(2), g.x(3), g.u(0));
    let pull = 30.0 * (x - y - 0.5).max(0.0);
    let rhs = [v, w, u - pull - 0.1 * v, 0.5 * pull - 0.4 * w.sign()];
    let system = Model::from_rhs("tow", 1, 0, &rhs).and_then(|m| m.build(&g)).unwrap().system;
    let set = Settings { n_s: 3, n_fe: 3, search_effort: 4.0, ..Settings::default() };
    let mut o = Ocp::new(&system, 5.0, 20, &set).unwrap();
    let d = Dims { x: 4, u: 1, p: 0 };
    let of = |outputs: &[switchback::expr::Expr]| Arc::new(g.function("of", d, outputs).unwrap());
    o.set_x0(&[0.0; 4]).unwrap();
    o.set_u_bounds(&[-4.0], &[4.0]).unwrap();
    o.set_lagrange(of(&[u * u])).unwrap();
    o.add_terminal(of(&[y, w]), &[1.0, 0.0], &[1.0, 0.0]).unwrap();
    let r = solve(&mut o);
    assert_eq!(r.polish, Polish::Done);
    assert!(r.cost < 1.7494, "{}", r.cost);
    assert!(r.controls[0] < 0.0, "it runs up: {}", r.controls[0]);
    assert!(r.accuracy.unwrap().terminal_violation < 1e-3);
}

/// A boat steers across four currents of one width. Along the way of the smoothed problem the mode program is all but solved, and it ends there: its
/// Lagrange function is curved by multipliers alone, which are large beside the gradient of the time.
#[test]
fn a_start_next_to_the_answer_is_not_left() {
    let g = Graph::new();
    let (y, heading) = (g.x(1), g.u(0));
    let outer = y.gt(2.0).select(0.8, y.gt(1.0).select(-0.9, 0.2));
    let current = y.gt(3.0).select(-0.6, outer);
    let system = Model::from_rhs("boat", 1, 0, &[heading.cos() + current, heading.sin()])
        .and_then(|m| m.build(&g))
        .unwrap()
        .system;
    for (n_s, n_fe) in [(3, 2), (3, 3), (3, 4), (4, 3)] {
        let mut o = Ocp::new(&system, 5.0, 16, &Settings { n_s, n_fe, ..Settings::default() }).unwrap();
        let d = Dims { x: 2, u: 1, p: 0 };
        let of = |outputs: &[switchback::expr::Expr]| Arc::new(g.function("of", d, outputs).unwrap());
        o.set_x0(&[0.0, 0.0]).unwrap();
        o.set_u_bounds(&[-3.2], &[3.2]).unwrap();
        o.set_lagrange(of(&[g.constant(1.0)])).unwrap();
        o.add_terminal(of(&[g.x(0), y]), &[2.0, 4.0], &[2.0, 4.0]).unwrap();
        o.set_free_time(switchback::fesd::Durations::Horizon, 0.5, 20.0).unwrap();
        let r = solve(&mut o);
        assert_eq!(r.polish, Polish::Done);
        // with one heading in each current `Σ 1 / sin θ` is 4.664675 at least; headings change at the ends of stages only, and 5.12 is the next optimum
        assert!((0.0..0.02).contains(&(r.cost - 4.664675)), "{n_s}, {n_fe}: {}", r.cost);
    }
}

/// The start is free on either side of a line from which motions lead away on both: those on one side end far from the goal whatever the controls
/// are, and a guess there is left.
#[test]
fn a_free_start_is_found_on_the_other_side_of_a_line_that_repels() {
    let g = Graph::new();
    let (x, y, u) = (g.x(0), g.x(1), g.u(0));
    let rhs = [y.gt(0.5 * x).select(-1.0, 1.0) + 0.2 * y, u - 0.3 * y];
    let system = Model::from_rhs("side", 1, 0, &rhs).and_then(|m| m.build(&g)).unwrap().system;
    let mut o = Ocp::new(&system, 3.0, 10, &Settings::default()).unwrap();
    let d = Dims { x: 2, u: 1, p: 0 };
    let of = |output: switchback::expr::Expr| Arc::new(g.function("of", d, &[output]).unwrap());
    o.set_x0_bounds(&[-2.0, -1.0], &[2.0, 1.0]).unwrap();
    o.set_u_bounds(&[-1.0], &[1.0]).unwrap();
    o.set_lagrange(of(0.1 * u * u + 0.05 * x * x)).unwrap();
    let (right, up) = (x - 1.0, y - 0.7);
    o.set_mayer(of(right * right + up * up)).unwrap();
    o.set_x_guess(&[0.0], &[1.8, 1.0]).unwrap();
    let r = solve(&mut o);
    // a control of 0.25 from (-1.6, -1) leads away from the line all the time, and its closed form costs 0.5315; on the side of the guess the best is
    // 1.607. Less costs a start next to the line, from which the motion leads away to the side of the goal: the optima there cost 0.172 and 0.181
    assert!(r.cost < 0.182, "{}", r.cost);
    assert!(r.accuracy.as_ref().unwrap().terminal < 1e-6, "the controls lead to the answer");
    let x0 = &r.trajectory.elements[0].x0;
    assert!(x0[0] < 0.0 || (x0[1] - 0.5 * x0[0]).abs() < 1e-3, "{x0:?}: on the other side, or next to the line");
}

/// Of two answers the one that costs less with the price of what it violates is better: the other one leaves its goal and costs nothing else.
#[test]
fn what_relaxed_constraints_cost_counts_in_a_search() {
    let g = Graph::new();
    let u = g.u(0);
    let system = Model::from_rhs("integrator", 1, 0, &[u]).and_then(|m| m.build(&g)).unwrap().system;
    let d = Dims { x: 1, u: 1, p: 0 };
    let mut o = Ocp::new(&system, 1.0, 1, &Settings::default()).unwrap();
    o.set_x0(&[0.0]).unwrap();
    o.set_u_bounds(&[-0.5], &[1.5]).unwrap();
    let hill = 200.0 * u * u * (1.0 - u) * (1.0 - u);
    o.set_lagrange(Arc::new(g.function("cost", d, &[u + hill]).unwrap())).unwrap();
    let goal = Arc::new(g.function("goal", d, &[u]).unwrap());
    o.add_relaxed(goal, &[1.0], &[f64::INFINITY], Some(PathAt::ControlGrid), Norm::L1, 2.0).unwrap();
    let starts = o.solve_starts(&[vec![0.0], vec![1.0]], 1, &mut Control::default()).unwrap();
    let costs: Vec<(f64, f64)> =
        starts.results.iter().map(|r| r.as_ref().unwrap()).map(|r| (r.cost, r.violation)).collect();
    assert!(costs[0].0 < 0.3 && costs[0].1 > 0.8, "{costs:?}");
    assert!((costs[1].0 - 1.0).abs() < 1e-6 && costs[1].1 < 1e-6, "{costs:?}");
    assert_eq!(starts.best, 1, "{costs:?}");
}

/// A tank may stay below the level from which on it costs, and does so most of the time; how long it is beyond has several local optima, and a first
/// answer that is found soon is no reason to look for others less, where effort is asked for.
#[test]
fn other_ways_are_looked_for_where_the_first_one_was_found_soon() {
    let g = Graph::new();
    let (h, q, u) = (g.x(0), g.x(1), g.u(0));
    let inflow = 0.4 * (1.0 + 0.5 * g.t().sin() - q);
    let rhs = [q - 0.5 * u - 0.1 * h, inflow, (h - 1.0).gt(0.0).select(1.0, 0.0)];
    let system = Model::from_rhs("tank", 1, 0, &rhs).and_then(|m| m.build(&g)).unwrap().system;
    let mut o = Ocp::new(&system, 8.0, 16, &Settings { search_effort: 4.0, ..Settings::default() }).unwrap();
    let d = Dims { x: 3, u: 1, p: 0 };
    let of = |output: switchback::expr::Expr| Arc::new(g.function("of", d, &[output]).unwrap());
    o.set_x0(&[0.5, 0.8, 0.0]).unwrap();
    o.set_u_bounds(&[0.0], &[3.0]).unwrap();
    o.set_lagrange(of(u * u)).unwrap();
    o.set_mayer(of(3.0 * g.x(2) - h)).unwrap();
    let r = solve(&mut o);
    // the first answer costs 15.87
    assert!(r.cost < 15.79, "{}", r.cost);
}

/// Controls that stand exactly on their thresholds: a program mixes both sides within a stage, and no simulation does. The answer has one side in
/// every stage, and keeps a distance from the others. With the usual effort one of four seeds of the search ends at 0.114.
#[test]
fn controls_on_their_thresholds_choose_for_whole_stages() {
    let g = Graph::new();
    let (x, a, b) = (g.x(0), g.u(0), g.u(1));
    let rhs = [(a - 0.5).gt(0.0).select(1.0, 0.0) - b.gt(a).select(0.7, 0.1) * x];
    let system = Model::from_rhs("switches", 2, 0, &rhs).and_then(|m| m.build(&g)).unwrap().system;
    let mut o = Ocp::new(&system, 2.0, 5, &Settings { search_effort: 4.0, ..Settings::default() }).unwrap();
    let d = Dims { x: 1, u: 2, p: 0 };
    let of = |output: switchback::expr::Expr| Arc::new(g.function("of", d, &[output]).unwrap());
    o.set_x0(&[0.0]).unwrap();
    o.set_u_bounds(&[0.0; 2], &[1.0; 2]).unwrap();
    o.set_lagrange(of((x - 0.6) * (x - 0.6) + 0.05 * a + 0.02 * b * b)).unwrap();
    let r = solve(&mut o);
    // with the sides of the first stage 0.1142, with any mixture of both 0.0936
    assert!(r.cost < 0.097, "{}", r.cost);
    assert!(r.accuracy.as_ref().unwrap().terminal < 1e-6, "the controls lead to the answer");
    assert_eq!(r.optimality.as_ref().map(|o| o.verdict), Some(Verdict::Kink));
}
