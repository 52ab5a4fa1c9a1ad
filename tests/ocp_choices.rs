//! Controls that choose: answers against the best of all sequences, each solved for as a problem of its own.

use std::sync::Arc;

use switchback::error::Error;
use switchback::expr::{Expr, Graph};
use switchback::func::Dims;
use switchback::nlp::{Control, Outcome};
use switchback::ocp::{Durations, Ocp, OcpResult, Verdict};
use switchback::settings::Settings;
use switchback::system::System;

/// Factor of the state, aim and price of the cost.
type Data = (f64, f64, f64);

/// `x' = a x + u + v` on `n` stages of length 0.5 from 1, with the cost `∫ (x − aim)² + price u + v² dt`; `v` is a control within bounds, and `u` what the
/// graph says: another control, or a parameter.
fn stated(
    n: usize,
    (a, aim, price): Data,
    v: f64,
    d: Dims,
    u: impl Fn(&Graph) -> Expr,
    settings: &Settings,
) -> (System, impl Fn(&System) -> Ocp) {
    let g = Graph::new();
    let (x, u, w) = (g.x(0), u(&g), g.u(0));
    let mut s = System::new(1, d.u, d.p).unwrap();
    s.set_f0(Arc::new(g.function("f", d, &[a * x + u + w]).unwrap())).unwrap();
    let cost = (x - aim) * (x - aim) + price * u + w * w;
    let cost = Arc::new(g.function("L", d, &[cost]).unwrap());
    let settings = *settings;
    let make = move |s: &System| {
        let mut o = Ocp::new(s, 0.5 * n as f64, n, &settings).unwrap();
        o.set_x0(&[1.0]).unwrap();
        let (mut low, mut high) = (vec![f64::NEG_INFINITY; d.u], vec![f64::INFINITY; d.u]);
        (low[0], high[0]) = (-v, v);
        o.set_u_bounds(&low, &high).unwrap();
        o.set_lagrange(cost.clone()).unwrap();
        o
    };
    (s, make)
}

fn settings() -> Settings {
    Settings { n_s: 3, ..Settings::default() }
}

/// With `u` on or off.
fn with(n: usize, data: Data, v: f64, dwell: f64, settings: &Settings) -> Ocp {
    let d = Dims { x: 1, u: 2, p: 0 };
    let (mut s, make) = stated(n, data, v, d, |g| g.u(1), settings);
    s.add_choice(1, &[1.0, 0.0], dwell).unwrap();
    make(&s)
}

fn problem(n: usize, data: Data, v: f64, dwell: f64) -> Ocp {
    with(n, data, v, dwell, &settings())
}

fn solve(o: &mut Ocp) -> OcpResult {
    o.solve(&mut Control::default()).unwrap().clone()
}

/// What the best of all sequences costs.
fn least(n: usize, data: Data, v: f64, held: impl Fn(&[f64]) -> bool) -> f64 {
    let (s, make) = stated(n, data, v, Dims { x: 1, u: 1, p: 1 }, |g| g.p(0), &settings());
    let of = |bits: usize| -> Vec<f64> { (0..n).map(|k| f64::from(u8::from(bits >> k & 1 == 1))).collect() };
    let all = (0..1usize << n).map(of).filter(|u| held(u));
    all.map(|u| {
        let mut one = make(&s);
        one.set_stage_params(&u).unwrap();
        solve(&mut one).cost
    })
    .fold(f64::INFINITY, f64::min)
}

fn end(low: f64, high: f64, o: &mut Ocp) {
    let g = Graph::new();
    let f = g.function("end", Dims { x: 1, u: 2, p: 0 }, &[g.x(0)]).unwrap();
    o.add_terminal(Arc::new(f), &[low], &[high]).unwrap();
}

#[test]
fn the_best_of_all_choices_is_found_and_proven() {
    // the fractional parts of multiples of an irrational number are spread evenly
    let share = |k: usize| (0.618_033_988_749_895 * k as f64).fract();
    for k in 0..12 {
        let data = (-share(3 * k + 1), 0.6 + share(3 * k + 2), 0.3 * share(3 * k + 3));
        // without another control by enumeration, with one by bounds
        let v = if k % 2 == 0 { 0.0 } else { 0.3 };
        let mut o = problem(6, data, v, 0.0);
        let best = least(6, data, v, |_| true);
        let r = solve(&mut o);
        let found = r.optimality.unwrap();
        assert!((r.cost - best).abs() <= 1e-6 * best, "{data:?} {v}: {} {best}", r.cost);
        assert!(found.verdict == Verdict::Global && found.gap <= 1e-6, "{data:?} {found:?}");
        assert!(r.controls.chunks(2).all(|u| u[1] == 0.0 || u[1] == 1.0));
    }
}

#[test]
fn dwell_times_are_kept_by_both_exact_searches() {
    for v in [0.0, 0.2] {
        let data = (-0.5, 0.9, 0.05);
        let mut o = problem(7, data, v, 1.0);
        let held = |u: &[f64]| {
            let at = |k: usize| u[k];
            (1..6).all(|k| !(at(k - 1) != at(k) && at(k) != at(k + 1)))
        };
        let best = least(7, data, v, held);
        let r = solve(&mut o);
        assert!((r.cost - best).abs() <= 1e-6 * best, "{v}: {} {best}", r.cost);
        assert_eq!(r.optimality.unwrap().verdict, Verdict::Global);
    }
}

#[test]
fn a_search_without_proof_says_what_it_compared() {
    let mut o = with(6, (-0.5, 0.9, 0.05), 0.3, 0.0, &Settings { search_exact: 0.0, ..settings() });
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
    end(5.0, 6.0, &mut o);
    let r = solve(&mut o);
    assert!(matches!(r.outcome, Outcome::Infeasible), "{:?} {}", r.outcome, r.message);
    assert!(r.message.contains("no sequence of choices"), "{}", r.message);
    // half of the interval between the values can be reached by none of two stages
    let mut o = problem(2, (0.0, 0.5, 0.0), 0.0, 0.0);
    end(1.2, 1.3, &mut o);
    let r = solve(&mut o);
    assert!(r.outcome != Outcome::Solved && r.message.contains("choices"), "{:?} {}", r.outcome, r.message);
}

#[test]
fn what_choices_cannot_be_is_refused() {
    let mut o = problem(4, (-1.0, 0.5, 0.0), 0.1, 0.0);
    o.set_u_bounds(&[0.0, 0.2], &[0.0, 0.8]).unwrap();
    assert!(matches!(o.solve(&mut Control::default()), Err(Error::Range(m)) if m.contains("no value to choose")));
    let mut o = problem(4, (-1.0, 0.5, 0.0), 0.1, 0.0);
    o.set_linear_controls(&[false, true]).unwrap();
    assert!(matches!(o.solve(&mut Control::default()), Err(Error::Unsupported(m)) if m.contains("linear")));
    let mut o = problem(4, (-1.0, 0.5, 0.0), 0.1, 1.0);
    o.set_free_time(Durations::Horizon, 1.0, 3.0).unwrap();
    assert!(matches!(o.solve(&mut Control::default()), Err(Error::Unsupported(m)) if m.contains("dwell")));
}
