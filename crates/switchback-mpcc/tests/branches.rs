//! Branch and bound beside a full enumeration: what is said to be global is, and what is said to have no point has none.

#![allow(clippy::needless_range_loop)]

#[path = "../benches/families/draw.rs"]
#[allow(dead_code)]
mod draw;
#[path = "../benches/families/enumerate.rs"]
#[allow(dead_code)]
mod enumerate;
#[path = "../benches/families/program.rs"]
mod program;

use switchback_mpcc::mpcc::{BStationarity, FoundBy, Lifted, Mpcc, MpccSettings, MpccSolver, Solution};
use switchback_mpcc::nlp::{Control, Nlp, Outcome};

use draw::{bend, complementarity, draw, in_units};
use enumerate::enumerate;

/// The first seed of programs for models.
const SEEDS: u64 = 400;

/// The solution of a drawn program, and the least objective of its branches.
fn solve(kind: &str, seed: u64, settings: MpccSettings) -> (Solution, f64) {
    solve_in(kind, seed, 0, settings)
}

/// The same in drawn units of so many digits; objectives are those of the program as it was drawn.
fn solve_in(kind: &str, seed: u64, digits: i32, settings: MpccSettings) -> (Solution, f64) {
    let program = draw(kind, seed, None);
    let mut p = Lifted::new(program.clone(), &program.pairs).unwrap();
    let bounds = p.bounds(&program.bounds).unwrap();
    let least = if p.pairs().len() <= 9 { enumerate(&program, &mut p, &bounds) } else { f64::NAN };
    let (program, unit) = in_units(program, digits, seed);
    let mut p = Lifted::new(program.clone(), &program.pairs).unwrap();
    let bounds = p.bounds(&program.bounds).unwrap();
    let x0 = p.start(&program.x0);
    let mut solver = MpccSolver::new(&mut p, settings).unwrap();
    let mut s = solver.solve(&mut p, &bounds, &x0, &mut Control::default()).clone();
    s.objective /= unit;
    s.certificate.bound = s.certificate.bound.map(|b| b / unit);
    (s, least)
}

#[test]
fn bounds_are_those_of_an_enumeration() {
    let settings = MpccSettings { branch_work: 1e8, ..MpccSettings::default() };
    let (mut global, mut empty) = (0, 0);
    for kind in ["lpcc", "qpcc", "bilevel", "sparse", "friction", "obstacle"] {
        for seed in 0..6 {
            let (s, least) = solve(kind, seed, settings);
            if least.is_nan() {
                continue;
            }
            if least == f64::INFINITY {
                assert_eq!(s.outcome, Outcome::Infeasible, "{kind} {seed}");
                empty += 1;
                continue;
            }
            let room = 1e-6 * least.abs().max(1.0);
            assert_eq!((s.outcome, s.certificate.b), (Outcome::Solved, BStationarity::Yes), "{kind} {seed}");
            assert!((s.objective - least).abs() <= room, "{kind} {seed}: {}, enumerated {least}", s.objective);
            let bound = s.certificate.bound.expect("a bound");
            assert!((bound - least).abs() <= room, "{kind} {seed}: bound {bound}, enumerated {least}");
            global += 1;
        }
    }
    assert!(global > 20 && empty > 0, "{global} {empty}");
}

/// In units from a millionth to a million of everything bounds are not above the optimum.
#[test]
fn mixed_units_falsify_no_bound() {
    let mut global = 0;
    for kind in ["lpcc", "sparse", "friction", "obstacle"] {
        for seed in 20..25 {
            let (s, least) = solve_in(kind, seed, 6, MpccSettings::default());
            let room = 1e-6 * least.abs().max(1.0);
            match s.certificate.bound {
                Some(bound) if !least.is_nan() => {
                    assert!(bound <= least + room, "{kind} {seed}: bound {bound}, enumerated {least}");
                    global += usize::from(s.objective <= least + room && bound >= least - room);
                }
                _ => assert!(least.is_nan() || least.is_infinite(), "{kind} {seed}: {:?}", s.outcome),
            }
        }
    }
    assert!(global > 10, "{global}");
}

