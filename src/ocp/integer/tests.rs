//! Answers against enumeration by closed forms and by other solves.

use super::*;
use crate::expr::Graph;
use crate::func::Dims;
use crate::ocp::{Durations, Ocp, OcpResult};
use crate::random::SplitMix64;
use crate::settings::Settings;
use crate::system::System;

/// `x' = a x + u + v` on `n` stages of length 0.5 from 1, with the cost `∫ (x − aim)² + price u + v² dt`; `u` is on or off, `v` free within bounds.
fn problem(n: usize, (a, aim, price): (f64, f64, f64), v: f64, dwell: f64) -> Ocp {
    let d = Dims { x: 1, u: 2, p: 0 };
    let g = Graph::new();
    let (x, u, w) = (g.x(0), g.u(0), g.u(1));
    let mut s = System::new(1, 2, 0).unwrap();
    s.set_f0(std::sync::Arc::new(g.function("f", d, &[a * x + u + w]).unwrap())).unwrap();
    s.add_choice(0, &[1.0, 0.0], dwell).unwrap();
    let settings = Settings { n_s: 3, ..Settings::default() };
    let mut o = Ocp::new(&s, 0.5 * n as f64, n, &settings).unwrap();
    o.set_x0(&[1.0]).unwrap();
    o.set_u_bounds(&[f64::NEG_INFINITY, -v], &[f64::INFINITY, v]).unwrap();
    let cost = (x - aim) * (x - aim) + price * u + w * w;
    o.set_lagrange(std::sync::Arc::new(g.function("L", d, &[cost]).unwrap())).unwrap();
    o
}

fn solve(o: &mut Ocp) -> OcpResult {
    o.solve(&mut Control::default()).unwrap().clone()
}

/// What the best of all sequences costs, each solved for as a problem of its own.
fn least(o: &Ocp, n: usize, held: impl Fn(&[f64]) -> bool) -> f64 {
    let of = |bits: usize| -> Vec<f64> { (0..n).map(|k| f64::from(u8::from(bits >> k & 1 == 1))).collect() };
    let all = (0..1usize << n).map(of).filter(|u| held(u));
    all.map(|u| {
        let mut one = o.blank();
        let bounds = [0, 1].map(|side| u.iter().flat_map(|u| [*u, o.u_bounds[side][1]]).collect::<Vec<f64>>());
        one.chosen = Some(bounds);
        let request = Request::from_settings(&one.settings).unwrap();
        one.run(Start::Cold, &request, &mut Control::default()).unwrap().cost
    })
    .fold(f64::INFINITY, f64::min)
}

#[test]
fn the_best_of_all_choices_is_found_and_proven() {
    let mut numbers = SplitMix64::new(11);
    for k in 0..12 {
        let data = (-numbers.share(), 0.6 + numbers.share(), 0.3 * numbers.share());
        // without another control by enumeration, with one by bounds
        let v = if k % 2 == 0 { 0.0 } else { 0.3 };
        let mut o = problem(6, data, v, 0.0);
        let best = least(&o, 6, |_| true);
        let r = solve(&mut o);
        let found = r.optimality.unwrap();
        assert!((r.cost - best).abs() <= 1e-6 * best, "{data:?} {v}: {} {best}", r.cost);
        assert!(found.verdict == Verdict::Global && found.gap <= 1e-6, "{data:?} {found:?}");
        assert!(r.controls.chunks(2).all(|u| u[0] == 0.0 || u[0] == 1.0));
    }
}

#[test]
fn dwell_times_are_kept_by_both_exact_searches() {
    for v in [0.0, 0.2] {
        let mut o = problem(7, (-0.5, 0.9, 0.05), v, 1.0);
        let held = |u: &[f64]| {
            let at = |k: usize| u[k];
            (1..6).all(|k| !(at(k - 1) != at(k) && at(k) != at(k + 1)))
        };
        let best = least(&o, 7, held);
        let r = solve(&mut o);
        assert!((r.cost - best).abs() <= 1e-6 * best, "{v}: {} {best}", r.cost);
        assert_eq!(r.optimality.unwrap().verdict, Verdict::Global);
    }
}

#[test]
fn a_search_without_proof_says_what_it_compared() {
    let mut o = problem(6, (-0.5, 0.9, 0.05), 0.3, 0.0);
    o.settings.search_exact = 0.0;
    let r = solve(&mut o);
    let found = r.optimality.unwrap();
    assert!(found.verdict == Verdict::LocalOptimum && found.reason.contains("next to these"), "{found:?}");
    assert!(found.gap.is_nan() || found.gap >= 0.0);
}

#[test]
fn a_warm_start_keeps_a_sequence_that_is_still_the_best() {
    let mut o = problem(6, (-0.5, 0.9, 0.05), 0.0, 0.0);
    let cold = solve(&mut o);
    o.set_x0(&[1.001]).unwrap();
    let warm = o.solve_warm(&mut Control::default()).unwrap().clone();
    assert_eq!(warm.controls, cold.controls);
    assert!(warm.stats.iterations < cold.stats.iterations);
}

#[test]
fn what_cannot_be_met_is_infeasible_where_that_is_proven() {
    // the state falls whatever is chosen, and is to rise
    let mut o = problem(5, (-1.0, 0.5, 0.0), 0.1, 0.0);
    let d = Dims { x: 1, u: 2, p: 0 };
    let g = Graph::new();
    o.add_terminal(std::sync::Arc::new(g.function("end", d, &[g.x(0)]).unwrap()), &[5.0], &[6.0]).unwrap();
    let r = solve(&mut o);
    assert!(matches!(r.outcome, Outcome::Infeasible), "{:?} {}", r.outcome, r.message);
    assert!(r.message.contains("no sequence of choices"), "{}", r.message);
    // half of the interval between the values can be reached by none of two stages
    let mut o = problem(2, (0.0, 0.5, 0.0), 0.0, 0.0);
    o.add_terminal(std::sync::Arc::new(g.function("end", d, &[g.x(0)]).unwrap()), &[1.2], &[1.3]).unwrap();
    let r = solve(&mut o);
    assert!(!r.is_solution() && r.message.contains("choices"), "{:?} {}", r.outcome, r.message);
}

#[test]
fn what_choices_cannot_be_is_refused() {
    let mut o = problem(4, (-1.0, 0.5, 0.0), 0.1, 0.0);
    o.set_u_bounds(&[0.2, 0.0], &[0.8, 0.0]).unwrap();
    assert!(matches!(o.solve(&mut Control::default()), Err(Error::Range(m)) if m.contains("no value to choose")));
    let mut o = problem(4, (-1.0, 0.5, 0.0), 0.1, 0.0);
    o.set_linear_controls(&[true, false]).unwrap();
    assert!(matches!(o.solve(&mut Control::default()), Err(Error::Unsupported(m)) if m.contains("linear")));
    let mut o = problem(4, (-1.0, 0.5, 0.0), 0.1, 1.0);
    o.set_free_time(Durations::Horizon, 1.0, 3.0).unwrap();
    assert!(matches!(o.solve(&mut Control::default()), Err(Error::Unsupported(m)) if m.contains("dwell")));
}