/// A search that ends early proves a bound that is not above any point, and costs no answer.
#[test]
fn a_short_search_proves_what_it_can() {
    let mut open = 0;
    for seed in 0..12 {
        let (s, least) = solve("obstacle", seed, MpccSettings { branch_work: 3e4, ..MpccSettings::default() });
        let room = 1e-6 * least.abs().max(1.0);
        assert_eq!(s.outcome, Outcome::Solved, "{seed}");
        let bound = s.certificate.bound.unwrap_or(f64::NEG_INFINITY);
        assert!(least.is_nan() || bound <= least + room, "{seed}: bound {bound}, enumerated {least}");
        open += usize::from(bound < s.objective - room);
    }
    assert!(open > 0, "the work was enough for all");
}

/// Where objectives are no quadratic ones models lead from the solution of the path to better branches: to the best one, mostly.
#[test]
fn models_lead_to_better_branches() {
    let (mut better, mut global, mut all) = (0, 0, 0);
    for kind in ["lpcc", "sparse"] {
        for seed in SEEDS..SEEDS + 8 {
            let program = bend(draw(kind, seed, Some(5)), kind, seed);
            let mut p = Lifted::new(program.clone(), &program.pairs).unwrap();
            let bounds = p.bounds(&program.bounds).unwrap();
            let x0 = p.start(&program.x0);
            let mut of = |branch_work: f64| {
                let settings = MpccSettings { branch_work, ..MpccSettings::default() };
                let mut solver = MpccSolver::new(&mut p, settings).unwrap();
                solver.solve(&mut p, &bounds, &x0, &mut Control::default()).clone()
            };
            let (path, found) = (of(0.0), of(MpccSettings::default().branch_work));
            let least = enumerate(&program, &mut p, &bounds);
            if path.outcome != Outcome::Solved {
                continue;
            }
            let room = 1e-6 * least.abs().max(1.0);
            assert_eq!((found.outcome, found.certificate.b), (Outcome::Solved, BStationarity::Yes), "{kind} {seed}");
            assert!(found.objective <= path.objective + room, "{kind} {seed}: worse");
            assert!(found.objective >= least - room, "{kind} {seed}: {} below {least}", found.objective);
            let fell = found.objective < path.objective - room;
            assert_eq!(found.found_by, if fell { FoundBy::Models } else { path.found_by }, "{kind} {seed}");
            (better, all) = (better + usize::from(fell), all + 1);
            global += usize::from(found.objective <= least + room);
        }
    }
    assert!(better > 1 && 10 * global >= 9 * all, "{better} better, {global} of {all} global");
}

/// Linear complementarity problems end at a solution without a path: strictly copositive ones, on which one takes up to thousands of iterations.
#[test]
fn complementarity_problems_take_pivots() {
    for kind in ["positive", "monotone", "copositive"] {
        for (n, seed) in [(5, 1), (20, 2), (60, 3)] {
            let program = complementarity(kind, n, seed);
            let mut p = Lifted::new(program.clone(), &program.pairs).unwrap();
            let bounds = p.bounds(&program.bounds).unwrap();
            let x0 = p.start(&program.x0);
            let mut solver = MpccSolver::new(&mut p, MpccSettings::default()).unwrap();
            let s = solver.solve(&mut p, &bounds, &x0, &mut Control::default()).clone();
            assert_eq!((s.outcome, s.found_by), (Outcome::Solved, FoundBy::Branches), "{kind} {n}");
            assert!(s.stats.iterations <= 2, "{kind} {n}: {}", s.stats.iterations);
            let mut c = vec![0.0; p.m()];
            p.eval(&s.x, &mut c).unwrap();
            let open = p.pairs().iter().map(|&(a, b)| s.x[a].min(s.x[b]).abs()).fold(0.0, f64::max);
            let missed = c.iter().fold(0f64, |a, c| a.max(c.abs()));
            assert!(open.max(missed) < 1e-9 && s.x.iter().all(|x| *x >= 0.0), "{kind} {n}: {open:e} {missed:e}");
        }
    }
}

/// Nothing is said of programs whose objective or rows are others, nor without work for it.
#[test]
fn others_have_no_bound() {
    for kind in ["market", "tolls", "design", "inverse"] {
        assert_eq!(solve(kind, 1, MpccSettings::default()).0.certificate.bound, None, "{kind}");
    }
    let (s, _) = solve("qpcc", 1, MpccSettings { branch_work: 0.0, ..MpccSettings::default() });
    assert!(s.certificate.bound.is_none() && s.found_by == FoundBy::Path);
}
